"""Verifies what holds of double integrators that track virtual states: the part on vehicles of section 22.

Every decay by rows of the virtual single integrators ``z_k``, ``|z_k - x*_k| <= u_k (initial y + floor + C)``, carries
over to the vehicles, which follow ``z_k`` as it is seen through two filters of the first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down, up
from lmi.exact.numbers import longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.late_input import gain_above
from ptcc_certify.checker.late_messages import Messages
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.rows import Rows
from ptcc_certify.checker.sections import Agents, Positive

#: Coefficients of ``|v_k(0)|``, of ``u_k``, of ``D_k u_k + sum_l |w_kl| u_l``, of ``D_k u_k`` and of ``D_k``.
Coefficients = tuple[Fraction, Fraction, Fraction, Fraction, Fraction]


@dataclass(frozen=True, kw_only=True)
class VehiclesSection:
    """Double integrators that track virtual states: gains, initial velocities, and bounds by agent."""

    a1: Positive
    a2: Positive
    v0: Agents
    position: Agents
    velocity: Agents | None
    input: Agents | None


@dataclass(frozen=True)
class Decay:
    """One decay by rows of the virtual states.

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


def coefficients(messages: Messages, decay: Decay, a1: Fraction, a2: Fraction) -> tuple[Coefficients, ...]:
    """Return by what positions at ``T`` are bounded, and under a cap velocities and inputs up to ``T``.

    Examples
    --------
    >>> from ptcc_certify.checker.input_formulas import PrescribedGain
    >>> from ptcc_certify.checker.side_files import Numbers
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
        need("formation" not in doc.data, "vehicles in a formation")
        need(messages.leaders is None or messages.leaders.disturbance == 0, "vehicles that are disturbed")
        capped = messages.gain_cap is not None
        stated = [section.velocity is not None, section.input is not None]
        need(stated == [capped, capped], "velocity and input are stated iff the gain has a cap")
        lists = (section.position, section.velocity, section.input)
        everyone = range(len(self.labels))
        self.stated = [values.over(everyone) for values in lists if values is not None]
        need(all(min(values) >= 0 for values, _ in self.stated), "a bound is negative")
        self.begun, self.scale = section.v0.over(everyone)
        self.met = [bytearray(len(self.labels)) for _ in self.stated]

    def by_rows(self, rows: Rows, decay: Decay) -> None:
        """Mark what is at least as large as this decay makes it, unless it is too fast for the gains."""
        section, messages, followers = self.section, self.messages, rows.followers
        others = followers.others
        if messages.leaders is not None:
            need(not any(self.begun[v] for v in others), "an initial velocity of a leader that moves as it likes")
        bits = length((decay.b, decay.left, decay.initial, decay.floor, decay.highest, section.a1, section.a2))
        spend(100, bits, bits, "bounds of vehicles")
        if decay.b >= section.a1 or decay.b > section.a2:
            return
        (heard, unit), (degrees, _) = rows.largest, followers.degrees
        over = self.scale, rows.scale, rows.scale * unit, rows.scale * unit, unit
        nothing = [0] * len(others)
        columns = [
            [abs(self.begun[v]) for v in (*followers.nodes, *others)],
            [*rows.u, *nothing],
            [*heard, *nothing],
            [*(D * u for D, u in zip(degrees, rows.u, strict=True)), *nothing],
            [*degrees, *nothing],
        ]
        nodes = [*followers.nodes, *others]
        each = coefficients(messages, decay, section.a1, section.a2)
        for met, (values, scale), row in zip(self.met, self.stated, each, strict=True):
            _mark(met, nodes, values, [x * scale / own for x, own in zip(row, over, strict=True)], columns)

    def close(self, doc: Document) -> None:
        """Verify that a decay meets what is stated of every agent."""
        doc.at = "messages.vehicles"
        doc.open("late-vehicles", "messages.vehicles")
        for name, met in zip(("position", "velocity", "input"), self.met, strict=False):
            low = met.find(0)
            need(low < 0, f"the {name} of agent {shorten(self.labels[max(low, 0)])} is not proved")
        values, scale = self.stated[0]
        doc.done(f"a_1 = {down(self.section.a1)}, at most {up(Fraction(max(values), scale))}")


def _mark(
    met: bytearray, nodes: Sequence[int], values: Sequence[int], row: Sequence[Fraction], columns: Sequence[list[int]]
) -> None:
    """Mark the nodes whose value is at least the sum of the columns, each times its factor."""
    common = math.lcm(*(x.denominator for x in row))
    factors = [x.numerator * (common // x.denominator) for x in row]
    spend(6 * len(nodes), longest((common, *factors)), longest(values) + max(map(longest, columns)), "vehicles")
    for v, *own in zip(nodes, *columns, strict=True):
        if common * values[v] >= sum(x * c for x, c in zip(own, factors, strict=True)):
            met[v] = 1
