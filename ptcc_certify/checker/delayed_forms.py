"""Verifies Lyapunov functions where messages are late: under small delays, and of leaders whom followers hear late.

Under a capped gain small delays take some of the rate, of all agents. Leaders in groups that hear each other at once
settle as they do without delays, and followers that hear of them late by rows.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import Any

from lmi.exact.decimal_rounding import down
from lmi.exact.elementary_enclosures import exp
from lmi.exact.numbers import integers, longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker import input_formulas as formulas
from ptcc_certify.checker.digraph import Digraph, edges_of
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.follower_rows import away_of
from ptcc_certify.checker.graph import proved_above
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.matrix_products import quadratic
from ptcc_certify.checker.message_ages import LARGEST_GROWTH, Messages, need_left
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import FewAgents, Positive
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.checker.structure import Structure


@dataclass(frozen=True)
class Constants:
    """A Lyapunov function with ``e_k^2 <= errors_k V`` and ``(x_k - (Q x)_k)^2 <= deviations_k V``."""

    form: Form
    errors: Sequence[Fraction]
    deviations: Sequence[Fraction]


@dataclass(frozen=True, kw_only=True)
class LateForm:
    """A Lyapunov function under small delays and errors: what errors make of its root; the rest as of LMIs."""

    left: Fraction
    floor: Fraction | None = None
    moved: FewAgents
    away: FewAgents
    residual: FewAgents


@dataclass(frozen=True, kw_only=True)
class LateFormWitness:
    """The number of the Lyapunov function, ``phi`` of every agent, and where values are off ``psi``."""

    function: int
    phi: FewAgents
    psi: FewAgents | None = None


def check_form(doc: Document, messages: Messages, verified: Verified, section: LateForm) -> DecayOfAll:
    """Verify ``sqrt(V) <= e^(-b s) sqrt(V(0)) + floor``, and how far the final state may move."""
    doc.at = "messages.form"
    graph, cap, error = verified.structure.graph, messages.gain_cap, messages.value_error
    need(cap is not None or not (messages.delay or error), "form without a cap, though something is late or off")
    need(not (error and messages.late), "form of values that are off and of a late own state")
    obligation = doc.open("late-form", "messages.form")
    q, b, kap = (obligation[key] for key in ("q", "b", "kap"))
    known = function_of(doc, verified, obligation["witness"].function)
    phi, psi, left = obligation["witness"].phi, obligation["witness"].psi, section.left
    need(
        (psi is None) == (not error) and (section.floor is None) == (not error),
        "floor and psi are told iff values are off",
    )
    standing, floor = psi or Numbers([Fraction(0)] * graph.n), section.floor or Fraction(0)
    need(all(x >= 0 for x in phi), "phi is negative")
    need(floor >= 0 and all(x >= 0 for x in standing), "floor or psi is negative")
    late = (cap or 0) * messages.delay
    lag = late * q
    bits = length((b, kap, lag, left, error, floor, known.form.rate, *phi, *standing, *known.errors, *known.deviations))
    spend(30 * graph.n, bits, bits, "small delays")
    need(b > 0, "b is not positive")
    need(b * late <= LARGEST_GROWTH and q >= exp(b * late)[1], "q is below e^(b h)")
    pushed = _heard(graph, phi, messages.late)
    off = [
        late * x + error * Fraction(D, graph.unit)
        for x, D in zip(_heard(graph, standing, False), graph.diagonal, strict=True)
    ]
    roots = [formulas.root_above(c) for c in known.errors]
    for label, x, c, y in zip(graph.labels, phi, roots, pushed, strict=True):
        need(x >= c + lag * y, f"phi of agent {shorten(label)} is too small")
    for label, x, c, y in zip(graph.labels, standing, roots, off, strict=True):
        need(x >= c * floor + y, f"psi of agent {shorten(label)} is too small")
    need(kap >= 0 and kap**2 >= _value_of_sizes(doc, graph, known.form, pushed), "kap is too small")
    need(b + lag * kap <= known.form.rate / 2, "the delay takes more than the rate")
    need((floor * known.form.rate / 2) ** 2 >= _value_of_sizes(doc, graph, known.form, off), "floor is too small")
    far = need_left_at_deadline(messages, b, left)
    root = formulas.root_above(initial_value(verified, known.form))
    deviations = [formulas.root_above(c) for c in known.deviations]
    walks = _moved(verified, [lag / b * root * x + far * y for x, y in zip(pushed, off, strict=True)])
    moved = proved_above(graph, section.moved, "moved", [x + c * floor for x, c in zip(walks, deviations, strict=True)])
    away = proved_above(graph, section.away, "away", [c * root for c in deviations])
    proved_above(graph, section.residual, "residual", [x + y * left for x, y in zip(moved, away, strict=True)])
    doc.done(f"b = {down(b)}" + ("" if cap is None else f", gain at most {down(cap)}"))
    nodes = range(graph.n)
    return DecayOfAll(nodes, b, None, left, list(away), list(moved), [root * x for x in phi], list(standing))


def need_left_at_deadline(messages: Messages, b: Fraction, left: Fraction) -> Fraction:
    """Verify what is left of ``e^(-b s)`` at ``T``; return how far the clock comes at most, 0 without a cap."""
    if messages.gain_cap is None:
        need(left == 0, "left is not 0 though the clock goes on for ever")
        return Fraction(0)
    limits = formulas.Limits(messages.gain_cap)
    need(left >= formulas.decay_above(b * limits.clock_below(messages.gain)), "left is not proved")
    return limits.clock_above(messages.gain)


def function_of(doc: Document, verified: Verified, k: Any) -> Constants:
    """Return the Lyapunov function of this number, with its constants."""
    need(type(k) is int and 0 <= k < len(verified.functions), "no such Lyapunov function")
    function, graph = verified.functions[k], verified.structure.graph
    form = function.form
    if form is None or form.coordinates != "E" or function.rate <= 0:
        raise RejectedError("a Lyapunov function of large graphs, of deviations, or without a rate")
    deviation, constants = doc.sections["decays"][k].deviation, doc.sections["input"].constants[k]
    need(deviation is not None, "a Lyapunov function without deviations")
    deviations = deviation.agents
    errors = form.error_constants(graph.n, graph.rational_row)
    if errors is None:
        need(constants is not None, "a full matrix without constants")
        errors = list(constants)
    return Constants(form, errors, list(deviations))


def _heard(graph: Digraph, phi: Numbers, late: bool) -> list[Fraction]:
    """Return ``|W| phi``, or ``|L| phi`` where the own state is late too."""
    values, scale = phi.over(range(graph.n))
    sums = graph.sums_in(values)
    if late:
        sums = [x + D * y for x, D, y in zip(sums, graph.diagonal, values, strict=True)]
    return [Fraction(x, scale * graph.unit) for x in sums]


def _value_of_sizes(doc: Document, graph: Digraph, form: Form, sizes: Sequence[Fraction]) -> Fraction:
    """Return ``y'|L'P L| y``, with the sizes of the entries."""
    (M, scale), ((Y,), common) = form.of_state(doc.exact, graph), integers([sizes])
    spend(graph.n**2, longest(chain.from_iterable(M)), longest(Y), "small delays")
    return quadratic(M, Y, sizes=True) / (scale * common**2)


def initial_value(verified: Verified, form: Form, among: Container[int] | None = None) -> Fraction:
    """Return ``V(0)``, with errors of other agents than ``among`` set to 0."""
    graph, state = verified.structure.graph, verified.begin.state
    if state is None:
        raise RejectedError("form without an initial state")
    values, scale = state.over(range(graph.n))
    errors = graph.laplacian_product(values)
    spend(len(form.nodes) ** 2, longest(errors), longest(chain.from_iterable(form.entries[0])), "V(0)")
    counted = [errors[v] if among is None or v in among else 0 for v in form.nodes]
    return form.value([Fraction(x, scale * graph.unit) for x in counted])


def _moved(verified: Verified, pushed: Sequence[Fraction]) -> list[Fraction]:
    """Return ``|Q| B phi``."""
    need(verified.final.exact, "form without an exact influence of the leaders")
    rows = verified.final.projection
    bits = length(chain(pushed, *(row.values() for row in rows)))
    spend(2 * sum(map(len, rows)), bits, bits, "how far the final state moves")
    return [sum((abs(x) * pushed[j] for j, x in row.items()), Fraction(0)) for row in rows]


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


def check_settling(doc: Document, messages: Messages, verified: Verified, section: SettlingSection) -> DecayOfAll:
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
    doc.done(f"b = {down(b)}, q = {down(q)}")
    graph, nothing = structure.graph, [Fraction(0)] * structure.graph.n
    pulled = [D * x for D, x in zip(graph.diagonal, values, strict=True)]
    heard = graph.sums_in(values)  # at most (D_k - b) u_k of followers
    falling = [Fraction(x + y, scale * graph.unit) for x, y in zip(pulled, heard, strict=True)]
    for v in structure.followers:
        falling[v] = Fraction(2 * pulled[v], scale * graph.unit) - b * Fraction(values[v], scale)
    return DecayOfAll(range(graph.n), b, cap, left, list(u), nothing, falling, nothing)


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
