"""Where every agent of one graph is proved to be over time, and whether anybody's run is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptcc_certify.errors import ParameterError

#: By how much ``1 - t/T`` may be larger than what floats make of it.
_EPSILON = 4 * np.finfo(float).eps
#: What is added for rounding, relative to the largest state.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Tube:
    """Bounds of every state over time: ``low <= x_k(t) <= high``; infinite where nothing is proved.

    Attributes
    ----------
    t : (M,) array
    low, high : (N, M) arrays
        In a formation of positions. While leaders move they are about targets, which depend on the run.
    labels : tuple of str
    """

    t: np.ndarray
    low: np.ndarray
    high: np.ndarray
    labels: tuple[str, ...]

    def compare(self, x: Any, tolerance: float = 0) -> Compared:
        """Compare states at the instants with the bounds.

        Parameters
        ----------
        x : (N, M) or (M, N) array_like
            Measured or simulated by whomever; where N = M agents are rows.
        tolerance : float
            By how much states may be off, such as the noise of a sensor.

        Returns
        -------
        Compared

        Raises
        ------
        ParameterError
            The shape is another one, or a state is not finite.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
        >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
        >>> tube = cert.tube([0, 0.5, 0.9])
        >>> tube.compare([[3, -0.7, -0.995], [5, 1.2, 1.002]])
        Compared(inside)
        >>> tube.compare([[3, -0.7, -0.995], [5, 2.5, 1.002]])
        Compared(bob is 1.13 outside at t = 0.5)
        """
        x = np.asarray(x, dtype=float)
        n, m = self.low.shape
        if x.shape not in ((n, m), (m, n)):
            raise ParameterError(f"states of {n} agents at {m} instants have shape ({n}, {m}), not {x.shape}")
        x = x if x.shape == (n, m) else x.T
        if not np.isfinite(x).all():
            raise ParameterError("a state is not finite; leave out instants that were not measured")
        slack = tolerance + _ROUNDING * float(np.abs(x).max(initial=0))
        outside = np.maximum(np.maximum(self.low - x, x - self.high) - slack, 0)
        k, at = np.unravel_index(int(outside.argmax()), outside.shape)
        return Compared(float(outside[k, at]), self.labels[k], float(self.t[at]))


@dataclass(frozen=True, repr=False)
class Compared:
    """By how much a run is outside its tube, at worst; 0 where it is inside at all instants.

    Attributes
    ----------
    outside : float
    agent : str
    t : float
        Whose state is farthest outside, and when.
    """

    outside: float
    agent: str
    t: float

    @property
    def inside(self) -> bool:
        """Whether every state is where it is proved to be."""
        return self.outside == 0

    def __repr__(self) -> str:
        where = "inside" if self.inside else f"{self.agent} is {self.outside:.3g} outside at t = {self.t:.4g}"
        return f"Compared({where})"


def tube_of(proof: Any, t: Sequence[float] | np.ndarray, targets: np.ndarray | None = None) -> Tube:
    """Return where every agent is proved to be at instants.

    With late messages, moving leaders, a gain cap beside these, and of vehicles that exchange virtual positions it is
    what ``late`` bounds; under limits of the gain alone nothing is proved before ``T``. Otherwise it is without noise
    and without disturbances of the nominal protocol. Through a reaching phase of the sliding mode bounds are integrated
    in floats: numerical.

    Parameters
    ----------
    proof : :class:`~ptcc_certify.certificate.graph_proof.GraphProof`
        Of single integrators, or of vehicles that exchange virtual positions.
    t : (M,) array_like
        From 0 on, in units of time.
    targets : (N, M) array, optional
        Where agents aim at, less places, while leaders move: of the run that is compared.

    Raises
    ------
    ParameterError
        There is no initial state, an instant is not finite or before 0; or leaders move, and no targets are given.
    """
    proof.require_initial_state()
    t, late = np.atleast_1d(np.asarray(t, dtype=float)), proof.late
    if t.ndim != 1 or not (np.isfinite(t) & (t >= 0)).all():
        raise ParameterError("t", "is no list of finite instants from 0 on")
    if proof.leaders_move and targets is None:
        raise ParameterError("while leaders move where agents should be depends on their way; give their targets")
    n = proof.graph.n_nodes
    off = np.full((n, t.size), np.inf)
    if proof.final_state is None:
        return Tube(t, -off, off, proof.graph.labels)
    if late is not None and late.says_something:
        if late.vehicles is not None:
            off = late.vehicles_over_time(t)[0]
        else:
            alone = [v for c in proof.structure.closed_components if len(c.nodes) == 1 for v in c.nodes]
            off[alone] = 0  # single leaders are their own aims
            off[late.followers] = late.deviation_bound(t)
            for one in late.of_all:
                off = np.fmin(off, one.over_time(late.case, t).bound)
    elif not proof.limits and not proof.leaders_move and late is None:
        left = 1 - t / float(proof.protocol.gain.T)
        off = proof.deviation_bound(np.where(left > 0, np.minimum(left + _EPSILON, 1), 0))
    aims = np.asarray(proof.final_state, dtype=float)[:, None] if targets is None else targets
    if proof.offsets is not None:
        aims = aims + np.array([float(h) for h in proof.offsets])[:, None]
    return Tube(t, aims - off, aims + off, proof.graph.labels)
