"""Double integrators that exchange virtual positions: accepted, refused where forged, and no run exceeds a bound."""

from __future__ import annotations

import itertools
import json
from bisect import bisect_right
from fractions import Fraction
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from late_certificates import led_graph
from mutations import Json, at, changed, judged_mutants, mutants, resealed, without
from oracle import number
from schema_validator import VALIDATOR

from ptcc_certify import read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.checker.stated_bounds import Vehicles
from ptcc_certify.errors import HypothesisError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, GainLimits, InitialState
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.virtual_positions import TrackingProtocol
from ptcc_certify.model.virtual_positions import Vehicles as Team
from ptcc_certify.simulation.late_messages import simulate_late
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.virtual_positions import follow, follow_in_motion, run_virtual_positions, simulate_vehicles

F = Fraction
VIRTUAL = Agents(order=2, exchange="virtual")
PATH = ("messages", "vehicles")
#: What goes together, by name: the parts beside agents, initial state and protocol.
CASES: dict[str, dict[str, Any]] = {
    "plain": {},
    "capped": {"limits": GainLimits(gain_cap=20)},
    "late": {"messages": LateMessages(delay="0.02")},
    "late-capped": {"messages": LateMessages(delay="0.02", value_error="0.01"), "limits": GainLimits(gain_cap=12)},
    "lost": {"messages": LateMessages(delay="0.005", period="0.01", losses=2, gain_cap=15)},
    "moving": {"leaders": MovingLeaders(speed="0.5"), "limits": GainLimits(gain_cap=30)},
    "late-moving": {"messages": LateMessages(delay="0.02", gain_cap=25), "leaders": MovingLeaders(speed="0.3")},
    "uncertain": {"uncertainty": "10%", "limits": GainLimits(gain_cap=20)},
    "uncertain-late-moving": {
        "uncertainty": "10%",
        "messages": LateMessages(delay="0.01", gain_cap=25),
        "leaders": MovingLeaders(speed="0.3"),
    },
    "uncertain-late": {"uncertainty": "20%", "messages": LateMessages(delay="0.01")},
}
#: The same of mixed teams, whose orders go round.
TEAMS = {
    "team": {},
    "team-capped": CASES["capped"],
    "team-late": CASES["late"],
    "team-lost": CASES["lost"],
    "team-late-capped": CASES["late-capped"],
    "team-late-moving": CASES["late-moving"],
    "team-uncertain-late-moving": CASES["uncertain-late-moving"],
    "shaken": {},
    "shaken-capped": CASES["capped"],
    "shaken-late-moving": CASES["late-moving"],
    "driven": {},
    "driven-capped": CASES["capped"],
    "driven-late-moving": CASES["late-moving"],
}
CASES |= TEAMS
ORDERS, SHAKEN = (3, 2, 1, 3, 2), (3, 2, 2, 3, 2)
#: Whom something disturbs; agents of order 1 by themselves drive virtual positions.
DISTURBED = ("shaken", "driven")
KIND = {False: "late-vehicles", True: "late-team"}


def agents_of(graph: SignedDigraph, name: str) -> Agents:
    """Double integrators, or a mixed team."""
    return Agents(orders=orders_of(name)[: graph.n_nodes]) if name in TEAMS else VIRTUAL


def orders_of(name: str) -> tuple[int, ...]:
    """The orders of a mixed team."""
    return SHAKEN if name.startswith("shaken") else ORDERS


def problem(seed: int, name: str) -> tuple[SignedDigraph, NominalProtocol, InitialState]:
    """A random graph of one leader, or two, and where its vehicles begin."""
    rng, parts = np.random.default_rng(seed), CASES[name]
    one = "uncertainty" in parts
    graph = led_graph(rng, 1 if one else 2, 3, signs="gauge" if one else "mixed")
    x0, v0 = ([F(int(x), 10) for x in rng.integers(-50, 50, graph.n_nodes)] for _ in range(2))
    if "leaders" in parts:
        v0 = [v if d else F(0) for v, d in zip(v0, graph.in_weight(), strict=True)]
    protocol = NominalProtocol(T=1, rho1=1, rho2=int(rng.integers(2, 6)), kappa=1)
    if name not in TEAMS:
        return graph, protocol, InitialState(x0, v0=v0)
    still = [name.endswith("moving") and not d for d in graph.in_weight()]
    orders = orders_of(name)
    v0 = [F(0) if n == 1 or rests else v for v, n, rests in zip(v0, orders, still, strict=False)]
    a0 = [F(0) if n < 3 or rests else 10 * v for v, n, rests in zip(v0, orders, still, strict=False)]
    return graph, protocol, InitialState(x0, derivatives=[v0, a0])


@cache
def certified(seed: int, name: str) -> Any:
    graph, protocol, initial = problem(seed, name)
    more = {} if "uncertainty" in CASES[name] else {"asks": Asks(simulation=False, method="paper")}
    if name.startswith(DISTURBED):
        more = {"asks": Asks(simulation=False, method="paper", delta=2)}
    return certify(graph, protocol, initial, agents=agents_of(graph, name), **CASES[name], **more)


@cache
def document(seed: int, name: str) -> Json:
    return {**json.loads(certified(seed, name).to_json()), "unverified": {}}


def weights_of(data: Json) -> list[list[tuple[int, int, Fraction]]]:
    """The edges of every mode, at their largest weights."""
    index = {label: v for v, label in enumerate(data["problem"]["graph"]["nodes"])}
    modes = data["problem"]["graph"]["modes"]
    sizes = []
    for mode in modes:
        pairs = [(index[edge[0]], index[edge[1]], edge[2:]) for edge in mode["edges"]]
        sizes.append([(s, t, max(abs(number(x)) for x in ends)) for s, t, ends in pairs])
    return sizes


def by_steps(
    data: Json,
    edges: list[tuple[int, int, Fraction]],
    D: np.ndarray,
    gains: tuple[float, float],
    v0: np.ndarray,
    gain: tuple[float, float, float, float],
    wrong: float,
    speed: float,
) -> dict[str, np.ndarray]:
    """What follows of vehicles from instant to instant, in floats, by hand."""
    said, (a1, a2), (T, rho1, k, cap) = data["messages"], gains, gain
    (witness,) = (step["witness"] for step in data["proof"] if step["kind"] == "late-steps")
    exact, old = [number(x) for x in said["steps"]["instants"]], number(said["delay"])
    t = list(map(float, exact))
    y = [np.zeros(len(D))]
    y[0][D > 0] = [float(number(x)) for x in witness["start"]]
    W = np.zeros((len(D),) * 2)
    for s, to, w in edges:
        W[to, s] = float(w)
    divided = np.where(D > 0, D, 1.0)
    at = np.minimum(cap, [rho1 + k / (T - x) if x < T else np.inf for x in t])
    fine = [np.linspace(a, b, 401)[:-1] + (b - a) / 800 for a, b in itertools.pairwise(t)]
    ways = [np.minimum(cap, rho1 + k / (T - x)).mean() * (b - a) for x, a, b in zip(fine, t, t[1:], strict=False)]
    lag, most = np.zeros(len(D)), {key: np.zeros(len(D)) for key in ("velocity", "input")}
    for i, way in enumerate(ways):
        past = max(bisect_right(exact, exact[i] - old) - 1, 0)
        heard = W @ y[past] / divided + wrong
        moved, begun = y[i] + heard, v0 * np.exp(-a2 * sum(ways[:i]))
        h = moved + begun / at[i] / divided
        after = h + (lag - h) * np.exp(-a1 * way)
        high, rise = np.maximum(lag, after), 0.0 if at[i] >= cap else (at[i + 1] - rho1) ** 2 / k
        g = at[i + 1]
        most["velocity"] = np.maximum(most["velocity"], begun + g * D * high)
        push = (a1 + a2) * g * begun + D * (rise * high + a1 * g * g * (high + moved))
        most["input"] = np.maximum(most["input"], push)
        lag = after
        pushed = heard + speed / (at[i] * divided)
        y.append(np.minimum(y[i], pushed + np.maximum(y[i] - pushed, 0) * np.exp(-D * way)))
    return {"position": 0.999 * (y[-1] + D * lag / a1), **{key: 0.999 * x for key, x in most.items()}}


def tracked(
    n: int, a: tuple[float, ...], b: float, k: float, g0: float, away: float, pushed: tuple[float, float], begun: Any
) -> tuple[float, float, float]:
    """What |x - x*|, |x'|/g and |u|/g^n of order n are of ``e^(-b s)`` at least, by the worst growth of the gain.

    ``pushed`` are ``p`` and what of ``|x - x*|`` drives add, which are no more than the former.
    """
    if n == 1:
        return away, pushed[0], pushed[0]
    v, acc = begun
    lag = 1 / (a[0] - b)
    if n == 2:
        far = lag * (a[0] * away + v / g0)
        y = [lag * (pushed[0] + v / g0), v / g0]
        weights = [max(abs(a[0] ** 2 - a[0] * x) for x in (0, 1 / k)), a[0] + a[1]]
        return far, a[0] * y[0] + y[1], weights[0] * y[0] + weights[1] * y[1] + a[0] * pushed[0]
    third = acc / g0**2 + (a[0] + a[1]) * v / g0
    slack = a[1] - b - b * lag / k
    ahead = max(a[1] * (away + third / a[0] / a[1]) / slack, away + v / g0 / a[0])
    second = max((third + a[0] * pushed[0] * (1 + lag / k)) / slack, v / g0)
    y = [lag * (second + pushed[0]), second, third]
    ends = (0, 1 / k)
    weights = [
        max(abs(a[0] ** 3 - x * a[0] * (a[0] - a[1])) for x in ends),
        max(abs(a[0] ** 2 + a[0] * a[1] + a[1] ** 2 - x * (a[0] + a[1])) for x in ends),
        sum(a),
    ]
    return a[0] * lag * ahead, a[0] * y[0] + y[1], float(np.dot(weights, y)) + a[0] * a[1] * pushed[0]


def standing(n: int, a: tuple[float, ...], k: float) -> tuple[float, float]:
    """The same of what stands of ``|e|``, of |x'|/g and |u|/g^n."""
    return tracked(n, a, 0.0, k, 1.0, 0.0, (1.0, 0.0), (0.0, 0.0))[1:]


def shaken(n: int, a: tuple[float, ...], k: float) -> tuple[float, float]:
    """The same of what stands of ``y_n``."""
    y = [1 / a[0], 1.0] if n == 2 else [1 / a[0] / a[1], 1 / a[1], 1.0]
    ends = (0, 1 / k)
    if n == 2:
        weights = [max(abs(a[0] ** 2 - a[0] * x) for x in ends), a[0] + a[1]]
    else:
        weights = [
            max(abs(a[0] ** 3 - x * a[0] * (a[0] - a[1])) for x in ends),
            max(abs(a[0] ** 2 + a[0] * a[1] + a[1] ** 2 - x * (a[0] + a[1])) for x in ends),
            sum(a),
        ]
    return a[0] * y[0] + y[1], float(np.dot(weights, y))


@cache
def decays_of_all(text: str) -> list[Any]:
    """The decays of all agents that an accepted certificate proves beside rows; other tests judge these."""
    found: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Vehicles, "of_all", lambda _, decay: found.append(decay))
        check(resealed(json.loads(text)))
    return found


def unbounded(data: Json) -> Json:
    """The certificate with bounds of vehicles that any decay meets."""
    told = dict(at(data, PATH))
    for key in ("position", "velocity", "input"):
        if key in told:
            told[key] = dict.fromkeys(told[key], "1" + "0" * 30)
    return {**data, "messages": {**data["messages"], "vehicles": told}}


def false_claims(data: Json) -> list[str]:
    """What is stated of vehicles and does not follow: each bound by its formula, suprema over a fine grid of time."""
    said = data["messages"]
    told, labels = said["vehicles"], data["problem"]["graph"]["nodes"]
    gains = tuple(float(number(told[key])) for key in ("a1", "a2", "a3") if key in told)
    a1, a2 = gains[:2]
    orders = [int(number(told["orders"][label])) if "orders" in told else 2 for label in labels]
    T, rho1, rho2, kappa = (float(number(data["problem"]["gain"][key])) for key in ("T", "rho1", "rho2", "kappa"))
    k, cap = rho2 * kappa, float(number(said["gain_cap"])) if "gain_cap" in said else None
    modes = weights_of(data)
    D = np.max([[sum(float(w) for _, t, w in edges if t == v) for v in range(len(labels))] for edges in modes], axis=0)
    followers = np.flatnonzero(D > 0)
    v0 = np.abs([float(number(told["v0"][label])) for label in labels])
    acc = np.abs([float(number(told["a0"][label])) if "a0" in told else 0.0 for label in labels])
    if any((v and n < 2) or (x and n < 3) for v, x, n in zip(v0, acc, orders, strict=True)):
        return ["what agents of such an order have not"]
    leaders = said.get("leaders")
    push = float(number(told["disturbance"])) if "disturbance" in told else 0.0
    driven = 0.0 if leaders is None else float(number(leaders["disturbance"]))
    speed = 0.0 if leaders is None else float(number(leaders["speed"]))
    if driven != (push if 1 in orders else 0.0) or (speed and (v0[D == 0].any() or acc[D == 0].any())):
        return ["vehicles that nothing is proved of"]
    wrong = float(number(said["value_error"])) + speed * float(number(said["delay"]))
    t = np.unique(np.concatenate([np.linspace(0, T, 20001)[:-1], T - np.geomspace(1e-9, 1, 4000) * T]))
    gain = rho1 + k / (T - t)
    g = gain if cap is None else np.minimum(gain, cap)
    steps = {step["of"]: step for step in data["proof"] if step["kind"] == "late-rows"}
    least = {key: np.full(len(labels), np.inf) for key in ("position", "velocity", "input")}
    decays = []
    for i, row in enumerate(said["rows"]):
        step = steps[f"messages.rows[{i}]"]
        b = float(number(step["numbers"]["b"]))
        u = np.zeros(len(labels))
        u[followers] = [float(number(x)) for x in step["witness"]["u"]]
        limit = float(number(row["cap"])) if "cap" in row else np.inf
        numbers = {key: float(number(x)) for key, x in row.items()}
        M, drift, after = numbers["initial"], numbers.get("drift", 0.0), numbers.get("after", 0.0)
        f = numbers["floor"] + (0.0 if cap is None else after * min(rho1, cap) / g[0])
        heard = np.max(
            [
                [sum(float(w) * u[source] for source, to, w in edges if to == v) for v in range(len(labels))]
                for edges in modes
            ],
            axis=0,
        )
        p, n = (2 * D - b) * u * M, f * (D * u + heard) + wrong * D
        decays.append((b, limit, numbers["left"], u * M, u * drift, u * numbers["floor"], p, n))
    for one in decays_of_all(json.dumps(unbounded(data))):
        columns = np.zeros((4, len(labels)))
        each = (one.away, one.floor, one.falling, one.standing)
        columns[:, list(one.nodes)] = [[float(x) for x in column] for column in each]
        limit = np.inf if one.cap is None else float(one.cap)
        decays.append((float(one.b), limit, float(one.left), columns[0], 0 * D, columns[1], *columns[2:]))
    for b, limit, left, away, drift, floor, p, n in decays:
        paced = np.minimum(g, limit)
        s = np.concatenate([[0.0], np.cumsum(np.minimum(paced[1:], paced[:-1]) * np.diff(t))])
        for v, order in enumerate(orders):
            fast = order > 1 and (b >= a1 or b > a2)
            if fast or (order > 2 and (b > gains[2] or a2 - b - b / (a1 - b) / k <= 0)):
                continue
            made = tracked(order, gains, b, k, g[0], away[v], (p[v], 0.0), (v0[v], acc[v]))
            drawn = tracked(order, gains, b, k, g[0], drift[v], (0.0, 0.0), (0.0, 0.0))[0]
            unrest = 0.0
            if push and cap is not None and order > 1:  # what it adds to y_n at T, about
                way = np.exp(-b * (s[-1] - s)) / g ** (order - 1)
                unrest = push * float((way[1:] * np.diff(t)).sum()) / (a1 - b) * 0.999
                unrest /= 1.0 if order == 2 else a2 - b - b / (a1 - b) / k
            least["position"][v] = min(least["position"][v], made[0] * left + drawn + floor[v] + unrest)
            if cap is None:
                continue
            steady = shaken(order, gains, k) if push and order > 1 else (0.0, 0.0)
            always = push / (gains[order - 1] * g[0] ** order)
            for key, power, falls, stands, shakes in zip(
                ("velocity", "input"), (1, order), made[1:], standing(order, gains, k), steady, strict=True
            ):
                # s is too small, and y too large, by less than a part in a thousand
                y = (g**power * np.exp(-b * s)).max() * 0.99
                stood = cap**power * (stands * n[v] + shakes * always)
                stood += push * (order == 1 and key == "velocity")
                least[key][v] = min(least[key][v], falls * y + stood)
    if "steps" in said and cap is not None and set(orders) == {2}:
        own = by_steps(data, modes[0], D, (a1, a2), v0, (T, rho1, k, cap), wrong, speed)
        for key, found in own.items():
            least[key][followers] = np.minimum(least[key], found)[followers]
    claims = {key: told[key] for key in least if key in told}
    return [
        f"{key} of {label}"
        for key, stated in claims.items()
        for v, label in enumerate(labels)
        if float(number(stated[label])) < least[key][v] * (1 - 1e-6)
    ]


# ---------------------------------------------------------------------- what is true is accepted


@pytest.mark.parametrize("name", CASES)
def test_every_combination_is_proved_checked_with_and_without_arrays_and_read_back(name: str, tmp_path: Any):
    certificate, data = certified(1, name), document(1, name)
    assert VALIDATOR.is_valid(data)
    for stdlib in (False, True):
        report = check(resealed(data), stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
    assert KIND[name in TEAMS] in {step["kind"] for step in data["proof"]}
    assert false_claims(data) == []
    certificate.save(tmp_path / "c.json")
    again, made = read_certificate(tmp_path / "c.json").late, certificate.late
    vehicles = made.vehicles
    assert again.vehicles.vehicles == vehicles.vehicles and again.vehicles.gains == vehicles.gains
    assert np.array_equal(again.vehicles.position, vehicles.position)
    t = np.array([0.5, 0.9, 0.99])
    for one, other in zip(again.vehicles_over_time(t), made.vehicles_over_time(t), strict=True):
        assert one == pytest.approx(other)


@pytest.mark.few(2)  # each once
@pytest.mark.parametrize("seed", range(1, 7))
@pytest.mark.parametrize("name", [name for name in CASES if "uncertain" not in name])
def test_no_run_exceeds_a_bound(seed: int, name: str):
    certificate = certified(seed, name)
    late, graph, protocol = certificate.late, certificate.graph, certificate.protocol
    tracking = late.tracking_protocol
    x0, vehicles = [float(x) for x in certificate.initial_state], late.vehicles.vehicles
    if late.messages.exact and late.leaders is None:
        cap = late.messages.gain_cap
        more = {} if cap is None else {"actuator": GainLimits(gain_cap=cap)}
        runs = [simulate(graph, protocol, x0, samples=1001, **more)]
    else:
        runs = [
            simulate_late(graph, protocol, late.messages, x0, pattern=pattern, leaders=late.leaders)
            for pattern in ("oldest", "square")
        ]
    like = late.leaders is not None and late.leaders.speed  # leaders move as they like
    moved = graph.in_weight() > 0 if like else np.ones(graph.n_nodes, dtype=bool)
    ends = np.asarray(certificate.final_state, dtype=float)[:, None]
    for run in (follow(one, tracking, vehicles) for one in runs):
        before = run.t < 0.999
        position, _ = late.vehicles_over_time(run.t[before])
        off = np.abs(run.states - (ends if run.targets is None else run.targets))
        assert (off[:, before] <= position * (1 + 1e-6) + 1e-6)[moved].all()
        at_T = int(np.argmax(run.remaining == 0))
        assert (off[:, at_T] <= late.vehicles.position + 1e-6)[moved].all()
        if late.vehicles.input is not None:
            up_to_T = run.remaining > 0
            assert (np.abs(run.input[:, up_to_T]).max(axis=1) <= late.vehicles.input * (1 + 1e-6))[moved].all()


@pytest.mark.parametrize("orders", [(2, 2, 2, 2, 2), (3, 1, 2, 3, 1)])
@pytest.mark.parametrize("cap", [None, 20, 2])
def test_cvodes_the_filters_and_the_expression_agree(cap: int | None, orders: tuple[int, ...]):
    graph, protocol, initial = problem(3, "plain")
    x0 = [float(x) for x in initial.x0]
    v0 = tuple(v if n > 1 else F(0) for v, n in zip(initial.v0, orders, strict=True))
    a0 = tuple(F(n == 3) * 4 for n in orders)
    vehicles = Team(v0, orders, a0 if 3 in orders else None)
    gains = (F(5, 2), F(3), F(2))[: max(orders)]
    tracking = TrackingProtocol(protocol.gain, gains, None if cap is None else F(cap), orders)
    run = simulate_vehicles(graph, tracking, x0, vehicles, samples=201)
    actuator = {} if cap is None else {"actuator": GainLimits(gain_cap=cap)}
    followed = follow_in_motion(simulate(graph, protocol, x0, samples=4001, **actuator), tracking, vehicles)
    early = run.t < 0.9
    for k, n in enumerate(orders):
        for i in range(n):
            seen = np.interp(run.t, followed.t, followed.states[k, 0, i])
            size = np.abs(run.states[k, 0, i][early]).max() + 1
            assert seen[early] == pytest.approx(run.states[k, 0, i][early], abs=1e-3 * size)
        seen = np.interp(run.t, followed.t, followed.input[k, 0])[early]
        assert seen == pytest.approx(run.input[k, 0][early], abs=5e-3 * np.abs(seen).max() + 1e-3)
    loop = tracking.closed_loop(graph)
    options = {"reltol": 1e-10, "abstol": 1e-12}
    solver = ca.integrator("f", "cvodes", {key: loop[key] for key in ("t", "x", "ode")}, 0, 0.5, options)
    begin = [*x0, *(v for v, n in zip(v0, orders, strict=True) if n > 1)]
    begin += [*(a for a, n in zip(a0, orders, strict=True) if n > 2)]
    begin += [*(x for x, n in zip(x0, orders, strict=True) if n > 1)]
    end = solver(x0=list(map(float, begin)))["xf"].full().ravel()[: graph.n_nodes]
    assert [np.interp(0.5, run.t, row) for row in run.positions[:, 0]] == pytest.approx(end, abs=1e-3)


def test_vehicles_lag_behind_leaders_that_move_from_the_deadline_on_too():
    """At a constant gain of 1 a ramp leaves ``2 age + 1`` of virtual positions, and ``1/a_1`` more of vehicles."""
    graph = SignedDigraph.from_edges([("L", "a", 1), ("L", "b", 1), ("a", "b", 1), ("b", "a", 1)])
    parts = {"messages": LateMessages(delay=1, gain_cap=1), "leaders": MovingLeaders(speed=1)}
    late = certify(graph, NominalProtocol(T=20), InitialState([0, 1, -1]), agents=VIRTUAL, **parts).late
    lag = 3 + 1 / float(late.vehicles.gains[0])
    assert lag <= late.after <= lag + 0.01
    assert late.vehicles.position.max() >= lag - 0.01


@pytest.mark.few(1)
@pytest.mark.parametrize("delay", ["0.03", 0])
@pytest.mark.parametrize("cap", [None, 30])
def test_the_bound_that_is_drawn_is_above_the_vehicles(cap: int | None, delay: str | int):
    graph = SignedDigraph.from_edges([("l", "a", 1), ("a", "b", -2), ("b", "a", "-0.5"), ("l", "b", -1)])
    initial, limits = InitialState([1, 2, -3], v0=[0, 1, -1]), None if cap is None else GainLimits(gain_cap=cap)
    beside = {"messages": LateMessages(delay=delay)} if delay else {"leaders": MovingLeaders(speed="0.4")}
    parts: dict[str, Any] = {"agents": VIRTUAL, "limits": limits, **beside}
    made = certify(graph, NominalProtocol(T=1, rho2=1, kappa=4), initial, **parts)
    run = made.asked_trajectory
    assert run is not None and run.vehicles and (delay or run.states[0, -1] != 1)
    aims = np.asarray(made.final_state, dtype=float)[:, None] if run.targets is None else run.targets
    away = np.abs(run.states - aims)
    inside = run.t <= 1
    bound = made.late.largest_bound(run.t[inside])
    assert (away[:, inside].max(axis=0) <= bound * (1 + 1e-6) + 1e-9).all() and bound[0] < 10
    assert (made.late.deviation_bound(run.t[inside]).max(axis=0) <= bound).all()
    lines = {line.get_label(): line.get_ydata() for line in made.plot("late", axis="time").lines}
    assert (lines["vehicles"] <= lines["proved bound"] * (1 + 1e-6) + 1e-9).all()


def test_vehicles_that_hear_at_once_are_on_their_targets_at_the_deadline_however_slowly_they_settle():
    """A chain in which each agent hears the next one far more than the one before: 100 corrections settle nothing."""
    heard = [(4, 6), (4, 6), (3, 3), (4, 14), (2, 14), (3, 16), (1, 15), (3, 19), (1, 6)]
    edges = [("L", "a0", 1), *((f"a{k}", f"a{k + 1}", on) for k, (on, _) in enumerate(heard))]
    edges += [(f"a{k + 1}", f"a{k}", back) for k, (_, back) in enumerate(heard)]
    graph, x0 = SignedDigraph.from_edges(edges), [0, *range(1, 11)]
    made = certify(graph, NominalProtocol(rho2=3, kappa=2), x0, agents=VIRTUAL, leaders=MovingLeaders(speed="0.5"))
    run = made.asked_trajectory
    at_T = int(np.argmax(run.remaining == 0))
    assert np.abs(run.states - run.targets)[:, at_T].max() < 1e-7 < np.abs(run.states - run.targets)[:, at_T - 1].max()


def test_vehicles_that_begin_on_their_targets_with_a_velocity_are_bounded():
    graph, initial = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 2)]), InitialState([1, 1, 1], v0=[0, 3, 0])
    limits = GainLimits(gain_cap=20)
    certificate = certify(graph, NominalProtocol(rho2=3), initial, agents=VIRTUAL, limits=limits)
    late = certificate.late
    position, velocity = late.vehicles.over_time(late.case, late.rows, np.array([0.0, 0.1]))
    assert position[1].min() > 0.01 and velocity[1, 0] >= 3
    assert position[2].max() < 1e-200 and certificate.checked.accepted


# ---------------------------------------------------------------------- forgeries


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "name",
    [
        "driven-late-moving",
        "team-late-capped",
        "shaken-late-moving",
        "late-capped",
        "late-moving",
        "uncertain-late-moving",
        "plain",
    ],
)
def test_no_mutant_of_what_is_said_of_vehicles_is_accepted_unless_it_is_true(name: str):
    data = document(2, name)
    of = next(i for i, step in enumerate(data["proof"]) if step["kind"] == KIND[name in TEAMS])
    kept = [one for one in mutants(data) if one[0][:2] in (PATH, ("proof", of))]
    count, passed = judged_mutants(data, iter(kept[::2]), false_claims)  # which judges each that is accepted
    assert count > 45 and passed  # larger bounds are true


@pytest.mark.parametrize(
    "name",
    [
        "capped",
        "late-capped",
        "late-moving",
        "uncertain",
        "team-capped",
        "team-late-moving",
        "shaken-capped",
        "driven-capped",
    ],
)
def test_bounds_without_a_part_of_their_formula_are_refused(name: str):
    data = document(2, name)
    told = at(data, PATH)
    for key, label in itertools.product(("position", "velocity", "input"), told["position"]):
        value = number(told[key][label])
        if value:
            less = changed(data, (*PATH, key, label), str(value * F(999, 1000)))
            report = check(resealed(less))
            assert not report.accepted and f"the {key} of agent {label}" in report.reason
    slow = changed(changed(data, (*PATH, "a1"), "1/1000"), (*PATH, "a2"), "1/1000")
    faster = {label: str(number(x) * 2 + 1) for label, x in told["v0"].items()}
    for forged in (slow, changed(data, (*PATH, "a2"), "1/1000"), changed(data, (*PATH, "v0"), faster)):
        assert not check(resealed(forged)).accepted


def test_bounds_of_the_virtual_positions_are_none_of_the_vehicles():
    data = document(2, "late-capped")
    less = changed(data, (*PATH, "position"), data["messages"]["residual"])
    assert "position" in (check(resealed(less)).reason or "")


def test_what_is_not_stated_and_what_is_not_proved_is_refused():
    free, capped, moving = document(1, "late"), document(1, "late-capped"), document(1, "late-moving")
    told = at(free, PATH)
    for data, path, value, why in (
        (free, (*PATH, "velocity"), told["position"], "iff the gain has a cap"),
        (capped, (*PATH, "input"), None, "input is null, and not left out"),
        (moving, ("messages", "leaders", "disturbance"), "1/10", "that of agents of order 1"),
        (free, (*PATH, "a1"), "0", "not positive"),
        (free, (*PATH, "orders"), told["v0"], "none of 1, 2 and 3"),
        (free, (*PATH, "a3"), "1", "a3 and a0 are there iff order 3 is"),
    ):
        assert why in (check(resealed(changed(data, path, value))).reason or "")
    assert "iff the gain has a cap" in (check(resealed(without(capped, (*PATH, "input")))).reason or "")
    leader = next(label for label, x in moving["messages"]["residual"].items() if not number(x))
    assert "a leader that moves" in (check(resealed(changed(moving, (*PATH, "v0", leader), "1"))).reason or "")
    alone = {key: x for key, x in document(1, "plain")["messages"].items() if key != "vehicles"}
    proof = [step for step in document(1, "plain")["proof"] if step["kind"] != "late-vehicles"]
    bare = {**document(1, "plain"), "messages": alone, "proof": proof}
    assert check(resealed(bare)).reason == "nothing is late or off, and leaders rest"


# ---------------------------------------------------------------------- what is not proved yet

SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ({"limits": GainLimits(stop_before="0.1")}, "stop_before"),
        ({"limits": GainLimits(sample_period="0.1")}, "sample_period"),
        ({"leaders": MovingLeaders(speed=1, sign_gain=1)}, "sign_gain"),
        ({"messages": LateMessages(delay=1, own_delay=True, gain_cap=1)}, "own_delay"),
        ({"protocol": SLIDING}, "protocol"),
        ({"asks": Asks(noise=1)}, "noise"),
        ({"asks": Asks(initial_set=1)}, "initial_set"),
    ],
)
def test_what_is_not_proved_of_vehicles_is_refused_by_name(parts: dict[str, Any], why: str):
    pair = SignedDigraph.from_edges([("a", "b", 1)])
    given = {"protocol": NominalProtocol(), "x0": [1, 2], "agents": VIRTUAL} | parts
    with pytest.raises(ParameterError, match=f"^{why}.*not proved yet where virtual positions are exchanged"):
        certify(pair, **given)


@pytest.mark.parametrize("name", ["drag", "rest", "cascade", "decay", "biases"])
def test_agents_that_exchange_virtual_positions_have_no_other_protocol(name: str):
    with pytest.raises(ParameterError, match=f"^{name}.*not proved yet"):
        Agents(order=2, exchange="virtual", **{name: [1, 2] if name == "biases" else 5})
    with pytest.raises(ParameterError, match="order 4: not proved yet"):
        Agents(order=4, exchange="virtual")
    with pytest.raises(ParameterError, match="single integrators exchange their positions as they are"):
        Agents(order=1, exchange="virtual")
    with pytest.raises(ParameterError, match="exchange"):
        Agents(order=2, exchange="everything")


def test_leader_groups_that_move_a_velocity_of_a_leader_and_planes_are_refused():
    group = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", 1)])
    for graph in (group, Family.from_graph(group)):
        with pytest.raises(HypothesisError, match="leaders"):
            certify(graph, NominalProtocol(), [1, 2, 3], agents=VIRTUAL, leaders=MovingLeaders(speed=1))
    pair, moving = SignedDigraph.from_edges([("a", "b", 1)]), MovingLeaders(speed=1)
    with pytest.raises(ParameterError, match="v0: of a is not 0, a leader that moves as it likes"):
        certify(pair, NominalProtocol(), InitialState([1, 2], v0=[1, 0]), agents=VIRTUAL, leaders=moving)
    with pytest.raises(ParameterError, match="one"):
        certify(pair, NominalProtocol(), [[1, 2], [2, 3]], agents=VIRTUAL)
    with pytest.raises(ParameterError, match="there are two"):
        two = {"messages": LateMessages(delay=1, gain_cap=1), "limits": GainLimits(gain_cap=2)}
        certify(pair, NominalProtocol(), [1, 2], agents=VIRTUAL, **two)


@pytest.mark.parametrize("name", ["capped", "plain", "moving"])
def test_bounds_over_time_are_those_of_the_gain_that_the_tracking_keeps_at_the_deadline(name: str):
    late = certified(0, name).late
    T = float(late.gain.gain.T)
    position, velocity = late.vehicles.over_time(late.case, late.rows, T * np.array([1 - 1e-9, 1, 1.5]))
    assert late.largest_bound(0.5 * T).shape == (1,) and not np.isnan(velocity).any()
    if name == "plain":
        assert np.isinf(velocity[:, 1:]).all() and np.isinf(position[:, 2]).all()
        return
    chosen = late.followers
    assert velocity[chosen, 1] == pytest.approx(velocity[chosen, 0], rel=1e-6)
    assert (velocity[:, :2] <= late.vehicles.velocity[:, None]).all() and np.isinf(velocity[chosen, 2]).all()
    assert (position[chosen, 2] <= (position[chosen, 1] if late.leaders is None else late.after)).all()


@pytest.mark.parametrize("parts", [{"limits": GainLimits(gain_cap=5)}, {"messages": LateMessages("0.1", gain_cap=5)}])
def test_the_input_at_the_deadline_is_that_just_before_it(parts: dict[str, Any]):
    graph, protocol = SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1)]), NominalProtocol(T=1, rho1="0.1", rho2=1)
    asks = Asks(simulation=False)
    late = certify(graph, protocol, InitialState([0, 5, -5], v0=[0, 1, 0]), agents=VIRTUAL, asks=asks, **parts).late
    virtual = run_virtual_positions(graph, protocol, late.messages, [0, 5, -5])
    run = follow(virtual, late.tracking_protocol, late.messages.vehicles)
    end = int(np.argmax(run.remaining == 0))
    near = int(np.flatnonzero(run.remaining > 1e-5)[-1])
    assert np.abs(run.held_input[:, near]).max() > 0.1
    assert run.held_input[:, end] == pytest.approx(run.held_input[:, near], abs=1e-2)
