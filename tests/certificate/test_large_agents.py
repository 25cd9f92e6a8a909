"""Final states of many agents of order n, enclosed as those of large graphs: against exact ones, floats, mutants."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from cpu_time import at_most
from mutations import Json, at, changed, judged_mutants, leaves, nudged, resealed
from oracle_agents import false_claims_of_agents
from oracle_cascade import false_claims_of_cascade
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.checker.reading import interval
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, InitialState

F = Fraction
STRONG = NominalProtocol(T=2, rho1="0.5", rho2=3, kappa=1)
#: Agents, and derivatives that they begin with.
KINDS: dict[str, dict[str, Any]] = {
    "double integrators": {"order": 2},
    "triple integrators in a formation": {"order": 3, "offsets": True},
    "with drag in a formation": {"order": 2, "drag": "0.3", "offsets": True},
    "driven apart": {"plant": ["-1", "1/3"]},
    "at rest": {"order": 2, "rest": 1},
    "cascade": {"order": 2, "cascade": 2},
    "capped": {"order": 2, "gain_cap": 9},
    "single integrators in a formation": {"order": 1, "offsets": True},
}


def team(N: int, seed: int, group: int = 5) -> SignedDigraph:
    """Two groups of camps, one that has none, three single leaders, and followers of four agents each, of any sign.

    The weights of the groups lie apart; those within a group are decimals whose left null vector is not short.
    """
    rng = np.random.default_rng([7, seed])
    edges: dict[tuple[int, int], float] = {}
    for first, balanced in ((0, True), (group, True), (2 * group, False)):
        camp = rng.choice([-1, 1], group)
        for i in range(group):
            for j in {(i + 1) % group, int(rng.integers(group))} - {i}:
                sign = camp[i] * camp[j] * (1 if balanced or (i, j) != (0, 1) else -1)
                edges[first + i, first + j] = round(float(rng.uniform(0.5, 2)), 3) * int(sign)
    for v in range(3 * group + 3, N):
        for u in {int(rng.integers(v)) for _ in range(3)} | {int(rng.integers(3 * group + 3, N))} - {v}:
            edges[u, v] = round(float(rng.uniform(0.5, 2)), 3) * (1 if rng.random() < 0.7 else -1)
    return SignedDigraph.from_edges([(u, v, w) for (u, v), w in edges.items()])


def rows(rng: np.random.Generator, N: int, d: int) -> list[list[Fraction]]:
    return [[F(int(x), 100) for x in row] for row in rng.integers(-500, 501, (N, d))]


def made(graph: SignedDigraph, kind: str, d: int = 1, method: str = "perron") -> Certificate:
    rng, words = np.random.default_rng(5), dict(KINDS[kind])
    N = graph.n_nodes
    if words.get("offsets"):
        words["offsets"] = rows(rng, N, d)
    agents = Agents(**words)
    x0, more = rows(rng, N, d), [rows(rng, N, d) for _ in range(agents.degree - 1)]
    options: dict[str, Any] = {"derivatives": more} if more else {}
    return certify_words(graph, STRONG, x0, agents=agents, simulation=False, method=method, **options)


def as_large(graph: SignedDigraph, kind: str, d: int = 1) -> Certificate:
    """The same in the large form, whatever the size of the graph."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graph_certification, "EXACT_NODES", 0)
        patch.setattr(final_states, "EXACT_NODES", 0)
        return made(graph, kind, d)


def ends(certificate: Certificate) -> list[tuple[Fraction, Fraction]]:
    part = certificate.agents
    if part is None:  # single integrators on a line
        return [interval(end) for end in certificate.to_dict()["formation"]["final_state"].values()]
    assert part.final_state is not None
    return [end for agent in part.final_state for chain in agent for end in chain]


def floats(certificate: Certificate) -> np.ndarray:
    """Where agents end by other means: the kernel of ``L`` by singular vectors, one agent by SciPy's exponential."""
    part = certificate.agents
    assert part is not None
    L = certificate.graph.laplacian().toarray()
    left, sizes, right = np.linalg.svd(L)
    rank = int((sizes > 1e-9 * sizes.max()).sum())
    kernel, cokernel = right[rank:].T, left[:, rank:]
    Q = kernel @ np.linalg.solve(cokernel.T @ kernel, cokernel.T)
    A = np.eye(part.order, k=1)
    A[-1] = [-float(a) for a in part.protocol.plant]
    xi = np.array([[[float(x) for x in chain] for chain in agent] for agent in part.initial_state or ()])
    h = np.array([[float(x) for x in row] for row in part.protocol.offsets])
    xi[:, :, 0] -= h
    end = np.einsum("kl,ldj,ij->kdi", Q, xi, expm(A * float(part.protocol.gain.T)))
    end[:, :, 0] += h
    return end


@cache
def document(kind: str, N: int = 24, group: int = 3) -> Json:
    return json.loads(as_large(team(N, 1, group), kind).to_json())


def agrees(large: Certificate, exact: Certificate, width: float = 1e-8) -> None:
    """What is enclosed is accepted, and holds what is exact, or an interval of it."""
    assert large.verdict == "certified", large.checked
    assert "containment_weights" not in large.to_dict()["influence"]
    assert any(r for _, r in ends(large))
    for (m, r), (x, s) in zip(ends(large), ends(exact), strict=True):
        assert abs(m - x) <= r + s and r <= width


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", thinned(KINDS, 3))
def test_the_large_form_encloses_the_exact_final_states(kind: str):
    graph = team(28, 2)
    large = as_large(graph, kind)
    agrees(large, made(graph, kind))
    assert check(large.to_dict(), stdlib=True).accepted


@pytest.mark.few(0)
@pytest.mark.parametrize(("N", "seed"), thinned([(24, 3), (120, 4)], 2))
def test_it_does_so_in_the_plane_and_up_to_the_largest_exact_graphs(N: int, seed: int):
    graph = team(N, seed)
    agrees(as_large(graph, "with drag in a formation", 2), made(graph, "with drag in a formation", 2))


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5, 15))
def test_it_does_so_on_many_graphs(kind: str, seed: int):
    graph, d = team(30 + 8 * (seed - 5), seed), 1 + seed % 2
    agrees(as_large(graph, kind, d), made(graph, kind, d))


@pytest.mark.parametrize("kind", thinned(["triple integrators in a formation", "driven apart"], 2))
def test_many_agents_end_where_floats_say_and_the_file_says_the_same(kind: str, tmp_path: Path):
    """More than 400 agents, with a leader group of 130, whose left null vector is enclosed."""
    graph = team(420, 6, 130)
    with at_most(300):
        found = made(graph, kind, 2)
        found.save(tmp_path / "many.json")
        report = check(tmp_path / "many.json", stdlib=True)
    assert found.verdict == "certified" and report.accepted, report.reason
    middles = np.array([float(m) for m, _ in ends(found)])
    told = floats(found).ravel()
    radius = max(float(r) for _, r in ends(found))
    assert 0 < radius < 1e-7 * max(1, np.abs(told).max())
    assert np.abs(middles - told).max() <= radius + 1e-9 * max(1, np.abs(told).max())
    again = read_certificate(tmp_path / "many.json").agents
    assert again is not None and found.agents is not None and again.final_state == found.agents.final_state
    table = found.to_pandas()
    assert np.allclose(table["x_2(T)"], middles.reshape(graph.n_nodes, 2, -1)[:, 1, 0], rtol=1e-12)


@pytest.mark.few(0)
@pytest.mark.parametrize("size", ["1e290", "1e-300"])
def test_numbers_of_any_size_are_enclosed(size: str):
    """Positions and velocities beyond what floats hold squared, and near the smallest floats."""
    graph = team(16, 8, 3)
    x0, v0 = ([F(size) * int(x) for x in np.random.default_rng(k).integers(-9, 10, graph.n_nodes)] for k in (1, 2))
    begin, agents, asks = InitialState(x0, v0=v0), Agents(order=2), Asks(simulation=False, method="perron")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graph_certification, "EXACT_NODES", 0)
        patch.setattr(final_states, "EXACT_NODES", 0)
        large = certify(graph, STRONG, begin, agents=agents, asks=asks)
    exact = certify(graph, STRONG, begin, agents=agents, asks=asks)
    assert large.verdict == "certified", large.checked
    for (m, r), (x, _) in zip(ends(large), ends(exact), strict=True):
        assert abs(m - x) <= r <= F(size) / 10**6


def test_agents_that_begin_in_rest_at_their_places_end_there_exactly():
    graph = team(30, 9)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graph_certification, "EXACT_NODES", 0)
        patch.setattr(final_states, "EXACT_NODES", 0)
        h = rows(np.random.default_rng(1), graph.n_nodes, 1)
        found = certify(
            graph, STRONG, h, agents=Agents(order=2, offsets=h), asks=Asks(simulation=False, method="perron")
        )
    assert found.verdict == "certified" and found.agents is not None and found.agents.final_state is not None
    assert [agent[0] for agent in found.agents.final_state] == [((x, F(0)), (F(0), F(0))) for (x,) in h]


# ---------------------------------------------------------------------- what is forged


@pytest.mark.parametrize("kind", thinned(["double integrators", "with drag in a formation", "cascade"], 2))
def test_ends_that_are_moved_and_radii_that_are_too_small_are_rejected(kind: str):
    data = document(kind)
    part = data["agents"]["final_state"]
    places = [path for path, _ in leaves(part) if path[-1] in ("mid", 0)]
    assert len(places) > 20
    for stdlib, path in zip((True, False) * len(places), [("agents", "final_state", *p) for p in places], strict=False):
        said = at(data, path if path[-1] != "mid" else path[:-1])
        if not isinstance(said, dict):
            forged = changed(data, path, str(F(said) + F(1, 10**9)))
        else:
            path = path[:-1]
            middle, radius = F(said["mid"]), F(said["radius"])
            forged = changed(data, path, {**said, "mid": str(middle + radius * F(21, 10))})
            narrow = resealed(changed(data, path, {**said, "radius": str(radius / 10**6)}))
            assert not check(narrow, stdlib=stdlib).accepted
            assert check(resealed(changed(data, path, {**said, "radius": str(radius * 2)})), stdlib=stdlib).accepted
        report = check(resealed(forged), stdlib=stdlib)
        assert not report.accepted and (report.rejected or "").startswith("agent-final-state"), path


def test_without_the_witness_or_with_another_initial_state_no_end_is_accepted():
    data = document("double integrators")
    k = next(k for k, step in enumerate(data["proof"]) if step["kind"] == "final-state")
    leader = data["structure"][0]["leaders"][0]
    for forged in (
        changed(data, ("proof", k, "witness"), None),
        changed(data, ("proof", k), {key: x for key, x in data["proof"][k].items() if key != "witness"}),
        changed(data, ("agents", "initial_state", leader, 0, 1), "17"),
        changed(data, ("agents", "offsets", leader, 0), "1/7"),
        changed(data, ("influence", "components", 0, "left_null_vector", 0), "1/3"),
    ):
        assert not check(resealed(forged)).accepted


def unchanged(mutant: Json, path: Any, new: str) -> Json:
    return mutant


#: They take half a minute each.
LONG = [
    pytest.param(k, marks=pytest.mark.campaign)
    for k in ("triple integrators in a formation", "with drag in a formation")
]


@pytest.mark.parametrize("kind", [*LONG, "cascade"])
def test_mutants_of_final_states_that_are_accepted_are_true(kind: str):
    data = document(kind, 13, 2)
    judge = false_claims_of_cascade if kind == "cascade" else false_claims_of_agents
    only = [(path, mutant) for path, mutant in nudged(data, ("agents",), 3, 400, unchanged) if path[1] == "final_state"]
    parts = ("initial_state", "offsets", "motion")
    other = [(path, m) for path, m in nudged(data, ("agents",), 4, 40, unchanged) if path[1] in parts]
    count, passed = judged_mutants(data, iter(only[:20]), judge)
    assert count > 12 and passed  # a wider interval is true
    assert judged_mutants(data, iter(other), judge)[0] > 3
