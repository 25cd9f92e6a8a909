"""What a search or a closed form returns: a diagonal Lyapunov matrix with its rate and how far from optimal it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lmi.errors import MatrixError, NoCertificate
from lmi.matrix_classes import square


@dataclass(frozen=True, eq=False)
class DiagonalCertificate:
    """A diagonal Lyapunov matrix ``Omega = diag(omega)`` of ``A``, scaled to ``max omega = 1``.

    Long chains of followers need entries that float64 cannot hold: the logarithms are kept, and everything that
    float64 cannot say is said by them.

    Attributes
    ----------
    log_omega : (n,) array
        Natural logarithms of ``omega``; the largest is 0.
    rate : float
        The decay of the objective, per unit of the clock: ``lmin(Omega A + A' Omega) / max(omega)`` if the margin was
        maximised, otherwise :func:`diagonal_rate`. ``V = x' Omega x`` obeys ``V' <= -rate V`` along ``x' = -A x``.
    upper : float
        No diagonal matrix has a larger rate of that objective, as far as floating point tells; infinite if unknown.
    witness : tuple of arrays or None
        Closed forms: ``(log u, log v)``, both (n,), with ``Omega = diag(v / u)``. Best rate: ``(Y,)``, (n, k), with
        ``X = Y Y'`` that shows ``upper``; see :func:`lmi.no_diagonal_rate_above`.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> certificate = m_matrix_certificate([[2.0, -1.0], [-4.0, 5.0]])
    >>> round(certificate.rate, 9), round(certificate.condition, 9), abs(certificate.gap) < 1e-9
    (2.0, 4.0, True)
    """

    log_omega: np.ndarray
    rate: float
    upper: float = math.inf
    witness: tuple[np.ndarray, ...] | None = None

    @cached_property
    def omega(self) -> np.ndarray:
        """The diagonal; entries below 1e-308 times the largest underflow."""
        return np.exp(self.log_omega)

    @property
    def log_condition(self) -> float:
        """``ln(max(omega) / min(omega))``."""
        return float(-self.log_omega.min(initial=0.0))

    @property
    def condition(self) -> float:
        """``max(omega) / min(omega)``, the overshoot constant of the squared norm; infinite where float64 ends."""
        return math.exp(self.log_condition) if self.log_condition < 709 else math.inf

    @property
    def gap(self) -> float:
        """``upper / rate - 1``: how much faster, at most, another diagonal matrix could decay."""
        return self.upper / self.rate - 1 if self.rate > 0 else math.inf


def diagonal_margin(A: Any, omega: np.ndarray) -> float:
    """Return ``lmin(Omega A + A' Omega)`` with ``Omega = diag(omega)``.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    omega : (n,) array
        The diagonal.

    Returns
    -------
    float
        In floating point. Over ``max(omega)`` it is a rate, per unit of the clock; where it is positive ``Omega`` is a
        Lyapunov matrix.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> diagonal_margin([[1.0, 0.0], [0.0, 2.0]], [1.0, 1.0])
    2.0
    """
    S = np.asarray(omega)[:, None] * square(A)
    return float(np.linalg.eigvalsh(S + S.T)[0])


def diagonal_rate(A: Any, log_omega: np.ndarray, basis: np.ndarray | None = None) -> float:
    """Return the tight rate ``beta = max { b : Omega A + A' Omega >= b Omega }`` of a diagonal matrix.

    The smallest eigenvalue of ``B + B'`` with ``B = Omega^1/2 A Omega^-1/2``: no formula with these weights is larger.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    log_omega : (n,) array
        Natural logarithms of the diagonal.
    basis : (n, r) array, optional
        Of an invariant subspace of ``A`` to which the motion is confined; the inequality is asked for there only.

    Returns
    -------
    float
        Per unit of the clock, in floating point; negative if ``x' Omega x`` may grow.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square, or the vector has the wrong length.
    NoCertificate
        An entry of ``B`` overflows.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> round(diagonal_rate([[1.0, 0.0], [-2.0, 1.0]], [0.0, 0.0]), 12)
    0.0
    >>> round(diagonal_rate([[1.0, 0.0], [-2.0, 1.0]], [0.0, -40.0]), 6)
    2.0
    """
    A = square(A)
    log_omega = np.asarray(log_omega, dtype=float)
    if log_omega.shape != (len(A),):
        raise MatrixError(f"log_omega has shape {log_omega.shape}, not {(len(A),)}")
    B = scaled(A, log_omega)
    S = B + B.T
    if basis is not None:
        Q = np.linalg.qr(np.exp((log_omega - log_omega.max()) / 2)[:, None] * basis)[0]
        S = Q.T @ S @ Q
    return float(np.linalg.eigvalsh((S + S.T) / 2)[0])


def scaled(A: np.ndarray, log_omega: np.ndarray, log_columns: np.ndarray | None = None) -> np.ndarray:
    """Return ``Omega^1/2 A Omega^-1/2``, formed entry by entry so that no factor overflows where the product does not.

    With ``log_columns`` the columns of a block beside the diagonal have weights of their own.

    Raises
    ------
    NoCertificate
        An entry of the product itself overflows.
    """
    rows, columns = np.nonzero(A)
    log_columns = log_omega if log_columns is None else log_columns
    B = np.zeros_like(A)
    with np.errstate(over="ignore"):
        values = A[rows, columns]
        apart = log_omega[rows] - log_columns[columns]
        B[rows, columns] = np.sign(values) * np.exp(np.log(np.abs(values)) + apart / 2)
    if not np.isfinite(B).all():
        raise NoCertificate("the weights lie too far apart for floating point")
    return B
