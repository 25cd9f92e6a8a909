"""The verified checker as tests run it, and what it does not check: the causes of differences from ``ptcc check``."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from ptcc_certify.cli.verified import executable
from ptcc_certify.errors import ParameterError

Path_ = tuple[str | int, ...]
#: Kinds of obligations that the theorem of ``formal/`` does not speak of.
SKIPPED = {
    *("reaching-time", "input-threshold"),
    *("input-peak", "input-energy", "input-length", "limited-gain", "nominal-disturbed"),
}
#: Parts of the document that are not checked; what stands in these may be false.
UNCHECKED: tuple[Path_, ...] = (
    *(("influence", "degenerate"), ("reaching_time", "z")),
    *(("input", key) for key in ("initial_set", "peak", "energy", "path_length", "residual")),
    *(("input", "disturbed"), ("input", "bounded")),
)
#: What the executable says of a form that it does not read.
UNREAD = (
    "100 weak components",
    "family",
    "side files",
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


def unchecked(document: dict[str, Any], path: Path_) -> bool:
    """Whether what stands at a path is a part that is named as not checked, or a witness, which claims nothing."""
    if path[:1] == ("proof",) and path[2:3] == ("witness",):
        return True
    if path[:1] == ("proof",) and len(path) > 1:
        proof = document["proof"]
        return isinstance(path[1], int) and path[1] < len(proof) and proof[path[1]]["kind"] in SKIPPED
    return any(path[: len(part)] == part for part in UNCHECKED)
