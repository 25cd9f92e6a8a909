"""Trajectories under the sliding-mode protocol: the Filippov solution, found event by event.

While no sliding variable changes its sign the motion is as smooth as the disturbance. With ``y = x - sigma``,

    y' = -gain(t) L (y + sigma),      gain with the pole at T = T_r + T_s,

and ``sigma_k`` stays at 0 once it is there, whatever the disturbance. So every reaching time is found first, as the
root of a scalar equation, the integrator runs from event to event in ``z = ln(T_r/(T_r - t))``, where the pole at
``T_r`` is gone, and the rest is the nominal motion. No integrator ever meets a pole or a jump of the sign.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.protocols.disturbance import TOLERANCE, Disturbance, StateDependent, WorstCaseDisturbance
from ptcc_certify.protocols.reaching_time import LAST_Z, ReachingProblem
from ptcc_certify.simulation.cvodes import NominalMotion, Tolerances
from ptcc_certify.simulation.forced import Phase, SlidingMotion
from ptcc_certify.simulation.instants import Instants, tau_before
from ptcc_certify.simulation.trajectory import SlidingTrajectory

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols import ReachingProtocol

# The imitation with a boundary layer goes so far towards each pole: 1 - t/T = 1e-13.
_LAYER_Z = 30.0


def simulate_sliding(
    graph: SignedDigraph,
    protocol: ReachingProtocol,
    start: np.ndarray,
    sigma0: np.ndarray,
    disturbance: Disturbance,
    instants: Instants,
    tolerances: Tolerances,
    boundary_layer: float | None,
) -> SlidingTrajectory:
    """Integrate ``x_k' = u_k + d_k`` with (48); see :func:`ptcc_certify.simulation.run.simulate`.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : ReachingProtocol
    start, sigma0 : (N,) array
    disturbance : Disturbance
    instants : Instants
    tolerances : Tolerances
    boundary_layer : float or None
    """
    slack = rounding_slack(protocol)
    bounded_by = disturbance.check(protocol.delta, graph.labels, float(instants.t[-1]), slack)
    unit = float(max(np.abs(start).max(), np.abs(sigma0).max(), np.abs(start - sigma0).max())) or 1.0
    solver = _Solver(graph, protocol, disturbance, unit, tolerances)
    if boundary_layer is None:
        z, y, sigma, residual = solver.filippov(start, sigma0, instants)
    else:
        z = np.full(start.size, np.nan)
        y, sigma, residual = solver.imitation(start, sigma0, instants, boundary_layer)
    with np.errstate(divide="ignore"):
        clock = np.where(instants.left > 0, protocol.gain.clock_at_remaining(instants.left) + 0.0, np.inf)
    return SlidingTrajectory(
        graph=graph,
        protocol=protocol,
        t=instants.t,
        remaining=instants.left,
        clock=clock,
        states=y + sigma,
        rtol=tolerances.rtol,
        atol=tolerances.atol,
        deadline_index=instants.deadline(protocol),
        deadline_residual=residual,
        stats=solver.stats,
        sigma=sigma,
        disturbance=solver.disturbances(instants.t, y + sigma, sigma, boundary_layer),
        sigma0=sigma0,
        reaching_remaining=instants.reaching_left,
        reaching_z=z,
        source=disturbance.text,
        bounded_by=bounded_by,
        boundary_layer=boundary_layer,
        reads_states=isinstance(disturbance, StateDependent),
    )


class _Solver:
    """One run; ``stats`` adds up what the integrators did."""

    def __init__(
        self,
        graph: SignedDigraph,
        protocol: ReachingProtocol,
        disturbance: Disturbance,
        unit: float,
        tolerances: Tolerances,
    ):
        self.graph, self.protocol, self.disturbance = graph, protocol, disturbance
        self.unit, self.tolerances = unit, tolerances
        self.stats: dict[str, float] = {"steps": 0, "rhs": 0}
        self.T_r, self.T_s, self.T = float(protocol.T_r), float(protocol.T_s), float(protocol.T)
        self.rho1, self.pole = float(protocol.rho1), float(protocol.gain.pole)
        self.mu1, self.mu2 = float(protocol.mu1), float(protocol.mu2)
        reaching_pole = float(protocol.reaching_gain.pole)
        self.reaching = Phase(0.0, self.T_r, self.rho1, self.pole, self.T_s, self.mu2, reaching_pole)

    # ------------------------------------------------------------------ the true solution

    def filippov(
        self, start: np.ndarray, sigma0: np.ndarray, instants: Instants
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, float | None]:
        """Return reaching times ``z``, the (N, M) ``y`` and sliding variables, and the residual at the deadline."""
        z, n = instants.z, start.size
        out = np.zeros((2 * n, z.size))
        reads_states = isinstance(self.disturbance, StateDependent) and bool(sigma0.any())
        reach = self._coupled if reads_states else self._decoupled
        reached, end, y_end = reach(start, sigma0, z, out)
        # Sliding variables that are 0 at T_r only: from ``end`` on they move nobody.
        early = end < self._last_z
        out[:n, (z >= end) & (z < np.inf)] = y_end[:, None]
        later = z >= end if early else np.isinf(z)
        remaining = self.T_s + (self.T_r * math.exp(-end) if early else 0.0)
        out[:n, later], residual = self._nominal(y_end, remaining, instants.t[later], instants.left[later])
        return reached, out[:n] * self.unit, out[n:] * self.unit, residual

    @property
    def _last_z(self) -> float:
        """Beyond this ``z`` what is left of the sliding variables moves nobody by a float's last bit."""
        gain = (self.rho1 + self.pole / self.T_s) * self.T_r * 2 * float(self.graph.in_weight().max())
        return LAST_Z + max(0.0, math.log(max(gain, 1.0)))

    def _decoupled(
        self, start: np.ndarray, sigma0: np.ndarray, z: np.ndarray, out: np.ndarray
    ) -> tuple[np.ndarray, float, np.ndarray]:
        """Fill ``out`` until all sliding variables are 0; return the reaching times, the last of them, ``y`` there."""
        scalar = ReachingProblem(self.protocol, sigma0, self.disturbance)
        end = min(float(scalar.z.max(initial=0.0)), self._last_z)
        motion = self._motion(start, sigma0)
        sign = np.sign(sigma0)
        events = [0.0, *scalar.z[scalar.z < end], end]
        motion.sample(self.reaching, z, events, lambda at: np.where(scalar.z > at, sign, 0.0), out)
        self._count(motion.stats)
        # The scalar equations are solved to near machine precision.
        out[start.size :] = scalar.sigma(z) / self.unit
        return scalar.z, end, motion.state[: start.size]

    def _coupled(
        self, start: np.ndarray, sigma0: np.ndarray, z: np.ndarray, out: np.ndarray
    ) -> tuple[np.ndarray, float, np.ndarray]:
        """Do the same under a disturbance that reads the states: all agents at once, events by bracketing."""
        from scipy.integrate import LSODA

        n, end, now = start.size, self._last_z, 0.0
        phase, L = self.reaching, self.graph.laplacian()
        disturbance = self.disturbance
        assert isinstance(disturbance, StateDependent)
        labels, delta, slack = self.graph.labels, self.protocol.delta, rounding_slack(self.protocol)
        signs, reached = np.sign(sigma0), np.where(sigma0 == 0, 0.0, np.inf)
        state = np.concatenate([start - sigma0, sigma0]) / self.unit
        # Each sliding variable to a tolerance of its own size: its root depends on nothing else.
        sizes = np.abs(state[n:])
        atol = self.tolerances.atol * np.concatenate([np.ones(n), np.where(sizes > 0, np.maximum(sizes, 1e-250), 1.0)])

        def motion(z: float, v: np.ndarray) -> np.ndarray:
            R, t = float(phase.rate(z, math.exp)), float(phase.time(z, math.exp))
            # A trial beyond the root must not show the disturbance a sign that never occurs.
            y, sigma = v[:n], signs * np.maximum(signs * v[n:], np.finfo(float).tiny)
            d = disturbance.at(t, (y + sigma) * self.unit, sigma * self.unit, delta, labels, slack)
            push = R * (self.mu1 * signs - np.abs(signs) * d) / self.unit
            rate = -push - (phase.mu2 * R + phase.reaching_pole) * np.where(signs != 0, v[n:], 0.0)
            return np.concatenate([-phase.nominal(R) * (L @ (y + sigma)), rate])

        while signs.any() and now < end:
            solver = LSODA(motion, now, state, end, rtol=self.tolerances.rtol, atol=atol)
            watched = np.flatnonzero(signs).tolist()
            hit: list[int] = []
            while not hit and solver.status == "running":
                before = solver.t
                if message := solver.step():
                    raise SimulationError(f"the reaching phase stopped: {message}")
                dense = solver.dense_output()
                roots = {k: _root(dense, n + k, signs[k], before, solver.t) for k in watched}
                last = min(roots.values())
                hit = [k for k in watched if roots[k] <= min(last, solver.t)]
                now = min(last, solver.t)
                inside = (z >= before) & (z < now)
                if inside.any():
                    out[:, inside] = dense(z[inside])
                    out[n:, inside] *= np.abs(signs)[:, None]
                self._count({"steps": 1, "rhs": 0})
            self._count({"steps": 0, "rhs": solver.nfev})
            state = dense(now) if hit else solver.y.copy()
            reached[hit], signs[hit] = now, 0.0
            # Who is past 0 by a rounding has arrived too.
            late = np.flatnonzero(signs * state[n:] < 0)
            reached[late], signs[late] = now, 0.0
            state[n:][signs == 0] = 0
        return reached, now, state[:n]

    def _nominal(
        self, y: np.ndarray, remaining: float, t: np.ndarray, left: np.ndarray
    ) -> tuple[np.ndarray, float | None]:
        """Return the (N, .) states on the sliding manifold, reached ``remaining`` before ``T``, and the residual."""
        motion, before = NominalMotion(self.graph, y[:, None], self.tolerances), left > 0
        tau = tau_before(t[before], left[before], self.T, remaining)
        states, residual = motion.past_deadline(self.protocol.gain, remaining, tau, t[~before])
        self._count(motion.stats)
        return states[:, :, 0].T, residual

    # ------------------------------------------------------------------ the imitation

    def imitation(
        self, start: np.ndarray, sigma0: np.ndarray, instants: Instants, width: float
    ) -> tuple[np.ndarray, np.ndarray, float | None]:
        """Return the (N, M) ``y`` and sliding variables with ``tanh(sigma/width)`` for the sign, and the residual.

        Towards each pole the run stops at ``1 - t/T = 1e-13``; its state there stands for what follows.
        """
        if isinstance(self.disturbance, StateDependent):
            raise ParameterError("a boundary layer takes no disturbance that reads the states; give one of time")
        n, t, last = start.size, instants.t, float(instants.t[-1])
        out = np.empty((2 * n, t.size))
        motion = self._motion(start, sigma0, width)
        before, after = instants.reaching_left > 0, instants.left == 0
        between = ~before & ~after
        settling = Phase(self.T_r, self.T_s, self.rho1, self.pole, mu2=self.mu2)
        past = Phase(self.T, self.T, self.rho1, mu2=self.mu2, past=True)
        towards_T = tau_before(t, instants.left, self.T, self.T_s)
        clocks = (
            (self.reaching, before, instants.z, _LAYER_Z),
            (settling, between, towards_T, _LAYER_Z),
            (past, after, np.maximum(t / self.T - 1, 0.0), max(last / self.T - 1, 0.0)),
        )
        residual = None
        for phase, here, clock, end in clocks:
            if phase is past and after.any():
                residual = motion.imbalance((motion.state[:n] + motion.state[n:])[:, None])
            if (t >= phase.start).any():
                z = np.where(here, clock, np.nan)
                motion.sample(phase, z, [0.0, end], lambda _: np.ones(n), out)
                out[:, here & (clock >= end)] = motion.state[:, None]
        self._count(motion.stats)
        return out[:n] * self.unit, out[n:] * self.unit, residual

    def _motion(self, start: np.ndarray, sigma0: np.ndarray, layer: float | None = None) -> SlidingMotion:
        state = np.concatenate([start - sigma0, sigma0]) / self.unit
        return SlidingMotion(self.graph, self.protocol, self.disturbance, state, self.unit, self.tolerances, layer)

    def disturbances(self, t: np.ndarray, x: np.ndarray, sigma: np.ndarray, layer: float | None) -> np.ndarray:
        """Return the (N, M) disturbances along a run; one that reads the states is checked at every sample."""
        disturbance, labels, delta = self.disturbance, self.graph.labels, self.protocol.delta
        if isinstance(disturbance, StateDependent):
            slack = rounding_slack(self.protocol)
            columns = (disturbance.at(float(t[i]), x[:, i], sigma[:, i], delta, labels, slack) for i in range(t.size))
            return np.stack(list(columns), axis=1)
        if isinstance(disturbance, WorstCaseDisturbance) and layer is not None:
            return float(disturbance.delta) * np.tanh(sigma / layer)
        agents = np.arange(x.shape[0])
        up, rest, down = (disturbance.values(t, agents, np.full(agents.size, s)) for s in (1, 0, -1))
        return np.where(sigma > 0, up, np.where(sigma < 0, down, rest))

    def _count(self, stats: dict[str, Any]) -> None:
        for key in ("steps", "rhs"):
            self.stats[key] += stats[key]


def rounding_slack(protocol: ReachingProtocol) -> float:
    """Return by how much a float disturbance may exceed ``delta``, relatively; never as far as ``mu1``."""
    gap = (protocol.mu1 - protocol.delta) / (2 * protocol.delta) if protocol.delta else 0
    return min(TOLERANCE, float(gap))


def _root(dense: Any, row: int, sign: float, low: float, high: float) -> float:
    """Return where a sliding variable reaches 0 within a step, infinity if it does not."""
    from scipy.optimize import brentq

    def size(z: float) -> float:
        return float(sign * dense(z)[row])

    if size(high) > 0:
        return math.inf
    return low if size(low) <= 0 else float(brentq(size, low, high, xtol=1e-300, rtol=4e-16 * 4))
