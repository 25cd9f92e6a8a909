"""Rows of followers that single leaders lead, in integers: ``D u - q |W_F| u >= b u``, and how far they start.

Where ages differ from edge to edge an edge has a power of ``q``, as what is heard over it is younger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from lmi.exact.elementary_enclosures import exp, log, rounded
from lmi.exact.numbers import longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.input_formulas import BITS
from ptcc_certify.checker.late_messages import PARTS
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.structure import Structure


@dataclass(frozen=True, eq=False)
class Followers:
    """The followers of a graph whose leaders are single nodes.

    Attributes
    ----------
    structure : Structure
    away : Numbers
        By follower, what ``|x_k(0) - x*_k|`` is at most.
    """

    structure: Structure
    away: Numbers

    @property
    def nodes(self) -> Sequence[int]:
        """The followers, in the order of the graph."""
        return self.structure.followers

    @cached_property
    def degrees(self) -> list[int]:
        """``D_k`` by follower, times the unit of the graph."""
        diagonal = self.structure.graph.diagonal
        return [diagonal[v] for v in self.nodes]

    def vector(self, doc: Document, entry: Any, what: str) -> Numbers:
        """Read a vector of followers: an array of numbers, or side numbers."""
        return doc.files.numbers(entry, what, len(self.nodes))

    def heard(
        self, values: Sequence[int], parts: Sequence[int] = (), factors: Mapping[int, int] | None = None
    ) -> list[int]:
        """Return ``|W_F| u`` by follower, times the unit of the graph; edges by factors of their parts, if given."""
        graph, whole = self.structure.graph, [0] * self.structure.graph.n
        for v, x in zip(self.nodes, values, strict=True):
            whole[v] = x
        sums = graph.sums_in(whole) if factors is None else graph.sums_by_part(whole, parts, factors)
        return [sums[v] for v in self.nodes]

    def label(self, k: int) -> str:
        """Return the label of follower ``k``, for a message."""
        return shorten(self.structure.graph.labels[self.nodes[k]])

    def starts_within(self, values: Sequence[int], scale: int, initial: Fraction = Fraction(1)) -> None:
        """Verify ``initial u_k >= |x_k(0) - x*_k|``, ``u`` in integers over a scale."""
        away, common = self.away.over(range(len(values)))
        p, q = initial.numerator * common, initial.denominator * scale
        spend(2 * len(values), longest((p, q)), longest(values) + longest(away), "rows of followers")
        low = next((k for k, (u, x) in enumerate(zip(values, away, strict=True)) if p * u < q * x), None)
        need(low is None, f"agent {self.label(low or 0)} starts farther from its final state")

    def never_grows(self, values: Sequence[int], value_error: Fraction, push: Fraction = Fraction(0)) -> None:
        """Verify ``D_k y_k >= sum_l |w_kl| y_l + value_error D_k + push``; all over one scale."""
        graph, q = self.structure.graph, math.lcm(value_error.denominator, push.denominator)
        p, more = int(value_error * q), int(push * q) * graph.unit
        spend(3 * len(values), graph.bits + longest((p, q, more)), longest(values), "rows of followers")
        rows = zip(values, self.degrees, self.heard(values), strict=True)
        low = next((k for k, (y, D, h) in enumerate(rows) if q * (D * y - h) < p * D + more), None)
        need(low is None, f"the start of agent {self.label(low or 0)} may grow")


class Rows:
    """``u > 0`` with ``D_k u_k - q sum_l |w_kl| u_l >= b u_k`` for every follower, sums over followers.

    Parameters
    ----------
    followers : Followers
    u : Numbers
        By follower.

    Raises
    ------
    RejectedError
        ``u`` is not positive.
    """

    def __init__(self, followers: Followers, u: Numbers):
        need(u.positive(), "u is not positive")
        self.followers, self.graph = followers, followers.structure.graph
        self.u, self.scale = u.over(range(len(u)))
        self.heard = followers.heard(self.u)

    @property
    def least(self) -> Fraction:
        """The least ``u_k``."""
        return Fraction(min(self.u), self.scale)

    def _spent(self, *values: Fraction) -> None:
        """Count what a comparison for every follower costs, with numbers as long as these."""
        bits = longest(n for x in values for n in x.as_integer_ratio())
        spend(6 * len(self.u), self.graph.bits + bits, longest(self.u) + self.scale.bit_length(), "rows of followers")

    def decay(self, q: Fraction, b: Fraction, parts: Sequence[int] = (PARTS,)) -> None:
        """Verify ``D_k u_k - sum_l q^(part_kl/64) |w_kl| u_l >= b u_k``, with parts by edge, or one for all."""
        need(b > 0, "b is not positive")
        self._spent(q, b)
        heard, common = self._heard_later(q, parts)
        own, other = common * b.denominator, b.denominator
        third = b.numerator * common * self.graph.unit
        rows = zip(self.u, self.followers.degrees, heard, strict=True)
        low = next((k for k, (u, D, h) in enumerate(rows) if (own * D - third) * u < other * h), None)
        need(low is None, f"the row of agent {self.followers.label(low or 0)} does not decay so fast")

    def _heard_later(self, q: Fraction, parts: Sequence[int]) -> tuple[Sequence[int], int]:
        """Bound ``sum_l q^(part_kl/64) |w_kl| u_l`` from above, over a common denominator and the unit of the graph."""
        if len(parts) == 1:
            return [q.numerator * x for x in self.heard], q.denominator
        factors, common = powers(q, parts)
        return self.followers.heard(self.u, parts, factors), common

    def above_initial(self, initial: Fraction) -> None:
        """Verify ``initial u_k >= |x_k(0) - x*_k|``."""
        need(initial >= 0, "initial is negative")
        self.followers.starts_within(self.u, self.scale, initial)

    def above_floor(self, floor: Fraction, value_error: Fraction) -> None:
        """Verify ``floor (D_k u_k - sum_l |w_kl| u_l) >= value_error D_k``."""
        need(floor >= 0, "floor is negative")
        self._spent(floor, value_error)
        p, q = floor.numerator * value_error.denominator, floor.denominator * value_error.numerator * self.scale
        rows = zip(self.u, self.followers.degrees, self.heard, strict=True)
        low = next((k for k, (u, D, h) in enumerate(rows) if p * (D * u - h) < q * D), None)
        need(low is None, f"what is heard wrong drives agent {self.followers.label(low or 0)} farther")

    def above_push(self, floor: Fraction, push: Fraction) -> None:
        """Verify ``floor (D_k u_k - sum_l |w_kl| u_l) >= push``."""
        need(floor >= 0, "what pushes followers is negative")
        self._spent(floor, push)
        p, q = floor.numerator * push.denominator, floor.denominator * push.numerator * self.scale * self.graph.unit
        rows = zip(self.u, self.followers.degrees, self.heard, strict=True)
        low = next((k for k, (u, D, h) in enumerate(rows) if p * (D * u - h) < q), None)
        need(low is None, f"agent {self.followers.label(low or 0)} is pushed farther")

    def inputs(self) -> list[int]:
        """Return ``D_k u_k + sum_l |w_kl| u_l`` by follower, times the scale of ``u`` and the unit of the graph."""
        return [D * u + h for u, D, h in zip(self.u, self.followers.degrees, self.heard, strict=True)]


def powers(q: Fraction, parts: Sequence[int]) -> tuple[dict[int, int], int]:
    """Bound ``q^(part/64)`` from above for every part, over a common denominator."""
    log_q = log(q)[1]
    power = {part: rounded(exp(log_q * Fraction(part, PARTS))[1], BITS, up=True) for part in set(parts)}
    power |= {0: Fraction(1), PARTS: q}
    common = math.lcm(*(x.denominator for x in power.values()))
    return {part: x.numerator * (common // x.denominator) for part, x in power.items()}, common


def heard_later(graph: Digraph, values: Sequence[int], q: Fraction, parts: Sequence[int]) -> tuple[list[int], int]:
    """Bound ``sum_l q^(part_kl/64) |w_kl| u_l`` from above for every agent, over a common denominator and the unit."""
    if len(parts) == 1:
        return [q.numerator * x for x in graph.sums_in(values)], q.denominator
    factors, common = powers(q, parts)
    return graph.sums_by_part(values, parts, factors), common


def followers_of(doc: Document, structure: Structure, begin: Begin) -> Followers:
    """Return the followers of leaders that are single nodes, with bounds of ``|x_k(0) - x*_k|``; 1 without a state."""
    need(all(len(group) == 1 for group in structure.closed), "leaders in a group of two or more, which do not rest")
    return away_of(doc, structure, begin)


def away_of(doc: Document, structure: Structure, begin: Begin) -> Followers:
    """Return the followers, with bounds of ``|x_k(0) - x*_k|``; 1 without a state."""
    nodes, final = structure.followers, doc.sections["final_state"]
    need(bool(nodes), "no follower")
    if final is None or begin.state is None:
        return Followers(structure, Numbers([1] * len(nodes), 1))
    parts = [numbers.over(nodes) for numbers in (begin.state, *final)]
    scale = math.lcm(*(own for _, own in parts))
    sized(3 * len(nodes), scale.bit_length() + max(longest(values) for values, _ in parts), "the initial state")
    x, mid, radius = ([value * (scale // own) for value in values] for values, own in parts)
    return Followers(structure, Numbers([abs(a - m) + r for a, m, r in zip(x, mid, radius, strict=True)], scale))
