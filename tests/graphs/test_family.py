"""Families of signed digraphs: what is taken, what is refused, and that names and orders do not count."""

from __future__ import annotations

import json
import random
from fractions import Fraction
from io import StringIO

import numpy as np
import pytest

from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.difference import family_difference, mode_order
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_family, read_family
from ptcc_certify.graphs.io.conversion import is_family
from ptcc_certify.graphs.io.family_files import keywords_of
from tests.families import KINDS, random_family

GRAPH = SignedDigraph.from_edges([("a", "b", 2), ("b", "c", -3)])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Family.from_intervals([("a", "b", 2, 1)]), "least weight 2 is above the largest"),
        (lambda: Family.from_intervals([("a", "b", 0, 0)]), "its weight is always 0"),
        (lambda: Family.from_intervals([("a", "a", 1, 2)]), "a"),
        (lambda: Family.from_intervals([("a", "b", 1, 2), ("a", "b", 1, 3)]), "a -> b"),
        (lambda: Family.from_intervals([("a", "b", 1, 2), ("a", "b", -2, -1)]), "both signs in one mode"),
        (lambda: Family.from_intervals([("a", "b", -1, 1), ("a", "b", 2, 3)]), "a -> b"),
        (lambda: Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 2)], undirected=True), "->"),
        (lambda: Family.from_intervals([("a", "b", 1)]), "is not (source, target, least, largest)"),
        (lambda: Family.from_intervals([("a", "b", "nan", 1)]), 'edge a -> b: "nan"'),
        (lambda: Family.from_intervals([("a", "b", 1, float("inf"))]), "edge a -> b:"),
        (lambda: Family.from_intervals([("a", "b", 1, "x")]), "edge a -> b:"),
        (lambda: Family.from_intervals([("a", "b", 1, 2)], orientation="up"), 'orientation "up" is unknown'),
        (lambda: Family.from_intervals([]), "node"),
        (lambda: Family.switching({}), "at least one mode"),
        (lambda: Family(GRAPH), "Family.from_graph takes a graph"),
        (lambda: Family(()), "at least one"),
        (
            lambda: Family.switching({"day": GRAPH, "night": SignedDigraph.from_edges([("a", "b", 1)])}),
            "night has no node c",
        ),
        (
            lambda: Family.switching({"day": SignedDigraph.from_edges([("a", "b", 1)]), "night": GRAPH}),
            "day has no node c",
        ),
        (lambda: Family.from_graph(GRAPH, uncertainty=-1), "is not from 0 to 1"),
        (lambda: Family.from_graph(GRAPH, uncertainty=10), "write 10% if it is one"),
        (lambda: Family.from_graph(GRAPH, uncertainty="much"), "uncertainty = much"),
        (lambda: Family.from_graph(GRAPH, optional=[("c", "b")]), "c -> b is not in the graph"),
        (lambda: Family.from_graph(GRAPH, optional=["a"]), "is no pair of nodes"),
        (lambda: Family.from_graph(GRAPH, optional=[("a", "z")]), "is no pair of nodes"),
    ],
)
def test_a_bad_family_is_refused_in_one_line(make, words):
    with pytest.raises((GraphError, ParameterError)) as error:
        make()
    text = str(error.value)
    assert words in text
    assert "\n" not in text
    assert len(text) < 200


def test_a_mode_without_edges_and_a_single_node_are_families():
    outage = SignedDigraph.from_edges([], nodes="abc")
    assert len(Family.switching([GRAPH, outage]).modes) == 2
    assert Family.from_intervals([], nodes=["a"]).n_nodes == 1


def test_a_graph_is_a_family_of_one_mode_and_keeps_its_hash():
    assert Family.from_graph(GRAPH).sha256 == GRAPH.sha256
    assert Family.from_graph(GRAPH).graph == GRAPH


def test_a_member_has_no_pair_with_both_signs():
    mode = Family.from_intervals([("a", "b", -1, 2)]).modes[0]
    assert mode.member(np.array([True, False])).edges == (("a", "b", Fraction(-1)),)
    with pytest.raises(GraphError):
        mode.member(np.array([True, True]))


def test_all_members_lie_in_the_intervals():
    for seed in range(60):
        rng = random.Random(seed)
        for mode in random_family(rng, KINDS[seed % len(KINDS)], wide=seed % 2 == 0).family.modes:
            same = np.array([False, *((mode.source[1:] == mode.source[:-1]) & (mode.target[1:] == mode.target[:-1]))])
            largest = np.array([rng.random() < 0.5 for _ in same], dtype=bool) & ~same
            intervals = {}
            for edge in range(mode.n_edges):
                pair = mode.labels[mode.source[edge]], mode.labels[mode.target[edge]]
                intervals.setdefault(pair, []).append(mode.edge_interval(edge))
            for source, target, weight in mode.member(largest).edges:
                assert any(low <= weight <= high for low, high in intervals[source, target])


def test_the_order_of_nodes_and_rows_changes_neither_family_nor_hash():
    rows = [("a", "b", 1, 2), ("c", "b", -1, 1), ("b", "a", "1/3", "1/2")]
    one = Family.from_intervals(rows)
    other = Family.from_intervals(rows[::-1], nodes="cba")
    assert one == other
    assert hash(one) == hash(other)
    assert Family.switching([one, other]).modes[1].labels == one.labels
    assert Family.switching([one, other]).modes[0].edge_interval(0) == Family.switching([one, other]).modes[
        1
    ].edge_interval(0)


def test_undirected_edges_are_one_parameter_for_both_directions():
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 3, 3)], undirected=True)
    assert family.modes[0].parameters.size == 1
    assert family.modes[0].n_edges == 4


def test_no_file_takes_the_place_of_another_of_the_same_name(tmp_path):
    paths = [tmp_path / folder / name for folder, name in (("1", "net.csv"), ("2", "net (3).csv"), ("3", "net.csv"))]
    for k, path in enumerate(paths, 1):
        path.parent.mkdir()
        path.write_text(f"a,b,{k}\n")
    family = read_family(paths)
    assert [mode.edge_interval(0)[0] for mode in family.modes] == [1, 2, 3]
    assert len({mode.name for mode in family.modes}) == 3


def test_intervals_take_no_uncertainty_besides():
    with pytest.raises(ParameterError, match="give intervals themselves"):
        as_family([("a", "b", 1, 2)], uncertainty="50%")


def test_the_names_of_modes_do_not_count_and_their_order_counts_for_the_hash_alone():
    day, night = ([("a", "b", 1)], [("b", "a", -1)])
    one, named = as_family({"day": day, "night": night}), as_family({"1": day, "2": night})
    turned, other = as_family({"night": night, "day": day}), as_family({"day": day, "night": day})
    assert one == named and one != turned
    assert mode_order(one, turned) == (1, 0) and family_difference(one, turned) is None
    assert mode_order(one, other) is None
    assert family_difference(one, other) == (
        'in mode night ["b", "a", "-1"] is only in the certificate, and ["a", "b", "1"] is only in the files'
    )


def test_families_that_differ_in_how_often_a_mode_occurs_are_told_apart():
    day, night = ([("a", "b", 1)], [("b", "a", -1)])
    one, other = (as_family(dict(zip("123", modes, strict=True))) for modes in ((day, day, night), (day, night, night)))
    assert "in mode 2 " in family_difference(one, other)
    edge = ("a", "b", 1, 2)
    tied = Family.from_intervals([edge], undirected=True)
    apart = Family.from_intervals([edge, ("b", "a", 1, 2)])
    assert family_difference(tied, apart) == '{"undirected": true} is only in the certificate'


def test_a_family_knows_how_its_files_were_read(tmp_path):
    path = tmp_path / "net.csv"
    path.write_text("a,b,1\nb,c,2\n")
    family = read_family([path], uncertainty="10%", optional=[("b", "a")], undirected=True, orientation="listens")
    assert read_family([path], **family.read) == family
    assert family.read == keywords_of(json.loads(json.dumps(family.read)))
    assert Family.from_intervals([("a", "b", 1, 2)]).read == {}


@pytest.mark.parametrize(
    "read",
    [None, [], {"format": "csv"}, {"uncertainty": 0.1}, {"optional": [["a"]]}, {"optional": "ab"}, {"undirected": 1}],
)
def test_what_no_certificate_writes_is_no_way_of_reading(read):
    assert keywords_of(read) == {}


def test_attributes_of_networkx_edges_make_a_family(tmp_path):
    nx = pytest.importorskip("networkx")
    plain, unsure = nx.DiGraph(), nx.DiGraph()
    plain.add_edge("a", "b", weight=2)
    unsure.add_node("alone")
    unsure.add_edge("a", "b", weight=2, optional=True)
    unsure.add_edge("b", "a", weight_min=-3, weight_max=-1)
    (mode,) = as_family(unsure).modes
    assert [mode.edge_interval(k) for k in range(2)] == [(-3, -1), (0, 2)] and "alone" in mode.labels
    assert as_family(plain).graph == SignedDigraph.from_edges([("a", "b", 2)])
    assert is_family(unsure) and not is_family(plain) and is_family([plain, plain])
    with pytest.raises(GraphError, match=r"optional.*makes a family of graphs"):
        SignedDigraph.from_networkx(unsure)
    with pytest.raises(ParameterError, match="leave out the uncertainty"):
        as_family(unsure, uncertainty="10%")
    for attributes in ({"weight_min": 1}, {"optional": True}):
        with pytest.raises(GraphError, match=r"edge a -> b: it has no weight|one end of the intervals"):
            as_family(nx.DiGraph([("a", "b", attributes)]))
    for name, write in (("g.graphml", nx.write_graphml), ("g.gml", lambda g, p: nx.write_gml(g, p, stringizer=str))):
        write(unsure.subgraph("ab"), tmp_path / name)
        with pytest.raises(FormatError, match="which makes a family of graphs; as a CSV file"):
            read_family(tmp_path / name)


def test_a_weight_beside_an_interval_lies_in_it():
    pandas = pytest.importorskip("pandas")
    for weight, taken in (("9", False), ("1", True), ("", True), ("n/a", True)):
        text = f"source,target,weight,weight_min,weight_max\na,b,{weight},0.5,2\n"
        for read in (lambda t: read_family(StringIO(t)), lambda t: as_family(pandas.read_csv(StringIO(t)))):
            if taken:
                assert read(text).modes[0].edge_interval(0) == (Fraction(1, 2), 2)
            else:
                with pytest.raises(GraphError, match="weight 9 lies outside of its interval, 1/2 to 2"):
                    read(text)


def test_modes_that_share_a_name_are_told_apart_one_by_one():
    graphs = [SignedDigraph.from_edges([("a", "b", weight)]) for weight in range(1, 9)]
    twice = Family.switching([Family.switching({"day": graphs[k], "x": graphs[k + 1]}) for k in (0, 2)])
    other = Family.switching(dict(zip(("day", "u", "v", "w"), graphs[4:], strict=True)))
    assert [mode.name for mode in twice.modes] == ["day", "x", "day", "x"]
    expected = 'in mode day (one of 4 that differ) ["a", "b", "1"] is only in the certificate, and '
    assert family_difference(twice, other) == expected + '["a", "b", "5"] is only in the files'
