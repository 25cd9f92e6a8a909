"""Leaders that hear each other: late messages, errors, caps and vehicles, of graphs and of families, by forms."""

from __future__ import annotations

import itertools
import json
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mutations import Json, changed, judged_mutants, mutants, resealed, without
from oracle import number
from schema_validator import VALIDATOR

from ptcc_certify import read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, GainLimits, InitialState
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.simulation.late_messages import simulate_late
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.virtual_positions import follow

F = Fraction
VIRTUAL = {"agents": Agents(order=2, exchange="virtual")}
CAP = {"limits": GainLimits(gain_cap=12)}
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=3, kappa=1)
#: A ring with two camps and a chord, and one follower.
RING = [("a", "b", "1.5"), ("b", "c", -1), ("c", "a", -2), ("b", "a", 1), ("c", "d", "-0.5")]
#: The same camps, other edges.
OTHER = [("b", "a", 2), ("a", "c", -1), ("c", "b", "-1.5"), ("a", "d", "0.5")]
BEGIN, SPEEDS = [3, -1, 2, 5], [1, 0, -2, "0.5"]
OFF = {"messages": LateMessages(value_error="0.02", gain_cap=12)}
LATE = {"messages": LateMessages(delay="0.0005", gain_cap=12)}
BOTH = {"messages": LateMessages(delay="0.0005", value_error="0.02", gain_cap=12)}
BEHIND = {"messages": LateMessages({("c", "d"): "0.01"})}
#: What is asked of one graph, and of families.
OF_GRAPH: dict[str, dict[str, Any]] = {
    "off": OFF,
    "both": BOTH,
    "vehicles": VIRTUAL,
    "vehicles-capped": VIRTUAL | CAP,
    "vehicles-off": VIRTUAL | OFF,
    "vehicles-late": VIRTUAL | LATE,
    "vehicles-both": VIRTUAL | BOTH,
    "vehicles-behind": VIRTUAL | BEHIND,
}
OF_FAMILY: dict[str, dict[str, Any]] = {
    "capped": CAP,
    "late": LATE,
    "vehicles": VIRTUAL,
    "vehicles-capped": VIRTUAL | CAP,
    "vehicles-late": VIRTUAL | LATE,
    "off": {"messages": LateMessages(value_error="0.02")},
    "disturbed": {"asks": Asks(delta="0.3")},
    "disturbed-capped": {"asks": Asks(delta="0.3"), **CAP},
    "all": {"asks": Asks(delta="0.3"), **BOTH},
}
TOP = ("messages",)


def asked(parts: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    return InitialState(BEGIN, v0=SPEEDS) if "agents" in parts else BEGIN, parts


@cache
def of_graph(name: str) -> Any:
    begin, parts = asked(OF_GRAPH[name])
    return certify(SignedDigraph.from_edges(RING), PROTOCOL, begin, asks=Asks(simulation=False), **parts)


@cache
def of_family(name: str) -> Any:
    begin, parts = asked(OF_FAMILY[name])
    graphs = [SignedDigraph.from_edges(edges, ["a", "b", "c", "d"]) for edges in (RING, OTHER)]
    return certify(graphs, PROTOCOL, begin, uncertainty="5%", **parts)


def document(certificate: Any) -> Json:
    return {**json.loads(certificate.to_json()), "unverified": {}}


def reason(data: Json) -> str:
    report = check(resealed(data))
    assert not report.accepted
    return f"{report.rejected}: {report.reason}"


# ---------------------------------------------------------------------- what is true is accepted


@pytest.mark.parametrize(("kind", "name"), [*(("graph", x) for x in OF_GRAPH), *(("family", x) for x in OF_FAMILY)])
def test_it_is_proved_checked_with_and_without_arrays_and_read_back(kind: str, name: str, tmp_path: Path):
    made = of_graph(name) if kind == "graph" else of_family(name)
    data = document(made)
    assert VALIDATOR.is_valid(data)
    for stdlib in (False, True):
        report = check(resealed(data), stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
    assert false_claims(data) == []
    made.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json").late
    t = np.array([0.0, 0.5, 0.99, 1.0])
    assert again.largest == made.late.largest and np.array_equal(again.largest_bound(t), made.late.largest_bound(t))
    assert again.inputs is None or np.array_equal(again.inputs, made.late.inputs)
    assert made.late.largest < (2 if kind == "graph" else 60)


@pytest.mark.parametrize("name", OF_GRAPH)
def test_no_run_of_a_graph_exceeds_a_bound(name: str):
    made = of_graph(name)
    late, graph, x0 = made.late, made.graph, [float(x) for x in made.initial_state]
    if late.messages.exact:
        actuator = None if late.messages.gain_cap is None else GainLimits(gain_cap=late.messages.gain_cap)
        runs = [simulate(graph, PROTOCOL, x0, samples=1001, actuator=actuator)]
    else:
        runs = [simulate_late(graph, PROTOCOL, late.messages, x0, pattern=one) for one in ("oldest", "square")]
    ends = np.asarray(made.final_state, dtype=float)[:, None]
    for run in runs:
        moved = run if late.vehicles is None else follow(run, late.tracking_protocol, late.vehicles.vehicles)
        before, up_to_T = moved.t < 0.999, moved.remaining > 0
        off, at_T = np.abs(moved.states - ends), int(np.argmax(moved.remaining == 0))
        if late.vehicles is None:
            bound = np.minimum.reduce([one.over_time(late.case, moved.t[before]).bound for one in late.of_all])
        else:
            bound = late.vehicles_over_time(moved.t[before])[0]
        assert (off[:, before] <= bound * (1 + 1e-6) + 1e-6).all()
        assert (off[:, at_T] <= np.minimum.reduce(late.residuals) + 1e-6).all()
        if late.inputs is not None:
            assert (np.abs(moved.input[:, up_to_T]).max(axis=1) <= late.inputs * (1 + 1e-6)).all()


def worst_runs(data: Json, rng: np.random.Generator, steps: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions up to ``T``, inputs, and where agents settle, of a signal, of weights and ages drawn at random."""
    said, gain = data["messages"], data["problem"]["gain"]
    T, rho1, k = (float(number(gain[key])) for key in ("T", "rho1", "rho2"))
    cap = float(number(said["gain_cap"])) if "gain_cap" in said else np.inf
    error, push = float(number(said["value_error"])), float(number(said.get("leaders", {}).get("disturbance", "0")))
    modes, told = weights_of(data), said.get("vehicles")
    labels = data["problem"]["graph"]["nodes"]
    x = np.array([float(number(data["problem"]["initial_state"][label])) for label in labels])
    a1, a2 = (0.0, 0.0) if told is None else (float(number(told[key])) for key in ("a1", "a2"))
    r1, r2 = np.zeros((2, x.size))
    r2 += 0 if told is None else [float(number(told["v0"][label])) for label in labels]
    dt, seen, moved, most = T / steps, [x], [x], np.zeros(x.size)
    old = int(float(number(said["delay"])) / dt)
    for i in range(steps + 40_000):
        t = (i + 0.5) * dt
        free = rho1 + k / (T - t) if t < T else rho1
        g, rise = min(free, cap), k / (T - t) ** 2 if t < T and free < cap else 0.0
        if i % 150 == 0:
            low, high = modes[int(rng.integers(len(modes)))]
            W, d = low + (high - low) * rng.random(low.shape), push * rng.choice([-1, 1], x.size)
            off = error * np.abs(W).sum(axis=1) * rng.choice([-1, 1], x.size)
        e = W @ seen[max(0, len(seen) - 1 - int(rng.integers(0, old + 1)))] - np.abs(W).sum(axis=1) * x + off
        v = r2 - a1 * g * r1
        u = g * e if told is None else -a1 * rise * r1 - a1 * g * (v - g * e) - a2 * g * r2
        most = np.maximum(most, np.abs(u)) if i < steps else most
        r1, r2 = r1 + (0 if told is None else dt * (v - g * e)), r2 * (1 - dt * a2 * g)
        x = x + dt * (g * e + (d if i < steps else 0))
        seen.append(x)
        moved.append(x + r1)
    return np.array(moved[: steps + 1]).T, most, x


@pytest.mark.few(1)
@pytest.mark.parametrize("name", OF_FAMILY)
def test_no_run_of_a_member_exceeds_a_bound(name: str):
    made, data = of_family(name), document(of_family(name))
    for seed in range(3):
        x, push, end = worst_runs(data, np.random.default_rng(seed))
        t = np.linspace(0, 1, x.shape[1])[:-40:20]
        bound = made.late.largest_bound(t)
        aims = end[:, None] if made.late.messages.settles else np.outer([1, 1, -1, 1], x[0])
        off = np.abs(x - aims).max(axis=0)
        assert (off[:-40:20] <= bound * 1.01 + 1e-3).all()
        if made.late.messages.gain_cap is not None:
            assert off[-1] <= made.late.largest * 1.01 + 1e-3
            assert (push <= made.late.inputs * 1.01).all()


# ---------------------------------------------------------------------- by hand, in floats


def weights_of(data: Json) -> list[tuple[np.ndarray, np.ndarray]]:
    """The signed weights of every mode, the smallest and the largest ones."""
    labels = data["problem"]["graph"]["nodes"]
    index, modes = {label: v for v, label in enumerate(labels)}, []
    for mode in data["problem"]["graph"]["modes"]:
        low, high = np.zeros((2, len(labels), len(labels)))
        for edge in mode["edges"]:
            ends = sorted((float(number(x)) for x in edge[2:]), key=abs)
            low[index[edge[1]], index[edge[0]]], high[index[edge[1]], index[edge[0]]] = ends[0], ends[-1]
        modes.append((low, high))
    return modes


def largest(values: np.ndarray, b: float, data: Json, power: int = 1) -> np.ndarray:
    """``sup_t g^power e^(-b s)`` times these, a part in a thousand too small."""
    gain, said = data["problem"]["gain"], data["messages"]
    T, rho1, k = (float(number(gain[key])) for key in ("T", "rho1", "rho2"))
    t = np.unique(np.concatenate([np.linspace(0, T, 20001)[:-1], T - np.geomspace(1e-9, 1, 4000) * T]))
    g = np.minimum(rho1 + k / (T - t), float(number(said["gain_cap"])))
    s = np.concatenate([[0.0], np.cumsum((g[1:] + g[:-1]) / 2 * np.diff(t))])
    return values * (g**power * np.exp(-b * s)).max() * 0.999


def left_at_T(data: Json, b: float) -> float:
    """``e^(-b s(T))``, 0 without a cap."""
    gain, said = data["problem"]["gain"], data["messages"]
    if "gain_cap" not in said:
        return 0.0
    T, rho1, k = (float(number(gain[key])) for key in ("T", "rho1", "rho2"))
    cap = float(number(said["gain_cap"]))
    turn = max(T - k / (cap - rho1), 0.0)
    return float(np.exp(-b * (rho1 * turn + k * np.log(T / (T - turn)) + cap * (T - turn))))


def drift(data: Json, b: float) -> float:
    """``int_0^T e^(-b (s(T) - s(t))) dt``, a part in a thousand too small; 0 without a cap."""
    gain, said = data["problem"]["gain"], data["messages"]
    if "gain_cap" not in said:
        return 0.0
    T, rho1, k = (float(number(gain[key])) for key in ("T", "rho1", "rho2"))
    t = np.linspace(0, T, 40001)[:-1] + T / 80000
    g = np.minimum(rho1 + k / (T - t), float(number(said["gain_cap"])))
    ahead = np.cumsum(g[::-1])[::-1] * T / 40000
    return float(np.exp(-b * ahead).sum() * T / 40000 * 0.999)


def by_agent(data: Json, values: Json) -> np.ndarray:
    return np.array([float(number(values[label])) for label in data["problem"]["graph"]["nodes"]])


def symmetric(lower: list[list[Any]]) -> np.ndarray:
    n = len(lower)
    return np.array([[float(number(lower[max(i, j)][min(i, j)])) for j in range(n)] for i in range(n)])


def decays(data: Json) -> tuple[list[dict[str, Any]], list[str]]:
    """What forms say of all agents, by their conditions; and which of these do not hold."""
    said, false, found = data["messages"], list[str](), list[dict[str, Any]]()
    modes, x0 = weights_of(data), by_agent(data, data["problem"]["initial_state"])
    h = float(number(said["delay"])) * float(number(said.get("gain_cap", "0")))
    error, n = float(number(said["value_error"])), len(x0)
    disturbance = float(number(said.get("leaders", {}).get("disturbance", "0")))
    error += disturbance * float(number(said["delay"]))
    for step in (one for one in data["proof"] if one["kind"] == "late-form"):
        q, b, kap = (float(number(step["numbers"][key])) for key in ("q", "b", "kap"))
        function, phi = data["decays"][step["witness"]["function"]], by_agent(data, step["witness"]["phi"])
        family = step["of"] != "messages.form"
        told = said["forms"][int(step["of"][15:-1])] if family else said["form"]
        camps = np.array([1, 1, -1, 1])
        free = [1, 2, 3]
        C = np.eye(n)[free] - np.outer(camps[free] * camps[0], np.eye(n)[0])
        laplacians = [
            np.diag(np.abs(W).sum(axis=1)) - W
            for low, high in modes
            for chosen in itertools.product([0, 1], repeat=int((low != high).sum()))
            for W in [filled(low, high, chosen)]
        ]
        if family:
            P = symmetric(function["lower_triangle"])
            inverse = np.linalg.inv(P)
            rows = np.max([np.einsum("ki,ij,kj->k", L[:, free], inverse, L[:, free]) for L in laplacians], axis=0)
            root = np.sqrt(x0 @ C.T @ P @ C @ x0)
            norm = C.T @ P @ C
        else:
            (L,) = laplacians
            Q = np.zeros((n, n)) if P_of(function) is None else P_of(function)
            P, inverse = Q, np.linalg.pinv(Q)
            rows = np.diag(inverse)
            root, norm = np.sqrt(x0 @ L.T @ P @ L @ x0), L.T @ P @ L
        heard = [np.abs(high) @ phi for _, high in modes]
        pushes = [w * signs for w in heard for signs in itertools.product([-1, 1], repeat=n)]
        least = max(np.sqrt(push @ norm @ push) for push in map(np.array, pushes))
        rate = float(number(function["rate"]))
        holds = {
            "q": q >= np.exp(b * h) * (1 - 1e-12),
            "phi": (phi >= (np.sqrt(np.maximum(rows, 0)) + h * q * np.max(heard, axis=0)) * (1 - 1e-7)).all(),
            "kap": b > 0 and kap >= least * (1 - 1e-9) and b + h * q * kap <= rate / 2 * (1 + 1e-12),
            "left": float(number(told["left"])) >= left_at_T(data, b) * (1 - 1e-9),
        }
        floor, psi = 0.0, np.zeros(n)
        if error:
            floor, psi = float(number(told["floor"])), by_agent(data, step["witness"]["psi"])
            off = np.max([h * (np.abs(W) @ psi) + error * np.abs(W).sum(axis=1) for _, W in modes], axis=0)
            worst = max(
                np.sqrt((off * s) @ norm @ (off * s)) for s in map(np.array, itertools.product([-1, 1], repeat=n))
            )
            holds["floor"] = family or floor * rate / 2 >= worst * (1 - 1e-9)
            for _, W in modes if family else ():
                of_mode = h * (np.abs(W) @ psi) + error * np.abs(W).sum(axis=1)
                signed = (of_mode * s for s in map(np.array, itertools.product([-1, 1], repeat=n)))
                least_floor = max(np.sqrt(y @ norm @ y) for y in signed)
                holds["floor"] &= floor * rate / 2 >= least_floor * (1 - 1e-9)
            holds["psi"] = (psi >= (np.sqrt(rows) * floor + off) * (1 - 1e-7)).all()
        one = {"b": b, "left": left_at_T(data, b), "falling": phi * root, "standing": psi}
        if family:
            holds["initial"] = float(number(told["initial"])) >= root * (1 - 1e-9)
            one |= {"away": phi * root / b, "floor": np.zeros(n)}
            if disturbance:
                ones = map(np.array, itertools.product([-1, 1], repeat=n))
                push = disturbance * max(np.sqrt(s @ norm @ s) for s in ones)
                holds["push"] = float(number(told["push"])) >= push * (1 - 1e-9)
                first = sum(float(number(data["problem"]["gain"][key])) for key in ("rho1", "rho2"))
                g0 = min(first, float(number(said.get("gain_cap", "1e9"))))
                one["standing"] = psi + phi * push / (b * g0)
            if error or disturbance:
                sizes = np.zeros(n)
                sizes[free] = np.sqrt(np.diag(inverse))
                holds["sizes"] = (by_agent(data, told["sizes"]) >= sizes * (1 - 1e-7)).all()
                drive = push * drift(data, b) if disturbance else 0.0
                one |= {"away": sizes * root, "floor": sizes * (floor + drive)}
        else:
            away, moved = (by_agent(data, told[key]) for key in ("away", "moved"))
            deviation = by_agent(data, function["deviation"]["agents"])
            holds["away"] = (away >= np.sqrt(deviation) * root * (1 - 1e-7)).all()
            one |= {"away": np.sqrt(deviation) * root, "floor": moved}
            residual = by_agent(data, told["residual"])
            holds["residual"] = (residual >= (moved + one["away"] * one["left"]) * (1 - 1e-7)).all()
        false += [f"{key} of {step['of']}" for key, true in holds.items() if not true]
        found.append(one)
    for step in (one for one in data["proof"] if one["kind"] == "late-lmi"):
        b = float(number(step["numbers"]["b"]))
        away, moved = (by_agent(data, said["lmi"][key]) for key in ("away", "moved"))
        found.append({"b": b, "left": left_at_T(data, b), "away": away, "floor": moved})
    return found, false


def filled(low: np.ndarray, high: np.ndarray, chosen: tuple[int, ...]) -> np.ndarray:
    W = low.copy()
    W[low != high] = np.where(chosen, high[low != high], low[low != high])
    return W


def P_of(function: Json) -> np.ndarray | None:
    """``P`` of a function in the coordinates ``E`` of the four agents, in floats."""
    labels, rho = ["a", "b", "c", "d"], float(number(function.get("rho", "1")))
    P = np.zeros((4, 4))
    if "lower_triangle" in function:
        own = [labels.index(label) for label in function["nodes"]]
        P[np.ix_(own, own)] = symmetric(function["lower_triangle"])
        return P
    for block in function["blocks"]:
        own = [labels.index(label) for label in block["nodes"]]
        part = (
            np.diag([float(number(x)) for x in block["diagonal"]])
            if "diagonal" in block
            else symmetric(block["lower_triangle"])
        )
        P[np.ix_(own, own)] = part * (rho if block["times_rho"] else 1)
    return P


def false_claims(data: Json) -> list[str]:
    """What is stated and does not follow."""
    said, (found, false) = data["messages"], decays(data)
    capped, told = "gain_cap" in said, said.get("vehicles")
    least: dict[str, np.ndarray] = {}

    def offer(key: str, bound: np.ndarray) -> None:
        least[key] = np.minimum(least.get(key, np.full(4, np.inf)), bound)

    for one in found:
        b, left, whole = one["b"], one["left"], "falling" in one
        offer("residual", one["away"] * left + one["floor"])
        if whole and capped:
            cap = float(number(said["gain_cap"]))
            offer("input", largest(one["falling"], b, data) + cap * one["standing"])
        elif whole and "input" in said:
            rho1, k = (float(number(data["problem"]["gain"][key])) for key in ("rho1", "rho2"))
            p, g0 = b * k, rho1 + k
            if p > 1:
                offer("input", g0 * one["falling"] + b * g0 * one["standing"] * (rho1 + k) / (p - 1))
        if told is None:
            continue
        a1, a2, k = (float(number(x)) for x in (told["a1"], told["a2"], data["problem"]["gain"]["rho2"]))
        v0, g0 = np.abs(by_agent(data, told["v0"])), float(number(data["problem"]["gain"]["rho1"])) + k
        if b >= a1 or b > a2:
            continue
        lag, c = 1 / (a1 - b), max(a1 * a1, a1 / k - a1 * a1)
        offer("position", a1 * lag * one["away"] * left + one["floor"] + v0 * lag * left / g0)
        if whole and capped:
            p, n = one["falling"], one["standing"]
            offer("velocity", largest(v0 * (1 + a1 * lag) / g0 + a1 * lag * p, b, data) + cap * n)
            push = largest(v0 * (c * lag + a1 + a2) / g0 + (c * lag + a1) * p, b, data, 2)
            offer("push", push + (c / a1 + a1) * cap**2 * n)
    claims = {key: said[key] for key in ("residual", "input") if key in said}
    claims |= {
        {"input": "push"}.get(key, key): told[key] for key in ("position", "velocity", "input") if told and key in told
    }
    by_matrices = "lmi" in said or "settling" in said  # which say more of inputs
    for key, stated in claims.items():
        if not (by_matrices and key != "position") and key in least:
            low = by_agent(data, stated) < least[key] * (1 - 1e-6)
            false += [f"{key} of {v}" for v in np.flatnonzero(low)]
    return false


# ---------------------------------------------------------------------- forgeries


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *(("graph", "vehicles-off"), ("graph", "both"), ("family", "vehicles-late"), ("family", "capped")),
        *(("family", "off"), ("family", "disturbed"), ("family", "all")),
    ],
)
def test_no_mutant_of_what_is_said_is_accepted_unless_it_is_true(kind: str, name: str):
    data = document(of_graph(name) if kind == "graph" else of_family(name))
    own = {i for i, step in enumerate(data["proof"]) if step["kind"].startswith("late-")}
    parts = {("messages", key) for key in data["messages"]} | {("proof", i) for i in own}
    chosen = [one for one in mutants(data) if one[0][:2] in parts]
    count, passed = judged_mutants(data, iter(chosen[::3]), false_claims)
    assert count > 30 and passed


@pytest.mark.parametrize("name", ["off", "both", "vehicles-off", "vehicles-capped"])
def test_what_a_form_states_too_small_is_refused(name: str):
    data = document(of_graph(name))
    of = next(i for i, step in enumerate(data["proof"]) if step["kind"] == "late-form")
    for key in ("moved", "away", "residual"):
        for label, x in data["messages"]["form"][key].items():
            if number(x):
                less = changed(data, (*TOP, "form", key, label), str(number(x) * F(999, 1000)))
                assert f"{key} of agent {label} is not proved" in reason(less)
    keys = ["phi", "psi"] if number(data["messages"]["value_error"]) else ["phi"]
    for key in keys:
        for label, x in data["proof"][of]["witness"][key].items():
            path = ("proof", of, "witness", key, label)
            assert f"{key} of agent {label} is too small" in reason(changed(data, path, str(number(x) * F(99, 100))))
            assert "is negative" in reason(changed(data, path, f"-{x}"))
    if "psi" in keys:
        less = str(number(data["messages"]["form"]["floor"]) * F(1, 2))
        assert "floor is too small" in reason(changed(data, (*TOP, "form", "floor"), less))
        assert "iff values are off" in reason(without(data, (*TOP, "form", "floor")))
        assert "iff values are off" in reason(without(data, ("proof", of, "witness", "psi")))
        assert "own state" in reason(changed(data, (*TOP, "own"), "late"))
        assert "form without a cap" in reason(without(without_inputs(data), (*TOP, "gain_cap")))


def without_inputs(data: Json) -> Json:
    said = {key: x for key, x in data["messages"].items() if key not in ("input", "vehicles")}
    proof = [step for step in data["proof"] if step["kind"] not in ("late-input", "late-vehicles")]
    return {**data, "messages": said, "proof": proof}


def test_without_a_cap_nothing_is_left_of_what_comes_at_once():
    data = document(of_graph("vehicles"))
    assert number(data["messages"]["form"]["left"]) == 0 and of_graph("vehicles").late.largest == 0
    assert "left is not 0" in reason(changed(data, (*TOP, "form", "left"), "1/100"))
    late = changed(changed(data, (*TOP, "delay"), "1/100"), (*TOP, "latency"), "1/100")
    assert "form without a cap" in reason(late)


@pytest.mark.parametrize("name", OF_FAMILY)
def test_what_is_stated_of_a_family_too_small_is_refused(name: str):
    data = document(of_family(name))
    of = next(i for i, step in enumerate(data["proof"]) if step["kind"] == "late-form")
    entry = data["messages"]["forms"][0]
    for key, said in (("floor", "floor"), ("push", "push")):
        if key in entry:
            less = changed(data, (*TOP, "forms", 0, key), str(number(entry[key]) * F(1, 2)))
            assert f"{said} is too small" in reason(less)
            assert "told iff" in reason(without(data, (*TOP, "forms", 0, key)))
    for label, x in entry.get("sizes", {}).items():
        if number(x):
            less = changed(data, (*TOP, "forms", 0, "sizes", label), str(number(x) * F(99, 100)))
            assert f"size of agent {label} is too small" in reason(less)
    for label, x in data["proof"][of]["witness"].get("psi", {}).items():
        less = changed(data, ("proof", of, "witness", "psi", label), str(number(x) * F(9, 10)))
        assert f"psi of agent {label} is too small" in reason(less)
    for path, why in (
        ((*TOP, "forms", 0, "initial"), "initial is not proved"),
        (("proof", of, "numbers", "kap"), "kap is too small"),
    ):
        old = data["proof"][of]["numbers"]["kap"] if path[0] == "proof" else data["messages"]["forms"][0]["initial"]
        assert why in reason(changed(data, path, str(number(old) * F(999, 1000))))
    for label, x in data["proof"][of]["witness"]["phi"].items():
        less = changed(data, ("proof", of, "witness", "phi", label), str(number(x) * F(99, 100)))
        assert f"phi of agent {label} is too small" in reason(less)
        turned = changed(data, ("proof", of, "witness", "phi", label), f"-{x}")
        assert f"phi of agent {label} is negative" in reason(turned)
    for label, x in data["messages"]["residual"].items():
        if number(x):
            less = changed(data, (*TOP, "residual", label), str(number(x) * F(999, 1000)))
            assert f"residual of agent {label} is not proved" in reason(less)
    rate = number(data["decays"][data["proof"][of]["witness"]["function"]]["rate"])
    numbers, phi = data["proof"][of]["numbers"], data["proof"][of]["witness"]["phi"]
    wide = changed(data, ("proof", of, "numbers", "q"), str(number(numbers["q"]) * F(102, 100)))
    wide = changed(wide, ("proof", of, "witness", "phi"), {key: str(number(x) * F(105, 100)) for key, x in phi.items()})
    wide = changed(wide, ("proof", of, "numbers", "kap"), str(number(numbers["kap"]) * F(110, 100)))
    wide = changed(wide, (*TOP, "forms", 0, "left"), "1")
    assert "more than the rate" in reason(changed(wide, ("proof", of, "numbers", "b"), str(rate * F(51, 100))))
    assert "no such Lyapunov function" in reason(changed(data, ("proof", of, "witness", "function"), 99))
    swapped = ["b", "a", "c", "d"]
    assert "nodes" in reason(changed(data, (*TOP, "forms", 0, "nodes"), swapped))
    if not number(data["messages"]["value_error"]):
        assert reason(changed(data, (*TOP, "value_error"), "1/100"))
    if "gain_cap" in data["messages"]:
        moving = {"speed": "1", "disturbance": "0"}
        assert "leaders move" in reason(changed(data, (*TOP, "leaders"), moving))
        assert "left is not proved" in reason(changed(data, (*TOP, "forms", 0, "left"), "1/1000000000"))


def test_forms_are_of_families_and_form_is_of_one_graph():
    graph, family = document(of_graph("both")), document(of_family("late"))
    forms = family["messages"]["forms"]
    stated = {"forms": forms, "residual": graph["messages"]["form"]["residual"]}
    assert reason({**graph, "messages": {**graph["messages"], **stated}})
    assert "of a family" in reason({**family, "messages": {**family["messages"], "form": graph["messages"]["form"]}})


def test_a_vector_that_is_not_positive_proves_no_delay():
    """Long delays of two agents that mirror each other: ``phi >= c + h q B phi`` with entries below 0, which cancel."""
    data = json.loads(Path(__file__).with_name("negative_phi.json").read_text("utf-8"))
    for stdlib in (False, True):
        report = check(data, stdlib=stdlib)
        assert not report.accepted and report.reason == "phi of agent b is negative"


# ---------------------------------------------------------------------- what is asked


def test_who_rests_alone_beside_a_group_keeps_its_place():
    family = [("a", "b", 1), ("b", "a", 2)]
    graph = SignedDigraph.from_edges(family, ["a", "b", "z"])
    begin = InitialState([1, 2, 3], v0=[0, 1, 1])
    made = certify(graph, PROTOCOL, begin, uncertainty="10%", **VIRTUAL, **LATE)
    assert made.checked.accepted and 0 < made.late.vehicles.position[2] < 0.01
    still = certify(graph, PROTOCOL, [1, 2, 3], uncertainty="10%", **LATE)
    assert still.checked.accepted and still.late.residual[2] == 0 and still.late.largest_bound([0.5])[0] < 10


@pytest.mark.parametrize("name", ["capped", "late", "vehicles", "disturbed", "off"])
def test_without_an_initial_state_it_is_left_open(name: str):
    graphs = [SignedDigraph.from_edges(edges, ["a", "b", "c", "d"]) for edges in (RING, OTHER)]
    made = certify(graphs, PROTOCOL, **OF_FAMILY[name])
    assert made.checked.accepted and not made.late.says_something
    assert int(made.assessment.exit_code) == 4 and "initial state" in made.assessment.text


def test_a_delay_that_is_not_forgiven_is_left_open():
    begin, parts = asked({"messages": LateMessages(delay="0.5", gain_cap=12)})
    graphs = [SignedDigraph.from_edges(edges, ["a", "b", "c", "d"]) for edges in (RING, OTHER)]
    made = certify(graphs, PROTOCOL, begin, **parts)
    assert made.verdict == "certified" and not made.late.says_something and int(made.assessment.exit_code) == 4


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ({"messages": LateMessages(delay="0.01")}, "add a gain cap"),
        ({"leaders": MovingLeaders(speed=1)}, "leave it out"),
        (VIRTUAL | OFF, "leave out the vehicles"),
    ],
)
def test_of_a_family_with_a_leader_group_the_rest_is_refused(parts: dict[str, Any], why: str):
    graphs = [SignedDigraph.from_edges(edges, ["a", "b", "c", "d"]) for edges in (RING, OTHER)]
    with pytest.raises(HypothesisError, match=f"leads and hears others: {why}"):
        certify(graphs, PROTOCOL, BEGIN, **parts)
