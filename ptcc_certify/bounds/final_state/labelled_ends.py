"""Ends between which the agents of a family are at the deadline, by label."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.graphs.labels import place_of
from ptcc_certify.graphs.rationals import shorten

Interval = tuple[Fraction, Fraction]


class FinalEnds(tuple[Interval | None, ...]):
    """The ends of every agent, in the order of the nodes: a tuple that takes labels beside places.

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
        """Return the ends of an agent, by its place from 0, or by its label if that is a text."""
        from_end = hasattr(key, "__index__") and -len(self) <= key < 0
        return super().__getitem__(key if from_end or isinstance(key, slice) else place_of(key, self.labels))

    def __repr__(self) -> str:
        texts = [f"{shorten(label)} {_text(ends)}" for label, ends in zip(self.labels[:8], self, strict=False)]
        return f"FinalEnds({', '.join(texts)}{', ...' if len(self) > 8 else ''})"


def _text(ends: Interval | None) -> str:
    if ends is None:
        return "unknown"
    low, high = ends
    if down(low) == up(high):
        return f"at {down(low)}"
    return f"in [{down(low)}, {up(high)}]"
