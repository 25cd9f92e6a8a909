"""Trajectories under the sliding-mode protocol: the Filippov solution, event by event.

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
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.reaching_time import LAST_Z, ReachingProblem, worst_case
from ptcc_certify.simulation.cvodes import Motion, Phase, Tolerances
from ptcc_certify.simulation.cvodes_nominal import MANY_STEPS, NominalMotion, signal
from ptcc_certify.simulation.instants import Instants, tau_before
from ptcc_certify.simulation.trajectory import SlidingTrajectory

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols import ReachingProtocol

# The imitation with a boundary layer goes so far towards each pole: 1 - t/T = 1e-13.
_LAYER_Z = 30.0


def simulate_sliding(
    graph: SignedDigraph,
    protocol: ReachingProtocol,
    initial_state: np.ndarray,
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
    initial_state, sigma0 : (N,) array
    disturbance : Disturbance
    instants : Instants
    tolerances : Tolerances
    boundary_layer : float or None
    """
    bounded_by = disturbance.check(protocol.delta, graph.labels, float(instants.t[-1]), rounding_slack(protocol))
    motion = _SlidingMotion(graph, protocol, disturbance, initial_state, sigma0, tolerances, boundary_layer)
    z = np.full(initial_state.size, np.nan)
    if boundary_layer is None:
        z, states, residual = motion.filippov(instants)
    else:
        states, residual = motion.imitation(instants)
    y, sigma = states.T * motion.unit
    with np.errstate(divide="ignore"):
        clock = np.where(instants.remaining > 0, protocol.gain.clock_at_remaining(instants.remaining) + 0.0, np.inf)
    return SlidingTrajectory(
        graph=graph,
        protocol=protocol,
        t=instants.t,
        remaining=instants.remaining,
        clock=clock,
        states=y + sigma,
        rtol=tolerances.rtol,
        atol=tolerances.atol,
        deadline_index=instants.deadline(protocol),
        deadline_residual=residual,
        stats=motion.stats,
        sigma=sigma,
        disturbance=motion.disturbances(instants.t, y + sigma, sigma),
        sigma0=sigma0,
        reaching_remaining=instants.reaching_remaining,
        reaching_z=z,
        source=disturbance.text,
        bounded_by=bounded_by,
        boundary_layer=boundary_layer,
        reads_states=isinstance(disturbance, StateDependent),
    )


class _SlidingMotion(Motion):
    """Agents moved along ``y' = -gain L (y + sigma)`` with their sliding variables, ``y = x - sigma``.

        sigma' = -mu1 s - (reaching gain) sigma + d    until sigma is 0, and 0 from there on

    Attributes
    ----------
    state : (N, 2) array
        ``y`` and ``sigma`` in units of ``unit``, the size of the initial state.
    reaching_z : (N,) array
        ``z`` where each sliding variable is 0; before, ``s`` is the sign of its initial value.
    layer : float or None
        ``s`` is ``tanh(sigma/layer)`` instead.
    """

    def __init__(
        self,
        graph: SignedDigraph,
        protocol: ReachingProtocol,
        disturbance: Disturbance,
        initial_state: np.ndarray,
        sigma0: np.ndarray,
        tolerances: Tolerances,
        boundary_layer: float | None,
    ):
        state = np.stack([initial_state - sigma0, sigma0], axis=1)
        self.unit = float(max(np.abs(initial_state).max(), np.abs(state).max())) or 1.0
        super().__init__(graph, state / self.unit, 1, tolerances)
        self._options["max_num_steps"] = MANY_STEPS
        self.graph, self.protocol, self.tolerances, self.slack = graph, protocol, tolerances, rounding_slack(protocol)
        self.sigma0, self.disturbance = sigma0, disturbance
        self.sources, self._signal = (disturbance,), signal(disturbance, graph.n_nodes)
        self.reaching_z, self.layer = np.full(len(state), np.inf), boundary_layer
        self.T_r, self.T_s, self.T = float(protocol.T_r), float(protocol.T_s), float(protocol.T)
        self.rho1, self.pole = float(protocol.rho1), float(protocol.gain.pole)
        self.mu1, self.mu2 = float(protocol.mu1), float(protocol.mu2)
        reaching_pole = float(protocol.reaching_gain.pole)
        self.reaching = Phase(0.0, self.T_r, self.rho1, self.pole, self.T_s, self.mu2, reaching_pole)

    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dy/dz`` and ``dsigma/dz``, with 0 for a sliding variable that is 0."""
        import casadi as ca

        R, t = phase.rate(clock, ca.exp), phase.time(clock, ca.exp)
        y, sigma = ca.horzsplit(x)
        s = ca.tanh(sigma * (self.unit / self.layer)) if self.layer else ca.DM(np.sign(self.sigma0))
        push = R / self.unit * ca.DM(self.reaching_z > ends[0]) * (self.mu1 * s - self._signal(phase, ends, t, s))
        sigma_slope = -push - (phase.mu2 * R + phase.reaching_pole) * sigma
        return ca.horzcat(-phase.nominal(R) * self._product(y + sigma), sigma_slope)

    def _advance(self, phase: Phase, z: np.ndarray, start: float) -> np.ndarray:
        self.state[self.reaching_z <= start, 1] = 0
        return super()._advance(phase, z, start)

    # ------------------------------------------------------------------ the true solution

    def filippov(self, instants: Instants) -> tuple[np.ndarray, np.ndarray, float | None]:
        """Return reaching times ``z``, the (M, N, 2) ``y`` and sliding variables, and the residual at the deadline."""
        z, t = instants.z, instants.t
        out = np.zeros((z.size, *self.state.shape))
        reads_states = isinstance(self.disturbance, StateDependent) and bool(self.sigma0.any())
        reaching_z, end, y_end = (self._solve_coupled if reads_states else self._solve_decoupled)(z, out)
        # Sliding variables that are 0 at T_r only: from ``end`` on they move nobody.
        early = end < self._last_z
        out[(z >= end) & (z < np.inf), :, 0] = y_end
        later = z >= end if early else np.isinf(z)
        remaining = self.T_s + (self.T_r * math.exp(-end) if early else 0.0)
        motion = NominalMotion(self.graph, y_end[:, None], self.tolerances)
        motion.stats = self.stats
        limited, begin = GainLimits().limit(self.protocol.gain), math.log(self.T / remaining)
        nominal, residual = motion.follow(limited, t[later], instants.remaining[later], begin)
        out[later, :, 0] = nominal[:, :, 0]
        return reaching_z, out, residual

    @property
    def _last_z(self) -> float:
        """Beyond this ``z`` what remains of the sliding variables moves nobody by a float's last bit."""
        gain = (self.rho1 + self.pole / self.T_s) * self.T_r * 2 * float(self.in_weight.max())
        return LAST_Z + max(0.0, math.log(max(gain, 1.0)))

    def _solve_decoupled(self, z: np.ndarray, out: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Fill ``out`` until all sliding variables are 0; return the reaching times, the last of them, ``y`` there."""
        if self.disturbance == WorstCaseDisturbance(self.protocol.delta):
            scalar = worst_case(self.protocol, tuple(self.sigma0.tolist()))
        else:
            scalar = ReachingProblem(self.protocol, self.sigma0, self.disturbance)
        end = min(float(scalar.z.max(initial=0.0)), self._last_z)
        self.reaching_z, early = scalar.z, z < end
        out[early] = self.sample(self.reaching, z[early], end, events=scalar.z)
        # The scalar equations are solved to near machine precision.
        out[:, :, 1] = scalar.sigma(z).T / self.unit
        return scalar.z, end, self.state[:, 0]

    def _solve_coupled(self, z: np.ndarray, out: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Do the same under a disturbance that reads the states: all agents at once, events by bracketing."""
        from scipy.integrate import LSODA

        n, end, now, phase = len(self.state), self._last_z, 0.0, self.reaching
        state, signs = self.state.T.ravel(), np.sign(self.sigma0)
        reaching_z = np.where(signs == 0, 0.0, np.inf)
        # Each sliding variable to a tolerance of its own size: its root depends on nothing else.
        sizes = np.abs(state[n:])
        atol = self.tolerances.atol * np.concatenate([np.ones(n), np.where(sizes > 0, np.maximum(sizes, 1e-250), 1.0)])

        def motion(z: float, v: np.ndarray) -> np.ndarray:
            R, t = float(phase.rate(z, math.exp)), float(phase.time(z, math.exp))
            # A trial beyond the root must not show the disturbance a sign that never occurs.
            y, sigma = v[:n], signs * np.maximum(signs * v[n:], np.finfo(float).tiny)
            d = self._evaluate_disturbance(t, (y + sigma) * self.unit, sigma * self.unit)
            push = R * (self.mu1 * signs - np.abs(signs) * d) / self.unit
            rate = -push - (phase.mu2 * R + phase.reaching_pole) * np.where(signs != 0, v[n:], 0.0)
            return np.concatenate([-phase.nominal(R) * (self.laplacian @ (y + sigma)), rate])

        while signs.any() and now < end:
            solver = LSODA(motion, now, state, end, rtol=self.tolerances.rtol, atol=atol)
            candidates = np.flatnonzero(signs).tolist()
            events: list[int] = []
            while not events and solver.status == "running":
                before = solver.t
                if message := solver.step():
                    raise SimulationError(f"the reaching phase stopped: {message}")
                dense = solver.dense_output()
                roots = {k: _root(dense, n + k, signs[k], before, solver.t) for k in candidates}
                last = min(roots.values())
                events = [k for k in candidates if roots[k] <= min(last, solver.t)]
                now = min(last, solver.t)
                inside = (z >= before) & (z < now)
                if inside.any():
                    out[inside] = dense(z[inside]).T.reshape(-1, 2, n).swapaxes(1, 2)
                    out[inside, :, 1] *= np.abs(signs)
                self.stats["steps"] += 1
            self.stats["rhs"] += solver.nfev
            state = dense(now) if events else solver.y.copy()
            # Who is past 0 by a rounding has arrived too.
            arrivals = (signs * state[n:] < 0) | np.isin(np.arange(n), events)
            reaching_z[arrivals], signs[arrivals] = now, 0.0
            state[n:][signs == 0] = 0
        return reaching_z, now, state[:n]

    # ------------------------------------------------------------------ the imitation

    def imitation(self, instants: Instants) -> tuple[np.ndarray, float | None]:
        """Return the (M, N, 2) ``y`` and sliding variables with ``tanh(sigma/layer)`` for the sign, and the residual.

        Towards each pole the run stops at ``1 - t/T = 1e-13``; its state there stands for what follows.
        """
        if isinstance(self.disturbance, StateDependent):
            raise ParameterError("a boundary layer takes no disturbance that reads the states; give one of time")
        t, residual = instants.t, None
        out = np.empty((t.size, *self.state.shape))
        before, after = instants.reaching_remaining > 0, instants.remaining == 0
        settling = Phase(self.T_r, self.T_s, self.rho1, self.pole, mu2=self.mu2)
        past = Phase(self.T, self.T, self.rho1, mu2=self.mu2, past=True)
        towards_T, since_T = tau_before(t, instants.remaining, self.T, self.T_s), np.maximum(t / self.T - 1, 0.0)
        clocks = (
            (self.reaching, before, instants.z, _LAYER_Z),
            (settling, ~before & ~after, towards_T, _LAYER_Z),
            (past, after, since_T, float(since_T[-1])),
        )
        for phase, here, clock, end in clocks:
            if phase is past and after.any():
                residual = self.imbalance(self.state.sum(axis=1, keepdims=True))
            if (t >= phase.start).any():
                out[here] = self.sample(phase, clock[here], end)
        return out, residual

    def _evaluate_disturbance(self, t: float, x: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the (N,) disturbances at one instant and state, within the bound."""
        assert isinstance(self.disturbance, StateDependent)
        return self.disturbance.at(t, x, sigma, self.protocol.delta, self.graph.labels, self.slack)

    def disturbances(self, t: np.ndarray, x: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the (N, M) disturbances along a run; one that reads the states is checked at every sample."""
        disturbance = self.disturbance
        if isinstance(disturbance, StateDependent):
            return np.stack(
                [self._evaluate_disturbance(*at) for at in zip(t.tolist(), x.T, sigma.T, strict=True)], axis=1
            )
        if isinstance(disturbance, WorstCaseDisturbance):
            return float(disturbance.delta) * (np.tanh(sigma / self.layer) if self.layer else np.sign(sigma))
        agents = np.arange(len(x))
        return disturbance.values(t, agents, np.zeros_like(agents))


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
    return low if size(low) <= 0 else float(brentq(size, low, high, xtol=1e-300, rtol=4e-16 * 4, maxiter=3000))
