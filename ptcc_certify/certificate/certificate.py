"""The certificate, made or read back: its content, with the word of the independent check, its verdict and its file."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, BinaryIO

from lmi.exact.decimal_rounding import down
from ptcc_certify.certificate.agents_table import agents_table
from ptcc_certify.certificate.certificate_data import Content, Source
from ptcc_certify.certificate.certificate_file import Recorded, RejectedCertificate, bytes_of, text_of
from ptcc_certify.certificate.checking import read_and_check, refuse_no_certificate
from ptcc_certify.certificate.document import certificate_document, read_document
from ptcc_certify.certificate.section_writer import read_side_files
from ptcc_certify.checker import CheckReport, VerifiedObligation
from ptcc_certify.errors import FormatError, gated
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.kinds_of_file import refuse_as_certificate
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    import pandas as pd

    from ptcc_certify.certificate.family_certificate import FamilyCertificate


@gated
@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Content, Recorded):
    """A claim about a signed digraph under a protocol, with its proof.

    Made by :func:`ptcc_certify.certify`, or read from a file by :func:`read_certificate`.

    Attributes
    ----------
    structure : Structure
    protocol : NominalProtocol or SlidingModeProtocol
    initial_state : tuple of N Fraction, or None
        ``X(0)``.
    sigma0 : tuple of N Fraction, or None
        ``sigma(0)`` of the sliding-mode protocol; None for the nominal one.
    reaching : tuple of N ReachingTime, or None
        When each sliding variable is proved to be 0, whatever the disturbance.
    lyapunov : LyapunovFunction or None
        The paper's; None when the search found none or was not started. All that are proved are ``functions``.
    proof : RateProof
        The proved rate of the paper's function (None if not proved) and the statements proved for it.
    searched_functions : tuple of LyapunovFunction
        Better ones, of the classes that ``method`` names, proved.
    limit : RateBound or None
        The proved upper bound on the decay rate, and what proves it; None if no agent listens to another.
    final_state : FinalState or None
        ``Q X(0)``, for the sliding-mode protocol ``Q (X(0) - sigma(0))``; None without an initial state.
    matrix : Influence or None
        ``Q``, as it was computed; see ``influence``.
    request : Request
        What was asked.
    observed : Observations
        What was seen, and is not claimed.
    late : LateBounds or None
        What holds with late messages; None where nothing was asked of them.
    tracking : Tracking or None
        What holds while leaders move; None where nothing was asked of that.
    source : Source or None
        The file that it was read from.
    agents : AgentsAnswer or None
        What is proved of agents of order n; then initial and final states are there, and not above.
    offsets : tuple of N Fraction, or None
        Places of single integrators in a formation: initial and final state and everything else are of ``x - offsets``;
        :attr:`initial_positions` and :attr:`final_positions` are of ``x``.

    References
    ----------
    Theorems 1 to 6 and Corollaries 1 to 10 of [Zhu]_.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], asks=Asks(simulation=False))
    >>> cert.verdict, cert.claim.behaviour, cert.claim.theorem
    ('certified', 'bipartite consensus', '1.1')
    >>> cert.final_state, bool(cert.rate <= cert.upper_bound), cert.checked.accepted
    (FinalState(1=1, 2=-1), True, True)
    """

    def _record(self, files: bool) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
        return certificate_document(self, files)

    @cached_property
    def checked(self) -> CheckReport:
        """What the independent check says of the certificate as it is written, certified or undecided."""
        return self._recorded[2]

    @property
    def obligations(self) -> tuple[VerifiedObligation, ...]:
        """What the independent check verified, in its order."""
        return self.checked.obligations

    def to_pandas(self) -> pd.DataFrame:
        """Return one row per agent: its place in the graph, where it begins and ends, how near its end it is proved.

        ``role``, ``group``, ``camp`` and ``component`` are those of :meth:`Structure.to_pandas`; ``x(0)`` and ``x(T)``
        are rounded to floats; ``deviation`` bounds ``|x_k - x_k(T)|`` at 0.99 T, or at T_r + 0.99 T_s. The last three
        are NaN where the certificate has no initial state, or nothing is proved. Of agents of order n there are columns
        for each derivative and coordinate, such as ``v_2(T)``, and the proved bound of the input.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
        >>> certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).to_pandas()["x(T)"].to_dict()
        {'a': -1.0, 'b': 1.0}
        """
        return agents_table(self)

    @property
    def main_figure(self) -> str:
        """The figure of what is claimed: of moving leaders, late messages, agents of order n, else the decay."""
        if self.agents is not None:
            return "motion"
        if self.initial_state is None or self.final_state is None:
            return "decay"
        return "tracking" if self.tracking is not None else "decay" if self.late is None else "late"

    def __repr__(self) -> str:
        rate = "none" if self.rate is None else down(self.rate)
        behaviour = f"{len(self.structure.components)} components"
        if self.claim:
            behaviour = self.claim.sharpest
        return f"Certificate({behaviour}, {self.theorems_named}, rate {rate}, {self.verdict})"


def read_certificate(
    path: str | Path | Mapping[str, Any] | Certificate | FamilyCertificate, *, stdlib: bool = False, memory: float = 1
) -> Certificate | FamilyCertificate:
    """Check a certificate's file with the independent check, and read it back.

    Nothing is taken from a file that the check does not accept, and no claim from its key ``unverified``. Bounds are
    rebuilt from the exact numbers of the file and rounded to the safe side, as those of a fresh certificate are.

    Parameters
    ----------
    path : str, Path, mapping, Certificate or FamilyCertificate
        A file of schema ``ptcc-certificate/2``; its side files are in the same folder. ``"-"`` is standard input, with
        side files in the current folder. Or its parsed JSON, without side files; or a certificate, which is written
        down and read back.
    stdlib : bool
        Let the check use the standard library alone.
    memory : float
        GB that the check may take; see :func:`ptcc_certify.checker.check`.

    Returns
    -------
    Certificate or FamilyCertificate
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
    (Certificate(signed-average consensus, Theorem 1.1, rate 3.99999, certified), True, ['-1', '1'])
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
) -> Certificate | FamilyCertificate:
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
) -> Certificate | FamilyCertificate:
    """Return the certificate, of a graph or a family, whose file the independent check accepts."""
    if "modes" in document["graph"]:
        from ptcc_certify.certificate.read_family_certificate import read_family_certificate

        return read_family_certificate(Source(path, sha256, document, report, None, files))
    return Certificate(**read_document(path, document, sha256, report, files))


def _file_hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        refuse_as_certificate(str(path))
        raise FormatError(f"{shorten(str(path), 200)}: not a readable certificate ({error.strerror})") from None
