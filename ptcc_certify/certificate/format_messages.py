"""Late messages and moving leaders in the file of a certificate: written and read, section 22 of ``FORMAT.md``."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.delay_lmi import DelayLMIBound
from ptcc_certify.bounds.late_messages import LateBounds, RowBound, heard_wrong, late_rows
from ptcc_certify.bounds.late_steps import bound_steps
from ptcc_certify.bounds.missed_deadline import Missed
from ptcc_certify.bounds.settling_leaders import Settling
from ptcc_certify.bounds.small_delays import SmallDelays
from ptcc_certify.certificate.format_vectors import floats, floats_up
from ptcc_certify.checker.delay_lmi import LateLMI, LateLMIWitness
from ptcc_certify.checker.late_form import LateForm, LateFormWitness
from ptcc_certify.checker.late_messages import Delays, Moving, Packets
from ptcc_certify.checker.messages import MessagesSection, StepsStart
from ptcc_certify.checker.missed_deadline import Signs
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.sections import RowVector, declared
from ptcc_certify.checker.settling_leaders import SettlingSection, SettlingWitness
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import RowWitness
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.late_messages import LateMessages
from ptcc_certify.protocols.moving_leaders import MovingLeaders
from ptcc_certify.theorems.theorem import Obligation


def late_obligations(late: LateBounds | None) -> Iterator[Obligation]:
    """Yield what proves bounds with late messages."""
    if late is None:
        return
    for i, row in enumerate(late.rows):
        numbers = {"q": row.witness.q, "b": row.witness.b}
        yield Obligation("late-rows", f"messages.rows[{i}]", numbers, RowVector(u=Numbers(row.witness.u)))
    if late.steps is not None:
        yield Obligation("late-steps", "messages.steps", witness=StepsStart(start=Numbers(late.steps.start)))
    if late.missed is not None:
        yield Obligation("late-missed", "messages.missed", witness=Signs(gauge=late.missed.gauge.tolist()))
    if (settling := late.settling) is not None:
        witness = SettlingWitness(function=settling.function, u=Numbers(settling.u))
        yield Obligation("late-settling", "messages.settling", {"q": settling.q, "b": settling.b}, witness)
    if (form := late.form) is not None:
        numbers = {"q": form.q, "b": form.b, "kap": form.kap}
        phi = LateFormWitness(function=form.function, phi=Numbers(form.phi))
        yield Obligation("late-form", "messages.form", numbers, phi)
    if (lmi := late.lmi) is not None:
        floating: Any = [list(map(float, row)) for row in (*lmi.matrix, lmi.tau)]  # dyadic numbers, and short texts
        matrix = LateLMIWitness(matrix=floating[:-1], tau=floating[-1])
        yield Obligation("late-lmi", "messages.lmi", {"b": lmi.b}, matrix)


def delays(messages: LateMessages, graph: SignedDigraph, leaders: MovingLeaders | None = None) -> Delays:
    """Return how late, how often lost and how inexact messages are, as files have it."""
    period, latency = messages.period, messages.latencies(graph)
    return Delays(
        latency=latency if isinstance(latency, Fraction) else Numbers(latency),
        packets=None if period is None else Packets(period=period, losses=Fraction(messages.losses)),
        delay=messages.age,
        own="late" if messages.own_delay else "fresh",
        value_error=messages.value_error,
        gain_cap=messages.gain_cap,
        leaders=None if leaders is None else Moving(speed=leaders.speed, disturbance=leaders.disturbance),
    )


def messages_section(late: LateBounds) -> MessagesSection:
    """Return what is proved with late messages, as files have it."""
    proved: dict[str, Any] = {f.name: getattr(late, f.name) for f in declared(MessagesSection) if hasattr(late, f.name)}
    return MessagesSection(**proved | vars(delays(late.messages, late.structure.graph, late.leaders)))


def read_late(report: CheckReport, structure: Structure, protocol: Protocol, relative: bool) -> LateBounds | None:
    """Return what an accepted certificate says of late messages; None if it says nothing."""
    section: MessagesSection | None = report.sections.get("messages")
    if section is None:
        return None
    messages, proved, moving = read_messages(section, structure), report.proved, section.leaders
    leaders = None if moving is None else MovingLeaders(moving.speed, moving.disturbance)
    rows = []
    for i, row in enumerate(section.rows):
        step = proved["late-rows", f"messages.rows[{i}]"]
        witness = RowWitness(step["q"], step["b"], floats(step["witness"].u))
        rows.append(RowBound(witness, row.cap, row.clock, row.left, row.initial, row.floor, row.drift, row.after))
    gain, missed, steps = GainLimits(gain_cap=messages.gain_cap).limit(protocol.gain), None, None
    if section.missed is not None:
        gauge = np.array(proved["late-missed", "messages.missed"]["witness"].gauge)
        missed = Missed(section.missed.agent, section.missed.bound, gauge)
    if section.steps is not None:
        start = floats(proved["late-steps", "messages.steps"]["witness"].start)
        error, push = float_up(heard_wrong(messages, leaders)), float_up(leaders.total) if leaders else 0.0
        times = tuple(section.steps.instants)
        steps = bound_steps(late_rows(structure, messages), gain, messages.age, error, times, start, push)
    return LateBounds(
        messages,
        structure,
        gain,
        relative,
        tuple(rows),
        steps,
        missed,
        None if section.staged is None else tuple(section.staged),
        floats_up(section.residual),
        _read_form(section.form, proved.get(("late-form", "messages.form"))),
        lmi=_read_lmi(section.lmi, proved.get(("late-lmi", "messages.lmi"))),
        settling=_read_settling(section.settling, proved.get(("late-settling", "messages.settling"))),
        input=floats_up(section.input),
        leaders=leaders,
    )


def _read_form(form: LateForm | None, step: Any) -> SmallDelays | None:
    if form is None:
        return None
    known = step["witness"]
    bounds = form.left, tuple(form.moved), tuple(form.residual)
    return SmallDelays(known.function, step["q"], step["b"], step["kap"], tuple(known.phi), *bounds)


def _read_lmi(lmi: LateLMI | None, step: Any) -> DelayLMIBound | None:
    if lmi is None:
        return None
    bounds = (tuple(values) for values in (lmi.moved, lmi.away, lmi.residual))
    matrix = tuple(map(tuple, step["witness"].matrix))
    return DelayLMIBound(step["b"], matrix, tuple(step["witness"].tau), lmi.left, *bounds)


def _read_settling(settling: SettlingSection | None, step: Any) -> Settling | None:
    if settling is None:
        return None
    known, (cap, clock, left) = step["witness"], (settling.cap, settling.clock, settling.left)
    return Settling(known.function, step["q"], step["b"], cap, clock, left, tuple(known.u))


def read_messages(section: Delays, structure: Structure) -> LateMessages:
    """Return what a certificate says of how late messages are."""
    packets, graph = section.packets, structure.graph
    latency: Any = section.latency
    if isinstance(latency, Numbers):
        latency = {(s, t): x for (s, t, _), x in zip(graph.edges, latency, strict=True)}
    return LateMessages(
        delay=latency,
        period=None if packets is None else packets.period,
        losses=0 if packets is None else int(packets.losses),
        value_error=section.value_error,
        own_delay=section.own == "late",
        gain_cap=section.gain_cap,
    )
