"""States and sliding variables over time, agents of order n and their formations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lmi.exact.decimal_rounding import counted
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, analyse
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.report.plots.camp_lines import (
    CAMP_STYLES,
    HALO,
    NAME_SIZE,
    NAMED_AGENTS,
    camp_groups,
    camp_lines,
    draw_agents,
    draw_deadlines,
    family_camps,
    family_groups,
    name_agents,
    share_times,
)
from ptcc_certify.report.plots.final_colours import colours_at_end
from ptcc_certify.report.plots.graph import node_id
from ptcc_certify.report.plots.runs_under_signals import bound_label, count_of_signals, is_worst, runs_of
from ptcc_certify.report.plots.sizes import DOUBLE_COLUMN, SINGLE_COLUMN, current_sizes
from ptcc_certify.report.plots.style import (
    BEHIND,
    BOUND,
    axes_of,
    finished,
    new_axes,
    share_legend,
    shown,
    styled,
    time_label,
)
from ptcc_certify.report.plots.subject import certifies_family, limits_text, read_back, structure_of, trajectory_of
from ptcc_certify.report.text_layout import printable, shorten_text
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.trajectory import Trajectory

#: The bar of a final interval.
BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "_", "markersize": 5}


@styled
def plot_trajectory(
    subject: Any, *, ax: Axes | None = None, runs: Sequence[Trajectory] | None = None, time_unit: str = ""
) -> Axes:
    """Draw the states ``x_k(t)`` of one run, and the deadline ``T``.

    Lines are those of the camps; colours of up to 60 agents of a certificate those of states at ``T``, as at a glance,
    else of the camps, too. In a formation these are positions, the places added.
    Of up to eight agents each line has its name, of more those of the agents that begin highest and lowest in each part
    of the graph. Of more than 60 agents these parts are drawn as their range and mean.

    Of the certificate of a family thin lines are runs under random signals, thicker ones under worst cases, in the
    colours and lines of the camps: those of the consensus, or what agents are in every mode. Shaded: where those of a
    camp are for every signal, the final interval of each widened by the bound of ``|x_k(t) - x_k(T)|``, and never
    beyond the largest state. Bars behind ``T``: the final intervals. Of more than eight agents those are drawn that
    begin highest and lowest.

    Parameters
    ----------
    subject : Trajectory, Certificate
        Of one initial state. The run of a certificate that holds none is simulated.
    ax : Axes, optional
    runs : sequence of Trajectory, optional
        Of a family, by default under eight random signals and worst cases.
    time_unit : str
        Of the deadline, for the label of the axis: ``"s"``.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no run of one initial state, or runs are not of its family.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_trajectory(run, time_unit="s")
    >>> ax.get_xlabel(), [text.get_text() for text in ax.texts]
    ('time $t$ (s)', ['$T$ = 1', 'ann', 'bob', 'ann', 'bob'])
    """
    every, ax = runs_of(subject, runs), axes_of(ax)
    run, values = every[0], every[0].positions
    if certifies_family(subject):
        named, limits = _draw_signals(ax, subject, every)
        title = count_of_signals(subject, every)
    else:
        named, limits = draw_agents(ax, run, values, structure_of(subject), colours=_colours(subject, run)), None
        title = limits_text(run, subject if isinstance(subject, Certificate) else None)
    draw_deadlines(ax, run, told=True)
    until = None if limits is None else float(run.t[-1])  # beyond T stand bars of final states
    name_agents(ax, run, values, named, ends=limits is None, until=until)
    if limits is not None:
        ax.set_ylim(limits)
    return finished(ax, time_label("time $t$", time_unit), "state $x_k$", title)


def _colours(subject: Any, run: Trajectory) -> list[str] | None:
    """Return the colours of agents by where they end, if a certificate tells that."""
    return colours_at_end(subject, run) if isinstance(subject, Certificate) else None


def _draw_signals(
    ax: Axes, certificate: Certificate, runs: Sequence[Trajectory]
) -> tuple[dict[int, str], tuple[float, float]]:
    """Draw runs of a family within what is proved for every signal; return the colours of agents, and the limits."""
    proof = certificate.family_proof
    groups = family_camps(proof.family)
    if groups is None or not all(part.component.behaviour == BIPARTITE_CONSENSUS for part in proof.parts):
        groups = family_groups(proof.family)
    agents = _extreme_agents(runs[0].positions[:, 0])
    for k, style in camp_lines(groups, agents):
        for run in runs:
            worst = is_worst(run)
            ax.plot(run.t, run.positions[k], linewidth=1.1 if worst else 0.5, alpha=1.0 if worst else 0.7, **style)
            style["label"] = None
    bars = _draw_tubes(ax, certificate, runs[0], agents, groups)
    values = np.concatenate([bars, *(run.positions[agents].ravel() for run in runs)])
    low, high = float(values.min()), float(values.max())
    low, high = (low, high) if low < high else (low - 1, high + 1)
    room = 0.08 * (high - low)
    return {k: CAMP_STYLES[groups[k]][0] for k in agents}, (low - room, high + room)


def _extreme_agents(x: np.ndarray) -> list[int]:
    """Return all agents, or those that begin highest and lowest."""
    order = np.argsort(x, kind="stable").tolist()
    if len(order) <= NAMED_AGENTS:
        return sorted(order)
    half = NAMED_AGENTS // 2
    return sorted([*order[:half], *order[-half:]])


def _draw_tubes(
    ax: Axes, certificate: Certificate, run: Trajectory, agents: list[int], groups: np.ndarray
) -> list[float]:
    """Shade where the agents of each camp are for every signal; draw the final intervals beyond ``T``, return ends.

    In a formation each agent by itself.
    """
    before = run.remaining > 0
    offsets = certificate.proof.offsets
    moves = certificate.proof.deviation_bound(run.remaining[before])
    finals = tuple(certificate.family_proof.final_state or ())
    largest = np.zeros(len(groups))  # what the states of a component never exceed
    for part in certificate.family_proof.parts:
        nodes = part.component.nodes
        largest[nodes] = np.abs(run.states[nodes, 0]).max()
        if run.sliding is not None:
            largest[nodes] += np.abs(run.sliding.sigma0[nodes]).sum()
    T = float(certificate.protocol.T)
    places: dict[tuple[float, float, str], None] = {}
    for name in dict.fromkeys(groups[agents]):
        tubes = []
        for k in (k for k in agents if groups[k] == name):
            if (interval := finals[k]) is not None:
                low, high = (float(end) for end in interval)
                h = 0.0 if offsets is None else float(offsets[k])
                places[low + h, high + h, CAMP_STYLES[name][0]] = None
                tube = np.maximum(low - moves[k], -largest[k]), np.minimum(high + moves[k], largest[k])
                tubes.append((tube[0] + h, tube[1] + h))
        if name != "single leaders" and tubes and offsets is None:
            tubes = [(np.min([low for low, _ in tubes], axis=0), np.max([high for _, high in tubes], axis=0))]
        for least, most in tubes:
            colour = CAMP_STYLES[name][0]
            ax.fill_between(run.t[before], least, most, color=colour, alpha=0.07, linewidth=0)
            for rim in (least, most):  # told apart where two overlap
                ax.plot(run.t[before], rim, color=colour, alpha=0.6, linewidth=0.6)
    for number, (low, high, colour) in enumerate(places, 1):
        place = T + number * (float(run.t[-1]) - T) / (len(places) + 1)
        ax.plot([place, place], [low, high], color=colour, zorder=4, **BAR)
    if places:
        ax.fill([], [], facecolor=BEHIND, alpha=0.3, edgecolor=BEHIND, label=bound_label(certificate))
        ax.plot([], [], color=BEHIND, **BAR, label="final states, proved")
    return [end for low, high, _ in places for end in (low, high)]


@styled
def plot_run(
    subject: Any, *, reaching: Sequence[ReachingTime] | None = None, wide: bool = False, time_unit: str = ""
) -> Figure:
    """Draw the states ``x_k(t)``; in a reaching phase the sliding variables ``sigma_k(t)`` below, at the same times.

    Parameters
    ----------
    subject : Trajectory or Certificate
        As for :func:`plot_trajectory`.
    reaching : sequence of N ReachingTime, optional
        Proved reaching times; those of a certificate by default.
    wide : bool
        As wide as two columns of a journal, instead of one.
    time_unit : str
        Of the deadline, for the labels of the axes.

    Returns
    -------
    Figure

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> len(plot_run(simulate(pair, p, [3, 5], sigma0=[1, 0])).axes)
    2
    """
    width, height = DOUBLE_COLUMN if wide else SINGLE_COLUMN
    sizes, run = current_sizes(), trajectory_of(subject)
    reaching = subject.proof.reaching if reaching is None and isinstance(subject, Certificate) else reaching
    if isinstance(subject, Certificate) and subject.trajectory is None and run.sliding is not None:
        subject = subject.changed(trajectory=run)  # which both panels show
    if run.sliding is None or not run.sliding.sigma0.any():
        figure = Figure(sizes.of((width, height)), layout="constrained")
        plot_trajectory(subject, ax=new_axes(figure), time_unit=time_unit)
        return figure
    figure = Figure(sizes.of((width, 1.8 * height)), layout="constrained")
    upper = new_axes(figure, (2, 1, 1))
    lower = new_axes(figure, (2, 1, 2))
    plot_trajectory(subject, ax=upper, time_unit=time_unit)
    plot_sliding(subject, ax=lower, reaching=reaching, time_unit=time_unit)
    upper.set_xlabel("")
    share_times([upper, lower], [upper, lower], 2)
    return share_legend(figure, 3 if wide else 2)


@styled
def plot_sliding(
    subject: Any, *, ax: Axes | None = None, reaching: Sequence[ReachingTime] | None = None, time_unit: str = ""
) -> Axes:
    r"""Draw ``sigma_k(t)`` up to a little beyond ``T_r``: circles where each reaches 0, ticks by when that is proved.

    Lines, ranges and names are those of :func:`plot_trajectory`.

    Parameters
    ----------
    subject : Trajectory or Certificate
        Of the sliding-mode protocol.
    ax : Axes, optional
    reaching : sequence of N ReachingTime, optional
        Proved reaching times; those of a certificate by default.
    time_unit : str
        Of the deadline, for the label of the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The run has no sliding variables.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(pair, p, [3, 5], sigma0=[1, -4])
    >>> ax = plot_sliding(run, reaching=ptcc.model.reaching_time.certified_reaching_times(p, [1, -4]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()][-3:]
    ['$\\sigma_k$ reaches 0', 'reaching time at most', '$T_r$']
    """
    run, structure = trajectory_of(subject), structure_of(subject)
    ax = axes_of(ax)
    if (sliding := run.sliding) is None:
        raise ParameterError("the run has no sliding variables; simulate under the sliding-mode protocol")
    reaching = subject.proof.reaching if reaching is None and isinstance(subject, Certificate) else reaching
    T_r = float(sliding.protocol.T_r)
    named = draw_agents(ax, run, sliding.sigma, structure, colours=_colours(subject, run))
    reached = sliding.reaching_times[sliding.sigma0 != 0]
    if np.isfinite(reached).any():
        marked: dict[str, Any] = {"color": "black", "markerfacecolor": "white", "markersize": 3.5, "zorder": 4}
        ax.plot(reached, np.zeros(reached.size), "o", **marked, label="$\\sigma_k$ reaches 0")
    if reaching is not None:
        proved = [r.time for r in reaching if r.z is None or r.z > 0]
        ax.plot(proved, [0.0] * len(proved), "|", color=BOUND, markersize=12, zorder=3, label="reaching time at most")
    ax.axvline(T_r, color="black", linewidth=0.8, linestyle=(0, (5, 2, 1, 2)), label="$T_r$")
    name_agents(ax, run, sliding.sigma, named, until=min(1.1 * T_r, float(run.t[-1])))
    return finished(ax, time_label("time $t$", time_unit), "sliding variable $\\sigma_k$")


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
