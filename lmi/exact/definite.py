"""Definiteness of symmetric integer matrices, decided exactly, with the standard library.

One proof for all sizes: a rounded Cholesky factor ``R`` with ``S = R R' + E``, the remainder ``E`` known in integers.
Where the diagonal of ``E`` exceeds the sum of the other entries of each row, ``E > 0`` and ``S > 0``. A
:class:`Factor` is computed here, for a dense matrix; a :class:`SparseFactor` comes from whoever searched it, and its
remainder is formed by :func:`remainder`.

References
----------
Rump, Verification of positive definiteness, BIT 46 (2006).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from math import isqrt
from operator import mul
from typing import Any, NamedTuple

from lmi.exact.polynomials import characteristic
from lmi.exact.work import fits, spend

Rows = Sequence[Sequence[int]]
#: Bits of the dense factor, one after the other, until the proof succeeds.
BITS = (128, 320, 1024, 4096)
#: Exponents of a sparse factor beyond this are refused, lest a witness fill the memory.
LARGEST_SHIFT = 2**16
#: Bits that the entries may be shifted by, or multiplied by, in all.
LARGEST_BITS = 400_000_000
#: Pairs of entries of a column of a sparse factor that are multiplied, and that are kept at a time.
LARGEST_PAIRS, LARGEST_KEPT = 200_000_000, 2_000_000


def symmetric(S: Rows) -> bool:
    """Tell whether a matrix is one of integers, symmetric, with a positive diagonal.

    Examples
    --------
    >>> symmetric([[2, 1], [1, 2]]), symmetric([[2, 1], [0, 2]]), symmetric([[2.0]]), symmetric([[0]])
    (True, False, False, False)
    """
    n = len(S)
    if not all(len(row) == n and set(map(type, row)) <= {int} and row[i] > 0 for i, row in enumerate(S)):
        return False
    return all(tuple(row) == column for row, column in zip(S, zip(*S, strict=True), strict=True))


# ---------------------------------------------------------------------- the dense factor


class Factor:
    """``D S D = R R' + E``: ``D`` a diagonal of powers of two, ``E`` dominated by its positive diagonal.

    Parameters
    ----------
    S : n rows of n integers
        Symmetric; only the lower triangle is read.
    bits : int
        Of the factor.

    Raises
    ------
    ArithmeticError
        Not proved with so many bits.

    Examples
    --------
    >>> value = Factor([[2, 1], [1, 1]], 64).above([1, 0])
    >>> float(value), value > 1
    (1.0, True)
    """

    def __init__(self, S: Rows, bits: int):
        n, self.bits = len(S), bits
        # Powers of two by which rows and columns are scaled, so that the diagonal fits the bits.
        self.shifts = [bits - (S[i][i].bit_length() - 1) // 2 for i in range(n)]
        self.rows: list[list[int]] = []
        self.diagonal: list[int] = []
        # Scaled entries lie below 4^(bits + 1), so entries of R below 2^(bits + 1). A scaled entry is cut to an
        # integer and a quotient is rounded: each off-diagonal entry of E is at most 2^bits + 1 in size. With one more
        # row below (see `above`) a row of E has n of them.
        self.slack = (n + 1) * (2**bits + 1)
        for i in range(n):
            row = self._substitute(S[i], self.shifts[i])
            remaining = _scale(S[i][i], 2 * self.shifts[i]) - sum(map(mul, row, row)) - self.slack
            if remaining <= 0:
                raise ArithmeticError("not proved")
            self.rows.append(row)
            self.diagonal.append(isqrt(remaining))

    def _substitute(self, entries: Sequence[int], shift: int) -> list[int]:
        """Return the row of ``R`` that belongs to a row of ``S``: forward substitution, each quotient rounded."""
        row: list[int] = []
        for entry, own, previous, pivot in zip(entries, self.shifts, self.rows, self.diagonal, strict=False):
            remaining = _scale(entry, own + shift) - sum(map(mul, row, previous))
            row.append((2 * remaining + pivot) // (2 * pivot))
        return row

    def above(self, d: Sequence[int]) -> Fraction:
        """Bound ``d'S^-1 d`` from above, to ``bits`` bits or so: ``[[S, d], [d', c]]`` is definite for this ``c``."""
        if not any(d):
            return Fraction(0)
        # The largest of d_i^2 / S_ii, none of which exceeds the value, gets as large as a diagonal entry of S.
        shift = 2 * self.bits - max(abs(x).bit_length() + own for x, own in zip(d, self.shifts, strict=True) if x)
        row = self._substitute(d, shift)
        return Fraction(sum(map(mul, row, row)) + self.slack) / Fraction(4) ** shift


def _scale(entry: int, shift: int) -> int:
    return entry << shift if shift >= 0 else entry >> -shift


# ---------------------------------------------------------------------- the sparse factor


class SparseFactor(NamedTuple):
    """A rounded factor: ``2^(2 bits) T[order, order] = R R' + E``, ``T_ij = 2^(e_i + e_j + power) S_ij``.

    It proves ``S > 0`` if ``E_ii d_i > sum_j |E_ij| d_j`` for all rows, ``d`` positive. Whether ``R`` is a good factor,
    and scaling and order good ones, decides only if that succeeds.
    """

    order: Any  #: a permutation: ``order[k]`` is the row of ``S`` eliminated as number ``k``
    indptr: Any  #: where the columns of ``R`` begin, and the last one ends
    indices: Any  #: rows of its entries, increasing in each column from the diagonal on
    data: Any  #: its entries
    exponents: Any  #: ``e``, for the rows of ``S`` as they are numbered there
    bits: int
    weights: Any = None  #: ``d`` in the order of elimination; None: all are 1


class Scaled(NamedTuple):
    """Verified to be well formed: ``times`` times ``E`` is ``T - times R R'``, all in integers."""

    n: int
    T: dict[tuple[int, int], int]  #: the lower triangle in the order of elimination
    indptr: list[int]
    indices: list[int]
    data: list[int]
    times: int
    weights: list[int]


def scaled(n: int, entries: Any, factor: SparseFactor, power: int = 0, scale: int = 1) -> Scaled | None:
    """Return a matrix and its factor in integers, None if something is malformed or too large.

    Parameters
    ----------
    n : int
    entries : (rows, columns, values)
        The lower triangle of ``scale S`` in ints, ``row >= column``; repeated entries add up.
    factor : SparseFactor
    power : int
        For ``S`` over a scale: the exponents may be those of another multiple of it.
    scale : int
        Positive.
    """
    try:
        d = [1] * n if factor.weights is None else factor.weights
        columns = [*entries, factor.order, factor.indptr, factor.indices, factor.data, factor.exponents, d]
        columns = [x.tolist() if hasattr(x, "tolist") else list(x) for x in columns]
    except TypeError:
        return None
    columns.append([factor.bits, power, scale])
    if len(columns) != 10 or not all(set(map(type, column)) <= {int} for column in columns):
        return None
    rows, cols, values, order, indptr, indices, data, exponents, d, _ = columns
    if not (len(rows) == len(cols) == len(values) and len(exponents) == len(d) == n and min([scale, *d]) > 0):
        return None
    largest = max(map(abs, (factor.bits, power, *exponents)))
    if largest > LARGEST_SHIFT or not _well_formed(n, order, indptr, indices, data):
        return None
    if not all(n > row >= column >= 0 for row, column in zip(rows, cols, strict=True)):
        return None
    place = [0] * n
    for k, node in enumerate(order):
        place[node] = k
    shifts = [exponents[i] + exponents[j] + power + 2 * factor.bits for i, j in zip(rows, cols, strict=True)]
    up = max(0, -min(shifts, default=0))
    if not fits((max(shifts, default=0) + up) * len(shifts), LARGEST_BITS):
        return None
    T: dict[tuple[int, int], int] = defaultdict(int)
    for i, j, value, shift in zip(rows, cols, values, shifts, strict=True):
        a, b = place[i], place[j]
        T[(a, b) if a >= b else (b, a)] += value << (shift + up)
    return Scaled(n, T, indptr, indices, data, scale << up, d)


def _well_formed(n: int, order: list[int], indptr: list[int], indices: list[int], data: list[int]) -> bool:
    """Tell whether ``order`` is a permutation, and the others the columns of a lower triangular matrix."""
    if sorted(order) != list(range(n)) or len(indices) != len(data) or len(indptr) != n + 1:
        return False
    if indptr != sorted(indptr) or (indptr[0], indptr[n]) != (0, len(indices)):
        return False
    columns = enumerate(indices[first:last] for first, last in pairwise(indptr))
    return all(not rows or (k <= rows[0] and rows[-1] < n and rows == sorted(set(rows))) for k, rows in columns)


def remainder(S: Scaled) -> list[dict[int, int]] | None:
    """Return the lower triangle of ``times E`` by rows; None if that is too much work or memory."""
    if sum((b - a + 1) * (b - a) // 2 for a, b in pairwise(S.indptr)) > LARGEST_PAIRS:
        return None
    E: list[dict[int, int]] = [defaultdict(int) for _ in range(S.n)]
    count = 0
    for first, last in pairwise(S.indptr):
        part = list(zip(S.indices[first:last], S.data[first:last], strict=True))
        for number, (i, x) in enumerate(part, 1):
            row = E[i]
            count -= len(row)
            for j, y in part[:number]:
                row[j] -= x * y
            count += len(row)
            if not fits(count, LARGEST_KEPT):
                return None
    if not fits(sum(map(len, E)) * S.times.bit_length(), LARGEST_BITS):
        return None
    for row in E:
        for j in row:
            row[j] *= S.times
    for (i, j), value in S.T.items():
        E[i][j] += value
    return E


def spare(E: Sequence[Mapping[int, int]], d: Sequence[int]) -> list[int]:
    """Return ``E_ii d_i - sum_j |E_ij| d_j`` of a symmetric matrix given by its lower triangle.

    Examples
    --------
    >>> spare([{0: 2}, {0: -1, 1: 3}], [1, 1])
    [1, 2]
    """
    margins = [0] * len(E)
    for i, row in enumerate(E):
        for j, value in row.items():
            if i == j:
                margins[i] += value * d[i]
            else:
                margins[i] -= abs(value) * d[j]
                margins[j] -= abs(value) * d[i]
    return margins


# ---------------------------------------------------------------------- what decides


class Arithmetic:
    """What decides, by the standard library; :mod:`lmi.exact.fast` has its twin, with arrays."""

    name = "standard library"
    #: Largest sum of squared column lengths of a sparse factor that is taken.
    products = 300_000_000
    #: Whether NumPy is used.
    numpy = False

    def definite(self, S: Rows) -> bool:
        """Tell whether a symmetric integer matrix is proved positive definite.

        Examples
        --------
        >>> Arithmetic().definite([[2, 1], [1, 1]]), Arithmetic().definite([[1, 1], [1, 1]])
        (True, False)
        """
        return symmetric(S) and self.factor(S) is not None

    def factor(self, S: Rows, first: int = BITS[0]) -> Factor | None:
        """Return the factor that proves a matrix definite, with ``first`` bits or more; None if none does."""
        n = len(S)
        for bits in BITS[BITS.index(first) :]:
            spend(n**3 // 6, bits, bits, "a proof of definiteness")
            try:
                return Factor(S, bits)
            except ArithmeticError:
                continue
        return None

    def residual_definite(self, n: int, entries: Any, factor: SparseFactor, power: int = 0, scale: int = 1) -> bool:
        """Tell whether a rounded sparse factor proves a symmetric matrix positive definite; see :func:`scaled`.

        Examples
        --------
        >>> entries = [0, 1, 1], [0, 0, 1], [4, 2, 5]
        >>> good = SparseFactor([0, 1], [0, 2, 3], [0, 1, 1], [31, 16, 31], [0, 0], 4)
        >>> judge = Arithmetic().residual_definite
        >>> judge(2, entries, good), judge(2, entries, good._replace(data=[31, 0, 31]))
        (True, False)
        """
        S = scaled(n, entries, factor, power, scale)
        return S is not None and (margins := self.spare(S)) is not None and min(margins, default=1) > 0

    def spare(self, S: Scaled) -> list[int] | None:
        """Return by how much each row of the remainder dominates, None if that is too much work."""
        E = remainder(S)
        return None if E is None else spare(E, S.weights)

    def product(self, A: Rows, B: Rows) -> list[list[int]]:
        """Return ``A B``.

        Examples
        --------
        >>> Arithmetic().product([[1, 2], [0, 1]], [[3, 0], [1, 1]])
        [[5, 2], [1, 1]]
        """
        columns = list(zip(*B, strict=True))
        return [[sum(map(mul, row, column)) for column in columns] for row in A]

    def characteristic(self, rows: Sequence[Mapping[int, int]]) -> list[int]:
        """Return ``det(x I - A)`` of a sparse integer matrix, the leading coefficient first.

        Examples
        --------
        >>> Arithmetic().characteristic([{0: 1, 1: 2}, {0: 3, 1: 4}])
        [1, -5, -2]
        """
        return characteristic(rows)

    def above(self, S: Rows, D: Rows, bits: int = BITS[0]) -> list[Fraction] | None:
        """Bound ``d'S^-1 d`` from above for every row ``d`` of ``D``, by one factor; None if ``S > 0`` is not proved.

        Parameters
        ----------
        S : n rows of n integers
        D : rows of n integers
            A bound is 0 iff the row is.
        bits : int
            Of the factor, at least; the bounds are sharp to about as many unless ``S`` is nearly singular.

        Examples
        --------
        >>> [float(x) for x in Arithmetic().above([[2, 1], [1, 1]], [[1, 0], [0, 2]])]
        [1.0, 8.0]
        """
        factor = self.factor(S, bits) if symmetric(S) else None
        if factor is None:
            return None
        spend(len(D) * len(S) ** 2 // 2, factor.bits, factor.bits, "constants of many agents")
        return [factor.above(d) for d in D]

    def bounded(self, S: Rows, forms: Sequence[tuple[Sequence[int], int]]) -> int | None:
        """Return the first ``k`` for which ``(d_k'x)^2 < c_k x'S x`` is not proved for all ``x``; None if all are.

        Where ``d_k = 0``, nonnegative ``c_k`` will do. Nothing is bounded unless ``S > 0`` is proved.

        Parameters
        ----------
        S : n rows of n integers
        forms : pairs ``d_k`` (n integers), ``c_k``

        Examples
        --------
        >>> Arithmetic().bounded([[2, 1], [1, 1]], [([1, 0], 2), ([0, 1], 1)])
        1
        """
        todo = list(range(len(forms)))
        for bits in BITS:
            values = self.above(S, [forms[k][0] for k in todo], bits)
            if values is None:
                return 0
            pairs = ((k, forms[k][1], value) for k, value in zip(todo, values, strict=True))
            todo = [k for k, c, value in pairs if not (value < c or value == c == 0)]
            if not todo:
                return None
        return todo[0]
