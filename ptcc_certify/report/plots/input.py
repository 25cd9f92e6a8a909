"""The input of a run, what it has spent, and what is proved of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.judgements import largest_late_input
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.report.facts.input import initial_states_text
from ptcc_certify.report.plots.camp_lines import NAME_SIZE, draw_agents, draw_deadlines, name_agents
from ptcc_certify.report.plots.final_colours import colours_at_end
from ptcc_certify.report.plots.runs_under_signals import (
    bound_label,
    count_of_signals,
    is_worst,
    line_of,
    no_bound_text,
    runs_of,
)
from ptcc_certify.report.plots.style import BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.report.plots.subject import certifies_family, limits_text, require_same, structure_of, trajectory_of
from ptcc_certify.report.plots.trajectory import agents_run
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.trajectory import Trajectory

#: An error ``|e_k|`` below so many tolerances of the integrator, in units of what it is made of, is not resolved.
RESOLVED_ERROR = 10


#: An input that grows to so many times its initial size, or is above such a share of its largest for less than such a
#: share of the time, is drawn on a logarithmic axis,
LARGE_GROWTH, LARGE, BRIEF = 3, 1 / 5, 1 / 8
#: from so many decades below its initial size on; with signs from so many, and linear about 0.
INPUT_DECADES, SIGNED_DECADES = 3, 2
#: Or if a bound is so many times above the largest input. On a logarithmic axis a bound is drawn as a line up to so
#: many times the largest input of the run, else named at the top.
HIGH_PEAK, HIGH_PEAK_OF_LOGARITHM = 3, 1e6


class InputAxis(NamedTuple):
    """An axis of inputs: where they begin to be drawn by their decades, 0 of a linear axis, and between which ends."""

    least: float
    low: float
    high: float


class Peak(NamedTuple):
    """A proved bound of inputs, and its name."""

    value: float
    name: str
    color: str = "black"


@styled
def plot_input(
    subject: Any,
    *,
    ax: Axes | None = None,
    certificate: Certificate | None = None,
    runs: Sequence[Trajectory] | None = None,
    time_unit: str = "",
    beside: Sequence[Any] = (),
) -> Axes:
    """Draw ``u_k(t)`` of one run, and the peak of ``|u_k|`` that is proved.

    Lines are those of the camps, colours those of where agents end.

    Lines and names are those of :func:`plot_trajectory`. The axis is linear; for an input that grows to three times its
    initial size, or is large for a short time alone, it is logarithmic on both sides of a linear part about 0. Behind
    an actuator it is the input that acts. Nothing is drawn where the integrator no longer resolves what the gain
    multiplies. No peak is drawn where none holds: for runs that begin later than 0, sampled inputs, disturbance or
    noise of the nominal protocol, boundary layers. Of a certificate with one set of limits of the gain the run under
    these is drawn, and their peak; with late messages or moving leaders the run with these, and what bounds its input,
    if anything does; the legend names them. A held input is drawn in steps if every period is sampled.

    Of a family the largest input under each of many signals is drawn, below its bound for every signal; signals of a
    search for worst cases keep the error large, and their inputs need not be: "slowest found". Where no bound holds the
    legend says why. Of agents of order n it
    is each agent's input, in several dimensions its size, under the sliding-mode protocol of its nominal part; the peak
    is of the whole.

    Parameters
    ----------
    subject : Certificate, Trajectory or AgentsTrajectory
        Of one initial state. The run of a certificate that holds none is simulated.
    ax : Axes, optional
    certificate : Certificate, optional
        Of the same graph, protocol and initial state as a trajectory. Beside the peak of one of a set of initial
        states the set is named.
    runs : sequence of Trajectory, optional
        Of a family, by default under eight random signals and worst cases.
    time_unit : str
        Of the deadline, for the label of the axis.
    beside : sequence of Certificate, Trajectory or AgentsTrajectory
        Of the panels beside this one, which are to have the same axis of inputs.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no run of one initial state, or the certificate is of another one.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_input(cert)
    >>> ax.get_ylabel(), ax.texts[0].get_text()
    ('input $u_k$', 'proved peak 16.01')
    """
    ax, x = axes_of(ax), time_label("time $t$", time_unit)
    if certifies_family(subject):
        runs = runs_of(subject, runs)
        bounded = _draw_signals(ax, subject, runs)
        draw_deadlines(ax, runs[0])
        words = [count_of_signals(subject, runs), *([] if bounded else [no_bound_text(subject)])]
        return finished(ax, x, r"$\max_k |u_k|$", "; ".join(words))
    drawn = _inputs_of(subject, certificate)
    run = drawn.run
    structure = analyse(run.graph) if isinstance(run, AgentsTrajectory) else structure_of(subject)
    of = subject if isinstance(subject, Certificate) else certificate
    colours = None if of is None else colours_at_end(of, run)
    colours = None if len(set(colours or ())) < 2 else colours  # where all end alike camps tell them apart
    named = draw_agents(ax, run, drawn.values, structure, size=drawn.sizes, drawstyle=drawn.steps, colours=colours)
    every = [drawn.axis, *(_inputs_of(other, None).axis for other in beside)]
    least = min((one.least for one in every if one.least), default=0.0)
    axis = InputAxis(least, min(one.low for one in every), max(one.high for one in every))
    _draw_peaks(ax, run.t, drawn.values, drawn.peaks, axis)
    draw_deadlines(ax, run)
    name_agents(ax, run, drawn.values, named)
    return finished(ax, x, drawn.name, drawn.title)


class _Inputs(NamedTuple):
    """The inputs of a run, (N, M), or their sizes, what bounds them, and how they are named and drawn."""

    run: Trajectory | AgentsTrajectory
    values: np.ndarray
    sizes: bool
    peaks: list[Peak]
    name: str
    title: str = ""
    steps: str = "default"

    @property
    def axis(self) -> InputAxis:
        return _axis_of(self.run.t, self.values, self.peaks, signed=not self.sizes)


def _inputs_of(subject: Any, certificate: Certificate | None) -> _Inputs:
    """Return what is drawn of the inputs of one run."""
    certificate = subject if isinstance(subject, Certificate) else certificate
    if isinstance(subject, AgentsTrajectory) or (certificate is not None and certificate.proof.agents is not None):
        moved = agents_run(subject)
        sliding, sizes = moved.protocol.base.reaching is not None, moved.input.shape[1] > 1
        name = f"{'nominal ' if sliding else ''}input " + (r"$\|u_k\|$" if sizes else "$u_k$")
        values = np.sqrt((moved.input**2).sum(axis=1)) if sizes else moved.input[:, 0]
        return _Inputs(moved, values, sizes, [] if certificate is None else _agents_peaks(certificate, sliding), name)
    run = trajectory_of(subject)
    steps = "steps-post" if _every_period_sampled(run) else "default"
    peaks = [] if certificate is None else _peaks(run, certificate)
    return _Inputs(run, _resolved_input(run), False, peaks, "input $u_k$", limits_text(run, certificate), steps)


def _draw_signals(ax: Axes, certificate: Certificate, runs: Sequence[Trajectory]) -> bool:
    """Draw the largest input under many signals below its bound for every signal, and the proved peak.

    Tell whether there is such a bound.
    """
    proof = certificate.family_proof
    first, gain = runs[0], certificate.protocol.gain
    before = first.remaining > 0
    t, left = first.t[before], first.remaining[before]
    floor = FLOOR_FACTOR * first.rtol * (float(np.abs(first.states[:, 0]).max()) or 1.0)
    noise = 2 * float(Members(proof.family).in_weight.max(initial=0.0)) * floor
    others = "other signals" if any(map(is_worst, runs)) else "random signals"
    names, sizes = {False: others, True: "slowest found"}, []
    for run in runs:
        own = run.remaining > 0
        size = np.abs(run.input[:, own]).max(axis=0)
        resolved = np.where(size > noise * gain.value_at_remaining(run.remaining[own]), size, np.nan)
        ax.plot(run.t[own], resolved, label=names.pop(is_worst(run), None), **line_of(run))
        sizes.append(np.interp(first.t, run.t[own], np.nan_to_num(resolved), right=0.0))
    bound = proof.input_bound(left).max(axis=0)
    if bounded := bool(np.isfinite(bound).all()):
        ax.plot(t, bound, color=BOUND, linewidth=1.8, label=bound_label(certificate))
        sizes.append(np.interp(first.t, t, bound, right=0.0))
    peaks = [Peak(float(peak), f"proved peak {up(peak, 4)}") for peak in sorted(proof.input_peaks or ())[-1:]]
    _draw_peaks(ax, first.t, np.array(sizes), peaks, _axis_of(first.t, np.array(sizes), peaks, signed=False))
    ax.set_xlim(0, float(first.t[-1]))
    return bounded


def _axis_of(t: np.ndarray, values: np.ndarray, peaks: Sequence[Peak], *, signed: bool) -> InputAxis:
    """Return the axis of inputs, or of their sizes, (N, M), with those of their bounds that are not far above.

    It is logarithmic where a linear one would leave most of the time, ``t`` (M,), flat.
    """
    values = np.nan_to_num(values)
    first, top = (float(np.abs(some).max(initial=0)) for some in (values[:, :1], values))
    even = np.interp(np.linspace(t[0], t[-1], 401), t, np.abs(values).max(axis=0))
    brief = (even > LARGE * top).mean() < BRIEF
    least = 0.0
    far = any(peak.value > HIGH_PEAK * top for peak in peaks)
    if top and (far or (first and (brief or top > LARGE_GROWTH * first))):
        least = (first or top) * 10.0 ** -(SIGNED_DECADES if signed else INPUT_DECADES)
    shown = [peak.value for peak in peaks if _is_near(peak, top, least)]
    room = 2 if least else 1.12
    high, low = room * max([float(values.max(initial=0)), *shown]), float(values.min(initial=0))
    if not signed:
        return InputAxis(least, least, high or 1.0)
    low = room * min([low, *(-peak for peak in shown)])
    return InputAxis(least, min(low, -least), max(high * (2 if least else 1), least) or 1.0)  # with room for a name


def _is_near(peak: Peak, top: float, least: float) -> bool:
    """Tell whether a bound is drawn as a line."""
    return top == 0 or peak.value <= (HIGH_PEAK_OF_LOGARITHM if least else HIGH_PEAK) * top


def _draw_peaks(ax: Axes, t: np.ndarray, values: np.ndarray, peaks: Sequence[Peak], axis: InputAxis) -> None:
    """Set the axis of inputs, (N, M), and draw what bounds them, with names; those far above at the top.

    Of two lines the higher one has its name above it, the lower one below.
    """
    top = float(np.abs(np.nan_to_num(values)).max(initial=0))
    shown = [peak for peak in peaks if _is_near(peak, top, axis.least) and peak.value <= axis.high]
    if axis.least and axis.low >= axis.least:
        ax.set_yscale("log", nonpositive="clip")
    elif axis.least:
        ax.set_yscale("symlog", linthresh=axis.least, linscale=0.5)
    ax.set_ylim(axis.low, axis.high)
    ground = {"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none"}
    style: dict[str, Any] = {"ha": "right", "fontsize": NAME_SIZE, "textcoords": "offset points", "bbox": ground}
    above = 0
    for peak in peaks:
        if peak not in shown:
            place, at = (0, -2 - 1.5 * NAME_SIZE * above), "axes fraction"
            ax.annotate(f"{peak.name}, above", (1, 1), place, xycoords=at, va="top", color=peak.color, **style)
            above += 1
            continue
        for height in (peak.value, -peak.value)[: 1 + (axis.low < 0)]:
            ax.plot(t[[0, -1]], [height] * 2, color=peak.color, linewidth=0.9, linestyle="--")  # not over names
        low = any(other.value > peak.value for other in shown)
        ends: dict[str, Any] = {"va": "top" if low else "bottom", "color": peak.color}
        sides = ("axes fraction", "data")
        ax.annotate(peak.name, (1, peak.value), (0, -3 if low else 2), xycoords=sides, **ends, **style)


def _agents_peaks(certificate: Certificate, sliding: bool) -> list[Peak]:
    """Return the proved peak of agents of order n, of the whole input."""
    part = certificate.proof.agents
    if part is None or part.input is None:
        return []
    largest = max(part.input)
    return [Peak(float(largest), f"proved peak {up(largest, 4)}{', sliding terms included' if sliding else ''}")]


def _every_period_sampled(run: Trajectory) -> bool:
    """Whether the input is held, and known in each period up to the deadline."""
    if run.conditions.actuator is None or run.conditions.actuator.sample_period is None:
        return False
    longest = np.diff(run.t[run.t <= float(run.protocol.T)]).max(initial=0)
    return bool(longest <= (1 + 1e-9) * float(run.conditions.actuator.sample_period))


def _peaks(run: Trajectory, certificate: Certificate) -> list[Peak]:
    """Return what bounds the input of a run, be it with late messages; not those of another run than it."""
    late = certificate.proof.late
    peak = None if run.vehicles else _certified_peak(run, certificate)  # which is of the virtual positions then
    found = [] if peak is None else [Peak(peak, f"proved peak {up(peak, 4)}{_set_text(run, certificate)}")]
    met = run.conditions
    acts = met.messages is not None or met.leaders is not None or met.actuator is not None or run.vehicles
    if late is not None and acts and (largest := largest_late_input(late, certificate.protocol)) is not None:
        whole = f", from within 1 of the {'targets' if late.tracks else 'final states'}" if late.relative else ""
        what = "moving leaders" if late.tracks else "as asked" if late.messages.exact else "late messages"
        found.append(Peak(float(largest), f"{what}: at most {up(largest, 4)}{whole}", BOUND))
    return found


def _set_text(run: Trajectory, certificate: Certificate) -> str:
    """Name the set of initial states for which a peak is proved, and say whether a run begins outside a box."""
    region = certificate.graph_proof.effort and certificate.graph_proof.effort.initial_set
    if not region:
        return "" if certificate.proof.late is None else ", messages at once"
    outside = False
    if region.radius:
        center, radius = (np.array(list(map(float, numbers))) for numbers in (region.center, region.radius))
        outside = bool((np.abs(run.states[:, 0] - center) > radius * (1 + 1e-12)).any())
    states = initial_states_text(region).replace("|x_k(0)| <=", r"$|x_k(0)| \leq$")
    return f" ({states}" + (",\nnot from where this run begins)" if outside else ")")


@styled
def plot_effort(
    subject: Any, *, ax: Axes | None = None, certificate: Certificate | None = None, time_unit: str = ""
) -> Axes:
    """Draw the energy spent so far, ``int_0^t ||u||^2 dt``, and the bound that a certificate proves for it.

    The integral is numerical: between the samples ``||u||^2`` is taken for an exponential of ``ln(T/(T - t))``, as it
    is along a single mode. No bound is drawn where none holds: as in :func:`plot_input`, and under the sliding-mode
    protocol, whose switching part no certificate integrates.

    Parameters
    ----------
    subject : Certificate or Trajectory
        Of one initial state. The run of a certificate that holds none is simulated.
    ax : Axes, optional
    certificate : Certificate, optional
        Of the same graph, protocol and initial state as a trajectory.
    time_unit : str
        Of the deadline, for the label of the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no run of one initial state, the energy is beyond the range of floats or not settled by the
        samples, or the certificate is of another graph, protocol or initial state.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [line.get_label() for line in plot_effort(cert).lines]
    ['simulated (CVODES)', 'proved bound', 'deadline $T$']
    """
    run = trajectory_of(subject)
    certificate = subject if isinstance(subject, Certificate) else certificate
    effort, bound = None if certificate is None else _certified_effort(run, certificate), None
    if effort and effort.energy and not (effort.initial_set or run.conditions.actuator or run.sliding or run.vehicles):
        bound = float(effort.energy.value)
    ax, energy = axes_of(ax), _energy(run)
    ax.plot(run.t, energy, color=RUN, label="simulated (CVODES)")
    if bound is not None:
        ax.axhline(bound, color="black", linewidth=0.9, linestyle="--", label="proved bound")
    ax.set_ylim(0, 1.1 * max(bound or 0.0, float(energy.max(initial=0))) or 1)
    draw_deadlines(ax, run)
    label = r"energy spent, $\int \|u\|^2\, dt$"
    return finished(ax, time_label("time $t$", time_unit), label, limits_text(run, certificate))


def _resolved_input(trajectory: Trajectory) -> np.ndarray:
    """Return the input, NaN where the infinite gain multiplies what the integrator does not resolve."""
    u = np.array(trajectory.input)
    if trajectory.held_input is not None:
        return u
    weights = abs(trajectory.graph.laplacian())
    floor = RESOLVED_ERROR * trajectory.rtol * np.asarray(weights @ np.abs(trajectory.states))
    below = np.abs(trajectory.error) < floor
    if trajectory.sliding:  # what answers the disturbance is resolved
        u[below] -= (trajectory.protocol.gain.value_at_remaining(trajectory.remaining) * trajectory.error)[below]
        below &= u == 0
    u[below] = np.nan
    return u


def _energy(trajectory: Trajectory) -> np.ndarray:
    """Return ``int ||u||^2 dt`` up to each instant, (M,).

    Raises
    ------
    ParameterError
        It is beyond the range of floats, with every second sample it would differ by more than a hundredth, or its
        trend before the deadline adds more than a fiftieth after the last sample.
    """
    T = float(trajectory.protocol.T)
    t = trajectory.t
    remaining = trajectory.remaining
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused
        power, unsettled = (np.nan_to_num(_resolved_input(trajectory)) ** 2).sum(axis=0), False
        if trajectory.held_input is not None:
            every = np.concatenate([[0.0], np.cumsum(power[:-1] * np.diff(t))])
            coarse = every[::2]
        else:
            full = (trajectory.input**2).sum(axis=0)
            every, coarse = (_integrated(power[::k], full[::k], t[::k], remaining[::k], T) for k in (1, 2))
            unsettled = _energy_after(power, remaining, T) > every[-1] / 50
    if not np.isfinite(every).all():
        raise ParameterError("the energy is beyond the range of floats; scale the initial state down")
    if unsettled or (t.size > 2 and abs(every[::2][-1] - coarse[-1]) > every[-1] / 100):
        raise ParameterError("these samples do not settle the energy: simulate with more, unless it is infinite")
    return every


def _integrated(power: np.ndarray, full: np.ndarray, t: np.ndarray, remaining: np.ndarray, T: float) -> np.ndarray:
    """Integrate over time, before ``T`` over ``tau = -ln(remaining)``: exact for exponentials of ``tau``.

    ``full`` holds besides ``power`` what is not resolved: it tells how fast ``power`` fell to there.
    """
    power = power.copy()
    below = 1 + np.flatnonzero((power[1:] == 0) & (power[:-1] > 0))
    power[below] = np.minimum(full[below], power[below - 1])
    late = remaining[1:] <= 0
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = np.where(late, 0.0, np.log(remaining[:-1] / remaining[1:]))
    early = _logarithmic_mean(power[:-1] * remaining[:-1], power[1:] * remaining[1:]) * T * tau
    pieces = np.where(late, np.minimum(power[:-1], power[1:]) * np.diff(t), early)
    return np.concatenate([[0.0], np.cumsum(pieces)])


def _energy_after(power: np.ndarray, remaining: np.ndarray, T: float) -> float:
    """Return the energy between the last sample before ``T`` and ``T``, if what is spent per ``tau`` goes on as before.

    It is an exponential through the last such sample and that of half its ``tau``, cut after as much ``tau`` again.
    """
    tau = -np.log(remaining[remaining > 0])
    half = int(np.abs(tau - tau[-1] / 2).argmin())
    spent = power[: tau.size] * remaining[: tau.size] * T
    before, now = spent[half], spent[-1]
    fall = np.log(before / now) / (tau[-1] - tau[half]) if before > now > 0 else 0.0
    return float(now / max(fall, 1 / tau[-1])) if now else 0.0


def _logarithmic_mean(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ``(a - b) / ln(a/b)``, the mean of the exponential from ``a`` to ``b``; half the sum if one is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(a / b)
        mean = (a - b) / ratio
    return np.where(np.isfinite(ratio) & (np.abs(ratio) > 1e-6), mean, (a + b) / 2)


def _certified_peak(trajectory: Trajectory, certificate: Certificate) -> float | None:
    """Return the proved bound of ``|u_k|`` that holds for a run; None if there is none.

    Raises
    ------
    ParameterError
        The certificate is of another graph, protocol or initial state.
    """
    effort, actuator = _certified_effort(trajectory, certificate), trajectory.conditions.actuator
    if effort is None or (actuator is not None and actuator.sample_period is not None):
        return None
    acts = None if actuator is None else (actuator.gain_cap, actuator.stop_before, actuator.sample_period)
    for entry in effort.residual:
        own = (entry.limits.gain_cap, entry.limits.stop_before, entry.limits.sample_period)
        if own == acts and entry.largest is not None:
            return float(entry.largest)
    # A smaller gain at the same state: what bounds the input of the ideal actuator bounds it too.
    return None if effort.peak is None else float(effort.peak.largest)


def _certified_effort(trajectory: Trajectory, certificate: Certificate) -> Effort | None:
    """Return what is proved of the input of a punctual run that begins at 0 without a disturbance; None of others.

    Raises
    ------
    ParameterError
        The certificate is of another graph, protocol or initial state.
    """
    require_same(trajectory, certificate)
    effort, slid = certificate.graph_proof.effort, trajectory.sliding
    met = trajectory.conditions
    unknown = met.forcing is not None or 0.0 not in trajectory.t[:1]
    unknown = unknown or (slid is not None and slid.boundary_layer is not None)
    unknown = unknown or met.messages is not None or met.leaders is not None
    return None if unknown else effort
