"""What a design trades: peak input against deadline."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from ptcc_certify.gain_design import Design
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled


@styled
def plot_trade_off(found: Design, ax: Axes | None = None) -> Axes:
    """Draw the peak input that is certified against the deadline, and below which no gains can stay.

    Both axes are logarithmic. The limit that was asked for is a horizontal line.

    Parameters
    ----------
    found : Design
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> ax = plot_trade_off(design(pair, max_input=10, initial_bound=1))
    >>> [line.get_label() for line in ax.lines]
    ['certified with these gains', 'no gains stay below', 'asked for', 'this design']
    """
    ax, curve = axes_of(ax), found.trade_off(found.deadlines())
    ax.set(xscale="log", yscale="log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))  # deadlines take up little more than a decade
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
    if np.isfinite(curve.certified).any():
        ax.plot(curve.deadlines, curve.certified, color=RUN, label="certified with these gains")
    if np.isfinite(curve.lower).any():
        ax.fill_between(curve.deadlines, curve.lower * 1e-3, curve.lower, color=BEHIND, alpha=0.3, linewidth=0)
        ax.plot(curve.deadlines, curve.lower, color=BEHIND, linestyle="--", label="no gains stay below")
        ax.set_ylim(bottom=float(np.nanmin(curve.lower)) / 3)
    ax.axhline(float(found.asked.max_input), color=BOUND, linewidth=0.9, linestyle=":", label="asked for")
    if found.protocol is not None and found.peak:
        ax.plot([float(found.protocol.T)], [float(found.peak)], "o", color=RUN, label="this design")
    norm = r"peak input $\|u\|_2$" if found.asked.input_norm == 2 else "peak input, largest $|u_k|$"
    return finished(ax, "deadline $T$", norm)
