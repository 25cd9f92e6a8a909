"""Numbers as they are shown: what was proved is rounded to the safe side, what is exact and short is shown exactly.

A lower bound goes :func:`down`, an upper bound :func:`up`; what was given, and is bounded by nothing, is told by
:func:`near`. One pair of functions for screen, page, statement and the report of the check.
"""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction


def down(x: Fraction | float, digits: int = 6) -> str:
    """Write a number with up to so many digits, not above it; exactly, if that is possible.

    Examples
    --------
    >>> down(Fraction(139985999972, 10**10)), down(Fraction(7, 2)), down(Fraction(-1, 3), 2), down(0.1, 20)
    ('13.9985', '3.5', '-0.34', '0.10000000000000000555')
    """
    if x == 0:
        return "0"
    return _write(x, digits, ROUND_FLOOR)


def up(x: Fraction | float, digits: int = 6) -> str:
    """Write a number with up to so many digits, not below it; exactly, if that is possible.

    A float 0 is an exponential that left float64, and is written as ``1e-300``.

    Examples
    --------
    >>> up(Fraction(1, 3)), up(Fraction(7, 2)), up(Fraction(10) ** 500 / 3), up(0.0), up(math.inf)
    ('0.333334', '3.5', '3.33334e+499', '1e-300', 'infinity')
    """
    if x == 0:
        return "0" if isinstance(x, Fraction | int) else "1e-300"
    return _write(x, digits, ROUND_CEILING)


def near(x: Fraction, digits: int = 6) -> str:
    """Write a rational exactly, as a decimal or a quotient, if that is short, else rounded and marked by ``~``.

    Examples
    --------
    >>> near(Fraction(3, 5)), near(Fraction(1, 3)), near(Fraction(10**9 + 1, 3 * 10**9))
    ('0.6', '1/3', '~0.333333')
    """
    text = _write(x, digits, ROUND_HALF_EVEN) if x else "0"
    if Fraction(text) == x:
        return text
    short = x.numerator.bit_length() + x.denominator.bit_length() <= 3 * digits
    return str(x) if short else f"~{text}"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Examples
    --------
    >>> counted(1, "edge"), counted(0, "edge"), counted(1005, "closed component")
    ('1 edge', '0 edges', '1,005 closed components')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def float_down(x: Fraction) -> float:
    """Return the largest float that is not above a rational.

    Examples
    --------
    >>> float_down(Fraction(1, 2)), float_down(Fraction(1, 10)) < Fraction(1, 10), float_down(-Fraction(10) ** 400)
    (0.5, True, -inf)
    """
    return -float_up(-x)


def float_up(x: Fraction) -> float:
    """Return the smallest float that is not below a rational, infinite beyond float64.

    Examples
    --------
    >>> float_up(Fraction(1, 2)), float_up(Fraction(1, 3)) > Fraction(1, 3), float_up(Fraction(10) ** 400)
    (0.5, True, inf)
    """
    try:
        nearest = float(x)
    except OverflowError:
        nearest = math.inf if x > 0 else -math.inf
    return nearest if nearest >= x else math.nextafter(nearest, math.inf)


def _write(x: Fraction | float, digits: int, rounding: str) -> str:
    if isinstance(x, float) and not math.isfinite(x):
        return "infinity" if x > 0 else "-infinity" if x < 0 else "nan"
    exact = Fraction(x)
    context = Context(prec=digits, rounding=rounding)
    value = context.divide(Decimal(exact.numerator), Decimal(exact.denominator))
    if digits <= 15 and Decimal("1e-300") < abs(value) < Decimal("1e300"):
        return f"{float(value):.{digits}g}"  # which has the digits of the decimal, as 15 are kept
    return f"{value.normalize(Context(prec=digits)):g}"
