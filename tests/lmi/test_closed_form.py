"""Facts about diagonal Lyapunov matrices in closed form: M-matrices, H-matrices, Perron vectors."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from test_lmi import random_h_matrix, random_m_matrix

from lmi import closed_form
from lmi.closed_form import h_matrix_certificate, m_matrix_certificate, perron_certificate
from lmi.definiteness_proofs import prove_positive_definite
from lmi.diagonal_solution import DiagonalCertificate, diagonal_rate
from lmi.errors import MatrixError, NoCertificate, NotAnHMatrix, NotAnMMatrix
from lmi.matrix_classes import comparison_matrix

SEEDS = st.integers(0, 2**32 - 1)


def spectral_rate(A: np.ndarray) -> float:
    return float(2 * np.linalg.eigvals(A).real.min())


def strong_components(A: np.ndarray) -> int:
    return int(sparse.csgraph.connected_components(sparse.csr_array(A), connection="strong")[0])


def witness_rate(A: np.ndarray, found: DiagonalCertificate) -> float:
    """Evaluate ``min_i (A u)_i / u_i + (A' v)_i / v_i`` in logarithms, ``v = Omega u`` taken from ``Omega``."""
    assert found.witness is not None
    log_u = found.witness[0]
    rows, columns = np.nonzero(A)
    total = np.zeros(len(A))
    np.add.at(total, rows, A[rows, columns] * np.exp(log_u[columns] - log_u[rows]))
    log_v = log_u + found.log_omega
    np.add.at(total, columns, A[rows, columns] * np.exp(log_v[rows] - log_v[columns]))
    return float(total.min())


def proved(A: np.ndarray, found: DiagonalCertificate, loss: float = 1e-9) -> bool:
    """Decide exactly whether ``Omega A + A' Omega > rate (1 - loss) Omega`` for the floats ``Omega``."""
    n, b = len(A), Fraction(found.rate) * (1 - Fraction(loss))
    omega = [Fraction(x) for x in found.omega]
    exact = [[Fraction(x) for x in row] for row in A]
    return bool(
        prove_positive_definite(
            [
                [omega[i] * exact[i][j] + omega[j] * exact[j][i] - (i == j) * b * omega[i] for j in range(n)]
                for i in range(n)
            ]
        )
    )


def signed_ring(rng: np.random.Generator, n: int, magnitude: float = 0.5) -> np.ndarray:
    """Laplacian of a strongly connected signed digraph with two mutual edges of opposite sign: unbalanced."""
    W = np.where(rng.random((n, n)) < 0.3, rng.choice([-1.0, 1.0], (n, n)), 0.0)
    ring = np.arange(n)
    W[ring, ring - 1] = rng.choice([-1.0, 1.0], n)
    W[1, 0], W[0, 1] = 1.0, -1.0
    W *= 10.0 ** rng.uniform(-magnitude, magnitude, (n, n))
    np.fill_diagonal(W, 0.0)
    return np.diag(np.abs(W).sum(axis=1)) - W


# ---------------------------------------------------------------------- M-matrices


@pytest.mark.parametrize("count", [40, pytest.param(2000, marks=pytest.mark.campaign)])
def test_m_matrices_reach_twice_their_smallest_eigenvalue(count: int):
    rng = np.random.default_rng(20240517)
    irreducible = 0
    for _ in range(count):
        A = random_m_matrix(rng, int(rng.integers(1, 13)))
        found, best = m_matrix_certificate(A), spectral_rate(A)
        strong = strong_components(A) == 1
        irreducible += strong
        assert best * (1 - (1e-8 if strong else 2e-6)) <= found.rate <= best * (1 + 1e-9)
        assert found.upper == pytest.approx(best, rel=1e-8)
        assert found.rate <= found.upper
        assert found.log_omega.max() == 0
    assert 0.2 < irreducible / count < 0.8


@settings(max_examples=20)
@given(SEEDS, st.integers(1, 10), st.sampled_from([1.0, 3.0]))
def test_the_inequality_is_proved_exactly(seed, n, magnitude):
    A = random_m_matrix(np.random.default_rng(seed), n, magnitude)
    found = m_matrix_certificate(A)
    assert found.rate > 0
    assert proved(A, found)


@given(SEEDS, st.integers(1, 10))
def test_weights_over_twelve_decades_are_certified_or_refused(seed, n):
    A = random_m_matrix(np.random.default_rng(seed), n, 6.0)
    try:
        found = m_matrix_certificate(A)
    except NotAnMMatrix:
        return
    assert proved(A, found)


@settings(max_examples=6)
@given(SEEDS, st.integers(2, 10), st.sampled_from([2.0, 1e2, 1e4]))
def test_a_bound_on_the_condition_is_kept(seed, n, limit):
    A = random_m_matrix(np.random.default_rng(seed), n)
    free = m_matrix_certificate(A)
    try:
        found = m_matrix_certificate(A, max_condition=limit)
    except NoCertificate:
        assert free.condition > limit
        return
    assert found.condition <= limit
    assert 0 < found.rate <= free.upper
    assert proved(A, found)


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 10))
def test_relabelling_permutes_the_certificate(seed, n):
    rng = np.random.default_rng(seed)
    A, order = random_m_matrix(rng, n), rng.permutation(n)
    here, there = m_matrix_certificate(A), m_matrix_certificate(A[order][:, order])
    assert there.rate == pytest.approx(here.rate, rel=1e-6)
    assert there.log_omega == pytest.approx(here.log_omega[order], abs=1e-5)


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 10), st.floats(1e-6, 1e6))
def test_the_rate_scales_with_the_matrix(seed, n, c):
    A = random_m_matrix(np.random.default_rng(seed), n)
    assert m_matrix_certificate(c * A).rate == pytest.approx(c * m_matrix_certificate(A).rate, rel=1e-6)
    L = signed_ring(np.random.default_rng(seed), n + 2)
    assert perron_certificate(c * L).rate == pytest.approx(c * perron_certificate(L).rate, rel=1e-6)


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 10))
def test_a_diagonal_similarity_leaves_the_rate(seed, n):
    rng = np.random.default_rng(seed)
    A, d = random_m_matrix(rng, n), 10.0 ** rng.uniform(-3, 3, n)
    assert m_matrix_certificate(d[:, None] * A / d).rate == pytest.approx(m_matrix_certificate(A).rate, rel=3e-6)


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 12))
def test_sparse_and_dense_agree(seed, n):
    rng = np.random.default_rng(seed)
    A, H, L = random_m_matrix(rng, n), random_h_matrix(rng, n), signed_ring(rng, n + 2)
    for function, matrix in ((m_matrix_certificate, A), (h_matrix_certificate, H), (perron_certificate, L)):
        dense, thin = function(matrix), function(sparse.csr_matrix(matrix))
        assert thin.rate == dense.rate
        assert (thin.log_omega == dense.log_omega).all()


def test_a_direct_sum_has_the_smaller_rate():
    A, B = np.array([[2.0, -1.0], [-4.0, 5.0]]), np.array([[7.0]])
    both = np.block([[B, np.zeros((1, 2))], [np.zeros((2, 1)), A]])
    assert m_matrix_certificate(both).rate == pytest.approx(m_matrix_certificate(A).rate, rel=1e-12)


def test_components_of_every_kind_in_a_row():
    """Rings that hear the ring before them; the slowest decides, wherever it stands."""
    rng = np.random.default_rng(5)
    sizes, rows = [3, 1, 8, 2, 1, 5], []
    A = np.zeros((20, 20))
    for k, size in enumerate(sizes):
        first = sum(sizes[:k])
        ring = np.arange(first, first + size)
        A[ring, np.roll(ring, 1)] = -rng.uniform(0.1, 1, size)
        A[ring, ring] = rng.uniform(2, 3, size)
        if first:
            A[first, first - 1] = -1e3
        rows.append(ring)
    slow = min(spectral_rate(A[np.ix_(ring, ring)]) for ring in rows)
    found = m_matrix_certificate(A)
    assert found.rate == pytest.approx(slow, rel=2e-6)
    assert found.rate <= witness_rate(A, found) * (1 + 1e-12)
    assert proved(A, found, 1e-8)


# ---------------------------------------------------------------------- chains


def chain(n: int) -> np.ndarray:
    return np.eye(n) - np.eye(n, k=-1)


def test_a_chain_of_two_thousand_has_a_certificate_beyond_the_range_of_float64():
    A = chain(2000)
    found = m_matrix_certificate(sparse.csr_array(A))
    assert np.isfinite(found.log_omega).all()
    assert found.condition == math.inf
    assert math.isfinite(found.log_condition)
    assert 2 * (1 - 2e-6) <= found.rate <= 2
    assert witness_rate(A, found) >= found.rate


@pytest.mark.parametrize("limit", [1e2, 1e6, 1e12])
def test_a_chain_under_a_bound_on_the_condition(limit):
    """``omega_k = q^k`` with ``q^(n-1) = 1/c`` has the rate ``2 (1 - sqrt(q) cos(pi / (n + 1)))``."""
    A = chain(200)
    found = m_matrix_certificate(A, max_condition=limit)
    geometric = 2 * (1 - limit ** (-0.5 / 199) * math.cos(math.pi / 201))
    assert found.condition <= limit
    assert found.rate >= geometric * (1 - 1e-6)
    assert diagonal_rate(A, found.log_omega) >= found.rate * (1 - 1e-9)


def test_a_long_chain_under_a_bound_on_the_condition_stays_sparse():
    found = m_matrix_certificate(sparse.csr_array(chain(1600)), max_condition=1e6)
    assert found.rate >= 2 * (1 - 1e6 ** (-0.5 / 1599)) * (1 - 1e-6)
    assert found.condition <= 1e6
    with pytest.raises(NoCertificate, match="condition of at most 1"):
        m_matrix_certificate([[1.0, 0.0], [-3.0, 1.0]], max_condition=1)


@pytest.mark.parametrize("n", [20, 500])
def test_a_ring_whose_perron_vector_leaves_the_range_of_float64(n):
    """Entries fall by about 9 from row to row, to 10^-477; ``A u >= t u`` asks for less than Perron vectors."""
    A = 10 * np.eye(n) - np.eye(n, k=-1)
    A[0, 0], A[0, -1] = 1.0, -1.0
    found = m_matrix_certificate(sparse.csr_array(A))
    assert 2 * (1 - 1e-9) <= found.rate <= found.upper <= 2 * (1 + 1e-9)
    assert witness_rate(A, found) >= found.rate * (1 - 1e-12)


# ---------------------------------------------------------------------- witnesses and refusals


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 8))
def test_given_witnesses_are_used(seed, n):
    A = random_m_matrix(np.random.default_rng(seed), n)
    u, v = np.linalg.solve(A, np.ones(n)), np.linalg.solve(A.T, np.ones(n))
    found = m_matrix_certificate(A, u, v)
    assert np.exp(found.log_omega) == pytest.approx(v / u / (v / u).max(), rel=1e-9)
    assert found.rate == pytest.approx((1 / u + 1 / v).min(), rel=1e-6)
    assert m_matrix_certificate(A, u).rate >= found.rate - (1 / v).min() * (1 + 1e-6)


def test_refusals_name_the_entry():
    A = [[2.0, -1.0], [-1.0, 2.0]]
    with pytest.raises(NotAnMMatrix, match=r"entry \(0, 1\) is 1, positive off the diagonal"):
        m_matrix_certificate([[1.0, 1.0], [0.0, 1.0]])
    with pytest.raises(NotAnMMatrix, match="diagonal entry 1 is 0"):
        m_matrix_certificate(np.diag([1.0, 0.0]))
    with pytest.raises(NotAnMMatrix, match="strong component of row 1"):
        m_matrix_certificate([[1.0, 0, 0], [0, 1.0, -1.0], [0, -1.0, 1.0]])
    with pytest.raises(NotAnMMatrix, match="strong component of row 0"):
        m_matrix_certificate([[1.0, -2.0], [-2.0, 1.0]])
    with pytest.raises(NotAnMMatrix, match="entry 1 of u is -1, not positive"):
        m_matrix_certificate(A, [1.0, -1.0])
    with pytest.raises(NotAnMMatrix, match="entry 0 of A u is -1, not confirmed"):
        m_matrix_certificate(A, [1.0, 3.0])
    with pytest.raises(NotAnMMatrix, match="entry 1 of A' v is -1, not confirmed"):
        m_matrix_certificate(A, None, [3.0, 1.0])
    with pytest.raises(MatrixError, match="shape"):
        m_matrix_certificate(A, [1.0])
    with pytest.raises(NoCertificate):
        m_matrix_certificate(A, [1.0, 1.9], [1.9, 1.0], max_condition=2)
    with pytest.raises(NotAnHMatrix, match="strong component of row 0"):
        h_matrix_certificate([[1.0, 2.0], [2.0, 1.0]])


@pytest.mark.parametrize("function", [m_matrix_certificate, h_matrix_certificate, perron_certificate])
def test_malformed_matrices_are_refused(function):
    bad = [[[1.0, 2.0]], [[math.nan]], [1.0, 2.0], np.zeros((0, 0)), [["a"]]]
    for A in [*bad, sparse.csr_array([[1.0, 2.0]]), sparse.csr_array([[math.inf]]), sparse.csr_array([[1j]])]:
        with pytest.raises(MatrixError):
            function(A)
    for limit in (0.5, math.nan):
        with pytest.raises(MatrixError, match="max_condition"):
            h_matrix_certificate([[1.0]], max_condition=limit)


# ---------------------------------------------------------------------- H-matrices


@settings(max_examples=8)
@given(SEEDS, st.integers(1, 10), st.sampled_from([1.0, 3.0]))
def test_an_h_matrix_is_certified_by_its_comparison_matrix(seed, n, magnitude):
    A = random_h_matrix(np.random.default_rng(seed), n, magnitude)
    found, least = h_matrix_certificate(A), m_matrix_certificate(comparison_matrix(A))
    assert least.rate <= found.rate <= spectral_rate(A) * (1 + 1e-9)
    assert found.upper == math.inf
    assert proved(A, found)


def test_a_large_sparse_h_matrix():
    """Far more rows than a dense matrix of them would fit."""
    n = 100_000
    rng = np.random.default_rng(1)
    rows, columns = rng.integers(1, n, 3 * n), rng.random(3 * n)
    W = sparse.coo_array((rng.choice([-1.0, 1.0], 3 * n), (rows, (columns * rows).astype(int))), shape=(n, n)).tocsr()
    A = sparse.diags_array(abs(W).sum(axis=1) + 0.5) - W
    found = h_matrix_certificate(A)
    assert found.rate >= 2 * 0.5 * (1 - 2e-6)
    assert np.isfinite(found.log_omega).all()


# ---------------------------------------------------------------------- Perron vectors


@given(SEEDS, st.integers(2, 12))
def test_the_perron_certificate_of_an_unbalanced_digraph(seed, n):
    L = signed_ring(np.random.default_rng(seed), n)
    found = perron_certificate(L)
    p, M = found.omega, comparison_matrix(L)
    assert np.abs(p @ M).max() <= 1e-14 * n * (p @ np.abs(M)).max()
    half = np.sqrt(p)
    B = half[:, None] * L / half
    assert found.rate == pytest.approx(np.linalg.eigvalsh(B + B.T)[0], rel=1e-7)
    assert 0 < found.rate <= spectral_rate(L) * (1 + 1e-9)
    assert proved(L, found, 1e-8)


@given(SEEDS, st.integers(2, 10))
def test_a_balanced_digraph_has_none(seed, n):
    rng = np.random.default_rng(seed)
    camps = rng.choice([-1.0, 1.0], n)
    L = camps[:, None] * comparison_matrix(signed_ring(rng, n)) * camps
    with pytest.raises(NoCertificate, match="balanced"):
        perron_certificate(L)


@given(SEEDS, st.integers(2, 8))
def test_the_left_vector_has_full_accuracy_over_twelve_decades(seed, n):
    L = signed_ring(np.random.default_rng(seed), n, 6.0)
    M = comparison_matrix(L)
    p = np.exp(closed_form._log_left_vector(sparse.csr_array(M)))
    # The same elimination in rationals.
    exact = [[Fraction(abs(x)) for x in row] for row in M]
    for k in range(n - 1, 0, -1):
        out = sum(exact[k][:k])
        for i in range(k):
            exact[i][k] /= out
            for j in range(k):
                exact[i][j] += exact[i][k] * exact[k][j]
    q = [Fraction(1)]
    for k in range(1, n):
        q.append(sum((q[j] * exact[j][k] for j in range(k)), Fraction(0)))
    assert p / p[0] == pytest.approx([float(x) for x in q], rel=1e-12)


@settings(max_examples=8)
@given(SEEDS, st.integers(2, 10))
def test_perron_vectors_in_other_scales_give_the_same_rate(seed, n):
    """``D L D^-1`` has ``M u = 0`` with ``u = D 1``: the rate does not change."""
    rng = np.random.default_rng(seed)
    L, d = signed_ring(rng, n), 10.0 ** rng.uniform(-1, 1, n)
    assert perron_certificate(d[:, None] * L / d).rate == pytest.approx(perron_certificate(L).rate, rel=1e-6)


def test_perron_certificates_of_large_digraphs_stay_sparse(monkeypatch):
    L = signed_ring(np.random.default_rng(3), 150)
    dense = perron_certificate(L)
    monkeypatch.setattr(closed_form, "DENSE_ROWS", 10)
    monkeypatch.setattr(closed_form, "ELIMINATION_ROWS", 10)
    thin = perron_certificate(L)
    assert thin.rate == pytest.approx(dense.rate, rel=1e-6)
    assert thin.log_omega == pytest.approx(dense.log_omega, abs=1e-9)


def test_what_has_no_perron_certificate():
    with pytest.raises(NotAnHMatrix, match="reducible"):
        perron_certificate(np.eye(2))
    with pytest.raises(NotAnHMatrix, match="diagonal entry 0"):
        perron_certificate([[0.0, 1.0], [1.0, 1.0]])
    with pytest.raises(NotAnHMatrix, match="eigenvalue -1"):
        perron_certificate([[1.0, 2.0], [2.0, 1.0]])
    assert perron_certificate([[3.0]]).rate == pytest.approx(6, rel=1e-12)
