"""Motions under the sliding-mode protocol: the Filippov solution, event by event.

While no sliding variable changes its sign the motion is as smooth as the disturbance. With ``y = x - sigma``,

    y' = -gain(t) L (y + sigma),      gain with the pole at T = T_r + T_s,

and ``sigma_k`` stays at 0 once it is there, whatever the disturbance. So every reaching time is found first, as the
root of a scalar equation that knows no graph, the integrator runs from event to event, and from switch to switch of a
signal, in ``z = ln(T_r/(T_r - t))``, where the pole at ``T_r`` is gone, and the rest is the nominal motion. No
integrator ever meets a pole or a jump of the sign.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.model.disturbance import TOLERANCE, Disturbance, StateDependent, WorstCaseDisturbance
from ptcc_certify.model.reaching_time import LAST_Z, ReachingProblem, worst_case
from ptcc_certify.simulation.cvodes import Drive, Motion, Phase, Tolerances
from ptcc_certify.simulation.member_laplacians import Choice, Members
from ptcc_certify.simulation.nominal import Instants, tau_before
from ptcc_certify.simulation.switching_signals import Course, Leg
from ptcc_certify.simulation.trajectory import Sliding

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.model import ReachingProtocol

# The imitation with a boundary layer goes so far towards each pole: 1 - t/T = 1e-13.
_LAYER_Z = 30.0
# Steps of Newton's method that finds an instant from the clock.
_NEWTON = 60


class SlidingMotion(Motion):
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

    moved = 1

    def __init__(
        self,
        members: Members,
        protocol: ReachingProtocol,
        disturbance: Disturbance,
        starts: tuple[np.ndarray, np.ndarray],
        tolerances: Tolerances,
        boundary_layer: float | None,
    ):
        import casadi as ca

        initial_state, self.sigma0 = starts
        state = np.stack([initial_state - self.sigma0, self.sigma0], axis=1)
        unit = float(max(np.abs(initial_state).max(), np.abs(state).max())) or 1.0
        super().__init__(members, state / unit, tolerances, unit=unit)
        self.protocol, self.tolerances = protocol, tolerances
        self.slack = rounding_slack(protocol)
        self.disturbance, self.drives = disturbance, [Drive(disturbance, len(state))]
        self._moving = ca.MX.sym("moving", len(state))
        self.reaching_z, self.layer = np.full(len(state), np.inf), boundary_layer
        self.T_r, self.T_s, self.T = float(protocol.T_r), float(protocol.T_s), float(protocol.T)
        self.rho1, self.pole = float(protocol.rho1), float(protocol.gain.pole)
        self.mu1, self.mu2 = float(protocol.mu1), float(protocol.mu2)
        reaching_pole = float(protocol.reaching_gain.pole)
        self.reaching = Phase(0.0, self.T_r, self.rho1, self.pole, self.T_s, self.mu2, reaching_pole)

    def agents(self) -> np.ndarray:
        """Return the (N,) present states ``y + sigma``, in units of ``unit``."""
        return self.state.sum(axis=1)

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return ``dy/dz`` and ``dsigma/dz``, with 0 for a sliding variable that is 0."""
        import casadi as ca

        R, t = phase.rate(z, ca.exp), phase.time(z, ca.exp)
        y, sigma = ca.horzsplit(x)
        s = ca.tanh(sigma * (self.unit / self.layer)) if self.layer else ca.DM(np.sign(self.sigma0))
        push = R / self.unit * self._moving * (self.mu1 * s - self.drives[0](t, s))
        sigma_slope = -push - (phase.mu2 * R + phase.reaching_pole) * sigma
        return ca.horzcat(-phase.nominal(R) * self._product(y + sigma), sigma_slope)

    def symbols(self) -> list[ca.MX]:
        """Return the parameters of an integrator; besides which sliding variables move."""
        return [*super().symbols(), self._moving]

    def numbers(self, phase: Phase, start: float, end: float) -> list[float]:
        """Return these parameters between two neighbouring stops."""
        return [*super().numbers(phase, start, end), *(self.reaching_z > start).astype(float).tolist()]

    def _advance(self, phase: Phase, z: np.ndarray, start: float) -> np.ndarray:
        self.state[self.reaching_z <= start, 1] = 0
        return super()._advance(phase, z, start)

    def nominal(self, y: np.ndarray) -> Motion:
        """Return the motion of the agents from ``y`` on, where no sliding variable moves."""
        motion = Motion(self.members, y[:, None], self.tolerances, unit=self.unit)
        motion.stats = self.stats
        return motion

    # ------------------------------------------------------------------ the true solution

    def reach(self, course: Course, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lead the course until all sliding variables are 0, at the end of the reaching phase at the latest.

        Those that are 0 at ``T_r`` only move nobody for the last of it. Return which instants come later, and the
        (M, N, 2) ``y`` and sliding variables; there ``y`` is left out.
        """
        out = np.zeros((z.size, *self.state.shape))
        reads_states = isinstance(self.disturbance, StateDependent) and bool(self.sigma0.any())
        if reads_states:
            end, y = self._solve_coupled(z, out)
            course.stay(int((z < end).sum()), float(self.protocol.clock_while_reaching(np.array(end))))
        else:
            end, y = self._solve_decoupled(course, z, out)
        course.lead(self.nominal(y))
        if end < self._last_z:
            return z >= end, out
        late = (z >= end) & (z < np.inf)
        out[late, :, 0] = y
        course.stay(int(late.sum()), float(self.protocol.clock_while_reaching(np.array(np.inf))))
        return np.isinf(z), out

    @property
    def _last_z(self) -> float:
        """Beyond this ``z`` what remains of the sliding variables moves nobody by a float's last bit."""
        gain = (self.rho1 + self.pole / self.T_s) * self.T_r * 2 * float(self.in_weight.max())
        return LAST_Z + max(0.0, math.log(max(gain, 1.0)))

    def _solve_decoupled(self, course: Course, z: np.ndarray, out: np.ndarray) -> tuple[float, np.ndarray]:
        """Fill ``out`` until all sliding variables are 0; return the last reaching time, and ``y`` there."""
        if self.disturbance == WorstCaseDisturbance(self.protocol.delta):
            scalar = worst_case(self.protocol, tuple(self.sigma0.tolist()))
        else:
            scalar = ReachingProblem(self.protocol, self.sigma0, self.disturbance)
        end = min(float(scalar.z.max(initial=0.0)), self._last_z)
        self.reaching_z, early = scalar.z, z < end
        out[early] = course.sample(z[early], end, self._leg, events=scalar.z)
        # The scalar equations are solved to near machine precision.
        out[:, :, 1] = scalar.sigma(z).T / self.unit
        return end, self.state[:, 0]

    @cached_property
    def _leg(self) -> Leg:
        """The reaching phase as a stretch of the clock."""
        T, T_r, rho, pole = self.T, self.T_r, self.rho1 * self.T, self.pole

        def place(clock: float) -> float:
            """Return ``z`` at a value of the clock."""
            tau = clock / (rho + pole)
            for _ in range(_NEWTON if math.isfinite(clock) else 0):  # from below, where the clock is concave
                step = (rho * -math.expm1(-tau) + pole * tau - clock) / (rho * math.exp(-tau) + pole)
                tau -= step
                if abs(step) <= 1e-15 * abs(tau):
                    break
            left = 1 + math.expm1(-tau) * (T / T_r)  # (T_r - t) / T_r
            return -math.log(left) if left > 0 else math.inf

        return Leg(self.reaching, lambda z: float(self.protocol.clock_while_reaching(np.array(z))), place)

    def _solve_coupled(self, z: np.ndarray, out: np.ndarray) -> tuple[float, np.ndarray]:
        """Do the same under a disturbance that reads the states: all agents at once, events by bracketing."""
        from scipy.integrate import LSODA

        n = len(self.state)
        end, now = self._last_z, 0.0
        phase = self.reaching
        laplacian = self.members.graph.laplacian()
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
            return np.concatenate([-phase.nominal(R) * (laplacian @ (y + sigma)), rate])

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
        self.reaching_z = reaching_z
        return now, state[:n]

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
                residual = self.members.imbalance(self.agents(), Choice(0))
            if (t >= phase.start).any():
                out[here] = self.sample(phase, clock[here], end)
        return out, residual

    def _evaluate_disturbance(self, t: float, x: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the (N,) disturbances at one instant and state, within the bound."""
        assert isinstance(self.disturbance, StateDependent)
        return self.disturbance.at(t, x, sigma, self.protocol.delta, self.members.graph.labels, self.slack)

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

    def part(self, instants: Instants, x: np.ndarray, sigma: np.ndarray, bounded_by: str) -> Sliding:
        """Return what a trajectory keeps of the sliding variables, (N, M)."""
        return Sliding(
            protocol=self.protocol,
            sigma=sigma,
            disturbance=self.disturbances(instants.t, x, sigma),
            sigma0=self.sigma0,
            reaching_remaining=instants.reaching_remaining,
            reaching_z=self.reaching_z if self.layer is None else np.full(len(x), np.nan),
            source=self.disturbance.text,
            bounded_by=bounded_by,
            boundary_layer=self.layer,
            reads_states=isinstance(self.disturbance, StateDependent),
        )


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
