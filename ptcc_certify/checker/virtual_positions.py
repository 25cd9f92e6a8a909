"""Verifies what holds of double integrators that track virtual states: the part on vehicles of section 22.

Every decay by rows of the virtual single integrators ``z_k``, ``|z_k - x*_k| <= u_k (initial y + floor + C)``, carries
over to the vehicles, which follow ``z_k`` as it is seen through two filters of the first order.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from operator import mul

from lmi.exact.decimal_rounding import down, up
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.late_input import gain_above
from ptcc_certify.checker.messages_asked import Messages
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.rows import Rows
from ptcc_certify.checker.section_declarations import Agents, Positive
from ptcc_certify.checker.stated_bounds import Decay, Stated

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
        lists = {"position": section.position, "velocity": section.velocity, "input": section.input}
        self.stated = [Stated(name, self.labels, values) for name, values in lists.items() if values is not None]
        need(all(min(one.values) >= 0 for one in self.stated), "a bound is negative")
        self.begun, self.scale = section.v0.over(range(len(self.labels)))

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

    def close(self, doc: Document) -> None:
        """Verify that a decay meets what is stated of every agent."""
        doc.at = "messages.vehicles"
        doc.open("late-vehicles", "messages.vehicles")
        for one in self.stated:
            one.close()
        doc.done(f"a_1 = {down(self.section.a1)}, at most {up(self.stated[0].largest)}")
