"""The decay of followers of any size under every signal, proved row by row in integers.

Let nobody outside ``F`` hear a node of ``F``. If ``d > 0`` and, for every node ``k`` of ``F``, in every mode,

    sum_(l in F) |w_kl| (d_k - d_l) + sum_(l not in F) |w_kl| d_k  >=  alpha d_k

at the worst weights, ``w+`` where ``d_l > d_k`` and ``w-`` elsewhere, then ``max_k |x_k| / d_k`` decays with
``e^(-alpha s)`` along ``X_F' = -L_F X_F`` for every signal. With one mode, independent directed weights and camps that
all edges in ``F`` keep, the largest ``alpha`` is the smallest eigenvalue of ``L_F`` over the box, and constant weights
attain it: no certificate of any kind proves more.

The search is policy iteration: solve ``(M - t I) d = 1``, take the worst weights for that ``d``, again until they
stand. Whatever it proposes, integers decide.

References
----------
docs/theory/families.md, "Rows". Howard, Dynamic Programming and Markov Processes, 1960.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.dyadic import dyadic_array, round_array
from lmi.exact.elementary_enclosures import rounded
from lmi.sparse_h_matrix import positive_vector, smallest_eigenvalue
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov.interval_rows import IntervalRows, Policy, least_quotient
from ptcc_certify.theorems.kernel import reached

#: Rounds of policy iteration, and of the search for the rate.
_ROUNDS, _TRIALS = 40, 24
#: Relative distance of the search from the smallest eigenvalue, and at which it ends.
_NEAR, _TOLERANCE = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class FollowerDecay:
    """``max_k |x_k| / d_k <= e^(-rate s)`` times its first value, along ``X_F' = -L_F X_F``, for every signal.

    Attributes
    ----------
    nodes : (n,) int array
        ``F``, ascending.
    vector : (n,) array of positive int64 or Python ints
        ``d``, up to a common factor.
    rate : Fraction
        ``alpha`` of the norm, per unit of the clock; that of squared functions is twice this.
    """

    nodes: np.ndarray
    vector: np.ndarray
    rate: Fraction

    @property
    def overshoot(self) -> Fraction:
        """``max d / min d``, which multiplies the largest ``|x_k|``."""
        return Fraction(int(self.vector.max()), int(self.vector.min()))


def follower_nodes(family: Family) -> np.ndarray:
    """Return the nodes of which no closed component of any mandatory graph hears, through any edges; ascending.

    Examples
    --------
    >>> follower_nodes(Family.from_intervals([("a", "b", 1, 2), ("b", "c", 0, 1), ("a", "c", 1, 1)])).tolist()
    [1, 2]
    """
    closed = [v for mode in family.modes for c in analyse(mode.mandatory).closed_components for v in c.nodes]
    source, target, _ = family.union
    heard = reached(family.n_nodes, target, source, np.unique(np.array(closed, dtype=np.int64)))
    return np.setdiff1d(np.arange(family.n_nodes), heard)


def follower_decay(family: Family, nodes: np.ndarray | None = None, loss: float = _NEAR) -> FollowerDecay | None:
    """Search and prove the decay of followers.

    Parameters
    ----------
    family : Family
    nodes : (n,) int array, optional
        ``F``, ascending; nobody outside hears them. By default :func:`follower_nodes`.
    loss : float
        Share of the largest rate that is given up, so that ``d`` has a smaller range.

    Returns
    -------
    FollowerDecay or None
        None if there are no followers or rows prove no positive rate.

    Raises
    ------
    ValueError
        A node outside hears one of ``F``.

    References
    ----------
    docs/theory/families.md, "Rows".

    Examples
    --------
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 3, 4), ("c", "b", 1, 2)])
    >>> round(float(follower_decay(chain).rate), 5)
    0.55051
    """
    return next(follower_decays(family, nodes, [loss]), None)


def follower_decays(family: Family, nodes: np.ndarray | None, losses: Iterable[float]) -> Iterator[FollowerDecay]:
    """Yield the decay of followers for every loss, as :func:`follower_decay`, from one search; nothing if that fails.

    Examples
    --------
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2)])
    >>> [(round(float(one.rate), 2), round(float(one.overshoot))) for one in follower_decays(chain, None, [0.01, 0.5])]
    [(0.99, 101), (0.67, 3)]
    """
    nodes = follower_nodes(family) if nodes is None else np.asarray(nodes, dtype=np.int64)
    source, target, _ = family.union
    if (np.isin(source, nodes) & ~np.isin(target, nodes)).any():
        raise ValueError("a node outside the followers hears one of them")
    rows = IntervalRows.of(family.modes, nodes)
    with np.errstate(all="ignore"):
        found = _largest_rate(rows) if nodes.size else None
        if found is None:
            return
        t, policy = found
    for loss in losses:
        with np.errstate(all="ignore"):
            d, _ = _vector(rows, t * (1 - loss), policy)
        if d is not None and (decay := prove_follower_decay(rows, nodes, d)) is not None:
            yield decay


def prove_follower_decay(rows: IntervalRows, nodes: np.ndarray, d: np.ndarray) -> FollowerDecay | None:
    """Prove the rate of a positive vector, rounded to 40 bits: the least quotient of a row and ``d``, in integers.

    None if that is not positive.

    Examples
    --------
    >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 2, 5)]).modes, np.array([1]))
    >>> prove_follower_decay(rows, np.array([1]), np.array([0.3])).rate
    Fraction(2, 1)
    """
    whole, _ = dyadic_array(round_array(d))
    rate = least_rate(rows, whole)
    return FollowerDecay(nodes, whole, rounded(rate, 53)) if rate > 0 else None


def least_rate(
    rows: IntervalRows, d: np.ndarray, outside: np.ndarray | None = None, drifts: Sequence[Fraction] = ()
) -> Fraction:
    """Return the largest ``alpha`` that positive integers ``d`` prove; exact.

    ``sum_l |w_kl| (d_k - d_l) - drift_k >= alpha d_k``, with ``d_l`` of nodes outside as given, 0 by default. Drifts
    are rounded up to multiples of the unit.

    Examples
    --------
    >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 2, 5), ("b", "c", 1, 3)]).modes, np.array([1, 2]))
    >>> least_rate(rows, np.array([1, 2])), least_rate(rows, np.array([2, 1]))
    (Fraction(1, 2), Fraction(-3, 1))
    """
    outside = np.zeros(rows.outside, dtype=np.int64).astype(d.dtype) if outside is None else outside
    pull = rows.pull(np.concatenate([d, outside]))
    if any(drifts):
        pull = pull - np.array([-(-q // rows.unit) for q in drifts], dtype=object)
    return least_quotient(pull.ravel(), np.tile(d, rows.modes)) * rows.unit


# ---------------------------------------------------------------------- search


def _extended(rows: IntervalRows, d: np.ndarray) -> np.ndarray:
    return np.concatenate([d, np.zeros(rows.outside)])


def _vector(rows: IntervalRows, t: float, policy: Policy) -> tuple[np.ndarray | None, Policy]:
    """Return ``d`` that proves a rate above ``t``, or None, and the last policy: refused, its member is slower."""
    for _ in range(_ROUNDS):
        d = positive_vector(rows.system(policy), t)
        if not (np.isfinite(d).all() and (d > 0).all() and d.max() < 1e250 * d.min()):
            return None, policy
        if (rows.pull(_extended(rows, d)) >= t * d).all():
            return d, policy
        new = rows.worst(_extended(rows, d))
        if new == policy:
            return None, policy
        policy = new
    return None, policy


def _largest_rate(rows: IntervalRows) -> tuple[float, Policy] | None:
    """Return a rate just below the largest, and the policy of a member that is slow; None if none is positive."""
    policy, low = rows.worst(_extended(rows, np.ones(rows.n))), 0.0
    for _ in range(_ROUNDS):
        found = smallest_eigenvalue(rows.system(policy), shifted=True)
        if found is None:
            return None
        high = found[0] * (1 - _NEAR)
        d, new = _vector(rows, high, policy)
        if d is not None:
            low, policy, high = high, new, high * (1 + 3 * _NEAR)
            break
        if new == policy:
            break
        policy = new
    # The bound of the eigenvalue of a block that is nearly triangular is far below it: the test itself decides.
    if low:
        d, _ = _vector(rows, high, policy)
        if d is not None:
            low, high = high, float(rows.system(policy).diagonal().min())
    for _ in range(_TRIALS):
        if high <= low * (1 + _TOLERANCE):
            break
        t = (low + high) / 2
        d, new = _vector(rows, t, policy)
        low, high, policy = (t, high, new) if d is not None else (low, t, policy)
    return (low, policy) if low > 0 else None
