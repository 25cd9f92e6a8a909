"""Bounds that a file states by agent, which proofs of several kinds may meet: some agents by one, some by another.

They are bounds of what is left at the deadline, and under a capped gain of the input, by rows or by a Lyapunov
function; and of vehicles that track virtual states, the part on these of section 22 of the format. Every
decay by rows of virtual single integrators ``z_k``, ``|z_k - x*_k| <= u_k (initial y + floor + C)``, carries over to
the vehicles, which follow ``z_k`` as it is seen through filters of the first order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul
from typing import NamedTuple, TypeAlias

from lmi.exact.decimal_rounding import down, up
from lmi.exact.numbers import integers, longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.follower_rows import Followers, Rows
from ptcc_certify.checker.input_formulas import decay_above, gain_above
from ptcc_certify.checker.message_ages import Messages
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import Agents, Positive
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stepwise_inputs import AgentSteps, VehicleSteps, Walk

#: A factor, and a column by node that it multiplies.
Term: TypeAlias = tuple[Fraction, Sequence[int]]


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

    def meet(self, nodes: Sequence[int], *terms: Term) -> None:
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
    """Vehicles that track virtual states: gains, initial velocities, and bounds by agent.

    Double integrators, or else of these ``orders``, 1 to 3; where any is 3, with ``a3`` and accelerations ``a0``.
    """

    a1: Positive
    a2: Positive
    v0: Agents
    position: Agents
    velocity: Agents | None = None
    input: Agents | None = None
    a3: Positive | None = None
    a0: Agents | None = None
    orders: Agents | None = None
    disturbance: Positive | None = None


class Passed(NamedTuple):
    """By what a bound of vehicles grows with what falls and what stands of virtual states, |v_k(0)| and |x_k''(0)|.

    And with ``|d_k|``, by what disturbs a vehicle of order 2 or 3: ``x_k^(n) = u_k + d_k``.
    """

    falling: Fraction
    standing: Fraction
    begun: Fraction = Fraction(0)
    pushed: Fraction = Fraction(0)
    disturbed: Fraction = Fraction(0)


@dataclass(frozen=True)
class Tracking:
    """How vehicles of one order follow virtual states, ``|z_k - x*_k| <= Y_k``, that decay like ``e^(-b s)``.

    A vehicle of order n is the virtual one as it is seen through n - 1 filters of the first order: ``q_1 = x``, ``q_n =
    z + y_n/(a_1 .. a_(n-1))``, ``y_i = r_i/g^(i-1)``, ``r_1 = x - z``, and ``r_(i+1)`` the derivative of ``r_i`` as if
    ``z`` and ``g`` were constant, plus ``a_i g r_i``. Per unit of the clock, with ``0 <= theta = g'/g^2 <= 1/k``,

        n = 2:   q_1' = a_1 (q_2 - q_1),                                        y_2' = -(a_2 + theta) y_2
        n = 3:   q_1' = a_1 (q_2 - q_1),   q_2' = a_2 (q_3 - q_2) - theta (q_2 - q_1),   y_3' = -(a_3 + 2 theta) y_3.

    Parameters
    ----------
    order : int
        1, 2 or 3.
    gains : Fractions
        ``a_1``, ``a_2`` and, of order 3, ``a_3``.
    b : Fraction
        The rate of ``Y``.
    k : Fraction
        ``rho2 kappa``.
    first : Fraction
        ``g(0)``, the least gain.

    Examples
    --------
    >>> two = Fraction(2)
    >>> for n in (1, 2, 3):
    ...     print(*map(float, Tracking(n, (two, two, two), Fraction(1, 2), two, two).ahead))
    1.0 1.0 0.0 0.0 0.0
    1.0 1.0 0.25 0.0 0.0
    1.5 1.0 1.0 0.09375 0.0
    """

    order: int
    gains: tuple[Fraction, ...]
    b: Fraction
    k: Fraction
    first: Fraction

    @property
    def follows(self) -> bool:
        """Whether the gains are large enough for the rate."""
        a, b = self.gains, self.b
        return self.order == 1 or (b < a[0] and b <= a[1] and (self.order == 2 or (self.slack > 0 and b <= a[2])))

    @property
    def lag(self) -> Fraction:
        """``1/(a_1 - b)``."""
        return 1 / (self.gains[0] - self.b)

    @property
    def slack(self) -> Fraction:
        """``a_2 - b - max theta b/(a_1 - b)``: what the second filter draws more than it must."""
        return self.gains[1] - self.b - self.b * self.lag / self.k

    @property
    def ahead(self) -> Passed:
        """What bounds ``|q_2 - x*_k|``, of order 1 ``|x_k - x*_k|``, by ``Y_k``."""
        a1, begun, one = self.gains[0], 1 / (self.gains[0] * self.first), Fraction(1)
        if self.order < 3:
            return Passed(one, one, begun if self.order == 2 else Fraction(0))
        drawn = 1 / (a1 * self.slack * self.first)
        return Passed(self.gains[1] / self.slack, one, (a1 + self.gains[1]) * drawn + begun, drawn / self.first)

    @property
    def position(self) -> Passed:
        """What bounds ``|x_k - x*_k|`` by ``Y_k``."""
        falling, standing, begun, pushed, _ = self.ahead
        grown = Fraction(1) if self.order == 1 else self.gains[0] * self.lag
        return Passed(grown * falling, standing, grown * begun, grown * pushed)

    @property
    def shaken(self) -> Fraction:
        """By what ``|y_n|``, as long as it decays no faster than ``e^(-b s)``, enters ``|x_k - x*_k|``."""
        return self.lag if self.order == 2 else self.lag / self.slack

    @property
    def steady(self) -> Fraction:
        """What ``|d_k| <= 1`` adds to ``|x_k - x*_k|`` and to ``|q_2 - x*_k|`` at all times."""
        a1, a2 = self.gains[:2]
        return self.unrest / (a1 if self.order == 2 else a1 * a2)

    @property
    def unrest(self) -> Fraction:
        """What bounds ``|y_n|`` at all times by ``|d_k|``: ``y_n' = -(a_n + (n - 1) theta) g y_n + d_k/g^(n-1)``."""
        return 1 / (self.gains[self.order - 1] * self.first**self.order)

    def offsets(self) -> tuple[Passed, ...]:
        """Return what bounds ``|y_1|`` to ``|y_n|`` by ``|e_k| <= p_k y + n_k``; what disturbs stands."""
        zero, first, k = Fraction(0), self.first, self.k
        if self.order == 1:
            return ()
        a1, a2 = self.gains[:2]
        if self.order == 2:
            last = [Passed(zero, zero, 1 / first, zero, self.unrest)]
            second = last[0]
        else:
            third = Passed(zero, zero, (a1 + a2) / first, 1 / first**2, self.unrest)
            second = Passed(
                (a1 + a1 * self.lag / k) / self.slack,
                (a1 + 1 / k) / a2,
                third.begun / self.slack + 1 / first,
                third.pushed / self.slack,
                third.disturbed / a2,
            )
            last = [second, third]
        p, n, v, x, d = second
        return Passed(self.lag * (p + 1), (n + 1) / a1, self.lag * v, self.lag * x, d / a1), *last

    def velocity_and_input(self) -> tuple[Passed, Passed]:
        """Return what bounds ``|x_k'|/g`` and ``|u_k|/g^n`` by ``|e_k| <= p_k y + n_k``.

        n = 2:   x'/g = y_2 - a_1 y_1,   u/g^2 = (a_1^2 - a_1 theta) y_1 - (a_1 + a_2) y_2 + a_1 e
        n = 3:   u/g^3 = (theta a_1 (a_1 - a_2) - a_1^3) y_1 + (a_1^2 + a_1 a_2 + a_2^2 - theta (a_1 + a_2)) y_2
                         - (a_1 + a_2 + a_3) y_3 + a_1 a_2 e
        """
        e, one = Passed(Fraction(1), Fraction(1)), Fraction(1)
        if self.order == 1:
            return e, e
        (a1, a2), theta, y = self.gains[:2], 1 / self.k, self.offsets()
        velocity = _sum((a1, y[0]), (one, y[1]))
        if self.order == 2:
            return velocity, _sum((max(a1**2, a1 * theta - a1**2), y[0]), (a1 + a2, y[1]), (a1, e))
        own, turn = a1**3, a1 * (a1 - a2) * theta
        other, slowed = a1**2 + a1 * a2 + a2**2, (a1 + a2) * theta
        weights = max(own, abs(turn - own)), max(other, slowed - other), a1 + a2 + self.gains[2], a1 * a2
        return velocity, _sum(*zip(weights, (*y, e), strict=True))


def _sum(*terms: tuple[Fraction, Passed]) -> Passed:
    """Return a sum of bounds, each times its weight."""
    return Passed(*(sum((w * part[i] for w, part in terms), Fraction(0)) for i in range(5)))


def passed_on(messages: Messages, left: Fraction, cap: Fraction | None, tracking: Tracking) -> tuple[Passed, ...]:
    """Return what vehicles of one order make of a decay of virtual states, ``y = e^(-b s_c)``.

    First of positions at ``T``: ``|z_k - x*_k|`` at ``T``, without and with what stands of it; then, under a cap, of
    velocities and inputs up to ``T``: ``p_k`` and ``n_k``, where ``|e_k| <= p_k y + n_k``.

    Examples
    --------
    >>> from ptcc_certify.checker.input_formulas import PrescribedGain
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> messages = Messages(gain, Numbers([Fraction(0)]), Fraction(0), False, Fraction(0), Fraction(2))
    >>> one, left = Fraction(1), Fraction(1, 4)
    >>> tracking = Tracking(2, (2 * one, 2 * one), one, gain.k, messages.least_gain())
    >>> for passed in passed_on(messages, left, 2 * one, tracking):
    ...     print(*map(float, passed[:3]))
    2.0 1.0 0.125
    4.0 2.0 3.0
    24.0 16.0 16.0
    """
    falling, standing, begun, pushed, _ = tracking.position
    shaken = Fraction(0) if tracking.order == 1 else tracking.shaken * unrest_at_deadline(messages, tracking)
    position, G = Passed(falling, standing, begun * left, pushed * left, shaken), messages.gain_cap
    if G is None:
        return (position,)
    found = [position]
    for power, one in zip((1, tracking.order), tracking.velocity_and_input(), strict=True):
        y = gain_above(messages.gain, G, tracking.b / power, cap) ** power
        stands = G**power
        found.append(
            Passed(one.falling * y, one.standing * stands, one.begun * y, one.pushed * y, one.disturbed * stands)
        )
    if tracking.order == 1:  # whose velocity is what disturbs it, too
        found[1] = found[1]._replace(disturbed=Fraction(1))
    return tuple(found)


def unrest_at_deadline(messages: Messages, tracking: Tracking) -> Fraction:
    """Bound ``int_0^T e^(-b (s(T) - s(t))) g(t)^(1 - n) dt``, what ``|d_k| <= 1`` makes of ``|y_n|`` at ``T``.

    It is 0 where the clock goes on for ever. Under a cap G, that acts from ``t_1`` on, it is at most ``1/(b G^n)`` of
    what comes then, and of what comes before ``t_1 e^(-b G (T - t_1)) g(0)^(1 - n)``.
    """
    gain, G, n = messages.gain, messages.gain_cap, tracking.order
    if G is None:
        return Fraction(0)
    since = Fraction(0) if messages.least_gain() == G else gain.T - gain.k / (G - gain.rho1)
    before = decay_above(tracking.b * G * (gain.T - since)) * since / tracking.first ** (n - 1)
    return 1 / (tracking.b * G**n) + before


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
        capped = messages.gain_cap is not None
        stated = [section.velocity is not None, section.input is not None]
        need(stated == [capped, capped], "velocity and input are stated iff the gain has a cap")
        lists = {"position": section.position, "velocity": section.velocity, "input": section.input}
        self.stated = [Stated(name, self.labels, values) for name, values in lists.items() if values is not None]
        need(all(min(one.values) >= 0 for one in self.stated), "a bound is negative")
        everyone = range(len(self.labels))
        self.orders = [2] * len(self.labels) if section.orders is None else _orders(section.orders.over(everyone))
        third = 3 in self.orders
        need([section.a3 is not None, section.a0 is not None] == [third, third], "a3 and a0 are there iff order 3 is")
        self.begun, self.scale = section.v0.over(everyone)
        self.pushed, self.unit = ([0] * len(self.labels), 1) if section.a0 is None else section.a0.over(everyone)
        need(not any(v for v, n in zip(self.begun, self.orders, strict=True) if n == 1), "v0 of an agent of order 1")
        need(not any(x for x, n in zip(self.pushed, self.orders, strict=True) if n < 3), "a0 of an order below 3")
        self.gains = section.a1, section.a2, *([] if section.a3 is None else [section.a3])
        self.steps: VehicleSteps | None = None
        self.disturbance = section.disturbance or Fraction(0)
        pushed = self.disturbance if 1 in self.orders else 0  # virtual positions of agents of order 1 are their own
        driven = Fraction(0) if messages.leaders is None else messages.leaders.disturbance
        need(driven == pushed, "leaders.disturbance is that of agents of order 1")

    def by_rows(self, rows: Rows, decay: Decay) -> None:
        """Mark what is at least as large as this decay makes it, unless it is too fast for the gains."""
        followers, b, M = rows.followers, decay.b, decay.initial
        others = followers.others
        if self.messages.leaders is not None and self.messages.leaders.speed:
            moved = any(self.begun[v] or self.pushed[v] for v in others)
            need(not moved, "an initial velocity of a leader that moves as it likes")
        bits = length((M, decay.floor, decay.highest))
        spend(100, bits, bits, "bounds of vehicles")
        (heard, unit), (degrees, _) = rows.largest, followers.degrees
        common, pulled = rows.scale * unit, list(map(mul, degrees, rows.u))

        def position(passed: Passed) -> tuple[Term, ...]:
            first = passed.falling * (M * decay.left + decay.drift) + passed.standing * decay.floor
            return ((first / rows.scale, rows.u),)

        def moving(passed: Passed) -> tuple[Term, ...]:
            return (
                (2 * passed.falling * M / common, pulled),
                (-b * passed.falling * M / rows.scale, rows.u),
                (passed.standing * decay.highest / common, heard),
                (passed.standing * self.messages.wrong / unit, degrees),
            )

        self._meet(followers.nodes, b, decay.left, decay.cap, position, moving)
        self._meet(others, b, decay.left, decay.cap, lambda _: (), lambda _: ())

    def of_all(self, decay: DecayOfAll) -> None:
        """Mark what is at least as large as a decay of all agents makes it, unless it is too fast for the gains."""
        columns = [x * decay.left for x in decay.away], decay.floor, decay.falling, decay.standing
        (away, floor, falling, standing), scale = integers(columns)

        def position(passed: Passed) -> tuple[Term, ...]:
            return (passed.falling / scale, away), (passed.standing / scale, floor)

        def moving(passed: Passed) -> tuple[Term, ...]:
            return (passed.falling / scale, falling), (passed.standing / scale, standing)

        self._meet(decay.nodes, decay.b, decay.left, decay.cap, position, moving)

    def _meet(
        self,
        nodes: Sequence[int],
        b: Fraction,
        left: Fraction,
        cap: Fraction | None,
        position: Callable[[Passed], tuple[Term, ...]],
        moving: Callable[[Passed], tuple[Term, ...]],
    ) -> None:
        """Mark what vehicles make of a decay of virtual states by node, order by order; nothing if it is too fast."""
        bits = length((b, left, *self.gains))
        for order in sorted(set(self.orders)):
            chosen = [i for i, v in enumerate(nodes) if self.orders[v] == order]
            tracking = Tracking(order, self.gains, b, self.messages.gain.k, self.messages.least_gain())
            spend(200, bits, bits, "bounds of vehicles")
            if not chosen or not tracking.follows:
                continue
            of = [nodes[i] for i in chosen]
            begun, pushed = ([abs(column[v]) for v in of] for column in (self.begun, self.pushed))
            passed_all = passed_on(self.messages, left, cap, tracking)
            for one, passed, terms in zip(self.stated, passed_all, (position, moving, moving), strict=False):
                own = [(factor, [column[i] for i in chosen]) for factor, column in terms(passed)]
                shaken = passed.disturbed * self.disturbance, [1] * len(of)
                one.meet(of, (passed.begun / self.scale, begun), (passed.pushed / self.unit, pushed), shaken, *own)

    def along(self, walk: Walk) -> VehicleSteps | None:
        """Return what follows vehicles from instant to instant; None without a cap, of other orders, or disturbed."""
        if self.messages.gain_cap is not None and set(self.orders) == {2} and not self.disturbance:
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
        doc.open("late-vehicles" if self.section.orders is None else "late-team", "messages.vehicles")
        for one in self.stated:
            one.close()
        doc.done(f"a_1 = {down(self.section.a1)}, at most {up(self.stated[0].largest)}")


def _orders(column: tuple[Sequence[int], int]) -> list[int]:
    """Return orders of agents, whole numbers from 1 to 3."""
    values, scale = column
    need(scale == 1 and min(values) >= 1 and max(values) <= 3, "an order that is none of 1, 2 and 3")
    return list(values)
