"""Random cases of agents of order n: every class of graphs, with drag, forces of either sign, formations, caps."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from generators import all_classes, random_graph

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, Protocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents

CLASSES = all_classes()
Rows = list[list[Fraction]]


@dataclass(frozen=True)
class AgentCase:
    """A graph, a protocol, agents, their positions, and their velocities and so on."""

    name: str
    graph: SignedDigraph
    protocol: Protocol
    agents: Agents
    x0: Rows
    derivatives: list[Rows]


def _rows(rng: np.random.Generator, n: int, d: int) -> Rows:
    return [[Fraction(int(x), 100) for x in row] for row in rng.integers(-500, 501, (n, d))]


def _plant(rng: np.random.Generator, n: int) -> list[Fraction]:
    """Chains of integrators, drag, unstable agents, or any coefficients."""
    kind, plant = rng.integers(4), [Fraction(0)] * n
    if kind in (1, 2):
        plant[-1] = Fraction(int(rng.integers(1, 20)), 10 if kind == 1 else -10)
    return plant if kind < 3 else [Fraction(int(x), 10) for x in rng.integers(-20, 20, n)]


def agent_case(seed: int, order: int | None = None) -> AgentCase:
    """The case of a seed."""
    rng = np.random.default_rng([21, seed])
    name, keywords = CLASSES[seed % len(CLASSES)]
    graph = random_graph(rng, **{"weights": "decimals", **keywords}).graph
    n = int(rng.choice([2, 3])) if order is None else order
    plant, N, d = _plant(rng, n), graph.n_nodes, int(rng.integers(1, 3))
    draw = rng.random(4)
    rest = Fraction(int(rng.integers(1, 20)), 10) if n == 2 and not plant[0] and draw[0] < 0.2 else None
    cap = Fraction(int(rng.integers(3, 50))) if rest is None and draw[1] < 0.3 else None
    decay = 2 * (n - 1) + Fraction(int(rng.integers(1, 40)), 10) if draw[2] < 0.3 else None
    offsets = _rows(rng, N, d) if draw[3] < 0.4 else None
    tenths = {"rho1": (1, 20), "rho2": (1, 40)}
    gains = {name: Fraction(int(rng.integers(*ends)), 10) for name, ends in tenths.items()} | {"kappa": Fraction(1)}
    T = Fraction(int(rng.integers(5, 30)), 10)
    protocol: Protocol = NominalProtocol(T=T, **gains)
    if rng.random() < 0.2:
        protocol = SlidingModeProtocol(T_r=T / 3, T_s=2 * T / 3, **gains)
    agents = Agents(plant=plant, rest=rest, decay=decay, offsets=offsets, gain_cap=cap)
    return AgentCase(name, graph, protocol, agents, _rows(rng, N, d), [_rows(rng, N, d) for _ in range(n - 1)])
