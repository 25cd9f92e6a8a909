"""How far agents are from where they should be, with late messages or leaders that move, under what is proved of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.certificate.asked_run import late_run
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.errors import Change, ParameterError
from ptcc_certify.report.plots.decay import NONE, NothingDecays
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.report.plots.subject import certificate_of, certifies_family
from ptcc_certify.simulation.trajectory import Trajectory

#: How runs with late messages are drawn, by how old is what agents hear.
_RUNS: dict[str, dict[str, Any]] = {
    "oldest": {"color": RUN, "linewidth": 1.1, "label": "as late as allowed"},
    "square": {"color": BEHIND, "linewidth": 0.8, "linestyle": "--", "label": "now late, now not"},
}
#: What is proved at ``T`` alone is drawn below this share of what is proved over time.
_NEARER = 0.5
#: A lower bound at ``T`` is drawn from this share of the upper one on.
_SEEN = 1e-3


#: Bounds below which nothing is to be seen.
_NOTHING = 1e-200


@styled
def plot_tracking(subject: Any, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw how far the farthest agent is from where it should be, under the proved bound.

    While messages are late that is its final state, in the runs the farther off, the later messages are; where delays
    are too short for runs the bound is drawn alone. Where leaders move, in the runs away from the farthest follower as
    fast as they may, it is the target of the follower.

    Parameters
    ----------
    subject : Certificate
        With late messages or moving leaders, and an initial state; of a family the bound is drawn alone.
    ax : Axes, optional
    time_unit : str
        Of time on the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        No certificate, or one that says nothing of late messages or moving leaders, or has no initial state.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    >>> p = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> cert = certify(graph, p, [1, 0, 2], messages=LateMessages(delay="0.05"), asks=Asks(simulation=False))
    >>> [line.get_label() for line in plot_tracking(cert).lines]
    ['as late as allowed', 'now late, now not', 'proved bound', 'at least, if as late as allowed']
    >>> cert = certify(graph, p, [1, 0, 2], leaders=MovingLeaders(speed=1), asks=Asks(simulation=False))
    >>> [line.get_label() for line in plot_tracking(cert).lines]
    ['worst leaders', 'proved bound', '$T$']
    """
    certificate = subject if certifies_family(subject) else certificate_of(subject)
    late, x0 = certificate.proof.late, certificate.initial_state
    if late is None or not late.says_something:
        what = "the certificate says nothing of late messages or of leaders that move; certify with "
        raise ParameterError((what, Change("delay"), " or ", Change("leader_speed")))
    T = float(certificate.protocol.T)
    t = np.linspace(0, T, 401)
    if (late.of_followers or late.of_all) and late.largest_bound(t).max() < _NOTHING:
        raise NothingDecays(NONE)
    ax = axes_of(ax)
    if not certificate.of_family:
        if x0 is None or certificate.proof.final_state is None:
            raise ParameterError("the certificate has no initial state to run from; certify with x0")
        t = _draw_runs(ax, certificate.graph_proof, late)
    _draw_bound(ax, late, t)
    if late.tracks:
        ax.axvline(T, color=BEHIND, linewidth=0.8, linestyle=":", label="$T$")
        ax.set_ylim(bottom=0)
    ax.set_xlim(0, t[-1])
    moving = "" if late.leaders is None else "(t)"
    return finished(ax, time_label("time $t$", time_unit), rf"$\max_k |x_k(t) - x_k^*{moving}|$")


def _draw_runs(ax: Axes, proof: GraphProof, late: LateBounds) -> np.ndarray:
    """Draw the runs of one graph; return their instants."""
    nodes, ends = proof.structure.followers, np.asarray(proof.final_state, dtype=float)
    if not nodes.size or late.vehicles is not None or late.of_all:
        nodes = np.arange(proof.graph.n_nodes)
    t = np.linspace(0, float(proof.protocol.T), 401)
    for run, style in _runs(proof, late):
        aims = ends[:, None] if run.targets is None else run.targets
        ax.plot(run.t, np.abs(run.states - aims)[nodes].max(axis=0), **style)
        t = run.t
    return t


def _runs(proof: GraphProof, late: LateBounds) -> list[tuple[Trajectory, dict[str, Any]]]:
    """Return the runs that are drawn, and how."""
    drawn: list[tuple[dict[str, Any], dict[str, Any]]] = []
    if late.vehicles is not None:
        drawn = [({}, {"color": RUN, "linewidth": 1.1, "label": "vehicles"})]
    elif late.tracks:
        drawn = [({"steps": 400}, {"color": RUN, "linewidth": 1.1, "label": "worst leaders"})]
    elif not late.messages.age and not late.case.signed:
        drawn = [({}, {**_RUNS["oldest"], "label": "values as far off as allowed"})]
    elif not late.case.signed:
        drawn = [({"pattern": pattern}, style) for pattern, style in _RUNS.items()]
    runs = [(late_run(proof, late, **options), style) for options, style in drawn]
    return [(run, style) for run, style in runs if run is not None]


def _draw_bound(ax: Axes, late: LateBounds, t: np.ndarray) -> None:
    """Draw what is proved, and what is the least that a bound can be."""
    if not late.tracks:
        ax.set_yscale("log")
    if late.of_followers or late.of_all:
        over_time = late.largest_bound(t)
        ax.plot(t, over_time, color=BOUND, linewidth=1.8, label="proved bound")
        nearer = not late.tracks and 0 < late.largest < _NEARER * float(over_time[-1])
    else:
        nearer = late.form is not None
    if nearer:  # another proof, which says nothing of what is before T
        ax.plot(t[-1:], [late.largest], marker="_", color=BOUND, markersize=12, label="proved at $T$", linestyle="none")
    if late.missed is not None and late.missed.bound >= _SEEN * late.largest:
        marks: dict[str, Any] = {"marker": "v", "color": BOUND, "linestyle": "none", "markersize": 4, "clip_on": False}
        ax.plot(t[-1:], [float(late.missed.bound)], label="at least, if as late as allowed", **marks)
