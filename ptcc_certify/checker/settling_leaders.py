"""Verifies followers that hear late of leaders in groups, which hear each other at once and settle by themselves."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import shorten
from lmi.exact.work import spend
from ptcc_certify.checker import input_formulas as formulas
from ptcc_certify.checker.digraph import edges_of
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.late_form import Constants, function_of, initial_value
from ptcc_certify.checker.messages_asked import Messages, need_left
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.rows import away_of
from ptcc_certify.checker.section_declarations import FewAgents, Positive
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import Inputs
from ptcc_certify.checker.structure import Structure


@dataclass(frozen=True, kw_only=True)
class SettlingSection:
    """Followers of leaders in groups: a cap, how far the clock comes under it, and the share that is left then."""

    cap: Positive
    clock: Fraction
    left: Fraction


@dataclass(frozen=True, kw_only=True)
class SettlingWitness:
    """A Lyapunov function of the leaders, and a number of every agent."""

    function: int
    u: FewAgents


def check_settling(
    doc: Document, messages: Messages, verified: Verified, section: SettlingSection, inputs: Inputs | None = None
) -> None:
    """Verify ``|x_k - x*_k| <= u_k e^(-b s_c)`` for every agent, leaders by a Lyapunov function of theirs."""
    doc.at = "messages.settling"
    structure, gain = verified.structure, messages.gain
    need(messages.delay > 0 and messages.value_error == 0, "settling leaders where nothing is late, or values are off")
    need(not messages.late, "settling leaders of a late own state")
    need(
        verified.begin.state is not None and doc.sections["final_state"] is not None, "settling leaders without a state"
    )
    need(bool(structure.followers), "no follower")
    _hear_at_once(messages, structure)
    cap, clock, left = section.cap, section.clock, section.left
    obligation = doc.open("late-settling", "messages.settling")
    q, b, u = obligation["q"], obligation["b"], obligation["witness"].u
    known = function_of(doc, verified, obligation["witness"].function)
    need(q > 1, "q is not above 1")
    need(0 < b <= known.form.rate / 2, "b is not positive, or above half the rate of the leaders")
    bits = length((q, b, left, clock, cap, messages.delay, gain.T, gain.rho1, *u, *known.deviations))
    spend(50 + 20 * structure.graph.n, bits, bits, "settling leaders")
    need_left(messages, q, b, cap, clock, left)
    _above_leaders(verified, known, u)
    followers = away_of(doc, structure, verified.begin)
    values, scale = u.over(range(structure.graph.n))
    own = [values[v] for v in followers.nodes]
    need(min(own) > 0, "u of a follower is not positive")
    followers.starts_within(own, scale)
    followers.need_decay(values, q, b, messages.parts)
    if inputs is not None:
        inputs.by_settling(structure, u, b, cap)
    doc.done(f"b = {down(b)}, q = {down(q)}")


def _hear_at_once(messages: Messages, structure: Structure) -> None:
    """Verify that what leaders hear of each other is never old."""
    graph = structure.graph
    need(messages.delay == messages.latency.largest(), "leaders of a group hear values that are held")
    spend(graph.n_edges, what="what leaders hear")
    for group in structure.closed:
        for v in group:
            first = graph.into[0][v]
            for e in range(first, first + len(edges_of(graph.into, v)[0])):
                need(messages.latency_of(e) == 0, f"agent {shorten(graph.labels[v])} leads, and hears late")


def _above_leaders(verified: Verified, known: Constants, u: Numbers) -> None:
    """Verify ``u_l >= sqrt(c_l V(0))`` for leaders in groups, followers where their errors are 0; others rest."""
    structure = verified.structure
    leaders = {v for group in structure.closed for v in group}
    root = formulas.root_above(initial_value(verified, known.form, leaders))
    for group in structure.closed:
        for v in group:
            least = formulas.root_above(known.deviations[v]) * root if len(group) > 1 else Fraction(0)
            need(u[v] >= least, f"u of agent {shorten(structure.graph.labels[v])} is too small")
