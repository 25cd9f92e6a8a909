"""``ptcc influence``: who decides whom, and who is dangerous."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import asdict
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ptcc_certify.cli.click_options import Command, exact_number
from ptcc_certify.cli.options import graph_argument, json_option, read, reading_options
from ptcc_certify.cli.terminal import FIGURES, Screen, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError, items_of
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    from ptcc_certify.bounds.final_state.of_graph import Influence
    from ptcc_certify.certificate.fact import Facts
    from ptcc_certify.graphs.structure import Structure


class Answer(NamedTuple):
    """What is printed, on a short screen or with details and as JSON, and the table that is written."""

    facts: Callable[[bool], Facts]
    told: Callable[[], dict[str, Any]]
    table: Callable[[], str]


@click.command(cls=Command)
@graph_argument
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="A heat map, .png, .pdf or .svg, or the table, .csv"
)
@click.option(
    "--captured",
    metavar="A[,B]|all",
    help="How far these agents move the others if they hear nobody and show what they like; all: each alone, ranked.",
)
@click.option("--radius", metavar="R", help="With --captured: they show numbers within [-R, R].  [default: 1]")
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
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.facts.graph import graph_facts

    captured, radius = options.pop("captured"), options.pop("radius")
    kind = None if output is None else PurePath(output).suffix.lower()
    if kind not in (None, ".csv", *FIGURES):
        raise ParameterError(f"{output}: a table is written to .csv, a heat map to {', '.join(FIGURES)}; choose one")
    if captured is not None and kind in FIGURES:
        raise ParameterError(f"{output}: what --captured tells is a table; write it to .csv")
    if captured is None and radius is not None:
        raise ParameterError("--radius is of what captured agents show; name them by --captured, or leave it out")
    refuse_output(output)
    drawn = None
    with progress(("who decides whom", "figure")) as begin:
        begin("who decides whom")
        structure = analyse(read(graph, options))
        if captured is not None:
            answer = _of_captured(structure, captured, radius or "1")
        else:
            who = influence_of(structure)
            answer = _of_leaders(who)
            if kind in FIGURES:  # refused, if so, before anything is told
                from ptcc_certify.report.plots.influence import plot_influence

                begin("figure")
                drawn = plot_influence(who)
    if as_json:
        print_json(answer.told())
    else:
        screen.show(lambda details: [*graph_facts(structure, graph, details), *answer.facts(details)])
    if output is not None:
        if drawn is None:
            write_atomically(output, answer.table())
        else:
            from ptcc_certify.report.plots.style import save_figure

            save_figure(drawn, output)
        if not as_json:
            screen.note(f"written    {output}")
    return ExitCode.OK


def _of_leaders(who: Influence) -> Answer:
    from ptcc_certify.report.facts.influence import influence_facts

    labels = who.structure.graph.labels

    def told() -> dict[str, Any]:
        deciding = {label: share for label, share in zip(labels, who.shares.tolist(), strict=True) if share}
        rows = {label: {labels[j]: str(x) for j, x in who.row(k).items()} for k, label in enumerate(labels)}
        return {"exact": who.exact, "shares": deciding, "weights": rows}

    return Answer(lambda _: influence_facts(who), told, who.to_csv)


def _of_captured(structure: Structure, text: str, radius: str) -> Answer:
    """Tell how far agents move others, of a text of their labels, or ``all``."""
    from ptcc_certify.bounds.final_state.captured import captured, ranking, ranking_csv
    from ptcc_certify.graphs.size_limits import EXACT_NODES
    from ptcc_certify.report.facts.influence import captured_facts, ranking_facts

    labels, size = structure.graph.labels, exact_number(radius, "--radius")
    exact = len(labels) <= EXACT_NODES
    if text != "all":
        try:
            agents = [text] if text in labels else [x.strip() for x in items_of(text)]
        except csv.Error:
            raise ParameterError(f"--captured: {shorten(text)} names no agents; write A,B, such as a,b") from None
        found = captured(structure, agents, size, exact)
        return Answer(lambda _: captured_facts(found), lambda: _written(asdict(found)), found.to_csv)
    if text in labels:
        mend = 'ask Python, influence(graph).captured("all") or .ranking()'
        raise ParameterError(f"--captured all: one agent is called all, and all are ranked so; {mend}")
    ranked = ranking(structure, size, exact)
    rows = {"exact": exact, "radius": size, "ranking": [asdict(reach) for reach in ranked]}
    return Answer(
        lambda details: ranking_facts(ranked, size, exact, details), lambda: _written(rows), lambda: ranking_csv(ranked)
    )


def _written(data: Any) -> Any:
    """Return data for JSON, numbers as texts."""
    if isinstance(data, dict):
        return {key: _written(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_written(value) for value in data]
    return data if isinstance(data, bool | str) else str(data)
