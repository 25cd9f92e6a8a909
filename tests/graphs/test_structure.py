"""The structure of a signed digraph against the bare definitions, against networkx, and against its invariances."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from zlib import crc32

import networkx as nx
import numpy as np
import pytest
from generators import WEIGHTS, Made, all_classes, made_graphs, random_graph, smallest, sparse_digraph
from hypothesis import given, settings
from hypothesis import strategies as st
from selection import thinned

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.structure import BEHAVIOURS, Structure, WeakComponent, analyse, behaviour_name
from ptcc_certify.theorems.claims import Claim

Pair = tuple[int, int]
Weighted = dict[Pair, Fraction]  # (source, target) -> weight

CLASSES = dict(all_classes())
PER_CLASS = 13


def weights_of(graph: SignedDigraph) -> Weighted:
    """The edges by node index, read through labels."""
    place = {label: i for i, label in enumerate(graph.labels)}
    return {(place[s], place[t]): w for s, t, w in graph.edges}


# ---------------------------------------------------------------------- the definitions, by brute force


@dataclass(frozen=True)
class ComponentTruth:
    """What the theorems say of one weakly connected component."""

    nodes: tuple[int, ...]
    connectivity: str
    closed: tuple[tuple[tuple[int, ...], tuple[int, ...] | None], ...]  # (nodes, gauge or None), by smallest node
    balanced: bool
    claim: Claim
    behaviours: frozenset[str]  # which hold for almost every start


def closure(n: int, pairs: Iterable[Pair]) -> list[list[bool]]:
    """Warshall's reflexive transitive closure."""
    reach = [[i == j for j in range(n)] for i in range(n)]
    for a, b in pairs:
        reach[a][b] = True
    for k in range(n):
        for i in range(n):
            if reach[i][k]:
                reach[i] = [x or y for x, y in zip(reach[i], reach[k], strict=True)]
    return reach


def gauge_by_trial(nodes: tuple[int, ...], weight: Weighted) -> tuple[int, ...] | None:
    """Try all camps of connected ``nodes``; the first node is +1, which makes the answer unique."""
    edges = [(nodes.index(a), nodes.index(b), w > 0) for (a, b), w in weight.items() if a in nodes and b in nodes]
    for rest in product((1, -1), repeat=len(nodes) - 1):
        gauge = (1, *rest)
        if all((gauge[a] == gauge[b]) == same for a, b, same in edges):
            return gauge
    return None


def truth(n: int, weight: Weighted) -> list[ComponentTruth]:
    """Every weak component from the definitions."""
    reach = closure(n, weight)
    weakly = closure(n, [*weight, *((b, a) for a, b in weight)])
    strong_of = [tuple(j for j in range(n) if reach[i][j] and reach[j][i]) for i in range(n)]
    weak_of = [tuple(j for j in range(n) if weakly[i][j]) for i in range(n)]
    closed_sets = [
        c for c in sorted(set(strong_of)) if not any(b in c and a not in c for a, b in weight)
    ]  # nobody inside listens out
    result = []
    for nodes in sorted(set(weak_of)):
        own = {edge: w for edge, w in weight.items() if edge[0] in nodes}
        if all(reach[i][j] for i in nodes for j in nodes):
            connectivity = "strong"
        elif any(all(reach[i][j] for j in nodes) for i in nodes):  # a root
            connectivity = "quasi-strong"
        else:
            connectivity = "weak"
        closed = tuple((c, gauge_by_trial(c, own)) for c in closed_sets if c[0] in nodes)
        balanced = all(gauge for _, gauge in closed) and gauge_by_trial(nodes, own) is not None
        claim, behaviours = theorem_table(connectivity, [g is not None for _, g in closed], balanced, own)
        result.append(ComponentTruth(nodes, connectivity, closed, balanced, claim, behaviours))
    return result


def theorem_table(
    connectivity: str, csc_balanced: list[bool], balanced: bool, weight: Weighted
) -> tuple[Claim, frozenset[str]]:
    """The table of theorems and corollaries, row by row."""
    some = any(csc_balanced)
    positive = all(w > 0 for w in weight.values())
    undirected = all(weight.get((b, a)) == w for (a, b), w in weight.items())
    rows = {
        ("strong", True): ("1.1", "bipartite consensus"),
        ("strong", False): ("1.2", "stability"),
        ("quasi-strong", True): ("2.1", "interval bipartite consensus"),
        ("quasi-strong", False): ("2.2", "stability"),
        ("weak", True): ("3.1", "bipartite containment"),
        ("weak", False): ("3.2", "stability"),
    }
    theorem, behaviour = rows[connectivity, some]
    extra = []  # (corollary, special behaviour)
    if theorem == "1.1" and undirected:
        extra.append(("1.1", "signed-average consensus"))
    if theorem == "1.1" and positive:
        extra.append(("2", "consensus"))
    if theorem == "2.1" and balanced:
        extra.append(("3", "bipartite consensus"))
    if theorem == "2.1" and positive:
        extra.append(("4", "consensus"))
    if theorem == "3.1" and positive:
        extra.append(("5", "containment"))
    corollaries = tuple(name for name, _ in extra)
    if theorem == "1.2" and undirected:
        corollaries = ("1.2",)
    claim = Claim(theorem, behaviour, corollaries, tuple(word for _, word in extra))
    facts = {
        "stability": not some,
        "bipartite consensus": len(csc_balanced) == 1 and some and balanced,
        "interval bipartite consensus": len(csc_balanced) == 1 and some,
        "bipartite containment": some,
        "consensus": len(csc_balanced) == 1 and positive,
        "signed-average consensus": connectivity == "strong" and some and undirected,
        "containment": positive,
    }
    return claim, frozenset(name for name, holds in facts.items() if holds)


def assert_negative_cycle(cycle: tuple[Pair, ...] | None, weight: Weighted, inside: Iterable[int]) -> None:
    """A closed walk of existing edges, either way, whose signs multiply to -1, within ``inside``, no node twice."""
    assert cycle
    nodes = {v for edge in cycle for v in edge}
    assert nodes <= set(inside)
    assert len(nodes) == len(cycle) == len(set(cycle))
    negative = sum(weight[edge] < 0 for edge in cycle)  # KeyError: no such edge
    assert negative % 2 == 1

    def walk(start: int) -> int | None:
        at = start
        for a, b in cycle:
            if at not in (a, b):
                return None
            at = b if at == a else a
        return at

    assert any(walk(start) == start for start in cycle[0])


def assert_agrees(structure: Structure, n: int, weight: Weighted) -> None:
    """Every field of ``structure`` is what the definitions say."""
    expected = truth(n, weight)
    reach, weakly = closure(n, weight), closure(n, [*weight, *((b, a) for a, b in weight)])
    strong, weak = structure.strong_component.tolist(), structure.weak_component.tolist()
    for i in range(n):
        for j in range(n):
            assert (strong[i] == strong[j]) == (reach[i][j] and reach[j][i])
            assert (weak[i] == weak[j]) == weakly[i][j]
    assert structure.connectivity == (expected[0].connectivity if len(expected) == 1 else "disconnected")

    closed = sorted(pair for part in expected for pair in part.closed)
    assert [c.nodes for c in structure.closed_components] == [nodes for nodes, _ in closed]
    for component, (nodes, gauge) in zip(structure.closed_components, closed, strict=True):
        assert component.balanced == (gauge is not None)
        assert component.gauge == gauge
        if gauge is None:
            assert_negative_cycle(component.negative_cycle, weight, nodes)
        else:
            assert component.negative_cycle is None

    leaders = [v for nodes, _ in closed for v in nodes]
    assert structure.leaders.tolist() == leaders
    assert structure.followers.tolist() == [v for v in range(n) if v not in leaders]

    assert structure.balanced == all(part.balanced for part in expected)
    if structure.balanced:
        gauge = structure.gauge.tolist()
        assert set(gauge) <= {1, -1}
        assert all(w * gauge[a] * gauge[b] > 0 for (a, b), w in weight.items())
        assert all(gauge[part.nodes[0]] == 1 for part in expected)
        assert structure.negative_cycle is None
    else:
        assert structure.gauge is None
        assert_negative_cycle(structure.negative_cycle, weight, range(n))

    assert structure.sign_symmetric == all(w * weight.get((b, a), Fraction(0)) >= 0 for (a, b), w in weight.items())
    assert structure.undirected == all(w == weight.get((b, a)) for (a, b), w in weight.items())
    assert structure.all_positive == all(w > 0 for w in weight.values())

    assert [c.nodes for c in structure.components] == [part.nodes for part in expected]
    for component, part in zip(structure.components, expected, strict=True):
        assert component.connectivity == part.connectivity
        assert [structure.closed_components[i].nodes for i in component.closed] == [nodes for nodes, _ in part.closed]
        assert component.claim == part.claim
        for name in BEHAVIOURS:
            assert component.claim.holds(name) == (name in part.behaviours), name
            assert component.claim.holds(name.replace(" ", "-")) == (name in part.behaviours), name
    assert structure.claim == (expected[0].claim if len(expected) == 1 else None)
    for name in BEHAVIOURS:
        assert structure.holds(name) == all(
            name in part.behaviours or (name == "signed-average consensus" and meets_at_its_average(part, weight))
            for part in expected
        )


def meets_at_its_average(part: ComponentTruth, weight: Weighted) -> bool:
    """Strong and balanced, and every node speaks as loudly as it listens: the left null vector is uniform."""
    if part.claim.theorem != "1.1":
        return False
    heard = [sum(abs(w) for (_, b), w in weight.items() if b == v) for v in part.nodes]
    spoken = [sum(abs(w) for (a, _), w in weight.items() if a == v) for v in part.nodes]
    return heard == spoken


def assert_as_constructed(structure: Structure, made: Made) -> None:
    assert structure.connectivity == made.connectivity
    assert {(frozenset(c.nodes), c.balanced) for c in structure.closed_components} == made.closed
    assert {(frozenset(c.nodes), c.connectivity, c.claim.theorem) for c in structure.components} == {
        (part.nodes, part.connectivity, part.theorem) for part in made.parts
    }
    for value, wanted in (
        (structure.balanced, made.whole_balanced),
        (structure.all_positive, made.all_positive),
        (structure.undirected, made.undirected),
        (structure.sign_symmetric, made.sign_symmetric),
    ):
        assert wanted is None or value == wanted


def constructed(name: str) -> Iterator[Made]:
    """``PER_CLASS`` graphs of one class: every size from the smallest to 12, every law of weights, sparse to dense."""
    kwargs = CLASSES[name]
    rng = np.random.default_rng(crc32(name.encode()))
    least, laws = smallest(**kwargs), list(WEIGHTS)
    fixed = "n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])
    for i in range(PER_CLASS):
        n = least if fixed else least + i % (max(least, 12) - least + 1)
        changes = {"n": n, "weights": laws[i % len(laws)]}
        if "negative" not in kwargs:
            changes["negative"] = (0.3, 0.5, 0.1, 0.9)[i % 4]
        yield random_graph(rng, **(kwargs | changes))


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(CLASSES, 2))
def test_every_field_agrees_with_the_definitions_and_with_the_construction(name):
    for made in constructed(name):
        structure = analyse(made.graph)
        assert_as_constructed(structure, made)
        assert_agrees(structure, made.graph.n_nodes, weights_of(made.graph))


@pytest.mark.few(0)
def test_the_constructed_graphs_cover_every_class_and_size():
    cells, theorems, sizes, mixtures = Counter(), Counter(), Counter(), set()
    for name in CLASSES:
        for made in constructed(name):
            balances = {balanced for _, balanced in made.closed}
            balance = "mixed" if len(balances) == 2 else "balanced" if True in balances else "unbalanced"
            cells[made.connectivity, balance] += 1
            theorems.update(made.theorems)
            sizes[made.graph.n_nodes] += 1
            mixtures.add(tuple(sorted(set(made.theorems))))
    assert sum(cells.values()) >= 1000
    assert set(cells) == {
        *product(("strong", "quasi-strong"), ("balanced", "unbalanced")),
        *product(("weak", "disconnected"), ("balanced", "unbalanced", "mixed")),
    }
    assert min(cells.values()) >= 50
    assert set(theorems) == {"1.1", "1.2", "2.1", "2.2", "3.1", "3.2"}
    assert set(sizes) == set(range(1, 13))
    assert len([m for m in mixtures if len(m) > 1]) >= 12


@pytest.mark.few(0)
@pytest.mark.parametrize("negative", thinned([0.15, 0.0, 0.5, 1.0], 2))
def test_random_sign_matrices_agree_with_the_definitions(negative):
    rng = np.random.default_rng(int(100 * negative))
    for i in range(150):
        n = 1 + i % 12
        density = float(rng.choice([0.5, 1.0, 1.5, 3.0])) / n
        matrix = (rng.random((n, n)) < density) * np.where(rng.random((n, n)) < negative, -1, 1)
        np.fill_diagonal(matrix, 0)
        if i % 5 == 0:  # undirected
            matrix = np.triu(matrix) + np.triu(matrix).T
        weight = {(j, k): Fraction(int(matrix[k, j])) for k in range(n) for j in range(n) if matrix[k, j]}
        assert_agrees(analyse(SignedDigraph.from_matrix(matrix, orientation="listens")), n, weight)


# ---------------------------------------------------------------------- against networkx


def partition(numbers: np.ndarray) -> set[frozenset[int]]:
    groups: dict[int, set[int]] = {}
    for node, number in enumerate(numbers.tolist()):
        groups.setdefault(number, set()).add(node)
    return {frozenset(group) for group in groups.values()}


def balanced_parts(n: int, edges: Iterable[tuple[int, int, int]]) -> list[bool]:
    """Whether the weak component of each node is balanced: union-find on the double cover ``(v, +), (v, -)``."""
    parent = list(range(2 * n))

    def find(x: int) -> int:
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        return x

    for a, b, sign in edges:
        other = b if sign > 0 else b + n
        parent[find(a)] = find(other)
        parent[find(a + n)] = find((other + n) % (2 * n))
    torn = {min(find(v), find(v + n)) for v in range(n) if find(v) == find(v + n)}
    return [find(v) not in torn for v in range(n)]


@pytest.mark.few(0)
@pytest.mark.parametrize("negative", thinned([0.3, 0.001, 0.0], 3))
@pytest.mark.parametrize(
    ("mean_in_degree", "block"), thinned([(0.5, None), (1.0, None), (3.0, None), (1.5, 4), (2.0, 10)])
)
def test_large_sparse_graphs_agree_with_networkx(mean_in_degree, block, negative):
    n = 10_000
    rng = np.random.default_rng([int(10 * mean_in_degree), int(1000 * negative)])
    graph = sparse_digraph(rng, n, mean_in_degree, negative, block=block)
    structure = analyse(graph)
    if block and negative == 0.3:  # closed components of both kinds, of several nodes each
        several = Counter(c.balanced for c in structure.closed_components if len(c.nodes) > 1)
        assert min(several[False], several[True]) >= 20
    pairs = list(zip(graph.source.tolist(), graph.target.tolist(), strict=True))
    peer = nx.DiGraph()
    peer.add_nodes_from(range(n))
    peer.add_edges_from(pairs)

    assert partition(structure.strong_component) == {frozenset(c) for c in nx.strongly_connected_components(peer)}
    assert partition(structure.weak_component) == {frozenset(c) for c in nx.weakly_connected_components(peer)}
    condensed = nx.condensation(peer)
    sources = {frozenset(condensed.nodes[c]["members"]) for c in condensed if condensed.in_degree(c) == 0}
    assert {frozenset(c.nodes) for c in structure.closed_components} == sources
    assert sorted([*structure.leaders.tolist(), *structure.followers.tolist()]) == list(range(n))
    assert set(structure.leaders.tolist()) == set().union(*sources)

    signs = [(a, b, s) for (a, b), s in zip(pairs, graph.sign.tolist(), strict=True)]
    weight = {(a, b): Fraction(s) for a, b, s in signs}
    assert structure.balanced == all(balanced_parts(n, signs))
    if structure.balanced:
        assert (graph.sign * structure.gauge[graph.source] * structure.gauge[graph.target] > 0).all()
    else:
        assert_negative_cycle(structure.negative_cycle, weight, range(n))
    number = structure.strong_component.tolist()
    inner = balanced_parts(n, [edge for edge in signs if number[edge[0]] == number[edge[1]]])
    for component in structure.closed_components:
        assert component.balanced == inner[component.nodes[0]]
        if component.balanced:
            camp = dict(zip(component.nodes, component.gauge, strict=True))
            assert all(weight[e] * camp[e[0]] * camp[e[1]] > 0 for e in peer.subgraph(component.nodes).edges)
        else:
            assert_negative_cycle(component.negative_cycle, weight, component.nodes)


# ---------------------------------------------------------------------- invariances


def build(n: int, weight: Weighted) -> Structure:
    return analyse(SignedDigraph.from_edges([(a, b, w) for (a, b), w in weight.items()], range(n)))


def closed_sets(structure: Structure) -> set[tuple[frozenset[int], bool]]:
    return {(frozenset(c.nodes), c.balanced) for c in structure.closed_components}


def claims(components: Iterable[WeakComponent]) -> set[tuple[frozenset[int], str, Claim]]:
    return {(frozenset(c.nodes), c.connectivity, c.claim) for c in components}


def flags(structure: Structure) -> tuple[str, bool, bool, bool, bool]:
    s = structure
    return s.connectivity, s.balanced, s.sign_symmetric, s.undirected, s.all_positive


many = settings(max_examples=30, deadline=None)


@many
@given(made_graphs(), st.randoms(use_true_random=False))
def test_relabelling_permutes_the_structure_and_changes_nothing_else(made, random):
    n, weight, old = made.graph.n_nodes, weights_of(made.graph), analyse(made.graph)
    new_name = random.sample(range(n), n)

    def moved(groups):
        return {(frozenset(new_name[v] for v in nodes), *rest) for nodes, *rest in groups}

    new = build(n, {(new_name[a], new_name[b]): w for (a, b), w in weight.items()})
    assert flags(new) == flags(old)
    assert closed_sets(new) == moved(closed_sets(old))
    assert claims(new.components) == moved(claims(old.components))


@many
@given(made_graphs(), st.integers(0, 10**6))
def test_a_gauge_switch_at_one_node_keeps_balance_and_theorem(made, choice):
    n, weight, old = made.graph.n_nodes, weights_of(made.graph), analyse(made.graph)
    node = choice % n
    new = build(n, {edge: -w if node in edge else w for edge, w in weight.items()})
    assert flags(new)[:-1] == flags(old)[:-1]  # all but all_positive
    assert closed_sets(new) == closed_sets(old)
    for before, after in zip(old.components, new.components, strict=True):
        assert (after.nodes, after.connectivity) == (before.nodes, before.connectivity)
        assert (after.claim.theorem, after.claim.behaviour) == (before.claim.theorem, before.claim.behaviour)
        unsigned = {"1.1", "1.2", "3"}  # the corollaries that do not ask for positive weights
        assert set(after.claim.corollaries) & unsigned == set(before.claim.corollaries) & unsigned
    if old.balanced:
        switch = np.ones(n, dtype=int)
        switch[node] = -1
        root = {c: nodes.nodes[0] for c, nodes in enumerate(old.components)}
        first = switch[[root[c] for c in old.weak_component.tolist()]]
        assert (new.gauge == old.gauge * switch * first).all()


@many
@given(made_graphs(), st.sets(st.integers(0, 10**6), max_size=3))
def test_a_new_node_that_listens_to_nobody_becomes_a_leader(made, listeners):
    n, weight, old = made.graph.n_nodes, weights_of(made.graph), analyse(made.graph)
    listeners = {v % n for v in listeners}
    new = build(n + 1, weight | {(n, v): Fraction(-1) for v in listeners})
    assert n in new.leaders
    kept = {pair for pair in closed_sets(old) if not pair[0] & listeners}  # the others listen out now
    assert closed_sets(new) == kept | {(frozenset([n]), True)}
    if not listeners:
        alone = Claim("1.1", "bipartite consensus", ("1.1", "2"), ("signed-average consensus", "consensus"))
        assert claims(new.components) == claims(old.components) | {(frozenset([n]), "strong", alone)}


@many
@given(made_graphs(), st.sets(st.integers(0, 10**6), min_size=1, max_size=3))
def test_a_new_node_that_only_listens_becomes_a_follower(made, heard):
    n, weight, old = made.graph.n_nodes, weights_of(made.graph), analyse(made.graph)
    new = build(n + 1, weight | {(v % n, n): Fraction(-1) for v in heard})
    assert n in new.followers
    assert closed_sets(new) == closed_sets(old)
    assert new.followers.tolist() == [*old.followers.tolist(), n]


@many
@given(made_graphs(max_nodes=8), made_graphs(max_nodes=8))
def test_a_disjoint_union_unites_the_structures(first, second):
    n, one, two = first.graph.n_nodes, analyse(first.graph), analyse(second.graph)
    shifted = {(a + n, b + n): w for (a, b), w in weights_of(second.graph).items()}
    union = build(n + second.graph.n_nodes, weights_of(first.graph) | shifted)

    def moved(groups):
        return {(frozenset(v + n for v in nodes), *rest) for nodes, *rest in groups}

    assert union.connectivity == "disconnected"
    assert union.claim is None
    assert flags(union)[1:] == tuple(a and b for a, b in zip(flags(one)[1:], flags(two)[1:], strict=True))
    assert closed_sets(union) == closed_sets(one) | moved(closed_sets(two))
    assert claims(union.components) == claims(one.components) | moved(claims(two.components))
    for name in BEHAVIOURS:
        assert union.holds(name) == (one.holds(name) and two.holds(name))


@many
@given(made_graphs(weights=tuple(WEIGHTS)), st.fractions(Fraction(1, 10**6), 10**6))
def test_scaling_all_weights_changes_nothing(made, factor):
    factor = factor or Fraction(1)
    n, weight, old = made.graph.n_nodes, weights_of(made.graph), analyse(made.graph)
    new = build(n, {edge: factor * w for edge, w in weight.items()})
    assert flags(new) == flags(old)
    assert new.closed_components == old.closed_components
    assert new.components == old.components
    assert new.negative_cycle == old.negative_cycle


def test_undirected_is_decided_by_exact_weights():
    third = Fraction(1, 3)
    assert build(2, {(0, 1): third, (1, 0): Fraction(2, 6)}).undirected
    assert not build(2, {(0, 1): third, (1, 0): Fraction(float(third))}).undirected
    assert SignedDigraph.from_edges([("a", "b", "0.1"), ("b", "a", 0.1)]).weights.tolist() == [0.1, 0.1]
    assert not analyse(SignedDigraph.from_edges([("a", "b", "0.1"), ("b", "a", 0.1)])).undirected


# ---------------------------------------------------------------------- large graphs, names


def signed_ring(n: int, reverse: np.ndarray, negative: int) -> SignedDigraph:
    """A ring of ``n`` nodes; edges in ``reverse`` run backwards, edge number ``negative`` is negative."""
    here, there = np.arange(n), (np.arange(n) + 1) % n
    source, target = np.where(reverse, there, here), np.where(reverse, here, there)
    code = (np.arange(n) == negative).astype(np.int64)
    return SignedDigraph(map(str, range(n)), source, target, Weights([Fraction(1), Fraction(-1)], code))


@pytest.mark.few(0)
@pytest.mark.parametrize("turned", [False, True])
def test_the_witness_of_a_long_unbalanced_ring_goes_all_the_way_round(turned):
    n = 100_000
    reverse = np.random.default_rng(3).random(n) < 0.5 if turned else np.zeros(n, dtype=bool)
    graph = signed_ring(n, reverse, 12_345)
    structure = analyse(graph)
    assert structure.connectivity == ("weak" if turned else "strong")
    assert structure.claim.theorem == ("3.1" if turned else "1.2")
    weight = {
        (a, b): s for a, b, s in zip(graph.source.tolist(), graph.target.tolist(), graph.sign.tolist(), strict=True)
    }
    cycles = [structure.negative_cycle, *(c.negative_cycle for c in structure.closed_components if not c.balanced)]
    assert len(cycles) == (1 if turned else 2)
    for cycle in cycles:
        assert len(set(cycle)) == len(cycle) == n
        assert_negative_cycle(cycle, weight, range(n))


def test_a_long_chain_has_one_leader():
    n = 100_000
    graph = SignedDigraph(
        map(str, range(n)), np.arange(n - 1), np.arange(1, n), Weights([Fraction(-1)], np.zeros(n - 1, dtype=np.int64))
    )
    structure = analyse(graph)
    assert structure.leaders.tolist() == [0]
    assert (structure.gauge == np.where(np.arange(n) % 2, -1, 1)).all()
    assert structure.holds("bipartite-consensus")


@pytest.mark.campaign
def test_a_million_edges():
    graph = sparse_digraph(np.random.default_rng(5), 200_000, 5.0)
    structure = analyse(graph)
    assert structure.leaders.size + structure.followers.size == 200_000
    closed = structure.strong_component[structure.leaders]
    assert np.isin(structure.strong_component[graph.source], closed)[
        np.isin(structure.strong_component[graph.target], closed)
    ].all()
    assert not structure.balanced


def test_isolated_nodes_keep_their_state():
    structure = build(5, {})
    assert structure.leaders.tolist() == [0, 1, 2, 3, 4]
    assert all(c.gauge == (1,) for c in structure.closed_components)
    assert {c.claim.theorem for c in structure.components} == {"1.1"}


def test_behaviours_are_named_with_blanks_or_hyphens():
    for name in BEHAVIOURS:
        assert behaviour_name(name) == behaviour_name(name.replace(" ", "-")) == name
    with pytest.raises(ValueError, match="interval-bipartite-consensus"):
        behaviour_name("chaos")
    assert "; Theorem 2.1, Corollary 4: consensus)" in repr(build(2, {(0, 1): Fraction(1)}))
    assert "2 components" in repr(build(2, {}))
