"""Signed digraphs: one graph however it is built, exact weights, and nothing in it that is no signed digraph."""

from __future__ import annotations

import copy
import hashlib
import json
import pickle
from decimal import Decimal
from fractions import Fraction
from functools import partial
from itertools import product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from ptcc_certify.errors import GraphError, ParameterError, PTCCError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.labels import ordered_labels
from ptcc_certify.graphs.packed_weights import Weights

weight = st.one_of(
    st.integers(-(10**20), 10**20),
    st.fractions(max_denominator=10**15),
    st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False),
).filter(lambda w: w == w and 1e-300 < abs(w) < 1e300)


texts = st.text(max_size=4)


@st.composite
def edge_lists(draw, labels=texts):
    """Node labels and a dictionary (source, target) -> weight."""
    names = draw(st.lists(labels, min_size=1, max_size=6, unique=True))
    pairs = [(a, b) for a in names for b in names if a != b]
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True, max_size=12)) if pairs else []
    return names, {pair: Fraction(draw(weight)) for pair in chosen}


def build(names, weights, **options) -> SignedDigraph:
    return SignedDigraph.from_edges([(a, b, w) for (a, b), w in weights.items()], names, **options)


# ---------------------------------------------------------------------------------------------- weights and order


@pytest.mark.few(0)
@given(edge_lists())
def test_edges_come_back_exactly_sorted_by_listener(made):
    names, weights = made
    graph = build(names, weights)
    assert {(s, t): w for s, t, w in graph.edges} == weights
    assert sorted(graph.labels) == sorted(names)
    assert all(graph.index[label] == i for i, label in enumerate(graph.labels))
    position = [(graph.index[t], graph.index[s]) for s, t, _ in graph.edges]
    assert position == sorted(position)
    assert (graph.n_nodes, graph.n_edges) == (len(names), len(weights))
    for i, (_, _, w) in enumerate(graph.edges):
        assert graph.exact_weight(i) == w
        assert graph.weights[i] == float(w)
        assert graph.sign[i] == (1 if w > 0 else -1)


@given(edge_lists(), st.randoms(use_true_random=False))
def test_the_order_of_edges_and_nodes_changes_no_identity(made, random):
    names, weights = made
    shuffled, order = list(weights.items()), list(names)
    random.shuffle(shuffled)
    random.shuffle(order)
    one, other = build(names, weights), build(order, dict(shuffled))
    assert one == other and hash(one) == hash(other) and one.sha256 == other.sha256


@given(edge_lists(), st.data())
def test_another_weight_edge_node_or_direction_is_another_graph(made, data):
    names, weights = made
    graph = build(names, weights)
    assert graph != build([*names, "further"], weights)
    if weights:
        pair = data.draw(st.sampled_from(sorted(weights)))
        assert graph != build(names, weights | {pair: weights[pair] * Fraction(10**20 + 1, 10**20)})
        assert graph != build(names, {k: w for k, w in weights.items() if k != pair})
        mirrored = {(b, a): w for (a, b), w in weights.items()}
        assert (graph == build(names, mirrored)) == (mirrored == weights)


def test_equal_numbers_in_any_spelling_are_the_same_graph():
    spellings = [1 / 2, "0.5", "1/2", "0x1p-1", Fraction(1, 2), Decimal("0.50"), np.float32(0.5)]
    graphs = [SignedDigraph.from_edges([("a", "b", w)]) for w in spellings]
    assert len(set(graphs)) == 1
    assert SignedDigraph.from_edges([("a", "b", 0.1)]) != SignedDigraph.from_edges([("a", "b", "0.1")])
    assert graphs[0] != "a" and graphs[0] != None  # noqa: E711


def test_the_hash_is_that_of_the_written_list():
    graph = SignedDigraph.from_edges([("b", "ä", "-6/4"), ("ä", "b", 2)], nodes=["z"])
    lines = [["b"], ["z"], ["ä"], ["b", "ä", "-3/2"], ["ä", "b", "2"]]
    content = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
    assert graph.sha256 == hashlib.sha256(content.encode()).hexdigest()


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([1, -2, 3], "int64"),
        (["0.1", "-0.25", "1/3"], "int64"),
        ([0.1, 1e300], "float64"),
        ([2.0**80, 2.0**-80], "float64"),
        (["1/3", "1e30"], "object"),
        ([f"1/{p}" for p in (10**9 + 7, 10**9 + 9, 998244353)], "object"),
    ],
)
def test_weights_are_exact_in_the_smallest_form_that_holds_them(values, kind):
    graph = SignedDigraph.from_edges([(str(i), str(i + 1), v) for i, v in enumerate(values)])
    assert graph._weights.table.dtype.name == kind
    for i, value in enumerate(values):
        assert graph.exact_weight(i) == Fraction(value)
        assert graph.weights[i] == float(Fraction(value))


@given(st.lists(weight, min_size=1, max_size=8))
def test_packing_loses_nothing(values):
    values = [Fraction(v) for v in values]
    codes = np.arange(len(values))[::-1]
    packed = Weights(values, codes)
    assert [packed.fraction(i) for i in range(len(values))] == values[::-1]
    assert packed.as_float().tolist() == [float(v) for v in values[::-1]]
    assert packed.signs().tolist() == [1 if v > 0 else -1 for v in values[::-1]]
    assert packed.take(np.array([0])).fraction(0) == values[-1]


@pytest.mark.parametrize(
    ("labels", "ordered"),
    [
        (["10", "9", "-1"], ["-1", "9", "10"]),
        (["10", "9", "x"], ["10", "9", "x"]),
        (["2", "02", "1"], ["1", "02", "2"]),
        (["2", "1.5"], ["2", "1.5"]),
        (["2", "1 "], ["2", "1 "]),
        (["2", "٣", "1"], ["2", "٣", "1"]),
        ([], []),
    ],
)
def test_labels_that_are_all_integers_are_ordered_by_value(labels, ordered):
    result, rank = ordered_labels(labels)
    assert result == ordered
    assert [result[r] for r in rank] == labels


# ---------------------------------------------------------------------------------------------- matrices


@given(edge_lists())
def test_the_laplacian_is_the_signed_one(made):
    names, weights = made
    graph = build(names, weights)
    exact = graph.exact_laplacian()
    for k, l_ in product(range(graph.n_nodes), repeat=2):
        w = weights.get((graph.labels[l_], graph.labels[k]), Fraction(0))
        row = [w for (_, t), w in weights.items() if t == graph.labels[k]]
        assert exact[k][l_] == (sum(map(abs, row)) if k == l_ else -w)
    laplacian = graph.laplacian().toarray()
    assert np.allclose(laplacian, np.array(exact, dtype=float), rtol=1e-12, atol=0)
    assert np.array_equal(laplacian, np.diag(graph.in_weight()) - graph.adjacency().toarray())


@pytest.mark.few(0)
@given(edge_lists(st.integers(0, 30).map(str)))
def test_matrix_networkx_and_edges_give_the_same_graph(made):
    names, weights = made
    graph = build(names, weights)
    dense = np.zeros((len(names), len(names)), dtype=object)
    for s, t, w in graph.edges:
        dense[graph.index[t], graph.index[s]] = w
    assert SignedDigraph.from_matrix(dense, graph.labels, orientation="listens") == graph
    digraph = nx.DiGraph()
    digraph.add_nodes_from(int(name) for name in names)
    digraph.add_weighted_edges_from((int(a), int(b), w) for (a, b), w in weights.items())
    assert SignedDigraph.from_networkx(digraph) == graph
    floats = graph.adjacency()
    again = SignedDigraph.from_matrix(floats, graph.labels, orientation="listens")
    assert again == SignedDigraph.from_matrix(floats.toarray(), graph.labels, orientation="listens")
    assert np.array_equal(again.weights, graph.weights)


DTYPES = [np.int8, np.int64, np.uint16, np.float32, np.float64]
FORMS = [np.array, list, sparse.csr_array, sparse.coo_matrix, sparse.lil_array, sparse.dok_array]


@pytest.mark.parametrize(("dtype", "form"), [*product(DTYPES, FORMS), (object, np.array), (object, list)])
def test_a_matrix_of_any_kind(dtype, form):
    matrix = np.array([[0, 2, 0], [0, 0, 0], [1, 3, 0]]).astype(dtype)
    graph = SignedDigraph.from_matrix(
        matrix.tolist() if form is list else form(matrix), labels="abc", orientation="listens"
    )
    assert set(graph.edges) == {("b", "a", 2), ("a", "c", 1), ("b", "c", 3)}
    assert graph.read["orientation"] == "matrix"


def test_a_matrix_is_not_changed_by_reading_it():
    matrix = sparse.coo_array(([1, 2, 5], ([0, 1, 1], [1, 0, 2])), shape=(3, 3))
    before = [array.copy() for array in (matrix.row, matrix.col, matrix.data)]
    graph = SignedDigraph.from_matrix(matrix, orientation="listens")
    assert all(np.array_equal(a, b) for a, b in zip(before, (matrix.row, matrix.col, matrix.data), strict=True))
    matrix.data[:] = 9
    assert graph.exact_weight(0) == 1


def test_stored_zeros_of_a_matrix_are_no_edges():
    matrix = sparse.coo_array(([1, 0], ([0, 1], [1, 0])), shape=(2, 2))
    assert SignedDigraph.from_matrix(matrix, orientation="listens").n_edges == 1


def test_two_entries_for_one_place_are_refused():
    # SciPy would add them; +1 and -1 would vanish without a word.
    matrix = sparse.coo_array(([1, -1], ([0, 0], [1, 1])), shape=(2, 2))
    with pytest.raises(GraphError, match="two edges 2 -> 1"):
        SignedDigraph.from_matrix(matrix, orientation="listens")


def test_arrays_are_read_only():
    graph = SignedDigraph.from_edges([("a", "b", 1)])
    for array in (graph.source, graph.target, graph.sign, graph.weights):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5


def test_a_graph_keeps_no_view_of_the_callers_arrays():
    source, target = np.array([0]), np.array([1])
    graph = SignedDigraph("ab", source, target, Weights(np.array([1.0])))
    source[0], target[0] = 1, 0
    assert graph.edges == (("a", "b", 1),)


@given(edge_lists(), st.data())
def test_a_subgraph_is_induced(made, data):
    names, weights = made
    graph = build(names, weights)
    chosen = data.draw(st.lists(st.sampled_from(range(graph.n_nodes)), min_size=1, unique=True))
    part = graph.subgraph(chosen)
    assert part.labels == graph.subgraph([graph.labels[i] for i in chosen]).labels
    assert part.labels == tuple(graph.labels[i] for i in chosen)
    inside = set(part.labels)
    assert {(s, t): w for s, t, w in part.edges} == {p: w for p, w in weights.items() if inside.issuperset(p)}


@given(edge_lists(), st.data())
def test_without_some_nodes_and_edges_the_others_are_left(made, data):
    names, weights = made
    graph = build(names, weights)
    out = data.draw(st.lists(st.sampled_from(graph.labels), max_size=graph.n_nodes - 1, unique=True))
    left = graph.without_nodes(*out)
    assert left.labels == tuple(label for label in graph.labels if label not in out)
    assert {(s, t): w for s, t, w in left.edges} == {p: w for p, w in weights.items() if not set(p) & set(out)}
    pairs = data.draw(st.lists(st.sampled_from(sorted(weights)), unique=True)) if weights else []
    left = graph.without_edges(*pairs)
    assert left.labels == graph.labels
    assert {(s, t): w for s, t, w in left.edges} == {p: w for p, w in weights.items() if p not in pairs}


@pytest.mark.parametrize(
    ("call", "why"),
    [
        (lambda graph: graph.without_nodes("a", "b"), "there is no graph"),
        (lambda graph: graph.without_nodes("z"), "z"),
        (lambda graph: graph.without_edges(("b", "a")), "there is no edge b -> a"),
        (lambda graph: graph.without_edges("ab"), "give pairs"),
    ],
)
def test_what_is_not_there_cannot_be_taken_out(call, why):
    with pytest.raises(PTCCError, match=why):
        call(SignedDigraph.from_edges([("a", "b", 1)]))


# ---------------------------------------------------------------------------------------------- orientation


@given(edge_lists())
def test_listens_turns_every_edge_round(made):
    names, weights = made
    listens = build(names, weights, orientation="listens")
    assert {(t, s): w for s, t, w in listens.edges} == weights
    assert listens.read["orientation"] == "listens"


def test_a_row_of_a_matrix_listens():
    graph = SignedDigraph.from_matrix([[0, 0], [-3, 0]], orientation="listens")
    assert graph.edges == (("1", "2", -3),)
    assert graph.in_weight().tolist() == [0, 3]


def test_a_matrix_without_a_direction_is_refused_with_both():
    with pytest.raises(GraphError, match="networkx") as caught:
        SignedDigraph.from_matrix([[0, 1], [0, 0]])
    assert 'orientation="listens"' in str(caught.value) and '"information"' in str(caught.value)
    with pytest.raises(ParameterError, match='"sideways" is unknown'):
        SignedDigraph.from_matrix([[0, 1], [0, 0]], orientation="sideways")
    with pytest.raises(GraphError, match="it is read by SignedDigraph"):
        SignedDigraph.from_matrix(nx.DiGraph([(1, 2)]), orientation="information")


@pytest.mark.few(0)
@given(edge_lists(st.integers(0, 30).map(str)))
def test_a_matrix_of_networkx_with_its_orientation_is_the_networkx_graph(made):
    names, weights = made
    graph = nx.DiGraph()
    graph.add_nodes_from(names)
    graph.add_weighted_edges_from((a, b, float(w)) for (a, b), w in weights.items())
    for matrix in (nx.to_numpy_array(graph), nx.to_scipy_sparse_array(graph)):
        for orientation in ("information", "listens"):
            expected = SignedDigraph.from_networkx(graph, orientation=orientation)
            assert SignedDigraph.from_matrix(matrix, graph.nodes, orientation=orientation) == expected
    assert SignedDigraph.from_networkx(graph) == build(names, {pair: float(w) for pair, w in weights.items()})


# ---------------------------------------------------------------------------------------------- labels


def test_a_data_frame_keeps_its_labels():
    pd = pytest.importorskip("pandas")
    team = nx.DiGraph()
    team.add_weighted_edges_from([("bob", "ann", 2), ("ann", "eve", -1)])
    frame = nx.to_pandas_adjacency(team)
    graph = SignedDigraph.from_matrix(frame, orientation="information")
    assert graph == SignedDigraph.from_networkx(team) and graph.labels == ("bob", "ann", "eve")
    assert SignedDigraph.from_matrix(frame[["eve", "bob", "ann"]], orientation="information") == graph
    assert set(SignedDigraph.from_matrix(frame.T, orientation="listens").edges) == set(graph.edges)
    places = [("a", 1), ("b", 2)]  # labels as from_networkx writes such nodes
    frame = pd.DataFrame([[0, 3], [0, 0]], pd.MultiIndex.from_tuples(places), pd.MultiIndex.from_tuples(places))
    graph = SignedDigraph.from_matrix(frame, orientation="information")
    assert graph.edges == (("('a', 1)", "('b', 2)", 3),)


def test_a_data_frame_of_several_types_keeps_its_integers():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({1: [0, 2**60 + 1, 0], "x": [0.5, 0.0, 0.0], 3: ["1/3", 0, 0]}, index=[1, "x", 3])
    graph = SignedDigraph.from_matrix(frame.astype({3: object}), orientation="listens")
    assert set(graph.edges) == {("1", "x", 2**60 + 1), ("x", "1", Fraction(1, 2)), ("3", "1", Fraction(1, 3))}


@pytest.mark.parametrize(
    ("rows", "columns", "entry", "reason"),
    [
        (["a", "b"], ["a", "c"], 1, "different labels: b, c"),
        ([0, 1], ["a", "b"], 1, "different labels: 0, 1, a, b"),
        (["a", "a"], ["a", "b"], 1, "two rows of the matrix are both labelled a"),
        (["a", 1], [1, "1"], 1, "two columns of the matrix are both labelled 1"),
        (["a", "b"], ["a", "b"], float("nan"), "row a, column b of the matrix: the entry is nan, not a finite"),
        (["a", "b"], ["a", "b"], "x", "row a, column b of the matrix: .* is not a number"),
    ],
)
def test_a_data_frame_whose_labels_do_not_fit_is_refused(rows, columns, entry, reason):
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame([[0, entry], [0, 0]], index=rows, columns=columns)
    with pytest.raises(GraphError, match=reason) as caught:
        SignedDigraph.from_matrix(frame, orientation="listens")
    assert str(caught.value).isprintable() and len(str(caught.value)) < 200


def test_a_missing_entry_of_a_data_frame_is_no_edge_of_any_weight():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame([[0, None], [1, 0]], dtype="Int64")
    with pytest.raises(GraphError, match="missing"):
        SignedDigraph.from_matrix(frame, orientation="listens")
    assert SignedDigraph.from_matrix(frame.fillna(0), orientation="listens").edges == (("0", "1", 1),)
    with pytest.raises(GraphError, match="labels of its own"):
        SignedDigraph.from_matrix(frame.fillna(0), "ab", orientation="listens")


# ---------------------------------------------------------------------------------------------- refusals


def multigraph() -> nx.MultiDiGraph:
    graph = nx.MultiDiGraph()
    graph.add_weighted_edges_from([("a", "b", 1), ("a", "b", -1)])
    return graph


EDGES = SignedDigraph.from_edges
MATRIX = partial(SignedDigraph.from_matrix, orientation="listens")
NETWORKX = SignedDigraph.from_networkx


@pytest.mark.parametrize(
    ("make", "data", "reason"),
    [
        (EDGES, [], "no nodes"),
        (EDGES, [("a", "b", 0)], "weight 0 of edge a -> b"),
        (EDGES, [("a", "b", "0.0")], "weight 0 of edge a -> b"),
        (EDGES, [("a", "b", float("nan"))], "edge a -> b: weight is nan, not a finite number"),
        (EDGES, [("a", "b", float("inf"))], "not a finite number"),
        (EDGES, [("a", "b", "x")], 'weight "x" of edge a -> b is not a number'),
        (EDGES, [("a", "b", True)], "not a number"),
        (EDGES, [("a", "b", None)], "not a number"),
        (EDGES, [("a", "b", 10**400)], "edge a -> b is outside the range of float64"),
        (EDGES, [("a", "b", Fraction(1, 10**400))], "outside the range of float64"),
        (EDGES, [("a", "b", Fraction(10**400, 3)), ("b", "c", 1)], "edge a -> b is outside the range of float64"),
        (EDGES, [("a", "b", 1e-310)], "outside the range of float64"),
        (EDGES, [("a", "a", 1)], "self-loop at node a"),
        (EDGES, [("a", "b", 1), ("a", "b", 1)], "two edges a -> b"),
        (EDGES, [("a", "b")], "not a triple"),
        (EDGES, [5], "not a triple"),
        (EDGES, [(1, "b", 1), ("1", "c", 1)], "both written 1"),
        (MATRIX, [[0, 1]], "square"),
        (MATRIX, [[0, 1], [1]], "rows of different lengths"),
        (MATRIX, [0, 1], "two dimensions"),
        (MATRIX, np.zeros((2, 2, 2)), "two dimensions"),
        (MATRIX, np.zeros((0, 0)), "no nodes"),
        (MATRIX, [[1, 0], [0, 0]], "self-loop at node 1"),
        (MATRIX, [[0, np.nan], [0, 0]], "row 1, column 2 of the matrix is nan; write 0"),
        (MATRIX, [[0, 1j], [0, 0]], "real numbers"),
        (MATRIX, [["a", "b"], ["c", "d"]], 'row 1, column 1 of the matrix: "a" is not a number'),
        (MATRIX, np.array([[0, "x"], [0, 0]], dtype=object), "not a number"),
        (MATRIX, sparse.csr_array(np.array([[0, 1j], [0, 0]])), "real numbers"),
        (NETWORKX, nx.Graph([("a", "b")]), "undirected"),
        (NETWORKX, multigraph(), "multigraph"),
        (NETWORKX, nx.DiGraph([("a", "b")]), 'no attribute "weight"'),
    ],
)
def test_what_is_no_signed_digraph_is_refused_with_one_line(make, data, reason):
    with pytest.raises(GraphError, match=reason) as caught:
        make(data)
    message = str(caught.value)
    assert message.isprintable() and len(message) < 300
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, PTCCError)


def test_wrong_options_are_refused():
    with pytest.raises(ParameterError, match="orientation"):
        SignedDigraph.from_edges([("a", "b", 1)], orientation="sideways")
    with pytest.raises(GraphError, match="3 labels for 2 rows"):
        SignedDigraph.from_matrix([[0, 1], [0, 0]], labels="abc", orientation="listens")
    with pytest.raises(GraphError, match="same label"):
        SignedDigraph.from_matrix([[0, 1], [0, 0]], labels="aa", orientation="listens")


def test_a_huge_label_and_a_control_character_stay_out_of_messages():
    with pytest.raises(GraphError) as caught:
        SignedDigraph.from_edges([("a\n" * 10_000, "b", 0)])
    assert str(caught.value).isprintable() and len(str(caught.value)) < 300


def test_one_node_is_a_graph():
    graph = SignedDigraph.from_edges([], nodes=["only"])
    assert (graph.n_nodes, graph.n_edges) == (1, 0)
    assert graph.laplacian().toarray().tolist() == [[0]]
    assert graph.exact_laplacian() == [[0]]
    assert repr(graph) == "SignedDigraph(1 nodes, 0 edges, 0 negative)"


def test_a_weight_that_could_not_be_written_again_is_refused():
    with pytest.raises(GraphError, match="too many digits"):
        SignedDigraph.from_edges([("a", "b", "0." + "3" * 2500)])


def test_a_character_in_two_surrogates_is_refused():
    """Written to JSON and read again it would be another label."""
    with pytest.raises(GraphError, match="two surrogates"):
        SignedDigraph.from_edges([("\ud83d\ude00", "b", 1)])


def test_labels_and_edges_are_tuples_that_may_be_called():
    g = SignedDigraph.from_edges([("a", "b", -1), ("b", "c", 2)])
    for row in (g.labels, g.edges, Family.from_graph(g).labels):
        assert row() is row and isinstance(row, tuple)
        assert row == tuple(row) and hash(row) == hash(tuple(row)) and repr(row) == repr(tuple(row))
        for again in (pickle.loads(pickle.dumps(row)), copy.copy(row), copy.deepcopy(row)):  # noqa: S301
            assert again == row and again() == row
        with pytest.raises(AttributeError):
            row.label = 1
    assert json.loads(json.dumps(g.labels)) == ["a", "b", "c"]
