"""Facts of where agents begin, and where they end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import counted, up
from ptcc_certify.bounds.final_state.of_graph import FinalState, extremes
from ptcc_certify.bounds.final_state.opinions import disagreement, polarisation
from ptcc_certify.certificate.constrained_switching.final_states import constant_states, last_states, states_of_signal
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.graphs.stubborn import prejudices
from ptcc_certify.report.facts.claim import assumptions, range_text, told_ranges
from ptcc_certify.report.facts.constrained_switching import agreement_text, every_text, rests
from ptcc_certify.report.text_layout import (
    TEXT,
    columns,
    interval_text,
    intervals_text,
    printable,
    short_number,
    shorten_list,
    value_list,
    wrap_text,
)

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.reading import Interval

#: Most leader groups that are named.
_NAMED = 9
#: Columns of a list of intervals on a short screen and on a long one.
_SHORT, _LONG = 2 * TEXT - 20, 12 * TEXT


def initial_facts(certificate: Certificate, origins: Mapping[str, str], alone: bool) -> Facts:
    """Tell initial positions, and velocities, and where they come from; ``alone`` if of the simulated run alone."""
    if (begin := certificate.proof.initial_positions) is not None:
        drawn = f" ({origins['x(0)']})" if "x(0)" in origins else ""
        text = value_list(certificate.labels, begin) + drawn
        text += ", of the simulated run alone" if alone else ""
        yield Fact(head="x(0)", value=dict(zip(certificate.labels, begin, strict=True)), note=text, detail=True)
    if (places := certificate.proof.offsets) is not None:
        values = dict(zip(certificate.labels, places, strict=True))
        yield Fact(head="offsets", value=values, note=value_list(certificate.labels, places), detail=True)
    for name, column in (certificate.proof.vehicles or {}).items():
        if any(column):
            values = dict(zip(certificate.labels, column, strict=True))
            yield Fact(head=name, value=values, note=value_list(certificate.labels, column), detail=True)


def final_facts(certificate: Certificate) -> Facts:
    """Tell where the agents end: each of them, or in two lines those at the same state together, or the extremes."""
    result, labels = certificate.graph_proof.final_positions, certificate.labels
    if result is None:
        return
    remarks = {
        _meeting(certificate): bool(result.degenerate),
        **dict.fromkeys(assumptions(certificate, states=True), True),
        "not certified that they get there": certificate.verdict == "undecided",
    }
    more = "".join(f"; {remark}" for remark, holds in remarks.items() if holds) + ")"
    groups: dict[Fraction | float, list[str]] = {}
    for label, state in zip(labels, result.states, strict=True):
        groups.setdefault(state, []).append(labelled(printable(label)))
    listed = value_list(labels, result.states, 2 * TEXT)
    grouped = "; ".join(f"{', '.join(names)} at {short_number(state)}" for state, names in groups.items())
    brief = min(listed, grouped, key=columns)
    kind = f"({_accuracy(result, 'rounded')}{more}"
    cut = ", ... (" in brief or len(wrap_text(f"{brief} {kind}")) > 2
    if len(groups) == 1 < len(labels):
        brief = f"every agent at {short_number(result.states[0])}"
    elif cut and len(groups) == 2:
        brief = " and ".join(f"{counted(len(names), 'agent')} at {short_number(x)}" for x, names in groups.items())
    elif cut:
        highest, lowest = extremes(result.states, 1, result.radius)
        most, least = (value_list([labels[k]], [result.states[k]]) for (k,) in (highest, lowest))
        brief = f"least {least}, largest {most}, of {len(labels):,} agents"
    yield Fact(
        head="x(T)",
        value=dict(zip(labels, result.states, strict=True)),
        standing="unproved" if certificate.verdict == "undecided" else "proved",
        note=f"{value_list(labels, result.states)} ({_accuracy(result)}{more}",
        brief=(f"{brief} {kind}",),
    )
    if result.degenerate:
        yield Fact(head="x(T)", note=f"of this x(0) {_meeting(certificate)}", detail=True)
    yield from _opinion_facts(certificate, result)


def _opinion_facts(certificate: Certificate, result: FinalState) -> Facts:
    """Tell of stubborn agents how far they lie apart before and after, where x(T) is exact and assumes nothing."""
    graph, begin = certificate.graph_proof.graph, certificate.proof.initial_positions
    if begin is None or not (result.exact and prejudices(graph)) or certificate.proof.offsets is not None:
        return
    if certificate.verdict == "undecided" or [*assumptions(certificate, states=True)]:
        return
    values = {f.__name__: [f(graph, begin), f(graph, result.states)] for f in (polarisation, disagreement)}
    text = ", ".join(f"{name} {float(x):.4g} -> {float(y):.4g}" for name, (x, y) in values.items())
    yield Fact(head="opinions", value=values, standing="unproved", note=f"x(0) to x(T): {text}")


def _meeting(certificate: Certificate) -> str:
    """Tell which balanced leader groups happen to meet at 0, in a formation at their places."""
    proof = certificate.graph_proof
    groups, formation = proof.degenerate, proof.offsets is not None
    named = ", ".join(map(str, groups[:_NAMED])) + (", .." if len(groups) > _NAMED else "")
    if len(groups) == 1:
        where = "its place" if formation else "0"
        return f"leader group {named} happens to meet at {where}, although it is balanced"
    return f"leader groups {named} happen to meet at {'their places' if formation else '0'}, although they are balanced"


def _accuracy(result: FinalState, rounded: str = "here to 5 digits") -> str:
    """Tell how exactly a final state is known, and whether it is written with fewer digits."""
    if result.radius is None and not result.exact:
        return "floating point"
    cut = any(Fraction(short_number(x)) != x for x in result.states)
    if widest := max(result.radius or (0,)):
        within = f"to within {up(widest, 2)}, proved"
        return f"{within}; {rounded}" if cut else within
    return "exact" if not cut else rounded if rounded == "rounded" else f"exact; {rounded}"


def family_final_facts(certificate: Certificate) -> Facts:
    """Tell between which ends every agent is at the deadline, agents with the same ends together."""
    proof = certificate.family_proof
    if certificate.refused:
        return
    labels = certificate.labels
    ends: Sequence[Interval | None] | None = None
    head, more = "x(T)", ""
    if proof.final_state is not None and proof.common:
        ends, more = proof.final_positions, every_text(certificate)
    elif proof.final_state is not None and any(one is not None for one in last_states(certificate.family_proof)):
        ends, more = states_of_signal(certificate.family_proof), f"{agreement_text(certificate)} (these signals)"
        head = "x(T)" if rests(certificate) else "x(t)"
    if ends is not None:
        assumed = f" ({', '.join(without)})" if (without := assumptions(certificate, states=True)) else ""
        note, brief = (f"{intervals_text(labels, ends, width)}{more}{assumed}" for width in (_LONG, _SHORT))
        yield Fact(head=head, value=dict(zip(labels, ends, strict=True)), note=note, brief=(brief,))
    if text := constant_text(certificate):
        brief = f"{constant_text(certificate, _SHORT)} (constant weights)"
        yield Fact(head="x(T)", note=f"{text} (constant weights; {attained_text(certificate)})", brief=(brief,))
    for place, (k, kept) in enumerate(told_ranges(certificate).items()):
        component = proof.parts[k].component
        text, brief = (range_text(component, kept, width) for width in (12 * TEXT, TEXT))
        yield Fact(head="x(t)", note=text, brief=(brief,), detail=place > 0)


def attained_text(certificate: Certificate) -> str:
    """Tell how near some constant weights come to the ends that are told of all of them."""
    values = (
        ends for claim in certificate.family_proof.final_values.values() for ends in claim.values if ends is not None
    )
    within = max(ends.within for ends in values)
    return f"some weights come within {up(within, 2)} of either end" if within else "some weights attain these ends"


def constant_text(certificate: Certificate, width: int = 12 * TEXT) -> str:
    """Tell between which ends agents are at the deadline if mode and weights never change; "" if that says no more.

    Of agents whose end depends on the signal nothing is told here.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    >>> constant_text(certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [0, 6], signal="constant"))
    'every agent in [2, 3]'
    """
    proof = certificate.family_proof
    columns = (
        proof.family.labels,
        constant_states(certificate.family_proof),
        proof.final_positions or (),
    )
    rows = [row for row in zip(*columns, strict=False) if None not in row]
    if all(interval_text(own) == interval_text(every) for _, own, every in rows):
        return ""
    text = intervals_text([label for label, *_ in rows], [own for _, own, _ in rows], width)
    whole = len(rows) == proof.family.n_nodes
    return (
        text
        if whole
        else text.replace("every agent", shorten_list([labelled(label) for label, *_ in rows], 4 * TEXT), 1)
    )
