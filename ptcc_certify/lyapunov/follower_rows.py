"""Rows of followers of single leaders: the vectors ``u > 0`` by which late messages and moving leaders are certified.

``D`` holds the in-weights of the followers, ``|W_F|`` the sizes of the weights among them. For ``q >= 1``

    D_k u_k - q sum_l |w_kl| u_l >= b u_k    for every follower k

has a solution with ``b > 0`` iff ``q`` is below 1 over the spectral radius of ``D^-1 |W_F|``: ``u = (D - q |W_F| - t
I)^-1 1``, ``t`` just below the smallest eigenvalue of ``D - q |W_F|``. With ``q = 1`` it is the
row-wise decay rate of followers. Where what is heard over an edge is younger than elsewhere, ``q`` has a smaller power.
Where weights are uncertain, or a graph is one of several, the row of every follower is that of the worst member.

Rows of a family with weights in intervals: the least pull of every row over all members, in integers, in one pass.

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
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.dyadic import dyadic_array, round_array, round_to_bits
from lmi.errors import LMIError, NoCertificate
from lmi.exact.fast import INT64_SAFE
from lmi.sparse_h_matrix import DIRECT_ROWS, positive_vector, smallest_eigenvalue
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.refusals import refuse_leader_groups
from ptcc_certify.theorems.family_behaviour import decide


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


#: What floats may have lost in a row: a share of ``b``, and of the terms that cancel. The check forms rows exactly.
_SLACK, _ROUNDING = 1e-9, 1e-13
#: Residual of a solve for ``u``, in every row.
_LOOSE = 0.05
#: Inverse iterations for many followers.
_ROUNDS = 3
#: Members of a family that are tried one after the other, each the worst for the vector of the last.
_POLICIES = 20
#: Halvings of what errors of values add.
_FLOORS = 40
#: Products by which what errors of values add at least is found.
_ITERATIONS = 200
#: Products by which the largest ``q`` is found, halvings where ages differ, and the largest one that is tried then.
_PRODUCTS, _HALVINGS, _LARGEST = 30, 8, 1e12


@dataclass(frozen=True, eq=False)
class RowWitness:
    """``q``, ``b`` and ``u``, rounded, with ``D_k u_k - q sum_l |w_kl| u_l >= b u_k`` for every follower.

    Attributes
    ----------
    q, b : Fraction
        ``q >= 1``; ``b > 0`` in units of weight.
    u : (F,) array
        Positive floats of 40 bits, the largest 1.
    """

    q: Fraction
    b: Fraction
    u: np.ndarray


class FollowerRows:
    """The agents that hear others, if all others are leaders that rest or move as they like; of a graph or a family.

    Parameters
    ----------
    of : Structure or Family
    shares : (P,) array, optional
        By ordered pair of an edge, as :func:`ptcc_certify.graphs.family.Family.pairs` has them, how old is what is
        heard over it in terms of the oldest: ``q`` has this power there. All 1 by default.

    Attributes
    ----------
    followers : (F,) int array
        Their nodes.
    n_nodes : int
        Number of agents.
    D : (F,) array
        Their in-weights, in the member whose rows were the worst at last.
    W : (F, F) sparse array
        ``|W_F|`` of this member: listeners are rows.

    Raises
    ------
    HypothesisError
        Nobody listens to anybody, a leader belongs to a group, or where followers are drawn to depends on the signal.

    Examples
    --------
    >>> chain = FollowerRows(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1), (3, 2, 1)])))
    >>> witness = chain.witness(Fraction(5, 4))
    >>> round(float(witness.b), 3), chain.largest_q() > 1.4
    (0.154, True)
    >>> from ptcc_certify.graphs.family import Family
    >>> unsure = FollowerRows(Family.from_intervals([(1, 2, 1, 2), (2, 3, 1, 2), (3, 2, "0.5", 1)]))
    >>> round(float(unsure.witness(Fraction(5, 4)).b), 3)
    0.154
    """

    def __init__(self, of: Structure | Family, shares: np.ndarray | None = None):
        if isinstance(of, Structure):
            refuse_leader_groups(of, "a bound row by row")
            self.structure, family, self.followers = of, Family.from_graph(of.graph), of.followers
        else:
            family, self.followers = of, listeners(of)
        if not self.followers.size:
            raise HypothesisError("nobody listens to anybody, so there is nothing that could be late; add edges")
        if isinstance(of, Family):
            refuse_other_targets(family)
        self.n_nodes = family.n_nodes
        self.intervals = IntervalRows.of(family.modes, self.followers)
        self._known = family.graph is not None
        edges = self.intervals.edge.size
        self.shares = np.ones(edges) if shares is None else self.intervals.by_pair(family, self.followers, shares)
        self._smallest: dict[Fraction, float] = {}
        self._set(self.intervals.worst(self._all(np.ones(self.followers.size)), 1.0))

    @property
    def least_share(self) -> Fraction:
        """The least positive share of an edge; 1 if there is none."""
        return Fraction(float(self.shares[self.shares > 0].min(initial=1.0)))

    def by_age(self) -> dict[float, Any]:
        """Return ``|W_F|`` of the member at hand in parts, edges of one share each."""
        ages = np.unique(self._inner_shares()).tolist()
        return {x: self._heard((self.shares == x).astype(float)) for x in ages}

    def _heard(self, times: float | np.ndarray = 1.0) -> Any:
        """Return ``|W_F|`` of the member at hand, each entry times what belongs to its edge."""
        return self.intervals.heard(self._policy, times)[:, : self.intervals.n]

    def _inner_shares(self) -> np.ndarray:
        """Return the shares of edges among followers, in the member at hand."""
        _, source, _, place = self.intervals.edges_of(self._policy)
        return np.asarray(self.shares[place[source < self.D.size]])

    def share(self, u: np.ndarray) -> np.ndarray:
        """Return ``(|W_F| u)_k / (D_k u_k)`` for every follower, in the member at hand."""
        return (self.W @ u) / (self.D * u)

    def largest_q(self) -> float:
        """Bound from below the largest ``q`` that leaves a positive ``b``: infinite without a cycle of followers."""
        u = self.witness(Fraction(1), 0.01).u
        least = float(self.share(u).max())
        for _ in range(_PRODUCTS):
            u = u + (self.W @ u) / self.D
            u /= u.max()
            least = min(least, float(self.share(np.maximum(u, 1e-200)).max()))
        if not least > 0:
            return math.inf
        alike = bool((self.shares == 1).all()) or u.size > DIRECT_ROWS
        return 1 / least if alike else self._largest_power(1 / least, u)

    def _largest_power(self, q: float, u: np.ndarray) -> float:
        """Return a larger ``q`` than one that serves if all edges have share 1, where some have less."""
        inner = self._inner_shares()
        if not (inner > 0).any():
            return math.inf
        low, high = math.log(max(q, 1.0)), min(math.log(max(q, 1.0)) / inner[inner > 0].min(), math.log(_LARGEST))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            heard = self._heard(math.exp(middle) ** self.shares)
            for _ in range(_PRODUCTS):
                u = np.maximum(u + (heard @ u) / self.D, 1e-200)
                u /= u.max()
            low, high = (middle, high) if ((heard @ u) / (self.D * u)).max() < 1 else (low, middle)
        return math.exp(low)

    def witness(self, q: Fraction, loss: float = 0.01) -> RowWitness:
        """Return a witness whose ``b`` is about ``1 - loss`` of the largest for this ``q``.

        Raises
        ------
        NoCertificate
            No positive ``b`` was found: ``q`` is too large.
        """
        return self.rounded(q, self._vector(q, loss))

    def _vector(self, q: Fraction, loss: float) -> np.ndarray:
        """Return ``u`` in floats: that of one member after the other, each the worst for the last, until it stands."""
        for _ in range(_POLICIES):
            M = self.intervals.system(self._policy, float(q) ** self.shares)
            if q not in self._smallest:
                self._smallest[q] = _smallest(M)
            u = positive_vector(M, self._smallest[q] * (1 - loss))
            if not (np.isfinite(u).all() and u.min() > 1e-280 * u.max()):
                raise NoCertificate(f"no positive vector for q = {float(q):.6g}")
            if not self._take(u, float(q)):
                break
        return np.asarray(u)

    def rounded(self, q: Fraction, u: np.ndarray) -> RowWitness:
        """Return the witness of a vector, rounded, with the largest ``b`` that leaves room for rounding.

        Raises
        ------
        NoCertificate
            It is not positive.
        """
        u = round_array(u / u.max())
        lost = self.weights + float(q) * self.intervals.largest_pushes(self._all(u)).max(axis=0) / u
        b = float((self._least(u, float(q)) / u - _ROUNDING * lost).min())
        if not b > 0:
            raise NoCertificate(f"no positive b for q = {float(q):.6g}")
        return RowWitness(q, Fraction(round_to_bits(b * (1 - _SLACK), 53)), u)

    # ------------------------------------------------------------------ over all members

    def decay(self, witness: RowWitness, q: float) -> float:
        """Return the ``b`` that the ``u`` of a witness proves with another ``q``, in floats."""
        return float((self._least(witness.u, q) / witness.u).min())

    @cached_property
    def weights(self) -> np.ndarray:
        """``D`` at most."""
        ones = np.ones(self.intervals.n + self.intervals.outside)
        return np.asarray(self.intervals.largest_pushes(ones).max(axis=0))

    def _rounding(self, u: np.ndarray) -> np.ndarray:
        """Return by how much sums of ``|w_kl| (u_k - u_l)`` in floats are off at most, for every follower."""
        return np.asarray((u.size + 4) * 2.0**-52 * self.largest(u))

    def slack(self, witness: RowWitness) -> np.ndarray:
        """Return ``sum_l |w_kl| (u_k - u_l)`` of every follower, at least: as in floats, and as the witness proves."""
        u = witness.u
        pulled = self.intervals.pull(self._all(u)).min(axis=0) - self._rounding(u)
        return np.maximum(pulled, float(witness.b) * (1 - 1e-15) * u)

    def floor(self, witness: RowWitness, error: float) -> float:
        """Return about the least ``f`` with ``sum_l |w_kl| (f (u_k - u_l) - error) >= 0`` for every follower.

        Halved towards it: at the largest weights of the least rows all are known to hold.
        """
        u = witness.u
        low, high = error, float((self.weights / self.slack(witness)).max()) * error
        for _ in range(0 if self._known else _FLOORS):
            middle = (low + high) / 2
            pulled = self.intervals.pull(self._all(middle * u), less=error)
            holds = bool((pulled >= self._rounding(middle * u)).all())
            low, high = (low, middle) if holds else (middle, high)
        return high

    def kept_off(self, error: float) -> np.ndarray:
        """Return what every ``y`` exceeds with ``D_k y_k - sum_l |w_kl| y_l >= error D_k`` for every follower.

        By the member that decays the least; any serves.
        """
        if not self._known:
            with suppress(LMIError):
                self._vector(Fraction(1), 0.01)
        y = np.zeros(self.D.size)
        for _ in range(_ITERATIONS):
            y = (self.W @ y) / self.D + error
        return y

    def largest(self, u: np.ndarray) -> np.ndarray:
        """Return ``sum_l |w_kl| (u_k + u_l)`` of every follower, at most."""
        return np.asarray(self.weights * u + self.intervals.largest_pushes(self._all(u)).max(axis=0))

    def _least(self, u: np.ndarray, q: float) -> np.ndarray:
        """Return ``sum_l |w_kl| (u_k - q^share u_l)`` of every follower, at least."""
        return np.asarray(self.intervals.pull(self._all(u), q**self.shares).min(axis=0))

    def _all(self, u: np.ndarray) -> np.ndarray:
        return np.concatenate([u, np.zeros(self.intervals.outside)])

    def _take(self, u: np.ndarray, q: float) -> bool:
        """Take the member whose rows are the worst for ``u``; tell whether it is another."""
        policy = self._policy if self._known else self.intervals.worst(self._all(u), q**self.shares)
        if policy == self._policy:
            return False
        self._set(policy)
        return True

    def _set(self, policy: Policy) -> None:
        self._policy = policy
        self._smallest.clear()
        self.D, self.W = self.intervals.in_weights(policy), self._heard()


def listeners(family: Family) -> np.ndarray:
    """Return the agents that hear others in some mode, ascending.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> listeners(Family.from_intervals([("a", "b", 0, 1), ("b", "c", 1, 1)])).tolist()
    [1, 2]
    """
    return np.unique(family.union[1])


def leading_group(family: Family, asked: str = "late messages") -> str | None:
    """Return who leads and hears others in some mode, or None; refuse a family whose targets depend on the signal.

    Parameters
    ----------
    family : Family
    asked : str
        What is asked of it.

    Raises
    ------
    HypothesisError
        The targets depend on the signal.

    Examples
    --------
    >>> leading_group(Family.from_intervals([(1, 2, 1, 2), (2, 1, 1, 2)]))
    '1'
    """
    found = None
    for component in decide(family):
        kernel = component.kernel
        if kernel is None or component.behaviour is None:
            where = "where the signal decides where agents are drawn to"
            raise HypothesisError(f"with {asked} nothing is proved yet of families {where}; leave it out")
        heard = set(listeners(component.family).tolist())
        group = next((c for c in kernel.structure.closed_components if heard.intersection(c.nodes)), None)
        if found is None and group is not None:
            found = shorten(component.family.labels[group.nodes[0]])
    return found


def refuse_other_targets(family: Family, asked: str = "late messages", mend: str = "leave it out") -> None:
    """Refuse a family of whose members the followers of leaders that are single nodes have no common targets.

    Parameters
    ----------
    family : Family
    asked, mend : str
        What is asked of it, and what to do instead.

    Raises
    ------
    HypothesisError
        Tells who hears whom, or that the targets depend on the signal.
    """
    if (leader := leading_group(family, asked)) is not None:
        raise HypothesisError(
            f"with {asked} nothing is proved yet where leaders hear others; {leader} leads and hears others: {mend}"
        )


def _smallest(M: Any) -> float:
    """Bound the smallest eigenvalue from below, of many rows by a few loose solves."""
    n = M.shape[0]
    found = (
        smallest_eigenvalue(M)
        if n <= DIRECT_ROWS
        else smallest_eigenvalue(M, rounds=_ROUNDS, residual=_LOOSE / math.sqrt(n))
    )
    if found is None:
        raise NoCertificate("followers decay too slowly for solves to tell")
    return found[0]
