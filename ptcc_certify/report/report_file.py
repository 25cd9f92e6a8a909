"""A certificate written as a page or a statement: checked first, its run repeated for the figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from datetime import date
from pathlib import Path
from typing import Any

from ptcc_certify.certificate.assessment import CERTIFIED, OPEN, REFUTED
from ptcc_certify.certificate.certificate import Certificate, RejectedCertificate, read_certificate
from ptcc_certify.certificate.checking import refuse_no_certificate
from ptcc_certify.certificate.request import listener
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.size_limits import REPEATED_NODES, TRACED_NODES
from ptcc_certify.report.page import rejected_html, report_html
from ptcc_certify.report.page_figures import draw
from ptcc_certify.report.plots.runs_under_signals import sample_runs
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.statement import report_latex
from ptcc_certify.simulation.trajectory import Trajectory

#: What a report is written as.
SUFFIXES = (".html", ".htm", ".tex")


def write_report(
    certificate: str | Path | Mapping[str, Any] | Certificate,
    output: str | Path,
    *,
    simulation: bool | None = None,
    progress: Callable[[str], None] | None = None,
    memory: float = 1,
    day: date | None = None,
) -> str:
    """Check a certificate's file and write a report of it: a page (``.html``) or a statement in LaTeX (``.tex``).

    A statement has its figures beside it, ``<name>_graph.pdf`` and ``<name>_decay.pdf``. Of a certificate that the
    check rejects there is a page that says so and shows nothing else of it, and no statement.

    Parameters
    ----------
    certificate : path, mapping, Certificate
        A file of schema ``ptcc-certificate/3`` (``"-"``: standard input), its parsed JSON, or a certificate.
    output : path
        The suffix decides what is written.
    simulation : bool, optional
        Whether to repeat the CVODES run for the figures; by default up to 1,000 agents. Of a family runs under many
        signals, by default up to 100 agents.
    progress : callable, optional
        Told which of ``independent check``, ``simulation``, ``report`` begins.
    memory : float
        GB that the check may take; see :func:`ptcc_certify.checker.check`.
    day : date, optional
        The day that a page gives as that of its writing; today by default.

    Returns
    -------
    str
        ``certified``, ``undecided`` or ``rejected``; ``left open`` or ``refuted`` if that became of what was asked.

    Raises
    ------
    ParameterError
        Another suffix, or ``output`` is the certificate.
    FormatError
        The file cannot be read as a certificate, or the report not be written.
    RejectedCertificate
        A statement is asked of a certificate that the check rejects.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     write_report(f"{folder}/c.json", f"{folder}/c.html", simulation=False)
    ...     sorted(path.name for path in Path(folder).iterdir())
    'certified'
    ['c.html', 'c.json']
    """
    refuse_no_path(output)
    path, suffix = Path(output), Path(output).suffix.lower()
    if suffix not in SUFFIXES:
        raise ParameterError(f"{output}: a report is written to .html or .tex; choose one of these")
    refuse_no_certificate(certificate)
    in_memory = isinstance(certificate, Certificate | Mapping)
    file = None if in_memory or certificate == "-" else Path(certificate)  # type: ignore[arg-type]
    if file is not None and path.is_file() and file.is_file() and path.samefile(file):
        raise ParameterError(f"{output}: is the certificate itself; name another file")
    if not path.parent.is_dir():
        raise ParameterError(f"{output}: the folder does not exist; make it first")
    if suffix == ".tex" and not re.fullmatch(r"[A-Za-z0-9_.-]+", path.stem):
        raise ParameterError(f"{output}: LaTeX wants a plain name; use letters, digits, -, _ and .")
    progress = listener(progress)
    progress("independent check")
    try:
        saved = _read(certificate, memory)
    except RejectedCertificate as error:
        if suffix == ".tex":
            raise
        write_atomically(path, rejected_html(error, day=day))
        return "rejected"
    if suffix == ".tex" and saved.source is None:
        raise ParameterError("nothing is certified of this family, so that there is no statement; a page tells why")
    progress("simulation")
    saved, runs, why = _with_runs(saved, simulation)
    progress("report")
    if suffix == ".tex":
        _write_statement(path, draw(saved, ("graph", "decay"), runs), lambda names: report_latex(saved, names))
    else:
        write_atomically(path, report_html(saved, runs=runs, no_run=why, day=day))
    asked = saved.assessment.asked
    return asked if saved.verdict == CERTIFIED and asked in (OPEN, REFUTED) else saved.verdict


def _read(certificate: Any, memory: float) -> Certificate:
    """Read a certificate back; that of a family of which nothing is certified has no file, and stays what it is."""
    if isinstance(certificate, Certificate) and certificate.of_family and certificate.verdict != "certified":
        return certificate
    return read_certificate(certificate, memory=memory)


def _write_statement(path: Path, drawn: Mapping[str, Any], latex: Callable[[dict[str, str]], str]) -> None:
    """Write a statement, given the names of its figures, and these beside it."""
    files = {name: path.with_name(f"{path.stem}_{name}.pdf") for name in drawn}
    if folder := next((file for file in files.values() if file.is_dir()), None):
        raise ParameterError(f"{folder}: is a folder, where a figure of the statement would go; name another file")
    text = latex({name: file.name for name, file in files.items()})
    contents = {files[name]: figure_bytes(figure, ".pdf") for name, figure in drawn.items()}
    for file, content in contents.items():
        write_atomically(file, content)
    write_atomically(path, text)


def _with_runs(saved: Certificate, simulation: bool | None) -> tuple[Certificate, list[Trajectory], str]:
    """Repeat the run of one graph, or make runs of a family under many signals; return why there is none."""
    n, of_family = len(saved.labels), saved.of_family
    most, made = (TRACED_NODES, "made") if of_family else (REPEATED_NODES, "repeated")
    if simulation is False:
        return saved, [], "it was left out, as was asked"
    if saved.initial_state is None:
        return saved, [], "the certificate names no initial state"
    if of_family and saved.proof.late is not None:
        return saved, [], f"with {saved.proof.late.messages.asked} none is made of a family"
    if simulation is None and n > most:
        return saved, [], f"above {most} agents it is {made} only where that is asked for"
    try:
        if of_family:
            return saved, sample_runs(saved), ""
        return saved.with_simulation(samples=201 if n <= TRACED_NODES else 101), [], ""
    except (SimulationError, ParameterError) as error:
        return saved, [], f"it failed: {error}"
    except OverflowError as error:
        beyond = "a number of the initial state is beyond the range of float64"
        return saved, [], f"it failed: {error}" if of_family else beyond
