"""Certificates of families: mutants judged by an oracle of their own, forgeries, files made to exhaust the check."""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
import os
import random
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family, family_certificate
from common_kernel_families import random_family as with_common_kernel
from cpu_time import at_most
from families import KINDS, random_family
from mutations import (
    GRAPH,
    Json,
    at,
    changed,
    containers,
    leaves,
    of_container,
    of_keys,
    of_leaf,
    part_of,
    resealed,
    same_claim,
    without,
)
from oracle_family_certificates import FamilyOracle, false_family_claims
from schema_validator import VALIDATOR
from selection import thinned

from ptcc_certify import checker
from ptcc_certify.certificate import section_io
from ptcc_certify.certificate.certificate import RejectedCertificate, read_certificate
from ptcc_certify.certificate.document import certificate_document
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import follower_functions
from ptcc_certify.lyapunov.squares_function import SquaresFunction, squares_function
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows
from ptcc_certify.model.reaching_time import certified_reaching_times
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide

SEED = int(os.environ.get("PTCC_FUZZ_SEED", "0"))
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
Rng = np.random.Generator


def certificate(family: Family, seed: int = 0, state: bool = True) -> Any:
    draw = random.Random(seed)
    x0 = [Fraction(draw.randint(-1000, 1000), 100) for _ in range(family.n_nodes)] if state else None
    return certify_family(family, PROTOCOL, x0, time_limit=60)


def document(family: Family, seed: int = 0, state: bool = True) -> Json:
    return {**certificate(family, seed, state).to_dict(), "unverified": {}}


def document_of_rows(family: Family) -> Json:
    """The same with functions of followers alone."""
    parts = tuple(ComponentProof(c, tuple(follower_functions(c))) for c in decide(family))
    assert all(part.functions for part in parts)
    state = tuple(Fraction(k) for k in range(1, family.n_nodes + 1))
    return {**family_certificate(family, PROTOCOL, parts, state).to_dict(), "unverified": {}}


def function_of_squares(component: FamilyComponent) -> SquaresFunction:
    V = squares_function(component.family)
    assert V is not None
    return V


def document_of_squares(family: Family, sigma0: tuple[Fraction, ...] | None = None) -> Json:
    """The same with weighted sums of squares alone, under the sliding-mode protocol if there is a ``sigma(0)``."""
    parts = tuple(ComponentProof(c, (function_of_squares(c),)) for c in decide(family))
    state = tuple(Fraction(k) for k in range(1, family.n_nodes + 1))
    if sigma0 is None:
        return {**family_certificate(family, PROTOCOL, parts, state).to_dict(), "unverified": {}}
    protocol = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
    reaching = certified_reaching_times(protocol, sigma0)
    return {**family_certificate(family, protocol, parts, state, sigma0, reaching).to_dict(), "unverified": {}}


def two_rings() -> Family:
    """Two modes in which one opponent keeps camps apart, and one that may hear by either sign."""
    day = [("a", "b", 3, "3.3"), ("b", "c", 2, 2), ("c", "a", "-4.2", -4), ("b", "a", "-0.1", 0), ("b", "a", 0, "0.2")]
    night = [("a", "c", 3, "3.1"), ("c", "b", 2, "2.1"), ("b", "a", -4, -4)]
    return Family.switching({"day": Family.from_intervals(day), "night": Family.from_intervals(night, nodes="abc")})


@cache
def cases() -> list[tuple[str, Json]]:
    """True certificates of families of every behaviour, small."""
    found = []
    for k, kind in enumerate(KINDS):
        made = random_family(random.Random(100 + k), kind, nodes=3 if kind == "bipartite consensus" else 4)
        found.append((kind, document(made.family, k, k % 4 > 0)))
    found += uncertain_cases(("consensus", "containment", "undirected"))
    one = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0), ("b", "a", 0, 1), ("c", "a", 1, 2)])
    found.append(("opposite signs", document(one)))
    found.append(("known", document(Family.from_intervals([("a", "b", 1, 1), ("b", "c", -1, -1)]))))
    found.append(("one node", document(Family.from_intervals([], nodes=["a"]))))
    apart = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("c", "d", -1, -1), ("d", "c", 1, 1)])
    found.append(("two components", document(apart)))
    led = [("a", "b", 1, 2), ("b", "a", -1, -1), ("a", "c", -1, -1), ("c", "d", 1, 3), ("b", "d", "-1/2", 0)]
    found.append(("rows", document_of_rows(Family.from_intervals(led))))
    heard = [("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", 1, 3), ("a", "d", 1, 1), ("c", "d", 1, 2)]
    found.append(("rows of camps", document_of_rows(Family.from_intervals(heard))))
    foes = [("a", "b", -3, -3), ("b", "c", 2, "2.1"), ("c", "a", 2, 2)]
    found.append(("squares", document_of_squares(Family.from_intervals(foes))))
    found.append(("squares of modes", document_of_squares(two_rings())))
    undirected = Family.from_intervals([("a", "b", -3, -2), ("b", "c", 2, 3), ("c", "a", 2, 3)], undirected=True)
    found.append(("undirected squares", document_of_squares(undirected)))
    found.append(("sliding squares", document_of_squares(two_rings(), tuple(map(Fraction, (1, 0, -2))))))
    day, night = ([("a", "b", 1, 1)], [("b", "a", 1, 1)])
    modes = {"day": Family.from_intervals(day), "night": Family.from_intervals(night, nodes="ab")}
    found.append(("leaders change", document(Family.switching(modes))))
    found += rate_cases(own=True)[:1] + box_cases() + restricted_cases(4)
    return found + final_value_cases(2) + sliding_cases(5)


def uncertain_cases(kinds: tuple[str, ...]) -> list[tuple[str, Json]]:
    """True certificates of families of two modes whose weights are known to a fifth."""
    draw = np.random.default_rng(1)
    families = {kind: with_common_kernel(draw, kind, 3, 2, Fraction(1, 5), 0.5) for kind in kinds}
    return [(f"uncertain {kind}", document(family)) for kind, family in families.items()]


def box_cases() -> list[tuple[str, Json]]:
    """True certificates with boxes: targets that uncertain weights move, two modes, foes, two components."""
    moved = [("a", "c", 1, 3), ("b", "c", -1, -1), ("c", "d", 1, 2), ("a", "d", -1, 0)]
    modes = [[("a", "c", 1, 1), ("b", "c", 1, 2)], [("a", "c", -2, -1), ("b", "c", 1, 1)]]
    led = [("a", "b", -2, -1), ("b", "a", -1, -1), ("b", "d", 1, 2), ("c", "d", 1, 2), ("d", "e", 1, 1)]
    families = [
        Family.from_intervals(moved, nodes="abcd"),
        Family.switching([Family.from_intervals(edges, nodes="abc") for edges in modes]),
        Family.from_intervals([*led, ("f", "g", 1, 2), ("h", "g", 1, 1)]),
    ]
    made = [document(family, k + 1) for k, family in enumerate(families)]
    assert [sum("vector" in box for box in one["boxes"]) for one in made] == [1, 1, 2]
    return [(f"box {k}", one) for k, one in enumerate(made)]


@cache
def more_cases() -> list[tuple[str, Json]]:
    """Those, and more."""
    found = []
    for k, kind in enumerate(KINDS, len(KINDS)):
        made = random_family(random.Random(100 + k), kind, nodes=3)
        found.append((kind, document(made.family, k, k % 4 > 0)))
    found += uncertain_cases(("stability",)) + rate_cases(own=True)[1:] + rate_cases(own=False)
    return cases() + found + restricted_cases(6)[4:6] + final_value_cases(4)[2:] + sliding_cases(6)[5:6]


SIGNALS = {"constant": "constant", "time": DwellTime("0.3", clock="t"), "clock": DwellTime(4, clock="s")}


def rate_cases(own: bool) -> list[tuple[str, Json]]:
    """True certificates with rates for restricted signals: dwell times with a family of their own, or the others."""
    found, draw = [], np.random.default_rng(3)
    families = (("stability", Fraction(1, 5)), ("consensus", Fraction(0)), ("consensus", Fraction(1, 5)))
    for (kind, share), chosen in zip(families, SIGNALS, strict=True):
        family = with_common_kernel(draw, kind, 3, 2, share, 0.3)
        for name, signal in SIGNALS.items():
            if (name == chosen != "constant") is own:
                made = certify_family(family, PROTOCOL, time_limit=60, signal=signal)
                found.append((f"{name} {kind} {share}", {**made.to_dict(), "unverified": {}}))
    return found


def restricted_cases(count: int) -> list[tuple[str, Json]]:
    """True certificates with other claims for restricted signals: the last mode, windows, shares."""
    found = []
    for k in range(count):
        made = random_family(random.Random(k), "depends", nodes=4 - k % 2).family
        state = list(range(1, made.n_nodes + 1)) if k else None
        last = certify_family(made, PROTOCOL, state, signal=SIGNALS["constant" if k == 2 else "time"])
        found.append((f"last mode {k}", {**last.to_dict(), "unverified": {}}))
    for k, signs in enumerate(((1, -1, 1), (-1, 1, 1))):
        cut = [[(f"n{j}", f"n{(j + 1) % 3}", sign)] for j, sign in enumerate(signs[: 3 - k])]
        modes = [SignedDigraph.from_edges(edges, nodes=["n0", "n1", "n2"]) for edges in cut]
        windows = JointWindows(2, on="0.3", clock="s")
        made = certify_family(Family.switching(modes), PROTOCOL, None if k else [1, 2, -3], signal=windows)
        found.append((f"windows {k}", {**made.to_dict(), "unverified": {}}))
    outage = Family.from_intervals([], nodes=["a", "b", "c"])
    for k, back in enumerate((0, -1)):
        pair = Family.from_intervals([("a", "b", 1, 2), ("b", "c", -1, -1), *[("c", "a", 1, 1)] * -back], nodes="abc")
        other = Family.from_intervals([("a", "b", 1, 1), *[("b", "a", -1, 0)] * -back], nodes="abc")
        modes = Family.switching({"pair": pair, "outage": outage, "other": other})
        state = None if k else [3, -1, Fraction(1, 7)]
        made = certify_family(modes, PROTOCOL, state, signal=ClockShares(["0.8", "0.1", "0.1"]))
        assert made.restricted
        found.append((f"shares {k}", {**made.to_dict(), "unverified": {}}))
    kept = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -3), ("b", "c", 1)], nodes="abc")
    moved = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", 1, 1)])
    stable = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -3), ("b", "c", 1)])
    for k, on in enumerate((kept, moved, stable)):
        modes = Family.switching([on, outage])
        made = certify_family(modes, PROTOCOL, [3, -1, Fraction(1, 7)], signal=ClockShares(["0.7", "0.3"]))
        assert (made.restricted[0].mean is None) == (k > 0) and made.restricted[0].final_states is not None
        found.append((f"ends by shares {k}", {**made.to_dict(), "unverified": {}}))
    return found


def final_value_cases(count: int) -> list[tuple[str, Json]]:
    """True certificates of where agents end under constant weights: one mode, several, undirected, at rest before."""
    pair = [("a", "b", -2, -1), ("b", "a", -1, -1), ("b", "c", 1, 3), ("c", "b", 0, 1)]
    other = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 3), ("b", "c", 1, 1)])
    tied = Family.from_intervals([("a", "b", 1, 2), ("b", "c", -3, -1)], undirected=True)
    gains = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
    apart = Family.from_intervals([*pair, ("d", "e", 1, 2), ("e", "d", 1, 1), ("f", "g", 1, 2)])
    asked: list[tuple[Family, Any, Any]] = [
        (Family.from_intervals(pair), PROTOCOL, [1, "-5/3", 4]),
        (Family.switching([other, tied]), PROTOCOL, [1, 5, -2]),
        (other, SlidingModeProtocol(**gains), [1, 5, -2]),
        (apart, PROTOCOL, range(1, 8)),
    ]
    made = [certify_family(*one, signal="constant", time_limit=3) for one in asked[:count]]
    assert all(one.final_values for one in made)
    return [(f"final value {k}", {**one.to_dict(), "unverified": {}}) for k, one in enumerate(made)]


def sliding_cases(count: int) -> list[tuple[str, Json]]:
    """True certificates under the sliding-mode protocol: sliding variables 0, moving, and of an unbounded part."""
    found, draw = [], np.random.default_rng(7)
    gains = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "delta": 1}
    kinds = ("consensus", "stability", "containment", "undirected", "consensus", "consensus")
    for k, kind in enumerate(kinds[:count]):
        family = with_common_kernel(draw, kind, 3, 1 + k % 2, Fraction(1, 5), 0.5)
        sigma0 = [0, 0, 0] if k == 4 else draw.integers(-4, 5, 3).tolist()
        protocol = SlidingModeProtocol(**gains, mu3="0.1" if k == 5 else 1)
        x0 = None if k == 2 else draw.integers(-9, 10, 3).tolist()
        made = certify_family(family, protocol, x0, sigma0=sigma0, time_limit=60)
        found.append((f"sliding {kind} {k}", {**made.to_dict(), "unverified": {}}))
    protocol = SlidingModeProtocol(**gains, mu3=1)
    apart = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("c", "d", 0, 1)], nodes="abcde")
    made = certify_family(apart, protocol, [1, 2, 3, 4, 5], sigma0=[1, -2, 3, 0, 1], time_limit=60)
    found.append(("sliding apart", {**made.to_dict(), "unverified": {}}))
    led = Family.from_intervals(
        [("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", 1, 3), ("a", "d", 1, 1), ("c", "d", 1, 2)]
    )
    parts = tuple(ComponentProof(c, tuple(follower_functions(c))) for c in decide(led))
    state, sigma0 = tuple(map(Fraction, (1, 2, 3, 4))), tuple(map(Fraction, (1, 0, -1, 2)))
    made = family_certificate(led, protocol, parts, state, sigma0, certified_reaching_times(protocol, sigma0))
    found.append(("sliding rows", {**made.to_dict(), "unverified": {}}))
    return found


def test_there_are_certificates_of_every_behaviour():
    claims = [part["claim"] for _, data in cases() for part in data.get("components", [data])[:1]]
    behaviours = {claim["behaviour"] for claim in claims}
    assert len(cases()) >= 20 and len(behaviours) == 5
    assert any("peaks" in data["input"] for _, data in cases()) and any(
        "bounded" not in data["input"] for _, data in cases()
    )
    witnesses = [x["witness"] for _, data in cases() for x in data["proof"] if x["kind"] == "family-claim"]
    assert any(w and "rows" in w for some in witnesses for w in some)
    assert any(w and "state" in w for some in witnesses for w in some)


def test_the_oracle_finds_nothing_false_in_what_is_proved():
    for name, data in cases():
        assert check(data | {"digest": resealed(data)["digest"]}).accepted, name
    for name, data in cases()[::2]:
        assert false_family_claims(data) == [], name


@pytest.mark.campaign
def test_the_oracle_finds_nothing_false_in_more_of_what_is_proved():
    for name, data in more_cases():
        assert check(data | {"digest": resealed(data)["digest"]}).accepted, name
        assert false_family_claims(data) == [], name


# ---------------------------------------------------------------------- mutants


def pick(rng: Rng, items: list[Any]) -> Any:
    return items[int(rng.integers(len(items)))]


def fraction(text: Any) -> Fraction | None:
    try:
        return Fraction(text) if isinstance(text, str) and "x" not in text.lower() and len(text) < 500 else None
    except (ValueError, ZeroDivisionError):
        return None


def nudged(rng: Rng, text: str) -> str:
    value = fraction(text)
    assert value is not None
    step = Fraction(1, 2 ** int(rng.integers(1, 60)))
    new = [
        value * (1 + step),
        value * (1 - step),
        value + step,
        value - step,
        value * 2,
        value / 2,
        -value,
        Fraction(0),
    ]
    return str(pick(rng, new))


def a_leaf(rng: Rng, data: Json) -> Json:
    path, value = pick(rng, list(leaves(data)))
    if fraction(value) is not None and rng.random() < 0.7:
        return changed(data, path, nudged(rng, value))
    new = of_leaf(value, data["problem"]["graph"]["nodes"], False)
    return changed(data, path, pick(rng, new)) if new else data


def everywhere(rng: Rng, data: Json) -> Json:
    texts = [v for path, v in leaves(data) if fraction(v) is not None and path[:2] != GRAPH]
    if not texts:
        return data
    old = pick(rng, texts)
    new = nudged(rng, old)
    for path, value in list(leaves(data)):
        if value == old and path[:2] != GRAPH:
            data = changed(data, path, new)
    return data


def a_container(rng: Rng, data: Json) -> Json:
    path = pick(rng, list(containers(data)))
    new = [*(of_container(at(data, path)) if path else ()), *(section for _, section in of_keys(at(data, path)))]
    return changed(data, path, pick(rng, new)) if new else data


def a_swap(rng: Rng, data: Json) -> Json:
    (one, x), (other, y) = (pick(rng, [e for e in leaves(data) if fraction(e[1]) is not None]) for _ in range(2))
    return changed(changed(data, one, y), other, x)


def a_graft(rng: Rng, data: Json) -> Json:
    _, other = pick(rng, cases())
    path = pick(rng, [p for p in containers(data) if p])
    try:
        return changed(data, path, at(other, path))
    except (KeyError, IndexError, TypeError):
        return data


def an_edge(rng: Rng, data: Json) -> Json:
    """Another family with the same claims: an edge less, more, of another sign, narrower, wider, tied or not."""
    modes = copy.deepcopy(data["problem"]["graph"]["modes"])
    mode, way = pick(rng, modes), int(rng.integers(8))
    edges = mode["edges"]
    if way == 7 or not edges:
        mode |= {} if mode.pop("undirected", False) else {"undirected": True}
    else:
        row = pick(rng, edges)
        ends = [Fraction(row[2]), Fraction(row[-1])]
        if way == 0:
            edges.remove(row)
        elif way == 1:
            ends = [-ends[1], -ends[0]]
        elif way == 2:
            ends = [min(*ends, Fraction(0)), max(*ends, Fraction(0))]
        elif way == 3:
            ends[0] = max(ends, key=abs)
            ends[1] = ends[0]
        elif way == 4:
            ends = sorted(x * y for x, y in zip(ends, (1, 1 + Fraction(int(rng.integers(1, 9)), 10)), strict=True))
        elif way == 5:
            row[0], row[1] = row[1], row[0]
        else:
            edges.append([*rng.choice(data["problem"]["graph"]["nodes"], 2).tolist(), "1"])
        row[2:] = [str(x) for x in dict.fromkeys(ends)]
    return with_hash(changed(data, ("problem", "graph", "modes"), modes))


def with_hash(data: Json) -> Json:
    """The same with edges in order and the SHA-256 of the modes as the oracle forms it."""
    index = {label: v for v, label in enumerate(data["problem"]["graph"]["nodes"])}
    modes = [
        {**m, "edges": sorted(m["edges"], key=lambda row: (index[row[1]], index[row[0]], Fraction(row[-1]) > 0))}
        for m in data["problem"]["graph"]["modes"]
    ]
    data = changed(data, (*GRAPH, "modes"), modes)
    return changed(data, (*GRAPH, "sha256"), FamilyOracle(data, {}).sha256)


MUTATIONS = [(a_leaf, 0.35), (everywhere, 0.2), (a_container, 0.12), (a_swap, 0.06), (a_graft, 0.07), (an_edge, 0.2)]


def mutant(rng: Rng, data: Json) -> tuple[Json, list[str]]:
    """A certificate changed in one place or several, with a digest that fits; and how."""
    ways = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        way = MUTATIONS[int(rng.choice(len(MUTATIONS), p=[p for _, p in MUTATIONS]))][0]
        ways.append(way.__name__)
        try:
            data = way(rng, data)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, AssertionError, ZeroDivisionError):
            continue  # what was changed before does not fit any more
    return resealed(data), ways


def fuzzed(drawn: Iterator[int], among: list[tuple[str, Json]]) -> Counter[str]:
    count: Counter[str] = Counter()
    for k in drawn:
        rng = np.random.default_rng([SEED, k])
        name, data = pick(rng, among)
        made, ways = mutant(rng, data)
        if same_claim(made, data):
            count["unchanged"] += 1
            continue
        count["mutants"] += 1
        report, other = check(made, stdlib=True), check(made)
        where = f"mutant {k} of seed {SEED}: {name} by {', '.join(ways)}"
        assert (report.accepted, report.reason) == (other.accepted, other.reason), where
        assert report.accepted or (report.rejected and report.reason and "\n" not in report.reason), where
        assert "MemoryError" not in (report.reason or ""), where
        if report.accepted:
            count["accepted"] += 1
            count[f"accepted by {ways[-1]}"] += 1
            assert (false := false_family_claims(made)) == [], f"{where}: {false[:3]}"
    return count


def numbers(most: int) -> Iterator[int]:
    only = os.environ.get("PTCC_FUZZ_ONLY")
    return iter([int(only)] if only else range(int(os.environ.get("PTCC_FUZZ_COUNT", most))))


def test_no_mutant_is_accepted_that_is_false():
    assert fuzzed(numbers(60), cases())["accepted"] > 0 or os.environ.get("PTCC_FUZZ_ONLY")


NEW = ("sliding_variable", "reaching_time", "gain", "drives", "input", "final_state")


def changed_numbers(begin: str, keys: tuple[str, ...], count: int) -> Counter[str]:
    """Change one number below some keys of the certificates whose name begins so."""
    rng, seen = np.random.default_rng([SEED, 5]), Counter[str]()
    among = [case for case in cases() if case[0].startswith(begin)]
    for _ in range(count):
        name, data = pick(rng, among)
        paths = [(path, x) for path, x in leaves(data) if set(path) & set(keys) and fraction(x) is not None]
        path, text = pick(rng, paths)
        made = resealed(changed(data, path, nudged(rng, text)))
        if not same_claim(made, data):
            accepted = check(made).accepted
            seen[f"{part_of(path)} {'accepted' if accepted else 'rejected'}"] += 1
            assert not accepted or false_family_claims(made) == [], (name, path, at(made, path))
    return seen


def of_sliding(count: int) -> Counter[str]:
    """Change what families have under the sliding-mode protocol alone, in one place."""
    return changed_numbers("sliding", NEW, count)


def of_shares(count: int) -> Counter[str]:
    """Change where agents end by shares of the clock, and the mean from which that follows, in one place."""
    return changed_numbers("ends by shares", ("restricted", "witness", "initial_state"), count)


def test_no_mutant_of_where_agents_end_by_shares_is_accepted_that_is_false():
    seen = of_shares(40)
    assert {key.split()[1] for key in seen} == {"accepted", "rejected"}


@pytest.mark.campaign
def test_no_mutant_of_thousands_of_where_agents_end_by_shares_is_accepted_that_is_false():
    assert sum(of_shares(2000).values()) > 1000


def test_no_mutant_of_what_slides_is_accepted_that_is_false():
    seen = of_sliding(20)
    assert {key.split()[1] for key in seen} == {"accepted", "rejected"}


@pytest.mark.campaign
def test_no_mutant_of_thousands_of_what_slides_is_accepted_that_is_false(capsys: pytest.CaptureFixture[str]):
    seen = of_sliding(3000)
    with capsys.disabled():
        print(f"\nseed {SEED}: {dict(seen)}")
    assert sum(seen.values()) > 2000


@pytest.mark.campaign
def test_no_mutant_of_thousands_is_accepted_that_is_false(capsys: pytest.CaptureFixture[str]):
    count = fuzzed(numbers(4000), more_cases())
    with capsys.disabled():
        print(f"\nseed {SEED}: {dict(count)}")
    assert os.environ.get("PTCC_FUZZ_ONLY") or count["mutants"] >= 3000


# ---------------------------------------------------------------------- the shape


NUMBERS_AS_KEYS = "rows is not an object with numbers as keys"


def test_certificates_of_families_are_valid():
    for _, data in cases():
        VALIDATOR.validate(data)


@pytest.mark.parametrize(
    ("path", "new"),
    [
        (("problem", "signal"), "constant"),
        (("problem", "signal"), None),
        (("claim", "signal"), "any"),
        (("claim", "behaviour"), "bipartite"),
        (("problem", "graph", "modes", 0, "undirected"), None),
        (("problem", "graph", "modes", 0, "undirected"), False),
        (("problem", "graph", "modes", 0, "name"), None),
        (("problem", "graph", "modes", 0, "edges", 0), ["a"]),
        (("structure", 0, "connectivity"), "torn"),
        (("problem", "gain", "kind"), "sliding-mode"),
        (("paper",), {}),
        (("rates",), {}),
        (("drives",), None),
        (("input", "bounded"), None),
        (("verdict",), "undecided"),
        (("decays", 0, "class"), "paper"),
        (("proof", -1, "lemma"), "Lemma 1"),
        (("more",), 1),
    ],
)
def test_what_does_not_fit_is_neither_valid_nor_accepted(path: tuple[Any, ...], new: Any):
    data = next(data for name, data in cases() if name == "uncertain consensus")
    assert VALIDATOR.is_valid(data) and check(resealed(data)).accepted
    made = changed(data, path, new)
    assert not VALIDATOR.is_valid(made) and not check(resealed(made)).accepted


@pytest.mark.parametrize(
    ("path", "new", "reason"),
    [
        (("problem", "graph", "modes"), [], "no mode"),
        (("problem", "sliding_variable"), {}, "the key"),
        (("drives",), [], "drives"),
        (("input", "bounded"), False, "no place here"),
        (("proof", 0, "of"), "graph", "another obligation"),
    ],
)
def test_what_does_not_go_together_is_not_accepted(path: tuple[Any, ...], new: Any, reason: str):
    report = check(changed(cases()[0][1], path, new))
    assert not report.accepted and reason in (report.reason or "")


# ---------------------------------------------------------------------- forgeries


def test_an_undirected_family_is_not_the_directed_one_of_the_same_bounds():
    """Its weights change together: a directed member of this path decays with 0.31, below the rate 1.17."""
    path = [("a", "b", 1, 10), ("b", "c", 1, 10), ("c", "d", 1, 10)]
    tied = Family.from_intervals(path, undirected=True)
    free = Family.from_intervals(path + [(t, s, low, high) for s, t, low, high in path])
    made = certificate(tied, state=False)
    slowest = min(
        2
        * sorted(
            np.linalg.eigvals(np.diag([a, b + c, d + e, f]) - np.diag([a, c, e], 1) - np.diag([b, d, f], -1)).real
        )[1]
        for a, b, c, d, e, f in itertools.product((1, 10), repeat=6)
    )
    assert slowest < 0.32 < 1.17 < float(made.rate)
    assert tied != free and tied.sha256 != free.sha256
    forged = made.to_dict()
    del forged["problem"]["graph"]["modes"][0]["undirected"]
    assert check(resealed(forged)).rejected == "graph"
    forged["problem"]["graph"]["sha256"] = free.sha256
    assert check(resealed(forged)).rejected == "family-rate of decays[0].modes[0]"


def forged(name: str, *changes: tuple[tuple[Any, ...], Any]) -> Any:
    data = next(data for own, data in cases() if own == name)
    for path, new in changes:
        data = changed(data, path, new)
    return check(resealed(data))


def steps(name: str, kind: str) -> list[int]:
    data = next(data for own, data in cases() if own == name)
    return [k for k, step in enumerate(data["proof"]) if step["kind"] == kind]


def test_a_function_is_of_its_own_component():
    data = next(data for name, data in cases() if name == "two components")
    numbers = [V["component"] for V in data["decays"]]
    assert set(numbers) == {0, 1}
    for k, number in enumerate(numbers):
        path = ("decays", k, "component")
        assert forged("two components", (path, 1 - number)).rejected == f"decays[{k}]"
        assert not forged("two components", (path, 2)).accepted


def test_functions_of_one_component_bound_no_input_of_another():
    data = next(data for name, data in cases() if name == "two components")
    for number in (0, 1):
        kept = [k for k, V in enumerate(data["decays"]) if V["component"] == number]
        proof = [x for x in data["proof"] if not x["of"].startswith("decays")]
        middle = next(k for k, x in enumerate(proof) if x["kind"] == "family-claim") + 1
        renamed = []
        for place, k in enumerate(kept):
            for x in data["proof"]:
                if x["of"].startswith(f"decays[{k}]"):
                    renamed.append({**x, "of": x["of"].replace(f"decays[{k}]", f"decays[{place}]")})
        functions = [data["decays"][k] for k in kept]
        report = forged(
            "two components",
            (("decays",), functions),
            (("proof",), proof[:middle] + renamed + proof[middle:]),
        )
        assert not report.accepted and report.rejected in ("family-final-state of final_state", "family-input of input")


def test_a_multiplier_is_positive_and_none_is_left_out():
    (first, *_) = steps("uncertain consensus", "family-rate")
    path = ("proof", first, "witness", "multipliers")
    data = next(data for name, data in cases() if name == "uncertain consensus")
    own = at(data, path)
    assert own and forged("uncertain consensus", (path, own)).accepted
    for new in ([], own[:-1], [*own, "1"], ["0", *own[1:]], ["-1", *own[1:]]):
        assert forged("uncertain consensus", (path, new)).rejected == "family-rate of decays[0].modes[0]"
    where = ("proof", first, "witness")
    assert forged("uncertain consensus", (where, None)).reason == "witness is null, and not left out"
    assert check(resealed(without(data, where))).reason == "the least weights are not the worst"


def test_a_peak_takes_a_rate_of_at_least_two_over_the_exponent():
    name, data = next((name, data) for name, data in cases() if "peaks" in data["input"] and data["decays"])
    rate = max(Fraction(V["rate"]) for V in data["decays"])
    exponent = Fraction(data["problem"]["gain"]["kappa"]) * Fraction(data["problem"]["gain"]["rho2"])
    assert rate * exponent >= 2
    slower = str(Fraction(199, 100) / rate / Fraction(data["problem"]["gain"]["rho2"]))
    assert forged(name, (("problem", "gain", "kappa"), slower)).rejected == "family-input of input"


def test_a_rate_that_is_not_positive_moves_nothing():
    """Then the agents end between the extremes at the beginning, and nothing narrower is taken."""
    name = "uncertain consensus"
    data = next(data for own, data in cases() if own == name)
    proof = [x for x in data["proof"] if x["kind"] != "family-input"]
    proof = [{**x, "numbers": {"b": "-1"}} if x["kind"] == "family-rate" else x for x in proof]
    functions = [{**V, "rate": "-1"} for V in data["decays"]]
    size = max(abs(Fraction(x)) for x in data["problem"]["initial_state"].values())
    for share, accepted in ((1, True), (Fraction(1, 100), False)):
        ends = dict.fromkeys(data["problem"]["graph"]["nodes"], ball("0", str(share * size)))
        report = forged(
            name,
            (("proof",), proof),
            (("decays",), functions),
            (("input",), {}),
            (("final_state",), ends),
        )
        assert functions and report.accepted == accepted
        assert accepted or report.rejected == "family-final-state of final_state"


def test_a_row_of_a_kernel_has_columns_of_its_own_component_alone():
    data = next(data for name, data in cases() if name == "bipartite containment")
    (place,) = steps("bipartite containment", "family-claim")
    rows = data["proof"][place]["witness"][0]["rows"]
    label = next(iter(rows))
    for key, reason in {"9": "a row of a kernel", **dict.fromkeys(("0", "01", "-1", ""), NUMBERS_AS_KEYS)}.items():
        path = ("proof", place, "witness", 0, "rows")
        report = forged("bipartite containment", (path, {**rows, label: {**rows[label], key: "0"}}))
        assert report.reason == reason


@pytest.mark.campaign
def test_many_components_take_time_in_proportion():
    edges = [(f"{s}{i}", f"{t}{i}", 1, 1 + (t == "d")) for i in range(500) for s, t in ("ac", "bc", "cd")]
    family = Family.from_intervals(edges)
    data = certificate_document(family_certificate(family, PROTOCOL, tuple(map(ComponentProof, decide(family)))))[0]
    with at_most(5):
        assert check(data, stdlib=True).accepted


def test_known_weights_are_one_family_whether_undirected_or_not():
    path = [("a", "b", 1, 1), ("b", "c", -2, -2)]
    both = path + [(t, s, low, high) for s, t, low, high in path]
    assert Family.from_intervals(path, undirected=True) == Family.from_intervals(both)


@pytest.mark.parametrize("name", ["connectivity", "balanced", "sign_symmetric"])
def test_what_is_said_of_a_mode_is_verified(name: str):
    data = next(data for name, data in cases() if name == "leaders change")
    said = data["structure"][0][name]
    new = (not said) if isinstance(said, bool) else "weak"
    report = check(resealed(changed(data, ("structure", 0, name), new)))
    assert not report.accepted


APART = [("a", "c", 1, 1), ("b", "c", 1, 1), ("c", "d", 2, 2)]


def moved(state: Json, edge: Any = None, modes: tuple[int, int] = (0, 1)) -> Any:
    """A certificate that says that a state at rest in one mode moves in another."""
    second = [("a", "c", 1, 1), ("b", "c", 3, 3), ("c", "d", 2, 4)]
    data = document(Family.switching([Family.from_intervals(e) for e in (APART, second)]), state=False)
    place = next(k for k, x in enumerate(data["proof"]) if x["kind"] == "family-claim")
    witness = [{"mode": modes[0], "other": modes[1], "state": state} | ({"edge": edge} if edge else {})]
    return check(resealed(changed(data, ("proof", place, "witness"), witness)))


def ball(mid: str, radius: str) -> Json:
    return {"mid": mid, "radius": radius}


def test_a_state_at_rest_may_be_exact_or_enclosed():
    assert moved({"a": "1", "c": "1/2", "d": "1/2"}).accepted
    assert moved({"a": "1", "c": ball("0.501", "0.002"), "d": ball("0.5", "0.003")}).accepted
    assert moved({"b": "1", "c": "3/4", "d": "3/4"}, modes=(1, 0)).accepted


@pytest.mark.parametrize(
    ("state", "edge"),
    [
        ({"a": "1", "c": "1/2"}, None),  # d moves in the first mode
        ({"a": "1", "c": "1/2", "d": "1/2"}, ["c", "d", 1]),  # c and d are equal
        ({"a": "1", "c": "1/2", "d": "1/2"}, ["c", "d", True]),
        ({"a": "1", "c": "1/2", "d": "1/2"}, ["c", "d", -1]),  # no edge
        ({"a": "1", "c": "1/2", "d": "1/2"}, ["b", "c", 1]),  # a known edge
        ({"a": "1", "b": "1", "c": "1", "d": "1"}, None),  # at rest in both
        ({"a": ball("1", "0.1"), "c": ball("1/2", "0.1"), "d": ball("1/2", "0.1")}, None),  # a leader is exact
        ({"a": "1", "c": ball("1/2", "0.3"), "d": ball("1/2", "0.3")}, None),  # may be at rest in both
        ({"a": "1", "c": ball("0.51", "0.002"), "d": ball("0.5", "0.02")}, None),  # c lies elsewhere
        ({"a": "1", "c": ball("0.501", "0.002"), "d": ball("0.5", "0.001")}, None),  # d may lie elsewhere
        ({"x": "1"}, None),
        ({}, None),
    ],
)
def test_a_state_that_does_not_prove_it_is_refused(state: Json, edge: Any):
    report = moved(state, edge)
    assert report.rejected == "family-claim of graph" and "\n" not in report.reason


def test_the_true_state_lies_within_the_radii():
    """Enclosures of states at rest that are accepted hold them: random followers, against exact solves."""
    draw, accepted = random.Random(3), 0
    for _ in range(60):
        weights = [Fraction(draw.randint(1, 5)) for _ in range(5)]
        edges = [("a", "c", weights[0]), ("b", "c", -weights[1]), ("d", "c", weights[2]), ("c", "d", weights[3])]
        edges.append(("b", "d", weights[4]))
        first = Family.from_intervals([(s, t, w, w) for s, t, w in edges])
        second = Family.from_intervals([(s, t, w, w) for s, t, w in edges[1:]] + [("a", "c", 9, 9)])
        data = document(Family.switching([first, second]), state=False)
        place = next(k for k, x in enumerate(data["proof"]) if x["kind"] == "family-claim")
        w = weights  # c (w0 + w1 + w2) - w2 d = w0, d (w3 + w4) - w3 c = 0 for a = 1, b = 0
        c = w[0] * (w[3] + w[4]) / ((w[0] + w[1] + w[2]) * (w[3] + w[4]) - w[2] * w[3])
        d = w[3] * c / (w[3] + w[4])
        size = Fraction(1, draw.choice((4, 100, 10**4)))
        mids = [x + draw.randint(-8, 8) * size / 8 for x in (c, d)]
        radii = [draw.randint(1, 8) * size / 8 for _ in (c, d)]
        state = {"a": "1"} | {k: ball(str(m), str(r)) for k, m, r in zip("cd", mids, radii, strict=True)}
        witness = [{"mode": 0, "other": 1, "state": state}]
        if check(resealed(changed(data, ("proof", place, "witness"), witness))).accepted:
            accepted += 1
            assert all(abs(x - m) <= r for x, m, r in zip((c, d), mids, radii, strict=True))
    assert accepted >= 3


# ---------------------------------------------------------------------- files made to exhaust the check


def hostile(n: int, edges: list[Any] | None = None, multiplier: str = "1000", modes: int = 1) -> Json:
    """A certificate with a Lyapunov function that proves nothing, all in its form right."""
    star: Any = [("h", f"v{i}", 1, 2) for i in range(n)]
    family = Family.switching([Family.from_intervals(edges or star) for _ in range(modes)])
    parts = tuple(map(ComponentProof, decide(family)))
    data = certificate_document(family_certificate(family, PROTOCOL, parts))[0]
    labels, q = list(family.labels), len(edges or star)
    function = {"class": "full", "component": 0, "nodes": labels[1:], "rate": "-100"}
    function["lower_triangle"] = [["1" if i == j else "0" for j in range(i + 1)] for i in range(n)]
    function |= {"inputs": dict.fromkeys(labels, "1000000"), "coordinates": dict.fromkeys(labels[1:], "2")}
    data["decays"] = [function]

    def step(kind: str, of: str, witness: Any = None, **numbers: str) -> Json:
        proves, lemma = checker.OBLIGATIONS[kind]
        told = {"numbers": numbers or None, "witness": witness}
        brought = {key: x for key, x in told.items() if x is not None}
        return {"kind": kind, "of": of, "proves": proves, "lemma": lemma, **brought}

    proof = data["proof"][: modes + 1]
    multipliers = {"multipliers": [f"{multiplier}{i}" if len(multiplier) > 4 else multiplier for i in range(q)]}
    proof += [step("family-rate", f"decays[0].modes[{k}]", multipliers, b="-100") for k in range(modes)]
    data["proof"] = [*proof, step("family-constants", "decays[0]")]
    data["input"] = {}
    return data


def long_numbers(count: int, digits: int = 1900) -> list[str]:
    draw = random.Random(count)
    return [f"1/{10**digits + 2 * draw.randrange(10**digits) + 1}" for _ in range(count)]


def with_long_state(n: int) -> Json:
    data = hostile(n)
    labels = data["problem"]["graph"]["nodes"]
    data["problem"]["initial_state"] = dict(zip(labels, long_numbers(n + 1), strict=True))
    data["final_state"] = dict.fromkeys(labels, ball("0", "100"))
    data["proof"].append({**data["proof"][-1], "kind": "family-final-state", "of": "final_state"})
    data["proof"][-1]["proves"], data["proof"][-1]["lemma"] = checker.OBLIGATIONS["family-final-state"]
    return data


def with_long_rows(n: int) -> Json:
    family = Family.from_intervals([(f"l{i}", "f", 1, 1) for i in range(n)])
    data = document(family, state=False)
    step = next(x for x in data["proof"] if x["kind"] == "family-claim")
    step["witness"][0]["rows"]["f"] = dict(zip(step["witness"][0]["rows"]["f"], long_numbers(n), strict=True))
    return data


def with_long_weights(n: int) -> Json:
    return hostile(n, [("h", f"v{i}", 1, 1 + Fraction(x)) for i, x in enumerate(long_numbers(n))])


def with_many_rows(followers: int, leaders: int, modes: int) -> Json:
    """Uncertain edges between agents with the same long rows of the kernel."""
    draw = random.Random(0)
    first = [(f"l{i}", "f0", 1 + draw.randrange(9), 0) for i in range(leaders)]
    known: Any = [(s, t, w, w) for s, t, w, _ in first]
    known += [("f0", f"f{k}", 1, 2) for k in range(1, followers)]
    pairs = [(f"f{i}", f"f{k}", 0, 1) for i in range(1, followers) for k in range(1, followers) if i != k]
    family = Family.switching([Family.from_intervals(known + pairs)] * modes)
    return certificate_document(family_certificate(family, PROTOCOL, tuple(map(ComponentProof, decide(family)))))[0]


def with_many_functions(leaders: int, modes: int) -> Json:
    """Functions of one agent that hears very many, each with its rates in all modes."""
    edges = [(f"l{i}", "f", 1, 1) for i in range(leaders)]
    family = Family.switching([Family.from_intervals(edges)] * modes)
    data = document(family, state=False)
    one = data["decays"][0]
    proof = data["proof"]
    own = [x for x in proof if x["of"].startswith("decays[0]")]
    rest = [x for x in proof if not x["of"].startswith("decays")]
    place = next(k for k, x in enumerate(rest) if x["kind"] == "family-claim") + 1
    many = [{**x, "of": x["of"].replace("[0]", f"[{k}]", 1)} for k in range(100) for x in own]
    return {**data, "decays": [one] * 100, "proof": rest[:place] + many + rest[place:]}


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "make",
    [
        lambda: with_long_state(60),
        lambda: with_long_rows(100),
        lambda: with_long_weights(100),
        lambda: hostile(60, multiplier=long_numbers(1)[0]),
        lambda: hostile(30, [(f"v{i}", f"v{j}", 1, 2) for i in range(31) for j in range(31) if i != j]),
        lambda: hostile(40, modes=50),
        lambda: with_many_rows(8, 400, 10),
        lambda: with_many_functions(60, 4),
    ],
)
def test_long_numbers_and_many_weights_are_answered_soon(make: Any):
    data = resealed(make())
    with at_most(3):
        report = check(data, stdlib=True)
    assert report.accepted or "\n" not in (report.reason or "")


# ---------------------------------------------------------------------- read back


@pytest.mark.parametrize(("k", "kind"), thinned(reversed(list(enumerate(KINDS[:5]))), 3))
def test_what_is_read_back_says_the_same(k: int, kind: str, tmp_path: Path):
    made = certificate(random_family(random.Random(k), kind, nodes=3).family, k)
    made.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    assert (saved.behaviours, saved.rate, saved.family) == (made.behaviours, made.rate, made.family)
    assert (saved.final_state, saved.input_peaks, saved.bounded) == (made.final_state, made.input_peaks, made.bounded)
    assert (saved.deviation_bound([1, 0.5, 0.1]) == made.deviation_bound([1, 0.5, 0.1])).all()
    assert saved.verdict == made.verdict == "certified" and saved.checked.accepted
    assert [part.upper_bound for part in saved.parts] == [part.upper_bound for part in made.parts]
    saved.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "c.json").read_bytes()
    assert read_certificate(made.to_dict()).final_state == made.final_state


def test_functions_of_rows_are_read_back():
    for name, data in cases():
        if name.startswith("rows"):
            saved = read_certificate(resealed(data))
            assert [V.kind for V in saved.parts[0].functions] == [V["class"] for V in data["decays"]]
            for told, ends in zip(data["final_state"].values(), saved.final_state, strict=True):
                middle, radius = (Fraction(told[k]) for k in ("mid", "radius")) if isinstance(told, dict) else (told, 0)
                middle = Fraction(middle)
                assert middle - radius <= ends[0] <= ends[1] <= middle + radius
            peaks = map(Fraction, data["input"]["peaks"].values())
            assert all(
                0 < own <= told < own * (1 + Fraction(1, 10**9))
                for told, own in zip(peaks, saved.input_peaks, strict=True)
            )


def test_a_file_that_is_rejected_is_not_read(tmp_path: Path):
    data = next(data for name, data in cases() if name == "uncertain consensus")
    (tmp_path / "c.json").write_text(json.dumps(resealed({**data, "verdict": "undecided"})), encoding="utf-8")
    with pytest.raises(RejectedCertificate, match="the independent check rejects verdict"):
        read_certificate(tmp_path / "c.json")


def test_many_edges_are_read_from_side_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(section_io, "LONG", 2)
    edges = [("a", "b", 1, 2), ("b", "a", "0", "0.1"), ("b", "a", "-0.25", 0), ("a", "c", -3, -3)]
    made = certificate(Family.from_intervals(edges), state=False)
    made.save(tmp_path / "c.json")
    document = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    VALIDATOR.validate(document)
    files = {path.name: path.read_bytes() for path in tmp_path.glob("*.npy")}
    assert isinstance(document["problem"]["graph"]["modes"][0]["edges"], dict) and len(files) >= 4
    assert false_family_claims(document, files) == []
    assert all(check(tmp_path / "c.json", stdlib=stdlib).accepted for stdlib in (True, False))
    saved = read_certificate(tmp_path / "c.json")
    assert saved.family == made.family and saved.family.modes[0].edge_interval(0) == made.family.modes[0].edge_interval(
        0
    )
    largest = document["problem"]["graph"]["modes"][0]["edges"]["largest"]
    values = np.load(tmp_path / largest["file"])
    values[0] += 1
    np.save(tmp_path / "other.npy", values)
    other = {"file": "other.npy", "sha256": hashlib.sha256((tmp_path / "other.npy").read_bytes()).hexdigest()}
    forged = resealed(changed(document, ("problem", "graph", "modes", 0, "edges", "largest"), {**largest, **other}))
    assert check(forged, files=files | {"other.npy": (tmp_path / "other.npy").read_bytes()}).rejected == "graph"
