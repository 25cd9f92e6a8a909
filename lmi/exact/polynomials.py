"""Polynomials and sparse matrices with integer coefficients, exactly, with the standard library."""

from __future__ import annotations

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
    leading: list[list[tuple[int, int]]] = []  # rows of A_(k-1), as pairs of column and entry
    columns: list[list[tuple[int, int]]] = [[] for _ in rows]
    for i, row in enumerate(rows):
        for j, v in row.items():
            columns[j].append((i, v))
    for k, row in enumerate(rows):
        r = [(j, v) for j, v in row.items() if j < k]
        vector = [0] * k
        for i, v in columns[k]:
            if i < k:
                vector[i] = v
        series = [1, -row.get(k, 0)]
        if r and any(vector):
            for step in range(k):
                if step:
                    vector = [sum([v * vector[j] for j, v in entries]) for entries in leading]
                series.append(-sum([v * vector[j] for j, v in r]))
        p = product(series, p)[: k + 2]
        for i, v in columns[k]:
            if i < k:
                leading[i].append((k, v))
        leading.append([(j, v) for j, v in row.items() if j <= k])
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


def derivative(p: Polynomial) -> Polynomial:
    """Return the primitive part of the derivative."""
    return primitive([c * k for k, c in zip(range(len(p) - 1, 0, -1), p, strict=False)])


def primitive(p: Polynomial) -> Polynomial:
    """Divide by the greatest common divisor of the coefficients, a positive number."""
    content = gcd(*p)
    return [c // content for c in p] if content > 1 else p


def remainder(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return a positive multiple of the remainder of ``p`` by ``q``, primitive.

    Examples
    --------
    >>> remainder([2, 0, 1], [-3, 1])
    [1]
    """
    left = list(p)
    while len(left) >= len(q):
        scale = gcd(left[0], q[0])
        up, down = q[0] // scale, left[0] // scale
        if up < 0:
            up, down = -up, -down
        left = [up * c - (down * q[k] if k < len(q) else 0) for k, c in enumerate(left)]
        while left and not left[0]:
            del left[0]
    return primitive(left)


def quotient(p: Polynomial, q: Polynomial) -> Polynomial | None:
    """Return ``p / q``, or None unless it is a polynomial with integer coefficients.

    Examples
    --------
    >>> quotient([2, 1, -1], [2, -1]), quotient([2, 1, -1], [2, 1])
    ([1, 1], None)
    """
    left, result = list(p), []
    for k in range(len(p) - len(q) + 1):
        c, over = divmod(left[k], q[0])
        if over:
            return None
        result.append(c)
        for j, b in enumerate(q, k):
            left[j] -= c * b
    return None if any(left) else result


def common_divisor(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return the primitive greatest common divisor, with a positive leading coefficient.

    Examples
    --------
    >>> common_divisor([1, 0, -1], [2, 4, 2])
    [1, 1]
    """
    while q:
        p, q = q, remainder(p, q)
    p = primitive(p)
    return p if p[0] > 0 else [-c for c in p]


def squarefree(p: Polynomial) -> Polynomial:
    """Return the primitive polynomial with the roots of a primitive one, each once.

    Examples
    --------
    >>> squarefree([1, 4, 5, 2])
    [1, 3, 2]
    """
    return divided(p, common_divisor(p, derivative(p)))


def divided(p: Polynomial, q: Polynomial) -> Polynomial:
    """Divide by a primitive divisor."""
    result = quotient(p, q)
    if result is None:
        raise ArithmeticError("a division leaves a remainder")
    return result


def evaluated(pairs: Polynomial, zero: bool, matrix: Matrix) -> list[dict[int, int]]:
    """Return ``G(M^2)``, or ``M G(M^2)``."""
    result = _identity(len(matrix), pairs[0])
    for c in pairs[1:]:
        result = _times(_times(result, matrix), matrix)
        for i, row in enumerate(result):
            row[i] = row.get(i, 0) + c
    return _times(result, matrix) if zero else result


def _identity(size: int, factor: int) -> list[dict[int, int]]:
    return [{i: factor} for i in range(size)]


def _times(left: Matrix, right: Matrix) -> list[dict[int, int]]:
    result = []
    for row in left:
        total: dict[int, int] = {}
        for k, v in row.items():
            for j, w in right[k].items():
                total[j] = total.get(j, 0) + v * w
        result.append(total)
    return result


def rank(rows: Matrix) -> int:
    """Return the rank of an integer matrix, by elimination without fractions.

    Each row is kept primitive, so that its entries are not larger than minors of the matrix.

    Examples
    --------
    >>> rank([{0: 1, 1: 2}, {0: 2, 1: 4}, {2: 5}])
    2
    """
    left = [_primitive_row(row) for row in rows]
    left = [row for row in left if row]
    found = 0
    while left:
        pivot = min(left, key=len)
        left.remove(pivot)
        found += 1
        column = min(pivot, key=lambda j: abs(pivot[j]))
        head = pivot.pop(column)
        kept = []
        for row in left:
            factor = row.pop(column, 0)
            if factor:
                scale = gcd(head, factor)
                up, down = head // scale, factor // scale
                total = {j: up * v for j, v in row.items()}
                for j, v in pivot.items():
                    total[j] = total.get(j, 0) - down * v
                row = _primitive_row(total)
            if row:
                kept.append(row)
        left = kept
    return found


def _primitive_row(row: Mapping[int, int]) -> dict[int, int]:
    content = gcd(*row.values())
    return {j: v // content for j, v in row.items() if v}
