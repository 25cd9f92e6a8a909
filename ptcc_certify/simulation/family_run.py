"""Runs of a family of graphs under a signal, integrated by CasADi's CVODES between the switches.

On the stretched clock ``dX/ds = -L(s) X`` has no pole: before ``T`` a run is on this clock. The state at ``T`` is the
limit for ``s`` to infinity, if there is one; from ``T`` on ``X' = -rho1 L X``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError, gated
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_family, as_states
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.base import refuse_no_protocol
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.simulation.cvodes import Tolerances
from ptcc_certify.simulation.family_members import Choice, Members
from ptcc_certify.simulation.family_motion import FamilyMotion
from ptcc_certify.simulation.family_sliding import DrivenFamilyMotion, SlidingRun
from ptcc_certify.simulation.instants import PAST, Instants, default_instants, wanted_instants
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.signals import Signal, as_signal
from ptcc_certify.simulation.trajectory import RESOLVED, SlidingTrajectory, Trajectory

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact

#: Choices of a signal before a run is given up, and those after which it does not go on to see where it settles.
MOST_STRETCHES, MOST_SETTLING = 100_000, 2_000
# The state at T is given up beyond this s max(D), as for one graph.
_MAX_CLOCK = 1e13


@dataclass(frozen=True, eq=False, repr=False)
class FamilyTrajectory(Trajectory):
    """A run of a family of graphs; ``graph`` is the mandatory graph of the first mode.

    Attributes
    ----------
    family : Family
    signal : str
        The signal in words.
    choices : tuple of Choice
        The members in the order in which they acted.
    switches : (P,) array
        The value of the clock from which on each acted; infinite from ``T`` on.
    acting : (M,) int array
        Which of them acted at the instants, or last before them.

    References
    ----------
    docs/theory/families.md, "What may change".

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> family = Family.switching({"day": day, "night": night})
    >>> run = simulate_family(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2, 3], "random")
    >>> run.deadline_resolved, bool(np.ptp(run.final_state * [1, 1, -1]) < 1e-9), sorted(set(run.modes.tolist()))
    (True, True, [0, 1])
    """

    family: Family = field(kw_only=True)
    signal: str = field(kw_only=True)
    choices: tuple[Choice, ...] = field(kw_only=True)
    switches: np.ndarray = field(kw_only=True)
    acting: np.ndarray = field(kw_only=True)

    @property
    def modes(self) -> np.ndarray:
        """(M,) int array: the mode that acts at every instant, from 0."""
        return np.array([choice.mode for choice in self.choices])[self.acting]

    @cached_property
    def error(self) -> np.ndarray:
        """``E = -L X`` with the member that acts, of the shape of ``states``."""
        members, result = Members(self.family), np.empty_like(self.states)
        for k in np.unique(self.acting).tolist():
            at = self.acting == k
            result[:, at] = -(members.laplacian(self.choices[k]) @ self.states[:, at])
        return result

    def clock_of_modes(self) -> np.ndarray:
        """(modes, M) array: how much of the clock has been spent in every mode; infinite from ``T`` on in the last."""
        ends = np.append(self.switches[1:], np.inf)
        spent = np.zeros((len(self.family.modes), self.clock.size))
        for choice, begin, end in zip(self.choices, self.switches.tolist(), ends.tolist(), strict=True):
            if np.isfinite(begin):
                spent[choice.mode] += np.clip(self.clock, begin, end) - begin
        return spent

    def _more_columns(self) -> list[tuple[str, np.ndarray]]:
        return [("mode", self.modes + 1)]

    def __repr__(self) -> str:
        return f"Family{super().__repr__()[:-1]}, signal: {self.signal})"


@dataclass(frozen=True, eq=False, repr=False)
class FamilySlidingTrajectory(FamilyTrajectory, SlidingTrajectory):
    """A run of a family of graphs under the sliding-mode protocol, the Filippov solution.

    Its attributes are those of :class:`FamilyTrajectory` and of
    :class:`~ptcc_certify.simulation.trajectory.SlidingTrajectory`.

    Examples
    --------
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> pair = [("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")]
    >>> run = simulate_family(pair, robust, [1, 2], sigma0=[1, 0], disturbance="sin(9*k*t)")
    >>> run.final_state.round(9) + 0, bool((run.reaching_times < 1).all())
    (array([0., 0.]), True)
    """

    def _more_columns(self) -> list[tuple[str, np.ndarray]]:
        return [*FamilyTrajectory._more_columns(self), *SlidingTrajectory._more_columns(self)]


class _Course:
    """A motion led by a signal along the clock."""

    def __init__(self, motion: FamilyMotion, play: Callable[..., Any], unit: float):
        self.motion, self.clock, self.until, self.stretches = motion, 0.0, 0.0, 0
        self.choices: list[Choice] = []
        self.switches: list[float] = []
        self._play = play(lambda: motion.agents() * unit)
        self._begin()

    def _begin(self) -> None:
        choice, self.until = next(self._play)
        self.stretches += 1
        if self.stretches > MOST_STRETCHES:
            raise SimulationError(f"the signal chooses more than {MOST_STRETCHES:,} times; let each member act longer")
        if not self.choices or choice != self.choices[-1]:
            self.switch(choice, self.clock)

    def switch(self, choice: Choice, clock: float) -> None:
        """Let a member act from now on."""
        self.choices.append(choice)
        self.switches.append(clock)
        self.motion.choose(choice)

    def advance(self, clock: float) -> np.ndarray:
        """Move on to a value of the clock; return the (N,) state."""
        while True:
            end = min(clock, self.until)
            self.motion.move(end - self.clock)
            self.clock = max(end, self.clock)
            if end == clock:
                return self.motion.state[:, 0]
            self._begin()

    def settle(self, residual: float, goal: float) -> float:
        """Go on, doubling the clock, until the residual is small; return it."""
        largest = float(self.motion.in_weight.max(initial=0.0)) or 1.0
        while residual > goal and self.clock * largest <= _MAX_CLOCK and self.stretches < MOST_SETTLING:
            before = self.motion.state
            try:
                self.advance(max(2 * self.clock, 20 / largest))
            except SimulationError:
                return residual
            residual = max(float(np.abs(self.motion.state - before).max()), self.imbalance())
        return residual

    def imbalance(self) -> float:
        """Bound ``max_k |e_k| / (2 D_k)`` over all members, or of the one that stays for ever."""
        own = self.choices[-1] if math.isinf(self.until) else None
        return self.motion.members.imbalance(self.motion.state[:, 0], own)


@gated
def simulate_family(
    family: Any,
    protocol: Protocol,
    x0: Any,
    signal: Any = "random",
    *,
    sigma0: Any = None,
    disturbance: Any = None,
    times: Iterable[Exact] | None = None,
    remaining: float = 1e-8,
    samples: int = 201,
    past: float = PAST,
    rtol: float = 1e-11,
    atol: float = 1e-11,
) -> FamilyTrajectory:
    """Integrate a protocol for a family of graphs from which a signal chooses ``L(t)``, as ``X' = -gain(t) L(t) X``.

    Parameters
    ----------
    family : family-like
        Whatever :func:`ptcc_certify.as_family` takes: a Family, graphs by name, edges with intervals.
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : state-like
        N numbers in the order of ``family.labels``, or by label.
    signal : Signal, str, path, file object or sequence of rows
        ``"random"``, ``"worst-case"``, a table of instants and modes, or a
        :class:`~ptcc_certify.simulation.signals.Signal`: see :func:`~ptcc_certify.simulation.signals.as_signal`.
    sigma0 : state-like, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    disturbance : Disturbance, str, number or sequence, optional
        Sliding mode: as for :func:`ptcc_certify.simulate`, but none that reads the states; by default the worst case.
    times : increasing numbers >= 0, optional
        The instants wanted, in units of time.
    remaining : float
        Without ``times``: instants go from ``1 - t/T = 1`` to this; dimensionless.
    samples : int
        Without ``times``: so many of these instants; see :func:`ptcc_certify.simulate`.
    past : float
        Without ``times``: go on to ``T (1 + past)``; dimensionless.
    rtol, atol : float
        Tolerances of CVODES; ``atol`` is relative to the largest entry of ``x0``.

    Returns
    -------
    FamilyTrajectory
        A :class:`FamilySlidingTrajectory` under the sliding-mode protocol. Its state at ``T`` has settled
        (``deadline_resolved``) if the run came to rest in all members, or in the one that stays; under a signal that
        switches for ever it need not. From ``T`` on the last member stays, unless a table tells.

    Raises
    ------
    ParameterError
        An initial state, option, disturbance or signal that does not fit.
    SimulationError
        The integrator failed, or the signal switches too often.

    References
    ----------
    The network (3) under the protocol (4) of [Zhu]_; docs/theory/families.md, "What may change".

    Examples
    --------
    >>> unsure = [("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")]
    >>> run = simulate_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2], "worst-case")
    >>> run.signal, run.deadline_resolved, run.final_state.round(9) + 0
    ('worst case', True, array([0., 0.]))
    """
    begin, tolerances = time.perf_counter(), Tolerances.within(rtol, atol)
    family = as_family(family)
    refuse_no_protocol(protocol)
    for name, value in (("sigma0", sigma0), ("disturbance", disturbance)):
        if value is not None and protocol.reaching is None:
            raise ParameterError(name, "belongs to the sliding-mode protocol; leave it out or change the protocol")
    x = _one_state(x0, family, "x0")
    played = as_signal(signal)
    if times is None:
        instants = default_instants(protocol, remaining, samples, past)
    else:
        instants = wanted_instants(protocol, times)
    sliding = None
    if (robust := protocol.reaching) is not None:
        sigma = np.zeros(family.n_nodes) if sigma0 is None else _one_state(sigma0, family, "sigma0")[:, 0]
        sliding = SlidingRun.of(robust, family.labels, sigma, disturbance, float(instants.t[-1]))
    with interruptible():
        run = _run(family, protocol, x, played, instants, (tolerances, sliding))
    run.stats["seconds"] = time.perf_counter() - begin  # type: ignore[index]
    return run


def _one_state(values: Any, family: Family, name: str) -> np.ndarray:
    """Return a state as an (N, 1) array."""
    x = np.array([[float(value) for value in row] for row in as_states(values, family.modes[0].mandatory, name)])
    if x.shape[1] > 1:
        raise ParameterError(f"families run from one initial state at a time; give N numbers {name}")
    return x


def _run(
    family: Family,
    protocol: Protocol,
    x: np.ndarray,
    signal: Signal,
    instants: Instants,
    how: tuple[Tolerances, SlidingRun | None],
) -> FamilyTrajectory:
    (tolerances, sliding), gain = how, protocol.gain
    y = x if sliding is None else x - sliding.sigma0[:, None]
    unit = float(max(np.abs(x).max(), np.abs(y).max())) or 1.0
    clock = np.asarray(GainLimits().limit(gain).clock(instants.t, instants.remaining))
    members = Members(family)
    if sliding is None or not sliding.sigma0.any():
        motion = FamilyMotion(members, y / unit, tolerances)
    else:
        motion = DrivenFamilyMotion(members, y / unit, tolerances, sliding, unit)
    course = _Course(motion, lambda state: signal.play(members, gain, state), unit)
    states = np.empty((family.n_nodes, clock.size))
    acting = np.zeros(clock.size, dtype=np.int64)
    early = np.flatnonzero(np.isfinite(clock))
    for k in early.tolist():
        states[:, k] = course.advance(float(clock[k]))
        acting[k] = len(course.choices) - 1
    residual = None
    if early.size < clock.size:
        residual = _settle(course, clock[early], states[:, early], RESOLVED / 10 * max(tolerances))
        _go_past(course, signal, instants, early.size, (states, acting), protocol)
    more: dict[str, Any] = {} if sliding is None else sliding.fields(instants)
    trajectory = FamilyTrajectory if sliding is None else FamilySlidingTrajectory
    return trajectory(
        graph=family.modes[0].mandatory,
        protocol=protocol,
        t=instants.t,
        remaining=instants.remaining,
        clock=clock,
        states=states * unit + more.get("sigma", 0.0),
        rtol=tolerances.rtol,
        atol=tolerances.atol,
        deadline_index=instants.deadline(protocol),
        deadline_residual=residual,
        stats=motion.stats,
        family=family,
        signal=signal.text,
        choices=tuple(course.choices),
        switches=np.array(course.switches),
        acting=acting,
        **more,
    )


def _settle(course: _Course, clock: np.ndarray, states: np.ndarray, goal: float) -> float:
    """Move on to ``T``, and return how far from settled the state there is, relative to the largest entry of x0."""
    residual = np.inf
    if clock.size and clock[-1] > 0:
        half = states[:, np.searchsorted(clock, clock[-1] / 2)]
        if np.searchsorted(clock, clock[-1] / 2) < clock.size - 1:
            residual = max(float(np.abs(states[:, -1] - half).max()), course.imbalance())
    return course.settle(residual, goal)


def _go_past(
    course: _Course,
    signal: Signal,
    instants: Instants,
    first: int,
    results: tuple[np.ndarray, np.ndarray],
    protocol: Protocol,
) -> None:
    """Move on from ``T``, which is at the instants from the ``first`` on or before."""
    T, rho1 = float(protocol.T), float(protocol.gain.rho1)
    changes = [(max(t, T), choice) for t, choice in signal.past(course.motion.members, T)]
    states, acting = results
    now = T
    for k in range(first, instants.t.size):
        t = float(instants.t[k])
        while changes and changes[0][0] < t:
            change, choice = changes.pop(0)
            course.motion.move(rho1 * (change - now))
            course.switch(choice, np.inf)
            now = change
        course.motion.move(rho1 * (t - now))
        states[:, k], now = course.motion.state[:, 0], t
        acting[k] = len(course.choices) - 1
