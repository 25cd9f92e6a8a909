"""Bounds of a family for every signal: where each agent ends, and how large its input gets; proved and verified here.

With ``V <= e^(-r s) V(0)`` and ``|(L X)_k| <= c_k sqrt(V)`` for every member, for every signal

    |u_k| <= gain c_k sqrt(V(0)) e^(-r s / 2),      |x_k(t) - x_k(T)| <= (2/r) c_k sqrt(V(0)) e^(-r s / 2)

and ``r rho2 kappa >= 2`` makes the first largest at ``t = 0``. Where agents end by the common kernel is in
:mod:`~ptcc_certify.checker.family_limits`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Protocol

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.family import STABILITY, Component, Family
from ptcc_certify.checker.family_function import Scaled
from ptcc_certify.checker.family_limits import WeightedMean, check_means, limits
from ptcc_certify.checker.family_rows import Function as VerifiedFunction
from ptcc_certify.checker.graph import ordered
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import Interval, exact, fields, interval, length, need

Gains = Mapping[str, Fraction]
#: Products of short integers that a root costs, about.
EACH_ROOT = 300


class Function(Protocol):
    """What a Lyapunov function says, by node: see :class:`~ptcc_certify.checker.family_function.FamilyFunction`."""

    @property
    def rate(self) -> Fraction:
        """The proved rate."""

    @property
    def speeds(self) -> Sequence[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)`` for every member; a node may be in several vectors."""

    @property
    def means(self) -> Sequence[WeightedMean]:
        """Weighted means, with their constants."""

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state."""


def least(bounds: Iterable[Scaled]) -> tuple[dict[int, int], int]:
    """Return the least number of every node in some vectors as integers over one scale, and that.

    Examples
    --------
    >>> least([({1: 3, 2: 3}, Fraction(1, 2)), ({2: 1}, Fraction(1))])
    ({1: 3, 2: 2}, 2)
    """
    some = list(bounds)
    (factors,), scale = integers([[factor for _, factor in some]])
    result: dict[int, int] = {}
    for (vector, _), factor in zip(some, factors, strict=True):
        bits = longest(vector.values())
        spend(len(vector), bits, factor.bit_length(), "bounds of many agents")
        sized(len(vector), bits + factor.bit_length(), "bounds of many agents")
        for k, x in vector.items():
            bound = factor * x
            result[k] = min(bound, result.get(k, bound))
    return result, scale


def _multiples(functions: Iterable[tuple[Function, Fraction]]) -> tuple[dict[int, int], int]:
    """Return the least of all speeds, those of every function multiplied by a number that is rounded up."""
    some = [(V.speeds, rounded(factor, BITS, up=True)) for V, factor in functions]
    return least((vector, unit * factor) for speeds, factor in some for vector, unit in speeds)


def deviations(functions: Iterable[Function], x: Sequence[Fraction]) -> tuple[dict[int, int], int]:
    """Bound ``|x_k(0) - x_k(T)|`` by functions of one component, as :func:`least` does; empty if none decays."""
    return _multiples((V, 2 * V.root(x) / V.rate) for V in functions if V.rate > 0)


def mean_intervals(functions: Iterable[Function], x: Sequence[Fraction]) -> list[tuple[int, Interval]]:
    """Return columns of the basis with ends of their ``c_j``, from the means of functions of one component."""
    result = []
    for V in functions:
        if V.means and V.rate > 0:
            factor = rounded(2 * V.root(x) / V.rate, BITS, up=True)
            for mean in V.means:
                spend(EACH_ROOT + 10 * len(mean.weights), what="means of many agents")
                result.append((mean.column, mean.interval(x, root_above(mean.constant) * factor)))
    return result


def peaks(functions: Iterable[Function], gains: Gains, x: Sequence[Fraction]) -> tuple[dict[int, int], int]:
    """Bound ``|u_k|`` for all times by functions of one component with ``rate rho2 kappa >= 2``, as :func:`least` does.

    Empty if no function has this rate.
    """
    pole = gains["rho2"] * gains["kappa"]
    first = gains["rho1"] + pole / gains["T"]
    return _multiples((V, first * V.root(x)) for V in functions if V.rate * pole >= 2)


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
    bits = longest(b for row in whole.values() for b in row.values())
    spend(8 * component.size, bits, longest(x[v].numerator for v in component.nodes), "final states")
    near = mean_intervals(functions, x)
    return dict(limits(component.kernel, groups, means, near, deviations(functions, x), x))


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
    told = list(map(exact, ordered(family.labels, entry, "peaks").values()))
    for component in family.components:
        bounds, unit = peaks([V for V in functions if V.component is component], gains, x or ())
        bits = length(told[v] for v in component.nodes), max(longest(bounds.values()), unit.bit_length())
        spend(2 * len(component.nodes), *bits, "peaks of many agents")
        for v in component.nodes:
            need(told[v].numerator * unit >= bounds.get(v, 0) * told[v].denominator, "a peak is not proved")
    doc.done(f"peaks of {len(told)} agents")
