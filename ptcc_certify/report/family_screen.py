"""One screen of text about a family of graphs: its decision, its certificate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.certificate.answer import rejects
from ptcc_certify.certificate.restricted_claims import LastModeClaim
from ptcc_certify.certificate.restricted_states import constant_states, last_states, states_of_signal
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, BIPARTITE_CONTAINMENT, STABILITY
from ptcc_certify.report.restricted_screen import (
    RESTS,
    TINY,
    TOO_SMALL,
    agreement_text,
    of_mode,
    restricted_entries,
    rests,
)
from ptcc_certify.report.sliding_lines import sliding_lines
from ptcc_certify.report.structure_text import Lines, structure_text
from ptcc_certify.report.text_layout import (
    TEXT,
    columns,
    counted,
    format_lines,
    printable,
    short_number,
    shorten_label,
    shorten_list,
    shorten_text,
    value_list,
    wrap_lines,
    wrap_text,
)
from ptcc_certify.report.told_instants import SHORT, told_instants
from ptcc_certify.theorems.counterexample_text import counterexample_text, mode_name
from ptcc_certify.theorems.family_behaviour import CHAIN, DEPENDS, FamilyComponent, decide
from ptcc_certify.theorems.family_claims import camps, special_behaviours
from ptcc_certify.theorems.family_groups import AgreeingGroup, FamilyGroups
from ptcc_certify.theorems.family_rate import explicit_rate

if TYPE_CHECKING:
    from ptcc_certify.bounds.attracting_box import AttractingBox
    from ptcc_certify.certificate.family_certificate import FamilyCertificate
    from ptcc_certify.certificate.family_content import FamilyContent
    from ptcc_certify.checker.reading import Interval

#: Components of which a screen tells, and lines of a text on the short one.
_COMPONENTS, _LINES = 4, 3
#: Columns of names within a phrase, and groups that agree of which each is named.
_NAMES, _GROUPS = 30, 3
#: Where sliding variables bring an agent that listens to nobody.
DRIVEN = "ends at x(0) - sigma(0)"
_NOTHING: Mapping[str, str] = MappingProxyType({})
#: What proves an upper bound on the rate, in words.
BOUND_KINDS = {
    "member": "a single graph of the family, held for ever",
    "mixture": "a mixture of graphs of the family, between which a signal switches fast",
    "word": "a periodic signal",
}
#: What is told of signals.
WHATEVER = {"any": "for every signal", "constant": "if mode and weights never change"}


def family_summary(certificate: FamilyCertificate, name: str, origins: Mapping[str, str] = _NOTHING) -> list[str]:
    r"""Return the short screen of ``ptcc certify`` for a family: 9 lines of 80 columns, more rather than cut an answer.

    Parameters
    ----------
    certificate : FamilyCertificate
    name : str
        What the family is called.
    origins : mapping of str to str, optional
        Where ``x(0)`` comes from, and how rows were ``read``.

    Returns
    -------
    list of str

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", "0.9", "1.1")], undirected=True)
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1))
    >>> print("\n".join(family_summary(cert, "pair")))
    family     pair: 2 nodes, 2 edges, 2 uncertain
    protocol   nominal: T=1, rho1=1, rho2=2, kappa=1; no x(0)
    claim      consensus at T = 1 for every signal
    rate       3.59999, upper bound 3.6: both proved, ratio 0.999999
    input      bounded for every signal and every initial state
    verdict    certified; checked without a solver
    """
    components, T = [part.component for part in certificate.parts], certificate.protocol.T
    asked = [
        *_family_entries(certificate.family, name, origins),
        ("protocol", _protocol_text(certificate, origins)),
    ]
    if rejects(certificate.checked):
        return wrap_lines(format_lines([*asked, ("verdict", _verdict(certificate))]))
    entries = [
        *asked,
        *_claim_entries(components, f" at T = {near(T)}", False, certificate),
        *_rate_entries(certificate),
        *restricted_entries(certificate),
        *_final_entries(certificate),
        *_error_entries(certificate),
        *_input_entries(certificate),
        ("verdict", _verdict(certificate)),
    ]
    return wrap_lines(format_lines(entries))


def decision_summary(components: Sequence[FamilyComponent], family: Family, name: str, read: str = "") -> list[str]:
    r"""Return the short screen of ``ptcc classify`` for a family.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", -1, 0), ("b", "a", 1, 2)])
    >>> print("\n".join(decision_summary(ptcc.decide(unsure), unsure, "pair")))
    family     pair: 2 nodes, 2 edges, 2 uncertain, 1 of them optional
    claim      depends on the signal
    why        the state a=1, b=1 rests at the least weights and moves with a -> b
               on
    constant   where weights never change: it depends on the weights
    groups     no limit is claimed of a, b
    """
    return wrap_lines(format_lines([*_family_entries(family, name, {"read": read}), *_claim_entries(components)]))


def decision_lines(components: Sequence[FamilyComponent], family: Family, name: str, read: str = "") -> list[str]:
    """Return the lines of ``ptcc classify -v`` for a family, as long as they are."""
    entries = [*_family_entries(family, name, {"read": read}), ("nodes", shorten_list(family.labels))]
    entries += _mode_entries(family, components)
    return format_lines([*entries, *_claim_entries(components, every=True)])


def family_lines(certificate: FamilyCertificate, name: str, origins: Mapping[str, str] = _NOTHING) -> list[str]:
    """Return the lines of ``ptcc certify -v`` for a family, as long as they are."""
    components, family = [part.component for part in certificate.parts], certificate.family
    entries = [*_family_entries(family, name, origins), ("nodes", shorten_list(family.labels))]
    if rejects(certificate.checked):
        return format_lines([*entries, ("proof", _proof_text(certificate)), ("verdict", certificate.assessment.text)])
    entries += _mode_entries(family, components)
    entries += [("protocol", _gains(certificate))]
    if certificate.initial_state is not None:
        origin = f" ({origins['x(0)']})" if "x(0)" in origins else ""
        entries.append(("x(0)", value_list(family.labels, certificate.initial_state) + origin))
    entries += sliding_lines(family.labels, certificate.protocol.reaching, certificate.sigma0, certificate.reaching)
    when = f" at T = {near(certificate.protocol.T)}"
    entries += _claim_entries(components, when, True, certificate)
    entries += [*_rate_entries(certificate), *restricted_entries(certificate), *_function_entries(certificate)]
    entries += _final_entries(certificate, long=True)
    entries += [*_error_entries(certificate, long=True), *_input_entries(certificate, long=True)]
    entries += [("note", note) for note in certificate.notes if note not in family.notes]
    entries.append(("proof", _proof_text(certificate)))
    return format_lines([*entries, ("verdict", certificate.assessment.text)])


# ---------------------------------------------------------------------- the family


def family_text(family: Family, name: str) -> str:
    """Tell the size of a family, its modes by name, and what is uncertain.

    Examples
    --------
    >>> family_text(Family.from_intervals([("a", "b", 0, 1)]), "pair")
    'pair: 2 nodes, 1 edge, 1 optional'
    """
    several = len(family.modes) > 1
    edges = sum(mode.n_edges for mode in family.modes)
    uncertain = sum(int((~mode.known).sum()) for mode in family.modes)
    optional = sum(int(mode.optional.sum()) for mode in family.modes)
    rest = f"{counted(family.n_nodes, 'node')}, {counted(edges, 'edge')}"
    rest += f", {uncertain:,} uncertain" * (uncertain > optional)
    rest += f", {optional:,}{' of them' * (uncertain > optional)} optional" * bool(optional)
    if not (several or name):
        return rest
    if not several:
        return f"{shorten_text(printable(name), max(TEXT - len(rest) - 2, 8))}: {rest}"
    names = [printable(mode_name(family, k)) for k in range(len(family.modes))]
    rest = f"{counted(len(names), 'mode')} on {rest}"
    return f"{shorten_list(names, max(TEXT - len(rest) - 2, 30))}: {rest}"


def _family_entries(family: Family, name: str, origins: Mapping[str, str]) -> list[tuple[str, str]]:
    notes = "".join(f"; {note}" for note in family.notes)
    read = origins.get("read", "")
    return [("family", family_text(family, name))] + [("read", (read + notes).removeprefix("; "))] * bool(read or notes)


def _mode_entries(family: Family, components: Sequence[FamilyComponent]) -> Lines:
    """Tell of every mode its edges, what is uncertain, and the structure of its mandatory graph."""
    from ptcc_certify.graphs.structure import analyse

    for number, mode in enumerate(family.modes):
        structure = components[0].structures[number] if len(components) == 1 else analyse(mode.mandatory)
        size = f"{counted(mode.n_edges, 'edge')} ({int((mode.sign < 0).sum()):,} negative)" + "; undirected" * mode.tied
        yield "mode", f"{mode_name(family, number)}: {size}; mandatory edges: {structure_text(structure)}"
        if edges := _uncertain_edges(mode):
            yield "", f"uncertain: {edges}"


def _uncertain_edges(mode: Mode) -> str:
    listed = []
    for edge in np.flatnonzero(~mode.known)[:12].tolist():
        ends = [shorten_label(mode.labels[int(side[edge])]) for side in (mode.source, mode.target)]
        least, largest = (short_number(end) for end in mode.edge_interval(edge))
        listed.append(f"{ends[0]} -> {ends[1]} in [{least}, {largest}]")
    return shorten_list(listed, 4 * TEXT, int((~mode.known).sum()))


def _gains(certificate: FamilyCertificate) -> str:
    p = certificate.protocol
    return f"{p.kind}: " + ", ".join(f"{name}={near(getattr(p, name), 12)}" for name in p.to_dict() if name != "kind")


def _protocol_text(certificate: FamilyCertificate, origins: Mapping[str, str]) -> str:
    begin = "no x(0)" if certificate.initial_state is None else f"x(0) {origins.get('x(0)', 'given')}"
    if certificate.sigma0 is not None:
        begin += f", sigma(0) {'0' if certificate.direct else origins.get('sigma(0)', 'given')}"
    return f"{_gains(certificate)}; {begin}"


# ---------------------------------------------------------------------- what it does


def sharpest(component: FamilyComponent) -> str:
    """Name the sharpest behaviour of a component.

    Examples
    --------
    >>> sharpest(ptcc.decide([("a", "b", 1, 2)])[0])
    'consensus'
    """
    return (str(component.behaviour or "not decided"), *special_behaviours(component))[-1]


def _claim_entries(
    components: Sequence[FamilyComponent],
    when: str = "",
    every: bool = False,
    certificate: FamilyContent | None = None,
) -> Lines:
    """Tell what every component does; where that depends on the signal, why, and what holds all the same."""
    disturbed = certificate is not None and certificate.sigma0 is not None
    direct, boxes = (True, {}) if certificate is None else (certificate.direct, certificate.boxes)
    order = sorted(range(len(components)), key=lambda k: -components[k].nodes.size)
    if len(components) == 1:
        yield "claim", _claim_text(components[0], when, every, disturbed)
    else:
        for place, k in enumerate(order[:_COMPONENTS]):
            text = _claim_text(components[k], when, False, disturbed)
            names = [printable(label) for label in components[k].family.labels[:TEXT]]
            room = max(TEXT - len(text) - 2, 12)
            yield "claim" if not place else "", f"{shorten_list(names, room, components[k].nodes.size)}: {text}"
        if len(components) > _COMPONENTS:
            yield "", f"... {len(components):,} components in all"
    depending = [k for k in order if components[k].behaviour == DEPENDS]
    for k in depending[: len(depending) if every else 1]:
        yield from _depends_entries(components[k], every, direct)
        if k in boxes:
            yield "box", box_text(components[k], boxes[k], 12 * TEXT if every else TEXT)


def _claim_text(component: FamilyComponent, when: str, every: bool, disturbed: bool) -> str:
    if component.behaviour is None:
        return "not decided"
    if component.behaviour == DEPENDS:
        return DEPENDS if component.signal == "any" else "depends on which graph it is"
    whatever = WHATEVER[component.signal].replace("mode and ", "mode and " * (len(component.family.modes) > 1))
    text = f"{sharpest(component)}{when} {whatever}{' and disturbance' * disturbed}"
    sides = [_names(component, side.tolist(), TEXT if every else 20) for side in camps(component)]
    if component.behaviour == STABILITY or len(sides) < 2:
        return text
    longer = f"{text}: camps {' against '.join('{' + side + '}' for side in sides)}"
    return longer if every or len(longer) <= TEXT else text


def _names(component: FamilyComponent, nodes: Sequence[int], width: int) -> str:
    return shorten_list([printable(shorten_label(component.family.labels[v])) for v in nodes], width)


def _depends_entries(component: FamilyComponent, every: bool, direct: bool) -> Lines:
    if component.counterexample is not None:
        yield "why", _cut(printable(counterexample_text(component, component.counterexample)), every)
    family = component.family
    if len(family.modes) > 1:
        alone = (f"{mode_name(family, k)}: {_alone(mode, direct)}" for k, mode in enumerate(family.modes))
        yield "alone", _cut("; ".join(alone), every)
    elif component.signal == "any":
        (constant, *_) = decide(family, "constant")
        behaviour = "it depends on the weights" if constant.behaviour == DEPENDS else sharpest(constant)
        yield "constant", f"where weights never change: {behaviour}"
    if component.signal == "any":
        yield "groups", groups_text(component, direct)


def _alone(mode: Mode, direct: bool) -> str:
    """Tell what a mode does if no other one acts."""
    if not mode.n_edges:
        return RESTS if direct else f"every agent {DRIVEN}"
    components = decide(Family((mode,)))
    if len(components) == 1:
        return sharpest(components[0])
    parts, behaviours = f"{len(components):,} separate parts", {part.behaviour for part in components}
    if behaviours <= {*CHAIN}:
        return f"{of_mode(BIPARTITE_CONTAINMENT, mode)}, in {parts}"
    return f"{parts}, each by itself: {', '.join(dict.fromkeys(map(sharpest, components)))}"


def groups_text(component: FamilyComponent, direct: bool = True) -> str:
    """Tell which agents agree, follow or end at 0 under every signal, where the behaviour depends on it.

    An agent that listens to nobody keeps its value where no sliding variable moves (``direct``). Many such agents, and
    many groups that agree, are counted.

    Examples
    --------
    >>> groups_text(ptcc.decide([(1, 3, 1, 2), (2, 3, 1, 1)])[0])
    '1, 2 keep their value; 3 ends between these, up to signs, or moves there for ever'
    """
    groups = FamilyGroups(component)
    parts = _keeping(component, groups.agreeing, direct) + _agreeing(component, groups.agreeing)
    zero, near = groups.at_zero.tolist(), set(groups.bounded.tolist())
    known = {v for group in groups.agreeing for v in group.nodes.tolist()}.union(zero)
    others = [v for v in range(component.nodes.size) if v not in known]
    followers, free = ([v for v in others if (v in near) == wanted] for wanted in (True, False))
    if zero:
        parts.append(f"{_names(component, zero, _NAMES)} {'end' if len(zero) > 1 else 'ends'} at 0")
    if followers:
        ends, moves = ("end", "move") if len(followers) > 1 else ("ends", "moves")
        names = _names(component, followers, _NAMES)
        parts.append(f"{names} {ends} between these, up to signs, or {moves} there for ever")
    if free:
        parts.append(f"no limit is claimed of {_names(component, free, _NAMES)}")
    return "; ".join(parts)


def _keeping(component: FamilyComponent, groups: Sequence[AgreeingGroup], direct: bool) -> list[str]:
    """Tell of agents that listen to nobody: names of those that nobody agrees with if these are short, else how many.

    Of the many, those count too with whom others agree.
    """
    alone = [int(group.nodes[0]) for group in groups if group.nodes.size == 1]
    if not alone:
        return []
    names = ", ".join(printable(shorten_label(component.family.labels[v])) for v in alone)
    if columns(names) > _NAMES:
        _, target, _ = component.family.union
        names = f"{counted(component.nodes.size - np.unique(target).size, 'agent')} that listen to nobody"
    if direct:
        return [f"{names} {'keeps its value' if len(alone) == 1 else 'keep their value'}"]
    return [f"{names} {DRIVEN if len(alone) == 1 else DRIVEN.replace('ends', 'end')}"]


def _agreeing(component: FamilyComponent, groups: Sequence[AgreeingGroup]) -> list[str]:
    """Tell of groups of two agents or more that agree, of many only how many there are."""
    several = [group for group in groups if group.nodes.size > 1]
    if len(several) > _GROUPS:
        agents = sum(group.nodes.size for group in several)
        camps = ", up to camps" * any((group.camps < 0).any() for group in several)
        return [f"{len(several):,} groups, of {agents:,} agents in all, agree each within itself{camps}"]
    return [
        f"{_names(component, group.nodes.tolist(), _NAMES)} agree{' up to camps' * bool((group.camps < 0).any())}"
        for group in several
    ]


def told_ranges(certificate: FamilyContent) -> dict[int, tuple[Interval, ...]]:
    """Return between which ends every signal keeps agents, of components of which no last mode tells the same."""
    last = certificate.ends_of_signal
    same = {k for k, claim in last.items() if isinstance(claim, LastModeClaim) and claim.final_states is not None}
    return {k: ends for k, ends in certificate.ranges.items() if k not in same}


def range_text(component: FamilyComponent, ends: Sequence[Interval], width: int = 12 * TEXT) -> str:
    """Tell in which intervals every signal keeps all agents of a component at all times.

    Where that takes more columns than ``width``, the interval is told that holds them all.

    Examples
    --------
    >>> foes = Family.from_intervals([("a", "b", -1, 1), ("b", "a", 1, 2)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, -2])
    >>> range_text(cert.parts[0].component, cert.ranges[0])
    'every signal keeps a, b in [-2, 2] at all times'
    """
    groups: dict[str, list[int]] = {}
    for v, own in enumerate(ends):
        groups.setdefault(_interval(own), []).append(v)
    told = ", ".join(f"{_names(component, nodes, _NAMES)} {text}" for text, nodes in groups.items())
    text = f"every signal keeps {told} at all times"
    if columns(text) <= width:
        return text
    whole = _interval((min(low for low, _ in ends), max(high for _, high in ends)))
    return f"every signal keeps {counted(len(ends), 'agent')} {whole} at all times"


def box_text(component: FamilyComponent, box: AttractingBox, width: int = 12 * TEXT) -> str:
    """Tell into which intervals every signal draws followers, whether or not they come to rest, and at what rate.

    Intervals that take more columns than ``width`` are counted, and the one that holds them all is told.

    Examples
    --------
    >>> moved = Family.from_intervals([(1, 3, 1, 3), (2, 3, 1, 1), (1, 4, 1, 1), (2, 4, 1, 4)])
    >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {1: 0, 2: 4, 3: 100, 4: 0})
    >>> box_text(cert.parts[0].component, cert.boxes[0])
    'every signal draws 3 into [1, 2], 4 into [2, 3.2], at the rate 4; no limit is claimed'
    >>> box_text(cert.parts[0].component, cert.boxes[0], 20)
    'every signal draws 2 agents into 2 intervals in all, within [1, 3.2], at the rate 4; no limit is claimed'
    """
    groups: dict[str, list[int]] = {}
    for v, *ends in zip(box.decay.nodes.tolist(), box.lower, box.upper, strict=True):
        text = _interval((ends[0], ends[1])).replace("in [", "into [").replace("at ", "to ")
        groups.setdefault(text, []).append(v)
    told = ", ".join(f"{_names(component, nodes, _NAMES)} {text}" for text, nodes in groups.items())
    if columns(told) > width:
        hull = _interval((min(box.lower), max(box.upper))).removeprefix("in ")
        told = f"{counted(len(box.lower), 'agent')} into {len(groups):,} intervals in all, within {hull}"
    return f"every signal draws {told}, at the rate {down(2 * box.decay.rate)}; no limit is claimed"


def _cut(text: str, every: bool) -> str:
    lines = wrap_text(text)
    if every or len(lines) <= _LINES:
        return text
    more = "... (all with -v)"
    (last, *_) = wrap_text(lines[_LINES - 1], TEXT - len(more) - 1)
    return " ".join([*lines[: _LINES - 1], last, more])


# ---------------------------------------------------------------------- what is proved


def _rate_entries(certificate: FamilyCertificate) -> Lines:
    """Tell the proved rate, its upper bound and their ratio; where no rate was found, the one in closed form."""
    if not certificate.common or all(part.component.nodes.size == 1 for part in certificate.parts):
        return
    rate, bound = certificate.rate, certificate.upper_bound
    limit = "" if bound is None else f"upper bound {up(bound)}"
    if rate is not None and _is_refused(certificate):
        yield (
            "rate",
            "none is proved: the independent check does not accept what was found" + f"; {limit}" * bool(limit),
        )
        return
    if rate is not None:
        ratio = "" if bound is None else f": both proved, ratio {down(rate / bound)}"
        which = f"{down(rate)}{_every(certificate)}"
        yield "rate", f"{which}, {limit}{ratio}" if limit else f"{which}, proved"
        return
    why = f" ({_no_search(certificate)})".replace(" ()", "")
    explicit = [explicit_rate(part.component) for part in certificate.parts]
    logs = [one.log10_decay_rate for one in explicit if one is not None]
    if logs and len(logs) == sum(part.component.nodes.size > 1 for part in certificate.parts):
        power = int(min(logs)) - 1
        least = TOO_SMALL if power < TINY else f"above 1e{power}"
        yield "rate", f"{least}, in closed form; no larger one was proved{why}" + f"; {limit}" * bool(limit)
    else:
        yield "rate", f"there is one, but none was proved{why}" + f"; {limit}" * bool(limit)


def _no_search(certificate: FamilyCertificate) -> str:
    """Tell why no rate was proved: too many agents for a search, or too little time; nothing where it is not known."""
    from ptcc_certify.lyapunov.family_search import CLOSED_ROWS, TOO_MANY_ROWS

    without = [part.component for part in certificate.parts if part.component.nodes.size > 1 and not part.rate]
    largest = max(without, key=lambda component: component.nodes.size, default=None)
    late = any("cut off" in note for note in certificate.notes)
    if largest is not None and largest.behaviour != STABILITY:
        most = CLOSED_ROWS if largest.behaviour == BIPARTITE_CONSENSUS else EXACT_NODES
        if largest.nodes.size > most:
            return f"{largest.nodes.size:,} agents are above the {most:,} of the searches"
    if large := next((note for note in certificate.notes if TOO_MANY_ROWS in note), ""):
        return large
    if largest is not None and largest.nodes.size > EXACT_NODES and not late:
        return f"closed forms of {largest.nodes.size:,} agents prove none"
    return "the searches took too long; raise --time-limit" * late


def _function_entries(certificate: FamilyCertificate) -> Lines:
    for part in certificate.parts:
        names = [mode_name(certificate.family, k) for k in range(len(certificate.family.modes))]
        for V in part.functions:
            own = getattr(V, "rates", ()) if len(names) > 1 else ()  # functions of rows have one rate
            rates = ", ".join(f"{name} {down(rate)}" for name, rate in zip(names, own, strict=False))
            alone = f"; of each mode: {rates}" * bool(own)
            yield "function", f"{V.kind}: decay rate {down(V.rate) if V.rate > 0 else 0}{alone}"
        if part.upper_bound is not None:
            modes = dict.fromkeys(names[member.mode] for member in part.upper_bound.members)
            what = BOUND_KINDS[part.upper_bound.kind] + f": {', '.join(modes)}" * (len(names) > 1)
            yield "bound", f"decay rate at most {up(part.upper_bound.value)}, proved by {what}"


def _interval(ends: tuple[Fraction, Fraction] | None) -> str:
    if ends is None:
        return "no limit is claimed"
    low, high = ends
    return f"at {short_number(low)}" if low == high else f"in [{down(low, 5)}, {up(high, 5)}]"


def _is_refused(certificate: FamilyCertificate) -> bool:
    """Tell whether the check does not accept the functions that were found: nothing that follows from them is told."""
    return certificate.verdict != "certified" and any(part.functions for part in certificate.parts)


def _final_entries(certificate: FamilyCertificate, long: bool = False) -> Lines:
    """Tell between which ends every agent is at the deadline, agents with the same ends together."""
    if _is_refused(certificate):
        return
    if certificate.final_states is not None and certificate.common:
        width = 12 * TEXT if long else 2 * TEXT - 20
        states = _interval_entries(certificate.family.labels, certificate.final_states, width)
        yield from ((name, f"{text}{_every(certificate)}") for name, text in states)
    elif certificate.final_states is not None and any(ends is not None for ends in last_states(certificate)):
        width = 12 * TEXT if long else 2 * TEXT - 20
        ends = _interval_entries(certificate.family.labels, states_of_signal(certificate), width)
        what = "x(T)" if rests(certificate) else "x(t)"
        agree = agreement_text(certificate)
        yield from ((name and what, f"{text}{agree} (these signals)") for name, text in ends)
    if text := constant_text(certificate, 12 * TEXT if long else 2 * TEXT - 20):
        yield "" if certificate.common else "x(T)", f"{text} (constant weights)"
    ranges = [*told_ranges(certificate).items()]
    for k, kept in ranges if long else ranges[:1]:
        yield "x(t)", range_text(certificate.parts[k].component, kept, 12 * TEXT if long else TEXT)


def constant_text(certificate: FamilyContent, width: int = 12 * TEXT) -> str:
    """Tell between which ends agents are at the deadline if mode and weights never change; "" if that says no more.

    Of agents whose end depends on the signal nothing is told here.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    >>> constant_text(certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [0, 6], signal="constant"))
    'every agent in [2, 3]'
    """
    columns = certificate.family.labels, constant_states(certificate), certificate.final_states or ()
    rows = [row for row in zip(*columns, strict=False) if None not in row]
    if all(_interval(own) == _interval(every) for _, own, every in rows):
        return ""
    ((_, text),) = _interval_entries([label for label, *_ in rows], [own for _, own, _ in rows], width)
    whole = len(rows) == certificate.family.n_nodes
    return text if whole else text.replace("every agent", shorten_list([label for label, *_ in rows], 4 * TEXT), 1)


def _interval_entries(labels: Sequence[str], states: Sequence[tuple[Fraction, Fraction] | None], width: int) -> Lines:
    groups: dict[str, list[str]] = {}
    for label, ends in zip(labels, states, strict=True):
        groups.setdefault(_interval(ends), []).append(printable(shorten_label(label)))
    if len(groups) == 1 < len(states):
        yield "x(T)", f"every agent {next(iter(groups))}"
        return
    texts = [f"{shorten_list(names, 24 if width < 4 * TEXT else 4 * TEXT)} {ends}" for ends, names in groups.items()]
    yield "x(T)", shorten_list(texts, width)


def _error_entries(certificate: FamilyCertificate, long: bool = False) -> Lines:
    """Tell how near the agents are to their final states by when, for every signal and those that were asked for."""
    from ptcc_certify.certificate.restricted_bounds import deviation_of_signal, nearer_for_signal  # slow to load

    if certificate.initial_state is None or _is_refused(certificate):
        return
    if certificate.common and certificate.rate is not None:
        yield "error", _error_text(certificate, certificate.deviation_bound, long) + _every(certificate)
    if nearer_for_signal(certificate):
        nearer = _error_text(certificate, partial(deviation_of_signal, certificate), long)
        if certificate.rate is None or nearer != _error_text(certificate, certificate.deviation_bound, long):
            again = nearer if certificate.rate is None else nearer.removesuffix(" of its final state")
            yield "error" if certificate.rate is None else "", f"{again} (these signals)"


def _error_text(certificate: FamilyCertificate, bound: Callable[[list[float]], np.ndarray], long: bool) -> str:
    instants = told_instants(certificate.protocol, certificate.direct)[:4]
    if not long:
        left, when = instants[SHORT]
        when += ", numerical" * (not certificate.direct)
        return f"at {when}: every agent within {up(float(bound([left]).max()), 2)} of its final state"
    bounds = bound([remaining for remaining, _ in instants]).max(axis=0)
    texts = (f"{up(float(most), 2)} at {when}" for (_, when), most in zip(instants, bounds, strict=True))
    numerical = "" if certificate.direct else " (numerical)"
    return f"every agent is within so much of its final state{numerical}: {', '.join(texts)}"


def _input_entries(certificate: FamilyCertificate, long: bool = False) -> Lines:
    if any(part.component.behaviour is None for part in certificate.parts):
        return
    if not certificate.bounded or _is_refused(certificate):
        if not certificate.common:
            yield "INPUT", f"no bound for all signals and x(0): a switch near T may meet any gain{_every(certificate)}"
        elif certificate.unbounded:
            yield "INPUT", "NOT BOUNDED for some signal from some initial states"
        else:
            yield "input", f"not proved bounded{_every(certificate)}"
        return
    peaks, labels = certificate.input_peaks, certificate.family.labels
    if peaks is None and certificate.sliding_bounded is False:
        known = certificate.sliding_peaks is not None
        whole = (
            "bounded while sigma(0) = 0"
            if known
            else "the nominal part is bounded, of the sliding part nothing is proved"
        )
        yield "input", whole
        return
    yield from _peak_entries(labels, peaks or (), _every(certificate))
    if long and peaks is not None:
        each = [f"{shorten_label(label)} {up(peak, 4)}" for label, peak in zip(labels, peaks, strict=True)]
        yield "", f"|u_k| <= {shorten_list(each, 4 * TEXT)}"


def _every(certificate: FamilyCertificate) -> str:
    """Tell apart what holds for every signal where more is claimed of some."""
    return "" if certificate.signal == "any" else " (every signal)"


def _peak_entries(labels: Sequence[str], peaks: Sequence[Fraction], every: str) -> Lines:
    if not peaks:
        yield "input", "bounded for every signal and every initial state"
        return
    largest = max(peaks)
    agent = shorten_label(labels[peaks.index(largest)], 22)
    yield "input", f"bounded; |u_k| <= {up(largest, 4)}, the largest of agent {agent}{every}"


def _proof_text(certificate: FamilyCertificate) -> str:
    report = certificate.checked
    if report is None:
        return "nothing to check"
    return report.lines()[-1]


def _verdict(certificate: FamilyCertificate) -> str:
    assessment = certificate.assessment
    if assessment.verdict != "certified":
        return assessment.text
    certified = assessment.certified_part + ", but says little by T" * (assessment.useful is False)
    plain = assessment.useful is not False and not assessment.answers and not assessment.caveat
    return assessment.line(certified, "checked without a solver" * plain, assessment.caveat, assessment.advice)
