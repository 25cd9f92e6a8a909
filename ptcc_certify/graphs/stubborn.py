"""Stubborn agents: who does not let go of a prejudice, as in the models of Taylor, and of Friedkin and Johnsen.

A stubborn agent k is drawn to its *prejudice* ``p_k``, too, with weight ``theta_k > 0``:

    e_k = sum_l w_kl (x_l - sgn(w_kl) x_k) + theta_k (p_k - x_k).

That is what it does in the graph with one node more, its prejudice, which hears nobody, rests at ``p_k``, and is heard
by k alone, with weight ``theta_k``: a leader. So whatever is proved of graphs is proved of stubborn agents.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeVar

import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import format_exact

#: What the node of a prejudice is called, after the label of its agent.
PREJUDICE = "'s prejudice"
_T = TypeVar("_T")


def prejudices(graph: SignedDigraph | Family) -> dict[int, int]:
    """Return the nodes that are prejudices, each with its agent: called so, hear nobody, and nobody else hears them.

    Examples
    --------
    >>> prejudices(with_stubborn([("a", "b", 1)], "b=2"))
    {2: 1}
    """
    named = {k: label.removesuffix(PREJUDICE) for k, label in enumerate(graph.labels) if label.endswith(PREJUDICE)}
    if not named:
        return {}
    place = {label: k for k, label in enumerate(graph.labels)}
    found = {node: place[label] for node, label in named.items() if label in place}
    source, target = graph.pairs if isinstance(graph, Family) else (graph.source, graph.target)
    for s, t in zip(source.tolist(), target.tolist(), strict=True):
        found.pop(t, None)
        if found.get(s, t) != t:
            del found[s]
    return found


def completed(entries: Sequence[_T], graph: SignedDigraph, still: _T | None = None) -> Sequence[_T]:
    """Return an entry for every node where those of agents alone are given, in node order.

    Parameters
    ----------
    entries : sequence
    graph : SignedDigraph
    still : optional
        What prejudices have; by default the same as their agents.

    Examples
    --------
    >>> graph = with_stubborn([("a", "b", 1)], "b=2")
    >>> completed([5, 3], graph), completed([5, 3], graph, still=0), completed([5, 3, 4], graph)
    ([5, 3, 3], [5, 3, 0], [5, 3, 4])
    """
    added, agents = prejudices(graph), agent_nodes(graph)
    if not added or len(entries) != len(agents):
        return entries
    of = dict(zip(agents, entries, strict=True))
    return [of[k] if k in of else of[added[k]] if still is None else still for k in range(graph.n_nodes)]


def agent_nodes(graph: SignedDigraph) -> list[int]:
    """Return the nodes that are no prejudices.

    Examples
    --------
    >>> agent_nodes(with_stubborn([("a", "b", 1)], "b=2"))
    [0, 1]
    """
    added = prejudices(graph)
    return [k for k in range(graph.n_nodes) if k not in added]


def stubbornness(graph: SignedDigraph | Family) -> dict[str, tuple[Fraction, Fraction]]:
    """Return how stubborn agents are, from the least to the largest weight of any mode, by their labels.

    Examples
    --------
    >>> stubbornness(with_stubborn([("a", "b", 1)], "b=2"))
    {'b': (Fraction(2, 1), Fraction(2, 1))}
    """
    found: dict[str, tuple[Fraction, Fraction]] = {}
    if not (nodes := prejudices(graph)):
        return found
    family = graph if isinstance(graph, Family) else Family.from_graph(graph)
    for mode in family.modes:
        for edge in np.flatnonzero(np.isin(mode.source, [*nodes])).tolist():
            label, (low, high) = mode.labels[int(mode.target[edge])], mode.edge_interval(edge)
            least, largest = found.get(label, (low, high))
            found[label] = min(low, least), max(high, largest)
    return found


def stubborn_text(weights: Mapping[str, tuple[Fraction, Fraction]]) -> str:
    """Write how stubborn agents are as an option takes it.

    Examples
    --------
    >>> stubborn_text({"a": (Fraction(1, 2), Fraction(1, 2)), "b": (Fraction(1), Fraction(2))})
    'a=1/2,b=1..2'
    """
    told = [
        f"{a}={format_exact(low)}{f'..{format_exact(high)}' if low < high else ''}"
        for a, (low, high) in weights.items()
    ]
    return ",".join(f'"{item}"' if "," in item else item for item in told)
