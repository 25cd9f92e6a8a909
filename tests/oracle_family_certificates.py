"""Whether a certificate of a small family is true, judged from its JSON by means that share nothing with the checker.

:func:`false_family_claims` forms members of the family: the mandatory graphs, each uncertain weight alone at its other
end, and vertices of the boxes at random. What the agents do follows from their kernels in rationals, rates from
semidefiniteness in rationals, constants from inverses, final states and inputs from the motion under constant members
(in rationals where they end) and under signals that switch. Witnesses are not read. A bound that some member or
instant exceeds is false.
"""

from __future__ import annotations

import hashlib
import json
import math
import random
from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import Any

import networkx as nx
import numpy as np
from oracle import Json, Matrix, Oracle, Vector, inverse, kernel, number, semidefinite, times, transposed
from scipy.linalg import expm

#: Vertices of the box of every mode, and signals that switch at random, that are tried.
VERTICES, SIGNALS = 12, 4
SLACK = 1e-9

Edge = tuple[int, int, Fraction, Fraction]


def false_family_claims(data: Json, files: Mapping[str, bytes] | None = None) -> list[str]:
    """Say what is false in an accepted certificate of a family; an empty list if nothing is."""
    oracle = FamilyOracle(data, files or {})
    claims = (oracle.graph, oracle.structures, oracle.behaviours, oracle.functions, oracle.sliding, oracle.drives)
    for claim in (*claims, oracle.finals, oracle.inputs, oracle.boxes, oracle.restricted):
        claim()
    return oracle.false


class FamilyOracle:
    """One certificate."""

    def __init__(self, data: Json, files: Mapping[str, bytes]):
        self.data, self.files, self.false = data, files, list[str]()
        self.labels: list[str] = data["problem"]["graph"]["nodes"]
        self.index = {label: v for v, label in enumerate(self.labels)}
        self.n = len(self.labels)
        self.modes = [(self.edges(mode["edges"]), "undirected" in mode) for mode in data["problem"]["graph"]["modes"]]
        self.draw = random.Random(0)

    def require(self, holds: Any, claim: str) -> None:
        if not holds:
            self.false.append(claim)

    def edges(self, said: Any) -> list[Edge]:
        """The least and the largest weight of every edge, with its sign."""
        if isinstance(said, list):
            return [(self.index[row[0]], self.index[row[1]], number(row[2]), number(row[-1])) for row in said]
        read = Oracle.column.__get__(self)
        columns = [read(said[key]) for key in ("source", "target", "least", "largest")]
        return [(int(s), int(t), low, high) for s, t, low, high in zip(*columns, strict=True)]

    # ------------------------------------------------------------------ members

    @staticmethod
    def ends(edge: Edge) -> tuple[Fraction, Fraction]:
        """The weights of the least and of the largest size."""
        _, _, low, high = edge
        return (low, high) if high > 0 else (high, low)

    def member(self, number_of_mode: int, far: set[Any]) -> Matrix:
        """The Laplacian with some weights of the largest size, the others of the least; named by :meth:`parameters`."""
        L = [[Fraction(0)] * self.n for _ in range(self.n)]
        edges, tied = self.modes[number_of_mode]
        for edge in edges:
            s, t = edge[:2]
            w = self.ends(edge)[self.parameter(edge, tied) in far]
            L[t][s] -= w
            L[t][t] += abs(w)
        return L

    @staticmethod
    def parameter(edge: Edge, tied: bool) -> Any:
        s, t, _, high = edge
        return (frozenset((s, t)) if tied else (s, t)), high > 0

    def far_sets(self, number_of_mode: int) -> Iterator[set[Any]]:
        """Which weights are of the largest size: none, each alone, and some at random; never both signs of a pair."""
        edges, tied = self.modes[number_of_mode]
        names = list(dict.fromkeys(self.parameter(e, tied) for e in edges if e[2] < e[3]))
        yield set()
        for name in names:
            yield {name}
        for share in (1, *[self.draw.random() for _ in range(VERTICES)]):
            some = [name for name in names if self.draw.random() <= share]
            self.draw.shuffle(some)
            yield {(pair, sign) for pair, sign in dict(some).items()}

    @cached_property
    def members(self) -> list[list[Matrix]]:
        """Of every mode; the mandatory graph is the first."""
        return [[self.member(k, far) for far in self.far_sets(k)] for k in range(len(self.modes))]

    @cached_property
    def pieces(self) -> list[list[int]]:
        graph = nx.Graph()
        graph.add_nodes_from(range(self.n))
        graph.add_edges_from((s, t) for edges, _ in self.modes for s, t, _, _ in edges)
        return sorted(map(sorted, nx.connected_components(graph)))

    @staticmethod
    def part(L: Matrix, nodes: list[int]) -> Matrix:
        return [[L[i][j] for j in nodes] for i in nodes]

    def common_kernel(self, nodes: list[int]) -> Matrix | None:
        """Rows that span the states at rest in all members; None if they have not all the same."""
        own = [self.part(L, nodes) for some in self.members for L in some]
        basis = kernel(own[0])
        for L in own:
            if len(kernel(L)) != len(basis) or any(x for b in basis for (x,) in times(L, [[y] for y in b])):
                return None
        return basis

    # ------------------------------------------------------------------ graph, structure, behaviour

    @property
    def sha256(self) -> str:
        lines = [json.dumps([x], ensure_ascii=False) for x in sorted(self.labels)]
        for k, (edges, tied) in enumerate(self.modes):
            lines += ["{}"] * (k > 0)
            lines += ['{"undirected": true}'] * (tied and any(low < high for _, _, low, high in edges))
            rows = [(self.labels[s], self.labels[t], low, high) for s, t, low, high in edges]
            for s, t, low, high in sorted(rows, key=lambda row: (*row[:2], row[3] > 0)):
                lines.append(json.dumps([s, t, *dict.fromkeys([str(low), str(high)])], ensure_ascii=False))
        text = "".join(f"{line}\n" for line in lines)
        return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()

    def graph(self) -> None:
        for edges, tied in self.modes:
            for s, t, low, high in edges:
                self.require(s != t and low <= high and (low or high) and low * high >= 0, "an edge")
            if tied:
                both = {(s, t, high > 0): (low, high) for s, t, low, high in edges}
                self.require(all(both.get((t, s, x)) == ends for (s, t, x), ends in both.items()), "undirected edges")
        self.require(self.sha256 == self.data["problem"]["graph"]["sha256"], "the hash")

    def structures(self) -> None:
        for (edges, _), said in zip(self.modes, self.data["structure"], strict=True):
            weights = [(s, t, str(self.ends((s, t, low, high))[0])) for s, t, low, high in edges]
            rows = [[self.labels[s], self.labels[t], w] for s, t, w in weights if Fraction(w)]
            one = Oracle(
                {"problem": {"graph": {"nodes": self.labels, "modes": [{"edges": rows}]}}, "structure": [said]}, {}
            )
            one.structure()
            pieces, closed = nx.number_weakly_connected_components(one.digraph), one.closed
            row = 0 if len(closed) == 1 and len(closed[0]) == self.n else 1 if len(closed) == 1 else 2
            kind = "disconnected" if pieces > 1 else ("strong", "quasi-strong", "weak")[row]
            self.require(said["connectivity"] == kind, "connectivity")
            self.false += one.false

    def closed_components(self, number_of_mode: int, nodes: list[int]) -> int:
        L, graph = self.members[number_of_mode][0], nx.DiGraph()
        graph.add_nodes_from(nodes)
        graph.add_edges_from((t, s) for t in nodes for s in nodes if s != t and L[t][s])
        return sum(1 for _ in nx.attracting_components(graph))

    def behaviour(self, nodes: list[int]) -> str:
        basis = self.common_kernel(nodes)
        if basis is None:
            return "depends on the signal"
        if not basis:
            return "stability"
        if len(basis) == 1 and len(set(map(abs, basis[0]))) == 1:
            return "bipartite consensus"
        single = all(self.closed_components(k, nodes) == 1 for k in range(len(self.modes)))
        return "interval bipartite consensus" if single else "bipartite containment"

    def behaviours(self) -> None:
        told = [{"theorem": "common kernel", "behaviour": self.behaviour(nodes)} for nodes in self.pieces]
        if len(told) == 1:
            self.require(self.data.get("claim") == told[0] and "components" not in self.data, "claim")
        else:
            names = [[self.labels[v] for v in nodes] for nodes in self.pieces]
            found = [{"nodes": x, "claim": claim} for x, claim in zip(names, told, strict=True)]
            self.require("claim" not in self.data and self.data["components"] == found, "claims of components")
        self.require(self.data["verdict"] == "certified", "verdict")
        empty = {"paper", "rates", "overshoot", "influence"}
        self.require(not empty & set(self.data), "parts that families do not have")
        self.require(self.data["problem"]["signal"] == "any", "signal")

    # ------------------------------------------------------------------ Lyapunov functions

    def functions(self) -> None:
        steps = {x["of"]: x for x in self.data["proof"] if x["kind"] == "family-rate"}
        for number_of, said in enumerate(self.data["decays"]):
            if said["class"] == "rows":
                self.rows(said)
                continue
            if said["class"] == "squares":
                self.squares(said)
                continue
            nodes = self.pieces[said["component"]]
            basis = self.common_kernel(nodes)
            if basis is None:
                self.require(False, "a function without a common kernel")
                continue
            free = [self.index[label] for label in said["nodes"]]
            pivots = [v for v in nodes if v not in free]
            self.require(len(pivots) == len(basis) and free == sorted(free), "nodes of a function")
            P = self.symmetric(said["lower_triangle"])
            self.require(self.definite(P), "P is not definite")
            to_zero = self.lift(basis, nodes, free, pivots)
            constants = [number(x) for x in said["inputs"].values()]
            self.require(list(said["inputs"]) == [self.labels[v] for v in nodes], "inputs by agent")
            rates = [number(steps[f"decays[{number_of}].modes[{k}]"]["numbers"]["b"]) for k in range(len(self.modes))]
            self.require(min(rates) == number(said["rate"]), "the least rate")
            G = inverse(P)
            for some, rate in zip(self.members, rates, strict=True):
                for L in some:
                    A = times(
                        to_zero, [[self.part(L, nodes)[i][nodes.index(v)] for v in free] for i in range(len(nodes))]
                    )
                    PA = times(P, A)
                    S = [[PA[i][j] + PA[j][i] - rate * P[i][j] for j in range(len(P))] for i in range(len(P))]
                    self.require(semidefinite(S), "a rate")
                    for v, c in zip(nodes, constants, strict=True):
                        y = [L[v][u] for u in free]
                        self.require(self.form(G, y) <= c, "the constant of an input")
                    for mean in said["means"]:
                        q = [(self.index[label], number(w)) for label, w in mean["weights"].items()]
                        y = [sum((w * L[v][u] for v, w in q), Fraction(0)) for u in free]
                        self.require(self.form(G, y) <= number(mean["constant"]), "the constant of a mean")
            self.require(list(said["coordinates"]) == said["nodes"], "coordinates by agent")
            for i, c in enumerate(said["coordinates"].values()):
                self.require(G[i][i] <= number(c), "the constant of a coordinate")

    def rows(self, said: Json) -> None:
        """A function of rows, by the motion under single members from random states: ``W^2 <= e^(-rate s) W(0)^2``."""
        nodes = self.pieces[said["component"]]
        basis = self.common_kernel(nodes)
        if basis is None:
            self.require(False, "a function without a common kernel")
            return
        first = [c[0] for c in self.balanced_first(nodes)]
        free = [v for v in nodes if v not in first]
        C = np.array(self.lift(basis, nodes, free, first), dtype=float).reshape(len(free), len(nodes))
        led = [self.index[label] for part in said["parts"] for label in part["nodes"]]
        followers = [v for v in free if v not in led]
        d = [float(number(x)) for x in said["vector"]]
        self.require(len(d) == len(followers) and min(d) > 0 and len(set(led)) == len(led), "agents of a function")
        self.require(all(part["function"]["component"] == said["component"] for part in said["parts"]), "a part")

        def value(x: np.ndarray) -> float:
            xi = dict(zip(free, C @ x, strict=True))
            squares = [(xi[v] / s) ** 2 for v, s in zip(followers, d, strict=True)]
            for part in said["parts"]:
                z = np.array([xi[self.index[label]] for label in part["function"]["nodes"]])
                P = np.array(self.symmetric(part["function"]["lower_triangle"]), dtype=float)
                squares.append(float(z @ P @ z) / float(number(part["times"])) ** 2)
            return max(squares)

        rate, draw = float(number(said["rate"])), np.random.default_rng(0)
        for some in self.members:
            for L in some:
                M = np.array(self.part(L, nodes), dtype=float)
                size = max(float(abs(M).max()), 1e-300)
                for _ in range(6):
                    x = draw.choice([-1.0, 1.0], len(nodes)) * draw.choice([1.0, draw.random()], len(nodes))
                    for s in (1e-3 / size, 0.1 / size, 1 / size):
                        later = value(expm(-M * s) @ x)
                        self.require(later <= np.exp(-rate * s) * value(x) * (1 + 1e-7) + 1e-12, "a rate of rows")

    def squares(self, said: Json) -> None:
        """A weighted sum of squares, by the matrices of members."""
        nodes, p = self.pieces[said["component"]], [number(x) for x in said["vector"]]
        self.require(self.common_kernel(nodes) == [], "a sum of squares of agents that do not end at 0")
        self.require(len(p) == len(nodes) and min(p) > 0, "weights of a function")
        if len(p) != len(nodes):
            return
        rate, n = number(said["rate"]), len(p)
        for some in self.members:
            for L in (self.part(one, nodes) for one in some):
                S = [
                    [p[i] * L[i][j] + p[j] * L[j][i] - (rate * p[i] if i == j else 0) for j in range(n)]
                    for i in range(n)
                ]
                self.require(semidefinite(S), "a rate of squares")

    def balanced_first(self, nodes: list[int]) -> list[list[int]]:
        said = self.data["structure"][0]["closed_components"]
        groups = [[self.index[label] for label in c["nodes"]] for c in said if c["balanced"]]
        return [group for group in groups if group[0] in nodes]

    def lift(self, basis: Matrix, nodes: list[int], free: list[int], pivots: list[int]) -> Matrix:
        """The matrix ``C``: ``xi = x_free - B_free B_piv^-1 x_piv``, by rows, columns numbered as the nodes."""
        place = {v: i for i, v in enumerate(nodes)}
        C = [[Fraction(int(v == u)) for u in nodes] for v in free]
        if pivots:
            upper = inverse([[b[place[p]] for b in basis] for p in pivots])
            shares = times([[b[place[v]] for b in basis] for v in free], upper)
            for row, share in zip(C, shares, strict=True):
                for p, x in zip(pivots, share, strict=True):
                    row[place[p]] -= x
        return C

    @staticmethod
    def form(G: Matrix, y: Vector) -> Fraction:
        return sum((a * g * b for a, row in zip(y, G, strict=True) for g, b in zip(row, y, strict=True)), Fraction(0))

    @staticmethod
    def symmetric(lower: list[list[str]]) -> Matrix:
        return [[number(lower[max(i, j)][min(i, j)]) for j in range(len(lower))] for i in range(len(lower))]

    @staticmethod
    def definite(P: Matrix) -> bool:
        return semidefinite(P) and not kernel(P)

    # ------------------------------------------------------------------ sliding variables

    @cached_property
    def gains(self) -> dict[str, Fraction]:
        said = self.data["problem"]["gain"]
        return {key: number(x) for key, x in said.items() if key not in ("kind", "disturbance")}

    @cached_property
    def sigma0(self) -> Vector:
        said = self.data["problem"].get("sliding_variable")
        return [Fraction(0)] * self.n if said is None else [number(said[label]) for label in self.labels]

    reach, integral = Oracle.reach, staticmethod(Oracle.integral)

    def sliding(self) -> None:
        """Reaching times, and the sliding part of the input: no graph enters, so that it is as for one graph."""
        g, said = self.gains, self.data["problem"].get("sliding_variable")
        slides = self.data["problem"]["gain"]["kind"] == "sliding-mode"
        self.require(slides == ("mu1" in g) == (said is not None), "a sliding variable")
        self.require(min(x for key, x in g.items() if key != "delta") > 0, "a parameter")
        Oracle.reaching(self)  # type: ignore[arg-type]
        own = self.data["input"].get("sliding")
        self.require((own is not None) == slides, "a sliding part")
        if own is None:
            return
        self.require(0 <= g["delta"] < g["mu1"] and said is not None and list(said) == self.labels, "mu1 and delta")
        self.require(own["bounded"] is (g["mu3"] * g["kappa"] >= 1), "sliding: bounded")
        push = g["mu2"] + g["mu3"] * g["kappa"] / g["T_r"]
        if "agents" in own:
            self.require(own["bounded"] or not any(self.sigma0), "sliding: not bounded")
            for s, x in zip(self.sigma0, map(number, own["agents"].values()), strict=True):
                self.require(x >= g["mu1"] + push * abs(s), "sliding: agents")

    def drives(self) -> None:
        """How sliding variables drive a function: ``C L sigma`` of members, and corners of what is stated."""
        told = self.data.get("drives")
        self.require((told is not None) == any(self.sigma0), "drives")
        for said, text in zip(self.data["decays"], told or [], strict=False):
            nodes = self.pieces[said["component"]]
            basis, c = self.common_kernel(nodes), number(text)
            if basis is None:
                continue
            first = [group[0] for group in self.balanced_first(nodes)]
            free = [v for v in nodes if v not in first]
            C = self.lift(basis, nodes, free, first)
            for some in self.members:
                sizes = [
                    max(
                        sum((abs(x) * abs(self.sigma0[j]) for j, x in enumerate(L[v]) if j in nodes), Fraction(0))
                        for L in some
                    )
                    for v in nodes
                ]
                own = [self.sigma0[v] for v in nodes]
                vectors = [[y for (y,) in times(self.part(L, nodes), [[x] for x in own])] for L in some]
                vectors += [[p * self.draw.choice((-1, 1)) for p in sizes] for _ in range(8)]
                for x in vectors:
                    xi = dict(zip(free, [y for (y,) in times(C, [[z] for z in x])], strict=True))
                    self.require(self.size(said, xi) <= c**2, "a drive")

    def size(self, said: Json, xi: dict[int, Fraction]) -> Fraction:
        """``V`` of coordinates by node."""
        if said["class"] == "squares":
            return sum((number(p) * x**2 for p, x in zip(said["vector"], xi.values(), strict=True)), Fraction(0))
        if said["class"] != "rows":
            z = [xi[self.index[label]] for label in said["nodes"]]
            return self.form(self.symmetric(said["lower_triangle"]), z)
        led = [self.index[label] for part in said["parts"] for label in part["nodes"]]
        followers = [v for v in xi if v not in led]
        squares = [(xi[v] / number(d)) ** 2 for v, d in zip(followers, said["vector"], strict=True)]
        squares += [self.size(part["function"], xi) / number(part["times"]) ** 2 for part in said["parts"]]
        return max(squares)

    # ------------------------------------------------------------------ where agents end, and their inputs

    @cached_property
    def start(self) -> Vector | None:
        said = self.data["problem"].get("initial_state")
        return None if said is None else [number(said[label]) for label in self.labels]

    @cached_property
    def gain(self) -> tuple[Fraction, Fraction, Fraction]:
        g = self.gains
        return g["T"] if "T" in g else g["T_r"] + g["T_s"], g["rho1"], g["rho2"] * g["kappa"]

    def depends(self, nodes: list[int]) -> bool:
        return self.common_kernel(nodes) is None

    def finals(self) -> None:
        said = self.data.get("final_state")
        self.require((said is None) == (self.start is None), "final states without a state, or the other way round")
        if said is None or self.start is None:
            return
        self.require(list(said) == self.labels, "final states by agent")
        for nodes in self.pieces:
            ends = [said[self.labels[v]] for v in nodes]
            if self.depends(nodes):
                self.require(not any(x is not None for x in ends), "a final state that depends on the signal")
                continue
            self.require(None not in ends, "no final state")
            for some in self.members:
                for L in some:
                    end = self.limit(self.part(L, nodes), [self.start[v] - self.sigma0[v] for v in nodes])
                    self.require(all(Oracle.holds(x, y) for x, y in zip(ends, end, strict=True)), "a final state")
            for x in self.switched(nodes):
                for entry, y in zip(ends, x, strict=True):
                    mid = number(entry["mid"]) if isinstance(entry, dict) else number(entry)
                    radius = number(entry["radius"]) if isinstance(entry, dict) else Fraction(0)
                    size = max(1.0, *(abs(float(z)) for z in self.start))
                    slack = (1e-4 if any(self.sigma0) else 1e-7) * size
                    self.require(abs(y - float(mid)) <= float(radius) + slack, "a final state by switches")

    @staticmethod
    def limit(L: Matrix, x: Vector) -> Vector:
        """Where ``X' = -L X`` ends."""
        right, left = kernel(L), kernel(transposed(L))
        if not right:
            return [Fraction(0)] * len(x)
        within = times(inverse(times(left, transposed(right))), times(left, [[y] for y in x]))
        return [y for (y,) in times(transposed(right), within)]

    def switched(self, nodes: list[int]) -> Iterator[np.ndarray]:
        """Where the agents end under signals that switch some times, and then keep one member."""
        assert self.start is not None
        flat = [(k, L) for k, some in enumerate(self.members) for L in some]
        size = max(float(x) for _, L in flat for row in L for x in row)
        for _ in range(SIGNALS if size else 0):
            x = np.array([float(self.start[v] - self.sigma0[v]) for v in nodes])
            if any(self.sigma0):
                x = self.driven(
                    x, nodes, [np.array(self.part(self.draw.choice(flat)[1], nodes), dtype=float) for _ in range(5)]
                )
            for _ in range(5):
                L = np.array(self.part(self.draw.choice(flat)[1], nodes), dtype=float)
                x = expm(-L * self.draw.choice((0.1, 1, 3)) / size) @ x
            last = self.part(self.draw.choice(flat)[1], nodes)
            yield np.array([float(y) for y in self.limit(last, [Fraction(float(y)) for y in x])])

    def driven(self, y: np.ndarray, nodes: list[int], members: list[np.ndarray]) -> np.ndarray:
        """``x - sigma`` at ``T_r``, one member after the other, the disturbance with the sign or against, in steps."""
        T, rho1, pole = map(float, self.gain)
        T_r, mu2, power = map(float, self.reach)
        push = float(self.gains["mu1"]) - float(self.gains["delta"]) * self.draw.choice((-1, 0, 1))
        sigma, steps = np.array([float(self.sigma0[v]) for v in nodes]), 400
        for k in range(steps):
            a, b = ((1 - (1 - j / steps) ** 2) * T_r for j in (k, k + 1))
            psi = np.exp(-mu2 * (b - a)) * ((T_r - b) / (T_r - a)) ** power
            later = np.sign(sigma) * np.maximum(psi * (np.abs(sigma) - push * (b - a)), 0)
            L, s = members[k * len(members) // steps], rho1 * (b - a) + pole * np.log((T - a) / (T - b))
            y = expm(-L * s) @ (y + (sigma + later) / 2) - (sigma + later) / 2
            sigma = later
        return y

    def inputs(self) -> None:
        said, g = self.data["input"], self.gains
        T, rho1, pole = self.gain
        if "bounded" not in said:
            self.require("peaks" not in said, "peaks of an input that is not bounded")
            return
        unknown = self.start is None or ("mu1" in g and g["mu3"] * g["kappa"] < 1 and any(self.sigma0))
        self.require(said["bounded"] is True and ("peaks" not in said) == unknown, "bounded")
        for nodes in self.pieces:
            self.require(not self.depends(nodes), "an input that depends on the signal is bounded")
            for some in self.members:
                for L in some:
                    values = np.linalg.eigvals(np.array(self.part(L, nodes), dtype=float))
                    least = min((z.real for z in values if abs(z) > 1e-6 * max(abs(values))), default=np.inf)
                    self.require(least * float(pole) >= 1 - 1e-6, "an eigenvalue that makes the input unbounded")
        if "peaks" not in said or self.start is None:
            return
        self.require(list(said["peaks"]) == self.labels, "peaks by agent")
        bounds = [number(x) for x in said["peaks"].values()]
        first = rho1 + pole / T
        for some in self.members:
            for L in some:
                for v, (row, b) in enumerate(zip(L, bounds, strict=True)):
                    u = -first * sum((a * x for a, x in zip(row, self.start, strict=True)), Fraction(0))
                    if s := self.sigma0[v]:
                        u -= g["mu1"] * (1 if s > 0 else -1) + (g["mu2"] + g["mu3"] * g["kappa"] / g["T_r"]) * s
                    self.require(abs(u) + (0 if s else g.get("delta", 0)) <= b, "a peak at the beginning")
                if not any(self.sigma0):
                    self.later(np.array(L, dtype=float), np.array(bounds, dtype=float))

    def later(self, L: np.ndarray, bounds: np.ndarray) -> None:
        T, rho1, pole = map(float, self.gain)
        for z in (0.01, 0.1, 0.5, 1.0, 2.0):
            s = rho1 * T * (1 - np.exp(-z)) + pole * z
            if s * abs(L).max() < 300:
                u = (rho1 + pole / T * np.exp(z)) * L @ expm(-L * s) @ np.array([float(x) for x in self.start or ()])
                self.require((abs(u) <= bounds * (1 + SLACK) + 1e-9 * bounds.max(initial=0)).all(), "a later peak")

    # ------------------------------------------------------------------ boxes

    def boxes(self) -> None:
        """Boxes: no signal that is played leaves the distance above its bound; greedy ones push outwards."""
        for said in self.data.get("boxes", ()):
            nodes = self.pieces[said["component"]]
            self.require(self.depends(nodes) and self.start is not None and not any(self.sigma0), "a box")
            if self.start is None or not isinstance(said.get("vector", []), list):
                continue
            if "vector" not in said:
                self.stays(nodes, said)
                continue
            own = [self.index[label] for label in said["nodes"]]
            self.require(own == sorted(set(own)) and set(own) <= set(nodes), "followers of a box")
            low, high, d = (np.array([float(number(x)) for x in said[key]]) for key in ("lower", "upper", "vector"))
            rate, places = float(number(said["rate"])), [nodes.index(v) for v in own]
            members = [np.array(self.part(L, nodes), dtype=float) for some in self.members for L in some]
            largest = max(float(np.abs(L).max()) for L in members) or 1.0
            begin = np.array([float(self.start[v]) for v in nodes])
            size = max(1.0, float(np.abs(begin).max()))
            self.require(rate > 0 and (d > 0).all(), "a box without a rate")

            def rho(x: np.ndarray) -> float:
                f = x[places]  # noqa: B023
                return float(max(0.0, ((f - high) / d).max(), ((low - f) / d).max()))  # noqa: B023

            first = rho(begin)
            for run in range(2 * SIGNALS):
                x, s = begin, 0.0
                target = self.draw.choice(places)
                for _ in range(60):
                    h = self.draw.choice((0.1, 1.0, 10.0)) / largest
                    if run % 2:
                        L = self.draw.choice(members)
                    else:  # push one follower up, or down
                        side = 1 if run % 4 else -1
                        L = max(members, key=lambda L: side * float((expm(-L * h) @ x)[target]))
                    x, s = expm(-L * h) @ x, s + h
                    bound = first * np.exp(-rate * s / 2) * (1 + SLACK) + 1e-9 * size / d.min()
                    self.require(rho(x) <= bound, "an agent outside of a box")

    def stays(self, nodes: list[int], said: Json) -> None:
        """Ends between which agents stay: no signal that is played leaves them, the greedy ones push one agent out."""
        low, high = (np.array([float(number(x)) for x in said[key]]) for key in ("lower", "upper"))
        self.require(len(low) == len(high) == len(nodes), "an interval for each agent")
        members = [np.array(self.part(L, nodes), dtype=float) for some in self.members for L in some]
        largest = max(float(np.abs(L).max()) for L in members) or 1.0
        flows = [[expm(-L * h / largest) for L in members] for h in (0.1, 1.0, 10.0)]
        begin = np.array([float(self.start[v]) for v in nodes])  # type: ignore[index]
        slack = 1e-9 * max(1.0, float(np.abs(begin).max()))
        for run in range(4 * SIGNALS):
            x, target, side = begin, self.draw.randrange(len(nodes)), self.draw.choice((-1, 1))
            for _ in range(40):
                self.require(bool((x >= low - slack).all() and (x <= high + slack).all()), "an agent out of its ends")
                flow = self.draw.choice(flows)
                if run % 2:
                    x = self.draw.choice(flow) @ x
                else:
                    x = max((F @ x for F in flow), key=lambda y: side * float(y[target]))

    # ------------------------------------------------------------------ restricted signals

    def restricted(self) -> None:
        """Rates of restricted signals, by members in rationals: the forms, their ratio, and what follows."""
        for place, said in enumerate(self.data.get("restricted", ())):
            nodes = self.pieces[said["component"]]
            if said["claim"] == "shares":
                self.shares(nodes, said, f"restricted[{place}]")
                continue
            if said["claim"] == "final value":
                self.final_values(nodes, said)
                continue
            if said["claim"] != "rate":
                (self.last_mode if said["claim"] == "last mode" else self.windows)(nodes, said)
                continue
            basis = self.common_kernel(nodes)
            if basis is None or len(nodes) == 1:
                self.require(False, "a rate without a common kernel")
                continue
            rate, ratio, signals = number(said["rate"]), number(said["ratio"]), said["signals"]
            self.require(said.get("bounded", False) == (rate * self.gain[2] >= 2), "a bounded input")
            self.require(said.get("bounded", True) is True, "bounded")
            dwell = None if signals == "constant" else number(signals["dwell"])
            self.require(dwell is None or (dwell > 0 and signals["clock"] in ("t", "s")), "a dwell time")
            if "forms" not in said:
                own = [number(V["rate"]) for V in self.data["decays"] if self.same_part(V, said)]
                self.require(ratio == 1 and rate <= max(own), "a rate of restricted signals by functions")
                continue
            forms = [self.symmetric(lower) for lower in said["forms"]]
            self.require(ratio >= 1 and (dwell is not None or ratio == 1), "a ratio")
            if dwell is not None:
                for P in forms:
                    for Q in forms:
                        S = [[ratio * x - y for x, y in zip(*rows, strict=True)] for rows in zip(P, Q, strict=True)]
                        self.require(semidefinite(S), "the ratio of forms")
                if signals["clock"] == "s":
                    rate += Fraction(math.log(ratio) * (1 - SLACK)) / dwell
            self.forms(nodes, basis, forms, rate)

    @staticmethod
    def same_part(one: Json, other: Json) -> bool:
        return bool(one["component"] == other["component"])

    def forms(self, nodes: list[int], basis: Matrix, forms: list[Matrix], rate: Fraction) -> None:
        """Forms of each mode that all decay at a rate, in the coordinates of the first nodes of the leading groups."""
        pivots = [c[0] for c in self.balanced_first(nodes)]
        free = [v for v in nodes if v not in pivots]
        to_zero = self.lift(basis, nodes, free, pivots)
        for some, P in zip(self.members, forms, strict=True):
            self.require(len(P) == len(free) and self.definite(P), "P is not definite")
            for L in some:
                own = self.part(L, nodes)
                A = times(to_zero, [[row[nodes.index(v)] for v in free] for row in own])
                PA = times(P, A)
                S = [[PA[i][j] + PA[j][i] - rate * P[i][j] for j in range(len(P))] for i in range(len(P))]
                self.require(semidefinite(S), "a rate of restricted signals")

    def final_values(self, nodes: list[int], said: Json) -> None:
        """The consensus values of members, in rationals; of few uncertain weights all vertices."""
        self.require(said["signals"] == "constant" and any(said["modes"]), "a final value")
        self.require(self.start is not None and not any(self.sigma0), "a final value without a state")
        for k, told in enumerate(said["modes"]):
            if told is None or self.start is None:
                continue
            edges, tied = self.modes[k]
            names = {self.parameter(e, tied) for e in edges if e[2] < e[3] and e[0] in nodes}
            few = len(names) <= 6
            sets = [{x for x in names if self.draw.random() < 0.5} for _ in range(VERTICES)]
            if few:
                order = sorted(names, key=str)
                sets = [{x for i, x in enumerate(order) if far >> i & 1} for far in range(2 ** len(order))]
            values = []
            for L in (self.part(self.member(k, far), nodes) for far in sets):
                camps, left = kernel(L), kernel(transposed(L))
                if len(camps) != 1 or len(set(map(abs, camps[0]))) != 1:
                    self.require(False, "a final value where there is no consensus")
                    return
                signs = [x / camps[0][0] for x in camps[0]]
                weight = sum((p * g for p, g in zip(left[0], signs, strict=True)), Fraction(0))
                pairs = zip(left[0], nodes, strict=True)
                values.append(sum((p * self.start[v] for p, v in pairs), Fraction(0)) / weight)
            low, high, within = (number(told[key]) for key in ("lower", "upper", "within"))
            self.require(low <= min(values) and max(values) <= high, "a final value is outside")
            near = min(values) <= low + within and max(values) >= high - within
            self.require(near or not few, "no member is so near to an end")

    def last_mode(self, nodes: list[int], said: Json) -> None:
        """What each mode does by itself, by kernels of its members, and where agents are under signals that switch."""
        self.require(self.common_kernel(nodes) is None, "a last mode where every signal does the same")
        constant = said["signals"] == "constant"
        self.require(constant or said["signals"]["clock"] == "t", "infinitely many switches")
        self.require(constant or number(said["signals"]["dwell"]) > 0, "a dwell time")
        for k, told in enumerate(said["modes"]):
            kernels = [kernel(self.part(L, nodes)) for L in self.members[k]]
            first = kernels[0]
            same = all(
                len(own) == len(first) and not any(x for b in first for (x,) in times(L, [[y] for y in b]))
                for own, L in zip(kernels, (self.part(L, nodes) for L in self.members[k]), strict=True)
            )
            uncertain = any(s in nodes and low < high for s, _, low, high in self.modes[k][0])
            single = self.closed_components(k, nodes) == 1
            camps = len(first) == 1 and len(set(map(abs, first[0]))) == 1
            found = "stability" if not first else "bipartite consensus" if camps and single else None
            if not same or (found is None and uncertain):
                found = None
            elif found is None:
                found = "interval bipartite consensus" if single else "bipartite containment"
            self.require(told == found, "a behaviour of the last mode")
        for excess in self.ends_of(nodes, said, self.switched):
            self.require(
                excess <= 1e-7 * max(1.0, *(abs(float(z)) for z in self.start or ())), "an end of the last mode"
            )

    def ends_of(self, nodes: list[int], said: Json, runs: Any) -> Iterator[float]:
        """How far agents end outside of what is said, under signals that are played."""
        ends = said.get("final_state")
        self.require((ends is None) == (self.start is None), "final states of restricted signals")
        if ends is None:
            return
        self.require(list(ends) == [self.labels[v] for v in nodes], "final states by agent")
        for x in runs(nodes):
            for entry, y in zip(ends.values(), x, strict=True):
                mid = number(entry["mid"]) if isinstance(entry, dict) else number(entry)
                radius = number(entry["radius"]) if isinstance(entry, dict) else Fraction(0)
                yield abs(y - float(mid)) - float(radius)

    def windows(self, nodes: list[int], said: Json) -> None:
        """Joint windows: the mean of all modes by its kernel, the contraction in floats, and modes played in turn."""
        self.require(self.common_kernel(nodes) is None, "windows where every signal does the same")
        window, on, eta = (number(x) for x in (said["signals"]["window"], said["signals"]["on"], said["eta"]))
        self.require(0 < on <= window, "a window")
        m, mandatory = len(self.modes), [self.part(some[0], nodes) for some in self.members]
        mean = [[sum((L[i][j] for L in mandatory), Fraction(0)) for j in range(len(nodes))] for i in range(len(nodes))]
        for i, row in enumerate(mean):  # edges of both signs on one pair cancel: they are told by the sizes
            row[i] = sum((L[i][i] for L in mandatory), Fraction(0))
        basis = kernel(mean)
        camps = len(basis) == 1 and len(set(map(abs, basis[0]))) == 1
        every = [self.part(L, nodes) for some in self.members for L in some]
        fit = camps and not any(x for L in every for (x,) in times(L, [[y] for y in basis[0]]))
        self.require(fit or not basis, "what windows do")
        self.require(said["behaviour"] == ("bipartite consensus" if fit else "stability"), "a behaviour of windows")
        largest = max(float(L[i][i]) for L in every for i in range(len(nodes)))
        edges = [e for some, _ in self.modes for e in some if e[0] in nodes]
        least = min(abs(float(self.ends(e)[0])) for e in edges if self.ends(e)[0])
        bound = np.exp(-largest * float(window)) * min(1.0, float(on) * least)
        self.require(eta > 0 and float(eta) <= bound * (1 + SLACK), "the contraction of windows")

        def in_turn(own: list[int]) -> Iterator[np.ndarray]:
            floats = [[np.array(self.part(L, own), dtype=float) for L in some] for some in self.members]
            for _ in range(SIGNALS):
                x = np.array([float(self.start[v]) for v in own])  # type: ignore[index]
                for _ in range(300):
                    for k in self.draw.sample(range(m), m):
                        x = expm(-self.draw.choice(floats[k]) * self.draw.choice((0.5, 2)) / largest) @ x
                yield x

        for excess in self.ends_of(nodes, said, in_turn):
            self.require(excess <= 1e-3 * max(1.0, *(abs(float(z)) for z in self.start or ())), "an end of windows")

    def shares(self, nodes: list[int], said: Json, of: str) -> None:
        """Shares of the clock: one form, the rates of its modes by members in rationals, and their mean."""
        shares = [number(x) for x in said["signals"]["shares"]]
        self.require(len(shares) == len(self.modes) and min(shares) >= 0 and sum(shares) == 1, "shares")
        steps = {x["of"]: x for x in self.data["proof"] if x["kind"] == "family-rate"}
        rates = [number(steps[f"{of}.modes[{k}]"]["numbers"]["b"]) for k in range(len(shares))]
        mean = sum((s * b for s, b in zip(shares, rates, strict=True)), Fraction(0))
        rate, free = number(said["rate"]), [self.index[label] for label in said["nodes"]]
        self.require(rate <= mean and free == sorted(set(free)) and set(free) <= set(nodes), "a mean rate")
        pivots, P, basis = [v for v in nodes if v not in free], self.symmetric(said["form"]), list[Vector]()
        every = [self.part(L, nodes) for some in self.members for L in some]
        if pivots:
            stacked = [row for L in every for row in L]
            near = [b for b in kernel(stacked) if all(abs(x) == abs(b[0]) for x in b)]
            self.require(len(pivots) == 1 and len(near) == 1, "camps of all modes")
            basis = near[:1]
        if len(pivots) != len(basis):
            return
        told = None if rate <= 0 else "bipartite consensus" if basis else "stability"
        self.require(said.get("behaviour") == told, "a behaviour by shares")
        self.require(len(P) == len(free) and self.definite(P), "P is not definite")
        to_zero = self.lift(basis, nodes, free, pivots)
        for some, b in zip(self.members, rates, strict=True):
            for L in some:
                own = self.part(L, nodes)
                PA = times(P, times(to_zero, [[row[nodes.index(v)] for v in free] for row in own]))
                S = [[PA[i][j] + PA[j][i] - b * P[i][j] for j in range(len(P))] for i in range(len(P))]
                self.require(semidefinite(S), "a rate by shares")
        if "final_state" in said:
            self.ends_by_shares(nodes, said, every, basis)

    def ends_by_shares(self, nodes: list[int], said: Json, every: list[Matrix], basis: Matrix) -> None:
        """Where agents end by shares: the value of what all members keep, in rationals, and modes played in turn."""
        known = self.start is not None and "behaviour" in said and not any(self.sigma0)
        self.require(known and list(said["final_state"]) == [self.labels[v] for v in nodes], "ends by shares")
        if not known or self.start is None:
            return
        kept = kernel([row for L in every for row in transposed(L)])
        if basis and kept:
            first, camps = [self.start[v] for v in nodes], basis[0]
            values = [sum((p * y for p, y in zip(kept[0], ys, strict=True)), Fraction(0)) for ys in (first, camps)]
            ends = zip(said["final_state"].values(), camps, strict=True)
            self.require(len(kept) == 1, "several means that are kept where all agents agree")
            self.require(all(Oracle.holds(x, g * values[0] / values[1]) for x, g in ends), "an end by a kept mean")
        largest = max(float(L[i][i]) for L in every for i in range(len(nodes)))
        pace = 8 / float(number(said["rate"]))
        shares = [float(number(x)) for x in said["signals"]["shares"]]
        for _ in range(SIGNALS):
            x = np.array([float(self.start[v]) for v in nodes])
            for step in [1 / largest] * 20 + [pace] * 8:
                for k in self.draw.sample(range(len(shares)), len(shares)):
                    L = np.array(self.part(self.draw.choice(self.members[k]), nodes), dtype=float)
                    x = expm(-L * shares[k] * step) @ x
            for entry, y in zip(said["final_state"].values(), x, strict=True):
                mid = number(entry["mid"]) if isinstance(entry, dict) else number(entry)
                radius = number(entry["radius"]) if isinstance(entry, dict) else Fraction(0)
                size = max(1.0, *(abs(float(z)) for z in self.start))
                self.require(abs(y - float(mid)) <= float(radius) + 1e-6 * size, "an end by shares, played")
