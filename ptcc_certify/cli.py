"""The command line ``ptcc``: parses, calls, prints.

Exit codes: 0 proved and everything asked holds; 1 a bound is violated, or a certificate rejected; 2 bad input or
usage; 3 an expectation is refuted; 4 undecided; 70 an error of this program. Data go to standard output, everything
else to standard error.
"""

from __future__ import annotations

import io
import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.errors import ParameterError, PTCCError, explain, one_line

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker import CheckReport
    from ptcc_certify.gain_design import Design
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.structure import Structure
    from ptcc_certify.protocols import Protocol
    from ptcc_certify.protocols.limits import Actuator

OK, REJECTED, BAD_INPUT, REFUTED_EXPECTATION, UNDECIDED = 0, 1, 2, 3, 4  # ptcc_certify.certificate.verdict has them too
INTERNAL_ERROR, INTERRUPTED = 70, 130
FIGURES, TABLES = (".png", ".pdf", ".svg"), ("", ".csv", ".txt")
_NO_ARGUMENTS = getattr(click.exceptions, "NoArgsIsHelpError", ())  # its message is the help; new in click 8.2


def _options(*decorators: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def apply(function: Any) -> Any:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return apply


_reading_options = _options(
    click.option(
        "--edges",
        type=click.Choice(["information", "listens"]),
        help="Row a,b (or entry a,b of a matrix): flows a -> b, or a listens.  [default: information; matrix: listens]",
    ),
    click.option("--duplicates", type=click.Choice(["refuse", "sum", "last"]), default="refuse", show_default=True),
    click.option("--drop-self-loops", is_flag=True, help="Ignore edges of a node to itself."),
    click.option("--undirected", is_flag=True, help="Every row counts in both directions."),
)
_graph_options = _options(click.argument("graph"), _reading_options)
_protocol_options = _options(
    click.option(
        "--protocol", "kind", type=click.Choice(["nominal", "sliding-mode"]), default="nominal", show_default=True
    ),
    click.option("--T", "T", show_default="1", help="Deadline (nominal)."),
    click.option("--rho1", default="1", show_default=True, help="Constant part of the gain."),
    click.option("--rho2", default="1", show_default=True, help="Factor of the growing part of the gain."),
    click.option("--kappa", default="2", show_default=True, help="Exponent of the time scaling."),
    click.option("--T-r", "T_r", show_default="0.5", help="Sliding mode: time to reach the manifold."),
    click.option("--T-s", "T_s", show_default="0.5", help="Sliding mode: time on it; the deadline is T_r + T_s."),
    click.option("--mu1", show_default="2", help="Sliding mode: switching gain, above delta."),
    click.option("--mu2", show_default="1", help="Sliding mode: constant part of the reaching gain."),
    click.option("--mu3", show_default="1", help="Sliding mode: factor of its growing part."),
    click.option("--delta", show_default="1", help="Bound of every disturbance."),
    click.option(
        "--disturbance",
        metavar="EXPR",
        show_default="adversary",
        help="Of the simulated run: an expression of k and t, adversary (sliding mode), telegraph or none.",
    ),
    click.option("--sigma0", show_default="0", help="Sliding mode: like --x0; 0 leaves no reaching phase."),
    click.option("--x0", default="random", show_default=True, help="5,2,-4 | label=value,... | FILE.csv | random"),
    click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of random starts."),
)
_LIMITS = ("gain_cap", "stop_before", "sample_period")
_limit_options = _options(
    click.option("--gain-cap", metavar="G", help="Nominal: the gain is at most G."),
    click.option("--stop-before", metavar="EPS", help="Nominal: the input is 0 from T - EPS on."),
    click.option("--sample-period", metavar="H", help="Nominal: gain and input are held over periods H."),
)
_SLIDING_DEFAULTS = {"T_r": "0.5", "T_s": "0.5", "mu1": "2", "mu2": "1", "mu3": "1", "delta": "1"}
_method_option = click.option(
    "--method",
    type=click.Choice(["best", "paper", "perron", "lmi", "full"]),
    default="best",
    show_default=True,
    help="Lyapunov functions searched beside the paper's.",
)
_starts_option = click.option(
    "--initial-bound", metavar="R", help="Bound the input for all starts within |x_k(0)| <= R, not --x0."
)
_memory_option = click.option(
    "--memory",
    type=click.FloatRange(min=0, min_open=True, max=1000),
    default=1,
    show_default=True,
    metavar="GB",
    help="What the check may take; a certificate that may take more is refused.",
)
_time_limit_option = click.option(
    "--time-limit",
    type=float,
    metavar="SECONDS",
    help="For simulation and searches of a graph together.  [default: 60, and 1 more for every 1,000 nodes]",
)
_json_option = click.option("--json", "as_json", is_flag=True, help="Print exactly one JSON object.")


@contextmanager
def _progress(steps: Sequence[str]) -> Iterator[Callable[[str], None]]:
    """Show on a terminal which of some steps is at work; the line goes when they are done."""
    if not sys.stderr.isatty():
        yield lambda step: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}")
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(steps))
        yield lambda step: bar.update(task, completed=steps.index(step), description=step)


class _InOrder(click.Group):
    """Commands in the order of their use, as they are written below."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(cls=_InOrder, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="ptcc-certify", prog_name="ptcc")
def cli() -> None:
    """Certify prescribed-time coordination control on signed digraphs.

    GRAPH is a file, - for standard input, or the name of a packaged graph (fig1a, fig1b, fig3a, fig3b, fig5a, fig5b).
    """


@cli.command()
@_graph_options
@click.option("--expect", metavar="BEHAVIOUR", help="E.g. bipartite-consensus; exit code 3 if it does not follow.")
@_json_option
def classify(graph: str, expect: str | None, as_json: bool, **read: Any) -> int:
    """Tell the structure of GRAPH and the theorem that applies; no computation in floating point."""
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.screen import structure_lines

    expected = _behaviour(expect)
    structure = analyse(_read(graph, **read))
    if as_json:
        from ptcc_certify.certificate.format_graph import structure_document

        _print_json(structure_document(structure))
    else:
        _print(structure_lines(structure, graph))
    return OK if expected is None else _judged_behaviour(structure, expected)


@cli.command()
@_graph_options
@_protocol_options
@click.option("--expect", metavar="BEHAVIOUR", help="E.g. bipartite-consensus; exit code 3 if it does not follow.")
@click.option("--min-rate", metavar="R", help="Ask for a proved rate of at least R per unit of the stretched clock.")
@_method_option
@_limit_options
@_starts_option
@click.option("--noise", metavar="NU", help="Nominal: bound the effect of measurement noise |n_k| <= NU under a limit.")
@click.option("--max-input", metavar="U", help="Ask for a proved peak of every |u_k| of at most U.")
@click.option("--at", metavar="t", help="Optimise the bound at this instant, and print it for every agent.")
@click.option(
    "--simulation/--no-simulation", default=None, help="Compare with a CVODES run.  [default: up to 10,000 agents]"
)
@_time_limit_option
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write the certificate to this file.")
@_json_option
def certify(
    graph: str,
    kind: str,
    x0: str,
    seed: int,
    expect: str | None,
    min_rate: str | None,
    method: str,
    at: str | None,
    simulation: bool | None,
    initial_bound: str | None,
    max_input: str | None,
    time_limit: float | None,
    output: str | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Certify what the protocol does on GRAPH: behaviour, rate, outcome; compare with a CVODES run."""
    from ptcc_certify.certificate.procedure import STEPS
    from ptcc_certify.certificate.procedure import certify as run
    from ptcc_certify.certificate.request import Expectations
    from ptcc_certify.report.screen import certificate_lines

    instant, bound = _number(at, "--at"), _number(initial_bound, "--initial-bound")
    most = _number(max_input, "--max-input")
    if most is not None and most <= 0:
        raise ParameterError("--max-input is outside its domain; it must be > 0")
    expected = Expectations(_behaviour(expect), _number(min_rate, "--min-rate"), most)
    _refuse_output(output, graph)
    protocol = _protocol(kind, options)
    signed = _read(graph, **options)
    start = _start(x0, seed, signed)
    more = _sliding_options(protocol, options, seed, signed)
    if kind == "nominal":
        actuator = _actuator(options)
        more = {"limits": [] if actuator is None else [actuator]}
        more |= {name: _number(options[name], f"--{name}") for name in ("delta", "noise")}
    elif options["noise"] is not None:
        raise ParameterError("--noise belongs to --protocol nominal; leave it out or change the protocol")
    with _progress(STEPS) as begin:
        certificate = run(
            signed,
            protocol,
            start,
            method=method,
            at=instant,
            simulation=simulation,
            starts=bound,
            time_limit=time_limit,
            expectations=expected,
            progress=begin,
            **more,
        )
    if output:
        certificate.save(output)
    found = certificate.assessment
    if as_json:
        _print_json(certificate.to_dict())
        if found.exit_code:
            click.echo(f"verdict    {found.text}", err=True)
    else:
        _print(certificate_lines(certificate, graph))
        if output:
            click.echo(f"written    {output}")
    return found.exit_code


@cli.command()
@click.argument("certificate")
@click.argument("graph", required=False)
@_reading_options
@click.option("--stdlib", is_flag=True, help="Use the standard library alone, even where python-flint is installed.")
@_memory_option
@_json_option
def check(certificate: str, graph: str | None, stdlib: bool, memory: float, as_json: bool, **read: Any) -> int:
    """Check CERTIFICATE exactly, without a solver; with GRAPH, that it speaks of this graph.

    GRAPH is read as the certificate says that it was read, which is printed; the options about reading override that.
    Prints every obligation with what was verified. Exit code 0 if the claim is proved, 1 if it is rejected, 4 if the
    certificate itself says undecided. `python -m ptcc_certify.checker` does the same without any other package.
    """
    from ptcc_certify.certificate.checking import read_and_check

    with _progress(("independent check",)) as begin:
        begin("independent check")
        document, report = read_and_check(certificate, stdlib=stdlib, memory=memory)
    how: dict[str, str] = {}
    if graph is not None and report.accepted:
        report, how = _same_graph(certificate, document, report, graph, read)
    if as_json:
        _print_json(report.to_dict() | how)
    else:
        _print([*(f"graph      {how[key]}" for key in how), *report.lines()])
    if not report.accepted:
        return REJECTED
    return OK if report.verdict == "certified" else UNDECIDED


def _same_graph(
    certificate: str, document: dict[str, Any], report: CheckReport, graph: str, read: dict[str, Any]
) -> tuple[CheckReport, dict[str, str]]:
    """Compare GRAPH with that of an accepted certificate; return the report, and how GRAPH was read."""
    from ptcc_certify.certificate.format_graph import certificate_graph
    from ptcc_certify.graphs.difference import difference
    from ptcc_certify.graphs.io.graph_files import read_graph_as, reading_flags

    source = click.get_current_context().get_parameter_source
    names = {"orientation": "edges", **{name: name for name in ("duplicates", "drop_self_loops", "undirected")}}
    given = {key: read[name] for key, name in names.items() if source(name) is ParameterSource.COMMANDLINE}
    told = document["graph"]["read"]
    signed = read_graph_as(_graph_file(graph), told, **given)
    way = "as the options say" if given else "as the certificate says"
    how = {"graph_read": f"{graph}, read {way}: {reading_flags(signed.read)}"}
    if signed.sha256 == report.sha256:
        return report, how
    reason = f"another graph than {graph}: {difference(certificate_graph(document, Path(certificate).parent), signed)}"
    return replace(report, accepted=False, steps=(), rejected="graph", reason=reason), how


@cli.command()
@click.argument("certificate")
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), required=True, help="A page, .html, or a statement, .tex"
)
@click.option(
    "--simulation/--no-simulation", default=None, help="Repeat the CVODES run.  [default: up to 1,000 agents]"
)
@_memory_option
def report(certificate: str, output: str, simulation: bool | None, memory: float) -> int:
    """Check CERTIFICATE and write a report to send to somebody: a page of HTML, or a statement in LaTeX.

    The page is one file that loads nothing and runs no script. Exit codes are those of `check`; of a rejected
    certificate the page tells the reason and no claim.
    """
    from ptcc_certify.certificate.certificate import RejectedCertificate
    from ptcc_certify.report import write_report

    try:
        with _progress(("independent check", "simulation", "report")) as begin:
            verdict = write_report(certificate, output, simulation=simulation, progress=begin, memory=memory)
    except RejectedCertificate as error:
        click.echo(f"rejected: {error}", err=True)
        return REJECTED
    click.echo(f"{verdict:<10} {output}")
    return {"certified": OK, "undecided": UNDECIDED}.get(verdict, REJECTED)


@cli.command()
@_graph_options
@_protocol_options
@_limit_options
@click.option(
    "--dimension", type=click.IntRange(1, 1000), default=1, show_default=True, help="State components per agent."
)
@click.option("--samples", type=click.IntRange(2, 100_000), default=201, show_default=True, help="Instants up to T.")
@click.option("--boundary-layer", type=float, metavar="W", help="Sliding mode: tanh(sigma/W) for the sign, to compare.")
@click.option("--wide", is_flag=True, help="A figure as wide as two columns of a journal, instead of one.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="FILE.csv, or a figure: .png, .pdf, .svg")
def simulate(
    graph: str,
    kind: str,
    x0: str,
    seed: int,
    dimension: int,
    samples: int,
    boundary_layer: float | None,
    wide: bool,
    output: str | None,
    **options: Any,
) -> int:
    """Integrate the closed loop with CVODES up to the deadline and past it; print CSV or draw a figure.

    rho2 = 0 runs the nominal protocol without a deadline (asymptotic baseline). With --dimension d, --x0 takes N*d
    numbers, agent after agent. Under the sliding-mode protocol columns sigma(<label>) follow the states.
    """
    from ptcc_certify.graphs.io import write_atomically
    from ptcc_certify.simulation.run import simulate as run

    suffix = Path(output or "").suffix.lower()
    if suffix not in (*FIGURES, *TABLES):
        raise ParameterError(f"{output}: CSV is written to .csv, figures to {', '.join(FIGURES)}; choose one of these")
    if suffix in FIGURES and dimension > 1:
        raise ParameterError("a figure shows one component per agent; leave out --dimension or write CSV")
    _refuse_output(output, graph)
    protocol = _protocol(kind, options, ("delta", "disturbance"))
    if kind == "sliding-mode" and dimension > 1:
        raise ParameterError("the sliding-mode protocol is simulated for scalar agents; leave out --dimension")
    signed = _read(graph, **options)
    more = _sliding_options(protocol, options, seed, signed)
    if kind == "nominal":
        more = {"actuator": _actuator(options), "delta": options["delta"], "disturbance": options["disturbance"]}
    trajectory = run(
        signed,
        protocol,
        _start_columns(x0, seed, signed, dimension),
        samples=samples,
        boundary_layer=boundary_layer,
        **more,
    )
    if output and suffix in FIGURES:
        from ptcc_certify.graphs.structure import analyse
        from ptcc_certify.report.plots import plot_run, save_figure

        save_figure(plot_run(trajectory, analyse(signed), wide=wide), output)
    elif output:
        write_atomically(output, trajectory.to_csv())
    else:
        click.echo(trajectory.to_csv(), nl=False, color=True)  # labels stay as they are, escape codes included
    if protocol.prescribed and trajectory.actuator is None and not trajectory.deadline_resolved:
        click.echo("note: the run had not settled at the deadline; raise rho2 * kappa", err=True)
    return OK


@cli.command()
@_graph_options
@click.option("--max-input", metavar="U", required=True, help="Every |u_k| at all times, from all starts.")
@click.option("--initial-bound", metavar="R", required=True, help="All starts with |x_k(0)| <= R.")
@click.option("--deadline", metavar="T", help="Ask for this deadline.")
@click.option("--shortest-deadline", is_flag=True, help="Ask for the shortest deadline.")
@click.option("--residual", metavar="r", help="Every agent may be so far from its outcome at the deadline.")
@click.option("--input-norm", type=click.Choice(["2"]), help="2: U bounds ||u||, not each |u_k|.")
@click.option("--curve", type=click.Path(dir_okay=False), help="Deadline against peak input: FILE.csv, or a figure.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write the certificate to this file.")
@_json_option
def design(
    graph: str,
    max_input: str,
    initial_bound: str,
    deadline: str | None,
    shortest_deadline: bool,
    residual: str | None,
    input_norm: str | None,
    curve: str | None,
    output: str | None,
    as_json: bool,
    **read: Any,
) -> int:
    """Find gains of the nominal protocol whose input is proved to stay within a limit.

    The numbers printed are exact, and the last line is the command that proves them again with exit code 0.

    Exit code 0: found, with a certificate. 3: no gains of this protocol can, proved. 4: not with this certificate.
    """
    from ptcc_certify.gain_design import INFEASIBLE, MET
    from ptcc_certify.gain_design import design as run

    if (deadline is None) != shortest_deadline:
        raise ParameterError("give --deadline T, or ask for the --shortest-deadline: one of the two")
    for path in (output, curve):
        _refuse_output(path, graph)
    if curve is not None and Path(curve).suffix.lower() not in (*FIGURES, ".csv"):
        raise ParameterError(f"{curve}: the curve is written to .csv, {', '.join(FIGURES)}; choose one of these")
    U, R = _number(max_input, "--max-input"), _number(initial_bound, "--initial-bound")
    T, r = _number(deadline, "--deadline"), _number(residual, "--residual")
    assert U is not None and R is not None
    found = run(
        _read(graph, **read),
        max_input=U,
        initial_bound=R,
        deadline=T,
        residual=r,
        input_norm=2 if input_norm else None,
    )
    if output and found.certificate is not None:
        found.certificate.save(output)
    if curve:
        _save_curve(found, curve)
    command = _certify_command(found, graph, read)
    if as_json:
        _print_json(found.to_dict() | {"command": command})
    else:
        _print(found.lines())
        if output and found.certificate is not None:
            click.echo(f"written    {output}")
        if command is not None:
            again = " (give it the graph again, on standard input)" if graph == "-" else ""
            click.echo(f"to prove it again{again}:\n{command}")
        elif found.protocol is not None:
            why = "certify finds other functions for these gains, which prove less"
            click.echo(f"note: {why}; the proof is the certificate that -o writes", err=True)
    return {MET: OK, INFEASIBLE: REFUTED_EXPECTATION}.get(found.verdict, UNDECIDED)


@cli.command()
@click.argument("name", default="all")
@click.option("-o", "--output", type=click.Path(file_okay=False), help="Write certificates and figures to this folder.")
@click.option(
    "--format", "suffix", type=click.Choice(["png", "pdf", "svg"]), default="png", show_default=True, help="Of figures."
)
def examples(name: str, output: str | None, suffix: str) -> int:
    """Run the paper's examples (all, a number 1 to 6, or a graph such as fig1a) and print one row each.

    worst and reached are of the simulated run, all else is proved. With -o also every certificate, the figures of the
    paper's Section 4 (and decay and input besides), and the table in full as examples.csv.
    """
    from lmi.exact.rounding import down
    from ptcc_certify.certificate.procedure import certify as run
    from ptcc_certify.certificate.request import Expectations
    from ptcc_certify.certificate.verdict import worst_code
    from ptcc_certify.examples import load_graph, select
    from ptcc_certify.report.paper_figures import Run, paper_figures, results_csv

    chosen, codes, runs = select(name), [], []
    if output:
        _make_folder(output)
    click.echo(
        f"{'example':<9}{'theorem':<9}{'behaviour':<30}{'rate':>9}{'optimality':>12}{'worst':>8}"
        f"{'reached':>10}{'proved by':>11}{'T_r':>5}  {'final state':<14}verdict"
    )
    for example, graph_name, reported in chosen:
        certificate = run(
            load_graph(graph_name),
            example.protocol(),
            example.x0.split(","),
            sigma0=example.sigma0 and example.sigma0.split(","),
            disturbance=example.disturbance,
            expectations=Expectations(reported),
        )
        claim, rate, seen = certificate.claim, certificate.rate, certificate.comparison
        assert claim is not None
        click.echo(
            f"{example.number} {graph_name:<7}{claim.theorem:<9}{claim.behaviour:<30}"
            f"{down(rate or Fraction(0)):>9}{down(certificate.optimality_ratio or 0.0, 4):>12}"
            f"{seen.worst_ratio if seen else 0:>8.3f}{_reached(certificate)}  "
            f"{_ends(certificate):<14}{certificate.assessment.word}"
        )
        codes.append(certificate.assessment.exit_code)
        if output:
            stem = Path(output) / (graph_name if example.sigma0 is None else f"{graph_name}_sliding")
            certificate.save(f"{stem}.json")
            runs.append(Run(example, graph_name, certificate))
    if output:
        from ptcc_certify.graphs.io import write_atomically
        from ptcc_certify.report.plots import save_figure

        for title, figure in paper_figures(runs).items():
            save_figure(figure, Path(output) / f"{title}.{suffix}")
        write_atomically(Path(output) / "examples.csv", results_csv(runs))
    return worst_code(codes)


@cli.command()
@click.argument("pattern", nargs=-1, required=True)
@_reading_options
@_protocol_options
@click.option("--expect", metavar="BEHAVIOUR", help="E.g. stability; exit code 3 if it does not follow for some graph.")
@click.option("--min-rate", metavar="R", help="Ask for a proved rate of at least R of every graph.")
@_method_option
@_starts_option
@click.option("--simulation/--no-simulation", default=False, show_default=True, help="Compare with CVODES runs.")
@_time_limit_option
@click.option("--workers", type=click.IntRange(1, 1024), help="Processes on this machine.  [default: one per core]")
@click.option("--scheduler", metavar="ADDRESS", help="Compute on the workers of this Dask scheduler instead.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write the table to FILE.csv or FILE.parquet.")
@click.option("--restart", is_flag=True, help="Begin again, and replace the table, or the graphs of --write-graphs.")
@click.option("--write-graphs", metavar="DIR", help="Only write the graphs of SPEC.toml to this folder, as CSV.")
def batch(
    pattern: tuple[str, ...],
    kind: str,
    expect: str | None,
    min_rate: str | None,
    initial_bound: str | None,
    workers: int | None,
    scheduler: str | None,
    output: str | None,
    restart: bool,
    write_graphs: str | None,
    **options: Any,
) -> int:
    """Certify many graphs: a table with one row for each.

    PATTERN is a file, a quoted pattern such as 'graphs/*.csv', a packaged graph, or SPEC.toml, which describes an
    ensemble of random graphs (keys: count, nodes, seed, connectivity, balanced, mean_degree, negative, weight_range,
    weight_decades, undirected); several may be given. Every graph has a random start of its own, unless --x0 is given.

    Rows are kept in FILE.journal as they come: after an interruption the same command goes on with those that are
    missing, and with files that have changed; the list of graphs may have changed too. FILE then has the rows so far.
    Whatever goes wrong with one graph becomes the column error of its row. Without -o the table is printed as CSV when
    it is complete, or with the rows so far when it ends before.

    Exit code 0: every graph certified, and what was asked of them holds. Otherwise the table is there too, and the
    code is the worst of its rows: 1 a simulated run exceeds its bound, 3 an expectation is refuted, 4 some are
    undecided or have an error. 2: nothing was written.
    """
    from ptcc_certify import batch as many

    expected, wanted = _behaviour(expect), _number(min_rate, "--min-rate")
    bound = _number(initial_bound, "--initial-bound")
    if write_graphs is not None:
        for name, value in (("-o", output), ("--scheduler", scheduler), ("--workers", workers)):
            if value is not None:
                raise ParameterError(f"{name} has no effect beside --write-graphs; leave it out")
        click.echo(f"written    {many.write_graphs(pattern, write_graphs, restart=restart)} graphs to {write_graphs}")
        return OK
    if scheduler is not None and workers is not None:
        raise ParameterError("--workers is for this machine, --scheduler for a cluster; leave one out")
    if restart and output is None:
        raise ParameterError("--restart replaces a table; name it with -o")
    if output in ("", "-"):
        raise ParameterError("-o names a file; for standard output leave it out")
    protocol = _protocol(kind, {**dict.fromkeys(_LIMITS), **options}, ())
    total = 0
    with _counting() as show, _interrupted_by_term():

        def progress(*counts: int) -> None:
            nonlocal total
            if output and total == 0 and counts[0]:
                click.echo(f"note: {counts[0]} of {counts[1]} rows were there already", err=True)
            total = counts[1]
            show(*counts)

        try:
            rows = many.certify_many(
                pattern,
                protocol,
                **{name: options[name] for name in ("x0", "seed", "sigma0", "disturbance", "method", "simulation")},
                **{name: options[name] for name in ("duplicates", "drop_self_loops", "undirected", "time_limit")},
                orientation=options["edges"],
                initial_bound=bound,
                expect=expected,
                min_rate=wanted,
                workers=workers or many.default_workers(),
                scheduler=scheduler,
                output=output,
                restart=restart,
                progress=progress,
            )
        except BaseException as error:
            found, stopped = getattr(error, "rows", []), isinstance(error, KeyboardInterrupt)
            if found or stopped:
                kept = _kept(found, total, output, restart)
                click.echo(f"{'ptcc: interrupted' if stopped else 'note: the batch failed'}; {kept}", err=True)
            if stopped:
                return INTERRUPTED
            raise
    if output is None:
        click.echo(many.table_bytes(rows, ".csv").decode(), nl=False, color=True)
    else:
        counts = [f"{sum(row['verdict'] == v for row in rows)} {v}" for v in ("certified", "undecided")]
        failed = sum(row["error"] is not None for row in rows)
        click.echo(f"rows       {len(rows)}: {', '.join(counts)}, {failed} with an error")
        click.echo(f"written    {output}")
    return _batch_code(rows)


@cli.command()
@click.argument("theorem", required=False)
def cite(theorem: str | None) -> int:
    """Print BibTeX of the source, with the THEOREM used (such as 2.1) in the note."""
    from ptcc_certify.theorems import THEOREMS

    note = "Manuscript"
    if theorem is not None:
        statements = {t.number: t.statement for t in THEOREMS}
        if theorem not in statements:
            raise ParameterError(f'no theorem "{theorem}"; one of ' + ", ".join(statements))
        note += f"; Theorem {theorem}: {statements[theorem]}"
    click.echo(
        "@unpublished{zhu_prescribed_time_coordination,\n"
        "  author = {Zhu, Zhen-Hua and Wu, Huaiyu and Guan, Zhi-Hong and Liu, Zhi-Wei and Chen, Yang and "
        "Zheng, Xiujuan},\n"
        "  title  = {Robust prescribed-time coordination control of cooperative-antagonistic networks with "
        "disturbances},\n"
        f"  note   = {{{note}}}\n"
        "}"
    )
    return OK


# ---------------------------------------------------------------------- helpers


def _read(
    graph: str,
    edges: str | None = None,
    duplicates: Any = "refuse",
    drop_self_loops: bool = False,
    undirected: bool = False,
    **_: Any,
) -> SignedDigraph:
    from ptcc_certify.graphs.io import read_graph

    return read_graph(
        _graph_file(graph),
        orientation=edges,
        duplicates=duplicates,
        drop_self_loops=drop_self_loops,
        undirected=undirected,
    )


def _graph_file(graph: str) -> Any:
    """Return the file of a graph, of a packaged one where no such file exists."""
    from ptcc_certify.examples import GRAPHS, graph_path

    if graph == "-" and sys.stdin is None:
        raise ParameterError("standard input is closed; name a file")
    packaged = graph in GRAPHS and (Path(graph).is_dir() or not Path(graph).exists())
    return graph_path(graph) if packaged else graph


def _protocol(kind: str, options: dict[str, Any], disturbed: tuple[str, ...] = ("delta",)) -> Protocol:
    """Return the protocol; ``disturbed`` are the options about disturbances that the nominal one takes too."""
    from ptcc_certify.protocols import NominalProtocol, SlidingModeProtocol

    shared = {name: options[name] for name in ("rho1", "rho2", "kappa")}
    if kind == "nominal":
        for name in (*_SLIDING_DEFAULTS, "disturbance", "sigma0"):
            if options[name] is not None and name not in disturbed:
                flag = name.replace("_", "-")
                raise ParameterError(
                    f"--{flag} belongs to --protocol sliding-mode; leave it out or change the protocol"
                )
        return NominalProtocol(T="1" if options["T"] is None else options["T"], **shared)
    for name in _LIMITS:
        if options[name] is not None:
            flag = name.replace("_", "-")
            raise ParameterError(f"--{flag} belongs to --protocol nominal; leave it out or change the protocol")
    if options["T"] is not None:
        raise ParameterError("--T belongs to --protocol nominal; under sliding-mode the deadline is --T-r plus --T-s")
    own = {name: default if options[name] is None else options[name] for name, default in _SLIDING_DEFAULTS.items()}
    return SlidingModeProtocol(**own, **shared)


def _sliding_options(protocol: Protocol, options: dict[str, Any], seed: int, graph: SignedDigraph) -> dict[str, Any]:
    """Return ``sigma0`` and ``disturbance`` as the library takes them; nothing for the nominal protocol."""
    from ptcc_certify.protocols.disturbance import as_disturbance

    if (sliding := protocol.reaching) is None:
        return {}
    source = "adversary" if options["disturbance"] is None else options["disturbance"]
    horizon = 2 * float(protocol.T)
    return {
        "sigma0": _sigma0(options["sigma0"], seed, graph),
        "disturbance": as_disturbance(source, graph.n_nodes, sliding.delta, horizon, seed),
    }


def _actuator(options: dict[str, Any]) -> Actuator | None:
    """Return the limits of the gain; None if there are none."""
    from ptcc_certify.protocols.limits import Actuator

    given = {name: _number(options[name], f"--{name.replace('_', '-')}") for name in _LIMITS}
    actuator = Actuator(**given)
    return None if actuator.ideal else actuator


def _sigma0(text: str | None, seed: int, graph: SignedDigraph) -> list[Fraction]:
    from ptcc_certify.errors import NumberError
    from ptcc_certify.graphs.rationals import parse_exact

    try:
        if text is None or parse_exact(text) == 0:
            return [Fraction(0)] * graph.n_nodes
    except NumberError:
        pass
    return _start(text or "", [seed, 1], graph, "--sigma0: ")


def _reached(certificate: Certificate) -> str:
    """Return the columns of ``ptcc examples`` about the sliding variables: last instant, proved instant, ``T_r``."""
    from lmi.exact.rounding import up
    from ptcc_certify.report.paper_figures import reaching_times

    last, proved, deadline = reaching_times(certificate)
    if isinstance(last, str):
        return f"{'-':>10}{'-':>11}{'-':>5}"
    return f"{last:>10.5f}{up(float(proved), 5):>11}{deadline:>5.2g}"


def _ends(certificate: Certificate) -> str:
    """Return the outcome in a few letters: 0, a common size, or the largest, rounded up."""
    from lmi.exact.rounding import near, up

    if certificate.outcome is None:
        return "-"
    sizes = {abs(Fraction(x)) for x in certificate.outcome.final_state}
    largest = max(sizes)
    return (
        near(largest, 5) if sizes == {0} else f"+-{near(largest, 5)}" if len(sizes) == 1 else f"|x| <= {up(largest, 5)}"
    )


def _start(x0: str, seed: Any, graph: SignedDigraph, option: str = "") -> list[Fraction]:
    from ptcc_certify.graphs.io import random_states, read_state

    if x0 != "random":
        try:
            return read_state(x0, graph)
        except PTCCError as error:
            raise type(error)(f"{option}{error}") from None
    return [x for (x,) in random_states(seed, graph.n_nodes)]


def _start_columns(x0: str, seed: int, graph: SignedDigraph, dimension: int) -> Any:
    import numpy as np

    from ptcc_certify.graphs.io import random_states

    if dimension == 1:
        return _start(x0, seed, graph)
    if x0 == "random":
        return random_states(seed, graph.n_nodes, dimension)
    texts = x0.split(",")
    if len(texts) != graph.n_nodes * dimension:
        raise ParameterError(
            f"--x0 has {len(texts)} value{'s' * (len(texts) > 1)} for {graph.n_nodes} agents of dimension {dimension}; "
            f"give {graph.n_nodes * dimension} numbers, agent after agent"
        )
    return np.array([_number(text, "--x0") for text in texts]).reshape(graph.n_nodes, dimension)


def _behaviour(text: str | None) -> str | None:
    if text is None:
        return None
    from ptcc_certify.graphs.structure import behaviour_name

    try:
        return behaviour_name(text)
    except ValueError as error:
        raise ParameterError(f"--expect: {error}") from None


def _number(text: str | None, option: str) -> Fraction | None:
    if text is None:
        return None
    from ptcc_certify.graphs.rationals import parse_exact

    try:
        return parse_exact(text)
    except PTCCError as error:
        raise ParameterError(f"{option}: {error}") from None


def _judged_behaviour(structure: Structure, expected: str) -> int:
    from ptcc_certify.certificate.verdict import MET, judge_behaviour

    answer = judge_behaviour(structure, expected)
    if answer.status != MET:
        click.echo(f"{answer.status}: {answer}", err=True)
        return REFUTED_EXPECTATION
    if len(structure.components) > 1:
        click.echo(f"note: {expected} holds in each of the components by itself", err=True)
    return OK


def _certify_command(found: Design, graph: str, read: dict[str, Any]) -> str | None:
    """Return the command that certifies the gains of a design again, as a shell takes it; None if there is none."""
    import shlex

    options = found.certify_options
    if options is None:
        return None
    flags = [] if read["edges"] is None else ["--edges", read["edges"]]
    flags += [] if read["duplicates"] == "refuse" else ["--duplicates", read["duplicates"]]
    flags += [f"--{name.replace('_', '-')}" for name in ("drop_self_loops", "undirected") if read[name]]
    given = [*flags, *options]
    if graph.startswith("-") and graph != "-":
        return shlex.join(["ptcc", "certify", *given, "--", graph])
    return shlex.join(["ptcc", "certify", graph, *given])


@contextmanager
def _counting() -> Iterator[Callable[[int, int, int], None]]:
    """Show on a terminal how many of many rows are done, how many have an error, and how long the rest will take."""
    if not sys.stderr.isatty():
        yield lambda done, total, errors: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("left {task.description}")
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = None

        def show(done: int, total: int, errors: int) -> None:
            nonlocal task
            if task is None:  # rows that were there already do not count for the speed
                task = bar.add_task("", total=total, completed=done)
            bar.update(task, completed=done, description=f"({errors} with an error)" if errors else "")

        yield show


@contextmanager
def _interrupted_by_term() -> Iterator[None]:
    """Let SIGTERM, by which schedulers and shutdowns end a process, do what Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():  # which alone handles signals
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


def _kept(rows: list[dict[str, Any]], total: int, output: str | None, restart: bool) -> str:
    """Tell, after a batch ended before its time, which rows there are and how it goes on; print them without a file."""
    from ptcc_certify.batch import table_bytes

    if not rows:
        return "nothing is kept"
    if output is None:
        click.echo(table_bytes(rows, ".csv").decode(), nl=False, color=True)
        return f"{len(rows)} of {total} rows are printed; with -o FILE.csv the same command could go on"
    missing = f"{total - len(rows)} are missing, and the same command{' without --restart' * restart} goes on"
    return f"{len(rows)} of {total} rows are kept, in {output} too; {missing}"


def _batch_code(rows: Sequence[dict[str, Any]]) -> int:
    """Return the exit code of the worst row, and tell how many rows are not what one would wish."""
    from ptcc_certify.certificate.verdict import OPEN, REFUTED, exit_code

    failed = [row for row in rows if row["error"] is not None]
    violated = sum(row["bound_kept"] is False for row in rows)
    refuted = sum(row["asked"] == REFUTED for row in rows)
    undecided = sum(row["verdict"] == "undecided" or row["asked"] == OPEN for row in rows)
    cut_off = sum(row["cut_off"] is not None for row in rows)
    if cut_off:
        click.echo(f"note: {cut_off} of {len(rows)} graphs: the time limit ended searches, column cut_off", err=True)
    said = (
        (violated, "violated: the simulated run exceeds the proved bound; please report"),
        (refuted, "refuted: what was asked does not hold"),
        (undecided, "undecided, or what was asked is left open"),
        (len(failed), "" if not failed else f"no certificate, such as {failed[0]['error']}"),
    )
    for count, text in said:
        if count:
            click.echo(f"note: {count} of {len(rows)} graphs: {text}", err=True)
    return exit_code(bool(violated), bool(refuted), bool(undecided or failed))


def _refuse_output(output: str | None, graph: str) -> None:
    """Refuse before the work what could not, or should not, be written after it."""
    if not output:
        return
    if output == "-":
        raise ParameterError("-o names a file; for standard output leave it out (certify: and say --json)")
    if not Path(output).parent.is_dir():
        raise ParameterError(f"{output}: the folder does not exist; make it first")
    if Path(output).is_file() and Path(graph).is_file() and Path(output).samefile(graph):
        raise ParameterError(f"{output}: is the graph itself; name another file")


def _save_curve(found: Design, path: str) -> None:
    """Write peak input against deadline: CSV, or a figure."""
    from ptcc_certify.graphs.io import write_atomically

    if Path(path).suffix.lower() == ".csv":
        curve = found.trade_off(found.deadlines())
        rows = zip(*(values.tolist() for values in curve), strict=True)
        lines = ["deadline,certified_peak,no_gains_below", *(",".join(map(repr, row)) for row in rows)]
        write_atomically(path, "\n".join(lines) + "\n")
    else:
        from ptcc_certify.report.plots import plot_trade_off, save_figure

        save_figure(plot_trade_off(found).figure, path)


def _make_folder(path: str) -> None:
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"{path}: cannot make this folder ({error.strerror})") from None


def _print(lines: list[str]) -> None:
    click.echo("\n".join(lines))


def _print_json(data: Any) -> None:
    click.echo(json.dumps(data, allow_nan=False))  # ASCII: no label can spoil the object or steer a terminal


def main() -> None:
    """Run ``ptcc`` and exit with its code; every refusal is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a label that the terminal cannot show stops nothing
    try:
        code = cli.main(prog_name="ptcc", standalone_mode=False)
    except click.ClickException as error:
        if isinstance(error, _NO_ARGUMENTS):
            click.echo(error.format_message(), err=True)
            code = BAD_INPUT
        else:
            code = _refuse(error.format_message())
    except (PTCCError, OverflowError, MemoryError) as error:
        code = _refuse(explain(error))
    except (KeyboardInterrupt, click.Abort):
        click.echo("ptcc: interrupted", err=True)
        code = INTERRUPTED
    except BrokenPipeError:
        code = OK
        sys.stderr.close()
    except OSError as error:
        code = _refuse(f"the result cannot be written ({error.strerror or error})")
    except Exception as error:
        click.echo(f"ptcc: {explain(error)}", err=True)
        code = INTERNAL_ERROR
    sys.exit(code if isinstance(code, int) else OK)


def _refuse(message: str) -> int:
    click.echo(f"ptcc: {one_line(message)}", err=True)
    return BAD_INPUT


if __name__ == "__main__":
    main()
