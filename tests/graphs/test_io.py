"""Files in and out: what is read is what was written, and what is no signed digraph is refused by name."""

from __future__ import annotations

import gzip
import io
import math
import os
import stat
import struct
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.io import mmwrite, savemat

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, GraphError, NumberError, ParameterError, PTCCError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import files, read_graph, read_state, write_atomically, write_graph

EDGES = [("a", "b", "2"), ("b", "c", "-0.1"), ("c", "a", "1/3"), ("c", "b", "-4")]
GRAPH = SignedDigraph.from_edges(EDGES, nodes="abc")
# Listeners are rows: 2 listens to 1 as an opponent, 3 to 2 by a tenth, 1 to 3 by 2.5.
MATRIX = np.array([[0, 0, 2.5], [-1, 0, 0], [0, 0.1, 0]])
MATRIX_EDGES = {("1", "2", Fraction(-1)), ("2", "3", Fraction(0.1)), ("3", "1", Fraction(5, 2))}
DECIMAL_EDGES = {("1", "2", Fraction(-1)), ("2", "3", Fraction(1, 10)), ("3", "1", Fraction(5, 2))}


@pytest.fixture
def put(tmp_path: Path) -> Callable[..., Path]:
    """Write a file and return its path."""

    def put(name: str, content: str | bytes) -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return put


def text(content: str, **options) -> SignedDigraph:
    return read_graph(io.StringIO(content), **options)


def edges(graph: SignedDigraph) -> set[tuple[str, str, Fraction]]:
    return set(graph.edges)


def one_line(error: BaseException) -> str:
    message = str(error)
    assert message and "\n" not in message and message.isprintable()
    return message


# ---------------------------------------------------------------------------------------------- edge lists


@pytest.mark.parametrize(
    "content",
    [
        "a,b,2\nb,c,-0.1\nc,a,1/3\nc,b,-4\n",
        "a\tb\t2\nb\tc\t-0.1\nc\ta\t1/3\nc\tb\t-4\n",
        "a;b;2\nb;c;-0.1\nc;a;1/3\nc;b;-4\n",
        "a b 2\n b   c -0.1\nc \t a 1/3\nc b -4 \n",
        "a , b,2\n b, c , -0.1\nc,a,\t1/3\nc,b,-4",
        "a,b,2\r\nb,c,-0.1\r\nc,a,1/3\r\nc,b,-4\r\n",
        "a,b,2\rb,c,-0.1\rc,a,1/3\rc,b,-4\r",
        "\ufeffa,b,2\nb,c,-0.1\nc,a,1/3\nc,b,-4\n",
        "# a,b,7\n% b,c,8\n\n  # c\na,b,2\n\nb,c,-0.1\n#,,\nc,a,1/3\n,,\nc,b,-4\n\n",
        "source,target,weight\na,b,2\nb,c,-0.1\nc,a,1/3\nc,b,-4\n",
        "Weight;TO;From\n2;b;a\n-0.1;c;b\n1/3;a;c\n-4;b;c\n",
        "FromNodeId ToNodeId Sign\na b 2\nb c -0.1\nc a 1/3\nc b -4\n",
        "time,src,dst,note,rating\n1,a,b,x,2\n2,b,c,,-0.1\n3,c,a,y,1/3\n4,c,b,z,-4\n",
        '"a","b","2"\n"b","c","-0.1"\nc,a,1/3\n"c", "b", -4\n',
        '"a" "b" 2\nb "c" -0.1\nc a 1/3\nc b -4\n',
        "a,b,2,2012,x\nb,c,-0.1\nc,a,1/3,\nc,b,-4,,,\n",
        'a,b,2,"two\nlines"\nb,c,-0.1,x\nc,a,1/3,x\nc,b,-4,x\n',
        "b\na,b,2\nb,c,-0.1\nc\nc,a,1/3\nc,b,-4\n",
        "source,target,weight\na\na,,\na,b,2e0\nb,c,-1e-1\nc,a,2/6\nc,b,-0x1p2\n",
    ],
)
def test_the_same_graph_in_many_spellings(content):
    assert text(content) == GRAPH


def test_a_row_with_one_field_declares_a_node():
    graph = text("x\na,b,1\ny z\n")
    assert graph.labels == ("x", "a", "b", "y z")
    assert graph.n_edges == 1
    assert text("only\n").labels == ("only",)
    assert text("time,source,target,weight\nn\n7,m\n").labels == ("n", "m")


def test_columns_beyond_the_third_are_ignored_and_said():
    assert text("a,b,1\n").read["notes"] == ()
    assert text("a,b,1,2026\n").read["notes"] == ("columns ignored: after the third",)
    assert text("a,b,1\nb,a,1,late\n").read["notes"] == ("columns ignored: after the third",)
    assert text("a,b,1,1289241911.7\n").read["notes"] == ("columns ignored: after the third",)
    assert text("source,time,target,weight\na,9,b,1\n").read["notes"] == ('columns ignored: "time"',)


@pytest.mark.parametrize("rows", ["a,b,-1,5\n", "# trust\na,b,1\nb,a,-0,25\n"])
def test_a_decimal_comma_is_not_taken_for_another_column(rows):
    with pytest.raises(FormatError, match="a weight with a decimal comma, or a weight and another column"):
        text(rows)


@pytest.mark.parametrize(
    "titles", ["From Node;To Node;Sign", "FromNodeId;ToNodeId;Weight", "source_id;target-id;w", "rater;ratee;Rating"]
)
def test_titles_of_a_header_may_have_blanks_capitals_and_hyphens(titles):
    table = f'{titles};Year\n"Anna Berg";"Bo, Jr.";-1;2001\n'
    assert read_graph(io.StringIO(table)).edges == (("Anna Berg", "Bo, Jr.", Fraction(-1)),)


def test_names_of_a_header_in_a_row_with_a_number_are_nodes():
    assert edges(text("source,target,1\n")) == {("source", "target", Fraction(1))}


@pytest.mark.parametrize("separator", [",", "\t", ";"])
def test_labels_keep_their_blanks_and_the_other_separators(separator):
    other = {",": ";", "\t": ",", ";": ","}[separator]
    graph = text(
        separator.join(["New York", "Los Angeles", "1"]) + "\n" + separator.join(["New York", f"a{other}b", "1"])
    )
    assert graph.labels == ("New York", "Los Angeles", f"a{other}b")


def test_a_separator_is_the_one_that_gives_three_fields():
    assert text("a,x by 1\n").labels == ("a,x", "by")
    assert edges(text("a;;\na;b;1\n")) == {("a", "b", Fraction(1))}
    assert text("a;b;1\n").labels == ("a", "b")


@pytest.mark.parametrize("table", ["a,b,1\nb;a;1\n", "a\tb\t1\nb,a,-0.5\n", "a;b;1\nb\ta\t2e3\n", "c\na b 1\nb,a,1\n"])
def test_an_edge_with_other_separators_is_no_node(table):
    """Such a row would declare a lone agent, and the edge would be missing without a word."""
    line = table.count("\n")
    with pytest.raises(FormatError, match=f"line {line}: b.a.* is one field here; separate fields as the rows before"):
        text(table)
    quoted = "".join(f'"{row}"\n' if row[0] == "b" else f"{row}\n" for row in table.splitlines())
    assert text(quoted).n_edges == 1


def test_nodes_whose_names_look_like_edges_are_written_so_that_they_are_read(tmp_path):
    graph = SignedDigraph.from_edges([("a", "b", 1)], nodes=["a", "b", "b;a;1", "b\ta\t1", "x; y"])
    write_graph(graph, tmp_path / "g.csv")
    assert read_graph(tmp_path / "g.csv") == graph


def test_comment_signs_begin_comments_only_at_the_begin_of_a_row():
    graph = text('a,#b,1\n#b,a,1\n"#b",a,-1\n% x\nc,%x,1\n%x,c,2\n%x,c,3\n')
    assert edges(graph) == {("a", "#b", Fraction(1)), ("#b", "a", Fraction(-1)), ("c", "%x", Fraction(1))}


def test_nodes_come_by_value_if_all_are_integers_else_by_appearance():
    assert text("10,9,1\n2,10,1\n").labels == ("2", "9", "10")
    assert text("10,9,1\n2,x,1\n").labels == ("10", "9", "2", "x")
    assert text("007,7,1\n").labels == ("007", "7")


def test_orientation_says_who_listens():
    assert edges(text("a,b,1\n")) == {("a", "b", Fraction(1))}
    assert edges(text("a,b,1\n", orientation="information")) == {("a", "b", Fraction(1))}
    graph = text("a,b,1\n", orientation="listens")
    assert edges(graph) == {("b", "a", Fraction(1))}
    assert graph.labels == ("a", "b")
    assert graph.read["orientation"] == "listens"


def test_reading_is_told_in_full():
    assert text("a,b,1\n").read == {
        "orientation": "information",
        "duplicates": "refused",
        "self_loops": "refused",
        "undirected": False,
        "notes": (),
    }


def test_duplicates_are_summed_or_the_last_is_kept():
    content = "a,b,0.1\na,b,-0.4\nb,a,1\na,b,0.2\n"
    total, last = text(content, duplicates="sum"), text(content, duplicates="last")
    assert edges(total) == {("a", "b", Fraction(-1, 10)), ("b", "a", Fraction(1))}
    assert edges(last) == {("a", "b", Fraction(1, 5)), ("b", "a", Fraction(1))}
    assert (total.read["duplicates"], last.read["duplicates"]) == ("sum", "last")
    assert total.read["notes"] == ("2 repeated rows were merged (sum)",)
    assert text("a,b,1\n", duplicates="sum").read["notes"] == ()


def test_self_loops_are_dropped_on_request_and_counted():
    graph = text("a,a,1\na,b,2\nb,b,-1\nc,c,0\n", drop_self_loops=True)
    assert edges(graph) == {("a", "b", Fraction(2))}
    assert graph.labels == ("a", "b", "c")
    assert graph.read["self_loops"] == "dropped 3"
    assert text("a,b,1\n", drop_self_loops=True).read["self_loops"] == "dropped 0"


def test_undirected_edges_go_both_ways():
    graph = text("a,b,1\nb,c,-2\nc,a,1\na,c,1\n", undirected=True, duplicates="last")
    assert edges(graph) == {
        (*pair, Fraction(w)) for a, b, w in [("a", "b", 1), ("b", "c", -2), ("c", "a", 1)] for pair in [(a, b), (b, a)]
    }
    assert graph.read["undirected"] is True
    assert edges(text("a,b,1\nb,a,2\n", undirected=True, duplicates="sum")) == {
        ("a", "b", Fraction(3)),
        ("b", "a", Fraction(3)),
    }


@pytest.mark.few(0)
@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(-3, 3).filter(bool)), min_size=1),
    st.sampled_from(["sum", "last"]),
    st.booleans(),
    st.booleans(),
)
def test_merging_agrees_with_a_dictionary(rows, duplicates, undirected, listens):
    expected: dict[tuple[int, int], int] = {}
    for a, b, w in rows:
        if a != b:
            pair = (b, a) if listens else (a, b)
            pair = tuple(sorted(pair)) if undirected else pair
            expected[pair] = expected.get(pair, 0) + w if duplicates == "sum" else w
    content = "".join(f"{a},{b},{w}\n" for a, b, w in rows)

    def read() -> SignedDigraph:
        return text(
            content,
            duplicates=duplicates,
            undirected=undirected,
            drop_self_loops=True,
            orientation="listens" if listens else None,
        )

    if 0 in expected.values():
        with pytest.raises(FormatError, match="sum 0 of the weights"):
            read()
        return
    found = {(int(s), int(t)): w for s, t, w in read().edges}
    if undirected:
        expected |= {(b, a): w for (a, b), w in expected.items()}
    assert found == expected


# ---------------------------------------------------------------------------------------------- there and back

odd_text = st.text(
    st.one_of(
        st.characters(exclude_categories=["Cs"], exclude_characters="\0"), st.sampled_from(' ,;"\t\n\r#%\u2028\u00a0aé')
    ),
    max_size=8,
)
weight = st.one_of(
    st.integers(-(10**30), 10**30),
    st.fractions(max_denominator=10**12),
    st.floats(allow_nan=False, allow_infinity=False),
    st.builds(lambda m, e: Fraction(m) * Fraction(10) ** e, st.integers(-999, 999), st.integers(-290, 290)),
).filter(lambda w: 2.3e-308 <= abs(w) <= 1.7e308)


@st.composite
def graphs(draw, labels=odd_text):
    names = draw(st.lists(st.one_of(labels, st.integers(-3, 20).map(str)), min_size=1, max_size=7, unique=True))
    pairs = [(a, b) for a in names for b in names if a != b]
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True, max_size=12)) if pairs else []
    return SignedDigraph.from_edges([(a, b, draw(weight)) for a, b in chosen], nodes=names)


def plain(text: str) -> str:
    return text.strip() or "x"


@pytest.mark.few(0)
@given(graphs(odd_text.map(plain)), st.sampled_from(["g.csv", "g.csv.gz", "g", "g.txt"]))
@example(SignedDigraph.from_edges([("source", "target", 1)], nodes=["weight"]), "g.csv")
@example(SignedDigraph.from_edges([('"', "a\nb", 1), ("a\nb", "c\r\nd", -1), ("#", "%", 1)], nodes=["z"]), "g.csv")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100)
def test_a_graph_is_read_back_as_it_was_written(tmp_path, graph, name):
    write_graph(graph, tmp_path / name)
    back = read_graph(tmp_path / name)
    assert back == graph
    assert back.labels == graph.labels
    assert back.edges == graph.edges
    alone = graph.n_nodes - len({*graph.source.tolist(), *graph.target.tolist()})
    told = [note.split(":")[0] for note in back.read["notes"]]
    assert told == [f"{counted(alone, 'node')} without edges"][:alone]


@pytest.mark.few(0)
@given(graphs(odd_text.map(plain)))
@settings(max_examples=60)
def test_the_node_order_of_a_subgraph_survives_where_the_order_rule_allows(tmp_path_factory, graph):
    part = graph.subgraph(np.arange(graph.n_nodes)[::-1])
    path = tmp_path_factory.mktemp("sub") / "g.csv"
    write_graph(part, path)
    back = read_graph(path)
    assert back == part
    assert back.labels in (part.labels, graph.labels)


def test_nodes_are_declared_only_where_needed(tmp_path):
    write_graph(GRAPH, tmp_path / "g.csv")
    rows = ["source,target,weight", "a,,", "b,,", "c,,", "c,a,1/3", "a,b,2", "c,b,-4", "b,c,-1/10"]
    assert (tmp_path / "g.csv").read_text().splitlines() == rows
    write_graph(text("1,2,1\n3\n"), tmp_path / "g.csv")
    assert (tmp_path / "g.csv").read_text() == "source,target,weight\n3,,\n1,2,1\n"


@pytest.mark.parametrize(
    ("graph", "name", "reason"),
    [
        (SignedDigraph.from_edges([("a\0", "b", 1)]), "g.csv", "not Unicode text"),
        (SignedDigraph.from_edges([("", "b", 1)]), "g.csv", "is empty"),
        (SignedDigraph.from_edges([(" a", "b", 1)]), "g.csv", "has blanks around it"),
        (SignedDigraph.from_edges([("a\ud800", "b", 1)]), "g.csv", "Unicode"),
        (SignedDigraph.from_edges([("a" * 70_000, "b", 1)]), "g.csv", "longer than"),
        (GRAPH, "g.graphml", "edge lists"),
        (GRAPH, "g.npz", "edge lists"),
        (GRAPH, "missing/g.csv", "folder does not exist"),
    ],
)
def test_what_cannot_be_read_back_is_not_written(tmp_path, graph, name, reason):
    with pytest.raises(FormatError, match=reason) as caught:
        write_graph(graph, tmp_path / name)
    assert name in one_line(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.few(0)
@given(
    graphs(
        st.text(st.characters(codec="utf-8", exclude_characters="\0\r\n", exclude_categories=["C", "Z"]), min_size=1)
    )
)
@settings(max_examples=60)
def test_networkx_writes_graphml_and_gml_that_mean_the_same(tmp_path_factory, graph):
    folder = tmp_path_factory.mktemp("nx")
    digraph = nx.DiGraph()
    digraph.add_nodes_from(graph.labels)
    digraph.add_weighted_edges_from((s, t, float(w)) for s, t, w in graph.edges)
    nx.write_graphml_xml(digraph, folder / "g.graphml")
    # A decimal in a text format is the decimal, not the float that it once was.
    decimal = {(s, t, Fraction(repr(float(w)))) for s, t, w in graph.edges}
    assert edges(read_graph(folder / "g.graphml")) == decimal
    assert read_graph(folder / "g.graphml").labels == graph.labels
    if all(label == label.strip() and "&" not in label for label in graph.labels):
        nx.write_gml(digraph, folder / "g.gml")
        assert edges(read_graph(folder / "g.gml")) == decimal
        assert read_graph(folder / "g.gml").labels == graph.labels


@pytest.mark.parametrize("integer", [True, False])
def test_networkx_writes_pajek_that_means_the_same(tmp_path, integer):
    digraph = nx.DiGraph()
    a, b, c = ("1", "2", "10") if integer else ("New York", "b", "ü")
    digraph.add_weighted_edges_from([(a, b, 2), (b, c, -0.1), (c, a, 1.5)])
    nx.write_pajek(digraph, tmp_path / "g.net")
    expected = {(a, b, Fraction(2)), (b, c, Fraction(-1, 10)), (c, a, Fraction(3, 2))}
    assert edges(read_graph(tmp_path / "g.net")) == expected


def big_endian(matrix: np.ndarray) -> bytes:
    """A MATLAB 5 file as a big-endian machine writes it: name and dimensions, then the columns."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    flags = element(6, struct.pack(">II", 6, 0))
    size, name = element(5, struct.pack(">ii", *matrix.shape)), struct.pack(">HH4s", 1, 1, b"W")
    columns = element(9, matrix.astype(">f8").tobytes(order="F"))
    return bytes(124) + b"\1\0MI" + element(14, flags + size + name + columns)


def write_npz(path: Path, matrix: np.ndarray) -> None:
    np.savez(path, W=matrix, labels=np.array(["x", "ü", "z"]))


@pytest.mark.parametrize("kind", ["csr", "csc", "coo"])
def test_every_sparse_npz_is_the_same_graph(tmp_path, kind):
    sparse.save_npz(tmp_path / "g.npz", sparse.csr_array(MATRIX).asformat(kind))
    graph = read_graph(tmp_path / "g.npz")
    assert edges(graph) == MATRIX_EDGES
    assert graph.read["orientation"] == "matrix"


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("g.npy", np.save),
        ("g.npz", lambda path, matrix: np.savez_compressed(path, matrix)),
        ("g.mat", lambda path, matrix: savemat(path, {"W": matrix})),
        ("g.mat", lambda path, matrix: savemat(path, {"W": sparse.csc_array(matrix)}, do_compression=True)),
        ("g.mat", lambda path, matrix: savemat(path, {"A": matrix, "T": 0.6, "x0": [1.0, 2, 3], "name": "text"})),
        ("g.mat", lambda path, matrix: path.write_bytes(big_endian(matrix))),
    ],
)
def test_a_binary_matrix_keeps_its_floats(tmp_path, name, write):
    write(tmp_path / name, MATRIX)
    assert edges(read_graph(tmp_path / name)) == MATRIX_EDGES
    write(tmp_path / name, np.asfortranarray((10 * MATRIX).astype(np.int16)))
    assert edges(read_graph(tmp_path / name)) == {(s, t, Fraction(round(10 * w))) for s, t, w in MATRIX_EDGES}


def test_repeated_entries_of_a_sparse_matrix_are_repeated_rows(tmp_path):
    sparse.save_npz(tmp_path / "g.npz", sparse.coo_array(([1.0, -3.0], ([0, 0], [1, 1])), shape=(2, 2)))
    with pytest.raises(FormatError, match="row 1, column 2: second row for edge 2 -> 1"):
        read_graph(tmp_path / "g.npz")
    assert edges(read_graph(tmp_path / "g.npz", duplicates="sum")) == {("2", "1", Fraction(-2))}


def test_labels_of_an_archive_are_kept(tmp_path):
    write_npz(tmp_path / "g.npz", MATRIX)
    assert read_graph(tmp_path / "g.npz").labels == ("x", "ü", "z")
    np.savez(tmp_path / "g.npz", W=MATRIX, labels=np.array([b"x", b"y", b"z"]))
    assert read_graph(tmp_path / "g.npz").labels == ("x", "y", "z")
    np.savez(tmp_path / "g.npz", W=MATRIX, labels=np.array([7, 5, 6]))
    assert edges(read_graph(tmp_path / "g.npz")) == {
        ("7", "5", Fraction(-1)),
        ("5", "6", Fraction(0.1)),
        ("6", "7", Fraction(5, 2)),
    }


@pytest.mark.parametrize("matrix", [MATRIX, sparse.coo_array(MATRIX)])
def test_matrix_market_decimals_are_decimals(tmp_path, matrix):
    mmwrite(tmp_path / "g.mtx", matrix, symmetry="general")
    assert edges(read_graph(tmp_path / "g.mtx")) == DECIMAL_EDGES
    (tmp_path / "g.mtx.gz").write_bytes(gzip.compress((tmp_path / "g.mtx").read_bytes(), mtime=0))
    assert edges(read_graph(tmp_path / "g.mtx.gz")) == DECIMAL_EDGES


@pytest.mark.parametrize("dense", [True, False])
def test_a_symmetric_matrix_market_file_is_undirected(tmp_path, dense):
    matrix = np.array([[0, 1, 0], [1, 0, -2], [0, -2, 0]])
    mmwrite(tmp_path / "g.mtx", matrix if dense else sparse.coo_array(matrix), symmetry="symmetric")
    with pytest.raises(FormatError, match="--undirected"):
        read_graph(tmp_path / "g.mtx")
    assert read_graph(tmp_path / "g.mtx", undirected=True) == SignedDigraph.from_matrix(matrix, orientation="listens")


@pytest.mark.few(0)
@given(st.integers(1, 6), st.data())
@settings(max_examples=60)
def test_a_dense_and_a_sparse_matrix_are_the_same_graph(tmp_path_factory, n, data):
    cell = st.one_of(st.just(0.0), weight.map(float).filter(bool))
    matrix = np.array(data.draw(st.lists(st.lists(cell, min_size=n, max_size=n), min_size=n, max_size=n)))
    np.fill_diagonal(matrix, 0)
    folder = tmp_path_factory.mktemp("matrix")
    np.save(folder / "g.npy", matrix)
    sparse.save_npz(folder / "g.npz", sparse.csr_array(matrix))
    savemat(folder / "g.mat", {"W": matrix})
    expected = SignedDigraph.from_matrix(matrix, orientation="listens")
    for name in ("g.npy", "g.npz", "g.mat"):
        assert read_graph(folder / name) == expected


NAMESPACE = ' xmlns="http://graphml.graphdrawing.org/xmlns"'
GRAPHML = """<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="d0" for="edge" attr.name="{name}" attr.type="double">{default}</key>
  <key id="d1" for="node" attr.name="weight" attr.type="double"><default>9</default></key>
  <graph edgedefault="{kind}">
    <edge id="e1" source="1" target="b"><data key="d0">2</data></edge>
    <node id="1"><data key="d1">5</data></node><node id="b"/><node id="lonely"/>
    <edge source="b" target="1">{data}</edge>
  </graph>
</graphml>
"""


def graphml(kind="directed", name="weight", default="", data='<data key="d0"> -0.1 </data>') -> str:
    return GRAPHML.format(kind=kind, name=name, default=default, data=data)


GML = """Creator "someone" # not a comment
graph [
  directed {directed}
  node [ id 3 label "a &#228; b" graphics [ x 1.0 y 2.0 ] ]
  node [ id 1 label "1" ]
  # a comment
  edge [ source 3 target 1 {weight} ]
  edge [ source 1 target 3 weight "1/3" ]
]
"""
PAJEK = """*Network test
*Vertices 3
% comment
1 "New York" 0.1 0.2 ellipse
3 c
{section}
1 2 0.1
3 1 -2
"""
MTX = "%%MatrixMarket matrix coordinate {field} {symmetry}\n% comment\n3 3 2\n2 1 {weight}\n3 2 0.1\n"


def gml(directed="1", weight="weight -0.5") -> str:
    return GML.format(directed=directed, weight=weight)


def pajek(section="*Arcs") -> str:
    return PAJEK.format(section=section)


def mtx(field="real", symmetry="general", weight="-1") -> str:
    return MTX.format(field=field, symmetry=symmetry, weight=weight)


def test_graphml(put):
    expected = {("1", "b", Fraction(2)), ("b", "1", Fraction(-1, 10))}
    graph = read_graph(put("g.graphml", graphml()))
    assert edges(graph) == expected
    assert graph.labels == ("1", "b", "lonely")
    assert edges(read_graph(put("g.graphml", graphml(name="Sign")))) == expected
    assert edges(read_graph(put("g.graphml", graphml(default="<default>-0.1</default>", data="")))) == expected
    assert edges(read_graph(put("g.graphml.gz", gzip.compress(graphml().encode(), mtime=0)))) == expected
    assert edges(read_graph(put("g.graphml", graphml().replace("UTF-8", "klingon")))) == expected
    assert edges(read_graph(put("g.graphml", graphml().replace(NAMESPACE, "")))) == expected
    assert edges(read_graph(io.StringIO(graphml()), format="graphml")) == expected
    one_way = graphml("undirected", data='<data key="d0">1</data>').replace(
        'source="b" target="1"', 'source="b" target="lonely"'
    )
    assert edges(read_graph(put("g.graphml", one_way), undirected=True)) == {
        ("1", "b", Fraction(2)),
        ("b", "1", Fraction(2)),
        ("b", "lonely", Fraction(1)),
        ("lonely", "b", Fraction(1)),
    }


def test_gml(put):
    graph = read_graph(put("g.gml", gml()))
    assert edges(graph) == {("a ä b", "1", Fraction(-1, 2)), ("1", "a ä b", Fraction(1, 3))}
    assert graph.labels == ("a ä b", "1")
    assert edges(read_graph(put("g.gml", gml(weight="sign -1")))) >= {("a ä b", "1", Fraction(-1))}
    without_labels = gml().replace('label "a &#228; b"', "").replace('label "1"', "")
    assert read_graph(put("g.gml", without_labels)).labels == ("1", "3")


def test_pajek(put):
    graph = read_graph(put("g.net", pajek()))
    assert edges(graph) == {("New York", "2", Fraction(1, 10)), ("c", "New York", Fraction(-2))}
    assert graph.labels == ("New York", "2", "c")
    both = read_graph(put("g.pajek", pajek("*Edges")), undirected=True)
    assert both.n_edges == 4


def test_pajek_nodes_without_rows_are_their_numbers(put):
    graph = read_graph(put("g.net", "*Vertices 3\n*Arcs\n1 2 0.5\n3 1 -1\n"))
    assert edges(graph) == {("1", "2", Fraction(1, 2)), ("3", "1", Fraction(-1))}


def test_pajek_reads_three_fields_of_an_arc(put):
    graph = read_graph(put("g.net", pajek() + '2 3 1 weight 7 l "it\'s"\n'))
    assert ("2", "c", Fraction(1)) in edges(graph)


def test_gml_labels_are_texts_or_integers(put):
    content = gml().replace('"a &#228; b"', "7").replace('label "1"', 'label "[]"')
    assert read_graph(put("g.gml", content)).labels == ("7", "[]")
    assert (
        read_graph(put("g.gml", gml().replace('label "1"', 'LABEL "&#34;x&#34; [ # &amp;"'))).labels[1] == '"x" [ # &'
    )


@pytest.mark.parametrize("number", ["2", "-0.1", "0.30000000000000004", "1e-300", "-2.5E+30", "12345678901234567890"])
def test_decimals_of_graph_formats_are_decimals(put, number):
    kind = "long" if number.isdigit() else "double"
    content = graphml(data=f'<data key="d0">{number}</data>').replace("double", kind)
    real = number if number.isdigit() or "." in number else number.replace("e", ".0e")
    for name, text in [
        ("g.graphml", content),
        ("g.gml", gml(weight=f"weight {real}")),
        ("g.net", pajek() + f"2 3 {number}"),
    ]:
        found = {weight for _, _, weight in read_graph(put(name, text)).edges}
        assert Fraction(number) in found or (name == "g.net" and Fraction(repr(float(number))) in found)


def test_weights_that_are_texts_keep_all_digits(put):
    exact = "1234567890.12345678901234567890123"
    for name, text in [
        ("g.graphml", graphml(data=f'<data key="d0">{exact}</data>').replace("double", "string")),
        ("g.gml", gml(weight=f'weight "{exact}"')),
    ]:
        assert Fraction(exact) in {weight for _, _, weight in read_graph(put(name, text)).edges}


@pytest.mark.parametrize("kind", ["graphml", "gml", "net"])
def test_repeated_edges_of_graph_formats_are_merged_on_request(put, kind):
    graph = nx.MultiDiGraph()
    graph.add_weighted_edges_from([("a", "b", 1.5), ("b", "a", 1.0), ("a", "b", -2.0), ("a", "b", 0.25)])
    write = {"graphml": nx.generate_graphml, "gml": nx.generate_gml, "net": nx.generate_pajek}[kind]
    path = put(f"g.{kind}", "\n".join(write(graph)))
    with pytest.raises(FormatError, match="second row for edge a -> b"):
        read_graph(path)
    assert ("a", "b", Fraction(1, 4)) in edges(read_graph(path, duplicates="last"))
    assert ("a", "b", Fraction(-1, 4)) in edges(read_graph(path, duplicates="sum"))
    assert ("a", "b", Fraction(3, 4)) in edges(read_graph(path, duplicates="sum", undirected=True))
    if kind == "net":  # its rows come as they stand in the file
        assert ("a", "b", Fraction(1)) in edges(read_graph(path, duplicates="last", undirected=True))
        return
    with pytest.raises(FormatError, match="which of two opposite edges is the last"):
        read_graph(path, duplicates="last", undirected=True)


def test_deep_nesting_is_refused_in_one_line(put):
    graph = "<node id='a' yfiles.foldertype='group'><graph edgedefault='directed'>"
    nested = graphml().replace('<node id="b"/>', graph * 5000 + "</graph></node>" * 5000 + '<node id="b"/>')
    with pytest.raises(FormatError, match="GraphML") as caught:
        read_graph(put("g.graphml", nested))
    one_line(caught.value)


def test_matrix_market_files_may_end_within_a_line(put):
    assert edges(read_graph(put("g.mtx", mtx().rstrip("\n")))) == edges(read_graph(put("h.mtx", mtx())))


def test_matrix_market_integers_are_exact(put):
    graph = read_graph(put("g.mtx", mtx("integer", weight=str(2**53 + 1)).replace("0.1", "1")))
    assert ("1", "2", Fraction(2**53 + 1)) in edges(graph)


def test_matrix_market_rows_listen(put):
    graph = read_graph(put("g.mtx", mtx()))
    assert edges(graph) == {("1", "2", Fraction(-1)), ("2", "3", Fraction(1, 10))}
    assert graph.labels == ("1", "2", "3")


# ---------------------------------------------------------------------------------------------- ways in


def test_a_graph_comes_by_path_file_object_and_standard_input(put, monkeypatch):
    content = b"a,b,1\n"
    expected = text(content.decode())
    path = put("g.csv", content)
    packed = put("g.csv.gz", gzip.compress(content, mtime=0))
    assert read_graph(path) == read_graph(str(path)) == read_graph(packed) == expected
    for file in (io.BytesIO(content), io.BytesIO(gzip.compress(content, mtime=0)), io.StringIO(content.decode())):
        assert read_graph(file) == expected
    with path.open() as as_text:
        assert read_graph(as_text) == expected
    with gzip.open(packed) as as_bytes:
        assert read_graph(as_bytes) == expected
    with gzip.open(packed, "rt") as as_text:
        assert read_graph(as_text) == expected
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))
    assert read_graph("-") == expected
    monkeypatch.setattr(sys, "stdin", io.StringIO("a,b,x\n"))
    with pytest.raises(FormatError, match="standard input, line 1"):
        read_graph("-")


def test_the_format_may_be_said(put):
    path = put("g.data", pajek())
    assert read_graph(path, format="net") == read_graph(path, format=".PAJEK")
    assert text(mtx(), format="mtx").read["orientation"] == "matrix"
    buffer = io.BytesIO()
    np.save(buffer, MATRIX)
    buffer.seek(0)
    assert edges(read_graph(buffer, format="npy")) == MATRIX_EDGES


def test_importing_the_reader_loads_nothing_heavy():
    def modules(code: str) -> set[str]:
        code = f"import sys; {code}; print(*{{name.partition('.')[0] for name in sys.modules}})"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        return set(done.stdout.split())

    loaded, preloaded = modules("import ptcc_certify.graphs.io"), modules("pass")
    loaded = {name for name in loaded if not name.strip("_").startswith("cython")}  # parts of older NumPy
    assert "numpy" in loaded
    assert loaded <= {*sys.stdlib_module_names, "__mp_main__", "lmi", "numpy", "ptcc_certify"} | preloaded


# ---------------------------------------------------------------------------------------------- refusals


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def mat(**variables: object) -> bytes:
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=True)
    return buffer.getvalue()


def mat4(**variables: object) -> bytes:
    buffer = io.BytesIO()
    savemat(buffer, variables, format="4")
    return buffer.getvalue()


def sparse_npz(**change: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    sparse.save_npz(buffer, sparse.csr_array(MATRIX))
    buffer.seek(0)
    return npz(**{**np.load(buffer), **change})


ROWS = "".join(f"n{i},n{i + 1},1\n" for i in range(10))
BAD_FILES = [
    # name, content, what the message says besides the name of the file
    ("g.csv", "", ["no edge and no node"]),
    ("g.csv", "# only\n\n% comments\n", ["no edge and no node"]),
    ("g.csv", "source,target,weight\n", ["no edge and no node"]),
    ("g.csv", ROWS + "b,c,nan\n" + ROWS, ["line 11:", '"nan"', "edge b -> c", "not a finite number", "remove the row"]),
    ("g.csv", "a,b,1\n\n# x\nb,c,-inf\n", ["line 4:", '"-inf"', "edge b -> c", "not a finite number"]),
    ("g.csv", "a,b,1\nx\nb,c,Infinity\n", ["line 3:", "not a finite number"]),
    ("g.csv", "a,b,+\nb,c,2\n", ["line 1:", 'weight "+" of edge a -> b is not a number; write 1 or -1']),
    ("g.csv", "source,target,sign\na,b,positive\nb,c,1\n", ["line 2:", 'weight "positive" of edge a -> b', "1 or -1"]),
    (
        "W.csv",
        ",ann,bob,eve\nann,0,1,0\n",
        ["line 1:", "looks like a matrix with names", "rows and columns have different ones"],
    ),
    ("el.txt", "0 1 {'weight': 1}\n", ["line 1:", "edge 0 -> 1 is not a number", "write_weighted_edgelist"]),
    ("g.csv", ",b,1\n", ["line 1:", "the source is empty"]),
    ("g.csv", "a,b,\N{MINUS SIGN}2\n", ["line 1:", "is not a number; write -2"]),
    ("g.csv", "listener,speaker,weight\na,b,1\n", ["line 1:", "names no source and target"]),
    ("g.csv", "a,b,1\nb,c,strong\n", ["line 2:", 'weight "strong" of edge b -> c is not a number']),
    ("g.csv", "origin,end,power\na,b,x\n", ["line 1:", '"power"', "header", "who is heard source"]),
    ("g.csv", "a b 1\na c 0,5\n", ["line 2:", '"0,5"', "point"]),
    ("g.csv", "a,b,1/0\n", ["line 1:", "divides by zero"]),
    ("g.csv", "a,b,1e500\n", ["line 1:", "exponent", "edge a -> b"]),
    ("g.csv", "a,b,1\nb,c,1e309\n", ["line 2:", "edge b -> c", "range of float64", "rescale"]),
    ("g.csv", "a,b,1e-320\n", ["line 1:", "range of float64"]),
    ("g.csv", "a,b," + "9" * 5000 + "\n", ["line 1:", "5000 characters is too long"]),
    ("g.csv", "a,b,1_000\n", ["line 1:", '"1_000"', "not a number"]),
    ("g.csv", "a,b,٣\n", ["line 1:", "not a number"]),
    ("g.csv", "a,b,{}\n", ["line 1:", 'weight "{}" of edge a -> b']),
    ("g.csv", "a,b,1\nb,c,0\n", ["line 2:", "weight 0 of edge b -> c", "neither ally nor opponent"]),
    ("g.csv", "a,b,0.0\nb,c,1\nc,d,-0e5\n", ["line 1:", "weight 0 of edge a -> b, c -> d (2 in all)"]),
    (
        "g.csv",
        "".join(f"a,{i},0\n" for i in range(9)),
        ["line 1:", "weight 0 of edge a -> 0, a -> 1, a -> 2, a -> 3, a -> 4 (9 in all)"],
    ),
    ("g.csv", "a,b,1\nb,c\n", ["line 2:", "edge b -> c has no weight"]),
    ("g.csv", "a,b,1\nb,c,\n", ["line 2:", "edge b -> c has no weight"]),
    ("g.csv", "a b\nb c\n", ["line 1:", "edge a -> b has no weight"]),
    ("g.csv", "source,target\na,b\n", ["line 1:", "no weight", "sign"]),
    ("g.csv", "source,target,weight,Weight\na,b,1,2\n", ["line 1:", "two columns"]),
    ("g.csv", "a,b,1\n,c,1\n", ["line 2:", "the source is empty"]),
    ("g.csv", "a,b,1\nc,,1\n", ["line 2:", "the target is empty"]),
    ("g.csv", "time,source,target,weight\n1,,,\n", ["line 2:", "the source is empty"]),
    ("g.csv", "a,b,1\nb,a,1\n\na,b,-1\n", ["line 4:", "second row for edge a -> b", "line 1", "--duplicates sum|last"]),
    ("g.csv", "a,b,1\na , b,1\n", ["line 2:", "second row for edge a -> b"]),
    (
        "g.csv",
        "a,b,1\nb,b,1\nc,c,1\n",
        ["line 2:", "self-loop at node b", "2 in all", "remove these rows", "--drop-self-loops"],
    ),
    ("g.csv", "origin end power\na b 0,5\n", ["line 1:", "who is heard source"]),
    ("g.csv", "source,target,weight\na,b,1,9\n", ["line 2:", "4 fields, and the header has 3", "quote"]),
    ("g.csv", 'a,b,1\n"b,c,1\nd,e,1\n', ["line 2:", "quote"]),
    ("g.csv", 'a,b,1\n"b"x,c,1\n', ["line 2:", "quotes"]),
    ("g.csv", 'a,b,1\n"x\ny",c,1\nc,d,nan\n', ["line 4:", '"nan"']),
    ("g.csv", 'a,b,1\n"x\ny",c,nan\n', ["line 2:", '"nan"', "x?y -> c"]),
    ("g.csv", '"x\ny"\na,b,1\na,b,1\n', ["line 4:", "line 3"]),
    ("g.csv", '"' + "x\n" * 70_000, ["line 1:", "quotes"]),
    ("g.csv", "a,b,1\n" + "x" * 70_000 + ",b,1\n", ["line 2:", "65536 characters"]),
    ("g.csv", b"a,b,1\nb,c\0,1\n", ["line 2:", "0x00", "UTF-8"]),
    ("g.csv", b"a,b,1\n\xe9,c,1\n", ["line 2:", "0xe9", "UTF-8"]),
    ("g.csv", "a,b,1\n".encode("utf-16"), ["line 1:", "UTF-16", "UTF-8"]),
    ("g.csv", mtx(), ["Matrix Market", ".mtx"]),
    ("g.csv", b"PK\3\4\0\0", ["is a zip archive", "CSV"]),
    ("g.csv.gz", gzip.compress(ROWS.encode() * 99, mtime=0)[:-12], ["gzip"]),
    ("g.csv.gz", gzip.compress(ROWS.encode() * 99, mtime=0)[:40] + b"\xff" * 40, ["gzip"]),
    ("g.csv.gz", ROWS, ["not a gzip file"]),
    ("g.csv.gz", gzip.compress(b"a,b,1\nb,c,x\n", mtime=0), ["line 2:", '"x"']),
    ("g.graphml", "", ["GraphML"]),
    ("g.graphml", "a,b,1\n", ["GraphML", "line 1"]),
    ("g.graphml", graphml()[:-40], ["GraphML", "line"]),
    ("g.graphml", "<graphml/>", ["GraphML"]),
    ("g.graphml", graphml().replace("lonely", "\xe9").encode("latin-1"), ["line 7:", "0xe9", "UTF-8"]),
    ("g.graphml", graphml().encode("utf-16"), ["UTF-8"]),
    ("g.graphml", graphml("undirected"), ["undirected", "--undirected"]),
    (
        "g.graphml",
        graphml().replace("<edge id", '<edge directed="false" id'),
        ['edge 1 -> b has directed="false"', "as two"],
    ),
    (
        "g.graphml",
        graphml("undirected").replace("<edge id", '<edge directed="true" id'),
        ['edge 1 -> b has directed="true"', "as two"],
    ),
    ("g.graphml", graphml(data=""), ["edge b -> 1 has no weight"]),
    ("g.graphml", graphml(data='<data key="d0"/>'), ["edge b -> 1 has no weight"]),
    ("g.graphml", graphml(data='<data key="d0">strong</data>'), ["GraphML", "strong"]),
    ("g.graphml", graphml(data='<data key="d0">NaN</data>'), ["edge b -> 1", "not a finite number"]),
    ("g.graphml", graphml(data='<data key="d0">1e999</data>'), ["edge b -> 1", "not a finite number"]),
    ("g.graphml", graphml(data='<data key="d0">0</data>'), ["weight 0 of edge b -> 1"]),
    (
        "g.graphml",
        graphml(data='<data key="d0">true</data>')
        .replace("double", "boolean")
        .replace(">9<", ">1<")
        .replace(">5<", ">1<")
        .replace(">2<", ">1<"),
        ['weight "true"', "not a number"],
    ),
    ("g.graphml", graphml().replace('target="1"', 'target="b"'), ["self-loop at node b"]),
    ("g.graphml", graphml().replace('target="1"', 'target="x"'), ["node x is declared 0 times"]),
    ("g.graphml", graphml().replace(' target="1"', ""), ["node None is declared 0 times"]),
    ("g.graphml", graphml().replace('id="lonely"', 'id="b"'), ["node b is declared 2 times"]),
    ("g.graphml", graphml().replace('source="b" target="1"', 'source="1" target="b"'), ["second row for edge 1 -> b"]),
    (
        "g.graphml",
        graphml().replace('<edge source="b" target="1"', '<edge id="e1" source="1" target="b"'),
        ["second row"],
    ),
    ("g.graphml", graphml().replace("<graphml", "<!DOCTYPE g><graphml"), ["DOCTYPE"]),
    (
        "g.graphml",
        '<!DOCTYPE g [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n<graphml>&b;</graphml>',
        ["DOCTYPE"],
    ),
    ("g.graphml", graphml().replace("</graph>", "</graph><graph/>"), ["second or nested"]),
    ("g.graphml", graphml().replace('<node id="b"/>', '<node id="b"><graph/></node>'), ["second or nested"]),
    ("g.graphml", graphml().replace('<node id="lonely"/>', "<hyperedge/>"), ["hyperedge"]),
    ("g.gml", "", ["no graph"]),
    ("g.gml", gml()[:-3], ["expected ']'"]),
    ("g.gml", gml() + "]", ["expected EOF", "10"]),
    ("g.gml", gml() + '"', ["GML", "10"]),
    ("g.gml", gml() + gml(), ["more than one graph"]),
    ("g.gml", "graph [ " + "a [ " * 5000, ["GML", "recursion"]),
    ("g.gml", "5 6 7", ["GML"]),
    ("g.gml", gml("0"), ["directed 0", "--undirected"]),
    ("g.gml", gml().replace("directed 1", ""), ["directed 0", "--undirected"]),
    ("g.gml", gml('"0"'), ["neither 0 nor 1"]),
    ("g.gml", gml("0 directed 1"), ["neither 0 nor 1"]),
    ("g.gml", gml().replace("edge [ source 1", "Edge [ source 1"), ["Edge", "lower case"]),
    ("g.gml", gml().replace("node [ id 1", "Node [ id 1").replace("target 1", "target 3"), ["GML"]),
    ("g.gml", gml(weight=""), ["edge a ä b -> 1 has no weight"]),
    ("g.gml", gml(weight="weight 1 weight 2"), ['named "weight"', "(1 and 2)"]),
    ("g.gml", gml(weight="weight 1e5x"), ['"1e5x"', "line "]),
    ("g.gml", gml(weight="weight NAN"), ['"nan"', "not a finite number"]),
    ("g.gml", gml(weight="weight 0.0"), ["weight 0 of edge a ä b -> 1"]),
    ("g.gml", gml().replace('label "1"', 'label "a &#228; b"'), ['two nodes have the label "a ä b"']),
    ("g.gml", gml().replace('label "a &#228; b"', "label 1"), ['two nodes have the label "1"']),
    ("g.gml", gml().replace('label "1"', "label 1.50"), ["label 1.5", "quotes"]),
    ("g.gml", gml().replace("id 1 ", "id 3 "), ["duplicated"]),
    ("g.gml", gml().replace("id 1 ", ""), ["no 'id'"]),
    ("g.gml", gml().replace("target 3", "target 4"), ["undefined target 4"]),
    ("g.gml", gml().replace("target 3", ""), ["no 'target'"]),
    ("g.gml", gml().replace("source 1 target 3", "source 3 target 1"), ["second row for edge a ä b -> 1"]),
    ("g.net", "", ["*Vertices"]),
    ("g.net", "1 2 3\n", ["*Vertices"]),
    ("g.net", "*Vertices many\n", ["*Vertices n"]),
    ("g.net", "*Vertices 999999999\n", ["more than"]),
    ("g.net", pajek("*Edges"), ["*Edges", "--undirected"]),
    ("g.net", pajek() + "*Arcs :2\n2 3 1\n", ['several relations ("1", "2")', "--variable"]),
    ("g.net", pajek() + "*Rows\n2 3 1\n", ["line 9:", '"*Rows"', "lists of *Arcs"]),
    ("g.net", pajek("*Matrix"), ["line 7:", "not 3 rows of 3 numbers"]),
    ("g.net", pajek("*Arcslist"), ["line 7:", "1 to 3"]),
    ("g.net", pajek() + "1 3\n", ["edge New York -> c has no weight"]),
    ("g.net", pajek() + "1 3 strong\n", ["edge New York -> c has no weight"]),
    ("g.net", pajek() + "1\n", ['row "1"', "1 to 3"]),
    ("g.net", pajek() + "1 3 0\n", ["weight 0 of edge New York -> c"]),
    ("g.net", pajek() + "1 3 nan\n", ['"nan"', "not a finite number"]),
    ("g.net", pajek() + "1 4 1\n", ['row "1 4 1"', "1 to 3"]),
    ("g.net", pajek().replace("3 c", "3 4") + "1 4 1\n", ['row "1 4 1"', "1 to 3"]),
    ("g.net", pajek() + "1 2 1\n", ["second row for edge New York -> 2"]),
    ("g.net", pajek().replace("3 c", "4 c"), ["1 to 3"]),
    ("g.net", pajek().replace("3 c", "1 c"), ["declared twice"]),
    ("g.net", pajek().replace("3 c", "3 2"), ["same label"]),
    ("g.net", pajek().replace("York", 'York"'), ["Pajek", "quotation"]),
    ("g.mtx", "", ["line 1:", "%%MatrixMarket"]),
    ("g.mtx", mtx("pattern"), ["line 1:", "pattern"]),
    ("g.mtx", mtx("complex"), ["line 1:", "complex"]),
    ("g.mtx", mtx(symmetry="symmetric"), ["symmetric", "--undirected"]),
    ("g.mtx", mtx(symmetry="hermitian"), ["line 1:", "hermitian"]),
    ("g.mtx", mtx(symmetry="skew-symmetric"), ["line 1:", "skew-symmetric"]),
    ("g.mtx", mtx().replace("3 3 2", "3 4 2"), ["(3, 4)", "square"]),
    ("g.mtx", mtx().replace("3 3 2", "3 3"), ["2 entries"]),
    ("g.mtx", mtx().replace("3 3 2", "many"), ["Matrix Market"]),
    ("g.mtx", mtx().replace("3 3 2", "999999999 999999999 2"), ["more than"]),
    ("g.mtx", mtx().replace("3 3 2", "3 3 9"), ["2 entries", "9"]),
    ("g.mtx", mtx(weight="nan"), ["row 2, column 1:", '"nan"', "edge 1 -> 2"]),
    ("g.mtx", mtx(weight="0"), ["row 2, column 1:", "weight 0 of edge 1 -> 2"]),
    ("g.mtx", mtx(weight=""), ["Matrix Market", "3 columns"]),
    ("g.mtx", mtx(weight="1 7"), ["Matrix Market", "3 columns"]),
    ("g.mtx", mtx(weight="1/3"), ["Matrix Market", "1/3"]),
    ("g.mtx", mtx(weight="1,5"), ["Matrix Market", "1,5"]),
    ("g.mtx", mtx(weight="strong"), ["Matrix Market", "strong"]),
    ("g.mtx", mtx("integer"), ["Matrix Market", "0.1"]),
    ("g.mtx", mtx().replace("2 1 ", "2 4 "), ["Matrix Market", "outside the 3 x 3 matrix"]),
    ("g.mtx", mtx().replace("2 1 ", "2 0 "), ["Matrix Market", "outside the 3 x 3 matrix"]),
    ("g.mtx", mtx().replace("2 1 ", "2 2 "), ["row 2, column 2:", "self-loop at node 2"]),
    ("g.mtx", mtx().replace("2 1 ", "3 2 "), ["row 3, column 2:", "second row"]),
    ("g.mtx", "%%MatrixMarket matrix array real general\n2 2\n0\n1\nx\n0\n", ["Matrix Market", "'x'"]),
    ("g.mtx", "%%MatrixMarket matrix array real general\n2 2\n0\n1\n1\n", ["3 entries"]),
    ("g.mtx", "%%MatrixMarket matrix array real general\n2000000 2000000\n0\n1\n1\n", ["3 entries"]),
    ("g.npy", b"", ["NumPy"]),
    ("g.npy", npy(MATRIX)[:-1], ["NumPy"]),
    ("g.npy", npy(np.array([[0, Fraction(1)], [1, 0]], dtype=object)), ["NumPy"]),
    ("g.npy", npy(MATRIX[:2]), ["(2, 3)", "square"]),
    ("g.npy", npy(MATRIX[0]), ["square"]),
    ("g.npy", npy(np.float64(3)), ["square"]),
    ("g.npy", npy(MATRIX != 0), ["bool"]),
    ("g.npy", npy(MATRIX * 1j), ["complex"]),
    ("g.npy", npy(MATRIX * math.nan), ["weight nan", "row 1, column 1"]),
    ("g.npy", npy(np.where(MATRIX < 0, math.inf, MATRIX)), ["row 2, column 1", "weight inf of edge 1 -> 2"]),
    ("g.npy", npy(MATRIX * 1e-308), ["range of float64"]),
    ("g.npy", npy(MATRIX + np.eye(3)), ["row 1, column 1", "self-loop", "3 in all"]),
    ("g.npy", npy(np.zeros((0, 0))), ["no node"]),
    ("g.npz", b"PK\3\4 nothing more", ["npz"]),
    ("g.npz", npz(a=MATRIX)[:200], ["npz"]),
    ("g.npz", npz(), ["no square numeric matrix", "nothing"]),
    ("g.npz", npz(a=MATRIX, b=MATRIX), ["several square matrices", "a, b"]),
    ("g.npz", npz(a=MATRIX[0], b=np.array("x")), ["no square numeric matrix", "a, b"]),
    ("g.npz", npz(a=MATRIX, labels=np.array(["a", "b"])), ["labels", "3"]),
    ("g.npz", npz(a=MATRIX, labels=np.array(["a", "b", "a"])), ["two nodes have the label"]),
    ("g.npz", npz(a=np.array([[0, Fraction(1)], [1, 0]], dtype=object)), ["npz"]),
    ("g.npz", sparse_npz(indices=np.array([2, 0, 7])), ["npz"]),
    ("g.npz", sparse_npz(indptr=np.array([0, 10**6, 2, 3])), ["npz"]),
    ("g.npz", sparse_npz(shape=np.array([10**12, 10**12])), ["npz"]),
    ("g.npz", sparse_npz(shape=np.array([-3, -3])), ["npz"]),
    ("g.npz", sparse_npz(format=np.array(b"bsr")), ["layout bsr", "tocsr"]),
    ("g.npz", sparse_npz(indptr=np.array([0, 1, 3, -1])), ["npz", "inconsistent"]),
    ("g.npz", sparse_npz(data=np.array([2.5, -1, 0])), ["row 3, column 2:", "weight 0 of edge 2 -> 3"]),
    ("g.mat", b"", ["MATLAB"]),
    ("g.mat", b"MATLAB 7.3 MAT-file" + bytes(600), ["7.3", "-v7"]),
    ("g.mat", mat(W=MATRIX)[:-20], ["MATLAB"]),
    ("g.mat", mat(W=MATRIX, A=MATRIX), ["several square matrices", "W, A"]),
    ("g.mat", mat(x=[1.0, 2.0], s="text"), ["no square numeric matrix", "x, s"]),
    ("g.mat", mat(W=MATRIX * 1j), ["no square numeric matrix", "W"]),
    ("g.mat", mat(W=sparse.csc_array(MATRIX * 1j)), ["no square numeric matrix"]),
    ("g.mat", mat(W=MATRIX != 0), ["no square numeric matrix", "W"]),
    ("g.mat", mat4(W=MATRIX), ["MATLAB 5", "-v7"]),
    ("g.mat", mat(W=MATRIX * math.nan), ["weight nan"]),
]


@pytest.mark.parametrize(
    ("name", "content", "words"), BAD_FILES, ids=[f"{name}, {words[0]}" for name, _, words in BAD_FILES]
)
def test_a_bad_file_is_refused_with_one_line_that_names_it(put, name, content, words):
    path = put(name, content)
    with pytest.raises(FormatError) as caught:
        read_graph(path)
    message = one_line(caught.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message
    assert len(message) < len(str(path)) + 420
    assert caught.value.__cause__ is None


def test_a_refusal_is_a_graph_error_and_a_value_error():
    assert issubclass(FormatError, GraphError) and issubclass(GraphError, ValueError)
    with pytest.raises(ValueError, match="input, line 1"):
        text("a,b,x\n")
    assert not issubclass(NumberError, FormatError)


def test_what_merging_cannot_mend_is_refused(put):
    path = put("g.csv", "a,b,1\na,c,1\na,b,-1\n")
    with pytest.raises(FormatError, match="line 1: sum 0 of the weights of edge a -> b"):
        read_graph(path, duplicates="sum")
    with pytest.raises(FormatError, match="line 2: weight 0 of edge a -> b"):
        text("a,b,1\na,b,0\n", duplicates="last")
    with pytest.raises(FormatError, match="line 2: second row for edge b -> a"):
        text("a,b,1\nb,a,1\n", undirected=True)


def test_a_missing_file_a_folder_and_a_closed_file_are_refused(tmp_path, put):
    with pytest.raises(FormatError, match=r"nothing\.csv: no such file"):
        read_graph(tmp_path / "nothing.csv")
    with pytest.raises(FormatError, match="is a directory"):
        read_graph(tmp_path)
    with pytest.raises(FormatError, match="cannot be read"):
        read_graph("a\0b")
    with pytest.raises(FormatError, match="int is no file"):
        read_graph(5)  # type: ignore[arg-type]
    file = put("g.csv", "a,b,1\n").open()
    file.close()
    with pytest.raises(FormatError, match="cannot be read"):
        read_graph(file)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions do not bind this user")
def test_a_file_without_permission_is_refused(put):
    path = put("g.csv", "a,b,1\n")
    path.chmod(0)
    with pytest.raises(FormatError, match="permission denied"):
        read_graph(path)


def test_permission_errors_are_one_line(put, monkeypatch):
    path = put("g.csv", "a,b,1\n")

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(FormatError, match=r"g\.csv: cannot be read \(permission denied\)"):
        read_graph(path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"orientation": "sideways"}, "information, listens"),
        ({"duplicates": "first"}, "refuse, sum, last"),
        ({"format": "xlsx"}, "csv"),
    ],
)
def test_unknown_options_are_refused(options, words):
    with pytest.raises(ParameterError, match=words) as caught:
        text("a,b,1\n", **options)
    one_line(caught.value)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("g.mtx", mmwrite),
        ("g.mtx", lambda path, matrix: mmwrite(path, sparse.coo_array(matrix))),
        ("g.npy", np.save),
        ("g.npz", write_npz),
        ("g.npz", lambda path, matrix: sparse.save_npz(path, sparse.csc_array(matrix))),
        ("g.mat", lambda path, matrix: savemat(path, {"W": matrix})),
    ],
)
def test_rows_of_a_matrix_file_listen_unless_it_is_said_that_they_inform(tmp_path, name, write):
    write(tmp_path / name, MATRIX)
    turned = {(t, s, w) for s, t, w in edges(read_graph(tmp_path / name))}
    for orientation, said in ((None, "matrix"), ("listens", "matrix"), ("information", "information")):
        graph = read_graph(tmp_path / name, orientation=orientation)
        assert (edges(graph) == turned) == (said == "information")
        assert graph.read["orientation"] == said


def test_a_file_of_a_networkx_matrix_is_the_networkx_graph(tmp_path):
    graph = nx.DiGraph()
    graph.add_weighted_edges_from([(1, 2, 2.5), (2, 3, -1.0), (3, 1, 0.5)])
    np.save(tmp_path / "g.npy", nx.to_numpy_array(graph))
    assert read_graph(tmp_path / "g.npy", orientation="information") == SignedDigraph.from_networkx(graph)
    with pytest.raises(FormatError, match="row 2, column 2: self-loop at node 2"):
        np.save(tmp_path / "g.npy", np.diag([0.0, 1.0]))
        read_graph(tmp_path / "g.npy", orientation="information")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("g.csv.gz", gzip.compress(b"#" * 99 + b"\n" + b"#\n" * 10_000, mtime=0)),
        ("g.csv", b"#\n" * 10_000),
        ("g.npz", npz(a=np.zeros((100, 100)))),
        ("g.mat", mat(W=np.zeros((100, 100)))),
    ],
)
def test_a_file_that_unpacks_to_too_much_is_refused(put, monkeypatch, name, content):
    monkeypatch.setattr(files, "MAX_BYTES", 15_000)
    with pytest.raises(FormatError, match="more than 15000 bytes"):
        read_graph(put(name, content))


def test_binary_formats_are_not_read_from_text():
    with pytest.raises(FormatError, match="not a NumPy array file"):
        text("a", format="npy")


@pytest.mark.few(0)
@given(st.sampled_from(["csv", "graphml", "gml", "net", "mtx", "npy", "npz", "mat"]), st.data())
@settings(max_examples=150)
def test_a_damaged_file_gives_a_graph_or_one_line(kind, data):
    whole = {
        "csv": (ROWS + '"x ""y""",z,1\n').encode(),
        "graphml": graphml().encode(),
        "gml": gml().encode(),
        "net": pajek().encode(),
        "mtx": mtx().encode(),
        "npy": npy(MATRIX),
        "npz": sparse_npz(),
        "mat": mat(W=sparse.csc_array(MATRIX)),
    }[kind]
    at = data.draw(st.integers(0, len(whole) - 1))
    damage = data.draw(st.sampled_from(["cut", "flip", "insert", "drop"]))
    some = data.draw(st.binary(min_size=1, max_size=4))
    damaged = {
        "cut": whole[:at],
        "flip": whole[:at] + some + whole[at + len(some) :],
        "insert": whole[:at] + some + whole[at:],
        "drop": whole[:at] + whole[at + len(some) :],
    }[damage]
    try:
        graph = read_graph(io.BytesIO(damaged), format=kind)
    except PTCCError as error:
        assert one_line(error).startswith("input")
    else:
        assert graph.n_nodes >= 1


@given(st.binary(max_size=200))
def test_noise_gives_a_graph_or_one_line(noise):
    try:
        read_graph(io.BytesIO(noise))
    except FormatError as error:
        one_line(error)


@pytest.mark.few(0)
@given(st.text(st.sampled_from('ab01., \t;"#%\n\r-'), max_size=60))
@settings(max_examples=200)
def test_what_is_read_can_be_written_and_read_again(tmp_path_factory, content):
    try:
        graph = text(content, duplicates="last", drop_self_loops=True)
    except FormatError as error:
        one_line(error)
        return
    path = tmp_path_factory.mktemp("again") / "g.csv"
    write_graph(graph, path)
    assert read_graph(path) == graph


# ---------------------------------------------------------------------------------------------- starts

START = [Fraction(5), Fraction(-1, 10), Fraction(1, 3)]


@pytest.mark.parametrize(
    "content", ["5,-0.1,1/3", " 5 , -1e-1 , 2/6 ", "a=5,b=-0.1,c=1/3", "c = 1/3, a=5 , b = -0.1", '"c=1/3",a=5,b=-0.1']
)
def test_a_start_by_position_or_by_name(content):
    assert read_state(content, GRAPH) == START


@pytest.mark.parametrize(
    "content",
    [
        "a,5\nb,-0.1\nc,1/3\n",
        "# start\nnode,value\nc,1/3\na,5\n\nb,-0.1,further\n",
        "Value;Label\n5;a\n-0.1;b\n1/3;c\n",
        "a 5\nb -0.1\nc 1/3\n",
        '"c",1/3\r\n"a",5\r\n"b",-0.1\r\n',
    ],
)
def test_a_start_from_a_file(put, content):
    path = put("x0.csv", content)
    assert read_state(path, GRAPH) == START
    assert read_state(str(path), GRAPH) == START


def test_odd_labels_in_a_start(put):
    graph = SignedDigraph.from_edges([("a,b", "x=y", 1), ("a,b", "two\nlines", 1)])
    assert graph.labels == ("a,b", "x=y", "two\nlines")
    expected = [Fraction(i) for i in range(1, 4)]
    assert read_state('"a,b=1",x=y=2,"two\nlines=3"', graph) == expected
    assert read_state(put("x0.csv", '"two\nlines",3\nx=y,2\n"a,b",1\n'), graph) == expected


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("5,2", ["2 values for 3 nodes", "a, b, c"]),
        ("5", ["1 value for 3 nodes"]),
        ("5,2,1,0", ["4 values"]),
        ("", ["no such file", "1 value for 3 nodes"]),
        ("x0.csv", ['"x0.csv"', "no such file"]),
        ("5,,1", ["value of node b"]),
        ("5,nan,1", ["node b", '"nan" is not a finite number']),
        ("5,1,inf", ["node c", "not a finite number"]),
        ("5,1,1/0", ["node c", "divides by zero"]),
        ("5,1,1e999", ["node c", "exponent"]),
        ("5,1,x", ["node c", '"x" is not a number']),
        ("5 1 2", ["separate the values by commas"]),
        ("[5,1,2]", ["separate the values by commas, without brackets"]),
        ("5;1;2", ["separate the values by commas"]),
        ("a=1 b=2 c=3", ["separate the values by commas", "a=5,b=2,c=-4"]),
        ("a=1,5;b=2;c=3", ["separate the values by commas", "a=5,b=2,c=-4"]),
        ("a:1,b:2,c:3", ["separate the values by commas", "a=5,b=2,c=-4"]),
        ("5,1,\N{MINUS SIGN}2", ["node c", "write the minus as -"]),
        ("a=1,b=2", ["1 of 3 nodes have no value: c"]),
        ("a=1", ["2 of 3 nodes have no value: b, c"]),
        ("a=1,b=2,c=3,d=4", ['node "d" is not in the graph', "a, b, c"]),
        ("a=1,b=2,c=3,a=1", ["node a has two values"]),
        ("a=1,b=2,3", ['"3" is not label=value']),
        ("a=1,b=,c=3", ["node b"]),
        ('a=1,"b=2,c=3', ["quote"]),
    ],
)
def test_a_wrong_initial_state_is_refused(content, words):
    with pytest.raises(ParameterError) as caught:
        read_state(content, GRAPH)
    message = one_line(caught.value)
    assert message.startswith("initial state")
    for word in words:
        assert word in message


def test_labels_with_commas_stand_in_quotes():
    cars = SignedDigraph.from_edges([("my car", "your, car", 1)])
    with pytest.raises(ParameterError, match='"your" is not label=value; write labels with a comma in quotes'):
        read_state("my car=1,your, car=2", cars)
    for text in ('my car=1,"your, car"=2', '"your, car"=2, "my car" = 1', 'my car=1,"your, car=2"'):
        assert read_state(text, cars) == [1, 2]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["3 of 3 nodes have no value: a, b, c"]),
        ("a,1\nb,2\n", ["1 of 3 nodes have no value: c"]),
        ("a,1\n\nb,2\nc,3\nd,4\n", ["line 5:", 'node "d" is not in the graph']),
        ("node,value\na,1\na,2\n", ["line 3:", "two values"]),
        ("a,1\nb,nan\n", ["line 2:", "node b", "not a finite number"]),
        ("node,x,y\na,1,2\nb,1,2\nc,1,2\n", ["line 1:", "coordinates of a vector", "keep one column"]),
        ("a,1\nb\n", ["line 2:", "node,value"]),
        ("1\n2\n3\n", ["line 1:", "node,value"]),
        ('a,1\n"b,2\n', ["line 2:", "quote"]),
        ('"a\nb",1\n', ["line 1:", "a?b"]),
        (b"a,\xff\n", ["line 1", "UTF-8"]),
    ],
)
def test_a_wrong_start_file_is_refused(put, content, words):
    path = put("x0.csv", content)
    with pytest.raises(FormatError) as caught:
        read_state(path, GRAPH)
    message = one_line(caught.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_a_missing_start_file_is_refused(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
        read_state(tmp_path / "x0.csv", GRAPH)


@pytest.mark.few(0)
@given(graphs(odd_text.map(plain)), st.data())
@settings(max_examples=80)
def test_a_start_is_read_exactly_from_a_file_of_quoted_labels(tmp_path_factory, graph, data):
    values = [Fraction(data.draw(weight)) for _ in graph.labels]
    rows = ['"' + label.replace('"', '""') + f'",{value}\n' for label, value in zip(graph.labels, values, strict=True)]
    path = tmp_path_factory.mktemp("start") / "x0.csv"
    path.write_bytes(("node,value\n" + "".join(data.draw(st.permutations(rows)))).encode())
    assert read_state(path, graph) == values


# ---------------------------------------------------------------------------------------------- whole or not at all


@pytest.mark.parametrize(
    ("data", "content"), [("tëxt\n", "tëxt\n".encode()), (b"\0\xff\r\n", b"\0\xff\r\n"), ("", b"")]
)
def test_what_is_written_is_there(tmp_path, data, content):
    path = tmp_path / "a.txt"
    for _ in range(2):
        write_atomically(path, data)
        assert path.read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_atomically(path, "old")

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(FormatError, match=r"a\.txt: cannot be written \(no space left on device\)") as caught:
        write_atomically(path, "new")
    one_line(caught.value)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_an_interrupt_leaves_nothing(tmp_path, monkeypatch):
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "a.txt", "new")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("", "x", "is a directory"),
        ("missing/a.txt", "x", "folder does not exist"),
        ("a\0b", "x", "cannot be written"),
        ("n" * 5000, "x", "cannot be written"),
        ("a.txt", "\ud800", "cannot be written"),
    ],
)
def test_where_nothing_can_be_written(tmp_path, name, data, reason):
    with pytest.raises(FormatError, match=reason) as caught:
        write_atomically(os.path.join(tmp_path, name), data)  # noqa: PTH118 - pathlib would refuse some
    one_line(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_file_where_a_folder_is_needed(tmp_path):
    write_atomically(tmp_path / "a", "x")
    with pytest.raises(FormatError):
        write_atomically(tmp_path / "a" / "b", "x")


@pytest.mark.skipif(os.name != "posix", reason="links, modes and devices of POSIX")
def test_links_are_followed_modes_kept_and_devices_written_to(tmp_path):
    path, link = tmp_path / "a.txt", tmp_path / "link"
    write_atomically(path, "one")
    path.chmod(0o640)
    link.symlink_to(path)
    write_atomically(link, "two")
    assert link.is_symlink() and path.read_text() == "two"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    write_atomically("/dev/null", "three")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


# ---------------------------------------------------------------------------------------------- real graphs


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "nodes", "edges_", "negative", "loops"),
    [
        ("soc-sign-bitcoinotc.csv.gz", 5881, 35592, 3563, 0),
        ("wiki-elec.txt.gz", 7115, 103689, 22344, 0),
        ("soc-sign-epinions.txt.gz", 131828, 840799, 123670, 573),
    ],
)
def test_large_rating_data_as_published(real_data, name, nodes, edges_, negative, loops):
    graph = read_graph(real_data / name, orientation="listens", drop_self_loops=bool(loops))
    assert (graph.n_nodes, graph.n_edges, int((graph.sign < 0).sum())) == (nodes, edges_, negative)
    assert graph.read["self_loops"] == (f"dropped {loops}" if loops else "refused")
    assert graph.labels[:3] == (("1", "2", "3") if "bitcoin" in name else ("0", "1", "2"))


def test_a_rater_listens_to_the_rated(real_data):
    graph = read_graph(real_data / "soc-sign-bitcoinotc.csv.gz", orientation="listens")
    assert ("2", "6", Fraction(4)) in edges(graph)
    assert graph.read["notes"] == ("columns ignored: after the third",)


def test_a_file_of_raters_that_is_read_as_information_says_so():
    table = "rater,rated,rating\na,b,1"
    assert "raters listen? --edges listens" in read_graph(io.StringIO(table)).read["notes"]
    assert read_graph(io.StringIO(table), orientation="listens").read["notes"] == ()


@pytest.mark.parametrize("columns", ["listener,speaker,w", "1,2,3"])
def test_where_the_title_of_a_told_source_says_that_it_listens_a_note_asks(columns: str):
    table = "listener,speaker,w\na,b,1\nb,c,-1"
    asks = "listener listens to speaker? --edges listens"
    graph = read_graph(io.StringIO(table), columns=columns)
    assert ("a", "b", Fraction(1)) in edges(graph) and asks in graph.read["notes"]  # read as ever
    for told in ("listens", "information"):
        assert asks not in read_graph(io.StringIO(table), orientation=told, columns=columns).read["notes"]
    swapped = read_graph(io.StringIO(table), columns="speaker,listener,w")
    assert not any("listens" in note for note in swapped.read["notes"])
    with pytest.raises(FormatError, match=r"listener listens to speaker, edges the opposite; .* listener,speaker,w"):
        read_graph(io.StringIO(table), orientation="listens", columns="speaker,listener,w")


def test_a_header_of_two_columns_may_call_the_values_anything(tmp_path):
    graph = read_graph(io.StringIO("a b;name;1\nname;a b;1"))
    (tmp_path / "x.csv").write_text("name,opinion\na b,2\nname,3\n")
    assert read_state(tmp_path / "x.csv", graph) == [2, 3]
    (tmp_path / "x.csv").write_text("name,3\na b,2\n")
    assert read_state(tmp_path / "x.csv", graph) == [2, 3]
    with pytest.raises(ParameterError, match="1 of 2 nodes have no value: name"):
        read_state("a b=3", graph)


def test_small_real_graphs(real_data):
    for path in sorted(real_data.glob("*.csv")):
        if "unknown" in path.name:
            with pytest.raises(FormatError) as caught:
                read_graph(path)
            assert "line 38: weight 0 of edge v_FANCD2I -> v_MRN" in one_line(caught.value)
        else:
            assert read_graph(path).n_edges > 0


@pytest.mark.few(0)
def test_self_loops_of_epinions_are_refused_by_name(real_data):
    with pytest.raises(FormatError, match=r"line \d+: self-loop at node \d+ \(573 in all\)"):
        read_graph(real_data / "soc-sign-epinions.txt.gz", orientation="listens")
