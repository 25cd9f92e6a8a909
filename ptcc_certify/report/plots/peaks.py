"""The axis of a figure of inputs, and what bounds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.report.plots.lines_of_agents import NAME_SIZE

#: An input that grows to so many times its initial size, or is above such a share of its largest for less than such a
#: share of the time, is drawn on a logarithmic axis,
LARGE_GROWTH, LARGE, BRIEF = 3, 1 / 5, 1 / 8
#: from so many decades below its initial size on; changes of sign go further down.
INPUT_DECADES = 3
#: A bound is drawn as a line up to so many times the largest input of the run, else named at the top; on a linear axis,
#: and on a logarithmic one.
HIGH_PEAK, HIGH_PEAK_OF_LOGARITHM = 1.6, 30


class Peak(NamedTuple):
    """A proved bound of inputs, and its name."""

    value: float
    name: str
    color: str = "black"


def draw_peaks(ax: Axes, t: np.ndarray, size: np.ndarray, peaks: Sequence[Peak]) -> None:
    """Set the axis of inputs of these sizes, (N, M), and draw what bounds them, with names; those far above at the top.

    The axis is logarithmic where a linear one would leave most of the time, ``t`` (M,), flat. Of two lines the higher
    one has its name above it, the lower one below.
    """
    largest = np.nan_to_num(size)
    first, top = float(largest[:, :1].max(initial=0)), float(largest.max(initial=0))
    even = np.interp(np.linspace(t[0], t[-1], 401), t, largest.max(axis=0))
    brief = (even > LARGE * top).mean() < BRIEF
    logarithmic = bool(first and (brief or top > LARGE_GROWTH * first))
    most = HIGH_PEAK_OF_LOGARITHM if logarithmic else HIGH_PEAK
    shown = [peak for peak in peaks if peak.value <= most * top or top == 0]
    height = max([top, *(peak.value for peak in shown)])
    if logarithmic:
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
        ax.plot(t[[0, -1]], [peak.value] * 2, color=peak.color, linewidth=0.9, linestyle="--")  # not over names
        low = any(other.value > peak.value for other in shown)
        ends: dict[str, Any] = {"va": "top" if low else "bottom", "color": peak.color}
        sides = ("axes fraction", "data")
        ax.annotate(peak.name, (1, peak.value), (0, -3 if low else 2), xycoords=sides, **ends, **style)
