"""The inputs of agents of order n, below what is proved of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from lmi.exact.decimal_rounding import up
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.report.plots.agents import draw_agents, name_agents
from ptcc_certify.report.plots.agents_motion import agents_run
from ptcc_certify.report.plots.peaks import Peak, draw_peaks
from ptcc_certify.report.plots.style import axes_of, finished, styled, time_label


@styled
def plot_agents_input(subject: Any, *, ax: Axes | None = None, time_unit: str = "") -> Axes:
    """Draw ``|u_k(t)|``, in space ``||u_k(t)||``, of one run of agents of order n, and the peak that is proved.

    Lines, names and the axis are those of :func:`~ptcc_certify.report.plots.input.plot_input`. Under the sliding-mode
    protocol the nominal part of the input is drawn; the peak is of the whole.

    Parameters
    ----------
    subject : Certificate of agents of order n, or AgentsTrajectory
    ax : Axes, optional
    time_unit : str
        Of the deadline, for the label of the axis.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The subject leads to no such run.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    >>> ax = plot_agents_input(certify(foes, protocol, [3, 1], agents=Agents(order=2), asks=Asks(method="paper")))
    >>> ax.get_ylabel(), ax.texts[0].get_text()
    ('input $|u_k|$', 'certified peak 46.96')
    """
    run, ax = agents_run(subject), axes_of(ax)
    sliding = run.protocol.base.reaching is not None
    size = np.sqrt((run.input**2).sum(axis=1))
    named = draw_agents(ax, run, size, analyse(run.graph), size=True)
    part = subject.agents if isinstance(subject, Certificate) else None
    largest = None if part is None or part.input is None else max(part.input)
    text = "" if largest is None else f"certified peak {up(largest, 4)}{', sliding terms included' * sliding}"
    draw_peaks(ax, run.t, size, [] if largest is None else [Peak(float(largest), text)])
    ax.axvline(float(run.protocol.gain.T), color="black", linewidth=0.8, linestyle=":", label="deadline $T$")
    name_agents(ax, run, size, named)
    norm = "$|u_k|$" if run.input.shape[1] == 1 else r"$\|u_k\|$"
    return finished(ax, time_label("time $t$", time_unit), f"{'nominal ' * sliding}input {norm}")
