"""The axis of a figure of inputs, and what bounds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.report.plots.agents import NAME_SIZE

#: An input that grows to so many times its initial size is drawn on a logarithmic axis,
LARGE_GROWTH = 3
#: from so many decades below its initial size on; changes of sign go further down.
INPUT_DECADES = 3
#: A bound is drawn as a line up to so many times the largest input of the run, else named at the top.
HIGH_PEAK = 2.5


class Peak(NamedTuple):
    """A proved bound of inputs, and its name."""

    value: float
    name: str
    color: str = "black"


def draw_peaks(ax: Axes, size: np.ndarray, peaks: Sequence[Peak]) -> None:
    """Set the axis of inputs of these sizes, (N, M), and draw what bounds them, with names; those far above at the top.

    Of two lines the higher one has its name above it, the lower one below.
    """
    largest = np.nan_to_num(size)
    first, top = float(largest[:, :1].max(initial=0)), float(largest.max(initial=0))
    shown = [peak for peak in peaks if peak.value <= HIGH_PEAK * top or top == 0]
    height = max([top, *(peak.value for peak in shown)])
    if first and top > LARGE_GROWTH * first:
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(first * 10.0**-INPUT_DECADES, height * 2)
    else:
        ax.set_ylim(0, 1.12 * height or 1)
    ground = {"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none"}
    style: dict[str, Any] = {"ha": "right", "fontsize": NAME_SIZE, "textcoords": "offset points", "bbox": ground}
    above = 0
    for peak in peaks:
        if peak not in shown:
            place, at = (0, -2 - 1.5 * NAME_SIZE * above), "axes fraction"
            ax.annotate(f"{peak.name}, above", (1, 1), place, xycoords=at, va="top", color=peak.color, **style)
            above += 1
            continue
        ax.axhline(peak.value, color=peak.color, linewidth=0.9, linestyle="--")
        low = any(other.value > peak.value for other in shown)
        ends: dict[str, Any] = {"va": "top" if low else "bottom", "color": peak.color}
        sides = ("axes fraction", "data")
        ax.annotate(peak.name, (1, peak.value), (0, -3 if low else 2), xycoords=sides, **ends, **style)
