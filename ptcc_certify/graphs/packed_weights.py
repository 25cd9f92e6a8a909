"""Exact weights of edges, in as few bytes as hold them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from fractions import Fraction

import numpy as np

from ptcc_certify.graphs.array_holders import ReadOnly
from ptcc_certify.graphs.rationals import format_exact, nearest_float

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
