"""``ptcc design --agents``: the shortest deadline of agents of order n within a limit of their input."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ptcc_certify.cli.agents import agents_and_states
from ptcc_certify.cli.click_options import flag_of, one_of, together
from ptcc_certify.cli.options import Options, kind_option, protocol_of
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import short_exact
from ptcc_certify.model import SlidingModeProtocol
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.initial_state import InitialState
from ptcc_certify.model.run import Run

if TYPE_CHECKING:
    from ptcc_certify.gain_design.answer import AgentsDesign
    from ptcc_certify.graphs.digraph import SignedDigraph

#: Sliding terms, which are kept.
_SLIDING = ("mu1", "mu2", "mu3", "delta")
#: Options of this command that need ``--agents``, and those that say what the agents are and where they begin.
_OWN = ("kind", *_SLIDING, "x0", "seed", "gain_cap", "dimension")
_OF_STATES = ("plant", "drag", "rest", "cascade", "x0", "v0", "a0", "offsets", "biases", "dimension")
#: What is searched: the gains that a deadline ``T = 1`` would have, whose deadline is then sought.
_TEMPLATE = {"T": None, "T_r": None, "T_s": None, "rho1": "0.001", "rho2": "1", "kappa": "1"}

template_options = together(
    kind_option("Agents: nominal, or sliding mode, which disturbances within --delta do not move."),
    one_of(InitialState, "x0", default="random", help="Agents: initial positions, as of ptcc certify."),
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


def refuse_of_agents() -> None:
    """Refuse flags of agents of order n where there are none; a scenario may have such keys for other commands."""
    context = click.get_current_context()
    for name in _OWN:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            flag = flag_of(name)
            says = "is not searched for single integrators; give it to ptcc certify, or add --agents double-integrator"
            if name == "x0":
                says = "single integrators are designed for all states within a bound; give --initial-bound R instead"
            raise ParameterError(f"{flag}: {says}")


def design_of_agents(signed: SignedDigraph, options: Options) -> AgentsDesign:
    """Return the deadline of the agents that the options tell."""
    from ptcc_certify.gain_design.deadline_search import design_agents

    if options["input_norm"]:
        raise ParameterError("--input-norm: is of single integrators; of agents in space U bounds ||u_k|| as it is")
    request: Any = {name: options[name] for name in ("max_input", "deadline", "residual")}
    protocol = protocol_of({**options, **_TEMPLATE})
    agents, initial = agents_and_states(options, signed)
    assert agents is not None
    return design_agents(signed, agents, initial, protocol=protocol, **request)


def command_of_agents(answer: AgentsDesign, options: Options) -> list[str] | None:
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
