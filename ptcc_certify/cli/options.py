"""Options that several commands share, and what becomes of them: graphs, protocols, initial states, numbers.

Commands take theirs as keywords; the functions here take what they need from these.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click

from ptcc_certify.cli.scenario import (
    FOREIGN,
    IN_LIBRARY,
    graph_of,
    is_scenario,
    kind_of_protocol,
    read_scenario,
    takes_one_graph,
)
from ptcc_certify.errors import Change, ParameterError, PTCCError
from ptcc_certify.graphs.kinds_of_file import TOML, kind_of, refuse_as_certificate, refuse_as_graph, shell_word
from ptcc_certify.graphs.reading import OPTIONS, option_flags

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols import Protocol
    from ptcc_certify.protocols.gain_limits import GainLimits

#: What the commands are given, by the names of their parameters.
Options = Mapping[str, Any]

#: Options that tell how a graph is read, by the names of their parameters; ``edges`` is the orientation.
READING = ("edges", *OPTIONS[1:])
LIMITS = ("gain_cap", "stop_before", "sample_period")
#: Parameters of the sliding-mode protocol: what they are by default, and what they are.
_SLIDING = {
    "T_r": ("0.5", "Sliding mode: time to reach the manifold."),
    "T_s": ("0.5", "Sliding mode: time on it; the deadline is T_r + T_s."),
    "mu1": ("2", "Sliding mode: switching gain, above delta."),
    "mu2": ("1", "Sliding mode: constant part of the reaching gain."),
    "mu3": ("1", "Sliding mode: factor of its growing part."),
    "delta": ("sliding mode: 1; nominal: none", "Bound of every disturbance."),
}
#: What is told of a file that was asked for where nothing is certified.
NOTHING_WRITTEN = "note       nothing is certified, and nothing was written"
#: Options that are times.
_TIMES = ("--sample-period", "--stop-before", "--deadline", "--at")


def flag_of(name: str) -> str:
    """Return the flag of a parameter."""
    return f"--{name.replace('_', '-')}"


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
        name = IN_LIBRARY.get(change.field, change.field)
        return f"{flags[name]} {change.number}".rstrip() if name in flags else str(change)

    return ParameterError(error.told(flag))


def _exact(context: click.Context, parameter: click.Parameter, text: str | None) -> Fraction | None:
    """Return the exact number that an option gives, None if it was not given."""
    return None if text is None or context.resilient_parsing else exact_number(text, parameter.opts[0])


def exact_number(text: str, flag: str) -> Fraction:
    """Return the exact number that a text of an option stands for."""
    from ptcc_certify.graphs.rationals import parse_exact

    try:
        return parse_exact(text)
    except PTCCError as error:
        mend = "; give a number in your unit of time, such as 0.001" if flag in _TIMES else ""
        raise ParameterError(f"{flag}: {error}{mend}") from None


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


def options_of(*decorators: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return one decorator of several, which adds their options in this order."""

    def apply(function: Any) -> Any:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return apply


#: Options whose value is an exact number.
number_option = partial(click.option, callback=_exact)
#: Options that are true or false, also where a scenario has the other.
_switch = partial(click.option, default=False, show_default=False)


def expect_option(text: str) -> Callable[[Any], Any]:
    """Return the option that names the behaviour that is asked for."""
    return click.option("--expect", metavar="BEHAVIOUR", callback=_behaviour, help=text)


reading_options = options_of(
    click.option(
        "--edges",
        type=click.Choice(["information", "listens"]),
        help="Row a,b (or entry a,b of a matrix): flows a -> b, or a listens.  [default: information; matrix: listens]",
    ),
    click.option(
        "--duplicates",
        type=click.Choice(["refuse", "sum", "last"]),
        default="refuse",
        help="What becomes of two rows for one ordered pair.",
    ),
    _switch("--drop-self-loops/--no-drop-self-loops", help="Ignore edges of a node to itself."),
    _switch("--drop-zeros/--no-drop-zeros", help="Ignore edges of weight 0."),
    _switch("--undirected/--no-undirected", help="Every row counts in both directions."),
    click.option(
        "--laplacian/--no-laplacian",
        default=None,
        help="The matrix is a signed Laplacian D - W, or none though its diagonal holds the sums.",
    ),
    click.option("--columns", metavar="A,B,W", help="Source, target and weight of a table: titles, or numbers from 1."),
    click.option("--variable", metavar="NAME", help="Which matrix, network or relation of a file with several."),
)
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


def kind_option(text: str) -> Callable[[Any], Any]:
    """Return the option that tells the protocol; it comes before the others, which may be of one protocol alone."""
    return click.option(
        "--protocol",
        "kind",
        type=click.Choice(["nominal", "sliding-mode"]),
        default="nominal",
        is_eager=True,
        callback=kind_of_protocol,
        help=text,
    )


protocol_options = options_of(
    kind_option("Nominal, or sliding mode, which disturbances within delta do not move."),
    click.option("--T", "T", metavar="NUMBER", help="Nominal: the deadline.  [default: 1]"),
    click.option("--rho1", metavar="NUMBER", default="1", help="Constant part of the gain."),
    click.option("--rho2", metavar="NUMBER", default="1", help="Factor of the growing part of the gain."),
    click.option("--kappa", metavar="NUMBER", default="2", help="Exponent of the time scaling."),
    click.option(
        "--x0", metavar="STATE", default="random", help="Initial state: 5,2,-4 | label=value,... | FILE.csv | random"
    ),
    click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of random initial states."),
    *(
        click.option(flag_of(name), name, metavar="NUMBER", help=f"{text}  [default: {value}]")
        for name, (value, text) in _SLIDING.items()
    ),
    click.option(
        "--disturbance",
        metavar="EXPR",
        help="Of the simulated run: an expression of k and t, worst-case (sliding mode), telegraph or none."
        "  [default: worst-case]",
    ),
    click.option(
        "--sigma0", metavar="STATE", help="Sliding mode: like --x0; 0 leaves no reaching phase.  [default: 0]"
    ),
)
limit_options = options_of(
    number_option("--gain-cap", metavar="G", help="Nominal: the gain is at most G."),
    number_option("--stop-before", metavar="EPS", help="Nominal: the input is 0 from T - EPS on."),
    number_option("--sample-period", metavar="H", help="Nominal: gain and input are held over periods H."),
)
method_option = click.option(
    "--method",
    type=click.Choice(["best", "paper", "perron", "lmi", "full"]),
    default="best",
    help="Lyapunov functions searched beside the paper's.",
)
initial_bound_option = number_option(
    "--initial-bound", metavar="R", help="Bound the input for all initial states within |x_k(0)| <= R, not --x0."
)
#: Of a scenario, for commands that only draw x(0): where it is random, it begins within the set.
random_within_option = number_option("--initial-bound", hidden=True)
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
time_limit_option = click.option(
    "--time-limit",
    type=float,
    metavar="SECONDS",
    help="Of wall time, for simulation and searches of a graph together, not for decisions and checks; near it what is "
    "found may differ from run to run.  [default: the work of 60 s, and of 1 s more for every 1,000 nodes, which does "
    "not depend on how busy the machine is]",
)
output_option = click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False),
    callback=_certificate_output,
    help="Write the certificate to this file, such as FILE.json.",
)


class OneGraph(click.Command):
    """A command about one graph, which says so if it is given several."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Return what is left of the arguments: nothing."""
        ctx.allow_extra_args = True
        rest = super().parse_args(ctx, args)
        if rest and not ctx.resilient_parsing:
            raise ParameterError(takes_one_graph(self.name))
        return rest


def written(certificate: Certificate, output: str) -> str:
    """Return what is said of a certificate that was saved, with its side files."""
    count = len(certificate.for_check()[1])
    beside = f" and {count} side file{'s' * (count > 1)} in the same folder, which go with it" if count else ""
    return f"written    {output}{beside}"


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
    """Read GRAPH, or a file object, as the options say."""
    from ptcc_certify.graphs.io import read_graph

    file = graph_file(graph) if isinstance(graph, str) else graph
    return read_graph(file, **reading_of(options))


def reading_of(options: Options) -> dict[str, Any]:
    """Return how a graph is read, as the keywords of ``read_graph``; what is not among the options is left out.

    Examples
    --------
    >>> reading_of({"edges": "listens", "undirected": False, "T": "1"})
    {'orientation': 'listens', 'undirected': False}
    """
    return {"orientation" if name == "edges" else name: options[name] for name in READING if name in options}


def reading_words(options: Options) -> list[str]:
    """Return how a graph is read, as words of the command line."""
    way = [] if options["edges"] is None else ["--edges", options["edges"]]
    return way + [word for flag in option_flags(options) for word in flag.split(" ", 1)]


def protocol_of(options: Options, disturbed: tuple[str, ...] = ("delta",)) -> Protocol:
    """Return the protocol; ``disturbed`` are the options about disturbances that the nominal one takes too."""
    from ptcc_certify.protocols import NominalProtocol, SlidingModeProtocol

    shared = {name: options[name] for name in ("rho1", "rho2", "kappa")}
    nominal = options["kind"] == "nominal"
    other = "sliding-mode" if nominal else "nominal"
    for name in (*FOREIGN[options["kind"]], *["delta"] * nominal):
        if options.get(name) is not None and name not in disturbed:
            mend = "the deadline is --T-r plus --T-s" if name == "T" else "leave it out or change the protocol"
            raise ParameterError(f"{flag_of(name)} belongs to --protocol {other}; {mend}")
    if nominal:
        return NominalProtocol(T="1" if options["T"] is None else options["T"], **shared)
    defaults = {name: default for name, (default, _) in _SLIDING.items()} | {"delta": "1"}
    own = {name: default if options[name] is None else options[name] for name, default in defaults.items()}
    return SlidingModeProtocol(**own, **shared)


def sliding_keywords(protocol: Protocol, options: Options, graph: SignedDigraph) -> dict[str, Any]:
    """Return ``sigma0`` and ``disturbance`` as the library takes them; nothing for the nominal protocol."""
    from ptcc_certify.protocols.disturbance import as_disturbance

    if (sliding := protocol.reaching) is None:
        return {}
    source = "worst-case" if options["disturbance"] is None else options["disturbance"]
    horizon, seed = 2 * float(protocol.T), options["seed"]
    return {
        "sigma0": _sigma0(options["sigma0"], seed, graph),
        "disturbance": as_disturbance(source, graph.n_nodes, sliding.delta, horizon, seed),
    }


def run_keywords(protocol: Protocol, options: Options, graph: SignedDigraph) -> dict[str, Any]:
    """Return what acts on a simulated run, as the library takes it."""
    if protocol.reaching is not None:
        return sliding_keywords(protocol, options, graph)
    return {"actuator": actuator_of(options)} | {name: options[name] for name in ("delta", "disturbance")}


def actuator_of(options: Options) -> GainLimits | None:
    """Return the limits of the gain; None if there are none."""
    from ptcc_certify.protocols.gain_limits import GainLimits

    actuator = GainLimits(**{name: options[name] for name in LIMITS})
    return None if actuator.ideal else actuator


def _sigma0(text: str | None, seed: int, graph: SignedDigraph) -> list[Fraction]:
    if text is None or ("0" in text and not text.strip("0. ")):
        return [Fraction(0)] * graph.n_nodes
    return read_initial_state(text, [seed, 1], graph, "--sigma0: sigma(0)")


def read_initial_state(
    x0: str, seed: Any, graph: SignedDigraph, name: str = "initial state", within: Fraction | None = None
) -> list[Fraction]:
    """Return the initial state that ``--x0`` gives, or ``sigma(0)`` that ``--sigma0`` gives, or draw one.

    A random one is at most 10 in size, and at most ``within``.
    """
    from ptcc_certify.graphs.io import random_states, read_state

    if x0 == "random":
        scale = Fraction(1) if within is None else min(Fraction(1), abs(within) / 10)
        return [scale * x for (x,) in random_states(seed, graph.n_nodes)]
    return read_state(x0, graph, name)


def read_initial_states(options: Options, graph: SignedDigraph) -> Any:
    """Return the initial states of agents of ``--dimension`` components, one column for each."""
    import numpy as np

    from ptcc_certify.graphs.io import random_states

    x0, seed, n, dimension = options["x0"], options["seed"], graph.n_nodes, options["dimension"]
    if dimension == 1:
        return read_initial_state(x0, seed, graph, within=options["initial_bound"])
    if x0 == "random":
        return random_states(seed, n, dimension)
    texts = x0.split(",")
    if len(texts) != n * dimension:
        raise ParameterError(
            f"--x0 has {len(texts)} value{'s' * (len(texts) > 1)} for {n} agents of dimension {dimension}; "
            f"give {n * dimension} numbers, agent after agent"
        )
    return np.array([exact_number(text, "--x0") for text in texts]).reshape(n, dimension)
