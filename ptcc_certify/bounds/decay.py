"""A decay over time: the one scalar that every bound over time is a multiple of.

With ``push`` what drives it per unit of the clock ``s``, which is 0 but in a reaching phase,

    y(t) = e^(-rate s(t)/2) first + int_0^t e^(-rate (s(t) - s(r))/2) push(r) ds(r)

bounds ``sqrt(V)``: then norms, deviations and speeds of agents are at most constants times ``y``.

The time in which sliding variables move: its instants in floats, and what drives a norm that decays otherwise.

With ``psi = e^(-mu2 t) ((T_r - t)/T_r)^(mu3 kappa)``, which bounds ``|sigma_k| / |sigma_k(0)|``, and a rate
``2 alpha``,

    v(t)  <=  e^(-alpha s(t)) v(0) + int_0^min(t,T_r) e^(-alpha (s(t) - s(r))) gain(r) push(r) dr

where ``push`` is ``c psi`` for families, and a norm of bounds of all ``|sigma_k|`` for one graph. It decreases, so that
its value at the begin of a piece is the largest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np

from ptcc_certify.bounds.instants import Instants, clock_values, remaining_part
from ptcc_certify.model.base import ReachingProtocol
from ptcc_certify.model.reaching_time import LAST_Z, ReachingTime, sliding_bound

_PIECES = 4000
#: What sums of so many floats may be off by, relatively.
_SLACK = 1 + 1e-11
#: Arrays of instants at which sliding variables are kept.
_KEPT = 8


@dataclass(frozen=True)
class ReachingPhase:
    """Instants of the reaching phase, in ``z = ln(T_r/(T_r - t))`` and on the stretched clock.

    Attributes
    ----------
    protocol : ReachingProtocol
    reaching : tuple of ReachingTime
        Proved reaching times, one for each agent.
    sigma0 : tuple of Fraction
        ``sigma(0)``, N numbers.
    """

    protocol: ReachingProtocol
    reaching: tuple[ReachingTime, ...]
    sigma0: tuple[Fraction, ...]

    def instants(self, remaining: Any) -> Instants:
        """Return ``s`` and ``z`` where ``1 - t/(T_r + T_s)`` is ``remaining``, or refuse it."""
        q = remaining_part(remaining)
        T_r, T_s = float(self.protocol.T_r), float(self.protocol.T_s)
        T = float(self.protocol.T)
        with np.errstate(divide="ignore"):
            z = -np.log(np.maximum((q - T_s / T) * (T / T_r), 0.0))
            return Instants(np.asarray(self.protocol.gain.clock_at_remaining(q)), z)

    @cached_property
    def pieces(self) -> np.ndarray:
        """Instants ``z`` at which the pieces begin, until all sliding variables are certainly 0."""
        certain = [LAST_Z if r.z is None else float(min(r.z, Fraction(LAST_Z))) for r in self.reaching]
        fine = np.concatenate([[0.0], np.geomspace(1e-9, 1, 2000) * max(certain)])
        levels = self.protocol.reaching_gain.clock_at_tau(fine)
        return np.interp(np.linspace(0, levels[-1], _PIECES), levels, fine)

    @cached_property
    def _quiet(self) -> float:
        """``z`` from which on all are 0."""
        return max(np.inf if r.z is None else float(r.z) for r in self.reaching)

    def share(self, z: np.ndarray) -> np.ndarray:
        """Return ``psi`` at instants ``z``, 0 from the last proved reaching time on."""
        return np.where(z < self._quiet, np.exp(-self.protocol.reaching_gain.clock_at_tau(z)) * _SLACK, 0.0)

    def share_at(self, at: Instants) -> np.ndarray:
        """Return ``psi`` at instants, 0 where it is not before ``T_r``."""
        return np.where(np.isfinite(at.z), self.share(at.z), 0.0)

    @cached_property
    def _clock(self) -> np.ndarray:
        """The clock where the pieces begin, and at ``T_r``."""
        return self.protocol.clock_while_reaching(np.append(self.pieces, np.inf))

    @cached_property
    def shares(self) -> np.ndarray:
        """``psi`` where the pieces begin, and 0 at ``T_r``."""
        share = np.append(self.share(self.pieces), 0.0)
        if self._quiet <= LAST_Z:  # the last piece begins when all are 0
            share[-2] = 0.0
        return share

    def sizes(self, z: np.ndarray) -> np.ndarray:
        """Return the (N, M) bounds of ``|sigma_k|`` at instants ``z``, 0 from ``T_r`` on."""
        key = z.shape, z.tobytes()
        if key not in self._sizes:
            if len(self._sizes) >= _KEPT:
                self._sizes.clear()
            moving = np.isfinite(z)
            instants, same = np.unique(z[moving], return_inverse=True)
            result = np.zeros((len(self.sigma0), *z.shape))
            result[:, moving] = sliding_bound(self.protocol, self.sigma0, instants, self.reaching)[:, same]
            self._sizes[key] = result
        return self._sizes[key]

    @cached_property
    def _sizes(self) -> dict[tuple[tuple[int, ...], bytes], np.ndarray]:
        return {}

    def norm(self, z: np.ndarray) -> np.ndarray:
        """Return Proposition 1's bound of ``||sigma||``, ``e^(-clock) ||sigma(0)||``, at instants ``z``."""
        decay = np.exp(-self.protocol.reaching_gain.clock_at_tau(clock_values(z, "z")))
        return np.asarray(math.hypot(*(float(x) for x in self.sigma0)) * decay)

    def rest(self, at: Instants) -> np.ndarray:
        """Return ``int gain psi`` from the instants on, from above."""
        share = self.shares
        later = np.append(np.cumsum((share[:-1] * np.diff(self._clock))[::-1])[::-1], 0.0) * _SLACK
        place, clock = self._place(at)
        beyond = np.append(self._clock[1:], self._clock[-1])[place]
        return share[place] * np.maximum(beyond - clock, 0.0) * _SLACK + np.append(later[1:], 0.0)[place]

    def driven(self, half: float, first: float, push: np.ndarray, at: Instants) -> np.ndarray:
        """Bound ``v`` at the instants from ``v(0) = first``; ``half`` is half the rate.

        ``push`` is that where each piece begins, and 0 at ``T_r``.
        """
        step = half * np.diff(self._clock)
        pieces = zip(np.exp(-step).tolist(), (push[:-1] * (-np.expm1(-step) / half)).tolist(), strict=True)
        v = np.array(list(accumulate(pieces, lambda v, piece: piece[0] * v + piece[1], initial=first)))
        place, clock = self._place(at)
        passed = half * np.maximum(clock - self._clock[place], 0.0)
        return (v[place] * np.exp(-passed) - push[place] * np.expm1(-passed) / half) * _SLACK

    def _place(self, at: Instants) -> tuple[np.ndarray, np.ndarray]:
        """Return in which pieces instants lie, the last of which begins at ``T_r``, and the clock there."""
        moving = np.isfinite(at.z)
        place = np.where(moving, np.searchsorted(self.pieces, at.z, side="right") - 1, self.pieces.size)
        return place, np.where(moving, self.protocol.clock_while_reaching(at.z), at.clock)


@dataclass(frozen=True, eq=False)
class Decay:
    """``y`` of the module.

    Attributes
    ----------
    rate : float
        From below; positive where something drives it.
    first : float
        ``y(0)``, from above.
    phase : ReachingPhase or None
        The time in which something drives it.
    push : array or None
        From above what drives it in every piece of that time, see :meth:`ReachingPhase.driven`.

    Examples
    --------
    >>> decay = Decay(2.0, 3.0)
    >>> decay.times([1.0, 2.0], Instants(np.array([0.0, np.inf]))).round(9).tolist()
    [[3.0, 0.0], [6.0, 0.0]]
    """

    rate: float
    first: float
    phase: ReachingPhase | None = None
    push: np.ndarray | None = None

    def times(self, constants: np.ndarray | list[float] | float, at: Instants) -> np.ndarray:
        """Return the constants times ``y`` at M instants, (.., M), rounded up; infinite beyond the range of floats."""
        with np.errstate(over="ignore", invalid="ignore"):
            if self.phase is None or self.push is None:
                # 0 times infinity is 0
                return decayed(np.nan_to_num(np.multiply(constants, self.first), posinf=np.inf), self.rate, at.clock)
            y = self.phase.driven(self.rate / 2, self.first, self.push, at)
            return np.nan_to_num(np.multiply.outer(constants, y * (1 + 1e-12)), posinf=np.inf)


def decayed(size: np.ndarray | float, rate: float, clock: np.ndarray) -> np.ndarray:
    """Return ``size e^(-rate s / 2)`` for every size and every clock value, rounded up; formed in logarithms.

    At the deadline, where the clock is infinite, 0 if the rate is positive or the size is 0.
    """
    with np.errstate(all="ignore"):
        exponent = np.add.outer(np.log(size), -rate * clock / 2 if rate else np.zeros_like(clock))
        value = np.exp(exponent) * (1 + 1e-12)
    value = np.where((value == 0) & (exponent > -np.inf), 5e-324, value)
    return np.where(np.isnan(value), 0.0, value)
