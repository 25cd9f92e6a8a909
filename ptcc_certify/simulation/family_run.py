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
from ptcc_certify.simulation.cvodes import Motion, Phase, Tolerances
from ptcc_certify.simulation.family_members import Choice, Members
from ptcc_certify.simulation.instants import PAST, Instants, default_instants, wanted_instants
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.signals import Signal, as_signal
from ptcc_certify.simulation.trajectory import RESOLVED, Trajectory

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import Exact

#: Choices of a signal before a run is given up, and those after which it does not go on to see where it settles.
MOST_STRETCHES, MOST_SETTLING = 100_000, 2_000
# Beyond this product of in-weights and the stretch of the clock implicit steps are cheaper.
_STIFF = 10.0
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


class FamilyMotion(Motion):
    """The agents of a family, moved by the members that a signal chooses.

    Parameters
    ----------
    members : Members
    state : (N, 1) array
        In units of ``unit``.
    tolerances : Tolerances
    """

    def __init__(self, members: Members, state: np.ndarray, tolerances: Tolerances):
        import casadi as ca

        super().__init__(members.family.modes[0].mandatory, state, 1, tolerances)
        self.members, self.in_weight, n = members, members.in_weight, len(state)
        self._largest = float(self.in_weight.max(initial=0.0))
        self._pattern = ca.Sparsity(n, n, members.indptr.tolist(), members.indices.tolist())
        self._weights = ca.MX.sym("weights", members.indices.size)
        self._steps: dict[bool, Any] = {}
        self._data = np.zeros(members.indices.size)

    def choose(self, choice: Choice) -> None:
        """Let a member act from now on."""
        self._data = self.members.data(choice)

    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dX/dz`` on a stretch of length 1; its true length is a factor of the weights."""
        import casadi as ca

        return -ca.mtimes(ca.MX(self._pattern, self._weights), x)

    def move(self, span: float) -> None:
        """Move on by a stretch of the clock."""
        if span <= 0 or not self._largest:
            return
        stiffness = span * self._largest
        self.state = self._call(self._step(stiffness > _STIFF), stiffness, (self._data * span).tolist())[0]

    def _step(self, stiff: bool) -> Any:
        """Return CVODES for stretches of length 1, with implicit steps if they are stiff."""
        import casadi as ca

        if stiff not in self._steps:
            x, clock = ca.MX.sym("x", self.state.size), ca.MX.sym("z")
            ode = self.slope(x, Phase(0, 1, 1, past=True), clock, (0.0, 1.0))
            problem = {"x": x, "t": clock, "p": self._weights, "ode": ode}
            explicit = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
            self._steps[stiff] = self._integrator(problem, 0.0, np.ones(1), **({} if stiff else explicit))
        return self._steps[stiff]


class _Course:
    """A motion led by a signal along the clock."""

    def __init__(self, motion: FamilyMotion, play: Callable[..., Any], unit: float):
        self.motion, self.clock, self.until, self.stretches = motion, 0.0, 0.0, 0
        self.choices: list[Choice] = []
        self.switches: list[float] = []
        self._play = play(lambda: motion.state[:, 0] * unit)
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
    times: Iterable[Exact] | None = None,
    remaining: float = 1e-8,
    samples: int = 201,
    past: float = PAST,
    rtol: float = 1e-11,
    atol: float = 1e-11,
) -> FamilyTrajectory:
    """Integrate ``X' = -gain(t) L(t) X`` for a family of graphs from which a signal chooses ``L(t)``.

    Parameters
    ----------
    family : family-like
        Whatever :func:`ptcc_certify.as_family` takes: a Family, graphs by name, edges with intervals.
    protocol : NominalProtocol
    x0 : state-like
        N numbers in the order of ``family.labels``, or by label.
    signal : Signal, str, path, file object or sequence of rows
        ``"random"``, ``"worst-case"``, a table of instants and modes, or a
        :class:`~ptcc_certify.simulation.signals.Signal`: see :func:`~ptcc_certify.simulation.signals.as_signal`.
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
        Its state at ``T`` has settled (``deadline_resolved``) if the run came to rest in all members, or in the one
        that stays; under a signal that switches for ever it need not. From ``T`` on the last member stays, unless a
        table tells.

    Raises
    ------
    ParameterError
        Another protocol than the nominal one, an initial state, option or signal that does not fit.
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
    if protocol.reaching is not None:
        raise ParameterError("families run under the nominal protocol; give NominalProtocol(..)")
    graph = family.modes[0].mandatory
    x = np.array([[float(value) for value in row] for row in as_states(x0, graph, "x0")])
    if x.shape[1] > 1:
        raise ParameterError("families run from one initial state at a time; give N numbers x0")
    played = as_signal(signal)
    if times is None:
        instants = default_instants(protocol, remaining, samples, past)
    else:
        instants = wanted_instants(protocol, times)
    with interruptible():
        run = _run(family, protocol, x, played, instants, tolerances)
    run.stats["seconds"] = time.perf_counter() - begin  # type: ignore[index]
    return run


def _run(
    family: Family, protocol: Protocol, x: np.ndarray, signal: Signal, instants: Instants, tolerances: Tolerances
) -> FamilyTrajectory:
    gain, unit = protocol.gain, float(np.abs(x).max()) or 1.0
    clock = np.asarray(GainLimits().limit(gain).clock(instants.t, instants.remaining))
    members = Members(family)
    motion = FamilyMotion(members, x / unit, tolerances)
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
    return FamilyTrajectory(
        graph=family.modes[0].mandatory,
        protocol=protocol,
        t=instants.t,
        remaining=instants.remaining,
        clock=clock,
        states=states * unit,
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
