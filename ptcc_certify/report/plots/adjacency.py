"""The matrix of a large signed digraph as a picture: who listens to whom, camp by camp."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.camp_lines import CAMP_STYLES, camp_groups
from ptcc_certify.report.plots.style import EDGE_STYLES, finished

#: Cells of the picture in each direction, and depths of their colours.
CELLS, DEPTHS = 120, 4


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
    n, total = graph.n_nodes, counts.sum(axis=0)
    depth = np.ceil(DEPTHS * np.log1p(total) / np.log1p(max(total.max(initial=0), 1)))
    side = n / cells
    for number, sign in enumerate((1, -1)):
        own = (counts[number] > 0) & (counts[number] >= counts[1 - number])
        for level in range(1, DEPTHS + 1):  # as vectors, for pages that load no images
            row, column = np.nonzero(own & (depth == level))
            corners = np.stack([column, row], axis=1)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
            squares = Path.make_compound_path_from_polys(side * corners)
            cell = {"facecolor": EDGE_STYLES[sign][0], "alpha": 0.4 + 0.6 * level / DEPTHS, "linewidth": 0}
            ax.add_patch(PathPatch(squares, **cell))
    ends = np.cumsum([(group == name).sum() for name in parts])
    margin = 0.04 * n  # for the bars of the camps
    for end in ends[:-1]:
        ax.axhline(end, color="black", linewidth=0.7)
        ax.axvline(end, color="black", linewidth=0.7)
    for name, low, high in zip(parts, [0, *ends[:-1]], ends, strict=True):
        style: dict[str, Any] = {"color": CAMP_STYLES[name][0], "linewidth": 5, "solid_capstyle": "butt"}
        ax.plot([-margin / 2] * 2, [low, high], **style)
        ax.plot([low, high], [-margin / 2] * 2, **style)
        ax.plot([], [], **style, label=f"{name} ({high - low:,})")
    for sign, (colour, _, name) in EDGE_STYLES.items():
        if (graph.sign == sign).any():
            ax.plot([], [], "s", color=colour, markersize=4, label=name)
    ax.set_xlim(-margin, n)
    ax.set_ylim(n, -margin)
    ax.set_aspect("equal")
    ax.grid(False)
    ax.spines[:].set_visible(False)
    finished(ax, f"who is listened to (the {n:,} nodes)", "who listens")
    ax.set_xticks([])
    ax.set_yticks([])
    return ax
