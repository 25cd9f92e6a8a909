"""Motions under the nominal input, alone or with a disturbance and measurement noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import SimulationError
from ptcc_certify.protocols.disturbance import Disturbance, ExpressionDisturbance, WorstCaseDisturbance
from ptcc_certify.simulation.cvodes import DIRECT_UP_TO, Motion, Phase, Tolerances
from ptcc_certify.simulation.trajectory import RESOLVED

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols.limited_gain import LimitedGain

# A disturbance may be fast: so many steps between two instants.
MANY_STEPS = 500_000
# From 1 - t/T = e^-40 on, what a disturbance still moves is beyond a float's last digit; noise times a gain that grows
# further is not, but without limits of the gain nothing is asked of noise.
_LAST_TAU = 40.0
# No tolerance is made finer than this on the way to the state at T.
_FINEST = 1e-13
# The state at T is given up beyond this s max(D): the roundings of float64 weights act there like slow modes.
_MAX_CLOCK = 1e13
_MAX_TAU = 1e300


class Forcing(NamedTuple):
    """What is added to ``x'`` and to every measurement, in words, how large it gets, and whether there is noise."""

    disturbance: Disturbance
    noise: Disturbance
    text: str
    size: float
    noisy: bool


def signal(source: Disturbance, n: int) -> Callable[[Phase, tuple[float, float], Any, Any], Any]:
    """Return ``phase, ends, t, sign -> d`` for the integrator between two instants without a jump in between."""
    import casadi as ca

    if isinstance(source, WorstCaseDisturbance):
        return lambda phase, ends, t, sign: float(source.delta) * sign
    if isinstance(source, ExpressionDisturbance):
        instant = ca.SX.sym("t")
        values = ca.vertcat(*(source.casadi(instant, k) for k in range(n)))  # type: ignore[arg-type]
        function = ca.Function("d", [instant], [values])
        return lambda phase, ends, t, sign: function(t)

    def line(phase: Phase, ends: tuple[float, float], t: Any, sign: Any) -> Any:
        begin, end = (float(phase.time(z, math.exp)) for z in ends)
        linear = source.linear(begin, end, np.arange(n), np.zeros(n))
        assert linear is not None
        return ca.DM(linear[0]) + ca.DM(linear[1]) * t

    return line


class NominalMotion(Motion):
    """Columns of agents moved along ``dX/dz = -(gain R) L (X + n) + R d``, where ``R = dt/dz`` is that of a phase.

    Parameters
    ----------
    state : (N, S) array
        In units of ``unit``.
    forcing : Forcing or None
        ``d`` and ``n``; None: 0.
    unit : (S,) array or None
        Size of the initial states; None: 1.
    """

    def __init__(
        self,
        graph: SignedDigraph,
        state: np.ndarray,
        tolerances: Tolerances,
        forcing: Forcing | None = None,
        unit: np.ndarray | None = None,
    ):
        super().__init__(graph, state, state.shape[1], tolerances)
        self._unit = np.ones(state.shape[1]) if unit is None else unit
        self._to_pole = True  # whether the gain grows up to T
        if forcing is not None:
            self._options["max_num_steps"] = MANY_STEPS
            self.sources = forcing.disturbance, forcing.noise
            self._signals = [signal(source, len(state)) for source in self.sources]

    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dX/dz``."""
        import casadi as ca

        R, t = phase.rate(clock, ca.exp), phase.time(clock, ca.exp)
        if not self.sources or (ends[0] >= _LAST_TAU and self._to_pole and not phase.past):
            return -phase.nominal(R) * self._product(x)
        per_unit = ca.DM(1 / self._unit).T
        d, noise = (ca.mtimes(source(phase, ends, t, 0), per_unit) for source in self._signals)
        return R * d - phase.nominal(R) * self._product(x + noise)

    def follow(
        self, limited: LimitedGain, t: np.ndarray, remaining: np.ndarray, begin: float = 0.0
    ) -> tuple[np.ndarray, float | None]:
        """Return the (M, N, S) states under a gain, and the residual at ``T`` if it has its pole there.

        Parameters
        ----------
        limited : LimitedGain
            The gain that acts, not held over periods.
        t, remaining : (M,) array
            Increasing instants, and ``1 - t/T`` there.
        begin : float
            ``ln(T/(T - t))`` at the present state; if it is not 0, nothing limits the gain.
        """
        T, rho1, pole = (float(value) for value in (limited.gain.T, limited.gain.rho1, limited.gain.pole))
        states, residual = np.empty((t.size, *self.state.shape)), None
        for stretch in limited.stretches:
            here = (remaining <= stretch.begin) & (remaining > stretch.end)
            beyond = bool((remaining <= stretch.end).any())
            if not here.any() and not beyond:
                break
            self._to_pole = stretch.level is None and not stretch.end
            if stretch.level is None:
                phase, z = Phase(0.0, T, rho1, pole), limited.tau(stretch, t, remaining)[here]
                least = _LAST_TAU if self.sources else begin
                end = -math.log(stretch.end) if stretch.end else z.max(initial=least)
            else:
                span = T * (stretch.begin - stretch.end) if stretch.end >= 0 else T
                phase = Phase(T * (1 - stretch.begin), span, stretch.level, past=True)
                z, end = limited.elapsed(stretch, t, remaining)[here] / span, 1.0 if stretch.end >= 0 else math.inf
            last = end if beyond else min(float(z[-1]), end)
            states[here] = self.sample(phase, z, last, begin, [_LAST_TAU] if self.sources else [])
            if beyond and stretch.level is None and not stretch.end:
                residual = self._settle(rho1 * T, pole, last)
            begin = 0.0
        return states, residual

    def _settle(self, a: float, b: float, tau: float) -> float:
        """Move along ``dX/dtau = -(a e^-tau + b) L X``, doubling ``tau`` until the residual is small; return it.

        The residual must be small both locally (no agent is away from what it listens to) and over time (groups that
        hardly listen to each other drift slowly).
        """
        import casadi as ca

        x, clock, p = ca.MX.sym("x", self.state.size), ca.MX.sym("z"), ca.MX.sym("p", 3)
        rate = p[0] * ca.exp(-p[2] * clock) + p[1]
        ode = -rate * ca.vec(self._product(ca.reshape(x, *self.state.shape)))
        # One unit of the integrator's clock is the whole span.
        leap = self._integrator({"x": x, "t": clock, "p": p, "ode": ode}, 0.0, np.ones(1), **self._finer())
        goal = RESOLVED / 10 * max(self._options["reltol"], self._options["abstol"])
        largest, residual = self.in_weight.max(), math.inf
        while True:
            span = max(tau, 20.0)
            previous, start = self.state, a * math.exp(-tau) * span
            try:
                self.state = self._call(leap, (start + b * span) * largest, [start, b * span, span])[0]
            except SimulationError:
                if residual == math.inf:
                    raise
                return residual
            tau += span
            residual = max(float(np.abs(self.state - previous).max()), self.imbalance(self.state))
            if residual <= goal or b * tau * largest > _MAX_CLOCK or tau > _MAX_TAU:
                return residual

    def _finer(self) -> dict[str, Any]:
        """Return the options of a run that settles to within the tolerances in every agent of a large graph.

        CVODES bounds the root of the mean square of the errors; that of one agent can be sqrt(N) times as large.
        """
        if len(self.state) <= DIRECT_UP_TO:
            return {}
        share = math.sqrt(len(self.state))
        return {n: min(self._options[n], max(self._options[n] / share, _FINEST)) for n in ("reltol", "abstol")}
