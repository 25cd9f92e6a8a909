"""Theorems 1 to 3: which row applies, its rate from the definition, its proof, V' along the motion, invariances."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import cvxpy as cp
import numpy as np
import pytest
from generators import Made, all_classes, class_cases, made_graphs, random_graph
from generators import smallest as smallest_size
from hypothesis import given, settings
from hypothesis import strategies as st
from test_latex import read, rows_of

from ptcc_certify.checker import OBLIGATIONS
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model import NominalProtocol
from ptcc_certify.theorems.casadi_lyapunov import symbolic_lyapunov
from ptcc_certify.theorems.claims import sliding_claim
from ptcc_certify.theorems.leaders_and_followers import _prove_interval
from ptcc_certify.theorems.lemmas import laplacian_spectrum
from ptcc_certify.theorems.table import THEOREMS, theorem_for

PROTOCOL = NominalProtocol(T="0.6", rho1="0.1", rho2="0.3", kappa=1)


def laplacian(graph: SignedDigraph) -> np.ndarray:
    L = np.zeros((graph.n_nodes, graph.n_nodes))
    for s, t, w in graph.edges:
        L[graph.index[t], graph.index[s]] -= float(w)
        L[graph.index[t], graph.index[t]] += abs(float(w))
    return L


def smallest(S: np.ndarray) -> float:
    return np.linalg.eigvals((S + S.T) / 2).real.min()


def connectivity(L: np.ndarray, p: np.ndarray) -> float:
    """``2 a(L)``: twice the second-smallest eigenvalue of ``P^-1 (PL + L'P)/2``."""
    return float(np.sort(np.linalg.eigvals(L + np.diag(1 / p) @ L.T @ np.diag(p)).real)[1])


def rate_from_the_definition(structure: Structure, V: LyapunovFunction, theorem: str) -> float:
    """The column "rate" of the table of theorem rows, with plain NumPy eigenvalues."""
    L = laplacian(structure.graph)
    w = np.array([float(x) for x in V.weights])
    nodes = list(V.nodes)
    if theorem == "1.1":
        return connectivity(L, w)
    whole = np.diag(w) @ L[np.ix_(nodes, nodes)]
    if theorem in ("1.2", "2.2", "3.2") or all(b.name in ("Xi_F", "H_F") for b in V.blocks):
        return smallest(whole + whole.T) / w.max()
    sizes, gammas = [], []
    for block in V.blocks:
        if block.times_rho:
            continue
        own, d = list(block.nodes), np.array([float(x) for x in block.diagonal])
        L_k = L[np.ix_(own, own)]
        component = next(c for c in structure.closed_components if list(c.nodes) == own)
        if theorem == "2.1":
            gammas.append(connectivity(L_k, d) * d)
        elif component.balanced:
            gammas.append(np.full(len(own), connectivity(L_k, d) * d.min()))
        else:
            gammas.append(np.full(len(own), smallest(np.diag(d) @ L_k + L_k.T @ np.diag(d))))
        sizes.append(len(own))
    K = sum(sizes)
    form = whole + whole.T  # its follower rows are those of Phi and Pi; the leader block is replaced
    form[:K, :K] = np.diag(np.concatenate(gammas))
    return smallest(form) / w.max()


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "kwargs"), class_cases())
def test_every_row(name: str, kwargs: dict):
    """The row applies, its rate is the paper's to 1e-8, it is proved, and never above the spectral rate."""
    for seed in range(2):
        made = random_graph(np.random.default_rng(seed), **kwargs)
        structure = analyse(made.graph)
        theorem = theorem_for(structure)
        assert all(theorem.hypotheses(structure).values())
        assert theorem.statement
        if structure.claim is not None:
            counterpart = theorem_for(structure, "sliding-mode")
            applying = [t.number for t in THEOREMS if t.applies(structure)]
            assert applying == [structure.claim.theorem, counterpart.number]
            assert [theorem.number, sliding_claim(structure.claim).theorem] == applying
            assert counterpart.hypotheses(structure) == theorem.hypotheses(structure)
        V = theorem.lyapunov(structure)
        proof = theorem.prove(structure, V)
        spectral = laplacian_spectrum(structure).spectral_rate
        if not V.blocks:
            assert spectral is None
            assert proof.rate is None
            assert proof.failed is None and proof.obligations == ()
            continue
        rate = theorem.rate(structure, V)
        assert theorem_for(structure, "sliding-mode").rate(structure, V) == rate
        assert rate == pytest.approx(rate_from_the_definition(structure, V, theorem.number), rel=1e-8)
        assert proof.failed is None
        assert float(proof.rate) == pytest.approx(rate, rel=1e-8)
        assert 0 < float(proof.rate) <= spectral * (1 + 1e-9)
        assert V.overshoot == max(V.weights) / min(V.weights) >= 1
        assert min(V.weights) > 0
        last = [o for o in proof.obligations if o.kind != "rho-interval"][-1]
        if theorem.number == "1.1":
            assert (last.kind, last.of, last.numbers) == ("deviation-decrease", "paper", {"b": proof.rate})
        else:
            rho = {} if V.rho is None else {"rho": V.rho}
            assert (last.kind, last.of) == ("margin", "paper")
            assert last.numbers == {"m": proof.rate * max(V.weights), **rho}
        assert all((o.statement, o.lemma) == OBLIGATIONS[o.kind] and o.witness is None for o in proof.obligations)
        if proof.interval is not None and V.rho is not None and proof.interval.exact is not None:
            assert 0 < proof.interval.printed <= proof.interval.exact
            assert V.rho <= proof.interval.exact


def optimum_of_another_solver(structure: Structure, V: LyapunovFunction, theorem: str) -> float:
    """The largest quotient of the row over its free matrices and ``rho`` by SCS, with a full matrix variable."""
    L, n = laplacian(structure.graph), len(V.nodes)
    A = L[np.ix_(V.nodes, V.nodes)]
    unit = np.abs(A).max()
    t, s, w, S = cp.Variable(), cp.Variable(), cp.Variable(n), cp.Variable((n, n), PSD=True)
    product = cp.multiply(cp.reshape(w, (n, 1), order="C") @ np.ones((1, n)), A / unit)
    form = product + product.T
    constraints = [w >= 0, w <= 1]
    at = 0
    for block in V.blocks:
        own, here = list(block.nodes), slice(at, at + len(block.nodes))
        at += len(own)
        if block.times_rho or theorem not in ("2.1", "3.1") or V.rho is None:
            continue
        d = np.array([float(x) for x in block.diagonal])
        L_k = L[np.ix_(own, own)] / unit
        picked = np.zeros((n, n))
        picked[here, here] = 1.0
        if next(c.balanced for c in structure.closed_components if list(c.nodes) == own):
            decrease = s * (connectivity(L_k, d) * (d if theorem == "2.1" else np.full(len(own), d.min())))
            constraints.append(w[here] == s * d)
        else:
            t_k, S_k = cp.Variable(), cp.Variable((len(own), len(own)), PSD=True)
            inner = cp.multiply(cp.reshape(w[here], (len(own), 1), order="C") @ np.ones((1, len(own))), L_k)
            constraints.append(inner + inner.T - t_k * np.eye(len(own)) == S_k)
            decrease = t_k * np.ones(len(own))
        selection = np.eye(n)[:, here]
        form = form - cp.multiply(picked, form) + selection @ cp.diag(decrease) @ selection.T
    problem = cp.Problem(cp.Maximize(t), [*constraints, form - t * np.eye(n) == S])
    problem.solve(solver=cp.SCS, eps_abs=1e-9, eps_rel=1e-9, max_iters=200_000)
    return float(t.value) * unit


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["1.2", "2.1 K=1", "2.1 K>=2", "2.2", "3.1 all single", "3.1 mixed no single", "3.2"])
@pytest.mark.parametrize("seed", range(2))
def test_the_objective_of_a_row_is_the_optimum_of_another_solver(name: str, seed: int):
    kwargs = dict(all_classes())[name]
    made = random_graph(np.random.default_rng(seed), **dict(kwargs, n=smallest_size(**kwargs) + 1))
    structure = analyse(made.graph)
    theorem = theorem_for(structure)
    V = theorem.lyapunov(structure)
    assert theorem.rate(structure, V) == pytest.approx(
        optimum_of_another_solver(structure, V, theorem.number), rel=1e-5
    )


@pytest.mark.few(0)
@pytest.mark.parametrize("theorem", ["2.1", "2.2", "3.1 no single", "3.1 mixed", "3.2"])
@pytest.mark.parametrize("seed", range(3))
def test_the_chosen_rho_beats_a_thousand_others(theorem: str, seed: int):
    kwargs = dict(all_classes())[theorem if theorem != "2.1" else "2.1 K>=2"]
    rng = np.random.default_rng(seed)
    structure = analyse(random_graph(rng, **kwargs).graph)
    row = theorem_for(structure)
    V = row.lyapunov(structure)
    assert V.rho is not None and V.interval is not None
    end = min(V.interval.exact, 1e6)
    tried = np.concatenate([rng.uniform(0, end, 500), end * 10.0 ** rng.uniform(-6, 0, 500)])
    one, two = (row.decrease(structure, replace(V, rho=Fraction(rho))) for rho in (1, 2))
    plain = np.array([float(w) for block in V.blocks for w in block.diagonal])
    times = np.array([block.times_rho for block in V.blocks for _ in block.nodes])

    def rate(rho: float) -> float:
        form = 2 * one - two + rho * (two - one)  # affine in rho
        return float(np.linalg.eigvalsh(form)[0]) / float((np.where(times, rho, 1.0) * plain).max())

    assert rate(float(V.rho)) == pytest.approx(row.rate(structure, V), rel=1e-9)
    assert row.rate(structure, V) >= max(rate(rho) for rho in tried if rho > 0) * (1 - 1e-9)


@pytest.mark.parametrize("gap", [1e-2, 1e-8, 1e-10])
def test_a_rho_next_to_the_end_of_its_interval_lies_within_what_is_proved(gap: float):
    structure = analyse(random_graph(np.random.default_rng(0), **dict(all_classes())["2.1 K>=2"]).graph)
    V = theorem_for(structure).lyapunov(structure)
    assert V.interval is not None
    near = replace(V, rho=Fraction(1 - gap), interval=replace(V.interval, printed=0.5, exact=1.0))
    interval, _ = _prove_interval(near, lambda rho: [[1 - rho]])
    assert interval is not None and interval.exact is not None and near.rho <= interval.exact < 1


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "kwargs"), class_cases())
def test_the_derivative_is_the_form_of_the_proof(name: str, kwargs: dict):
    """V' by CasADi equals -gain z'(Omega A + A'Omega)z to 1e-10 and is at most the form that gives the rate."""
    rng = np.random.default_rng(7)
    structure = analyse(random_graph(rng, **kwargs).graph)
    V = theorem_for(structure).lyapunov(structure)
    if not V.blocks:
        return
    symbolic = symbolic_lyapunov(structure, V, PROTOCOL)
    evaluate = ca.Function(
        "f", [symbolic.t, symbolic.x], [symbolic.V, symbolic.V_dot, symbolic.proof_form, symbolic.bounding_form]
    )
    w = np.array([float(x) for x in V.weights])
    for _ in range(10):
        x, t = rng.normal(size=structure.graph.n_nodes), rng.uniform(0, 0.59)
        value, derivative, form, bound = (float(y) for y in evaluate(t, x))
        scale = abs(derivative) + abs(value)
        assert derivative == pytest.approx(form, abs=1e-10 * scale)
        assert derivative <= bound + 1e-10 * scale
        E = -laplacian(structure.graph) @ x
        z = E[list(V.nodes)] if V.coordinates == "E" else None
        if z is not None:
            assert value == pytest.approx(w @ z**2, rel=1e-12)
        assert np.array(ca.Function("E", [symbolic.x], [symbolic.E])(x)).ravel() == pytest.approx(E)


@pytest.mark.parametrize("name", ["1.1", "1.2", "2.1 K=1", "2.1 K>=2", "2.2", "3.1 mixed", "3.2"])
def test_the_latex_of_a_row_has_the_values_of_its_expressions(name: str):
    rng = np.random.default_rng(3)
    structure = analyse(random_graph(rng, **dict(all_classes())[name]).graph)
    V = theorem_for(structure).lyapunov(structure)
    form = symbolic_lyapunov(structure, V, PROTOCOL)
    state, instant = rng.normal(size=structure.graph.n_nodes), 0.25
    values = {f"x{k + 1}": v for k, v in enumerate(state)}
    rows = rows_of(form.latex())
    e = {f"e{k + 1}": read(rows[f"e_{{{k + 1}}}"], **values) for k in V.nodes}
    evaluate = ca.Function("f", [form.t, form.x], [form.z, form.V, form.V_dot])
    z, value, derivative = (np.array(y).ravel() for y in evaluate(instant, state))
    assert list(e.values()) == pytest.approx(z)
    assert read(rows["V"], **e) == pytest.approx(float(value[0]))
    gain = read(rows["g"], t=instant)
    assert read(rows[r"\dot V"], g=gain, **e) == pytest.approx(float(derivative[0]))


def test_a_notebook_shows_coefficients_of_four_digits_and_says_that_they_are_rounded():
    structure = analyse(load_graph("fig3a"))
    form = symbolic_lyapunov(structure, theorem_for(structure).lyapunov(structure), PROTOCOL)
    shown, exact = form._repr_latex_(), form.latex()
    assert not re.search(r"\d\.\d{5}", shown) and shown.count(r"&\approx") == 2
    assert r"\approx" not in exact and re.search(r"\d\.\d{12}", exact)
    shorter = rows_of(form.latex(4).replace(r"\approx", "="))
    for name, row in rows_of(exact).items():
        few, full = (re.findall(r"\d+\.?\d*(?= e_)", text) for text in (shorter[name], row))
        assert [float(x) for x in few] == pytest.approx([float(x) for x in full], rel=5e-4)


def certified_rate(graph: SignedDigraph) -> float | None:
    structure = analyse(graph)
    theorem = theorem_for(structure)
    V = theorem.lyapunov(structure)
    rate = theorem.prove(structure, V).rate
    return None if rate is None else float(rate)


@settings(max_examples=5)
@given(made_graphs(max_nodes=8, weights=("units", "small ints")), st.integers(0, 2**32 - 1))
def test_relabelling_scaling_and_switching_change_no_rate(made: Made, seed: int):
    rng = np.random.default_rng(seed)
    graph = made.graph
    rate = certified_rate(graph)
    edges = list(graph.edges)
    order = rng.permutation(graph.n_nodes)
    names = {label: f"n{order[i]}" for i, label in enumerate(graph.labels)}
    moved = SignedDigraph.from_edges(
        [(names[s], names[t], w) for s, t, w in edges], sorted(names.values(), key=lambda x: int(x[1:]))
    )
    factor = Fraction(int(rng.integers(1, 50)), int(rng.integers(1, 50)))
    scaled = SignedDigraph.from_edges([(s, t, factor * w) for s, t, w in edges], graph.labels)
    node = graph.labels[int(rng.integers(graph.n_nodes))]
    switched = SignedDigraph.from_edges(
        [(s, t, -w if (s == node) != (t == node) else w) for s, t, w in edges], graph.labels
    )
    if rate is None:
        assert certified_rate(moved) is certified_rate(scaled) is certified_rate(switched) is None
        return
    assert certified_rate(moved) == pytest.approx(rate, rel=1e-5)
    assert certified_rate(scaled) == pytest.approx(rate * float(factor), rel=1e-5)
    assert certified_rate(switched) == pytest.approx(rate, rel=1e-5)


def test_the_hypotheses_are_named():
    structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)]))
    assert THEOREMS[0].hypotheses(structure) == {"strongly connected": True, "structurally balanced": False}
    assert not THEOREMS[0].applies(structure)


def test_a_wrong_matrix_is_not_proved():
    """The proof judges the matrix, not its origin: a diagonal that does not decay is refused."""
    structure = analyse(SignedDigraph.from_edges([(1, 2, 3), (2, 3, -1), (3, 1, 1), (1, 3, 1)]))
    theorem = theorem_for(structure)
    V = theorem.lyapunov(structure)
    bad = replace(V, blocks=(replace(V.blocks[0], diagonal=(Fraction(1), Fraction(10**6), Fraction(1, 10**6))),))
    proof = theorem.prove(structure, bad)
    assert proof.rate is None
    assert "not proved" in str(proof.failed)
