"""The error of a run under its proved bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled

#: Horizontal axes of the decay, and their labels.
_DECAY_AXES = {"left": "remaining time, $1 - t/T$", "time": "time, $t/T$", "clock": "stretched clock $s(t)$"}


@styled
def plot_decay(certificate: Certificate, ax: Axes | None = None, *, axis: str = "left") -> Axes:
    """Draw ``||E(t)|| / ||E(0)||`` of the simulated run under its proved bounds; the vertical axis is logarithmic.

    Thick: the bound, the best of all proved Lyapunov functions at every instant. Thin: each of them. Dashed: the
    paper's. Dotted: the integrator's floor, below which the run says nothing. If only Theorem 1.1's own coordinates
    were proved, ``||eps(t)||`` instead.

    Parameters
    ----------
    certificate : Certificate
        With a trajectory and a proved rate.
    ax : Axes, optional
    axis : {"left", "time", "clock"}
        Horizontally the time left ``1 - t/T``, logarithmic, running towards the deadline; or ``t/T``; or the stretched
        clock ``s(t)``, on which each bound is a straight line where nothing but a rate is at work.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        There is nothing to draw, or an unknown axis.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [plot_decay(cert, axis=name).get_xlabel() for name in ("left", "time", "clock")]
    ['remaining time, $1 - t/T$', 'time, $t/T$', 'stretched clock $s(t)$']
    """
    if axis not in _DECAY_AXES:
        raise ValueError(f'axis "{axis}" is unknown; one of {", ".join(_DECAY_AXES)}')
    run, envelope, x0 = certificate.trajectory, certificate.envelope, certificate.initial_state
    if run is None or x0 is None or certificate.comparison is None or not envelope.functions:
        raise ValueError("the certificate holds no simulated run with a proved bound")
    ax, before = axes_of(ax), run.remaining > 0
    unit = float(np.abs(run.states).max(initial=0)) or 1.0  # in which squares neither overflow nor vanish
    remaining, states = run.remaining[before], run.states[:, before] / unit
    place = {"left": remaining, "time": 1 - remaining, "clock": run.clock[before]}[axis]
    functions = [m for m in envelope.functions if m.coordinates == envelope.coordinates]
    norm = np.linalg.norm(functions[0].coordinates_of(states, certificate.graph.laplacian()), axis=0)
    bound = envelope.norm_bound(remaining, x0) / unit
    scale = float(norm[0]) or float(bound[0])
    if scale == 0:
        raise ValueError("the agents begin where they end: nothing decays")
    for number, function in enumerate(functions if len(functions) > 1 else ()):
        alone = replace(envelope, functions=(function,)).norm_bound(remaining, x0) / unit / scale
        if function.kind == "paper":
            ax.plot(place, alone, color="black", linewidth=0.9, linestyle="--", label="the paper's")
        else:
            label = "each Lyapunov function" if all(m.kind == "paper" for m in functions[:number]) else None
            ax.plot(place, alone, color=BOUND, linewidth=0.7, alpha=0.55, label=label)
    ax.plot(place, bound / scale, color=BOUND, linewidth=1.6, label="proved bound")
    if norm[0] > 0:
        ax.plot(place, np.maximum(norm / scale, 1e-300), color=RUN, label="simulated (CVODES)")
        floor = FLOOR_FACTOR * run.rtol * float(np.abs(states).max()) * _row_sum(certificate)
        ax.axhline(floor / scale, color=BEHIND, linewidth=0.9, linestyle=":", label="integrator's floor")
        least = min(float((norm / scale).min()), floor / scale)
        ax.set_ylim(max(least, 1e-18) / 3, 3 * max(float((norm / scale).max()), float((bound / scale).max())))
    ax.set_yscale("log")
    if axis == "left":
        ax.set_xscale("log", subs=[])  # ticks at decades only
        ax.invert_xaxis()
    name = "E" if envelope.coordinates == "E" else r"\varepsilon"
    return finished(ax, _DECAY_AXES[axis], rf"$\|{name}(t)\| \,/\, \|{name}(0)\|$")


def _row_sum(certificate: Certificate) -> float:
    """Bound ``||dz||`` for an error of 1 in every state."""
    if certificate.envelope.coordinates == "eps":
        return 2 * math.sqrt(certificate.graph.n_nodes)
    return float(np.linalg.norm(abs(certificate.graph.laplacian()).sum(axis=1)))
