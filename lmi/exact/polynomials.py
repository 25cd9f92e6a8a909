"""Polynomials and sparse matrices with integer coefficients, exactly, with the standard library."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import gcd

#: Coefficients of an integer polynomial, the leading one first and not zero; the zero polynomial has none.
Polynomial = list[int]
#: A square integer matrix by its rows, without entries that are zero.
Matrix = Sequence[Mapping[int, int]]


def characteristic(rows: Matrix) -> Polynomial:
    """Return ``det(x I - A)`` by the recursion of Samuelson and Berkowitz, which never divides.

    For ``A_k = [[A_(k-1), s], [r, a]]`` the polynomial of ``A_k`` is the product of that of ``A_(k-1)`` with
    ``x - a - r s / x - r A_(k-1) s / x^2 - ...``, cut after the constant term.

    Examples
    --------
    >>> characteristic([{0: 1, 1: 2}, {0: 3, 1: 4}])
    [1, -5, -2]
    """
    p = [1]
    for k, row in enumerate(rows):
        leading = [[(j, v) for j, v in earlier.items() if j < k] for earlier in rows[:k]]  # A_(k-1)
        own = [(j, v) for j, v in row.items() if j < k]
        vector = [earlier.get(k, 0) for earlier in rows[:k]]
        series = [1, -row.get(k, 0)]
        for _ in range(k if own and any(vector) else 0):
            series.append(-sum([v * vector[j] for j, v in own]))
            vector = [sum([v * vector[j] for j, v in entries]) for entries in leading]
        p = product(series, p)[: k + 2]
    return p


def shifted(p: Polynomial, place: Fraction) -> Polynomial:
    """Return ``b^n p((a + y) / b)`` in ``y``, where ``place = a / b`` and ``n`` is the degree.

    Examples
    --------
    >>> shifted([1, 0, 0], Fraction(1, 2))
    [1, 2, 1]
    """
    a, b = place.numerator, place.denominator
    result, scale = [], 1
    for c in p:
        result.append(c * scale)
        scale *= b
    for end in range(len(p), 1, -1):
        for k in range(1, end):
            result[k] += a * result[k - 1]
    return result


def product(p: Polynomial, q: Polynomial) -> Polynomial:
    """Multiply two polynomials."""
    result = [0] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        if a:
            for j, b in enumerate(q, i):
                result[j] += a * b
    return result


def quotient(p: Polynomial, q: Polynomial) -> Polynomial | None:
    """Return ``p / q``, or None unless it is a polynomial with integer coefficients.

    Examples
    --------
    >>> quotient([2, 1, -1], [2, -1]), quotient([2, 1, -1], [2, 1])
    ([1, 1], None)
    """
    remaining, result = list(p), []
    for k in range(len(p) - len(q) + 1):
        c, over = divmod(remaining[k], q[0])
        if over:
            return None
        result.append(c)
        for j, b in enumerate(q, k):
            remaining[j] -= c * b
    return None if any(remaining) else result


def evaluated(p: Polynomial, matrix: Matrix) -> list[dict[int, int]]:
    """Return ``p(M)``.

    Examples
    --------
    >>> [dict(row) for row in evaluated([1, 0, 1], [{1: 2}, {0: 3}])]
    [{0: 7, 1: 0}, {1: 7, 0: 0}]
    """
    result: list[dict[int, int]] = [{} for _ in matrix]
    for c in p:
        result = [row_sum(row, matrix) for row in result]
        for i, row in enumerate(result):
            row[i] += c
    return result


def row_sum(factors: Mapping[int, int], matrix: Matrix) -> dict[int, int]:
    """Return the sum of multiples of some rows of a matrix.

    Examples
    --------
    >>> dict(row_sum({0: 1, 1: 10}, [{0: 2}, {0: 3, 1: 4}]))
    {0: 32, 1: 40}
    """
    total: dict[int, int] = defaultdict(int)
    for k, v in factors.items():
        for j, w in matrix[k].items():
            total[j] += v * w
    return total


def rank(rows: Matrix) -> int:
    """Return the rank of an integer matrix, by elimination without fractions.

    Each row is kept primitive, so that its entries are not larger than minors of the matrix.

    Examples
    --------
    >>> rank([{0: 1, 1: 2}, {0: 2, 1: 4}, {2: 5}])
    2
    """
    remaining, count = [_primitive_row(row) for row in rows], 0
    while remaining := [row for row in remaining if row]:
        pivot = min(remaining, key=len)
        column = min(pivot, key=lambda j: abs(pivot[j]))
        remaining.remove(pivot)
        count += 1
        for k, row in enumerate(remaining):
            if column in row:
                remaining[k] = _primitive_row(row_sum({0: pivot[column], 1: -row[column]}, [row, pivot]))
    return count


def _primitive_row(row: Mapping[int, int]) -> dict[int, int]:
    content = gcd(*row.values())
    return {j: v // content for j, v in row.items() if v}
