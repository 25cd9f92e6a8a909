"""Families and the checker that is itself proved: it accepts what ``ptcc check`` accepts, or says why not."""

from __future__ import annotations

import json
import os
import random
import re
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family, family_certificate
from common_kernel_families import KINDS as SHARED
from common_kernel_families import random_family as with_common_kernel
from families import KINDS, random_family
from mutations import EDGES, changed, mutants, resealed, without
from row_families import random_followers
from verified import compare, named, program, said

from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import follower_functions
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.constrained_switching import ClockShares, JointWindows
from ptcc_certify.theorems.family_behaviour import decide

Json = dict[str, Any]
NOMINAL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
SIGNED = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", -2, -1)])
SIGNALS = ("any", "constant", ClockShares(["1/2", "1/2"]), JointWindows(1, on="1/5", clock="s"))
#: Families of which what becomes depends on the signal, by the kind of the witness.
DEPENDING = {
    "moves in another mode": Family.switching(
        [SignedDigraph.from_edges([("l", "a", 1), ("m", "a", w), ("a", "b", -1)]) for w in (1, 2)]
    ),
    "moves by a weight": Family.from_intervals([("l", "a", 1, 2), ("m", "a", 1, 1), ("a", "b", -1, -1)]),
    "moves by an undirected weight": Family.from_intervals(
        [("a", "b", 1, 1), ("b", "c", -1, -1), ("a", "c", 0, 1)], undirected=True
    ),
    "other numbers": Family.switching(
        [
            SignedDigraph.from_edges(edges, nodes=["a", "b", "c"])
            for edges in ([("a", "b", 1)], [("a", "b", 1), ("c", "b", -1), ("b", "c", 2), ("b", "a", -1)])
        ]
    ),
}
#: What the executable says of a form of a family that it does not read.
UNREAD = ("function of rows", "function of squares", "side files", "more than 400 nodes", "entries")


def document(family: Family, seed: int = 0, protocol: Any = NOMINAL, **more: Any) -> Json:
    """A certificate of a family, from a random state."""
    draw = random.Random(seed)
    x0 = [Fraction(draw.randint(-1000, 1000), 100) for _ in range(family.n_nodes)]
    made = certify_family(family, protocol, x0, time_limit=3600, **more)
    return {**json.loads(made.to_json()), "unverified": {}}


def same_claim(found: Json, path: tuple[str | int, ...], place: str, left: set[str]) -> bool:
    """Whether a mutant claims what the certificate did, or no more than is named as not checked."""
    if place == "family-input of input" and path[0] == "decays":
        return True  # peaks as they were, which the changed function proves here as well
    if place == "family-final-state of final_state" and path[0] == "final_state":  # roots are rounded in another way
        told = found["final_state"][path[1]]
        wider = {**told, "radius": str(Fraction(told["radius"]) + Fraction(1, 2**40))}
        return check(resealed({**found, "final_state": {**found["final_state"], path[1]: wider}})).accepted
    if place == "proof":  # an obligation stands there twice
        (place,) = {f"{o['kind']} of {o['of']}" for o in found["proof"] if found["proof"].count(o) > 1}
    return place in left


def random_families(count: int) -> list[tuple[str, Family]]:
    """Families of all kinds, of 1 to 8 nodes."""
    found = []
    for seed in range(count):
        kind = KINDS[seed % len(KINDS)]
        found.append((f"{kind} {seed}", random_family(random.Random(seed), kind).family))
        shared = SHARED[seed % len(SHARED)]
        draw = np.random.default_rng(seed)
        uncertain = with_common_kernel(draw, shared, 3 + seed % 4, 1 + seed % 3, Fraction(seed % 3, 10), 0.3)
        found.append((f"shared {shared} {seed}", uncertain))
    return found


@cache
def signed(protocol: Any = NOMINAL) -> str:
    """The certificate of one uncertain mode with camps, as a text."""
    return json.dumps(document(SIGNED, protocol=protocol))


def decided(family: Family, protocol: Any = NOMINAL) -> Json:
    """The certificate of a family by the decision alone, without functions."""
    parts = tuple(ComponentProof(c, ()) for c in decide(family))
    made = certify_family(family, protocol, range(1, family.n_nodes + 1), time_limit=0.001)
    return {**json.loads(made.changed(parts=parts).to_json()), "unverified": {}}


def rows(seed: int) -> Json:
    """The certificate of a family of which every agent but one follows, with functions of rows alone."""
    family = random_followers(random.Random(seed), 1 + seed % 3, agree=True)
    parts = tuple(ComponentProof(c, tuple(follower_functions(c))) for c in decide(family))
    state = tuple(Fraction(k) for k in range(1, family.n_nodes + 1))
    return {**json.loads(family_certificate(family, NOMINAL, parts, state).to_json()), "unverified": {}}


def test_a_family_is_accepted_and_every_obligation_is_verified_or_named(tmp_path: Path) -> None:
    program()
    for protocol in (NOMINAL, SLIDING):
        found = json.loads(signed(protocol))
        assert check(found).accepted
        code, text = said(found, tmp_path)
        assert code == 0, text
        lines = re.findall(r"^(verified    |not checked )(\S+ of [^\s:]+)(?:: .*)?$", text, re.MULTILINE)
        assert sorted(what for _, what in lines) == sorted(f"{o['kind']} of {o['of']}" for o in found["proof"])
        assert "family-rate of decays[0].modes[0]" in {w for mark, w in lines if mark.startswith("verified")}


@pytest.mark.parametrize("signal", SIGNALS, ids=str)
def test_what_is_said_of_restricted_signals_is_named_and_boxes_are_verified(signal: Any, tmp_path: Path) -> None:
    program()
    pairs = [("a", "b", 1), ("b", "a", 1), ("b", "c", 2), ("c", "b", 2)], [("a", "c", 1), ("c", "a", 1)]
    several = [("l", "a", 1), ("m", "b", 1), ("a", "b", 1)], [("m", "a", 1), ("l", "b", 1), ("b", "a", 2)]
    for one, other in (pairs, several):
        found = document(switching(one, other), signal=signal)
        assert check(found).accepted
        code, text = said(found, tmp_path)
        assert code == (4 if "restricted" in found else 0), text
        listed = {f"{o['kind']} of {o['of']}" for o in found["proof"]}
        verified = set(re.findall(r"^verified    ([^:\n]*)", text, re.MULTILINE))
        assert verified | named(text) >= listed and not verified & named(text)
        assert "kept-box of boxes[" in " ".join(verified) and "boxes" not in named(text)
        assert ("restricted" in named(text)) == ("restricted" in found)
        apart = ("last-mode", "clock-shares", "joint-windows")
        assert not any(what.startswith(apart) or "restricted" in what for what in verified)


def switching(*modes: Any) -> Family:
    """A family of graphs that switch."""
    nodes = sorted({v for edges in modes for edge in edges for v in edge[:2]})
    return Family.switching([SignedDigraph.from_edges(edges, nodes=nodes) for edges in modes])


def test_followers_are_drawn_to_their_box_and_no_narrower_one_is_accepted(tmp_path: Path) -> None:
    program()
    found = document(
        switching([("l", "a", 1), ("m", "b", 1), ("a", "b", 1)], [("m", "a", 1), ("l", "b", 1), ("b", "a", 2)])
    )
    code, text = said(found, tmp_path)
    assert code == 0 and "verified    attracting-box of boxes[0]" in text and "verified    kept-box of boxes[1]" in text
    cases: list[Json] = [
        changed(found, ("boxes", 0, "rate"), str(Fraction(found["boxes"][0]["rate"]) * Fraction(101, 100)))
    ]
    for k, box in enumerate(found["boxes"]):
        for key, inwards in (("lower", Fraction(1, 100)), ("upper", Fraction(-1, 100))):
            for i, end in enumerate(box[key]):
                cases.append(changed(found, ("boxes", k, key, i), str(Fraction(end) + inwards)))
    assert len(cases) > 10
    for wrong in cases:
        sealed = resealed(wrong)
        assert not check(sealed).accepted
        code, text = said(sealed, tmp_path)
        assert code == 1 and "boxes" in text


#: Families whose final states are proved by what reaches the leaders, by Lyapunov functions, and by kept means.
ENDING = {
    "uncertain weights": SIGNED,
    "undirected": Family.switching(
        [
            SignedDigraph.from_edges([(s, t, w) for s, t, w in edges for s, t in ((s, t), (t, s))])
            for edges in ([("a", "b", 1), ("b", "c", -2)], [("a", "b", 3), ("b", "c", -1)])
        ]
    ),
    "two leaders": Family.from_intervals(
        [("l", "a", 1, 1), ("m", "a", 2, 2), ("a", "b", 1, 2), ("m", "n", -1, -1), ("n", "m", -1, -1)]
    ),
}


def narrower(entry: Any) -> list[Any]:
    """Two intervals, each without one end of this one."""
    if isinstance(entry, str):
        return [str(Fraction(entry) + d) for d in (Fraction(1, 10**6), Fraction(-1, 10**6))]
    middle, radius = Fraction(entry["mid"]), Fraction(entry["radius"])
    return [
        {"mid": str(middle + d * radius), "radius": str(radius * Fraction(98, 100))}
        for d in (Fraction(1, 50), Fraction(-1, 50))
    ]


@pytest.mark.few(0)
@pytest.mark.parametrize("protocol", [NOMINAL, SLIDING], ids=["nominal", "sliding"])
@pytest.mark.parametrize("name", ENDING)
def test_agents_end_in_their_intervals_and_no_narrower_one_is_accepted(
    name: str, protocol: Any, tmp_path: Path
) -> None:
    program()
    found = document(ENDING[name], protocol=protocol)
    code, text = said(found, tmp_path)
    assert code == 0 and "verified    family-final-state of final_state" in text, text
    assert not named(text) - {"input.sliding.bounded"}
    for label, entry in found["final_state"].items():
        for other in narrower(entry):
            sealed = resealed(changed(found, ("final_state", label), other))
            assert not check(sealed).accepted
            code, text = said(sealed, tmp_path)
            assert code == 1 and "family-final-state" in text


@pytest.mark.few(0)
def test_while_sliding_variables_move_the_ends_of_kept_means_are_verified_and_others_named(tmp_path: Path) -> None:
    program()
    for name, verified in (("undirected", True), ("uncertain weights", False)):
        made = certify_family(ENDING[name], SLIDING, [1, 2, 3], sigma0=[1, 0, "-1/2"], time_limit=3600)
        found = {**json.loads(made.to_json()), "unverified": {}}
        code, text = said(found, tmp_path)
        assert code == (0 if verified else 4) and ("final_state" in named(text)) != verified, text
        label = next(iter(found["final_state"]))
        sealed = resealed(changed(found, ("final_state", label), narrower(found["final_state"][label])[0]))
        assert not check(sealed).accepted and said(sealed, tmp_path).code == (1 if verified else 4)


def test_peaks_have_what_the_sliding_mode_adds(tmp_path: Path) -> None:
    program()
    found = json.loads(signed(SLIDING))
    code, text = said(found, tmp_path)
    assert code == 0 and "verified    family-input of input" in text
    lower = str(Fraction(found["input"]["peaks"]["b"]) - Fraction(1, 100))
    sealed = resealed(changed(found, ("input", "peaks", "b"), lower))
    assert not check(sealed).accepted
    code, text = said(sealed, tmp_path)
    assert code == 1 and "family-input" in text


def test_higher_rates_and_smaller_constants_than_are_proved_are_rejected(tmp_path: Path) -> None:
    program()
    found = json.loads(signed())
    function = found["decays"][0]
    rate = str(Fraction(function["rate"]) * Fraction(101, 100))
    faster = changed(found, ("decays", 0, "rate"), rate)
    for k, o in enumerate(faster["proof"]):
        if o["kind"] == "family-rate" and o["of"].startswith("decays[0]"):
            faster = changed(faster, ("proof", k, "numbers", "b"), rate)
    cases = [(faster, "decays[0]")]
    for key in ("inputs", "coordinates"):
        at = ("decays", 0, key, "b")
        cases.append((changed(found, at, str(Fraction(function[key]["b"]) * Fraction(99, 100))), "decays[0]"))
    mean = ("decays", 0, "means", 0, "constant")
    smaller = str(Fraction(function["means"][0]["constant"]) * Fraction(99, 100))
    cases.append((changed(found, mean, smaller), "decays[0]"))
    lower = str(Fraction(found["input"]["peaks"]["b"]) * Fraction(1, 2))
    cases.append((changed(found, ("input", "peaks", "b"), lower), "family-input of input"))
    cases.append((changed(found, ("claim", "behaviour"), "stability"), "nodes of a function"))
    for wrong, where in cases:
        code, text = said(resealed(wrong), tmp_path)
        assert code == 1 and where in text


def test_rows_are_verified_and_a_higher_rate_of_theirs_is_rejected(tmp_path: Path) -> None:
    program()
    found = rows(2)
    code, text = said(found, tmp_path)
    assert code == 0 and "verified    family-rows of decays[0]" in text, text
    rate = str(Fraction(found["decays"][0]["rate"]) * Fraction(1001, 1000))
    place = next(k for k, o in enumerate(found["proof"]) if o["kind"] == "family-rows")
    faster = changed(found, ("decays", 0, "rate"), rate)
    code, text = said(resealed(changed(faster, ("proof", place, "numbers", "b"), rate)), tmp_path)
    assert code == 1 and "decays[0]" in text, text


@pytest.mark.few(0)
def test_without_functions_it_is_verified_that_components_come_to_rest(tmp_path: Path) -> None:
    program()
    seen = set()
    for seed, (name, family) in enumerate(random_families(9)):
        found = decided(family, SLIDING if seed % 3 == 2 else NOMINAL)
        assert check(found).accepted and found["decays"] == []
        code, text = said(found, tmp_path)
        assert code == 0, (name, text)
        behaviours = {c.behaviour for c in decide(family)}
        assert "verified    family-claim of graph\n" in text and "claim" not in named(text), (name, text)
        if behaviours == {"stability"}:
            assert "verified    family-final-state of final_state" in text, (name, text)
        seen |= behaviours
    assert seen > {"stability", "bipartite consensus", "interval bipartite consensus", "bipartite containment"}


def test_without_functions_a_common_kernel_that_is_none_is_rejected(tmp_path: Path) -> None:
    program()
    shares = {"a": {"1": "1/2", "2": "1/2"}}
    depends = decided(DEPENDING["moves in another mode"])
    bent = decided(Family.switching([SignedDigraph.from_edges([("l", "a", 1), ("m", "a", 1)])]))
    more = decided(Family.switching([SignedDigraph.from_edges([("a", "b", 1)], nodes=["a", "b"])]))
    fewer = decided(Family.switching([SignedDigraph.from_edges([("a", "b", -1), ("b", "a", 1)])]))
    for forged in (
        with_witness(depends, "bipartite containment", [{"rows": shares}]),
        with_witness(bent, "bipartite containment", [{"rows": {"a": {"1": "1/2", "2": "1/4"}}}]),
        with_witness(more, "stability", [None]),
        with_witness(fewer, "bipartite consensus", [None]),
    ):
        assert not check(forged).accepted
        code, text = said(forged, tmp_path)
        assert code == 1 and "claim" in text, text


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", DEPENDING)
def test_that_a_component_depends_on_the_signal_is_verified_by_its_witness(kind: str, tmp_path: Path) -> None:
    program()
    found = decided(DEPENDING[kind])
    (claim,) = (o for o in found["proof"] if o["kind"] == "family-claim")
    (witness,) = claim["witness"]
    assert found["claim"]["behaviour"] == "depends on the signal" and check(found).accepted
    assert (witness is None) == (kind == "other numbers")
    assert witness is None or ("edge" not in witness) == (kind == "moves in another mode")
    code, text = said(found, tmp_path)
    assert code == 0 and "verified    family-claim of graph\n" in text, text
    for path, mutant in mutants(found, every=3):
        compare(mutant, path, tmp_path, UNREAD, same_claim)
    other = {"mode": 0, "other": 0, "state": {}} if witness is None else None
    code, text = said(with_witness(found, "depends on the signal", [other]), tmp_path)
    assert code == 1 and "witness" in text, text


def test_a_state_that_does_not_rest_or_does_not_move_proves_nothing(tmp_path: Path) -> None:
    program()
    found = decided(DEPENDING["moves in another mode"])
    (witness,) = next(o["witness"] for o in found["proof"] if o["kind"] == "family-claim")
    state = witness["state"]
    near = {"mid": state["a"], "radius": "1/100"}
    cases: list[tuple[bool, Json]] = [
        (True, {"state": {**state, "a": near, "b": {**near, "mid": state["b"]}}}),
        (False, {"state": {**state, "a": near}}),  # what hears it has no radius
        (False, {"state": {**state, "a": str(Fraction(state["a"]) + Fraction(1, 1000))}}),
        (False, {"state": {**state, "a": {**near, "radius": "1"}, "b": {"mid": state["b"], "radius": "1"}}}),
        (False, {"state": {k: {"mid": x, "radius": "1/1000"} for k, x in state.items()}}),  # leaders are exact
        (False, {"state": {}}),
        (False, {"other": witness["mode"]}),
        (False, {"mode": witness["other"]}),
        (False, {"edge": ["l", "a", 1]}),
        (False, {"mode": 2}),
    ]
    for accepted, change in cases:
        changed_ = with_witness(found, "depends on the signal", [{**witness, **change}])
        assert check(changed_).accepted == accepted, change
        code, text = said(changed_, tmp_path)
        assert (code == 0) == accepted and code in (0, 1), (change, text)


def with_witness(found: Json, behaviour: str, witness: Any) -> Json:
    """The same with another behaviour of its one component, and what is to prove it."""
    place = next(k for k, o in enumerate(found["proof"]) if o["kind"] == "family-claim")
    return resealed(changed(changed(found, ("claim", "behaviour"), behaviour), ("proof", place, "witness"), witness))


@pytest.mark.few(0)
def test_a_behaviour_that_comes_after_the_one_that_fits_is_rejected(tmp_path: Path) -> None:
    program()
    stable = document(Family.from_intervals([("a", "b", 1, 2), ("b", "a", -1, -1), ("b", "c", -2, -1)]))
    for forged in (
        with_witness(stable, "interval bipartite consensus", [{"rows": {}}]),
        with_witness(stable, "bipartite containment", [{"rows": {}}]),
        with_witness(json.loads(signed()), "interval bipartite consensus", [{"rows": {"c": {"1": "-1"}}}]),
    ):
        assert not check(forged).accepted
        code, text = said(forged, tmp_path)
        assert code == 1 and "claim" in text


@pytest.mark.few(0)
def test_what_drives_and_peaks_are_due_of_is_neither_added_nor_left_out(tmp_path: Path) -> None:
    program()
    quiet = json.loads(signed())
    made = certify_family(SIGNED, SLIDING, [1, 2, 3], sigma0=[1, 0, 0], time_limit=3600)
    moving = {**json.loads(made.to_json()), "unverified": {}}
    code, text = said(resealed(moving), tmp_path)
    assert code == 4 and "not checked drives" in text
    others = [o for o in moving["proof"] if o["kind"] != "family-drive"]
    for forged in (
        {**quiet, "drives": ["0"] * len(quiet["decays"])},
        {**quiet, "drives": None},
        without({**moving, "proof": others}, ("drives",)),
        {**moving, "proof": others},
        {**moving, "drives": ["0"] * (len(moving["decays"]) + 1)},
        {**moving, "drives": "0"},
        without(moving, ("input", "peaks")),
    ):
        sealed = resealed(forged)
        assert not check(sealed).accepted and said(sealed, tmp_path).code == 1


def test_a_weight_of_the_other_sign_is_rejected(tmp_path: Path) -> None:
    program()
    found = json.loads(signed())
    edges = found["problem"]["graph"]["modes"][0]["edges"]
    at = next(k for k, e in enumerate(edges) if e[:2] == ["b", "c"])
    code, text = said(resealed(changed(found, (*EDGES, at), ["b", "c", "1", "2"])), tmp_path)
    assert code == 1 and "SHA-256" in text


@pytest.mark.few(0)
def test_of_some_mutants_of_a_family_none_is_accepted_unless_true_or_not_checked(tmp_path: Path) -> None:
    program()
    found = json.loads(signed())
    for path, mutant in mutants(found, every=23):
        compare(mutant, path, tmp_path, UNREAD, same_claim)


@pytest.mark.campaign
@pytest.mark.parametrize("number", range(4))
def test_of_many_mutants_of_rows_none_is_accepted_unless_true_or_not_checked(number: int, tmp_path: Path) -> None:
    program()
    every = int(os.environ.get("PTCC_MUTANTS_EVERY", 1))
    count = sum(
        1
        for path, m in mutants(rows(2 + 4 * number), every=every)
        if compare(m, path, tmp_path, UNREAD, same_claim) is not None
    )
    assert count > 100 // every


@pytest.mark.campaign
@pytest.mark.parametrize("number", range(6))
def test_of_many_mutants_of_families_none_is_accepted_unless_true_or_not_checked(number: int, tmp_path: Path) -> None:
    program()
    every = int(os.environ.get("PTCC_MUTANTS_EVERY", 1))
    name, family = random_families(12)[number + 4]
    found = document(family, number, NOMINAL if number % 3 else SLIDING)
    count = sum(
        1
        for path, mutant in mutants(found, every=every)
        if compare(mutant, path, tmp_path, UNREAD, same_claim) is not None
    )
    assert count > 100 // every, name


@pytest.mark.campaign
@pytest.mark.parametrize("number", range(6))
def test_what_the_checker_accepts_of_random_families_the_verified_one_accepts(number: int, tmp_path: Path) -> None:
    program()
    for seed, (name, family) in list(enumerate(random_families(60)))[number::6]:
        found = document(family, seed, SLIDING if seed % 5 == 4 else NOMINAL)
        assert check(found).accepted
        code, text = said(found, tmp_path)
        assert code == 0 or (code == 2 and any(word in text for word in UNREAD)), (name, text)
