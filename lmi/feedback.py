"""One feedback for several linear systems with one input, at a wanted rate: the search, by Clarabel.

With ``W > 0`` and ``A_i W + W A_i' - b b' + r W <= 0`` for all ``i``, the feedback ``u = -c b'W^-1 x``, ``c >= 1``,
gives ``V = x'W^-1 x`` the rate ``r`` along ``x' = A(t) x + b u`` for every ``A(t)`` in the convex hull of the ``A_i``.
What is found is proved elsewhere.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from lmi import child_process
from lmi.diagonal import run_solver
from lmi.errors import NoCertificate

#: By how much of ``W`` the inequalities hold strictly, so that rounding keeps them: the first that the solver reaches.
SLACKS = (1e-3, 1e-5, 1e-7)
#: Real parts from which on a Lyapunov equation is solved for coordinates; otherwise they are shifted to 1/2.
LEAST = 0.02
#: Largest ``W`` in these coordinates: where a system decays by itself, the least gain is reached at no finite ``W``.
LARGEST = 1e4


def feedback_matrix(systems: Sequence[np.ndarray], rate: float) -> np.ndarray:
    """Find the ``W`` of least ``b'W^-1 b``, ``b`` the last unit vector: the feedback of the least gain.

        minimise b'W^-1 b   subject to   A_i W + W A_i' - b b' + rate W <= -slack rate W

    The program is solved in coordinates in which the ``W`` of one of the systems alone is the identity.

    Parameters
    ----------
    systems : sequence of (n, n) arrays
        ``A_i``, chains of integrators disturbed by terms of any size.
    rate : float
        Positive.

    Returns
    -------
    (n, n) array
        Symmetric positive definite.

    Raises
    ------
    NoCertificate
        The solver found nothing.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994, 7.2.

    Examples
    --------
    >>> W = feedback_matrix([np.zeros((1, 1))], 2.0)  # 2 W <= 1, with a slack of 0.001
    >>> round(float(W[0, 0]), 4)
    0.4995
    """
    if child_process.forked:
        raise NoCertificate("Clarabel is not run in a forked process")
    n = len(systems[0])
    scale = rate ** (np.arange(n) + 1.0 - n) / np.sqrt(rate)
    scaled = [A * scale / scale[:, None] / rate for A in systems]
    C = _frame(scaled)
    back = np.linalg.inv(C)
    turned, last = [back @ A @ C for A in scaled], back[:, -1]
    for slack in SLACKS:
        try:
            W = _solve(turned, last, 1 + slack)
        except NoCertificate:
            continue
        return scale[:, None] * (C @ W @ C.T) * scale
    raise NoCertificate(f"no feedback of rate {rate:.6g} was found")


def later_matrices(
    systems: Sequence[np.ndarray], gains: np.ndarray, former: np.ndarray, strength: float
) -> Callable[[float], np.ndarray | None]:
    """Return the search of matrices not below a former one by which a given feedback decays at other rates.

        minimise sum W_ii/former_ii   subject to   W >= former,   W gains = d b,
        A_i W + W A_i' - strength d b b' + rate W <= -slack rate W

    Parameters
    ----------
    systems : sequence of (n, n) arrays
        ``A_i``, as :func:`feedback_matrix` takes them.
    gains : (n,) array
    former : (n, n) array
        Symmetric positive definite.
    strength : float
        Positive.

    Returns
    -------
    callable
        Of a positive rate; it returns ``W``, or None if none is found. The program is built once for all rates.

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> later_matrices([0 * one], np.ones(1), one, 1.0)(0.5).round(3)  # 0.5 W <= d, W = d
    array([[1.]])
    """
    import cvxpy as cp

    C = np.linalg.cholesky(former)
    back, n = np.linalg.inv(C), len(former)
    turned, last = [back @ A @ C for A in systems], back[:, -1]
    W, d, rate = cp.Variable((n, n), symmetric=True), cp.Variable(), cp.Parameter(pos=True)
    gap = [strength * d * np.outer(last, last) - (1 + SLACKS[1]) * rate * W - A @ W - W @ A.T for A in turned]
    limits = [(F + F.T) / 2 >> 0 for F in gap] + [W - (1 + SLACKS[1]) * np.eye(n) >> 0, W @ (C.T @ gains) == d * last]
    weight = C.T @ np.diag(1 / former.diagonal()) @ C
    problem = cp.Problem(cp.Minimize(cp.trace(weight @ W)), [*limits, LARGEST * np.eye(n) - W >> 0])

    def matrix_at(value: float) -> np.ndarray | None:
        rate.value = value
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # as above
                run_solver(problem, "clarabel", {"warm_start": False})
        except NoCertificate:
            return None
        if problem.status != "optimal" or W.value is None:
            return None
        return np.asarray(C @ (W.value + W.value.T) @ C.T / 2)

    return matrix_at


def _frame(systems: Sequence[np.ndarray]) -> np.ndarray:
    """Return a factor of the ``W`` with ``A W + W A' + 2 s W = b b'``, of the first system that has one.

    ``s`` is 1/2 if ``A + I/2`` has its spectrum on the right, and so large that ``A + s I`` has otherwise: ``W`` is
    positive definite, and near those of the others. The identity if rounding leaves none.
    """
    n = len(systems[0])
    unit = np.eye(n)[:, [-1]]
    for A in systems:
        least = np.linalg.eigvals(A).real.min()
        moved = A + np.eye(n) * (0.5 if least > LEAST - 0.5 else 0.5 - least)
        W = solve_continuous_lyapunov(moved, unit @ unit.T)
        try:
            return np.asarray(np.linalg.cholesky((W + W.T) / 2))
        except np.linalg.LinAlgError:
            continue
    return np.eye(n)


def _solve(systems: Sequence[np.ndarray], last: np.ndarray, rate: float) -> np.ndarray:
    """Return the ``W`` of systems whose entries are of size 1, ``last`` in the place of ``b``."""
    import cvxpy as cp

    n = len(last)
    W, square = cp.Variable((n, n), symmetric=True), np.outer(last, last)
    gap = [square - rate * W - A @ W - W @ A.T for A in systems]
    cost = cp.matrix_frac(last, W)
    limits = [(F + F.T) / 2 >> 0 for F in gap]
    problem = cp.Problem(cp.Minimize(cost), [*limits, LARGEST * np.eye(n) - W >> 0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "solution may be inaccurate": what is found is proved by the caller
        run_solver(problem, "clarabel", {})
    if W.value is None or not np.isfinite(W.value).all():
        raise NoCertificate(f"the solver answered {problem.status}")
    return (W.value + W.value.T) / 2
