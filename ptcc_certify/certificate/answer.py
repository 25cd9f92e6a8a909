"""What became of one expectation of a certificate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from ptcc_certify.checker import CheckReport

#: What became of an expectation.
MET, REFUTED, OPEN = "met", "refuted", "left open"


@dataclass(frozen=True)
class Answer:
    """What became of one expectation: ``met``, ``refuted`` or ``left open``, of what, and why."""

    status: str
    what: str
    why: str = ""

    def __str__(self) -> str:
        return f"{self.what} ({self.why})" if self.why else self.what


def rejects(report: CheckReport | None) -> bool:
    """Tell whether the independent check rejects what was found: a defect of this program, which then claims nothing.

    Examples
    --------
    >>> rejects(None), rejects(certify("fig1a", NominalProtocol()).checked)
    (False, False)
    """
    return report is not None and not report.accepted


def rejection_text(report: CheckReport) -> str:
    """Tell what the check rejects, and whose defect that is."""
    return (
        f"the independent check rejects {report.rejected}, a defect of this program: nothing is claimed; "
        "please report this graph"
    )


def rejection(report: CheckReport) -> dict[str, Any]:
    """Return what is left of a certificate that the check rejects, as JSON-ready data: no claim.

    Examples
    --------
    >>> rejection(check({"schema": "ptcc-certificate/2"}))["verdict"]
    'undecided'
    """
    return {"verdict": "undecided", "rejected": report.rejected, "reason": report.reason}


def standing(answers: Iterable[Answer], report: CheckReport | None) -> tuple[Answer, ...]:
    """Return the answers as they rest on what the check accepts: without that all are left open.

    Examples
    --------
    >>> [str(answer) for answer in standing([Answer(REFUTED, "rate >= 5", "upper bound 4, proved")], None)]
    ['rate >= 5 (nothing is certified)']
    """
    if report is not None and report.accepted:
        return tuple(answers)
    return tuple(replace(answer, status=OPEN, why="nothing is certified") for answer in answers)
