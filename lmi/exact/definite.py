"""Definiteness of symmetric integer matrices, decided exactly, for the independent check of certificates.

A rounded Cholesky factor ``R`` is formed in integers, and every remainder is kept: ``S = R R' + E`` with ``E`` known
exactly. Where the diagonal of ``E`` exceeds the sum of the other entries of each row, ``S`` is positive definite. The
standard library suffices; python-flint, where it is there, decides small matrices by another way.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import chain
from math import isqrt
from operator import mul
from typing import Any

from lmi.exact.sparse import dense_definite
from lmi.exact.spectral_line import characteristic
from lmi.exact.work import affordable, fits, spend

Rows = Sequence[Sequence[int]]
#: Bits of the factor, one after the other, until the proof succeeds.
BITS = (128, 320, 1024, 4096)
#: Up to this many rows python-flint decides, by the characteristic polynomial.
FLINT_ROWS = 24
#: python-flint is not asked about entries longer than these bits over the number of rows.
FLINT_BITS = 40_000
#: Above this many rows NumPy, where it is installed, forms factor and remainder, or solves.
NUMPY_ROWS = 24
#: Matrices with entries of more bits whose mean is shorter by this factor are not multiplied by python-flint.
PADDED_BITS, PADDED = 4000, 8
#: Bits of all entries up to which python-flint multiplies large matrices.
LONGEST = 200_000_000
#: Bits of an inverse factor in floats, and how near it takes a matrix to the identity: ``2^-CONGRUENCE``.
FLOAT_BITS, CONGRUENCE = 53, 30


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
        if any(S[i][i] <= 0 for i in range(n)):
            raise ArithmeticError("a diagonal entry is not positive")
        self.shifts = [self._shift(S[i][i]) for i in range(n)]
        self.rows: list[list[int]] = []
        self.diagonal: list[int] = []
        # Scaled entries lie below 4^(bits + 1), so entries of R below 2^(bits + 1). A scaled entry is cut to an
        # integer and a quotient is rounded: each off-diagonal entry of E is at most 2^bits + 1 in size. With one more
        # row below (see `above`) a row of E has n of them.
        self.slack = (n + 1) * (2**bits + 1)
        for i in range(n):
            row = self._substituted(S[i], self.shifts[i])
            left = _scaled(S[i][i], 2 * self.shifts[i]) - sum(map(mul, row, row)) - self.slack
            if left <= 0:
                raise ArithmeticError("not proved")
            self.rows.append(row)
            self.diagonal.append(isqrt(left))
            if not self.diagonal[-1]:
                raise ArithmeticError("not proved")

    def _shift(self, entry: int) -> int:
        """Return the power of two by which row and column are scaled, so that the diagonal fits the bits."""
        return self.bits - (entry.bit_length() - 1) // 2

    def _substituted(self, entries: Sequence[int], shift: int) -> list[int]:
        """Return the row of ``R`` that belongs to a row of ``S``: forward substitution, each quotient rounded."""
        row: list[int] = []
        for entry, own, known, pivot in zip(entries, self.shifts, self.rows, self.diagonal, strict=False):
            left = _scaled(entry, own + shift) - sum(map(mul, row, known))
            row.append((2 * left + pivot) // (2 * pivot))
        return row

    def above(self, d: Sequence[int]) -> Fraction:
        """Bound ``d'S^-1 d`` from above, to ``bits`` bits or so: ``[[S, d], [d', c]]`` is definite for this ``c``."""
        if not any(d):
            return Fraction(0)
        # The largest of d_i^2 / S_ii, none of which exceeds the value, gets as large as a diagonal entry of S.
        shift = 2 * self.bits - max(abs(x).bit_length() + own for x, own in zip(d, self.shifts, strict=True) if x)
        row = self._substituted(d, shift)
        return Fraction(sum(map(mul, row, row)) + self.slack) / Fraction(4) ** shift


def _scaled(entry: int, shift: int) -> int:
    return entry << shift if shift >= 0 else entry >> -shift


class Standard:
    """Definiteness by the standard library."""

    name = "standard library"
    #: Largest matrix that is taken, and largest sum of squared column lengths of a sparse factor.
    rows, products = 400, 300_000_000
    #: Whether NumPy is used.
    numpy = False

    def definite(self, S: Rows) -> bool:
        """Tell whether a symmetric integer matrix is proved positive definite.

        Examples
        --------
        >>> Standard().definite([[2, 1], [1, 1]]), Standard().definite([[1, 1], [1, 1]])
        (True, False)
        """
        return self.factor(S) is not None

    def factor(self, S: Rows, first: int = BITS[0]) -> Factor | None:
        """Return the factor that proves a matrix definite, with ``first`` bits or more; None if none does."""
        n = len(S)
        for bits in BITS:
            # Every precision costs more than the one before.
            if bits >= first and affordable(n**3 // 6, bits, bits):
                spend(n**3 // 6, bits, bits)
                try:
                    return Factor(S, bits)
                except ArithmeticError:
                    continue
        return None

    def product(self, A: Rows, B: Rows) -> list[list[int]]:
        """Return ``A B``.

        Examples
        --------
        >>> Standard().product([[1, 2], [0, 1]], [[3, 0], [1, 1]])
        [[5, 2], [1, 1]]
        """
        columns = list(zip(*B, strict=True))
        return [[sum(map(mul, row, column)) for column in columns] for row in A]

    def characteristic(self, rows: Sequence[Mapping[int, int]]) -> list[int]:
        """Return ``det(x I - A)`` of a sparse integer matrix, the leading coefficient first.

        Examples
        --------
        >>> Standard().characteristic([{0: 1, 1: 2}, {0: 3, 1: 4}])
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
        >>> [float(x) for x in Standard().above([[2, 1], [1, 1]], [[1, 0], [0, 2]])]
        [1.0, 8.0]
        """
        factor = self.factor(S, bits)
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
        >>> Standard().bounded([[2, 1], [1, 1]], [([1, 0], 2), ([0, 1], 1)])
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


class Flint(Standard):
    """Definiteness by python-flint, and by NumPy for large matrices; in between as above.

    python-flint forms the characteristic polynomial: ``S > 0`` iff its signs alternate strictly (Descartes; its roots
    are real).
    """

    def __init__(self) -> None:
        self.flint: Any = importlib.import_module("flint")
        self.name = f"python-flint {self.flint.__version__} and the standard library"
        with contextlib.suppress(ImportError):
            self.name = f"python-flint {self.flint.__version__}, NumPy {importlib.import_module('numpy').__version__}"
            self.products, self.numpy = 10_000_000_000, True

    def definite(self, S: Rows) -> bool:
        """Tell whether a symmetric integer matrix is positive definite; see :meth:`Standard.definite`."""
        if len(S) > NUMPY_ROWS:
            with contextlib.suppress(ImportError):
                if dense_definite(S):
                    return True
        if not self._short(S):
            return super().definite(S)
        coefficients = self.flint.fmpz_mat([list(row) for row in S]).charpoly().coeffs()  # constant term first
        return all(c * (-1) ** (len(S) - k) > 0 for k, c in enumerate(coefficients))

    def product(self, A: Rows, B: Rows) -> list[list[int]]:
        """Return ``A B``, by python-flint unless some entries are much longer than others, which it pads all to."""
        long, short = sorted((longest(A), longest(B)), reverse=True)
        if not A or not B or _padded(A) or _padded(B) or long > max(PADDED_BITS, PADDED**2 * short):
            return super().product(A, B)
        left, right = (self.flint.fmpz_mat([list(row) for row in M]) for M in (A, B))
        return [[int(x) for x in row] for row in (left * right).tolist()]

    def characteristic(self, rows: Sequence[Mapping[int, int]]) -> list[int]:
        """Return the characteristic polynomial; see :meth:`Standard.characteristic`."""
        dense = [[row.get(j, 0) for j in range(len(rows))] for row in rows]
        return [int(c) for c in reversed(self.flint.fmpz_mat(dense).charpoly().coeffs())]

    def above(self, S: Rows, D: Rows, bits: int = BITS[0]) -> list[Fraction] | None:
        """Bound ``d'S^-1 d`` from above for every row ``d`` of ``D``; see :meth:`Standard.above`.

        For large matrices first by a matrix that takes ``S`` near to the identity: the inverse of a float factor.
        """
        if self.numpy and len(S) > NUMPY_ROWS and bits == BITS[0]:
            values = self._above_by_congruence(S, D)
            if values is not None:
                return values
        return super().above(S, D, bits)

    def _above_by_congruence(self, S: Rows, D: Rows) -> list[Fraction] | None:
        """Bound ``d'S^-1 d`` by ``|Y'd|^2 / least``, since ``Y'S Y >= least I`` is dominated by its diagonal."""
        np, matrix = importlib.import_module("numpy"), self.flint.fmpz_mat
        if any(row[i] <= 0 for i, row in enumerate(S)):
            return None
        T, halves = unit_diagonal(S)
        try:
            found = np.linalg.inv(np.linalg.cholesky(T)).T
        except np.linalg.LinAlgError:
            return None
        # Y = 2^-power U found, U diagonal, in integers: columns of S and D are multiplied by U first
        up = [max(halves) - half for half in halves]
        bits = len(S) * longest(S) + len(D) * longest(D) + 2 * (len(S) + len(D)) * max(up)
        if not fits(bits * len(S), LONGEST) or not np.isfinite(found).all():
            return None
        spend((len(S) + len(D)) * len(S) ** 2 // 10, bits // len(S), FLOAT_BITS, "constants of many agents")
        power = FLOAT_BITS - int(np.frexp(np.abs(found).max())[1])
        Y = matrix([[int(x) for x in row] for row in np.ldexp(found, power).tolist()])
        SU = matrix([[x << i + j for x, j in zip(row, up, strict=True)] for row, i in zip(S, up, strict=True)])
        G = [[int(x) for x in row] for row in (Y.transpose() * (SU * Y)).tolist()]
        least, one = min(2 * row[i] - sum(map(abs, row)) for i, row in enumerate(G)), 4 ** (max(halves) + power)
        if (one - least) << CONGRUENCE > one:
            return None
        moved = matrix([[x << j for x, j in zip(d, up, strict=True)] for d in D]) * Y
        return [Fraction(int(sum(x * x for x in row)), least) for row in moved.tolist()]

    def _short(self, rows: Rows) -> bool:
        """Tell whether a matrix is small, and its entries short, for what python-flint does."""
        return 0 < len(rows[0] if rows else ()) <= FLINT_ROWS and longest(rows) * len(rows) <= FLINT_BITS


def longest(rows: Rows) -> int:
    """Return the bits of the largest entry in size.

    Examples
    --------
    >>> longest([[1, 2], [-5, 0]])
    3
    """
    return max(map(abs, chain.from_iterable(rows)), default=0).bit_length()


def _padded(rows: Rows) -> bool:
    """Tell whether all entries are much shorter than the longest one, on average."""
    most, count = longest(rows), sum(map(len, rows))
    return most > PADDED_BITS and sum(map(int.bit_length, chain.from_iterable(rows))) < most * count // PADDED


def floats(rows: Rows) -> tuple[Any, int]:
    """Return integers of any size as an array of float64 and a power of two, by which it is to be multiplied.

    Examples
    --------
    >>> array, power = floats([[1, 2], [3, 10**400]])
    >>> [round(x * 2.0 ** (power - 1328), 3) for x in array[1].tolist()]
    [0.0, 1.707]
    """
    np = importlib.import_module("numpy")
    power = max(longest(rows) - 1000, 0)
    return np.array([[x >> power for x in row] for row in rows] if power else rows, dtype=float), power


def unit_diagonal(S: Rows) -> tuple[Any, list[int]]:
    """Return ``T_ij = 2^(-h_i - h_j) S_ij`` in floats, its diagonal between 1/4 and 1, and ``h``.

    Entries of ``S`` that are smaller than the largest one by 300 decades are lost.

    Examples
    --------
    >>> T, halves = unit_diagonal([[4, 1], [1, 9]])
    >>> T.tolist(), halves
    ([[0.25, 0.0625], [0.0625, 0.5625]], [2, 2])
    """
    np = importlib.import_module("numpy")
    halves = [(S[i][i].bit_length() + 1) // 2 for i in range(len(S))]
    array, power = floats(S)
    powers = np.array(halves)
    return np.ldexp(array, power - powers[:, None] - powers[None, :]), halves


def arithmetic(stdlib: bool = False) -> Standard:
    """Return what decides definiteness: python-flint where it is installed, else (or on request) the standard library.

    Examples
    --------
    >>> arithmetic(stdlib=True).name
    'standard library'
    """
    if not stdlib:
        try:
            return Flint()
        except ImportError:
            pass
    return Standard()
