"""The search for diagonal Lyapunov matrices with cvxpy and Clarabel.

The solver only proposes: every result is recomputed from eigenvalues of the matrices that it returns, and a
certificate is proved elsewhere (:mod:`lmi.exact`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.closed_form import h_matrix_diagonal
from lmi.errors import MatrixError, NoCertificate
from lmi.matrices import square

if TYPE_CHECKING:
    import cvxpy as cp


#: A joint rate, in units of the largest entry, below this multiple of the tolerance is noise of the solver.
_RESOLVED = 100.0


@dataclass(frozen=True)
class DiagonalCertificate:
    """A diagonal Lyapunov matrix ``Omega = diag(omega)`` of ``A``, scaled to ``max omega = 1``.

    Attributes
    ----------
    omega : (n,) array
        Positive.
    margin : float
        ``lmin(Omega A + A' Omega)``, from eigenvalues of the returned matrix.
    rate : float
        ``margin / max(omega)``: ``V = x' Omega x`` obeys ``V' <= -rate V`` along ``x' = -A x``.
    condition : float
        ``max(omega) / min(omega)``.
    """

    omega: np.ndarray
    margin: float
    rate: float
    condition: float


def diagonal_margin(A: Any, omega: np.ndarray) -> float:
    """Return ``lmin(Omega A + A' Omega)`` with ``Omega = diag(omega)``.

    Examples
    --------
    >>> diagonal_margin([[1.0, 0.0], [0.0, 2.0]], [1.0, 1.0])
    2.0
    """
    S = np.asarray(omega)[:, None] * square(A)
    return float(np.linalg.eigvalsh(S + S.T)[0])


def diagonal_lyapunov(A: Any, *, objective: str = "margin", tolerance: float = 1e-9) -> DiagonalCertificate:
    """Find the diagonal ``Omega > 0`` that decays fastest in the sense of the quotient ``lmin / lmax``.

    Solves

        maximise t   subject to   Omega A + A' Omega >= t I,   0 <= Omega <= I,

    whose optimum is the largest ``lmin(Omega A + A' Omega) / lmax(Omega)``. Such an ``Omega`` exists for every
    nonsingular H-matrix with positive diagonal (Lemma 4) and for the Laplacian of every strongly connected
    structurally unbalanced signed digraph (Lemma 3.2), but the function takes any real square matrix.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Any real matrix; a diagonal Lyapunov matrix exists only if all its eigenvalues have positive real part (not
        a sufficient condition).
    objective : {"margin"}
        What to maximise.
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    DiagonalCertificate

    Raises
    ------
    MatrixError
        ``A`` is not square, not finite, or ``objective`` is unknown.
    NoCertificate
        The margin of what the solver returned is not positive: no diagonal Lyapunov matrix exists, or precision ends.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> found = diagonal_lyapunov([[2.0, -1.0], [-1.0, 2.0]])
    >>> round(found.rate, 6), found.omega.round(6)
    (2.0, array([1., 1.]))
    """
    if objective != "margin":
        raise MatrixError(f'objective "{objective}" is unknown; use "margin"')
    A = square(A)
    n = len(A)
    if n == 0:
        raise MatrixError("A has no rows")
    if n == 1:
        return _certificate(A, np.ones(1))
    scale = _scale(A)

    def problem(cp: Any) -> tuple[cp.Problem, cp.Variable]:
        omega, t = cp.Variable(n), cp.Variable()
        S = _symmetric_product(cp, omega, A / scale)
        return cp.Problem(cp.Maximize(t), [S - t * np.eye(n) >> 0, omega >= 0, omega <= 1]), omega

    omega = _solve(problem, tolerance)
    return _certificate(A, omega)


def h_matrix_lyapunov(A: Any, *, tolerance: float = 1e-9) -> DiagonalCertificate:
    """Lemma 4: a nonsingular H-matrix with positive diagonal has ``Omega > 0`` with ``Omega A + A' Omega > 0``.

    The hypothesis is tested first; then the search of :func:`diagonal_lyapunov` runs.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    DiagonalCertificate

    Raises
    ------
    NotAnHMatrix
        A diagonal entry is not positive, or ``M(A)`` has no positive ``u`` with ``M(A) u > 0``.

    Examples
    --------
    >>> h_matrix_lyapunov([[2.0, 1.0], [-1.0, 2.0]]).omega.round(6)
    array([1., 1.])
    """
    A = square(A)
    closed_form = h_matrix_diagonal(A)
    try:
        return diagonal_lyapunov(A, tolerance=tolerance)
    except NoCertificate:
        # The best margin can lie below what the solver resolves; the closed form exists all the same.
        return _certificate(A, closed_form)


@dataclass(frozen=True)
class FixedLeader:
    """A leader block whose Lyapunov matrix is known up to the scale shared by all such blocks.

    ``omega`` (k,) is the diagonal; ``decrease`` (k,) the diagonal of a matrix that bounds the decrease of
    ``x' diag(omega) x`` from below on the states that occur.
    """

    omega: np.ndarray
    decrease: np.ndarray


@dataclass(frozen=True)
class FreeLeader:
    """A leader block ``x' = -A x`` whose diagonal ``H`` is searched; its decrease counts as ``lmin(HA + A'H) I``."""

    A: np.ndarray


@dataclass(frozen=True)
class CoupledCertificate:
    """Diagonal Lyapunov matrices of leaders and followers, found together.

    Attributes
    ----------
    leaders : tuple of (k,) arrays
        For a fixed block its ``omega`` unchanged; for a free block relative to those.
    followers : (n_F,) array
        ``rho Omega_F``: the coupling factor is contained.
    """

    leaders: tuple[np.ndarray, ...]
    followers: np.ndarray


def coupled_lyapunov(
    leaders: Sequence[FixedLeader | FreeLeader], A_FL: Any, A_F: Any, *, tolerance: float = 1e-9
) -> CoupledCertificate:
    """Find free leader blocks, follower matrix and coupling factor in one semidefinite program.

    With ``Gamma`` the block diagonal of ``s diag(decrease)`` (fixed blocks) and ``t_k I`` (free blocks,
    ``H_k A_k + A_k' H_k >= t_k I``), solves

        maximise t   subject to   [[Gamma, A_FL' Y], [Y A_FL, Y A_F + A_F' Y]] >= t I,   all diagonals <= 1,

    whose optimum is the largest ``lmin(Pi) / lmax(H)`` of the paper over free blocks, ``Y = rho H_F`` and ``rho``.

    Parameters
    ----------
    leaders : sequence of FixedLeader or FreeLeader
    A_FL : (n_F, n_L) array
        Columns in the order of the leader blocks.
    A_F : (n_F, n_F) array

    Returns
    -------
    CoupledCertificate

    Raises
    ------
    MatrixError
        Shapes do not match, or there is no leader block.
    NoCertificate
        A free block or the follower block has no diagonal Lyapunov matrix that the solver can resolve.
    NotAnHMatrix
        The solver found no positive rate, and the follower block is not an H-matrix with positive diagonal.

    Examples
    --------
    >>> found = coupled_lyapunov([FixedLeader(np.ones(2), np.full(2, 2.0))], [[-1.0, 0.0]], [[1.0]])
    >>> (found.followers > 0).all()
    np.True_
    """
    A_F = square(A_F, "A_F")
    A_FL = np.asarray(A_FL.toarray() if hasattr(A_FL, "toarray") else A_FL, dtype=np.float64)
    sizes = [len(block.omega) if isinstance(block, FixedLeader) else len(square(block.A)) for block in leaders]
    n_L, n_F = sum(sizes), len(A_F)
    fixed = [block for block in leaders if isinstance(block, FixedLeader)]
    if any(not (b.omega.min() > 0 and b.decrease.min() > 0) for b in fixed if len(b.omega)):
        raise MatrixError("a fixed leader block needs a positive omega and a positive decrease")
    if n_L == 0:
        raise MatrixError("there is no leader block; use h_matrix_lyapunov for followers alone")
    if A_FL.shape != (n_F, n_L):
        raise MatrixError(f"A_FL has shape {A_FL.shape}, not {(n_F, n_L)}")
    # One unit for all blocks: the rate is the smallest eigenvalue of the whole matrix.
    scale = max(_scale(A_F), *(_scale(b.A) for b in leaders if isinstance(b, FreeLeader)), 1e-300)
    fixed_top = max((float(b.omega.max()) for b in fixed), default=1.0)

    def problem(cp: Any) -> tuple[cp.Problem, cp.Variable]:
        s = cp.Variable() if fixed else cp.Constant(1.0)
        t, Y = cp.Variable(), cp.Variable(n_F) if n_F else cp.Constant(np.zeros(0))
        diagonal, constraints, free = [], [Y >= 0, Y <= 1] if n_F else [], []
        if fixed:
            constraints += [s >= 0, s <= 1]
        for block, k in zip(leaders, sizes, strict=True):
            if isinstance(block, FixedLeader):
                diagonal.append(s * (block.decrease / (fixed_top * scale)))
            else:
                H, t_k = cp.Variable(k), cp.Variable()
                constraints += [H >= 0, H <= 1]
                if k > 1:
                    constraints.append(_symmetric_product(cp, H, square(block.A) / scale) - t_k * np.eye(k) >> 0)
                else:
                    constraints.append(2 * H[0] * float(np.squeeze(block.A)) / scale >= t_k)
                diagonal.append(t_k * np.ones(k))
                free.append(H)
        if n_F:
            followers = _symmetric_product(cp, Y, A_F / scale)
            coupling = cp.diag(Y) @ (A_FL / scale)
            Pi = cp.bmat([[cp.diag(cp.hstack(diagonal)), coupling.T], [coupling, followers]])
        else:
            Pi = cp.diag(cp.hstack(diagonal))
        constraints.append(Pi - t * np.eye(n_L + n_F) >> 0)
        return cp.Problem(cp.Maximize(t), constraints), cp.hstack([s, t, Y, *free] if n_F else [s, t, *free])

    values = _solve(problem, tolerance)
    s, t, Y, rest = values[0], values[1], values[2 : 2 + n_F], values[2 + n_F :]
    if not (t > _RESOLVED * tolerance and s > 0):
        return _block_by_block(leaders, A_F, fixed_top, tolerance)
    found, used = [], 0
    unit = fixed_top / s if fixed else 1.0
    for block, k in zip(leaders, sizes, strict=True):
        if isinstance(block, FixedLeader):
            found.append(block.omega)
        else:
            found.append(_positive(rest[used : used + k]) * unit)
            used += k
    return CoupledCertificate(tuple(found), _positive(Y) * unit if n_F else Y)


def _block_by_block(
    leaders: Sequence[FixedLeader | FreeLeader], A_F: np.ndarray, top: float, tolerance: float
) -> CoupledCertificate:
    """Find each block by itself, for when the best joint rate lies below what the solver resolves."""
    found = tuple(
        block.omega if isinstance(block, FixedLeader) else top * diagonal_lyapunov(block.A, tolerance=tolerance).omega
        for block in leaders
    )
    followers = top * h_matrix_lyapunov(A_F, tolerance=tolerance).omega if len(A_F) else np.zeros(0)
    return CoupledCertificate(found, followers)


def _certificate(A: np.ndarray, omega: np.ndarray) -> DiagonalCertificate:
    omega = _positive(omega)
    omega = omega / omega.max()
    margin = diagonal_margin(A, omega)
    if not margin > 0:
        raise NoCertificate(f"the best margin found is {margin:.3g}, which is not positive")
    return DiagonalCertificate(omega, margin, margin, float(1 / omega.min()))


def _positive(omega: np.ndarray) -> np.ndarray:
    """Lift entries that the solver left at or below zero."""
    top = float(np.max(omega, initial=0.0))
    if not (math.isfinite(top) and top > 0):
        raise NoCertificate("the solver returned no positive diagonal")
    return np.maximum(omega, 1e-14 * top)


def _scale(A: np.ndarray) -> float:
    """Return a unit in which the entries of ``A`` are at most 1."""
    return float(np.abs(A).max(initial=0.0)) or 1.0


def _symmetric_product(cp: Any, omega: Any, A: np.ndarray) -> Any:
    """Return ``Omega A + A' Omega`` as a cvxpy expression that keeps the zeros of ``A``."""
    from scipy import sparse

    product = cp.diag(omega) @ sparse.csr_array(A)
    return product + product.T


def _solve(problem: Callable[[Any], tuple[cp.Problem, cp.Expression]], tolerance: float) -> np.ndarray:
    """Solve with Clarabel and return the value of the expression; its status is not trusted, only its absence."""
    import warnings

    import cvxpy as cp

    built, expression = problem(cp)
    options = {"tol_gap_abs": tolerance * 1e-3, "tol_gap_rel": tolerance, "tol_feas": tolerance}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "solution may be inaccurate": every result is recomputed by the caller
        try:
            built.solve(solver=cp.CLARABEL, **options)
        except cp.SolverError as error:
            raise NoCertificate(f"the solver failed: {str(error).splitlines()[0]}") from None
    if expression.value is None or not np.isfinite(expression.value).all():
        raise NoCertificate(f"the solver answered {built.status}")
    return np.atleast_1d(np.asarray(expression.value, dtype=np.float64))
