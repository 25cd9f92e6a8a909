"""Biases of relative positions: those that fit are formations, the others drift as fast as is told."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest
from generators import all_classes, random_graph
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from ptcc_certify.bounds.agents.formation import drift_until_deadline, formation_of_biases
from ptcc_certify.bounds.final_state.of_graph import influence
from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.gain import Gain

CLASSES = all_classes()


@pytest.mark.parametrize(
    "seed", [pytest.param(k, marks=pytest.mark.campaign if k % 4 else ()) for k in range(len(CLASSES))]
)
def test_biases_move_the_agents_as_told(seed: int):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, **{"weights": "decimals", **CLASSES[seed][1]}).graph
    L, N = graph.laplacian().toarray(), graph.n_nodes
    drawn = [Fraction(int(x), 10) for x in rng.integers(-50, 51, N)]
    told = formation_of_biases(graph, drawn)
    # X' = -(L X - b) on the clock: the last column of one exponential
    slowest = min((x.real for x in np.linalg.eigvals(L) if abs(x) > 1e-6 * np.abs(L).max()), default=1.0)
    s, whole = 40.0 / slowest, np.zeros((N + 1, N + 1))
    whole[:N, :N], whole[:N, N] = -L, [float(x) for x in drawn]
    far, farther = (expm(whole * x)[:N, N] for x in (s, 2 * s))
    assert np.allclose((farther - far) / s, [float(x) for (x,) in told.drift], atol=1e-5 * (1 + np.abs(far / s).max()))
    assert (told.offsets is None) == bool(told.groups) == any(x for (x,) in told.drift)
    rest, _ = influence(analyse(graph)).apply(drawn)
    fit = formation_of_biases(graph, [x - Fraction(y) for x, y in zip(drawn, rest, strict=True)])
    assert fit.offsets is not None
    h = [x for (x,) in fit.offsets]
    for v, row in enumerate(graph.exact_rows(range(N))):
        assert sum((a * h[j] for j, a in row.items()), Fraction(0)) == drawn[v] - Fraction(rest[v])
    assert not any(influence(analyse(graph)).apply(h)[0])


def test_a_certificate_takes_biases_that_fit_and_names_who_drifts():
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("a", "c", -1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    part = certify(
        graph, protocol, [1, 3, 0], agents=Agents(order=2, biases=[1, -1, 5]), asks=Asks(method="perron")
    ).agents
    assert part is not None and part.final_state is not None
    ends = [chain[0][0] for (chain,) in part.final_state]
    assert ends == [Fraction(5, 2), Fraction(3, 2), Fraction(5, 2)]  # c = 5 - a
    with pytest.raises(ParameterError, match=r"acceleration of leader group a, b by 1/2 times K_1 g\^2, positions wi"):
        certify(graph, protocol, [1, 3, 0], agents=Agents(order=2, biases=[1, 0, 5]))
    with pytest.raises(ParameterError, match="give offsets"):
        Agents(plant=[1, 0], biases=[1, -1, 5])


RING = SignedDigraph.from_edges(
    [("a", "b", 1), ("b", "a", 1), ("b", "c", -2), ("c", "d", "1.5"), ("d", "c", "0.7"), ("a", "d", -1)]
)


def refusal(gain: dict, **agents) -> str:
    with pytest.raises(ParameterError, match="biases fit no formation") as refused:
        certify(RING, NominalProtocol(**gain), agents=Agents(biases=[1, 0, 0, 0], **agents))
    return str(refused.value)


@pytest.mark.parametrize("cap", ["0.3", "3", "5", "40"])
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize(
    "gain", [{"T": 1, "rho1": 1, "rho2": 1, "kappa": 2}, {"T": 3, "rho1": 2, "rho2": 1, "kappa": 1}]
)
def test_the_drift_under_a_cap_is_what_quadrature_gives(gain: dict, n: int, cap: str):
    low, high = drift_until_deadline(Gain(**gain), Fraction(cap), n)
    T, rho1, k, top = float(gain["T"]), float(gain["rho1"]), float(gain["rho2"] * gain["kappa"]), float(Fraction(cap))

    def fed(w: float) -> float:
        return w ** (n - 1) / math.factorial(n - 1) * min(rho1 + k / w, top) ** n

    turn = min(max(k / (top - rho1), 0), T) if top > rho1 + k / T else T
    value = quad(fed, 0, turn, epsabs=1e-13)[0] + quad(fed, turn, T, epsabs=1e-13, epsrel=1e-13)[0]
    assert low <= high < low + Fraction(1, 10**15) * max(1, high)
    assert math.isclose(value, high, rel_tol=1e-10)


@pytest.mark.parametrize("cap", [None, 5])
@pytest.mark.parametrize("n", [1, 2])
def test_integrators_with_biases_drift_as_the_refusal_says(n: int, cap: int | None):
    # x^(n) = sum_i K_i eta^(n-i+1) (b - L x)^(i-1), b constant; told at T under the cap, else until 0.99 T
    L, K, T = RING.laplacian().toarray(), [1.0] if n == 1 else [12.0, 6.0], 1.0
    b, end = np.array([1.0, 0, 0, 0]), T if cap else 0.99 * T

    def eta(t: float) -> float:
        return min(1 + 2 / max(T - t, 1e-300), cap or math.inf)

    def loop(t: float, z: np.ndarray) -> np.ndarray:
        x = z.reshape(n, 4)
        u = K[0] * eta(t) ** n * (b - L @ x[0])
        u -= K[1] * eta(t) * (L @ x[1]) if n == 2 else 0
        return np.concatenate([*x[1:], u])

    run = solve_ivp(loop, (0, end), np.zeros(4 * n), method="LSODA", rtol=1e-11, atol=1e-12, max_step=0.002).y[:4, -1]
    rate, mean = 0.5, run[:2].mean()
    told = refusal({"T": 1, "rho1": 1, "rho2": 1, "kappa": 2}, order=n, gain_cap=cap)
    assert "leader group a, b by 1/2" in told
    assert ("per unit of the clock" in told) == (n == 1) and ("change the acceleration of" in told) == (n == 2)
    if cap:
        most = float(re.search(r"at most (?:K_1 times )?([\d.]+) until T", told)[1])  # type: ignore[index]
        assert mean <= K[0] * most <= mean * (1 + 1e-5)
    else:
        assert "without bound before T" in told
        way = quad(lambda r: (end - r) ** (n - 1) * eta(r) ** n, 0, end, epsrel=1e-12)[0]
        assert math.isclose(mean, K[0] * rate * way, rel_tol=1e-6)


def test_the_refusal_names_the_derivative_and_its_factor_for_every_order_and_protocol():
    gain = {"T": 1, "rho1": 1, "rho2": 1, "kappa": 2}
    assert "change the jerk of leader group a, b by 1/2 times K_1 g^3, positions without" in refusal(gain, order=3)
    assert "change derivative 5 of leader group a, b by 1/2 times K_1 g^5" in refusal(gain, order=5)
    assert "move leader group a, b by 1/2 times K_1 g, without bound" in refusal(gain, order=1, decay=3)
    assert "a, b by 1/2 times (3 g^2 + g'), positions without" in refusal(gain, order=2, cascade=3)
    damped = refusal(gain, order=2, drag=1, gain_cap=5)  # bounded, by a number that is not told
    assert "without bound" not in damped and "until T" not in damped
