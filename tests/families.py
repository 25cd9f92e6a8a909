"""Random families of signed digraphs that are what they are by construction.

    made = random_family(random.Random(1), "containment")
    made.family, made.behaviour        # one weak component, unless ``behaviour`` is None

Every kind has 1 to 4 modes and 1 to 8 nodes, whose order differs between modes; weights are known, uncertain or may
fail, also with both signs; modes are directed or undirected where the kind allows it.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from fractions import Fraction

from ptcc_certify.graphs.family import Family, Interval

KINDS = ("stability", "bipartite consensus", "interval bipartite consensus", "bipartite containment", "depends", "any")
Edges = dict[tuple[int, int], tuple[int, Fraction, Fraction]]  # (source, target): sign, least and largest size


@dataclass(frozen=True)
class MadeFamily:
    """A family, and the behaviour that it has by construction; None where that is left open."""

    family: Family
    behaviour: str | None


def random_family(rng: random.Random, kind: str, nodes: int | None = None, wide: bool = False) -> MadeFamily:
    """Return a random family; ``wide`` weights go over 16 powers of ten, others from 1 to 4."""
    maker = _Maker(rng, nodes or rng.randint(1, 8), wide)
    if kind == "stability":
        maker.n = max(maker.n, 2)
        modes = [maker.unbalanced() for _ in range(rng.randint(1, 4))]
    elif kind == "bipartite consensus":
        camps = maker.camps()
        modes = [maker.rooted(camps) for _ in range(rng.randint(1, 4))]
    elif kind in ("interval bipartite consensus", "bipartite containment"):
        modes = maker.common_rows(1 if kind.startswith("interval") else rng.randint(2, 3))
    elif kind == "depends":
        return _spoiled(rng, maker)
    else:
        modes = [maker.anything() for _ in range(rng.randint(1, 4))]
    return MadeFamily(maker.family(modes), None if kind == "any" else kind)


def _spoiled(rng: random.Random, maker: _Maker) -> MadeFamily:
    """Return a family whose rest states are not all common, in one of four ways."""
    maker.n = max(maker.n, 3)
    way = rng.choice(("outage", "other camps", "shares", "optional"))
    camps = maker.camps()
    if way == "outage":
        modes = [maker.rooted(camps), ({}, False)]
    elif way == "other camps":
        others = [-g if k == 1 else g for k, g in enumerate(camps)]
        modes = [maker.rooted(camps), maker.rooted(others)]
    else:  # node 0 and 1 lead, all others hear both, at first in equal shares
        one = Fraction(1)
        first: Edges = {(v, k): (1, one, one) for v in (0, 1) for k in range(2, maker.n)}
        second = dict(first)
        second[0, 2] = (1, Fraction(3), Fraction(3)) if way == "shares" else (1, one, Fraction(2))
        modes = [(first, False), (second, False)]
        rng.shuffle(modes)
    return MadeFamily(maker.family(modes), "depends on the signal")


@dataclass
class _Maker:
    rng: random.Random
    n: int
    wide: bool

    def camps(self) -> list[int]:
        return [self.rng.choice((1, -1)) for _ in range(self.n)]

    def weight(self) -> Fraction:
        return Fraction(10) ** self.rng.randint(-8, 8) if self.wide else Fraction(self.rng.randint(2, 8), 2)

    def mandatory(self) -> tuple[Fraction, Fraction]:
        low = self.weight()
        return low, low * self.rng.choice((1, 1, 2))

    def interval(self) -> tuple[Fraction, Fraction]:
        return self.mandatory() if self.rng.random() < 0.6 else (Fraction(0), self.weight())

    def rooted(self, camps: list[int]) -> tuple[Edges, bool]:
        """Return edges that keep camps, with one root or more at all nodes in mandatory edges."""
        order = self.rng.sample(range(self.n), self.n)
        edges: Edges = {}
        for place, v in enumerate(order[1:], 1):
            u = self.rng.choice(order[:place])
            edges[u, v] = (camps[u] * camps[v], *self.mandatory())
        self._more(edges, lambda u, v: camps[u] * camps[v])
        tied = self.rng.random() < 0.2
        return (_one_way(edges), True) if tied else (edges, False)

    def unbalanced(self) -> tuple[Edges, bool]:
        """Return edges of which the mandatory ones have unbalanced closed components only."""
        order = self.rng.sample(range(self.n), self.n)
        tied = self.n > 2 and self.rng.random() < 0.2
        size = self.rng.randint(3 if tied else 2, self.n)
        core = order[:size]
        signs = [self.rng.choice((1, -1)) for _ in core]
        signs[0] *= -1 if signs.count(-1) % 2 == 0 else 1
        edges: Edges = {(core[k - 1], v): (signs[k], *self.mandatory()) for k, v in enumerate(core)}
        for place, v in enumerate(order[size:], size):
            edges[self.rng.choice(order[:place]), v] = (self.rng.choice((1, -1)), *self.mandatory())
        self._more(edges, lambda u, v: self.rng.choice((1, -1, 0)))
        return (_one_way(edges), True) if tied else (edges, False)

    def anything(self) -> tuple[Edges, bool]:
        edges: Edges = {}
        share = self.rng.choice((0, 0.15, 0.3, 0.6))
        camps, agree = self.camps(), self.rng.choice((0.5, 0.95, 1))
        for u in range(self.n):
            for v in range(self.n):
                if u != v and self.rng.random() < share:
                    sign = camps[u] * camps[v] * (1 if self.rng.random() < agree else -1)
                    both = self.rng.random() < 0.05
                    edges[u, v] = (0, Fraction(0), self.weight()) if both else (sign, *self.interval())
        tied = self.rng.random() < 0.2
        return (_one_way(edges), True) if tied else (edges, False)

    def _more(self, edges: Edges, sign: object) -> None:
        for u in range(self.n):
            for v in range(self.n):
                if u != v and (u, v) not in edges and self.rng.random() < 0.2:
                    one = sign(u, v)  # type: ignore[operator]
                    edges[u, v] = (one, *self.interval()) if one else (0, Fraction(0), self.weight())

    def common_rows(self, groups: int) -> list[tuple[Edges, bool]]:
        """Return modes with ``groups`` common closed components, some balanced, and agents that weigh them alike.

        The last agent hears only the one before it, in uncertain weights; one hears both camps or two components.
        """
        sizes = [self.rng.randint(1, 2) for _ in range(groups)]
        unbalanced = groups > 1 and self.rng.random() < 0.3
        sizes[0] = 2 if unbalanced else sizes[0]
        starts = [sum(sizes[:k]) for k in range(groups)]
        leaders, followers = sum(sizes), self.rng.randint(2, 3)
        self.n = leaders + followers
        camps, first = self.camps(), leaders
        base: dict[tuple[int, int], tuple[int, Fraction]] = {}
        for v in range(first, self.n - 1):
            for u in {0, *starts, *self.rng.sample(range(v), self.rng.randint(0, v))}:
                base[u, v] = (self.rng.choice((1, -1)), self.weight())
        if groups == 1:
            if sizes[0] == 1:  # the first follower and its copy with another sign pull the second one apart
                base[0, first] = (1, Fraction(1))
                base = {pair: one for pair, one in base.items() if pair[1] != first or pair[0] == 0}
                base[0, self.n - 2] = (1, Fraction(1))
                base[self.n - 1, first] = (-1, Fraction(1))
            else:
                base[0, first], base[1, first] = (camps[0], Fraction(1)), (-camps[1], Fraction(2))
        modes = []
        for _ in range(self.rng.randint(1, 4)):
            speed = [self.weight() for _ in range(self.n)]
            edges: Edges = {(u, v): (s, w * speed[v], w * speed[v]) for (u, v), (s, w) in base.items()}
            for k, (start, size) in enumerate(zip(starts, sizes, strict=True)):
                if size == 2:
                    sign = camps[start] * camps[start + 1]
                    back = -sign if unbalanced and k == 0 else sign
                    edges[start, start + 1] = (sign, *self.mandatory())
                    edges[start + 1, start] = (back, *self.mandatory())
            edges[self.n - 2, self.n - 1] = (1, *self.mandatory())
            modes.append((edges, False))
        return modes

    def family(self, modes: list[tuple[Edges, bool]]) -> Family:
        names = [f"n{v}" for v in range(self.n)]
        made = {}
        for number, (edges, tied) in enumerate(modes):
            rows: list[Interval] = []
            for (u, v), (sign, low, high) in edges.items():
                ends = (-high, high) if sign == 0 else sorted((sign * low, sign * high))
                rows.append((names[u], names[v], *ends))
            self.rng.shuffle(rows)
            nodes = self.rng.sample(names, self.n) if number else names
            made[f"mode {number}"] = Family.from_intervals(rows, nodes, undirected=tied)
        return Family.switching(made)


def _one_way(edges: Edges) -> Edges:
    """Return the edges with one direction of every pair, the first."""
    kept: Edges = {}
    for (u, v), what in edges.items():
        if (v, u) not in kept:
            kept[u, v] = what
    return kept
