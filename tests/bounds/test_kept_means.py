"""Means that every signal keeps: circulations, undirected graphs, followers beside; and where agents end by them."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from asked import certify_family, family_certificate
from row_families import laplacian, random_interval, random_led, random_vertex
from scipy.linalg import expm

from ptcc_certify import NominalProtocol
from ptcc_certify.bounds.final_state.constant_weights import leading_groups
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import check, digest
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.common_forms import CommonForm
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)


def circulations(rng: random.Random) -> tuple[Family, list[Fraction]]:
    """One to three modes that share ``p``, cycles of constant flow ``p_t |w|``, and a follower of one of them."""
    n = rng.randint(2, 5)
    p = [Fraction(rng.randint(1, 30), rng.randint(1, 9)) for _ in range(n)]
    camps = [rng.choice([1, -1]) for _ in range(n + 1)]
    modes = []
    for _ in range(rng.randint(1, 3)):
        flow: dict[tuple[int, int], Fraction] = {}
        for size in (n, *(rng.randint(2, n) for _ in range(2))):
            cycle, amount = rng.sample(range(n), size), Fraction(rng.randint(1, 9)) * Fraction(10) ** rng.randint(-2, 2)
            for s, t in zip(cycle, cycle[1:] + cycle[:1], strict=True):
                flow[s, t] = flow.get((s, t), Fraction(0)) + amount
        edges = [(s, t, *[camps[s] * camps[t] * f / p[t]] * 2) for (s, t), f in flow.items()]
        parent = rng.randrange(n)
        low, high = random_interval(rng, True)
        edges.append((parent, n, *sorted(camps[parent] * camps[n] * w for w in (low, high))))
        modes.append(Family.from_intervals(edges, nodes=range(n + 1)))
    return Family.switching(modes), p


def undirected(rng: random.Random) -> Family:
    """A tree whose edges are uncertain, and optional edges beside it."""
    n = rng.randint(2, 6)
    camps = [rng.choice([1, -1]) for _ in range(n)]
    modes = []
    for _ in range(rng.randint(1, 2)):
        tree = {(rng.randrange(t), t) for t in range(1, n)}
        more = {(s, t) for s in range(n) for t in range(s + 1, n) if rng.random() < 0.3}
        edges = []
        for s, t in tree | more:
            low, high = random_interval(rng, (s, t) in tree)
            edges.append((s, t, *sorted(camps[s] * camps[t] * w for w in (low, high))))
        modes.append(Family.from_intervals(edges, nodes=range(n), undirected=True))
    return Family.switching(modes)


def end_of_a_signal(rng: random.Random, family: Family, x: list[Fraction]) -> np.ndarray:
    X = np.array([float(v) for v in x])
    for _ in range(10):
        mode = rng.choice(family.modes)
        X = expm(-laplacian(mode, random_vertex(rng, mode)) * rng.choice([0.01, 0.1, 1])) @ X
    step = expm(-laplacian(family.modes[0], random_vertex(rng, family.modes[0])))
    return np.linalg.matrix_power(step, 100_000) @ X


def plain(family: Family, x: list[Fraction]) -> Certificate:
    """A certificate without any Lyapunov function."""
    return family_certificate(family, PROTOCOL, tuple(map(ComponentProof, decide(family))), tuple(x))


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(12))
def test_every_signal_keeps_the_mean_of_a_circulation(seed: int):
    rng = random.Random(seed)
    family, p = circulations(rng)
    (group,) = leading_groups(decide(family)[0])
    assert group.vector is not None
    size = [v for v in group.vector if v]
    assert [v * p[0] for v in size] == [size[0] * q for q in p]  # nobody hears the follower
    x = [Fraction(rng.randint(-20, 20), 3) for _ in range(family.n_nodes)]
    certificate = plain(family, x)
    assert certificate.checked is not None and certificate.checked.accepted, certificate.checked
    ends = certificate.final_state
    assert ends is not None and all(low == high for low, high in filter(None, ends))
    X = end_of_a_signal(rng, family, x)
    assert np.allclose(X, [float(low) for low, _ in filter(None, ends)], atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_undirected_graphs_end_at_the_mean_whatever_the_signal(seed: int):
    rng = random.Random(seed)
    family = undirected(rng)
    x = [Fraction(rng.randint(-20, 20)) for _ in range(family.n_nodes)]
    certificate = plain(family, x)
    g = [int(v) for v in certificate.parts[0].component.gauge]
    mean = sum(a * b for a, b in zip(g, x, strict=True)) / len(x)
    assert certificate.final_state == tuple((a * mean, a * mean) for a in g)
    assert certificate.checked is not None and certificate.checked.accepted
    assert np.allclose(end_of_a_signal(rng, family, x), [float(a * mean) for a in g], atol=1e-6)


def test_one_uncertain_direction_or_another_vector_keeps_no_mean():
    cycle = [("a", "b", 1, 1), ("b", "c", 1, 1), ("c", "a", 1, 1)]
    for edges in ([*cycle[:2], ("c", "a", 1, 2)], [*cycle, ("a", "c", 0, 1)]):
        assert leading_groups(decide(Family.from_intervals(edges))[0])[0].vector is None
    other = [("a", "b", 1, 1), ("b", "c", 1, 1), ("c", "a", 2, 2)]
    both = Family.switching([Family.from_intervals(cycle), Family.from_intervals(other)])
    assert leading_groups(decide(both)[0])[0].vector is None
    pairs = Family.from_intervals([("a", "b", 1, 3)], undirected=True)
    apart = Family.from_intervals([("a", "b", 1, 3), ("b", "a", 1, 3)])
    assert leading_groups(decide(pairs)[0])[0].vector == (1, 1)
    assert leading_groups(decide(apart)[0])[0].vector is None


@pytest.mark.parametrize("seed", range(10))
def test_followers_of_several_groups_end_between_combinations_of_these(seed: int):
    rng = random.Random(seed)
    family = random_led(rng, "bipartite containment")
    x = [Fraction(rng.randint(-20, 20)) for _ in range(family.n_nodes)]
    certificate = plain(family, x)
    assert certificate.checked is not None and certificate.checked.accepted, certificate.checked
    ends = certificate.final_state
    assert ends is not None and None not in ends
    for _ in range(3):
        X = end_of_a_signal(rng, family, x)
        assert all(low - 1e-6 <= X[k] <= high + 1e-6 for k, (low, high) in enumerate(filter(None, ends)))


def test_followers_of_leaders_that_keep_their_values_end_at_a_point():
    rows = [(1, 3, 1), (2, 3, 3), (3, 4, 1), (1, 5, -1), (4, 5, -1)]
    day = [(s, t, w, w) for s, t, w in rows]
    night = [(s, t, 7 * w, 7 * w) for s, t, w in rows]
    family = Family.switching([Family.from_intervals(day), Family.from_intervals(night)])
    certificate = certify_family(family, PROTOCOL, [1, 5, 99, -99, 0])
    assert certificate.verdict == "certified"
    assert certificate.final_state == tuple((Fraction(v),) * 2 for v in (1, 5, 4, 4, Fraction(-5, 2)))


@pytest.mark.few(0)
def test_weights_known_to_a_part_leave_the_mean_nearly_kept():
    """The ends without the mean are those of deviations of single agents; the mean narrows them to half and less."""
    rng = random.Random(2)
    cycle = [(k, (k + 1) % 5, 3, 3) for k in range(5)] + [(0, 2, 1, 1)]
    family = Family.from_intervals([(s, t, low * Fraction(19, 20), low * Fraction(21, 20)) for s, t, low, _ in cycle])
    x = [Fraction(v) for v in (5, -3, 8, 0, -9)]
    certificate = certify_family(family, PROTOCOL, x)
    bare = certificate.changed(parts=tuple(replace(p, functions=stripped(p)) for p in certificate.parts))
    assert certificate.verdict == bare.verdict == "certified"
    assert certificate.final_state is not None and bare.final_state is not None
    (low, high), (before, after) = (ends for c in (certificate, bare) if (ends := c.final_state[0]) is not None)
    assert before <= low < high <= after and high - low < (after - before) / 2
    for _ in range(5):
        assert low - 1e-6 <= end_of_a_signal(rng, family, x)[0] <= high + 1e-6
    data = certificate.to_dict()
    data["decays"][0]["means"][0]["constant"] = "0"
    assert "of an input or a mean" in str(answer(data))


def stripped(part: ComponentProof) -> tuple[CommonForm, ...]:
    return tuple(replace(V, means=()) for V in part.functions if isinstance(V, CommonForm))


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("mean", "why"),
    [
        ({"weights": {}, "constant": "1"}, "weights of a mean"),
        ({"weights": {"1": "0"}, "constant": "1"}, "weight 0"),
        ({"weights": {"1": "1", "3": "1"}, "constant": "9999"}, "several groups"),
        ({"weights": {"1": "1", "2": "1"}, "constant": "9999"}, "several groups"),
        ({"weights": {"1": "1", "4": "1"}, "constant": "9999"}, None),
        ({"weights": {"1": "1"}, "constant": "0"}, None),
        ({"weights": {"1": "1"}}, "constant"),
    ],
)
def test_a_mean_is_of_agents_of_one_group(mean: dict[str, Any], why: str | None):
    """1 and 2 lead, 3 hears both, 4 hears 1."""
    family = Family.from_intervals([(1, 3, 1, 1), (2, 3, 1, 1), (1, 4, 1, 2)])
    data = certify_family(family, PROTOCOL, [1, 2, 3, 4]).to_dict()
    data["decays"][0]["means"] = [mean]
    found = answer(data)
    assert found is None if why is None else why in str(found)


# ---------------------------------------------------------------------- the check


def witness_of(data: dict[str, Any]) -> dict[str, Any]:
    return next(step for step in data["proof"] if step["kind"] == "family-final-state")


def answer(data: dict[str, Any]) -> str | None:
    return check(data | {"digest": digest(data)}).reason


def test_a_mean_that_is_not_kept_is_refused():
    x = [Fraction(4), Fraction(8), Fraction(0)]
    signed = Family.from_intervals([("a", "b", -1, -1), ("b", "a", -3, -3), ("b", "c", -2, -1)])
    data = plain(signed, x).to_dict()
    step = witness_of(data)
    assert answer(data) is None and step["witness"] == [{"1": {"a": "1", "b": "-3"}}]
    for entry, why in (
        ("equal", "not kept"),
        ({"a": "1", "b": "3"}, "not kept"),
        ({"a": "1", "b": "-2"}, "not kept"),
        ({"a": "0", "b": "0"}, "weight 0"),
        ({}, "weight 0"),
        ({"a": "1", "b": "-3", "c": "1"}, "does not hear"),
        ({"a": "1", "z": "-3"}, "unknown node"),
        (3, "not one of equal"),
        (["a"], "unknown node"),
    ):
        step["witness"] = [{"1": entry}]
        assert why in str(answer(data)), entry
    for witness, why in (
        ([{"2": "equal"}], "means of a component"),
        ([], "means has not 1 entries"),
        ([None], "not enclosed"),
        (None, "witness is null, and not left out"),
        ({"1": "equal"}, "not a list"),
        ([["equal"]], "numbers as keys"),
    ):
        step["witness"] = witness
        assert why in str(answer(data)), witness
    del step["witness"]
    assert "not enclosed" in str(answer(data))


def test_a_mean_that_an_uncertain_edge_changes_is_refused():
    x = [Fraction(0), Fraction(6)]
    tied = plain(Family.from_intervals([("a", "b", 1, 9)], undirected=True), x).to_dict()
    assert answer(tied) is None and witness_of(tied)["witness"] == [{"1": "equal"}]
    assert tied["final_state"] == {"a": "3", "b": "3"}
    apart = plain(Family.from_intervals([("a", "b", 1, 9), ("b", "a", 1, 9)]), x).to_dict()
    assert answer(apart) is None
    witness_of(apart)["witness"], apart["final_state"] = [{"1": "equal"}], tied["final_state"]
    assert "an uncertain edge changes" in str(answer(apart))
