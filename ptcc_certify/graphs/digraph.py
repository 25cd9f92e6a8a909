"""Signed digraphs: immutable, labelled, sparse, with exact weights.

``w_kl != 0`` iff there is an edge ``v_l -> v_k``: information flows from ``l`` to ``k``, *k listens to l*. A
positive weight means ally, a negative one opponent. Rows of every matrix are listeners, columns are sources.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import FrozenInstanceError
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, NumberError, gated
from ptcc_certify.graphs.labels import first_five, import_pandas, in_all, labels_beside, place_of, refuse_unnamed
from ptcc_certify.graphs.packed_weights import LARGEST_WEIGHT, SMALLEST_WEIGHT, ReadOnly, Weights
from ptcc_certify.graphs.rationals import Exact, as_fraction, shorten, writable
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.lazy_report import Shown

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    from scipy import sparse

    from ptcc_certify.graphs.io.raw_edges import Rows

_SURROGATE_PAIR = re.compile("[\ud800-\udbff][\udc00-\udfff]")


_T = TypeVar("_T")


class CallableTuple(tuple[_T, ...]):
    """A tuple that may be called, too, as in networkx: ``graph.edges()`` is ``graph.edges``.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", -1)])
    >>> graph.labels(), graph.edges() == graph.edges == (("a", "b", -1),)
    (('a', 'b'), True)
    """

    __slots__ = ()

    def __call__(self) -> Self:
        """Return the tuple itself."""
        return self


#: Edges whose lines are hashed at a time.
_HASHED = 65_536


@gated
class SignedDigraph(ReadOnly, Shown):
    """A signed digraph with exact weights.

    Build one with :meth:`from_edges`, :meth:`from_matrix`, :meth:`from_networkx` or
    :func:`ptcc_certify.read_graph`. Nodes carry text labels; edge arrays are sorted by (target, source) index.

    Attributes
    ----------
    labels : tuple of str
        Node labels in index order: by value when all are integers, otherwise by first appearance.
    source, target : (n_edges,) int array
        Information flows from ``source`` to ``target``: the target listens.
    weights : (n_edges,) float64 array
        The weights, each rounded once; the constructor takes them exactly.
    sign : (n_edges,) int8 array
        +1 ally, -1 opponent.
    read : mapping, optional
        How the data were read: ``orientation``, ``duplicates``, ``self_loops``, ``undirected``, ``notes``. The
        constructor fills in what it is not told.

    Raises
    ------
    GraphError
        There is no node, two nodes bear one label, a weight is zero, an edge occurs twice or is a loop.

    References
    ----------
    Section II of [Zhu]_.
    Altafini, Consensus problems on networks with antagonistic interactions, IEEE Trans. Automat. Control 58 (2013).

    Examples
    --------
    >>> g = SignedDigraph.from_edges([("a", "b", 2), ("b", "a", "-0.5")])
    >>> g
    SignedDigraph(2 nodes, 2 edges, 1 negative)
    >>> g.laplacian().toarray()
    array([[ 0.5,  0.5],
           [-2. ,  2. ]])
    """

    def __init__(
        self,
        labels: Iterable[str],
        source: np.ndarray,
        target: np.ndarray,
        weights: Weights,
        read: Mapping[str, Any] | None = None,
    ):
        self.labels = CallableTuple(labels)
        n = len(self.labels)
        if n == 0:
            raise GraphError("the graph has no nodes; give at least one edge, or a row with one label")
        if len(set(self.labels)) != n:
            raise GraphError("two nodes bear the same label; rename one of them")
        for label in self.labels:
            if _SURROGATE_PAIR.search(label):
                name = shorten(label)
                raise GraphError(f"label {name} holds a character as two surrogates; write the character itself")
        source, target = np.asarray(source, dtype=np.int64), np.asarray(target, dtype=np.int64)
        order = np.lexsort((source, target))
        self.source, self.target = source[order], target[order]
        self._weights = weights.take(order)
        self.sign = self._weights.signs()
        self.read = dict(_READ_DEFAULT, **(read or {}))
        self.lock()
        self._weights.lock()
        self._refuse_bad_edges()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in vars(self) or any(name in vars(one) for one in type(self).__mro__):
            raise FrozenInstanceError(f"{name} of a graph stays as it is; make another graph")
        super().__setattr__(name, value)

    def _refuse_bad_edges(self) -> None:
        source, target, table = self.source, self.target, self._weights.table
        size = np.abs(self.weights)
        again = (source[1:] == source[:-1]) & (target[1:] == target[:-1])
        long = np.array([not writable(w) for w in table.tolist()] if table.dtype == object else [], dtype=bool)
        loops = source == target
        odd = ~((size >= SMALLEST_WEIGHT) & (size <= LARGEST_WEIGHT))
        for bad, message in (
            (loops, f"self-loop at node {{0}}{in_all(loops.sum())}; remove {'them' if loops.sum() > 1 else 'it'}"),
            (again, "two edges {0} -> {1}; keep one"),
            (table == 0, "weight 0 of edge {0} -> {1}: neither ally nor opponent; remove it or give a weight"),
            (long, "weight of edge {0} -> {1} has too many digits to keep; round it"),
            (odd, "weight of edge {0} -> {1} is outside the range of float64; rescale the weights"),
        ):
            if bad.any():
                raise GraphError(message.format(*(shorten(self.labels[p[np.argmax(bad)]]) for p in (source, target))))

    # ------------------------------------------------------------------ constructors

    @classmethod
    @gated
    def from_edges(
        cls,
        edges: Iterable[tuple[Hashable, Hashable, Exact]],
        nodes: Iterable[Hashable] = (),
        *,
        orientation: str = "information",
        duplicates: str = "refuse",
        drop_self_loops: bool = False,
        drop_zeros: bool = False,
        undirected: bool = False,
    ) -> SignedDigraph:
        """Build a graph from ``(source, target, weight)`` triples.

        Parameters
        ----------
        edges : iterable of (label, label, weight)
            A weight is an int, Fraction, float (the dyadic number it is) or a text of the exact grammar. Where all are
            words for signs (``+``, ``-``, activates, inhibits, ..) these are 1 and -1.
        nodes : iterable of labels, optional
            Further nodes, and the wish for an order: these come first unless all labels are integers.
        orientation : {"information", "listens"}
            ``information``: information flows first -> second. ``listens``: the first listens to the second.
        duplicates : {"refuse", "sum", "last"}
            As in :func:`ptcc_certify.read_graph`.
        drop_self_loops, drop_zeros, undirected : bool
            As in :func:`ptcc_certify.read_graph`.

        Raises
        ------
        GraphError
            A weight is zero or not finite, an edge occurs twice, or an edge is a loop.

        Examples
        --------
        >>> SignedDigraph.from_edges([("a", "b", 1)], orientation="listens").edges[0]
        ('b', 'a', Fraction(1, 1))
        """
        from ptcc_certify.graphs.io.raw_edges import Nodes, rows_of

        if not isinstance(edges, Iterable):
            raise GraphError(f"{shorten(repr(edges))} is no list of edges; give triples (source, target, weight)")
        known = Nodes()
        for node in nodes:
            known.number(node, "an edge")
        heads, tails, values = [], [], []
        for edge in edges:
            try:
                first, second, weight = edge
            except (TypeError, ValueError):
                mend = "; as_graph takes tables of pandas" if hasattr(edges, "columns") else ""
                raise GraphError(f"edge {shorten(repr(edge))} is not a triple (source, target, weight){mend}") from None
            heads.append(known.number(first, "an edge"))
            tails.append(known.number(second, "an edge"))
            values.append(weight)
        how = Reading(
            orientation=orientation,
            duplicates=duplicates,
            drop_self_loops=drop_self_loops,
            drop_zeros=drop_zeros,
            undirected=undirected,
        )
        return graph_of(rows_of([*known], heads, tails, values), "", how)

    @classmethod
    @gated
    def from_matrix(
        cls,
        matrix: Any,
        labels: Iterable[Hashable] | None = None,
        *,
        orientation: str | None = None,
        duplicates: str = "refuse",
        drop_self_loops: bool = False,
        undirected: bool = False,
        laplacian: bool | None = None,
    ) -> SignedDigraph:
        """Build a graph from an adjacency matrix: its entry (k, l) is read as the row ``k, l, entry`` of an edge list.

        Some write ``w_kl`` for what k makes of l, as the paper does, others for the edge k -> l, as networkx does. A
        matrix does not tell which, so that ``orientation`` must:

            from_matrix(W, orientation="listens").adjacency()              is the paper's W again
            from_matrix(nx.to_numpy_array(G), orientation="information")   is from_networkx(G), but for the labels

        Parameters
        ----------
        matrix : (N, N) array, SciPy sparse matrix or pandas DataFrame
            Integers are exact, floats are the dyadic numbers they are, texts obey the exact grammar: ``"-0.3"`` is
            -3/10. Entries may be Fractions; the diagonal is zero, or a Laplacian's. A DataFrame has the same labels on
            rows and columns, in any order; those of the rows become the nodes.
        labels : iterable of N labels, optional
            ``1 .. N`` by default; none beside those of a DataFrame.
        orientation : {"information", "listens"} or None
            ``information``: information flows from the row to the column. ``listens``: the row listens to the column.
            None is refused: it must be said.
        laplacian : bool, optional
            The matrix is a signed Laplacian ``D - W``: a weight is minus the entry. A matrix whose diagonal holds the
            sums of its rows is refused unless this says what it is.
        duplicates : {"refuse", "sum", "last"}
            As in :func:`ptcc_certify.read_graph`: entries of a sparse matrix may be repeated.
        drop_self_loops, undirected : bool
            As in :func:`ptcc_certify.read_graph`.

        Raises
        ------
        GraphError
            The orientation is not given, the matrix is not square, a diagonal entry is not zero, an entry is not a
            finite number, there are not N different labels, or rows and columns of a DataFrame have different ones.

        Examples
        --------
        >>> SignedDigraph.from_matrix([[0, -1], [0, 0]], orientation="listens").edges
        (('2', '1', Fraction(-1, 1)),)
        >>> SignedDigraph.from_matrix([[0, -1], [0, 0]], orientation="information").edges
        (('1', '2', Fraction(-1, 1)),)
        """
        from ptcc_certify.graphs.io.raw_edges import rows_of

        if hasattr(matrix, "is_multigraph"):
            raise GraphError("a networkx graph is no matrix; it is read by SignedDigraph.from_networkx")
        if orientation is None:
            raise GraphError(f"a matrix {WAY}")
        if hasattr(matrix, "columns") and (rows := labels_beside(matrix)) is not None:
            if labels is not None:
                raise GraphError("the DataFrame has labels of its own; leave out labels=, or give matrix.to_numpy()")
            labels, matrix = matrix.index, _aligned_frame(matrix, rows)
        row, column, values, n = _entries(matrix)
        nodes: list[Hashable] = list(range(1, n + 1)) if labels is None else list(labels)
        for label in nodes:
            refuse_unnamed(label, "the matrix")
        if len(nodes) != n:
            raise GraphError(f"{len(nodes)} labels for {n} rows")
        names = [str(label) for label in nodes]
        place = lambda k: f"row {shorten(names[row[k]])}, column {shorten(names[column[k]])} of the matrix"  # noqa: E731
        if values.dtype.kind == "f" and (odd := np.flatnonzero(~np.isfinite(values))).size:
            raise GraphError(f"{place(odd[0])} is {values[odd[0]]}; write 0 where there is no edge")
        for k, value in enumerate(values.tolist() if values.dtype.kind == "O" else ()):
            try:
                as_fraction(value, "the entry")
            except NumberError as error:
                raise GraphError(f"{place(k)}: {error}") from None
        how = Reading(
            orientation=orientation,
            duplicates=duplicates,
            drop_self_loops=drop_self_loops,
            undirected=undirected,
            laplacian=laplacian,
        )
        weights = values.tolist() if values.dtype.kind in "bO" else values
        return graph_of(rows_of(names, row, column, weights, matrix=True), "", how)

    @classmethod
    @gated
    def from_networkx(
        cls,
        graph: nx.DiGraph,
        weight: str | None = None,
        *,
        orientation: str = "information",
        duplicates: str = "refuse",
        drop_self_loops: bool = False,
        drop_zeros: bool = False,
        undirected: bool = False,
    ) -> SignedDigraph:
        """Build a graph from a networkx ``DiGraph``.

        Parameters
        ----------
        graph : networkx.DiGraph
        weight : str, optional
            The attribute of edges that holds their weights, and it alone; by default ``weight``, times ``sign`` or
            ``type`` if these are there and are signs, or one of these.
        orientation : {"information", "listens"}
            ``information``: information flows along an edge ``u -> v``. ``listens``: u listens to v, as in trust and
            rating data.
        duplicates : {"refuse", "sum", "last"}
            As in :func:`ptcc_certify.read_graph`.
        drop_self_loops, drop_zeros, undirected : bool
            As in :func:`ptcc_certify.read_graph`.

        Raises
        ------
        GraphError
            ``graph`` is undirected (say so, or give ``graph.to_directed()``), a multigraph (say what becomes of
            duplicates), an edge has no weight, or an attribute that makes a family of it.

        Examples
        --------
        >>> import networkx as nx
        >>> team = nx.DiGraph()
        >>> team.add_edge("ann", "bob", weight=-2)
        >>> SignedDigraph.from_networkx(team).edges, SignedDigraph.from_networkx(team, orientation="listens").edges
        ((('ann', 'bob', Fraction(-2, 1)),), (('bob', 'ann', Fraction(-2, 1)),))
        """
        from ptcc_certify.graphs.io.attributes import values_of_edges
        from ptcc_certify.graphs.io.raw_edges import Nodes, rows_of

        refuse_networkx(graph, undirected=undirected, multigraph=duplicates != "refuse")
        ends, data = [edge[:2] for edge in graph.edges], [more for *_, more in graph.edges(data=True)]
        edge = lambda k: f"{shorten(str(ends[k][0]))} -> {shorten(str(ends[k][1]))}"  # noqa: E731
        weights, beside = values_of_edges(data, edge, "", weight)
        known = Nodes()
        place = {node: known.number(node, "the graph") for node in graph}
        how = Reading(
            orientation=orientation,
            duplicates=duplicates,
            drop_self_loops=drop_self_loops,
            drop_zeros=drop_zeros,
            undirected=undirected,
        )
        heads, tails = [place[u] for u, _ in ends], [place[v] for _, v in ends]
        return graph_of(rows_of([*known], heads, tails, weights, beside), "", how)

    # ------------------------------------------------------------------ reading

    @property
    def n_nodes(self) -> int:
        """Number of nodes ``N``."""
        return len(self.labels)

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return int(self.source.size)

    @cached_property
    def index(self) -> dict[str, int]:
        """Map of label to node index."""
        return {label: i for i, label in enumerate(self.labels)}

    @cached_property
    def weights(self) -> np.ndarray:
        """(n_edges,) float64 array: the weights, each rounded once."""
        values = self._weights.as_float()
        values.flags.writeable = False
        return values

    def exact_weight(self, edge: int) -> Fraction:
        """Return the weight of edge number ``edge`` exactly."""
        return self._weights.fraction(edge)

    @cached_property
    def weight_decades(self) -> int:
        """How many powers of ten lie between the smallest and the largest size of a weight; 0 without edges."""
        sizes = {abs(self._weights.fraction(int(i))) for i in np.unique(self._weights.table, return_index=True)[1]}
        ratio = max(sizes) / min(sizes) if sizes else Fraction(1)
        return len(str(ratio.numerator // ratio.denominator)) - 1

    def weight_table(self) -> tuple[np.ndarray | None, int]:
        """Return int64 numerators or float64 weights, in the order of the edges, and what divides them.

        None where neither holds the weights exactly.
        """
        table = self._weights.table
        return (None if table.dtype == object else table), self._weights.scale

    @cached_property
    def weight_texts(self) -> list[str]:
        """The weights as exact texts, in the order of the edges."""
        return self._weights.texts()

    def equal_weights(self, other: np.ndarray) -> np.ndarray:
        """Tell for each edge ``i`` whether its weight equals that of edge ``other[i]``, exactly."""
        return np.asarray(self._weights.table == self._weights.table[other], dtype=bool)

    @property
    def edges(self) -> CallableTuple[tuple[str, str, Fraction]]:
        """All edges as ``(source label, target label, exact weight)``, sorted by (target, source) index."""
        pairs = enumerate(zip(self.source.tolist(), self.target.tolist(), strict=True))
        return CallableTuple((self.labels[s], self.labels[t], self._weights.fraction(i)) for i, (s, t) in pairs)

    def adjacency(self) -> sparse.csr_array:
        """(N, N) sparse float64 matrix ``W``; rows are listeners."""
        from scipy import sparse

        n = self.n_nodes
        return sparse.csr_array((self.weights, (self.target, self.source)), shape=(n, n))

    def laplacian(self) -> sparse.csr_array:
        """(N, N) sparse float64 signed Laplacian ``L = D - W``, ``D = diag(sum_l |w_kl|)``."""
        from scipy import sparse

        return sparse.csr_array(sparse.diags_array(self.in_weight()) - self.adjacency())

    def dense_laplacian(self) -> np.ndarray:
        """(N, N) dense float64 signed Laplacian, for small graphs."""
        return self.laplacian().toarray()

    def in_weight(self) -> np.ndarray:
        """(N,) float64 array: ``D_k = sum_l |w_kl|``, how much node k listens in total."""
        return np.bincount(self.target, np.abs(self.weights), minlength=self.n_nodes).astype(np.float64)

    def exact_laplacian(self) -> list[list[Fraction]]:
        """Return the signed Laplacian as N rows of N rationals (small graphs)."""
        nodes = range(self.n_nodes)
        return [[row.get(column, Fraction(0)) for column in nodes] for row in self.exact_rows(nodes)]

    def exact_rows(self, nodes: Iterable[int | str]) -> list[dict[int, Fraction]]:
        """Return rows of the signed Laplacian as ``{column: rational}``, without zeros.

        Parameters
        ----------
        nodes : iterable of int or str
            Indices of the rows, or their labels if these are texts.

        Returns
        -------
        list of dict of int to Fraction

        Raises
        ------
        UnknownAgentError
            There is no such node.
        """
        start = np.searchsorted(self.target, np.arange(self.n_nodes + 1))
        rows = []
        for node in (place_of(node, self.labels) for node in nodes):
            edges = range(int(start[node]), int(start[node + 1]))
            row = {int(self.source[edge]): -self._weights.fraction(edge) for edge in edges}
            total = sum(map(abs, row.values()), Fraction(0))
            rows.append({**row, node: total} if total else {})
        return rows

    def subgraph(self, nodes: Sequence[int | str] | np.ndarray) -> SignedDigraph:
        """Return the graph induced by some nodes, in the order in which they are given.

        Parameters
        ----------
        nodes : sequence of int or str
            Indices, or labels if these are texts.

        Raises
        ------
        UnknownAgentError, GraphError
            There is no such node, or none at all.

        Examples
        --------
        >>> graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2)])
        >>> graph.subgraph(["c", "b"]).labels, graph.subgraph([1, 2]).labels
        (('c', 'b'), ('b', 'c'))
        """
        if not isinstance(nodes, np.ndarray) and any(isinstance(node, str) for node in nodes):
            nodes = [place_of(node, self.labels) for node in nodes]
        nodes = np.asarray(nodes)
        if not nodes.size:
            nodes = nodes.astype(np.int64)
        elif nodes.ndim != 1 or nodes.dtype.kind not in "iu" or not 0 <= nodes.min() <= nodes.max() < self.n_nodes:
            raise GraphError(f"a node of a subgraph is an index from 0 to {self.n_nodes - 1}, or a label, a text")
        position = np.full(self.n_nodes, -1, dtype=np.int64)
        position[nodes] = np.arange(nodes.size)
        keep = np.flatnonzero((position[self.source] >= 0) & (position[self.target] >= 0))
        return SignedDigraph(
            [self.labels[i] for i in nodes.tolist()],
            position[self.source[keep]],
            position[self.target[keep]],
            self._weights.take(keep),
            self.read,
        )

    def without_nodes(self, *nodes: int | str) -> SignedDigraph:
        """Return the graph that is left when nodes and their edges are taken out.

        Parameters
        ----------
        *nodes : int or str
            Indices, or labels if these are texts; or one list of these.

        Raises
        ------
        UnknownAgentError, GraphError
            There is no such node; or none is left.

        Examples
        --------
        >>> graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2)])
        >>> graph.without_nodes("a").edges
        (('b', 'c', Fraction(-2, 1)),)
        """
        given = nodes[0] if len(nodes) == 1 and isinstance(nodes[0], list | tuple | set | frozenset) else nodes
        out = {place_of(node, self.labels) for node in given}
        left = [k for k in range(self.n_nodes) if k not in out]
        if not left:
            raise GraphError("without these nodes there is no graph; leave one of them in")
        return self.subgraph(left)

    def without_edges(self, *edges: tuple[int | str, int | str]) -> SignedDigraph:
        """Return the graph without some edges, all its nodes kept, such as to ask who leads when a link is lost.

        Parameters
        ----------
        *edges : pair of int or str
            Source and target, as information flows; or one list of these.

        Raises
        ------
        UnknownAgentError, GraphError
            There is no such node, or edge.

        Examples
        --------
        >>> graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -2)])
        >>> left = graph.without_edges(("a", "b"))
        >>> left.n_nodes, left.edges
        (3, (('b', 'a', Fraction(1, 1)), ('b', 'c', Fraction(-2, 1))))
        """
        out = set()
        given = edges[0] if len(edges) == 1 and isinstance(edges[0], list | set | frozenset) else edges
        for edge in given:
            if isinstance(edge, str) or len(edge) != 2:
                raise GraphError(f"{shorten(repr(edge))} is no edge; give pairs (source, target)")
            out.add(tuple(place_of(node, self.labels) for node in edge))
        pairs = list(zip(self.source.tolist(), self.target.tolist(), strict=True))
        for a, b in out.difference(pairs):
            raise GraphError(f"there is no edge {shorten(self.labels[a])} -> {shorten(self.labels[b])}")
        keep = np.array([k for k, pair in enumerate(pairs) if pair not in out], dtype=np.int64)
        return SignedDigraph(self.labels, self.source[keep], self.target[keep], self._weights.take(keep), self.read)

    @cached_property
    def sha256(self) -> str:
        r"""SHA-256 of the canonical edge list, independent of the order of nodes and edges.

        One JSON array per line: first ``[label]`` of every node, then ``[source, target, weight]`` of every edge
        with the weight as ``p`` or ``p/q`` in lowest terms, each group sorted; UTF-8, ``\n`` after each line.
        """
        digest = hashlib.sha256()
        quoted = [json.dumps(label, ensure_ascii=False) for label in self.labels]
        order = sorted(range(self.n_nodes), key=self.labels.__getitem__)
        rank = np.argsort(order)
        digest.update("".join(f"[{quoted[v]}]\n" for v in order).encode("utf-8", "surrogatepass"))
        names, texts = np.array(quoted, dtype=object), np.array(self.weight_texts, dtype=object)
        edges = np.lexsort((rank[self.target], rank[self.source]))
        for some in np.split(edges, range(_HASHED, edges.size, _HASHED)):
            columns = names[self.source[some]], names[self.target[some]], texts[some]
            lines = [f'[{s}, {t}, "{w}"]\n' for s, t, w in zip(*(c.tolist() for c in columns), strict=True)]
            digest.update("".join(lines).encode("utf-8", "surrogatepass"))
        return digest.hexdigest()

    def to_networkx(self) -> nx.DiGraph:
        """Return a networkx ``DiGraph``: an edge ``u -> v`` lets information flow so, ``weight`` is a float64.

        Examples
        --------
        >>> graph = SignedDigraph.from_edges([("a", "b", -2)])
        >>> SignedDigraph.from_networkx(graph.to_networkx()) == graph
        True
        """
        import networkx as nx

        result = nx.DiGraph()
        result.add_nodes_from(self.labels)
        result.add_weighted_edges_from(zip(*self._columns(), strict=True))
        return result

    def to_pandas(self) -> pd.DataFrame:
        """Return the edges as a DataFrame with columns ``source``, ``target``, ``weight`` (float64).

        A node without edges is in no row; :meth:`to_networkx` keeps it.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> SignedDigraph.from_edges([("a", "b", -2)]).to_pandas().to_dict("records")
        [{'source': 'a', 'target': 'b', 'weight': -2.0}]
        """
        source, target, weight = self._columns()
        return import_pandas().DataFrame({"source": source, "target": target, "weight": weight})

    def _columns(self) -> tuple[list[str], list[str], list[float]]:
        names = self.labels
        ends = ([names[i] for i in end.tolist()] for end in (self.source, self.target))
        return (*ends, self.weights.tolist())  # type: ignore[return-value]

    def __len__(self) -> int:
        return len(self.labels)

    def __iter__(self) -> Iterator[str]:
        return iter(self.labels)

    def __contains__(self, label: object) -> bool:
        return str(label) in self.index

    def __eq__(self, other: object) -> bool:
        """Two graphs are equal when they have the same labelled nodes and the same exact edges."""
        return isinstance(other, SignedDigraph) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __repr__(self) -> str:
        negative = int((self.sign < 0).sum())
        return f"SignedDigraph({self.n_nodes} nodes, {self.n_edges} edges, {negative} negative)"


#: What a matrix without an orientation is refused with.
WAY = (
    'does not tell its direction: write as_graph(W, orientation="listens") if row k holds whom k listens to (the '
    'paper\'s W), or "information" if row k holds whom k informs (networkx.to_numpy_array)'
)
_READ_DEFAULT: dict[str, Any] = {
    "orientation": "information",
    "duplicates": "refused",
    "self_loops": "refused",
    "undirected": False,
    "notes": (),
}


def graph_of(rows: Rows, name: str, how: Reading) -> SignedDigraph:
    """Build the graph of rows, or refuse them.

    Parameters
    ----------
    rows : Rows
    name : str
        Of the file; "" of data in memory, where mends are parameters instead of flags.
    how : Reading
    """
    from ptcc_certify.graphs.io.graph_from_rows import edges_of

    parts = edges_of(rows, name, how)
    try:
        return SignedDigraph(*parts)
    except GraphError as error:
        if not name:
            raise
        raise FormatError(f"{name}: {error}") from None


def _entries(matrix: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return row, column and value of the entries of a square matrix that are not 0, and how many rows it has."""
    dense = not hasattr(matrix, "tocoo")
    if np.ma.is_masked(matrix):
        raise GraphError("an entry of the adjacency matrix is masked; write 0 where there is no edge: filled(0)")
    try:
        entries: Any = np.asarray(matrix) if dense else matrix.tocoo()
    except ValueError:
        raise GraphError("the adjacency matrix has rows of different lengths") from None
    shape = entries.shape
    if len(shape) != 2:
        raise GraphError(f"an adjacency matrix has two dimensions, not {len(shape)}")
    if dense and entries.dtype.kind in "UO":
        entries = _without_texts(np.array(matrix, dtype=object))
    if entries.dtype.kind not in "biufO":
        raise GraphError(f"an adjacency matrix holds real numbers, not {entries.dtype}")
    if shape[0] != shape[1]:
        raise GraphError(f"an adjacency matrix is square, not {shape[0]} x {shape[1]}")
    try:
        row, column = entries.nonzero()
    except (TypeError, ValueError):  # pandas' NA is neither zero nor not
        raise GraphError("an entry of the adjacency matrix is missing; write 0 where there is no edge") from None
    return row, column, entries[row, column] if dense else entries.data[entries.data != 0], shape[0]


def _aligned_frame(frame: Any, rows: list[str]) -> np.ndarray:
    """Return the entries of a DataFrame with its columns in the order of its rows."""
    frame = frame.set_axis(rows, axis=0).set_axis([str(label) for label in frame.columns], axis=1)
    for what, labels in (("rows", frame.index), ("columns", frame.columns)):
        if labels.has_duplicates:
            twice = labels[labels.duplicated()][0]
            raise GraphError(f"two {what} of the matrix are both labelled {shorten(twice)}; rename one of them")
    if odd := frame.index.symmetric_difference(frame.columns).tolist():
        raise GraphError(f"rows and columns of the matrix have different labels: {first_five(odd)}; give both the same")
    # One type for all columns would round the integers of one beside the floats of another.
    return frame[rows].to_numpy(dtype=object if len(set(frame.dtypes)) > 1 else None)


def _without_texts(entries: np.ndarray) -> np.ndarray:
    """Return entries of a matrix with rationals in the place of texts that are numbers."""
    for place, entry in np.ndenumerate(entries):
        if isinstance(entry, str):
            with suppress(NumberError):
                entries[place] = as_fraction(entry)
    return entries


def refuse_networkx(graph: Any, undirected: bool = False, multigraph: bool = False) -> None:
    """Refuse what is no directed networkx graph with one edge at most from node to node, unless others are taken.

    Examples
    --------
    >>> refuse_networkx([])
    Traceback (most recent call last):
        ...
    ptcc_certify.errors.GraphError: a list is no networkx graph; ptcc_certify.as_graph takes other data
    """
    if not hasattr(graph, "is_multigraph"):
        raise GraphError(f"a {type(graph).__name__} is no networkx graph; ptcc_certify.as_graph takes other data")
    if graph.is_multigraph() and not multigraph:
        mend = 'merge parallel edges into one signed edge first, or give duplicates="sum" or "last"'
        raise GraphError(f"the networkx graph is a multigraph; {mend}")
    if not graph.is_directed() and not undirected:
        mend = "give graph.to_directed(), or undirected=True, if both ends listen"
        raise GraphError(f"the networkx graph is undirected; {mend}")
