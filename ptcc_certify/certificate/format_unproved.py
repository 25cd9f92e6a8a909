"""Late messages and moving leaders that were asked for, in files where nothing is proved of them.

Such a file has no key for them, for a certificate states what is proved. What was asked stands with the other requests
under ``unverified``, so that whoever reads the file is told that it was, and is left open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ptcc_certify.bounds.late_messages import LateBounds
from ptcc_certify.certificate.certificate_data import Content
from ptcc_certify.certificate.format_leaders import asked_leaders, read_leaders
from ptcc_certify.certificate.format_messages import asked_messages, read_messages
from ptcc_certify.certificate.format_vectors import Reader, Writer, readable
from ptcc_certify.certificate.request import Request
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
        asked["messages"] = asked_messages(messages, content.graph, Writer(content.graph.labels))
    return asked if leaders is None else {**asked, "leaders": asked_leaders(leaders)}


def read_unproved(document: Mapping[str, Any], structure: Structure) -> dict[str, Any]:
    """Read what :func:`write_unproved` wrote, unless something of the kind is proved."""
    asked, data = document["unverified"].get("asked"), Reader(structure.graph.labels, {})
    if not isinstance(asked, dict) or "messages" in document or "leaders" in document:
        return {}
    return {
        "messages": readable(lambda: read_messages(asked["messages"], structure, data)),
        "leaders": readable(lambda: read_leaders(asked["leaders"])),
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
