"""What is asked of :func:`ptcc_certify.certify`, refused where it does not fit; what proofs that answer it share."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from fractions import Fraction
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.numbers import MAX_SCALE_BITS
from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.bounds.input.initial_sets import read_initial_set
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.errors import Change, NumberError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_state
from ptcc_certify.graphs.rationals import as_fraction, shorten, writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import Case, Expectations, GainLimits, InitialState
from ptcc_certify.model.constrained_switching import SignalClass, read_signal
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.parameters import parameter
from ptcc_certify.model.reaching_time import ReachingTime, certified_reaching_times

#: Longest weights and initial states, over a common denominator: so many bits over ``N^(5/4)``, for seconds of work.
LONGEST_BITS = 470_000


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
        How late is what agents hear, and how leaders move.
    signal : {"any", "constant"}, DwellTime, JointWindows or ClockShares
        Of a family: restricted signals of which more is claimed than of every signal.
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
    signal: SignalClass = "any"
    time_limit: float = math.inf
    by_work: bool = False
    expectations: Expectations = field(default_factory=Expectations)
    scenario: Mapping[str, Any] | None = None
    origins: Mapping[str, str] = field(default_factory=dict, hash=False)


@dataclass(frozen=True, eq=False)
class Question:
    """What a certificate answers: of whom, under which protocol, from where, and what was asked beside.

    Attributes
    ----------
    subject : Structure or Family
        The graph, with its structure, or the family.
    protocol : NominalProtocol or SlidingModeProtocol
    initial_state : tuple of N Fraction, or None
        ``X(0)``.
    sigma0 : tuple of N Fraction, or None
        ``sigma(0)`` of the sliding-mode protocol; None for the nominal one.
    request : Request
    """

    subject: Structure | Family
    protocol: Protocol
    initial_state: tuple[Fraction, ...] | None = None
    sigma0: tuple[Fraction, ...] | None = None
    request: Request = field(default_factory=Request)

    @property
    def labels(self) -> Sequence[str]:
        """The names of the agents."""
        return self.subject.labels if isinstance(self.subject, Family) else self.subject.graph.labels


def origins_of(graph: Any, initial: InitialState) -> dict[str, str]:
    """Return what the arguments of :func:`ptcc_certify.certify` tell of where they come from.

    Examples
    --------
    >>> origins_of("graphs/team.csv", InitialState("random"))
    {'graph': 'team.csv', 'x(0)': 'random, seed 0'}
    """
    origins = {"graph": Path(graph).name} if isinstance(graph, str | os.PathLike) else {}
    states = {"x(0)": initial.x0, "sigma(0)": initial.sigma0}
    return origins | {
        name: "random, seed 0" for name, state in states.items() if isinstance(state, str) and state.strip() == "random"
    }


def refuse_long_weights(graph: SignedDigraph) -> None:
    """Refuse weights whose exact arithmetic would take long."""
    _refuse_long(_distinct_weights(graph), graph.n_nodes, "the weights", lambda: f"edge {_longest_edge(graph)}")


def read_request(
    structure: Structure, case: Case, scenario: Mapping[str, Any] | None, origins: Mapping[str, str]
) -> Request:
    """Return what is asked, read; or refuse it."""
    if not isinstance(scenario, Mapping | None):
        raise ParameterError(
            "scenario", f"= {shorten(repr(scenario))} is none; give the mapping that tomllib.load returns"
        )
    asks, protocol = case.asks, case.protocol
    return Request(
        method=asks.method,
        at=None if asks.at is None else _instant(asks.at, protocol),
        initial_set=None if asks.initial_set is None else read_initial_set(structure, asks.initial_set),
        limits=tuple(_limits(entry, protocol) for entry in case.limits),
        delta=None if asks.delta is None else parameter("delta", asks.delta, optional=True),
        noise=None if asks.noise is None else parameter("noise", asks.noise, optional=True),
        messages=case.messages,
        signal=read_signal(case.signal),
        time_limit=read_seconds(asks.time_limit, structure.graph),
        by_work=asks.time_limit is None,
        expectations=asks.expectations,
        scenario=scenario,
        origins=origins,
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


def _limits(entry: Limits, protocol: Protocol) -> GainLimits:
    """Return limits of the gain, or refuse them."""
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


@dataclass(frozen=True, eq=False)
class Source:
    """The file that a certificate was read from, accepted by the independent check.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the file.
    document : mapping
        Its JSON. What stands under ``unverified`` is the file's own word.
    report : CheckReport
        Of the independent check.
    effort : Effort or None
        What is proved about the input.
    files : mapping of str to bytes
        The side files that stood beside it, by name.
    """

    path: Path
    sha256: str
    document: Mapping[str, Any]
    report: CheckReport
    effort: Effort | None
    files: Mapping[str, bytes] = field(repr=False)


def _told(path: str) -> Any:
    return property(attrgetter(path))


class OfQuestion:
    """What a question tells, asked of what answers it, which has it as ``question``."""

    #: The protocol.
    protocol: Protocol = _told("question.protocol")
    #: ``X(0)``.
    initial_state: tuple[Fraction, ...] | None = _told("question.initial_state")
    #: ``sigma(0)`` of the sliding-mode protocol; None for the nominal one.
    sigma0: tuple[Fraction, ...] | None = _told("question.sigma0")
    #: The names of the agents.
    labels: Sequence[str] = _told("question.labels")
    #: What was asked.
    request: Request = _told("question.request")
    #: What is asked besides.
    expectations: Expectations = _told("question.request.expectations")
    #: What the graph is called, and where initial states come from.
    origins: Mapping[str, str] = _told("question.request.origins")
    #: Which Lyapunov functions were searched.
    method: str = _told("question.request.method")
    #: Instant for which the bound was optimised, in units of time.
    at: Fraction | None = _told("question.request.at")
    #: The set of initial states for which the input is bounded; None: that of ``initial_state`` alone.
    initial_set: InitialSet | None = _told("question.request.initial_set")
    #: Limits of the gain that are judged besides.
    limits: tuple[Limits, ...] = _told("question.request.limits")
    #: Nominal protocol: bound of the disturbances that are judged besides, in units of the input.
    delta: Fraction | None = _told("question.request.delta")
    #: Nominal protocol: bound of the measurement noise that is judged under each of the limits.
    noise: Fraction | None = _told("question.request.noise")
    #: Seconds that the searches were given, infinity for no limit.
    time_limit: float = _told("question.request.time_limit")

    @property
    def only_drawn(self) -> bool:
        """Whether the question is of a set of initial states, and the one at hand drawn for the simulated run."""
        return self.initial_set is not None and "x(0)" in self.request.origins

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())


@dataclass(frozen=True, eq=False, kw_only=True)
class Proof(OfQuestion):
    """What is proved of a graph or of a family.

    Attributes
    ----------
    question : Question
    reaching : tuple of N ReachingTime, or None
        When each sliding variable is proved to be 0, whatever the disturbance.
    late : LateBounds or None
        What holds with late messages, and while leaders move; None where neither was asked.
    source : Source or None
        The file that it was read from.
    offsets : tuple of N Fraction, or None
        Places of agents in a formation on a line: initial and final state and everything else are of ``x - offsets``;
        :attr:`initial_positions` and ``final_positions`` are of ``x``.
    """

    question: Question
    reaching: tuple[ReachingTime, ...] | None = None
    late: LateBounds | None = None
    source: Source | None = None
    offsets: tuple[Fraction, ...] | None = None

    @property
    def initial_positions(self) -> tuple[Fraction, ...] | None:
        """Where agents begin: in a formation ``initial_state`` is less their places."""
        if self.offsets is None or self.initial_state is None:
            return self.initial_state
        return tuple(x + h for x, h in zip(self.initial_state, self.offsets, strict=True))

    @property
    def asked_messages(self) -> LateMessages | None:
        """How late messages are; None where they come at once and exactly."""
        messages = self.request.messages if self.late is None else self.late.messages
        return None if messages is None or messages.tracks else messages

    @property
    def asked_leaders(self) -> MovingLeaders | None:
        """How leaders move."""
        messages = self.request.messages if self.late is None else self.late.messages
        return None if messages is None else messages.leaders

    @property
    def leaders_move(self) -> bool:
        """Whether leaders move."""
        return self.asked_leaders is not None and self.asked_leaders.moving

    @property
    def vehicles(self) -> Mapping[str, Sequence[Fraction]] | None:
        """Of agents that exchange virtual positions ``v(0)``, of a team ``order`` and ``a(0)``; None without them."""
        vehicles = None if self.late is None else self.late.messages.vehicles
        if vehicles is None:
            return None
        orders = None if vehicles.team is None else tuple(map(Fraction, vehicles.team))
        told = {"order": orders, "v(0)": vehicles.v0, "a(0)": vehicles.a0}
        return {name: values for name, values in told.items() if values is not None}
