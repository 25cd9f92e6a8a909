"""What decides the behaviour of a signed digraph: components, closed components, camps, negative cycles.

Everything here is combinatorial and exact: it looks at edges and at signs of exact weights, never at a float.
Time and memory are linear in nodes and edges.

A *closed strong component* (CSC) is a strongly connected component that nobody inside listens out of: a source of
the condensation in the direction in which information flows. Its nodes are *leaders*, all other nodes *followers*.
A graph is *structurally balanced* iff a *gauge* ``g`` in {-1, +1}^N exists with ``w_kl g_k g_l > 0`` on every edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.labels import import_pandas
from ptcc_certify.graphs.packed_weights import ReadOnly
from ptcc_certify.lazy_report import Shown

if TYPE_CHECKING:
    import pandas as pd

STABILITY = "stability"
BIPARTITE_CONSENSUS = "bipartite consensus"
INTERVAL_BIPARTITE_CONSENSUS = "interval bipartite consensus"
BIPARTITE_CONTAINMENT = "bipartite containment"
CONSENSUS = "consensus"
SIGNED_AVERAGE_CONSENSUS = "signed-average consensus"
CONTAINMENT = "containment"

BEHAVIOURS = (
    STABILITY,
    CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS,
    BIPARTITE_CONSENSUS,
    INTERVAL_BIPARTITE_CONSENSUS,
    CONTAINMENT,
    BIPARTITE_CONTAINMENT,
)

Edge = tuple[int, int]
_CLAIMS = "ptcc_certify.theorems.claims"


@dataclass(frozen=True)
class ClosedComponent:
    """A closed strong component with the witness of its balance.

    Attributes
    ----------
    nodes : tuple of int
        Node indices, ascending.
    balanced : bool
        Whether it splits into two camps, allies within and opponents across.
    gauge : tuple of +1/-1, or None
        Camps in the order of ``nodes`` (Lemma 1), the first node +1; None if unbalanced.
    negative_cycle : tuple of (source, target), or None
        A closed walk of the underlying undirected multigraph whose signs multiply to -1; None if balanced.

    References
    ----------
    Section II and Lemma 1 of [Zhu]_.

    Examples
    --------
    >>> analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1), (2, 3, 1)])).closed_components[0]
    ClosedComponent(nodes=(0, 1), balanced=True, gauge=(1, -1), negative_cycle=None)
    """

    nodes: tuple[int, ...]
    balanced: bool
    gauge: tuple[int, ...] | None
    negative_cycle: tuple[Edge, ...] | None


def behaviour_name(text: str) -> str:
    """Return the behaviour that ``text`` names, blanks and hyphens alike.

    Raises
    ------
    ParameterError
        No such behaviour; the message lists them.

    Examples
    --------
    >>> behaviour_name("interval-bipartite-consensus")
    'interval bipartite consensus'
    """
    text = str(text)
    for name in BEHAVIOURS:
        if text.replace("-", " ") == name.replace("-", " "):
            return name
    names = [name.replace(" ", "-") for name in BEHAVIOURS]
    raise ParameterError(f'unknown behaviour "{text}"; one of {", ".join(names)}{did_you_mean(text, names)}')


@dataclass(frozen=True)
class WeakComponent:
    """One weakly connected component: its nodes, how it is connected, which CSCs it holds, what it will do.

    Attributes
    ----------
    nodes : tuple of int
        Node indices, ascending.
    connectivity : {"strong", "quasi-strong", "weak"}
    closed : tuple of int
        Indices of its closed strong components among ``closed_components`` of the graph.
    leaders_balanced : bool
        Whether some of these are balanced.
    balanced, all_positive, undirected : bool
        As of :class:`Structure`, of the component by itself.

    References
    ----------
    Section II and Theorems 1 to 3 of [Zhu]_.

    Examples
    --------
    >>> two = analyse(SignedDigraph.from_edges([(1, 2, 1), (3, 4, 1), (4, 3, -1)]))
    >>> [(c.nodes, c.connectivity, c.claim.behaviour) for c in two.components]
    [((0, 1), 'quasi-strong', 'interval bipartite consensus'), ((2, 3), 'strong', 'stability')]
    """

    nodes: tuple[int, ...]
    connectivity: str
    closed: tuple[int, ...]
    leaders_balanced: bool
    balanced: bool
    all_positive: bool
    undirected: bool

    @cached_property
    def claim(self) -> Any:
        """What the theorems say of it (:mod:`ptcc_certify.theorems.claims`, which is loaded when this is asked)."""
        return import_module(_CLAIMS).claim_of(self)


@dataclass(frozen=True, eq=False, repr=False)
class Structure(ReadOnly, Shown):
    """The structure of a signed digraph; made by :func:`analyse`.

    Attributes
    ----------
    graph : SignedDigraph
    connectivity : {"strong", "quasi-strong", "weak", "disconnected"}
    strong_component, weak_component : (N,) int array
        Component number of every node.
    closed_components : tuple of ClosedComponent
        Ordered by smallest node.
    components : tuple of WeakComponent
        Ordered by smallest node.
    leaders, followers : (K,), (N-K,) int array
        Node indices; leaders CSC after CSC, followers ascending.
    gauge : (N,) int8 array or None
        Camps of the whole graph; None if the whole graph is unbalanced.
    negative_cycle : tuple of (source, target) or None
        Witness that the whole graph is unbalanced.
    sign_symmetric : bool
        ``w_kl w_lk >= 0`` for all pairs.
    undirected : bool
        ``w_kl = w_lk`` for all pairs, exactly.
    all_positive : bool
        No edge is negative.

    References
    ----------
    Section II and Lemma 1 of [Zhu]_.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1), (2, 3, 1)]))
    >>> structure.connectivity, structure.leaders.tolist(), structure.followers.tolist()
    ('quasi-strong', [0, 1], [2])
    >>> structure.balanced, structure.negative_cycle, structure.claim.theorem
    (False, ((0, 1), (1, 0)), '2.2')
    """

    graph: SignedDigraph
    connectivity: str
    strong_component: np.ndarray
    weak_component: np.ndarray
    closed_components: tuple[ClosedComponent, ...]
    components: tuple[WeakComponent, ...]
    leaders: np.ndarray
    followers: np.ndarray
    gauge: np.ndarray | None
    negative_cycle: tuple[Edge, ...] | None
    sign_symmetric: bool
    undirected: bool
    all_positive: bool

    def __post_init__(self) -> None:
        self.lock()

    @property
    def balanced(self) -> bool:
        """Whether the whole graph is structurally balanced."""
        return self.gauge is not None

    @property
    def claim(self) -> Any:
        """The claim of a weakly connected graph; None if disconnected (see ``components``)."""
        return self.components[0].claim if len(self.components) == 1 else None

    def holds(self, behaviour: str) -> bool:
        """Tell whether every component shows ``behaviour`` from every initial state that is not degenerate.

        Theorems and corollaries decide, but for the signed average: a strongly connected balanced component meets at
        it iff every node listens as much as it is listened to, undirected or not.

        Parameters
        ----------
        behaviour : str
            As in :meth:`ptcc_certify.theorems.claims.Claim.holds`.

        Returns
        -------
        bool

        Raises
        ------
        ParameterError
            No behaviour is called so.
        """
        wanted = behaviour_name(behaviour)
        return all(
            component.claim.holds(wanted)
            or (
                wanted == SIGNED_AVERAGE_CONSENSUS
                and component.claim.behaviour == BIPARTITE_CONSENSUS
                and self._even(component)
            )
            for component in self.components
        )

    def _even(self, component: WeakComponent) -> bool:
        """Tell whether in-weights equal out-weights at every node of a component, exactly."""
        inside = np.isin(self.graph.target, component.nodes)
        surplus = dict.fromkeys(component.nodes, Fraction(0))
        for edge in np.flatnonzero(inside).tolist():
            weight = abs(self.graph.exact_weight(edge))
            surplus[int(self.graph.target[edge])] += weight
            surplus[int(self.graph.source[edge])] -= weight
        return not any(surplus.values())

    def to_pandas(self) -> pd.DataFrame:
        """Return one row per node.

        Its ``role`` is leader or follower; ``group`` is the number of a leader's closed component, missing for
        followers; ``component`` that of the weakly connected one. ``camp`` is +1 or -1 within the component if the
        whole graph is balanced; else within a leader's group, 0 if that is unbalanced, and missing for followers.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> print(*analyse([("a", "b", -1), ("b", "a", -1), ("b", "c", 1)]).to_pandas().loc["b"])
        leader 1 -1 1
        """
        pandas, n = import_pandas(), self.graph.n_nodes
        group: list[int | None] = [None] * n
        camp = group.copy()
        for number, closed in enumerate(self.closed_components, start=1):
            for node, side in zip(closed.nodes, closed.gauge or (0,) * len(closed.nodes), strict=True):
                group[node], camp[node] = number, side
        camp = camp if self.gauge is None else self.gauge.tolist()
        columns = {
            "role": ["follower" if number is None else "leader" for number in group],
            "group": pandas.array(group, dtype="Int64"),
            "camp": pandas.array(camp, dtype="Int64"),
            "component": self.weak_component + 1,
        }
        return pandas.DataFrame(columns, index=pandas.Index(self.graph.labels, name="node"))

    def __eq__(self, other: object) -> bool:
        """Two structures are equal when their graphs are, with their nodes in the same order."""
        same = isinstance(other, Structure) and self.graph.labels == other.graph.labels
        return same and self.graph == other.graph  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash(self.graph)

    def __repr__(self) -> str:
        closed, balanced = len(self.closed_components), sum(c.balanced for c in self.closed_components)
        claim = f"{len(self.components)} components"
        if self.claim:
            claim = f"{self.claim.reference}: {self.claim.sharpest}"
        return (
            f"Structure({self.graph.n_nodes} nodes, {self.connectivity}, {counted(closed, 'closed component')}, "
            f"{balanced} balanced, {self.leaders.size} leaders; {claim})"
        )


def analyse(graph: Any, orientation: str | None = None) -> Structure:
    """Find components, leaders, camps, negative cycles and the theorem that applies.

    Parameters
    ----------
    graph : graph-like
        Whatever :func:`ptcc_certify.as_graph` takes; a structure is returned as it is.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    Structure

    References
    ----------
    Section II of [Zhu]_ (Lemmas 1 and 2, Theorems 1 to 3, Corollaries 1 to 5).

    Examples
    --------
    >>> g = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1)])
    >>> analyse(g)
    Structure(3 nodes, quasi-strong, 1 closed component, 1 balanced, 2 leaders; Theorem 2.1, Corollary 3: bipartite \
consensus)
    """
    if isinstance(graph, Structure) and orientation is None:
        return graph
    return _structure_of(as_graph(graph, orientation))


def _structure_of(graph: SignedDigraph) -> Structure:
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    n, source, target, sign = graph.n_nodes, graph.source, graph.target, graph.sign
    pattern = sparse.csr_array((np.ones(source.size, dtype=np.int8), (source, target)), shape=(n, n))
    strong, weak = (_by_first_node(connected_components(pattern, connection=kind)[1]) for kind in ("strong", "weak"))
    inside = strong[source] == strong[target]
    is_closed = np.ones(strong.max() + 1, dtype=bool)
    is_closed[strong[target[~inside]]] = False
    leader = is_closed[strong]

    closed = _closed_components(graph, strong, is_closed, inside & leader[target])
    gauge, violated, negative_cycle = find_camps(n, source, target, sign)
    opposed, one_way = _mutual_edges(graph)
    # Which weak components are balanced, all positive, undirected.
    flags = [_none_of(weak, source[edges]) for edges in (violated, sign < 0, one_way)]
    components = _weak_components(weak, strong, closed, np.column_stack(flags))
    return Structure(
        graph=graph,
        connectivity=components[0].connectivity if len(components) == 1 else "disconnected",
        strong_component=strong,
        weak_component=weak,
        closed_components=closed,
        components=components,
        leaders=np.array([v for c in closed for v in c.nodes], dtype=np.int64),
        followers=np.flatnonzero(~leader),
        gauge=None if violated.size else gauge,
        negative_cycle=negative_cycle(int(violated[0])) if violated.size else None,
        sign_symmetric=opposed.size == 0,
        undirected=one_way.size == 0,
        all_positive=bool((sign > 0).all()),
    )


def find_camps(
    n: int, source: np.ndarray, target: np.ndarray, sign: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Callable[[int], tuple[Edge, ...]]]:
    """Assign camps along a breadth-first forest of the underlying undirected multigraph (Lemma 1).

    Returns
    -------
    gauge : (N,) int8 array
        +1 at the smallest node of each component.
    violated : int array
        Numbers of the edges that violate it, ascending.
    negative_cycle : function
        Of such a number: the closed walk that the edge makes with the forest.
    """
    from scipy import sparse
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    low, high = np.minimum(source, target), np.maximum(source, target)
    pair, first = np.unique(low * n + high, return_index=True)  # of parallel edges, the first counts
    pattern = sparse.csr_array((np.ones(pair.size, dtype=np.int8), (pair // n, pair % n)), shape=(n, n))
    _, component = connected_components(pattern, directed=False)
    _, root = np.unique(component, return_index=True)
    # A virtual node n reaches the smallest node of every component, so that one search covers them all.
    rows, columns = np.concatenate([pair // n, np.full(root.size, n)]), np.concatenate([pair % n, root])
    forest = sparse.csr_array((np.ones(rows.size, dtype=np.int8), (rows, columns)), shape=(n + 1, n + 1))
    _, parent = breadth_first_order(forest, n, directed=False, return_predecessors=True)
    parent = parent[:n].astype(np.int64)

    child = np.flatnonzero(parent != n)
    keys = np.minimum(child, parent[child]) * n + np.maximum(child, parent[child])
    parent_edge = np.full(n, -1, dtype=np.int64)
    parent_edge[child] = first[np.searchsorted(pair, keys)]

    gauge, jump = np.ones(n + 1, dtype=np.int8), np.append(parent, n)
    gauge[child] = sign[parent_edge[child]]
    while (jump != n).any():  # doubling: gauge becomes the product of the signs up to the root
        gauge, jump = gauge * gauge[jump], jump[jump]
    gauge = gauge[:n]
    violated = np.flatnonzero(sign * gauge[source] * gauge[target] < 0)

    def path_to_root(node: int) -> list[int]:
        path = []
        while (edge := int(parent_edge[node])) >= 0:
            path.append(edge)
            node = int(parent[node])
        return path

    def negative_cycle(edge: int) -> tuple[Edge, ...]:
        left, right = path_to_root(int(source[edge])), path_to_root(int(target[edge]))
        while left and right and left[-1] == right[-1]:
            left.pop()
            right.pop()
        walk = [edge, *right, *reversed(left)]
        return tuple((int(source[e]), int(target[e])) for e in walk)

    return gauge, violated, negative_cycle


def weak_components(n: int, source: np.ndarray, target: np.ndarray) -> list[np.ndarray]:
    """Return the nodes of each weakly connected component, ascending, in the order of their first nodes.

    Examples
    --------
    >>> [nodes.tolist() for nodes in weak_components(3, np.array([2]), np.array([0]))]
    [[0, 2], [1]]
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    pattern = sparse.csr_array((np.ones(source.size, dtype=np.int8), (source, target)), shape=(n, n))
    return _groups(_by_first_node(connected_components(pattern, directed=False)[1]))


def _closed_components(
    graph: SignedDigraph, strong: np.ndarray, is_closed: np.ndarray, edges: np.ndarray
) -> tuple[ClosedComponent, ...]:
    source, target, sign = graph.source[edges], graph.target[edges], graph.sign[edges]
    gauge, violated, negative_cycle = find_camps(graph.n_nodes, source, target, sign)
    violating = {int(strong[source[i]]): i for i in violated[::-1].tolist()}  # the first of each
    groups = _groups(strong)
    result = []
    for number in np.flatnonzero(is_closed).tolist():
        nodes = tuple(groups[number].tolist())
        if number in violating:
            result.append(ClosedComponent(nodes, False, None, negative_cycle(violating[number])))
        else:
            result.append(ClosedComponent(nodes, True, tuple(gauge[groups[number]].tolist()), None))
    return tuple(result)


def _weak_components(
    weak: np.ndarray, strong: np.ndarray, closed: tuple[ClosedComponent, ...], flags: np.ndarray
) -> tuple[WeakComponent, ...]:
    groups = _groups(weak)
    contents: list[list[int]] = [[] for _ in groups]
    for i, component in enumerate(closed):
        contents[weak[component.nodes[0]]].append(i)
    _, first = np.unique(weak, return_index=True)
    whole = _none_of(weak, strong != strong[first[weak]])
    result = []
    for nodes, closed_in, one, row in zip(groups, contents, whole.tolist(), flags.tolist(), strict=True):
        connectivity = "strong" if one else "quasi-strong" if len(closed_in) == 1 else "weak"
        balanced = any(closed[i].balanced for i in closed_in)
        result.append(WeakComponent(tuple(nodes.tolist()), connectivity, tuple(closed_in), balanced, *row))
    return tuple(result)


def _mutual_edges(graph: SignedDigraph) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges whose reverse has the opposite sign, and those whose reverse is missing or differs."""
    n, m = graph.n_nodes, graph.n_edges
    forward, backward = graph.target * n + graph.source, graph.source * n + graph.target  # forward ascends
    place = np.minimum(np.searchsorted(forward, backward), max(m - 1, 0))
    mutual = forward[place] == backward if m else np.zeros(0, dtype=bool)
    opposed = np.flatnonzero(mutual & (graph.sign != graph.sign[place]))
    one_way = np.flatnonzero(~(mutual & graph.equal_weights(place)))
    return opposed, one_way


def _none_of(component: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Tell for each component whether none of ``nodes`` lies in it."""
    return np.bincount(component[nodes], minlength=component.max() + 1) == 0


def _groups(component: np.ndarray) -> list[np.ndarray]:
    """Return the nodes of each component, ascending."""
    return np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])


def _by_first_node(component: np.ndarray) -> np.ndarray:
    """Renumber components by their smallest node."""
    _, first, inverse = np.unique(component, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]
