"""Late messages and moving leaders that were asked for, in files where nothing is proved of them.

Such a file has no key for them, for a certificate states what is proved. What was asked stands with the other requests
under ``unverified``, so that whoever reads the file is told that it was, and is left open.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ptcc_certify.bounds.late_messages import LateBounds
from ptcc_certify.certificate.certificate_data import Content
from ptcc_certify.certificate.format_leaders import asked_leaders, read_leaders
from ptcc_certify.certificate.format_messages import delays, read_messages
from ptcc_certify.certificate.format_vectors import Writer, readable
from ptcc_certify.certificate.request import Request
from ptcc_certify.certificate.write_sections import write
from ptcc_certify.checker.late_messages import Delays
from ptcc_certify.checker.leaders import LeadersAsked
from ptcc_certify.checker.sections import Context, read
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.gain_limits import GainLimits


def write_unproved(content: Content) -> dict[str, Any]:
    """Return the late messages or moving leaders that were asked for where nothing is proved of them."""
    messages, leaders, late = content.request.messages, content.request.leaders, content.late
    if (late is not None and late.says_something) or content.tracking is not None:
        return {}
    asked: dict[str, Any] = {}
    if messages is not None:
        asked["messages"] = write(Delays, delays(messages, content.graph), Writer(content.graph.labels))
        del asked["messages"]["leaders"]
    return asked if leaders is None else {**asked, "leaders": write(LeadersAsked, asked_leaders(leaders), Writer(()))}


def read_unproved(document: Mapping[str, Any], structure: Structure) -> dict[str, Any]:
    """Read what :func:`write_unproved` wrote, unless something of the kind is proved."""
    asked, graph = document["unverified"].get("asked"), structure.graph
    at = Context(SideFiles(Path(), {}), graph.labels, edges=graph.n_edges)
    if not isinstance(asked, dict) or "messages" in document or "leaders" in document:
        return {}
    return {
        "messages": readable(
            lambda: read_messages(read(Delays, asked["messages"] | {"leaders": None}, at, "messages"), structure)
        ),
        "leaders": readable(lambda: read_leaders(read(LeadersAsked, asked["leaders"], at, "leaders"))),
    }


def nothing_proved(request: Request, structure: Structure, protocol: Protocol, relative: bool) -> LateBounds | None:
    """Return that nothing is proved of late messages that were asked for; None if none were.

    Parameters
    ----------
    request : Request
    structure : Structure
    protocol : Protocol
    relative : bool
        Whether no initial state was given.
    """
    messages = request.messages
    if messages is None:
        return None
    gain = GainLimits(gain_cap=messages.gain_cap).limit(protocol.gain)
    return LateBounds(messages, structure, gain, relative, leaders=request.leaders)
