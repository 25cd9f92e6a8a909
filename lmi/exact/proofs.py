"""Proofs in exact arithmetic that a symmetric matrix is positive definite, each with a witness.

Nothing here trusts a float: floats only suggest what to prove. Matrices are exact: a float is the dyadic number that it
is. Three kinds of witness, each to be checked without a solver and without this package:

- a rounded Cholesky factor, dense or sparse: ``S - R R'``, formed in integers, is strictly diagonally dominant;
- two positive vectors for a matrix that dominates (an H-matrix): ``Omega A + A' Omega >= b Omega``;
- for a refutation, a vector ``x`` with ``x' S x <= 0``.

Large products of integers are formed slice by slice. With slices of ``w`` bits, ``|d| <= 2^(w-1)``, a sum of ``n``
products is at most ``n 2^(2w-2) <= 2^53``: float64 adds it without rounding, in any order, with or without fused
operations. ``w`` is chosen from ``n`` (21 up to n = 8,192), and the bound is verified on the slices themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Rational
from operator import mul
from typing import Any, NamedTuple, cast

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from lmi.deadline import checkpoint
from lmi.errors import MatrixError

Rows = Sequence[Sequence[Fraction]]
IntegerRows = Sequence[Sequence[int]]
#: Above this many rows a rounded Cholesky factor is tried before the elimination.
RESIDUAL_ROWS = 20
#: Above this many rows a looser rate by the residual test is preferred to the elimination.
ELIMINATION_ROWS = 60
#: Entries longer than these bits go to the residual test whatever the rows.
LONG_BITS = 2000


#: Sums of integers up to this size are exact in float64, and with :data:`INT64_SAFE` in int64.
FLOAT_SAFE = 2**53
INT64_SAFE = 2**62
#: Slices of a rounded factor: it is kept to ``slices * width - 2`` bits of the square root of the diagonal.
DENSE_SLICES = 3
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class ResidualWitness:
    """A rounded factor: ``scale 2^(e_i + e_j) S_ij = 2^(-2 bits) (R R')_ij + E_ij``, ``E`` strictly dominant.

    Attributes
    ----------
    R : (n, n) int64 array
        Lower triangular.
    exponents : (n,) int array
        ``e``: brings the diagonal of ``scale S`` into [1, 4).
    bits : int
        Binary places of ``R``.
    scale : int
        A common denominator; 1 for arrays.

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
        """Check in integers that the residual of ``S`` is strictly diagonally dominant, its diagonal positive."""
        scaled = _scaled(S)
        n = len(self.exponents)
        width = (self.bits + 2) // DENSE_SLICES
        if scaled is None or scaled.shape != (n, n) or self.R.shape != (n, n) or self.R.dtype != np.int64:
            return False
        if self.bits != DENSE_SLICES * width - 2 or width != slice_width(n) or scaled.scale != self.scale:
            return False
        if (scaled.exponents != self.exponents).any() or n == 0:
            return n == 0
        limbs = scaled.limbs(width, DENSE_SLICES)
        return limbs is not None and _shortfall(limbs, self.R, width) < 0


@dataclass(frozen=True)
class DefinitenessProof:
    """Outcome of :func:`prove_positive_definite`.

    Attributes
    ----------
    proved : bool
        True: the matrix is positive definite. False: it is not (this is a refutation, as exact as the proof).
    size : int
        Number of rows.
    failed_at : int or None
        First row whose leading principal minor is not positive, where the elimination found it.
    witness : ResidualWitness or None
        The factor of the residual test; None where the elimination decided.
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
    array, rows = _plain_array(S), None
    if array is None:
        rows, shift, scale = _integer_rows(_rationals(S))
        scaled = _scaled_rows(rows, shift, scale)
    else:
        scaled = _scaled_array(array)
    n = len(S)
    if scaled is not None and (n > RESIDUAL_ROWS or (rows is not None and _long(rows))):
        if (witness := _residual_witness(scaled)) is not None:
            return DefinitenessProof(True, n, witness=witness)
        if n > ELIMINATION_ROWS and (direction := _refuting_direction(scaled)) is not None:
            return DefinitenessProof(False, n, direction=direction)
    return _eliminate(_scaled_lower_triangle(_rationals(S)) if rows is None else rows)


def _bits(x: Fraction | int) -> int:
    return max(x.numerator.bit_length(), x.denominator.bit_length())


def _long(rows: list[list[int]]) -> bool:
    """Tell whether entries are so long that the residual test costs less than elimination."""
    return max((x.bit_length() for row in rows for x in row), default=0) > LONG_BITS


def _eliminate(rows: list[list[int]]) -> DefinitenessProof:
    """Decide by fraction-free symmetric elimination of a lower triangle in integers, in place."""
    n = len(rows)
    previous = 1
    for k in range(n):
        checkpoint()
        pivot = rows[k][k]
        if pivot <= 0:
            return DefinitenessProof(False, n, k)
        column = [rows[i][k] for i in range(k + 1, n)]
        for i in range(k + 1, n):
            row, head = rows[i], column[i - k - 1]
            if head:
                for j in range(k + 1, i + 1):
                    row[j] = (row[j] * pivot - head * column[j - k - 1]) // previous
            elif pivot != previous:
                for j in range(k + 1, i + 1):
                    if row[j]:
                        row[j] = row[j] * pivot // previous
        previous = pivot
    return DefinitenessProof(True, n)


def _rationals(S: Rows) -> list[list[Fraction]]:
    """Return ``S`` in Fractions (a float is the dyadic number that it is), or refuse it."""
    n = len(S)
    if any(len(row) != n for row in S):
        raise MatrixError("the matrix is not square")
    try:
        rows = [[x if type(x) is Fraction or type(x) is int else _rational(x) for x in row] for row in S]
    except (TypeError, ValueError, OverflowError):
        raise MatrixError("the matrix has an entry that is not a finite real number") from None
    if any(rows[i][j] != rows[j][i] for i in range(n) for j in range(i)):
        raise MatrixError("the matrix is not symmetric")
    return rows


def _rational(x: Any) -> Fraction:
    if isinstance(x, Rational):
        return Fraction(int(x.numerator), int(x.denominator))
    return Fraction(*x.as_integer_ratio()) if isinstance(x, np.floating) else Fraction(float(x))


class _Scaled(NamedTuple):
    """``T_ij = scale 2^(e_i + e_j) S_ij`` with a diagonal in [1, 4); ``limbs(width, slices)`` are its integers.

    ``2^(2 bits) T = sum_m limbs[m] 2^(width m)`` up to an error below 1, with ``bits = slices * width - 2`` and
    ``2 slices - 1`` limbs; None if an entry is too large for ``S > 0``.
    """

    shape: tuple[int, ...]
    exponents: np.ndarray
    scale: int
    limbs: Callable[[int, int], list[np.ndarray] | None]


def slice_width(n: int) -> int:
    """Return the bits ``w`` of a slice, at most 21, with ``n 2^(2w - 2) <= 2^53``.

    Examples
    --------
    >>> slice_width(1000), slice_width(100_000)
    (21, 19)
    """
    return min(21, (53 - max(n - 1, 1).bit_length()) // 2 + 1)


def _scaled(S: Any) -> _Scaled | None:
    """Scale ``S``, refused if it is no symmetric real matrix; None if a diagonal entry is not positive."""
    array = _plain_array(S)
    return _scaled_rows(*_integer_rows(_rationals(S))) if array is None else _scaled_array(array)


def _scaled_array(array: np.ndarray) -> _Scaled | None:
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise MatrixError("the matrix is not square")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise MatrixError("the matrix has an entry that is not a finite real number")
    if not (array == array.T).all():
        raise MatrixError("the matrix is not symmetric")
    diagonal = np.diag(array)
    if not (diagonal > 0).all():
        return None
    e = _exponents(diagonal)
    return _Scaled(array.shape, e, 1, lambda width, slices: _limbs(array, e[:, None] + e[None, :], width, slices))


def _plain_array(S: Any) -> np.ndarray | None:
    """Return an array of numbers as float64 or int64 without changing one; None if ``S`` is something else."""
    if not isinstance(S, np.ndarray) or S.dtype.kind not in "fiub" or S.dtype.itemsize > 8 or S.dtype == np.uint64:
        return None
    return S.astype(np.float64 if S.dtype.kind == "f" else np.int64)


def _exponents(diagonal: np.ndarray) -> np.ndarray:
    """Return ``e`` with ``d 2^(2e)`` in [1, 4) up to rounding, ``d > 0``."""
    return -((np.frexp(diagonal.astype(float))[1].astype(np.int64) - 1) // 2)


def _scaled_rows(rows: list[list[int]], shift: Sequence[int], scale: int) -> _Scaled | None:
    """Scale integers further: ``rows`` is the lower triangle of ``scale 2^(shift_i + shift_j) S_ij``."""
    n = len(rows)
    if any(rows[i][i] <= 0 for i in range(n)):
        return None
    e = [-((rows[i][i].bit_length() - 1) // 2) for i in range(n)]

    def limbs(width: int, slices: int) -> list[np.ndarray] | None:
        places = 2 * (slices * width - 2)
        cut = min(3, 2 * slices - 2) * width
        high, low = np.zeros((n, n), dtype=np.int64), np.zeros((n, n), dtype=np.int64)
        mask = (1 << cut) - 1
        try:
            for i, row in enumerate(rows):
                powers = [e[i] + e[j] + places for j in range(i + 1)]
                ints = [x << power if power >= 0 else x >> -power for x, power in zip(row, powers, strict=True)]
                high[i, : i + 1] = [x >> cut for x in ints]
                low[i, : i + 1] = [x & mask for x in ints]
        except OverflowError:
            return None
        parts = []
        for whole, count in ((low, cut // width), (high, 2 * slices - 1 - cut // width)):
            whole += np.tril(whole, -1).T
            for _ in range(count - 1):
                parts.append(whole & ((1 << width) - 1))
                whole = whole >> width
            parts.append(whole)
        return parts if int(np.abs(parts[-1]).max()) < 1 << (2 * width - 1) else None

    return _Scaled((n, n), np.array(e) + np.array(shift, dtype=np.int64), scale, limbs)


def _limbs(values: np.ndarray, power: np.ndarray, width: int, slices: int) -> list[np.ndarray] | None:
    """Return ``values 2^power`` in the limbs of :class:`_Scaled`.

    A float splits exactly: ``y - rint(y)`` and products with powers of two are free of rounding. What underflows is
    far below the last limb.
    """
    if values.dtype.kind == "i":
        sign, size = np.sign(values), np.abs(values).view(np.uint64)
        parts = [sign * ((size >> 32).astype(float) * 2.0**32), sign * (size & 0xFFFFFFFF).astype(float)]
    else:
        parts = [values]
    count = 2 * slices - 1
    limbs = [np.zeros(values.shape, dtype=np.int64) for _ in range(count)]
    top = power + (2 * (slices * width - 2) - (count - 1) * width)
    for part in parts:
        y = np.ldexp(part, top)
        if not (np.abs(y) < 2.0 ** (2 * width)).all():
            return None
        for m in range(count - 1, -1, -1):
            whole = np.rint(y)
            limbs[m] += whole.astype(np.int64)
            y = (y - whole) * 2.0**width
    return limbs


def _digits(R: np.ndarray, width: int, slices: int) -> list[np.ndarray]:
    """Split integers below ``2^62``: ``R = sum_a digits[a] 2^(width a)``, all but the last at most ``2^(width-1)``."""
    half = 1 << (width - 1)
    digits = []
    for _ in range(slices - 1):
        low = ((R + half) & (2 * half - 1)) - half
        digits.append(low)
        R = (R - low) >> width
    return [*digits, R]


def _squares(R: np.ndarray, width: int, slices: int) -> list[np.ndarray] | None:
    """Return ``R R' = sum_m Q[m] 2^(width m)`` exactly, from float64 products of slices; None if they would round."""
    digits = _digits(R, width, slices)
    size = [int(np.abs(d).max(initial=0)) for d in digits]
    if R.shape[1] * max(size) ** 2 > FLOAT_SAFE:
        return None
    floats = [d.astype(float) for d in digits]
    Q = [np.zeros((len(R), len(R)), dtype=np.int64) for _ in range(2 * slices - 1)]
    for a in range(slices):
        for b in range(a + 1):
            product = (floats[a] @ floats[b].T).astype(np.int64)
            Q[a + b] += product if a == b else product + product.T
    return Q


def _carry(limbs: list[np.ndarray], width: int) -> None:
    """Bring all limbs but the last into ``[0, 2^width)``, in place."""
    for m in range(len(limbs) - 1):
        carry = limbs[m] >> width
        limbs[m] -= carry << width
        limbs[m + 1] += carry


def _leading(limbs: list[np.ndarray], width: int, level: int) -> np.ndarray:
    """Return the number of carried limbs in units of ``2^(width level)``, rounded down."""
    whole = limbs[-1]
    for m in range(len(limbs) - 2, level - 1, -1):
        whole = (whole << width) + limbs[m]
    return whole


def _level(limbs: list[np.ndarray], width: int, cap: int) -> int | None:
    """Return the least level at which the carried limbs stay below ``cap``, None if there is none."""
    size = int(np.abs(limbs[-1]).max(initial=0)) + 1
    if size > cap:
        return None
    level = len(limbs) - 1
    while level > 0 and size << width <= cap:
        level -= 1
        size = int(np.abs(_leading(limbs, width, level)).max(initial=0)) + 1
    return level


def _shortfall(limbs: list[np.ndarray], R: np.ndarray, width: int) -> float:
    """Return by how much the residual's diagonal falls short of dominance at worst, in units of ``T``; < 0: it holds.

    The leading integers ``e`` of the residual are exact and the rest of each entry lies within ``(e - 1, e + 2)``, so
    rows pass with ``e_ii - sum |e_ij| > 2 n``. The sign of the answer is exact.
    """
    n = len(R)
    if int(np.abs(R).max(initial=0)) > INT64_SAFE or (Q := _squares(R, width, DENSE_SLICES)) is None:
        return math.inf
    residual = [t - q for t, q in zip(limbs, Q, strict=True)]
    _carry(residual, width)
    level = _level(residual, width, INT64_SAFE // (2 * n) - 2)
    if level is None:
        return math.inf
    e = _leading(residual, width, level)
    missing = int((np.abs(e).sum(axis=1) - np.abs(np.diag(e)) - np.diag(e)).max()) + 2 * n + 1
    return math.ldexp(float(missing), width * level - 2 * (DENSE_SLICES * width - 2))


def _residual_witness(scaled: _Scaled) -> ResidualWitness | None:
    """Look for a factor whose residual dominates; None says nothing about the matrix.

    The factor is that of ``T - c I`` by float Cholesky. ``c`` begins at the size of the roundings and is raised by what
    the residual's diagonal was seen to be short of.
    """
    n = scaled.shape[0]
    width = slice_width(n)
    bits = DENSE_SLICES * width - 2
    if (limbs := scaled.limbs(width, DENSE_SLICES)) is None:
        return None
    unit = _as_float(limbs, width, bits)
    shift = n * EPS
    for _ in range(4):
        try:
            factor = np.linalg.cholesky(unit - shift * np.eye(n))
        except np.linalg.LinAlgError:
            return None
        R = np.rint(np.ldexp(factor, bits)).astype(np.int64)
        short = _shortfall(limbs, R, width)
        if short < 0:
            return ResidualWitness(R, scaled.exponents, bits, scaled.scale)
        if not short < 1:
            return None
        shift += 1.25 * short
    return None


def _as_float(limbs: list[np.ndarray], width: int, bits: int) -> np.ndarray:
    whole = np.zeros(limbs[0].shape)
    for m, limb in enumerate(limbs):
        whole += np.ldexp(limb.astype(float), width * m - 2 * bits)
    return whole


def _residual_test(rows: list[list[int]]) -> bool:
    """Tell whether the residual test proves the lower triangle ``rows``. False says nothing."""
    scaled = _scaled_rows(rows, [0] * len(rows), 1)
    return scaled is not None and _residual_witness(scaled) is not None


def _refuting_direction(scaled: _Scaled) -> tuple[int, ...] | None:
    """Find ``x`` with ``x' S x <= 0``, checked in integers, along the float eigenvector of the smallest eigenvalue."""
    n = scaled.shape[0]
    width = slice_width(n)
    if (limbs := scaled.limbs(width, DENSE_SLICES)) is None:
        return None
    values, vectors = np.linalg.eigh(_as_float(limbs, width, DENSE_SLICES * width - 2))
    if not values[0] < 0:
        return None
    x = np.array([round(math.ldexp(float(value), 40)) for value in vectors[:, 0]], dtype=object)
    form = sum(int(x @ (limb.astype(object) @ x)) << (width * m) for m, limb in enumerate(limbs))
    if not any(x) or form + sum(abs(value) for value in x) ** 2 > 0:
        return None
    e = scaled.exponents - scaled.exponents.min()
    return tuple(value << power for value, power in zip(x.tolist(), e.tolist(), strict=True))


def _scaled_lower_triangle(S: Rows) -> list[list[int]]:
    """Return the lower triangle of ``D S D`` in integers, ``D`` a diagonal of powers of two."""
    return _integer_rows(S)[0]


def _integer_rows(S: Rows) -> tuple[list[list[int]], list[int], int]:
    """Return the lower triangle of ``scale 2^(shift_i + shift_j) S_ij`` in integers, ``shift`` and ``scale``.

    Scaling rows and columns alike keeps definiteness and keeps entries of very different size short.
    """
    scale = math.lcm(*{x.denominator for row in S for x in row})
    whole = [[x.numerator * (scale // x.denominator) for x in row[: i + 1]] for i, row in enumerate(S)]
    rows, shift, power = _equilibrated(whole)
    return rows, shift, scale << power


def _equilibrated(rows: list[list[int]]) -> tuple[list[list[int]], list[int], int]:
    """Return the lower triangle of ``2^(power + shift_i + shift_j) S_ij`` in integers, ``shift`` and ``power``."""
    shift = [-((abs(rows[i][i]).bit_length() - 1) // 2) for i in range(len(rows))]
    places = [[shift[i] + other for other in shift[: i + 1]] for i in range(len(rows))]
    zeros = (
        place + (x & -x).bit_length() - 1
        for xs, ps in zip(rows, places, strict=True)
        for x, place in zip(xs, ps, strict=True)
        if x
    )
    power = max(0, -min(zeros, default=0))
    scaled = [
        [x << place + power if place + power >= 0 else x >> -place - power for x, place in zip(xs, ps, strict=True)]
        for xs, ps in zip(rows, places, strict=True)
    ]
    return scaled, shift, power


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
    n, both = len(S), cast("tuple[Rows, Rows]", (S, Z))
    scale = math.lcm(*{x.denominator for M in both for row in M for x in row})
    whole = [[[x.numerator * (scale // x.denominator) for x in row[: i + 1]] for i, row in enumerate(M)] for M in both]

    def lowered(b: Fraction) -> list[list[int]]:
        """Return the lower triangle of ``scale q (S - b Z)``, ``b = p/q``."""
        p, q = b.as_integer_ratio()
        return [[q * x - p * z for x, z in zip(*rows, strict=True)] for rows in zip(*whole, strict=True)]

    candidates = [b for loss in LOSSES if (b := Fraction(guess - abs(guess) * loss)) * Fraction(guess) > 0]
    long = any(_bits(x) > LONG_BITS for M in (S, Z) for row in M for x in row)
    if n > RESIDUAL_ROWS or long:
        # Elimination takes seconds to minutes here: it comes last, after all that the residual test can give.
        for b in candidates if long or n > ELIMINATION_ROWS else candidates[:4]:
            checkpoint()
            if _residual_test(lowered(b)):
                return b
    return next((b for b in candidates if _definite(lowered(b))), None)


def _definite(rows: list[list[int]]) -> bool:
    """Decide the definiteness of a lower triangle in integers."""
    if len(rows) > RESIDUAL_ROWS and _residual_test(rows):
        return True
    return bool(_eliminate(_equilibrated(rows)[0]))


#: Relative amounts by which a float eigenvalue is lowered, one after the other, until the proof succeeds.
LOSSES = (2e-10, 5e-9, 1e-7, 1e-5, 1e-3, 0.1, 0.5)


def round_to_bits(value: float, bits: int) -> Fraction:
    """Round a finite float to the nearest dyadic rational with ``bits`` significant bits.

    Parameters
    ----------
    value : float
        Finite.
    bits : int
        Positive.

    Returns
    -------
    Fraction

    Examples
    --------
    >>> round_to_bits(0.1, 4)
    Fraction(13, 128)
    """
    if value == 0:
        return Fraction(0)
    mantissa, exponent = math.frexp(value)
    return Fraction(round(math.ldexp(mantissa, bits))) * Fraction(2) ** (exponent - bits)


def no_diagonal_rate_above(A: Rows, Y: Rows, rate: Fraction) -> bool:
    """Check in rationals that ``Y`` proves: no diagonal ``Omega > 0`` decays faster than ``rate``.

    That is, ``Omega A + A' Omega >= b Omega`` needs ``b <= rate``.

    ``X = Y Y'`` is positive semidefinite; if it is not zero and ``diag(A X) <= (rate/2) diag(X)``, then such an
    ``Omega`` would give ``b sum_i omega_i X_ii <= 2 sum_i omega_i (A X)_ii <= rate sum_i omega_i X_ii``. With
    ``rate = 0``: no diagonal Lyapunov matrix exists.

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
    try:
        A, Y = ([[x if type(x) is Fraction else _rational(x) for x in row] for row in M] for M in (A, Y))
        rate = _rational(rate)
    except (TypeError, ValueError, OverflowError):
        raise MatrixError("an entry or the rate is not a finite real number") from None
    a, y = _integers(A), _integers(Y)
    sizes = [sum(x * x for x in row) for row in y[0].tolist()]
    moved = [
        sum(x * z for x, z in zip(image, row, strict=True))
        for image, row in zip((a[0] @ y[0]).tolist(), y[0].tolist(), strict=True)
    ]
    return any(sizes) and all(2 * m <= rate * a[1] * size for m, size in zip(moved, sizes, strict=True))


def _integers(M: Rows) -> tuple[np.ndarray, int]:
    """Return a rational matrix as integers over one denominator."""
    scale = math.lcm(*(x.denominator for row in M for x in row))
    return np.array([[x.numerator * (scale // x.denominator) for x in row] for row in M], dtype=object), scale


# ---------------------------------------------------------------------- dominance


@dataclass(frozen=True, eq=False)
class DominanceProof:
    """Witness of :func:`prove_dominance`: ``Omega A + A' Omega >= rate Omega`` with ``Omega = diag(v / u)``.

    Attributes
    ----------
    u, v : (n,) array of positive integers
        int64, or Python integers where they are larger.
    rate : Fraction
        Positive, dyadic; per unit of the clock.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> proof = prove_dominance([[2.0, 1.0], [-1.0, 2.0]], [1, 1], [1, 1])
    >>> bool((proof.u > 0).all() and (proof.v > 0).all()), proof.rate
    (True, Fraction(2, 1))
    """

    u: np.ndarray
    v: np.ndarray
    rate: Fraction

    def __bool__(self) -> bool:
        return True


def prove_dominance(A: Any, u: Any, v: Any, *, bits: int = 22) -> DominanceProof | None:
    """Find the largest rate that two positive vectors prove for a matrix that dominates, in integers.

    With the comparison matrix ``M`` of ``A``, a positive diagonal, and positive ``u, v``, let ``b`` be the largest
    number with ``v_i (M u)_i + u_i (M' v)_i >= b u_i v_i`` for all ``i``. The symmetric Z-matrix
    ``Omega M + M' Omega - b Omega``, ``Omega = diag(v / u)``, takes ``u`` to a nonnegative vector, hence is positive
    semidefinite, and ``x'(Omega A + A' Omega)x >= |x|'(Omega M + M' Omega)|x| >= b x' Omega x``.

    Parameters
    ----------
    A : (n, n) array or sparse matrix of floats or ints
        A float is the dyadic number that it is; a matrix of int64 likewise.
    u, v : (n,) array
        Positive; only their directions matter.
    bits : int
        ``u`` and ``v`` are rounded to this many significant bits before anything is proved.

    Returns
    -------
    DominanceProof or None
        ``rate`` is ``b`` of the rounded vectors, rounded down to a float; None if that is not positive.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square, or a vector is not positive, finite and of its length.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> proof = prove_dominance([[2.0, 1.0], [-1.0, 2.0]], [1, 1], [1, 1])
    >>> proof.rate
    Fraction(2, 1)
    >>> prove_dominance([[1.0, 1.0], [-1.0, 1.0]], [1, 1], [1, 1]) is None
    True
    """
    A = sparse.csr_array(A)
    n = A.shape[0]
    if A.shape != (n, n) or A.dtype.kind not in "fiu" or A.dtype.itemsize > 8 or A.dtype == np.uint64:
        raise MatrixError("A is not a square matrix of floats or ints of at most 64 bits")
    if not np.isfinite(A.data).all():
        raise MatrixError("A has an entry that is not finite")
    A.sum_duplicates()
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    column, data = A.indices.astype(np.int64), A.data.astype(np.int64 if A.dtype.kind in "iu" else float)
    u, v = _rounded_vector(u, n, bits), _rounded_vector(v, n, bits)
    if n == 0 or not (A.diagonal() > 0).all():
        return None
    on = row == column
    slices, unit = _binary_slices(data)
    right, left = np.zeros(n, dtype=object), np.zeros(n, dtype=object)
    for entries, digits, power in slices:
        signed = np.where(on[entries], np.abs(digits), -np.abs(digits))
        i, j = row[entries], column[entries]
        right += _sums(signed, u, i, j, n) << power
        left += _sums(signed, v, j, i, n) << power
    a, b = u.astype(object), v.astype(object)
    rate = _least_ratio(b * right + a * left, a * b, unit)
    return DominanceProof(u, v, rate) if rate > 0 else None


def _rounded_vector(x: Any, n: int, bits: int) -> np.ndarray:
    """Return positive integers in the direction of ``x``, each rounded to about ``bits`` significant bits."""
    x = np.asarray(x, dtype=float)
    if x.shape != (n,) or not (np.isfinite(x).all() and (x > 0).all()):
        raise MatrixError("a vector is not positive, finite and of the length of A")
    mantissa, exponent = np.frexp(x)
    whole = np.rint(np.ldexp(mantissa, bits)).astype(np.int64)
    power = exponent - (exponent.min() if n else 0)
    if power.max(initial=0) + bits < 62:
        return whole << power
    return whole.astype(object) << power.astype(object)


def dyadic_integers(values: Any) -> tuple[list[int], int]:
    """Return floats or ints as integers over one power of two: ``values = integers * 2^power``, exactly.

    So a matrix of floats is handed to whoever checks its proof in integers.

    Parameters
    ----------
    values : (n,) sequence of float or int
        Finite.

    Returns
    -------
    integers : list of n ints
    power : int

    Examples
    --------
    >>> dyadic_integers([0.75, -2.0, 3])
    ([3, -8, 12], -2)
    """
    ratios = [value.as_integer_ratio() for value in np.asarray(values).tolist()]
    places = max((denominator.bit_length() for _, denominator in ratios), default=1)
    return [numerator << (places - denominator.bit_length()) for numerator, denominator in ratios], 1 - places


def _binary_slices(data: np.ndarray) -> tuple[list[tuple[np.ndarray, np.ndarray, int]], int]:
    """Split ``data = 2^unit sum_s digits_s 2^power_s`` exactly: which entries, their digits below ``2^31``, the power.

    Only powers that occur make a slice: three or four for data of similar size, whatever its range.
    """
    if data.dtype.kind == "i":
        whole, power = data, np.zeros(len(data), dtype=np.int64)
    else:
        mantissa, exponent = np.frexp(data)
        whole, power = np.ldexp(mantissa, 53).astype(np.int64), exponent.astype(np.int64) - 53
    some = whole != 0
    unit = int(power[some].min()) if some.any() else 0
    # whole 2^power with power = 31 q + r: the digits of whole, shifted by r, begin at the place q
    place, r = np.divmod(np.where(some, power - unit, 0), 31)
    sign, size = np.sign(whole), np.abs(whole).view(np.uint64)
    pieces = []
    for k in range(3):
        moved = (size & 0x7FFFFFFF).astype(np.int64) << r
        size = size >> 31
        pieces += [(place + k, moved & 0x7FFFFFFF), (place + k + 1, moved >> 31)]
    found = []
    for p in range(int(place.max(initial=0)) + 4):
        where = [np.flatnonzero((q == p) & (x != 0)) for q, x in pieces]
        if any(len(at) for at in where):
            entries = np.concatenate(where)
            digits = np.concatenate([x[at] for at, (_, x) in zip(where, pieces, strict=True)])
            found.append((entries, sign[entries] * digits, 31 * p))
    return found, unit


def _sums(weights: np.ndarray, x: np.ndarray, to: np.ndarray, of: np.ndarray, n: int) -> np.ndarray:
    """Return ``y`` with ``y[to] += weights * x[of]`` as Python integers; the weights are below ``2^31``."""
    largest = int(np.bincount(to, minlength=n).max(initial=0)) * int(np.abs(weights).max(initial=0))
    step = 62 - largest.bit_length()  # a matrix in memory has rows shorter than 2^30
    y, power = np.zeros(n, dtype=object), 0
    while True:
        rest = x >> step
        sums = np.zeros(n, dtype=np.int64)
        np.add.at(sums, to, weights * (x - (rest << step)).astype(np.int64)[of])
        y += sums.astype(object) << power
        if not rest.any():
            return y
        x, power = rest, power + step


def _least_ratio(numerators: np.ndarray, denominators: np.ndarray, unit: int) -> Fraction:
    """Return the least ``2^unit numerator / denominator``, rounded down to a float; the denominators are positive."""
    try:
        ratios = numerators.astype(float) / denominators.astype(float)
        near = np.flatnonzero(ratios <= ratios.min() + 2.0**-48 * abs(ratios.min()))
        least = min(Fraction(numerators[i], denominators[i]) for i in near)
    except OverflowError:
        least = min(map(Fraction, numerators.tolist(), denominators.tolist()))
    if least == 0:
        return least
    places = 53 - abs(least.numerator).bit_length() + least.denominator.bit_length()
    return math.floor(least * Fraction(2) ** places) * Fraction(2) ** (unit - places)


# ---------------------------------------------------------------------- sparse factors


@dataclass(frozen=True, eq=False)
class SparseDefinitenessProof:
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

    order: np.ndarray
    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray
    exponents: np.ndarray
    bits: int
    weights: np.ndarray | None = None

    def __bool__(self) -> bool:
        return True


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
    S = sparse.csc_array(S)
    n = S.shape[0]
    if S.shape != (n, n) or S.dtype.kind not in "fiu" or S.dtype.itemsize > 8 or S.dtype == np.uint64:
        raise MatrixError("the matrix is not a square one of floats or ints of at most 64 bits")
    S = S.astype(float if S.dtype.kind == "f" else np.int64)
    S.sum_duplicates()
    S.eliminate_zeros()
    if not np.isfinite(S.data).all():
        raise MatrixError("the matrix has an entry that is not finite")
    if (S != S.T).nnz:
        raise MatrixError("the matrix is not symmetric")
    diagonal = S.diagonal()
    if n == 0 or not (diagonal > 0).all():
        return None
    e = _exponents(diagonal)
    T = sparse.coo_array(S)
    unit = sparse.csc_array((np.ldexp(T.data.astype(float), e[T.row] + e[T.col]), (T.row, T.col)), shape=(n, n))
    if not (np.abs(unit.data) < 4.1).all():
        return None
    for slices in (2, 3):
        shift = 4 * int(np.diff(unit.indptr).max()) * EPS
        for _ in range(4):
            if (factor := _sparse_factor(unit, shift)) is None:
                break
            short, proof = _sparse_attempt(T, e, *factor, slices)
            if proof is not None:
                return proof
            if not short < 1:
                break
            shift += 1.25 * short
    return None


def _sparse_factor(unit: sparse.csc_array, shift: float) -> tuple[np.ndarray, sparse.csc_array] | None:
    """Return an order and the float factor of ``unit - shift I`` in that order, None if it meets a pivot <= 0."""
    n = unit.shape[0]
    options = {"SymmetricMode": True}
    try:
        lu = splu(
            sparse.csc_matrix(unit - shift * sparse.eye_array(n)),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options=options,
        )
    except RuntimeError:
        return None
    pivots = lu.U.diagonal()
    if (lu.perm_r != lu.perm_c).any() or not (pivots > 0).all():
        return None
    R = sparse.csc_array(lu.L @ sparse.diags_array(np.sqrt(pivots)))
    R.sort_indices()
    return np.argsort(lu.perm_c).astype(np.int64), R


def _sparse_attempt(
    T: sparse.coo_array, e: np.ndarray, order: np.ndarray, R: sparse.csc_array, slices: int
) -> tuple[float, SparseDefinitenessProof | None]:
    """Round the factor and judge its residual: by how much the diagonal is short, and the proof if it is not."""
    n = len(order)
    width = slice_width(n)
    bits = slices * width - 2
    whole = np.rint(np.ldexp(R.data, bits)).astype(np.int64)
    kept = whole != 0
    columns = np.repeat(np.arange(n), np.diff(R.indptr))[kept]
    rows, whole = R.indices[kept].astype(np.int64), whole[kept]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=n))]).astype(np.int64)
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    i, j = place[T.row], place[T.col]
    lower = i >= j
    limbs = _limbs(T.data[lower], (e[T.row] + e[T.col])[lower], width, slices)
    if limbs is None or int(np.abs(whole).max(initial=0)) > INT64_SAFE:
        return math.inf, None
    residual = _sparse_residual((i[lower], j[lower], limbs), (rows, columns, whole), n, width, slices)
    if residual is None:
        return math.inf, None
    unit = 2.0 ** (width * residual.level - 2 * bits)
    ones = np.ones(n, dtype=np.int64)
    weights = None
    missing = residual.missing(ones)
    if missing.max() >= 0:
        weights = residual.weights()
        if weights is None or residual.missing(weights).max() >= 0:
            return float(missing.max()) * unit, None
    return 0.0, SparseDefinitenessProof(order, indptr, rows, whole, e, bits, weights)


#: Weights of a residual are integers up to this size.
LARGEST_WEIGHT = 2**12


class _SparseResidual(NamedTuple):
    """The leading integers of a residual: entries ``(i, j, value)``, ``i >= j``, and a dense block at the end.

    An entry lies within ``(value - 1, value + 2)`` in units of ``2^(width level)``; pairs not listed are 0.
    """

    i: np.ndarray
    j: np.ndarray
    value: np.ndarray
    block: np.ndarray
    level: int
    n: int

    def missing(self, d: np.ndarray) -> np.ndarray:
        """Return ``sum_j |E_ij| d_j - E_ii d_i`` rounded up; negative: the row dominates."""
        off = self.i != self.j
        i, j, size = self.i[off], self.j[off], np.abs(self.value[off]) + 2
        out = np.zeros(self.n, dtype=np.int64)
        np.add.at(out, i, size * d[j])
        np.add.at(out, j, size * d[i])
        on = self.i[~off]
        out[on] -= (self.value[~off] - 1) * d[on]
        m = self.n - len(self.block)
        if len(self.block):
            size = np.abs(self.block) + 2
            np.fill_diagonal(size, 1 - np.diag(self.block))
            out[m:] += size @ d[m:]
        return out

    def weights(self) -> np.ndarray | None:
        """Look for weights with which the residual dominates: a few Jacobi steps towards ``M(E) d = 1``."""
        diagonal = np.zeros(self.n)
        on = self.i == self.j
        diagonal[self.i[on]] = self.value[on]
        m = self.n - len(self.block)
        diagonal[m:] += np.diag(self.block)
        if not (diagonal > 0).all():
            return None
        a = np.abs(self.value[~on]).astype(float)
        i, j = self.i[~on], self.j[~on]
        half = sparse.csr_array((a, (i, j)), shape=(self.n, self.n))
        whole, block = half + half.T, np.abs(self.block).astype(float)
        np.fill_diagonal(block, 0.0)
        d = np.ones(self.n)
        for _ in range(30):
            off = whole @ d
            off[m:] += block @ d[m:]
            d = (d / d.max() + off / diagonal) / 2
        d /= d.max()
        return np.maximum(np.rint(d * LARGEST_WEIGHT), 1).astype(np.int64)


def _sparse_residual(
    T: tuple[np.ndarray, np.ndarray, list[np.ndarray]],
    R: tuple[np.ndarray, np.ndarray, np.ndarray],
    n: int,
    width: int,
    slices: int,
) -> _SparseResidual | None:
    """Form ``T - R R'`` exactly. ``T`` is its lower triangle in limbs, ``R`` the entries of a triangular factor."""
    rows, columns, values = R
    first = _dense_from(np.bincount(columns, minlength=n))
    count = 2 * slices - 1
    leading = columns < first
    # The trailing columns: a dense block
    corner = np.zeros((n - first, n - first), dtype=np.int64)
    corner[rows[~leading] - first, columns[~leading] - first] = values[~leading]
    if (block := _squares(corner, width, slices)) is None:
        return None
    # The leading columns: a sum of at most `terms` products of digits in each entry, three such sums in a limb
    digits = _digits(values[leading], width, slices)
    terms = int(np.bincount(rows[leading], minlength=n).max(initial=0))
    if 3 * max(terms, 1) * max(int(np.abs(d).max(initial=0)) for d in digits) ** 2 > INT64_SAFE:
        return None
    parts = [sparse.csc_array((d, (rows[leading], columns[leading])), shape=(n, first)) for d in digits]
    keys, owner, amounts = [T[1] * n + T[0]] * count, list(range(count)), list(T[2])
    for a in range(slices):
        for b in range(a + 1):
            product = sparse.csc_array(parts[a] @ parts[b].T)
            product = sparse.coo_array(sparse.tril(product if a == b else product + product.T))
            keys.append(product.col.astype(np.int64) * n + product.row)
            owner.append(a + b)
            amounts.append(-product.data)
    every = np.unique(np.concatenate(keys))
    limbs = [np.zeros(len(every), dtype=np.int64) for _ in range(count)]
    for key, m, amount in zip(keys, owner, amounts, strict=True):
        limbs[m][np.searchsorted(every, key)] += amount
    i, j = every % n, every // n
    inside = j >= first
    for limb, square in zip(limbs, block, strict=True):
        square *= -1
        added = np.zeros_like(square)
        added[i[inside] - first, j[inside] - first] = limb[inside]
        square += added + np.tril(added, -1).T
    i, j, limbs = i[~inside], j[~inside], [limb[~inside] for limb in limbs]
    _carry(limbs, width)
    _carry(block, width)
    cap = INT64_SAFE // (4 * n * LARGEST_WEIGHT) - 2
    levels = _level(limbs, width, cap), _level(block, width, cap)
    if levels[0] is None or levels[1] is None:
        return None
    level = max(levels[0], levels[1])
    return _SparseResidual(i, j, _leading(limbs, width, level), _leading(block, width, level), level, n)


def _dense_from(counts: np.ndarray) -> int:
    """Return the column from which a factor is better treated as dense, from the entries of its columns."""
    n = len(counts)
    before = np.concatenate([[0.0], np.cumsum(counts.astype(float) ** 2)])
    left = n - np.arange(n + 1.0)
    return int(np.argmin(30 * before + 0.05 * left**3 + 200 * left**2))


# ---------------------------------------------------------------------- a second opinion


def definite_by_polynomial(S: Rows) -> bool:
    """Decide whether a symmetric rational matrix is positive definite by the signs of its characteristic polynomial.

    All roots of ``det(x I - S) = x^n + c_1 x^(n-1) + ... + c_n`` are real. They are positive iff ``(-1)^k c_k > 0`` for
    all ``k`` (Descartes). The coefficients are exact, by Faddeev and LeVerrier in integers; nothing of the other proofs
    is used, nor anything outside the standard library. Seconds at n = 40.

    Parameters
    ----------
    S : n rows of n Fractions
        Or other real numbers; a float is the dyadic number that it is.

    Returns
    -------
    bool
        True: positive definite. False: not.

    Raises
    ------
    MatrixError
        As in :func:`prove_positive_definite`.

    References
    ----------
    Horn and Johnson, Matrix Analysis, 2nd ed., Cambridge 2013, section 7.2.

    Examples
    --------
    >>> definite_by_polynomial([[2, 1], [1, 1]])
    True
    >>> definite_by_polynomial([[2, 2], [2, 2]])
    False
    """
    lower = _scaled_lower_triangle(_rationals(S))
    n = len(lower)
    A = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    # B_1 = A, c_k = -tr(B_k) / k, B_(k+1) = A (B_k + c_k I); all B_k are symmetric
    B = [list(row) for row in A]
    for k in range(1, n + 1):
        coefficient = -sum(B[i][i] for i in range(n)) // k
        if coefficient * (-1) ** k <= 0:
            return False
        for i in range(n):
            B[i][i] += coefficient
        if k < n:
            B = [[sum(map(mul, row, column)) for column in B] for row in A]
    return True
