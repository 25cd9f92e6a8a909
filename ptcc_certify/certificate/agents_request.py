"""What is asked of agents of order n, read and refused where it does not fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.agents.each_agent import States
from ptcc_certify.bounds.agents.formation import GroupDrift, drift_until_deadline, formation_of_biases
from ptcc_certify.checker.input_formulas import InitialSet, root_above
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_family, as_graph
from ptcc_certify.graphs.io.conversion import is_family
from ptcc_certify.graphs.io.states import as_states, draw_states
from ptcc_certify.graphs.rationals import shorten, writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.model.agents import DERIVATIVES, MOST_DIMENSION, MOST_TRACKING, PLURALS, Agents
from ptcc_certify.model.asks import Case, InitialState
from ptcc_certify.model.gain import Gain
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.parameters import parameter, readable
from ptcc_certify.model.refusals import (
    NOT_LATE,
    asked_of_single_integrators,
    refuse_agents,
    refuse_beside_virtual_positions,
)
from ptcc_certify.model.virtual_positions import Vehicles, one_cap


class Chains(NamedTuple):
    """Position, velocity and so on of every agent in every coordinate, the dimension of space, places, and remarks."""

    states: States | None
    dimension: int
    offsets: tuple[tuple[Fraction, ...], ...]
    notes: tuple[str, ...] = ()


class Formation(NamedTuple):
    """Single integrators on a line: the initial state less the places ``h``, these, and limits of the gain."""

    initial_state: list[Fraction] | None
    offsets: tuple[Fraction, ...]
    limits: tuple[Any, ...]

    def case_of(self, case: Case) -> Case:
        """Return the case of the agents less their places."""
        return replace(case, initial=replace(case.initial, x0=self.initial_state), limits=self.limits)

    def shift(self, initial_set: InitialSet | None) -> InitialSet | None:
        """Return a set of initial states less the places."""
        if initial_set is None:
            return None
        return replace(initial_set, center=[x - h for x, h in zip(initial_set.center, self.offsets, strict=True)])


def formation_on_a_line(case: Case, agents: Agents, chains: Chains, of_family: bool) -> Formation | None:
    """Return single integrators of the paper's protocol about places: ``x - h`` has the plain certificate.

    None for other agents, refused beside what is not asked of them: of order n, in several dimensions, and under a cap
    the sliding-mode protocol, which limits nothing of single integrators. Of large graphs the plain certificate has
    Lyapunov functions that bound no input: formations that ask for nothing but their agents keep that of order n.
    """
    if of_family and chains.dimension > 1:
        raise ParameterError(
            "dimension", "a formation of a family is proved on a line, coordinate by coordinate: give one"
        )
    if of_family and agents.cap is not None:
        raise ParameterError("gain_cap", "is for the nominal protocol; leave it out, or change the protocol")
    large = len(chains.offsets) > EXACT_NODES and not of_family and not asked_of_single_integrators(case)
    if not agents.of_paper or chains.dimension > 1 or large or (agents.cap is not None and case.sliding):
        refuse_agents(case)
        return None
    places = tuple(h for (h,) in chains.offsets)
    begin = None
    if chains.states is not None:
        begin = [x - h for ((x,),), h in zip(chains.states, places, strict=True)]
    return Formation(begin, places, case.limits_with(agents))


def with_vehicles(case: Case) -> Case:
    """Return a case of agents that exchange virtual positions as that of these, with late messages.

    Raises
    ------
    ParameterError
        Something is asked that is not proved of them.
    """
    agents = case.agents
    if not (isinstance(agents, Agents) and agents.virtual):
        return case
    case, disturbance = _undisturbed(case)
    refuse_beside_virtual_positions(case)
    if case.uncertainty or is_family(case.graph):
        given: Any = as_family(case.graph, uncertainty=case.uncertainty)
        graph = given.modes[0].mandatory
    else:
        given = graph = as_graph(case.graph)
    orders = _orders(agents, graph)
    of_all = replace(agents, order=max(orders), plant=None)
    chains = read_chains(of_all, graph, case.protocol.gain, case.initial)
    if chains.dimension > 1:
        raise ParameterError("dimension", "what is proved of vehicles on a line holds in each coordinate: give one")
    in_formation = any(h for (h,) in chains.offsets)
    cap = one_cap([agents.cap, *(limit.gain_cap for limit in case.limits), getattr(case.messages, "gain_cap", None)])
    if disturbance and 1 in orders:  # whose virtual positions are their own
        leaders = MovingLeaders(speed=0) if case.leaders is None else case.leaders
        case = replace(case, leaders=replace(leaders, disturbance=disturbance))
    vehicles = replace(_vehicles(chains.states, orders, graph), disturbance=disturbance)
    if case.messages is None:
        messages = LateMessages(gain_cap=cap, vehicles=vehicles)
    else:
        messages = replace(case.messages, gain_cap=cap, vehicles=vehicles)
    begin = InitialState([x for ((x, *_),) in chains.states or ()] or None)
    agents = Agents(1, offsets=chains.offsets) if in_formation else None
    return replace(case, graph=given, initial=begin, uncertainty=0, agents=agents, messages=messages, limits=())


def _undisturbed(case: Case) -> tuple[Case, Fraction]:
    """Return a case without what disturbs its vehicles, and that: virtual positions are not disturbed."""
    leaders, delta = case.leaders, case.asks.delta
    if case.sliding:
        return case, Fraction(0)
    disturbance = Fraction(0) if delta is None else parameter("delta", delta, True)
    if leaders is not None and leaders.disturbance:
        if delta is not None:
            raise ParameterError("delta", NOT_LATE["delta"])
        disturbance, leaders = leaders.disturbance, replace(leaders, disturbance=0)
        leaders = None if leaders.idle else leaders
    return replace(case, leaders=leaders, asks=replace(case.asks, delta=None)), disturbance


def _orders(agents: Agents, graph: SignedDigraph) -> tuple[int, ...]:
    """Return the order of every agent that exchanges virtual positions, or refuse one that is not proved."""
    if agents.orders is None:
        return (agents.degree,) * graph.n_nodes
    orders = [n for (n,) in _states(agents.orders, graph, "orders", 1)]
    for label, n in zip(graph.labels, orders, strict=True):
        if n not in range(1, MOST_TRACKING + 1):
            why = f"of {shorten(label)} is {readable(n)}; give a whole number from 1 to {MOST_TRACKING}"
            raise ParameterError("orders", why)
    return tuple(map(int, orders))


def _vehicles(states: States | None, orders: tuple[int, ...], graph: SignedDigraph) -> Vehicles:
    """Return vehicles as they begin; refuse what one of lower order has not."""
    still = (Fraction(0),) * graph.n_nodes
    begun = [still, still]
    for i in range(1, max(orders)) if states is not None else ():
        begun[i - 1] = tuple(chain[i] for (chain,) in states or ())
        for label, n, value in zip(graph.labels, orders, begun[i - 1], strict=True):
            if value and n <= i:
                why = f"of {shorten(label)} is not 0, an agent of order {n}; give it 0, or another order"
                raise ParameterError(("v0", "a0")[i - 1], why)
    return Vehicles(begun[0], orders, begun[1] if 3 in orders else None)


def read_offsets(agents: Agents, graph: SignedDigraph, dimension: int, gain: Gain) -> tuple[tuple[Fraction, ...], ...]:
    """Return ``h_k`` of every agent: those that are given, and the places that biases make.

    Raises
    ------
    ParameterError
        They do not fit the graph, or biases fit no formation: who drifts, and how fast.
    """
    rows = [[Fraction(0)] * dimension for _ in graph.labels]
    if agents.offsets is not None:
        rows = _states(agents.offsets, graph, "offsets", dimension)
    if agents.biases is not None:
        made = formation_of_biases(graph, _states(agents.biases, graph, "biases", dimension))
        if made.offsets is None:
            raise ParameterError(
                f"biases fit no formation: they {_drift_text(made.groups, agents, gain)}; "
                "change them so that their weighted signed sum over each leader group is 0"
            )
        rows = [[x + y for x, y in zip(*pair, strict=True)] for pair in zip(rows, made.offsets, strict=True)]
    return tuple(map(tuple, rows))


def _drift_text(groups: Sequence[GroupDrift], agents: Agents, gain: Gain) -> str:
    """Tell which leader groups biases drive, how fast, and how far: without bound before ``T``, or under a cap.

    Of chains of integrators that are capped the drift at ``T`` is a number, rounded up, times ``K_1`` where that is a
    gain to be designed.
    """
    n, cap = agents.degree, agents.cap
    designed = not agents.of_paper
    name = f"the {DERIVATIVES[n]}" if n < len(DERIVATIVES) else f"derivative {n}"
    power = "g" if n == 1 else f"g^{n}"
    unit = f" times K_1 {power}" if designed else " per unit of the clock"
    if agents.cascade is not None:
        unit, designed = f" times ({readable(agents.alpha)} g^2 + g')", False
    far = None if cap is None or any(agents.coefficients) else drift_until_deadline(gain, cap, n)[1]
    positions = "positions " if n > 1 else ""
    factor = "K_1 times " if designed else ""
    drifts = [f"{group}{unit}" for group in groups[:3]]
    if far is not None:
        most = [f"at most {factor}{up(far * root_above(group.square))} until T" for group in groups[:3]]
        drifts = [f"{drift}, {positions}{limit}" for drift, limit in zip(drifts, most, strict=True)]
    if len(groups) > 3:
        drifts.append("...")
    text = f"{'move' if n == 1 else f'change {name} of'} leader group {'; '.join(drifts)}"
    if cap is None:
        text += f", {positions}without bound before T"
    return f"{text} (K_1 is the gain of relative positions, g the gain)" if designed else text


def read_chains(agents: Agents, graph: SignedDigraph, gain: Gain, initial: InitialState) -> Chains:
    """Return position, velocity and so on of every agent, the dimension of space, places, and remarks.

    Velocities that are not given are 0.
    """
    n, x0, v0, derivatives = agents.degree, initial.x0, initial.v0, initial.derivatives
    if v0 is not None and derivatives is not None:
        raise ParameterError("v0", "is the first of derivatives; give one of them")
    if isinstance(derivatives, str) or not isinstance(derivatives, Iterable | None):
        raise ParameterError(
            "derivatives", f"= {shorten(repr(derivatives))} is no list; give [v0], or [v0, a0] and so on"
        )
    given = [v0] if derivatives is None else list(derivatives)
    given = [None if isinstance(one, str) and one.strip() == "0" else one for one in given]
    if any(one is not None for one in given[n - 1 :]):
        surplus = DERIVATIVES[n] if n < len(DERIVATIVES) else f"derivative {n}"
        raise ParameterError(
            f"{'v0' if n == 1 else 'derivatives'}: agents of order {n} have no {surplus} to begin with"
        )
    if x0 is None:
        if any(one is not None for one in given):
            raise ParameterError("v0 without x0: give the positions, too")
        d = _dimension_of(agents, graph)
        return Chains(None, d, read_offsets(agents, graph, d, gain))
    positions = _states(x0, graph, "x0")
    d = len(positions[0])
    if d > MOST_DIMENSION:
        raise ParameterError("x0", f"has {d} numbers for each agent; space has at most {MOST_DIMENSION} coordinates")
    columns, notes = [positions], []
    for i in range(1, n):
        value = given[i - 1] if i <= len(given) else None
        name = DERIVATIVES[i] if i < len(DERIVATIVES) else f"derivative {i}"
        if value is None:
            columns.append([[Fraction(0)] * d for _ in positions])
        else:
            columns.append(_states(value, graph, "v0" if i == 1 else f"derivatives[{i - 1}] ({name})", d))
    missing = [PLURALS[i] for i in range(1, min(n, len(PLURALS))) if i > len(given) or given[i - 1] is None]
    if missing and v0 is None and derivatives is None:
        notes.append(f"no {' and '.join(missing)} given: taken for 0")
    chains = tuple(tuple(tuple(columns[i][k][q] for i in range(n)) for q in range(d)) for k in range(graph.n_nodes))
    return Chains(chains, d, read_offsets(agents, graph, d, gain), tuple(notes))


def _dimension_of(agents: Agents, graph: SignedDigraph) -> int:
    given = {"offsets": agents.offsets, "biases": agents.biases}
    return next((len(_states(rows, graph, name)[0]) for name, rows in given.items() if rows is not None), 1)


def _states(values: Any, graph: SignedDigraph, name: str, dimension: int | None = None) -> list[list[Fraction]]:
    """Return N rows of d numbers, or refuse them."""
    rows: Sequence[Sequence[Fraction]]
    if isinstance(values, str) and values.strip() == "random" and name != "x0":
        rows = draw_states([0, 2], graph, name, dimension or 1)
    else:
        rows = as_states(values, graph, name)
    if dimension is not None and len(rows[0]) != dimension:
        raise ParameterError(
            name, f"has {len(rows[0])} numbers for each agent, x0 has {dimension}: give {graph.n_nodes} x {dimension}"
        )
    for label, row in zip(graph.labels, rows, strict=True):
        if not all(map(writable, row)):
            raise ParameterError(f"{name} of agent {shorten(label)} has too many digits to keep; round it")
    return [list(row) for row in rows]
