"""Verifies weighted sums of squares as Lyapunov functions of stable families: one sparse matrix for each mode.

Section 19 of the format. With ``P = diag(p)``, for all weights in their intervals, ``x_l`` heard by ``x_k``,

    P L + L'P  >=  P L(w-) + L(w-)'P - (1/2) diag_l( sum_k p_k (w+_kl - w-_kl) ).

If the right side exceeds ``b P`` in every mode, ``V = sum_k p_k x_k^2`` decays at the rate ``b`` for every signal. By
Cauchy's inequality ``(L x)_k^2 <= (D_k^2 / p_k + sum_l w+_kl^2 / p_l) V``, ``D_k`` the sum of ``w+`` into ``k``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Literal

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import common_denominator, integers, longest, sized
from lmi.exact.work import fits, spend
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.common_kernel_ends import WeightedMean
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.dominance import LARGEST_FORM, FactorSection, read_factor
from ptcc_certify.checker.family import STABILITY, Component, Edge, Family
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.section_declarations import Vector


@dataclass(frozen=True, kw_only=True)
class SquaresSection:
    """What the file says of a weighted sum of squares."""

    class_: Literal["squares"]
    component: int
    vector: Vector
    rate: Fraction


@dataclass(frozen=True, kw_only=True)
class FactorWitness:
    """A sparse factor."""

    factor: FactorSection


#: Bits of ``1/p``, which are rounded up, and products of short integers that a root costs, about.
BITS, EACH_ROOT = 64, 300


@dataclass(frozen=True, eq=False)
class WeightedSquares:
    """``V = sum_k p_k x_k^2``, and what it says of the members of a family.

    Attributes
    ----------
    weights : dict of int to int
        ``p`` of every node,
    scale : int
        over this.
    rate : Fraction
        ``V <= e^(-rate s) V(0)`` for every signal, once :meth:`form` is proved definite in every mode.
    modes : sequence of (list of Edge, int)
        The edges of every mode, and what divides their sizes.
    """

    weights: dict[int, int]
    scale: int
    rate: Fraction
    modes: Sequence[tuple[Sequence[Edge], int]]

    @property
    def means(self) -> tuple[WeightedMean, ...]:
        """None."""
        return ()

    def form(self, mode: int) -> tuple[tuple[list[int], list[int], list[int]], int]:
        """Return rows, columns and values of the lower triangle that is to be definite, and what divides the values."""
        (edges, unit), p = self.modes[mode], self.weights
        r, q = self.rate.as_integer_ratio()
        bits = longest(p.values()) + longest(edge[4] for edge in edges), r.bit_length() + q.bit_length()
        spend(6 * len(edges) + 2 * len(p), *bits, "a form of many agents")
        sized(len(edges) + len(p), sum(bits) + unit.bit_length(), "a form of many agents")
        place = {v: k for k, v in enumerate(p)}
        diagonal = [-2 * r * unit * weight for weight in p.values()]
        rows, columns, values = [*range(len(p))], [*range(len(p))], diagonal
        for s, t, sign, low, high in edges:
            i, j = place[t], place[s]
            weight = q * p[t]
            diagonal[i] += 4 * weight * low
            diagonal[j] -= weight * (high - low)
            if low:
                rows.append(max(i, j))
                columns.append(min(i, j))
                values.append(-2 * sign * weight * low)
        return (rows, columns, values), 2 * q * unit * self.scale

    @cached_property
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)`` for every member."""
        p, most = self.weights, dict.fromkeys(self.weights, 0)
        power = longest(p.values()) + BITS
        units = common_denominator({unit for _, unit in self.modes}, len(p), "the weights")
        count, bits = sum(len(edges) for edges, _ in self.modes), longest(e[4] for m, _ in self.modes for e in m)
        bits += units.bit_length()
        sized(3 * len(p), 2 * bits + power, "bounds of many agents")
        spend(3 * (count + len(p)), bits, bits + power, "bounds of many agents")
        spend(EACH_ROOT * len(p), what="bounds of many agents")
        spend(20 * len(p), bits + power, bits + power, "bounds of many agents")
        inverse = {v: -(-(1 << power) // weight) for v, weight in p.items()}
        for edges, unit in self.modes:
            heard: dict[tuple[int, int], int] = {}  # both signs of a pair
            for s, t, _, _, high in edges:
                heard[s, t] = heard.get((s, t), 0) + high
            sums, squares = dict.fromkeys(p, 0), dict.fromkeys(p, 0)
            for (s, t), size in heard.items():
                sums[t] += size
                squares[t] += size**2 * inverse[s]
            times = (units // unit) ** 2
            for v in p:
                most[v] = max(most[v], times * (sums[v] ** 2 * inverse[v] + squares[v]))
        divisor = units**2 << power
        (values,), scale = integers([[root_above(Fraction(x * self.scale, divisor)) for x in most.values()]])
        return [(dict(zip(p, values, strict=True)), Fraction(1, scale))]

    @property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|x_k| / sqrt(V)``."""
        spend(EACH_ROOT * len(self.weights), what="bounds of many agents")
        inverse = (root_above(Fraction(self.scale, weight)) for weight in self.weights.values())
        (values,), scale = integers([list(inverse)])
        return [(dict(zip(self.weights, values, strict=True)), Fraction(1, scale))]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state."""
        return root_above(self._value(x))

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Return the largest ``V`` of all states with ``|x_k| <= sizes_k``."""
        return self._value(sizes)

    def spread(self, sizes: Mapping[int, Fraction]) -> Fraction | None:
        """Return 1: ``sqrt(V)`` grows no faster than agents that move by themselves part."""
        return Fraction(1)

    def _value(self, x: Sequence[Fraction] | Mapping[int, Fraction]) -> Fraction:
        (whole,), scale = integers([[x[v] for v in self.weights]])
        bits = longest(whole)
        spend(2 * len(whole), bits, bits + longest(self.weights.values()), "a Lyapunov function")
        total = sum(weight * y**2 for weight, y in zip(self.weights.values(), whole, strict=True))
        return Fraction(total, self.scale * scale**2)


@dataclass(frozen=True, eq=False)
class SquaresFunction(WeightedSquares):
    """A weighted sum of squares that was verified, of this component."""

    component: Component


def check_squares(
    doc: Document, family: Family, component: Component, entry: SquaresSection, of: str
) -> SquaresFunction:
    """Verify a weighted sum of squares of a stable component."""
    need(component.behaviour == STABILITY, "a sum of squares where not all agents end at 0")
    nodes, rate = component.nodes, entry.rate
    vector = doc.files.numbers(entry.vector, "vector", len(nodes))
    need(vector.positive(), "the vector is not positive")
    own, scale = vector.over(range(len(nodes)))
    modes = [(edges, mode.unit) for edges, mode in zip(component.part.edges, family.modes, strict=True)]
    V = SquaresFunction(dict(zip(nodes, own, strict=True)), scale, rate, modes, component)
    for number, (edges, _) in enumerate(modes):
        obligation = doc.open("family-squares", f"{of}.modes[{number}]")
        need(obligation["b"] == rate, "b is not the rate")
        section = obligation["witness"].factor
        factor, power = read_factor(doc, section, len(nodes))
        need(section.parents is None, "parents of no leader group")
        need(fits(len(edges) + len(nodes), LARGEST_FORM), "a component of too many edges")
        lower, over = V.form(number)
        definite = doc.exact.residual_definite(len(nodes), lower, factor, power, over)
        need(definite, "the rate of a mode is not proved by its factor")
        doc.done(f"b = {down(rate)}, {len(nodes)} agents")
    return V
