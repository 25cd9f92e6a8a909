"""Rows of followers of single leaders: the vectors ``u > 0`` by which late messages and moving leaders are certified.

``D`` holds the in-weights of the followers, ``|W_F|`` the sizes of the weights among them. For ``q >= 1``

    D_k u_k - q sum_l |w_kl| u_l >= b u_k    for every follower k

has a solution with ``b > 0`` iff ``q`` is below 1 over the spectral radius of ``D^-1 |W_F|``: ``u = (D - q |W_F| - t
I)^-1 1``, ``t`` just below the smallest eigenvalue of ``D - q |W_F|``. With ``q = 1`` it is the
row-wise decay rate of followers. Where what is heard over an edge is younger than elsewhere, ``q`` has a smaller power.
Where weights are uncertain, or a graph is one of several, the row of every follower is that of the worst member.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.dyadic import round_array, round_to_bits
from lmi.errors import LMIError, NoCertificate
from lmi.sparse_h_matrix import DIRECT_ROWS, positive_vector, smallest_eigenvalue
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.interval_rows import IntervalRows, Policy
from ptcc_certify.model.refusals import refuse_leader_groups
from ptcc_certify.theorems.family_behaviour import decide

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
