"""Facts about runs of families: products of matrix exponentials, whatever the signal, and what signals may choose."""

from fractions import Fraction
from io import StringIO

import numpy as np
import pytest
from common_kernel_families import KINDS, random_family
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.errors import FormatError, ParameterError, SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import (
    ConstantSignal,
    PeriodicSignal,
    RandomSignal,
    TableSignal,
    WorstCaseSignal,
)

PROTOCOL = NominalProtocol(T=2, rho1="1/2", rho2=1, kappa=3)
DAY = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
NIGHT = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
PAIR = Family.switching({"day": DAY, "night": NIGHT})


def families():
    """One of every kind, with uncertain and optional weights, tied ones, an outage, two signs on a pair, one node."""
    rng = np.random.default_rng(5)
    for n, kind in enumerate(KINDS, 3):
        yield random_family(rng, kind, n, modes=2, share=Fraction(1, 4), optional=0.5)
    yield Family.switching([DAY, SignedDigraph.from_edges([], nodes="abc")])
    yield Family.from_intervals([("a", "b", -1, 2), ("b", "a", 1, 1), ("b", "c", "1e-3", "1e3")])
    yield Family.from_intervals([], nodes="a")


def signals(family):
    names = [mode.name for mode in family.modes]
    return [
        ConstantSignal(names[-1] or 0, 1.0),
        PeriodicSignal([(k, 0.3 + 0.2 * k, 0.25) for k in range(len(names))]),
        RandomSignal(1),
        RandomSignal(2, dwell=1.7, weights="ends"),
        WorstCaseSignal(step=0.4),
        TableSignal([(0, 0), (0.5, len(names) - 1, 0.0), (1.9, 0, 1.0)]),
    ]


@pytest.mark.few(0)
@pytest.mark.parametrize("family", thinned(families(), 2), ids=lambda family: f"{family.n_nodes} nodes")
def test_a_run_is_a_product_of_exponentials_of_its_members(family):
    members, x0 = Members(family), np.random.default_rng(0).normal(size=family.n_nodes)
    for signal in signals(family):
        run = simulate(family, PROTOCOL, x0, signal, samples=7)
        x, last = x0, float(run.clock[np.isfinite(run.clock)][-1])
        ends = np.append(run.played.switches[1:], np.inf)
        product, at = [], 0.0
        for s in run.clock[np.isfinite(run.clock)].tolist():
            for choice, begin, end in zip(run.played.choices, run.played.switches.tolist(), ends.tolist(), strict=True):
                span = min(end, s) - max(begin, at)
                if span > 0:
                    x = expm(-members.laplacian(choice).toarray() * span) @ x
            product.append(x)
            at = s
        assert last > 40
        assert np.abs(np.transpose(product) - run.states[:, : len(product)]).max() < 1e-8, signal


def test_a_family_of_one_graph_runs_like_the_graph():
    one, x0 = Family.from_graph(DAY), [3, -1, 2]
    run, known = simulate(one, PROTOCOL, x0, ConstantSignal()), simulate(DAY, PROTOCOL, x0)
    assert simulate(DAY, PROTOCOL, x0) == simulate(one, PROTOCOL, x0)
    assert np.abs(run.states - known.states).max() < 1e-8
    assert run.deadline_resolved
    shown = run.remaining > 1e-4
    assert np.abs(run.input - known.input)[:, shown].max() < 1e-3


def test_weights_lie_in_their_intervals_and_tied_ones_are_equal_and_pairs_of_signs_are_never_both_on():
    rows = [("a", "b", -1, 2), ("b", "c", 1, 3), ("a", "c", -2, 5)]
    for tied in (False, True):
        family = Family.from_intervals(rows, undirected=tied)
        members, mode = Members(family), family.modes[0]
        run = simulate(family, PROTOCOL, [1, -2, 4], RandomSignal(4), times=[0, "9/5"])
        assert len({choice.levels for choice in run.played.choices}) > 20
        for choice in run.played.choices:
            sizes = members.arrays[0].sizes(choice.levels)
            assert (sizes >= mode.lower.as_float()).all()
            assert (sizes <= mode.upper.as_float()).all()
            L = members.laplacian(choice).toarray()
            assert np.allclose(np.abs(L).sum(1) - 2 * np.diag(L) + 0, 0)  # what is on has one sign for each pair
            assert not tied or np.array_equal(L, L.T)


def test_the_worst_case_member_makes_a_function_fall_least_of_all_vertices():
    rng = np.random.default_rng(3)
    for kind in KINDS:
        family = random_family(rng, kind, 4, modes=2, share=Fraction(1, 3), optional=0.5)
        members = Members(family)
        for _ in range(5):
            x, gradient = rng.normal(size=(2, 4))
            worst = gradient @ (members.laplacian(members.worst(x, gradient)) @ x)
            for mode, own in enumerate(members.arrays):
                for _ in range(40):
                    levels = rng.integers(2, size=own.q).astype(float)
                    member = members.laplacian(members.choice(mode, levels))
                    assert worst <= gradient @ (member @ x) + 1e-12


def test_of_two_edges_of_opposite_signs_the_worst_case_takes_the_worse():
    family = Family.from_intervals([("a", "b", -1, 2)])
    negative, positive = (int(np.flatnonzero(family.modes[0].sign == sign)[0]) for sign in (-1, 1))
    levels = Members(family).worst(np.array([1.0, 0.2]), np.array([0.0, 1.0])).levels
    assert levels[positive] == 1
    assert levels[negative] == 0


def test_a_table_in_time_acts_at_its_instants_and_beyond_the_deadline():
    stable, free = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -1)]), SignedDigraph.from_edges([], nodes="ab")
    family = Family.switching({"free": free, "stable": stable})
    table = TableSignal.read(StringIO("t,mode\n0,free\n3,stable\n"))
    run = simulate(family, PROTOCOL, [1, 2], table, times=[0, 1, 2, 3, 5])
    A = stable.laplacian().toarray()
    assert np.array_equal(run.states[:, 3], [1, 2])
    assert np.abs(run.states[:, 4] - expm(-A * 0.5 * 2) @ [1, 2]).max() < 1e-8  # rho1 = 1/2
    run = simulate(family, PROTOCOL, [1, 2], [(0, "free"), (1, "2")], times=[0, 1, "3/2"])
    span = float(PROTOCOL.gain.clock(1.5) - PROTOCOL.gain.clock(1))
    assert np.abs(run.states[:, 2] - expm(-A * span) @ [1, 2]).max() < 1e-8


def test_the_clock_is_shared_among_the_modes():
    run = simulate(PAIR, PROTOCOL, [1, 2, 3], RandomSignal(9), samples=9)
    finite = np.isfinite(run.clock)
    assert np.abs(run.played.clock_of_modes(run.clock).sum(axis=0)[finite] - run.clock[finite]).max() < 1e-9


def test_the_table_of_a_run_tells_the_mode():
    text = simulate(PAIR, PROTOCOL, [1, 2, 3], PeriodicSignal([("night", 1), ("day", 1)]), times=[0, 1]).to_csv()
    assert text.splitlines()[0] == "t,remaining,a,b,c,mode,u(a),u(b),u(c)"
    assert float(text.splitlines()[1].split(",")[5]) == 2


def test_equal_seeds_give_equal_runs_and_others_do_not():
    runs = [simulate(PAIR, PROTOCOL, [1, 2, 3], RandomSignal(seed), times=[0, 1]).states for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


@pytest.mark.parametrize("size", [1, 10**4, 10**8])
def test_random_members_act_longer_once_all_agents_rest(size):
    """At weights of 10^4 the clock of a run holds more stretches of the agents' own time than any run may have."""
    family = Family.from_intervals([("a", "b", size, 2 * size), ("b", "c", -2 * size, -size), ("c", "a", size, size)])
    run = simulate(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2, 3], RandomSignal(1))
    assert run.deadline_resolved and len(run.played.choices) < 500
    before = np.searchsorted(run.played.switches, 5 / size)
    assert before > 3 and np.abs(run.final_state).max() < 1e-9


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: simulate(PAIR, PROTOCOL.T, [1, 2, 3]), "rotocol"),
        (lambda: simulate(PAIR, PROTOCOL, [1, 2, 3], "dusk.csv"), "one of random, worst-case"),
        (lambda: simulate(PAIR, PROTOCOL, [1, 2, 3], [(0, "dusk")]), "no mode dusk; it has day, night"),
        (lambda: simulate(PAIR, PROTOCOL, [1, 2, 3], actuator=GainLimits(gain_cap=9)), "actuator is not simulated of"),
        (lambda: simulate(DAY, PROTOCOL, [1, 2, 3], ("fresh", 1, 2), messages=LateMessages(delay="0.1")), "pattern"),
        (lambda: simulate(DAY, PROTOCOL, [1, 2, 3], sampels=9), "no parameter sampels; did you mean samples"),
        (lambda: simulate(PAIR, PROTOCOL, np.ones((3, 2))), "one initial state at a time"),
        (lambda: TableSignal([(1, "day")]), "ascend from 0, and it begins at 1"),
        (lambda: TableSignal([(0, 0), (0, 1)]), "0 follows 0"),
        (lambda: PeriodicSignal([]), "a list of"),
        (lambda: RandomSignal(dwell=0), "dwell"),
        (lambda: RandomSignal(weights="wild"), "one of both, ends, between"),
        (lambda: Members(PAIR).choice(0, [0.5]), "has 0 uncertain weights, not 1"),
        (
            lambda: (
                ConstantSignal(0, 2.0)
                .play(Members(Family.from_graph(DAY, uncertainty="10%")), PROTOCOL.gain, None)
                .__next__()
            ),
            "not from 0",
        ),
    ],
)
def test_what_no_signal_is_gets_refused(call, told):
    with pytest.raises(ParameterError, match=told):
        call()


def test_bad_tables_are_refused_by_line():
    with pytest.raises(FormatError, match="line 3"):
        TableSignal.read(StringIO("t,mode\n0,day\nnoon,night\n"))
    with pytest.raises(FormatError, match="header of a signal"):
        TableSignal.read(StringIO("0,day\n1,night\n"))


def test_a_signal_that_switches_too_often_is_refused_in_time(monkeypatch):
    monkeypatch.setattr("ptcc_certify.simulation.switching_signals.MOST_STRETCHES", 50)
    with pytest.raises(SimulationError, match="let each member act longer"):
        simulate(PAIR, PROTOCOL, [1, 2, 3], RandomSignal(dwell=1e-3))


@pytest.mark.few(0)
def test_where_no_limit_exists_a_run_does_not_claim_to_have_settled():
    plus = SignedDigraph.from_edges([("a", "c", 1)], nodes="abc")
    minus = SignedDigraph.from_edges([("b", "c", 1)], nodes="abc")
    run = simulate(Family.switching([plus, minus]), PROTOCOL, [1, -1, 0], PeriodicSignal([(0, 0.2), (1, 0.2)]))
    assert not run.deadline_resolved
    assert np.array_equal(run.final_state[:2], [1, -1])
    last = simulate(Family.switching([plus, minus]), PROTOCOL, [1, -1, 0], [(0, 0), (1, 1)])
    assert last.deadline_resolved  # the second graph stays
    assert np.abs(last.final_state - [1, -1, -1]).max() < 1e-9
