"""Labels and weights of a drawn graph: where there is room for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.graphs.stubborn import PREJUDICE
from ptcc_certify.report.plots.camp_lines import HALO, NAME_SIZE, text_width
from ptcc_certify.report.plots.graph_layout import Arrow, arc
from ptcc_certify.report.plots.style import EDGE_STYLES
from ptcc_certify.report.text_layout import printable, shorten_text

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
