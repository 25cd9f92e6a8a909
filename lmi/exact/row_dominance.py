"""Decay rates that positive vectors prove for a matrix whose diagonal dominates, and a bound on all diagonal rates.

All in integers and rationals, with the standard library.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from numbers import Rational
from operator import mul
from typing import Any

#: Numerators and positive denominators of the rates of the rows.
Pairs = list[tuple[int, int]]
Rows = Sequence[Sequence[Fraction]]


def dominates(n: int, edges: Any, diagonal: Any, u: Any, v: Any, rate: Any) -> bool:
    """Check that two positive vectors prove a rate for a matrix, in integers.

    ``A`` has ``diagonal`` and, for each edge, its weight at (target, source). With ``M`` the comparison matrix,
    ``-|A_ij|`` off the diagonal, True means ``u, v, diagonal > 0`` and

        v_i (M u)_i + u_i (M' v)_i >= rate u_i v_i    for all i,

    hence ``Omega A + A' Omega >= rate Omega`` with ``Omega = diag(v / u)``: the symmetric Z-matrix
    ``Omega M + M' Omega - rate Omega`` takes ``u > 0`` to a nonnegative vector, and bounds the one of ``A`` from below.

    Parameters
    ----------
    n : int
    edges : (sources, targets, weights)
        Three sequences of ints; nodes are 0 to n - 1. The sizes of repeated edges
        add up, and a loop counts against its node: what is proved holds for their sum as well.
    diagonal, u, v : n ints
    rate : Fraction or int
        In units of the weights.

    Returns
    -------
    bool
        False as well for what is malformed.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> edges = [0, 1], [1, 0], [-1, 1]
    >>> dominates(2, edges, [2, 2], [1, 1], [1, 1], 2), dominates(2, edges, [2, 2], [1, 1], [1, 1], Fraction(201, 100))
    (True, False)
    """
    pairs, ratio = _pairs(n, edges, diagonal, u, v), ratio_of(rate)
    return pairs is not None and ratio is not None and all(ratio[1] * x >= ratio[0] * y for x, y in pairs)


def largest_rate(n: int, edges: Any, diagonal: Any, u: Any, v: Any) -> Fraction | None:
    """Return the largest rate that :func:`dominates`; None for what is malformed, or has no rows.

    Examples
    --------
    >>> largest_rate(2, ([0, 1], [1, 0], [-1, 1]), [2, 2], [1, 1], [1, 1])
    Fraction(2, 1)
    """
    return least_ratio(_pairs(n, edges, diagonal, u, v) or [])


def least_ratio(pairs: Pairs) -> Fraction | None:
    """Return the least quotient of numbers and positive numbers, None if there is none."""
    if not pairs:
        return None
    least, under = pairs[0]
    for x, y in pairs:
        if x * under < least * y:
            least, under = x, y
    return Fraction(least, under)


def ratio_of(rate: Any) -> tuple[int, int] | None:
    """Return numerator and denominator of a rational, None if it is something else."""
    return (int(rate.numerator), int(rate.denominator)) if isinstance(rate, Rational) else None


def _pairs(n: int, edges: Any, diagonal: Any, u: Any, v: Any) -> Pairs | None:
    """Return ``v_i (M u)_i + u_i (M' v)_i`` and ``u_i v_i`` of all rows; None for what is malformed."""
    try:
        columns = [x.tolist() if hasattr(x, "tolist") else list(x) for x in (*edges, diagonal, u, v)]
    except TypeError:
        return None
    if len(columns) != 6 or not all(set(map(type, column)) <= {int} for column in columns):
        return None
    sources, targets, weights, diagonal, u, v = columns
    if not len(sources) == len(targets) == len(weights) or not len(diagonal) == len(u) == len(v) == n:
        return None
    if not all(0 <= x < n for ends in (sources, targets) for x in ends) or any(x <= 0 for x in (*u, *v, *diagonal)):
        return None
    heard, hearing = [0] * n, [0] * n
    for source, target, weight in zip(sources, targets, map(abs, weights), strict=True):
        heard[target] += weight * u[source]
        hearing[source] += weight * v[target]
    rows = zip(u, v, diagonal, heard, hearing, strict=True)
    return [(2 * d * a * b - b * inward - a * outward, a * b) for a, b, d, inward, outward in rows]


def bounds_diagonal_rates(A: Rows, Y: Rows, rate: Fraction) -> bool:
    """Check in rationals that ``Y`` proves: no diagonal ``Omega > 0`` decays faster than ``rate``.

    That is, ``Omega A + A' Omega >= b Omega`` needs ``b <= rate``.

    ``X = Y Y'`` is positive semidefinite; if it is not zero and ``diag(A X) <= (rate/2) diag(X)``, then such an
    ``Omega`` would give ``b sum_i omega_i X_ii <= 2 sum_i omega_i (A X)_ii <= rate sum_i omega_i X_ii``.

    Parameters
    ----------
    A : n rows of n Fractions
    Y : n rows of k Fractions
    rate : Fraction
        Per unit of the clock.

    Returns
    -------
    bool
        False: this ``Y`` proves nothing.

    References
    ----------
    Barker, Berman, Plemmons, Positive diagonal solutions to the Lyapunov equations, Linear Multilinear Algebra 5
    (1978).

    Examples
    --------
    >>> one = Fraction(1)
    >>> bounds_diagonal_rates([[one, -one], [-one, one]], [[one], [one]], Fraction(0))
    True
    >>> bounds_diagonal_rates([[one, -one], [-one, 2 * one]], [[one], [one]], Fraction(0))
    False
    """
    (a, unit), (y, _) = _whole(A), _whole(Y)
    sizes = [sum(map(mul, row, row)) for row in y]
    columns = list(zip(*y, strict=True))
    moved = [
        sum(x * sum(map(mul, row, column)) for x, column in zip(own, columns, strict=True))
        for row, own in zip(a, y, strict=True)
    ]
    return any(sizes) and all(2 * m <= rate * unit * size for m, size in zip(moved, sizes, strict=True))


def _whole(M: Rows) -> tuple[list[list[int]], int]:
    """Return a rational matrix as integers over one denominator, and that."""
    scale = math.lcm(*(x.denominator for row in M for x in row))
    return [[x.numerator * (scale // x.denominator) for x in row] for row in M], scale
