"""The style of all figures: sizes, colours, axes, legends, and how figures are saved."""

from __future__ import annotations

import functools
import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rcParams, style
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.structure import Structure

#: Matplotlib's name of the style of all figures.
STYLE = "ptcc_certify.ptcc"
#: Width and height in inches of figures as wide as a column, or two, of a journal.
SINGLE_COLUMN, DOUBLE_COLUMN = (3.5, 2.7), (7.16, 2.9)
#: What figures are saved as; PDF and SVG are vectors.
FIGURES = (".png", ".pdf", ".svg")
#: Colours that the colour-blind tell apart (Okabe and Ito): what runs, what bounds it, what stands behind.
RUN, BOUND, BEHIND = "#0072B2", "#D55E00", "#7F7F7F"
#: The same for the parts of a graph.
CAMP_COLOURS = {"first camp": RUN, "second camp": BOUND, "unbalanced leaders": "#CC79A7", "followers": BEHIND}


def styled(plot: Callable[..., Any]) -> Callable[..., Any]:
    """Draw in the style of :data:`STYLE`, unless the axes are given: these have a style of their own."""

    @functools.wraps(plot)
    def drawn(*args: Any, **options: Any) -> Any:
        if any(isinstance(value, Axes) for value in (*args, *options.values())):
            return plot(*args, **options)
        with style.context(STYLE):
            return plot(*args, **options)

    return drawn


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file; it appears whole or not at all, and equal figures make equal files.

    Parameters
    ----------
    figure : Figure
    path : path
        ``.png`` (200 dots per inch), ``.pdf`` or ``.svg``.

    Raises
    ------
    ParameterError
        Another suffix.

    Examples
    --------
    >>> ax = plot_graph(analyse(SignedDigraph.from_edges([(1, 2, -1)])))
    >>> save_figure(ax.figure, "graph.jpg")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: graph.jpg: figures are written to .png, .pdf, .svg; choose one of these
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FIGURES:
        raise ParameterError(f"{path}: figures are written to {', '.join(FIGURES)}; choose one of these")
    write_atomically(path, figure_bytes(figure, suffix))


def figure_bytes(figure: FigureBase, suffix: str) -> bytes:
    """Return a figure as one of :data:`FIGURES`, the same bytes for the same figure.

    Letters of scripts that the font does not have become boxes, without a word about each.
    """
    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    buffer = io.BytesIO()
    with style.context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        figure.savefig(buffer, format=suffix[1:], metadata=undated)  # type: ignore[attr-defined]
    return buffer.getvalue()


def new_axes(figure: FigureBase, place: tuple[int, int, int] = (1, 1, 1)) -> Axes:
    """Add axes to a figure in the style that is in force; ``place`` is rows, columns and number, from 1."""
    ax = figure.add_subplot(*place)
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
    return new_axes(Figure(size, layout="constrained")) if ax is None else ax


def finished(ax: Axes, x: str, y: str) -> Axes:
    """Name the axes, and put the legend above them, where it covers no data, in as many columns as its width takes."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    width = ax.get_window_extent().width / ax.figure.dpi
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2 if width < 4 else 3, frameon=False)
    return ax


def camp_groups(structure: Structure) -> np.ndarray:
    """Return which of ``CAMP_COLOURS`` every node belongs to."""
    group = np.full(structure.graph.n_nodes, "followers", dtype=object)
    for component in structure.closed_components:
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            group[v] = {1: "first camp", -1: "second camp", 0: "unbalanced leaders"}[sign]
    return group
