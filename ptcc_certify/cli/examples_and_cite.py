"""``ptcc examples`` and ``cite``: the paper's examples, and its name."""

from __future__ import annotations

from pathlib import Path

import click

from ptcc_certify.cli.completion import PACKAGED, THEOREMS, complete
from ptcc_certify.errors import ParameterError, did_you_mean


@click.command()
@click.argument("name", default="all", shell_complete=complete((), ("all", *"123456", *PACKAGED)))
@click.option("-o", "--output", type=click.Path(file_okay=False), help="Write certificates and figures to this folder.")
@click.option("--format", "suffix", type=click.Choice(["png", "pdf", "svg"]), default="png", help="Of figures.")
def examples(name: str, output: str | None, suffix: str) -> int:
    """Run the paper's examples (all, a number 1 to 6, or a graph such as fig1a) and print one row each.

    worst and reached are of the simulated run, all else is proved. With -o also every certificate, the figures of the
    paper's Section 4 (and decay and input besides), and the table in full as examples.csv.
    """
    from ptcc_certify.certificate.verdict import worst_code
    from ptcc_certify.examples import select
    from ptcc_certify.report.example_results import RESULTS_HEAD, certify_example, result_line, results_csv

    selection, runs = select(name), []
    if output:
        try:
            Path(output).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ParameterError(f"{output}: cannot make this folder ({error.strerror})") from None
    click.echo(RESULTS_HEAD)
    for run in map(certify_example, selection):
        click.echo(result_line(run))
        runs.append(run)
        if output:
            stem = run.graph if run.example.sigma0 is None else f"{run.graph}_sliding"
            run.certificate.save(Path(output) / f"{stem}.json")
    if output:
        from ptcc_certify.graphs.io import write_atomically
        from ptcc_certify.report.example_figures import paper_figures
        from ptcc_certify.report.plots.style import save_figure

        for title, figure in paper_figures(runs).items():
            save_figure(figure, Path(output) / f"{title}.{suffix}")
        write_atomically(Path(output) / "examples.csv", results_csv(runs))
    return worst_code([run.certificate.assessment.exit_code for run in runs])


@click.command()
@click.argument("theorem", required=False, shell_complete=complete((), THEOREMS))
def cite(theorem: str | None) -> int:
    """Print BibTeX of the source, with the THEOREM used (such as 2.1) in the note."""
    from ptcc_certify.theorems.table import THEOREMS

    note = "Manuscript"
    if theorem is not None:
        statements = {t.number: t.statement for t in THEOREMS}
        if theorem not in statements:
            hint = did_you_mean(theorem, statements)
            raise ParameterError(f'no theorem "{theorem}"; one of {", ".join(statements)}{hint}')
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
    return 0
