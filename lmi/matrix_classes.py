"""Comparison matrices and the classes Z, M and H.

A *Z-matrix* has no positive entry off the diagonal. A Z-matrix ``A`` is a nonsingular *M-matrix* iff some ``u > 0``
has ``A u > 0``: that vector is the witness. ``A`` is a nonsingular *H-matrix* iff its comparison matrix is a
nonsingular M-matrix.

References
----------
Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6, theorem 2.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from lmi.errors import MatrixError


def square(A: Any, name: str = "A") -> np.ndarray:
    """Return ``A`` as a dense float64 matrix.

    Raises
    ------
    MatrixError
        ``A`` is not square or not finite.
    """
    try:
        dense = np.asarray(A.toarray() if hasattr(A, "toarray") else A)
        if dense.dtype.kind not in "biufO":
            raise TypeError
        dense = dense.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise MatrixError(f"{name} is not a matrix of real numbers") from None
    _require_square(dense.shape, dense, name)
    return dense


def sparse_square(A: Any) -> sparse.csr_array:
    """Return ``A`` as a sparse float64 matrix without stored zeros.

    Raises
    ------
    MatrixError
        ``A`` is not a real, finite, square matrix, or has no rows.
    """
    if not sparse.issparse(A):
        A = square(A)
    elif A.dtype.kind not in "biuf":
        raise MatrixError("A is not a matrix of real numbers")
    matrix = sparse.csr_array(A, dtype=np.float64, copy=True)
    _require_square(matrix.shape, matrix.data, "A")
    if matrix.shape[0] == 0:
        raise MatrixError("A has no rows")
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def _require_square(shape: tuple[int, ...], entries: np.ndarray, name: str) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        raise MatrixError(f"{name} has shape {shape}, not (n, n)")
    if not np.isfinite(entries).all():
        raise MatrixError(f"{name} has an entry that is not finite")


def comparison_matrix(A: Any) -> np.ndarray:
    """Comparison matrix ``M(A)``: ``|a_ii|`` on the diagonal, ``-|a_ij|`` off it.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    (n, n) array

    Raises
    ------
    MatrixError
        ``A`` is not square or not finite.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> comparison_matrix([[-2.0, 1.0], [0.0, 3.0]])
    array([[ 2., -1.],
           [-0.,  3.]])
    """
    A = square(A)
    M = -np.abs(A)
    np.fill_diagonal(M, np.abs(np.diag(A)))
    return M


def is_z_matrix(A: Any) -> bool:
    """Tell whether no off-diagonal entry is positive.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    bool

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> is_z_matrix([[1, -1], [0, -5]])
    True
    """
    A = square(A)
    return bool((A - np.diag(np.diag(A)) <= 0).all())


def m_matrix_witness(A: Any) -> np.ndarray | None:
    """Find ``u > 0`` with ``A u > 0``, which proves that the Z-matrix ``A`` is a nonsingular M-matrix.

    The candidate is ``A^-1 1``, positive for every nonsingular M-matrix because ``A^-1 >= 0``; it is accepted only
    if ``A u > 0`` holds componentwise by more than the rounding of that product.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    (n,) array or None
        None when ``A`` is not a Z-matrix or no witness could be confirmed.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6, theorem 2.3.

    Examples
    --------
    >>> m_matrix_witness([[2.0, -1.0], [-1.0, 2.0]])
    array([1., 1.])
    >>> m_matrix_witness([[1.0, -2.0], [-2.0, 1.0]]) is None
    True
    """
    A = square(A)
    if not is_z_matrix(A):
        return None
    try:
        u = np.linalg.solve(A, np.ones(len(A)))
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(u).all() and (u > 0).all()):
        return None
    rounding = (len(A) + 2) * np.finfo(float).eps * (np.abs(A) @ u)
    return u if (A @ u > rounding).all() else None


def is_m_matrix(A: Any) -> bool:
    """Tell whether ``A`` is a nonsingular M-matrix, as far as a witness can be confirmed in float64.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    bool

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> is_m_matrix([[2.0, -1.0], [-1.0, 2.0]]), is_m_matrix([[1.0, -1.0], [-1.0, 1.0]])
    (True, False)
    """
    return m_matrix_witness(A) is not None


def is_h_matrix(A: Any) -> bool:
    """Tell whether ``A`` is a nonsingular H-matrix: whether ``M(A)`` is a nonsingular M-matrix.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    bool

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> is_h_matrix([[2.0, 1.0], [-1.0, -2.0]])
    True
    """
    return is_m_matrix(comparison_matrix(A))


def irreducible_blocks(A: Any) -> list[np.ndarray]:
    """Return the index sets of the irreducible diagonal blocks, those that drive before those that are driven.

    Row ``i`` is driven by ``j`` where ``a_ij != 0``. With the rows in this order the matrix is block lower triangular.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    list of (k,) int arrays

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 2.

    Examples
    --------
    >>> irreducible_blocks([[1, 0, 2], [0, 1, 0], [3, 1, 1]])
    [array([1]), array([0, 2])]
    >>> irreducible_blocks(np.zeros((0, 0)))
    []
    """
    label, depth = block_depths(sparse.csr_array(A))
    if not label.size:
        return []
    blocks = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
    return sorted(blocks, key=lambda rows: (depth[label[rows[0]]], rows[0]))


def block_depths(A: sparse.csr_array) -> tuple[np.ndarray, np.ndarray]:
    """Return the irreducible block of each row, and the depth of each block.

    That is 0 of a block that nothing drives, otherwise 1 + that of the deepest one by which it is driven.

    Examples
    --------
    >>> label, depth = block_depths(sparse.csr_array([[1, 0, 2], [0, 1, 0], [3, 1, 1]]))
    >>> depth[label].tolist()
    [1, 0, 1]
    """
    count, label = connected_components(A, connection="strong")
    entries = A.tocoo()
    rows, columns = label[entries.row], label[entries.col]
    keep = rows != columns
    graph = sparse.csr_array((np.ones(keep.sum()), (rows[keep], columns[keep])), shape=(count, count))
    waiting, dependents = np.diff(graph.indptr), graph.tocsc()
    depth = np.zeros(count, dtype=int)
    frontier = np.flatnonzero(waiting == 0)
    level = 0
    while frontier.size:
        depth[frontier] = level
        touched, hits = np.unique(dependents[:, frontier].indices, return_counts=True)
        waiting[touched] -= hits.astype(waiting.dtype)
        frontier, level = touched[waiting[touched] == 0], level + 1
    return label, depth


def block_columns(basis: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return the rows ``part`` of a basis, with the columns that are not zero there.

    Examples
    --------
    >>> block_columns(np.eye(3), np.array([1])).tolist()
    [[1.0]]
    """
    rows = basis[part]
    return rows[:, np.abs(rows).max(axis=0, initial=0.0) > 0]
