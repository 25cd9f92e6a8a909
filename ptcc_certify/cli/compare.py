"""``ptcc compare``: an asymptotic, a finite-time, a fixed-time and the prescribed-time protocol on one graph."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import exact_number, one_of, options_for, together
from ptcc_certify.cli.terminal import Screen, print_json, progress, screen_options
from ptcc_certify.errors import ExitCode
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import Asks, InitialState, Run

_nominal = together(options_for(NominalProtocol), one_of(InitialState, "x0", default="random"), one_of(Run, "seed"))


@click.command()
@shared.graph_argument
@_nominal
@shared.prejudice_option
@click.option("--power", metavar="P", default="1/2", show_default=True, help="0 < P < 1: of finite and fixed time.")
@click.option("--high-power", metavar="Q", default="3/2", show_default=True, help="Q > 1: of fixed time.")
@click.option("--factor", metavar="C", default="1", show_default=True, help="Of the protocols without a deadline.")
@shared.json_option
@screen_options
@shared.reading_options
def compare(graph: str, power: str, high_power: str, factor: str, as_json: bool, screen: Screen, **options: Any) -> int:
    """Compare protocols on GRAPH: when everybody rests, and what input it takes.

    Beside the prescribed-time protocol three without a deadline, of powers of e, the relative position of an agent to
    those that it hears. Times are proved upper bounds, and so is the input of the prescribed-time protocol; the inputs
    of the others are exact, they are those at 0.

    For example: ptcc compare fig5a --T 0.5 --rho2 2
    """
    from ptcc_certify.bounds.settling import PowerProtocol
    from ptcc_certify.certificate.certification import certify
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.report.facts.compare import compare_facts, row_of_powers, row_of_protocol
    from ptcc_certify.report.facts.graph import graph_facts

    p, q, c = (exact_number(x, f) for x, f in ((power, "--power"), (high_power, "--high-power"), (factor, "--factor")))
    kinds = {"asymptotic": (Fraction(1),), "finite": (p,), "fixed": (p, q)}
    laws = {name: PowerProtocol(powers, c) for name, powers in kinds.items()}
    with progress(("comparison",)) as begin:
        begin("comparison")
        structure = analyse(shared.read(graph, options))
        x0 = shared.initial_state_of(options, structure.graph)
        protocol = shared.protocol_of({**options, "kind": "nominal"})
        assert isinstance(protocol, NominalProtocol)
        rows = [row_of_powers(name, c, kinds[name], law.settling(structure, x0)) for name, law in laws.items()]
        effort = certify(structure.graph, protocol, x0, asks=Asks(simulation=False)).graph_proof.effort
        peak = None if effort is None or effort.peak is None else Fraction(effort.peak.largest)
        rows.append(row_of_protocol(protocol, peak))
    if as_json:
        print_json({row.name: row.told() for row in rows})
    else:
        screen.show(lambda details: [*graph_facts(structure, graph, details), *compare_facts(rows)])
    return ExitCode.OK
