"""The independent check of a certificate: from its JSON alone, in exact arithmetic, without a solver.

Reads schema ``ptcc-certificate/3``, recomputes the structure of the graph from its edges, and checks every claim
outside ``unverified``, obligation by obligation as the proof lists them; ``_verdict`` is the list. ``FORMAT.md``
specifies the file. Imports the standard library and the kernel :mod:`lmi.exact`, nothing that makes certificates;
``TRUSTED`` lists all files that must be right. python-flint and NumPy are used where they are installed.

What makes certificates asks the same kernel, and takes the bounds of the input from ``input_formulas``; graph,
structure, final state, Lyapunov functions and upper bounds on rates are verified by code of the checker's own.

    python -m ptcc_certify.checker certificate.json [--stdlib] [--memory GB]
"""

from __future__ import annotations

import io
import json
import math
import re
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lmi.exact import arithmetic
from lmi.exact.decimal_rounding import counted, down, up
from lmi.exact.numbers import shorten
from lmi.exact.work import Account, WorkError, limited
from ptcc_certify.checker.agents import check_agents
from ptcc_certify.checker.attracting_boxes import check_boxes
from ptcc_certify.checker.constrained_switching import check_restricted
from ptcc_certify.checker.contents import BRINGS, FamilyCertificate, GraphCertificate
from ptcc_certify.checker.document import Document, Recorder
from ptcc_certify.checker.family import check_family
from ptcc_certify.checker.final_state import check_final_state, check_formation
from ptcc_certify.checker.graph import check_graph
from ptcc_certify.checker.input import INPUT_NODES, Verified, check_input
from ptcc_certify.checker.lyapunov import check_functions, check_rate_bound, check_rates
from ptcc_certify.checker.messages import check_messages
from ptcc_certify.checker.obligations import OBLIGATIONS, CheckReport, ProofObligation, VerifiedObligation
from ptcc_certify.checker.protocol import (
    REACHING_BITS,
    SLIDING_BOUND,
    SLIDING_CLOCK,
    Protocol,
    check_begin,
    check_protocol,
    check_sliding,
)
from ptcc_certify.checker.reading import SCHEMA, RejectedError, UnreadableError, digest, exact, need, read
from ptcc_certify.checker.row_functions import check_family_functions
from ptcc_certify.checker.section_declarations import declared
from ptcc_certify.checker.side_files import SideFiles, beside
from ptcc_certify.checker.signal_bounds import check_drive, check_family_bounds
from ptcc_certify.checker.structure import MANY_COMPONENTS, StructureSection, check_claim, check_structure, reference
from ptcc_certify.checker.theorem_function import check_paper

USAGE = "usage: python -m ptcc_certify.checker CERTIFICATE|- [--stdlib] [--memory GB]"
GRAPH = "a graph file is not read: compare the SHA-256 that is printed, or use ptcc check CERTIFICATE GRAPH"

#: Final states that are told of an accepted certificate.
STATED = 4
#: What values of another type, or too deep, raise where they are used.
MALFORMED = (ArithmeticError, LookupError, TypeError, ValueError, AttributeError, RecursionError, MemoryError)

__all__ = [
    "INPUT_NODES",
    "MANY_COMPONENTS",
    "OBLIGATIONS",
    "REACHING_BITS",
    "SCHEMA",
    "SLIDING_BOUND",
    "SLIDING_CLOCK",
    "CheckReport",
    "ProofObligation",
    "UnreadableError",
    "VerifiedObligation",
    "check",
    "digest",
    "read",
    "record",
]


def check(source: str | Path | Mapping[str, Any], **options: Any) -> CheckReport:
    """Check a certificate; source and options are those of :func:`read_and_check`.

    Raises
    ------
    UnreadableError
        The file cannot be read as a certificate; one line.

    Examples
    --------
    >>> check({"schema": SCHEMA}).reason
    'the key "producer" is missing'
    """
    return read_and_check(source, **options)[1]


def read_and_check(
    source: str | Path | Mapping[str, Any],
    *,
    stdlib: bool = False,
    files: Mapping[str, bytes] | None = None,
    memory: float = 1,
) -> tuple[dict[str, Any], CheckReport]:
    """Check a certificate; return its JSON object beside the report.

    Parameters
    ----------
    source : str, Path or mapping
        A path, ``-`` for standard input, or the parsed JSON object; side files are in the folder of the path.
    stdlib : bool
        Use the standard library alone, even where python-flint and NumPy are installed.
    files : mapping of str to bytes, optional
        The side files by name, in place of those in the folder of the certificate.
    memory : float
        GB that the check may take; what would take more is rejected before it is formed. The work that is allowed, some
        seconds for each GB, grows with it.

    Raises
    ------
    UnreadableError
        The file cannot be read as a certificate; one line.

    Examples
    --------
    >>> read_and_check({"schema": SCHEMA})[0]
    {'schema': 'ptcc-certificate/3'}
    """
    with limited(memory) as account:
        data, folder = (dict(source), Path()) if isinstance(source, Mapping) else (read(source), Path(source).parent)
        return data, _report(Document(data, SideFiles(folder, files), arithmetic(stdlib)), account)


def record(
    sections: Mapping[str, Any],
    given: Mapping[tuple[str, str], Mapping[str, Any]],
    *,
    files: Mapping[str, bytes] | None = None,
    memory: float = 1,
) -> tuple[dict[str, Any], CheckReport]:
    """Lay down the proof, the verdict and the digest of a certificate while it is checked.

    Parameters
    ----------
    sections : mapping
        The JSON object; what stands under ``proof``, ``verdict`` and ``digest`` is put there anew.
    given : mapping of (str, str) to mapping
        By kind and place, in any order, the obligations that have ``numbers`` or a ``witness``.
    files, memory
        As in :func:`read_and_check`.

    Returns
    -------
    dict, CheckReport
        The certificate, and the report of its check. If it is rejected, the proof ends at what was rejected.

    Examples
    --------
    >>> record({"schema": SCHEMA}, {})[1].reason
    'the key "producer" is missing'
    """
    data = dict(sections)
    with limited(memory) as account:
        return data, _report(Recorder(data, SideFiles(Path(), files), arithmetic(False), given), account)


def _report(doc: Document, account: Account) -> CheckReport:
    """Verify a whole certificate; return what came of it."""
    verdict, reason = "", None
    try:
        verdict = _verdict(doc)
    except (RejectedError, WorkError) as error:
        reason = str(error)
    except MALFORMED as error:
        reason = f"malformed ({type(error).__name__})"
    at = None if reason is None else doc.at
    obligations = tuple(doc.obligations)
    needed = float(account.needed)
    results = (reason is None, verdict, obligations, at, reason, doc.exact.name, doc.sha256, needed)
    return CheckReport(*results, doc.sections, doc.proved)


def _verdict(doc: Document) -> str:
    """Verify a whole certificate, part after part, each from those before; return its verdict.

    Raises
    ------
    RejectedError
        Something does not follow; ``doc.at`` tells where.
    """
    problem = doc.data.get("problem")
    of_family = isinstance(problem, dict) and "signal" in problem
    own, other = (FamilyCertificate, GraphCertificate) if of_family else (GraphCertificate, FamilyCertificate)
    known, foreign = ({f.key for f in declared(kind)} for kind in (own, other))
    for key in doc.data:
        need(key in known or key not in foreign, f"{key} has no place for {'a family' if of_family else 'one graph'}")
    doc.begin(own, BRINGS)
    for key in ("schema", "producer", "unverified", "proof"):
        doc.section(key)
    protocol = check_protocol(doc)
    if of_family:
        return _family_verdict(doc, protocol)
    graph = check_graph(doc)
    sections: Sequence[StructureSection] = doc.section("structure")
    need(len(sections) == 1, "structure has not one entry")
    structure = check_structure(doc, graph, sections[0], "graph.modes[0]")
    claim = check_claim(doc, structure, protocol.sliding)
    begin = check_begin(doc, protocol)
    final = check_final_state(doc, structure, claim, begin)
    check_formation(doc, begin)
    paper = check_paper(doc, structure, claim)
    functions = check_functions(doc, structure, final, paper)
    rate = check_rates(doc, paper, functions)
    bound = check_rate_bound(doc, structure)
    check_sliding(doc, graph, protocol, begin)
    verified = Verified(structure, protocol, begin, final, functions, rate, bound)
    if "agents" in doc:
        need("messages" not in doc, "agents of order n with late messages or moving leaders")
        return doc.close(check_agents(doc, verified))
    for key in ("phases", "instants"):
        doc.refuse(key, f"{key} of agents that are not of order n")
    check_input(doc, verified)
    check_messages(doc, verified, protocol, begin)
    return doc.close("influence" in doc and (rate is not None or not graph.listening))


def _family_verdict(doc: Document, protocol: Protocol) -> str:
    """Verify a certificate of a family, part after part; return its verdict."""
    doc.section("signal")
    family = check_family(doc)
    begin = check_begin(doc, protocol)
    check_formation(doc, begin, of_family=True)
    functions = check_family_functions(doc, family)
    drive = check_drive(doc, family, functions, protocol, begin)
    check_family_bounds(doc, family, functions, protocol, begin, drive)
    check_boxes(doc, family, begin)
    check_restricted(doc, family, functions, protocol, begin)
    check_messages(doc, family, protocol, begin, functions)
    return doc.close(True)


def stated(data: Mapping[str, Any]) -> list[str]:
    """Tell in four lines at most what an accepted certificate is about: protocol, claim, the first final states.

    Examples
    --------
    >>> cert = certify([("a", "b", -1)], NominalProtocol(T=2, rho1=1), [3, 1], asks=Asks(simulation=False))
    >>> print(*stated(cert.to_dict()), sep=chr(10))
    protocol   nominal: T=2, rho1=1, rho2=1, kappa=2; 2 nodes
    claim      interval bipartite consensus (Theorem 2.1, Corollary 3)
    x(T)       a at 3, b at -3
    """
    problem = data["problem"]
    nodes, gain = problem["graph"]["nodes"], dict(problem["gain"])
    gain.pop("disturbance", None)
    texts = ((key, _number(value)) for key, value in gain.items() if key != "kind")
    numbers = ", ".join(f"{key}={text[3:]}" if text.startswith("at ") else f"{key} {text}" for key, text in texts)
    signal = f", signal {problem['signal']}" if "signal" in problem else ""
    lines = [f"protocol   {gain['kind']}: {numbers}; {counted(len(nodes), 'node')}{signal}"]
    if "claim" in data:
        claim = data["claim"]
        cited = reference(claim["theorem"], claim.get("corollaries", ()))
        lines.append(f"claim      {claim['behaviour']} ({cited})")
    elif isinstance(parts := data.get("components"), list):
        told = dict.fromkeys(part["claim"]["behaviour"] for part in parts)
        lines.append(f"claim      {', '.join(told)}, component by component ({len(parts)})")
    ends = {} if beside(data.get("final_state")) else data.get("final_state", {})
    known = [f"{_quoted(node)} {_number(ends[node])}" for node in nodes[:STATED] if ends.get(node)]
    if known:
        lines.append(f"x(T)       {', '.join(known)}{', ..' if len(nodes) > STATED else ''}")
    without = [key for key in ("agents", "messages", "formation", "restricted") if key in data]
    without += ["input.residual"] if data.get("input", {}).get("residual") else []
    return [*lines, f"beside     {', '.join(without)}: claim and x(T) are without these"] if without else lines


def _quoted(label: str) -> str:
    """Return a label, in quotes where a reader could take it for more than that, and cut before its end."""
    cut = label if len(label) <= 40 else f"{label[:18]}...{label[-18:]}"
    return cut if re.fullmatch(r"[\w.+-]+", cut) else json.dumps(shorten(cut, 60), ensure_ascii=False)


def _number(number: str | Mapping[str, str]) -> str:
    """Tell a number as it is stated if that is short, else, and an interval always, rounded outwards."""
    if isinstance(number, str) and len(number) <= 12:
        return f"at {number}"
    mid, radius = (exact(number), 0) if isinstance(number, str) else (exact(number["mid"]), exact(number["radius"]))
    return f"in [{down(mid - radius)}, {up(mid + radius)}]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the certificate that the command line names; 0 proved, 1 rejected, 2 unreadable, 4 undecided."""
    for stream in (sys.stdout, sys.stderr):  # labels may hold what the terminal cannot show
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    words = list(sys.argv[1:] if arguments is None else arguments)
    stdlib, memory = "--stdlib" in words, 1.0
    if "--memory" in words[:-1]:
        place = words.index("--memory")
        try:
            memory = float(words[place + 1])
        except ValueError:
            memory = 0
        del words[place : place + 2]
    paths = [word for word in words if word != "--stdlib"]
    if paths in (["-h"], ["--help"]):
        print(USAGE, GRAPH, sep="\n")
        return 0
    if len(paths) != 1 or (paths[0].startswith("-") and paths[0] != "-") or not paths[0] or not 0 < memory < math.inf:
        print(USAGE, file=sys.stderr)
        return 2
    try:
        data, report = read_and_check(paths[0], stdlib=stdlib, memory=memory)
    except UnreadableError as error:
        print(f"checker: {error}", file=sys.stderr)
        return 2
    *lines, last = report.lines()
    if report.sha256:
        lines.insert(0, f"graph      SHA-256 {report.sha256}; compare it with that of the graph you mean")
    for line in [*lines, *(stated(data) if report.accepted else ())]:
        print(textwrap.fill(line, 80, subsequent_indent=" " * 11, break_on_hyphens=False, break_long_words=False))
    print(last)  # a refusal is one line
    return 1 if not report.accepted else 0 if report.verdict == "certified" else 4
