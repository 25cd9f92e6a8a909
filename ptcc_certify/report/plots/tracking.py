"""How far agents are from where they should be, with late messages or leaders that move, under what is proved of it."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.certificate.evidence import late_run
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.errors import Change, ParameterError
from ptcc_certify.report.plots.decay import NONE, NothingDecays, axis_label
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled
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
#: If a bound falls to less than this share the axis is of the time that remains, until it is so near to what is left at
#: ``T``, and never nearer to ``T`` than the last.
_SMALL, _NEAR, _LAST = 1e-2, 1.05, 1e-6
#: Instants of a bound that is drawn alone.
_INSTANTS = 401


@styled
def plot_tracking(
    subject: Any, *, ax: Axes | None = None, axis: Literal["left", "time"] | None = None, time_unit: str = ""
) -> Axes:
    """Draw how far the farthest agent is from where it should be, under the proved bound.

    While messages are late that is its final state, in the runs the farther off, the later messages are; where delays
    are too short for runs the bound is drawn alone. Where leaders move, in the runs away from the farthest follower as
    fast as they may, it is the target of the follower.

    Parameters
    ----------
    subject : Certificate
        With late messages or moving leaders, and an initial state; of a family the bound is drawn alone.
    ax : Axes, optional
    axis : {"left", "time"}, optional
        Horizontally the time left ``1 - t/T``, logarithmic, running towards the deadline; or the time ``t``. By default
        the time left if less than a hundredth of the bound is left at ``T``, and after it where leaders move.
    time_unit : str
        Of time on the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        No certificate, or one that says nothing of late messages or moving leaders, or has no initial state; or an
        unknown axis.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    >>> p = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> cert = certify(graph, p, [1, 0, 2], messages=LateMessages(delay="0.05"), asks=Asks(simulation=False))
    >>> ax = plot_tracking(cert)
    >>> [line.get_label() for line in ax.lines]
    ['as late as allowed', 'now late, now not', 'proved bound', 'at least, if as late as allowed']
    >>> ax.get_xlabel(), plot_tracking(cert, axis="time").get_xlabel()
    ('remaining time, $1 - t/T$', 'time $t$')
    >>> cert = certify(graph, p, [1, 0, 2], leaders=MovingLeaders(speed=1), asks=Asks(simulation=False))
    >>> [line.get_label() for line in plot_tracking(cert).lines]
    ['worst leaders', 'proved bound', '$T$']
    """
    certificate = subject if certifies_family(subject) else certificate_of(subject)
    late, x0 = certificate.proof.late, certificate.initial_state
    if late is None or not late.says_something:
        what = "the certificate says nothing of late messages or of leaders that move; certify with "
        raise ParameterError((what, Change("delay"), " or ", Change("leader_speed")))
    if axis not in (None, "left", "time"):
        raise ParameterError("axis", f"= {axis!r} is unknown; one of left, time")
    T = float(certificate.protocol.T)
    left = np.unique(np.concatenate([np.geomspace(1, _LAST / 10, _INSTANTS), np.linspace(1, 0, _INSTANTS)]))[::-1]
    t, bounded = T * (1 - left), bool(late.of_followers or late.of_all)
    bound = late.largest_bound(t) if bounded else np.full(t.size, np.inf)
    if bound.max() < _NOTHING:
        raise NothingDecays(NONE)
    runs: list[tuple[Trajectory, dict[str, Any]]] = []
    if not certificate.of_family and (x0 is None or certificate.proof.final_state is None):
        raise ParameterError("the certificate has no initial state to run from; certify with x0")
    if x0 is not None:
        runs = _runs(certificate.proof, late)
    after = runs[-1][0].t if runs else t
    if axis is None:
        small = bounded and max(bound[-1], *late.largest_bound(after[after >= T])) < _SMALL * bound[0]
        axis = "left" if small else "time"
    ax = axes_of(ax)
    drawn = [_draw_run(ax, certificate.proof, late, run, axis, style) for run, style in runs]
    if axis == "time" and runs:
        t = after
        bound = late.largest_bound(t) if bounded else np.full(t.size, np.inf)
    place = left if axis == "left" else t
    if bounded:
        ax.plot(place, bound, color=BOUND, linewidth=1.8, label="proved bound")
    if axis == "left":
        near = left[(bound > _NEAR * bound[-1]) & (left > 0)].min(initial=1.0)
        end = max(_LAST, near / 2)
        ax.set(xscale="log", yscale="log", xlim=(1, end))
        shown, low = bound[(left >= end) & (bound > 0)], [far[place >= end].min() for place, far in drawn]
        ax.set_ylim(max(min([shown.min() / 1.5, *low]) / 2, shown.min() * _SEEN), 2 * shown.max())
    else:
        end = t[-1]
        ax.set_xlim(0, end)
        if late.tracks:
            ax.axvline(T, color=BEHIND, linewidth=0.8, linestyle=":", label="$T$")
            ax.set_ylim(bottom=0)
        else:
            ax.set_yscale("log")
    _draw_marks(ax, late, float(end), float(bound[-1]) if bounded else None)
    moving = "" if late.leaders is None else "(t)"
    return finished(ax, axis_label(axis, time_unit), rf"$\max_k |x_k(t) - x_k^*{moving}|$")


def _draw_run(
    ax: Axes, proof: GraphProof | FamilyProof, late: LateBounds, run: Trajectory, axis: str, style: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw how far the agents of a run are from where they should be; return where on the axis, and how far."""
    nodes = late.followers
    if not nodes.size or late.vehicles is not None or late.of_all:
        nodes = np.arange(len(late.labels))
    aims = np.asarray(proof.final_state, dtype=float)[:, None] if run.targets is None else run.targets
    far = np.abs(run.states - aims)[nodes].max(axis=0)
    place = 1 - run.t / float(proof.protocol.T) if axis == "left" else run.t
    if axis == "left":
        place, far = place[place > 0], far[place > 0]
    ax.plot(place, far, **style)
    return place, far


def _runs(proof: GraphProof | FamilyProof, late: LateBounds) -> list[tuple[Trajectory, dict[str, Any]]]:
    """Return the runs that are drawn, and how."""
    drawn: list[tuple[dict[str, Any], dict[str, Any]]] = []
    if late.vehicles is not None:
        drawn = [({}, {"color": RUN, "linewidth": 1.1, "label": "vehicles"})]
    elif late.tracks:
        worst = "worst leaders" if late.leaders is not None and late.leaders.speed else "run"
        drawn = [({"steps": 400}, {"color": RUN, "linewidth": 1.1, "label": worst})]
    elif not late.messages.age and not late.case.signed:
        drawn = [({}, {**_RUNS["oldest"], "label": "values as far off as allowed"})]
    elif not late.case.signed:
        drawn = [({"pattern": pattern}, style) for pattern, style in _RUNS.items()]
    runs = [(late_run(proof, late, **options), style) for options, style in drawn]
    return [(run, style) for run, style in runs if run is not None]


def _draw_marks(ax: Axes, late: LateBounds, end: float, bound: float | None) -> None:
    """Draw at ``T``, where the axis ends, what is proved there alone, and what is the least that a bound can be."""
    nearer = late.form is not None if bound is None else not late.tracks and 0 < late.largest < _NEARER * bound
    low: list[float] = [ax.get_ylim()[0]]
    if nearer:  # another proof, which says nothing of what is before T
        ax.plot([end], [late.largest], marker="_", color=BOUND, markersize=12, label="proved at $T$", linestyle="none")
        low.append(late.largest / 2)
    if late.missed is not None and late.missed.bound >= _SEEN * late.largest:
        marks: dict[str, Any] = {"marker": "v", "color": BOUND, "linestyle": "none", "markersize": 4, "clip_on": False}
        ax.plot([end], [float(late.missed.bound)], label="at least, if as late as allowed", **marks)
        low.append(float(late.missed.bound) / 2)
    ax.set_ylim(bottom=min(low))
