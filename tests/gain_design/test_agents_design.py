"""Facts about designed deadlines of agents of order n: held against the check, fresh certificates, runs, and LPs."""

from __future__ import annotations

import functools
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from generators import all_classes, random_graph
from scipy.optimize import linprog

from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import ParameterError
from ptcc_certify.gain_design import deadline_search
from ptcc_certify.gain_design.answer import INFEASIBLE, MET, UNPROVED, AgentsDesign
from ptcc_certify.gain_design.deadline_search import TOLERANCE, Candidate, at_deadline, design_agents, shortest_time
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, InitialState

TRIO = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 2), ("a", "c", -1), ("c", "a", -1)])
PLACES = {"a": [0, 0], "b": [1, 0], "c": [0, 1]}
X0 = {"a": [0, 3], "b": [5, 1], "c": [-2, -4]}
V0 = {"a": [1, 0], "b": [0, 0], "c": [0, "-0.5"]}
SLIDING = SlidingModeProtocol(T_r="0.5", T_s="0.5", rho1="0.001", rho2=1, kappa=1, mu1="1.5", mu2=1, mu3=1, delta=1)
#: Agents, their protocol, the limit, and what else is asked.
CASES: dict[str, tuple[Agents, Any, Fraction, dict[str, Any]]] = {
    "double": (Agents(order=2), None, Fraction(5), {"v0": V0}),
    "formation with drag under disturbances": (
        Agents(order=2, drag="0.1", offsets=PLACES),
        SLIDING,
        Fraction(8),
        {"v0": V0},
    ),
    "capped": (Agents(order=2, gain_cap=3), None, Fraction(20), {"v0": V0, "residual": "0.2"}),
    "cascade": (Agents(order=2, cascade=2), None, Fraction(8), {"v0": V0}),
    "cascade under disturbances": (Agents(order=2, cascade="1.5", offsets=PLACES), SLIDING, Fraction(9), {"v0": V0}),
    "at rest": (Agents(order=2, rest=1, offsets=PLACES), None, Fraction(8), {"v0": V0}),
    "at rest with drag under disturbances": (Agents(order=2, rest="0.5", drag="0.2"), SLIDING, Fraction(9), {"v0": V0}),
    "single in formation": (Agents(order=1, offsets=PLACES), None, Fraction(5), {}),
}


@pytest.fixture(autouse=True)
def _paper_functions(monkeypatch):
    """One Lyapunov function is enough for facts about deadlines; the command line's tests and the campaign use more."""
    monkeypatch.setattr(deadline_search, "Asks", functools.partial(Asks, method="paper"))


@functools.cache
def designed(name: str) -> AgentsDesign:
    agents, protocol, limit, more = CASES[name]
    asked = {key: value for key, value in more.items() if key != "v0"}
    return design_agents(TRIO, agents, InitialState(X0, v0=more.get("v0")), max_input=limit, protocol=protocol, **asked)


def fresh(answer: AgentsDesign, T: Fraction, x0: Any, v0: Any, graph: Any = TRIO) -> Candidate:
    """What certify itself proves at another deadline."""
    assert answer.protocol is not None
    protocol = at_deadline(answer.protocol, T)
    part = certify(
        graph, protocol, InitialState(x0, v0=v0), agents=answer.agents, asks=Asks(simulation=False, method="paper")
    ).agents
    assert part is not None
    return Candidate(T, protocol, part)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", CASES)
def test_the_checker_reads_inputs_within_the_limit(name: str):
    answer, limit = designed(name), CASES[name][2]
    assert answer.verdict == MET and answer.repeatable and answer.certificate is not None
    document = answer.certificate.to_dict()
    assert check(document).accepted
    inputs = [Fraction(text) for text in document["agents"]["input"]["agents"].values()]
    assert answer.peak == max(inputs) <= limit and answer.certificate.assessment.exit_code == 0
    if answer.asked.residual is not None:
        left = [Fraction(row[0]) for row in document["agents"]["residual"]["agents"].values()]
        assert answer.residual == max(left) <= answer.asked.residual


@pytest.mark.few(0)
@pytest.mark.parametrize("name", CASES)
def test_a_deadline_that_is_shorter_by_two_hundredths_is_not_proved_to_keep_the_limit(name: str):
    answer = designed(name)
    assert answer.deadline is not None and answer.too_short is not None
    assert answer.too_short < answer.deadline <= answer.too_short * (1 + TOLERANCE)
    assert not answer.asked.met_by(fresh(answer, answer.deadline * Fraction(98, 100), X0, CASES[name][3].get("v0")))


@pytest.mark.few(0)
@pytest.mark.parametrize("name", CASES)
def test_a_run_keeps_the_limit(name: str):
    answer = designed(name)
    assert answer.certificate is not None and answer.certificate.agents is not None and answer.peak is not None
    run = answer.certificate.agents.simulate(samples=101)
    comparison = answer.certificate.agents.compare(run)
    assert comparison is not None and comparison.input is not None and comparison.input <= 1 + 1e-9


def least_peak(deviation: np.ndarray, T: float, steps: int = 400) -> float:
    """Of one coordinate, by linear programming: the peak of the best input that is constant on each of some steps."""
    n, ends = len(deviation), np.linspace(0, T, steps + 1)
    moments = [
        ((T - ends[:-1]) ** (m + 1) - (T - ends[1:]) ** (m + 1)) / math.factorial(m + 1) for m in reversed(range(n))
    ]
    free = [sum(deviation[j] * T ** (j - i) / math.factorial(j - i) for j in range(i, n)) for i in range(n)]
    rows = np.column_stack([np.array(moments), np.zeros(n)])
    sides = np.block([[np.eye(steps), -np.ones((steps, 1))], [-np.eye(steps), -np.ones((steps, 1))]])
    best = linprog(
        np.eye(steps + 1)[-1], sides, np.zeros(2 * steps), rows, -np.array(free), [(None, None)] * (steps + 1)
    )
    assert best.status == 0
    return float(best.fun)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_no_input_within_the_limit_is_quicker_than_the_shortest_time(order: int):
    rng = np.random.default_rng(order)
    for _ in range(4):
        deviation = rng.choice([-1, 1], order) * rng.integers(1, 10, order)
        T = shortest_time([[Fraction(int(x)) for x in deviation]], Fraction(2))
        assert T > 0 and least_peak(deviation, 0.99 * float(T)) > 2


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_shortest_time_from_rest_to_rest_is_attained(order: int):
    rest = [Fraction(3), Fraction(0), Fraction(0)][:order]
    T = float(shortest_time([rest], Fraction(2)))
    assert least_peak(np.array([float(x) for x in rest]), T) == pytest.approx(2, rel=1e-3)


def test_the_shortest_time_in_space_is_that_of_the_straight_way():
    plane = shortest_time([[Fraction(3), Fraction(0)], [Fraction(4), Fraction(0)]], Fraction(1))
    line = shortest_time([[Fraction(5), Fraction(0)]], Fraction(1))
    assert plane == line


@pytest.mark.few(0)
def test_a_deadline_below_the_shortest_possible_one_is_infeasible():
    possible = designed("double").shortest_possible
    assert possible is not None and possible < designed("double").too_short
    answer = design_agents(
        TRIO, Agents(order=2), InitialState(X0, v0=V0), max_input=5, deadline=possible * Fraction(99, 100)
    )
    assert answer.verdict == INFEASIBLE and "no gains meet a deadline below" in answer.binding
    assert answer.certificate is None and answer.protocol is None


def test_a_deadline_that_is_too_short_for_the_bounds_names_the_one_that_is_not():
    found = designed("double")
    assert found.deadline is not None and found.peak is not None
    answer = design_agents(
        TRIO, Agents(order=2), InitialState(X0, v0=V0), max_input=5, deadline=found.deadline * Fraction(9, 10)
    )
    assert answer.verdict == UNPROVED and "times the limit; T = " in answer.binding
    named = Fraction(answer.binding.split("T = ")[-1].split()[0])
    assert abs(named / found.deadline - 1) < 2 * TOLERANCE
    longer = design_agents(TRIO, Agents(order=2), InitialState(X0, v0=V0), max_input=5, deadline=found.deadline * 2)
    assert longer.verdict == MET and longer.deadline == found.deadline * 2 and longer.peak < found.peak


def test_what_is_missing_whatever_the_deadline_is_named():
    answer = design_agents(TRIO, Agents(order=2), X0, max_input=3, protocol=SLIDING)
    assert answer.verdict == UNPROVED and "the limit is taken by the sliding terms 3:" in answer.binding
    alone = SignedDigraph.from_edges([], nodes=["a", "b", "c"])
    assert "no agent listens" in design_agents(alone, Agents(order=2), X0, max_input=3).binding
    unstable = design_agents(TRIO, Agents(plant=[0, -9]), InitialState(X0, v0=V0), max_input="0.001")
    assert unstable.verdict == UNPROVED and "no deadline that was tried keeps the limit" in unstable.binding


@pytest.mark.few(1)
@pytest.mark.parametrize("cascade", [None, 2])
def test_agents_in_place_need_no_input(cascade: int | None):
    agents = Agents(order=2, offsets=PLACES, cascade=cascade)
    answer = design_agents(TRIO, agents, PLACES, max_input="0.01")
    assert answer.verdict == MET and answer.peak == 0 and "no input" in answer.binding


@pytest.mark.few(0)
def test_agents_in_agreement_that_must_come_to_rest_need_an_input():
    together = {"a": [1, 1], "b": [1, 1], "c": [-1, -1]}
    answer = design_agents(TRIO, Agents(order=2, rest=2), InitialState(together, v0=together), max_input=3)
    assert answer.verdict == MET and answer.peak > 0 and answer.too_short is not None


def test_rho2_is_raised_until_agents_at_rest_have_a_bounded_input():
    answer = design_agents(TRIO, Agents(order=2, rest="0.3"), X0, max_input=30)
    assert answer.verdict == MET and Fraction(3, 10) * answer.protocol.gain.pole >= 1
    open_one = design_agents(TRIO, Agents(order=2, rest=2, drag=-3), X0, max_input=30, deadline=1)
    assert open_one.verdict == UNPROVED and "not proved bounded at T = 1: rest 2 is below 3.998" in open_one.binding


@pytest.mark.parametrize(
    ("agents", "asked", "says"),
    [
        (Agents(order=1), {}, "single integrators"),
        (2, {}, "agents = 2: give Agents"),
        (Agents(order=2, decay=3), {}, "decay: below 2 n = 4"),
        (Agents(order=2), {"residual": 1}, "residual: nothing is left"),
        (Agents(order=2, gain_cap=4), {}, "gain_cap: leaves something"),
        (Agents(order=2), {"max_input": 0}, "max_input = 0"),
        (Agents(order=2), {"x0": None}, "give x0"),
    ],
)
def test_what_is_not_searched_is_refused(agents: Any, asked: dict[str, Any], says: str):
    options = {"x0": X0, "max_input": 5} | asked
    with pytest.raises(ParameterError, match=says):
        design_agents(TRIO, agents, options.pop("x0"), **options)


def test_a_protocol_with_another_deadline_keeps_its_shares():
    there = at_deadline(SLIDING, Fraction(7))
    assert there.T == 7 and there.reaching is not None and there.reaching.T_r == Fraction(7, 2)
    assert abs(there.rho1 * 7 / SLIDING.rho1 - 1) < Fraction(1, 10**6) and there.rho2 == 1
    assert at_deadline(NominalProtocol(T=2), Fraction(2)) == NominalProtocol(T=2)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_designs_on_random_graphs_are_accepted_minimal_and_kept_by_runs(seed: int, monkeypatch):
    monkeypatch.setattr(deadline_search, "Asks", Asks)
    _, kwargs = all_classes()[seed % len(all_classes())]
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, n=6, **{k: v for k, v in kwargs.items() if k != "n"}).graph
    order = 2 + seed % 2
    agents = Agents(order=order, drag=Fraction(int(rng.integers(-2, 3)), 10) if seed % 4 else None)
    x0, later = rng.integers(-9, 10, (6, 2)).tolist(), [rng.integers(-2, 3, (6, 2)).tolist() for _ in range(order - 1)]
    answer = design_agents(graph, agents, InitialState(x0, derivatives=later), max_input=40)
    assert answer.verdict == MET and answer.certificate is not None and answer.deadline is not None
    assert answer.certificate.verdict == "certified" and answer.peak <= 40
    assert answer.too_short is not None and answer.deadline <= answer.too_short * (1 + TOLERANCE)
    assert answer.shortest_possible is None or answer.shortest_possible <= answer.deadline
    part = answer.certificate.agents
    assert part is not None and part.compare(part.simulate(samples=101)).input <= 1 + 1e-9


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 78, 13))
def test_designs_of_the_cascade_on_every_class_are_accepted_and_kept_by_runs(first: int, monkeypatch):
    monkeypatch.setattr(deadline_search, "Asks", Asks)
    for seed in range(first, min(first + 13, len(all_classes()))):
        _, kwargs = all_classes()[seed]
        rng = np.random.default_rng([35, seed])
        graph = random_graph(rng, **kwargs).graph
        if not graph.n_edges:  # no gains act
            continue
        x0, v0 = rng.integers(-9, 10, (2, graph.n_nodes)).tolist()
        agents = Agents(order=2, cascade=Fraction(int(rng.integers(1, 60)), 10))
        answer = design_agents(graph, agents, InitialState(x0, v0=v0), max_input=40)
        assert answer.verdict == MET and answer.certificate is not None and answer.peak <= 40, (seed, answer)
        assert answer.certificate.verdict == "certified" and answer.shortest_possible is None
        part = answer.certificate.agents
        assert part is not None and part.compare(part.simulate(samples=101)).input <= 1 + 1e-9


@pytest.mark.parametrize(
    ("agents", "verdict", "says"),
    [
        (Agents(order=2), "met", "every deadline is met"),
        (Agents(order=2, gain_cap=5), "met", "every deadline is met"),
        (Agents(order=2, cascade=2), "met", "% of the limit"),
        (Agents(order=2, cascade="0.3"), "not with this certificate", "give cascade 1 or more"),
    ],
)
def test_agents_that_listen_to_nobody_have_a_deadline(agents: Agents, verdict: str, says: str):
    alone = SignedDigraph.from_edges([], ["a"])
    residual = None if agents.cap is None else 1
    answer = design_agents(alone, agents, InitialState([3], v0=[1]), max_input=3, residual=residual)
    assert answer.verdict == verdict and says in answer.binding
    if answer.certificate is not None:
        assert answer.certificate.verdict == "certified" and answer.peak <= 3
    if agents.cascade is not None and verdict == "met":  # u(0) = -alpha eta(0) v(0), eta(0) = (0.001 + 1)/T
        assert abs(answer.deadline * 3 - 2 * Fraction("1.001")) < Fraction("0.01")
