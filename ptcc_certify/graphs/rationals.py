"""Rationals of graphs, command line and certificates: read by the kernel's grammar, and written in it.

The grammar is that of :mod:`lmi.exact.numbers`.
"""

from __future__ import annotations

import math
import operator
import re
from contextlib import suppress
from decimal import Context, Decimal, Inexact
from fractions import Fraction
from numbers import Integral, Rational, Real
from typing import Any

from lmi.exact import numbers
from lmi.exact.numbers import MAX_CHARACTERS, shorten
from ptcc_certify.errors import NumberError, ParameterError

Exact = Fraction | int | float | str
#: Numbers with a decimal comma, and those of them that may have thousands instead.
COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
#: The sign that typesetting and spreadsheets write, which is no hyphen.
MINUS = "\N{MINUS SIGN}"


def parse_exact(text: str) -> Fraction:
    """Read a number of the exact grammar.

    Parameters
    ----------
    text : str
        At most 4,000 characters; blanks around it are ignored.

    Returns
    -------
    Fraction

    Raises
    ------
    NumberError
        Names the text (shortened) and what is wrong with it.

    Examples
    --------
    >>> parse_exact("0.1"), parse_exact("-3/4"), parse_exact("2.5e-3"), parse_exact("0x1.8p-1")
    (Fraction(1, 10), Fraction(-3, 4), Fraction(1, 400), Fraction(3, 4))
    """
    try:
        return numbers.parse(text.strip())
    except numbers.NumberError as error:
        raise NumberError(str(error)) from None


def as_fraction(value: Rational | Real | str, name: str = "value") -> Fraction:
    """Return ``value`` as an exact rational; a float is the dyadic number that it is, a text obeys the grammar.

    Raises
    ------
    NumberError
        ``value`` is not finite, not real, or not of the grammar.

    Examples
    --------
    >>> as_fraction("0.1"), as_fraction(0.5)
    (Fraction(1, 10), Fraction(1, 2))
    """
    if isinstance(value, str):
        return parse_exact(value)
    if type(value).__module__ == "numpy" and getattr(value, "shape", None) == ():
        value = value.item()  # type: ignore[attr-defined]  # NumPy's True is no bool, but its item is
    if isinstance(value, bool | bytes | bytearray) or getattr(value, "ndim", False):
        raise NumberError(f"{name} is {shorten(repr(value))}, not a number")
    if isinstance(value, Integral):
        return Fraction(int(value))
    if isinstance(value, Rational):
        return Fraction(int(value.numerator), int(value.denominator))
    if isinstance(value, Decimal):
        return parse_exact(str(value))
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise NumberError(f"{name} is {shorten(repr(value))}, not a number") from None
    if not math.isfinite(number):
        raise NumberError(f"{name} is {number}, not a finite number")
    return Fraction(number)


def no_number(value: Any, error: NumberError) -> str:
    """Return what is said of a parameter that is no exact number: that, or which limit of the grammar it exceeds.

    Examples
    --------
    >>> no_number("fast", NumberError('"fast" is not a number'))
    '= fast is not a finite number'
    >>> no_number("1e500", NumberError('the exponent of "1e500" is beyond 400'))
    'the exponent of "1e500" is beyond 400'
    """
    plain = str(error).endswith(("not a number", "not a finite number"))
    return f"= {shorten(str(value))} is not a finite number" if plain else str(error)


def decimal_mend(text: str, otherwise: str = "give a number") -> str:
    """Return how a text is mended that is no number: with a point where it has a decimal comma.

    Examples
    --------
    >>> decimal_mend("1,5"), decimal_mend("1,5 m"), decimal_mend("fast")
    ('write decimals with a point, 1.5', 'write decimals with a point', 'give a number')
    >>> decimal_mend("1,500")
    'write 1.500 or 1500'
    """
    if "," not in text:
        return otherwise
    if THOUSANDS.fullmatch(text.strip()):
        return f"write {text.replace(',', '.')} or {text.replace(',', '')}"
    own = f", {text.replace(',', '.')}" if re.fullmatch(r"[-+]?\d{1,20},\d{1,20}", text.strip()) else ""
    return f"write decimals with a point{own}"


def whole_number(value: Any, name: str, least: int, most: int) -> int:
    """Return an integer, NumPy's included, from ``least`` to ``most``; refuse anything else by name.

    Raises
    ------
    ParameterError
        The message tells the value and the domain.

    Examples
    --------
    >>> whole_number(7, "seed", 0, 10)
    7
    """
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        domain = f"an integer from {least} to {most}"
        raise ParameterError(name, f"= {given(value)} is outside its domain; it must be {domain}")
    return number


def number_within(value: Any, name: str, least: float, most: float) -> float:
    """Return the float of a number from ``least`` to ``most``, NumPy's included; refuse anything else by name.

    Raises
    ------
    ParameterError
        The message tells the value and the domain.

    Examples
    --------
    >>> number_within("1/2", "past", 0, 1)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: past = 1/2 is outside its domain; it must be a number from 0 to 1
    """
    with suppress(NumberError):
        if not isinstance(value, str) and least <= as_fraction(value) <= most:
            return float(value)
    domain = f"a number from {least:g} to {most:g}"
    raise ParameterError(name, f"= {given(value)} is outside its domain; it must be {domain}")


def given(value: Any) -> str:
    """Return what was given for a parameter as a message quotes it, truth values as TOML writes them.

    Examples
    --------
    >>> given(True), given(10**5000)
    ('true', 'a number of thousands of digits')
    """
    try:
        return str(value).lower() if isinstance(value, bool) else shorten(str(value))
    except ValueError:  # Python writes no integer of more than 4,300 digits
        return "a number of thousands of digits"


def nearest_float(value: Fraction) -> float:
    """Return the float nearest to a rational, infinite where ``float(value)`` overflows.

    Examples
    --------
    >>> nearest_float(Fraction(1, 3)), nearest_float(Fraction(-(10**400)))
    (0.3333333333333333, -inf)
    """
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def writable(value: Fraction) -> bool:
    """Tell whether a rational is short enough to be written in the exact grammar.

    Examples
    --------
    >>> writable(Fraction(1, 3)), writable(Fraction(1, 3**9000))
    (True, False)
    """
    # One bit is at most 0.30103 decimal digits; the guard comes before the expensive conversion.
    return (value.numerator.bit_length() + value.denominator.bit_length()) * 0.30103 <= MAX_CHARACTERS - 6


def short_exact(value: Fraction) -> str:
    """Write a rational exactly: as a decimal if it is one of at most 17 digits, otherwise as ``p/q``.

    Raises
    ------
    NumberError
        The text would be longer than the grammar allows.

    Examples
    --------
    >>> [short_exact(x) for x in (Fraction(7, 40), Fraction(50), Fraction(1, 3), Fraction(3, 10**9))]
    ['0.175', '50', '1/3', '3E-9']
    """
    exact = Context(prec=17, traps=[Inexact])
    try:
        decimal = exact.divide(Decimal(value.numerator), Decimal(value.denominator)).normalize(exact)
    except Inexact:
        return format_exact(value)
    return f"{decimal:f}" if -7 <= decimal.adjusted() <= 17 else str(decimal)


def format_exact(value: Fraction) -> str:
    """Write a rational as ``p`` or ``p/q``, the inverse of :func:`parse_exact`.

    Raises
    ------
    NumberError
        The text would be longer than the grammar allows.

    Examples
    --------
    >>> format_exact(Fraction(6, -4)), format_exact(Fraction(3))
    ('-3/2', '3')
    """
    if not writable(value):
        raise NumberError("a rational is too long to be written in the exact grammar")
    return str(value.numerator) if value.denominator == 1 else f"{value.numerator}/{value.denominator}"
