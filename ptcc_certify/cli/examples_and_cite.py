"""``ptcc examples`` and ``cite``: the paper's examples, and its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ptcc_certify.cli.terminal import print_lines, progress
from ptcc_certify.errors import ExitCode, ParameterError

if TYPE_CHECKING:
    from ptcc_certify.report.example_results import Run


@click.command()
@click.argument("names", metavar="[NAME]", nargs=-1)
@click.option("-o", "--output", type=click.Path(file_okay=False), help="Write certificates and figures to this folder.")
@click.option(
    "--format",
    "suffix",
    type=click.Choice(["png", "pdf", "svg"], case_sensitive=False),
    default="png",
    help="Of figures.",
)
def examples(names: tuple[str, ...], output: str | None, suffix: str) -> int:
    """Run the paper's examples (all, a number 1 to 6, or a graph such as fig1a) and print two lines each.

    worst and reached are of the simulated run, all else is proved. With -o also every certificate, the figures of the
    paper's Section 4 (and decay and input besides), and the table in full as examples.csv.

    published, or the name of one of them, runs examples of other papers, and tells what is claimed and what is found;
    with -o a certificate and a figure of each.
    """
    from ptcc_certify.examples import select
    from ptcc_certify.examples.published import PUBLISHED

    name = names[-1] if names else "all"
    if len(names) > 1 and (len(names) > 2 or names[0] != "published"):
        raise ParameterError(f"{len(names)} names: examples are run one at a time, or all; give one name")
    if "published" in names or name in PUBLISHED:
        return _published(name, output, suffix)
    selection = select(name)
    _make(output)
    steps = [f"example {example.number} on {graph}" for example, graph, _ in selection]
    with progress([*steps, "figures"] if output else steps) as begin:
        begin(steps[0])
        from ptcc_certify.certificate.assessment import worst_code
        from ptcc_certify.report.example_results import RESULTS_HEAD, certify_example, result_lines

        print_lines(*RESULTS_HEAD)
        runs = []
        for step, entry in zip(steps, selection, strict=True):
            begin(step)
            runs.append(certify_example(entry))
            print_lines(*result_lines(runs[-1]))
            if output:
                _save(runs[-1], Path(output))
        if output:
            begin("figures")
            _draw(runs, Path(output), suffix)
    return worst_code([run.certificate.assessment.exit_code for run in runs])


def _published(name: str, output: str | None, suffix: str) -> int:
    """Certify published examples; return 0 if each holds, or fails, as recorded."""
    from ptcc_certify.examples.published import select_published

    selection = select_published(name)
    _make(output)
    recorded = True
    with progress([entry.name for entry in selection]) as begin:
        begin(selection[0].name)
        from ptcc_certify.report.example_results import PUBLISHED_HEAD, certify_published
        from ptcc_certify.report.plots.style import save_figure

        print_lines(*PUBLISHED_HEAD)
        for entry in selection:
            begin(entry.name)
            found = certify_published(entry)
            recorded &= found.as_recorded
            print_lines(*found.lines())
            if output:
                found.certificate.save(Path(output) / f"{entry.name}.json")
                save_figure(found.certificate.plot(), Path(output) / f"{entry.name}.{suffix}")
    return int(not recorded)


def _make(output: str | None) -> None:
    """Make the folder for what is written."""
    if output:
        try:
            Path(output).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ParameterError(f"{output}: cannot make this folder ({error.strerror})") from None


def _save(run: Run, folder: Path) -> None:
    """Write the certificate of an example to a folder."""
    stem = run.graph if run.example.sigma0 is None else f"{run.graph}_sliding"
    run.certificate.save(folder / f"{stem}.json")


def _draw(runs: Sequence[Run], folder: Path, suffix: str) -> None:
    """Write the figures of some examples, and their table, to a folder."""
    from ptcc_certify.graphs.io import write_atomically
    from ptcc_certify.report.example_figures import paper_figures
    from ptcc_certify.report.example_results import results_csv
    from ptcc_certify.report.plots.style import save_figure

    for title, figure in paper_figures(runs).items():
        save_figure(figure, folder / f"{title}.{suffix}")
    write_atomically(folder / "examples.csv", results_csv(runs))


@click.command()
@click.argument("theorem", metavar="[THEOREM|CERTIFICATE|software]", nargs=-1)
def cite(theorem: tuple[str, ...]) -> int:
    """Print BibTeX of the source, with the THEOREM used (such as 2.1) in the note, or those of a CERTIFICATE.

    software prints that of this program.
    """
    from ptcc_certify.certificate.certificate import RejectedCertificate
    from ptcc_certify.theorems.table import cite as bibtex
    from ptcc_certify.theorems.table import cite_software

    named = list(filter(None, (re.sub(r"(?i)^theorem\b\s*", "", word) for word in theorem)))
    if len(named) > 1:
        raise ParameterError("cite one theorem, or one certificate, at a time")
    if [word.lower() for word in named] == ["software"]:
        click.echo(cite_software())
        return ExitCode.OK
    try:
        applied = _theorems_of(named[0]) if named and Path(named[0]).suffix.lower() == ".json" else named
    except RejectedCertificate as error:
        print_lines(f"rejected: {error}", err=True)
        return ExitCode.VIOLATED
    click.echo(bibtex(*applied))
    return ExitCode.OK


def _theorems_of(path: str) -> list[str]:
    """Return the theorems of the source that a certificate applies."""
    from ptcc_certify.certificate.certificate import read_certificate

    certificate = read_certificate(path)
    if certificate.of_family:
        raise ParameterError(
            f"{path}: of a family, to which no theorem of the source applies; ptcc cite alone prints the source"
        )
    return list(dict.fromkeys(claim.theorem for claim in certificate.graph_proof.claims))
