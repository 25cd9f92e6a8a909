"""Certificates of agents of order n: what is proved, against exact and integrated motions; what is refused, and how."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agent_cases import agent_case
from asked import certify_words
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from ptcc_certify.certificate.assessment import MET, OPEN, REFUTED
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.checker.input_formulas import InitialSet
from ptcc_certify.errors import Change, ParameterError, spell
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, Expectations, GainLimits, InitialState
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.report.screen import summary_lines

TEAM = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("c", "a", -1), ("c", "d", 1), ("d", "c", 1)])
PAIR = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
ENEMIES = SignedDigraph.from_edges([("a", "b", -1), ("b", "c", -2), ("c", "a", -1), ("b", "a", -1)])
CAMPS = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)])
NOMINAL = NominalProtocol(T=2, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)


def made(graph: Any, protocol: Any, x0: Any, agents: Agents, **options: Any) -> Certificate:
    return certify_words(graph, protocol, x0, agents=agents, **{"method": "perron", "simulation": False, **options})


def seen(seed: int, order: int | None = None) -> tuple[Certificate, Any]:
    """The certificate of a random case, and its run against the bounds."""
    case = agent_case(seed, order)
    certificate = made(case.graph, case.protocol, case.x0, case.agents, derivatives=case.derivatives, simulation=None)
    return certificate, certificate.agents_comparison


def kernel_projection(graph: SignedDigraph) -> np.ndarray:
    """``Q`` in floats, from the singular vectors of ``L``: onto its kernel along its range."""
    L = graph.laplacian().toarray()
    left, sizes, right = np.linalg.svd(L)
    rank = int((sizes > 1e-9 * max(sizes.max(initial=0), 1e-300)).sum())
    N, M = right[rank:].T, left[:, rank:]
    return N @ np.linalg.solve(M.T @ N, M.T)


def holds(certificate: Certificate, comparison: Any) -> None:
    """Accepted, no bound exceeded, and the final state is the projection of one agent's free motion."""
    part = certificate.agents
    assert part is not None and certificate.verdict == "certified", certificate.checked
    assert comparison is None or comparison.worst <= 1 + 1e-7, comparison
    if any(part.protocol.own):
        return
    n, T = part.order, float(part.protocol.gain.T)
    A = np.eye(n, k=1)
    A[-1] = [-float(a) for a in part.protocol.plant]
    xi = np.array([[[float(x) for x in chain] for chain in agent] for agent in part.initial_state or ()])
    h = np.array([[float(x) for x in row] for row in part.protocol.offsets])
    xi[:, :, 0] -= h
    end = np.einsum("kl,ldj,ij->kdi", kernel_projection(certificate.graph), xi, expm(A * T))
    end[:, :, 0] += h
    claimed = np.array([[[float(m) for m, _ in chain] for chain in agent] for agent in part.final_state or ()])
    assert np.abs(end - claimed).max() <= 1e-7 * max(1.0, np.abs(end).max())


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(4))
def test_bounds_hold_on_random_graphs_and_agents(seed: int):
    holds(*seen(seed))


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(4, 330))
def test_bounds_hold_on_many_random_graphs_and_agents(seed: int):
    holds(*seen(seed))


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(20))
def test_bounds_hold_for_agents_of_orders_four_to_eight(seed: int):
    holds(*seen(seed, 4 + seed % 5))


@pytest.mark.few(0)
def test_a_run_obeys_the_equation_of_the_agents_in_time():
    agents = Agents(plant=[Fraction(1, 2), Fraction(-1, 5)], offsets=[[1], [0], [2], [-1]])
    part = made(TEAM, NOMINAL, [5, 2, 4, -1], agents, v0=[1, 0, 0, -2]).agents
    assert part is not None
    run = part.simulate(remaining=0.02)
    loop = part.protocol.closed_loop(TEAM)
    import casadi as ca

    slope = ca.Function("f", [loop["t"], loop["x"]], [loop["ode"]])
    begin = run.states[:, 0, :, 0].T.ravel()
    t = run.t[run.t <= 0.98 * 2]
    told = solve_ivp(lambda s, x: np.array(slope(s, x)).ravel(), (0, t[-1]), begin, "DOP853", t, rtol=1e-11, atol=1e-12)
    ours = run.states[:, 0, :, : t.size].transpose(1, 0, 2).reshape(8, -1)
    assert np.abs(told.y - ours).max() <= 1e-7


@pytest.mark.few(0)
def test_agents_meet_in_flight_and_fly_on_as_mirror_images():
    part = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2), v0=[1, 0, 0, -2]).agents
    assert part is not None and part.final_state is not None
    ends = [[m for m, _ in chain] for (chain,) in part.final_state]
    assert ends[0] == ends[1] == [-x for x in ends[2]] == [-x for x in ends[3]]
    mean = (Fraction(4) - 1 + 2 * (0 - 2)) / 2  # c and d lead; their mean at 2 + 2 v
    assert ends[2] == [mean, Fraction(-1)]


@pytest.mark.few(0)
def test_agents_meet_at_rest_where_their_own_velocity_is_damped():
    part = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, rest=1), v0=[1, 0, 0, -2]).agents
    assert part is not None and part.final_state is not None and part.input is not None
    run = part.simulate(remaining=1e-9)
    assert (np.nanmax(np.abs(run.input[:, 0]), axis=1) <= np.array([float(x) for x in part.input])).all()
    assert [chain[1] for (chain,) in part.final_state] == [(0, 0)] * 4
    claimed = [float(chain[0][0]) for (chain,) in part.final_state]
    assert np.abs(run.positions[:, 0, -2] - claimed).max() < 1e-8


def test_one_integrator_is_the_plain_certificate():
    plain, same = (
        certify_words(PAIR, NOMINAL, [3, 1], simulation=False, **more) for more in ({}, {"agents": Agents(1)})
    )
    assert same == plain and same.agents is None and "agents" not in same.document


@pytest.mark.few(0)
def test_one_integrator_under_a_gain_cap_is_the_plain_certificate_under_this_limit():
    plain = certify(TEAM, NOMINAL, [5, 2, 4, -1], limits=GainLimits(gain_cap=4), asks=Asks(simulation=False))
    same = certify(TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(1, gain_cap=4), asks=Asks(simulation=False))
    assert same == plain and same.agents is None and same.to_dict()["digest"] == plain.to_dict()["digest"]
    both = certify(
        TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(1, gain_cap=4), limits=GainLimits(9), asks=Asks(simulation=False)
    )
    assert [limit.gain_cap for limit in both.limits] == [4, 9]
    twice = certify(
        TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(1, gain_cap=9), limits=GainLimits(9), asks=Asks(simulation=False)
    )
    assert [limit.gain_cap for limit in twice.limits] == [9]
    with pytest.raises(ParameterError, match="no velocity"):
        certify(TEAM, NOMINAL, InitialState([5, 2, 4, -1], v0=[1, 0, 0, 0]), agents=Agents(1, gain_cap=4))


def test_one_integrator_under_a_gain_cap_and_disturbances_is_still_one_of_order_one():
    robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    part = certify(TEAM, robust, [5, 2, 4, -1], agents=Agents(1, gain_cap=40), asks=Asks(simulation=False)).agents
    assert part is not None and part.protocol.gain_cap == 40


#: What plain single integrators are asked beside a graph, a protocol and an initial state.
BESIDE: dict[str, tuple[Any, dict[str, Any]]] = {
    "nothing": (NOMINAL, {}),
    "a cap": (NOMINAL, {"limits": GainLimits(gain_cap="0.5")}),
    "a stop and a period": (NOMINAL, {"limits": [GainLimits(stop_before="0.1"), GainLimits(sample_period="0.001")]}),
    "noise and disturbances": (NOMINAL, {"limits": GainLimits(gain_cap=9), "noise": "0.1", "delta": "0.5"}),
    "late messages": (NOMINAL, {"messages": LateMessages(delay="0.001", gain_cap=5)}),
    "moving leaders": (NOMINAL, {"leaders": MovingLeaders(speed=1)}),
    "sliding variables": (SLIDING, {"sigma0": [1, 0, -2, 1]}),
}


@pytest.mark.few(1)  # each once
@pytest.mark.parametrize("name", BESIDE)
@pytest.mark.parametrize("graph", [TEAM, CAMPS], ids=["team", "camps"])
def test_single_integrators_in_a_formation_have_the_plain_certificate_of_their_places(
    graph: SignedDigraph, name: str, tmp_path: Path
):
    """Every part of the file but the places is that of ``x0 - h`` under the same conditions; positions are shifted."""
    protocol, beside = BESIDE[name]
    if name == "moving leaders":
        graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "d", 1), ("d", "b", "0.5")])
    x0, h = [5, 2, 4, -1], [1, -3, "2/3", 2]
    asked = {"simulation": False, "method": "paper", **beside}
    ours = certify_words(graph, protocol, x0, agents=Agents(order=1, offsets=h), **asked)
    less = [x - Fraction(y) for x, y in zip(x0, h, strict=True)]
    plain = certify_words(graph, protocol, less, **asked)
    assert ours.verdict == "certified" and ours.agents is None and ours.offsets == tuple(map(Fraction, h))
    own, other = (
        {key: part for key, part in one.to_dict().items() if key not in ("digest", "unverified", "formation")}
        for one in (ours, plain)
    )
    assert own == other and ours != plain
    assert ours.initial_positions == tuple(map(Fraction, x0))
    assert ours.final_positions is not None and plain.final_state is not None
    shifted = [x - y for x, y in zip(ours.final_positions.states, ours.offsets, strict=True)]
    assert shifted == list(plain.final_state.states)
    told = ours.to_dict()["formation"]
    assert [told["initial_state"][v] for v in graph.labels] == [str(x) for x in x0]
    assert list(map(Fraction, told["final_state"].values())) == list(ours.final_positions.states)
    ours.save(tmp_path / "places.json")
    again = read_certificate(tmp_path / "places.json")
    assert again == ours and again.offsets == ours.offsets
    assert again.final_state == ours.final_state == ours.final_positions != ours.proof.final_state
    assert ours.to_pandas()["x(T)"].to_list() == [float(x) for x in ours.final_positions.states]
    assert any("of x - offsets" in line for line in summary_lines(again, "team"))


@pytest.mark.few(0)
def test_bounds_of_a_formation_under_a_cap_hold_on_the_motion_that_agents_of_order_1_make():
    """The motion, in the plane, is that of agents in their places; the bound of the input is no weaker than theirs."""
    ours = in_places()
    in_plane = Agents(order=1, offsets=[[1, 0], [-3, 0], [2, 0], [2, 0]], gain_cap=4)
    part = certify(TEAM, NOMINAL, [[x, 0] for x in (5, 2, 4, -1)], agents=in_plane, asks=Asks(simulation=False)).agents
    assert part is not None and part.input is not None and ours.effort is not None
    (left,) = ours.effort.residual
    run = part.simulate()
    ends = np.array([float(x) for x in ours.final_positions.states])
    off = np.abs(run.states[:, 0, 0, -1] - ends)
    assert left.agents is not None and left.largest is not None
    assert all(0 <= x <= float(y) * (1 + 1e-7) for x, y in zip(off, left.agents, strict=True))
    assert left.largest <= max(part.input) * (1 + Fraction(1, 10**9))


@pytest.mark.few(0)
@pytest.mark.parametrize("name", BESIDE)
def test_runs_of_a_formation_tell_positions(name: str):
    """What is asked and the run beside the bounds begin at ``x0``, and differ from ``x - h`` by ``h`` at any time."""
    protocol, beside = BESIDE[name]
    graph = TEAM
    if name == "moving leaders":
        graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "d", 1), ("d", "b", "0.5")])
    x0, h = [5, 2, 4, -1], [1, -3, Fraction(2, 3), 2]
    ours = certify_words(graph, protocol, x0, simulation=True, agents=Agents(order=1, offsets=h), **beside)
    plain = certify_words(graph, protocol, [x - y for x, y in zip(x0, h, strict=True)], simulation=True, **beside)
    runs = [(ours.trajectory, plain.trajectory), (ours.asked_trajectory, plain.asked_trajectory)]
    assert ours.comparison is not None and not ours.comparison.violated
    for run, less in runs:
        assert (run is None) == (less is None)
        if run is not None and less is not None:
            assert run.positions[:, 0] == pytest.approx(x0, rel=1e-12)
            assert np.array_equal(run.states, less.states) and np.array_equal(run.input, less.input)
            table, other = (np.loadtxt(one.to_csv().splitlines()[1:], delimiter=",") for one in (run, less))
            shift = np.array([float(x) for x in h])
            assert table[:, 2:6] == pytest.approx(other[:, 2:6] + shift, abs=1e-12)
            if run.targets is not None:
                assert table[:, 6:10] == pytest.approx(other[:, 6:10] + shift, abs=1e-12)


@pytest.mark.few(0)
@pytest.mark.parametrize("expected", ["bipartite-containment", "consensus"])
def test_a_behaviour_under_a_cap_is_not_told_to_be_met_in_a_formation(expected: str):
    agents = Agents(order=1, offsets=[1, -3, 2, 2], gain_cap=4)
    asked = Expectations(behaviour=expected)
    found = certify(TEAM, NOMINAL, [5, 2, 4, -1], agents=agents, asks=Asks(simulation=False, expectations=asked))
    assert found.assessment.answers[0].status == OPEN


def test_agents_that_begin_in_their_common_motion_keep_it_under_a_cap_exactly():
    camps = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 2), ("b", "c", -1), ("c", "b", -1)])
    agents, asked = Agents(order=2, gain_cap=20), Asks(simulation=False, expectations="bipartite-consensus")
    x0 = ["0.3", "0.3", "-0.3"]
    made = certify(camps, NOMINAL, InitialState(x0, v0=[1, 1, -1]), agents=agents, asks=asked)
    assert made.assessment.text.startswith("met: bipartite consensus; certified")
    assert "at T positions within 0, velocities within 0 of the common motion" in " ".join(made.summary().split())
    off = certify(camps, NOMINAL, InitialState(x0, v0=[1, 1, 1]), agents=agents, asks=asked)
    assert "left open: bipartite consensus (the capped gain leaves something at T)" in off.assessment.text


def test_biases_under_a_cap_make_the_same_certificate_as_the_places_that_they_make():
    biases = [0, 0, 0, 1]
    ours = certify(
        TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(order=1, biases=[0] * 4, gain_cap=4), asks=Asks(simulation=False)
    )
    assert ours.offsets == (0, 0, 0, 0)
    with pytest.raises(ParameterError, match="biases fit no formation"):
        certify(TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(order=1, biases=biases, gain_cap=4))


def test_in_the_plane_single_integrators_under_a_cap_keep_the_proof_of_agents_of_order_n():
    agents = Agents(order=1, offsets=[[1, 0], [0, 0], [2, 1], [0, 3]], gain_cap=4)
    part = certify(TEAM, NOMINAL, [[5, 1], [2, 0], [4, 1], [-1, 2]], agents=agents, asks=Asks(simulation=False)).agents
    assert part is not None and part.residual is not None and part.dimension == 2


@pytest.mark.few(0)
def test_the_initial_set_of_a_formation_is_that_of_positions():
    """All ``|x_k(0)| <= 10`` are a box about ``-h`` of what agents steer by."""
    h = [1, -3, 2, 2]
    ours = certify(TEAM, NOMINAL, agents=Agents(order=1, offsets=h), asks=Asks(simulation=False, initial_set=10))
    box = InitialSet([Fraction(-x) for x in h], [Fraction(10)] * 4)
    plain = certify(TEAM, NOMINAL, asks=Asks(simulation=False, initial_set=box))
    assert ours.verdict == "certified" and ours.to_dict()["input"] == plain.to_dict()["input"]


@cache
def in_places() -> Certificate:
    """Of single integrators in a formation under a cap."""
    agents = Agents(order=1, offsets=[1, -3, 2, 2], gain_cap=4)
    return certify(TEAM, NOMINAL, [5, 2, 4, -1], agents=agents, asks=Asks(simulation=False))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (None, "formation is null, and not left out"),
        ({"offsets": {"a": "1"}}, "missing"),
        ({"offsets": {"a": "1", "b": "-3", "c": "2", "d": "nan"}}, ""),
        ({"offsets": {"a": "1", "b": "-3", "c": "2", "d": "3"}}, "an agent of the formation begins elsewhere"),
        ({"initial_state": {"a": "5", "b": "2", "c": "4", "d": "-2"}}, "an agent of the formation begins elsewhere"),
        ({"initial_state": None}, "initial_state is null, and not left out"),
        ({"final_state": None}, "final_state is null, and not left out"),
        (
            {"final_state": {"a": "4.5", "b": "0.5", "c": "5.5", "d": "-1.5"}},
            "an agent of the formation ends elsewhere",
        ),
    ],
)
def test_places_and_positions_that_do_not_follow_are_rejected(change: Any, reason: str):
    data = in_places().to_dict()
    assert check(data).accepted
    report = check({**data, "formation": change and {**data["formation"], **change}})
    assert not report.accepted and reason in (report.reason or "")


@pytest.mark.parametrize("key", ["initial_state", "final_state"])
def test_places_without_positions_are_rejected_where_states_are_told(key: str):
    data = in_places().to_dict()
    formation = {k: part for k, part in data["formation"].items() if k != key}
    assert check({**data, "formation": formation}).reason == "positions are told iff states are"
    assert not check({k: part for k, part in data.items() if k != "formation"}).accepted


@pytest.mark.few(0)
def test_no_agents_of_order_n_stand_beside_a_formation():
    of_order_two = certify(TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(order=2), asks=Asks(simulation=False)).to_dict()
    formation = certify(
        TEAM, NOMINAL, [5, 2, 4, -1], agents=Agents(order=1, offsets=[1, 0, 0, 0]), asks=Asks(simulation=False)
    )
    report = check({**of_order_two, "formation": formation.to_dict()["formation"]})
    assert report.reason == "a formation beside that of agents of order n"


@pytest.mark.few(0)
def test_a_formation_in_the_plane_is_bounded_by_the_function_that_needs_least_input():
    """The fastest function of this graph nearly degenerates: by it inputs were bounded by 4e7, deviations by 480."""
    graph = SignedDigraph.from_edges([("ann", "bob", 1), ("bob", "eve", -1)])
    x0, h = [[7, 3], [5, -9], [6, 8]], [[1, 2], [3, 4], [5, 6]]
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    part = certify(graph, protocol, x0, agents=Agents(order=1, offsets=h), asks=Asks(simulation=False)).agents
    assert part is not None and part.input is not None
    run = part.simulate()
    most = np.nanmax(np.sqrt((run.input**2).sum(axis=1)))
    assert most <= max(part.input) <= 10 * most


def test_in_the_plane_a_rate_too_slow_for_a_bounded_input_is_told_as_a_rate():
    graph = SignedDigraph.from_edges([("ann", "bob", 1), ("bob", "eve", -1)])
    agents = Agents(order=1, offsets=[[1, 2], [3, 4], [5, 6]])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    part = certify(
        graph, protocol, [[7, 3], [5, -9], [6, 8]], agents=agents, asks=Asks(simulation=False, method="paper")
    ).agents
    assert part is not None and part.unbounded == (
        ("rate 0.999999 is below 2/(rho2 kappa) = 1", Change("rho2", "1.001")),
    )


def test_single_integrators_run_the_equation_of_the_plain_protocol():
    import casadi as ca

    part = made(TEAM, NOMINAL, [[x, 0] for x in (5, 2, 4, -1)], Agents(order=1, offsets=[[0, 0]] * 4)).agents
    loops = [protocol.closed_loop(TEAM) for protocol in (part.protocol, NOMINAL)]
    slopes = [ca.Function("f", [loop["t"], loop["x"]], [loop["ode"]]) for loop in loops]
    for t in (0.0, 1.3, 1.999):
        one, other = (np.array(slope(t, [5, 2, 4, -1])).ravel() for slope in slopes)
        assert np.allclose(one, other, rtol=1e-12)


def test_a_decay_of_single_integrators_is_not_dropped():
    part = made(PAIR, NOMINAL, [3, 1], Agents(order=1, decay=6)).agents
    assert part is not None and part.decay == 6


STARTED = {
    "designed": (Agents(order=2), NOMINAL),
    "of order 3 with drag": (Agents(order=3, drag="0.3"), NOMINAL),
    "with forces, in places": (Agents(plant=[2, 1], offsets=[[1, 0], [0, 1], [3, 3], [2, 0]]), NOMINAL),
    "at rest": (Agents(order=2, rest=2, offsets=[[1, 0], [0, 1], [3, 3], [2, 0]]), NOMINAL),
    "cascade": (Agents(order=2, cascade=3, offsets=[[1, 0], [0, 1], [3, 3], [2, 0]]), NOMINAL),
    "capped": (Agents(order=2, gain_cap=2), NOMINAL),
    "capped from the start": (Agents(order=2, gain_cap="0.5"), NOMINAL),
    "disturbed": (Agents(order=2), SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1)),
}


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", STARTED)
def test_a_limit_below_the_input_at_time_0_is_refuted_and_one_above_it_is_not(kind: str):
    import casadi as ca

    agents, base = STARTED[kind]
    x0, more = [[5, 2], [2, 1], [4, -1], [-1, 3]], [[[1, 0], [0, 2], [0, 1], [-2, 1]]] * (agents.degree - 1)
    certificate = certify(
        TEAM, base, InitialState(x0, derivatives=more), agents=agents, asks=Asks(simulation=False, method="paper")
    )
    part, t = certificate.agents, ca.SX.sym("t")
    assert part is not None
    columns = []
    for q in range(2):
        states = [ca.SX(np.array([row[q] for row in rows], dtype=float)) for rows in (x0, *more)]
        columns.append(np.array(ca.Function("u", [t], [part.protocol.input(TEAM, states, t, q)])(0)).ravel())
    largest = np.hypot(*columns).max()
    below, above = (part.judge_input(Fraction(float(largest * x))) for x in (1 - 1e-9, 1 + 1e-9))
    assert below.status == REFUTED and "at the start, proved" in below.why and below.what.startswith("||u_k|| <=")
    assert float(below.why.split()[4]) <= largest and above.status != REFUTED
    asked = certificate.changed(expectations=Expectations(max_input=Fraction(1)))
    assert asked.assessment.exit_code == 3 and check(asked.to_dict()).accepted


ALONE = SignedDigraph.from_edges([], ["p", "q"])


@pytest.mark.parametrize(
    ("agents", "status", "exact"),
    [
        (Agents(order=2), MET, 0),
        (Agents(order=3, drag=-1), MET, 0),
        (Agents(order=2, cascade="0.5"), MET, 3),  # alpha rho2 kappa = 1, eta(0) = 2, |v(0)| = 3
        (Agents(order=2, rest=2), MET, 12),
        (Agents(order=2, rest=2, drag=1), MET, 12),
        (Agents(order=2, rest=2, drag=-2), MET, 12),
        (Agents(order=2, rest="0.6", drag=-2), OPEN, None),
        (Agents(order=2, cascade="0.4"), REFUTED, None),
        (Agents(order=2, rest="0.4"), REFUTED, None),
        (Agents(plant=[2, 1], offsets=[3, -4]), MET, 8),
    ],
)
def test_the_input_of_agents_that_listen_to_nobody_is_known(agents: Agents, status: str, exact: int | None):
    base = NominalProtocol(T=2, rho1=1, rho2=1, kappa=2)
    part = certify(ALONE, base, InitialState([5, 2], v0=[3, -2]), agents=agents, asks=Asks(simulation=False)).agents
    assert part is not None
    assert part.judge_input(Fraction(10**9 if exact is None else exact)).status == status
    assert part.inputs is None or max(part.inputs) == exact
    if exact is None:
        return
    assert not exact or part.judge_input(Fraction(exact) - Fraction(1, 10**30)).status == REFUTED
    run = part.simulate()
    assert np.nanmax(np.abs(run.input)) <= exact * (1 + 1e-6)


def test_gains_come_near_those_in_closed_form_for_a_small_constant_gain():
    for n in (2, 3, 4):
        base = NominalProtocol(T=1, rho1="1e-9", rho2=1, kappa=1)
        part = made(PAIR, base, None, Agents(order=n)).agents
        assert part is not None
        K = [float(x / part.matrix.coupling) for x in part.protocol.gains]
        exact = [comb(n, i) * np.prod([2 * n - j for j in range(i, n)]) for i in range(n)]
        assert np.allclose(K, exact, rtol=0.02)


@pytest.mark.few(0)
def test_agents_of_the_largest_order_are_certified():
    certificate = made(PAIR, NOMINAL, [3, 1], Agents(order=8))
    holds(certificate, certificate.agents_comparison)


@pytest.mark.few(0)
def test_a_file_says_what_the_certificate_says(tmp_path: Path):
    agents = Agents(order=2, drag="0.3", offsets=[[0, 1]] * 4, gain_cap=30)
    first = made(TEAM, SLIDING, [[5, 1], [2, 2], [4, 3], [-1, 4]], agents)
    first.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    assert isinstance(again, Certificate) and again == first
    one, other = first.agents, again.agents
    assert one is not None and other is not None and one.protocol == other.protocol
    assert np.array_equal(one.deviation_bound(np.array([0.5, 0.1])), other.deviation_bound(np.array([0.5, 0.1])))
    assert one.residual == other.residual and one.input == other.input
    assert summary_lines(first, "team")[4:] == summary_lines(again, "team")[4:]


@pytest.mark.few(0)
def test_every_number_that_bounds_something_cannot_be_smaller_for_nothing():
    document = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, gain_cap=30)).to_dict()
    for change in (
        lambda part: part["input"]["agents"].update(a="1"),
        lambda part: part["residual"]["agents"].update(b=["1e-9", "1e-9"]),
        lambda part: part["residual"].update(clock="1000"),
        lambda part: part.update(rate="3"),
        lambda part: part.update(coupling="1/10"),
        lambda part: part.update(gains=["1", "1"]),
        lambda part: part["final_state"].update(a=[["0", "0"]]),
    ):
        data = {**document, "agents": {**document["agents"]}}
        for key in ("input", "residual", "final_state"):
            data["agents"][key] = {**data["agents"][key]}
        data["agents"]["residual"]["agents"] = {**data["agents"]["residual"]["agents"]}
        data["agents"]["input"]["agents"] = {**data["agents"]["input"]["agents"]}
        change(data["agents"])
        assert not check(data).accepted


# ---------------------------------------------------------------------- what is told at the boundary


def told(certificate: Certificate) -> str:
    return " ".join(" ".join(summary_lines(certificate, "team")).split())


def test_just_above_the_least_decay_the_input_is_told_not_to_be_certified_bounded():
    certificate = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, decay="2.01"))
    assert certificate.verdict == "certified" and certificate.agents is not None and certificate.agents.input is None
    assert "INPUT NOT CERTIFIED BOUNDED: decay 2.01 is below 2 n = 4" in told(certificate)
    assert "decay=4 bounds it" in certificate.assessment.text


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("agents", "why", "mend"),
    [
        ({"rest": "2/5"}, "rest 0.4 is below 0.5", "rest=0.5 bounds it"),  # 1/k, k = 2
        ({"rest": 1, "drag": -2}, "rest 1 is below 1.5", "rest=1.5 bounds it"),  # 1/k + 2/eta(0), eta(0) = 2
        (
            {"rest": "2/5", "decay": 3},
            "decay 3 is below 2 n = 4, rest 0.4 is below 0.5",
            "decay=4 and rest=0.5 bound it",
        ),
    ],
)
def test_the_input_at_rest_is_bounded_iff_the_common_velocity_falls_fast_enough(agents: Any, why: str, mend: str):
    certificate = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, **agents), v0=[1, 0, 0, -2])
    assert certificate.agents is not None and certificate.agents.input is None
    assert f"INPUT NOT CERTIFIED BOUNDED: {why}" in told(certificate) and mend in certificate.assessment.text
    words = mend.replace("=", " ").split()
    mended = Agents(order=2, **{**agents, **{name: words[words.index(name) + 1] for name in agents if name in words}})
    certificate = made(TEAM, NOMINAL, [5, 2, 4, -1], mended, v0=[1, 0, 0, -2], simulation=None)
    assert certificate.agents is not None and certificate.agents.input is not None
    assert check(certificate.to_dict()).accepted and certificate.agents_comparison.worst <= 1 + 1e-7


@pytest.mark.few(0)
def test_a_bound_that_is_larger_than_the_way_of_the_agents_says_little_by_t():
    slow = Agents(order=2, decay="2.01")
    assert made(TEAM, NOMINAL, [5, 2, 4, -1], slow).assessment.useful is True
    little = made(TEAM, NOMINAL, [1, 2, -1, -1], slow, v0=[1000, -1000, 0, 0]).assessment
    advice = "decay=4 bounds it; a larger decay, such as 6, leaves less"
    assert little.useful is False and spell(little.advice) == advice
    certificate = made(TEAM, NOMINAL, [1, 2, -1, -1], Agents(order=2), v0=[10000, -10000, 0, 0])
    part, assessment = certificate.agents, certificate.assessment
    assert part is not None and part.deviation_bound(np.array([0.01]))[:, 0].max() > 0.01 * part.longest_way > 0
    assert assessment.useful is False and "a larger decay, such as 8, leaves less" in assessment.text


@pytest.mark.few(0)
def test_the_coupling_is_not_that_of_a_fast_function_with_a_huge_overshoot_constant():
    edges = [
        ("1", "2", "0.8"),
        ("2", "3", "-1.2"),
        ("3", "1", "-0.5"),
        ("3", "4", 1),
        ("4", "5", -2),
        ("5", "4", "-0.7"),
    ]
    edges += [("5", "6", "1.5"), ("6", "7", 1), ("7", "6", "-0.3")]
    graph, x0 = SignedDigraph.from_edges(edges), [3, -1, 2, 0, -4, 1, 5]
    protocol = NominalProtocol(T=3)
    bounds = {}
    for method in ("paper", "perron"):
        part = certify(graph, protocol, x0, agents=Agents(order=2), asks=Asks(method=method, simulation=False)).agents
        assert part is not None
        bounds[method] = part.deviation_bound(np.array([0.01])).max()
    assert bounds["perron"] < 10 * bounds["paper"]


@pytest.mark.few(0)
def test_velocities_that_are_the_same_everywhere_are_told_once():
    certificate = made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, drag="0.1"))
    assert "v(T) 0, of every agent (rounded)" in told(certificate)


@pytest.mark.few(0)
def test_at_twice_the_order_the_input_is_bounded():
    assert "input bounded; |u_k| <=" in told(made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2, decay=4)))


@pytest.mark.few(0)
def test_velocities_that_are_not_given_are_told_to_be_zero():
    assert "no velocities given: taken for 0" in made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(order=2)).notes


def test_one_agent_and_single_leaders_and_disconnected_graphs():
    alone = SignedDigraph.from_edges([], ["a"])
    certificate = made(alone, NOMINAL, [3], Agents(order=2), v0=[-1])
    assert certificate.agents is not None and certificate.agents.final_state == ((((1, 0), (-1, 0)),),)
    assert "no agent listens to another, each moves by itself" in told(certificate)
    led = SignedDigraph.from_edges([("a", "b", -2)])
    certificate = made(led, NOMINAL, [3, 5], Agents(order=2), v0=[-1, 4])
    assert certificate.agents is not None and certificate.agents.final_state is not None
    assert [chain[0][0] for (chain,) in certificate.agents.final_state] == [1, -1]
    apart = SignedDigraph.from_edges([("a", "b", 1), ("c", "d", -1)])
    certificate = made(apart, NOMINAL, [1, 2, 3, 4], Agents(order=3))
    assert certificate.verdict == "certified" and certificate.agents is not None
    assert [chain[0][0] for (chain,) in certificate.agents.final_state or ()] == [1, 1, 3, -3]


DECADES = SignedDigraph.from_edges([("a", "b", "1e-30"), ("b", "a", "1e30"), ("b", "c", "-1e40"), ("c", "a", 1)])


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("graph", "agents", "answer", "claim"),
    [
        (ENEMIES, {}, "stability", "stability at T = 2"),
        (ENEMIES, {"offsets": [5, 0, 0]}, "stability of x - offsets", "stability of x - offsets at T = 2"),
        (
            ENEMIES,
            {"gain_cap": 3},
            "stability (the capped gain leaves something at T)",
            "stability but for what the cap leaves at T = 2",
        ),
        (DECADES, {}, "stability (no decay is proved)", "stability of x' = u at T = 2"),
    ],
    ids=["plain", "formation", "capped", "undecided"],
)
def test_a_behaviour_is_met_only_where_it_is_proved_of_these_agents(graph: Any, agents: Any, answer: str, claim: str):
    """In a formation, under a cap, or undecided, agents do not end at 0 at T, whatever single integrators would do."""
    wish = Expectations(behaviour="stability")
    certificate = made(graph, NOMINAL, [1, 2, 3], Agents(order=2, **agents), expectations=wish)
    (judged,) = certificate.assessment.answers
    assert str(judged) == answer and (judged.status == MET) == ("(" not in answer)
    assert claim in told(certificate) and check(certificate.to_dict()).accepted


REFUSED: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    ({"order": 2, "decay": 2}, {}, "not above 2 (n - 1) = 2: velocities would not agree at T; give 4"),
    ({"order": 3, "rest": 1}, {}, "meeting at rest is proved for agents of order 2"),
    ({"plant": [1, 0], "rest": 1}, {}, "agents without a force towards 0"),
    ({"order": 2, "rest": 1, "gain_cap": 30}, {}, "an unlimited gain"),
    ({"order": 9}, {}, "order = 9 is outside its domain"),
    ({"order": 2, "plant": [1]}, {}, "plant has 1 number for agents of order 2"),
    ({"plant": [0, 1e6]}, {}, "take a shorter deadline or another unit of time"),
    ({"order": 2}, {"v0": [[1, 2]] * 4}, "v0 has 2 numbers for each agent, x0 has 1: give 4 x 1"),
    ({"order": 2}, {"v0": [1, 2]}, "2 values for 4 agents"),
    ({"order": 2}, {"derivatives": [[0] * 4, [1] * 4]}, "agents of order 2 have no acceleration to begin with"),
    ({"order": 2, "offsets": {"z": 1}}, {}, "not in the graph"),
    ({"order": 2}, {"at": 1}, "at is for single integrators"),
    ({"order": 2}, {"noise": 1}, "noise is for single integrators"),
]


@pytest.mark.parametrize(("agents", "options", "says"), REFUSED)
def test_what_is_not_proved_is_refused_with_the_reason(agents: Any, options: Any, says: str):
    with pytest.raises(ParameterError) as caught:
        made(TEAM, NOMINAL, [5, 2, 4, -1], Agents(**agents), **options)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_sliding_variables_that_begin_elsewhere_are_refused():
    with pytest.raises(ParameterError, match=r"sigma\(0\) = 0"):
        made(TEAM, SLIDING, [5, 2, 4, -1], Agents(order=2), sigma0=[1, 0, 0, 0])
    with pytest.raises(ParameterError, match="velocity to begin with"):
        certify(TEAM, NOMINAL, InitialState([5, 2, 4, -1], v0=[1, 1, 1, 1]))


@pytest.mark.few(0)
def test_a_faster_function_with_a_huge_constant_does_not_decide_the_coupling():
    follower = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("a", "c", -1), ("c", "a", -1), ("c", "d", 1)])
    agents, begin = Agents(order=2), {"x0": [5, 2, 4, -1], "v0": [1, 0, 0, -2]}
    sizes = {}
    for method in ("paper", "lmi"):  # the latter finds a rate near its supremum, where the follower counts for little
        part = certify_words(follower, NOMINAL, agents=agents, method=method, simulation=False, **begin).agents
        assert part is not None and part.input is not None
        assert len(part.used) == sum(V.proved_rate * part.matrix.coupling >= 1 for V in part.functions)
        sizes[method] = max(part.input)
    assert sizes["lmi"] <= sizes["paper"] * Fraction(1001, 1000)
    without = certify(follower, NOMINAL, agents=agents, asks=Asks(method="lmi", simulation=False)).agents
    assert without is not None and without.matrix.coupling <= Fraction(1001, 1000)
