"""Random families with followers, all vertices of small boxes, and their members in floats.

made = random_followers(random.Random(1))       # one mode, camps kept by all edges
for levels in vertices(made.modes[0]): laplacian(made.modes[0], levels)
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable, Iterator
from fractions import Fraction

import numpy as np

from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.signal_bounds import least
from ptcc_certify.graphs.family import Family, Mode

Edge = tuple[int, int, Fraction, Fraction]


def random_interval(rng: random.Random, mandatory: bool) -> tuple[Fraction, Fraction]:
    """Return two sizes, over some powers of ten; equal ones, and 0 as the least, occur."""
    low = Fraction(rng.randint(1, 40), 10) * Fraction(10) ** rng.choice([0, 0, 0, 2, -2])
    high = low * rng.choice([1, 2, 5])
    return (Fraction(0), high) if not mandatory and rng.random() < 0.3 else (low, high)


def random_followers(rng: random.Random, modes: int = 1, leaders: int = 1, agree: bool = True) -> Family:
    """Return a family whose nodes from number ``leaders`` on follow the first ones; 7 uncertain edges a mode."""
    n = leaders + rng.randint(1, 5)
    camps = [rng.choice([1, -1]) for _ in range(n)]
    families = []
    for _ in range(modes):
        edges: list[Edge] = []
        unsure = 0
        for t in range(leaders, n):
            parent = rng.randrange(t)
            for s in range(n):
                if s != t and (s == parent or rng.random() < 0.4):
                    low, high = random_interval(rng, s == parent)
                    low, unsure = (low, unsure + 1) if low < high and unsure < 7 else (high, unsure)
                    sign = camps[s] * camps[t] if agree else rng.choice([1, -1])
                    edges.append((s, t, *sorted((sign * low, sign * high))))
        families.append(Family.from_intervals(edges, nodes=range(n)))
    return families[0] if modes == 1 else Family.switching(families)


def random_consensus(rng: random.Random) -> Family:
    """Return a family of one mode that comes to bipartite consensus; at most 7 uncertain edges."""
    n = rng.randint(1, 5)
    camps = [rng.choice([1, -1]) for _ in range(n)]
    order = list(range(n))
    rng.shuffle(order)
    parent = {order[i]: order[rng.randrange(i)] for i in range(1, n)}
    edges: list[Edge] = []
    unsure = 0
    for t, s in itertools.permutations(range(n), 2):
        if parent.get(t) == s or rng.random() < 0.5:
            low, high = random_interval(rng, parent.get(t) == s)
            low, unsure = (low, unsure + 1) if low < high and unsure < 7 else (high, unsure)
            sign = camps[s] * camps[t]
            edges.append((s, t, *sorted((sign * low, sign * high))))
    return Family.from_intervals(edges, nodes=range(n))


def random_led(rng: random.Random, kind: str) -> Family:
    """Return a family of one or two modes in which pairs lead and others follow, of common states at rest.

    ``stability``: one unbalanced pair; ``bipartite consensus``: a balanced one; ``bipartite containment``: two, of
    which every follower hears one, but the last.
    """
    pairs = {"stability": 1, "bipartite consensus": 1, "bipartite containment": 2}[kind]
    first = 2 * pairs
    n = first + rng.randint(1, 3)
    camps = [rng.choice([1, -1]) for _ in range(n)]
    families = []
    for _ in range(rng.randint(1, 2)):
        edges: list[Edge] = []
        for s, t in itertools.permutations(range(n), 2):
            together = s % pairs == t % pairs
            lead = t < first and s < first and together
            parent = t >= first and s == t % pairs
            if lead or parent or (t >= first and together and rng.random() < 0.4):
                low, high = random_interval(rng, lead or parent)
                sign = camps[s] * camps[t]
                if kind == "stability":
                    sign = (1 if s < t else -1) if lead else rng.choice([1, -1])
                edges.append((s, t, *sorted((sign * low, sign * high))))
        if pairs == 2:  # one hears both, in known shares
            edges += [(0, n, Fraction(1), Fraction(1)), (1, n, Fraction(2), Fraction(2))]
        families.append(Family.from_intervals(edges, nodes=range(n + pairs - 1)))
    return families[0] if len(families) == 1 else Family.switching(families)


def vertices(mode: Mode) -> Iterator[np.ndarray]:
    """Yield which edges are at ``w+``, for all corners of the box of independent weights."""
    unsure = np.flatnonzero(~mode.known)
    for bits in itertools.product([False, True], repeat=unsure.size):
        largest = np.zeros(mode.n_edges, dtype=bool)
        largest[unsure] = bits
        yield largest


def laplacian(mode: Mode, largest: np.ndarray) -> np.ndarray:
    """Return the signed Laplacian in floats; both of two parallel edges count."""
    L = np.zeros((len(mode.labels),) * 2)
    weights = np.where(largest, mode.upper.as_float(), mode.lower.as_float())
    np.add.at(L, (mode.target, mode.target), weights)
    np.add.at(L, (mode.target, mode.source), -mode.sign * weights)
    return L


def random_vertex(rng: random.Random, mode: Mode) -> np.ndarray:
    """Return a corner of the box; undirected edges change together, of two signs one is on."""
    largest = np.zeros(mode.n_edges, dtype=bool)
    chosen: dict[tuple[int, int], tuple[int, bool]] = {}
    for e in range(mode.n_edges):
        s, t, sign = int(mode.source[e]), int(mode.target[e]), int(mode.sign[e])
        key = (min(s, t), max(s, t)) if mode.tied else (s, t)
        on = chosen.setdefault(key, (rng.choice([1, -1]), rng.random() < 0.5))
        both = bool(((mode.source == s) & (mode.target == t)).sum() > 1)
        largest[e] = on[1] and (not both or on[0] == sign)
    return largest


def exact_value(n: int, edges: list[tuple[int, int, Fraction]], z: list[Fraction]) -> Fraction:
    """Return ``eta' z``, ``eta' M(L) = 0`` and ``eta' 1 = 1``, by elimination in rationals."""
    M = [[Fraction(0)] * n for _ in range(n)]
    for s, t, w in edges:
        M[t][t] += abs(w)
        M[t][s] -= abs(w)
    rows = [[M[j][i] for j in range(n)] + [Fraction(0)] for i in range(n)] + [[Fraction(1)] * (n + 1)]
    for column in range(n):
        pivot = next(i for i in range(column, n + 1) if rows[i][column])
        rows[column], rows[pivot] = rows[pivot], rows[column]
        head = [x / rows[column][column] for x in rows[column]]
        rows = [
            head if i == column else [x - row[column] * y for x, y in zip(row, head, strict=True)]
            for i, row in enumerate(rows)
        ]
    return sum((row[n] * x for row, x in zip(rows[:n], z, strict=True)), Fraction(0))


def random_state(rng: random.Random, n: int) -> list[Fraction]:
    """Return a state of short fractions."""
    return [Fraction(rng.randint(-20, 20), rng.randint(1, 7)) for _ in range(n)]


def values_of_vertices(mode: Mode, z: list[Fraction]) -> list[Fraction]:
    """Return the consensus values of all members with weights at ends of their intervals, ``z`` camps times states."""
    values = []
    for largest in vertices(mode):
        sizes = [(mode.upper if up else mode.lower).fraction(e) for e, up in enumerate(largest.tolist())]
        edges = zip(mode.source.tolist(), mode.target.tolist(), sizes, strict=True)
        values.append(exact_value(len(z), [edge for edge in edges if edge[2]], z))
    return values


def bounds_of(vectors: Iterable[Scaled]) -> dict[int, Fraction]:
    """Return what some vectors say of every node."""
    whole, scale = least(vectors)
    return {k: Fraction(x, scale) for k, x in whole.items()}
