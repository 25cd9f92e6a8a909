"""What a family of signed digraphs does under every signal: decided exactly, with a counterexample where it is refuted.

The *mandatory graph* of a mode has its mandatory edges at ``w-``. With the kernel ``K`` of the Laplacian of the first
one, and its basis ``B`` whose row ``B_k`` belongs to node ``k``, these are equivalent (docs/theory/families.md):

- every mandatory graph has the kernel ``K``, and every uncertain edge of every mode has ``B_k = sgn(w_kl) B_l``;
- ``K`` is at rest in every member, and every solution under every signal comes to ``K`` exponentially, on the stretched
  clock: exactly at the deadline.

``K = {0}`` is stability, ``K = span g`` with camps ``g`` bipartite consensus: both are decided on edges alone, in
linear time. Otherwise agents that follow several groups, or a group of which they are no camp, have rows of ``B`` that
are rational numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import (
    BIPARTITE_CONSENSUS,
    BIPARTITE_CONTAINMENT,
    INTERVAL_BIPARTITE_CONSENSUS,
    STABILITY,
    Edge,
    Structure,
    analyse,
    find_camps,
    weak_components,
)
from ptcc_certify.theorems.lemmas import solve_exact

DEPENDS = "depends on the signal"
#: Of the basis of a kernel: a row that only an exact solve tells.
_UNKNOWN = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Counterexample:
    """What refutes a behaviour for every signal; each kind is verified in exact arithmetic from the family alone.

    Attributes
    ----------
    kind : {"balanced closed set", "two closed components", "no camps", "different kernels", "moving rest state"}
        - a mode has a set of nodes that no mandatory edge enters, whose camps all its mandatory edges keep: held
          constant with the optional edges off, it stays at the camps, and does not come to 0;
        - a mode has two closed components: held constant, they do not meet;
        - signs along ``cycle``, a closed walk of edges of any modes, multiply to -1: no camps keep all edges;
        - the mandatory graphs of two modes have kernels of different dimensions;
        - ``state`` is at rest in the mandatory graph of the first mode, and moves in another member.
    mode, other : int
        Numbers of the modes, from 0; of the member in which ``state`` moves, ``other``.
    nodes : tuple of int
        The balanced closed set, or one node of each of the two components.
    camps : tuple of +1/-1
        Those of ``nodes``.
    cycle : tuple of (source, target)
    edge : int or None
        The uncertain edge of the mode ``other`` that is at ``w+`` in that member; None if none is.
    state : tuple of N Fraction, or None

    References
    ----------
    docs/theory/families.md, "Refutations".
    """

    kind: str
    mode: int = 0
    other: int = 0
    nodes: tuple[int, ...] = ()
    camps: tuple[int, ...] = ()
    cycle: tuple[Edge, ...] = ()
    edge: int | None = None
    state: tuple[Fraction, ...] | None = None


@dataclass(frozen=True, eq=False)
class FamilyComponent:
    """One weakly connected component of the union of all modes, and what it does under every signal.

    Attributes
    ----------
    nodes : (n,) int array
        Indices, ascending. Nodes of the attributes below are numbered within it.
    family : Family
        The family on these nodes.
    behaviour : str or None
        ``stability``, ``bipartite consensus``, ``interval bipartite consensus``, ``bipartite containment`` or
        ``depends on the signal``; None where it takes an exact solve of too many rows, which neither stability nor
        consensus needs.
    gauge : (n,) int8 array or None
        Camps that all edges of all modes keep, the first node +1; None if there are none.
    kernel : Kernel or None
        The states at rest in every member; None where it depends on the signal.
    counterexample : Counterexample or None
        Where it depends on the signal: why there is no common kernel.
    """

    nodes: np.ndarray
    family: Family
    behaviour: str | None
    gauge: np.ndarray | None
    kernel: Kernel | None
    counterexample: Counterexample | None

    @cached_property
    def structures(self) -> tuple[Structure, ...]:
        """The structure of the mandatory graph of every mode."""
        return tuple(analyse(mode.mandatory) for mode in self.family.modes)

    def refutation(self, behaviour: str) -> Counterexample | None:
        """Return what refutes ``behaviour`` for every signal; None if it holds, or is not decided.

        Examples
        --------
        >>> pair = Family.from_intervals([("a", "b", 0, 1), ("b", "a", 1, 2)])
        >>> decide(pair)[0].refutation("stability").kind
        'balanced closed set'
        """
        if self.behaviour in (behaviour, None):
            return None
        if behaviour == STABILITY:
            return self._balanced_closed_set()
        if behaviour == BIPARTITE_CONSENSUS:
            return self._two_components() or self._negative_cycle()
        return self.counterexample

    def _balanced_closed_set(self) -> Counterexample | None:
        for number, structure in enumerate(self.structures):
            for closed in structure.closed_components:
                if closed.gauge is not None:
                    return Counterexample("balanced closed set", number, nodes=closed.nodes, camps=closed.gauge)
        return None

    def _two_components(self) -> Counterexample | None:
        for number, structure in enumerate(self.structures):
            if len(structure.closed_components) > 1:
                one, two = structure.closed_components[:2]
                return Counterexample("two closed components", number, nodes=(one.nodes[0], two.nodes[0]))
        return None

    def _negative_cycle(self) -> Counterexample | None:
        _, violated, negative_cycle = find_camps(self.family.n_nodes, *self.family.union)
        if not violated.size:
            return None
        return Counterexample("no camps", cycle=negative_cycle(int(violated[0])))


def decide(family: Family) -> tuple[FamilyComponent, ...]:
    """Decide what every weakly connected component of a family does under every signal.

    Parameters
    ----------
    family : Family

    Returns
    -------
    tuple of FamilyComponent
        Ordered by smallest node.

    References
    ----------
    docs/theory/families.md, "The decision".

    Examples
    --------
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> [c.behaviour for c in decide(Family.switching([day, night]))]
    ['bipartite consensus']
    >>> spoiled = SignedDigraph.from_edges([("c", "a", 2), ("a", "b", 1)])
    >>> component = decide(Family.switching([day, spoiled]))[0]
    >>> component.behaviour, component.counterexample.kind
    ('depends on the signal', 'moving rest state')
    """
    n = family.n_nodes
    source, target, _ = family.union
    result = []
    for nodes in weak_components(n, source, target):
        part = family if nodes.size == n else family.restricted(nodes)
        result.append(_decide_connected(nodes, part))
    return tuple(result)


def _decide_connected(nodes: np.ndarray, family: Family) -> FamilyComponent:
    structures = tuple(analyse(mode.mandatory) for mode in family.modes)
    gauge, violated, _ = find_camps(family.n_nodes, *family.union)
    camps = None if violated.size else gauge
    behaviour: str | None = None
    kernel, counterexample = None, None
    dimensions = [sum(c.balanced for c in s.closed_components) for s in structures]
    if not any(dimensions):
        behaviour, kernel = STABILITY, Kernel(structures[0])
    elif camps is not None and all(len(s.closed_components) == 1 for s in structures):
        behaviour, kernel = BIPARTITE_CONSENSUS, Kernel(structures[0])
    elif len(set(dimensions)) > 1:
        behaviour = DEPENDS
        most, least = int(np.argmax(dimensions)), int(np.argmin(dimensions))
        counterexample = Counterexample("different kernels", most, least)
    else:
        common = Kernel(structures[0])
        try:
            counterexample = _moving_rest_state(family, common)
            behaviour = DEPENDS if counterexample else BIPARTITE_CONTAINMENT
            if behaviour == BIPARTITE_CONTAINMENT and dimensions[0] == 1:
                behaviour = INTERVAL_BIPARTITE_CONSENSUS
            kernel = None if counterexample else common
        except TooLarge:
            behaviour = None
    component = FamilyComponent(nodes, family, behaviour, camps, kernel, counterexample)
    component.__dict__["structures"] = structures
    return component


# ---------------------------------------------------------------------- kernels


class TooLarge(Exception):
    """The rows of a kernel are rational numbers, and there are too many to solve for."""


class Kernel:
    """The kernel of a signed Laplacian, by the rows of its basis ``B``.

    Column ``j`` belongs to balanced closed component ``j``: its camps there, 0 in the others. The row of an agent that
    ends in a camp of one component whatever the weights, or at 0, is known from the edges; the others need a solve.

    Parameters
    ----------
    structure : Structure

    Attributes
    ----------
    dimension : int
    codes : (n,) int array
        ``j + 1`` or ``-(j + 1)`` for a row that is a unit vector or its opposite, 0 for a row of zeros.
    """

    def __init__(self, structure: Structure):
        self.structure = structure
        balanced = [c for c in structure.closed_components if c.gauge is not None]
        self.dimension = len(balanced)
        codes = np.full(structure.graph.n_nodes, _UNKNOWN)
        codes[structure.leaders] = 0
        for number, component in enumerate(balanced, 1):
            codes[list(component.nodes)] = number * np.array(component.gauge)
        self.codes = _follow(structure.graph, codes)

    @cached_property
    def _solved(self) -> dict[int, list[Fraction]]:
        """The rows that the edges alone do not tell."""
        unknown = np.flatnonzero(self.codes == _UNKNOWN).tolist()
        if len(unknown) > EXACT_NODES:
            raise TooLarge
        rows, place = self.structure.graph.exact_rows(unknown), {v: k for k, v in enumerate(unknown)}
        zero = Fraction(0)
        block = [[row.get(v, zero) for v in unknown] for row in rows]
        pull = [
            [-sum((w * self.row(v)[j] for v, w in row.items() if v not in place), zero) for j in range(self.dimension)]
            for row in rows
        ]
        solution = solve_exact(block, pull)
        assert solution is not None, "a follower block is never singular"
        return dict(zip(unknown, solution, strict=True))

    def row(self, node: int) -> Sequence[Fraction]:
        """Return ``B_k`` of a node, exact.

        Raises
        ------
        TooLarge
            The edges alone do not tell it, nor those of more than 120 agents.
        """
        code = int(self.codes[node])
        if code == _UNKNOWN:
            return self._solved[node]
        row = [Fraction(0)] * self.dimension
        if code:
            row[abs(code) - 1] = Fraction(1 if code > 0 else -1)
        return row

    def column(self, j: int) -> tuple[Fraction, ...] | None:
        """Return column ``j`` of ``B``, a state at rest; None if it takes a solve of too many rows."""
        try:
            return tuple(self.row(v)[j] for v in range(self.codes.size))
        except TooLarge:
            return None

    def disagreeing(self, source: np.ndarray, target: np.ndarray, sign: np.ndarray) -> Iterator[tuple[int, int]]:
        """Yield edges with ``B_target != sign B_source``, each with a column that tells, lazily; each at least once.

        Raises
        ------
        TooLarge
            After the others, where an edge depends on a row that is not known; see :meth:`row`.
        """
        ends, heard = self.codes[target], self.codes[source]
        unknown = (ends == _UNKNOWN) | (heard == _UNKNOWN)
        differ = ~unknown & (ends != sign * np.where(unknown, 0, heard))
        # An unknown row is a proper mean of others, and never a unit vector.
        unit = np.where(ends == _UNKNOWN, heard, ends)
        for edge in np.flatnonzero(unknown & (unit != _UNKNOWN) & (unit != 0)).tolist():
            yield edge, abs(int(unit[edge])) - 1
        for edge in [*np.flatnonzero(differ).tolist(), *np.flatnonzero(unknown).tolist()]:
            pairs = zip(self.row(int(target[edge])), self.row(int(source[edge])), strict=True)
            column = next((j for j, (b, c) in enumerate(pairs) if b != int(sign[edge]) * c), None)
            if column is not None:
                yield edge, column

    def first_moved(self, graph: SignedDigraph) -> int | None:
        """Return a column of ``B`` that is not at rest in ``graph``; None if ``L B = 0``.

        Raises
        ------
        TooLarge
            None is found, and some row of ``L B`` is not known.
        """
        ends, heard = self.codes[graph.target], self.codes[graph.source]
        # Where all edges of a row agree with B, its sum is 0.
        agree = (ends != _UNKNOWN) & (heard != _UNKNOWN) & (ends == graph.sign * np.where(heard == _UNKNOWN, 0, heard))
        suspects = np.unique(graph.target[~agree]).tolist()
        unknown = False
        for row in graph.exact_rows(suspects):
            try:
                for j in range(self.dimension):
                    if sum((w * self.row(v)[j] for v, w in row.items()), Fraction(0)):
                        return j
            except TooLarge:
                unknown = True
        if unknown:
            raise TooLarge
        return None


def _follow(graph: SignedDigraph, codes: np.ndarray) -> np.ndarray:
    """Return the codes of followers that hear one camp only, through edges that all agree; the rest stay unknown."""
    from scipy import sparse

    n, codes = graph.n_nodes, codes.copy()
    follower = codes == _UNKNOWN
    into = np.flatnonzero(follower[graph.target])
    source, target, sign = graph.source[into], graph.target[into], graph.sign[into].astype(np.int64)
    for layer, edges in _layers(n, source, target, np.flatnonzero(~follower)):
        codes[layer] = sign[edges] * codes[source[edges]]
    # A follower that hears anything else spoils itself and all that hear it.
    spoiled = np.unique(target[codes[target] != sign * codes[source]])
    if spoiled.size:
        pattern = sparse.csr_array((np.ones(into.size, dtype=np.int8), (source, target)), shape=(n, n))
        codes[_reached(pattern, spoiled)] = _UNKNOWN
    return codes


def _layers(
    n: int, source: np.ndarray, target: np.ndarray, first: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the followers breadth first, layer by layer, each with an edge that it hears an earlier node by."""
    order = np.argsort(source, kind="stable")
    start = np.searchsorted(source[order], np.arange(n + 1))
    seen = np.zeros(n, dtype=bool)
    seen[first] = True
    front = first
    while front.size:
        counts = start[front + 1] - start[front]
        where = np.repeat(start[front] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts) + np.arange(
            counts.sum()
        )
        edges = order[where]
        edges = edges[~seen[target[edges]]]
        front, which = np.unique(target[edges], return_index=True)
        seen[front] = True
        if front.size:
            yield front, edges[which]


def _reached(pattern: object, first: np.ndarray) -> np.ndarray:
    """Return the nodes that information from ``first`` reaches, these included."""
    from scipy import sparse
    from scipy.sparse.csgraph import breadth_first_order

    n = pattern.shape[0]  # type: ignore[attr-defined]
    extra = sparse.csr_array((np.ones(first.size, dtype=np.int8), (np.zeros(first.size, dtype=int), first)), (1, n))
    whole = sparse.hstack([sparse.vstack([pattern, extra]), sparse.csr_array((n + 1, 1), dtype=np.int8)]).tocsr()
    found = breadth_first_order(whole, n, return_predecessors=False)
    return found[found < n]


def _moving_rest_state(family: Family, kernel: Kernel) -> Counterexample | None:
    """Return a state that is at rest in the first mandatory graph and moves in another member; None if there is none.

    Raises
    ------
    TooLarge
        None is found, and there may be one.
    """
    unknown = False
    for number, mode in enumerate(family.modes):
        try:
            if number and (j := kernel.first_moved(mode.mandatory)) is not None:
                return Counterexample("moving rest state", 0, number, state=kernel.column(j))
        except TooLarge:
            unknown = True
            continue
        uncertain = np.flatnonzero(~mode.known)
        ends = (end[uncertain] for end in (mode.source, mode.target, mode.sign))
        try:
            for edge, j in kernel.disagreeing(*ends):
                return Counterexample("moving rest state", 0, number, edge=int(uncertain[edge]), state=kernel.column(j))
        except TooLarge:
            unknown = True
    if unknown:
        raise TooLarge
    return None
