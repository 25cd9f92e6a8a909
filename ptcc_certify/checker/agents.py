"""Verifies a certificate of agents of order n, after its graph: section 21 of the format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.work import spend
from ptcc_certify.checker.agent_bounds import (
    AgentsInput,
    Begin,
    ResidualSection,
    Used,
    UsedSection,
    check_input,
    check_residual,
    verify_used,
)
from ptcc_certify.checker.agent_cascade import check_cascade
from ptcc_certify.checker.agent_decrease import check_decrease, check_phases
from ptcc_certify.checker.agent_instants import Halved, check_instants, halvings, value_above
from ptcc_certify.checker.agent_model import Agents, OneAgent, agents_of
from ptcc_certify.checker.common_motion import check_ends, need_shape, sized_offsets
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import Ball, ByAgent, Several


@dataclass(frozen=True, kw_only=True)
class AgentsSection(OneAgent):
    """What the file says of agents of order n."""

    functions: Several[UsedSection]
    offsets: ByAgent[Several[Fraction]]
    initial_state: ByAgent[Several[Several[Fraction]]] | None = None
    motion: Several[Several[Ball]]
    final_state: ByAgent[Several[Several[Ball]]] | None = None
    residual: ResidualSection | None = None
    input: AgentsInput | None = None


def check_agents(doc: Document, verified: Verified) -> bool:
    """Verify the section ``agents``; return whether agreement and where it happens were proved.

    The problem tells no initial state: that of the agents stands here.
    """
    _check_document(doc, verified)
    if isinstance(doc.data["agents"], dict) and "cascade" in doc.data["agents"]:
        doc.refuse("phases", "phases of the cascade")
        return check_cascade(doc, verified)
    section, graph = doc.section("agents"), verified.structure.graph
    agents = agents_of(section, verified.gain)
    offsets, states = sized_offsets(section.offsets, agents), section.initial_state
    need_shape(states, "initial_state", agents)
    begin = None
    if states is not None:
        begin = Begin(agents, graph, states, offsets)
        longest = length(x for part in (*begin.states, offsets) for row in part for x in row)
        spend(20 * agents.d * agents.n * graph.n, longest, longest, "the initial states")
    used = list[Used]()
    for entry in section.functions:
        used.append(verify_used(doc, verified, entry, used[-1].number if used else -1))
    check_decrease(doc, agents, [use.function for use in used])
    proved = check_ends(doc, agents, verified.final, section, bool(used))
    _bounds(doc, verified, section, agents, begin, used)
    check_phases(doc, agents, used)
    if "instants" in doc:
        _instants(doc, begin, used)
    return proved


def _check_document(doc: Document, verified: Verified) -> None:
    """Verify that the parts that speak of agents of order 1 are empty, and that no sliding variable moves."""
    doc.refuse("initial_state", "an initial state beside that of the agents")
    doc.refuse("input", "an input beside that of the agents")
    doc.at = "sliding_variable"
    need(not any(verified.begin.sigma or ()), "agents of order n begin with sliding variables that are 0")


def _instants(doc: Document, begin: Begin | None, used: Sequence[Used]) -> None:
    """Verify Lyapunov functions at instants at which the time left is halved."""
    if begin is None or begin.agents.cap is not None:
        raise RejectedError("instants without initial states, or of a gain that is capped")

    def least(k: int, at: Halved, _: Fraction) -> tuple[Fraction]:
        return (value_above(begin, used[k].function, at),)

    graph = begin.graph
    known = halvings(begin.agents, graph.laplacian_product, graph.unit, begin.states, begin.offsets)
    check_instants(doc, known, len(used), 1, least)


def _bounds(
    doc: Document,
    verified: Verified,
    section: AgentsSection,
    agents: Agents,
    begin: Begin | None,
    used: Sequence[Used],
) -> None:
    """Verify what is left at the deadline, and the input."""
    graph, doc.at = verified.structure.graph, "agents.residual"
    deviates = any(use.function.deviation is not None for use in used)
    need(
        (section.residual is not None) == (agents.cap is not None and begin is not None and deviates),
        "what is left at the deadline is told iff there are a cap, initial states and deviations",
    )
    if begin is not None and section.residual is not None:
        check_residual(doc, begin, used, section.residual)
    doc.at = "agents.input"
    if section.input is None:
        return
    need(begin is not None and bool(used), "a bound of the input without initial states or Lyapunov functions")
    if any(agents.own):
        need(agents.damped, "a bound of the input of agents whose common velocity falls too slowly")
        need(
            deviates and verified.final.weights is not None,
            "a bound of the input at rest without deviations or weights",
        )
    need(agents.cap is not None or agents.bounded, "a bound of the input though r k is below 2 n")
    need(any(use.error_constants(graph) is not None for use in used), "a bound of the input without its constants")
    if begin is not None:
        mu1 = verified.protocol.gains["mu1"] if verified.protocol.sliding else Fraction(0)
        check_input(doc, begin, used, section.input, verified.final, mu1)
