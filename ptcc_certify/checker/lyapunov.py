"""Verifies Lyapunov functions: the paper's own, the sharper ones, their rates and prefactors, and what limits rates."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from operator import mul
from typing import Any

from lmi.exact.definite import SparseFactor
from lmi.exact.rounding import down, up
from lmi.exact.work import fits, spend
from ptcc_certify.checker.input_bounds import Form
from ptcc_certify.checker.outcome import OutcomeCheck
from ptcc_certify.checker.reading import (
    entries,
    exact,
    fields,
    integers,
    longest,
    need,
    same,
    short,
    sized,
    triangle,
)
from ptcc_certify.checker.vectors import Numbers, beside

Matrix = list[list[int]]
ZERO = Fraction(0)
#: Above so many entries, a quarter of them not 0, products with ``L`` are formed as those of dense matrices.
DENSE_SIZE = 400
Sparse = list[dict[int, int]]
Row = tuple[str, str, list[tuple[str, list[int], bool]]]

#: Products of entries up to which sparse matrices are multiplied, and entries of one that are kept.
LARGEST_PRODUCT, LARGEST_KEPT = 50_000_000, 3_000_000
#: Entries of the factor of a leader group, and of the matrix that it is of.
LARGEST_FACTOR, LARGEST_FORM = 2_000_000, 700_000
#: Lyapunov functions that are read.
MANY_MEMBERS = 100


class LyapunovCheck(OutcomeCheck):
    """Every claim about decay."""

    # ------------------------------------------------------------------ matrices

    def _block(self, nodes: Sequence[int]) -> Matrix:
        """Return rows and columns of ``L``, times unit."""
        return [[row.get(j, 0) for j in nodes] for row in map(self.digraph.row, nodes)]

    def _state_form(self, P: Mapping[int, Mapping[int, int]]) -> Matrix:
        """Return ``L'P L``: the form ``E'P E`` in the state, times unit squared."""
        self._bounded_size(self.n)
        bits, own = longest(x for row in P.values() for x in row.values()), self.digraph.bits
        sized(self.n**2, bits + 2 * own, "L'P L")
        spend(sum(len(self.digraph.row(b)) for row in P.values() for b in row), bits, own, "L'P L")
        spend(sum(len(self.digraph.row(a)) for a in P) * self.n, bits + own, own, "L'P L")
        if self._dense:
            kept = sorted({b for row in P.values() for b in row})
            L = {v: [self.digraph.row(v).get(j, 0) for j in range(self.n)] for v in {*P, *kept}}
            PL = self.exact.product([[row.get(b, 0) for b in kept] for row in P.values()], [L[b] for b in kept])
            return self.exact.product([list(x) for x in zip(*(L[a] for a in P), strict=True)], PL) if P else []
        F = [[0] * self.n for _ in range(self.n)]
        for a, row in P.items():
            moved = [0] * self.n
            for b, weight in row.items():
                for j, x in self.digraph.row(b).items():
                    moved[j] += weight * x
            for i, x in self.digraph.row(a).items():
                F[i] = [f + x * y for f, y in zip(F[i], moved, strict=True)]
        return F

    @cached_property
    def _dense(self) -> bool:
        """Whether products with ``L`` are formed as those of dense matrices."""
        return 4 * sum(len(self.digraph.row(v)) for v in range(self.n)) > self.n**2 > DENSE_SIZE

    def _decrease(self, F: Matrix, b: Fraction, nodes: Sequence[int]) -> Matrix:
        """Return ``F L + L'F - b F`` on some nodes, times a positive integer; ``F`` is symmetric."""
        moved, L = [], [self.digraph.row(v) for v in range(self.n)]
        p, q = (b * self.digraph.unit).as_integer_ratio()
        bits, own, ratio = longest(x for row in F for x in row), self.digraph.bits, longest((p, q))
        sized(self.n**2, bits + own + ratio, "F L + L'F - b F")
        spend(self.n * sum(map(len, L)), bits, own, "F L + L'F - b F")
        spend(2 * len(nodes) ** 2, bits + own, ratio, "F L + L'F - b F")
        if self._dense:
            moved = self.exact.product(F, [[row.get(j, 0) for j in range(self.n)] for row in L])
        for row in () if self._dense else F:
            product = [0] * self.n
            for x, laplacian in zip(row, L, strict=True):
                if x:
                    for j, y in laplacian.items():
                        product[j] += x * y
            moved.append(product)
        return [[q * (moved[i][j] + moved[j][i]) - p * F[i][j] for j in nodes] for i in nodes]

    def _margin(self, S: Sequence[Sequence[Fraction]], m: Fraction) -> bool:
        """Tell whether ``S - m I > 0`` is proved."""
        rows, scale = integers(S)
        p, q = (m * scale).as_integer_ratio()
        return self.exact.definite([[q * x - p * (i == j) for j, x in enumerate(row)] for i, row in enumerate(rows)])

    # ------------------------------------------------------------------ the paper's own certificate

    def _row(self) -> Row:
        """Return objective, coordinates and blocks of the theorem's row."""
        family, balanced = int(self.theorem[0]), self.theorem.endswith("1")
        row, F = family - 3 if self.is_sliding else family, self.followers
        groups = [(k, group) for k, group in enumerate(self.closed, start=1) if len(group) > 1]
        if not self.moving:
            return "none: every agent keeps its state", "eps" if row == 1 else "E", []
        if row == 1:
            if balanced:
                return "2 a(L)", "eps", [("P", self.closed[0], False)]
            return "lmin(Omega L + L' Omega) / lmax(Omega)", "E", [("Omega", self.closed[0], False)]
        if balanced and not groups:
            letter = "Xi_F" if row == 2 else "H_F"
            return f"lmin({letter} L_F + L_F' {letter}) / lmax({letter})", "E", [(letter, F, False)]
        if row == 2:
            name, objective = ("Xi_L", "lmin(Phi) / lmax(Xi)") if balanced else ("Xit_L", "lmin(Psi) / lmax(Xit)")
            return objective, "E", [(name, groups[0][1], False), ("Xi_F", F, True)]
        letter, objective = (
            ("H_", "lmin(Pi) / lmax(H)") if balanced else ("Theta_L", "lmin(Theta L + L' Theta) / lmax(Theta)")
        )
        last = [("H_F" if balanced else "Theta_F", F, True)] if F else []
        return objective, "E", [(f"{letter}{k}", group, False) for k, group in groups] + last

    def paper(self) -> None:
        """Verify the certificate of the theorem's row as the paper has it."""
        self.at, said = "paper", self.data["paper"]
        self.paper_rate: Fraction | None = None
        if said is None:
            return
        keys = ("theorem", "objective", "coordinates", "blocks", "rho", "rho_interval", "rate", "prefactor")
        self._bounded_size(self.n)
        said, (objective, coordinates, expected) = fields(said, keys, "paper"), self._row()
        need(said["theorem"] == self.theorem and said["objective"] == objective, "another theorem or objective")
        need(said["coordinates"] == coordinates, "other coordinates")
        self.blocks: list[tuple[str, list[int], list[Fraction], bool]] = []
        for entry, (name, nodes, times_rho) in zip(
            entries(said["blocks"], "blocks", len(expected)), expected, strict=True
        ):
            fields(entry, ("name", "nodes", "diagonal", "times_rho"), "a block")
            need(entry["name"] == name and entry["times_rho"] is times_rho, "another block")
            need(self._numbers(entry["nodes"], "nodes of a block") == nodes, "nodes of a block")
            weights = [exact(w) for w in entries(entry["diagonal"], "diagonal", len(nodes))]
            need(all(w > 0 for w in weights), "a weight is not positive")
            self.blocks.append((name, nodes, weights, times_rho))
        need((said["rho"] is not None) == any(b[3] for b in self.blocks), "rho belongs to a block times rho")
        self.rho = Fraction(1) if said["rho"] is None else exact(said["rho"])
        need(self.rho > 0, "rho is not positive")
        self.weights = {v: w * (self.rho if b[3] else 1) for b in self.blocks for v, w in zip(b[1], b[2], strict=True)}
        if not self.blocks:
            need(said["rate"] is None and said["prefactor"] is None, "a rate where nothing moves")
        else:
            need(exact(said["prefactor"]) == max(self.weights.values()) / min(self.weights.values()), "prefactor")
        if said["rate"] is None:
            need(said["rho_interval"] is None, "an interval without a proof")
            return
        self.paper_rate = exact(said["rate"])
        need(self.paper_rate > 0, "the rate is not positive")
        if coordinates == "eps":
            b = self.open("deviation-decrease", "paper", ["b"])["b"]
            need(b == self.paper_rate, "b is not the rate")
            self._null_vector(*self.blocks[0][1:3])
            need(self.exact.definite(self._decrease(self._deviation()[0], b, self.kept)), "not proved definite")
            need(said["rho_interval"] is None, "an interval without rho")
            self.done(f"b = {down(b)}")
            return
        gamma = self._leaders() if self.theorem in ("2.1", "3.1", "5.1", "6.1") else None
        numbers = self.open("margin", "paper", ["m"] if said["rho"] is None else ["m", "rho"])
        need(numbers.get("rho", self.rho) == self.rho, "another rho")
        need(self._margin(self._coupled(gamma, self.rho), numbers["m"]), "not proved definite")
        need(self.paper_rate == numbers["m"] / max(self.weights.values()), "the rate is not m / largest weight")
        self.done(f"m = {down(numbers['m'])}, rate {down(self.paper_rate)}")
        self._interval(gamma)

    def _deviation(self) -> tuple[Matrix, Fraction]:
        """Return ``Z = G (P - p p'/p'1) G``, whose form is ``eps'P eps``, times a scale, and the scale."""
        self._bounded_size(self.n)
        (_, nodes, p, _), gauge = self.blocks[0], self.gauges[0] or []
        bits = 2 * _length(p)
        spend(4 * len(nodes) ** 2, bits, bits, "deviations")
        sized(len(nodes) ** 2, 2 * bits, "deviations")
        total, n = sum(p), len(nodes)
        Z = [[gauge[i] * gauge[j] * (total * p[i] * (i == j) - p[i] * p[j]) for j in range(n)] for i in range(n)]
        form, scale = integers(Z)
        return form, Fraction(total * scale)

    def _leaders(self) -> dict[int, Fraction]:
        """Verify the decrease of each leader block; return the diagonal of Gamma."""
        gamma: dict[int, Fraction] = {}
        for name, nodes, weights, times_rho in self.blocks:
            if times_rho or nodes == self.followers:
                continue
            if self.gauges[self.closed.index(nodes)] is None:
                m = self.open("leader-margin", f"paper.{name}", ["m"])["m"]
                need(m > 0 and self._margin(self._lyapunov(nodes, weights), m), "not proved definite")
                gamma.update(dict.fromkeys(nodes, m))
                self.done(f"m = {down(m)}")
                continue
            b = self.open("leader-decrease", f"paper.{name}", ["b"])["b"]
            self._null_vector(nodes, weights)
            S = self._group_decrease(nodes, weights, b, range(1, len(nodes)))
            need(b > 0 and self.exact.definite(S), "not proved definite")
            least = min(weights)
            phi = self.theorem in ("2.1", "5.1")
            gamma.update({v: b * (w if phi else least) for v, w in zip(nodes, weights, strict=True)})
            self.done(f"b = {down(b)}")
        return gamma

    def _null_vector(self, nodes: Sequence[int], p: Sequence[Fraction]) -> None:
        """Verify ``p' M(L_k) = 0`` up to a part in 10^9 of each diagonal term, as the paper's formula asks."""
        (scaled,), _ = integers([list(p)])
        weight = dict(zip(nodes, scaled, strict=True))
        spend(2 * sum(len(self.digraph.row(v)) for v in nodes), self.digraph.bits, longest(scaled), "left null vectors")
        L = {v: self.digraph.row(v) for v in nodes}
        left = {v: weight[v] * L[v][v] for v in nodes}
        for v in nodes:
            for j, x in L[v].items():
                if j != v:
                    left[j] -= weight[v] * abs(x)
        near = all(abs(left[v]) * 10**9 <= weight[v] * L[v][v] for v in nodes)
        need(near, "the weights are not the left null vector of the comparison matrix")

    def _lyapunov(self, nodes: Sequence[int], weights: Sequence[Fraction]) -> list[list[Fraction]]:
        """Return ``W A + A'W`` on some rows of ``L``."""
        self._bounded_size(len(nodes))
        A, bits = self._block(nodes), 2 * _length(weights) + self.digraph.bits
        sized(len(nodes) ** 2, bits + self.digraph.unit.bit_length(), "W A + A'W")
        spend(4 * len(nodes) ** 2, bits, bits, "W A + A'W")
        (own,), scale = integers([weights])
        scale *= self.digraph.unit
        return [
            [Fraction(own[i] * x + own[j] * A[j][i], scale) if x or A[j][i] else ZERO for j, x in enumerate(row)]
            for i, row in enumerate(A)
        ]

    def _coupled(self, gamma: dict[int, Fraction] | None, rho: Fraction) -> list[list[Fraction]]:
        """Return the matrix of the row at some rho: ``W A + A'W``, with Gamma in place of the leaders' block."""
        nodes = [v for block in self.blocks for v in block[1]]
        weights = [w * (rho if block[3] else 1) for block in self.blocks for w in block[2]]
        S = self._lyapunov(nodes, weights)
        for i, v in enumerate(nodes):
            if gamma and v in gamma:
                for j, u in enumerate(nodes):
                    if u in gamma:
                        S[i][j] = gamma[v] * (i == j)
        return S

    def _interval(self, gamma: dict[int, Fraction] | None) -> None:
        said = self.data["paper"]["rho_interval"]
        self.at = "rho-interval of paper"
        if self.data["paper"]["rho"] is None:
            need(said is None, "an interval without rho")
            return
        said = fields(said, ("printed", "exact"), "rho_interval")
        ends = {key: exact(value) for key, value in said.items() if value is not None}
        need(len(ends) != 1, "one end without the other")
        if not ends:
            leading = {v for block in self.blocks if not block[3] for v in block[1]}
            free = all(j not in leading for v in self.followers for j in self.digraph.row(v))
            need(free, "rho is bounded, since followers listen to these leaders")
            return
        need(self.open("rho-interval", "paper", list(ends)) == {**ends, "witness": None}, "other ends")
        need(ends.get("printed", 0) <= ends.get("exact", math.inf), "the ends are in the wrong order")
        for end in ends.values():
            need(end > 0 and self._margin(self._coupled(gamma, end), Fraction(0)), "an end is not proved admissible")
        need(self.rho <= ends.get("exact", math.inf), "rho lies beyond the interval")
        self.done(", ".join(f"{key} end {down(end)}" for key, end in ends.items()))

    # ------------------------------------------------------------------ the envelope

    def members(self) -> None:
        """Verify every Lyapunov function of the envelope."""
        self.at = "lyapunov"
        members = entries(fields(self.data["lyapunov"], ("members",), "lyapunov")["members"], "members")
        self.found: list[tuple[Fraction, Fraction, str, str]] = []  # rate, prefactor, class, coordinates
        self.forms: list[Form | None] = []  # None: by rows, in a large graph
        self.proved: set[tuple[int, Fraction, tuple[int, ...]]] = set()  # group, its rate and weights
        need(len(members) <= MANY_MEMBERS, f"more than {MANY_MEMBERS} Lyapunov functions")
        need(self.paper_rate is None or bool(members), "the paper's certificate is not among the members")
        need(bool(self.moving) or not members, "a Lyapunov function where nothing moves")
        for k, member in enumerate(members):
            self.at = of = f"lyapunov.members[{k}]"
            keys = ("coordinates", "blocks", "rho", "rate", "prefactor")
            fields(member, ("class", *keys, "distance"), "a member")
            if k == 0 and self.paper_rate is not None:
                paper = self.data["paper"]
                equal = all(same(member[key], paper[key]) for key in keys) and member["class"] == "paper"
                need(equal, "the first member is not the paper's certificate")
                self.found.append((self.paper_rate, exact(paper["prefactor"]), "paper", paper["coordinates"]))
                own = list(self.weights.values())
                self.forms.append(
                    Form(
                        self.paper_rate,
                        paper["coordinates"],
                        list(self.weights),
                        own,
                        None,
                        min(own),
                        self.gauges[0] or [],
                    )
                )
                if paper["coordinates"] == "eps":
                    form, scale = self._deviation()
                else:
                    form, scale = self._weighted(self.weights)
            else:
                form, scale = self._sharp(member, of)
            if member["distance"] is not None:
                need(bool(form), "a distance without a form")
                self._distance(member["distance"], form, scale, of)

    def _weighted(self, weights: Mapping[int, Fraction]) -> tuple[Matrix, Fraction]:
        """Return ``E'W E`` as a form of the state, times a scale, and the scale."""
        (scaled,), scale = integers([list(weights.values())])
        form = self._state_form({v: {v: x} for v, x in zip(weights, scaled, strict=True)})
        return form, Fraction(scale * self.digraph.unit**2)

    def _sharp(self, member: dict[str, Any], of: str) -> tuple[Matrix, Fraction]:
        """Verify rate and prefactor of a sharper Lyapunov matrix; return its form in the state and the scale."""
        kind = member["class"]
        need(kind in ("perron", "lmi", "full"), "an unknown class")
        need(member["coordinates"] == "E" and member["rho"] is None, "other coordinates, or a rho")
        (block,) = entries(member["blocks"], "blocks", 1)
        shape = "lower_triangle" if kind == "full" else "diagonal"
        fields(block, ("name", "nodes", shape, "times_rho"), "a block")
        need(block["name"] == "P" and block["times_rho"] is False, "another block")
        nodes = self._numbers(block["nodes"], "nodes of a block", len(self.moving))
        need(sorted(nodes) == self.moving, "nodes of a block")
        rate = exact(member["rate"])
        if kind == "full":
            self._bounded_size(len(nodes))
            rows = triangle(block[shape], len(nodes))
            P, common = integers(rows)
            named = {v: dict(zip(nodes, row, strict=True)) for v, row in zip(nodes, P, strict=True)}
            form, scale = self._state_form(named), Fraction(common * self.digraph.unit**2)
        else:
            dominates = self.following() == "dominance"
            need(dominates or not beside(block[shape]), "a side vector where it has no place")
            diagonal = self.files.numbers(block[shape], shape, len(nodes))
            need(diagonal.positive(), "a weight is not positive")
            low, high = (Fraction(end(diagonal.values)) / (diagonal.scale or 1) for end in (min, max))
            if dominates:
                self._dominance(nodes, diagonal, rate, of)
                need(exact(member["prefactor"]) == high / low, "the prefactor is another")
                self.found.append((rate, high / low, kind, "E"))
                self.forms.append(None)
                return [], Fraction(1)
            weights = list(diagonal)
            form, scale = self._weighted(dict(zip(nodes, weights, strict=True)))
        need(self.open("rate", of, ["b"])["b"] == rate, "b is not the rate")
        need(self.exact.definite(self._decrease(form, rate, self.kept)), "not proved definite")
        self.done(f"b = {down(rate)}, class {kind}")
        if kind == "full":
            ends = self.open("prefactor", of, ["lowest", "highest"])
            low, high = ends["lowest"], ends["highest"]
            need(low > 0 and self._margin(rows, low), "the lower end is not proved")
            need(self._margin([[-x for x in row] for row in rows], -high), "the upper end is not proved")
            need(low <= high, "the ends are in the wrong order")
            self.done(f"at most {up(high / low)}")
        need(exact(member["prefactor"]) == high / low, "the prefactor is another")
        self.found.append((rate, high / low, kind, "E"))
        full = kind == "full"
        self.forms.append(Form(rate, "E", nodes, None if full else weights, rows if full else None, low))
        return form, scale

    def _dominance(self, nodes: Sequence[int], weights: Numbers, rate: Fraction, of: str) -> None:
        """Verify a diagonal matrix row by row: ``S_ii d_i > sum_j |S_ij| d_j``, after each leader group by itself."""
        step = self.open("dominance", of, ["b"], witness=True)
        need(step["b"] == rate, "b is not the rate")
        said = fields(step["witness"], ("vector", "groups"), "the witness")
        vector = self.files.numbers(said["vector"], "vector", len(nodes))
        need(vector.positive(), "the vector is not positive")
        (own, scale), (each, _) = (numbers.over(range(len(nodes))) for numbers in (weights, vector))
        W, D = [0] * self.n, [0] * self.n
        for v, w, d in zip(nodes, own, each, strict=True):
            W[v], D[v] = w, d
        groups = [k for k, group in enumerate(self.closed) if len(group) > 1]
        known = {  # g_k of leader groups
            k: self._group(k, [W[v] for v in self.closed[k]], scale, entry)
            for k, entry in zip(groups, entries(said["groups"], "groups", len(groups)), strict=True)
        }
        # w_i d_i times rate, less what the others push, times q and unit
        p, q = (rate * self.digraph.unit).as_integer_ratio()
        spare = {k: ((g - rate) * self.digraph.unit).as_integer_ratio() for k, g in known.items()}
        bits = longest((p, q, *(x for pair in spare.values() for x in pair))) + self.digraph.bits
        if bits > 1000:
            spend(5 * len(nodes), bits, longest(W) + longest(D), "rows")
        heard, diagonal = self.digraph.heard(D), self.digraph.diagonal
        pushes = [0 if k >= 0 else w * d for k, w, d in zip(self.number, W, D, strict=True)]
        pushed = self.digraph.hearing(pushes)
        for v in nodes:
            if self.number[v] < 0:
                left = (2 * q * diagonal[v] - p) * pushes[v] - q * (W[v] * heard[v] + pushed[v])
            else:
                top, bottom = spare[self.number[v]]
                left = top * W[v] * D[v] - bottom * pushed[v]
            need(left > 0, "a row is not dominated by its diagonal")
        self.done(f"b = {down(rate)}, {len(nodes)} rows")

    def _group(self, k: int, weights: Sequence[int], scale: int, said: Any) -> Fraction:
        """Verify the decay of a leader group by itself, once for all multiples of its weights; return its rate."""
        if isinstance(said, dict):
            fields(said, ("rate", "factor"), "a leader group")
        g, common = exact(said["rate"] if isinstance(said, dict) else said), math.gcd(*weights)
        key = k, g, tuple(w // common for w in weights)
        if key in self.proved:
            need(not isinstance(said, dict), "a factor of a leader group that is proved already")
            return g
        group, balanced = self.closed[k], self.gauges[k] is not None
        if isinstance(said, dict):
            self._factor(said["factor"], group, Fraction(common, scale), key[2], g, self.gauges[k])
        else:
            S = self._group_decrease(group, [Fraction(w) for w in key[2]], g, range(balanced, len(group)))
            need(self.exact.definite(S), "a leader group is not proved")
        self.proved.add(key)
        return g

    def _factor(
        self,
        said: Any,
        group: Sequence[int],
        times: Fraction,
        ratios: Sequence[int],
        g: Fraction,
        gauge: Sequence[int] | None,
    ) -> None:
        """Verify the decay of a leader group, of weights ``times ratios``, by the sparse factor of its form."""
        keys = ("order", "indptr", "indices", "data", "exponents", "bits", "power", "weights", "parents")
        said, read = fields(said, keys, "factor"), self.files.integers
        n = len(group) - (gauge is not None)
        need(type(said["bits"]) is int and type(said["power"]) is int, "bits or power is no integer")
        order, exponents, indptr = (
            read(said[key], key, count) for key, count in (("order", n), ("exponents", n), ("indptr", n + 1))
        )
        vector = None if said["weights"] is None else read(said["weights"], "weights", n)
        few = 0 <= indptr[-1] <= n * (n + 1) // 2 and fits(indptr[-1], LARGEST_FACTOR)
        need(few, "the factor has too many entries")
        work = sum((b - a) ** 2 for a, b in pairwise(indptr))
        need(work <= self.exact.products, f"a factor of {work} products; {self.exact.name} takes {self.exact.products}")
        columns = indptr, *(read(said[key], key, indptr[-1]) for key in ("indices", "data"))
        A = self._sparse_block(group)
        basis = None
        if said["parents"] is not None:
            need(gauge is not None, "parents of a group that is not balanced")
            basis = self._differences(A, ratios, gauge or (), read(said["parents"], "parents", len(group)))
        elif gauge is not None:
            basis = [{j - 1: x for j, x in row.items() if j} for row in A]
        lower, scale = self._group_form(A, [times.numerator * w for w in ratios], g, basis)
        if gauge is not None and said["parents"] is None:
            scale *= self.digraph.unit**2
        scale *= times.denominator
        factor = SparseFactor(order, *columns, exponents, said["bits"], vector)
        proved = self.exact.residual_definite(n, lower, factor, said["power"], scale)
        need(proved, "a leader group is not proved by its factor")

    def _sparse_block(self, group: Sequence[int]) -> Sparse:
        """Return the rows of ``L_k``, times unit."""
        place = {v: i for i, v in enumerate(group)}
        return [{place[j]: x for j, x in self.digraph.row(v).items()} for v in group]

    def _differences(self, A: Sparse, w: Sequence[int], gauge: Sequence[int], parents: Sequence[int]) -> Sparse:
        """Return a basis of all ``y`` with ``eta'y = 0``, ``eta = G w``, which contain the range of ``A``, by rows.

        One column ``w_q G_i e_i - w_i G_q e_q`` for each node ``i`` but the root of a tree, ``q`` its parent.
        """
        n = len(A)
        kept = [0] * n
        for i, row in enumerate(A):
            for j, x in row.items():
                kept[j] += gauge[i] * w[i] * x
        need(not any(kept), "the weights are not a left null vector")
        need(min(parents) == -1 and parents.count(-1) == 1 and max(parents) < n, "parents have not one root")
        children: list[list[int]] = [[] for _ in range(n + 1)]  # those of the root's parent, -1, at the end
        for i, q in enumerate(parents):
            children[q].append(i)
        reached = list(children[-1])
        for i in reached:
            reached += children[i]
        need(len(reached) == n, "parents are no tree")
        basis: Sparse = [{} for _ in range(n)]
        root = parents.index(-1)
        for i, q in enumerate(parents):
            if q >= 0:
                column = i - (i > root)
                basis[i][column] = w[q] * gauge[i]
                basis[q][column] = -w[i] * gauge[q]
        return basis

    def _group_form(
        self, A: Sparse, weights: Sequence[int], g: Fraction, basis: Sparse | None
    ) -> tuple[tuple[list[int], list[int], list[int]], int]:
        """Return the lower triangle of ``S = W A + A'W - g W``, or of ``B'S B`` with a basis ``B``, times a scale."""
        p, scale = (g * self.digraph.unit).as_integer_ratio()
        S: Sparse = [defaultdict(int, {i: -p * w}) for i, w in enumerate(weights)]
        for i, row in enumerate(A):
            for j, x in row.items():
                S[i][j] += scale * weights[i] * x
                S[j][i] += scale * weights[i] * x
        rows: Iterable[dict[int, int]] = S
        if basis is not None:
            columns: Sparse = [{} for _ in range(len(A) - 1)]
            for i, row in enumerate(basis):
                for j, x in row.items():
                    columns[j][i] = x
            work = sum(len(basis[j]) for row in S for j in row)
            few = work <= LARGEST_PRODUCT and fits(min(work, len(A) ** 2), LARGEST_KEPT)
            need(few, "a leader group of too many edges")
            SB = list(multiplied(S, basis))
            need(sum(map(mul, map(len, basis), map(len, SB))) <= LARGEST_PRODUCT, "a leader group of too many edges")
            rows = multiplied(columns, SB)
        lower: tuple[list[int], list[int], list[int]] = [], [], []
        for i, row in enumerate(rows):
            need(fits(len(lower[0]), LARGEST_FORM), "a leader group of too many edges")
            for j, x in row.items():
                if j <= i:
                    for part, value in zip(lower, (i, j, x), strict=True):
                        part.append(value)
        return lower, scale * self.digraph.unit

    def _group_decrease(
        self, group: Sequence[int], weights: Sequence[Fraction], g: Fraction, kept: Sequence[int]
    ) -> Matrix:
        """Return ``F L_k + L_k'F - g F`` with ``F = L_k'W L_k`` on some rows, times a positive integer."""
        self._bounded_size(len(group))
        A = self._block(group)
        (scaled,), _ = integers([list(weights)])
        p, q = (g * self.digraph.unit).as_integer_ratio()
        size, own, bits, ratio = len(A), self.digraph.bits, longest(scaled), longest((p, q))
        sized(size**2, 3 * own + bits + ratio, "the form of a leader group")
        spend(size**3, own, own + bits, "the form of a leader group")
        spend(size**3, own, 2 * own + bits, "the form of a leader group")
        spend(2 * size**2, 3 * own + bits, ratio, "the form of a leader group")
        columns = [list(column) for column in zip(*A, strict=True)]
        F = product(columns, [[x * y for y in row] for x, row in zip(scaled, A, strict=True)])
        FL = product(F, A)
        return [[q * (FL[i][j] + FL[j][i]) - p * F[i][j] for j in kept] for i in kept]

    def _distance(self, said: Any, form: Matrix, scale: Fraction, of: str) -> None:
        """Verify the constants from ``V = x'form x / scale`` to the distances, in the coordinates ``kept``."""
        self.open("distance", of)
        said = fields(said, ("agents", "norm"), "distance")
        need(list(fields(said["agents"], self.labels, "agents")) == self.labels, "agents are in another order")
        D, common, gram = self._beyond
        S = [[form[i][j] for j in self.kept] for i in self.kept]
        forms: list[tuple[list[int], int]] = []
        for row, text in zip(D, said["agents"].values(), strict=True):
            p, q = (exact(text) * common**2 / scale).as_integer_ratio()
            sized((len(forms) + 1) * len(row), longest((q,)) + longest(row), "distances")
            spend(len(row), longest((q,)), longest(row), "distances")
            forms.append(([q * x for x in row], q * p))
        failed = self.exact.bounded(S, forms)  # proves V > 0 besides
        need(failed is None, f"the constant of agent {short(self.labels[failed or 0])} is not proved")
        p, q = (exact(said["norm"]) * common**2 / scale).as_integer_ratio()
        bits, ratio = max(longest(x for row in part for x in row) for part in (S, gram)), longest((p, q))
        sized(len(S) ** 2, bits + ratio, "the distance of the norm")
        spend(2 * len(S) ** 2, bits, ratio, "the distance of the norm")
        N = [[p * s - q * g for s, g in zip(r, t, strict=True)] for r, t in zip(S, gram, strict=True)]
        need(p >= 0 and self.exact.definite(N), "the constant of the norm is not proved")
        self.done(f"norm at most {up(exact(said['norm']))}")

    @cached_property
    def _beyond(self) -> tuple[Matrix, int, Matrix]:
        """``D = I - Q`` on the columns ``kept``, times a scale; the scale; ``D'D``."""
        place, Q = {v: j for j, v in enumerate(self.kept)}, self.projection()
        rows = [{j: (i == j) - Q[i].get(j, Fraction(0)) for j in {i, *Q[i]} & place.keys()} for i in range(self.n)]
        (flat,), scale = integers([[x for row in rows for x in row.values()]])
        left, D = iter(flat), [[0] * len(place) for _ in rows]
        for full, row in zip(D, rows, strict=True):
            for j in row:
                full[place[j]] = next(left)
        columns, bits = list(zip(*D, strict=True)), longest(flat)
        sized(len(columns) ** 2 + self.n * len(columns), 2 * bits, "D'D")
        spend(len(columns) ** 2 * self.n // 2, bits, bits, "D'D")
        half = [[sum(map(mul, x, y)) for y in columns[: i + 1]] for i, x in enumerate(columns)]
        return D, scale, [[half[max(i, j)][min(i, j)] for j in range(len(half))] for i in range(len(half))]

    def rates(self) -> None:
        """Verify that the rates and the prefactor are those of the members."""
        self.at = "rates"
        said = fields(self.data["rates"], ("paper", "diagonal", "certified", "limit"), "rates")
        best = max((f for f in self.found if f[0] > 0), key=lambda f: (f[0], -f[1]), default=None)
        diagonal = max((f[0] for f in self.found if f[0] > 0 and f[2] in ("perron", "lmi")), default=None)
        proved = {"paper": self.paper_rate, "diagonal": diagonal, "certified": best and best[0]}
        for key, value in proved.items():
            need((None if said[key] is None else exact(said[key])) == value, f"the rate {key} is not the proved one")
        self.at, said = "prefactor", self.data["prefactor"]
        if best is None:
            need(said is None, "a prefactor without a rate")
        else:
            fields(said, ("value", "of"), "prefactor")
            need(exact(said["value"]) == best[1] and said["of"] == f"||{best[3]}||^2", "not that of the largest rate")

    def limit(self) -> None:
        """Verify the upper bound on every rate: by the mean nonzero eigenvalue of a strong component, or by inertia."""
        if self.data["rates"]["limit"] is None:
            return
        mean = self.following() == "rate-mean"
        limit = self.open("rate-mean" if mean else "rate-limit", "rates", ["limit"], witness=True)
        need(exact(self.data["rates"]["limit"]) == limit["limit"], "the limit is another")
        if mean:
            self._mean(limit["limit"], fields(limit["witness"], ("node",), "the witness")["node"])
        else:
            self._inertia(limit["limit"], limit["witness"])
        self.done(f"no rate exceeds {up(limit['limit'])}")

    def _strong_component(self, v: int) -> tuple[list[int], bool]:
        """Return the strong component of a node, and whether it is closed and balanced, so that 0 is an eigenvalue."""
        there, back = (self.digraph.reached([v], back) for back in (False, True))
        own = [u for u, both in enumerate(zip(there, back, strict=True)) if all(both)]
        return own, self.number[v] >= 0 and self.gauges[self.number[v]] is not None

    def _mean(self, limit: Fraction, node: Any) -> None:
        """Verify that the limit is twice the mean of the nonzero eigenvalues, whose sum is the trace."""
        (v,) = self._numbers([node], "node")
        own, still = self._strong_component(v)
        trace = Fraction(sum(self.digraph.diagonal[u] for u in own), self.digraph.unit)
        need(v == own[0], "not the first node of a strong component")
        need(len(own) > still and limit * (len(own) - still) == 2 * trace, "not twice the mean nonzero eigenvalue")

    def _inertia(self, limit: Fraction, witness: Any) -> None:
        """Verify ``H B + B'H > 0``, which gives ``H`` and ``B = A - (limit/2) I`` the same inertia."""
        said = fields(witness, ("nodes", "lower_triangle", "vectors"), "the witness")
        nodes = self._numbers(said["nodes"], "nodes")
        need(bool(nodes), "no nodes")
        own, still = self._strong_component(nodes[0])
        need(nodes == own, "the nodes are not a strong component")
        self._bounded_size(len(nodes))
        H, _ = integers(triangle(said["lower_triangle"], len(nodes)))
        p, q = (limit / 2 * self.digraph.unit).as_integer_ratio()
        bits, entry = longest(x for row in H for x in row), self.digraph.bits + longest((p, q))
        sized(len(nodes) ** 2, bits + entry, "H B")
        spend(2 * len(nodes) ** 2, entry, entry, "H B")
        spend(len(nodes) ** 3, bits, entry, "H B")
        B = [[q * x - p * (i == j) for j, x in enumerate(row)] for i, row in enumerate(self._block(nodes))]
        HB = product(H, B)
        S = [
            [x + y for x, y in zip(row, column, strict=True)]
            for row, column in zip(HB, zip(*HB, strict=True), strict=True)
        ]
        need(self.exact.definite(S), "not proved definite")
        # Of a balanced closed component the eigenvalue 0 lies below too, so that one more is needed.
        vectors = [
            [exact(x) for x in entries(row, "a vector", len(nodes))]
            for row in entries(said["vectors"], "vectors", 2 if still else 1)
        ]
        X, _ = integers(vectors)
        spend(2 * len(nodes) ** 2, bits, 2 * longest(x for row in X for x in row), "H on the vectors")
        below = product(X, product(H, [list(column) for column in zip(*X, strict=True)]))
        need(self.exact.definite([[-x for x in row] for row in below]), "H is not negative on the vectors")


def _length(values: Iterable[Fraction]) -> int:
    """Return the bits of the longest numerator or denominator."""
    return longest(n for x in values for n in x.as_integer_ratio())


def product(A: Matrix, B: Matrix) -> Matrix:
    """Return ``A B``."""
    columns = list(zip(*B, strict=True))
    return [[sum(map(mul, row, column)) for column in columns] for row in A]


def multiplied(A: Sparse, B: Sparse) -> Iterator[dict[int, int]]:
    """Yield the rows of ``A B``."""
    for left in A:
        row: dict[int, int] = defaultdict(int)
        for k, x in left.items():
            for j, y in B[k].items():
                row[j] += x * y
        yield row
