"""One Lyapunov matrix for several uncertain matrices without a solver: a useful rate at once, and of hundreds of rows.

With ``A`` the mean mode, ``b`` a share of twice its slowest eigenvalue, the Lyapunov equation

    P A + A' P - b P = Q,        Q = sum_i (H_i diag(tau_i) H_i' + P_0 F_i diag(r_i^2 / tau_i) F_i' P_0),

has a solution ``P`` that is prepared, to first order, for what the inequality of :mod:`lmi.common_lyapunov` takes off:
``P_0`` and ``tau`` are those of the last solution; at first ``Q`` is made of ``H_i`` and ``A_i``.

Given ``P``, in coordinates in which it is the identity, the best multipliers of
``C(tau) = A_i + A_i' - H diag(tau) H' - F diag(1 / tau) F'`` fulfil ``tau_e^2 = (f_e' X f_e) / (h_e' X h_e)`` with a
dual ``X``; ``(C - t I)^-1`` with ``t`` below the least eigenvalue is taken for it, again and again.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Sequence

import numpy as np

from lmi.common_lyapunov import CommonCertificate, evaluate
from lmi.errors import NoCertificate
from lmi.search_time import spend
from lmi.uncertain_matrix import UncertainMatrix

#: Shares of the slowest rate that are tried, equations solved for each, and steps of multipliers.
_SHARES, _EQUATIONS, _STEPS = (0.0, 0.3, 0.5, 0.7, 0.85), 2, 20
#: What of the identity is added to ``Q``, against its mean eigenvalue.
_REST = 1e-3
#: Seconds that an eigenvalue problem takes, over the cube of its rows.
_SECONDS = 1e-8


def closed_form_lyapunov(modes: Sequence[UncertainMatrix]) -> CommonCertificate:
    """Return the best of a few matrices that Lyapunov equations give, with multipliers.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
        All with the same number of rows.

    Raises
    ------
    NoCertificate
        The mean mode does not decay, or floating point ends.
    OutOfTime
        The time limit is reached.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994, chapter 5.

    Examples
    --------
    >>> one = UncertainMatrix(np.array([[3.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([1.0]))
    >>> round(closed_form_lyapunov([one]).rate, 6)  # the matrices [2] to [4]
    4.0
    """
    n, mean = len(modes[0].A), np.mean([mode.A for mode in modes], axis=0)
    found: list[CommonCertificate] = []
    spend(_SECONDS * n**3 * len(_SHARES) * _EQUATIONS * (_STEPS * len(modes) + 20))
    with warnings.catch_warnings(), np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError, ValueError):
        warnings.simplefilter("ignore")  # an equation that is nearly singular: it is one of a few
        slowest = float(np.linalg.eigvals(mean).real.min())
        for share in _SHARES if slowest > 0 else ():
            with contextlib.suppress(np.linalg.LinAlgError):
                found += _solutions(modes, mean - share * slowest * np.eye(n))
    if not found:
        raise NoCertificate("no Lyapunov equation of the mean mode gave a matrix")
    return max(found, key=lambda certificate: certificate.rate)


def _solutions(modes: Sequence[UncertainMatrix], A: np.ndarray) -> list[CommonCertificate]:
    from scipy.linalg import solve_continuous_lyapunov

    n, result = len(A), []
    Q = sum((_scaled(mode.A.T) + _scaled(mode.H) for mode in modes), np.zeros((n, n)))
    for _ in range(_EQUATIONS):
        P = solve_continuous_lyapunov(A.T, Q + _REST * np.trace(Q) / n * np.eye(n))
        P = (P + P.T) / 2
        P /= np.linalg.eigvalsh(P)[-1]
        result.append(evaluate(P, modes, [tuned_multipliers(P, mode) for mode in modes]))
        Q = np.zeros((n, n))
        for mode, tau in zip(modes, result[-1].multipliers, strict=True):
            spread = P @ (mode.F * mode.radii)
            Q += (mode.H * tau) @ mode.H.T + (spread / tau) @ spread.T
        if not Q.any():  # no weight is uncertain
            break
    return result


def _scaled(X: np.ndarray) -> np.ndarray:
    """Return ``X X'`` with the trace 1, or 0."""
    size = float(np.square(X).sum())
    return X @ X.T / size if size else np.zeros((len(X), len(X)))


def tuned_multipliers(P: np.ndarray, mode: UncertainMatrix) -> np.ndarray:
    """Return multipliers of a large rate for a given ``P``.

    Examples
    --------
    >>> one = UncertainMatrix(np.array([[3.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([1.0]))
    >>> [round(float(tau), 6) for tau in tuned_multipliers(np.eye(1), one)]
    [1.0]
    """
    if not mode.radii.size:
        return np.zeros(0)
    transformed, scale = mode.transformed(np.linalg.cholesky(P).T)
    form = transformed.A + transformed.A.T
    tau, best = np.ones(len(scale)), (-np.inf, np.ones(len(scale)))
    for step in range(_STEPS):
        sizes, vectors = np.linalg.eigh(
            form - (transformed.H * tau) @ transformed.H.T - (transformed.F / tau) @ transformed.F.T
        )
        if sizes[0] > best[0]:
            best = float(sizes[0]), tau
        below = max(float(sizes[-1] - sizes[0]), 1e-12) * 10.0 ** (-0.5 - 2 * step / _STEPS)
        root = vectors / np.sqrt(sizes - sizes[0] + below)
        f, h = (np.square(X.T @ root).sum(axis=1) for X in (transformed.F, transformed.H))
        tau = np.sqrt(np.where(step > 0, tau, np.sqrt(f / h)) * np.sqrt(f / h))
    return best[1] / scale
