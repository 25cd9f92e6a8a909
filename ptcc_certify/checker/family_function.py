"""Verifies the Lyapunov functions of a family: one quadratic form for every signal, and what it says of agents.

Section 15 of the format: ``xi = C X`` are the states of all nodes of a component but its pivots, minus what the pivots
make of them at rest; in every mode ``xi' = -gain A xi`` with ``A = A_0 + sum_e delta_e f_e h_e'``,
``|delta_e| <= radius_e``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import integers, sized
from lmi.exact.work import spend
from ptcc_certify.checker.family import Component, Edge, Family
from ptcc_certify.checker.graph import ordered, positions
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.matrix_products import need_rows
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import entries, exact, fields, need, triangle

Matrix = list[list[Fraction]]
Vector = dict[int, Fraction]
#: Lyapunov functions that are read.
MANY_FUNCTIONS = 100
KEYS = ("class", "component", "nodes", "lower_triangle", "rate", "inputs", "coordinates")


@dataclass(frozen=True)
class Part:
    """What one uncertain parameter adds to a mode: ``delta f h'``; ``effect`` is ``f`` of the states of all nodes."""

    f: Vector
    h: Vector
    effect: Vector
    radius: Fraction


@dataclass(frozen=True)
class QuotientMode:
    """One mode: ``A_0`` and ``L_0 C^r`` by rows, at the middles of all weights, and the uncertain parts."""

    center: list[Vector]
    rows: dict[int, Vector]
    parts: list[Part]


@dataclass(frozen=True)
class FamilyFunction:
    """A function that was verified: ``V = xi'P xi <= e^(-rate s) V(0)`` for every signal.

    Attributes
    ----------
    component : Component
    nodes : list of int
    matrix : Matrix
    rate : Fraction
    inputs : dict of int to Fraction
        ``|(L X)_k|^2 <= inputs[k] V`` for every member.
    coordinates : dict of int to Fraction
        ``xi_k^2 <= coordinates[k] V``.
    """

    component: Component
    nodes: list[int]
    matrix: Matrix
    rate: Fraction
    inputs: Vector
    coordinates: Vector

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of a state."""
        kernel, pivots = self.component.kernel, self.component.pivots
        xi = [x[v] - sum((b * x[pivots[j]] for j, b in kernel[v].items()), Fraction(0)) for v in self.nodes]
        rows = zip(xi, self.matrix, strict=True)
        return sum((y * sum(map(Fraction.__mul__, row, xi), Fraction(0)) for y, row in rows), Fraction(0))


def check_family_functions(doc: Document, family: Family) -> list[FamilyFunction]:
    """Verify every function, its rates and constants."""
    section = fields(doc.section("lyapunov"), ("functions",), "lyapunov")
    items = entries(section["functions"], "functions")
    need(len(items) <= MANY_FUNCTIONS, f"more than {MANY_FUNCTIONS} Lyapunov functions")
    return [_function(doc, family, entry, f"lyapunov.functions[{k}]") for k, entry in enumerate(items)]


def _function(doc: Document, family: Family, entry: Any, of: str) -> FamilyFunction:
    doc.at = of
    fields(entry, KEYS, "a Lyapunov function")
    need(entry["class"] in ("full", "diagonal", "undirected"), "an unknown class")
    number = entry["component"]
    need(type(number) is int and 0 <= number < len(family.components), "an unknown component")
    component = family.components[number]
    need(not component.depends, "a Lyapunov function where there is no common kernel")
    graph = family.modes[0].structure.graph
    nodes = positions(doc, graph, entry["nodes"], "nodes of a function")
    pivots = set(component.pivots.values())
    need(nodes == [v for v in component.nodes if v not in pivots] and bool(nodes), "nodes of a function")
    need_rows(len(nodes))
    P, rate = triangle(entry["lower_triangle"], len(nodes)), exact(entry["rate"])
    rates = []
    modes = [_quotient(family, k, component, nodes) for k in range(len(family.modes))]
    for k, mode in enumerate(modes):
        numbers = doc.open("family-rate", f"{of}.modes[{k}]", ["b"], witness=True)
        _decreases(doc, mode, P, numbers["b"], numbers["witness"])
        rates.append(numbers["b"])
        doc.done(f"b = {down(numbers['b'])}")
    need(min(rates) == rate, "the rate is not the least of the modes'")
    doc.open("family-constants", of)
    labels = family.labels
    own = {v: labels[v] for v in component.nodes}
    inputs = dict(zip(own, map(exact, ordered(list(own.values()), entry["inputs"], "inputs").values()), strict=True))
    some = [labels[v] for v in nodes]
    coordinates = dict(zip(nodes, map(exact, ordered(some, entry["coordinates"], "coordinates").values()), strict=True))
    _constants(doc, modes, P, inputs, coordinates)
    doc.done(f"{len(inputs)} inputs, {len(coordinates)} coordinates")
    return FamilyFunction(component, nodes, P, rate, inputs, coordinates)


# ---------------------------------------------------------------------- the quotient


def _quotient(family: Family, number: int, component: Component, nodes: list[int]) -> QuotientMode:
    """Return a mode in the coordinates ``xi``; columns are numbered as ``nodes``."""
    mode, place, inside = family.modes[number], {v: i for i, v in enumerate(nodes)}, set(component.nodes)
    rows: dict[int, Vector] = {v: {} for v in component.nodes}
    parts = []
    for edge in mode.edges:
        s, t, sign, low, high = edge
        if t not in inside:
            continue
        middle = (low + high) / 2
        for v, weight in ((t, middle), (s, -sign * middle)):
            if v in place:
                rows[t][place[v]] = rows[t].get(place[v], Fraction(0)) + weight
        if low < high and not (mode.tied and s > t):
            parts.append(_part(component, place, edge, mode.tied))
    spend(len(nodes) * sum(map(len, rows.values())), 64, 64, "rows of a quotient")
    return QuotientMode([_projected(component, v, rows) for v in nodes], rows, parts)


def _part(component: Component, place: dict[int, int], edge: Edge, tied: bool) -> Part:
    s, t, sign, low, high = edge
    h = {place[v]: Fraction(x) for v, x in ((t, 1), (s, -sign)) if v in place}
    effect = {t: Fraction(1), **({s: Fraction(-sign)} if tied else {})}
    columns = {v: {0: x} for v, x in effect.items()}
    f = {i: x.get(0, Fraction(0)) for v, i in place.items() if (x := _projected(component, v, columns)).get(0)}
    return Part(f, h, effect, (high - low) / 2)


def _projected(component: Component, v: int, rows: dict[int, Vector]) -> Vector:
    """Return the row of a node, minus those of the pivots times its row of the kernel."""
    total = dict(rows.get(v, {}))
    for j, b in component.kernel[v].items():
        for i, x in rows.get(component.pivots[j], {}).items():
            total[i] = total.get(i, Fraction(0)) - b * x
    return total


# ---------------------------------------------------------------------- rates


def _decreases(doc: Document, mode: QuotientMode, P: Matrix, b: Fraction, witness: Any) -> None:
    """Verify ``P > 0`` and ``P A + A'P >= b P`` for all members of a mode.

    With multipliers ``tau > 0``: ``[[P A_0 + A_0'P - b P - H diag(tau) H', P F diag(r)], [.., diag(tau)]] > 0``.
    Without: every ``P f_e`` is a multiple ``c_e >= 0`` of ``h_e``, so that the least weights are the worst.
    """
    n, zero = len(P), Fraction(0)
    moves = any(map(bool, mode.center)) or bool(mode.parts)
    need(doc.exact.definite(integers(P)[0]), "P is not proved definite")
    if not moves:
        need(b == 0 and witness is None, "nothing moves in this mode")
        return
    sized(n * n, 64, "a form of a family")
    product = [
        [sum((P[i][k] * row.get(j, zero) for k, row in enumerate(mode.center)), zero) for j in range(n)]
        for i in range(n)
    ]
    S = [[product[i][j] + product[j][i] - b * P[i][j] for j in range(n)] for i in range(n)]
    pushed = [[sum((row[j] * x for j, x in part.f.items()), zero) for row in P] for part in mode.parts]
    parts = list(zip(mode.parts, pushed, strict=True))
    if witness is None:
        for part, Pf in parts:
            c = _multiple(Pf, part.h)
            for i, x in part.h.items():
                for j, y in part.h.items():
                    S[i][j] -= 2 * c * part.radius * x * y
        need(doc.exact.definite(integers(S)[0]), "not proved definite")
        return
    multipliers = [
        exact(x) for x in entries(fields(witness, ("multipliers",), "the witness")["multipliers"], "multipliers")
    ]
    parts = [(part, Pf) for part, Pf in parts if part.f and part.h]
    need(len(multipliers) == len(parts), "a multiplier for each uncertain parameter")
    q = len(parts)
    need_rows(n + q)
    for tau, (part, _) in zip(multipliers, parts, strict=True):
        for i, x in part.h.items():
            for j, y in part.h.items():
                S[i][j] -= tau * x * y
    whole = [[*row, *(part.radius * Pf[i] for part, Pf in parts)] for i, row in enumerate(S)]
    whole += [
        [part.radius * x for x in Pf] + [tau if e == k else zero for k in range(q)]
        for e, (tau, (part, Pf)) in enumerate(zip(multipliers, parts, strict=True))
    ]
    need(doc.exact.definite(integers(whole)[0]), "not proved definite")


def _multiple(Pf: Sequence[Fraction], h: Vector) -> Fraction:
    """Return ``c`` with ``P f = c h``; refuse any other, and a negative one."""
    c = next((Pf[i] / x for i, x in h.items()), Fraction(0))
    need(c >= 0 and all(y == c * h.get(i, 0) for i, y in enumerate(Pf)), "the least weights are not the worst")
    return c


# ---------------------------------------------------------------------- constants


def _constants(doc: Document, modes: Sequence[QuotientMode], P: Matrix, inputs: Vector, coordinates: Vector) -> None:
    """Verify what ``V`` says of inputs and coordinates, for every member of every mode.

    ``|(L X)_k| <= (|y| + sum_e radius_e |effect_ek| |h_e|) sqrt(V)``, ``y`` the row ``k`` of ``L_0 C^r`` and
    ``|z| = sqrt(z' P^-1 z)``.
    """
    n = len(P)
    vectors: dict[tuple[tuple[int, Fraction], ...], int] = {}

    def number(vector: Vector) -> int:
        return vectors.setdefault(tuple(sorted((i, x) for i, x in vector.items() if x)), len(vectors))

    sums = []
    for mode in modes:
        for k, row in mode.rows.items():
            terms = [(Fraction(1), number(row))]
            terms += [(part.radius * abs(part.effect[k]), number(part.h)) for part in mode.parts if k in part.effect]
            sums.append((k, terms))
    units = [number({i: Fraction(1)}) for i in range(n)]
    (rows, scale), (whole, unit) = integers(P), integers([_dense(vector, n) for vector in vectors])
    above = doc.exact.above(rows, whole)
    need(above is not None, "P is not proved definite")
    squares = [x * scale / unit**2 for x in above or ()]
    norms = [root_above(x) if x else Fraction(0) for x in squares]
    for k, terms in sums:
        total = sum((factor * norms[place] for factor, place in terms), Fraction(0))
        need(total**2 <= inputs[k], "the constant of an input is not proved")
    for (v, c), place in zip(coordinates.items(), units, strict=True):
        need(squares[place] <= c, f"the constant of coordinate {v} is not proved")


def _dense(vector: Sequence[tuple[int, Fraction]], n: int) -> list[Fraction]:
    row = [Fraction(0)] * n
    for i, x in vector:
        row[i] = x
    return row
