"""The signed digraph: nodes in the colours of their camps, arrows in the direction of information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon

from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.adjacency import draw_adjacency
from ptcc_certify.report.plots.agents import CAMP_STYLES, camp_groups
from ptcc_certify.report.plots.family_graph import plot_family_graph
from ptcc_certify.report.plots.graph_labels import INSIDE, boxes_along, draw_labels, draw_sizes
from ptcc_certify.report.plots.graph_layout import FREE_NODES, Arrow, arrows_of, places_and_bends, triangles_of
from ptcc_certify.report.plots.style import EDGE_STYLES, SINGLE_COLUMN, axes_of, finished, styled
from ptcc_certify.report.plots.subject import structure_of
from ptcc_certify.report.text_layout import columns

#: Colour of the ground under a leader group, and how far it reaches beyond its nodes, in radii.
GROUND, REACH = "#E2E2E2", 1.5
#: Height of the drawing in inches.
_HEIGHT = 3.4


@styled
def plot_graph(subject: Any, *, ax: Axes | None = None) -> Axes:
    """Draw the signed digraph ``(V, E, W)``: an arrow from ``j`` to ``k`` where ``w_kj != 0``, so that ``k`` listens.

    Solid arrows come from allies (``w_kj > 0``), dashed ones from opponents; two opposite ones of the same weight are
    one with two heads. Where weights differ, ``|w_kj|`` is written at up to 24 arrows, and told by widths. Nodes have
    the colours of their camps; leaders are outlined, and a grey ground lies under each group of several, the closed
    strong components. The layout is the same in every run.

    Graphs of more than 40 nodes are drawn as their matrix ``W``: row ``k`` holds whom ``k`` listens to, camps and
    followers stand together.

    Of a family the modes stand side by side, nodes in the same places. An uncertain weight is a line as wide as its
    least size on a pale band as wide as its largest; an edge that may fail is a dotted line on the band.

    Parameters
    ----------
    subject : Structure, Certificate, Trajectory, Family, FamilyCertificate or graph-like
        As :func:`ptcc_certify.as_graph` takes it: a path, a networkx graph, the name of a packaged graph.
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> ax = plot_graph([("a", "b", 1), ("b", "a", 1), ("b", "c", -2)])
    >>> [text.get_text() for text in ax.texts]
    ['a', 'b', 'c', '1', '2']
    """
    if isinstance(subject, Family | FamilyCertificate):
        return plot_family_graph(subject, ax=ax)
    structure = structure_of(subject)
    graph, own, ax = structure.graph, ax is None, axes_of(ax, (SINGLE_COLUMN[0], _HEIGHT))
    if graph.n_nodes > LABELLED_NODES:
        return draw_adjacency(ax, structure)
    width, height = np.array(ax.get_window_extent().size) / ax.figure.dpi * 72 * [1.05, 0.95]  # points, of own axes
    inside = max(map(columns, graph.labels)) <= INSIDE
    radius = float(np.clip(32 / np.sqrt(graph.n_nodes), 7.5 if graph.n_nodes <= FREE_NODES else 6.3, 10))
    radius = radius if inside else 4.5
    part = np.full(graph.n_nodes, -1)
    for number, component in enumerate(structure.closed_components):
        part[list(component.nodes)] = number
    margin = 4 * radius if inside else 60  # for labels
    arrows = arrows_of(graph)
    place, bends = places_and_bends(arrows, part, radius, (width - margin, height - 4 * radius))
    if structure.followers.size:
        groups = [c.nodes for c in structure.closed_components if len(c.nodes) > 1]
        for nodes in groups:
            draw_ground(ax, graph, place, nodes, radius)
        if groups:
            ax.fill([], [], color=GROUND, label="leader group")
    draw_nodes(ax, structure, place, radius)
    _draw_arrows(ax, arrows, place, bends, radius)
    lines = boxes_along(arrows, place, bends)
    written = draw_labels(ax, graph.labels, place, radius, None if inside else [box for line in lines for box in line])
    sizes = [f"{arrow.size:.3g}" for arrow in arrows]
    if len(set(sizes)) > 1:
        draw_sizes(ax, arrows, sizes, place, bends, written, lines)
    ax.set_aspect("equal")
    ax.set_xlim(-width / 2, width / 2)
    ax.set_ylim(-height / 2, height / 2)
    ax.set_axis_off()
    finished(ax, "", "")
    if own:
        fit_height(ax, np.concatenate([written, *lines]), radius)
    return ax


def fit_height(ax: Axes, boxes: np.ndarray, radius: float) -> None:
    """Make a figure as high as what is drawn and its legend need."""
    low, high = boxes[:, 1].min() - radius, boxes[:, 3].max() + radius
    figure, legend = ax.figure.figure, ax.get_legend()  # type: ignore[union-attr]
    scale = figure.get_figwidth() / np.ptp(ax.get_xlim())
    room = 0.1 + (0 if legend is None else legend.get_window_extent().height / figure.dpi)
    ax.set_ylim(low, high)
    figure.set_figheight(min(_HEIGHT, room + scale * (high - low)))


def draw_nodes(ax: Axes, structure: Structure, place: np.ndarray, radius: float) -> None:
    """Draw the nodes, those of leaders outlined."""
    group = camp_groups(structure)
    for name, (colour, _) in CAMP_STYLES.items():
        own = group == name
        if own.any():
            edge, width = (colour, 0.5) if name == "followers" else ("black", 1.2)
            style: dict[str, Any] = {"color": colour, "markeredgecolor": edge, "markeredgewidth": width, "zorder": 3}
            x, y = place[own].T
            ax.plot(x, y, "o", markersize=2 * radius, **style)
            ax.plot([], [], "o", markersize=6, label=name, **style)


def _draw_arrows(ax: Axes, arrows: Sequence[Arrow], place: np.ndarray, bends: np.ndarray, radius: float) -> None:
    """Draw the arrows, wide where the weight is large."""
    largest = max((a.size for a in arrows), default=1.0)
    differ = min((a.size for a in arrows), default=1.0) < largest
    style: dict[str, Any] = {"shrinkA": radius + 1, "shrinkB": radius + 1, "mutation_scale": 7, "zorder": 2}
    for arrow, bend in zip(arrows, bends, strict=True):
        colour, line, _ = EDGE_STYLES[arrow.sign]
        style |= {"color": colour, "linestyle": line, "arrowstyle": "<|-|>" if arrow.mutual else "-|>"}
        width = 0.6 + 1.0 * arrow.size / largest if differ else 0.9
        ends = place[arrow.source], place[arrow.target]
        ax.add_artist(FancyArrowPatch(*ends, connectionstyle=f"arc3,rad={bend}", linewidth=width, **style))
    for sign, (colour, line, name) in EDGE_STYLES.items():
        if any(arrow.sign == sign for arrow in arrows):
            ax.plot([], [], color=colour, linestyle=line, linewidth=1.1, label=name)


def draw_ground(ax: Axes, graph: SignedDigraph, place: np.ndarray, nodes: Sequence[int], radius: float) -> None:
    """Draw a ground under a leader group: its nodes, its edges and what is between them, but under no other node."""
    inside, style = np.zeros(graph.n_nodes, dtype=bool), {"color": GROUND, "zorder": 0}
    inside[list(nodes)] = True
    own, foreign = inside[graph.source] & inside[graph.target], place[~inside]
    parts = [place[[v, v]] for v in nodes] + list(place[np.stack([graph.source[own], graph.target[own]], axis=1)])
    if (triangles := triangles_of(place[list(nodes)])) is not None:
        free = np.setdiff1d(np.arange(len(triangles.simplices)), triangles.find_simplex(foreign))
        parts += list(triangles.points[triangles.simplices[free]])
    along = np.linspace(0, 1, 41)[:, None, None]
    for part in parts:
        rim = (1 - along) * part + along * np.roll(part, 1, axis=0)
        gap = np.linalg.norm(rim.reshape(-1, 1, 2) - foreign, axis=-1).min(initial=np.inf)
        width = 2 * min(REACH * radius, gap - radius)  # under no node that is not of the group
        if width > 0:
            ax.add_patch(Polygon(part, linewidth=width, joinstyle="round", capstyle="round", **style))  # type: ignore[arg-type]
