"""``ptcc check`` and ``report``: check a certificate, and write it for somebody to read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lmi.exact.decimal_rounding import counted
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import Command, flag_of
from ptcc_certify.cli.families import mode_options
from ptcc_certify.cli.same_graph import READING, compare
from ptcc_certify.cli.scenario import graph_of
from ptcc_certify.cli.terminal import Screen, print_json, print_lines, progress, screen_options
from ptcc_certify.errors import ExitCode, ParameterError

if TYPE_CHECKING:
    from ptcc_certify.checker import CheckReport


@click.command(cls=Command)
@shared.certificate_argument
@click.argument("graph", nargs=-1, is_eager=True, callback=graph_of, type=click.Path())
@shared.reading_options
@mode_options
@click.option("--stdlib", is_flag=True, help="Use the standard library alone, even where python-flint is installed.")
@click.option("--verified", is_flag=True, help="Use the checker that is itself proved in Coq, if formal/ is built.")
@shared.memory_option
@shared.json_option
@screen_options
def check(
    certificate: str,
    graph: tuple[str, ...],
    stdlib: bool,
    verified: bool,
    memory: float,
    as_json: bool,
    screen: Screen,
    **options: Any,
) -> int:
    """Check CERTIFICATE exactly, without a solver; with GRAPH, that it speaks of this graph.

    Exit code 0 if the claim is proved, 1 if it is rejected, 4 if the certificate itself says undecided; where what was
    asked of it is refuted or left open, the last line, and `asked` of --json, say so.

    For example: ptcc check fig1b.json fig1b

    CERTIFICATE is a file, or - for standard input (side files are then those in this folder). GRAPH is read as the
    options say, as by the other commands, or a scenario; never as the certificate says. Where that alone gives its
    graph, the check fails and names the options that would agree. Of a family name all its graphs, in any order.
    Prints claim and verdict; -v tells every obligation with what was verified. With --verified all that was not
    checked is named: exit code 4 if a claim is among it; an undecided certificate is not read.
    `python -m ptcc_certify.checker` does the same, without other packages.
    """
    from ptcc_certify.certificate.checking import read_and_check
    from ptcc_certify.cli.proved_checker import verified_check
    from ptcc_certify.report.screen import accepted_line, certificate_of_file, check_summary
    from ptcc_certify.report.text_layout import wrap_lines

    if certificate == "-" and "-" in graph:
        raise ParameterError("CERTIFICATE and GRAPH cannot both be standard input; name a file for one")
    source = click.get_current_context().get_parameter_source
    given = [name for name in READING if source(name) is ParameterSource.COMMANDLINE]
    if given and not graph:
        raise ParameterError(f"{flag_of(given[0])} tells how a graph is read; name it: ptcc check CERT GRAPH")
    report: CheckReport
    with progress(("independent check",), screen.quiet) as begin:
        begin("independent check")
        if verified:
            document, report = verified_check(certificate, memory)
        else:
            document, report = read_and_check(certificate, stdlib=stdlib, memory=memory)
    how: dict[str, str] = {}
    if graph and report.accepted:
        report, how = compare(certificate, document, report, graph, options)
    path = "" if stdlib else certificate
    if as_json:
        accepted = certificate_of_file(path, document, report)
        asked = {"asked": accepted.assessment.asked} if accepted and accepted.assessment.asked else {}
        print_json(report.to_dict() | how | asked)
    else:
        lines = [f"graph      {text}" for text in how.values() or _own_graph(document, report)]
        if screen.verbose:
            last = accepted_line(report, certificate_of_file(path, document, report))
            screen.lines([*lines, *report.lines()[:-1], last])
        elif not screen.quiet:
            print_lines(*wrap_lines(lines), *check_summary(path, document, report))
    if not report.accepted:
        return ExitCode.VIOLATED
    return ExitCode.OK if report.verdict == "certified" else ExitCode.UNDECIDED


def _own_graph(document: dict[str, Any], report: CheckReport) -> list[str]:
    """Tell the size of the graph, or family, that an accepted certificate holds, and how to know it for the one meant.

    Examples
    --------
    >>> cert = certify([("a", "b", -1)], NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), asks=Asks(simulation=False))
    >>> [text.partition(" SHA")[0] for text in _own_graph(cert.to_dict(), cert.checked)]
    ['2 nodes, 1 edge, as in the file; name yours to compare;']
    """
    if not report.accepted:
        return []
    graph = document["problem"]["graph"]
    modes = graph["modes"]
    edges = [mode["edges"] for mode in modes]
    count = sum(listed["count"] if isinstance(listed, dict) else len(listed) for listed in edges)
    sizes = [counted(len(graph["nodes"]), "node"), counted(count, "edge")]
    if len(modes) > 1:
        sizes.insert(0, counted(len(modes), "mode"))
    return [f"{', '.join(sizes)}, as in the file; name yours to compare; SHA-256 {report.sha256}"]


@click.command()
@shared.certificate_argument
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), required=True, help="A page, .html, or a statement, .tex"
)
@click.option(
    "--simulation/--no-simulation", default=None, help="Repeat the CVODES run.  [default: up to 1,000 agents]"
)
@shared.memory_option
def report(certificate: str, output: str, simulation: bool | None, memory: float) -> int:
    """Check CERTIFICATE and write a report to send to somebody: a page of HTML, or a statement in LaTeX.

    CERTIFICATE is a file, or - for standard input (side files are then those in this folder), which the report calls
    certificate.json. The page is one file that loads nothing and runs no script. Exit codes are those of `check`; of a
    rejected certificate the page tells the reason and no claim.
    """
    from ptcc_certify.certificate.certificate import RejectedCertificate

    try:
        with progress(("independent check", "simulation", "report")) as begin:
            begin("independent check")
            from ptcc_certify.report.report_file import write_report  # takes seconds: figures

            verdict = write_report(certificate, output, simulation=simulation, progress=begin, memory=memory)
    except RejectedCertificate as error:
        print_lines(f"rejected: {error}", err=True)
        return ExitCode.VIOLATED
    if verdict == "rejected":
        print_lines(f"rejected   {'standard input' if certificate == '-' else certificate}")
        print_lines(f"written    {output} (tells why)")
        return ExitCode.VIOLATED
    print_lines(f"{verdict:<10} {output}")
    if (path := Path(output)).suffix.lower() == ".tex":
        figures = re.findall(rf"{re.escape(path.stem)}_\w+\.pdf", path.read_text(encoding="utf-8"))
        print_lines(f"{'written':<10} {', '.join(dict.fromkeys([path.name, *figures]))}")
    return ExitCode.UNDECIDED if verdict == "undecided" else ExitCode.OK
