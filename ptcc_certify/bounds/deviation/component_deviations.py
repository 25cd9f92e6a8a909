"""The deviations and inputs of a component of a family, for every signal, by all that is proved of it; in floats.

References
----------
docs/theory/families.md, "Inputs".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.deviation.heard import HeardRows
from ptcc_certify.bounds.deviation.of_family import Function, RestStates, above, deviation_on_clock, input_on_clock
from ptcc_certify.checker.reading import Interval


@dataclass(frozen=True, eq=False)
class FunctionOf:
    """A function of some agents of a component that hear nobody else, and their common states at rest."""

    agents: np.ndarray
    function: Function
    rest: RestStates | None


@dataclass(frozen=True, eq=False)
class UndrivenPart:
    """A component in which no sliding variable moves.

    Attributes
    ----------
    functions : sequence of FunctionOf
    x : sequence of N Fraction
        The initial state.
    rows : HeardRows, or None
        Followed if ``ends`` are known and a function decays.
    ends : sequence of N intervals, or None
        Where every agent ends.
    """

    functions: Sequence[FunctionOf]
    x: Sequence[Fraction]
    rows: HeardRows | None = None
    ends: Sequence[Interval] | None = None

    def deviation(self, clock: np.ndarray) -> np.ndarray:
        """Bound ``|x_k(t) - x_k(T)|`` at instants of the clock, (N, M): 0 where all begin where they end, at rest."""
        if self.ends is not None and all(x == low == high for x, (low, high) in zip(self.x, self.ends, strict=True)):
            return np.zeros((len(self.x), clock.size))
        bounds, finite = self._by_functions(clock), np.isfinite(clock)
        rate = max((float(one.function.rate) for one in self.functions), default=0.0)
        if self.rows is not None and self.ends is not None and rate > 0 and finite.any():
            start = np.array([above(max(abs(x - e) for e in ends)) for x, ends in zip(self.x, self.ends, strict=True)])
            followed = self.rows.follow(start, self._by_functions, clock[finite], rate)
            bounds[:, finite] = np.fmin(bounds[:, finite], followed)
        return bounds

    def input(self, clock: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Bound ``gain |(L x)_k|``, (N, M)."""
        bounds = np.full((len(self.x), clock.size), np.inf)
        for one in self.functions:
            own = input_on_clock(one.function, self._state(one), clock, gain)
            bounds[one.agents] = np.minimum(bounds[one.agents], own)
        if self.rows is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                heard = self.rows.speeds(self.deviation(clock)) * gain
            bounds = np.where(np.isfinite(clock), np.fmin(bounds, heard), bounds)
        return bounds

    def _state(self, one: FunctionOf) -> list[Fraction]:
        return [self.x[v] for v in one.agents.tolist()]

    def _by_functions(self, clock: np.ndarray) -> np.ndarray:
        bounds = np.full((len(self.x), clock.size), np.inf)
        for one in self.functions:
            own = deviation_on_clock(one.function, one.rest, self._state(one), clock)
            if own is not None:
                bounds[one.agents] = np.minimum(bounds[one.agents], own)
        return bounds
