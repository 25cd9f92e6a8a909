"""Rational enclosures of the exponential of a small matrix, with the standard library alone.

The matrix is halved until its norm is at most 1/2, its power series is summed in integers over a power of two, and the
sum is squared as often; what is cut off and rounded is bounded in the norm of the largest row sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import factorial
from operator import mul

from lmi.exact.numbers import integers, longest
from lmi.exact.work import spend

#: Bits to which an entry is enclosed unless told otherwise.
BITS = 96
#: Largest norm of a matrix whose exponential is formed.
LARGEST_NORM = 1000

Rows = list[list[Fraction]]


def expm(A: Sequence[Sequence[Fraction]], bits: int = BITS) -> tuple[Rows, Fraction]:
    """Enclose ``e^A``, exactly where ``A`` is strictly upper triangular.

    Parameters
    ----------
    A : n rows of n Fractions
        Of largest row sum, of the sizes of its entries, at most 1,000.
    bits : int
        The radius is at most ``2^-bits``.

    Returns
    -------
    middle : n rows of n Fractions
    radius : Fraction
        No row of what the middle is off has entries whose sizes sum to more.

    Raises
    ------
    OverflowError
        The norm of the matrix is above 1,000.

    Examples
    --------
    >>> expm([[Fraction(0), Fraction(3)], [Fraction(0), Fraction(0)]])
    ([[Fraction(1, 1), Fraction(3, 1)], [Fraction(0, 1), Fraction(1, 1)]], Fraction(0, 1))
    >>> turn, radius = expm([[Fraction(0), Fraction(1)], [Fraction(-1), Fraction(0)]])
    >>> float(turn[0][1]), float(turn[0][0]), radius < Fraction(1, 2**96)
    (0.8414709848078965, 0.5403023058681398, True)
    """
    n = len(A)
    if not any(x for i, row in enumerate(A) for x in row[: i + 1]):
        return _nilpotent(A), Fraction(0)
    norm = max(sum(map(abs, row), Fraction(0)) for row in A)
    if norm > LARGEST_NORM:
        raise OverflowError("the exponential of a matrix of this size is not formed")
    halvings = max(0, int(2 * norm).bit_length())  # norm 2^-halvings <= 1/2
    p = bits + halvings + 3 * int(norm) // 2 + n.bit_length() + 24  # the radius grows like 2^halvings e^norm
    terms = _terms(p)
    spend(n**3 * (terms + halvings), p + 2 * int(norm), p + 2 * int(norm), "the exponential of a matrix")
    B = [[_floor(x, p - halvings) for x in row] for row in A]
    # off: what rows are off by, in units of 2^-p
    total = [[(i == j) << p for j in range(n)] for i in range(n)]
    off, each = Fraction(2), Fraction(0)
    term = total
    for j in range(1, terms + 1):
        term = [[x // j for x in row] for row in _times(term, B, p)]
        each = (each + 2 * n) / j + n  # rows of B, and of a term, have entries whose sizes sum to at most 1
        off += each
        total = [list(map(sum, zip(a, b, strict=True))) for a, b in zip(total, term, strict=True)]
    for _ in range(halvings):
        size = Fraction(max(sum(map(abs, row)) for row in total), 1 << p)
        off = Fraction(-int(-(off * (2 * size + off / (1 << p)) + n + 1) // 1))
        total = _times(total, total, p)
    return [[Fraction(x, 1 << p) for x in row] for row in total], off / (1 << p)


def _nilpotent(A: Sequence[Sequence[Fraction]]) -> Rows:
    """Return ``e^A`` of a strictly upper triangular matrix, which is a finite sum."""
    n = len(A)
    (N, scale), power = integers(A), [[int(i == j) for j in range(n)] for i in range(n)]
    bits = n * (longest(x for row in N for x in row) + scale.bit_length() + n)
    spend(n**4, bits, bits, "the exponential of a matrix")
    total = [[Fraction(x) for x in row] for row in power]
    for j in range(1, n):
        columns = list(zip(*N, strict=True))
        power = [[sum(map(mul, row, column)) for column in columns] for row in power]
        over = factorial(j) * scale**j
        total = [[x + Fraction(y, over) for x, y in zip(*rows, strict=True)] for rows in zip(total, power, strict=True)]
    return total


def _terms(p: int) -> int:
    """Return after how many terms the rest of ``sum_j 2^-j / j!`` is below ``2^-p``."""
    j, size = 0, 1
    while size >> p == 0:
        j += 1
        size = factorial(j + 1) << j
    return j


def _floor(x: Fraction, shift: int) -> int:
    return (x.numerator << shift) // x.denominator if shift >= 0 else x.numerator // (x.denominator << -shift)


def _times(A: Sequence[Sequence[int]], B: Sequence[Sequence[int]], p: int) -> list[list[int]]:
    """Return the product of matrices over ``2^p``, rounded down."""
    columns = list(zip(*B, strict=True))
    return [[sum(map(mul, row, column)) >> p for column in columns] for row in A]
