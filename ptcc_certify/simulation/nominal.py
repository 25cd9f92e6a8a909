"""What a run under the nominal protocol meets besides its graph: disturbances and noise, and a gain that is held.

A disturbance ``d`` and noise ``n`` give ``X' = -gain L (X + n) + d``; where nothing drives the agents any more their
course is on the stretched clock again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError, gated
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.disturbance import ExpressionDisturbance, SampledDisturbance, as_disturbance
from ptcc_certify.model.limited_gain import LimitedGain, Periods
from ptcc_certify.model.parameters import parameter, readable
from ptcc_certify.simulation.cvodes import Forcing, Motion, Phase
from ptcc_certify.simulation.instants import Instants

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.simulation.switching_signals import Course

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
