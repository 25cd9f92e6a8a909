"""``ptcc certify``: make a certificate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lmi.exact.decimal_rounding import down
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.agents import (
    agents_keywords,
    agents_of,
    agents_options,
    dimension_option,
    refuse_agents_of_family,
    refuse_dimension,
)
from ptcc_certify.cli.families import (
    certify_family,
    family_options,
    read_graph_or_family,
    refuse_restricted,
    restricted_options,
)
from ptcc_certify.cli.messages import leader_options, leaders_of, message_options, messages_of, refuse_unheard
from ptcc_certify.cli.scenario import scenario_record
from ptcc_certify.cli.terminal import LOG, Screen, in_flags, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ParameterError, one_line

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols import Protocol


@click.command()
@shared.graphs_argument
@shared.protocol_options
@shared.output_option
@shared.json_option
@screen_options
@shared.reading_options
@family_options
@restricted_options
@shared.expect_option("E.g. bipartite-consensus; exit code 3 if it does not follow.")
@shared.number_option(
    "--min-rate", metavar="R", help="Ask for a proved decay rate of at least R per unit of the stretched clock."
)
@shared.number_option("--max-input", metavar="U", help="Ask for a proved peak of every |u_k| of at most U.")
@shared.number_option(
    "--at", metavar="t", help="Optimise the bound at this instant, and print it; -v: for every agent."
)
@shared.method_option
@shared.limit_options
@agents_options
@message_options
@leader_options
@shared.number_option(
    "--max-residual", metavar="R", help="With late messages: ask for every agent within R of its final state at T."
)
@dimension_option
@shared.initial_bound_option
@shared.number_option(
    "--noise", metavar="NU", help="Nominal: bound the effect of measurement noise |n_k| <= NU under a limit."
)
@click.option(
    "--simulation/--no-simulation", default=None, help="Compare with a CVODES run.  [default: up to 10,000 agents]"
)
@shared.time_limit_option
def certify(graph: tuple[str, ...], output: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Certify what the protocol does on GRAPH: behaviour, final state, error bound, input.

    Of a family - several graphs with --switching, weights in intervals, --uncertainty, --optional - it certifies what
    holds for every signal.

    Prints 8 lines, 10 or so where the answers take more; -v tells rates, the Lyapunov functions searched and used,
    proof obligations and the simulated run. Exit code 0: certified, and everything asked holds.
    """
    from ptcc_certify.graphs.family import Family

    refuse_output(output)
    refuse_dimension(options, "certify")
    protocol, given = shared.protocol_of(options), read_graph_or_family(graph, options)
    if isinstance(given, Family):
        if agents_of(options) is not None:
            refuse_agents_of_family(options, "certify")
        return certify_family(graph, given, output, as_json, screen, options)
    refuse_restricted(options)
    return _certify_graph(graph[0], given, protocol, output, as_json, screen, options)


def _certify_graph(
    graph: str,
    signed: SignedDigraph,
    protocol: Protocol,
    output: str | None,
    as_json: bool,
    screen: Screen,
    options: shared.Options,
) -> int:
    """Certify what the protocol does on one graph."""
    from ptcc_certify.certificate.answer import rejects
    from ptcc_certify.certificate.procedure import STEPS
    from ptcc_certify.certificate.procedure import certify as run
    from ptcc_certify.report.facts.of_certificate import facts_of

    LOG.info("%s", one_line(f"read {graph}: {signed.n_nodes} nodes, {signed.n_edges} edges"))
    more = shared.sliding_keywords(protocol, options, signed) | _requests(options)
    of_agents = agents_keywords(options, signed, certified=True)
    x0 = of_agents.pop("x0", None) or shared.read_initial_state(options["x0"], options["seed"], signed)
    if of_agents:
        more = _with_agents(more, of_agents)
    refuse_unheard(signed, options)
    more |= {"messages": messages_of(graph, signed, options), "leaders": leaders_of(options)}
    origins = _origins(options)
    with progress(STEPS, screen.quiet) as begin:
        named = {"graph": Path(graph).name, **origins}
        certificate = run(signed, protocol, x0, origins=named, progress=begin, **more)
    _log_result(certificate)
    saved = output is not None and not rejects(certificate.checked)
    if output and saved:
        certificate.save(output)
        LOG.info("%s", one_line(f"written {output}"))
    assessment = certificate.assessment
    if as_json:
        print_json(certificate.to_dict())
        if assessment.exit_code and not screen.quiet:
            click.echo(f"verdict    {in_flags(assessment.sentence)}", err=True)
        return assessment.exit_code
    screen.show(lambda details: facts_of(certificate, graph, origins, details))
    if output:
        screen.note(shared.written(certificate, output) if saved else shared.NOTHING_WRITTEN)
    return assessment.exit_code


def _with_agents(more: dict[str, Any], of_agents: dict[str, Any]) -> dict[str, Any]:
    """Add agents of order n to what is asked: a cap of the gain is theirs, unless a formation has more limits."""
    agents, limits = of_agents["agents"], more.pop("limits", [])
    if any(limit.stop_before is not None or limit.sample_period is not None for limit in limits):
        return more | of_agents | {"agents": replace(agents, gain_cap=None), "limits": limits}
    unasked = () if agents.of_paper else ("disturbance",)
    return {name: value for name, value in more.items() if name not in unasked} | of_agents


def _requests(options: shared.Options) -> dict[str, Any]:
    """Return what is asked besides graph, protocol and initial state, as the library takes it."""
    from ptcc_certify.certificate.request import Expectations

    most = options["max_input"]
    if most is not None and most <= 0:
        raise ParameterError("--max-input is outside its domain; it must be > 0")
    more: dict[str, Any] = {name: options[name] for name in ("method", "simulation", "time_limit", "at")}
    more |= {"initial_set": options["initial_bound"]}
    more |= {
        "expectations": Expectations(options["expect"], options["min_rate"], most, options["max_residual"]),
        "scenario": scenario_record(),
    }
    if options["kind"] == "nominal":
        own = {"noise": options["noise"]}
        own |= {"delta": options["delta"]} if options["leader_speed"] is None else {}  # else it disturbs the followers
        return more | own | {"limits": [*filter(None, [shared.actuator_of(options)])]}
    return more


def _origins(options: shared.Options) -> dict[str, str]:
    """Return which of ``x(0)`` and ``sigma(0)`` were drawn, and with which seed."""
    states = {"x(0)": options["x0"], "sigma(0)": options["sigma0"], "v(0)": options["v0"], "a(0)": options["a0"]}
    drawn = {name: f"random, seed {options['seed']}" for name, text in states.items() if text == "random"}
    zero = {name: "0" for name in ("v(0)", "a(0)") if states[name] in (None, "0")}
    return drawn | (zero if options["agents"] is not None else {})


def _log_result(certificate: Certificate) -> None:
    """Log what was searched, what the time limit cut off, and what was decided."""
    search = certificate.search
    for kind, rate in search.searched.items():
        LOG.info("searched %s: numerical decay rate %.6g", kind, rate)
    for V in certificate.functions:
        LOG.info("proved %s: decay rate %s", V.kind, down(V.proved_rate))
    for part in certificate.cut_off:
        LOG.warning("cut off by the time limit of %g s: %s", certificate.time_limit, part)
    for note in certificate.notes:
        LOG.info("note: %s", one_line(note))
    LOG.info("verdict %s; exit code %d", in_flags(certificate.assessment.sentence), certificate.assessment.exit_code)
