"""Verifies a certificate of agents of order n, after its graph: section 21 of the format."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lmi.exact.work import spend
from ptcc_certify.checker.agent_bounds import Begin, Used, check_input, check_residual, read_used
from ptcc_certify.checker.agent_cascade import check_cascade
from ptcc_certify.checker.agent_decrease import check_decrease, check_phases
from ptcc_certify.checker.agent_instants import check_instants
from ptcc_certify.checker.agent_model import Agents, read_agents
from ptcc_certify.checker.agent_motion import check_final_states, check_motion, read_offsets, read_states
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import entries, fields, length, need

KEYS = (
    *("order", "dimension", "plant", "own", "gains", "coupling", "lower_triangle", "rate", "gain_cap", "points"),
    *("functions", "offsets", "initial_state", "motion", "final_state", "residual", "input"),
)


def check_agents(doc: Document, verified: Verified) -> bool:
    """Verify the section ``agents``; return whether agreement and where it happens were proved.

    The initial state of the document is null: that of the agents stands here.
    """
    _check_document(doc, verified)
    if isinstance(doc.data["agents"], dict) and "cascade" in doc.data["agents"]:
        need("phases" not in doc.data and "instants" not in doc.data, "phases or instants of the cascade")
        return check_cascade(doc, verified)
    section, graph = fields(doc.section("agents"), KEYS, "agents"), verified.structure.graph
    agents = read_agents(section, verified.gain)
    offsets = read_offsets(section["offsets"], graph.labels, agents)
    states = section["initial_state"]
    begin = None
    if states is not None:
        begin = Begin(agents, graph, read_states(graph.labels, states, "initial_state", agents), offsets)
        longest = length(x for part in (*begin.states, offsets) for row in part for x in row)
        spend(20 * agents.d * agents.n * graph.n, longest, longest, "the initial states")
    used = _functions(doc, verified, section["functions"])
    check_decrease(doc, agents, [use.function for use in used])
    doc.at = "agents.motion"
    M = check_motion(doc, agents, section["motion"])
    doc.at = "agents.final_state"
    final = verified.final
    proved = doc.data["influence"] is not None and (bool(used) or not graph.listening)
    need(
        (begin is not None and proved) or section["final_state"] is None,
        "a final state without initial states or a proof",
    )
    if begin is not None and section["final_state"] is not None:
        check_final_states(doc, agents, final, M, begin.states, offsets)
    _bounds(doc, verified, agents, begin, used)
    check_phases(doc, agents, used)
    check_instants(doc, begin, used)
    return proved


def _check_document(doc: Document, verified: Verified) -> None:
    """Verify that the parts that speak of agents of order 1 are empty, and that no sliding variable moves."""
    need(doc.section("initial_state") is None, "an initial state beside that of the agents")
    need(doc.section("input") is None, "an input beside that of the agents")
    doc.at = "sliding_variable"
    need(not any(verified.begin.sigma or ()), "agents of order n begin with sliding variables that are 0")


def _functions(doc: Document, verified: Verified, section: Any) -> list[Used]:
    """Read which Lyapunov functions are used, and verify constants of the input of full ones."""
    used = list[Used]()
    for entry in entries(section, "functions"):
        before = used[-1].number if used else -1
        used.append(read_used(doc, verified, fields(entry, ("function", "inputs"), "a function that is used"), before))
    return used


def _bounds(doc: Document, verified: Verified, agents: Agents, begin: Begin | None, used: Sequence[Used]) -> None:
    """Verify what is left at the deadline, and the input."""
    section, graph = doc.data["agents"], verified.structure.graph
    doc.at = "agents.residual"
    deviates = any(use.function.deviation is not None for use in used)
    need(
        (section["residual"] is not None) == (agents.cap is not None and begin is not None and deviates),
        "what is left at the deadline is told iff there are a cap, initial states and deviations",
    )
    if begin is not None and section["residual"] is not None:
        check_residual(doc, begin, used, section["residual"])
    doc.at = "agents.input"
    if section["input"] is None:
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
        check_input(doc, begin, used, section["input"], verified.final, mu1)
