"""A matrix with uncertain parameters, each of which multiplies a matrix of rank one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lmi.errors import MatrixError
from lmi.matrix_classes import square


@dataclass(frozen=True, eq=False)
class UncertainMatrix:
    """The matrices ``A + sum_e delta_e f_e h_e'`` with ``|delta_e| <= radii_e``.

    Attributes
    ----------
    A : (n, n) array
    F, H : (n, q) arrays
        Columns ``f_e``, ``h_e``, none of them 0.
    radii : (q,) array
        Positive.

    Examples
    --------
    >>> UncertainMatrix.known([[1.0, 2.0], [0.0, 1.0]]).radii
    array([], dtype=float64)
    """

    A: np.ndarray
    F: np.ndarray
    H: np.ndarray
    radii: np.ndarray

    @classmethod
    def known(cls, A: Any) -> UncertainMatrix:
        """Return a matrix without uncertainty."""
        A = square(A)
        return cls(A, np.zeros((len(A), 0)), np.zeros((len(A), 0)), np.zeros(0))

    def __post_init__(self) -> None:
        n, q = len(self.A), len(self.radii)
        arrays = (self.A, self.F, self.H, self.radii)
        if self.A.shape != (n, n) or not self.F.shape == self.H.shape == (n, q) or self.radii.shape != (q,):
            raise MatrixError("A is (n, n), F and H are (n, q), radii (q,)")
        if not all(np.isfinite(x).all() for x in arrays) or not (self.radii > 0).all():
            raise MatrixError("an entry is not a finite number, or a radius is not positive")

    def transformed(self, R: np.ndarray) -> tuple[UncertainMatrix, np.ndarray]:
        """Return the matrices of ``y = R x`` with ``|f| = |h|`` and radii 1, and by what to divide multipliers."""
        A = np.linalg.solve(R.T, (R @ self.A).T).T
        F, H = R @ (self.F * self.radii), np.linalg.solve(R.T, self.H)
        scale = np.sqrt(_column_norms(H) / _column_norms(F))
        return UncertainMatrix(A, F * scale, H / scale, np.ones(len(scale))), scale**2


def _column_norms(X: np.ndarray) -> np.ndarray:
    """Return the norms of columns that are not 0, also where squares of their entries are beyond floats."""
    largest = np.abs(X).max(axis=0, initial=0.0)
    return largest * np.linalg.norm(X / largest, axis=0)
