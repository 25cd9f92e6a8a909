"""The array twins of the kernel: the same answers, by NumPy and python-flint, where matrices or edges are many.

Floats occur in two places only. A factor that is proposed by floats is rounded to integers, and its remainder formed
exactly. Products of matrices of integers are formed slice by slice: with slices of ``w`` bits, ``|d| <= 2^(w-1)``, a
sum of ``n`` products is at most ``n 2^(2w-2) <= 2^53``, which float64 adds without rounding, in any order; the bound is
verified on the slices themselves. Every twin is compared with its plain one by a test.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import reduce
from itertools import chain, pairwise
from operator import add
from typing import Any, NamedTuple

import flint
import numpy as np

from lmi.exact.definite import BITS, LARGEST_BITS, Arithmetic, Rows, Scaled, symmetric
from lmi.exact.numbers import longest
from lmi.exact.work import fits, spend

#: Sums of integers up to these sizes are exact in float64 and in int64.
FLOAT_SAFE, INT64_SAFE = 2**53, 2**62
#: Above this many rows NumPy proposes a factor.
SMALL_ROWS = 24
#: Matrices with entries of more bits whose mean is shorter by this factor are not multiplied by python-flint.
PADDED_BITS, PADDED = 4000, 8
#: Bits of all entries up to which python-flint multiplies large matrices.
LONGEST = 200_000_000
#: Bits of an inverse factor in floats, and how near it takes a matrix to the identity: ``2^-CONGRUENCE``.
FLOAT_BITS, CONGRUENCE = 53, 30
#: Bits of a slice at most, and of a dense factor: a sum of three slices.
SLICE, FACTOR_BITS = 21, 57
#: Longest column of a sparse factor that is multiplied pair by pair, entries of the largest dense block at the end,
#: pairs in all, and at a time.
LONGEST_COLUMN, LARGEST_BLOCK, LARGEST_PAIRS, CHUNK = 4000, 2_000_000, 400_000_000, 2_000_000


class FastArithmetic(Arithmetic):
    """What decides, with factors that NumPy proposes for large matrices, and products by python-flint."""

    name = f"python-flint {flint.__version__}, NumPy {np.__version__}"
    products, numpy = 10_000_000_000, True

    def definite(self, S: Rows) -> bool:
        """Tell whether a symmetric integer matrix is positive definite; see :meth:`Arithmetic.definite`."""
        return (len(S) > SMALL_ROWS and symmetric(S) and factor(S) is not None) or super().definite(S)

    def product(self, A: Rows, B: Rows) -> list[list[int]]:
        """Return ``A B``, by python-flint unless some entries are much longer than others, which it pads all to."""
        long, short = sorted((_longest(A), _longest(B)), reverse=True)
        if not A or not B or _needs_padding(A) or _needs_padding(B) or long > max(PADDED_BITS, PADDED**2 * short):
            return super().product(A, B)
        return _rows(_flint(A) * _flint(B))

    def characteristic(self, rows: Sequence[Mapping[int, int]]) -> list[int]:
        """Return the characteristic polynomial; see :meth:`Arithmetic.characteristic`."""
        dense = [[row.get(j, 0) for j in range(len(rows))] for row in rows]
        return [int(c) for c in reversed(_flint(dense).charpoly().coeffs())]

    def spare(self, S: Scaled) -> list[int] | None:
        """Return by how much each row of the remainder dominates; see :meth:`Arithmetic.spare`."""
        if max(map(abs, S.data), default=0) > INT64_SAFE:
            return super().spare(S)
        E = remainder(S)
        return None if E is None else E.spare(S.weights)

    def above(self, S: Rows, D: Rows, bits: int = BITS[0]) -> list[Fraction] | None:
        """Bound ``d'S^-1 d`` from above for every row ``d`` of ``D``; see :meth:`Arithmetic.above`.

        For large matrices first by a matrix that takes ``S`` near to the identity: the inverse of a float factor.
        """
        large = len(S) > SMALL_ROWS and bits == BITS[0] and symmetric(S)
        return (_above_by_congruence(S, D) if large else None) or super().above(S, D, bits)


def _flint(rows: Rows) -> Any:
    return flint.fmpz_mat([list(row) for row in rows])


def _rows(M: Any) -> list[list[int]]:
    return [[int(x) for x in row] for row in M.tolist()]


def _longest(rows: Rows) -> int:
    return longest(chain.from_iterable(rows))


def _needs_padding(rows: Rows) -> bool:
    """Tell whether all entries are much shorter than the longest one, on average."""
    most, count = _longest(rows), sum(map(len, rows))
    return most > PADDED_BITS and sum(map(int.bit_length, chain.from_iterable(rows))) < most * count // PADDED


def floats(rows: Rows) -> tuple[np.ndarray, int]:
    """Return integers of any size as an array of float64 and a power of two, by which it is to be multiplied.

    Examples
    --------
    >>> array, power = floats([[1, 2], [3, 10**400]])
    >>> [round(x * 2.0 ** (power - 1328), 3) for x in array[1].tolist()]
    [0.0, 1.707]
    """
    power = max(_longest(rows) - 1000, 0)
    return np.array([[x >> power for x in row] for row in rows] if power else rows, dtype=float), power


def unit_diagonal(S: Rows) -> tuple[np.ndarray, list[int]]:
    """Return ``T_ij = 2^(-h_i - h_j) S_ij`` in floats, its diagonal between 1/4 and 1, and ``h``.

    Entries of ``S`` that are smaller than the largest one by 300 decades are lost.

    Examples
    --------
    >>> T, halves = unit_diagonal([[4, 1], [1, 9]])
    >>> T.tolist(), halves
    ([[0.25, 0.0625], [0.0625, 0.5625]], [2, 2])
    """
    halves = [(S[i][i].bit_length() + 1) // 2 for i in range(len(S))]
    array, power = floats(S)
    powers = np.array(halves)
    return np.ldexp(array, power - powers[:, None] - powers[None, :]), halves


def _above_by_congruence(S: Rows, D: Rows) -> list[Fraction] | None:
    """Bound ``d'S^-1 d`` by ``|Y'd|^2 / least``, since ``Y'S Y >= least I`` is dominated by its diagonal."""
    T, halves = unit_diagonal(S)
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(T)).T
    except np.linalg.LinAlgError:
        return None
    # Y = 2^-power U inverse, U diagonal, in integers: columns of S and D are multiplied by U first
    up = [max(halves) - half for half in halves]
    bits = len(S) * _longest(S) + len(D) * _longest(D) + 2 * (len(S) + len(D)) * max(up)
    if not fits(bits * len(S), LONGEST) or not np.isfinite(inverse).all():
        return None
    spend((len(S) + len(D)) * len(S) ** 2 // 10, bits // len(S), FLOAT_BITS, "constants of many agents")
    power = FLOAT_BITS - int(np.frexp(np.abs(inverse).max())[1])
    Y = _flint([[int(x) for x in row] for row in np.ldexp(inverse, power).tolist()])
    SU = _flint([[x << i + j for x, j in zip(row, up, strict=True)] for row, i in zip(S, up, strict=True)])
    G = _rows(Y.transpose() * (SU * Y))
    least, one = min(2 * row[i] - sum(map(abs, row)) for i, row in enumerate(G)), 4 ** (max(halves) + power)
    if (one - least) << CONGRUENCE > one:
        return None
    product = _flint([[x << j for x, j in zip(d, up, strict=True)] for d in D]) * Y
    return [Fraction(int(sum(x * x for x in row)), least) for row in product.tolist()]


# ---------------------------------------------------------------------- exact products of arrays


def square(R: np.ndarray) -> np.ndarray | None:
    """Return ``R R'`` of int64 entries in Python integers; None unless every product and sum is exact.

    Examples
    --------
    >>> square(np.array([[2**40, 1], [0, 1]])).tolist()
    [[1208925819614629174706177, 1], [1, 1]]
    """
    if R.size == 0 or _largest(R) > INT64_SAFE:
        return None if R.size else np.zeros((len(R), len(R)), dtype=object)
    digits, width = _digits(R, R.shape[1])
    if R.shape[1] * max(_largest(d) for d in digits) ** 2 > FLOAT_SAFE:
        return None
    halves = [digit.astype(np.float64) for digit in digits]
    limbs = [np.zeros((len(R), len(R)), dtype=np.int64) for _ in range(2 * len(digits) - 1)]
    for a, left in enumerate(halves):
        for b, right in enumerate(halves[: a + 1]):
            product = (left @ right.T).astype(np.int64)
            limbs[a + b] += product if a == b else product + product.T
    return _join(limbs, width)


def _digits(whole: np.ndarray, terms: int) -> tuple[list[np.ndarray], int]:
    """Split int64 numbers into digits for sums of so many products; all but the last are at most ``2^(width - 1)``."""
    width = min(SLICE, (53 - max(terms, 1).bit_length()) // 2 + 1)
    half, digits = 1 << (width - 1), []
    for _ in range(_largest(whole).bit_length() // width):
        digit = ((whole + half) & ((1 << width) - 1)) - half
        digits.append(digit)
        whole = (whole - digit) >> width
    return [*digits, whole], width


def _join(limbs: list[np.ndarray], width: int) -> np.ndarray:
    """Return ``sum_m limbs[m] 2^(width m)`` in Python integers, of as few pieces of int64 as hold them."""
    for m in range(len(limbs) - 1):
        carry = limbs[m] >> width
        limbs[m] -= carry << width
        limbs[m + 1] += carry
    pieces = [(limbs[-1], _largest(limbs[-1]) + 1, len(limbs) - 1)]
    for m in reversed(range(len(limbs) - 1)):
        top, bound, _ = pieces[-1]
        if bound << width <= INT64_SAFE:
            pieces[-1] = (top << width) + limbs[m], bound << width, m
        else:
            pieces.append((limbs[m], 1 << width, m))
    return reduce(add, (piece.astype(object) << width * m if m else piece.astype(object) for piece, _, m in pieces))


def _largest(x: np.ndarray) -> int:
    return max(int(x.max()), -int(x.min())) if x.size else 0


# ---------------------------------------------------------------------- dense factors


def factor(S: Any) -> tuple[np.ndarray, np.ndarray] | None:
    """Propose a factor of a symmetric matrix by floats, and judge it by its exact remainder.

    Rows and columns are scaled by powers of two to diagonal entries of one size. ``R`` is the factor of the result
    less a multiple of the identity, rounded to integers.

    Parameters
    ----------
    S : n rows of n integers, or an (n, n) object array

    Returns
    -------
    R : (n, n) int64 array
        Of ``FACTOR_BITS`` bits.
    exponents : (n,) int array
        With which :func:`dense_spare` is positive. None instead of both says nothing about the matrix.

    Examples
    --------
    >>> factor([[2, 1], [1, 1]]) is None, factor([[1, 1], [1, 1]]) is None
    (False, True)
    """
    n = len(S)
    lengths = [S[i][i].bit_length() if S[i][i] > 0 else 0 for i in range(n)]
    if not all(lengths):
        return None
    exponents = np.array([-((length + 1) // 2) for length in lengths])
    T, down = _shift(S, exponents, FACTOR_BITS)
    if (T != T.T).any():
        return None
    one = 2 * FACTOR_BITS + down  # the diagonal is in [2^(one - 2), 2^one), nothing above 2^one if S > 0
    try:
        unit = (T >> (one - 60)).astype(np.int64).astype(np.float64) * 2.0**-60
    except OverflowError:
        return None
    shift = n * 2.0**-54
    for _ in range(4):
        try:
            whole = np.rint(np.ldexp(np.linalg.cholesky(unit - shift * np.eye(n)), FACTOR_BITS))
        except np.linalg.LinAlgError:
            return None
        if not np.abs(whole).max(initial=0) <= INT64_SAFE:
            return None
        R = whole.astype(np.int64)
        margins = _spare(T, down, R)
        if margins is None or min(margins, default=1) > 0:
            return None if margins is None else (R, exponents)
        missing = Fraction(-min(margins), 1 << one)
        if missing > 1:
            return None
        shift += 1.25 * float(missing)
    return None


def dense_spare(S: Any, R: np.ndarray, exponents: Any, bits: int) -> list[int] | None:
    """Return by how much each row of ``2^(e_i + e_j + 2 bits) S_ij - (R R')_ij`` dominates; None if it is not formed.

    Examples
    --------
    >>> dense_spare([[4, 2], [2, 5]], np.array([[31, 0], [16, 31]]), [0, 0], 4)
    [47, 47]
    """
    T, down = _shift(S, np.asarray(exponents), bits)
    return None if (T != T.T).any() else _spare(T, down, R)


def _shift(S: Any, exponents: np.ndarray, bits: int) -> tuple[np.ndarray, int]:
    """Return ``2^(e_i + e_j + 2 bits + down) S_ij`` in an array of integers, and ``down >= 0``."""
    T = np.empty((len(S), len(S)), dtype=object)
    T[:] = S
    places = exponents[:, None] + exponents[None, :] + 2 * bits
    down = max(0, -int(places.min(initial=0)))
    return T << (places + down).astype(object), down


def _spare(T: np.ndarray, down: int, R: np.ndarray) -> list[int] | None:
    if (whole := square(R)) is None:
        return None
    E = T - (whole << down if down else whole)
    diagonal = np.diag(E)
    return list(diagonal + np.abs(diagonal) - np.abs(E).sum(axis=1))


# ---------------------------------------------------------------------- sparse factors


class Remainder(NamedTuple):
    """A remainder by the entries ``(i, j, value)`` of its lower triangle, and a dense block at the end."""

    i: np.ndarray
    j: np.ndarray
    value: np.ndarray
    block: np.ndarray
    n: int

    def spare(self, weights: Any) -> list[int]:
        """Return ``E_ii d_i - sum_j |E_ij| d_j``."""
        d, margins = np.array(weights, dtype=object), np.zeros(self.n, dtype=object)
        off = self.i != self.j
        i, j = self.i[off], self.j[off]
        size, on = np.abs(self.value[off]), self.i[~off]
        np.subtract.at(margins, i, size * d[j])
        np.subtract.at(margins, j, size * d[i])
        margins[on] += self.value[~off] * d[on]
        m = self.n - len(self.block)
        if m < self.n:
            diagonal = np.diag(self.block)
            margins[m:] += (diagonal + np.abs(diagonal)) * d[m:] - np.abs(self.block) @ d[m:]
        return list(margins)


def remainder(S: Scaled) -> Remainder | None:
    """Form the remainder of a sparse factor, its leading columns pair by pair, the trailing ones as a dense block.

    The entries of the factor are at most 2^62. None: that would be too much work or memory.
    """
    n = S.n
    indptr, indices, data = (np.array(x, dtype=np.int64) for x in (S.indptr, S.indices, S.data))
    counts = np.diff(indptr)
    remaining = n - np.arange(n + 1.0)
    before = np.concatenate([[0.0], np.cumsum(counts.astype(float) ** 2)])
    first = int(np.argmin(100 * before + 0.1 * remaining**3 + 500 * remaining**2))
    if int(counts[:first].max(initial=0)) > LONGEST_COLUMN or before[first] > LARGEST_PAIRS:
        return None
    if not fits((n - first) ** 2, LARGEST_BLOCK):
        return None
    corner = np.zeros((n - first, n - first), dtype=np.int64)
    offset = indptr[first]
    corner[indices[offset:] - first, np.repeat(np.arange(n - first), counts[first:])] = data[offset:]
    block, sums = square(corner), _pair_products(n, first, indptr, indices, data)
    if block is None or sums is None or not fits((len(sums[0]) + corner.size) * S.times.bit_length(), LARGEST_BITS):
        return None
    E = defaultdict(int, zip(sums[0].tolist(), (-S.times * sums[1]).tolist(), strict=True))
    block = -S.times * block
    for (row, column), value in S.T.items():
        E[row * n + column] += value
    values = np.array(list(E.values()), dtype=object)
    i, j = np.divmod(np.array(list(E), dtype=np.int64), max(n, 1))
    inside = j >= first
    a, b = i[inside] - first, j[inside] - first
    entries = values[inside]
    block[a, b] += entries
    block[b[a != b], a[a != b]] += entries[a != b]
    return Remainder(i[~inside], j[~inside], values[~inside], block, n)


def _pair_products(
    n: int, first: int, indptr: np.ndarray, indices: np.ndarray, data: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the lower triangle of ``R R'`` from the columns before ``first``: keys ``i n + j``, and integers."""
    digits, width = _digits(data, first)
    count, counts = 2 * len(digits) - 1, np.diff(indptr)[:first]
    if len(digits) * first * max(_largest(digit) for digit in digits) ** 2 > INT64_SAFE or n > 2**31:
        return None
    keys: Any = np.zeros(0, dtype=np.int64)
    limbs = [np.zeros(0, dtype=np.int64) for _ in range(count)]
    pairs = np.cumsum(counts * (counts + 1) // 2)
    cuts = np.searchsorted(pairs, np.arange(CHUNK, pairs[-1] if first else 0, CHUNK))
    for begin, end in pairwise(np.unique([0, *cuts, first]).tolist()):
        # Every entry of these columns, with those of its column down to itself.
        entry = np.arange(indptr[begin], indptr[end])
        head = np.repeat(indptr[begin:end], counts[begin:end])
        many = entry - head + 1
        upper = np.repeat(entry, many)
        lower = np.arange(len(upper)) - np.repeat(np.cumsum(many) - many - head, many)
        positions = np.concatenate([keys, indices[upper] * n + indices[lower]])
        keys, inverse = np.unique(positions, return_inverse=True)
        for m in range(count):
            parts = [x[upper] * digits[m - a][lower] for a, x in enumerate(digits) if 0 <= m - a < len(digits)]
            total = np.zeros(len(keys), dtype=np.int64)
            np.add.at(total, inverse, np.concatenate([limbs[m], np.sum(parts, axis=0)]))
            limbs[m] = total
    return keys, _join(limbs, width)
