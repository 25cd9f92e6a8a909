"""``ptcc design``: gains from limits."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ptcc_certify.cli.options import Options, flag_of, graph_options, json_option, number_option, output_option, read
from ptcc_certify.cli.terminal import FIGURES, print_json, print_lines, refuse_output
from ptcc_certify.errors import ExitCode, ParameterError

if TYPE_CHECKING:
    from ptcc_certify.gain_design import Design


@click.command()
@graph_options
@number_option("--max-input", metavar="U", required=True, help="Every |u_k| at all times, from all initial states.")
@number_option("--initial-bound", metavar="R", required=True, help="All initial states with |x_k(0)| <= R.")
@number_option("--deadline", metavar="T", help="Ask for this deadline.")
@click.option("--shortest-deadline", is_flag=True, help="Ask for the shortest deadline.")
@number_option("--residual", metavar="r", help="Every agent may be so far from its final state at the deadline.")
@click.option("--input-norm", type=click.Choice(["2"]), help="2: U bounds ||u||, not each |u_k|.")
@click.option("--curve", type=click.Path(dir_okay=False), help="Deadline against peak input: FILE.csv, or a figure.")
@output_option
@json_option
def design(graph: str, curve: str | None, output: str | None, as_json: bool, **options: Any) -> int:
    """Find gains of the nominal protocol whose input is proved to stay within a limit.

    The numbers printed are exact, and the last line is the command that proves them again with exit code 0.

    Exit code 0: found, with a certificate. 3: no gains of this protocol can, proved. 4: not with this certificate.
    """
    from ptcc_certify.gain_design import INFEASIBLE, MET
    from ptcc_certify.gain_design import design as run

    if (options["deadline"] is None) != options["shortest_deadline"]:
        raise ParameterError("give --deadline T, or ask for the --shortest-deadline: one of the two")
    for path in (output, curve):
        refuse_output(path, graph)
    if curve is not None and Path(curve).suffix.lower() not in (*FIGURES, ".csv"):
        raise ParameterError(f"{curve}: the curve is written to .csv, {', '.join(FIGURES)}; choose one of these")
    request: Any = {name: options[name] for name in ("max_input", "initial_bound", "deadline", "residual")}
    answer = run(read(graph, options), input_norm=2 if options["input_norm"] else None, **request)
    if output and answer.certificate is not None:
        answer.certificate.save(output)
    if curve:
        _save_curve(answer, curve)
    command = _certify_command(answer, graph, options)
    if as_json:
        print_json(answer.to_dict() | {"command": command})
    else:
        print_lines(answer.lines())
        if output and answer.certificate is not None:
            click.echo(f"written    {output}")
        if command is not None:
            again = " (give it the graph again, on standard input)" if graph == "-" else ""
            click.echo(f"to prove it again{again}:\n{command}")
        elif answer.protocol is not None:
            why = "certify finds other functions for these gains, which prove less"
            click.echo(f"note: {why}; the proof is the certificate that -o writes", err=True)
    return {MET: ExitCode.OK, INFEASIBLE: ExitCode.REFUTED}.get(answer.verdict, ExitCode.UNDECIDED)


def _certify_command(answer: Design, graph: str, options: Options) -> str | None:
    """Return the command that certifies the gains of a design again, as a shell takes it; None if there is none."""
    if answer.certify_options is None:
        return None
    flags = [] if options["edges"] is None else ["--edges", options["edges"]]
    flags += [] if options["duplicates"] == "refuse" else ["--duplicates", options["duplicates"]]
    flags += [flag_of(name) for name in ("drop_self_loops", "undirected") if options[name]]
    flags += answer.certify_options
    words = [*flags, "--", graph] if graph.startswith("-") and graph != "-" else [graph, *flags]
    return shlex.join(["ptcc", "certify", *words])


def _save_curve(answer: Design, path: str) -> None:
    """Write peak input against deadline: CSV, or a figure."""
    from ptcc_certify.graphs.io import write_atomically

    if Path(path).suffix.lower() == ".csv":
        curve = answer.trade_off(answer.deadlines())
        rows = zip(*(values.tolist() for values in curve), strict=True)
        lines = ["deadline,certified_peak,no_gains_below", *(",".join(map(repr, row)) for row in rows)]
        write_atomically(path, "\n".join(lines) + "\n")
    else:
        from ptcc_certify.report.plots.style import save_figure
        from ptcc_certify.report.plots.trade_off import plot_trade_off

        save_figure(plot_trade_off(answer), path)
