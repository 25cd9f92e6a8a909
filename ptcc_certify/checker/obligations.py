"""What a certificate may prove, and the report of a check."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lmi.exact.decimal_rounding import counted

#: What each kind of obligation states, and what makes it part of the claim; the fixed texts of FORMAT.md.
_TEXTS = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
OBLIGATIONS: dict[str, tuple[str, str]] = {kind: (text, lemma) for kind, (text, lemma) in _TEXTS.items()}


@dataclass(frozen=True)
class ProofObligation:
    """What an obligation states: its kind, and the part of the certificate that it is about."""

    kind: str
    of: str

    @property
    def statement(self) -> str:
        """What is stated."""
        return OBLIGATIONS[self.kind][0]

    @property
    def lemma(self) -> str:
        """What makes the statement part of the claim."""
        return OBLIGATIONS[self.kind][1]


@dataclass(frozen=True)
class VerifiedObligation(ProofObligation):
    """One obligation that was verified, and what was verified."""

    detail: str


@dataclass(frozen=True, repr=False)
class CheckReport:
    """What came of a check.

    Attributes
    ----------
    accepted : bool
        Every claim outside ``unverified`` was verified.
    verdict : str
        Of the certificate: ``certified`` or ``undecided``.
    obligations : tuple of VerifiedObligation
        The obligations that were verified, in order.
    rejected : str or None
        The obligation, or the part of the document, that was not.
    reason : str or None
        Why it was not.
    arithmetic : str
        What the numbers were computed with.
    sha256 : str
        Of the graph.
    memory : float
        The ``memory``, in GB, for which all that was checked is allowed.
    sections, proved : dict
        What the certificate says, as far as it was read: sections by key; numbers and witnesses by kind and place.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> document = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), asks=Asks(simulation=False)).to_dict()
    >>> check(document).accepted, check(document | {"verdict": "undecided"}).rejected
    (True, 'verdict')
    """

    accepted: bool
    verdict: str
    obligations: tuple[VerifiedObligation, ...]
    rejected: str | None
    reason: str | None
    arithmetic: str
    sha256: str
    memory: float = 0.0
    sections: Mapping[str, Any] = field(default_factory=dict, compare=False)
    proved: Mapping[tuple[str, str], Mapping[str, Any]] = field(default_factory=dict, compare=False)

    def __repr__(self) -> str:
        if not self.accepted:
            return f"CheckReport(rejected {self.rejected}: {self.reason})"
        return f"CheckReport(accepted, {self.verdict}, {len(self.obligations)} obligations verified)"

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON-ready data."""
        obligations = [{"kind": o.kind, "of": o.of, "verified": o.detail, "lemma": o.lemma} for o in self.obligations]
        return {
            "accepted": self.accepted,
            "verdict": self.verdict,
            "obligations": obligations,
            "rejected": self.rejected,
            "reason": self.reason,
            "arithmetic": self.arithmetic,
            "graph_sha256": self.sha256,
        }

    def lines(self) -> list[str]:
        """Return the report as text, one line for each obligation; what would steer a terminal is ``?``."""
        return ["".join(c if c.isprintable() else "?" for c in line) for line in self._lines()]

    def _lines(self) -> list[str]:
        lines = [f"verified   {o.kind} of {o.of}: {o.detail} ({o.lemma})" for o in self.obligations]
        if self.accepted:
            count = counted(len(self.obligations), "proof obligation")
            return [*lines, f"accepted   {self.verdict}; {count} by {self.arithmetic}"]
        return [*lines, f"rejected   {self.rejected}: {self.reason}"]
