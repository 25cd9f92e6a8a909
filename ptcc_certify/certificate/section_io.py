"""Vectors and long numbers of a certificate's file: in the JSON, or beside it; exact, or as balls."""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from fractions import Fraction
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from ptcc_certify.bounds.final_state.enclosed_ends import DECIMALS, RADIUS
from ptcc_certify.bounds.float_conversion import floats
from ptcc_certify.checker.reading import Interval, RejectedError
from ptcc_certify.checker.section_declarations import Pattern, Rule, declared
from ptcc_certify.checker.side_files import Numbers, SideFiles, beside
from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import read_bytes
from ptcc_certify.graphs.rationals import format_exact, writable

#: Vectors above this length go to side files.
LONG = 50_000
#: Bits of numerator and denominator up to which an interval is written as it is.
_SHORT_BITS = 256


class Writer:
    """Writes the vectors of a document: in the JSON, or the long ones to side files.

    Parameters
    ----------
    labels : sequence of str
        Of the nodes.
    files : bool
        Whether vectors of more than ``LONG`` entries go to side files.
    followers : sequence of str
        The labels of followers.

    Attributes
    ----------
    files : dict of str to bytes
        Names and contents of the side files, ``.npy`` vectors of 64-bit numbers.
    written_groups : set of tuple
        The proofs of leader groups that are written already: first row, rate, weights.
    """

    def __init__(self, labels: Sequence[str], files: bool = False, followers: Sequence[str] = ()):
        self.labels, self.followers, self._aside = labels, followers, files
        self.files: dict[str, bytes] = {}
        self.written_groups: set[tuple[int, Fraction, bytes]] = set()

    def aside(self, length: int) -> bool:
        """Tell whether a vector of this length goes to a side file."""
        return self._aside and length > LONG

    def file(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return its name and hash."""
        content = io.BytesIO()
        np.save(content, values.astype("<f8" if values.dtype.kind == "f" else "<i8"), allow_pickle=False)
        sha256 = hashlib.sha256(content.getvalue()).hexdigest()
        file = f"{sha256[:16]}-{name}.npy"
        self.files[file] = content.getvalue()
        return {"file": file, "sha256": sha256}

    def vector(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return what stands for the vector."""
        return {**self.file(name, values), "count": values.size}

    def nodes(self, nodes: Sequence[int] | np.ndarray) -> Any:
        """Write node indices as labels, or as a side file of indices."""
        if self.aside(len(nodes)):
            return self.vector("nodes", np.asarray(nodes, dtype=np.int64))
        return [self.labels[v] for v in np.asarray(nodes, dtype=np.int64).tolist()]

    def floats(self, name: str, values: np.ndarray) -> Any:
        """Write floats as the dyadic numbers that they are."""
        if self.aside(values.size):
            return self.vector(name, values)
        return [x.hex() for x in values.tolist()]

    def integers(self, name: str, values: np.ndarray) -> Any:
        """Write int64 numbers."""
        return self.vector(name, values.astype(np.int64)) if self.aside(values.size) else values.tolist()

    def state(self, name: str, state: Sequence[Fraction] | None) -> Any:
        """Write one number of each agent: by label, or as a side file of integers over a common denominator."""
        if state is None:
            return None
        return self._over_scale(name, state) or dict(zip(self.labels, map(format_exact, state), strict=True))

    def numbers(self, name: str, values: Sequence[Fraction]) -> Any:
        """Write numbers as texts, or as a side file of integers over a common denominator."""
        return self._over_scale(name, values) or [format_exact(x) for x in values]

    def _over_scale(self, name: str, values: Sequence[Fraction]) -> dict[str, Any] | None:
        """Put many numbers into a side file of integers over a common denominator; None where int64 is too short."""
        if not self.aside(len(values)):
            return None
        scale = math.lcm(*{x.denominator for x in values})
        if scale.bit_length() >= 63:
            return None
        whole = [x.numerator * (scale // x.denominator) for x in values]
        if max(map(abs, whole)) >= 2**63:
            return None
        return {**self.vector(name, np.array(whole, dtype=np.int64)), "scale": str(scale)}


class Reader:
    """Reads the vectors of an accepted document; the check has verified that every part is there.

    Parameters
    ----------
    labels : sequence of str
        Of the nodes.
    files : mapping of str to bytes
        The side files.
    """

    def __init__(self, labels: Sequence[str], files: Mapping[str, bytes]):
        self.files = SideFiles(Path(), files)
        self._index = {label: i for i, label in enumerate(labels)}

    def nodes(self, section: Any) -> tuple[int, ...]:
        """Read node indices."""
        if beside(section):
            return tuple(self.files.integers(section, "nodes", section["count"]))
        return tuple(self._index[label] for label in section)

    def floats(self, section: Any, length: int) -> np.ndarray:
        """Read a vector as the floats nearest to its numbers, each rounded once."""
        return floats(self.files.numbers(section, "a vector", length))


def read_side_files(document: Mapping[str, Any], folder: Path) -> dict[str, bytes]:
    """Return the side files of a document that was accepted, by name; what is ``unverified`` names none.

    Raises
    ------
    FormatError
        One was changed or removed since the check.
    """
    named = dict(_side_files([part for key, part in document.items() if key != "unverified"]))
    files = {name: read_bytes(folder / name, name) for name in named}
    for name, content in files.items():
        if hashlib.sha256(content).hexdigest() != named[name]:
            raise FormatError(f"{name}: was changed while the certificate was read; try again")
    return files


def _side_files(value: Any) -> Iterator[tuple[str, str]]:
    """Yield name and hash of every side file; two numbers of agents called ``file`` and ``sha256`` are none."""
    if isinstance(value, dict) and re.fullmatch("[0-9a-f]{64}", str(value.get("sha256"))) and "file" in value:
        yield value["file"], value["sha256"]
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _side_files(part)


def text(value: Fraction | None) -> str | None:
    """Write a rational if there is one."""
    return None if value is None else format_exact(value)


def readable(read: Callable[[], Any]) -> Any:
    """Return what is read from a part of any content; None where it cannot be."""
    try:
        return read()
    except (RejectedError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError):
        return None


def finite(value: float | None) -> float | None:
    """Return a float that JSON holds, or None."""
    return value if value is not None and math.isfinite(value) else None


# ---------------------------------------------------------------------- balls


def exact_or_ball(value: Fraction) -> str | dict[str, str]:
    """Write a rational exactly, or as a ball ``{mid, radius}`` that contains it where the text would be too long.

    Examples
    --------
    >>> exact_or_ball(Fraction(1, 3))
    '1/3'
    >>> sorted(exact_or_ball(Fraction(1, 3**9000)))
    ['mid', 'radius']
    """
    return format_exact(value) if writable(value) else _ball_text((value, RADIUS))


def interval_text(interval: Interval) -> str | dict[str, str]:
    """Write an interval: exactly if its radius is 0, or its numbers are short; otherwise as a ball that contains it."""
    if interval[1] == 0:
        return exact_or_ball(interval[0])
    if all(map(writable, interval)) and all(
        _odd_bits(n) <= _SHORT_BITS for x in interval for n in x.as_integer_ratio()
    ):
        return {"mid": format_exact(interval[0]), "radius": format_exact(interval[1])}
    return _ball_text(interval)


def _odd_bits(n: int) -> int:
    """Return the bits of an integer but for a power of two."""
    return n.bit_length() - (n & -n).bit_length()


def _ball_text(interval: Interval) -> dict[str, str]:
    """Write an interval as a ball that contains it, with short decimals."""
    middle, radius = interval
    unit = 10**DECIMALS
    mid = round(middle * unit)
    wide = math.ceil((radius + abs(middle - Fraction(mid, unit))) * unit)
    return {"mid": f"{mid}e-{DECIMALS}", "radius": f"{wide}e-{DECIMALS}"}


def write(kind: Any, value: Any, out: Writer, key: str = "a vector") -> Any:
    """Return what stands in the file for a value of this declaration.

    Parameters
    ----------
    kind : declaration
    value : object
        A section, or anything with attributes of these names: numbers as Fraction, or as floats, which are the dyadic
        numbers that they are; vectors as sequences or arrays.
    out : Writer
        Where long vectors go.
    key : str
        Under which it stands, which names its side file.
    """
    if value is None:
        return None
    if get_origin(kind) in (Union, UnionType):
        kinds = [one for one in get_args(kind) if one is not NoneType]
        return write(next((one for one in kinds if _fits(one, value)), kinds[0]), value, out, key)
    value = value.values if isinstance(value, Numbers) else value
    if get_origin(kind) is Annotated:
        return _annotated(*get_args(kind), value=value, out=out, key=key)
    if get_origin(kind) is tuple:
        return [write(inner, one, out, key) for inner, one in zip(get_args(kind), value, strict=True)]
    if kind is Fraction:
        return _text(value)
    if isinstance(kind, type) and is_dataclass(kind):
        pairs = ((f, getattr(value, f.name)) for f in declared(kind))
        return {f.key: write(f.kind, one, out, f.key) for f, one in pairs if not (f.optional and one is None)}
    return value


def _fits(kind: Any, value: Any) -> bool:
    """Tell whether a value is of one of several kinds."""
    if get_origin(kind) is Annotated:
        return _fits(get_args(kind)[0], value)
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    kind = get_origin(kind) or kind
    return kind is Any or (isinstance(kind, type) and isinstance(value, kind))


def _text(value: Fraction | float) -> str:
    """Write a number exactly; a float as the dyadic number that it is."""
    if isinstance(value, float):
        return value.hex() if value else "0"
    return format_exact(value)


def _annotated(inner: Any, note: Any, *rest: str, value: Any, out: Writer, key: str) -> Any:
    if isinstance(note, Rule | Pattern):
        return write(inner, value, out, key)
    if note == "a ball":
        return interval_text(value)
    if note == "a list":
        return [write(get_args(inner)[0], one, out, key) for one in value]
    if note == "ends by agent":
        return dict(zip(out.labels, map(interval_text, zip(*value, strict=True)), strict=True))
    if note == "lower triangle":
        return [list(map(_text, row[: k + 1])) for k, row in enumerate(value)]
    if note == "by some agents":
        return {label: write(get_args(inner)[1], x, out, key) for label, x in value.items()}
    if note == "a label":
        return out.labels[value]
    if note == "nodes":
        return [out.labels[v] for v in np.asarray(value).tolist()]
    if note == "many nodes":
        return out.nodes(value)
    if note in ("integers", "integers of followers"):
        return out.integers(key, np.asarray(value))
    if note == "numbers" and not isinstance(value, np.ndarray):  # whose length the file does not tell
        return list(map(format_exact, value))
    if note.startswith("numbers"):
        return _numbers(value, out, key)
    if inner is Numbers and not rest and isinstance(value, np.ndarray) and out.aside(value.size):
        return out.vector(key, value)
    if inner is Numbers and not rest and not isinstance(value, np.ndarray):
        return out.state(key, value)
    labels, each = out.followers if note == "by follower" else out.labels, Fraction if inner is Numbers else None
    values = value.tolist() if isinstance(value, np.ndarray) else value
    kind = each or get_args(inner)[0]
    return {label: write(kind, x, out, key) for label, x in zip(labels, values, strict=True)}


def _numbers(value: Any, out: Writer, key: str) -> Any:
    if isinstance(value, np.ndarray):
        return out.floats(key, value)
    return format_exact(value) if isinstance(value, Fraction) else out.numbers(key, value)
