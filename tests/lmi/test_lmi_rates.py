"""Facts about the best rates of diagonal and full Lyapunov matrices: optimum, dual bound, frontier, refutation."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from test_lmi import SEEDS, random_m_matrix

import lmi


def exact(A: np.ndarray) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in row] for row in A]


def signed_laplacian(rng: np.random.Generator, n: int, decades: float = 1.0) -> np.ndarray:
    """A ring, random edges, and one pair of opposite mutual signs: strongly connected and unbalanced."""
    pattern = rng.random((n, n)) < 2 / n
    order = rng.permutation(n)
    pattern[order, np.roll(order, 1)] = True
    np.fill_diagonal(pattern, False)
    W = np.where(pattern, 10.0 ** rng.uniform(-decades / 2, decades / 2, (n, n)), 0.0)
    W *= np.where(rng.random((n, n)) < 0.4, -1.0, 1.0)
    i, j = order[1], order[0]
    W[j, i] = -np.sign(W[i, j]) * 10.0 ** rng.uniform(-decades / 2, decades / 2)
    return np.diag(np.abs(W).sum(axis=1)) - W


def diagonally_stable(rng: np.random.Generator, n: int) -> np.ndarray:
    """``Omega^-1 (S + K)`` with ``S > 0`` and skew ``K``: ``Omega`` is a diagonal Lyapunov matrix."""
    B, K = rng.normal(size=(n, n)), rng.normal(size=(n, n)) * 3
    omega = 10.0 ** rng.uniform(-2, 2, n)
    return (B @ B.T + 0.1 * np.eye(n) + K - K.T) / omega[:, None]


def without_diagonal_solution(rng: np.random.Generator, n: int) -> np.ndarray:
    """``diag(A X) < 0`` for some ``X = Y Y' >= 0``, while the diagonal of ``A`` stays positive where it can."""
    A = rng.normal(size=(n, n)) * 3 + 6 * np.eye(n)
    Y = rng.normal(size=(n, int(rng.integers(1, n))))
    X = Y @ Y.T
    push = ((A @ X).diagonal() + 0.05 * X.diagonal() * rng.random(n)) / (X @ X).diagonal()
    return A - push[:, None] * X


# ---------------------------------------------------------------------- the optimum


def m_matrix_gap(seed: int) -> float:
    """Relative distance of the searched rate from ``2 lambda_min`` of a random M-matrix."""
    rng = np.random.default_rng(seed)
    A = random_m_matrix(rng, int(rng.integers(1, 9 if seed % 10 else 41)))  # the larger ones by interior points
    best = 2 * min(np.linalg.eigvals(A[np.ix_(part, part)]).real.min() for part in lmi.irreducible_blocks(A))
    found = lmi.diagonal_lyapunov(A, objective="rate")
    closed = lmi.m_matrix_certificate(A)
    assert found.rate <= best * (1 + 1e-9)
    assert closed.rate <= best * (1 + 1e-9)
    return max(1 - found.rate / best, 1 - closed.rate / best)


def test_the_best_diagonal_rate_of_an_m_matrix_is_twice_its_smallest_eigenvalue():
    gaps = [m_matrix_gap(seed) for seed in range(8)]
    assert max(gaps) <= 1e-6, int(np.argmax(gaps))


@pytest.mark.campaign
def test_the_best_diagonal_rate_of_a_thousand_m_matrices():
    gaps = [m_matrix_gap(10_000 + seed) for seed in range(1000)]
    print(f"\n1000 M-matrices: 1 - rate / (2 lambda_min) at most {max(gaps):.2e}, median {np.median(gaps):.2e}")
    assert max(gaps) <= 1e-6


@settings(deadline=None, max_examples=6)
@given(SEEDS, st.integers(2, 10), st.sampled_from([1.0, 6.0]))
def test_the_optimum_lies_between_a_matrix_and_its_dual_bound(seed, n, decades):
    A = signed_laplacian(np.random.default_rng(seed), n, decades)
    found = lmi.diagonal_lyapunov(A, objective="rate")
    S = lmi.diagonal_solution.scaled(A, found.log_omega)
    assert np.linalg.eigvalsh(S + S.T)[0] == pytest.approx(found.rate, rel=1e-9, abs=1e-12 * np.abs(S).max())
    assert found.rate >= lmi.perron_certificate(A).rate * (1 - 1e-9)
    assert found.gap <= 1e-4
    assert found.witness is not None
    rows = [[Fraction(float(x)) for x in row] for row in found.witness[0]]
    assert lmi.no_diagonal_rate_above(exact(A), rows, Fraction(found.upper))
    assert found.rate <= 2 * np.linalg.eigvals(A).real.min() * (1 + 1e-6)


@settings(deadline=None, max_examples=2)
@given(SEEDS, st.integers(2, 8))
def test_the_best_rate_is_invariant(seed, n):
    """Permutation, diagonal similarity and gauge change nothing; a factor scales the rate."""
    rng = np.random.default_rng(seed)
    A = signed_laplacian(rng, n)
    rate = lmi.diagonal_lyapunov(A, objective="rate").rate
    order, D = rng.permutation(n), 10.0 ** rng.uniform(-1, 1, n)
    gauge = np.where(rng.random(n) < 0.5, -1.0, 1.0)
    for same, factor in (
        (A[np.ix_(order, order)], 1.0),
        (D[:, None] * A / D, 1.0),
        (gauge[:, None] * A * gauge, 1.0),
        (A * 1e5, 1e5),
    ):
        assert lmi.diagonal_lyapunov(same, objective="rate").rate == pytest.approx(rate * factor, rel=1e-5)


def test_a_reducible_matrix_decays_like_its_slowest_block():
    rng = np.random.default_rng(3)
    for _ in range(2):
        blocks = [signed_laplacian(rng, int(rng.integers(2, 5))) for _ in range(3)]
        n = sum(map(len, blocks))
        A, start = np.tril(rng.normal(size=(n, n)), -1) * 5, 0
        for block in blocks:
            A[start : start + len(block), start : start + len(block)] = block
            start += len(block)
        slowest = min(lmi.diagonal_lyapunov(block, objective="rate").rate for block in blocks)
        found = lmi.diagonal_lyapunov(A, objective="rate")
        assert found.rate == pytest.approx(slowest, rel=2e-6)
        assert found.upper >= slowest * (1 - 1e-9)
        assert lmi.diagonal_rate_limit(A, found.witness[0]) <= found.upper * (1 + 1e-12)


@pytest.mark.campaign
def test_a_chain_of_two_thousand_followers_has_a_certificate():
    n = 2000
    A = np.eye(n) - np.eye(n, k=-1)
    closed = lmi.m_matrix_certificate(A)
    assert closed.rate == pytest.approx(2, rel=1e-5)
    assert np.isfinite(closed.log_condition) and closed.condition == np.inf  # beyond float64, known by its logarithm
    # D^-1 A D of a bidiagonal matrix: B + B' > b I by dominance, row by row
    B = lmi.diagonal_solution.scaled(A, closed.log_omega)
    off = np.abs(B.diagonal(-1))
    assert (2 - closed.rate - np.append(0, off) - np.append(off, 0) >= 0).all()
    capped = lmi.m_matrix_certificate(A, max_condition=1e6)
    assert capped.rate > 0 and capped.condition <= 1e6 * (1 + 1e-9)
    assert lmi.diagonal_rate(A, capped.log_omega) >= capped.rate * (1 - 1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize("n", [4, 40])
@pytest.mark.parametrize("condition", [None, 50.0])
def test_clarabel_finds_a_margin_just_below_the_best_rate_and_none_above(n: int, condition: float | None):
    for seed in range(1 if n == 40 else 2):
        A = signed_laplacian(np.random.default_rng(100 * n + seed), n)
        rate = lmi.diagonal_lyapunov(A, objective="rate", max_condition=condition).rate
        options = {"solver": "clarabel", "max_condition": condition}
        assert lmi.diagonal_lyapunov(A - rate * (1 - 1e-4) / 2 * np.eye(n), **options).rate > 0
        with pytest.raises(lmi.NoCertificate):
            lmi.diagonal_lyapunov(A - rate * (1 + 1e-4) / 2 * np.eye(n), **options)


def test_a_singular_matrix_has_no_rate():
    """Row sums 0: whatever rate a search sees is rounding."""
    A = (
        np.array([[11, -6, 0, -5, 0], [0, 11, -2, -8, -1], [-1, -2, 3, 0, 0], [0, 0, -3, 3, 0], [-5, -7, -6, -2, 20]])
        / 8
    )
    with pytest.raises(lmi.NoCertificate):
        lmi.diagonal_lyapunov(A, objective="rate")


# ---------------------------------------------------------------------- rate against prefactor


@settings(deadline=None, max_examples=2)
@given(SEEDS, st.integers(2, 8), st.sampled_from([1.0, 4.0]))
def test_the_frontier_is_monotone_and_bounds_the_motion(seed, n, decades):
    A = signed_laplacian(np.random.default_rng(seed), n, decades)
    diagonal, full = lmi.rate_frontier(A), lmi.full_frontier(A)
    for frontier in (diagonal, full):
        assert all(a.rate < b.rate and a.condition < b.condition for a, b in pairwise(frontier))
        for s in np.array([0.01, 0.3, 1.0, 5.0]) / np.abs(A).max():
            norm = np.linalg.norm(expm(-A * s), 2)
            for function in frontier:
                assert norm <= np.sqrt(function.condition) * np.exp(-function.rate * s / 2) * (1 + 1e-9)
    spectral = 2 * np.linalg.eigvals(A).real.min()
    assert full[-1].rate == pytest.approx(spectral, rel=1e-3)
    assert full[-1].rate <= spectral * (1 + 1e-6)


@pytest.mark.parametrize("condition", [1.0, 1.5, 4.0, 100.0])
@pytest.mark.parametrize("objective", ["margin", "rate"])
def test_a_largest_condition_is_kept(condition: float, objective: str):
    A = signed_laplacian(np.random.default_rng(5), 6)
    try:
        found = lmi.diagonal_lyapunov(A, objective=objective, max_condition=condition)
    except lmi.NoCertificate:
        assert condition < 4
        return
    assert found.condition <= condition * (1 + 1e-9)
    free = lmi.diagonal_lyapunov(A, objective=objective)
    assert found.rate <= free.rate * (1 + 1e-6)
    if condition >= free.condition:
        assert found.rate == pytest.approx(free.rate, rel=1e-5)


@settings(deadline=None, max_examples=20)
@given(SEEDS, st.integers(1, 12))
def test_full_matrices_are_what_they_say(seed, n):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1)
    A += (0.1 + rng.random() - np.linalg.eigvals(A).real.min()) * np.eye(n)
    for found in lmi.full_frontier(A):
        P = found.matrix
        assert np.array_equal(P, P.T)
        size = np.linalg.eigvalsh(P)
        assert size[0] == pytest.approx(1, rel=1e-6) and size[-1] == pytest.approx(found.condition, rel=1e-6)
        S = P @ A + A.T @ P - found.rate * P
        assert np.linalg.eigvalsh(S)[0] >= -1e-9 * np.abs(S).max() * n


def test_a_normal_matrix_loses_nothing():
    rng = np.random.default_rng(1)
    Q = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    A = Q @ np.diag([1.0, 2, 3, 4, 5, 1e4]) @ Q.T
    fastest = lmi.full_frontier(A)[-1]
    assert fastest.rate == pytest.approx(2, rel=1e-9) and fastest.condition == pytest.approx(1, rel=1e-9)


def test_a_jordan_chain_has_full_matrices_below_its_rate():
    A = np.eye(30) - np.eye(30, k=-1)
    frontier = lmi.full_frontier(A, decay=1.0)
    assert 0.5 < frontier[-1].rate < 2
    with pytest.raises(lmi.NoCertificate, match="nothing decays"):
        lmi.full_frontier(-A)


# ---------------------------------------------------------------------- refusals


@pytest.mark.parametrize("count", [10, pytest.param(40, marks=pytest.mark.campaign)])
def test_a_witness_shows_that_no_diagonal_solution_exists(count: int):
    """Matrices built around ``diag(A X) < 0``: the witness is found and checked in rationals."""
    found = 0
    for seed in range(count):
        rng = np.random.default_rng(seed)
        A = without_diagonal_solution(rng, int(rng.integers(2, 9)))
        Y = lmi.refute_diagonal_lyapunov(A)
        if Y is not None:
            found += 1
            assert lmi.no_diagonal_rate_above(exact(A), Y, Fraction(0))
        with pytest.raises(lmi.NoCertificate):
            lmi.diagonal_lyapunov(A)
    assert found >= count - count // 40, found


@settings(deadline=None, max_examples=8)
@given(SEEDS, st.integers(1, 8))
def test_no_witness_is_reported_where_a_diagonal_solution_exists(seed, n):
    A = diagonally_stable(np.random.default_rng(seed), n)
    assert lmi.refute_diagonal_lyapunov(A) is None


def rate_refuted(seed: int) -> bool:
    """Whether a rational witness excludes diagonal rates above 1.001 times the optimum found."""
    rng = np.random.default_rng(seed)
    A = signed_laplacian(rng, int(rng.integers(2, 13)), float(rng.choice([1.0, 4.0])))
    best = lmi.diagonal_lyapunov(A, objective="rate").rate
    Y = lmi.refute_diagonal_lyapunov(A, 1.001 * best)
    assert lmi.refute_diagonal_lyapunov(A, 0.999 * best) is None
    return Y is not None and lmi.no_diagonal_rate_above(exact(A), Y, Fraction(1.001 * best))


@pytest.mark.parametrize("count", [4, pytest.param(20, marks=pytest.mark.campaign)])
def test_a_rational_witness_excludes_rates_just_above_the_optimum(count: int):
    refuted = [rate_refuted(seed) for seed in range(count)]
    assert sum(refuted) == count, [seed for seed, done in enumerate(refuted) if not done]


def test_a_wrong_witness_proves_nothing():
    A = exact(np.array([[2.0, 1.0], [-1.0, 2.0]]))
    for Y in ([[0], [0]], [[1], [0]], [[1, 2], [3, 4]]):
        assert not lmi.no_diagonal_rate_above(A, Y, Fraction(0))
    assert lmi.no_diagonal_rate_above(A, [[1], [0]], Fraction(4))
    assert not lmi.no_diagonal_rate_above(A, [[1], [0]], Fraction(399, 100))
    with pytest.raises(lmi.MatrixError):
        lmi.no_diagonal_rate_above(A, [[1]], Fraction(0))


def test_bad_arguments_are_named():
    A = np.eye(2)
    for bad in (
        lambda: lmi.diagonal_lyapunov(A, objective="fast"),
        lambda: lmi.diagonal_lyapunov(A, max_condition=0.5),
        lambda: lmi.diagonal_lyapunov(A, basis=np.eye(2)),
        lambda: lmi.diagonal_lyapunov(A, objective="rate", basis=np.eye(3)),
        lambda: lmi.diagonal_rate(A, [0.0]),
        lambda: lmi.full_frontier(np.zeros((0, 0))),
        lambda: lmi.rate_frontier(np.zeros((0, 0))),
        lambda: lmi.refute_diagonal_lyapunov(np.zeros((0, 0))),
        lambda: lmi.refute_diagonal_lyapunov(A, np.nan),
        lambda: lmi.diagonal_lyapunov(A, objective="rate", basis=np.zeros((2, 1))),
        lambda: lmi.diagonal_lyapunov(A, objective="rate", max_condition=2.0, start=[0.0, np.nan]),
        lambda: lmi.diagonal_rate_limit(A, [[1.0]]),
        lambda: lmi.no_diagonal_rate_above([], [], Fraction(0)),
        lambda: lmi.no_diagonal_rate_above(exact(A), [[np.nan], [1]], Fraction(0)),
    ):
        with pytest.raises(lmi.MatrixError):
            bad()
