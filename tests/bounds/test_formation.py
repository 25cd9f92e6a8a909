"""Biases of relative positions: those that fit are formations, the others drift as fast as is told."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from generators import all_classes, random_graph
from scipy.linalg import expm

from ptcc_certify.bounds.final_state import influence
from ptcc_certify.bounds.formation import formation_of_biases
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.protocols import NominalProtocol
from ptcc_certify.protocols.agents import Agents

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
    part = certify(graph, protocol, [1, 3, 0], agents=Agents(order=2, biases=[1, -1, 5]), method="perron").agents
    assert part is not None and part.final_state is not None
    ends = [chain[0][0] for (chain,) in part.final_state]
    assert ends == [Fraction(5, 2), Fraction(3, 2), Fraction(5, 2)]  # c = 5 - a
    with pytest.raises(ParameterError, match="leader group a, b by 1/2 per unit of the clock"):
        certify(graph, protocol, [1, 3, 0], agents=Agents(order=2, biases=[1, 0, 5]))
    with pytest.raises(ParameterError, match="give offsets"):
        Agents(plant=[1, 0], biases=[1, -1, 5])
