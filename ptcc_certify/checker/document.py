"""A certificate while it is checked: what it says, the obligations of its proof one after the other, its side files.

The check also lays a proof down: :class:`Recorder` takes each obligation when it is asked for, so that the order of a
proof stands in the functions that verify it, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lmi.exact.definite import Arithmetic
from ptcc_certify.checker.obligations import OBLIGATIONS, VerifiedObligation
from ptcc_certify.checker.reading import digest, exact, fields, need
from ptcc_certify.checker.section_declarations import Brings, Context, parts_of, read
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
    context : Context
        Labels of agents and of followers, as far as they are known.
    parts : dict
        How parts are declared, by key.
    brings : mapping
        What obligations bring, by kind.
    sections : dict
        What parts say, by key, as far as they were read.
    proved : dict
        Numbers and witnesses of obligations, by kind and place.
    """

    def __init__(self, data: dict[str, Any], files: SideFiles, arithmetic: Arithmetic):
        self.data, self.files, self.exact = data, files, arithmetic
        self.obligations: list[VerifiedObligation] = []
        self.at, self.sha256 = "format", ""
        self.context, self.sections = Context(files), dict[str, Any]()
        self.proved: dict[tuple[str, str], dict[str, Any]] = {}
        self.parts: dict[str, Any] = {}
        self.brings: Mapping[str, tuple[Brings, ...]] = {}

    def begin(self, certificate: type, brings: Mapping[str, tuple[Brings, ...]]) -> None:
        """Take what is declared of the parts, which must be there, and no other, and of the obligations."""
        self.parts = {f.key: f.kind for f in parts_of(certificate, self.data, "the certificate")}
        self.brings = brings

    def section(self, key: str) -> Any:
        """Return a part of the document, as it is declared; it is what is verified next."""
        self.at = key
        self.sections[key] = read(self.parts[key], self.data[key], self.context, key)
        return self.sections[key]

    def following(self, kind: str, of: str) -> Mapping[str, Any]:
        """Return the next obligation, not verified yet, if it is this one, else nothing."""
        proof, k = self.data["proof"], len(self.obligations)
        obligation = proof[k] if k < len(proof) and isinstance(proof[k], dict) else {}
        return obligation if (obligation.get("kind"), obligation.get("of")) == (kind, of) else {}

    def open(self, kind: str, of: str) -> dict[str, Any]:
        """Take the next obligation of the proof, which must be this one; return its numbers and its witness."""
        self.at = f"{kind} of {of}"
        need(len(self.obligations) < len(self.data["proof"]), "the proof does not list this obligation")
        keys = ("kind", "of", "proves", "lemma", "numbers", "witness")
        obligation = fields(self.data["proof"][len(self.obligations)], keys, "an obligation")
        texts = [obligation[key] for key in keys[:4]]
        need(texts == [kind, of, *OBLIGATIONS[kind]], "the proof lists another obligation here")
        numbers, told = obligation["numbers"], obligation["witness"]
        declared = self.brings.get(kind, (Brings(),))
        same = (one for one in declared if isinstance(numbers, dict) and set(numbers) == set(one.numbers.split()))
        names, witness = next(same, declared[0])
        need(witness is not None or told is None, "a witness that nothing asks for")
        values = {key: exact(x) for key, x in fields(numbers, names.split(), "numbers").items()}
        values["witness"] = read(witness, told, self.context, "the witness")
        self.proved[kind, of] = values
        return values

    def done(self, detail: str) -> None:
        """Close the obligation that was opened last."""
        kind, _, of = self.at.partition(" of ")
        self.obligations.append(VerifiedObligation(kind, of, detail))
        self.at = "format"

    def close(self, proved: bool) -> str:
        """Verify that nothing is left of the proof, the verdict, and the digest; return the verdict."""
        self.at = "proof"
        need(len(self.obligations) == len(self.data["proof"]), "an obligation that nothing asks for")
        verdict = "certified" if proved else "undecided"
        need(self.section("verdict") == verdict, f"what was proved makes it {verdict}")
        need(self.section("digest") == digest(self.data), "the certificate was changed after it was made")
        return verdict


class Recorder(Document):
    """A certificate whose proof, verdict and digest are laid down while it is checked.

    Attributes
    ----------
    given : dict
        By kind and place, in any order, the obligations that have numbers or a witness, and have not been asked for.
    """

    def __init__(
        self,
        data: dict[str, Any],
        files: SideFiles,
        arithmetic: Arithmetic,
        given: Mapping[tuple[str, str], Mapping[str, Any]],
    ):
        super().__init__(data, files, arithmetic)
        self.given = dict(given)
        data |= {"proof": [], "verdict": "undecided", "digest": ""}

    def following(self, kind: str, of: str) -> Mapping[str, Any]:
        """Return an obligation if it is given, else nothing."""
        return self.given.get((kind, of), {})

    def open(self, kind: str, of: str) -> dict[str, Any]:
        """Lay down an obligation, and take it as any other."""
        proves, lemma = OBLIGATIONS[kind]
        obligation: dict[str, Any] = {
            "kind": kind,
            "of": of,
            "proves": proves,
            "lemma": lemma,
            "numbers": {},
            "witness": None,
        }
        self.data["proof"].append({**obligation, **self.given.pop((kind, of), {})})
        return super().open(kind, of)

    def close(self, proved: bool) -> str:
        """Verify that nothing was given in vain; lay down the verdict, and the digest of the whole."""
        self.at = "proof"
        need(not self.given, "an obligation that nothing asks for")
        self.data["verdict"] = "certified" if proved else "undecided"
        self.data["digest"] = digest(self.data)
        return super().close(proved)
