"""The error of a run under its proved bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain
from ptcc_certify.report.plots.runs_under_signals import (
    bound_label,
    is_worst,
    keeps_promise,
    line_of,
    no_bound_text,
    runs_of,
)
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.report.plots.subject import certifies_family, ideal_run_of, ideal_text, limits_text, require_same
from ptcc_certify.simulation.trajectory import Trajectory

#: Horizontal axes of the decay, and their labels; that of time has a unit.
DECAY_AXES = {"left": "remaining time, $1 - t/T$", "time": "time $t$", "clock": "stretched clock $s(t)$"}
#: What is drawn below the integrator's floor, as a share of it.
_BELOW_FLOOR = 1e-2
#: 1 - t/T down to which bounds are drawn where there is no run, and how many instants.
_LAST, _INSTANTS = 1e-8, 401
#: What is told where there is nothing to draw.
NONE = "nothing decays: every agent begins where it ends, or nearer to it than a run tells; draw its states"
#: What is said of curves of the plain protocol beside a run of what was asked, which the title names.
_WITHOUT = "without these"
#: The name of the best bound among those of the Lyapunov functions.
_BEST = "best"


class NothingDecays(ParameterError):
    """Agents begin where they end, as far as a run tells, and the bound says so, too: nothing is to be drawn."""


@styled
def plot_decay(
    subject: Any,
    *,
    ax: Axes | None = None,
    certificate: Certificate | None = None,
    runs: Sequence[Trajectory] | None = None,
    axis: str = "left",
    each: bool = True,
    time_unit: str = "",
) -> Axes:
    r"""Draw ``||E(t)|| / ||E(0)||``, ``E = -L X``, of a run under its proved bounds; the vertical axis is logarithmic.

    Thick: the bound ``min_i sqrt(e^(-rate_i s(t)) V_i(0) / lmin(P_i))``, the best of all proved Lyapunov functions at
    every instant. Thin: each of them. Dashed: the theorem's own. If only Theorem 1.1's own coordinates were proved,
    ``||eps(t)||`` instead. Through a reaching phase the bounds are integrated in floating point: numerical. The run,
    with circles, is drawn down to the integrator's floor, its tolerance times the size of the states times what ``E``
    multiplies them by: below, a run says nothing. Where limits of the gain, late messages or moving leaders were asked,
    that run is drawn; thin and grey behind it the best bound, and the run with circles, of the protocol without these.

    Of the certificate of a family ``max_k |x_k(t) - x_k(T)|`` under many signals is drawn below its bound for every
    signal, of those runs that have settled at ``T``, or of which it is proved where they end. Where no bound is drawn
    the legend says why.

    Parameters
    ----------
    subject : Certificate, its path, or Trajectory
        A certificate with an initial state and a proved rate; without a run its bounds alone are drawn
        (``certificate.with_simulation()`` adds one). A trajectory without ``certificate`` is drawn alone.
    ax : Axes, optional
    certificate : Certificate, optional
        Of the graph, protocol and initial state of a trajectory, whose bounds are drawn over it.
    runs : sequence of Trajectory, optional
        Of a family, by default under eight random signals and worst cases.
    axis : {"left", "time", "clock"}
        Horizontally the time left ``1 - t/T``, logarithmic, running towards the deadline; or the time ``t``; or the
        stretched clock ``s(t)``, on which each bound is a straight line where nothing but a rate is at work.
    each : bool
        Whether every Lyapunov function is drawn, or the best bound alone.
    time_unit : str
        Of the deadline, for the label of the axis of time.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        There is nothing to draw, the certificate is of another graph, protocol or initial state, or an unknown axis.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [plot_decay(cert, axis=name).get_xlabel() for name in ("left", "time", "clock")]
    ['remaining time, $1 - t/T$', 'time $t$', 'stretched clock $s(t)$']
    >>> [line.get_label() for line in plot_decay(cert.trajectory).lines]
    ['simulated (CVODES)', "integrator's floor"]
    """
    if axis not in DECAY_AXES:
        raise ParameterError(f'axis "{axis}" is unknown; one of {", ".join(DECAY_AXES)}')
    if certifies_family(subject):
        return _draw_signals(axes_of(ax), subject, runs_of(subject, runs), axis, time_unit)
    proved = subject if isinstance(subject, Certificate) else certificate
    run = None if isinstance(subject, Certificate) and subject.trajectory is None else ideal_run_of(subject)
    asked = subject.asked_trajectory if isinstance(subject, Certificate) and run is not None else None
    if proved is not None:
        _require_bounds(proved, run)
    remaining = np.geomspace(1, _LAST, _INSTANTS) if run is None else run.remaining[run.remaining > 0]
    norm, floor, unit = error_norm(subject if run is None else run, proved)
    bounds = {} if proved is None else _bounds(proved, remaining, unit, each, behind=asked is not None)
    best = bounds.get(_BEST, (np.full(remaining.size, np.inf), {}))[0]
    bounded = bool(bounds) and bool((best > _BELOW_FLOOR * floor).any())
    seen = np.full(norm.size, np.nan) if run is None else resolved(norm, best, floor)
    if not bounded and not np.isfinite(seen).any():
        raise NothingDecays(NONE)
    scale = float(norm[0] if norm[0] > floor else 0) or (float(best[0]) if bounds else 0.0) or float(norm.max())
    place = _places(subject.protocol.gain, run, remaining)[axis]
    ax = axes_of(ax)
    for values, style in bounds.values():
        ax.plot(place, values / scale, **style)
    bottom, last = max(float(np.nanmin(best)), 1e-16 * scale), remaining.size - 1
    top = float(max(scale, best[np.isfinite(best)].max(initial=0.0)))
    if run is not None and norm.any():
        bottom = max(_BELOW_FLOOR * floor, min(float(norm.min()), bottom) / 3)
        _draw_run(ax, place, seen / scale, floor / scale, bottom / scale, behind=asked is not None)
        last = int(np.flatnonzero(((best if bounds else norm) >= bottom) | (seen > best))[-1])
        top = max(top, float(np.nan_to_num(seen).max()))  # a violated bound stays in sight
    if asked is not None:
        norm, floor, _ = error_norm(asked, proved)
        seen = np.where(norm > floor, norm, np.nan)
        top = max(top, float(np.nan_to_num(seen).max()))
        where = _places(asked.protocol.gain, None, asked.remaining[asked.remaining > 0])[axis]
        ax.plot(where, seen / scale, color=RUN, linewidth=1.1, label="simulated, as asked")
    _scale(ax, axis, place[[0, max(last, 1)]], (bottom / scale, 3 * top / scale))
    p = subject.protocol
    if p.reaching is not None and (proved is None or not proved.direct):
        (at,) = _places(p.gain, None, np.array([float(p.span / p.T)]))[axis]
        ax.axvline(at, color="black", linewidth=0.8, linestyle=(0, (5, 2, 1, 2)), label="$T_r$")
    name = r"\varepsilon" if proved is not None and proved.graph_proof.envelope.coordinates == "eps" else "E"
    if run is None:
        title = f"without what was asked: {without}" if (without := ideal_text(subject)) else ""
    else:
        title = limits_text(run if asked is None else asked, proved)
    return finished(ax, axis_label(axis, time_unit), rf"$\|{name}(t)\| \,/\, \|{name}(0)\|$", title)


def _draw_signals(ax: Axes, certificate: Certificate, runs: Sequence[Trajectory], axis: str, time_unit: str) -> Axes:
    """Draw how far agents are from their final states under many signals below the bound for every signal."""
    first = runs[0]
    before = first.remaining > 0
    bound = certificate.proof.deviation_bound(first.remaining[before]).max(axis=0)
    bounded = bool(np.isfinite(bound).any())
    place = {"left": first.remaining, "time": first.t, "clock": first.clock}[axis][before]
    floor = FLOOR_FACTOR * first.rtol * (float(np.abs(first.states[:, 0]).max()) or 1.0)
    if not (bound >= floor).any():
        raise NothingDecays(NONE)
    seen = [bound if bounded else np.zeros(bound.size)]
    own = certificate.family_proof.signal == "any" or keeps_promise(certificate, runs)
    names = {False: "random signals" if own else "any signal (random)", True: "worst cases found"}
    known = _known_end(certificate)
    for run in sorted(runs, key=is_worst):
        end = run.final_state if run.deadline_resolved else known
        if end is not None and np.array_equal(run.t, first.t):
            gap = np.abs(run.states[:, before] - end[:, None]).max(axis=0)
            ax.plot(place, np.where(gap > floor, gap, np.nan), label=names.pop(is_worst(run), None), **line_of(run))
            seen.append(gap)
    if bounded:
        ax.plot(place, bound, color=BOUND, linewidth=1.8, label=bound_label(certificate), zorder=4)
    top = np.max(np.where(np.isfinite(seen), seen, 0), axis=0)
    if not (top > floor).any():
        raise ParameterError(f"{no_bound_text(certificate)}, and no run has settled; draw its states")
    _draw_floor(ax, floor, floor / 10)
    last = int(np.flatnonzero((bound if bounded else top) >= floor / 10)[-1])
    _scale(ax, axis, place[[0, max(last, 1)]], (floor / 10, 3 * float(top.max())))
    title = "" if bounded else no_bound_text(certificate)
    return finished(ax, axis_label(axis, time_unit), r"$\max_k |x_k(t) - x_k(T)|$", title)


def _known_end(certificate: Certificate) -> np.ndarray | None:
    """Return the state at ``T`` if it is proved to be the same for every signal."""
    ends = [one for one in certificate.family_proof.final_state or () if one is not None]
    same = len(ends) == certificate.family_proof.family.n_nodes and all(low == high for low, high in ends)
    return np.array([float(low) for low, _ in ends]) if same else None


def _scale(ax: Axes, axis: str, ends: np.ndarray, limits: tuple[float, float]) -> None:
    """Set the scales and limits of both axes."""
    ax.set_yscale("log")
    ax.set_ylim(*limits)
    ax.set_xscale("log" if axis == "left" else "linear")
    ax.set_xlim(*ends)


def axis_label(axis: str, time_unit: str) -> str:
    """Return the label of one of :data:`DECAY_AXES`."""
    return time_label(DECAY_AXES[axis], time_unit) if axis == "time" else DECAY_AXES[axis]


def _draw_floor(ax: Axes, floor: float, bottom: float) -> None:
    """Draw the floor below which a run says nothing."""
    ax.axhspan(bottom, floor, color=BEHIND, alpha=0.12, linewidth=0)
    ax.axhline(floor, color=BEHIND, linewidth=0.9, linestyle=":", label="integrator's floor")


def error_norm(subject: Certificate | Trajectory, certificate: Certificate | None) -> tuple[np.ndarray, float, float]:
    """Return ``||z||`` at the instants before the deadline, the integrator's floor, and the unit of both.

    ``z`` is ``E``, or the ``eps`` in which a certificate's bounds are. The unit is the largest state, in which squares
    neither overflow nor vanish. Of a certificate without a run the first instant alone is there.
    """
    if isinstance(subject, Trajectory):
        graph, states, tolerance = subject.graph, subject.states[:, subject.remaining > 0], subject.rtol
    else:
        graph, tolerance = subject.graph_proof.graph, 0.0
        states = np.array([[float(x)] for x in subject.initial_state or ()])
    laplacian = graph.laplacian()
    unit = float(np.abs(states).max(initial=0)) or 1.0
    if certificate is not None and certificate.graph_proof.envelope.coordinates == "eps":
        z = certificate.graph_proof.envelope.functions[0].coordinates_of(states / unit, laplacian)
        multiple = 2 * math.sqrt(len(states))  # bounds ||dz|| for an error of 1 in every state
    else:
        z, multiple = laplacian @ (states / unit), float(np.linalg.norm(abs(laplacian).sum(axis=1)))
    return np.linalg.norm(z, axis=0), FLOOR_FACTOR * tolerance * multiple, unit


def resolved(norm: np.ndarray, bound: np.ndarray, floor: float) -> np.ndarray:
    """Return the norm where a run says something of it: above the integrator's floor, and where the bound is.

    Where the bound lies below the floor, only what exceeds it by more than the floor is shown: a violation.
    """
    return np.where((norm > floor) & ((bound > floor) | (norm > bound + floor)), norm, np.nan)


def _require_bounds(certificate: Certificate, run: Trajectory | None) -> None:
    if certificate.initial_state is None:
        raise ParameterError("the certificate has no initial state, from which something decays; certify with x0")
    if not certificate.graph_proof.envelope.functions:
        raise ParameterError("the certificate holds no proved bound of a decay")
    if run is not None:
        require_same(run, certificate)


def _places(gain: Gain, run: Trajectory | None, remaining: np.ndarray) -> dict[str, np.ndarray]:
    """Return where the instants lie on each of the horizontal axes."""
    clock = np.asarray(gain.clock_at_remaining(remaining)) if run is None else run.clock[: remaining.size]
    return {"left": remaining, "time": float(gain.T) * (1 - remaining), "clock": clock}


def _bounds(
    certificate: Certificate, remaining: np.ndarray, unit: float, each: bool, *, behind: bool
) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    """Return the bounds of every Lyapunov function in the norm, and the best of all, with how they are drawn.

    Behind a run that they do not bound the best stands alone.
    """
    envelope, x0 = certificate.graph_proof.envelope, certificate.initial_state
    functions = [m for m in envelope.functions if m.coordinates == envelope.coordinates]
    bounds: dict[str, tuple[np.ndarray, dict[str, Any]]] = {}
    label: str | None = "each Lyapunov function"
    for function in functions if each and not behind and len(functions) > 1 else ():
        values = replace(envelope, functions=(function,)).norm_bound(remaining, x0) / unit
        if function.kind == "paper":
            style: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": "--", "zorder": 2.1}
            style["label"] = f"bound of {certificate.graph_proof.theorems_named}"
        else:
            style = {"color": BOUND, "linewidth": 0.6, "alpha": 0.6, "linestyle": "-.", "label": label}
            label = None
        bounds[function.name] = values, style
    best = envelope.norm_bound(remaining, x0) / unit
    if behind:
        return {_BEST: (best, {"color": BEHIND, "linewidth": 0.8, "label": f"proved {_WITHOUT}"})}
    label = "proved bound from $x(0)$" if certificate.direct else "bound from $x(0)$ (numerical)"
    return bounds | {_BEST: (best, {"color": BOUND, "linewidth": 1.8, "label": label})}


def _draw_run(ax: Axes, place: np.ndarray, seen: np.ndarray, floor: float, bottom: float, *, behind: bool) -> None:
    """Draw what a run says, and the floor below which it says nothing, if that is in sight.

    Where it is not the run that was asked for it stands ``behind`` that.
    """
    if np.isfinite(seen).any():
        marks: dict[str, Any] = {"marker": "o", "markersize": 2.8, "markerfacecolor": "white", "markevery": 0.1}
        colour, label = (BEHIND, f"simulated {_WITHOUT}") if behind else (RUN, "simulated (CVODES)")
        ax.plot(place, seen, color=colour, linewidth=1.1, label=label, **marks)
    if bottom < floor:
        _draw_floor(ax, floor, bottom)
