"""``certify`` by one list of words, for tests of many cases: each word goes to the group that declares it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ptcc_certify.certificate.procedure import certify
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.initial_state import InitialState


def certify_words(graph: Any, protocol: Any, x0: Any = None, **words: Any) -> Any:
    """Return the certificate of what is asked."""
    groups = {
        kind: {f.name: words.pop(f.name) for f in fields(kind) if f.name in words} for kind in (InitialState, Asks)
    }
    return certify(graph, protocol, InitialState(x0, **groups[InitialState]), asks=Asks(**groups[Asks]), **words)
