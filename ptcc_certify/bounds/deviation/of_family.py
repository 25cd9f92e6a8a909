"""How far the agents of a family are from where they end, and how fast they go, for every signal; in floats, upwards.

References
----------
docs/theory/families.md, "Where it ends" and "Disturbances".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple, Protocol

import numpy as np

from ptcc_certify.bounds.envelope import Instants
from ptcc_certify.bounds.reaching_phase import ReachingPhase
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.signal_bounds import Drive, deviations, least
from ptcc_certify.checker.signal_bounds import Function as BoundsFunction
from ptcc_certify.graphs.rationals import nearest_float

_SLACK = 1 + 1e-12
#: Bits beyond those of the sizes to which shares of these are rounded up.
_ROUNDING_BITS = 32


class Function(BoundsFunction, Protocol):
    """What the formulas of the bounds take, and how large coordinates are."""

    @property
    def sizes(self) -> Sequence[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""


class RestStates(NamedTuple):
    """The common kernel of a component: the rows of its basis by node, without zeros, and its leading groups."""

    rows: Mapping[int, Mapping[int, Fraction]]
    groups: Sequence[Sequence[int]]


def deviation_on_clock(
    V: Function, rest: RestStates | None, x: Sequence[Fraction], clock: np.ndarray
) -> np.ndarray | None:
    """Bound ``|x_k(t) - x_k(T)|`` by a function of a component, (n, M); None if it does not decay.

    That is what the speeds add up to until the deadline, and at most what :func:`from_rest` tells.

    Parameters
    ----------
    V : Function
    rest : RestStates or None
        Of the component, where they are known.
    x : sequence of n Fraction
        The initial state.
    clock : (M,) array
    """
    moves, unit = deviations([V], x)
    if not moves:
        return None
    if rest is not None:
        vector, factor = from_rest(V.sizes, rest)
        moves, unit = least([(moves, Fraction(1, unit)), (vector, factor * V.root(x))])
    return _times([Fraction(moves[k], unit) for k in range(len(x))], _decay(V, clock))


def from_rest(sizes: Sequence[Scaled], rest: RestStates) -> Scaled:
    """Bound ``|x_k(t) - x_k(T)| / sqrt(V)``, for every signal after ``t``.

        x_k - x_k(T) = xi_k + sum_j B_kj (x_(p_j) - c_j)

    Of every leading group ``c_j`` is between the least and the largest ``g_l x_l`` at all times, since no signal lets
    these grow apart: its pivot is no farther from it than the farthest agent of the group from the pivot, and another
    one no farther than from some other agent. Groups of one agent rest.

    Parameters
    ----------
    sizes : sequence of Scaled
        Bounds of ``|xi_k| / sqrt(V)``, for all but pivots and agents at rest.
    rest : RestStates

    Examples
    --------
    >>> one = Fraction(1)
    >>> shares = {0: {0: one}, 1: {0: one}, 2: {1: one}, 3: {0: one / 2, 1: one / 2}}
    >>> vector, unit = from_rest([({1: 3, 3: 5}, Fraction(1, 2))], RestStates(shares, [[0, 1], [2]]))
    >>> [str(x * unit) for x in vector.values()]  # the pivot is as far as agent 1 from it; agent 3 hears it by halves
    ['3/2', '3/2', '0', '13/4']
    """
    known, scale = least(sizes)
    reach = {k: known.get(k, 0) << _ROUNDING_BITS for k in rest.rows}
    ends = [sorted([0, *(reach[v] for v in group)])[-2:] for group in rest.groups]
    members = [set(group) for group in rest.groups]
    result = {}
    for k, row in rest.rows.items():
        result[k] = reach[k]
        for j, b in row.items():
            second, largest = ends[j]
            far = second if k in members[j] and reach[k] == largest else largest
            result[k] -= -abs(b.numerator) * far // b.denominator
    return result, Fraction(1, scale << _ROUNDING_BITS)


def input_on_clock(V: Function, x: Sequence[Fraction], clock: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Bound ``gain |(L x)_k|`` by a function of a component, (n, M)."""
    speeds, unit = least(V.speeds)
    root = V.root(x) / unit
    return _times([speeds[k] * root for k in range(len(x))], gain * _decay(V, clock))


def _times(sizes: Sequence[Fraction], factors: np.ndarray) -> np.ndarray:
    """Return products in floats; infinity for sizes beyond their range."""
    size = np.array([above(x) for x in sizes])
    with np.errstate(invalid="ignore"):
        products = np.multiply.outer(size, factors)
    products[np.isinf(size)] = np.inf
    return products


def _decay(V: Function, clock: np.ndarray) -> np.ndarray:
    return np.exp(-float(V.rate) * (1 - 1e-12) / 2 * clock)


def deviation_while_driven(
    V: Function, rest: RestStates | None, y: Sequence[Fraction], drive: Drive, phase: ReachingPhase, at: Instants
) -> np.ndarray | None:
    """Bound the same where sliding variables move: of ``y = x - sigma`` by the integral of its speed, and ``|sigma|``.

        |y_k(t) - x_k(T)|  <=  int_t^T gain |(L x)_k|  <=  c_k (v(t) + c R(t)) / alpha + m_k R(t)

    ``R(t) = int_t^T gain psi``, with the rate ``2 alpha`` and ``|(L y)_k| <= c_k v``. Besides by :func:`from_rest`
    where ``R`` is 0, and at all times where all agents end at 0.

    Parameters
    ----------
    V : Function
    rest : RestStates or None
        Of the component, where they are known.
    y : sequence of n Fraction
        ``x(0) - sigma(0)``.
    drive : Drive
    phase : ReachingPhase
    at : Instants
        M of them.
    """
    if V.rate <= 0:
        return None
    half = float(V.rate) * (1 - 1e-12) / 2
    nodes = range(len(y))
    c = above(drive.constant(V))
    with np.errstate(over="ignore", invalid="ignore"):
        v, more = phase.driven(half, above(V.root(y)), c, at), phase.rest(at)
        deviation = np.multiply.outer(_floats(V.speeds, len(y)), (v + c * more) / half)
        deviation += np.multiply.outer([above(drive.sizes[k]) for k in nodes], more)
        if rest is not None:
            near = np.multiply.outer(_floats([from_rest(V.sizes, rest)], len(y)), v)
            deviation = np.fmin(deviation, near if not rest.groups else np.where(more == 0, near, np.inf))
        deviation += sliding_sizes(drive, phase, at)
    return np.nan_to_num(deviation, nan=np.inf, posinf=np.inf)


def input_while_driven(
    V: Function, y: Sequence[Fraction], drive: Drive, phase: ReachingPhase, at: Instants, gain: np.ndarray
) -> np.ndarray:
    """Bound ``gain |(L x)_k| <= gain (c_k v + m_k psi)`` where sliding variables move."""
    if V.rate <= 0:
        return np.full((len(y), at.clock.size), np.inf)
    half = float(V.rate) * (1 - 1e-12) / 2
    with np.errstate(over="ignore", invalid="ignore"):
        v = phase.driven(half, above(V.root(y)), above(drive.constant(V)), at)
        own = np.multiply.outer(_floats(V.speeds, len(y)), gain * v)
        own += np.multiply.outer([above(drive.sizes[k]) for k in range(len(y))], gain * phase.share_at(at))
    return np.nan_to_num(own * _SLACK, nan=np.inf, posinf=np.inf)


def _floats(bounds: Sequence[Scaled], n: int) -> np.ndarray:
    """Return the least bound of every node in floats that are not below; infinity where there is none."""
    values, unit = least(bounds)
    return np.array([above(Fraction(values[k], unit)) if k in values else np.inf for k in range(n)])


def above(x: Fraction) -> float:
    """Return a float that is not below; infinity beyond their range."""
    return nearest_float(x) * _SLACK


def sliding_sizes(drive: Drive, phase: ReachingPhase, at: Instants) -> np.ndarray:
    """Bound ``|sigma_k|``, (n, M)."""
    sizes = [abs(float(s)) for s in drive.sigma0.values()]
    return np.multiply.outer(sizes, phase.share_at(at)) * _SLACK
