"""Trajectories of a coordination protocol, integrated by CasADi's CVODES.

Before the deadline the integrator runs on the stretched clock, where the pole of the gain at ``T`` is gone,

    dX/ds = -L(s) X,

from switch to switch of the signal that chooses ``L``; that of one graph is constant. The state at ``T`` is the limit
for ``s`` to infinity, and from ``T`` on ``X' = -rho1 L X``. A simulation corroborates a certificate; it proves nothing.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypedDict, Unpack

import numpy as np

from ptcc_certify.errors import ParameterError, gated, unknown_parameter
from ptcc_certify.graphs.digraph import Exact, SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_family, as_graph, as_states
from ptcc_certify.graphs.io.conversion import is_family
from ptcc_certify.graphs.rationals import number_within, shorten
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.base import refuse_no_protocol
from ptcc_certify.model.disturbance import StateDependent, as_disturbance
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders, told_leaders
from ptcc_certify.model.refusals import refuse_together
from ptcc_certify.simulation.cvodes import Motion, Tolerances
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.late_messages import simulate_late
from ptcc_certify.simulation.member_laplacians import Choice, Members
from ptcc_certify.simulation.moving_leaders import simulate_tracking
from ptcc_certify.simulation.nominal import (
    PAST,
    Bounded,
    as_forcing,
    default_instants,
    sample,
    sample_and_hold,
    wanted_instants,
)
from ptcc_certify.simulation.sliding import SlidingMotion, rounding_slack
from ptcc_certify.simulation.switching_signals import ConstantSignal, Course, Signal, as_signal
from ptcc_certify.simulation.trajectory import RESOLVED, Conditions, Played, Setup, Trajectory


class RunOptions(TypedDict, total=False):
    """What drives a run beside its graph, where it is sampled, and how it is integrated.

    Attributes
    ----------
    sigma0 : state-like
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    disturbance : Disturbance, str, number, callable or sequence
        Sliding mode: whatever :func:`ptcc_certify.model.disturbance.as_disturbance` takes, such as
        ``"sin(2*k*t)"``; by default the worst case, ``d_k = delta sign(sigma_k)``. It is refused where it exceeds
        ``delta``, and of families where it reads the states. Nominal protocol: :class:`Bounded`, one that reads neither
        states nor sliding variables; by default none.
    noise : Bounded
        Nominal protocol: what is added to every measurement, with an actuator that bounds the gain.
    times : increasing numbers >= 0
        The instants wanted, in units of time. One that a float cannot tell from ``T`` counts as ``T``.
    remaining : float
        Without ``times``: instants uniform in ``tau`` go from ``1 - t/T = 1`` to this, 1e-8 by default; dimensionless.
    samples : int
        Without ``times``: so many of these instants, 201 by default, and half as many uniform in t (with ``rho2 = 0``:
        so many uniform in t over [0, T]), and 0.5 T, 0.9 T, 0.99 T, T.
    past : float
        Without ``times``: go on to ``T (1 + past)``, by default a quarter of ``T``; dimensionless.
    rtol, atol : float
        Tolerances of CVODES, 1e-11 by default; ``atol`` is relative to the largest entry of each column of ``x0``, or
        to the bound of the disturbance times ``T`` or of the noise under the nominal protocol if that is larger.
    boundary_layer : float
        Sliding mode, for comparison only: integrate ``tanh(sigma/boundary_layer)`` instead of the sign.
    """

    sigma0: Any
    disturbance: Any
    noise: Bounded | None
    times: Iterable[Exact] | None
    remaining: float
    samples: int
    past: float
    rtol: float
    atol: float
    boundary_layer: float | None


_DEFAULTS: dict[str, Any] = dict.fromkeys(("sigma0", "disturbance", "noise", "times", "boundary_layer"))
_DEFAULTS |= {"remaining": 1e-8, "samples": 201, "past": PAST, "rtol": 1e-11, "atol": 1e-11}


@gated
def simulate(
    graph: Any,
    protocol: Protocol,
    x0: Any,
    signal: Any = None,
    *,
    actuator: GainLimits | None = None,
    messages: LateMessages | None = None,
    leaders: MovingLeaders | None = None,
    **options: Unpack[RunOptions],
) -> Trajectory:
    """Integrate the closed loop of a protocol from ``X(0) = x0`` to the deadline and past it.

    The nominal protocol gives ``X' = -gain(t) L X``. The sliding-mode protocol under a disturbance gives the Filippov
    solution: every sliding variable reaches 0 at a root of its own equation and stays there.

    The nominal protocol may act under :class:`~ptcc_certify.model.asks.GainLimits`, and under a disturbance
    and measurement noise: ``X' = -gain(t) L (X + n) + d``, the gain being the one that acts.

    Parameters
    ----------
    graph : graph-like or family-like
        N agents, in whatever form :func:`ptcc_certify.as_graph` takes; or a family of graphs, as
        :func:`ptcc_certify.as_family` takes it: graphs by name, edges with intervals. What is one graph is a family,
        too, where a signal is given.
    protocol : Protocol
        With ``rho2 = 0`` the run is on the plain clock ``t``, without a deadline.
    x0 : state-like, or N rows of S numbers
        The initial state in the order of ``graph.labels``, or by label where there are labels: whatever
        :func:`ptcc_certify.as_state` takes. S > 1 columns are S initial states, or the S components of vector-valued
        agents: the protocol acts as ``L kron I_S``, so both evolve alike. Sliding mode, families: one column.
    signal : Signal, str, path, file object or sequence of rows, optional
        Of a family: ``"random"``, the default, ``"worst-case"``, ``"constant"``, a table of instants and modes, or a
        :class:`~ptcc_certify.simulation.switching_signals.Signal`: see
        :func:`~ptcc_certify.simulation.switching_signals.as_signal`.
        ``X' = -gain(t) L(t) X``, the signal choosing ``L(t)``. With ``messages`` how old is what agents hear: a pattern
        of :func:`ptcc_certify.simulate_late`, or that and a seed, ``("varying", 3)``.
    actuator : GainLimits, optional
        Nominal protocol: limits of the input; without sampling if there is a disturbance or noise.
    messages : LateMessages, optional
        The run of :func:`ptcc_certify.simulate_late`, at instants of its own up to ``T``; nothing else acts on it, and
        sliding variables are 0.
    leaders : MovingLeaders, optional
        The run of :func:`ptcc_certify.simulate_tracking`, at instants of its own; nothing else acts on it. With
        ``messages`` that of :func:`ptcc_certify.simulate_late`.
    **options : RunOptions
        What drives the run: ``sigma0``, ``disturbance``, ``noise``; where it is sampled, and how it is integrated:
        ``times``, ``remaining``, ``samples``, ``past``, ``rtol``, ``atol``, ``boundary_layer``, see
        :class:`RunOptions`.

    Returns
    -------
    Trajectory
        With its ``sliding`` variables under the sliding-mode protocol, of families with the members ``played``.

    Raises
    ------
    ParameterError
        ``x0`` has a wrong shape, labels other than those of the nodes or an entry that is not finite, or an option is
        outside its domain.
    SimulationError
        The integrator failed, a signal switches too often, or a sampled run outgrew floats; the message names the
        cause.

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
    >>> unsure = [("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")]
    >>> run = simulate(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2], "worst-case")
    >>> run.signal, run.deadline_resolved, run.final_state.round(9) + 0
    ('worst case', True, array([0., 0.]))
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(foes, robust, [3, 1], sigma0=[1, 0], disturbance="sin(9*k*t)")
    >>> run.final_state.round(9), bool((run.sliding.reaching_times < 1).all())
    (array([ 0.5, -0.5]), True)
    """
    refuse_no_protocol(protocol)
    how, beside = _with_defaults(options), messages is not None or leaders is not None
    if isinstance(messages, LateMessages):
        leaders = told_leaders(messages, leaders)
        if messages.tracks and actuator is None:  # nothing is late of what is heard
            actuator = None if messages.gain_cap is None else GainLimits(gain_cap=messages.gain_cap)
            messages = None
    family = as_family(graph) if not beside and (signal is not None or is_family(graph)) else None
    one = as_graph(graph) if family is None else family.modes[0].mandatory
    sigma0, disturbance, layer = how["sigma0"], how["disturbance"], how["boundary_layer"]
    only: dict[str, Any] = {"actuator": actuator, "noise": how["noise"], "boundary_layer": layer}
    if beside:
        foreign = only | {"disturbance": disturbance, "times": how["times"]}
        foreign |= {} if messages is not None else {"signal": signal, "actuator": None}
        _refuse_beside(one, messages, leaders, sigma0, foreign)
        if messages is not None:
            return simulate_late(one, protocol, messages, x0, pattern=signal or "oldest", leaders=leaders)
        assert leaders is not None
        return simulate_tracking(one, protocol, leaders, x0, gain_cap=_cap_alone(actuator))
    initial_state, tolerances = _floats(x0, one, "x0"), Tolerances.within(how["rtol"], how["atol"])
    manifold = None if sigma0 is None else _floats(sigma0, one, "sigma0")
    _refuse_foreign(protocol, family, only | {"sigma0": sigma0, "disturbance": disturbance})
    if (protocol.reaching or family) and any(x is not None and x.ndim > 1 for x in (initial_state, manifold)):
        who = "families run" if family else "the sliding mode is simulated"
        raise ParameterError(f"{who} from one initial state at a time; give N numbers x0 and sigma0")
    if actuator is not None and not isinstance(actuator, GainLimits):
        raise ParameterError("actuator", f"= {shorten(repr(actuator))} is none; give GainLimits(gain_cap=50), say")
    if how["times"] is None:
        driven = protocol.reaching is not None or disturbance is not None or how["noise"] is not None
        instants = default_instants(protocol, how["remaining"], how["samples"], how["past"], driven=driven)
    else:
        instants = wanted_instants(protocol, how["times"])
    played = ConstantSignal() if family is None else as_signal("random" if signal is None else signal)
    limits = None if actuator is None or actuator.ideal else actuator
    run = _Run(one, protocol, instants, Conditions(limits), family=family, signal=played, tolerances=tolerances)
    with interruptible():
        if protocol.reaching is None:
            return run.nominal(initial_state, disturbance, how["noise"])
        manifold = np.zeros(one.n_nodes) if manifold is None else manifold
        return run.sliding(initial_state, manifold, disturbance, layer)


@dataclass(frozen=True)
class _Run(Setup):
    """A graph, or a family under a signal, under a protocol."""

    family: Family | None = None
    signal: Signal = field(kw_only=True)
    tolerances: Tolerances = field(kw_only=True)

    @property
    def goal(self) -> float:
        """Of the residual at ``T``."""
        return RESOLVED / 10 * max(self.tolerances)

    def members(self) -> Members:
        return Members(self.graph if self.family is None else self.family)

    def course(self, motion: Motion) -> Course:
        return Course(motion, lambda state: self.signal.play(motion.members, self.protocol.gain, state))

    def nominal(self, x: np.ndarray, disturbance: Any, noise: Any) -> Trajectory:
        """Return the run under the nominal protocol, whose gain may be limited, with what drives the agents."""
        t, remaining, _ = self.instants
        until = float(t[-1])
        forcing = as_forcing(self.graph, self.protocol.T, disturbance, noise, until) if self.family is None else None
        held = self.gain.limits.sample_period is not None
        if forcing is not None and held:
            raise ParameterError("a run with a sample period takes no disturbance and no noise; leave one of them out")
        if forcing is not None and forcing.noisy and not self.gain.bounded:
            mend = "give a gain cap or stop before T"
            raise ParameterError(f"noise times a gain that becomes infinite at T is no input; {mend}")
        columns = x.reshape(self.graph.n_nodes, -1)
        unit = np.maximum(np.abs(columns).max(axis=0), forcing.size if forcing else 0.0)
        unit[unit == 0] = 1
        motion = Motion(self.members(), columns / unit, self.tolerances, forcing, unit)
        inputs, residual, course = None, None, self.course(motion)
        if held:
            periods = self.gain.periods(until)
            states, inputs = sample_and_hold(self.graph, periods, motion.state, t)
            motion.stats["steps"] = int(periods.locate(t[-1:])[0][0])
        elif forcing is None:
            states, residual = self.on_the_clock(course, self.clock)
        else:
            states, residual = sample(motion, self.gain, self.instants, course, self.goal)
        late = np.flatnonzero(remaining == 0)
        if residual is None and self.protocol.prescribed and late.size:
            residual = motion.members.imbalance(states[late[0]], Choice(0) if self.family is None else None)

        def restore(values: np.ndarray) -> np.ndarray:
            return (np.moveaxis(values, 0, -1) * unit[:, None]).reshape(*x.shape, t.size)

        more: dict[str, Any] = {"held_input": None if inputs is None else restore(inputs)}
        met = self if forcing is None else replace(self, conditions=replace(self.conditions, forcing=forcing.text))
        return met.result(course, restore(states), residual, **more)

    def sliding(self, x: np.ndarray, sigma0: np.ndarray, disturbance: Any, layer: float | None) -> Trajectory:
        """Return the run under the sliding-mode protocol, the Filippov solution or its imitation."""
        protocol, t = self.protocol.reaching, self.instants.t
        assert protocol is not None
        source, until = "worst-case" if disturbance is None else disturbance, float(t[-1])
        if isinstance(disturbance, Bounded):
            raise ParameterError("disturbance", "the sliding-mode protocol has its bound, delta; give the signal alone")
        met = as_disturbance(source, self.graph.n_nodes, protocol.delta, until)
        if self.family is not None and isinstance(met, StateDependent):
            raise ParameterError("families take no disturbance that reads the states; give one of time")
        bounded_by = met.check(protocol.delta, self.graph.labels, until, rounding_slack(protocol))
        layer = None if layer is None else number_within(layer, "boundary_layer", 1e-12, 1e12)
        motion = SlidingMotion(self.members(), protocol, met, (x, sigma0), self.tolerances, layer)
        course = self.course(motion)
        if layer is not None:
            states, residual = motion.imitation(self.instants)
        else:
            later, states = motion.reach(course, self.instants.z)
            nominal, residual = self.on_the_clock(course, self.clock[later], t[later])
            states[later, :, 0] = nominal[:, :, 0]
        y, sigma = states.T * motion.unit
        part = motion.part(self.instants, y + sigma, sigma, bounded_by)
        return self.result(course, y + sigma, residual, sliding=part)

    def on_the_clock(
        self, course: Course, clock: np.ndarray, t: np.ndarray | None = None
    ) -> tuple[np.ndarray, float | None]:
        """Return the (M, N, S) states where nothing but the graph acts, and the residual at ``T`` if it is a pole."""
        before, t = np.isfinite(clock), self.instants.t if t is None else t
        states = [np.empty((0, *course.motion.state.shape))]
        if before.any():
            states.append(course.sample(clock[before], float(clock[before][-1])))
        residual = None
        if not before.all():
            residual = course.settle(self.goal)
            T, rho1 = float(self.protocol.T), float(self.protocol.gain.rho1)
            changes = self.signal.past(course.motion.members, T)
            states.append(course.past(t[~before], T, rho1, changes))
        return np.concatenate(states), residual

    def result(self, course: Course, states: np.ndarray, residual: float | None, **more: Any) -> Trajectory:
        """Return what was run, with the members that acted."""
        played = None
        if self.family is not None:
            acted = tuple(course.choices), np.array(course.switches), np.array(course.acting, dtype=np.int64)
            played = Played(self.family, self.signal.text, *acted)
        return self.trajectory(states, self.tolerances, residual, course.motion.stats, played=played, **more)


def _with_defaults(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return all options of a run, or refuse a keyword that is none of them."""
    for name in given:
        if name not in _DEFAULTS:
            parameters = [*inspect.signature(simulate).parameters][:-1]
            raise ParameterError(unknown_parameter("simulate", name, [*parameters, *_DEFAULTS]))
    return {**_DEFAULTS, **given}


def _refuse_foreign(protocol: Protocol, family: Family | None, given: Mapping[str, Any]) -> None:
    """Refuse what belongs to the other protocol, or is of one graph alone."""
    of_nominal, of_sliding = ("actuator", "noise"), ("sigma0", "boundary_layer", "disturbance")
    forced_nominal = isinstance(given["disturbance"], Bounded) and family is None
    for name in of_nominal if protocol.reaching is not None else of_sliding:
        if given[name] is not None and not (name == "disturbance" and forced_nominal):
            other = "nominal" if name in of_nominal else "sliding-mode"
            mend = "leave it out or change the protocol"
            if name == "disturbance" and family is None:
                mend = "under the nominal protocol give Bounded(disturbance, delta)"
            raise ParameterError(name, f"belongs to the {other} protocol; {mend}")
    for name in (*of_nominal, "boundary_layer") if family is not None else ():
        if given[name] is not None:
            raise ParameterError(f"{name} is not simulated of families yet; leave it out")


def _cap_alone(actuator: GainLimits | None) -> Fraction | None:
    """Return the cap of limits that are no more than that."""
    if actuator is None or (actuator.stop_before is None and actuator.sample_period is None):
        return None if actuator is None else actuator.gain_cap
    raise ParameterError("actuator: leaders that move are simulated under a cap of the gain alone; leave the rest out")


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
