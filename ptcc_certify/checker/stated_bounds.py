"""Bounds that a file states by agent, which proofs of several kinds may meet: some agents by one, some by another.

They are bounds of what is left at the deadline, and under a capped gain of the input, by rows or by a Lyapunov
function; and of double integrators that track virtual states, the part on vehicles of section 22 of the format. Every
decay by rows of virtual single integrators ``z_k``, ``|z_k - x*_k| <= u_k (initial y + floor + C)``, carries over to
the vehicles, which follow ``z_k`` as it is seen through two filters of the first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul
from typing import NamedTuple

from lmi.exact.decimal_rounding import down, up
from lmi.exact.numbers import integers, longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.follower_rows import Followers, Rows
from ptcc_certify.checker.input_formulas import gain_above
from ptcc_certify.checker.message_ages import Messages
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import Agents, Positive
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stepwise_inputs import AgentSteps, VehicleSteps, Walk


@dataclass(frozen=True)
class Decay:
    """A decay by rows: ``|x_k - x*_k| <= u_k (initial e^(-b s) + floor)`` and what drives add.

    Attributes
    ----------
    b : Fraction
        Its rate.
    cap : Fraction or None
        Of its clock.
    left : Fraction
        What is left of it at ``T``.
    initial, floor, drift, highest : Fraction
        ``initial`` times it, what errors add, what drives add at ``T``, and what both add at most up to ``T``.
    """

    b: Fraction
    cap: Fraction | None
    left: Fraction
    initial: Fraction
    floor: Fraction
    drift: Fraction
    highest: Fraction


@dataclass(frozen=True)
class DecayOfAll:
    """A decay of agents up to ``T``: ``|x_k - x*_k| <= away_k y + floor_k``, ``|e_k| <= falling_k y + standing_k``.

    Attributes
    ----------
    nodes : sequence of int
        Whose.
    b : Fraction
        Its rate, ``y = e^(-b s_c)``.
    cap : Fraction or None
        Of its clock.
    left : Fraction
        What is left of it at ``T``.
    away, floor, falling, standing : sequences of Fraction
        By node.
    """

    nodes: Sequence[int]
    b: Fraction
    cap: Fraction | None
    left: Fraction
    away: Sequence[Fraction]
    floor: Sequence[Fraction]
    falling: Sequence[Fraction]
    standing: Sequence[Fraction]


class Stated:
    """A bound of every agent, and which of them a proof has met.

    Parameters
    ----------
    name : str
        Of what is bounded.
    labels : sequence of str
        Of the agents.
    values : Numbers
        By agent.

    Examples
    --------
    >>> stated = Stated("input", ["a", "b"], Numbers([Fraction(1, 2), Fraction(3)]))
    >>> stated.meet([0, 1], (Fraction(1, 4), [2, 12]), (Fraction(1), [0, 0]))
    >>> stated.close()
    >>> stated.largest, list(stated.met)
    (Fraction(3, 1), [1, 1])
    """

    def __init__(self, name: str, labels: Sequence[str], values: Numbers):
        self.name, self.labels = name, labels
        self.values, self.scale = values.over(range(len(labels)))
        self.met = bytearray(len(labels))

    @property
    def largest(self) -> Fraction:
        """The largest one."""
        return Fraction(max(self.values), self.scale)

    def meet(self, nodes: Sequence[int], *terms: tuple[Fraction, Sequence[int]]) -> None:
        """Mark the nodes whose bound is at least the sum of columns by node, each times its factor."""
        columns = [column for _, column in terms]
        common = math.lcm(*(factor.denominator for factor, _ in terms))
        factors = [factor.numerator * (common // factor.denominator) * self.scale for factor, _ in terms]
        bits = longest(self.values) + max(map(longest, columns), default=0)
        spend((2 + len(terms)) * len(nodes), longest((common, *factors)), bits, f"the {self.name} of agents")
        for v, *own in zip(nodes, *columns, strict=True):
            if common * self.values[v] >= sum(map(mul, own, factors)):
                self.met[v] = 1

    def rest(self, nodes: Sequence[int], why: str) -> None:
        """Verify that 0 is stated of agents that rest; ``why`` tells what is the matter otherwise."""
        need(not any(self.values[v] for v in nodes), why)
        self.meet(nodes)

    def close(self) -> None:
        """Verify that a proof has met the bound of every agent."""
        low = self.met.find(0)
        need(low < 0, f"the {self.name} of agent {shorten(self.labels[max(low, 0)])} is not proved")


class Residual:
    """What is stated of ``|x_k(T) - x*_k|``.

    Parameters
    ----------
    doc : Document
    values : Numbers
        By agent.
    """

    def __init__(self, doc: Document, values: Numbers):
        doc.at = "messages.residual"
        self.stated = Stated("residual", doc.context.labels, values)

    def of_all(self, decay: DecayOfAll) -> None:
        """Mark what is at least as large as a decay leaves it."""
        (at_T,), scale = integers([[x * decay.left + y for x, y in zip(decay.away, decay.floor, strict=True)]])
        self.stated.meet(decay.nodes, (Fraction(1, scale), at_T))

    def behind(self, followers: Followers) -> None:
        """Verify that nothing is stated of leaders that rest."""
        self.stated.rest(followers.others, "a residual of a leader that rests")

    def by_rows(self, rows: Rows, decay: Decay) -> None:
        """Mark what is at least as large as this decay leaves it."""
        at_T = decay.initial * decay.left + decay.floor + decay.drift
        self.stated.meet(rows.followers.nodes, (at_T / rows.scale, rows.u))

    def along(self, walk: Walk) -> None:
        """Nothing is to be followed: what is left stands at the last instant."""

    def by_steps(self, walk: Walk, last: Sequence[int]) -> None:
        """Mark what is at least what bounds from instant to instant leave."""
        self.stated.meet(walk.steps.nodes, (walk.unit, last))

    def close(self, doc: Document) -> None:
        """Verify that a bound meets what is stated of every follower."""
        doc.open("late-residual", "messages.residual")
        self.stated.close()
        doc.done(f"at most {up(self.stated.largest)}")


class Inputs:
    """What is stated of ``|u_k|`` up to the deadline by agent.

    Parameters
    ----------
    doc : Document
    messages : Messages
    values : Numbers
        By agent.

    """

    def __init__(self, doc: Document, messages: Messages, values: Numbers):
        doc.at = "messages.input"
        self.messages, self.gain_cap = messages, messages.gain_cap
        self.stated = Stated("input", doc.context.labels, values)
        need(min(self.stated.values) >= 0, "an input is negative")
        self.steps: AgentSteps | None = None

    def by_rows(self, rows: Rows, decay: Decay) -> None:
        """Mark what is at least ``(2 D_k - b) u_k initial y + gain_cap (highest (D_k u_k + heard_k) + error D_k)``.

        Since ``heard_k <= (D_k - b) u_k``, of any weights. Where these are uncertain, the largest are taken. Where
        nothing is late ``(D_k u_k + heard_k)`` times what bounds ``gain m`` does, too; and ``sign_gain`` is added.
        Where inputs are clipped what they are clipped to does.
        """
        followers, b, leaders = rows.followers, decay.b, self.messages.leaders
        (most, unit), (degrees, _) = rows.largest, followers.degrees
        sign = (Fraction(0) if leaders is None else leaders.sign_gain or Fraction(0)), [1] * len(degrees)
        self.stated.meet(followers.others)  # leaders that rest, or move as they like
        if (saturation := self.messages.saturation) is not None:
            self.stated.meet(followers.nodes, (saturation, [1] * len(degrees)))
        falling = self.messages.falling_input(b, decay.initial, rows.least)
        if falling is not None:
            self.stated.meet(followers.nodes, (falling / (rows.scale * unit), most), sign)
        if self.gain_cap is None:
            return
        y = decay.initial * self._gain_above(b, decay.cap) / rows.scale
        self.stated.meet(
            followers.nodes,
            sign,
            (2 * y / unit, list(map(mul, degrees, rows.u))),
            (-b * y, rows.u),
            (self.gain_cap * decay.highest / (rows.scale * unit), most),
            (self.gain_cap * self.messages.wrong / unit, degrees),
        )

    def along(self, walk: Walk) -> AgentSteps | None:
        """Return what follows inputs from instant to instant; None without a cap of the gain."""
        self.steps = None if self.gain_cap is None else AgentSteps(walk)
        return self.steps

    def by_steps(self, walk: Walk, last: Sequence[int]) -> None:
        """Mark what is at least ``D_k g m_k`` in every step."""
        if self.steps is not None:
            degrees, inside = walk.steps.degrees, set(walk.steps.nodes)
            self.stated.meet([v for v in range(len(self.stated.met)) if v not in inside])
            heard = [D * int(x) for D, x in zip(degrees, self.steps.peaks, strict=True)]
            self.stated.meet(walk.steps.nodes, (walk.size * walk.gains[-1], heard))

    def _gain_above(self, b: Fraction, cap: Fraction | None = None) -> Fraction:
        if self.gain_cap is None:
            raise RejectedError("an input without a cap of the gain")
        return gain_above(self.messages.gain, self.gain_cap, b, cap)

    def of_all(self, decay: DecayOfAll) -> None:
        """Mark what is at least ``falling_k sup g e^(-b s) + gain_cap standing_k``, under a cap.

        Without one, where nothing is late or off: ``g(0) falling_k + b g(0) standing_k (rho1 T + k)/(p - 1)``, ``p = b
        k``, for what stands is then what drives add at most, over ``b g(0)``.
        """
        gain, p = self.messages.gain, decay.b * self.messages.gain.k
        (falling, standing), scale = integers([decay.falling, decay.standing])
        if self.gain_cap is not None:
            y, steady = self._gain_above(decay.b, decay.cap), self.gain_cap
        elif not self.messages.delay and not self.messages.value_error and (p > 1 or (p == 1 and not any(standing))):
            y = self.messages.least_gain()
            steady = decay.b * y * (gain.rho1 * gain.T + gain.k) / (p - 1) if p > 1 else Fraction(0)
        else:
            return
        self.stated.meet(decay.nodes, (y / scale, falling), (steady / scale, standing))

    def close(self, doc: Document) -> None:
        """Verify that a bound meets what is stated of every agent."""
        doc.at = "messages.input"
        doc.open("late-input", "messages.input")
        self.stated.close()
        doc.done(f"at most {up(self.stated.largest)}")


@dataclass(frozen=True, kw_only=True)
class VehiclesSection:
    """Double integrators that track virtual states: gains, initial velocities, and bounds by agent."""

    a1: Positive
    a2: Positive
    v0: Agents
    position: Agents
    velocity: Agents | None = None
    input: Agents | None = None


class Passed(NamedTuple):
    """By what a bound of vehicles grows with ``|v_k(0)|``, and with what falls and what stands of virtual states."""

    begun: Fraction
    falling: Fraction
    standing: Fraction


def passed_on(
    messages: Messages, b: Fraction, left: Fraction, cap: Fraction | None, gains: tuple[Fraction, Fraction]
) -> tuple[Passed, ...]:
    """Return what vehicles make of a decay of virtual states, ``y = e^(-b s_c)``, by ``a_1`` and ``a_2``.

    First of positions at ``T``: ``|z_k - x*_k|`` at ``T``, without and with what stands of it; then, under a cap, of
    velocities and inputs up to ``T``: ``p_k`` and ``n_k``, where ``|e_k| <= p_k y + n_k``.

    Examples
    --------
    >>> from ptcc_certify.checker.input_formulas import PrescribedGain
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> messages = Messages(gain, Numbers([Fraction(0)]), Fraction(0), False, Fraction(0), Fraction(2))
    >>> one, left = Fraction(1), Fraction(1, 4)
    >>> for passed in passed_on(messages, one, left, 2 * one, (2 * one, 2 * one)):
    ...     print(*map(float, passed))
    0.125 2.0 1.0
    3.0 4.0 2.0
    20.0 32.0 20.0
    """
    gain, (a1, a2), first, G = messages.gain, gains, messages.least_gain(), messages.gain_cap
    lag, turn = 1 / (a1 - b), a1 / gain.k + a1 * a1
    position = Passed(left * lag / first, a1 * lag, Fraction(1))
    if G is None:
        return (position,)
    y, square = gain_above(gain, G, b, cap), gain_above(gain, G, b / 2, cap) ** 2
    velocity = Passed(y * (1 + a1 * lag) / first, y * a1 * lag, G)
    whole = Passed(square * (turn * lag + a1 + a2) / first, square * (turn * lag + a1), (1 / gain.k + 2 * a1) * G * G)
    return position, velocity, whole


class Vehicles:
    """What is stated of vehicles by agent, and which of it was met by a decay of their virtual states.

    Parameters
    ----------
    doc : Document
    messages : Messages
    section : VehiclesSection

    Raises
    ------
    RejectedError
        Something of it is not proved of these messages.
    """

    def __init__(self, doc: Document, messages: Messages, section: VehiclesSection):
        doc.at = "messages.vehicles"
        self.labels, self.messages, self.section = doc.context.labels, messages, section
        need(messages.leaders is None or messages.leaders.disturbance == 0, "vehicles that are disturbed")
        capped = messages.gain_cap is not None
        stated = [section.velocity is not None, section.input is not None]
        need(stated == [capped, capped], "velocity and input are stated iff the gain has a cap")
        lists = {"position": section.position, "velocity": section.velocity, "input": section.input}
        self.stated = [Stated(name, self.labels, values) for name, values in lists.items() if values is not None]
        need(all(min(one.values) >= 0 for one in self.stated), "a bound is negative")
        self.begun, self.scale = section.v0.over(range(len(self.labels)))
        self.steps: VehicleSteps | None = None

    def by_rows(self, rows: Rows, decay: Decay) -> None:
        """Mark what is at least as large as this decay makes it, unless it is too fast for the gains."""
        followers, b, M = rows.followers, decay.b, decay.initial
        begun, others = [abs(v) for v in self.begun], followers.others
        if self.messages.leaders is not None:
            need(not any(begun[v] for v in others), "an initial velocity of a leader that moves as it likes")
        bits = length((M, decay.floor, decay.highest))
        spend(100, bits, bits, "bounds of vehicles")
        if (passed := self._passed(b, decay.left, decay.cap)) is None:
            return
        (heard, unit), (degrees, _) = rows.largest, followers.degrees
        of, common = followers.nodes, rows.scale * unit
        pulled, own = list(map(mul, degrees, rows.u)), [begun[v] for v in of]
        first = passed[0].falling * (M * decay.left + decay.drift) + decay.floor
        self.stated[0].meet(of, (passed[0].begun / self.scale, own), (first / rows.scale, rows.u))
        for one, (by_begun, falling, standing) in zip(self.stated[1:], passed[1:], strict=True):
            one.meet(
                of,
                (by_begun / self.scale, own),
                (2 * falling * M / common, pulled),
                (-b * falling * M / rows.scale, rows.u),
                (standing * decay.highest / common, heard),
                (standing * self.messages.wrong / unit, degrees),
            )
        for one, (by_begun, _, _) in zip(self.stated, passed, strict=True):
            one.meet(others, (by_begun / self.scale, [begun[v] for v in others]))

    def of_all(self, decay: DecayOfAll) -> None:
        """Mark what is at least as large as a decay of all agents makes it, unless it is too fast for the gains."""
        if (passed := self._passed(decay.b, decay.left, decay.cap)) is None:
            return
        columns = [x * decay.left for x in decay.away], decay.floor, decay.falling, decay.standing
        (away, floor, falling, standing), scale = integers(columns)
        begun = [abs(self.begun[v]) for v in decay.nodes]
        pairs = [(away, floor), *[(falling, standing)] * 2]
        for one, row, (falls, stands) in zip(self.stated, passed, pairs, strict=False):
            terms = (row.begun / self.scale, begun), (row.falling / scale, falls), (row.standing / scale, stands)
            one.meet(decay.nodes, *terms)

    def _passed(self, b: Fraction, left: Fraction, cap: Fraction | None) -> tuple[Passed, ...] | None:
        """Return what vehicles make of a decay of virtual states; None if it is too fast for the gains."""
        a1, a2 = gains = self.section.a1, self.section.a2
        bits = length((b, left, *gains))
        spend(100, bits, bits, "bounds of vehicles")
        return None if b >= a1 or b > a2 else passed_on(self.messages, b, left, cap, gains)

    def along(self, walk: Walk) -> VehicleSteps | None:
        """Return what follows vehicles from instant to instant; None without a cap of the gain."""
        if self.messages.gain_cap is not None:
            begun = [Fraction(abs(self.begun[v]), self.scale) for v in walk.steps.nodes]
            self.steps = VehicleSteps(walk, begun, self.section.a1, self.section.a2)
        return self.steps

    def by_steps(self, walk: Walk, last: Sequence[int]) -> None:
        """Mark what is at least what follows from instant to instant."""
        if self.steps is not None:
            bounds = self.steps.bounds(last)
            for one in self.stated:
                one.meet(walk.steps.nodes, bounds[one.name])

    def close(self, doc: Document) -> None:
        """Verify that a decay meets what is stated of every agent."""
        doc.at = "messages.vehicles"
        doc.open("late-vehicles", "messages.vehicles")
        for one in self.stated:
            one.close()
        doc.done(f"a_1 = {down(self.section.a1)}, at most {up(self.stated[0].largest)}")
