"""Runs with late messages, without an ODE solver.

Over a step from ``t_i`` to ``t_(i+1)`` what an agent hears is held, as it was at an instant ``t_j`` between ``t_(i+1) -
age`` and ``t_i``: the delay ``t - t_j`` is one of those that are allowed, and the step has a closed form,

    x_k(t_(i+1)) = h_k + (x_k(t_i) - h_k) e^(-D_k (s(t_(i+1)) - s(t_i))),    h_k = sum_l w_kl y_kl / D_k,

exact where the gain has its pole: the run is a solution, up to rounding. With an own state that is late the whole right
side is held. What is heard at once is no solution if it is held: it is taken to change evenly with the clock over a
step, which is of second order in the step, and leaders of a group that hear each other at once move exactly. Leaders
that move as they like may do so over a step, for who hears them late hears of it in the next; disturbances are a
constant times the gain within a step, at most ``d``.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_graph, as_state
from ptcc_certify.graphs.rationals import shorten, whole_number
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.base import Protocol, refuse_no_protocol
from ptcc_certify.model.gain import Gain
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders, told_leaders
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.model.refusals import refuse_together
from ptcc_certify.simulation.cvodes import Tolerances
from ptcc_certify.simulation.moving_leaders import WorstLeaders
from ptcc_certify.simulation.nominal import MOST_STEPS, STEP_SHARE, Instants, steps_towards
from ptcc_certify.simulation.trajectory import Conditions, Setup, Trajectory

Pattern = Literal["oldest", "fresh", "varying", "square"]
PATTERNS = ("oldest", "fresh", "varying", "square")
#: Corrections of what is heard at once, in a step, at most.
_CORRECTIONS = 100
#: Instants of a run, about; the share of ``T`` down to which they come nearer to it.
STEPS, NEAREST = 1500, 1e-9
#: How many times leaders in groups fall by a factor e until they are settled.
_SETTLED = 40
#: Terms of the exponential series of a matrix whose 1-norm is 1 at most; what is left out is below ``2^-53``.
_TERMS = 19
#: States of a run at most.
MOST_STATES = 50_000_000
#: What a step loses, relatively.
_ROUNDING = 2.0**-50
#: Steps in the largest delay, at least, and steps of a run that the least one may ask for.
IN_DELAY, _MOST_FOR_LEAST = 6, 5000


@gated
def simulate_late(
    graph: Any,
    protocol: Protocol,
    messages: LateMessages,
    x0: Any,
    *,
    pattern: Pattern | tuple[Pattern, int] = "oldest",
    steps: int = STEPS,
    deadlines: Sequence[Fraction] | None = None,
    leaders: MovingLeaders | None = None,
) -> Trajectory:
    """Run a protocol with late messages up to its deadline.

    Parameters
    ----------
    graph : graph-like
        N agents, in whatever form :func:`ptcc_certify.as_graph` takes.
    protocol : Protocol
    messages : LateMessages
        Values are off by the whole ``value_error``, to either side. What is heard over an edge is as old as a step
        where its own delay is less than that, but not 0.
    x0 : state-like
        The state up to 0, whatever :func:`ptcc_certify.as_state` takes.
    pattern : {"oldest", "fresh", "varying", "square"}, or one with a seed
        As old as allowed; as fresh as allowed, but for the step; between the two like a sine of its own for every edge;
        from the one to the other and back at random instants. With a seed of what is random: ``("varying", 3)``.
    steps : int
        Instants, about.
    deadlines : sequence of N Fraction, optional
        Of every agent by itself, in place of ``T``; in units of time.
    leaders : MovingLeaders, optional
        Without a sign term, under the nominal protocol: leaders move away from the follower that is farthest from its
        target, as fast as they may, and disturbances drive all followers off.

    Returns
    -------
    Trajectory
        Its input is of what agents hear, ``gain sum_l w_kl (y_kl -+ x_k)``.

    Raises
    ------
    HypothesisError
        Leaders are to move, and one belongs to a group.
    ParameterError
        The pattern is unknown, a number is outside its domain, the state does not fit the graph, the delay is so short
        that the run would take more than 20,000 steps, or steps and agents are so many that it would not fit memory.

    References
    ----------
    Feyzmahdavian, Charalambous, Johansson, Exponential stability of homogeneous positive systems of degree one with
    time-varying delays, IEEE Trans. Automat. Control 59 (2014).

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> run = simulate_late(pair, protocol, LateMessages(delay="0.1"), [1, 0, 0])
    >>> run.states[:, -1].round(3)
    array([1.   , 1.   , 0.996])
    """
    word, seed = pattern if isinstance(pattern, tuple) and len(pattern) == 2 else (pattern, 0)
    if word not in PATTERNS:
        raise ParameterError(f'pattern "{shorten(str(word))}" is unknown; one of {", ".join(PATTERNS)}')
    refuse_no_protocol(protocol)
    leaders = told_leaders(messages, leaders) if isinstance(messages, LateMessages) else leaders
    for name in ("growth", "saturation"):
        if getattr(leaders, name, None) is not None:
            raise ParameterError(name, "is simulated of values that are neither late nor off; leave it out, or these")
    if not isinstance(messages, LateMessages):
        raise ParameterError("messages", f"= {shorten(repr(messages))} is none; give LateMessages(delay='0.01'), say")
    if leaders is not None and not isinstance(leaders, MovingLeaders):
        raise ParameterError("leaders", f"= {shorten(repr(leaders))} is none; give MovingLeaders(speed=1), say")
    graph, leaders = as_graph(graph), told_leaders(messages, leaders)
    steps, random = whole_number(steps, "steps", 2, MOST_STEPS), whole_number(seed, "seed", 0, 2**63)
    if deadlines is not None and not isinstance(deadlines, Sequence):
        raise ParameterError("deadlines", f"= {shorten(repr(deadlines))} are none; give one for each agent")
    if deadlines is not None and len(deadlines) != graph.n_nodes:
        raise ParameterError(f"deadlines are {len(deadlines)} for {graph.n_nodes} agents; give one for each")
    first = [float(x) for x in as_state(x0, graph, "x0")]
    hearing = _Hearing(graph, messages, float(protocol.T), word, np.random.default_rng(random))
    t = hearing.instants(steps)
    if t.size * graph.n_nodes > MOST_STATES:
        raise ParameterError(
            f"{t.size:,} instants of {graph.n_nodes:,} agents are more than {MOST_STATES:,} states; "
            "the bound needs no run"
        )
    limits = GainLimits(gain_cap=messages.gain_cap)
    conditions = Conditions(None if limits.ideal else limits, messages=messages, leaders=leaders)
    run = Setup(graph, protocol, Instants(t, np.maximum(1 - t / t[-1], 0), np.zeros(t.size)), conditions)
    clocks = run.clock[:, None] if deadlines is None else _own_clocks(run, deadlines)
    with np.errstate(invalid="ignore"):
        steps_of_clock = np.where(np.isinf(clocks[1:]), np.inf, clocks[1:] - clocks[:-1])
    states, errors = np.empty((2, t.size, graph.n_nodes))
    states[0] = first
    D, leading = graph.in_weight(), _Leading(graph, messages)
    fleeing = None if leaders is None else _Fleeing(run, messages, leaders)
    for i in range(t.size - 1):
        heard, own = hearing.sums(i, states)
        step, errors[i] = steps_of_clock[i], heard - (own if messages.own_delay else D * states[i])
        if messages.own_delay:
            states[i + 1] = states[i] + step * (heard - own)
            continue
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            goal = np.where(D > 0, heard / D, states[i])
            left = np.where(np.isfinite(step), np.exp(-D * step), D <= 0)
        states[i + 1] = goal + (states[i] - goal) * left
        if fleeing is not None:
            fleeing.move(i, states, left)
        leading.move(states[i], states[i + 1], step)
        hearing.correct(states[i], states[i + 1], step, left)
    errors[-1] = heard - (own if messages.own_delay else D * states[-1])
    inputs, targets = run.gains * errors.T, None
    if fleeing is not None:
        inputs[fleeing.worst.heads] = fleeing.inputs.T
        targets = fleeing.worst.targets(states.T)
    return run.stepped(states.T, Tolerances(_ROUNDING, _ROUNDING), held_input=inputs, targets=targets)


def can_run(protocol: Protocol, messages: LateMessages) -> bool:
    """Tell whether delays are long enough for a run of at most 20,000 steps.

    Parameters
    ----------
    protocol : Protocol
    messages : LateMessages
    """
    return not messages.age or MOST_STEPS * messages.age >= protocol.T * IN_DELAY


def _own_clocks(run: Setup, deadlines: Sequence[Fraction]) -> np.ndarray:
    """Return the (M, N) clocks of agents with deadlines of their own, infinite from these on."""
    g, clocks = run.protocol.gain, np.empty((run.instants.t.size, run.graph.n_nodes))
    for k, end in enumerate(deadlines):
        clocks[:, k] = LimitedGain(Gain(end, g.rho1, g.rho2, g.kappa), run.gain.limits).clock(run.instants.t)
        clocks[run.instants.t >= float(end) * (1 - 1e-14), k] = np.inf
    return clocks


class _Fleeing:
    """Leaders that move away from the farthest follower over steps, and disturbances that push followers off."""

    def __init__(self, run: Setup, messages: LateMessages, leaders: MovingLeaders):
        refuse_together(messages, leaders)
        if leaders.sign_gain is not None:
            where = "messages are late" if messages.age else "what is heard is off"
            raise ParameterError("sign_gain", f"is not simulated where {where}; leave it out")
        self.worst, self.t = WorstLeaders(analyse(run.graph), run.protocol, leaders), run.instants.t
        self.pull = run.graph.in_weight()[self.worst.followers] * run.gains_before()[:, None]
        self.inputs = np.zeros((run.instants.t.size, self.worst.heads.size))

    def move(self, i: int, states: np.ndarray, left: np.ndarray) -> None:
        """Add to the states after step ``i`` how leaders move, and what pushes followers."""
        worst, F = self.worst, self.worst.followers
        eps = states[i, F] - worst.Q @ states[i, worst.heads]
        self.inputs[i:] = velocity = worst.velocities(eps)
        states[i + 1, worst.heads] += velocity * (self.t[i + 1] - self.t[i])
        states[i + 1, F] += worst.pushes(eps) * (1 - left[F]) / self.pull[i + 1]


class _Leading:
    """Leaders of groups that hear each other at once: they move as ``X' = -gain L X`` does, exactly."""

    def __init__(self, graph: SignedDigraph, messages: LateMessages):
        structure = analyse(graph)
        at_once = messages.leaders_hear_at_once(structure)
        groups = [np.array(c.nodes) for c in structure.closed_components if at_once and len(c.nodes) > 1]
        L: Any = graph.laplacian().tocsr() if groups else None
        self.groups = [(nodes, part := L[nodes][:, nodes].toarray(), _settled_after(part)) for nodes in groups]

    def move(self, before: np.ndarray, after: np.ndarray, step: np.ndarray) -> None:
        """Write the states of leaders after a step of the clock; after an infinite one they are settled."""
        for nodes, L, longest in self.groups:
            after[nodes] = _moved(L * min(float(step.min()), longest), before[nodes])


def _moved(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return ``exp(-A) x``, of small matrices by the series: most steps are short."""
    if np.abs(A).sum(axis=0).max() > 1:
        from scipy.linalg import expm

        return np.asarray(expm(-A) @ x)
    total, term = x, x
    for n in range(1, _TERMS):
        term = A @ term / -n
        total = total + term
    return total


def _settled_after(L: np.ndarray) -> float:
    """Return a length of the clock after which leaders of a group are settled."""
    slowest = min((x.real for x in np.linalg.eigvals(L) if abs(x) > 1e-9 * abs(L).max()), default=1.0)
    return float(_SETTLED / slowest)


class _Hearing:
    """What agents hear over a step: sums over edges of values that are held."""

    def __init__(
        self, graph: SignedDigraph, messages: LateMessages, T: float, pattern: str, random: np.random.Generator
    ):
        self.source, self.target, self.weights, self.n = graph.source, graph.target, graph.weights, graph.n_nodes
        latencies = messages.latencies(graph)
        each = latencies if isinstance(latencies, tuple) else (latencies,)
        self.ages = np.broadcast_to([float(x + messages.held) for x in each], graph.n_edges)
        self.T, self.age, self.pattern, self.random = T, float(messages.age), pattern, random
        self.error, self.own = float(messages.value_error), messages.own_delay
        self.speed = random.uniform(2, 40, graph.n_edges) / T
        self.phase = random.uniform(0, 2 * np.pi, graph.n_edges)
        self.old = random.random(graph.n_edges) < 0.5
        self.signs = np.where(random.random(graph.n_edges) < 0.5, 1.0, -1.0)
        followers = np.isin(self.target, analyse(graph).followers)
        self.at_once = np.flatnonzero(followers & (self.ages == 0) & (not self.own))
        self.degree = graph.in_weight()

    def instants(self, steps: int) -> np.ndarray:
        """Return instants that come near to ``T``: some in the largest delay, one in the least that is not too short.

        A step is a share of what is left until ``T`` at most, a fifth of that where followers hear at once.
        """
        T, age = self.T, self.age
        least = float(self.ages[self.ages > 0].min(initial=age))
        longest = min(T / steps, age / IN_DELAY, max(least, T / _MOST_FOR_LEAST)) if age else T / steps
        if T / longest > MOST_STEPS:
            raise ParameterError(
                f"a delay of {age:.3g} in a run of {T:.6g} takes more than {MOST_STEPS:,} steps; the bound needs no run"
            )
        share = STEP_SHARE / 5 if self.at_once.size else STEP_SHARE
        self.t = T - steps_towards(T, longest, share, NEAREST)
        return self.t

    def correct(self, before: np.ndarray, after: np.ndarray, step: np.ndarray, left: np.ndarray) -> None:
        """Let what followers hear at once change evenly over a step of the clock, in place of being held.

        With ``w/D`` times its change ``c``, ``way = D step`` and ``left = e^-way``, the state gains
        ``c (1 - (1 - left)/way)``; the change is that of the states that are sought, which are found one from another.
        """
        if not self.at_once.size:
            return
        source, target = self.source[self.at_once], self.target[self.at_once]
        with np.errstate(invalid="ignore", divide="ignore"):
            way = np.where(self.degree > 0, self.degree * step, 0.0)
            share = np.where(np.isinf(way), 1.0, np.where(way > 1e-5, 1 - (1 - left) / way, way / 2))
        factor, held = self.weights[self.at_once] * share[target] / self.degree[target], after.copy()
        for _ in range(_CORRECTIONS):
            change = np.bincount(target, factor * (after - before)[source], minlength=self.n)
            last, after[:] = after.copy(), held + change
            if np.abs(after - last).max() <= _ROUNDING * np.abs(after).max():
                return
        from scipy.sparse import coo_array, eye_array
        from scipy.sparse.linalg import spsolve

        shares = coo_array((factor, (target, source)), shape=(self.n, self.n)).tocsc()
        after[:] = spsolve(eye_array(self.n, format="csc") - shares, held - shares @ before)

    def sums(self, i: int, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of ``w y`` and, for an own state that is late, of ``|w| x_k`` as it was."""
        j = self._instants(i)
        values = states[j, self.source]
        if self.error:
            self.signs = np.where(self.random.random(self.signs.size) < 0.05, -self.signs, self.signs)
            values = values + self.error * self.signs
        heard = np.bincount(self.target, self.weights * values, minlength=self.n)
        if not self.own:
            return heard, np.zeros(self.n)
        own = states[j, self.target] + (self.error * self.signs if self.error else 0.0)
        return heard, np.bincount(self.target, np.abs(self.weights) * own, minlength=self.n)

    def _instants(self, i: int) -> np.ndarray:
        """Return for every edge the number of the instant that is heard over the next step."""
        oldest = np.minimum(np.searchsorted(self.t, (self.t[i + 1] - self.ages) * (1 + 1e-13)), i)
        if self.pattern == "oldest":
            return oldest
        if self.pattern == "fresh":
            return np.full(oldest.size, i)
        if self.pattern == "varying":
            share = (1 + np.sin(self.speed * self.t[i] + self.phase)) / 2
            return oldest + np.floor((i - oldest) * share).astype(np.int64)
        self.old ^= self.random.random(self.old.size) < 0.03
        return np.where(self.old, oldest, i)
