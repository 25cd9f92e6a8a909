"""The nominal protocol through actuators that are not ideal, under disturbances and measurement noise.

An ideal actuator gives ``u = -gain(t) L X`` however large the gain becomes. Here the gain may be capped, the input may
stop before the deadline, or both may be held over sampling periods. As long as nothing is held or added,

    X(t) = exp(-L s_eff(t)) X(0),      s_eff(t) = integral of the gain that acts

With ``k = rho2 kappa``, a cap ``g_max > rho1 + k/T`` acts from ``t_c = T - k/(g_max - rho1)`` on, and

    s_eff(T) = rho1 T + k (1 + ln(T (g_max - rho1)/k))

A smaller cap acts from 0 on. A disturbance ``d`` and noise ``n`` give ``X' = -gain L (X + n) + d``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.protocols.disturbance import Disturbance, ExpressionDisturbance, SampledDisturbance, as_disturbance
from ptcc_certify.protocols.gain import Gain, parameter, parameters_text, readable
from ptcc_certify.simulation.cvodes import _MAX_SLIDING_STEPS, NominalMotion, Phase, _Motion
from ptcc_certify.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ptcc_certify.graphs.digraph import Exact, SignedDigraph
    from ptcc_certify.protocols.nominal import NominalProtocol

MAX_PERIODS, MAX_JUMPS = 10**6, 10**4
_LIMITS = ("gain_cap", "stop_before", "sample_period")
# 1 - t/T below which nothing can act any more.
_SMALLEST_SHARE = Fraction(1, 10**300)
# From 1 - t/T = e^-40 on, what a disturbance still moves is beyond a float's last digit.
_LAST_TAU = 40.0
# Up to so many agents a dense product with ``L`` is faster than a sparse one.
_DENSE_UP_TO = 64


@dataclass(frozen=True, init=False, repr=False)
class Actuator:
    """What an actuator does to the nominal protocol; None for what it does not.

    Parameters
    ----------
    gain_cap : int, float, str or Fraction, optional
        Positive: the gain is at most this; 1/time/weight.
    stop_before : int, float, str or Fraction, optional
        Positive and below ``T``, in units of time: the input is 0 from ``T - stop_before`` on, for ever.
    sample_period : int, float, str or Fraction, optional
        Positive, in units of time: gain and input change at its multiples only, and at ``T - stop_before`` or ``T``.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    References
    ----------
    These limit the gain of the protocol (4) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> actuator = Actuator(gain_cap=11, stop_before="0.01")
    >>> actuator
    Actuator(gain_cap=11, stop_before=1/100)
    >>> actuator.limit(Gain(T=1, rho1=1, rho2=1, kappa=1)).value([0, 0.9, 0.95, 0.99])
    array([ 2., 11., 11.,  0.])
    """

    gain_cap: Fraction | None
    stop_before: Fraction | None
    sample_period: Fraction | None

    def __init__(
        self, gain_cap: Exact | None = None, stop_before: Exact | None = None, sample_period: Exact | None = None
    ):
        for name, given in zip(_LIMITS, (gain_cap, stop_before, sample_period), strict=True):
            object.__setattr__(self, name, None if given is None else parameter(name, given))

    @property
    def ideal(self) -> bool:
        """Whether it limits nothing."""
        return not self._limits

    def limit(self, gain: Gain) -> LimitedGain:
        """Return what this actuator leaves of a gain.

        Parameters
        ----------
        gain : Gain
            Of the protocol.

        Returns
        -------
        LimitedGain

        Raises
        ------
        ParameterError
            ``stop_before`` is not below ``T``, or a limit acts only where ``1 - t/T`` is below 1e-300.
        """
        return LimitedGain(gain, self)

    @property
    def _limits(self) -> list[str]:
        return [name for name in _LIMITS if getattr(self, name) is not None]

    def __repr__(self) -> str:
        return f"Actuator({parameters_text(self, self._limits)})"


class Stretch(NamedTuple):
    """Where ``end < 1 - t/T <= begin``, the gain that acts is constant; None for that of the protocol, with its pole.

    An ``end`` of -1 is never reached.
    """

    begin: float
    end: float
    level: float | None


class Periods(NamedTuple):
    """Sampling periods, (P,) each: where they start, how long they last, the gain they hold, and its integral."""

    starts: np.ndarray
    durations: np.ndarray
    gains: np.ndarray
    steps: np.ndarray

    def value(self, t: np.ndarray) -> np.ndarray:
        """Return the gain that is held at instants."""
        return self.gains[self.locate(t)[0]]

    def clock(self, t: np.ndarray) -> np.ndarray:
        """Return the integral of the gain until instants."""
        index, share = self.locate(t)
        return np.append(0.0, self.steps.cumsum())[index] + self.steps[index] * share

    def locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the periods that instants fall into, and which share of them is over."""
        index = np.searchsorted(self.starts, t, side="right") - 1
        return index, np.clip((t - self.starts[index]) / self.durations[index], 0, 1)


@dataclass(frozen=True)
class LimitedGain:
    """The gain that acts behind an actuator, and its clock.

    Examples
    --------
    >>> limited = LimitedGain(Gain(T=1, rho1=1, rho2=1, kappa=1), Actuator(gain_cap=11))
    >>> limited.clock([0, 0.9, 1, 2]).round(6)
    array([0.      , 3.202585, 4.302585, 5.302585])
    """

    gain: Gain
    actuator: Actuator

    def __post_init__(self) -> None:
        stop, T = self.actuator.stop_before, self.gain.T
        if stop is not None and stop >= T:
            raise ParameterError(
                f"stop_before = {readable(stop)} is outside its domain; stop_before must be below T = {readable(T)}"
            )
        for name, share in (("gain_cap", self._capped_share), ("stop_before", self._stopped_share)):
            if share is not None and share < _SMALLEST_SHARE:
                raise ParameterError(f"{name} acts only where 1 - t/T is below 1e-300; leave it out")

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The course of the gain if it is not held over periods."""
        gain, capped, stopped = self.gain, float(self._capped_share or 0), float(self._stopped_share or 0)
        stretches, begin = [], 1.0
        if gain.rho2 and capped < 1:
            begin = max(capped, stopped)
            stretches.append(Stretch(1.0, begin, None))
        if begin > stopped:
            stretches.append(Stretch(begin, stopped, self._cap if gain.rho2 else self._late))
        stretches.append(Stretch(stopped, -1.0, 0.0 if stopped else self._late))
        return tuple(stretches)

    @property
    def bounded(self) -> bool:
        """Whether the gain that acts stays finite towards ``T``."""
        return self.stretches[0].end != 0 or self.stretches[0].level is not None

    def value(self, t: ArrayLike, remaining: ArrayLike | None = None) -> np.ndarray:
        """Return the gain that acts at ``t >= 0``; floats of the shape of ``t``.

        Parameters
        ----------
        t : array_like
        remaining : array_like, optional
            ``max(0, 1 - t/T)`` where it is known more accurately than from ``t``.

        Raises
        ------
        ParameterError
            There are more than 1,000,000 sampling periods until then.
        """
        t, q = self._instants(t, remaining)
        if self.actuator.sample_period is not None:
            return self.periods(float(t.max())).value(t)
        value = np.zeros(t.shape)
        for stretch in self.stretches:
            free = self.gain.value_at_remaining(q) if stretch.level is None else stretch.level
            value = np.where((q <= stretch.begin) & (q > stretch.end), free, value)
        return value

    def clock(self, t: ArrayLike, remaining: ArrayLike | None = None) -> np.ndarray:
        """Return ``s_eff(t)``, the integral of the gain that acts; infinite from a pole on.

        Parameters and errors are those of :meth:`value`.
        """
        t, q = self._instants(t, remaining)
        if self.actuator.sample_period is not None:
            return self.periods(float(t.max())).clock(t)
        clock = np.zeros(t.shape)
        for stretch in self.stretches:
            elapsed = self.elapsed(stretch, t, q)
            if stretch.level is None:
                clock += float(self.gain.rho1) * elapsed + float(self.gain.pole) * self.tau(stretch, t, q)
            else:
                clock += stretch.level * elapsed
        return clock

    def elapsed(self, stretch: Stretch, t: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the time spent in a stretch until instants ``t``, where ``1 - t/T = q``."""
        T, end = float(self.gain.T), max(stretch.end, 0.0)
        left = np.clip(q, end, stretch.begin)
        early = np.minimum(t, T * (1 - end)) - T * (1 - stretch.begin)
        # Whichever of 1 - t/T and t is the small one holds the digits.
        before = np.where(left > 0.5, np.maximum(early, 0), T * (stretch.begin - left))
        return before + (np.maximum(t - T, 0) if stretch.end < 0 else 0)

    def tau(self, stretch: Stretch, t: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return ``-ln(1 - t/T)``, not beyond the end of the first stretch; infinite at the pole."""
        left = np.maximum(q, stretch.end)
        early = np.minimum(self.elapsed(stretch, t, q) / float(self.gain.T), 0.5)
        with np.errstate(divide="ignore"):
            return np.where(left > 0.5, -np.log1p(-early), -np.log(left))

    def periods(self, until: float) -> Periods:
        """Return the sampling periods that start in [0, until], and the next one.

        An instant that a float cannot tell from the start of a period counts as it.

        Raises
        ------
        ParameterError
            There are more than 1,000,000.
        """
        period, gain = self.actuator.sample_period, self.gain
        assert period is not None
        if Fraction(until) > MAX_PERIODS * period:
            raise ParameterError(
                f"sample_period = {readable(period)} gives more than {MAX_PERIODS:,} periods until t = {until:.6g}; "
                "take a longer period or end earlier"
            )
        stop = gain.T - (self.actuator.stop_before or 0)
        unit = math.lcm(period.denominator, gain.T.denominator, stop.denominator)
        h, T, end = (int(value * unit) for value in (period, gain.T, stop))
        last = (int(Fraction(math.nextafter(until, math.inf)) * unit) // h + 2) * h
        ticks = sorted({*range(0, last + 1, h), *(cut for cut in (T, end) if cut < last)})
        if self.actuator.stop_before is not None:
            ticks = [tick for tick in ticks if tick <= end or tick == last]
        starts, durations = (
            np.array([n / unit for n in ns]) for ns in (ticks[:-1], [b - a for a, b in pairwise(ticks)])
        )
        left = np.array([max(T - tick, 0) / unit for tick in ticks[:-1]])
        share = np.array([(b - a) / (T - a) if a < T else 0.0 for a, b in pairwise(ticks)])
        with np.errstate(divide="ignore", over="ignore"):
            gains = np.minimum(float(gain.rho1) + np.where(left > 0, float(gain.pole) / left, 0.0), self._cap)
        # A period may start so close to T that the gain overflows; its integral does not.
        steps = np.minimum(float(gain.rho1) * durations + float(gain.pole) * share, self._cap * durations)
        running = np.array([tick < end or self.actuator.stop_before is None for tick in ticks[:-1]])
        return Periods(starts, durations, gains * running, steps * running)

    @property
    def _cap(self) -> float:
        return math.inf if self.actuator.gain_cap is None else float(self.actuator.gain_cap)

    @property
    def _late(self) -> float:
        """The gain from ``T`` on, and at any time if there is no pole."""
        return min(float(self.gain.rho1), self._cap)

    @property
    def _capped_share(self) -> Fraction | None:
        """``1 - t/T`` where the cap begins to act."""
        cap, gain = self.actuator.gain_cap, self.gain
        if cap is None or not gain.rho2:
            return None
        least = gain.rho1 + gain.pole / gain.T
        return Fraction(1) if cap <= least else gain.pole / (gain.T * (cap - gain.rho1))

    @property
    def _stopped_share(self) -> Fraction | None:
        stop = self.actuator.stop_before
        return None if stop is None else stop / self.gain.T

    def _instants(self, t: ArrayLike, remaining: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        """Return ``t`` and ``1 - t/T`` as arrays."""
        t = np.asarray(t, dtype=float)
        if remaining is not None:
            return t, np.asarray(remaining, dtype=float)
        q = np.maximum(1 - t / float(self.gain.T), 0)
        if self._stopped_share is None:
            return t, q
        stopped = t >= float(self.gain.T * (1 - self._stopped_share))
        return t, np.where(stopped, np.minimum(q, float(self._stopped_share)), q)


class Forcing(NamedTuple):
    """What is added to ``x'`` and to every measurement, both in words, and the size of what they move."""

    disturbance: Disturbance
    noise: Disturbance
    text: str
    size: float
    noisy: bool


class ForcedMotion(_Motion):
    """Starts moved along ``dX/dz = -(gain R) L (X + n) + R d``, where ``R = dt/dz`` is that of a phase.

    Parameters
    ----------
    state : (N, S) array
        In units of ``unit``.
    unit : (S,) array
        Size of the starts.
    forcing : Forcing
    until : float
        End of the run.
    """

    def __init__(
        self, graph: SignedDigraph, state: np.ndarray, unit: np.ndarray, forcing: Forcing, until: float, **tols: float
    ):
        super().__init__(graph, state.shape[1], **tols)
        self._options["max_num_steps"] = _MAX_SLIDING_STEPS
        self.state, self._unit = state, unit
        self._sources = (forcing.disturbance, forcing.noise)
        self._expressions = [_expression(source, len(state)) for source in self._sources]
        self._breaks = np.unique(np.concatenate([source.breaks(until) for source in self._sources]))

    def sample(self, phase: Phase, z: np.ndarray, end: float) -> np.ndarray:
        """Return the (len(z), N, S) states at ``0 <= z <= end`` from the start of a phase; the end becomes present."""
        jumps = phase.clock(self._breaks[(self._breaks > phase.start) & (self._breaks < phase.end)])
        stops = np.unique([0.0, *jumps[(jumps > 0) & (jumps < end)], end])
        states = np.empty((z.size, *self.state.shape))
        states[z == 0] = self.state
        for a, b in pairwise(stops.tolist()):
            inside = (z > a) & (z <= b)
            later = np.unique(np.append(z[inside], b))
            reached = self._advance(phase, a, later)
            states[inside] = reached[np.searchsorted(later, z[inside])]
            self.state = reached[-1]
        return states

    def _advance(self, phase: Phase, start: float, z: np.ndarray) -> np.ndarray:
        import casadi as ca

        n, columns = self.state.shape
        x, clock, p = ca.MX.sym("x", n * columns), ca.MX.sym("z"), ca.MX.sym("p", 4 * n)
        R, t, unit = phase.rate(clock, ca.exp), phase.time(clock, ca.exp), ca.DM(1 / self._unit).T
        d, noise = (
            ca.mtimes(source(t, p[2 * n * i : 2 * n * (i + 1)]), unit) for i, source in enumerate(self._expressions)
        )
        moved = R * d - phase.nominal(R) * self._product(ca.reshape(x, n, columns) + noise)
        problem = {"x": x, "t": clock, "p": p, "ode": ca.vec(moved)}
        integrator = ca.integrator("run", "cvodes", problem, start, z.tolist(), self._options)
        times = float(phase.time(start, math.exp)), float(phase.time(float(z[-1]), math.exp))
        lines = [source.linear(*times, np.arange(n), np.zeros(n)) for source in self._sources]
        numbers = np.concatenate([np.zeros(2 * n) if line is None else np.concatenate(line) for line in lines])
        stiffness = (phase.rho1 * phase.span + phase.pole) * self.in_weight.max() * float(z[-1] - start)
        reached = self._call(integrator, self.state.ravel(order="F"), numbers.tolist(), stiffness)
        return reached.reshape(columns, n, -1).transpose(2, 1, 0)


def simulate_limited(
    graph: SignedDigraph,
    protocol: NominalProtocol,
    start: np.ndarray,
    t: np.ndarray,
    left: np.ndarray,
    actuator: Actuator | None,
    forcing: Forcing | None,
    *,
    rtol: float,
    atol: float,
) -> Trajectory:
    """Move the nominal protocol through an actuator; see :func:`ptcc_certify.simulation.run.simulate`.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : NominalProtocol
    start : (N,) or (N, S) array
    t, left : (M,) array
        Instants, and ``max(0, 1 - t/T)`` there.
    actuator : Actuator or None
    forcing : Forcing or None
    rtol, atol
        As there.

    Raises
    ------
    ParameterError
        An option is outside its domain, or the options do not fit together.
    SimulationError
        The integrator failed, or a sampled run grew beyond the range of floats.
    """
    began = time.perf_counter()
    limited = (actuator or Actuator()).limit(protocol.gain)
    if forcing is not None and limited.actuator.sample_period is not None:
        raise ParameterError("sample_period takes no disturbance and no noise; leave one of them out")
    if forcing is not None and forcing.noisy and not limited.bounded:
        raise ParameterError("noise times a gain that becomes infinite at T is no input; give gain_cap or stop_before")
    columns = start.reshape(graph.n_nodes, -1)
    unit = np.maximum(np.abs(columns).max(axis=0), forcing.size if forcing else 0.0)
    unit[unit == 0] = 1
    held = residual = None
    run: _Motion
    if limited.actuator.sample_period is not None:
        periods = limited.periods(float(t[-1]))
        clock = periods.clock(t)
        states, held = _sampled(graph, periods, columns / unit, t)
        run = NominalMotion(graph, states[-1], rtol, atol)
        run.stats["steps"] = int(periods.locate(t[-1:])[0][0])
    elif forcing is None:
        clock = limited.clock(t, left)
        run = NominalMotion(graph, columns / unit, rtol, atol)
        span = float(clock[-1]) or 1.0
        states = run.sample(0.0, span, 0.0, clock / span)
    else:
        clock = limited.clock(t, left)
        run = ForcedMotion(graph, columns / unit, unit, forcing, float(t[-1]), rtol=rtol, atol=atol)
        states, residual = _forced(graph, limited, run, t, left, rtol=rtol, atol=atol)
    late = np.flatnonzero(left == 0)
    if residual is None and protocol.prescribed and late.size:
        residual = run.imbalance(states[late[0]])
    shape = (*start.shape, t.size)
    at_deadline = np.flatnonzero((left == 0) & (t == float(protocol.T)) & protocol.prescribed)
    return Trajectory(
        graph=graph,
        protocol=protocol,
        t=t,
        remaining=left,
        clock=clock,
        states=(np.moveaxis(states, 0, -1) * unit[:, None]).reshape(shape),
        rtol=rtol,
        atol=atol,
        deadline_index=int(at_deadline[0]) if at_deadline.size else None,
        deadline_residual=residual,
        stats=run.stats | {"seconds": time.perf_counter() - began},
        actuator=actuator,
        forcing=None if forcing is None else forcing.text,
        held_input=None if held is None else (np.moveaxis(held, 0, -1) * unit[:, None]).reshape(shape),
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
            "disturbance belongs to the sliding-mode protocol; under the nominal protocol give its bound delta too"
        )
    if noise is not None and noise_bound is None:
        raise ParameterError("noise needs a bound; give noise_bound too")
    sources, bounds, words = [], [], []
    given = (("disturbance", disturbance, "delta", delta), ("noise", noise, "noise_bound", noise_bound))
    # Telegraph signals of the two differ by their seeds.
    for seed, (name, value, bound_name, bound) in enumerate(given):
        if value is None and bound is not None:
            raise ParameterError(f"{bound_name} is the bound of a {name}; give the {name} too, or leave it out")
        limit = parameter(bound_name, 0 if bound is None else bound, zero_allowed=True)
        source = as_disturbance("none" if value is None else value, graph.n_nodes, limit, until, seed)
        if not isinstance(source, ExpressionDisturbance | SampledDisturbance):
            taken = "the nominal protocol takes expressions of k and t, numbers and samples"
            raise ParameterError(f"{name} ({shorten(source.text)}) reads the states or sliding variables; {taken}")
        source.check(limit, graph.labels, until)
        if source.breaks(until).size > MAX_JUMPS:
            raise ParameterError(f"{name} has more than {MAX_JUMPS:,} samples until t = {until:.6g}; give fewer")
        sources.append(source)
        bounds.append(limit)
        if value is not None:
            words.append(f"{name} {shorten(source.text)} within {readable(limit)}")
    if not words:
        return None
    size = float(max(bounds[0] * T, bounds[1]))
    return Forcing(sources[0], sources[1], ", ".join(words), size, noisy=bounds[1] > 0)


def _forced(
    graph: SignedDigraph, limited: LimitedGain, motion: ForcedMotion, t: np.ndarray, left: np.ndarray, **tols: float
) -> tuple[np.ndarray, float | None]:
    """Return the (M, N, S) states, found stretch by stretch, and the residual at ``T`` if the gain has its pole."""
    T, rho1, pole = (float(value) for value in (limited.gain.T, limited.gain.rho1, limited.gain.pole))
    states, residual = np.empty((t.size, *motion.state.shape)), None
    for stretch in limited.stretches:
        here, beyond = (left <= stretch.begin) & (left > stretch.end), bool((left <= stretch.end).any())
        if not here.any() and not beyond:
            break
        if stretch.level is None:
            phase = Phase(0.0, T, rho1, pole, 0.0, 0.0, 0.0)
            z, end = limited.tau(stretch, t, left)[here], -math.log(stretch.end) if stretch.end else _LAST_TAU
        else:
            span = T * (stretch.begin - stretch.end) if stretch.end >= 0 else T
            phase = Phase(T * (1 - stretch.begin), span, stretch.level, 0.0, 0.0, 0.0, 0.0, past=True)
            z, end = limited.elapsed(stretch, t, left)[here] / span, 1.0 if stretch.end >= 0 else math.inf
        last = end if beyond else min(float(z[-1]), end)
        states[here] = motion.sample(phase, np.minimum(z, last), last)
        if stretch.level is None and not stretch.end and last == _LAST_TAU:
            onward = NominalMotion(graph, motion.state, **tols)
            late = np.maximum(z - _LAST_TAU, 0)
            moved = onward.sample(rho1 * T * math.exp(-_LAST_TAU), pole, 1.0, late)
            states[here] = np.where((late > 0)[:, None, None], moved, states[here])
            if beyond:
                residual = onward.settle(rho1 * T, pole, max(z.max(initial=0.0), _LAST_TAU))
            motion.state = onward.state
            for name, count in onward.stats.items():
                motion.stats[name] += count
    return states, residual


def _sampled(graph: SignedDigraph, periods: Periods, state: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the (M, N, S) states and held inputs of ``X_(j+1) = X_j - step_j L X_j``, linear in between."""
    L = graph.laplacian() if graph.n_nodes > _DENSE_UP_TO else graph.laplacian().toarray()
    index, share = periods.locate(t)
    states, held = np.empty((2, t.size, *state.shape))
    edges = np.searchsorted(index, np.arange(index[-1] + 2))
    with np.errstate(over="ignore", invalid="ignore"):
        for j, (first, last) in enumerate(pairwise(edges.tolist())):
            pull = L @ state
            if first < last:
                states[first:last] = state - np.multiply.outer(periods.steps[j] * share[first:last], pull)
                held[first:last] = -periods.gains[j] * pull
            state = state - periods.steps[j] * pull
    if not np.isfinite(states).all():
        raise SimulationError("the sampled run grows beyond the range of floats; take a shorter sample_period")
    return states, held


def _expression(source: Disturbance, n: int) -> Callable[[Any, Any], Any]:
    """Return ``t, (a, b) -> d`` for the integrator."""
    import casadi as ca

    if not isinstance(source, ExpressionDisturbance):
        return lambda t, p: p[:n] + p[n:] * t
    instant = ca.SX.sym("t")
    values = ca.vertcat(*(source.casadi(instant, k) for k in range(n)))  # type: ignore[arg-type]
    function = ca.Function("d", [instant], [values])
    return lambda t, p: function(t)
