"""Verifies what is said of the graph: components, closedness, camps, negative cycles, the theorem that applies."""

from __future__ import annotations

import hashlib
import json
import math
import re
import sys
from array import array
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from ptcc_certify.checker.obligations import OBLIGATIONS, Step
from ptcc_certify.checker.reading import MAX_SCALE_BITS, RejectedError, entries, exact, fields, need, same
from ptcc_certify.definite import arithmetic

#: Above this many weak components they are listed in arrays.
MANY_COMPONENTS = 100
NOMINAL = ("T", "rho1", "rho2", "kappa")
SLIDING = ("T_r", "T_s", "rho1", "rho2", "kappa", "mu1", "mu2", "mu3", "delta")
COROLLARIES = {"1.1": "6.1", "1.2": "6.2", "2": "7", "3": "8", "4": "9", "5": "10"}
BEHAVIOURS = ("bipartite consensus", "interval bipartite consensus", "bipartite containment")
NPY = re.compile(r"\{'descr': '(<i8|<f8)', 'fortran_order': False, 'shape': \(([0-9]{1,12}),\), \} *\n")


class StructureCheck:
    """One run through a certificate: the graph, its structure, the theorem and the protocol."""

    def __init__(self, data: dict[str, Any], folder: Path, stdlib: bool):
        self.data, self.folder, self.exact = data, folder, arithmetic(stdlib)
        self.steps: list[Step] = []
        self.at, self.sha256, self.next = "format", "", 0
        self.theorem = ""

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
        need(re.fullmatch(r"refused|dropped [0-9]{1,12}", str(how["self_loops"])) is not None, "read: self_loops")
        need(isinstance(how["undirected"], bool), "read: undirected")
        self.labels = entries(said["nodes"], "nodes")
        need(
            all(isinstance(x, str) for x in self.labels) and bool(self.labels), "nodes are not texts, or there is none"
        )
        self.index = {label: i for i, label in enumerate(self.labels)}
        need(len(self.index) == len(self.labels), "a node occurs twice")
        self.n = len(self.labels)
        sources, targets, weights, scale = self._edges(said["edges"])
        ends = list(zip(targets, sources, strict=True))
        need(all(a < b for a, b in pairwise(ends)), "edges are not in order, or one occurs twice")
        need(all(0 <= s < self.n and 0 <= t < self.n and s != t for t, s in ends), "an edge of a node to itself")
        need(all(weights), "an edge of weight 0")
        hashed = hashlib.sha256()
        quoted = [json.dumps(label, ensure_ascii=False) for label in self.labels]
        order = sorted(range(self.n), key=self.labels.__getitem__)
        rank = {v: i for i, v in enumerate(order)}
        hashed.update("".join(f"[{quoted[v]}]\n" for v in order).encode("utf-8", "surrogatepass"))
        for k in sorted(range(len(weights)), key=lambda k: (rank[sources[k]], rank[targets[k]])):
            w = weights[k] if scale == 1 else Fraction(weights[k]) / scale
            line = f'[{quoted[sources[k]]}, {quoted[targets[k]]}, "{w}"]\n'
            hashed.update(line.encode("utf-8", "surrogatepass"))
        self.sha256 = hashed.hexdigest()
        need(said["sha256"] == self.sha256, "the SHA-256 of the edge list is another")
        self.scale, self.edges = scale, list(zip(sources, targets, weights, strict=True))
        self.heard: list[dict[int, Fraction | int]] = [{} for _ in range(self.n)]  # source and weight, times scale
        for s, t, w in self.edges:
            self.heard[t][s] = w

    @cached_property
    def unit(self) -> int:
        """A positive integer that makes every weight one."""
        unit = 1
        for _, _, w in self.edges:
            unit = math.lcm(unit, w.denominator)
            need(unit.bit_length() <= MAX_SCALE_BITS, "the weights have no common denominator of moderate length")
        return unit * self.scale

    @cached_property
    def L(self) -> list[dict[int, int]]:
        """Rows of the signed Laplacian, times ``unit``."""
        rows, factor = [], self.unit // self.scale
        for i, heard in enumerate(self.heard):
            own = {j: -int(w * factor) for j, w in heard.items()}
            rows.append({i: sum(map(abs, own.values())), **own} if own else {})
        return rows

    def _edges(self, said: Any) -> tuple[list[int], list[int], list[Any], int]:
        """Return sources, targets, weights and what divides the weights."""
        if isinstance(said, dict):
            said = fields(said, ("count", "source", "target", "weight", "scale"), "edges")
            need(type(said["count"]) is int and said["count"] > 0, "edges: count is no positive integer")
            scale = exact(said["scale"])
            need(scale > 0 and scale.denominator == 1, "scale is not a positive integer")
            columns = [self._column(said[key], said["count"]) for key in ("source", "target", "weight")]
            need(all(isinstance(x, int) for x in (*columns[0], *columns[1])), "ends of edges are not integers")
            need(all(math.isfinite(w) for w in columns[2]), "a weight is not finite")
            return columns[0], columns[1], [plain(Fraction(w)) for w in columns[2]], int(scale)
        rows = [entries(row, "an edge", 3) for row in entries(said, "edges")]
        need(all(isinstance(x, str) and x in self.index for row in rows for x in row[:2]), "an edge of an unknown node")
        return [self.index[r[0]] for r in rows], [self.index[r[1]] for r in rows], [plain(exact(r[2])) for r in rows], 1

    def _column(self, said: Any, count: int) -> list[Any]:
        """Read a side file: one .npy vector of 64-bit numbers, little-endian, named with its SHA-256."""
        said = fields(said, ("file", "sha256"), "a side file")
        name = said["file"]
        need(isinstance(name, str) and re.fullmatch(r"[\w.-]{1,200}", name) is not None, "a side file's name is odd")
        try:
            need((self.folder / name).is_file(), f"side file {name} cannot be read")
            fits = (self.folder / name).stat().st_size <= 8 * count + 1024
            need(fits, f"side file {name} is not a vector of {count} numbers")
            with (self.folder / name).open("rb") as file:
                content = file.read()
        except OSError:
            raise RejectedError(f"side file {name} cannot be read") from None
        need(hashlib.sha256(content).hexdigest() == said["sha256"], f"side file {name} is not what its hash says")
        size = int.from_bytes(content[8:10], "little")
        match = NPY.fullmatch(content[10 : 10 + size].decode("latin-1"))
        fits = content[:8] == b"\x93NUMPY\x01\x00" and match is not None and int(match[2]) == count
        need(fits and len(content) == 10 + size + 8 * count, f"side file {name} is not a vector of {count} numbers")
        values = array("q" if match is not None and match[1] == "<i8" else "d", content[10 + size :])
        if sys.byteorder == "big":
            values.byteswap()
        return values.tolist()

    def _numbers(self, said: Any, what: str) -> list[int]:
        """Return the indices of a list of labels."""
        labels = entries(said, what)
        need(all(isinstance(x, str) and x in self.index for x in labels), f"{what}: an unknown node")
        return [self.index[label] for label in labels]

    def _strong_components(self) -> list[int]:
        """Return the number of every node's strong component (Tarjan), without recursion."""
        heard = [list(row) for row in self.heard]
        order, low, number = [0] * self.n, [0] * self.n, [-1] * self.n
        stack: list[int] = []
        count = groups = 0
        for root in range(self.n):
            work = [(root, 0)] if not order[root] else []
            while work:
                v, k = work.pop()
                if k == 0:
                    count += 1
                    order[v] = low[v] = count
                    stack.append(v)
                elif number[heard[v][k - 1]] < 0:
                    low[v] = min(low[v], low[heard[v][k - 1]])
                while k < len(heard[v]) and order[heard[v][k]]:
                    if number[heard[v][k]] < 0:
                        low[v] = min(low[v], order[heard[v][k]])
                    k += 1
                if k < len(heard[v]):
                    work += [(v, k + 1), (heard[v][k], 0)]
                elif low[v] == order[v]:
                    while number[v] < 0:
                        number[stack.pop()] = groups
                    groups += 1
        return number

    def _camps(self, edges: Sequence[tuple[int, int, int]]) -> tuple[list[int], list[int], set[int]]:
        """Return signs along a search of the undirected graph, the first node of each piece, pieces that conflict."""
        near: list[list[tuple[int, int]]] = [[] for _ in range(self.n)]
        for s, t, w in edges:
            near[s].append((t, 1 if w > 0 else -1))
            near[t].append((s, 1 if w > 0 else -1))
        camp, piece = [0] * self.n, [-1] * self.n
        for root in range(self.n):
            todo = [] if camp[root] else [root]
            if todo:
                camp[root], piece[root] = 1, root
            while todo:
                v = todo.pop()
                for u, sign in near[v]:
                    if not camp[u]:
                        camp[u], piece[u] = camp[v] * sign, root
                        todo.append(u)
        return camp, piece, {piece[s] for s, t, w in edges if w * camp[s] * camp[t] < 0}

    def structure(self) -> None:
        """Recompute components, camps, leaders and followers; verify every witness."""
        self.open("structure", "graph")
        said = fields(
            self.data["structure"],
            ("connectivity", "closed_components", "leaders", "followers", "balanced", "sign_symmetric"),
            "structure",
        )
        self.strong = self._strong_components()
        opened = {self.strong[t] for s, t, _ in self.edges if self.strong[s] != self.strong[t]}
        groups: dict[int, list[int]] = {}
        for v in range(self.n):
            if self.strong[v] not in opened:
                groups.setdefault(self.strong[v], []).append(v)
        self.closed = list(groups.values())  # in the order of their smallest nodes
        leading = {v for group in self.closed for v in group}
        self.followers = [v for v in range(self.n) if v not in leading]
        _, self.piece, self.conflicts = self._camps(self.edges)
        camp, first, torn = self._camps([e for e in self.edges if e[1] in leading])
        self.gauges = [None if first[group[0]] in torn else [camp[v] for v in group] for group in self.closed]
        listed = entries(said["closed_components"], "closed_components", len(self.closed))
        for entry, group, gauge in zip(listed, self.closed, self.gauges, strict=True):
            witness = "negative_cycle" if gauge is None else "gauge"
            fields(entry, ("nodes", "balanced", witness), "a closed component")
            need(self._numbers(entry["nodes"], "a closed component") == group, "another closed component")
            need(entry["balanced"] is (gauge is not None), "balance of a closed component")
            if gauge is None:
                self._negative_cycle(entry["negative_cycle"], set(group))
            else:
                need(same(entry["gauge"], gauge), "camps of a component")
        need(self._numbers(said["leaders"], "leaders") == [v for g in self.closed for v in g], "other leaders")
        need(self._numbers(said["followers"], "followers") == self.followers, "other followers")
        need(said["balanced"] is (not self.conflicts), "balance of the graph")
        signs = {(s, t): w > 0 for s, t, w in self.edges}
        symmetric = all(signs.get((t, s), sign) == sign for (s, t), sign in signs.items())
        need(said["sign_symmetric"] is symmetric, "sign symmetry")
        self.kept = sorted(
            set(range(self.n)) - {g[0] for g, gauge in zip(self.closed, self.gauges, strict=True) if gauge}
        )
        self.moving = [v for v in range(self.n) if self.heard[v]]
        self.done(f"{self.n} nodes, {len(self.edges)} edges, {len(self.closed)} closed component(s)")

    def _negative_cycle(self, said: Any, group: set[int]) -> None:
        """Check a closed walk of the undirected graph inside a component whose signs multiply to -1."""
        steps = [tuple(self._numbers(entries(step, "a step", 2), "a step")) for step in entries(said, "negative_cycle")]
        need(bool(steps) and all(s in group and s in self.heard[t] for s, t in steps), "not a walk along edges")
        need(math.prod(1 if self.heard[t][s] > 0 else -1 for s, t in steps) == -1, "the cycle is not negative")
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
        pieces: dict[int, list[int]] = {}
        for v in range(self.n):
            pieces.setdefault(self.piece[v], []).append(v)
        number = {v: k for k, group in enumerate(self.closed) for v in group}
        held: dict[int, list[int]] = {root: [] for root in pieces}
        for k, group in enumerate(self.closed):
            held[self.piece[group[0]]].append(k)
        weight = {(s, t): w for s, t, w in self.edges}
        odd = {self.piece[s] for (s, t), w in weight.items() if weight.get((t, s)) != w}
        negative = {self.piece[s] for (s, _), w in weight.items() if w < 0}
        expected = []
        for root, nodes in pieces.items():
            row = 0 if all(v in number for v in nodes) and len(held[root]) == 1 else 1 if len(held[root]) == 1 else 2
            some = any(self.gauges[k] is not None for k in held[root])
            flags = {
                "1.1": row == 0 and some and root not in odd,
                "1.2": row == 0 and not some and root not in odd,
                "2": row == 0 and some and root not in negative,
                "3": row == 1 and some and root not in self.conflicts,
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


def plain(x: Fraction) -> Fraction | int:
    """Return an integer as one, which is faster."""
    return x.numerator if x.denominator == 1 else x
