"""Make the stored certificates again: ``python tests/corpus/make.py [NAME ..]``.

``commands.txt`` says what each is of. ``NAME.json`` is the certificate, ``NAME.txt`` what is printed of it by the
command (exit code and screen), of the file (screen), and by the check.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ptcc_certify import Certificate

HERE = Path(__file__).parent
GRAPHS = HERE / "graphs"


def commands() -> dict[str, list[str]]:
    """Return what each certificate is made by: the arguments of ``ptcc certify``."""
    lines = (HERE / "commands.txt").read_text("utf-8").splitlines()
    pairs = (line.split(": ", 1) for line in lines if not line.startswith("#"))
    return {name: [_path(word) for word in shlex.split(arguments)] for name, arguments in pairs}


def _path(word: str) -> str:
    return str(GRAPHS / word) if word.endswith(".csv") else word


def printed(path: Path, saved: Certificate) -> str:
    """Return what is printed of a stored certificate, as it was read back: its screen, and the lines of the check."""
    from ptcc_certify import check
    from ptcc_certify.cli.terminal import flagged
    from ptcc_certify.report.screen import summary_lines

    lines = check(path).lines()
    lines[-1] = lines[-1].split(" by ")[0]  # which packages computed it, of which versions
    return "\n".join([*summary_lines(saved, name=flagged), "", *lines]) + "\n"


def make(name: str, arguments: list[str]) -> int:
    """Write a certificate and what is printed of it; return the exit code of the command."""
    from ptcc_certify import read_certificate
    from ptcc_certify.cli import cli

    path = HERE / f"{name}.json"
    path.unlink(missing_ok=True)
    code = cli.main(["certify", *arguments, "-q", "-o", str(path)], standalone_mode=False)
    (HERE / f"{name}.txt").write_text(f"exit code  {code}\n{printed(path, read_certificate(path))}", "utf-8")
    return code


if __name__ == "__main__":
    made = commands()
    for name in sys.argv[1:] or made:
        print(name, "exit", make(name, made[name]), flush=True)
