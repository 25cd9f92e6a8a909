"""Reads a certificate strictly: bounded size and depth, exact numbers of one written grammar, no unknown keys."""

from __future__ import annotations

import hashlib
import json
import math
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

from lmi.exact.work import fits, keeps, spend

SCHEMA = "ptcc-certificate/1"
#: Limits of a file, of the text of a number, and of its decimal and binary exponents.
MAX_BYTES, MAX_CHARACTERS, MAX_EXPONENT, MAX_BINARY_EXPONENT = 200_000_000, 4000, 400, 1400
#: Longest common denominator that is formed, and bits that a vector or a whole matrix of integers may take.
MAX_SCALE_BITS, MAX_TOTAL_BITS = 100_000, 400_000_000
#: Bytes that the JSON may take in memory, by :func:`loaded_bytes`.
MAX_LOADED = 800_000_000
#: Texts of numbers up to this length are kept once they are read.
CACHED = 64
QUOTIENT = re.compile(r"([+-]?[0-9]+)(?:/([0-9]+))?", re.ASCII)
DECIMAL = re.compile(r"([+-]?)(?=\.?[0-9])([0-9]*)(?:\.([0-9]*))?(?:[eE]([+-]?[0-9]{1,5}))?", re.ASCII)
HEXADECIMAL = re.compile(r"([+-]?)0[xX]([0-9a-fA-F]+)(?:\.([0-9a-fA-F]*))?[pP]([+-]?[0-9]{1,5})", re.ASCII)

Interval = tuple[Fraction, Fraction]


class RejectedError(Exception):
    """A claim does not follow."""


class UnreadableError(ValueError):
    """A file cannot be read as a certificate; one line."""


def read(path: str | Path) -> dict[str, Any]:
    """Read the JSON of a certificate strictly: bounded size, no duplicate keys, no number that is not finite.

    Raises
    ------
    UnreadableError
        Names the file and what is wrong.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) != len(pairs):
            raise ValueError("a key occurs twice")
        return result

    def number(text: str) -> float:
        if len(text) > 100 or not math.isfinite(value := float(text)):
            raise ValueError(f"{short(text)} is not a number that is kept")
        return value

    name = short(str(path), 200)
    try:
        with Path(path).open("rb") as file:
            content = file.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes")
        text = content.decode("utf-8")
        loaded = loaded_bytes(content, text)
        if not (keeps(loaded) and fits(loaded, MAX_LOADED)):
            raise ValueError(f"it may take {loaded / 1e9:.1f} GB in memory; allow more by --memory")
        del content
        integer = lambda text: int(text) if len(text) <= 18 else number(text)  # noqa: E731
        data = json.loads(
            text,
            object_pairs_hook=unique,
            parse_constant=number,
            parse_float=number,
            parse_int=integer,
        )
    except (OSError, ValueError, RecursionError) as error:
        said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UnreadableError(f"{name}: not a readable certificate ({short(said, 160)})") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise UnreadableError(f'{name}: not a certificate of schema "{SCHEMA}"')
    return data


def loaded_bytes(content: bytes, text: str) -> int:
    """Bound the memory of a JSON text and of what it becomes, from its brackets, commas, colons and quotes.

    Examples
    --------
    >>> loaded_bytes(b"[[], []]", "[[], []]")
    359
    """
    objects, arrays, keys, commas, quotes = (content.count(x) for x in (b"{", b"[", b":", b",", b'"'))
    width = 1 if text.isascii() else -(-(sys.getsizeof(text) - 80) // len(text))  # bytes of a character
    numbers = max(0, commas + 1 + keys - quotes // 2)
    return 190 * objects + 90 * arrays + 70 * keys + 9 * commas + 26 * quotes + 32 * numbers + 2 * width * len(text)


def digest(data: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything but ``digest`` and ``unverified``, as JSON with sorted keys and no blanks."""
    hashed = hashlib.sha256()
    for part in _canonical({key: value for key, value in data.items() if key not in ("digest", "unverified")}):
        hashed.update(part.encode("ascii"))
    return hashed.hexdigest()


def _canonical(value: Any) -> Iterator[str]:
    """Yield JSON with sorted keys and no blanks in pieces, lest the whole stand in memory once more."""
    items = sorted(value.items()) if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if any(isinstance(x, dict | list) for _, x in items):
        yield "{" if isinstance(value, dict) else "["
        for k, (key, x) in enumerate(sorted(value.items()) if isinstance(value, dict) else enumerate(value)):
            yield ("," if k else "") + (f"{json.dumps(key)}:" if isinstance(value, dict) else "")
            yield from _canonical(x)
        yield "}" if isinstance(value, dict) else "]"
    else:
        yield json.dumps(value, sort_keys=True, separators=(",", ":"))


def exact(text: Any) -> Fraction:
    """Read an integer, a quotient ``p/q``, a decimal with an exponent up to 400, or a hexadecimal float.

    Raises
    ------
    RejectedError
        Not of this grammar, or longer than 4,000 characters.

    Examples
    --------
    >>> exact("-3/4"), exact("2.5e-1"), exact("0x1.8p-1")
    (Fraction(-3, 4), Fraction(1, 4), Fraction(3, 4))
    """
    if not isinstance(text, str):
        raise RejectedError(f"a value of type {type(text).__name__} is not an exact number")
    if len(text) <= CACHED:
        value = _short_number(text)
    else:
        spend(1, 2 * len(text), 2 * len(text), "reading long numbers")
        value = _parsed(text) if len(text) <= MAX_CHARACTERS else None
    if value is None:
        raise RejectedError(f"{short(text)} is not an exact number")
    return value


@lru_cache(maxsize=10_000)
def _short_number(text: str) -> Fraction | None:
    return _parsed(text)


def _parsed(text: str) -> Fraction | None:
    if match := QUOTIENT.fullmatch(text):
        bottom = int(match[2] or 1)
        return Fraction(int(match[1]), bottom) if bottom else None
    kinds = (DECIMAL, 10, 10, 1, MAX_EXPONENT), (HEXADECIMAL, 16, 2, 4, MAX_BINARY_EXPONENT)
    for pattern, base, radix, each, most in kinds:  # a digit of the fraction counts `each` in the exponent
        if (match := pattern.fullmatch(text)) and abs(exponent := int(match[4] or 0)) <= most:
            sign, whole, part = match[1], match[2], match[3] or ""
            return int(sign + whole + part, base) * Fraction(radix) ** (exponent - each * len(part))
    return None


def short(text: str, limit: int = 40) -> str:
    """Return a text fit for a message: printable, and cut."""
    clean = "".join(c if c.isprintable() else "?" for c in text[: limit + 1])
    return clean if len(clean) <= limit else clean[:limit] + "..."


def need(holds: bool, reason: str) -> None:
    """Reject the claim at hand unless this holds."""
    if not holds:
        raise RejectedError(reason)


def fields(value: Any, keys: Sequence[str], what: str) -> dict[str, Any]:
    """Return an object that has exactly these keys."""
    if not isinstance(value, dict):
        raise RejectedError(f"{what} is not an object")
    known = set(keys)
    for key in [*(k for k in keys if k not in value), *(k for k in value if k not in known)]:
        raise RejectedError(f'the key "{short(str(key))}" is {"missing" if key in known else "not known"}')
    return value


def same(one: Any, other: Any) -> bool:
    """Tell whether two JSON values are the same; ``true`` is not 1.

    Examples
    --------
    >>> same([1, {"a": None}], [1, {"a": None}]), same([1], [True])
    (True, False)
    """
    return json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def entries(value: Any, what: str, length: int | None = None) -> list[Any]:
    """Return a list, of this length if one is given."""
    need(isinstance(value, list), f"{what} is not a list")
    need(length is None or len(value) == length, f"{what} has not {length} entries")
    return value


def triangle(said: Any, n: int) -> list[list[Fraction]]:
    """Return a symmetric matrix from its lower triangle."""
    lower = [
        [exact(x) for x in entries(row, "a row", i + 1)] for i, row in enumerate(entries(said, "lower_triangle", n))
    ]
    return [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]


def interval(said: Any) -> Interval:
    """Read an exact number, or a middle with a radius."""
    if not isinstance(said, dict):
        return exact(said), Fraction(0)
    fields(said, ("mid", "radius"), "a number")
    mid, radius = exact(said["mid"]), exact(said["radius"])
    need(radius > 0, "a radius is not positive")
    return mid, radius


def integers(rows: Sequence[Sequence[Fraction]]) -> tuple[list[list[int]], int]:
    """Return rational rows times their common denominator, and that; the size of the whole is judged before."""
    count, bits = sum(map(len, rows)), longest(x.numerator for row in rows for x in row)
    scale = common_denominator({x.denominator for row in rows for x in row}, count)
    size = scale.bit_length()
    sized(count, bits + size)
    spend(count, bits, size)
    return [[x.numerator * (scale // x.denominator) for x in row] for row in rows], scale


def common_denominator(denominators: Collection[int], count: int, what: str = "the numbers") -> int:
    """Return the least common multiple, by which ``count`` numbers are multiplied."""
    scale = 1
    for q in denominators:
        spend(2, scale.bit_length(), q.bit_length(), "a common denominator")
        scale = math.lcm(scale, q)
        short = scale.bit_length() <= MAX_SCALE_BITS and fits(scale.bit_length() * count, MAX_TOTAL_BITS)
        need(short, f"{what} have no common denominator of moderate length")
    spend(count, scale.bit_length(), longest(denominators), "a common denominator")
    return scale


def sized(count: int, bits: int, what: str = "the numbers") -> None:
    """Refuse a matrix or a vector of so many integers of so many bits, if it would take much memory."""
    need(fits(count * bits, MAX_TOTAL_BITS), f"{what} are too long over one denominator")


def longest(values: Iterable[int]) -> int:
    """Return the bits of the longest integer.

    Examples
    --------
    >>> longest([1, -8])
    4
    """
    return max((x.bit_length() for x in values), default=0)


def length(values: Iterable[Fraction]) -> int:
    """Return the bits of the longest numerator or denominator."""
    return longest(n for x in values for n in x.as_integer_ratio())
