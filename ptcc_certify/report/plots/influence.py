"""Who decides whom, as a heat map."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap

from ptcc_certify.bounds.final_state.of_graph import Influence, influence
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.size_limits import DRAWN_NODES, LABELLED_NODES
from ptcc_certify.report.plots.camp_lines import NAME_SIZE
from ptcc_certify.report.plots.style import SINGLE_COLUMN, axes_of, finished, styled
from ptcc_certify.report.plots.subject import structure_of
from ptcc_certify.report.text_layout import printable, shorten_text

#: Colours of weights, from the least over 0 to the largest.
_COLOURS = LinearSegmentedColormap.from_list("weights", ["#A84300", "#FFFFFF", "#005A9C"])
#: The luminance on which black and white have the same contrast, which is 4.58.
_MIDDLE = 0.179
#: Columns of a name; height of a row in inches, and the least and largest height of a figure; rows that are named.
_NAME, _ROW, _HEIGHTS, _ROWS = 14, 0.15, (1.8, 10.0), 60


@styled
def plot_influence(subject: Any, *, ax: Axes | None = None) -> Axes:
    """Draw the weights ``Q_kj`` by which initial states of leaders decide where nodes end, ``x(T) = Q x(0)``.

    Rows are nodes, columns the leaders that count; blue weights pull a node to the leader, red ones to its opposite.
    Nodes with like weights stand together: they are in the order of the leader that decides most of each.

    Parameters
    ----------
    subject : Influence, or whatever :func:`ptcc_certify.plot_graph` takes of one graph
        Of at most 300 nodes.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        There are more nodes, or nobody decides anything: every node ends at 0.

    References
    ----------
    Lemmas 2, 8 and 9 of [Zhu]_.

    Examples
    --------
    >>> ax = plot_influence([("a", "c", 1), ("b", "c", -3)])
    >>> [text.get_text() for text in ax.get_xticklabels()], [text.get_text() for text in ax.get_yticklabels()]
    (['a', 'b'], ['a', 'b', 'c'])
    """
    who = subject if isinstance(subject, Influence) else influence(structure_of(subject))
    labels = [shorten_text(printable(label), _NAME) for label in who.structure.graph.labels]
    if len(labels) > DRAWN_NODES:
        raise ParameterError(f"a heat map shows at most {DRAWN_NODES} nodes; write a table of these")
    leaders = [int(j) for j in np.flatnonzero(who.shares)]
    if not leaders:
        raise ParameterError("nobody decides where nodes end: all end at 0, wherever they begin")
    matrix = np.zeros((len(labels), len(leaders)))
    for k in range(len(labels)):
        row = who.row(k)
        matrix[k] = [float(row.get(j, 0)) for j in leaders]
    decider = np.where(matrix.any(axis=1), np.abs(matrix).argmax(axis=1), len(leaders))  # who ends at 0 stands last
    order = np.lexsort((-matrix.sum(axis=1), decider))
    height = float(np.clip(0.9 + _ROW * len(labels), *_HEIGHTS)) if len(labels) <= _ROWS else 7.0
    ax = axes_of(ax, (SINGLE_COLUMN[0], height))
    edges = np.arange(len(leaders) + 1) - 0.5, np.arange(len(labels) + 1) - 0.5
    most = float(np.abs(matrix).max())
    cells = ax.pcolormesh(
        *edges, matrix[order], cmap=_COLOURS, vmin=-most, vmax=most, edgecolors="white", linewidth=0.4
    )
    ax.invert_yaxis()
    ax.grid(False)
    ax.spines[:].set_visible(False)
    named = len(labels) <= _ROWS
    ax.set_xticks(range(len(leaders)) if len(leaders) <= LABELLED_NODES else [], minor=False)
    ax.set_yticks(range(len(labels)) if named else [])
    if len(leaders) <= LABELLED_NODES:
        names = [labels[j] for j in leaders]
        upright = max(map(len, names)) > 3 and len(names) > 4
        ax.set_xticklabels(names, rotation=90 if upright else 0, parse_math=False, fontsize=NAME_SIZE)
    if named:
        ax.set_yticklabels([labels[k] for k in order], parse_math=False, fontsize=NAME_SIZE)
        if matrix.size <= 12 * LABELLED_NODES and len(leaders) <= 8:
            _write_weights(ax, matrix[order], cells.to_rgba(matrix[order]))
    ax.tick_params(length=0)
    bar = ax.figure.colorbar(cells, ax=ax, shrink=0.7, label="weight in $x(T)$")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return finished(ax, "whose initial state", "who ends there" if named else f"who ends there ({len(labels)} nodes)")


def _write_weights(ax: Axes, matrix: np.ndarray, colours: np.ndarray) -> None:
    """Write weights into their cells, black or white, whichever stands out; 0 where nobody counts."""
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)[..., :3]
    dark = linear @ [0.2126, 0.7152, 0.0722] < _MIDDLE
    for (row, column), weight in np.ndenumerate(matrix):
        if weight or not matrix[row].any():
            text: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.5}
            ax.text(column, row, f"{weight:.2g}", color="white" if dark[row, column] else "black", **text)
