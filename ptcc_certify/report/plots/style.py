"""The style of all figures: colours, axes, ticks, legends, and how figures are saved."""

from __future__ import annotations

import functools
import io
import math
import re
import textwrap
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rcParams, style
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator, ScalarFormatter

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.rationals import MINUS
from ptcc_certify.report.plots.sizes import SINGLE_COLUMN, current_sizes
from ptcc_certify.report.plots.subject import read_back

#: Matplotlib's name of the style of all figures.
STYLE = "ptcc_certify.ptcc"
#: What figures are saved as; PDF and SVG are vectors.
FIGURES = (".png", ".pdf", ".svg")
#: Colours of what runs, what bounds it, what stands behind. All colours of figures are dark enough for names on white,
#: a contrast of 4.5 and more, and those of camps stay apart for eyes without the cones of green.
RUN, BOUND, BEHIND = "#0072B2", "#B84E00", "#707070"
#: Colour and line of an edge from an ally (+1) or an opponent (-1); no camp has them.
EDGE_STYLES = {1: ("#117733", "-", "from an ally"), -1: ("#882255", "--", "from an opponent")}
#: Characters of the title of a legend for an inch of the axes below it.
_TITLE = 22
#: How labels of vertical axes begin that are of states, and have their unit.
_OF_STATES = ("state ", "position", "sliding variable", r"$\max_k |x_k(t)")
#: Between ticks lie these numbers of units, times a power of ten.
STEPS = [1, 2, 2.5, 5, 10]


def signed(x: float, digits: int = 3) -> str:
    """Return a number as the ticks of an axis are written, with the sign of minus.

    Examples
    --------
    >>> from ptcc_certify.report.plots.style import signed
    >>> print(signed(-0.5), signed(2))
    \u22120.5 2
    """
    return f"{x + 0.0:.{digits}g}".replace("-", MINUS)


def styled(plot: Callable[..., Any]) -> Callable[..., Any]:
    """Draw in the style of :data:`STYLE` what notebooks show; if ``ax`` is given, they have a style of their own.

    The subject may be the path of a certificate, which is read back.
    """

    @functools.wraps(plot)
    def drawn(subject: Any, *, ax: Axes | None = None, **keywords: Any) -> Any:
        subject = read_back(subject)
        if ax is not None:
            if not isinstance(ax, Axes):
                raise ParameterError("ax", f"= {ax!r} is none; give axes of Matplotlib, or leave it out")
            return plot(subject, ax=ax, **keywords)
        with style.context(STYLE):
            return shown(plot(subject, **keywords))

    return drawn


def shown(drawn: Any) -> Any:
    """Let notebooks show a figure, or axes, which is the last line of a cell or given to ``display``.

    No backend is asked and pyplot, which would keep every figure, does not know of it.

    Examples
    --------
    >>> data, size = plot_graph("fig1a")._repr_png_()
    >>> data[1:4], size["width"]
    (b'PNG', 336)
    """
    for one in (drawn, drawn.figure):
        one._repr_png_ = functools.partial(_notebook_png, drawn.figure)
    return drawn


def _notebook_png(figure: Figure) -> tuple[bytes, dict[str, int]]:
    """Return a figure and how wide it is shown, in pixels of 1/96 inch."""
    return figure_bytes(figure, ".png"), {"width": round(96 * float(figure.get_figwidth()))}


def save_figure(drawn: Figure | Axes, path: str | Path) -> None:
    """Write a figure, or that of axes, to a file; it appears whole or not at all, and equal figures make equal files.

    Parameters
    ----------
    drawn : Figure or Axes
        What a ``plot_*`` returns.
    path : path
        ``.png`` (300 dots per inch), ``.pdf`` or ``.svg``.

    Raises
    ------
    ParameterError
        Another suffix.

    Examples
    --------
    >>> save_figure(plot_graph(SignedDigraph.from_edges([(1, 2, -1)])), "graph.jpg")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: graph.jpg: figures are written to .png, .pdf, .svg; choose one of these
    """
    refuse_no_path(path)
    if not isinstance(drawn, FigureBase | Axes):
        raise ParameterError(f"a {type(drawn).__name__} is no figure; give what a plot_ function returned")
    suffix = Path(path).suffix.lower()
    if suffix not in FIGURES:
        raise ParameterError(f"{path}: figures are written to {', '.join(FIGURES)}; choose one of these")
    figure: Any = drawn.figure
    write_atomically(path, figure_bytes(figure.figure, suffix))  # that of a part of a figure is the whole


def figure_bytes(figure: FigureBase, suffix: str) -> bytes:
    """Return a figure as one of :data:`FIGURES`, the same bytes for the same figure.

    Letters of scripts that the font does not have become boxes, without a word about each.
    """
    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    buffer, scale = io.BytesIO(), current_sizes().scale_of(float(figure.get_figwidth()))  # type: ignore[attr-defined]
    more: dict[str, Any] = {"metadata": undated}
    with style.context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        if suffix == ".png" and scale != 1:
            dpi = float(rcParams["savefig.dpi"])
            more |= {"dpi": scale * dpi, "pil_kwargs": {"dpi": (dpi, dpi)}}
        target = _scaled_pdf(buffer, scale, undated) if suffix == ".pdf" and scale != 1 else buffer
        figure.savefig(target, format=suffix[1:], **more)  # type: ignore[attr-defined]
        if target is not buffer:
            target.close()
    if suffix != ".svg" or scale == 1:
        return buffer.getvalue()

    def resized(tag: re.Match[bytes]) -> bytes:
        return re.sub(rb'\b((?:width|height)=")([\d.]+)', lambda m: m[1] + b"%.6f" % (scale * float(m[2])), tag[0])

    return re.sub(rb"<svg[^>]*>", resized, buffer.getvalue(), count=1)


def _scaled_pdf(buffer: io.BytesIO, scale: float, metadata: Any) -> Any:
    """Return a PDF that scales what is drawn on its pages."""
    from matplotlib.backends.backend_pdf import Op, PdfFile, PdfPages

    class Scaled(PdfFile):
        def newPage(self, width: float, height: float) -> None:
            super().newPage(scale * width, scale * height)
            self.width, self.height = width, height  # paths are cut there before they are scaled
            self.output(scale, 0, 0, scale, 0, 0, Op.concat_matrix)

    pages: Any = PdfPages(buffer, metadata=metadata)
    pages._file = Scaled(buffer, metadata=metadata)
    return pages


def new_axes(figure: FigureBase, place: tuple[int, int, int] = (1, 1, 1), **keywords: Any) -> Axes:
    """Add axes to a figure in the style that is in force; ``place`` is rows, columns and number, from 1."""
    ax = figure.add_subplot(*place, **keywords)
    given: Any = rcParams  # whose stubs know literal names only
    # Ticks and grid are made when they are drawn, after the style has gone: fix them now.
    for which in ("x", "y"):
        ax.tick_params(axis=which, labelsize=given[f"{which}tick.labelsize"])
        for kind in ("major", "minor"):
            ax.tick_params(axis=which, which=kind, width=given[f"{which}tick.{kind}.width"])
    if given["axes.grid"]:
        ax.grid(True, color=given["grid.color"], linewidth=given["grid.linewidth"])
    return ax


def axes_of(ax: Axes | None, size: tuple[float, float] = SINGLE_COLUMN) -> Axes:
    """Return axes as they are given, or make new ones of a figure of their own."""
    return new_axes(Figure(current_sizes().of(size), layout="constrained")) if ax is None else ax


def time_label(quantity: str, unit: str) -> str:
    """Return the label of an axis of time, with the unit if one is given."""
    return f"{quantity} ({unit})" if unit else quantity


def tick_count(axis: Axis, most: int = 6) -> int:
    """Return how many ticks with labels an axis has room for."""
    return min(most, max(2, int(0.7 * axis.get_tick_space())))


def place_ticks(axis: Axis) -> None:
    """Place ticks that do not collide: on a logarithmic axis at decades, over two or so at 1, 2, 5 too.

    Of an axis that is logarithmic on both sides of 0 they are at equal decades of both. Ticks that were placed by hand
    stay.
    """
    if isinstance(axis.get_major_locator(), FixedLocator):
        return
    if axis.get_scale() == "symlog":
        low, high = axis.get_view_interval()
        least = math.ceil(math.log10(axis.get_transform().linthresh) - 1e-9)  # type: ignore[attr-defined]
        sides = [(sign, math.floor(math.log10(max(sign * end, 1e-300)))) for sign, end in ((-1, low), (1, high))]
        step = max(1, -(-sum(max(most - least + 1, 0) for _, most in sides) // tick_count(axis, 8)))
        ticks = [sign * 10.0**k for sign, most in sides for k in range(least, most + 1, step)]
        axis.set_major_locator(FixedLocator([0, *ticks]))
        axis.set_minor_locator(NullLocator())
        return
    if axis.get_scale() != "log":
        axis.set_major_locator(MaxNLocator(tick_count(axis), steps=STEPS))
        return
    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low) if low > 0 else math.inf
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    if decades > 2.5 or (decades > 1 and tick_count(axis) < 6):
        axis.set_major_locator(LogLocator(numticks=tick_count(axis, 7)))
        return
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)) if decades > 0.7 else MaxNLocator(tick_count(axis), steps=STEPS))
    axis.set_major_formatter("{x:g}")


def factor_out(axis: Axis, label: str) -> str:
    """Return the label of an axis with the power of ten that its ticks leave out, which would lie on the legend."""
    formatter = axis.get_major_formatter()
    if not isinstance(formatter, ScalarFormatter):
        return label
    formatter.set_useOffset(False)
    formatter.set_useMathText(False)
    formatter.set_locs(axis.get_majorticklocs())  # type: ignore[arg-type]
    axis.get_offset_text().set_visible(False)
    power = formatter.get_offset().removeprefix("1e")
    return f"{label} / $10^{{{power}}}$" if power else label


def finished(ax: Axes, x: str, y: str, title: str = "") -> Axes:
    """Name the axes, and put the legend above them, where it covers no data, in as many columns as its width takes."""
    unit = current_sizes().state_unit if y.startswith(_OF_STATES) else ""
    for axis, label in ((ax.xaxis, x), (ax.yaxis, y)):
        place_ticks(axis)
        label = factor_out(axis, label) if label else ""
        axis.set_label_text(time_label(label, unit) if axis is ax.yaxis else label)
    if labels := ax.get_legend_handles_labels()[1]:
        width = ax.get_window_extent().width / ax.figure.dpi
        columns = legend_columns(labels, 1.2 * width, 1 if width < 2.2 else 2 if width < 4 else 3)
        title = "\n".join(textwrap.wrap(title, max(int(_TITLE * width), 20)))
        ax.legend(
            loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, frameon=False, borderaxespad=0.2, title=title
        )
    return ax


def legend_columns(labels: Iterable[str], width: float, most: int) -> int:
    """Return in how many columns a legend fits into a width in inches, at most ``most``; labels go down, then right.

    Examples
    --------
    >>> from ptcc_certify.report.plots.style import legend_columns
    >>> legend_columns(["first camp", "followers"], 3, 2), legend_columns(["unbalanced leaders, to be sure"] * 2, 3, 2)
    (2, 1)
    """
    sizes = [3.6 * len(re.sub(r"[$_{}]|\\\w", "", label)) for label in labels]  # points in the size of the style

    def fits(columns: int) -> bool:
        parts = np.array_split(sizes, columns)
        return sum(24 + max(part, default=0) for part in parts) <= 72 * width

    return next((columns for columns in range(most, 1, -1) if fits(columns)), 1)


def share_legend(figure: Figure, columns: int) -> Figure:
    """Put one legend above all panels of a figure in the place of theirs."""
    shared: dict[str, Any] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            shared.setdefault(label, handle)
        if (own := ax.get_legend()) is not None:
            own.remove()
    columns = legend_columns(shared, float(figure.get_figwidth()), columns)
    narrow = {"handlelength": 1.6, "columnspacing": 1.2, "handletextpad": 0.6}  # not from border to border
    figure.legend(shared.values(), shared.keys(), loc="outside upper center", ncols=columns, frameon=False, **narrow)
    return figure
