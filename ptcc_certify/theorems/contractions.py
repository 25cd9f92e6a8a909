"""Contractions in closed form, of every family that is stable or reaches bipartite consensus under every signal.

With ``D`` at least every sum of ``w+`` into a node, ``w`` the least mandatory weight, ``m`` modes, and windows of
``h = 1/D`` on the stretched clock, let ``eta = w/(3 D m) < e^-1 w h/m``. Then for every signal

    stability:            ||X||_inf          shrinks by  1 - 2 eta^N        in every  N h,
    bipartite consensus:  max G X - min G X  shrinks by  1 - eta^(N - 1)    in every  (N - 1) h.

The numbers are tiny. They show that a rate exists, whatever a search finds (docs/theory/families.md, "An explicit
rate"). They hold of joint windows, too, in which every edge is on for some part of each window of the clock, and no
mode need be connected: with windows of length ``h`` in which every edge is on for ``d`` at least, and
``eta <= e^(-D h) min(1, d w)`` (docs/theory/families.md, "Joint windows").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.checker.constrained_switching import closed_groups, contraction_below
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.model.constrained_switching import JointWindows
from ptcc_certify.model.parameters import readable
from ptcc_certify.theorems.family_behaviour import FamilyComponent

_BITS = 53


@dataclass(frozen=True)
class ExplicitRate:
    """A contraction in windows of the stretched clock, with its numbers kept apart: powers of ``eta`` are tiny.

    Attributes
    ----------
    eta : Fraction
    exponent : int
        ``N`` or ``N - 1``.
    multiple : int
        2 for stability, 1 for consensus.
    window : Fraction
        The time on the stretched clock in which the factor :attr:`contraction` is gained.

    Examples
    --------
    >>> rate = ExplicitRate(Fraction(1, 6), 2, 1, Fraction(1))
    >>> rate.contraction, rate.factor(Fraction(5, 2))
    (Fraction(35, 36), Fraction(1225, 1296))
    """

    eta: Fraction
    exponent: int
    multiple: int
    window: Fraction

    @property
    def contraction(self) -> Fraction:
        """The factor ``1 - multiple eta^exponent`` per completed window; of many digits where there are many nodes."""
        return 1 - self.multiple * self.eta**self.exponent

    def factor(self, clock: Fraction) -> Fraction:
        """Return what is left at most after the time ``clock`` on the stretched clock: only completed windows count."""
        return self.contraction ** math.floor(clock / self.window)

    @property
    def log10_decay_rate(self) -> float:
        """The decimal logarithm of ``multiple eta^exponent / window``, which is below the decay rate per window."""
        logs = [math.log10(x.numerator) - math.log10(x.denominator) for x in (self.eta, self.window)]
        return self.exponent * logs[0] + math.log10(self.multiple) - logs[1]


def explicit_rate(component: FamilyComponent) -> ExplicitRate | None:
    """Return the explicit rate of a component that is stable or reaches bipartite consensus under any signal.

    None for others, and for a single node, which is at rest.

    References
    ----------
    docs/theory/families.md, "An explicit rate".

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> explicit_rate(decide(Family.from_intervals([("a", "b", 1, 2), ("b", "a", 0, 1)]))[0])
    ExplicitRate(eta=Fraction(1, 6), exponent=1, multiple=1, window=Fraction(1, 2))
    """
    family, n = component.family, component.family.n_nodes
    if component.behaviour not in (STABILITY, BIPARTITE_CONSENSUS) or n == 1 or component.signal != "any":
        return None
    largest = max(map(largest_sum, family.modes))
    least = min(map(least_mandatory, family.modes))
    eta = least / (3 * largest * len(family.modes))
    exponent, multiple = (n, 2) if component.behaviour == STABILITY else (n - 1, 1)
    return ExplicitRate(eta, exponent, multiple, exponent / largest)


def largest_sum(mode: Mode) -> Fraction:
    """Return the largest sum of ``w+`` into a node."""
    sums: dict[int, Fraction] = {}
    table = mode.upper.table
    if table.dtype == np.int64 and int(table.max(initial=0)) * max(mode.n_edges, 1) < 2**63:
        totals = np.zeros(len(mode.labels), dtype=np.int64)
        np.add.at(totals, mode.target, table)
        return Fraction(int(totals.max()), mode.upper.scale)
    for edge, node in enumerate(mode.target.tolist()):
        sums[node] = sums.get(node, Fraction(0)) + mode.upper.fraction(edge)
    return max(sums.values(), default=Fraction(0))


def least_mandatory(mode: Mode) -> Fraction:
    """Return the least mandatory weight."""
    mandatory = np.flatnonzero(~mode.optional)
    return mode.lower.fraction(int(mandatory[np.argmin(mode.lower.table[mandatory])]))


# ---------------------------------------------------------------------- joint windows


def joint_behaviour(component: FamilyComponent) -> str | None:
    """Return what a component does if all its mandatory edges are on in every window; None if that is not decided.

    Stability if the graph of all mandatory edges of all modes has no balanced closed component; bipartite consensus if
    it has one closed component, and some camps fit all edges of all modes.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day, night = (SignedDigraph.from_edges([edge], nodes="abc") for edge in (("a", "b", 1), ("b", "c", -1)))
    >>> joint_behaviour(decide(Family.switching([day, night]))[0])
    'bipartite consensus'
    """
    edges = set[tuple[int, int, int]]()
    for mode in component.family.modes:
        on = ~mode.optional
        edges.update(zip(mode.source[on].tolist(), mode.target[on].tolist(), mode.sign[on].tolist(), strict=True))
    groups = closed_groups(range(component.nodes.size), edges)
    if component.gauge is not None and len(groups) == 1:
        return BIPARTITE_CONSENSUS
    return None if any(balanced for _, balanced in groups) else STABILITY


def refuse_impossible_windows(family: Family, signal: JointWindows) -> None:
    """Refuse windows that no signal keeps: the modes that turn all edges on need more than a window for it.

    Raises
    ------
    ParameterError
        The message tells which windows a signal may keep.

    Examples
    --------
    >>> day, night = (SignedDigraph.from_edges([edge], nodes="abc") for edge in (("a", "b", 1), ("b", "c", -1)))
    >>> refuse_impossible_windows(Family.switching([day, night]), JointWindows(1, on="0.5", clock="s"))
    """
    needed = signal.on * clock_for_all_edges(family)
    if needed > signal.length:
        most = signal.on * signal.length / needed
        raise ParameterError(
            f"no signal has every edge on for {readable(signal.on)} of every window of {readable(signal.length)}: the "
            f"modes need {readable(needed)} for it, one after the other; let windows be as long, or on {readable(most)}"
        )


def clock_for_all_edges(family: Family) -> Fraction:
    """Return a lower bound of the clock that it takes to have every edge on for 1, in modes in which it is mandatory.

    With ``y_e >= 0``, of which the sum over the mandatory edges of any mode is at most 1, that is ``sum_e y_e``: let
    mode ``i`` act for ``h_i``; then ``sum_e y_e <= sum_e y_e sum_(i with e) h_i <= sum_i h_i``. Floats propose ``y``.

    Examples
    --------
    >>> ring = [(1, 2, 1), (2, 3, 1), (3, 1, 1)]
    >>> pairs = [SignedDigraph.from_edges([e for e in ring if e != off], nodes=[1, 2, 3]) for off in ring]
    >>> clock_for_all_edges(Family.switching(pairs))
    Fraction(3, 2)
    """
    from scipy.optimize import linprog

    where: dict[tuple[int, int, int], list[int]] = {}
    for number, mode in enumerate(family.modes):
        on = ~mode.optional
        for edge in zip(mode.source[on].tolist(), mode.target[on].tolist(), mode.sign[on].tolist(), strict=True):
            where.setdefault(edge, []).append(number)
    modes_of_edges = sorted(set(map(tuple, where.values())))
    if not modes_of_edges:
        return Fraction(0)
    table = np.zeros((len(family.modes), len(modes_of_edges)))
    for k, numbers in enumerate(modes_of_edges):
        table[list(numbers), k] = 1
    proposal = linprog(-np.ones(table.shape[1]), A_ub=table, b_ub=np.ones(table.shape[0]))
    if not proposal.success:
        return Fraction(1)  # some edge is on for 1
    y = [max(Fraction(float(x)).limit_denominator(10**6), Fraction(0)) for x in proposal.x]
    sums = [Fraction(0)] * len(family.modes)
    for value, numbers in zip(y, modes_of_edges, strict=True):
        for number in numbers:
            sums[number] += value
    return max(Fraction(1), sum(y, Fraction(0)) / max(sums)) if any(sums) else Fraction(1)


def window_rate(component: FamilyComponent, signal: JointWindows, behaviour: str) -> ExplicitRate | None:
    """Return the contraction of a component of more than one node; None if it is below every number that is written.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day, night = (SignedDigraph.from_edges([edge], nodes="abc") for edge in (("a", "b", 1), ("b", "c", -1)))
    >>> component = decide(Family.switching([day, night]))[0]
    >>> rate = window_rate(component, JointWindows(2, on=1, clock="s"), "bipartite consensus")
    >>> round(float(rate.eta), 6), rate.window
    (0.135335, Fraction(4, 1))
    """
    modes = [mode for mode in component.family.modes if mode.n_edges]
    largest = max(map(largest_sum, modes))
    least = min(least_mandatory(mode) for mode in modes if not mode.optional.all())
    eta = rounded(contraction_below(largest, least, signal.length, signal.on), _BITS)
    if eta <= 0 or eta < Fraction(1, 10**300):
        return None
    return contraction(component.nodes.size, signal, behaviour, eta)


def contraction(n: int, signal: JointWindows, behaviour: str, eta: Fraction) -> ExplicitRate:
    """Return what windows contract: ``1 - 2 eta^n`` in n of them, or ``1 - eta^(n-1)`` in n - 1 for consensus.

    Examples
    --------
    >>> contraction(3, JointWindows(2, on=1, clock="s"), "stability", Fraction(1, 10)).contraction
    Fraction(499, 500)
    """
    exponent, multiple = (n, 2) if behaviour == STABILITY else (n - 1, 1)
    return ExplicitRate(eta, exponent, multiple, exponent * signal.length)
