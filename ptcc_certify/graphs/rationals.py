"""The one written grammar of exact numbers, shared by the graph reader, the command line and certificates.

A number is written as

* an integer ``-12``,
* a quotient of integers ``3/4``,
* a decimal ``0.1``, ``-2.5e-3`` with an exponent of at most 400 in absolute value (``0.1`` *is* 1/10), or
* a hexadecimal float ``0x1.8p-3``, read as an integer times a power of two.

The length of a text is capped before anything is converted, so that no input can make a conversion expensive.
"""

from __future__ import annotations

import math
import re
from decimal import Context, Decimal, Inexact
from fractions import Fraction
from numbers import Integral, Rational, Real

from ptcc_certify.errors import NumberError

MAX_CHARACTERS = 4000
MAX_EXPONENT = 400

_INTEGER = re.compile(r"[+-]?[0-9]+", re.ASCII)
_QUOTIENT = re.compile(r"([+-]?[0-9]+)/([0-9]+)", re.ASCII)
_DECIMAL = re.compile(r"([+-]?)([0-9]*)(?:\.([0-9]*))?(?:[eE]([+-]?[0-9]+))?", re.ASCII)
_HEXADECIMAL = re.compile(r"([+-]?)0[xX]([0-9a-fA-F]+)(?:\.([0-9a-fA-F]*))?[pP]([+-]?[0-9]+)", re.ASCII)
_MAX_BINARY_EXPONENT = 1400


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
    text = text.strip()
    if len(text) > MAX_CHARACTERS:
        raise NumberError(f"a number of {len(text)} characters is too long; the limit is {MAX_CHARACTERS}")
    if _INTEGER.fullmatch(text):
        return Fraction(int(text))
    if match := _QUOTIENT.fullmatch(text):
        if int(match[2]) == 0:
            raise NumberError(f'"{shorten(text)}" divides by zero')
        return Fraction(int(match[1]), int(match[2]))
    if match := _HEXADECIMAL.fullmatch(text):
        return _hexadecimal(text, match)
    match = _DECIMAL.fullmatch(text)
    if match and (match[2] or match[3]):
        whole, part = match[2] or "", match[3] or ""
        exponent = _exponent(text, match[4], MAX_EXPONENT)
        digits, shift = int(whole + part), exponent - len(part)
        value = Fraction(digits * 10**shift) if shift >= 0 else Fraction(digits, 10**-shift)
        return -value if match[1] == "-" else value
    if text.lower().lstrip("+-") in {"nan", "inf", "infinity"}:
        raise NumberError(f'"{text}" is not a finite number')
    raise NumberError(f'"{shorten(text)}" is not a number')


def _exponent(text: str, digits: str | None, limit: int) -> int:
    if digits is None:
        return 0
    if len(digits.lstrip("+-0")) > 5 or abs(int(digits)) > limit:
        raise NumberError(f'the exponent of "{shorten(text)}" is beyond {limit}')
    return int(digits)


def _hexadecimal(text: str, match: re.Match[str]) -> Fraction:
    part = match[3] or ""
    exponent = _exponent(text, match[4], _MAX_BINARY_EXPONENT)
    value = Fraction(int(match[2] + part, 16)) * Fraction(2) ** (exponent - 4 * len(part))
    return -value if match[1] == "-" else value


def shorten(text: str, limit: int = 40) -> str:
    """Return ``text`` fit for an error message: printable, and cut after ``limit`` characters."""
    clean = "".join(c if c.isprintable() else "?" for c in text[: limit + 1])
    return clean if len(clean) <= limit else clean[:limit] + "..."


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
    if isinstance(value, bool | bytes | bytearray):
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
