r"""How long agents of order n need at least, whoever steers them, if their input is within a limit.

Let ``x^(n) = u`` with ``|u| <= U``, and let ``D_i`` be the i-th derivative of its deviation from a free motion at the
beginning, which is 0 at ``T`` with all its derivatives up to ``n - 1``. Integration by parts against the Chebyshev
polynomial ``U_j`` of the second kind, shifted to ``[0, T]``, whose absolute value has the integral ``T``, gives

    | sum_{q < n} 4^q q! C(j + q + 1, 2 q + 1) D_(n-1-q) T^(-q) | <= U T,      j = 0, .., n - 1.

With ``n = 1`` this is ``|D| <= U T``; with ``n = 2`` it is ``|D_1| <= U T`` and ``|2 D_1 + 4 D_0/T| <= U T``. In space
it holds of Euclidean norms.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb, factorial, lcm

from lmi.exact.polynomials import product, shifted

#: A shortest time is found to one part in ``2^20``.
_BITS = 20


def shortest_time(deviations: Sequence[Sequence[Fraction]], limit: Fraction) -> Fraction:
    """Return a time below which no input within a limit ends a deviation from a free motion; 0 if there is none.

    Parameters
    ----------
    deviations : d rows of n Fraction
        Of position, velocity and so on, in each coordinate of space.
    limit : Fraction
        Positive: ``U`` of the Euclidean norm of the input, in units of the input.

    Returns
    -------
    Fraction
        In units of time.

    Examples
    --------
    >>> float(shortest_time([[Fraction(1)]], Fraction(2)))
    0.5
    >>> float(shortest_time([[Fraction(1), Fraction(0)]], Fraction(1)))  # bang-bang: full speed up, full speed down
    2.0
    """
    n = len(deviations[0])
    bounds = [_largest_root(_excess(deviations, j, limit)) for j in range(n)]
    return max((1 / z for z in bounds if z), default=Fraction(0))


def _excess(deviations: Sequence[Sequence[Fraction]], j: int, limit: Fraction) -> list[int]:
    """Return ``(z |..|)^2 - U^2`` as a polynomial in ``z = 1/T``, the highest power first, times a positive number."""
    n = len(deviations[0])
    factors = [4**q * factorial(q) * comb(j + q + 1, 2 * q + 1) for q in range(n)]
    rows = [[c * row[n - 1 - q] for q, c in enumerate(factors)] for row in deviations]
    scale = lcm(limit.denominator, *(x.denominator for row in rows for x in row))
    total = [0] * (2 * n + 1)
    for row in rows:
        p = [int(x * scale) for x in reversed(row)] + [0]
        total = [a + b for a, b in zip(total, product(p, p), strict=True)]
    total[-1] -= int(limit * scale) ** 2
    return total


def _largest_root(p: list[int]) -> Fraction | None:
    """Return a number above which a polynomial is not negative; None if it is nowhere seen to be.

    Its Taylor coefficients there have one sign, so that it grows from there on.
    """
    if not any(p[:-1]):
        return None

    def grows(z: Fraction) -> bool:
        return min(shifted(p, z)) >= 0

    high = Fraction(1)
    while not grows(high):
        high *= 2
    while grows(high / 2):
        high /= 2
    low = high / 2
    while high - low > high / 2**_BITS:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high
