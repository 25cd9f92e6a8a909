"""Where families end: all vertices, boxes that attract, intervals about weighted means."""

from __future__ import annotations

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest
from row_families import (
    laplacian,
    random_consensus,
    random_followers,
    random_state,
    random_vertex,
    values_of_vertices,
    vertices,
)
from scipy.linalg import expm

import ptcc_certify.bounds.final_state.constant_weights as module
from ptcc_certify.bounds.final_state.attracting_box import AttractingBox, attracting_box, invariant_intervals
from ptcc_certify.bounds.final_state.constant_weights import value_ends
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import follower_decay

# ---------------------------------------------------------------------- constant weights


def compare_with_vertices(seed: int) -> None:
    rng = random.Random(seed)
    family = random_consensus(rng)
    x = random_state(rng, family.n_nodes)
    ends = value_ends(family.modes[0], x)
    values = values_of_vertices(family.modes[0], [g * v for g, v in zip(ends.camps, x, strict=True)])
    assert ends.within == 0 and (ends.lower, ends.upper) == (min(values), max(values))


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(40))
def test_final_values_are_those_of_all_vertices(seed):
    compare_with_vertices(seed)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(40, 400))
def test_final_values_are_those_of_all_vertices_of_more_graphs(seed):
    compare_with_vertices(seed)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_final_values_of_large_groups_enclose_the_vertices_closely(seed, monkeypatch):
    monkeypatch.setattr(module, "EXACT_NODES", 0)
    rng = random.Random(seed)
    family = random_consensus(rng)
    x = random_state(rng, family.n_nodes)
    ends = value_ends(family.modes[0], x)
    values = values_of_vertices(family.modes[0], [g * v for g, v in zip(ends.camps, x, strict=True)])
    low, high = min(values), max(values)
    assert ends.lower <= low <= ends.lower + ends.within and ends.upper - ends.within <= high <= ends.upper
    assert max(low - ends.lower, ends.upper - high) < 1e-6


def test_followers_have_no_say_and_camps_turn_the_interval():
    family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, -1), ("b", "c", 5, 9)])
    ends = value_ends(family.modes[0], [Fraction(0), Fraction(6), Fraction(100)])
    assert ends.final_states == [(-3, -2), (2, 3), (2, 3)] and ends.nodes == (0, 1)


def test_undirected_edges_keep_the_mean_where_directions_apart_would_not():
    edges = [("a", "b", 1, 9)]
    x = [Fraction(0), Fraction(1)]
    tied = value_ends(Family.from_intervals(edges, undirected=True).modes[0], x)
    apart = value_ends(Family.from_intervals([*edges, ("b", "a", 1, 9)]).modes[0], x)
    assert tied.within == 0 and tied.lower == tied.upper == Fraction(1, 2)
    assert (apart.lower, apart.upper) == (Fraction(1, 10), Fraction(9, 10))


def test_weights_that_change_leave_the_interval_of_constant_ones():
    """By a quarter of its length: agent 1 first listens as much as it can, then agent 2 listens to agent 1."""
    family = Family.from_intervals([(0, 1, 1, 2), (1, 2, 1, 2), (2, 0, 1, 2), (2, 1, 1, 2)])
    value = value_ends(family.modes[0], [Fraction(2), Fraction(-1), Fraction(1)])
    assert (value.lower, value.upper) == (Fraction(2, 5), 1)
    first, then = (np.array([[1, 0, -1], [-2, d, 2 - d], [0, -w, w]]) for d, w in ((4, 1), (3, 2)))
    X = expm(-100.0 * then) @ expm(-0.4 * first) @ [2, -1, 1]
    assert X.min() > 1.14


@pytest.mark.parametrize(
    "edges", [[("a", "b", 1, 1), ("b", "a", -1, -1)], [("a", "c", 1, 1), ("b", "c", 1, 2)], [("a", "b", -1, 1)]]
)
def test_a_mode_without_consensus_has_no_final_value(edges):
    family = Family.from_intervals(edges)
    with pytest.raises(HypothesisError):
        value_ends(family.modes[0], [Fraction(1)] * family.n_nodes)


# ---------------------------------------------------------------------- boxes


def rows_hold(family: Family, lower: dict[int, Fraction], upper: dict[int, Fraction], nodes: list[int]) -> bool:
    """Compare every row of a box with all vertices of the weights of that row."""
    for mode in family.modes:
        for k in nodes:
            own = np.flatnonzero(mode.target == k).tolist()
            for bits in itertools.product([False, True], repeat=len(own)):
                up = down = Fraction(0)
                for e, largest in zip(own, bits, strict=True):
                    w, s = (mode.upper if largest else mode.lower).fraction(e), int(mode.source[e])
                    high, low = (upper[s], lower[s]) if mode.sign[e] > 0 else (-lower[s], -upper[s])
                    up, down = up + w * (high - upper[k]), down + w * (low - lower[k])
                if up > 0 or down < 0:
                    return False
    return True


def box_along_signals(seed: int) -> int:
    rng = random.Random(seed)
    leaders = rng.randint(1, 2)
    family = random_followers(rng, rng.choice([1, 1, 2]), leaders, rng.random() < 0.5)
    decay = follower_decay(family, np.arange(leaders, family.n_nodes))
    if decay is None:
        return 0
    x = random_state(rng, family.n_nodes)
    ends = invariant_intervals(family, decay.nodes, x)
    box = attracting_box(family, decay, ends)
    nodes = decay.nodes.tolist()
    lower = {k: low for k, (low, _) in ends.items()} | dict(zip(nodes, box.lower, strict=True))
    upper = {k: high for k, (_, high) in ends.items()} | dict(zip(nodes, box.upper, strict=True))
    assert rows_hold(family, lower, upper, nodes)
    X, s, start = np.array([float(v) for v in x]), 0.0, float(box.excess(x))
    for _ in range(12):
        mode = rng.choice(family.modes)
        h = rng.choice([0.01, 0.1, 1])
        X, s = expm(-laplacian(mode, random_vertex(rng, mode)) * h) @ X, s + h
        excess = float(box.excess([Fraction(v) for v in X.tolist()]))
        floats = 1e-10 / float(decay.vector.min())  # the motion is one in floats
        assert excess <= start * np.exp(-float(decay.rate) * s) * (1 + 1e-9) + floats
    return 1


@pytest.mark.few(0)
def test_boxes_attract_followers_along_random_signals():
    assert sum(box_along_signals(seed) for seed in range(15)) > 8


@pytest.mark.campaign
def test_boxes_attract_followers_along_more_signals():
    assert sum(box_along_signals(seed) for seed in range(15, 400)) > 200


def test_a_box_is_as_close_where_the_vector_of_the_decay_has_a_huge_range():
    """At 1 - 1e-6 of the largest rate one agent is 3e9 times another one in ``d``; the box does not care."""
    edges = [(0, 2, -1350, -270), (1, 2, "-5/2", "-1/2"), (4, 2, 2, 2), (0, 3, "-13/100", "-13/500")]
    edges += [(0, 4, -5, "-5/2"), (1, 5, "9/5", "9/5"), (3, 5, "-6/5", "-3/5"), (4, 5, "-2/25", 0)]
    family = Family.from_intervals(edges, nodes=range(6))
    decay = follower_decay(family, np.arange(2, 6))
    ends = {0: (Fraction(-8, 3), Fraction(-8, 3)), 1: (Fraction(6, 7), Fraction(6, 7))}
    box = attracting_box(family, decay, ends)
    assert decay.overshoot > 1e9
    assert attained(family, box, [-8 / 3, 6 / 7])
    assert float(box.upper[1]) == pytest.approx(8 / 3)


def test_constant_weights_attain_a_box_of_one_mode_with_camps():
    edges = [("a", "c", 1, 3), ("b", "c", -2, -1), ("c", "d", 1, 4), ("a", "d", 1, 1)]
    family = Family.from_intervals(edges, nodes="abcd")
    decay = follower_decay(family)
    box = attracting_box(family, decay, {0: (Fraction(0), Fraction(0)), 1: (Fraction(4), Fraction(4))})
    assert attained(family, box, [0, 4])


def attained(family: Family, box: AttractingBox, outside: list[float]) -> bool:
    """Tell whether constant weights, all at one end, take every agent to both of its ends of the box."""
    ends = []
    for largest in vertices(family.modes[0]):
        L = laplacian(family.modes[0], largest)
        ends.append(np.linalg.solve(L[2:, 2:], -L[2:, :2] @ outside))
    upper, lower = (np.array([float(v) for v in side]) for side in (box.upper, box.lower))
    return np.allclose(upper, np.max(ends, axis=0), atol=1e-9) and np.allclose(lower, np.min(ends, axis=0), atol=1e-9)


def test_two_modes_may_need_less_than_their_box():
    """The box lets each row choose its mode, 1 and 1; no signal keeps both agents up."""
    first = Family.from_intervals([("a", "c", 1, 1), ("b", "d", 1, 1)], nodes="abcd")
    second = Family.from_intervals([("b", "c", 1, 1), ("a", "d", 1, 1)], nodes="abcd")
    family = Family.switching([first, second])
    decay = follower_decay(family, np.array([2, 3]))
    box = attracting_box(family, decay, {0: (Fraction(0), Fraction(0)), 1: (Fraction(1), Fraction(1))})
    assert all(float(u) == pytest.approx(1) for u in box.upper)


def test_the_choice_of_weights_is_repeated_until_it_stands():
    """One step with an end that is too large undershoots: there only the leader at 1 is listened to with ``w+``."""
    family = Family.from_intervals([("a", "d", 1, 1), ("b", "d", 1, 2), ("c", "d", 1, 2)], nodes="abcd")
    decay = follower_decay(family)
    points = {k: (Fraction(v), Fraction(v)) for k, v in enumerate(("0", "3/5", "1"))}
    box = attracting_box(family, decay, points)
    values = [(0.6 * v + w) / (1 + v + w) for v, w in itertools.product((1, 2), repeat=2)]
    assert float(box.upper[0]) == pytest.approx(max(values), abs=1e-9)


def test_a_box_is_built_on_intervals_that_hold_from_the_beginning():
    """The limit of the leaders, or an interval about it, is left at first, and so is a box on it."""
    family = Family.from_intervals([("a", "b", 1, 1), ("b", "a", 1, 1), ("a", "c", 1, 2)])
    x = [Fraction(0), Fraction(2), Fraction(1)]
    decay = follower_decay(family)
    limit = attracting_box(family, decay, {0: (Fraction(1), Fraction(1)), 1: (Fraction(1), Fraction(1))})
    box = attracting_box(family, decay, invariant_intervals(family, decay.nodes, x))
    X = [Fraction(v) for v in (expm(-0.4 * laplacian(family.modes[0], np.zeros(3, bool))) @ [0, 2, 1]).tolist()]
    assert limit.excess(x) < 1e-9 / int(decay.vector[0]) < 0.1 / int(decay.vector[0]) < limit.excess(X)
    assert box.excess(x) == box.excess(X) == 0


def test_a_box_needs_the_intervals_of_all_others():
    family = Family.from_intervals([("a", "c", 1, 1), ("b", "c", 1, 1)], nodes="abc")
    with pytest.raises(ValueError, match="all agents that are no followers"):
        attracting_box(family, follower_decay(family), {0: (Fraction(0), Fraction(0))})


def test_parts_without_camps_stay_within_their_largest_size():
    family = Family.from_intervals([("a", "b", 1, 1), ("b", "a", -1, -1), ("b", "c", 1, 1)])
    x = [Fraction(1), Fraction(-3), Fraction(9)]
    assert invariant_intervals(family, np.array([2]), x) == {0: (-3, 3), 1: (-3, 3)}
