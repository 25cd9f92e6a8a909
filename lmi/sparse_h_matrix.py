"""Certificates of sparse H-matrices by Krylov solves (a factor up to 2,000 rows), judged by their witnesses.

The comparison matrix ``M`` of an H-matrix with positive diagonal is a nonsingular M-matrix. For ``t`` below its
smallest eigenvalue, ``u = (M - t I)^-1 1`` and ``v = (M - t I)^-T 1`` are positive, and ``Omega = diag(v / u)`` has

    Omega A + A' Omega >= b Omega,      b = min_i (M u)_i / u_i + min_i (M' v)_i / v_i > 2 t.

A solve need not be accurate: whatever ``u, v > 0`` it gives, ``b`` is what they prove. Where the diagonal dominates,
as in Laplacians, a solve by BiCGSTAB with the diagonal as preconditioner takes some dozens of products.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, bicgstab, splu

from lmi.diagonal_solution import DiagonalCertificate
from lmi.errors import NoCertificate
from lmi.search_time import checkpoint

#: Inverse iterations at most; they end when the bound of the smallest eigenvalue gains less than this, relatively.
_ROUNDS, _GAIN = 40, 1e-9
#: Relative residual asked of a solve, and products spent on it at most.
_RESIDUAL, _PRODUCTS = 1e-10, 2000
#: A residual up to this share of the right-hand side in every row leaves a witness of a rate what it is.
_WITNESS_RESIDUAL = 0.05
#: Solves to a smaller tolerance than this are refined.
_REFINED = 1e-9
#: Up to these many rows a factor is made at once; up to so many that fill in, where Krylov solves fail.
DIRECT_ROWS, FILL_ROWS = 2000, 4000


class SparseHMatrix:
    """The comparison matrix ``M`` of a large sparse H-matrix, prepared for solves.

    Parameters
    ----------
    A : (n, n) sparse matrix

    Raises
    ------
    NoCertificate
        A diagonal entry is not positive.
    """

    def __init__(self, A: Any):
        A = sparse.csr_array(A, dtype=np.float64)
        self.diagonal: np.ndarray = A.diagonal()
        if not (self.diagonal > 0).all():
            raise NoCertificate("a diagonal entry is not positive")
        self.M: Any = sparse.csr_array(2 * sparse.diags_array(self.diagonal) - abs(A))
        self.Mt: Any = sparse.csr_array(self.M.T)

    def smallest(self) -> float:
        """Bound the smallest eigenvalue of ``M`` from below, ``min_i (M y)_i / y_i`` (Collatz), by inverse iteration.

        Raises
        ------
        NoCertificate
            No positive bound was found.
        """
        if (smallest := smallest_eigenvalue(self.M)) is None:
            raise NoCertificate("the comparison matrix is not a nonsingular M-matrix that Krylov solves resolve")
        return smallest[0]

    def certificate(self, t: float) -> DiagonalCertificate:
        """Return the certificate of ``u = (M - t I)^-1 1`` and ``v``; its witness is ``(u, v)``.

        Raises
        ------
        NoCertificate
            ``t`` is too near to the smallest eigenvalue, or beyond it.
        """
        u, v = positive_vector(self.M, t), positive_vector(self.Mt, t)
        if not ((u > 0).all() and (v > 0).all()):
            raise NoCertificate(f"no positive witness at {t:.6g}")
        rate = float(((self.M @ u) / u).min() + ((self.Mt @ v) / v).min())
        if not rate > 0:
            raise NoCertificate(f"the witness at {t:.6g} proves no positive rate")
        log_omega = np.log(v) - np.log(u)
        return DiagonalCertificate(log_omega - log_omega.max(), rate, witness=(u, v))


def smallest_eigenvalue(
    M: Any, shifted: bool = False, rounds: int = _ROUNDS, residual: float = _RESIDUAL
) -> tuple[float, np.ndarray] | None:
    """Bound the smallest eigenvalue of an M-matrix from below, ``min_i (M y)_i / y_i``, by inverse iteration.

    Parameters
    ----------
    M : (n, n) sparse array
    shifted : bool
        Whether, up to ``DIRECT_ROWS`` rows, the bound shifts the next solve (Noda's iteration).
    rounds : int
        Solves at most.
    residual : float
        Of a solve of more rows.

    Returns
    -------
    (float, (n,) array) or None
        The bound and its ``y``; None if no positive bound is found.

    Examples
    --------
    >>> round(smallest_eigenvalue(sparse.csr_array([[2.0, -1.0], [-1.0, 2.0]]))[0], 6)
    1.0
    """
    diagonal, n = M.diagonal(), M.shape[0]
    if not (diagonal > 0).all():
        return None
    factor = Factor(M) if n <= DIRECT_ROWS and not shifted else None
    y, best, low = np.ones(n), np.ones(n), 0.0
    for _ in range(rounds):
        try:
            if factor is not None:
                y = factor.solve(y)
            elif n <= DIRECT_ROWS:
                y = diagonal_factor(M - low * (1 - _GAIN) * sparse.eye_array(n, format="csr")).solve(y)
            else:
                y = solve(M, y, diagonal, residual)
        except RuntimeError:  # exactly singular
            break
        y = np.abs(y) / np.abs(y).max()
        if not (y > 0).all():
            break
        before, bound = low, float(((M @ y) / y).min())
        if bound > low:
            low, best = bound, y
        if low > 0 and low - before <= _GAIN * low:
            break
    return (low, best) if low > 0 else None


def positive_vector(M: Any, t: float) -> np.ndarray:
    """Return ``(M - t I)^-1 1``, positive for ``t`` below the smallest eigenvalue, as near as a witness needs.

    Examples
    --------
    >>> positive_vector(sparse.csr_array([[2.0, -1.0], [-1.0, 2.0]]), 0.5).round(6)
    array([2., 2.])
    """
    diagonal, ones = M.diagonal(), np.ones(M.shape[0])
    shifted = M - t * sparse.eye_array(ones.size, format="csr")
    room = np.maximum(diagonal - t, diagonal * 1e-3 + 1e-300)
    return solve(shifted, ones, room, _WITNESS_RESIDUAL / np.sqrt(ones.size))


def solve(B: Any, right: np.ndarray, diagonal: np.ndarray, tolerance: float = _RESIDUAL) -> np.ndarray:
    """Solve ``B x = right``: by a sparse factor if that is cheap, else by BiCGSTAB preconditioned by a diagonal.

    ``tolerance`` bounds the residual over ``right`` in the Euclidean norm; small ones are met by one refinement.
    What is not converged is returned as it is, to be judged by its residual. Above ``DIRECT_ROWS`` rows a factor is
    made only where BiCGSTAB fails and at most ``FILL_ROWS`` rows fill in: long chains converge slowly, and have sparse
    factors.

    Examples
    --------
    >>> solve(sparse.csr_array([[2.0, -1.0], [-1.0, 2.0]]), np.ones(2), np.full(2, 2.0)).round(9)
    array([1., 1.])
    """
    if B.shape[0] <= DIRECT_ROWS:
        return Factor(B).solve(right)
    x, converged = _krylov(B, right, diagonal, tolerance)
    return x if converged or fill_core(B) > FILL_ROWS else Factor(B).solve(right)


def solve_columns(B: Any, right: np.ndarray, diagonal: np.ndarray) -> np.ndarray | None:
    """Solve ``B X = right`` for the columns of ``right`` as :func:`solve` does, with one factor for all of them.

    None where a column is not converged: a factor would fill in, and no other column is tried.

    Examples
    --------
    >>> solve_columns(sparse.csr_array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2), np.full(2, 2.0)).round(3).tolist()
    [[0.667, 0.333], [0.333, 0.667]]
    """
    factor = Factor(B) if B.shape[0] <= DIRECT_ROWS else None
    result = np.empty(right.shape)
    for k, column in enumerate(right.T):
        converged = False
        if factor is None:
            result[:, k], converged = _krylov(B, column, diagonal, _RESIDUAL)
        if not converged and factor is None:
            if fill_core(B) > FILL_ROWS:
                return None
            factor = Factor(B)
        if factor is not None:
            result[:, k] = factor.solve(column)
    return result if np.isfinite(result).all() else None


def _krylov(B: Any, right: np.ndarray, diagonal: np.ndarray, tolerance: float) -> tuple[np.ndarray, bool]:
    """Solve by BiCGSTAB, refined once if the tolerance is small; tell whether it converged."""
    own = LinearOperator(B.shape, matvec=lambda r: r / diagonal)
    x, info = bicgstab(B, right, rtol=tolerance, maxiter=_PRODUCTS, M=own, callback=_in_time)
    if info < 0:  # from a right-hand side of few rows the search reaches few a step, and breaks down: begin everywhere
        start = np.random.default_rng(0).uniform(-1, 1, right.size) * np.abs(right / diagonal).max()
        x, _ = bicgstab(B, right, x0=start, rtol=tolerance, maxiter=_PRODUCTS, M=own, callback=_in_time)
    residual = right - B @ x
    loose = tolerance > _REFINED
    if not np.linalg.norm(residual) <= (2 if loose else 1e3) * tolerance * np.linalg.norm(right):
        return x, False
    if loose:
        return x, True
    correction, _ = bicgstab(B, residual, rtol=1e-6, maxiter=_PRODUCTS, M=own, callback=_in_time)
    better = x + correction
    return (better if np.abs(right - B @ better).max() < np.abs(residual).max() else x), True


def _in_time(_: np.ndarray) -> None:
    checkpoint()


def fill_core(block: Any) -> int:
    """Return how many rows are left when those coupled to at most two others are taken off, again and again.

    A sparse factor of these fills in, that of the others does not.

    Examples
    --------
    >>> fill_core(sparse.csr_array(np.ones((5, 5)))), fill_core(sparse.eye_array(5, k=1) + sparse.eye_array(5))
    (5, 0)
    """
    near = sparse.csr_array(abs(block))
    near = sparse.csr_array(near + near.T)
    near.setdiag(0)
    near.eliminate_zeros()
    near.data = np.ones_like(near.data)
    remaining = np.ones(near.shape[0])
    while (few := (remaining > 0) & (near @ remaining <= 2)).any():
        remaining[few] = 0
    return int(remaining.sum())


class Factor:
    """A sparse factor of a matrix with its rows scaled to a unit diagonal.

    Parameters
    ----------
    B : (n, n) sparse matrix

    Examples
    --------
    >>> Factor(sparse.csr_array([[0.0, 2.0], [4.0, 1.0]]) + 4 * sparse.eye_array(2)).solve(np.ones(2)).round(3)
    array([0.25, 0.  ])
    """

    def __init__(self, B: Any):
        self._B, self._scale = B, 1 / np.abs(B.diagonal())
        try:
            self._factor: Any = diagonal_factor(sparse.csc_array(sparse.diags_array(self._scale) @ B))
        except RuntimeError:  # exactly singular
            self._factor = None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve ``B x = right`` and refine once; NaN of a matrix that is exactly singular."""
        if self._factor is None:
            return np.full(right.shape, np.nan)
        x = self._factor.solve(self._scale * right)
        return np.asarray(x + self._factor.solve(self._scale * (right - self._B @ x)))


def diagonal_factor(A: Any) -> Any:
    """Factor a sparse matrix with its diagonal entries as pivots, in an order of little fill.

    Of an M-matrix, solutions of positive systems stay positive.

    Raises
    ------
    RuntimeError
        The matrix is exactly singular.

    Examples
    --------
    >>> diagonal_factor(sparse.eye_array(2) * 4.0).solve(np.ones(2))
    array([0.25, 0.25])
    """
    return splu(sparse.csc_array(A), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
