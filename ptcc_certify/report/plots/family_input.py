"""The input of a family's runs below its bound for every signal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.report.plots.agents import NAME_SIZE
from ptcc_certify.report.plots.family import bound_label, count_of_signals, runs_of
from ptcc_certify.report.plots.style import BOUND, RUN, axes_of, finished, styled, time_label
from ptcc_certify.simulation.members import Members
from ptcc_certify.simulation.trajectory import Trajectory

#: From this ratio of the largest input to its first size on, the axis is logarithmic; decades below the first size.
_GROWTH, _DECADES = 20, 3


@styled
def plot_family_input(
    subject: FamilyCertificate,
    *,
    ax: Axes | None = None,
    runs: Sequence[Trajectory] | None = None,
    time_unit: str = "",
) -> Axes:
    """Draw ``max_k |u_k(t)|`` under many signals below its bound for every signal, and the proved peak.

    Signals of a search for worst cases keep the error large, and their inputs need not be: "slowest found".
    Nothing of a run is drawn where the integrator no longer resolves what the gain multiplies. A bound that grows much
    towards the deadline is drawn on a logarithmic axis.

    Parameters
    ----------
    subject, ax, runs, time_unit
        As :func:`~ptcc_certify.report.plots.family.plot_family` takes them.

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
    >>> ax = plot_family_input(certify_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]))
    >>> ax.texts[0].get_text()
    'certified peak 6.001'
    """
    runs, ax = runs_of(subject, runs), axes_of(ax)
    first, gain = runs[0], subject.protocol.gain
    before = first.remaining > 0
    t, left = first.t[before], first.remaining[before]
    floor = FLOOR_FACTOR * first.rtol * (float(np.abs(first.states[:, 0]).max()) or 1.0)
    noise = 2 * float(Members(subject.family).in_weight.max(initial=0.0)) * floor
    top, start, labels = 0.0, 0.0, set[str]()
    others = "other signals" if any(run.signal.startswith("worst") for run in runs) else "random signals"
    for run in runs:
        own = run.remaining > 0
        size = np.abs(run.input[:, own]).max(axis=0)
        resolved = np.where(size > noise * gain.value_at_remaining(run.remaining[own]), size, np.nan)
        label = "slowest found" if (worst := run.signal.startswith("worst")) else others
        style: dict[str, Any] = {
            "color": "black" if worst else RUN,
            "linewidth": 0.9 if worst else 0.6,
            "zorder": 3 if worst else 2,
        }
        ax.plot(run.t[own], resolved, **style, label=None if label in labels else label)
        labels.add(label)
        top, start = max(top, float(np.nanmax(resolved, initial=0.0))), max(start, float(size[:1].max(initial=0.0)))
    bound = subject.input_bound(left).max(axis=0)
    if np.isfinite(bound).all():
        ax.plot(t, bound, color=BOUND, linewidth=1.8, label=bound_label(subject))
        top = max(top, float(bound.max()))
    if subject.input_peaks:
        peak = float(bound[0]) if subject.direct else float(max(subject.input_peaks))
        if not subject.direct:  # it need not be at the beginning
            ax.axhline(peak, color=BOUND, linewidth=0.8, linestyle="--")
            top = max(top, peak)
        ax.annotate(
            f"certified peak {up(max(subject.input_peaks), 4)}",
            (0, peak),
            (4, 2),
            textcoords="offset points",
            fontsize=NAME_SIZE,
        )
    ax.axvline(float(subject.protocol.T), color="black", linewidth=0.8, linestyle=":", label="deadline $T$")
    ax.set_xlim(0, float(first.t[-1]))
    if start and top > _GROWTH * start:
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(start * 10.0**-_DECADES, 2 * top)
    else:
        ax.set_ylim(0, 1.12 * top or 1)
    return finished(ax, time_label("time $t$", time_unit), r"$\max_k |u_k|$", count_of_signals(subject, runs))
