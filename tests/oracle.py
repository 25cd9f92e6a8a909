"""Whether what a certificate claims is true: judged without the checker, by other means.

:func:`false_claims` recomputes what a certificate of a small graph says: structure by networkx, where the agents end by
the kernel of ``L`` in rationals, decay rates by semidefiniteness of ``rate V + dV/ds`` in rationals, the spectrum by
isolated roots of the characteristic polynomial, and bounds of the input by the exact motion at many instants, from many
starts. Bounds over time are tested from below: a bound that some instant exceeds is false. Witnesses are not read.

To judge a new claim, add a method that calls :meth:`Oracle.require` and name it in :meth:`Oracle.judged`.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import flint
import networkx as nx
import numpy as np

Json = dict[str, Any]
Vector = list[Fraction]
Matrix = list[Vector]

#: Instants ``z = ln(T/(T - t))`` at which the motion is formed.
INSTANTS = sorted({*np.linspace(0, 3, 13), *np.linspace(3, 12, 10), 16.0, 24.0, 40.0, 80.0})
#: Largest exponent ``s max |L_ij|`` for which the motion is formed.
LATEST = 700
#: A bound may lie below what floats find by this share.
SLACK = 1e-9


def false_claims(data: Json, files: Mapping[str, bytes] | None = None) -> list[str]:
    """Say what is false in an accepted certificate; an empty list if nothing is."""
    oracle = Oracle(data, files or {})
    oracle.judged()
    return oracle.false


def number(text: str) -> Fraction:
    """Read a number of the written grammar."""
    if match := re.fullmatch(r"([+-]?)0[xX]([0-9a-fA-F]+)\.?([0-9a-fA-F]*)[pP]([+-]?\d+)", text, re.ASCII):
        size = Fraction(int(match[2] + match[3], 16), 16 ** len(match[3])) * Fraction(2) ** int(match[4])
        return -size if match[1] == "-" else size
    return Fraction(text)


# ---------------------------------------------------------------------- exact linear algebra


def semidefinite(S: Matrix) -> bool:
    """Whether ``x'S x >= 0`` for all ``x``, by symmetric elimination; a zero pivot needs a zero row."""
    left = [list(row) for row in S]
    while left:
        k = next((i for i in range(len(left)) if left[i][i] != 0), None)
        if k is None:
            return not any(x for row in left for x in row)
        if left[k][k] < 0:
            return False
        pivot = left[k]
        left = [
            [x - row[k] * pivot[j] / pivot[k] for j, x in enumerate(row) if j != k]
            for i, row in enumerate(left)
            if i != k
        ]
    return True


def times(A: Matrix, B: Matrix) -> Matrix:
    columns = list(zip(*B, strict=True))
    return [[sum((x * y for x, y in zip(r, c, strict=True) if x and y), Fraction(0)) for c in columns] for r in A]


def transposed(A: Matrix) -> Matrix:
    return [list(column) for column in zip(*A, strict=True)]


def kernel(A: Matrix) -> Matrix:
    """Rows that span ``{x: A x = 0}``."""
    reduced, rank = flint.fmpq_mat([[flint.fmpq(x.numerator, x.denominator) for x in row] for row in A]).rref()
    n = len(A[0])
    rows = [[Fraction(int(reduced[i, j].p), int(reduced[i, j].q)) for j in range(n)] for i in range(rank)]
    pivots = [next(j for j in range(n) if row[j]) for row in rows]
    basis = []
    for free in (j for j in range(n) if j not in pivots):
        x = [Fraction(int(j == free)) for j in range(n)]
        for row, pivot in zip(rows, pivots, strict=True):
            x[pivot] = -row[free]
        basis.append(x)
    return basis


def inverse(A: Matrix) -> Matrix:
    found = flint.fmpq_mat([[flint.fmpq(x.numerator, x.denominator) for x in row] for row in A]).inv()
    return [[Fraction(int(found[i, j].p), int(found[i, j].q)) for j in range(len(A))] for i in range(len(A))]


class Oracle:
    """One certificate."""

    def __init__(self, data: Json, files: Mapping[str, bytes]):
        self.data, self.files, self.false = data, files, list[str]()
        said = data["problem"]["graph"]
        self.labels: list[str] = said["nodes"]
        self.index = {label: i for i, label in enumerate(self.labels)}
        self.n = len(self.labels)
        self.weights = {(s, t): w for s, t, w in self.edges(said["modes"][0]["edges"])}
        self.L = [[-self.weights.get((j, i), Fraction(0)) for j in range(self.n)] for i in range(self.n)]
        for i, row in enumerate(self.L):
            row[i] = sum(map(abs, row), Fraction(0))
        self.key = tuple(map(tuple, self.L))

    def require(self, holds: Any, claim: str) -> None:
        """Note a claim that is false."""
        if not holds:
            self.false.append(claim)

    def judged(self) -> None:
        for claim in (
            self.structure,
            self.claims,
            self.final_state,
            self.functions,
            self.paper,
            self.rates,
            self.reaching,
            self.effort,
        ):
            claim()

    # ------------------------------------------------------------------ reading

    def column(self, said: Json) -> list[Fraction]:
        values = np.load(io.BytesIO(self.files[said["file"]]), allow_pickle=False).tolist()
        return [Fraction(x) / number(said.get("scale", "1")) for x in values]

    def edges(self, said: Any) -> list[tuple[int, int, Fraction]]:
        if isinstance(said, list):
            return [(self.index[s], self.index[t], number(w)) for s, t, w in said]
        source, target, weight = (self.column(said[key]) for key in ("source", "target", "weight"))
        scale = number(said["scale"])
        return [(int(s), int(t), w / scale) for s, t, w in zip(source, target, weight, strict=True)]

    def vector(self, said: Any) -> Vector:
        """Numbers by agent, or in a side file."""
        if isinstance(said, dict) and type(said.get("count")) is int:
            return self.column(said)
        return [number(said[label]) for label in self.labels]

    def listed(self, said: Any) -> Vector:
        return self.column(said) if isinstance(said, dict) else list(map(number, said))

    def nodes(self, said: Any) -> list[int]:
        return list(map(int, self.column(said))) if isinstance(said, dict) else [self.index[x] for x in said]

    @staticmethod
    def holds(said: Any, value: Fraction) -> bool:
        """Whether an interval contains a number."""
        if isinstance(said, dict):
            return abs(number(said["mid"]) - value) <= number(said["radius"])
        return number(said) == value

    # ------------------------------------------------------------------ structure and claim

    @cached_property
    def digraph(self) -> nx.DiGraph:
        graph = nx.DiGraph()
        graph.add_nodes_from(range(self.n))
        graph.add_edges_from(self.weights)
        return graph

    def camps(self, nodes: Iterable[int]) -> dict[int, int] | None:
        """Signs ``g`` with ``w g_i g_j > 0`` on all edges between the nodes; None if there are none."""
        own = self.digraph.subgraph(nodes).to_undirected(as_view=False)
        sign: dict[int, int] = {}
        for root in sorted(own):
            if root not in sign:
                sign[root] = 1
                for a, b in nx.bfs_edges(own, root):
                    sign[b] = sign[a] * (1 if self.weights.get((a, b), self.weights.get((b, a), 0)) > 0 else -1)
        fits = all(w * sign[s] * sign[t] > 0 for (s, t), w in self.weights.items() if s in sign and t in sign)
        return sign if fits else None

    @cached_property
    def closed(self) -> list[list[int]]:
        parts = [sorted(part) for part in nx.strongly_connected_components(self.digraph)]
        return sorted(p for p in parts if not any(s not in p and t in p for s, t in self.weights))

    def structure(self) -> None:
        said, leaders = self.data["structure"][0], [v for part in self.closed for v in part]
        followers = [v for v in range(self.n) if v not in leaders]
        self.require(self.nodes(said["leaders"]) == leaders, "leaders")
        self.require(self.nodes(said["followers"]) == followers, "followers")
        listed = said["closed_components"]
        self.require([self.nodes(c["nodes"]) for c in listed] == self.closed, "closed components")
        for part, c in zip(self.closed, listed, strict=False):
            camps = self.camps(part)
            self.require(c["balanced"] is (camps is not None), "balance of a component")
            if camps is not None and c["balanced"]:
                self.require(c["gauge"] == [camps[v] * camps[part[0]] for v in part], "a gauge")
        self.require(said["balanced"] is (self.camps(range(self.n)) is not None), "balance")
        symmetric = all(w * self.weights.get((t, s), w) > 0 for (s, t), w in self.weights.items())
        self.require(said["sign_symmetric"] is symmetric, "sign symmetry")

    def claims(self) -> None:
        pieces = sorted((sorted(p) for p in nx.weakly_connected_components(self.digraph)), key=lambda p: p[0])
        slides, found = self.data["problem"]["gain"]["kind"] == "sliding-mode", []
        for piece in pieces:
            own = [part for part in self.closed if part[0] in piece]
            row = 0 if own == [piece] else 1 if len(own) == 1 else 2
            some = any(self.camps(part) is not None for part in own)
            inside = {pair: w for pair, w in self.weights.items() if pair[0] in piece}
            mutual = all(self.weights.get((t, s)) == w for (s, t), w in inside.items())
            friends = all(w > 0 for w in inside.values())
            flags = {
                ("1.1", "6.1"): row == 0 and some and mutual,
                ("1.2", "6.2"): row == 0 and not some and mutual,
                ("2", "7"): row == 0 and some and friends,
                ("3", "8"): row == 1 and some and self.camps(piece) is not None,
                ("4", "9"): row == 1 and some and friends,
                ("5", "10"): row == 2 and some and friends,
            }
            behaviour = ("bipartite consensus", "interval bipartite consensus", "bipartite containment")[row]
            claim = {
                "theorem": f"{row + (4 if slides else 1)}.{1 if some else 2}",
                "behaviour": behaviour if some else "stability",
                "corollaries": [names[slides] for names, holds in flags.items() if holds],
            }
            found.append((piece, ("strong", "quasi-strong", "weak")[row], claim))
        said = self.data.get("components")
        if len(found) == 1:
            self.require(self.data.get("claim") == found[0][2] and said is None, "claim")
            self.require(self.data["structure"][0]["connectivity"] == found[0][1], "connectivity")
        elif isinstance(said, list):
            told = [(self.nodes(c["nodes"]), c["connectivity"], c["claim"]) for c in said]
            self.require("claim" not in self.data and told == found, "claims of components")

    # ------------------------------------------------------------------ outcome

    @cached_property
    def Q(self) -> Matrix:
        """The projection onto the kernel of ``L`` along its range."""
        right, left = kernel(self.L), kernel(transposed(self.L))
        if not right:
            return [[Fraction(0)] * self.n for _ in range(self.n)]
        between = inverse(times(left, transposed(right)))
        return times(times(transposed(right), between), left)

    @cached_property
    def start(self) -> Vector | None:
        said = self.data["problem"].get("initial_state")
        return None if said is None else self.vector(said)

    @cached_property
    def sigma0(self) -> Vector:
        said = self.data["problem"].get("sliding_variable")
        return [Fraction(0)] * self.n if said is None else self.vector(said)

    def final_state(self) -> None:
        said, state = self.data.get("influence"), self.data.get("final_state")
        proved = "proved" in self.data["rates"] or not self.weights
        self.require((self.data["verdict"] == "certified") == (proved and said is not None), "verdict")
        if said is None:
            return
        if self.start is not None:
            moved = [x - s for x, s in zip(self.start, self.sigma0, strict=True)]
            end = [sum((q * x for q, x in zip(row, moved, strict=True)), Fraction(0)) for row in self.Q]
            if list(state) == ["mid", "radius"] and isinstance(state["mid"], dict):
                mid, radius = self.column(state["mid"]), self.column(state["radius"])
                inside = all(abs(x - m) <= r for x, m, r in zip(end, mid, radius, strict=True))
            else:
                inside = all(self.holds(state[label], x) for label, x in zip(self.labels, end, strict=True))
                for component in self.data.get("components") or ():
                    own = isinstance(component, dict) and component.get("final_state")
                    ends = {label: end[self.index[label]] for label in own} if own else {}
                    inside = inside and all(self.holds(own[label], x) for label, x in ends.items())
            self.require(inside, "final state")
            zero = [k for k, p in enumerate(self.closed, 1) if self.camps(p) is not None and end[p[0]] == 0]
            self.require(said.get("degenerate") == zero, "degenerate")
        balanced = [p for p in self.closed if self.camps(p) is not None]
        grouped = "containment_weights" not in said
        groups = [p for p in balanced if len(p) > 1 or not grouped]
        listed = said["components"]
        self.require([self.nodes(c["nodes"]) for c in listed] == groups, "groups")
        for p, c in zip(groups, listed, strict=False):
            fits = all(self.holds(x, self.Q[p[0]][v]) for x, v in zip(c["left_null_vector"], p, strict=True))
            self.require(fits, "left_null_vector")
        for label, row in {} if grouped else said["containment_weights"].items():
            for p, x in zip(balanced, row, strict=True):
                camps = self.camps(p) or {}
                weight = sum((self.Q[self.index[label]][v] * camps[v] * camps[p[0]] for v in p), Fraction(0))
                self.require(self.holds(x, weight), "the weight of a follower")

    # ------------------------------------------------------------------ decay

    def form(self, function: Json) -> tuple[Matrix, Matrix, Matrix, list[int]]:
        """``V = x'F x = z'P z``, ``z = A x``: return ``F``, ``P``, ``A`` and the nodes."""
        nodes, diagonal, rows = [], [], None
        for block in function["blocks"]:
            nodes += self.nodes(block["nodes"])
            if "diagonal" in block:
                rho = number(function["rho"]) if block["times_rho"] else 1
                diagonal += [w * rho for w in self.listed(block["diagonal"])]
            else:
                lower = [list(map(number, row)) for row in block["lower_triangle"]]
                rows = [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]
        P = rows or [[w * (i == j) for j in range(len(nodes))] for i, w in enumerate(diagonal)]
        A = [self.L[v] for v in nodes]
        if function["coordinates"] == "eps":
            camps, total = self.camps(nodes) or {}, sum(diagonal)
            first = camps[nodes[0]]
            A = [
                [
                    (i == j) - camps[i] * camps[j] * first * first * p / total
                    for j, p in zip(nodes, diagonal, strict=True)
                ]
                for i in nodes
            ]
        return times(times(transposed(A), P), A), P, A, nodes

    def decays(self, F: Matrix, L: Matrix, rate: Fraction) -> bool:
        """Whether ``d(x'F x)/ds <= -rate x'F x`` along ``dx/ds = -L x``."""
        FL = times(F, L)
        n = len(F)
        return semidefinite([[FL[i][j] + FL[j][i] - rate * F[i][j] for j in range(n)] for i in range(n)])

    @cached_property
    def forms(self) -> list[tuple[Matrix, Matrix, Matrix, list[int]]]:
        return [self.form(function) for function in self.data["decays"]]

    def functions(self) -> None:
        away = [[(i == j) - x for j, x in enumerate(row)] for i, row in enumerate(self.Q)]
        for k, (function, (F, P, _, nodes)) in enumerate(zip(self.data["decays"], self.forms, strict=True)):
            at, rate = f"decays[{k}]", number(function["rate"])
            self.require(sorted(nodes) == [v for v in range(self.n) if self.L[v][v]] or k == 0, f"{at}: nodes")
            self.require(self.decays(F, self.L, rate), f"{at}: rate")
            high = number(function["overshoot"])
            steps = [s for s in self.data["proof"] if s["kind"] == "overshoot" and s["of"] == at]
            low = number(steps[0]["numbers"]["lowest"]) if steps else min(P[i][i] for i in range(len(P)))
            within = [[(high * low * (i == j) - x) for j, x in enumerate(row)] for i, row in enumerate(P)]
            above = [[x - low * (i == j) for j, x in enumerate(row)] for i, row in enumerate(P)]
            self.require(low > 0 and semidefinite(above) and semidefinite(within), f"{at}: prefactor")
            if "deviation" in function:
                for d, label in zip(away, self.labels, strict=True):
                    c = number(function["deviation"]["agents"][label])
                    least = [[c * x - a * b for x, b in zip(row, d, strict=True)] for row, a in zip(F, d, strict=True)]
                    self.require(semidefinite(least), f"{at}: distance of {label}")
                gram, c = times(transposed(away), away), number(function["deviation"]["norm"])
                least = [[c * x - y for x, y in zip(r, g, strict=True)] for r, g in zip(F, gram, strict=True)]
                self.require(semidefinite(least), f"{at}: distance of the norm")

    def paper(self) -> None:
        """Every positive ``rho`` up to an end makes the matrix of the theorem's row definite."""
        said = self.data.get("paper")
        if said is None or "rate" not in said:
            return
        first = self.data["decays"][0]
        same = all(first.get(key) == said.get(key) for key in ("coordinates", "blocks", "rho", "rate", "overshoot"))
        self.require(same and number(said["rate"]) > 0, "the paper's certificate")
        steps = {s["of"]: s for s in self.data["proof"] if s["kind"] in ("leader-decrease", "leader-margin")}
        gamma: dict[int, Fraction] = {}
        for block in said["blocks"]:
            step, nodes = steps.get(f"paper.{block['name']}"), self.nodes(block["nodes"])
            if step is None:
                continue
            weights = self.listed(block["diagonal"])
            W = [[w * (i == j) for j in range(len(nodes))] for i, w in enumerate(weights)]
            L = [[self.L[i][j] for j in nodes] for i in nodes]
            if step["kind"] == "leader-margin":
                m = number(step["numbers"]["m"])
                WL = times(W, L)
                S = [[WL[i][j] + WL[j][i] - m * (i == j) for j in range(len(L))] for i in range(len(L))]
                self.require(semidefinite(S), "a leader margin")
                gamma.update(dict.fromkeys(nodes, m))
            else:
                b = number(step["numbers"]["b"])
                self.require(self.decays(times(times(transposed(L), W), L), L, b), "a leader decrease")
                least = said["theorem"] not in ("2.1", "5.1")
                gamma.update({v: b * (min(weights) if least else w) for v, w in zip(nodes, weights, strict=True)})
        margins = [s for s in self.data["proof"] if s["kind"] == "margin"]
        if margins:
            m, rho = number(margins[0]["numbers"]["m"]), number(said.get("rho", "1"))
            self.require(semidefinite(self.coupled(said, gamma, rho, m)), "margin")
        for end in said.get("rho_interval", {}).values():
            for share in (Fraction(1), Fraction(1, 1000)):
                self.require(semidefinite(self.coupled(said, gamma, number(end) * share, Fraction(0))), "rho interval")

    def coupled(self, said: Json, gamma: Mapping[int, Fraction], rho: Fraction, m: Fraction) -> Matrix:
        weight: dict[int, Fraction] = {}
        for block in said["blocks"]:
            scale = rho if block["times_rho"] else 1
            weight |= {
                v: w * scale for v, w in zip(self.nodes(block["nodes"]), self.listed(block["diagonal"]), strict=True)
            }
        nodes = list(weight)
        S = [[weight[i] * self.L[i][j] + weight[j] * self.L[j][i] for j in nodes] for i in nodes]
        for a, i in enumerate(nodes):
            for b, j in enumerate(nodes):
                if i in gamma and j in gamma:
                    S[a][b] = gamma[i] * (i == j)
            S[a][a] -= m
        return S

    # ------------------------------------------------------------------ spectrum

    @cached_property
    def slowest(self) -> Any:
        """The smallest real part of the nonzero eigenvalues, an arb; None without one."""
        matrix = flint.fmpq_mat([[flint.fmpq(x.numerator, x.denominator) for x in row] for row in self.L])
        polynomial = (matrix.charpoly() * math.lcm(*(x.denominator for row in self.L for x in row)) ** self.n).numer()
        parts = [root.real for root, _ in polynomial.complex_roots() if not root.contains(0)]
        return min(parts, key=lambda part: float(part.mid())) if parts else None

    def rates(self) -> None:
        said, functions = self.data["rates"], self.data["decays"]
        known = [(number(m["rate"]), m["class"]) for m in functions]
        for key, kinds in (("diagonal", ("perron", "lmi")), ("proved", None), ("paper", ("paper",))):
            best = max((r for r, kind in known if r > 0 and (kinds is None or kind in kinds)), default=None)
            self.require((number(said[key]) if key in said else None) == best, f"rates.{key}")
        if "upper_bound" in said:
            self.require(self.slowest is not None and not ball(said["upper_bound"]) < 2 * self.slowest, "rates.limit")
        if (overshoot := self.data.get("overshoot")) is not None:
            fits = [
                m
                for m in functions
                if m["rate"]
                and number(m["rate"]) == number(said.get("proved", "0"))
                and number(m["overshoot"]) <= number(overshoot["value"])
                and f"||{m['coordinates']}||^2" == overshoot["of"]
            ]
            self.require(fits, "overshoot")

    # ------------------------------------------------------------------ sliding variables

    def reaching(self) -> None:
        said, g = self.data.get("reaching_time"), self.gains
        if said is None:
            self.require("mu1" not in g, "reaching times")
            return
        for s, z in zip(self.sigma0, (said["z"][label] for label in self.labels), strict=True):
            if z is not None and s:
                pushed = (g["mu1"] - g["delta"]) * Fraction(self.integral(float(number(z)), *map(float, self.reach)))
                self.require(abs(s) <= pushed * (1 + Fraction(1, 10**8)), "a reaching time")
            elif z is not None:
                self.require(number(z) == 0, "a reaching time of 0")

    @property
    def reach(self) -> tuple[Fraction, Fraction, Fraction]:
        g = self.gains
        return g["T_r"], g["mu2"], g["mu3"] * g["kappa"]

    @staticmethod
    @lru_cache(maxsize=10_000)
    def integral(z: float, T: float, mu: float, m: float) -> float:
        """``int_0^t dr / psi(r)`` up to ``z = ln(T/(T - t))``: ``T int_0^z e^(mu T (1 - e^-y)) e^((m - 1) y) dy``."""
        x, w = np.polynomial.legendre.leggauss(40)
        ends = np.linspace(0, min(z, 600.0), 41)
        total = 0.0
        for a, b in pairwise(ends):
            y = (a + b) / 2 + (b - a) / 2 * x
            total += (b - a) / 2 * float(w @ np.exp(np.minimum(mu * T * -np.expm1(-y) + (m - 1) * y, 700)))
        return min(T * total, 1e300)

    # ------------------------------------------------------------------ input

    @cached_property
    def gains(self) -> dict[str, Fraction]:
        said = self.data["problem"]["gain"]
        return {key: number(x) for key, x in said.items() if key not in ("kind", "disturbance")}

    @cached_property
    def gain(self) -> tuple[Fraction, Fraction, Fraction]:
        """``T``, ``rho1``, ``k = rho2 kappa``."""
        g = self.gains
        return g["T"] if "T" in g else g["T_r"] + g["T_s"], g["rho1"], g["rho2"] * g["kappa"]

    def motion(self, s: float) -> np.ndarray:
        """``exp(-L s)``."""
        return motions(self.key, s)[0]

    def decaying(self, s: float) -> np.ndarray:
        """``L exp(-L s)``."""
        return motions(self.key, s)[1]

    @cached_property
    def latest(self) -> float:
        return LATEST / max(float(abs(x)) for row in self.L for x in row)

    @property
    def from_known(self) -> bool:
        return "mu1" not in self.gains or not any(self.sigma0)

    def states(self, initial_set: Any) -> np.ndarray:
        """Starts of the set, one a column: corners of a box, points of an ellipsoid's boundary."""
        rng = np.random.default_rng(0)
        own = np.array([float(x) for x in self.sigma0])
        if initial_set is None:
            return np.array([[float(x) for x in self.start or ()]]).T - own[:, None]
        center = np.array([float(x) for x in self.vector(initial_set["center"])])
        if "radius" in initial_set:
            radius = np.array([float(x) for x in self.vector(initial_set["radius"])])
            signs = rng.choice([-1.0, 1.0], (self.n, 64))
            return center[:, None] + radius[:, None] * signs - own[:, None]
        axes = np.array([[float(x) for x in self.vector(axis)] for axis in initial_set["axes"]]).T
        v = rng.normal(size=(axes.shape[1], 64)) if axes.size else np.zeros((0, 1))
        spread = axes @ (v / np.maximum(np.linalg.norm(v, axis=0), 1e-300)) if axes.size else 0
        return center[:, None] + spread - own[:, None]

    @cached_property
    def sampled(self) -> list[tuple[float, float, float, np.ndarray]]:
        """``z``, gain, ``s`` and the inputs of the nominal part, one start a column."""
        T, rho1, k = map(float, self.gain)
        X, found = self.states(self.data["input"].get("initial_set")), []
        for z in INSTANTS:
            s, gain = rho1 * T * -math.expm1(-z) + k * z, rho1 + k / T * math.exp(z)
            if s > self.latest:
                break
            found.append((z, gain, s, -gain * (self.decaying(s) @ X)))
        return found

    def bounds(self, said: Any, seen: float, claim: str, share: float = SLACK) -> None:
        """A bound is not below what was seen."""
        if math.isfinite(seen):
            self.require(number(said) >= Fraction(seen) * (1 - Fraction(share)), f"{claim}: {said} below {seen!r}")

    def effort(self) -> None:
        said = self.data.get("input")
        if said is None:
            return
        k, slowest = self.gain[2], self.slowest
        ends = said["threshold"]
        if slowest is not None:
            low, high = ends.get("lower"), ends.get("upper")
            self.require(low is None or not ball(low) > slowest * ball(k), "threshold: lower")
            self.require(high is None or not ball(high) < slowest * ball(k), "threshold: upper")
            if "bounded" in said and not (slowest * ball(k)).overlaps(flint.arb(1)):
                self.require(said["bounded"] is bool(slowest * ball(k) > 1), "bounded")
        for known, (_, P, _, nodes) in zip(said["constants"], self.forms, strict=True):
            for v, c in enumerate(self.vector(known) if known is not None else ()):
                e = [Fraction(int(u == v)) for u in nodes]
                S = [[c * x - a * b for x, b in zip(row, e, strict=True)] for row, a in zip(P, e, strict=True)]
                self.require(c >= 0 and semidefinite(S), "a constant")
        if (own := said.get("sliding")) is not None:
            g = self.gains
            self.require(own["bounded"] is (g["mu3"] * g["kappa"] >= 1), "sliding: bounded")
            push = g["mu2"] + g["mu3"] * g["kappa"] / g["T_r"]
            for s, x in zip(self.sigma0, self.vector(own["agents"]) if "agents" in own else [], strict=False):
                self.require(x >= g["mu1"] + push * abs(s), "sliding: agents")
        if self.from_known and ("initial_set" in said or self.start is not None) and self.n <= 60:
            self.sizes(said)
        for entry in said["residual"]:
            self.limited(entry, said)
        if "disturbed" in said:
            self.disturbed(said["disturbed"])

    def sizes(self, said: Json) -> None:
        if "peak" in said:
            agents = said["peak"]["agents"]
            self.require(number(said["peak"]["largest"]) == max(map(number, agents.values())), "the largest peak")
            for z, _, _, u in self.sampled:
                for label, row in zip(self.labels, np.abs(u), strict=True):
                    self.bounds(agents[label], float(row.max()), f"peak of {label} at z = {z}")
                self.bounds(
                    said["peak"]["norm"], float(np.linalg.norm(u, axis=0).max()), f"peak of the norm at z = {z}"
                )
        # int ||gain E||^2 dt = int gain ||E||^2 ds, and int ||gain E|| dt = int ||E|| ds: Gauss over pieces of z.
        for key, power in (("energy", 2), ("path_length", 1)):
            if key in said:
                seen = self.integrated(power).max()
                self.bounds(said[key], float(seen), key, 1e-6)

    def integrated(self, power: int) -> np.ndarray:
        T, rho1, k = map(float, self.gain)
        X = self.states(self.data["input"].get("initial_set"))
        x, w = np.polynomial.legendre.leggauss(4)
        total = np.zeros(X.shape[1])
        for a, b in pairwise((0.0, 0.1, 0.3, 0.7, 1.5, 3.0, 6.0)):
            for y, weight in zip((a + b) / 2 + (b - a) / 2 * x, (b - a) / 2 * w, strict=True):
                gain, s = rho1 + k / T * math.exp(y), rho1 * T * -math.expm1(-y) + k * y
                if s > self.latest:
                    return total * 0.9
                norm = np.linalg.norm(self.decaying(s) @ X, axis=0)
                total += weight * T * math.exp(-y) * (gain * norm) ** power  # dt = T e^(-z) dz
        # What a piece of four nodes misses is not claimed: the integrand is smooth, but steep for large rates.
        return total * 0.9

    def limited(self, said: Json, effort: Json) -> None:
        T, rho1, k = map(float, self.gain)
        cap, stop, period = (
            float(number(said[x])) if x in said else None for x in ("gain_cap", "stop_before", "sample_period")
        )
        end = T - (stop or 0)
        top = [] if cap is None else [cap]
        if period is not None:
            top.append(rho1 + k / (T - period * (math.ceil(end / period * (1 - 1e-12)) - 1)))
        elif stop is not None:
            top.append(rho1 + k / stop)
        g = min(top)
        turn = min(T - k / (g - rho1), end) if g > rho1 + k / T else 0.0
        clock = (rho1 * turn + k * math.log(T / (T - turn)) if turn > 0 else 0.0) + g * (end - max(turn, 0.0))
        self.require(number(said["clock"]) <= Fraction(clock) * (1 + Fraction(1, 10**9)), "clock")
        X, L = self.states(effort.get("initial_set")), np.array([[float(x) for x in row] for row in self.L])
        if period is None and clock > self.latest:
            return
        if period is None:
            moved, fading = self.motion(clock), self.decaying(clock)
            final = fading @ X
            self.bounds(said["norm"], float(np.linalg.norm(final, axis=0).max()), "what is left")
            if "agents" in said:
                away = np.abs(moved @ X - np.array([[float(x) for x in row] for row in self.Q]) @ X).max(axis=1)
                for label, seen in zip(self.labels, away, strict=True):
                    self.bounds(said["agents"][label], float(seen), "what is left of an agent", 1e-6)
            for z, gain, _, u in self.sampled:
                if T * math.exp(-z) >= (stop or 0):
                    self.bounds(
                        said["largest"], float(np.abs(u).max() / gain * min(gain, g)), f"largest at z = {z}", 1e-6
                    )
            if "noise" in said:
                n = float(number(said["noise"]["bound"])) * np.random.default_rng(1).choice([-1.0, 1.0], X.shape)
                final = fading @ (X + n) - L @ n  # of constant noise n: x + n moves as x does without
                self.bounds(said["noise"]["norm"], float(np.linalg.norm(final, axis=0).max()), "noise", 1e-6)
        elif end / period < 3000:
            x, left = X, 0.0
            for _ in range(math.ceil(end / period * (1 - 1e-12))):
                step = min(period, end - left)
                x = x - step * min(rho1 + k / (T - left), g) * (L @ x)
                left += step
            self.bounds(said["norm"], float(np.linalg.norm(L @ x, axis=0).max()), "what sampling leaves", 1e-6)

    def disturbed(self, said: Json) -> None:
        T, _, _ = self.gain
        delta = number(said["delta"])
        if "drift" in said:
            for x, row in zip(self.vector(said["drift"]), self.Q, strict=True):
                self.require(x >= delta * T * sum(map(abs, row), Fraction(0)), "drift")
        # A constant disturbance d: what it adds to the input is -gain L int exp(-L (s(t) - s(r))) d dr.
        T, rho1, k = map(float, self.gain)
        d = float(delta) * np.random.default_rng(2).choice([-1.0, 1.0], (self.n, 16))
        inputs, x, w = self.vector(said["inputs"]), *np.polynomial.legendre.leggauss(8)
        for z in (0.5, 2.0, 5.0):
            s = rho1 * T * -math.expm1(-z) + k * z
            if s > self.latest:
                break
            moved = np.zeros_like(d)
            for a, b in pairwise(np.linspace(0, z, 5)):
                for y, weight in zip((a + b) / 2 + (b - a) / 2 * x, (b - a) / 2 * w, strict=True):
                    before = rho1 * T * -math.expm1(-y) + k * y
                    moved += weight * T * math.exp(-y) * (self.decaying(s - before) @ d)
            seen = np.abs((rho1 + k / T * math.exp(z)) * moved).max(axis=1)
            for label, bound, size in zip(self.labels, inputs, seen, strict=True):
                self.require(bound >= Fraction(float(size)) * Fraction(99, 100), f"disturbed input of {label}")


def ball(x: str | Fraction) -> Any:
    """A rational as a ball."""
    x = number(x) if isinstance(x, str) else x
    return flint.arb(flint.fmpq(x.numerator, x.denominator))


@lru_cache(maxsize=4000)
def motions(L: tuple[tuple[Fraction, ...], ...], s: float) -> tuple[np.ndarray, np.ndarray]:
    """``exp(-L s)`` and ``L exp(-L s)`` by balls, rounded to floats at the end: what decays is small, and not lost."""
    before = flint.ctx.prec
    flint.ctx.prec = 200 + int(4 * s * max(float(abs(x)) for row in L for x in row))
    try:
        matrix = flint.arb_mat([[ball(x) for x in row] for row in L])
        found = (matrix * -ball(Fraction(s))).exp()
        both = found, matrix * found
        return tuple(np.array([[float(m[i, j].mid()) for j in range(len(L))] for i in range(len(L))]) for m in both)
    finally:
        flint.ctx.prec = before
