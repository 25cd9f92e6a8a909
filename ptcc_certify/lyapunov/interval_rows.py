"""Rows of a family with weights in intervals: the least pull of every row over all members, in integers, in one pass.

In ``sum_l |w_kl| (y_k - y_l)`` every weight has a factor that does not depend on weights. The least value of a row over
a mode is therefore taken at ``w+`` where ``y_l > y_k``, at ``w-`` elsewhere; over all members each row takes the mode
that is worst for it. What rows prove needs no more: the decay of followers, final values, boxes that attract.

References
----------
docs/theory/families.md, "Rows".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.dyadic import dyadic_array
from lmi.exact.fast import INT64_SAFE
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import nearest_float


@dataclass(frozen=True, eq=False)
class Policy:
    """One choice of weights: for every row a mode, for every edge one end of its interval.

    Attributes
    ----------
    mode : (n,) int array
    largest : (m,) bool array
        Edges at ``w+``; the others are at ``w-``.
    """

    mode: np.ndarray
    largest: np.ndarray

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Policy)
            and np.array_equal(self.mode, other.mode)
            and np.array_equal(self.largest, other.largest)
        )

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class IntervalRows:
    """The edges into some nodes, the *block*, in every mode.

    Made by :meth:`of`.

    Attributes
    ----------
    n, outside, modes : int
        Nodes of the block, other nodes, modes.
    mode, target, source : (m,) int array
        Sorted by mode and target. Nodes of the block are numbered from 0, the others from ``n``.
    sign : (m,) int8 array
    lower, upper : (m,) array of int64 or Python ints
        The sizes of the weights are these times ``unit``.
    unit : Fraction
    edge : (m,) int array
        The number of the edge in its mode.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2)])
    >>> rows = IntervalRows.of(chain.modes, np.array([1, 2]))
    >>> rows.pull(np.array([1, 3, 0])).tolist(), rows.pull(np.array([3, 1, 0])).tolist()
    ([[1, 2]], [[3, -4]])
    """

    n: int
    outside: int
    modes: int
    mode: np.ndarray
    target: np.ndarray
    source: np.ndarray
    sign: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    unit: Fraction
    edge: np.ndarray

    @classmethod
    def of(cls, modes: Sequence[Mode], nodes: np.ndarray) -> IntervalRows:
        """Return the rows of ``nodes`` (indices, ascending) in all modes."""
        total = len(modes[0].labels)
        place = np.full(total, -1, dtype=np.int64)
        place[nodes] = np.arange(nodes.size)
        others = np.flatnonzero(place < 0)
        place[others] = nodes.size + np.arange(others.size)
        keep = [np.flatnonzero(place[mode.target] < nodes.size) for mode in modes]
        numbers = np.repeat(np.arange(len(modes)), [k.size for k in keep])
        target, source, sign = (
            np.concatenate([getattr(m, end)[k] for m, k in zip(modes, keep, strict=True)])
            for end in ("target", "source", "sign")
        )
        tables, unit = _integers(
            [bound.take(k) for m, k in zip(modes, keep, strict=True) for bound in (m.lower, m.upper)]
        )
        lower, upper = np.concatenate(tables[::2]), np.concatenate(tables[1::2])
        edge = np.concatenate(keep)
        return cls(
            nodes.size, others.size, len(modes), numbers, place[target], place[source], sign, lower, upper, unit, edge
        )

    @cached_property
    def _floats(self) -> tuple[np.ndarray, np.ndarray]:
        unit = nearest_float(self.unit)
        return tuple(  # type: ignore[return-value]
            x * unit if x.dtype == np.int64 else np.array([nearest_float(v * self.unit) for v in x.tolist()])
            for x in (self.lower, self.upper)
        )

    @cached_property
    def _starts(self) -> tuple[np.ndarray, np.ndarray]:
        """The rows ``mode n + target`` that have edges, and the first edge of each."""
        return np.unique(self.mode * self.n + self.target, return_index=True)

    @cached_property
    def degree(self) -> int:
        """The most edges of a row."""
        return int(np.diff(self._starts[1], append=self.target.size).max(initial=0))

    # ------------------------------------------------------------------ rows

    def by_pair(self, family: Family, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return of every edge what belongs to its ends; ``nodes`` are the block, values in the order of pairs."""
        n = family.n_nodes
        node = np.concatenate([nodes, np.setdiff1d(np.arange(n), nodes)])
        source, target = family.pairs
        return values[np.searchsorted(target * n + source, node[self.target] * n + node[self.source])]

    def pull(self, values: np.ndarray, times: float | np.ndarray = 1.0, less: float = 0.0) -> np.ndarray:
        """Return the least ``sum_l |w_kl| (y_k - times y_l - less)`` of every row, in every mode.

        Parameters
        ----------
        values : (n + outside,) array
            ``y``. Of integers everything is exact, in units of ``unit``; of floats nothing is, and the unit is 1.
        times : float or (m,) array
            Of floats; by edge.
        less : float
            Of floats.

        Returns
        -------
        (modes, n) array
        """
        if values.dtype.kind == "f":
            low, high = self._floats
            gap = values[self.target] - times * values[self.source] - less
        else:
            low, high = self.lower, self.upper
            span = int(values.max(initial=0)) - int(values.min(initial=0))
            small = span < INT64_SAFE and self.degree * int(high.max(initial=0)) * span < INT64_SAFE
            kind: Any = np.int64 if small else object
            low, high, values = low.astype(kind), high.astype(kind), values.astype(kind)
            gap = values[self.target] - values[self.source]
        return self._sums(np.where(gap < 0, high, low) * gap)

    def largest_pushes(self, values: np.ndarray) -> np.ndarray:
        """Return the largest ``sum_l |w_kl| y_l`` of every row, in every mode; ``y >= 0``, of floats or integers."""
        if values.dtype.kind == "f":
            return self._sums(self._floats[1] * values[self.source])
        return self._sums(self.upper.astype(object) * values.astype(object)[self.source])

    def largest_sums(self, values: np.ndarray) -> np.ndarray:
        """Return the largest ``sum_l |w_kl| (y_k + y_l)`` of every row over all members; of integers ``y >= 0``, exact.

        Examples
        --------
        >>> from ptcc_certify.graphs.family import Family
        >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 1, 2)]).modes, np.array([1]))
        >>> rows.largest_sums(np.array([3, 1])).tolist()
        [8]
        """
        values = values.astype(object)
        return self._sums(self.upper.astype(object) * (values[self.target] + values[self.source])).max(axis=0)

    def _sums(self, terms: np.ndarray) -> np.ndarray:
        total = np.zeros(self.modes * self.n, dtype=terms.dtype)
        row, first = self._starts
        if row.size:
            total[row] = np.add.reduceat(terms, first)
        return total.reshape(self.modes, self.n)

    # ------------------------------------------------------------------ policies

    def worst(self, values: np.ndarray, times: float | np.ndarray = 1.0) -> Policy:
        """Return the choice of the least pull of every row, in floats."""
        mode = self.pull(values.astype(float), times).argmin(axis=0)
        return Policy(mode, times * values[self.source] > values[self.target])

    def edges_of(self, policy: Policy) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return targets, sources, weights in floats and places of the edges that a policy has, of weight 0 none."""
        low, high = self._floats
        weights = np.where(policy.largest, high, low)
        on = np.flatnonzero((self.mode == policy.mode[self.target]) & (weights > 0))
        return self.target[on], self.source[on], weights[on], on

    def in_weights(self, policy: Policy) -> np.ndarray:
        """Return ``sum_l |w_kl|`` of every row under a policy, in floats."""
        target, _, weights, _ = self.edges_of(policy)
        return np.bincount(target, weights, self.n).astype(float)  # of no edges they are integers

    def heard(self, policy: Policy, times: float | np.ndarray = 1.0) -> Any:
        """Return ``|w_kl|`` under a policy, (n, n + outside), in floats, each times what belongs to its edge."""
        from scipy import sparse

        target, source, weights, place = self.edges_of(policy)
        weights = weights * (times[place] if isinstance(times, np.ndarray) else times)
        on = weights > 0
        return sparse.csr_array((weights[on], (target[on], source[on])), shape=(self.n, self.n + self.outside))

    def system(self, policy: Policy, times: float | np.ndarray = 1.0) -> Any:
        """Return ``M`` (n, n) in floats: rows under a policy are ``M y``, less what is heard from outside the block."""
        from scipy import sparse

        return sparse.csr_array(sparse.diags_array(self.in_weights(policy)) - self.heard(policy, times)[:, : self.n])

    def lifted(self) -> IntervalRows:
        """Return the rows of ``(y, -y)``: node ``k`` of both numbers, ``-y_k`` as number ``n + k``, edges positive.

        Outside nodes ``z`` likewise: ``z_j`` and ``-z_j`` are numbers ``2n + j`` and ``2n + outside + j``.

        Examples
        --------
        >>> from ptcc_certify.graphs.family import Family
        >>> foes = IntervalRows.of(Family.from_intervals([("a", "b", -1, -1)]).modes, np.array([1])).lifted()
        >>> foes.source.tolist(), foes.target.tolist()
        ([3, 2], [0, 1])
        """
        n, o = self.n, self.outside
        negative = (self.sign < 0).astype(np.int64)
        base = np.where(self.source < n, self.source, n + self.source)  # of +source
        step = np.where(self.source < n, n, o)
        target = np.concatenate([self.target, self.target + n])
        source = np.concatenate([base + step * negative, base + step * (1 - negative)])
        mode, lower, upper, edge = (np.concatenate([x, x]) for x in (self.mode, self.lower, self.upper, self.edge))
        order = np.lexsort((source, target, mode))
        arrays = (mode, target, source, np.ones(target.size, dtype=np.int8), lower, upper)
        mode, target, source, sign, lower, upper = (x[order] for x in arrays)
        return IntervalRows(2 * n, 2 * o, self.modes, mode, target, source, sign, lower, upper, self.unit, edge[order])


def least_quotient(x: np.ndarray, y: np.ndarray) -> Fraction:
    """Return the least ``x_k / y_k`` of integers, ``y > 0``; at least one.

    Examples
    --------
    >>> least_quotient(np.array([2, 3]), np.array([3, 4]))
    Fraction(2, 3)
    """
    try:  # floats tell which may be the least
        ratios = x.astype(float) / y.astype(float)
        near = np.flatnonzero(~(ratios > ratios.min() + 2.0**-48 * abs(ratios.min())))
    except OverflowError:
        near = np.arange(x.size)
    return min(map(Fraction, x[near].tolist(), y[near].tolist()))


def _integers(weights: Sequence[Weights]) -> tuple[list[np.ndarray], Fraction]:
    """Return weights as integers over one unit, in int64 where they fit."""
    parts = [_whole(one) for one in weights]
    units = [unit for table, unit in parts if table.size]
    numerator = math.gcd(*(u.numerator for u in units)) or 1
    common = Fraction(numerator, math.lcm(*(u.denominator for u in units)))
    tables = []
    for table, unit in parts:
        times = int(unit / common) if table.size else 1
        large = times * int(table.max(initial=0)) >= INT64_SAFE
        tables.append(table.astype(object) * times if large else table.astype(np.int64) * times)
    return tables, common


def _whole(weights: Weights) -> tuple[np.ndarray, Fraction]:
    table = weights.table
    if table.dtype == np.int64:
        return table, Fraction(1, weights.scale)
    if table.dtype != object:
        whole, power = dyadic_array(table)
        return whole, Fraction(2) ** power
    exact = [Fraction(x) for x in table.tolist()]
    scale = math.lcm(*{x.denominator for x in exact})
    return np.array([x.numerator * (scale // x.denominator) for x in exact], dtype=object), Fraction(1, scale)
