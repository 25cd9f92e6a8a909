"""Inputs that are clipped to [-U, U]: no run exceeds a bound, who cannot arrive is told, and no forgery is accepted."""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from led_families import led_family
from mutations import changed, resealed
from oracle import number
from schema_validator import VALIDATOR

from ptcc_certify import read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import HypothesisError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, Expectations
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.simulation.late_messages import simulate_late
from ptcc_certify.simulation.moving_leaders import simulate_tracking

F = Fraction
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=8, kappa=1)
TEAM = SignedDigraph.from_edges([("L", "a", 1), ("a", "b", -1), ("b", "a", -1), ("b", "c", 1), ("M", "c", 1)])
BEGIN = {"L": 2, "a": 0, "b": 1, "c": 3, "M": 1}


def clipped(U: Any, cap: Any = None, error: Any = 0) -> LateMessages:
    return LateMessages(value_error=error, gain_cap=cap, leaders=MovingLeaders(saturation=U))


def test_one_follower_by_hand():
    """From 3 away within 4: the line 3 - 4 t until (1 + 8/(1 - t)) (3 - 4 t) = 4, and from there the free decay."""
    pair = SignedDigraph.from_edges([("a", "b", 1)])
    late = certify(pair, PROTOCOL, [0, 3], messages=clipped(4)).late
    turn = min(r.real for r in np.roots([4, -35, 23]))  # (9 - t) (3 - 4 t) = 4 (1 - t)
    t = np.array([0, turn / 2, turn, (turn + 1) / 2])
    line = 3 - 4 * np.minimum(t, turn)
    free = np.exp(-(t - turn)) * ((1 - t) / (1 - turn)) ** 8
    assert late.deviation_bound(t)[0] == pytest.approx(np.where(t > turn, line * free, line), rel=1e-4)
    assert late.largest == 0 and late.inputs.max() == pytest.approx(4)


def run(rng: np.random.Generator, family: Any, begin: list[int], case: dict[str, Any], t: np.ndarray) -> np.ndarray:
    """States ``(N, M)`` at instants, of weights, modes and errors drawn at random; steps of Runge and Kutta."""
    n, x, U = family.n_nodes, np.array(begin, dtype=float), case["U"]
    boxes = []
    for mode in family.modes:
        ends = np.zeros((2, n, n))
        for end, values in zip(ends, (mode.lower, mode.upper), strict=True):
            size = [float(values.fraction(e)) for e in range(mode.source.size)]
            end[mode.target, mode.source] = np.array(mode.sign, dtype=float) * size
        boxes.append(ends)
    states = [x]
    for i in range(t.size - 1):
        if i % 30 == 0:
            low, high = boxes[int(rng.integers(len(boxes)))]
            W = low + (high - low) * rng.random((n, n))
            L, off = np.diag(np.abs(W).sum(axis=1)) - W, np.abs(W).sum(axis=1) * rng.choice([-1, 1], n) * case["error"]

        def speed(s: float, y: np.ndarray, L: np.ndarray = L, off: np.ndarray = off) -> np.ndarray:
            gain = min(1 + 8 / (1 - s) if s < 1 else 1, case["cap"] or np.inf)
            return np.clip(gain * (off - L @ y), -U, U)

        a, h = t[i], t[i + 1] - t[i]
        k1 = speed(a, x)
        k2 = speed(a + h / 2, x + h / 2 * k1)
        k3 = speed(a + h / 2, x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + speed(a + h * (1 - 1e-12), x + h * k3))
        states.append(x)
    return np.array(states).T


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(150))
def test_no_run_of_a_member_exceeds_a_bound(seed: int):
    rng = np.random.default_rng(seed)
    heads = int(rng.integers(1, 3))
    family = led_family(rng, heads, int(rng.integers(1, 5)), int(rng.integers(1, 3)))
    begin = [int(x) for x in rng.integers(-6, 7, family.n_nodes)]
    cap = int(rng.integers(5, 60)) if rng.random() < 0.4 else None
    error = F(1, 100) if rng.random() < 0.3 else F(0)
    wide = certify(family, PROTOCOL, begin, messages=clipped(10**6, cap, error))
    ends = np.array([float(sum(pair)) / 2 for pair in wide.proof.final_state])
    away = float(np.abs(np.array(begin) - ends).max())
    U = F(round(away * rng.uniform(0.6, 3) * 64) + 1, 64)
    made = certify(family, PROTOCOL, begin, messages=clipped(U, cap, error))
    late = made.late
    if not late.says_something:
        return
    assert made.verdict == "certified" and check(json.loads(made.to_json())).accepted
    t = 1 - np.geomspace(1, 1e-3, 3000) if cap is None else np.linspace(0, 1.2, 3000)
    x = run(rng, family, begin, {"U": float(U), "cap": cap, "error": float(error)}, t)
    bound = np.minimum.reduce([row.over_time(late.case, t).bound for row in late.rows])
    assert (np.abs(x - ends[:, None]) <= bound * (1 + 1e-6) + 1e-5).all()


@pytest.mark.parametrize("U", [1, 2, F(7, 2)])
def test_who_cannot_arrive_is_told_and_does_not(U: Any):
    made = certify(TEAM, PROTOCOL, BEGIN, messages=clipped(U))
    label, off = made.late.unreachable if F(7, 2) > U else ("c", F(0))
    assert label == "c" and off == F(7, 2) - F(U)  # c ends at -1/2
    moved = simulate_tracking(TEAM, PROTOCOL, MovingLeaders(saturation=U), BEGIN)
    at = int(np.abs(moved.t - 1).argmin())
    assert abs(moved.states[3, at] + 0.5) >= off - 1e-9
    assert made.assessment.exit_code == (3 if F(7, 2) > U else 4)


@pytest.mark.parametrize("U", [6, 8, 20])
def test_the_run_arrives_below_the_bound(U: int):
    late = certify(TEAM, PROTOCOL, BEGIN, messages=clipped(U)).late
    made = simulate_tracking(TEAM, PROTOCOL, MovingLeaders(saturation=U), BEGIN)
    off, before = np.abs(made.states - made.targets)[late.followers], made.t < 1
    assert (off[:, before] <= late.deviation_bound(made.t[before]) * (1 + 1e-6) + 1e-9).all()
    assert np.abs(made.input).max() <= U and off[:, int(np.abs(made.t - 1).argmin())].max() < 1e-9


def test_the_input_asked_for_is_that_of_clipped_inputs():
    for most, code in ((8, 0), (7, 4)):
        asks = Asks(expectations=Expectations(max_input=most))
        assert certify(TEAM, PROTOCOL, BEGIN, messages=clipped(8), asks=asks).assessment.exit_code == code


def test_fast_decays_are_stated_at_slower_rates():
    """e^(b s) at the turn would be beyond floats."""
    graph, protocol = [("L", "a", 100)], NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    made = certify(graph, protocol, [0, 3], messages=clipped("3.01"))
    assert made.verdict == "certified" and made.late.largest == 0


@pytest.mark.parametrize("other", [{"speed": 1}, {"disturbance": 1}, {"growth": 1}])
def test_runs_are_refused_of_what_is_not_certified(other: dict[str, Any]):
    with pytest.raises(ParameterError, match="beside"):
        simulate_tracking(TEAM, PROTOCOL, MovingLeaders(saturation=5, **other), BEGIN)
    with pytest.raises(ParameterError, match="neither late nor off"):
        simulate_late(TEAM, PROTOCOL, LateMessages(value_error=1), BEGIN, leaders=MovingLeaders(saturation=5))


# ---------------------------------------------------------------------- files


def document(U: Any = 8, **parts: Any) -> dict[str, Any]:
    made = certify(TEAM, PROTOCOL, BEGIN, messages=clipped(U, **parts), asks=Asks(simulation=False))
    return {**json.loads(made.to_json()), "unverified": {}}


@pytest.mark.parametrize("parts", [{}, {"cap": 20}, {"cap": 20, "error": F(1, 100)}])
def test_it_is_checked_with_and_without_arrays_and_read_back(parts: dict[str, Any], tmp_path):
    made = certify(TEAM, PROTOCOL, BEGIN, messages=clipped(6, **parts))
    data = json.loads(made.to_json())
    assert VALIDATOR.is_valid(data) and data["messages"]["leaders"]["saturation"] == "6"
    assert all(check(data, stdlib=one).accepted for one in (False, True))
    made.save(tmp_path / "c.json")
    again, t = read_certificate(tmp_path / "c.json").late, np.linspace(0, 1.2, 40)
    assert again.leaders == made.late.leaders and np.array_equal(again.inputs, made.late.inputs)
    assert np.array_equal(again.largest_bound(t), made.late.largest_bound(t))


def row_with(data: dict[str, Any], **entries: Fraction) -> str:
    for name, value in entries.items():
        data = changed(data, ("messages", "rows", 0, name), str(value))
    report = check(resealed(data))
    return "" if report.accepted else report.reason


def test_a_turn_that_comes_later_is_not_accepted():
    """From the true turn on bounds no longer fall evenly: a line that goes on would be at 0 before T."""
    data = document()
    row = {name: number(data["messages"]["rows"][0][name]) for name in ("start", "turn", "level", "initial")}
    speed = (row["start"] - row["level"]) / row["turn"]
    for share in (F(1, 1000), F(1, 10), F(1, 2), F(1)):
        turn = row["turn"] + share * (row["start"] / speed - row["turn"])
        level = max(row["start"] - speed * turn, F(0))
        assert "does not fall so fast" in row_with(data, turn=turn, level=level, initial=row["initial"])


@pytest.mark.parametrize(
    ("name", "factor", "why"),
    [
        ("start", F(99, 100), "starts farther"),
        ("initial", F(99, 100), "initial is not proved"),
        ("level", F(9, 10), "does not fall so fast"),
        ("level", F(11, 10), "clipped at the turn"),
        ("turn", F(9, 10), "does not fall so fast"),
        ("turn", F(11, 10), ""),
    ],
)
def test_no_number_of_a_row_may_be_another(name: str, factor: Fraction, why: str):
    data = document()
    reason = row_with(data, **{name: number(data["messages"]["rows"][0][name]) * factor})
    assert reason and why in reason


def test_a_smaller_saturation_is_not_accepted():
    data = changed(document(), ("messages", "leaders", "saturation"), "7")
    assert not check(resealed(data)).accepted


@pytest.mark.parametrize("other", ["speed", "disturbance", "growth", "sign_gain"])
def test_it_is_not_accepted_beside_what_is_not_proved(other: str):
    data = changed(document(), ("messages", "leaders", other), "1")
    assert "clipped beside" in check(resealed(data)).reason


@pytest.mark.parametrize(
    ("graph", "parts", "why"),
    [
        (TEAM, {"messages": LateMessages("0.1")}, "beside late messages"),
        (TEAM, {"leaders": MovingLeaders(1, saturation=5)}, "beside leaders that move"),
        (TEAM, {"leaders": MovingLeaders(saturation=5, growth=1)}, "beside growth"),
        (TEAM, {"agents": Agents(order=2, exchange="virtual")}, "virtual positions"),
        ([("a", "b", 1), ("b", "a", 1)], {}, "where leaders hear others"),
        (TEAM, {"protocol": SlidingModeProtocol(1, 1, 1, 1, 1, 2, 1, 1, 1)}, "nominal protocol"),
    ],
)
def test_what_is_not_proved_is_refused_in_one_line(graph: Any, parts: dict[str, Any], why: str):
    parts = {"leaders": MovingLeaders(saturation=5), **parts}
    with pytest.raises((ParameterError, HypothesisError), match=why):
        certify(graph, parts.pop("protocol", PROTOCOL), **parts)


def test_what_is_told_of_a_file_is_what_was_told_at_first(tmp_path):
    made = certify(TEAM, PROTOCOL, BEGIN, messages=clipped(2))
    made.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    assert again.late.missing == made.late.missing and again.late.unreachable == made.late.unreachable
