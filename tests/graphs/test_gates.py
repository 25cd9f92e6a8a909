"""The gates: one for graphs and one for states, and every function passes what it is given through them."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

import ptcc_certify as ptcc
from ptcc_certify.errors import FormatError, GraphError, ParameterError, PTCCError
from ptcc_certify.graphs.io import as_graph, as_state, write_graph

EDGES = [("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)]
TEAM = as_graph(EDGES)
PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)


def forms():
    """Yield the same graph in every form."""
    nx, pd = pytest.importorskip("networkx"), pytest.importorskip("pandas")
    digraph = nx.DiGraph()
    digraph.add_weighted_edges_from(EDGES)
    frame = pd.DataFrame(EDGES, columns=["source", "target", "weight"])
    yield "itself", TEAM, None
    yield "structure", ptcc.analyse(TEAM), None
    yield "networkx", digraph, None
    yield "tuples", tuple(EDGES), None
    yield "generator", (edge for edge in EDGES), None
    yield "lists", [list(edge) for edge in EDGES], None
    yield "turned tuples", [(b, a, w) for a, b, w in EDGES], "listens"
    yield "edges of a frame", frame, None
    yield "other columns", frame.assign(year=1999)[["year", "weight", "target", "source"]], None
    yield "other names", frame.rename(columns={"source": "from", "target": "to", "weight": "rating"}), None
    W = TEAM.adjacency().toarray()
    labels = list(TEAM.labels)
    yield "adjacency frame", pd.DataFrame(W, index=labels, columns=labels), "listens"
    yield "turned adjacency frame", pd.DataFrame(W.T, index=labels, columns=labels), "information"


@pytest.mark.parametrize("number", range(12))
def test_a_graph_is_the_same_in_whatever_form_it_is_given(number):
    _, form, orientation = list(forms())[number]
    assert as_graph(form, orientation) == TEAM


@pytest.mark.parametrize("kind", [np.array, np.ndarray.tolist, sparse.csr_array, sparse.csr_matrix, sparse.coo_array])
def test_a_matrix_is_read_as_the_orientation_says_and_never_without(kind):
    W = np.array([[0, -2, 0], [1, 0, 0], [0, 3, 0]])
    numbered = as_graph([("2", "1", -2), ("1", "2", 1), ("2", "3", 3)])
    assert as_graph(kind(W), "listens") == numbered == as_graph(kind(W.T.copy()), "information")
    with pytest.raises(GraphError, match=r'"listens"\) .* "information"'):
        as_graph(kind(W))


def test_a_path_and_a_packaged_name_are_read(tmp_path):
    write_graph(TEAM, tmp_path / "team.csv")
    assert as_graph(tmp_path / "team.csv") == as_graph(str(tmp_path / "team.csv")) == TEAM
    assert as_graph("fig1a").n_nodes == 6
    assert as_graph("highland_tribes").n_edges == 2 * (29 + 29)


def test_a_file_counts_before_a_packaged_graph_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_graph(TEAM, "fig1a")
    assert as_graph("fig1a") == TEAM


def test_columns_of_a_frame_that_are_ignored_are_told():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"source": ["a"], "target": ["b"], "weight": [1], "year": [1999]})
    assert as_graph(frame).read["notes"] == ('columns ignored: "year"',)


REFUSED = {
    "nothing": (None, "give a SignedDigraph, a path"),
    "number": (5, "5 is not read as a graph"),
    "dictionary": ({("a", "b"): 1}, "list of \\(source, target, weight\\)"),
    "unknown name": ("fig9", "no such file, and no packaged graph \\(fig1a"),
    "missing file": (Path("nowhere.csv"), "no such file"),
    "pairs": ([("a", "b")], "not a triple"),
    "array of edges": (np.ones((2, 3)), "write edges as a list"),
    "three by three": ([[1, 2, 1], [2, 3, 1], [3, 1, 1]], "edges as tuples"),
    "no edge": ([], "no nodes"),
    "zero weight": ([("a", "b", 0)], "weight 0 of edge a -> b"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_graph_is_refused_in_one_line_that_names_the_mend(case):
    data, words = REFUSED[case]
    with pytest.raises(GraphError, match=words) as caught:
        as_graph(data)
    assert "\n" not in str(caught.value)


def test_an_undirected_networkx_graph_is_refused_with_the_mend():
    nx = pytest.importorskip("networkx")
    with pytest.raises(GraphError, match="to_directed"):
        as_graph(nx.Graph([("a", "b", {"weight": 1})]))
    with pytest.raises(GraphError, match=r"has no attribute .* name the attribute"):
        as_graph(nx.DiGraph([("a", "b")]))


def test_frames_that_are_no_graph_are_refused_with_the_mend():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"source": ["a", None], "target": ["b", "c"], "weight": [1, 2]})
    for bad, words in (
        (frame, "row 2, source of the DataFrame names no node"),
        (frame.rename(columns={"source": "who"}), "name them source, target, weight"),
        (frame[["source", "target"]], "names no weight"),
    ):
        with pytest.raises(GraphError, match=words):
            as_graph(bad)


def test_a_graph_that_has_its_orientation_takes_no_other():
    with pytest.raises(ParameterError, match="leave out orientation"):
        as_graph(TEAM, "listens")


@pytest.mark.few(0)
def test_every_function_takes_a_graph_in_every_form():
    W, x0 = TEAM.adjacency().toarray(), [5, 2, -4]
    cert = ptcc.certify(ptcc.as_graph(W, "listens"), PROTOCOL, x0, asks=ptcc.Asks(simulation=False))
    assert cert.graph.sha256 == as_graph(W, "listens").sha256
    assert ptcc.simulate(ptcc.as_graph(W, "listens"), PROTOCOL, x0, samples=3).graph == cert.graph
    assert ptcc.analyse(W, "listens").claim == cert.claim
    assert ptcc.final_state(EDGES, x0).states == ptcc.final_state(W, x0, orientation="listens").states
    assert ptcc.influence(EDGES).row(0) == ptcc.influence(W, orientation="listens").row(0)
    assert ptcc.design(EDGES, max_input=10, initial_bound=1).deadline > 0
    assert ptcc.worst_initial_state(EDGES, PROTOCOL, 1).size > 0
    (row,) = ptcc.certify_many([EDGES], PROTOCOL)
    assert row["nodes"] == 3 and not row["error"]


STATES = {
    "list": [5, 2, -4],
    "tuple": (5, 2, -4),
    "array": np.array([5.0, 2.0, -4.0]),
    "column": np.array([[5], [2], [-4]]),
    "texts": ["5", "2", "-4"],
    "rationals": [Fraction(5), Fraction(2), Fraction(-4)],
    "labels": {"eve": -4, "ann": 5, "bob": 2},
    "command line": "5,2,-4",
    "labelled text": "eve=-4, ann=5, bob=2",
}


@pytest.mark.parametrize("form", STATES)
def test_a_state_is_the_same_in_whatever_form_it_is_given(form):
    assert as_state(STATES[form], TEAM) == [5, 2, -4]
    assert ptcc.simulate(TEAM, PROTOCOL, STATES[form], samples=3).states[:, 0].tolist() == [5, 2, -4]
    sliding = ptcc.simulate(TEAM, ptcc.SlidingModeProtocol(), STATES[form], sigma0=STATES[form], times=[0])
    assert sliding.states[:, 0].tolist() == sliding.sliding.sigma0.tolist() == [5, 2, -4]


def test_a_state_is_read_from_series_frames_and_files(tmp_path):
    pd = pytest.importorskip("pandas")
    series = pd.Series({"eve": -4, "ann": 5, "bob": 2})
    table = series.rename_axis("node").reset_index(name="value")
    table.to_csv(tmp_path / "x0.csv", index=False)
    for form in (series, series.to_frame("x"), table, tmp_path / "x0.csv", str(tmp_path / "x0.csv")):
        assert as_state(form, TEAM) == [5, 2, -4]


def test_a_random_state_is_that_of_the_command_line():
    from ptcc_certify.cli.options import read_initial_state

    assert as_state("random", TEAM) == read_initial_state("random", 0, TEAM)
    assert as_state("random", TEAM, "sigma0") == read_initial_state("random", [0, 1], TEAM)


@pytest.mark.parametrize(
    "bad",
    [3, None, [1], [1, 2, 3, 4], {1, 2, 3}, "1,2", [1, 2, None], [1, 2, float("nan")], [1, 2, 10**400], {1: 1}],
)
def test_a_bad_state_is_refused_alike_by_simulation_and_certificate(bad):
    messages = []
    for ask in (ptcc.simulate, ptcc.certify, lambda *args, **more: ptcc.final_state(TEAM, bad)):
        if ask is ptcc.certify and bad is None:
            continue  # a certificate needs no initial state
        with pytest.raises(PTCCError) as caught:
            ask(TEAM, PROTOCOL, bad)
        messages.append(str(caught.value))
    assert len(set(messages)) == 1 and "\n" not in messages[0]


def test_a_protocol_that_is_none_is_refused_with_the_mend():
    for ask in (ptcc.simulate, ptcc.certify, ptcc.certify_many):
        with pytest.raises(ParameterError, match="give NominalProtocol"):
            ask(TEAM, 0.6, x0=[5, 2, -4])


def test_a_missing_state_file_is_refused_as_a_file():
    with pytest.raises(FormatError, match=r"x0: nowhere.csv: no such file"):
        as_state(Path("nowhere.csv"), TEAM)
