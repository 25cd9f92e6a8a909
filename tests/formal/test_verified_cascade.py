"""The cascade before the checker that is itself proved: what is true is accepted, and what is forged is not."""

from __future__ import annotations

import json
import os
import re
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph
from mutations import EDGES, Json, at, changed, mutants, nudged, resealed, without, without_instants
from verified import compare, named, program, said

from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.certificate import graph_certification
from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents

F = Fraction
SOURCES = Path(__file__).resolve().parents[2] / "formal"
GRAPHS = {
    "camps": [("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)],
    "enemies": [("a", "b", -1), ("b", "c", -2), ("c", "a", -1), ("b", "a", -1)],
    "singles": [("a", "f", 1), ("b", "f", -2), ("f", "g", 1)],
}
STRONG, WEAK = NominalProtocol(T=2, rho1="1/2", rho2=12, kappa=2), NominalProtocol(T=2, rho1="1/2", rho2=1, kappa="1/2")
SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=24, kappa=1, mu1=2, delta="3/2")
#: A graph, a protocol, what agents have, and how many coordinates of initial states.
SETTINGS: dict[str, tuple[str, Any, Json, int]] = {
    "plain": ("camps", STRONG, {}, 1),
    "formation in the plane": ("singles", STRONG, {"offsets": True}, 2),
    "no camps": ("enemies", STRONG, {"cascade": "7/3"}, 1),
    "every function": ("camps", STRONG, {"method": "best"}, 2),
    "velocities that need not vanish": ("camps", WEAK, {}, 1),
    "no bound of the input": ("singles", STRONG, {"cascade": "1/50"}, 1),
    "sliding variables": ("camps", SLIDING, {}, 2),
    "no states": ("camps", STRONG, {}, 0),
    "little rho1, in space": ("camps", NominalProtocol(T="1/3", rho1="1/1000", rho2=9, kappa=1), {"cascade": 4}, 3),
}
#: What the executable says of a form that it does not read.
UNREAD = ("large form", "undecided", "radius", "dominance", "weak components")


def document(
    graph: SignedDigraph, protocol: Any, of_agents: Json, dimension: int, seed: int = 3, instants: bool = False
) -> Json:
    """A certificate, with offsets and initial states of small quotients; with what it says of instants, or without.

    Forgeries and mutants are made without: the program leaves instants out, and would take whatever they say.
    """
    rng, labels, options = np.random.default_rng(seed), graph.labels, {"cascade": 2, **of_agents}
    rows = lambda: {v: [str(F(int(x), 4)) for x in rng.integers(-20, 21, dimension)] for v in labels}  # noqa: E731
    asked: Json = {"method": options.pop("method", "paper"), "simulation": False}
    if options.pop("offsets", False) and dimension:
        options["offsets"] = rows()
    if dimension:
        asked |= {"x0": rows(), "v0": rows()}
    text = certify_words(graph, protocol, agents=Agents(order=2, **options), **asked).to_json()
    data = {**json.loads(text), "unverified": {}}
    return data if instants else without_instants(data)


@cache
def made(name: str) -> Json:
    kind, *rest = SETTINGS[name]
    return document(SignedDigraph.from_edges(GRAPHS[kind]), *rest)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", SETTINGS)
def test_certificates_of_the_cascade_are_accepted_and_every_obligation_is_verified(name: str, tmp_path: Path) -> None:
    program()
    data = made(name)
    assert check(data).accepted
    code, text = said(data, tmp_path)
    assert code == 0 and named(text) == set(), text
    listed = [f"{o['kind']} of {o['of']}" for o in data["proof"]]
    assert re.findall(r"^verified    ([^:\n]*)", text, re.MULTILINE) == listed
    assert ("agent-input of agents" in listed) == ("input" in data["agents"])


def test_instants_are_named_as_not_checked_and_the_rest_is_verified(tmp_path: Path) -> None:
    program()
    kind, *rest = SETTINGS["plain"]
    data = document(SignedDigraph.from_edges(GRAPHS[kind]), *rest, instants=True)
    assert check(data).accepted and data["instants"]
    code, text = said(data, tmp_path)
    assert code == 0 and "agent-instants of instants" in named(text), text
    listed = [f"{o['kind']} of {o['of']}" for o in data["proof"] if o["kind"] != "agent-instants"]
    assert re.findall(r"^verified    ([^:\n]*)", text, re.MULTILINE) == listed


def test_the_statement_is_one_more_file_of_as_many_lines_as_is_said() -> None:
    text = re.sub(r"\(\*.*?\*\)", "", (SOURCES / "CascadeCertificate.v").read_text("utf-8"), flags=re.DOTALL)
    lines = [line for line in text.splitlines() if line.strip()]
    assert max(map(len, lines)) <= 120
    assert [line for line in lines if "Require" in line] == [
        "Require Import ZArith QArith Qreals List Bool Reals.",
        "From Coquelicot Require Import Coquelicot.",
        "Require Import Certificate AgentCertificate.",
    ]
    for page, said_so in (
        (SOURCES / "README.md", f"{len(lines)} more lines"),
        (SOURCES.parent / "docs" / "theory" / "verified-checker.md", f"{len(lines)} more in"),
    ):
        assert said_so in page.read_text("utf-8")


def told(data: Json, path: tuple[str | int, ...], new: Any) -> Json:
    """A change that the proof and the largest input tell as well, and a digest that fits."""
    data = changed(data, path, new)
    if path[-1] == "cascade":
        step = next(k for k, step in enumerate(data["proof"]) if step["kind"] == "agent-cascade")
        data = changed(data, ("proof", step, "numbers", "alpha"), new)
    if path[:3] == ("agents", "input", "agents"):
        values = data["agents"]["input"]["agents"].values()
        data = changed(data, ("agents", "input", "largest"), max(values, key=F))
    return resealed(data)


def middle(interval: Any) -> Fraction:
    return F(interval["mid"] if isinstance(interval, dict) else interval)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["plain", "formation in the plane", "every function", "sliding variables"])
def test_what_is_forged_is_rejected_by_both_checkers(name: str, tmp_path: Path) -> None:
    program()
    data = made(name)
    own, less = data["agents"], lambda text, q="999999/1000000": str(F(text) * F(q))
    used, ends = own["functions"][0], own["final_state"]["f"][0]
    m = own["motion"][0][1]
    for path, new, where in (
        (("cascade",), "-2", "not positive"),
        (("cascade",), str(F(own["cascade"]) * F(11, 10)), "agent-motion"),
        (("functions", 0, "initial"), less(used["initial"]), "agent-cascade"),
        (("functions", 0, "drive"), less(used["drive"]), "agent-cascade"),
        (("functions", 0, "drive"), "-" + used["drive"], "agent-cascade"),
        (("functions",), own["functions"][:1] * 2, "another order"),
        (("motion", 0, 0), "1001/1000", "agent-motion"),
        (("motion", 0, 1), str(middle(m) + F(1, 10**6)), "agent-motion"),
        (("motion", 1, 1), "1/1000000", "agent-motion"),
        (("final_state", "f", 0, 0), str(middle(ends[0]) + F(1, 10**6)), "agent-final-state"),
        (("final_state", "f", 0, 1), "1/10", "agent-final-state"),
        (("final_state", "f", 0), [ends[0]], "derivatives"),
        (("initial_state", "a", 0, 1), "50", "agent-"),
        (("offsets", "a", 0), "77", "agent-"),
        (("input", "agents", "f"), less(own["input"]["agents"]["f"], "9/10"), "agent-input"),
        (("dimension",), 5, "coordinates"),
    ):
        forged = told(data, ("agents", *path), new)
        assert not check(forged).accepted, path
        code, text = said(forged, tmp_path)
        assert code == 1 and where in text, (path, text)
    untold = resealed(without(data, ("agents", "functions", 0, "initial")))
    assert not check(untold).accepted and "or none" in said(untold, tmp_path).text
    # less is claimed
    for path in (("functions", 0, "drive"), ("input", "agents", "f")):
        weaker = told(data, ("agents", *path), str(2 * F(at(data, ("agents", *path)))))
        assert check(weaker).accepted and said(weaker, tmp_path).code == 0


@pytest.mark.few(0)
def test_velocities_that_need_not_vanish_and_inputs_without_a_bound_are_rejected(tmp_path: Path) -> None:
    program()
    slow = made("velocities that need not vanish")
    ends = {label: [[*row, "0"] for row in rows] for label, rows in slow["agents"]["final_state"].items()}
    forged = resealed(changed(slow, ("agents", "final_state"), ends))
    assert not check(forged).accepted
    code, text = said(forged, tmp_path)
    assert code == 1 and "1 derivatives are due" in text
    step = next(step for step in made("plain")["proof"] if step["kind"] == "agent-input")
    for name in ("velocities that need not vanish", "no bound of the input"):
        data = made(name)
        bound = {"agents": dict.fromkeys(data["problem"]["graph"]["nodes"], "1000000000"), "largest": "1000000000"}
        forged = changed({**data, "proof": [*data["proof"], step]}, ("agents", "input"), bound)
        assert not check(resealed(forged)).accepted
        code, text = said(resealed(forged), tmp_path)
        assert code == 1 and "agent-input" in text


@pytest.mark.few(0)
def test_the_common_motion_is_verified_however_strong_the_damping(tmp_path: Path) -> None:
    program()
    for alpha in (25, "12345678901234567/1000000000000000"):
        data = document(SignedDigraph.from_edges(GRAPHS["camps"]), STRONG, {"cascade": alpha}, 1)
        assert check(data).accepted
        code, text = said(data, tmp_path)
        assert code == 0 and not {"agent-motion of agents", "agents.motion", "agents.final_state"} & named(text)


def test_where_no_function_used_has_a_deviation_it_is_named_that_all_agree(tmp_path: Path) -> None:
    program()
    data = made("every function")
    functions = data["decays"]
    k = next(k for k, f in reversed(list(enumerate(functions))) if f["class"] == "full")
    proof = [o for o in data["proof"] if (o["kind"], o["of"]) != ("deviation", f"decays[{k}]")]
    proof = [o for o in proof if o["kind"] != "input-constants" or o["of"] == f"decays[{k}]"]
    proof = [o for o in proof if o["kind"] != "agent-input"]
    data = without({**data, "proof": proof}, ("decays", k, "deviation"))
    data = without(data, ("agents", "input"))
    data = resealed(
        changed(data, ("agents", "functions"), [f for f in data["agents"]["functions"] if f["function"] == k])
    )
    assert check(data).accepted
    code, text = said(data, tmp_path)
    assert code == 4 and "not checked claim, that all agree at the deadline" in text
    assert {"agent-motion of agents", "agents.motion"} <= named(text)


def own_mutants(data: Json, every: int, start: int, nudges: int) -> list[tuple[tuple[str | int, ...], Json]]:
    """Changes of what the cascade has, and small ones of numbers anywhere."""
    parts = ("agents", "problem", "proof", "verdict")
    small = nudged(data, ("agents", "problem", "decays"), start, nudges, told)
    return [(path, x) for path, x in mutants(data, every, start) if path[0] in parts] + list(small)


def test_a_cascade_on_a_large_form_is_told_in_one_line(tmp_path: Path) -> None:
    program()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graph_certification, "EXACT_NODES", 0)
        patch.setattr(final_states, "EXACT_NODES", 0)
        data = document(SignedDigraph.from_edges(GRAPHS["singles"]), STRONG, {"method": "perron"}, 1)
    assert check(data).accepted
    code, text = said(data, tmp_path)
    assert code == 2 and "large form" in text and "use ptcc check" in text and text.count("\n") == 1


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["plain", "formation in the plane", "sliding variables"])
def test_of_some_mutants_of_the_cascade_none_is_accepted_unless_true_or_not_checked(name: str, tmp_path: Path) -> None:
    program()
    for path, mutant in own_mutants(made(name), 149, 5, 8):
        compare(mutant, path, tmp_path, UNREAD)


@pytest.mark.campaign
@pytest.mark.parametrize("name", SETTINGS)
def test_of_hundreds_of_mutants_of_the_cascade_none_is_accepted_unless_true_or_not_checked(
    name: str, tmp_path: Path
) -> None:
    program()
    every, nudges = int(os.environ.get("PTCC_MUTANTS_EVERY", 5)), int(os.environ.get("PTCC_FUZZ_COUNT", "60"))
    found = own_mutants(made(name), every, 1, nudges)
    causes = [compare(mutant, path, tmp_path, UNREAD) for path, mutant in found]
    assert len(causes) > 100


def random_document(seed: int) -> Json:
    """One of every class of graphs, nominal and sliding-mode, strong and weak, with and without states."""
    classes = all_classes()
    graph = random_graph(np.random.default_rng(seed), **classes[seed % len(classes)][1]).graph
    rng = np.random.default_rng([8, seed])
    k, alpha = F(int(rng.integers(1, 60)), 2), F(int(rng.integers(1, 40)), 8)
    rho1 = F(int(rng.integers(1, 5)), 4)
    protocol: Any = NominalProtocol(T="3/2", rho1=rho1, rho2=k, kappa=1)
    if seed % 4 == 1:
        protocol = SlidingModeProtocol(T_r=1, T_s="1/2", rho1=rho1, rho2=k, kappa=1, mu1=2, delta=1)
    method = ("paper", "best")[seed % 11 == 0]
    return document(graph, protocol, {"cascade": alpha, "method": method, "offsets": seed % 3 == 0}, seed % 4, seed)


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", [3, 14, 25, 41])
def test_what_the_checker_accepts_of_graphs_of_some_classes_the_verified_one_accepts(seed: int, tmp_path: Path) -> None:
    program()
    data = random_document(seed)
    assert check(data).accepted
    code, text = said(data, tmp_path)
    assert code == 0, text


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(5))
def test_what_the_checker_accepts_of_random_cascades_the_verified_one_accepts(part: int, tmp_path: Path) -> None:
    program()
    for seed in range(part, int(os.environ.get("PTCC_VERIFIED_AGENTS", 150)), 5):
        data = random_document(seed)
        assert check(data).accepted
        code, text = said(data, tmp_path)
        # agents that hear nobody are not covered
        resting = code == 4 and not at(data, EDGES)
        assert code == 0 or resting or (code == 2 and any(word in text for word in UNREAD)), (seed, text)
