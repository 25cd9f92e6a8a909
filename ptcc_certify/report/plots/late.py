"""Figures of late messages and of moving leaders: runs under the bounds that were proved."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.late_messages import LateBounds
from ptcc_certify.bounds.tracking import Tracking
from ptcc_certify.errors import ParameterError
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.report.plots.subject import certificate_of
from ptcc_certify.simulation.late_messages import can_run, simulate_late
from ptcc_certify.simulation.moving_leaders import simulate_tracking

#: How runs with late messages are drawn, by how old is what agents hear.
_RUNS: dict[str, dict[str, Any]] = {
    "oldest": {"color": RUN, "linewidth": 1.1, "label": "as late as allowed"},
    "square": {"color": BEHIND, "linewidth": 0.8, "linestyle": "--", "label": "now late, now not"},
}

#: A lower bound at ``T`` is drawn from this share of the upper one on.
_SEEN = 1e-3


@styled
def plot_late(subject: Any, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw how far the farthest agent is from its final state while messages are late, under the proved bound.

    Where delays are too short for runs, the bound alone. Where leaders move, in the runs away from the farthest
    follower as fast as they may, how far that is from its target.

    Parameters
    ----------
    subject : Certificate
        With late messages and an initial state.
    ax : Axes, optional
    time_unit : str
        Of time on the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        No certificate, or one that says nothing of late messages, or has no initial state.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    >>> p = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> cert = certify(graph, p, [1, 0, 2], messages=LateMessages(delay="0.05"), asks=Asks(simulation=False))
    >>> [line.get_label() for line in plot_late(cert).lines]
    ['as late as allowed', 'now late, now not', 'proved bound', 'at least, if as late as allowed']
    """
    certificate = certificate_of(subject)
    late, x0, ends = certificate.late, certificate.initial_state, certificate.final_state
    if late is None or not late.says_something:
        raise ParameterError("the certificate says nothing of late messages; certify with messages, or --delay")
    if x0 is None or ends is None:
        raise ParameterError("the certificate has no initial state to run from; certify with x0")
    ax, F = axes_of(ax), certificate.structure.followers
    nodes = F if F.size and late.settling is None and late.lmi is None else np.arange(certificate.graph.n_nodes)
    start, goal = [float(x) for x in x0], np.asarray(ends, dtype=float)[:, None]
    options: dict[str, Any] = {"leaders": late.leaders}
    t = np.linspace(0, float(certificate.protocol.T), 401)
    for pattern, style in _RUNS.items() if can_run(certificate.protocol, late.messages) else ():
        options["pattern"] = pattern
        run = simulate_late(certificate.graph, certificate.protocol, late.messages, start, **options)
        t = run.t
        aims = goal if run.targets is None else run.targets
        ax.plot(t, np.abs(run.states - aims)[nodes].max(axis=0), **style)
    _draw_bound(ax, late, t)
    if late.missed is not None and late.missed.bound >= _SEEN * late.largest:
        marks: dict[str, Any] = {"marker": "v", "color": BOUND, "linestyle": "none", "markersize": 4, "clip_on": False}
        ax.plot(t[-1:], [float(late.missed.bound)], label="at least, if as late as allowed", **marks)
    ax.set_yscale("log")
    ax.set_xlim(0, t[-1])
    moving = "(t)" * (late.leaders is not None)
    return finished(ax, time_label("time $t$", time_unit), rf"$\max_k |x_k(t) - x_k^*{moving}|$")


def _draw_bound(ax: Axes, late: LateBounds, t: np.ndarray) -> None:
    if late.rows or late.steps is not None or late.settling is not None or late.lmi is not None:
        ax.plot(t, late.largest_bound(t), color=BOUND, linewidth=1.8, label="proved bound")
    elif late.form is not None:
        ax.plot(t[-1:], [late.largest], marker="_", color=BOUND, markersize=12, label="proved at $T$", linestyle="none")


@styled
def plot_tracking(subject: Any, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw how far the farthest follower is from its target while leaders move away as fast as they may.

    Parameters
    ----------
    subject : Certificate
        With moving leaders and an initial state.
    ax : Axes, optional
    time_unit : str
        Of time on the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        No certificate, or one that says nothing of moving leaders, or has no initial state.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    >>> p = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> cert = certify(graph, p, [1, 0, 2], leaders=MovingLeaders(speed=1), asks=Asks(simulation=False))
    >>> [line.get_label() for line in plot_tracking(cert).lines]
    ['worst leaders', 'proved bound', '$T$']
    """
    certificate = certificate_of(subject)
    tracking, x0 = certificate.tracking, certificate.initial_state
    if tracking is None:
        raise ParameterError("the certificate says nothing of moving leaders; certify with leaders, or --leader-speed")
    if x0 is None:
        raise ParameterError("the certificate has no initial state to run from; certify with x0")
    ax, T, u = axes_of(ax), float(certificate.protocol.T), tracking.witness.u
    run = simulate_tracking(
        certificate.graph, certificate.protocol, tracking.leaders, [float(x) for x in x0], u=u, steps=400
    )
    away = np.abs(run.states - run.targets)[certificate.structure.followers]
    ax.plot(run.t, away.max(axis=0), color=RUN, linewidth=1.1, label="worst leaders")
    ax.plot(run.t, _tracking_bound(tracking, run.t, T), color=BOUND, linewidth=1.8, label="proved bound")
    ax.axvline(T, color=BEHIND, linewidth=0.8, linestyle=":", label="$T$")
    ax.set_xlim(0, run.t[-1])
    ax.set_ylim(bottom=0)
    return finished(ax, time_label("time $t$", time_unit), r"$\max_k |x_k(t) - x_k^*(t)|$")


def _tracking_bound(tracking: Tracking, t: np.ndarray, T: float) -> np.ndarray:
    """Return the bound before T, and from there on."""
    before = tracking.distance_bound(np.maximum(1 - t / T, 0)).max(axis=0)
    rate = float(tracking.witness.b * tracking.protocol.gain.rho1)
    later = -np.expm1(-rate * np.maximum(t - T, 0))  # m' <= -a rho1 m + c from m(T) = 0
    return np.where(t <= T, before, tracking.distance_after * later)
