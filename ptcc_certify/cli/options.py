"""Options that several commands share, and what becomes of them: graphs, protocols, initial states, numbers.

Commands take theirs as keywords; the functions here take what they need from these.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lmi.exact.decimal_rounding import counted, near
from ptcc_certify.cli import click_options as declared
from ptcc_certify.cli.scenario import graph_of, is_scenario, kind_of_protocol, read_scenario, takes_one_graph
from ptcc_certify.errors import Change, ParameterError
from ptcc_certify.graphs.declared_option import options_of
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import PREJUDICE, STUBBORN, Reading, option_flags
from ptcc_certify.graphs.recognised_files import TOML, kind_of, refuse_as_certificate, refuse_as_graph, shell_word
from ptcc_certify.model import NominalProtocol, Protocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, Expectations, GainLimits, InitialState, Run

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family

#: What the commands are given, by the names of their parameters.
Options = Mapping[str, Any]

#: Options that tell how a graph is read, and limits of the gain, by the names of their parameters.
READING, LIMITS = declared.names_of(Reading), declared.names_of(GainLimits)
#: What is told of a file that was asked for where nothing is certified.
NOTHING_WRITTEN = "note       nothing is certified, and nothing was written"


def with_flags(command: click.Command, error: ParameterError) -> ParameterError:
    """Return an error of the library that names flags of a command where it named parameters.

    Examples
    --------
    >>> command = click.Command("certify", params=[click.Option(["--gain-cap"]), click.Option(["--rest"])])
    >>> error = ParameterError("rest", ("= 1: for an unlimited gain; leave ", Change("gain_cap"), " out"))
    >>> print(with_flags(command, error))
    --rest = 1: for an unlimited gain; leave --gain-cap out
    """
    flags = {p.name: p.opts[0] for p in command.params if isinstance(p, click.Option)}

    def flag(change: Change) -> str:
        name = declared.IN_LIBRARY.get(change.field, change.field)
        return f"{flags[name]} {change.number}".rstrip() if name in flags else str(change)

    return ParameterError(error.told(flag))


def _behaviour(context: click.Context, parameter: click.Parameter, text: str | None) -> str | None:
    """Return the behaviour that ``--expect`` names."""
    if text is None or context.resilient_parsing:
        return text
    from ptcc_certify.graphs.structure import behaviour_name

    try:
        return behaviour_name(text)
    except ValueError as error:
        raise ParameterError(f"--expect: {error}") from None


def _certificate(context: click.Context, parameter: click.Parameter, path: str) -> str:
    """Return the path of a certificate, or refuse what is none."""
    if not context.resilient_parsing:
        refuse_as_certificate(path, context.info_name == "check")
    return path


#: What is asked of ``-o`` where a certificate is written, and which command writes that.
_OTHER_OUTPUTS = {
    **dict.fromkeys((".html", ".htm", ".tex"), "save it as FILE.json, then ptcc report FILE.json -o {}"),
    **dict.fromkeys((".png", ".pdf", ".svg"), "save it as FILE.json, then ptcc plot FILE.json -o {}"),
    ".csv": "the run as a table: ptcc simulate GRAPH -o {}",
    ".toml": "a scenario: ptcc new GRAPH -o {}",
}


def _certificate_output(context: click.Context, parameter: click.Parameter, output: str | None) -> str | None:
    """Return the file for a certificate, or refuse what another command writes."""
    mend = _OTHER_OUTPUTS.get(PurePath(output or "").suffix.lower())
    if output and not context.resilient_parsing and PurePath(output).suffix.lower() not in ("", ".json"):
        mend = mend or "let the name end in .json"
        raise ParameterError(f"{output}: -o writes the certificate, which is JSON; {mend.format(shell_word(output))}")
    return output


def expect_option(text: str) -> declared.Decorator:
    """Return the option that names the behaviour that is asked for."""
    return declared.one_of(Expectations, "behaviour", callback=_behaviour, help=text)


#: How graphs are read, and who is stubborn in them; the former alone.
plain_reading_options = declared.options_for(Reading)
reading_options = declared.together(plain_reading_options, declared.click_option(STUBBORN))
prejudice_option = declared.click_option(PREJUDICE)
#: GRAPH, or SCENARIO.toml, whose other keys become defaults of the options; hence it is read before these.
graph_argument = click.argument(
    "graph", metavar="GRAPH|SCENARIO.toml", is_eager=True, callback=graph_of, type=click.Path()
)
#: The same where several graphs are the modes of a family.
graphs_argument = click.argument(
    "graph",
    nargs=-1,
    required=True,
    metavar="GRAPH..|SCENARIO.toml",
    is_eager=True,
    callback=graph_of,
    type=click.Path(),
)
certificate_argument = click.argument("certificate", callback=_certificate, type=click.Path())


def kind_option(text: str) -> declared.Decorator:
    """Return the option that tells the protocol; it comes before the others, which may be of one protocol alone."""
    told = replace(declared.KIND, help=text)
    more: dict[str, Any] = {
        "type": click.Choice(list(told.choices), case_sensitive=False),
        "default": told.default,
        "help": told.help,
    }
    return click.option(told.flag, told.name, is_eager=True, callback=kind_of_protocol, **more)


protocol_options = declared.together(
    kind_option(declared.KIND.help),
    declared.options_for(NominalProtocol),
    declared.one_of(InitialState, "x0", default="random"),
    declared.one_of(Run, "seed"),
    declared.options_for(SlidingModeProtocol),
    declared.one_of(Asks, "disturbance"),
    declared.one_of(InitialState, "sigma0"),
)
limit_options = declared.options_for(GainLimits)
method_option = declared.one_of(Asks, "method")
initial_bound_option = declared.one_of(Asks, "initial_set")
#: Of a scenario, for commands that only draw x(0): where it is random, it begins within the set.
random_within_option = declared.one_of(Asks, "initial_set", hidden=True)
memory_option = click.option(
    "--memory",
    type=click.FloatRange(min=0, min_open=True, max=1000),
    default=1,
    metavar="GB",
    help="What the check may take; a certificate that may take more is refused.",
)
time_unit_option = click.option(
    "--time-unit", metavar="UNIT", default="", show_default=False, help="Of time on the axes of figures, such as s."
)
time_limit_option = declared.one_of(Asks, "time_limit")
output_option = click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False),
    callback=_certificate_output,
    help="Write the certificate to this file, such as FILE.json.",
)


class OneGraph(declared.Command):
    """A command about one graph, which says so if it is given several."""

    first = (*declared.Command.first, "max_input", "initial_bound", "deadline", "shortest_deadline", "residual")

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Return what is left of the arguments: nothing."""
        ctx.allow_extra_args = True
        rest = super().parse_args(ctx, args)
        if rest and not ctx.resilient_parsing:
            raise ParameterError(takes_one_graph(self.name))
        return rest


def refuse_beside_certificate(path: str, taken: Sequence[str]) -> None:
    """Refuse what is given on the command line about a graph where a certificate stands in its place."""
    context = click.get_current_context()
    for parameter in context.command.params:
        given = context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if given and parameter.name not in taken:
            raise ParameterError(f"{parameter.opts[0]} is for a graph; the certificate {path} has its own")


def written(certificate: Certificate, output: str) -> str:
    """Return what is said of a certificate that was saved, with its side files."""
    count = len(certificate.for_check()[1])
    if not count:
        return f"written    {output}"
    return f"written    {output} and {counted(count, 'side file')} in the same folder, which go with it"


json_option = click.option("--json", "as_json", is_flag=True, help="Print exactly one JSON object.")


def graph_file(graph: str) -> Any:
    """Return the file of a graph, of a packaged one where no such file exists, of a scenario that of its graph."""
    from ptcc_certify.graphs.io.packaged import GRAPHS, graph_path

    if graph == "-" and sys.stdin is None:
        raise ParameterError("standard input is closed; name a file")
    if is_scenario(graph) and kind_of(graph) in TOML:
        graph = read_scenario(graph).graph
    if graph in GRAPHS and kind_of(graph) in ("missing", "a folder"):
        return graph_path(graph)
    refuse_as_graph(graph)
    return graph


def read(graph: Any, options: Options) -> SignedDigraph:
    """Read GRAPH, or a file object, as the options say, stubborn agents included."""
    from ptcc_certify.graphs.family import Family

    given = with_stubborn(read_alone(graph, options), options)
    if isinstance(given, Family):
        command = click.get_current_context().command.name
        raise ParameterError(f"--stubborn: an interval makes a family; {takes_one_graph(command)}; give one number")
    return given


def read_alone(graph: Any, options: Options) -> SignedDigraph:
    """Read GRAPH, or a file object, as the options say, without prejudices of stubborn agents."""
    from ptcc_certify.graphs.io import read_graph

    file = graph_file(graph) if isinstance(graph, str) else graph
    return read_graph(file, **reading_of(options))


def with_stubborn(given: SignedDigraph | Family, options: Options) -> SignedDigraph | Family:
    """Return a graph or a family with the prejudices of the agents that ``--stubborn`` names."""
    if options.get("stubborn") is None:
        return given
    from ptcc_certify.graphs.io import with_stubborn as making

    return making.with_stubborn(given, options["stubborn"])


def reading_of(options: Options) -> dict[str, Any]:
    """Return how a graph is read, as the keywords of ``read_graph``; what is not among the options is left out.

    Examples
    --------
    >>> reading_of({"edges": "listens", "undirected": False, "T": "1"})
    {'orientation': 'listens', 'undirected': False}
    """
    return {field: options[told.name] for field, told in options_of(Reading).items() if told.name in options}


def reading_words(options: Options) -> list[str]:
    """Return how a graph is read, as words of the command line."""
    way = [] if options["edges"] is None else ["--edges", options["edges"]]
    stubborn = [] if options.get("stubborn") is None else ["--stubborn", options["stubborn"]]
    return way + [word for flag in option_flags(options) for word in flag.split(" ", 1)] + stubborn


def protocol_of(options: Options, disturbed: tuple[str, ...] = ("delta",)) -> Protocol:
    """Return the protocol; ``disturbed`` are the options about disturbances that the nominal one takes too."""
    nominal = options["kind"] == "nominal"
    other = "sliding-mode" if nominal else "nominal"
    foreign = (*declared.OF_PROTOCOL["sliding-mode"], "delta") if nominal else declared.OF_PROTOCOL["nominal"]
    for name in foreign:
        if options.get(name) is not None and name not in disturbed:
            mend = "the deadline is --T-r plus --T-s" if name == "T" else "leave it out or change the protocol"
            raise ParameterError(f"{declared.flag_of(name)} belongs to --protocol {other}; {mend}")
    kind = NominalProtocol if nominal else SlidingModeProtocol
    given = {field.name: options[field.name] for field in fields(kind)}
    return kind(**{name: value for name, value in given.items() if value is not None})


def asks_of(options: Options) -> Asks:
    """Return what is asked of single graphs and families, beside disturbances and noise."""
    most = options["max_input"]
    if most is not None and most <= 0:
        raise ParameterError("--max-input is outside its domain; it must be > 0")
    given = declared.given_of(Asks, options)
    asks = {field: value for field, value in given.items() if field not in ("noise", "disturbance")}
    return Asks(**asks, expectations=Expectations(**declared.given_of(Expectations, options)))


def sigma0_of(protocol: Protocol, options: Options, graph: SignedDigraph) -> list[Fraction] | None:
    """Return ``sigma(0)``; None under the nominal protocol."""
    if protocol.reaching is None:
        return None
    text = options["sigma0"]
    if text is None or ("0" in text and not text.strip("0. ")):
        return [Fraction(0)] * graph.n_nodes
    return read_initial_state(text, [options["seed"], 1], graph, "--sigma0: sigma(0)")


def disturbance_of(protocol: Protocol, options: Options, graph: SignedDigraph) -> Any:
    """Return what a run meets under the sliding-mode protocol, by default the worst; None under the nominal one."""
    from ptcc_certify.model.disturbance import as_disturbance

    if (sliding := protocol.reaching) is None:
        return None
    source = "worst-case" if options["disturbance"] is None else options["disturbance"]
    return as_disturbance(source, graph.n_nodes, sliding.delta, 2 * float(protocol.T), options["seed"])


def run_keywords(protocol: Protocol, options: Options, graph: SignedDigraph) -> dict[str, Any]:
    """Return what acts on a simulated run, as the library takes it."""
    if protocol.reaching is not None:
        sigma0 = sigma0_of(protocol, options, graph)
        return {"sigma0": sigma0, "disturbance": disturbance_of(protocol, options, graph)}
    from ptcc_certify.simulation.nominal import Bounded

    delta, disturbance = options["delta"], options["disturbance"]
    if (delta is None) != (disturbance is None):
        given, other = ("--disturbance", "--delta") if delta is None else ("--delta", "--disturbance")
        raise ParameterError(f"{given}: a disturbance of the nominal protocol has a bound; give {other} too")
    met = None if delta is None else Bounded(disturbance, delta)
    return {"actuator": actuator_of(options), "disturbance": met}


def actuator_of(options: Options) -> GainLimits | None:
    """Return the limits of the gain; None if there are none."""
    actuator = GainLimits(**{name: options[name] for name in LIMITS})
    return None if actuator.ideal else actuator


def limits_of(options: Options) -> tuple[GainLimits, ...]:
    """Return the limits of the gain; none if there are none."""
    actuator = actuator_of(options)
    return () if actuator is None else (actuator,)


def initial_state_of(options: Options, graph: SignedDigraph, within: Fraction | None = None) -> list[Fraction]:
    """Return the initial state that ``--x0`` and ``--prejudice`` give, or draw one, of size ``within`` at most."""
    state = read_initial_state(options["x0"], options["seed"], graph, within=within)
    return [row[0] for row in with_prejudices([[x] for x in state], options, graph)]


def with_prejudices(rows: Sequence[Any], options: Options, graph: SignedDigraph) -> Sequence[Any]:
    """Return rows of numbers of each agent, with those of prejudices that ``--prejudice`` tells."""
    from ptcc_certify.graphs.io.with_stubborn import told_by_agent
    from ptcc_certify.graphs.labels import first_five
    from ptcc_certify.graphs.stubborn import prejudices

    if options.get("prejudice") is None:
        return rows
    nodes = {graph.labels[agent]: node for node, agent in prejudices(graph).items()}
    if not nodes:
        raise ParameterError("--prejudice is of stubborn agents; name them by --stubborn, or leave it out")
    if len(rows[0]) > 1:
        raise ParameterError('--prejudice: is one number; of vectors give rows "a\'s prejudice,x,y" of --x0 FILE.csv')
    told = told_by_agent(options["prejudice"], [*nodes], "--prejudice")
    if odd := next((label for label in told if label not in nodes), None):
        raise ParameterError(f"--prejudice: {shorten(odd)} is not stubborn; stubborn are {first_five([*nodes])}")
    numbers = {nodes[label]: declared.exact_number(text, "--prejudice") for label, text in told.items()}
    for node, agent in prejudices(graph).items():
        if node in numbers and rows[node] not in ([numbers[node]], rows[agent]):  # of an agent unless it was given
            given = f"--x0 gives {shorten(graph.labels[node])} {near(rows[node][0])}"
            raise ParameterError(f"--prejudice: {given}, and this {near(numbers[node])}; keep one")
    return [[numbers[k]] if k in numbers else row for k, row in enumerate(rows)]


def read_initial_state(
    x0: str, seed: Any, graph: SignedDigraph, name: str = "initial state", within: Fraction | None = None
) -> list[Fraction]:
    """Return the initial state that ``--x0`` gives, or ``sigma(0)`` that ``--sigma0`` gives, or draw one.

    A random one is at most 10 in size, and at most ``within``.
    """
    from ptcc_certify.graphs.io.states import draw_states, read_state

    if x0 == "random":
        scale = Fraction(1) if within is None else min(Fraction(1), abs(within) / 10)
        return [scale * x for (x,) in draw_states(seed, graph, name)]
    return read_state(x0, graph, name)
