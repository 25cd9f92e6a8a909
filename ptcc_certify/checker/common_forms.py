"""Verifies the Lyapunov functions of a family: one quadratic form for every signal, and what it says of agents.

Section 19 of the format: ``xi = C X`` are the states of all nodes of a component but its pivots, minus what the pivots
make of them at rest; in every mode ``xi' = -gain A xi`` with ``A = A_0 + sum_e delta_e f_e h_e'``,
``|delta_e| <= radius_e``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, Literal

from lmi.exact.decimal_rounding import down
from lmi.exact.definite import Arithmetic
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.common_kernel_ends import WeightedMean
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Component, Edge, Family, combination
from ptcc_certify.checker.graph import ordered, positions
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.matrix_products import (
    Matrix,
    combined,
    need_rows,
    need_rows_with_multipliers,
    quadratic,
    times,
    transposed,
)
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.section_declarations import Nodes, Several, Some, Triangle

Vector = dict[int, Fraction]
#: Integers by node, and a number by which all are multiplied.
Scaled = tuple[Mapping[int, int], Fraction]
Whole = dict[int, int]


@dataclass(frozen=True, kw_only=True)
class MeanSection:
    """A weighted mean of agents, and how fast it changes at most."""

    weights: Some[Fraction]
    constant: Fraction


@dataclass(frozen=True, kw_only=True)
class FormSection:
    """What the file says of a quadratic form of a component, or of a part of one that hears nobody else."""

    class_: Literal["full", "diagonal", "undirected"]
    component: int
    nodes: Nodes
    lower_triangle: Triangle
    rate: Fraction
    inputs: Some[Fraction]
    coordinates: Some[Fraction]
    means: Several[MeanSection]


@dataclass(frozen=True, kw_only=True)
class Multipliers:
    """The witness of a rate: a multiplier of every uncertain weight."""

    multipliers: Several[Fraction]


#: Means of one function.
MANY_MEANS = 100


@dataclass(frozen=True)
class Part:
    """What one uncertain parameter adds to a mode: ``delta f h'``; ``effect`` is ``f`` of the states of all nodes.

    In integers: ``f`` over the scale of the kernel, ``|delta| <= radius`` over twice the unit of the mode.
    """

    f: Whole
    h: Whole
    effect: Whole
    radius: int


@dataclass(frozen=True)
class QuotientMode:
    """One mode: ``A_0`` and ``L_0 C^r`` by rows, at the middles of all weights, and the uncertain parts.

    In integers: ``A_0`` over ``unit`` times the scale of the kernel, ``L_0 C^r`` over ``unit``.
    """

    center: list[Whole]
    rows: dict[int, Whole]
    parts: list[Part]
    unit: int


@dataclass(frozen=True)
class FamilyFunction:
    """A function that was verified: ``V = xi'P xi <= e^(-rate s) V(0)`` for every signal.

    Attributes
    ----------
    component : Component
    nodes : list of int
    matrix : Matrix
        ``P`` in integers,
    scale : int
        over this.
    rate : Fraction
    inputs : dict of int to Fraction
        ``|(L X)_k|^2 <= inputs[k] V`` for every member.
    coordinates : dict of int to Fraction
        ``xi_k^2 <= coordinates[k] V``.
    means : list of WeightedMean
    """

    component: Component
    nodes: list[int]
    matrix: Matrix
    scale: int
    rate: Fraction
    inputs: Vector
    coordinates: Vector
    means: list[WeightedMean]

    @cached_property
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)``."""
        (values,), scale = integers([[root_above(c) for c in self.inputs.values()]])
        return [(dict(zip(self.inputs, values, strict=True)), Fraction(1, scale))]

    @cached_property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""
        (values,), scale = integers([[root_above(c) for c in self.coordinates.values()]])
        return [(dict(zip(self.coordinates, values, strict=True)), Fraction(1, scale))]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state."""
        return root_above(self.value(x))

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``: ``b'|P| b``, ``b = |C| sizes``, by entries."""
        return self.value(sizes, sizes=True)

    def spread(self, sizes: Mapping[int, Fraction]) -> Fraction | None:
        """Bound how much faster ``sqrt(V)`` grows than agents that move by themselves part: see :func:`spread`."""
        kernel, pivots = self.component.kernel, self.component.pivots
        rows = [[kernel[v].get(j, 0) for j in pivots] for v in self.nodes]
        return spread(self.matrix, self.scale, rows, [sizes[v] for v in self.nodes])

    def value(self, x: Sequence[Fraction] | Mapping[int, Fraction], sizes: bool = False) -> Fraction:
        """Return ``V`` of a state, or of sizes the largest one."""
        xi, unit = self.component.coordinates(self.nodes, x, sizes)
        spend(len(xi) ** 2, longest(xi), longest(max(row, key=abs) for row in self.matrix), "a Lyapunov function")
        return Fraction(quadratic(self.matrix, xi, sizes), self.scale * unit**2)


def spread(
    matrix: Sequence[Sequence[Any]], scale: int, kernel: Sequence[Sequence[Any]], sizes: Iterable[Fraction]
) -> Fraction | None:
    """Bound how much faster the root of a form grows than its agents part, if they move by themselves.

    ``V`` is a sum of ``c_kl (x_k - x_l)^2`` of pairs in one camp, or where all end at 0 of ``c_kl (x_k +- x_l)^2`` and
    ``c_k x_k^2``. An odd ``f`` with the constant ``l`` lets no square grow faster than ``2 l`` times itself, nor fall
    faster: so ``V' <= 2 l (V + 2 N)``, ``N`` the terms with ``c < 0`` in size, by ``|xi_k| <= sizes_k sqrt(V)``.

    Parameters
    ----------
    matrix, scale : n rows of n integers, int
        ``P = matrix/scale``.
    kernel : n rows
        Of the coordinates: 1 or -1 at the one pivot; without pivots they are empty.
    sizes : n Fraction

    Returns
    -------
    Fraction or None
        ``1 + 2 N/V``; None of other kernels.

    Examples
    --------
    >>> sizes = [Fraction(1)] * 2
    >>> spread([[2, -1], [-1, 2]], 1, [[1], [1]], sizes), spread([[2, 1], [1, 2]], 1, [[1], [1]], sizes)
    (Fraction(1, 1), Fraction(9, 1))
    >>> spread([[1, 2], [2, 5]], 1, [[], []], sizes)
    Fraction(3, 1)
    """
    own, n, terms = list(sizes), len(matrix), list[Fraction]()
    spend(4 * n * n, longest(max(row, key=abs) for row in matrix), longest(x.numerator for x in own) + 64, "growth")
    if not any(kernel):
        for k, (row, size) in enumerate(zip(matrix, own, strict=True)):
            terms.append((sum(map(abs, row)) - 2 * row[k]) * size**2)
    elif all(len(row) == 1 and abs(row[0]) == 1 for row in kernel):
        camps = [int(row[0]) for row in kernel]
        for k, (row, size) in enumerate(zip(matrix, own, strict=True)):
            coupled = [camps[k] * camp * x for camp, x in zip(camps, row, strict=True)]
            terms.append(-sum(coupled) * size**2)
            terms += [x * (size + other) ** 2 for x, other in zip(coupled[:k], own, strict=False)]
    else:
        return None
    return 1 + 2 * sum((x for x in terms if x > 0), Fraction(0)) / scale


def check_form(doc: Document, family: Family, component: Component, entry: FormSection, of: str) -> FamilyFunction:
    """Verify a quadratic form of a component, or of a part of one that hears nobody else."""
    doc.at = of
    graph = family.modes[0].structure.graph
    nodes = positions(doc, graph, entry.nodes, "nodes of a function")
    pivots = set(component.pivots.values())
    need(nodes == [v for v in component.nodes if v not in pivots] and bool(nodes), "nodes of a function")
    proved = []
    for one in rates_of_modes(doc, family, component, nodes, [entry.lower_triangle], of):
        proved.append(one)
        doc.done(f"b = {down(one[2])}")
    ((P, scale), *_), modes, rates = zip(*proved, strict=True)
    need(min(rates) == entry.rate, "the rate is not the least of the modes'")
    doc.open("family-constants", of)
    labels = family.labels
    labels_of = {v: labels[v] for v in component.nodes}
    inputs = dict(zip(labels_of, ordered(list(labels_of.values()), entry.inputs, "inputs").values(), strict=True))
    function_labels = [labels[v] for v in nodes]
    coordinates = dict(zip(nodes, ordered(function_labels, entry.coordinates, "coordinates").values(), strict=True))
    means = [_mean(doc, graph, component, mean) for mean in entry.means]
    need(len(means) <= MANY_MEANS, f"more than {MANY_MEANS} means")
    _constants(doc.exact, modes, (P, scale), inputs, coordinates, means)
    doc.done(f"{len(inputs)} inputs, {len(coordinates)} coordinates" + (f", {len(means)} means" if means else ""))
    return FamilyFunction(component, nodes, P, scale, entry.rate, inputs, coordinates, means)


def rates_of_modes(
    doc: Document,
    family: Family,
    component: Component,
    nodes: list[int],
    triangles: Sequence[Sequence[Sequence[Fraction]]],
    of: str,
) -> Iterator[tuple[tuple[Matrix, int], QuotientMode, Fraction]]:
    """Yield the form of every mode in integers and over what, the mode in its coordinates, and its verified rate.

    There is one form for all modes, or one for each. Who takes them closes the obligations.
    """
    need_rows(len(nodes))
    form: tuple[Matrix, int] = [], 1
    for k in range(len(family.modes)):
        if k < len(triangles):
            need(len(triangles[k]) == len(nodes), f"lower_triangle has not {len(nodes)} entries")
            form = integers(triangles[k])
            need(doc.exact.definite(form[0]), "P is not proved definite")
        numbers, mode = doc.open("family-rate", f"{of}.modes[{k}]"), quotient_of(family, k, component, nodes)
        decreases(doc.exact, mode, form, component.whole[1], numbers["b"], numbers["witness"])
        yield form, mode, numbers["b"]


def _mean(doc: Document, graph: Digraph, component: Component, entry: MeanSection) -> WeightedMean:
    """Return a weighted mean of agents whose rows of the basis are 1 or -1 in one column, and 0 elsewhere."""
    need(bool(entry.weights), "weights of a mean")
    nodes = positions(doc, graph, list(entry.weights), "a mean")
    need(set(nodes) <= set(component.nodes), "a mean of other agents")
    rows = [component.kernel[v] for v in nodes]
    column = next(iter(rows[0]), 0)
    need(all([*row] == [column] and abs(row[column]) == 1 for row in rows), "a mean of agents of several groups")
    weights = list(entry.weights.values())
    size = sum((q * row[column] for q, row in zip(weights, rows, strict=True)), Fraction(0))
    need(size != 0, "a mean of weight 0")
    return WeightedMean(column, dict(zip(nodes, weights, strict=True)), size, entry.constant)


# ---------------------------------------------------------------------- the quotient


def quotient_of(family: Family, number: int, component: Component, nodes: list[int]) -> QuotientMode:
    """Return a mode in the coordinates ``xi``; columns are numbered as ``nodes``."""
    mode, edges = family.modes[number], component.part.edges[number]
    place = {v: i for i, v in enumerate(nodes)}
    kernel, scale = component.whole
    spend(8 * (len(edges) + component.size), mode.unit.bit_length(), what="a quotient")
    rows: dict[int, Whole] = {v: {} for v in component.nodes}
    for s, t, sign, low, high in edges:
        for v, weight in ((t, low + high), (s, -sign * (low + high))):
            if v in place:
                rows[t][place[v]] = rows[t].get(place[v], 0) + weight
    uncertain = [edge for edge in edges if edge[3] < edge[4] and not (mode.tied and edge[0] > edge[1])]
    columns = _columns(component, nodes, place)
    longest_entry = max(64, scale.bit_length(), longest(b for v in nodes for b in kernel[v].values()))
    entries_of_f = sum(len(columns[v]) for edge in uncertain for v in edge[:2])
    sized(entries_of_f + 8 * len(uncertain), longest_entry, "the uncertain weights of a family")
    parts = [_part(columns, place, edge, mode.tied) for edge in uncertain]
    bits = longest(x for row in rows.values() for x in row.values())
    entry_bits = longest_entry + scale.bit_length()
    of_pivots = sum(len(rows[component.pivots[j]]) for v in nodes for j in kernel[v])
    spend(sum(len(rows[v]) for v in nodes) + of_pivots, bits, entry_bits, "a quotient")
    sized(min(len(nodes) ** 2, sum(map(len, rows.values())) + of_pivots), bits + entry_bits + len(nodes), "a quotient")
    center = []
    for v in nodes:
        factors = {v: scale, **{component.pivots[j]: -b for j, b in kernel[v].items()}}
        center.append(combination(factors, rows))
    return QuotientMode(center, rows, parts, 2 * mode.unit)


def _columns(component: Component, nodes: list[int], place: dict[int, int]) -> dict[int, Whole]:
    """Return the columns of ``C``, over the scale of the kernel, of all nodes of a component."""
    kernel, scale = component.whole
    columns: dict[int, Whole] = {v: {place[v]: scale} if v in place else {} for v in component.nodes}
    for v in nodes:
        for j, b in kernel[v].items():
            columns[component.pivots[j]][place[v]] = -b
    return columns


def _part(columns: dict[int, Whole], place: dict[int, int], edge: Edge, tied: bool) -> Part:
    s, t, sign, low, high = edge
    h = {place[v]: x for v, x in ((t, 1), (s, -sign)) if v in place}
    effect = {t: 1, **({s: -sign} if tied else {})}
    return Part(combination(effect, columns), h, effect, high - low)


# ---------------------------------------------------------------------- rates


def decreases(
    judge: Arithmetic,
    mode: QuotientMode,
    form: tuple[Matrix, int],
    kernel_scale: int,
    b: Fraction,
    witness: Multipliers | None,
) -> None:
    """Verify ``P A + A'P >= b P`` for all members of a mode, ``P > 0``.

    With multipliers ``tau > 0``: ``[[P A_0 + A_0'P - b P - H diag(tau) H', P F diag(r)], [.., diag(tau)]] > 0``.
    Without: every ``P f_e`` is a multiple ``c_e >= 0`` of ``h_e``, so that the least weights are the worst.
    """
    P, scale = form
    n = len(form[0])
    unit = mode.unit * kernel_scale
    parts = [part for part in mode.parts if part.f and part.h]
    if not parts and not any(mode.center):
        need(b == 0 and witness is None, "nothing moves in this mode")
        return
    need_rows(n)
    product = times(judge, P, mode.center, n)
    if witness is None:
        slack = _least_weights(P, parts)
        S = combined("a form of a family", (1, product), (1, transposed(product)), (-2, slack))
        S = combined("a form of a family", (b.denominator, S), (-b.numerator * unit, P))
        need(judge.definite(S), "not proved definite")
        return
    q = len(witness.multipliers)
    need(q == len(parts), f"multipliers has not {len(parts)} entries")
    need_rows_with_multipliers(n + q)
    (taus,), common = integers([witness.multipliers])
    pushes = [_push(P, part) for part in parts]
    diagonal, squares = [[tau * (e == k) for k in range(q)] for e, tau in enumerate(taus)], _zeros(n)
    for tau, part in zip(taus, parts, strict=True):
        _add_square(squares, tau, part)
    # Everything times b.denominator * common * scale * unit.
    p, d = b.as_integer_ratio()
    low = combined("a form of a family", (d, product), (d, transposed(product)), (-p * unit, P))
    low = combined("a form of a family", (common, low), (-d * scale * unit, squares))
    rounds = [[part.radius * x for x in push] for part, push in zip(parts, pushes, strict=True)]
    side = combined("a form of a family", (d * common, rounds)) if q else []
    corner = combined("a form of a family", (d * scale * unit, diagonal)) if q else []
    bordered = [[*row, *(push[i] for push in side)] for i, row in enumerate(low)]
    bordered += [[*push, *row] for push, row in zip(side, corner, strict=True)]
    need(judge.definite(bordered), "not proved definite")


def _zeros(n: int) -> Matrix:
    return [[0] * n for _ in range(n)]


def _push(P: Matrix, part: Part) -> list[int]:
    """Return ``P f``."""
    bits = longest(max(row, key=abs) for row in P), longest(part.f.values())
    spend(len(P) * len(part.f), *bits, "the uncertain weights of a family")
    sized(len(P), sum(bits) + len(P).bit_length())
    return [sum(row[j] * x for j, x in part.f.items()) for row in P]


def _add_square(S: Matrix, factor: int, part: Part) -> None:
    """Add ``factor h h'``."""
    for i, x in part.h.items():
        for j, y in part.h.items():
            S[i][j] += factor * x * y


def _least_weights(P: Matrix, parts: Sequence[Part]) -> Matrix:
    """Return ``sum_e c_e radius_e h_e h_e'`` where every ``P f_e`` is ``c_e h_e``, ``c_e >= 0``; refuse any other."""
    S = _zeros(len(P))
    for part in parts:
        push = _push(P, part)
        i, x = next(iter(part.h.items()))
        c = push[i] * x  # entries of h are 1 and -1
        agrees = c >= 0 and all(y == c * part.h.get(k, 0) for k, y in enumerate(push))
        need(agrees, "the least weights are not the worst")
        _add_square(S, c * part.radius, part)
    return S


# ---------------------------------------------------------------------- constants


def _constants(
    judge: Arithmetic,
    modes: Sequence[QuotientMode],
    form: tuple[Matrix, int],
    inputs: Vector,
    coordinates: Vector,
    means: Sequence[WeightedMean],
) -> None:
    """Verify what ``V`` says of inputs, coordinates and means, for every member of every mode.

    ``|(L X)_k| <= (|y| + sum_e radius_e |effect_ek| |h_e|) sqrt(V)``, ``y`` the row ``k`` of ``L_0 C^r`` and
    ``|z| = sqrt(z' P^-1 z)``; of a mean ``q' L X``, ``y`` and ``effect_e`` are combinations by ``q``.
    """
    (P, scale), n = form, len(form[0])
    vectors: dict[tuple[tuple[int, int], ...], int] = {}

    def number(vector: Whole) -> int:
        return vectors.setdefault(tuple(sorted((i, x) for i, x in vector.items() if x)), len(vectors))

    sums = []
    for mode in modes:
        terms = {k: [(1, number(row))] for k, row in mode.rows.items()}
        for part in mode.parts:
            for k in part.effect:
                terms[k].append((part.radius, number(part.h)))
        sums += [(c, mode.unit, some) for c, some in zip(inputs.values(), terms.values(), strict=True)]
        for mean in means:
            unit, row, factors = _mean_terms(mode, mean)
            sums.append((mean.constant, unit, [(1, number(row)), *((size, number(h)) for size, h in factors)]))
    units = [number({i: 1}) for i in range(n)]
    sized(len(vectors) * n, max(64, longest(x for vector in vectors for _, x in vector)), "the inputs of a family")
    above = judge.above(P, [[vector.get(i, 0) for i in range(n)] for vector in map(dict, vectors)])
    if above is None:
        raise RejectedError("P is not proved definite")
    squares = [x * scale for x in above]
    norms = [root_above(x) if x else Fraction(0) for x in squares]
    spend(80 * sum(len(some) for _, _, some in sums), 128, 2 * max(mode.unit for mode in modes).bit_length())
    for c, unit, some in sums:
        total = sum((factor * norms[place] for factor, place in some), Fraction(0)) / unit
        need(total**2 <= c, "the constant of an input or a mean is not proved")
    for (v, c), place in zip(coordinates.items(), units, strict=True):
        need(squares[place] <= c, f"the constant of coordinate {v} is not proved")


def _mean_terms(mode: QuotientMode, mean: WeightedMean) -> tuple[int, Whole, list[tuple[int, Whole]]]:
    """Return of ``q' L``, over one unit: that, ``q' L_0 C^r``, and of every part ``radius |q' effect|`` and ``h``."""
    (values,), scale = integers([[*mean.weights.values()]])
    whole, row = dict(zip(mean.weights, values, strict=True)), Whole()
    count = sum(len(mode.rows[v]) for v in whole) + 2 * len(mode.parts)
    spend(count, longest(values), longest(x for v in whole for x in mode.rows[v].values()), "means of a family")
    for v, q in whole.items():
        for i, x in mode.rows[v].items():
            row[i] = row.get(i, 0) + q * x
    pushes = ((abs(sum(whole.get(k, 0) * x for k, x in part.effect.items())), part) for part in mode.parts)
    return mode.unit * scale, row, [(part.radius * size, part.h) for size, part in pushes if size]
