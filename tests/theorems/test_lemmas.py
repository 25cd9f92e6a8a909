"""Lemmas 1, 2, 3, 7, 8 and 9 of the paper as properties (4 and 5: test_lmi.py; 6: test_gain.py)."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from generators import Made, made_graphs
from hypothesis import given, settings
from hypothesis import strategies as st

import lmi
from lmi import sparse_h_matrix
from ptcc_certify.bounds.final_state.of_graph import influence
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.theorems.lemmas import (
    algebraic_connectivity,
    containment_weights,
    exact_containment_weights,
    exact_left_vector,
    follower_lyapunov,
    gauge,
    laplacian_spectrum,
    left_vector,
    solve_exact,
    unbalanced_lyapunov,
)

STRONG_BALANCED, STRONG_UNBALANCED = ("1.1",), ("1.2",)


def laplacian(graph: SignedDigraph) -> np.ndarray:
    """``D - W`` from the definition, entry by entry."""
    L = np.zeros((graph.n_nodes, graph.n_nodes))
    for s, t, w in graph.edges:
        k, j = graph.index[t], graph.index[s]
        L[k, j] -= float(w)
        L[k, k] += abs(float(w))
    return L


@given(made_graphs(max_nodes=8))
def test_lemma_1_balance_means_a_gauge(made: Made):
    """G L G = M(L) for some G iff balanced; for unbalanced graphs no choice of signs serves."""
    L = laplacian(made.graph)
    M = lmi.comparison_matrix(L)
    g = gauge(made.graph)
    if g is not None:
        assert np.array_equal(np.diag(g) @ L @ np.diag(g), M)
    else:
        n = made.graph.n_nodes
        signs = (np.array((1, *rest)) for rest in product((1, -1), repeat=n - 1))
        assert not any(np.array_equal(np.outer(s, s) * L, M) for s in signs)


@given(made_graphs(only=STRONG_UNBALANCED))
def test_lemma_2_unbalanced_strong_graphs_have_no_zero_eigenvalue(made: Made):
    spectrum = laplacian_spectrum(analyse(made.graph))
    assert spectrum.kernel_dimension == 0
    assert spectrum.nonzero.size == made.graph.n_nodes
    assert spectrum.nonzero.real.min() > 0
    assert np.sort(spectrum.nonzero.real) == pytest.approx(np.sort(np.linalg.eigvals(laplacian(made.graph)).real))


@pytest.mark.few(0)
@given(made_graphs(only=STRONG_BALANCED))
def test_lemma_2_balanced_strong_graphs_have_a_simple_zero(made: Made):
    spectrum = laplacian_spectrum(analyse(made.graph))
    g = gauge(made.graph)
    assert g is not None
    assert spectrum.kernel_dimension == 1
    assert spectrum.nonzero.size == made.graph.n_nodes - 1
    assert (spectrum.nonzero.real > 0).all()
    assert laplacian(made.graph) @ g == pytest.approx(0, abs=1e-9 * (1 + np.abs(laplacian(made.graph)).max()))


@given(made_graphs(weights=("units", "small ints")))
def test_the_spectrum_has_one_zero_for_each_balanced_closed_component(made: Made):
    structure = analyse(made.graph)
    spectrum = laplacian_spectrum(structure)
    assert spectrum.kernel_dimension == sum(balanced for _, balanced in made.closed)
    assert spectrum.nonzero.size + spectrum.kernel_dimension == made.graph.n_nodes
    assert (spectrum.nonzero.real > 0).all()
    assert spectrum.nonzero.real.sum() == pytest.approx(np.trace(laplacian(made.graph)), abs=1e-8)


@pytest.mark.few(0)
@given(made_graphs(only=("1.1", "1.2")))
def test_lemma_2_3_the_positive_left_vector(made: Made):
    exact, p = exact_left_vector(made.graph), left_vector(made.graph)
    assert sum(exact) == 1
    assert min(exact) > 0
    L, n = made.graph.exact_laplacian(), made.graph.n_nodes
    M = [[abs(L[i][j]) if i == j else -abs(L[i][j]) for j in range(n)] for i in range(n)]
    assert all(sum(exact[i] * M[i][j] for i in range(n)) == 0 for j in range(n))
    assert p == pytest.approx([float(x) for x in exact], rel=1e-12)  # relative accuracy in every entry


def test_left_vector_needs_a_strong_graph():
    g = SignedDigraph.from_edges([(1, 2, 1)])
    for function in (left_vector, exact_left_vector):
        with pytest.raises(HypothesisError, match="strongly connected"):
            function(g)


@given(made_graphs(only=STRONG_BALANCED), st.integers(0, 2**32 - 1))
def test_lemma_3_1_connectivity_bounds_the_form_from_below(made: Made, seed: int):
    graph = made.graph
    if graph.n_nodes == 1:
        with pytest.raises(HypothesisError, match="two nodes"):
            algebraic_connectivity(graph)
        return
    L, p, g = laplacian(graph), left_vector(graph), gauge(graph)
    assert g is not None
    P = np.diag(p)
    Lbar = (P @ L + L.T @ P) / 2
    a = algebraic_connectivity(graph)
    scale = np.abs(Lbar).max()
    assert a > 0
    assert np.linalg.eigvalsh(Lbar)[0] >= -1e-12 * scale  # Lbar >= 0, kernel spanned by G1
    assert Lbar @ g == pytest.approx(0, abs=1e-12 * scale)
    xi = np.random.default_rng(seed).normal(size=(graph.n_nodes, 20))
    xi -= np.outer(g, (g * p) @ xi)  # xi' G p = 0
    assert ((xi * (Lbar @ xi)).sum(0) >= a * (xi * (P @ xi)).sum(0) - 1e-9 * scale * (xi**2).sum(0)).all()


@pytest.mark.few(0)
@settings(max_examples=20)
@given(made_graphs(only=STRONG_UNBALANCED, max_nodes=8))
def test_lemma_3_2_unbalanced_strong_graphs_have_a_diagonal_lyapunov_matrix(made: Made):
    found = unbalanced_lyapunov(made.graph)
    S = np.diag(found.omega) @ laplacian(made.graph)
    assert found.omega.min() > 0
    assert np.linalg.eigvalsh(S + S.T)[0] > 0


def test_lemma_3_names_the_hypothesis_that_fails():
    balanced = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    unbalanced = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)])
    with pytest.raises(HypothesisError, match="balanced"):
        unbalanced_lyapunov(balanced)
    with pytest.raises(HypothesisError, match="strongly connected"):
        unbalanced_lyapunov(SignedDigraph.from_edges([(1, 2, 1)]))
    with pytest.raises(HypothesisError, match="negative cycle"):
        algebraic_connectivity(unbalanced)


@pytest.mark.few(0)
@settings(max_examples=20)
@given(made_graphs(only=("2.", "3."), max_nodes=10))
def test_lemmas_7_and_9_1_the_follower_block(made: Made):
    structure = analyse(made.graph)
    F = structure.followers
    L_F = laplacian(made.graph)[np.ix_(F, F)]
    assert lmi.is_h_matrix(L_F / np.diag(L_F)[:, None])
    assert np.linalg.eigvals(L_F).real.min() > 0
    found = follower_lyapunov(structure)
    S = np.diag(found.omega) @ L_F
    assert found.omega.min() > 0
    assert np.linalg.eigvalsh(S + S.T)[0] > 0


def test_lemma_7_needs_followers():
    with pytest.raises(HypothesisError, match="no followers"):
        follower_lyapunov(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])))


@given(made_graphs())
def test_lemmas_8_and_9_2_followers_stay_within_the_leaders(made: Made):
    """Absolute row sums of varpi are at most 1, and exactly 1 for one closed component in a balanced graph."""
    structure = analyse(made.graph)
    exact = exact_containment_weights(structure)
    assert len(exact) == structure.followers.size
    assert all(sum(map(abs, row), Fraction(0)) <= 1 for row in exact)
    weights = containment_weights(structure)
    assert weights is not None
    floats = np.array([[float(x) for x in row] for row in exact]).reshape(weights.shape)
    assert weights == pytest.approx(floats, abs=1e-9)
    if made.connectivity == "quasi-strong" and structure.balanced:
        assert all(abs(row[0]) == 1 for row in exact)
        camps = structure.gauge
        assert camps is not None
        ratio = {int(camps[v]) * int(row[0]) for v, row in zip(structure.followers, exact, strict=True)}
        assert len(ratio) == 1  # zeta = G_F 1, up to the sign common to the whole gauge


@given(made_graphs(only=("2.", "3."), weights=("units", "small ints")))
def test_the_inverse_of_the_follower_block_contracts(made: Made):
    """Absolute row sums of L_F^-1 L_FL are at most 1 (Lemma 8 node by node)."""
    structure = analyse(made.graph)
    L, F, K = made.graph.exact_laplacian(), structure.followers.tolist(), structure.leaders.tolist()
    X = solve_exact([[L[i][j] for j in F] for i in F], [[L[i][j] for j in K] for i in F])
    assert X is not None
    assert all(sum(map(abs, row), Fraction(0)) <= 1 for row in X)


def test_a_singular_system_has_no_solution():
    assert solve_exact([[Fraction(1), Fraction(1)], [Fraction(1), Fraction(1)]], [[Fraction(1)], [Fraction(0)]]) is None


def test_followers_of_a_random_graph_need_no_sparse_factor_for_their_weights(monkeypatch: pytest.MonkeyPatch):
    """Its factor fills in: of 20,000 followers it takes many minutes."""
    monkeypatch.setattr(sparse_h_matrix, "diagonal_factor", None)
    n, leaders = 6000, 5
    rng = np.random.default_rng(2)
    source, target = rng.integers(0, n, 6 * n), rng.integers(leaders, n, 6 * n)
    edges = {(int(s), int(t)): int(w) for s, t, w in zip(source, target, rng.choice([-1, 2], 6 * n), strict=True)}
    graph = SignedDigraph.from_edges([(s, t, w) for (s, t), w in edges.items() if s != t])
    structure = analyse(graph)
    weights, L = containment_weights(structure), graph.laplacian().tocsr()
    assert weights is not None and structure.closed_components
    ends = np.zeros((graph.n_nodes, weights.shape[1]))
    for column, component in enumerate(c for c in structure.closed_components if c.balanced):
        ends[list(component.nodes), column] = component.gauge
    ends[structure.followers] = weights
    assert np.abs((L @ ends)[structure.followers]).max() < 1e-7 * graph.in_weight().max()
    assert np.abs(weights).sum(axis=1).max() <= 1 + 1e-7


def test_followers_on_a_long_line_between_two_leaders_share_them_by_their_place():
    """No iterative solve converges on it, its factor is sparse: made once for both columns."""
    n = 4000
    edges = [e for k in range(1, n) for e in ((k + 1, k, 1), (k, k + 1, 1)) if e[1] < n]
    weights = containment_weights(analyse(SignedDigraph.from_edges([(0, 1, 1), *edges])))
    share = np.arange(1, n) / n
    assert weights is not None
    assert np.abs(weights - np.column_stack([1 - share, share])).max() < 1e-6


def test_weights_that_no_solve_finds_are_not_given(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sparse_h_matrix, "_PRODUCTS", 1)
    monkeypatch.setattr(sparse_h_matrix, "DIRECT_ROWS", 2)
    star = [(0, 1, 1), (1, 2, 1), (2, 3, 1), (3, 1, -1), (9, 3, 2)]
    by_factor = np.array([[3, -2], [3, -2], [1, 4]]) / 7
    assert containment_weights(analyse(star)) == pytest.approx(by_factor)
    monkeypatch.setattr(sparse_h_matrix, "FILL_ROWS", -1)
    assert containment_weights(analyse(star)) is None
    assert influence(analyse(star), exact=False).containment_weights is None
