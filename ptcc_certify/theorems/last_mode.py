"""Where agents end under signals that switch finitely often before the deadline: where the last mode leads them.

The stretched clock is infinite after the last switch. So the last mode does what it does by itself, from the state in
which the others left the agents (docs/theory/families.md, "The last mode").
"""

from __future__ import annotations

from ptcc_certify.graphs.structure import (
    BIPARTITE_CONSENSUS,
    BIPARTITE_CONTAINMENT,
    CONSENSUS,
    INTERVAL_BIPARTITE_CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS,
    STABILITY,
    find_camps,
)
from ptcc_certify.theorems.family_behaviour import CHAIN, GENERAL, FamilyComponent


def last_mode_behaviours(component: FamilyComponent) -> tuple[str | None, ...]:
    """Return what each mode does to all agents of a component if it acts for ever, its weights still changing.

    None for a mode that has uncertain weights and neither brings all agents to 0 nor to one value up to camps: where
    its weights move on, its agents need not come to rest.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day, outage = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([], nodes="ab")
    >>> last_mode_behaviours(decide(Family.switching([day, outage]))[0])
    ('bipartite consensus', 'bipartite containment')
    """
    result: list[str | None] = []
    for mode, structure in zip(component.family.modes, component.structures, strict=True):
        closed = structure.closed_components
        camps_fit = not find_camps(component.family.n_nodes, mode.source, mode.target, mode.sign)[1].size
        if not any(c.balanced for c in closed):
            result.append(STABILITY)
        elif len(closed) == 1 and camps_fit:
            result.append(BIPARTITE_CONSENSUS)
        elif not mode.known.all():
            result.append(None)
        else:
            result.append(INTERVAL_BIPARTITE_CONSENSUS if len(closed) == 1 else BIPARTITE_CONTAINMENT)
    return tuple(result)


def last_mode_shows(own: str | None, behaviour: str, positive: bool = False) -> bool | None:
    """Tell whether a mode that does ``own`` shows a behaviour, special cases included; None if that is not known.

    Consensus and containment are bipartite ones without negative edges.

    Parameters
    ----------
    own : str or None
        One of :func:`last_mode_behaviours`.
    behaviour : str
    positive : bool
        Whether all edges by which they do it are positive.

    Examples
    --------
    >>> last_mode_shows("bipartite consensus", "bipartite containment"), last_mode_shows("stability", "consensus")
    (True, False)
    >>> last_mode_shows("bipartite consensus", "consensus", positive=True)
    True
    """
    if own is None:
        return None
    general = GENERAL.get(behaviour, behaviour)
    if general not in (CHAIN[CHAIN.index(own) :] if own in CHAIN else (own,)):
        return False
    if behaviour not in GENERAL or (positive and behaviour != SIGNED_AVERAGE_CONSENSUS):
        return True
    return False if behaviour == CONSENSUS else None
