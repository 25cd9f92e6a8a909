"""A signed digraph in exact integers: sums over edges, searches, weak components, signs, hash.

:class:`Digraph` needs the standard library alone; its twin in ``fast.py`` gives the same answers by NumPy. What is
summed is integers of any size, and every sum is exact.
"""

from __future__ import annotations

import hashlib
import json
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, islice, pairwise
from typing import Any

from lmi.exact.numbers import common_denominator, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.reading import need

#: Lines hashed, and edges taken from arrays, at a time.
CHUNK = 65_536


def numbered(weights: Any) -> tuple[list[Any], list[int]]:
    """Return the distinct weights, and the number of each one; by their texts, whose hashes nobody can foresee."""
    distinct = {_text(w): w for w in weights}
    number = {text: k for k, text in enumerate(distinct)}
    return list(distinct.values()), [number[_text(w)] for w in weights]


def _text(w: Any) -> str:
    p, q = w.as_integer_ratio()
    return f"{p:x}/{q:x}"


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
    into, out : (starts, ends, negative)
        The edges that enter ``v``, and those that leave it, are those from ``starts[v]`` to ``starts[v + 1]``: the
        other ends, and 1 where the weight is negative.

    Raises
    ------
    RejectedError
        Not the edges of a graph, or in another order.

    Examples
    --------
    >>> g = Digraph("abc", [1, 0, 1], [0, 1, 2], [2, -3, 1], 1)
    >>> g.row(1), g.heard([1, 10, 100]), g.hearing([1, 10, 100])
    ({1: 3, 0: 3}, [20, 3, 10], [30, 102, 0])
    """

    def __init__(self, labels: Sequence[str], source: Any, target: Any, weights: Any, scale: int):
        self.labels, self.index, self.n = labels, {label: v for v, label in enumerate(labels)}, len(labels)
        self.source, self.target, self.scale, self.n_edges = source, target, scale, len(source)
        self._rows: dict[int, dict[int, int]] = {}
        self._formed = 0  # entries of these rows
        self._read(weights)
        self.ratios = [w.as_integer_ratio() for w in self.distinct]

    def _read(self, weights: Any) -> None:
        """Verify range and order; find the distinct weights, and which of them every edge has."""
        ends = list(zip(self.target, self.source, strict=True))
        need(all(a < b for a, b in pairwise(ends)), "edges are not in order, or one occurs twice")
        need(all(0 <= s < self.n and 0 <= t < self.n and s != t for t, s in ends), "an edge of a node to itself")
        need(all(weights), "an edge of weight 0")
        self.distinct, which = numbered(weights)
        self.which: Any = array("q", which)
        self.negative: Any = bytearray(w < 0 for w in weights)
        leaving = sorted(range(self.n_edges), key=self.source.__getitem__)
        self.into = _starts(self.n, self.target), memoryview(array("q", self.source)), memoryview(self.negative)
        self.out = (
            _starts(self.n, (self.source[e] for e in leaving)),
            memoryview(array("q", (self.target[e] for e in leaving))),
            memoryview(bytearray(self.negative[e] for e in leaving)),
        )

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
            starts, ends, _ = self.into
            first, last = starts[v], starts[v + 1]
            self._formed += last - first + 1
            sized(self._formed, self.bits, "the weights")
            own = {s: -self.values[k] for s, k in zip(ends[first:last], self.which[first:last], strict=True)}
            self._rows[v] = {v: sum(map(abs, own.values())), **{int(s): x for s, x in own.items()}} if own else {}
        return self._rows[v]

    @cached_property
    def diagonal(self) -> list[int]:
        """The diagonal of the signed Laplacian, times ``unit``."""
        return self.heard([1] * self.n)

    def sign(self, s: int, t: int) -> int:
        """Return the sign of the edge from ``s`` to ``t``, 0 if there is none."""
        starts, ends, negative = self.into
        at = bisect_left(ends, s, starts[t], starts[t + 1])
        return 0 if at == starts[t + 1] or ends[at] != s else -1 if negative[at] else 1

    @cached_property
    def listening(self) -> list[int]:
        """The nodes that some edge enters."""
        return [v for v, (a, b) in enumerate(pairwise(self.into[0])) if a < b]

    # ------------------------------------------------------------------ sums

    def heard(self, x: Sequence[int], signed: bool = False) -> list[int]:
        """Return the sums of ``|w| x[s]``, or ``w x[s]``, over the edges into every node; weights times ``unit``."""
        return self._sums(self.source, self.target, x, signed)

    def hearing(self, x: Sequence[int]) -> list[int]:
        """Return the sums of ``|w| x[t]`` over the edges out of every node; weights times ``unit``."""
        return self._sums(self.target, self.source, x, False)

    def moved(self, x: Sequence[int]) -> list[int]:
        """Return ``L x``, times ``unit``."""
        return [d * y - h for d, y, h in zip(self.diagonal, x, self.heard(x, signed=True), strict=True)]

    def compared(self, x: Sequence[int]) -> list[int]:
        """Return ``M(L) x`` with the comparison matrix of ``L``, times ``unit``."""
        return [d * y - h for d, y, h in zip(self.diagonal, x, self.heard(x), strict=True)]

    def left(self, group: Sequence[int], x: Sequence[int]) -> list[int]:
        """Return ``x' M(L_k)``, times ``unit``, for a group of nodes that no edge enters."""
        sums, rows = dict.fromkeys(group, 0), [self.row(v) for v in group]
        spend(sum(map(len, rows)), self.bits, longest(x), "left null vectors")
        for v, row, weight in zip(group, rows, x, strict=True):
            for j, a in row.items():
                sums[j] += weight * (a if j == v else -abs(a))
        return list(sums.values())

    def _sums(self, of: Any, to: Any, x: Sequence[int], signed: bool) -> list[int]:
        values, bits = self.values if signed else [abs(w) for w in self.values], longest(x)
        sized(self.n, self.bits + bits)
        spend(self.n_edges, self.bits, bits, "sums over edges")
        total = [0] * self.n
        for i, j, k in zip(of, to, self.which, strict=True):
            total[j] += values[k] * x[i]
        return total

    # ------------------------------------------------------------------ connection

    def reached(self, first: Sequence[int], back: bool = False, group: Sequence[int] | None = None) -> bytearray:
        """Mark what is reached from some nodes, along edges or against them; inside groups, if their numbers are given.

        Examples
        --------
        >>> list(Digraph("abc", [0, 1], [1, 2], [1, 1], 1).reached([1]))
        [0, 1, 1]
        """
        starts, ends, _ = self.into if back else self.out
        seen, todo = bytearray(self.n), list(first)
        for v in todo:
            seen[v] = 1
        while todo:
            v = todo.pop()
            for u in ends[starts[v] : starts[v + 1]].tolist():
                if not seen[u] and (group is None or group[u] == group[v]):
                    seen[u] = 1
                    todo.append(u)
        return seen

    @cached_property
    def pieces(self) -> tuple[list[int], set[int]]:
        """The smallest node of every node's weak component, and those components that no camps fit."""
        camp, piece, torn = bytearray(self.n), [-1] * self.n, set()
        for root in range(self.n):
            todo = [] if piece[root] >= 0 else [root]
            if todo:
                piece[root] = root
            while todo:
                v = todo.pop()
                for starts, ends, negative in (self.into, self.out):
                    first, last = starts[v], starts[v + 1]
                    for u, opposed in zip(ends[first:last].tolist(), negative[first:last].tolist(), strict=True):
                        if piece[u] < 0:
                            piece[u], camp[u] = root, camp[v] ^ opposed
                            todo.append(u)
                        elif camp[u] != camp[v] ^ opposed:
                            torn.add(root)
        return piece, torn

    def closed(self, group: Sequence[int]) -> bool:
        """Tell whether no edge enters a group from outside; -1 marks nodes of none."""
        return all(group[t] in (-1, group[s]) for s, t in zip(self.source, self.target, strict=True))

    def fits(self, gauge: Sequence[int]) -> bool:
        """Tell whether ``w gauge[s] gauge[t] > 0`` for all edges to a ``t`` whose gauge is not 0."""
        edges = zip(self.source, self.target, self.negative, strict=True)
        return all(not gauge[t] or gauge[s] * gauge[t] == (-1 if minus else 1) for s, t, minus in edges)

    # ------------------------------------------------------------------ pairs of edges

    @cached_property
    def mutual(self) -> tuple[bool, set[int]]:
        """Whether no two opposite edges differ in sign, and the pieces with an edge whose opposite is not its equal."""
        which = {(s, t): k for s, t, k in zip(self.source, self.target, self.which, strict=True)}
        piece, signs = self.pieces[0], [w < 0 for w in self.distinct]
        symmetric = all(signs[which.get((t, s), k)] == signs[k] for (s, t), k in which.items())
        return symmetric, {piece[s] for (s, t), k in which.items() if which.get((t, s)) != k}

    def antagonistic(self) -> set[int]:
        """Return the pieces with a negative weight."""
        piece = self.pieces[0]
        return {piece[s] for s, minus in zip(self.source, self.negative, strict=True) if minus}

    # ------------------------------------------------------------------ hash

    def sha256(self) -> str:
        """Return the SHA-256 of nodes and edges, in an order that depends on the labels alone."""
        quoted = [*map(json.JSONEncoder(ensure_ascii=False).encode, self.labels)]
        order = sorted(range(self.n), key=self.labels.__getitem__)
        rank = [0] * self.n
        for k, v in enumerate(order):
            rank[v] = k
        hashed = hashlib.sha256("".join(f"[{quoted[v]}]\n" for v in order).encode("utf-8", "surrogatepass"))
        columns = [f"[{label}, " for label in quoted], [f'{label}, "' for label in quoted]
        for lines in self._lines(rank, *columns, [f'{Fraction(p, q * self.scale)}"]\n' for p, q in self.ratios]):
            hashed.update(lines.encode("utf-8", "surrogatepass"))
        return hashed.hexdigest()

    def _lines(self, rank: Sequence[int], *columns: Sequence[str]) -> Iterator[str]:
        """Yield the lines of all edges, put together from texts of source, target and weight, ascending by rank."""
        edges = zip(self.source, self.target, self.which, strict=True)
        ordered = iter(sorted(edges, key=lambda edge: (rank[edge[0]], rank[edge[1]])))
        first, second, third = columns
        while lines := "".join(first[s] + second[t] + third[k] for s, t, k in islice(ordered, CHUNK)):
            yield lines


def _starts(n: int, nodes: Any) -> list[int]:
    """Return where every node's part of a sorted list begins, and the end."""
    counts = [0] * n
    for v in nodes:
        counts[v] += 1
    return [0, *accumulate(counts)]
