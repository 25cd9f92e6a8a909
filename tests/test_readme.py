"""Everything the README shows is run, and shows what it says."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from ptcc_certify.cli import cli

README = Path(__file__).parent.parent / "README.md"
TEXT = README.read_text(encoding="utf-8") if README.exists() else ""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


def ptcc(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = shlex.split(command, comments=True)
    assert words[0] == "ptcc"
    return subprocess.run(
        [sys.executable, "-m", "ptcc_certify.cli", *words[1:]], cwd=folder, capture_output=True, text=True, timeout=120
    )


#: Blocks of commands, each run from top to bottom in one folder as a reader would; those that set up are CI's own.
SESSIONS = [block for block in blocks("sh") if "ptcc " in block and "pip install" not in block]


@pytest.mark.parametrize("session", SESSIONS, ids=lambda text: text.splitlines()[0][:30])
def test_commands_run(session: str, tmp_path: Path):
    for command in session.splitlines():
        if command.startswith("printf "):
            subprocess.run(["sh", "-c", command], cwd=tmp_path, check=True)
            continue
        done = ptcc(command, tmp_path)
        assert done.returncode == 0, (command, done.stderr)
        words = shlex.split(command, comments=True)
        for option in {"-o", "--write-graphs", "--curve"} & set(words):
            assert (tmp_path / words[words.index(option) + 1]).exists()


def test_there_are_commands():
    """Every command of ``ptcc`` is shown, and run above."""
    shown = {line.split()[1] for block in SESSIONS for line in block.splitlines() if line.startswith("ptcc ")}
    assert shown == set(cli.commands)


@pytest.mark.parametrize("code", blocks("python"))
def test_python_runs(code: str, tmp_path: Path):
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_transcript_is_what_ptcc_prints(tmp_path: Path):
    """To the letter, but for lines of floating point, whose last digits depend on the machine.

    These are the two lines of the simulation and the two of the search.
    """
    (block,) = blocks("console")
    command, *shown = block.rstrip("\n").splitlines()
    done = ptcc(command.removeprefix("$ "), tmp_path)
    assert done.returncode == 0, done.stderr
    printed = done.stdout.splitlines()
    assert len(printed) == len(shown)
    for said, seen in zip(shown, printed, strict=True):
        if not re.match(r"simulated|\s+(end state|tried|taken)", said):
            assert said == seen


def test_the_verdict_line_is_what_ptcc_prints(tmp_path: Path):
    """A refuted expectation, and gains with which the bound would say something."""
    ((command, shown),) = re.findall(r"\n(ptcc certify [^\n]*)\n\.\.\.\n(verdict [^\n]*)\n", TEXT)
    done = ptcc(command, tmp_path)
    assert done.returncode == 3 and done.stdout.splitlines()[-1] == shown


def test_the_set_up_commands_are_there():
    first, second = [line for block in blocks("sh") if block not in SESSIONS for line in block.splitlines()]
    assert "pip install" in first and first.endswith("ptcc certify fig1b")
    assert second == "bash .ci/run"
    assert (README.parent / ".ci" / "run").exists()


def test_the_packaged_graphs_and_the_theorem_table_are_complete():
    assert [row.split("|")[4].strip() for row in TEXT.splitlines() if re.search(r"\| \d\.\d \|$", row)] == [
        "1.1",
        "1.2",
        "2.1",
        "2.2",
        "3.1",
        "3.2",
    ]
