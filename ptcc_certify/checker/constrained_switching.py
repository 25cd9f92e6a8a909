"""Verifies what is claimed of a family for restricted signals: dwell times, windows, nothing that ever changes.

Section 19 of the format, "Restricted signals". In mode ``i`` the value ``xi' P_i xi`` decays at the rate ``b_i`` for
all members, and at a switch ``P_j <= ratio P_i`` bounds what it becomes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from lmi.exact.decimal_rounding import down
from lmi.exact.definite import Arithmetic
from lmi.exact.elementary_enclosures import exp, log
from lmi.exact.work import spend
from ptcc_certify.checker.common_forms import rates_of_modes
from ptcc_certify.checker.common_kernel_ends import Mean, check_mean
from ptcc_certify.checker.constant_signal_ends import FinalValueSection, check_final_value, fitting_camps
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import CONSENSUS, CONTAINMENT, INTERVAL, STABILITY, Component, Family
from ptcc_certify.checker.graph import ordered, positions
from ptcc_certify.checker.matrix_products import Matrix, combined
from ptcc_certify.checker.protocol import Begin, Protocol
from ptcc_certify.checker.reading import Interval, need
from ptcc_certify.checker.row_functions import Function
from ptcc_certify.checker.section_declarations import Ball, Nodes, NotNegative, Positive, Several, Some, Triangle
from ptcc_certify.checker.structure import Behaviour

#: Claims that are read.
MANY_CLAIMS = 100
#: Products of short integers that an edge of a claim costs, about.
EACH_EDGE = 100
#: Longest ratio, in bits, of which the logarithm is enclosed.
RATIO_BITS = 4000

Form = tuple[Matrix, int]


@dataclass(frozen=True, kw_only=True)
class Dwell:
    """A dwell time of modes, on a clock."""

    dwell: Positive
    clock: Literal["t", "s"]


@dataclass(frozen=True, kw_only=True)
class Windows:
    """In every window every edge that may be on is on for some time."""

    window: Positive
    on: Positive


@dataclass(frozen=True, kw_only=True)
class Shares:
    """Shares of the clock that modes have."""

    shares: Several[NotNegative]


@dataclass(frozen=True, kw_only=True)
class RateSection:
    """A rate for restricted signals."""

    claim: Literal["rate"]
    signals: Dwell | Literal["constant"]
    component: int
    forms: Several[Triangle] | None = None
    ratio: Fraction
    rate: Fraction
    bounded: bool | None = None


@dataclass(frozen=True, kw_only=True)
class LastModeSection:
    """What each mode does where it is the last one, and where the agents end."""

    claim: Literal["last mode"]
    signals: Dwell | Literal["constant"]
    component: int
    modes: Several[Behaviour | None]
    final_state: Some[Ball] | None = None


@dataclass(frozen=True, kw_only=True)
class WindowsSection:
    """What joint windows do."""

    claim: Literal["windows"]
    signals: Windows
    component: int
    behaviour: Behaviour
    eta: Positive
    final_state: Some[Ball] | None = None


@dataclass(frozen=True, kw_only=True)
class SharesSection:
    """What shares of the clock do; ``final_state`` where it is told."""

    claim: Literal["shares"]
    signals: Shares
    component: int
    nodes: Nodes
    form: Triangle
    rate: Fraction
    behaviour: Behaviour | None = None
    final_state: Some[Ball] | None = None


@dataclass(frozen=True, kw_only=True)
class KeptMean:
    """A mean that is kept: weights of agents, or that all are equal up to camps."""

    mean: Mean


Section = RateSection | LastModeSection | WindowsSection | SharesSection | FinalValueSection


def check_restricted(
    doc: Document,
    family: Family,
    functions: Sequence[Function],
    protocol: Protocol,
    begin: Begin,
) -> None:
    """Verify every claim for restricted signals."""
    if "restricted" not in doc:
        return
    items: Sequence[Section] = doc.section("restricted")
    need(0 < len(items) <= MANY_CLAIMS, f"no claim for restricted signals, or more than {MANY_CLAIMS}")
    gains, x = protocol.gains, None if begin.state is None else list(begin.state)
    need(not (begin.sigma and any(begin.sigma)), "restricted signals while sliding variables move")
    need(all(entry.signals == items[0].signals for entry in items), "claims about different signals")
    for k, entry in enumerate(items):
        doc.at = of = f"restricted[{k}]"
        component = family.component(entry.component)
        if isinstance(entry, FinalValueSection):
            check_final_value(doc, family, component, x, entry, of)
            continue
        need(not protocol.sliding, "restricted signals under the sliding-mode protocol")
        if isinstance(entry, RateSection):
            _check_rate(doc, family, functions, gains, entry, of)
        elif isinstance(entry, LastModeSection):
            _check_last_mode(doc, family, x, entry, of)
        elif isinstance(entry, WindowsSection):
            _check_windows(doc, family, x, entry, of)
        else:
            _check_shares(doc, family, x, entry, of)


def _check_rate(
    doc: Document,
    family: Family,
    functions: Sequence[Function],
    gains: dict[str, Fraction],
    entry: RateSection,
    of: str,
) -> None:
    component, dwell = family.component(entry.component), entry.signals
    need(not component.depends and len(component.nodes) > 1, "a rate where nothing, or no common kernel, decays")
    ratio, rate = entry.ratio, entry.rate
    forms: list[Form] = []
    if entry.forms is None:
        own = [V.rate for V in functions if V.component is component]
        need(bool(own), "no function of this component")
        most = max(own)
    else:
        forms, rates = _forms(doc, family, component, entry.forms, of)
        most = min(rates)
    doc.open("restricted-rate", of)
    need(ratio >= 1 and (bool(forms and isinstance(dwell, Dwell)) or ratio == 1), "the ratio is not 1, or less")
    if isinstance(dwell, Dwell):
        _check_ratio(doc.exact, forms, ratio)
        if dwell.clock == "s" and ratio > 1:
            need(max(map(int.bit_length, ratio.as_integer_ratio())) <= RATIO_BITS, "a ratio that is too long")
            most -= log(ratio)[1] / dwell.dwell
    need(rate <= most, "the rate is not proved")
    enough = rate * gains["rho2"] * gains["kappa"] >= 2
    need(entry.bounded is (True if enough else None), "whether the input is bounded")
    doc.done(f"rate {down(rate)}" if rate > 0 else "nothing decays")


def _forms(
    doc: Document, family: Family, component: Component, section: Sequence[Sequence[Sequence[Fraction]]], of: str
) -> tuple[list[Form], list[Fraction]]:
    """Verify the forms of all modes with their rates."""
    pivots = set(component.pivots.values())
    nodes = [v for v in component.nodes if v not in pivots]
    need(bool(nodes), "a form of no agents")
    need(len(section) == len(family.modes), f"forms has not {len(family.modes)} entries")
    forms, rates = [], []
    for form, _, b in rates_of_modes(doc, family, component, nodes, section, of):
        forms.append(form)
        rates.append(b)
        doc.done(f"b = {down(b)}")
    return forms, rates


def _check_ratio(judge: Arithmetic, forms: Sequence[Form], ratio: Fraction) -> None:
    """Verify ``P_j <= ratio P_i`` for all pairs of forms."""
    p, q = ratio.as_integer_ratio()
    distinct: list[Form] = []
    for form in forms:
        if form not in distinct:
            distinct.append(form)
    for i, (P, unit) in enumerate(distinct):
        for j, (Q, scale) in enumerate(distinct):
            if i != j:
                S = combined("the ratio of forms", (p * scale, P), (-q * unit, Q))
                need(judge.definite(S), "the ratio of two forms is not proved")


# ---------------------------------------------------------------------- the last mode


def reachable_bounds(
    nodes: Sequence[int], edges: Iterable[tuple[int, int, int]], x: Sequence[Fraction]
) -> dict[int, Interval]:
    """Bound ``x_k(t)`` for every node and all times, under every signal.

    ``+-x_l(0)`` reaches ``k`` with the sign of a path of edges of any modes; the largest that reaches it, also from
    itself, is an upper bound of ``x_k``: in the graph with a node for each sign, no largest value of a set that hears
    nobody else ever grows.

    Examples
    --------
    >>> reachable_bounds([0, 1, 2], [(0, 1, -1), (1, 0, -1), (2, 2, 1)], [1, 2, 5])
    {0: (-2, 1), 1: (-1, 2), 2: (5, 5)}
    """
    out: dict[int, list[tuple[int, int]]] = {v: [] for v in nodes}
    for s, t, sign in edges:
        out[s].append((t, sign))
    best: dict[tuple[int, int], Fraction] = {}
    for value, v, side in sorted(((side * x[v], v, side) for v in nodes for side in (1, -1)), reverse=True):
        found = [(v, side)] if (v, side) not in best else []
        best.update(dict.fromkeys(found, value))
        for u, own in found:
            for w, sign in out[u]:
                if (w, own * sign) not in best:
                    best[w, own * sign] = value
                    found.append((w, own * sign))
    return {v: (-best[v, -1], best[v, 1]) for v in nodes}


def mode_behaviour(family: Family, number: int, component: Component) -> str | None:
    """Return what a mode does to a component where it acts for ever, its weights changing; None if that is not told."""
    structure, edges = family.modes[number].structure, component.part.edges[number]
    closed = component.part.closed[number]
    if not any(structure.gauges[k] is not None for k in closed):
        return STABILITY
    if len(closed) == 1 and fitting_camps(component.nodes, edges) is not None:
        return CONSENSUS
    if any(low < high for _, _, _, low, high in edges):
        return None
    return INTERVAL if len(closed) == 1 else CONTAINMENT


def _check_last_mode(
    doc: Document, family: Family, x: Sequence[Fraction] | None, entry: LastModeSection, of: str
) -> None:
    """Verify what each mode does to a component where it is the last one, and where the agents end."""
    component, dwell = family.component(entry.component), entry.signals
    need(component.depends, "every signal does the same")
    need(not isinstance(dwell, Dwell) or dwell.clock == "t", "modes that may change for ever")
    doc.open("last-mode", of)
    spend(EACH_EDGE * sum(1 + len(edges) for edges in component.part.edges), what="restricted signals")
    known = [mode_behaviour(family, k, component) for k in range(len(family.modes))]
    need(entry.modes == known, "another behaviour of a mode")
    section = entry.final_state
    need((section is None) == (x is None), "final states are claimed iff there is an initial state")
    if x is not None:
        edges = {edge[:3] for some in component.part.edges for edge in some}
        bounds = reachable_bounds(component.nodes, edges, x)
        _check_intervals(family, component, section, bounds)
    doc.done(", ".join(dict.fromkeys(str(b or "not told") for b in known)))


# ---------------------------------------------------------------------- windows


def closed_groups(nodes: Sequence[int], edges: Iterable[tuple[int, int, int]]) -> list[tuple[list[int], bool]]:
    """Return the closed strong components of a graph, each with whether it is balanced; a pair may have both signs.

    In each there is one node that no node before reaches. It is among the first ones that are reached from nobody
    before; and of these, whoever is in no such component is reached from one that is, which comes later.

    Examples
    --------
    >>> closed_groups([0, 1, 2], [(0, 1, 1), (1, 0, -1), (1, 2, 1)]), closed_groups([3, 5], [(5, 3, 1), (5, 3, -1)])
    ([([0, 1], False)], [([5], True)])
    """
    out: dict[int, list[int]] = {v: [] for v in nodes}
    into: dict[int, list[tuple[int, int]]] = {v: [] for v in nodes}
    for s, t, sign in edges:
        out[s].append(t)
        into[t].append((s, sign))
    first, reached = list[int](), set[int]()
    for v in nodes:
        if v not in reached:
            first.append(v)
            _reach(out, v, reached)
    groups, reached = [], set()
    for root in reversed(first):
        if root in reached:
            continue
        _reach(out, root, reached)
        camp, found, balanced = {root: 1}, [root], True
        for v in found:
            for u, sign in into[v]:
                if u not in camp:
                    camp[u] = sign * camp[v]
                    found.append(u)
                balanced &= camp[u] == sign * camp[v]
        groups.append((sorted(found), balanced))
    return groups


def _reach(out: Mapping[int, Sequence[int]], root: int, reached: set[int]) -> None:
    """Add to some nodes all that are reached from a root."""
    ahead = [root]
    reached.add(root)
    for v in ahead:
        for u in out[v]:
            if u not in reached:
                reached.add(u)
                ahead.append(u)


def contraction_below(largest: Fraction, least: Fraction, window: Fraction, on: Fraction) -> Fraction:
    """Return ``e^(-D h) min(1, on w)``, or a little less: 0 where it is below ``e^-100,000``.

    Examples
    --------
    >>> round(float(contraction_below(Fraction(1), Fraction(1), Fraction(1), Fraction(1, 2))), 6)
    0.18394
    """
    return exp(-largest * window)[0] * min(Fraction(1), on * least)


def _check_windows(doc: Document, family: Family, x: Sequence[Fraction] | None, entry: WindowsSection, of: str) -> None:
    """Verify what joint windows do, and the contraction in as many as there are nodes."""
    component = family.component(entry.component)
    window, on, eta = entry.signals.window, entry.signals.on, entry.eta
    need(on <= window, "a window, or the part of it in which an edge is on")
    need(component.depends, "every signal does the same")
    doc.open("joint-windows", of)
    spend(EACH_EDGE * sum(1 + len(edges) for edges in component.part.edges), what="restricted signals")
    part, sums = component.part, [Fraction(0)]
    weights = []
    for edges, mode in zip(part.edges, family.modes, strict=True):
        total = dict.fromkeys(component.nodes, 0)
        for _, t, _, low, high in edges:
            total[t] += high
            if low > 0:
                weights.append(Fraction(low, mode.unit))
        sums.append(Fraction(max(total.values()), mode.unit))
    on_edges = {edge[:3] for edges in part.edges for edge in edges if edge[3]}
    groups = closed_groups(component.nodes, on_edges)
    consensus = part.camps is not None and len(groups) == 1
    need(consensus or not any(balanced for _, balanced in groups), "nothing follows from these windows")
    need(entry.behaviour == (CONSENSUS if consensus else STABILITY), "another behaviour")
    need(eta <= contraction_below(max(sums), min(weights), window, on), "the contraction is not proved")
    section = entry.final_state
    need((section is None) == (x is None), "final states are claimed iff there is an initial state")
    if x is not None:
        every = {edge[:3] for edges in part.edges for edge in edges}
        bounds = agreed_bounds(component.nodes, every, x, part.camps if consensus else None)
        _check_intervals(family, component, section, bounds)
    doc.done(entry.behaviour)


def agreed_bounds(
    nodes: Sequence[int], edges: Iterable[tuple[int, int, int]], x: Sequence[Fraction], camps: Mapping[int, int] | None
) -> dict[int, Interval]:
    """Return ends of agents that end at 0 (no camps), or at one value up to camps, within all their bounds.

    Examples
    --------
    >>> agreed_bounds([0, 1], [(0, 1, -1)], [3, 5], {0: 1, 1: -1})
    {0: (3, 3), 1: (-3, -3)}
    """
    if camps is None:
        return dict.fromkeys(nodes, (Fraction(0), Fraction(0)))
    bounds = reachable_bounds(nodes, edges, x)
    ends = [bounds[v] if camps[v] > 0 else (-bounds[v][1], -bounds[v][0]) for v in nodes]
    low, high = max(low for low, _ in ends), min(high for _, high in ends)
    return {v: (low, high) if camps[v] > 0 else (-high, -low) for v in nodes}


def _check_intervals(
    family: Family, component: Component, section: Mapping[str, Interval] | None, bounds: Mapping[int, Interval]
) -> None:
    labels = [family.labels[v] for v in component.nodes]
    for v, end in zip(component.nodes, ordered(labels, section, "final_state").values(), strict=True):
        middle, radius = end
        low, high = bounds[v]
        need(middle - radius <= low and high <= middle + radius, "a final state is not enclosed")


# ---------------------------------------------------------------------- shares of the clock


def _check_shares(doc: Document, family: Family, x: Sequence[Fraction] | None, entry: SharesSection, of: str) -> None:
    """Verify one form for all modes, of which each has a rate of its own, and the mean of these rates."""
    told, shares = entry.final_state is not None, entry.signals.shares
    part = family.component(entry.component).part
    need(len(shares) == len(family.modes) and sum(shares) == 1, "shares of the modes")
    nodes = positions(doc, family.modes[0].structure.graph, entry.nodes, "nodes of a form")
    pivots = [v for v in part.nodes if v not in set(nodes)]
    need(bool(nodes) and set(nodes) <= set(part.nodes) and nodes == sorted(set(nodes)), "nodes of a form")
    if pivots:
        need(len(pivots) == 1 and part.camps is not None, "states at rest that no camps tell")
        camps = part.camps or {}
        kernel = {v: {1: Fraction(camps[v] * camps[pivots[0]])} for v in part.nodes}
        common = Component(part, CONSENSUS, kernel, {1: pivots[0]})
    else:
        common = Component(part, STABILITY, {v: {} for v in part.nodes}, {})
    mean = Fraction(0)
    for share, (_, _, b) in zip(shares, rates_of_modes(doc, family, common, nodes, [entry.form], of), strict=True):
        mean += share * b
        doc.done(f"b = {down(b)}" if b > 0 else "nothing decays")
    witness: KeptMean | None = doc.open("clock-shares", of)["witness"]
    need(told or witness is None, "a witness that nothing asks for")
    rate = entry.rate
    need(rate <= mean, "the rate is not proved")
    need(entry.behaviour == (common.behaviour if rate > 0 else None), "another behaviour")
    if told:
        need(x is not None and rate > 0, "a final state where none is known")
        _check_share_ends(doc, family, common, x or [], entry.final_state, witness)
    doc.done(f"rate {down(rate)}" if rate > 0 else "nothing decays")


def _check_share_ends(
    doc: Document,
    family: Family,
    common: Component,
    x: Sequence[Fraction],
    section: Mapping[str, Interval] | None,
    witness: KeptMean | None,
) -> None:
    """Verify where agents end: at 0, at one value up to camps that a kept mean tells, or within all their bounds."""
    part = common.part
    spend(EACH_EDGE * sum(1 + len(edges) for edges in part.edges), what="restricted signals")
    if witness is None:
        every = {edge[:3] for edges in part.edges for edge in edges}
        bounds = agreed_bounds(part.nodes, every, x, part.camps if common.behaviour == CONSENSUS else None)
    else:
        need(common.behaviour == CONSENSUS, "a mean of agents that end at 0")
        value = check_mean(family, common, part.nodes, 1, witness.mean, x)
        bounds = {v: (row[1] * value, row[1] * value) for v, row in common.kernel.items()}
    _check_intervals(family, common, section, bounds)
