"""A motion led by a signal along the stretched clock, from switch to switch; one graph is a constant signal.

On the clock ``dX/ds = -L(s) X`` has no pole: before ``T`` a run is on it. The state at ``T`` is the limit for ``s`` to
infinity, if there is one; from ``T`` on ``X' = -rho1 L X``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ptcc_certify.errors import SimulationError
from ptcc_certify.simulation.cvodes import ON_CLOCK, Motion, Phase
from ptcc_certify.simulation.member_laplacians import Choice
from ptcc_certify.simulation.switching_signals import State, Stretch

#: Choices of a signal before a run is given up, and those after which it does not go on to see where it settles.
MOST_STRETCHES, MOST_SETTLING = 100_000, 2_000
# The state at T is given up beyond this s max(D): the roundings of float64 weights act there like slow modes.
_MAX_CLOCK = 1e13


class Leg(NamedTuple):
    """A part of a run on a clock of its own: its phase, the stretched clock there, and where that has a value."""

    phase: Phase
    clock: Callable[[float], float]
    place: Callable[[float], float]


#: The part of a run that is on the stretched clock itself.
CLOCK_LEG = Leg(ON_CLOCK, float, float)


class Course:
    """A motion led by a signal.

    Parameters
    ----------
    motion : Motion
    play : callable
        As :meth:`Signal.play <ptcc_certify.simulation.switching_signals.Signal.play>`, of the present state alone.

    Attributes
    ----------
    clock : float
        How far the run is.
    choices : list of Choice
        The members that have acted, in their order.
    switches : list of float
        The clock from which on each acted; infinite from ``T`` on.
    acting : list of int
        Which acted at the instants that were sampled.
    """

    def __init__(self, motion: Motion, play: Callable[[State], Iterator[Stretch]]):
        self.motion = motion
        self.clock, self.until, self.stretches = 0.0, 0.0, 0
        self.choices: list[Choice] = []
        self.switches: list[float] = []
        self.acting: list[int] = []
        self._play = play(lambda: self.motion.agents() * np.ravel(self.motion.unit)[0])
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

    def lead(self, motion: Motion) -> None:
        """Lead another motion from now on."""
        self.motion = motion
        motion.choose(self.choices[-1])

    def stay(self, instants: int, clock: float) -> None:
        """Note that the present member has acted at so many instants, up to a value of the clock."""
        self.acting += [len(self.choices) - 1] * instants
        self.clock = clock

    def sample(self, z: np.ndarray, end: float, leg: Leg = CLOCK_LEG, events: Iterable[float] = ()) -> np.ndarray:
        """Move on to the end of a leg; return the (len(z), N, S) states at increasing instants of it."""
        states = np.empty((z.size, *self.motion.state.shape))
        now, before = leg.place(self.clock), 0
        while True:
            stop = min(end, max(now, leg.place(self.until)))
            after = z.size if stop >= end else int(np.searchsorted(z, stop, side="right"))
            states[before:after] = self.motion.sample(leg.phase, z[before:after], stop, now, events)
            self.stay(after - before, leg.clock(end) if stop >= end else self.until)
            if stop >= end:
                return states
            now, before = stop, after
            self._begin()

    def settle(self, goal: float) -> float:
        """Go on to ``T``, doubling the clock, until the residual is small; return it.

        The residual must be small both locally (no agent is away from what it listens to) and over time (groups that
        hardly listen to each other drift slowly).
        """
        self.motion.refine()
        largest, residual = float(self.motion.in_weight.max(initial=0.0)) or 1.0, math.inf
        while True:
            before = self.motion.state
            try:
                self.sample(np.empty(0), max(2 * self.clock, 20 / largest))
            except SimulationError:
                if math.isinf(residual) and math.isinf(self.until):
                    raise
                return residual
            residual = max(float(np.abs(self.motion.state - before).max()), self.imbalance())
            if residual <= goal or self.clock * largest > _MAX_CLOCK or self.stretches >= MOST_SETTLING:
                return residual

    def imbalance(self) -> float:
        """Bound ``max_k |e_k| / (2 D_k)`` over all members, or of the one that stays for ever."""
        alone = math.isinf(self.until)
        state = self.motion.state if alone else self.motion.state[:, 0]
        return self.motion.members.imbalance(state, self.choices[-1] if alone else None)

    def past(self, t: np.ndarray, T: float, rho1: float, changes: Iterable[tuple[float, Choice]]) -> np.ndarray:
        """Move on from ``T``, where members change at instants; return the (M, N, S) states at instants from ``T``."""
        states = [np.empty((0, *self.motion.state.shape))]
        begins = [(T, None), *((max(instant, T), choice) for instant, choice in changes)]
        for (begin, choice), (end, _) in zip(begins, [*begins[1:], (math.inf, None)], strict=True):
            if choice is not None:
                self.switch(choice, math.inf)
            here = t[(t <= end) & ((t > begin) if choice is not None else True)]
            stop = rho1 * (min(end, float(t[-1])) - begin)
            states.append(self.motion.sample(ON_CLOCK, rho1 * (here - begin), max(stop, 0.0)))
            self.stay(here.size, math.inf)
        return np.concatenate(states)
