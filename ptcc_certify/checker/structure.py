"""Verifies what is said of the graph: closed components, camps, negative cycles, and the theorem that applies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal, TypeAlias

from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.reading import RejectedError, entries, fields, need, same
from ptcc_certify.checker.section_declarations import (
    Ball,
    Integers,
    ManyNodes,
    Node,
    Nodes,
    Pattern,
    Several,
    Some,
    Unread,
)
from ptcc_certify.checker.side_files import beside

#: Above this many weak components they are listed in arrays.
MANY_COMPONENTS = 100
COROLLARIES = {"1.1": "6.1", "1.2": "6.2", "2": "7", "3": "8", "4": "9", "5": "10"}
CONNECTIVITY = ("strong", "quasi-strong", "weak")
BEHAVIOURS = ("bipartite consensus", "interval bipartite consensus", "bipartite containment")

Connectivity = Literal["strong", "quasi-strong", "weak"]
Theorem: TypeAlias = Annotated[str, Pattern("[1-6][.][12]")]
Behaviour: TypeAlias = Annotated[str, Pattern("|".join((*BEHAVIOURS, "stability")))]
Corollary = Literal["1.1", "1.2", "2", "3", "4", "5", "6.1", "6.2", "7", "8", "9", "10"]


@dataclass(frozen=True, kw_only=True)
class BalancedComponent:
    """A balanced closed component: its nodes, and the camp of each."""

    nodes: Nodes
    balanced: Literal[True]
    gauge: Several[Literal[1, -1]]


@dataclass(frozen=True, kw_only=True)
class UnbalancedComponent:
    """A closed component that is not balanced: its nodes, and a negative cycle."""

    nodes: Nodes
    balanced: Literal[False]
    negative_cycle: Several[tuple[Node, Node]]


@dataclass(frozen=True, kw_only=True)
class StructureSection:
    """What the file says of the structure of a graph."""

    connectivity: Literal["strong", "quasi-strong", "weak", "disconnected"]
    closed_components: Unread[Several[BalancedComponent | UnbalancedComponent]]
    leaders: ManyNodes
    followers: ManyNodes
    balanced: bool
    sign_symmetric: bool


@dataclass(frozen=True, kw_only=True)
class ClaimSection:
    """The theorem that applies, what agents do by it, and the corollaries whose hypotheses hold."""

    theorem: Theorem
    behaviour: Behaviour
    corollaries: Several[Corollary]


@dataclass(frozen=True, kw_only=True)
class ComponentSection:
    """A weak component, its claim, and where its agents end."""

    nodes: Several[Node]
    connectivity: Connectivity
    claim: ClaimSection
    final_state: Some[Ball] | None = None


@dataclass(frozen=True, kw_only=True)
class ManyComponents:
    """Many weak components: labels of their nodes, or the number of every node's, and of each what is claimed."""

    nodes: Several[Several[Node]] | Integers
    connectivity: Several[Connectivity]
    theorem: Several[Theorem]
    behaviour: Several[Behaviour]
    corollaries: Several[Several[Corollary]]


@dataclass(frozen=True, eq=False)
class Structure:
    """The closed strong components of the graph.

    Attributes
    ----------
    graph : Digraph
    closed : list of list of int
        Their nodes.
    gauges : list of (list of int or None)
        The camps of each, 1 and -1; None: not balanced.
    number : list of int
        Of every node's closed component; -1: a follower.
    """

    graph: Digraph
    closed: list[list[int]]
    gauges: list[list[int] | None]
    number: list[int]

    @cached_property
    def followers(self) -> list[int]:
        """The nodes of no closed component."""
        return [v for v, k in enumerate(self.number) if k < 0]

    @cached_property
    def balanced(self) -> list[tuple[int, list[int], list[int]]]:
        """The balanced closed components: number from 1 on, nodes, camps."""
        pairs = enumerate(zip(self.closed, self.gauges, strict=True), start=1)
        return [(k, nodes, gauge) for k, (nodes, gauge) in pairs if gauge is not None]

    @cached_property
    def free_nodes(self) -> list[int]:
        """All nodes but the first one of each balanced closed component."""
        first = {nodes[0] for _, nodes, _ in self.balanced}
        return [v for v in range(self.graph.n) if v not in first]

    def strong_component(self, v: int) -> tuple[list[int], bool]:
        """Return the strong component of a node, and whether it is closed and balanced, so that 0 is an eigenvalue."""
        there, back = (self.graph.reached([v], back) for back in (False, True))
        own = [u for u, both in enumerate(zip(there, back, strict=True)) if all(both)]
        return own, self.number[v] >= 0 and self.gauges[self.number[v]] is not None


@dataclass(frozen=True)
class Claim:
    """The theorem whose Lyapunov function is used, and the weak components, if several, with their final states.

    Attributes
    ----------
    theorem : str
    components : list of (list of int, JSON)
        Empty for a connected graph; the final state of each is not verified yet.
    """

    theorem: str
    components: list[tuple[list[int], Any]]


def check_structure(doc: Document, graph: Digraph, section: StructureSection, of: str) -> Structure:
    """Verify closed components, camps, leaders and followers, and every witness."""
    doc.open("structure", of)
    closed: list[list[int]] = []
    gauges: list[list[int] | None] = []
    for entry in entries(section.closed_components, "closed_components"):
        balanced = isinstance(entry, dict) and entry.get("balanced") is True
        fields(entry, ("nodes", "balanced", "gauge" if balanced else "negative_cycle"), "a closed component")
        need(type(entry["balanced"]) is bool, "balance of a closed component")
        nodes = positions(doc, graph, entry["nodes"], "a closed component")
        need(bool(nodes) and all(a < b for a, b in pairwise(nodes)), "nodes of a closed component are not in order")
        gauge = None
        if balanced:
            gauge = entries(entry["gauge"], "gauge", len(nodes))
            need(all(type(g) is int and abs(g) == 1 for g in gauge) and gauge[0] == 1, "camps of a component")
        else:
            _negative_cycle(doc, graph, entry["negative_cycle"], set(nodes))
        closed.append(nodes)
        gauges.append(gauge)
    structure = Structure(graph, closed, gauges, _closed_components(graph, closed))
    doc.context.followers = [graph.labels[v] for v in structure.followers]
    signs = {v: g for _, nodes, gauge in structure.balanced for v, g in zip(nodes, gauge, strict=True)}
    need(graph.fits([signs.get(v, 0) for v in range(graph.n)]), "camps of a component")
    for key, expected in (("leaders", [v for nodes in closed for v in nodes]), ("followers", structure.followers)):
        need(positions(doc, graph, getattr(section, key), key, len(expected)) == expected, f"other {key}")
    need(section.balanced is (not graph.pieces[1]), "balance of the graph")
    need(section.sign_symmetric is graph.mutual[0], "sign symmetry")
    doc.done(f"{graph.n} nodes, {graph.n_edges} edges, {len(closed)} closed component(s)")
    return structure


def _closed_components(graph: Digraph, closed: Sequence[Sequence[int]]) -> list[int]:
    """Verify that the groups that are listed are the closed strong components, all of them; number their nodes.

    A group that no edge enters, within which one node reaches all others and is reached by them, is one. There is
    no other if every node is reached from some group: the nodes that reach a closed component are its own.
    """
    need(all(a[0] < b[0] for a, b in pairwise(closed)), "closed components are in another order")
    number = [-1] * graph.n
    for k, nodes in enumerate(closed):
        for v in nodes:
            need(number[v] < 0, "a node in two closed components")
            number[v] = k
    need(graph.closed(number), "a component that is not closed")
    first = [nodes[0] for nodes in closed]
    for back in (False, True):
        inside = sum(graph.reached(first, back, number)) == sum(map(len, closed))
        need(inside, "a component that is not strongly connected")
    need(all(graph.reached(first)), "a closed component is missing")
    return number


def _negative_cycle(doc: Document, graph: Digraph, entry: Any, group: set[int]) -> None:
    """Check a closed walk of the undirected graph inside a component whose signs multiply to -1."""
    steps = [positions(doc, graph, entries(x, "a step", 2), "a step") for x in entries(entry, "negative_cycle")]
    inside = all(s in group and t in group and graph.sign(s, t) for s, t in steps)
    need(bool(steps) and inside, "not a walk along edges of the component")
    need(math.prod(graph.sign(s, t) for s, t in steps) == -1, "the cycle is not negative")
    for home in steps[0]:
        place: int | None = home
        for s, t in steps:
            place = t if place == s else s if place == t else None
        if place == home:
            return
    raise RejectedError("the walk is not closed")


def check_claim(doc: Document, structure: Structure, sliding: bool) -> Claim:
    """Verify theorem, behaviour and corollaries of every weak component."""
    doc.open("claim", "graph")
    connectivity, expected = doc.sections["structure"][0].connectivity, _expected(structure, sliding)
    section: ClaimSection | None = doc.section("claim")
    doc.at = "claim of graph"
    if len(expected) == 1:
        ((_, kind, claim),) = expected
        need("components" not in doc, "components of a connected graph")
        need(connectivity == kind, f"the graph is {kind}")
        other = section is not None and section.theorem == claim.theorem and section.behaviour != claim.behaviour
        need(section == claim, f"the claim is {f'{claim.behaviour} by ' if other else ''}Theorem {claim.theorem}")
        verified = Claim(claim.theorem, [])
    else:
        need(connectivity == "disconnected" and section is None, "the graph is disconnected")
        theorem = f"{6 if sliding else 3}.{1 if structure.balanced else 2}"
        verified = Claim(theorem, _components(doc, structure.graph, expected))
    doc.done(f"{len(expected)} components" if verified.components else f"Theorem {verified.theorem}")
    return verified


def reference(theorem: str, corollaries: Sequence[str] = ()) -> str:
    """Return a theorem as it is cited, with the last of the corollaries that make the behaviour sharper.

    Examples
    --------
    >>> reference("2.1", ["3"]), reference("1.2", ["1.2"]), reference("families")
    ('Theorem 2.1, Corollary 3', 'Theorem 1.2', 'families')
    """
    sharper = [number for number in corollaries if number not in ("1.2", "6.2")]
    named = f"Theorem {theorem}" if theorem[0].isdigit() else theorem
    return f"{named}, Corollary {sharper[-1]}" if sharper else named


def _expected(structure: Structure, sliding: bool) -> list[tuple[list[int], str, ClaimSection]]:
    """Return nodes, connectivity and claim of every weak component, by section 7 of the format."""
    piece, torn = structure.graph.pieces
    odd, negative = structure.graph.mutual[1], structure.graph.antagonistic()
    pieces: dict[int, list[int]] = {}
    for v, root in enumerate(piece):
        pieces.setdefault(root, []).append(v)
    groups: dict[int, list[int]] = {root: [] for root in pieces}
    for k, group in enumerate(structure.closed):
        groups[piece[group[0]]].append(k)
    expected = []
    for root, nodes in pieces.items():
        row = 2 if len(groups[root]) > 1 else int(len(structure.closed[groups[root][0]]) < len(nodes))
        balanced = any(structure.gauges[k] is not None for k in groups[root])
        holds = {
            "1.1": row == 0 and balanced and root not in odd,
            "1.2": row == 0 and not balanced and root not in odd,
            "2": row == 0 and balanced and root not in negative,
            "3": row == 1 and balanced and root not in torn,
            "4": row == 1 and balanced and root not in negative,
            "5": row == 2 and balanced and root not in negative,
        }
        corollaries: list[Any] = [COROLLARIES[key] if sliding else key for key in holds if holds[key]]
        theorem = f"{row + (4 if sliding else 1)}.{1 if balanced else 2}"
        behaviour = BEHAVIOURS[row] if balanced else "stability"
        claim = ClaimSection(theorem=theorem, behaviour=behaviour, corollaries=corollaries)
        expected.append((nodes, CONNECTIVITY[row], claim))
    return expected


def _components(doc: Document, graph: Digraph, expected: Sequence[Any]) -> list[tuple[list[int], Any]]:
    """Check what is said of each weak component; return its nodes and the final state that is claimed."""
    section, groups = doc.section("components"), [nodes for nodes, _, _ in expected]
    doc.at = "claim of graph"
    labels = [[graph.labels[v] for v in nodes] for nodes in groups]
    states: list[Any] = [None] * len(groups)
    reference: Any
    if len(groups) <= MANY_COMPONENTS:
        items = entries(section, "components", len(groups))
        states = [entry.get("final_state") if isinstance(entry, dict) else None for entry in items]
        reference = [
            {"nodes": nodes, "connectivity": kind, "claim": vars(claim)}
            | ({} if state is None else {"final_state": state})
            for nodes, (_, kind, claim), state in zip(labels, expected, states, strict=True)
        ]
    else:
        reference = {"nodes": labels, "connectivity": [kind for _, kind, _ in expected]}
        keys = "theorem", "behaviour", "corollaries"
        reference |= {key: [getattr(claim, key) for _, _, claim in expected] for key in keys}
        if isinstance(section, dict) and beside(section.get("nodes")):
            number = {v: k for k, nodes in enumerate(groups) for v in nodes}
            items = doc.files.integers(section["nodes"], "nodes", graph.n)
            need(items == [number[v] for v in range(graph.n)], "other components")
            reference["nodes"] = section["nodes"]
    need(same(section, reference), "other components, or another claim of one")
    ordered = all(list(state) == nodes for nodes, state in zip(labels, states, strict=True) if state is not None)
    need(ordered, "agents of a component are in another order")
    return list(zip(groups, states, strict=True))
