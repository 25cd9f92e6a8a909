"""Blocks of Markdown - commands of a shell, Python - and how they are run: from top to bottom, as a reader would.

Commands are run in this process, for speed; that ``ptcc`` is one of its own is told in ``tests/cli``.
"""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Container
from pathlib import Path
from typing import Any

from bad_inputs import Run
from bad_inputs import ptcc as called


def blocks(text: str, *languages: str) -> list[tuple[str, str]]:
    """Return language and text of the blocks in some languages, in the order of the page."""
    return re.findall(rf"^```({'|'.join(languages)})\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def ptcc(command: str) -> Run:
    """Run a line that begins with ``ptcc``."""
    words = shlex.split(command, comments=True)
    assert words[0] == "ptcc", command
    return called(*words[1:])


def run_commands(session: str, folder: Path, elsewhere: Container[str] = ()) -> None:
    """Run the lines of a block in a folder; each ends with exit code 0, or with that of its comment ``# exit code 3``.

    Those in ``elsewhere`` have a test of their own. What an option names as a file to write is there afterwards.
    """
    for match in re.finditer(r".*<<'(\w+)'[\s\S]*?^\1$|.+", re.sub(r"\\\n\s*", "", session), re.MULTILINE):
        command = match[0]
        words = shlex.split(command.splitlines()[0], comments=True)
        if not words or shlex.join(words) in elsewhere:
            continue
        if words[0] != "ptcc":
            subprocess.run(["sh", "-c", command], check=True, cwd=folder)
            continue
        done = ptcc(command)
        assert done.code == _exit_code(command), (command, done.err)
        for option in {"-o", "--write-graphs", "--curve"} & set(words):
            assert (folder / words[words.index(option) + 1]).exists(), command


def check_transcripts(text: str) -> int:
    """Run what is shown after ``$ ptcc``, and compare to the letter; ``...`` stands for lines. Return how many."""
    transcripts = [block for _, block in blocks(text, "console") if block.startswith("$ ptcc ")]
    for block in transcripts:
        _check_transcript(block)
    return len(transcripts)


def _check_transcript(block: str) -> None:
    command, shown = block.split("\n", 1)
    done = ptcc(command.removeprefix("$ "))
    assert done.code == _exit_code(command), (command, done.err)
    first, _, last = shown.rpartition("...\n")
    assert done.out.startswith(first) and done.out.endswith(last), done.out
    assert first or "..." in shown or done.out == shown


def _exit_code(command: str) -> int:
    code = re.search(r"# exit code (\d)$", command)
    return int(code[1]) if code else 0


def run_page(text: str, folder: Path) -> None:
    """Run the commands, the transcripts and the Python of a page, in one folder and with one set of names."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for language, block in blocks(text, "sh", "console", "python"):
        if language == "sh":
            run_commands(block, folder)
        elif language == "console":
            if block.startswith("$ ptcc "):
                _check_transcript(block)
        else:
            exec(compile(block, f"<{block.splitlines()[0]}>", "exec"), names)
