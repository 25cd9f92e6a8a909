"""Agents of order n over time: positions, velocities and so on; and a formation in the plane."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmi.exact.decimal_rounding import counted
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.report.plots.camp_lines import (
    HALO,
    NAME_SIZE,
    NAMED_AGENTS,
    camp_groups,
    camp_lines,
    draw_agents,
    draw_deadlines,
    name_agents,
    share_times,
)
from ptcc_certify.report.plots.graph import node_id
from ptcc_certify.report.plots.sizes import DOUBLE_COLUMN, SINGLE_COLUMN, current_sizes
from ptcc_certify.report.plots.style import BEHIND, axes_of, finished, new_axes, share_legend, shown, styled, time_label
from ptcc_certify.report.plots.subject import read_back
from ptcc_certify.report.text_layout import printable, shorten_text
from ptcc_certify.simulation.agents import AgentsTrajectory

#: Labels of axes.
_NAMES = ("position", "velocity", "acceleration")
#: How far a name stands from the mark that it names, in points.
_AWAY = 8
#: Agents whose ends are named as well as their starts.
_NAMED_ENDS = 12


def agents_run(subject: Any) -> AgentsTrajectory:
    """Return the run of agents of order n, simulated where there is none.

    Raises
    ------
    ParameterError
        The subject is none, or of single integrators.
    """
    subject = read_back(subject)
    if isinstance(subject, Certificate) and subject.proof.agents is not None:
        return subject.observed.agents_run or subject.proof.agents.simulate()
    if isinstance(subject, AgentsAnswer):
        return subject.simulate()
    if isinstance(subject, AgentsTrajectory):
        return subject
    if isinstance(subject, Certificate) and subject.proof.vehicles is not None:
        raise ParameterError(
            "this figure is not drawn yet of vehicles that exchange virtual positions; take states, late or input"
        )
    raise ParameterError("this figure is of agents of order n; certify with agents=Agents(order=2), say")


def plot_motion(subject: Any, *, wide: bool = False, time_unit: str = "") -> Figure:
    """Draw positions, velocities and so on over time, below each other; in the plane x and y side by side.

    Of more than 60 agents, parts of the graph with more than three are drawn as their range and mean.

    Parameters
    ----------
    subject : AgentsTrajectory, or Certificate of agents of order n
    wide : bool
        As wide as two columns of a journal, all coordinates side by side.
    time_unit : str
        Of the deadline, for the labels of the axes.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        The subject leads to no such run.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    >>> cert = certify(foes, protocol, [3, 1], agents=Agents(order=2), asks=Asks(method="paper"))
    >>> [ax.get_ylabel() for ax in plot_motion(cert).axes]
    ['position', 'velocity']
    """
    from matplotlib import style

    from ptcc_certify.report.plots.style import STYLE

    run = agents_run(subject)
    _, d, n, _ = run.states.shape
    width, height = SINGLE_COLUMN
    with style.context(STYLE):
        beside, sizes = wide or d == 2, current_sizes()
        rows, columns = (n, d) if beside else (n * d, 1)
        broad = wide or (beside and sizes.widths[1] > sizes.widths[0])
        size = (DOUBLE_COLUMN[0] if broad else width), 0.75 * height * rows
        figure = Figure(sizes.of(size), layout="constrained")
        structure = analyse(run.graph)
        for i in range(n):
            for q in range(d):
                place = i * d + q if beside else q * n + i
                ax = new_axes(figure, (rows, columns, 1 + place))
                lines = draw_agents(ax, run, run.states[:, q, i], structure)
                draw_deadlines(ax, run)
                name = _NAMES[i] if i < len(_NAMES) else f"derivative {i}"
                label = f"{name} {'xyz'[q] if d < 4 else q + 1}" if d > 1 else name
                finished(ax, time_label("time $t$", time_unit) if place // columns == rows - 1 else "", label)
                if not i:
                    name_agents(ax, run, run.states[:, q, i], lines)
                elif run.graph.n_nodes <= NAMED_AGENTS:
                    _name_peaks(ax, run, run.states[:, q, i], lines)
        share_times(figure.axes[:d], figure.axes, rows)  # positions are drawn first
        return shown(share_legend(figure, 3))


def _name_peaks(ax: Axes, run: AgentsTrajectory, values: np.ndarray, colours: dict[int, str]) -> None:
    """Write the names of agents where their values are largest: many velocities begin and end at 0."""
    ax.margins(y=0.12)
    for k, color in colours.items():
        at = int(np.abs(values[k]).argmax())
        name, up = shorten_text(printable(run.labels[k]), 12), 1 if values[k, at] >= 0 else -1
        how: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center", "fontsize": NAME_SIZE}
        ax.annotate(name, (run.t[at], values[k, at]), (0, 5 * up), color=color, path_effects=HALO, zorder=6, **how)


@styled
def plot_formation(subject: Any, *, ax: Axes | None = None) -> Axes:
    """Draw the ways of agents in the plane: open circles where they begin, full ones where they are at ``T``.

    Parameters
    ----------
    subject : AgentsTrajectory, or Certificate of agents of order n
        In two dimensions.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no such run, or to one that is not in the plane.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    >>> cert = certify(foes, protocol, [[3, 1], [1, 0]], agents=Agents(order=2), asks=Asks(method="paper"))
    >>> plot_formation(cert).get_xlabel()
    '$x$'
    """
    run = agents_run(subject)
    if run.states.shape[1] != 2:
        d = run.states.shape[1]
        raise ParameterError(
            f"a formation is drawn in the plane; these agents have {counted(d, 'coordinate')}: certify them with 2"
        )
    ax = axes_of(ax, (SINGLE_COLUMN[0], SINGLE_COLUMN[0]))
    groups = camp_groups(analyse(run.graph))
    width = 1.0
    for k, style in camp_lines(groups, range(len(groups))):
        (x, y), color = run.positions[k], style["color"]
        ax.plot(x, y, linewidth=width, gid=node_id(k, "run"), **style)
        ax.plot(x[0], y[0], "o", markersize=3.5, markerfacecolor="white", markeredgecolor=color, zorder=5.5)
        ax.plot(x[-1], y[-1], "o", markersize=4.5, color=color, zorder=5, gid=node_id(k, "end"))
    ax.set_aspect("equal", adjustable="datalim")
    if run.graph.n_nodes <= 2 * NAMED_AGENTS:
        _name_ways(ax, run)
    for face, name in (("white", "at $t = 0$"), (BEHIND, "at $t = T$")):
        ax.plot([], [], "o", markersize=4, markerfacecolor=face, markeredgecolor=BEHIND, label=name)
    return finished(ax, "$x$", "$y$")


def _name_ways(ax: Axes, run: AgentsTrajectory) -> None:
    """Write every agent's name beside the start of its way, on the side where ways, marks and names are farthest.

    Of few agents, beside its end too, if it moves.
    """
    ends, begins = run.positions[:, :, -1], run.positions[:, :, 0]
    points = 72 * min(SINGLE_COLUMN) * 0.8
    unit = float(np.ptp(np.vstack([ends, begins]), axis=0).max() or 1) * 1.1 / points  # of data, for one point of print
    sides = [np.array([math.cos(a), math.sin(a)]) * _AWAY for a in np.arange(16) * math.pi / 8]
    taken: list[np.ndarray] = [*np.moveaxis(run.positions, 1, -1).reshape(-1, 2)]
    named = list(enumerate(begins))
    if len(begins) <= _NAMED_ENDS:
        named += [(k, end) for k, end in enumerate(ends) if np.hypot(*(end - begins[k])) > 2 * _AWAY * unit]
    for k, place in named:
        others = np.array(taken)
        free = [float(np.hypot(*(others - place - unit * side).T).min()) for side in sides]
        side = sides[int(np.argmax(np.round(free, 9)))]
        taken.append(place + unit * side)
        name = shorten_text(printable(run.graph.labels[k]), 12)
        how: dict[str, Any] = {"textcoords": "offset points", "fontsize": NAME_SIZE, "ha": "center", "va": "center"}
        ax.annotate(name, (place[0], place[1]), (side[0], side[1]), zorder=6, **how).set_path_effects([*HALO])
