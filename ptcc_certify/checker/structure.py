"""Verifies what is said of the graph: components, closedness, camps, negative cycles, the theorem that applies."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

from lmi.exact import arithmetic
from lmi.exact.work import keeps
from ptcc_certify.checker.digraph import digraph
from ptcc_certify.checker.obligations import OBLIGATIONS, Step
from ptcc_certify.checker.reading import RejectedError, entries, exact, fields, need, same
from ptcc_certify.checker.vectors import SideFiles, beside

#: Above this many weak components they are listed in arrays.
MANY_COMPONENTS = 100
#: Bytes that a node takes, at most about, and an edge in a side file, or in the JSON.
NODE_BYTES, EDGE_BYTES = 700, (100, 300)
NOMINAL = ("T", "rho1", "rho2", "kappa")
SLIDING = ("T_r", "T_s", "rho1", "rho2", "kappa", "mu1", "mu2", "mu3", "delta")
COROLLARIES = {"1.1": "6.1", "1.2": "6.2", "2": "7", "3": "8", "4": "9", "5": "10"}
BEHAVIOURS = ("bipartite consensus", "interval bipartite consensus", "bipartite containment")


class StructureCheck:
    """One run through a certificate: the graph, its structure, the theorem and the protocol."""

    def __init__(self, data: dict[str, Any], files: SideFiles, stdlib: bool):
        self.data, self.files, self.exact = data, files, arithmetic(stdlib)
        self.steps: list[Step] = []
        self.at, self.sha256, self.next = "format", "", 0
        self.theorem = ""

    def _bounded_size(self, rows: int) -> None:
        """Refuse matrices for which the arithmetic at hand would take long."""
        need(rows <= self.exact.rows, f"a matrix of {rows} rows; {self.exact.name} takes {self.exact.rows}")

    def open(self, kind: str, of: str, numbers: Sequence[str] = (), witness: bool = False) -> dict[str, Any]:
        """Take the next obligation of the proof, which must be this one; return its numbers."""
        self.at = f"{kind} of {of}"
        need(self.next < len(self.data["proof"]), "the proof does not list this obligation")
        step = fields(
            self.data["proof"][self.next], ("kind", "of", "statement", "lemma", "numbers", "witness"), "an obligation"
        )
        said = [step[key] for key in ("kind", "of", "statement", "lemma")]
        need(said == [kind, of, *OBLIGATIONS[kind]], "the proof lists another obligation here")
        need(witness or step["witness"] is None, "a witness that nothing asks for")
        self.next += 1
        found: dict[str, Any] = {k: exact(x) for k, x in fields(step["numbers"], numbers, "numbers").items()}
        return {**found, "witness": step["witness"]}

    def following(self) -> Any:
        """Return the kind of the next obligation, which is not verified yet; None if there is none."""
        step = self.data["proof"][self.next] if self.next < len(self.data["proof"]) else None
        return step.get("kind") if isinstance(step, dict) else None

    def done(self, detail: str) -> None:
        """Close the obligation that was opened last."""
        kind, _, of = self.at.partition(" of ")
        self.steps.append(Step(kind, of, detail))
        self.at = "format"

    # ------------------------------------------------------------------ graph and structure

    def graph(self) -> None:
        """Read nodes and edges; verify their hash."""
        self.at = "graph"
        said = fields(self.data["graph"], ("nodes", "edges", "read", "sha256"), "graph")
        how = fields(said["read"], ("orientation", "duplicates", "self_loops", "undirected"), "read")
        need(how["orientation"] in ("information", "listens", "matrix"), "read: an unknown orientation")
        need(how["duplicates"] in ("refused", "sum", "last"), "read: duplicates")
        loops = how["self_loops"]
        kept = isinstance(loops, str) and re.fullmatch(r"refused|dropped [0-9]{1,12}", loops) is not None
        need(kept, "read: self_loops")
        need(isinstance(how["undirected"], bool), "read: undirected")
        self.labels = entries(said["nodes"], "nodes")
        need(
            all(isinstance(x, str) for x in self.labels) and bool(self.labels), "nodes are not texts, or there is none"
        )
        self.index = {label: i for i, label in enumerate(self.labels)}
        need(len(self.index) == len(self.labels), "a node occurs twice")
        self.n = len(self.labels)
        self._fit(NODE_BYTES * self.n)
        self.digraph = digraph(self.n, *self._edges(said["edges"]), self.exact.numpy)
        self.sha256 = self.digraph.sha256(self.labels)
        need(said["sha256"] == self.sha256, "the SHA-256 of the edge list is another")

    def _fit(self, size: int) -> None:
        """Refuse a graph for which the memory does not suffice."""
        need(keeps(size), "a graph that may take more memory than is allowed; allow more by --memory")

    def _edges(self, said: Any) -> tuple[Any, Any, Any, int]:
        """Return sources, targets, weights and what divides the weights."""
        if isinstance(said, dict):
            said = fields(said, ("count", "source", "target", "weight", "scale"), "edges")
            count, scale = said["count"], exact(said["scale"])
            need(type(count) is int and 0 < count <= self.n**2, "edges: count is no number of edges")
            need(scale > 0 and scale.denominator == 1, "scale is not a positive integer")
            self._fit(EDGE_BYTES[0] * count)
            source, target, weight = (self.files.column(said[key], count) for key in ("source", "target", "weight"))
            need(source.typecode == target.typecode == "q", "ends of edges are not integers")
            return source, target, weight, int(scale)
        self._fit(EDGE_BYTES[1] * len(entries(said, "edges")))
        rows = [entries(row, "an edge", 3) for row in said]
        need(all(isinstance(x, str) and x in self.index for row in rows for x in row[:2]), "an edge of an unknown node")
        return [self.index[r[0]] for r in rows], [self.index[r[1]] for r in rows], [exact(r[2]) for r in rows], 1

    def _numbers(self, said: Any, what: str, count: int | None = None) -> list[int]:
        """Return the indices of a list of labels, or of so many nodes in a side vector."""
        if count is not None and beside(said):
            nodes = self.files.integers(said, what, count)
            need(all(0 <= v < self.n for v in nodes), f"{what}: an unknown node")
            return nodes
        labels = entries(said, what, count)
        need(all(isinstance(x, str) and x in self.index for x in labels), f"{what}: an unknown node")
        return [self.index[label] for label in labels]

    def structure(self) -> None:
        """Recompute components, camps, leaders and followers; verify every witness."""
        self.open("structure", "graph")
        said = fields(
            self.data["structure"],
            ("connectivity", "closed_components", "leaders", "followers", "balanced", "sign_symmetric"),
            "structure",
        )
        self.closed: list[list[int]] = []
        self.gauges: list[list[int] | None] = []
        for entry in entries(said["closed_components"], "closed_components"):
            balanced = isinstance(entry, dict) and entry.get("balanced") is True
            fields(entry, ("nodes", "balanced", "gauge" if balanced else "negative_cycle"), "a closed component")
            need(type(entry["balanced"]) is bool, "balance of a closed component")
            nodes = self._numbers(entry["nodes"], "a closed component")
            need(bool(nodes) and all(a < b for a, b in pairwise(nodes)), "nodes of a closed component are not in order")
            self.closed.append(nodes)
            self.gauges.append(self._gauge(entry["gauge"], len(nodes)) if balanced else None)
        self._closed_components()
        gauge = [0] * self.n
        for entry, nodes, own in zip(said["closed_components"], self.closed, self.gauges, strict=True):
            if own is None:
                self._negative_cycle(entry["negative_cycle"], nodes)
            else:
                for v, sign in zip(nodes, own, strict=True):
                    gauge[v] = sign
        need(self.digraph.fits(gauge), "camps of a component")
        leaders = [v for nodes in self.closed for v in nodes]
        self.followers = [v for v, k in enumerate(self.number) if k < 0]
        need(self._numbers(said["leaders"], "leaders", len(leaders)) == leaders, "other leaders")
        need(self._numbers(said["followers"], "followers", len(self.followers)) == self.followers, "other followers")
        need(said["balanced"] is (not self.digraph.pieces[1]), "balance of the graph")
        need(said["sign_symmetric"] is self.digraph.mutual[0], "sign symmetry")
        self.moving = self.digraph.listening()
        self.done(f"{self.n} nodes, {self.digraph.n_edges} edges, {len(self.closed)} closed component(s)")

    @cached_property
    def kept(self) -> list[int]:
        """All nodes but the first one of each balanced closed component."""
        first = {nodes[0] for nodes, gauge in zip(self.closed, self.gauges, strict=True) if gauge}
        return [v for v in range(self.n) if v not in first]

    def _gauge(self, said: Any, count: int) -> list[int]:
        gauge = entries(said, "gauge", count)
        need(all(type(g) is int and g in (1, -1) for g in gauge) and gauge[0] == 1, "camps of a component")
        return gauge

    def _closed_components(self) -> None:
        """Verify that the groups that are listed are the closed strong components, all of them.

        A group that no edge enters, within which one node reaches all others and is reached by them, is one. There is
        no other if every node is reached from some group: the nodes that reach a closed component are its own.
        """
        need(all(a[0] < b[0] for a, b in pairwise(self.closed)), "closed components are in another order")
        self.number = [-1] * self.n  # of every node's closed component
        for k, nodes in enumerate(self.closed):
            for v in nodes:
                need(self.number[v] < 0, "a node in two closed components")
                self.number[v] = k
        need(self.digraph.closed(self.number), "a component that is not closed")
        first = [nodes[0] for nodes in self.closed]
        for back in (False, True):
            seen = self.digraph.reached(first, back, self.number)
            need(sum(seen) == sum(map(len, self.closed)), "a component that is not strongly connected")
        need(all(self.digraph.reached(first)), "a closed component is missing")

    def _negative_cycle(self, said: Any, nodes: Sequence[int]) -> None:
        """Check a closed walk of the undirected graph inside a component whose signs multiply to -1."""
        steps = [tuple(self._numbers(entries(step, "a step", 2), "a step")) for step in entries(said, "negative_cycle")]
        group = set(nodes)
        inside = all(s in group and t in group and self.digraph.sign(s, t) for s, t in steps)
        need(bool(steps) and inside, "not a walk along edges of the component")
        need(math.prod(self.digraph.sign(s, t) for s, t in steps) == -1, "the cycle is not negative")
        for home in steps[0]:
            place: int | None = home
            for s, t in steps:
                place = t if place == s else s if place == t else None
            if place == home:
                return
        raise RejectedError("the walk is not closed")

    # ------------------------------------------------------------------ what is claimed

    def protocol(self) -> None:
        """Read the parameters, which are positive; mu1 is above delta."""
        self.at = "protocol"
        said = self.data["protocol"]
        self.is_sliding = isinstance(said, dict) and said.get("kind") == "sliding-mode"
        own = ("disturbance",) if self.is_sliding else ()
        names = SLIDING if self.is_sliding else NOMINAL
        said = fields(said, ("kind", *names, *own), "protocol")
        need(self.is_sliding or said["kind"] == "nominal", "an unknown kind of protocol")
        self.gains = {name: exact(said[name]) for name in names}
        need(all(value > 0 for name, value in self.gains.items() if name != "delta"), "a parameter is not positive")
        if self.is_sliding:
            need(0 <= self.gains["delta"] < self.gains["mu1"], "mu1 is not above delta")
            need(said["disturbance"] is None or isinstance(said["disturbance"], str), "disturbance is not a text")

    def claims(self) -> None:
        """Verify theorem, behaviour and corollaries of every weak component."""
        self.open("claim", "graph")
        piece, torn = self.digraph.pieces
        pieces: dict[int, list[int]] = {}
        for v, root in enumerate(piece):
            pieces.setdefault(root, []).append(v)
        held: dict[int, list[int]] = {root: [] for root in pieces}
        for k, group in enumerate(self.closed):
            held[piece[group[0]]].append(k)
        odd, negative = self.digraph.mutual[1], self.digraph.antagonistic()
        expected = []
        for root, nodes in pieces.items():
            only = len(held[root]) == 1
            row = 0 if only and len(self.closed[held[root][0]]) == len(nodes) else 1 if only else 2
            some = any(self.gauges[k] is not None for k in held[root])
            flags = {
                "1.1": row == 0 and some and root not in odd,
                "1.2": row == 0 and not some and root not in odd,
                "2": row == 0 and some and root not in negative,
                "3": row == 1 and some and root not in torn,
                "4": row == 1 and some and root not in negative,
                "5": row == 2 and some and root not in negative,
            }
            theorem = f"{row + (4 if self.is_sliding else 1)}.{1 if some else 2}"
            names = [COROLLARIES[k] if self.is_sliding else k for k, holds in flags.items() if holds]
            behaviour = BEHAVIOURS[row] if some else "stability"
            claim: dict[str, Any] = {"theorem": theorem, "behaviour": behaviour, "corollaries": names}
            expected.append((nodes, ("strong", "quasi-strong", "weak")[row], claim))
        said, connectivity = self.data["claim"], self.data["structure"]["connectivity"]
        if len(expected) == 1:
            need("components" not in self.data, "components of a connected graph")
            need(connectivity == expected[0][1], f"the graph is {expected[0][1]}")
            need(same(said, expected[0][2]), f"the claim is Theorem {expected[0][2]['theorem']}")
            self.theorem, self.components = expected[0][2]["theorem"], []
        else:
            need(connectivity == "disconnected" and said is None, "the graph is disconnected")
            self.components = self._components(expected)
            some = any(gauge is not None for gauge in self.gauges)
            self.theorem = f"{6 if self.is_sliding else 3}.{1 if some else 2}"
        self.done(f"Theorem {self.theorem}" if not self.components else f"{len(expected)} components")

    def _components(self, expected: Sequence[tuple[list[int], str, dict[str, Any]]]) -> list[tuple[list[int], Any]]:
        """Check what is said of each component; return its nodes and the outcome that is claimed."""
        said = self.data.get("components")
        if len(expected) > MANY_COMPONENTS:
            keys = ("theorem", "behaviour", "corollaries")
            said = fields(said, ("nodes", "connectivity", *keys), "components")
            if beside(said["nodes"]):
                number = [-1] * self.n
                for k, (nodes, _, _) in enumerate(expected):
                    for v in nodes:
                        number[v] = k
                need(self.files.integers(said["nodes"], "nodes", self.n) == number, "other components")
            else:
                groups = [self._numbers(x, "a component") for x in entries(said["nodes"], "nodes")]
                need(groups == [e[0] for e in expected], "other components")
            need(same(said["connectivity"], [e[1] for e in expected]), "connectivity of the components")
            need(all(same(said[key], [e[2][key] for e in expected]) for key in keys), "claims of the components")
            return [(e[0], None) for e in expected]
        found = []
        for entry, (nodes, connectivity, claim) in zip(
            entries(said, "components", len(expected)), expected, strict=True
        ):
            fields(entry, ("nodes", "connectivity", "claim", "outcome"), "a component")
            need(self._numbers(entry["nodes"], "a component") == nodes, "another component")
            need(entry["connectivity"] == connectivity and same(entry["claim"], claim), "the claim of a component")
            found.append((nodes, entry["outcome"]))
        return found
