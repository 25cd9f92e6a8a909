"""``ptcc plot``: one figure of a certificate, a graph or a scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.cli import agents as of_agents
from ptcc_certify.cli import families
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import Command
from ptcc_certify.cli.scenario import MEMORY, graph_of, refuse_beside
from ptcc_certify.cli.terminal import FIGURES, print_lines, progress, refuse_output
from ptcc_certify.errors import ExitCode, ParameterError
from ptcc_certify.graphs.recognised_files import kind_of
from ptcc_certify.model.asks import Asks, Case, InitialState

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol
    from ptcc_certify.simulation.trajectory import Trajectory

#: Options that a certificate takes; the others are for graphs.
_SIZES = ("purpose", "width", "state_unit")
_OF_CERTIFICATES = ("graph", "what", "output", "wide", "time_unit", *_SIZES, "memory", "x0", "seed")
#: Figures of a simulated run.
OF_A_RUN = ("states", "input", "decay")
#: Figures of agents of order n; and which they share with others.
OF_AGENTS = ("motion", "formation")
_SHARED = ("input",)


#: The figure of a certificate that is drawn unless another one is asked for.
GLANCE = "glance"
#: Figures of a certificate with late messages, or with moving leaders.
OF_A_CERTIFICATE = ("late", "tracking")


class _Figure(click.Choice):  # type: ignore[type-arg]  # no generic class before click 8.2
    """The name of a figure; of what another one shows it tells which."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        if value == "sliding":
            self.fail("the sliding variables are under states", param, ctx)
        return str(super().convert(value, param, ctx))


@click.command(cls=Command)
@click.argument(
    "graph",
    nargs=-1,
    required=True,
    metavar="CERT|GRAPH..",
    is_eager=True,
    callback=graph_of,
    type=click.Path(),
)
@click.option(
    "--what",
    type=_Figure([GLANCE, *OF_A_RUN, "graph", "spectrum", *OF_AGENTS, *OF_A_CERTIFICATE]),
    metavar="FIGURE",
    help="glance: of a certificate graph, runs and bounds at once; states, input, decay: of families too; graph, or "
    "the modes of a family; spectrum: eigenvalues of one graph. Agents of order n: motion, input, and in the plane "
    "formation. Certificates with late messages: late; with moving leaders: tracking.  [default: of a certificate "
    "glance, else graph]",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False),
    help="FILE.png, .pdf or .svg.  [default: NAME-WHAT.png]",
)
@click.option("--wide", is_flag=True, help="As wide as two columns of a journal (states).")
@click.option(
    "--for",
    "purpose",
    type=click.Choice(["ieee", "nature", "slide"], case_sensitive=False),
    default="ieee",
    help="Sizes of figure and text: columns of a journal of the IEEE, 3.5 or 7.16 inches, or of Nature, 89 or 183 mm; "
    "a slide of 16 to 9.",
)
@click.option(
    "--width", type=click.FloatRange(0.5, 100), metavar="INCHES", help="Of the figure, in place of that of a column."
)
@shared.time_unit_option
@click.option("--state-unit", metavar="UNIT", default="", show_default=False, help="Of states on axes, such as m.")
@shared.reading_options
@families.mode_options
@shared.protocol_options
@shared.prejudice_option
@shared.limit_options
@shared.random_within_option
@of_agents.agents_options
@of_agents.dimension_option
@shared.method_option
@shared.time_limit_option
@shared.memory_option
def plot(
    graph: tuple[str, ...], what: str | None, output: str | None, wide: bool, time_unit: str, **options: Any
) -> int:
    """Draw one figure of a certificate, a graph, a family of graphs or a scenario.

    A certificate is checked first, and its run is repeated.

    For example: ptcc plot fig1b.json --what states -o states.pdf

    The run of a certificate without an initial state, as `design` makes, begins at --x0. A graph is simulated, for its
    decay certified, with the options about protocol and initial state that `certify` has too: only a certificate shows
    the input's bound.

    Of a family - its certificate, or several graphs with --switching, weights in intervals, --uncertainty, --optional -
    runs under many signals are drawn within what is proved for every signal.
    """
    from ptcc_certify.certificate.certificate import RejectedCertificate

    certified = kind_of(graph[0]) in ("a certificate", "JSON")
    if certified and len(graph) > 1:
        raise ParameterError(f"{graph[0]}: is a certificate, which is drawn by itself; leave out {graph[1]}")
    if output is not None and PurePath(output).suffix.lower() not in FIGURES:
        raise ParameterError(f"{output}: figures are written to {', '.join(FIGURES)}; choose one of these")
    refuse_output(output)
    if what in (GLANCE, *OF_A_CERTIFICATE) and not certified:
        flag = {"late": "--delay ..", "tracking": "--leader-speed .."}.get(what or "", "--x0 ..")
        raise ParameterError(f"--what {what} is of a certificate; make one with ptcc certify GRAPH {flag} -o c.json")
    of_agents.refuse_dimension(options, "plot")
    try:
        if certified:
            what, subject = _of_certificate(graph[0], what, options)
        else:
            what = what or "graph"
            subject = _of_graphs(graph, what, options)
    except RejectedCertificate as error:
        print_lines(f"rejected: {error}", err=True)
        return ExitCode.VIOLATED
    if output is None:
        output = f"{PurePath(graph[0]).stem.lstrip('-') or 'graph'}-{what}.png"
        refuse_output(output)
    with progress(("figure",)) as begin:
        begin("figure")
        from ptcc_certify.report.plots.sizes import figures_for
        from ptcc_certify.report.plots.style import save_figure

        with figures_for(options["purpose"], width=options["width"], state_unit=options["state_unit"]):
            save_figure(_draw(what, subject, wide, time_unit), output)
    print_lines(f"written    {output}")
    return ExitCode.OK


def _of_certificate(path: str, what: str | None, options: shared.Options) -> tuple[str, Certificate]:
    """Read a certificate's file, and repeat its run if that is drawn; refuse options that are about a graph.

    Which figure comes first: ``what``, or the one that is drawn where none is named.
    """
    from ptcc_certify.certificate.certificate import read_certificate

    context = click.get_current_context()
    shared.refuse_beside_certificate(path, _OF_CERTIFICATES)
    begins = any(context.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in ("x0", "seed"))
    with progress(("independent check", "simulation")) as begin:
        begin("independent check")
        certificate = read_certificate(path, memory=options["memory"])
        agents = certificate.proof.agents
        of_agents = agents is not None
        if begins and (of_agents or certificate.initial_state is not None):
            mend = "certify agents of order n with it" if of_agents else f"the certificate {path} has its own"
            raise ParameterError(f"--x0, or --seed, is for what holds no initial state; {mend}")
        what = what or GLANCE
        of_these = OF_AGENTS if agents is None or agents.dimension == 2 else ("motion",)
        own = tuple({certificate.proof.main_figure} & set(OF_A_CERTIFICATE))  # of late messages, or of moving leaders
        drawn, others = ((*of_these, *_SHARED), OF_A_RUN) if of_agents else ((*own, *OF_A_RUN), OF_AGENTS)
        if what in others and what not in drawn:
            raise ParameterError(f"--what {what} is not drawn of {path}; ask for --what {' or '.join(drawn)}")
        begun = certificate.initial_state is not None and what == GLANCE  # which simulates what it draws
        if of_agents or begun or what not in (GLANCE, *OF_A_RUN):
            return what, certificate
        if begins:
            one = (
                certificate.family_proof.family.modes[0].mandatory
                if certificate.of_family
                else certificate.graph_proof.graph
            )
            x0 = shared.initial_state_of(options, one)
            if certificate.proof.offsets is not None:
                x0 = [x - h for x, h in zip(x0, certificate.proof.offsets, strict=True)]
            question = replace(certificate.question, initial_state=tuple(x0))
            proof = replace(certificate.proof, question=question)  # to be drawn: what is proved holds for all
            certificate = replace(certificate, proof=proof)
        elif what == GLANCE:
            return what, certificate
        elif certificate.initial_state is None:
            raise ParameterError(f"{path}: the certificate holds no initial state; give one with --x0")
        begin("simulation")
        return what, certificate if certificate.of_family else certificate.with_simulation()


def _of_graphs(graphs: tuple[str, ...], what: str, options: shared.Options) -> Any:
    """Return what the figure of a graph, or of a family, is drawn from."""
    from ptcc_certify.graphs.family import Family

    given = families.read_graph_or_family(graphs, options)
    return _of_family(given, what, options) if isinstance(given, Family) else _of_graph(given, what, options)


def _of_family(family: Family, what: str, options: shared.Options) -> Family | Certificate:
    """Return what the figure of a family is drawn from: itself, or its certificate."""
    from ptcc_certify.certificate.certification import certify_case
    from ptcc_certify.certificate.family_certification import STEPS
    from ptcc_certify.model.agents import Agents

    families.refuse_options(options)
    of_agents.refuse_agents_of_family(options, "draw")
    if what in OF_AGENTS:
        raise ParameterError(f"--what {what}: is of agents of order n; ask for another figure, or draw one graph")
    given = click.get_current_context().get_parameter_source("disturbance") is ParameterSource.COMMANDLINE
    if given and options["disturbance"] is not None:
        raise ParameterError("--disturbance: runs of a family are drawn under the worst one; leave it out")
    if what not in OF_A_RUN:
        return family
    protocol = shared.protocol_of(options)
    one = family.modes[0].mandatory
    x0 = shared.initial_state_of(options, one)
    if x0 is None:
        raise ParameterError(f"{what} is drawn from an initial state; give one with --x0")
    initial = InitialState(x0, shared.sigma0_of(protocol, options, one))
    places, asks = of_agents.places_of(options, one, protocol), Asks(time_limit=options["time_limit"])
    agents = None if places is None else Agents(1, offsets=places)
    with progress(STEPS) as begin:
        return certify_case(Case(family, protocol, initial, agents=agents, asks=asks), progress=begin)


def _of_graph(
    signed: SignedDigraph, what: str, options: shared.Options
) -> Certificate | Trajectory | tuple[SignedDigraph, Any]:
    """Return what the figure of a graph is drawn from: itself, a run, or for its decay a certificate."""
    from ptcc_certify.certificate.certification import certify_case
    from ptcc_certify.certificate.graph_certification import STEPS
    from ptcc_certify.model.agents import Agents

    protocol = shared.protocol_of(options, () if what == "decay" else ("delta", "disturbance"))
    if what in ("graph", "spectrum"):
        return signed, protocol
    refuse_beside(click.get_current_context().meta.get(MEMORY), f"plot --what {what}")
    places = None if what == "formation" else of_agents.places_of(options, signed, protocol)
    if places is None and (what in OF_AGENTS or of_agents.agents_of(options) is not None):
        return _of_agents(signed, protocol, what, options)
    x0 = shared.initial_state_of(options, signed, within=options["initial_bound"])
    if what == "decay":
        if shared.actuator_of(options) is not None:
            raise ParameterError("decay is drawn without limits of the gain; leave them out, or ask for --what states")
        initial = InitialState(x0, sigma0=shared.sigma0_of(protocol, options, signed))
        asks = Asks(
            method=options["method"],
            time_limit=options["time_limit"],
            simulation=True,
            disturbance=shared.disturbance_of(protocol, options, signed),
        )
        agents = None if places is None else Agents(1, offsets=places)
        with progress(STEPS) as begin:
            return certify_case(Case(signed, protocol, initial, agents=agents, asks=asks), progress=begin)  # type: ignore[return-value]
    with progress(("simulation",)) as begin:
        begin("simulation")
        return of_agents.run_in_places(signed, protocol, x0, places, **shared.run_keywords(protocol, options, signed))


def _of_agents(signed: SignedDigraph, protocol: Protocol, what: str, options: shared.Options) -> Certificate:
    """Return what the figure of agents of order n is drawn from: a certificate of theirs."""
    from ptcc_certify.certificate.certification import certify_case
    from ptcc_certify.certificate.graph_certification import STEPS

    agents, initial = of_agents.agents_and_states(options, signed)
    if initial is None:
        raise ParameterError(f"--what {what}: is of agents of order n; add --agents double-integrator, say")
    drawn = (*OF_AGENTS, *_SHARED)
    if what not in drawn:
        raise ParameterError(f"--what {what}: is not drawn of agents of order n; ask for --what {' or '.join(drawn)}")
    if what == "formation" and options["dimension"] != 2:
        raise ParameterError("--what formation: is drawn in the plane; add --dimension 2")
    asks = Asks(method=options["method"], time_limit=options["time_limit"], simulation=False)
    initial = replace(initial, sigma0=shared.sigma0_of(protocol, options, signed))
    with progress(STEPS) as begin:
        return certify_case(Case(signed, protocol, initial, agents=agents, asks=asks), progress=begin)  # type: ignore[return-value]


def _draw(what: str, subject: Any, wide: bool, time_unit: str) -> Any:
    """Draw a figure of a certificate, a run, a family, or a graph with its protocol."""
    from ptcc_certify.report.page_figures import plot as plot_of
    from ptcc_certify.report.plots.subject import is_of_family
    from ptcc_certify.report.plots.trajectory import plot_run
    from ptcc_certify.simulation.trajectory import Trajectory

    if is_of_family(subject):
        if wide:
            mend = "figures of families are one column wide: leave it out"
            raise ParameterError(f"--wide is for the states of one graph; {mend}")
    elif what == "states" or (what == "motion" and isinstance(subject, Trajectory)):
        return plot_run(subject, wide=wide, time_unit=time_unit)
    more: dict[str, Any] = {} if what in ("graph", "spectrum", "formation") else {"time_unit": time_unit}
    if isinstance(subject, tuple):
        subject, protocol = subject
        more |= {"protocol": protocol} if what == "spectrum" else {}
    return plot_of(subject, what, **more, **({"wide": wide} if what == "motion" else {}))
