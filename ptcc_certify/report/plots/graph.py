"""The signed digraph: nodes in the colours of their camps, arrows in the direction of information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import networkx as nx
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.size_limits import DRAWN_NODES, KAMADA_NODES, LABELLED_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.style import CAMP_COLOURS, SINGLE_COLUMN, axes_of, camp_groups, finished, styled

#: Colour and line of an edge from an ally (+1) or an opponent (-1).
EDGE_STYLES = {1: ("#4477AA", "-", "ally"), -1: ("#AA3344", "--", "opponent")}
#: Colour and width, in points, of what marks the closed components of a graph.
HALO = ("#DDDDDD", 22)


@styled
def plot_graph(structure: Structure, ax: Axes | None = None) -> Axes:
    """Draw the signed digraph: arrows in the direction of information, solid from allies, dashed from opponents.

    Nodes have the colours of their camps; leaders are larger and outlined, and a grey ground joins each of
    their groups, the closed strong components. Up to 40 nodes are labelled. The layout is the same in every run.

    Parameters
    ----------
    structure : Structure
        Of up to 300 nodes.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The graph has more than 300 nodes.

    Examples
    --------
    >>> ax = plot_graph(analyse(SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1)])))
    >>> len(ax.patches), [text.get_text() for text in ax.texts]
    (3, ['a', 'b', 'c'])
    """
    graph = structure.graph
    n = graph.n_nodes
    if n > DRAWN_NODES:
        raise ValueError(f"graphs are drawn up to {DRAWN_NODES} nodes; this one has {n}")
    ax, place, many = axes_of(ax, (SINGLE_COLUMN[0], 3.4)), _layout(graph), n > LABELLED_NODES
    for component in structure.closed_components if structure.followers.size else ():
        _draw_ground(ax, graph, place, component.nodes)
    if structure.followers.size:
        ax.plot([], [], color=HALO[0], linewidth=6, label="leader group")
    radius = _draw_nodes(ax, structure, place)
    looks: dict[int, dict[str, Any]] = {
        sign: {"color": colour, "linestyle": line, "linewidth": 0.6 if many else 1.1}
        for sign, (colour, line, _) in EDGE_STYLES.items()
    }
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 5 if many else 9, "connectionstyle": "arc3,rad=0.1"}
    for source, target, sign in zip(graph.source.tolist(), graph.target.tolist(), graph.sign.tolist(), strict=True):
        shrunk = {"shrinkA": radius[source], "shrinkB": radius[target]}
        ax.add_artist(FancyArrowPatch(place[source], place[target], zorder=1, **arrow, **shrunk, **looks[sign]))
    for sign, (_, _, name) in EDGE_STYLES.items():
        if (graph.sign == sign).any():
            ax.plot([], [], label=name, **looks[sign])
    if not many:
        _draw_labels(ax, graph.labels, place, radius)
    ax.set_aspect("equal")
    low, high = place.min(axis=0), place.max(axis=0)
    half = 0.62 * np.maximum(high - low, 0.6 * (max(high - low) or 1.0))  # a path is a line, in axes that are none
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    ax.axis((left, right, bottom, top))
    ax.set_axis_off()
    return finished(ax, "", "")


def _draw_nodes(ax: Axes, structure: Structure, place: np.ndarray) -> np.ndarray:
    """Draw the nodes, leaders larger and outlined; return their radii in points."""
    group = camp_groups(structure)
    area = np.where(group != "followers", 1.7, 1.0) * min(max(4000 / group.size, 14), 130)  # points squared
    for name, colour in CAMP_COLOURS.items():
        own = group == name
        if own.any():
            edge, width = (colour, 0.5) if name == "followers" else ("black", 1.1)
            x, y = place[own].T
            ax.scatter(x, y, area[own], colour, edgecolors=edge, linewidths=width, zorder=2)
            ax.plot([], [], "o", color=colour, markeredgecolor=edge, markersize=6, label=name)
    return np.sqrt(area) / 2


def _draw_labels(ax: Axes, labels: Sequence[str], place: np.ndarray, radius: np.ndarray) -> None:
    """Write short labels into the nodes, others above them."""
    inside = max(map(len, labels)) <= 2
    colour, va = ("white", "center_baseline") if inside else ("black", "bottom")
    looks: dict[str, Any] = {"color": colour, "va": va, "ha": "center", "fontsize": 8, "parse_math": False}
    for v, label in enumerate(labels):
        offset = (0, 0 if inside else radius[v] + 2)
        ax.annotate(shorten(label, 12), place[v], offset, textcoords="offset points", **looks)


def _draw_ground(ax: Axes, graph: SignedDigraph, place: np.ndarray, nodes: Sequence[int]) -> None:
    """Draw a grey ground under the nodes of a strong component and along its edges."""
    inside, (colour, width) = np.zeros(graph.n_nodes, dtype=bool), HALO
    inside[list(nodes)] = True
    own = inside[graph.source] & inside[graph.target]
    lines = [(v, v) for v in nodes] + list(zip(graph.source[own].tolist(), graph.target[own].tolist(), strict=True))
    narrow = width if graph.n_nodes <= LABELLED_NODES else width / 2
    for source, target in lines:
        x, y = place[[source, target]].T
        ax.plot(x, y, color=colour, linewidth=narrow, solid_capstyle="round", zorder=0)


def _layout(graph: SignedDigraph) -> np.ndarray:
    """Return places of the nodes, (N, 2), the same in every run."""
    plain = nx.Graph(zip(graph.source.tolist(), graph.target.tolist(), strict=True))
    plain.add_nodes_from(range(graph.n_nodes))
    if graph.n_nodes > KAMADA_NODES:
        place = nx.spring_layout(plain, seed=1)
    else:
        hops = dict(nx.all_pairs_shortest_path_length(plain))
        gap = 2 + max(max(row.values()) for row in hops.values())  # between components
        place = nx.kamada_kawai_layout(plain, {u: {v: hops[u].get(v, gap) for v in plain} for u in plain})
    points = np.array([place[v] for v in range(graph.n_nodes)])
    width, height = np.ptp(points, axis=0)
    return points if width >= height else points[:, ::-1]  # lying, as axes are wider than high
