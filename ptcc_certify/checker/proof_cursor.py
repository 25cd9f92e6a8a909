"""A certificate while it is checked: what it says, the obligations of its proof one after the other, its side files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lmi.exact.definite import Arithmetic
from ptcc_certify.checker.obligations import OBLIGATIONS, VerifiedObligation
from ptcc_certify.checker.reading import exact, fields, need
from ptcc_certify.checker.side_files import SideFiles


class Document:
    """What a certificate says, how far its proof was followed, and what it is checked with.

    Attributes
    ----------
    data : dict
        The JSON.
    files : SideFiles
    exact : Arithmetic
        Decides definiteness.
    obligations : list of VerifiedObligation
        The obligations that were verified.
    at : str
        What is being verified.
    sha256 : str
        Of the graph.
    """

    def __init__(self, data: dict[str, Any], files: SideFiles, arithmetic: Arithmetic):
        self.data, self.files, self.exact = data, files, arithmetic
        self.obligations: list[VerifiedObligation] = []
        self.at, self.sha256 = "format", ""

    def section(self, key: str) -> Any:
        """Return a part of the document, which is what is verified next."""
        self.at = key
        return self.data[key]

    @property
    def following(self) -> dict[str, Any]:
        """The next obligation, not verified yet; empty if there is none."""
        proof, k = self.data["proof"], len(self.obligations)
        return proof[k] if k < len(proof) and isinstance(proof[k], dict) else {}

    def open(self, kind: str, of: str, numbers: Sequence[str] = (), witness: bool = False) -> dict[str, Any]:
        """Take the next obligation of the proof, which must be this one; return its numbers and its witness."""
        self.at = f"{kind} of {of}"
        need(len(self.obligations) < len(self.data["proof"]), "the proof does not list this obligation")
        keys = ("kind", "of", "proves", "lemma", "numbers", "witness")
        obligation = fields(self.data["proof"][len(self.obligations)], keys, "an obligation")
        texts = [obligation[key] for key in keys[:4]]
        need(texts == [kind, of, *OBLIGATIONS[kind]], "the proof lists another obligation here")
        need(witness or obligation["witness"] is None, "a witness that nothing asks for")
        values = {key: exact(x) for key, x in fields(obligation["numbers"], numbers, "numbers").items()}
        return {**values, "witness": obligation["witness"]}

    def done(self, detail: str) -> None:
        """Close the obligation that was opened last."""
        kind, _, of = self.at.partition(" of ")
        self.obligations.append(VerifiedObligation(kind, of, detail))
        self.at = "format"
