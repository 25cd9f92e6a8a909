"""What the explorer asks ``certify``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import Protocol
from ptcc_certify.model.disturbance import Disturbance
from ptcc_certify.report.explorer.settings import Settings


@dataclass(frozen=True, eq=False)
class Question:
    """What ``certify`` is asked for some settings.

    Attributes
    ----------
    settings : Settings
    source : mapping or None
        Where the graph was read from and how (``path``, ``orientation``, ...); None of a packaged graph or an object.
    graph : SignedDigraph
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : list of N int
    sigma0 : list of N int, or None
        None for the nominal protocol.
    disturbance : Disturbance or None
    """

    settings: Settings
    source: Mapping[str, Any] | None
    graph: SignedDigraph
    protocol: Protocol
    x0: list[int]
    sigma0: list[int] | None
    disturbance: Disturbance | None

    @property
    def sliding(self) -> dict[str, Any]:
        """What is asked under the sliding-mode protocol alone."""
        return {} if self.sigma0 is None else {"sigma0": self.sigma0, "disturbance": self.disturbance}
