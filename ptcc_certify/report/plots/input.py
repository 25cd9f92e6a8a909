"""The input of a run, what it has spent, and what is proved of both."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.plots.style import RUN, axes_of, finished, styled
from ptcc_certify.report.plots.trajectory import draw_agents, draw_deadlines
from ptcc_certify.simulation.trajectory import Trajectory

#: An error ``|e_k|`` below so many tolerances of the integrator, in units of what it is made of, is not resolved.
RESOLVED_ERROR = 10
#: Decades of the input that are drawn below its initial size; changes of sign go further down.
INPUT_DECADES = 3


@styled
def plot_input(
    trajectory: Trajectory, structure: Structure, certificate: Certificate | None = None, ax: Axes | None = None
) -> Axes:
    """Draw ``|u_k(t)|`` with camps coloured, and the peak that a certificate of the same initial state proves.

    The axis of the input is logarithmic, from three decades below its initial size. Behind an actuator it is the
    input that acts. Nothing is drawn where the integrator no longer resolves what the gain multiplies. No peak is drawn
    where none holds: for runs that begin later than 0, sampled inputs, disturbance or noise of the nominal protocol,
    boundary layers. Under caps and stops that ``certificate`` judges, theirs is drawn.

    Parameters
    ----------
    trajectory : Trajectory
        Of one initial state.
    structure : Structure
        Of the same graph.
    certificate : Certificate, optional
        Of the same graph, protocol and initial state. One of a set of initial states adds nothing.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The trajectory holds several initial states, or the certificate is of another graph, protocol or initial state.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_input(run, analyse(pair))
    >>> len(ax.lines), ax.get_ylabel()
    (3, 'input $|u_k|$')
    """
    _require_one_initial_state(trajectory)
    peak = None if certificate is None else _certified_peak(trajectory, certificate)
    ax, u = axes_of(ax), _resolved_input(trajectory)
    size = np.where(np.isnan(u), 0.0, np.abs(u))
    top = max(float(size.max(initial=0)), peak or 0.0)
    if top > 0:
        ax.set_yscale("log", nonpositive="clip")
        first = float(size[:, 0].max(initial=0)) if u.shape[1] else 0.0
        ax.set_ylim((first or top) * 10.0**-INPUT_DECADES, top * 2)
    hold = trajectory.held_input is not None
    draw_agents(trajectory, np.abs(u), structure, ax, drawstyle="steps-post" if hold else "default")
    if peak is not None:
        ax.axhline(peak, color="black", linewidth=0.9, linestyle="--", label="certified peak")
    return finished(ax, "time $t$", "input $|u_k|$")


@styled
def plot_effort(trajectory: Trajectory, certificate: Certificate | None = None, ax: Axes | None = None) -> Axes:
    """Draw the energy spent so far, ``int_0^t ||u||^2 dt``, and the bound that a certificate proves for it.

    The integral is numerical: between the samples ``||u||^2`` is taken for an exponential of ``ln(T/(T - t))``, as it
    is along a single mode. No bound is drawn where none holds: as in :func:`plot_input`, and under the sliding-mode
    protocol, whose switching part no certificate integrates.

    Parameters
    ----------
    trajectory : Trajectory
        Of one initial state.
    certificate : Certificate, optional
        Of the same graph, protocol and initial state.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The trajectory holds several initial states, the energy is beyond the range of floats or not settled by the
        samples, or the certificate is of another graph, protocol or initial state.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_effort(cert.trajectory, cert)
    >>> [line.get_label() for line in ax.lines]
    ['simulated (CVODES)', 'certified bound', 'deadline']
    """
    _require_one_initial_state(trajectory)
    effort, bound = None if certificate is None else _certified_effort(trajectory, certificate), None
    if effort is not None and effort.energy is not None and not (trajectory.actuator or trajectory.sliding):
        bound = float(effort.energy.value)
    ax, energy = axes_of(ax), _energy(trajectory)
    ax.plot(trajectory.t, energy, color=RUN, label="simulated (CVODES)")
    if bound is not None:
        ax.axhline(bound, color="black", linewidth=0.9, linestyle="--", label="certified bound")
    ax.set_ylim(0, 1.1 * max(bound or 0.0, float(energy.max(initial=0))) or 1)
    draw_deadlines(trajectory, ax)
    return finished(ax, "time $t$", r"energy spent, $\int \|u\|^2\, dt$")


def _require_one_initial_state(trajectory: Trajectory) -> None:
    if trajectory.states.ndim != 2:
        raise ValueError(f"the trajectory holds {trajectory.states.shape[1]} initial states; draw the input of one")


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
    ValueError
        It is beyond the range of floats, or with every second sample it would differ by more than a hundredth.
    """
    T, t, remaining = float(trajectory.protocol.T), trajectory.t, trajectory.remaining
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused
        power = (np.nan_to_num(_resolved_input(trajectory)) ** 2).sum(axis=0)
        if trajectory.held_input is not None:
            every = np.concatenate([[0.0], np.cumsum(power[:-1] * np.diff(t))])
            some = every[::2]
        else:
            full = (trajectory.input**2).sum(axis=0)
            every, some = (_integrated(power[::k], full[::k], t[::k], remaining[::k], T) for k in (1, 2))
    if not np.isfinite(every).all():
        raise ValueError("the energy is beyond the range of floats; scale the initial state down")
    if t.size > 2 and abs(every[::2][-1] - some[-1]) > every[-1] / 100:
        raise ValueError("these samples do not settle the energy: simulate with more, unless it is infinite")
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
    ValueError
        The certificate is of another graph, protocol or initial state.
    """
    effort, actuator = _certified_effort(trajectory, certificate), trajectory.actuator
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
    """Return what is proved about the input of a run; None if that is of other initial states, or the run is disturbed.

    Raises
    ------
    ValueError
        The certificate is of another graph, protocol or initial state.
    """
    for name in ("graph", "protocol"):
        if getattr(certificate, name) != getattr(trajectory, name):
            raise ValueError(f"the certificate is of another {name} than the trajectory")
    initial_values = [("initial state", certificate.initial_state, trajectory.states[:, :1])]
    rounding = np.abs(trajectory.states[:, :1])  # runs are integrated in units of the initial state
    unknown = trajectory.forcing is not None or 0.0 not in trajectory.t[:1]
    if (slid := trajectory.sliding) is not None:
        sigma0 = slid.sigma0[:, None]
        initial_values.append(("sigma(0)", certificate.sigma0, sigma0))
        unknown = unknown or slid.boundary_layer is not None
        rounding = rounding + np.abs(sigma0)  # the states are sums of two parts
    for name, proved, run in initial_values if 0.0 in trajectory.t[:1] else ():
        at = run if proved is None else np.array([[float(x)] for x in proved])
        if (np.abs(at - run) > 4 * np.finfo(float).eps * rounding).any():
            raise ValueError(f"the certificate is of another {name} than the trajectory")
    effort = certificate.effort
    unknown = unknown or effort is None or effort.initial_set is not None or certificate.initial_state is None
    return None if unknown else effort
