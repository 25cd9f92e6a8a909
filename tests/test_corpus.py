"""Stored certificates of every kind: what they must print, how they read back, and how their proof is laid down."""

from __future__ import annotations

import json
import random
import sys
from pathlib import Path
from typing import Any

import pytest

from ptcc_certify import read_certificate
from ptcc_certify.checker import OBLIGATIONS, read, read_and_check, record

sys.path.insert(0, str(Path(__file__).parent / "corpus"))
from make import HERE, commands, printed

NAMES = list(commands())


def test_every_kind_of_obligation_and_every_verdict_is_stored():
    stored = [read(HERE / f"{name}.json") for name in NAMES]
    assert {path.stem for path in HERE.glob("*.json")} == set(NAMES)
    assert {step["kind"] for document in stored for step in document["proof"]} == set(OBLIGATIONS)
    assert {document["verdict"] for document in stored} == {"certified", "undecided"}
    codes = [(HERE / f"{name}.txt").read_text("utf-8").split("\n")[0] for name in NAMES]
    assert {code.split()[-1] for code in codes} == {"0", "3", "4"}


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_certificate_prints_what_it_printed(name: str):
    code, told = (HERE / f"{name}.txt").read_text("utf-8").split("\n", 1)
    saved = read_certificate(HERE / f"{name}.json")
    assert printed(HERE / f"{name}.json", saved) == told
    assert saved.assessment.exit_code == int(code.split()[-1])


def given(document: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    """What the proof of a document needs besides its claims, in any order."""
    steps = random.Random(document["digest"]).sample(document["proof"], len(document["proof"]))
    brought = [(step, {key: step[key] for key in ("numbers", "witness") if key in step}) for step in steps]
    return {(step["kind"], step["of"]): needed for step, needed in brought if needed}


@pytest.mark.few(20)
@pytest.mark.parametrize("name", NAMES)
def test_the_check_lays_down_the_proof_from_obligations_in_any_order(name: str):
    document, _ = read_and_check(HERE / f"{name}.json")
    recorded, report = record({**document, "proof": [], "verdict": "", "digest": ""}, given(document))
    assert report.accepted and json.dumps(recorded) == json.dumps(document)


def test_what_nothing_asks_for_is_refused_and_what_is_missing_is_named():
    document = read(HERE / "fig1a.json")
    _, report = record(document, {**given(document), ("dominance", "nowhere"): {}})
    assert (report.accepted, report.rejected) == (False, "proof")
    _, report = record(document, {key: step for key, step in given(document).items() if key[0] != "rate"})
    assert not report.accepted and report.rejected is not None and report.rejected.startswith("rate of decays")
