"""Definitions 2 to 5 on states, as they stand: what a graph's agents do where these are their final states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ptcc_certify.graphs.structure import Structure

States = Sequence[Any]


def is_stability(x: States, structure: Structure, tolerance: float = 0) -> bool:
    return all(abs(v) <= tolerance for v in x)


def is_bipartite_consensus(x: States, structure: Structure, tolerance: float = 0) -> bool:
    sizes = [abs(v) for v in x]
    return min(sizes) > tolerance and max(sizes) - min(sizes) <= tolerance


def is_interval_bipartite_consensus(x: States, structure: Structure, tolerance: float = 0) -> bool:
    leaders = [x[v] for v in structure.leaders]
    within = all(abs(x[v]) <= abs(leaders[0]) + tolerance for v in structure.followers)
    return len(structure.closed_components) == 1 and within and is_bipartite_consensus(leaders, structure, tolerance)


def is_bipartite_containment(x: States, structure: Structure, tolerance: float = 0) -> bool:
    groups = [(c.balanced, [x[v] for v in c.nodes]) for c in structure.closed_components]
    camps = all((is_bipartite_consensus if ok else is_stability)(own, structure, tolerance) for ok, own in groups)
    hull = max(abs(x[v]) for v in structure.leaders)
    return camps and all(abs(x[v]) <= hull + tolerance for v in structure.followers)


DEFINITIONS: dict[str, Callable[..., bool]] = {
    "stability": is_stability,
    "bipartite consensus": is_bipartite_consensus,
    "interval bipartite consensus": is_interval_bipartite_consensus,
    "bipartite containment": is_bipartite_containment,
}
