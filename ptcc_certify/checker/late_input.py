"""Verifies bounds of the input under late messages and a capped gain: by rows, or by a Lyapunov function."""

from __future__ import annotations

from collections.abc import Container, Sequence
from fractions import Fraction

from lmi.exact.decimal_rounding import up
from lmi.exact.numbers import longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.input_formulas import PrescribedGain, decay_above
from ptcc_certify.checker.late_messages import Messages
from ptcc_certify.checker.late_steps import clock_below
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.rows import Rows
from ptcc_certify.checker.side_files import Numbers


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
    """What is stated of ``|u_k|`` up to the deadline by agent, and which of it was met by a bound.

    Parameters
    ----------
    doc : Document
    messages : Messages
    values : Numbers
        By agent.

    Raises
    ------
    RejectedError
        The gain has no cap.
    """

    def __init__(self, doc: Document, messages: Messages, values: Numbers):
        doc.at = "messages.input"
        if messages.gain_cap is None:
            raise RejectedError("input without a cap of the gain")
        self.labels, self.messages, self.gain_cap = doc.context.labels, messages, messages.gain_cap
        self.values, self.scale = values.over(range(len(self.labels)))
        need(min(self.values) >= 0, "an input is negative")
        self.met = bytearray(len(self.labels))

    def by_rows(self, rows: Rows, b: Fraction, cap: Fraction | None, initial: Fraction, floor: Fraction) -> None:
        """Mark what is at least ``(2 D_k - b) u_k initial y + gain_cap (floor (D_k u_k + heard_k) + error D_k)``.

        Since ``heard_k <= (D_k - b) u_k``, of any weights. Where these are uncertain, the largest are taken.
        """
        followers = rows.followers
        (most, unit), (degrees, _) = rows.largest, followers.degrees
        y = initial * gain_above(self.messages.gain, self.gain_cap, b, cap)
        each, error = self.gain_cap * floor, self.gain_cap * self.messages.wrong
        factors = [x * self.scale / (rows.scale * unit) for x in (2 * y, y * b * unit, each, error * rows.scale)]
        bits = longest(n for x in factors for n in x.as_integer_ratio())
        long = longest(rows.u) + longest(most)
        spend(8 * len(rows.u), 4 * bits, long + longest(self.values), "inputs of followers")
        common = 1
        for x in factors:
            common *= x.denominator
        twice, less, steady, wrong = (int(x * common) for x in factors)
        for v, u, D, total in zip(followers.nodes, rows.u, degrees, most, strict=True):
            if common * self.values[v] >= D * u * twice - u * less + total * steady + D * wrong:
                self.met[v] = 1
        for v in followers.others:  # leaders that rest
            self.met[v] = 1

    def by_settling(self, graph: Digraph, followers: Container[int], u: Numbers, b: Fraction, cap: Fraction) -> None:
        """Mark what is at least ``(2 D_k - b) u_k y`` of followers, ``(D_l u_l + heard_l) y`` of leaders."""
        y = gain_above(self.messages.gain, self.gain_cap, b, cap)
        values, scale = u.over(range(graph.n))
        heard, bits = graph.sums_in(values), longest(n for x in (y, b) for n in x.as_integer_ratio())
        spend(8 * graph.n, 4 * bits, longest(values) + graph.bits + longest(self.values), "inputs of agents")
        for v, (x, D, h) in enumerate(zip(values, graph.diagonal, heard, strict=True)):
            most = (2 * D - b * graph.unit) * x if v in followers else Fraction(D * x + h)
            if Fraction(self.values[v], self.scale) >= most * y / (scale * graph.unit):
                self.met[v] = 1

    def by_form(self, phi: Sequence[Fraction], b: Fraction, root: Fraction) -> None:
        """Mark what is at least ``phi_k sqrt(V(0)) y``."""
        y = root * gain_above(self.messages.gain, self.gain_cap, b)
        bits = longest(n for x in (y, *phi) for n in x.as_integer_ratio())
        spend(4 * len(self.values), bits, bits + longest(self.values), "inputs of agents")
        for v, x in enumerate(phi):
            if Fraction(self.values[v], self.scale) >= x * y:
                self.met[v] = 1

    def close(self, doc: Document) -> None:
        """Verify that a bound meets what is stated of every agent."""
        doc.at = "messages.input"
        doc.open("late-input", "messages.input")
        low = self.met.find(0)
        need(low < 0, f"the input of agent {shorten(self.labels[max(low, 0)])} is not proved")
        doc.done(f"at most {up(Fraction(max(self.values), self.scale))}")
