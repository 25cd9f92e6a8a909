"""How far agents of a family are from where they end: never less than some signal shows, and not far above it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm

from ptcc_certify import NominalProtocol
from ptcc_certify.certificate.family_certificate import certify_family
from ptcc_certify.graphs.family import Family

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
CLOCK = np.array([0.0, 0.5, 1.0, 2.0, 4.0])


def deviations(edges: list[tuple[int, int, Fraction, Fraction]], x: list[int], seed: int) -> np.ndarray:
    """Return the largest ``|x_k(s) - x_k(end)|`` at the instants over signals that change at each of them."""
    rng, n, worst = np.random.default_rng(seed), len(x), np.zeros((len(x), CLOCK.size))
    for _ in range(60):
        states, state = [], np.array(x, dtype=float)
        for step in [0.0, *np.diff(CLOCK), 400.0]:
            L = np.zeros((n, n))
            for a, b, *ends in edges:
                weight = float(ends[rng.integers(2)])
                L[b, b] += abs(weight)
                L[b, a] -= weight
            state = expm(-L * step) @ state
            states.append(state)
        worst = np.maximum(worst, np.abs(np.array(states[:-1]) - states[-1]).T)
    return worst


def near(weight: int, of: str = "1/5") -> tuple[Fraction, Fraction]:
    low, high = sorted((weight * (1 - Fraction(of)), weight * (1 + Fraction(of))))
    return low, high


@pytest.mark.parametrize("n", [4, 8])
def test_agents_in_camps_are_no_farther_from_their_value_than_from_each_other(n: int):
    edges = [(k, (k + 1) % n, *near(-1 if k % 2 else 1)) for k in range(n)]
    edges.append((0, 2, *near(-1)))
    x = [3, -1, 4, 1, -5, 9, 2, -6][:n]
    certificate = certify_family(Family.from_intervals(edges), PROTOCOL, x)
    assert certificate.behaviours == ("bipartite consensus",)
    bound, seen = certificate.deviation_at(CLOCK), deviations(edges, x, n)
    assert (seen <= bound * (1 + 1e-9)).all()
    assert np.median(bound / seen) < 20


def test_followers_of_a_large_component_are_no_farther_either():
    edges = [(0, 1, *near(1)), (1, 2, *near(2)), (2, 0, *near(1))]
    edges += [(k // 2, k, *near(1 if k % 3 else -1)) for k in range(3, 130)]
    x = [(7 * k * k + 3 * k) % 11 - 5 for k in range(130)]
    certificate = certify_family(Family.from_intervals(edges), PROTOCOL, x)
    assert certificate.behaviours == ("bipartite consensus",) and certificate.rate > 0
    assert (deviations(edges, x, 0) <= certificate.deviation_at(CLOCK) * (1 + 1e-9)).all()
