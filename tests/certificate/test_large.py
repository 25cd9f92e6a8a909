"""Certificates of large graphs: rates proved row by row, final states enclosed; tried on small graphs, where both are
known exactly, and on large ones."""

from __future__ import annotations

import contextlib
import json
import signal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from generators import KINDS, all_classes, class_cases, random_graph
from mutations import Json, changed, resealed
from scipy.linalg import expm
from scipy.sparse.linalg import eigs
from selection import thinned

from lmi.errors import NoCertificate
from lmi.sparse_h_matrix import SparseHMatrix
from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import read_graph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov import dominance
from ptcc_certify.lyapunov.dominance import dominant_functions
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.theorems.lemmas import laplacian_spectrum, left_vector

NOMINAL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
CLASSES = dict(all_classes())


@pytest.fixture
def small_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Treat every graph as a large one."""
    monkeypatch.setattr(graph_certification, "EXACT_NODES", 0)
    monkeypatch.setattr(final_states, "EXACT_NODES", 0)


def made(name: str, seed: int = 3) -> tuple[Certificate, Json]:
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, **{"weights": "decimals", **CLASSES[name]}).graph
    start = [Fraction(int(v), 100) for v in rng.integers(-1000, 1001, graph.n_nodes)]
    found = certify(graph, NOMINAL, start, asks=Asks(simulation=False))
    return found, json.loads(found.to_json())


@pytest.mark.few(0)
@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize(("name", "kwargs"), class_cases(KINDS[1::4]))
def test_every_class_is_certified_as_a_large_graph(name: str, kwargs: dict):
    """The rate is proved and below the spectral rate; the intervals hold the exact final state."""
    cert, data = made(name)
    assert cert.verdict == "certified", cert.notes
    for stdlib in (True, False):
        report = check(data, stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
    if cert.rate is not None:
        spectral = laplacian_spectrum(cert.structure).spectral_rate
        assert spectral is not None and 0 < float(cert.rate) <= spectral * (1 + 1e-9)
        assert cert.limit is None or cert.rate <= cert.limit.value
        assert {step["kind"] for step in data["proof"]} >= {"dominance", "final-state"}
    exact = final_state(cert.structure, cert.initial_state or (), exact=True)
    for value, said in zip(exact.states, data["final_state"].values(), strict=True):
        if isinstance(said, dict):
            assert abs(Fraction(value) - Fraction(said["mid"])) <= Fraction(said["radius"]) < Fraction(1, 10**8)
        else:
            assert Fraction(value) == Fraction(said)
    assert data["influence"]["degenerate"] == list(exact.degenerate)


def rejected(data: Json, where: str) -> None:
    report = check(resealed(data), stdlib=True)
    assert not report.accepted
    assert (report.rejected or "").startswith(where), (report.rejected, report.reason)


@pytest.mark.few(1)
@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize("name", ["2.1 K>=2", "2.2", "3.1 mixed", "3.2", "3.1 all single"])
def test_false_rates_and_narrow_intervals_are_rejected(name: str):
    _, data = made(name, 5)
    for k, function in enumerate(data["decays"]):
        of = f"decays[{k}]"
        step = next(i for i, s in enumerate(data["proof"]) if s["of"] == of and s["kind"] == "dominance")
        higher = str(Fraction(function["rate"]) * (1 + Fraction(1, 10**6)))
        forged = changed(changed(data, ("decays", k, "rate"), higher), ("proof", step, "numbers"), {"b": higher})
        rejected(forged, f"dominance of {of}")
        vector = data["proof"][step]["witness"]["vector"]
        for new in (f"-{vector[0]}", "0"):
            rejected(changed(data, ("proof", step, "witness", "vector", 0), new), f"dominance of {of}")
        for i, g in enumerate(data["proof"][step]["witness"]["groups"]):
            more = str(Fraction(g) * (1 + Fraction(1, 10**6)))
            rejected(changed(data, ("proof", step, "witness", "groups", i), more), f"dominance of {of}")
    for label in data["structure"][0]["followers"]:
        ball = data["final_state"][label]
        if isinstance(ball, str):  # nobody is followed but groups that end at 0
            rejected(changed(data, ("final_state", label), "1e-30"), "final-state of graph")
            continue
        for new in ({**ball, "radius": "1e-300"}, {**ball, "mid": str(float(ball["mid"]) + 1e-6)}):
            rejected(changed(data, ("final_state", label), new), "final-state of graph")
    leader = data["structure"][0]["leaders"][0]
    rejected(changed(data, ("final_state", leader), "7/3"), "final-state of graph")
    at = next(i for i, s in enumerate(data["proof"]) if s["kind"] == "final-state")
    if any(isinstance(data["final_state"][label], dict) for label in data["structure"][0]["followers"]):
        rejected(changed(data, ("proof", at, "witness"), None), "final-state of graph")
        bare = {key: x for key, x in data["proof"][at].items() if key != "witness"}
        rejected(changed(data, ("proof", at), bare), "final-state of graph")


def random_sparse(n: int, seed: int) -> SignedDigraph:
    """Every fourth agent listens to nobody, or in a ring of three; the others to five random agents."""
    rng = np.random.default_rng(seed)
    edges = {}
    for i in range(n):
        if i % 12 in (0, 4, 8):
            if i % 24 < 12:  # rings of three leaders
                ring = [i - i % 12 + k for k in (0, 4, 8)]
                other = ring[(ring.index(i) + 1) % 3]
                if other < n:
                    edges[other, i] = float(rng.uniform(0.5, 2))
        else:
            for j in rng.choice(n, 5, replace=False).tolist():
                if j != i:
                    edges[j, i] = float(rng.choice([-1, 1], p=[0.3, 0.7]) * rng.uniform(0.5, 2))
    return SignedDigraph.from_edges([(j, i, w) for (j, i), w in edges.items()], nodes=range(n))


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("n", "slides"), [(500, False), (400, True), pytest.param(1000, False, marks=pytest.mark.campaign)]
)
def test_sparse_graphs_of_hundreds_of_nodes(n: int, slides: bool, tmp_path: Path):
    graph = random_sparse(n, 1)
    start = np.random.default_rng(2).uniform(-10, 10, n).round(2).tolist()
    protocol = NOMINAL
    more = {}
    if slides:
        protocol = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
        more = {"sigma0": ([1, 0, "-0.5", 2] * (n // 4))}
    cert = certify_words(graph, protocol, start, simulation=False, **more)
    assert cert.verdict == "certified"
    cert.save(tmp_path / "c.json")
    assert check(tmp_path / "c.json").accepted
    followers = cert.structure.followers
    block = graph.laplacian().tocsr()[followers][:, followers]
    least = float(eigs(block.tocsc(), k=1, sigma=0, return_eigenvectors=False)[0].real)
    comparison = SparseHMatrix(block).smallest()
    assert cert.rate is not None
    assert float(cert.rate) <= 2 * least * (1 + 1e-9)
    slowest_group = min(group.rate for group in dominant_functions(cert.structure)[0].dominance.groups)
    assert float(cert.rate) >= 0.99 * min(2 * comparison, float(slowest_group))


def strong_graph(n: int, balanced: bool, seed: int, followers: int = 0) -> SignedDigraph:
    """A ring with two random in-edges per agent, and followers of three random agents each."""
    rng = np.random.default_rng(seed)
    camp = rng.choice([-1, 1], n + followers)
    edges = {}
    for t in range(n + followers):
        heard = [(t + 1) % n, *rng.integers(0, n, 2)] if t < n else rng.integers(0, n + followers, 3)
        for s in heard:
            if s != t:
                sign = camp[s] * camp[t] if balanced else rng.choice([-1, 1])
                edges[int(s), t] = int(sign) * Fraction(int(rng.integers(50, 200)), 100)
    return SignedDigraph.from_edges([(s, t, w) for (s, t), w in edges.items()], nodes=range(n + followers))


@pytest.mark.few(0)
@pytest.mark.parametrize(("balanced", "followers"), thinned([(False, 0), (True, 60)], 2))
def test_large_leader_groups_are_proved_by_a_sparse_factor(balanced: bool, followers: int):
    graph = strong_graph(150, balanced, 7 + followers, followers)
    start = np.random.default_rng(0).uniform(-10, 10, graph.n_nodes).round(3).tolist()
    cert = certify(graph, NOMINAL, start, asks=Asks(simulation=False, method="perron"))
    assert cert.verdict == "certified", cert.notes
    for stdlib in (True, False):
        report = check(cert.to_dict(), stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
    (group,) = cert.search.functions[0].dominance.groups  # type: ignore[union-attr]
    leaders = graph.subgraph(np.arange(150))
    half = np.sqrt(left_vector(leaders))
    S = half[:, None] * leaders.dense_laplacian() / half
    best = float(np.linalg.eigvalsh(S + S.T)[int(balanced)])
    assert best * (1 - 1e-5) <= float(group.rate) <= best * (1 + 1e-9)
    assert cert.rate is not None and cert.spectral_rate is not None
    assert float(cert.rate) <= cert.spectral_rate * (1 + 1e-9)
    # The end from the long run of the state itself.
    end = expm(-40.0 / float(cert.rate) * graph.dense_laplacian()) @ start
    assert cert.final_state is not None and cert.final_state.radius is not None
    assert (np.abs(end - np.asarray(cert.final_state)) <= np.array(cert.final_state.radius, float) + 1e-6).all()
    assert max(cert.final_state.radius) < 1e-8


@pytest.mark.campaign
def test_a_factor_is_of_the_matrix_that_the_checker_forms():
    """Rounding is judged in the scaling of the factor, where a small diagonal makes its row's entries large."""
    rng, n = np.random.default_rng(5), 180
    camps, ring = rng.choice([-1, 1], n), np.arange(n)
    source, target = (np.concatenate([own, rng.integers(0, n, n // 2)]) for own in ((ring - 1) % n, ring))
    weights = rng.integers(1, 10, source.size) * camps[source] * camps[target]
    edges = {(s, t): w for s, t, w in zip(source.tolist(), target.tolist(), weights.tolist(), strict=True) if s != t}
    edges |= {(t, s): w for (s, t), w in edges.items()}
    graph = SignedDigraph.from_edges([(s, t, w) for (s, t), w in edges.items()])
    assert certify(graph, NOMINAL, asks=Asks(simulation=False)).verdict == "certified"


@pytest.mark.few(0)
@pytest.mark.parametrize("balanced", thinned([True, False], 2))
def test_leader_groups_of_hundreds_take_the_best_diagonal_matrix(balanced: bool):
    graph = strong_graph(125, balanced, 1)
    found = {
        method: certify(graph, NOMINAL, asks=Asks(simulation=False, method=method))
        for method in ("perron", "lmi", "best", "full")
    }
    assert [c.verdict for c in found.values()] == ["certified"] * 3 + ["undecided"]
    assert any("only the classes perron and lmi are proved" in note for note in found["full"].notes)
    perron, best, both = (float(found[m].rate or 0) for m in ("perron", "lmi", "best"))
    assert perron < 0.95 * best and both == pytest.approx(best, rel=1e-6)
    assert best <= (found["lmi"].spectral_rate or 0) * (1 + 1e-9)
    assert {m.kind for m in found["lmi"].search.functions} == {"lmi"}
    assert set(found["best"].search.searched) == {"perron", "lmi"}


@pytest.mark.parametrize("balanced", thinned([True, False], 2))
def test_forged_rates_of_large_groups_are_rejected(balanced: bool):
    graph = strong_graph(130, balanced, 3)
    asks = Asks(simulation=False, method="perron")
    data = json.loads(certify(graph, NOMINAL, [1, *[0] * 129], asks=asks).to_json())
    step = next(i for i, s in enumerate(data["proof"]) if s["kind"] == "dominance")
    where = ("proof", step, "witness", "groups", 0)
    said = data["proof"][step]["witness"]["groups"][0]
    rejected(changed(data, (*where, "rate"), str(Fraction(said["rate"]) * (1 + Fraction(1, 10**5)))), "dominance of")
    for k, key in enumerate(("order", "indptr", "indices", "data", "exponents")):
        news = (said["factor"][key][:-1], said["factor"][key][::-1], [*said["factor"][key][:-1], 1.5], None)
        for new in (news[k % 4], news[(k + 1 + balanced) % 4]):
            rejected(changed(data, (*where, "factor", key), new), "dominance of")
    rejected(changed(data, (*where, "factor", "bits"), said["factor"]["bits"] + 1), "dominance of")
    rejected(changed(data, (*where, "factor"), None), "dominance of")
    rejected(changed(data, where, {key: x for key, x in said.items() if key != "factor"}), "dominance of")
    rejected(changed(data, where, said["rate"] + "0"), "dominance of")
    if balanced:
        null_vector = data["influence"]["components"][0]["left_null_vector"][5]
        where = ("influence", "components", 0, "left_null_vector", 5)
        for new in (
            {**null_vector, "radius": "1e-300"},
            {**null_vector, "mid": str(Fraction(null_vector["mid"]) + Fraction(1, 10**6))},
            "0.01",
        ):
            rejected(changed(data, where, new), "final-state of graph")


@pytest.mark.few(0)
def test_a_leader_group_beyond_the_limit_is_undecided_with_a_note(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(dominance, "FILL_ROWS", 100)
    graph = strong_graph(125, False, 5)
    cert = certify(graph, NOMINAL, asks=Asks(simulation=False))
    assert cert.verdict == "undecided"
    assert any("of a leader group of 125 nodes is numerical" in note for note in cert.notes)


def test_nobody_listens_to_anybody():
    graph = SignedDigraph.from_edges([], nodes=range(300))
    data = json.loads(certify(graph, NOMINAL, [1] * 300).to_json())
    assert data["verdict"] == "certified" and check(data).accepted


def test_no_dominance_where_the_comparison_matrix_is_singular():
    with pytest.raises(NoCertificate):
        SparseHMatrix([[1.0, -1.0], [-1.0, 1.0]]).smallest()
    with pytest.raises(NoCertificate, match="diagonal"):
        SparseHMatrix([[0.0, -1.0], [-1.0, 1.0]])


def test_frontier_of_rate_and_overshoot_is_monotone():
    found = dominant_functions(analyse(random_sparse(600, 3)))
    rates = [m.rate for m in found]
    overshoots = [m.highest / m.lowest for m in found]
    assert rates == sorted(rates, reverse=True)
    assert overshoots == sorted(overshoots, reverse=True)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "ratio"), [("soc-sign-bitcoinotc.csv.gz", 0.4), ("wiki-elec.txt.gz", 0.99)])
def test_real_networks_of_thousands_are_certified(name: str, ratio: float, real_data: Path, tmp_path: Path):
    graph = read_graph(real_data / name, orientation="listens")
    start = np.random.default_rng(0).uniform(-10, 10, graph.n_nodes).round(3).tolist()
    cert = certify(graph, NOMINAL, start, asks=Asks(simulation=False))
    assert cert.verdict == "certified" and cert.rate is not None
    cert.save(tmp_path / "c.json")
    assert check(tmp_path / "c.json").accepted
    followers = cert.structure.followers
    block = graph.laplacian().tocsc()[followers][:, followers]
    least = float(eigs(block, k=1, sigma=0, return_eigenvectors=False)[0].real)
    assert ratio * 2 * least <= float(cert.rate) <= 2 * least * (1 + 1e-9)


@pytest.mark.few(0)
def test_the_screen_tells_how_near_the_final_state_is_known():
    graph = random_sparse(150, 4)
    cert = certify(graph, NOMINAL, [1] * 150, asks=Asks(simulation=False))
    lines = certificate_lines(cert, "g")
    (said,) = [line for line in lines if line.startswith("x(T)")]
    assert said.endswith("proved; here to 5 digits)") and "to within" in said
    assert lines[0].startswith("verdict    certified")


def chain(weights: list[Any]) -> SignedDigraph:
    """A leader and followers in a row, each listening to the one before it."""
    labels = ["a", *(f"f{i}" for i in range(len(weights)))]
    return SignedDigraph.from_edges([(labels[i], labels[i + 1], w) for i, w in enumerate(weights)])


def tied(weight: str) -> SignedDigraph:
    """Two agents that listen to each other, and hardly to the leader; 130 more listen to one of them."""
    pair = [("a", "x", weight), ("x", "y", 1), ("y", "x", 1)]
    return SignedDigraph.from_edges([*pair, *(("x", f"f{i}", 1) for i in range(130))])


def fan() -> SignedDigraph:
    rows = [("a", f"f{i}", 10.0 ** (i % 20 - 10)) for i in range(130)]
    rows += [(f"f{i}", f"f{(7 * i + 1) % 130}", 1) for i in range(130) if i != (7 * i + 1) % 130]
    return SignedDigraph.from_edges(rows)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("graph", "start"),
    thinned(
        [
            (chain([10**9] * 130), "1e300"),
            (chain([1] * 130), "1e-300"),
            (chain([1] * 130), "1e-400"),
            (chain([1] * 130), "0"),
            (chain([10.0 ** (i % 13 - 6) for i in range(130)]), "2.5"),
            (chain(["1/3", "-2/7"] * 65), "2.5"),
            (tied("1e-9"), "1.5"),
            (fan(), "3"),
        ],
        2,
    ),
)
def test_weights_and_starts_of_any_size_are_certified(graph: SignedDigraph, start: str):
    cert = certify(graph, NOMINAL, [start] * graph.n_nodes, asks=Asks(simulation=False))
    assert cert.verdict == "certified", cert.notes


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "graph",
    [
        chain([Fraction(1, 10**17) if i == 60 else 1 for i in range(130)]),
        tied("1e-17"),
        SignedDigraph.from_edges(
            [("a", "f0", 1)] + [e for i in range(149) for e in ((f"f{i}", f"f{i + 1}", 1), (f"f{i + 1}", f"f{i}", 2))]
        ),
    ],
)
def test_what_floats_cannot_solve_is_undecided_and_says_so(graph: SignedDigraph):
    cert = certify(graph, NOMINAL, [1] * graph.n_nodes)
    assert cert.verdict == "undecided"
    assert not any("leader group" in note for note in cert.notes)
    assert not any("span 0 decades" in note for note in cert.notes)
    assert check(json.loads(cert.to_json())).accepted


def test_a_final_state_that_floats_cannot_compute_is_none(monkeypatch: pytest.MonkeyPatch):
    """No number is told of it, on the screen neither; the note says why."""
    monkeypatch.setattr(final_states, "containment_weights", lambda structure: None)
    monkeypatch.setattr(
        final_states, "follower_state", lambda structure, state: np.full(structure.followers.size, np.nan)
    )
    cert = certify(chain([1] * 130), NOMINAL, [1] * 131, asks=Asks(simulation=False))
    assert cert.final_state is None and cert.verdict == "undecided" and cert.checked.accepted
    assert "x(T)" not in cert.summary() and "nan" not in cert.summary()
    assert any("too ill-conditioned for floats" in note for note in cert.notes)


def test_a_leader_group_over_many_decades():
    """Its rate is proved by itself; floats alone would claim a little too much."""
    rng = np.random.default_rng(0)
    edges = {(i, (i + 1) % 40): float(10 ** rng.uniform(-4, 4)) for i in range(40)}
    edges |= {(int(rng.integers(0, 40)), 40 + k): 1.0 for k in range(130)}
    cert = certify(
        SignedDigraph.from_edges([(i, j, w) for (i, j), w in edges.items()]), NOMINAL, asks=Asks(simulation=False)
    )
    assert cert.verdict == "certified", cert.notes


@pytest.mark.few(0)
def test_long_chains_have_a_bound_that_says_something():
    """The fastest member has an astronomical prefactor; the slowest one bounds the first instants."""
    found = certify(chain([1] * 141), NOMINAL, asks=Asks(simulation=False)).search.functions
    assert min(m.overshoot for m in found) < 10**5


# ---------------------------------------------------------------------- slow mixing, degenerate starts


def undirected(pairs: list[tuple[int, int, Any]]) -> SignedDigraph:
    return SignedDigraph.from_edges([e for i, j, w in pairs for e in ((i, j, w), (j, i, w))])


SLOW = {
    "path": undirected([(i, i + 1, 1) for i in range(399)]),
    "signed path": undirected([(i, i + 1, Fraction((-1) ** i, 3)) for i in range(159)]),
    "ring": undirected([(i, (i + 1) % 500, 1) for i in range(500)]),
    "directed ring": SignedDigraph.from_edges([(i, (i + 1) % 160, "0.1") for i in range(160)]),
    "ladder": undirected([(i, i + 2, 1) for i in range(198)] + [(2 * i, 2 * i + 1, -1) for i in range(100)]),
    "huge weights": undirected([(i, i + 1, 10**150) for i in range(150)]),
    "tiny weights": undirected([(i, i + 1, Fraction(1, 10**150)) for i in range(150)]),
}


#: Longer ones, and other kinds that are certified in the same way.
IN_CAMPAIGNS = ("path", "ring", "ladder", "huge weights", "tiny weights")


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.campaign if name in IN_CAMPAIGNS else ()) for name in SLOW],
)
def test_undirected_groups_that_mix_slowly_are_certified(name: str):
    """Their left vector is exact, so that the proof needs no cube of the Laplacian, and the end is exact too."""
    graph = SLOW[name]
    n = graph.n_nodes
    cert = certify(graph, NOMINAL, list(range(n)), asks=Asks(simulation=False))
    assert cert.verdict == "certified", cert.notes
    assert check(cert.to_dict(), stdlib=True).accepted
    symmetric = graph.dense_laplacian()
    scale = np.abs(symmetric).max()
    best = float(np.linalg.eigvalsh((symmetric + symmetric.T) / scale)[1]) * scale
    assert cert.rate is not None and 0.7 * best <= float(cert.rate) <= best * (1 + 1e-6)
    camps = cert.structure.closed_components[0].gauge or ()
    mean = sum((Fraction(g * k) for k, g in enumerate(camps)), Fraction(0)) / n
    assert cert.final_state is not None and list(cert.final_state.states) == [g * mean for g in camps]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "start", [[0] * 130, [(-1) ** i for i in range(130)], [0] * 129 + ["1e-320"]], ids=["zero", "degenerate", "tiny"]
)
def test_starts_that_meet_at_zero_and_tiny_ones(start: list[Any]):
    graph = undirected([(i, (i + 1) % 130, 1) for i in range(130)])
    cert = certify(graph, NOMINAL, start, asks=Asks(simulation=False, method="perron"))
    assert cert.verdict == "certified", cert.notes
    assert cert.final_state is not None and cert.final_state.degenerate == (() if start[-1] == "1e-320" else (1,))


@pytest.mark.few(0)
def test_a_directed_group_that_starts_at_zero_meets_there():
    directed = certify(strong_graph(125, True, 2), NOMINAL, [0] * 125, asks=Asks(simulation=False, method="perron"))
    assert (
        directed.verdict == "certified" and directed.final_state is not None and directed.final_state.degenerate == (1,)
    )


def test_what_is_printed_lies_in_the_intervals_of_the_certificate():
    edges = [(0, 1, 1), (1, 2, 1), (2, 0, 1), *((i, i + 1, 1) for i in range(2, 132))]
    start = [Fraction(1, 10), Fraction(2, 10), Fraction(-3, 10) + Fraction(1, 10**17), *[1] * 130]
    cert = certify(SignedDigraph.from_edges(edges), NOMINAL, start, asks=Asks(simulation=False, method="perron"))
    data = cert.to_dict()
    assert data["influence"]["degenerate"] == [] and cert.final_state is not None and cert.final_state.degenerate == ()
    for seen, said in zip(cert.final_state.states, data["final_state"].values(), strict=True):
        middle, radius = (said["mid"], said["radius"]) if isinstance(said, dict) else (said, "0")
        assert abs(Fraction(seen) - Fraction(middle)) <= Fraction(radius)
    assert not any("degenerate" in line for line in certificate_lines(cert, "g"))


def test_a_forged_tree_is_rejected():
    data = json.loads(certify(SLOW["directed ring"], NOMINAL, asks=Asks(simulation=False, method="perron")).to_json())
    step = next(i for i, s in enumerate(data["proof"]) if s["kind"] == "dominance")
    where = ("proof", step, "witness", "groups", 0, "factor", "parents")
    factor = data["proof"][step]["witness"]["groups"][0]["factor"]
    tree = factor["parents"]
    root = tree.index(-1)
    two = [-1 if i == (root + 1) % 300 else q for i, q in enumerate(tree)]
    loop = [(i + 1) % 300 for i in range(300)]
    for new in (None, tree[:-1], two, loop, [300, *tree[1:]], [*loop[:-1], -2], [0, *tree[1:]]):
        rejected(changed(data, where, new), "dominance of")
    bare = {key: x for key, x in factor.items() if key != "parents"}
    rejected(changed(data, where[:-1], bare), "dominance of")
    weights = ("decays", 0, "blocks", 0, "diagonal", 0)
    rejected(changed(data, weights, "0.9"), "dominance of")


def mean_of_start(cert: Certificate) -> list[Fraction]:
    """Return the end of a balanced undirected graph, of all agents alike."""
    camps = cert.structure.closed_components[0].gauge or ()
    mean = sum((g * Fraction(x) for g, x in zip(camps, cert.initial_state or (), strict=True)), Fraction(0)) / len(
        camps
    )
    return [g * mean for g in camps]


@pytest.mark.few(0)
@pytest.mark.parametrize("closed", thinned([False, True], 2), ids=["path", "ring"])
def test_long_undirected_groups_have_an_exact_left_vector(closed: bool):
    """A factor in floats finds it to 1e-11 only, and the cube of the Laplacian is not proved."""
    n = 1500
    graph = undirected([(i, (i + 1) % n, Fraction((-1) ** i, 3)) for i in range(n - 1 + closed)])
    assert left_vector(graph).tolist() == [1 / n] * n
    cert = certify(graph, NOMINAL, list(range(n)), asks=Asks(simulation=False, method="perron"))
    assert cert.verdict == "certified" and cert.rate is not None, cert.notes
    best = 4 / 3 * (1 - np.cos((2 if closed else 1) * np.pi / n))
    assert 0.7 * best <= float(cert.rate) <= best * (1 + 1e-6)
    assert cert.final_state is not None and list(cert.final_state.states) == mean_of_start(cert)


def test_a_large_group_of_leaders_without_a_sparse_factor_has_a_left_vector():
    """The iterative search, begun at 0, breaks down on it."""
    n = 5000
    jumps = [(i, (7 * i + 3) % n, 2) for i in range(n)]
    ring = [(i, (i + 1) % n, 1) for i in range(n)]
    graph = SignedDigraph.from_edges([*ring, *(e for e in jumps if (e[1] - e[0]) % n > 1)])
    p = left_vector(graph)
    inflow = np.bincount(graph.source, p[graph.target] * np.abs(graph.weights), n)
    assert (p > 0).all() and np.allclose(inflow, p * graph.in_weight(), rtol=1e-9)


def test_the_vector_of_ones_belongs_to_connected_graphs_of_equal_flows_only():
    ring = [(i, (i + 1) % 600, 1) for i in range(600)]
    assert left_vector(SignedDigraph.from_edges(ring)).tolist() == [1 / 600] * 600
    nearly = [*ring[1:], (0, 1, 1 + Fraction(1, 10**12))]
    assert left_vector(SignedDigraph.from_edges(nearly)).tolist() != [1 / 600] * 600
    with pytest.raises((HypothesisError, RuntimeError)):
        left_vector(undirected([(i, i + 1, 1) for i in range(0, 600, 2)]))


@pytest.mark.few(0)
@pytest.mark.parametrize("method", ["perron", "best"])
@pytest.mark.parametrize("weight", thinned([1.7e308, 1e306], 2))
def test_weights_near_the_largest_float_are_undecided(weight: float, method: str):
    star = undirected([(0, i, weight) for i in range(1, 130)])
    for graph in (star, SignedDigraph.from_edges([(i, (i + 1) % 130, 1.7e308) for i in range(130)])):
        cert = certify(graph, NOMINAL, asks=Asks(simulation=False, method=method))
        assert cert.verdict == "undecided"
        assert any("too near to the largest float" in note for note in cert.notes)


def test_ends_below_the_floats_are_kept():
    graph = SignedDigraph.from_edges([(i, (i + 1) % 130, Fraction(1, 1 + i % 3)) for i in range(130)])
    cert = certify(graph, NOMINAL, ["1e-400"] * 130, asks=Asks(simulation=False, method="perron"))
    assert cert.final_state is not None and cert.final_state.degenerate == ()
    for value in (*cert.final_state.states, *cert.final_state.consensus_values):
        assert abs(Fraction(value) * 10**400 - 1) < 1e-9


def test_an_interrupt_that_casadi_turns_into_any_error_is_not_lost():
    for lost in (ValueError, TypeError, RuntimeError, None):
        with pytest.raises(KeyboardInterrupt), interruptible():
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            if lost is not None:
                raise lost("what was interrupted")
    with pytest.raises(ValueError, match="a failure"), interruptible():
        raise ValueError("a failure")
