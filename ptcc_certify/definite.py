"""Definiteness of symmetric integer matrices, decided exactly, for the independent check of certificates.

A rounded Cholesky factor ``R`` is formed in integers, and every remainder is kept: ``S = R R' + E`` with ``E`` known
exactly. Where the diagonal of ``E`` exceeds the sum of the other entries of each row, ``S`` is positive definite. The
standard library suffices; python-flint, where it is there, decides small matrices by another way.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Sequence
from math import isqrt
from operator import mul
from typing import Any

from ptcc_certify.sparse_definite import dense_definite
from ptcc_certify.work import affordable, spend

Rows = Sequence[Sequence[int]]
#: Bits of the factor, one after the other, until the proof succeeds.
BITS = (128, 320, 1024, 4096)
#: Up to this many rows python-flint decides: by the characteristic polynomial, and by exact solutions.
FLINT_ROWS = 24
#: python-flint is not asked about entries longer than these bits over the number of rows.
FLINT_BITS = 40_000
#: Above this many rows NumPy, where it is installed, forms factor and remainder.
NUMPY_ROWS = 150
#: Bits that the entries of a dense matrix may take together.
MOST_BITS = 400_000_000


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
    >>> Factor([[2, 1], [1, 1]], 64).bounds([1, 0], 1), Factor([[2, 1], [1, 1]], 64).bounds([1, 1], 1)
    (False, False)
    >>> Factor([[2, 1], [1, 1]], 64).bounds([1, 0], 2)
    True
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
        # row below (see `bounds`) a row of E has n of them.
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

    def bounds(self, d: Sequence[int], c: int) -> bool:
        """Prove ``(d'x)^2 < c x'S x`` for all ``x`` but 0: ``[[S, d], [d', c]]`` is definite; or that ``d`` is 0."""
        if not any(d):
            return c >= 0
        if c <= 0:
            return False
        shift = self._shift(c)
        row = self._substituted(d, shift)
        return _scaled(c, 2 * shift) - sum(map(mul, row, row)) >= self.slack


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

    def bounded(self, S: Rows, forms: Sequence[tuple[Sequence[int], int]]) -> int | None:
        """Return the first ``k`` for which ``(d_k'x)^2 < c_k x'S x`` is not proved for all ``x``; None if all are.

        Where ``d_k = 0``, nonnegative ``c_k`` will do.

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
            factor = self.factor(S, bits)
            if factor is None:
                return 0
            spend(len(todo) * len(S) ** 2 // 2, bits, bits, "constants of many agents")
            todo = [k for k in todo if not factor.bounds(*forms[k])]
            if not todo:
                return None
        return todo[0]


class Flint(Standard):
    """Definiteness by python-flint, and by NumPy for large matrices; in between as above.

    python-flint solves exactly and forms the characteristic polynomial: ``S > 0`` iff its signs alternate strictly
    (Descartes; its roots are real).
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

    def bounded(self, S: Rows, forms: Sequence[tuple[Sequence[int], int]]) -> int | None:
        """Return the first form that exceeds its bound, by exact solutions; see :meth:`Standard.bounded`."""
        if not forms or not self._short([*S, *(d for d, _ in forms)]) or len(S) > FLINT_ROWS or not self.definite(S):
            return super().bounded(S, forms)
        columns = self.flint.fmpz_mat([list(column) for column in zip(*(d for d, _ in forms), strict=True)])
        solved, scale = self.flint.fmpz_mat([list(row) for row in S]).solve(columns).numer_denom()
        reached = columns.transpose() * solved
        exceeds = (k for k, (d, c) in enumerate(forms) if reached[k, k] >= c * scale and (any(d) or c < 0))
        return next(exceeds, None)

    def _short(self, rows: Rows) -> bool:
        """Tell whether a matrix is small, and its entries short, for what python-flint does."""
        longest = max((x.bit_length() for row in rows for x in row), default=0)
        return 0 < len(rows[0] if rows else ()) <= FLINT_ROWS and longest * len(rows) <= FLINT_BITS


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
