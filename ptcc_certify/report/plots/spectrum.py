"""What decides the rate: eigenvalues, and the Lyapunov functions that are proved."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.model import Protocol
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled
from ptcc_certify.report.plots.subject import certificate_of, structure_of
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.lemmas import laplacian_spectrum

#: Colour and marker of the classes of certificates.
CLASS_MARKERS = {"paper": ("#000000", "s"), "perron": ("#007A5A", "^"), "lmi": (RUN, "o"), "full": (BOUND, "D")}


@styled
def plot_spectrum(subject: Any, *, ax: Axes | None = None, protocol: Protocol | None = None) -> Axes:
    """Draw the eigenvalues of ``L`` (numerical), and the line ``1/(rho2 kappa)`` from which on the input stays bounded.

    The zeros of balanced closed components are marked apart. From every initial state the input (its nominal part,
    under the sliding-mode protocol) is bounded up to the deadline if all other eigenvalues lie right of ``1/(rho2
    kappa)``; one to its left leaves it unbounded. One unit is as long in both directions.

    Parameters
    ----------
    subject : Certificate, Trajectory, Structure or graph-like
        Of strong components above 500 nodes only the eigenvalues nearest to 0 are computed.
    ax : Axes, optional
    protocol : NominalProtocol or SlidingModeProtocol, optional
        Whose line is drawn, that of a certificate or trajectory by default; there is none with ``rho2 = 0``.

    Returns
    -------
    Axes

    Raises
    ------
    numpy.linalg.LinAlgError
        The eigenvalues were not found.

    Examples
    --------
    >>> ax = plot_spectrum([(1, 2, 1), (2, 1, 1), (2, 3, 4)])
    >>> [(line.get_label(), line.get_xdata().round(6).tolist()) for line in ax.lines]
    [('nonzero eigenvalues', [2.0, 4.0]), ('zero eigenvalues', [0.0])]
    """
    ax, spectrum = axes_of(ax), laplacian_spectrum(structure_of(subject))
    if protocol is None and isinstance(subject, Certificate | Trajectory):
        protocol = subject.protocol
    if spectrum.nonzero.size:
        dots: dict[str, Any] = {"color": RUN, "markersize": 5, "alpha": 0.7, "clip_on": False}
        ax.plot(spectrum.nonzero.real, spectrum.nonzero.imag, "o", label="nonzero eigenvalues", **dots)
    if spectrum.kernel_dimension:
        many = "" if spectrum.kernel_dimension == 1 else f" ({spectrum.kernel_dimension})"
        ax.plot([0.0], [0.0], "x", color=BEHIND, markersize=7, label=f"zero eigenvalues{many}")
    if protocol is not None and protocol.prescribed:
        least = float(1 / (protocol.rho2 * protocol.kappa))
        name = r"$1/(\rho_2 \kappa)$: input bounded to the right"
        ax.axvline(least, color=BOUND, linewidth=0.9, linestyle="--", label=name)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    return finished(ax, "real part of eigenvalue", "imaginary part of eigenvalue")


@styled
def plot_frontier(subject: Any, *, ax: Axes | None = None) -> Axes:
    """Draw rate against overshoot constant of all proved Lyapunov functions by class, and what no rate exceeds.

    A function of rate ``b`` and overshoot constant ``c`` proves ``||z(t)||^2 <= c e^(-b s) ||z(0)||^2``, ``z`` being
    ``E``, or the ``eps`` of Theorem 1.1 for the paper's own. The axis of the overshoot constant is logarithmic.

    Parameters
    ----------
    subject : Certificate
        With a proved Lyapunov function.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        There is nothing to draw.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> ax = plot_frontier(certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)))
    >>> [line.get_label() for line in ax.lines]
    ['paper', 'perron', 'upper bound (proved)', 'spectral rate (numerical)']
    """
    subject = certificate_of(subject)
    functions = subject.envelope.functions
    if not functions:
        raise ParameterError("the certificate holds no proved Lyapunov function")
    ax = axes_of(ax)
    ax.set_xscale("log")
    for kind, (colour, marker) in CLASS_MARKERS.items():
        own = [m for m in functions if m.kind == kind]
        if own:
            points = [m.overshoot_above for m in own], [m.rate_below for m in own]
            ax.plot(*points, marker, color=colour, markersize=5, alpha=0.8, label=kind)
    constants = [m.overshoot_above for m in functions]
    low, high = ax.get_xlim()
    ax.set_xlim(min(low, min(constants) / 1.5), max(high, max(constants) * 1.5))  # room for ticks that differ
    rates = [m.rate_below for m in functions]
    if subject.upper_bound is not None:
        limit = float_up(subject.upper_bound)
        ax.axhline(limit, color=BEHIND, linewidth=2.2, alpha=0.6, label="upper bound (proved)")
        rates.append(limit)
    if subject.spectral_rate is not None:
        rates.append(subject.spectral_rate)
        ax.axhline(rates[-1], color="black", linewidth=0.9, linestyle=":", label="spectral rate (numerical)")
    low, high = min(0.0, *rates), max(0.0, *rates)
    room = 0.08 * (high - low)
    ax.set_ylim(low - room if low < 0 else low, high + room)
    return finished(ax, "overshoot constant of the squared norm", "proved rate")
