"""Bounds for every signal: where each agent ends, how large its input gets, and what sliding variables drive.

With ``V <= e^(-r s) V(0)`` and ``|(L X)_k| <= c_k sqrt(V)`` for every member, for every signal

    |u_k| <= gain c_k sqrt(V(0)) e^(-r s / 2),      |x_k(t) - x_k(T)| <= (2/r) c_k sqrt(V(0)) e^(-r s / 2)

and ``r rho2 kappa >= 2`` makes the first largest at ``t = 0``. Where agents end by the common kernel is in
:mod:`~ptcc_certify.checker.common_kernel_ends`.

Sliding variables that are not 0 at first drive the agents besides. ``y = x - sigma`` obeys ``y' = -gain L (y +
sigma)``, and ``|sigma_k| <= psi |sigma_k(0)|``, which no graph enters: then all this is said of ``y``. With ``sqrt(V)``
a norm that decays by ``e^(-rate s / 2)`` where nothing drives, and ``m_k`` the largest ``sum_l w+_kl (|sigma_k(0)| +
|sigma_l(0)|)`` of a mode,

    sqrt(V(y(t)))  <=  e^(-rate s(t) / 2) sqrt(V(y(0))) + c int_0^t e^(-rate (s(t) - s(r)) / 2) gain(r) psi(r) dr

where ``c^2`` is the largest ``V`` of all states with ``|x_k| <= m_k``, of every mode.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Protocol

from lmi.exact.decimal_rounding import up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.common_kernel_ends import WeightedMean, check_means, limits
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import STABILITY, Component, Family
from ptcc_certify.checker.input_formulas import BITS, decay_above, root_above, stretches
from ptcc_certify.checker.protocol import (
    Begin,
    SlidingPart,
    check_sliding,
    check_sliding_part,
    last_time,
    nominal_gain,
    reaching_of,
    sliding_part,
)
from ptcc_certify.checker.protocol import Protocol as Parameters
from ptcc_certify.checker.reading import Interval, RejectedError, length, need
from ptcc_certify.checker.row_functions import Function as VerifiedFunction
from ptcc_certify.checker.section_declarations import FewAgents

Sizes = Mapping[int, Fraction]
#: Stretches into which the time is cut while sliding variables move.
STRETCHES = 64
#: Below these ``psi``, and what a stretch leaves of a norm, are not made smaller: shorter numbers.
LEAST, MOST_DECAY = Fraction(1, 2**200), Fraction(100)


class Function(Protocol):
    """What a Lyapunov function says, by node: see :class:`~ptcc_certify.checker.common_forms.FamilyFunction`."""

    @property
    def rate(self) -> Fraction:
        """The proved rate."""

    @property
    def speeds(self) -> Sequence[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)`` for every member; a node may be in several vectors."""

    @property
    def sizes(self) -> Sequence[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``, of pivots and agents at rest 0 or left out."""

    @property
    def means(self) -> Sequence[WeightedMean]:
        """Weighted means, with their constants."""

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state."""

    def largest(self, sizes: Sizes) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``."""


def drive_sizes(edges: Iterable[tuple[int, int, Fraction]], sigma0: Sizes) -> dict[int, Fraction]:
    """Return ``m_k = sum_l w+ (|sigma_k(0)| + |sigma_l(0)|)`` of sources, targets and largest sizes of edges.

    ``|(L sigma)_k| <= psi m_k`` for every member. Entries of ``C L`` may cancel at ``w+`` and not elsewhere, so that
    this is formed before ``C`` is.

    Examples
    --------
    >>> drive_sizes([(0, 1, Fraction(2))], {0: Fraction(3), 1: Fraction(-1)})
    {0: Fraction(0, 1), 1: Fraction(8, 1)}
    """
    total = dict.fromkeys(sigma0, Fraction(0))
    for source, target, size in edges:
        total[target] += size * (abs(sigma0[source]) + abs(sigma0[target]))
    return total


class Stretch(NamedTuple):
    """A stretch of the time while sliding variables move.

    The gain at its two ends and ``psi`` at its begin, from above; how far the clock goes, at least and at most.
    """

    first: Fraction
    last: Fraction
    psi: Fraction
    least: Fraction
    most: Fraction


def reaching_stretches(gains: Mapping[str, Fraction], quiet: Fraction | None) -> list[Stretch]:
    """Cut the time until all sliding variables are 0, ``quiet`` or ``T_r``, into stretches."""
    reaching, result = reaching_of(gains, (), quiet), []
    for part in stretches(nominal_gain(gains), reaching, reaching.quiet, STRETCHES):
        low, high = part.clock
        first, last, psi, most = (
            rounded(x, BITS, up=True) for x in (part.first, part.last, max(part.psi[1], LEAST), high)
        )
        result.append(Stretch(first, last, psi, rounded(low, BITS, up=False), most))
    return result


@dataclass(frozen=True, eq=False)
class Drive:
    """What sliding variables that are not 0 at first do to the agents of a family, or of a component of it.

    Attributes
    ----------
    stretches : sequence of Stretch
        Of the time while some sliding variable of the family moves, rounded outwards.
    sigma0 : mapping of int to Fraction
        By node.
    modes : sequence of mapping of int to Fraction
        ``m_k`` of :func:`drive_sizes` by node, of every mode.
    """

    stretches: Sequence[Stretch]
    sigma0: Sizes
    modes: Sequence[Sizes]
    _constants: dict[int, tuple[Function, Fraction]] = field(default_factory=dict)

    @cached_property
    def sizes(self) -> dict[int, Fraction]:
        """The largest ``m_k`` of all modes."""
        return {k: max(mode[k] for mode in self.modes) for k in self.sigma0}

    @cached_property
    def integral(self) -> Fraction:
        """``int gain psi dt`` from above."""
        return sum((part.psi * part.most for part in self.stretches), Fraction(0))

    @cached_property
    def largest(self) -> Fraction:
        """``max gain psi`` from above."""
        return max(part.last * part.psi for part in self.stretches)

    def constant(self, V: Function) -> Fraction:
        """Return ``c`` of a function, rounded up."""
        if id(V) not in self._constants:
            self._constants[id(V)] = V, root_above(max(V.largest(mode) for mode in self.modes))
        return self._constants[id(V)][1]

    def sum(self, V: Function, root: Fraction) -> Fraction:
        """Bound ``int gain sqrt(V(y)) dt`` from a bound of ``sqrt(V(y(0)))``, for a positive rate."""
        return 2 / V.rate * (root + self.constant(V) * self.integral)

    def peak(self, V: Function, root: Fraction) -> Fraction:
        """Bound ``gain sqrt(V(y))`` for all times from a bound of ``sqrt(V(y(0)))``, for ``rate rho2 kappa >= 2``.

        Then ``gain e^(-rate s / 2)`` does not grow: in a stretch the product is at most the gain at its begin times the
        root there, and the gain at its end times what the stretch adds.
        """
        half, c = V.rate / 2, self.constant(V)
        most, v = Fraction(0), root
        for stretch in self.stretches:
            added = c * stretch.psi * min(stretch.most, 1 / half)
            most = max(most, stretch.first * v + stretch.last * added)
            v = rounded(v * decay_above(min(half * stretch.least, MOST_DECAY)) + added, BITS, up=True)
        return rounded(max(most, self.stretches[-1].last * v), BITS, up=True)

    def ends(self, camps: Mapping[int, int], y: Sequence[Fraction]) -> Interval:
        """Return ends of ``g_k x_k(T)`` from ``y(0)``, of agents that hear nobody else and all end at the same number.

        The extremes of ``g_k y_k`` move outwards by at most ``gain psi m_k``; and ``x(T)`` is a mean of ``g_k x_k(0)``
        plus means of what the ``g_k sigma_k`` lose, each of which goes to 0 without turning.
        """
        values, reach = [g * y[k] for k, g in camps.items()], max(self.sizes[k] for k in camps) * self.integral
        sigma, zero = [g * self.sigma0[k] for k, g in camps.items()], Fraction(0)
        first = [value + s for value, s in zip(values, sigma, strict=True)]
        lost, won = (sum((max(sign * s, zero) for s in sigma), zero) for sign in (1, -1))
        return max(min(values) - reach, min(first) - lost), min(max(values) + reach, max(first) + won)

    @classmethod
    def of(
        cls,
        gains: Mapping[str, Fraction],
        sigma0: Sizes,
        quiet: Fraction | None,
        modes: Sequence[Iterable[tuple[int, int, Fraction]]],
    ) -> Drive:
        """Return what sliding variables do to all agents.

        Parameters
        ----------
        gains : mapping
            The parameters of the protocol.
        sigma0 : mapping of int to Fraction
            By node.
        quiet : Fraction or None
            From when on all are 0, ``ln(T_r/(T_r - t))``; None: ``T_r``.
        modes : sequence of edges
            Source, target and largest size, of every mode.
        """
        return cls(reaching_stretches(gains, quiet), sigma0, [drive_sizes(edges, sigma0) for edges in modes])

    def restricted(self, nodes: Sequence[int]) -> Drive:
        """Return what they do to agents that hear nobody else, numbered anew."""
        sigma0, *modes = ({k: of[v] for k, v in enumerate(nodes)} for of in (self.sigma0, *self.modes))
        return Drive(self.stretches, sigma0, modes)


# ---------------------------------------------------------------------- the check


def check_drive(
    doc: Document, family: Family, functions: Sequence[VerifiedFunction], protocol: Parameters, begin: Begin
) -> Drive | None:
    """Verify the sliding variables, and how they drive every Lyapunov function."""
    graph = family.modes[0].structure.graph
    check_sliding(doc, graph, protocol, begin)
    result = None
    if begin.sigma is not None and any(begin.sigma):
        sigma0 = dict(enumerate(begin.sigma))
        bits = longest(edge[4] for mode in family.modes for edge in mode.edges)
        spend(10 * sum(len(mode.edges) for mode in family.modes), bits, 128, "what sliding variables do")
        times = doc.sections["reaching_time"].z
        edges = ([(s, t, Fraction(high, mode.unit)) for s, t, _, _, high in mode.edges] for mode in family.modes)
        result = Drive.of(protocol.gains, sigma0, last_time(times, begin.sigma), list(edges))
    drives = doc.section("drives")
    need((result is None) == (drives is None), "drives belong to sliding variables that move")
    if result is not None:
        need(len(drives) == len(functions), f"drives has not {len(functions)} entries")
        for k, (V, drive) in enumerate(zip(functions, drives, strict=True)):
            doc.open("family-drive", f"decays[{k}]")
            need(drive >= result.constant(V), "what drives the function is not proved")
            doc.done(f"c = {up(drive)}")
    return result


Gains = Mapping[str, Fraction]
#: Products of short integers that a root costs, about.
EACH_ROOT = 300


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

    bounded: bool | None = None
    peaks: FewAgents | None = None
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
