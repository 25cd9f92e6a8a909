"""Exact numbers: the one written grammar, integers over a common denominator, limits of length.

A number is written as

* an integer ``-12``,
* a quotient of integers ``3/4``,
* a decimal ``0.1``, ``-2.5e-3`` with an exponent of at most 400 in size (``0.1`` *is* 1/10), or
* a hexadecimal float ``0x1.8p-3``, read as an integer times a power of two, with an exponent of at most 1400 in size.

An exponent has at most 5 digits. The length of a text is capped before anything is converted, so that no input can make
a conversion expensive.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from fractions import Fraction
from functools import lru_cache

from lmi.exact.work import WorkError, fits, spend

#: Limits of the text of a number, and of its decimal and binary exponents.
MAX_CHARACTERS, MAX_EXPONENT, MAX_BINARY_EXPONENT = 4000, 400, 1400
#: Longest common denominator that is formed, and bits that a vector or a whole matrix of integers may take.
MAX_SCALE_BITS, MAX_TOTAL_BITS = 100_000, 400_000_000
#: Texts of numbers up to this length are kept once they are read.
CACHED = 64

_QUOTIENT = re.compile(r"([+-]?[0-9]+)(?:/([0-9]+))?", re.ASCII)
_DECIMAL = re.compile(r"([+-]?)([0-9]*)(?:\.([0-9]*))?(?:[eE]([+-]?[0-9]+))?", re.ASCII)
_HEXADECIMAL = re.compile(r"([+-]?)0[xX]([0-9a-fA-F]+)(?:\.([0-9a-fA-F]*))?[pP]([+-]?[0-9]+)", re.ASCII)


class NumberError(ValueError):
    """A text is not a number of the exact grammar."""


def parse(text: str) -> Fraction:
    """Read a number of the exact grammar; no blank around it.

    Raises
    ------
    NumberError
        Names the text, cut, and what is wrong with it.

    Examples
    --------
    >>> parse("0.1"), parse("-3/4"), parse("2.5e-3"), parse("0x1.8p-1")
    (Fraction(1, 10), Fraction(-3, 4), Fraction(1, 400), Fraction(3, 4))
    """
    if len(text) <= CACHED:
        return _parse(text)
    spend(1, 2 * len(text), 2 * len(text), "reading long numbers")
    return _parse.__wrapped__(text)  # which is not kept


@lru_cache(maxsize=10_000)
def _parse(text: str) -> Fraction:
    if len(text) > MAX_CHARACTERS:
        raise NumberError(f"a number of {len(text)} characters is too long; the limit is {MAX_CHARACTERS}")
    if match := _QUOTIENT.fullmatch(text):
        bottom = int(match[2] or 1)
        if bottom == 0:
            raise NumberError(f'"{shorten(text)}" divides by zero')
        return Fraction(int(match[1]), bottom)
    if match := _HEXADECIMAL.fullmatch(text):
        base, radix, limit = 16, 2, MAX_BINARY_EXPONENT
    elif (match := _DECIMAL.fullmatch(text)) and (match[2] or match[3]):
        base, radix, limit = 10, 10, MAX_EXPONENT
    elif text.lower().lstrip("+-") in {"nan", "inf", "infinity"}:
        raise NumberError(f'"{text}" is not a finite number')
    else:
        raise NumberError(f'"{shorten(text)}" is not a number')
    sign = match[1]
    integer, fraction, digits = match[2] or "", match[3] or "", match[4] or "0"
    if len(digits.lstrip("+-")) > 5 or abs(int(digits)) > limit:
        raise NumberError(f'the exponent of "{shorten(text)}" is beyond {limit}')
    value, power = int(sign + integer + fraction, base), int(digits) - len(fraction) * (4 if base == 16 else 1)
    return Fraction(value * radix**power) if power >= 0 else Fraction(value, radix**-power)


def shorten(text: str, limit: int = 40) -> str:
    """Return a text fit for a message: printable, and cut after ``limit`` characters."""
    clean = "".join(c if c.isprintable() else "?" for c in text[: limit + 1])
    return clean if len(clean) <= limit else clean[:limit] + "..."


def longest(values: Iterable[int]) -> int:
    """Return the bits of the longest integer.

    Examples
    --------
    >>> longest([1, -8])
    4
    """
    return max(map(int.bit_length, values), default=0)


def integers(rows: Sequence[Sequence[Fraction]]) -> tuple[list[list[int]], int]:
    """Return rational rows times their common denominator, and that; the size of the whole is judged before.

    Examples
    --------
    >>> integers([[Fraction(1, 2), Fraction(2, 3)]])
    ([[3, 4]], 6)
    """
    count, bits = sum(map(len, rows)), longest(x.numerator for row in rows for x in row)
    scale = common_denominator({x.denominator for row in rows for x in row}, count)
    sized(count, bits + scale.bit_length())
    spend(count, bits, scale.bit_length())
    return [[x.numerator * (scale // x.denominator) for x in row] for row in rows], scale


def common_denominator(denominators: Collection[int], count: int, what: str = "the numbers") -> int:
    """Return the least common multiple, by which ``count`` numbers are to be multiplied.

    Raises
    ------
    WorkError
        It would be long.
    """
    scale = 1
    for q in denominators:
        spend(2, scale.bit_length(), q.bit_length(), "a common denominator")
        scale = math.lcm(scale, q)
        if scale.bit_length() > MAX_SCALE_BITS or not fits(scale.bit_length() * count, MAX_TOTAL_BITS):
            raise WorkError(f"{what} have no common denominator of moderate length")
    spend(count, scale.bit_length(), longest(denominators), "a common denominator")
    return scale


def sized(count: int, bits: int, what: str = "the numbers") -> None:
    """Refuse a matrix or a vector of so many integers of so many bits, if it would take much memory.

    Raises
    ------
    WorkError
        It would.
    """
    if not fits(count * bits, MAX_TOTAL_BITS):
        raise WorkError(f"{what} are too long over one denominator")
