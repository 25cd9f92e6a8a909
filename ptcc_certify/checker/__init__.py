"""The independent check of a certificate: from its JSON alone, in exact arithmetic, without a solver.

Reads schema ``ptcc-certificate/1``, recomputes the structure of the graph from its edges, and checks every claim
outside ``unverified``, step by step as the proof lists them. Imports the standard library and three modules on exact
arithmetic, nothing that makes certificates; python-flint and NumPy are used where they are installed. ``FORMAT.md``
specifies the file. The modules, in the order of the proof: ``reading``, ``vectors``, ``digraph``, ``structure``,
``outcome``, ``lyapunov``, ``effort``.

    python -m ptcc_certify.checker certificate.json [--stdlib] [--memory GB]
"""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lmi.exact.work import WorkError, limited
from ptcc_certify.checker.effort import INPUT_NODES, EffortCheck
from ptcc_certify.checker.obligations import OBLIGATIONS, CheckReport, Statement, Step
from ptcc_certify.checker.outcome import REACHING_BITS, SLIDING_BOUND, SLIDING_CLOCK
from ptcc_certify.checker.reading import SCHEMA, RejectedError, digest, entries, fields, need, read
from ptcc_certify.checker.structure import MANY_COMPONENTS
from ptcc_certify.checker.vectors import SideFiles
from ptcc_certify.errors import FormatError

USAGE = "usage: python -m ptcc_certify.checker CERTIFICATE [--stdlib] [--memory GB]"

__all__ = [
    "INPUT_NODES",
    "MANY_COMPONENTS",
    "OBLIGATIONS",
    "REACHING_BITS",
    "SCHEMA",
    "SLIDING_BOUND",
    "SLIDING_CLOCK",
    "CheckReport",
    "Statement",
    "Step",
    "check",
    "digest",
    "read",
]


def check(
    source: str | Path | Mapping[str, Any],
    *,
    stdlib: bool = False,
    files: Mapping[str, bytes] | None = None,
    memory: float = 1,
) -> CheckReport:
    """Check a certificate.

    Parameters
    ----------
    source : str, Path or mapping
        A path, or the parsed JSON object.
    stdlib : bool
        Use the standard library alone, even where python-flint and NumPy are installed.
    files : mapping of str to bytes, optional
        The side files by name, in place of those in the folder of the certificate.
    memory : float
        GB that the check may take; what would take more is rejected before it is formed. The work that is allowed, some
        seconds for each GB, grows with it.

    Returns
    -------
    CheckReport

    Raises
    ------
    FormatError
        The file cannot be read as a certificate; one line.

    Examples
    --------
    >>> check({"schema": SCHEMA}).reason
    'the key "producer" is missing'
    """
    return read_and_check(source, stdlib=stdlib, files=files, memory=memory)[1]


def read_and_check(
    source: str | Path | Mapping[str, Any],
    *,
    stdlib: bool = False,
    files: Mapping[str, bytes] | None = None,
    memory: float = 1,
) -> tuple[dict[str, Any], CheckReport]:
    """Return the parsed JSON object beside the report of :func:`check`, whose parameters these are.

    Raises
    ------
    FormatError
        The file cannot be read as a certificate; one line.

    Examples
    --------
    >>> read_and_check({"schema": SCHEMA})[0]
    {'schema': 'ptcc-certificate/1'}
    """
    with limited(memory) as account:
        if isinstance(source, Mapping):
            data, folder = dict(source), Path()
        else:
            data, folder = read(source), Path(source).parent
        report = _check(data, SideFiles(folder, files), stdlib)
        return data, replace(report, memory=float(account.needed))


def _check(data: dict[str, Any], files: SideFiles, stdlib: bool) -> CheckReport:
    run = _Check(data, files, stdlib)
    try:
        run.everything()
    except (RejectedError, WorkError) as error:
        reason = str(error)
    except (ArithmeticError, LookupError, TypeError, ValueError, AttributeError, RecursionError, MemoryError) as error:
        reason = f"malformed ({type(error).__name__})"
    else:
        return CheckReport(True, data["verdict"], tuple(run.steps), None, None, run.exact.name, run.sha256)
    return CheckReport(False, "", tuple(run.steps), run.at, reason, run.exact.name, run.sha256)


class _Check(EffortCheck):
    """One run through a whole certificate."""

    def everything(self) -> None:
        keys = ["schema", "producer", "graph", "structure", "claim", "protocol", "paper", "lyapunov", "rates"]
        keys += ["prefactor", "initial_state", "sigma0", "outcome", "reaching_time", "effort", "proof", "verdict"]
        components = ["components"] if "components" in self.data else []
        fields(self.data, [*keys, *components, "digest", "unverified"], "the certificate")
        need(self.data["schema"] == SCHEMA, "an unknown schema")
        need(isinstance(self.data["producer"], str), "producer is not a text")
        need(isinstance(self.data["unverified"], dict), "unverified is not an object")
        entries(self.data["proof"], "proof")
        self.protocol()
        self.graph()
        self.structure()
        self.claims()
        self.outcome()
        self.paper()
        self.members()
        self.rates()
        self.limit()
        self.sliding()
        self.effort()
        self.at = "proof"
        need(self.next == len(self.data["proof"]), "an obligation that nothing asks for")
        self.at = "verdict"
        moving = self.data["rates"]["certified"] is not None or not self.moving
        said = "certified" if moving and self.data["outcome"] is not None else "undecided"
        need(self.data["verdict"] == said, f"what was proved makes it {said}")
        self.at = "digest"
        need(digest(self.data) == self.data["digest"], "the certificate was changed after it was made")


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the certificate that the command line names; 0 proved, 1 rejected, 2 unreadable, 4 undecided."""
    for stream in (sys.stdout, sys.stderr):  # labels may hold what the terminal cannot show
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    words = list(sys.argv[1:] if arguments is None else arguments)
    stdlib, memory = "--stdlib" in words, 1.0
    if "--memory" in words[:-1]:
        place = words.index("--memory")
        try:
            memory = float(words[place + 1])
        except ValueError:
            memory = 0
        del words[place : place + 2]
    paths = [word for word in words if word != "--stdlib"]
    if paths in (["-h"], ["--help"]):
        print(USAGE)
        return 0
    if len(paths) != 1 or paths[0].startswith("-") or not paths[0] or not 0 < memory < math.inf:
        print(USAGE, file=sys.stderr)
        return 2
    try:
        report = check(paths[0], stdlib=stdlib, memory=memory)
    except FormatError as error:
        print(f"checker: {error}", file=sys.stderr)
        return 2
    print("\n".join(report.lines()))
    return 1 if not report.accepted else 0 if report.verdict == "certified" else 4
