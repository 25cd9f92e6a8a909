"""The graph of the checker: with the standard library and with NumPy, against each other and against networkx."""

from __future__ import annotations

import json
import tracemalloc
from array import array
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

from lmi.exact import arithmetic
from lmi.exact.work import WorkError
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker.array_digraph import ArrayDigraph
from ptcc_certify.checker.contents import GraphCertificate
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import check_graph
from ptcc_certify.checker.reading import RejectedError
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.base import NominalProtocol

KINDS = (Digraph, ArrayDigraph)


def drawn(seed: int) -> tuple[int, list[tuple[int, int, Any]], int]:
    """Nodes, edges in order, scale: sparse or dense, single nodes, mutual edges, equal or opposite, any weights."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 14))
    count = int(rng.integers(1, 3 * n))
    weights = [
        lambda: int(rng.choice([-1, 1])),
        lambda: float(rng.choice([-1, 1]) * rng.uniform(0.1, 3)),
        lambda: Fraction(int(rng.choice([-3, -1, 2, 5])), int(rng.integers(1, 9))),
        lambda: int(rng.choice([-1, 1])) * 10 ** int(rng.integers(0, 40)),
    ][seed % 4]
    edges: dict[tuple[int, int], Any] = {}
    for s, t in rng.integers(0, n, (count, 2)).tolist():
        if s != t:
            edges[t, s] = weights()
            if rng.random() < 0.3:
                edges[s, t] = edges[t, s] * int(rng.choice([-1, 1, 1]))
    return n, [(s, t, w) for (t, s), w in sorted(edges.items())], int(rng.integers(1, 7))


def labelled(n: int) -> list[str]:
    return [f'"{v}\n' for v in np.random.default_rng(n).permutation(n)]


def made(kind: type[Digraph], n: int, edges: list[tuple[int, int, Any]], scale: int) -> Digraph:
    source, target, weights = map(list, zip(*edges, strict=True)) if edges else ([], [], [])
    if all(isinstance(w, float) for w in weights):
        return kind(labelled(n), array("q", source), array("q", target), array("d", weights), scale)
    return kind(labelled(n), source, target, weights, scale)


def conflicting(graph: nx.DiGraph, nodes: set[int]) -> bool:
    """Whether no camps fit, by trying all of them."""
    edges = [(s, t, w > 0) for s, t, w in graph.subgraph(nodes).edges(data="w")]
    first, *others = sorted(nodes)
    for signs in product([True, False], repeat=len(others)):
        camp = {first: True, **dict(zip(others, signs, strict=True))}
        if all((camp[s] == camp[t]) == same for s, t, same in edges):
            return False
    return True


@pytest.mark.few(60)
@pytest.mark.parametrize("seed", range(160))
def test_both_are_what_the_definitions_say(seed: int):
    n, edges, scale = drawn(seed)
    reference = nx.DiGraph()
    reference.add_nodes_from(range(n))
    reference.add_weighted_edges_from(edges, weight="w")
    rng = np.random.default_rng(seed)
    x = [int(v) * 10 ** int(k) for v, k in rng.integers([-9, 0], [10, 40], (n, 2))]
    ones = [made(kind, n, edges, scale) for kind in KINDS]
    if not edges:
        return
    for g in ones:
        exact = {(s, t): Fraction(w) / scale * g.unit for s, t, w in edges}
        assert all(w.denominator == 1 for w in exact.values())
        heard, signed, hearing = [0] * n, [0] * n, [0] * n
        for (s, t), w in exact.items():
            heard[t] += int(abs(w)) * x[s]
            signed[t] += int(w) * x[s]
            hearing[s] += int(abs(w)) * x[t]
        diagonal = [sum(int(abs(w)) for (_, t), w in exact.items() if t == v) for v in range(n)]
        assert g.laplacian_product(x) == [d * y - h for d, y, h in zip(diagonal, x, signed, strict=True)]
        assert g.laplacian_product(x, signed=False) == [d * y - h for d, y, h in zip(diagonal, x, heard, strict=True)]
        assert g.left_product(range(n), x) == [d * y - h for d, y, h in zip(diagonal, x, hearing, strict=True)]
        factors = {3: 1 << 70, 5: 0, 64: int(rng.integers(1, 9))}
        parts = [int(p) for p in np.random.default_rng(seed).choice([3, 5, 64], len(edges))]
        apart = [0] * n
        for s, t, part in zip(g.source, g.target, parts, strict=True):
            apart[t] += factors[part] * int(abs(exact[s, t])) * x[s]
        assert g.sums_by_part(x, parts, factors) == apart
        assert g.sums_in(x) == heard and g.sums_in(x, signed=True) == signed and g.sums_out(x) == hearing
        for v in range(n):
            row = {s: -int(w) for (s, t), w in exact.items() if t == v}
            assert g.row(v) == ({v: sum(map(abs, row.values())), **row} if row else {})
            assert g.diagonal[v] == sum(map(abs, row.values()))
        assert g.listening == [v for v in range(n) if reference.in_degree(v)]
        for s, t in product(range(n), repeat=2):
            w = exact.get((s, t), 0)
            assert g.sign(s, t) == (w > 0) - (w < 0)
        pieces = [set(c) for c in nx.weakly_connected_components(reference)]
        piece, torn = g.pieces
        assert piece == [min(next(c for c in pieces if v in c)) for v in range(n)]
        assert torn == {min(c) for c in pieces if conflicting(reference, c)}
        assert g.antagonistic() == {piece[s] for (s, _), w in exact.items() if w < 0}
        odd = {piece[s] for (s, t), w in exact.items() if exact.get((t, s)) != w}
        assert g.mutual == (all(exact.get((t, s), w) * w > 0 for (s, t), w in exact.items()), odd)
        for v in range(n):
            assert {u for u, seen in enumerate(g.reached([v])) if seen} == nx.descendants(reference, v) | {v}
            assert {u for u, seen in enumerate(g.reached([v], back=True)) if seen} == nx.ancestors(reference, v) | {v}
        group = rng.integers(-1, 3, n).tolist()
        functions = [v for v in range(n) if group[v] >= 0]
        inside = nx.DiGraph([(s, t) for s, t, _ in edges if group[s] == group[t]])
        inside.add_nodes_from(range(n))
        for v in functions:
            found = {u for u, seen in enumerate(g.reached([v], group=group)) if seen}
            assert found == nx.descendants(inside, v) | {v}
        assert g.closed(group) == all(group[t] < 0 or group[s] == group[t] for s, t, _ in edges)
        gauge = rng.choice([-1, 0, 1], n, p=[0.2, 0.6, 0.2]).tolist()
        assert g.fits(gauge) == all(w * gauge[s] * gauge[t] > 0 for s, t, w in edges if gauge[t])
    plain, arrays = ones
    assert plain.unit == arrays.unit and plain.sha256() == arrays.sha256()


@pytest.mark.parametrize("kind", KINDS)
def test_long_integers_are_summed_exactly(kind: type[Digraph]):
    """Of thousands of bits, with both signs, over weights at the ends of int64, and beyond what arrays are used for."""
    edges = [(0, 1, -(2**63)), (2, 1, 2**63 - 1), (1, 2, 1), (0, 2, -1)]
    source, target, weights = map(list, zip(*sorted(edges, key=lambda e: (e[1], e[0])), strict=True))
    for w in (weights, array("q", weights), [x * 7**4000 for x in weights]):
        g = kind("abc", source, target, w, 1)
        values = dict(zip(zip(source, target, strict=True), w, strict=True))
        for bits in (1, 31, 32, 33, 63, 64, 65, 5000, 9000):
            x = [-(1 << bits), (1 << bits) - 1, 3**bits]
            sums = [0, 0, 0]
            for (s, t), value in values.items():
                sums[t] += value * x[s]
            assert g.sums_in(x, signed=True) == sums


def test_products_of_long_integers_take_no_more_memory_than_their_sums():
    n, bits = 150, 200_000
    ends = [(s, t) for t in range(n) for s in range(n) if s != t]
    g = ArrayDigraph(range(n), [s for s, _ in ends], [t for _, t in ends], [1] * len(ends), 1)
    tracemalloc.start()
    assert g.sums_in([1 << bits] * n) == [(n - 1) << bits] * n
    assert tracemalloc.get_traced_memory()[1] < 8 * n * bits / 8
    tracemalloc.stop()


def test_many_rounds_of_hooking():
    """Long chains and stars whose numbers run against the search, whole and in conflict."""
    rng = np.random.default_rng(5)
    n = 3000
    for place in (np.arange(n), np.arange(n)[::-1], rng.permutation(n)):
        for ends in (np.stack([place[:-1], place[1:]]), np.stack([np.full(n - 1, place[0]), place[1:]])):
            sign = rng.choice([-1, 1], n - 1)
            order = np.lexsort((ends[0], ends[1]))
            source, target = (array("q", row[order].tolist()) for row in ends)
            g = ArrayDigraph(range(n), source, target, array("q", sign.tolist()), 1)
            assert g.pieces == ([0] * n, set()) == Digraph(range(n), source, target, sign.tolist(), 1).pieces


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_graph_is_refused(kind: type[Digraph]):
    good = [(1, 0, 1), (0, 1, 1), (2, 1, 1)]
    made(kind, 3, good, 1)
    for k in range(3):
        for bad in ((3, 1, 1), (-1, 1, 1), (1, 1, 1), (0, 3, 1), (0, 1, 0)):
            with pytest.raises(RejectedError):
                made(kind, 3, [*good[:k], bad, *good[k + 1 :]], 1)
    for one, other in combinations(range(3), 2):
        swapped = list(good)
        swapped[one], swapped[other] = swapped[other], swapped[one]
        with pytest.raises(RejectedError, match="order"):
            made(kind, 3, swapped, 1)
    with pytest.raises(RejectedError, match="order"):
        made(kind, 3, [good[0], good[0]], 1)
    for weights in ([0.0, 1.0, 2.0], [1.0, -0.0, 2.0]):
        with pytest.raises(RejectedError, match="weight 0"):
            kind("abc", array("q", [1, 0, 2]), array("q", [0, 1, 1]), array("d", weights), 1)
    with pytest.raises(WorkError, match="denominator"):
        kind("ab", [1, 0], [0, 1], [Fraction(1, 3**40_000), Fraction(1, 2**60_000)], 1).row(0)


def test_arrays_are_taken_where_edges_are_many(monkeypatch: pytest.MonkeyPatch):
    pair = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    certificate = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), asks=Asks(simulation=False))
    data = json.loads(certificate.to_json())
    for many, stdlib, kind in ((10_000, False, Digraph), (1, False, ArrayDigraph), (1, True, Digraph)):
        monkeypatch.setattr("ptcc_certify.checker.graph.MANY_EDGES", many)
        doc = Document(data, SideFiles(Path(), {}), arithmetic(stdlib))
        doc.begin(GraphCertificate, {})
        assert type(check_graph(doc)) is kind
