"""Verifies nodes and edges, and reads what is told by node: positions of labels, numbers by agent."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from lmi.exact.work import keeps
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import entries, exact, fields, need
from ptcc_certify.checker.side_files import Numbers, beside

#: From this number of edges on NumPy is used, where it is there.
MANY_EDGES = 10_000
#: Bytes that a node takes, at most about, and an edge in a side file, or in the JSON.
NODE_BYTES, EDGE_BYTES = 700, (100, 300)


def check_graph(doc: Document) -> Digraph:
    """Read nodes and edges; verify their order and their hash."""
    section = fields(doc.section("graph"), ("nodes", "edges", "read", "sha256"), "graph")
    check_read(section["read"])
    labels, index = read_nodes(section)
    _fit(NODE_BYTES * len(labels))
    doc.context.labels, doc.context.index = labels, index
    graph = digraph(doc, labels, *_edges(doc, section["edges"], index))
    doc.sha256, doc.context.edges = graph.sha256(), graph.n_edges
    need(section["sha256"] == doc.sha256, "the SHA-256 of the edge list is another")
    return graph


def check_read(read: Any) -> None:
    """Verify the form of what is told of the reading of a file: four keys, and others where they were asked for."""
    need(isinstance(read, dict), "read is not an object")
    asked = tuple(key for key in ("zeros", "laplacian", "columns", "variable") if key in read)
    how = fields(read, ("orientation", "duplicates", "self_loops", "undirected", *asked), "read")
    need(how["orientation"] in ("information", "listens", "matrix"), "read: an unknown orientation")
    need(how["duplicates"] in ("refused", "sum", "last"), "read: duplicates")
    for key, pattern in (("self_loops", r"refused|dropped [0-9]{1,12}"), ("zeros", r"dropped [0-9]{1,12}")):
        text = how.get(key, "dropped 0")
        need(isinstance(text, str) and bool(re.fullmatch(pattern, text)), f"read: {key}")
    for key, kind in (("undirected", bool), ("laplacian", bool), ("columns", str), ("variable", str)):
        need(isinstance(how.get(key, kind()), kind), f"read: {key}")


def read_nodes(section: dict[str, Any]) -> tuple[list[str], dict[str, int]]:
    """Return the labels of the nodes, and their positions."""
    labels = entries(section["nodes"], "nodes")
    need(bool(labels) and all(isinstance(x, str) for x in labels), "nodes are not texts, or there is none")
    index = {label: v for v, label in enumerate(labels)}
    need(len(index) == len(labels), "a node occurs twice")
    return labels, index


def digraph(doc: Document, labels: Sequence[str], source: Any, target: Any, weights: Any, scale: int) -> Digraph:
    """Return a graph: of many edges its array twin."""
    kind = Digraph
    if doc.exact.numpy and len(source) >= MANY_EDGES:
        from ptcc_certify.checker.array_digraph import ArrayDigraph as kind  # noqa: N813
    return kind(labels, source, target, weights, scale)


def _fit(size: int) -> None:
    """Refuse a graph for which the memory does not suffice."""
    need(keeps(size), "a graph that may take more memory than is allowed; allow more by --memory")


def _edges(doc: Document, section: Any, index: dict[str, int]) -> tuple[Any, Any, Any, int]:
    """Return sources, targets, weights and what divides the weights."""
    if isinstance(section, dict):
        section = fields(section, ("count", "source", "target", "weight", "scale"), "edges")
        count, scale = section["count"], exact(section["scale"])
        need(type(count) is int and 0 < count <= len(index) ** 2, "edges: count is no number of edges")
        need(scale > 0 and scale.denominator == 1, "scale is not a positive integer")
        _fit(EDGE_BYTES[0] * count)
        source, target, weight = (doc.files.column(section[key], count) for key in ("source", "target", "weight"))
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


def by_agent(doc: Document, graph: Digraph, entry: Any, what: str, files: bool = True) -> Numbers:
    """Read a number for every agent: an object in their order, or a side vector where ``files`` may be named."""
    if beside(entry):
        need(files, f"{what} in a side file")
        return doc.files.numbers(entry, what, graph.n)
    return Numbers([exact(x) for x in ordered(graph.labels, entry, what).values()])
