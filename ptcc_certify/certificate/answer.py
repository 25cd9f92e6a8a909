"""What became of one expectation of a certificate."""

from __future__ import annotations

from dataclasses import dataclass

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
