"""Trajectories of a coordination protocol, integrated by CasADi's CVODES.

Before the deadline the integrator runs in ``tau = -ln(1 - t/T)``, where the pole of the gain at ``T`` is gone:

    dX/dtau = -(rho1 T e^-tau + rho2 kappa) L X,      t = T (1 - e^-tau)

The state at ``T`` is the limit for ``tau`` to infinity, and from ``T`` on ``X' = -rho1 L X``. A simulation
corroborates a certificate; it proves nothing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError
from ptcc_certify.graphs.io import in_node_order
from ptcc_certify.graphs.rationals import as_fraction, shorten
from ptcc_certify.protocols.disturbance import as_disturbance
from ptcc_certify.protocols.nominal import NominalProtocol, Protocol, SlidingModeProtocol
from ptcc_certify.simulation.cvodes import NominalMotion, interruptible
from ptcc_certify.simulation.filippov import Instants, simulate_sliding
from ptcc_certify.simulation.limited import Actuator, as_forcing, simulate_limited
from ptcc_certify.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact, SignedDigraph

#: How far a run goes past the deadline unless told otherwise, as a share of it.
PAST = 0.25
_PAST_SAMPLES = 5
# 1 - t/T at 0.5 T, 0.9 T, 0.99 T.
_MARKS = (0.5, 0.1, 0.01)


def simulate(
    graph: SignedDigraph,
    protocol: Protocol,
    x0: Any,
    *,
    sigma0: Any = None,
    disturbance: Any = None,
    boundary_layer: float | None = None,
    actuator: Actuator | None = None,
    delta: Exact | None = None,
    noise: Any = None,
    noise_bound: Exact | None = None,
    times: Iterable[Exact] | None = None,
    remaining: float = 1e-8,
    samples: int = 201,
    past: float = PAST,
    rtol: float = 1e-11,
    atol: float = 1e-11,
) -> Trajectory:
    """Integrate the closed loop of a protocol from ``X(0) = x0`` to the deadline and past it.

    The nominal protocol gives ``X' = -gain(t) L X``. The sliding-mode protocol under a disturbance gives the Filippov
    solution: every sliding variable reaches 0 at a root of its own equation and stays there.

    The nominal protocol may act through an :class:`~ptcc_certify.simulation.limited.Actuator`, and under a disturbance
    and measurement noise: ``X' = -gain(t) L (X + n) + d``, the gain being the one that acts.

    Parameters
    ----------
    graph : SignedDigraph
        N agents.
    protocol : NominalProtocol or SlidingModeProtocol
        With ``rho2 = 0`` the run is on the plain clock ``t``, without a deadline.
    x0 : (N,) or (N, S) array of numbers, mapping by label, pandas Series or DataFrame
        The start in the order of ``graph.labels``, or by label where there are labels; S columns are S starts, or the
        S components of vector-valued agents: the protocol acts as ``L kron I_S``, so both evolve alike. Sliding mode:
        one column.
    sigma0 : (N,) array of numbers, mapping by label or pandas Series, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    disturbance : Disturbance, str, number, callable or sequence, optional
        Sliding mode: whatever :func:`ptcc_certify.protocols.disturbance.as_disturbance` takes, such as
        ``"sin(2*k*t)"``; by default the adversary ``d_k = delta sign(sigma_k)``. It is refused where it exceeds
        ``delta``. Nominal protocol: one that reads neither states nor sliding variables, by default none.
    boundary_layer : float, optional
        Sliding mode, for comparison only: integrate ``tanh(sigma/boundary_layer)`` instead of the sign.
    actuator : Actuator, optional
        Nominal protocol: limits of the input; without sampling if there is a disturbance or noise.
    delta : int, float, str or Fraction, optional
        Nominal protocol: the bound of the disturbance, needed with it; in units of the input.
    noise : Disturbance, str, number or sequence, optional
        Nominal protocol: what is added to every measurement, like ``disturbance``; with an actuator that bounds the
        gain.
    noise_bound : int, float, str or Fraction, optional
        The bound of ``noise``, needed with it; in units of the states.
    times : increasing numbers >= 0, optional
        The instants wanted, in units of time. One that a float cannot tell from ``T`` counts as ``T``.
    remaining : float
        Without ``times``: instants uniform in ``tau`` go from ``1 - t/T = 1`` to this; dimensionless.
    samples : int
        Without ``times``: so many of these instants and half as many uniform in t (with ``rho2 = 0``: so many uniform
        in t over [0, T]), and 0.5 T, 0.9 T, 0.99 T, T.
    past : float
        Without ``times``: go on to ``T (1 + past)``; dimensionless.
    rtol, atol : float
        Tolerances of CVODES; ``atol`` is relative to the largest entry of each column of ``x0``, or to ``delta T`` or
        ``noise_bound`` of the nominal protocol if that is larger.

    Returns
    -------
    Trajectory
        A :class:`~ptcc_certify.simulation.trajectory.SlidingTrajectory` under the sliding-mode protocol.

    Raises
    ------
    ParameterError
        ``x0`` has a wrong shape, labels other than those of the nodes or an entry that is not finite, or an option is
        outside its domain.
    SimulationError
        The integrator failed, or a sampled run outgrew floats; the message names the cause.

    References
    ----------
    The networks (2) and (3) under the protocols (4) and (47)-(48) of Zhu et al., Robust prescribed-time coordination
    control of cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.protocols.nominal import NominalProtocol
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1])
    >>> run.final_state.round(9)
    array([ 1., -1.])
    >>> run = simulate(foes, run.protocol, [3, 1], actuator=Actuator(gain_cap=11))  # e^(-2 s_eff(T)) = 0.00018
    >>> run.final_state.round(5)
    array([ 1.00037, -0.99963])
    >>> from ptcc_certify.protocols.nominal import SlidingModeProtocol
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(foes, robust, [3, 1], sigma0=[1, 0], disturbance="sin(9*k*t)")
    >>> run.final_state.round(9), bool((run.reaching_times < 1).all())
    (array([ 0.5, -0.5]), True)
    """
    started = time.perf_counter()
    x0, sigma0 = in_node_order(x0, graph), in_node_order(sigma0, graph, "sigma0")
    start = _start(graph, x0)
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if not 1e-15 <= tolerance <= 0.1:
            raise ParameterError(f"{name} = {tolerance} is outside its domain; {name} must be between 1e-15 and 0.1")
    if isinstance(protocol, SlidingModeProtocol):
        nominal = {"actuator": actuator, "delta": delta, "noise": noise, "noise_bound": noise_bound}
        for name, value in nominal.items():
            if value is not None:
                raise ParameterError(f"{name} belongs to the nominal protocol; leave it out or change the protocol")
        if np.ndim(x0) != 1 or np.ndim(sigma0) > 1:
            raise ParameterError("the sliding mode is simulated from one start at a time; give N numbers x0 and sigma0")
        if boundary_layer is not None and not 1e-12 <= boundary_layer <= 1e12:
            raise ParameterError(f"boundary_layer = {boundary_layer} is outside its domain, 1e-12 to 1e12")
        instants = _sliding_defaults(protocol, remaining, samples, past) if times is None else _sliding(protocol, times)
        source = as_disturbance(
            "adversary" if disturbance is None else disturbance, graph.n_nodes, protocol.delta, float(instants.t[-1])
        )
        with interruptible():
            return simulate_sliding(
                graph,
                protocol,
                start[:, 0],
                np.zeros(graph.n_nodes) if sigma0 is None else _start(graph, sigma0, "sigma0")[:, 0],
                source,
                instants,
                rtol=rtol,
                atol=atol,
                boundary_layer=boundary_layer,
            )
    for name, value in (("sigma0", sigma0), ("boundary_layer", boundary_layer)):
        if value is not None:
            raise ParameterError(f"{name} belongs to the sliding-mode protocol; leave it out or change the protocol")
    t, left = _default_instants(protocol, remaining, samples, past) if times is None else _instants(protocol, times)
    with interruptible():
        forcing = as_forcing(graph, protocol.T, disturbance, delta, noise, noise_bound, float(t[-1]))
        if forcing is not None or (actuator is not None and not actuator.ideal):
            begin = start[:, 0] if np.ndim(x0) == 1 else start
            return simulate_limited(graph, protocol, begin, t, left, actuator, forcing, rtol=rtol, atol=atol)
    scale = np.abs(start).max(axis=0)
    scale[scale == 0] = 1
    gain, T = protocol.gain, float(protocol.T)
    residual = None
    with interruptible():
        run = NominalMotion(graph, start / scale, rtol, atol)
        if protocol.prescribed:
            before = left > 0
            # Whichever of 1 - t/T and t is the small one holds the digits.
            tau = np.where(left > 0.5, gain.tau(t), -np.log(np.where(before, left, 1)))[before]
            parts = [run.sample(float(gain.rho1) * T, float(gain.pole), 1.0, tau)]
            if not before.all():
                residual = run.settle(float(gain.rho1) * T, float(gain.pole), tau[-1] if tau.size else 0.0)
                parts.append(run.sample(0.0, float(gain.rho1) * T, 0.0, np.maximum(t[~before] / T - 1, 0)))
            clock = np.append(gain.clock_at_tau(tau), np.full(t.size - tau.size, np.inf))
            at_deadline = np.flatnonzero((left == 0) & (t == T))
        else:
            parts = [run.sample(0.0, float(gain.rho1) * T, 0.0, t / T)]
            clock = gain.clock(t)
            at_deadline = np.zeros(0, dtype=int)
    states = np.moveaxis(np.concatenate(parts), 0, -1) * scale[:, None]
    return Trajectory(
        graph=graph,
        protocol=protocol,
        t=t,
        remaining=left,
        clock=clock,
        states=states[:, 0] if np.ndim(x0) == 1 else states,
        rtol=rtol,
        atol=atol,
        deadline_index=int(at_deadline[0]) if at_deadline.size else None,
        deadline_residual=residual,
        stats=run.stats | {"seconds": time.perf_counter() - started},
    )


# ---------------------------------------------------------------------- start and instants


def _start(graph: SignedDigraph, x0: Any, name: str = "x0") -> np.ndarray:
    """Return the start as an (N, S) float array."""
    try:
        array = np.asarray(x0)
    except ValueError:
        raise ParameterError(f"the start {name} has rows of different lengths") from None
    n = graph.n_nodes
    if array.ndim not in (1, 2) or array.shape[0] != n or array.size == 0:
        shape = " x ".join(map(str, array.shape)) or "a single number"
        raise ParameterError(f"the start {name} has shape {shape}; give {n} numbers, or {n} rows, one for each agent")
    if array.dtype.kind in "OU":
        try:
            array = np.array([float(as_fraction(v, name)) for v in array.ravel()]).reshape(array.shape)
        except (NumberError, OverflowError) as error:
            raise ParameterError(f"the start {name}: {error}") from None
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"the start {name} holds real numbers, not {array.dtype}")
    array = array.astype(float).reshape(n, -1)
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0]
        raise ParameterError(
            f"the start {name} of agent {shorten(graph.labels[row])} is {array[row, column]}, not a finite number"
        )
    return array


def _default_instants(
    protocol: NominalProtocol, remaining: float, samples: int, past: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, 1 - t/T)."""
    _check_sampling(remaining, samples, past)
    T = float(protocol.T)
    if protocol.prescribed:
        uniform = np.exp(np.linspace(0, math.log(remaining), samples))
        uniform = np.append(uniform, np.linspace(1, uniform[-1], samples // 2))  # for figures in t
    else:
        uniform = np.linspace(1, 0, samples)
    left = np.unique(np.concatenate([uniform, _MARKS, [0.0]]))[::-1]
    later = _later(T, past)
    return np.append(T * (1 - left), later), np.append(left, np.zeros(later.size))


def _instants(protocol: NominalProtocol, times: Iterable[Exact]) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, 1 - t/T) of the instants wanted, the latter from exact rationals."""
    wanted, t = _read_times(times)
    left = np.array([max(0.0, float(1 - value / protocol.T)) for value in wanted])
    left[t == float(protocol.T)] = 0
    return t, left


def _sliding_defaults(protocol: SlidingModeProtocol, remaining: float, samples: int, past: float) -> Instants:
    """Return instants dense towards ``T_r`` and towards ``T``, each on its own clock and evenly in time."""
    _check_sampling(remaining, samples, past)
    T_r, T_s, T = float(protocol.T_r), float(protocol.T_s), float(protocol.T)
    grid = np.exp(np.linspace(0, math.log(remaining), samples))
    grid = np.unique(np.append(grid, np.linspace(1, grid[-1], samples // 2)))[::-1]
    marks = np.array([T * (1 - left) for left in _MARKS])
    early = np.append(grid, 1 - marks[marks < T_r] / T_r)
    before = np.stack([T_r * (1 - early), (T_s + T_r * early) / T, early])
    share = np.append(grid * (T_s / T), [left for left in _MARKS if left < T_s / T])
    share = share[share >= remaining]
    between = np.stack([T * (1 - share), share, np.zeros(share.size)])
    between[0, share == T_s / T] = T_r
    later = np.append(T, _later(T, past))
    after = np.stack([later, np.zeros(later.size), np.zeros(later.size)])
    table = np.concatenate([before, between, after], axis=1)
    table = table[:, np.lexsort((table[0], -table[1], -table[2]))]
    fresh = np.append(True, np.diff(table, axis=1).any(axis=0))
    return Instants(*table[:, fresh])


def _sliding(protocol: SlidingModeProtocol, times: Iterable[Exact]) -> Instants:
    """Return the instants wanted, what is left until ``T`` and ``T_r`` from exact rationals."""
    wanted, t = _read_times(times)
    parts = []
    for deadline in (protocol.T, protocol.T_r):
        left = np.array([max(0.0, float(1 - value / deadline)) for value in wanted])
        left[t == float(deadline)] = 0
        parts.append(left)
    return Instants(t, *parts)


def _check_sampling(remaining: float, samples: int, past: float) -> None:
    if not 1e-300 <= remaining < 1:
        raise ParameterError(f"remaining = {remaining} is outside its domain; it must be between 1e-300 and 1")
    if samples < 2:
        raise ParameterError(f"samples = {samples} is outside its domain; it must be at least 2")
    if not 0 <= past <= 1e6:
        raise ParameterError(f"past = {past} is outside its domain; it must be between 0 and 1e6")


def _later(T: float, past: float) -> np.ndarray:
    return T * (1 + past * np.arange(1, _PAST_SAMPLES + 1) / _PAST_SAMPLES) if past else np.zeros(0)


def _read_times(times: Iterable[Exact]) -> tuple[list[Fraction], np.ndarray]:
    try:
        wanted = [as_fraction(t, "an instant") for t in times]  # type: ignore[arg-type]
        t = np.array([float(value) for value in wanted])
    except (NumberError, TypeError, OverflowError) as error:
        raise ParameterError(f"times: {error}") from None
    if not wanted:
        raise ParameterError("times is empty; give at least one instant")
    if wanted[0] < 0:
        raise ParameterError(f"times starts at {t[0]}; instants must be >= 0")
    for earlier, later in pairwise(wanted):
        if later <= earlier:
            raise ParameterError(f"times is not increasing: {float(later)} follows {float(earlier)}")
    return wanted, t
