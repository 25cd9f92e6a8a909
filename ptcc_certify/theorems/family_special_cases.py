"""The special cases of what a family does: consensus, signed-average consensus, containment, for every signal."""

from __future__ import annotations

import numpy as np

from ptcc_certify.graphs.structure import (
    BIPARTITE_CONSENSUS,
    BIPARTITE_CONTAINMENT,
    CONSENSUS,
    CONTAINMENT,
    SIGNED_AVERAGE_CONSENSUS,
)
from ptcc_certify.theorems.family_behaviour import CHAIN, Counterexample, FamilyComponent

#: The behaviour of which each special case is one.
GENERAL = {
    CONSENSUS: BIPARTITE_CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS: BIPARTITE_CONSENSUS,
    CONTAINMENT: BIPARTITE_CONTAINMENT,
}


def special_behaviours(component: FamilyComponent) -> tuple[str, ...]:
    """Return the sharper behaviours that a component shows for every signal, the sharpest last.

    - Signed-average consensus: bipartite consensus where each edge of each mode is undirected, both directions one
      parameter or known: ``g' X`` stays what it is.
    - Consensus, and containment: all edges of all modes are positive.

    References
    ----------
    Corollaries 1 to 5 of [Zhu]_; docs/theory/families.md.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> special_behaviours(decide(Family.from_intervals([("a", "b", 1, 2)], undirected=True))[0])
    ('signed-average consensus', 'consensus')
    """
    if component.behaviour not in CHAIN:
        return ()
    positive = bool((component.family.union[2] > 0).all())
    if component.behaviour != BIPARTITE_CONSENSUS:
        return (CONTAINMENT,) if positive else ()
    pairs = zip(component.family.modes, component.structures, strict=True)
    undirected = all(mode.tied or (mode.known.all() and s.undirected) for mode, s in pairs) and component.nodes.size > 1
    special = [SIGNED_AVERAGE_CONSENSUS] if undirected else []
    if positive:
        special.append(CONSENSUS)
    return tuple(special)


def component_holds(component: FamilyComponent, behaviour: str) -> bool | None:
    """Tell whether a component shows a behaviour, special cases included, under every signal; None if undecided.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> (pair,) = decide(Family.from_intervals([("a", "b", 0, 1), ("b", "a", 1, 2)]))
    >>> component_holds(pair, "containment"), component_holds(pair, "signed-average consensus")
    (True, False)
    """
    if behaviour not in GENERAL:
        return component.holds(behaviour)
    general = component.holds(GENERAL[behaviour])
    if not general:
        return general
    special = special_behaviours(component)
    return behaviour in special or (behaviour == CONTAINMENT and CONSENSUS in special)


def component_refutation(component: FamilyComponent, behaviour: str) -> Counterexample | None:
    """Return what refutes a behaviour, special cases included; None where a special case alone does not hold."""
    return component.refutation(GENERAL.get(behaviour, behaviour))


def camps(component: FamilyComponent) -> list[np.ndarray]:
    """Return the camps that all edges of all modes keep, that of the first node first; one or two."""
    if component.gauge is None:
        return []
    return [side for sign in (1, -1) if (side := np.flatnonzero(component.gauge == sign)).size]
