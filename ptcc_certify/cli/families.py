"""What ``ptcc classify``, ``certify`` and ``check`` do with a family of graphs: several files, uncertain weights."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import BytesIO
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import SIGNAL, click_option, flag_of, options_asking, options_for, together
from ptcc_certify.cli.terminal import Screen, print_json
from ptcc_certify.errors import ExitCode, ParameterError, items_of, one_line
from ptcc_certify.graphs.declared_option import options_of
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import OPTIONAL, UNCERTAINTY
from ptcc_certify.model.constrained_switching import (
    CLOCK_DWELL,
    WINDOWS_OF_TIME,
    ClockShares,
    DwellTime,
    JointWindows,
    SignalClass,
)
from ptcc_certify.model.refusals import NOT_OF_FAMILIES

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol
    from ptcc_certify.theorems.family_behaviour import FamilyComponent

#: Options of certify that families do not take; agents are refused by themselves, disturbances by the protocol.
_NOT_OF_FAMILIES = tuple(
    name
    for name in options_asking(["method", *NOT_OF_FAMILIES])
    if name not in ("agents", "disturbance", "delta", "noise", "gain_cap")
)


def edges_named(
    context: click.Context, parameter: click.Parameter, texts: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    """Return the edges that an option such as ``--optional`` names."""
    pairs = []
    for text in () if context.resilient_parsing else texts:
        try:
            ends = [end.strip() for end in items_of(text)]
        except csv.Error:
            ends = []
        if len(ends) != 2 or not all(ends):
            raise ParameterError(f"{parameter.opts[0]}: {shorten(text)} is no edge; write SOURCE,TARGET, such as a,b")
        pairs.append((ends[0], ends[1]))
    return tuple(pairs)


_DWELL = options_of(DwellTime)["least"]
#: Options that make a family of graphs; and those that tell for which signals it is asked, too.
mode_options = together(
    click.option("--switching", is_flag=True, help="Family: the graphs are modes, of which any may act at any time."),
    click_option(UNCERTAINTY),
    click_option(OPTIONAL, callback=edges_named),
)
family_options = together(mode_options, click_option(SIGNAL))
#: Of ptcc simulate, in the words of ptcc certify, which claims more for such signals.
dwell_options = together(
    click_option(_DWELL, help="Families: at least so much time between switches."),
    click_option(CLOCK_DWELL, help="Families: the same on the stretched clock, which is infinite at T."),
)
restricted_options = together(
    click_option(_DWELL),
    click_option(CLOCK_DWELL),
    options_for(JointWindows),
    click.option("--window", metavar="H", hidden=True),
    options_for(ClockShares),
)


#: What restricts signals, by the names of the options.
_RESTRICTED = ("dwell", "clock_dwell", "window", "clock_window", "window_on", "share")


def dwell_of(options: shared.Options) -> DwellTime | None:
    """Return the dwell time of time or of the clock, or refuse both at once; None if there is none."""
    dwells = {"t": options["dwell"], "s": options["clock_dwell"]}
    given = [DwellTime(least, clock=clock) for clock, least in dwells.items() if least is not None]
    if len(given) > 1:
        raise ParameterError("--dwell is of time, --clock-dwell of the clock: give one of them")
    return given[0] if given else None


def signals_of(options: shared.Options) -> SignalClass:
    """Return the signals of which more is asked, or refuse two kinds of them at once."""
    if options["window"] is not None:
        raise ParameterError(f"--window: {WINDOWS_OF_TIME}: --clock-window with --window-on instead")
    dwell = dwell_of(options)
    given: list[Any] = [] if dwell is None else [dwell]
    length, on = options["clock_window"], options["window_on"]
    if (length is None) != (on is None):
        raise ParameterError(
            "--clock-window is the length of windows, --window-on what each edge is on in them: give both"
        )
    given += [] if length is None else [JointWindows(length, on=on, clock="s")]
    given += [ClockShares(options["share"])] if options["share"] else []
    if len(given) > 1:
        raise ParameterError("dwell times, windows and shares are for signals of different kinds: give one of them")
    if given and options["signal"] == "constant":
        raise ParameterError("--signal constant never switches: leave dwell times, windows and shares out")
    if given and options.get("kind") == "sliding-mode":
        flag = flag_of(next(name for name in _RESTRICTED if options.get(name)))
        raise ParameterError(
            f"{flag}: restricted signals are certified under the nominal protocol; leave it out, or take "
            "--protocol nominal"
        )
    return given[0] if given else options["signal"]


def refuse_restricted(options: shared.Options) -> None:
    """Refuse restricted signals where one graph acts for ever."""
    for name in _RESTRICTED:
        if options.get(name):
            raise ParameterError(f"{flag_of(name)} is for families of graphs; this is one graph: leave it out")


def read_graph_or_family(graphs: tuple[str, ...], options: shared.Options) -> SignedDigraph | Family:
    """Return what files and options make: a family, or the graph where there is one, with known weights."""
    if len(graphs) > 1 and not options["switching"]:
        named = shorten(", ".join(graphs), 200)
        mend = "add --switching if any of them may act at any time; ptcc batch takes many, each by itself"
        raise ParameterError(f"{named}: {len(graphs)} graphs; {mend}")
    if len(graphs) == 1 and options["switching"] and not click.get_current_context().params.get("quiet"):
        click.echo("note: --switching with one graph changes nothing; name the other modes beside it", err=True)
    return graph_or_family(files_of(graphs), options)


def graph_or_family(files: Sequence[Any], options: shared.Options) -> SignedDigraph | Family:
    """Return the family of files, read as the options say, or the graph where there is one, with known weights."""
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.graphs.io import read_family
    from ptcc_certify.graphs.io.interval_rows import is_family_file

    uncertain, of_intervals = options["uncertainty"] is not None or options["optional"], is_family_file(files[0])
    one = len(files) == 1 and not uncertain and not of_intervals
    family = None if one else read_family(files, **family_keywords(options))
    graph = None if family is None else family.graph
    if one or (graph is not None and not of_intervals):
        graph = shared.read_alone(files[0], options)
    if graph is not None and not isinstance(alone := shared.with_stubborn(graph, options), Family):
        return alone
    return shared.with_stubborn(family or read_family(files, **family_keywords(options)), options)


def family_keywords(options: shared.Options) -> dict[str, Any]:
    """Return what ``read_family`` is told by the options."""
    more = {"uncertainty": options["uncertainty"] or 0, "optional": options["optional"]}
    return shared.reading_of(options) | more


def files_of(graphs: tuple[str, ...]) -> list[Any]:
    """Return the files of graphs that a command line names; standard input as one that is read more than once."""
    if graphs.count("-") > 1:
        raise ParameterError("- stands for standard input, which is one graph; name files for the others")
    return [_standard_input() if graph == "-" else shared.graph_file(graph) for graph in graphs]


def _standard_input() -> BytesIO:
    """Return standard input as a file that is read more than once."""
    from ptcc_certify.graphs.io.files import read_bytes

    file = BytesIO(read_bytes(shared.graph_file("-"), "standard input"))
    file.name = "standard input"  # type: ignore[attr-defined]
    return file


def names_of_family(graphs: tuple[str, ...], family: Family, options: shared.Options) -> tuple[str, str]:
    """Return what a family is called, and how its rows were read."""
    from ptcc_certify.graphs.io.graph_files import MATRICES
    from ptcc_certify.report.facts.graph import ORIENTATION

    way = (
        family.read.get("orientation")
        or options["edges"]
        or ("matrix" if PurePath(graphs[0]).suffix[1:] in MATRICES else "information")
    )
    read = ORIENTATION[way]
    if any(mode.tied for mode in family.modes):
        read += "; undirected, both directions change together"
    return ", ".join(PurePath(graph).name for graph in graphs), read


def classify_family(
    graphs: tuple[str, ...], family: Family, expect: str | None, as_json: bool, screen: Screen, options: shared.Options
) -> int:
    """Tell what every signal does, decided on edges."""
    from ptcc_certify.theorems.family_behaviour import decide

    components = decide(family, options["signal"])
    _show_decision(graphs, family, components, as_json, screen, options)
    return _expected(components, expect)


def _show_decision(
    graphs: tuple[str, ...],
    family: Family,
    components: Sequence[FamilyComponent],
    as_json: bool,
    screen: Screen,
    options: shared.Options,
) -> None:
    from ptcc_certify.certificate.graph_sections import decision_document
    from ptcc_certify.report.facts.graph import decision_facts

    if as_json:
        print_json(decision_document(family, components))
        return
    name, read = names_of_family(graphs, family, options)
    screen.show(lambda details: decision_facts(components, family, name, read, details))


def _expected(components: Sequence[FamilyComponent], expect: str | None) -> int:
    """Tell on standard error what became of an expectation, and what is left undecided; return the exit code."""
    from ptcc_certify.certificate.assessment import MET, REFUTED
    from ptcc_certify.certificate.judgements import judge_family_behaviour
    from ptcc_certify.certificate.verdict import NEXT_STEP

    if expect is not None:
        answer = judge_family_behaviour(components, expect)
        if answer.status == REFUTED:
            click.echo(one_line(f"refuted: {answer}"), err=True)
            return ExitCode.REFUTED
        if answer.status == MET:
            return ExitCode.OK
    if any(component.behaviour is None for component in components):
        click.echo(f"undecided: {NEXT_STEP}", err=True)
        return ExitCode.UNDECIDED
    return ExitCode.OK


def asked_signal(family: Family, protocol: Protocol, options: shared.Options) -> SignalClass:
    """Return the signals of which more is asked of a family, or refuse what is certified of one graph alone."""
    from ptcc_certify.certificate.constrained_switching.search import require_nominal

    refuse_options(options, certified=True)
    _refuse_disturbance(options)
    given, modes = len(options["share"]), len(family.modes)
    if given not in (0, modes):
        raise ParameterError(f"--share: {given} given, and {modes} modes; give one for each, outages too")
    signal = signals_of(options)
    require_nominal(signal, protocol)
    return signal


def decided_alone(
    graphs: tuple[str, ...], family: Family, output: str | None, as_json: bool, screen: Screen, options: shared.Options
) -> int | None:
    """Show what fixed weights do of which no certificate is made, and return the exit code; None where one is."""
    from ptcc_certify.theorems.family_behaviour import decide

    left = _constant_alone(decide(family, "constant"), decide(family)) if options["signal"] == "constant" else ()
    if not left:
        return None
    if options["max_input"] is not None or options["min_rate"] is not None:
        raise ParameterError("--min-rate and --max-input: no rate is certified of members that end differently")
    _show_decision(graphs, family, left, as_json, screen, options)
    return _judged_alone(left, options["expect"], output)


def _judged_alone(components: Sequence[FamilyComponent], expect: str | None, output: str | None) -> int:
    """Tell what became of an expectation of fixed weights, of which no certificate is made; return the exit code."""
    from ptcc_certify.certificate.assessment import MET
    from ptcc_certify.certificate.judgements import judge_family_behaviour

    code = _expected(components, expect)
    met = expect is not None and judge_family_behaviour(components, expect).status == MET and not output
    if output:
        click.echo("note: of fixed weights that are unknown no certificate is made; nothing was written", err=True)
    status = f"met: {expect}" if met else "undecided"
    click.echo(f"{status}: of fixed weights that are unknown the behaviour is decided, no rate is certified", err=True)
    return ExitCode.OK if met else code or ExitCode.UNDECIDED


def _refuse_disturbance(options: shared.Options) -> None:
    """Refuse a disturbance on the command line; one of a scenario is for ptcc simulate."""
    given = click.get_current_context().get_parameter_source("disturbance") == ParameterSource.COMMANDLINE
    if given and options["disturbance"] is not None:
        raise ParameterError(
            "--disturbance: no run is made of a family; it is certified for every one within --delta: leave it out"
        )


def refuse_options(options: shared.Options, certified: bool = False) -> None:
    """Refuse what is asked of one graph alone, on the command line or in a scenario.

    A cap of the gain, disturbances and noise are certified of families, and neither drawn nor simulated.
    """
    source, nominal = click.get_current_context().get_parameter_source, options["kind"] == "nominal"
    foreign = [*_NOT_OF_FAMILIES, *(["disturbance"] if nominal else [])]
    foreign += [] if certified else ["gain_cap", "noise", *(["delta"] if nominal else [])]
    for name in (name for name in foreign if name in options):
        given = source(name) in (ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP)
        if given and options[name] not in (None, False):
            raise ParameterError(f"{flag_of(name)} is for one graph, not for families yet; leave it out")


def _constant_alone(constant: Sequence[FamilyComponent], every: Sequence[FamilyComponent]) -> Sequence[FamilyComponent]:
    """Return what constant signals do where neither all signals nor single modes show it; nothing where they do."""
    from ptcc_certify.theorems.family_behaviour import DEPENDS, last_mode_behaviours

    follows = all(
        None not in last_mode_behaviours(other) if other.behaviour == DEPENDS else one.behaviour == other.behaviour
        for one, other in zip(constant, every, strict=True)
    )
    return () if follows else constant
