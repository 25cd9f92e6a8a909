"""Definiteness and bounds of forms, by both arithmetics, against minors; the dense factor entry by entry."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest
from exact_cases import FAST, PLAIN
from hypothesis import given, settings
from hypothesis import strategies as st

from lmi.exact import arithmetic
from lmi.exact.definite import BITS, Factor


def minors(S: list[list[int]]) -> bool:
    """Sylvester: all leading principal minors are positive."""
    return all(flint.fmpz_mat([row[:k] for row in S[:k]]).det() > 0 for k in range(1, len(S) + 1))


@st.composite
def symmetric(draw: st.DrawFn) -> list[list[int]]:
    """Gram matrices of full or lower rank, some with an entry off by a little, rows of very different size."""
    n = draw(st.integers(1, 8))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    R = rng.integers(-9, 10, (n, n if draw(st.booleans()) else max(n - 1, 1)))
    scale = [10 ** int(k) for k in rng.integers(0, draw(st.sampled_from([1, 30])), n)]
    G = (R @ R.T).tolist()
    S = [[int(G[i][j]) * scale[i] * scale[j] for j in range(n)] for i in range(n)]
    S[0][0] += draw(st.sampled_from([-1, 0, 1]))
    return S


@given(S=symmetric())
@settings(max_examples=100, deadline=None)
def test_both_arithmetics_decide_as_the_minors_do(S: list[list[int]]):
    for judge in (PLAIN, FAST):
        assert judge.definite(S) == minors(S)


@given(S=symmetric(), seed=st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_forms_are_bounded_up_to_their_best_constant(S: list[list[int]], seed: int):
    """``(d'x)^2 <= c x'S x`` holds from ``c = d' S^-1 d`` on."""
    n = len(S)
    d = np.random.default_rng(seed).integers(-5, 6, n).tolist()
    for judge in (PLAIN, FAST):
        if not minors(S):
            assert judge.bounded(S, [(d, 10**9)]) == 0
            continue
        best = flint.fmpz_mat([d]) * flint.fmpz_mat(S).solve(flint.fmpz_mat([[x] for x in d]))
        p, q = 10**9 * int(best[0, 0].p), 10**9 * int(best[0, 0].q)
        wide = [q * x for x in d]
        assert judge.bounded(S, [(wide, q * (p + 1))]) is None
        assert not any(d) or judge.bounded(S, [(wide, q * (p - 1))]) == 0


@pytest.mark.few(0)
def test_a_margin_of_a_part_in_a_billion_is_told_from_none():
    rng = np.random.default_rng(0)
    for n, judges in ((5, (PLAIN, FAST)), (24, (PLAIN, FAST)), (60, (FAST,))):
        R = [[int(x) for x in row] for row in rng.integers(-99, 100, (n, n - 1))]
        S = [[10**9 * sum(a * b for a, b in zip(x, y, strict=True)) for y in R] for x in R]
        for judge in judges:
            assert not judge.definite(S)  # singular
            raised = [[x + (i == j) for j, x in enumerate(row)] for i, row in enumerate(S)]
            assert judge.definite(raised)
            lowered = [[x - (i == j) for j, x in enumerate(row)] for i, row in enumerate(S)]
            assert not judge.definite(lowered)


def test_large_matrices_by_numpy_and_without():
    rng = np.random.default_rng(1)
    R = rng.integers(-9, 10, (170, 170))
    S = [[int(x) for x in row] for row in (R @ R.T + np.eye(170, dtype=int))]
    assert FAST.definite(S) and PLAIN.definite(S)
    S[3][3] = 0
    assert not FAST.definite(S) and not PLAIN.definite(S)


def test_a_factor_says_what_it_is():
    """``D S D - R R'`` has a positive diagonal that dominates, entry by entry in rationals."""
    rng = np.random.default_rng(2)
    G = rng.integers(-9, 10, (12, 12))
    S = [[int(x) for x in row] for row in (G @ G.T + np.eye(12, dtype=int))]
    factor = Factor(S, BITS[0])
    n = len(S)
    R = [[*row, d] + [0] * (n - len(row) - 1) for row, d in zip(factor.rows, factor.diagonal, strict=True)]
    for i in range(n):
        scales = [Fraction(2) ** (factor.shifts[i] + shift) for shift in factor.shifts]
        E = [S[i][j] * scales[j] - sum(a * b for a, b in zip(R[i], R[j], strict=True)) for j in range(n)]
        assert E[i] > sum(abs(x) for j, x in enumerate(E) if j != i)


def test_the_arithmetic_is_chosen():
    assert arithmetic(stdlib=True).name == "standard library"
    assert "python-flint" in arithmetic().name
