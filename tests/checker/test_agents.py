"""Certificates of agents of order n: true ones are accepted, forged ones rejected for the reason that makes them false.

The documents are made by hand, in ``agent_documents``; ``oracle_agents`` judges them from the closed loop.
"""

from __future__ import annotations

import copy
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from agent_cases import agent_case
from agent_documents import Setting, damping_bound, document, final_state, obligations, of_graph
from asked import certify_family, certify_words
from cpu_time import at_most
from generators import all_classes, random_graph
from mutations import Json, at, changed, judged_mutants, mutants, nudged, part_of, resealed
from oracle_agents import false_claims_of_agents
from schema_validator import VALIDATOR

from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check, common_motion
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol

F = Fraction
CLASSES = dict(all_classes())
#: Two camps of three that hear each other, and a follower that is an enemy of one.
CAMPS = [("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)]
#: Unbalanced: three that are all enemies.
ENEMIES = [("a", "b", -1), ("b", "c", -2), ("c", "a", -1), ("b", "a", -1)]
#: Two single leaders, one of them an enemy of a follower.
SINGLES = [("a", "f", 1), ("b", "f", -2), ("f", "g", 1)]

PLAIN = Setting()
SETTINGS = {
    "double integrators": PLAIN,
    "drag in the plane": Setting(plant=(F(0), F(1, 3)), dimension=2),
    "oscillators, three pieces": Setting(plant=(F(1), F(-1, 3)), pieces=3, R=F(5)),
    "no rho1": Setting(order=3, rho1=F(0)),
    "order 1": Setting(order=1),
    "at rest": Setting(damping=F(2), plant=(F(0), F(1, 3))),
    "at rest without drag or rho1": Setting(damping=F(1), rho1=F(0)),
    "damped too little": Setting(damping=F(1, 2)),
    "damped and driven": Setting(damping=F(1), plant=(F(0), F(-1))),
    "capped later": Setting(cap=F(7), R=F(5)),
    "capped from the beginning": Setting(cap=F(1, 2), plant=(F(1, 2), F(1))),
    "sliding variables": Setting(slides=True, dimension=2, plant=(F(1), F(0))),
    "every Lyapunov function": Setting(order=3, method="best"),
    "no states": Setting(start=False),
}


def graph_of(edges: list[Any]) -> SignedDigraph:
    return SignedDigraph.from_edges(edges)


@cache
def made(name: str = "double integrators", kind: str = "camps") -> Json:
    edges = {"camps": CAMPS, "enemies": ENEMIES, "singles": SINGLES}[kind]
    return document(graph_of(edges), SETTINGS[name], len(name))


def accepted(data: Json) -> None:
    for stdlib in (True, False):
        report = check(data, stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
        assert report.verdict == data["verdict"] and len(report.obligations) == len(data["proof"])


def with_agents(data: Json, **parts: Any) -> Json:
    """The same with other parts of ``agents``, None: left out, and the obligations that belong to them."""
    told = {**data["agents"], **parts}
    data = {**data, "agents": {key: x for key, x in told.items() if x is not None}}
    own = obligations(data["agents"])
    of_graph = [s for s in data["proof"] if s["of"] != "agents" and s["kind"] != "input-constants"]
    return resealed({**data, "proof": [*of_graph, *own]})


def rejected(data: Json, where: str, reason: str) -> None:
    """Rejected by both arithmetics, with a digest that fits, and for this reason."""
    for stdlib in (True, False):
        report = check(resealed(data), stdlib=stdlib)
        assert not report.accepted
        assert re.match(where, report.rejected or ""), (report.rejected, report.reason)
        assert reason in (report.reason or ""), (report.rejected, report.reason)


#: Bounds of inputs that are never reached.
LARGE = {"agents": dict.fromkeys("abcf", "10000000"), "largest": "10000000"}


def undamped(data: Json) -> Json:
    """Its input as far as it is of relative positions and velocities."""
    less, labels = damping_bound(data, SETTINGS["at rest"]) or [], data["problem"]["graph"]["nodes"]
    rest = {label: str(F(data["agents"]["input"]["agents"][label]) - x) for label, x in zip(labels, less, strict=True)}
    return {"agents": rest, "largest": max(rest.values(), key=F)}


def numbers(values: list[str], factor: Fraction | int) -> list[str]:
    return [str(F(x) * factor) for x in values]


# ---------------------------------------------------------------------- what is true is accepted


@pytest.mark.few(6)
@pytest.mark.parametrize("name", SETTINGS)
def test_every_kind_of_agent_is_accepted_and_true(name: str):
    data = made(name)
    accepted(data)
    assert data["verdict"] == "certified" and VALIDATOR.is_valid(data)
    assert false_claims_of_agents(data) == []


@pytest.mark.parametrize("kind", ["enemies", "singles"])
def test_unbalanced_groups_and_single_leaders_are_accepted_and_true(kind: str):
    data = made("drag in the plane", kind)
    accepted(data)
    assert false_claims_of_agents(data) == []
    if kind == "enemies":  # no freedom at all: each agent stands on its offset, at rest
        ends, offsets = data["agents"]["final_state"], data["agents"]["offsets"]
        at_rest = {label: [[h, "0"] for h in row] for label, row in offsets.items()}
        middles = {
            label: [[x if isinstance(x, str) else x["mid"] for x in row] for row in rows]
            for label, rows in ends.items()
        }
        assert middles == at_rest


def test_disconnected_graphs_and_single_nodes_are_accepted_and_true():
    parts = graph_of([*CAMPS, ("p", "q", -1), ("q", "p", -1)])
    data = document(parts, PLAIN)
    assert "claim" not in data
    accepted(data)
    assert false_claims_of_agents(data) == []
    alone = document(SignedDigraph.from_edges([], ["only"]), Setting(plant=(F(1), F(0))))
    assert alone["agents"]["functions"] == [] and "final_state" in alone["agents"]
    accepted(alone)
    assert alone["verdict"] == "certified" and false_claims_of_agents(alone) == []


def test_the_meeting_in_flight_of_the_theory():
    """Allies ab, and allies cd who are enemies of a: they meet at 4.5 and -4.5 and fly on at 1/2 and -1/2."""
    edges = [("a", "b", 1), ("b", "a", 1), ("a", "c", -1), ("c", "d", 1), ("d", "c", 1)]
    data = copy.deepcopy(document(graph_of(edges), replace(PLAIN, offsets=False)))
    begins = zip("abcd", ("5", "2", "4", "-1"), ("1", "0", "0", "-2"), strict=True)
    data["agents"]["initial_state"] = {label: [[x, v]] for label, x, v in begins}
    told = with_agents(data, final_state=final_state(data), input=None)
    accepted(told)
    ends = {label: rows[0] for label, rows in told["agents"]["final_state"].items()}
    assert ends == {"a": ["9/2", "1/2"], "b": ["9/2", "1/2"], "c": ["-9/2", "-1/2"], "d": ["-9/2", "-1/2"]}


def test_rates_down_to_the_limit_are_accepted():
    slow = document(graph_of(CAMPS), replace(PLAIN, R=F(2001, 1000)))
    accepted(slow)
    assert "input" not in slow["agents"] and false_claims_of_agents(slow) == []
    edge = document(graph_of(CAMPS), replace(PLAIN, R=F(4)))
    assert "input" in edge["agents"]
    accepted(edge)


# ---------------------------------------------------------------------- forgeries


Change = Callable[[Json], Json]


def agents(**parts: Any) -> Change:
    return lambda data: with_agents(data, **parts)


def negative(data: Json) -> Json:
    """A coupling and a rate of the other sign, and gains that fit them."""
    own = data["agents"]
    parts = {key: str(-F(own[key])) for key in ("coupling", "rate")}
    return with_agents(data, gains=numbers(own["gains"], -1), **parts)


def repelling(data: Json) -> Json:
    own = data["agents"]
    return with_agents(data, gains=numbers(own["gains"], -1), coupling=str(-F(own["coupling"])))


def weaker(data: Json) -> Json:
    """Gains of the same matrix with a coupling that is a little too small."""
    own, share = data["agents"], 1 - F(1, 10**9)
    return with_agents(data, gains=numbers(own["gains"], share), coupling=str(F(own["coupling"]) * share))


def turned_matrix(data: Json) -> Json:
    W = data["agents"]["lower_triangle"]
    return with_agents(data, lower_triangle=[numbers(row, -1) for row in W], gains=numbers(data["agents"]["gains"], -1))


def other_gains(data: Json) -> Json:
    K = data["agents"]["gains"]
    return with_agents(data, gains=[str(F(K[0]) + F(1, 10**30)), *K[1:]])


def moved_end(axis: int, i: int) -> Change:
    def change(data: Json) -> Json:
        ends = copy.deepcopy(data["agents"]["final_state"])
        row = ends["f"][axis]
        old = row[i]
        row[i] = (
            {**old, "mid": str(F(old["mid"]) + 2 * F(old["radius"]))}
            if isinstance(old, dict)
            else str(F(old) + F(1, 10**20))
        )
        return with_agents(data, final_state=ends)

    return change


def moved_offset(data: Json) -> Json:
    offsets = copy.deepcopy(data["agents"]["offsets"])
    offsets["a"][0] = str(F(offsets["a"][0]) + F(1, 10**15))
    return with_agents(data, offsets=offsets)


def smaller(part: str, *path: Any) -> Change:
    def change(data: Json) -> Json:
        old = at(data["agents"][part], path)
        told = changed(data["agents"][part], path, str(F(old) * (1 - F(1, 10**6))))
        if part == "input":
            told["largest"] = max(told["agents"].values(), key=F)
        return with_agents(data, **{part: told})

    return change


def clocked(factor: Fraction) -> Change:
    """Another clock beside what is left."""

    def change(data: Json) -> Json:
        old = data["agents"]["residual"]
        return with_agents(data, residual={**old, "clock": str(F(old["clock"]) * factor)})

    return change


def faster(data: Json) -> Json:
    return with_agents(data, rate=str(F(data["agents"]["rate"]) * F(11, 10)))


def points(change: Callable[[list[str]], list[str]]) -> Change:
    return lambda data: with_agents(data, points=change(data["agents"]["points"]))


def part_of_motion(i: int, j: int, new: Any) -> Change:
    return lambda data: with_agents(data, motion=changed(data["agents"]["motion"], (i, j), new))


def used(*entries: Any) -> Change:
    return agents(functions=[{"function": k} for k in entries])


def proof_without_the_last(data: Json) -> Json:
    return {**data, "proof": data["proof"][:-1]}


def proof_with_one_twice(data: Json) -> Json:
    return {**data, "proof": [*data["proof"], data["proof"][-1]]}


def with_witness(data: Json) -> Json:
    step = len(data["proof"]) - 3
    return changed(data, ("proof", step, "witness"), {"u": "1"})


SIDE = {"file": "x.npy", "sha256": "0" * 64, "count": 4}
LONG = "1." + "0" * 1000 + "1"
WIDE = {"mid": "2", "radius": "1/10"}

FORGERIES: dict[str, tuple[str, Change, str, str]] = {
    "a negative rate with a negative coupling": (
        "double integrators", negative,
        "agents", "rate of the agents is not positive"),
    "a negative rate, capped": ("capped later", negative, "agents", "rate of the agents is not positive"),
    "a rate of 0, capped": ("capped later", agents(rate="0"), "agents", "rate of the agents is not positive"),
    "a negative coupling": ("double integrators", repelling, "agents", "the coupling is not positive"),
    "a coupling that is too weak": ("double integrators", weaker, "agent-coupling", "too weak"),
    "gains of another matrix": ("double integrators", other_gains, "agent-coupling", "K is not c b'W^-1"),
    "a matrix that is not definite": (
        "double integrators", turned_matrix,
        "agent-positive", "not proved positive definite"),
    "a faster rate": ("double integrators", faster, "agent-decrease", "between two points"),
    "a faster rate, capped from the beginning": ("capped from the beginning", faster, "agent-decrease", "at the cap"),
    "a plant beside a damping": ("at rest", agents(plant=["1", "1/3"]), "agents", "beside a force"),
    "a cap beside a damping": ("at rest", agents(gain_cap="7"), "agents", "with a gain that is capped"),
    "a damping that drives": ("at rest", agents(own=["0", "-2"]), "agents", "damp the velocity alone"),
    "feedback of the own position": ("at rest", agents(own=["1", "2"]), "agents", "damp the velocity alone"),
    "damping of order 3": ("no rho1", agents(own=["0", "0", "1"]), "agents", "not of order 2"),
    "damping of order 1": ("order 1", agents(own=["1"]), "agents", "not of order 2"),
    "a damping that is left out": ("at rest", agents(own=["0", "0"]), "agent-decrease|agent-motion", ""),
    "a damping that is not there": ("drag in the plane", agents(own=["0", "2"]), "agent-decrease|agent-motion", ""),
    "another drag": ("drag in the plane", agents(plant=["0", "1/2"]), "agent-decrease|agent-motion", ""),
    "a damping that is huge": ("at rest", agents(own=["0", "100000"]), "agent-decrease|agent-motion", ""),
    "the derivatives of a slow rate": (
        "double integrators", agents(rate="4/3"),
        "agents", "derivatives need not agree"),
    "another final position": ("double integrators", moved_end(0, 0), "agent-final-state", "ends elsewhere"),
    "another final velocity": ("drag in the plane", moved_end(1, 1), "agent-final-state", "ends elsewhere"),
    "another final velocity at rest": ("at rest", moved_end(0, 1), "agent-final-state", "ends elsewhere"),
    "another final position, capped": ("capped later", moved_end(0, 0), "agent-final-state", "ends elsewhere"),
    "another offset": ("double integrators", moved_offset, "agent-final-state", "ends elsewhere"),
    "points that do not reach the end": (
        "oscillators, three pieces", points(lambda p: p[:-1]), "agent-decrease", "end elsewhere"),
    "points that begin late": (
        "oscillators, three pieces", points(lambda p: p[1:]),
        "agent-decrease", "begin elsewhere"),
    "points that begin late, capped": (
        "capped later", points(lambda p: [str(F(p[0]) + F(1, 10**9)), p[1]]), "agent-decrease", "begin elsewhere"),
    "points that go back": (
        "oscillators, three pieces", points(lambda p: [p[0], p[2], p[1], p[3]]), "agent-decrease", "ascending"),
    "a point twice": ("double integrators", points(lambda p: [p[0], p[0], p[1]]), "agent-decrease", "ascending"),
    "one point": ("double integrators", points(lambda p: p[-1:]), "agent-decrease", "fewer than two"),
    "no points": ("double integrators", points(lambda p: []), "agent-decrease", "fewer than two"),
    "many points": (
        "double integrators", points(lambda p: [str(F(p[1]) * j / 257) for j in range(258)]), "agents",
        "more than 257"),
    "points where there are none": (
        "capped from the beginning", agents(points=["0", "4/5"]), "agent-decrease", "capped from the beginning"),
    "a cap that was not thought of": ("double integrators", agents(gain_cap="9"), "agent-decrease", "begin elsewhere"),
    "a cap that is 0": ("capped later", agents(gain_cap="0"), "agents", "cap of the gain is not positive"),
    "a cap that is negative": ("capped later", agents(gain_cap="-7"), "agents", "cap of the gain is not positive"),
    "a later cap": ("capped later", agents(gain_cap="8"), "agent-decrease", "begin elsewhere"),
    "another common motion": ("double integrators", part_of_motion(0, 1, "3"), "agent-motion", "another"),
    "a wide common motion": ("double integrators", part_of_motion(0, 1, WIDE), "agent-motion", "known exactly"),
    "a common motion that is not enclosed": (
        "drag in the plane", part_of_motion(0, 1, "1.5"),
        "agent-motion", "another"),
    "a velocity that is kept at rest": ("at rest", part_of_motion(1, 1, "1"), "agent-motion", "another"),
    "another way at rest": (
        "at rest without drag or rho1", part_of_motion(0, 1, "1"), "agent-motion", "another"),
    "a smaller input": ("double integrators", smaller("input", "agents", "a"), "agent-input", "input of agent a"),
    "a smaller input, capped": ("capped later", smaller("input", "agents", "f"), "agent-input", "input of agent f"),
    "an input without its sliding part": (
        "sliding variables", smaller("input", "agents", "b"), "agent-input", "input of agent b"),
    "a smaller input of a full matrix": (
        "every Lyapunov function", smaller("input", "agents", "c"), "agent-input", "input of agent c"),
    "another largest input": (
        "double integrators",
        lambda data: with_agents(data, input={**data["agents"]["input"], "largest": "1"}), "agent-input", "largest"),
    "an input at a slow rate": ("double integrators", agents(rate="2"), "agents.input", "below 2 n"),
    "a smaller input at rest": ("at rest", smaller("input", "agents", "a"), "agent-input", "input of agent a"),
    "an input at rest without its damping": (
        "at rest", lambda data: with_agents(data, input=undamped(data)), "agent-input", "input of agent"),
    "an input of agents that are damped too little": (
        "damped too little", agents(input=LARGE), "agents.input", "falls too slowly"),
    "an input of agents that are driven too much": (
        "damped and driven", agents(input=LARGE), "agents.input", "falls too slowly"),
    "an input without states": (
        "no states", agents(input={"agents": dict.fromkeys("abcf", "10000"), "largest": "10000"}), "agents.input",
        "without initial states"),
    "less that is left": ("capped later", smaller("residual", "agents", "a", 0), "agent-residual", "left of agent a"),
    "less velocity that is left": (
        "capped later", smaller("residual", "agents", "f", 1), "agent-residual", "left of agent f"),
    "a longer clock": (
        "capped later",
        clocked(F(1001, 1000)), "agent-residual", "clock is not proved"),
    "a negative clock": (
        "capped later", clocked(F(-1)), "agents", "clock is negative"),
    "nothing left without a cap": (
        "double integrators", agents(residual={"clock": "1", "agents": {key: ["1", "1"] for key in "abcf"}}),
        "agents.residual", "iff"),
    "what is left is not told": ("capped later", agents(residual=None), "agents.residual", "iff"),
    "no such function": ("double integrators", used(7), "agents.functions", "none such"),
    "a function before the first": ("double integrators", used(-1), "agents.functions", "none such"),
    "a function twice": ("double integrators", used(0, 0), "agents.functions", "none such"),
    "a function that is a truth value": ("double integrators", used(False), "agents", "not an integer"),
    "a function by its text": ("double integrators", used("0"), "agents", "not an integer"),
    "constants of a diagonal function": (
        "double integrators", agents(functions=[{"function": 0, "inputs": dict.fromkeys("abcf", "100")}]),
        "agents.functions|input-constants", "constants that follow"),
    "no function is used": ("double integrators", agents(functions=[], input=None), "agents.final_state", "without"),
    "no function is used, and no final state": (
        "double integrators", agents(functions=[], input=None, final_state=None), "verdict", "undecided"),
    "a final state without an initial one": (
        "double integrators", agents(initial_state=None, input=None), "agents.final_state", "without"),
    "order 0": ("double integrators", agents(order=0), "agents", "order is no integer from 1 to 8"),
    "order 9": ("double integrators", agents(order=9), "agents", "order is no integer from 1 to 8"),
    "a huge order": ("double integrators", agents(order=10**17), "agents", "order is no integer from 1 to 8"),
    "an order that is a truth value": ("order 1", agents(order=True), "agents", "order is not an integer"),
    "an order by its text": ("double integrators", agents(order="2"), "agents", "order is not an integer"),
    "order 1 of what is of order 2": ("double integrators", agents(order=1), "agents", "has not 1 entries"),
    "dimension 0": ("double integrators", agents(dimension=0), "agents", "dimension is no integer"),
    "dimension 9": ("double integrators", agents(dimension=9), "agents", "dimension is no integer"),
    "another dimension": ("double integrators", agents(dimension=2), "agents", "has not 2 entries"),
    "long numbers": ("drag in the plane", agents(plant=["0", LONG]), "agents", "2000 are taken"),
    "long numbers of the matrix": (
        "double integrators", agents(lower_triangle=[["1"], ["0", LONG]]), "agents", "2000 are taken"),
    "agents that move too far": ("drag in the plane", agents(plant=["0", "50"]), "agents", "move too far"),
    "agents that explode": ("drag in the plane", agents(plant=["0", "-1e300"]), "agents", "move too far"),
    "offsets in a side file": ("double integrators", agents(offsets=SIDE), "agents", "the key"),
    "a final state in a side file": (
        "double integrators", agents(final_state={"mid": SIDE, "radius": SIDE}), "agents", "the key"),
    "initial states in a side file": ("double integrators", agents(initial_state=SIDE), "agents", "the key"),
    "inputs in a side file": (
        "double integrators", agents(input={"agents": SIDE, "largest": "1"}), "agents", "in a side file"),
    "an agent less": (
        "double integrators", agents(offsets={key: ["0"] for key in "abc"}), "agents", 'the key "f" is missing'),
    "agents in another order": (
        "double integrators", agents(offsets={key: ["0"] for key in "fcba"}), "agents", "agents are in another order"),
    "an obligation less": ("double integrators", proof_without_the_last, "agent-input", "does not list"),
    "an obligation twice": ("double integrators", proof_with_one_twice, "proof", "nothing asks for"),
    "a witness": ("double integrators", with_witness, "agent-", "a witness that nothing asks for"),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_certificate_is_rejected_for_its_reason(name: str):
    setting, change, where, reason = FORGERIES[name]
    rejected(change(made(setting)), where, reason)


@pytest.mark.few(0)
def test_a_wrong_one_stays_wrong_in_the_eyes_of_the_oracle():
    """The oracle is no rubber stamp: what the check rejects as false is false to it."""
    false = dict[str, list[str]]()
    names = ("another final position", "another offset", "another common motion", "another largest input")
    for name in ("a negative coupling", *names):
        setting, change, _, _ = FORGERIES[name]
        false[name] = false_claims_of_agents(change(made(setting)))
    slack = with_agents(made(), gains=numbers(made()["agents"]["gains"], F(1, 20)))
    low = {"agents": dict.fromkeys("abcf", "1/10"), "largest": "1/10"}
    false["low gains"] = false_claims_of_agents(slack)
    false["a low input"] = false_claims_of_agents(with_agents(made(), input=low))
    left = with_agents(
        made("capped later"),
        residual={**made("capped later")["agents"]["residual"], "agents": {key: ["0", "0"] for key in "abcf"}},
    )
    false["nothing left"] = false_claims_of_agents(left)
    assert all(false.values()), false


# ---------------------------------------------------------------------- beside other parts


def test_sliding_variables_that_begin_elsewhere_are_refused():
    data = made("sliding variables")
    sigma = dict.fromkeys(data["problem"]["graph"]["nodes"], "0") | {"a": "1/1000"}
    z = {**data["reaching_time"], "z": dict.fromkeys(data["problem"]["graph"]["nodes"])}
    moving = changed({**data, "reaching_time": z}, ("problem", "sliding_variable"), sigma)
    rejected(moving, "sliding_variable", "sliding variables that are 0")


def test_parts_of_agents_of_order_1_are_empty():
    data, zero = made(), dict.fromkeys("abcf", "0")
    rejected(changed(data, ("problem", "initial_state"), zero), "final_state|final-state|initial_state", "")
    plain = json.loads(certify(graph_of(CAMPS), NominalProtocol(T=2, rho1="1/2", rho2="3/4", kappa=2)).to_json())
    rejected({**data, "input": plain["input"]}, "input", "beside that of the agents")
    rejected({**data, "agents": None}, "format", "agents is null")
    rejected({**plain, "agents": data["agents"]}, "initial_state|input", "beside that of the agents")
    rejected({**data, "agents": {**data["agents"], "more": None}}, "agents", "not known")
    rejected({**data, "input": None}, "format", "input is null, and not left out")
    rejected(with_agents({key: x for key, x in data.items() if key != "rates"}), "format", "missing")


def test_parts_that_are_null_are_rejected():
    data = made("capped later")
    for key in ("gain_cap", "initial_state", "final_state", "residual", "input"):
        rejected(changed(data, ("agents", key), None), "agents", f"{key} is null, and not left out")
    rejected(changed(data, ("agents", "functions", 0, "inputs"), None), "agents", "inputs is null, and not left out")


def test_only_agents_of_order_n_may_do_without_rho1():
    data = made("no rho1")
    plain = {key: x for key, x in data.items() if key != "agents"}
    rejected(plain, "gain", "not positive")
    rejected(changed(data, ("problem", "gain", "rho1"), "-1/100"), "gain", "rho1 is negative")
    rejected(changed(data, ("problem", "gain", "rho2"), "0"), "gain", "not positive")


def test_agents_of_order_n_on_a_family_are_refused():
    one = Family.switching([graph_of(CAMPS), graph_of([*CAMPS[:-1], ("a", "f", 1)])])
    data = json.loads(certify_family(one, NominalProtocol(T=2, rho1="1/2", rho2="3/4", kappa=2)).to_json())
    assert check(data).accepted
    rejected({**data, "agents": made()["agents"]}, "format", "has no place for a family")


def test_an_undecided_certificate_says_nothing_of_the_end():
    data = with_agents(made(), functions=[], input=None, final_state=None)
    data = resealed({**data, "verdict": "undecided"})
    accepted(data)
    assert false_claims_of_agents(data) == []


def test_nothing_takes_long(monkeypatch: pytest.MonkeyPatch):
    """Numbers of the longest kind, the most points, the largest order: answered or refused in seconds."""
    big = str(F(10**600 + 7, 10**600 + 9))
    small = {key: [["1"] * 8] for key in "abcf"}
    eight = Setting(order=8, rho1=F(0))
    base = of_graph(graph_of(CAMPS), replace(eight, order=1))
    points = [str(F(4, 3) * F(big) ** 0 * j / 256) for j in range(257)]
    triangle = [[str(F(10**600 + i + j, 10**600 + 3 * i + j + 1)) for j in range(i + 1)] for i in range(8)]
    for i, row in enumerate(triangle):
        row[i] = str(F(row[i]) + 9)
    told = {
        **made()["agents"], "order": 8, "plant": [str(F(big) / (i + 1)) for i in range(8)], "own": ["0"] * 8,
        "gains": [big] * 8, "coupling": big, "lower_triangle": triangle, "rate": "100", "points": points,
        "offsets": {key: ["0"] for key in "abcf"}, "initial_state": small, "motion": [["0"] * 8] * 8,
    }  # fmt: skip
    told = {key: x for key, x in told.items() if key not in ("final_state", "input")}
    with at_most(15):
        report = check(resealed({**base, "agents": told, "proof": [*base["proof"], *obligations(told)]}))
    assert not report.accepted, (report.rejected, report.reason)


# ---------------------------------------------------------------------- mutants


def judged(data: Json, changes: Iterator[tuple[Any, Json]]) -> tuple[int, Counter[str]]:
    return judged_mutants(data, changes, false_claims_of_agents)


def told_again(mutant: Json, path: Any, new: str) -> Json:
    """The proof tells some numbers once more."""
    for k, stated in enumerate(mutant["proof"]):
        for key in ("rate", "coupling"):
            if stated["of"] == "agents" and key in stated.get("numbers", {}) and path == ("agents", key):
                mutant = changed(mutant, ("proof", k, "numbers", key), new)
    return mutant


def nudges(data: Json, seed: int, count: int) -> Iterator[tuple[Any, Json]]:
    return nudged(data, ("agents", "gain", "graph", "decays"), seed, count, told_again)


def test_mutants_of_agents_that_are_accepted_are_true():
    data = made("capped later")
    count, _ = judged(data, mutants(data, 41, 3))
    more, passed = judged(data, nudges(data, 1, 40))
    assert count > 30 and more > 30 and passed


@pytest.mark.campaign
@pytest.mark.parametrize("name", SETTINGS)
def test_mutants_of_every_kind_of_agents_that_are_accepted_are_true(name: str):
    """At least 3,000 in all."""
    total, passed = 0, Counter[str]()
    for kind in ("camps", "singles"):
        data = made(name, kind)
        own = ((path, x) for path, x in mutants(data, 3, 1) if part_of(path) in ("agents", "gain", "proof", "verdict"))
        for changes in (own, nudges(data, len(name), int(os.environ.get("PTCC_FUZZ_COUNT", "60")))):
            count, through = judged(data, changes)
            total, passed = total + count, passed + through
    print(f"\n{name}: {total} mutants, none accepted but true; {sum(passed.values())} true: {dict(passed)}")
    assert total > 250


@pytest.mark.campaign
@pytest.mark.parametrize("name", CLASSES)
def test_agents_on_every_class_of_graphs_are_accepted_and_true(name: str):
    rng = np.random.default_rng(list(CLASSES).index(name))
    graph = random_graph(rng, **{"weights": "decimals", **CLASSES[name]}).graph
    for setting in list(SETTINGS)[list(CLASSES).index(name) % 3 :: 3]:
        data = document(graph, SETTINGS[setting], int(rng.integers(1000)))
        accepted(data)
        assert false_claims_of_agents(data) == [], setting


# ---------------------------------------------------------------------- what the program makes


def made_by_the_program(seed: int, method: str) -> Json:
    """A certificate of a random case."""
    case = agent_case(seed)
    options: Json = {"agents": case.agents, "derivatives": case.derivatives, "method": method, "simulation": False}
    return json.loads(certify_words(case.graph, case.protocol, case.x0, **options).to_json())


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [3, 13])
def test_what_the_program_makes_is_true(seed: int):
    data = made_by_the_program(seed, "paper")
    assert data["verdict"] == "certified" and VALIDATOR.is_valid(data)
    accepted(data)
    assert false_claims_of_agents(data) == []


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_what_the_program_makes_is_true_and_stays_so(seed: int):
    """Every class of graphs; mutants of each that are accepted are true."""
    data = {**made_by_the_program(seed, ("paper", "best")[seed % 2]), "unverified": {}}
    assert data["verdict"] == "certified" and VALIDATOR.is_valid(data)
    accepted(data)
    assert false_claims_of_agents(data) == []
    own = ((path, x) for path, x in mutants(data, 29, seed) if part_of(path) in ("agents", "gain", "proof"))
    for changes in (own, nudges(data, seed, 20)):
        judged(data, changes)


def test_final_states_that_cost_too_much_are_refused_before_they_are_read(monkeypatch: pytest.MonkeyPatch):
    data = made()
    monkeypatch.setattr(common_motion, "ENTRY", 10**10)
    rejected(data, "agent-final-state|agents", "the final states of agents would take too long")
