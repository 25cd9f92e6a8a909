"""``ptcc certify``: make a certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lmi.exact.decimal_rounding import down
from ptcc_certify.cli import agents as of_agents
from ptcc_certify.cli import families
from ptcc_certify.cli import messages_and_leaders as asked
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import Command, one_of
from ptcc_certify.cli.scenario import scenario_record
from ptcc_certify.cli.terminal import LOG, Screen, in_flags, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import one_line
from ptcc_certify.model.asks import Asks, Case, Expectations, InitialState

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol
    from ptcc_certify.model.constrained_switching import SignalClass


@click.command(cls=Command)
@shared.graphs_argument
@shared.protocol_options
@shared.prejudice_option
@shared.output_option
@shared.json_option
@screen_options
@shared.reading_options
@families.family_options
@families.restricted_options
@shared.expect_option("Such as bipartite-consensus; exit code 3 if refuted.")
@one_of(Expectations, "min_rate")
@one_of(Expectations, "max_input")
@one_of(Asks, "at")
@shared.method_option
@shared.limit_options
@of_agents.agents_options
@asked.message_options
@asked.leader_options
@one_of(Expectations, "max_residual")
@of_agents.dimension_option
@shared.initial_bound_option
@one_of(Asks, "noise")
@one_of(Asks, "simulation")
@shared.time_limit_option
def certify(graph: tuple[str, ...], output: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Certify what the protocol does on GRAPH: behaviour, final state, error bound, input.

    Exit code 0: certified, and everything asked holds.

    For example: ptcc certify fig1b --T 2 --x0 5,2,-4,1,0,3 -o fig1b.json

    Of a family - several graphs with --switching, weights in intervals, --uncertainty, --optional - it certifies what
    holds for every signal.

    Prints 8 lines, 10 or so where the answers take more; -v tells rates, the Lyapunov functions searched and used,
    proof obligations and the simulated run.
    """
    from ptcc_certify.certificate import family_certification, graph_certification
    from ptcc_certify.certificate.assessment import CERTIFIED, rejects
    from ptcc_certify.certificate.certification import certify_case
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.report.facts.of_certificate import facts_of

    refuse_output(output)
    protocol, given = shared.protocol_of(options), families.read_graph_or_family(graph, options)
    family = given if isinstance(given, Family) else None
    if family is not None:
        of_agents.refuse_agents_of_family(options, "certify")
    of_agents.refuse_dimension(options, "certify")
    if family is None:
        families.refuse_restricted(options)
        signal: SignalClass = "any"
    else:
        signal = families.asked_signal(family, protocol, options)
    size = repr(given) if isinstance(given, Family) else f"{given.n_nodes} nodes, {given.n_edges} edges"
    LOG.info("%s", one_line(f"read {', '.join(graph)}: {size}"))
    alone = None if family is None else families.decided_alone(graph, family, output, as_json, screen, options)
    if alone is not None:
        return alone
    case = _case_of(graph, given, signal, protocol, options)
    name, origins = graph[0], _origins(options, family is None)
    if family is not None:
        name, read = families.names_of_family(graph, family, options)
        origins = {"read": read, **origins}
    steps = graph_certification.STEPS if family is None else family_certification.STEPS
    with progress(steps, screen.quiet) as begin:
        named = {"graph": Path(name).name, **origins}
        certificate: Any = certify_case(case, progress=begin, scenario=scenario_record(), origins=named)
        assessment = certificate.assessment
    _log_result(certificate)
    saved = not rejects(certificate.checked) if family is None else assessment.verdict == CERTIFIED
    if output and saved:
        certificate.save(output)
        LOG.info("%s", one_line(f"written {output}"))
    if as_json:
        print_json(certificate.to_dict() | ({} if family is None else {"verdict": assessment.verdict}))
        if assessment.exit_code and not screen.quiet:
            click.echo(f"verdict    {in_flags(assessment.sentence)}", err=True)
        return assessment.exit_code  # type: ignore[no-any-return]
    screen.show(lambda details: facts_of(certificate, name, origins, details))
    if output:
        screen.note(shared.written(certificate, output) if saved else shared.NOTHING_WRITTEN)
    return assessment.exit_code  # type: ignore[no-any-return]


def _case_of(
    graphs: tuple[str, ...],
    given: SignedDigraph | Family,
    signal: SignalClass,
    protocol: Protocol,
    options: shared.Options,
) -> Case:
    """Return what the options ask of a graph or a family.

    A cap of the gain is that of agents, unless a formation has more limits, and of a family that of late messages or
    of the followers of leaders. Under ``--leader-speed`` it is the followers that ``--delta`` disturbs.
    """
    from ptcc_certify.graphs.family import Family

    family = isinstance(given, Family)
    one, asks = given.modes[0].mandatory if isinstance(given, Family) else given, shared.asks_of(options)
    disturbance = None if family else shared.disturbance_of(protocol, options, one)
    sigma0 = shared.sigma0_of(protocol, options, one)
    agents, initial = of_agents.agents_and_states(options, one, certified=True)
    if initial is None:
        initial = InitialState(shared.initial_state_of(options, one))
    limits = shared.limits_of(options) if options["kind"] == "nominal" else ()
    if agents is not None and not family:
        more = any(limit.stop_before is not None or limit.sample_period is not None for limit in limits)
        agents, limits = (replace(agents, gain_cap=None), limits) if more else (agents, ())
        disturbance = disturbance if more or agents.of_paper else None
    if agents is not None and family and agents.of_paper:
        agents = replace(agents, gain_cap=None)  # which limits or messages have
    if not family:
        asked.refuse_unheard(one, options)
    messages, leaders = asked.messages_of(graphs, given, options), asked.leaders_of(options)
    if family and messages is not None:
        limits = ()  # a cap is theirs
    if isinstance(given, Family) and messages is not None and isinstance(messages.delay, Mapping):
        given = replace(given, notes=asked.noted_delays(given.notes, options["delay"]))
    if options["kind"] == "nominal":
        asks = replace(asks, noise=options["noise"], delta=options["delta"] if leaders is None else None)
    asks, initial = replace(asks, disturbance=disturbance), replace(initial, sigma0=sigma0)
    beside: dict[str, Any] = {"agents": agents, "messages": messages, "leaders": leaders, "limits": limits}
    return Case(given, protocol, initial, signal=signal, asks=asks, **beside)


def _origins(options: shared.Options, alone: bool) -> dict[str, str]:
    """Return which of ``x(0)`` and ``sigma(0)`` were drawn, and with which seed; of one graph ``alone`` also 0."""
    states = {"x(0)": options["x0"], "sigma(0)": options["sigma0"], "v(0)": options["v0"], "a(0)": options["a0"]}
    drawn = {name: f"random, seed {options['seed']}" for name, text in states.items() if text == "random"}
    moved = ("v(0)", "a(0)")[: of_agents.NAMES.get(options["agents"], 1) - 1 if alone else 0]
    return drawn | {name: "0" for name in moved if states[name] in (None, "0")}


def _log_result(certificate: Certificate) -> None:
    """Log what was searched, what the time limit cut off, and what was decided."""
    searched = {} if certificate.of_family else certificate.search.searched
    for kind, rate in searched.items():
        LOG.info("searched %s: numerical decay rate %.6g", kind, rate)
    for V in () if certificate.of_family else certificate.graph_proof.functions:
        LOG.info("proved %s: decay rate %s", V.kind, down(V.proved_rate))
    for part in certificate.observed.cut_off:
        LOG.warning("cut off by the time limit of %g s: %s", certificate.time_limit, part)
    for note in certificate.observed.notes:
        LOG.info("note: %s", one_line(note))
    LOG.info("verdict %s; exit code %d", in_flags(certificate.assessment.sentence), certificate.assessment.exit_code)
