"""Facts of agents of order n: their equation and protocol, where they end, how near by when, their input."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import near, up
from ptcc_certify.bounds.final_state.of_graph import extremes
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.model.agents import DERIVATIVES, PLURALS, plant_text
from ptcc_certify.report.facts.input import peak_fact
from ptcc_certify.report.text_layout import TEXT, agent_text, columns, short_number, shorten_list, unbroken

if TYPE_CHECKING:
    from ptcc_certify.bounds.agents.common_motion import Interval
    from ptcc_certify.certificate.agents_answer import AgentsAnswer

#: Names of final derivatives on the screen.
_ENDS = ("x(T)", "v(T)", "a(T)")
#: ``1 - t/T`` and its name, where the long screen tells what may be left.
_INSTANTS = ((0.5, "0.5 T"), (0.1, "0.9 T"), (0.01, "0.99 T"), (1e-6, "T(1-1e-6)"))


def agents_text(part: AgentsAnswer) -> str:
    """Tell the agents and their protocol in one line.

    The gains are those of relative positions, velocities and so on, each times a power of the gain.
    """
    protocol = part.protocol
    remarks = {
        "in formation": part.formation,
        f"in {part.dimension} dimensions": part.dimension > 1,
        "meeting at rest": any(protocol.own) and part.derivatives_agree,
    }
    how = ", ".join(remark for remark, holds in remarks.items() if holds)
    texts = [f"{plant_text(protocol.plant)} {how}".strip()]
    if protocol.gain_cap is not None:
        texts.append(f"gain at most {near(protocol.gain_cap)}")
    if part.functions or not part.structure.graph.n_edges:  # else no gains are proved
        texts.append(unbroken(f"u = {protocol.law()}"))
    return "; ".join(texts)


def agents_facts(part: AgentsAnswer, details: bool = True) -> Facts:
    """Tell what the agents are and how they are driven, where they end, bounds of deviations, and of the input."""
    gains, proof = part.proof_text
    text = agents_text(part)
    yield Fact(head="agents", note=f"{text}; {gains}", brief=(text,))
    yield Fact(head="agents", note=proof, detail=True)
    yield from _final_facts(part)
    if not part.functions:
        if part.alone:
            by_itself = "comes to rest" if part.derivatives_agree and any(part.protocol.own) else "moves"
            yield Fact(head="error", note=f"none: no agent listens to another, each {by_itself} by itself")
            if part.inputs is not None or part.grows:
                yield _input_fact(part)
        return
    yield Fact(head="error", note=_error_text(part))
    if details:
        yield from _deviation_facts(part)
    yield _input_fact(part)


def _final_facts(part: AgentsAnswer) -> Facts:
    """Tell positions at ``T``, and velocities and so on unless all are 0."""
    if part.final_state is None:
        if part.initial_state is not None and part.functions:
            text = "not proved: the equations of followers or leaders are too ill-conditioned for floats"
            yield Fact(head=_ENDS[0], standing="unproved", note=text)
        return
    rest = not part.moving and part.settled > 1
    open_end = "" if part.derivatives_agree else "; velocities are not proved to vanish"
    for i in range(part.settled):
        ends = [[chain[i] for chain in agent] for agent in part.final_state]
        if i and not any(m or r for row in ends for m, r in row):
            continue
        kind = f"({_accuracy(ends)}{', at rest' if rest and i == 0 else ''}{open_end})"
        note, brief = (_ends_text(part, ends, width - columns(kind) - 1) for width in (12 * TEXT, 2 * TEXT))
        if part.protocol.gain_cap is not None:
            kind = f"{kind[:-1]}; without the cap)"
        head = _ENDS[i] if i < len(_ENDS) else f"x^({i})(T)"
        yield Fact(head=head, value=ends, note=f"{note} {kind}", brief=(f"{brief} {kind}",))


def _ends_text(part: AgentsAnswer, ends: Sequence[Sequence[Interval]], width: int) -> str:
    """Tell the ends of all agents; the one that all have, or of too many the least and the largest."""
    labels, places = part.structure.graph.labels, [_place(row) for row in ends]
    words = [f"{agent_text(label)}={place}" for label, place in zip(labels, places, strict=True)]
    if len(set(places)) == 1 < len(places):
        return f"{places[0]}, of every agent"
    if len(words) > EXACT_NODES and part.dimension == 1:
        (m,), (least,) = extremes([row[0][0] for row in ends], 1, [row[0][1] for row in ends])
        return f"least {words[least]}, largest {words[m]}, of {len(words):,} agents"
    return shorten_list(words, width)


def _place(row: Sequence[Interval]) -> str:
    numbers = [short_number(float(m) if r else m) for m, r in row]
    return numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"


def _accuracy(ends: Sequence[Sequence[Interval]]) -> str:
    widest = max(r for row in ends for _, r in row)
    cut = any(Fraction(short_number(float(m) if r else m)) != m for row in ends for m, r in row)
    if widest > Fraction(1, 10**12):
        return f"to within {up(widest, 2)}, proved{'; rounded' if cut else ''}"
    return "rounded" if cut or widest else "exact"


def _motion(part: AgentsAnswer) -> str:
    """Name what agents are near to."""
    return "their places in the common motion" if part.formation else "the common motion"


def _named(bounds: Sequence[float], part: AgentsAnswer) -> str:
    """Tell bounds of positions, velocities and so on."""
    words = []
    for i, bound in enumerate(bounds):
        name = PLURALS[i] if i < len(PLURALS) else f"derivatives {i}"
        words.append(f"{name} within {up(0 if part.never_off else bound, 2)}")
    return ", ".join(words) + f" of {_motion(part)}"


def _error_text(part: AgentsAnswer) -> str:
    """Tell how near agents are to the common motion at ``0.99 T``, or at ``T`` under a cap."""
    if part.residual is not None:
        return "at T " + _named([float(max(row[i] for row in part.residual.agents)) for i in range(part.order)], part)
    bounds = part.deviation_bound(np.array([0.01]))[:, :, 0].max(axis=0)
    if not np.isfinite(bounds).all():
        return f"at 0.99 T deviations are {up(part.fall(0.01) * (1 + 1e-9), 2)} of {part.first_ones}, in the norm of V"
    return "at 0.99 T " + _named(bounds.tolist(), part)


def _input_fact(part: AgentsAnswer) -> Fact:
    """Tell whether the input is bounded, its proved size, and whose it is."""
    if part.grows:
        return Fact(head="input", note="NOT BOUNDED: it grows without limit", loud=True)
    if part.inputs is None:
        if part.unbounded:
            why = ", ".join(why for why, _ in part.unbounded)
            return Fact(head="input", standing="unproved", note=f"NOT CERTIFIED BOUNDED: {why}", loud=True)
        return Fact(head="input", note=f"bounded; no number is proved{'' if part.initial_state else ' without x(0)'}")
    largest = max(part.inputs)
    if not largest:
        return Fact(head="input", value=largest, note="none: u = 0")
    text = f"bounded; {part.norm} <= {up(largest, 4)}"
    return peak_fact(text, largest, part.structure.graph.labels, part.inputs)


def _deviation_facts(part: AgentsAnswer) -> Facts:
    """Tell how far from the common motion the farthest agent may be, of every derivative."""
    for i in range(part.order if part.initial_state is not None else 0):
        worst = part.deviation_bound(np.array([q for q, _ in _INSTANTS]))[:, i].max(axis=0)
        if np.isfinite(worst).all():
            pairs = zip(worst.tolist(), _INSTANTS, strict=True)
            bounds = ", ".join(f"{up(0 if part.never_off else x, 2)} at {name}" for x, (_, name) in pairs)
            name = DERIVATIVES[i] if i < len(DERIVATIVES) else f"derivative {i}"
            yield Fact(head="deviation", note=f"{name}: from {_motion(part)} at most {bounds}", detail=True)


def claimed_of(part: AgentsAnswer) -> str:
    """Tell of what the claim of the graph holds, where it is not just of the positions."""
    of = " of x - offsets" if part.formation else ""
    if part.settles:
        return of
    return f"{of} but for what the cap leaves" if part.functions else " of x' = u"
