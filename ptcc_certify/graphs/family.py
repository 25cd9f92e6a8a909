"""Families of signed digraphs: switching topologies, uncertain weights, edges that may fail.

A family is a list of *modes* on one node set. In a mode every edge has one sign, and its size ``|w_kl|`` lies in an
interval ``[w-, w+]``: *known* if ``w- = w+``, *optional* (it may fail) if ``w- = 0``, *mandatory* if ``w- > 0``. A
*signal* chooses, at every instant, a mode and weights in its intervals. A graph is a family of one mode with known
weights.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import GraphError, NumberError, ParameterError, did_you_mean, gated
from ptcc_certify.graphs.digraph import CallableTuple, Exact, SignedDigraph
from ptcc_certify.graphs.labels import import_pandas, ordered_labels, refuse_unnamed, refuse_written_twice
from ptcc_certify.graphs.packed_weights import LARGEST_WEIGHT, SMALLEST_WEIGHT, Weights
from ptcc_certify.graphs.rationals import as_fraction, decimal_mend, format_exact, nearest_float, shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.lazy_report import Shown

if TYPE_CHECKING:
    import pandas as pd

Interval = tuple[Hashable, Hashable, Exact, Exact]
#: Lines that are formed and hashed at a time.
_TOGETHER = 65_536


@dataclass(frozen=True, eq=False, repr=False)
class Mode:
    """The graphs of one mode: edges with fixed signs, whose sizes lie in intervals.

    Attributes
    ----------
    labels : tuple of str
        The N nodes.
    source, target : (m,) int arrays
        Information flows from ``source`` to ``target``; sorted by (target, source, sign).
    sign : (m,) int8 array
        Two optional edges of opposite signs may join one pair of nodes: a weight of unknown sign.
    lower, upper : Weights
        The sizes ``w-`` and ``w+``, over one scale.
    name : str
        What the user calls it: a file, "day".
    tied : bool
        Whether both directions of an edge are one parameter, so that they change together (undirected edges).

    References
    ----------
    docs/theory/families.md, "What may change".

    Examples
    --------
    >>> mode = Family.from_intervals([("a", "b", -3, -2), ("b", "a", 0, 1)]).modes[0]
    >>> mode
    Mode(2 nodes, 2 edges, 2 uncertain, 1 of them optional)
    >>> mode.mandatory.edges
    (('a', 'b', Fraction(-2, 1)),)
    """

    labels: tuple[str, ...]
    source: np.ndarray
    target: np.ndarray
    sign: np.ndarray
    lower: Weights
    upper: Weights
    name: str = ""
    tied: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", CallableTuple(self.labels))
        for array in (self.source, self.target, self.sign, self.lower.table, self.upper.table):
            array.flags.writeable = False

    @property
    def n_edges(self) -> int:
        """Number of edges, those that may fail included."""
        return int(self.source.size)

    @cached_property
    def known(self) -> np.ndarray:
        """(m,) bool array: edges of which ``w- = w+``."""
        return np.asarray(self.lower.table == self.upper.table, dtype=bool)

    @cached_property
    def optional(self) -> np.ndarray:
        """(m,) bool array: edges that may fail, ``w- = 0``."""
        return np.asarray(self.lower.table == 0, dtype=bool)

    @cached_property
    def parameters(self) -> np.ndarray:
        """(q,) int array: one edge for each uncertain parameter; of undirected edges the one from the smaller node."""
        uncertain = ~self.known
        return np.flatnonzero(uncertain & (self.source < self.target) if self.tied else uncertain)

    @cached_property
    def mandatory(self) -> SignedDigraph:
        """The graph of the mandatory edges at ``w-``: a member of the mode, with all optional edges off."""
        return self.member(np.zeros(self.n_edges, dtype=bool))

    def member(self, largest: np.ndarray) -> SignedDigraph:
        """Return the graph with ``w+`` on the edges that ``largest`` (m,) selects, ``w-`` on the others.

        Raises
        ------
        GraphError
            Two edges of opposite signs between one pair of nodes are both on.
        """
        on = np.flatnonzero(largest | ~self.optional)
        table = np.where(largest, self.upper.table, self.lower.table) * self.sign
        weights = self.upper.take(on)
        weights.table = table[on]
        return SignedDigraph(self.labels, self.source[on], self.target[on], weights)

    def edge_interval(self, edge: int) -> tuple[Fraction, Fraction]:
        """Return the least and the largest weight of an edge, with its sign."""
        ends = [int(self.sign[edge]) * bound.fraction(edge) for bound in (self.lower, self.upper)]
        return min(ends), max(ends)

    def restricted(self, nodes: np.ndarray) -> Mode:
        """Return the mode on the nodes ``nodes`` (indices, ascending) and the edges among them."""
        place = np.full(len(self.labels), -1, dtype=np.int64)
        place[nodes] = np.arange(nodes.size)
        keep = np.flatnonzero((place[self.source] >= 0) & (place[self.target] >= 0))
        return Mode(
            tuple(self.labels[v] for v in nodes.tolist()),
            place[self.source[keep]],
            place[self.target[keep]],
            self.sign[keep],
            self.lower.take(keep),
            self.upper.take(keep),
            self.name,
            self.tied,
        )

    @cached_property
    def texts(self) -> tuple[list[str], list[str]]:
        """The least and the largest weight of every edge, with their signs, as exact texts."""
        negative = self.sign < 0
        ends = []
        for below, above in ((self.upper, self.lower), (self.lower, self.upper)):  # of negative and positive edges
            ends.append(np.where(negative, [f"-{w}" if w != "0" else w for w in below.texts()], above.texts()).tolist())
        return ends[0], ends[1]

    def lines(self) -> Iterator[str]:
        """Yield one JSON array per edge: ``[source, target, weight]``, or ``[source, target, least, largest]``.

        Sorted by source label, target label and sign, so that the order of nodes does not count.
        """
        names = np.array([json.dumps(label, ensure_ascii=False) for label in self.labels], dtype=object)
        rank = np.argsort(sorted(range(len(names)), key=self.labels.__getitem__))
        ends = [np.array(texts, dtype=object) for texts in self.texts]
        order = np.lexsort((self.sign, rank[self.target], rank[self.source]))
        for some in np.split(order, range(_TOGETHER, order.size, _TOGETHER)):
            columns = names[self.source[some]], names[self.target[some]], *(texts[some] for texts in ends)
            for s, t, least, largest in zip(*(column.tolist() for column in columns), strict=True):
                weights = f'"{least}"' if least == largest else f'"{least}", "{largest}"'
                yield f"[{s}, {t}, {weights}]"

    def marked_lines(self) -> Iterator[str]:
        """Yield a line that tells whether uncertain edges are undirected, if so, then those of all edges."""
        if self.tied and not self.known.all():
            yield json.dumps({"undirected": True})
        yield from self.lines()

    def __eq__(self, other: object) -> bool:
        """Two modes are equal when their nodes and edges are; names do not count."""
        return isinstance(other, Mode) and self._lines == other._lines

    def __hash__(self) -> int:
        return hash(self._lines)

    @cached_property
    def _lines(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return tuple(sorted(self.labels)), tuple(self.marked_lines())

    def __repr__(self) -> str:
        uncertain, optional = int((~self.known).sum()), int(self.optional.sum())
        more = f", {uncertain} uncertain" if uncertain else ""
        more += f", {optional} of them optional" if optional else ""
        return f"Mode({len(self.labels)} nodes, {self.n_edges} edges{more})"


@dataclass(frozen=True, eq=False, repr=False)
class Family(Shown):
    """Signed digraphs on one node set, of which any may act at any instant.

    Made by :meth:`from_graph`, :meth:`from_intervals` or :meth:`switching`.

    Attributes
    ----------
    modes : tuple of Mode
        At least one; all have the same nodes in the same order.
    notes : tuple of str
        What was read in a larger sense than it was written.
    read : mapping
        The keywords with which :func:`ptcc_certify.read_family` reads its files again; empty if it is from none.

    Raises
    ------
    GraphError
        It is given no tuple of modes.

    References
    ----------
    docs/theory/families.md.

    Examples
    --------
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", 2)], nodes="abc")
    >>> Family.switching({"day": day, "night": night})
    Family(3 nodes, 2 modes)
    >>> Family.from_graph(day, uncertainty="20%", optional=[("b", "c")]).modes[0].edge_interval(1)
    (Fraction(-6, 5), Fraction(0, 1))
    """

    modes: tuple[Mode, ...]
    notes: tuple[str, ...] = field(default=())
    read: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.modes, tuple) and self.modes and all(isinstance(mode, Mode) for mode in self.modes)):
            mend = "Family.from_graph takes a graph, Family.switching several, as_family whatever makes a family"
            raise GraphError(f"Family takes a tuple of modes, at least one; {mend}")

    @property
    def labels(self) -> tuple[str, ...]:
        """The N nodes."""
        return self.modes[0].labels

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.labels)

    @cached_property
    def graph(self) -> SignedDigraph | None:
        """The one graph of the family; None if there are several."""
        if len(self.modes) > 1 or not self.modes[0].known.all():
            return None
        return self.modes[0].mandatory

    @cached_property
    def union(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Source, target and sign of all edges of all modes, each once, sorted."""
        n = self.n_nodes
        keys = [2 * (mode.target * n + mode.source) + (mode.sign > 0) for mode in self.modes]  # each ascends
        pair, positive = np.divmod(keys[0] if len(keys) == 1 else np.unique(np.concatenate(keys)), 2)
        target, source = np.divmod(pair, n)
        return source, target, (2 * positive - 1).astype(np.int8)

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Source and target of all edges, each ordered pair once, by target, then source: of a graph its edges.

        Examples
        --------
        >>> [ends.tolist() for ends in Family.from_intervals([("a", "b", -1, 2), ("b", "c", 1, 1)]).pairs]
        [[0, 1], [1, 2]]
        """
        source, target, _ = self.union
        new = np.ones(source.size, dtype=bool)
        new[1:] = (source[1:] != source[:-1]) | (target[1:] != target[:-1])
        return source[new], target[new]

    def restricted(self, nodes: np.ndarray) -> Family:
        """Return the family on the nodes ``nodes`` (indices, ascending) and the edges among them."""
        return Family(tuple(mode.restricted(nodes) for mode in self.modes), self.notes)

    @cached_property
    def sha256(self) -> str:
        r"""SHA-256 of nodes and modes.

        Lines of UTF-8, ``\n`` after each: ``[label]`` of every node, sorted; then the modes in their order, a line
        ``{}`` between two, each with the lines of its edges (:meth:`Mode.lines`), numbers as ``p`` or ``p/q`` in lowest
        terms. Before the edges of a mode that are undirected, some of them uncertain, a line ``{"undirected": true}``:
        both directions change together. Names of modes do not count. That of one graph is the graph's own.
        """
        parts: list[Iterable[str]] = [(json.dumps([label], ensure_ascii=False) for label in sorted(self.labels))]
        for number, mode in enumerate(self.modes):
            parts += [["{}"], mode.marked_lines()] if number else [mode.marked_lines()]
        digest, lines = hashlib.sha256(), chain.from_iterable(parts)
        while batch := list(islice(lines, _TOGETHER)):
            digest.update("".join(f"{line}\n" for line in batch).encode("utf-8", "surrogatepass"))
        return digest.hexdigest()

    # ------------------------------------------------------------------ constructors

    @classmethod
    def from_graph(
        cls, graph: SignedDigraph, *, uncertainty: Any = 0, optional: Iterable[tuple[Hashable, Hashable]] = ()
    ) -> Family:
        """Return the family of one graph whose weights are known up to a share of each.

        Parameters
        ----------
        graph : SignedDigraph
        uncertainty : number or str
            ``u`` from 0 to 1, or a text as "10%": ``|w|`` lies in ``[(1 - u) |w|, (1 + u) |w|]``.
        optional : iterable of (source, target)
            Edges that may fail; ``w+`` stays. Of an undirected graph one direction names both.

        Raises
        ------
        GraphError
            An optional edge is not in the graph, or the uncertainty is not from 0 to 1.

        Examples
        --------
        >>> Family.from_graph(SignedDigraph.from_edges([("a", "b", 3)])).graph.edges
        (('a', 'b', Fraction(3, 1)),)
        """
        if not isinstance(graph, SignedDigraph):
            mend = "ptcc_certify.as_graph and as_family take other forms"
            raise GraphError(f"{shorten(repr(graph))} is no SignedDigraph; {mend}")
        share = read_share(uncertainty)
        off = np.zeros(graph.n_edges, dtype=bool)
        key = graph.target * graph.n_nodes + graph.source  # ascends
        both = np.array_equal(np.sort(graph.source * graph.n_nodes + graph.target), key)  # but for edges added or lost
        tied = bool(graph.read.get("undirected")) and both
        for one in optional:
            off[_edge_number(graph, key, one)] = True
            if tied:
                off[_edge_number(graph, key, one[::-1])] = True
        bounds = _uncertain(graph, share, off)
        mode = Mode(graph.labels, graph.source, graph.target, graph.sign, *bounds, tied=tied)
        return cls((mode,))

    @classmethod
    def from_intervals(
        cls,
        edges: Iterable[Interval],
        nodes: Iterable[Hashable] = (),
        *,
        orientation: str = "information",
        undirected: bool = False,
    ) -> Family:
        """Return the family of one mode with edges ``(source, target, least, largest)``.

        Parameters
        ----------
        edges : iterable of (label, label, number, number)
            The weight, with its sign, lies between the two. 0 at one end is an edge that may fail. An interval with 0
            inside, a weight of unknown sign, becomes two edges that may fail, one of each sign: a larger family.
        nodes : iterable of labels, optional
            Further nodes, and the wish for an order.
        orientation : {"information", "listens"}
            As in :meth:`SignedDigraph.from_edges`.
        undirected : bool
            Let each edge go both ways, as one parameter.

        Raises
        ------
        GraphError
            ``least > largest``, both are 0, or an edge occurs twice or is a loop.

        Examples
        --------
        >>> unsure = Family.from_intervals([("a", "b", -1, 2)])
        >>> unsure
        Family(2 nodes, 2 of 2 weights uncertain, 2 edges optional)
        >>> print(unsure.notes[0])
        1 weight of unknown sign was read as two edges that may fail, one of each sign
        """
        Reading(orientation=orientation)  # refuses an unknown one
        for name, some in (("edges", edges), ("nodes", nodes)):
            if not isinstance(some, Iterable):
                raise ParameterError(name, f"= {shorten(repr(some))} are none; give a list")
        rows: list[tuple[Hashable, Hashable, Fraction, Fraction]] = []
        unsure = 0
        for edge in edges:
            parts = _parts(edge)
            unsure += len(parts) == 2
            for source, target, least, largest in parts:
                rows.append((source, target, least, largest))
                if undirected:
                    rows.append((target, source, least, largest))
        return cls((_mode(rows, nodes, orientation, undirected),), _note(unsure))

    @classmethod
    @gated
    def switching(cls, modes: Any) -> Family:
        """Return the family of several modes, of which any may act at any instant.

        Parameters
        ----------
        modes : mapping of str to graphs or families, or iterable of these
            Each a SignedDigraph, or a family, whose modes are added.

        Raises
        ------
        GraphError
            There is none, one is no graph, or two have different nodes: a missing node is not an isolated one.
        """
        if not isinstance(modes, Iterable):
            raise ParameterError("modes", f"= {shorten(repr(modes))} are none; give a mapping of names to graphs")
        named = list(modes.items()) if hasattr(modes, "items") else [(str(k), one) for k, one in enumerate(modes, 1)]
        if not named:
            raise GraphError("a family has at least one mode; give one graph or several")
        for name, one in named:
            if not isinstance(one, SignedDigraph | Family):
                mend = 'ptcc_certify.as_family({"day": edges, "night": edges2}) takes edges, tables and files'
                raise GraphError(f"mode {shorten(str(name))}: {shorten(repr(one))} is no SignedDigraph; {mend}")
        families = [(name, one if isinstance(one, Family) else cls.from_graph(one)) for name, one in named]
        labels = families[0][1].labels
        joint: list[Mode] = []
        for name, family in families:
            for number, mode in enumerate(family.modes, 1):
                joint.append(
                    _in_order(mode, labels, f"{name}.{number}" if len(family.modes) > 1 else name, named[0][0])
                )
        return cls(tuple(joint), tuple(note for _, family in families for note in family.notes))

    def to_pandas(self) -> pd.DataFrame:
        """Return the edges of all modes as a table: mode, ends, and the interval of the weight, rounded to floats.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> Family.from_intervals([("a", "b", -3, -2)]).to_pandas().values.tolist()
        [['', 'a', 'b', -3.0, -2.0]]
        """
        columns = ["mode", "source", "target", "weight_min", "weight_max"]
        rows = []
        for mode in self.modes:
            for edge in range(mode.n_edges):
                ends = (self.labels[int(end[edge])] for end in (mode.source, mode.target))
                rows.append((mode.name, *ends, *map(float, mode.edge_interval(edge))))
        return import_pandas().DataFrame(rows, columns=columns)

    def __len__(self) -> int:
        return self.n_nodes

    def __iter__(self) -> Iterator[str]:
        return iter(self.labels)

    def __contains__(self, label: object) -> bool:
        return str(label) in self.labels

    def __eq__(self, other: object) -> bool:
        """Two families are equal when their nodes and their modes are, in the same order."""
        return isinstance(other, Family) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __repr__(self) -> str:
        edges = sum(mode.n_edges for mode in self.modes)
        uncertain = sum(int((~mode.known).sum()) for mode in self.modes)
        optional = sum(int(mode.optional.sum()) for mode in self.modes)
        sizes = [f"{self.n_nodes} nodes"]
        if len(self.modes) > 1:
            sizes.append(f"{len(self.modes)} modes")
        if uncertain:
            sizes.append(f"{uncertain} of {edges} weights uncertain")
        if optional:
            sizes.append(f"{counted(optional, 'edge')} optional")
        return f"Family({', '.join(sizes)})"


def read_share(value: Any) -> Fraction:
    """Return a share of a weight, from 0 to 1: ``0.1``, ``"1/10"`` or ``"10%"``.

    Raises
    ------
    GraphError
        It is no number from 0 to 1.

    Examples
    --------
    >>> read_share("10%")
    Fraction(1, 10)
    """
    percent = isinstance(value, str) and value.strip().endswith("%")
    try:
        share = as_fraction(value.strip()[:-1] if percent else value, "it") / (100 if percent else 1)
    except NumberError as error:
        raise GraphError("uncertainty", f"= {shorten(str(value))}: {error}; give a share such as 10% or 0.1") from None
    if not 0 <= share <= 1:
        more = "; give a share such as 10% or 0.1"
        hint = f"; write {format_exact(share)}% if it is one" if not percent and 1 < share <= 100 else ""
        raise GraphError("uncertainty", f"= {shorten(str(value))} is not from 0 to 1{hint or more}")
    return share


def _uncertain(graph: SignedDigraph, share: Fraction, optional: np.ndarray) -> tuple[Weights, Weights]:
    """Return the bounds of the sizes of all edges, over one scale; equal weights are one number."""
    table, _ = graph.weight_table()
    m = graph.n_edges
    if table is None:
        sizes, which = [abs(graph.exact_weight(e)) for e in range(m)], np.arange(m)
    else:
        _, first, which = np.unique(np.abs(table), return_index=True, return_inverse=True)
        sizes = [abs(graph.exact_weight(e)) for e in first.tolist()]
    d = len(sizes)
    values = [(1 - share) * w for w in sizes] + [(1 + share) * w for w in sizes] + [Fraction(0)]
    both = Weights(values, np.concatenate([np.where(optional, 2 * d, which), which + d]).astype(np.int64))
    return both.take(np.arange(m)), both.take(np.arange(m, 2 * m))


def _edge_number(graph: SignedDigraph, keys: np.ndarray, edge: tuple[Hashable, Hashable]) -> int:
    try:
        source, target = (graph.index[str(end)] for end in edge)
    except (KeyError, ValueError, TypeError):
        raise GraphError(f"optional edge {shorten(repr(edge))} is no pair of nodes of the graph") from None
    key = target * graph.n_nodes + source
    place = int(np.searchsorted(keys, key))
    if place == keys.size or keys[place] != key:
        raise GraphError(f"optional edge {shorten(str(edge[0]))} -> {shorten(str(edge[1]))} is not in the graph")
    return place


def read_interval(first: Any, last: Any, place: str) -> tuple[Fraction, Fraction]:
    """Return the least and the largest weight of an edge, which ``place`` names.

    Raises
    ------
    GraphError
        One is no number, the first is above the last, or both are 0.

    Examples
    --------
    >>> read_interval("-0.5", 0, "edge a -> b")
    (Fraction(-1, 2), Fraction(0, 1))
    """
    try:
        least, largest = as_fraction(first, "the least weight"), as_fraction(last, "the largest weight")
    except NumberError as error:
        mend = decimal_mend(str(error).rpartition('"')[0].rpartition('"')[2])
        raise GraphError(f"{place}: {error}; {mend}") from None
    for end in (least, largest):
        if end and not SMALLEST_WEIGHT <= abs(nearest_float(end)) <= LARGEST_WEIGHT:
            raise GraphError(
                f"{place}: weight {shorten(format_exact(end))} is outside the range of float64; rescale the weights"
            )
    if least > largest:
        mend = f"exchange them: a weight from {format_exact(largest)} to {format_exact(least)} has the least first"
        raise GraphError(f"{place}: the least weight {format_exact(least)} is above the largest; {mend}")
    if least == largest == 0:
        raise GraphError(f"{place}: its weight is always 0; leave the edge out")
    return least, largest


def _parts(edge: Interval) -> list[tuple[Hashable, Hashable, Fraction, Fraction]]:
    """Return an interval as sizes times signs that do not change: one edge, or two if 0 lies inside."""
    try:
        source, target, first, last = edge
    except (TypeError, ValueError):
        raise GraphError(f"edge {shorten(repr(edge))} is not (source, target, least, largest)") from None
    for node in (source, target):
        refuse_unnamed(node, f"edge {shorten(str(source))} -> {shorten(str(target))}")
    least, largest = read_interval(first, last, f"edge {shorten(str(source))} -> {shorten(str(target))}")
    zero = Fraction(0)
    if least < 0 < largest:
        return [(source, target, least, zero), (source, target, zero, largest)]
    return [(source, target, least, largest)]


def _mode(
    rows: Sequence[tuple[Hashable, Hashable, Fraction, Fraction]],
    nodes: Iterable[Hashable],
    orientation: str,
    tied: bool,
) -> Mode:
    signs = [1 if largest > 0 else -1 for *_, largest in rows]
    sizes = [sorted((abs(least), abs(largest))) for *_, least, largest in rows]
    # The graph of all edges, one sign at a time, holds the rules of labels, loops and edges that occur twice.
    known: dict[str, int] = {}
    for node in nodes:
        known.setdefault(str(node), len(known))
    for first, second, *_ in rows:
        known.setdefault(str(first), len(known))
        known.setdefault(str(second), len(known))
    refuse_written_twice(list(known), "")
    labels, rank = ordered_labels(list(known))
    ends = [rank[np.array([known[str(row[k])] for row in rows], dtype=np.int64)] for k in (0, 1)]
    source, target = ends if orientation == "information" else ends[::-1]
    sign, m = np.array(signs, dtype=np.int8), len(rows)
    both = Weights([low for low, _ in sizes] + [high for _, high in sizes])
    for one in (1, -1):
        some = np.flatnonzero(sign == one)
        SignedDigraph(labels, source[some], target[some], both.take(some + m))
    order = np.lexsort((sign, source, target))
    mode = Mode(
        tuple(labels), source[order], target[order], sign[order], both.take(order), both.take(order + m), tied=tied
    )
    _refuse_two_signs(mode)
    return mode


def _refuse_two_signs(mode: Mode) -> None:
    """Refuse two edges of opposite signs between one pair of nodes, but where both may fail."""
    same = (mode.source[1:] == mode.source[:-1]) & (mode.target[1:] == mode.target[:-1])
    bad = np.flatnonzero(same & ~(mode.optional[1:] & mode.optional[:-1]))
    if bad.size:
        source, target = (shorten(mode.labels[int(end[bad[0]])]) for end in (mode.source, mode.target))
        raise GraphError(
            f"edge {source} -> {target} has both signs in one mode; give two modes, one with each sign (exact), or one "
            "interval with 0 inside (a larger family)"
        )


def _note(unsure: int) -> tuple[str, ...]:
    if not unsure:
        return ()
    which = "1 weight of unknown sign was" if unsure == 1 else f"{unsure} weights of unknown sign were"
    return (f"{which} read as two edges that may fail, one of each sign",)


def _in_order(mode: Mode, labels: tuple[str, ...], name: str, first: str) -> Mode:
    """Return a mode with its nodes in the order of ``labels``."""
    if mode.labels == labels:
        return Mode(labels, mode.source, mode.target, mode.sign, mode.lower, mode.upper, mode.name or name, mode.tied)
    index = {label: v for v, label in enumerate(labels)}
    if odd := sorted(set(labels) ^ set(mode.labels)):
        lacks = name if odd[0] in index else first
        mend = "declare it in a row of its own if it is isolated there"
        near = did_you_mean(odd[0], sorted({*labels, *mode.labels} - {odd[0]}))
        raise GraphError(
            f"mode {shorten(lacks)} has no node {shorten(odd[0])}, which another mode has{near or ';'} {mend}"
        )
    place = np.array([index[label] for label in mode.labels], dtype=np.int64)
    source, target = place[mode.source], place[mode.target]
    order = np.lexsort((mode.sign, source, target))
    lower, upper = mode.lower.take(order), mode.upper.take(order)
    return Mode(labels, source[order], target[order], mode.sign[order], lower, upper, mode.name or name, mode.tied)


def pairs_of(of: SignedDigraph | Family) -> list[tuple[str, str]]:
    """Return source and target of all edges by label, each ordered pair once, by target, then source, as nodes are.

    Examples
    --------
    >>> pairs_of(SignedDigraph.from_edges([("a", "c", 1), ("a", "b", 1)], nodes="abc"))
    [('a', 'b'), ('a', 'c')]
    """
    source, target = of.pairs if isinstance(of, Family) else (of.source, of.target)
    return [(of.labels[s], of.labels[t]) for s, t in zip(source.tolist(), target.tolist(), strict=True)]
