"""Objects that hold arrays: read-only, copies too, and equal by value, which ``==`` of tuples cannot tell."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np


class ReadOnly:
    """What holds arrays that are not written to, nor are those of its copies and of what was pickled.

    Examples
    --------
    >>> from copy import deepcopy
    >>> graph = deepcopy(SignedDigraph.from_edges([("a", "b", 1)]))
    >>> graph.sign[0] = -1
    Traceback (most recent call last):
    ValueError: assignment destination is read-only
    """

    def lock(self) -> None:
        """Let no array be written to."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.lock()


class ByValue(ReadOnly):
    """A frozen dataclass whose instances are equal when all fields that compare are: arrays entry by entry.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, eq=False)
    ... class Samples(ByValue):
    ...     t: np.ndarray
    >>> Samples(np.array([0, 1])) == Samples(np.array([0, 1])), Samples(np.array([0])) == Samples(np.array([1]))
    (True, False)
    """

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(mine, its) for mine, its in zip(_values(self), _values(other), strict=True))

    def __hash__(self) -> int:
        return hash(tuple(x.shape if isinstance(x, np.ndarray) else x for x in _values(self)))


def _values(one: Any) -> list[Any]:
    return [getattr(one, field.name) for field in fields(one) if field.compare]


def _same(mine: Any, its: Any) -> bool:
    if isinstance(mine, np.ndarray) and isinstance(its, np.ndarray):
        return np.array_equal(mine, its, equal_nan=mine.dtype.kind == "f")
    return bool(mine == its)
