"""What limits of the gain leave at the deadline, and what noise and disturbances add under the nominal protocol."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.input.effort import Disturbed, Limited, Noise, Peak
from ptcc_certify.bounds.input.tightest_bound import BOUND_BITS, decaying, least, log, round_up
from ptcc_certify.checker.input_formulas import LAST_PERIODS, InputBounds, Limits, root_above, rounded
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.gain import Gain

#: Periods below this share of ``T`` are not searched; how often the interval of the longest one is halved, and which
#: shares of it are proved, one after the other, until one is.
SHORTEST_SHARE, PERIOD_STEPS, PERIOD_SHARES = 1e-12, 12, (0.999, 0.99, 0.9, 0.5)


@dataclass(frozen=True)
class LimitedBounds:
    """Bounds of what is left at the deadline, from some Lyapunov functions.

    Attributes
    ----------
    bounds : InputBounds
    functions : sequence of int
        The Lyapunov functions that serve.
    deviations : sequence
        Of every one, the constants from ``V`` to the deviations of agents to their final states, or None.
    cap : Fraction or None
        No agent is farther from its final state than this, the largest deviation at first, but under a zero-order
        hold.
    peak : Peak or None
        Of the input without limits.
    noise : Fraction or None
        Bound of the measurement noise.
    """

    bounds: InputBounds
    functions: Sequence[int]
    deviations: Sequence[Sequence[Fraction] | None]
    cap: Fraction | None
    peak: Peak | None
    noise: Fraction | None

    @cached_property
    def first(self) -> Fraction:
        """A bound of ``||E(0)||``, exact but for rounding for a single initial state."""
        bounds = self.bounds
        return root_above(sum((bounds.initial_set.largest(row) ** 2 for row in bounds.rows), Fraction(0)))

    def bound_residual(self, limits: Limits) -> Limited | None:
        """Bound what is left at the deadline under limits of the gain; None if nothing is certified.

        With sampling, which may drive the agents apart, that is certified which leaves ``||E||`` no larger than at
        first.
        """
        top, clock = self._of(limits)
        each = [partial(self._bound_by, k, limits, clock, top) for k in self.functions]
        best = least(each, lambda entry: entry.norm)
        if best is not None and limits.sample_period is None:
            best = replace(best, agents=self._least_deviations(limits, clock))
        if best is None or self.noise is None or limits.sample_period is not None:
            return best
        noise = least((partial(self._noise, k, best, top) for k in self.functions), lambda noise: noise.largest)
        return replace(best, noise=noise)

    def _of(self, limits: Limits) -> tuple[Fraction, Fraction]:
        """Return the largest gain, and the clock that is left, short of what other roundings find."""
        gain = self.bounds.gain
        return limits.largest_gain(gain), rounded(limits.clock_below(gain), BOUND_BITS)

    def _bound_by(self, k: int, limits: Limits, clock: Fraction, top: Fraction) -> Limited | None:
        """Return what one Lyapunov function proves."""
        bounds, hold = self.bounds, limits.sample_period is not None
        growth = step_growth(bounds, k) if hold else Fraction(0)
        if growth is None:
            return None
        residual = bounds.share(k, limits, clock, growth) * bounds.initial_root(k)
        norm = round_up(bounds.root_constant(k, None) * residual)
        if hold and norm > self.first:
            return None
        constants = self.deviations[k] if hold and k < len(self.deviations) else None
        agents = None if constants is None else tuple(round_up(root_above(c) * residual) for c in constants)
        peak = [] if self.peak is None else [self.peak.largest]
        largest = None if hold else round_up(min([top * max(bounds.error_bounds), *peak]))
        return Limited(limits, clock, k, growth, norm, agents, largest)

    def _least_deviations(self, limits: Limits, clock: Fraction) -> tuple[Fraction, ...] | None:
        """Return what is left of every agent without a zero-order hold, each by the function that leaves least."""
        found = [[] if self.cap is None else [self.cap] * len(self.bounds.rows)]
        for k, constants in enumerate(self.deviations):
            if constants is not None and k in self.functions:
                residual = self.bounds.share(k, limits, clock, Fraction(0)) * self.bounds.initial_root(k)
                found.append([root_above(c) * residual for c in constants])
        return tuple(map(round_up, map(min, zip(*filter(None, found), strict=True)))) if found[1:] else None

    def _noise(self, k: int, entry: Limited, top: Fraction) -> Noise:
        """Return the bounds under measurement noise by one Lyapunov function."""
        noise = self.noise or Fraction(0)
        whole, each = self.bounds.noisy(k, noise)
        norm, most = round_up(entry.norm + whole), round_up((entry.largest or 0) + top * max(each))
        return Noise(noise, k, norm, most)

    def longest_period(
        self, limits: Sequence[Limits], results: Sequence[Limited | None], gain: Gain
    ) -> Fraction | None:
        """Return a period of four digits with which all is certified that is not, near to the longest; None if none."""
        failures = [entry for entry, result in zip(limits, results, strict=True) if result is None]
        if not failures or any(entry.sample_period is None for entry in failures) or not self.first:
            return None
        growths = {k: m for k in self.functions if (m := step_growth(self.bounds, k)) is not None}
        periods = [self._longest_period(entry, gain, growths) for entry in failures]
        return None if None in periods else min(period for period in periods if period is not None)

    def _longest_period(self, limits: Limits, gain: Gain, growths: dict[int, Fraction]) -> Fraction | None:
        T, bounds = nearest_float(gain.T), self.bounds
        sizes = {k: log(decaying(bounds, k, None)) - log(self.first) for k in growths}

        def excesses(period: float) -> dict[int, float]:
            return {k: sizes[k] + _log_share(gain, limits, period, bounds.form(k).rate, m) for k, m in growths.items()}

        def excess(period: float) -> float:
            return min(excesses(period).values(), default=math.inf)

        def proved(period: Fraction) -> bool:
            held, by_size = replace(limits, sample_period=period), excesses(nearest_float(period))
            top, clock = self._of(held)
            for k in sorted(growths, key=by_size.__getitem__):
                with suppress(ValueError, ArithmeticError):
                    if self._bound_by(k, held, clock, top) is not None:
                        return True
            return False

        high = nearest_float(limits.sample_period or gain.T)
        low = high / 2
        while low >= SHORTEST_SHARE * T and excess(low) > 0:
            high, low = low, low / 2
        if low < SHORTEST_SHARE * T:
            return None
        for _ in range(PERIOD_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if excess(middle) <= 0 else (low, middle)
        periods = (Fraction(f"{low * share:.3e}") for share in PERIOD_SHARES)
        return next(filter(proved, periods), None)


def _log_share(gain: Gain, limits: Limits, period: float, rate: Fraction, growth: Fraction) -> float:
    """Return the logarithm of the bound of ``sqrt(V)`` over ``sqrt(V(0))`` under a zero-order hold, in floats."""
    limited = GainLimits(limits.gain_cap, limits.stop_before).limit(gain)
    b, m, end = map(nearest_float, (rate, growth, gain.T - (limits.stop_before or 0)))
    count = math.ceil(end / period * (1 - 1e-12))
    first = max(count - LAST_PERIODS, 0)
    # Before the last periods the gain changes little from one to the next: they are counted by the thousand.
    edges = np.unique(np.append(np.geomspace(1, first + 1, 1000).astype(np.int64), 1)) - 1 if first else np.array([0])
    begins = np.append(first - edges[::-1], np.arange(first + 1, count))
    times = np.diff(begins, append=count)
    at = begins * period
    eta = limited.value(at) * np.minimum(period, end - at)
    with np.errstate(all="ignore"):
        return float(np.sum(times * np.log(np.maximum(1 - eta * b + eta**2 * m, 1e-300))) / 2)


def step_growth(bounds: InputBounds, k: int) -> Fraction | None:
    """Return ``m`` with ``L'P L <= m P``, in floating point and raised a little; the check proves it."""
    form = bounds.form(k)
    if form.coordinates != "E":
        return None
    A = np.array([[float(bounds.rows[v].get(w, 0)) for w in form.nodes] for v in form.nodes])
    P, scale = form.entries
    try:
        with np.errstate(all="ignore"):
            R = np.linalg.cholesky(np.array([[x / scale for x in row] for row in P])).T
            size = float(np.linalg.norm(R @ A @ np.linalg.inv(R), 2))
    except (ValueError, ArithmeticError):
        return None
    return round_up(Fraction(size) ** 2 * (1 + Fraction(1, 10**9))) if math.isfinite(size) else None


def bound_disturbed(
    bounds: InputBounds, functions: Sequence[int], delta: Fraction, influence: Influence | None
) -> Disturbed | None:
    """Bound what disturbances add under the nominal protocol."""
    drift = None
    if influence is not None and influence.exact:
        rows = (influence.row(v).values() for v in range(len(bounds.rows)))
        drift = tuple(round_up(delta * bounds.gain.T * sum(abs(Fraction(x)) for x in row)) for row in rows)

    def by(k: int) -> Disturbed:
        return Disturbed(delta, k, tuple(map(round_up, bounds.disturbed(k, delta))), drift)

    return least((partial(by, k) for k in functions), lambda entry: max(entry.inputs))
