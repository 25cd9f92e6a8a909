"""Where the agents end, who decides whom, Definitions 1 to 5."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from definitions import (
    DEFINITIONS,
    is_bipartite_consensus,
    is_bipartite_containment,
    is_interval_bipartite_consensus,
    is_stability,
)
from generators import Made, made_graphs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from ptcc_certify.batch import certify_many
from ptcc_certify.bounds.final_state.of_graph import final_state, influence
from ptcc_certify.bounds.input.initial_sets import box, ellipsoid
from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.simulation.run import simulate
from ptcc_certify.theorems.lemmas import laplacian_spectrum

SEEDS = st.integers(0, 2**32 - 1)


def start(seed: int, n: int) -> list[Fraction]:
    rng = np.random.default_rng(seed)
    return [Fraction(int(v), int(d)) for v, d in zip(rng.integers(-99, 100, n), rng.integers(1, 9, n), strict=True)]


def projection(made: Made) -> list[list[Fraction]]:
    """``Q`` as a full matrix, from the rows."""
    q = influence(analyse(made.graph))
    n = made.graph.n_nodes
    return [[Fraction(q.row(i).get(j, 0)) for j in range(n)] for i in range(n)]


@pytest.mark.few(0)
@given(made_graphs(max_nodes=9))
def test_q_is_the_projection_onto_the_kernel_along_the_range(made: Made):
    """L Q = Q L = 0 and Q Q = Q, in rationals, and rank Q is the number of balanced closed components."""
    Q, L, n = projection(made), made.graph.exact_laplacian(), made.graph.n_nodes

    def product(A, B):
        return [[sum((A[i][k] * B[k][j] for k in range(n)), Fraction(0)) for j in range(n)] for i in range(n)]

    zero = [[Fraction(0)] * n for _ in range(n)]
    assert product(L, Q) == zero
    assert product(Q, L) == zero
    assert product(Q, Q) == Q
    assert sum(Q[i][i] for i in range(n)) == sum(balanced for _, balanced in made.closed)


@pytest.mark.few(0)
@given(made_graphs(max_nodes=9), SEEDS)
def test_the_final_state_is_the_limit_of_the_motion(made: Made, seed: int):
    x0 = start(seed, made.graph.n_nodes)
    structure = analyse(made.graph)
    exact, floats = final_state(structure, x0), final_state(structure, x0, exact=False)
    assert exact.exact and not floats.exact
    size = max(1.0, max(abs(float(x)) for x in x0))
    assert np.asarray(floats) == pytest.approx(np.asarray(exact), abs=1e-8 * size)
    rate = laplacian_spectrum(structure).spectral_rate or 1.0
    L = made.graph.laplacian().toarray()
    if np.abs(L).max() / rate < 1e4:  # beyond, expm needs too large an argument for float64
        limit = expm(-L * (80 / rate)) @ [float(x) for x in x0]
        assert np.asarray(exact) == pytest.approx(limit, abs=1e-6 * size)


@pytest.mark.few(0)
@given(made_graphs(max_nodes=9), SEEDS)
def test_the_final_state_shows_the_claimed_behaviour(made: Made, seed: int):
    x0 = start(seed, made.graph.n_nodes)
    structure = analyse(made.graph)
    result = final_state(structure, x0)
    if not result.degenerate and structure.claim is not None:
        assert DEFINITIONS[structure.claim.behaviour](result.states, structure)
        for word in structure.claim.special:
            if word in ("consensus",):
                assert len(set(result.states)) == 1
            elif word in ("signed-average consensus",):
                g = structure.gauge
                assert g is not None
                mean = sum((int(s) * x for s, x in zip(g, x0, strict=True)), Fraction(0)) / len(x0)
                assert [int(s) * x for s, x in zip(g, result.states, strict=True)] == [mean] * len(x0)
            elif word in DEFINITIONS:
                assert DEFINITIONS[word](result.states, structure)
    if not result.degenerate and structure.claim is None:
        assert is_bipartite_containment(result.states, structure)
    hull = max((abs(result.states[v]) for v in structure.leaders.tolist()), default=Fraction(0))
    assert all(abs(x) <= hull for x in result.states)
    assert hull <= max(abs(x0[v]) for v in structure.leaders.tolist())


def test_a_degenerate_start_is_named():
    st_ = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 3)]))
    result = final_state(st_, [3, -1])
    assert result.states == (0, 0)
    assert result.degenerate == (1,)
    assert not is_bipartite_consensus(result.states, st_)  # Definition 3 asks for a positive value
    assert final_state(st_, [3, 1]).degenerate == ()
    single = analyse(SignedDigraph.from_edges([("a", "b", 1)]))
    assert final_state(single, [0, 5]).degenerate == (1,)
    assert final_state(single, ["0.1", 5]).states == (Fraction(1, 10), Fraction(1, 10))


def test_who_decides_whom():
    g = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "f", -2), ("c", "f", 2)])
    q = influence(analyse(g))
    assert q.row(g.index["f"]) == {0: Fraction(-1, 4), 1: Fraction(-1, 4), 3: Fraction(1, 2)}
    assert q.row(g.index["a"]) == {0: Fraction(1, 2), 1: Fraction(1, 2)}
    unbalanced = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)]))
    assert influence(unbalanced).row(0) == {}


@pytest.mark.parametrize(
    ("x0", "message"), [([1], "1 value for 2"), ([1, "x"], "not a number"), ([1, float("nan")], "finite")]
)
def test_bad_starts_are_refused(x0, message):
    st_ = analyse(SignedDigraph.from_edges([(1, 2, 1)]))
    with pytest.raises(ParameterError, match=message):
        final_state(st_, x0)


def test_a_start_by_label():
    st_ = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)]))
    assert final_state(st_, {"2": 1, 1: 5}).states == (3, 3)
    for bad in ({"1": 5}, {"1": 5, "3": 2}, "52", {5, 2}, iter([1, 2, 3])):
        with pytest.raises(ParameterError, match="x0"):
            final_state(st_, bad)


def test_labels_of_a_series_count_wherever_a_state_is_taken():
    pd = pytest.importorskip("pandas")
    team = SignedDigraph.from_edges([("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
    plain, x0 = [3.5, 2.5, 1.5], pd.Series({"eve": 1.5, "bob": 2.5, "ann": 3.5})
    cert = certify(team, protocol, x0, asks=Asks(simulation=False))
    assert [float(x) for x in cert.initial_state] == plain
    assert cert.envelope.norm_bound([0.5], x0) == cert.norm_bound([0.5])
    assert (cert.envelope.deviation_bound([0.5], x0) == cert.deviation_bound([0.5])).all()
    assert cert.final_state.states == final_state(analyse(team), x0).states
    assert simulate(team, protocol, x0).states[:, 0].tolist() == plain
    run = simulate(team, protocol, pd.DataFrame({"x": x0, "y": 2 * x0}))
    assert run.states[:, :, 0].tolist() == [[x, 2 * x] for x in plain]
    robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    slid = certify(team, robust, InitialState(x0, sigma0=x0), asks=Asks(simulation=False))
    assert slid.sigma0 == slid.initial_state == cert.initial_state
    assert simulate(team, robust, x0, sigma0=x0).sliding.sigma[:, 0].tolist() == plain
    row, other = certify_many(team, protocol, x0=x0)[0], certify_many(team, protocol, x0=plain)[0]
    assert row | {"seconds": 0} == other | {"seconds": 0}
    assert box(x0 - 1, x0, team) == box([2.5, 1.5, 0.5], plain, team)
    assert ellipsoid(x0, [x0], team) == ellipsoid(plain, [plain])
    whole = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (3, 1, 1)])
    assert final_state(analyse(whole), pd.Series([7, 5, 6], index=[3, 1, 2])).states == (7, 7, 7)


@pytest.mark.parametrize(
    ("index", "reason"),
    [
        (["ann", "bob"], "no value for eve;"),
        (["ann", "bob", "zoe"], "no value for eve, and zoe is not in the graph"),
        (["ann", "bob", "eve", "zoe", "max"], "max, zoe are not in the graph|zoe, max are not in the graph"),
        ([0, 1, 2], "no value for ann, bob, eve, and 0, 1, 2 are not in the graph"),
        (["ann", "bob", "eve", "ann"], "two values for node ann"),
    ],
)
def test_a_series_with_other_labels_than_the_nodes_is_refused(index, reason):
    pd = pytest.importorskip("pandas")
    team = SignedDigraph.from_edges([("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)])
    protocol, x0 = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), pd.Series(1.0, index=index)
    for ask in (certify, simulate):
        with pytest.raises(ParameterError, match=reason) as caught:
            ask(team, protocol, x0)
        assert str(caught.value).isprintable() and len(str(caught.value)) < 200
    (row,) = certify_many(team, protocol, x0=x0) if len(set(index)) == len(index) else [{"error": reason}]
    assert re.search(reason, row["error"])


def test_ends_of_a_box_with_labels_need_the_graph():
    with pytest.raises(ParameterError, match="low has labels"):
        box({"a": 1}, {"a": 2})
    with pytest.raises(ParameterError, match="center has labels"):
        ellipsoid({"a": 1}, [[1]])
    with pytest.raises(ParameterError, match="list of vectors"):
        ellipsoid([0], {"a": [1]})


def test_the_definitions_on_states():
    pair = analyse(SignedDigraph.from_edges([("a", "f", 1), ("b", "f", 1)]))
    assert is_stability([0, 0, 0], pair) and not is_stability([0, 1e-9, 0], pair)
    assert is_bipartite_consensus([2, -2, 2], pair) and not is_bipartite_consensus([2, -2, 1], pair)
    assert not is_bipartite_consensus([0, 0, 0], pair)
    order = pair.graph.labels
    state = {"a": 1, "b": -3, "f": 2}
    assert is_bipartite_containment([state[k] for k in order], pair)
    assert not is_bipartite_containment([dict(state, f=4)[k] for k in order], pair)
    assert not is_bipartite_containment([dict(state, a=0)[k] for k in order], pair)
    assert not is_interval_bipartite_consensus([1, 1, 1], pair)  # two closed components
    chain = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)]))
    assert is_interval_bipartite_consensus([2, -1, 0], chain)
    assert not is_interval_bipartite_consensus([2, -3, 0], chain)


@pytest.mark.few(0)
@settings(max_examples=40)
@given(made_graphs(max_nodes=6, weights=("units", "small ints")), SEEDS)
def test_the_definitions_on_trajectories(made: Made, seed: int):
    structure = analyse(made.graph)
    x0 = start(seed, made.graph.n_nodes)
    run = simulate(made.graph, NominalProtocol(T=1, rho1=1, rho2=2, kappa=2), [float(x) for x in x0])
    result = final_state(structure, x0)
    assert run.deadline_resolved
    assert np.abs(run.final_state - np.asarray(result)).max() <= 1e-7 * max(1.0, np.abs(run.states).max())
    after = run.error[..., run.deadline_index :]
    assert np.abs(after).max(initial=0.0) <= 1e-6 * np.abs(run.error).max(initial=0.0)  # Definition 1
    tolerance = 1e-6 * np.abs(run.states).max()
    smallest = min((abs(float(c)) for c in result.consensus_values), default=1.0)
    if structure.claim is not None and smallest > 1e-3:
        assert DEFINITIONS[structure.claim.behaviour](run.final_state, structure, tolerance)
    early = simulate(made.graph, NominalProtocol(T=1, rho1=1, rho2=2, kappa=2), [float(x) for x in x0], past=0.5)
    assert is_stability(early.final_state, structure, tolerance) == is_stability(result.states, structure)
