"""Where the nodes of a drawn graph lie, and how its arrows bend around those that are not their ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import networkx as nx
import numpy as np
from scipy.spatial import Delaunay, QhullError

#: Bends of an arrow that are tried, as shares of its length; two arrows of opposite directions need a large one.
BENDS, OPPOSITE_BENDS = (0.0, 0.12, -0.12, 0.22, -0.22, 0.4, -0.4, 0.6, -0.6), (0.22, 0.32, 0.45, 0.6)
#: Points on an arrow at which its distance from nodes is measured, as shares of its length.
ALONG = np.linspace(0.06, 0.94, 23)
#: Layouts by springs that are tried; nodes of which more lie on a circle, around which there is room for labels.
SPRINGS, FREE_NODES = 5, 20


class Arrow(NamedTuple):
    """An edge of a drawing, or two opposite ones of the same weight."""

    source: int
    target: int
    sign: int
    size: float
    mutual: bool


def places_and_bends(
    arrows: Sequence[Arrow], part: np.ndarray, radius: float, size: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return places of the nodes in points, (N, 2), and the bend of every arrow, (M,), the same in every run.

    The first of some layouts in which nodes lie apart, none among those of another ``part``, and every arrow keeps away
    from nodes that are not its ends; if there is none, the one with the fewest exceptions. On a circle nodes of the
    same ``part``, (N,), are neighbours.
    """
    best: tuple[int, np.ndarray, np.ndarray] | None = None
    for points in _layouts(arrows, part):
        low, span = points.min(axis=0), np.ptp(points, axis=0)
        scale = min(np.array(size)[span > 1e-9] / span[span > 1e-9], default=1.0)
        place = (points - low - span / 2) * scale
        bends, exceptions = _bends(arrows, place, 1.35 * radius)
        gaps = np.linalg.norm(place[:, None] - place, axis=-1)
        exceptions += int((gaps[np.triu_indices(len(gaps), 1)] < 2.2 * radius).sum())
        for number in np.unique(part[part >= 0]):
            if (triangles := triangles_of(place[part == number])) is not None:
                exceptions += int((triangles.find_simplex(place[part != number]) >= 0).sum())
        if best is None or exceptions < best[0]:
            best = exceptions, place, bends
        if not exceptions:
            break
    assert best is not None
    return best[1], best[2]


def triangles_of(place: np.ndarray) -> Delaunay | None:
    """Return the triangles between places, or None if there are none: fewer than three places, or all on a line."""
    try:
        return Delaunay(place) if len(place) > 2 else None
    except QhullError:
        return None


def arc(start: np.ndarray, end: np.ndarray, bend: float, along: np.ndarray = ALONG) -> np.ndarray:
    """Return points on matplotlib's ``arc3`` from one place to another, at shares of its length."""
    control = (start + end) / 2 + bend * (end - start)[::-1] * [1, -1]
    s = along[:, None]
    return (1 - s) ** 2 * start + 2 * s * (1 - s) * control + s**2 * end


def _bends(arrows: Sequence[Arrow], place: np.ndarray, least: float) -> tuple[np.ndarray, int]:
    """Return the smallest bend of every arrow that keeps it so far from foreign nodes, and how many have none."""
    pairs = {(a.source, a.target) for a in arrows}
    bends = np.zeros(len(arrows))
    without = 0
    for number, (a, b, *_) in enumerate(arrows):
        foreign, clearest = np.delete(place, [a, b], axis=0), -1.0
        for bend in OPPOSITE_BENDS if (b, a) in pairs else BENDS:
            gaps = np.linalg.norm(arc(place[a], place[b], bend)[:, None] - foreign, axis=-1)
            gap = float(gaps.min(initial=least))
            if gap > clearest:
                clearest, bends[number] = gap, bend
            if gap >= least:
                break
        without += clearest < least
    return bends, without


def _layouts(arrows: Sequence[Arrow], part: np.ndarray) -> Iterator[np.ndarray]:
    """Yield layouts: by distances in the graph, then by springs, then on a circle; of many nodes the last alone."""
    n = part.size
    plain = nx.Graph((a.source, a.target) for a in arrows)
    plain.add_nodes_from(range(n))
    hops = dict(nx.all_pairs_shortest_path_length(plain))
    gap = 1 + max(max(row.values()) for row in hops.values())  # between components
    lengths = {u: {v: hops[u].get(v, gap) for v in plain} for u in plain}
    by_distance = nx.kamada_kawai_layout(plain, lengths)
    points = np.array([by_distance[v] for v in range(n)])
    if n <= FREE_NODES:
        yield _lying(points)
        for seed in range(SPRINGS):
            springs = nx.spring_layout(plain, pos=by_distance if seed == 0 else None, seed=seed, k=1.6 / np.sqrt(n))
            yield _lying(np.array([springs[v] for v in range(n)]))
    angle = np.empty(n)
    order = np.lexsort((np.arctan2(*points.T), part))
    places = np.arange(n) + np.searchsorted(np.unique(part), part[order])  # one is empty between parts
    gaps = np.unique(part).size if np.unique(part).size > 1 else 0
    angle[order] = 2 * np.pi * places / (n + gaps)
    yield np.stack([1.15 * np.sin(angle), np.cos(angle)], axis=1)


def _lying(points: np.ndarray) -> np.ndarray:
    """Turn points so that they are widest from left to right, as axes are wider than high."""
    points = points - points.mean(axis=0)
    axes = np.linalg.svd(points, full_matrices=True)[2]
    return np.asarray(points @ (axes * np.where(axes[:, :1] < 0, -1, 1)).T)
