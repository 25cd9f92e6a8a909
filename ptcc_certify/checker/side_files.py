"""Long vectors of a certificate: texts in the JSON, or binary files beside it, named with their SHA-256. All exact."""

from __future__ import annotations

import hashlib
import math
import re
import sys
from array import array
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from lmi.exact.numbers import integers, longest, sized
from ptcc_certify.checker.reading import RejectedError, entries, exact, fields, need

NPY = re.compile(
    rb"(?s)\x93NUMPY\x01\x00..\{'descr': '<([if])8', 'fortran_order': False, 'shape': \(([0-9]{1,12}),\), \} *\n"
)


class Numbers:
    """Rationals, each by itself or as integers over one scale.

    Examples
    --------
    >>> x = Numbers([Fraction(1, 2), Fraction(1, 3)])
    >>> x[1], x.over([0, 1]), Numbers([1, 4], 2).over([1])
    (Fraction(1, 3), ([3, 2], 6), ([4], 2))
    """

    def __init__(self, values: Any, scale: int | None = None):
        self.values, self.scale = values, scale

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, k: int) -> Fraction:
        return self.values[k] if self.scale is None else Fraction(self.values[k], self.scale)

    def __iter__(self) -> Iterator[Fraction]:
        return map(self.__getitem__, range(len(self)))

    def over(self, which: Sequence[int]) -> tuple[list[int], int]:
        """Return some of the numbers as integers over a common scale, and that."""
        chosen: list[Any] = [self.values[k] for k in which]
        if self.scale is not None:
            return chosen, self.scale
        (values,), scale = integers([chosen])
        return values, scale

    def largest(self) -> Fraction:
        """Return the largest size."""
        return Fraction(max(map(abs, self.values))) / (self.scale or 1)

    def positive(self) -> bool:
        """Tell whether all are positive."""
        return all(x > 0 for x in self.values)


def beside(entry: Any) -> bool:
    """Tell whether a value stands for a side vector: numbers and labels by agent are never JSON integers."""
    return isinstance(entry, dict) and type(entry.get("count")) is int


class SideFiles:
    """The files that a certificate names: in its folder, or given by name.

    Parameters
    ----------
    folder : Path
    files : mapping from name to bytes, optional
        In place of the folder.
    """

    def __init__(self, folder: Path, files: Mapping[str, bytes] | None):
        self.folder, self.files = folder, files

    def column(self, entry: Any, count: int) -> array[Any]:
        """Read ``{"file", "sha256"}``: a .npy vector of 64-bit integers or finite floats, little-endian."""
        entry = fields(entry, ("file", "sha256"), "a side file")
        name = entry["file"]
        plain = isinstance(name, str) and re.fullmatch(r"[A-Za-z0-9_.-]{1,200}", name)
        need(bool(plain), "a side file's name is odd")
        content = self._content(name, 8 * count + 1024)
        need(hashlib.sha256(content).hexdigest() == entry["sha256"], f"side file {name} is not what its hash says")
        match, start = NPY.match(content), 10 + int.from_bytes(content[8:10], "little")
        if match is None or int(match[2]) != count or not match.end() == start == len(content) - 8 * count:
            raise RejectedError(f"side file {name} is not a vector of {count} numbers")
        values = array("q" if match[1] == b"i" else "d", content[start:])
        if sys.byteorder == "big":
            values.byteswap()
        need(values.typecode == "q" or all(map(math.isfinite, values)), f"side file {name}: a number is not finite")
        return values

    def _content(self, name: str, largest: int) -> bytes:
        if self.files is not None:
            need(name in self.files, f"side file {name} cannot be read")
            return self.files[name]
        try:
            need((self.folder / name).is_file(), f"side file {name} cannot be read")
            with (self.folder / name).open("rb") as file:
                content = file.read(largest + 1)
        except OSError:
            raise RejectedError(f"side file {name} cannot be read") from None
        need(len(content) <= largest, f"side file {name} is not a vector of so few numbers")
        return content

    def _vector(self, entry: dict[str, Any], what: str, count: int) -> array[Any]:
        need(entry["count"] == count, f"{what} has not {count} entries")
        return self.column({key: value for key, value in entry.items() if key not in ("count", "scale")}, count)

    def integers(self, entry: Any, what: str, count: int) -> list[int]:
        """Return a list of JSON integers, or a side vector of integers."""
        if not beside(entry):
            need(all(type(x) is int for x in entries(entry, what, count)), f"{what}: not integers")
            return entry
        need("scale" not in entry, f"{what}: integers have no scale")
        values = self._vector(entry, what, count)
        need(values.typecode == "q", f"{what}: not integers")
        return values.tolist()

    def numbers(self, entry: Any, what: str, count: int) -> Numbers:
        """Return the exact numbers of a list of texts, or of a side vector: floats, or integers over a scale."""
        if not beside(entry):
            return Numbers([exact(x) for x in entries(entry, what, count)])
        values = self._vector(entry, what, count)
        if values.typecode == "d":
            need("scale" not in entry, f"{what}: only integers have a scale")
            ratios = [x.as_integer_ratio() for x in values]
            common = max((q for _, q in ratios), default=1)  # they are powers of two
            sized(count, common.bit_length() + longest(int(end(values)) for end in (min, max) if count), what)
            return Numbers([p * (common // q) for p, q in ratios], common)
        scale = exact(entry.get("scale", "1"))
        need(scale > 0, f"{what}: the scale is not positive")
        factor = scale.denominator
        sized(count, 64 + factor.bit_length(), what)
        return Numbers(values.tolist() if factor == 1 else [factor * x for x in values], scale.numerator)
