"""Bounds that a file states by agent, which proofs of several kinds may meet: some agents by one, some by another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul

from lmi.exact.numbers import longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.side_files import Numbers


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
