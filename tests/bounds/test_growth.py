"""Agents that move by themselves, x' = f(t, x) + u: no run of any member, under any odd f, exceeds a bound."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from mutations import changed, resealed
from oracle import number
from schema_validator import VALIDATOR

from ptcc_certify import read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import HypothesisError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.simulation.moving_leaders import simulate_tracking

F = Fraction
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
CONVOY = SignedDigraph.from_edges([("L", "a", 1), ("a", "b", -1), ("b", "a", -1), ("b", "c", 1)])
TEAM = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1), ("c", "a", -1), ("c", "d", 2)])
BEGIN = [2, 0, 1, 3]


def drawn(rng: np.random.Generator, kind: str) -> tuple[Family, np.ndarray, np.ndarray]:
    """A family of one to three modes, its camps, and by agent the pivot that it follows; -1 of those that end at 0."""
    n, heads = int(rng.integers(2, 7)), 1
    camp, home = rng.choice([-1, 1], n), np.zeros(n, dtype=int)
    if kind == "led":
        heads = int(rng.integers(1, 3))
        n = max(n, heads + 1)
        camp, home = rng.choice([-1, 1], n), np.concatenate([np.arange(heads), rng.integers(0, heads, n - heads)])
    made = []
    for _ in range(int(rng.integers(1, 4))):
        rows = []
        for v in range(heads if kind == "led" else 0, n):
            sure = int(rng.choice([u for u in range(v) if home[u] == home[v]])) if v else n - 1
            for u in range(n):
                if u == v or home[u] != home[v] or (u != sure and rng.random() < 0.6):
                    continue
                low, share = F(int(rng.integers(2, 30)), 10), F(int(rng.integers(0, 4)), 10)
                sign = int(camp[u] * camp[v])
                rows.append((u, v, *sorted((sign * low, sign * low * (1 + share)))))
        if kind == "repelled":  # an edge that no camps keep, in every member
            sign = -int(camp[0] * camp[1])
            rows = [row for row in rows if row[:2] not in ((0, 1), (1, 0))]
            rows += [(0, 1, sign, sign), (1, 0, -sign, -sign)]
        made.append(Family.from_intervals(rows, nodes=range(n)))
    return Family.switching(made), camp, np.full(n, -1) if kind == "repelled" else home


def own_motion(rng: np.random.Generator, growth: float) -> Callable[[float, np.ndarray], np.ndarray]:
    """An odd function with this Lipschitz constant."""
    size, width, turn = float(rng.choice([-1, 1])), float(rng.uniform(0.2, 3)), float(rng.uniform(3, 30))
    return [
        lambda t, x: growth * x,
        lambda t, x: size * growth * width * np.sin(x / width),
        lambda t, x: growth * math.copysign(1, math.sin(turn * t)) * x,
        lambda t, x: growth * np.clip(x, -width, width),
    ][int(rng.integers(4))]


def run(rng: np.random.Generator, family: Family, case: dict[str, Any], t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States ``(N, M)`` at instants and inputs, of weights, modes, disturbances, errors and speeds drawn at random."""
    n, gap, x, f = family.n_nodes, case["cap"] or np.inf, np.array(case["begin"], dtype=float), case["f"]
    boxes = []

    def gain(s: float) -> float:
        return min(1 + 4 / (1 - s) if s < 1 else 1, gap)

    for mode in family.modes:
        ends = np.zeros((2, n, n))
        for end, values in zip(ends, (mode.lower, mode.upper), strict=True):
            sign = np.array(mode.sign, dtype=float)
            end[mode.target, mode.source] = sign * [float(values.fraction(e)) for e in range(mode.source.size)]
        boxes.append(ends)
    hears = np.abs(np.array(boxes)).sum(axis=(0, 1, 3)) > 0
    states, inputs, W, d, off = [x], [np.zeros(n)], boxes[0][0], np.zeros(n), np.zeros(n)
    for i, (a, b) in enumerate(itertools.pairwise(t)):
        if i % 40 == 0:
            low, high = boxes[int(rng.integers(len(boxes)))]
            W = low + (high - low) * rng.random((n, n))
            d = np.where(hears, case["disturbance"], case["speed"]) * rng.choice([-1, 1], n)
            off = case["error"] * np.abs(W).sum(axis=1) * rng.choice([-1, 1], n)
        D = np.abs(W).sum(axis=1)

        def speed(
            s: float, y: np.ndarray, W: np.ndarray = W, D: np.ndarray = D, d: np.ndarray = d, off: np.ndarray = off
        ) -> np.ndarray:
            return f(s, y) + d + gain(s) * (W @ y - D * y + off)

        h = b - a
        k1 = speed(a, x)
        k2 = speed(a + h / 2, x + h / 2 * k1)
        k3 = speed(a + h / 2, x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + speed(b - 1e-15, x + h * k3))
        states.append(x)
        inputs.append(gain(b) * (W @ x - D * x + off))
    return np.array(states).T, np.array(inputs).T


def worst_ratio(kind: str, seed: int) -> float:
    """The largest ratio of a run to what is certified of it: of deviations at all times, and of inputs."""
    rng = np.random.default_rng([seed, len(kind)])
    family, camp, pivot = drawn(rng, kind)
    n, growth = family.n_nodes, F(int(rng.integers(1, 20)), 10)
    forced = rng.random() < 0.5
    speed, push = (F(int(rng.integers(1, 10)), 10) if forced else F(0) for _ in range(2))
    leaders = MovingLeaders(speed if kind == "led" else 0, push, growth=growth)
    error = F(1, 50) if rng.random() < 0.4 else F(0)
    cap = F(int(rng.integers(3, 40))) if rng.random() < 0.5 else None
    begin = [int(x) for x in rng.integers(-5, 6, n)]
    told = LateMessages(value_error=error, gain_cap=cap, leaders=leaders)
    made = certify(family, PROTOCOL, begin, messages=told, leaders=leaders, asks=Asks(simulation=False))
    late = made.late
    if not late.says_something:
        return 0.0
    assert made.verdict == "certified" and check(json.loads(made.to_json())).accepted
    t = 1 - np.geomspace(1, 1e-3, 3000)
    case = {"begin": begin, "cap": None if cap is None else float(cap), "error": float(error)}
    case |= {"speed": float(leaders.speed), "disturbance": float(push), "f": own_motion(rng, float(growth))}
    if cap is not None:
        t = np.linspace(0, 1.5, 3000)
    x, u = run(rng, family, case, t)
    target = np.where(pivot[:, None] < 0, 0.0, (camp * camp[pivot])[:, None] * x[pivot])
    each = [one.over_time(late.case, t).bound for one in (*late.rows, *late.of_all)]
    bound = np.minimum.reduce(each)  # of forms, one of which knows each agent
    assert np.isfinite(bound[:, t < 1]).all()
    room = 1e-6 * (1 + np.abs(x).max())
    worst = float((np.abs(x - target) / (bound + room)).max())
    if late.inputs is not None:
        heard, up_to_T = np.isfinite(late.inputs), t <= 1
        own = np.abs(u[heard][:, up_to_T]).max(axis=1)
        listens = np.isin(np.arange(n), np.concatenate([mode.target for mode in family.modes]))[heard]
        worst = max(worst, float((own * listens / (late.inputs[heard] + 1e-6)).max(initial=0)))
    return worst


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("kind", ["led", "agreed", "repelled"])
def test_no_run_exceeds_a_bound(kind: str, seed: int):
    assert worst_ratio(kind, seed) <= 1 + 1e-6


def test_one_pair_by_hand():
    """Two agents, one leader: x_b - x_a is multiplied by e^(l t) (1 - t) e^-t, and the bound is that."""
    pair = SignedDigraph.from_edges([("a", "b", 1)])
    leaders = MovingLeaders(speed=0, growth=F(1, 2))
    late = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [0, 3], leaders=leaders).late
    t = np.array([0, 0.3, 0.9])
    assert late.deviation_bound(t)[0] == pytest.approx(3 * np.exp(t / 2) * (1 - t) * np.exp(-t), rel=1e-6)
    assert late.largest == 0


@pytest.mark.parametrize("cap", [None, 20])
@pytest.mark.parametrize("speed", [0, F(1, 2)])
def test_the_run_of_leaders_that_move_by_themselves_is_on_the_bound(speed: Fraction, cap: int | None):
    leaders = MovingLeaders(speed, growth=1)
    late = certify(CONVOY, PROTOCOL, BEGIN, messages=LateMessages(leaders=leaders, gain_cap=cap)).late
    made = simulate_tracking(CONVOY, PROTOCOL, leaders, BEGIN, u=late.rows[0].witness.u, gain_cap=cap)
    off, bound = np.abs(made.states - made.targets)[late.followers], late.deviation_bound(made.t)
    assert (off <= bound * (1 + 1e-9) + 1e-9).all()
    assert made.states[0, -1] > 2 * math.exp(1)


@pytest.mark.parametrize(("graph", "growth"), [([("L", "a", "1.01")], 1), ([("a", "b", 1), ("b", "a", 1)], 20)])
def test_long_after_t_a_bound_is_above_what_grows(graph: Any, growth: int):
    """Under a cap the distance of two agents is e^(growth t - b s) of what it was, also beyond floats."""
    leaders = MovingLeaders(growth=growth)
    late = certify(graph, PROTOCOL, [0, 1], messages=LateMessages(gain_cap=5, leaders=leaders)).late
    t, b = np.array([1, 40, 400, 720.0]), 1.01 if growth == 1 else 2
    size = growth * t - b * (5 + 1 * (t - 1))
    with np.errstate(over="ignore"):
        bound = late.largest_bound(t)
        assert (bound >= np.exp(size) * (0.5 if growth == 20 else 1) * (1 - 1e-6)).all()


# ---------------------------------------------------------------------- files


def document(graph: Any, **parts: Any) -> dict[str, Any]:
    made = certify(graph, PROTOCOL, BEGIN, asks=Asks(simulation=False), **parts)
    return {**json.loads(made.to_json()), "unverified": {}}


def asked(growth: Any = "0.3", **parts: Any) -> dict[str, Any]:
    leaders = MovingLeaders(**{"speed": 0, "disturbance": "0.1", **parts}, growth=growth)
    return {"messages": LateMessages(value_error="0.01", gain_cap=20, leaders=leaders)}


@pytest.mark.parametrize("graph", [CONVOY, TEAM], ids=["rows", "forms"])
def test_it_is_checked_with_and_without_arrays_and_read_back(graph: SignedDigraph, tmp_path):
    made = certify(graph, PROTOCOL, BEGIN, **asked())
    data = json.loads(made.to_json())
    assert VALIDATOR.is_valid(data) and data["messages"]["leaders"]["growth"] == "3/10"
    assert all(check(data, stdlib=one).accepted for one in (False, True))
    made.save(tmp_path / "c.json")
    again, t = read_certificate(tmp_path / "c.json").late, np.array([0, 0.5, 1, 1.2])
    assert again.leaders == made.late.leaders and again.largest == made.late.largest
    assert np.array_equal(again.largest_bound(t), made.late.largest_bound(t))


@pytest.mark.parametrize(
    ("graph", "name", "why"),
    [
        (CONVOY, "initial", "starts farther"),
        (CONVOY, "floor", "heard wrong"),
        (CONVOY, "drift", "drift is not proved"),
        (CONVOY, "after", "pushed farther"),
        (TEAM, "initial", "initial is not proved"),
        (TEAM, "push", "push is too small"),
        (TEAM, "floor", "is too small"),
        (TEAM, "growth", "growth is too small"),
    ],
)
def test_nothing_is_accepted_without_what_growth_multiplies(graph: SignedDigraph, name: str, why: str):
    data, key = document(graph, **asked()), "rows" if graph is CONVOY else "forms"
    less = number(data["messages"][key][0][name]) * F(5, 6)  # e^(growth T) is 1.35
    report = check(resealed(changed(data, ("messages", key, 0, name), str(less))))
    assert not report.accepted and why in report.reason, report.reason


def test_growth_of_one_graph_or_of_other_targets_is_not_accepted():
    plain = certify(CONVOY, PROTOCOL, BEGIN, leaders=MovingLeaders(speed=1), asks=Asks(simulation=False))
    data = changed(json.loads(plain.to_json()), ("messages", "leaders", "growth"), "1/100")
    assert "move by themselves" in check(resealed(data)).reason
    placed = certify(
        {"day": CONVOY, "night": CONVOY},
        PROTOCOL,
        BEGIN,
        agents=Agents(order=1, offsets=[0, 1, 2, 3]),
        leaders=MovingLeaders(speed=1),
    )
    data = changed(json.loads(placed.to_json()), ("messages", "leaders", "growth"), "1/100")
    assert "in a formation" in check(resealed(data)).reason
    two = {"day": [("L", "a", 1), ("M", "a", 1)], "night": [("L", "a", 2), ("M", "a", 2)]}
    made = certify(two, PROTOCOL, [1, 2, 3], leaders=MovingLeaders(speed=1))
    data = changed(json.loads(made.to_json()), ("messages", "leaders", "growth"), "1/100")
    assert "neither 0, a leader nor its opposite" in check(resealed(data)).reason


@pytest.mark.parametrize(
    ("graph", "parts", "why"),
    [
        ([("L", "a", 1), ("M", "a", 1)], {}, "do not stay at the mean that a is drawn to"),
        (CONVOY, {"messages": LateMessages("0.1")}, "goes on while messages come"),
        (CONVOY, {"agents": Agents(order=2, exchange="virtual")}, "virtual positions"),
        (CONVOY, {"agents": Agents(order=1, offsets=[0, 1, 2, 3])}, "is not for formations"),
        (CONVOY, {"asks": Asks(initial_set=1)}, "initial_set"),
        (TEAM, {"leaders": MovingLeaders(1, growth=1)}, "a and b are leaders of one group"),
        (CONVOY, {"protocol": SlidingModeProtocol(1, 1, 1, 1, 1, 2, 1, 1, 1)}, "nominal protocol"),
    ],
)
def test_what_is_not_proved_is_refused_in_one_line(graph: Any, parts: dict[str, Any], why: str):
    parts = {"leaders": MovingLeaders(0, growth="0.3"), **parts}
    with pytest.raises((ParameterError, HypothesisError), match=why):
        certify(graph, parts.pop("protocol", PROTOCOL), **parts)


def test_a_target_that_moves_by_itself_is_heard_late():
    """Why late messages are refused beside growth: however fast it decays, the follower stays behind."""
    growth, delay, dt = 0.5, 0.1, 1e-4
    heard, x, steps = [1.0], 1.0, int(0.9 / dt)
    for i in range(steps):
        old = heard[max(0, len(heard) - 1 - round(delay / dt))]
        x += dt * (growth * x + 200 * (old - x))
        heard.append(math.exp(growth * (i + 1) * dt))
    assert abs(x - heard[-1]) > 0.8 * growth * delay * heard[-1]
