"""The signed digraph as the check needs it: rows, exact sums over edges, searches, pieces, signs, hash.

:class:`Digraph` needs the standard library alone. :class:`ArrayDigraph` gives the same answers, with NumPy where edges
are many. What is summed is integers of any size, and every sum is exact.
"""

from __future__ import annotations

import hashlib
import json
import math
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import islice, pairwise
from typing import Any

from lmi.exact.work import spend
from ptcc_certify.checker.reading import common_denominator, longest, need, sized

#: From this number of edges on NumPy is used, where it is there.
MANY_EDGES = 10_000
#: Lines hashed, and edges taken from arrays, at a time.
CHUNK = 65_536
#: Bits of the digits in which arrays of long integers are summed, and the passes over all edges that this may take.
DIGIT, PASSES = 32, 200


def _numbered(weights: Any) -> tuple[list[Any], list[int]]:
    """Return the distinct weights, and the number of each one; by their texts, whose hashes nobody can foresee."""
    number: dict[str, int] = {}
    distinct: list[Any] = []
    which = []
    for w in weights:
        p, q = w.as_integer_ratio()
        k = number.setdefault(f"{p:x}/{q:x}", len(distinct))
        if k == len(distinct):
            distinct.append(w)
        which.append(k)
    return distinct, which


class Digraph:
    """Edges with integer or rational weights over a scale.

    Parameters
    ----------
    n : int
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
    >>> g = Digraph(3, [1, 0, 1], [0, 1, 2], [2, -3, 1], 1)
    >>> g.row(1), g.heard([1, 10, 100]), g.hearing([1, 10, 100])
    ({1: 3, 0: 3}, [20, 3, 10], [30, 102, 0])
    """

    def __init__(self, n: int, source: Any, target: Any, weights: Any, scale: int):
        self.n, self.source, self.target, self.scale = n, source, target, scale
        self.n_edges = len(source)
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
        self.distinct, which = _numbered(weights)
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

    def listening(self) -> list[int]:
        """Return the nodes that some edge enters."""
        return [v for v, (a, b) in enumerate(pairwise(self.into[0])) if a < b]

    # ------------------------------------------------------------------ sums

    def heard(self, x: Sequence[int], signed: bool = False) -> list[int]:
        """Return the sums of ``|w| x[s]``, or ``w x[s]``, over the edges into every node; weights times ``unit``."""
        return self._sums(self.source, self.target, x, signed)

    def hearing(self, x: Sequence[int]) -> list[int]:
        """Return the sums of ``|w| x[t]`` over the edges out of every node; weights times ``unit``."""
        return self._sums(self.target, self.source, x, False)

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
        >>> list(Digraph(3, [0, 1], [1, 2], [1, 1], 1).reached([1]))
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

    def sha256(self, labels: Sequence[str]) -> str:
        """Return the SHA-256 of nodes and edges, in an order that depends on the labels alone."""
        quoted = [*map(json.JSONEncoder(ensure_ascii=False).encode, labels)]
        order = sorted(range(self.n), key=labels.__getitem__)
        rank = [0] * self.n
        for k, v in enumerate(order):
            rank[v] = k
        hashed = hashlib.sha256("".join(f"[{quoted[v]}]\n" for v in order).encode("utf-8", "surrogatepass"))
        columns = [f"[{label}, " for label in quoted], [f'{label}, "' for label in quoted]
        for lines in self._lines(rank, *columns, [f'{self._text(p, q)}"]\n' for p, q in self.ratios]):
            hashed.update(lines.encode("utf-8", "surrogatepass"))
        return hashed.hexdigest()

    def _text(self, p: int, q: int) -> str:
        common = math.gcd(p, self.scale)
        below = q * (self.scale // common)
        return f"{p // common}" if below == 1 else f"{p // common}/{below}"

    def _lines(self, rank: Sequence[int], *columns: Sequence[str]) -> Iterator[str]:
        """Yield the lines of all edges, put together from texts of source, target and weight, ascending by rank."""
        edges = zip(self.source, self.target, self.which, strict=True)
        ordered = iter(sorted(edges, key=lambda edge: (rank[edge[0]], rank[edge[1]])))
        first, second, third = columns
        while lines := "".join(first[s] + second[t] + third[k] for s, t, k in islice(ordered, CHUNK)):
            yield lines


def _starts(n: int, nodes: Any) -> list[int]:
    """Return where every node's part of a sorted list begins, and the end."""
    starts = [0] * (n + 1)
    for v in nodes:
        starts[v + 1] += 1
    for v in range(n):
        starts[v + 1] += starts[v]
    return starts


class ArrayDigraph(Digraph):
    """The same with NumPy."""

    def _read(self, weights: Any) -> None:
        import numpy as np

        n = self.n
        source: Any = np.asarray(self.source, dtype=np.int64)
        target: Any = np.asarray(self.target, dtype=np.int64)
        inside = (source >= 0) & (source < n) & (target >= 0) & (target < n) & (source != target)
        need(bool(inside.all()), "an edge of a node to itself")
        above, beside = target[1:] > target[:-1], (target[1:] == target[:-1]) & (source[1:] > source[:-1])
        need(bool((above | beside).all()), "edges are not in order, or one occurs twice")
        if isinstance(weights, array):
            values, which = np.unique(np.asarray(weights), return_inverse=True)
            self.distinct = values.tolist()
        else:
            self.distinct, listed = _numbered(weights)
            which = np.array(listed, dtype=np.int64)
        need(all(self.distinct), "an edge of weight 0")
        self.source, self.target, self.which = source, target, which
        self.negative = np.array([w < 0 for w in self.distinct], dtype=np.uint8)[which]
        self.leaving = np.argsort(source, kind="stable")
        self.into = self._part(target), memoryview(source), memoryview(self.negative)
        leaving = memoryview(target[self.leaving]), memoryview(self.negative[self.leaving])
        self.out = self._part(source), *leaving

    def _part(self, nodes: Any) -> list[int]:
        import numpy as np

        return [0, *np.cumsum(np.bincount(nodes, minlength=self.n)).tolist()]

    @cached_property
    def _parts(self) -> tuple[list[Any], int] | None:
        """The weights, times ``unit``, as digits of so many bits that sums of products fit in 64; None if too many."""
        import numpy as np

        degree = max(b - a for starts in (self.into[0], self.out[0]) for a, b in pairwise(starts))
        bits = 62 - DIGIT - degree.bit_length()
        longest = max(abs(w).bit_length() for w in self.values)
        if bits < 1 or longest > PASSES * bits:
            return None
        sizes, parts = [abs(w) for w in self.values], []
        for shift in range(0, longest, bits):
            digits = [(w >> shift) & ((1 << bits) - 1) for w in sizes]
            parts.append(np.array(digits, dtype=np.int64)[self.which])
        return parts, bits

    def _sums(self, of: Any, to: Any, x: Sequence[int], signed: bool) -> list[int]:
        import numpy as np

        parts, bits = self._parts or ([], 0)
        width = max(max(x).bit_length(), min(x).bit_length()) // DIGIT + 1
        if len(parts) * width not in range(1, PASSES + 1):
            return super()._sums(of, to, x, signed)
        starts = np.array((self.into if to is self.target else self.out)[0])
        order = slice(None) if to is self.target else self.leaving
        sign = 1 - 2 * self.negative.astype(np.int64) if signed else 1
        weights, at, some = [(sign * part)[order] for part in parts], of[order], np.flatnonzero(np.diff(starts))
        # Two's complement: the last digit has the sign.
        content = b"".join([value.to_bytes(width * DIGIT // 8, "little", signed=True) for value in x])
        digits = np.frombuffer(content, dtype="<u4").reshape(self.n, width)
        total = np.zeros(some.size, dtype=object)
        for k in range(width):
            digit = np.ascontiguousarray(digits[:, k])
            each = (digit.view("<i4") if k == width - 1 else digit).astype(np.int64)[at]
            for m, weight in enumerate(weights):
                found = np.add.reduceat(weight * each, starts[some])
                total += found.astype(object) << (k * DIGIT + m * bits)
        sums = np.zeros(self.n, dtype=object)
        sums[some] = total
        return sums.tolist()

    @cached_property
    def pieces(self) -> tuple[list[int], set[int]]:
        """Weak components and those in conflict, from the signed double cover; see :attr:`Digraph.pieces`.

        Node ``v`` is there twice, ``v`` and ``v + n``: with either sign. An edge joins equal or opposite signs. Camps
        exclude each other where both copies of a node are connected.
        """
        import numpy as np

        n, over = self.n, self.n * self.negative.astype(np.int64)
        x = np.concatenate([self.source, self.source + n])
        y = np.concatenate([self.target + over, self.target + n - over])
        label = np.arange(2 * n)
        while x.size:
            # Each label takes the smallest one next to it, then that one's, and so on.
            a, b = label[x], label[y]
            np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
            while (label != (further := label[label])).any():
                label = further
            apart = label[x] != label[y]
            x, y = x[apart], y[apart]
        first = np.minimum(label[:n], label[n:])
        return first.tolist(), set(first[label[:n] == label[n:]].tolist())

    def closed(self, group: Sequence[int]) -> bool:
        """Tell whether no edge enters a group from outside; see :meth:`Digraph.closed`."""
        import numpy as np

        number = np.array(group)
        home = number[self.target]
        return bool(((home == -1) | (home == number[self.source])).all())

    def fits(self, gauge: Sequence[int]) -> bool:
        """Tell whether camps fit; see :meth:`Digraph.fits`."""
        import numpy as np

        sign = np.array(gauge, dtype=np.int8)
        product = sign[self.source] * sign[self.target]
        return bool(((sign[self.target] == 0) | (product == 1 - 2 * self.negative.astype(np.int8))).all())

    @cached_property
    def mutual(self) -> tuple[bool, set[int]]:
        """Compare opposite edges; see :attr:`Digraph.mutual`."""
        import numpy as np

        source, target = self.source[self.leaving], self.target[self.leaving]
        keys, opposite = self.target * self.n + self.source, source * self.n + target
        at = np.minimum(np.searchsorted(keys, opposite), self.n_edges - 1)
        there, other = keys[at] == opposite, self.which[at]
        own = self.which[self.leaving]
        minus = np.array([w < 0 for w in self.distinct])
        odd = np.array(self.pieces[0])[source[~there | (other != own)]]
        return bool((~there | (minus[other] == minus[own])).all()), set(np.unique(odd).tolist())

    def antagonistic(self) -> set[int]:
        """Return the pieces with a negative weight."""
        import numpy as np

        return set(np.unique(np.array(self.pieces[0])[self.source[self.negative == 1]]).tolist())

    def _lines(self, rank: Sequence[int], *columns: Sequence[str]) -> Iterator[str]:
        import numpy as np

        place, texts = np.array(rank), [np.array(column, dtype=object) for column in columns]
        order = np.lexsort((place[self.target], place[self.source]))
        for first in range(0, self.n_edges, CHUNK):
            part = order[first : first + CHUNK]
            numbers = self.source[part], self.target[part], self.which[part]
            words = np.stack([text[number] for text, number in zip(texts, numbers, strict=True)], axis=1)
            yield "".join(words.ravel().tolist())


def digraph(n: int, source: Any, target: Any, weights: Any, scale: int, numpy: bool) -> Digraph:
    """Return the graph in the form that is faster."""
    kind = ArrayDigraph if numpy and len(source) >= MANY_EDGES else Digraph
    return kind(n, source, target, weights, scale)
