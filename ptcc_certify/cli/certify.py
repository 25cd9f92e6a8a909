"""``ptcc certify``: make a certificate."""

from __future__ import annotations

from typing import Any

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.scenario import scenario_record
from ptcc_certify.cli.terminal import print_json, print_lines, progress, refuse_output
from ptcc_certify.errors import ParameterError


@click.command()
@shared.graph_options
@shared.protocol_options
@shared.expect_option("E.g. bipartite-consensus; exit code 3 if it does not follow.")
@shared.number_option(
    "--min-rate", metavar="R", help="Ask for a proved rate of at least R per unit of the stretched clock."
)
@shared.method_option
@shared.limit_options
@shared.initial_bound_option
@shared.number_option(
    "--noise", metavar="NU", help="Nominal: bound the effect of measurement noise |n_k| <= NU under a limit."
)
@shared.number_option("--max-input", metavar="U", help="Ask for a proved peak of every |u_k| of at most U.")
@shared.number_option("--at", metavar="t", help="Optimise the bound at this instant, and print it for every agent.")
@click.option(
    "--simulation/--no-simulation", default=None, help="Compare with a CVODES run.  [default: up to 10,000 agents]"
)
@shared.time_limit_option
@shared.output_option
@shared.json_option
def certify(graph: str, output: str | None, as_json: bool, **options: Any) -> int:
    """Certify what the protocol does on GRAPH: behaviour, rate, final state; compare with a CVODES run."""
    from ptcc_certify.certificate.procedure import STEPS
    from ptcc_certify.certificate.procedure import certify as run
    from ptcc_certify.certificate.request import Expectations
    from ptcc_certify.report.screen import certificate_lines

    most = options["max_input"]
    if most is not None and most <= 0:
        raise ParameterError("--max-input is outside its domain; it must be > 0")
    refuse_output(output, graph)
    protocol = shared.protocol_of(options)
    signed = shared.read(graph, options)
    x0 = shared.read_initial_state(options["x0"], options["seed"], signed)
    more = shared.sliding_keywords(protocol, options, signed)
    if options["kind"] == "nominal":
        actuator = shared.actuator_of(options)
        more = {"limits": [] if actuator is None else [actuator], "delta": options["delta"], "noise": options["noise"]}
    elif options["noise"] is not None:
        raise ParameterError("--noise belongs to --protocol nominal; leave it out or change the protocol")
    more |= {name: options[name] for name in ("method", "simulation", "time_limit", "at")}
    more |= {"initial_set": options["initial_bound"]}
    more |= {"expectations": Expectations(options["expect"], options["min_rate"], most), "scenario": scenario_record()}
    with progress(STEPS) as begin:
        certificate = run(signed, protocol, x0, progress=begin, **more)
    if output:
        certificate.save(output)
    assessment = certificate.assessment
    if as_json:
        print_json(certificate.to_dict())
        if assessment.exit_code:
            click.echo(f"verdict    {assessment.text}", err=True)
    else:
        print_lines(certificate_lines(certificate, graph))
        if output:
            click.echo(f"written    {output}")
    return assessment.exit_code
