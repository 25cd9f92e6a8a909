"""Agents of order n before the checker that is itself proved: what is true is accepted, and what is forged is not."""

from __future__ import annotations

import os
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agent_documents import Setting, ball, damped, ends, exponential
from agent_documents import document as made
from generators import all_classes, random_graph
from mutations import Json, at, changed, mutants, nudged, resealed, without
from selection import every
from verified import compare, named, program, said

from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks

F = Fraction
SOURCES = Path(__file__).resolve().parents[2] / "formal"
CAMPS = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)])
SETTINGS = {
    "double integrators": Setting(),
    "drag in the plane": Setting(plant=(F(0), F(1, 3)), dimension=2),
    "oscillators, three pieces": Setting(plant=(F(1), F(-1, 3)), pieces=3, R=F(5)),
    "no rho1": Setting(order=3, rho1=F(0)),
    "order 1": Setting(order=1),
    "at rest": Setting(damping=F(2), plant=(F(0), F(1, 3))),
    "sliding variables": Setting(slides=True, dimension=2),
    "every Lyapunov function": Setting(order=3, method="best"),
    "order 4 without states": Setting(order=4, start=False),
    "capped gain": Setting(cap=F(7), R=F(5)),
    "capped gain, slow decay": Setting(cap=F(5), R=F(3)),
    "capped from the beginning": Setting(cap=F(1, 2)),
    "capped at its first value": Setting(order=3, cap=F(5, 4)),
    "capped gain, sliding variables": Setting(order=3, cap=F(20), slides=True, dimension=2),
    "capped gain, drag": Setting(cap=F(9), plant=(F(0), F(1, 3)), pieces=2),
    "capped gain, every Lyapunov function": Setting(cap=F(100), method="best"),
    "capped gain without states": Setting(cap=F(7), start=False),
}
#: What the executable says of a form that it does not read.
UNREAD = ("large form", "undecided", "radius", "dominance", "weak components")


@pytest.mark.few(1)
@pytest.mark.parametrize("name", SETTINGS)
def test_certificates_of_agents_are_accepted_and_every_obligation_is_verified(name: str, tmp_path: Path) -> None:
    program()
    document = made(CAMPS, SETTINGS[name])
    assert check(document).accepted
    code, text = said(document, tmp_path)
    assert code == 0, text
    listed = [f"{o['kind']} of {o['of']}" for o in document["proof"]]
    verified = re.findall(r"^verified    ([^:\n]*)", text, re.MULTILINE)
    assert sorted(verified) == sorted(listed) and not named(text)


def test_the_statement_is_one_more_file_of_as_many_lines_as_is_said() -> None:
    text = re.sub(r"\(\*.*?\*\)", "", (SOURCES / "AgentCertificate.v").read_text("utf-8"), flags=re.DOTALL)
    lines = [line for line in text.splitlines() if line.strip()]
    assert max(map(len, lines)) <= 120
    assert [line for line in lines if "Require" in line] == [
        "Require Import ZArith QArith Qreals List Bool Reals.",
        "From Coquelicot Require Import Coquelicot.",
        "Require Import Certificate.",
    ]
    for page in (SOURCES / "README.md", SOURCES.parent / "docs" / "theory" / "verified-checker.md"):
        assert f"{len(lines)} more" in page.read_text("utf-8")


def test_a_formation_of_single_integrators_is_told_in_one_line(tmp_path: Path) -> None:
    program()
    places = Agents(order=1, offsets=[1, 2, 3, 4])
    formation = certify(
        CAMPS, NominalProtocol(1, 1, 1, 4), [1, 2, 3, 5], agents=places, asks=Asks(simulation=False)
    ).to_dict()
    assert check(formation).accepted
    code, text = said(formation, tmp_path)
    assert code == 2 and "formation" in text and "use ptcc check" in text and text.count("\n") == 1


@pytest.mark.few(0)
def test_phases_are_named_as_not_checked_and_the_rest_is_verified(tmp_path: Path) -> None:
    program()
    agents = Agents(order=3, drag="1/3")
    document = certify(
        CAMPS, NominalProtocol(1, 1, 1, 4), [1, 2, 3, 5], agents=agents, asks=Asks(simulation=False)
    ).to_dict()
    assert check(document).accepted and document["phases"]
    code, text = said(document, tmp_path)
    assert code == 0, text
    assert {part for part in named(text) if part.startswith("agent-phase")} == {
        f"agent-phase of phases[{k}]" for k in range(len(document["phases"]))
    }
    assert "not checked phases" in text


def told(document: Json, path: tuple[str | int, ...], new: Any) -> Json:
    """A change that the proof tells as well, and a digest that fits."""
    for k, stated in enumerate(document["proof"]):
        if stated["of"] == "agents" and path[0] == "agents" and path[-1] in stated.get("numbers", {}):
            document = changed(document, ("proof", k, "numbers", path[-1]), new)
    return resealed(changed(document, path, new))


def test_what_is_forged_is_rejected_by_both_checkers(tmp_path: Path) -> None:
    program()
    document = made(CAMPS, Setting())
    own = document["agents"]
    more = lambda text: str(F(text) * F(1001, 1000))  # noqa: E731
    for path, new, where in (
        (("agents", "rate"), str(F(own["rate"]) * F(11, 10)), "agent-decrease"),
        (("agents", "coupling"), more(own["coupling"]), "agent-"),
        (("agents", "gains", 1), more(own["gains"][1]), "agent-"),
        (("agents", "lower_triangle", 1, 1), more(own["lower_triangle"][1][1]), "agent-"),
        (("agents", "points"), ["0", "1/10"], "agent-decrease"),
        (("agents", "motion", 0, 1), more(own["motion"][0][1]), "agent-motion"),
        (
            ("agents", "final_state", "f", 0, 1),
            str(F(own["final_state"]["f"][0][1]) + F(1, 10**9)),
            "agent-final-state",
        ),
        (("agents", "offsets", "b", 0), "77", "agent-final-state"),
        (("agents", "input", "agents", "b"), str(F(own["input"]["agents"]["b"]) * F(999, 1000)), "input"),
        (("agents", "plant", 0), "30", "agent-"),
        (("agents", "own", 0), "1", "feedback"),
        (("agents", "initial_state", "b", 0), ["1"], "derivatives"),
        (("agents", "order"), 3, "number of rows"),
        (("problem", "gain", "rho2"), "1/4", "r k is not above"),
    ):
        forged = told(document, path, new)
        assert not check(forged).accepted, path
        code, text = said(forged, tmp_path)
        assert code == 1 and where in text, (path, text)


def refused(document: Json, path: tuple[str | int, ...], new: Any, where: str, folder: Path) -> None:
    """Both checkers reject a change that the proof tells as well."""
    forged = told(document, path, new)
    assert not check(forged).accepted, path
    code, text = said(forged, folder)
    assert code == 1 and where in text, (path, text)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["capped gain", "capped gain, slow decay", "capped from the beginning"])
def test_what_is_forged_under_a_cap_is_rejected_by_both_checkers(name: str, tmp_path: Path) -> None:
    program()
    document = made(CAMPS, SETTINGS[name])
    own = document["agents"]
    late = own["points"] == []
    times = lambda text, q: str(F(text) * F(q))  # noqa: E731
    rows, entry = own["residual"]["agents"], own["input"]["agents"]
    for path, new, where in (
        (("agents", "residual", "clock"), times(own["residual"]["clock"], "1.000001"), "agent-residual"),
        (("agents", "residual", "agents", "b", 0), times(rows["b"][0], "0.99999"), "agent-residual"),
        (("agents", "residual", "agents", "f", 1), times(rows["f"][1], "0.99999"), "agent-residual"),
        (("agents", "residual", "agents", "a", 0), "-1", "agent-residual"),
        (("agents", "input", "agents", "b"), times(entry["b"], "0.99999"), "input"),
        (("agents", "gain_cap"), times(own["gain_cap"], "2"), "points" if not late else "agent-"),
        (("agents", "gain_cap"), "0", "not positive"),
        (("agents", "points"), ["0", "4/5"] if late else ["0", *own["points"]], "points"),
        (("agents", "rate"), times(own["rate"], "1.01"), "agent-decrease"),
        (("agents", "own", 1), "1", "feedback"),
    ):
        refused(document, path, new, where, tmp_path)
    untold = resealed(without(document, ("agents", "residual")))
    assert not check(untold).accepted and "iff" in said(untold, tmp_path).text
    # less is claimed
    for path, new in (
        (("agents", "residual", "agents", "b", 0), times(rows["b"][0], 2)),
        (("agents", "input", "agents", "b"), entry["b"]),
    ):
        weaker = told(document, path, new)
        assert check(weaker).accepted and said(weaker, tmp_path).code == 0


@pytest.mark.few(0)
@every(3)
def test_where_agents_that_meet_at_rest_end_is_verified_and_what_is_forged_of_it_is_rejected(
    every: int, tmp_path: Path
) -> None:
    program()
    settings = (
        SETTINGS["at rest"],
        Setting(damping=F(1, 3), rho1=F(0)),
        Setting(damping=F(5), plant=(F(0), F(-2))),
        Setting(damping=F(9, 2), rho1=F(2), dimension=2),
        Setting(damping=F(25), plant=(F(0), F(-1))),
        Setting(damping=F(2), plant=(F(0), F(-40))),
        Setting(damping=F(2), rho1=F(1), T=F(500)),
    )
    for setting in settings[::every]:
        document = made(CAMPS, setting)
        assert check(document).accepted
        code, text = said(document, tmp_path)
        assert code == 0 and {"agent-motion", "agent-final-state"} <= set(
            re.findall(r"verified +(\S+) of agents", text)
        )
        mid, radius = ends(document["agents"]["motion"][0][1])
        far = mid + 2 * radius + F(1, 10**30)
        away = {"mid": str(far), "radius": str(radius)} if radius else str(far)
        refused(document, ("agents", "motion", 0, 1), away, "agent-motion", tmp_path)
        refused(document, ("agents", "motion", 1, 1), "1/1000000", "agent-motion", tmp_path)
        middle, _ = ends(document["agents"]["final_state"]["f"][0][0])
        moved = str(middle + F(1, 10**6) * max(1, abs(middle)))
        refused(document, ("agents", "final_state", "f", 0, 0), moved, "agent-final-state", tmp_path)
        refused(document, ("agents", "final_state", "f", 0, 1), "1/10", "agent-final-state", tmp_path)
    # where a_2 + f_2 rho1 is 0 the common motion is known exactly
    document = made(CAMPS, Setting(damping=F(2), plant=(F(0), F(-1))))
    wide = {"mid": document["agents"]["motion"][0][1], "radius": "1/1000"}
    refused(document, ("agents", "motion", 0, 1), wide, "known exactly", tmp_path)
    assert said(document, tmp_path).code == 0
    far = told(document, ("problem", "gain", "rho1"), "300")
    assert not check(far).accepted
    code, text = said(far, tmp_path)
    assert code == 1


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "setting",
    [
        SETTINGS["drag in the plane"],
        Setting(plant=(F(20), F(-10))),
        Setting(order=1, plant=(F(49),)),
        Setting(order=1, plant=(F(-40),)),
        Setting(order=3, plant=(F(1, 3), F(0), F(-2)), slides=True),
        SETTINGS["capped gain, drag"],
    ],
)
def test_where_agents_that_move_by_themselves_end_is_verified_and_what_is_forged_of_it_is_rejected(
    setting: Setting, tmp_path: Path
) -> None:
    program()
    document = made(CAMPS, setting)
    code, text = said(document, tmp_path)
    assert code == 0 and {"agent-motion", "agent-final-state"} <= set(re.findall(r"verified +(\S+) of agents", text))
    for i in range(setting.order):
        for j in range(setting.order):
            middle, radius = ends(document["agents"]["motion"][i][j])
            for mid in (middle + 2 * radius, middle - 2 * radius):
                away = {"mid": str(mid), "radius": str(radius)}
                refused(document, ("agents", "motion", i, j), away, "agent-motion", tmp_path)
            if middle not in (0, 1):  # which are exact where drag alone moves them
                refused(document, ("agents", "motion", i, j), str(middle), "agent-motion", tmp_path)
    for i, end in enumerate(document["agents"]["final_state"]["f"][0]):
        middle, radius = ends(end)
        away = {"mid": str(middle + 3 * radius), "radius": str(radius)}
        refused(document, ("agents", "final_state", "f", 0, i), away, "agent-final-state", tmp_path)
        refused(document, ("agents", "final_state", "f", 0, i), str(middle), "agent-final-state", tmp_path)


@pytest.mark.few(0)
def test_the_input_of_agents_that_meet_at_rest_is_verified_and_what_is_forged_of_it_is_rejected(tmp_path: Path) -> None:
    program()
    tight = {
        "at rest": SETTINGS["at rest"],
        "thrust": Setting(damping=F(5), plant=(F(0), F(-2))),
        "plane": Setting(damping=F(9, 2), rho1=F(2), dimension=2),
        "slides": Setting(damping=F(2), slides=True, dimension=3),
    }
    for name, setting in tight.items():
        document = made(CAMPS, setting)
        code, text = said(document, tmp_path)
        assert code == 0 and "verified    agent-input of agents" in text, name
        own = document["agents"]["input"]["agents"]
        for label in own:
            lower = changed(document, ("agents", "input", "agents", label), str(F(own[label]) * (1 - F(1, 10**9))))
            rest = max(map(F, lower["agents"]["input"]["agents"].values()))
            refused(lower, ("agents", "input", "largest"), str(rest), "agent-input", tmp_path)
        refused(document, ("agents", "input", "largest"), "7", "largest input", tmp_path)
    # a bound that is true at the begin where the own velocity grows faster than the gain fades
    for setting in (Setting(damping=F(1, 3)), Setting(damping=F(2), plant=(F(0), F(-3)))):
        document, known = made(CAMPS, setting), made(CAMPS, SETTINGS["at rest"])
        assert "input" not in document["agents"]
        steps = [o for o in known["proof"] if o["kind"] == "agent-input"]
        forged = {**document, "proof": document["proof"] + steps}
        vast = {"agents": dict.fromkeys(known["agents"]["input"]["agents"], "1000000"), "largest": "1000000"}
        refused(forged, ("agents", "input"), vast, "agent-input", tmp_path)


def test_a_decrease_that_holds_but_at_the_cap_is_rejected(tmp_path: Path) -> None:
    program()
    free, capped = Setting(R=F(5)), Setting(cap=F(7), R=F(5))
    document = made(CAMPS, capped)
    for key in ("lower_triangle", "gains"):
        document = changed(document, ("agents", key), made(CAMPS, free)["agents"][key])
    document = resealed(document)
    assert not check(document).accepted
    code, text = said(document, tmp_path)
    assert code == 1 and "agent-decrease" in text


def test_what_is_left_is_named_where_the_decay_is_too_long_to_be_enclosed(tmp_path: Path) -> None:
    program()
    document = made(CAMPS, Setting(order=1, cap=F(10) ** 120, R=F(2)))
    assert check(document).accepted
    code, text = said(document, tmp_path)
    assert code == 4 and {"agent-residual of agents", "agents.residual"} <= named(text)


def test_where_no_function_used_has_a_deviation_it_is_named_that_all_agree(tmp_path: Path) -> None:
    program()
    document = made(CAMPS, Setting(order=3, method="best", start=False))
    functions = document["decays"]
    k = next(k for k, f in reversed(list(enumerate(functions))) if f["class"] == "full")
    proof = [o for o in document["proof"] if o["kind"] != "input-constants"]
    proof = [o for o in proof if (o["kind"], o["of"]) != ("deviation", f"decays[{k}]")]
    document = without({**document, "proof": proof}, ("decays", k, "deviation"))
    document = resealed(changed(document, ("agents", "functions"), [{"function": k}]))
    assert check(document).accepted
    code, text = said(document, tmp_path)
    assert code == 4 and "not checked claim, that all agree at the deadline" in text
    assert {"agent-motion of agents", "agents.motion"} <= named(text)


@pytest.mark.parametrize("labels", [["a"], ["a", "b", "c"]])
def test_where_agents_end_of_whom_none_listens_is_verified(labels: list[str], tmp_path: Path) -> None:
    program()
    graph = SignedDigraph.from_edges([], nodes=labels)
    for setting in (Setting(order=3, dimension=2), SETTINGS["drag in the plane"], SETTINGS["at rest"]):
        document = made(graph, setting)
        assert check(document).accepted and document["agents"]["functions"] == []
        code, text = said(document, tmp_path)
        assert code == 0 and not named(text)
        row = document["agents"]["final_state"][labels[0]][0]
        middle, radius = ends(row[0])
        away = {"mid": str(middle + 3 * radius), "radius": str(radius)} if radius else str(middle + F(1, 10**30))
        refused(document, ("agents", "final_state", labels[0], 0, 0), away, "agent-final-state", tmp_path)


def test_late_messages_and_moving_leaders_beside_agents_are_rejected(tmp_path: Path) -> None:
    program()
    for key in ("messages", "leaders"):
        forged = resealed({**made(CAMPS, Setting()), key: {}})
        assert not check(forged).accepted
        code, text = said(forged, tmp_path)
        assert code == 1 and key in text


def again(mutant: Json, path: Any, new: str) -> Json:
    return told(mutant, path, new)


def own_mutants(document: Json, every: int, start: int, nudges: int) -> list[tuple[tuple[str | int, ...], Json]]:
    """Changes of what agents of order n have, and small ones of numbers anywhere."""
    parts = ("agents", "problem", "proof", "verdict")
    small = nudged(document, ("agents", "problem", "decays"), start, nudges, again)
    return [(path, x) for path, x in mutants(document, every, start) if path[0] in parts] + list(small)


def holds(mid: Fraction, radius: Fraction, x: Any) -> bool:
    """Whether an interval holds a ball, as far as that can be told."""
    return not abs(x - ball(mid)) > ball(radius)


def sharper(setting: Setting) -> Any:
    """What knows that a common motion holds that is told within less than ``ptcc check`` encloses it."""

    def known(document: Json, path: tuple[str | int, ...], place: str, left: set[str]) -> bool:
        if path[:2] != ("agents", "motion"):
            return False
        if setting.damping:
            return path[2:4] == (0, 1) and damped(setting, lambda x: holds(*ends(at(document, path[:4])), x))
        stated = iter([ends(x) for row in document["agents"]["motion"] for x in row])
        inside = exponential(setting, lambda x: holds(*next(stated), x))
        return all(map(all, inside))

    return known


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["double integrators", "drag in the plane", "at rest", "capped gain"])
def test_of_some_mutants_of_agents_none_is_accepted_unless_true_or_not_checked(name: str, tmp_path: Path) -> None:
    program()
    document = {**made(CAMPS, SETTINGS[name]), "unverified": {}}
    for path, mutant in own_mutants(document, 97, 5, 10):
        compare(mutant, path, tmp_path, UNREAD, sharper(SETTINGS[name]))


@pytest.mark.campaign
@pytest.mark.parametrize("name", SETTINGS)
def test_of_hundreds_of_mutants_of_agents_none_is_accepted_unless_true_or_not_checked(
    name: str, tmp_path: Path
) -> None:
    """At least 1,000 in all."""
    program()
    document = {**made(CAMPS, SETTINGS[name]), "unverified": {}}
    every, nudges = int(os.environ.get("PTCC_MUTANTS_EVERY", 5)), int(os.environ.get("PTCC_FUZZ_COUNT", "60"))
    found = own_mutants(document, every, 1, nudges)
    causes = [compare(mutant, path, tmp_path, UNREAD, sharper(SETTINGS[name])) for path, mutant in found]
    assert len(causes) > 120 and at(document, ("verdict",)) == "certified"


def random_setting(seed: int) -> Setting:
    """Orders 1 to 4, chains and others, with and without ``rho1``, sliding variables, a cap, and slow decay."""
    rng = np.random.default_rng([7, seed])
    n = 1 + seed % 4
    plant = tuple(F(int(x), 10) for x in rng.integers(-10, 11, n)) if seed % 3 == 0 else ()
    rate = F(2 * n - 1) if seed % 7 == 0 else None
    first = F(seed % 5, 8) + F(3, 4)
    cap = [None, None, None, first / 2, first, first * 3 / 2, F(7), F(50), F(10**6)][seed % 9]
    return Setting(
        order=n, dimension=1 + seed % 2, plant=plant, R=rate, rho1=F(seed % 5, 8), slides=seed % 4 == 1, cap=cap,
        method=("paper", "best")[seed % 11 == 0],
    )  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(5))
def test_what_the_checker_accepts_of_random_agents_the_verified_one_accepts(part: int, tmp_path: Path) -> None:
    program()
    classes = all_classes()
    for seed in range(part, int(os.environ.get("PTCC_VERIFIED_AGENTS", 150)), 5):
        name, kwargs = classes[seed % len(classes)]
        graph = random_graph(np.random.default_rng(seed), **kwargs).graph
        document = made(graph, random_setting(seed), seed)
        assert check(document).accepted
        code, text = said(document, tmp_path)
        assert code == 0 or (code == 2 and any(word in text for word in UNREAD)), (name, seed, text)
