"""A certificate under the nominal protocol proved anew, step by step, from its JSON alone and by other means.

:mod:`oracle` asks whether claims are true and reads no witness; :class:`Recheck` follows the proof that is written.
"""

from __future__ import annotations

import hashlib
import json
import re
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import Any

import flint
import numpy as np
from balls import ball

Rows = list[list[Fraction]]


def number(text: object) -> Fraction:
    assert isinstance(text, str) and re.fullmatch(r"-?[0-9]+(/[1-9][0-9]*)?", text), text
    return Fraction(text)


def positive_definite(S: Rows) -> bool:
    """A symmetric matrix is positive definite iff the signs of its characteristic polynomial strictly alternate."""
    n = len(S)
    assert all(S[i][j] == S[j][i] for i in range(n) for j in range(n))
    scale = lcm(*(x.denominator for row in S for x in row))
    integers = [[x.numerator * (scale // x.denominator) for x in row] for row in S]
    coefficients = flint.fmpz_mat(n, n, [x for row in integers for x in row]).charpoly().coeffs() if n else [1]
    return all(c * (-1) ** (n - k) > 0 for k, c in enumerate(coefficients))


def product(A: Rows, B: Rows) -> Rows:
    columns = list(zip(*B, strict=True))
    return [[sum((a * b for a, b in zip(row, c, strict=True) if a and b), Fraction(0)) for c in columns] for row in A]


def transposed(A: Rows) -> Rows:
    return [list(column) for column in zip(*A, strict=True)]


def part(A: Rows, rows: list[int], columns: list[int]) -> Rows:
    return [[A[i][j] for j in columns] for i in rows]


def diagonal(values: list[Fraction]) -> Rows:
    return [[v if i == j else Fraction(0) for j in range(len(values))] for i, v in enumerate(values)]


def combined(A: Rows, B: Rows, factor: Fraction) -> Rows:
    return [[a + factor * b for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]


def lyapunov(weights: list[Fraction], A: Rows) -> Rows:
    """``Omega A + A' Omega``."""
    WA = [[w * a for a in row] for w, row in zip(weights, A, strict=True)]
    return combined(WA, transposed(WA), Fraction(1))


def exact_matrix(A: Rows) -> flint.fmpq_mat:
    return flint.fmpq_mat(
        len(A), len(A[0]) if A else 0, [flint.fmpq(x.numerator, x.denominator) for row in A for x in row]
    )


def rows_of(A: flint.fmpq_mat) -> Rows:
    return [[Fraction(int(x.p), int(x.q)) for x in row] for row in A.tolist()]


def kernel(A: Rows) -> flint.fmpq_mat:
    """Columns that span the null space."""
    scale = lcm(*(x.denominator for row in A for x in row))
    vectors, nullity = flint.fmpz_mat([[int(x * scale) for x in row] for row in A]).nullspace()
    return flint.fmpq_mat(flint.fmpz_mat([row[:nullity] for row in vectors.tolist()]))


#: Obligations with a witness.
WITNESSED = ("rate-upper-bound", "rate-mean", "input-threshold", "input-peak", "input-energy", "input-length")


class Recheck:
    """Everything that a certificate under the nominal protocol claims, from its JSON alone: structure by reachability,
    definiteness and eigenvalues by characteristic polynomials, nothing of the package. Unless ``sharp`` is false, also
    that constants are hardly larger than they must be, which is not claimed."""

    def __init__(self, data: dict[str, Any], *, sharp: bool = True):
        self.data, self.sharp = data, sharp
        self.nodes: list[str] = data["problem"]["graph"]["nodes"]
        self.index = {label: k for k, label in enumerate(self.nodes)}
        n = self.n = len(self.nodes)
        self.W = [[Fraction(0)] * n for _ in range(n)]
        for source, target, weight in data["problem"]["graph"]["modes"][0]["edges"]:
            assert self.W[self.index[target]][self.index[source]] == 0
            self.W[self.index[target]][self.index[source]] = number(weight)
        degree = [sum((abs(w) for w in row), Fraction(0)) for row in self.W]
        self.L = [[degree[i] if i == j else -self.W[i][j] for j in range(n)] for i in range(n)]

    def numbers(self, labels: list[str]) -> list[int]:
        return [self.index[label] for label in labels]

    # ------------------------------------------------------------------ structure

    @cached_property
    def reached(self) -> list[int]:
        """Bit j of entry i: information flows from i to j along some path (Warshall)."""
        masks = [1 << i for i in range(self.n)]
        for i in range(self.n):
            for j in range(self.n):
                if self.W[j][i]:
                    masks[i] |= 1 << j
        for k in range(self.n):
            for i in range(self.n):
                if masks[i] >> k & 1:
                    masks[i] |= masks[k]
        return masks

    @cached_property
    def closed(self) -> list[list[int]]:
        """The closed strong components: every node that reaches them is reached by them."""
        groups = []
        for i in range(self.n):
            heard = [j for j in range(self.n) if self.reached[j] >> i & 1]
            if all(self.reached[i] >> j & 1 for j in heard) and heard[0] == i:
                groups.append(heard)
        return groups

    @cached_property
    def followers(self) -> list[int]:
        leaders = {v for group in self.closed for v in group}
        return [v for v in range(self.n) if v not in leaders]

    def components(self) -> list[list[int]]:
        groups: list[set[int]] = []
        for i in range(self.n):
            own = {j for j in range(self.n) if self.W[i][j] or self.W[j][i]} | {i}
            groups = [g for g in groups if not g & own] + [own.union(*(g for g in groups if g & own))]
        return sorted(sorted(g) for g in groups)

    def camps(self, nodes: list[int]) -> dict[int, int] | None:
        """Camps of some nodes by spreading signs along edges; None if an edge contradicts them."""
        camp: dict[int, int] = {}
        for root in nodes:
            todo = [] if root in camp else [root]
            camp.setdefault(root, 1)
            while todo:
                i = todo.pop()
                for j in nodes:
                    w = self.W[i][j] or self.W[j][i]
                    if w and j not in camp:
                        camp[j] = camp[i] * (1 if w > 0 else -1)
                        todo.append(j)
        return camp if all(self.W[i][j] * camp[i] * camp[j] >= 0 for i in nodes for j in nodes) else None

    def kind(self, nodes: list[int]) -> tuple[str, str, str]:
        """Connectivity, theorem and behaviour of a weakly connected set of nodes, by the table of theorems."""
        closed = [group for group in self.closed if set(group) <= set(nodes)]
        row = 1 if closed == [nodes] else 2 if len(closed) == 1 else 3
        balanced = any(self.camps(group) is not None for group in closed)
        behaviour = ["bipartite consensus", "interval bipartite consensus", "bipartite containment"][row - 1]
        return (
            ["strong", "quasi-strong", "weak"][row - 1],
            f"{row}.{1 if balanced else 2}",
            behaviour if balanced else "stability",
        )

    def structure(self) -> None:
        said = self.data["structure"][0]
        groups = self.components()
        assert said["connectivity"] == (self.kind(groups[0])[0] if len(groups) == 1 else "disconnected")
        assert [self.numbers(c["nodes"]) for c in said["closed_components"]] == self.closed
        assert self.numbers(said["leaders"]) == [v for group in self.closed for v in group]
        assert self.numbers(said["followers"]) == self.followers
        assert said["balanced"] == (self.camps(list(range(self.n))) is not None)
        pairs = [(i, j) for i in range(self.n) for j in range(i)]
        assert said["sign_symmetric"] == all(self.W[i][j] * self.W[j][i] >= 0 for i, j in pairs)
        for entry, group in zip(said["closed_components"], self.closed, strict=True):
            assert entry["balanced"] == (self.camps(group) is not None)
            if entry["balanced"]:
                assert set(entry) == {"nodes", "balanced", "gauge"}
                g = dict(zip(group, entry["gauge"], strict=True))
                assert set(g.values()) <= {1, -1}
                assert all(self.W[i][j] * g[i] * g[j] >= 0 for i in group for j in group)
            else:
                assert set(entry) == {"nodes", "balanced", "negative_cycle"}
                self.negative_cycle(entry["negative_cycle"], group)
        if len(groups) == 1:
            _, theorem, behaviour = self.kind(groups[0])
            assert (self.data["claim"]["theorem"], self.data["claim"]["behaviour"]) == (theorem, behaviour)
            assert "components" not in self.data
        else:
            assert "claim" not in self.data
            assert [self.numbers(c["nodes"]) for c in self.data["components"]] == groups
            for entry, group in zip(self.data["components"], groups, strict=True):
                claim = entry["claim"]
                assert (entry["connectivity"], claim["theorem"], claim["behaviour"]) == self.kind(group)

    def negative_cycle(self, steps: list[list[str]], group: list[int]) -> None:
        """A closed walk along edges, either way, whose signs multiply to -1."""
        edges = [tuple(self.numbers(step)) for step in steps]
        assert all(self.W[t][s] and {s, t} <= set(group) for s, t in edges)
        assert np.prod([1 if self.W[t][s] > 0 else -1 for s, t in edges]) == -1

        def closes(at: int, k: int, home: int) -> bool:
            if k == len(edges):
                return at == home
            s, t = edges[k]
            return (at == s and closes(t, k + 1, home)) or (at == t and closes(s, k + 1, home))

        assert any(closes(home, 0, home) for home in edges[0])

    # ------------------------------------------------------------------ the steps of the proof

    @cached_property
    def steps(self) -> dict[tuple[str, str], dict[str, Any]]:
        """The steps by kind and by what they are about."""
        steps = {(step["kind"], step["of"]): step for step in self.data["proof"]}
        assert len(steps) == len(self.data["proof"])
        return steps

    def step(self, kind: str, of: str = "paper") -> dict[str, Fraction]:
        """The numbers of a step, which must be there."""
        assert (kind, of) in self.steps, (kind, of)
        return {name: number(text) for name, text in self.steps[kind, of].get("numbers", {}).items()}

    @cached_property
    def own_steps(self) -> list[tuple[str, str, list[str]]]:
        """Kind, place and names of the numbers of the steps to the paper's rate, in order."""
        paper = self.data["paper"]
        if not paper["blocks"]:
            return []
        if paper["theorem"] == "1.1":
            return [("deviation-decrease", "paper", ["b"])]
        steps: list[tuple[str, str, list[str]]] = []
        if paper["theorem"] in ("2.1", "3.1") and [nodes for nodes, _, _ in self.blocks] != [self.followers]:
            for block, (nodes, _, times_rho) in zip(paper["blocks"], self.blocks, strict=True):
                if not times_rho:
                    balanced = self.camps(nodes) is not None
                    kind, name = ("leader-decrease", "b") if balanced else ("leader-margin", "m")
                    steps.append((kind, f"paper.{block['name']}", [name]))
        steps.append(("margin", "paper", ["m", "rho"] if "rho" in paper else ["m"]))
        ends = list(paper.get("rho_interval", {}))
        return [*steps, ("rho-interval", "paper", ends)] if ends else steps

    def outline(self) -> None:
        """The proof has the steps that the claims need, in order, and no others."""
        assert "reaching_time" not in self.data and "sliding_variable" not in self.data["problem"]  # nominal
        expected: list[tuple[str, str, list[str]]] = [("structure", "graph.modes[0]", []), ("claim", "graph", [])]
        if "influence" in self.data:
            expected.append(("final-state", "graph", []))
        expected += self.own_steps
        for k, function in enumerate(self.data["decays"]):
            of = f"decays[{k}]"
            assert (function["class"] == "paper") == (k == 0)
            expected += [("rate", of, ["b"])] if function["class"] != "paper" else []
            expected += [("overshoot", of, ["lowest", "highest"])] if function["class"] == "full" else []
            expected += [("deviation", of, [])] if "deviation" in function else []
        if "upper_bound" in self.data["rates"]:
            expected.append((self.limited_by, "rates", ["upper_bound"]))
        expected += self.effort_steps
        assert [(s["kind"], s["of"], list(s.get("numbers", {}))) for s in self.data["proof"]] == expected
        for step, (kind, _, names) in zip(self.data["proof"], expected, strict=True):
            brings = {"numbers": bool(names), "witness": kind in WITNESSED}  # the outcome is exact, not in balls
            assert set(step) == {"kind", "of", "proves", "lemma"} | {key for key, there in brings.items() if there}

    @property
    def effort_steps(self) -> list[tuple[str, str, list[str]]]:
        """The steps about the input; what they state is judged in test_effort.py."""
        said = self.data.get("input")
        assert (said is None) == (
            "proved" not in self.data["rates"] and bool(self.data["problem"]["graph"]["modes"][0]["edges"])
        )
        if said is None:
            return []
        steps: list[tuple[str, str, list[str]]] = []
        steps += [("input-threshold", "input", [])] if "bounded" in said else []
        steps += [("input-constants", f"decays[{k}]", []) for k, c in enumerate(said["constants"]) if c is not None]
        kinds = {"peak": "input-peak", "energy": "input-energy", "path_length": "input-length"}
        for key, kind in kinds.items():
            if key in said:
                integral = any(s["kind"] == kind and "p" in s.get("numbers", {}) for s in self.data["proof"])
                steps.append((kind, "input", ["p", "m0", "m1"] if integral else ["z"]))
        return steps

    def digest(self) -> None:
        said = {key: value for key, value in self.data.items() if key not in ("digest", "unverified")}
        text = json.dumps(said, sort_keys=True, separators=(",", ":"))
        assert self.data["digest"] == hashlib.sha256(text.encode()).hexdigest()

    # ------------------------------------------------------------------ the rate

    @cached_property
    def blocks(self) -> list[tuple[list[int], list[Fraction], bool]]:
        """Nodes and weights of each block without rho, and whether rho multiplies them."""
        blocks = [
            (self.numbers(b["nodes"]), [number(w) for w in b["diagonal"]], b["times_rho"])
            for b in self.data["paper"]["blocks"]
        ]
        assert all(w > 0 for _, diagonal, _ in blocks for w in diagonal)
        return blocks

    @cached_property
    def rho(self) -> Fraction:
        rho = self.data["paper"].get("rho")
        assert (rho is not None) == any(times_rho for _, _, times_rho in self.blocks)
        return Fraction(1) if rho is None else number(rho)

    @cached_property
    def weights(self) -> dict[int, Fraction]:
        return self.weights_at(self.rho)

    def weights_at(self, rho: Fraction) -> dict[int, Fraction]:
        return {
            v: w * (rho if times_rho else 1)
            for nodes, diagonal, times_rho in self.blocks
            for v, w in zip(nodes, diagonal, strict=True)
        }

    def proves(self, rate: Fraction) -> bool:
        """Tell whether the inequality of the theorem's row holds strictly for ``rate``."""
        if self.data["paper"]["theorem"] == "1.1":
            return self.deviation_decays(rate)
        nodes = list(self.weights)
        for v in set(range(self.n)) - set(nodes):
            assert not any(self.L[v]), "an agent that listens has a coordinate"
        top = max(self.weights.values())
        return positive_definite(combined(self.form(self.rho), diagonal([top] * len(nodes)), -rate))

    def form(self, rho: Fraction) -> Rows:
        """The matrix whose least eigenvalue the objective of the row takes, at some ``rho``."""
        theorem, weights = self.data["paper"]["theorem"], self.weights_at(rho)
        nodes = list(weights)
        if theorem in ("1.2", "2.2", "3.2") or [block[0] for block in self.blocks] == [self.followers]:
            return lyapunov(list(weights.values()), part(self.L, nodes, nodes))
        return self.coupled(theorem, weights)

    def paper_steps(self) -> None:
        """The numbers of the proof are those of the paper's certificate, and the ends of rho are admissible."""
        paper, rate = self.data["paper"], number(self.data["paper"]["rate"])
        if paper["theorem"] == "1.1":
            assert self.step("deviation-decrease") == {"b": rate}
            assert "rho" not in paper and "rho_interval" not in paper
            return
        said = self.step("margin")
        assert said["m"] == rate * max(self.weights.values())
        if "rho" not in paper:
            assert "rho_interval" not in paper
            return
        assert said["rho"] == self.rho > 0
        assert set(paper["rho_interval"]) <= {"printed", "exact"}
        ends = {name: number(end) for name, end in paper["rho_interval"].items()}
        for end in ends.values():
            assert end > 0 and positive_definite(self.form(end))
        if len(ends) < 2:  # unbounded: no follower listens to these leaders
            K = [v for nodes, _, times_rho in self.blocks if not times_rho for v in nodes]
            assert not any(any(row) for row in part(self.L, self.followers, K))
        if ends:
            assert self.step("rho-interval") == ends
            assert ends.get("printed", 0) <= ends.get("exact", ends.get("printed", 0))
            assert self.rho <= ends.get("exact", self.rho)

    def deviation_decays(self, rate: Fraction) -> bool:
        """``Z L + L'Z - rate Z > 0`` modulo G1, where ``Z = G (P - pp'/p'1) G`` is the form of ``eps'P eps``."""
        Z = self.deviation_form
        ZL = product(Z, self.L)
        S = combined(combined(ZL, transposed(ZL), Fraction(1)), Z, -rate)
        return positive_definite(part(S, *[list(range(self.n - 1))] * 2))

    @cached_property
    def deviation_form(self) -> Rows:
        """``Z`` of ``eps'P eps = X'Z X``."""
        p, camp = [self.weights[v] for v in range(self.n)], self.camps(list(range(self.n)))
        assert camp is not None
        return [
            [camp[i] * camp[j] * ((p[i] if i == j else 0) - p[i] * p[j] / sum(p)) for j in range(self.n)]
            for i in range(self.n)
        ]

    def coupled(self, theorem: str, at: dict[int, Fraction]) -> Rows:
        """``Phi`` of 2.1 or ``Pi`` of 3.1; the decrease of each leader block is proved first."""
        gamma: list[Fraction] = []
        names = [block["name"] for block in self.data["paper"]["blocks"]]
        leaders = [(name, *block[:2]) for name, block in zip(names, self.blocks, strict=True) if not block[2]]
        for name, nodes, weights in leaders:
            assert nodes in self.closed
            A = part(self.L, nodes, nodes)
            S = lyapunov(weights, A)
            if self.camps(nodes) is not None:  # on the range of L_k, whose kernel is G_k 1
                b = self.step("leader-decrease", f"paper.{name}")["b"]
                assert b > 0
                S = combined(S, diagonal(weights), -b)
                S = product(transposed(A), product(S, A))
                assert positive_definite(part(S, *[list(range(len(nodes) - 1))] * 2))
                gamma += [b * w for w in weights] if theorem == "2.1" else [b * min(weights)] * len(nodes)
            else:
                m = self.step("leader-margin", f"paper.{name}")["m"]
                assert m > 0 and positive_definite(combined(S, diagonal([Fraction(1)] * len(nodes)), -m))
                gamma += [m] * len(nodes)
        K = [v for _, nodes, _ in leaders for v in nodes]
        F = [v for v in at if v not in K]
        S_F = lyapunov([at[v] for v in F], part(self.L, F, F))
        C = [[at[v] * x for x in row] for v, row in zip(F, part(self.L, F, K), strict=True)]
        top = [[*row, *(line[i] for line in C)] for i, row in enumerate(diagonal(gamma))]
        return top + [[*line, *S_F[i]] for i, line in enumerate(C)]

    def decreases(self, rate: Fraction) -> bool:
        """Tell whether ``V' <= -rate V`` for every state, whatever the theorem's way to it.

        ``V = E'Omega E`` with ``E = -LX``: ``L'(Omega L + L'Omega - rate Omega)L`` must be positive definite modulo the
        kernel of ``L``; one node of each balanced closed component is left out.
        """
        if self.data["paper"]["theorem"] == "1.1":
            return self.deviation_decays(rate)
        weights = [self.weights.get(v, Fraction(0)) for v in range(self.n)]
        S = combined(lyapunov(weights, self.L), diagonal(weights), -rate)
        return positive_definite(product(transposed(self.range), product(S, self.range)))

    def rates(self) -> None:
        data = self.data
        paper, functions = data["paper"], data["decays"]
        if not paper["blocks"]:
            assert not any(any(row) for row in self.L)  # nobody listens, nothing moves
            assert "rate" not in paper and "rho_interval" not in paper
            assert data["rates"] == {} and functions == [] and "overshoot" not in data
            return
        rate = number(paper["rate"])
        assert rate > 0
        assert self.proves(rate)
        assert self.decreases(rate)
        self.paper_steps()
        assert number(paper["overshoot"]) == max(self.weights.values()) / min(self.weights.values())
        shared = {
            k: paper[k] for k in ("coordinates", "blocks", "rho", "rate", "overshoot") if k in paper or k != "rho"
        }
        assert functions[0] == {"class": "paper", **shared, "deviation": functions[0]["deviation"]}
        self.deviations(functions[0], self.paper_form)
        self.searched_functions(functions[1:])
        self.limit()
        assert (
            {"paper", "proved", "upper_bound"} <= set(data["rates"]) <= {"paper", "diagonal", "proved", "upper_bound"}
        )
        assert data["rates"]["paper"] == paper["rate"]
        for key, classes in (("diagonal", ("perron", "lmi")), ("proved", ("paper", "perron", "lmi", "full"))):
            positive = [number(m["rate"]) for m in functions if m["class"] in classes and number(m["rate"]) > 0]
            assert data["rates"].get(key) == (str(max(positive)) if positive else None)
        fastest = [m for m in functions if m["rate"] == data["rates"]["proved"]]
        least = min(fastest, key=lambda m: number(m["overshoot"]))
        assert {"value": least["overshoot"], "of": f"||{least['coordinates']}||^2"} == data["overshoot"]

    # ------------------------------------------------------------------ what no rate exceeds

    @cached_property
    def slowest(self) -> flint.arb:
        """Twice the least real part of the nonzero eigenvalues of ``L``: the roots of its characteristic polynomial."""
        scale = lcm(*(x.denominator for row in self.L for x in row))
        roots = flint.fmpz_mat([[int(x * scale) for x in row] for row in self.L]).charpoly().complex_roots()
        balanced = sum(self.camps(group) is not None for group in self.closed)
        assert sum(multiplicity for root, multiplicity in roots if root == 0) == balanced
        least = None
        for root, _ in roots:
            if root != 0:
                assert root.real > 0
                least = root.real if least is None else least.min(root.real)
        assert least is not None
        return 2 * least / scale

    @property
    def limited_by(self) -> str:
        """Which of two obligations limits the rates."""
        return "rate-mean" if ("rate-mean", "rates") in self.steps else "rate-upper-bound"

    def limit(self) -> None:
        """No rate exceeds the limit, which some eigenvalue does not, though by less than a thousandth."""
        said = self.data["rates"]["upper_bound"]
        assert self.step(self.limited_by, "rates") == {"upper_bound": number(said)}
        assert not self.slowest > ball(number(said))
        assert not self.sharp or ball(number(said)) < self.slowest * (1 + ball(Fraction(1, 1000)))
        for function in self.data["decays"]:
            assert number(function["rate"]) < number(said)
            assert not ball(number(function["rate"])) > self.slowest
        witness = self.steps[self.limited_by, "rates"]["witness"]
        (self.mean if self.limited_by == "rate-mean" else self.inertia)(witness, number(said) / 2)

    def mean(self, witness: dict[str, Any], c: Fraction) -> None:
        """``c`` is the trace of the block of a strong component over the number of its nonzero eigenvalues."""
        assert set(witness) == {"node"}
        (v,) = self.numbers([witness["node"]])
        nodes = [j for j in range(self.n) if self.reached[v] >> j & 1 and self.reached[j] >> v & 1]
        count = len(nodes) - (nodes in self.closed and self.camps(nodes) is not None)
        assert count > 0 and c * count == sum((self.L[j][j] for j in nodes), Fraction(0))

    def inertia(self, witness: dict[str, Any], c: Fraction) -> None:
        """``H B + B'H > 0`` for ``B = A - c I``, and ``H < 0`` on one vector; two where the eigenvalue 0 is one."""
        assert set(witness) == {"nodes", "lower_triangle", "vectors"}
        nodes = self.numbers(witness["nodes"])
        v = nodes[0]
        assert nodes == [j for j in range(self.n) if self.reached[v] >> j & 1 and self.reached[j] >> v & 1]
        lower = [[number(x) for x in row] for row in witness["lower_triangle"]]
        assert [len(row) for row in lower] == list(range(1, len(nodes) + 1))
        H = [[lower[max(i, j)][min(i, j)] for j in range(len(nodes))] for i in range(len(nodes))]
        HB = product(H, combined(part(self.L, nodes, nodes), diagonal([Fraction(1)] * len(nodes)), -c))
        assert positive_definite(combined(HB, transposed(HB), Fraction(1)))
        X = [[number(x) for x in vector] for vector in witness["vectors"]]
        assert len(X) == (2 if nodes in self.closed and self.camps(nodes) is not None else 1)
        below = product(X, product(H, transposed(X)))
        assert positive_definite([[-x for x in row] for row in below])

    # ------------------------------------------------------------------ searched Lyapunov functions, deviations

    @cached_property
    def kept(self) -> list[int]:
        """All nodes but one of each balanced closed component: as unit vectors a complement of the kernel of ``L``."""
        left_out = {group[0] for group in self.closed if self.camps(group) is not None}
        return [v for v in range(self.n) if v not in left_out]

    @cached_property
    def moving(self) -> list[int]:
        """The rows of ``E`` that are not 0 forever."""
        alone = {group[0] for group in self.closed if len(group) == 1}
        return [v for v in range(self.n) if v not in alone]

    @cached_property
    def range(self) -> Rows:
        """``L`` on ``kept``: its columns are a basis of all errors ``E = -L X``."""
        return part(self.L, list(range(self.n)), self.kept)

    @cached_property
    def beyond_final_state(self) -> Rows:
        """``I - Q`` on ``kept``, with ``Q = U (V'U)^-1 V'`` for ``L U = 0`` and ``V'L = 0``."""
        U, V = kernel(self.L), kernel(transposed(self.L))
        Q = rows_of(U * (V.transpose() * U).inv() * V.transpose()) if U.ncols() else [[Fraction(0)] * self.n] * self.n
        return part(combined(diagonal([Fraction(1)] * self.n), Q, Fraction(-1)), list(range(self.n)), self.kept)

    @cached_property
    def paper_form(self) -> Rows:
        """The paper's ``V`` as a form of the state, on ``kept``."""
        if self.data["paper"]["coordinates"] == "eps":
            return part(self.deviation_form, self.kept, self.kept)
        weights = [self.weights.get(v, Fraction(0)) for v in range(self.n)]
        return product(transposed(self.range), product(diagonal(weights), self.range))

    def matrix(self, function: dict[str, Any]) -> Rows:
        """``P`` of a searched function, on the rows ``moving``."""
        (block,) = function["blocks"]
        assert set(block) == {
            "name",
            "nodes",
            "times_rho",
            "lower_triangle" if "full" in function["class"] else "diagonal",
        }
        assert block["name"] == "P" and block["times_rho"] is False
        nodes = self.numbers(block["nodes"])
        assert sorted(nodes) == self.moving
        order = [nodes.index(v) for v in self.moving]
        if "diagonal" in block:
            assert len(block["diagonal"]) == len(nodes)
            P = diagonal([number(w) for w in block["diagonal"]])
        else:
            lower = [[number(x) for x in row] for row in block["lower_triangle"]]
            assert [len(row) for row in lower] == list(range(1, len(nodes) + 1))
            P = [[lower[max(i, j)][min(i, j)] for j in range(len(nodes))] for i in range(len(nodes))]
        return part(P, order, order)

    def decays(self, P: Rows, rate: Fraction) -> bool:
        """Tell whether ``V' < -rate V`` for ``V = E'P E`` and every error that is not 0."""
        basis, A = part(self.range, self.moving, list(range(len(self.kept)))), part(self.L, self.moving, self.moving)
        PA = product(P, A)
        S = combined(combined(PA, transposed(PA), Fraction(1)), P, -rate)
        return positive_definite(product(transposed(basis), product(S, basis)))

    def searched_functions(self, functions: list[dict[str, Any]]) -> None:
        """Rate, overshoot constant and deviations of every other function, and that the proof speaks of them."""
        for k, function in enumerate(functions, start=1):
            of = f"decays[{k}]"
            assert set(function) == {"class", "coordinates", "blocks", "rate", "overshoot", "deviation"}
            assert function["class"] in ("perron", "lmi", "full")
            assert function["coordinates"] == "E"
            P, rate, overshoot = self.matrix(function), number(function["rate"]), number(function["overshoot"])
            assert self.step("rate", of) == {"b": rate}
            assert self.decays(P, rate)
            if function["class"] == "full":
                ends = self.step("overshoot", of)
                lowest, highest = ends["lowest"], ends["highest"]
                unit = diagonal([Fraction(1)] * len(P))
                assert lowest > 0 and overshoot == highest / lowest
                assert positive_definite(combined(P, unit, -lowest))
                assert positive_definite(combined(diagonal([highest] * len(P)), P, Fraction(-1)))
            else:
                weights = [P[i][i] for i in range(len(P))]
                assert min(weights) > 0 and overshoot == max(weights) / min(weights)
            basis = part(self.range, self.moving, list(range(len(self.kept))))
            self.deviations(function, product(transposed(basis), product(P, basis)))

    def deviations(self, function: dict[str, Any], V: Rows) -> None:
        """``|x_k - (Q x)_k|^2 <= c_k V`` and ``||x - Q x||^2 <= norm V``, and constants hardly smaller would not do.

        For ``V`` and ``x - Q x = D x`` on ``kept`` the least ``c_k`` is ``D_k V^-1 D_k'``.
        """
        said, D = function["deviation"], self.beyond_final_state
        assert set(said) == {"agents", "norm"} and list(said["agents"]) == self.nodes
        assert positive_definite(V)
        solved = rows_of(exact_matrix(V).solve(exact_matrix(transposed(D))))
        for k, text in enumerate(said["agents"].values()):
            least = sum((a * row[k] for a, row in zip(D[k], solved, strict=True)), Fraction(0))
            assert least < number(text) or number(text) == least == 0, k  # strictly, so that it is quick to prove
            assert not self.sharp or number(text) <= least * (1 + Fraction(1, 10**6)) + Fraction(1, 10**200), k
        gram, norm = product(transposed(D), D), number(said["norm"])
        assert positive_definite(combined([[norm * x for x in row] for row in V], gram, Fraction(-1)))
        less = norm * Fraction(98, 100)
        too_little = combined([[less * x for x in row] for row in V], gram, Fraction(-1))
        assert not self.sharp or not positive_definite(too_little)

    # ------------------------------------------------------------------ the outcome

    def final_state(self) -> None:
        """``L x = 0`` and ``eta' G (x - x0) = 0``: together they determine the limit."""
        said = self.data["influence"]
        x = self.state(self.data["final_state"])
        x0 = self.state(self.data["problem"]["initial_state"])
        assert not any(sum((a * v for a, v in zip(row, x, strict=True) if a), Fraction(0)) for row in self.L)
        balanced = [group for group in self.closed if self.camps(group) is not None]
        left_null_vectors = said["components"]
        assert [self.numbers(c["nodes"]) for c in left_null_vectors] == balanced
        degenerate = []
        for group, entry in zip(balanced, left_null_vectors, strict=True):
            camp = self.camps(group)
            assert camp is not None
            null_vector = [number(v) for v in entry["left_null_vector"]]
            eta = [camp[v] * w * camp[group[0]] for v, w in zip(group, null_vector, strict=True)]
            eta = eta if eta[0] > 0 else [-w for w in eta]
            assert min(eta) > 0 and sum(eta) == 1
            for j in group:  # eta' M(L_k) = 0
                M = [abs(self.L[i][j]) * (1 if i == j else -1) for i in group]
                assert sum(a * b for a, b in zip(eta, M, strict=True)) == 0
            assert sum(w * (x[v] - x0[v]) for v, w in zip(group, null_vector, strict=True)) == 0
            if all(x[v] == 0 for v in group):
                degenerate.append(self.closed.index(group) + 1)
        assert said["degenerate"] == degenerate
        assert all(x[v] == 0 for group in self.closed if group not in balanced for v in group)
        self.containment_weights(said, balanced)
        for entry in self.data.get("components", []):
            assert entry["final_state"] == {label: self.data["final_state"][label] for label in entry["nodes"]}

    def containment_weights(self, influence: dict[str, Any], balanced: list[list[int]]) -> None:
        """Each column of the followers' weights extends ``G_k 1`` to a vector of the kernel of ``L``."""
        assert self.numbers(list(influence["containment_weights"])) == self.followers
        for k, entry in enumerate(self.data["structure"][0]["closed_components"]):
            if not entry["balanced"]:
                continue
            column = balanced.index(self.closed[k])
            state = [Fraction(0)] * self.n
            for v, sign in zip(self.closed[k], entry["gauge"], strict=True):
                state[v] = Fraction(sign)
            for label, weights in influence["containment_weights"].items():
                state[self.index[label]] = number(weights[column])
                assert sum(abs(number(w)) for w in weights) <= 1
            assert not any(sum((a * v for a, v in zip(row, state, strict=True) if a), Fraction(0)) for row in self.L)

    def state(self, values: dict[str, str]) -> list[Fraction]:
        assert list(values) == self.nodes
        return [number(text) for text in values.values()]

    def everything(self) -> None:
        assert self.data["verdict"] == "certified"
        self.structure()
        self.outline()
        self.rates()
        self.final_state()
