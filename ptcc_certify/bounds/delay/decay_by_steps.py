"""Followers whose messages are late, bounded from instant to instant by a solution that never grows.

With ``y_0 >= |eps(0)|`` and ``D y_0 >= |W_F| y_0 + nu D`` the solution of

    y' = -gain (D y - |W_F| y(t - delay) - nu D),    y = y_0 up to 0,

never grows, so that ``|eps(t)| <= y(t)`` whatever the delays up to ``delay`` and the value errors up to ``nu``. Between
instants ``t_(i-1)`` and ``t_i`` what it hears over an edge is at most ``y`` at an instant ``t_j <= t_(i-1) - age`` with
the age of the edge, hence

    y_i = h + (y_(i-1) - h)_+ e^(-D (s(t_i) - s(t_(i-1)))),    h = D^-1 |W_F| y_j + nu.

Where delays are constant and weights positive the solution is attained: what is lost is the distance of instants.
Where leaders move, and followers are disturbed, ``nu`` has ``push/(D gain)`` besides: the gain never falls, so that
``push <= gain D (push/(D gain(t_(i-1))))`` in a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.lyapunov.follower_rows import FollowerRows

#: Instants at most, and products of weights that all instants together may take.
MOST_INSTANTS, MOST_PRODUCTS = 2000, 20_000_000
#: The same where vehicles follow, in integers without arrays.
_OF_VEHICLES = 1_000_000
#: Instants in one delay, at most, and in each e-fold of the time that is left.
_IN_DELAY, _IN_E_FOLD = 32, 120
#: Where nothing is late, in place of a delay, how far the clock goes times the largest degree.
_WAY = 4
#: Fewer instants than this say nothing.
_FEWEST = 20
#: Integers over ``2^30`` by which the check may form what is formed here in floats.
_UNIT = 2.0**-30
#: What is added so that the start obeys its inequality for certain, relatively.
_MORE = 1e-9
#: Iterations for the start.
_ITERATIONS = 200


@dataclass(frozen=True, eq=False)
class Steps:
    """The instants, and what bounds ``|eps|`` there.

    Attributes
    ----------
    instants : tuple of Fraction
        ``t_0 = 0 .. t_m = T``.
    start : (F,) array
        ``y_0``, floats that are taken as they are.
    bounds : (m + 1, F) array
        ``y_i`` in floats, not below what integers over ``2^30`` give.
    peaks : (F,) array
        The largest gain times what an agent is off by and hears, likewise; infinite without a cap.
    """

    instants: tuple[Fraction, ...]
    start: np.ndarray
    bounds: np.ndarray
    peaks: np.ndarray

    def residual(self) -> np.ndarray:
        """Return what bounds ``|eps(T)|``, ``(F,)`` floats."""
        return np.asarray(self.bounds[-1] * (1 + _MORE) + 1e-300)

    def inputs(self, rows: FollowerRows) -> np.ndarray | None:
        """Return what bounds ``gain |e|`` up to ``T``, ``(F,)`` floats; None without a cap."""
        return np.asarray(rows.D * self.peaks * (1 + _MORE) + 1e-300) if np.isfinite(self.peaks).all() else None

    def deviation_bound(self, case: LateCase, t: np.ndarray) -> np.ndarray:
        """Return what bounds ``|eps|`` at instants, ``(F, M)`` floats; after ``T`` nothing does while leaders move."""
        at = np.searchsorted([float(x) for x in self.instants], t * (1 - 1e-15), side="right") - 1
        lost = (t > float(case.protocol.T)) & (case.leaders is not None)  # the gain falls there
        return np.where(lost, np.inf, self.bounds[np.maximum(at, 0)].T)


def instants_of(T: Fraction, delay: Fraction, most: int) -> tuple[Fraction, ...]:
    """Return instants from 0 to ``T``: near to ``T`` parts of the delay, farther away parts of the time left.

    Examples
    --------
    >>> instants = instants_of(Fraction(1), Fraction(1, 10), 100)
    >>> instants[0], instants[-1], len(instants) <= 101
    (Fraction(0, 1), Fraction(1, 1), True)
    """
    for parts in range(_IN_DELAY, 1, -1):
        step, share = delay / parts, _IN_E_FOLD * parts / _IN_DELAY
        left, backwards = Fraction(0), [Fraction(0)]
        while left < T and len(backwards) <= most:
            # Whole steps, so that an instant lies a delay before another where steps are short.
            left += step * max(1, int(float(left / step) / share))
            backwards.append(min(left, T))
        if backwards[-1] == T and len(backwards) <= most + 1:
            return tuple(T - left for left in reversed(backwards))
    count = max(2, most)
    return tuple(T * i / count for i in range(count + 1))


def search_steps(case: LateCase, rows: FollowerRows, first: np.ndarray) -> Steps | None:
    """Choose instants and start, and bound followers from instant to instant; None where the graph is too large.

    Parameters
    ----------
    case : LateCase
        Something is late, or vehicles track under a cap.
    rows : FollowerRows
        Those of the case.
    first : (F,) array
        ``|eps(0)|`` from above.

    Raises
    ------
    NoCertificate
        No vector for the followers was found.
    """
    products = MOST_PRODUCTS if case.messages.vehicles is None else _OF_VEHICLES
    most = min(MOST_INSTANTS, products // (rows.W.nnz + 4 * rows.D.size))
    if most < _FEWEST:
        return None
    start = _start(rows, _wrong(case) + _lags(case, rows, (Fraction(0),))[0], first)
    if not 0 < float(start.max()) < np.inf:
        return None
    delay = case.messages.age * rows.least_share
    if not delay:  # vehicles alone, under a cap, whose clock is to go by small parts of the fastest row
        fastest = Fraction(float(rows.D.max())) * (case.messages.gain_cap or 1)
        delay = min(case.protocol.T, _WAY / fastest)
    return bound_steps(case, rows, instants_of(case.protocol.T, delay, most), start)


def bound_steps(case: LateCase, rows: FollowerRows, instants: tuple[Fraction, ...], start: np.ndarray) -> Steps:
    """Bound followers from instant to instant, in floats that leave room for the integers of the check."""
    parts = [(W, _hearing(instants, case.messages.age * Fraction(share))) for share, W in rows.by_age().items()]
    clock, error = case.limited().clock(*_places(case, instants)), _wrong(case)
    size = float(start.max())
    lags = _lags(case, rows, instants[:-1])
    gains = np.append(case.limited().value(*_places(case, instants[:-1])), float(case.messages.gain_cap or np.inf))
    peaks = np.zeros(rows.D.size)
    room, bounds = _UNIT * size * (np.diff(rows.W.indptr) + 6.0), [start + _UNIT * size]
    for i in range(1, len(instants)):
        before, heard = bounds[-1], sum(W @ bounds[at[i - 1]] for W, at in parts) / rows.D + error + room
        moved = before + heard + 2 * _UNIT * size
        with np.errstate(over="ignore"):
            peaks = np.maximum(peaks, moved * (gains[i] * (1 + _MORE) + 2 * _UNIT * gains[-1]))
        if np.isfinite(clock[i]):
            heard = heard + lags[i - 1]
        step = clock[i] - clock[i - 1] if np.isfinite(clock[i]) else np.inf
        left = _decay_above(rows.D * max(step, 0.0) * (1 - 1e-9))
        bounds.append(np.minimum(before, heard + np.maximum(before - heard, 0) * left + 4 * _UNIT * size))
    return Steps(instants, start, np.array(bounds), peaks)


def _wrong(case: LateCase) -> float:
    """Bound what is heard wrong."""
    return float(case.exact.wrong) * (1 + _MORE)


def _lags(case: LateCase, rows: FollowerRows, instants: Sequence[Fraction]) -> np.ndarray:
    """Return ``push/(D gain(t))`` at instants by follower, ``(m, F)``, a little above."""
    push = float(case.leaders.total) * (1 + _MORE) if case.leaders is not None else 0.0
    return np.asarray(push / np.outer(case.limited().value(*_places(case, instants)), rows.D) * (1 + _MORE))


def _places(case: LateCase, instants: Sequence[Fraction]) -> tuple[np.ndarray, np.ndarray]:
    """Return instants, and the shares of the time that are left there, in floats."""
    T = case.protocol.T
    return np.array([float(t) for t in instants]), np.array([float((T - t) / T) for t in instants])


def _hearing(instants: Sequence[Fraction], delay: Fraction) -> list[int]:
    """Return for every instant the number of the last one that is a delay before it, 0 if there is none."""
    heard, j = [], 0
    for t in instants:
        while j + 1 < len(instants) and instants[j + 1] <= t - delay:
            j += 1
        heard.append(j)
    return heard


def _decay_above(x: np.ndarray) -> np.ndarray:
    """Bound ``e^-x`` by the reciprocal of the first terms of ``e^x``."""
    with np.errstate(over="ignore"):
        return 1 / (1 + x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4))))


def _start(rows: FollowerRows, error: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return a small ``y_0 >= first`` with ``D y_0 >= |W_F| y_0 + error D``, by iteration from below."""
    y = first * (1 + _MORE)
    for _ in range(_ITERATIONS):
        new = np.maximum(y, (rows.W @ y) / rows.D + error)
        if (new <= y * (1 + _MORE)).all():
            break
        y = new
    witness = rows.witness(Fraction(1), 0.5)
    slack = rows.D * witness.u - rows.W @ witness.u
    lacking = rows.W @ y + error * rows.D - rows.D * y + 1e-13 * rows.D * (y + error)
    return y + float(np.maximum(lacking / slack, 0).max() * (1 + 1e-6)) * witness.u
