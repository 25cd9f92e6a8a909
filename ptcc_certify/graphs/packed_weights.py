"""Exact weights of edges, in as few bytes as hold them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import fields
from fractions import Fraction
from typing import Any

import numpy as np

from ptcc_certify.graphs.rationals import format_exact, nearest_float


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


_INT64_LIMIT = 2**62
SMALLEST_WEIGHT, LARGEST_WEIGHT = 2.3e-308, 1.7e308


class Weights(ReadOnly):
    """Exact weights, stored as int64 numerators over one scale, as float64, or as rationals where neither fits."""

    def __init__(self, values: Sequence[Fraction] | np.ndarray, codes: np.ndarray | None = None):
        """Pack ``values[codes]`` (all of ``values`` when ``codes`` is None); an array is one of floats."""
        self.scale = 1
        if isinstance(values, np.ndarray):
            table: np.ndarray = values.astype(np.float64)
        elif (scale := _common_scale(values)) is not None:
            table, self.scale = np.array([int(v * scale) for v in values], dtype=np.int64), scale
        elif all(math.isfinite(nearest := nearest_float(v)) and Fraction(nearest) == v for v in values):
            table = np.array([float(v) for v in values])
        else:
            table = np.array(values, dtype=object)
        self.table = table if codes is None else table[codes]

    def take(self, index: np.ndarray) -> Weights:
        """Return the weights at ``index``, in that order."""
        new = copy(self)
        new.table = self.table[index]
        return new

    def as_float(self) -> np.ndarray:
        """Return the weights rounded to float64."""
        if self.table.dtype == np.int64:
            # One rounding only: int64 / scale in float64 would round the numerator first.
            if self.scale == 1 or (int(np.abs(self.table).max(initial=0)) < 2**53 and self.scale < 2**53):
                return self.table / float(self.scale)
            return np.array([float(Fraction(v, self.scale)) for v in self.table.tolist()])
        return np.array([nearest_float(v) for v in self.table]) if self.table.dtype == object else self.table

    def fraction(self, i: int) -> Fraction:
        """Return weight ``i`` exactly."""
        value = self.table.item(i)
        return Fraction(value, self.scale) if isinstance(value, int) else Fraction(value)

    def texts(self) -> list[str]:
        """Return the weights as exact texts."""
        if self.table.dtype == object:
            return [format_exact(self.fraction(i)) for i in range(self.table.size)]
        _, first, which = np.unique(self.table, return_index=True, return_inverse=True)
        texts = [format_exact(self.fraction(int(i))) for i in first]
        return [texts[k] for k in which.tolist()]

    def signs(self) -> np.ndarray:
        """Return +1 or -1 for each weight."""
        return np.where(self.table > 0, 1, -1).astype(np.int8)


def _common_scale(values: Sequence[Fraction]) -> int | None:
    """Return the common denominator of rationals that are int64 numerators over it; None if they are not."""
    scale = 1
    for value in values:
        scale = math.lcm(scale, value.denominator)
        if scale > _INT64_LIMIT:
            return None
    return scale if all(abs(v * scale) <= _INT64_LIMIT for v in values) else None
