"""Proofs in exact arithmetic that a symmetric rational matrix is positive definite.

Nothing here trusts a float: floats only suggest what to prove.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from numbers import Rational
from typing import Any

import numpy as np

from lmi.errors import MatrixError

Rows = Sequence[Sequence[Fraction]]
#: Above this many rows a rounded Cholesky factor is tried before the elimination.
RESIDUAL_ROWS = 20
#: Above this many rows a looser rate by the residual test is preferred to the elimination.
ELIMINATION_ROWS = 60


@dataclass(frozen=True)
class DefinitenessProof:
    """Outcome of :func:`prove_positive_definite`.

    Attributes
    ----------
    proved : bool
        True: the matrix is positive definite. False: it is not (the elimination is exact, so this is a refutation).
    size : int
        Number of rows.
    failed_at : int or None
        First row whose leading principal minor is not positive.
    """

    proved: bool
    size: int
    failed_at: int | None = None

    def __bool__(self) -> bool:
        return self.proved


def prove_positive_definite(S: Rows) -> DefinitenessProof:
    """Decide exactly whether a symmetric rational matrix is positive definite.

    ``S`` is scaled to integers. Larger matrices are first compared with a rounded Cholesky factor: if ``S - R R'``,
    formed in integers, has a positive, strictly dominant diagonal, then ``S > 0``. Otherwise ``S`` is reduced to
    ``L D L'`` by fraction-free symmetric elimination; ``S > 0`` iff every pivot, a leading principal minor, is positive
    (Sylvester).

    Parameters
    ----------
    S : n rows of n Fractions or ints
        The matrix of size 0 counts as positive definite.

    Returns
    -------
    DefinitenessProof

    Raises
    ------
    MatrixError
        ``S`` is not square, not exactly symmetric, or has an entry that is not a finite real number.

    References
    ----------
    Bareiss, Sylvester's identity and multistep integer-preserving Gaussian elimination, Math. Comp. 22 (1968).

    Examples
    --------
    >>> prove_positive_definite([[Fraction(2), Fraction(1)], [Fraction(1), Fraction(1, 2)]])
    DefinitenessProof(proved=False, size=2, failed_at=1)
    >>> bool(prove_positive_definite([[2, 1], [1, 1]]))
    True
    """
    rows = _scaled_lower_triangle(_rationals(S))
    n = len(rows)
    if n > RESIDUAL_ROWS and _residual_test(rows):
        return DefinitenessProof(True, n)
    previous = 1
    for k in range(n):
        pivot = rows[k][k]
        if pivot <= 0:
            return DefinitenessProof(False, n, k)
        column = [rows[i][k] for i in range(k + 1, n)]
        for i in range(k + 1, n):
            row, head = rows[i], column[i - k - 1]
            if head:
                for j in range(k + 1, i + 1):
                    row[j] = (row[j] * pivot - head * column[j - k - 1]) // previous
            elif pivot != previous:
                for j in range(k + 1, i + 1):
                    if row[j]:
                        row[j] = row[j] * pivot // previous
        previous = pivot
    return DefinitenessProof(True, n)


def _rationals(S: Rows) -> list[list[Fraction]]:
    """Return ``S`` in Fractions (a float is the dyadic number that it is), or refuse it."""
    n = len(S)
    if any(len(row) != n for row in S):
        raise MatrixError("the matrix is not square")
    try:
        rows = [[x if type(x) is Fraction else _rational(x) for x in row] for row in S]
    except (TypeError, ValueError, OverflowError):
        raise MatrixError("the matrix has an entry that is not a finite real number") from None
    if any(rows[i][j] != rows[j][i] for i in range(n) for j in range(i)):
        raise MatrixError("the matrix is not symmetric")
    return rows


def _rational(x: Any) -> Fraction:
    if isinstance(x, Rational):
        return Fraction(int(x.numerator), int(x.denominator))
    return Fraction(float(x))


def _residual_test(rows: list[list[int]]) -> bool:
    """Tell whether ``S = R R' + E`` with ``E`` strictly diagonally dominant, ``R`` a rounded float factor.

    ``rows`` is the lower triangle in integers. False says nothing about ``S``.
    """
    n = len(rows)
    top = max(abs(x) for row in rows for x in row)
    down = max(top.bit_length() - 900, 0)
    lower = np.array([[float(x >> down) for x in row] + [0.0] * (n - len(row)) for row in rows])
    floats = lower + np.tril(lower, -1).T
    size = np.sqrt(np.abs(np.diag(floats)))
    if not (size > 0).all():
        return False
    unit = floats / np.outer(size, size)
    shift = 8 * n * np.finfo(float).eps * float(np.abs(unit).sum(axis=1).max())
    try:
        factor = np.linalg.cholesky(unit - shift * np.eye(n)) * size[:, None]
    except np.linalg.LinAlgError:
        return False
    bits = 62  # R is kept to 2^-bits of its largest entry
    exponent = math.frexp(float(np.abs(factor).max()))[1]
    R = np.array([[int(math.ldexp(x, bits - exponent)) for x in row] for row in factor], dtype=object)
    product = R @ R.T  # Python integers: exact
    # S 2^(2 (bits - exponent)) / 2^down in the same unit, as S times a power of two
    power = 2 * (bits - exponent) - down
    up, back = max(power, 0), max(-power, 0)
    for i in range(n):
        residual = [(rows[max(i, j)][min(i, j)] << up) - (int(product[i, j]) << back) for j in range(n)]
        if residual[i] <= sum(abs(x) for j, x in enumerate(residual) if j != i):
            return False
    return True


def _scaled_lower_triangle(S: Rows) -> list[list[int]]:
    """Return the lower triangle of ``D S D`` in integers, ``D`` a diagonal of powers of two.

    Scaling rows and columns alike keeps definiteness and keeps entries of very different size short.
    """
    n = len(S)
    shift = [0] * n
    for i in range(n):
        size = abs(S[i][i])
        if size:
            shift[i] = (size.denominator.bit_length() - size.numerator.bit_length()) // 2
    scaled = [[S[i][j] * Fraction(2) ** (shift[i] + shift[j]) for j in range(i + 1)] for i in range(n)]
    scale = math.lcm(*(value.denominator for row in scaled for value in row))
    return [[value.numerator * (scale // value.denominator) for value in row] for row in scaled]


def prove_margin(S: Rows, guess: float) -> Fraction | None:
    """Find a rational ``m > 0``, as near to ``guess`` as proves, with ``S - m I`` positive definite.

    Parameters
    ----------
    S : n rows of n Fractions
        Symmetric.
    guess : float
        What floating point takes for the smallest eigenvalue.

    Returns
    -------
    Fraction or None
        A proved lower bound of the smallest eigenvalue of ``S``; None if none was found above ``guess / 2``.

    Examples
    --------
    >>> m = prove_margin([[Fraction(2), Fraction(0)], [Fraction(0), Fraction(3)]], 2.0)
    >>> m < 2, float(m) > 2 - 1e-9
    (True, True)
    """
    if not guess > 0:
        return None
    identity = [[Fraction(int(i == j)) for j in range(len(S))] for i in range(len(S))]
    return prove_generalized_margin(S, identity, guess)


def prove_generalized_margin(S: Rows, Z: Rows, guess: float) -> Fraction | None:
    """Find a rational ``b``, as near to ``guess`` as proves, with ``S - b Z`` positive definite.

    Parameters
    ----------
    S, Z : n rows of n Fractions
        Symmetric.
    guess : float
        What floating point takes for the largest such ``b``; not 0.

    Returns
    -------
    Fraction or None
        Of the sign of ``guess``; None if none was found above ``guess - |guess| / 2``.

    Examples
    --------
    >>> b = prove_generalized_margin([[Fraction(6)]], [[Fraction(2)]], 3.0)
    >>> b < 3, float(b) > 3 - 1e-9
    (True, True)
    """
    if not math.isfinite(guess) or guess == 0:
        return None
    n = len(S)

    def lowered(b: Fraction) -> list[list[Fraction]]:
        return [[S[i][j] - b * Z[i][j] for j in range(n)] for i in range(n)]

    candidates = [b for loss in LOSSES if (b := Fraction(guess - abs(guess) * loss)) * Fraction(guess) > 0]
    if n > RESIDUAL_ROWS:
        # Elimination takes seconds to minutes here: it comes last, after all that the residual test can give.
        quick = candidates if n > ELIMINATION_ROWS else candidates[:4]
        for b in quick:
            if _residual_test(_scaled_lower_triangle(_rationals(lowered(b)))):
                return b
    return next((b for b in candidates if prove_positive_definite(lowered(b))), None)


#: Relative amounts by which a float eigenvalue is lowered, one after the other, until the proof succeeds.
LOSSES = (2e-10, 5e-9, 1e-7, 1e-5, 1e-3, 0.1, 0.5)


def round_to_bits(value: float, bits: int) -> Fraction:
    """Round a finite float to the nearest dyadic rational with ``bits`` significant bits.

    Examples
    --------
    >>> round_to_bits(0.1, 4)
    Fraction(13, 128)
    """
    if value == 0:
        return Fraction(0)
    mantissa, exponent = math.frexp(value)
    return Fraction(round(math.ldexp(mantissa, bits))) * Fraction(2) ** (exponent - bits)


def no_diagonal_rate_above(A: Rows, Y: Rows, rate: Fraction) -> bool:
    """Check in rationals that ``Y`` proves: no diagonal ``Omega > 0`` decays faster than ``rate``.

    That is, ``Omega A + A' Omega >= b Omega`` needs ``b <= rate``.

    ``X = Y Y'`` is positive semidefinite; if it is not zero and ``diag(A X) <= (rate/2) diag(X)``, then such an
    ``Omega`` would give ``b sum_i omega_i X_ii <= 2 sum_i omega_i (A X)_ii <= rate sum_i omega_i X_ii``. With
    ``rate = 0``: no diagonal Lyapunov matrix exists.

    Parameters
    ----------
    A : n rows of n Fractions
    Y : n rows of k Fractions
    rate : Fraction

    Returns
    -------
    bool
        False: this ``Y`` proves nothing.

    References
    ----------
    Barker, Berman, Plemmons, Positive diagonal solutions to the Lyapunov equations, Linear Multilinear Algebra 5
    (1978).

    Examples
    --------
    >>> no_diagonal_rate_above([[1, -1], [-1, 1]], [[1], [1]], Fraction(0))
    True
    >>> no_diagonal_rate_above([[1, -1], [-1, 2]], [[1], [1]], Fraction(0))
    False
    """
    n = len(A)
    if n == 0 or len(Y) != n or any(len(row) != n for row in A) or len({len(row) for row in Y}) > 1:
        raise MatrixError("A is not square, is empty, or Y has not as many rows")
    try:
        A, Y = ([[x if type(x) is Fraction else _rational(x) for x in row] for row in M] for M in (A, Y))
        rate = _rational(rate)
    except (TypeError, ValueError, OverflowError):
        raise MatrixError("an entry or the rate is not a finite real number") from None
    a, y = _integers(A), _integers(Y)
    sizes = [sum(x * x for x in row) for row in y[0].tolist()]
    moved = [
        sum(x * z for x, z in zip(image, row, strict=True))
        for image, row in zip((a[0] @ y[0]).tolist(), y[0].tolist(), strict=True)
    ]
    return any(sizes) and all(2 * m <= rate * a[1] * size for m, size in zip(moved, sizes, strict=True))


def _integers(M: Rows) -> tuple[np.ndarray, int]:
    """Return a rational matrix as integers over one denominator."""
    scale = math.lcm(*(x.denominator for row in M for x in row))
    return np.array([[x.numerator * (scale // x.denominator) for x in row] for row in M], dtype=object), scale
