"""Bounds of double integrators of the cascade: the integral of what drives them, its limits, and their input."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ptcc_certify.bounds.agents.cascade import drive_integral, input_from
from ptcc_certify.checker.agent_cascade import input_is_bounded
from ptcc_certify.model.gain import Gain

F = Fraction


def exact_integral(gain: Gain, rate: Fraction, alpha: Fraction, q: float) -> float:
    """``int_0^t e^(-(rate/2)(s(t) - s(r)) - alpha s(r)) dr``, in balls: a lower bound of it."""
    ball = lambda x: flint.acb(flint.fmpq(F(x).numerator, F(x).denominator))  # noqa: E731
    T, rho1, k, b, a = map(ball, (gain.T, gain.rho1, gain.pole, rate / 2, alpha))
    clock = lambda z: rho1 * T * (1 - (-z).exp()) + k * z  # noqa: E731
    z = -ball(q).log()
    field = lambda y, _: T * (-y - b * (clock(z) - clock(y)) - a * clock(y)).exp()  # noqa: E731
    return float(flint.acb.integral(field, flint.acb(0), z).real.lower())


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(x, marks=pytest.mark.campaign) for x in range(3, 24))])
def test_the_integral_is_bounded_from_above_up_to_the_deadline(seed: int):
    rng = np.random.default_rng([5, seed])
    rho1 = F(0) if seed % 3 == 2 else F(int(rng.integers(1, 60)), 10)
    gain = Gain(
        T=F(int(rng.integers(1, 30)), 10), rho1=rho1 or F(1, 10**12), rho2=F(int(rng.integers(1, 60)), 10), kappa=1
    )
    rate, alpha = F(int(rng.integers(1, 80)), 10), F(int(rng.integers(1, 50)), 10)
    if seed % 4 == 0:
        alpha = rate / 2
    if seed % 4 == 1 and rate * gain.pole > 2:
        alpha = rate / 2 - 1 / gain.pole  # the powers of the closed form coincide
    q = np.array([0.9, 0.5, 0.03, 1e-4, 1e-9])
    bounds = drive_integral(gain, rate, alpha, q)
    true = np.array([exact_integral(gain, rate, alpha, x) for x in q])
    assert (bounds >= true).all()
    if rho1 == 0:
        assert np.allclose(bounds, true, rtol=1e-7)


def test_the_input_is_bounded_iff_both_parts_are_and_not_both_at_the_limit():
    k = F(3, 2)
    both = [input_is_bounded(k, rate, alpha) for rate in (4 / k, 4 / k + F(1, 10**9)) for alpha in (1 / k, F(1))]
    assert both == [False, True, True, True]
    assert not input_is_bounded(k, 4 / k - F(1, 10**9), F(100)) and not input_is_bounded(k, F(100), F(2, 3) - F(1, 99))


def largest_input(gain: Gain, alpha: Fraction, pull: Fraction, x: Fraction, v: Fraction) -> float:
    """The largest ``|u|`` of one agent that is drawn to 0, ``e = -pull x``, formed in ``(x, x'/eta)``."""
    T, rho1, k, a, L = map(float, (gain.T, gain.rho1, gain.pole, alpha, pull))

    def at(z: float) -> tuple[float, float]:
        eta = rho1 + k / T * np.exp(z)
        return eta, (1 - rho1 / eta) ** 2 / k

    def field(z: float, y: np.ndarray) -> list[float]:
        eta, theta = at(z)
        speed = T * np.exp(-z) * eta  # ds/dz
        return [speed * y[1], speed * (-(L + a + theta) * y[1] - (a + theta) * L * y[0])]

    begin = [float(x), float(v / gain.first)]
    run = solve_ivp(field, (0, 12), begin, "LSODA", rtol=1e-10, atol=1e-14, dense_output=True)
    places = np.linspace(0, 12, 4000)
    eta, theta = at(places)
    y = run.sol(places)
    return float(np.abs(eta**2 * (-(a + theta) * L * y[0] - (L + a) * y[1])).max())


@pytest.mark.few(0)
@pytest.mark.parametrize("first", [0, pytest.param(40, marks=pytest.mark.campaign)])
def test_the_input_of_one_agent_stays_within_its_bound_and_comes_near(first: int):
    """Its own Lyapunov function: ``V = x^2``, of rate ``2 pull``, ``e^2 = pull^2 V``."""
    ratios = []
    for seed in range(first, first + (40 if first == 0 else 400)):
        rng = np.random.default_rng([6, seed])
        rho1 = F(int(rng.integers(1, 60)), 10) if seed % 2 else F(1, 10**12)
        gain = Gain(T=F(int(rng.integers(1, 30)), 10), rho1=rho1, rho2=F(int(rng.integers(2, 60)), 10), kappa=1)
        pull = 2 / gain.pole * F(int(rng.integers(100, 500)), 100)
        alpha = 1 / gain.pole * F(int(rng.integers(101, 900)), 100)
        x, v = (F(int(n), 100) for n in rng.integers(-500, 501, 2))
        combined = abs(v / gain.first + (alpha + gain.first_theta) * x)
        (bound,) = input_from(gain, alpha, 2 * pull, [pull**2], abs(x), combined, [abs(v)])
        ratios.append(largest_input(gain, alpha, pull, x, v) / float(bound))
    assert max(ratios) <= 1 + 1e-9 and max(ratios) > 0.9 and np.median(ratios) > 0.3, np.quantile(ratios, [0, 0.5, 1])
