"""Runs of a family of graphs under many signals, within what is proved for every signal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.certificate.family_comparison import worst_case_signals
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, find_camps
from ptcc_certify.protocols.restricted_signals import ClockShares, DwellTime, JointWindows
from ptcc_certify.report.plots.agents import CAMP_STYLES, NAMED_AGENTS, draw_deadlines, family_groups, name_agents
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.simulation.family_run import FamilyTrajectory, simulate_family
from ptcc_certify.simulation.signals import ConstantSignal, PeriodicSignal, RandomDwellSignal, RandomSignal, Signal

#: Random signals that are drawn beside the worst cases.
_RANDOM = 8
#: Periods of the clock in which modes have their shares.
_PERIODS = (0.25, 0.5, 1.0, 2.0, 4.0)
#: Samples of runs that begin off the sliding manifold: half as many, since there are as many again before ``T_r``.
_SAMPLES = 101
#: The bar of a final interval.
BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "_", "markersize": 5}
_AXES = {"left": "remaining time, $1 - t/T$", "time": "time $t$", "clock": "stretched clock $s(t)$"}


def sample_runs(certificate: FamilyCertificate, signals: Iterable[Signal] | None = None) -> list[FamilyTrajectory]:
    """Return runs from a certificate's initial state.

    Parameters
    ----------
    certificate : FamilyCertificate
    signals : iterable of Signal, optional
        By default eight random ones, and worst cases; of a certificate for constant signals, a dwell time, shares or
        windows signals of that kind.

    Raises
    ------
    ParameterError
        The certificate has no initial state.
    """
    if certificate.initial_state is None:
        raise ParameterError("the certificate has no initial state; certify the family with x0")
    chosen = _signals(certificate) if signals is None else signals
    start = [float(x) for x in certificate.initial_state]
    more: dict[str, Any] = {}
    if certificate.sigma0 is not None:
        more = {"sigma0": [float(s) for s in certificate.sigma0], "samples": _SAMPLES}
    return [simulate_family(certificate.family, certificate.protocol, start, signal, **more) for signal in chosen]


def _signals(certificate: FamilyCertificate) -> list[Signal]:
    """Return signals of the kind that was asked for; where that is any random ones, and worst cases."""
    return _of_the_kind(certificate) or [*map(RandomSignal, range(_RANDOM)), *worst_case_signals(certificate)]


def _of_the_kind(certificate: FamilyCertificate) -> list[Signal]:
    """Return signals that keep what a certificate was asked of; none where that is any, or where none is known."""
    signal, modes = certificate.signal, certificate.family.modes
    if isinstance(signal, DwellTime):
        return [RandomDwellSignal(signal, seed) for seed in range(_RANDOM)]
    if signal == "constant":
        levels = (0.0, 0.5, 1.0) if not all(mode.known.all() for mode in modes) else (0.5,)
        members = [ConstantSignal(i, level) for i in range(len(modes)) for level in levels]
        return list(members[:: math.ceil(len(members) / _RANDOM)])
    if isinstance(signal, ClockShares):
        shares = [(i, float(share)) for i, share in enumerate(signal.shares) if share]
        return [PeriodicSignal([(i, share * period) for i, share in shares]) for period in _PERIODS]
    if isinstance(signal, JointWindows) and len(modes) * signal.on <= signal.length:
        word = [(i, float(signal.length) / len(modes)) for i in range(len(modes))]
        return [PeriodicSignal(word[k:] + word[:k]) for k in range(min(len(word), _RANDOM))]
    return []


def keeps_promise(certificate: FamilyCertificate, runs: Sequence[FamilyTrajectory]) -> bool:
    """Tell whether runs are those under signals of the kind that a certificate was asked of."""
    own = {signal.text for signal in _of_the_kind(certificate)}
    return all(run.signal in own for run in runs)


def family_camps(family: Family) -> np.ndarray | None:
    """Return the camp, of ``CAMP_STYLES``, of every node that all edges of all modes keep; None if there are none.

    Examples
    --------
    >>> family_camps(ptcc.as_family([("a", "b", -2, -1)])).tolist()
    ['first camp', 'second camp']
    """
    gauge, violated, _ = find_camps(family.n_nodes, *family.union)
    return None if violated.size else np.where(gauge > 0, "first camp", "second camp").astype(object)


@styled
def plot_family(
    subject: FamilyCertificate,
    *,
    ax: Axes | None = None,
    runs: Sequence[FamilyTrajectory] | None = None,
    time_unit: str = "",
) -> Axes:
    """Draw the states ``x_k(t)`` under many signals, within what is proved for every signal.

    Thin lines are runs under given or random signals, thicker ones under worst cases, in the colours and lines of the
    camps: those of the consensus, or what agents are in every mode. Shaded: where those of a camp are for every signal,
    the final interval of each widened by the bound of ``|x_k(t) - x_k(T)|``, and never beyond the largest state. Bars
    behind ``T``: the final intervals. Of more than eight agents those are drawn that begin highest and lowest.

    Parameters
    ----------
    subject : FamilyCertificate
        With an initial state.
    ax : Axes, optional
    runs : sequence of FamilyTrajectory, optional
        By default under eight random signals and worst cases.
    time_unit : str
        Of the deadline, for the label of the axis: ``"s"``.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject is no certificate of a family, or has no initial state.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.certificate.family_certificate import certify_family
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "0.5", "1.5")])
    >>> ax = plot_family(certify_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]), time_unit="s")
    >>> ax.get_xlabel(), [text.get_text() for text in ax.get_legend().get_texts()][-3:]
    ('time $t$ (s)', ['proved for every signal', 'final states, proved', 'deadline $T$'])
    """
    runs, ax = runs_of(subject, runs), axes_of(ax)
    first = runs[0]
    groups = family_camps(subject.family)
    if groups is None or not all(part.component.behaviour == BIPARTITE_CONSENSUS for part in subject.parts):
        groups = family_groups(subject.family)
    agents = _extreme_agents(first.states[:, 0])
    named = {k: CAMP_STYLES[groups[k]][0] for k in agents}
    labels = set()
    for k in agents:
        for run in runs:
            worst = run.signal.startswith("worst")
            style: dict[str, Any] = {"linewidth": 1.1 if worst else 0.5, "alpha": 1.0 if worst else 0.7}
            style |= {"color": named[k], "linestyle": CAMP_STYLES[groups[k]][1]}
            ax.plot(run.t, run.states[k], **style, label=None if groups[k] in labels else groups[k])
            labels.add(groups[k])
    bars = _draw_tubes(ax, subject, first, agents, groups)
    draw_deadlines(ax, first)
    name_agents(ax, first, first.states, named)
    values = [run.states[agents].ravel() for run in runs]
    low, high = float(np.min([*map(np.min, values), *bars])), float(np.max([*map(np.max, values), *bars]))
    low, high = (low, high) if low < high else (low - 1, high + 1)
    ax.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    return finished(ax, time_label("time $t$", time_unit), "state $x_k$", count_of_signals(subject, runs))


@styled
def plot_family_decay(
    subject: FamilyCertificate,
    *,
    ax: Axes | None = None,
    runs: Sequence[FamilyTrajectory] | None = None,
    axis: str = "left",
    time_unit: str = "",
) -> Axes:
    """Draw ``max_k |x_k(t) - x_k(T)|`` under many signals below its bound for every signal, logarithmically.

    Parameters
    ----------
    subject : FamilyCertificate
        With an initial state and a proved rate.
    ax : Axes, optional
    runs : sequence of FamilyTrajectory, optional
        By default under eight random signals and worst cases; those are drawn that have settled at ``T``, or of which
        it is proved where they end.
    axis : {"left", "time", "clock"}
        As in :func:`~ptcc_certify.plot_decay`.
    time_unit : str

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject is no certificate of a family, or has no initial state or no bound; or an unknown axis.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.certificate.family_certificate import certify_family
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "0.5", "1.5")])
    >>> cert = certify_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2])
    >>> plot_family_decay(cert, axis="clock").get_xlabel()
    'stretched clock $s(t)$'
    """
    if axis not in _AXES:
        raise ParameterError(f'axis "{axis}" is unknown; one of {", ".join(_AXES)}')
    runs, ax = runs_of(subject, runs), axes_of(ax)
    first = runs[0]
    before = first.remaining > 0
    bound = subject.deviation_bound(first.remaining[before]).max(axis=0)
    if not np.isfinite(bound).any():
        raise ParameterError("the certificate holds no proved bound of a decay; draw its states")
    places = {"left": first.remaining, "time": first.t, "clock": first.clock}[axis][before]
    scale = float(np.abs(first.states[:, 0]).max()) or 1.0
    floor = FLOOR_FACTOR * first.rtol * scale
    if not (bound >= floor).any():
        raise ParameterError("every agent begins where it ends: there is no decay to draw")
    own = subject.signal == "any" or keeps_promise(subject, runs)
    label: str | None = "random signals" if own else "any signal (random)"
    any_worst, known = False, _known_end(subject)
    for run in runs:
        end = run.final_state if run.deadline_resolved else known
        if end is not None and np.array_equal(run.t, first.t):
            gap = np.abs(run.states[:, before] - end[:, None]).max(axis=0)
            worst = run.signal.startswith("worst")
            style: dict[str, Any] = {"color": "black" if worst else RUN, "linewidth": 0.9 if worst else 0.6}
            ax.plot(places, np.where(gap > floor, gap, np.nan), **style, label=None if worst else label)
            label = label if worst else None
            any_worst |= worst
    if any_worst:
        ax.plot([], [], color="black", linewidth=0.9, label="worst cases found")
    ax.plot(places, bound, color=BOUND, linewidth=1.8, label=bound_label(subject))
    bottom = floor / 10
    ax.axhspan(bottom, floor, color=BEHIND, alpha=0.12, linewidth=0)
    ax.axhline(floor, color=BEHIND, linewidth=0.9, linestyle=":", label="integrator's floor")
    ax.set_yscale("log")
    ax.set_ylim(bottom, 3 * float(bound[np.isfinite(bound)].max()))
    ax.set_xscale("log" if axis == "left" else "linear")
    last = int(np.flatnonzero(bound >= bottom)[-1])
    ax.set_xlim(places[0], places[max(last, 1)])
    name = time_label(_AXES[axis], time_unit) if axis == "time" else _AXES[axis]
    return finished(ax, name, r"$\max_k |x_k(t) - x_k(T)|$")


def bound_label(certificate: FamilyCertificate) -> str:
    """Name bounds for every signal; while sliding variables move they are integrated in floats: numerical."""
    return "proved for every signal" if certificate.direct else "bound for every signal (numerical)"


def runs_of(subject: Any, runs: Sequence[FamilyTrajectory] | None) -> list[FamilyTrajectory]:
    """Return runs that are given, or those that are drawn of a certificate by default.

    Raises
    ------
    ParameterError
        The subject is no certificate of a family, or the runs are of another one.
    """
    if not isinstance(subject, FamilyCertificate):
        raise ParameterError(
            f"this figure is drawn from the certificate of a family, not from {type(subject).__name__}"
        )
    result = sample_runs(subject) if runs is None else list(runs)
    if not result or not all(isinstance(run, FamilyTrajectory) and run.family == subject.family for run in result):
        raise ParameterError("runs are what simulate_family returned for the family of the certificate")
    return result


def _known_end(certificate: FamilyCertificate) -> np.ndarray | None:
    """Return the state at ``T`` if it is proved to be the same for every signal."""
    ends = [] if certificate.final_states is None else [one for one in certificate.final_states if one is not None]
    same = len(ends) == certificate.family.n_nodes and all(low == high for low, high in ends)
    return np.array([float(low) for low, _ in ends]) if same else None


def count_of_signals(certificate: FamilyCertificate, runs: Sequence[FamilyTrajectory]) -> str:
    """Tell how many signals are drawn, and where some are promised, whether these keep the promise or are any."""
    kept = " of the kind asked for" if keeps_promise(certificate, runs) else " of any kind"
    return f"{len(runs)} signals" + kept * (certificate.signal != "any")


def _extreme_agents(x: np.ndarray) -> list[int]:
    """Return all agents, or those that begin highest and lowest."""
    order = np.argsort(x, kind="stable").tolist()
    if len(order) <= NAMED_AGENTS:
        return sorted(order)
    half = NAMED_AGENTS // 2
    return sorted([*order[:half], *order[-half:]])


def _draw_tubes(
    ax: Axes, certificate: FamilyCertificate, run: FamilyTrajectory, agents: list[int], groups: np.ndarray
) -> list[float]:
    """Shade where the agents of each camp are for every signal; draw the final intervals beyond ``T``, return ends."""
    before = run.remaining > 0
    moves = certificate.deviation_bound(run.remaining[before])
    finals = certificate.final_states or ()
    largest = np.zeros(len(groups))  # what the states of a component never exceed
    for part in certificate.parts:
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
                places[low, high, CAMP_STYLES[name][0]] = None
                tubes.append((np.maximum(low - moves[k], -largest[k]), np.minimum(high + moves[k], largest[k])))
        if name != "single leaders" and tubes:
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
