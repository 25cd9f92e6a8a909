"""Leaders that move as badly as they may, and disturbances that help them; runs with these, without an ODE solver.

The target of the followers is ``X_F* = -L_F^-1 L_FL X_L``. Of the row ``k`` whose ``|eps_k| / u_k`` is largest, ``eps =
X_F - X_F*``, leaders take the signs that part target and follower; every follower is pushed away from its own target.

Over a step from ``s_i`` to ``s_(i+1)`` of the clock, in which the gain grows to ``g``, leaders move at ``v gain(t)/g``,
and followers are pushed by ``d gain(t)/g``: within the limits of ``v`` and ``d``, and with a step in closed form,

    eps_(i+1) = E eps_i + (I - E) L_F^-1 (d - X*') / g,    E = e^(-L_F (s_(i+1) - s_i)).

Where agents move by themselves ``f(x) = growth x``, by which they part fastest: over a step that multiplies positions
and ``eps`` by ``e^(growth dt)``, and what drives them is as much less before.

Inputs clipped to ``U`` move ``eps`` by ``clip(g e, U)`` per unit of time, ``g`` the mean gain of the step, in steps of
Runge and Kutta.

So without these and the sign term every run is a solution, up to rounding. The sign term is held over steps, at a value
that ``mu sign(e)`` takes where the step ends: of any within ``mu`` where ``e`` is 0 there, so that it stays 0.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from lmi.blas_threads import one_thread
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.io import as_graph, as_state
from ptcc_certify.graphs.rationals import whole_number
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.base import Protocol, refuse_no_protocol
from ptcc_certify.model.late_messages import MovingLeaders
from ptcc_certify.model.refusals import refuse_leader_groups, refuse_together
from ptcc_certify.simulation.cvodes import Tolerances
from ptcc_certify.simulation.nominal import MOST_STEPS, STEP_SHARE, Instants, steps_towards
from ptcc_certify.simulation.trajectory import JUST_BEFORE, Conditions, Setup, Trajectory

#: Steps up to T; how near they come; where a run ends.
STEPS, NEAREST, PAST = 800, 1e-7, 0.5
#: Growth times ``T`` at most: floats end at ``e^709``.
_LARGEST_GROWTH = 400
#: Iterations for a sign term at most, and what they may change of it at last, relative to its gain.
_ITERATIONS, _CONVERGED = 1000, 1e-12


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
        refuse_together(None, leaders)
        refuse_leader_groups(structure, f"{leaders.asked}: a run")
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
        self.speed, self.delta, self.growth = (
            float(x or 0) for x in (leaders.speed, leaders.disturbance, leaders.growth)
        )
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


@gated
@one_thread()
def simulate_tracking(
    graph: Any,
    protocol: Protocol,
    leaders: MovingLeaders,
    x0: Any,
    *,
    u: np.ndarray | None = None,
    steps: int = STEPS,
    gain_cap: Fraction | None = None,
) -> Trajectory:
    """Run followers of leaders that move away from the follower that is farthest off, as fast as they may.

    Parameters
    ----------
    graph : graph-like
        N agents, in whatever form :func:`ptcc_certify.as_graph` takes; all leaders are single nodes.
    protocol : Protocol
        The nominal one.
    leaders : MovingLeaders
    x0 : state-like
        The initial state, whatever :func:`ptcc_certify.as_state` takes.
    u : (F,) array, optional
        By which distances are compared, positive; dimensionless.
    steps : int
        Up to ``T``, about.
    gain_cap : Fraction, optional
        The gain is at most this, 1/time/weight.

    Returns
    -------
    Trajectory
        From 0 beyond ``T``; the input of a leader is its velocity.

    Raises
    ------
    HypothesisError
        A leader belongs to a group.
    ParameterError
        There are more than 120 agents, the protocol is not the nominal one, a number is outside its domain, or the
        state does not fit the graph.

    References
    ----------
    The sliding-mode term is that of protocol (8) of [Zhu]_, with ``e_k`` in place of ``sigma_k``.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    >>> p = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> run = simulate_tracking(graph, p, MovingLeaders(speed=1), [1, 0, 0])
    >>> at = int(np.argmin(abs(run.t - 1)))
    >>> abs(run.states - run.targets)[:, at].max() < 1e-6
    np.True_
    """
    refuse_no_protocol(protocol)
    if isinstance(leaders, MovingLeaders) and (leaders.growth or 0) * protocol.T > _LARGEST_GROWTH:
        raise ParameterError(
            "growth", f"times T is above {_LARGEST_GROWTH}: states leave the range of floats; give less"
        )
    structure, steps = analyse(as_graph(graph)), whole_number(steps, "steps", 2, MOST_STEPS)
    worst = WorstLeaders(structure, protocol, leaders, u)
    F, heads = worst.followers, worst.heads
    x = np.array([float(value) for value in as_state(x0, structure.graph, "x0")])
    conditions = Conditions(None if gain_cap is None else GainLimits(gain_cap=gain_cap), leaders=leaders)
    run = Setup(structure.graph, protocol, _instants(float(protocol.T), steps), conditions)
    t, remaining, _ = run.instants
    step_of, passed, highest = _Step(worst, leaders), np.diff(t), run.gains_before()[1:]
    clock = np.diff(run.gain.clock(t, np.maximum(remaining, JUST_BEFORE)))
    states, targets, inputs = np.zeros((3, t.size, structure.graph.n_nodes))
    lead, eps = x[heads], x[F] - worst.Q @ x[heads]
    grown = np.exp(worst.growth * passed)
    for i in range(t.size):
        states[i, heads] = targets[i, heads] = lead
        targets[i, F] = worst.Q @ lead
        states[i, F] = targets[i, F] + eps
        inputs[i, F] = -run.gains[i] * (worst.L_F @ eps)
        if i < passed.size:
            moved, eps = step_of(eps * grown[i], clock[i], highest[i], passed[i])
            lead, inputs[i, heads] = lead * grown[i] + moved, moved / passed[i]
        inputs[i, F] = step_of.clip(inputs[i, F] + step_of.term, 1.0)
    return run.stepped(states.T, Tolerances(NEAREST, NEAREST), held_input=inputs.T, targets=targets.T)


def _instants(T: float, steps: int) -> Instants:
    """Return the instants of a run, which goes on beyond ``T``."""
    remaining = steps_towards(T, T / steps, STEP_SHARE, NEAREST) / T
    later = T + np.linspace(0, PAST * T, max(steps // 4, 2))[1:]
    t = np.append(T * (1 - remaining), later)
    return Instants(t, np.append(remaining, np.zeros(later.size)), np.zeros(t.size))


class _Step:
    """One step of the deviations, at the worst velocities and disturbances; ``term`` is the latest sign term."""

    def __init__(self, worst: WorstLeaders, leaders: MovingLeaders):
        self.worst, self.L_F = worst, worst.L_F
        self.inverse = np.linalg.inv(worst.L_F)
        self.sign = None if leaders.sign_gain is None else float(leaders.sign_gain)
        self.term = np.zeros(worst.followers.size)
        self.saturation = np.inf if leaders.saturation is None else float(leaders.saturation)

    def clip(self, moved: np.ndarray, dt: float) -> np.ndarray:
        """Return what inputs that are clipped leave of what they would move agents by in so long a time."""
        return np.clip(moved, -self.saturation * dt, self.saturation * dt)

    def __call__(self, eps: np.ndarray, ds: float, gain: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much leaders move, and the deviations after the step."""
        if np.isinf(gain):
            return np.zeros(self.worst.heads.size), eps + self.clip(-eps, dt)
        if np.abs(self.L_F @ eps).max() * gain > self.saturation:  # beside which nothing else acts
            return np.zeros(self.worst.heads.size), self._clipped(eps, ds, dt)
        v = self.worst.velocities(eps)
        push, E = self.worst.pushes(eps) - self.worst.Q @ v, _decay(self.L_F * ds)
        passed = (np.eye(eps.size) - E) / gain
        new = E @ eps + passed @ (self.inverse @ push)
        if self.sign:
            self.term = _sign_term(passed, -(self.L_F @ new), self.sign, self.term)
            new = new + self.inverse @ (passed @ self.term)
        return v * ds / gain, new

    def _clipped(self, eps: np.ndarray, ds: float, dt: float) -> np.ndarray:
        """Return the deviations after a step in which some inputs are clipped."""
        count = max(4, int(np.ceil(4 * ds * np.abs(self.L_F).sum(axis=1).max())))
        h, g = dt / count, ds / dt
        for _ in range(count):
            k1 = self.clip(-g * (self.L_F @ eps), 1.0)
            k2 = self.clip(-g * (self.L_F @ (eps + h / 2 * k1)), 1.0)
            k3 = self.clip(-g * (self.L_F @ (eps + h / 2 * k2)), 1.0)
            k4 = self.clip(-g * (self.L_F @ (eps + h * k3)), 1.0)
            eps = eps + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return eps


def _sign_term(A: np.ndarray, e: np.ndarray, mu: float, term: np.ndarray) -> np.ndarray:
    """Return ``u`` in ``mu sign(e - A u)``, any of ``[-mu, mu]`` where that is 0, from a first guess.

    The sums of ``|e^(-L_F s)|`` over rows are at most 1, so that the diagonal of ``A`` dominates: they converge.
    """
    diagonal = np.diag(A)
    for _ in range(_ITERATIONS):
        before, term = term, np.clip(term + (e - A @ term) / diagonal, -mu, mu)
        if np.abs(term - before).max() <= _CONVERGED * mu:
            break
    return term


def _decay(A: np.ndarray) -> np.ndarray:
    from scipy.linalg import expm

    return np.asarray(expm(-A))
