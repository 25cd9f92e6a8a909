"""The search for a matrix that forgives late values, beside the inequality with a column for every channel."""

from __future__ import annotations

import numpy as np
import pytest

from lmi.delay import LateSystem, delay_lyapunov
from lmi.errors import NoCertificate


def loop(seed: int, lateness: float, own: bool) -> LateSystem:
    """A complete graph of agents with a leader at rest, which is left out: ``y`` are the agents themselves."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    W = rng.choice([-1, 1], (n, n)) * rng.uniform(0.2, 2, (n, n)) * (1 - np.eye(n))
    K = np.diag(np.abs(W).sum(axis=1) + rng.uniform(0.2, 1, n)) - W
    place, source = np.nonzero(W)
    heard = np.eye(n)[source] - (np.sign(W[place, source])[:, None] * np.eye(n)[place] if own else 0)
    agents, rows = np.unique(place, return_inverse=True)
    h = lateness * rng.uniform(0.3, 1, len(place))
    return LateSystem(K, np.eye(n)[:, agents], K, agents, rows, W[place, source], h, heard, np.zeros((0, len(agents))))


def smallest(system: LateSystem, b: float, P: np.ndarray, tau: np.ndarray) -> float:
    """The least eigenvalue of the inequality with one column for each channel, scaled to a diagonal of ones."""
    W = np.zeros((len(system.K), len(tau)))
    W[system.agents[system.place], np.arange(len(tau))] = system.weights
    C = np.zeros((len(P), len(tau)))
    C[:] = system.C[:, system.place] * system.weights
    Z = system.heard @ np.hstack([system.K, -W])
    c = system.lateness * np.expm1(2 * b * system.lateness) / (2 * b)
    N = np.block([[P @ system.A + system.A.T @ P - 2 * b * P, -P @ C], [-(P @ C).T, np.diag(tau)]])
    N -= Z.T * (tau * c) @ Z
    size = np.sqrt(np.diag(N))
    return float(np.linalg.eigvalsh(N / np.outer(size, size))[0])


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_what_is_found_fulfils_the_inequality_with_a_column_for_every_channel(seed: int, own: bool):
    system = loop(seed, 0.05, own)
    n, b = len(system.K), 0.5 * system.rate
    if not len(system.weights):
        pytest.skip("one agent alone")
    P, tau = delay_lyapunov(system, b, np.ones(n), np.eye(n))
    assert np.linalg.eigvalsh(P - np.eye(n))[0] > -1e-6
    assert smallest(system, b, P, tau) > 0


def test_nothing_late_leaves_the_rate_of_the_system():
    A = np.array([[1.0, 3.0], [0.0, 2.0]])
    none = np.zeros((0, 0))
    system = LateSystem(
        A, np.zeros((2, 0)), A, *(np.zeros(0, dtype=int),) * 2, *(np.zeros(0),) * 2, np.zeros((0, 2)), none
    )
    P, tau = delay_lyapunov(system, 0.99, np.ones(2), np.eye(2))
    assert tau.shape == (0,)
    assert np.linalg.eigvalsh(P @ A + A.T @ P - 1.98 * P)[0] > -1e-9
    with pytest.raises(NoCertificate):
        delay_lyapunov(system, 1.01, np.ones(2), np.eye(2))


def test_no_delay_is_forgiven_that_makes_a_late_own_state_diverge():
    """``y' = -2 y(s - h)``, of a pair of allies, diverges where ``h > pi/4``; with delays that vary, above 3/4."""

    def pair(h: float) -> LateSystem:
        heard = np.array([[-1.0, 1.0], [1.0, -1.0]])
        K, C, ones = np.array([[1.0], [-1.0]]), np.array([[1.0, -1.0]]), np.ones(2)
        return LateSystem(np.array([[2.0]]), C, K, np.arange(2), np.arange(2), ones, h * ones, heard, np.zeros((0, 2)))

    P, _ = delay_lyapunov(pair(0.49), 0.001, np.ones(1), np.eye(1))
    assert P[0, 0] >= 1 - 1e-6
    for h in (0.51, 0.75, np.pi / 4, 2.0):
        with pytest.raises(NoCertificate):
            delay_lyapunov(pair(h), 0.001, np.ones(1), np.eye(1))
