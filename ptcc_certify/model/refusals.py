"""What is refused, in one place: each for a reason of nature, or since nothing is proved of it yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import Change, HypothesisError, ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.base import Protocol, refuse_no_protocol

if TYPE_CHECKING:
    from ptcc_certify.graphs.structure import Structure
    from ptcc_certify.model.asks import Case
    from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

#: What is asked of one graph alone.
NOT_OF_FAMILIES = (*("at", "initial_set", "limits", "delta", "noise", "agents", "simulation", "disturbance"),)
#: What is asked of single integrators alone.
_NOT_OF_AGENTS = {
    "at": "leave it out",
    "initial_set": "bounds are from one initial state, x0; leave it out",
    "limits": "give Agents(gain_cap=..) instead of a gain cap; a stop and sampling are not proved for them",
    "delta": "take the sliding-mode protocol, which disturbances within delta do not move",
    "noise": "leave it out",
    "messages": "leave it out, or let agents of order 2 or 3 exchange virtual positions, which may come late: "
    "Agents(order=2, exchange='virtual')",
    "leaders": "leave it out; their leaders move as their plant does, unless agents exchange virtual "
    "positions: Agents(order=2, exchange='virtual')",
    "disturbance": "leave it out: what holds holds for every disturbance within delta",
}
_NO_SET = "is not taken up here, bounds are from one initial state, x0; leave it out"
#: What is not proved of agents that exchange virtual positions, of all that may be asked.
_NOT_OF_VEHICLES = ("stop_before", "sample_period", "noise", "disturbance", "initial_set", "sigma0")
_WORDS_OF_VEHICLES = {"protocol": "the sliding-mode protocol "}
#: What is not certified beside late messages, and what to do instead.
NOT_LATE = {
    "initial_set": _NO_SET,
    "stop_before": "late messages are certified under a gain cap alone; leave it out",
    "sample_period": "of late messages a period tells how often they are sent; give that instead",
    "delta": "is given twice: MovingLeaders(disturbance=..) tells what disturbs the followers; leave one of them out",
}
_CAPPED = "beside what moves, disturbs or clips followers one gain cap alone is certified; leave others out"
#: What is not certified beside leaders that move.
_NOT_TRACKING = {
    "initial_set": _NO_SET,
    **dict.fromkeys(("gain_cap", "stop_before", "sample_period"), _CAPPED),
    "delta": NOT_LATE["delta"],
}


def refuse_before_the_graph(case: Case) -> None:
    """Refuse what does not fit together on any graph.

    Raises
    ------
    ParameterError
        Names what does not fit, and the mend.

    Examples
    --------
    >>> from ptcc_certify.model.asks import Case
    >>> refuse_before_the_graph(Case("fig1a", NominalProtocol(rho2=0)))
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: rho2 = 0 gives no deadline; give rho2 > 0, and for what the constant gain ...
    """
    refuse_no_protocol(case.protocol)
    if not case.protocol.prescribed:
        constant = Change("gain_cap", case.protocol.rho1)
        why = "= 0 gives no deadline; give rho2 > 0, and for what the constant gain leaves by T "
        raise ParameterError("rho2", (why, constant))
    for name in ("sigma0", "disturbance"):
        if case.given(name) is not None and not case.sliding:
            raise ParameterError(name, "belongs to the sliding-mode protocol; leave it out or change the protocol")
    if case.sliding and any(case.given(name) is not None for name in ("limits", "delta", "noise")):
        raise ParameterError("limits, delta and noise are for the nominal protocol; the sliding mode has its own delta")


def asked_of_signals(structure: Structure, case: Case) -> bool:
    """Tell whether what is asked of one graph is proved of families alone, of which it is one of a single mode.

    These are agents that move by themselves, inputs that are clipped, disturbances beside messages where leaders hear
    each other, and values that are off without a gain cap.

    Examples
    --------
    >>> from ptcc_certify.model.asks import Case
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)]))
    >>> asked_of_signals(pair, Case(pair.graph, NominalProtocol(), messages=LateMessages(value_error=1)))
    True
    """
    messages = case.messages
    groups = any(len(c.nodes) > 1 for c in structure.closed_components)
    if messages is None or case.sliding or (groups and not messages.at_rest):
        return False
    if (leaders := messages.leaders) is not None:
        return groups or leaders.growth is not None or leaders.saturation is not None
    return groups and messages.value_error > 0 and messages.gain_cap is None


def refuse_in_places(leaders: MovingLeaders | None) -> None:
    """Refuse agents that move by themselves in a formation: at other places they move otherwise.

    Raises
    ------
    ParameterError
        They do.
    """
    if leaders is not None and leaders.growth is not None:
        raise ParameterError("growth", "is not for formations, whose places it changes; leave one of the two out")


def refuse_of_families(case: Case) -> None:
    """Refuse what is asked of one graph alone, where a family is given."""
    given = [] if case.asks.method == "best" else ["method"]
    given += [name for name in NOT_OF_FAMILIES if (value := case.given(name)) is not None and value is not False]
    if case.messages is not None and "at" in given:
        given.remove("at")  # bounds with these are told at any instant
    if isinstance(case.agents, Agents) and case.agents.of_paper:
        given.remove("agents")  # in a formation
        if case.agents.biases is not None:
            raise ParameterError("biases", "of a family make other places in every graph; give offsets instead")
        refuse_in_places(case.leaders)
    if given:
        mend = {"limits": "families take one gain cap alone; leave others out", "delta": NOT_LATE["delta"]}
        text = "is not for families of graphs yet, nor for what one graph has proved as one; leave it out"
        raise ParameterError(given[0], mend.get(given[0], text))
    _refuse_beside_any_graph(case)
    if case.messages is not None and case.messages.own_delay:
        raise ParameterError("own_delay", "an own state that is late is not proved of families yet; leave it out")


def refuse_agents(case: Case) -> None:
    """Refuse what is not asked of agents of order n, or not proved of them.

    Raises
    ------
    ParameterError
        Says what, and what to do instead.
    """
    if not isinstance(case.agents, Agents):
        raise ParameterError("agents", f"= {shorten(repr(case.agents))}: give Agents(order=2) for double integrators")
    for name in asked_of_single_integrators(case):
        raise ParameterError(name, f"is for single integrators; of agents of order n: {_NOT_OF_AGENTS[name]}")
    if case.initial.sigma0 is not None and any(_entries(case.initial.sigma0)):
        raise ParameterError(
            "sigma0",
            "agents of order n start with sigma(0) = 0 (their auxiliary variables at minus the highest "
            "derivative); otherwise their final positions depend on the disturbance: leave it out",
        )
    case.agents.refuse_motion(case.protocol.T)


def refuse_beside_virtual_positions(case: Case) -> None:
    """Refuse what is not proved of agents that exchange virtual positions.

    Raises
    ------
    ParameterError
        Says what.

    Examples
    --------
    >>> from ptcc_certify.model.asks import Case
    >>> agents, limits = Agents(order=2, exchange="virtual"), GainLimits(stop_before="0.1")
    >>> refuse_beside_virtual_positions(Case("fig1a", NominalProtocol(), agents=agents, limits=limits))
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: stop_before is not proved yet where virtual positions are exchanged; leave \
it out
    """
    leaders, messages = case.leaders, case.messages
    asked = {"protocol": case.sliding} | {name: case.given(name) is not None for name in _NOT_OF_VEHICLES}
    asked |= {
        "sign_gain": leaders is not None and leaders.sign_gain is not None,
        "growth": leaders is not None and leaders.growth is not None,
        "saturation": leaders is not None and leaders.saturation is not None,
        "own_delay": messages is not None and messages.own_delay,
    }
    if name := next((name for name, given in asked.items() if given), None):
        what = _WORDS_OF_VEHICLES.get(name, "")
        raise ParameterError(name, f"{what}is not proved yet where virtual positions are exchanged; leave it out")


def asked_of_single_integrators(case: Case) -> list[str]:
    """Return what is asked of single integrators alone."""
    given = [name for name in _NOT_OF_AGENTS if case.given(name) is not None]
    alone = case.messages is not None and case.messages.tracks  # which nobody asked for beside leaders
    return [name for name in given if name != "messages" or not alone]


def _entries(values: Any) -> list[Any]:
    """Return the numbers of a state as far as they are seen without its graph."""
    if isinstance(values, str):
        return [values] if values.strip() not in ("0", "") else []
    values = values.values() if hasattr(values, "values") and callable(values.values) else values
    try:
        return [float(x) for x in values]
    except (TypeError, ValueError):
        return [values]


def _refuse_beside_any_graph(case: Case) -> None:
    """Refuse what is proved of no graph where messages are late, or leaders move."""
    if case.messages is None and case.asks.expectations.max_residual is not None:
        raise ParameterError("max_residual", "is asked of late messages; tell how late they are, or leave it out")
    refuse_together(case.messages, case.leaders)
    if case.leaders is not None and case.sliding:
        raise ParameterError(
            f"{case.leaders.asked} are certified under the nominal protocol; change it, or leave them out"
        )


def refuse_beside(structure: Structure, case: Case) -> None:
    """Refuse late messages and moving leaders where nothing could be certified, before anything is searched."""
    messages, leaders = case.messages, case.leaders
    _refuse_beside_any_graph(case)
    if messages is None and leaders is None:
        return
    late = messages is not None and not messages.tracks
    _refuse_more(NOT_LATE if late else _NOT_TRACKING, case)
    if leaders is not None:
        if messages is None or messages.leaders is None:
            raise ParameterError("leaders", "that move are not certified of these agents; leave them out")
        refuse_leader_groups(structure, f"{leaders.asked}: a bound")
    if messages is not None:
        _refuse_messages(structure, messages, [limit.gain_cap for limit in case.limits])
    if structure.graph.n_edges == 0:
        name, why = ("messages", "nothing is late") if late else ("leaders", "nobody tracks")
        if messages is not None and messages.vehicles is not None and messages.exact:
            name, why = "exchange", "no virtual positions are exchanged"
        raise ParameterError(name, f"nobody listens to anybody, so {why}; leave it out")


def _refuse_more(refused: Mapping[str, str], case: Case) -> None:
    """Refuse limits of the gain, noise and disturbances of which nothing is certified beside."""
    for name, mend in refused.items():
        if case.given(name) is not None:
            raise ParameterError(name, mend)


def _refuse_messages(structure: Structure, messages: LateMessages, caps: Sequence[Fraction | None]) -> None:
    """Refuse late messages that do not fit the graph, or a cap of the gain that is another than theirs."""
    messages.latencies(structure.graph)
    if any(cap != messages.gain_cap for cap in caps):
        raise ParameterError("gain_cap", "limits and late messages have two; give both the same, or messages alone")
    if messages.value_error and messages.own_delay:
        raise ParameterError("values that are off are not certified where the own state is late; leave one of them out")
    if messages.gain_cap is None and not messages.leaders_hear_at_once(structure):
        at_once = f"delays of 0 within their group{', and no period' if messages.held else ''}"
        mend = f"add a gain cap, or let leaders hear each other at once ({at_once})"
        refuse_leader_groups(structure, f"late messages: {mend}; otherwise a bound")


def refuse_together(messages: LateMessages | None, leaders: MovingLeaders | None) -> None:
    """Refuse late messages and moving leaders of which nothing is proved at once.

    Raises
    ------
    ParameterError
        The own states of followers are late, messages where agents move by themselves, or inputs are clipped beside
        what is not proved with them.

    Examples
    --------
    >>> refuse_together(LateMessages(delay=1, own_delay=True, gain_cap=1), MovingLeaders(speed=1))
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: own_delay: an own state that is late is certified of leaders at rest alone; \
leave one of the two out
    """
    if leaders is not None and leaders.saturation is not None:
        beside: dict[str, Any] = {"late messages": messages is not None and messages.age, "growth": leaders.growth}
        beside |= {"leaders that move": leaders.speed, "disturbances": leaders.disturbance}
        beside |= {"a sign term": leaders.sign_gain}
        if what := next((name for name, given in beside.items() if given), None):
            told: tuple[str | Change, ...] = (f"beside {what} is not certified yet; leave one of the two out",)
            if what in ("late messages", "leaders that move"):
                told += (", or bound inputs by ", Change("gain_cap"), " and ask for ", Change("max_input"))
            raise ParameterError("saturation", told)
    if messages is None or leaders is None:
        return
    if messages.age and leaders.growth:
        why = "a target that moves by itself goes on while messages come, and nothing tells how far"
        raise ParameterError("growth", f"beside late messages is not certified: {why}; leave one of the two out")
    if messages.own_delay:
        what = "of leaders at rest" if leaders.speed else "without disturbances"
        raise ParameterError(
            "own_delay", f"an own state that is late is certified {what} alone; leave one of the two out"
        )


def refuse_leader_groups(structure: Structure, what: str) -> None:
    """Refuse a graph some of whose leaders form a group, by the labels of one.

    Raises
    ------
    HypothesisError
        Names two leaders of the group.

    Examples
    --------
    >>> refuse_leader_groups(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 1)])), "this")
    Traceback (most recent call last):
    ptcc_certify.errors.HypothesisError: this needs leaders that listen to nobody; 1 and 2 are leaders of \
one group
    """
    group = next((c for c in structure.closed_components if len(c.nodes) > 1), None)
    if group is not None:
        first, second = (shorten(structure.graph.labels[v]) for v in group.nodes[:2])
        raise HypothesisError(
            f"{what} needs leaders that listen to nobody; {first} and {second} are leaders of one group"
        )


def refuse_exchanged(graph: Any) -> None:
    """Refuse a protocol where the graph stands."""
    if isinstance(graph, Protocol):
        raise ParameterError("graph and protocol are exchanged; write certify(graph, protocol)")
