"""Coupling leaders and followers: admissible and best factor ``rho`` of a block-triangular composite.

With a leader block of Lyapunov matrix ``Omega_L`` and decrease ``Gamma > 0``, followers ``A_F`` with diagonal
``Omega_F`` and ``S_F = Omega_F A_F + A_F' Omega_F > 0``, the composite ``diag(Omega_L, rho Omega_F)`` decreases at
least by

    Phi(rho) = [[Gamma, rho A_FL' Omega_F], [rho Omega_F A_FL, rho S_F]].

By the Schur complement (Lemma 5) ``Phi(rho) > 0`` iff ``Gamma - rho R > 0``, ``R = A_FL' Omega_F S_F^-1 Omega_F A_FL``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import eigh, solve_triangular

from lmi.diagonal_solution import scaled
from lmi.errors import MatrixError, NoCertificate
from lmi.matrix_classes import block_columns


@dataclass(frozen=True)
class RhoInterval:
    """Upper ends of ``0 < rho < ...``; infinite when the leaders do not drive the followers.

    Attributes
    ----------
    printed : float
        The paper's sufficient end ``lmin / lmax(R)``.
    exact : float
        The supremum ``1 / lmax(Gamma^-1/2 R Gamma^-1/2)``.

    References
    ----------
    Lemma 5 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> gamma = np.diag([1.0, 4.0])  # a leader that does not drive the follower does not shorten the exact interval
    >>> Coupling(gamma, np.ones(2), np.ones(1), np.array([[0.0, -1.0]]), np.array([[1.0]])).interval()
    RhoInterval(printed=2.0, exact=8.0)
    """

    printed: float
    exact: float


@dataclass(frozen=True)
class Coupling:
    """A composite of leaders and followers, ready to be asked about ``rho``; see the module for the symbols.

    Attributes
    ----------
    gamma : (n_L, n_L) array
        Decrease of the leaders, positive definite.
    omega_L, omega_F : (n_L,), (n_F,) arrays
        Diagonals of the Lyapunov matrices of leaders and followers.
    A_FL, A_F : (n_F, n_L), (n_F, n_F) arrays
        The followers' rows of the matrix, ``x_F' = -A_FL x_L - A_F x_F``.
    printed_numerator : float or None
        The paper's numerator of the printed interval, ``lmin(Gamma)`` by default.

    Raises
    ------
    MatrixError
        The blocks do not fit together.

    References
    ----------
    Lemma 5 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> c = Coupling(np.eye(1), np.ones(1), np.ones(1), np.array([[-1.0]]), np.array([[1.0]]))
    >>> c.schur_term()
    array([[0.5]])
    >>> round(c.rate(0.5), 9), c.interval().exact  # Phi(rho) > 0 below the end of the interval
    (0.5, 2.0)
    """

    gamma: np.ndarray
    omega_L: np.ndarray
    omega_F: np.ndarray
    A_FL: np.ndarray
    A_F: np.ndarray
    printed_numerator: float | None = None

    def __post_init__(self) -> None:
        n_L, n_F = len(self.omega_L), len(self.omega_F)
        if self.gamma.shape != (n_L, n_L) or self.A_FL.shape != (n_F, n_L) or self.A_F.shape != (n_F, n_F):
            raise MatrixError("the blocks of the composite do not fit together")

    def follower_decrease(self) -> np.ndarray:
        """``S_F = Omega_F A_F + A_F' Omega_F``."""
        S = self.omega_F[:, None] * self.A_F
        return S + S.T

    def schur_term(self) -> np.ndarray:
        """``R = A_FL' Omega_F S_F^-1 Omega_F A_FL``."""
        C = self.omega_F[:, None] * self.A_FL
        R = C.T @ np.linalg.solve(self.follower_decrease(), C)
        return (R + R.T) / 2

    def phi(self, rho: float) -> np.ndarray:
        """Return ``Phi(rho)``, (n_L + n_F, n_L + n_F), of a factor ``rho > 0``."""
        C = rho * self.omega_F[:, None] * self.A_FL
        return np.block([[self.gamma, C.T], [C, rho * self.follower_decrease()]])

    def rate(self, rho: float) -> float:
        """Return the paper's rate ``lmin(Phi(rho)) / lmax(diag(Omega_L, rho Omega_F))``, per unit of the clock."""
        top = max(float(self.omega_L.max(initial=0.0)), rho * float(self.omega_F.max(initial=0.0)))
        return float(np.linalg.eigvalsh(self.phi(rho))[0]) / top

    def interval(self) -> RhoInterval:
        """Return the printed and the exact upper end of the admissible ``rho``.

        Raises
        ------
        MatrixError
            No ``rho`` is admissible, because ``Gamma`` or ``S_F`` is not positive definite.

        Examples
        --------
        >>> c = Coupling(np.eye(1), np.ones(1), np.ones(1), np.array([[-1.0]]), np.array([[1.0]]))
        >>> c.interval()
        RhoInterval(printed=2.0, exact=2.0)
        """
        if not (self.omega_F.size and np.any(self.A_FL)):
            return RhoInterval(math.inf, math.inf)
        # In a unit of its own, so that a weak coupling does not underflow.
        unit = float(np.abs(self.A_FL).max())
        R = replace(self, A_FL=self.A_FL / unit).schur_term()
        top, low = float(np.linalg.eigvalsh(R)[-1]), float(np.linalg.eigvalsh(self.gamma)[0])
        if not (top > 0 and low > 0):
            raise MatrixError("Gamma or the followers' decrease is not positive definite: no rho is admissible")
        numerator = low if self.printed_numerator is None else self.printed_numerator
        ends = (numerator / top, 1 / float(eigh(R, self.gamma, eigvals_only=True)[-1]))
        return RhoInterval(*(min(end / unit / unit, sys.float_info.max) for end in ends))

    def best_rho(self) -> float:
        """Return the ``rho`` of the exact interval with the largest :meth:`rate`, by golden section.

        ``lmin(Phi(rho))`` is concave with value 0 at 0, so the rate falls once ``rho Omega_F`` exceeds ``Omega_L``:
        the best ``rho`` lies below that crossing and the end of the interval; there the rate is concave in ``rho``.

        Examples
        --------
        >>> c = Coupling(np.eye(1), np.ones(1), np.ones(1), np.array([[-1.0]]), np.array([[1.0]]))
        >>> round(c.best_rho(), 6), round(c.rate(c.best_rho()), 6)
        (0.5, 0.5)
        """
        crossing = float(self.omega_L.max()) / float(self.omega_F.max())
        end = min(self.interval().exact, crossing)
        return golden_section(self.rate, 0.0, end)


def schur_positive_definite(S1: Any, S2: Any, S3: Any) -> bool:
    """Lemma 5: with ``S3 > 0``, ``S1 - S2' S3^-1 S2 > 0`` iff ``[[S1, S2'], [S2, S3]] > 0``; decided by the former.

    Parameters
    ----------
    S1 : (n, n) array
        Symmetric.
    S2 : (m, n) array
    S3 : (m, m) array
        Symmetric, positive definite.

    Returns
    -------
    bool
        As far as floating-point eigenvalues tell; :func:`lmi.prove_positive_definite` decides exactly.

    Raises
    ------
    MatrixError
        ``S3`` is not positive definite.

    Examples
    --------
    >>> schur_positive_definite([[2.0]], [[1.0]], [[1.0]]), schur_positive_definite([[1.0]], [[2.0]], [[1.0]])
    (True, False)
    """
    S1, S2, S3 = (np.asarray(S, dtype=np.float64) for S in (S1, S2, S3))
    if not np.linalg.eigvalsh(S3)[0] > 0:
        raise MatrixError("S3 is not positive definite")
    complement = S1 - S2.T @ np.linalg.solve(S3, S2)
    return bool(np.linalg.eigvalsh((complement + complement.T) / 2)[0] > 0)


def golden_section(function: Any, low: float, high: float, tolerance: float = 1e-10) -> float:
    """Maximise a quasiconcave function on ``[low, high]``; returns the best point that was evaluated.

    Examples
    --------
    >>> round(golden_section(lambda x: -(x - 1) ** 2, 0.0, 3.0), 6)
    1.0
    """
    ratio = (math.sqrt(5) - 1) / 2
    inner, outer = high - ratio * (high - low), low + ratio * (high - low)
    f_inner, f_outer = function(inner), function(outer)
    best = max((f_inner, inner), (f_outer, outer), (function(high), high))
    while high - low > tolerance * high:
        if f_inner < f_outer:
            low, inner, f_inner = inner, outer, f_outer
            outer = low + ratio * (high - low)
            f_outer = function(outer)
        else:
            high, outer, f_outer = outer, inner, f_inner
            inner = high - ratio * (high - low)
            f_inner = function(inner)
        best = max(best, (f_inner, inner), (f_outer, outer))
    return best[1]


def couple_blocks(
    A: np.ndarray, parts: Sequence[np.ndarray], log_omega: np.ndarray, rate: float, basis: np.ndarray | None = None
) -> np.ndarray:
    """Scale the diagonal Lyapunov matrices of irreducible blocks so that the composite decays at ``rate``.

    In the scaled rows ``B = Omega^1/2 A Omega^-1/2`` the composite decays at ``b`` iff ``M = B + B' - b I > 0``, and a
    factor ``rho`` on the driven rows multiplies the coupling block ``C`` by ``rho^1/2``: ``M > 0`` iff
    ``rho < 1 / ||M_F^-1/2 C M_L^-1/2||^2`` (Lemma 5). Blocks of the same depth are joined to those that drive them with
    half of that factor. Only logarithms are kept, so that long chains do not overflow.

    Parameters
    ----------
    A : (n, n) array
    parts : sequence of (k,) int arrays
        Irreducible blocks, those that drive first (:func:`lmi.irreducible_blocks`).
    log_omega : (n,) array
        Logarithms of the blocks' own diagonals.
    rate : float
        Below the rate of every block, per unit of the clock.
    basis : (n, r) array, optional
        Of an invariant subspace, block by block, to which the inequality is restricted.

    Returns
    -------
    (n,) array
        Logarithms, the largest 0.

    Raises
    ------
    NoCertificate
        Some block does not decay at that rate.

    Examples
    --------
    >>> A = np.array([[1.0, 0.0], [-4.0, 1.0]])
    >>> log_omega = couple_blocks(A, [np.array([0]), np.array([1])], np.zeros(2), 1.0)
    >>> S = np.exp(log_omega)[:, None] * A
    >>> bool((np.linalg.eigvalsh(S + S.T - np.diag(np.exp(log_omega))) > 0).all())
    True
    """
    log_omega, n = np.array(log_omega, dtype=float), len(A)
    depth = np.zeros(n, dtype=int)
    for part in parts:
        drives = np.abs(A[part]).sum(axis=0) > 0
        drives[part] = False
        depth[part] = depth[drives].max(initial=-1) + 1
    above, used = np.zeros(0, dtype=int), 0
    frame = np.zeros((n, n if basis is None else basis.shape[1]))  # orthonormal, in scaled rows
    factor = np.zeros((frame.shape[1], frame.shape[1]))
    try:
        for level in range(int(depth.max(initial=0)) + 1):
            own = np.flatnonzero(depth == level)
            rows, columns = np.nonzero(A[np.ix_(own, above)])
            if rows.size:  # into reach of the rows that drive, where no entry overflows
                log_omega[own] += float((log_omega[above[columns]] - log_omega[own[rows]]).min())
            Q = _frame(own, log_omega, basis)
            B = scaled(A[np.ix_(own, own)], log_omega[own])
            M = Q.T @ (B + B.T) @ Q - rate * np.eye(Q.shape[1])
            reach = scaled(A[np.ix_(own, above)], log_omega[own], log_omega[above]) @ frame[above, :used]
            lower = solve_triangular(factor[:used, :used], (Q.T @ reach).T, lower=True).T if used else Q.T @ reach
            top = float(np.linalg.norm(np.linalg.solve(np.linalg.cholesky(M), lower), 2)) if lower.size else 0.0
            share = -2 * math.log(top) - math.log(2) if top > 0 else 0.0
            log_omega[own] += share
            lower *= math.exp(share / 2)
            end = used + Q.shape[1]
            factor[used:end, :used] = lower
            factor[used:end, used:end] = np.linalg.cholesky(M - lower @ lower.T)
            frame[own, used:end] = Q
            above, used = np.concatenate([above, own]), end
    except (np.linalg.LinAlgError, ValueError):
        raise NoCertificate(f"some block does not decay at the rate {rate:.6g} in floating point") from None
    return log_omega - log_omega.max()


def _frame(own: np.ndarray, log_omega: np.ndarray, basis: np.ndarray | None) -> np.ndarray:
    """Return an orthonormal basis of the subspace, in the scaled rows of one level."""
    if basis is None:
        return np.eye(len(own))
    weight = np.exp((log_omega[own] - log_omega[own].max()) / 2)
    return np.linalg.qr(weight[:, None] * block_columns(basis, own))[0]
