"""Bounds of a family for every signal: where each agent ends, and how large its input gets; proved and verified here.

With ``V <= e^(-r s) V(0)`` and ``|(L X)_k|^2 <= c_k V`` for every member, for every signal

    |u_k| <= gain sqrt(c_k V(0)) e^(-r s / 2),      |x_k(t) - x_k(T)| <= (2/r) sqrt(c_k V(0)) e^(-r s / 2)

and ``r rho2 kappa >= 2`` makes the first largest at ``t = 0``. Sliding variables that are not 0 at first drive the
agents besides: then all this is said of ``y = x - sigma``, with what :mod:`~ptcc_certify.checker.family_sliding` adds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Protocol

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.work import spend
from ptcc_certify.checker.family import CONSENSUS, STABILITY, Component, Family
from ptcc_certify.checker.family_rows import Function as VerifiedFunction
from ptcc_certify.checker.family_sliding import Drive, Sizes, nominal_gain
from ptcc_certify.checker.graph import ordered
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.protocol import Begin, check_sliding_part, sliding_part
from ptcc_certify.checker.protocol import Protocol as Parameters
from ptcc_certify.checker.reading import Interval, RejectedError, exact, fields, interval, need

Gains = Mapping[str, Fraction]
#: Products of short integers that a root costs, about.
EACH_ROOT = 300


class Function(Protocol):
    """What a Lyapunov function says, by node: see :class:`~ptcc_certify.checker.family_function.FamilyFunction`."""

    @property
    def rate(self) -> Fraction:
        """The proved rate."""

    @property
    def inputs(self) -> Mapping[int, Fraction]:
        """Constants of inputs."""

    @property
    def coordinates(self) -> Mapping[int, Fraction]:
        """Constants of coordinates."""

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of a state."""

    def largest(self, sizes: Sizes) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``."""


def deviations(
    functions: Iterable[Function], stable: bool, x: Sequence[Fraction], drive: Drive | None = None
) -> dict[int, Fraction]:
    """Bound ``|x_k(0) - x_k(T)|`` by functions of one component; empty if none decays.

    Where sliding variables move, ``x`` is ``y(0)``, and it is ``|y_k(0) - x_k(T)|``.
    """
    least: dict[int, Fraction] = {}
    for V in functions:
        if V.rate <= 0:
            continue
        spend(EACH_ROOT * len(V.inputs), what="bounds of many agents")
        value = rounded(V.value(x), BITS, up=True)
        if drive is not None:
            total = drive.sum(V, root_above(value))
            bounds = {k: drive.end(k, total, root_above(c)) for k, c in V.inputs.items()}
            least = {k: min(bound, least.get(k, bound)) for k, bound in bounds.items()}
            continue
        bounds = {k: 2 * root_above(c * value) / V.rate for k, c in V.inputs.items()}
        for k, c in V.coordinates.items() if stable else ():
            bounds[k] = min(bounds[k], root_above(c * value))
        least = {k: min(bound, least.get(k, bound)) for k, bound in bounds.items()}
    return least


def final_interval(
    nodes: Sequence[int],
    camps: Mapping[int, int],
    deciding: Iterable[int],
    moves: Mapping[int, Fraction],
    x: Sequence[Fraction],
    drive: Drive | None = None,
) -> dict[int, Interval]:
    """Return ends of ``x_k(T)`` of a component that comes to consensus, from the deciding nodes and all deviations."""
    values = [camps[k] * x[k] for k in deciding]
    low, high = min(values), max(values)
    if drive is not None:
        reach = max(drive.pulls[k] for k in deciding) * drive.integral
        added = [camps[k] * drive.sigma0[k] for k in deciding]
        first, zero = [y + s for y, s in zip(values, added, strict=True)], Fraction(0)
        down, up = (sum((max(sign * s, zero) for s in added), zero) for sign in (1, -1))
        low, high = max(low - reach, min(first) - down), min(high + reach, max(first) + up)
    for k, d in moves.items():
        low, high = max(low, camps[k] * x[k] - d), min(high, camps[k] * x[k] + d)
    return {k: (low, high) if camps[k] > 0 else (-high, -low) for k in nodes}


def largest_state(nodes: Sequence[int], x: Sequence[Fraction], drive: Drive | None) -> Fraction:
    """Bound all ``|x_k(T)|`` of a component, from ``x(0)``, or from ``y(0)`` where sliding variables move."""
    largest = max(abs(x[k]) for k in nodes)
    if drive is None:
        return largest
    sigma = [drive.sigma0[k] for k in nodes]
    first = max(abs(x[k] + s) for k, s in zip(nodes, sigma, strict=True))
    return min(largest + max(drive.pulls[k] for k in nodes) * drive.integral, first + sum(map(abs, sigma)))


def peaks(
    functions: Iterable[Function], gains: Gains, x: Sequence[Fraction], drive: Drive | None = None
) -> dict[int, Fraction]:
    """Bound ``gain |(L x)_k|`` for all times by functions of one component with ``rate rho2 kappa >= 2``.

    Empty if none has; where sliding variables move, ``x`` is ``y(0)``.
    """
    gain = nominal_gain(gains)
    first, least = gain.value(Fraction(1)), dict[int, Fraction]()
    for V in functions:
        if V.rate * gain.k >= 2:
            spend(EACH_ROOT * len(V.inputs), what="bounds of many agents")
            value = rounded(V.value(x), BITS, up=True)
            if drive is None:
                bounds = {k: first * root_above(c * value) for k, c in V.inputs.items()}
            else:
                most, own = drive.peak(V, root_above(value)), drive.largest
                bounds = {k: root_above(c) * most + drive.pulls[k] * own for k, c in V.inputs.items()}
            least = {k: min(bound, least.get(k, bound)) for k, bound in bounds.items()}
    return least


def deciding_nodes(family: Family, component: Component) -> list[int]:
    """Return the nodes that may have a say in the consensus: what reaches a closed component through any edges."""
    part = component.part
    heard: dict[int, set[int]] = {v: set() for v in part.nodes}
    pairs = zip(family.modes, part.closed, strict=True)
    found = [v for mode, numbers in pairs for k in numbers for v in mode.structure.closed[k]]
    for edges in part.edges:
        for s, t, _, _, _ in edges:
            heard[t].add(s)
    seen = set(found)
    for v in found:
        new = heard[v] - seen
        seen |= new
        found.extend(new)
    return sorted(seen)


def final_states(
    family: Family, component: Component, functions: Sequence[Function], x: Sequence[Fraction], drive: Drive | None
) -> dict[int, Interval | None]:
    """Return the ends between which every agent of a component is at the deadline; None: no limit is claimed."""
    zero = Fraction(0)
    if component.behaviour == STABILITY:
        return dict.fromkeys(component.nodes, (zero, zero))
    if component.depends:
        return dict.fromkeys(component.nodes)
    moves = deviations(functions, False, x, drive)
    if component.behaviour == CONSENSUS:
        camps = component.part.camps or {}
        return dict(final_interval(component.nodes, camps, deciding_nodes(family, component), moves, x, drive))
    largest = largest_state(component.nodes, x, drive)
    result: dict[int, Interval | None] = {}
    for k in component.nodes:
        d = moves.get(k, 2 * largest + abs(x[k]))
        result[k] = max(-largest, x[k] - d), min(largest, x[k] + d)
    return result


# ---------------------------------------------------------------------- the check


def check_family_bounds(
    doc: Document,
    family: Family,
    functions: Sequence[VerifiedFunction],
    protocol: Parameters,
    begin: Begin,
    drive: Drive | None,
) -> None:
    """Verify final states and inputs."""
    labels, x = family.labels, None if begin.state is None else list(begin.state)
    if x is not None and drive is not None:
        x = [value - drive.sigma0[v] for v, value in enumerate(x)]
    final = doc.section("final_state")
    need((final is None) == (x is None), "final states are claimed iff there is an initial state")
    if x is not None:
        doc.open("family-final-state", "final_state")
        known: dict[int, Interval | None] = {}
        for component in family.components:
            known |= final_states(family, component, [V for V in functions if V.component is component], x, drive)
        for v, entry in enumerate(ordered(labels, final, "final_state").values()):
            need((known[v] is None) == (entry is None), "a final state that is not claimed, or one that is")
            if (ends := known[v]) is not None:
                middle, radius = interval(entry)
                need(middle - radius <= ends[0] and ends[1] <= middle + radius, "a final state is not enclosed")
        doc.done(f"{sum(ends is not None for ends in known.values())} agents")
    _check_input(doc, family, functions, (protocol, begin, drive), x)


def _check_input(
    doc: Document,
    family: Family,
    functions: Sequence[VerifiedFunction],
    sliding: tuple[Parameters, Begin, Drive | None],
    x: Sequence[Fraction] | None,
) -> None:
    protocol, begin, drive = sliding
    section = fields(doc.section("input"), ("bounded", "peaks", *["sliding"] * protocol.sliding), "input")
    check_sliding_part(doc, family.modes[0].structure.graph, protocol, begin, section.get("sliding"))
    doc.at = "input"
    if section["bounded"] is None:
        need(section["peaks"] is None, "peaks of an input that is not proved bounded")
        return
    doc.open("family-input", "input")
    need(section["bounded"] is True, "an input that is proved not bounded has no place here")
    gains = protocol.gains
    pole = gains["rho2"] * gains["kappa"]
    for component in family.components:
        own = [V for V in functions if V.component is component]
        need(
            len(component.nodes) == 1 or any(V.rate * pole >= 2 for V in own),
            "no rate proves that the input is bounded",
        )
    added = sliding_part(gains, begin.sigma) if begin.sigma is not None else [Fraction(0)] * len(family.labels)
    if (entry := section["peaks"]) is None:
        need(x is None or added is None, "no peaks")
        doc.done("bounded")
        return
    if x is None or added is None:
        raise RejectedError("peaks without an initial state, or of a sliding part that is not bounded")
    least = dict.fromkeys(range(len(family.labels)), Fraction(0))
    for component in family.components:
        least |= peaks([V for V in functions if V.component is component], gains, x, drive)
    for v, text in enumerate(ordered(family.labels, entry, "peaks").values()):
        need(exact(text) >= least[v] + added[v], "a peak is not proved")
    doc.done(f"peaks of {len(least)} agents")
