"""Enclosures of elementary functions, against ball arithmetic."""

from __future__ import annotations

import decimal
from fractions import Fraction

import flint
import pytest
from balls import ball, inverse_decay_integral
from hypothesis import given, settings
from hypothesis import strategies as st

from lmi.exact import elementary_enclosures as enclosure
from ptcc_certify.model import SlidingModeProtocol


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
@settings(max_examples=80, deadline=None)
def test_exponentials_are_enclosed(x: Fraction, bits: int):
    holds(enclosure.exp(x, bits), ball(x).exp(), bits - 2)


@given(x=positive())
@settings(max_examples=80, deadline=None)
def test_square_roots_are_enclosed(x: Fraction):
    below, above = enclosure.sqrt(x)
    assert below**2 <= x <= above**2
    assert above - below <= above / 2**90


@given(x=positive())
@settings(max_examples=80, deadline=None)
def test_logarithms_are_enclosed(x: Fraction):
    below, above = enclosure.log(x)
    value = ball(x).log()
    assert not ball(below) > value and not ball(above) < value
    assert above - below <= Fraction(1, 2**90) * max(abs(above), abs(below), Fraction(1))


def test_what_a_float_cannot_hold_is_enclosed():
    """Exponentials that only ever get smaller, and arguments that are no float: far off, next to 1, next to 0."""
    below, above = enclosure.exp(Fraction(-(10**30)))
    assert below == 0 and above == enclosure.exp(Fraction(-100_000))[1] > 0
    tiny = Fraction(1, 10**3000)
    below, above = enclosure.log(tiny)
    holds((below, above), ball(tiny).log())
    below, above = enclosure.log(1 + tiny)
    assert below <= tiny / 2 and tiny <= above < Fraction(1, 2**96)
    below, above = enclosure.sqrt(tiny**2)
    assert below <= tiny <= above <= tiny * (1 + Fraction(1, 2**96))
    assert enclosure.log(Fraction(1)) == enclosure.sqrt(Fraction(0)) == (0, 0)


def test_what_others_set_for_decimals_changes_nothing():
    x, before = Fraction(355, 113), decimal.DefaultContext.copy()
    values = [of(x, 77) for of in (enclosure.log, enclosure.sqrt, enclosure.exp)]
    enclosure.exp.cache_clear()
    try:
        for context in (decimal.DefaultContext, decimal.getcontext()):
            context.prec, context.Emin, context.Emax, context.rounding = 3, -1, 1, decimal.ROUND_UP
        assert values == [of(x, 77) for of in (enclosure.log, enclosure.sqrt, enclosure.exp)]
    finally:
        for context in (decimal.DefaultContext, decimal.getcontext()):
            context.prec, context.rounding = before.prec, before.rounding
            context.Emin, context.Emax = before.Emin, before.Emax


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
    below = enclosure.decay_integrals_below(T_r, mu2, mu3 * kappa, [z])[z]
    value = inverse_decay_integral(protocol, z)
    if value.is_finite() and value.rel_accuracy_bits() > 120:
        assert ball(below) <= value
        if (mu3 * kappa - 1) * z < 20_000:  # beyond, the way is cut
            assert ball(below) >= value * (1 - flint.arb(2) ** -60)
