"""Leaders that move away from the follower that is farthest off, as fast as they may, and disturbances that help them.

The target of the followers is ``X_F* = -L_F^-1 L_FL X_L``. Of the row ``k`` whose ``|eps_k| / u_k`` is largest, ``eps =
X_F - X_F*``, leaders take the signs that part target and follower; every follower is pushed away from its own target.
"""

from __future__ import annotations

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.refusals import refuse_leader_groups


class WorstLeaders:
    """Single leaders, their followers, and the targets of these.

    Parameters
    ----------
    structure : Structure
    protocol : Protocol
        The nominal one.
    leaders : MovingLeaders
    u : (F,) array, optional
        By which distances are compared, positive; dimensionless.

    Raises
    ------
    HypothesisError
        A leader belongs to a group.
    ParameterError
        There are more than 120 agents, nobody listens, the protocol is another one, or ``u`` does not fit.

    Examples
    --------
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, -1)]))
    >>> worst = WorstLeaders(pair, NominalProtocol(1, 1, 1, 1), MovingLeaders(speed=3, disturbance=1))
    >>> worst.velocities(np.array([0.5])), worst.pushes(np.array([0.5]))
    (array([3.]), array([1.]))
    """

    def __init__(self, structure: Structure, protocol: Protocol, leaders: MovingLeaders, u: np.ndarray | None = None):
        if not isinstance(leaders, MovingLeaders) or protocol.reaching:
            mend = "give it, and MovingLeaders(speed=1), say"
            raise ParameterError(f"leaders that move run under the nominal protocol; {mend}")
        refuse_leader_groups(structure, "leaders that move as they like: a run")
        n, F = structure.graph.n_nodes, structure.followers
        if n > EXACT_NODES:
            raise ParameterError(f"runs with moving leaders are of up to {EXACT_NODES} agents; the graph has {n}")
        if not F.size:
            raise ParameterError("nobody listens to a leader, so nobody tracks; add edges")
        self.followers, self.heads = F, np.setdiff1d(np.arange(n), F)
        L = structure.graph.dense_laplacian()
        self.L_F = L[np.ix_(F, F)]
        try:
            self.Q = -np.linalg.solve(self.L_F, L[np.ix_(F, self.heads)])
        except np.linalg.LinAlgError:
            raise ParameterError("the weights lie too far apart for a run: floats lose who follows whom") from None
        self.speed, self.delta = float(leaders.speed), float(leaders.disturbance)
        try:
            self.weights = np.ones(F.size) if u is None else np.asarray(u, dtype=float)
        except (TypeError, ValueError):
            self.weights = np.empty(0)  # no numbers
        if self.weights.shape != (F.size,) or not (np.isfinite(self.weights) & (self.weights > 0)).all():
            raise ParameterError(f"u is not {F.size} positive numbers, one for each follower; leave it out")

    def velocities(self, eps: np.ndarray) -> np.ndarray:
        """Return the velocities of the leaders, ``(N - F,)``, where followers are off by ``eps``."""
        k = int(np.argmax(np.abs(eps) / self.weights))
        side = 1.0 if eps[k] >= 0 else -1.0
        return np.asarray(-side * np.sign(self.Q[k]) * self.speed)

    def pushes(self, eps: np.ndarray) -> np.ndarray:
        """Return the disturbances of the followers, ``(F,)``."""
        return self.delta * np.where(eps >= 0, 1.0, -1.0)

    def targets(self, states: np.ndarray) -> np.ndarray:
        """Return the targets for ``(N, M)`` states; of leaders their states."""
        targets = states.copy()
        targets[self.followers] = self.Q @ states[self.heads]
        return targets
