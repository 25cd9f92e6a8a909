"""What proofs of graphs and of families have in common: the question, and what is proved beside the decay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.certificate.request import Expectations, Question, Request
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.model import Protocol
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.reaching_time import ReachingTime


@dataclass(frozen=True, eq=False)
class Source:
    """The file that a certificate was read from, accepted by the independent check.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the file.
    document : mapping
        Its JSON. What stands under ``unverified`` is the file's own word.
    report : CheckReport
        Of the independent check.
    effort : Effort or None
        What is proved about the input.
    files : mapping of str to bytes
        The side files that stood beside it, by name.
    """

    path: Path
    sha256: str
    document: Mapping[str, Any]
    report: CheckReport
    effort: Effort | None
    files: Mapping[str, bytes] = field(repr=False)


class OfQuestion:
    """What a question tells, asked of what answers it."""

    question: Question

    @property
    def protocol(self) -> Protocol:
        """The protocol."""
        return self.question.protocol

    @property
    def initial_state(self) -> tuple[Fraction, ...] | None:
        """``X(0)``."""
        return self.question.initial_state

    @property
    def sigma0(self) -> tuple[Fraction, ...] | None:
        """``sigma(0)`` of the sliding-mode protocol; None for the nominal one."""
        return self.question.sigma0

    @property
    def labels(self) -> Sequence[str]:
        """The names of the agents."""
        return self.question.labels

    @property
    def request(self) -> Request:
        """What was asked."""
        return self.question.request

    @property
    def expectations(self) -> Expectations:
        """What is asked besides."""
        return self.request.expectations

    @property
    def origins(self) -> Mapping[str, str]:
        """What the graph is called, and where initial states come from."""
        return self.request.origins

    @property
    def method(self) -> str:
        """Which Lyapunov functions were searched."""
        return self.request.method

    @property
    def at(self) -> Fraction | None:
        """Instant for which the bound was optimised, in units of time."""
        return self.request.at

    @property
    def initial_set(self) -> InitialSet | None:
        """The set of initial states for which the input is bounded; None: that of ``initial_state`` alone."""
        return self.request.initial_set

    @property
    def only_drawn(self) -> bool:
        """Whether the question is of a set of initial states, and the one at hand drawn for the simulated run."""
        return self.initial_set is not None and "x(0)" in self.request.origins

    @property
    def limits(self) -> tuple[Limits, ...]:
        """Limits of the gain that are judged besides."""
        return self.request.limits

    @property
    def delta(self) -> Fraction | None:
        """Nominal protocol: bound of the disturbances that are judged besides, in units of the input."""
        return self.request.delta

    @property
    def noise(self) -> Fraction | None:
        """Nominal protocol: bound of the measurement noise that is judged under each of the limits."""
        return self.request.noise

    @property
    def time_limit(self) -> float:
        """Seconds that the searches were given, infinity for no limit."""
        return self.request.time_limit

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())


@dataclass(frozen=True, eq=False, kw_only=True)
class Proof(OfQuestion):
    """What is proved of a graph or of a family.

    Attributes
    ----------
    question : Question
    reaching : tuple of N ReachingTime, or None
        When each sliding variable is proved to be 0, whatever the disturbance.
    late : LateBounds or None
        What holds with late messages, and while leaders move; None where neither was asked.
    source : Source or None
        The file that it was read from.
    offsets : tuple of N Fraction, or None
        Places of agents in a formation on a line: initial and final state and everything else are of ``x - offsets``;
        :attr:`initial_positions` and ``final_positions`` are of ``x``.
    """

    question: Question
    reaching: tuple[ReachingTime, ...] | None = None
    late: LateBounds | None = None
    source: Source | None = None
    offsets: tuple[Fraction, ...] | None = None

    @property
    def initial_positions(self) -> tuple[Fraction, ...] | None:
        """Where agents begin: in a formation ``initial_state`` is less their places."""
        if self.offsets is None or self.initial_state is None:
            return self.initial_state
        return tuple(x + h for x, h in zip(self.initial_state, self.offsets, strict=True))

    @property
    def asked_messages(self) -> LateMessages | None:
        """How late messages are; None where they come at once and exactly."""
        messages = self.request.messages if self.late is None else self.late.messages
        return None if messages is None or messages.tracks else messages

    @property
    def asked_leaders(self) -> MovingLeaders | None:
        """How leaders move."""
        messages = self.request.messages if self.late is None else self.late.messages
        return None if messages is None else messages.leaders

    @property
    def leaders_move(self) -> bool:
        """Whether leaders move."""
        return self.asked_leaders is not None and self.asked_leaders.moving

    @property
    def velocities(self) -> Sequence[Fraction] | None:
        """Initial velocities of vehicles that exchange virtual positions; None without them."""
        vehicles = None if self.late is None else self.late.messages.vehicles
        return None if vehicles is None else vehicles.v0
