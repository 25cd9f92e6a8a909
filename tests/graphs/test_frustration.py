"""The distance from balance against all camps, against what is known of real graphs, and its witnesses one by one."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc as command
from generators import WEIGHTS, Made, made_graphs
from hypothesis import given, settings
from hypothesis import strategies as st

import ptcc_certify as ptcc
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs import frustration
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.frustration import FrustrationIndex, frustration_index

Tie = tuple[frozenset[int], int]


def ties_of(graph: SignedDigraph, by: str) -> dict[Tie, Fraction]:
    """What each pair weighs, by sign: its arcs together, or one of them where the graph is undirected."""
    weights: Counter[Tie] = Counter()
    place = {label: k for k, label in enumerate(graph.labels)}
    arcs = {(place[s], place[t]): w for s, t, w in graph.edges}
    undirected = all(arcs.get((t, s)) == w for (s, t), w in arcs.items())
    for (s, t), w in arcs.items():
        if s < t or not undirected:
            weights[frozenset((s, t)), 1 if w > 0 else -1] += abs(w) if by == "weight" else Fraction(1)
    return dict(weights)


def least_over_all_camps(graph: SignedDigraph, by: str) -> Fraction:
    """The definition: every assignment of camps is tried."""
    ties = ties_of(graph, by)
    scale = math.lcm(*(weight.denominator for weight in ties.values()))
    camps = np.array([(1, *others) for others in product((1, -1), repeat=graph.n_nodes - 1)])
    against = np.zeros(len(camps), dtype=object)
    for (pair, sign), weight in ties.items():
        s, t = pair
        against[camps[:, s] * camps[:, t] != sign] += int(weight * scale)
    return Fraction(int(against.min()), scale)


def check_witnesses(graph: SignedDigraph, found: FrustrationIndex) -> None:
    """Camps make the upper bound; cycles close, are negative, and use no tie for more than it weighs."""
    ties, camps = ties_of(graph, found.by), found.camps.tolist()
    against = {tie for tie in ties if math.prod(camps[k] for k in tie[0]) != tie[1]}
    assert sum((ties[tie] for tie in against), Fraction(0)) == found.upper
    ends = [(frozenset((int(graph.source[e]), int(graph.target[e]))), int(graph.sign[e])) for e in found.edges]
    assert set(ends) == against and len(set(found.edges)) == len(found.edges)
    used: Counter[Tie] = Counter()
    for cycle in found.cycles:
        assert math.prod(cycle.signs) == -1 and cycle.share > 0 and len(set(cycle.nodes)) == len(cycle.nodes)
        for here, there, sign in zip(cycle.nodes, cycle.nodes[1:] + cycle.nodes[:1], cycle.signs, strict=True):
            used[frozenset((here, there)), sign] += cycle.share
    assert all(share <= ties[tie] for tie, share in used.items())
    unit = Fraction(1, math.lcm(*(weight.denominator for weight in ties.values())))
    total = sum((cycle.share for cycle in found.cycles), Fraction(0))
    assert total <= found.lower < total + unit
    assert found.lower % unit == 0 and found.total == sum(ties.values())


def judge(graph: SignedDigraph) -> None:
    """By count and by weight: bounds hold, witnesses are witnesses, and what is left is balanced."""
    for by in ("count", "weight"):
        found = frustration_index(graph, by)
        check_witnesses(graph, found)
        if graph.n_nodes <= 9:
            least = least_over_all_camps(graph, by)
            assert found.lower <= least <= found.upper
            assert found.exact or by == "weight"
            assert float(found.lower) == pytest.approx(float(least), rel=1e-6)
            assert not found.reported or found.upper == least
        ends = zip(graph.source[[*found.edges]].tolist(), graph.target[[*found.edges]].tolist(), strict=True)
        assert ptcc.analyse(graph.without_edges(*ends)).balanced
        assert (found.upper == 0) == ptcc.analyse(graph).balanced


@given(made_graphs(max_nodes=8, weights=sorted(WEIGHTS)))
@settings(max_examples=10, deadline=None)
def test_the_bounds_of_every_class_hold_and_without_the_edges_the_graph_is_balanced(made: Made):
    judge(made.graph)


def random_signed(seed: int, n: int, undirected: bool, weight: str) -> SignedDigraph:
    """A dense graph of random signs, whose weights follow one of the laws."""
    rng = np.random.default_rng(seed)
    arcs = [(s, t) for s in range(n) for t in range(n) if s != t and (s < t or not undirected) and rng.random() < 0.7]
    edges = [(s, t, WEIGHTS[weight](rng) * int(rng.choice([-1, 1]))) for s, t in arcs]
    return SignedDigraph.from_edges(edges + [(t, s, w) for s, t, w in edges if undirected], nodes=range(n))


@given(st.integers(0, 2**32 - 1), st.integers(2, 8), st.booleans(), st.sampled_from(sorted(WEIGHTS)))
@settings(max_examples=10, deadline=None)
def test_the_bounds_of_dense_graphs_hold(seed: int, n: int, undirected: bool, weight: str):
    judge(random_signed(seed, n, undirected, weight))


@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.sampled_from(sorted(WEIGHTS)))
@settings(max_examples=15, deadline=None)
def test_weak_imbalance_means_slow_stability(seed: int, n: int, weight: str):
    graph = random_signed(seed, n, True, weight)
    slowest = np.linalg.eigvalsh(graph.dense_laplacian())[0]
    bound = 4 * float(least_over_all_camps(graph, "weight")) / n
    assert slowest <= bound * (1 + 1e-9) + 1e-12 * abs(graph.weights).max(initial=0)


def test_sixteen_tribes_are_seven_ties_from_balance():
    found = frustration_index("highland_tribes")
    assert (found.lower, found.upper, found.undirected, found.total) == (7, 7, True, 58)
    assert len(found.edges) == 14
    check_witnesses(found.graph, found)


@pytest.mark.parametrize(("n", "least"), [(3, 1), (4, 2), (5, 4), (6, 6), (7, 9)])
def test_all_enemies_are_as_far_from_balance_as_two_halves_have_ties(n: int, least: int):
    """``F = floor((n-1)^2 / 4)`` of the complete graph of negative ties: Petersdorf (1966)."""
    found = frustration_index([(s, t, -1) for s in range(n) for t in range(n) if s != t])
    assert found.upper == least and found.lower <= least and found.undirected
    assert found.exact or found.reported  # an integer program closes what a packing leaves open, unproved
    check_witnesses(found.graph, found)


def test_a_large_complete_graph_is_left_open_by_packings_and_told_so():
    found = frustration_index([(s, t, -1) for s in range(8) for t in range(8) if s != t])
    assert (found.lower, found.upper, found.reported) == (10, 12, True)  # 28 ties, three in a triangle
    assert "from 10 to 12" in repr(found)


def test_an_undirected_pair_counts_once_and_arcs_each():
    pair = [("a", "b", 2), ("b", "a", 2)]
    triangle = [*pair, ("b", "c", 3), ("c", "b", 3), ("a", "c", -1), ("c", "a", -1)]
    assert [frustration_index(triangle, by).upper for by in ("count", "weight")] == [1, 1]
    one_way = [*triangle, ("c", "d", 1)]
    assert [frustration_index(one_way, by).upper for by in ("count", "weight")] == [2, 2]
    lonely = frustration_index(SignedDigraph.from_edges([], nodes=["a"]))
    assert lonely.exact and lonely.upper == 0 and lonely.total == 0 and lonely.cycles == ()


def test_what_is_found_within_no_time_holds():
    graph = random_signed(7, 60, False, "log6")
    for by in ("count", "weight"):
        found = frustration_index(graph, by, time_limit=1e-9)
        check_witnesses(graph, found)
        assert found.lower < found.upper and not found.reported


def test_a_packing_that_is_none_is_refused():
    ties = frustration._Ties(
        ptcc.as_graph([("a", "b", 1), ("b", "a", -1), ("b", "c", 1), ("c", "a", 1)]), "count", False
    )
    assert [int(s) for s in ties.sign] == [1, -1, 1, 1]  # a-b, a-b, a-c, b-c
    assert ties.bound_of({(0, 1): Fraction(1)}) == 1 and ties.bound_of({(1, 2, 3): Fraction(1, 3)}) == 1
    for wrong in ({(0, 1): Fraction(2)}, {(0, 1): Fraction(-1)}, {(0, 1): Fraction(1), (1, 2, 3): Fraction(1, 9)}):
        with pytest.raises(ArithmeticError, match="more than it weighs"):
            ties.bound_of(wrong)
    for wrong in ({(0, 2, 3): Fraction(1)}, {(1, 2): Fraction(1)}, {(1,): Fraction(1)}):
        with pytest.raises(ArithmeticError, match=r"positive|meet|two ties"):
            ties.bound_of(wrong)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"by": "size"}, "by = 'size'"),
        ({"time_limit": 0}, "seconds must be positive"),
        ({"time_limit": math.nan}, "sec"),
    ],
)
def test_what_makes_no_sense_is_refused(options: Any, message: str):
    with pytest.raises(ParameterError, match=message):
        frustration_index("fig1a", **options)


def test_weights_without_a_short_common_denominator_are_counted_only():
    primes = [p for p in range(2, 6000) if all(p % q for q in range(2, int(p**0.5) + 1))]
    graph = SignedDigraph.from_edges([(k, k + 1, Fraction(1, p)) for k, p in enumerate(primes)])
    with pytest.raises(ParameterError, match='round them, or give "count"'):
        frustration_index(graph, "weight")
    assert frustration_index(graph).upper == 0


# ---------------------------------------------------------------------- the command


def test_the_command_writes_what_spoils_balance(tmp_path: Path):
    run = command("balance", "highland_tribes", "-o", str(tmp_path / "spoiling.csv"))
    assert run.code == 0 and "balance    frustration index 7 of 58 pairs (proved)" in run.out
    assert "spoiled by 7 pairs: " in run.out and "written" in run.out
    rows = list(csv.DictReader((tmp_path / "spoiling.csv").open()))
    edges = [(row["source"], row["target"]) for row in rows]
    assert len(edges) == 14 and ptcc.analyse(ptcc.as_graph("highland_tribes").without_edges(*edges)).balanced
    told = json.loads(command("balance", "highland_tribes", "--by", "weight", "--json").out)["parts"]
    assert [(part["by"], part["lower"], part["upper"], part["exact"]) for part in told] == [("weight", "7", "7", True)]


def test_the_command_tells_of_groups():
    run = command("balance", "fig5a", "--groups")
    assert run.code == 0 and "leaders    4, 5, 6" in run.out and "frustration index 1 of 4 arcs (proved)" in run.out
    assert "every leader group is balanced" in command("balance", "fig1b", "--groups").out
    assert "the graph is balanced: frustration index 0" in command("balance", "fig1b").out
    assert json.loads(command("balance", "fig1b", "--groups", "--json").out) == {"parts": []}


def test_the_long_screen_of_classify_has_a_line():
    assert "balance    frustration index 3 of 12 arcs (proved)" in command("classify", "fig1a", "-v").out
    assert "frustration" not in command("classify", "fig1a").out + command("classify", "fig1b", "-v").out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fig1a", "-o", "spoiling.png"], "let the name end in .csv"),
        (["fig1a", "--time-limit", "0"], "--time-limit"),
        (["fig1a", "--by", "size"], "--by"),
        (["nowhere.csv"], "nowhere.csv"),
    ],
)
def test_the_command_refuses_in_one_line(words: list[str], message: str):
    run = command("balance", *words)
    assert run.code == 2 and message in run.err and run.out == "" and len(run.err.strip().splitlines()) == 1
