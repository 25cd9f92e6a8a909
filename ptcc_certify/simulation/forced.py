"""Motions under disturbances and measurement noise, from event to event on clocks that know no pole."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.protocols.disturbance import Disturbance, ExpressionDisturbance, WorstCaseDisturbance
from ptcc_certify.simulation.cvodes import Motion, Tolerances

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols import ReachingProtocol

# A disturbance may be fast: so many steps between two instants.
_MAX_STEPS = 500_000


class Forcing(NamedTuple):
    """What is added to ``x'`` and to every measurement, both in words, and the size of what they move."""

    disturbance: Disturbance
    noise: Disturbance
    text: str
    size: float
    noisy: bool


@dataclass(frozen=True)
class Phase:
    """A stretch of a motion on its own clock ``z``, on which no gain has a pole.

        t = start + span (1 - e^-z),   R = dt/dz = span e^-z     towards a pole at start + span
        t = start + span z,            R = span                  past all poles

    The nominal gain times ``R`` is ``rho1 R + pole R/(gap + R)``, where ``gap + R`` is the time left to ``T``; that of
    the sliding variables is ``mu2 R + reaching_pole``.
    """

    start: float
    span: float
    rho1: float
    pole: float = 0.0
    gap: float = 0.0
    mu2: float = 0.0
    reaching_pole: float = 0.0
    past: bool = False

    def rate(self, z: Any, exp: Any) -> Any:
        """Return ``R``."""
        return self.span if self.past else self.span * exp(-z)

    def time(self, z: Any, exp: Any) -> Any:
        """Return ``t``."""
        return self.start + (self.span * z if self.past else self.span - self.span * exp(-z))

    def nominal(self, R: Any) -> Any:
        """Return the nominal gain times ``R``."""
        return self.rho1 * R + (self.pole * R / (self.gap + R) if self.pole else 0)

    @property
    def end(self) -> float:
        """The pole, or infinity past all poles."""
        return math.inf if self.past else self.start + self.span

    def clock(self, t: np.ndarray) -> np.ndarray:
        """Return the ``z`` of instants before the pole."""
        share = (t - self.start) / self.span
        return share if self.past else -np.log1p(-share)


def signal(source: Disturbance, n: int) -> Callable[[Any, Any, Any], Any]:
    """Return ``t, (a, b), sign -> d`` for the integrator; ``a + b t`` for a source that is linear between its jumps."""
    import casadi as ca

    if isinstance(source, WorstCaseDisturbance):
        return lambda t, p, sign: float(source.delta) * sign
    if not isinstance(source, ExpressionDisturbance):
        return lambda t, p, sign: p[:n] + p[n:] * t
    instant = ca.SX.sym("t")
    values = ca.vertcat(*(source.casadi(instant, k) for k in range(n)))  # type: ignore[arg-type]
    function = ca.Function("d", [instant], [values])
    return lambda t, p, sign: function(t)


def coefficients(source: Disturbance, phase: Phase, ends: tuple[float, float], signs: np.ndarray) -> np.ndarray:
    """Return the (2 N,) ``a`` and ``b`` of a source that is linear between two instants of a phase, otherwise 0."""
    start, end = (float(phase.time(z, math.exp)) for z in ends)
    line = source.linear(start, end, np.arange(signs.size), signs.astype(int))
    return np.zeros(2 * signs.size) if line is None else np.concatenate(line)


class SlidingMotion(Motion):
    """One start moved along ``y' = -gain L (y + sigma)`` with its sliding variables, ``y = x - sigma``.

        sigma' = -mu1 s - (reaching gain) sigma + active d

    Parameters
    ----------
    state : (2 N,) array
        ``y`` and ``sigma`` in units of ``unit``.
    unit : float
        Size of the initial state.
    layer : float or None
        ``s`` is ``tanh(sigma/layer)`` instead of a given sign.
    """

    def __init__(
        self,
        graph: SignedDigraph,
        protocol: ReachingProtocol,
        disturbance: Disturbance,
        state: np.ndarray,
        unit: float,
        tolerances: Tolerances,
        layer: float | None = None,
    ):
        super().__init__(graph, state, 1, tolerances, _MAX_STEPS)
        self._unit, self._mu1, self._layer = unit, float(protocol.mu1), layer
        self._disturbance, self._signal = disturbance, signal(disturbance, graph.n_nodes)

    def sample(
        self,
        phase: Phase,
        z: np.ndarray,
        events: list[float],
        signs: Callable[[float], np.ndarray],
        out: np.ndarray,
    ) -> None:
        """Move from event to event of one phase, jumps of the disturbance among them; fill ``out`` where ``z`` lies."""
        n, first, last = self.state.size // 2, events[0], events[-1]
        jumps = self._disturbance.breaks(phase.end)
        jumps = phase.clock(jumps[jumps > phase.start])
        stops = np.unique(np.concatenate([events, jumps[(jumps > first) & (jumps < last)]]))
        for a, b in pairwise(stops.tolist()):
            sign = signs(a)
            self.state[n:][sign == 0] = 0
            inside = np.flatnonzero((z >= a) & (z < b))
            out[:, inside[z[inside] == a]] = self.state[:, None]
            inside = inside[z[inside] > a]
            out[:, inside] = self._advance(phase, a, np.append(z[inside], b), sign)[:, :-1]

    def _advance(self, phase: Phase, start: float, z: np.ndarray, signs: np.ndarray) -> np.ndarray:
        """Return the (2 N, len(z)) states at increasing instants ``z > start``; the last becomes the present state.

        ``signs`` are those of the sliding variables, 0 for one that stays at 0.
        """
        import casadi as ca

        n = signs.size
        x, clock, p = ca.MX.sym("x", 2 * n), ca.MX.sym("z"), ca.MX.sym("p", 3 * n)
        y, sigma, sign = x[:n], x[n:], p[:n]
        R, t = phase.rate(clock, ca.exp), phase.time(clock, ca.exp)
        s = sign if self._layer is None else ca.tanh(sigma * (self._unit / self._layer))
        push = R / self._unit * (self._mu1 * s - ca.fabs(sign) * self._signal(t, p[n:], s))
        driven = -push - (phase.mu2 * R + phase.reaching_pole) * sigma
        ode = ca.vertcat(-phase.nominal(R) * self._product(y + sigma), driven)
        integrator = self._integrator({"x": x, "t": clock, "p": p, "ode": ode}, start, z)
        line = coefficients(self._disturbance, phase, (start, float(z[-1])), signs)
        weight = (phase.rho1 * phase.span + phase.pole) * self.in_weight.max()
        stiffness = (weight + phase.mu2 * phase.span + phase.reaching_pole) * float(z[-1] - start)
        reached = self._call(integrator, self.state, [*signs, *line], stiffness)
        self.state = reached[:, -1].copy()
        return reached


class ForcedMotion(Motion):
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
        self,
        graph: SignedDigraph,
        state: np.ndarray,
        unit: np.ndarray,
        forcing: Forcing,
        until: float,
        tolerances: Tolerances,
    ):
        super().__init__(graph, state, state.shape[1], tolerances, _MAX_STEPS)
        self._unit, self._sources = unit, (forcing.disturbance, forcing.noise)
        self._signals = [signal(source, len(state)) for source in self._sources]
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
            ca.mtimes(source(t, p[2 * n * i : 2 * n * (i + 1)], 0), unit) for i, source in enumerate(self._signals)
        )
        moved = R * d - phase.nominal(R) * self._product(ca.reshape(x, n, columns) + noise)
        integrator = self._integrator({"x": x, "t": clock, "p": p, "ode": ca.vec(moved)}, start, z)
        ends = start, float(z[-1])
        lines = np.concatenate([coefficients(source, phase, ends, np.zeros(n)) for source in self._sources])
        stiffness = (phase.rho1 * phase.span + phase.pole) * self.in_weight.max() * float(z[-1] - start)
        reached = self._call(integrator, self.state.ravel(order="F"), lines.tolist(), stiffness)
        return reached.reshape(columns, n, -1).transpose(2, 1, 0)
