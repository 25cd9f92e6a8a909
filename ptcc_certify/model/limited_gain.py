"""The gain that acts under limits: saturation, switch-off before the deadline, zero-order hold.

With ``k = rho2 kappa``, a cap ``g_max > rho1 + k/T`` acts from ``t_c = T - k/(g_max - rho1)`` on, and the integral of
the gain that acts is

    s_eff(T) = rho1 T + k (1 + ln(T (g_max - rho1)/k))

A smaller cap acts from 0 on. Here everything is in floats; what proofs need of the same limits is enclosed by
:class:`ptcc_certify.checker.input_formulas.Limits`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain
from ptcc_certify.model.parameters import readable

MAX_PERIODS = 10**6
# 1 - t/T below which nothing can act any more.
_SMALLEST_SHARE = Fraction(1, 10**300)


class Stretch(NamedTuple):
    """Where ``end < 1 - t/T <= begin``, the gain that acts is constant; None for that of the protocol, with its pole.

    An ``end`` of -1 is never reached.
    """

    begin: float
    end: float
    level: float | None


class Periods(NamedTuple):
    """Sampling periods, (P,) each: where they start, how long they last, the gain they hold, and its integral."""

    starts: np.ndarray
    durations: np.ndarray
    gains: np.ndarray
    steps: np.ndarray

    def value(self, t: np.ndarray) -> np.ndarray:
        """Return the gain that is held at instants."""
        return self.gains[self.locate(t)[0]]

    def clock(self, t: np.ndarray) -> np.ndarray:
        """Return the integral of the gain until instants."""
        index, share = self.locate(t)
        return np.append(0.0, self.steps.cumsum())[index] + self.steps[index] * share

    def locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the periods that instants fall into, and which share of them is over."""
        index = np.searchsorted(self.starts, t, side="right") - 1
        return index, np.clip((t - self.starts[index]) / self.durations[index], 0, 1)


@dataclass(frozen=True)
class LimitedGain:
    """The gain that acts under limits, and its clock.

    Examples
    --------
    >>> limited = LimitedGain(Gain(T=1, rho1=1, rho2=1, kappa=1), GainLimits(gain_cap=11))
    >>> limited.clock([0, 0.9, 1, 2]).round(6)
    array([0.      , 3.202585, 4.302585, 5.302585])
    """

    gain: Gain
    limits: Limits

    def __post_init__(self) -> None:
        stop, T = self.limits.stop_before, self.gain.T
        if stop is not None and stop >= T:
            raise ParameterError(
                "stop_before", f"= {readable(stop)} is outside its domain; stop_before must be below T = {readable(T)}"
            )
        for name, share in (("gain_cap", self._capped_share), ("stop_before", self._stopped_share)):
            if 0 < share < _SMALLEST_SHARE:
                raise ParameterError(name, "acts only where 1 - t/T is below 1e-300; leave it out")

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The course of the gain if it is not held over periods."""
        gain, capped, stopped = self.gain, float(self._capped_share), float(self._stopped_share)
        stretches, begin = [], 1.0
        if gain.rho2 and capped < 1:
            begin = max(capped, stopped)
            stretches.append(Stretch(1.0, begin, None))
        if begin > stopped:
            stretches.append(Stretch(begin, stopped, self._cap if gain.rho2 else self._late))
        stretches.append(Stretch(stopped, -1.0, 0.0 if stopped else self._late))
        return tuple(stretches)

    @property
    def bounded(self) -> bool:
        """Whether the gain that acts stays finite towards ``T``."""
        return self.stretches[0].end != 0 or self.stretches[0].level is not None

    def value(self, t: ArrayLike, remaining: ArrayLike | None = None) -> np.ndarray:
        """Return the gain that acts at ``t >= 0``; floats of the shape of ``t``.

        Parameters
        ----------
        t : array_like
        remaining : array_like, optional
            ``max(0, 1 - t/T)`` where it is known more accurately than from ``t``.

        Raises
        ------
        ParameterError
            There are more than 1,000,000 sampling periods until then.
        """
        t, q = self._instants(t, remaining)
        if self.limits.sample_period is not None:
            return self.periods(float(t.max())).value(t)
        free = self.gain.value_at_remaining(q)
        masks = [(q <= stretch.begin) & (q > stretch.end) for stretch in self.stretches]
        return np.select(masks, [free if stretch.level is None else stretch.level for stretch in self.stretches])

    def clock(self, t: ArrayLike, remaining: ArrayLike | None = None) -> np.ndarray:
        """Return ``s_eff(t)``, the integral of the gain that acts; infinite from a pole on.

        Parameters and errors are those of :meth:`value`.
        """
        t, q = self._instants(t, remaining)
        if self.limits.sample_period is not None:
            return self.periods(float(t.max())).clock(t)
        clock = np.zeros(t.shape)
        for stretch in self.stretches:
            elapsed = self.elapsed(stretch, t, q)
            if stretch.level is None:
                clock += float(self.gain.rho1) * elapsed + float(self.gain.pole) * self.tau(stretch, t, q)
            else:
                clock += stretch.level * elapsed
        return clock

    def elapsed(self, stretch: Stretch, t: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the time spent in a stretch until instants ``t``, where ``1 - t/T = q``."""
        T, end = float(self.gain.T), max(stretch.end, 0.0)
        rest = np.clip(q, end, stretch.begin)
        early = np.minimum(t, T * (1 - end)) - T * (1 - stretch.begin)
        # Whichever of 1 - t/T and t is the small one holds the digits.
        before = np.where(rest > 0.5, np.maximum(early, 0), T * (stretch.begin - rest))
        return before + (np.maximum(t - T, 0) if stretch.end < 0 else 0)

    def tau(self, stretch: Stretch, t: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return ``-ln(1 - t/T)``, not beyond the end of the first stretch; infinite at the pole."""
        rest = np.maximum(q, stretch.end)
        early = np.minimum(self.elapsed(stretch, t, q) / float(self.gain.T), 0.5)
        with np.errstate(divide="ignore"):
            return np.where(rest > 0.5, -np.log1p(-early), -np.log(rest))

    def periods(self, until: float) -> Periods:
        """Return the sampling periods that start in [0, until], and the next one.

        An instant that a float cannot tell from the start of a period counts as it.

        Raises
        ------
        ParameterError
            There are more than 1,000,000.
        """
        period, gain = self.limits.sample_period, self.gain
        assert period is not None
        if Fraction(until) > MAX_PERIODS * period:
            raise ParameterError(
                "sample_period",
                f"= {readable(period)} gives more than {MAX_PERIODS:,} periods until t = {until:.6g}; "
                "take a longer period or end earlier",
            )
        stop = gain.T - (self.limits.stop_before or 0)
        unit = math.lcm(period.denominator, gain.T.denominator, stop.denominator)
        h, T, end = (int(value * unit) for value in (period, gain.T, stop))
        last = (int(Fraction(math.nextafter(until, math.inf)) * unit) // h + 2) * h
        ticks = sorted({*range(0, last + 1, h), *(cut for cut in (T, end) if cut < last)})
        if self.limits.stop_before is not None:
            ticks = [tick for tick in ticks if tick <= end or tick == last]
        starts, durations = (
            np.array([n / unit for n in ns]) for ns in (ticks[:-1], [b - a for a, b in pairwise(ticks)])
        )
        rest = np.array([max(T - tick, 0) / unit for tick in ticks[:-1]])
        share = np.array([(b - a) / (T - a) if a < T else 0.0 for a, b in pairwise(ticks)])
        with np.errstate(divide="ignore", over="ignore"):
            gains = np.minimum(float(gain.rho1) + np.where(rest > 0, float(gain.pole) / rest, 0.0), self._cap)
        # A period may start so close to T that the gain overflows; its integral does not.
        steps = np.minimum(float(gain.rho1) * durations + float(gain.pole) * share, self._cap * durations)
        running = np.array([tick < end or self.limits.stop_before is None for tick in ticks[:-1]])
        return Periods(starts, durations, gains * running, steps * running)

    @property
    def _cap(self) -> float:
        return math.inf if self.limits.gain_cap is None else float(self.limits.gain_cap)

    @property
    def _late(self) -> float:
        """The gain from ``T`` on, and at any time if there is no pole."""
        return min(float(self.gain.rho1), self._cap)

    @property
    def _capped_share(self) -> Fraction:
        """``1 - t/T`` where the cap begins to act; 0 if it never does."""
        cap, gain = self.limits.gain_cap, self.gain
        if cap is None or not gain.rho2:
            return Fraction(0)
        return Fraction(1) if cap <= gain.first else gain.pole / (gain.T * (cap - gain.rho1))

    @property
    def _stopped_share(self) -> Fraction:
        """``1 - t/T`` where the input is switched off; 0 if it never is."""
        return (self.limits.stop_before or Fraction(0)) / self.gain.T

    def _instants(self, t: ArrayLike, remaining: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        """Return ``t`` and ``1 - t/T`` as arrays."""
        t = np.asarray(t, dtype=float)
        if remaining is not None:
            return t, np.asarray(remaining, dtype=float)
        q, stopped = np.maximum(1 - t / float(self.gain.T), 0), self._stopped_share
        late = t >= float(self.gain.T * (1 - stopped)) if stopped else False
        return t, np.where(late, np.minimum(q, float(stopped)), q)
