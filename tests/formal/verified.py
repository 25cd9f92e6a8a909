"""The verified checker as tests run it, and what it does not check: the causes of differences from ``ptcc check``."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mutations import resealed

from ptcc_certify.checker import check
from ptcc_certify.cli.proved_checker import executable
from ptcc_certify.errors import ParameterError

Path_ = tuple[str | int, ...]
#: Kinds of obligations that the theorem of ``formal/`` does not speak of, or not always (reaching times far away).
SKIPPED = {"reaching-time", "input-threshold", "input-peak", "limited-gain", "nominal-disturbed"}
#: Those that it speaks of where no sliding variable moves.
AT_REST = {"input-energy", "input-length"}
#: Exit codes of what is accepted; 4 where a claim is among what was not checked.
ACCEPTED = (0, 4)
#: What the executable says of a form that it does not read.
UNREAD = (
    "weak components of",
    "family",
    "side vector",
    "large form",
    "witness",
    "radius",
    "dominance",
    "undecided",
)


class Said(NamedTuple):
    """Exit code and output of the executable."""

    code: int
    text: str


def program() -> Path:
    """The executable; skips where it is not built."""
    try:
        return executable()
    except ParameterError as error:
        pytest.skip(f"no verified checker: {error}")


def said(document: dict[str, Any], folder: Path) -> Said:
    """What the verified checker says of a document."""
    file = folder / "c.json"
    file.write_text(json.dumps(document))
    run = subprocess.run([program(), "--obligations", file], capture_output=True, text=True, check=False)
    return Said(run.returncode, run.stdout + run.stderr)


def named(text: str) -> set[str]:
    """What the executable names as not checked: obligations, and parts of the document."""
    lines = (line.removeprefix("not checked ") for line in text.splitlines() if line.startswith("not checked "))
    return {part for line in lines for part in line.split(", ")}


def unchecked(document: dict[str, Any], path: Path_, left: set[str]) -> bool:
    """Whether what stands at a path is named as not checked, or is a witness, which claims nothing."""
    if path[:1] == ("proof",) and len(path) > 1:
        proof, place = document["proof"], path[1]
        if path[2:3] == ("witness",):
            return True
        return (
            isinstance(place, int) and place < len(proof) and f"{proof[place]['kind']} of {proof[place]['of']}" in left
        )
    return any(".".join(map(str, path[:depth])) in left for depth in range(1, len(path) + 1))


def compare(
    document: dict[str, Any],
    path: Path_,
    folder: Path,
    unread: Collection[str] = UNREAD,
    more: Callable[[dict[str, Any], Path_, str, set[str]], bool] = lambda *_: False,
) -> str:
    """The cause of a difference between the two checkers on a mutant; empty if they agree.

    What Python found false must be of a part that is named as not checked; or ``more`` knows why both are right.
    """
    sealed = resealed(document)
    python, (code, text) = check(sealed), said(sealed, folder)
    if python.accepted == (code in ACCEPTED):
        return ""
    if code in ACCEPTED:
        place, left = str(python.rejected), named(text)
        known = place in left or unchecked(document, path, left) or more(document, path, place, left)
        assert known, (path, place, python.reason, text)
        return "a part that is not checked"
    assert code == 2 and any(word in text for word in unread), (path, text)
    return "a form that is not read"
