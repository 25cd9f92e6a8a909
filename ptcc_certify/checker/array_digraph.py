"""The array twin of the graph: the same answers by NumPy, for graphs of many edges. Every sum is exact.

Nothing here decides what :class:`~ptcc_certify.checker.digraph.Digraph` does not decide by the standard library alone;
``tests/checker/test_digraph.py`` compares the two method by method.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ptcc_certify.checker.digraph import CHUNK, Digraph, numbered
from ptcc_certify.checker.reading import need

#: Bits of the digits in which arrays of long integers are summed, and the passes over all edges that this may take.
DIGIT, PASSES = 32, 200


class ArrayDigraph(Digraph):
    """The same with NumPy."""

    def _read(self, weights: Any) -> None:
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
            self.distinct, listed = numbered(weights)
            which = np.array(listed, dtype=np.int64)
        need(all(self.distinct), "an edge of weight 0")
        self.source, self.target, self.which = source, target, which
        self.negative = np.array([w < 0 for w in self.distinct], dtype=np.uint8)[which]
        self.leaving = np.argsort(source, kind="stable")
        self.into = self._part(target), memoryview(source), memoryview(self.negative)
        leaving = memoryview(target[self.leaving]), memoryview(self.negative[self.leaving])
        self.out = self._part(source), *leaving

    def _part(self, nodes: Any) -> list[int]:
        return [0, *np.cumsum(np.bincount(nodes, minlength=self.n)).tolist()]

    @cached_property
    def _parts(self) -> tuple[list[Any], int] | None:
        """The weights, times ``unit``, as digits of so many bits that sums of products fit in 64; None if too many."""
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
        number = np.array(group)
        home = number[self.target]
        return bool(((home == -1) | (home == number[self.source])).all())

    def fits(self, gauge: Sequence[int]) -> bool:
        """Tell whether camps fit; see :meth:`Digraph.fits`."""
        sign = np.array(gauge, dtype=np.int8)
        product = sign[self.source] * sign[self.target]
        return bool(((sign[self.target] == 0) | (product == 1 - 2 * self.negative.astype(np.int8))).all())

    @cached_property
    def mutual(self) -> tuple[bool, set[int]]:
        """Compare opposite edges; see :attr:`Digraph.mutual`."""
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
        return set(np.unique(np.array(self.pieces[0])[self.source[self.negative == 1]]).tolist())

    def _lines(self, rank: Sequence[int], *columns: Sequence[str]) -> Iterator[str]:
        place, texts = np.array(rank), [np.array(column, dtype=object) for column in columns]
        order = np.lexsort((place[self.target], place[self.source]))
        for first in range(0, self.n_edges, CHUNK):
            part = order[first : first + CHUNK]
            numbers = self.source[part], self.target[part], self.which[part]
            words = np.stack([text[number] for text, number in zip(texts, numbers, strict=True)], axis=1)
            yield "".join(words.ravel().tolist())
