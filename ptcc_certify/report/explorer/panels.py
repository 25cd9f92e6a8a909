"""The figures of the explorer, whose axes keep their places as long as their legends keep their rows."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.report.page_figures import PLOTS
from ptcc_certify.report.plots.decay import error_norm, resolved
from ptcc_certify.report.plots.sizes import SINGLE_COLUMN
from ptcc_certify.report.plots.style import BOUND, RUN, STYLE, figure_bytes, finished, new_axes

#: The panels, in the order in which they stand, and what they show.
PANELS = {
    "states": "States over time",
    "decay": "Error under its proved bound",
    "graph": "The graph: who listens to whom",
    "input": "Input over time",
    "sliding": "Sliding variables over time",
}
#: Share of the initial error down to which the decay is drawn, below which the integrator resolves little; and of time.
_LEAST, _LAST = 1e-8, 1e-4
#: Decades that are named on the axes of the decay.
_TICKS = {4: "10⁴", 2: "100", 0: "1", -2: "0.01", -4: "10⁻⁴", -6: "10⁻⁶", -8: "10⁻⁸"}
#: A panel in inches, and its margins: left, bottom, right, and top: the longest legend has one line, or four.
_SIZE, _MARGINS = (SINGLE_COLUMN[0], 3.0), (0.62, 0.45, 0.56)
_TOP = {"decay": 0.26, "states": 0.74, "input": 0.74, "graph": 0.74, "sliding": 0.74}


def panel_svg(certificate: Certificate, name: str) -> str:
    """Return a panel by itself, as wide as a column of a journal, as SVG."""
    return figure_bytes(draw_panels(certificate, (name,)), ".svg").decode()


def shown_in(certificate: Certificate, name: str) -> Any:
    """Return all that a panel shows of a graph, if it does not change with every control; None if it does.

    Sliding variables move by their own gain: those of the protocol's states leave them as they are.
    """
    run = certificate.trajectory
    if name == "graph":
        return name
    if name != "sliding" or run is None or run.sliding is None:
        return None
    moved = tuple(part.tobytes() for part in (run.t, run.sliding.sigma, run.sliding.reaching_times))
    return moved, run.sliding.protocol.T_r, certificate.proof.reaching


def draw_panels(certificate: Certificate, names: tuple[str, ...]) -> Figure:
    """Return panels in one figure, two beside each other."""
    columns = min(2, len(names))
    rows = math.ceil(len(names) / columns)
    size = np.array([columns * _SIZE[0], rows * _SIZE[1]])
    with style.context(STYLE):
        figure = Figure(size.tolist(), layout="none")  # type: ignore[arg-type]  # with one all is drawn twice
        for place, name in enumerate(names, start=1):
            ax = new_axes(figure, (rows, columns, place))
            row, column = divmod(place - 1, columns)
            left, bottom, right = (0.1, 0.1, 0.1) if name == "graph" else _MARGINS
            corner = (column * _SIZE[0] + left, (rows - 1 - row) * _SIZE[1] + bottom) / size
            extent = (_SIZE[0] - left - right, _SIZE[1] - bottom - _TOP[name]) / size
            ax.set_position((*corner, *extent))
            _draw(certificate, name, ax)
    return figure


def message_figure(message: str) -> Figure:
    """Return a figure that holds nothing but a message."""
    figure = Figure((2 * SINGLE_COLUMN[0], SINGLE_COLUMN[1]))
    figure.text(0.5, 0.5, message, ha="center", va="center", wrap=True, parse_math=False)
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=90)
    return buffer.getvalue()


def _draw(certificate: Certificate, name: str, ax: Axes) -> None:
    """Draw a panel, or say that there is nothing to draw."""
    try:
        if name != "graph" and certificate.trajectory is None:
            raise ValueError("the integrator failed: there is no run to draw")
        (_draw_decay if name == "decay" else PLOTS[name])(certificate, ax=ax)
    except ValueError as nothing:
        ax.clear()
        ax.set_axis_off()
        ax.text(0.5, 0.5, str(nothing), ha="center", va="center", wrap=True, transform=ax.transAxes, parse_math=False)


def _draw_decay(certificate: Certificate, ax: Axes) -> None:
    """Draw ``||E||`` (or ``||eps||``) under its bound as :func:`plot_decay` does, but without each function's own.

    These, typeset powers of ten and minor ticks would take longer to draw than all the rest; the axes are fixed.
    """
    run, envelope = certificate.trajectory, certificate.graph_proof.envelope
    if run is None or not envelope.functions or certificate.proof.constant:
        raise ValueError("there is nothing to decay" if certificate.proof.constant else "no bound is proved")
    before = run.remaining > 0
    norm, floor, unit = error_norm(run, certificate)
    bound = certificate.graph_proof.norm_bound(run.remaining[before]) / unit
    scale = float(norm[0]) or 1.0
    ax.loglog(run.remaining[before], bound / scale, color=BOUND, linewidth=1.6, label="proved bound")
    ax.loglog(run.remaining[before], resolved(norm, bound, floor) / scale, color=RUN, label="simulated (CVODES)")
    ax.minorticks_off()
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_ticks([10.0**k for k in _TICKS], list(_TICKS.values()))
    ax.set_xlim(1, _LAST)
    ax.set_ylim(_LEAST, 1e4)
    name = "E" if envelope.coordinates == "E" else "ε"
    finished(ax, "remaining time, 1 − t/T", f"‖{name}(t)‖ / ‖{name}(0)‖")
