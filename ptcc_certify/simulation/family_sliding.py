"""Runs of a family of graphs under the sliding-mode protocol: the Filippov solution, led by a signal.

Sliding variables know no graph: each is found first, as the solution of its own scalar equation. With ``y = x - sigma``
it is ``dy/ds = -L(s) (y + sigma)`` on the stretched clock; on every stretch ``sigma`` is replaced by a polynomial that
tells it to the tolerance of the integrator.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.protocols.base import ReachingProtocol
from ptcc_certify.protocols.disturbance import Disturbance, StateDependent, WorstCaseDisturbance, as_disturbance
from ptcc_certify.protocols.reaching_time import ReachingProblem
from ptcc_certify.simulation.cvodes import Phase, Tolerances
from ptcc_certify.simulation.family_members import Members
from ptcc_certify.simulation.family_motion import FamilyMotion
from ptcc_certify.simulation.filippov import rounding_slack
from ptcc_certify.simulation.instants import Instants

if TYPE_CHECKING:
    import casadi as ca

# Nodes of the polynomials, and how near these must come, of the tolerance of the integrator.
_NODES, _SHARE = 12, 0.1
_NEWTON = 60


@dataclass(frozen=True, eq=False)
class SlidingRun:
    """Sliding variables of one run under a disturbance that does not read the states.

    Attributes
    ----------
    protocol : ReachingProtocol
    sigma0 : (N,) array
    disturbance : Disturbance
    bounded_by : str
        How ``|d_k| <= delta`` was established.
    """

    protocol: ReachingProtocol
    sigma0: np.ndarray
    disturbance: Disturbance
    bounded_by: str

    @classmethod
    def of(
        cls, protocol: ReachingProtocol, labels: Any, sigma0: np.ndarray, disturbance: Any, until: float
    ) -> SlidingRun:
        """Read a disturbance, the worst case by default, and check it up to an instant.

        Raises
        ------
        ParameterError
            It exceeds ``delta``, or reads the states.
        """
        source = as_disturbance(
            "worst-case" if disturbance is None else disturbance, len(labels), protocol.delta, until
        )
        if isinstance(source, StateDependent):
            raise ParameterError("families take no disturbance that reads the states; give one of time")
        return cls(protocol, sigma0, source, source.check(protocol.delta, labels, until, rounding_slack(protocol)))

    @cached_property
    def problem(self) -> ReachingProblem:
        """The scalar equations."""
        return ReachingProblem(self.protocol, self.sigma0, self.disturbance)

    @cached_property
    def events(self) -> np.ndarray:
        """The clock where a sliding variable reaches 0 or the disturbance jumps; the last one ends all motion."""
        if not self.sigma0.any():
            return np.zeros(1)
        last = float(self.problem.z.max())
        T_r = float(self.protocol.T_r)
        jumps = self.disturbance.breaks(T_r)
        jumps = jumps[(jumps > 0) & (jumps < T_r)]
        z = np.concatenate([self.problem.z, -np.log1p(-jumps / T_r)])
        return np.unique(self.protocol.clock_while_reaching(z[z <= last]))

    def sigma_at(self, clock: np.ndarray) -> np.ndarray:
        """Return the (N, M) sliding variables at increasing values of the clock."""
        T, T_r = float(self.protocol.T), float(self.protocol.T_r)
        rho, pole = float(self.protocol.gain.rho1) * T, float(self.protocol.gain.pole)
        tau = clock / (rho + pole)
        for _ in range(_NEWTON):  # from below, where the clock is concave
            step = (rho * -np.expm1(-tau) + pole * tau - clock) / (rho * np.exp(-tau) + pole)
            tau = tau - step
            if np.abs(step).max(initial=0.0) <= 1e-15 * np.abs(tau).max(initial=0.0):
                break
        left = 1 + np.expm1(-tau) * (T / T_r)  # (T_r - t) / T_r
        with np.errstate(divide="ignore"):
            z = np.maximum(-np.log(np.maximum(left, 0.0)), 0.0)
        return self.problem.sigma(np.maximum.accumulate(z))

    def disturbances(self, t: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the (N, M) disturbances along a run."""
        if isinstance(self.disturbance, WorstCaseDisturbance):
            return float(self.disturbance.delta) * np.sign(sigma)
        agents = np.arange(len(sigma))
        return self.disturbance.values(t, agents, np.zeros_like(agents))

    def fields(self, instants: Instants) -> dict[str, Any]:
        """Return what a trajectory keeps of it."""
        sigma = self.problem.sigma(instants.z)
        return {
            "sigma": sigma,
            "disturbance": self.disturbances(instants.t, sigma),
            "sigma0": self.sigma0,
            "reaching_remaining": instants.reaching_remaining,
            "reaching_z": self.problem.z,
            "source": self.disturbance.text,
            "bounded_by": self.bounded_by,
            "boundary_layer": None,
            "reads_states": False,
        }


class DrivenFamilyMotion(FamilyMotion):
    """``y`` of the agents of a family, moved by the members that a signal chooses, and driven by sliding variables.

    Parameters
    ----------
    members : Members
    state : (N, 1) array
        ``y`` in units of ``unit``.
    tolerances : Tolerances
    sliding : SlidingRun
    unit : float
    """

    def __init__(self, members: Members, state: np.ndarray, tolerances: Tolerances, sliding: SlidingRun, unit: float):
        import casadi as ca

        super().__init__(members, state, tolerances)
        n, count = len(state), members.indices.size
        self._sliding, self._unit, self._clock = sliding, unit, 0.0
        self._parameters = ca.MX.sym("p", count + n * _NODES)
        self._weights = self._parameters[:count]
        self._forcing = ca.reshape(self._parameters[count:], n, _NODES)
        nodes = np.cos(np.pi * (np.arange(_NODES)[::-1] + 0.5) / _NODES)  # of Chebyshev, ascending
        self._nodes, self._fit = nodes, np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, _NODES - 1)).T
        between = np.linspace(-1, 1, 7)
        self._places = np.concatenate([nodes, between])
        self._order = np.argsort(self._places, kind="stable")
        self._between = np.polynomial.chebyshev.chebvander(between, _NODES - 1).T
        self._error = _SHARE * max(tolerances)

    def agents(self) -> np.ndarray:
        """Return the (N,) state ``x = y + sigma``."""
        if self._clock >= self._sliding.events[-1]:
            return self.state[:, 0]
        return self.state[:, 0] + self._sliding.sigma_at(np.array([self._clock]))[:, 0] / self._unit

    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dy/dz`` on a stretch of length 1; its true length is a factor of the weights."""
        import casadi as ca

        powers, place = [ca.MX(1), 2 * clock - 1], 2 * clock - 1
        while len(powers) < _NODES:
            powers.append(2 * place * powers[-1] - powers[-2])
        sigma = ca.mtimes(self._forcing, ca.vertcat(*powers))
        return super().slope(x + sigma, phase, clock, ends)

    def move(self, span: float) -> None:
        """Move on by a stretch of the clock, from event to event."""
        goal = self._clock + span
        for event in self._sliding.events.tolist():
            if self._clock < event and span > 0:
                self._drive(self._clock, min(event, goal))
                self._clock = min(event, goal)
                if event >= goal:
                    break
        if self._clock < goal:
            self._forced = np.zeros(self._between.shape[0] * len(self.state))
            super().move(goal - self._clock)
        self._clock = goal

    def _drive(self, begin: float, end: float) -> None:
        """Move on through a stretch without events, in as many parts as it takes to tell ``sigma``."""
        places = (begin + end) / 2 + self._places[self._order] * ((end - begin) / 2)
        values = np.empty((len(self.state), self._places.size))
        values[:, self._order] = self._sliding.sigma_at(np.clip(places, begin, end)) / self._unit
        coefficients = values[:, :_NODES] @ self._fit
        gap = float(np.abs(values[:, _NODES:] - coefficients @ self._between).max())
        weight = min(1.0, (end - begin) * self._largest)
        middle = (begin + end) / 2
        if gap * weight > self._error and begin < middle < end:
            self._drive(begin, middle)
            self._drive(middle, end)
            return
        self._forced = coefficients.ravel(order="F")
        super().move(end - begin)

    def _values(self, span: float) -> list[float]:
        return [*super()._values(span), *self._forced.tolist()]
