"""Mutants of certificates, judged by an oracle that shares nothing with the checker.

Every case is drawn from a seed and its number. To repeat one that failed:

    PTCC_FUZZ_SEED=0 PTCC_FUZZ_ONLY=123 python -m pytest -m "" tests/checker/test_fuzz.py -k mutant

``PTCC_FUZZ_COUNT`` sets how many are drawn. Mutations know nothing of the fields of a certificate: a new field is
changed like any other; its truth is judged once :mod:`oracle` has a method for it.
"""

from __future__ import annotations

import os
from collections import Counter
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import random_mutants
from mutations import Json, at, changed, containers, same_claim
from oracle import false_claims
from random_mutants import SEED, Rng, mutant, numbers, pick
from true_certificates import cases, made

from ptcc_certify.checker import check
from ptcc_certify.checker import graph as checked_graph
from ptcc_certify.model.asks import GainLimits

# ---------------------------------------------------------------------- mutations


def a_graft(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """A part of another certificate."""
    _, other, more = pick(rng, cases())
    path = pick(rng, [p for p in containers(data) if p])
    try:
        new = at(other, path)
    except (KeyError, IndexError, TypeError):
        return data
    files.update(more)
    return changed(data, path, new)


WAYS = [*random_mutants.WAYS, (a_graft, 0.04)]


def fuzzed(most: int) -> Counter[str]:
    """Judge mutants; return how many there were, and how many were accepted, all of which are true."""
    count: Counter[str] = Counter()
    for drawn in numbers(most):
        rng = np.random.default_rng([SEED, drawn])
        name, data, files = pick(rng, cases())
        files = dict(files)
        made, ways = mutant(rng, data, files, WAYS)
        if same_claim(made, data):
            count["unchanged"] += 1
            continue
        count["mutants"] += 1
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(checked_graph, "MANY_EDGES", int(rng.choice([0, 10_000])))
            report = check(made, stdlib=bool(rng.random() < 0.3), files=files)
        where = f"mutant {drawn} of seed {SEED}: {name} by {', '.join(ways)}"
        assert report.accepted or (report.rejected and report.reason), where
        assert "MemoryError" not in (report.reason or ""), where
        if report.accepted:
            count["accepted"] += 1
            assert (false := false_claims(made, files)) == [], f"{where}: {false[:3]}"
    return count


def test_no_mutant_is_accepted_that_is_false():
    count = fuzzed(80)
    assert os.environ.get("PTCC_FUZZ_ONLY") or (count["accepted"] > 0 and count["mutants"] > 40)


@pytest.mark.campaign
def test_no_mutant_of_twenty_thousand_is_accepted_that_is_false(capsys: pytest.CaptureFixture[str]):
    count = fuzzed(24_000)
    with capsys.disabled():
        print(f"\nseed {SEED}: {dict(count)}")
    assert os.environ.get("PTCC_FUZZ_ONLY") or count["mutants"] >= 20_000


def test_the_oracle_finds_nothing_false_in_what_is_proved():
    for name, data, files in cases():
        assert false_claims(data, files) == [], name


@cache
def with_limits() -> Json:
    limits = [GainLimits(gain_cap=9), GainLimits(stop_before="0.01")]
    data = made("2.1 K>=2", 7, limits=limits, noise="0.01", rho2=5)
    assert false_claims(data) == []
    return data


@pytest.mark.few(5)
@pytest.mark.parametrize(
    ("path", "share"),
    [
        (("decays", 0, "rate"), "1.01"),
        (("decays", -1, "deviation", "norm"), "0.5"),
        (("decays", -1, "overshoot"), "0.5"),
        (("rates", "upper_bound"), "0.5"),
        (("rates", "proved"), "1.01"),
        (("input", "threshold", "lower"), "3"),
        (("input", "peak", "norm"), "0.1"),
        (("input", "energy"), "0.001"),
        (("input", "path_length"), "0.1"),
        (("input", "residual", 0, "clock"), "1.01"),
        (("input", "residual", 0, "norm"), "1e-6"),
        (("input", "residual", 1, "largest"), "0.01"),
        (("input", "residual", 0, "noise", "norm"), "1e-3"),
        (("problem", "initial_state"), ""),
        (("problem", "graph", "modes", 0, "edges"), ""),
    ],
)
def test_the_oracle_sees_what_is_false(path: tuple[Any, ...], share: str):
    data = with_limits()
    if path == ("problem", "initial_state"):
        data = changed(data, path, dict.fromkeys(data["problem"]["initial_state"], "1"))
    elif path == ("problem", "graph", "modes", 0, "edges"):
        data = changed(data, path, data["problem"]["graph"]["modes"][0]["edges"][1:])
    else:
        data = changed(data, path, str(Fraction(at(data, path)) * Fraction(share)))
    assert false_claims(data) != []
