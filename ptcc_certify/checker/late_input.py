"""Verifies bounds of the input under late messages and a capped gain: by rows, or by a Lyapunov function."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from operator import mul

from lmi.exact.decimal_rounding import up
from lmi.exact.numbers import integers
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input_formulas import PrescribedGain, decay_above
from ptcc_certify.checker.late_steps import clock_below
from ptcc_certify.checker.messages_asked import Messages
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.rows import Rows
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import Decay, Stated
from ptcc_certify.checker.structure import Structure


def gain_above(gain: PrescribedGain, gain_cap: Fraction, b: Fraction, cap: Fraction | None = None) -> Fraction:
    """Bound ``sup_t g e^(-b s_c)``, ``g = min(gain, gain_cap)``, ``s_c`` the integral of ``min(g, cap)`` from 0 to t.

    While ``gain`` grows past neither cap, or past ``cap`` alone, the product falls, grows, or first falls and then
    grows; under ``gain_cap`` it falls: the supremum is where ``t = 0``, or where the gain comes to a cap.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(2))
    >>> gain_above(gain, Fraction(9), Fraction(1)), gain_above(gain, Fraction(2), Fraction(1))
    (Fraction(3, 1), Fraction(2, 1))
    >>> 9 * 0.6 < gain_above(gain, Fraction(9), Fraction(1, 8)) < 9 * 0.7
    True
    """
    first, lower = gain.value(Fraction(1)), gain_cap if cap is None else min(cap, gain_cap)
    found = [min(first, gain_cap)]
    for level in (lower, gain_cap):
        if level > first:
            t = gain.T - gain.k / (level - gain.rho1)
            found.append(level * decay_above(b * (clock_below(gain, lower, Fraction(0), t) or Fraction(0))))
    return max(found)


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
