"""Verifies a diagonal Lyapunov function of a large graph: each leader group by itself, then every row."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, pairwise
from operator import mul
from typing import Any

from lmi.exact.decimal_rounding import down
from lmi.exact.definite import SparseFactor
from lmi.exact.numbers import longest
from lmi.exact.polynomials import row_sum
from lmi.exact.work import fits, spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.matrix_products import Sparse, block
from ptcc_certify.checker.reading import entries, exact, need
from ptcc_certify.checker.section_declarations import Integers, Several, Unread, Vector, read
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.structure import Structure
from ptcc_certify.checker.theorem_function import group_decrease

#: Products of entries up to which sparse matrices are multiplied, and entries of one that are kept.
LARGEST_PRODUCT, LARGEST_KEPT = 50_000_000, 3_000_000
#: Entries of the factor of a leader group, and of the matrix that it is of.
LARGEST_FACTOR, LARGEST_FORM = 2_000_000, 700_000
#: The groups that were proved: number, rate, and weights without common factor.
Proved = set[tuple[int, Fraction, tuple[int, ...]]]


@dataclass(frozen=True, kw_only=True)
class FactorSection:
    """A rounded sparse factor of a matrix, and what it is of."""

    order: Integers
    indptr: Integers
    indices: Integers
    data: Integers
    exponents: Integers
    bits: int
    power: int
    weights: Integers | None = None
    parents: Integers | None = None


@dataclass(frozen=True, kw_only=True)
class GroupWitness:
    """The rate of a leader group by itself, and the factor that proves it."""

    rate: Fraction
    factor: FactorSection


@dataclass(frozen=True, kw_only=True)
class DominanceWitness:
    """A vector by which rows are dominated, and of each leader group its rate; a factor where one is needed."""

    vector: Vector
    groups: Unread[Several[Fraction | GroupWitness]]


def check_dominance(
    doc: Document,
    structure: Structure,
    nodes: Sequence[int],
    weights: Numbers,
    rate: Fraction,
    of: str,
    proofs: Proved,
) -> None:
    """Verify ``S_ii d_i > sum_j |S_ij| d_j`` for all rows, after each leader group by itself."""
    graph, number = structure.graph, structure.number
    obligation = doc.open("dominance", of)
    need(obligation["b"] == rate, "b is not the rate")
    witness: DominanceWitness = obligation["witness"]
    vector = doc.files.numbers(witness.vector, "vector", len(nodes))
    need(vector.positive(), "the vector is not positive")
    (own, scale), (each, _) = (numbers.over(range(len(nodes))) for numbers in (weights, vector))
    W, D = [0] * graph.n, [0] * graph.n
    for v, w, d in zip(nodes, own, each, strict=True):
        W[v], D[v] = w, d
    groups = [k for k, group in enumerate(structure.closed) if len(group) > 1]
    spare = {}  # of leader groups, by which g_k exceeds the rate
    for k, entry in zip(groups, entries(witness.groups, "groups", len(groups)), strict=True):
        g = _group(doc, structure, k, [W[v] for v in structure.closed[k]], scale, entry, proofs)
        spare[k] = ((g - rate) * graph.unit).as_integer_ratio()
    # w_i d_i times rate, less what the others push, times q and unit
    p, q = (rate * graph.unit).as_integer_ratio()
    bits = longest((p, q, *chain.from_iterable(spare.values()))) + graph.bits
    spend(5 * len(nodes), bits, longest(W) + longest(D), "rows")
    row_sums, diagonal = graph.sums_in(D), graph.diagonal
    pushes = [0 if k >= 0 else w * d for k, w, d in zip(number, W, D, strict=True)]
    column_sums = graph.sums_out(pushes)
    for v in nodes:
        if number[v] < 0:
            margin = (2 * q * diagonal[v] - p) * pushes[v] - q * (W[v] * row_sums[v] + column_sums[v])
        else:
            top, bottom = spare[number[v]]
            margin = top * W[v] * D[v] - bottom * column_sums[v]
        need(margin > 0, "a row is not dominated by its diagonal")
    doc.done(f"b = {down(rate)}, {len(nodes)} rows")


def _group(
    doc: Document, structure: Structure, k: int, weights: Sequence[int], scale: int, entry: Any, proofs: Proved
) -> Fraction:
    """Verify the decay of a leader group by itself, once for all multiples of its weights; return its rate."""
    told = read(GroupWitness, entry, doc.context, "a leader group") if isinstance(entry, dict) else None
    factor = None if told is None else told.factor
    g, common = exact(entry) if told is None else told.rate, math.gcd(*weights)
    key = k, g, tuple(w // common for w in weights)
    if key in proofs:
        need(factor is None, "a factor of a leader group that is proved already")
    elif factor is not None:
        _factor(doc, structure, k, Fraction(common, scale), key[2], g, factor)
    else:
        need(group_decrease(doc, structure, k, key[2], g), "a leader group is not proved")
    proofs.add(key)
    return g


def _factor(
    doc: Document,
    structure: Structure,
    k: int,
    times: Fraction,
    ratios: Sequence[int],
    g: Fraction,
    section: FactorSection,
) -> None:
    """Verify the decay of a leader group, of weights ``times ratios``, by the sparse factor of its form."""
    gauge, unit = structure.gauges[k], structure.graph.unit
    group = structure.closed[k]
    factor, power = read_factor(doc, section, len(group) - (gauge is not None))
    n = len(factor.exponents)
    A, basis = block(structure.graph, group), None
    if section.parents is not None:
        need(gauge is not None, "parents of a group that is not balanced")
        basis = _differences(A, ratios, gauge or (), doc.files.integers(section.parents, "parents", len(group)))
    elif gauge is not None:
        basis = [{j - 1: x for j, x in row.items() if j} for row in A]
    lower, scale = _form(A, [times.numerator * w for w in ratios], g, unit, basis)
    if gauge is not None and section.parents is None:
        scale *= unit**2
    definite = doc.exact.residual_definite(n, lower, factor, power, scale * times.denominator)
    need(definite, "a leader group is not proved by its factor")


def read_factor(doc: Document, section: FactorSection, n: int) -> tuple[SparseFactor, int]:
    """Return the factor of a matrix of ``n`` rows as a certificate has it, and its power; refuse a large one."""
    whole, arithmetic = doc.files.integers, doc.exact
    order, exponents = whole(section.order, "order", n), whole(section.exponents, "exponents", n)
    indptr = whole(section.indptr, "indptr", n + 1)
    vector = None if section.weights is None else whole(section.weights, "weights", n)
    few = 0 <= indptr[-1] <= n * (n + 1) // 2 and fits(indptr[-1], LARGEST_FACTOR)
    need(few, "the factor has too many entries")
    need(all(0 <= b - a <= n for a, b in pairwise(indptr)), "indptr has no columns of a factor")
    work, most = sum((b - a) ** 2 for a, b in pairwise(indptr)), arithmetic.products
    need(work <= most, f"a factor of {work} products; {arithmetic.name} takes {most}")
    indices, data = (whole(getattr(section, key), key, indptr[-1]) for key in ("indices", "data"))
    return SparseFactor(order, indptr, indices, data, exponents, section.bits, vector), section.power


def _differences(A: Sparse, w: Sequence[int], gauge: Sequence[int], parents: Sequence[int]) -> Sparse:
    """Return ``B``, by rows: a basis of all ``y`` with ``eta'y = 0``, ``eta = G w``, which contain the range of ``A``.

    One column ``w_q G_i e_i - w_i G_q e_q`` for each node ``i`` but the root of a tree, ``q`` its parent. Where parents
    are no tree, the columns are dependent, and ``B'S B`` is not definite.
    """
    eta = {i: sign * weight for i, (sign, weight) in enumerate(zip(gauge, w, strict=True))}
    need(not any(row_sum(eta, A).values()), "the weights are not a left null vector")
    rooted = min(parents) == -1 and parents.count(-1) == 1 and max(parents) < len(A)
    need(rooted and all(i != q for i, q in enumerate(parents)), "parents are not those of a tree")
    basis: Sparse = [{} for _ in A]
    for column, i in enumerate(i for i, q in enumerate(parents) if q >= 0):
        q = parents[i]
        basis[i][column], basis[q][column] = w[q] * gauge[i], -w[i] * gauge[q]
    return basis


def _form(
    A: Sparse, weights: Sequence[int], g: Fraction, unit: int, basis: Sparse | None
) -> tuple[list[tuple[int, ...]], int]:
    """Return the lower triangle of ``S = W A + A'W - g W``, or of ``B'S B`` with a basis ``B``, times a scale."""
    p, q = (g * unit).as_integer_ratio()
    S: Sparse = [defaultdict(int, {i: -p * w}) for i, w in enumerate(weights)]
    for i, row in enumerate(A):
        for j, x in row.items():
            S[i][j] += q * weights[i] * x
            S[j][i] += q * weights[i] * x
    rows: Iterable[dict[int, int]] = S
    if basis is not None:
        columns: Sparse = [{} for _ in A[1:]]
        for i, row in enumerate(basis):
            for j, x in row.items():
                columns[j][i] = x
        work = sum(len(basis[j]) for row in S for j in row)
        few = work <= LARGEST_PRODUCT and fits(min(work, len(A) ** 2), LARGEST_KEPT)
        need(few, "a leader group of too many edges")
        SB = [row_sum(row, basis) for row in S]
        need(sum(map(mul, map(len, basis), map(len, SB))) <= LARGEST_PRODUCT, "a leader group of too many edges")
        rows = (row_sum(column, SB) for column in columns)
    lower: list[tuple[int, int, int]] = []
    for i, row in enumerate(rows):
        need(fits(len(lower), LARGEST_FORM), "a leader group of too many edges")
        lower += [(i, j, x) for j, x in row.items() if j <= i]
    return list(zip(*lower, strict=True)), q * unit
