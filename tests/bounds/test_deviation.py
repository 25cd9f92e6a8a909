"""Facts about deviations from the final state: how far an agent may be from where it ends, and what proves it."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from balls import BITS, ball, clock, states
from generators import all_classes, random_graph
from selection import thinned

from lmi.exact.definite import Arithmetic
from lmi.exact.fast import SMALL_ROWS, FastArithmetic
from ptcc_certify.bounds.deviation import from_final_state
from ptcc_certify.bounds.deviation.from_final_state import _constants
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check, digest
from ptcc_certify.checker.final_state import FinalState
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import random_states, read_graph
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.lyapunov import search as search_functions
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, GainLimits, InitialState

NOMINAL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r="0.5", T_s="0.5", rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
REMAINING = [1.0, 0.99, 0.9, 0.7, 0.5, 0.1, 1e-3]


def numbers(rng: np.random.Generator, n: int, largest: int = 1000) -> list[Fraction]:
    return [Fraction(int(v), 100) for v in rng.integers(-largest, largest + 1, n)]


def sparse(n: int, seed: int) -> SignedDigraph:
    """A tree of listeners with some feedback: slow, and far from normal."""
    rng = np.random.default_rng(seed)
    edges = {}
    for i in range(1, n):
        for j in rng.integers(0, i, 1 + int(rng.poisson(1))).tolist():
            pair = (i, j) if rng.random() < 0.2 else (j, i)
            edges[pair] = -1 if rng.random() < 0.3 else 1
    return SignedDigraph.from_edges([(a, b, w) for (a, b), w in edges.items()])


@cache
def slow() -> Certificate:
    """A graph of more nodes than the exact polynomial decides."""
    graph = sparse(SMALL_ROWS + 12, 3)
    return certify(
        graph, NOMINAL, numbers(np.random.default_rng(1), graph.n_nodes), asks=Asks(method="full", simulation=False)
    )


def largest_at_start(cert: Certificate) -> Fraction:
    """``max_k |x_k(0) - x_k(T)|``, exactly."""
    assert cert.initial_state is not None and cert.final_state is not None
    return max(abs(x - Fraction(end)) for x, end in zip(cert.initial_state, cert.final_state.states, strict=True))


# ---------------------------------------------------------------------- bounds


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "kwargs"), thinned(all_classes()[::4], 3))
def test_no_deviation_bound_exceeds_the_largest_deviation_at_the_start(name: str, kwargs: dict, tmp_path: Path):
    rng = np.random.default_rng(5)
    graph = random_graph(rng, **{"weights": "small ints", **kwargs}).graph
    cert = certify(graph, NOMINAL, numbers(rng, graph.n_nodes), asks=Asks(method="perron", simulation=False))
    bounds = cert.deviation_bound(REMAINING)
    assert (bounds <= float(largest_at_start(cert)) * (1 + 1e-14)).all()
    assert cert.initial_state is not None
    assert (bounds <= 2 * float(max(map(abs, cert.initial_state))) * (1 + 1e-14)).all()
    cert.save(tmp_path / "c.json")
    assert np.array_equal(read_certificate(tmp_path / "c.json").deviation_bound(REMAINING), bounds)


@pytest.mark.few(0)
def test_the_deviation_bound_is_above_the_exact_motion_and_at_half_time_it_says_something():
    """One chain of transients, in balls: with the largest deviation at the start the bound is at most five times it."""
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        cert = slow()
        assert cert.initial_state is not None and cert.final_state is not None
        for q in (Fraction(9, 10), Fraction(1, 2), Fraction(1, 10), Fraction(1, 100)):
            X, bound = states(cert.graph, clock(NOMINAL, q), cert.initial_state), cert.deviation_bound([float(q)])[:, 0]
            gaps = [abs(x - ball(Fraction(end))) for x, end in zip(X, cert.final_state.states, strict=True)]
            assert not any(gap > flint.arb(float(b)) for gap, b in zip(gaps, bound, strict=True))
            if q == Fraction(1, 2):
                assert bound.max() <= 5 * max(float(gap) for gap in gaps)
    finally:
        flint.ctx.prec = before


@pytest.mark.few(0)
@pytest.mark.parametrize("disturbance", thinned(["worst-case", "sin(5*k*t)"]))
def test_sliding_variables_move_no_agent_farther_than_they_are_large_together(disturbance: str):
    """``max_k |x_k(0) - x_k(T)| + sum_k |sigma_k(0)|`` is never exceeded, by any run, and the bound knows it."""
    rng = np.random.default_rng(8)
    for name, kwargs in [c for c in all_classes() if c[0] in ("1.1", "1.2", "2.1", "3.1 mixed no single")]:
        graph = random_graph(rng, **kwargs).graph
        x0, sigma0 = numbers(rng, graph.n_nodes), numbers(rng, graph.n_nodes, 200)
        cert = certify(
            graph, SLIDING, InitialState(x0, sigma0=sigma0), asks=Asks(disturbance=disturbance, method="perron")
        )
        assert cert.trajectory is not None and cert.final_state is not None and cert.comparison is not None
        most = float(largest_at_start(cert) + sum(map(abs, sigma0)))
        assert (cert.deviation_bound(REMAINING) <= most * (1 + 1e-12)).all(), name
        assert np.abs(cert.trajectory.states - np.asarray(cert.final_state)[:, None]).max() <= most * (1 + 1e-9), name
        assert not cert.comparison.violated, name


@pytest.mark.few(0)
def test_the_vector_norm_of_deviations_is_bounded_by_their_largest_entry():
    cert = slow()
    assert cert.initial_state is not None
    size = float(largest_at_start(cert)) * len(cert.initial_state) ** 0.5
    assert cert.envelope.deviation_norm(0.0, cert.initial_state) <= size * (1 + 1e-12)
    d = [float(x) - float(end) for x, end in zip(cert.initial_state, cert.final_state.states, strict=True)]  # type: ignore[union-attr]
    assert cert.envelope.deviation_norm(0.0, cert.initial_state) >= np.linalg.norm(d)


# ---------------------------------------------------------------------- a Lyapunov function for deviations


@pytest.mark.few(0)
def test_a_function_for_deviations_changes_no_rate_and_improves_their_bound(monkeypatch: pytest.MonkeyPatch):
    cert = slow()
    monkeypatch.setattr(search_functions, "_for_deviations", lambda *args: None)
    plain = certify(cert.graph, NOMINAL, cert.initial_state, asks=Asks(method="full", simulation=False))
    assert (cert.rate, cert.overshoot, cert.diagonal_rate) == (plain.rate, plain.overshoot, plain.diagonal_rate)
    more, fewer = cert.envelope.functions, plain.envelope.functions
    assert len(more) == len(fewer) + 1
    instants = [1 - f for f in FRACTIONS]
    worst = [c.deviation_bound(instants).max(axis=0) for c in (cert, plain)]
    assert (worst[0] <= worst[1]).all() and (worst[1] / worst[0]).max() > 1.5


@pytest.mark.few(0)
def test_the_packaged_graphs_keep_their_rates(monkeypatch: pytest.MonkeyPatch):
    graphs = [load_graph(name) for name in ("fig1a", "fig1b", "fig3a", "fig5b")]
    with_it = [certify(g, NOMINAL, asks=Asks(method="full", simulation=False)) for g in graphs]
    monkeypatch.setattr(search_functions, "_for_deviations", lambda *args: None)
    without = [certify(g, NOMINAL, asks=Asks(method="full", simulation=False)) for g in graphs]
    for a, b in zip(with_it, without, strict=True):
        assert (a.rate, a.overshoot) == (b.rate, b.overshoot)


@pytest.mark.few(0)
def test_real_graphs_are_bounded_within_five_times_the_motion_in_the_median(real_data: Path):
    """The largest deviation at half time from a random start: its bound over the exact one."""
    names = ("sampson_t4", "sampson_sanctions", "regulatory_007")
    from scipy.linalg import expm

    ratios = []
    for name in names:
        graph = read_graph(real_data / f"{name}.csv")
        x0 = [x for (x,) in random_states(0, graph.n_nodes)]
        cert = certify(graph, NOMINAL, x0, asks=Asks(method="full", simulation=False))
        assert cert.final_state is not None
        d = np.array([float(x - Fraction(end)) for x, end in zip(x0, cert.final_state.states, strict=True)])
        true = np.abs(expm(-float(NOMINAL.gain.clock_at_remaining(0.5)) * graph.dense_laplacian()) @ d).max()
        bound = cert.deviation_bound([0.5]).max()
        assert true <= bound <= 2 * float(max(map(abs, x0)))
        ratios.append(bound / true)
    assert np.median(ratios) <= 5


# ---------------------------------------------------------------------- constants


def signed(document: dict[str, Any]) -> dict[str, Any]:
    return {**document, "digest": digest(document)}


@pytest.mark.few(1)
@pytest.mark.parametrize(("large", "stdlib"), thinned([(False, False), (False, True), (True, True), (True, False)], 3))
def test_a_constant_lowered_by_a_millionth_is_rejected(large: bool, stdlib: bool):
    """Of the agent, and of the norm, of every member; in a small graph and, one of the two, in one beyond it."""
    graph = load_graph("fig3a")
    told = json.loads((slow() if large else certify(graph, NOMINAL, range(6), asks=Asks(simulation=False))).to_json())
    assert check(told, stdlib=stdlib).accepted
    for k, function in enumerate(told["decays"]):
        assert "deviation" in function
        farthest = max(function["deviation"]["agents"], key=lambda a: Fraction(function["deviation"]["agents"][a]))
        paths = [("norm",), ("agents", farthest)]
        for path in paths[stdlib:][:1] if large else paths:
            spoilt = copy.deepcopy(told)
            place = spoilt["decays"][k]["deviation"]
            for key in path[:-1]:
                place = place[key]
            place[path[-1]] = str(Fraction(place[path[-1]]) * (1 - Fraction(1, 10**6)))
            report = check(signed(spoilt), stdlib=stdlib)
            assert report.rejected == f"deviation of decays[{k}]", (path, report.reason)


def test_where_its_form_takes_too_long_the_norm_is_bounded_by_the_sum_over_agents(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(from_final_state, "GRAM_WORK", 0)
    told = json.loads(certify(load_graph("fig3a"), NOMINAL, range(6), asks=Asks(simulation=False)).to_json())
    monkeypatch.setattr(FinalState, "gram", None)  # no need of it
    assert check(told).accepted
    for function in told["decays"]:
        deviation = function["deviation"]
        assert Fraction(deviation["norm"]) == sum(map(Fraction, deviation["agents"].values()))


def test_a_norm_below_the_sum_over_agents_is_proved_by_its_form_or_rejected():
    told = json.loads(certify(load_graph("fig3a"), NOMINAL, range(6), asks=Asks(simulation=False)).to_json())
    least = Fraction(told["decays"][0]["deviation"]["norm"])
    most = sum(map(Fraction, told["decays"][0]["deviation"]["agents"].values()))
    assert least < most
    for norm, accepted in ((most, True), ((least + most) / 2, True), (least * Fraction(99, 100), False), (0, False)):
        said = copy.deepcopy(told)
        said["decays"][0]["deviation"]["norm"] = format_exact(Fraction(norm))
        report = check(signed(said))
        assert report.accepted == accepted and (accepted or report.rejected == "deviation of decays[0]")


@pytest.mark.parametrize("n", [3, SMALL_ROWS, SMALL_ROWS + 8])
def test_both_arithmetics_bound_the_inverse_from_above_and_sharply(n: int):
    """``d'S^-1 d`` for rows of a million sizes, and for rows and columns of ``S`` of many."""
    rng = np.random.default_rng(n)
    G = rng.integers(-9, 10, (n, n)).tolist()
    sizes = [10 ** int(k) for k in rng.integers(0, 30, n)]
    S = [
        [
            (sum(a * b for a, b in zip(x, y, strict=True)) + 9 * n * (i == j)) * sizes[i] * sizes[j]
            for j, y in enumerate(G)
        ]
        for i, x in enumerate(G)
    ]
    D = [[int(x) * 10 ** int(rng.integers(0, 7)) for x in row] for row in rng.integers(-5, 6, (4, n))] + [[0] * n]
    solved = flint.fmpz_mat(S).solve(flint.fmpz_mat(D).transpose())
    exact = (flint.fmpq_mat(flint.fmpz_mat(D)) * solved).tolist()
    for arithmetic in (Arithmetic(), FastArithmetic()):
        values = arithmetic.above(S, D)
        assert values is not None and values[-1] == 0
        for k, value in enumerate(values[:-1]):
            least = Fraction(int(exact[k][k].p), int(exact[k][k].q))
            assert least < value <= least * (1 + Fraction(1, 2**29))


@pytest.mark.parametrize("bits", [0, 900, 2700])
def test_constants_scale_with_a_form_beyond_the_range_of_floats(bits: int):
    F, D, scale = [[2, 1], [1, 3]], [[1, 0], [1, 1], [0, 0]], 2**bits
    constants = _constants([[x * scale for x in row] for row in F], D)
    assert constants is not None
    exact = [Fraction(3, 5), Fraction(3, 5), Fraction(0), Fraction(1)]  # 1 is the eigenvalue of [[3, 2], [2, 3]] / 5
    assert all(0 <= x * scale - y <= y / 10**6 for x, y in zip(constants, exact, strict=True))


def test_nothing_is_bounded_by_a_matrix_that_is_not_definite():
    n = SMALL_ROWS + 6
    S = [[int(i == j) * (1 if i else -1) for j in range(n)] for i in range(n)]
    singular = [[1] * n for _ in range(n)]
    for arithmetic in (Arithmetic(), FastArithmetic()):
        assert arithmetic.above(S, [[1] * n]) is None
        assert arithmetic.bounded(singular, [([1] * n, 10**9)]) == 0


# ---------------------------------------------------------------------- limits of the gain


@pytest.mark.few(0)
@pytest.mark.parametrize("actuator", thinned([GainLimits(gain_cap="0.01"), GainLimits(stop_before="0.999")]), ids=str)
def test_what_a_limited_gain_leaves_is_capped_by_the_start_and_the_check_knows_it(actuator: GainLimits):
    """A gain that hardly acts: every agent is as far from its final state as it was, and no farther."""
    cert = slow()
    limited = certify(
        cert.graph, NOMINAL, cert.initial_state, limits=[actuator], asks=Asks(method="full", simulation=False)
    )
    assert limited.effort is not None and limited.verdict == "certified"
    (entry,) = limited.effort.residual
    assert entry.agents is not None
    most = largest_at_start(limited)
    assert max(entry.agents) <= most * (1 + Fraction(1, 2**39))
    told = json.loads(limited.to_json())
    agents = told["input"]["residual"][0]["agents"]
    label = next(a for a, x in agents.items() if Fraction(x) >= most)
    agents[label] = str(most)
    assert check(signed(told)).accepted and check(signed(told), stdlib=True).accepted
    agents[label] = str(most * (1 - Fraction(1, 10**6)))
    assert check(signed(told)).rejected == "limited-gain of input.residual[0]"


def test_a_held_input_may_leave_more_than_the_start():
    """``X - h L X`` expands where ``h L`` is large: the cap is not claimed, and the check does not take it."""
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1), (2, 3, 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
    cert = certify(
        graph,
        protocol,
        [3, -1, 2],
        limits=[GainLimits(gain_cap=3, sample_period=Fraction(1, 200))],
        asks=Asks(simulation=False),
    )
    assert cert.effort is not None and cert.effort.residual
    told = json.loads(cert.to_json())
    agents = told["input"]["residual"][0]["agents"]
    most = largest_at_start(cert)
    assert cert.verdict == "certified"
    for label, x in agents.items():
        if Fraction(x) > most:
            agents[label] = str(most)
            assert not check(signed(told)).accepted


def test_constants_are_accepted_where_weights_of_eighteen_orders_make_floats_see_another_form():
    edges = [
        *[("0", "2", "0.00296"), ("1", "2", -960000), ("4", "2", "0.000016"), ("0", "3", -143000000)],
        *[("4", "3", "-0.0000098"), ("1", "4", "-0.0000111"), ("2", "4", "-0.0000012"), ("3", "4", "0.000002")],
        *[("3", "5", "0.98"), ("6", "5", "0.000239"), ("2", "6", -1300000), ("4", "6", -2170000)],
        ("5", "6", "-0.0000000086"),
    ]
    graph = SignedDigraph.from_edges(edges, [str(v) for v in range(7)])
    cert = certify(graph, NominalProtocol(T=1, rho1=180, rho2="3.4", kappa=1), [1] * 7, asks=Asks(simulation=False))
    assert cert.checked is not None and cert.checked.accepted, cert.checked
