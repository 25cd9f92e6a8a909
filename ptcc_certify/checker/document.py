"""A certificate while it is checked: what it says, the obligations of its proof one after the other, its side files.

The check also lays a proof down: :class:`Recorder` takes each obligation when it is asked for, so that the order of a
proof stands in the functions that verify it, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lmi.exact.definite import Arithmetic
from ptcc_certify.checker.obligations import OBLIGATIONS, VerifiedObligation
from ptcc_certify.checker.reading import digest, exact, fields, need
from ptcc_certify.checker.section_declarations import Brings, Context, parts_of, read
from ptcc_certify.checker.side_files import SideFiles


@dataclass(frozen=True, kw_only=True)
class ObligationSection:
    """An obligation of the proof; the first four are texts of the format, the others are there where it brings them."""

    kind: str
    of: str
    proves: str
    lemma: str
    numbers: dict[str, Any] | None = None
    witness: Any | None = None


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
        Of every part that is there, by key, how it is declared, and the object that has the key.
    brings : mapping
        What obligations bring, by kind.
    sections : dict
        What parts say, by key, as far as they were read; None: absent.
    proved : dict
        Numbers and witnesses of obligations, by kind and place.
    """

    def __init__(self, data: dict[str, Any], files: SideFiles, arithmetic: Arithmetic):
        self.data, self.files, self.exact = data, files, arithmetic
        self.obligations: list[VerifiedObligation] = []
        self.at, self.sha256 = "format", ""
        self.context, self.sections = Context(files), dict[str, Any]()
        self.proved: dict[tuple[str, str], dict[str, Any]] = {}
        self.parts: dict[str, tuple[Any, Any]] = {}
        self.brings: Mapping[str, tuple[Brings, ...]] = {}

    def begin(self, certificate: type, brings: Mapping[str, tuple[Brings, ...]]) -> None:
        """Take what is declared of the parts, those of the problem too, and of the obligations."""
        for f in parts_of(certificate, self.data, "the certificate"):
            self.parts[f.key] = f.kind, self.data
        kind, problem = self.parts.pop("problem")[0], self.data["problem"]
        self.parts |= {f.key: (f.kind, problem) for f in parts_of(kind, problem, "the problem")}
        self.brings = brings

    def __contains__(self, key: str) -> bool:
        """Tell whether a part is there."""
        return key in self.parts

    def refuse(self, key: str, why: str) -> None:
        """Reject a part if it is there."""
        self.at = key
        need(key not in self.parts, why)

    def section(self, key: str) -> Any:
        """Return a part of the document, as it is declared, None if it is absent; it is what is verified next."""
        self.at = key
        kind, beside = self.parts.get(key, (None, {key: None}))
        self.sections[key] = read(kind, beside[key], self.context, key)
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
        told: ObligationSection = read(
            ObligationSection, self.data["proof"][len(self.obligations)], self.context, "an obligation"
        )
        texts = [told.kind, told.of, told.proves, told.lemma]
        need(texts == [kind, of, *OBLIGATIONS[kind]], "the proof lists another obligation here")
        need(told.numbers != {}, "numbers is empty, and not left out")
        numbers, declared = told.numbers or {}, self.brings.get(kind, (Brings(),))
        same = (one for one in declared if set(numbers) == set(one.numbers.split()))
        names, witness = next(same, declared[0])
        need(witness is not None or told.witness is None, "a witness that nothing asks for")
        values = {key: exact(x) for key, x in fields(numbers, names.split(), "numbers").items()}
        values["witness"] = read(witness, told.witness, self.context, "the witness")
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
        self.at = next((key for key in self.parts if key not in self.sections), self.at)
        need(self.at in self.sections, "nothing verifies this part")
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
        brought = {key: x for key, x in self.given.pop((kind, of), {}).items() if x not in (None, {})}
        self.data["proof"].append({"kind": kind, "of": of, "proves": proves, "lemma": lemma, **brought})
        return super().open(kind, of)

    def close(self, proved: bool) -> str:
        """Verify that nothing was given in vain; lay down the verdict, and the digest of the whole."""
        self.at = "proof"
        need(not self.given, "an obligation that nothing asks for")
        self.data["verdict"] = "certified" if proved else "undecided"
        self.data["digest"] = digest(self.data)
        return super().close(proved)
