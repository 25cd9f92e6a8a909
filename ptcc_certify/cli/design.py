"""``ptcc design``: gains from limits, of agents of order n the shortest deadline."""

from __future__ import annotations

import shlex
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.agents import agents_and_states, agents_of, agents_options, dimension_option
from ptcc_certify.cli.click_options import SHORTEST, click_option, flag_of, one_of, together
from ptcc_certify.cli.scenario import places_of, scenario_record
from ptcc_certify.cli.terminal import FIGURES, LOG, Screen, print_json, progress, refuse_output, screen_options
from ptcc_certify.errors import ExitCode, ParameterError, one_line
from ptcc_certify.gain_design.request import DesignRequest
from ptcc_certify.graphs.rationals import short_exact
from ptcc_certify.model import SlidingModeProtocol
from ptcc_certify.model.asks import Asks, Expectations, GainLimits, InitialState, Run
from ptcc_certify.report.text_layout import wrap_command

if TYPE_CHECKING:
    from ptcc_certify.gain_design.answer import AgentsDesign, Design
    from ptcc_certify.graphs.digraph import SignedDigraph

#: What a scenario may ask that no gains are searched under, and what of these agents of order n take.
_NOT_SEARCHED, _OF_AGENTS = ("gain_cap", "stop_before", "sample_period", "delta", "noise"), ("gain_cap", "delta")
#: Sliding terms, which are kept.
_SLIDING = ("mu1", "mu2", "mu3", "delta")
#: shared.Options of this command that need ``--agents``, and those that say what the agents are and where they begin.
_OWN = ("kind", *_SLIDING, "x0", "prejudice", "seed", "gain_cap", "dimension")
_OF_STATES = ("plant", "drag", "rest", "cascade", "x0", "v0", "a0", "offsets", "biases", "dimension", "prejudice")
#: What is searched: the gains that a deadline ``T = 1`` would have, whose deadline is then sought.
_TEMPLATE = {"T": None, "T_r": None, "T_s": None, "rho1": "0.001", "rho2": "1", "kappa": "1"}

_EXAMPLE = "ptcc design fig5b --max-input 10 --initial-bound 1 --shortest-deadline"
_EXAMPLE_OF_AGENTS = "ptcc design fig1a --agents double-integrator --max-input 30 --shortest-deadline"

template_options = together(
    shared.kind_option("Agents: nominal, or sliding mode, which disturbances within --delta do not move."),
    one_of(InitialState, "x0", default="random", help="Agents: initial positions, as of ptcc certify."),
    shared.prejudice_option,
    one_of(Run, "seed", help="Agents: seed of random initial states."),
    *(
        one_of(SlidingModeProtocol, name, shown=default, help=f"Agents, sliding mode: {text}")
        for name, default, text in (
            ("delta", "1", "bound of every disturbance."),
            ("mu1", "2", "switching gain, above delta."),
            ("mu2", "1", "constant part of the reaching gain."),
            ("mu3", "1", "factor of its growing part."),
        )
    ),
    one_of(GainLimits, "gain_cap", help="Agents: the gain is at most G; with --residual."),
)


@click.command(cls=shared.OneGraph)
@shared.graph_argument
@one_of(Expectations, "max_input", help="Needed. Every |u_k| is to be at most U, from all initial states.")
@one_of(Asks, "initial_set", help="Needed without --agents. All |x_k(0)| <= R.")
@one_of(DesignRequest, "deadline")
@click_option(SHORTEST)
@one_of(DesignRequest, "residual")
@one_of(DesignRequest, "input_norm")
@shared.output_option
@shared.json_option
@click.option("--curve", type=click.Path(dir_okay=False), help="Deadline against peak input: FILE.csv, or a figure.")
@agents_options
@template_options
@dimension_option
@screen_options
@shared.reading_options
def design(graph: str, curve: str | None, output: str | None, as_json: bool, screen: Screen, **options: Any) -> int:
    """Find gains of the nominal protocol whose input is proved to stay within a limit.

    The numbers printed are exact, and the last lines are the command that proves them again with exit code 0.

    For example: ptcc design fig5b --max-input 10 --initial-bound 1 --deadline 9

    A saturation, a sample period, disturbances and noise are not searched under: give them to that command.

    Of agents of order n, from one initial state, the shortest deadline is searched, also under the sliding-mode
    protocol, and under a gain cap that is given.

    Exit code 0: met, with a certificate. 3: no gains of this protocol can, proved. 4: not with this certificate.
    """
    special = agents_of(options) is not None
    if not special:
        _refuse_of_agents()
    _refuse_incomplete(options, special)
    for path in (output, curve):
        refuse_output(path)
    signed = shared.read(graph, options)
    if special and curve is not None:
        raise ParameterError("--curve: is drawn of single integrators; leave it out")
    if curve is not None and Path(curve).suffix.lower() not in (*FIGURES, ".csv"):
        raise ParameterError(f"{curve}: the curve is written to .csv, {', '.join(FIGURES)}; choose one of these")
    step = "search of a deadline" if special else "search of gains"
    with progress((step,), screen.quiet) as begin:
        begin(step)
        answer: Any = _of_agents(signed, options) if special else _of_single_integrators(signed, options)
    command = _command_of_agents(answer, options) if special else answer.certify_options
    if curve is not None:
        _save_curve(answer, curve)
    LOG.info("%s", one_line(f"{answer.verdict}: {answer.binding}"))
    _save(answer, output)
    words = None if command is None else _certify_command(command, graph, options)
    ignored = places_of(name for name in _NOT_SEARCHED if not (special and name in _OF_AGENTS))
    return _show(answer, signed, graph, output, as_json, screen, words, ignored)


def _of_single_integrators(signed: SignedDigraph, options: shared.Options) -> Design:
    """Return gains of single integrators."""
    from ptcc_certify.gain_design.search import design as run

    request: Any = {name: options[name] for name in ("max_input", "initial_bound", "deadline", "residual")}
    return run(signed, input_norm=2 if options["input_norm"] else None, **request)


def _save(answer: Design | AgentsDesign, output: str | None) -> None:
    """Write the certificate, if there is one and a file for it."""
    if output and answer.certificate is not None:
        scenario = scenario_record()
        recorded = answer.certificate.changed(scenario=scenario) if scenario else answer.certificate
        recorded.save(output)


def _show(
    answer: Design | AgentsDesign,
    signed: SignedDigraph,
    graph: str,
    output: str | None,
    as_json: bool,
    screen: Screen,
    command: list[str] | None,
    ignored: list[str],
) -> int:
    """Print the answer, and the command that proves it again; return the exit code."""
    from ptcc_certify.gain_design.answer import INFEASIBLE, MET
    from ptcc_certify.report.facts.graph import design_facts

    if as_json:
        print_json(answer.to_dict() | {"command": None if command is None else " ".join(command)})
    else:
        screen.show(lambda details: design_facts(answer, signed, graph))
        if output and answer.certificate is not None:
            screen.note(f"written    {output}")
        if ignored:
            screen.note(f"note       not designed for: {', '.join(ignored)}; ask ptcc certify about them")
        if command is not None:
            again = " (give it the graph again, on standard input)" if graph == "-" else ""
            if answer.gain_cap is not None:
                again += "; of the deviation see its line error"
            screen.note("\n".join([f"to prove it again{again}:", *wrap_command(command)]))
        elif answer.protocol is not None:
            where = f"the proof is in {output}" if output else "add -o design.json to keep the proof"
            screen.note(f"note       {where}; certify alone proves less")
    return {MET: ExitCode.OK, INFEASIBLE: ExitCode.REFUTED}.get(answer.verdict, ExitCode.UNDECIDED)


def _refuse_incomplete(options: dict[str, Any], special: bool) -> None:
    """Name everything that is missing, at once; of the two questions about the deadline the flag's counts."""
    names = {"max_input": "--max-input U"} | ({} if special else {"initial_bound": "--initial-bound R"})
    missing = [flag for name, flag in names.items() if options[name] is None]
    if options["deadline"] is None and not options["shortest_deadline"]:
        missing = [*filter(None, [", ".join(missing)]), "one of --deadline T, --shortest-deadline"]
    if missing:
        raise ParameterError(
            f"design needs {' and '.join(missing)}; e.g. {_EXAMPLE if not special else _EXAMPLE_OF_AGENTS}"
        )
    if options["deadline"] is None or not options["shortest_deadline"]:
        return
    source = click.get_current_context().get_parameter_source
    if source("deadline") is source("shortest_deadline"):
        raise ParameterError("--deadline and --shortest-deadline ask for two things; leave one out")
    if source("shortest_deadline") is ParameterSource.COMMANDLINE:  # which displaces that of the scenario
        options["deadline"] = None


def _certify_command(certify_options: list[str], graph: str, options: shared.Options) -> list[str]:
    """Return the words of the command that certifies the gains of a design again, quoted for a shell."""
    flags = shared.reading_words(options) + certify_options
    words = [*flags, "--", graph] if graph.startswith("-") and graph != "-" else [graph, *flags]
    return [shlex.quote(word) for word in ("ptcc", "certify", *words)]


def _refuse_of_agents() -> None:
    """Refuse flags of agents of order n where there are none; a scenario may have such keys for other commands."""
    context = click.get_current_context()
    for name in _OWN:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            flag = flag_of(name)
            says = "is not searched for single integrators; give it to ptcc certify, or add --agents double-integrator"
            if name == "x0":
                says = "single integrators are designed for all states within a bound; give --initial-bound R instead"
            raise ParameterError(f"{flag}: {says}")


def _of_agents(signed: SignedDigraph, options: shared.Options) -> AgentsDesign:
    """Return the deadline of the agents that the options tell."""
    from ptcc_certify.gain_design.deadline_search import design_agents

    if options["input_norm"]:
        raise ParameterError("--input-norm: is of single integrators; of agents in space U bounds ||u_k|| as it is")
    request: Any = {name: options[name] for name in ("max_input", "deadline", "residual")}
    protocol = shared.protocol_of({**options, **_TEMPLATE})
    agents, initial = agents_and_states(options, signed)
    assert agents is not None
    return design_agents(signed, agents, initial, protocol=protocol, **request)


def _command_of_agents(answer: AgentsDesign, options: shared.Options) -> list[str] | None:
    """Return options of ``ptcc certify`` that prove a design again; None if none do."""
    protocol = answer.protocol
    if protocol is None or not answer.repeatable:
        return None
    given: dict[str, Any] = {"agents": options["agents"] or "integrator"}
    given |= {name: options[name] for name in _OF_STATES if options[name] is not None}
    if "random" in given.values():
        given["seed"] = options["seed"]
    if options["decay"] is not None or answer.agents.degree == 1:
        given["decay"] = short_exact(answer.agents.decay_rate)
    if answer.gain_cap is not None:
        given["gain_cap"] = short_exact(answer.gain_cap)
    if protocol.reaching is not None:
        given["protocol"] = protocol.kind
    given |= {name: short_exact(value) for name, value in protocol.parameters.items()}
    given["max_input"] = short_exact(answer.asked.max_input)
    words = {name: short_exact(value) if isinstance(value, Fraction) else str(value) for name, value in given.items()}
    return [text for name, value in words.items() for text in (flag_of(name), value)]


def _save_curve(answer: Design, path: str) -> None:
    """Write peak input against deadline: CSV, or a figure."""
    from ptcc_certify.graphs.io import write_atomically

    if Path(path).suffix.lower() == ".csv":
        curve = answer.trade_off(answer.deadlines())
        rows = zip(*(values.tolist() for values in curve), strict=True)
        lines = ["deadline,certified_peak,least_possible_peak", *(",".join(map(repr, row)) for row in rows)]
        write_atomically(path, "\n".join(lines) + "\n")
    else:
        from ptcc_certify.report.plots.style import save_figure
        from ptcc_certify.report.plots.trade_off import plot_trade_off

        save_figure(plot_trade_off(answer), path)
