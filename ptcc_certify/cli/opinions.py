"""``ptcc opinions``: what becomes of opinions in steps of time."""

from __future__ import annotations

import csv
import io
from pathlib import PurePath
from typing import Any

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import exact_number, one_of
from ptcc_certify.cli.terminal import Screen, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError
from ptcc_certify.model.asks import InitialState, Run


@click.command()
@shared.graph_argument
@one_of(InitialState, "x0", default="random")
@one_of(Run, "seed")
@shared.prejudice_option
@click.option(
    "--self-weight", metavar="S", default="0", help="Share of its own opinion each keeps: 0.3 | a=0.3,b=0.5 | FILE.csv"
)
@click.option("--steps", type=click.IntRange(1, 100_000), default=50, help="Steps of the run that is shown.")
@click.option("--within", metavar="R", default="0.01", help="Tell after how many steps all stay as near to their ends.")
@click.option(
    "--rule",
    type=click.Choice(["opposing", "repelling"]),
    default="opposing",
    help="What a negative weight does: an opinion is heard with the sign turned; repelling is refused.",
)
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="The run as a table, FILE.csv")
@shared.json_option
@screen_options
@shared.reading_options
def opinions(graph: str, steps: int, output: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Tell what becomes of opinions on GRAPH in steps of time: x(t+1) = A x(t) + B p, of DeGroot, Friedkin and Johnsen.

    Agent k keeps the share S of its own opinion; the rest it hears in proportion to the weights, that of --stubborn
    included. Whether opinions settle is decided exactly; where, is exact up to 120 nodes; the bound is proved.

    For example: ptcc opinions fig5a --stubborn 1=0.5 --self-weight 0.2
    """
    from ptcc_certify.bounds.final_state.in_steps import opinions_in_steps
    from ptcc_certify.graphs.io import write_atomically
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.graphs.stubborn import agent_nodes
    from ptcc_certify.report.facts.graph import graph_facts
    from ptcc_certify.report.facts.in_steps import steps_facts

    if options.pop("rule") == "repelling":
        mend = "it may diverge, and nothing here is proved of it; leave it out"
        raise ParameterError(
            f"--rule repelling: divides by the sum of w_kl, not of |w_kl|, which is another model; {mend}"
        )
    if output is not None and PurePath(output).suffix.lower() != ".csv":
        raise ParameterError(f"{output}: the run is a table; write it to .csv")
    refuse_output(output)
    within = exact_number(options.pop("within"), "--within")
    if within <= 0:
        raise ParameterError("--within: is a distance; give a number > 0, such as 0.01")
    with progress(("opinions",)) as begin:
        begin("opinions")
        signed = shared.read(graph, options)
        x0 = shared.initial_state_of(options, signed)
        found = opinions_in_steps(signed, x0, self_weight=options["self_weight"])
    facts = [*steps_facts(found, steps, within)]
    if as_json:
        print_json(found.to_dict(within))
    else:
        screen.show(lambda details: [*graph_facts(analyse(signed), graph, details), *facts])
    if output is not None:
        agents, text = agent_nodes(signed), io.StringIO()
        rows = ((step, *row) for step, row in enumerate(found.run(steps)[:, agents].tolist()))
        csv.writer(text, lineterminator="\n").writerows([("step", *(signed.labels[k] for k in agents)), *rows])
        write_atomically(output, text.getvalue())
        if not as_json:
            screen.note(f"written    {output}")
    return ExitCode.OK
