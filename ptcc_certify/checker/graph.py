"""Verifies nodes and edges, and reads what is told by node: positions of labels, numbers by agent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, Literal, TypeAlias

from lmi.exact.numbers import shorten
from lmi.exact.work import keeps
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.reading import entries, exact, fields, need
from ptcc_certify.checker.section_declarations import (
    Column,
    Integers,
    Labels,
    Node,
    Pattern,
    Several,
    Sha256,
    Unread,
    Vector,
    read,
)
from ptcc_certify.checker.side_files import Numbers, beside

#: From this number of edges on NumPy is used, where it is there.
MANY_EDGES = 10_000
#: Bytes that a node takes, at most about, and an edge in a side file, or in the JSON.
NODE_BYTES, EDGE_BYTES = 700, (100, 300)


#: Source, target, and weight.
Edge: TypeAlias = tuple[Node, Node, Fraction]
#: Source, target, least and largest weight.
UncertainEdge: TypeAlias = tuple[Node, Node, Fraction, Fraction]


@dataclass(frozen=True, kw_only=True)
class EdgesAside:
    """Edges in side files: ends as integers, and what divides the weights."""

    count: int
    source: Column
    target: Column
    weight: Column
    scale: Fraction


@dataclass(frozen=True, kw_only=True)
class UncertainEdgesAside:
    """Edges of a mode of a family in side files."""

    count: int
    source: Integers
    target: Integers
    least: Vector
    largest: Vector


@dataclass(frozen=True, kw_only=True)
class FixedMode:
    """The one mode of a fixed graph."""

    edges: Unread[Several[Edge] | EdgesAside]


@dataclass(frozen=True, kw_only=True)
class ModeSection:
    """A mode of a family: its name, whether both directions of edges change together, and its edges."""

    name: str
    undirected: Literal[True] | None = None
    edges: Unread[Several[Edge | UncertainEdge] | UncertainEdgesAside]


@dataclass(frozen=True, kw_only=True)
class ReadSection:
    """How a file was read: four keys, and others where they were asked for."""

    orientation: Literal["information", "listens", "matrix"]
    duplicates: Literal["refused", "sum", "last"]
    self_loops: Annotated[str, Pattern("refused|dropped [0-9]{1,12}")]
    undirected: bool
    zeros: Annotated[str, Pattern("dropped [0-9]{1,12}")] | None = None
    laplacian: bool | None = None
    columns: str | None = None
    variable: str | None = None


@dataclass(frozen=True, kw_only=True)
class GraphSection:
    """A fixed graph: agents, who listens to whom, and how its file was read."""

    nodes: Labels
    modes: tuple[FixedMode]
    read: ReadSection
    sha256: Sha256


@dataclass(frozen=True, kw_only=True)
class FamilySection:
    """A family: agents, and who listens to whom in every mode."""

    nodes: Labels
    modes: Several[ModeSection]
    sha256: Sha256


def check_graph(doc: Document) -> Digraph:
    """Read nodes and edges of one fixed graph; verify their order and their hash."""
    section: GraphSection = doc.section("graph")
    labels, index = section.nodes, doc.context.know(section.nodes)
    _fit(NODE_BYTES * len(labels))
    graph = digraph(doc, labels, *_edges(doc, section.modes[0].edges, index))
    doc.sha256, doc.context.edges = graph.sha256(), graph.n_edges
    need(section.sha256 == doc.sha256, "the SHA-256 of the edge list is another")
    return graph


def digraph(doc: Document, labels: Sequence[str], source: Any, target: Any, weights: Any, scale: int) -> Digraph:
    """Return a graph: of many edges its array twin."""
    kind = Digraph
    if doc.exact.numpy and len(source) >= MANY_EDGES:
        from ptcc_certify.checker.array_digraph import ArrayDigraph as kind  # noqa: N813
    return kind(labels, source, target, weights, scale)


def _fit(size: int) -> None:
    """Refuse a graph for which the memory does not suffice."""
    need(keeps(size), "a graph that may take more memory than is allowed; allow more by --memory")


def _edges(doc: Document, section: Any, index: Mapping[str, int]) -> tuple[Any, Any, Any, int]:
    """Return sources, targets, weights and what divides the weights."""
    if isinstance(section, dict):
        aside: EdgesAside = read(EdgesAside, section, doc.context, "edges")
        count, scale = aside.count, aside.scale
        need(0 < count <= len(index) ** 2, "edges: count is no number of edges")
        need(scale > 0 and scale.denominator == 1, "scale is not a positive integer")
        _fit(EDGE_BYTES[0] * count)
        source, target, weight = (doc.files.column(part, count) for part in (aside.source, aside.target, aside.weight))
        need(source.typecode == target.typecode == "q", "ends of edges are not integers")
        return source, target, weight, int(scale)
    _fit(EDGE_BYTES[1] * len(entries(section, "edges")))
    rows = [entries(row, "an edge", 3) for row in section]
    need(all(isinstance(x, str) and x in index for row in rows for x in row[:2]), "an edge of an unknown node")
    return [index[r[0]] for r in rows], [index[r[1]] for r in rows], [exact(r[2]) for r in rows], 1


def positions(doc: Document, graph: Digraph, entry: Any, what: str, count: int | None = None) -> list[int]:
    """Return the positions of a list of labels, or, where their number is known, of nodes in a side vector."""
    if count is not None and beside(entry):
        nodes = doc.files.integers(entry, what, count)
        need(all(0 <= v < graph.n for v in nodes), f"{what}: an unknown node")
        return nodes
    labels = entries(entry, what, count)
    need(all(isinstance(x, str) and x in graph.index for x in labels), f"{what}: an unknown node")
    return [graph.index[label] for label in labels]


def ordered(labels: Sequence[str], entry: Any, what: str) -> dict[str, Any]:
    """Return an object that has these labels as keys, in this order."""
    need(list(fields(entry, labels, what)) == labels, "agents are in another order")
    return entry


def proved_above(graph: Digraph, values: Numbers, what: str, least: Sequence[Fraction]) -> Numbers:
    """Return bounds by agent, none of which is below what is proved."""
    low = next((label for label, x, y in zip(graph.labels, values, least, strict=True) if x < y), None)
    need(low is None, f"{what} of agent {shorten(low or '')} is not proved")
    return values
