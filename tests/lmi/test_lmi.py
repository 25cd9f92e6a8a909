"""Facts about diagonal Lyapunov matrices: classes of matrices, search, coupling, exact proof (Lemmas 4 and 5)."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import cvxpy as cp
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from selection import thinned

import lmi
import ptcc_certify
from lmi.definiteness_proofs import _integers, eliminate
from lmi.exact import fast

SEEDS = st.integers(0, 2**32 - 1)


def random_m_matrix(rng: np.random.Generator, n: int, magnitude: float = 1.0) -> np.ndarray:
    """``D - B`` with nonnegative ``B``, weakly dominant, some rows strictly: reducible and irreducible ones."""
    B = (
        rng.random((n, n))
        * (rng.random((n, n)) < rng.uniform(0.1, 1.0))
        * 10.0 ** rng.uniform(-magnitude, magnitude, (n, n))
    )
    np.fill_diagonal(B, 0.0)
    slack = rng.random(n) * 10.0 ** rng.uniform(-magnitude, magnitude)
    return np.diag(B.sum(axis=1) + slack) - B


def random_h_matrix(rng: np.random.Generator, n: int, magnitude: float = 1.0) -> np.ndarray:
    M = random_m_matrix(rng, n, magnitude)
    sign = np.where(rng.random((n, n)) < 0.5, -1.0, 1.0)
    np.fill_diagonal(sign, 1.0)
    return M * sign


def test_import_lmi_is_ours():
    assert Path(lmi.__file__).parent.parent == Path(ptcc_certify.__file__).parent.parent
    assert set(lmi.__all__) <= set(dir(lmi))
    for name in lmi.__all__:
        assert getattr(lmi, name) is not None
    with pytest.raises(AttributeError):
        lmi.no_such_name  # noqa: B018


# ---------------------------------------------------------------------- classes


@given(SEEDS, st.integers(1, 8))
def test_an_m_matrix_has_a_witness_and_eigenvalues_in_the_right_half_plane(seed, n):
    A = random_m_matrix(np.random.default_rng(seed), n)
    u = lmi.m_matrix_witness(A)
    assert u is not None
    assert (u > 0).all()
    assert (A @ u > 0).all()
    assert np.linalg.eigvals(A).real.min() > 0


@given(SEEDS, st.integers(1, 8))
def test_a_witness_never_lies(seed, n):
    """Whatever Z-matrix is asked about: a witness implies eigenvalues in the right half plane."""
    rng = np.random.default_rng(seed)
    A = -rng.random((n, n))
    np.fill_diagonal(A, rng.uniform(0, n, n))
    if lmi.is_m_matrix(A):
        assert np.linalg.eigvals(A).real.min() > 0
    assert not lmi.is_m_matrix(A - np.diag(A.sum(axis=1)))  # row sums 0: singular


def test_what_is_not_an_m_or_h_matrix():
    assert not lmi.is_m_matrix([[1.0, 2.0], [0.0, 1.0]])  # not a Z-matrix
    assert not lmi.is_m_matrix([[-1.0]])
    assert not lmi.is_m_matrix([[0.0]])
    assert not lmi.is_h_matrix([[1.0, 2.0], [2.0, 1.0]])
    assert lmi.is_h_matrix([[-1.0]])
    with pytest.raises(lmi.NotAnHMatrix, match="diagonal entry 0 is -1"):
        lmi.h_matrix_lyapunov([[-1.0]])
    with pytest.raises(lmi.NotAnHMatrix, match="no positive u"):
        lmi.h_matrix_lyapunov([[1.0, 2.0], [2.0, 1.0]])


@pytest.mark.parametrize("bad", [[[1.0, 2.0]], [[math.nan]], [[math.inf]], [1.0, 2.0], np.zeros((2, 2, 2))])
def test_malformed_matrices_are_refused(bad):
    for function in (lmi.comparison_matrix, lmi.is_h_matrix, lmi.diagonal_lyapunov, lmi.h_matrix_diagonal):
        with pytest.raises(lmi.MatrixError):
            function(bad)


# ---------------------------------------------------------------------- Lemma 4 and the search


@settings(max_examples=12)
@given(SEEDS, st.integers(1, 7))
def test_lemma_4_every_h_matrix_has_a_diagonal_lyapunov_matrix(seed, n):
    A = random_h_matrix(np.random.default_rng(seed), n)
    found = lmi.h_matrix_lyapunov(A)
    S = np.diag(found.omega) @ A
    assert found.omega.min() > 0
    assert found.omega.max() == 1
    assert np.linalg.eigvalsh(S + S.T)[0] == pytest.approx(found.rate, rel=1e-9)
    assert 0 < found.rate <= 2 * np.linalg.eigvals(A).real.min() * (1 + 1e-9)


@given(SEEDS, st.integers(1, 30), st.sampled_from([0.0, 1.0, 3.0]))
def test_the_closed_form_of_an_h_matrix_is_proved_exactly(seed, n, magnitude):
    A = random_h_matrix(np.random.default_rng(seed), n, magnitude)
    omega = [Fraction(w) for w in lmi.h_matrix_diagonal(A)]
    exact = [[Fraction(x) for x in row] for row in A]
    assert lmi.prove_positive_definite(
        [[omega[i] * exact[i][j] + omega[j] * exact[j][i] for j in range(n)] for i in range(n)]
    )


def other_solver(A: np.ndarray) -> float:
    """The same optimum by SCS, written with a full symmetric matrix variable instead of ours."""
    n = len(A)
    omega, t, S = cp.Variable(n), cp.Variable(), cp.Variable((n, n), PSD=True)
    product = cp.multiply(cp.reshape(omega, (n, 1), order="C") @ np.ones((1, n)), A)
    problem = cp.Problem(cp.Maximize(t), [product + product.T - t * np.eye(n) == S, omega >= 0, omega <= 1])
    problem.solve(solver=cp.SCS, eps_abs=1e-9, eps_rel=1e-9, max_iters=200_000)
    return float(t.value)


@pytest.mark.parametrize("seed", thinned(range(12)))
def test_the_search_reaches_the_optimum_of_another_solver(seed):
    rng = np.random.default_rng(seed)
    A = random_h_matrix(rng, int(rng.integers(2, 9)), 0.5)
    A /= np.abs(A).max()
    assert lmi.diagonal_lyapunov(A).rate == pytest.approx(other_solver(A), rel=1e-5)


@settings(max_examples=12)
@given(SEEDS, st.integers(2, 6))
def test_weak_duality_bounds_the_search(seed, n):
    """For X >= 0 with trace 1, every Omega <= I has margin <= sum_i max(0, 2 (A X)_ii)."""
    rng = np.random.default_rng(seed)
    A = random_h_matrix(rng, n)
    Y = rng.normal(size=(n, n))
    X = Y @ Y.T
    X /= np.trace(X)
    assert lmi.diagonal_lyapunov(A).rate <= np.maximum(0, 2 * np.diag(A @ X)).sum() * (1 + 1e-7) + 1e-9


def test_a_matrix_without_a_diagonal_lyapunov_matrix():
    """Stable, yet no diagonal matrix serves: a diagonal entry is negative."""
    with pytest.raises(lmi.NoCertificate):
        lmi.diagonal_lyapunov([[-1.0, -4.0], [4.0, 3.0]])
    with pytest.raises(lmi.NoCertificate):
        lmi.diagonal_lyapunov(np.diag([1.0, -1.0]))
    with pytest.raises(lmi.MatrixError, match="objective"):
        lmi.diagonal_lyapunov([[1.0]], objective="beauty")
    with pytest.raises(lmi.MatrixError, match="no rows"):
        lmi.diagonal_lyapunov(np.zeros((0, 0)))


@settings(max_examples=12)
@given(SEEDS, st.integers(2, 6), st.floats(1e-6, 1e6))
def test_the_rate_scales_with_the_matrix(seed, n, c):
    A = random_h_matrix(np.random.default_rng(seed), n)
    assert lmi.diagonal_lyapunov(c * A).rate == pytest.approx(c * lmi.diagonal_lyapunov(A).rate, rel=1e-5)


def test_a_long_chain_of_followers():
    n = 100
    A = np.eye(n) - np.eye(n, k=-1)
    found = lmi.h_matrix_lyapunov(A)
    assert 0 < found.rate < 2
    assert found.rate > 2 * (1 - math.cos(math.pi / (n + 1))) * 0.999  # Omega = I is admissible


# ---------------------------------------------------------------------- Lemma 5 and the coupling


@given(SEEDS, st.integers(1, 5), st.integers(1, 5), st.floats(-2, 2))
def test_lemma_5_schur_complement(seed, n, m, shift):
    rng = np.random.default_rng(seed)
    S2, Y, Z = rng.normal(size=(m, n)), rng.normal(size=(n, n)), rng.normal(size=(m, m))
    S3 = Z @ Z.T + 0.1 * np.eye(m)
    S1 = Y @ Y.T + S2.T @ np.linalg.solve(S3, S2) + shift * np.eye(n)
    whole = np.linalg.eigvalsh(np.block([[S1, S2.T], [S2, S3]]))
    swapped = np.linalg.eigvalsh(np.block([[S3, S2], [S2.T, S1]]))
    assert whole == pytest.approx(swapped, abs=1e-9)
    if abs(whole[0]) > 1e-9:
        assert lmi.schur_positive_definite(S1, S2, S3) == bool(whole[0] > 0)
    with pytest.raises(lmi.MatrixError, match="S3"):
        lmi.schur_positive_definite(S1, S2, -S3)


def random_coupling(rng: np.random.Generator) -> lmi.Coupling:
    n_L, n_F = int(rng.integers(1, 5)), int(rng.integers(1, 6))
    Y = rng.normal(size=(n_L, n_L))
    A_F = random_h_matrix(rng, n_F)
    omega_F = lmi.h_matrix_diagonal(A_F)
    return lmi.Coupling(
        Y @ Y.T + 0.1 * np.eye(n_L), rng.uniform(0.05, 1, n_L), omega_F, rng.normal(size=(n_F, n_L)), A_F
    )


@given(SEEDS)
def test_the_exact_interval_contains_the_printed_one_and_ends_where_definiteness_ends(seed):
    coupling = random_coupling(np.random.default_rng(seed))
    interval = coupling.interval()
    assert 0 < interval.printed <= interval.exact * (1 + 1e-9)
    assert np.linalg.eigvalsh(coupling.phi(interval.exact * (1 - 1e-6)))[0] > 0
    assert np.linalg.eigvalsh(coupling.phi(interval.exact * (1 + 1e-6)))[0] < 0


@settings(max_examples=10)
@given(SEEDS)
def test_the_best_rho_beats_a_thousand_random_ones(seed):
    rng = np.random.default_rng(seed)
    coupling = random_coupling(rng)
    best = coupling.rate(coupling.best_rho())
    end = coupling.interval().exact
    tried = np.concatenate([rng.uniform(0, end, 500), end * 10.0 ** rng.uniform(-6, 0, 500)])
    assert best >= max(coupling.rate(rho) for rho in tried) * (1 - 1e-9)


def test_uncoupled_followers_leave_rho_free():
    coupling = lmi.Coupling(np.eye(2), np.ones(2), np.ones(1), np.zeros((1, 2)), np.array([[3.0]]))
    assert coupling.interval() == lmi.RhoInterval(math.inf, math.inf)
    assert coupling.rate(coupling.best_rho()) == pytest.approx(1.0)


@settings(max_examples=10)
@given(SEEDS)
def test_the_joint_search_is_at_least_as_good_as_block_by_block(seed):
    rng = np.random.default_rng(seed)
    n_L, n_F = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    omega, decrease = rng.uniform(0.1, 1, n_L), rng.uniform(0.1, 1, n_L)
    A_FL, A_F = -rng.random((n_F, n_L)), random_h_matrix(rng, n_F, 0.3)
    joint = lmi.coupled_lyapunov([lmi.FixedLeader(omega, decrease)], A_FL, A_F).followers
    alone = lmi.h_matrix_lyapunov(A_F).omega

    def rate(followers: np.ndarray) -> float:
        coupling = lmi.Coupling(np.diag(decrease), omega, followers, A_FL, A_F)
        return coupling.rate(coupling.best_rho())

    assert rate(joint) >= rate(alone) * (1 - 1e-6)


def test_free_leaders_alone_and_shapes():
    A = np.array([[2.0, 1.0], [-1.0, 2.0]])
    found = lmi.coupled_lyapunov([lmi.FreeLeader(A)], np.zeros((0, 2)), np.zeros((0, 0)))
    sparse_block = lmi.coupled_lyapunov([lmi.FreeLeader(sparse.csr_array(A))], np.zeros((0, 2)), np.zeros((0, 0)))
    assert np.array_equal(sparse_block.leaders[0], found.leaders[0])
    assert found.leaders[0] == pytest.approx([1, 1], rel=1e-6)
    assert found.followers.size == 0
    with pytest.raises(lmi.MatrixError, match="A_FL"):
        lmi.coupled_lyapunov([lmi.FreeLeader(A)], np.zeros((1, 3)), np.eye(1))
    with pytest.raises(lmi.MatrixError, match="no leader"):
        lmi.coupled_lyapunov([], np.zeros((1, 0)), np.eye(1))


# ---------------------------------------------------------------------- exact proof


def rational_matrix(rng: np.random.Generator, n: int, shift: Fraction) -> list[list[Fraction]]:
    Y = [[Fraction(int(rng.integers(-20, 21)), int(rng.integers(1, 9))) for _ in range(n)] for _ in range(n)]
    return [[sum((Y[i][k] * Y[j][k] for k in range(n)), shift * (i == j)) for j in range(n)] for i in range(n)]


@given(
    SEEDS, st.integers(1, 6), st.sampled_from([Fraction(0), Fraction(1, 10**30), Fraction(-1, 10**30), Fraction(-5)])
)
def test_definiteness_is_decided_exactly(seed, n, shift):
    """Oracle: all leading principal minors by python-flint's rational determinant."""
    S = rational_matrix(np.random.default_rng(seed), n, shift)
    minors = [
        flint.fmpq_mat(k, k, [flint.fmpq(x.numerator, x.denominator) for row in S[:k] for x in row[:k]]).det()
        for k in range(1, n + 1)
    ]
    proof = lmi.prove_positive_definite(S)
    assert proof.proved == all(m > 0 for m in minors)
    if not proof:
        assert minors[proof.failed_at] <= 0
        assert all(m > 0 for m in minors[: proof.failed_at])


@given(SEEDS, st.integers(1, 5), st.integers(-300, 300))
def test_definiteness_does_not_depend_on_scale(seed, n, exponent):
    rng = np.random.default_rng(seed)
    S = rational_matrix(rng, n, Fraction(1, 7))
    d = [Fraction(10) ** int(rng.integers(-40, 40)) for _ in range(n)]
    scaled = [[Fraction(10) ** exponent * d[i] * S[i][j] * d[j] for j in range(n)] for i in range(n)]
    assert lmi.prove_positive_definite(scaled).proved


def test_a_singular_or_unsymmetric_matrix_is_never_proved():
    assert not lmi.prove_positive_definite([[1, 1], [1, 1]])
    assert not lmi.prove_positive_definite([[0]])
    assert lmi.prove_positive_definite([])
    with pytest.raises(lmi.MatrixError, match="symmetric"):
        lmi.prove_positive_definite([[2, 1], [0, 2]])
    with pytest.raises(lmi.MatrixError, match="square"):
        lmi.prove_positive_definite([[2, 1]])


@given(SEEDS, st.integers(1, 6))
def test_a_proved_margin_is_below_and_near_the_smallest_eigenvalue(seed, n):
    S = rational_matrix(np.random.default_rng(seed), n, Fraction(1))
    smallest = float(np.linalg.eigvalsh(np.array([[float(x) for x in row] for row in S]))[0])
    m = lmi.prove_margin(S, smallest)
    assert m is not None
    assert smallest * (1 - 1e-6) <= float(m) < smallest * (1 + 1e-6)
    assert lmi.prove_margin(S, -1.0) is None
    assert lmi.prove_margin(S, math.nan) is None
    assert lmi.prove_margin([[Fraction(1)]], 1e9) is None  # a wrong guess is not proved


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(2, 60))
def test_rounding_to_bits(value, bits):
    rounded = lmi.round_to_bits(value, bits)
    assert abs(rounded - Fraction(value)) <= abs(Fraction(value)) / 2**bits


@settings(max_examples=12)
@given(SEEDS, st.integers(21, 40), st.sampled_from([0.0, 3.0]), st.booleans())
def test_both_exact_routes_agree(seed, n, magnitude, spoil):
    """A rounded factor (n > 20) and the elimination, judged by python-flint's determinants."""
    rng = np.random.default_rng(seed)
    A = random_h_matrix(rng, n, magnitude)
    omega = lmi.h_matrix_diagonal(A)
    S = [
        [Fraction(omega[i]) * Fraction(A[i, j]) + Fraction(omega[j]) * Fraction(A[j, i]) for j in range(n)]
        for i in range(n)
    ]
    if spoil:
        S[n - 1][n - 1] = Fraction(0)
    rows = _integers(S)[0]
    quick = fast.factor(rows) is not None
    assert (eliminate(rows) is None) is not spoil
    assert lmi.prove_positive_definite(S).proved is not spoil
    assert not (spoil and quick)
    whole = flint.fmpq_mat(n, n, [flint.fmpq(x.numerator, x.denominator) for row in S for x in row])
    assert (whole.det() > 0) or spoil


def test_a_rounded_factor_never_proves_a_singular_or_indefinite_matrix():
    n = 30
    singular = [[n - 1 if i == j else -1 for j in range(n)] for i in range(n)]  # a Laplacian
    for shift in (0, Fraction(-1, 10**18)):
        S = [[Fraction(x) + (shift if i == j else 0) for j, x in enumerate(row)] for i, row in enumerate(singular)]
        assert fast.factor(_integers(S)[0]) is None
        assert not lmi.prove_positive_definite(S)
    better = [
        [Fraction(x) + (Fraction(1, 10**6) if i == j else 0) for j, x in enumerate(r)] for i, r in enumerate(singular)
    ]
    assert fast.factor(_integers(better)[0]) is not None


def test_exact_proofs_take_numpy_numbers_and_refuse_others():
    assert lmi.prove_positive_definite(np.array([[2, 1], [1, 1]]))
    assert lmi.prove_positive_definite(np.array([[2.0, 1.0], [1.0, 1.0]]))
    for bad in ([[math.nan]], [["x"]], [[1j]], [[math.inf]]):
        with pytest.raises(lmi.MatrixError, match="finite real"):
            lmi.prove_positive_definite(bad)


def test_leaders_that_do_not_decay_are_refused():
    with pytest.raises(lmi.MatrixError, match="positive decrease"):
        lmi.coupled_lyapunov([lmi.FixedLeader(np.ones(2), np.array([-2.0, 2.0]))], [[-1.0, 0.0]], [[1.0]])
    with pytest.raises(lmi.MatrixError, match="admissible"):
        lmi.Coupling(np.eye(1), np.ones(1), np.ones(1), np.array([[1.0]]), np.array([[-1.0]])).interval()
    weak = lmi.Coupling(np.eye(1), np.ones(1), np.ones(1), np.array([[-1e-170]]), np.array([[1.0]])).interval()
    assert math.isfinite(weak.exact)  # a weak coupling still bounds rho


def test_where_clarabel_panics_it_is_asked_again_without_splitting_the_matrix():
    """It panics on this pattern: five followers, three of which listen to each other, of nineteen leaders."""
    A_F = np.diag([3.5, 9.9, 3.2, 2.8, 4.9])
    A_F[[0, 1, 2, 4], [4, 4, 0, 1]] = 0.36, 3.2, -1.7, -4.1
    A_FL = np.zeros((5, 19))
    A_FL[[0, 1, 1, 2, 2, 3, 3, 4, 4], [8, 5, 18, 2, 10, 3, 13, 11, 12]] = 3.1, 4.6, -2, -0.56, 0.94, -2, -0.8, 0.5, 0.3
    found = lmi.coupled_lyapunov([lmi.FixedLeader(np.ones(19), np.full(19, 3.0))], A_FL, A_F)
    form = np.block([[3 * np.eye(19), A_FL.T * found.followers], [found.followers[:, None] * A_FL, np.zeros((5, 5))]])
    form[19:, 19:] = found.followers[:, None] * A_F + A_F.T * found.followers
    assert np.linalg.eigvalsh(form)[0] > 0


class PanicException(BaseException):
    """The name of what pyo3 raises."""


@pytest.mark.parametrize(
    ("raised", "seen"),
    [
        (PanicException("index"), "Clarabel panicked"),
        (ValueError("contains NaN or Inf"), "NaN"),
        (KeyboardInterrupt(), ""),
    ],
)
def test_what_a_solver_raises_is_no_certificate_but_for_interrupts(monkeypatch, raised, seen):
    def solve(self, **options):
        raise raised

    monkeypatch.setattr(cp.Problem, "solve", solve)
    with pytest.raises(lmi.NoCertificate if seen else KeyboardInterrupt, match=seen or None):
        lmi.diagonal_lyapunov([[2.0, 1.0], [1.0, 2.0]])
