"""The initial state of a set from which the input gets largest, in floating point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ptcc_certify.checker.input_bounds import Starts
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols import Protocol


@dataclass(frozen=True)
class WorstStart:
    """A start of the set from which the input gets largest, in floating point.

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
    The protocol (4) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> from ptcc_certify.protocols import NominalProtocol
    >>> follower = analyse(SignedDigraph.from_edges([(1, 2, -2)]))
    >>> from ptcc_certify.bounds.input import box
    >>> worst_start(follower, NominalProtocol(1, 1, 1, 1), box([0, 0], [1, 1]))
    WorstStart(x0=array([1., 1.]), agent=1, t=0.0, size=8.0)
    """

    x0: np.ndarray
    agent: int
    t: float
    size: float


def worst_start(
    structure: Structure, protocol: Protocol, starts: Starts, *, samples: int = 120, latest: float = 14.0
) -> WorstStart:
    """Return the start from which some ``|u_k(t)|`` is largest under the nominal part of the protocol (numerical).

    ``u(t) = -gain L e^(-L s) X(0)`` is linear in the start: at each of ``samples`` instants, evenly spaced in
    ``z = ln(T/(T - t))`` up to ``latest``, the maximum over the set is exact.

    Parameters
    ----------
    structure : Structure
        Of N agents.
    protocol : Protocol
    starts : Starts
        Of N numbers.
    samples : int
        Number of instants.
    latest : float
        ``ln(T/(T - t))`` of the last one, dimensionless.

    Returns
    -------
    WorstStart

    References
    ----------
    The protocol (4) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.protocols import NominalProtocol
    >>> from ptcc_certify.graphs.structure import analyse
    >>> from ptcc_certify.bounds.input import starts_within
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]))
    >>> worst = worst_start(pair, NominalProtocol(1, 1, 1, 1), starts_within(pair, 3))
    >>> worst.x0, worst.t, worst.size
    (array([-3., -3.]), 0.0, 12.0)
    """
    from scipy.linalg import expm

    L = structure.graph.dense_laplacian()
    center = np.array([nearest_float(x) for x in starts.center])
    radius = np.array([nearest_float(x) for x in starts.radius]) if starts.radius else np.zeros(len(center))
    axes = np.array([[nearest_float(x) for x in axis] for axis in starts.axes])
    best: WorstStart | None = None
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
            best = WorstStart(x0, k, float(gain.time_at_tau(z)), size)
    assert best is not None
    return best
