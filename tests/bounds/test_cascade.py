"""Bounds of double integrators of the cascade: the integral of what drives them, its limits, and their input."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest

from ptcc_certify.bounds.cascade import drive_integral, input_constants, input_is_bounded
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.protocols.gain import Gain

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


@pytest.mark.parametrize("seed", range(8))
def test_what_the_relative_positions_ask_for_is_at_most_the_constants(seed: int):
    rng = np.random.default_rng([6, seed])
    edges = [(f"{i}", f"{j}", int(rng.choice([-2, -1, 1, 3]))) for i in range(5) for j in range(5) if i != j]
    graph = SignedDigraph.from_edges([edge for edge in edges if rng.random() < 0.6] or edges)
    k, constants = F(int(rng.integers(1, 30)), 10), [F(int(x), 7) for x in rng.integers(0, 20, graph.n_nodes)]
    most = np.array([float(x) for x in input_constants(analyse(graph), constants, k)])
    L, size = graph.laplacian().toarray(), np.sqrt([float(c) for c in constants])
    for _ in range(200):
        e, theta = size * rng.choice([-1, 1], len(size)), rng.random() / float(k)
        assert (np.abs(theta * e - L @ e) <= most * (1 + 1e-12)).all()
    for v, row in enumerate(L):  # and attained, at theta = 0 or 1/k
        e = -size * np.sign(row) * np.where(np.arange(len(row)) == v, -1, 1)
        attained = [abs(theta * e[v] - row @ e) for theta in (0, 1 / float(k))]
        e[v] = -e[v]
        attained += [abs(theta * e[v] - row @ e) for theta in (0, 1 / float(k))]
        assert max(attained) >= most[v] * (1 - 1e-12)
