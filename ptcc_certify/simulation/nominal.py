"""The nominal protocol, alone or under limits of the gain, disturbances and measurement noise.

Without a hold and without forcing,

    X(t) = exp(-L s_eff(t)) X(0),      s_eff(t) = integral of the gain that acts

A disturbance ``d`` and noise ``n`` give ``X' = -gain L (X + n) + d``.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.protocols.disturbance import ExpressionDisturbance, SampledDisturbance, as_disturbance
from ptcc_certify.protocols.gain_limits import GainLimits, Periods
from ptcc_certify.protocols.parameters import parameter, readable
from ptcc_certify.simulation.cvodes import Phase, Tolerances
from ptcc_certify.simulation.cvodes_nominal import Forcing, NominalMotion
from ptcc_certify.simulation.instants import Instants
from ptcc_certify.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact, SignedDigraph
    from ptcc_certify.protocols import Protocol

MAX_JUMPS = 10**4
# Up to so many agents a dense product with ``L`` is faster than a sparse one.
_DENSE_UP_TO = 64


def simulate_nominal(
    graph: SignedDigraph,
    protocol: Protocol,
    initial_state: np.ndarray,
    instants: Instants,
    actuator: GainLimits | None,
    forcing: Forcing | None,
    tolerances: Tolerances,
) -> Trajectory:
    """Move the nominal protocol, under limits of the gain; see :func:`ptcc_certify.simulation.run.simulate`.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : Protocol
    initial_state : (N,) or (N, S) array
    instants : Instants
    actuator : GainLimits or None
    forcing : Forcing or None
    tolerances : Tolerances

    Raises
    ------
    ParameterError
        An option is outside its domain, or the options do not fit together.
    SimulationError
        The integrator failed, or a sampled run grew beyond the range of floats.
    """
    limited = (actuator or GainLimits()).limit(protocol.gain)
    t, remaining = instants.t, instants.remaining
    sampled = limited.limits.sample_period is not None
    if forcing is not None and sampled:
        raise ParameterError("a run with a sample period takes no disturbance and no noise; leave one of them out")
    if forcing is not None and forcing.noisy and not limited.bounded:
        raise ParameterError(
            "noise times a gain that becomes infinite at T is no input; give a gain cap or stop before T"
        )
    columns = initial_state.reshape(graph.n_nodes, -1)
    unit = np.maximum(np.abs(columns).max(axis=0), forcing.size if forcing else 0.0)
    unit[unit == 0] = 1
    inputs = residual = None
    run = NominalMotion(graph, columns / unit, tolerances, forcing, unit)
    if sampled:
        periods = limited.periods(float(t[-1]))
        clock = periods.clock(t)
        states, inputs = _sample_and_hold(graph, periods, run.state, t)
        run.stats["steps"] = int(periods.locate(t[-1:])[0][0])
    elif forcing is None and limited.bounded:
        clock = limited.clock(t, remaining)
        span = float(clock[-1]) or 1.0
        states = run.sample(Phase(0.0, 1.0, span, past=True), clock / span, float(clock[-1]) / span)
    else:
        clock = limited.clock(t, remaining)
        states, residual = run.follow(limited, t, remaining)
    late = np.flatnonzero(remaining == 0)
    if residual is None and protocol.prescribed and late.size:
        residual = run.imbalance(states[late[0]])

    def restore(values: np.ndarray) -> np.ndarray:
        return (np.moveaxis(values, 0, -1) * unit[:, None]).reshape(*initial_state.shape, t.size)

    return Trajectory(
        graph=graph,
        protocol=protocol,
        t=t,
        remaining=remaining,
        clock=clock,
        states=restore(states),
        rtol=tolerances.rtol,
        atol=tolerances.atol,
        deadline_index=instants.deadline(protocol),
        deadline_residual=residual,
        stats=run.stats,
        actuator=None if actuator is None or actuator.ideal else actuator,
        forcing=None if forcing is None else forcing.text,
        held_input=None if inputs is None else restore(inputs),
    )


def as_forcing(
    graph: SignedDigraph,
    T: Fraction,
    disturbance: Any,
    delta: Exact | None,
    noise: Any,
    noise_bound: Exact | None,
    until: float,
) -> Forcing | None:
    """Read a disturbance and measurement noise with their bounds; None if there is neither.

    Raises
    ------
    ParameterError
        A bound is missing, outside its domain, exceeded or without a signal; or a signal reads the states, or jumps
        more than 10,000 times.
    """
    if disturbance is not None and delta is None:
        raise ParameterError(
            "disturbance", "belongs to the sliding-mode protocol; under the nominal protocol give its bound delta too"
        )
    if noise is not None and noise_bound is None:
        raise ParameterError("noise needs a bound; give noise_bound too")
    sources, bounds, words = [], [], []
    signals = (("disturbance", disturbance, "delta", delta), ("noise", noise, "noise_bound", noise_bound))
    # Telegraph signals of the two differ by their seeds.
    for seed, (name, value, bound_name, bound) in enumerate(signals):
        if value is None and bound is not None:
            raise ParameterError(bound_name, f"is the bound of a {name}; give the {name} too, or leave it out")
        limit = parameter(bound_name, 0 if bound is None else bound, zero_allowed=True)
        source = as_disturbance("none" if value is None else value, graph.n_nodes, limit, until, seed)
        if not isinstance(source, ExpressionDisturbance | SampledDisturbance):
            domain = "the nominal protocol takes expressions of k and t, numbers and samples"
            raise ParameterError(f"{name} ({shorten(source.text)}) reads the states or sliding variables; {domain}")
        source.check(limit, graph.labels, until)
        if source.breaks(until).size > MAX_JUMPS:
            raise ParameterError(name, f"has more than {MAX_JUMPS:,} samples until t = {until:.6g}; give fewer")
        sources.append(source)
        bounds.append(limit)
        if value is not None:
            words.append(f"{name} {shorten(source.text)} within {readable(limit)}")
    if not words:
        return None
    size = float(max(bounds[0] * T, bounds[1]))
    return Forcing(sources[0], sources[1], ", ".join(words), size, noisy=bounds[1] > 0)


def _sample_and_hold(
    graph: SignedDigraph, periods: Periods, state: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, ...]:
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
