"""Facts about the interior-point method: the optima of other solvers, closed forms, and duals that prove something."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from selection import thinned
from test_lmi import SEEDS, random_h_matrix, random_m_matrix
from test_lmi_rates import diagonally_stable, signed_laplacian

import lmi
from lmi.diagonal_interior_point import Solution, maximise_margin


def sparse_laplacian(rng: np.random.Generator, n: int) -> np.ndarray:
    """A ring and two more in-edges of each node, 30% of the edges negative."""
    W = np.zeros((n, n))
    for i in range(n):
        sources = [(i + 1) % n, *rng.choice(n, 2, replace=False)]
        W[i, sources] = rng.uniform(0.5, 2, 3) * np.where(rng.random(3) < 0.3, -1, 1)
    np.fill_diagonal(W, 0.0)
    return np.diag(np.abs(W).sum(axis=1)) - W


def margin(A: np.ndarray, omega: np.ndarray) -> float:
    return lmi.diagonal_margin(A, omega) / omega.max()


def both(A: np.ndarray, **options: object) -> tuple[float, float]:
    """The margins of Clarabel and of the interior-point method, 0 where there is none."""
    rates = []
    for solver in ("clarabel", "interior-point"):
        try:
            rates.append(lmi.diagonal_lyapunov(A, solver=solver, **options).rate)
        except lmi.NoCertificate:
            rates.append(0.0)
    return rates[0], rates[1]


# ---------------------------------------------------------------------- the margin


SIZES = [(n, seed) for n in (1, 2, 3, 5, 8, 13, 21) for seed in range(3)] + [(40, 0)]


@pytest.mark.parametrize(("n", "seed"), thinned(SIZES))
def test_the_margin_is_that_of_clarabel(n: int, seed: int):
    rng = np.random.default_rng(100 * n + seed)
    matrices = [random_h_matrix(rng, n, 0.5), diagonally_stable(rng, n)]
    matrices += [signed_laplacian(rng, n), np.tril(signed_laplacian(rng, n)) + 0.1 * np.eye(n)] if n > 1 else []
    for A in matrices:
        theirs, ours = both(A)
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9 * np.abs(A).max())


@settings(deadline=None, max_examples=5)
@given(SEEDS, st.integers(2, 20), st.sampled_from([2.0, 6.0]))
def test_over_magnitudes_the_margin_lies_between_that_of_clarabel_and_the_dual_bound(seed, n, decades):
    A = signed_laplacian(np.random.default_rng(seed), n, decades)
    A /= np.abs(A).max()
    found = maximise_margin(A, np.ones(n), least=0.0)
    theirs = both(A)[0]
    assert margin(A, found.omega) >= theirs * (1 - 1e-6) - 1e-9
    assert found.value >= max(theirs, margin(A, found.omega)) - 1e-12


def dual_bound(A: np.ndarray, found: Solution) -> float:
    """``<X, Omega A + A' Omega>`` is largest at weights of 0 or 1; no margin exceeds it, the trace of X being 1."""
    assert np.trace(found.X) == pytest.approx(1)
    assert np.linalg.eigvalsh(found.X)[0] >= -1e-12
    return float(np.maximum(0, 2 * np.einsum("ij,ji->i", A, found.X)).sum())


@settings(deadline=None, max_examples=10)
@given(SEEDS, st.integers(1, 12))
def test_the_dual_matrix_bounds_every_margin(seed, n):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) + rng.uniform(0, n) * np.eye(n)
    found = maximise_margin(A, np.ones(n), least=0.0)
    assert dual_bound(A, found) == pytest.approx(found.value, rel=1e-9, abs=1e-12)
    assert found.t <= found.value + 1e-12
    assert found.value - found.t <= 1e-7 * max(found.value, 1e-2)
    for _ in range(20):
        assert lmi.diagonal_margin(A, rng.random(n)) <= found.value + 1e-9


def test_quick_search():
    rng = np.random.default_rng(0)
    B = rng.normal(size=(30, 30))
    S = B @ B.T + np.eye(30)  # symmetric: no diagonal does better than the identity
    found = lmi.diagonal_lyapunov(S, solver="interior-point")
    assert found.rate == pytest.approx(2 * np.linalg.eigvalsh(S)[0], rel=1e-7)
    d = rng.uniform(1, 9, 70)
    found = lmi.diagonal_lyapunov(np.diag(d))
    assert found.rate == pytest.approx(2 * d.min(), rel=1e-7)
    # [[4 - t, -1], [-1, 8 - t]] is singular at 6 - sqrt(5), and smaller weights only lower it
    expected = 6 - np.sqrt(5)
    assert both(np.array([[2.0, -1.0], [0.0, 4.0]])) == pytest.approx((expected, expected), rel=1e-6)


def test_a_margin_that_is_not_positive():
    for A in (np.array([[-1.0, -4.0], [4.0, 3.0]]), np.diag([1.0, -1.0]), np.zeros((3, 3)), -np.eye(65)):
        with pytest.raises(lmi.NoCertificate):
            lmi.diagonal_lyapunov(A, solver="interior-point")


@pytest.mark.parametrize("condition", [1.0, 1.2, 3.0, 1e3])
def test_a_largest_condition(condition: float):
    for seed in range(4):
        A = random_h_matrix(np.random.default_rng(seed), 7, 0.5)
        theirs, ours = both(A, max_condition=condition)
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9 * np.abs(A).max())
        if ours:
            found = lmi.diagonal_lyapunov(A, max_condition=condition, solver="interior-point")
            assert found.condition <= condition * (1 + 1e-12)


# ---------------------------------------------------------------------- large and sparse


def test_three_hundred_nodes():
    A = sparse_laplacian(np.random.default_rng(1), 300)
    found = maximise_margin(A / 8, np.ones(300), least=0.0)
    assert margin(A / 8, found.omega) >= found.value * (1 - 1e-7)
    assert dual_bound(A / 8, found) == pytest.approx(found.value, rel=1e-9)
    automatic = lmi.diagonal_lyapunov(sparse.csr_array(A))
    assert automatic.rate == pytest.approx(8 * found.value, rel=1e-7)


def test_sparse_and_dense_products_agree(monkeypatch: pytest.MonkeyPatch):
    A = sparse_laplacian(np.random.default_rng(2), 120)
    values = []
    for share in (0.0, 1.0):
        monkeypatch.setattr("lmi.diagonal_interior_point._SPARSE_SHARE", share)
        for rows in (10, 1000):
            monkeypatch.setattr("lmi.diagonal_interior_point._LANCZOS_ROWS", rows)
            values.append(maximise_margin(A / 8, np.ones(120), least=0.0).t)
    assert values == pytest.approx([values[0]] * 4, rel=1e-8)


def test_the_best_rate_of_a_large_m_matrix():
    A = np.abs(sparse_laplacian(np.random.default_rng(3), 110))
    A = 2 * np.diag(np.diag(A)) - A + np.diag(np.linspace(0.1, 1, 110))
    found = lmi.diagonal_lyapunov(A, objective="rate")
    assert found.rate == pytest.approx(2 * np.linalg.eigvals(A).real.min(), rel=1e-6)
    assert found.gap <= 1e-5


# ---------------------------------------------------------------------- the other sets of weights


@settings(deadline=None, max_examples=8)
@given(SEEDS, st.integers(2, 9), st.floats(1.5, 1e4))
def test_the_dual_value_bounds_weights_of_a_given_sum(seed, n, condition):
    rng = np.random.default_rng(seed)
    A, weight = random_m_matrix(rng, n, 0.5), 10.0 ** rng.uniform(-1, 1, n)
    A /= np.abs(A).max()
    scale = np.exp(rng.uniform(0, 0.9 * np.log(condition), n))
    half = 1 / np.sqrt(weight)

    def reached(omega: np.ndarray) -> float:
        return lmi.diagonal_margin(half[:, None] * A * half, omega)

    free = maximise_margin(A, weight)
    capped = maximise_margin(A, weight, scale=scale, max_condition=condition)
    assert capped.value <= free.value + 1e-9
    for found in (free, capped):
        assert found.omega.sum() == pytest.approx(n)
        assert found.t <= reached(found.omega) + 1e-9
        assert found.t >= found.value - 1e-6 * max(1, abs(found.value))
    relative = scale * capped.omega
    assert relative.max() <= relative.min() * condition * (1 + 1e-9)
    for _ in range(20):
        omega = np.exp(rng.uniform(0, np.log(condition), n)) / scale
        omega *= n / omega.sum()
        assert reached(omega) <= min(free.value, capped.value) + 1e-9


# ---------------------------------------------------------------------- numbers that floats cannot take


@pytest.mark.parametrize("size", [1e-300, 1e-150, 1e150, 1e300, np.inf, np.nan])
def test_entries_of_any_size_are_answered_or_refused(size: float):
    A = np.array([[2.0, -1.0, 0.0], [size, 3.0, 1.0], [0.0, -1.0, 2.0]])
    for options in ({"least": 0.0}, {}, {"scale": np.array([1.0, 1.5, 2.0]), "max_condition": 4.0}):
        try:
            found = maximise_margin(A, np.ones(3), **options)
        except lmi.NoCertificate:
            continue
        assert np.isfinite(found.omega).all()
        assert found.t <= found.value + 1e-9 * abs(found.value)


# ---------------------------------------------------------------------- the choice


def test_the_size_chooses_the_solver(monkeypatch: pytest.MonkeyPatch):
    asked = []

    def refuse(*_: object, **__: object) -> None:
        asked.append("cvxpy")
        raise lmi.NoCertificate("not now")

    monkeypatch.setattr("lmi.diagonal.solve", refuse)
    assert lmi.diagonal_lyapunov(3 * np.eye(33)).rate == pytest.approx(6)
    assert not asked
    with pytest.raises(lmi.NoCertificate):
        lmi.diagonal_lyapunov(3 * np.eye(32))
    assert asked


def test_solvers_by_name(monkeypatch: pytest.MonkeyPatch):
    A = [[2.0, -1.0], [-1.0, 2.0]]
    with pytest.raises(lmi.MatrixError, match="interior-point"):
        lmi.diagonal_lyapunov(A, solver="simplex")
    with pytest.raises(lmi.MatrixError, match="margin"):
        lmi.diagonal_lyapunov(A, objective="rate", solver="clarabel")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(lmi.LMIError, match="sdpa-python"):
        lmi.diagonal_lyapunov(A, solver="sdpa")


def test_sdpa_agrees():
    pytest.importorskip("sdpap")
    A = sparse_laplacian(np.random.default_rng(4), 40)
    ours = lmi.diagonal_lyapunov(A, solver="interior-point").rate
    assert lmi.diagonal_lyapunov(A, solver="sdpa").rate == pytest.approx(ours, rel=1e-5)
