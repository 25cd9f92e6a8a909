"""States and sliding variables over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.report.plots.style import (
    BEHIND,
    BOUND,
    CAMP_COLOURS,
    DOUBLE_COLUMN,
    RUN,
    SINGLE_COLUMN,
    axes_of,
    camp_groups,
    finished,
    new_axes,
    styled,
)
from ptcc_certify.simulation.trajectory import SlidingTrajectory, Trajectory


@styled
def plot_trajectory(trajectory: Trajectory, structure: Structure, ax: Axes | None = None) -> Axes:
    """Draw ``x_k(t)`` with camps coloured, leaders thick, followers thin, and the deadline as a vertical line.

    Parameters
    ----------
    trajectory : Trajectory
        Of one initial state.
    structure : Structure
        Of the same graph.
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [line.get_label() for line in plot_trajectory(run, analyse(pair)).lines]
    ['first camp', 'second camp', 'deadline']
    """
    ax = axes_of(ax)
    draw_agents(trajectory, trajectory.states, structure, ax)
    return finished(ax, "time $t$", "state $x_k$")


@styled
def plot_run(
    trajectory: Trajectory,
    structure: Structure,
    reaching: Sequence[ReachingTime] | None = None,
    *,
    wide: bool = False,
) -> Figure:
    """Draw the states; under the sliding-mode protocol with a reaching phase the sliding variables below them.

    Parameters
    ----------
    trajectory : Trajectory
        Of one initial state.
    structure : Structure
        Of the same graph.
    reaching : sequence of N ReachingTime, optional
        Proved reaching times.
    wide : bool
        As wide as two columns of a journal, instead of one.

    Returns
    -------
    Figure

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> len(plot_run(simulate(pair, p, [3, 5], sigma0=[1, 0]), analyse(pair)).axes)
    2
    """
    width, height = DOUBLE_COLUMN if wide else SINGLE_COLUMN
    slid = trajectory.sliding
    if slid is None or not slid.sigma0.any():
        return plot_trajectory(trajectory, structure, axes_of(None, (width, height))).figure  # type: ignore[return-value]
    figure = Figure((width, 2 * height), layout="constrained")
    upper, lower = (new_axes(figure, (2, 1, row)) for row in (1, 2))
    plot_trajectory(trajectory, structure, upper)
    plot_sliding(slid, reaching, lower)
    return figure


@styled
def plot_sliding(
    trajectory: SlidingTrajectory, reaching: Sequence[ReachingTime] | None = None, ax: Axes | None = None
) -> Axes:
    r"""Draw ``sigma_k(t)`` up to a little beyond ``T_r``, dots where each reaches 0, ticks where that is proved.

    Parameters
    ----------
    trajectory : SlidingTrajectory
    reaching : sequence of N ReachingTime, optional
        Proved reaching times (``certificate.reaching``).
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(pair, p, [3, 5], sigma0=[1, -4])
    >>> ax = plot_sliding(run, ptcc.protocols.reaching_time.certified_reaching_times(p, [1, -4]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['$\\sigma_k$ reaches 0', 'reaching time at most', '$T_r$']
    """
    ax, T_r = axes_of(ax), float(trajectory.protocol.T_r)
    shown = trajectory.t <= 1.1 * T_r
    for row in trajectory.sigma:
        ax.plot(trajectory.t[shown], row[shown], color=RUN, linewidth=0.9)
    reached = trajectory.reaching_times[trajectory.sigma0 != 0]
    if np.isfinite(reached).any():
        ax.plot(reached, np.zeros(reached.size), "o", color=RUN, markersize=3, label="$\\sigma_k$ reaches 0")
    if reaching is not None:
        proved = [r.time for r in reaching if r.z is None or r.z > 0]
        ax.plot(proved, [0.0] * len(proved), "|", color=BOUND, markersize=12, label="reaching time at most")
    ax.axvline(T_r, color="black", linewidth=0.8, linestyle=":", label="$T_r$")
    return finished(ax, "time $t$", "sliding variable $\\sigma_k$")


def draw_agents(
    trajectory: Trajectory, values: np.ndarray, structure: Structure, ax: Axes, drawstyle: str = "default"
) -> None:
    """Draw a line for every agent, leaders first and thick, and the deadlines."""
    group = camp_groups(structure)
    names: set[str] = set()
    for node in np.argsort(group == "followers", kind="stable"):
        name = str(group[node])
        line, width = ("--", 0.9) if name == "followers" else ("-", 1.6)
        looks: dict[str, Any] = {"color": CAMP_COLOURS[name], "linestyle": line, "linewidth": width}
        label = None if name in names else name
        ax.plot(trajectory.t, values[node], drawstyle=drawstyle, label=label, **looks)
        names.add(name)
    draw_deadlines(trajectory, ax)


def draw_deadlines(trajectory: Trajectory, ax: Axes) -> None:
    """Draw the deadline, and the reaching time of the sliding-mode protocol, as vertical lines."""
    if trajectory.protocol.prescribed:
        ax.axvline(float(trajectory.protocol.T), color="black", linewidth=0.8, linestyle=":", label="deadline")
    if (sliding := trajectory.protocol.reaching) is not None:
        ax.axvline(float(sliding.T_r), color=BEHIND, linewidth=0.8, linestyle="-.", label="$T_r$")
