"""Verifies a family: its modes, the structure of every mandatory graph, and what it does under every signal.

In a mode every edge has one sign, and its size lies in an interval; the mandatory graph has the edges whose interval
does not reach 0, at the least size. Section 14 of the format tells the rules.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from operator import itemgetter
from typing import Any

from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import RejectedError, entries, exact, fields, need, same
from ptcc_certify.checker.structure import Structure, check_structure

#: Modes that are read.
MANY_MODES = 1000
THEOREM = "common kernel"
STABILITY, CONSENSUS, DEPENDS = "stability", "bipartite consensus", "depends on the signal"
INTERVAL, CONTAINMENT = "interval bipartite consensus", "bipartite containment"

Row = dict[int, Fraction]
#: Source, target, sign, least and largest size of an edge.
Edge = tuple[int, int, int, Fraction, Fraction]


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: its edges, and the structure of its mandatory graph.

    Attributes
    ----------
    edges : list of Edge
    structure : Structure
    tied : bool
        Both directions of every edge change together.
    """

    edges: list[Edge]
    structure: Structure
    tied: bool

    @property
    def uncertain(self) -> Iterator[Edge]:
        """The edges whose size is not known."""
        return (edge for edge in self.edges if edge[3] < edge[4])


@dataclass(frozen=True, eq=False)
class Family:
    """The modes of a certificate, and its weakly connected components.

    Attributes
    ----------
    labels : list of str
    modes : list of Mode
    components : list of Component
    """

    labels: list[str]
    modes: list[Mode]
    components: list[Component]


@dataclass(frozen=True, eq=False)
class Component:
    """A weak component of all edges of all modes: its nodes, camps that keep all its edges, what it does.

    Attributes
    ----------
    nodes : list of int
    camps : dict of int to +1/-1, or None
    behaviour : str
    kernel : dict of int to (dict of int to Fraction)
        The rows of the basis of the common kernel, without zeros, by the numbers of the balanced closed components of
        the first mandatory graph; empty if there is no common kernel.
    pivots : dict of int to int
        The first node of each of these.
    """

    nodes: list[int]
    camps: dict[int, int] | None
    behaviour: str
    kernel: dict[int, Row]
    pivots: dict[int, int]

    @property
    def depends(self) -> bool:
        """Whether there is no common kernel."""
        return self.behaviour == DEPENDS


def check_family(doc: Document) -> Family:
    """Verify modes, structures and what is claimed of every component."""
    labels, drafts = _read_modes(doc)
    sections = entries(fields(doc.section("structure"), ("modes",), "structure")["modes"], "modes", len(drafts))
    modes = []
    for number, ((edges, tied), section) in enumerate(zip(drafts, sections, strict=True)):
        edges_on = [edge for edge in edges if edge[3]]
        source, target, weights = ([x(e) for e in edges_on] for x in (itemgetter(0), itemgetter(1), _least))
        graph = Digraph(labels, source, target, weights, 1)
        modes.append(Mode(edges, check_structure(doc, graph, section, f"graph.modes[{number}]"), tied))
    return Family(labels, modes, _check_claims(doc, labels, modes))


def _least(edge: Edge) -> Fraction:
    return edge[2] * edge[3]


# ---------------------------------------------------------------------- modes


def _read_modes(doc: Document) -> tuple[list[str], list[tuple[list[Edge], bool]]]:
    section = fields(doc.section("graph"), ("nodes", "modes", "sha256"), "graph")
    labels = entries(section["nodes"], "nodes")
    need(bool(labels) and all(isinstance(x, str) for x in labels), "nodes are not texts, or there is none")
    index = {label: v for v, label in enumerate(labels)}
    need(len(index) == len(labels), "a node occurs twice")
    items = entries(section["modes"], "modes")
    need(0 < len(items) <= MANY_MODES, f"no mode, or more than {MANY_MODES}")
    drafts = []
    for item in items:
        fields(item, ("name", "undirected", "edges"), "a mode")
        need(isinstance(item["name"], str) and type(item["undirected"]) is bool, "name or undirected of a mode")
        edges = [_edge(entries(row, "an edge"), index) for row in entries(item["edges"], "edges")]
        _check_edges(edges, item["undirected"])
        drafts.append((edges, item["undirected"]))
    doc.sha256 = _hash(labels, [edges for edges, _ in drafts])
    need(section["sha256"] == doc.sha256, "the SHA-256 of the modes is another")
    return labels, drafts


def _edge(row: list[Any], index: dict[str, int]) -> Edge:
    need(len(row) in (3, 4), "an edge has not 3 or 4 entries")
    need(all(isinstance(x, str) and x in index for x in row[:2]), "an edge of an unknown node")
    least, largest = exact(row[2]), exact(row[-1])
    need(len(row) == 3 or least < largest, "the least weight of an edge is not below the largest")
    need(least >= 0 or largest <= 0, "an edge without a sign")
    need(bool(least or largest), "an edge of weight 0")
    need(row[0] != row[1], "an edge of a node to itself")
    sign = 1 if largest > 0 else -1
    return index[row[0]], index[row[1]], sign, min(abs(least), abs(largest)), max(abs(least), abs(largest))


def _check_edges(edges: Sequence[Edge], tied: bool) -> None:
    keys = [(t, s, sign) for s, t, sign, _, _ in edges]
    need(all(a < b for a, b in pairwise(keys)), "edges are not in order, or one occurs twice")
    for one, other in pairwise(edges):
        need(one[:2] != other[:2] or one[3] == other[3] == 0, "an edge of both signs that cannot fail")
    if tied:
        sizes = {edge[:3]: edge[3:] for edge in edges}
        need(
            all(sizes.get((t, s, sign)) == size for (s, t, sign), size in sizes.items()), "an edge without its reverse"
        )


def _hash(labels: Sequence[str], modes: Sequence[Sequence[Edge]]) -> str:
    quote = json.JSONEncoder(ensure_ascii=False).encode
    hashed = hashlib.sha256("".join(f"[{quote(x)}]\n" for x in sorted(labels)).encode("utf-8", "surrogatepass"))
    for number, edges in enumerate(modes):
        hashed.update(b"{}\n" if number else b"")
        for s, t, sign, low, high in sorted(edges, key=lambda e: (labels[e[0]], labels[e[1]], e[2])):
            weights = ", ".join(f'"{w}"' for w in dict.fromkeys(sorted((sign * low, sign * high))))
            line = f"[{quote(labels[s])}, {quote(labels[t])}, {weights}]\n"
            hashed.update(line.encode("utf-8", "surrogatepass"))
    return hashed.hexdigest()


# ---------------------------------------------------------------------- claims


def _check_claims(doc: Document, labels: list[str], modes: list[Mode]) -> list[Component]:
    """Verify the behaviour of every component; the one with a common kernel by its basis, one without by a witness."""
    numbers = doc.open("family-claim", "graph", witness=True)
    parts = _parts(len(labels), modes)
    single = len(parts) == 1
    section = [doc.data["claim"]] if single else entries(doc.data.get("components"), "components", len(parts))
    need(not single or "components" not in doc.data, "components of a connected family")
    need(single or doc.data["claim"] is None, "the family is disconnected")
    witnesses = entries(numbers["witness"], "the witness", len(parts))
    result = []
    for entry, (nodes, camps), witness in zip(section, parts, witnesses, strict=True):
        component = _component(doc, modes, nodes, camps, witness)
        claim = {"theorem": THEOREM, "behaviour": component.behaviour, "signal": "any"}
        expected = claim if single else {"nodes": [labels[v] for v in nodes], "claim": claim}
        need(same(entry, expected), f"what follows is {component.behaviour}")
        result.append(component)
    doc.done(", ".join(dict.fromkeys(component.behaviour for component in result)))
    return result


def _parts(n: int, modes: Sequence[Mode]) -> list[tuple[list[int], dict[int, int] | None]]:
    """Return the weak components of all edges, each with the camps that keep all its edges, or None."""
    near: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for mode in modes:
        for s, t, sign, _, _ in mode.edges:
            near[s].append((t, sign))
            near[t].append((s, sign))
    camp = [0] * n
    parts = []
    for root in range(n):
        if camp[root]:
            continue
        camp[root], found, keeps = 1, [root], True
        for v in found:
            for u, sign in near[v]:
                if not camp[u]:
                    camp[u] = sign * camp[v]
                    found.append(u)
                keeps &= camp[u] == sign * camp[v]
        found.sort()
        parts.append((found, {v: camp[v] for v in found} if keeps else None))
    return parts


def _component(
    doc: Document, modes: Sequence[Mode], nodes: list[int], camps: dict[int, int] | None, witness: Any
) -> Component:
    inside = set(nodes)
    groups = [[k for k, group in enumerate(m.structure.closed) if group[0] in inside] for m in modes]
    balanced = [
        sum(m.structure.gauges[k] is not None for k in numbers) for m, numbers in zip(modes, groups, strict=True)
    ]
    pivots = {k: group[0] for k, group, _ in modes[0].structure.balanced if group[0] in inside}
    one_group = all(len(numbers) == 1 for numbers in groups)
    if camps is not None and one_group and all(balanced):
        ((number, pivot),) = pivots.items()
        behaviour, kernel = CONSENSUS, {v: {number: Fraction(camps[v] * camps[pivot])} for v in nodes}
    elif len(set(balanced)) == 1 and any(balanced):
        kernel = _check_kernel(doc, modes, inside, witness)
        behaviour = DEPENDS if not kernel else INTERVAL if one_group else CONTAINMENT
        return Component(nodes, camps, behaviour, kernel, pivots)
    else:
        behaviour, kernel = (DEPENDS, {}) if any(balanced) else (STABILITY, {v: {} for v in nodes})
    need(witness is None, "a witness that nothing asks for")
    return Component(nodes, camps, behaviour, kernel, pivots)


def _check_kernel(doc: Document, modes: Sequence[Mode], inside: set[int], witness: Any) -> dict[int, Row]:
    """Verify that all members share a kernel, by the rows of its basis, or that they do not, by a state at rest.

    Returns
    -------
    dict of int to Row
        The basis; empty if they do not.
    """
    if isinstance(witness, dict) and "rows" in witness:
        rows = _basis(doc, modes[0].structure, inside, fields(witness, ("rows",), "a kernel")["rows"])
        for mode in modes:
            graph = mode.structure.graph
            spend(sum(len(graph.row(v)) for v in inside), graph.bits, 64, "rows of kernels")
            for v in inside:
                need(not _row_product(graph.row(v), rows), "a column of the kernel is not at rest")
            for s, t, sign, _, _ in mode.uncertain:
                agrees = s not in inside or rows[t] == {j: sign * x for j, x in rows[s].items()}
                need(agrees, "an uncertain edge does not agree with the kernel")
        return rows
    fields(witness, ("mode", "other", "edge", "state"), "a counterexample")
    numbers = witness["mode"], witness["other"]
    need(all(type(k) is int and 0 <= k < len(modes) for k in numbers), "an unknown mode")
    mode, other = (modes[k] for k in numbers)
    labels = mode.structure.graph.labels
    state = {v: {0: x} for v, x in _state(doc, mode.structure.graph, witness["state"]).items()}
    need(set(state) <= inside, "a state outside the component")
    state |= {v: {} for v in range(len(labels)) if v not in state}
    need(not any(_row_product(mode.structure.graph.row(v), state) for v in inside), "the state is not at rest")
    moved = {v for v in inside if _row_product(other.structure.graph.row(v), state)}
    if (edge := witness["edge"]) is not None:
        s, t = positions(doc, other.structure.graph, entries(edge, "an edge", 3)[:2], "an edge")
        need(edge[2] in (1, -1) and (s, t, sign := int(edge[2])) in {e[:3] for e in other.uncertain}, "a known edge")
        need(t not in moved, "the listener of the edge moves already")
        if state[t].get(0, 0) != sign * state[s].get(0, 0):
            moved.add(t)
    need(bool(moved), "the state is at rest in both")
    return {}


def _basis(doc: Document, structure: Structure, inside: set[int], entry: Any) -> dict[int, Row]:
    """Return the rows of the basis, without zeros: camps of leaders, and what is told of followers."""
    rows: dict[int, Row] = {v: {} for v in inside}
    numbers = set()
    for number, nodes, gauge in structure.balanced:
        if nodes[0] in inside:
            numbers.add(number)
            rows |= {v: {number: Fraction(g)} for v, g in zip(nodes, gauge, strict=True)}
    need(isinstance(entry, dict), "rows of a kernel are no object")
    followers = {v for v in inside if structure.number[v] < 0}
    nodes = positions(doc, structure.graph, list(entry), "rows of a kernel")
    for v, row in zip(nodes, entry.values(), strict=True):
        need(v in followers, "a row of a node that is no follower")
        need(isinstance(row, dict) and all(key in map(str, numbers) for key in row), "a row of a kernel")
        rows[v] = {int(key): value for key, x in row.items() if (value := exact(x))}
    return rows


def _state(doc: Document, graph: Digraph, entry: Any) -> dict[int, Fraction]:
    if not isinstance(entry, dict):
        raise RejectedError("a state is no object")
    nodes = positions(doc, graph, list(entry), "a state")
    return dict(zip(nodes, map(exact, entry.values()), strict=True))


def _row_product(row: dict[int, int], rows: dict[int, Row]) -> Row:
    """Return a row of ``L B``, without zeros."""
    total: Row = {}
    for v, weight in row.items():
        for j, x in rows[v].items():
            total[j] = total.get(j, Fraction(0)) + weight * x
    return {j: x for j, x in total.items() if x}
