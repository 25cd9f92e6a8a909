"""The certificate, made or read back: its content, with the word of the independent check, its verdict and its file."""

from __future__ import annotations

import hashlib
import json
import math
import sys
from collections.abc import Iterable, Mapping
from copy import deepcopy
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from lmi.exact.decimal_rounding import down, float_down, float_up
from ptcc_certify.certificate.assessment import Assessment, rejection, rejects, verdict_of
from ptcc_certify.certificate.checking import read_and_check, refuse_no_certificate
from ptcc_certify.certificate.constrained_switching.final_states import ends_for_signal
from ptcc_certify.certificate.document import certificate_document, read_document
from ptcc_certify.certificate.evidence import Evidence
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.request import Source
from ptcc_certify.certificate.section_io import read_side_files
from ptcc_certify.certificate.verdict import assess
from ptcc_certify.checker import CheckReport, VerifiedObligation
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import FormatError, ParameterError, PTCCError, gated, spell
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.labels import import_pandas
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.recognised_files import refuse_as_certificate
from ptcc_certify.lazy_report import rendered

if TYPE_CHECKING:
    import pandas as pd


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


def _of_graph(proof: GraphProof) -> dict[str, Any]:
    """Return where agents begin and end, and how near they are proved to be, NaN where that is not known."""
    unknown = np.full(proof.graph.n_nodes, np.nan)
    begin, end = proof.initial_positions, proof.final_positions
    deviation = unknown
    if begin is not None and proof.functions:
        share = 1 if proof.direct else float(proof.protocol.span / proof.protocol.T)
        deviation = proof.deviation_bound([0.01 * share])[:, 0]
    return {
        "x(0)": unknown if begin is None else [float(x) for x in begin],
        "x(T)": unknown if end is None else np.asarray(end, dtype=float),
        "deviation": np.where(np.isfinite(deviation), deviation, np.nan),
    }


def _of_family(proof: FamilyProof, certified: bool) -> dict[str, Any]:
    """Return intervals; nothing of restricted signals, nor of boxes, unless the check accepts the certificate."""
    unknown: list[Interval | None] = [None] * proof.family.n_nodes
    restricted = ends_for_signal(proof) if certified else unknown
    signal = "" if proof.signal == "any" else str(proof.signal)
    return {
        **_pair("least", "largest", proof.final_positions or unknown),
        **_pair("restricted_least", "restricted_largest", restricted),
        "restricted_to": ["" if ends is None else signal for ends in restricted],
        **_pair("box_least", "box_largest", _boxes(proof) if certified else unknown),
        **_pair("stays_least", "stays_largest", _ranges(proof) if certified else unknown),
        "keeps": _keeps(proof),
    }


def _pair(least: str, largest: str, states: Iterable[Interval | None]) -> dict[str, np.ndarray]:
    """Return two columns of ends rounded outwards, NaN where there are none."""
    unknown = (math.nan, math.nan)
    ends = [unknown if one is None else (float_down(one[0]), float_up(one[1])) for one in states]
    low, high = np.array(ends, dtype=float).T
    return {least: low, largest: high}


def _boxes(proof: FamilyProof) -> list[Interval | None]:
    """Return the interval of the box of every agent that is in one."""
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, box in proof.boxes.items():
        nodes = proof.parts[number].component.nodes[box.decay.nodes].tolist()
        for v, low, high in zip(nodes, box.lower, box.upper, strict=True):
            result[v] = low, high
    return proof.in_places(result)


def _ranges(proof: FamilyProof) -> list[Interval | None]:
    """Return the interval in which every signal keeps an agent whose end depends on it."""
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, ends in proof.ranges.items():
        for v, own in zip(proof.parts[number].component.nodes.tolist(), ends, strict=True):
            result[v] = own
    return proof.in_places(result)


def _keeps(proof: FamilyProof) -> np.ndarray:
    """Tell which agents no edge of any mode leads to, while no sliding variable moves, nor leaders."""
    _, target, _ = proof.family.union
    hears = np.zeros(proof.family.n_nodes, dtype=bool)
    hears[target] = True
    return ~hears & (proof.direct and not proof.leaders_move)


@gated
class Certificate(Evidence):
    """A claim about a signed digraph, or a family of these, under a protocol, with its proof.

    Made by :func:`ptcc_certify.certify`, or read from a file by :func:`read_certificate`. What its parts tell is asked
    of it by the same names: ``cert.rate`` is ``cert.proof.rate``, ``cert.limits`` is ``cert.question.request.limits``.
    In a formation ``cert.final_state`` is of positions, and ``cert.proof.final_state`` less the places.

    Attributes
    ----------
    proof : GraphProof or FamilyProof
        What is proved, with the question that it answers: :mod:`ptcc_certify.certificate.graph_proof` of one graph,
        :mod:`ptcc_certify.certificate.family_proof` of a family whatever the signal.
    observed : Observations
        What was seen, and is not claimed.

    References
    ----------
    Theorems 1 to 6 and Corollaries 1 to 10 of [Zhu]_; docs/theory/families.md.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], asks=Asks(simulation=False))
    >>> cert.verdict, cert.claim.behaviour, cert.claim.theorem
    ('certified', 'bipartite consensus', '1.1')
    >>> cert.final_state, bool(cert.rate <= cert.upper_bound), cert.checked.accepted
    (FinalState(1=1, 2=-1), True, True)
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> certify({"day": day, "night": night}, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2, 3])
    Certificate(certified; bipartite consensus for every signal, rate 0.955184)
    """

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

    # ------------------------------------------------------------------ of families, and tables

    @property
    def refused(self) -> bool:
        """Whether the check does not accept functions that were found of a family: what follows of them is not told."""
        parts = self.proof.parts if isinstance(self.proof, FamilyProof) else ()
        accepted = self.checked is not None and self.checked.accepted
        return not accepted and any(part.functions for part in parts)

    def to_pandas(self) -> pd.DataFrame:
        """Return one row per agent: where it begins and ends, and how near its end it is proved.

        Of one graph ``role``, ``group``, ``camp`` and ``component`` are those of :meth:`Structure.to_pandas`; ``x(0)``
        and ``x(T)`` are rounded to floats; ``deviation`` bounds ``|x_k - x_k(T)|`` at 0.99 T, or at T_r + 0.99 T_s,
        with nothing late, leaders at rest and no cap of the gain, of virtual positions where these are exchanged. The
        last three are NaN where the certificate has no initial state, or nothing is proved. Of agents of order n there
        are columns for each derivative and coordinate, such as ``v_2(T)``, and the proved bound of the input.

        Of a family ends are rounded outwards to floats, and NaN where nothing is proved; they are those with nothing
        late and leaders at rest, also where more was asked.

        - ``least``, ``largest``: of the state at the deadline, for every signal.
        - ``restricted_least``, ``restricted_largest``: the same for the signals that were asked for, if not all were;
          ``restricted_to`` names these, ``"constant"`` or ``"DwellTime(1/5, clock='t')"`` say, and is empty where there
          are no such ends. Where the last mode decides, an agent stays between them at all times, whether or not it
          comes to rest.
        - ``box_least``, ``box_largest``: the interval into which every signal draws a follower whose end depends on the
          signal. It may move there for ever: these are no ends at the deadline.
        - ``stays_least``, ``stays_largest``: the interval in which every signal keeps an agent at all times whose end
          depends on the signal.
        - ``keeps``: whether no edge of any mode leads to the agent and neither sliding variables nor leaders move, so
          that it stays at ``x(0)`` under every signal. Edges alone decide this, and it is no part of the claim that is
          checked.

        Without an initial state ``keeps`` alone is known, of an undecided certificate no restricted ends and no boxes.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
        >>> certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).to_pandas()["x(T)"].to_dict()
        {'a': -1.0, 'b': 1.0}
        >>> pair = Family.from_intervals([("a", "b", -2, -1)])
        >>> table = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]).to_pandas()
        >>> table.loc["b", ["least", "largest"]].tolist(), table["keeps"].tolist()
        ([-1.0, -1.0], [True, False])
        >>> moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
        >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {"a": 0, "b": 4, "c": 9})
        >>> cert.to_pandas()[["box_least", "box_largest"]].loc["c"].tolist()
        [1.0, 2.0]
        """
        pandas = import_pandas()
        columns: Mapping[Any, Any]
        proof = self.proof
        if isinstance(proof, FamilyProof):
            columns = _of_family(proof, self.verdict == "certified")
        else:
            own = _of_graph(proof) if proof.agents is None else proof.agents.columns()
            columns = {**proof.structure.to_pandas(), **own}
        return pandas.DataFrame(columns, index=pandas.Index(proof.labels, name="node"))

    def __repr__(self) -> str:
        rate = "none" if self.proof.rate is None else down(self.proof.rate)
        return f"Certificate({spell(self.assessment.brief)}; {self.proof.headline}, rate {rate})"


def read_certificate(
    path: str | Path | Mapping[str, Any] | Certificate, *, stdlib: bool = False, memory: float = 1
) -> Certificate:
    """Check a certificate's file with the independent check, and read it back.

    Nothing is taken from a file that the check does not accept, and no claim from its key ``unverified``. Bounds are
    rebuilt from the exact numbers of the file and rounded to the safe side, as those of a fresh certificate are.

    Parameters
    ----------
    path : str, Path, mapping or Certificate
        A file of schema ``ptcc-certificate/3``; its side files are in the same folder. ``"-"`` is standard input, with
        side files in the current folder. Or its parsed JSON, without side files; or a certificate, which is written
        down and read back.
    stdlib : bool
        Let the check use the standard library alone.
    memory : float
        GB that the check may take; see :func:`ptcc_certify.checker.check`.

    Returns
    -------
    Certificate
        Its verdict is ``certified`` or ``undecided``.

    Raises
    ------
    FormatError
        The file cannot be read as a certificate.
    RejectedCertificate
        The check does not accept it; nothing in it may be taken for proved.
    PTCCError
        A weight or parameter is exact in the file, but beyond the range of float64.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     saved = read_certificate(f"{folder}/c.json")
    >>> saved, saved.checked.accepted, [str(x) for x in saved.final_state.states]
    (Certificate(certified; signed-average consensus, Theorem 1.1, rate 3.99999), True, ['-1', '1'])
    >>> bool(saved.norm_bound([0.5])[0] < saved.norm_bound([1])[0])
    True
    >>> saved.with_simulation(samples=11).comparison.violated
    False
    """
    files = None
    refuse_no_certificate(path)
    if not isinstance(path, str | Path | Mapping) and hasattr(path, "for_check"):
        path, files = path.for_check()
    if isinstance(path, Mapping):
        try:
            path = json.loads(text_of(dict(path)))
        except (TypeError, ValueError, RecursionError):
            raise FormatError("the mapping is no JSON object; parse the file with json.load") from None
        document, report = read_and_check(path, files=files, stdlib=stdlib, memory=memory)
        file, sha256 = Path("certificate.json"), hashlib.sha256(bytes_of(document)).hexdigest()
        if not report.accepted:
            raise RejectedCertificate(file, report)
        return accepted_certificate(file, document, sha256, report, files or {})
    if path == "-":
        return _accepted(Path("certificate.json"), *_read_standard_input(stdlib, memory), name="standard input")
    refuse_no_path(path)
    path = Path(path)  # type: ignore[arg-type]
    sha256 = _file_hash(path)
    document, report = read_and_check(path, stdlib=stdlib, memory=memory)
    if _file_hash(path) != sha256:
        raise FormatError(f"{shorten(str(path), 200)}: was changed while it was read; try again")
    return _accepted(path, document, report, sha256)


def _accepted(
    path: Path, document: dict[str, Any], report: CheckReport, sha256: str, name: str | None = None
) -> Certificate:
    """Return the certificate of a file, with the side files in its folder, or refuse what the check rejects."""
    if not report.accepted:
        raise RejectedCertificate(Path(name or path), report)
    return accepted_certificate(path, document, sha256, report, read_side_files(document, path.parent))


class _Hashed:
    """A binary file, whose bytes are hashed as they are read."""

    def __init__(self, file: BinaryIO):
        self.file, self.sha256 = file, hashlib.sha256()

    def read(self, size: int) -> bytes:
        """Return the next bytes, at most so many."""
        content = self.file.read(size)
        self.sha256.update(content)
        return content


def _read_standard_input(stdlib: bool, memory: float) -> tuple[dict[str, Any], CheckReport, str]:
    """Check what stands on standard input, which can be read once, and hash it as the check reads it."""
    usual = sys.stdin
    hashed = _Hashed(getattr(usual, "buffer", BytesIO()))
    sys.stdin = SimpleNamespace(buffer=hashed) if usual else usual  # type: ignore[assignment]
    try:
        document, report = read_and_check("-", stdlib=stdlib, memory=memory)
    finally:
        sys.stdin = usual
    return document, report, hashed.sha256.hexdigest()


def accepted_certificate(
    path: Path, document: Mapping[str, Any], sha256: str, report: CheckReport, files: Mapping[str, bytes]
) -> Certificate:
    """Return the certificate, of a graph or a family, whose file the independent check accepts."""
    return Certificate(*read_document(Source(path, sha256, document, report, None, files)))


def _file_hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        refuse_as_certificate(str(path))
        raise FormatError(f"{shorten(str(path), 200)}: not a readable certificate ({error.strerror})") from None
