"""Runs of double integrators that exchange virtual positions: by CVODES, or after a run of the virtual ones.

In ``w = x'/g`` on the clock ``tau = -ln(1 - t/T)`` nothing has a pole: with ``h = g (T - t)``, ``theta = g'/g^2`` and
``r = x - z``

    dx/dtau = h w,   dw/dtau = h (-a_1 theta r - a_1 (w - e) - a_2 (w + a_1 r) - theta w),   dz/dtau = h e.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import whole_number
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.simulation.agents import MOST_STATES, AgentsTrajectory
from ptcc_certify.simulation.cvodes import Motion, Phase, Tolerances
from ptcc_certify.simulation.late_messages import can_run, simulate_late
from ptcc_certify.simulation.members import Members
from ptcc_certify.simulation.run import simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.model.base import Protocol
    from ptcc_certify.model.late_messages import LateMessages
    from ptcc_certify.model.moving_leaders import MovingLeaders
    from ptcc_certify.model.virtual_positions import TrackingProtocol
    from ptcc_certify.simulation.trajectory import Trajectory

#: Instants of a run that vehicles follow.
_SAMPLES = 1001
#: The least ``1 - t/T`` at which the input is told without a cap: nearer by rounding takes it over.
_NEAREST = 1e-5


class _Tracking(Motion):
    """``x``, ``w`` and ``z`` of every agent, on one stretch of time after the other."""

    moved = 1

    def __init__(self, graph: SignedDigraph, state: np.ndarray, of: TrackingProtocol, rtol: float):
        size = max(float(np.abs(state).max(initial=0)), 1e-300)
        super().__init__(Members(graph), state, Tolerances(rtol, rtol * size))
        self._of = of
        self._options |= {"max_num_steps": 200_000}

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return the slope of positions, scaled velocities and virtual positions on the clock of the phase."""
        import casadi as ca

        a1, a2, gain = float(self._of.a1), float(self._of.a2), self._of.gain
        R = phase.rate(z, ca.exp)
        h = phase.nominal(R)
        theta = ca.MX(0) if phase.past else (1 - float(gain.rho1) * R / h) ** 2 / float(gain.pole)
        position, scaled, virtual = (x[:, i] for i in range(3))
        e, r = -self._product(virtual), position - virtual
        pushed = -a1 * theta * r - a1 * (scaled - e) - a2 * (scaled + a1 * r) - theta * scaled
        return h * ca.horzcat(scaled, pushed, e)


def simulate_vehicles(
    graph: SignedDigraph,
    protocol: TrackingProtocol,
    x0: Sequence[float],
    v0: Sequence[float],
    *,
    remaining: float = 1e-6,
    samples: int = 101,
    rtol: float = 1e-10,
) -> AgentsTrajectory:
    """Integrate double integrators that exchange virtual positions, which are heard at once, to the deadline.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : TrackingProtocol
    x0, v0 : sequence of N float
    remaining : float
        Instants uniform in ``tau`` go from ``1 - t/T = 1`` to this; under a cap then comes ``T``.
    samples : int
        So many of these, and as many uniform in ``t``.
    rtol : float
        Of CVODES.

    Raises
    ------
    ParameterError
        There are too many agents, or ``samples`` are below 2.
    SimulationError
        The integrator failed.

    Examples
    --------
    >>> from ptcc_certify.model.gain import Gain
    >>> from ptcc_certify.model.virtual_positions import TrackingProtocol
    >>> protocol = TrackingProtocol(Gain(T=1, rho1=1, rho2=2, kappa=2), Fraction(4), Fraction(4))
    >>> run = simulate_vehicles(SignedDigraph.from_edges([(1, 2, 1)]), protocol, [1, 0], [0, 5])
    >>> run.positions[:, 0, -1].round(4)
    array([1., 1.])
    """
    N, samples = graph.n_nodes, whole_number(samples, "samples", 2, 100_000)
    if 3 * N > MOST_STATES:
        raise ParameterError(f"more than {MOST_STATES} numbers to integrate; simulate fewer agents")
    q = np.unique(np.concatenate([np.geomspace(remaining, 1, samples), np.linspace(remaining, 1, samples)]))[::-1]
    q = q if protocol.gain_cap is None else np.append(q, 0.0)
    base, T = protocol.gain, float(protocol.gain.T)
    limits = GainLimits(gain_cap=protocol.gain_cap).limit(base)
    g = limits.value(T * (1 - q), remaining=q)
    if protocol.gain_cap is not None:
        g = np.maximum.accumulate(g)  # which stays what it came to
    first = np.array([x0, np.asarray(v0, dtype=float) / g[0], x0], dtype=float).T
    states = _integrate(graph, protocol, first, q, rtol)
    x, w, z = states[:, :, 0].T, states[:, :, 1].T, states[:, :, 2].T
    a1, a2 = float(protocol.a1), float(protocol.a2)
    theta = _slope(protocol, g) / g**2
    e = -(graph.laplacian() @ z)
    u = g**2 * (-a1 * theta * (x - z) - a1 * (w - e) - a2 * (w + a1 * (x - z)))
    moved = np.stack([x, w * g], axis=1)[:, None]
    clock, told = limits.clock(T * (1 - q), remaining=q), np.full_like(moved, np.nan)
    tracking: Any = protocol  # nothing of an AgentsProtocol is asked of a run by itself
    return AgentsTrajectory(graph, tracking, T * (1 - q), q, clock, moved, told, u[:, None], rtol, 0.0)


def _integrate(
    graph: SignedDigraph, protocol: TrackingProtocol, first: np.ndarray, q: np.ndarray, rtol: float
) -> np.ndarray:
    """Return (M, N, 3) states at the instants: up to the cap of the gain, and from there on."""
    gain, cap, T = protocol.gain, protocol.gain_cap, float(protocol.gain.T)
    rho1, k = float(gain.rho1), float(gain.pole)
    turn = 0.0
    if cap is not None:
        turn = 1.0 if cap <= gain.first else k / (T * (float(cap) - rho1))
    motion, states, early = _Tracking(graph, first, protocol, rtol), np.zeros((q.size, *first.shape)), q >= turn
    states[early] = first
    if turn < 1:
        states[early] = motion.sample(Phase(0.0, T, rho1, k), -np.log(q[early]), -math.log(max(turn, float(q[-1]))))
    if turn:
        later = Phase(T * (1 - turn), T * turn, float(cap or 0), past=True)
        states[~early] = motion.sample(later, 1 - q[~early] / turn, 1.0)
    return states


def _slope(protocol: TrackingProtocol, g: np.ndarray) -> np.ndarray:
    """Return ``g'``, 0 under a cap."""
    rho1, k = float(protocol.gain.rho1), float(protocol.gain.pole)
    slope = (g - rho1) ** 2 / k
    return slope if protocol.gain_cap is None else np.where(g < float(protocol.gain_cap), slope, 0.0)


def follow(run: Trajectory, protocol: TrackingProtocol, v0: Sequence[Fraction]) -> Trajectory:
    """Return the run of vehicles that track the agents of a run, with their input.

    Over a step the virtual positions, and ``r/g``, are taken to change evenly with the clock: of second order.

    Parameters
    ----------
    run : Trajectory
        Of the virtual positions, up to ``T``, with its clock.
    protocol : TrackingProtocol
    v0 : sequence of N Fraction
    """
    a1, a2, z, s = float(protocol.a1), float(protocol.a2), run.states, run.clock
    gain = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain)
    g = gain.value(run.t, remaining=run.remaining)
    if protocol.gain_cap is not None:
        g = np.maximum.accumulate(g)
    begun = np.array([float(x) for x in v0])[:, None]
    with np.errstate(invalid="ignore", over="ignore"):
        r = begun * np.exp(-a2 * s)
        ahead = np.where(np.isfinite(g), r / g, 0.0)
        x = z.copy()
        for i in range(run.t.size - 1):
            way = math.inf if np.isinf(s[i + 1]) else a1 * (s[i + 1] - s[i])
            left, mean = math.exp(-way), -math.expm1(-way) / way if way > 0 else 1.0
            kept = 0.0 if math.isinf(way) else 1 - left
            lag = (x[:, i] - z[:, i]) * left - (z[:, i + 1] - z[:, i]) * mean
            x[:, i + 1] = z[:, i + 1] + lag + kept * (ahead[:, i] + ahead[:, i + 1]) / (2 * a1)
        v = r - a1 * g * (x - z)
        u = -a1 * _slope(protocol, g) * (x - z) - a1 * g * (v - run.input) - a2 * g * r
    seen = np.isfinite(u) & ((run.remaining > _NEAREST) | (protocol.gain_cap is not None))
    u = np.where(seen, u, np.nan)
    if run.targets is not None:  # leaders that move as they like send their own positions
        leading = run.graph.in_weight() == 0
        x[leading], u[leading] = z[leading], 0.0
    return replace(run, states=x, held_input=u, conditions=replace(run.conditions, tracking=protocol))


def run_of_vehicles(
    graph: SignedDigraph,
    protocol: Protocol,
    tracking: TrackingProtocol,
    messages: LateMessages,
    x0: Sequence[float],
    leaders: MovingLeaders | None = None,
) -> Trajectory | None:
    """Return a run of vehicles whose messages are as late as allowed, up to ``T`` or past it.

    None where delays are too short for a run.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : Protocol
        That of the virtual positions.
    tracking : TrackingProtocol
    messages : LateMessages
        With the vehicles.
    x0 : sequence of N float
    leaders : MovingLeaders, optional
    """
    cap, vehicles = messages.gain_cap, messages.vehicles
    assert vehicles is not None
    if messages.exact and leaders is None:
        actuator = None if cap is None else GainLimits(gain_cap=cap)
        run = simulate(graph, protocol, x0, samples=_SAMPLES, actuator=actuator)
    elif not can_run(protocol, messages):
        return None
    else:
        run = simulate_late(graph, protocol, messages, x0, leaders=leaders)
    return follow(run, tracking, vehicles.v0)
