"""What makes the check of large families fast decides nothing else: twins, sums in integers, texts that are hashed."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from asked import family_certificate
from mutations import changed, resealed
from row_families import bounds_of, random_led
from selection import thinned

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import check
from ptcc_certify.checker.array_digraph import ArrayDigraph
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.reading import exact
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import follower_functions
from ptcc_certify.model import NominalProtocol
from ptcc_certify.theorems.family_behaviour import decide

LED = ("stability", "bipartite consensus", "bipartite containment")
LONG = [Fraction(1), Fraction(3, 7**30), Fraction(2**70 - 1, 2**70), Fraction(10) ** 20, Fraction(1, 10**20)]


def long_family(rng: random.Random, family: Family) -> Family:
    """The same edges and signs; weights of many magnitudes over long denominators, and labels that need quotes."""
    odd = rng.sample(['"', "\\", "\u00e9", "\n", " ", "10", "9", "a, b"], family.n_nodes)
    labels = dict(zip(family.labels, odd, strict=True))
    modes = []
    for mode in family.modes:
        factor, edges = rng.choice(LONG), []
        for e in range(mode.n_edges):
            ends = [factor * x for x in mode.edge_interval(e)]
            edges.append((labels[mode.labels[mode.source[e]]], labels[mode.labels[mode.target[e]]], *ends))
        modes.append(Family.from_intervals(edges, nodes=labels.values()))
    return Family.switching(modes)


def certificate(family: Family) -> Certificate:
    """With functions of followers alone."""
    x0 = tuple(Fraction(7 * k % 11 - 5, 3) for k in range(family.n_nodes))
    parts = [ComponentProof(c, tuple(follower_functions(c, (0.1, 0.3))) if c.kernel else ()) for c in decide(family)]
    return family_certificate(family, NominalProtocol(T=1, rho1=1, rho2=30, kappa=3), tuple(parts), x0)


@pytest.mark.parametrize("seed", range(100))
def test_signed_pieces_are_what_the_definition_says(seed: int):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 9)), int(rng.integers(0, 12))
    source, target = rng.integers(0, n, (2, m)).tolist()
    minus = (rng.random(m) < 0.3).tolist()
    edges = list(zip(source, target, minus, strict=True))
    plain, twin = (kind.signed_pieces(n, source, target, minus) for kind in (Digraph, ArrayDigraph))
    first, _, odd = plain
    near = np.eye(n, dtype=bool)
    for s, t, _ in edges:
        near[s, t] = near[t, s] = True
    together = np.linalg.matrix_power(near.astype(int), n) > 0
    assert (first, odd) == (twin[0], twin[2])
    assert first == [int(row.argmax()) for row in together]
    for root in set(first):
        own = [edge for edge in edges if first[edge[0]] == root]
        fits = any(all((camps[s] == camps[t]) != m for s, t, m in own) for camps in product([True, False], repeat=n))
        assert (root in odd) == (not fits)
        for opposite in (plain[1], twin[1]) if fits else ():
            assert not opposite[root] and all((opposite[s] == opposite[t]) != m for s, t, m in own)


@pytest.mark.parametrize("kind", thinned(LED))
def test_speeds_and_roots_of_functions_of_rows_are_the_sums_of_their_definition(kind: str):
    """Of weights of many magnitudes; what is written is refused if it is less by 2^-55 of itself."""
    found = refused = 0
    for seed in range(5):
        rng = random.Random(seed)
        family = random_led(rng, kind)
        cert = certificate(long_family(rng, family) if seed % 2 else family)
        for V in cert.parts[0].functions:
            found += 1
            sizes = bounds_of(V.sizes)
            speeds = bounds_of(V.speeds)
            for k in V.followers.tolist():
                sums = []
                for mode in cert.family.modes:
                    into = np.flatnonzero(mode.target == k).tolist()
                    pairs = ((mode.upper.fraction(e), sizes.get(int(mode.source[e]), 0)) for e in into)
                    sums.append(sum((w * (sizes[k] + other) for w, other in pairs), Fraction(0)))
                assert speeds[k] == max(sums)
        document = cert.to_dict()
        assert check(document).accepted
        for label, peak in document["input"].get("peaks", {}).items():
            less = str(exact(peak) * (1 - Fraction(1, 2**55)))
            if peak != "0":
                assert not check(resealed(changed(document, ("input", "peaks", label), less))).accepted
                refused += 1
    assert found > 4 and refused > 4
