"""Enclosures of elementary functions and exact definiteness, against ball arithmetic and elimination."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest
from balls import ball
from hypothesis import given, settings
from hypothesis import strategies as st

from lmi.exact import enclosure
from lmi.exact.definite import BITS, Factor, Flint, Standard, arithmetic
from ptcc_certify.protocols import SlidingModeProtocol
from ptcc_certify.protocols.reaching_time import inverse_decay_integral


@pytest.fixture(autouse=True)
def precision():
    before, flint.ctx.prec = flint.ctx.prec, 400
    yield
    flint.ctx.prec = before


def positive(digits: int = 40) -> st.SearchStrategy[Fraction]:
    number = st.integers(1, 10**12)
    return st.builds(lambda p, q, e: Fraction(p, q) * Fraction(10) ** e, number, number, st.integers(-digits, digits))


def holds(ends: tuple[Fraction, Fraction], value: flint.arb, bits: int = 90) -> None:
    """The ends enclose a value, and are apart by 2^-bits of its size at most."""
    below, above = ends
    assert below <= above
    assert not ball(below) > value  # balls of 400 bits, whose own radius is far below the gap
    assert not ball(above) < value
    assert above - below <= Fraction(1, 2**bits) * max(abs(below), abs(above))


@given(x=st.fractions(-5000, 5000, max_denominator=10**9), bits=st.sampled_from([64, 96, 200]))
@settings(max_examples=200, deadline=None)
def test_exponentials_are_enclosed(x: Fraction, bits: int):
    holds(enclosure.exp(x, bits), ball(x).exp(), bits - 2)


@given(x=positive())
@settings(max_examples=200, deadline=None)
def test_square_roots_are_enclosed(x: Fraction):
    below, above = enclosure.sqrt(x)
    assert below**2 <= x <= above**2
    assert above - below <= above / 2**90


@given(x=positive())
@settings(max_examples=200, deadline=None)
def test_logarithms_are_enclosed(x: Fraction):
    below, above = enclosure.log(x)
    value = ball(x).log()
    assert not ball(below) > value and not ball(above) < value
    assert above - below <= Fraction(1, 2**90) * max(abs(above), abs(below), Fraction(1))


@given(x=positive(20), y=st.fractions(-30, 30, max_denominator=1000))
@settings(max_examples=200, deadline=None)
def test_powers_are_enclosed(x: Fraction, y: Fraction):
    holds(enclosure.power(x, y), ball(x) ** ball(y), 88)


def test_what_has_no_value_is_refused():
    with pytest.raises(ValueError, match="negative"):
        enclosure.sqrt(Fraction(-1))
    with pytest.raises(ValueError, match="not positive"):
        enclosure.log(Fraction(0))
    with pytest.raises(OverflowError):
        enclosure.exp(Fraction(10**6))


@given(
    T_r=st.fractions(Fraction(1, 100), 20, max_denominator=100),
    mu2=st.fractions(Fraction(1, 1000), 10, max_denominator=1000),
    kappa=st.fractions(Fraction(1, 10), 6, max_denominator=10),
    mu3=st.fractions(Fraction(1, 10), 6, max_denominator=10),
    z=st.one_of(st.fractions(0, 60, max_denominator=10**6), positive(8).map(lambda x: min(x, Fraction(10**5)))),
)
@settings(max_examples=40, deadline=None)
def test_the_reaching_integral_is_bounded_from_below_and_hardly(
    T_r: Fraction, mu2: Fraction, kappa: Fraction, mu3: Fraction, z: Fraction
):
    """The power series of the checker against the incomplete gamma functions of ball arithmetic."""
    gains = {"rho1": 1, "rho2": 1, "mu1": 2, "delta": 1}
    protocol = SlidingModeProtocol(T_r=T_r, T_s=1, kappa=kappa, mu2=mu2, mu3=mu3, **gains)  # type: ignore[arg-type]
    below = enclosure.decay_integral_below(T_r, mu2, mu3 * kappa, z)
    value = inverse_decay_integral(protocol, z)
    if value.is_finite() and value.rel_accuracy_bits() > 120:
        assert ball(below) <= value
        if (mu3 * kappa - 1) * z < 20_000:  # beyond, the way is cut
            assert ball(below) >= value * (1 - flint.arb(2) ** -60)


# ---------------------------------------------------------------------- definiteness


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
@settings(max_examples=300, deadline=None)
def test_both_arithmetics_decide_as_the_minors_do(S: list[list[int]]):
    for judge in (Standard(), Flint()):
        assert judge.definite(S) == minors(S)


@given(S=symmetric(), seed=st.integers(0, 1000))
@settings(max_examples=150, deadline=None)
def test_forms_are_bounded_up_to_their_best_constant(S: list[list[int]], seed: int):
    """``(d'x)^2 <= c x'S x`` holds from ``c = d' S^-1 d`` on."""
    n = len(S)
    d = np.random.default_rng(seed).integers(-5, 6, n).tolist()
    for judge in (Standard(), Flint()):
        if not minors(S):
            assert judge.bounded(S, [(d, 10**9)]) == 0
            continue
        best = flint.fmpz_mat([d]) * flint.fmpz_mat(S).solve(flint.fmpz_mat([[x] for x in d]))
        p, q = 10**9 * int(best[0, 0].p), 10**9 * int(best[0, 0].q)
        wide = [q * x for x in d]
        assert judge.bounded(S, [(wide, q * (p + 1))]) is None
        assert not any(d) or judge.bounded(S, [(wide, q * (p - 1))]) == 0


def test_a_margin_of_a_part_in_a_billion_is_told_from_none():
    rng = np.random.default_rng(0)
    for n in (5, 40, 90):
        R = [[int(x) for x in row] for row in rng.integers(-99, 100, (n, n - 1))]
        S = [[10**9 * sum(a * b for a, b in zip(x, y, strict=True)) for y in R] for x in R]
        for judge in (Standard(), Flint()):
            assert not judge.definite(S)  # singular
            raised = [[x + (i == j) for j, x in enumerate(row)] for i, row in enumerate(S)]
            assert judge.definite(raised)
            lowered = [[x - (i == j) for j, x in enumerate(row)] for i, row in enumerate(S)]
            assert not judge.definite(lowered)


def test_large_matrices_by_numpy_and_without():
    rng = np.random.default_rng(1)
    R = rng.integers(-9, 10, (170, 170))
    S = [[int(x) for x in row] for row in (R @ R.T + np.eye(170, dtype=int))]
    assert Flint().definite(S) and Standard().definite(S)
    S[3][3] = 0
    assert not Flint().definite(S) and not Standard().definite(S)


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
