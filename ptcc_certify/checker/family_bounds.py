"""Bounds of a family for every signal: where each agent ends, and how large its input gets; proved and verified here.

With ``V <= e^(-r s) V(0)`` and ``|(L X)_k| <= c_k sqrt(V)`` for every member, for every signal

    |u_k| <= gain c_k sqrt(V(0)) e^(-r s / 2),      |x_k(t) - x_k(T)| <= (2/r) c_k sqrt(V(0)) e^(-r s / 2)

and ``r rho2 kappa >= 2`` makes the first largest at ``t = 0``. Where agents end by the common kernel is in
:mod:`~ptcc_certify.checker.family_ends`. Sliding variables that are not 0 at first drive the agents besides: then all
this is said of ``y = x - sigma``, with what :mod:`~ptcc_certify.checker.family_sliding` adds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import STABILITY, Component, Family
from ptcc_certify.checker.family_ends import WeightedMean, check_means, limits
from ptcc_certify.checker.family_function import Scaled
from ptcc_certify.checker.family_rows import Function as VerifiedFunction
from ptcc_certify.checker.family_sliding import Drive, Sizes, nominal_gain
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.protocol import Begin, SlidingPart, check_sliding_part, sliding_part
from ptcc_certify.checker.protocol import Protocol as Parameters
from ptcc_certify.checker.reading import Interval, RejectedError, length, need
from ptcc_certify.checker.section_declarations import FewAgents

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

    def largest(self, sizes: Sizes) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``."""


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


def _added(bounds: tuple[Mapping[int, int], int], sizes: Sizes, factor: Fraction) -> tuple[dict[int, int], int]:
    """Add multiples of some sizes to bounds over one scale, rounded up."""
    spend(EACH_ROOT * len(bounds[0]), what="bounds of many agents")
    total = {k: Fraction(bound, bounds[1]) + factor * sizes[k] for k, bound in bounds[0].items()}
    (values,), scale = integers([[rounded(x, BITS, up=True) for x in total.values()]])
    return dict(zip(total, values, strict=True)), scale


def deviations(
    functions: Iterable[Function], x: Sequence[Fraction], drive: Drive | None = None
) -> tuple[dict[int, int], int]:
    """Bound ``|x_k(0) - x_k(T)|`` by functions of one component, as :func:`least` does; empty if none decays.

    Where sliding variables move, ``x`` is ``y(0)``, and it is ``|y_k(0) - x_k(T)|``.
    """
    some = [V for V in functions if V.rate > 0]
    if drive is None:
        return _multiples((V, 2 * V.root(x) / V.rate) for V in some)
    return _added(_multiples((V, drive.sum(V, V.root(x))) for V in some), drive.sizes, drive.integral)


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


def peaks(
    functions: Iterable[Function], gains: Gains, x: Sequence[Fraction], drive: Drive | None = None
) -> tuple[dict[int, int], int]:
    """Bound ``gain |(L x)_k|`` for all times by functions of one component with ``rate rho2 kappa >= 2``.

    As :func:`least` does; empty if no function has this rate. Where sliding variables move, ``x`` is ``y(0)``.
    """
    gain = nominal_gain(gains)
    some = [V for V in functions if V.rate * gain.k >= 2]
    if drive is None:
        first = gain.value(Fraction(1))
        return _multiples((V, first * V.root(x)) for V in some)
    return _added(_multiples((V, drive.peak(V, V.root(x))) for V in some), drive.sizes, drive.largest)


def final_states(
    component: Component,
    functions: Sequence[Function],
    kept: tuple[Mapping[int, Sequence[int]], Mapping[int, Fraction]],
    x: Sequence[Fraction],
    drive: Drive | None = None,
) -> dict[int, Interval | None]:
    """Return the ends between which every agent of a component is at the deadline; None: no limit is claimed.

    ``kept`` are the sets ``A_j`` and the ``c_j`` that are known. Where sliding variables move, ``x`` is ``y(0)``.
    """
    zero, (groups, means) = Fraction(0), kept
    if component.behaviour == STABILITY:
        return dict.fromkeys(component.nodes, (zero, zero))
    if component.depends:
        return dict.fromkeys(component.nodes)
    whole, _ = component.whole
    bits = longest(b for row in whole.values() for b in row.values())
    spend(8 * component.size, bits, longest(x[v].numerator for v in component.nodes), "final states")
    near, wide = ends_near(component.kernel, groups, functions, x, drive)
    return dict(limits(component.kernel, groups, means, near, deviations(functions, x, drive), x, wide))


def ends_near(
    kernel: Mapping[int, Mapping[int, Fraction]],
    groups: Mapping[int, Sequence[int]],
    functions: Iterable[Function],
    x: Sequence[Fraction],
    drive: Drive | None,
) -> tuple[list[tuple[int, Interval]], dict[int, Interval] | None]:
    """Return ends of the ``c_j`` from means, and those from the ``A_j`` where sliding variables move (``x = y(0)``)."""
    if drive is None:
        return mean_intervals(functions, x), None
    camps = {j: {v: 1 if kernel[v][j] > 0 else -1 for v in group} for j, group in groups.items()}
    return [], {j: drive.ends(own, x) for j, own in camps.items()}


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
    x = None if begin.state is None else list(begin.state)
    if x is not None and drive is not None:
        x = [value - drive.sigma0[v] for v, value in enumerate(x)]
    final = doc.section("final_state")
    need((final is None) == (x is None), "final states are claimed iff there is an initial state")
    if x is not None:
        witness = doc.open("family-final-state", "final_state")["witness"]
        known: dict[int, Interval | None] = {}
        for component, kept in zip(family.components, check_means(family, witness, x), strict=True):
            known |= final_states(component, [V for V in functions if V.component is component], kept, x, drive)
        for v, entry in enumerate(final):
            need((known[v] is None) == (entry is None), "a final state that is not claimed, or one that is")
            if (ends := known[v]) is not None:
                middle, radius = entry
                need(middle - radius <= ends[0] and ends[1] <= middle + radius, "a final state is not enclosed")
        count = sum(ends is not None for ends in known.values())
        doc.done(f"{count} agents" if count else "none claimed: ends depend on the signal")
    _check_input(doc, family, functions, (protocol, begin, drive), x)


@dataclass(frozen=True, kw_only=True)
class FamilyInput:
    """What the file says of the input for every signal; ``sliding`` under the sliding-mode protocol."""

    bounded: bool | None
    peaks: FewAgents | None
    sliding: SlidingPart | None = None


def _check_input(
    doc: Document,
    family: Family,
    functions: Sequence[VerifiedFunction],
    sliding: tuple[Parameters, Begin, Drive | None],
    x: Sequence[Fraction] | None,
) -> None:
    protocol, begin, drive = sliding
    section = doc.section("input")
    check_sliding_part(doc, family.modes[0].structure.graph, protocol, begin, section.sliding)
    doc.at = "input"
    if section.bounded is None:
        need(section.peaks is None, "peaks of an input that is not proved bounded")
        return
    doc.open("family-input", "input")
    need(section.bounded, "an input that is proved not bounded has no place here")
    gains = protocol.gains
    pole = gains["rho2"] * gains["kappa"]
    for component in family.components:
        own = [V for V in functions if V.component is component]
        need(
            len(component.nodes) == 1 or any(V.rate * pole >= 2 for V in own),
            "no rate proves that the input is bounded",
        )
    added = sliding_part(gains, begin.sigma) if begin.sigma is not None else [Fraction(0)] * len(family.labels)
    if section.peaks is None:
        need(x is None or added is None, "no peaks")
        doc.done("bounded")
        return
    if x is None or added is None:
        raise RejectedError("peaks without an initial state, or of a sliding part that is not bounded")
    nominal = [peak - more for peak, more in zip(section.peaks, added, strict=True)]
    for component in family.components:
        bounds, unit = peaks([V for V in functions if V.component is component], gains, x, drive)
        bits = length(nominal[v] for v in component.nodes), max(longest(bounds.values()), unit.bit_length())
        spend(2 * len(component.nodes), *bits, "peaks of many agents")
        for v in component.nodes:
            need(nominal[v].numerator * unit >= bounds.get(v, 0) * nominal[v].denominator, "a peak is not proved")
    doc.done(f"peaks of {len(nominal)} agents")
