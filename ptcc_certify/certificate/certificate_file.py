"""A certificate as it is recorded: its JSON, what the independent check says of it, its file, and what is told."""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from typing import Any

from ptcc_certify.certificate.assessment import Assessment, rejection, rejects, verdict_of
from ptcc_certify.certificate.document import certificate_document
from ptcc_certify.certificate.evidence import Evidence
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.certificate.proof import Source
from ptcc_certify.certificate.verdict import assess
from ptcc_certify.checker import CheckReport, VerifiedObligation
from ptcc_certify.errors import ParameterError, PTCCError, gated
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.lazy_report import rendered


class RejectedCertificate(PTCCError, ValueError):
    """The independent check does not accept a certificate: nothing in its file may be taken for proved.

    Attributes
    ----------
    path : Path
        Of the file.
    report : CheckReport
        What the check found: ``rejected`` names the part, ``reason`` tells why.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "c.json")
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)).save(path)
    ...     _ = path.write_text(path.read_text().replace('"rho2": "1"', '"rho2": "2"'))
    ...     try:
    ...         read_certificate(path)
    ...     except RejectedCertificate as error:
    ...         print(error.path.name, error.report.rejected)
    c.json input
    """

    def __init__(self, path: Path, report: CheckReport, mend: str = "certify the graph again"):
        self.path = path
        self.report = report
        reason = f"the independent check rejects {report.rejected}: {report.reason}"
        super().__init__(f"{shorten(str(path), 200)}: {reason}; {mend}")


class Recorded(Evidence):
    """A certificate as it is recorded: JSON and file, check and verdict, what is told."""

    @property
    def source(self) -> Source | None:
        """The file that it was read from."""
        return self.proof.source

    # ------------------------------------------------------------------ the JSON, and the check

    @cached_property
    def _recorded(self) -> tuple[Mapping[str, Any], Mapping[str, bytes], CheckReport]:
        if self.source is not None:
            return self.source.document, self.source.files, self.source.report
        return certificate_document(self)

    def for_check(self) -> tuple[Mapping[str, Any], Mapping[str, bytes]]:
        """Return the JSON and the contents of its side files, as the independent check takes them."""
        return self._recorded[:2]

    @cached_property
    def checked(self) -> CheckReport | None:
        """What the independent check says; None where there is nothing to check."""
        return self._recorded[2] if self.proof.checkable else None

    @property
    def obligations(self) -> tuple[VerifiedObligation, ...]:
        """What the independent check verified, in its order."""
        return () if self.checked is None else self.checked.obligations

    @property
    def verdict(self) -> str:
        """``certified`` if what was to be proved is and the independent check accepts it, else ``undecided``."""
        return verdict_of(self.checked)

    @cached_property
    def assessment(self) -> Assessment:
        """The graded verdict: whether the bound says something by the deadline, what became of expectations."""
        return assess(self, self.checked)

    @property
    def document(self) -> Mapping[str, Any]:
        """The JSON, without side files unless it was read with some; where the check rejects, nothing but that.

        What stands under ``unverified`` is its own word.
        """
        document, files, report = self._recorded
        if self.source is not None:
            return document
        if self.proof.checkable and rejects(report):
            return rejection(report)
        if files:
            document = certificate_document(self, files=False)[0]
        return {**document, "verdict": self.verdict}

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as JSON-ready data of schema ``ptcc-certificate/3``, without side files: a copy.

        One that was read is what its file says. Of one that the independent check rejects, a defect of this program,
        it tells the verdict, what is rejected and why, and no claim.
        """
        return deepcopy(dict(self.document))

    def to_json(self) -> str:
        """Return the certificate as one JSON object, without NaN or infinity."""
        return text_of(self.document)

    @gated
    def save(self, path: str | Path) -> None:
        """Write the certificate to ``path``; the file appears whole or not at all.

        Vectors of more than 50,000 entries go to ``.npy`` files beside it, which are written first.

        Parameters
        ----------
        path : str or Path
            Ends in ``.json``, or has no ending.

        Raises
        ------
        ParameterError
            Another ending, or there is nothing to check.
        FormatError
            The file cannot be written.
        RejectedCertificate
            The independent check does not accept it, a defect of this program: nothing is written.
        """
        refuse_no_path(path)
        if self.checked is None:
            raise ParameterError("nothing is certified of this family, so that no certificate is written")
        if rejects(self.checked):
            mend = "this is a defect of this program, nothing was written; please report this graph"
            raise RejectedCertificate(Path(path), self.checked, mend)
        write_certificate(path, *self.for_check())

    # ------------------------------------------------------------------ the file that it was read from

    @property
    def path(self) -> Path:
        """The file that it was read from."""
        return self._file.path

    @property
    def sha256(self) -> str:
        """Of the file that it was read from."""
        return self._file.sha256

    @property
    def report(self) -> CheckReport:
        """What the independent check says of a certificate that was read."""
        return self._file.report

    @property
    def _file(self) -> Source:
        if self.source is None:
            of = "report, path and sha256 are of a certificate that was read from a file"
            raise ParameterError(
                f"{of}; for a page or LaTeX: write_report(certificate, path); else save it, and read it"
            )
        return self.source

    # ------------------------------------------------------------------ what is told

    def summary(self) -> str:
        """Return what ``ptcc certify`` prints of it."""
        return "\n".join(rendered("screen.summary_lines", self))

    def facts(self) -> list[Fact]:
        """Return everything that is told of it, as data: see :class:`~ptcc_certify.certificate.fact.Fact`.

        Examples
        --------
        >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
        >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1), [3, 5], asks=Asks(simulation=False))
        >>> verdict = cert.facts()[-1]
        >>> verdict.head, [str(change) for change in verdict.changes]
        ('verdict', ['rho2=0.501'])
        """
        return rendered("facts.of_certificate.facts_of", self)  # type: ignore[no-any-return]

    def plot(self, what: str | None = None, **keywords: Any) -> Any:
        """Draw a figure of the certificate.

        Parameters
        ----------
        what : str, optional
            ``"glance"``, the default: who listens to whom beside every run in its proved tube, the bounds in words.
            ``"decay"``, ``"input"``, ``"graph"``, ``"states"``: runs and bounds, inputs and their proved peaks, graphs,
            states; ``"late"`` and ``"tracking"``: what is proved with late messages, or while leaders move. Of one
            graph also ``"spectrum"``, the eigenvalues; of agents of order n ``"motion"`` and ``"formation"``.
        **keywords : Any
            ``ax`` and others of the function ``ptcc_certify.plot_<what>``.

        Returns
        -------
        matplotlib.axes.Axes
            Of ``"glance"`` and ``"motion"`` the figure.

        Raises
        ------
        ParameterError
            No figure is called so, or there is nothing to draw.
        """
        return rendered("page_figures.plot", self, what or "glance", **keywords)

    def animate(self, path: str | Path, **keywords: Any) -> None:
        """Write a film of the certificate, ``.gif``, ``.html`` or ``.mp4``: agents on their way in their tubes.

        Parameters
        ----------
        path : str or Path
        **keywords : Any
            ``seconds`` and ``time_unit`` of :func:`ptcc_certify.report.plots.animation.animate`.

        Raises
        ------
        ParameterError
            The certificate is of a family, has no initial state or more than 40 agents; or there is no such film.
        """
        rendered("plots.animation.animate", self, path, **keywords)

    # ------------------------------------------------------------------ equality

    def __eq__(self, other: object) -> bool:
        """Two certificates are equal when they claim and prove the same; what was observed does not count."""
        return isinstance(other, type(self)) and self._digest == other._digest

    def __hash__(self) -> int:
        return hash(self._digest)

    @property
    def _digest(self) -> str:
        return str(self._recorded[0]["digest"])


def write_certificate(path: str | Path, document: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Write a certificate, its side files first; each file appears whole or not at all.

    Raises
    ------
    ParameterError
        The path ends neither in ``.json`` nor in nothing.
    FormatError
        A file cannot be written.
    """
    refuse_no_path(path)
    path = Path(path)
    if path.suffix.lower() not in ("", ".json"):
        other = ", a page or LaTeX by write_report, a figure by save_figure"
        raise ParameterError(f"{shorten(str(path), 200)}: a certificate is saved as .json{other}")
    for name, content in files.items():
        write_atomically(path.parent / name, content)
    write_atomically(path, bytes_of(document))


def text_of(document: Mapping[str, Any]) -> str:
    """Return JSON as it stands in a file, without NaN or infinity."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def bytes_of(document: Mapping[str, Any]) -> bytes:
    """Return the file: what UTF-8 cannot hold, a lone surrogate in a label, becomes its JSON escape."""
    return text_of(document).encode("utf-8", "backslashreplace")
