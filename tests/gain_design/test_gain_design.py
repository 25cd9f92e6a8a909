"""Facts about designed gains: each is held against simulations, a matrix exponential or a dense search."""

import functools
import json
import math
from fractions import Fraction

import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.bounds.final_state.of_graph import influence
from ptcc_certify.bounds.input.initial_sets import box, ellipsoid
from ptcc_certify.bounds.input.tightest_bound import usable_functions
from ptcc_certify.checker.input_formulas import InitialSet
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import GRAPHS, load_graph
from ptcc_certify.gain_design import search
from ptcc_certify.gain_design.answer import INFEASIBLE, MET, UNPROVED
from ptcc_certify.gain_design.request import input_bounds
from ptcc_certify.gain_design.search import Option, _at, design, least_peak, peak_factor
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import read_graph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.simulation.run import simulate

PAIR = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
TRIO = SignedDigraph.from_edges([(1, 2, 3), (2, 3, -1), (3, 1, 1)])
RANDOM = [f"random{seed}" for seed in range(0, 7, 2)]


@functools.cache
def graph_of(name):
    if name.startswith("random"):
        seed = int(name[6:])
        _, kwargs = all_classes()[seed * 9]
        return random_graph(np.random.default_rng(seed), n=7, **{k: v for k, v in kwargs.items() if k != "n"}).graph
    return {"pair": PAIR, "trio": TRIO}[name] if name in ("pair", "trio") else load_graph(name)


@functools.cache
def designed(name, U, R, **asked):
    return design(graph_of(name), max_input=U, initial_bound=R, **asked)


@functools.cache
def certified(graph, protocol, x0, initial_set):
    options = {"x0": x0} if initial_set is None else {"initial_set": InitialSet(*initial_set)}
    return certify_words(graph, protocol, **options, simulation=False)


@pytest.fixture(autouse=True)
def _certify_once(monkeypatch):
    """Lyapunov functions are searched once for all designs on a graph with the same starts."""

    def again(graph, protocol, x0=None, limits=(), asks=None):
        initial_set = asks.initial_set
        if initial_set is not None:
            initial_set = tuple(map(tuple, (initial_set.center, initial_set.radius, initial_set.axes)))
        first = search._first_protocol(analyse(graph))
        return certified(graph, first, x0, initial_set).changed(protocol=protocol, limits=tuple(limits))

    monkeypatch.setattr(search, "certify", again)


def influence_matrix(graph):
    Q = np.zeros((graph.n_nodes,) * 2)
    found = influence(analyse(graph))
    for v in range(graph.n_nodes):
        for j, x in found.row(v).items():
            Q[v, j] = float(x)
    return Q


def assert_holds_in_simulations(graph, found, R):
    """From the worst start and 20 random vertices."""
    rng = np.random.default_rng(3)
    center, radius = (
        np.array([float(x) for x in part]) for part in (found.asked.initial_set.center, found.asked.initial_set.radius)
    )
    vertices = center[:, None] + rng.choice([-1.0, 1.0], (graph.n_nodes, 20)) * radius[:, None]
    states = np.column_stack([found.worst.x0, vertices])
    cap = None if found.limits is None else GainLimits(gain_cap=found.limits.gain_cap)
    run = simulate(graph, found.protocol, states, actuator=cap, past=0)
    before = np.abs(run.input[..., run.t < float(found.deadline)])
    largest = np.linalg.norm(before, axis=0).max() if found.asked.input_norm == 2 else before.max()
    assert largest <= float(found.peak) * (1 + 1e-8)
    assert found.peak <= found.asked.max_input
    assert found.worst.size <= float(found.peak) * (1 + 1e-9)
    left = np.abs(run.final_state - influence_matrix(graph) @ states).max()
    assert left <= float(found.residual) + 1e-6 * float(R)


def errors_over_clock(graph, clocks):
    """``sup max_k |e_k|`` over ``||X(0)||_inf <= 1``, exact for each clock."""
    L = graph.dense_laplacian()
    return np.array([np.abs(L @ expm(-L * s)).sum(axis=1).max() for s in clocks])


def gain_at_clock(a, k, clocks):
    """``a + k e^z`` at ``a (1 - e^-z) + k z = clocks``, by bisection."""
    low, high = np.zeros_like(clocks), clocks / k
    for _ in range(80):
        z = (low + high) / 2
        below = -a * np.expm1(-z) + k * z < clocks
        low, high = np.where(below, z, low), np.where(below, high, z)
    return a + k * np.exp(np.minimum(low, 500))


# ---------------------------------------------------------------------- what is met

TASKS = [(name, 10, 1, {}) for name in (*GRAPHS, *RANDOM, "pair", "trio")]
TASKS += [(name, "7.5", "3/2", {"input_norm": 2}) for name in ("fig1a", "fig3b", "fig5a", "trio")]
TASKS += [(name, 20, 3, {"residual": "0.1"}) for name in ("fig1b", "fig3a", "fig5b", "random1")]
TASKS += [(name, 20, 3, {"residual": "2.9"}) for name in ("pair", "trio", "fig1b", "fig3a")]
TASKS += [("fig1b", 20, 3, {"residual": "2.9", "input_norm": 2}), ("pair", 1, 3, {"residual": "2"})]
TASKS += [(name, 10, 1, {"deadline": 8}) for name in (*GRAPHS, "pair", "random2")]
#: Each kind of task is among every fourth of both lists.
TIGHTENED = [task for task in TASKS if "deadline" not in task[3] and (not task[3] or "fig5" not in task[0])]


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "U", "R", "asked"), thinned(TASKS, 8), ids=str)
def test_a_design_is_certified_and_holds_in_simulations(name, U, R, asked):
    found = designed(name, U, R, **asked)
    assert found.verdict == MET, found
    assert found.certificate.verdict == "certified"
    assert found.deadline == found.protocol.T == found.asked.deadline or found.asked.deadline is None
    assert found.residual <= (found.asked.residual or 0)
    assert found.shortest_possible <= found.deadline
    assert_holds_in_simulations(graph_of(name), found, Fraction(R))
    if not asked.get("deadline"):
        assert found.peak >= found.asked.max_input * Fraction(999_999, 10**6)


@pytest.mark.parametrize("file", thinned(["highland_tribes", "sampson_t4", "regulatory_007"], 3))
def test_real_graphs(real_data, file):
    graph = read_graph(real_data / f"{file}.csv")
    found = design(graph, max_input=100, initial_bound=1)
    assert found.verdict == MET
    assert_holds_in_simulations(graph, found, 1)


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "U", "R", "asked"), thinned(TIGHTENED, 8), ids=str)
def test_what_binds_cannot_be_tightened(name, U, R, asked):
    found = designed(name, U, R, **asked)
    less = Fraction(95, 100)
    # The shortest deadline is met when it is asked for, and nothing shorter.
    again = designed(name, U, R, **asked, deadline=found.deadline)
    assert again.verdict == MET and again.protocol == found.protocol
    assert designed(name, U, R, **asked, deadline=found.deadline * less).verdict in (INFEASIBLE, UNPROVED)
    # With less input it is later, by as much.
    slower = designed(name, Fraction(U) * less, R, **asked)
    assert slower.verdict == MET
    assert float(slower.deadline * less / found.deadline) == pytest.approx(1, rel=1e-7)
    assert designed(name, Fraction(U) * less, R, **asked, deadline=found.deadline).verdict != MET


def test_a_shorter_deadline_is_worth_more_than_gains_that_certify_proves_again(monkeypatch):
    graph = graph_of("fig1a")
    first, shortest = search._first_protocol(analyse(graph)), designed("fig1a", 10, 1)
    usual = search.certify

    def weaker(graph, protocol, x0, **more):  # proves twice the deadline
        made = usual(graph, protocol, x0, **more)
        return made if protocol == first else made.changed(protocol=protocol.replace(T=2 * protocol.T))

    monkeypatch.setattr(search, "certify", weaker)
    found = design(graph, max_input=10, initial_bound=1)
    assert found.verdict == MET and found.deadline == shortest.deadline
    assert found.certificate.checked.accepted and not found.repeatable and found.certify_options is None


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["pair", "fig1b"])
def test_a_smaller_residual_takes_longer(name):
    times = [designed(name, 20, 3, residual=r).deadline for r in ("2.9", "2.755", "2.5", "0.1", "0.001")]
    assert times == sorted(times) and times[0] < times[1]
    assert times[-1] == designed(name, 20, 3).deadline  # without a cap nothing is left
    capped = designed(name, 20, 3, residual="2.9")
    assert capped.limits is not None
    tighter = designed(name, 20, 3, residual="2.755", deadline=capped.deadline)
    assert tighter.verdict != MET or tighter.limits != capped.limits


# ---------------------------------------------------------------------- what no gains can


@pytest.mark.few(2)
@pytest.mark.parametrize("name", thinned([*GRAPHS, "pair", "trio", "random0", "random4"], 3))
def test_below_the_bound_every_gain_fails(name):
    graph = graph_of(name)
    T = designed(name, 10, 1).shortest_possible * Fraction(9, 10)
    found = designed(name, 10, 1, deadline=T)
    assert found.verdict == INFEASIBLE and found.protocol is None
    assert "no gains" in found.binding and "agent" in found.binding
    L = graph.dense_laplacian()
    slowest = min(x.real for x in np.linalg.eigvals(L) if abs(x) > 1e-9)
    clocks = np.linspace(0, 60 / slowest, 600)
    errors = errors_over_clock(graph, clocks)
    rng = np.random.default_rng(0)
    for a, k in zip(np.exp(rng.uniform(-7, 3, 100)), np.exp(rng.uniform(-3, 3, 100)), strict=True):
        largest = (gain_at_clock(a / slowest, k / slowest, clocks) * errors).max() / float(T)
        assert largest > 10


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned([*GRAPHS, "trio"], 3))
def test_the_lower_bound_is_nearly_reached_and_the_certificate_not_far_off(name):
    """Gains with a small ``rho1`` and the least ``rho2 kappa`` come near the bound, by simulation."""
    graph, found = graph_of(name), designed(name, 10, 1)
    slowest = min(x.real for x in np.linalg.eigvals(graph.dense_laplacian()) if abs(x) > 1e-9)
    clocks = np.linspace(0, 15 / slowest, 300)
    product = (gain_at_clock(1e-6 / slowest, 1 / slowest, clocks) * errors_over_clock(graph, clocks)).max()
    assert float(found.lower_product) <= product * (1 + 1e-9)
    assert product <= 1.5 * float(found.lower_product)
    assert 1 <= found.ratio <= 4


def test_a_residual_lifts_the_bound_of_the_start_but_not_that_of_the_way():
    strict, loose = designed("fig3b", 10, 1), designed("fig3b", 10, 1, residual="0.5")
    assert "at t = 0" in strict.lower_by and "way" in loose.lower_by
    assert loose.lower_product == Fraction(1, 2)  # a stable agent goes from 1 to within 1/2 of 0
    assert designed("fig3b", 10, 1, residual="0.5", deadline="0.049").verdict == INFEASIBLE
    assert designed("fig3b", 10, 1, residual="0.5", deadline="0.051").verdict == UNPROVED


def test_starts_without_inner_points_give_no_bound_by_the_spectrum():
    flat = design(TRIO, max_input=10, initial_bound=box([-1, 0, 0], [1, 0, 0]))
    assert flat.verdict == MET and "way" in flat.lower_by
    assert_holds_in_simulations(TRIO, flat, 1)


# ---------------------------------------------------------------------- other starts, other cases


def test_a_point_a_box_and_an_ellipsoid():
    point = design(TRIO, max_input=10, initial_bound=InitialSet((Fraction(1), Fraction(2), Fraction(-1))))
    whole = design(TRIO, max_input=10, initial_bound=2)
    inside = design(TRIO, max_input=10, initial_bound=ellipsoid([0, 0, 0], [[2, 0, 0], [0, 2, 0], [0, 0, 2]]))
    moved = design(TRIO, max_input=10, initial_bound=box([0, 0, 0], [2, 2, 2]))
    for found in (point, whole, inside, moved):
        assert found.verdict == MET and found.shortest_possible <= found.deadline
        assert found.worst.size <= 10 * (1 + 1e-9)
    assert max(point.deadline, inside.deadline, moved.deadline) <= whole.deadline
    assert inside.lower_product <= whole.lower_product


def test_who_does_not_move_takes_any_gains():
    alone = SignedDigraph.from_edges([], nodes=["a", "b"])
    for asked in ({}, {"deadline": "0.1"}, {"residual": 1}):
        found = design(alone, max_input=1, initial_bound=1, **asked)
        assert found.verdict == MET and found.peak == 0 and found.certificate.verdict == "certified"
        assert found.summary() and repr(found)
    settled = design(PAIR, max_input=1, initial_bound=InitialSet((Fraction(2), Fraction(-2))))
    assert settled.verdict == MET and settled.peak == 0


def test_a_large_graph_is_answered():
    n = 401
    ring = SignedDigraph.from_edges([(i, (i + 1) % n, 1) for i in range(n)])
    found = design(ring, max_input=1, initial_bound=1)
    assert found.verdict == UNPROVED and "401" in found.binding


@pytest.mark.few(0)
@pytest.mark.parametrize("factor", [Fraction(1, 10**9), Fraction(10**9)])
def test_units_of_weights_and_states_do_not_matter(factor):
    scaled = SignedDigraph.from_edges([(1, 2, 3 * factor), (2, 3, -factor), (3, 1, factor)])
    plain, found = design(TRIO, max_input=10, initial_bound=1), design(scaled, max_input=10, initial_bound=1)
    assert float(found.deadline / plain.deadline) == pytest.approx(1, rel=1e-3)
    moved = design(TRIO, max_input=10 * factor, initial_bound=factor)
    assert float(moved.deadline / plain.deadline) == pytest.approx(1, rel=1e-8)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"max_input": 0}, "max_input"),
        ({"max_input": "x"}, "max_input"),
        ({"initial_bound": -1}, "bound of initial states"),
        ({"initial_bound": math.inf}, "bound of initial states"),
        ({"initial_bound": InitialSet((Fraction(1),))}, "1 values? for 3 agents"),
        ({"initial_bound": box([0], [1])}, "1 entries for 3 agents"),
        ({"deadline": "-1"}, "deadline"),
        ({"deadline": math.nan}, "deadline"),
        ({"residual": 0}, "residual"),
        ({"input_norm": 3}, "input_norm"),
        ({"max_input": "1e300", "initial_bound": "1e-300"}, "between 1e-300 and 1e300"),
    ],
    ids=str,
)
def test_bad_input_is_named_in_one_line(asked, said):
    with pytest.raises(ParameterError, match=said) as caught:
        design(TRIO, **({"max_input": 1, "initial_bound": 1} | asked))
    assert "\n" not in str(caught.value)


def test_what_is_shown_and_written():
    met, missed = designed("fig5a", 10, 1), designed("fig5a", 10, 1, deadline=1)
    assert missed.verdict == UNPROVED and "times the limit" in missed.binding
    assert missed.peak > 10 and missed.protocol is None and missed.certificate is None and missed.worst is None
    for found in (met, missed, designed("pair", 20, 3, residual="2.9")):
        assert all(len(line) <= 120 for line in found.summary().splitlines())
        assert found.verdict in repr(found)
        data = json.loads(json.dumps(found.to_dict()))
        assert data["verdict"] == found.verdict
        assert (data["protocol"] is None) == (found.protocol is None)
        if found.peak is not None:
            assert Fraction(data["peak"]) == found.peak


# ---------------------------------------------------------------------- the mathematics of the search


def test_the_peak_is_convex_in_rho1():
    rng = np.random.default_rng(1)
    for _ in range(100):
        n = rng.integers(1, 6)
        clocks, sizes = np.maximum(rng.uniform(-1, 8, n), 0), rng.uniform(0.1, 1, n)
        a, b = np.exp(rng.uniform(-5, 4, 2))
        for share in (0.2, 0.5, 0.8):
            between = peak_factor(share * a + (1 - share) * b, clocks, sizes)
            chord = share * peak_factor(a, clocks, sizes) + (1 - share) * peak_factor(b, clocks, sizes)
            assert between <= chord * (1 + 1e-12)


@pytest.mark.few(0)
def test_the_search_finds_the_least_peak_and_newton_the_crossing():
    rng = np.random.default_rng(2)
    for _ in range(20):
        clocks, sizes = rng.uniform(0, 8, 4), rng.uniform(0.1, 1, 4)
        a, peak = least_peak(clocks, sizes)
        for other in np.geomspace(1e-3, 1e2, 60):
            assert peak <= peak_factor(other, clocks, sizes) * (1 + 1e-9)
            gains = gain_at_clock(other, 1.0, clocks)
            assert peak_factor(other, clocks, sizes) == pytest.approx((sizes * gains).max(), rel=1e-9)
        assert peak == pytest.approx(peak_factor(a, clocks, sizes))


def test_for_one_agent_the_smallest_pole_is_best():
    rng = np.random.default_rng(4)
    for clock in rng.uniform(0, 6, 8):
        # In units of the smallest admissible k; with k = m the clock of the crossing is clock/m in units of k.
        best = least_peak(np.array([clock]), np.ones(1))[1]
        for m in np.geomspace(1, 5, 20):
            for a in np.geomspace(1e-3, 50, 20):
                assert best <= m * peak_factor(a / m, np.array([clock / m]), np.ones(1)) * (1 + 2e-3)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["fig1a", "fig5b", "trio"])
def test_the_bound_scales_with_one_over_the_deadline(name):
    found = designed(name, 10, 1)
    cert = found.certificate
    p = found.protocol
    option = Option(p.rho1 * p.T, p.rho2, None, found.product)
    for T in (p.T / 1024, p.T * Fraction(3, 7), p.T * 1000):
        fit = _at(cert, option, T, found.asked)
        assert float(fit.peak * T / found.product) == pytest.approx(1, abs=1e-9)
    curve = found.trade_off([1, 2, float(found.deadline)])
    np.testing.assert_allclose(curve.certified * curve.deadlines, float(found.product))
    assert curve.certified[-1] == pytest.approx(10)
    assert (curve.lower < curve.certified).all()


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["fig1a", "fig3b", "random5"])
def test_random_gains_are_not_certified_with_a_smaller_peak(name):
    found = designed(name, 10, 1)
    cert = found.certificate
    bounds = input_bounds(cert, cert.initial_set)
    functions = usable_functions(bounds)
    rng = np.random.default_rng(5)
    least = 2 / max(bounds.form(i).rate for i in functions)
    for _ in range(12):
        a, k = (least * Fraction(float(x)) for x in np.exp([rng.uniform(-3, 2), rng.uniform(0, 1.5)]))
        fit = _at(cert, Option(a, k, None, Fraction(1)), Fraction(1), found.asked)
        assert fit.peak >= found.product * Fraction(9999, 10000)
