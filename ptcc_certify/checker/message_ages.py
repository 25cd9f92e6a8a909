"""Reads how late messages are: ages of what is heard, packets that get lost, values that are rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil
from typing import Literal

from lmi.exact.elementary_enclosures import exp, log, rounded
from lmi.exact.numbers import longest
from lmi.exact.work import spend
from ptcc_certify.checker.input_formulas import BITS, Limits, PrescribedGain, decay_above
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.section_declarations import EdgeNumbers, NotNegative, Positive
from ptcc_certify.checker.side_files import Numbers

#: Ages of what is heard over single edges are rounded up to so many parts of the largest one.
PARTS = 64
#: Exponents of what grows, at most: ``b gain_cap delay``, ``growth T``.
LARGEST_GROWTH = 1000


@dataclass(frozen=True, kw_only=True)
class Moving:
    """Leaders that move.

    Attributes
    ----------
    speed, disturbance : Fraction
        Of every leader, and of every follower, at most.
    sign_gain : Fraction or None
        What followers add times ``sign(e_k)``: at least the sum of these.
    growth : Fraction or None
        The Lipschitz constant of what all agents do by themselves, which is odd; None if that is nothing.
    saturation : Fraction or None
        What the inputs of followers are clipped to.
    """

    speed: NotNegative
    disturbance: NotNegative
    sign_gain: Fraction | None = None
    growth: Positive | None = None
    saturation: Positive | None = None

    @property
    def push(self) -> Fraction:
        """How fast a follower and its target may part; 0 where the sign term takes that up."""
        return self.speed + self.disturbance if self.sign_gain is None else Fraction(0)


@dataclass(frozen=True, eq=False)
class Messages:
    """What is heard, and when.

    Attributes
    ----------
    gain : PrescribedGain
        That of the protocol.
    latency : Numbers
        The least age of what is heard over each edge; one number for all.
    delay : Fraction
        Nothing that is heard is older; over an edge nothing is older than its latency and what values are held.
    late : bool
        The own state is as old as what is heard.
    value_error : Fraction
        No value is off by more.
    gain_cap : Fraction or None
        What the gain is capped at.
    leaders : Moving or None
        How fast leaders move, what disturbs the followers, and a sign term; None if they rest, and nothing does.
    """

    gain: PrescribedGain
    latency: Numbers
    delay: Fraction
    late: bool
    value_error: Fraction
    gain_cap: Fraction | None
    leaders: Moving | None = None

    def least_gain(self, always: bool = False) -> Fraction:
        """Return the least gain up to ``T``, or of all times: ``rho1``, or the first one, or its cap."""
        least = self.gain.rho1 if always else self.gain.value(Fraction(1))
        return least if self.gain_cap is None else min(least, self.gain_cap)

    @property
    def wrong(self) -> Fraction:
        """What is heard differs from what is so by no more, deviations left out: targets move on while it is late."""
        return self.value_error + (self.leaders.speed * self.delay if self.leaders else 0)

    def falling_input(self, b: Fraction, initial: Fraction, least: Fraction) -> Fraction | None:
        """Bound ``gain m``, ``m' <= -b gain m + push/least`` from ``initial``, where nothing is late or off.

        With ``p = b rho2 kappa`` at most ``gain(0) initial + push/least (rho1 T + rho2 kappa)/(p - 1)``, without the
        push also where ``p = 1``, under a cap too; None where neither is known.
        """
        p, gain, push = b * self.gain.k, self.gain, Fraction(0) if self.leaders is None else self.leaders.push
        if self.delay or self.value_error or p < 1 or (push and p == 1):
            return None
        most, push = self.least_gain() * initial, push * self.grown(self.growth)
        return most + push / least * (gain.rho1 * gain.T + gain.k) / (p - 1) if push else most

    @property
    def growth(self) -> Fraction:
        """At what rate what agents do by themselves parts two of them, at most."""
        return (None if self.leaders is None else self.leaders.growth) or Fraction(0)

    @property
    def saturation(self) -> Fraction | None:
        """What inputs are clipped to."""
        return None if self.leaders is None else self.leaders.saturation

    def grown(self, growth: Fraction) -> Fraction:
        """Bound ``e^(growth T)`` from above: by so much more is left of anything at ``T`` than without growth.

        Raises
        ------
        RejectedError
            It is too large.
        """
        if not growth:
            return Fraction(1)
        need(growth * self.gain.T <= LARGEST_GROWTH, "agents part too fast by themselves")
        return rounded(exp(rounded(growth * self.gain.T, BITS, up=True), BITS)[1], BITS, up=True)

    def lasting(self, growth: Fraction, b: Fraction) -> Fraction | None:
        """Return how much more of what drives agents stands, at all times; None if after ``T`` it grows.

        Up to ``T`` that is ``e^(growth T)``; from there on ``g/(g - growth/b)`` under a gain of at least ``g``.
        """
        if not growth:
            return Fraction(1)
        room = 1 - growth / (b * self.least_gain(always=True))
        return max(self.grown(growth), 1 / room) if room > 0 else None

    def latency_of(self, edge: int) -> Fraction:
        """Return the latency of an edge, by its place among all."""
        return self.latency[edge if len(self.latency) > 1 else 0]

    @cached_property
    def parts(self) -> Sequence[int]:
        """Return the age of what is heard over each edge, at most, in 64ths of the largest one; one for all edges.

        Raises
        ------
        WorkError
            Latencies are too long to be compared.
        """
        if len(self.latency) == 1 or not self.delay:
            return (PARTS,)
        distinct, held = set(self.latency.values), self.delay - self.latency.largest()
        bits = longest((*self.delay.as_integer_ratio(), *held.as_integer_ratio(), self.latency.scale or 1))
        spend(4 * len(distinct), bits, bits + length(map(Fraction, distinct)), "ages of what is heard")
        part = {x: ceil(PARTS * (Fraction(x) / (self.latency.scale or 1) + held) / self.delay) for x in distinct}
        each = [part[x] for x in self.latency.values]
        return each if min(each) < PARTS else (PARTS,)


def need_left(
    messages: Messages, q: Fraction, b: Fraction, cap: Fraction | None, clock: Fraction | None, left: Fraction
) -> Fraction | None:
    """Verify that ``q`` serves the delay under a cap, how far the clock comes then, and what is left at ``T``.

    Return what caps the clock.
    """
    need(cap is None or b * cap * messages.delay <= log(q)[0], "b cap delay is above ln q")
    limit = min((x for x in (cap, messages.gain_cap) if x is not None), default=None)
    need((limit is None) == (clock is None), "clock is told iff something caps the gain")
    if limit is None or clock is None:
        need(left == 0, "left is not 0 though the clock goes on for ever")
    else:
        need(0 <= clock <= Limits(limit).clock_below(messages.gain), "the clock does not come so far")
        need(left >= decay_above(b * clock), "left is not proved")
    return limit


@dataclass(frozen=True, kw_only=True)
class Packets:
    """Values that are sent every so often, and held until the next one arrives."""

    period: Positive
    losses: NotNegative


@dataclass(frozen=True, kw_only=True)
class Delays:
    """What the file says of how late messages are; ``latency``: one number for all edges, or one for each."""

    latency: Fraction | EdgeNumbers
    packets: Packets | None = None
    delay: Fraction
    own: Literal["fresh", "late"]
    value_error: NotNegative
    gain_cap: Positive | None = None
    leaders: Moving | None = None


def check_delays(gain: PrescribedGain, section: Delays) -> Messages:
    """Verify that what a file says of messages fits together; return ages, errors, and what caps the gain.

    Raises
    ------
    RejectedError
        Some of it does not fit the rest.
    """
    latency, packets, delay = section.latency, section.packets, section.delay
    if isinstance(latency, Fraction):
        latency = Numbers([latency])
    need(len(latency) > 0, "latencies without edges")
    need(all(x >= 0 for x in latency.values), "a latency is negative")
    age = latency.largest()
    if packets is not None:
        need(packets.losses.denominator == 1, "losses is no number of packets")
        age += (packets.losses + 1) * packets.period
    need(delay == age, "delay is not the largest age of what is heard")
    virtual = getattr(section, "vehicles", None) is not None
    leaders = section.leaders
    need(
        virtual or leaders is not None or delay > 0 or section.value_error > 0,
        "nothing is late or off, and leaders rest",
    )
    if leaders is not None and leaders.sign_gain is not None:
        need(leaders.sign_gain >= leaders.speed + leaders.disturbance, "sign_gain is below speed + disturbance")
        need(not virtual and section.own == "fresh", "a sign term of virtual positions, or of a late own state")
    if leaders is not None and leaders.growth:
        need(not virtual and delay == 0, "agents that move by themselves beside virtual positions, or late messages")
    late, cap = section.own == "late", section.gain_cap
    need(cap is not None or not late, "the own state is late, and the gain has no cap: the protocol diverges")
    if leaders is not None and leaders.saturation is not None:
        alone = not virtual and delay == 0 and leaders.growth is None and leaders.sign_gain is None
        need(alone and not leaders.push, "inputs that are clipped beside late messages, leaders that move or vehicles")
    return Messages(gain, latency, delay, late, section.value_error, cap, leaders)
