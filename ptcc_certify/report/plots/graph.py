"""Signed digraphs: nodes in the colours of their camps, arrows in the direction of information, modes side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon

from lmi.exact.decimal_rounding import counted
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.io.conversion import as_family, is_family
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.graphs.stubborn import PREJUDICE
from ptcc_certify.report.plots.adjacency import draw_adjacency
from ptcc_certify.report.plots.camp_lines import (
    CAMP_STYLES,
    HALO,
    NAME_SIZE,
    camp_groups,
    family_camps,
    family_groups,
    text_width,
)
from ptcc_certify.report.plots.final_colours import colours_at_end
from ptcc_certify.report.plots.graph_layout import FREE_NODES, Arrow, arc, places_and_bends, triangles_of
from ptcc_certify.report.plots.sizes import SINGLE_COLUMN, current_sizes
from ptcc_certify.report.plots.style import BEHIND, EDGE_STYLES, axes_of, finished, signed, styled
from ptcc_certify.report.plots.subject import is_of_family, structure_of
from ptcc_certify.report.text_layout import columns, printable, shorten_text
from ptcc_certify.theorems.family_behaviour import mode_name

#: Columns of a label that fit into a node, and that are written beside one.
INSIDE, BESIDE = 3, 15
#: Arrows of which each has its weight written at it.
WEIGHED_ARROWS = 24
#: Where a weight may stand, as shares of its arrow; the first is best.
WEIGHT_SHARES = np.array([0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65, 0.3, 0.7, 0.25, 0.75])
#: Boxes along an arrow of three points each; its own weight keeps off so many at either end.
BOX, NEAR_ENDS = 3, 5
#: How far beside a short arrow its weight may stand too, as multiples of the nearest place.
FURTHER = (0.75, -0.75, 1.5, -1.5, 2, -2)
#: Points between two weights.
APART = 6


def draw_labels(
    ax: Axes, labels: Sequence[str], place: np.ndarray, radius: float, lines: list[np.ndarray] | None
) -> list[np.ndarray]:
    """Write labels into the nodes, or, given lines, around where they cover least; return the boxes that are taken."""
    style: dict[str, Any] = {"fontsize": NAME_SIZE, "parse_math": False, "ha": "center", "zorder": 5}
    nodes = [np.array([*(p - radius), *(p + radius)]) for p in place]
    if lines is None:
        for label, p in zip(labels, place, strict=True):
            small = {"fontsize": min(NAME_SIZE, 0.9 * radius)}
            ax.annotate(printable(label), p, color="white", va="center_baseline", **style | small)
        return nodes
    taken = nodes + lines
    for label, p in zip(labels, place, strict=True):
        text = shorten_text(printable(label), BESIDE)
        rows = [text]
        if label.endswith(PREJUDICE):  # in two rows, for it is long
            rows = [shorten_text(printable(label.removesuffix(PREJUDICE)), BESIDE - 2) + "'s", "prejudice"]
        half = np.array([max(map(text_width, rows)) / 2, 0.6 * NAME_SIZE * len(rows)])
        turns = np.arctan2(p[1], p[0]) + np.pi / 4 * np.array([0, 1, -1, 2, -2, 3, -3, 4])  # away from the middle first
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        spots = [p + way * (far * radius + 1) + half * way for far in (1, 2, 3, 4, 5, 6, 7) for way in ways]
        taken.append(box := least_covered(spots, half, taken))
        if (np.maximum(box[:2] - p, p - box[2:]) > 1.6 * radius).any():  # not beside its node
            ax.plot(*np.stack([p, np.clip(p, box[:2], box[2:])], axis=1), color="0.6", linewidth=0.5, zorder=1)
        ax.annotate("\n".join(rows), p, (box[:2] + box[2:]) / 2, va="center", color="black", path_effects=HALO, **style)
    return nodes + taken[len(nodes) + len(lines) :]


def boxes_along(arrows: Sequence[Arrow], place: np.ndarray, bends: np.ndarray) -> list[list[np.ndarray]]:
    """Return small boxes along each arrow, which leave no gaps."""
    boxes = []
    for (a, b, *_), bend in zip(arrows, bends, strict=True):
        along = np.linspace(0.06, 0.94, 2 + int(np.linalg.norm(place[b] - place[a]) / BOX))
        boxes.append([np.array([*(p - BOX / 2), *(p + BOX / 2)]) for p in arc(place[a], place[b], bend, along)])
    return boxes


def draw_sizes(
    ax: Axes,
    arrows: Sequence[Arrow],
    texts: Sequence[str],
    place: np.ndarray,
    bends: np.ndarray,
    taken: list[np.ndarray],
    lines: list[list[np.ndarray]],
) -> None:
    """Write the sizes of weights at their arrows, where no other one crosses, if there are few."""
    if len(arrows) > WEIGHED_ARROWS:
        return
    ground = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
    for k, (arrow, text, bend) in enumerate(zip(arrows, texts, bends, strict=True)):
        half = np.array([text_width(text) / 2, 0.6 * NAME_SIZE]) + 2
        spots = list(arc(place[arrow.source], place[arrow.target], bend, WEIGHT_SHARES))
        along = place[arrow.target] - place[arrow.source]
        length = max(float(np.linalg.norm(along)), 1e-9)
        beside = along[::-1] * [1, -1] / length * (np.linalg.norm(half) + 1)
        spots += [spots[at] + far * beside for far in (1, -1, *FURTHER) for at in (0, 1, 2, 5, 6)]
        others = [*lines[:k], lines[k][:NEAR_ENDS], lines[k][-NEAR_ENDS:], *lines[k + 1 :]]
        box = least_covered(spots, half, [*taken, *(box for line in others for box in line)])
        taken.append(box + APART * np.array([-1, -1, 1, 1]))
        (x, y), colour = (box[:2] + box[2:]) / 2, EDGE_STYLES[arrow.sign][0]
        ax.text(x, y, text, fontsize=NAME_SIZE, color=colour, ha="center", va="center", bbox=ground, zorder=4)


def least_covered(spots: Sequence[np.ndarray], half: np.ndarray, taken: list[np.ndarray]) -> np.ndarray:
    """Return the box about the first of some spots that covers least of the boxes taken."""
    boxes = [np.array([*(spot - half), *(spot + half)]) for spot in spots]
    others = np.array(taken)

    def covered(box: np.ndarray) -> float:
        sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
        return float(np.prod(np.maximum(sides, 0), axis=1).sum())

    return min(boxes, key=covered)


#: Colour of the ground under a leader group, and how far it reaches beyond its nodes, in radii.
GROUND, REACH = "#E2E2E2", 1.5
#: Height of the drawing of one graph in inches.
_HEIGHT = 3.4
#: Modes that are drawn, and nodes of which two modes have room side by side.
PANELS, BESIDE_NODES = 6, 8
#: Height of a panel in inches, as a share of its width; of its name, and of the legend.
_SHAPE, _TITLE, _LEGEND = 0.72, 0.2, 0.72
#: Widths of arrows in points: of the least weight that is drawn, what the largest adds, and where all are equal.
_WIDTHS, _EQUAL = (0.6, 1.0), 0.9
#: How many radii of few nodes a panel is high, at least.
_RADII = 9
#: Columns of a panel's name.
_NAME = 24
#: Marks of nodes that have colours of their own, and their sizes as shares of a circle's; others are circles.
_SHAPES = {"second camp": ("s", 0.9), "unbalanced leaders": ("D", 0.8)}
#: Bends of an arrow that is alone between its ends, and of those that are not.
_ALONE, _APART = 0.12, 0.25


class WeightRange(NamedTuple):
    """An edge of a drawing, or two opposite ones, with the range of its size.

    Attributes
    ----------
    arrow : Arrow
        Its size is the largest.
    least : float
        0 of an edge that may fail.
    late : str
        How late is what is heard over it; empty where that is not told edge by edge.
    """

    arrow: Arrow
    least: float
    late: str = ""

    @property
    def text(self) -> str:
        """The weight, or its range from the least size on."""
        ends = dict.fromkeys(signed(self.arrow.sign * x) for x in (self.least, self.arrow.size))
        return "\N{HORIZONTAL ELLIPSIS}".join(ends)

    @property
    def size(self) -> tuple[float, float]:
        """The range of the size."""
        return self.least, self.arrow.size


@styled
def plot_graph(
    subject: Any,
    *,
    ax: Axes | None = None,
    colours: Sequence[Any] | None = None,
    delays: Mapping[tuple[str, str], Any] | None = None,
) -> Axes:
    """Draw the signed digraph ``(V, E, W)``: an arrow from ``j`` to ``k`` where ``w_kj != 0``, so that ``k`` listens.

    Solid arrows come from allies (``w_kj > 0``), dashed ones from opponents; two opposite ones of the same weight are
    one with two heads. Where ``|w_kj|`` differ, weights are written at up to 24 arrows, and told by widths. Nodes have
    the colours of their camps, of a certificate those of states at ``T``, as at a glance; leaders are outlined, and a
    grey ground lies under each group of several, the closed strong components. The layout is the same in every run.

    Graphs of more than 40 nodes are drawn as their matrix ``W``: row ``k`` holds whom ``k`` listens to, camps and
    followers stand together.

    Of a family up to six modes stand side by side, nodes in the same places. An uncertain weight is a line as wide as
    its least size on a pale band as wide as its largest; an edge that may fail is a dotted line on the band; the range
    stands beside. Nodes have the colours of the camps that all edges keep, or of what they are in every mode; outlined
    are the leaders by mandatory edges.

    Parameters
    ----------
    subject : Structure, Certificate, Trajectory, Family, graph-like or family-like
        As :func:`ptcc_certify.as_graph` or :func:`ptcc_certify.as_family` takes it: a path, a networkx graph, the name
        of a packaged graph.
    ax : Axes, optional
        Several modes are drawn on parts of it.
    colours : sequence of N colours, optional
        Of the nodes, in place of those of their camps: the second camp is then drawn as squares, with its followers
        where all edges keep the camps, unbalanced leaders as diamonds, and the legend tells these alone.
    delays : mapping of (source, target) to number, optional
        How late is what is heard over each edge of one graph, in units of time: written at its arrow in place of the
        weight, which its width tells. By default those of a certificate whose messages have delays of their own.

    Returns
    -------
    Axes

    Examples
    --------
    >>> ax = plot_graph([("a", "b", 1), ("b", "a", 1), ("b", "c", -2)])
    >>> [text.get_text() for text in ax.texts]
    ['a', 'b', 'c', '1', '\u22122']
    >>> ax = plot_graph([("a", "b", 1, 2), ("b", "c", -1, 0)])
    >>> [text.get_text() for text in ax.texts][:3], len(ax.texts)
    (['a', 'b', 'c'], 5)
    """
    if is_of_family(subject) or is_family(subject):
        return _draw_family(as_family(getattr(subject, "family", subject)), ax, colours)
    structure, told = structure_of(subject), ""
    graph = structure.graph
    own_axes = ax is None
    ax = axes_of(ax, (SINGLE_COLUMN[0], _HEIGHT))
    if graph.n_nodes > LABELLED_NODES:
        return draw_adjacency(ax, structure)
    if isinstance(subject, Certificate) and colours is None:
        colours = _colours_of(subject)
        told = "" if colours is None else "colour: state at $T$"
    if isinstance(subject, Certificate) and delays is None:
        delays = delays_of(subject)
    room = np.array(ax.get_window_extent().size) / ax.figure.dpi * 72 * [1.05, 0.95]  # points, of own axes
    component_of = np.full(graph.n_nodes, -1)
    for number, component in enumerate(structure.closed_components):
        component_of[list(component.nodes)] = number
    edges = weight_ranges(Family.from_graph(graph).modes[0], delays, graph.labels)
    layout, bends = _layout(graph.labels, [edge.arrow for edge in edges], component_of, room)
    groups = [c.nodes for c in structure.closed_components if len(c.nodes) > 1 and structure.followers.size]
    for nodes in groups:
        draw_ground(ax, graph, layout.place, nodes, layout.radius)
    if groups and colours is None:
        ax.fill([], [], color=GROUND, label="leader group")
    camps = None if colours is None else family_camps(Family.from_graph(graph))
    groups_of = camp_groups(structure) if camps is None else camps
    boxes = _draw_mode(ax, structure, groups_of, edges, bends, layout, colours=colours)
    finished(ax, "", "", told)
    if own_axes:
        fit_height(ax, boxes, layout.radius)
    return ax


def _colours_of(certificate: Certificate) -> list[str] | None:
    """Return the colours of nodes by where their agents end: where that is not proved of what was asked, in its run."""
    proof = certificate.proof
    run = None
    if proof.limits or proof.late is not None or proof.leaders_move:
        with suppress(SimulationError):
            run = certificate.asked_trajectory
    return colours_at_end(certificate, run)


def _draw_family(family: Family, ax: Axes | None, colours: Sequence[Any] | None) -> Axes:
    """Draw the modes of a family side by side; as matrices where they are large."""
    modes = family.modes[:PANELS]
    side = 2 if len(modes) > 1 and family.n_nodes <= BESIDE_NODES else 1
    rows, title = math.ceil(len(modes) / side), _TITLE if len(modes) > 1 else 0.0
    column = current_sizes().of(SINGLE_COLUMN)[0]
    width = (column if ax is None else ax.get_window_extent().width / ax.figure.dpi) / side
    high = width * _SHAPE
    layout = None
    edges = [weight_ranges(mode) for mode in modes]
    if family.n_nodes <= LABELLED_NODES:
        every = {edge.arrow[:3]: edge.arrow for mode_edges in edges for edge in mode_edges}
        room, component_of = 72 * width * np.array([1.0, _SHAPE]), np.full(family.n_nodes, -1)
        layout, _ = _layout(family.labels, list(every.values()), component_of, room)
        high = layout.size[1] / 72
    else:
        title *= 2  # matrices name their axes
    height = SINGLE_COLUMN[0] / column * (_LEGEND + rows * (high + title))  # which is in inches of the drawing
    ax = axes_of(ax, (SINGLE_COLUMN[0], height))
    ax.set_axis_off()
    panels = [ax]
    if len(modes) > 1:
        share, places = high / (high + title), (divmod(number, side) for number in range(len(modes)))
        panels = [ax.inset_axes((c / side, 1 - (r + 1) / rows, 1 / side, share / rows)) for r, c in places]
    camps, seen = family_camps(family), dict[str, Any]()
    groups = family_groups(family) if camps is None else camps
    for number, (panel, mode, mode_edges) in enumerate(zip(panels, modes, edges, strict=True)):
        if layout is None:
            draw_adjacency(panel, analyse(mode.mandatory))
            if len(panels) > 1 and (legend := panel.get_legend()) is not None:
                legend.remove()
        else:
            every_size = [edge for of_mode in edges for edge in of_mode]
            structure, bends = analyse(mode.mandatory), _bends(mode_edges)
            _draw_mode(panel, structure, groups, mode_edges, bends, layout, every_size, colours)
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            seen.setdefault(label, handle)
        if len(modes) > 1:
            panel.set_title(shorten_text(printable(mode_name(family, number)), _NAME), pad=2, parse_math=False)
    left = len(family.modes) - len(modes)
    style: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "frameon": False, "ncols": 2}
    more = counted(left, "more mode") if left else ""
    ax.legend(seen.values(), seen.keys(), borderaxespad=0.2, title=more, **style)
    return ax


class _Layout(NamedTuple):
    """Where nodes lie in points, how large they are, and whether their labels are in them; the size of a panel."""

    labels: Sequence[str]
    place: np.ndarray
    radius: float
    inside: bool
    size: np.ndarray


def _layout(
    labels: Sequence[str], arrows: Sequence[Arrow], part: np.ndarray, room: np.ndarray
) -> tuple[_Layout, np.ndarray]:
    """Lay out arrows in a room in points, and bend them; a flat drawing takes less height."""
    n, inside = len(labels), max(map(columns, labels)) <= INSIDE
    radius = float(np.clip(32 / np.sqrt(n), 7.5 if n <= FREE_NODES else 6.3, 10)) if inside else 4.5
    if n <= BESIDE_NODES:  # arrows are to be seen on a slide, too
        radius = min(radius, room.min() / _RADII)
    margin = np.array([4 * radius] * 2 if inside else [min(60, 0.45 * room[0]), 30])  # for labels
    place, bends = places_and_bends(arrows, part, radius, tuple(room - margin))
    high = min(room[1], float(np.ptp(place[:, 1])) + margin[1] + 20)  # for bent arrows, and labels
    return _Layout(labels, place, radius, inside, np.array([room[0], high])), bends


def _draw_mode(
    ax: Axes,
    structure: Structure,
    groups: np.ndarray,
    edges: Sequence[WeightRange],
    bends: np.ndarray,
    layout: _Layout,
    among: Sequence[WeightRange] = (),
    colours: Sequence[Any] | None = None,
) -> np.ndarray:
    """Draw nodes, arrows, labels and sizes of one mode ``among`` others; return the boxes of what is drawn."""
    place, radius = layout.place, layout.radius
    if colours is None:
        _draw_nodes(ax, place, radius, groups, structure.leaders, outlined=bool(among))
    else:
        _draw_coloured(ax, place, radius, groups, structure.leaders, colours)
    among = among or edges
    differ, largest = len({edge.size for edge in among}) > 1, max((edge.arrow.size for edge in among), default=1.0)
    late = any(edge.late for edge in edges)
    texts = [edge.late if late else edge.text * differ for edge in edges]
    if late:
        ax.plot(
            [], [], " ", marker="$0.1$", color="black", markersize=12, markeredgewidth=0, label="how late, at its arrow"
        )
    _draw_arrows(ax, edges, place, bends, radius, largest if differ else None)
    arrows = [edge.arrow for edge in edges]
    lines = boxes_along(arrows, place, bends)
    written = draw_labels(
        ax, layout.labels, place, radius, None if layout.inside else [b for line in lines for b in line]
    )
    if any(texts):
        draw_sizes(ax, arrows, texts, place, bends, written, lines)
    ax.set_aspect("equal")
    ax.set_xlim(-layout.size[0] / 2, layout.size[0] / 2)
    ax.set_ylim(-layout.size[1] / 2, layout.size[1] / 2)
    ax.set_axis_off()
    return np.concatenate([written, *lines])


def delays_of(certificate: Certificate) -> Mapping[tuple[str, str], Any] | None:
    """Return how late messages are edge by edge; None where all are as late."""
    messages = certificate.proof.asked_messages
    return messages.delay if messages is not None and isinstance(messages.delay, Mapping) else None


def weight_ranges(
    mode: Mode, delays: Mapping[tuple[str, str], Any] | None = None, labels: Sequence[str] = ()
) -> list[WeightRange]:
    """Return the edges of a mode; two opposite ones of the same range are one with two heads."""
    lower, upper = mode.lower.as_float().tolist(), mode.upper.as_float().tolist()
    keys = list(zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True))
    ranges = dict(zip(keys, zip(lower, upper, strict=True), strict=True))
    result = []
    for (a, b, sign), (least, most) in ranges.items():
        mutual = ranges.get((b, a, sign)) == (least, most)
        if not (mutual and b < a):
            late = [] if delays is None else [delays.get((labels[a], labels[b]))]
            late += [delays.get((labels[b], labels[a]))] if mutual and delays is not None else []
            sizes = dict.fromkeys(f"{float(x):.3g}" for x in late if x)
            told = " / ".join(sizes) or ("0" if delays is not None else "")
            result.append(WeightRange(Arrow(a, b, sign, most, mutual), least, told))
    return result


def _bends(edges: Sequence[WeightRange]) -> np.ndarray:
    """Bend arrows that share their ends apart."""
    count: dict[frozenset[int], int] = {}
    for arrow in (edge.arrow for edge in edges):
        pair = frozenset((arrow.source, arrow.target))
        count[pair] = count.get(pair, 0) + 1
    seen: dict[tuple[int, int], int] = {}
    bends = []
    for arrow in (edge.arrow for edge in edges):
        ends = arrow.source, arrow.target
        alone = count[frozenset(ends)] == 1
        seen[ends] = seen.get(ends, -1) + 1
        bends.append(_ALONE if alone else _APART * (1 + seen[ends]))
    return np.array(bends)


def _draw_nodes(
    ax: Axes, place: np.ndarray, radius: float, groups: np.ndarray, leaders: np.ndarray, *, outlined: bool
) -> None:
    """Draw the nodes, those of leaders outlined, and say so where a camp may hold others."""
    leads = np.isin(np.arange(len(groups)), leaders)
    for name, (colour, _) in CAMP_STYLES.items():
        for lead in (False, True):
            own = (groups == name) & (leads == lead)
            if own.any():
                edge: dict[str, Any] = {"markeredgecolor": "black" if lead else colour, "color": colour, "zorder": 3}
                edge["markeredgewidth"] = 1.2 if lead else 0.5
                ax.plot(*place[own].T, "o", markersize=2 * radius, **edge)
                label = None if outlined and lead and ((groups == name) & ~leads).any() else name
                ax.plot([], [], "o", markersize=6, label=label, **({"color": colour} if outlined else edge))
    if outlined:
        ax.plot([], [], "o", color="white", markersize=6, markeredgecolor="black", markeredgewidth=1.2, label="leads")


def _draw_coloured(
    ax: Axes, place: np.ndarray, radius: float, groups: np.ndarray, leaders: np.ndarray, colours: Sequence[Any]
) -> None:
    """Draw the nodes in colours that are given, in the shapes of their camps, those of leaders outlined."""
    leads = set(leaders.tolist())
    outline: dict[str, Any] = {"markeredgecolor": "black", "markeredgewidth": 1.4}
    for k, (p, colour) in enumerate(zip(place, colours, strict=True)):
        marker, size = _SHAPES.get(groups[k], ("o", 1.0))
        edge = outline if k in leads else {"markeredgewidth": 0}
        ax.plot(*p, marker, markersize=2 * radius * size, color=colour, zorder=3, gid=node_id(k), **edge)
    if leads:
        ax.plot([], [], "o", color="white", markersize=6, label="leads", **outline)
    for name, (marker, _) in _SHAPES.items():
        if (groups == name).any():
            whose = " of leaders" if name == "second camp" and (groups == "followers").any() else ""
            ax.plot([], [], marker, color=BEHIND, markersize=6, label=name + whose)


def _draw_arrows(
    ax: Axes, edges: Sequence[WeightRange], place: np.ndarray, bends: np.ndarray, radius: float, largest: float | None
) -> None:
    """Draw arrows as wide as the least sizes on bands as wide as the largest; all are alike without a largest one."""
    style: dict[str, Any] = {"shrinkA": radius + 1, "shrinkB": radius + 1}
    for (arrow, least, _), bend in zip(edges, bends, strict=True):
        colour, line, _ = EDGE_STYLES[arrow.sign]
        start, end = place[arrow.source], place[arrow.target]
        curve = f"arc3,rad={bend}"
        sizes = [0.0 if largest is None else _WIDTHS[1] * size / largest for size in (least, arrow.size)]
        width, band = (_EQUAL if largest is None else _WIDTHS[0] + size for size in sizes)
        if least < arrow.size:
            pale: dict[str, Any] = {"arrowstyle": "-", "color": colour, "alpha": 0.3, "capstyle": "butt", "zorder": 1}
            ax.add_artist(FancyArrowPatch(start, end, connectionstyle=curve, linewidth=2 + band, **pale, **style))
        drawn: dict[str, Any] = {"mutation_scale": 7, "zorder": 2, "color": colour, "linewidth": width}
        drawn |= {"arrowstyle": "<|-|>" if arrow.mutual else "-|>", "linestyle": line if least else ":"}
        ax.add_artist(FancyArrowPatch(start, end, connectionstyle=curve, **drawn, **style))
    for sign, (colour, line, name) in EDGE_STYLES.items():
        if any(edge.arrow.sign == sign for edge in edges):
            ax.plot([], [], color=colour, linestyle=line, linewidth=1.1, label=name)
    if any(edge.least < edge.arrow.size for edge in edges):
        ranges = sorted({edge.text for edge in edges}, key=len)
        alone = f": {', '.join(ranges)}" if len({edge.size for edge in edges}) == 1 else ""
        ax.plot([], [], color="black", alpha=0.3, linewidth=4, label=f"uncertain weight{alone}")
    if any(not edge.least for edge in edges):
        ax.plot([], [], color="black", linestyle=":", linewidth=1.1, label="may fail")


def node_id(k: int, of: str = "node") -> str:
    """Return what the mark of an agent is known by in a figure, or its ``run``.

    Examples
    --------
    >>> from ptcc_certify.report.plots.graph import node_id
    >>> node_id(3), node_id(3, "run")
    ('node-3', 'run-3')
    """
    return f"{of}-{k}"


def fit_height(ax: Axes, boxes: np.ndarray, radius: float) -> None:
    """Make a figure as high as what is drawn and its legend need."""
    low, high = boxes[:, 1].min() - radius, boxes[:, 3].max() + radius
    figure, legend = ax.figure.figure, ax.get_legend()  # type: ignore[union-attr]
    scale = figure.get_figwidth() / np.ptp(ax.get_xlim())
    room = 0.1 + (0 if legend is None else legend.get_window_extent().height / figure.dpi)
    ax.set_ylim(low, high)
    if current_sizes().shape is None:
        figure.set_figheight(min(figure.get_figheight(), room + scale * (high - low)))


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
