"""The independent check as this package calls it: a file that cannot be read is a :class:`FormatError`, as elsewhere.

:mod:`ptcc_certify.checker` imports nothing of this package, hence has an exception of its own.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from typing import Any

from ptcc_certify import checker
from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import number_within, shorten
from ptcc_certify.graphs.recognised_files import refuse_as_certificate
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure

#: GB that the check of a large graph may take while it is certified.
LARGE_MEMORY = 16


def check(
    source: Any,
    *,
    stdlib: bool = False,
    files: Mapping[str, bytes] | None = None,
    memory: float = 1,
) -> CheckReport:
    """Check a certificate: from its JSON alone, in exact arithmetic, without a solver.

    Parameters
    ----------
    source : str, Path, mapping or Certificate
        A path (``"-"``: standard input), the parsed JSON object, or a certificate as it would be written.
    stdlib : bool
        Use the standard library alone, even where python-flint and NumPy are installed.
    files : mapping of str to bytes, optional
        The side files by name, in place of those in the folder of the certificate.
    memory : float
        GB that the check may take; what would take more is rejected before it is formed. The work that is allowed, some
        seconds for each GB, grows with it.

    Returns
    -------
    CheckReport

    Raises
    ------
    FormatError
        The file cannot be read as a certificate, or one of its side files is missing; one line.

    Examples
    --------
    >>> check({"schema": "ptcc-certificate/3"}).reason
    'the key "producer" is missing'
    """
    return read_and_check(source, stdlib=stdlib, files=files, memory=memory)[1]


def read_and_check(source: Any, **options: Any) -> tuple[dict[str, Any], CheckReport]:
    """Return the parsed JSON object beside the report of :func:`check`, whose options these are.

    Raises
    ------
    FormatError
        The file cannot be read as a certificate; one line.

    Examples
    --------
    >>> read_and_check({"schema": "ptcc-certificate/3"})[0]
    {'schema': 'ptcc-certificate/3'}
    """
    options["memory"] = number_within(options.get("memory", 1), "memory in GB", 1e-9, 1e8)
    if hasattr(source, "for_check"):
        source, options["files"] = source.for_check()
    refuse_no_certificate(source)
    try:
        document, report = checker.read_and_check(source, **options)
    except checker.UnreadableError as error:
        cause = error.__context__
        if not isinstance(source, Mapping) and isinstance(cause, OSError | json.JSONDecodeError | UnicodeDecodeError):
            refuse_as_certificate(os.fspath(source), content=_content_of(cause))
        raise FormatError(str(error)) from None
    if not isinstance(source, Mapping) and re.fullmatch(r"side file \S+ cannot be read", report.reason or ""):
        mend = "ask the sender for all files beside it"
        raise FormatError(f"{shorten(os.fspath(source), 200)}: incomplete: {report.reason}; {mend}")
    return document, report


def record(
    sections: Mapping[str, Any],
    given: Mapping[tuple[str, str], Mapping[str, Any]],
    files: Mapping[str, bytes],
    n_nodes: int,
) -> tuple[dict[str, Any], CheckReport]:
    """Lay down the proof of a certificate while it is checked; see :func:`ptcc_certify.checker.record`."""
    memory = 1 if n_nodes <= EXACT_NODES else LARGE_MEMORY
    document, report = checker.record(sections, given, files=files, memory=memory)
    return document, report


def refuse_no_certificate(source: Any) -> None:
    """Refuse what is neither a certificate nor a path nor a JSON object.

    Examples
    --------
    >>> refuse_no_certificate(as_graph("fig1a"))
    Traceback (most recent call last):
    ptcc_certify.errors.FormatError: SignedDigraph(6 nodes, 12 edges, 4 negat... is a graph, no certificate; give ...
    """
    if isinstance(source, SignedDigraph | Structure | Family) or hasattr(source, "is_multigraph"):
        mend = "give certify(graph, protocol, x0)"
        raise FormatError(f"{shorten(repr(source))} is a graph, no certificate; {mend}")
    if not isinstance(source, str | os.PathLike | Mapping) and not hasattr(source, "for_check"):
        raise FormatError(f"{shorten(repr(source))} is no certificate; give its path, its JSON object or a Certificate")


def _content_of(cause: OSError | json.JSONDecodeError | UnicodeDecodeError) -> bytes | None:
    """Return what the check met instead of JSON, as the error tells; None where nothing was read."""
    if isinstance(cause, json.JSONDecodeError):
        return cause.doc.encode("utf-8", "replace")
    return cause.object if isinstance(cause, UnicodeDecodeError) else None
