"""Weighted sums of squares in certificates: of hundreds of agents, accepted, read back, refused where they say more."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family
from mutations import Json, changed, resealed
from row_families import bounds_of

from ptcc_certify.certificate import family_certification, section_io
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.graph_sections import certificate_family, family_claim_sections, family_section
from ptcc_certify.certificate.runs_against_bounds import compare
from ptcc_certify.checker import check
from ptcc_certify.checker.reading import exact
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.common_form_search import CommonFormSearch
from ptcc_certify.lyapunov.squares_function import SquaresFunction
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.simulation.run import simulate
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)


def random_core(seed: int, n: int, modes: int = 1, edges: int = 6) -> Family:
    """A ring of everybody and random edges, ``edges`` into each agent, of random signs, known to 5 %."""
    rng, made = random.Random(seed), []
    for _ in range(modes):
        rows = []
        for t in range(n):
            for s in sorted({(t - 1) % n, *rng.sample(range(n), edges - 1)} - {t}):
                w = rng.choice([-1, 1]) * Fraction(rng.randint(50, 150), 100)
                rows.append((s, t, *sorted((w * Fraction(19, 20), w * Fraction(21, 20)))))
        made.append(Family.from_intervals(rows, nodes=range(n)))
    return made[0] if modes == 1 else Family.switching(made)


def state(n: int) -> list[Fraction]:
    return [Fraction(7 * k % 11 - 5, 2) for k in range(n)]


@cache
def certificate(modes: int) -> Certificate:
    family = random_core(modes, 200 if modes == 1 else 300, modes)
    return certify_family(family, PROTOCOL, state(family.n_nodes))


@cache
def document() -> Json:
    return {**certificate(1).to_dict(), "unverified": {}}


@pytest.mark.few(1)
@pytest.mark.parametrize("modes", [1, 2])
def test_random_unbalanced_families_of_hundreds_of_agents_are_certified_with_a_rate(modes):
    cert = certificate(modes)
    (V,) = cert.parts[0].functions
    assert isinstance(V, SquaresFunction) and len(V.factors) == modes
    assert cert.verdict == "certified" and cert.bounded and cert.rate > 3
    assert cert.final_state == ((0, 0),) * cert.family.n_nodes and min(cert.input_peaks) > 0
    assert check(cert.to_dict(), stdlib=True).accepted
    assert np.isfinite(cert.deviation_bound([0.9, 0.1])).all()


@pytest.mark.parametrize("signal", ["random", "worst-case"])
def test_runs_of_hundreds_of_agents_stay_below_the_bounds(signal):
    cert = certificate(1)
    run = simulate(cert.family, PROTOCOL, state(200), signal, remaining=1e-2, samples=11)
    assert not compare(cert, run).violated


def test_sliding_variables_drive_them():
    family, n = random_core(3, 130), 130
    protocol = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
    cert = certify_family(family, protocol, state(n), sigma0=[k % 3 - 1 for k in range(n)])
    assert cert.verdict == "certified" and cert.drives is not None
    data = cert.to_dict()
    (c,) = data["drives"]
    less = changed(data, ("drives", 0), str(exact(c) * Fraction(99, 100)))
    assert check(resealed(less)).reason == "what drives the function is not proved"


def test_files_are_read_back(tmp_path: Path):
    cert = certificate(2)
    cert.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    (V,), (W,) = cert.parts[0].functions, again.parts[0].functions
    assert isinstance(W, SquaresFunction) and V.rate == W.rate and V.overshoot == W.overshoot
    assert [bounds_of(x) for x in (V.speeds, V.sizes)] == [bounds_of(x) for x in (W.speeds, W.sizes)]
    assert again.input_peaks == cert.input_peaks and again == cert
    assert (again.deviation_bound([0.5]) == cert.deviation_bound([0.5])).all()


def test_long_vectors_and_factors_go_to_side_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(section_io, "LONG", 100)
    cert = certify_family(certificate(1).family, PROTOCOL)
    cert.save(tmp_path / "c.json")
    assert {path.name.split("-", 1)[1] for path in tmp_path.glob("*.npy")} >= {"vector.npy", "data.npy", "indices.npy"}
    assert all(check(tmp_path / "c.json", stdlib=stdlib).accepted for stdlib in (True, False))
    assert read_certificate(tmp_path / "c.json").rate == cert.rate


# ---------------------------------------------------------------------- refused


def steps(data: Json) -> list[Any]:
    return [k for k, step in enumerate(data["proof"]) if step["kind"] == "family-squares"]


def reason(data: Json) -> str | None:
    one, other = check(resealed(data)), check(resealed(data), stdlib=True)
    assert not one.accepted and one.reason == other.reason
    return one.reason


def with_rate(data: Json, factor: Fraction) -> Json:
    rate = str(exact(data["decays"][0]["rate"]) * factor)
    data = changed(data, ("decays", 0, "rate"), rate)
    for k in steps(data):
        data = changed(data, ("proof", k, "numbers", "b"), rate)
    return data


def test_a_rate_above_the_proved_one_is_refused():
    data = document()
    unproved = "the rate of a mode is not proved by its factor"
    assert check(data | {"digest": resealed(data)["digest"]}).accepted
    assert reason(with_rate(data, 1 + Fraction(1, 10**4))) == unproved
    assert reason(with_rate(data, Fraction(2))) == unproved
    once = changed(data, ("decays", 0, "rate"), "5")
    assert reason(once) == "b is not the rate"


def test_a_smaller_rate_proves_less():
    assert check(resealed(with_rate(document(), Fraction(1, 2)))).accepted
    assert reason(with_rate(document(), Fraction(1, 10))) == "no rate proves that the input is bounded"


def test_other_vectors_are_refused():
    data, of = document(), ("decays", 0, "vector")
    p = data["decays"][0]["vector"]
    for k in (0, 120):
        for factor in (Fraction(9, 10), Fraction(11, 10)):
            assert reason(changed(data, (*of, k), str(exact(p[k]) * factor)))
        assert reason(changed(data, (*of, k), "0")) == "the vector is not positive"
        assert reason(changed(data, (*of, k), str(-exact(p[k])))) == "the vector is not positive"
    assert reason(changed(data, of, p[:-1])) == "vector has not 200 entries"


def test_other_factors_are_refused():
    data = document()
    (k,) = steps(data)
    of = ("proof", k, "witness", "factor")
    factor = data["proof"][k]["witness"]["factor"]
    draw = random.Random(0)
    for place in draw.sample(range(len(factor["data"])), 2):
        value = factor["data"][place]
        for new in (value + 2**36, -value - 2**36):
            assert reason(changed(data, (*of, "data", place), new))
    for key in ("order", "exponents", "indices", "indptr"):
        new = list(factor[key])
        new[3], new[40] = new[40], new[3]
        if new != factor[key]:
            assert reason(changed(data, (*of, key), new))
    assert reason(changed(data, (*of, "exponents", 5), factor["exponents"][5] + 1))
    assert reason(changed(data, (*of, "power"), factor["power"] + 1))
    assert reason(changed(data, (*of, "bits"), factor["bits"] - 1))
    assert reason(changed(data, (*of, "parents"), [-1, *range(199)])) == "parents of no leader group"
    for new in (None, 1, "x", [], {}):
        assert reason(changed(data, of, new))


def test_other_weights_of_the_graph_are_refused():
    data = document()
    for k in (0, 600):
        edges = [list(row) for row in data["problem"]["graph"]["modes"][0]["edges"]]
        ends = list(map(Fraction, edges[k][2:]))
        wide = [end * (1 if end == min(ends, key=abs) else 30) for end in ends]
        edges[k][2:] = list(map(str, wide))
        modes = [{**data["problem"]["graph"]["modes"][0], "edges": edges}]
        family = certificate_family(data["problem"]["graph"] | {"modes": modes}, {})
        out = section_io.Writer(family.labels)
        sections = family_claim_sections(family, decide(family), out)
        other = changed({**data, **sections}, ("problem", "graph"), family_section(family, out))
        assert reason(other) == "the rate of a mode is not proved by its factor"


def test_a_sum_of_squares_of_agents_that_agree_is_refused():
    n = 130
    ring = Family.from_intervals([(k, (k + 1) % n, 1, 1) for k in range(n)])
    data = {**certify_family(ring, PROTOCOL).to_dict(), "unverified": {}}
    V = {"class": "squares", "component": 0, "vector": ["1"] * n, "rate": "0"}
    assert reason(changed(data, ("decays",), [V])) == "a sum of squares where not all agents end at 0"


def test_small_families_take_it_where_the_search_finds_nothing_and_else_what_was_found(monkeypatch):
    family = random_core(0, 8, edges=2)
    found = certify_family(family, PROTOCOL)
    monkeypatch.setattr(family_certification, "search_common_forms", lambda *args, **keywords: CommonFormSearch())
    cert = certify_family(family, PROTOCOL)
    assert [V.kind for V in cert.parts[0].functions] == ["squares"] and cert.verdict == "certified"
    assert 0 < cert.rate <= found.rate and all(V.kind != "squares" for V in found.parts[0].functions)
