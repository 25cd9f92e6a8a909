"""Matrix polynomials on intervals and exponentials of small matrices, against other exact methods and balls."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise
from math import comb

import flint
import numpy as np
import pytest

from lmi.exact.matrix_exponential import LARGEST_NORM, expm
from lmi.exact.matrix_polynomial_sign import bernstein, nonnegative_between, semidefinite
from lmi.exact.work import WorkError, limited
from ptcc_certify.checker.common_motion import rest_integral

F = Fraction


def by_minors(S: list[list[int]]) -> bool:
    """A symmetric matrix is semidefinite iff no principal minor is negative."""
    n = len(S)
    chosen = (rows for size in range(1, n + 1) for rows in combinations(range(n), size))
    return all(flint.fmpz_mat([[S[i][j] for j in rows] for i in rows]).det() >= 0 for rows in chosen)


@pytest.mark.parametrize("seed", range(40))
def test_a_matrix_is_semidefinite_iff_no_principal_minor_is_negative(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    half = rng.integers(-3, 4, (n, int(rng.integers(1, n + 1))))
    S = half @ half.T - (seed % 3 == 0) * np.diag(rng.integers(0, 2, n))
    for k in np.flatnonzero(rng.integers(0, 4, n) == 0):
        S[k, :] = S[:, k] = 0
    rows = S.tolist()
    assert semidefinite(rows) is by_minors(rows)


def test_a_pivot_that_is_0_needs_a_row_that_is_0():
    assert semidefinite([[0, 0], [0, 0]]) and not semidefinite([[1, 2, 0], [2, 4, 1], [0, 1, 9]])
    assert not semidefinite([[1, 2], [1, 4]])  # not symmetric


@pytest.mark.parametrize("seed", range(10))
def test_bernstein_coefficients_are_those_of_the_polynomial(seed: int):
    """``F(low + (high - low) t) = sum_i C(m, i) t^i (1 - t)^(m - i) B_i``, up to one positive factor."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    coefficients = rng.integers(-9, 10, (m + 1, n, n)).tolist()
    low = F(int(rng.integers(-5, 5)), 7)
    high = low + F(int(rng.integers(1, 9)), 4)
    B = bernstein(coefficients, low, high)
    ratios = set()
    for t in (F(0), F(1), F(1, 3), F(5, 8)):
        x = low + (high - low) * t
        for i in range(n):
            for j in range(n):
                value = sum(F[i][j] * x**k for k, F in enumerate(coefficients))
                mean = sum(comb(m, k) * t**k * (1 - t) ** (m - k) * part[i][j] for k, part in enumerate(B))
                assert (mean == 0) == (value == 0)
                ratios |= {mean / value} if value else set()
    assert len(ratios) == 1 and min(ratios) > 0


def test_halving_proves_what_is_positive_and_nothing_proves_what_is_not():
    touching = [[[1]], [[-2]], [[1]]]  # (1 - x)^2 + 1/100, and (1 - x)^2 - 1/100
    above, below = ([[[100 * touching[0][0][0] + d]], [[-200]], [[100]]] for d in (1, -1))
    assert not nonnegative_between(above, F(0), F(2))
    pieces = [F(2) * j / 64 for j in range(65)]
    assert all(nonnegative_between(above, low, high) for low, high in pairwise(pieces))
    assert not all(nonnegative_between(below, low, high) for low, high in pairwise(pieces))


@pytest.mark.parametrize("seed", range(12))
def test_exponentials_of_matrices_are_enclosed(seed: int):
    rng = np.random.default_rng(seed)
    n, size = int(rng.integers(1, 9)), float(rng.choice([0.01, 1, 10, 60]))
    A = [[F(float(x)) for x in row] for row in rng.uniform(-size, size, (n, n))]
    middle, radius = expm(A)
    assert radius <= F(1, 2**96)
    before, flint.ctx.prec = flint.ctx.prec, 3000
    try:
        true = flint.arb_mat([[flint.fmpq(x.numerator, x.denominator) for x in row] for row in A]).exp()
        for i, row in enumerate(middle):
            for j, x in enumerate(row):
                off = abs(true[i, j] - flint.arb(flint.fmpq(x.numerator, x.denominator)))
                assert off < flint.arb(flint.fmpq(radius.numerator, radius.denominator))
    finally:
        flint.ctx.prec = before


def test_exponentials_of_large_matrices_are_refused():
    with pytest.raises(OverflowError):
        expm([[F(LARGEST_NORM + 1)]])
    with limited(1e-6), pytest.raises(WorkError):
        expm([[F(1, 3)] * 8] * 8)


@pytest.mark.parametrize("w", [F(0), F(1, 10**9), F(-1, 10**9), F(1), F(-7, 3), F(40), F(-40), F(999), F(-999)])
@pytest.mark.parametrize("p", [F(0), F(1, 10**6), F(1), F(7, 2), F(10**6)])
def test_the_integral_of_agents_that_come_to_rest_is_enclosed(w: Fraction, p: Fraction):
    """``int_0^1 e^(-w (1 - q)) q^p dq``, by Kummer's function in balls."""
    low, high = rest_integral(p, w)
    before, flint.ctx.prec = flint.ctx.prec, 2500
    try:
        one, two, x = (flint.arb(flint.fmpq(y.numerator, y.denominator)) for y in (p + 1, p + 2, w))
        true = (-x).exp() * x.hypgeom_1f1(one, two) / one
        below, above = (flint.arb(flint.fmpq(y.numerator, y.denominator)) for y in (low, high))
        assert true.rad() < 2.0**-100 and not below > true and not true > above
        assert high - low <= F(1, 2**90)
    finally:
        flint.ctx.prec = before
