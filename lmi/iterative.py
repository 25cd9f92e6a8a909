"""Certificates of large sparse H-matrices without any factorisation: Krylov solves, judged by their witnesses.

The comparison matrix ``M`` of an H-matrix with positive diagonal is a nonsingular M-matrix. For ``t`` below its
smallest eigenvalue, ``u = (M - t I)^-1 1`` and ``v = (M - t I)^-T 1`` are positive, and ``Omega = diag(v / u)`` has

    Omega A + A' Omega >= b Omega,      b = min_i (M u)_i / u_i + min_i (M' v)_i / v_i > 2 t.

A solve need not be accurate: whatever ``u, v > 0`` it gives, ``b`` is what they prove. Where the diagonal dominates,
as in Laplacians, a solve by BiCGSTAB with the diagonal as preconditioner takes some dozens of products.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, bicgstab

from lmi.certificate import DiagonalCertificate
from lmi.errors import NoCertificate

#: Inverse iterations at most; they end when the bound of the smallest eigenvalue gains less than this, relatively.
_ROUNDS, _GAIN = 40, 1e-9
#: Relative residual asked of a solve, and products spent on it at most.
_RESIDUAL, _PRODUCTS = 1e-10, 2000


@dataclass(frozen=True, eq=False)
class SparseHMatrix:
    """The comparison matrix of a large sparse H-matrix, prepared for solves.

    Parameters
    ----------
    A : (n, n) sparse matrix
        Positive diagonal.
    """

    A: Any

    def __post_init__(self) -> None:
        A = sparse.csr_array(self.A, dtype=np.float64)
        diagonal = A.diagonal()
        if not (diagonal > 0).all():
            raise NoCertificate("a diagonal entry is not positive")
        M = sparse.csr_array(2 * sparse.diags_array(diagonal) - abs(A))
        object.__setattr__(self, "A", A)
        object.__setattr__(self, "diagonal", diagonal)
        object.__setattr__(self, "M", M)
        object.__setattr__(self, "Mt", sparse.csr_array(M.T))

    diagonal: np.ndarray = None  # type: ignore[assignment]
    M: Any = None
    Mt: Any = None

    def smallest(self) -> tuple[float, float]:
        """Bound the smallest eigenvalue of ``M`` from below and above (Collatz and Wielandt), by inverse iteration.

        Raises
        ------
        NoCertificate
            No positive lower bound was found.
        """
        x, low, high = np.ones(self.M.shape[0]), 0.0, np.inf
        for _ in range(_ROUNDS):
            y = solve(self.M, x, self.diagonal)
            y = np.abs(y) / np.abs(y).max()
            if not (y > 0).all():
                break
            ratio = (self.M @ y) / y
            before, low = low, max(low, float(ratio.min()))
            # One step of the iteration shrinks y by the eigenvalue in the norm; Rayleigh quotients bound nothing here.
            high = min(high, float(ratio.max()))
            x = y
            if low > 0 and low - before <= _GAIN * low:
                break
        if low <= 0:
            raise NoCertificate("the comparison matrix is not a nonsingular M-matrix that Krylov solves resolve")
        return low, high

    def certificate(self, t: float) -> DiagonalCertificate:
        """Return the certificate of ``u = (M - t I)^-1 1`` and ``v``; its witness is ``(u, v)``.

        Raises
        ------
        NoCertificate
            ``t`` is too near to the smallest eigenvalue, or beyond it.
        """
        ones, shift = np.ones(self.M.shape[0]), self.diagonal - t
        u, v = (
            solve(B - t * sparse.eye_array(ones.size, format="csr"), ones, np.maximum(shift, self.diagonal * 1e-3))
            for B in (self.M, self.Mt)
        )
        if not ((u > 0).all() and (v > 0).all()):
            raise NoCertificate(f"no positive witness at {t:.6g}")
        rate = float(((self.M @ u) / u).min() + ((self.Mt @ v) / v).min())
        if not rate > 0:
            raise NoCertificate(f"the witness at {t:.6g} proves no positive rate")
        log_omega = np.log(v) - np.log(u)
        return DiagonalCertificate(log_omega - log_omega.max(), rate, witness=(u, v))


def solve(B: Any, right: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """Solve ``B x = right`` by BiCGSTAB, preconditioned by a diagonal; what is not converged is returned as it is.

    Examples
    --------
    >>> solve(sparse.csr_array([[2.0, -1.0], [-1.0, 2.0]]), np.ones(2), np.full(2, 2.0)).round(9)
    array([1., 1.])
    """
    own = LinearOperator(B.shape, matvec=lambda r: r / diagonal)
    x, _ = bicgstab(B, right, rtol=_RESIDUAL, maxiter=_PRODUCTS, M=own)
    residual = right - B @ x
    if np.abs(residual).max() > 1e-14 * np.abs(right).max():
        correction, _ = bicgstab(B, residual, rtol=1e-6, maxiter=_PRODUCTS, M=own)
        better = x + correction
        if np.abs(right - B @ better).max() < np.abs(residual).max():
            x = better
    return x
