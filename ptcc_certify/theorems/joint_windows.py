"""What joint windows do: every edge is on for some part of each window of the clock, and no mode need be connected.

With ``D`` at least every sum of ``w+`` into a node, ``w`` the least mandatory weight, windows of length ``h`` in which
every edge is on for ``d`` at least, and ``eta <= e^(-D h) min(1, d w)``, the contractions of
:mod:`ptcc_certify.theorems.family_rate` hold in ``N h`` and ``(N - 1) h`` (docs/theory/families.md, "Joint windows").
"""

from __future__ import annotations

from fractions import Fraction

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.checker.restricted_signals import closed_groups, contraction_below
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.family_rate import ExplicitRate, largest_sum, least_mandatory
from ptcc_certify.theorems.restricted_signals import JointWindows

_BITS = 53


def joint_behaviour(component: FamilyComponent) -> str | None:
    """Return what a component does if all its mandatory edges are on in every window; None if that is not decided.

    Stability if the graph of all mandatory edges of all modes has no balanced closed component; bipartite consensus if
    it has one closed component, and some camps fit all edges of all modes.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
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


def window_rate(component: FamilyComponent, signal: JointWindows, behaviour: str) -> ExplicitRate | None:
    """Return the contraction of a component of more than one node; None if it is below every number that is written.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
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
