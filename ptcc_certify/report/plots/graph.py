"""The signed digraph: nodes in the colours of their camps, arrows in the direction of information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.adjacency import draw_adjacency
from ptcc_certify.report.plots.agents import CAMP_STYLES, HALO, NAME_SIZE, camp_groups, text_width
from ptcc_certify.report.plots.graph_layout import FREE_NODES, Arrow, arc, arrows_of, places_and_bends, triangles_of
from ptcc_certify.report.plots.style import EDGE_STYLES, SINGLE_COLUMN, axes_of, finished, styled
from ptcc_certify.report.plots.subject import structure_of
from ptcc_certify.report.text_layout import columns, printable, shorten_text

#: Colour of the ground under a leader group, and how far it reaches beyond its nodes, in radii.
GROUND, REACH = "#E2E2E2", 1.5
#: Columns of a label that fit into a node, and that are written beside one.
INSIDE, BESIDE = 3, 15
#: Arrows of which each has its weight written at it.
WEIGHED_ARROWS = 24
#: Where a weight may stand, as shares of its arrow; the first is best.
WEIGHT_SHARES = np.array([0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65, 0.3, 0.7, 0.25, 0.75])
#: Boxes along an arrow of three points each; its own weight keeps off so many at either end.
BOX, NEAR_ENDS = 3, 5
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

    Parameters
    ----------
    subject : Structure, Certificate, Trajectory or graph-like
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
    structure = structure_of(subject)
    graph, own, ax = structure.graph, ax is None, axes_of(ax, (SINGLE_COLUMN[0], _HEIGHT))
    if graph.n_nodes > LABELLED_NODES:
        return draw_adjacency(ax, structure)
    width, height = np.array(ax.get_window_extent().size) / ax.figure.dpi * 72 * [1.05, 0.95]  # points, of own axes
    inside = max(map(columns, graph.labels)) <= INSIDE and graph.n_nodes <= FREE_NODES
    radius = float(np.clip(32 / np.sqrt(graph.n_nodes), 7.5, 10)) if inside else 4.5
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
    _draw_weights(ax, arrows, place, bends, written, lines)
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
            looks: dict[str, Any] = {"color": colour, "markeredgecolor": edge, "markeredgewidth": width, "zorder": 3}
            x, y = place[own].T
            ax.plot(x, y, "o", markersize=2 * radius, **looks)
            ax.plot([], [], "o", markersize=6, label=name, **looks)


def _draw_arrows(ax: Axes, arrows: Sequence[Arrow], place: np.ndarray, bends: np.ndarray, radius: float) -> None:
    """Draw the arrows, wide where the weight is large."""
    largest = max((a.size for a in arrows), default=1.0)
    differ = min((a.size for a in arrows), default=1.0) < largest
    looks: dict[str, Any] = {"shrinkA": radius + 1, "shrinkB": radius + 1, "mutation_scale": 7, "zorder": 2}
    for arrow, bend in zip(arrows, bends, strict=True):
        colour, line, _ = EDGE_STYLES[arrow.sign]
        looks |= {"color": colour, "linestyle": line, "arrowstyle": "<|-|>" if arrow.mutual else "-|>"}
        width = 0.6 + 1.0 * arrow.size / largest if differ else 0.9
        ends = place[arrow.source], place[arrow.target]
        ax.add_artist(FancyArrowPatch(*ends, connectionstyle=f"arc3,rad={bend}", linewidth=width, **looks))
    for sign, (colour, line, name) in EDGE_STYLES.items():
        if any(arrow.sign == sign for arrow in arrows):
            ax.plot([], [], color=colour, linestyle=line, linewidth=1.1, label=name)


def draw_labels(
    ax: Axes, labels: Sequence[str], place: np.ndarray, radius: float, lines: list[np.ndarray] | None
) -> list[np.ndarray]:
    """Write labels into the nodes, or, given lines, around where they cover least; return the boxes that are taken."""
    looks: dict[str, Any] = {"fontsize": NAME_SIZE, "parse_math": False, "ha": "center", "zorder": 5}
    nodes = [np.array([*(p - radius), *(p + radius)]) for p in place]
    if lines is None:
        for label, p in zip(labels, place, strict=True):
            ax.annotate(printable(label), p, color="white", va="center_baseline", **looks)
        return nodes
    taken = nodes + lines
    for label, p in zip(labels, place, strict=True):
        text = shorten_text(printable(label), BESIDE)
        half = np.array([text_width(text) / 2, 0.6 * NAME_SIZE])
        turns = np.arctan2(p[1], p[0]) + np.pi / 4 * np.array([0, 1, -1, 2, -2, 3, -3, 4])  # away from the middle first
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        spots = [p + way * (far * radius + 1) + half * way for far in (1, 2, 3, 4, 5, 6, 7) for way in ways]
        taken.append(box := least_covered(spots, half, taken))
        if (np.maximum(box[:2] - p, p - box[2:]) > 3 * radius).any():  # far from its node
            ax.plot(*np.stack([p, np.clip(p, box[:2], box[2:])], axis=1), color="0.6", linewidth=0.5, zorder=1)
        ax.annotate(text, p, (box[:2] + box[2:]) / 2, va="center", color="black", path_effects=HALO, **looks)
    return nodes + taken[len(nodes) + len(lines) :]


def _draw_weights(
    ax: Axes,
    arrows: Sequence[Arrow],
    place: np.ndarray,
    bends: np.ndarray,
    taken: list[np.ndarray],
    lines: list[list[np.ndarray]],
) -> None:
    """Write the sizes of the weights at their arrows, where no other one crosses, if they differ and there are few."""
    if len({arrow.size for arrow in arrows}) < 2 or len(arrows) > WEIGHED_ARROWS:
        return
    ground = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
    for k, (arrow, bend) in enumerate(zip(arrows, bends, strict=True)):
        text = f"{arrow.size:.3g}"
        half = np.array([text_width(text) / 2, 0.6 * NAME_SIZE]) + 2
        spots = list(arc(place[arrow.source], place[arrow.target], bend, WEIGHT_SHARES))
        along = place[arrow.target] - place[arrow.source]
        beside = along[::-1] * [1, -1] / np.linalg.norm(along) * (np.linalg.norm(half) + 1)
        spots += [spots[0] + beside, spots[0] - beside]
        others = [*lines[:k], lines[k][:NEAR_ENDS], lines[k][-NEAR_ENDS:], *lines[k + 1 :]]
        box = least_covered(spots, half, [*taken, *(box for line in others for box in line)])
        taken.append(box)
        (x, y), colour = (box[:2] + box[2:]) / 2, EDGE_STYLES[arrow.sign][0]
        ax.text(x, y, text, fontsize=NAME_SIZE, color=colour, ha="center", va="center", bbox=ground, zorder=4)


def boxes_along(arrows: Sequence[Arrow], place: np.ndarray, bends: np.ndarray) -> list[list[np.ndarray]]:
    """Return small boxes along each arrow, which leave no gaps."""
    boxes = []
    for (a, b, *_), bend in zip(arrows, bends, strict=True):
        along = np.linspace(0.06, 0.94, 2 + int(np.linalg.norm(place[b] - place[a]) / BOX))
        boxes.append([np.array([*(p - BOX / 2), *(p + BOX / 2)]) for p in arc(place[a], place[b], bend, along)])
    return boxes


def least_covered(spots: Sequence[np.ndarray], half: np.ndarray, taken: list[np.ndarray]) -> np.ndarray:
    """Return the box about the first of some spots that covers least of the boxes taken."""
    boxes = [np.array([*(spot - half), *(spot + half)]) for spot in spots]
    others = np.array(taken)

    def covered(box: np.ndarray) -> float:
        sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
        return float(np.prod(np.maximum(sides, 0), axis=1).sum())

    return min(boxes, key=covered)


def draw_ground(ax: Axes, graph: SignedDigraph, place: np.ndarray, nodes: Sequence[int], radius: float) -> None:
    """Draw a ground under a leader group: under its nodes, along its edges, and between them where no other node is."""
    inside, looks = np.zeros(graph.n_nodes, dtype=bool), {"color": GROUND, "zorder": 0}
    inside[list(nodes)] = True
    own, foreign = inside[graph.source] & inside[graph.target], place[~inside]
    parts = [place[[v, v]] for v in nodes] + list(place[np.stack([graph.source[own], graph.target[own]], axis=1)])
    if (triangles := triangles_of(place[list(nodes)])) is not None:
        free = np.setdiff1d(np.arange(len(triangles.simplices)), triangles.find_simplex(foreign))
        parts += list(triangles.points[triangles.simplices[free]])
    for part in parts:
        width = 2 * REACH * radius
        ax.add_patch(Polygon(part, linewidth=width, joinstyle="round", capstyle="round", **looks))  # type: ignore[arg-type]
