"""Options of late, lost and rounded messages, and what becomes of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from ptcc_certify.cli.click_options import flag_of, given_of, names_of, options_for
from ptcc_certify.cli.options import Options, graph_file
from ptcc_certify.errors import NumberError, ParameterError
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.parameters import parameter

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family

message_options, leader_options = options_for(LateMessages, asked=True), options_for(MovingLeaders, asked=True)
#: What asks for bounds with late messages; --own-delay belongs to these.
_ASKING = ("delay", "period", "quantisation")


def asks_for_messages(options: Options) -> bool:
    """Tell whether something is asked of late, lost or rounded messages."""
    return any(options.get(name) is not None for name in _ASKING)


def messages_of(graphs: Sequence[str], signed: SignedDigraph | Family, options: Options) -> LateMessages | None:
    """Return how late messages are; None if nothing is asked of them."""
    if options["packet_loss"] and options["period"] is None:
        raise ParameterError("--packet-loss says nothing by itself; give --period, the time between two messages")
    if not asks_for_messages(options):
        if options["own_delay"]:
            raise ParameterError("--own-delay says nothing by itself; give --delay and --gain-cap")
        return None
    step = options["quantisation"]
    if step is not None and step < 0:
        raise ParameterError("--quantisation is outside its domain; a step must be >= 0")
    delay = Fraction(0) if options["delay"] is None else _delay(graphs, signed, options["delay"])
    if not (any(delay.values()) if isinstance(delay, dict) else delay) and options["period"] is None and not step:
        raise ParameterError(
            "messages are neither late, nor lost, nor rounded; give --delay, --period or --quantisation above 0, "
            "or leave them out"
        )
    messages = LateMessages(
        delay=delay,
        period=options["period"],
        losses=options["packet_loss"] or 0,
        value_error=0 if step is None else step / 2,
        gain_cap=options["gain_cap"],
    )
    if not options["own_delay"]:
        return messages
    if messages.gain_cap is None:
        raise ParameterError(_needs_cap(signed, messages))
    return replace(messages, own_delay=True)


def _needs_cap(signed: SignedDigraph | Family, messages: LateMessages) -> str:
    """Tell that an own state that is late asks for a cap, and what gain agents bear with this delay."""
    from ptcc_certify.bounds.delay.small_delays import delay_threshold
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.size_limits import EXACT_NODES
    from ptcc_certify.graphs.structure import analyse

    cap = ""
    graph = signed if isinstance(signed, SignedDigraph) else signed.graph
    if graph is not None and graph.n_nodes <= EXACT_NODES and graph.n_edges and messages.age:
        most = delay_threshold(analyse(graph), 1.0) / float(messages.age)
        cap = f" (with this delay a constant gain diverges above {most:.3g}, numerical; what is certified is less)"
    return (
        "--own-delay: an own state that is late makes the protocol diverge, for its gain grows without limit before T; "
        f"add --gain-cap{cap}, or measure the own state without delay"
    )


def refuse_unheard(signed: SignedDigraph, options: Options) -> None:
    """Refuse messages and leaders of a graph in which nobody listens to anybody, by the flag that asks for them."""
    given = next((name for name in (*_ASKING, *names_of(MovingLeaders)) if options[name] is not None), None)
    if given is not None and not signed.n_edges:
        raise ParameterError(f"{flag_of(given)}: nobody listens to anybody; leave it out, or add edges")


def _delay(
    graphs: Sequence[str], signed: SignedDigraph | Family, text: str
) -> Fraction | dict[tuple[str, str], Fraction]:
    """Return a delay, or those of a column: of several files the largest of every edge."""
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.io.edge_delays import read_delays
    from ptcc_certify.graphs.io.files import name_and_ending
    from ptcc_certify.graphs.io.graph_files import OTHER_FORMATS
    from ptcc_certify.graphs.rationals import parse_exact

    text = text.strip()
    try:
        return parse_exact(text)
    except NumberError as error:
        if not text.isidentifier() or "finite" in str(error):
            raise ParameterError(
                f"--delay: {error}; give a number in your unit of time, or the name of a column"
            ) from None
    delays: dict[tuple[str, str], Fraction] = {}
    for graph in graphs:
        if graph == "-":
            raise ParameterError(
                "--delay names a column, but standard input is read once; save the edge list to a file"
            )
        if (ending := name_and_ending(graph)[1]) in OTHER_FORMATS:
            mend = "save it as one, or give one delay for all"
            raise ParameterError(f"--delay {text}: names a column of an edge list, and .{ending} is none; {mend}")
        for pair, delay in read_delays(graph_file(graph), signed, text).items():
            delays[pair] = max(delay, delays.get(pair, delay))
    if isinstance(signed, SignedDigraph):
        signed.read["notes"] = noted_delays(signed.read["notes"], text)
    return delays


def noted_delays(notes: Iterable[str], title: str) -> tuple[str, ...]:
    """Return notes on how files were read that say that delays were read of a column, and not that it is ignored.

    Examples
    --------
    >>> noted_delays(['columns ignored: "lag", "year"', 'a.csv: columns ignored: "lag"'], "lag")
    ('delays of column "lag"', 'columns ignored: "year"')
    """
    told = [f'delays of column "{title}"']
    for note in notes:
        head, ignored, names = note.partition("columns ignored: ")
        left = [name for name in names.split(", ") if name.strip('"').lower() != title.lower()]
        if left or not ignored:
            told.append(f"{head}{ignored}{', '.join(left)}")
    return tuple(told)


def leaders_of(options: Options) -> MovingLeaders | None:
    """Return how leaders move; None if nothing is asked of that. ``--delta`` is what disturbs the followers."""
    given: dict[str, Any] = {**given_of(MovingLeaders, options)}
    if not given:
        return None
    delta = parameter("delta", options["delta"] or 0, True)
    if given.keys() == {"sign_gain"} and not delta:
        mend = f"give {flag_of('leader_speed')}, or {flag_of('delta')} if followers are disturbed"
        raise ParameterError(f"{flag_of('sign_gain')} belongs to leaders that move; {mend}")
    return MovingLeaders(**{"speed": 0, **given}, disturbance=delta)
