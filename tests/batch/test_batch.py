"""Many graphs, one table: random graphs are of their class, rows say what certificates say, and nothing gets lost."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import os
import pickle
import pkgutil
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from bad_inputs import ptcc
from selection import thinned
from threadpoolctl import threadpool_info, threadpool_limits

from lmi.child_process import apart
from ptcc_certify import Ensemble, NominalProtocol, SignedDigraph, analyse, batch, certify, certify_many
from ptcc_certify.batch import COLUMNS, Row, backends, table_bytes
from ptcc_certify.batch import rows as rows_module
from ptcc_certify.batch.sources import Settings
from ptcc_certify.errors import FormatError, GraphError, ParameterError, PTCCError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.ensembles import CONNECTIVITIES
from ptcc_certify.graphs.io import random_states, read_graph, write_graph
from ptcc_certify.model.asks import Asks

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
TRIANGLE = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1), (3, 1, 2)])
#: Small graphs of all classes, which take about a tenth of a second each, and tiny ones, which take less.
SPEC = "count = 8\nseed = 5\nnodes = { from = 5, to = 6 }\n"
TINY = 'count = 8\nseed = 5\nnodes = 3\nconnectivity = "strong"\nbalanced = false\n'
QUICK = ("--method", "perron", "--workers", "1")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("spec.toml").write_text(TINY)
    return tmp_path


def quickly(sources: Any, **more: Any) -> list[Row]:
    return certify_many(sources, PROTOCOL, **{"method": "perron", **more})


def facts(rows: list[Row]) -> list[Row]:
    """Rows without what the clock says."""
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def texts(rows: list[Row]) -> list[dict[str, str]]:
    """Rows as :func:`read_csv` reads them."""
    table = table_bytes([dict.fromkeys(COLUMNS) | row for row in facts(rows)], ".csv").decode()
    return facts(list(csv.DictReader(io.StringIO(table))))


def names(folder: str = ".") -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


def read_csv(path: str) -> list[dict[str, str]]:
    with Path(path).open(newline="", encoding="utf-8") as file:
        return facts(list(csv.DictReader(file)))


def test_no_module_of_the_package_bears_the_name_of_what_it_exports():
    modules = {module.name for module in pkgutil.iter_modules(batch.__path__)}
    assert "rows" in modules and not modules & set(batch.__all__)


# ---------------------------------------------------------------------- ensembles


def balanced_by_trial(graph: nx.DiGraph) -> bool:
    """Whether some assignment of camps agrees with every edge, by trying all."""
    nodes = list(graph)
    for camps in itertools.product((1, -1), repeat=len(nodes) - 1):
        side = dict(zip(nodes, (1, *camps), strict=True))
        if all(w * side[a] * side[b] > 0 for a, b, w in graph.edges(data="weight")):
            return True
    return False


CLASSES = [
    (c, b, u) for c in CONNECTIVITIES for b in (True, False) for u in (False, True) if not u or c in CONNECTIVITIES[::3]
]


@pytest.mark.few(0)
@pytest.mark.parametrize(("connectivity", "balanced", "undirected"), CLASSES)
def test_graphs_are_of_their_class(connectivity: str, balanced: bool, undirected: bool):
    for degree in (0, 2.5, 1000):
        ensemble = Ensemble(
            count=12,
            nodes=range(6, 9),
            seed=int(degree),
            connectivity=connectivity,
            balanced=balanced,
            mean_degree=degree,
            undirected=undirected,
        )
        for i in range(ensemble.count):
            graph = ensemble.graph(i)
            structure = analyse(graph)
            assert ensemble.kind(i) == (connectivity, balanced)
            assert structure.connectivity == connectivity
            assert {c.balanced for c in structure.closed_components} == {balanced}
            assert structure.undirected or not undirected
            # The same without this package.
            picture = nx.DiGraph()
            picture.add_nodes_from(graph.labels)
            picture.add_weighted_edges_from((a, b, float(w)) for a, b, w in graph.edges)
            condensed = nx.condensation(picture)
            closed = [condensed.nodes[v]["members"] for v, k in condensed.in_degree() if k == 0]
            assert nx.is_strongly_connected(picture) == (connectivity == "strong")
            assert nx.is_weakly_connected(picture) == (connectivity != "disconnected")
            if connectivity in ("quasi-strong", "weak"):
                assert (len(closed) == 1) == (connectivity == "quasi-strong")
            assert all(balanced_by_trial(picture.subgraph(functions)) == balanced for functions in closed)
            if undirected:
                assert all(picture[b][a]["weight"] == w for a, b, w in picture.edges(data="weight"))


@pytest.mark.few(0)
def test_a_graph_depends_on_the_seed_and_its_number_alone():
    few, many = (Ensemble(count=n, nodes=(5, 9), seed=3) for n in (4, 400))
    assert [few.graph(i) for i in range(4)] == [many.graph(i) for i in (3, 2, 1, 0)][::-1]
    again = pickle.loads(pickle.dumps(many))  # noqa: S301 - as workers get it
    assert again.graph(399) == many.graph(399)
    assert len({many.graph(i).sha256 for i in range(400)}) == 400
    assert Ensemble(count=4, nodes=(5, 9), seed=4).graph(0) != few.graph(0)


def test_sizes_degrees_and_weights_are_what_was_asked_for():
    for i, (n, degree) in enumerate([(6, 2), (9, 2.5), (30, 4), (300, 7)]):
        graph = Ensemble(count=9, nodes=n, connectivity="strong", mean_degree=degree, seed=i).graph(i)
        assert (graph.n_nodes, graph.n_edges) == (n, round(degree * n))
    complete = Ensemble(count=1, nodes=7, connectivity="strong", mean_degree=1000).graph(0)
    assert complete.n_edges == 7 * 6
    drawn = Ensemble(count=60, nodes=[5, 11], seed=2)
    assert {drawn.graph(i).n_nodes for i in range(60)} == {5, 11}
    low, high = Fraction(1, 3), Fraction("0.5004")
    narrow = Ensemble(count=4, nodes=12, weight_range=(low, high), mean_degree=6)
    sizes = {abs(w) for i in range(4) for _, _, w in narrow.graph(i).edges}
    assert low <= min(sizes) and max(sizes) <= high and len(sizes) > 20
    low, high = Fraction(1000), Fraction("1000.001")
    slit = Ensemble(count=1, nodes=12, weight_range=(low, high), mean_degree=6).graph(0)
    sizes = {abs(w) for _, _, w in slit.edges}
    assert low <= min(sizes) < max(sizes) <= high and len(sizes) > 20
    wide = Ensemble(count=4, nodes=40, weight_decades=8, mean_degree=6)
    logs = [math.log10(abs(w)) for i in range(4) for _, _, w in wide.graph(i).edges]
    assert -4 <= min(logs) < -3 and 3 < max(logs) <= 4
    friendly = Ensemble(count=8, nodes=6, balanced=True, negative=0)
    assert all(analyse(friendly.graph(i)).all_positive for i in range(8))


def test_classes_take_turns():
    ensemble = Ensemble(count=16, nodes=6)
    kinds = [ensemble.kind(i) for i in range(16)]
    assert kinds[:8] == kinds[8:] == list(zip(CONNECTIVITIES * 2, [True] * 4 + [False] * 4, strict=True))
    for i in (-1, 16):
        with pytest.raises(ParameterError, match="0 to 15"):
            ensemble.graph(i)


@pytest.mark.few(0)
def test_written_graphs_are_those_of_the_ensemble():
    assert ptcc("batch", "spec.toml", "--write-graphs", "made").code == 0
    ensemble = Ensemble.read("spec.toml")
    assert names("made") == [f"spec-{i}.csv" for i in range(8)]
    for i in range(8):
        assert read_graph(f"made/spec-{i}.csv") == ensemble.graph(i)
    mine, theirs = quickly("spec.toml"), quickly("made/*.csv")
    named = [dict(row, graph=f"spec.toml#{i}") for i, row in enumerate(facts(theirs))]
    assert facts(mine) == named


def test_written_graphs_are_lost_in_no_other_file():
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "e.toml").write_text(TINY)
    for args, says in (
        (("a/e.toml", "b/e.toml", "--write-graphs", "made"), "would be two graphs"),
        (("a/e.toml", "--write-graphs", ""), "is empty"),
        (("a/e.toml", "--write-graphs", "made", "-o", "t.csv"), "-o has no effect"),
        (("a/e.toml", "--write-graphs", "made", "--scheduler", "tcp://h:1"), "--scheduler has no effect"),
    ):
        run = ptcc("batch", *args)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1) and says in run.err
        assert names() == ["a", "b", "spec.toml"]
    Path("made").mkdir()
    Path("made/e-3.csv").write_text("mine")
    run = ptcc("batch", "a/e.toml", "--write-graphs", "made")
    assert run.code == 2 and "e-3.csv: is there already" in run.err
    assert names("made") == ["e-3.csv"] and Path("made/e-3.csv").read_text() == "mine"
    assert ptcc("batch", "a/e.toml", "--write-graphs", "made", "--restart").code == 0
    assert read_graph("made/e-3.csv") == Ensemble.read("a/e.toml").graph(3)


BAD_SPECS = [
    ("count = 3\nnodes = 6\nedges = 4", 'unknown key "edges"'),
    ("nodes = 6", '"count" is missing'),
    ("count = 3", '"nodes" is missing'),
    ("count = 0\nnodes = 6", "count = 0"),
    ("count = true\nnodes = 6", "count = true"),
    ("count = 3\nnodes = 6.5", "nodes = "),
    ("count = 3\nnodes = []", "nodes is empty"),
    ("count = 3\nnodes = { from = 9, to = 5 }", "nodes.to = 5"),
    ("count = 3\nnodes = { from = 9 }", "nodes: a range"),
    ("count = 3\nnodes = 6\nseed = -1", "seed = -1"),
    ('count = 3\nnodes = 6\nconnectivity = "ring"', "connectivity = ring"),
    ('count = 3\nnodes = 6\nconnectivity = ["weak", "weak"]', "names a class twice"),
    ('count = 3\nnodes = 6\nbalanced = "yes"', "balanced = yes"),
    ("count = 3\nnodes = 4", "a weak graph with unbalanced leaders has 5 nodes or more"),
    ('count = 3\nnodes = 5\nundirected = true\nconnectivity = "disconnected"', "has 6 nodes or more"),
    ("count = 3\nnodes = 6\nundirected = true", "an undirected graph is not quasi-strong"),
    ("count = 3\nnodes = 6\nmean_degree = nan", "cannot be read|not a finite number"),
    ("count = 3\nnodes = 6\nnegative = 2", "negative = 2"),
    ("count = 3\nnodes = 6\nweight_range = [1, 0.5]", "weight_range"),
    ("count = 3\nnodes = 6\nweight_range = [0, 1]", "weight_range"),
    ("count = 3\nnodes = 6\nweight_range = 2", "weight_range"),
    ("count = 3\nnodes = 6\nweight_decades = 1000", "weight_decades = 1000"),
    ("count = ", "no TOML"),
    ("count = " + 5000 * "1", "no TOML"),
    ("nodes = 6\ncount = 0x" + 5000 * "f", "thousands of digits"),
]


@pytest.mark.parametrize(("spec", "says"), BAD_SPECS)
def test_bad_specs_are_refused_in_one_line(spec: str, says: str):
    Path("bad.toml").write_text(spec)
    run = ptcc("batch", "bad.toml", "-o", "t.csv", *QUICK)
    assert (run.code, run.out) == (2, "")
    (line,) = run.err.splitlines()
    assert line.startswith("ptcc: bad.toml: ")
    with pytest.raises(ValueError, match=says):
        Ensemble.read("bad.toml")
    assert names() == ["bad.toml", "spec.toml"]


# ---------------------------------------------------------------------- rows


DIRECT = ("--T", "0.6", "--rho2", "0.3", "--initial-bound", "1", "--simulation")
SLIDES = ("--protocol", "sliding-mode", "--kappa", "3", "--sigma0", "random", "--disturbance", "telegraph")


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "graph"), thinned(itertools.product((DIRECT, (*SLIDES, "--simulation")), ("fig1b", "fig5a")), 3)
)
def test_a_row_is_what_certify_says(options: tuple[str, ...], graph: str):
    assert ptcc("batch", graph, "-o", "t.parquet", "--workers", "1", *options).code == 0
    from pyarrow import parquet

    (row,) = parquet.read_table("t.parquet").to_pylist()
    said = json.loads(ptcc("certify", row["graph"], "--seed", str(row["seed"]), "--json", *options).out)
    assert row["sha256"] == said["problem"]["graph"]["sha256"]
    assert (row["theorem"], row["behaviour"]) == (said["claim"]["theorem"], said["claim"]["behaviour"])
    assert row["verdict"] == said["verdict"] == "certified"
    rate, limit = Fraction(said["rates"]["proved"]), Fraction(said["rates"]["upper_bound"])
    assert Fraction(row["rate"]) <= rate <= Fraction(math.nextafter(row["rate"], math.inf))
    assert Fraction(math.nextafter(row["upper_bound"], 0)) < limit <= Fraction(row["upper_bound"])
    assert Fraction(row["optimality_ratio"]) <= rate / Fraction(row["upper_bound"]) * (1 + Fraction(1, 10**15))
    assert Fraction(row["paper_rate"]) <= Fraction(said["rates"]["paper"])
    assert row["obligations"] == len(said["proof"])
    assert [*said["problem"]["initial_state"].values()] == [str(x) for (x,) in random_states(row["seed"], row["nodes"])]
    assert row["worst_ratio"] == said["unverified"]["simulation"]["worst_ratio"]
    assert row["bound_kept"] is True
    assert (row["reaching_time"] is not None) == ("sliding-mode" in options)


@pytest.mark.few(0)
def test_columns_are_documented_and_of_their_types():
    rows = quickly(["fig1a", TRIANGLE, Ensemble(count=8, nodes=5)], simulation=True, expect="stability")
    assert all(list(row) == list(COLUMNS) for row in rows)
    for row in rows:
        for name, kind in COLUMNS.items():
            assert row[name] is None or type(row[name]) is kind, name
    lines = (rows_module.__doc__ or "").splitlines()
    documented = [line.split()[:2] for line in lines[lines.index("") :] if line[:1].isalpha() and line[20:25].strip()]
    kinds = {"text": str, "int": int, "float": float, "bool": bool}
    assert {name: kinds[kind] for name, kind in documented if kind in kinds} == COLUMNS


@pytest.mark.few(0)
def test_a_row_depends_on_its_graph_alone():
    Path("spec.toml").write_text(SPEC)
    ensemble = Ensemble.read("spec.toml")
    rows = {row["sha256"]: row for row in quickly([ensemble.graph(i) for i in range(8)])}
    for row in facts(quickly([ensemble.graph(i) for i in (6, 1)])):
        assert dict(row, graph="") == dict(facts([rows[row["sha256"]]])[0], graph="")
    assert len({row["seed"] for row in rows.values()}) == 8  # each has a start of its own
    assert {row["seed"] for row in quickly(ensemble, seed=1)}.isdisjoint(row["seed"] for row in rows.values())


def test_a_row_that_ran_out_of_time_says_so():
    (row,) = certify_many("fig1a", PROTOCOL, time_limit="1e-9")
    assert row["error"] is None and "class full" in row["cut_off"]
    assert certify_many("fig1a", PROTOCOL, time_limit=600)[0]["cut_off"] is None
    run = ptcc("batch", "fig1a", "fig1b", "--workers", "1", "--time-limit", "1e-9")
    assert "note: 2 of 2 graphs: the time limit ended searches" in run.err
    assert all("class full" in row["cut_off"] for row in csv.DictReader(io.StringIO(run.out)))
    for bad in (0, -1, math.nan, math.inf):
        with pytest.raises(ParameterError, match="time_limit"):
            quickly("fig1a", time_limit=bad)
        assert ptcc("batch", "fig1a", "--time-limit", str(bad)).code == 2


def test_the_peak_of_the_input_is_for_the_start_or_for_all_starts():
    for bound in (None, "1/3"):
        (row,) = quickly("fig1b", initial_bound=bound)
        start = None if bound else [x for (x,) in random_states(row["seed"], load_graph("fig1b").n_nodes)]
        initial_set = Fraction(1, 3) if bound else None
        effort = certify(
            load_graph("fig1b"), PROTOCOL, start, asks=Asks(method="perron", simulation=False, initial_set=initial_set)
        ).effort
        assert effort is not None and effort.peak is not None and row["input_bounded"] is effort.bounded
        assert Fraction(row["peak_input"]) >= effort.peak.largest > Fraction(math.nextafter(row["peak_input"], 0))


def test_components_of_a_disconnected_graph_are_joined():
    edges = [("a", "b", 1), ("b", "a", -1), ("c", "d", 1), ("d", "c", 1), ("d", "e", 1)]
    (row,) = quickly(SignedDigraph.from_edges([*edges, ("f", "g", 1)]))
    assert (row["connectivity"], row["components"]) == ("disconnected", 3)
    assert row["theorem"] == "1.2; 2.1" and row["behaviour"] == "stability; interval bipartite consensus"


def test_bad_graphs_are_rows_and_stop_nothing():
    write_graph(TRIANGLE, "a.csv")
    write_graph(TRIANGLE, "d.csv")
    Path("b.csv").write_text("source,target,weight\n1,2,nan\n")
    Path("c.csv").write_bytes(b"\x93\x00\x01")
    Path("e.mtx").write_text("no matrix")
    run = ptcc("batch", "[a-e].*", "fig1a", "-o", "t.csv", *QUICK)
    assert run.code == 4
    assert "3 with an error" in run.out and "3 of 6 graphs: no certificate, such as b.csv, line 2" in run.err
    rows = read_csv("t.csv")
    assert [row["graph"] for row in rows] == ["a.csv", "b.csv", "c.csv", "d.csv", "e.mtx", "fig1a"]
    for row in rows:
        refusal = ptcc("classify", row["graph"])
        assert row["error"] == refusal.err.removeprefix("ptcc: ").strip()
        assert (row["verdict"] == "certified") == (refusal.code == 0) == bool(row["rate"])


def test_bad_graphs_in_memory_and_missing_files_are_rows_and_stop_nothing():
    loop = nx.DiGraph()
    loop.add_edge(0, 0, weight=1)
    rows = quickly([TRIANGLE, loop, nx.DiGraph(), "nothing.csv", "fig1a"])
    assert [row["graph"] for row in rows] == ["graph#0", "graph#1", "graph#2", "nothing.csv", "fig1a"]
    assert [row["verdict"] for row in rows] == ["certified", None, None, None, "certified"]
    for row, says in zip(rows[1:4], ("self-loop at node 0", "no nodes", "nothing.csv: no such file"), strict=True):
        assert says in row["error"]
    named = quickly({"team": TRIANGLE, "loop": loop, "gone": "nothing.csv"})
    assert [(row["graph"], row["error"] is None) for row in named] == [("team", True), ("loop", False), ("gone", False)]
    with pytest.raises(GraphError, match="self-loop at node 0"):
        quickly(loop)


def test_rows_of_bad_graphs_in_memory_are_kept_as_they_come(computed: list[str]):
    graphs = [TRIANGLE, [("a", "a", 1)]]
    with pytest.raises(KeyboardInterrupt):
        quickly(graphs, output="t.csv", progress=interrupted_after(1))
    computed.clear()
    assert [row["graph"] for row in quickly(graphs, output="t.csv")] == ["graph#0", "graph#1"]
    assert computed == ["graph#1"]


def test_a_start_that_does_not_fit_is_an_error_of_its_row():
    fits, other = quickly([TRIANGLE, "fig1a"], x0="5,-2,1")
    assert fits["verdict"] == "certified" and fits["error"] is None
    assert "3 values for 6 nodes" in other["error"]
    assert other["nodes"] == 6 and other["rate"] is None


def test_a_defect_is_an_error_of_its_row(monkeypatch: pytest.MonkeyPatch):
    def broken(graph: SignedDigraph, *args: Any, **more: Any) -> Any:
        return {}["no such key"] if graph.n_nodes == 3 else certify(graph, *args, **more)

    monkeypatch.setattr(rows_module, "certify", broken)
    before, bad, after = quickly(["fig1a", TRIANGLE, "fig1b"])
    assert bad["error"].startswith("a defect of this program (KeyError in test_batch.py, line ")
    assert before["verdict"] == after["verdict"] == "certified"


class Deadly(SignedDigraph):
    """A graph that kills the process that it is sent to."""

    def __reduce__(self) -> Any:
        return os._exit, (1,)


@pytest.mark.few(0)
def test_a_process_that_dies_is_an_error_of_one_row():
    deadly = Deadly(TRIANGLE.labels, TRIANGLE.source, TRIANGLE.target, TRIANGLE._weights)
    graphs = [Ensemble.read("spec.toml").graph(i) for i in range(5)]
    rows = quickly([*graphs[:2], deadly, *graphs[2:]], workers=2)
    assert [row["error"] is None for row in rows] == [True, True, False, True, True, True]
    assert "died" in rows[2]["error"]
    assert [dict(row, graph="") for row in facts(rows[:2] + rows[3:])] == [
        dict(row, graph="") for row in facts(quickly(graphs))
    ]


class Unlucky(SignedDigraph):
    """A graph whose process dies until it was sent a third time."""

    def __reduce__(self) -> Any:
        return die_twice, (Path("deaths").absolute(), list(self.edges))


def die_twice(deaths: Path, edges: Any) -> SignedDigraph:
    with deaths.open("a") as file:
        file.write("x")
    if deaths.stat().st_size < 3:
        os._exit(1)
    return SignedDigraph.from_edges(edges)


@pytest.mark.campaign
def test_a_graph_is_to_blame_only_for_two_processes_that_died_with_it_alone():
    """It dies once among others, and once alone, which may be chance."""
    unlucky = Unlucky(TRIANGLE.labels, TRIANGLE.source, TRIANGLE.target, TRIANGLE._weights)
    rows = quickly([TRIANGLE, unlucky], workers=2)
    assert [row["error"] for row in rows] == [None, None]
    assert Path("deaths").read_text() == "xxx"


def scale(cluster: Any, workers: int) -> None:
    """Have so many workers in a cluster, and wait until it has."""
    cluster.scale(workers)
    until = time.monotonic() + 60
    while len(cluster.scheduler.workers) != workers and time.monotonic() < until:
        time.sleep(0.05)
    assert len(cluster.scheduler.workers) == workers


@pytest.mark.few(0)
@pytest.mark.parametrize("processes", [False, pytest.param(True, marks=pytest.mark.campaign)])
def test_rows_are_the_same_wherever_they_are_computed(processes: bool, monkeypatch: pytest.MonkeyPatch):
    """Workers of a scheduler are processes, which take long to start, or threads; rows of own processes are above."""
    from distributed import LocalCluster

    write_graph(TRIANGLE, "a.csv")
    Path("bad.csv").write_text("1,2,0\n")
    sources = ["a.csv", "bad.csv", "fig5a", "spec.toml"]
    here = facts(quickly(sources))
    assert [row["error"] is None for row in here] == [True, False] + [True] * 9
    if processes:
        assert facts(quickly(sources, workers=2)) == here
    with LocalCluster(n_workers=0, threads_per_worker=1, processes=processes, dashboard_address=None) as cluster:
        with monkeypatch.context() as patch, pytest.raises(ParameterError, match="no workers"):
            patch.setattr(backends, "PATIENCE", 3)
            quickly(sources, scheduler=cluster.scheduler_address)
        scale(cluster, 1)
        assert facts(quickly(sources, scheduler=cluster.scheduler_address, output="dask.csv")) == here
        monkeypatch.setattr(backends, "PATIENCE", 3)

        def lose(done: int, total: int, errors: int) -> None:
            if done == 2:
                scale(cluster, 0)

        monkeypatch.setattr(backends, "AHEAD", 1)
        with pytest.raises(ParameterError, match="lost all its workers"):
            quickly(sources, scheduler=cluster.scheduler_address, output="lost.csv", progress=lose)
    assert rows_in(Path("lost.csv.journal")) >= 2
    assert len(read_csv("lost.csv")) == rows_in(Path("lost.csv.journal"))
    Path("lost.csv.journal").unlink()
    Path("lost.csv").unlink()
    assert names() == ["a.csv", "bad.csv", "dask.csv", "spec.toml"]  # no worker writes anything
    assert read_csv("dask.csv") == texts(here)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes are not copied")
def test_a_worker_ends_native_code_at_a_time_limit(monkeypatch: pytest.MonkeyPatch):
    """It computes rows in another thread than its main one, and may copy its process there all the same."""

    def elsewhere(*args: Any) -> Row:
        (process,) = apart(lambda: [os.getpid()])
        return {"process": process}

    monkeypatch.setattr(backends, "certified_row", elsewhere)
    settings = batch.Settings.of(PROTOCOL)
    with ThreadPoolExecutor(1) as pool:
        row = pool.submit(backends._row_of, "a", pickle.dumps(TRIANGLE), settings).result()
    assert row["process"] != os.getpid()


@pytest.mark.few(0)
def test_a_script_without_a_main_part_is_told_so(tmp_path: Path):
    pytest.importorskip("distributed", "2026.8", "before, Dask starts for ever what fails to start")
    call = f"certify_many(['fig1a', 'fig1b'], {PROTOCOL!r}, method='perron', workers=2)"
    Path("script.py").write_text(f"from ptcc_certify import NominalProtocol, certify_many\n{call}\n")
    done = subprocess.run([sys.executable, "script.py"], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and "under if __name__ == '__main__'" in done.stderr.splitlines()[-1]


def test_an_unknown_setting_is_refused():
    with pytest.raises(ParameterError, match="certify_many has no parameter speed"):
        quickly(TRIANGLE, speed=3)


def test_uncertain_weights_of_many_graphs_are_refused_with_the_way_round():
    with pytest.raises(
        ParameterError, match=r'one graph each: \[ptcc.certify\(g, p, uncertainty="20%"\) for g in graphs\]'
    ):
        quickly([TRIANGLE, "fig1a"], uncertainty="20%")
    run = ptcc("batch", "fig1a", "fig1b", "--uncertainty", "20%")
    assert run.code == 2 and run.err.endswith("of many graphs certify each: ptcc certify GRAPH --uncertainty\n")


@pytest.mark.few(0)
def test_csv_and_parquet_hold_the_same():
    from pyarrow import parquet

    Path("bad,\n\udcff.csv").write_text("1,2,0\n")
    sources = ["fig1a", "bad*.csv", Ensemble(count=8, nodes=5)]
    rows = quickly(sources, output="t.parquet", simulation=True)
    table = parquet.read_table("t.parquet")
    assert table.column_names == list(COLUMNS)
    assert table.to_pylist() == rows
    quickly(sources, output="t.csv", simulation=True)
    read = {str: str, int: int, float: float, bool: {"true": True, "false": False}.__getitem__}
    again = [
        {name: read[COLUMNS[name]](text) if text else None for name, text in row.items()} for row in read_csv("t.csv")
    ]
    assert again == facts(rows)


@pytest.mark.few(0)
def test_a_graph_that_is_named_twice_has_one_row():
    write_graph(TRIANGLE, "a.csv")
    rows = quickly(["a.csv", "*.csv", "./a.csv", "fig1a", "fig1a", "spec.toml", "spec.*"])
    assert [row["graph"] for row in rows] == ["a.csv", "fig1a", *(f"spec.toml#{i}" for i in range(8))]
    rows = quickly(["./a.csv", Path("a.csv").absolute(), ".//spec.toml", Path("spec.toml").absolute()])
    assert [row["graph"] for row in rows] == ["a.csv", *(f"spec.toml#{i}" for i in range(8))]


@pytest.mark.few(0)
def test_graphs_are_read_alike_however_they_are_given():
    Path("rated.csv").write_text("a,b,1\nb,c,-2\nc,b,1\n")
    edges = [("a", "b", 1), ("b", "c", -2), ("c", "b", 1)]
    rated, both = (
        {row["sha256"] for given in ("rated.csv", *more) for row in quickly(given, **how)}
        for more, how in (
            (({"rated": "rated.csv"}, [edges], {"mine": edges}), {"orientation": "listens"}),
            (({"rated": Path("rated.csv")},), {"undirected": True, "duplicates": "sum"}),
        )
    )
    assert rated == {read_graph("rated.csv", orientation="listens").sha256} and len(both) == 1
    (row,) = quickly([np.array([[0, 1], [-1, 0]])], orientation="listens")
    assert row["verdict"] == "certified"


@pytest.mark.parametrize(
    ("sources", "how"),
    [
        ([TRIANGLE], {"orientation": "listens"}),
        ([[("a", "b", 1)]], {"undirected": True}),
        ({"mine": TRIANGLE}, {"duplicates": "sum"}),
        ({"mine": TRIANGLE}, {"drop_self_loops": True}),
        ("spec.toml", {"undirected": True}),
        (Ensemble(count=1, nodes=6), {"orientation": "listens"}),
    ],
)
def test_how_files_are_read_is_refused_where_it_has_no_effect(sources: Any, how: dict[str, Any]):
    with pytest.raises(ParameterError, match=next(iter(how))):
        quickly(sources, **how)


@pytest.mark.few(0)
def test_a_file_that_is_named_like_a_graph_of_an_ensemble_has_a_row_of_its_own():
    write_graph(TRIANGLE, "spec.toml#0.csv")
    Path("spec.toml#0.csv").rename("spec.toml#0")
    rows = quickly(["spec.toml", "spec.toml#0"])
    assert [row["graph"] for row in rows] == [*(f"spec.toml#{i}" for i in range(8)), "spec.toml#0"]
    assert rows[-1]["sha256"] == TRIANGLE.sha256 != rows[0]["sha256"]


@pytest.mark.skipif(os.name != "posix", reason="links, pipes and names of POSIX")
def test_odd_files_are_what_the_system_says(folder: Path):
    """A folder behind a link, links to files and to nowhere, pipes, and names that mean something elsewhere."""
    Path("far/inner").mkdir(parents=True)
    Path("link").symlink_to("far/inner")
    other = SignedDigraph.from_edges([(1, 2, 1)])
    write_graph(TRIANGLE, "a.csv")
    write_graph(other, "far/a.csv")
    rows = quickly(["link/../a.csv", "a.csv"])
    assert [(row["graph"], row["nodes"]) for row in rows] == [("link/../a.csv", 2), ("a.csv", 3)]
    Path("again.csv").symlink_to("a.csv")
    Path("gone.csv").symlink_to("nowhere.csv")
    Path("gone.toml").symlink_to("nowhere.toml")
    Path("folder.csv").mkdir()
    os.mkfifo("pipe.csv")
    Path("a.csv").rename("-")
    Path("again.csv").unlink()
    Path("again.csv").symlink_to("-")
    rows = quickly(["?", "*.csv", "g*.toml"])
    assert [row["graph"] for row in rows] == ["-", "gone.csv", "pipe.csv", "gone.toml"]
    errors = [row["error"] for row in rows]
    assert errors[0] is None and rows[0]["sha256"] == TRIANGLE.sha256
    assert "no such file" in errors[1] and "no regular file" in errors[2] and "no such file" in errors[3]
    for args in (("pipe.csv",), ("fig1a", "-o", "pipe.csv"), ("fig1a", "-o", "p.csv")):
        if args[-1] == "p.csv":
            os.mkfifo("p.csv.journal")
        run = ptcc("batch", *args, *QUICK)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1) and "no regular file" in run.err


@pytest.mark.skipif(os.name != "posix", reason="names of POSIX")
def test_no_name_of_a_file_breaks_a_table():
    odd = "a\rb\n\x1b\u2028,c.csv"
    write_graph(TRIANGLE, odd)
    (row,) = quickly("a*.csv", output="t.csv")
    assert row["graph"] == r"a\rb\n\x1b\u2028,c.csv" and row["error"] is None
    assert len(Path("t.csv").read_text().splitlines()) == 2
    assert read_csv("t.csv") == texts([row])


# ---------------------------------------------------------------------- exit codes and refusals


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "code", "column"),
    [
        ((), 0, ["", ""]),
        (("--expect", "stability"), 3, ["met", "refuted"]),
        (("--expect", "bipartite-containment"), 3, ["refuted", "met"]),
        (("--min-rate", "1e-6"), 0, ["met", "met"]),
        (("--min-rate", "1000"), 3, ["refuted", "refuted"]),
    ],
)
def test_the_exit_code_is_that_of_the_worst_row(options: tuple[str, ...], code: int, column: list[str]):
    run = ptcc("batch", "fig1a", "fig1b", "-o", "t.csv", *QUICK, *options)
    assert run.code == code
    assert [row["asked"] for row in read_csv("t.csv")] == column
    assert bool(run.err) == bool(code)


def test_a_rate_that_is_neither_proved_nor_excluded_is_left_open():
    (row,) = quickly("fig1b")
    between = (row["rate"] + row["upper_bound"]) / 2
    run = ptcc("batch", "fig1b", "-o", "t.csv", "--min-rate", str(between), *QUICK)
    assert run.code == 4 and "1 of 1 graphs: undecided" in run.err
    assert [row["asked"] for row in read_csv("t.csv")] == ["left open"]


def test_without_a_file_the_table_is_printed():
    run = ptcc("batch", "fig1a", *QUICK)
    assert run.code == 0 and run.err == ""
    (row,) = csv.DictReader(io.StringIO(run.out))
    assert row["behaviour"] == "stability"


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("nothing.csv",), "no such file"),
        (("*.none",), "no file matches"),
        (("made",), "is a folder"),
        (("fig1a", "-o", "t.txt"), ".parquet"),
        (("fig1a", "-o", "none/t.csv"), "folder does not exist"),
        (("fig1a", "g.csv", "-o", "g.csv"), "one of the graphs"),
        (("fig1a", "-o", "notes.csv"), "no table of ptcc batch"),
        (("fig1a", "-o", "notes.csv", "--restart"), "no table of ptcc batch"),
        (("fig1a", "-o", "other.csv"), "no journal"),
        (("fig1a", "-o", "other.csv", "--restart"), "no journal"),
        (("fig1a", "--restart"), "name it with -o"),
        (("fig1a", "-o", ""), "-o names a file"),
        (("fig1a", "--rho2", "0"), "no deadline"),
        (("fig1a", "--delta", "1"), "--protocol sliding-mode"),
        (("fig1a", "--x0", "g.csv"), "is a file"),
        (("fig1a", "--initial-bound", "0"), "initial_bound"),
        (("fig1a", "--expect", "peace"), "--expect"),
        (("fig1a", "--scheduler", "tcp://h:1", "--workers", "2"), "leave one out"),
        (("fig1a", "--scheduler", "no://h:1"), "no Dask scheduler"),
        (("fig1a", "--protocol", "sliding-mode", "--disturbance", "sin("), "sin("),
        (("fig1a", "--write-graphs", "d"), "is a graph already"),
    ],
)
def test_what_cannot_be_done_is_refused_before_the_work(args: tuple[str, ...], says: str, folder: Path):
    write_graph(TRIANGLE, "g.csv")
    Path("made").mkdir()
    Path("notes.csv").write_text("my notes")
    Path("other.csv.journal").write_text("Dear diary\n")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    run = ptcc("batch", *args)
    assert (run.code, run.out) == (2, "")
    (line,) = run.err.splitlines()
    assert says in line
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"x0": [1, math.nan, 2]}, "x0: .*nan"),
        ({"x0": {"1": math.inf}}, "x0: .*inf"),
        ({"x0": [10**5000]}, "x0: .*too long"),
        ({"seed": 1.5}, "seed = 1.5"),
        ({"seed": 10**5000}, "seed = a number of thousands of digits"),
        ({"workers": 0}, "workers = 0"),
        ({"protocol": None}, "protocol = None"),
        ({"sources": None}, "None is not read as a graph"),
    ],
)
def test_settings_are_refused_with_and_without_a_table(more: dict[str, Any], says: str):
    for output in (None, "t.csv"):
        with pytest.raises(PTCCError, match=says):
            certify_many(**{"sources": TRIANGLE, "protocol": PROTOCOL, "output": output} | more)
    assert names() == ["spec.toml"]


def test_numpy_integers_are_integers():
    assert facts(quickly(TRIANGLE, seed=np.int64(3), workers=np.int32(1))) == facts(quickly(TRIANGLE, seed=3))


def test_an_empty_name_of_a_table_is_refused():
    with pytest.raises(FormatError, match="names no file"):
        quickly(TRIANGLE, output="")


@pytest.mark.few(0)
def test_nothing_is_said_after_a_scheduler_was_refused():
    command = [sys.executable, "-m", "ptcc_certify.cli", "batch", "fig1a", "--scheduler", "no://h:1"]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (process.returncode, process.stdout) == (2, "")
    (line,) = process.stderr.splitlines()
    assert "no://h:1: no Dask scheduler answers" in line


def test_a_batch_that_is_refused_leaves_no_journal(monkeypatch: pytest.MonkeyPatch):
    """The packages and the scheduler are asked for after the journal is locked."""
    write_graph(TRIANGLE, "g.csv")
    for package, options in (("distributed", {"workers": 2}), ("distributed", {"scheduler": "tcp://h:1"})):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, package, None)
            with pytest.raises(ParameterError, match="pip install"):
                quickly(["g.csv", "fig1a"], output="t.csv", **options)
            assert names() == ["g.csv", "spec.toml"]
            kept = begin(3, "kept.csv")
            before = kept.read_bytes()
            with pytest.raises(ParameterError, match="pip install"):
                quickly("spec.toml", output="kept.csv", **options)
            assert kept.read_bytes() == before
            kept.unlink()
            Path("kept.csv").unlink()


@pytest.mark.parametrize(
    ("package", "args"),
    [
        ("pyarrow", ("-o", "t.parquet")),
        ("distributed", ("--workers", "2")),
        ("distributed", ("--scheduler", "tcp://127.0.0.1:1")),
    ],
)
def test_a_missing_extra_is_one_line(package: str, args: tuple[str, ...], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, package, None)
    run = ptcc("batch", "spec.toml", *args)
    assert run.code == 2 and run.out == ""
    (line,) = run.err.splitlines()
    assert 'pip install "ptcc-certify[batch]"' in line
    assert ptcc("batch", "fig1a", *QUICK).code == 0  # which needs none of them


# ---------------------------------------------------------------------- interruption


def interrupted_after(count: int) -> Callable[[int, int, int], None]:
    def progress(done: int, total: int, errors: int) -> None:
        if done == count:
            raise KeyboardInterrupt

    return progress


def begin(count: int, output: str = "t.csv", **more: Any) -> Path:
    """Begin a batch and interrupt it after some rows, of which the table is whole; return its journal."""
    with pytest.raises(KeyboardInterrupt) as stopped:
        quickly("spec.toml", output=output, progress=interrupted_after(count), **more)
    assert [row["graph"] for row in read_csv(output)] == [f"spec.toml#{i}" for i in range(count)]
    assert read_csv(output) == texts(stopped.value.rows)
    return Path(f"{output}.journal")


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the graphs that are computed, as they come."""
    names: list[str] = []
    row = backends.certified_row

    def watched(name: str, *args: Any) -> Row:
        names.append(name)
        return row(name, *args)

    monkeypatch.setattr(backends, "certified_row", watched)
    return names


@pytest.mark.few(0)
def test_an_interrupted_batch_goes_on_with_what_is_missing(computed: list[str]):
    whole = quickly("spec.toml")
    journal = begin(3)
    computed.clear()
    counts: list[tuple[int, ...]] = []
    rows = quickly("spec.toml", output="t.csv", progress=lambda *now: counts.append(now))
    assert computed == [f"spec.toml#{i}" for i in range(3, 8)]
    assert counts == [(done, 8, 0) for done in range(3, 9)]
    assert facts(rows) == facts(whole)
    assert read_csv("t.csv") == texts(whole)
    assert not journal.exists()


@pytest.mark.few(0)
def test_a_journal_may_be_torn_at_any_byte(monkeypatch: pytest.MonkeyPatch):
    """Whatever the rows are; these are empty."""
    computed: list[str] = []

    def empty(name: str, *args: Any) -> Row:
        computed.append(name)
        return dict.fromkeys(COLUMNS) | {"graph": name}

    monkeypatch.setattr(backends, "certified_row", empty)
    everything = [f"spec.toml#{i}" for i in range(8)]
    content = begin(3).read_bytes()
    ends = [i + 1 for i, byte in enumerate(content) if byte == 10]
    assert len(ends) == 4  # the settings and three rows
    cuts = {*range(40), *range(0, len(content), 23), *ends, *(end - 1 for end in ends), *(end + 1 for end in ends[:-1])}
    for cut in sorted(cuts):
        Path("t.csv").unlink(missing_ok=True)
        Path("t.csv.journal").write_bytes(content[:cut])
        computed.clear()
        kept = max(sum(end <= cut for end in ends) - 1, 0)
        begin(kept + 1)  # once more, so that the journal that was mended is read too
        rows = quickly("spec.toml", output="t.csv")
        assert computed == everything[kept:] and [row["graph"] for row in rows] == everything


@pytest.mark.few(0)
def test_a_complete_journal_only_wants_its_table_written(computed: list[str]):
    begin(8)
    computed.clear()
    assert len(quickly("spec.toml", output="t.csv")) == 8
    assert computed == [] and Path("t.csv").exists()


def test_a_damaged_journal_is_refused():
    journal = begin(3)
    lines = journal.read_bytes().splitlines(keepends=True)
    good = json.loads(lines[2])

    def edited(**row: Any) -> bytes:
        return json.dumps(good | {"row": good["row"] | row}).encode() + b"\n"

    for damage in (
        b"\x00\xff\n",
        b"{}\n",
        b'{"of": "a", "row": {}}\n',
        b"[1]\n",
        b"[" * 10**5 + b"\n",
        json.dumps(good | {"of": 1}).encode() + b"\n",
        json.dumps(good | {"number": 1}).encode() + b"\n",
        json.dumps(good | {"row": list(COLUMNS)}).encode() + b"\n",
        edited(graph=None),
        edited(graph="\ud800"),
        edited(nodes=True),
        edited(nodes=3.0),
        edited(nodes=10**30),
        edited(rate="much"),
        edited(rate=math.nan),
        edited(rate=math.inf),
        edited(rate=0.125).replace(b"0.125", b"1e999"),
        edited(nodes=77).replace(b"77", b"7" * 5000),
        edited(verdict=["certified"]),
    ):
        journal.write_bytes(b"".join([*lines[:2], damage, *lines[2:]]))
        with pytest.raises(ParameterError, match="line 3: is no row"):
            quickly("spec.toml", output="t.csv")


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"method": "paper"}, 'begun with method "perron", not "paper"'),
        ({"seed": 1}, "begun with seed 0, not 1"),
        ({"min_rate": 2}, 'begun with min_rate null, not "2"'),
        ({"x0": [0] * 3}, "begun with x0"),
        ({"undirected": True}, "begun with undirected false"),
    ],
)
def test_other_settings_than_the_journals_are_refused(more: dict[str, Any], says: str):
    journal = begin(3)
    before = journal.read_bytes()
    with pytest.raises(ParameterError, match=says):
        quickly(["spec.toml", "fig1a"], output="t.csv", **more)
    assert journal.read_bytes() == before


@pytest.mark.few(0)
def test_other_settings_than_the_journals_are_taken_when_the_batch_starts_again():
    begin(3)
    assert len(quickly(["spec.toml", "fig1a"], output="t.csv", restart=True, seed=1, min_rate=2)) == 9


def test_another_protocol_or_version_than_the_journals_is_refused():
    journal = begin(3)
    with pytest.raises(ParameterError, match="begun with protocol"):
        certify_many("spec.toml", NominalProtocol(2, 1, 1, 2), method="perron", output="t.csv")
    journal.write_bytes(journal.read_bytes().replace(b"ptcc-batch/2", b"ptcc-batch/1", 1))
    with pytest.raises(ParameterError, match=r'begun with schema "ptcc-batch/1".* --restart'):
        quickly("spec.toml", output="t.csv")


@pytest.mark.few(0)
def test_rows_are_those_of_their_graphs_whatever_the_list(computed: list[str]):
    for name in "abcdef":
        write_graph(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -"abcdef".index(name) - 1)]), f"{name}.csv")
    whole = facts(quickly(["a.csv", "b.csv", "c.csv", "d.csv"]))
    lists = [["d.csv", "b.csv"], ["f.csv", "a.csv", "./d.csv", "b.csv"], ["spec.toml", "c.csv", "b.csv"]]
    with pytest.raises(KeyboardInterrupt):
        quickly(["a.csv", "b.csv", "c.csv", "d.csv", "e.csv"], output="t.csv", progress=interrupted_after(4))
    assert read_csv("t.csv") == texts(whole)
    for graphs, missing in zip(lists, ([], ["f.csv"], [f"spec.toml#{i}" for i in range(8)]), strict=True):
        journal = Path("t.csv.journal").read_bytes()
        computed.clear()
        rows = quickly(graphs, output="t.csv")
        assert computed == missing
        assert facts(rows) == facts(quickly(graphs))
        assert not Path("t.csv.journal").exists()
        Path("t.csv.journal").write_bytes(journal)
    computed.clear()
    Path("spec.toml").write_text(TINY.replace("seed = 5", "seed = 6"))  # a list of other graphs, under the same names
    assert len(quickly(["spec.toml", "a.csv"], output="t.csv")) == 9 and computed[-1] == "spec.toml#7"


@pytest.mark.few(0)
def test_graphs_from_python_keep_their_rows_wherever_they_stand(computed: list[str]):
    pair, turned = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([("a", "b", 1)], ["b", "a"])
    assert pair == turned and pair.labels != turned.labels
    with pytest.raises(KeyboardInterrupt):
        quickly([pair, TRIANGLE], output="t.csv", progress=interrupted_after(2))
    computed.clear()
    rows = quickly([turned, TRIANGLE, pair, Ensemble.read("spec.toml")], output="t.csv", x0="random")
    assert computed == ["graph#0", *(f"ensemble#{i}" for i in range(8))]
    assert [row["graph"] for row in rows[:3]] == ["graph#0", "graph#1", "graph#2"]
    assert facts(rows)[:3] == facts(quickly([turned, TRIANGLE, pair]))


def test_files_that_have_changed_are_computed_again(computed: list[str]):
    for name in "abcd":
        write_graph(TRIANGLE, f"{name}.csv")
    Path("b.csv").write_text("1,2,0\n")
    with pytest.raises(KeyboardInterrupt):
        quickly("?.csv", output="t.csv", progress=interrupted_after(3))
    write_graph(TRIANGLE, "b.csv")  # mended
    write_graph(SignedDigraph.from_edges([(1, 2, 1)]), "c.csv")
    computed.clear()
    rows = quickly("?.csv", output="t.csv")
    assert computed == ["b.csv", "c.csv", "d.csv"]
    assert [(row["nodes"], row["error"]) for row in rows] == [(3, None), (3, None), (2, None), (3, None)]


def test_a_table_is_replaced_only_if_asked(computed: list[str]):
    quickly("spec.toml", output="t.csv")
    before = Path("t.csv").read_bytes()
    with pytest.raises(ParameterError, match="--restart"):
        quickly("spec.toml", output="t.csv", seed=1)
    with pytest.raises(KeyboardInterrupt):
        quickly("spec.toml", output="t.csv", seed=1, restart=True, progress=interrupted_after(5))
    assert len(read_csv("t.csv")) == 5 and before not in Path("t.csv").read_bytes()
    computed.clear()
    quickly("spec.toml", output="t.csv", seed=1)
    assert len(computed) == 3 and len(read_csv("t.csv")) == 8


def test_a_table_that_another_batch_finished_meanwhile_is_kept(monkeypatch: pytest.MonkeyPatch):
    """It appears, and its journal goes, after this batch looked for it and before it has a journal of its own."""
    refuse = batch.refuse_table

    def late(path: Path, *args: Any) -> None:
        refuse(path, *args)
        if not path.exists():
            path.write_bytes(table_bytes([], ".csv"))

    monkeypatch.setattr(batch, "refuse_table", late)
    with pytest.raises(ParameterError, match="is there already; name another"):
        quickly("spec.toml", output="t.csv")
    assert Path("t.csv").read_bytes() == table_bytes([], ".csv") and not Path("t.csv.journal").exists()


def test_a_pattern_leaves_out_the_table_itself():
    write_graph(TRIANGLE, "a.csv")
    for restart in (False, True):
        rows = quickly("*.csv", output="t.csv", restart=restart)
        assert [row["graph"] for row in rows] == ["a.csv"]


def test_two_batches_do_not_share_a_journal():
    said = []

    def meddle(done: int, total: int, errors: int) -> None:
        if done == 2:
            with pytest.raises(ParameterError) as refused:
                quickly("spec.toml", output="t.csv")
            said.append(str(refused.value))

    assert len(quickly("spec.toml", output="t.csv", progress=meddle)) == 8
    assert len(said) == 1 and "another process" in said[0]


@pytest.mark.few(0)
def test_ctrl_c_keeps_the_rows_and_says_so(monkeypatch: pytest.MonkeyPatch):
    row = backends.certified_row

    def stopped(name: str, *args: Any) -> Row:
        if name.endswith("#4"):
            raise KeyboardInterrupt
        return row(name, *args)

    with monkeypatch.context() as patch:
        patch.setattr(backends, "certified_row", stopped)
        run = ptcc("batch", "spec.toml", "-o", "t.csv", *QUICK)
    assert (run.code, run.out) == (130, "")
    (line,) = run.err.splitlines()
    assert "4 of 8 rows are kept, in t.csv too; 4 are missing, and the same command goes on" in line
    assert [row["graph"] for row in read_csv("t.csv")] == [f"spec.toml#{i}" for i in range(4)]
    run = ptcc("batch", "spec.toml", "-o", "t.csv", *QUICK)
    assert run.code == 0 and run.err == "note: 4 of 8 rows were there already\n"


def test_without_a_file_the_rows_so_far_are_printed(monkeypatch: pytest.MonkeyPatch):
    row = backends.certified_row

    def stopped(name: str, *args: Any) -> Row:
        if name.endswith("#4"):
            raise KeyboardInterrupt
        return row(name, *args)

    monkeypatch.setattr(backends, "certified_row", stopped)
    run = ptcc("batch", "spec.toml", *QUICK)
    assert run.code == 130 and len(list(csv.DictReader(io.StringIO(run.out)))) == 4
    assert run.err == "ptcc: interrupted; 4 of 8 rows are printed; with -o FILE.csv the same command could go on\n"


@pytest.mark.few(1)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_failure_leaves_the_table_so_far_and_says_how_it_goes_on(suffix: str, monkeypatch: pytest.MonkeyPatch):
    append = batch.Journal.append

    def full(journal: Any, mark: str, row: Row) -> None:
        if mark.endswith(" 5"):
            raise OSError(28, "No space left on device")
        append(journal, mark, row)

    with monkeypatch.context() as patch:
        patch.setattr(batch.Journal, "append", full)
        run = ptcc("batch", "spec.toml", "-o", f"t{suffix}", *QUICK)
    assert (run.code, run.out) == (2, "")
    note, line = run.err.splitlines()
    assert note.startswith(
        f"note: the batch failed; 6 of 8 rows are kept, in t{suffix} too; 2 are missing, and the same"
    )
    assert "No space left on device" in line
    if suffix == ".csv":
        assert len(read_csv("t.csv")) == 6
    run = ptcc("batch", "spec.toml", "-o", f"t{suffix}", *QUICK)
    assert run.code == 0 and "5 of 8 rows were there already" in run.err


@pytest.mark.few(0)
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("number", "workers"),
    thinned([(signal.SIGTERM, 1), (signal.SIGINT, 1), (signal.SIGINT, 2)]),
)
def test_a_process_that_is_stopped_leaves_the_table_so_far(killed: Any, number: int, workers: int):
    Path("many.toml").write_text(TINY.replace("8", "400"))
    args = ["batch", "many.toml", "-o", "t.csv", *QUICK[:-1], str(workers)]
    process = killed(args, Path("t.csv.journal"), 4, number)
    assert process.returncode == 130
    rows = read_csv("t.csv")
    assert 4 <= len(rows) == rows_in(Path("t.csv.journal")) < 400
    assert f"{len(rows)} of 400 rows are kept, in t.csv too; {400 - len(rows)} are missing" in process.said
    Path("many.toml").write_text(TINY.replace("8", "400").replace("nodes = 3", "nodes = 3 # the same"))
    Path("few.toml").write_text(TINY.replace("8", "1"))
    run = ptcc("batch", "few.toml", "fig1a", "-o", "t.csv", *QUICK)  # a list that has nothing of the other
    assert run.code == 0 and len(read_csv("t.csv")) == 2


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupt_that_a_library_loses_ends_the_batch_at_the_next_row(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
):
    def lose(*_: Any, progress: Callable[[int, int, int], None], **__: Any) -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        progress(1, 2, 0)
        raise AssertionError("the batch went on")

    monkeypatch.setattr("ptcc_certify.batch.certify_many", lose)
    before = signal.getsignal(number)
    assert ptcc("batch", "fig1a").code == 130 and signal.getsignal(number) is before


def rows_in(journal: Path) -> int:
    return journal.read_bytes().count(b"\n") - 1 if journal.exists() else 0


@pytest.fixture
def killed() -> Iterator[Callable[[list[str], Path, int, int], Any]]:
    """Start a command, send a signal when its journal has some rows, and return it with what it ``said``."""
    running: list[Any] = []

    def kill(args: list[str], journal: Path, rows: int, number: int) -> Any:
        process = subprocess.Popen([sys.executable, "-m", "ptcc_certify.cli", *args], stderr=subprocess.PIPE)
        running.append(process)
        until = time.monotonic() + 60
        while rows_in(journal) < rows and process.poll() is None and time.monotonic() < until:
            time.sleep(0.005)
        assert process.poll() is None, "ended before it was killed"
        process.send_signal(number)
        process.said = process.communicate(timeout=30)[1].decode()  # type: ignore[attr-defined]
        return process

    yield kill
    for process in running:
        if process.poll() is None:
            process.kill()


@pytest.mark.few(0)
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_killed_batch_loses_nothing_and_does_nothing_twice(killed: Any, computed: list[str]):
    Path("many.toml").write_text(TINY.replace("8", "20"))
    args = ["batch", "many.toml", "fig1a", "-o", "t.csv", *QUICK]
    journal = Path("t.csv.journal")
    killed(args, journal, 5, signal.SIGKILL)
    kept = rows_in(journal)
    assert 5 <= kept < 21 and not Path("t.csv").exists()
    computed.clear()
    run = ptcc(*args)
    assert run.code == 0 and f"{kept} of 21 rows were there already" in run.err
    assert len(computed) == len(set(computed)) == 21 - kept
    assert ptcc("batch", "many.toml", "fig1a", "-o", "whole.csv", *QUICK).code == 0
    assert read_csv("t.csv") == read_csv("whole.csv")
    assert not journal.exists()


@pytest.mark.few(0)
@pytest.mark.skipif(os.name != "posix", reason="process groups of POSIX")
@pytest.mark.parametrize("delay", thinned([0.6, 0, 0.15]))
def test_ctrl_c_while_processes_start_is_one_line(delay: float):
    """A terminal sends it to every process of the group; the journal is there just before the processes."""
    Path("many.toml").write_text(TINY.replace("8", "5000"))
    command = [sys.executable, "-m", "ptcc_certify.cli", "batch", "many.toml", "-o", "t.csv", "--workers", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0)
    try:
        until = time.monotonic() + 60
        while not Path("t.csv.journal").exists() and process.poll() is None and time.monotonic() < until:
            time.sleep(0.005)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            process.kill()
    assert (process.returncode, out) == (130, "")
    (line,) = err.splitlines()
    assert line.startswith("ptcc: interrupted; ")


def test_a_row_takes_one_thread_of_linear_algebra(monkeypatch: pytest.MonkeyPatch):
    """Processes side by side are better than threads; afterwards these are as many as before."""
    graph, seen = rows_module._graph, []

    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    def watched(*args: Any) -> SignedDigraph:
        seen.append(threads())
        return graph(*args)

    monkeypatch.setattr(rows_module, "_graph", watched)
    with threadpool_limits(2, user_api="blas"):
        row = rows_module.certified_row("fig1a", load_graph("fig1a"), Settings(NominalProtocol(1, 1, 1, 1)))
        assert (row["verdict"], seen) == ("certified", [{1}]) and max(threads()) == 2


def test_the_guide_tells_every_column():
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "many-graphs.md").read_text("utf-8")
    heads = [row.split("|")[1] for row in guide.splitlines() if row.startswith("| `")]
    assert re.findall("`([a-z0-9_]+)`", "".join(heads)) == [*COLUMNS]
