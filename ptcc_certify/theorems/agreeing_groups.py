"""What remains true of a family whose behaviour depends on the signal: groups that agree, agents that follow.

With ``R``, all nodes from which news reaches a balanced closed component of some mandatory graph through edges of any
modes, for every signal (docs/theory/families.md, "When kernels differ"):

- agents to which no news comes from ``R`` end at 0;
- agents outside ``R`` follow: ``limsup |x_k| <= max_R |x_l(0)|``;
- a set ``A`` that hears nobody outside, whose edges of all modes keep camps ``g``, and in which every mandatory graph
  has one closed component, agrees: it ends at ``g c_A``;
- if all of ``R`` that an agent hears lies in such sets, ``limsup |x_k| <= max |c_A|`` over these, but ``x_k`` need not
  converge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ptcc_certify.graphs.structure import find_camps, weak_components
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.kernel import UNKNOWN, reached, spread


@dataclass(frozen=True, eq=False)
class AgreeingGroup:
    """A set of agents that agree under every signal, up to camps.

    Attributes
    ----------
    nodes : (k,) int array
        Ascending. Nobody outside is heard.
    camps : (k,) int8 array
        They end at ``camps`` times one number, which lies between the extremes of ``camps * x(0)``.
    """

    nodes: np.ndarray
    camps: np.ndarray


@dataclass(frozen=True, eq=False)
class FamilyGroups:
    """What every signal does to the agents of a component, whatever its behaviour.

    Attributes
    ----------
    component : FamilyComponent
        Of arbitrary signals. Nodes are numbered within it.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> two_leaders = [(1, 3, 1, 2), (2, 3, 1, 1)]
    >>> groups = FamilyGroups(decide(Family.from_intervals(two_leaders))[0])
    >>> groups.component.behaviour, groups.sources.tolist(), [g.nodes.tolist() for g in groups.agreeing]
    ('depends on the signal', [0, 1], [[0], [1]])
    >>> groups.bounded_by(2)
    (0, 1)
    """

    component: FamilyComponent

    @cached_property
    def sources(self) -> np.ndarray:
        """The nodes of ``R``, ascending."""
        source, target, _ = self.component.family.union
        kept = [v for s in self.component.structures for c in s.closed_components if c.balanced for v in c.nodes]
        return reached(self._size, target, source, np.unique(np.array(kept, dtype=np.int64)))

    @cached_property
    def at_zero(self) -> np.ndarray:
        """The nodes that end at 0 under every signal, for no news from ``R`` comes to them; ascending."""
        source, target, _ = self.component.family.union
        return np.setdiff1d(np.arange(self._size), reached(self._size, source, target, self.sources))

    @cached_property
    def agreeing(self) -> tuple[AgreeingGroup, ...]:
        """The largest sets that agree under every signal, ordered by their smallest node; no two share a node."""
        source, target, _ = self.component.family.union
        gauge, keep = self._camps()
        inside = keep[source] & keep[target]
        groups = []
        place = np.flatnonzero(keep)
        number = np.cumsum(keep) - 1
        parts = weak_components(place.size, number[source[inside]], number[target[inside]]) if place.size else []
        for part in parts:
            nodes = place[part]
            groups.append(AgreeingGroup(nodes, gauge[nodes] * gauge[nodes[0]]))
        return tuple(groups)

    def bounded_by(self, node: int) -> tuple[int, ...] | None:
        """Return the numbers of the agreeing groups that an agent hears, whose values bound it in the end.

        None where it also hears nodes of ``R`` that are in no such group.
        """
        source, target, _ = self.component.family.union
        heard = reached(self._size, target, source, np.array([node]))
        member = self._membership
        if (member[np.intersect1d(heard, self.sources)] < 0).any():
            return None
        return tuple(np.unique(member[heard][member[heard] >= 0]).tolist())

    @cached_property
    def bounded(self) -> np.ndarray:
        """All nodes that hear agreeing groups and, of ``R``, nobody else: :meth:`bounded_by` of these is not empty."""
        source, target, _ = self.component.family.union
        others = self.sources[self._membership[self.sources] < 0]
        near, loose = (
            reached(self._size, source, target, first) for first in (np.flatnonzero(self._membership >= 0), others)
        )
        return np.setdiff1d(near, loose)

    @property
    def _size(self) -> int:
        return self.component.family.n_nodes

    @cached_property
    def _membership(self) -> np.ndarray:
        member = np.full(self._size, -1)
        for number, group in enumerate(self.agreeing):
            member[group.nodes] = number
        return member

    def _camps(self) -> tuple[np.ndarray, np.ndarray]:
        """Return camps, and which nodes lie in agreeing groups.

        Of such a group, the nodes that hear each other are one closed component of the union, which agrees by itself.
        The others hear no second one and neither both camps of theirs nor any agent that some mode leaves alone.
        """
        n, (source, target, sign) = self._size, self.component.family.union
        strong = _strong_components(n, source, target)
        is_closed = np.ones(strong.max() + 1, dtype=bool)
        is_closed[strong[target[strong[source] != strong[target]]]] = False
        closed = is_closed[strong]
        out = self._divided(strong, closed)
        inside = np.flatnonzero(closed[target])
        gauge, violated, _ = find_camps(n, source[inside], target[inside], sign[inside])
        out |= np.isin(strong, strong[target[inside[violated]]])
        into = np.flatnonzero(~closed[target])
        edges = source[into], target[into], sign[into].astype(np.int64)
        codes = spread(np.where(closed, (strong + 1) * gauge, UNKNOWN), *edges)
        out[edges[1][codes[edges[1]] != edges[2] * codes[edges[0]]]] = True
        keep = np.ones(n, dtype=bool)
        keep[reached(n, source, target, np.flatnonzero(out))] = False
        return np.sign(codes).astype(np.int8), keep

    def _divided(self, strong: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """Tell which nodes some mode leaves to themselves: in one of several closed components, or apart from one."""
        divided = np.zeros(self._size, dtype=bool)
        for structure in self.component.structures:
            count = np.zeros(self._size, dtype=np.int64)
            for component in structure.closed_components:
                divided[list(component.nodes)] |= ~closed[component.nodes[0]]
                count[strong[component.nodes[0]]] += 1
            divided |= closed & (count[strong] > 1)
        return divided


def _strong_components(n: int, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    pattern = sparse.csr_array((np.ones(source.size, dtype=np.int8), (source, target)), shape=(n, n))
    return np.asarray(connected_components(pattern, connection="strong")[1], dtype=np.int64)
