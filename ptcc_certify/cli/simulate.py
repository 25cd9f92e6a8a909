"""``ptcc simulate``: the closed loop as CSV or figure."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.cli import agents as of_agents
from ptcc_certify.cli import families
from ptcc_certify.cli import messages_and_leaders as asked
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import DIMENSION, SIGNAL, Command, click_option, flag_of, one_of
from ptcc_certify.cli.scenario import BESIDE
from ptcc_certify.cli.terminal import FIGURES, print_lines, progress, refuse_output
from ptcc_certify.errors import ExitCode, ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.recognised_files import kind_of
from ptcc_certify.lazy_report import rendered
from ptcc_certify.model.asks import Asks, Case, GainLimits, InitialState, Run
from ptcc_certify.model.late_messages import MovingLeaders
from ptcc_certify.model.refusals import refuse_in_places

if TYPE_CHECKING:
    from fractions import Fraction

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol
    from ptcc_certify.simulation.agents import AgentsTrajectory
    from ptcc_certify.simulation.trajectory import Trajectory

_TABLES = ("", ".csv", ".txt")


@click.command(cls=Command)
@shared.graphs_argument
@shared.reading_options
@shared.protocol_options
@shared.prejudice_option
@shared.limit_options
@shared.random_within_option
@families.mode_options
@families.dwell_options
@click_option(
    SIGNAL,
    flag="--signal SIGNAL",
    kind="text",
    default="random",
    help="Family: random (with --seed), worst-case, constant, or FILE.csv with columns t (or clock), mode, level.",
)
@of_agents.agents_options
@shared.method_option
@asked.message_options
@one_of(Run, "pattern")
@asked.leader_options
@click_option(DIMENSION, default=1, help="State components per agent.")
@one_of(Run, "samples")
@one_of(Run, "steps")
@one_of(Run, "boundary_layer")
@one_of(Asks, "noise", help="Nominal: telegraph noise of size NU on every measurement.")
@click.option("--wide", is_flag=True, help="A figure as wide as two columns of a journal, instead of one.")
@shared.time_unit_option
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="FILE.csv, or a figure: .png, .pdf, .svg")
def simulate(graph: tuple[str, ...], wide: bool, time_unit: str, output: str | None, **options: Any) -> int:
    """Integrate the closed loop with CVODES up to the deadline and past it; print CSV or draw a figure.

    For example: ptcc simulate fig1b --T 2 --x0 5,2,-4,1,0,3 -o run.png

    In place of a graph stands a certificate of one, which is checked, and run from its initial state.

    The columns are t, remaining (1 - t/T, accurate near the deadline), the state of every agent headed by its label,
    under the sliding-mode protocol sigma(<label>), and the input u(<label>). Near the deadline the infinite gain
    multiplies what the integrator leaves of the error: there u is rounding, which `ptcc plot --what input` leaves out.

    rho2 = 0 runs the nominal protocol without a deadline (asymptotic baseline). With --dimension d, --x0 takes N*d
    numbers, agent after agent, and columns are headed <label>[1] to <label>[d].

    Of a formation on a line (--offsets) states are positions, with whatever limits and messages other runs take.

    Agents of order n run with the gains that `certify` proves under the same --method, up to the deadline; beside
    their positions there are columns v(<label>), a(<label>).

    With late messages (--delay, --period, --packet-loss, --quantisation, --own-delay) one run in which they are as late
    as --pattern tells; with --leader-speed one in which leaders move away from the farthest follower as fast as they
    may, with columns target(<label>). Both have instants of their own, as have vehicles that exchange virtual positions
    (--agents double-integrator --exchange virtual) with either.

    Of a family - several graphs with --switching, weights in intervals, --uncertainty, --optional - one run under one
    signal, with a column mode: the number of the graph that acts.
    """
    from ptcc_certify.graphs.family import Family

    suffix, vectors = Path(output or "").suffix.lower(), options["dimension"] > 1
    source = click.get_current_context().get_parameter_source
    if options["steps"] is not None and source("samples") is ParameterSource.COMMANDLINE:
        raise ParameterError("--samples: --steps tells the instants; leave one of them out")
    if source("age_pattern") is ParameterSource.COMMANDLINE and not asked.asks_for_messages(options):
        raise ParameterError("--pattern says how late messages are; add --delay, --period or --quantisation")
    if suffix not in (*FIGURES, *_TABLES):
        raise ParameterError(f"{output}: CSV is written to .csv, figures to {', '.join(FIGURES)}; choose one of these")
    refuse_output(output)
    if kind_of(graph[0]) == "a certificate":
        return _of_certificate(graph, output, options["samples"], {"wide": wide, "time_unit": time_unit})
    protocol = shared.protocol_of(options, ("delta", "disturbance"))
    signed = families.read_graph_or_family(graph, options)
    if isinstance(signed, Family):
        of_agents.refuse_agents_of_family(options, "simulate")
    special = of_agents.agents_of(options) is not None
    if suffix in FIGURES and vectors and not special:
        raise ParameterError("a figure shows one component per agent; leave out --dimension or write CSV")
    if vectors and options["kind"] != "nominal" and not special:
        raise ParameterError("the sliding-mode protocol is simulated for scalar agents; leave out --dimension")
    one = signed.modes[0].mandatory if isinstance(signed, Family) else signed
    places = of_agents.places_of(options, one, protocol)
    special = special and places is None
    if isinstance(signed, Family):
        _refuse_messages(options, "families of graphs")
    elif special:
        with progress(("simulation",)) as begin:
            begin("simulation")
            motion = _run_agents(graph[0], signed, protocol, options)
        _write(motion, output, "trajectory.plot_motion", {"wide": wide, "time_unit": time_unit})
        if protocol.reaching is not None:
            click.echo("note: u is without the sliding terms, which cancel the disturbance", err=True)
        return ExitCode.OK
    if source("method") is ParameterSource.COMMANDLINE:
        raise ParameterError("--method: chooses the gains of agents of order n; leave it out, or add --agents")
    with progress(("simulation",)) as begin:
        begin("simulation")
        beside = None if isinstance(signed, Family) else _run_beside(graph[0], signed, protocol, options, places)
        trajectory = beside or _run(signed, protocol, options, places)
    _write(trajectory, output, "trajectory.plot_run", {"wide": wide, "time_unit": time_unit})
    if beside is not None:
        return ExitCode.OK
    if protocol.prescribed and trajectory.conditions.actuator is None and not trajectory.deadline_resolved:
        click.echo("note: the run had not settled at the deadline; raise rho2 * kappa", err=True)
    return ExitCode.OK


def _of_certificate(graph: tuple[str, ...], output: str | None, samples: int, look: dict[str, Any]) -> int:
    """Write the run of what a certificate is about, which is checked first, at as many instants as that of a graph."""
    from ptcc_certify.certificate.certificate import RejectedCertificate, read_certificate

    shared.refuse_beside_certificate(graph[0], ("graph", "output", *look))
    if len(graph) > 1:
        raise ParameterError(f"{graph[0]}: is a certificate, which is run by itself; leave out {graph[1]}")
    try:
        with progress(("independent check", "simulation")) as begin:
            begin("independent check")
            certificate = read_certificate(graph[0])
            if certificate.of_family:
                mend = "simulate its graphs: ptcc simulate GRAPH.. --switching"
                raise ParameterError(f"{graph[0]}: is of a family, which has a run for every signal; {mend}")
            begin("simulation")
            part = certificate.proof.agents
            if part is None and (certificate.initial_state is None or certificate.only_drawn):
                mend = "simulate its graph, with --x0"
                raise ParameterError(f"{graph[0]}: is of no single initial state; {mend}")
            own = certificate.asked_trajectory if part is None else part.simulate(samples=samples)
            run = own or certificate.simulate(samples=samples)
    except RejectedCertificate as error:
        print_lines(f"rejected: {error}", err=True)
        return ExitCode.VIOLATED
    _write(run, output, "trajectory.plot_run" if part is None else "trajectory.plot_motion", look)
    if own is None and (certificate.proof.late is not None or certificate.limits):
        click.echo("note: the run is of the protocol alone: without limits, nothing late, leaders at rest", err=True)
    return ExitCode.OK


def _write(run: Any, output: str | None, drawn_by: str, look: dict[str, Any]) -> None:
    """Write a run as a figure or CSV, to a file or to standard output."""
    from ptcc_certify.graphs.io import write_atomically

    if output and Path(output).suffix.lower() in FIGURES:
        from ptcc_certify.report.plots.style import save_figure

        save_figure(rendered(f"plots.{drawn_by}", run, **look), output)
    elif output:
        write_atomically(output, run.to_csv())
    else:
        click.echo(run.to_csv(), nl=False, color=True)  # labels stay as they are, escape codes included
        if sys.stdout.isatty():
            click.echo("note: -o FILE.csv keeps the table, -o FILE.png draws the states", err=True)
    if output:
        print_lines(f"written    {output}")


def _run_agents(graph: str, signed: SignedDigraph, protocol: Protocol, options: shared.Options) -> AgentsTrajectory:
    """Return the run of agents of order n."""
    source, asks = click.get_current_context().get_parameter_source, Asks(method=options["method"], simulation=False)
    beside: dict[str, Any] = {}
    if of_agents.exchanges_virtual(options):  # what is asked of these is judged in one place
        messages, leaders = asked.messages_of((graph,), signed, options), asked.leaders_of(options)
        limits = [limit for limit in shared.limits_of(options) if limit.stop_before or limit.sample_period]
        beside = {"messages": messages, "leaders": leaders, "limits": limits}
        asks = replace(asks, noise=options["noise"], delta=options["delta"] if leaders is None else None)
        given = [name for name in ("samples", "steps") if source(name) == ParameterSource.COMMANDLINE]
        if (messages or leaders) and given:
            raise ParameterError(f"{flag_of(given[0])}: these runs have instants of their own; leave it out")
    else:
        _refuse_messages(options, "agents of order n")
    if options["boundary_layer"] is not None:
        mend = f"leave it out, or leave out {of_agents.agents_flags(options)}"
        raise ParameterError(f"--boundary-layer: is for single integrators; {mend}")
    if options["kind"] == "nominal" and options["disturbance"] is not None:
        raise ParameterError("--disturbance: agents of order n run without, or under --protocol sliding-mode")
    if source("signal") == ParameterSource.COMMANDLINE:
        raise ParameterError("--signal: is for families of graphs; this is one graph: leave it out")
    families.refuse_restricted(options)
    agents, initial = of_agents.agents_and_states(options, signed, certified=of_agents.exchanges_virtual(options))
    begin = replace(initial or InitialState(), sigma0=shared.sigma0_of(protocol, options, signed))
    case = Case(signed, protocol, begin, agents=agents, asks=asks, **beside)
    pattern = options["age_pattern"], options["seed"]
    return of_agents.run_of_agents(case, options["samples"], options["steps"], pattern=pattern)


def _refuse_messages(options: shared.Options, what: str) -> None:
    """Refuse late messages and moving leaders where they are not simulated."""
    for name in BESIDE:
        if options[name] not in (None, False):
            raise ParameterError(f"{flag_of(name)}: is not simulated of {what}; leave it out")


def _run_beside(
    graph: str, signed: SignedDigraph, protocol: Protocol, options: shared.Options, places: Sequence[Fraction] | None
) -> Trajectory | None:
    """Return the run with late messages or leaders that move; None if nothing is asked of them."""
    messages, leaders = asked.messages_of((graph,), signed, options), asked.leaders_of(options)
    if messages is None and leaders is None:
        return None
    if leaders is None and protocol.reaching is None and options["delta"]:
        leaders = MovingLeaders(speed=0, disturbance=options["delta"])
    source = click.get_current_context().get_parameter_source
    name = "late messages" if messages else "leaders that move" if leaders is None else leaders.asked
    refused = ["steps", "boundary_layer", "stop_before", "sample_period"]
    if protocol.reaching is None:
        refused += ["delta", "disturbance"] if leaders is None else ["disturbance"]
    given = [option for option in refused if options[option] is not None]
    given += [option for option in ("samples", "signal") if source(option) == ParameterSource.COMMANDLINE]
    if options["dimension"] > 1:
        given.append("dimension")
    if given:
        raise ParameterError(f"{flag_of(given[0])}: is not simulated with {name}; leave it out")
    if places is not None:
        refuse_in_places(leaders)
    families.refuse_restricted(options)
    if options["noise"] is not None:  # what is heard is off by it
        asks, limits = Asks(noise=options["noise"]), shared.limits_of(options)
        case = Case(signed, protocol, messages=messages, leaders=leaders, limits=limits, asks=asks).with_rows()
        messages, leaders = case.messages, case.leaders
        if messages is None:
            raise ParameterError("--noise: is not simulated with leaders at rest; leave --leader-speed out")
    sigma0 = shared.sigma0_of(protocol, options, signed)
    x0 = shared.initial_state_of(options, signed)
    more: Any = {"messages": messages, "leaders": leaders}
    if messages is not None:
        more["signal"] = (options["age_pattern"], options["seed"])
    elif options["gain_cap"] is not None:
        more["actuator"] = GainLimits(gain_cap=options["gain_cap"])
    return of_agents.run_in_places(signed, protocol, x0, places, sigma0=sigma0, **more)


def _run(
    signed: SignedDigraph | Family, protocol: Protocol, options: shared.Options, places: Sequence[Fraction] | None
) -> Trajectory:
    """Return the run of a graph, or of a family under a signal."""
    from ptcc_certify.graphs.family import Family

    steps = options["steps"]
    times = None if steps is None else [protocol.T * k / steps for k in range(steps + 1)]
    if isinstance(signed, Family):
        return _run_family(signed, protocol, times, options, places)
    if click.get_current_context().get_parameter_source("signal") == ParameterSource.COMMANDLINE:
        raise ParameterError("--signal is for families (--switching, --uncertainty, intervals); this is one graph")
    families.refuse_restricted(options)
    more = shared.run_keywords(protocol, options, signed) | {n: options[n] for n in ("samples", "boundary_layer")}
    if options["noise"] is not None:
        from ptcc_certify.simulation.nominal import Bounded

        more["noise"] = Bounded("telegraph", options["noise"])
    if options["dimension"] == 1:
        x0: Any = shared.initial_state_of(options, signed, within=options["initial_bound"])
    else:
        x0 = of_agents.read_vectors(options["x0"], options["seed"], signed, options["dimension"], "--x0")
        x0 = shared.with_prejudices(x0, options, signed)
    return of_agents.run_in_places(signed, protocol, x0, places, times=times, **more)


def _run_family(
    family: Family,
    protocol: Protocol,
    times: list[Fraction] | None,
    options: shared.Options,
    places: Sequence[Fraction] | None,
) -> Trajectory:
    """Return the run of a family under a signal."""
    from ptcc_certify.simulation.switching_signals import RandomDwellSignal, as_signal

    families.refuse_options(options)
    if options["dimension"] > 1 or options["boundary_layer"] is not None:
        flag = "--dimension" if options["dimension"] > 1 else "--boundary-layer"
        raise ParameterError(f"{flag} is for one graph, not for families yet; leave it out")
    signal = "random" if options["signal"] == "any" else options["signal"]  # of a scenario for ptcc certify
    x0 = shared.initial_state_of(options, family.modes[0].mandatory)
    promise = families.dwell_of(options)
    if promise is not None and signal != "random":
        flag = "--dwell" if options["dwell"] is not None else "--clock-dwell"
        raise ParameterError(f"{flag} is of random signals; leave it out, or leave out --signal {shorten(signal)}")
    played = as_signal(signal, options["seed"]) if promise is None else RandomDwellSignal(promise, options["seed"])
    one = family.modes[0].mandatory
    more = {"sigma0": shared.sigma0_of(protocol, options, one), "samples": options["samples"], "times": times}
    more |= {"signal": played, "disturbance": shared.disturbance_of(protocol, options, one)}
    return of_agents.run_in_places(family, protocol, x0, places, **more)
