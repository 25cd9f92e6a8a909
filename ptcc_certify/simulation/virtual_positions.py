"""Runs of vehicles that exchange virtual positions: by CVODES, or after a run of the virtual ones.

In ``w_1 = x'/g``, ``w_2 = x''/g^2`` on the clock ``tau = -ln(1 - t/T)`` nothing has a pole: with ``h = g (T - t)`` and
``theta = g'/g^2``, ``dx/dtau = h w_1``, ``dz/dtau = h e``, ``dw_i/dtau = h (w_(i+1) - i theta w_i)``, in which the last
``w_n = u/g^n`` is the input with ``theta`` for ``g'``, 1 for ``g`` and ``e`` for ``z'``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.virtual_positions import Vehicles, tracking_input
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
    """``x``, ``w_1``, .. and ``z`` of every agent, on one stretch of time after the other."""

    moved = 1

    def __init__(self, graph: SignedDigraph, state: np.ndarray, of: TrackingProtocol, rtol: float, push: float = 0.0):
        super().__init__(graph, state, rtol)
        self._gains, self._orders = [float(a) for a in of.gains], np.array(of.orders or (2,) * graph.n_nodes)
        self._push = push

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return the slope of positions, scaled velocities and virtual positions on the clock of the phase."""
        import casadi as ca

        R, last = phase.rate(z, ca.exp), x.shape[1] - 1
        h, theta, virtual = phase.nominal(R), phase.shrinking(R), x[:, last]
        e, own = -self._product(virtual), [x[:, i] for i in range(last)]
        slopes = [ca.MX(x.shape[0], 1) for _ in own]
        for n in np.unique(self._orders).tolist():
            of = ca.DM((self._orders == n).astype(float))
            pushed = tracking_input(self._gains, own[:n], virtual, e, 1.0, theta)
            if self._push and n > 1:
                pushed = pushed + self._push * (R / h) ** n
            for i, rising in enumerate([*own[1:n], pushed]):
                slopes[i] += of * (rising - i * theta * own[i])
        return h * ca.horzcat(*slopes, e)


def simulate_vehicles(
    graph: SignedDigraph,
    protocol: TrackingProtocol,
    x0: Sequence[float],
    vehicles: Vehicles,
    *,
    remaining: float = 1e-6,
    samples: int = 101,
    steps: int | None = None,
    rtol: float = 1e-10,
) -> AgentsTrajectory:
    """Integrate vehicles that exchange virtual positions, which are heard at once, to the deadline.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : TrackingProtocol
    x0 : sequence of N float
    vehicles : Vehicles
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
    >>> protocol = TrackingProtocol(Gain(T=1, rho1=1, rho2=2, kappa=2), (Fraction(4), Fraction(4)))
    >>> vehicles = Vehicles((Fraction(0), Fraction(5)), (2, 2))
    >>> run = simulate_vehicles(SignedDigraph.from_edges([(1, 2, 1)]), protocol, [1, 0], vehicles)
    >>> run.positions[:, 0, -1].round(4)
    array([1., 1.])
    """
    n = max(vehicles.orders)
    if (n + 1) * graph.n_nodes > MOST_STATES:
        raise ParameterError(f"more than {MOST_STATES} numbers to integrate; simulate fewer agents")
    limited = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain)
    instants = instants_left(protocol.gain, remaining, samples, steps)
    if protocol.gain_cap is None:  # at T itself the gain is infinite
        instants = Instants(*(values[:-1] for values in instants))
    g = _gain_kept(limited, instants.t, instants.remaining)
    begun = [np.array([float(x) for x in values]) for values in (vehicles.v0, vehicles.a0 or ())]
    first = [np.asarray(x0, dtype=float), *(begun[i - 1] / g[0] ** i for i in range(1, n)), np.asarray(x0, dtype=float)]
    motion_of = _Tracking(graph, np.array(first).T, protocol, rtol, float(vehicles.disturbance))
    states, _ = sample(motion_of, limited, instants)
    *own, z = states.transpose(2, 1, 0)
    motion = [w * g**i for i, w in enumerate(own)]
    moved, slope = -g * (graph.laplacian() @ z), _slope(protocol, g)
    u = np.empty_like(z)
    for order in set(vehicles.orders):
        of = np.array(vehicles.orders) == order
        each = [part[of] for part in motion[:order]]
        u[of] = tracking_input([float(a) for a in protocol.gains], each, z[of], moved[of], g, slope)
    clock = limited.clock(instants.t, instants.remaining)
    return _motion_of(graph, protocol, (instants.t, instants.remaining, clock), (*_told(vehicles, motion, u), u), rtol)


def _gain_kept(limited: LimitedGain, t: np.ndarray, remaining: np.ndarray) -> np.ndarray:
    """Return the gain of the tracking, which from ``T`` on stays what it came to."""
    return np.maximum.accumulate(limited.value(t, remaining))


def _slope(protocol: TrackingProtocol, g: np.ndarray) -> np.ndarray:
    """Return ``g'``, 0 under a cap."""
    rho1, k = float(protocol.gain.rho1), float(protocol.gain.pole)
    slope = (g - rho1) ** 2 / k
    return slope if protocol.gain_cap is None else np.where(g < float(protocol.gain_cap), slope, 0.0)


def _told(vehicles: Vehicles, motion: Sequence[np.ndarray], u: np.ndarray) -> list[np.ndarray]:
    """Return positions, velocities and so on: the input of those of lower order, and beyond that NaN."""
    orders = np.array(vehicles.orders)[:, None]
    return [np.where(orders > i, part, np.where(orders == i, u, np.nan)) for i, part in enumerate(motion)]


def follow(run: Trajectory, protocol: TrackingProtocol, vehicles: Vehicles) -> Trajectory:
    """Return the run of vehicles that track the agents of a run, with their input; see :func:`follow_in_motion`."""
    x, *_, u = _followed(run, protocol, vehicles)
    return replace(run, states=x, held_input=u, conditions=replace(run.conditions, tracking=protocol))


def follow_in_motion(run: Trajectory, protocol: TrackingProtocol, vehicles: Vehicles) -> AgentsTrajectory:
    """Return the run of vehicles that track the agents of a run, with velocities and input.

    Over a step the virtual positions, and ``r/g``, are taken to change evenly with the clock: of second order.

    Parameters
    ----------
    run : Trajectory
        Of the virtual positions, up to ``T``, with its clock.
    protocol : TrackingProtocol
    vehicles : Vehicles
    """
    clocks = run.t, run.remaining, run.clock
    return _motion_of(run.graph, protocol, clocks, _followed(run, protocol, vehicles), run.rtol)


def _motion_of(
    graph: SignedDigraph,
    protocol: TrackingProtocol,
    clocks: tuple[Any, Any, Any],
    motion: Sequence[np.ndarray],
    rtol: float,
) -> AgentsTrajectory:
    """Return a run from positions, velocities and so on and inputs, (N, M) each."""
    *own, u = motion
    tracking: Any = protocol  # nothing of an AgentsProtocol is asked of a run by itself
    moved = np.stack(own, axis=1)[:, None]
    return AgentsTrajectory(graph, tracking, *clocks, moved, np.full_like(moved, np.nan), u[:, None], rtol, 0.0)


def _followed(run: Trajectory, protocol: TrackingProtocol, vehicles: Vehicles) -> list[np.ndarray]:
    """Return positions, velocities and so on and inputs of vehicles, (N, M) each; NaN where the gain is too large."""
    z, s, gains = run.states, run.clock, [float(a) for a in protocol.gains]
    limited, orders = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain), np.array(vehicles.orders)
    g = _gain_kept(limited, run.t, run.remaining)
    slope = _slope(protocol, g)
    # At T as just before it, where z is still drawn with the gain it came to.
    acts = limited.value(run.t, run.remaining)
    pulled = np.where(run.t == float(protocol.gain.T), run.input * g / acts, run.input)
    begun = [np.array([float(x) for x in values])[:, None] for values in (vehicles.v0, vehicles.a0 or vehicles.v0)]
    motion = [z.copy(), *(np.full_like(z, np.nan) for _ in range(max(orders) - 1))]
    u = np.where(orders[:, None] == 1, pulled, np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        for n in set(vehicles.orders) - {1}:
            of, (a1, a2) = orders == n, gains[:2]
            v0, a0 = (values[of] for values in begun)
            last = v0 if n == 2 else a0 + (a1 + a2) * g[0] * v0
            r = last * np.exp(-gains[n - 1] * s) + float(vehicles.disturbance) * _steady_push(run.t, gains[n - 1] * s)
            ahead = np.where(np.isfinite(g), r / g ** (n - 1), 0.0)  # y_n
            A, start = np.full((s.size, n - 1, n - 1), -a1), np.zeros((n - 1, len(v0)))
            if n == 3:
                theta = np.nan_to_num(slope / g**2, nan=0.0)
                A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = a1, theta, -a2 - theta
                start[1] = v0[:, 0] / (a1 * g[0])
            off = _filtered(z[of], ahead / math.prod(gains[: n - 1]), s, start, (A[1:] + A[:-1]) / 2)
            first, second = off[0], ahead if n == 2 else a1 * off[1]
            own = [z[of] + first, g * (second - a1 * first)]
            if n == 3:
                own.append(g**2 * (ahead - (a1 + a2) * second + a1**2 * first))
            for part, value in zip(motion, own, strict=False):
                part[of] = value
            u[of] = tracking_input(gains, own, z[of], pulled[of], g, slope)
    seen = np.isfinite(u) & ((run.remaining > _NEAREST) | (protocol.gain_cap is not None))
    u = np.where(seen, u, np.nan)
    told = _told(vehicles, motion, u)
    told[1:] = [np.where(seen, part, np.nan) for part in told[1:]]
    if run.targets is not None:  # leaders that move as they like send their own positions
        leading = run.graph.in_weight() == 0
        for part, value in zip((*told, u), (z, run.input, 0 * z), strict=False):
            part[leading] = value[leading]
        u[leading] = 0.0
    return [*told, u]


def _steady_push(t: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return ``int_0^t e^(s(r) - s(t)) dr`` at instants, (M,): what a steady push of 1 makes of ``r_n``."""
    pushed = np.zeros(t.size)
    for i, (time, way) in enumerate(zip(np.diff(t), np.diff(s), strict=True)):
        mean = -math.expm1(-way) / way if 0 < way < math.inf else float(way == 0)
        pushed[i + 1] = pushed[i] * math.exp(-way) + time * mean
    return pushed


def _filtered(z: np.ndarray, ahead: np.ndarray, s: np.ndarray, start: np.ndarray, A: np.ndarray) -> np.ndarray:
    """Return ``q_i - z`` of the filters by which vehicles follow ``z``, (n - 1, N, M).

    Over a step ``z`` is taken to change evenly with the clock, and the rest to be what it is on the mean.

    Parameters
    ----------
    z, ahead : (N, M) arrays
        Virtual positions, and ``q_n - z``.
    s : (M,) array
        The clock.
    start : (n - 1, N) array
    A : (M - 1, n - 1, n - 1) array
        Of every step: the slope of the filters per unit of the clock; each row sum is the weight of ``q_n``, negated.
    """
    from scipy.linalg import expm

    ways, off = np.diff(s), np.zeros((len(start), *z.shape))
    off[:, :, 0] = start
    finite = np.isfinite(ways)
    E = expm(A * np.where(finite, ways, 0.0)[:, None, None])
    weights = -A.sum(axis=2)
    for i in np.flatnonzero(finite):
        off[:, :, i + 1] = off[:, :, i]
        if ways[i] > 0:
            drawn = np.outer(weights[i], (ahead[:, i] + ahead[:, i + 1]) / 2) - (z[:, i + 1] - z[:, i]) / ways[i]
            off[:, :, i + 1] = E[i] @ off[:, :, i] + np.linalg.solve(A[i], (E[i] - np.eye(len(start))) @ drawn)
    return off


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
