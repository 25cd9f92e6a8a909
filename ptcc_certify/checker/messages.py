"""Verifies what holds where messages are late, get lost or are rounded, or leaders move: section 22 of the format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from lmi.exact.decimal_rounding import down
from lmi.exact.elementary_enclosures import exp, rounded
from lmi.exact.work import spend
from ptcc_certify.checker.delay_lmi import LateLMI, check_delay_lmi
from ptcc_certify.checker.delayed_forms import LateForm, SettlingSection, check_form, check_settling
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Family
from ptcc_certify.checker.follower_rows import Followers, Rows, followers_of
from ptcc_certify.checker.forms_of_families import FunctionOfSignals, LateFamilyForm, check_forms_of_family
from ptcc_certify.checker.graph import MANY_EDGES
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.input_formulas import BITS, Limits, drift_above
from ptcc_certify.checker.message_ages import LARGEST_GROWTH, Delays, Messages, Moving, check_delays, need_left
from ptcc_certify.checker.missed_deadline import MissedDeadline, check_missed, check_staged
from ptcc_certify.checker.protocol import Begin, Protocol
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import (
    Agents,
    ByFollower,
    FollowerNumbers,
    NotNegative,
    Positive,
    Several,
)
from ptcc_certify.checker.stated_bounds import Decay, DecayOfAll, Inputs, Residual, Vehicles, VehiclesSection
from ptcc_certify.checker.stepwise_bounds import Steps
from ptcc_certify.checker.stepwise_inputs import Walk

#: Witnesses of rows, and instants of steps, that are read.
MANY_ROWS, MANY_INSTANTS = 100, 2001
#: What is not proved where leaders move, and what of families.
AT_REST = ("missed", "staged", "settling", "form", "lmi")
OF_ONE_GRAPH = ("steps", *AT_REST)


@dataclass(frozen=True, kw_only=True)
class RowsBound:
    """A bound by rows.

    ``drift`` and ``after`` where leaders move, ``start``, ``turn`` and ``level`` where inputs are clipped.
    """

    cap: Positive | None = None
    clock: Fraction | None = None
    left: Fraction
    initial: Fraction
    floor: Fraction
    drift: Fraction | None = None
    after: Fraction | None = None
    start: Fraction | None = None
    turn: NotNegative | None = None
    level: NotNegative | None = None


@dataclass(frozen=True, kw_only=True)
class StepsBound:
    """A bound from instant to instant."""

    instants: Several[Fraction]


@dataclass(frozen=True, kw_only=True)
class StepsStart:
    """The witness of a bound from instant to instant."""

    start: FollowerNumbers


@dataclass(frozen=True, kw_only=True)
class MessagesSection(Delays):
    """What the file says of late messages."""

    rows: Several[RowsBound]
    steps: StepsBound | None = None
    forms: Several[LateFamilyForm] | None = None
    residual: Agents | None = None
    missed: MissedDeadline | None = None
    staged: ByFollower[Fraction] | None = None
    settling: SettlingSection | None = None
    form: LateForm | None = None
    lmi: LateLMI | None = None
    input: Agents | None = None
    vehicles: VehiclesSection | None = None


def check_messages(
    doc: Document,
    of: Verified | Family,
    protocol: Protocol,
    begin: Begin,
    functions: Sequence[FunctionOfSignals] = (),
) -> None:
    """Verify everything that is said of late messages, if there is something; ``functions`` are those of a family."""
    if "messages" not in doc:
        return
    if isinstance(of, Family):
        doc.context.edges = len(of.pairs)
    section = doc.section("messages")
    need(begin.sigma is None or not any(begin.sigma.values), "late messages while sliding variables move")
    messages = check_delays(protocol.gain, section)
    if messages.leaders is not None:
        need(not protocol.sliding, "leaders that move under the sliding-mode protocol")
        need(all(getattr(section, key) is None for key in AT_REST), f"one of {', '.join(AT_REST)} though leaders move")
        need(section.steps is None or messages.leaders.sign_gain is None, "steps beside a sign term")
    _check_moved(doc, messages, of, section)
    need(len(section.rows) <= MANY_ROWS, f"more than {MANY_ROWS} witnesses of rows")
    by_rows = bool(section.rows) or section.steps is not None
    bounded = by_rows or section.forms is not None
    by_rows = by_rows or section.missed is not None or section.staged is not None
    whole = any(x is not None for x in (section.settling, section.form, section.lmi, section.forms))
    need(by_rows or whole, "nothing is stated of late messages")
    need(bounded == (section.residual is not None), "a residual is stated iff rows, steps or forms bound it")
    residual = None if section.residual is None else Residual(doc, section.residual)
    inputs = None if section.input is None else Inputs(doc, messages, section.input)
    vehicles = None
    if section.vehicles is not None:
        need(bool(section.rows) or whole, "vehicles without rows, settling, form and lmi")
        need(not protocol.sliding, "vehicles under the sliding-mode protocol")
        need(
            section.forms is None or not messages.value_error,
            "vehicles of a family with forms, and values that are off",
        )
        vehicles = Vehicles(doc, messages, section.vehicles)
    stated, decays = [one for one in (residual, inputs, vehicles) if one is not None], list[DecayOfAll]()
    if by_rows:
        need(not messages.late, "rows, steps, missed or staged of a late own state")
        followers = followers_of(doc, of if isinstance(of, Family) else of.structure, begin)
        if residual is not None:
            residual.behind(followers)
        for k, entry in enumerate(section.rows):
            _check_rows(doc, messages, followers, entry, f"messages.rows[{k}]", stated)
        if isinstance(of, Verified) and section.steps is not None:
            _check_steps(doc, messages, followers, of.structure.graph, section.steps.instants, stated)
    if isinstance(of, Family):
        alone = all(getattr(section, key) is None for key in OF_ONE_GRAPH)
        need(alone, f"one of {', '.join(OF_ONE_GRAPH)} of a family")
        if section.forms is not None:
            decays = check_forms_of_family(doc, messages, of, functions, begin, section.forms)
    if residual is not None:
        for decay in decays:
            residual.of_all(decay)
        residual.close(doc)
    if isinstance(of, Verified):
        decays = _check_one_graph(doc, messages, of, begin, section)
    for one in (inputs, vehicles):
        if one is not None:
            for decay in decays:
                one.of_all(decay)
            one.close(doc)


def _check_moved(doc: Document, messages: Messages, of: Verified | Family, section: MessagesSection) -> None:
    """Verify that agents may move by themselves, and that inputs may be clipped: of a family, of these targets."""
    if messages.saturation is not None:
        need(isinstance(of, Family) and section.forms is None, "inputs that are clipped of one graph, or by forms")
    if messages.growth:
        if not isinstance(of, Family):
            raise RejectedError("agents that move by themselves of one graph, which is a family of one mode")
        carried = all(one.carried for one in of.components)
        need(carried, "agents that move by themselves to targets that are neither 0, a leader nor its opposite")
        need("formation" not in doc, "agents that move by themselves in a formation")


def _check_one_graph(
    doc: Document, messages: Messages, of: Verified, begin: Begin, section: MessagesSection
) -> list[DecayOfAll]:
    """Verify what is said of one graph alone; return its decays of all agents."""
    need(section.forms is None, "forms of one graph")
    if section.missed is not None:
        check_missed(doc, messages, of.structure, begin, section.missed)
    if section.staged is not None:
        check_staged(doc, messages, of.structure, section.staged)
    decays = []
    if section.settling is not None:
        decays.append(check_settling(doc, messages, of, section.settling))
    if section.form is not None:
        decays.append(check_form(doc, messages, of, section.form))
    if section.lmi is not None:
        decays.append(check_delay_lmi(doc, messages, of, section.lmi))
    return decays


def _check_rows(
    doc: Document,
    messages: Messages,
    followers: Followers,
    entry: RowsBound,
    of: str,
    stated: Sequence[Residual | Inputs | Vehicles],
) -> None:
    """Verify ``|x_k - x*_k| <= u_k (initial e^(-b s) + floor)`` by one witness of rows."""
    doc.at = of
    cap, clock, left, initial, floor = entry.cap, entry.clock, entry.left, entry.initial, entry.floor
    for x in (entry.drift, entry.after):
        need((x is None) == (messages.leaders is None), "drift and after are told iff leaders move")
    for x in (entry.start, entry.turn, entry.level):
        need((x is None) == (messages.saturation is None), "start, turn and level are told iff inputs are clipped")
    obligation = doc.open("late-rows", of)
    q, b = obligation["q"], obligation["b"]
    need(q > 1 or (q == 1 and messages.delay == 0), "q is not above 1")
    need((cap is None) == (messages.delay == 0), "cap is told iff something is late")
    bits = length((q, b, left, clock or left, cap or left, messages.delay, messages.gain.T, messages.gain.rho1))
    spend(50, bits, bits, "rows of followers")
    rows = Rows(followers, obligation["witness"].u)
    rows.decay(q, b, messages.parts)
    limit = need_left(messages, q, b, cap, clock, left)
    grown = messages.grown(messages.growth)
    more = messages.lasting(messages.growth, b) or grown
    rows.above_initial(_clipped(messages, rows, b, entry) if messages.saturation is not None else initial / grown)
    rows.above_floor(floor, messages.wrong * more)
    drift, highest = Fraction(0), floor
    if messages.leaders is not None:
        drift, after = _drift(messages, messages.leaders, rows, b, limit, entry, more)
        highest += after * messages.least_gain(always=True) / messages.least_gain()
    for one in stated:
        one.by_rows(rows, Decay(b, cap, left, initial, floor, drift, highest))
    doc.done(f"b = {down(b)}, q = {down(q)}")


def _clipped(messages: Messages, rows: Rows, b: Fraction, entry: RowsBound) -> Fraction:
    """Verify ``initial``, though inputs are clipped; return what bounds ``|x_k(0) - x*_k| / u_k`` then.

    Up to ``turn`` that falls evenly to ``level``, no faster than ``b g`` times itself and ``saturation/max u`` let it;
    from there on by ``e^(-b s)``: what ``u`` makes of inputs is clipped no more. ``g`` times a line that comes to 0 by
    ``T`` falls, and so does ``g e^(-b s)``, for ``b k >= 1``.
    """
    start, turn, level, gain = *(x or Fraction(0) for x in (entry.start, entry.turn, entry.level)), messages.gain
    assert messages.saturation is not None
    most = messages.saturation * rows.scale / max(rows.u)
    bits = length((start, turn, level, most, b, entry.initial, gain.T, gain.rho1, gain.k, messages.gain_cap or b))
    spend(100, bits, bits, "inputs that are clipped")
    need(turn < gain.T and b * gain.k >= 1, "turn is not before T, or b k is below 1")
    acts = gain.value(1 - turn / gain.T)
    acts = acts if messages.gain_cap is None else min(acts, messages.gain_cap)
    need(b * acts * level <= most, "inputs are clipped at the turn")
    if not turn:
        need(level >= start, "level is not start")
        need(entry.initial >= level, "initial is not proved")
        return start
    speed = (start - level) / turn
    need(
        0 <= speed <= min(most, b * acts * level) and start <= speed * gain.T, "it does not fall so fast up to the turn"
    )
    passed = b * Limits(messages.gain_cap, gain.T - turn).clock_above(gain)
    need(passed <= LARGEST_GROWTH, "the turn is too late")
    need(entry.initial >= level * exp(rounded(passed, BITS, up=True), BITS)[1], "initial is not proved")
    return start


def _drift(
    messages: Messages,
    leaders: Moving,
    rows: Rows,
    b: Fraction,
    limit: Fraction | None,
    entry: RowsBound,
    more: Fraction,
) -> tuple[Fraction, Fraction]:
    """Verify what leaders that move, and disturbances, add at ``T``, and at all times: ``more`` of it stands."""
    drift, after, gain = entry.drift or Fraction(0), entry.after or Fraction(0), messages.gain
    push, grown = leaders.push, messages.grown(messages.growth)
    bits = length((push, rows.least, drift, after, b, limit or b, gain.T, gain.rho1, gain.k, grown, more))
    spend(100, bits, bits, "drift of followers")
    need(drift >= grown * push / rows.least * drift_above(gain, b, limit), "drift is not proved")
    rows.above_push(after, more * push / messages.least_gain(always=True))
    return drift, after


def _check_steps(
    doc: Document,
    messages: Messages,
    followers: Followers,
    graph: Digraph,
    instants: Sequence[Fraction],
    stated: Sequence[Residual | Inputs | Vehicles],
) -> None:
    """Verify the start of a solution that never grows, and form its bounds from instant to instant."""
    doc.at = "messages.steps"
    gain = messages.gain
    need(2 <= len(instants) <= MANY_INSTANTS, f"instants are fewer than 2 or more than {MANY_INSTANTS}")
    need(all(a < b for a, b in pairwise(instants)), "instants do not ascend")
    need(instants[0] == 0 and instants[-1] == gain.T, "instants do not reach from 0 to the deadline")
    vehicles = any(isinstance(one, Vehicles) for one in stated)
    need(messages.delay > 0 or (vehicles and messages.gain_cap is not None), "steps though nothing is late")
    start = doc.open("late-steps", "messages.steps")["witness"].start
    need(all(x >= 0 for x in start.values), "start is negative")
    values, scale = start.over(range(len(start)))
    kind = Steps
    if doc.exact.numpy and graph.n_edges >= MANY_EDGES and not vehicles:
        from ptcc_certify.checker.array_stepwise_bounds import ArraySteps as kind  # noqa: N813
    followers.starts_within(values, scale)
    push = Fraction(0) if messages.leaders is None else messages.leaders.push * scale / messages.least_gain()
    why = "the start of agent {} may grow"
    followers.need_outweighed(values, Fraction(1), messages.wrong * scale, push, why)
    walk = Walk(messages, graph, followers.nodes, instants, values, scale, kind)
    followed = [own for own in (one.along(walk) for one in stated) if own is not None]
    for i, step in enumerate(walk):
        for own in followed:
            own.step(i, step)
    for one in stated:
        one.by_steps(walk, step.end)
    doc.done(f"{len(walk.ways)} steps")
