"""The array twin of the graph: the same answers by NumPy, for graphs of many edges. Every sum is exact.

Nothing here decides what :class:`~ptcc_certify.checker.digraph.Digraph` does not decide by the standard library alone;
``tests/checker/test_digraph.py`` compares the two method by method.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.numbers import longest
from ptcc_certify.checker.digraph import Adjacency, Digraph

#: Edges taken at a time; and where sums have so few bits that int64 holds them.
CHUNK, LONG_CHUNK, INT64_BITS = 8192, 1 << 18, 62


class ArrayDigraph(Digraph):
    """A :class:`Digraph` whose sums, searches for pieces and lines of the hash are by NumPy."""

    @cached_property
    def out(self) -> Adjacency:
        """The edges that leave every node; see :attr:`Digraph.out`."""
        leaving = np.argsort(np.asarray(self.source), kind="stable")
        ends, which = (array("q", np.asarray(part)[leaving].tobytes()) for part in (self.target, self.which))
        offsets = np.bincount(np.asarray(self.source), minlength=self.n).cumsum().tolist()
        return [0, *offsets], ends, which

    @cached_property
    def degree_bits(self) -> int:
        """Bits of the largest number of edges that enter a node, or leave one."""
        degrees = [int(np.bincount(np.asarray(ends)).max(initial=0)) for ends in (self.source, self.target)]
        return max(degrees).bit_length()

    def _add_over_edges(self, of: Any, to: Any, values: Sequence[int], x: Sequence[int]) -> list[int]:
        short = longest(values) + longest(x) + self.degree_bits <= INT64_BITS
        kind: Any = np.int64 if short else object
        total = np.zeros(self.n, dtype=kind)
        weights, numbers = np.array(values, dtype=kind), np.array(x, dtype=kind)
        step = LONG_CHUNK if short else min(CHUNK, self.n)  # so many products take no more memory than the sums
        for first in range(0, self.n_edges, step):
            i, j, k = (np.asarray(part)[first : first + step] for part in (of, to, self.which))
            np.add.at(total, j, weights[k] * numbers[i])
        return total.tolist()

    def _add_by_part(
        self, sizes: Sequence[int], x: Sequence[int], parts: Sequence[int], factors: Mapping[int, int]
    ) -> list[int]:
        if longest(sizes) + longest(x) + self.degree_bits > INT64_BITS:
            return super()._add_by_part(sizes, x, parts, factors)
        weights, numbers, each = np.array(sizes), np.array(x), np.asarray(parts)
        total = np.zeros(self.n, dtype=object)
        for part in np.unique(each).tolist():
            of, to, which = (np.asarray(y)[each == part] for y in (self.source, self.target, self.which))
            sums = np.zeros(self.n, dtype=np.int64)
            np.add.at(sums, to, weights[which] * numbers[of])
            heard = np.flatnonzero(sums)
            total[heard] += factors[part] * sums[heard].astype(object)
        return total.tolist()

    @staticmethod
    def signed_pieces(
        n: int, source: Sequence[int], target: Sequence[int], minus: Sequence[bool]
    ) -> tuple[list[int], list[bool], set[int]]:
        """Return weak components from the signed double cover; see :meth:`Digraph.signed_pieces`.

        Node ``v`` is there twice, ``v`` and ``v + n``: with either sign. An edge joins equal or opposite signs. Camps
        exclude each other where both copies of a node are connected.
        """
        tails, heads = np.asarray(source), np.asarray(target)
        over = n * np.array(minus, dtype=np.int64)
        x, y = np.concatenate([tails, tails + n]), np.concatenate([heads + over, heads + n - over])
        label = np.arange(2 * n)
        while x.size:
            # Each label takes the smallest one next to it, then that one's, and so on.
            a, b = label[x], label[y]
            np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
            while (label != (further := label[label])).any():
                label = further
            apart = label[x] != label[y]
            x, y = x[apart], y[apart]
        positive, negative = label[:n], label[n:]
        first = np.minimum(positive, negative)
        return first.tolist(), (negative < positive).tolist(), set(first[positive == negative].tolist())

    def _lines(self, order: Sequence[int], rank: Sequence[int], *texts: Sequence[str]) -> Iterator[str]:
        edges, place = [np.asarray(part) for part in (self.source, self.target, self.which)], np.array(rank)
        ordered, columns = np.lexsort((place[edges[1]], place[edges[0]])), [np.array(x, dtype=object) for x in texts]
        for first in range(0, self.n_edges, CHUNK):
            part = ordered[first : first + CHUNK]
            words = [column[numbers[part]] for column, numbers in zip(columns, edges, strict=True)]
            yield "".join(np.stack(words, axis=1).ravel().tolist())
