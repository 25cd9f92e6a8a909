"""Verifies a family: its modes, the structure of every mandatory graph, and what it does under every signal.

In a mode every edge has one sign, and its size lies in an interval; the mandatory graph has the edges whose interval
does not reach 0, at the least size. Section 18 of the format tells the rules.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain, groupby, pairwise
from math import gcd
from operator import itemgetter
from typing import Any, Literal

from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import keeps, spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import NODE_BYTES, FamilySection, UncertainEdgesAside, digraph
from ptcc_certify.checker.reading import Interval, RejectedError, entries, exact, need
from ptcc_certify.checker.section_declarations import (
    Ball,
    ByNumber,
    Node,
    Several,
    Some,
    read,
)
from ptcc_certify.checker.side_files import Numbers, beside
from ptcc_certify.checker.structure import CONNECTIVITY, Structure, StructureSection, check_structure

#: Modes that are read.
MANY_MODES = 1000
#: Bytes that an edge takes beside its text, at most about.
EDGE_BYTES = 500
THEOREM: Literal["common kernel"] = "common kernel"
TOO_LARGE = "a family that may take more memory than is allowed; allow more by --memory"
STABILITY, CONSENSUS, DEPENDS = "stability", "bipartite consensus", "depends on the signal"
INTERVAL, CONTAINMENT = "interval bipartite consensus", "bipartite containment"

Row = dict[int, Fraction]
#: Source, target, sign, least and largest size of an edge, times the unit of its mode.
Edge = tuple[int, int, int, int, int]


@dataclass(frozen=True, kw_only=True)
class FamilyClaim:
    """What a component does for every signal."""

    theorem: Literal["common kernel"]
    behaviour: Literal[
        "stability",
        "bipartite consensus",
        "interval bipartite consensus",
        "bipartite containment",
        "depends on the signal",
    ]


@dataclass(frozen=True, kw_only=True)
class FamilyComponent:
    """A component of a family, and its claim."""

    nodes: Several[Node]
    claim: FamilyClaim


@dataclass(frozen=True, kw_only=True)
class KernelWitness:
    """The rows of followers of the basis of a common kernel, by closed component."""

    rows: Some[ByNumber[Fraction]]


@dataclass(frozen=True, kw_only=True)
class Counterexample:
    """A state that is at rest in one mode, and moves in another, or where the weight of an edge changes."""

    mode: int
    other: int
    edge: tuple[Node, Node, Literal[1, -1]] | None = None
    state: Some[Ball]


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: its edges, and the structure of its mandatory graph.

    Attributes
    ----------
    edges : list of Edge
    unit : int
        What divides the sizes.
    tied : bool
        Both directions of every edge change together.
    structure : Structure
    """

    edges: list[Edge]
    unit: int
    tied: bool
    structure: Structure


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

    @cached_property
    def pairs(self) -> dict[tuple[int, int], int]:
        """Places of the ordered pairs of edges of any mode, by source and target; sorted by target, then source."""
        spend(8 * sum(len(mode.edges) for mode in self.modes), what="edges of all modes")
        ends = sorted({(target, source) for mode in self.modes for source, target, *_ in mode.edges})
        return {(source, target): place for place, (target, source) in enumerate(ends)}

    def component(self, number: int) -> Component:
        """Return the component of a number that a file tells."""
        need(0 <= number < len(self.components), "an unknown component")
        return self.components[number]


@dataclass(frozen=True, eq=False)
class Part:
    """A weak component of all edges of all modes.

    Attributes
    ----------
    nodes : list of int
    camps : dict of int to +1/-1, or None
        Those that keep all its edges.
    edges : list of (list of Edge)
        Of every mode.
    closed : list of (list of int)
        The numbers of its closed components in every mode.
    """

    nodes: list[int]
    camps: dict[int, int] | None
    edges: list[list[Edge]]
    closed: list[list[int]]


@dataclass(frozen=True, eq=False)
class Component:
    """A weak component of all edges of all modes, and what it does.

    Attributes
    ----------
    part : Part
    behaviour : str
    kernel : dict of int to (dict of int to Fraction)
        The rows of the basis of the common kernel, without zeros, by the numbers of the balanced closed components of
        the first mandatory graph; empty if there is no common kernel.
    pivots : dict of int to int
        The first node of each of these.
    """

    part: Part
    behaviour: str
    kernel: dict[int, Row]
    pivots: dict[int, int]

    @property
    def nodes(self) -> list[int]:
        """Its nodes."""
        return self.part.nodes

    @property
    def depends(self) -> bool:
        """Whether there is no common kernel."""
        return self.behaviour == DEPENDS

    @cached_property
    def size(self) -> int:
        """The number of its nodes and of the entries of the basis."""
        return len(self.nodes) + sum(map(len, self.kernel.values()))

    @property
    def carried(self) -> bool:
        """Whether all targets are 0, a pivot or its opposite: what an odd function of agents makes of pivots, too."""
        entries = (row.values() for row in self.kernel.values())
        return not self.depends and all(sum(map(abs, row)) in (0, 1) and len(row) < 2 for row in entries)

    @cached_property
    def whole(self) -> tuple[dict[int, dict[int, int]], int]:
        """The rows of the basis in integers, and what divides them."""
        return _whole(self.kernel)

    def coordinates(
        self, nodes: Sequence[int], x: Sequence[Fraction] | Mapping[int, Fraction], sizes: bool = False
    ) -> tuple[list[int], int]:
        """Return ``xi`` of a state at nodes that are no pivots, in integers, and what divides them.

        Of sizes: the largest ``|xi|`` of all states with ``|x_k|`` at most these.
        """
        (kernel, unit), pivots = self.whole, self.pivots
        (whole,), scale = integers([[x[v] for v in (*nodes, *pivots.values())]])
        rest, bits = dict(zip(pivots, whole[len(nodes) :], strict=True)), unit.bit_length() + 64
        spend(len(nodes) + sum(len(kernel[v]) for v in nodes), longest(whole), bits, "a Lyapunov function")
        own = zip(nodes, whole[: len(nodes)], strict=True)
        if sizes:
            return [unit * y + sum(abs(b) * rest[j] for j, b in kernel[v].items()) for v, y in own], unit * scale
        return [unit * y - sum(b * rest[j] for j, b in kernel[v].items()) for v, y in own], unit * scale


def check_family(doc: Document) -> Family:
    """Verify modes, structures and what is claimed of every component."""
    labels, drafts = _read_modes(doc)
    sections: Sequence[StructureSection] = doc.section("structure")
    need(len(sections) == len(drafts), f"structure has not {len(drafts)} entries")
    modes = []
    for number, ((edges, unit, tied), section) in enumerate(zip(drafts, sections, strict=True)):
        on = [edge for edge in edges if edge[3]]
        source, target = ([edge[k] for edge in on] for k in (0, 1))
        need(keeps(NODE_BYTES * len(labels)), TOO_LARGE)
        graph = digraph(doc, labels, source, target, [sign * low for _, _, sign, low, _ in on], unit)
        structure = check_structure(doc, graph, section, f"graph.modes[{number}]")
        need(section.connectivity == _connectivity(structure), "another connectivity of a mode")
        modes.append(Mode(edges, unit, tied, structure))
    hearing = {edge[1] for mode in modes for edge in mode.edges}
    doc.context.followers = [label for v, label in enumerate(labels) if v in hearing]
    return Family(labels, modes, _check_claims(doc, labels, modes))


def _connectivity(structure: Structure) -> str:
    if len(set(structure.graph.pieces[0])) > 1:
        return "disconnected"
    single = len(structure.closed) == 1
    return CONNECTIVITY[2 - single - (single and len(structure.closed[0]) == structure.graph.n)]


# ---------------------------------------------------------------------- modes


def _read_modes(doc: Document) -> tuple[list[str], list[tuple[list[Edge], int, bool]]]:
    section: FamilySection = doc.section("graph")
    labels, index = section.nodes, doc.context.know(section.nodes)
    need(0 < len(section.modes) <= MANY_MODES, f"no mode, or more than {MANY_MODES}")
    drafts = []
    for mode in section.modes:
        edges, unit = _edges(doc, mode.edges, index)
        _check_edges(edges, tied := mode.undirected is True)
        drafts.append((edges, unit, tied))
    doc.sha256 = _hash(labels, drafts)
    need(section.sha256 == doc.sha256, "the SHA-256 of the modes is another")
    return labels, drafts


def _edges(doc: Document, section: Any, index: Mapping[str, int]) -> tuple[list[Edge], int]:
    """Return the edges of a mode, and what divides their sizes."""
    least: Numbers
    largest: Numbers
    if isinstance(section, dict):
        aside: UncertainEdgesAside = read(UncertainEdgesAside, section, doc.context, "edges")
        count = aside.count
        need(0 < count <= 2 * len(index) ** 2, "edges: count is no number of edges")
        need(keeps(EDGE_BYTES * count), TOO_LARGE)
        need(all(beside(section[key]) for key in section if key != "count"), "edges: not in side files")
        source, target = (doc.files.integers(section[key], key, count) for key in ("source", "target"))
        need(all(0 <= v < len(index) for end in (source, target) for v in end), "an edge of an unknown node")
        least, largest = (doc.files.numbers(section[key], key, count) for key in ("least", "largest"))
    else:
        need(keeps(EDGE_BYTES * len(entries(section, "edges"))), TOO_LARGE)
        rows = [entries(row, "an edge") for row in section]
        need(all(len(row) in (3, 4) for row in rows), "an edge has not 3 or 4 entries")
        need(all(isinstance(x, str) and x in index for row in rows for x in row[:2]), "an edge of an unknown node")
        source, target = ([index[row[k]] for row in rows] for k in (0, 1))
        least, largest = (Numbers([exact(row[k]) for row in rows]) for k in (2, -1))
        apart = all(len(row) == 3 or x < y for row, x, y in zip(rows, least, largest, strict=True))
        need(apart, "the least weight of an edge is not below the largest")
    (lows, highs), unit = _over_one_unit(least, largest)
    need(all(low <= high for low, high in zip(lows, highs, strict=True)), "the least weight of an edge is the larger")
    need(all(low >= 0 or high <= 0 for low, high in zip(lows, highs, strict=True)), "an edge without a sign")
    need(all(low or high for low, high in zip(lows, highs, strict=True)), "an edge of weight 0")
    need(all(s != t for s, t in zip(source, target, strict=True)), "an edge of a node to itself")
    columns = zip(source, target, lows, highs, strict=True)
    return [(s, t, 1, low, high) if high > 0 else (s, t, -1, -high, -low) for s, t, low, high in columns], unit


def _over_one_unit(one: Numbers, other: Numbers) -> tuple[list[list[int]], int]:
    """Return two vectors as integers over one scale, and that."""
    parts = [numbers.over(range(len(numbers))) for numbers in (one, other)]
    (factors,), _ = integers([[Fraction(1, scale) for _, scale in parts]])
    values = []
    for factor, (numbers, _) in zip(factors, parts, strict=True):
        sized(len(numbers), longest(numbers) + factor.bit_length(), "the weights")
        values.append([factor * x for x in numbers])
    return values, parts[0][1] * factors[0]


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


def _hash(labels: Sequence[str], modes: Sequence[tuple[Sequence[Edge], int, bool]]) -> str:
    """Return the SHA-256 of nodes and modes; of undirected edges it tells if some weight is uncertain."""
    quoted = [*map(json.JSONEncoder(ensure_ascii=False).encode, labels)]
    order = sorted(range(len(labels)), key=labels.__getitem__)
    hashed = hashlib.sha256("".join([f"[{quoted[v]}]\n" for v in order]).encode("utf-8", "surrogatepass"))
    for number, (edges, unit, tied) in enumerate(modes):
        hashed.update(b"{}\n" if number else b"")
        hashed.update(b'{"undirected": true}\n' if tied and any(low < high for _, _, _, low, high in edges) else b"")
        spend(2 * len(edges), unit.bit_length(), unit.bit_length(), "the hash of long weights")
        # Edges ascend by target and sign. Put aside target by target in the order of labels, they do from every source.
        into = {t: list(some) for t, some in groupby(edges, itemgetter(1))}
        out: list[list[Edge]] = [[] for _ in labels]
        for edge in chain.from_iterable(into.get(v, ()) for v in order):
            out[edge[0]].append(edge)
        for v in order:
            lines = [f"[{quoted[v]}, {quoted[edge[1]]}, {_weight(edge, unit)}]\n" for edge in out[v]]
            hashed.update("".join(lines).encode("utf-8", "surrogatepass"))
    return hashed.hexdigest()


def _weight(edge: Edge, unit: int) -> str:
    """Write a weight, or the least and the largest one."""
    _, _, sign, low, high = edge
    texts = []
    for size in (low, high) if low < high else (low,):
        common = gcd(size, unit)
        texts.append(f'"{sign * size // common}{f"/{unit // common}" if common < unit else ""}"')
    return ", ".join(texts[::sign])


# ---------------------------------------------------------------------- claims


def _check_claims(doc: Document, labels: list[str], modes: list[Mode]) -> list[Component]:
    """Verify the behaviour of every component; the one with a common kernel by its basis, one without by a witness."""
    witnesses = doc.open("family-claim", "graph")["witness"]
    parts = _parts(len(labels), modes)
    single = len(parts) == 1
    section = [doc.section("claim")]
    need(single or section[0] is None, "the family is disconnected")
    if not single:
        need("components" in doc, 'the key "components" is missing')
        section = doc.section("components")
        need(len(section) == len(parts), f"components has not {len(parts)} entries")
    need(not single or "components" not in doc, "components of a connected family")
    doc.at = "family-claim of graph"
    need(len(witnesses) == len(parts), f"the witness has not {len(parts)} entries")
    result = []
    for entry, part, witness in zip(section, parts, witnesses, strict=True):
        component = _component(modes, part, witness)
        behaviour: Any = component.behaviour
        claim = FamilyClaim(theorem=THEOREM, behaviour=behaviour)
        expected = claim if single else FamilyComponent(nodes=part.nodes, claim=claim)
        need(entry == expected, f"what follows is {component.behaviour}")
        result.append(component)
    doc.done(", ".join(dict.fromkeys(component.behaviour for component in result)))
    return result


def _parts(n: int, modes: Sequence[Mode]) -> list[Part]:
    """Return the weak components of all edges, each with the camps that keep all its edges, or None."""
    edges = [edge for mode in modes for edge in mode.edges]
    source, target, minus = [e[0] for e in edges], [e[1] for e in edges], [e[2] < 0 for e in edges]
    first, opposite, odd = modes[0].structure.graph.signed_pieces(n, source, target, minus)
    groups: dict[int, list[int]] = {}
    for v, root in enumerate(first):
        groups.setdefault(root, []).append(v)
    home = {root: k for k, root in enumerate(groups)}
    parts: list[Part] = []
    for root, nodes in groups.items():
        camps = None if root in odd else {v: -1 if opposite[v] else 1 for v in nodes}
        parts.append(Part(nodes, camps, [[] for _ in modes], [[] for _ in modes]))
    for number, mode in enumerate(modes):
        for edge in mode.edges:
            parts[home[first[edge[0]]]].edges[number].append(edge)
        for k, group in enumerate(mode.structure.closed):
            parts[home[first[group[0]]]].closed[number].append(k)
    return parts


def _component(modes: Sequence[Mode], part: Part, witness: KernelWitness | Counterexample | None) -> Component:
    first, camps = modes[0].structure, part.camps
    pairs = zip(modes, part.closed, strict=True)
    balanced = [sum(m.structure.gauges[k] is not None for k in numbers) for m, numbers in pairs]
    pivots = {k + 1: first.closed[k][0] for k in part.closed[0] if first.gauges[k] is not None}
    one_group = all(len(numbers) == 1 for numbers in part.closed)
    kernel: dict[int, Row]
    if camps is not None and one_group and all(balanced):
        ((number, pivot),) = pivots.items()
        behaviour, kernel = CONSENSUS, {v: {number: Fraction(camps[v] * camps[pivot])} for v in part.nodes}
    elif len(set(balanced)) == 1 and any(balanced):
        kernel = _check_kernel(modes, part, witness)
        return Component(part, DEPENDS if not kernel else INTERVAL if one_group else CONTAINMENT, kernel, pivots)
    else:
        behaviour, kernel = (DEPENDS, {}) if any(balanced) else (STABILITY, {v: {} for v in part.nodes})
    need(witness is None, "a witness that nothing asks for")
    return Component(part, behaviour, kernel, pivots)


def _check_kernel(modes: Sequence[Mode], part: Part, witness: KernelWitness | Counterexample | None) -> dict[int, Row]:
    """Verify that all members share a kernel, by the rows of its basis, or that they do not, by a state at rest.

    Returns
    -------
    dict of int to Row
        The basis; empty if they do not.
    """
    if isinstance(witness, Counterexample):
        _check_counterexample(modes, part, witness)
        return {}
    if witness is None:
        raise RejectedError("a kernel without a witness")
    rows = _basis(modes[0].structure, part, witness.rows)
    whole, _ = _whole(rows)
    bits = longest(x for row in whole.values() for x in row.values())
    for mode, edges in zip(modes, part.edges, strict=True):
        graph = mode.structure.graph
        count = sum(len(whole[u]) for v in part.nodes for u in graph.row(v))
        count += sum(len(whole[s]) + len(whole[t]) for s, t, _, low, high in edges if low < high)
        spend(2 * count, graph.bits, bits, "rows of kernels")
        for v in part.nodes:
            need(not combination(graph.row(v), whole), "a column of the kernel is not at rest")
        for s, t, sign, low, high in edges:
            agrees = low == high or whole[t] == {j: sign * x for j, x in whole[s].items()}
            need(agrees, "an uncertain edge does not agree with the kernel")
    return rows


def _whole(rows: dict[int, Row]) -> tuple[dict[int, dict[int, int]], int]:
    """Return rows in integers over one scale, and that."""
    values, scale = integers([list(row.values()) for row in rows.values()])
    pairs = zip(rows.items(), values, strict=True)
    return {v: dict(zip(row, some, strict=True)) for (v, row), some in pairs}, scale


def _check_counterexample(modes: Sequence[Mode], part: Part, witness: Counterexample) -> None:
    """Verify that a state is at rest in the mandatory graph of one mode, and moves in a member of another.

    The state is enclosed: of every agent its middle is told, and a radius, which is 0 but for followers. A state at
    rest with these leaders exists, and lies within the radii if, for all followers ``k``,

        sum_l |w_kl| (radius_k - radius_l)  >=  |sum_l |w_kl| (middle_k - sgn(w_kl) middle_l)|.
    """
    numbers = witness.mode, witness.other
    need(all(0 <= k < len(modes) for k in numbers), "an unknown mode")
    mode, other = (modes[k] for k in numbers)
    inside = set(part.nodes)
    middle, radius = _state(mode.structure, inside, witness.state)
    bits = longest([*middle.values(), *radius.values()])
    for m in (mode, other):
        graph = m.structure.graph
        spend(2 * sum(len(graph.row(v)) for v in inside), graph.bits, bits, "a state at rest")
    for v in inside:
        row = mode.structure.graph.row(v)
        spare = sum(x * radius[u] if u == v else -abs(x) * radius[u] for u, x in row.items())
        need(abs(_dot(row, middle)) <= spare, "the state is not at rest")
    if (edge := witness.edge) is None:
        rows = (other.structure.graph.row(v) for v in inside)
        need(any(_moves(row, middle, radius) for row in rows), "the state is at rest in both")
        return
    s, t, sign = edge
    need(edge in {e[:3] for e in part.edges[numbers[1]] if e[3] < e[4]}, "a known edge")
    need(_moves({t: 1, s: -sign}, middle, radius), "the state is at rest in both")
    # Row t of one of two members differs: with this edge at w-, and at w+.


def _dot(row: dict[int, int], values: dict[int, int]) -> int:
    return sum(x * values[u] for u, x in row.items())


def _moves(row: dict[int, int], middle: dict[int, int], radius: dict[int, int]) -> bool:
    """Tell whether a row times the state is not 0, for all states within the radii."""
    return abs(_dot(row, middle)) > _dot({u: abs(x) for u, x in row.items()}, radius)


def _basis(structure: Structure, part: Part, entry: Mapping[str, Mapping[str, Fraction]]) -> dict[int, Row]:
    """Return the rows of the basis, without zeros: camps of leaders, and what is told of followers."""
    rows: dict[int, Row] = {v: {} for v in part.nodes}
    numbers = set()
    for k in part.closed[0]:
        if (gauge := structure.gauges[k]) is not None:
            numbers.add(k + 1)
            rows |= {v: {k + 1: Fraction(g)} for v, g in zip(structure.closed[k], gauge, strict=True)}
    followers = {v for v in part.nodes if structure.number[v] < 0}
    keys = set(map(str, numbers))
    for label, row in entry.items():
        v = structure.graph.index[label]
        need(v in followers, "a row of a node that is no follower")
        need(keys.issuperset(row), "a row of a kernel")
        rows[v] = {int(key): value for key, value in row.items() if value}
    return rows


def _state(
    structure: Structure, inside: set[int], entry: Mapping[str, Interval]
) -> tuple[dict[int, int], dict[int, int]]:
    """Return middles and radii of a state of all agents of a component, over one scale; those not told are 0."""
    nodes, ends = [structure.graph.index[label] for label in entry], list(entry.values())
    need(set(nodes) <= inside, "a state outside the component")
    exact_leaders = all(structure.number[v] < 0 or not radius for v, (_, radius) in zip(nodes, ends, strict=True))
    need(exact_leaders, "the state of a leader is not exact")
    (middles, radii), _ = integers([[x for x, _ in ends], [r for _, r in ends]])
    zero = dict.fromkeys(inside, 0)
    return zero | dict(zip(nodes, middles, strict=True)), zero | dict(zip(nodes, radii, strict=True))


def combination(factors: Mapping[int, Any], vectors: Mapping[int, dict[int, Any]]) -> dict[int, Any]:
    """Return the sum of multiples of vectors, without zeros.

    Examples
    --------
    >>> combination({1: 2, 2: -1}, {1: {5: 1, 6: 1}, 2: {5: 2}})
    {6: 2}
    """
    total: dict[int, Any] = {}
    for k, factor in factors.items():
        for j, x in vectors[k].items():
            total[j] = total.get(j, 0) + factor * x
    return {j: x for j, x in total.items() if x}
