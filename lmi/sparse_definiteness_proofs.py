"""Proofs for sparse matrices: rounded sparse factors.

Floats propose the witness, the kernel decides (:mod:`lmi.exact`).
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import sparse

from lmi.dyadic import dyadic_array
from lmi.errors import MatrixError
from lmi.exact import fast
from lmi.exact.definite import SparseFactor, scaled
from lmi.sparse_h_matrix import diagonal_factor

EPS = float(np.finfo(float).eps)
#: Bits of a rounded factor, one after the other.
BITS = (40, 61)
#: Weights of a remainder are integers up to this size.
LARGEST_WEIGHT = 2**12


def _matrix(A: Any, name: str) -> sparse.csc_array:
    """Return a square matrix of float64 or int64 without duplicates, or refuse it."""
    A = sparse.csc_array(A)
    if A.shape[0] != A.shape[1] or A.dtype.kind not in "fiu" or A.dtype.itemsize > 8 or A.dtype == np.uint64:
        raise MatrixError(f"{name} is not a square matrix of floats or ints of at most 64 bits")
    A = A.astype(float if A.dtype.kind == "f" else np.int64)
    A.sum_duplicates()
    A.eliminate_zeros()
    if not np.isfinite(A.data).all():
        raise MatrixError(f"{name} has an entry that is not finite")
    return A


class SparseDefinitenessProof(SparseFactor):
    """Witness of :func:`prove_sparse_positive_definite`: ``S - R R'`` is strictly dominant.

    With ``T_ij = 2^(e_i + e_j) S_ij`` and ``o = order``: ``2^(2 bits) T[o, o] = R R' + E``, and
    ``E_ii d_i > sum_j |E_ij| d_j`` for all rows.

    Attributes
    ----------
    order : (n,) int64 array
        ``order[k]`` is the row of ``S`` eliminated as number ``k``.
    indptr, indices, data : (n + 1,), (nnz,), (nnz,) int64 arrays
        ``R``, lower triangular, column by column with increasing rows.
    exponents : (n,) int64 array
        ``e``, for the rows of ``S`` as they are numbered there.
    bits : int
        Binary places of ``R``.
    weights : (n,) int64 array or None
        ``d`` in the order of elimination; None: all are 1.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> proof = prove_sparse_positive_definite(sparse.diags_array([2.0, 3.0, 4.0]))
    >>> bool(proof), proof.weights is None, sorted(proof.order.tolist())
    (True, True, [0, 1, 2])
    """


def prove_sparse_positive_definite(S: Any) -> SparseDefinitenessProof | None:
    """Prove exactly that a sparse symmetric matrix is positive definite.

    A sparse factor of ``T - c I``, ``T`` the matrix scaled to a diagonal in [1, 4), in an order of little fill, is
    rounded to integers. The trailing columns, where the factor is full, are multiplied as a dense block, the leading
    ones as a sparse matrix; both exactly. Rows where the residual does not dominate by itself may do so with weights.

    Parameters
    ----------
    S : (n, n) sparse matrix or array of floats or ints
        A float is the dyadic number that it is.

    Returns
    -------
    SparseDefinitenessProof or None
        None says nothing about the matrix.

    Raises
    ------
    MatrixError
        ``S`` is not square, not exactly symmetric, or has an entry that is not finite.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> S = sparse.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(200, 200))
    >>> prove_sparse_positive_definite(S).data.dtype
    dtype('int64')
    >>> prove_sparse_positive_definite(S - 0.51 * sparse.eye_array(200)) is None
    True
    """
    S = _matrix(S, "the matrix")
    n = S.shape[0]
    if (S != S.T).nnz:
        raise MatrixError("the matrix is not symmetric")
    diagonal = S.diagonal()
    if n == 0 or not (diagonal > 0).all():
        return None
    e = -((np.frexp(diagonal.astype(float))[1].astype(np.int64) - 1) // 2)
    T = sparse.coo_array(S)
    unit = sparse.csc_array((np.ldexp(T.data.astype(float), e[T.row] + e[T.col]), (T.row, T.col)), shape=(n, n))
    if not (np.abs(unit.data) < 4.1).all():
        return None
    lower = T.row >= T.col
    values, power = dyadic_array(T.data[lower])
    entries = T.row[lower], T.col[lower], values
    for bits in BITS:
        shift = 4 * int(np.diff(unit.indptr).max()) * EPS
        for _ in range(4):
            if (proof := _propose(unit, shift, e, bits)) is None:
                break
            short, result = _judge(n, entries, proof, power)
            if result is not None:
                return result
            if not short < 1:
                break
            shift += 1.25 * short
    return None


def _propose(unit: sparse.csc_array, shift: float, e: np.ndarray, bits: int) -> SparseDefinitenessProof | None:
    """Return an order and the factor of ``unit - shift I`` in that order, rounded; None if it meets a pivot <= 0."""
    n = unit.shape[0]
    try:
        lu = diagonal_factor(unit - shift * sparse.eye_array(n))
    except RuntimeError:
        return None
    pivots = lu.U.diagonal()
    if (lu.perm_r != lu.perm_c).any() or not (pivots > 0).all():
        return None
    R = sparse.csc_array(lu.L @ sparse.diags_array(np.sqrt(pivots)))
    R.data = np.rint(np.ldexp(R.data, bits))
    if not (np.abs(R.data) <= fast.INT64_SAFE).all():
        return None
    R.eliminate_zeros()
    R.sort_indices()
    order, whole = np.argsort(lu.perm_c).astype(np.int64), R.data.astype(np.int64)
    return SparseDefinitenessProof(order, R.indptr.astype(np.int64), R.indices.astype(np.int64), whole, e, bits)


def _judge(
    n: int, entries: Any, proof: SparseDefinitenessProof, power: int
) -> tuple[float, SparseDefinitenessProof | None]:
    """Ask the kernel for the remainder of a factor: by how much its diagonal is short, and the proof if it is not."""
    S = scaled(n, entries, proof, power)
    E = None if S is None else fast.remainder(S)
    if S is None or E is None:
        return math.inf, None
    missing = -min(E.spare(S.weights))
    if missing < 0:
        return 0.0, proof
    weights = _weights(E)
    if weights is not None and min(E.spare(weights)) > 0:
        return 0.0, proof._replace(weights=weights)
    return float(Fraction(missing, S.times << 2 * proof.bits)), None


def _weights(E: fast.Remainder) -> np.ndarray | None:
    """Look for weights with which the remainder dominates: a few Jacobi steps towards ``M(E) d = 1``."""
    m, on = E.n - len(E.block), E.i == E.j
    cut = max(int(np.abs(x).max(initial=0)).bit_length() - 1000 for x in (E.value, E.block))
    value, block = ((x >> cut if cut > 0 else x).astype(float) for x in (E.value, E.block))
    diagonal = np.zeros(E.n)
    diagonal[E.i[on]] = value[on]
    diagonal[m:] += np.diag(block)
    if not (diagonal > 0).all():
        return None
    half = sparse.csr_array((np.abs(value[~on]), (E.i[~on], E.j[~on])), shape=(E.n, E.n))
    whole, block = half + half.T, np.abs(block)
    np.fill_diagonal(block, 0.0)
    d = np.ones(E.n)
    for _ in range(30):
        off = whole @ d
        off[m:] += block @ d[m:]
        d = (d / d.max() + off / diagonal) / 2
    d /= d.max()
    return np.maximum(np.rint(d * LARGEST_WEIGHT), 1).astype(np.int64)
