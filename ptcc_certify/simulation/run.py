"""Trajectories of a coordination protocol, integrated by CasADi's CVODES.

Before the deadline the integrator runs in ``tau = -ln(1 - t/T)``, where the pole of the gain at ``T`` is gone:

    dX/dtau = -(rho1 T e^-tau + rho2 kappa) L X,      t = T (1 - e^-tau)

The state at ``T`` is the limit for ``tau`` to infinity, and from ``T`` on ``X' = -rho1 L X``. A simulation
corroborates a certificate; it proves nothing.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.io import as_graph, as_states
from ptcc_certify.graphs.rationals import number_within, shorten
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.base import refuse_no_protocol
from ptcc_certify.protocols.disturbance import as_disturbance
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.late_messages import LateMessages
from ptcc_certify.protocols.moving_leaders import MovingLeaders, refuse_together
from ptcc_certify.simulation.cvodes import Tolerances
from ptcc_certify.simulation.filippov import simulate_sliding
from ptcc_certify.simulation.instants import PAST, default_instants, wanted_instants
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.late_messages import Pattern, simulate_late
from ptcc_certify.simulation.nominal import as_forcing, simulate_nominal
from ptcc_certify.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact, SignedDigraph


@gated
def simulate(
    graph: Any,
    protocol: Protocol,
    x0: Any,
    *,
    orientation: str | None = None,
    sigma0: Any = None,
    disturbance: Any = None,
    boundary_layer: float | None = None,
    actuator: GainLimits | None = None,
    delta: Exact | None = None,
    noise: Any = None,
    noise_bound: Exact | None = None,
    messages: LateMessages | None = None,
    leaders: MovingLeaders | None = None,
    pattern: Pattern = "oldest",
    seed: int = 0,
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

    The nominal protocol may act under :class:`~ptcc_certify.protocols.gain_limits.GainLimits`, and under a disturbance
    and measurement noise: ``X' = -gain(t) L (X + n) + d``, the gain being the one that acts.

    Parameters
    ----------
    graph : graph-like
        N agents, in whatever form :func:`ptcc_certify.as_graph` takes.
    protocol : Protocol
        With ``rho2 = 0`` the run is on the plain clock ``t``, without a deadline.
    x0 : state-like, or N rows of S numbers
        The initial state in the order of ``graph.labels``, or by label where there are labels: whatever
        :func:`ptcc_certify.as_state` takes. S > 1 columns are S initial states, or the S components of vector-valued
        agents: the protocol acts as ``L kron I_S``, so both evolve alike. Sliding mode: one column.
    orientation : {"information", "listens"}, optional
        Of an edge, or of the rows of a matrix; see :func:`ptcc_certify.as_graph`.
    sigma0 : state-like, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    disturbance : Disturbance, str, number, callable or sequence, optional
        Sliding mode: whatever :func:`ptcc_certify.protocols.disturbance.as_disturbance` takes, such as
        ``"sin(2*k*t)"``; by default the worst case, ``d_k = delta sign(sigma_k)``. It is refused where it exceeds
        ``delta``. Nominal protocol: one that reads neither states nor sliding variables, by default none.
    boundary_layer : float, optional
        Sliding mode, for comparison only: integrate ``tanh(sigma/boundary_layer)`` instead of the sign.
    actuator : GainLimits, optional
        Nominal protocol: limits of the input; without sampling if there is a disturbance or noise.
    delta : int, float, str or Fraction, optional
        Nominal protocol: the bound of the disturbance, needed with it; in units of the input.
    noise : Disturbance, str, number or sequence, optional
        Nominal protocol: what is added to every measurement, like ``disturbance``; with an actuator that bounds the
        gain.
    noise_bound : int, float, str or Fraction, optional
        The bound of ``noise``, needed with it; in units of the states.
    messages : LateMessages, optional
        The run of :func:`ptcc_certify.simulate_late`, with ``pattern`` and ``seed``, at instants of its own up to
        ``T``; nothing else acts on it, and sliding variables are 0.
    leaders : MovingLeaders, optional
        The run of :func:`ptcc_certify.simulate_tracking`, at instants of its own; nothing else acts on it. With
        ``messages`` that of :func:`ptcc_certify.simulate_late`.
    pattern : {"oldest", "fresh", "varying", "square"}
        Of ``messages``: how old is what agents hear.
    seed : int
        Of what is random in ``pattern``.
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
        A :class:`~ptcc_certify.simulation.trajectory.SlidingTrajectory` where sliding variables are reached first.

    Raises
    ------
    ParameterError
        ``x0`` has a wrong shape, labels other than those of the nodes or an entry that is not finite, or an option is
        outside its domain.
    SimulationError
        The integrator failed, or a sampled run outgrew floats; the message names the cause.

    References
    ----------
    The networks (2) and (3) under the protocols (4) and (47)-(48) of [Zhu]_.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1])
    >>> run.final_state.round(9)
    array([ 1., -1.])
    >>> run = simulate(foes, run.protocol, [3, 1], actuator=GainLimits(gain_cap=11))  # e^(-2 s_eff(T)) = 0.00018
    >>> run.final_state.round(5)
    array([ 1.00037, -0.99963])
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(foes, robust, [3, 1], sigma0=[1, 0], disturbance="sin(9*k*t)")
    >>> run.final_state.round(9), bool((run.reaching_times < 1).all())
    (array([ 0.5, -0.5]), True)
    """
    begin = time.perf_counter()
    graph = as_graph(graph, orientation)
    refuse_no_protocol(protocol)
    if messages is not None or leaders is not None:
        beside = {"boundary_layer": boundary_layer, "delta": delta, "noise": noise, "noise_bound": noise_bound}
        beside |= {"disturbance": disturbance, "actuator": actuator, "times": times}
        _refuse_beside(graph, messages, leaders, sigma0, beside)
        if messages is not None:
            return simulate_late(graph, protocol, messages, x0, pattern=pattern, seed=seed, leaders=leaders)
        assert leaders is not None
        from ptcc_certify.simulation.moving_leaders import simulate_tracking  # it loads SciPy

        return simulate_tracking(graph, protocol, leaders, x0)
    initial_state = _floats(x0, graph, "x0")
    manifold = None if sigma0 is None else _floats(sigma0, graph, "sigma0")
    tolerances = Tolerances.within(rtol, atol)
    other = "sliding-mode"
    foreign: dict[str, Any] = {"sigma0": manifold, "boundary_layer": boundary_layer}
    if protocol.reaching is not None:
        other, foreign = "nominal", {"actuator": actuator, "delta": delta, "noise": noise, "noise_bound": noise_bound}
    for name, value in foreign.items():
        if value is not None:
            raise ParameterError(name, f"belongs to the {other} protocol; leave it out or change the protocol")
    if protocol.reaching is not None and (initial_state.ndim > 1 or (manifold is not None and manifold.ndim > 1)):
        raise ParameterError(
            "the sliding mode is simulated from one initial state at a time; give N numbers x0 and sigma0"
        )
    if actuator is not None and not isinstance(actuator, GainLimits):
        raise ParameterError("actuator", f"= {shorten(repr(actuator))} is none; give GainLimits(gain_cap=50), say")
    if boundary_layer is not None:
        boundary_layer = number_within(boundary_layer, "boundary_layer", 1e-12, 1e12)
    if times is None:
        instants = default_instants(protocol, remaining, samples, past)
    else:
        instants = wanted_instants(protocol, times)
    until = float(instants.t[-1])
    with interruptible():
        if (sliding := protocol.reaching) is not None:
            source = "worst-case" if disturbance is None else disturbance
            signal = as_disturbance(source, graph.n_nodes, sliding.delta, until)
            manifold = np.zeros(graph.n_nodes) if manifold is None else manifold
            run: Trajectory = simulate_sliding(
                graph, sliding, initial_state, manifold, signal, instants, tolerances, boundary_layer
            )
        else:
            forcing = as_forcing(graph, protocol.T, disturbance, delta, noise, noise_bound, until)
            run = simulate_nominal(graph, protocol, initial_state, instants, actuator, forcing, tolerances)
    return replace(run, stats=dict(run.stats) | {"seconds": time.perf_counter() - begin})


def simulate_formation(graph: Any, protocol: Protocol, x0: Any, offsets: Any, **options: Any) -> Trajectory:
    """Run single integrators in a formation: less their places they move as they do without.

    Parameters
    ----------
    graph, protocol, x0, **options
        As for :func:`simulate`; ``x0`` is where agents begin.
    offsets : state-like
        Their places.

    Returns
    -------
    Trajectory
        Its ``positions`` are where agents are, its ``states`` less their places.

    Examples
    --------
    >>> from ptcc_certify.simulation.run import simulate_formation
    >>> team = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    >>> run = simulate_formation(team, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], [0, 5], times=[0, 1])
    >>> run.positions.round(9)
    array([[ 3. , -0.5],
           [ 1. ,  4.5]])
    """
    graph = as_graph(graph, options.pop("orientation", None))
    rows, places = as_states(x0, graph, "x0"), as_states(offsets, graph, "offsets")
    if len(rows[0]) != len(places[0]):
        raise ParameterError("offsets", f"has {len(places[0])} numbers for each agent, x0 has {len(rows[0])}")
    less = [[x - h for x, h in zip(*pair, strict=True)] for pair in zip(rows, places, strict=True)]
    return replace(simulate(graph, protocol, less, **options), offsets=_floats(places, graph, "offsets"))


def _refuse_beside(
    graph: SignedDigraph,
    messages: LateMessages | None,
    leaders: MovingLeaders | None,
    sigma0: Any,
    beside: Mapping[str, Any],
) -> None:
    """Refuse what is not simulated beside late messages or moving leaders."""
    refuse_together(messages, leaders)
    name = "late messages" if messages is not None else "leaders that move"
    for what, value in beside.items():
        if value is not None:
            mend = (
                "; give LateMessages(gain_cap=..)" if what == "actuator" and messages is not None else "; leave it out"
            )
            raise ParameterError(f"{what}: is not simulated with {name}{mend}")
    if sigma0 is not None and _floats(sigma0, graph, "sigma0").any():
        raise ParameterError("sigma0", f"{name} ask for sigma(0) = 0, so that no sliding variable moves; leave it out")


def _floats(values: Any, graph: SignedDigraph, name: str) -> np.ndarray:
    """Return a state as an (N,) array, N rows of S > 1 numbers as an (N, S) array."""
    states = np.array([[float(x) for x in row] for row in as_states(values, graph, name)])
    return states if states.shape[1] > 1 else states[:, 0]
