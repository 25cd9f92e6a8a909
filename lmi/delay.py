"""One Lyapunov matrix that forgives late values: the search, by Clarabel; proofs are elsewhere.

Let ``x' = -F``, ``F = K y - p``, ``y' = -A y + C p``: agents ``x`` that hear late values, ``y`` what decays of them,
``p_k = sum_e w_e rho_e`` what the lateness adds, over the channels ``e`` of agent ``k``; ``rho_e`` is the integral of
``m_e'F`` over a time of at most ``h_e``. With ``c_e = h_e (e^(2 b h_e) - 1)/(2 b)`` and multipliers ``tau_e > 0``

    N = [[P A + A'P - 2 b P,  -P C],  [-C'P,  diag(T)]] - Z' (sum_e tau_e c_e m_e m_e') Z - [0, Y]'[0, Y]  >  0,
    1/T_k = sum_e w_e^2/tau_e,    Z = [K, -I]

implies ``y'P y <= e^(-2 b s) y(0)'P y(0)``, and that the integral of ``e^(2 b s) |Y p|^2`` is at most ``y(0)'P y(0)``.
Errors of what is heard are channels with ``h_e = 0`` whose ``rho_e`` is bounded by what values are off by.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from lmi import child_process
from lmi.diagonal import run_solver
from lmi.errors import NoCertificate

#: By how much of ``P`` (in units of time of the largest entry of ``K``) and of ``T`` the inequality holds strictly, so
#: that rounding keeps it.
SLACK = 1e-5
#: Largest lateness, in these units, with which something is searched.
LATEST = 1e6
#: Share of the trace of ``P`` that is minimised besides, so that no direction of it grows without bound.
_TRACE = 1e-7


@dataclass(frozen=True, eq=False)
class LateSystem:
    """A linear system with late values.

    Attributes
    ----------
    A : (m, m) array
    C : (m, q) array
    K : (n, m) array
    agents : (q,) array of int
        Which of the ``n`` agents have channels: the rows of ``p``.
    place : (E,) array of int
        Of each channel the row of ``p`` that it belongs to.
    weights, lateness : (E,) arrays
        ``w_e``, not 0, and ``h_e``.
    heard : (E, n) array
        Rows ``m_e``.
    walks : (d, q) array
        ``Y``.
    errors : int
        How many of the channels, the last ones, are errors of what is heard.
    """

    A: np.ndarray
    C: np.ndarray
    K: np.ndarray
    agents: np.ndarray
    place: np.ndarray
    weights: np.ndarray
    lateness: np.ndarray
    heard: np.ndarray
    walks: np.ndarray
    errors: int = 0

    @property
    def rate(self) -> float:
        """The decay rate of the system where nothing is late."""
        return float(np.linalg.eigvals(self.A).real.min())


def delay_lyapunov(
    system: LateSystem, b: float, start: np.ndarray, least: np.ndarray, price: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Find the ``P >= least`` of least ``start'P start``, and multipliers.

    The program is solved in units of time in which the largest entry of ``K`` is 1.

    Parameters
    ----------
    system : LateSystem
    b : float
        Positive.
    start : (m,) array
    least : (m, m) array
        Symmetric, positive semidefinite.
    price : float
        What multipliers of errors cost beside ``start'P start``: their sum times this is minimised, too.

    Returns
    -------
    P, tau : (m, m) and (E,) arrays

    Raises
    ------
    NoCertificate
        The solver found nothing.

    Examples
    --------
    A pair that hears late of each other, ``y`` their difference:

    >>> pair = LateSystem(
    ...     A=np.array([[2.0]]), C=np.array([[1.0, -1.0]]), K=np.array([[1.0], [-1.0]]), agents=np.array([0, 1]),
    ...     place=np.array([0, 1]), weights=np.ones(2), lateness=np.full(2, 0.1),
    ...     heard=np.array([[0.0, 1.0], [1.0, 0.0]]), walks=np.zeros((0, 2)),
    ... )
    >>> P, tau = delay_lyapunov(pair, 1.0, np.ones(1), np.eye(1))
    >>> P.shape, tau.shape
    ((1, 1), (2,))
    """
    import cvxpy as cp

    if child_process.forked:
        raise NoCertificate("Clarabel is not run in a forked process")
    unit = max(float(np.abs(system.K).max(initial=0.0)), 1e-300)
    if system.lateness.max(initial=0.0) > LATEST / unit:
        raise NoCertificate("values are later than numbers allow")
    P, (m, q) = cp.Variable((len(start), len(start)), symmetric=True), system.C.shape
    N, size = P @ (system.A / unit), max(float(start @ start), price * unit * system.errors) + 1e-300
    N, limits = N + N.T - 2 * (b / unit + SLACK) * P, [P - least / unit >> 0]
    tau = cp.Variable(max(len(system.weights), 1), nonneg=True)
    if q:
        T, G = cp.Variable(q, nonneg=True), _slopes(system, unit, b / unit)
        Y = np.hstack([np.zeros((len(system.walks), m)), system.walks])
        N = cp.bmat([[N, -P @ system.C], [-(P @ system.C).T, (1 - SLACK) * cp.diag(T)]])
        N = N - G.T @ cp.diag(tau) @ G - Y.T @ Y
        limits += _multipliers(system, unit, T, tau)
    cost = cp.sum(cp.multiply(np.outer(start, start) / size, P)) + _TRACE * cp.trace(P)
    if system.errors:
        cost += price * unit / size * cp.sum(tau[-system.errors :])
    problem = cp.Problem(cp.Minimize(cost), [*limits, (N + N.T) / 2 >> 0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "solution may be inaccurate": what is found is proved by the caller
        run_solver(problem, "clarabel", {"chordal_decomposition_merge_method": "parent_child"})
    if P.value is None or not np.isfinite(P.value).all():
        raise NoCertificate(f"the solver answered {problem.status}")
    return (P.value + P.value.T) / 2 * unit, np.asarray(tau.value) * unit**2 if q else np.zeros(0)


def _slopes(system: LateSystem, unit: float, b: float) -> np.ndarray:
    """Return ``sqrt(c_e) m_e'Z`` by channel, in units of time in which ``b`` is the rate."""
    (m, q), h = system.C.shape, system.lateness * unit
    Z = np.zeros((len(system.K), m + q))
    Z[:, :m] = system.K / unit
    Z[system.agents, m + np.arange(q)] = -1
    return system.heard @ Z * np.sqrt(h * np.expm1(2 * b * h) / (2 * b))[:, None]


def _multipliers(system: LateSystem, unit: float, T: Any, tau: Any) -> list[Any]:
    """Return ``sum_e (w_e T_k)^2/tau_e <= T_k`` for all ``k``, each term by a cone."""
    import cvxpy as cp

    count = len(system.weights)
    own, share = np.zeros((len(system.agents), count)), cp.Variable(count, nonneg=True)
    own[system.place, np.arange(count)] = 1
    each = cp.multiply(system.weights / unit, T[system.place])
    return [own @ share <= T, cp.SOC(tau + share, cp.vstack([2 * each, tau - share]))]
