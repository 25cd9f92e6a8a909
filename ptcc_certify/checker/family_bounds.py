"""Bounds of a family for every signal: where each agent ends, and how large its input gets; proved and verified here.

With ``V <= e^(-r s) V(0)`` and ``|(L X)_k|^2 <= c_k V`` for every member, for every signal

    |u_k| <= gain sqrt(c_k V(0)) e^(-r s / 2),      |x_k(t) - x_k(T)| <= (2/r) sqrt(c_k V(0)) e^(-r s / 2)

and ``r rho2 kappa >= 2`` makes the first largest at ``t = 0``. Where agents end by the common kernel is in
:mod:`~ptcc_certify.checker.family_limits`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Protocol

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import longest
from lmi.exact.work import spend
from ptcc_certify.checker.family import STABILITY, Component, Family
from ptcc_certify.checker.family_limits import WeightedMean, check_means, limits
from ptcc_certify.checker.family_rows import Function as VerifiedFunction
from ptcc_certify.checker.graph import ordered
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import Interval, exact, fields, interval, need

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

    @property
    def means(self) -> Sequence[WeightedMean]:
        """Weighted means, with their constants."""

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of a state."""


def deviations(functions: Iterable[Function], stable: bool, x: Sequence[Fraction]) -> dict[int, Fraction]:
    """Bound ``|x_k(0) - x_k(T)|`` by functions of one component; empty if none decays."""
    least: dict[int, Fraction] = {}
    for V in functions:
        if V.rate <= 0:
            continue
        spend(EACH_ROOT * len(V.inputs), what="bounds of many agents")
        value = rounded(V.value(x), BITS, up=True)
        bounds = {k: 2 * root_above(c * value) / V.rate for k, c in V.inputs.items()}
        for k, c in V.coordinates.items() if stable else ():
            bounds[k] = min(bounds[k], root_above(c * value))
        least = {k: min(bound, least.get(k, bound)) for k, bound in bounds.items()}
    return least


def mean_intervals(functions: Iterable[Function], x: Sequence[Fraction]) -> list[tuple[int, Interval]]:
    """Return columns of the basis with ends of their ``c_j``, from the means of functions of one component."""
    result = []
    for V in functions:
        if V.means and V.rate > 0:
            value = rounded(V.value(x), BITS, up=True)
            for mean in V.means:
                spend(EACH_ROOT + 10 * len(mean.weights), what="means of many agents")
                result.append((mean.column, mean.interval(x, 2 * root_above(mean.constant * value) / V.rate)))
    return result


def peaks(functions: Iterable[Function], gains: Gains, x: Sequence[Fraction]) -> dict[int, Fraction]:
    """Bound ``|u_k|`` for all times by functions of one component with ``rate rho2 kappa >= 2``; empty if none has."""
    pole = gains["rho2"] * gains["kappa"]
    first, least = gains["rho1"] + pole / gains["T"], dict[int, Fraction]()
    for V in functions:
        if V.rate * pole >= 2:
            spend(EACH_ROOT * len(V.inputs), what="bounds of many agents")
            value = rounded(V.value(x), BITS, up=True)
            bounds = {k: first * root_above(c * value) for k, c in V.inputs.items()}
            least = {k: min(bound, least.get(k, bound)) for k, bound in bounds.items()}
    return least


def final_states(
    component: Component,
    functions: Sequence[Function],
    groups: Mapping[int, Sequence[int]],
    means: Mapping[int, Fraction],
    x: Sequence[Fraction],
) -> dict[int, Interval | None]:
    """Return the ends between which every agent of a component is at the deadline; None: no limit is claimed."""
    zero = Fraction(0)
    if component.behaviour == STABILITY:
        return dict.fromkeys(component.nodes, (zero, zero))
    if component.depends:
        return dict.fromkeys(component.nodes)
    whole, _ = component.whole
    bits, own = (
        longest(b for row in whole.values() for b in row.values()),
        longest(x[v].numerator for v in component.nodes),
    )
    spend(8 * component.size, bits, own, "final states")
    near = mean_intervals(functions, x)
    return dict(limits(component.kernel, groups, means, near, deviations(functions, False, x), x))


# ---------------------------------------------------------------------- the check


def check_family_bounds(
    doc: Document, family: Family, functions: Sequence[VerifiedFunction], gains: Gains, x: Sequence[Fraction] | None
) -> None:
    """Verify final states and inputs."""
    labels = family.labels
    final = doc.section("final_state")
    need((final is None) == (x is None), "final states are claimed iff there is an initial state")
    if x is not None:
        witness = doc.open("family-final-state", "final_state", witness=True)["witness"]
        known: dict[int, Interval | None] = {}
        for component, kept in zip(family.components, check_means(doc, family, witness, x), strict=True):
            known |= final_states(component, [V for V in functions if V.component is component], *kept, x)
        for v, entry in enumerate(ordered(labels, final, "final_state").values()):
            need((known[v] is None) == (entry is None), "a final state that is not claimed, or one that is")
            if (ends := known[v]) is not None:
                middle, radius = interval(entry)
                need(middle - radius <= ends[0] and ends[1] <= middle + radius, "a final state is not enclosed")
        doc.done(f"{sum(ends is not None for ends in known.values())} agents")
    _check_input(doc, family, functions, gains, x)


def _check_input(
    doc: Document, family: Family, functions: Sequence[VerifiedFunction], gains: Gains, x: Sequence[Fraction] | None
) -> None:
    section = fields(doc.section("input"), ("bounded", "peaks"), "input")
    if section["bounded"] is None:
        need(section["peaks"] is None, "peaks of an input that is not proved bounded")
        return
    doc.open("family-input", "input")
    need(section["bounded"] is True, "an input that is proved not bounded has no place here")
    pole = gains["rho2"] * gains["kappa"]
    for component in family.components:
        own = [V for V in functions if V.component is component]
        need(
            len(component.nodes) == 1 or any(V.rate * pole >= 2 for V in own),
            "no rate proves that the input is bounded",
        )
    if (entry := section["peaks"]) is None:
        need(x is None, "no peaks")
        doc.done("bounded")
        return
    need(x is not None, "peaks without an initial state")
    least = dict.fromkeys(range(len(family.labels)), Fraction(0))
    for component in family.components:
        least |= peaks([V for V in functions if V.component is component], gains, x or ())
    for v, text in enumerate(ordered(family.labels, entry, "peaks").values()):
        need(exact(text) >= least[v], "a peak is not proved")
    doc.done(f"peaks of {len(least)} agents")
