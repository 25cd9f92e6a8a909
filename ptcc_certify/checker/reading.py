"""Reads a certificate strictly: bounded size and depth, exact numbers of one written grammar, no unknown keys."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

from ptcc_certify.errors import FormatError

SCHEMA = "ptcc-certificate/1"
#: Limits of a file, of the text of a number, and of its decimal and binary exponents.
MAX_BYTES, MAX_CHARACTERS, MAX_EXPONENT, MAX_BINARY_EXPONENT = 200_000_000, 4000, 400, 1400
#: Longest common denominator that is formed, and bits that a vector may take over one.
MAX_SCALE_BITS, MAX_TOTAL_BITS = 100_000, 8_000_000_000
INTEGER, SIGNED = re.compile(r"[0-9]+", re.ASCII), re.compile(r"[+-]?[0-9]+", re.ASCII)
DECIMAL = re.compile(r"([+-]?[0-9]*)(?:\.([0-9]*))?(?:[eE]([+-]?[0-9]{1,5}))?", re.ASCII)
HEXADECIMAL = re.compile(r"([+-]?)0[xX]([0-9a-fA-F]+)(?:\.([0-9a-fA-F]*))?[pP]([+-]?[0-9]{1,5})", re.ASCII)

Interval = tuple[Fraction, Fraction]


class RejectedError(Exception):
    """A claim does not follow."""


def read(path: str | Path) -> dict[str, Any]:
    """Read the JSON of a certificate strictly: bounded size, no duplicate keys, no number that is not finite.

    Raises
    ------
    FormatError
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
        integer = lambda text: int(text) if len(text) <= 18 else number(text)  # noqa: E731
        data = json.loads(
            content.decode("utf-8"),
            object_pairs_hook=unique,
            parse_constant=number,
            parse_float=number,
            parse_int=integer,
        )
    except (OSError, ValueError, RecursionError) as error:
        said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise FormatError(f"{name}: not a readable certificate ({short(said, 160)})") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise FormatError(f'{name}: not a certificate of schema "{SCHEMA}"')
    return data


def digest(data: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything but ``digest`` and ``unverified``, as JSON with sorted keys and no blanks."""
    said = {key: value for key, value in data.items() if key not in ("digest", "unverified")}
    return hashlib.sha256(json.dumps(said, sort_keys=True, separators=(",", ":")).encode("ascii")).hexdigest()


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
    if isinstance(text, str) and len(text) <= MAX_CHARACTERS and (value := _parsed(text)) is not None:
        return value
    raise RejectedError(f"{short(str(text))} is not an exact number")


@lru_cache(maxsize=10_000)
def _parsed(text: str) -> Fraction | None:
    top, slash, bottom = text.partition("/")
    if SIGNED.fullmatch(top) and (not slash or (INTEGER.fullmatch(bottom) and int(bottom))):
        return Fraction(int(top), int(bottom or 1))
    if match := HEXADECIMAL.fullmatch(text):
        part, exponent = match[3] or "", int(match[4])
        value = Fraction(int(match[1] + match[2] + part, 16))
        if abs(exponent) <= MAX_BINARY_EXPONENT:
            return value * Fraction(2) ** (exponent - 4 * len(part))
    match = DECIMAL.fullmatch(text)
    if match and (match[1].strip("+-") or match[2]) and abs(int(match[3] or 0)) <= MAX_EXPONENT:
        part = match[2] or ""
        digits, shift = int(match[1] + part), int(match[3] or 0) - len(part)
        return Fraction(digits * 10**shift) if shift >= 0 else Fraction(digits, 10**-shift)
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
    for key in keys:
        if key not in value:
            raise RejectedError(f'the key "{short(key)}" is missing')
    for key in value:
        if key not in known:
            raise RejectedError(f'the key "{short(str(key))}" is not known')
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
    """Return rational rows times their common denominator, and that."""
    scale = 1
    for row in rows:
        scale = math.lcm(scale, *{x.denominator for x in row})
        moderate = scale.bit_length() <= min(MAX_SCALE_BITS, MAX_TOTAL_BITS // (len(row) + 1))
        need(moderate, "the numbers have no common denominator of moderate length")
    return [[x.numerator * (scale // x.denominator) for x in row] for row in rows], scale
