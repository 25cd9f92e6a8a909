"""``ptcc edit``: a graph without some of its nodes and edges, as a file for the other commands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lmi.exact.decimal_rounding import counted
from ptcc_certify.cli.families import edges_named
from ptcc_certify.cli.options import graph_argument, read, reading_options
from ptcc_certify.cli.terminal import Screen, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError


@click.command()
@graph_argument
@click.option(
    "--without-node", "without_nodes", multiple=True, metavar="NODE", help="Leave NODE out, with all its edges."
)
@click.option(
    "--without-edge",
    "without_edges",
    multiple=True,
    metavar="SOURCE,TARGET",
    callback=edges_named,
    help="Leave out this edge, on which TARGET hears SOURCE; repeat both for more.",
)
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write it to this file, such as smaller.csv.")
@screen_options
@reading_options
def edit(
    graph: str,
    without_nodes: tuple[str, ...],
    without_edges: tuple[tuple[str, str], ...],
    output: str | None,
    screen: Screen,
    **options: Any,
) -> int:
    """Write GRAPH without some of its nodes and edges, weights exact, as rows source,target,weight.

    For example: ptcc edit fig5a --without-node 1 --without-edge 2,3 -o smaller.csv

    Information flows from source to target in what is written, however GRAPH was read; no other column is kept.
    Without -o it is printed: ptcc edit fig5a --without-node 1 | ptcc certify -
    """
    from ptcc_certify.graphs.io import write_graph
    from ptcc_certify.graphs.io.edge_list import edge_list
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.facts.graph import graph_facts

    if not (without_nodes or without_edges):
        raise ParameterError("nothing is left out; give --without-node NODE or --without-edge SOURCE,TARGET")
    if output is not None and Path(output).suffix.lower() not in (".csv", ".txt"):
        raise ParameterError(f"{output}: graphs are written as edge lists; let the name end in .csv or .txt")
    refuse_output(output)
    whole = read(graph, options)
    nodes = [text if text in whole.labels else text.removeprefix('"').removesuffix('"') for text in without_nodes]
    smaller = whole.without_edges(*without_edges).without_nodes(*nodes)
    if output is None:
        click.echo(edge_list(smaller, "standard output"), nl=False)
        return ExitCode.OK
    write_graph(smaller, output)
    screen.show(lambda details: graph_facts(analyse(whole), graph, details))
    size = f"{counted(smaller.n_nodes, 'node')}, {counted(smaller.n_edges, 'edge')}"
    screen.note(f"written    {output}: {size}; row a,b: information flows a -> b")
    return ExitCode.OK
