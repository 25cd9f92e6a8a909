"""Weighted sums of squares: their rates and constants against all vertices, in rationals, and along random signals."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
from families import random_family
from row_families import bounds_of, laplacian, random_vertex, vertices
from scipy.linalg import expm

from lmi.exact import arithmetic
from lmi.exact.numbers import integers
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.lyapunov.squares_function import FormTable, SquaresFunction, prove_squares, squares_function

Matrix = list[list[Fraction]]


def stable_family(seed: int, nodes: int = 6) -> Family:
    return random_family(random.Random(seed), "stability", nodes=random.Random(seed).randint(2, nodes)).family


def unsure_family(seed: int, n: int = 4, modes: int = 1) -> Family:
    """A ring with one opponent and one more edge, known to 5 %: few enough for all vertices."""
    rng, made = random.Random(seed), []
    for _ in range(modes):
        edges = {(k, (k + 1) % n): -1 if k == 0 else 1 for k in range(n)}
        edges[rng.randrange(1, n - 1), 0] = rng.choice([-1, 1])
        rows = [(s, t, Fraction(rng.randint(5, 15), 10), sign) for (s, t), sign in edges.items()]
        ends = [(s, t, *sorted((sign * w * Fraction(19, 20), sign * w * Fraction(21, 20)))) for s, t, w, sign in rows]
        made.append(Family.from_intervals(ends, nodes=range(n)))
    return made[0] if modes == 1 else Family.switching(made)


def exact_laplacian(mode: Mode, largest: np.ndarray) -> Matrix:
    n = len(mode.labels)
    L = [[Fraction(0)] * n for _ in range(n)]
    for e, (s, t, sign) in enumerate(zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True)):
        w = (mode.upper if largest[e] else mode.lower).fraction(e)
        L[t][t] += w
        L[t][s] -= sign * w
    return L


def largest_constant(V: SquaresFunction, L: Matrix, k: int) -> Fraction:
    """The largest ``(L x)_k^2 / V``."""
    return sum((x**2 * V.scale / V.weights[v] for v, x in enumerate(L[k])), Fraction(0))


def decays(V: SquaresFunction, L: Matrix) -> bool:
    """Whether ``P L + L'P - rate P`` is positive definite, exactly."""
    p, n = V.weights, len(L)
    S = [[p[i] * L[i][j] + p[j] * L[j][i] - (V.rate * p[i] if i == j else 0) for j in range(n)] for i in range(n)]
    return arithmetic().definite(integers(S)[0])


def compare(family: Family) -> int:
    """Compare with all vertices; return how many there were."""
    V, count = squares_function(family), 0
    assert V is not None
    speeds = bounds_of(V.speeds)
    for mode in family.modes:
        for vertex in vertices(mode):
            L = exact_laplacian(mode, vertex)
            assert decays(V, L)
            assert all(largest_constant(V, L, k) <= speeds[k] ** 2 for k in speeds)
            count += 1
    # the largest weights attain the constants, rounded up to some bits
    for k, speed in speeds.items():
        tops = [exact_laplacian(mode, np.ones(mode.n_edges, dtype=bool)) for mode in family.modes]
        assert max(largest_constant(V, L, k) for L in tops) > speed**2 * (1 - Fraction(1, 10**9))
    return count


@pytest.mark.parametrize(("n", "modes"), [(3, 1), (4, 1), (5, 1), (4, 2)])
def test_the_rate_and_the_constants_hold_at_all_vertices(n, modes):
    assert compare(unsure_family(n, n, modes)) >= 8


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(40))
def test_the_rate_and_the_constants_hold_at_more_vertices(seed):
    compare(unsure_family(seed, 3 + seed % 3, 1 + seed % 2))


def decays_of(family: Family, p: np.ndarray, rng: random.Random, count: int) -> list[float]:
    """The least ``r`` with ``P L + L'P >= r P`` of some members."""
    half, found = np.sqrt(p), []
    for _ in range(count):
        mode = rng.choice(family.modes)
        A = half[:, None] * laplacian(mode, random_vertex(rng, mode)) / half
        found.append(float(np.linalg.eigvalsh(A + A.T)[0]))
    return found


def test_functions_decay_in_all_members():
    proved = 0
    for seed in range(12):
        V = squares_function(family := stable_family(seed))
        if V is not None:
            proved += 1
            assert min(decays_of(family, V.vector, random.Random(seed), 30)) >= float(V.rate) * (1 - 1e-9)
    assert proved > 3


def test_no_form_proves_a_rate_that_a_member_contradicts():
    for seed in range(10):
        family = stable_family(seed)
        p = np.random.default_rng(seed).uniform(0.1, 1, family.n_nodes)
        worst = min(decays_of(family, p, random.Random(seed), 60))
        assert prove_squares([FormTable.of(mode) for mode in family.modes], p, Fraction(worst + 1e-6)) is None


def test_known_weights_keep_the_perron_rate_of_a_ring():
    ring = Family.from_intervals([("a", "b", 2, 2), ("b", "c", 2, 2), ("c", "a", -2, -2)])
    assert float(squares_function(ring).rate) == pytest.approx(2, rel=1e-5)
    notes: list[str] = []
    wide = Family.from_intervals([("a", "b", 1, 5), ("b", "c", 1, 5), ("c", "a", -5, -1)])
    assert squares_function(wide, notes) is None and notes == ["class squares: no rate"]


@pytest.mark.parametrize("power", [-300, 300])
def test_weights_of_any_size_have_the_rate_in_their_unit(power):
    unit = Fraction(10) ** power
    small, large = ([("a", "b", 1, "1.1"), ("b", "a", "-1.1", -1)], [("a", "b", unit, 11 * unit / 10)])
    large.append(("b", "a", -11 * unit / 10, -unit))
    one, other = (squares_function(Family.from_intervals(edges)) for edges in (small, large))
    assert other is not None and float(other.rate / unit / one.rate) == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_runs_under_random_signals_stay_below_the_bounds(seed):
    rng, family = random.Random(seed), unsure_family(seed, 4, 2)
    V = squares_function(family)
    x = [Fraction(rng.randint(-20, 20), 3) for _ in range(4)]
    speeds, sizes = bounds_of(V.speeds), bounds_of(V.sizes)
    X, start, s = np.array([float(v) for v in x]), float(V.root(x)), 0.0
    for _ in range(10):
        L = laplacian(mode := rng.choice(family.modes), random_vertex(rng, mode))
        bound = start * np.exp(-float(V.rate) / 2 * s)
        assert float(V.root([Fraction(v) for v in X.tolist()])) <= bound * (1 + 1e-9)
        assert all(abs((L @ X)[k]) <= speeds[k] * bound * (1 + 1e-9) for k in range(4))
        assert all(abs(X[k]) <= sizes[k] * bound * (1 + 1e-9) for k in range(4))
        h = rng.choice([0.01, 0.1, 0.5])
        X, s = expm(-L * h) @ X, s + h
