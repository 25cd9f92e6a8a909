"""A decay rate for every family that is stable or reaches bipartite consensus under every signal, in closed form.

With ``D`` at least every sum of ``w+`` into a node, ``w`` the least mandatory weight, ``m`` modes, and windows of
``h = 1/D`` on the stretched clock, let ``eta = w/(3 D m) < e^-1 w h/m``. Then for every signal

    stability:            ||X||_inf          shrinks by  1 - 2 eta^N        in every  N h,
    bipartite consensus:  max G X - min G X  shrinks by  1 - eta^(N - 1)    in every  (N - 1) h.

The numbers are tiny. They show that a rate exists, whatever a search finds (docs/theory/families.md, "An explicit
rate").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.theorems.family_behaviour import FamilyComponent


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
