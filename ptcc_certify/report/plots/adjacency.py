"""The matrix of a large signed digraph as a picture: who listens to whom, camp by camp."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.agents import CAMP_STYLES, camp_groups
from ptcc_certify.report.plots.style import EDGE_STYLES, finished

#: Cells of the picture in each direction.
CELLS = 150


def draw_adjacency(ax: Axes, structure: Structure) -> Axes:
    """Draw ``W`` as cells, each with the edges of some listeners from some sources, those of a camp next to each other.

    The colour of a cell is that of allies or opponents, whichever are more; it is the deeper, the more edges there are.
    """
    graph, group = structure.graph, camp_groups(structure)
    parts = [name for name in CAMP_STYLES if (group == name).any()]
    component = np.zeros(graph.n_nodes, dtype=int)
    for number, closed in enumerate(structure.closed_components):
        component[list(closed.nodes)] = number
    order = np.lexsort((component, np.array([parts.index(name) for name in group])))
    rank = np.empty(graph.n_nodes, dtype=int)
    rank[order] = np.arange(graph.n_nodes)
    cells = min(CELLS, graph.n_nodes)
    place = rank * cells // graph.n_nodes
    counts = np.zeros((2, cells, cells))
    np.add.at(counts, ((graph.sign < 0).astype(int), place[graph.target], place[graph.source]), 1)
    image, total = np.ones((cells, cells, 3)), counts.sum(axis=0)
    depth = 0.35 + 0.65 * np.log1p(total) / np.log1p(max(total.max(initial=0), 1))
    for number, sign in enumerate((1, -1)):
        own = (counts[number] > 0) & (counts[number] >= counts[1 - number])
        image[own] = 1 - depth[own][:, None] * (1 - np.array(to_rgb(EDGE_STYLES[sign][0])))
    n = graph.n_nodes
    ax.imshow(image, extent=(0, n, n, 0), interpolation="nearest")
    ends = np.cumsum([(group == name).sum() for name in parts])
    for end in ends[:-1]:
        ax.axhline(end, color="black", linewidth=0.7)
        ax.axvline(end, color="black", linewidth=0.7)
    for name, low, high in zip(parts, [0, *ends[:-1]], ends, strict=True):
        ax.plot([0, 0], [low, high], color=CAMP_STYLES[name][0], linewidth=5, solid_capstyle="butt", clip_on=False)
        ax.plot([low, high], [0, 0], color=CAMP_STYLES[name][0], linewidth=5, solid_capstyle="butt", clip_on=False)
        ax.plot([], [], color=CAMP_STYLES[name][0], linewidth=5, label=f"{name} ({high - low:,})")
    for sign, (colour, _, name) in EDGE_STYLES.items():
        if (graph.sign == sign).any():
            ax.plot([], [], "s", color=colour, markersize=4, label=name)
    ax.set_xlim(0, n)
    ax.set_ylim(n, 0)
    ax.grid(False)
    finished(ax, f"who is listened to (the {n:,} nodes)", "who listens")
    ax.set_xticks([])
    ax.set_yticks([])
    return ax
