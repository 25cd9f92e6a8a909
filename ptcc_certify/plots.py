"""Figures: Axes in, Axes out. Nothing is shown or saved here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ptcc_certify.simulation import Trajectory
from ptcc_certify.structure import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ptcc_certify.certificate import Certificate

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
        ax.axvline(float(trajectory.protocol.T), color="black", linewidth=0.8, linestyle=":", label="deadline $T$")
    ax.set_xlabel("time $t$")
    ax.set_ylabel("state $x_k$")
    _legend_above(ax)
    return ax


def plot_decay(certificate: Certificate, ax: Axes | None = None) -> Axes:
    """Draw ``sqrt(V(t)/V(0))`` of the simulated run under its proved bound, on the axis ``1 - t/T``.

    Both axes are logarithmic; time runs to the right, towards the deadline. Grey: the integrator's floor.

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
    run, seen = certificate.trajectory, certificate.comparison
    if run is None or seen is None:
        raise ValueError("the certificate holds no simulated run with a proved bound")
    ax = _axes(ax)
    member = certificate.envelope.members[0]
    z = member.coordinates_of(run.states, run.graph.laplacian())
    root = np.sqrt(member.value(z))
    before = run.remaining > 0
    remaining = run.remaining[before]
    ax.loglog(remaining, np.exp(-member.rate * run.clock[before] / 2), color="#D55E00", label="proved bound")
    if root[0] > 0:
        ax.loglog(remaining, np.maximum(root[before] / root[0], 1e-300), color="#0072B2", label="simulated (CVODES)")
        ax.axhline(
            seen.floor * seen.tolerance, color="#7F7F7F", linewidth=0.8, linestyle=":", label="integrator's floor"
        )
        lowest = float((root[before] / root[0]).min())
        ax.set_ylim(bottom=max(lowest, 1e-18) / 3)
    ax.invert_xaxis()
    ax.set_xlabel("time left, $1 - t/T$")
    ax.set_ylabel(r"$\sqrt{V(t)/V(0)}$")
    _legend_above(ax)
    return ax


def _legend_above(ax: Axes) -> None:
    """Put the legend above the axes, where it covers no data."""
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize="small", frameon=False)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6, 3.6), layout="constrained").add_subplot()
