"""How far opinions lie apart: polarisation, and disagreement with those who are heard."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from ptcc_certify.graphs.io.conversion import as_graph
from ptcc_certify.graphs.io.states import as_state
from ptcc_certify.graphs.stubborn import agent_nodes


def polarisation(graph: Any, x: Any) -> Fraction:
    """Return the variance of the opinions of agents, prejudices of stubborn ones left out.

    Parameters
    ----------
    graph : graph-like
        Whatever :func:`ptcc_certify.as_graph` takes.
    x : state-like
        Whatever :func:`ptcc_certify.as_state` takes, or a final state.

    References
    ----------
    Musco, Musco and Tsourakakis, Minimizing polarization and disagreement in social networks, WWW 2018, who do not
    divide by the number of agents.

    Examples
    --------
    >>> polarisation([("a", "b", 1)], [1, 4])
    Fraction(9, 4)
    """
    graph = as_graph(graph)
    states = as_state(x, graph)
    opinions = [states[k] for k in agent_nodes(graph)]
    mean = sum(opinions, Fraction(0)) / len(opinions)
    return sum(((opinion - mean) ** 2 for opinion in opinions), Fraction(0)) / len(opinions)


def disagreement(graph: Any, x: Any) -> Fraction:
    """Return ``sum |w_kl| (x_l - sgn(w_kl) x_k)^2`` over who listens to whom, prejudices left out.

    Parameters
    ----------
    graph : graph-like
        Whatever :func:`ptcc_certify.as_graph` takes.
    x : state-like
        Whatever :func:`ptcc_certify.as_state` takes, or a final state.

    Examples
    --------
    >>> disagreement([("a", "b", 2)], [1, 4]), disagreement([("a", "b", -2)], [1, 4])
    (Fraction(18, 1), Fraction(50, 1))
    """
    graph = as_graph(graph)
    states, agents, total = as_state(x, graph), {*agent_nodes(graph)}, Fraction(0)
    for edge, (s, t, sign) in enumerate(
        zip(*(e.tolist() for e in (graph.source, graph.target, graph.sign)), strict=True)
    ):
        if s in agents:
            total += abs(graph.exact_weight(edge)) * (states[s] - sign * states[t]) ** 2
    return total
