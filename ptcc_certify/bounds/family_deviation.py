"""How far the agents of a family are from where they end, and how fast they go, for every signal; in floats, upwards.

References
----------
docs/theory/families.md, "Where it ends" and "Disturbances".
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Protocol

import numpy as np

from ptcc_certify.bounds.envelope import Instants
from ptcc_certify.bounds.reaching_phase import ReachingPhase
from ptcc_certify.checker.family_bounds import Function as BoundsFunction
from ptcc_certify.checker.family_bounds import deviations, least
from ptcc_certify.checker.family_function import Scaled
from ptcc_certify.checker.family_sliding import Drive
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY

_SLACK = 1 + 1e-12


class Function(BoundsFunction, Protocol):
    """What the formulas of the bounds take, and how large coordinates are."""

    @property
    def sizes(self) -> Sequence[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""


def deviation_on_clock(
    V: Function, behaviour: str | None, x: Sequence[Fraction], clock: np.ndarray
) -> np.ndarray | None:
    """Bound ``|x_k(t) - x_k(T)|`` by a function of a component, (n, M); None if it does not decay.

    That is what the speeds add up to until the deadline. Agents that end at 0 are no farther from it than they are
    large, and those that come to ``+-c`` no farther than from some other agent: at all times ``c`` is between the
    least and the largest ``g_k x_k``, since no signal lets these grow apart.

    Parameters
    ----------
    V : Function
    behaviour : str or None
        Of the component.
    x : sequence of n Fraction
        The initial state.
    clock : (M,) array
    """
    moves, unit = deviations([V], x)
    if not moves:
        return None
    if behaviour in (STABILITY, BIPARTITE_CONSENSUS):
        root, own = V.root(x), V.sizes
        if behaviour == BIPARTITE_CONSENSUS:
            own = [_from_others(own, len(x))]
        moves, unit = least([(moves, Fraction(1, unit)), *((vector, factor * root) for vector, factor in own)])
    return _times([Fraction(moves[k], unit) for k in range(len(x))], _decay(V, clock))


def _from_others(sizes: Sequence[Scaled], n: int) -> Scaled:
    """Bound how far each agent is from any other, by how far they are from the pivot, which is not named.

    Examples
    --------
    >>> _from_others([({1: 3, 2: 5}, Fraction(1, 2))], 3)
    ({0: 5, 1: 8, 2: 8}, Fraction(1, 2))
    """
    from_pivot, scale = least(sizes)
    reach = [from_pivot.get(k, 0) for k in range(n)]
    second, largest = sorted([0, *reach])[-2:]
    return {k: x + (second if x == largest else largest) for k, x in enumerate(reach)}, Fraction(1, scale)


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
    V: Function, stable: bool, y: Sequence[Fraction], drive: Drive, phase: ReachingPhase, at: Instants
) -> np.ndarray | None:
    """Bound the same where sliding variables move: of ``y = x - sigma`` by the integral of its speed, and ``|sigma|``.

        |y_k(t) - x_k(T)|  <=  int_t^T gain |(L x)_k|  <=  c_k (v(t) + c R(t)) / alpha + m_k R(t)

    ``R(t) = int_t^T gain psi``, with the rate ``2 alpha`` and ``|(L y)_k| <= c_k v``.

    Parameters
    ----------
    V : Function
    stable : bool
    y : sequence of n Fraction
        ``x(0) - sigma(0)``.
    drive : Drive
    phase : ReachingPhase
    at : Instants
        M of them.
    """
    if V.rate <= 0:
        return None
    half, nodes, c = float(V.rate) * (1 - 1e-12) / 2, range(len(y)), above(drive.constant(V))
    with np.errstate(over="ignore", invalid="ignore"):
        v, rest = phase.driven(half, above(V.root(y)), c, at), phase.rest(at)
        own = np.multiply.outer(_floats(V.speeds, len(y)), (v + c * rest) / half)
        own += np.multiply.outer([above(drive.sizes[k]) for k in nodes], rest)
        if stable:
            own = np.fmin(own, np.multiply.outer(_floats(V.sizes, len(y)), v))
        own += sliding_sizes(drive, phase, at)
    return np.nan_to_num(own, nan=np.inf, posinf=np.inf)


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
