"""Symmetric matrix polynomials that are nonnegative on an interval, decided exactly, with the standard library.

On ``[low, high]`` a polynomial of degree ``m`` is ``F(x) = sum_i C(m, i) t^i (1 - t)^(m - i) B_i``, a convex
combination of its Bernstein coefficients ``B_i``, where ``t`` goes from 0 to 1. If all of them are nonnegative, so is
``F``; where ``F > 0`` that holds on all short pieces of the interval.

References
----------
Farouki, The Bernstein polynomial basis: a centennial retrospective, Computer Aided Geometric Design 29 (2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from math import comb, lcm

from lmi.exact.definite import Rows
from lmi.exact.numbers import longest
from lmi.exact.work import spend


def semidefinite(S: Rows) -> bool:
    """Tell whether a small symmetric integer matrix is positive semidefinite: ``x'S x >= 0`` for all ``x``.

    By symmetric elimination without fractions; a pivot that is 0 needs a row that is 0. Every entry on the way is a
    minor of the matrix.

    Parameters
    ----------
    S : n rows of n integers
        Only matrices that are symmetric are semidefinite here.

    Returns
    -------
    bool
        Exactly so, unlike :meth:`lmi.exact.definite.Arithmetic.definite`, which proves ``S > 0`` or nothing.

    Examples
    --------
    >>> semidefinite([[1, 1], [1, 1]]), semidefinite([[0, 1], [1, 5]]), semidefinite([[0, 0], [0, 2]]), semidefinite([])
    (True, False, True, True)
    """
    n, bits = len(S), longest(chain.from_iterable(S))
    if [list(row) for row in S] != [list(column) for column in zip(*S, strict=True)]:
        return False
    spend(n**3, n * bits, n * bits, "a proof of semidefiniteness")
    rows, before = [list(row) for row in S], 1
    while rows:
        k = next((i for i, row in enumerate(rows) if row[i]), None)
        if k is None:
            return not any(map(any, rows))
        pivot, own = rows[k][k], rows[k]
        if pivot < 0:
            return False
        kept = [i for i in range(len(rows)) if i != k]
        rows = [[(pivot * rows[i][j] - rows[i][k] * own[j]) // before for j in kept] for i in kept]
        before = pivot
    return True


def bernstein(coefficients: Sequence[Rows], low: Fraction, high: Fraction) -> list[list[list[int]]]:
    """Return the Bernstein coefficients of a matrix polynomial on an interval, times one positive integer.

    With ``x = low + (high - low) t`` and ``F = sum_j C_j t^j`` they are ``B_i = sum_(j <= i) C(i, j)/C(m, j) C_j``.

    Parameters
    ----------
    coefficients : m + 1 matrices of integers
        ``F_0, F_1, .., F_m`` of ``F(x) = sum_j F_j x^j``.
    low, high : Fraction
        The ends, in units of ``x``.

    Returns
    -------
    list of m + 1 matrices of integers

    Examples
    --------
    >>> bernstein([[[1]], [[-2]], [[1]]], Fraction(0), Fraction(1, 2))  # (1 - x)^2: 1, 1/2, 1/4 times 8
    [[[8]], [[4]], [[2]]]
    """
    m, unit = len(coefficients) - 1, lcm(low.denominator, high.denominator)
    begin, width = int(low * unit), int((high - low) * unit)
    many, size = m + 1, sum(map(len, coefficients[0]))
    bits = longest(chain.from_iterable(chain.from_iterable(coefficients)))
    ends = longest((unit, begin, width)) + 2
    spend(2 * size * many**2, bits + many * ends, many * ends, "Bernstein coefficients")
    common = lcm(*(comb(m, j) for j in range(many)))
    # unit^(m - j) (begin + width t)^j C(i, l)/C(m, l), summed over the powers l of t that belong to B_i
    shares = [
        [
            sum(
                common // comb(m, power) * comb(i, power) * comb(j, power) * begin ** (j - power) * width**power
                for power in range(min(i, j) + 1)
            )
            * unit ** (m - j)
            for j in range(many)
        ]
        for i in range(many)
    ]
    rows = range(len(coefficients[0]))
    return [
        [
            [sum(x * F[i][j] for x, F in zip(share, coefficients, strict=True)) for j in range(len(coefficients[0][i]))]
            for i in rows
        ]
        for share in shares
    ]


def nonnegative_between(coefficients: Sequence[Rows], low: Fraction, high: Fraction) -> bool:
    """Tell whether a symmetric matrix polynomial is proved nonnegative on an interval, by its Bernstein coefficients.

    Parameters
    ----------
    coefficients : m + 1 matrices of integers
        See :func:`bernstein`.
    low, high : Fraction

    Examples
    --------
    >>> square = [[[1]], [[-2]], [[1]]]  # (1 - x)^2 has the coefficients 1, -1, 1 on 0 .. 2
    >>> nonnegative_between(square, Fraction(0), Fraction(2)), nonnegative_between(square, Fraction(1), Fraction(2))
    (False, True)
    """
    return all(map(semidefinite, bernstein(coefficients, low, high)))
