"""Proofs that a symmetric matrix is positive definite: floats propose a witness, the kernel decides.

Nothing here trusts a float: what floats suggest is rounded to integers and handed to :mod:`lmi.exact`, which decides
without a solver. Matrices are exact: a float is the dyadic number that it is.

Proofs for sparse matrices: rounded sparse factors.

Floats propose the witness, the kernel decides (:mod:`lmi.exact`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Rational
from operator import mul
from typing import Any

import numpy as np
from scipy import sparse

from lmi.dyadic import dyadic_array, odd_parts
from lmi.errors import MatrixError
from lmi.exact import arithmetic, fast
from lmi.exact.definite import LARGEST_SHIFT, SparseFactor, scaled
from lmi.exact.numbers import integers
from lmi.search_time import checkpoint
from lmi.sparse_h_matrix import diagonal_factor

Rows = Sequence[Sequence[Fraction]]
IntegerRows = Sequence[Sequence[int]]
#: Above this many rows a rounded Cholesky factor is tried before the elimination.
RESIDUAL_ROWS = 20
#: Above this many rows a looser rate by the factor is preferred to what takes longer.
ELIMINATION_ROWS = 60
#: Entries longer than these bits go to the factor whatever the rows.
LONG_BITS = 2000
#: Relative amounts by which a float eigenvalue is lowered, one after the other, until the proof succeeds.
LOSSES = (2e-10, 5e-9, 1e-7, 1e-5, 1e-3, 0.1, 0.5)


@dataclass(frozen=True, eq=False)
class ResidualWitness:
    """A rounded factor: ``scale 2^(e_i + e_j) S_ij = 2^(-2 bits) (R R')_ij + E_ij``, ``E`` strictly dominant.

    Attributes
    ----------
    R : (n, n) int64 array
        Lower triangular.
    exponents : (n,) int array
        ``e``: brings the diagonal of ``scale S`` into [1/4, 1).
    bits : int
        Binary places of ``R``.
    scale : int
        A common denominator.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> S = np.full((50, 50), 0.1) + np.eye(50)
    >>> witness = prove_positive_definite(S).witness
    >>> witness.proves(S), witness.proves(S - np.eye(50))
    (True, False)
    """

    R: np.ndarray
    exponents: np.ndarray
    bits: int
    scale: int = 1

    def proves(self, S: Any) -> bool:
        """Ask the kernel whether the remainder of ``S`` is strictly diagonally dominant, its diagonal positive."""
        rows, shift, scale = _integers(S)
        n = len(rows)
        if self.R.shape != (n, n) or self.R.dtype != np.int64 or scale != self.scale or len(self.exponents) != n:
            return False
        own = np.asarray(self.exponents) - np.array(shift, dtype=np.int64)
        if max(int(np.abs(own).max(initial=0)), abs(self.bits)) > LARGEST_SHIFT:
            return False
        spare = fast.dense_spare(rows, self.R, own, self.bits)
        return spare is not None and min(spare, default=1) > 0


@dataclass(frozen=True)
class DefinitenessProof:
    """What :func:`prove_positive_definite` decided, with its witness.

    Attributes
    ----------
    proved : bool
        True: the matrix is positive definite. False: it is not (this is a refutation, as exact as the proof).
    size : int
        Number of rows.
    failed_at : int or None
        First row whose leading principal minor is not positive, where the elimination found it.
    witness : ResidualWitness or None
        The factor, where one decided; None where the elimination did.
    direction : tuple of int, or None
        A vector ``x`` with ``x' S x <= 0``, where one refuted the matrix.

    References
    ----------
    Bareiss, Sylvester's identity and multistep integer-preserving Gaussian elimination, Math. Comp. 22 (1968).
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> prove_positive_definite([[1, 2], [2, 1]])
    DefinitenessProof(proved=False, size=2, failed_at=1)
    >>> "definite" if prove_positive_definite([[2, 1], [1, 2]]) else "not definite"
    'definite'
    """

    proved: bool
    size: int
    failed_at: int | None = None
    witness: ResidualWitness | None = field(default=None, repr=False, compare=False)
    direction: tuple[int, ...] | None = field(default=None, repr=False, compare=False)

    def __bool__(self) -> bool:
        return self.proved


def prove_positive_definite(S: Any) -> DefinitenessProof:
    """Decide exactly whether a symmetric matrix is positive definite.

    Larger matrices are first compared with a rounded Cholesky factor: if ``S - R R'``, formed in integers, has a
    positive, strictly dominant diagonal, then ``S > 0`` (n = 1,000: about a second). Failing that, from 60 rows on, a
    vector with ``x' S x <= 0`` is looked for. Otherwise ``S``, scaled to integers, is reduced to ``L D L'`` by
    fraction-free symmetric elimination; ``S > 0`` iff every pivot, a leading principal minor, is positive (Sylvester).
    The elimination always decides, in seconds at 100 rows and in minutes at 300.

    Parameters
    ----------
    S : n rows of n Fractions, ints or floats, or an (n, n) array
        A float is the dyadic number that it is. The matrix of size 0 counts as positive definite.

    Returns
    -------
    DefinitenessProof

    Raises
    ------
    MatrixError
        ``S`` is not square, not exactly symmetric, or has an entry that is not a finite real number.

    References
    ----------
    Bareiss, Sylvester's identity and multistep integer-preserving Gaussian elimination, Math. Comp. 22 (1968).
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> prove_positive_definite([[Fraction(2), Fraction(1)], [Fraction(1), Fraction(1, 2)]])
    DefinitenessProof(proved=False, size=2, failed_at=1)
    >>> bool(prove_positive_definite([[2, 1], [1, 1]]))
    True
    >>> S = np.full((50, 50), 0.1) + np.eye(50)
    >>> prove_positive_definite(S).witness.proves(S)
    True
    """
    rows, shift, scale = _integers(S)
    n = len(rows)
    if n > RESIDUAL_ROWS or _long(rows):
        if (factors := fast.factor(rows)) is not None:
            R, exponents = factors
            witness = ResidualWitness(R, exponents + np.array(shift, dtype=np.int64), fast.FACTOR_BITS, scale)
            return DefinitenessProof(True, n, witness=witness)
        if n > ELIMINATION_ROWS and (x := _refuting_direction(rows)) is not None:
            x = tuple(value << power - min(shift) for value, power in zip(x, shift, strict=True))
            return DefinitenessProof(False, n, direction=x)
    failed_at = eliminate(rows)
    return DefinitenessProof(failed_at is None, n, failed_at)


def eliminate(S: IntegerRows) -> int | None:
    """Return the first ``k`` for which the leading minor of ``k + 1`` rows is not positive; None: ``S > 0``.

    Fraction-free symmetric elimination: every pivot is a leading principal minor (Sylvester). Always decides; seconds
    at 100 rows, minutes at 300.

    Parameters
    ----------
    S : n rows of n integers
        Symmetric; only the lower triangle is read.

    References
    ----------
    Bareiss, Sylvester's identity and multistep integer-preserving Gaussian elimination, Math. Comp. 22 (1968).

    Examples
    --------
    >>> eliminate([[2, 1], [1, 1]]), eliminate([[1, 1], [1, 1]])
    (None, 1)
    """
    rows, previous = [list(row[: i + 1]) for i, row in enumerate(S)], 1
    for k in range(len(rows)):
        checkpoint()
        pivot = rows[k][k]
        if pivot <= 0:
            return k
        column = [row[k] for row in rows[k + 1 :]]
        for i, (row, head) in enumerate(zip(rows[k + 1 :], column, strict=True)):
            row[k + 1 :] = [
                (x * pivot - head * y) // previous for x, y in zip(row[k + 1 :], column[: i + 1], strict=True)
            ]
        previous = pivot
    return None


def _refuting_direction(rows: Any) -> tuple[int, ...] | None:
    """Find ``x`` with ``x' S x <= 0`` along the float eigenvector of the smallest eigenvalue, in integers."""
    if any(row[i] <= 0 for i, row in enumerate(rows)):
        return None
    T, halves = fast.unit_diagonal(rows)
    values, vectors = np.linalg.eigh(T)
    if not values[0] < 0:
        return None
    whole = [round(math.ldexp(float(value), 40)) for value in vectors[:, 0]]
    x = tuple(value << max(halves) - half for value, half in zip(whole, halves, strict=True))
    form = sum(a * sum(map(mul, row, x)) for a, row in zip(x, rows, strict=True) if a)
    return x if any(x) and form <= 0 else None


def _long(rows: Any) -> bool:
    """Tell whether entries are so long that the factor costs less than elimination."""
    return max((x.bit_length() for row in rows for x in row), default=0) > LONG_BITS


# ---------------------------------------------------------------------- matrices in integers


def _integers(S: Any) -> tuple[Any, list[int], int]:
    """Return ``scale 2^(shift_i + shift_j) S_ij`` in integers, ``shift`` and ``scale``; or refuse the matrix.

    Scaling rows and columns alike keeps definiteness and keeps entries of very different size short.
    """
    # An array of numbers that float64 or int64 hold.
    if isinstance(S, np.ndarray) and S.dtype.kind in "fiub" and S.dtype.itemsize <= 8 and S.dtype != np.uint64:
        if S.ndim != 2 or S.shape[0] != S.shape[1]:
            raise MatrixError("the matrix is not square")
        if S.dtype.kind == "f" and not np.isfinite(S).all():
            raise MatrixError("the matrix has an entry that is not a finite real number")
        if len(S) > RESIDUAL_ROWS:
            return _array_integers(S)
        S = S.tolist()
    rows = _rationals(S)
    scale = math.lcm(*{x.denominator for row in rows for x in row})
    whole = [[x.numerator * (scale // x.denominator) for x in row] for row in rows]
    shift = [-((abs(row[i]).bit_length() - 1) // 2) for i, row in enumerate(whole)]
    pairs = [[(x, a + b) for x, b in zip(row, shift, strict=True)] for row, a in zip(whole, shift, strict=True)]
    power = max(0, -min((place + (x & -x).bit_length() - 1 for row in pairs for x, place in row if x), default=0))
    shifted = [[x << p + power if p + power >= 0 else x >> -p - power for x, p in row] for row in pairs]
    return shifted, shift, scale << power


def _array_integers(S: np.ndarray) -> tuple[np.ndarray, list[int], int]:
    """Return what :func:`_integers` does, of an array."""
    if not (S == S.T).all():
        raise MatrixError("the matrix is not symmetric")
    whole, power = odd_parts(S)
    half = (np.frexp(np.abs(np.diag(S).astype(float)))[1].astype(np.int64) - 1) // 2
    places = np.where(whole != 0, power - half[:, None] - half[None, :], 0)
    up = max(0, -int(places.min(initial=0)))
    return whole.astype(object) << (places + up).astype(object), (-half).tolist(), 1 << up


def _rationals(S: Rows) -> list[list[Fraction]]:
    """Return ``S`` in Fractions (a float is the dyadic number that it is), or refuse it."""
    n = len(S)
    if any(len(row) != n for row in S):
        raise MatrixError("the matrix is not square")
    rows = _fractions(S)
    if any(rows[i][j] != rows[j][i] for i in range(n) for j in range(i)):
        raise MatrixError("the matrix is not symmetric")
    return rows


def _fractions(S: Any) -> list[list[Any]]:
    try:
        return [[x if type(x) is Fraction or type(x) is int else _rational(x) for x in row] for row in S]
    except (TypeError, ValueError, OverflowError):
        raise MatrixError("the matrix has an entry that is not a finite real number") from None


def _rational(x: Any) -> Fraction:
    if isinstance(x, Rational):
        return Fraction(int(x.numerator), int(x.denominator))
    return Fraction(*x.as_integer_ratio()) if isinstance(x, np.floating) else Fraction(float(x))


# ---------------------------------------------------------------------- margins


def prove_margin(S: Rows, guess: float) -> Fraction | None:
    """Find a rational ``m > 0``, as near to ``guess`` as proves, with ``S - m I`` positive definite.

    Parameters
    ----------
    S : n rows of n Fractions
        Symmetric.
    guess : float
        What floating point takes for the smallest eigenvalue.

    Returns
    -------
    Fraction or None
        A proved lower bound of the smallest eigenvalue of ``S``; None if none was found above ``guess / 2``.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> m = prove_margin([[Fraction(2), Fraction(0)], [Fraction(0), Fraction(3)]], 2.0)
    >>> m < 2, float(m) > 2 - 1e-9
    (True, True)
    """
    if not guess > 0:
        return None
    identity = [[int(i == j) for j in range(len(S))] for i in range(len(S))]
    return prove_generalized_margin(S, identity, guess)


def prove_generalized_margin(S: Rows | IntegerRows, Z: Rows | IntegerRows, guess: float) -> Fraction | None:
    """Find a rational ``b``, as near to ``guess`` as proves, with ``S - b Z`` positive definite.

    Parameters
    ----------
    S, Z : n rows of n Fractions or ints
        Symmetric.
    guess : float
        What floating point takes for the largest such ``b``; not 0.

    Returns
    -------
    Fraction or None
        Of the sign of ``guess``; None if none was found above ``guess - |guess| / 2``.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> b = prove_generalized_margin([[Fraction(6)]], [[Fraction(2)]], 3.0)
    >>> b < 3, float(b) > 3 - 1e-9
    (True, True)
    """
    if not math.isfinite(guess) or guess == 0:
        return None
    n = len(S)
    scale = math.lcm(*{x.denominator for M in (S, Z) for row in M for x in row})
    a, z = ([[x.numerator * (scale // x.denominator) for x in row] for row in M] for M in (S, Z))

    def lowered(b: Fraction) -> list[list[int]]:
        """Return ``scale q (S - b Z)``, ``b = p/q``."""
        checkpoint()
        p, q = b.as_integer_ratio()
        return [[q * x - p * y for x, y in zip(*rows, strict=True)] for rows in zip(a, z, strict=True)]

    candidates = [b for loss in LOSSES if (b := Fraction(guess - abs(guess) * loss)) * Fraction(guess) > 0]
    long = _long(a) or _long(z)
    if n > RESIDUAL_ROWS or long:
        # What decides takes seconds here: it comes last, after all that a factor from floats can give.
        for b in candidates if long or n > ELIMINATION_ROWS else candidates[:4]:
            if fast.factor(lowered(b)) is not None:
                return b
    return next((b for b in candidates if arithmetic().definite(lowered(b))), None)


# ---------------------------------------------------------------------- other witnesses


def no_diagonal_rate_above(A: Rows, Y: Rows, rate: Fraction) -> bool:
    """Check in rationals that ``Y`` proves: no diagonal ``Omega > 0`` decays faster than ``rate``.

    That is, ``Omega A + A' Omega >= b Omega`` needs ``b <= rate``. With ``rate = 0``: no diagonal Lyapunov matrix
    exists.

    ``X = Y Y'`` is positive semidefinite; if it is not zero and ``diag(A X) <= (rate/2) diag(X)``, then such an
    ``Omega`` would give ``b sum_i omega_i X_ii <= 2 sum_i omega_i (A X)_ii <= rate sum_i omega_i X_ii``.

    Parameters
    ----------
    A : n rows of n Fractions
        Or other real numbers; a float is the dyadic number that it is.
    Y : n rows of k Fractions
    rate : Fraction
        Per unit of the clock.

    Returns
    -------
    bool
        False: this ``Y`` proves nothing.

    Raises
    ------
    MatrixError
        ``A`` is not square or has no rows, ``Y`` has not as many, or an entry is not a finite real number.

    References
    ----------
    Barker, Berman, Plemmons, Positive diagonal solutions to the Lyapunov equations, Linear Multilinear Algebra 5
    (1978).

    Examples
    --------
    >>> no_diagonal_rate_above([[1, -1], [-1, 1]], [[1], [1]], Fraction(0))
    True
    >>> no_diagonal_rate_above([[1, -1], [-1, 2]], [[1], [1]], Fraction(0))
    False
    """
    n = len(A)
    if n == 0 or len(Y) != n or any(len(row) != n for row in A) or len({len(row) for row in Y}) > 1:
        raise MatrixError("A is not square, is empty, or Y has not as many rows")
    (a, unit), (y, _) = integers(_fractions(A)), integers(_fractions(Y))
    ((bound,),) = _fractions([[rate]])
    sizes = [sum(map(mul, row, row)) for row in y]
    columns = list(zip(*y, strict=True))
    forms = [
        sum(x * sum(map(mul, row, column)) for x, column in zip(y_row, columns, strict=True))
        for row, y_row in zip(a, y, strict=True)
    ]
    return any(sizes) and all(2 * m <= bound * unit * size for m, size in zip(forms, sizes, strict=True))


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
