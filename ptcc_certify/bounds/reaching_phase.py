"""The time in which sliding variables move: its instants in floats, and what drives a norm that decays otherwise.

With ``psi = e^(-mu2 t) ((T_r - t)/T_r)^(mu3 kappa)``, which bounds ``|sigma_k| / |sigma_k(0)|``, and a rate
``2 alpha``,

    v(t)  <=  e^(-alpha s(t)) v(0) + c int_0^min(t,T_r) e^(-alpha (s(t) - s(r))) gain(r) psi(r) dr

``psi`` decreases, so that its value at the begin of a piece is the largest.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ptcc_certify.bounds.envelope import Instants, remaining_part
from ptcc_certify.model.base import ReachingProtocol
from ptcc_certify.model.reaching_time import LAST_Z, ReachingTime

_PIECES = 4000
#: What sums of so many floats may be off by, relatively.
_SLACK = 1 + 1e-11


@dataclass(frozen=True)
class ReachingPhase:
    """Instants of the reaching phase, in ``z = ln(T_r/(T_r - t))`` and on the stretched clock.

    Attributes
    ----------
    protocol : ReachingProtocol
    reaching : tuple of ReachingTime
        Proved reaching times.
    """

    protocol: ReachingProtocol
    reaching: tuple[ReachingTime, ...]

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
    def _knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The clock where the pieces begin, and at ``T_r``; ``psi`` there; ``int gain psi dt`` from there on."""
        clock = self.protocol.clock_while_reaching(np.append(self.pieces, np.inf))
        share = np.append(self.share(self.pieces), 0.0)
        if self._quiet <= LAST_Z:  # the last piece begins when all are 0
            share[-2] = 0.0
        later = np.append(np.cumsum((share[:-1] * np.diff(clock))[::-1])[::-1], 0.0) * _SLACK
        return clock, share, later

    def rest(self, at: Instants) -> np.ndarray:
        """Return ``int gain psi`` from the instants on, from above."""
        clock, share, later = self._knots
        place, s = self._place(at), np.minimum(at.clock, clock[-1])
        beyond = np.append(clock[1:], clock[-1])[place]
        return share[place] * np.maximum(beyond - s, 0.0) * _SLACK + np.append(later[1:], 0.0)[place]

    def driven(self, half: float, root: float, c: float, at: Instants) -> np.ndarray:
        """Bound ``v`` at the instants from ``v(0) = root``; ``half`` is half the rate."""
        clock, share, _ = self._knots
        decay, step = np.exp(-half * np.diff(clock)), -np.expm1(-half * np.diff(clock)) / half
        v = np.empty(clock.size)
        v[0] = root
        for i in range(clock.size - 1):
            v[i + 1] = decay[i] * v[i] + c * share[i] * step[i]
        place = self._place(at)
        passed = np.maximum(at.clock - clock[place], 0.0)
        return (v[place] * np.exp(-half * passed) - c * share[place] * np.expm1(-half * passed) / half) * _SLACK

    def _place(self, at: Instants) -> np.ndarray:
        """Return in which pieces instants lie; the last begins at ``T_r``."""
        clock, _, _ = self._knots
        return np.clip(np.searchsorted(clock, at.clock, side="right") - 1, 0, clock.size - 1)
