"""The array twin of bounds from instant to instant: the same integers by NumPy, for graphs of many edges.

Products of fixed-point numbers are below ``2^62``: weights of one row sum to ``2^30`` and a unit for each, entries are
at most ``2^30``; long factors are split in two. Nothing is rounded in any other way than by
:class:`~ptcc_certify.checker.stepwise_bounds.Steps`, with which tests compare it.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ptcc_certify.checker.stepwise_bounds import FIXED, ONE, Step, Steps

#: From ``2^FARTHEST`` units on a decay is rounded up to one unit; half of the bits of a share and of a fixed-point one.
FARTHEST, HALF_SHARE, HALF = 39, 20, 15


class ArraySteps(Steps):
    """:class:`Steps` by NumPy."""

    def _heard(self, told: Mapping[int, Sequence[int]]) -> Any:
        weights, sources = np.asarray(self.weights), np.asarray(self.sources)
        if len(told) == 1:
            (y,) = told.values()
            products = weights * np.asarray(y)[sources]
        else:
            products = np.empty(len(weights), np.int64)
            for part, where in self._edges_of_age.items():
                products[where] = weights[where] * np.asarray(told[part])[sources[where]]
        # modulo 2^64, which sums of rows never reach
        before = np.concatenate([[np.uint64(0)], np.cumsum(products.view(np.uint64))])[np.asarray(self.offsets)]
        return -(-np.diff(before).view(np.int64) >> FIXED) + self.error

    def _pushed(self, heard: Any, share: int) -> Any:
        return heard - (-np.asarray(self.lags) * share >> FIXED)

    def larger(self, peaks: Sequence[int], step: Step, share: int) -> Sequence[int]:
        """Return the larger ones; a share is at most ``2^30``, what two lists add up to below ``2^32``."""
        moved: Any = np.asarray(step.begin) + step.heard
        return np.maximum(peaks, -(-moved * share >> FIXED)).tolist()  # type: ignore[no-any-return]

    def _step(self, y: Sequence[int], heard: Any, way: tuple[int, int] | None) -> Sequence[int]:
        states = np.asarray(y)
        if way is None:
            return array("q", np.minimum(states, heard).tobytes())
        share, (b, shift) = np.asarray(self.shares), way
        high, low = share >> HALF_SHARE, share & ((1 << HALF_SHARE) - 1)
        x = (high * b + (low * b >> HALF_SHARE)) >> min(shift - HALF_SHARE, 62)
        decay = self._decay(x)
        rest = heard + -(-np.maximum(states - heard, 0) * decay >> FIXED)
        return array("q", np.minimum(states, rest).tobytes())

    @cached_property
    def _edges_of_age(self) -> dict[int, Any]:
        """The edges of every age."""
        parts = np.asarray(self.parts)
        return {part: np.flatnonzero(parts == part) for part in sorted(set(self.parts))}

    @staticmethod
    def _decay(x: Any) -> Any:
        # below the farthest argument the sums are less than 2^54 before the last product, and that less than 2^63
        total, near = np.full(len(x), ONE), np.minimum(x, (1 << FARTHEST) - 1)
        high, low = near >> HALF, near & ((1 << HALF) - 1)
        for n in (4, 3, 2, 1):
            rest = total & (ONE - 1)
            product = near * (total >> FIXED) + ((high * rest + (low * rest >> HALF)) >> HALF)
            total = ONE + product // n
        return -(-(ONE * ONE) // total)
