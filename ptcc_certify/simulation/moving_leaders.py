"""Runs with leaders that move as badly as they may, without an ODE solver.

Over a step from ``s_i`` to ``s_(i+1)`` of the clock, in which the gain grows to ``g``, leaders move at ``v gain(t)/g``,
and followers are pushed by ``d gain(t)/g``: within the limits of ``v`` and ``d``, and with a step in closed form,

    eps_(i+1) = E eps_i + (I - E) L_F^-1 (d - X*') / g,    E = e^(-L_F (s_(i+1) - s_i)).

So without the sign term every run is a solution, up to rounding. The sign term is held over steps, at a value that
``mu sign(e)`` takes where the step ends: of any within ``mu`` where ``e`` is 0 there, so that it stays 0.
"""

from __future__ import annotations

import time
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.blas_threads import one_thread
from ptcc_certify.errors import gated
from ptcc_certify.graphs.io import as_graph, as_state
from ptcc_certify.graphs.rationals import whole_number
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.base import Protocol, refuse_no_protocol
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.simulation.instants import steps_towards
from ptcc_certify.simulation.late_messages import stepped_run
from ptcc_certify.simulation.trajectory import Conditions, Trajectory
from ptcc_certify.simulation.worst_leaders import WorstLeaders

#: Steps up to T; the share of what is left of T that a step takes; how near they come; where a run with sign term ends.
STEPS, SHARE, NEAREST, PAST = 800, 0.02, 1e-7, 0.5
#: Most steps of a run.
MOST_STEPS = 20_000
#: Iterations for a sign term at most, and what they may change of it at last, relative to its gain.
_ITERATIONS, _CONVERGED = 1000, 1e-12


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
    structure, steps = analyse(as_graph(graph)), whole_number(steps, "steps", 2, MOST_STEPS)
    worst = WorstLeaders(structure, protocol, leaders, u)
    F, heads, L_F, Q = worst.followers, worst.heads, worst.L_F, worst.Q
    x = np.array([float(value) for value in as_state(x0, structure.graph, "x0")])
    limits = GainLimits(gain_cap=gain_cap)
    limited = limits.limit(protocol.gain)
    t, clock, last = _grid(limited, steps)
    step_of = _Step(worst, leaders)
    states, targets, inputs = np.zeros((3, t.size, structure.graph.n_nodes))
    lead, eps = x[heads], x[F] - Q @ x[heads]
    begin = time.perf_counter()
    gain = limited.value(t, np.maximum(1 - t / float(protocol.T), 0))
    for i in range(t.size):
        states[i, heads] = targets[i, heads] = lead
        targets[i, F] = Q @ lead
        states[i, F] = targets[i, F] + eps
        inputs[i, F] = -gain[i] * (L_F @ eps)
        if i + 1 < t.size:
            moved, eps = step_of(eps, clock[i], last[i])
            lead, inputs[i, heads] = lead + moved, moved / (t[i + 1] - t[i])
        inputs[i, F] += step_of.term
    conditions, seconds = Conditions(None if limits.ideal else limits, leaders=leaders), time.perf_counter() - begin
    run = stepped_run(structure.graph, protocol, t, states.T, inputs.T, conditions, NEAREST, seconds)
    return replace(run, targets=targets.T)


def _grid(limited: LimitedGain, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return instants, and of every step the clock that passes and the largest gain, infinite up to ``T`` uncapped."""
    T = float(limited.gain.T)
    remaining = steps_towards(T, T / steps, SHARE, NEAREST) / T
    later = np.linspace(0, PAST * T, max(steps // 4, 2))[1:]
    t, seen = T * (1 - remaining), np.maximum(remaining, NEAREST * 1e-3)
    values = limited.value(t[1:], seen[1:])
    if not limited.bounded:
        values[-1] = np.inf
    low = float(limited.value(2 * T))
    passed = np.concatenate([np.diff(limited.clock(t, seen)), low * np.diff(later, prepend=0)])
    return np.concatenate([t, T + later]), passed, np.concatenate([values, np.full(later.size, low)])


class _Step:
    """One step of the deviations, at the worst velocities and disturbances; ``term`` is the latest sign term."""

    def __init__(self, worst: WorstLeaders, leaders: MovingLeaders):
        self.worst, self.L_F = worst, worst.L_F
        self.inverse = np.linalg.inv(worst.L_F)
        self.sign = None if leaders.sign_gain is None else float(leaders.sign_gain)
        self.term = np.zeros(worst.followers.size)

    def __call__(self, eps: np.ndarray, ds: float, gain: float) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much leaders move, and the deviations after the step."""
        if np.isinf(gain):
            return np.zeros(self.worst.heads.size), np.zeros_like(eps)
        v = self.worst.velocities(eps)
        push, E = self.worst.pushes(eps) - self.worst.Q @ v, _decay(self.L_F * ds)
        passed = (np.eye(eps.size) - E) / gain
        new = E @ eps + passed @ (self.inverse @ push)
        if self.sign:
            self.term = _sign_term(passed, -(self.L_F @ new), self.sign, self.term)
            new = new + self.inverse @ (passed @ self.term)
        return v * ds / gain, new


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
