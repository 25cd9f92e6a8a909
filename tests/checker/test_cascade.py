"""Certificates of the cascade: true ones are accepted, forged ones rejected for the reason that makes them false."""

from __future__ import annotations

import copy
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from asked import certify_family, certify_words
from generators import all_classes, random_graph
from mutations import Json, changed, judged_mutants, mutants, nudged, part_of, resealed
from oracle_cascade import false_claims_of_cascade
from schema_validator import VALIDATOR

from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents

F = Fraction
CLASSES = dict(all_classes())
CAMPS = [("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)]
ENEMIES = [("a", "b", -1), ("b", "c", -2), ("c", "a", -1), ("b", "a", -1)]
SINGLES = [("a", "f", 1), ("b", "f", -2), ("f", "g", 1)]
X = {"a": [1, 2], "b": [-3, 0], "c": ["0.5", 1], "f": [4, -1], "g": [2, 2]}
V = {"a": [1, 0], "b": [0, -2], "c": [3, 1], "f": [-1, 1], "g": [0, 5]}

NOMINAL = {"T": 2, "rho1": "1/2", "rho2": 12, "kappa": 2}
SETTINGS: dict[str, tuple[Any, Json, Json]] = {  # protocol, agents, options
    "plain": (NominalProtocol(**NOMINAL), {}, {}),
    "formation": (NominalProtocol(**NOMINAL), {"offsets": V}, {}),
    "every function": (NominalProtocol(**NOMINAL), {}, {"method": "best"}),
    "slow": (NominalProtocol(T=2, rho1="1/2", rho2=1, kappa="1/2"), {}, {}),
    "weak alpha": (NominalProtocol(**NOMINAL), {"cascade": "1/50"}, {}),
    "sliding variables": (SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=24, kappa=1, mu1=2, delta="3/2"), {}, {}),
    "no states": (NominalProtocol(**NOMINAL), {}, {"x0": None, "v0": None}),
}


@cache
def made(name: str = "plain", kind: str = "camps") -> Json:
    graph = SignedDigraph.from_edges({"camps": CAMPS, "enemies": ENEMIES, "singles": SINGLES}[kind])
    protocol, of_agents, options = SETTINGS[name]
    begin = {key: {label: rows[label] for label in graph.labels} for key, rows in (("x0", X), ("v0", V))}
    of_agents = {
        key: {label: x[label] for label in graph.labels} if isinstance(x, dict) else x for key, x in of_agents.items()
    }
    agents = Agents(**{"order": 2, "cascade": 2, **of_agents})
    asked: Json = {"method": "paper", "simulation": False, "agents": agents, **begin, **options}
    return {**json.loads(certify_words(graph, protocol, **asked).to_json()), "unverified": {}}


def accepted(data: Json) -> None:
    for stdlib in (True, False):
        report = check(data, stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
        assert report.verdict == data["verdict"] and len(report.obligations) == len(data["proof"])


def rejected(data: Json, where: str, reason: str) -> None:
    """Rejected by both arithmetics, with a digest that fits, and for this reason."""
    for stdlib in (True, False):
        report = check(resealed(data), stdlib=stdlib)
        assert not report.accepted
        assert re.match(where, report.rejected or ""), (report.rejected, report.reason)
        assert reason in (report.reason or ""), (report.rejected, report.reason)


@pytest.mark.few(3)
@pytest.mark.parametrize("name", SETTINGS)
def test_every_kind_of_cascade_is_accepted_and_has_the_shape_of_the_schema(name: str):
    data = made(name)
    accepted(data)
    assert data["verdict"] == "certified" and VALIDATOR.is_valid(data)


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "kind"), [("every function", "camps"), ("slow", "enemies"), ("formation", "singles")])
def test_what_is_accepted_is_true(name: str, kind: str):
    data = made(name, kind)
    accepted(data)
    assert false_claims_of_cascade(data) == []


# ---------------------------------------------------------------------- forgeries

LESS = F(999_999, 1_000_000)
Change = Callable[[Json], Json]


def agents(**parts: Any) -> Change:
    """Other parts of the section, None: left out, and the obligations that belong to them."""

    def change(data: Json) -> Json:
        section = {key: x for key, x in {**data["agents"], **parts}.items() if x is not None}
        steps = {"final_state": "agent-final-state", "input": "agent-input"}
        gone = [steps[key] for key in parts if key in steps and parts[key] is None]
        return {**data, "agents": section, "proof": [step for step in data["proof"] if step["kind"] not in gone]}

    return change


def scaled(*path: Any, factor: Fraction = LESS) -> Change:
    """A number of the section times a factor."""

    def change(data: Json) -> Json:
        old = data["agents"]
        for key in path:
            old = old[key]
        told = changed(data, ("agents", *path), str(F(old) * factor))
        if path[0] == "input" and path[1] == "agents":
            told = changed(told, ("agents", "input", "largest"), max(told["agents"]["input"]["agents"].values(), key=F))
        return told

    return change


def alpha(value: str) -> Change:
    """Another rate of the cascade, in the proof too."""

    def change(data: Json) -> Json:
        step = next(k for k, step in enumerate(data["proof"]) if step["kind"] == "agent-cascade")
        return changed(agents(cascade=value)(data), ("proof", step, "numbers", "alpha"), value)

    return change


def moved(axis: int, i: int) -> Change:
    def change(data: Json) -> Json:
        old = data["agents"]["final_state"]["f"][axis][i]
        if isinstance(old, dict):
            new: Any = {**old, "mid": str(F(old["mid"]) + 2 * F(old["radius"]) + F(1, 10**15))}
        else:
            new = str(F(old) + F(1, 10**20))
        return changed(data, ("agents", "final_state", "f", axis, i), new)

    return change


def without_velocities(data: Json) -> Json:
    ends = {label: [row[:1] for row in rows] for label, rows in data["agents"]["final_state"].items()}
    return agents(final_state=ends)(data)


def with_velocities(data: Json) -> Json:
    ends = {label: [[*row, "0"] for row in rows] for label, rows in data["agents"]["final_state"].items()}
    return agents(final_state=ends)(data)


def with_input(data: Json) -> Json:
    """A bound that is never reached, where none is proved."""
    names = data["problem"]["graph"]["nodes"]
    text = {"agents": dict.fromkeys(names, "100000000"), "largest": "100000000"}
    input_step = next(step for step in made()["proof"] if step["kind"] == "agent-input")
    last = next((k for k, step in enumerate(data["proof"]) if step["kind"] == "agent-instants"), len(data["proof"]))
    proof = [*data["proof"][:last], input_step, *data["proof"][last:]]
    return {**data, "agents": {**data["agents"], "input": text}, "proof": proof}


def without_functions(data: Json) -> Json:
    steps = [step for step in data["proof"] if step["kind"] != "input-constants"]
    return agents(functions=[], input=None)({**data, "proof": steps})


def entry(**parts: Any) -> Change:
    """Other parts of the first function, None: left out."""

    def change(data: Json) -> Json:
        first = {**data["agents"]["functions"][0], **parts}
        return agents(functions=[{key: x for key, x in first.items() if x is not None}])(data)

    return change


def twice(data: Json) -> Json:
    return agents(functions=data["agents"]["functions"][:1] * 2)(data)


def step_of(kind: str, **parts: Any) -> Change:
    def change(data: Json) -> Json:
        k = next(k for k, step in enumerate(data["proof"]) if step["kind"] == kind)
        return {**data, "proof": [*data["proof"][:k], {**data["proof"][k], **parts}, *data["proof"][k + 1 :]]}

    return change


def without_step(kind: str) -> Change:
    return lambda data: {**data, "proof": [step for step in data["proof"] if step["kind"] != kind]}


def of_two_kinds(data: Json) -> Json:
    return agents(order=2, plant=["0", "0"])(data)


LONG = "1." + "0" * 1000 + "1"
SIDE = {"file": "x.npy", "sha256": "0" * 64, "count": 4}

FORGERIES: dict[str, tuple[str, Change, str, str]] = {
    "a negative alpha": ("plain", alpha("-2"), "agents", "cascade is not positive"),
    "an alpha of 0": ("plain", alpha("0"), "agents", "cascade is not positive"),
    "a larger alpha": ("plain", alpha("3"), "agent-motion", "another"),
    "a smaller alpha": ("plain", alpha("19/10"), "agent-motion", "another"),
    "a huge alpha": ("plain", alpha("1e9"), "agent-motion", "1000"),
    "an alpha of many digits": ("plain", alpha(LONG), "agents", "2000 are taken"),
    "another alpha in the proof": (
        "plain", step_of("agent-cascade", numbers={"alpha": "3"}), "agent-cascade", "another than that of the cascade"),
    "a smaller initial value": ("plain", scaled("functions", 0, "initial"), "agent-cascade", "initial positions"),
    "a smaller drive": ("plain", scaled("functions", 0, "drive"), "agent-cascade", "initial drive"),
    "a negative drive": ("plain", scaled("functions", 0, "drive", factor=F(-2)), "agent-cascade", "initial drive"),
    "a negative initial value": (
        "plain", scaled("functions", 0, "initial", factor=F(-2)), "agent-cascade", "initial positions"),
    "a smaller drive of a full matrix": (
        "every function", scaled("functions", -1, "drive"), "agent-cascade", "initial drive"),
    "no drive": ("plain", entry(drive=None), "agent-cascade", "iff there are initial states"),
    "values without states": ("no states", entry(initial="1", drive="1"), "agent-cascade", "iff there are"),
    "another final position": ("plain", moved(0, 0), "agent-final-state", "ends elsewhere"),
    "another final position in the plane": ("formation", moved(1, 0), "agent-final-state", "ends elsewhere"),
    "a final velocity": ("plain", moved(0, 1), "agent-final-state", "ends elsewhere"),
    "velocities that need not vanish": ("slow", with_velocities, "agent-final-state", "with 1 derivatives"),
    "velocities that are left out": ("plain", without_velocities, "agent-final-state", "with 2 derivatives"),
    "a smaller input": ("plain", scaled("input", "agents", "f", factor=F(99, 100)), "agent-input", "input of agent f"),
    "a smaller input beside sliding terms": (
        "sliding variables", scaled("input", "agents", "a", factor=F(99, 100)), "agent-input", "input of agent a"),
    "a smaller input by several functions": (
        "every function", scaled("input", "agents", "f", factor=F(999, 1000)), "agent-input", "input of agent f"),
    "another largest input": ("plain", scaled("input", "largest"), "agent-input", "largest input"),
    "an input of a slow graph": ("slow", with_input, "agents.input", "no function and no alpha bound it"),
    "an input of a weak alpha": ("weak alpha", with_input, "agents.input", "no function and no alpha bound it"),
    "an input without states": ("no states", with_input, "agents.input", "without initial states"),
    "other offsets": (
        "formation", lambda data: agents(offsets={**data["agents"]["offsets"], "a": ["7", "0"]})(data),
        "agent-cascade|agent-final-state", ""),
    "other velocities": (
        "plain",
        lambda data: agents(
            initial_state={**data["agents"]["initial_state"], "b": [["-3", "9"], ["0", "-2"]]}
        )(data),
        "agent-cascade|agent-final-state", ""),
    "another motion": (
        "plain", lambda data: changed(data, ("agents", "motion", 0, 1), "1/10"), "agent-motion", "another"),
    "a motion that does not rest": (
        "plain", lambda data: changed(data, ("agents", "motion", 1, 1), "1"), "agent-motion", "another"),
    "no such function": ("plain", entry(function=7), "agents.functions", "none such"),
    "a function before the first": ("plain", entry(function=-1), "agents.functions", "none such"),
    "a function that is a truth value": ("plain", entry(function=False), "agents", "not an integer"),
    "a function twice": ("plain", twice, "agents.functions", "none such"),
    "no function": ("plain", without_functions, "agents.final_state|agent-", "without initial states or a"),
    "constants of a diagonal function": (
        "plain", entry(inputs=dict.fromkeys("abcf", "100")), "agents.functions|input-constants", "that follow"),
    "a smaller constant": (
        "every function", lambda data: smaller_constant(data), "input-constants", "the constant of agent"),
    "dimension 9": ("plain", agents(dimension=9), "agents", "dimension is no integer from 1 to 8"),
    "another dimension": ("plain", agents(dimension=1), "agents", "has not 1 entries"),
    "keys of both protocols": ("plain", of_two_kinds, "agents", "not known"),
    "a cap": ("plain", agents(gain_cap="7"), "agents", "not known"),
    "a key less": (
        "plain", lambda data: {**data, "agents": {k: x for k, x in data["agents"].items() if k != "motion"}},
        "agents", 'the key "motion" is missing'),
    "an agent less": ("plain", agents(offsets={key: ["0", "0"] for key in "abc"}), "agents", "missing"),
    "offsets in a side file": ("plain", agents(offsets=SIDE), "agents", "the key"),
    "a step less": ("plain", without_step("agent-cascade"), "agent-cascade", "another obligation"),
    "a step of the input less": ("plain", without_step("agent-input"), "agent-input", "another obligation"),
    "the last step less": ("plain", without_step("agent-instants"), "agent-instants", "does not list"),
    "a step of the other protocol": (
        "plain", lambda data: {**data, "proof": [*data["proof"], data["proof"][-1]]}, "proof", "nothing asks for"),
    "a witness": ("plain", step_of("agent-cascade", witness={"u": "1"}), "agent-cascade", "nothing asks for"),
    "an input beside that of the agents": ("plain", lambda data: {**data, "input": {}}, "input", "beside that of"),
    "states beside those of the agents": (
        "plain", lambda data: changed(data, ("problem", "initial_state"), dict.fromkeys("abcf", "0")),
        "final|init", ""),
}  # fmt: skip


def smaller_constant(data: Json) -> Json:
    k = next(k for k, one in enumerate(data["agents"]["functions"]) if "inputs" in one)
    old = data["agents"]["functions"][k]["inputs"]["a"]
    return changed(data, ("agents", "functions", k, "inputs", "a"), str(F(old) / 100))


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_certificate_is_rejected_for_its_reason(name: str):
    setting, change, where, reason = FORGERIES[name]
    rejected(change(made(setting)), where, reason)


def test_parts_that_are_null_are_rejected():
    for key in ("initial_state", "final_state", "input"):
        rejected(changed(made(), ("agents", key), None), "agents", f"{key} is null, and not left out")
    for key in ("inputs", "initial", "drive"):
        null = changed(made(), ("agents", "functions", 0, key), None)
        rejected(null, "agents", f"{key} is null, and not left out")


@pytest.mark.few(0)
def test_what_is_rejected_as_false_is_false_to_the_oracle():
    false = {}
    for name in ("a smaller drive", "a smaller initial value", "another final position", "another motion"):
        setting, change, _, _ = FORGERIES[name]
        false[name] = false_claims_of_cascade(change(made(setting)))
    false["velocities"] = false_claims_of_cascade(with_velocities(made("slow")))
    low = {"agents": dict.fromkeys("abcf", "1/10"), "largest": "1/10"}
    false["a low input"] = false_claims_of_cascade(agents(input=low)(made()))
    for root in (0, 1):
        told = F(made()["instants"][0][root])
        false[f"instants {root}"] = false_claims_of_cascade(changed(made(), ("instants", 0, root), str(told * LESS**3)))
    assert all(false.values()), false


def test_agents_of_the_cascade_on_a_family_and_beside_late_messages_are_refused():
    one = Family.switching([SignedDigraph.from_edges(CAMPS), SignedDigraph.from_edges([*CAMPS[:-1], ("a", "f", 1)])])
    data = json.loads(certify_family(one, NominalProtocol(**NOMINAL)).to_json())
    rejected({**data, "agents": made()["agents"]}, "format", "has no place for a family")
    rejected({**made(), "messages": {}}, "", "agents of order n with late messages or moving leaders")


def test_without_rho1_it_holds_as_well():
    """``rho1 = 0`` is of agents alone; with the numbers of a gain that begins at the same value."""
    same = NominalProtocol(T=2, rho1="1e-300", rho2=4, kappa=2)
    graph = SignedDigraph.from_edges(CAMPS)
    begin = {key: {label: rows[label] for label in graph.labels} for key, rows in (("x0", X), ("v0", V))}
    made_here = certify_words(graph, same, agents=Agents(order=2, cascade=2), method="paper", simulation=False, **begin)
    data = {**json.loads(made_here.to_json()), "unverified": {}}
    exact = {"motion": [["1", str(F(2, 17))], ["0", "0"]]}  # T/(alpha k + 1)
    ends = copy.deepcopy(data["agents"]["final_state"])
    for rows in ends.values():
        for row in rows:
            row[0] = {"mid": row[0]["mid"], "radius": "1e-9"} if isinstance(row[0], dict) else row[0]
    told = agents(**exact, final_state=ends)(changed(data, ("problem", "gain", "rho1"), "0"))
    accepted(resealed(told))
    assert false_claims_of_cascade(told) == []


# ---------------------------------------------------------------------- mutants


def judged(data: Json, changes: Iterator[tuple[Any, Json]]) -> tuple[int, Counter[str]]:
    return judged_mutants(data, changes, false_claims_of_cascade)


def told_again(mutant: Json, path: Any, new: str) -> Json:
    """The proof tells alpha once more."""
    return alpha(new)(mutant) if path == ("agents", "cascade") else mutant


def nudges(data: Json, seed: int, count: int) -> Iterator[tuple[Any, Json]]:
    return nudged(data, ("agents", "gain", "graph", "decays", "instants"), seed, count, told_again)


@pytest.mark.few(0)
def test_mutants_that_are_accepted_are_true():
    data = made("formation")
    own = ((path, x) for path, x in mutants(data, 41, 1) if path[0] in ("agents", "proof", "instants"))
    count, _ = judged(data, own)
    more, passed = judged(data, nudges(data, 1, 40))
    assert count > 20 and more > 30 and passed
    last, kept = judged(data, nudged(data, ("instants",), 2, 40, told_again))
    assert last > 30 and kept["instants.k.k"] > 5


OWN = ("agents", "gain", "proof", "verdict", "instants")


@pytest.mark.campaign
@pytest.mark.parametrize("name", SETTINGS)
def test_mutants_of_every_kind_of_cascade_that_are_accepted_are_true(name: str):
    total, passed = 0, Counter[str]()
    for kind in ("camps", "singles", "enemies"):
        data = made(name, kind)
        own = ((path, x) for path, x in mutants(data, 3, 1) if part_of(path) in OWN)
        assert false_claims_of_cascade(data) == []
        for changes in (own, nudges(data, len(name), int(os.environ.get("PTCC_FUZZ_COUNT", "60")))):
            count, through = judged(data, changes)
            total, passed = total + count, passed + through
    print(f"\n{name}: {total} mutants, none accepted but true; {sum(passed.values())} true: {dict(passed)}")
    assert total > 200


@pytest.mark.campaign
@pytest.mark.parametrize("name", CLASSES)
def test_the_cascade_on_every_class_of_graphs_is_accepted_and_stays_true(name: str):
    rng = np.random.default_rng(list(CLASSES).index(name))
    graph = random_graph(rng, **{"weights": "decimals", **CLASSES[name]}).graph
    x0, v0 = rng.integers(-5, 6, (2, graph.n_nodes)).tolist()
    protocol = NominalProtocol(T=1, rho1="1/2", rho2=3, kappa=2)
    asked: Json = {"agents": Agents(order=2, cascade=1), "v0": v0, "simulation": False}
    data = {**json.loads(certify_words(graph, protocol, x0, **asked).to_json()), "unverified": {}}
    accepted(data)
    assert false_claims_of_cascade(data) == []
    judged(data, nudges(data, 7, 25))
