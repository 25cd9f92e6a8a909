"""Random families of flocks behind leaders that hear nobody, whose followers have the same targets in every member."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ptcc_certify.graphs.family import Family


def led_family(rng: np.random.Generator, leaders: int, followers: int, modes: int, common: bool = False) -> Family:
    """Flocks, each with a leader that hears nobody, whose camps every member keeps; one follower of two, if asked."""
    n = leaders + followers
    camp, home = rng.choice([-1, 1], n), np.concatenate([np.arange(leaders), rng.integers(0, leaders, followers)])
    made = []
    for _ in range(modes):
        rows = []
        for v in range(leaders, n):
            others = [u for u in range(n) if home[u] == home[v] and u != v]
            sure = int(rng.choice([u for u in others if u < v]))
            for u in others:
                if u != sure and rng.random() < 0.6:
                    continue
                size, share = Fraction(int(rng.integers(2, 30)), 10), Fraction(int(rng.integers(0, 4)), 10)
                low, high = size * (1 - share), size * (1 + share)
                low = low if u == sure or rng.random() < 0.7 else Fraction(0)
                sign = int(camp[u] * camp[v])
                rows.append((u, v, *sorted((sign * low, sign * high))))
        if common:
            rows += [(0, n, 1, 1), (1, n, -2, -2)]
        made.append(Family.from_intervals(rows, nodes=range(n + common)))
    return Family.switching(made)
