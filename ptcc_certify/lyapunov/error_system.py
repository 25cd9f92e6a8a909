"""The error ``E = -L X`` as a linear system of its own, where every eigenvalue decays.

Along ``X' = -gain L X`` the error obeys ``E' = -gain L E``. Rows of one-node closed components stay 0 and are left out;
the rows of a larger balanced closed component never leave the range of its Laplacian, ``{ E_k : p_k' G_k E_k = 0 }``.
What remains has exactly the nonzero eigenvalues of ``L``: a Lyapunov inequality is asked for on that subspace only.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import flint
import numpy as np

from lmi.definiteness_proofs import prove_generalized_margin
from lmi.dyadic import round_to_bits
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.theorems.lemmas import (
    Matrix,
    exact_block,
    float_block,
    integer_matrix,
    integer_rows,
    left_vector,
    multiply,
)

#: Bits of the rounded factor of the exact basis.
_BASIS_BITS = 53


@dataclass(frozen=True, eq=False)
class ErrorSystem:
    """Rows of ``E`` that move, leaders first, and how.

    Attributes
    ----------
    structure : Structure
    """

    structure: Structure

    @cached_property
    def leaders(self) -> tuple[ClosedComponent, ...]:
        """The closed components that move: all but the balanced ones of one node."""
        return tuple(c for c in self.structure.closed_components if len(c.nodes) > 1 or not c.balanced)

    @cached_property
    def nodes(self) -> tuple[int, ...]:
        """The node of every row."""
        return (*(v for c in self.leaders for v in c.nodes), *self.structure.followers.tolist())

    @cached_property
    def parts(self) -> tuple[np.ndarray, ...]:
        """Positions of the rows of each leader group, then of the followers if there are any."""
        sizes = [len(c.nodes) for c in self.leaders]
        sizes += [self.structure.followers.size] if self.structure.followers.size else []
        return tuple(np.split(np.arange(len(self.nodes)), np.cumsum(sizes)[:-1])) if sizes else ()

    @cached_property
    def matrix(self) -> np.ndarray:
        """``A`` with ``E' = -gain A E``, (n, n): the rows and columns of ``L``."""
        return float_block(self.structure.graph.dense_laplacian(), self.nodes, self.nodes)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit vectors ``G_k p_k`` (n, m_b), one for each balanced leader group that moves."""
        columns = []
        for rows, component in zip(self.parts, self.leaders, strict=False):
            if component.balanced:
                normal = np.zeros(len(self.nodes))
                normal[rows] = np.array(component.gauge) * left_vector(self.structure.graph.subgraph(component.nodes))
                columns.append(normal / np.linalg.norm(normal))
        return np.array(columns).T if columns else np.zeros((len(self.nodes), 0))

    @cached_property
    def basis(self) -> np.ndarray | None:
        """Orthonormal basis (n, r) of the subspace of ``E``, block by block; None if that is everything."""
        if not self.normals.shape[1]:
            return None
        columns = np.eye(len(self.nodes))
        blocks, normals = [], iter(self.normals.T)
        for rows, component in zip(self.parts, (*self.leaders, None), strict=False):
            if component is None or not component.balanced:
                blocks.append(columns[:, rows])
                continue
            # The columns of a Householder reflection that takes the normal to the first axis, but for the first.
            whole, normal = np.zeros((len(self.nodes), len(rows) - 1)), next(normals)[rows]
            whole[rows] = np.linalg.qr(normal[:, None], mode="complete")[0][:, 1:]
            blocks.append(whole)
        return np.hstack(blocks)

    @cached_property
    def exact_matrix(self) -> Matrix:
        """``A`` in rationals."""
        return exact_block(self.structure.graph.exact_laplacian(), self.nodes, self.nodes)

    @cached_property
    def exact_basis(self) -> Matrix | None:
        """Basis of the subspace in rationals: ``L_k R_k`` for balanced groups, near the orthonormal one; or None.

        Whatever the rounded ``R_k``, the columns lie in the range of ``L_k``; that they span it follows from the
        definiteness that is proved on them.
        """
        if self.basis is None:
            return None
        result: Matrix = [[Fraction(int(x)) for x in row] for row in self.basis]  # rows of balanced groups follow
        for rows, component in zip(self.parts, self.leaders, strict=False):
            if not component.balanced:
                continue
            columns = np.flatnonzero(np.abs(self.basis[rows]).max(axis=0) > 0)
            R = np.linalg.pinv(self.matrix[np.ix_(rows, rows)]) @ self.basis[np.ix_(rows, columns)]
            R /= 2.0 ** np.floor(np.log2(np.abs(R).max()))
            factor = [[Fraction(round(x * 2**_BASIS_BITS), 2**_BASIS_BITS) for x in row] for row in R]
            for i, row in zip(rows, multiply(exact_block(self.exact_matrix, rows, rows), factor), strict=True):
                for j, x in zip(columns, row, strict=True):
                    result[i][j] = x
        return result

    @cached_property
    def _integers(self) -> tuple[flint.fmpz_mat, int, flint.fmpz_mat | None]:
        """``A`` in integers over a scale, and the exact basis times a number."""
        A, scale = integer_matrix(self.exact_matrix)
        return A, scale, None if self.exact_basis is None else integer_matrix(self.exact_basis)[0]

    def prove_rate(self, P: Matrix, guess: float) -> Fraction | None:
        """Prove ``P A + A' P > b P`` on the subspace; return ``b``, near to the guess, or None.

        That ``P`` itself is positive definite, without which this bounds nothing, is proved by the caller.
        """
        A, scale, K = self._integers
        form, _ = integer_matrix(P)
        product = form * A
        S, Z = product + product.transpose(), form * scale
        if K is not None:
            S, Z = K.transpose() * S * K, K.transpose() * Z * K
        return prove_generalized_margin(integer_rows(S), integer_rows(Z), guess)


def rounded_diagonal(log_weights: np.ndarray, bits: int) -> tuple[Fraction, ...]:
    """Return ``exp(log_weights)``, the largest 1, as short dyadic rationals."""
    return tuple(round_to_bits(float(np.exp(x)), bits) for x in log_weights)


def rounded_matrix(P: np.ndarray, bits: int) -> Matrix:
    """Return a symmetric matrix in integers, its largest entry of that many bits; the scale is immaterial."""
    top = float(np.abs(P).max())
    unit = 2.0 ** (bits - np.ceil(np.log2(top)))
    whole = np.rint(np.tril(P) * unit)
    return [[Fraction(int(x)) for x in row] for row in (whole + np.tril(whole, -1).T).tolist()]
