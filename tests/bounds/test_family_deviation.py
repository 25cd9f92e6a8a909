"""How far agents of a family are from where they end: never less than some signal shows, and not far above it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from asked import certify_family
from scipy.linalg import expm

from ptcc_certify import NominalProtocol, SlidingModeProtocol
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.graphs.family import Family

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
CLOCK = np.array([0.0, 0.5, 1.0, 2.0, 4.0])


def deviations(edges: list[tuple[int, int, Fraction, Fraction]], x: list[int], seed: int) -> np.ndarray:
    """Return the largest ``|x_k(s) - x_k(end)|`` at the instants over signals that change at each of them."""
    return deviations_and_speeds(edges, x, seed)[0]


def deviations_and_speeds(
    edges: list[tuple[int, int, Fraction, Fraction]], x: list[int], seed: int, clock: np.ndarray = CLOCK
) -> tuple[np.ndarray, np.ndarray]:
    """Return the same, and the largest ``|(L x)_k|`` there."""
    rng, n, worst = np.random.default_rng(seed), len(x), np.zeros((len(x), clock.size))
    fastest = worst.copy()
    for _ in range(60):
        states, speeds, state = [], [], np.array(x, dtype=float)
        for step in [0.0, *np.diff(clock), 400.0]:
            L = np.zeros((n, n))
            for a, b, *ends in edges:
                weight = float(ends[rng.integers(2)])
                L[b, b] += abs(weight)
                L[b, a] -= weight
            state = expm(-L * step) @ state
            states.append(state)
            speeds.append(L @ state)
        worst = np.maximum(worst, np.abs(np.array(states[:-1]) - states[-1]).T)
        fastest = np.maximum(fastest, np.abs(speeds[:-1]).T)
    return worst, fastest


def near(weight: int, of: str = "1/5") -> tuple[Fraction, Fraction]:
    low, high = sorted((weight * (1 - Fraction(of)), weight * (1 + Fraction(of))))
    return low, high


@pytest.mark.few(0)
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


LED = [(0, 2, *near(2)), (1, 2, *near(-2)), (2, 3, *near(1)), (3, 4, *near(-1)), (4, 3, *near(-2))]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("edges", "behaviour", "most"),
    [
        ([(0, 1, *near(1)), (1, 2, *near(-2)), (2, 3, *near(1)), (0, 3, *near(-1, "0"))], "stability", 20),
        ([(0, 2, Fraction(1), Fraction(1)), (1, 2, Fraction(-1), Fraction(-1)), *LED[2:]], "bipartite containment", 8),
    ],
)
def test_followers_of_single_leaders_are_as_near_as_their_coordinates_are_small(
    edges: list[tuple[int, int, Fraction, Fraction]], behaviour: str, most: float
):
    if behaviour == "stability":
        edges = [*edges, (1, 0, *near(-1)), (3, 0, *near(1))]
    x = [3, -1, 4, 1, -5][: 1 + max(max(edge[:2]) for edge in edges)]
    certificate = certify_family(Family.from_intervals(edges), PROTOCOL, x)
    assert certificate.behaviours == (behaviour,)
    bound, seen = certificate.deviation_at(CLOCK), deviations(edges, x, 1)
    assert (seen <= bound * (1 + 1e-9)).all()
    assert (bound.max(axis=0) / seen.max(axis=0)).max() < most


@pytest.mark.few(0)
def test_pairs_that_lead_are_no_farther_from_their_values_than_from_each_other():
    """Two groups of two leaders, a follower that weighs both, and one that hears it."""
    edges = [(0, 1, *near(1)), (1, 0, *near(2)), (2, 3, *near(-1)), (3, 2, *near(-1))]
    edges += [(0, 4, Fraction(1), Fraction(1)), (2, 4, Fraction(2), Fraction(2)), (4, 5, *near(-2))]
    x = [3, -1, 4, 1, -5, 9]
    certificate = certify_family(Family.from_intervals(edges), PROTOCOL, x)
    assert certificate.behaviours == ("bipartite containment",)
    bound, seen = certificate.deviation_at(CLOCK), deviations(edges, x, 2)
    assert (seen <= bound * (1 + 1e-9)).all()
    assert (bound.max(axis=0) / seen.max(axis=0)).max() < 20


def test_quick_followers_of_slow_agents_are_as_near_as_what_they_hear():
    """The first value of a function of all agents is that of quick ones; late bounds are those of slow ones."""
    known = [(0, 4, 2), (1, 4, 2), (2, 4, -7), (3, 4, -8), (0, 5, 3), (1, 5, 3), (3, 5, -7)]
    edges = [(1, 2, *near(-2)), (2, 1, *near(-1)), *((a, b, Fraction(w), Fraction(w)) for a, b, w in known)]
    edges.append((5, 6, *near(2)))
    x = [2, -1, 5, 3, 5, 0, -3]
    certificate = certify_family(Family.from_intervals(edges), PROTOCOL, x)
    assert certificate.behaviours == ("bipartite containment",) and certificate.checked.accepted
    remaining = np.array([1, 0.5, 0.3, 0.1])
    clock, gain = PROTOCOL.gain.clock_at_remaining(remaining), PROTOCOL.gain.value_at_remaining(remaining)
    deviation, speed = deviations_and_speeds(edges, x, 3, clock)
    for bound, seen, most in (
        (certificate.deviation_bound(remaining), deviation, 12),  # 19 by one rate for all
        (certificate.input_bound(remaining), speed * gain, 60),  # parts that lead have one rate with the others
    ):
        assert (seen <= bound * (1 + 1e-9)).all()
        assert (bound.max(axis=0) / seen.max(axis=0)).max() < most


@pytest.mark.few(0)
@pytest.mark.parametrize("sigma", [[0, 0, 0, 0, 1], [1, -1, 0, 2, 0]])
def test_once_no_sliding_variable_moves_deviations_are_told_by_coordinates(sigma: list[int]):
    edges = [(0, 2, Fraction(1), Fraction(1)), (1, 2, Fraction(-1), Fraction(-1)), *LED[2:]]
    protocol = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, delta=1, mu1=2)
    certificate = certify_family(Family.from_intervals(edges), protocol, [3, -1, 4, 1, -5], sigma0=sigma)
    (part,) = certificate.parts
    early, late = (certificate.deviation_bound([q]) for q in (0.9, 0.1))
    coarse = certificate.changed(parts=(_without_rest(part),))
    assert (early == coarse.deviation_bound([0.9])).all() and (late < coarse.deviation_bound([0.1]))[3:].all()


def _without_rest(part: ComponentProof) -> ComponentProof:
    other = replace(part)
    other.__dict__["rest_states"] = None
    return other
