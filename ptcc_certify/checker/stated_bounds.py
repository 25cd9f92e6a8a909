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
from ptcc_certify.checker.structure import Structure


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
    """What is stated of ``|x_k(T) - x*_k|`` of followers; leaders rest.

    Parameters
    ----------
    doc : Document
    values : Numbers
        By agent.
    """

    def __init__(self, doc: Document, followers: Followers, values: Numbers):
        doc.at = "messages.residual"
        self.stated = Stated("residual", followers.labels, values)
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
        """
        followers, b, leaders = rows.followers, decay.b, self.messages.leaders
        (most, unit), (degrees, _) = rows.largest, followers.degrees
        sign = (Fraction(0) if leaders is None else leaders.sign_gain or Fraction(0)), [1] * len(degrees)
        self.stated.meet(followers.others)  # leaders that rest, or move as they like
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

    def by_settling(self, structure: Structure, u: Numbers, b: Fraction, cap: Fraction) -> None:
        """Mark what is at least ``(2 D_k - b) u_k y`` of followers, ``(D_l u_l + heard_l) y`` of leaders."""
        graph = structure.graph
        values, scale = u.over(range(graph.n))
        y, heard = self._gain_above(b, cap) / scale, graph.sums_in(values)
        sent = list(map(mul, graph.diagonal, values))
        of_followers = ([column[v] for v in structure.followers] for column in (sent, values))
        self.stated.meet(structure.followers, *zip((2 * y / graph.unit, -b * y), of_followers, strict=True))
        leaders = [v for group in structure.closed for v in group]
        self.stated.meet(leaders, (y / graph.unit, [sent[v] + heard[v] for v in leaders]))

    def by_form(self, phi: Sequence[Fraction], b: Fraction, root: Fraction) -> None:
        """Mark what is at least ``phi_k sqrt(V(0)) y``."""
        (values,), scale = integers([phi])
        y = root * self._gain_above(b)
        self.stated.meet(range(len(values)), (y / scale, values))

    def close(self, doc: Document) -> None:
        """Verify that a bound meets what is stated of every agent."""
        doc.at = "messages.input"
        doc.open("late-input", "messages.input")
        self.stated.close()
        doc.done(f"at most {up(self.stated.largest)}")


#: Coefficients of ``|v_k(0)|``, of ``u_k``, of ``D_k u_k + sum_l |w_kl| u_l``, of ``D_k u_k`` and of ``D_k``.
Coefficients = tuple[Fraction, Fraction, Fraction, Fraction, Fraction]


@dataclass(frozen=True, kw_only=True)
class VehiclesSection:
    """Double integrators that track virtual states: gains, initial velocities, and bounds by agent."""

    a1: Positive
    a2: Positive
    v0: Agents
    position: Agents
    velocity: Agents | None = None
    input: Agents | None = None


def coefficients(messages: Messages, decay: Decay, a1: Fraction, a2: Fraction) -> tuple[Coefficients, ...]:
    """Return by what positions at ``T`` are bounded, and under a cap velocities and inputs up to ``T``.

    Examples
    --------
    >>> from ptcc_certify.checker.input_formulas import PrescribedGain
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> messages = Messages(gain, Numbers([Fraction(0)]), Fraction(0), False, Fraction(0), Fraction(2))
    >>> decay = Decay(*map(Fraction, (1, 2)), Fraction(1, 4), Fraction(1), *[Fraction(0)] * 3)
    >>> [[float(x) for x in row] for row in coefficients(messages, decay, Fraction(2), Fraction(2))]
    [[0.125, 0.5, 0.0, 0.0, 0.0], [3.0, -4.0, 0.0, 8.0, 0.0], [20.0, -32.0, 0.0, 64.0, 0.0]]
    """
    gain, zero, b, M, error = messages.gain, Fraction(0), decay.b, decay.initial, messages.wrong
    first, k = messages.least_gain(), gain.k
    lag, G = 1 / (a1 - b), messages.gain_cap
    position = (decay.left * lag / first, a1 * lag * (M * decay.left + decay.drift) + decay.floor, zero, zero, zero)
    if G is None:
        return (position,)
    y, square = gain_above(gain, G, b, decay.cap), gain_above(gain, G, b / 2, decay.cap) ** 2
    turn = a1 / k + a1 * a1
    found = [position]
    for moved, own, pulled, steady in (
        (y, 1 + a1 * lag, a1 * lag, G),
        (square, turn * lag + a1 + a2, turn * lag + a1, (1 / k + 2 * a1) * G * G),
    ):
        pull = moved * pulled * M
        found.append((moved * own / first, -b * pull, steady * decay.highest, 2 * pull, steady * error))
    return tuple(found)


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
        section, messages, followers = self.section, self.messages, rows.followers
        begun, others = [abs(v) for v in self.begun], followers.others
        if messages.leaders is not None:
            need(not any(begun[v] for v in others), "an initial velocity of a leader that moves as it likes")
        bits = length((decay.b, decay.left, decay.initial, decay.floor, decay.highest, section.a1, section.a2))
        spend(100, bits, bits, "bounds of vehicles")
        if decay.b >= section.a1 or decay.b > section.a2:
            return
        (heard, unit), (degrees, _) = rows.largest, followers.degrees
        pulled = list(map(mul, degrees, rows.u))
        columns = [[begun[v] for v in followers.nodes], rows.u, heard, pulled, degrees]
        over = self.scale, rows.scale, rows.scale * unit, rows.scale * unit, unit
        for one, row in zip(self.stated, coefficients(messages, decay, section.a1, section.a2), strict=True):
            factors = [x / common for x, common in zip(row, over, strict=True)]
            one.meet(followers.nodes, *zip(factors, columns, strict=True))
            one.meet(others, (factors[0], [begun[v] for v in others]))

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
