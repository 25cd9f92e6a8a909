"""Facts about trajectories: X(t) = exp(-L s(t)) X(0), whatever the graph, the start, and how they are written."""

import csv
import gc
import io
import os
import signal
from fractions import Fraction
from itertools import product
from pathlib import Path

import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import expm_multiply
from selection import thinned

import ptcc_certify
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.simulation.run import simulate

EXAMPLE_1 = NominalProtocol("0.6", "0.1", "0.3", 1)
EXAMPLE_3 = NominalProtocol("0.2", "0.1", "0.3", 1)
X0 = [5, 2, -4, 3, -2, 1]
EXAMPLES = ["fig1a", "fig1b", "fig3a", "fig3b", "fig5a", "fig5b"]


def example(name, scale=1):
    lines = (Path(ptcc_certify.__file__).parent / "examples" / f"{name}.csv").read_text().splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return SignedDigraph.from_edges([(r["source"], r["target"], int(r["weight"]) * scale) for r in rows])


def random_graph(rng, n, decades=0, links=3):
    W = np.zeros((n, n))
    for k in range(n):
        heard = rng.choice([j for j in range(n) if j != k], min(links, n - 1), replace=False)
        size = 10 ** rng.uniform(-decades / 2, decades / 2, heard.size) if decades else rng.integers(1, 9, heard.size)
        W[k, heard] = rng.choice([-1, 1], heard.size) * size
    return SignedDigraph.from_matrix(W, orientation="listens")


def exact(graph, clock, start):
    """exp(-L s) X(0) in 600-bit ball arithmetic, L exact."""
    flint.ctx.prec, before = 600, flint.ctx.prec
    try:
        rows = graph.exact_laplacian()
        L = flint.arb_mat(flint.fmpq_mat([[flint.fmpq(v.numerator, v.denominator) for v in row] for row in rows]))
        start = flint.arb_mat([[flint.arb(float(v)) for v in row] for row in np.reshape(start, (len(rows), -1))])
        reached = (L * flint.arb(-clock)).exp() * start
        return np.array([[float(v.mid()) for v in row] for row in reached.tolist()]).reshape(len(rows), -1)
    finally:
        flint.ctx.prec = before


def spread(run, other):
    return np.abs(run - other).max()


# ---------------------------------------------------------------------- the solution


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("protocol", [EXAMPLE_1, EXAMPLE_3])
def test_the_state_is_the_matrix_exponential_of_the_clock(name, protocol):
    graph = example(name)
    start = np.resize(X0, graph.n_nodes)
    run = simulate(graph, protocol, start)
    L = graph.laplacian().toarray()
    for i in range(0, run.deadline_index, 5):
        assert spread(run.states[:, i], expm(-L * run.clock[i]) @ start) < 5e-9
    assert run.remaining[run.deadline_index - 1] == pytest.approx(1e-8, rel=1e-12)
    assert run.deadline_resolved
    assert spread(run.final_state, exact(graph, 1e4, start)[:, 0]) < 1e-9


@pytest.mark.few(0)
@settings(deadline=None, max_examples=25)
@given(st.integers(2, 12), st.integers(0, 2**32), st.sampled_from([0, 6]), st.floats(0.2, 2))
def test_accuracy_on_random_graphs_with_weights_up_to_six_decades_apart(n, seed, decades, T):
    rng = np.random.default_rng(seed)
    graph, start = random_graph(rng, n, decades), rng.normal(size=n)
    run = simulate(graph, NominalProtocol(T, "0.1", "0.3", 1), start)
    for i in (*np.searchsorted(-run.remaining, [-0.5, -0.01, -1e-4]), run.deadline_index - 1):
        assert spread(run.states[:, i], exact(graph, run.clock[i], start)[:, 0]) < 3e-9 * np.abs(start).max()


@pytest.mark.few(0)
@settings(deadline=None, max_examples=25)
@given(st.integers(2, 8), st.integers(0, 2**32), st.sampled_from([0, 4]))
def test_a_deadline_called_settled_is_the_limit(n, seed, decades):
    rng = np.random.default_rng(seed)
    graph, start = random_graph(rng, n, decades, links=2), rng.uniform(-1, 1, n)
    run = simulate(graph, EXAMPLE_1, start, times=[0, "0.6"])
    if run.deadline_resolved:
        assert spread(run.final_state, exact(graph, 1e40, start)[:, 0]) < 1e-8
    else:
        assert run.deadline_residual > 1e-9


def sparse_graph(rng, n, decades, links=4):
    """A tenth of the agents listen to nobody, the others to random ones."""
    target = np.repeat(np.arange(n // 10, n), links)
    source = (target + rng.integers(1, n, target.size)) % n
    size = 10 ** rng.uniform(-decades / 2, decades / 2, target.size) * rng.choice([-1, 1], target.size)
    W = sparse.coo_array((size, (target, source)), shape=(n, n)).tocsr()
    return SignedDigraph.from_matrix(W, orientation="listens")


@pytest.mark.few(0)
@pytest.mark.parametrize(("n", "decades"), [(500, 0), (500, 3), (10_000, 0)])
def test_a_large_graph_is_solved_by_gmres_as_accurately(n, decades):
    rng = np.random.default_rng(n)
    graph, start = sparse_graph(rng, n, decades), rng.uniform(-1, 1, n)
    run = simulate(graph, EXAMPLE_1, start, times=["0.3", "0.59", Fraction(599999, 10**6)])
    L, clock, state = graph.laplacian().tocsc(), 0.0, start
    for i in range(3):
        state, clock = expm_multiply(-L * (run.clock[i] - clock), state), run.clock[i]
        assert spread(run.states[:, i], state) < 1e-8


def test_a_large_stiff_graph_settles_in_few_steps():
    """With CasADi's 10 Krylov vectors it took 6,640 steps."""
    rng = np.random.default_rng(1)
    run = simulate(sparse_graph(rng, 300, 5), NominalProtocol(1, 1, 1, 2), rng.uniform(-1, 1, 300))
    assert run.deadline_residual < 1e-10
    assert run.stats["steps"] < 3000


def test_columns_of_a_large_graph_evolve_apart():
    rng = np.random.default_rng(2)
    graph, start = sparse_graph(rng, 300, 1), rng.normal(size=(300, 2))
    run = simulate(graph, EXAMPLE_1, start, times=["0.3", "0.6"])
    for column in range(2):
        alone = simulate(graph, EXAMPLE_1, start[:, column], times=["0.3", "0.6"])
        assert spread(run.states[:, column], alone.states) < 5e-9


@pytest.fixture
def alarm_interrupts():
    """Let an alarm act like Ctrl-C."""
    callbacks = gc.callbacks[:]
    gc.callbacks.clear()  # Python loses what is raised in one, and hypothesis has one
    gc.disable()  # and what is raised in a callback of a weak reference, as other tests leave some behind
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    yield
    signal.signal(signal.SIGALRM, before)
    gc.enable()
    gc.callbacks.extend(callbacks)


@pytest.mark.few(1)
@pytest.mark.skipif(os.name == "nt", reason="no alarms")
@pytest.mark.usefixtures("alarm_interrupts")
@pytest.mark.parametrize(
    ("n", "decades", "instants"), thinned([(50, 6, 8), (50, 6, 25), (5000, 2, 4), (5000, 2, 10)], 2)
)
def test_an_interrupt_is_no_failure_of_the_integrator_and_is_never_lost(n, decades, instants):
    rng = np.random.default_rng(3)
    graph, start = sparse_graph(rng, n, decades), rng.uniform(-1, 1, n)
    handler = signal.getsignal(signal.SIGINT)
    simulate(graph, EXAMPLE_1, start)
    for seconds in np.linspace(0.005, 0.1 if n == 50 else 0.4, instants):
        signal.setitimer(signal.ITIMER_REAL, seconds)
        with pytest.raises(KeyboardInterrupt):
            for _ in range(100):  # a lost interrupt would be noticed by its absence
                simulate(graph, EXAMPLE_1, start)
        assert signal.getsignal(signal.SIGINT) is handler


def test_the_deadline_is_reached_continuously_and_what_has_settled_stays():
    graph = example("fig1b")
    run = simulate(graph, EXAMPLE_1, X0, remaining=1e-15)
    last = run.states[:, run.deadline_index - 1 : run.deadline_index + 1]
    gap = np.abs(last[:, 0] - exact(graph, 1e4, X0)[:, 0]).max()
    assert spread(last[:, 0], last[:, 1]) == pytest.approx(gap, abs=1e-9)
    assert spread(run.states[:, run.deadline_index :], run.final_state[:, None]) < 1e-9
    assert run.t[-1] == pytest.approx(0.75)


def test_balanced_camps_meet_at_opposite_values_and_unbalanced_ones_at_zero():
    agreed = simulate(example("fig1b"), EXAMPLE_1, X0).final_state
    assert np.ptp(np.abs(agreed)) < 1e-9
    assert np.abs(agreed).min() > 1
    assert np.abs(simulate(example("fig1a"), EXAMPLE_1, X0).final_state).max() < 1e-9


def test_a_deadline_that_cannot_be_resolved_is_said_to_be_so():
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", Fraction(1, 10**16)), ("c", "b", 10**4)])
    run = simulate(graph, EXAMPLE_1, [1, 0, 0])
    assert not run.deadline_resolved
    assert run.deadline_residual > 1e-6
    assert "NOT settled" in repr(run)


def test_weights_as_small_as_floats_go_settle_on_the_clock():
    graph = SignedDigraph.from_edges([("a", "b", "1e-300"), ("b", "a", "3e-300")])
    run = simulate(graph, EXAMPLE_1, [1, 5])
    assert run.deadline_resolved and spread(run.final_state, [4, 4]) < 1e-9


def test_the_asymptotic_baseline_runs_on_the_plain_clock_without_a_deadline():
    graph = example("fig1b")
    run = simulate(graph, NominalProtocol("0.6", "0.1", 0, 1), X0)
    for i in range(0, run.t.size, 20):
        assert spread(run.states[:, i], expm(-graph.laplacian().toarray() * 0.1 * run.t[i]) @ X0) < 1e-8
    np.testing.assert_allclose(run.clock, 0.1 * run.t)
    assert run.deadline_index is None
    assert run.deadline_residual is None
    with pytest.raises(ParameterError, match="no deadline"):
        _ = run.final_state
    assert "no deadline" in repr(run)


# ---------------------------------------------------------------------- invariances


def test_relabelling_permutes_the_trajectory():
    rng = np.random.default_rng(4)
    graph, start, order = random_graph(rng, 9), rng.normal(size=9), rng.permutation(9)
    W = graph.adjacency().toarray()
    run = simulate(graph, EXAMPLE_1, start)
    permuted = simulate(
        SignedDigraph.from_matrix(W[np.ix_(order, order)], orientation="listens"), EXAMPLE_1, start[order]
    )
    assert spread(permuted.states, run.states[order]) < 1e-8


@pytest.mark.parametrize("factor", [1e6, 1e-6, -1.0, 1e-300, 1e299])
def test_scaling_the_start_scales_the_trajectory(factor):
    graph = example("fig3a")
    run, scaled = simulate(graph, EXAMPLE_1, X0), simulate(graph, EXAMPLE_1, np.multiply(X0, factor))
    assert spread(scaled.states / factor, run.states) < 1e-11


def test_scaling_the_weights_is_scaling_the_gain():
    run = simulate(example("fig5b", scale=7), EXAMPLE_3, np.arange(16))
    scaled = simulate(example("fig5b"), NominalProtocol("0.2", "0.7", "2.1", 1), np.arange(16))
    assert spread(run.states, scaled.states) < 1e-7


@pytest.mark.parametrize("name", ["fig1b", "fig5b"])
def test_columns_evolve_apart_and_as_the_kronecker_product(name):
    graph, rng = example(name), np.random.default_rng(5)
    n, d = graph.n_nodes, 3
    start = rng.normal(size=(n, d)) * [1, 1e6, 1e-3]
    run = simulate(graph, EXAMPLE_1, start)
    assert run.states.shape == (n, d, run.t.size)
    size = np.abs(start).max(axis=0)
    for column in range(d):
        alone = simulate(graph, EXAMPLE_1, start[:, column])
        assert spread(run.states[:, column], alone.states) < 5e-9 * size[column]
    kronecker = np.kron(graph.laplacian().toarray(), np.eye(d))
    i = run.deadline_index - 1
    whole = (expm(-kronecker * run.clock[i]) @ start.ravel()).reshape(n, d)
    assert np.abs((run.states[:, :, i] - whole) / size).max() < 5e-9


# ---------------------------------------------------------------------- instants and what is read off


def test_instants_are_met_exactly_and_those_too_near_the_deadline_count_as_it():
    graph = example("fig1a")
    near, same = np.nextafter(0.6, 0), Fraction(3, 5) - Fraction(1, 10**30)
    later = Fraction(3, 5) + Fraction(1, 10**12)
    times = [0, 1e-300, 1e-17, 0.1, np.nextafter(0.1, 1), Fraction(1, 2), near, same, later, 2]
    run = simulate(graph, EXAMPLE_1, X0, times=times)
    assert run.deadline_index == 7
    assert run.t[7] == 0.6
    assert run.remaining[6] == pytest.approx(float(1 - Fraction(near) / Fraction(3, 5)), rel=1e-12)
    np.testing.assert_array_equal(run.remaining[7:], 0)
    np.testing.assert_array_equal(run.states[:, 0], X0)
    np.testing.assert_array_equal(run.clock[7:], np.inf)
    for i in range(7):
        assert spread(run.states[:, i], exact(graph, run.clock[i], X0)[:, 0]) < 1e-8


def test_a_run_may_end_before_the_deadline_or_start_after_it():
    graph = example("fig1b")
    early = simulate(graph, EXAMPLE_1, X0, times=["0.1", "0.2"])
    assert early.deadline_residual is None
    assert not early.deadline_resolved
    with pytest.raises(ParameterError, match="T is not among"):
        _ = early.final_state
    late = simulate(graph, EXAMPLE_1, X0, times=[1, 2])
    assert late.deadline_index is None
    assert late.deadline_resolved
    assert spread(late.states[:, 0], simulate(graph, EXAMPLE_1, X0).final_state) < 1e-9


def test_the_default_instants_hold_the_marks_of_a_certificate():
    run = simulate(example("fig1a"), EXAMPLE_1, X0, samples=11)
    L = example("fig1a").laplacian().toarray()
    for fraction in (0, 0.5, 0.9, 0.99):
        expected = expm(-L * EXAMPLE_1.gain.clock_at_remaining(1 - fraction)) @ X0
        assert spread(run.at(fraction), expected) < 1e-8
    np.testing.assert_array_equal(run.at(1), run.final_state)
    np.testing.assert_array_equal(run.at(1.25), run.states[:, -1])
    with pytest.raises(ParameterError, match=r"0\.123"):
        run.at(0.123)
    assert (np.diff(run.t) >= 0).all()
    assert (np.diff(run.remaining) <= 0).all()


def test_error_and_input_are_those_of_the_protocol():
    graph = example("fig5a")
    run = simulate(graph, EXAMPLE_3, np.arange(16), times=[0, "0.1", "0.2", "0.3"])
    np.testing.assert_allclose(run.error, -graph.laplacian().toarray() @ run.states, atol=1e-12)
    np.testing.assert_allclose(run.input, run.error * [0.1 + 0.3 / 0.2, 0.1 + 0.3 / 0.1, 0.1, 0.1], atol=1e-12)


def test_the_table_reads_back_with_every_label_and_digit():
    graph = SignedDigraph.from_edges([("a, b", 'say "c"', -1), ('say "c"', "a, b", 2)])
    run = simulate(graph, EXAMPLE_1, [1, 2], samples=5)
    header, *rows = csv.reader(io.StringIO(run.to_csv()))
    assert header == ["t", "remaining", "a, b", 'say "c"', "u(a, b)", 'u(say "c")']
    np.testing.assert_array_equal(np.array(rows, dtype=float).T, [run.t, run.remaining, *run.states, *run.input])
    wide = simulate(graph, EXAMPLE_1, [[1, 2], [3, 4]], times=[0])
    header, first = csv.reader(io.StringIO(wide.to_csv()))
    assert first[:6] == ["0.0", "1.0", "1.0", "2.0", "3.0", "4.0"]
    assert header[6:] == [f"u({name})" for name in header[2:6]]
    assert list(map(float, first[6:])) == wide.input[..., 0].ravel().tolist()


def test_a_trajectory_cannot_be_changed():
    run = simulate(example("fig1a"), EXAMPLE_1, X0, samples=3)
    with pytest.raises(ValueError, match="read-only"):
        run.states[0, 0] = 1
    with pytest.raises(AttributeError):
        run.rtol = 1


def test_a_graph_without_edges_and_a_start_at_rest_stay():
    lone = SignedDigraph.from_edges([], ["a"])
    np.testing.assert_array_equal(simulate(lone, EXAMPLE_1, [7]).states, 7)
    run = simulate(example("fig1b"), EXAMPLE_1, np.zeros(6))
    np.testing.assert_array_equal(run.states, 0)
    assert run.deadline_residual == 0


# ---------------------------------------------------------------------- refusals and failures


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ([1, 2, 3], "3 values for 6"),
        (5, "x0 is 5; give one number"),
        (np.zeros((6, 0)), "empty rows"),
        (np.zeros((6, 1, 1)), "not a number"),
        ([1, 2, 3, 4, 5, float("nan")], "agent 6 is nan"),
        ([1, 2, 3, float("inf"), 5, 6], "agent 4 is inf"),
        ([1, 2, 3, 4, 5, 6j], "not a number"),
        (["a"] * 6, "not a number"),
        ([True] * 6, "not a number"),
        ([1, 2, 3, 4, 5, None], "x0"),
        ([1, 2, 3, 4, 5, 10**400], "x0"),
        ([[1], [2, 3], [4], [5], [6], [7]], "different lengths"),
    ],
)
def test_a_start_that_is_none_is_refused(start, words):
    with pytest.raises(ParameterError, match=words):
        simulate(example("fig1a"), EXAMPLE_1, start)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"times": []}, "empty"),
        ({"times": [-1, 2]}, ">= 0"),
        ({"times": [0, 2, 1]}, "not increasing"),
        ({"times": [0, "x"]}, "times"),
        ({"times": [0, float("inf")]}, "times"),
        ({"times": 3}, "times"),
        ({"rtol": 0}, "rtol"),
        ({"atol": float("nan")}, "atol"),
        ({"remaining": 0}, "remaining"),
        ({"samples": 1}, "samples"),
        ({"past": -1}, "past"),
    ],
)
def test_options_outside_their_domain_are_named(options, words):
    with pytest.raises(ParameterError, match=words):
        simulate(example("fig1a"), EXAMPLE_1, X0, **options)


def test_numbers_of_numpy_are_options():
    graph, start = example("fig1b"), np.arange(6)
    options = {"remaining": np.float32(0.5), "past": np.int64(1), "rtol": np.float32(1e-6), "atol": Fraction(1, 10**6)}
    run = simulate(graph, EXAMPLE_1, start, samples=np.int64(3), **options)
    assert run.t[-1] == 1.2 and (run.at(np.int64(1)) == run.final_state).all()
    for none in (True, "1", float("inf"), 10**400, np.ones(1), None):
        with pytest.raises(ParameterError, match="fraction"):
            run.at(none)


def test_fractions_are_a_start():
    start = [Fraction(v, 3) for v in X0]
    run = simulate(example("fig1a"), EXAMPLE_1, start, samples=3)
    np.testing.assert_allclose(run.states[:, 0], np.array(X0) / 3)


@pytest.mark.parametrize(
    ("name", "exponent"),
    thinned(product(["fig1a", "fig1b", "fig3a", "fig5b"], [-300, -150, -20, 6, 12, 20, 50, 150, 300])),
)
def test_weights_of_any_size_end_in_a_result_or_a_named_failure(name, exponent, capfd):
    graph = example(name, scale=Fraction(10) ** exponent)
    start = np.resize(X0, graph.n_nodes)
    limit = exact(example(name), 1e4, start)[:, 0]
    try:
        run = simulate(graph, EXAMPLE_1, start)
    except SimulationError as error:
        assert exponent > 6
        assert "too large" in str(error)
    else:
        assert np.isfinite(run.states).all()
        if run.deadline_resolved:
            assert spread(run.final_state, limit) < 1e-8
        else:
            assert exponent < -150
    assert capfd.readouterr() == ("", "")
