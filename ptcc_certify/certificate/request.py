"""What is asked of :func:`ptcc_certify.certify`, read and refused where it does not fit."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.numbers import MAX_SCALE_BITS
from ptcc_certify.bounds.input.initial_set import read_initial_set
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.errors import Change, NumberError, ParameterError, gated
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_state
from ptcc_certify.graphs.rationals import as_fraction, shorten, writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure, behaviour_name
from ptcc_certify.lyapunov.follower_rows import refuse_leader_groups
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.base import refuse_no_protocol
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.late_messages import LateMessages
from ptcc_certify.protocols.moving_leaders import MovingLeaders, refuse_together
from ptcc_certify.protocols.parameters import parameter
from ptcc_certify.protocols.reaching_time import ReachingTime, certified_reaching_times

#: Longest weights and initial states, over a common denominator: so many bits over ``N^(5/4)``, for seconds of work.
LONGEST_BITS = 470_000


@gated
@dataclass(frozen=True)
class Expectations:
    """What is asked of a certificate besides.

    Attributes
    ----------
    behaviour : str or None
        As :attr:`ptcc_certify.theorems.claims.Claim.behaviour` or one of its special cases.
    min_rate : Fraction or None
        A proved rate of at least so much, per unit of the stretched clock.
    max_input : Fraction or None
        A proved peak of every ``|u_k|`` of at most so much, in units of the input.
    max_residual : Fraction or None
        With late messages: every agent proved within so much of its final state at ``T``.

    Raises
    ------
    ParameterError
        No behaviour is called so, or a number is negative.

    References
    ----------
    Theorems 1 to 6 of [Zhu]_ say which behaviour follows.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> asked = Expectations("bipartite consensus", min_rate=Fraction(5))
    >>> print(certify(pair, protocol, expectations=asked).assessment.text)
    refuted: rate >= 5 (upper bound 4, proved); met: bipartite consensus; the rest is certified
    """

    behaviour: str | None = None
    min_rate: Fraction | None = None
    max_input: Fraction | None = None
    max_residual: Fraction | None = None

    def __post_init__(self) -> None:
        try:
            behaviour = None if self.behaviour is None else behaviour_name(str(self.behaviour))
        except ValueError as error:
            raise ParameterError(f"expected behaviour: {error}") from None
        object.__setattr__(self, "behaviour", behaviour)
        for name in ("min_rate", "max_input", "max_residual"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, parameter(name, value, zero_allowed=True))


@dataclass(frozen=True)
class Request:
    """What was asked of :func:`ptcc_certify.certify`, beside graph, protocol and initial state.

    Attributes
    ----------
    method : str
        Which Lyapunov functions are searched.
    at : Fraction or None
        Instant for which the bound was optimised, in units of time.
    initial_set : InitialSet or None
        The set of initial states for which the input is bounded; None: that of the initial state alone.
    limits : tuple of Limits
        Limits of the gain that are judged besides.
    delta : Fraction or None
        Nominal protocol: bound of the disturbances that are judged besides, in units of the input.
    noise : Fraction or None
        Nominal protocol: bound of the measurement noise that is judged under each of the limits.
    messages : LateMessages or None
        How late is what agents hear.
    leaders : MovingLeaders or None
        How leaders move.
    time_limit : float
        Seconds that the searches were given, infinity for no limit.
    by_work : bool
        Whether they were seconds of work, since nobody asked for a limit, and not of wall time.
    expectations : Expectations
        What is asked besides; what became of it is part of ``assessment``.
    scenario : mapping or None
        The scenario file that asked for it, as JSON; it is kept, and nothing is read from it.
    origins : mapping of str to str
        What ``"graph"`` is called, and where ``"x(0)"`` and ``"sigma(0)"`` come from: of a random state its seed. What
        is missing was given as it is.
    """

    method: str = "best"
    at: Fraction | None = None
    initial_set: InitialSet | None = None
    limits: tuple[Limits, ...] = ()
    delta: Fraction | None = None
    noise: Fraction | None = None
    messages: LateMessages | None = None
    leaders: MovingLeaders | None = None
    time_limit: float = math.inf
    by_work: bool = False
    expectations: Expectations = field(default_factory=Expectations)
    scenario: Mapping[str, Any] | None = None
    origins: Mapping[str, str] = field(default_factory=dict, hash=False)


def origins_of(graph: Any, x0: Any, sigma0: Any) -> dict[str, str]:
    """Return what the arguments of :func:`ptcc_certify.certify` tell of where they come from.

    Examples
    --------
    >>> origins_of("graphs/team.csv", "random", None)
    {'graph': 'team.csv', 'x(0)': 'random, seed 0'}
    """
    origins = {"graph": Path(graph).name} if isinstance(graph, str | os.PathLike) else {}
    states = {"x(0)": x0, "sigma(0)": sigma0}
    return origins | {
        name: "random, seed 0" for name, state in states.items() if isinstance(state, str) and state.strip() == "random"
    }


def refuse(
    graph: SignedDigraph, protocol: Protocol, method: str, sliding: Mapping[str, Any], nominal: Sequence[Any]
) -> None:
    """Refuse what does not fit together."""
    refuse_no_protocol(protocol)
    if not protocol.prescribed:
        raise ParameterError("rho2", "= 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
    for name, value in sliding.items():
        if value is not None and not protocol.reaching:
            raise ParameterError(name, "belongs to the sliding-mode protocol; leave it out or change the protocol")
    if method not in METHODS:
        raise ParameterError(f'method "{method}" is unknown; one of {", ".join(METHODS)}')
    if protocol.reaching and any(value is not None for value in nominal):
        raise ParameterError("limits, delta and noise are for the nominal protocol; the sliding mode has its own delta")
    _refuse_long(_distinct_weights(graph), graph.n_nodes, "the weights", lambda: f"edge {_longest_edge(graph)}")


_NO_SET = "is not taken up here, bounds are from one initial state; leave it out, and give x0"
#: What is not certified beside late messages, and what to do instead.
_NOT_LATE = {
    "initial_set": _NO_SET,
    "stop_before": "late messages are certified under a gain cap alone; leave it out",
    "sample_period": "of late messages a period tells how often they are sent; give that instead",
    "noise": "of late messages an error of values tells it: noise within NU is one of 2 NU, a quantisation of 4 NU; "
    "give that instead",
    "delta": "is not proved of late messages under the nominal protocol by itself; give leaders with it, of speed 0 if "
    "they rest, or take the sliding-mode protocol, under which disturbances within delta move nothing",
}
#: What is not certified beside leaders that move.
_NOT_TRACKING = {
    "initial_set": _NO_SET,
    "gain_cap": "leaders that move are tracked at T by a gain without limits; leave it out",
    "stop_before": "leaders that move are tracked at T by a gain without limits; leave it out",
    "sample_period": "leaders that move are tracked at T by a gain without limits; leave it out",
    "noise": "is not proved while leaders move; leave it out",
    "delta": "of leaders that move MovingLeaders(disturbance=..) tells what disturbs the followers; give that instead",
}
_NOT_TOGETHER = _NOT_LATE | {"delta": _NOT_TRACKING["delta"]}


def refuse_beside(structure: Structure, protocol: Protocol, request: Request) -> None:
    """Refuse late messages and moving leaders where nothing could be certified, before anything is searched."""
    messages, leaders = request.messages, request.leaders
    if messages is None and request.expectations.max_residual is not None:
        raise ParameterError("max_residual", "is asked of late messages; tell how late they are, or leave it out")
    if messages is None and leaders is None:
        return
    refuse_together(messages, leaders)
    together = messages is not None and leaders is not None
    _refuse_more(_NOT_TOGETHER if together else _NOT_TRACKING if messages is None else _NOT_LATE, request)
    if leaders is not None:
        if protocol.reaching:
            raise ParameterError(
                "leaders that move are certified under the nominal protocol; change it, or leave them out"
            )
        refuse_leader_groups(structure, "leaders that move as they like: a bound")
    if messages is not None:
        _refuse_messages(structure, messages, [limit.gain_cap for limit in request.limits])
    if structure.graph.n_edges == 0:
        name, why = ("leaders", "nobody tracks") if messages is None else ("messages", "nothing is late")
        raise ParameterError(name, f"nobody listens to anybody, so {why}; leave it out")


def _refuse_more(refused: Mapping[str, str], request: Request) -> None:
    """Refuse limits of the gain, noise and disturbances of which nothing is certified beside."""
    for name, mend in refused.items():
        if any(getattr(one, name, None) is not None for one in (request, *request.limits)):
            raise ParameterError(name, mend)


def _refuse_messages(structure: Structure, messages: LateMessages, caps: Sequence[Fraction | None]) -> None:
    """Refuse late messages that do not fit the graph, or a cap of the gain that is another than theirs."""
    messages.latencies(structure.graph)
    if any(cap != messages.gain_cap for cap in caps):
        raise ParameterError("gain_cap", "limits and late messages have two; give both the same, or messages alone")
    if messages.value_error and messages.own_delay:
        raise ParameterError("values that are off are not certified where the own state is late; leave one of them out")
    if messages.value_error:
        refuse_leader_groups(structure, "what values that are off add: a bound")
    if messages.gain_cap is None and not messages.leaders_hear_at_once(structure):
        at_once = f"delays of 0 within their group{', and no period' * bool(messages.held)}"
        mend = f"add a gain cap, or let leaders hear each other at once ({at_once})"
        refuse_leader_groups(structure, f"late messages: {mend}; otherwise a bound")


def read_request(structure: Structure, protocol: Protocol, arguments: Mapping[str, Any]) -> Request:
    """Return a request from the arguments of :func:`ptcc_certify.certify`, or refuse it."""
    if not isinstance(scenario := arguments["scenario"], Mapping | None):
        raise ParameterError(
            "scenario", f"= {shorten(repr(scenario))} is none; give the mapping that tomllib.load returns"
        )
    return Request(
        method=arguments["method"],
        at=None if arguments["at"] is None else _instant(arguments["at"], protocol),
        initial_set=None if (region := arguments["initial_set"]) is None else read_initial_set(structure, region),
        limits=tuple(_limits(entry, protocol) for entry in arguments["limits"]),
        messages=_one_of(LateMessages, "messages", arguments["messages"], "delay='0.01'"),
        leaders=_one_of(MovingLeaders, "leaders", arguments["leaders"], "speed=1"),
        time_limit=read_seconds(arguments["time_limit"], structure.graph),
        by_work=arguments["time_limit"] is None,
        expectations=read_expectations(arguments["expectations"]),
        scenario=scenario,
        origins=arguments["origins"],
        **{name: None if arguments[name] is None else parameter(name, arguments[name]) for name in ("delta", "noise")},
    )


def listener(progress: Callable[..., None] | None) -> Callable[..., None]:
    """Return what is told how the work goes on; None: nobody is."""
    if progress is not None and not callable(progress):
        raise ParameterError(
            "progress", f"= {shorten(repr(progress))} is no function; give print, say, or leave it out"
        )
    return progress or (lambda *_: None)


def read_seconds(time_limit: Any, graph: Sized) -> float:
    """Return the seconds of a time limit; None: 60 of work, and 1 more for every 1,000 nodes.

    Examples
    --------
    >>> read_seconds(None, range(2000)), read_seconds("5", [])
    (62.0, 5.0)
    """
    try:
        seconds = float(60 + len(graph) // 1000 if time_limit is None else time_limit)
    except (TypeError, ValueError):
        raise ParameterError("time_limit", f"= {shorten(repr(time_limit))} is not a number of seconds") from None
    if not seconds > 0:
        raise ParameterError("time_limit", f"= {seconds} is outside its domain; it must be > 0, in seconds")
    return seconds


def read_expectations(asked: Any) -> Expectations:
    """Return what is asked besides; a text names a behaviour.

    Examples
    --------
    >>> read_expectations("bipartite-consensus").behaviour
    'bipartite consensus'
    """
    if asked is None or isinstance(asked, str):
        return Expectations(asked)
    if not isinstance(asked, Expectations):
        raise ParameterError("expectations", f"= {shorten(repr(asked))} is none; give Expectations('stability'), say")
    return asked


def _one_of(kind: type, name: str, value: Any, example: str) -> Any:
    """Return what is of a kind, or None; refuse anything else."""
    if value is not None and not isinstance(value, kind):
        raise ParameterError(name, f"= {shorten(repr(value))} is none; give {kind.__name__}({example}), say")
    return value


def _limits(entry: Any, protocol: Protocol) -> GainLimits:
    """Return limits of the gain, or refuse them."""
    if not isinstance(entry, Limits):
        raise ParameterError(f"limits holds {shorten(repr(entry))}; give GainLimits(gain_cap=50), say")
    limits = GainLimits(entry.gain_cap, entry.stop_before, entry.sample_period)
    if limits.ideal:
        raise ParameterError(
            (
                "limits that limit nothing; give ",
                *(Change("gain_cap"), ", ", Change("stop_before"), " or ", Change("sample_period")),
            )
        )
    T = protocol.T
    if limits.stop_before is not None and limits.stop_before >= T:
        raise ParameterError(
            "stop_before", f"= {float(limits.stop_before):.6g} is not below the deadline {float(T):.6g}"
        )
    if limits.sample_period is not None and limits.sample_period > T:
        raise ParameterError(
            "sample_period", f"= {float(limits.sample_period):.6g} is beyond the deadline {float(T):.6g}"
        )
    return limits


def _distinct_weights(graph: SignedDigraph) -> Iterable[Fraction]:
    """Return the weights that may be long, each once."""
    table, _ = graph.weight_table()
    if table is None:
        return (graph.exact_weight(i) for i in range(graph.n_edges))
    return map(Fraction, np.unique(table).tolist()) if table.dtype.kind == "f" else ()


def _bits(value: Fraction) -> int:
    return value.numerator.bit_length() + value.denominator.bit_length()


def _longest_edge(graph: SignedDigraph) -> str:
    edge = max(range(graph.n_edges), key=lambda i: _bits(graph.exact_weight(i)))
    ends = (graph.labels[int(part[edge])] for part in (graph.source, graph.target))
    return " -> ".join(map(shorten, ends))


def _refuse_long(values: Iterable[Fraction], n: int, what: str, where: Callable[[], str]) -> None:
    """Refuse numbers of ``n`` agents whose exact arithmetic would take long: judged over a common denominator.

    Large graphs are proved row by row, in short numbers: only what their check refuses is refused.
    """
    most = int(LONGEST_BITS / n**1.25) if n <= EXACT_NODES else MAX_SCALE_BITS
    common, longest = 1, 0
    for value in values:
        common = math.lcm(common, value.denominator)
        longest = max(longest, value.numerator.bit_length() - value.denominator.bit_length())
        if common.bit_length() + longest > most:
            raise ParameterError(
                f"{what} take more than {most:,} bits over a common denominator, too many for exact proofs of {n:,} "
                f"agents (the longest is that of {where()}); round them, to 17 digits say"
            )


def read_initial_state(structure: Structure, values: Any, name: str) -> tuple[Fraction, ...]:
    """Return ``X(0)`` or ``sigma(0)`` in rationals, or refuse it."""
    state = tuple(as_state(values, structure.graph, name))
    for label, value in zip(structure.graph.labels, state, strict=True):
        if not writable(value):
            raise ParameterError(f"{name} of agent {shorten(label)} has too many digits to keep; round it")
    longest = max(zip(structure.graph.labels, state, strict=True), key=lambda entry: _bits(entry[1]))[0]
    _refuse_long(state, len(state), f"the numbers of {name}", lambda: f"agent {shorten(longest)}")
    return state


def read_sliding_variable(
    structure: Structure, protocol: Protocol, sigma0: Any
) -> tuple[tuple[Fraction, ...] | None, tuple[ReachingTime, ...] | None]:
    """Return ``sigma(0)`` and the proved reaching times; nothing for the nominal protocol."""
    sliding = protocol.reaching
    if sliding is None:
        return None, None
    n = structure.graph.n_nodes
    sigma = (Fraction(0),) * n if sigma0 is None else read_initial_state(structure, sigma0, "sigma0")
    return sigma, certified_reaching_times(sliding, sigma)


def _instant(at: Any, protocol: Protocol) -> Fraction:
    """Read an instant before the deadline."""
    try:
        instant = as_fraction(at, "at")
    except NumberError as error:
        raise ParameterError("at", f"{error}") from None
    if not 0 <= instant < protocol.T:
        raise ParameterError(
            "at",
            f"= {float(instant):.12g} is not an instant before the deadline {float(protocol.T):.12g}; "
            "give one from 0 on and below it",
        )
    return instant
