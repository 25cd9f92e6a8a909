"""Diagonal Lyapunov matrices of leaders and followers: leader blocks weighed, and followers found, in one program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lmi.diagonal import diagonal_lyapunov, h_matrix_lyapunov, largest_entry, positive
from lmi.diagonal_interior_point import maximise_margin
from lmi.errors import MatrixError
from lmi.matrix_classes import square

#: A joint rate, in units of the largest entry, below this multiple of the tolerance is noise of the solver.
_RESOLVED = 100.0


@dataclass(frozen=True)
class FixedLeader:
    """A leader block whose Lyapunov matrix is known up to the scale shared by all such blocks.

    Attributes
    ----------
    omega : (k,) array
        The diagonal of the Lyapunov matrix, positive.
    decrease : (k,) array
        Positive: the diagonal of a matrix that bounds the decrease of ``x' diag(omega) x`` from below on the states
        that occur.

    References
    ----------
    Theorem 3 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> two = FixedLeader(omega=np.array([1.0, 3.0]), decrease=np.full(2, 2.0))
    >>> coupled_lyapunov([two], [[-1.0, 0.0]], [[1.0]]).leaders[0]  # kept as it is
    array([1., 3.])
    """

    omega: np.ndarray
    decrease: np.ndarray


@dataclass(frozen=True)
class FreeLeader:
    """A leader block ``x' = -A x`` whose diagonal ``H`` is searched; its decrease counts as ``lmin(HA + A'H) I``.

    Attributes
    ----------
    A : (k, k) array or sparse matrix
        With a diagonal Lyapunov matrix.

    References
    ----------
    Theorem 3 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> certificate = coupled_lyapunov([FreeLeader(np.array([[1.0]]))], [[-1.0]], [[1.0]])
    >>> bool(certificate.leaders[0][0] > 0 and certificate.followers[0] > 0)
    True
    """

    A: np.ndarray


@dataclass(frozen=True)
class CoupledCertificate:
    """Diagonal Lyapunov matrices of leaders and followers, found together.

    Attributes
    ----------
    leaders : tuple of (k,) arrays
        For a fixed block its ``omega`` unchanged; for a free block relative to those.
    followers : (n_F,) array
        ``rho Omega_F``: the coupling factor is contained.

    References
    ----------
    Theorem 3 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> certificate = coupled_lyapunov([FreeLeader(np.array([[1.0]]))], [[-1.0]], [[1.0]])
    >>> A, omega = np.array([[1.0, 0.0], [-1.0, 1.0]]), np.concatenate([*certificate.leaders, certificate.followers])
    >>> diagonal_margin(A, omega) > 0
    True
    """

    leaders: tuple[np.ndarray, ...]
    followers: np.ndarray


def coupled_lyapunov(
    leaders: Sequence[FixedLeader | FreeLeader], A_FL: Any, A_F: Any, *, tolerance: float = 1e-9
) -> CoupledCertificate:
    """Find weights of the leader blocks, follower matrix and coupling factor in one semidefinite program.

    With ``Gamma`` the block diagonal of ``s diag(decrease)`` (fixed blocks) and ``t_k I`` (free blocks,
    ``H_k A_k + A_k' H_k >= t_k I``), solves

        maximise t   subject to   [[Gamma, A_FL' Y], [Y A_FL, Y A_F + A_F' Y]] >= t I,   all diagonals <= 1,

    whose optimum is the largest ``lmin(Pi) / lmax(H)`` of the paper over free blocks, ``Y = rho H_F`` and ``rho``. Of a
    free block ``t_k`` alone enters, from 0 to its own best margin: that margin's ``H_k`` is found first and scaled, so
    that each block of leaders is one weight, and the matrix is ``W C + C'W`` with half its decrease on the diagonal of
    ``C``.

    Parameters
    ----------
    leaders : sequence of FixedLeader or FreeLeader
    A_FL : (n_F, n_L) array
        Columns in the order of the leader blocks.
    A_F : (n_F, n_F) array
        Of the followers.
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    CoupledCertificate

    Raises
    ------
    MatrixError
        Shapes do not match, or there is no leader block.
    NoCertificate
        A free block or the follower block has no diagonal Lyapunov matrix that the solver can resolve.
    NotAnHMatrix
        The solver found no positive rate, and the follower block is not an H-matrix with positive diagonal.

    References
    ----------
    Theorem 3 of [Zhu]_.
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> certificate = coupled_lyapunov([FixedLeader(np.ones(2), np.full(2, 2.0))], [[-1.0, 0.0]], [[1.0]])
    >>> (certificate.followers > 0).all()
    np.True_
    """
    A_F = square(A_F, "A_F")
    A_FL = np.asarray(A_FL.toarray() if hasattr(A_FL, "toarray") else A_FL, dtype=np.float64)
    sizes = [len(block.omega) if isinstance(block, FixedLeader) else len(square(block.A)) for block in leaders]
    n_L, n_F = sum(sizes), len(A_F)
    fixed = [block for block in leaders if isinstance(block, FixedLeader)]
    if any(not (b.omega.min() > 0 and b.decrease.min() > 0) for b in fixed if len(b.omega)):
        raise MatrixError("a fixed leader block needs a positive omega and a positive decrease")
    if n_L == 0:
        raise MatrixError("there is no leader block; use h_matrix_lyapunov for followers alone")
    if A_FL.shape != (n_F, n_L):
        raise MatrixError(f"A_FL has shape {A_FL.shape}, not {(n_F, n_L)}")
    # One unit for all blocks: the rate is the smallest eigenvalue of the whole matrix.
    scale = max(largest_entry(A_F), *(largest_entry(square(b.A)) for b in leaders if isinstance(b, FreeLeader)), 1e-300)
    top = max((float(b.omega.max()) for b in fixed), default=1.0)
    omegas, halves, groups = [], [], []
    for k, block in enumerate(leaders, start=1):
        if isinstance(block, FixedLeader):
            group, omega = 0, block.omega / top
            half = block.decrease / (2 * top * scale)
        else:
            best = diagonal_lyapunov(block.A, tolerance=tolerance, solver="interior-point")
            group, omega = k, best.omega
            half = np.full(len(best.omega), best.rate / (2 * scale))
        omegas.append(omega)
        halves.append(half)
        groups.append(np.full(len(omega), group))
    shared = np.unique(np.concatenate(groups), return_inverse=True)[1]
    C = np.block([[np.diag(np.concatenate(halves)), np.zeros((n_L, n_F))], [A_FL / scale, A_F / scale]])
    separate = np.concatenate([shared, shared.max() + 1 + np.arange(n_F)])
    solution = maximise_margin(C, np.ones(len(C)), tolerance=tolerance, least=0.0, groups=separate)
    if solution.t > _RESOLVED * tolerance:
        weights = positive(solution.omega)
    else:  # the best joint rate lies below what the method resolves: each block by itself
        followers = h_matrix_lyapunov(A_F, tolerance=tolerance).omega if n_F else np.zeros(0)
        weights = np.append(np.ones(n_L), followers)
    unit = top / weights[:n_L][np.concatenate(groups) == 0][0] if fixed else 1.0
    diagonals = [
        block.omega if isinstance(block, FixedLeader) else omega * weights[start] * unit
        for block, omega, start in zip(leaders, omegas, np.cumsum([0, *sizes[:-1]]), strict=True)
    ]
    return CoupledCertificate(tuple(diagonals), weights[n_L:] * unit)
