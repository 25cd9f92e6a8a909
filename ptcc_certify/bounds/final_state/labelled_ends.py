"""Ends between which the agents of a family are at the deadline, by label."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import cached_property
from typing import Any

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.errors import quoted
from ptcc_certify.graphs.labels import place_of, position
from ptcc_certify.graphs.rationals import shorten

Interval = tuple[Fraction, Fraction]


class FinalEnds(tuple[Interval | None, ...]):
    """The ends of every agent, in the order of the nodes: a tuple that takes labels.

    Attributes
    ----------
    labels : tuple of str

    References
    ----------
    docs/theory/families.md, "Where it ends".

    Examples
    --------
    >>> ends = FinalEnds([(Fraction(6, 5), Fraction(8, 5)), None], ["ann", "bob"])
    >>> ends, ends["ann"] == ends[0]
    (FinalEnds(ann in [1.2, 1.6], bob unknown), True)
    >>> FinalEnds([None, (Fraction(2), Fraction(2))], ["1", "2"])[2]  # a number is a label where labels are numbers
    (Fraction(2, 1), Fraction(2, 1))
    """

    labels: tuple[str, ...]

    def __new__(cls, ends: Iterable[Interval | None], labels: Iterable[str]) -> FinalEnds:
        """Keep the labels beside the ends."""
        self = super().__new__(cls, ends)
        self.labels = tuple(labels)
        return self

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self), self.labels

    def __getitem__(self, key: Any) -> Any:
        """Return the ends of an agent by its label; where no label is a number, by its place, too."""
        if isinstance(key, slice) or (hasattr(key, "__index__") and -len(self) <= key < 0 and not self._numbered):
            return super().__getitem__(key)
        return super().__getitem__((position if self._numbered else place_of)(key, self.labels))

    @cached_property
    def _numbered(self) -> bool:
        return any(label.removeprefix("-").isdecimal() for label in self.labels)

    def __repr__(self) -> str:
        texts = [f"{quoted(shorten(label))} {_text(ends)}" for label, ends in zip(self.labels[:8], self, strict=False)]
        return f"FinalEnds({', '.join(texts)}{', ...' if len(self) > 8 else ''})"


def _text(ends: Interval | None) -> str:
    if ends is None:
        return "unknown"
    low, high = ends
    if down(low) == up(high):
        return f"at {down(low)}"
    return f"in [{down(low)}, {up(high)}]"
