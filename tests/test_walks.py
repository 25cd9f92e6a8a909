"""The walks through the code in CONTRIBUTING.md: modules are entered in the order that it tells."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from types import FrameType

import pytest

from ptcc_certify.cli import cli

ROOT = Path(__file__).parents[1]
INSIDE = f"{ROOT}{os.sep}"
#: A bold title, or what follows it, with a command; then the modules.
WALK = re.compile(r"`ptcc ([^`]+)`:\n\n((?:\d+\. `[^`]+`.*\n(?: {2,}.*\n)*)+)")
#: The graph of each file that the commands name: camps with two leaders, and a leader alone.
FILES = {
    "graph.csv": "ann,bob,0.5\nbob,ann,2\nann,eve,-1\neve,dan,1\n",
    "team.csv": "ann,bob,1\nann,eve,-1\nbob,dan,-1\n",
}
#: A function of a module, and not a class of it that is made when it is imported.
FUNCTION = 1


def walks() -> dict[str, list[tuple[str, list[str]]]]:
    """Of each walk the commands, with the modules."""
    _, *parts = re.split(r"^\*\*(.*)\*\*,", (ROOT / "CONTRIBUTING.md").read_text(), flags=re.MULTILINE)
    return {
        title: [
            (command, re.findall(r"^\d+\. `([^`]+)`", steps, re.MULTILINE)) for command, steps in WALK.findall(text)
        ]
        for title, text in zip(parts[::2], parts[1::2], strict=True)
    }


def entered(command: str) -> list[str]:
    """The modules in the order in which a function of each is called first."""
    order: dict[str, None] = {}

    def note(frame: FrameType, event: str, _argument: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_flags & FUNCTION and code.co_filename.startswith(INSIDE):
            order[code.co_filename] = None

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        cli.main(command.split(), standalone_mode=False)
    finally:
        sys.setprofile(before)
    return [str(Path(name).relative_to(ROOT)).removeprefix("ptcc_certify/") for name in order]


def test_there_are_three_walks_of_five_commands() -> None:
    assert [len(commands) for commands in walks().values()] == [1, 2, 2]


@pytest.mark.few(1)
@pytest.mark.parametrize("title", walks())
def test_a_walk_is_entered_in_the_order_that_is_told(
    title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, rows in FILES.items():
        Path(name).write_text(f"source,target,weight\n{rows}")
    for command, modules in walks()[title]:
        order = entered(command)
        assert [m for m in modules if m not in order] == [], command
        assert sorted(modules, key=order.index) == modules, command
