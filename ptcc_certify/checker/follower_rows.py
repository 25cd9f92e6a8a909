"""Rows of followers in integers: what a positive vector proves of all members of a mode, whatever their weights.

Followers ``F`` hear each other and agents that are none. In a row

    sum_l |w_kl| (own_k - heard_l),        heard_l = 0 of agents outside, where nothing else is told,

every weight has a factor that depends on no weight, so that it is least at ``w+`` where the factor is negative, at
``w-`` elsewhere. A graph is a mode whose weights are known. Where ages differ from edge to edge an edge has a power of
``q``, as what is heard over it is younger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from lmi.exact.elementary_enclosures import exp, log, rounded
from lmi.exact.numbers import common_denominator, integers, longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Edge, Family
from ptcc_certify.checker.input_formulas import BITS
from ptcc_certify.checker.message_ages import PARTS
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.structure import Structure

#: Factors of ages: by edge, or by ordered pair of an edge, the part of the largest age, and what each part multiplies;
#: None where all ages are one.
ByAge = tuple[Sequence[int], Mapping[int, int]] | None


@dataclass(frozen=True, eq=False)
class KnownWeights:
    """The edges of a graph."""

    graph: Digraph

    @property
    def unit(self) -> int:
        """What divides the weights."""
        return self.graph.unit

    @property
    def bits(self) -> int:
        """Bits of the longest row."""
        return self.graph.bits

    def least(self, own: Sequence[int], heard: Sequence[int], ages: ByAge = None) -> Sequence[int]:
        """Return the rows of all agents, times the unit."""
        sums = self.graph.sums_in(heard) if ages is None else self.graph.sums_by_part(heard, *ages)
        return [D * y - h for D, y, h in zip(self.graph.diagonal, own, sums, strict=True)]

    def most(self, own: Sequence[int], heard: Sequence[int]) -> Sequence[int]:
        """Return ``sum_l |w_kl| (own_k + heard_l)`` of all agents, times the unit."""
        return [D * y + h for D, y, h in zip(self.graph.diagonal, own, self.graph.sums_in(heard), strict=True)]


@dataclass(frozen=True, eq=False)
class WeightsBetween:
    """Edges whose weights lie between two ends each, times a unit.

    Attributes
    ----------
    edges : sequence of Edge
    unit : int
    family : Family, optional
        Whose pairs have ages.

    Examples
    --------
    >>> rows = WeightsBetween([(0, 1, 1, 2, 3), (1, 2, -1, 1, 5)], 1)
    >>> rows.least([0, 4, 1], [0, 4, 1]), rows.most([0, 4, 1], [0, 4, 1])
    ([0, 8, -15], [0, 12, 25])
    """

    edges: Sequence[Edge]
    unit: int
    family: Family | None = None

    @cached_property
    def bits(self) -> int:
        """Bits of the longest row."""
        return longest(edge[4] for edge in self.edges) + len(self.edges).bit_length()

    def least(self, own: Any, heard: Any, ages: ByAge = None) -> Any:
        """Return the least rows, times the unit; ``own`` and the rows are lists, or dicts by agent."""
        rows = self._none(own, heard)
        if ages is None:
            factors = (own[t] - heard[s] for s, t, *_ in self.edges)
        else:
            assert self.family is not None
            parts, multiples, place = *ages, self.family.pairs
            more, bits = longest(multiples.values()), longest(heard)
            spend(4 * len(self.edges), self.bits + more, bits, "rows of followers")
            sized(2 * len(own), self.bits + more + bits + 64, "rows of followers")
            factors = (own[t] - multiples[parts[place[s, t]]] * heard[s] for s, t, *_ in self.edges)
        for (_, t, _, low, high), factor in zip(self.edges, factors, strict=True):
            rows[t] += (high if factor < 0 else low) * factor
        return rows

    def most(self, own: Any, heard: Any) -> Any:
        """Return the largest ``sum_l |w_kl| (own_k + heard_l)``, of values that are not negative, times the unit."""
        rows = self._none(own, heard)
        for s, t, _, _, high in self.edges:
            rows[t] += high * (own[t] + heard[s])
        return rows

    def _none(self, own: Any, heard: Any) -> Any:
        """Return rows that are 0, and count what they cost."""
        bits = max(_longest(own), _longest(heard))
        spend(4 * (len(self.edges) + len(own)), self.bits, bits, "rows of followers")
        sized(2 * len(own), self.bits + bits + 64, "rows of followers")
        return dict.fromkeys(own, 0) if isinstance(own, Mapping) else [0] * len(own)


@dataclass(frozen=True, eq=False)
class RowSystem:
    """The rows of some agents that hear others, in every mode.

    Attributes
    ----------
    labels : sequence of str
        Of all agents.
    nodes : sequence of int
        Those whose rows they are, ascending.
    modes : sequence of KnownWeights or WeightsBetween
        The edges of every mode, of all agents that are heard.
    """

    labels: Sequence[str]
    nodes: Sequence[int]
    modes: Sequence[KnownWeights | WeightsBetween]

    @cached_property
    def bits(self) -> int:
        """Bits of the longest row."""
        return max(mode.bits for mode in self.modes)

    def label(self, k: int) -> str:
        """Return the label of the agent of row ``k``, for a message."""
        return shorten(self.labels[self.nodes[k]])

    def need_rows(
        self, own: Any, heard: Any, least: Sequence[int], why: str, times: int = 1, ages: ByAge = None
    ) -> None:
        """Verify that ``times`` the rows are at least these numbers, in every mode.

        Parameters
        ----------
        own, heard : sequence of N int, or mapping of int to int
            By agent.
        least : sequence of int
            By row.
        why : str
            What is the matter otherwise; ``{}`` is an agent.
        times : int
        ages : ByAge
        """
        for mode in self.modes:
            rows, unit = mode.least(own, heard, ages), mode.unit
            bits = _longest(heard) + mode.bits, longest((times, unit)) + longest(least)
            spend(3 * len(least), *bits, "rows of followers")
            pairs = enumerate(zip(self.nodes, least, strict=True))
            low = next((k for k, (v, x) in pairs if times * rows[v] < unit * x), None)
            need(low is None, why.format(self.label(low or 0)))

    def most(self, own: Any, heard: Any) -> tuple[list[int], int]:
        """Bound ``sum_l |w_kl| (own_k + heard_l)`` of every row over all members, times a unit; and this.

        Parameters
        ----------
        own, heard : sequence of N int, or mapping of int to int
            By agent; not negative.
        """
        unit = common_denominator({mode.unit for mode in self.modes}, len(self.nodes), "the weights")
        most = [0] * len(self.nodes)
        for mode in self.modes:
            rows, factor = mode.most(own, heard), unit // mode.unit
            bits = mode.bits + max(_longest(own), _longest(heard))
            spend(2 * len(most), bits, factor.bit_length(), "rows of followers")
            sized(2 * len(most), bits + unit.bit_length(), "rows of followers")
            most = [max(x, factor * rows[v]) for x, v in zip(most, self.nodes, strict=True)]
        return most, unit


@dataclass(frozen=True, eq=False)
class Followers(RowSystem):
    """Agents that hear others, in every mode.

    Attributes
    ----------
    away : Numbers
        By follower, what ``|x_k(0) - x*_k|`` is at most.
    """

    away: Numbers

    @cached_property
    def others(self) -> list[int]:
        """The agents that are no followers."""
        inside = set(self.nodes)
        return [v for v in range(len(self.labels)) if v not in inside]

    def whole(self, values: Sequence[int]) -> list[int]:
        """Return values of all agents, 0 of those that are no followers."""
        whole = [0] * len(self.labels)
        for v, x in zip(self.nodes, values, strict=True):
            whole[v] = x
        return whole

    @cached_property
    def degrees(self) -> tuple[list[int], int]:
        """``D_k`` of every follower at most, times the unit of :meth:`most`; and this."""
        return self.most([1] * len(self.labels), [0] * len(self.labels))

    def need_decay(self, u: Sequence[int], q: Fraction, b: Fraction, parts: Sequence[int]) -> None:
        """Verify ``sum_l |w_kl| (u_k - q^(part_kl/64) u_l) >= b u_k``, ``u`` of all agents; parts as ages have them."""
        need(b > 0, "b is not positive")
        ages = None
        factor, common = q.numerator, q.denominator
        if len(parts) > 1:
            factors, common = powers(q, parts)
            ages, factor = (parts, factors), 1
        own, heard = _times(common, u), _times(factor, u)
        least = _times(b.numerator * common, [u[v] for v in self.nodes])
        self.need_rows(own, heard, least, "the row of agent {} does not decay so fast", b.denominator, ages)

    def starts_within(self, values: Sequence[int], scale: int, initial: Fraction = Fraction(1)) -> None:
        """Verify ``initial u_k >= |x_k(0) - x*_k|``, ``u`` in integers over a scale."""
        away, common = self.away.over(range(len(values)))
        p, q = initial.numerator * common, initial.denominator * scale
        spend(2 * len(values), longest((p, q)), longest(values) + longest(away), "rows of followers")
        low = next((k for k, (u, x) in enumerate(zip(values, away, strict=True)) if p * u < q * x), None)
        need(low is None, f"agent {self.label(low or 0)} starts farther from its final state")

    def need_outweighed(
        self, values: Sequence[int], factor: Fraction, error: Fraction, push: Fraction, why: str
    ) -> None:
        """Verify ``sum_l |w_kl| (factor (y_k - y_l) - error) >= push``, ``y_l = 0`` of others; all over one scale."""
        scale = math.lcm(factor.denominator, error.denominator, push.denominator)
        times, lost, least = (int(x * scale) for x in (factor, error, push))
        heard, own = (self.whole(_times(times, values, less)) for less in (0, lost))
        self.need_rows(own, heard, [least] * len(values), why)


class Rows:
    """``u > 0`` of followers that decay: ``sum_l |w_kl| (u_k - q u_l) >= b u_k``, ``u_l = 0`` of others.

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
        self.followers = followers
        self.u, self.scale = u.over(range(len(u)))
        self.whole = followers.whole(self.u)

    @property
    def least(self) -> Fraction:
        """The least ``u_k``."""
        return Fraction(min(self.u), self.scale)

    def decay(self, q: Fraction, b: Fraction, parts: Sequence[int] = (PARTS,)) -> None:
        """Verify ``sum_l |w_kl| (u_k - q^(part_kl/64) u_l) >= b u_k``, with parts by edge, or one for all."""
        self.followers.need_decay(self.whole, q, b, parts)

    def above_initial(self, initial: Fraction) -> None:
        """Verify ``initial u_k >= |x_k(0) - x*_k|``."""
        need(initial >= 0, "initial is negative")
        self.followers.starts_within(self.u, self.scale, initial)

    def above_floor(self, floor: Fraction, value_error: Fraction) -> None:
        """Verify ``sum_l |w_kl| (floor (u_k - u_l) - value_error) >= 0``."""
        need(floor >= 0, "floor is negative")
        why = "what is heard wrong drives agent {} farther"
        self.followers.need_outweighed(self.u, floor, value_error * self.scale, Fraction(0), why)

    def above_push(self, floor: Fraction, push: Fraction) -> None:
        """Verify ``floor sum_l |w_kl| (u_k - u_l) >= push``."""
        need(floor >= 0, "what pushes followers is negative")
        self.followers.need_outweighed(self.u, floor, Fraction(0), push * self.scale, "agent {} is pushed farther")

    @cached_property
    def largest(self) -> tuple[list[int], int]:
        """``sum_l |w_kl| (u_k + u_l)`` of every follower at most, times the scale of ``u`` and a unit; and this."""
        return self.followers.most(self.whole, self.whole)


def _longest(values: Any) -> int:
    """Return the bits of the longest of some integers, of a list or by agent."""
    return longest(values.values() if isinstance(values, Mapping) else values)


def _times(factor: int, values: Sequence[int], less: int = 0) -> list[int]:
    """Return a multiple of values, less a number, unless this is long."""
    bits = longest(values), factor.bit_length()
    sized(len(values), max(sum(bits), less.bit_length()), "rows of followers")
    spend(len(values), *bits, "rows of followers")
    return [factor * x - less for x in values]


def powers(q: Fraction, parts: Sequence[int]) -> tuple[dict[int, int], int]:
    """Bound ``q^(part/64)`` from above for every part, over a common denominator."""
    log_q = log(q)[1]
    power = {part: rounded(exp(log_q * Fraction(part, PARTS))[1], BITS, up=True) for part in set(parts)}
    power |= {0: Fraction(1), PARTS: q}
    common = math.lcm(*(x.denominator for x in power.values()))
    return {part: x.numerator * (common // x.denominator) for part, x in power.items()}, common


def followers_of(doc: Document, of: Structure | Family, begin: Begin) -> Followers:
    """Return the followers of leaders that are single nodes, with bounds of ``|x_k(0) - x*_k|``; 1 without a state."""
    if isinstance(of, Family):
        return _followers_in_family(of, begin)
    need(all(len(group) == 1 for group in of.closed), "leaders in a group of two or more, which do not rest")
    return away_of(doc, of, begin)


def away_of(doc: Document, structure: Structure, begin: Begin) -> Followers:
    """Return the followers, with bounds of ``|x_k(0) - x*_k|``; 1 without a state."""
    nodes, final, graph = structure.followers, doc.sections["final_state"], structure.graph
    need(bool(nodes), "no follower")
    away = Numbers([1] * len(nodes), 1)
    if final is not None and begin.state is not None:
        parts = [numbers.over(nodes) for numbers in (begin.state, *final)]
        scale = math.lcm(*(own for _, own in parts))
        sized(3 * len(nodes), scale.bit_length() + max(longest(values) for values, _ in parts), "the initial state")
        x, mid, radius = ([value * (scale // own) for value in values] for values, own in parts)
        away = Numbers([abs(a - m) + r for a, m, r in zip(x, mid, radius, strict=True)], scale)
    return Followers(graph.labels, nodes, [KnownWeights(graph)], away)


def _followers_in_family(family: Family, begin: Begin) -> Followers:
    """Return the agents that hear others in some mode, if all others are the leaders of a common kernel.

    Then ``x*_k`` is the same combination of the leaders in every member: ``away`` is ``|x_k(0) - x*_k|`` exactly, or 1
    without a state.
    """
    edges = [edge for mode in family.modes for edge in mode.edges]
    spend(2 * len(edges), what="rows of followers")
    hearing = {edge[1] for edge in edges}
    need(bool(hearing), "no follower")
    away: dict[int, Fraction] = {}
    for component in family.components:
        need(not component.depends, "followers whose targets depend on the signal")
        single = hearing.isdisjoint(component.pivots.values())
        need(single, "leaders in a group of two or more, which do not rest")
        nodes = [v for v in component.nodes if v in hearing]
        if begin.state is not None and nodes:
            xi, scale = component.coordinates(nodes, list(begin.state))
            away |= {v: Fraction(abs(x), scale) for v, x in zip(nodes, xi, strict=True)}
    nodes = sorted(hearing)
    (values,), scale = integers([[away.get(v, Fraction(1)) for v in nodes]])
    modes = [WeightsBetween(mode.edges, mode.unit, family) for mode in family.modes]
    return Followers(family.labels, nodes, modes, Numbers(values, scale))
