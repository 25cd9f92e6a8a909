"""Distributions over the agents of a graph that is too large to be drawn: their final states, and their degrees."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, axes_of, finished, styled

#: Bars of a histogram.
BARS = 40
#: Share of their size by which values differ that share a bar, and what is drawn as 0.
_ALIKE, _SMALL = 1e-6, 1e-290


@styled
def plot_final_states(certificate: Certificate, *, ax: Axes | None = None) -> Axes:
    """Draw how many agents end where: a histogram of the final states, followers upon leaders.

    Parameters
    ----------
    certificate : Certificate
        With an initial state.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        The certificate has no final state.

    Examples
    --------
    >>> path = SignedDigraph.from_edges([("a", "b", -1), ("b", "c", 1)])
    >>> cert = certify(path, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [2, 0, 0], asks=Asks(simulation=False))
    >>> ax = plot_final_states(cert)
    >>> int(sum(bar.get_height() for bar in ax.patches))
    3
    """
    if (ends := certificate.graph_proof.final_positions) is None:
        raise ParameterError("the certificate has no final state; certify the graph with x0")
    values, followers = np.asarray(ends), certificate.graph_proof.structure.followers
    leaders = np.delete(np.arange(values.size), followers)
    ax = axes_of(ax)
    parts = {"leaders": (values[leaders], RUN), "followers": (values[followers], BEHIND)}
    there = {name: part for name, part in parts.items() if part[0].size}
    samples, colours = zip(*there.values(), strict=True)
    ax.hist(samples, BARS, range=_extent(values), color=list(colours), label=list(there), stacked=True)
    return finished(ax, "final state", "agents")


def _extent(values: np.ndarray) -> tuple[float, float]:
    """Return between which values bars stand; of values that differ in their last digits only, a range about them."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low > _ALIKE * size and high - low > _SMALL:
        return low, high
    about = 0.5 if size < _SMALL else 0.05 * size
    return low - about, high + about


@styled
def plot_degrees(graph: SignedDigraph, *, ax: Axes | None = None) -> Axes:
    """Draw how many agents listen to at least ``d`` others, and how many are heard by at least ``d``, over ``d``.

    Parameters
    ----------
    graph : SignedDigraph
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> ax = plot_degrees(SignedDigraph.from_edges([("a", "b", 1), ("a", "c", -1)]))
    >>> [line.get_label() for line in ax.lines]
    ['listens to', 'is heard by']
    """
    ax = axes_of(ax)
    for ends, name, colour, line in (
        (graph.target, "listens to", RUN, "-"),
        (graph.source, "is heard by", BOUND, "--"),
    ):
        degrees = np.sort(np.bincount(ends, minlength=graph.n_nodes))
        present = np.unique(degrees[degrees > 0])
        at_least = graph.n_nodes - np.searchsorted(degrees, present)
        ax.plot(present, at_least, color=colour, linestyle=line, label=name, drawstyle="steps-pre")
    ax.set_xscale("log")
    ax.set_yscale("log")
    return finished(ax, "at least so many others", "agents")
