"""``ptcc classify``: structure alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from ptcc_certify.cli.click_options import Command
from ptcc_certify.cli.families import classify_family, family_options, read_graph_or_family
from ptcc_certify.cli.options import expect_option, graphs_argument, json_option, reading_options
from ptcc_certify.cli.terminal import Screen, print_json, print_lines, progress, screen_options
from ptcc_certify.errors import ExitCode

if TYPE_CHECKING:
    from ptcc_certify.certificate.fact import Fact
    from ptcc_certify.graphs.structure import Structure

#: Seconds for the distance from balance.
_SECONDS = 5.0


@click.command(cls=Command)
@graphs_argument
@expect_option("Such as bipartite-consensus; exit code 3 if refuted.")
@json_option
@screen_options
@reading_options
@family_options
def classify(graph: tuple[str, ...], expect: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Tell the structure of GRAPH and the theorem that applies; no computation in floating point.

    With -v also how far from balance it is, as ptcc balance tells; searches are in floating point then.

    Of a family - several graphs with --switching, weights in intervals, --uncertainty, --optional - tell what it does
    for every signal, or why that depends on the signal.

    For example: ptcc classify fig1b --expect bipartite-consensus
    """
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.facts.graph import structure_facts

    with progress(("graph", "structure")) as begin:
        begin("graph")
        given = read_graph_or_family(graph, options)
        if isinstance(given, Family):
            return classify_family(graph, given, expect, as_json, screen, options)
        begin("structure")
        structure = analyse(given)
    if as_json:
        from ptcc_certify.certificate.graph_sections import structure_document

        print_json(structure_document(structure))
    else:
        screen.show(lambda details: structure_facts(structure, graph[0], _distance(structure) if details else ()))
    if expect is None:
        return ExitCode.OK
    from ptcc_certify.certificate.assessment import MET
    from ptcc_certify.certificate.judgements import judge_behaviour

    answer = judge_behaviour(structure, expect)
    if answer.status != MET:
        print_lines(f"{answer.status}: {answer}", err=True)
        return ExitCode.REFUTED
    if len(structure.components) > 1:
        click.echo(f"note: {expect} holds in each of the components by itself", err=True)
    return ExitCode.OK


def _distance(structure: Structure) -> list[Fact]:
    """Tell the distance from balance of a graph that is not balanced, within few seconds."""
    from ptcc_certify.graphs.frustration import frustration_index
    from ptcc_certify.report.facts.balance import distance_fact

    return [] if structure.balanced else [distance_fact(frustration_index(structure, time_limit=_SECONDS))]
