"""``ptcc check --verified``: the checker that is itself proved, an executable that ``formal/`` builds."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ptcc_certify import checker
from ptcc_certify.checker import CheckReport, UnreadableError, VerifiedObligation, read
from ptcc_certify.checker.obligations import OBLIGATIONS
from ptcc_certify.errors import FormatError, ParameterError

#: The variable that names the executable, and the name that is searched on the PATH.
VARIABLE, PROGRAM = "PTCC_VERIFIED", "ptcc-verified"
BUILD = (
    "build it with make in the folder formal of the sources (Debian: apt-get install --no-install-recommends coq "
    f"libcoq-coquelicot ocaml-nox ocaml-findlib libzarith-ocaml-dev), and name formal/ocaml/{PROGRAM} in {VARIABLE}"
)


@dataclass(frozen=True, repr=False)
class VerifiedReport(CheckReport):
    """What the verified checker said.

    Attributes
    ----------
    not_checked : tuple of str
        The obligations and the parts of the document that it did not check; a claim among them makes the verdict
        ``undecided``.
    last : str
        What it said in its last line of a certificate that it accepted.
    """

    not_checked: tuple[str, ...] = ()
    last: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON-ready data."""
        return super().to_dict() | {"not_checked": list(self.not_checked)}

    def _lines(self) -> list[str]:
        *verified, last = super()._lines()
        left = [f"not checked {what}" for what in self.not_checked]
        return [*verified, *left, f"accepted   {self.last}"] if self.accepted else [*verified, last]


def executable() -> Path:
    """Return the verified checker: that of ``PTCC_VERIFIED``, of the sources beside this package, or on the PATH.

    Raises
    ------
    ParameterError
        There is none; says how to build it.
    """
    if named := os.environ.get(VARIABLE):
        if not Path(named).is_file():
            raise ParameterError(f"{VARIABLE} names {named}, which is no file; {BUILD}")
        return Path(named)
    built = Path(__file__).resolve().parents[2] / "formal" / "ocaml" / PROGRAM
    found = built if built.is_file() else shutil.which(PROGRAM)
    if found is None:
        raise ParameterError(f"the verified checker is not built; {BUILD}")
    return Path(found)


def verified_check(certificate: str, memory: float = 1) -> tuple[dict[str, Any], VerifiedReport]:
    """Check a certificate with the verified checker; return its JSON object beside the report.

    Parameters
    ----------
    certificate : str
        A path.
    memory : float
        GB that the check may take; of the processor it takes at most ten seconds for each.

    Raises
    ------
    ParameterError
        The executable is not there, or cannot be run.
    FormatError
        The certificate cannot be read, or has a form that the verified checker does not read.
    """
    program = executable()
    if certificate == "-":
        raise ParameterError("the verified checker reads a file, not standard input; name a file")
    try:
        document = read(certificate)
    except UnreadableError as error:
        raise FormatError(str(error)) from None
    try:
        words = [str(program), "--obligations", "--memory", str(memory), certificate]
        run = subprocess.run(words, capture_output=True, check=False)
    except OSError as error:
        raise ParameterError(f"{program} cannot be run ({error.strerror}); {BUILD}") from None
    output = run.stdout.decode("utf-8", "replace").rstrip("\n").split("\n")
    if run.returncode not in (0, 1, 4) or not output[0]:
        message = run.stderr.decode("utf-8", "replace").strip().removeprefix(f"{PROGRAM}: ")
        if run.returncode < 0 or "out of memory" in message.lower():
            message = "the check takes too much memory or time; allow more by --memory"
        raise FormatError(f"{certificate}: {message or f'{PROGRAM} ended with code {run.returncode}'}")
    report = _report(output, run.returncode)
    if not report.accepted:
        return document, report
    own = checker.read_and_check(certificate, memory=memory)[1]  # what is told of a certificate, its reader reads
    return document, replace(report, sections=own.sections, proved=own.proved) if own.accepted else report


def _after(mark: str, output: list[str]) -> list[str]:
    """Return what stands behind a mark, line by line."""
    return [line.removeprefix(mark).strip() for line in output if line.startswith(mark)]


def _report(output: list[str], code: int) -> VerifiedReport:
    """Return what the executable printed, as the checker would report it."""
    obligations = []
    for line in _after("verified ", output):
        kind, _, rest = line.partition(" of ")
        of, _, words = rest.partition(": ")
        if kind in OBLIGATIONS:
            obligations.append(VerifiedObligation(kind, of, words or "by the verified checker"))
    rejected = " ".join(_after("rejected ", output)) or None
    sha256 = output[0].rpartition(" ")[2] if output[0].startswith("graph ") else ""
    return VerifiedReport(
        accepted=code != 1,
        verdict={0: "certified", 4: "undecided"}.get(code, ""),
        obligations=tuple(obligations),
        rejected=rejected and rejected.partition(":")[0],
        reason=rejected and (rejected.partition(": ")[2] or "not proved"),
        arithmetic="the verified checker",
        sha256=sha256,
        not_checked=tuple(_after("not checked ", output)),
        last=" ".join(_after("accepted ", output)),
    )
