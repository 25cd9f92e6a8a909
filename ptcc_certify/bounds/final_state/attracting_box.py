"""Boxes that attract followers under every signal, where what they follow may move in known intervals.

Let the agents outside ``F`` stay in ``[l_j, u_j]`` from the beginning, and nobody outside hears one of ``F``. With
``y_l = u_l`` for ``w > 0`` and ``-l_l`` for ``w < 0``, let ``u`` and ``-l`` on ``F`` satisfy, in every mode,

    sum_l |w_kl| (u_k - y_l)  >=  0        at w+ where y_l > u_k, at w- elsewhere,

and the mirror image for ``-l``, and let ``d``, ``alpha`` be a decay of rows,
:mod:`ptcc_certify.lyapunov.follower_function`. Then

    rho = max_k max(0, (x_k - u_k) / d_k, (l_k - x_k) / d_k)    decays with e^(-alpha s) for every signal:

at the largest, ``x_l <= u_l + rho d_l`` and ``x_l >= l_l - rho d_l``; add both conditions of its row. Policy iteration
finds the smallest such box: solve for ``u``, take the worst weights, again until they stand. If some rows fail by a
little, ``u + e v`` repairs them with ``v > 0`` of which every row is about its largest total weight: what rounding
leaves of a row is in proportion to its weights. (``d`` would do, but near the largest ``alpha`` its range is huge.)

References
----------
docs/theory/families.md, "Where it ends".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import frexp

import numpy as np

from lmi.dyadic import dyadic_array, round_array
from lmi.exact.numbers import integers
from lmi.exact.work import WorkError
from lmi.sparse_h_matrix import solve
from ptcc_certify.checker.constrained_switching import reachable_bounds
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.lyapunov.follower_function import FollowerDecay, follower_decays, least_rate
from ptcc_certify.lyapunov.follower_rows import IntervalRows, least_quotient

_ROUNDS = 60
#: Binary places of the ends, against the largest of them.
_BITS = 50
#: Further places of a box that was repaired.
_PLACES = 70
#: Relative accuracy of a solve.
_RESIDUAL = 1e-12
#: Share of the largest rate that is given up, so that ``rho(0)`` is not much larger; denominators of short ends.
_LOSS, _DENOMINATORS = 0.01, (1, 1000, 10**6)
#: Short ends are no farther from those that were found, relatively.
_SAME = Fraction(1, 10**10)
Interval = tuple[Fraction, Fraction]


@dataclass(frozen=True, eq=False)
class AttractingBox:
    """A box to which followers come under every signal: ``rho(s) <= e^(-decay.rate s) rho(0)``, see the module.

    Attributes
    ----------
    decay : FollowerDecay
        ``nodes``, ``d`` and ``alpha``.
    lower, upper : tuple of n Fraction
    """

    decay: FollowerDecay
    lower: tuple[Fraction, ...]
    upper: tuple[Fraction, ...]

    def excess(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``rho`` of the states of all agents; ``d`` in integers as in ``decay``.

        Examples
        --------
        >>> from ptcc_certify.lyapunov.follower_function import follower_decay
        >>> family = Family.from_intervals([("a", "b", 1, 2)])
        >>> box = attracting_box(family, follower_decay(family), {0: (Fraction(0), Fraction(1))})
        >>> box.upper[0] >= 1, float(box.excess([Fraction(0), box.upper[0] + 3 * int(box.decay.vector[0])]))
        (True, 3.0)
        """
        rows = zip(self.decay.nodes.tolist(), self.decay.vector.tolist(), self.lower, self.upper, strict=True)
        return max(max(Fraction(0), (x[k] - high) / d, (low - x[k]) / d) for k, d, low, high in rows)


def box_of_family(family: Family, x0: Sequence[Fraction]) -> AttractingBox | None:
    """Return the box that attracts the followers of a family from an initial state.

    None if no decay is proved, or the state has no common denominator of moderate length, which the check needs.

    The agents that they follow stay in their :func:`invariant_intervals`. Ends are short numbers where those prove the
    rows.

    Parameters
    ----------
    family : Family
    x0 : sequence of N Fraction

    Examples
    --------
    >>> family = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)], nodes="abc")
    >>> box = box_of_family(family, [Fraction(0), Fraction(4), Fraction(100)])
    >>> str(box.lower[0]), str(box.upper[0]), float(box.decay.rate)
    ('1', '2', 2.0)
    """
    decay = next(follower_decays(family, None, [_LOSS]), None) if have_common_denominator(x0) else None
    if decay is None:
        return None
    intervals = invariant_intervals(family, decay.nodes, x0)
    return _with_short_ends(attracting_box(family, decay, intervals), family, intervals)


def have_common_denominator(x: Sequence[Fraction]) -> bool:
    """Tell whether numbers are integers over one scale of moderate length.

    Examples
    --------
    >>> have_common_denominator([Fraction(1, 2), Fraction(1, 3)])
    True
    """
    try:
        integers([list(x)])
    except WorkError:
        return False
    return True


def _with_short_ends(box: AttractingBox, family: Family, intervals: dict[int, Interval]) -> AttractingBox:
    lifted = IntervalRows.of(family.modes, box.decay.nodes).lifted()
    values = [intervals[k] for k in sorted(intervals)]
    z = [high for _, high in values] + [-low for low, _ in values]
    ends = [*box.upper, *(-v for v in box.lower)]
    near = max(map(abs, z), default=Fraction(0)) * _SAME
    for most in _DENOMINATORS:
        y = [v.limit_denominator(most) for v in ends]
        if any(abs(v - short) > near for v, short in zip(ends, y, strict=True)):
            continue
        if not have_common_denominator(y + z):
            break
        (whole,), _ = integers([y + z])
        if (lifted.pull(np.array(whole, dtype=object)) >= 0).all():
            n = len(box.upper)
            return replace(box, lower=tuple(-v for v in y[n:]), upper=tuple(y[:n]))
    return box


def invariant_intervals(family: Family, followers: np.ndarray, x0: Sequence[Fraction]) -> dict[int, Interval]:
    """Return intervals that the agents that are no followers never leave, under any signal.

    Each stays within what reaches it of ``+-x_l(0)``: in a part that hears nobody else and whose edges keep camps
    ``g``, within ``g`` times the range of ``g X(0)`` of those that it hears. Limits, or narrower intervals about them,
    are not invariant, and a box that is built on them attracts nobody at once.

    Parameters
    ----------
    family : Family
    followers : (n,) int array
        Nobody else hears them.
    x0 : sequence of N Fraction

    Examples
    --------
    >>> family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, -1), ("b", "c", 1, 2)])
    >>> ends = invariant_intervals(family, np.array([2]), [Fraction(1), Fraction(2), Fraction(9)])
    >>> {k: tuple(map(str, pair)) for k, pair in ends.items()}
    {0: ('-2', '1'), 1: ('-1', '2')}
    """
    edges = zip(*(end.tolist() for end in family.union), strict=True)
    bounds = reachable_bounds(range(family.n_nodes), edges, x0)
    inside = set(followers.tolist())
    return {v: ends for v, ends in bounds.items() if v not in inside}


def attracting_box(family: Family, decay: FollowerDecay, intervals: dict[int, Interval]) -> AttractingBox:
    """Return the smallest box of the module's kind, proved row by row in integers.

    Parameters
    ----------
    family : Family
    decay : FollowerDecay
        Of the followers.
    intervals : dict of int to (Fraction, Fraction)
        Of all other agents, which they never leave; see :func:`invariant_intervals`.

    Returns
    -------
    AttractingBox

    Raises
    ------
    ValueError
        Other agents than these have intervals, or the vector of ``decay`` proves no rate here.

    Examples
    --------
    >>> from ptcc_certify.lyapunov.follower_function import follower_decay
    >>> family = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)], nodes="abc")
    >>> ends = {0: (Fraction(0), Fraction(0)), 1: (Fraction(4), Fraction(4))}
    >>> box = attracting_box(family, follower_decay(family), ends)
    >>> round(float(box.lower[0]), 9), round(float(box.upper[0]), 9)
    (1.0, 2.0)
    """
    nodes, d = decay.nodes, decay.vector
    if sorted(intervals) != np.setdiff1d(np.arange(family.n_nodes), nodes).tolist():
        raise ValueError("give the intervals of all agents that are no followers, and of no others")
    rows = IntervalRows.of(family.modes, nodes)
    lifted = rows.lifted()
    unit, z = _outside(intervals)
    with np.errstate(all="ignore"):
        y = _largest(lifted, z)
    if least_rate(rows, d) <= 0:
        raise ValueError("the vector proves no decay of these followers")
    v = np.tile(_repair(rows, d), 2)
    v_all = np.concatenate([v, np.zeros(lifted.outside, dtype=np.int64).astype(v.dtype)])
    # the least sum |w| (y_k - y_l) + e sum |w| (v_k - v_l) is at least the sum of both least ones
    upper = _shifted(y, v, _missing(lifted.pull(np.concatenate([y, z])), lifted.pull(v_all)))
    if not (lifted.pull(np.concatenate([upper, z * 2**_PLACES])) >= 0).all():
        raise ArithmeticError("a row of a box fails, against what was proved")
    return AttractingBox(decay, *_ends(upper, unit / 2**_PLACES))


def _ends(y: np.ndarray, unit: Fraction) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """Return ``l`` and ``u`` of the lifted rows."""
    half = y.size // 2
    values = [int(v) * unit for v in y.tolist()]
    return tuple(-v for v in values[half:]), tuple(values[:half])


def _outside(intervals: dict[int, Interval]) -> tuple[Fraction, np.ndarray]:
    """Return ends rounded outwards to integers times a unit, ``u`` of all agents before ``-l`` of all."""
    values = [intervals[k] for k in sorted(intervals)]
    z = [high for _, high in values] + [-low for low, _ in values]
    top = max(map(abs, z), default=Fraction(0)) or Fraction(1)
    unit = Fraction(2) ** (frexp(nearest_float(top))[1] - _BITS)
    return unit, np.array([-((-x / unit).__floor__()) for x in z], dtype=object)


def _largest(lifted: IntervalRows, z: np.ndarray) -> np.ndarray:
    """Return ``y`` of the fixed point of the worst weights, in integers."""
    ends = z.astype(float)
    top = float(np.abs(ends).max(initial=0))
    y = np.full(lifted.n, max(float(ends.max(initial=0)), 0.0))
    policy = lifted.worst(np.concatenate([y, ends]))
    for _ in range(_ROUNDS):
        M, N = lifted.system(policy), lifted.heard(policy)[:, lifted.n :]
        y = np.clip(solve(M, N @ ends, M.diagonal(), _RESIDUAL), -top, top)
        new = lifted.worst(np.concatenate([y, ends]))
        if new == policy or not np.isfinite(y).all():
            break
        policy = new
    y = np.where(np.isfinite(y), y, top)
    return np.array([int(v) for v in np.rint(y).tolist()], dtype=object)


def _repair(rows: IntervalRows, d: np.ndarray) -> np.ndarray:
    """Return integers ``v > 0`` of which every least row is positive, about its largest total weight; else ``d``."""
    none = np.zeros(rows.outside)
    total = rows.largest_pushes(np.ones(rows.n + rows.outside)).max(axis=0)
    policy = rows.worst(np.concatenate([np.ones(rows.n), none]))
    with np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            M = rows.system(policy)
            v = solve(M, total, M.diagonal(), _RESIDUAL)
            if not (np.isfinite(v).all() and (v > 0).all()):
                return d
            new = rows.worst(np.concatenate([v, none]))
            if new == policy:
                break
            policy = new
    whole, _ = dyadic_array(round_array(v))
    return whole if least_rate(rows, whole) > 0 else d


def _missing(pull: np.ndarray, spare: np.ndarray) -> Fraction:
    """Return the least ``e >= 0`` with ``pull + e spare >= 0`` in all rows."""
    return max(Fraction(0), -least_quotient(pull.ravel(), spare.ravel()))


def _shifted(y: np.ndarray, v: np.ndarray, e: Fraction) -> np.ndarray:
    """Return integers ``2^_PLACES (y + e v)``, ``e >= 0`` rounded up."""
    return y.astype(object) * 2**_PLACES - (-e * 2**_PLACES).__floor__() * v.astype(object)
