"""The initial state of a set from which the input gets largest, in floating point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptcc_certify.bounds.input.initial_sets import read_initial_set
from ptcc_certify.graphs.rationals import nearest_float, whole_number
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import Protocol
from ptcc_certify.model.base import refuse_no_protocol


@dataclass(frozen=True)
class WorstInitialState:
    """The initial state of a set from which the input gets largest, in floating point.

    Attributes
    ----------
    x0 : (N,) array
    agent : int
        Whose input is largest.
    t : float
        When, in units of time.
    size : float
        ``|u_agent(t)|``, in units of the input.

    References
    ----------
    The protocol (4) of [Zhu]_.

    Examples
    --------
    >>> follower = analyse(SignedDigraph.from_edges([(1, 2, -2)]))
    >>> worst_initial_state(follower, NominalProtocol(1, 1, 1, 1), box([0, 0], [1, 1]))
    WorstInitialState(x0=array([1., 1.]), agent=1, t=0.0, size=8.0)
    """

    x0: np.ndarray
    agent: int
    t: float
    size: float


def worst_initial_state(
    graph: Any, protocol: Protocol, initial_set: Any, *, samples: int = 120, latest: float = 14.0
) -> WorstInitialState:
    """Return the initial state with the largest ``|u_k(t)|`` under the nominal part of the protocol (numerical).

    ``u(t) = -gain L e^(-L s) X(0)`` is linear in the initial state: at each of ``samples`` instants, evenly spaced in
    ``z = ln(T/(T - t))`` up to ``latest``, the maximum over the set is exact.

    Parameters
    ----------
    graph : graph-like or Structure
        Whatever :func:`ptcc_certify.as_graph` takes.
    protocol : Protocol
    initial_set : InitialSet or positive number
        Of N numbers; a number ``R`` stands for ``||X(0)||_inf <= R``.
    samples : int
        Number of instants.
    latest : float
        ``ln(T/(T - t))`` of the last one, dimensionless.

    Returns
    -------
    WorstInitialState

    References
    ----------
    The protocol (4) of [Zhu]_.

    Examples
    --------
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]))
    >>> worst = worst_initial_state(pair, NominalProtocol(1, 1, 1, 1), 3)
    >>> worst.x0, worst.t, worst.size
    (array([-3., -3.]), 0.0, 12.0)
    """
    from scipy.linalg import expm

    refuse_no_protocol(protocol)
    structure = analyse(graph)
    initial_set = read_initial_set(structure, initial_set)
    samples = whole_number(samples, "samples", 1, 10**6)
    L = structure.graph.dense_laplacian()
    center = np.array([nearest_float(x) for x in initial_set.center])
    radius = np.array([nearest_float(x) for x in initial_set.radius]) if initial_set.radius else np.zeros(len(center))
    axes = np.array([[nearest_float(x) for x in axis] for axis in initial_set.axes])
    best: WorstInitialState | None = None
    gain = protocol.gain
    for z in np.linspace(0.0, latest, samples):
        M = -float(gain.value_at_remaining(math.exp(-z))) * (L @ expm(-L * float(gain.clock_at_tau(z))))
        middle = M @ center
        reach = np.linalg.norm(M @ axes.T, axis=1) if axes.size else np.abs(M) @ radius
        k = int(np.argmax(np.abs(middle) + reach))
        size = float(abs(middle[k]) + reach[k])
        if best is None or size > best.size * (1 + 1e-12):
            sign = -1.0 if middle[k] < 0 else 1.0
            if axes.size:
                along = axes @ M[k]
                x0 = center + sign * along @ axes / (np.linalg.norm(along) or 1.0)
            else:
                x0 = center + sign * radius * np.sign(M[k])
            best = WorstInitialState(x0, k, float(gain.time_at_tau(z)), size)
    assert best is not None
    return best
