"""Blocks and products of the matrices of the theorems: of the search in floats, of the proofs in rationals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from lmi.dyadic import round_to_bits
from ptcc_certify.lyapunov.function import Matrix

if TYPE_CHECKING:
    import flint

#: Significant bits to which the search's floats are rounded before anything is proved about them.
BITS = 40


def float_block(L: np.ndarray, rows: Iterable[int], columns: Iterable[int]) -> np.ndarray:
    """Return ``L[rows][:, columns]``, either possibly empty."""
    return L[np.ix_(np.array([*rows], dtype=int), np.array([*columns], dtype=int))]


def floats(values: Iterable[Fraction]) -> np.ndarray:
    """Return rationals as a float64 array."""
    return np.array([float(v) for v in values])


def rounded(values: Iterable[float], bits: int = BITS) -> tuple[Fraction, ...]:
    """Round positive floats to short dyadic rationals."""
    return tuple(round_to_bits(float(v), bits) for v in values)


def exact_block(L: Matrix, rows: Iterable[int], columns: Iterable[int]) -> Matrix:
    """Return ``L[rows][:, columns]``."""
    columns = list(columns)
    return [[L[i][j] for j in columns] for i in rows]


def diagonal_matrix(weights: Iterable[Fraction]) -> Matrix:
    """Return ``diag(weights)``."""
    w = list(weights)
    return [[w[i] if i == j else Fraction(0) for j in range(len(w))] for i in range(len(w))]


def symmetric_product(weights: Iterable[Fraction], A: Matrix) -> Matrix:
    """Return ``Omega A + A' Omega`` with ``Omega = diag(weights)``."""
    w = list(weights)
    n, zero = len(A), Fraction(0)
    return [
        [w[i] * A[i][j] + w[j] * A[j][i] if A[i][j] or A[j][i] else zero for j in range(n)]  # many are
        for i in range(n)
    ]


def multiply(A: Matrix, B: Matrix) -> Matrix:
    """Return ``A B``, formed in integers over common denominators."""
    (left, a), (right, b) = integer_matrix(A), integer_matrix(B)
    return [[Fraction(x, a * b) for x in row] for row in integer_rows(left * right)]


def congruence(A: Matrix, S: Matrix) -> Matrix:
    """Return ``A' S A``."""
    return multiply([list(column) for column in zip(*A, strict=True)], multiply(S, A))


def integer_matrix(M: Sequence[Sequence[Fraction]]) -> tuple[flint.fmpz_mat, int]:
    """Return a rational matrix as integers over its common denominator, and that."""
    import flint

    scale = math.lcm(*{x.denominator for row in M for x in row})
    whole = [[x.numerator * (scale // x.denominator) for x in row] for row in M]
    return flint.fmpz_mat(len(M), len(M[0]) if M else 0, [x for row in whole for x in row]), scale


def integer_rows(M: flint.fmpz_mat) -> list[list[int]]:
    """Return the rows of an integer matrix."""
    return [[int(x) for x in row] for row in M.tolist()]


def without_last(S: Matrix) -> Matrix:
    """Delete the last row and column: the quadratic form modulo a kernel vector whose last entry is not zero."""
    return [row[:-1] for row in S[:-1]]
