"""Mutants of certificates with late messages or moving leaders: none is accepted that a motion or a row refutes.

To repeat one that failed:

    PTCC_FUZZ_SEED=0 PTCC_FUZZ_ONLY=123 python -m pytest -m "" tests/checker/test_late_fuzz.py -k mutant
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from late_certificates import led_graph, nominal, plain, settling, whole, with_leaders, with_messages
from mutations import Json, at, changed, containers, leaves, of_container, of_keys, of_leaf, resealed, same_claim
from oracle_messages import late_claims
from random_mutants import WAYS, Rng, fraction, mutant, nudged, pick

from ptcc_certify.checker import check
from ptcc_certify.checker import graph as checked_graph
from ptcc_certify.checker import messages as checked_messages

SEED = int(os.environ.get("PTCC_FUZZ_SEED", "0"))
#: Certificates each field of which is changed.
SINGLY = (
    "everything of 1",
    "each edge of 2",
    "ages apart of 2",
    "capped of 4",
    "leaders of 1",
    "sign of 4",
    "moving of 1",
    "moving of 4",
    "moving, capped of 2",
    "any moving of 2",
    "form False of 1",
    "lmi False of 1",
    "lmi True of 2",
    "settling of 1",
    "settling of 2",
)
#: Obligations and parts of section 22.
OWN = ("messages", "late-")


@cache
def cases() -> list[tuple[str, Json]]:
    """True certificates of every kind."""
    found: list[tuple[str, Json]] = []
    for seed, signs, acyclic in ((1, "gauge", True), (2, "gauge", False), (4, "mixed", False)):
        rng = np.random.default_rng(seed)
        drawn = led_graph(rng, 2, 3, acyclic=acyclic, signs=signs)
        x0 = [Fraction(int(v), 10) for v in rng.integers(-50, 50, drawn.n_nodes)]
        known, any_state = plain(drawn, nominal(), x0, method="paper"), plain(drawn, nominal(), None, method="paper")
        ages = [Fraction(1, 20) + Fraction(k, 1000) for k in range(len(known["problem"]["graph"]["modes"][0]["edges"]))]
        apart = [Fraction(1 + 4 * (3 * k % 4), 100) for k in range(len(known["problem"]["graph"]["modes"][0]["edges"]))]
        packets = {"period": "1/100", "losses": "3"}
        some: dict[str, Json] = {
            "everything": with_messages(known, "1/20", qs=("21/20", "6/5"), steps=12, missed=True, staged=True),
            "each edge": with_messages(known, ages, missed=True, steps=8),
            "ages apart": with_messages(known, apart, qs=("21/20", "2"), steps=8),
            "capped": with_messages(known, gain_cap=20, value_error="1/100", packets=packets, steps=8),
            "values off": with_messages(known, "0", value_error="1/10", qs=("1", "6/5")),
            "any state": with_messages(any_state, "1/20", steps=8),
            "leaders": with_leaders(known, disturbance="1/10"),
            "sign": with_leaders(known, sign_gain="1/2"),
            "any leaders": with_leaders(any_state, speed="1/3"),
            "moving": with_messages(known, "1/20", qs=("21/20", "6/5"), steps=12, moving=("1/2", "1/5")),
            "moving, capped": with_messages(known, gain_cap=20, value_error="1/100", steps=8, moving=("1", "0")),
            "any moving": with_messages(any_state, apart, steps=8, moving=("1/3", "1/3")),
        }
        for late in (False, True):
            small = with_messages(known, "1/300", gain_cap=4, form=Fraction(1, 2), late=late)
            if "form" in small["messages"]:
                some[f"form {late}"] = small
        found += [(f"{name} of {seed}", data) for name, data in some.items()]
    found += [(f"lmi {late} of {seed}", whole(seed, late)) for seed, late in ((1, False), (2, True), (3, True))]
    found += [(f"settling of {seed}", settling(seed, cap)) for seed, cap in ((1, None), (2, 12))]
    for name, data in found:
        assert check(data).accepted, (name, check(data).reason)
    return found


def owned(data: Json) -> Callable[[tuple[str | int, ...]], bool]:
    """Whether a path leads to what section 22 describes, or to an obligation of it."""
    begin = sum(not step["kind"].startswith(OWN) for step in data["proof"])
    own = {("proof", k) for k in range(begin, len(data["proof"]))}
    return lambda path: path[:1] == ("messages",) or path[:2] in own


def own_part(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """A change of what section 22 describes: a field, or a number wherever it stands there, or a container."""
    inside, way = owned(data), rng.random()
    if way < 0.2:
        path = pick(rng, [path for path in containers(data) if inside(path)])
        new = [*of_container(at(data, path)), *(section for _, section in of_keys(at(data, path)))]
        return changed(data, path, pick(rng, new or [at(data, path)]))
    paths = [(path, value) for path, value in leaves(data) if inside(path)]
    path, value = pick(rng, paths)
    if not isinstance(value, str) or fraction(value) is None or way > 0.9:
        return changed(data, path, pick(rng, of_leaf(value, data["problem"]["graph"]["nodes"], False) or [value]))
    new = nudged(rng, value)
    for other, same in paths if way > 0.7 else [(path, value)]:
        if same == value:
            data = changed(data, other, new)
    return data


def fuzzed(most: int, seed: int = SEED) -> Counter[str]:
    """Judge mutants; return how many there were, and how many were accepted, all of which are true."""
    count: Counter[str] = Counter()
    only = os.environ.get("PTCC_FUZZ_ONLY")
    among = [(own_part, 2.0), *[(way, share) for way, share in WAYS if way.__name__ != "a_side_file"]]
    for drawn in [int(only)] if only else range(most):
        rng = np.random.default_rng([seed, drawn])
        name, data = pick(rng, cases())
        files: dict[str, bytes] = {}
        made, ways = mutant(rng, data, files, among)
        if same_claim(made, data):
            count["unchanged"] += 1
            continue
        count["mutants"] += 1
        with pytest.MonkeyPatch.context() as patch:
            many = int(rng.choice([0, 10_000]))
            patch.setattr(checked_graph, "MANY_EDGES", many)
            patch.setattr(checked_messages, "MANY_EDGES", many)
            report = check(made, stdlib=bool(rng.random() < 0.3), files=files)
        where = f"mutant {drawn} of seed {seed}: {name} by {', '.join(ways)}"
        assert report.accepted or (report.rejected and report.reason), where
        assert "MemoryError" not in (report.reason or ""), where
        count["own"] += bool(report.rejected and report.rejected.startswith(OWN))
        if report.accepted:
            count["accepted"] += 1
            assert (false := late_claims(made, files)) == [], f"{where}: {false[:3]}"
    return count


def test_no_mutant_is_accepted_that_is_false():
    count = fuzzed(30)
    assert os.environ.get("PTCC_FUZZ_ONLY") or (count["accepted"] > 0 and count["own"] > 10)


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(8))
def test_no_mutant_of_thousands_is_accepted_that_is_false(part: int, capsys: pytest.CaptureFixture[str]):
    count = fuzzed(600, SEED + 1 + part)
    with capsys.disabled():
        print(f"\nseed {SEED + 1 + part}: {dict(count)}")
    assert os.environ.get("PTCC_FUZZ_ONLY") or count["mutants"] >= 500


@pytest.mark.campaign
@pytest.mark.parametrize("name", SINGLY)
def test_no_single_change_of_any_field_is_accepted_that_is_false(name: str):
    """Every field of section 22 and of its obligations, one after the other, in several ways."""
    data = dict(cases())[name]
    inside, changes = owned(data), 0
    for path, value in list(leaves(data)):
        if inside(path):
            rng, others = np.random.default_rng(changes), of_leaf(value, data["problem"]["graph"]["nodes"], True)
            if isinstance(value, str) and fraction(value) is not None:
                others += [nudged(rng, value) for _ in range(6)]
            for new in others:
                made = resealed(changed(data, path, new))
                changes += 1
                if check(made).accepted and not same_claim(made, data):
                    assert late_claims(made) == [], (path, new)
    for path in containers(data):
        for key, section in of_keys(at(data, path)) if inside(path) else ():
            made = resealed(changed(data, path, section))
            changes += 1
            if check(made).accepted:
                assert late_claims(made) == [], (path, key)
    assert changes > 100


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(8))
def test_motions_keep_to_what_is_accepted_on_many_graphs(part: int):
    """Constant, random, square-wave and worst delays; leaders and disturbances that push the worst row."""
    kinds: Counter[str] = Counter()
    for seed in range(100 + 26 * part, 100 + 26 * (part + 1)):
        rng = np.random.default_rng(seed)
        signs = ("mixed", "positive", "gauge")[seed % 3]
        drawn = led_graph(rng, int(rng.integers(1, 3)), int(rng.integers(1, 5)), acyclic=seed % 4 == 0, signs=signs)
        x0 = [Fraction(int(v), 10) for v in rng.integers(-50, 50, drawn.n_nodes)]
        protocol = nominal(rho1=Fraction(int(rng.integers(1, 30)), 10), k=int(rng.integers(1, 6)))
        data = plain(drawn, protocol, x0, method="paper")
        delay = Fraction(int(rng.integers(10, 200)), 1000)
        more: list[Any] = [
            with_messages(data, delay, qs=("21/20", "11/10", "5/4"), steps=20, missed=True, staged=True),
            with_messages(data, delay, value_error="1/20", qs=("11/10",), gain_cap=15, steps=10),
            with_leaders(data, disturbance="1/10"),
            with_leaders(data, sign_gain="1/2"),
            with_messages(data, delay, qs=("21/20", "5/4"), steps=20, moving=("1/2", "1/5")),
            with_messages(data, delay, value_error="1/20", gain_cap=15, steps=10, moving=("1", "0")),
        ]
        for made in more:
            said = made.get("messages")
            if said is not None and not any(said.get(key) for key in ("rows", "steps", "missed", "staged", "form")):
                continue
            report = check(made)
            assert report.accepted, (seed, report.rejected, report.reason)
            assert late_claims(made) == [], seed
            kinds.update(step["kind"] for step in made["proof"][-6:])
    assert min(kinds[kind] for kind in ("late-rows", "late-steps")) >= 20
    assert kinds["late-missed"] and kinds["late-staged"]
