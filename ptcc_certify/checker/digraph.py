"""A signed digraph in exact integers: sums over edges, searches, weak components, signs, hash.

What is summed is integers of any size, and every sum is exact. Edges are kept in arrays, by listener and by source.
"""

from __future__ import annotations

import hashlib
import json
from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, pairwise, starmap
from operator import eq, lt, mul
from typing import Any

from lmi.exact.numbers import common_denominator, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.reading import need

#: Where the edges of every node begin, and the end; their other ends; the numbers of their weights.
Adjacency = tuple[list[int], "array[int]", "array[int]"]


def numbered(weights: Any) -> tuple[list[Any], array[int]]:
    """Return the distinct weights, and the number of each one; long ones by their texts, whose hashes nobody foresees.

    Examples
    --------
    >>> numbered([2, -3, 2])
    ([2, -3], array('q', [0, 1, 0]))
    """
    keys: Any
    try:
        keys = weights if isinstance(weights, array) else array("q", weights)
    except (OverflowError, TypeError):
        keys = [f"{p:x}/{q:x}" for p, q in (w.as_integer_ratio() for w in weights)]
    distinct = dict(zip(keys, weights, strict=True))
    number = {key: k for k, key in enumerate(distinct)}
    return list(distinct.values()), array("q", map(number.__getitem__, keys))


class Digraph:
    """Edges with integer or rational weights over a scale.

    Parameters
    ----------
    labels : texts
    source, target : ints
        Strictly ascending by (target, source).
    weights : ints, floats or Fractions
        None is 0.
    scale : int
        What divides the weights.

    Attributes
    ----------
    into, out : Adjacency
        The edges that enter ``v``, and those that leave it, are those from ``offsets[v]`` to ``offsets[v + 1]``.
    distinct : list
        The weights that occur.

    Raises
    ------
    RejectedError
        Not the edges of a graph, or in another order.

    Examples
    --------
    >>> g = Digraph("abc", [1, 0, 1], [0, 1, 2], [2, -3, 1], 1)
    >>> g.row(1), g.sums_in([1, 10, 100]), g.sums_out([1, 10, 100])
    ({1: 3, 0: 3}, [20, 3, 10], [30, 102, 0])
    """

    def __init__(self, labels: Sequence[str], source: Any, target: Any, weights: Any, scale: int):
        self.labels, self.n = labels, len(labels)
        self.index = {label: v for v, label in enumerate(labels)}
        self.source, self.target = array("q", source), array("q", target)
        self.scale, self.n_edges = scale, len(source)
        self._rows: dict[int, dict[int, int]] = {}
        self._formed = 0  # entries of these rows
        ordered = all(starmap(lt, pairwise(zip(self.target, self.source, strict=True))))
        need(ordered, "edges are not in order, or one occurs twice")
        inside = all(min(ends, default=0) >= 0 and max(ends, default=0) < self.n for ends in (self.source, self.target))
        need(inside and not any(map(eq, self.source, self.target)), "an edge of a node to itself")
        need(all(weights), "an edge of weight 0")
        self.distinct, self.which = numbered(weights)
        self.minus = [w < 0 for w in self.distinct]
        self.ratios = [w.as_integer_ratio() for w in self.distinct]
        self.into: Adjacency = _offsets(self.n, self.target), self.source, self.which

    @cached_property
    def out(self) -> Adjacency:
        """The edges that leave every node; see the class."""
        offsets = _offsets(self.n, self.source)
        ends, which = array("q", self.target), array("q", self.which)
        place = list(offsets)
        for s, t, k in zip(self.source, self.target, self.which, strict=True):
            ends[place[s]], which[place[s]] = t, k
            place[s] += 1
        return offsets, ends, which

    # ------------------------------------------------------------------ weights

    @cached_property
    def unit(self) -> int:
        """A positive integer that makes every weight one."""
        unit = common_denominator({q for _, q in self.ratios}, len(self.ratios), "the weights")
        sized(len(self.ratios), longest(p for p, _ in self.ratios) + unit.bit_length(), "the weights")
        return unit * self.scale

    @cached_property
    def values(self) -> list[int]:
        """The distinct weights, times ``unit``."""
        unit = self.unit // self.scale
        return [p * (unit // q) for p, q in self.ratios]

    @cached_property
    def bits(self) -> int:
        """Bits of the longest entry of the Laplacian, times ``unit``."""
        return longest(self.values) + self.n.bit_length()

    def row(self, v: int) -> dict[int, int]:
        """Return row ``v`` of the signed Laplacian, times ``unit``, without zeros."""
        if v not in self._rows:
            sources, which = edges_of(self.into, v)
            self._formed += len(sources) + 1
            sized(self._formed, self.bits, "the weights")
            own = {s: -self.values[k] for s, k in zip(sources, which, strict=True)}
            self._rows[v] = {v: sum(map(abs, own.values())), **own} if own else {}
        return self._rows[v]

    def rational_row(self, v: int) -> dict[int, Fraction]:
        """Return row ``v`` of the signed Laplacian, without zeros."""
        return {j: Fraction(x, self.unit) for j, x in self.row(v).items()}

    @cached_property
    def diagonal(self) -> list[int]:
        """The diagonal of the signed Laplacian, times ``unit``."""
        return self.sums_in([1] * self.n)

    def sign(self, s: int, t: int) -> int:
        """Return the sign of the edge from ``s`` to ``t``, 0 if there is none."""
        offsets, ends, which = self.into
        at = bisect_left(ends, s, offsets[t], offsets[t + 1])
        return 0 if at == offsets[t + 1] or ends[at] != s else -1 if self.minus[which[at]] else 1

    @cached_property
    def listening(self) -> list[int]:
        """The nodes that some edge enters."""
        return [v for v, (a, b) in enumerate(pairwise(self.into[0])) if a < b]

    # ------------------------------------------------------------------ sums

    def sums_in(self, x: Sequence[int], signed: bool = False) -> list[int]:
        """Return the sums of ``|w| x[s]``, or ``w x[s]``, over the edges into every node; weights times ``unit``."""
        return self._sums(self.source, self.target, x, signed)

    def sums_out(self, x: Sequence[int]) -> list[int]:
        """Return the sums of ``|w| x[t]`` over the edges out of every node; weights times ``unit``."""
        return self._sums(self.target, self.source, x, False)

    def sums_by_part(self, x: Sequence[int], parts: Sequence[int], factors: Mapping[int, int]) -> list[int]:
        """Return the sums of ``factors[part] |w| x[s]`` over the edges into every node, of a part each; times ``unit``.

        Examples
        --------
        >>> Digraph("abc", [0, 1], [2, 2], [3, -4], 1).sums_by_part([1, 10, 0], [5, 7], {5: 1, 7: 100})
        [0, 0, 4003]
        """
        sizes = [abs(w) for w in self.values]
        bits, more = longest(x), longest(factors.values())
        sized(self.n, self.bits + bits + more)
        spend(2 * self.n_edges, self.bits + more, bits, "sums over edges")
        return self._add_by_part(sizes, x, parts, factors)

    def laplacian_product(self, x: Sequence[int], signed: bool = True) -> list[int]:
        """Return ``L x``, or ``M(L) x`` with the comparison matrix of ``L``; times ``unit``."""
        return [d * y - h for d, y, h in zip(self.diagonal, x, self.sums_in(x, signed), strict=True)]

    def left_product(self, group: Sequence[int], x: Sequence[int]) -> list[int]:
        """Return ``x' M(L_k)``, times ``unit``, for a group of nodes that no edge enters."""
        sums, rows = dict.fromkeys(group, 0), [self.row(v) for v in group]
        spend(sum(map(len, rows)), self.bits, longest(x), "left null vectors")
        for v, row, weight in zip(group, rows, x, strict=True):
            for j, a in row.items():
                sums[j] += weight * (a if j == v else -abs(a))
        return list(sums.values())

    def _sums(self, of: array[int], to: array[int], x: Sequence[int], signed: bool) -> list[int]:
        values, bits = self.values if signed else [abs(w) for w in self.values], longest(x)
        sized(self.n, self.bits + bits)
        spend(self.n_edges, self.bits, bits, "sums over edges")
        return self._add_over_edges(of, to, values, x)

    def _add_over_edges(self, of: array[int], to: array[int], values: Sequence[int], x: Sequence[int]) -> list[int]:
        total = [0] * self.n
        for j, y in zip(to, map(mul, map(values.__getitem__, self.which), map(x.__getitem__, of)), strict=True):
            total[j] += y
        return total

    def _add_by_part(
        self, sizes: Sequence[int], x: Sequence[int], parts: Sequence[int], factors: Mapping[int, int]
    ) -> list[int]:
        total = [0] * self.n
        for s, t, k, part in zip(self.source, self.target, self.which, parts, strict=True):
            total[t] += factors[part] * sizes[k] * x[s]
        return total

    # ------------------------------------------------------------------ connection

    def reached(self, first: Sequence[int], back: bool = False, group: Sequence[int] | None = None) -> bytearray:
        """Mark what is reached from some nodes, along edges or against them; inside groups, if their numbers are given.

        Examples
        --------
        >>> list(Digraph("abc", [0, 1], [1, 2], [1, 1], 1).reached([1]))
        [0, 1, 1]
        """
        offsets, ends, _ = self.into if back else self.out
        marks, todo = bytearray(self.n), list(first)
        for v in todo:
            marks[v] = 1
        while todo:
            v = todo.pop()
            for u in ends[offsets[v] : offsets[v + 1]]:
                if not marks[u] and (group is None or group[u] == group[v]):
                    marks[u] = 1
                    todo.append(u)
        return marks

    @staticmethod
    def signed_pieces(
        n: int, source: Sequence[int], target: Sequence[int], minus: Sequence[bool]
    ) -> tuple[list[int], list[bool], set[int]]:
        """Return the weak components of signed edges.

        Returns
        -------
        first : list of int
            The smallest node of every node's component.
        opposite : list of bool
            Whether camps that fit have the node against that one.
        odd : set of int
            The components that no camps fit.

        Examples
        --------
        >>> Digraph.signed_pieces(4, [0, 2, 3], [1, 3, 2], [True, False, True])
        ([0, 0, 2, 2], [False, True, False, False], {2})
        """
        parent, opposite = list(range(n)), [False] * n
        odd = set()

        def root(v: int) -> tuple[int, bool]:
            against = False
            while parent[v] != v:
                opposite[v] ^= opposite[parent[v]]
                parent[v] = parent[parent[v]]  # every other step is left out next time
                against ^= opposite[v]
                v = parent[v]
            return v, against

        for s, t, m in zip(source, target, minus, strict=True):
            (smaller, x), (larger, y) = sorted((root(s), root(t)))
            if smaller != larger:
                parent[larger], opposite[larger] = smaller, x ^ y ^ m
            elif x ^ y ^ m:
                odd.add(smaller)
        first, against = map(list, zip(*map(root, range(n)), strict=True))
        return first, against, {first[v] for v in odd}

    @cached_property
    def pieces(self) -> tuple[list[int], set[int]]:
        """The smallest node of every node's weak component, and those components that no camps fit."""
        minus = [self.minus[k] for k in self.which]
        first, _, odd = self.signed_pieces(self.n, self.source, self.target, minus)
        return first, odd

    def closed(self, group: Sequence[int]) -> bool:
        """Tell whether no edge enters a group from outside; -1 marks nodes of none."""
        inside = (v for v, home in enumerate(group) if home != -1)
        return all(group[s] == group[t] for t in inside for s in edges_of(self.into, t)[0])

    def fits(self, gauge: Sequence[int]) -> bool:
        """Tell whether ``w gauge[s] gauge[t] > 0`` for all edges to a ``t`` whose gauge is not 0."""
        into = ((g, edges_of(self.into, t)) for t, g in enumerate(gauge) if g)
        return all(gauge[s] == (-g if self.minus[k] else g) for g, edges in into for s, k in zip(*edges, strict=True))

    # ------------------------------------------------------------------ pairs of edges

    @cached_property
    def mutual(self) -> tuple[bool, set[int]]:
        """Whether no two opposite edges differ in sign, and the pieces with an edge whose opposite is not its equal."""
        piece = self.pieces[0]
        symmetric, odd = True, set()
        for v in range(self.n):
            sources, targets = edges_of(self.into, v), edges_of(self.out, v)
            if sources != targets:
                odd.add(piece[v])
                both = set(sources[0]).intersection(targets[0])
                symmetric &= all(self.sign(u, v) == self.sign(v, u) for u in both)
        return symmetric, odd

    def antagonistic(self) -> set[int]:
        """Return the pieces with a negative weight."""
        piece = self.pieces[0]
        return {piece[s] for s, k in zip(self.source, self.which, strict=True) if self.minus[k]}

    # ------------------------------------------------------------------ hash

    def sha256(self) -> str:
        """Return the SHA-256 of nodes and edges, in an order that depends on the labels alone."""
        order = sorted(range(self.n), key=self.labels.__getitem__)
        rank = sorted(range(self.n), key=order.__getitem__)
        quoted = [*map(json.JSONEncoder(ensure_ascii=False).encode, self.labels)]
        weights = [f', "{Fraction(p, q * self.scale)}"]\n' for p, q in self.ratios]
        hashed = hashlib.sha256("".join(f"[{quoted[v]}]\n" for v in order).encode("utf-8", "surrogatepass"))
        for lines in self._lines(order, rank, [f"[{label}, " for label in quoted], quoted, weights):
            hashed.update(lines.encode("utf-8", "surrogatepass"))
        return hashed.hexdigest()

    def _lines(self, order: Sequence[int], rank: Sequence[int], *texts: Sequence[str]) -> Iterator[str]:
        """Yield the lines of all edges, put together from texts of source, target and weight, ascending by rank."""
        first, second, third = texts
        for v in order:
            ends, which = edges_of(self.out, v)
            edges = sorted(zip(map(rank.__getitem__, ends), which, strict=True))
            yield "".join([first[v] + second[order[r]] + third[k] for r, k in edges])


def edges_of(adjacency: Adjacency, v: int) -> tuple[array[int], array[int]]:
    """Return the other ends of the edges of a node, and the numbers of their weights."""
    offsets, ends, which = adjacency
    part = slice(offsets[v], offsets[v + 1])
    return ends[part], which[part]


def _offsets(n: int, nodes: Iterable[int]) -> list[int]:
    """Return where every node's part of a sorted list begins, and the end."""
    counts = Counter(nodes)
    return [0, *accumulate(counts[v] for v in range(n))]
