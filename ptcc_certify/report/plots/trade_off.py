"""What a design trades: peak input against deadline."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.errors import ParameterError
from ptcc_certify.gain_design.answer import Design
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled, time_label


@styled
def plot_trade_off(subject: Design, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw the peak input that is certified against the deadline, and below which no gains can stay.

    Both axes are logarithmic. The limit that was asked for is a horizontal line.

    Parameters
    ----------
    subject : Design
    ax : Axes, optional
    time_unit : str
        Of the deadline, for the label of the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject is no design.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> ax = plot_trade_off(design(pair, max_input=10, initial_bound=1))
    >>> [line.get_label() for line in ax.lines]
    ['certified with these gains', 'no gains stay below', 'asked for', 'this design']
    """
    if not isinstance(found := subject, Design):
        raise ParameterError(f"this figure is drawn from a design, not from {type(subject).__name__}; ask design first")
    ax, curve = axes_of(ax), found.trade_off(found.deadlines())
    ax.set(xscale="log", yscale="log")
    if np.isfinite(curve.certified).any():
        ax.plot(curve.deadlines, curve.certified, color=RUN, label="certified with these gains")
    if np.isfinite(curve.lower).any():
        ax.fill_between(curve.deadlines, curve.lower * 1e-3, curve.lower, color=BEHIND, alpha=0.3, linewidth=0)
        ax.plot(curve.deadlines, curve.lower, color=BEHIND, linestyle="--", label="no gains stay below")
        ax.set_ylim(bottom=float(np.nanmin(curve.lower)) / 3)
    ax.axhline(float(found.asked.max_input), color=BOUND, linewidth=0.9, linestyle=":", label="asked for")
    if found.protocol is not None and found.peak:
        ax.plot(
            [float(found.protocol.T)], [float(found.peak)], "o", color=RUN, markeredgecolor="black", label="this design"
        )
    norm = r"peak input $\|u\|_2$" if found.asked.input_norm == 2 else "peak input, largest $|u_k|$"
    return finished(ax, time_label("deadline $T$", time_unit), norm)
