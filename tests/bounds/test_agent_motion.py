"""The common motion of agents of order n, against ball arithmetic."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest

from ptcc_certify.bounds.agents.common_motion import common_motion
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain


def ball(x: Fraction) -> flint.arb:
    return flint.arb(flint.fmpq(x.numerator, x.denominator))


@pytest.mark.parametrize("seed", range(10))
def test_the_free_motion_encloses_the_exponential(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    plant = [Fraction(int(x), 10) for x in rng.integers(-40, 41, n)]
    gain = Gain(T=Fraction(int(rng.integers(1, 30)), 10), rho1=1, rho2=1, kappa=1)
    flint.ctx.prec = 300
    companion = [*([Fraction(j == i + 1) for j in range(n)] for i in range(n - 1)), [-a for a in plant]]
    A = flint.arb_mat([[ball(gain.T * x) for x in row] for row in companion])
    true = A.exp()
    for i, row in enumerate(common_motion(plant, [Fraction(0)] * n, gain)):
        for j, (middle, radius) in enumerate(row):
            assert abs(true[i, j] - ball(middle)) <= ball(radius)
            assert float(radius) <= 1e-20 * (1 + abs(float(middle)))


@pytest.mark.parametrize("seed", range(10))
def test_the_way_of_agents_that_come_to_rest(seed: int):
    rng = np.random.default_rng(seed)
    w, p = Fraction(int(rng.integers(-400, 401)), 10), Fraction(int(rng.integers(1, 60)), 10)
    gain = Gain(T=1, rho1=1, rho2=p, kappa=1)
    (_, (middle, radius)), rest = common_motion([Fraction(0), w - 1], [Fraction(0), Fraction(1)], gain)
    assert rest == ((0, 0), (0, 0))
    flint.ctx.prec = 400
    # e^(-w) 1F1(p + 1, p + 2, w)/(p + 1)
    true = (-ball(w)).exp() * ball(w).hypgeom_1f1(ball(p + 1), ball(p + 2)) / ball(p + 1)
    assert abs(true - ball(middle)) <= ball(radius) and float(radius) < 1e-20 * (1 + float(middle))


def test_a_way_that_is_too_steep_is_refused():
    with pytest.raises(ParameterError, match="smaller rest"):
        common_motion([Fraction(0)] * 2, [Fraction(0), Fraction(101)], Gain(T=1, rho1=1, rho2=1, kappa=1))
