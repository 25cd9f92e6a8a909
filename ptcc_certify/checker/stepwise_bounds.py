"""A solution that never grows, from instant to instant in integers: what followers are off by under late messages.

``y' = -g (D y - |W_F| y(t - delay) - value_error D)`` from a constant history ``y_0`` with ``D y_0 >= |W_F| y_0 +
value_error D`` never grows, and bounds ``|x - x*|`` for all delays up to ``delay``. Between two instants of the grid
what is heard is at most what was said at an instant before, so that each row has a solution in closed form. Entries are
multiples of ``2^-30`` of the largest one at first; everything is rounded up. Where leaders move, and followers are
disturbed, by ``push`` together, ``value_error + push/(D_k g)`` stands for ``value_error``: ``g`` never falls.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple

from lmi.exact.numbers import longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.message_ages import PARTS

#: Bits of a fixed-point number, of the share of a degree in the largest one, and of the way of the clock.
FIXED, SHARE, WAY = 30, 40, 42
ONE = 1 << FIXED
#: The most that the way of the clock times the largest degree is taken for: ``2^LONGEST_WAY``.
LONGEST_WAY = 31


def fixed_decay_above(x: int) -> int:
    """Bound ``e^-x`` from above by ``1/(1 + x + x^2/2 + x^3/6 + x^4/24)``; both are multiples of ``2^-30``.

    Examples
    --------
    >>> fixed_decay_above(ONE) / ONE  # 24/65
    0.3692307695746422
    """
    total = ONE
    for n in (4, 3, 2, 1):
        total = ONE + (x * total >> FIXED) // n
    return -(-(ONE * ONE) // total)


def fixed_decay_below(x: int) -> int:
    """Bound ``e^-x`` from below by ``1 - x + x^2/2 - x^3/6``, or 0; both are multiples of ``2^-30``.

    Examples
    --------
    >>> fixed_decay_below(ONE // 2) / ONE, fixed_decay_below(2 * ONE)  # 29/48
    (0.604166666045785, 0)
    """
    cubed = 6 * ONE**3 - 6 * x * ONE**2 + 3 * x**2 * ONE - x**3
    return max(cubed // (6 * ONE**2), 0)


class Step(NamedTuple):
    """From one instant to the next: bounds of deviations at both, and in between of what is heard over ``D_k``."""

    begin: Sequence[int]
    heard: Sequence[int]
    end: Sequence[int]


class Steps:
    """The bounds of followers from instant to instant.

    Parameters
    ----------
    graph : Digraph
    nodes : ints
        The followers.
    degrees : ints
        ``D_k`` of the followers, times the unit of the graph.
    start : ints
        ``y_0`` by follower, times a scale.
    value_error : Fraction
        Times the same scale.
    parts : ints
        Ages of what is heard over the edges of the graph, in 64ths of the largest one; or one for all.
    push : Fraction
        Over the first gain, times the same scale.
    """

    def __init__(
        self,
        graph: Digraph,
        nodes: Sequence[int],
        degrees: Sequence[int],
        start: Sequence[int],
        value_error: Fraction,
        parts: Sequence[int] = (PARTS,),
        push: Fraction = Fraction(0),
    ):
        self.graph, self.nodes, self.degrees = graph, nodes, degrees
        self.largest = max(max(start), 1)
        spend(graph.n_edges + 2 * graph.n, graph.bits + FIXED, longest(start), "bounds from instant to instant")
        self.start = array("q", (-(-(x << FIXED) // self.largest) for x in start))
        self.error = -(-(value_error.numerator << FIXED) // (value_error.denominator * self.largest))
        p, q = (push * graph.unit).as_integer_ratio()
        self.lags = array("q", (-(-(p << FIXED) // (q * self.largest * D)) for D in degrees))
        self.top = max(degrees)
        self.shares = array("q", ((D << SHARE) // self.top for D in degrees))
        place = dict(zip(nodes, range(len(nodes)), strict=True))
        sizes, (offsets, sources, which) = [abs(w) for w in graph.values], graph.into
        # where the edges of every follower begin that come from followers, these, shares in its degree, and ages
        self.offsets, self.sources, self.weights, self.parts = array("q", [0]), array("q"), array("q"), array("q")
        for v, D in zip(nodes, degrees, strict=True):
            for e in range(offsets[v], offsets[v + 1]):
                if (s := place.get(sources[e])) is not None:
                    self.sources.append(s)
                    self.weights.append(-(-(sizes[which[e]] << FIXED) // D))
                    self.parts.append(parts[e if len(parts) > 1 else 0])
            self.offsets.append(len(self.sources))

    def run(self, *asked: Any) -> Sequence[int]:
        """Return the bounds at the last instant of :meth:`walk`, multiples of ``largest 2^-30``."""
        *_, last = self.walk(*asked)
        return last.end

    def walk(
        self,
        instants: Sequence[Fraction],
        delay: Fraction,
        ways: Sequence[Fraction | None],
        gains: Sequence[Fraction] = (),
    ) -> Iterator[Step]:
        """Yield every step.

        Parameters
        ----------
        instants : Fractions
            Ascending from 0 on.
        delay : Fraction
        ways : Fractions
            How far the clock goes between two of them, from below; None: infinitely far.
        gains : Fractions
            The gain at every instant but the last, from below, ascending; where nothing pushes they may be left out.
        """
        ages = {part: delay * part / PARTS for part in sorted(set(self.parts) or {PARTS}, reverse=True)}
        said = [[max(bisect_right(instants, t - age) - 1, 0) for age in ages.values()] for t in instants[:-1]]
        window = max(i - oldest for i, (oldest, *_) in enumerate(said)) + 2
        sized(len(self.nodes) * window, 64, "bounds from instant to instant")
        spend(len(ways) * (len(self.sources) + 8 * len(self.nodes)), FIXED, FIXED, "bounds from instant to instant")
        known: dict[int, Sequence[int]] = {0: self.start}
        for i, (places, way) in enumerate(zip(said, ways, strict=True)):
            for old in [m for m in known if m < places[0]]:
                del known[old]
            heard = whole = self._heard({part: known[j] for part, j in zip(ages, places, strict=True)})
            if gains and way is not None:
                whole = self._pushed(heard, ceil(ONE * gains[0] / gains[i]))
            known[i + 1] = self._step(known[i], whole, None if way is None else self._fixed(way))
            yield Step(known[i], heard, known[i + 1])

    def _fixed(self, way: Fraction) -> tuple[int, int]:
        """Return what the way times the largest degree is, as an integer of ``WAY`` bits, and how far it is shifted."""
        x = min(way * Fraction(self.top, self.graph.unit), Fraction(1 << LONGEST_WAY))
        shift = WAY - (x.numerator.bit_length() - x.denominator.bit_length()) - 1
        whole = (x.numerator << max(shift, 0)) // (x.denominator << max(-shift, 0))
        return whole, SHARE + shift - FIXED

    def _heard(self, told: Mapping[int, Sequence[int]]) -> Sequence[int]:
        """Bound ``sum_l |w_kl| y_l / D_k + value_error`` from above, each ``y`` that of the age of its edge."""
        products = [a * told[part][s] for a, s, part in zip(self.weights, self.sources, self.parts, strict=True)]
        return [-(-sum(products[a:b]) >> FIXED) + self.error for a, b in pairwise(self.offsets)]

    def _pushed(self, heard: Sequence[int], share: int) -> Sequence[int]:
        """Add what pushes followers under a gain that is the first one over a share."""
        return [h - (-x * share >> FIXED) for h, x in zip(heard, self.lags, strict=True)]

    def larger(self, peaks: Sequence[int], step: Step, share: int) -> Sequence[int]:
        """Return the larger ones of peaks and of a share, in ``2^-30``, of what agents are off and hear."""
        rows = zip(peaks, step.begin, step.heard, strict=True)
        return [max(peak, -(-(y + h) * share >> FIXED)) for peak, y, h in rows]

    def _step(self, y: Sequence[int], heard: Sequence[int], way: tuple[int, int] | None) -> Sequence[int]:
        """Bound the next state."""
        if way is None:
            return array("q", map(min, y, heard))
        known: dict[int, int] = {}
        for share in set(self.shares):
            known[share] = fixed_decay_above(share * way[0] >> way[1])
        rest = (
            h + -(-max(x - h, 0) * known[share] >> FIXED) for x, h, share in zip(y, heard, self.shares, strict=True)
        )
        return array("q", map(min, y, rest))
