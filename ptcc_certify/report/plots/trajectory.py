"""States and sliding variables over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.report.plots.agents import draw_agents, draw_deadlines, name_agents
from ptcc_certify.report.plots.style import (
    BOUND,
    DOUBLE_COLUMN,
    SINGLE_COLUMN,
    axes_of,
    finished,
    new_axes,
    share_legend,
    styled,
    time_label,
)
from ptcc_certify.report.plots.subject import limits_text, structure_of, trajectory_of


@styled
def plot_trajectory(subject: Any, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw the states ``x_k(t)`` of one run, in the colours and lines of the camps, and the deadline ``T``.

    In a formation these are positions, the places added.
    Of up to eight agents each has a line with its name. Of more, parts of the graph with more than three agents are
    drawn as their range and median, and the agents that begin highest and lowest by name.

    Parameters
    ----------
    subject : Trajectory or Certificate
        Of one initial state. The run of a certificate that holds none is simulated.
    ax : Axes, optional
    time_unit : str
        Of the deadline, for the label of the axis: ``"s"``.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no run of one initial state.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_trajectory(run, time_unit="s")
    >>> ax.get_xlabel(), [text.get_text() for text in ax.texts]
    ('time $t$ (s)', ['ann', 'bob', 'ann', 'bob'])
    """
    run, structure, ax = trajectory_of(subject), structure_of(subject), axes_of(ax)
    named = draw_agents(ax, run, run.positions, structure)
    draw_deadlines(ax, run)
    name_agents(ax, run, run.positions, named, ends=True)
    title = limits_text(run, subject if isinstance(subject, Certificate) else None)
    return finished(ax, time_label("time $t$", time_unit), "state $x_k$", title)


@styled
def plot_run(
    subject: Any, *, reaching: Sequence[ReachingTime] | None = None, wide: bool = False, time_unit: str = ""
) -> Figure:
    """Draw the states ``x_k(t)``; in a reaching phase the sliding variables ``sigma_k(t)`` below them.

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
    run = trajectory_of(subject)
    if run.sliding is None or not run.sliding.sigma0.any():
        figure = Figure((width, height), layout="constrained")
        plot_trajectory(subject, ax=new_axes(figure), time_unit=time_unit)
        return figure
    figure = Figure((width, 1.8 * height), layout="constrained")
    upper = new_axes(figure, (2, 1, 1))
    lower = new_axes(figure, (2, 1, 2))
    plot_trajectory(run, ax=upper, time_unit=time_unit)
    reaching = subject.reaching if reaching is None and isinstance(subject, Certificate) else reaching
    plot_sliding(run, ax=lower, reaching=reaching, time_unit=time_unit)
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
    >>> ax = plot_sliding(run, reaching=ptcc.protocols.reaching_time.certified_reaching_times(p, [1, -4]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()][-3:]
    ['$\\sigma_k$ reaches 0', 'reaching time at most', '$T_r$']
    """
    run, structure, ax = trajectory_of(subject), structure_of(subject), axes_of(ax)
    if (sliding := run.sliding) is None:
        raise ParameterError("the run has no sliding variables; simulate under the sliding-mode protocol")
    reaching = subject.reaching if reaching is None and isinstance(subject, Certificate) else reaching
    T_r = float(sliding.protocol.T_r)
    named = draw_agents(ax, run, sliding.sigma, structure)
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
