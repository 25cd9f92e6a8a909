"""Random families with a common kernel, by construction: every mode has the states at rest that were chosen first."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ptcc_certify.graphs.family import Family

Rng = np.random.Generator
KINDS = ("stability", "consensus", "containment", "undirected")


def random_family(
    rng: Rng, kind: str, n: int, modes: int = 1, share: Fraction | int = 0, optional: float = 0
) -> Family:
    """A family of ``kind``; sizes of uncertain edges lie within ``share`` of their value, or may be 0."""
    gauge = rng.choice([-1, 1], n)
    rows = [
        {"stability": _stable, "consensus": _consensus, "undirected": _undirected}[kind](rng, n, gauge)
        for _ in range(modes if kind != "containment" else 0)
    ]
    certain: set[tuple[int, int]] = set()
    if kind == "containment":
        rows, certain = _containment(rng, n, gauge, modes)
    return Family.switching([_mode(rng, n, edges, kind, share, optional, certain) for edges in rows])


def _mode(
    rng: Rng,
    n: int,
    edges: dict[tuple[int, int], Fraction],
    kind: str,
    share: Fraction | int,
    optional: float,
    certain: set[tuple[int, int]],
) -> Family:
    """Make intervals of the edges; those beyond a spanning part, marked by a weight of more than 1000, may fail."""
    rows = []
    for (source, target), w in edges.items():
        extra = abs(w) > 1000
        w = w / 10**6 if extra else w
        low, high = sorted([w * (1 - share), w * (1 + share)])
        if (source, target) in certain:
            low = high = w
        elif extra and rng.random() < optional:
            low, high = min(w, Fraction(0)), max(w, Fraction(0))
        rows.append((source, target, low, high))
    return Family.from_intervals(rows, nodes=range(n), undirected=kind == "undirected")


def _weight(rng: Rng) -> Fraction:
    return Fraction(int(rng.integers(1, 40)), 10)


def _tree(rng: Rng, order: list[int]) -> list[tuple[int, int]]:
    return [(order[int(rng.integers(i))], order[i]) for i in range(1, len(order))]


def _extra(rng: Rng, n: int, count: int) -> list[tuple[int, int]]:
    pairs = [(int(rng.integers(n)), int(rng.integers(n))) for _ in range(count)]
    return [(s, t) for s, t in pairs if s != t]


def _stable(rng: Rng, n: int, gauge: np.ndarray) -> dict[tuple[int, int], Fraction]:
    """A root pair of which one likes and the other dislikes; everyone hears it."""
    order = rng.permutation(n).tolist()
    edges = {(s, t): _weight(rng) * int(rng.choice([-1, 1])) for s, t in _tree(rng, order)}
    first, second = order[:2]
    edges[second, first] = -_weight(rng) * (1 if edges[first, second] > 0 else -1)
    for pair in _extra(rng, n, 2 * n):
        edges.setdefault(pair, _weight(rng) * int(rng.choice([-1, 1])) * 10**6)
    return edges


def _consensus(rng: Rng, n: int, gauge: np.ndarray) -> dict[tuple[int, int], Fraction]:
    edges = {(s, t): _weight(rng) * int(gauge[s] * gauge[t]) for s, t in _tree(rng, rng.permutation(n).tolist())}
    for s, t in _extra(rng, n, 2 * n):
        edges.setdefault((s, t), _weight(rng) * int(gauge[s] * gauge[t]) * 10**6)
    return edges


def _undirected(rng: Rng, n: int, gauge: np.ndarray) -> dict[tuple[int, int], Fraction]:
    edges = {(s, t): _weight(rng) * int(gauge[s] * gauge[t]) for s, t in _tree(rng, rng.permutation(n).tolist())}
    for s, t in _extra(rng, n, n):
        if (t, s) not in edges:
            edges.setdefault((s, t), _weight(rng) * int(gauge[s] * gauge[t]) * 10**6)
    return edges


def _containment(
    rng: Rng, n: int, gauge: np.ndarray, modes: int
) -> tuple[list[dict[tuple[int, int], Fraction]], set[tuple[int, int]]]:
    """Two leaders, and one more for every four nodes; each follower's row is scaled from mode to mode."""
    leaders = max(1, min(n - 1, 2 + n // 4))
    into: dict[int, list[tuple[int, Fraction]]] = {}
    for k in range(leaders, n):
        heard = rng.choice(k, size=min(k, 2), replace=False).tolist()
        into[k] = [(s, _weight(rng) * int(rng.choice([-1, 1]))) for s in heard]
    result = []
    for _ in range(modes):
        scale = {k: _weight(rng) for k in into}
        result.append({(s, k): w * scale[k] for k, row in into.items() for s, w in row})
    return result, {(s, k) for k, row in into.items() for s, _ in row}
