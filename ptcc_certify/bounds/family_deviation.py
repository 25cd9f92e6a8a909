"""How far the agents of a family are from where they end, for every signal, in floats that are rounded upwards.

References
----------
docs/theory/families.md, "Where it ends" and "Disturbances".
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.bounds.envelope import Instants
from ptcc_certify.bounds.reaching_phase import ReachingPhase
from ptcc_certify.checker.family_bounds import Function, deviations
from ptcc_certify.checker.family_sliding import Drive
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.graphs.rationals import nearest_float

_SLACK = 1 + 1e-12


def deviation_on_clock(V: Function, stable: bool, x: Sequence[Fraction], clock: np.ndarray) -> np.ndarray | None:
    """Bound ``|x_k(t) - x_k(T)|`` by a function of a component, (n, M); None if it does not decay.

    Parameters
    ----------
    V : Function
    stable : bool
        Whether all agents end at 0.
    x : sequence of n Fraction
        The initial state.
    clock : (M,) array
    """
    moves = deviations([V], stable, x)
    if not moves:
        return None
    size = np.array([float(moves[k]) for k in range(len(x))]) * _SLACK
    return np.multiply.outer(size, np.exp(-float(V.rate) * (1 - 1e-12) / 2 * clock))


def deviation_while_driven(
    V: Function, stable: bool, y: Sequence[Fraction], drive: Drive, phase: ReachingPhase, at: Instants
) -> np.ndarray | None:
    """Bound the same where sliding variables move: of ``y = x - sigma`` by the integral of its speed, and ``|sigma|``.

        |y_k(t) - x_k(T)|  <=  int_t^T gain |(L x)_k|  <=  sqrt(c_k) (v(t) + c R(t)) / alpha + m_k R(t)

    ``R(t) = int_t^T gain psi``, with the rate ``2 alpha`` and ``|(L y)_k| <= sqrt(c_k) v``.

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
    root, half = root_above(rounded(V.value(y), BITS, up=True)), float(V.rate) * (1 - 1e-12) / 2
    c, nodes = _float(drive.constant(V)), range(len(y))
    with np.errstate(over="ignore", invalid="ignore"):
        v, rest = phase.driven(half, _float(root), c, at), phase.rest(at)
        speeds = np.sqrt([_float(V.inputs[k]) for k in nodes])
        own = np.multiply.outer(speeds, (v + c * rest) / half)
        own += np.multiply.outer([_float(drive.pulls[k]) for k in nodes], rest)
        if stable:
            sizes = np.sqrt([_float(V.coordinates[k]) if k in V.coordinates else np.inf for k in nodes])
            own = np.fmin(own, np.multiply.outer(sizes, v))
        own += sliding_sizes(drive, phase, at)
    return np.nan_to_num(own, nan=np.inf, posinf=np.inf)


def _float(x: Fraction) -> float:
    """Return a float that is not below; infinity beyond their range."""
    return nearest_float(x) * _SLACK


def sliding_sizes(drive: Drive, phase: ReachingPhase, at: Instants) -> np.ndarray:
    """Bound ``|sigma_k|``, (n, M)."""
    sizes = [abs(float(s)) for s in drive.sigma0.values()]
    return np.multiply.outer(sizes, np.where(np.isfinite(at.z), phase.share(at.z), 0.0)) * _SLACK
