"""``ptcc influence``: who decides whom."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

import click

from ptcc_certify.cli.click_options import Command
from ptcc_certify.cli.options import graph_argument, json_option, read, reading_options
from ptcc_certify.cli.terminal import FIGURES, Screen, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError


@click.command(cls=Command)
@graph_argument
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="A heat map, .png, .pdf or .svg, or the table, .csv"
)
@json_option
@screen_options
@reading_options
def influence(graph: str, output: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Tell who decides whom in GRAPH: by which weights final states depend on the initial states of leaders.

    Under the nominal protocol x(T) = Q x(0), whatever deadline and gains are. Exact up to 120 nodes.

    For example: ptcc influence fig5a -o influence.png
    """
    from ptcc_certify.bounds.final_state.of_graph import influence as influence_of
    from ptcc_certify.graphs.io import write_atomically
    from ptcc_certify.report.facts.graph import graph_facts
    from ptcc_certify.report.facts.influence import influence_facts

    kind = None if output is None else PurePath(output).suffix.lower()
    if kind not in (None, ".csv", *FIGURES):
        raise ParameterError(f"{output}: a table is written to .csv, a heat map to {', '.join(FIGURES)}; choose one")
    refuse_output(output)
    drawn = None
    with progress(("who decides whom", "figure")) as begin:
        begin("who decides whom")
        who = influence_of(read(graph, options))
        if kind in FIGURES:  # refused, if so, before anything is told
            from ptcc_certify.report.plots.influence import plot_influence

            begin("figure")
            drawn = plot_influence(who)
    if as_json:
        labels, shares = who.structure.graph.labels, who.shares.tolist()
        rows = {label: {labels[j]: str(x) for j, x in who.row(k).items()} for k, label in enumerate(labels)}
        deciding = {label: share for label, share in zip(labels, shares, strict=True) if share}
        print_json({"exact": who.exact, "shares": deciding, "weights": rows})
    else:
        screen.show(lambda details: [*graph_facts(who.structure, graph, details), *influence_facts(who)])
    if output is not None:
        if drawn is None:
            write_atomically(output, who.to_csv())
        else:
            from ptcc_certify.report.plots.style import save_figure

            save_figure(drawn, output)
        if not as_json:
            screen.note(f"written    {output}")
    return ExitCode.OK
