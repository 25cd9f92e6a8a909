"""Full (non-diagonal) Lyapunov matrices: every rate below the spectral one, at the smallest overshoot constant found.

Two steps, both without a solver. The slow and the fast modes are split by a basis ``X`` of invariant subspaces, so that
``X^-1 A X = diag(A_1 .. A_m)``; on each block the identity is corrected until it decays at the wanted rate:

    P = I + Delta,    (A - a I)' Delta + Delta (A - a I) = N,    N = negative part of A + A' - 2 a I,

whence ``P A + A' P - 2 a P = (A + A' - 2 a I) + N >= 0`` and ``P >= I``. If ``A`` is normal nothing is corrected and
nothing is lost; if it is not, the correction is what the transients need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lmi.errors import MatrixError, NoCertificate
from lmi.matrix_classes import square
from lmi.search_time import checkpoint

#: Relative deviations of the wanted rate from the spectral one.
LOSSES = (1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
#: Modes whose decay rates differ by more than this factor are split; 1 splits all that are distinct.
SPLITS = (np.inf, 30.0, 10.0, 5.0, 3.0, 2.0, 1.5, 1.2, 1.05, 1.0)
#: A basis of invariant subspaces with a larger condition number is not used.
_LARGEST_BASIS = 1e7
#: A rate that is larger by less, relatively, is not worth a larger overshoot constant.
_SAME_RATE = 1e-6


@dataclass(frozen=True, eq=False)
class FullCertificate:
    """A Lyapunov matrix ``P`` of ``A``: ``P A + A' P >= rate P``, as far as floating point tells.

    Attributes
    ----------
    matrix : (n, n) array
        Symmetric; smallest eigenvalue 1.
    rate : float
        Smallest eigenvalue of ``(P A + A' P, P)``, per unit of the clock.
    condition : float
        ``lmax(P) / lmin(P)``, the overshoot constant of the squared norm.

    References
    ----------
    Horn and Johnson, Topics in Matrix Analysis, Cambridge 1991, section 2.2.

    Examples
    --------
    >>> A = np.array([[1.0, 9.0], [0.0, 2.0]])
    >>> certificate = full_frontier(A)[-1]
    >>> P, rate = certificate.matrix, certificate.rate
    >>> bool(np.linalg.eigvalsh(P @ A + A.T @ P - 0.999 * rate * P)[0] > 0)
    True
    """

    matrix: np.ndarray
    rate: float
    condition: float


def full_frontier(
    A: Any, *, decay: float | None = None, losses: Sequence[float] = LOSSES
) -> tuple[FullCertificate, ...]:
    """Return rate against overshoot constant over full Lyapunov matrices; see the module for how they are made.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        All eigenvalues with positive real part.
    decay : float, optional
        ``min Re lambda``, if it is known better than from the eigenvalues of ``A`` (block by block of a reducible
        matrix, whose Jordan chains cost digits); per unit of the clock.
    losses : sequence of float
        Wanted deviations ``1 - a / decay``.

    Returns
    -------
    tuple of FullCertificate
        Rate and condition strictly increasing; the first may be the identity, with a negative rate.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square, or has no rows.
    NoCertificate
        ``A`` has an eigenvalue without positive real part, or no matrix with a positive rate was found.

    References
    ----------
    Horn and Johnson, Topics in Matrix Analysis, Cambridge 1991, section 2.2.

    Examples
    --------
    >>> best = full_frontier([[1.0, 9.0], [0.0, 2.0]])[-1]
    >>> round(best.rate, 3), best.condition < 500
    (2.0, True)
    """
    A = square(A)
    if len(A) == 0:
        raise MatrixError("A has no rows")
    values, vectors = np.linalg.eig(A)
    decay = float(values.real.min()) if decay is None else decay
    if not decay > 0:
        raise NoCertificate(f"an eigenvalue has real part {decay:.3g}: nothing decays")
    candidates = [_certificate(A, np.eye(len(A)))]
    searched = set()
    for split in SPLITS:
        groups = _groups(values.real, split)
        if len(groups) in searched:
            continue
        searched.add(len(groups))
        checkpoint()
        if blocks := _blocks(A, vectors, groups):
            candidates += [_certificate(A, _lyapunov(blocks, decay * (1 - loss))) for loss in losses]
    points = sorted((c for c in candidates if c is not None), key=lambda c: (c.condition, -c.rate))
    frontier: list[FullCertificate] = []
    for point in points:
        if not frontier or point.rate > frontier[-1].rate + _SAME_RATE * abs(frontier[-1].rate):
            frontier.append(point)
    if not frontier or not frontier[-1].rate > 0:
        raise NoCertificate("no full Lyapunov matrix with a positive rate was found in floating point")
    return tuple(frontier)


def _groups(decay: np.ndarray, split: float) -> list[np.ndarray]:
    """Cut the modes, sorted by decay, where the next one is faster by more than the factor ``split``."""
    order = np.argsort(decay, kind="stable")
    sorted_decay = decay[order]
    # Conjugate pairs share their real part up to rounding and stay together.
    faster = sorted_decay[1:] > np.abs(sorted_decay[:-1]) * split * (1 + 1e-9)
    return np.split(order, np.flatnonzero(faster) + 1)


def _blocks(A: np.ndarray, vectors: np.ndarray, groups: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Split ``A`` by invariant subspaces: ``(T, R)`` of each with ``R A = T R``, ``T`` a real Schur form.

    Empty where the basis is too ill-conditioned to be of use.
    """
    from scipy.linalg import schur

    X: np.ndarray = np.eye(len(A))
    inverse: np.ndarray = X
    if len(groups) > 1:
        spans = [np.hstack([vectors[:, group].real, vectors[:, group].imag]) for group in groups]
        parts = [np.linalg.svd(span, full_matrices=False)[0] for span in spans]
        X = np.hstack([part[:, : len(group)] for part, group in zip(parts, groups, strict=True)])
        size = np.linalg.svd(X, compute_uv=False)
        if not size[-1] * _LARGEST_BASIS > size[0]:
            return []
        inverse = np.linalg.inv(X)
    blocks = []
    for own in np.split(np.arange(len(A)), np.cumsum([len(group) for group in groups])[:-1]):
        T, U = schur(inverse[own] @ A @ X[:, own], output="real")
        blocks.append((T, U.T @ inverse[own]))
    return blocks


def _lyapunov(blocks: list[tuple[np.ndarray, np.ndarray]], a: float) -> np.ndarray | None:
    """Return ``P`` that decays at ``2 a``; None where floating point ends."""
    own = [_corrected_identity(T, a) for T, _ in blocks]
    if any(block is None for block in own):
        return None
    P = sum(R.T @ block @ R for block, (_, R) in zip(own, blocks, strict=True))
    return (P + P.T) / 2


def _corrected_identity(T: np.ndarray, a: float) -> np.ndarray | None:
    """Return ``I + Delta`` of a block in Schur form; see the module."""
    from scipy.linalg.lapack import dtrsyl

    shifted = T - a * np.eye(len(T))
    values, vectors = np.linalg.eigh(shifted + shifted.T)
    if values[0] >= 0:
        return np.eye(len(T))
    negative = (vectors * np.maximum(-values, 0.0)) @ vectors.T
    delta, scale, info = dtrsyl(shifted, shifted, negative, trana="T")
    if info < 0 or not scale > 0 or not np.isfinite(delta).all():
        return None
    return np.eye(len(T)) + delta / scale


def _certificate(A: np.ndarray, P: np.ndarray | None) -> FullCertificate | None:
    """Rate and condition from eigenvalues of the matrix itself; None if it is not positive definite in floats."""
    if P is None or not np.isfinite(P).all():
        return None
    try:
        size = np.linalg.eigvalsh(P)
        if not size[0] > 1e-15 * size[-1]:
            return None
        factor = np.linalg.cholesky(P / size[0])
        B = np.linalg.solve(factor, (factor.T @ A).T).T  # R A R^-1 with R = factor'
        rate = float(np.linalg.eigvalsh(B + B.T)[0])
    except np.linalg.LinAlgError:
        return None
    return FullCertificate(P / size[0], rate, float(size[-1] / size[0]))
