"""The matrix for agents of order n: what Bernstein matrices prove holds at every instant, nothing else is proved."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from ptcc_certify.checker.agent_decrease import scaled_matrix
from ptcc_certify.theorems.matrix_for_order_n import ScaledAgent, agent_matrix, prove_decrease, with_gains

SEEDS = [pytest.param(seed, marks=pytest.mark.campaign if seed > 2 else ()) for seed in range(40)]


def drawn(seed: int) -> tuple[ScaledAgent, Fraction]:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    rho1, k, T = (Fraction(int(x), 10) for x in rng.integers(1, 30, 3))
    plant = tuple(Fraction(int(x), 10) for x in rng.integers(-15, 16, n))
    cap = None if rng.random() < 0.5 else Fraction(int(rng.integers(1, 40)))
    return ScaledAgent(plant, (Fraction(0),) * n, rho1, k, rho1 + k / T, cap), Fraction(2 * n) / k


def matrix(agent: ScaledAgent, theta: float, zeta: float) -> np.ndarray:
    """``A_z`` in floats."""
    rows = scaled_matrix(agent.plant, agent.own, Fraction(theta), Fraction(zeta))
    return np.array([[float(x) for x in row] for row in rows])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_decrease_holds_at_every_instant(seed: int):
    agent, rate = drawn(seed)
    proved = agent_matrix(agent, rate, Fraction(1))
    low, high = agent.span or (1 / (agent.cap or 1),) * 2
    W = np.array([[float(x) for x in row] for row in proved.W])
    driven = np.zeros_like(W)
    driven[-1, -1] = 1
    for zeta in np.linspace(float(low), float(high), 50):
        theta = 0.0 if agent.span is None else (1 - float(agent.rho1) * zeta) ** 2 / float(agent.k)
        AW = matrix(agent, theta, zeta) @ W
        values = np.linalg.eigvalsh(driven - float(rate) * W - AW - AW.T)
        assert values[0] >= -1e-12 * max(1.0, values[-1])


@pytest.mark.parametrize(
    ("k", "damping", "R"), [("1/2", 3, "2.1"), ("1/2", 10, 4), (4, "1/2", "2.1"), ("5/2", "2.7", "5.2")]
)
def test_agents_that_slow_down_by_themselves_faster_than_is_asked_have_a_matrix(k: str, damping: str, R: str):
    """Then the least gain is reached at no finite ``W``: the search must stay at a finite one."""
    zero, small = Fraction(0), Fraction(1, 10**6)
    agent = ScaledAgent((zero, zero), (zero, Fraction(damping)), small, Fraction(k), small + Fraction(k), None)
    proved = agent_matrix(agent, Fraction(R) / Fraction(k), Fraction(1))
    assert prove_decrease(agent, proved.W, proved.rate) == proved.points


@pytest.mark.parametrize("seed", range(8))
def test_the_scaled_matrix_is_the_derivative_of_the_scaled_states(seed: int):
    agent, _ = drawn(seed)
    if agent.span is None:
        agent = replace(agent, cap=None)
    n, zeta, step = agent.order, 0.7 * float((agent.span or (0, 1))[1]), 1e-6
    rng = np.random.default_rng(seed)
    xi = rng.normal(size=n)
    A = np.eye(n, k=1)
    A[-1] = [-float(a) for a in agent.plant]
    theta = (1 - float(agent.rho1) * zeta) ** 2 / float(agent.k)
    after = (xi + step * zeta * A @ xi) * (zeta - step * zeta * theta) ** np.arange(n)  # ds = step, dt = zeta ds
    change = (after - xi * zeta ** np.arange(n)) / step
    told = matrix(agent, theta, zeta)
    assert np.allclose(change, told @ (xi * zeta ** np.arange(n)), atol=1e-4 * (1 + np.abs(change).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_higher_rate_than_any_is_not_proved(seed: int):
    agent, rate = drawn(seed)
    W = agent_matrix(agent, rate, Fraction(1)).W
    assert prove_decrease(agent, W, rate) is not None
    assert prove_decrease(agent, W, 3 * rate + 10) is None


def test_gains_are_those_of_the_matrix_exactly():
    rng = np.random.default_rng(3)
    for n in (1, 2, 5):
        R = rng.integers(-9, 10, (n, n))
        W = [[Fraction(int(x)) for x in row] for row in R @ R.T + 99 * np.eye(n, dtype=int)]
        g = [Fraction(int(x), 7) for x in rng.integers(1, 9, n)]
        near = with_gains(W, g)
        assert [sum(a * b for a, b in zip(row, g, strict=True)) for row in near] == [0] * (n - 1) + [1]
        assert all(near[i][j] == near[j][i] for i in range(n) for j in range(n))
