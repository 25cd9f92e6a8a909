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
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.simulation.agents import MOST_STATES, AgentsMotion, AgentsTrajectory, instants_left
from ptcc_certify.simulation.late_messages import simulate_late
from ptcc_certify.simulation.nominal import Instants, sample
from ptcc_certify.simulation.run import simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.model.base import Protocol
    from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
    from ptcc_certify.model.limited_gain import LimitedGain
    from ptcc_certify.model.virtual_positions import TrackingProtocol
    from ptcc_certify.simulation.cvodes import Phase
    from ptcc_certify.simulation.trajectory import Trajectory

#: Instants of a run that vehicles follow.
_SAMPLES = 1001
#: The least ``1 - t/T`` at which the input is told without a cap: nearer by rounding takes it over.
_NEAREST = 1e-5


class _Tracking(AgentsMotion):
    """``x``, ``w`` and ``z`` of every agent, on one stretch of time after the other."""

    moved = 1

    def __init__(self, graph: SignedDigraph, state: np.ndarray, of: TrackingProtocol, rtol: float):
        super().__init__(graph, state, rtol)
        self._a1, self._a2 = float(of.a1), float(of.a2)

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return the slope of positions, scaled velocities and virtual positions on the clock of the phase."""
        import casadi as ca

        a1, a2, R = self._a1, self._a2, phase.rate(z, ca.exp)
        h, theta = phase.nominal(R), phase.shrinking(R)
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
    steps: int | None = None,
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
    steps : int, optional
        Instead: so many equal steps of ``t`` from 0 to ``T``, which without a cap is left out.
    rtol : float
        Of CVODES.

    Raises
    ------
    ParameterError
        There are too many agents, ``samples`` are below 2 or ``steps`` below 1.
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
    if 3 * graph.n_nodes > MOST_STATES:
        raise ParameterError(f"more than {MOST_STATES} numbers to integrate; simulate fewer agents")
    limited = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain)
    instants = instants_left(protocol.gain, remaining, samples, steps)
    if protocol.gain_cap is None:  # at T itself the gain is infinite
        instants = Instants(*(values[:-1] for values in instants))
    g = _gain_kept(limited, instants.t, instants.remaining)
    first = np.array([x0, np.asarray(v0, dtype=float) / g[0], x0], dtype=float).T
    states, _ = sample(_Tracking(graph, first, protocol, rtol), limited, instants)
    x, w, z = states.transpose(2, 1, 0)
    a1, a2 = float(protocol.a1), float(protocol.a2)
    theta = _slope(protocol, g) / g**2
    e = -(graph.laplacian() @ z)
    u = g**2 * (-a1 * theta * (x - z) - a1 * (w - e) - a2 * (w + a1 * (x - z)))
    clock = limited.clock(instants.t, instants.remaining)
    return _motion_of(graph, protocol, (instants.t, instants.remaining, clock), (x, w * g, u), rtol)


def _gain_kept(limited: LimitedGain, t: np.ndarray, remaining: np.ndarray) -> np.ndarray:
    """Return the gain of the tracking, which from ``T`` on stays what it came to."""
    return np.maximum.accumulate(limited.value(t, remaining))


def _slope(protocol: TrackingProtocol, g: np.ndarray) -> np.ndarray:
    """Return ``g'``, 0 under a cap."""
    rho1, k = float(protocol.gain.rho1), float(protocol.gain.pole)
    slope = (g - rho1) ** 2 / k
    return slope if protocol.gain_cap is None else np.where(g < float(protocol.gain_cap), slope, 0.0)


def follow(run: Trajectory, protocol: TrackingProtocol, v0: Sequence[Fraction]) -> Trajectory:
    """Return the run of vehicles that track the agents of a run, with their input; see :func:`follow_in_motion`."""
    x, _, u = _followed(run, protocol, v0)
    return replace(run, states=x, held_input=u, conditions=replace(run.conditions, tracking=protocol))


def follow_in_motion(run: Trajectory, protocol: TrackingProtocol, v0: Sequence[Fraction]) -> AgentsTrajectory:
    """Return the run of vehicles that track the agents of a run, with velocities and input.

    Over a step the virtual positions, and ``r/g``, are taken to change evenly with the clock: of second order.

    Parameters
    ----------
    run : Trajectory
        Of the virtual positions, up to ``T``, with its clock.
    protocol : TrackingProtocol
    v0 : sequence of N Fraction
    """
    clocks = run.t, run.remaining, run.clock
    return _motion_of(run.graph, protocol, clocks, _followed(run, protocol, v0), run.rtol)


def _motion_of(
    graph: SignedDigraph,
    protocol: TrackingProtocol,
    clocks: tuple[Any, Any, Any],
    motion: tuple[Any, Any, Any],
    rtol: float,
) -> AgentsTrajectory:
    """Return a run from positions, velocities and inputs, (N, M) each."""
    x, v, u = motion
    tracking: Any = protocol  # nothing of an AgentsProtocol is asked of a run by itself
    moved = np.stack([x, v], axis=1)[:, None]
    return AgentsTrajectory(graph, tracking, *clocks, moved, np.full_like(moved, np.nan), u[:, None], rtol, 0.0)


def _followed(
    run: Trajectory, protocol: TrackingProtocol, v0: Sequence[Fraction]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, velocities and inputs of vehicles, (N, M) each; NaN where the gain is too large to tell."""
    a1, a2, z, s = float(protocol.a1), float(protocol.a2), run.states, run.clock
    limited = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain)
    g = _gain_kept(limited, run.t, run.remaining)
    # At T as just before it, where z is still drawn with the gain it came to.
    acts = limited.value(run.t, run.remaining)
    pulled = np.where(run.t == float(protocol.gain.T), run.input * g / acts, run.input)
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
        u = -a1 * _slope(protocol, g) * (x - z) - a1 * g * (v - pulled) - a2 * g * r
    seen = np.isfinite(u) & ((run.remaining > _NEAREST) | (protocol.gain_cap is not None))
    u, v = np.where(seen, u, np.nan), np.where(seen, v, np.nan)
    if run.targets is not None:  # leaders that move as they like send their own positions
        leading = run.graph.in_weight() == 0
        x[leading], v[leading], u[leading] = z[leading], run.input[leading], 0.0
    return x, v, u


def run_virtual_positions(
    graph: SignedDigraph,
    protocol: Protocol,
    messages: LateMessages,
    x0: Sequence[float],
    leaders: MovingLeaders | None = None,
    **pattern: Any,
) -> Trajectory:
    """Return a run of what vehicles exchange, whose messages are as late as allowed, up to ``T`` or past it.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : Protocol
    messages : LateMessages
        With the vehicles.
    x0 : sequence of N float
    leaders : MovingLeaders, optional
    **pattern : Any
        ``pattern`` and ``seed`` of :func:`ptcc_certify.simulation.late_messages.simulate_late`.

    Raises
    ------
    ParameterError
        Delays are too short for a run.
    """
    if messages.exact and leaders is None:
        actuator = None if messages.gain_cap is None else GainLimits(gain_cap=messages.gain_cap)
        return simulate(graph, protocol, x0, samples=_SAMPLES, actuator=actuator)
    return simulate_late(graph, protocol, messages, x0, leaders=leaders, **pattern)
