"""Everything that the README and the list of all commands show is run, and shows what it says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from run_blocks import blocks, check_transcripts, run_commands

from ptcc_certify.cli import cli

README = Path(__file__).parent.parent / "README.md"
TEXT = README.read_text(encoding="utf-8") if README.exists() else ""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMMANDS = README.parent / "docs" / "guide" / "commands.md"
#: Blocks of commands, each run from top to bottom in one folder as a reader would; those that set up are CI's own.
SESSIONS = [
    block
    for text in (TEXT, COMMANDS.read_text(encoding="utf-8") if README.exists() else "")
    for _, block in blocks(text, "sh")
    if "ptcc " in block and "pip install" not in block
]
#: Commands with a test of their own. The first costs as much as all others: tests/cli, test_all_examples_behave_*; the
#: second ends at Ctrl-C only: tests/report/test_explorer_page.py, test_ctrl_c_ends_the_explorer_at_once_*; the
#: third starts a process for each core: tests/batch, test_a_process_that_*; here it runs in this one.
RUN_ELSEWHERE = {"ptcc examples all -o figures", "ptcc explore fig3a", "ptcc batch ensemble.toml -o table.csv"}


@pytest.mark.few(0)
@pytest.mark.parametrize("session", SESSIONS, ids=lambda text: text.splitlines()[0][:30])
def test_commands_run(session: str, folder: Path):
    run_commands(session, folder, RUN_ELSEWHERE)


@pytest.mark.few(0)
def test_the_batch_runs(folder: Path):
    lines = next(session for session in SESSIONS if "ptcc batch" in session).splitlines()
    (spec,) = [line for line in lines if line.endswith("> ensemble.toml")]
    (command,) = [line for line in lines if line.startswith("ptcc batch ")]
    run_commands(f"{spec}\n{command.partition('#')[0]} --workers 1", folder)


def test_there_are_commands():
    """Every command of ``ptcc`` is shown, and run above."""
    shown = {line.split()[1] for text in SESSIONS for line in text.splitlines() if line.startswith("ptcc ")}
    assert shown == set(cli.commands)


@pytest.mark.few(0)
@pytest.mark.parametrize("code", [block for _, block in blocks(TEXT, "python")])
def test_python_runs(code: str):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_transcript_is_what_ptcc_prints(folder: Path):
    run_commands(next(line for line in SESSIONS[0].splitlines() if line.startswith("printf ")), folder)
    assert check_transcripts(TEXT) == 1


def test_the_set_up_commands_are_there():
    first, second = [line for _, block in blocks(TEXT, "sh") if block not in SESSIONS for line in block.splitlines()]
    assert "pip install" in first and first.endswith("ptcc certify fig1b")
    assert second == "pytest"
    assert "`bash .ci/run`" in TEXT
    assert "\npytest\n" in (README.parent / ".ci" / "run").read_text(encoding="utf-8")  # as the README says it


def test_what_goes_together_is_as_the_page_tells_it():
    """Pairs that are certified, and those that are not."""
    page = (README.parent / "docs" / "guide" / "what-goes-together.md").read_text(encoding="utf-8")
    told = _table(page.partition("## Where a and b")[0])
    mine = _table(TEXT.partition("## What goes together")[2].partition("## More")[0])
    named = {"disturbances": "disturbances without it"}
    of_page = [next(k for k, (name, _) in told.items() if name == named.get(own, own)) for own, _ in mine.values()]
    for row, (_, cells) in mine.items():
        for column in range(1, row):
            pair = sorted((of_page[row - 1], of_page[column - 1]))
            certified = told[pair[1]][1][pair[0] - 1] == "+"
            assert (cells[column - 1] == "+") is certified, (row, column)


def _table(text: str) -> dict[int, tuple[str, list[str]]]:
    """Return the rows of a triangular table by their numbers: the name, and the cells."""
    rows = re.findall(r"^\| ?(\d+) ?\|? ([^|]+)\|(.*)\|$", text, re.MULTILINE)
    return {int(number): (name.strip(), [cell.strip() for cell in cells.split("|")]) for number, name, cells in rows}
