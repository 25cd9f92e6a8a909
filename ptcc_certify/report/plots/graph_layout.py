"""Where the nodes of a drawn graph lie, and how its arrows bend around those that are not their ends."""

from __future__ import annotations

from collections.abc import Iterator

import networkx as nx
import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph

#: Bends of an arrow that are tried, as shares of its length; two opposite arrows need one.
BENDS = (0.0, 0.12, -0.12, 0.24, -0.24, 0.4, -0.4, 0.6, -0.6)
#: Points on an arrow at which its distance from nodes is measured, as shares of its length.
ALONG = np.linspace(0.06, 0.94, 23)


def places_and_bends(
    graph: SignedDigraph, part: np.ndarray, radius: float, size: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return places of the nodes in points, (N, 2), and the bend of every arrow, (M,), the same in every run.

    The first of some layouts in which nodes lie apart and every arrow keeps away from nodes that are not its ends; if
    there is none, the one with the fewest exceptions. On circles nodes of the same ``part``, (N,), are neighbours.
    """
    best: tuple[int, np.ndarray, np.ndarray] | None = None
    for points in _layouts(graph, part):
        low, span = points.min(axis=0), np.ptp(points, axis=0)
        scale = min((np.array(size) - 2 * radius)[span > 0] / span[span > 0], default=1.0)
        place = (points - low - span / 2) * scale
        bends, crossed = _bends(graph, place, 1.35 * radius)
        gaps = np.linalg.norm(place[:, None] - place, axis=-1)
        crossed += int((gaps[np.triu_indices(len(gaps), 1)] < 2.3 * radius).sum())
        if best is None or crossed < best[0]:
            best = crossed, place, bends
        if not crossed:
            break
    assert best is not None
    return best[1], best[2]


def arc(start: np.ndarray, end: np.ndarray, bend: float | np.ndarray, along: np.ndarray = ALONG) -> np.ndarray:
    """Return points on matplotlib's ``arc3`` from one place to another, at shares of its length."""
    control = (start + end) / 2 + bend * (end - start)[..., ::-1] * [1, -1]
    s = along[:, None]
    return (1 - s) ** 2 * start + 2 * s * (1 - s) * control + s**2 * end


def _bends(graph: SignedDigraph, place: np.ndarray, least: float) -> tuple[np.ndarray, int]:
    """Return the smallest bend of every arrow that keeps it so far from foreign nodes, and how many have none."""
    pairs = list(zip(graph.source.tolist(), graph.target.tolist(), strict=True))
    known, bends, crossed = set(pairs), np.zeros(len(pairs)), 0
    for number, (a, b) in enumerate(pairs):
        foreign = np.delete(place, [a, b], axis=0)
        clearest = -1.0
        for bend in BENDS:
            if bend <= 0 and (b, a) in known:  # opposite arrows bend to their own sides
                continue
            gaps = np.linalg.norm(arc(place[a], place[b], bend)[:, None] - foreign, axis=-1)
            gap = float(gaps.min(initial=np.inf))
            if gap > clearest:
                clearest, bends[number] = min(gap, least), bend
            if gap >= least:
                break
        crossed += clearest < least
    return bends, crossed


def _layouts(graph: SignedDigraph, part: np.ndarray) -> Iterator[np.ndarray]:
    """Yield layouts: by distances in the graph, then by springs, then on a circle."""
    plain = nx.Graph(zip(graph.source.tolist(), graph.target.tolist(), strict=True))
    plain.add_nodes_from(range(graph.n_nodes))
    hops = dict(nx.all_pairs_shortest_path_length(plain))
    gap = 2 + max(max(row.values()) for row in hops.values())  # between components
    lengths = {u: {v: hops[u].get(v, gap) for v in plain} for u in plain}
    by_distance = nx.kamada_kawai_layout(plain, lengths)
    for layout in (by_distance, nx.spring_layout(plain, pos=by_distance, seed=1, k=1.6 / np.sqrt(graph.n_nodes))):
        points = np.array([layout[v] for v in range(graph.n_nodes)])
        width, height = np.ptp(points, axis=0)
        yield points if width >= height else points[:, ::-1]  # lying, as axes are wider than high
    order = np.lexsort((np.arctan2(*np.array([by_distance[v] for v in range(graph.n_nodes)]).T), part))
    angle = np.empty(graph.n_nodes)
    angle[order] = 2 * np.pi * np.arange(graph.n_nodes) / graph.n_nodes
    yield np.stack([1.15 * np.sin(angle), np.cos(angle)], axis=1)
