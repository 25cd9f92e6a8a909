"""Diagonal Lyapunov matrices in closed form, without a solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from lmi.errors import MatrixError, NotAnHMatrix
from lmi.matrices import comparison_matrix, m_matrix_witness, square


def h_matrix_diagonal(A: Any) -> np.ndarray:
    """Diagonal Lyapunov matrix of a nonsingular H-matrix with positive diagonal: ``Omega = diag(v / u)``.

    With ``M = M(A)``, ``M u = 1`` and ``M' v = 1``, both positive,

        x'(Omega A + A' Omega)x >= |x|'(Omega M + M' Omega)|x|,    (Omega M + M' Omega) u = Omega 1 + 1 > 0,

    and a symmetric Z-matrix that takes some ``u > 0`` to a positive vector is positive definite. Not the best such
    matrix, but there for every H-matrix, however small its margin.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    (n,) array
        Positive, largest entry 1.

    Raises
    ------
    NotAnHMatrix
        No positive ``u`` with ``M(A) u > 0`` was confirmed, or a diagonal entry is not positive.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> h_matrix_diagonal([[2.0, 0.0], [-1.0, 1.0]])
    array([1.        , 0.33333333])
    """
    A = square(A)
    if len(A) == 0:
        raise MatrixError("A has no rows")
    if (low := np.flatnonzero(np.diag(A) <= 0)).size:
        i = int(low[0])
        raise NotAnHMatrix(f"diagonal entry {i} is {A[i, i]:.6g}, not positive")
    M = comparison_matrix(A)
    scale = np.diag(A)
    # Rows scaled to unit diagonal: the class does not change, and the witness is confirmed at any magnitude.
    if m_matrix_witness(M / scale[:, None]) is None:
        raise NotAnHMatrix("no positive u with M(A) u > 0 was confirmed in float64")
    u, v = np.linalg.solve(M, np.ones(len(A))), np.linalg.solve(M.T, np.ones(len(A)))
    if not ((u > 0).all() and (v > 0).all()):
        raise NotAnHMatrix("the comparison matrix M(A) is too near a singular one for float64")
    omega = v / u
    return omega / omega.max()
