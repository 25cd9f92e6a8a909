"""Reads a certificate strictly: bounded size and depth, exact numbers of one written grammar, no unknown keys."""

from __future__ import annotations

import hashlib
import json
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path
from typing import Any

from lmi.exact.numbers import NumberError, longest, parse, shorten
from lmi.exact.work import fits, keeps

SCHEMA = "ptcc-certificate/3"
#: Largest file.
MAX_BYTES = 200_000_000
#: Bytes that the JSON may take in memory, by :func:`loaded_bytes`.
MAX_LOADED = 800_000_000
#: What the digest leaves out.
OUTSIDE = ("digest", "unverified")

Interval = tuple[Fraction, Fraction]


class RejectedError(Exception):
    """A claim does not follow."""


class UnreadableError(ValueError):
    """A file cannot be read as a certificate; one line."""


def read(path: str | Path) -> dict[str, Any]:
    """Read the JSON of a certificate strictly: bounded size, no duplicate keys, no number that is not finite.

    The path ``-`` is standard input.

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
            raise ValueError(f"{shorten(text)} is not a number that is kept")
        return value

    name = "standard input" if path == "-" else shorten(str(path), 200)
    try:
        with nullcontext(sys.stdin.buffer) if path == "-" and sys.stdin else Path(path).open("rb") as file:
            content = file.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes")
        loaded = loaded_bytes(content)
        if not (keeps(loaded) and fits(loaded, MAX_LOADED)):
            tenths = -(-loaded // 10**8)
            raise ValueError(f"it may take {tenths // 10}.{tenths % 10} GB in memory; allow more by --memory")
        text = content.decode("utf-8-sig")
        del content
        # integers of 64 bits, as side files have them too; longer ones have no place in a certificate
        integer = lambda text: int(text) if len(text) <= 20 else number(text)  # noqa: E731
        data = json.loads(text, object_pairs_hook=unique, parse_constant=number, parse_float=number, parse_int=integer)
    except (OSError, ValueError, RecursionError) as error:
        detail = _why(error)
        raise UnreadableError(f"{name}: not a readable certificate ({shorten(detail, 160)})") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise UnreadableError(f"{name}: {_what(data.get('schema') if isinstance(data, dict) else None)}")
    return data


def _what(schema: Any) -> str:
    """Tell what a file of another schema is."""
    kind, _, number = str(schema).partition("/")
    own, _, version = SCHEMA.partition("/")
    if kind != own or not re.fullmatch("[0-9]{1,4}", number) or int(number) == int(version):
        return f'not a certificate of schema "{SCHEMA}"'
    if int(number) < int(version):
        return f"is {schema}, of an older version; certify again"
    return f"is {schema}, which needs a newer version of this program; install it"


def _why(error: Exception) -> str:
    """Tell in plain words why a file cannot be read."""
    if isinstance(error, UnicodeDecodeError):
        return f"no UTF-8 at byte {error.start}"
    if isinstance(error, json.JSONDecodeError):
        return f"no JSON: line {error.lineno}, column {error.colno}: {error.msg.removesuffix(' starting at')}"
    if isinstance(error, RecursionError):
        return "brackets are nested too deep"
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def loaded_bytes(content: bytes) -> int:
    """Bound the memory of a JSON text and of what it becomes, from its brackets, commas, colons and quotes.

    Nothing is decoded yet: one wide character makes every character of a long text take four bytes.

    Examples
    --------
    >>> loaded_bytes(b"[[], []]"), loaded_bytes("[[], ['\U0001f600']]".encode())
    (359, 455)
    """
    objects, arrays, keys, commas, quotes, escapes = (content.count(x) for x in (b"{", b"[", b":", b",", b'"', b"\\"))
    width = 1
    if not content.isascii():
        width = 4 if re.search(rb"[\xf0-\xff]", content) else 2 if re.search(rb"[\xc4-\xff]", content) else 1
    numbers = max(0, commas + 1 + keys - quotes // 2)
    entries = 190 * objects + 90 * arrays + 70 * keys + 9 * commas + 26 * quotes + 32 * numbers
    return entries + 80 * escapes + 2 * width * len(content)


def digest(data: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything but ``digest`` and ``unverified``, as JSON with sorted keys and no blanks."""
    hashed, encoder = hashlib.sha256(b"{"), json.JSONEncoder(sort_keys=True, separators=(",", ":"))
    members = (f"{encoder.encode(key)}:{encoder.encode(data[key])}" for key in sorted(data) if key not in OUTSIDE)
    for number, member in enumerate(members):
        hashed.update(f"{',' if number else ''}{member}".encode("ascii"))
    hashed.update(b"}")
    return hashed.hexdigest()


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
    try:
        return parse(text)
    except NumberError:
        raise RejectedError(f"{shorten(text)} is not an exact number") from None


def need(holds: bool, reason: str) -> None:
    """Reject the claim at hand unless this holds."""
    if not holds:
        raise RejectedError(reason)


def fields(value: Any, keys: Sequence[str], what: str) -> dict[str, Any]:
    """Return an object that has exactly these keys."""
    if not isinstance(value, dict):
        raise RejectedError(f"{what} is not an object")
    names = set(keys)
    for key in [*(k for k in keys if k not in value), *(k for k in value if k not in names)]:
        raise RejectedError(f'the key "{shorten(str(key))}" is {"missing" if key in names else "not known"}')
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


def triangle(entry: Any, n: int) -> list[list[Fraction]]:
    """Return a symmetric matrix from its lower triangle."""
    rows = enumerate(entries(entry, "lower_triangle", n), start=1)
    lower = [[exact(x) for x in entries(row, "a row", count)] for count, row in rows]
    return [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]


def interval(entry: Any) -> Interval:
    """Read an exact number, or a middle with a radius."""
    if not isinstance(entry, dict):
        return exact(entry), Fraction(0)
    fields(entry, ("mid", "radius"), "a number")
    mid, radius = exact(entry["mid"]), exact(entry["radius"])
    need(radius > 0, "a radius is not positive")
    return mid, radius


def length(values: Iterable[Fraction]) -> int:
    """Return the bits of the longest numerator or denominator."""
    return longest(n for x in values for n in x.as_integer_ratio())
