"""The graphs of a family: the modes side by side, uncertain weights with their range, edges that may fail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch

from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.io import as_family
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.report.plots.adjacency import draw_adjacency
from ptcc_certify.report.plots.agents import CAMP_STYLES, family_groups
from ptcc_certify.report.plots.family import family_camps
from ptcc_certify.report.plots.graph_labels import INSIDE, boxes_along, draw_labels, draw_sizes
from ptcc_certify.report.plots.graph_layout import FREE_NODES, Arrow, places_and_bends
from ptcc_certify.report.plots.style import EDGE_STYLES, SINGLE_COLUMN, axes_of, styled
from ptcc_certify.report.text_layout import columns, printable, shorten_text
from ptcc_certify.theorems.counterexample_text import mode_name

#: Modes that are drawn, and nodes of which two modes have room side by side.
PANELS, BESIDE_NODES = 6, 8
#: Height of a panel in inches, as a share of its width; of its name, and of the legend.
_SHAPE, _TITLE, _LEGEND = 0.72, 0.2, 0.72
#: Widths of arrows in points: of the least weight that is drawn, and what the largest adds.
_WIDTHS = 0.6, 1.6
#: Columns of a panel's name.
_NAME = 24
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
    """

    arrow: Arrow
    least: float

    @property
    def text(self) -> str:
        """The size, or its range."""
        ends = dict.fromkeys(f"{x:.3g}" for x in (self.least, self.arrow.size))
        return "\N{EN DASH}".join(ends)


@styled
def plot_family_graph(subject: Any, *, ax: Axes | None = None) -> Axes:
    """Draw the graphs of a family: its modes side by side, with nodes in the same places.

    Arrows are those of :func:`~ptcc_certify.plot_graph`. An uncertain weight is a line as wide as its least size on a
    pale band as wide as its largest; an edge that may fail is a dotted line on the band; the range stands beside. Nodes
    have the colours of the camps that all edges keep, or of what they are in every mode; outlined are the leaders by
    mandatory edges. Up to six modes are drawn; of more than 40 nodes the mandatory edges, as matrices.

    Parameters
    ----------
    subject : FamilyCertificate, Family or family-like
        As :func:`ptcc_certify.as_family` takes it.
    ax : Axes, optional
        Several modes are drawn on parts of it.

    Returns
    -------
    Axes

    Examples
    --------
    >>> ax = plot_family_graph([("a", "b", 1, 2), ("b", "c", -1, 0)])
    >>> [text.get_text() for text in ax.texts][:3], len(ax.texts)
    (['a', 'b', 'c'], 5)
    """
    family = as_family(getattr(subject, "family", subject))
    modes = family.modes[:PANELS]
    side = 2 if len(modes) > 1 and family.n_nodes <= BESIDE_NODES else 1
    rows, title = math.ceil(len(modes) / side), _TITLE * (len(modes) > 1)
    width = SINGLE_COLUMN[0] / side if ax is None else ax.get_window_extent().width / ax.figure.dpi / side
    room = 72 * width * np.array([1.0, _SHAPE])
    layout = _Layout.of(family, modes, room) if family.n_nodes <= LABELLED_NODES else None
    high = width * _SHAPE if layout is None else layout.size[1] / 72
    title *= 2 if layout is None else 1  # matrices name their axes
    ax = axes_of(ax, (SINGLE_COLUMN[0], _LEGEND + rows * (high + title)))
    ax.set_axis_off()
    panels = [ax]
    if len(modes) > 1:
        share = high / (high + title)
        places = (divmod(number, side) for number in range(len(modes)))
        panels = [ax.inset_axes((c / side, 1 - (r + 1) / rows, 1 / side, share / rows)) for r, c in places]
    _draw_modes(panels, family, modes, layout)
    seen: dict[str, Any] = {}
    for number, panel in enumerate(panels):
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            seen.setdefault(label, handle)
        if len(modes) > 1:
            panel.set_title(shorten_text(printable(mode_name(family, number)), _NAME), pad=2, parse_math=False)
    left = len(family.modes) - len(modes)
    style: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "frameon": False, "ncols": 2}
    more = f"{left:,} more mode{'s' * (left > 1)}" if left else ""
    ax.legend(seen.values(), seen.keys(), borderaxespad=0.2, title=more, **style)
    return ax


class _Layout(NamedTuple):
    """Where nodes lie in points, how large they are, and whether their labels are in them; the size of a panel."""

    place: np.ndarray
    radius: float
    inside: bool
    size: np.ndarray

    @classmethod
    def of(cls, family: Family, modes: Sequence[Mode], room: np.ndarray) -> _Layout:
        """Lay out all edges of the modes that are drawn, in a room in points; a flat drawing takes less height."""
        n = family.n_nodes
        inside = max(map(columns, family.labels)) <= INSIDE and n <= FREE_NODES
        radius = float(np.clip(32 / np.sqrt(n), 7.5, 10)) if inside else 4.5
        pairs = {(a.source, a.target, a.sign): a for mode in modes for a, _ in _ranges(mode)}
        margin = np.array([4 * radius + 4 if inside else 60, 4 * radius + 4])
        place, _ = places_and_bends(list(pairs.values()), np.full(n, -1), radius, room - margin)
        high = min(room[1], float(np.ptp(place[:, 1])) + margin[1] + 16)  # for bent arrows, and labels
        return cls(place, radius, inside, np.array([room[0], high]))


def _draw_modes(panels: Sequence[Axes], family: Family, modes: Sequence[Mode], layout: _Layout | None) -> None:
    """Draw modes with nodes in the same places; as matrices where there is no layout."""
    structures = [analyse(mode.mandatory) for mode in modes]
    if layout is None:
        for panel, structure in zip(panels, structures, strict=True):
            draw_adjacency(panel, structure)
            if len(panels) > 1 and (legend := panel.get_legend()) is not None:
                legend.remove()
        return
    place, radius, inside, size = layout
    camps, edges = family_camps(family), [_ranges(mode) for mode in modes]
    groups = family_groups(family) if camps is None else camps
    largest = max((arrow.size for some in edges for arrow, _ in some), default=1.0)
    differ = len({edge.text for some in edges for edge in some}) > 1
    for panel, structure, some in zip(panels, structures, edges, strict=True):
        _draw_nodes(panel, place, radius, groups, structure.leaders)
        bends = _bends(some)
        _draw_arrows(panel, some, place, bends, radius, largest)
        lines = boxes_along([arrow for arrow, _ in some], place, bends)
        taken = None if inside else [box for line in lines for box in line]
        written = draw_labels(panel, family.labels, place, radius, taken)
        arrows, texts = [arrow for arrow, _ in some], [edge.text for edge in some]
        if differ:
            draw_sizes(panel, arrows, texts, place, bends, written, lines)
        panel.set_aspect("equal")
        panel.set_xlim(-size[0] / 2, size[0] / 2)
        panel.set_ylim(-size[1] / 2, size[1] / 2)
        panel.set_axis_off()


def _ranges(mode: Mode) -> list[WeightRange]:
    """Return the edges of a mode; two opposite ones of the same range are one with two heads."""
    lower, upper = mode.lower.as_float().tolist(), mode.upper.as_float().tolist()
    keys = list(zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True))
    ranges = dict(zip(keys, zip(lower, upper, strict=True), strict=True))
    result = []
    for (a, b, sign), (least, most) in ranges.items():
        mutual = ranges.get((b, a, sign)) == (least, most)
        if not (mutual and b < a):
            result.append(WeightRange(Arrow(a, b, sign, most, mutual), least))
    return result


def _bends(edges: Sequence[WeightRange]) -> np.ndarray:
    """Bend arrows that share their ends apart."""
    count: dict[frozenset[int], int] = {}
    for arrow, _ in edges:
        pair = frozenset((arrow.source, arrow.target))
        count[pair] = count.get(pair, 0) + 1
    seen: dict[tuple[int, int], int] = {}
    bends = []
    for arrow, _ in edges:
        ends = arrow.source, arrow.target
        alone = count[frozenset(ends)] == 1
        seen[ends] = seen.get(ends, -1) + 1
        bends.append(_ALONE if alone else _APART * (1 + seen[ends]))
    return np.array(bends)


def _draw_nodes(ax: Axes, place: np.ndarray, radius: float, groups: np.ndarray, leaders: np.ndarray) -> None:
    leads = np.isin(np.arange(len(groups)), leaders)
    for name, (colour, _) in CAMP_STYLES.items():
        for lead in (False, True):
            own = (groups == name) & (leads == lead)
            if own.any():
                edge: dict[str, Any] = {
                    "markeredgecolor": "black" if lead else colour,
                    "markeredgewidth": 1.2 if lead else 0.5,
                }
                ax.plot(*place[own].T, "o", color=colour, markersize=2 * radius, zorder=3, **edge)
        if (groups == name).any():
            ax.plot([], [], "o", color=colour, markersize=6, label=name)
    ax.plot([], [], "o", color="white", markersize=6, markeredgecolor="black", markeredgewidth=1.2, label="leads")


def _draw_arrows(
    ax: Axes, edges: Sequence[WeightRange], place: np.ndarray, bends: np.ndarray, radius: float, largest: float
) -> None:
    """Draw arrows as wide as the least sizes on bands as wide as the largest."""
    shrink: dict[str, Any] = {"shrinkA": radius + 1, "shrinkB": radius + 1}
    for (arrow, least), bend in zip(edges, bends, strict=True):
        colour, line, _ = EDGE_STYLES[arrow.sign]
        start, end, curve = place[arrow.source], place[arrow.target], f"arc3,rad={bend}"
        widths = [_WIDTHS[0] + _WIDTHS[1] * size / largest for size in (least, arrow.size)]
        if least < arrow.size:
            band: dict[str, Any] = {
                "arrowstyle": "-",
                "color": colour,
                "alpha": 0.3,
                "zorder": 1,
                "linewidth": 2 + widths[1],
            }
            ax.add_artist(FancyArrowPatch(start, end, connectionstyle=curve, capstyle="butt", **band, **shrink))
        style: dict[str, Any] = {
            "arrowstyle": "<|-|>" if arrow.mutual else "-|>",
            "mutation_scale": 7,
            "zorder": 2,
            "color": colour,
        }
        style |= {"linestyle": line if least else ":", "linewidth": widths[0]}
        ax.add_artist(FancyArrowPatch(start, end, connectionstyle=curve, **style, **shrink))
    for sign, (colour, line, name) in EDGE_STYLES.items():
        if any(arrow.sign == sign for arrow, _ in edges):
            ax.plot([], [], color=colour, linestyle=line, linewidth=1.1, label=name)
    uncertain = {edge.text for edge in edges if edge.least < edge.arrow.size}
    if uncertain:
        alone = f": {uncertain.pop()}" if len({edge.text for edge in edges}) == 1 else ""
        ax.plot([], [], color="black", alpha=0.3, linewidth=4, label=f"uncertain weight{alone}")
    if any(not least for _, least in edges):
        ax.plot([], [], color="black", linestyle=":", linewidth=1.1, label="may fail")
