"""Functions of followers in certificates: accepted, read back, and refused where a number proves too much."""

from __future__ import annotations

import copy
import random
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from asked import certify_family, family_certificate
from mutations import Json, changed, resealed
from row_families import bounds_of, random_led

from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import check
from ptcc_certify.checker.reading import exact
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import FollowerFunction, follower_functions
from ptcc_certify.model import NominalProtocol
from ptcc_certify.theorems.family_behaviour import decide

KINDS = ("stability", "bipartite consensus", "bipartite containment")


def certificate(family: Family, losses: tuple[float, ...] = (0.01,)) -> Certificate:
    """With functions of followers alone."""
    x0 = tuple(Fraction(7 * k % 11 - 5, 2) for k in range(family.n_nodes))
    parts = [ComponentProof(c, tuple(follower_functions(c, losses)) if c.kernel else ()) for c in decide(family)]
    return family_certificate(family, NominalProtocol(T=1, rho1=1, rho2=30, kappa=3), tuple(parts), x0)


@cache
def document() -> Json:
    """A pair that leads, slower than its followers, and two followers."""
    edges = [
        ("a", "b", 1, 2),
        ("b", "a", -2, -1),
        ("c", "d", 1, 1),
        ("d", "c", 1, 2),
        ("c", "f", 2, 3),
        ("f", "e", 1, 4),
    ]
    family = Family.from_intervals([*edges, ("e", "f", 1, 2)])
    return {**certificate(family).to_dict(), "unverified": {}}


def refused(path: list[str | int], value: object) -> str | None:
    """Why the document with another value is refused."""
    report = check(resealed(changed(document(), tuple(path), value)))
    assert not report.accepted
    return report.reason


@pytest.mark.few(2)
@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("kind", KINDS)
def test_functions_of_followers_are_accepted(kind, count):
    found = 0
    for seed in range(count):
        cert = certificate(random_led(random.Random(seed), kind))
        found += bool(cert.parts[0].functions)
        assert cert.checked.accepted, cert.checked.reason
        assert check(cert.to_dict(), stdlib=True).accepted
    assert found > count - 2


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_more_functions_of_followers_are_accepted(kind):
    for seed in range(4, 80):
        cert = certificate(random_led(random.Random(seed), kind), (0.01, 0.3))
        assert cert.checked.accepted, (seed, cert.checked.reason)


def test_numbers_that_prove_too_much_are_refused():
    data = document()
    assert check(data).accepted
    (k,) = [k for k, V in enumerate(data["decays"]) if V["class"] == "rows" and V["parts"]]
    V, of = data["decays"][k], ["decays", k]
    part = V["parts"][0]
    assert "rate" in refused([*of, "rate"], str(exact(V["rate"]) * 2))
    assert "positive" in refused([*of, "vector", 0], "0")
    assert "positive" in refused([*of, "vector", 0], str(-exact(V["vector"][0])))
    assert "row" in refused([*of, "vector", 0], str(exact(V["vector"][0]) / 3))
    assert "bound of an agent" in refused([*of, "parts", 0, "times"], str(exact(part["times"]) * 2))
    for i, bound in enumerate(part["bounds"]):
        assert "bound of an agent" in refused([*of, "parts", 0, "bounds", i], str(exact(bound) * Fraction(9, 10)))
    # the first is how fast the pivot moves, and with it all targets; the other agent is heard by no follower
    assert "row" in refused([*of, "parts", 0, "bounds", 0], str(exact(part["bounds"][0]) * 10**4))
    assert refused([*of, "parts"], []) == "an agent that is no follower hears others"
    assert refused([*of, "parts"], [part, part])


def test_a_rate_of_rows_above_the_proved_one_is_refused_in_both_places():
    data = copy.deepcopy(document())
    (step,) = [s for s in data["proof"] if s["kind"] == "family-rows"]
    (V,) = [V for V in data["decays"] if V["class"] == "rows"]
    rate = exact(V["rate"])
    V["rate"] = step["numbers"]["b"] = str(rate * Fraction(11, 10))
    assert check(resealed(data)).reason == "a row does not decay fast enough"
    V["rate"] = step["numbers"]["b"] = str(rate * 100)
    assert check(resealed(data)).reason == "a part that the followers hear is slower"
    V["rate"] = step["numbers"]["b"] = str(rate * Fraction(9, 10))
    assert check(resealed(data)).reason not in ("b is not the rate", "a row does not decay fast enough")


def test_files_are_read_back(tmp_path):
    cert = certificate(random_led(random.Random(1), "bipartite containment"))
    cert.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    (V,), (W,) = cert.parts[0].functions, again.parts[0].functions
    assert isinstance(W, FollowerFunction) and V.rate == W.rate
    assert [bounds_of(x) for x in (V.speeds, V.sizes)] == [bounds_of(x) for x in (W.speeds, W.sizes)]
    assert again.final_state == cert.final_state and again.input_peaks == cert.input_peaks
    remaining = np.linspace(0, 1, 5)
    assert (again.deviation_bound(remaining) == cert.deviation_bound(remaining)).all()


def test_a_large_family_gets_a_rate():
    rng = random.Random(0)
    n, leaders = 400, 4
    edges = [(k, (k + 1) % leaders, 1, 2) for k in range(leaders)]
    for t in range(leaders, n):
        edges += [(s, t, 2, 3) for s in sorted({rng.randrange(leaders), rng.randrange(t)})]
    cert = certify_family(Family.from_intervals(edges), NominalProtocol(T=1, rho1=1, rho2=9, kappa=3), [1.0] * n)
    assert cert.verdict == "certified" and cert.rate > Fraction(1, 2) and cert.bounded
    assert cert.final_state == ((1, 1),) * n
