"""``ptcc balance``: how far from balance, and which edges spoil it."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any, Literal

import click

from ptcc_certify.cli.options import graph_argument, json_option, read, reading_options
from ptcc_certify.cli.terminal import Screen, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError


@click.command()
@graph_argument
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="Write the edges that spoil it to this .csv file."
)
@click.option(
    "--by",
    type=click.Choice(["count", "weight"]),
    default="count",
    help="Count edges, or sum up the sizes of their weights.",
)
@click.option("--groups", is_flag=True, help="Of each leader group by itself, instead of the whole graph.")
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=30.0,
    metavar="SECONDS",
    help="For the searches together; what they found by then is told.",
)
@json_option
@screen_options
@reading_options
def balance(
    graph: str,
    output: str | None,
    by: Literal["count", "weight"],
    groups: bool,
    time_limit: float,
    as_json: bool,
    screen: Screen,
    **options: Any,
) -> int:
    """Tell how far from balance GRAPH is: bounds on its frustration index, the least number of edges to remove.

    Both bounds are proved: by camps, and by negative cycles. An undirected pair counts once; in a graph that is not
    undirected every arc does.

    For example: ptcc balance highland_tribes -o spoiling.csv
    """
    from ptcc_certify.graphs.frustration import frustration_index
    from ptcc_certify.graphs.io import write_atomically
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.facts.balance import balance_facts
    from ptcc_certify.report.facts.graph import graph_facts

    if output is not None and PurePath(output).suffix.lower() != ".csv":
        raise ParameterError(f"{output}: the edges are written as a table; let the name end in .csv")
    refuse_output(output)
    with progress(("distance from balance",)) as begin:
        begin("distance from balance")
        structure = analyse(read(graph, options))
        parts = [structure.graph]
        if groups:
            unbalanced = [closed for closed in structure.closed_components if not closed.balanced]
            parts = [structure.graph.subgraph(closed.nodes) for closed in unbalanced]
        found = [frustration_index(part, by, time_limit / len(parts)) for part in parts]
    if as_json:
        print_json({"parts": [one.to_dict() for one in found]})
    else:
        told = [fact for one in found for fact in balance_facts(one, groups)]
        screen.show(lambda details: [*graph_facts(structure, graph, details), *told])
        if not found:
            screen.note("balance    every leader group is balanced: frustration index 0")
    if output is not None:
        tables = [one.to_csv() for one in found] or ["source,target,weight\n"]
        write_atomically(output, tables[0] + "".join(table.partition("\n")[2] for table in tables[1:]))
        if not as_json:
            screen.note(f"written    {output}")
    return ExitCode.OK
