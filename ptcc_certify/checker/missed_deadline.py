"""Verifies who misses a common deadline under late messages, and deadlines of their own that followers meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down
from lmi.exact.elementary_enclosures import exp, log
from lmi.exact.numbers import shorten
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph, edges_of
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input_formulas import BITS
from ptcc_certify.checker.message_ages import Messages
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.section_declarations import FollowerIntegers, Node, Positive
from ptcc_certify.checker.structure import Structure

#: Products of short integers that an exponential and a logarithm cost, about.
EACH_EXPONENTIAL = 1000


@dataclass(frozen=True, kw_only=True)
class MissedDeadline:
    """An agent, and how far it is away from its final state at the deadline, at least."""

    agent: Node
    bound: Positive


@dataclass(frozen=True, kw_only=True)
class Signs:
    """The witness of a missed deadline: 1, -1 or 0 of every follower."""

    gauge: FollowerIntegers


def check_missed(
    doc: Document, messages: Messages, structure: Structure, begin: Begin, section: MissedDeadline
) -> None:
    """Verify that an agent is away from its final state at the deadline, by the signs of those that it hears of."""
    doc.at = "messages.missed"
    graph, nodes = structure.graph, structure.followers
    agent, bound = section.agent, section.bound
    need(structure.number[agent] < 0, "a leader does not miss its final state")
    ideal = not messages.late and messages.value_error == 0 and messages.gain_cap is None
    need(ideal, "missed of a capped gain, of values that are off, or of a late own state")
    final = doc.sections["final_state"]
    need(final is not None and begin.state is not None, "missed without a final state")
    mid, radius = final
    state = begin.state or mid
    signs = doc.open("late-missed", "messages.missed")["witness"].gauge
    need(all(g in (-1, 0, 1) for g in signs), "gauge: a sign is neither 1, -1 nor 0")
    gauge = dict(zip(nodes, signs, strict=True))
    need(gauge[agent] != 0, "gauge: no sign of the agent")
    spend(graph.n_edges + graph.n, what="signs of followers")
    heard_of_agent = False
    for v, g in gauge.items():
        if g:
            for s, k in zip(*edges_of(graph.into, v), strict=True):
                if s in gauge:
                    need(gauge[s] == (-g if graph.minus[k] else g), "gauge: the sign of an edge does not fit")
                    heard_of_agent |= s == agent
    for v, g in gauge.items():
        if g and (v != agent or heard_of_agent):
            fits = g * (state[v] - mid[v]) >= radius[v]
            need(fits, f"agent {shorten(graph.labels[v])} starts on the other side of its final state")
    heard = {s for s in edges_of(graph.into, agent)[0] if s in gauge}
    away = {s: max(abs(state[s] - mid[s]) - radius[s], Fraction(0)) for s in heard}
    need(bound <= _left_below(messages, graph, agent, away), "the bound is not proved")
    doc.done(f"agent {shorten(graph.labels[agent])} is away by {down(bound)} at least")


def _left_below(messages: Messages, graph: Digraph, agent: int, away: dict[int, Fraction]) -> Fraction:
    """Bound ``sum_l (|w_kl|/D_k) e^(-D_l s(T - tau_kl)) e_l`` from below, over the followers that an agent hears."""
    gain, total = messages.gain, Fraction(0)
    first, (sources, which) = graph.into[0][agent], edges_of(graph.into, agent)
    edges = enumerate(zip(sources, which, strict=True), start=first)
    heard = [(messages.latency_of(e), s, k) for e, (s, k) in edges if s in away]
    need(all(late > 0 for late, _, _ in heard), "a message that is not late")
    bits = length((gain.T, gain.rho1, gain.k, *(late for late, _, _ in heard), *away.values()))
    spend(len(heard) * EACH_EXPONENTIAL, what="what late messages leave")
    spend(8 * len(heard), bits, bits + graph.bits, "what late messages leave")
    for late, s, k in heard:
        t = max(gain.T - late, Fraction(0))
        clock = gain.rho1 * t + gain.k * log(gain.T / (gain.T - t), BITS)[1] if t else Fraction(0)
        share = Fraction(abs(graph.values[k]), graph.diagonal[agent])
        total += share * exp(-clock * Fraction(graph.diagonal[s], graph.unit), BITS)[0] * away[s]
    return total


def check_staged(doc: Document, messages: Messages, structure: Structure, section: Sequence[Fraction]) -> None:
    """Verify deadlines of their own, each the delay after those of all that are heard."""
    doc.at = "messages.staged"
    graph, nodes = structure.graph, structure.followers
    ideal = not messages.late and messages.value_error == 0 and messages.gain_cap is None
    need(ideal, "staged of a capped gain, of values that are off, or of a late own state")
    doc.open("late-staged", "messages.staged")
    levels = _levels(structure)
    last = max(levels)
    due = [messages.gain.T - (last - level) * messages.delay for level in range(last + 1)]
    need(due[1] > 0, "information from the leaders has not arrived by the deadline")
    for v, level, deadline in zip(nodes, levels, section, strict=True):
        need(deadline == due[level], f"the deadline of agent {shorten(graph.labels[v])} is another")
    doc.done(f"{last} levels, the first at {down(due[1])}")


def _levels(structure: Structure) -> Sequence[int]:
    """Return the number of edges of the longest path from a leader to every follower; there are no cycles."""
    graph, waiting = structure.graph, dict[int, int]()
    spend(4 * graph.n_edges + graph.n, what="levels of followers")
    for v in structure.followers:
        waiting[v] = sum(structure.number[s] < 0 for s in edges_of(graph.into, v)[0])
    level = dict.fromkeys(structure.followers, 1)
    todo = [v for v, count in waiting.items() if not count]
    for v in todo:
        for t in edges_of(graph.out, v)[0]:
            level[t] = max(level[t], level[v] + 1)
            waiting[t] -= 1
            if not waiting[t]:
                todo.append(t)
    need(len(todo) == len(level), "edges between followers form a cycle")
    return list(level.values())
