"""Rows of families: the decay of followers against all vertices, and functions of followers along random signals."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from row_families import bounds_of, laplacian, random_followers, random_led, random_vertex, vertices
from scipy.linalg import expm

from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.common_form_search import common_left_vector
from ptcc_certify.lyapunov.follower_function import (
    FollowerDecay,
    follower_decay,
    follower_functions,
    follower_nodes,
    least_rate,
    prove_follower_decay,
)
from ptcc_certify.lyapunov.follower_rows import IntervalRows
from ptcc_certify.theorems.family_behaviour import decide

KINDS = ("stability", "bipartite consensus", "bipartite containment")


def least_eigenvalue(family: Family, nodes: np.ndarray) -> float:
    """Of the block of the followers, over all vertices of the one mode."""
    mode = family.modes[0]
    blocks = (laplacian(mode, largest)[np.ix_(nodes, nodes)] for largest in vertices(mode))
    return min(float(np.linalg.eigvals(block).real.min()) for block in blocks)


def compare(seed: int) -> None:
    family = random_followers(random.Random(seed))
    decay = follower_decay(family)
    assert decay is not None
    best = least_eigenvalue(family, decay.nodes)
    assert 0.999 * best < float(decay.rate) <= best * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(25))
def test_followers_decay_at_the_least_rate_of_all_vertices_and_no_faster(seed):
    compare(seed)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(25, 325))
def test_followers_decay_at_the_least_rate_of_more_vertices(seed):
    compare(seed)


def test_the_largest_weights_lead_to_the_slowest_agent():
    """|w+| where d_l > d_k: an agent that listens more to a slow one is slower."""
    decay = follower_decay(Family.from_intervals([("a", "b", 2, 2), ("b", "c", 1, 1), ("c", "b", 1, 9)]))
    least = follower_decay(Family.from_intervals([("a", "b", 2, 2), ("b", "c", 1, 1), ("c", "b", 1, 1)]))
    assert decay.rate < least.rate / 2


def test_a_rate_above_that_of_the_rows_is_refused():
    """The exact pass tells what a vector proves: nothing that a member contradicts."""
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2), ("c", "b", 1, 2)])
    rows = IntervalRows.of(family.modes, np.array([1, 2]))
    best = least_eigenvalue(family, np.array([1, 2]))
    rng = np.random.default_rng(0)
    for _ in range(200):
        assert least_rate(rows, rng.integers(1, 1000, 2)) <= best


def test_integers_that_overflow_64_bits_prove_the_same():
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 3), ("c", "b", 1, 2)])
    rows = IntervalRows.of(family.modes, np.array([1, 2]))
    d = np.array([3, 5])
    large = d.astype(object) * 2**80
    assert least_rate(rows, d) == least_rate(rows, d << 58) == least_rate(rows, large)
    wide = Family.from_intervals([("a", "b", 10**30, 10**31), ("b", "c", "1e-30", "2e-30")])
    assert follower_decay(wide).rate <= Fraction(1, 10**30)


def test_weights_of_floats_and_of_long_fractions_are_taken_exactly():
    for low, high in ((0.1, 0.3), (Fraction(1, 3**40), Fraction(1, 7**20))):
        family = Family.from_intervals([("a", "b", low, high)])
        exact = family.modes[0].lower.fraction(0)
        assert prove_follower_decay(
            IntervalRows.of(family.modes, np.array([1])), np.array([1]), np.array([1.0])
        ).rate in (
            exact,
            pytest.approx(exact, rel=1e-15),
        )
        assert least_rate(IntervalRows.of(family.modes, np.array([1])), np.array([7])) == exact


# ---------------------------------------------------------------------- traps


def test_a_weight_of_unknown_sign_makes_a_larger_family():
    family = Family.from_intervals([("a", "b", 1, 1), ("b", "c", -1, 2), ("c", "b", 1, 1), ("a", "c", 1, 1)])
    decay = follower_decay(family)
    assert decay.rate > 0


def test_undirected_edges_are_one_parameter_so_that_rows_are_sufficient_only():
    """The rows take the directions apart: their least value may be below that of every member."""
    edges = [("a", "b", 1, 1), ("b", "c", 1, 9)]
    both = Family.from_intervals(edges, undirected=True)
    mode = both.modes[0]
    keep = np.flatnonzero(mode.target > 0)
    parts = [getattr(mode, end)[keep] for end in ("source", "target", "sign")]
    led = Family(
        (
            replace(
                mode,
                source=parts[0],
                target=parts[1],
                sign=parts[2],
                lower=mode.lower.take(keep),
                upper=mode.upper.take(keep),
            ),
        )
    )
    decay = follower_decay(led, np.array([1, 2]))
    assert decay.rate > 0
    levels = [laplacian(led.modes[0], np.full(keep.size, high))[1:, 1:] for high in (False, True)]
    assert float(decay.rate) < 0.9 * min(np.linalg.eigvals(block).real.min() for block in levels)


def test_rows_of_several_modes_may_fail_where_all_modes_decay():
    first = Family.from_intervals([("a", "b", 1, 1), ("b", "c", 1, 1)], nodes="abc")
    second = Family.from_intervals([("a", "c", 1, 1), ("c", "b", 1, 1)], nodes="abc")
    assert follower_decay(first) is not None and follower_decay(second) is not None
    assert follower_decay(Family.switching([first, second])) is None
    same = follower_decay(Family.switching([first, first]))
    assert same.rate > 0


def test_leaders_and_unbalanced_blocks_are_no_followers():
    ring = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -2, -1)])
    assert follower_nodes(ring).size == 0 and follower_decay(ring) is None
    assert follower_decay(ring, np.array([0, 1])) is None  # no weight goes out of the block
    with pytest.raises(ValueError, match="outside"):
        follower_decay(ring, np.array([1]))


def test_an_outage_leaves_no_rate():
    on = Family.from_intervals([("a", "b", 1, 2)])
    off = Family.from_intervals([], nodes="ab")
    assert follower_decay(Family.switching([on, off]), np.array([1])) is None


def test_one_uncertain_direction_keeps_no_left_vector():
    """A path whose directions change by themselves: the least weights would claim 0.586, a member has less."""
    path = [(a, b, 1, 10) for a, b in ((0, 1), (1, 2), (2, 3))]
    assert common_left_vector(Family.from_intervals(path, undirected=True)) is not None
    apart = Family.from_intervals([*path, *((b, a, low, high) for a, b, low, high in path)])
    assert common_left_vector(apart) is None
    single = Family.from_intervals([*path[1:], (0, 1, 1, 1), *((b, a, 1, 1) for a, b, *_ in path)])
    assert common_left_vector(single) is None
    slowest = min(sorted(np.linalg.eigvals(laplacian(apart.modes[0], v)).real)[1] for v in vertices(apart.modes[0]))
    assert slowest < 0.2 < 0.58 < sorted(np.linalg.eigvals(laplacian(apart.modes[0], np.zeros(6, bool))).real)[1]


# ---------------------------------------------------------------------- functions of followers


def follow(seed: int, kind: str) -> int:
    """Compare functions of followers with a random signal; return how many there are."""
    rng = random.Random(seed)
    count = 0
    for component in decide(random_led(rng, kind)):
        assert component.behaviour == kind
        for W in follower_functions(component):
            n = W.family.n_nodes
            x = [Fraction(rng.randint(-20, 20), 3) for _ in range(n)]
            speeds, sizes = (bounds_of(some) for some in (W.speeds, W.sizes))
            X, start, s = np.array([float(v) for v in x]), float(W.root(x)), 0.0
            for _ in range(8):
                L = laplacian(mode := rng.choice(W.family.modes), random_vertex(rng, mode))
                bound = start * np.exp(-float(W.rate) / 2 * s)
                if bound > 1e-6 * start > 0:
                    assert float(W.root([Fraction(v) for v in X.tolist()])) <= bound * (1 + 1e-6)
                    assert all(abs((L @ X)[k]) <= speeds[k] * bound * (1 + 1e-6) + 1e-9 for k in range(n))
                    rest = [c.nodes[0] for c in W.kernel.structure.closed_components if c.balanced]
                    xi = X - np.array([[float(b) for b in W.kernel.row(k)] for k in range(n)]).reshape(n, -1) @ X[rest]
                    assert all(abs(xi[k]) <= sizes.get(k, 0) * bound * (1 + 1e-6) + 1e-9 for k in range(n))
                h = rng.choice([0.01, 0.1, 0.5])
                X, s = expm(-L * h) @ X, s + h
            count += 1
    return count


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", KINDS)
def test_functions_of_followers_decay_along_random_signals(kind):
    assert sum(follow(seed, kind) for seed in range(3)) > 1


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_functions_of_followers_decay_along_more_signals(kind):
    assert sum(follow(seed, kind) for seed in range(3, 100)) > 20


def test_a_group_that_moves_slows_its_followers():
    """The target of the followers moves while the group agrees: the rate is at most that of the group."""
    slow = [("a", "b", "1/10", "1/10"), ("b", "a", "1/10", "1/10"), ("b", "c", 5, 6)]
    (W,) = list(follower_functions(decide(Family.from_intervals(slow))[0], losses=[0.01]))
    assert W.rate <= min(part.function.rate for part in W.parts) == pytest.approx(0.4, rel=1e-6)
    assert all(speed > 0 for part in W.parts for speed in part.speeds.values())


def test_a_decay_has_a_smaller_range_at_a_loss():
    chain = Family.from_intervals([(str(k), str(k + 1), 1, 2) for k in range(12)])
    fast, slow = (follower_decay(chain, loss=loss) for loss in (1e-3, 0.5))
    assert isinstance(fast, FollowerDecay) and fast.rate > slow.rate and slow.overshoot < 1e-6 * fast.overshoot
