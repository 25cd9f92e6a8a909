"""Figures: Axes in, Axes out. Nothing is shown or saved here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ptcc_certify.bounds import FLOOR_FACTOR
from ptcc_certify.sharpen import Sharpening
from ptcc_certify.structure import Structure
from ptcc_certify.trajectory import SlidingTrajectory, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ptcc_certify.certificate import Certificate
    from ptcc_certify.gain_design import Design
    from ptcc_certify.reaching import ReachingTime

#: Colour-blind safe (Okabe and Ito): first camp, second camp, unbalanced leaders, followers.
CAMP_COLOURS = {
    "first camp": "#0072B2",
    "second camp": "#D55E00",
    "unbalanced leaders": "#CC79A7",
    "followers": "#7F7F7F",
}


def plot_trajectory(trajectory: Trajectory, structure: Structure, ax: Axes | None = None) -> Axes:
    """Draw ``x_k(t)`` with camps coloured, leaders thick, followers thin, and the deadline as a vertical line.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    structure : Structure
        Of the same graph.
    ax : Axes, optional

    Returns
    -------
    Axes
    """
    ax = _axes(ax)
    group = np.full(structure.graph.n_nodes, "followers", dtype=object)
    for component in structure.closed_components:
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            group[v] = {1: "first camp", -1: "second camp", 0: "unbalanced leaders"}[sign]
    seen: set[str] = set()
    for node in np.argsort(group == "followers", kind="stable"):
        name = str(group[node])
        ax.plot(
            trajectory.t,
            trajectory.states[node],
            color=CAMP_COLOURS[name],
            linewidth=0.9 if name == "followers" else 1.6,
            linestyle="--" if name == "followers" else "-",
            label=None if name in seen else name,
        )
        seen.add(name)
    if trajectory.protocol.prescribed:
        ax.axvline(float(trajectory.protocol.T), color="black", linewidth=0.8, linestyle=":", label="deadline")
    if isinstance(trajectory, SlidingTrajectory):
        ax.axvline(float(trajectory.protocol.T_r), color="#7F7F7F", linewidth=0.8, linestyle="-.", label="$T_r$")
    ax.set_xlabel("time $t$")
    ax.set_ylabel("state $x_k$")
    _legend_above(ax)
    return ax


def plot_run(trajectory: Trajectory, structure: Structure, reaching: Sequence[ReachingTime] | None = None) -> Figure:
    """Draw the states; under the sliding-mode protocol with a reaching phase the sliding variables below them.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    structure : Structure
        Of the same graph.
    reaching : sequence of N ReachingTime, optional
        Proved reaching times.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    if not isinstance(trajectory, SlidingTrajectory) or not trajectory.sigma0.any():
        return plot_trajectory(trajectory, structure).figure  # type: ignore[return-value]
    upper, lower = Figure(figsize=(6, 6.4), layout="constrained").subplots(2, 1)
    plot_trajectory(trajectory, structure, upper)
    plot_sliding(trajectory, reaching, lower)
    return upper.figure


def plot_sliding(
    trajectory: SlidingTrajectory, reaching: Sequence[ReachingTime] | None = None, ax: Axes | None = None
) -> Axes:
    """Draw ``sigma_k(t)`` up to a little beyond ``T_r``, dots where each reaches 0, ticks where that is proved.

    Parameters
    ----------
    trajectory : SlidingTrajectory
    reaching : sequence of N ReachingTime, optional
        Proved reaching times (``certificate.reaching``).
    ax : Axes, optional

    Returns
    -------
    Axes
    """
    ax, T_r = _axes(ax), float(trajectory.protocol.T_r)
    shown = trajectory.t <= 1.1 * T_r
    for row in trajectory.sigma:
        ax.plot(trajectory.t[shown], row[shown], color="#0072B2", linewidth=0.9)
    reached = trajectory.reaching_times[trajectory.sigma0 != 0]
    if np.isfinite(reached).any():
        ax.plot(reached, np.zeros(reached.size), "o", color="#0072B2", markersize=3, label="$\\sigma_k$ reaches 0")
    if reaching is not None:
        proved = [r.time for r in reaching if r.z is None or r.z > 0]
        ax.plot(proved, [0.0] * len(proved), "|", color="#D55E00", markersize=12, label="proved at the latest")
    ax.axvline(T_r, color="black", linewidth=0.8, linestyle=":", label="$T_r$")
    ax.set_xlabel("time $t$")
    ax.set_ylabel("sliding variable $\\sigma_k$")
    _legend_above(ax)
    return ax


def plot_decay(certificate: Certificate, ax: Axes | None = None) -> Axes:
    """Draw ``||E(t)||`` of the simulated run under its proved bounds, on the axis ``1 - t/T``.

    Both axes are logarithmic; time runs to the right, towards the deadline. Dashed: the paper's certificate alone.
    Grey: the integrator's floor. If only Theorem 1.1's own coordinates were proved, ``||eps(t)||`` instead.

    Parameters
    ----------
    certificate : Certificate
        With a trajectory and a proved rate.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        There is nothing to draw.
    """
    run, envelope = certificate.trajectory, certificate.envelope
    if run is None or certificate.comparison is None or not envelope.members:
        raise ValueError("the certificate holds no simulated run with a proved bound")
    ax, before = _axes(ax), run.remaining > 0
    remaining, states = run.remaining[before], run.states[:, before]
    member = next(m for m in envelope.members if m.coordinates == envelope.coordinates)
    norm = np.linalg.norm(member.coordinates_of(states, certificate.graph.laplacian()), axis=0)
    bound = certificate.norm_bound(remaining)
    scale = float(norm[0]) or float(bound[0]) or 1.0
    ax.loglog(remaining, bound / scale, color="#D55E00", label="proved bound")
    paper = replace(envelope, members=tuple(m for m in envelope.members if m.kind == "paper"))
    if len(envelope.members) > 1 and paper.members and paper.coordinates == envelope.coordinates:
        alone = replace(certificate, sharpening=Sharpening()).norm_bound(remaining)
        ax.loglog(remaining, alone / scale, color="#D55E00", linewidth=0.9, linestyle="--", label="the paper's alone")
    if norm[0] > 0:
        ax.loglog(remaining, np.maximum(norm / scale, 1e-300), color="#0072B2", label="simulated (CVODES)")
        floor = FLOOR_FACTOR * run.rtol * float(np.abs(states).max()) * _row_sum(certificate)
        ax.axhline(floor / scale, color="#7F7F7F", linewidth=0.8, linestyle=":", label="integrator's floor")
        ax.set_ylim(bottom=max(float((norm / scale).min()), 1e-18) / 3)
    ax.invert_xaxis()
    ax.set_xlabel("time left, $1 - t/T$")
    name = "E" if envelope.coordinates == "E" else r"\varepsilon"
    ax.set_ylabel(rf"$\|{name}(t)\| / \|{name}(0)\|$")
    _legend_above(ax)
    return ax


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
    """
    ax, curve = _axes(ax), found.trade_off(found.deadlines())
    if np.isfinite(curve.certified).any():
        ax.loglog(curve.deadlines, curve.certified, color="#0072B2", label="certified with these gains")
    if np.isfinite(curve.lower).any():
        ax.fill_between(curve.deadlines, curve.lower * 1e-3, curve.lower, color="#7F7F7F", alpha=0.3, linewidth=0)
        ax.loglog(curve.deadlines, curve.lower, color="#7F7F7F", linestyle="--", label="no gains stay below")
        ax.set_ylim(bottom=float(np.nanmin(curve.lower)) / 3)
    ax.axhline(float(found.max_input), color="#D55E00", linewidth=0.9, linestyle=":", label="asked for")
    if found.protocol is not None and found.peak:
        ax.plot([float(found.protocol.T)], [float(found.peak)], "o", color="#0072B2", label="this design")
    ax.set_xlabel("deadline $T$")
    ax.set_ylabel(r"peak input $\|u\|_2$" if found.input_norm == 2 else r"peak input $\max_k |u_k|$")
    _legend_above(ax)
    return ax


def _row_sum(certificate: Certificate) -> float:
    """Bound ``||dz||`` for an error of 1 in every state."""
    if certificate.envelope.coordinates == "eps":
        return 2 * math.sqrt(certificate.graph.n_nodes)
    return float(np.linalg.norm(abs(certificate.graph.laplacian()).sum(axis=1)))


def _legend_above(ax: Axes) -> None:
    """Put the legend above the axes, where it covers no data."""
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize="small", frameon=False)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6, 3.6), layout="constrained").add_subplot()
