"""Certificates of families: mutants judged by an oracle of their own, forgeries, files made to exhaust the check."""

from __future__ import annotations

import copy
import os
import random
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from common_kernel_families import random_family as with_common_kernel
from families import KINDS, random_family
from mutations import Json, at, changed, containers, leaves, of_container, of_leaf, resealed, same_claim
from oracle_family_certificates import FamilyOracle, false_family_claims

from ptcc_certify.certificate.family_certificate import certify_family
from ptcc_certify.checker import check
from ptcc_certify.graphs.family import Family
from ptcc_certify.protocols import NominalProtocol

SEED = int(os.environ.get("PTCC_FUZZ_SEED", "0"))
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
Rng = np.random.Generator


def certificate(family: Family, seed: int = 0, state: bool = True) -> Any:
    draw = random.Random(seed)
    x0 = [Fraction(draw.randint(-1000, 1000), 100) for _ in range(family.n_nodes)] if state else None
    return certify_family(family, PROTOCOL, x0, time_limit=3)


def document(family: Family, seed: int = 0, state: bool = True) -> Json:
    return {**certificate(family, seed, state).to_dict(), "unverified": {}}


@cache
def cases() -> list[tuple[str, Json]]:
    """True certificates of families of every behaviour, small."""
    found = []
    for k, kind in enumerate((*KINDS, *KINDS)):
        made = random_family(random.Random(100 + k), kind, nodes=4)
        found.append((kind, document(made.family, k, k % 4 > 0)))
    draw = np.random.default_rng(1)
    for kind in ("stability", "consensus", "containment", "undirected"):
        family = with_common_kernel(draw, kind, 4, 2, Fraction(1, 5), 0.5)
        found.append((f"uncertain {kind}", document(family)))
    one = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0), ("b", "a", 0, 1), ("c", "a", 1, 2)])
    found.append(("opposite signs", document(one)))
    found.append(("known", document(Family.from_intervals([("a", "b", 1, 1), ("b", "c", -1, -1)]))))
    found.append(("one node", document(Family.from_intervals([], nodes=["a"]))))
    apart = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("c", "d", -1, -1), ("d", "c", 1, 1)])
    found.append(("two components", document(apart)))
    day, night = ([("a", "b", 1, 1)], [("b", "a", 1, 1)])
    modes = {"day": Family.from_intervals(day), "night": Family.from_intervals(night, nodes="ab")}
    found.append(("leaders change", document(Family.switching(modes))))
    return found


def test_there_are_certificates_of_every_behaviour():
    claims = [
        data["claim"] or component["claim"] for _, data in cases() for component in data.get("components", [{}])[:1]
    ]
    behaviours = {claim["behaviour"] for claim in claims if claim}
    assert len(cases()) >= 20 and len(behaviours) == 5
    assert any(data["input"]["peaks"] for _, data in cases()) and any(
        not data["input"]["bounded"] for _, data in cases()
    )
    witnesses = [x["witness"] for _, data in cases() for x in data["proof"] if x["kind"] == "family-claim"]
    assert any(w and "rows" in w for some in witnesses for w in some)
    assert any(w and "state" in w for some in witnesses for w in some)


def test_the_oracle_finds_nothing_false_in_what_is_proved():
    for name, data in cases():
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
    new = of_leaf(value, data["graph"]["nodes"], False)
    return changed(data, path, pick(rng, new)) if new else data


def everywhere(rng: Rng, data: Json) -> Json:
    texts = [v for path, v in leaves(data) if fraction(v) is not None and path[0] != "graph"]
    if not texts:
        return data
    old = pick(rng, texts)
    new = nudged(rng, old)
    for path, value in list(leaves(data)):
        if value == old and path[0] != "graph":
            data = changed(data, path, new)
    return data


def a_container(rng: Rng, data: Json) -> Json:
    path = pick(rng, [p for p in containers(data) if p])
    new = of_container(at(data, path))
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
    modes = copy.deepcopy(data["graph"]["modes"])
    mode, way = pick(rng, modes), int(rng.integers(8))
    edges = mode["edges"]
    if way == 7 or not edges:
        mode["undirected"] = not mode["undirected"]
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
            edges.append([*rng.choice(data["graph"]["nodes"], 2).tolist(), "1"])
        row[2:] = [str(x) for x in dict.fromkeys(ends)]
    return with_hash(changed(data, ("graph", "modes"), modes))


def with_hash(data: Json) -> Json:
    """The same with edges in order and the SHA-256 of the modes as the oracle forms it."""
    index = {label: v for v, label in enumerate(data["graph"]["nodes"])}
    modes = [
        {**m, "edges": sorted(m["edges"], key=lambda row: (index[row[1]], index[row[0]], Fraction(row[-1]) > 0))}
        for m in data["graph"]["modes"]
    ]
    graph = {**data["graph"], "modes": modes}
    oracle = FamilyOracle({**data, "graph": graph}, {})
    return {**data, "graph": graph | {"sha256": oracle.sha256}}


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


def fuzzed(drawn: Iterator[int]) -> Counter[str]:
    count: Counter[str] = Counter()
    for k in drawn:
        rng = np.random.default_rng([SEED, k])
        name, data = pick(rng, cases())
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
    assert fuzzed(numbers(120))["accepted"] > 0 or os.environ.get("PTCC_FUZZ_ONLY")


@pytest.mark.campaign
def test_no_mutant_of_thousands_is_accepted_that_is_false(capsys: pytest.CaptureFixture[str]):
    count = fuzzed(numbers(4000))
    with capsys.disabled():
        print(f"\nseed {SEED}: {dict(count)}")
    assert os.environ.get("PTCC_FUZZ_ONLY") or count["mutants"] >= 3000
