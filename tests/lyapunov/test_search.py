"""Searched Lyapunov functions: what they reach, where precision ends, and that nothing wrong is said."""

from __future__ import annotations

from fractions import Fraction

import flint
import numpy as np
import pytest
from asked import certify_words
from balls import ball, clock, form_value, states
from generators import KINDS, all_classes, class_cases, random_graph
from selection import thinned

import lmi
from ptcc_certify import NominalProtocol, SignedDigraph, SlidingModeProtocol, analyse, certify
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.function import root_above
from ptcc_certify.lyapunov.search import LARGEST_OVERSHOOT, Candidate, choose, prove_function, search_functions
from ptcc_certify.model.asks import Asks, InitialState

P = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
CLOCKS = [float(P.gain.clock_at_remaining(1 - fraction)) for fraction in FRACTIONS]


@pytest.fixture(autouse=True)
def precision():
    before, flint.ctx.prec = flint.ctx.prec, 512
    yield
    flint.ctx.prec = before


def of_class(name: str, seed: int = 3, **more: object) -> SignedDigraph:
    return random_graph(np.random.default_rng(seed), **dict(dict(all_classes())[name], **more)).graph


def ring(n: int, *extra: tuple) -> SignedDigraph:
    return SignedDigraph.from_edges([(i, (i + 1) % n, 1) for i in range(n)] + list(extra))


# ---------------------------------------------------------------------- the error as a system of its own


@pytest.mark.parametrize("name", ["1.1", "1.2", "2.1 K=1", "2.1 K>=2", "2.2", "3.1 mixed", "disconnected 2.1 3.1"])
def test_the_error_system_has_the_nonzero_eigenvalues_of_the_laplacian(name: str):
    graph = of_class(name, weights="small ints")
    system = ErrorSystem(analyse(graph))
    reduced = system.matrix if system.basis is None else system.basis.T @ system.matrix @ system.basis
    L = np.sort_complex(np.linalg.eigvals(graph.laplacian().toarray()))
    nonzero = L[np.abs(L) > 1e-7]
    assert np.abs(np.sort(np.linalg.eigvals(reduced).real) - np.sort(nonzero.real)).max() < 1e-4
    if system.basis is not None:
        assert np.abs(system.basis.T @ system.basis - np.eye(system.basis.shape[1])).max() < 1e-12
        assert np.abs(system.normals.T @ system.basis).max() < 1e-12


@pytest.mark.parametrize("name", ["1.1", "2.1 K>=2", "3.1 no single", "disconnected 1.1 2.1"])
def test_the_exact_basis_lies_in_the_range_of_the_laplacian(name: str):
    """Orthogonal to every exact left null vector, and near the orthonormal basis up to scale."""
    from ptcc_certify.bounds.final_state.of_graph import influence

    graph = of_class(name)
    structure = analyse(graph)
    system, matrix = ErrorSystem(structure), influence(structure)
    K = system.exact_basis
    assert K is not None and system.basis is not None
    where = {v: i for i, v in enumerate(system.nodes)}
    for component, voice in zip(matrix.balanced, matrix.left_null_vectors, strict=True):
        if len(component.nodes) > 1:
            for column in range(len(K[0])):
                entries = zip(component.nodes, voice, strict=True)
                assert sum(Fraction(w) * K[where[v]][column] for v, w in entries) == 0
    floats = np.array([[float(x) for x in row] for row in K])
    angles = np.linalg.svd(np.linalg.qr(floats)[0].T @ system.basis, compute_uv=False)
    assert angles.min() > 1 - 1e-9


# ---------------------------------------------------------------------- what the classes reach


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "kwargs"), class_cases(KINDS[::5]))
def test_a_composite_reaches_its_slowest_block(name: str, kwargs: dict):
    """The full class at a useful prefactor, and the diagonal one against its own limit, over every row."""
    structure = analyse(random_graph(np.random.default_rng(8), **dict(kwargs, weights="decimals")).graph)
    system = ErrorSystem(structure)
    if system.nodes:
        found = search_functions(system, "best", CLOCKS)
        assert all("needs an overshoot constant above" in note for note in found.notes), (name, found.notes)
        spectral = certify(structure.graph, P, asks=Asks(simulation=False, method="paper")).spectral_rate
        useful = [float(m.rate) for m in found.functions if m.overshoot <= LARGEST_OVERSHOOT]
        assert spectral is not None and max(useful) >= 0.95 * spectral, name
        assert found.diagonal_limit is not None
        assert found.searched["lmi"] >= found.diagonal_limit * (1 - 1e-4), name
        assert found.searched["perron"] <= found.diagonal_limit * (1 + 1e-9), name
        assert max(float(m.rate) for m in found.functions) <= spectral * (1 + 1e-5), name


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("name", "at"), thinned([("1.2", "0.1"), ("2.1 K>=2", "0.7"), ("3.1 mixed", "0.95"), ("2.1 K>=2", "0.95")], 3)
)
def test_the_instant_asked_for_is_bounded_best(name: str, at: str):
    graph, q = of_class(name), float(1 - Fraction(at))
    plain = certify(graph, P, asks=Asks(simulation=False)).envelope.residual(q)
    asked = certify(graph, P, asks=Asks(simulation=False, at=at)).envelope.residual(q)
    assert asked <= plain * (1 + 1e-9)


def test_choice_prefers_the_smaller_overshoot_among_equal_rates():
    same = [Candidate("full", 1.0, 50.0), Candidate("full", 1.0 + 1e-9, 5000.0), Candidate("lmi", 0.9, 1e9)]
    chosen = choose(same, [100.0])
    assert any(c.condition == 50.0 for c in chosen) and any(c.kind == "lmi" for c in chosen)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(["1.1", "1.2", "2.2", "3.1 mixed", "disconnected mixed"], 3))
def test_the_envelope_lies_below_each_function_and_above_the_motion(name: str):
    rng = np.random.default_rng(2)
    graph = of_class(name, weights="log6")
    cert = certify(graph, P, asks=Asks(simulation=False))
    envelope, s = cert.envelope, np.linspace(0, 20, 41)
    whole = envelope.norm_factor(s)
    for function in envelope.functions:
        if function.coordinates == envelope.coordinates:
            alone = np.sqrt(function.overshoot_above) * np.exp(-function.rate_below * s / 2)
            assert (whole <= alone * (1 + 3e-12)).all()  # bounds are rounded up by 1e-12
    x0 = rng.normal(size=graph.n_nodes)
    assert (envelope.bound(s, x0) <= whole * envelope.bound(0.0, x0) * (1 + 1e-9)).all() or len(envelope.functions) > 1
    assert (np.diff(envelope.deviation(s, x0), axis=1) <= 1e-300).all() or min(m.rate for m in envelope.functions) < 0


def test_vector_norm_of_the_deviation_is_bounded():
    graph = of_class("3.1 mixed")
    x0 = [Fraction(k % 7 - 3) for k in range(graph.n_nodes)]
    cert = certify(graph, P, x0, asks=Asks(simulation=False))
    assert cert.final_state is not None
    final = [ball(Fraction(x)) for x in cert.final_state.states]
    for q in (Fraction(1, 2), Fraction(1, 10), Fraction(1, 1000)):
        X = states(graph, clock(P, q), x0)
        true = sum(((x - y) ** 2 for x, y in zip(X, final, strict=True)), flint.arb(0)) ** 0.5
        start = np.array([float(x) for x in x0])
        bound = cert.envelope.deviation_norm(float(P.gain.clock_at_remaining(float(q))), start)
        assert not true > flint.arb(float(bound))
        agents = cert.deviation_bound([float(q)])[:, 0]
        assert bound <= np.linalg.norm(agents) * (1 + 1e-9)


def test_square_roots_are_rounded_up():
    for value in (Fraction(2), Fraction(1, 3), Fraction(10) ** 700, Fraction(1, 10**700), Fraction(7, 10**320)):
        root = root_above(value)
        assert root == np.inf or Fraction(root) ** 2 >= value
        assert root == np.inf or value > Fraction(10) ** 500 or root <= float(flint.arb(root)) * (1 + 1e-12)


def test_an_indefinite_matrix_is_refused():
    """``P A + A' P > b P`` with ``b > 0`` holds for some indefinite ``P`` too: definiteness is proved by itself."""
    system = ErrorSystem(analyse(SignedDigraph.from_edges([(1, 2, 1), (1, 3, 2)])))  # E_2' = -E_2, E_3' = -2 E_3
    P_indefinite = np.diag([-1.0, 1.0])
    assert system.prove_rate([[Fraction(int(x)) for x in row] for row in P_indefinite], 3.0) is not None
    assert prove_function(system, Candidate("full", 3.0, 1.0, matrix=P_indefinite)) is None
    assert prove_function(system, Candidate("full", 1.9, 1.0, matrix=np.eye(2))) is not None


def test_a_start_that_cancels_is_taken_exactly():
    """Two agents 1 apart, at 10^16: floats see no distance at all; half of it is what each is from the outcome."""
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    for x0 in ([10**16 + 1, 10**16], ["1", "1.00000000000000000001"], ["123456763.948942", "61728381975471/500000"]):
        half = abs(Fraction(x0[0]) - Fraction(x0[1])) / 2
        for method in ("paper", "best"):
            cert = certify(graph, P, x0, asks=Asks(method=method, simulation=False))
            assert Fraction(cert.deviation_bound([1.0]).max()) >= half
            assert cert.deviation_bound([1.0]).max() <= float(half) * (1 + 1e-9)
            assert Fraction(cert.norm_bound([1.0])[0]) ** 2 >= (2 * half**2 if method == "paper" else 8 * half**2)
        robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
        slid = certify(graph, robust, InitialState(x0, sigma0=[0, 0]), asks=Asks(simulation=False))
        assert Fraction(slid.deviation_bound([1.0]).max()) >= half


@pytest.mark.parametrize(
    ("size", "method"),
    thinned([(size, method) for size in ("1e-300", "1e-162", "1e150") for method in ("best", "lmi")], 3),
)
def test_weights_of_any_size_keep_their_bounds_in_sliding_mode(size: str, method: str):
    graph = SignedDigraph.from_edges([(1, 2, size), (2, 1, size), (2, 3, f"-{size}")])
    robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    cert = certify(graph, robust, InitialState([1, 2, 3], sigma0=[1, 0, 0]), asks=Asks(method=method))
    assert cert.comparison is None or not cert.comparison.violated
    if cert.verdict == "certified" and size == "1e-300":
        assert (cert.deviation_bound([0.9, 0.4, 0.01]) > 0.1).all()  # nothing has moved yet


@pytest.mark.parametrize("far", thinned([12, 6], 2))
def test_stiff_graphs_give_no_nan(far: int):
    graph = SignedDigraph.from_edges([(1, 2, f"1e{far}"), (2, 3, f"1e-{far}"), (3, 1, -1), (1, 3, f"1e-{far}")])
    robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    for protocol, more in ((P, {}), (robust, {"sigma0": [1, 0, 0]})):
        cert = certify_words(graph, protocol, [1, 2, 3], method="lmi", **more)
        assert cert.verdict == "certified"
        assert not np.isnan(cert.deviation_bound([0.9, 0.1, 1e-9])).any()
        assert not np.isnan(cert.norm_bound([0.9, 0.1, 1e-9])).any()
        assert cert.comparison is None or not cert.comparison.violated


def test_agents_that_keep_their_state_are_where_they_end():
    graph = SignedDigraph.from_edges([], ["a", "b"])
    assert not certify(graph, P, [3, 4]).deviation_bound([1.0, 0.5]).any()
    robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    slid = certify(graph, robust, InitialState([3, 4], sigma0=[1, 0])).deviation_bound([1.0, 0.1])
    assert slid[0, 0] >= 1 and not slid[1].any() and not slid[:, 1].any()


@pytest.mark.parametrize(("name", "kwargs"), thinned(all_classes()[1:24:3], 8))
def test_the_reported_overshoot_is_not_decided_by_rounding(name: str, kwargs: dict):
    """Members whose rates differ by less than 1e-6 share the smaller one, so that the smaller prefactor is reported."""
    cert = certify(random_graph(np.random.default_rng(6), **kwargs).graph, P, asks=Asks(simulation=False))
    rates = [(m.rate, m.overshoot) for m in cert.search.functions]
    for rate, overshoot in rates:
        if cert.rate is not None and rate >= cert.rate * (1 - Fraction(1, 10**6)):
            assert cert.overshoot is not None and cert.overshoot <= overshoot, name


# ---------------------------------------------------------------------- where precision ends


def holds_in_balls(graph: SignedDigraph, seed: int) -> str:
    """Certify, then judge every member and every agent's distance in balls at late and early instants."""
    rng = np.random.default_rng(seed)
    x0 = [Fraction(int(v), 10) for v in rng.integers(-99, 100, graph.n_nodes)]
    cert = certify(graph, P, x0)
    assert cert.comparison is None or not cert.comparison.violated, cert.comparison
    if cert.verdict == "undecided":
        assert any(character.isdigit() for note in cert.notes for character in note), cert.notes
        return cert.verdict
    assert cert.final_state is not None
    final = [ball(Fraction(x)) for x in cert.final_state.states]
    instants = [Fraction(9, 10), Fraction(1, 2), Fraction(1, 100), Fraction(1, 10**8)]
    deviations = cert.deviation_bound([float(q) for q in instants])
    flint.ctx.prec = 2000
    start = [ball(x) for x in x0]
    for i, q in enumerate(instants):
        s = clock(P, q)
        X = states(graph, s, x0)
        for function in cert.search.functions:
            V0 = form_value(graph, function.nodes, function.weights or None, function.matrix, start)
            V = form_value(graph, function.nodes, function.weights or None, function.matrix, X)
            bound = (-ball(function.rate) * s).exp() * V0
            assert not bound < V, (function.kind, q)
        for k in range(graph.n_nodes):
            assert not abs(X[k] - final[k]) > flint.arb(float(deviations[k, i])), (k, q)
    return cert.verdict


@pytest.mark.parametrize("seed", thinned(range(12), 6))
def test_weights_over_twelve_decades_never_give_a_wrong_claim(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    order = [int(v) for v in rng.permutation(n)]
    pairs = {(order[i - 1], order[i]) for i in range(n)}
    pairs |= {(int(a), int(b)) for a, b in rng.integers(0, n, (n, 2)) if a != b}
    edges = [(a, b, f"{rng.choice([-1, 1]) * 10.0 ** rng.uniform(-6, 6):.3g}") for a, b in sorted(pairs)]
    holds_in_balls(SignedDigraph.from_edges(edges), seed)


@pytest.mark.parametrize("weak", thinned(["1e-9", "1e-12", "1e-6", "1e-3"]))
def test_nearly_balanced_and_nearly_disconnected_graphs(weak: str):
    """One edge of that weight breaks balance, couples two rings, or closes a cycle through both."""
    two = [(i, (i + 1) % 3, 1) for i in range(3)] + [(3 + i, 3 + (i + 1) % 3, -1) for i in range(3)]
    graphs = [
        ring(3, (2, 1, f"-{weak}")),
        ring(6, (0, 2, 1), (2, 1, f"-{weak}")),
        SignedDigraph.from_edges([*two, (0, 3, weak)]),
        SignedDigraph.from_edges([*two, (0, 3, weak), (4, 1, weak)]),
    ]
    verdicts = [holds_in_balls(graph, k) for k, graph in enumerate(graphs)]
    if weak != "1e-12":
        assert verdicts == ["certified"] * 4


def test_where_nothing_is_proved_the_verdict_says_by_which_number():
    graph = SignedDigraph.from_edges(
        [("a", "b", "1e300"), ("b", "a", "1e300"), ("b", "c", "1e-300"), ("c", "d", "-1e300"), ("d", "c", "1e-300")]
    )
    cert = certify(graph, P, [1, 2, 3, 4])
    assert cert.verdict == "undecided" and "600 decades" in cert.notes[0]


@pytest.mark.few(0)
def test_a_chain_of_followers_has_a_certificate():
    """Thirty followers in a row: one Jordan chain, for which diagonal matrices need astronomic prefactors."""
    graph = SignedDigraph.from_edges([(i, i + 1, 1) for i in range(30)])
    cert = certify(graph, P, [1] + [0] * 30)
    assert cert.verdict == "certified" and cert.optimality_ratio is not None
    assert cert.optimality_ratio > 0.3
    assert cert.comparison is not None and not cert.comparison.violated
    closed = lmi.m_matrix_certificate(ErrorSystem(cert.structure).matrix)
    assert closed.log_condition > 100 and closed.rate == pytest.approx(2, rel=1e-5)
