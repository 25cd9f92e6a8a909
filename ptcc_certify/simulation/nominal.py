"""What a run under the nominal protocol meets besides its graph: disturbances and noise, and a gain that is held.

A disturbance ``d`` and noise ``n`` give ``X' = -gain L (X + n) + d``; where nothing drives the agents any more their
course is on the stretched clock again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError, SimulationError, gated
from ptcc_certify.graphs.rationals import as_fraction, number_within, shorten, whole_number
from ptcc_certify.model.disturbance import ExpressionDisturbance, SampledDisturbance, as_disturbance
from ptcc_certify.model.limited_gain import LimitedGain, Periods
from ptcc_certify.model.parameters import parameter, readable
from ptcc_certify.simulation.cvodes import Forcing, Motion, Phase

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact, SignedDigraph
    from ptcc_certify.model import Protocol
    from ptcc_certify.simulation.switching_signals import Course

#: How far a run goes past the deadline unless told otherwise, as a share of it.
PAST = 0.25
#: Samples past the deadline, where nothing drives the agents; where something does, for 40 in a tenth of ``T``.
_PAST_SAMPLES, _DRIVEN_SAMPLES = 5, 100
#: Steps of a run in steps of closed form at most; a step as a share of what is left until ``T``, at most.
MOST_STEPS, STEP_SHARE = 20_000, 0.02
# 1 - t/T at 0.5 T, 0.9 T, 0.99 T.
_MARKS = (0.5, 0.1, 0.01)


class Instants(NamedTuple):
    """Where a run is sampled: ``t``, ``1 - t/T`` and ``1 - t/T_r``, each (M,); the last is 0 without a ``T_r``."""

    t: np.ndarray
    remaining: np.ndarray
    reaching_remaining: np.ndarray

    @property
    def z(self) -> np.ndarray:
        """``ln(T_r/(T_r - t))``, infinite from ``T_r`` on."""
        return minus_log(self.reaching_remaining, 1 - self.reaching_remaining)


def steps_towards(T: float, longest: float, share: float, nearest: float) -> np.ndarray:
    """Return what is left until ``T`` after steps at most so long, each at most a share of what is left, from 0 on.

    The last but one instant is as near to ``T`` as ``nearest`` times ``T``.
    """
    left = [0.0, nearest * T]
    while left[-1] < T:
        left.append(left[-1] + min(longest, left[-1] * share))
    return np.array([*left[:-1], T])[::-1]


def default_instants(
    protocol: Protocol, remaining: float, samples: int, past: float, *, driven: bool = False
) -> Instants:
    """Return instants dense towards ``T_r``, if there is one, and towards ``T``, and evenly in time.

    Past ``T`` they are denser where agents are ``driven``, by a disturbance that may oscillate.

    Raises
    ------
    ParameterError
        A number is outside its domain.
    """
    remaining = number_within(remaining, "remaining", 1e-300, 1 - 2**-53)
    samples = whole_number(samples, "samples", 2, 10**9)
    past = number_within(past, "past", 0, 1e6)
    T_r, T_s, T = (float(x) for x in (protocol.T - protocol.span, protocol.span, protocol.T))
    grid = np.linspace(1, 0, samples)
    if protocol.prescribed:
        grid = np.exp(np.linspace(0, math.log(remaining), samples))
        grid = np.append(grid, np.linspace(1, grid[-1], samples // 2))  # for figures in t
    grid = np.unique(grid)[::-1]
    shares = grid * (T_s / T)
    if protocol.prescribed:
        shares = shares[shares >= remaining * (1 - 1e-12)]
    shares = np.append(shares, [share for share in _MARKS if share < T_s / T])
    between = np.stack([T * (1 - shares), shares, np.zeros(shares.size)])
    between[0, shares == T_s / T] = T_r
    steps = math.ceil(_DRIVEN_SAMPLES * max(past / PAST, 1)) if driven else _PAST_SAMPLES
    later = T * (1 + past * np.arange(steps + 1 if past else 1) / steps)
    parts = [between, np.stack([later, np.zeros(later.size), np.zeros(later.size)])]
    if T_r:
        marks = np.array([T * (1 - share) for share in _MARKS])
        early = np.append(grid, 1 - marks[marks < T_r] / T_r)
        late = np.minimum((T_s + T_r * early) / T, 1.0)  # 0.8 + 0.9 is more than 1.7 in floats
        parts.append(np.stack([T_r * (1 - early), late, early]))
    table = np.concatenate(parts, axis=1)
    table = table[:, np.lexsort((table[0], -table[1], -table[2]))]
    fresh = np.append(True, np.diff(table, axis=1).any(axis=0))
    return Instants(*table[:, fresh])


def wanted_instants(protocol: Protocol, times: Iterable[Exact]) -> Instants:
    """Return the instants wanted, what remains until ``T`` and ``T_r`` from exact rationals.

    Raises
    ------
    ParameterError
        There are none, they are no numbers, negative, or not increasing.
    """
    try:
        wanted = [as_fraction(t, "an instant") for t in times]  # type: ignore[arg-type]
        t = np.array([float(value) for value in wanted])
    except (NumberError, TypeError, OverflowError) as error:
        raise ParameterError("times", f"{error}") from None
    if not wanted:
        raise ParameterError("times is empty; give at least one instant")
    if wanted[0] < 0:
        raise ParameterError(f"times starts at {t[0]}; instants must be >= 0")
    for earlier, later in pairwise(wanted):
        if later <= earlier:
            raise ParameterError(f"times is not increasing: {float(later)} follows {float(earlier)}")

    def remaining(deadline: Fraction) -> np.ndarray:
        share = [max(0.0, float(1 - value / deadline)) if deadline else 0.0 for value in wanted]
        return np.where(t == float(deadline), 0.0, share)

    return Instants(t, remaining(protocol.T), remaining(protocol.T - protocol.span))


def tau_before(t: np.ndarray, q: np.ndarray, T: float, remaining: float) -> np.ndarray:
    """Return ``-ln(q T/remaining)``, ``q = 1 - t/T > 0``, of instants from ``remaining`` before ``T`` on."""
    share = (t - (T - remaining)) / remaining
    return np.maximum(minus_log(q * (T / remaining), share), 0.0)


def minus_log(q: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return ``-ln(q)``, where ``q + share = 1``: whichever is the small one holds the digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(share < 0.5, -np.log1p(-share), -np.log(q))


MAX_JUMPS = 10**4
# From 1 - t/T = e^-40 on, what a disturbance still moves is beyond a float's last digit; noise times a gain that grows
# further is not, but without limits of the gain nothing is asked of noise.
_LAST_TAU = 40.0
# Up to so many agents a dense product with ``L`` is faster than a sparse one.
_DENSE_UP_TO = 64


@gated
@dataclass(frozen=True)
class Bounded:
    """A disturbance or measurement noise of the nominal protocol, with its bound.

    Parameters
    ----------
    signal : Disturbance, str, number or sequence
        Whatever :func:`ptcc_certify.model.disturbance.as_disturbance` takes, such as ``"sin(2*k*t)"``.
    bound : int, float, str or Fraction
        In units of the input, of noise in those of the states.

    References
    ----------
    The network (2) of [Zhu]_, whose disturbances the nominal protocol meets too; docs/theory/disturbances.md.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], disturbance=Bounded("sin(t)", 1))
    >>> run.conditions.forcing
    'disturbance sin(t) within 1'
    """

    signal: Any
    bound: int | float | str | Fraction


def sample(
    motion: Motion, limited: LimitedGain, instants: Instants, course: Course | None = None, goal: float = 0.0
) -> tuple[np.ndarray, float | None]:
    """Return the (M, N, S) states of a motion under a gain, and the residual at ``T`` if it has its pole there.

    Parameters
    ----------
    motion : Motion
    limited : LimitedGain
        The gain that acts, not held over periods.
    instants : Instants
        Where the gain has its pole, ``T`` is among them only with a course.
    course : Course, optional
        Of the motion; from ``1 - t/T = e^-40`` on to a pole it goes on upon the stretched clock, where nothing drives.
    goal : float
        Of the residual.
    """
    (t, remaining, _), states, residual = instants, np.empty((instants.t.size, *motion.state.shape)), None
    T, rho1, pole = (float(value) for value in (limited.gain.T, limited.gain.rho1, limited.gain.pole))
    for stretch in limited.stretches:
        here = (remaining <= stretch.begin) & (remaining > stretch.end)
        beyond = bool((remaining <= stretch.end).any())
        if not here.any() and not beyond:
            break
        if stretch.level is None:
            phase, z = Phase(0.0, T, rho1, pole), limited.tau(stretch, t, remaining)[here]
            end = -math.log(stretch.end) if stretch.end else max(_LAST_TAU, float(z.max(initial=0.0)))
        else:
            span = T * (stretch.begin - stretch.end) if stretch.end >= 0 else T
            phase = Phase(T * (1 - stretch.begin), span, stretch.level, past=True)
            z, end = limited.elapsed(stretch, t, remaining)[here] / span, 1.0 if stretch.end >= 0 else math.inf
        last = end if beyond else min(float(z[-1]), end)
        if course is None or phase.past or stretch.end or last < _LAST_TAU:
            states[here] = motion.sample(phase, z, last)
            continue
        states[here] = motion.sample(phase, z, _LAST_TAU)
        with motion.at_rest():
            course.clock = float(limited.gain.clock_at_tau(_LAST_TAU))
            free, clock = z > _LAST_TAU, limited.gain.clock_at_tau(z)
            if free.any():
                states[np.flatnonzero(here)[free]] = course.sample(clock[free], float(clock[-1]))
            residual = course.settle(goal) if beyond else None
    return states, residual


def as_forcing(
    graph: SignedDigraph,
    T: Fraction,
    disturbance: Bounded | None,
    noise: Bounded | None,
    until: float,
) -> Forcing | None:
    """Read a disturbance and measurement noise; None if there is neither.

    Raises
    ------
    ParameterError
        A bound is missing, outside its domain or exceeded; or a signal reads the states, or jumps more than 10,000
        times.
    """
    sources, bounds, words = [], [], []
    # Telegraph signals of the two differ by their seeds.
    for seed, (name, given) in enumerate((("disturbance", disturbance), ("noise", noise))):
        if given is not None and not isinstance(given, Bounded):
            raise ParameterError(f"{name} needs a bound; give Bounded({name}, bound)")
        value, bound = ("none", 0) if given is None else (given.signal, given.bound)
        limit = parameter("delta" if name == "disturbance" else "the bound of the noise", bound, zero_allowed=True)
        source = as_disturbance(value, graph.n_nodes, limit, until, seed)
        if not isinstance(source, ExpressionDisturbance | SampledDisturbance):
            domain = "the nominal protocol takes expressions of k and t, numbers and samples"
            raise ParameterError(f"{name} ({shorten(source.text)}) reads the states or sliding variables; {domain}")
        source.check(limit, graph.labels, until)
        if source.breaks(until).size > MAX_JUMPS:
            raise ParameterError(name, f"has more than {MAX_JUMPS:,} samples until t = {until:.6g}; give fewer")
        sources.append(source)
        bounds.append(limit)
        if given is not None:
            words.append(f"{name} {shorten(source.text)} within {readable(limit)}")
    if not words:
        return None
    size = float(max(bounds[0] * T, bounds[1]))
    return Forcing(sources[0], sources[1], ", ".join(words), size, noisy=bounds[1] > 0)


def sample_and_hold(graph: SignedDigraph, periods: Periods, state: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the (M, N, S) states and held inputs of ``X_(j+1) = X_j - step_j L X_j``, linear in between."""
    L = graph.laplacian() if graph.n_nodes > _DENSE_UP_TO else graph.laplacian().toarray()
    index, share = periods.locate(t)
    states, inputs = np.empty((2, t.size, *state.shape))
    edges = np.searchsorted(index, np.arange(index[-1] + 2))
    with np.errstate(over="ignore", invalid="ignore"):
        for j, (first, last) in enumerate(pairwise(edges.tolist())):
            pull = L @ state
            if first < last:
                states[first:last] = state - np.multiply.outer(periods.steps[j] * share[first:last], pull)
                inputs[first:last] = -periods.gains[j] * pull
            state = state - periods.steps[j] * pull
    if not np.isfinite(states).all():
        raise SimulationError("the sampled run grows beyond the range of floats; take a shorter sample_period")
    return states, inputs
