"""Formations of families, and of vehicles that exchange virtual positions: what is proved is of states less places."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from families import KINDS, random_family

from ptcc_certify import read_certificate
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, GainLimits, InitialState
from ptcc_certify.model.constrained_switching import DwellTime, JointWindows
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.report.facts.of_certificate import facts_of
from ptcc_certify.report.plots.runs_under_signals import sample_runs
from ptcc_certify.report.plots.trajectory import plot_trajectory
from ptcc_certify.report.screen import summary_lines
from ptcc_certify.simulation.switching_signals import ConstantSignal

F = Fraction
NOMINAL = NominalProtocol(T=1, rho1=1, rho2=3, kappa=1)
SLIDING = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
TEAM = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "d", 1), ("d", "b", "-0.5")])
UNSURE = Family.from_graph(TEAM, uncertainty="10%")
#: Where followers are drawn into boxes, and agents stay, for they end elsewhere under every signal.
DRAWN = Family.from_intervals([("l", "a", 1, 3), ("m", "a", 1, 1), ("a", "b", -1, -1)])
FOES = Family.from_intervals([("a", "b", -1, 1), ("b", "a", 1, 2)])
LIMITED = Asks(time_limit=20)
PLACES = [F(1), F(-3), F(2, 3), F(2)]


def pair(
    graph: Any, protocol: Any, x0: list[Any], h: list[Fraction], order: int = 1, **more: Any
) -> tuple[Certificate, Certificate]:
    """The certificate of a formation, and that of agents without places who begin that much elsewhere."""
    virtual = {"order": 2, "exchange": "virtual"} if order == 2 else {}
    v0 = more.pop("v0", None)
    less = [F(x) - y for x, y in zip(x0, h, strict=True)]
    plain = Agents(**virtual) if virtual else None
    return (
        certify(graph, protocol, InitialState(x0, v0=v0), agents=Agents(**{"order": 1} | virtual, offsets=h), **more),
        certify(graph, protocol, InitialState(less, v0=v0), agents=plain, **more),
    )


def told(certificate: Certificate) -> str:
    """What the screen tells from the protocol on, before which notes on a file that was read may stand."""
    text = " ".join(" ".join(summary_lines(certificate)).split())
    return text[text.index(" protocol ") :]


def agree(ours: Certificate, plain: Certificate, folder: Path) -> None:
    """Judge that a file differs by the places alone, is read back, and tells positions."""
    own, other = (
        {key: part for key, part in one.to_dict().items() if key not in ("digest", "unverified", "formation")}
        for one in (ours, plain)
    )
    assert own == other and ours.checked is not None and ours.checked.accepted
    ours.save(folder / "places.json")
    again = read_certificate(folder / "places.json")
    assert again.offsets == ours.offsets and again.final_state == ours.final_state
    assert again.proof.initial_positions == ours.proof.initial_positions
    texts = [told(one) for one in (ours, again)]
    assert texts[0] == texts[1] and "in a formation" in texts[0]
    for one, less, h in zip(ours.final_state or (), plain.final_state or (), ours.offsets or (), strict=False):
        assert one == (None if less is None else (less[0] + h, less[1] + h))


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(4 * len(KINDS)))
def test_a_formation_of_a_family_has_the_certificate_of_its_states_less_places(seed: int, tmp_path: Path):
    rng = random.Random(seed)
    family = random_family(rng, KINDS[seed % len(KINDS)], nodes=1 + seed % 5).family
    x0, h = ([F(rng.randint(-50, 50), 10) for _ in range(family.n_nodes)] for _ in range(2))
    protocol = SLIDING if seed % 4 == 3 else NOMINAL
    agree(*pair(family, protocol, x0, h, asks=LIMITED), tmp_path)


@pytest.mark.few(3)
@pytest.mark.parametrize(
    "more",
    [
        {"messages": LateMessages(delay="0.01")},
        {"leaders": MovingLeaders(speed="0.5"), "limits": GainLimits(gain_cap=40)},
        {"asks": Asks(noise="0.01", delta="0.2"), "limits": GainLimits(gain_cap=40)},
        {"signal": DwellTime("0.2")},
        {"signal": JointWindows(1, on="1/5", clock="s")},
        {"signal": "constant"},
    ],
    ids=["late", "moving", "disturbed", "dwell", "windows", "constant"],
)
def test_it_takes_what_other_families_take(more: Any, tmp_path: Path):
    agree(*pair(UNSURE, NOMINAL, [5, 2, 4, -1], PLACES, **more), tmp_path)


@pytest.mark.few(2)
@pytest.mark.parametrize("family", [None, UNSURE], ids=["graph", "family"])
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"limits": GainLimits(gain_cap=30)},
        {"messages": LateMessages(delay="0.01", period="0.01", losses=1, gain_cap=25)},
        {"messages": LateMessages(value_error="0.01", gain_cap=25), "leaders": MovingLeaders(speed="0.3")},
    ],
    ids=["plain", "capped", "late", "moving"],
)
def test_a_formation_of_vehicles_has_the_certificate_of_their_states_less_places(
    family: Family | None, more: Any, tmp_path: Path
):
    asks = {} if family is not None else {"asks": Asks(simulation=False, method="paper")}
    ours, plain = pair(family or TEAM, NOMINAL, [5, 2, 4, -1], PLACES, 2, v0=[0, 1, -2, "0.5"], **more, **asks)
    agree(ours, plain, tmp_path) if family is not None else None
    bounds, others = (vars(one.late.vehicles) for one in (ours, plain))
    assert all(np.array_equal(bounds[name], others[name]) for name in bounds)
    if family is None and (run := ours.asked_trajectory) is not None:
        assert run.positions[:, 0] == pytest.approx([5, 2, 4, -1]) and run.vehicles
        assert np.array_equal(run.states, plain.asked_trajectory.states)
        drawn = [[line.get_ydata() for line in one.plot().lines] for one in (ours, plain)]
        assert all(np.array_equal(*lines) for lines in zip(*drawn, strict=True))


@cache
def drawn(family: Family, constant: bool = False) -> Certificate:
    n = family.n_nodes
    agents, x0 = Agents(1, offsets=[F(10 * k) for k in range(n)]), [F(k + 1) + 10 * k for k in range(n)]
    return certify(family, NOMINAL, x0, agents=agents, signal="constant" if constant else "any")


@pytest.mark.parametrize("family", [DRAWN, FOES, UNSURE], ids=["boxes", "ranges", "consensus"])
def test_ends_boxes_and_ranges_are_of_positions_and_no_run_leaves_them(family: Family):
    """Also by other numbers than those of the certificate: constant weights, run to the deadline."""
    certificate = drawn(family)
    table = certificate.to_pandas()
    for level in (0.0, 0.5, 1.0):
        (run,) = sample_runs(certificate, [ConstantSignal(0, level)])
        assert run.positions[:, 0] == pytest.approx([float(x) for x in certificate.proof.initial_positions])
        end = run.positions[:, run.remaining > 0][:, -1]
        for low, high in (("least", "largest"), ("box_least", "box_largest"), ("stays_least", "stays_largest")):
            known = table[low].notna().to_numpy()
            assert (table[low][known] - 0.05 <= end[known]).all() and (end[known] <= table[high][known] + 0.05).all()
    assert table[["least", "box_least", "stays_least"]].notna().any().any()
    assert "of x - offsets" in told(certificate)


def test_what_is_shaded_is_around_positions():
    certificate = drawn(UNSURE)
    (run,) = runs = sample_runs(certificate, [ConstantSignal(0, 0.3)])
    ax = plot_trajectory(certificate, runs=runs)
    tubes = [path.vertices for area in ax.collections for path in area.get_paths()]
    at = [tube[np.abs(tube[:, 0] - 0.5) < 0.02][:, 1] for tube in tubes]
    for row in run.positions:
        middle = row[np.searchsorted(run.t, 0.5)]
        assert any(ends.min() - 1e-6 <= middle <= ends.max() + 1e-6 for ends in at if ends.size)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"offsets": {"a": "1", "b": "-3", "c": "2", "d": "3"}}, "an agent of the formation begins elsewhere"),
        ({"initial_state": {"a": "5", "b": "2", "c": "4", "d": "-2"}}, "an agent of the formation begins elsewhere"),
        ({"final_state": {"a": "5", "b": "2", "c": "4", "d": "-2"}}, "positions are told iff states are"),
        ({"offsets": {"a": "1"}}, "missing"),
    ],
)
def test_places_of_a_family_that_do_not_follow_are_rejected(change: Any, reason: str):
    data = drawn(UNSURE).to_dict()
    assert check(data).accepted
    report = check({**data, "formation": {**data["formation"], **change}})
    assert not report.accepted and reason in (report.reason or "")


@pytest.mark.parametrize(
    ("protocol", "agents", "x0", "words"),
    [
        (NOMINAL, {"order": 1, "biases": [1, 0, 0, 0]}, None, "biases: of a family make other places"),
        (NOMINAL, {"order": 1, "offsets": [[1, 0]] * 4}, [[1, 2]] * 4, "dimension.*on a line"),
        (SLIDING, {"order": 1, "offsets": [1, 0, 0, 0], "gain_cap": 5}, None, "gain_cap is for the nominal protocol"),
        (NOMINAL, {"order": 2, "offsets": [1, 0, 0, 0]}, None, "agents is not for families"),
        (NOMINAL, {"order": 1, "decay": 3, "offsets": [1, 0, 0, 0]}, None, "agents is not for families"),
    ],
)
def test_what_is_not_proved_of_families_is_refused(protocol: Any, agents: Any, x0: Any, words: str):
    with pytest.raises(ParameterError, match=words):
        certify(UNSURE, protocol, x0, agents=Agents(**agents))


def test_vehicles_are_told_to_end_where_virtual_positions_do_with_their_places() -> None:
    ours, _ = pair(TEAM, NOMINAL, [5, 2, 4, -1], PLACES, 2, asks=Asks(simulation=False, method="paper"))
    assert "of virtual positions, places added" in told(ours) and "track them, places added" in told(ours)
    ((fact,),) = ([one for one in facts_of(each) if one.head == "offsets"] for each in (ours,))
    assert list(fact.value.values()) == PLACES and fact.detail


def test_a_cap_of_the_agents_of_a_family_is_that_of_its_limits_and_messages():
    agents = Agents(1, offsets=PLACES, gain_cap=40)
    for more in ({}, {"limits": GainLimits(gain_cap=40)}, {"messages": LateMessages(delay="0.001", gain_cap=40)}):
        late = certify(UNSURE, NOMINAL, [5, 2, 4, -1], agents=agents, **more).late
        assert late is not None and late.messages.gain_cap == 40
