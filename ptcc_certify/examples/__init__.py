"""The paper's examples: parameters in ``examples.toml``, graphs as CSV files beside it.

The paper prints its topologies as pictures only; the packaged graphs are stand-ins of the stated class.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from ptcc_certify.errors import ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import read_graph
from ptcc_certify.graphs.io.packaged import PAPER as GRAPHS
from ptcc_certify.graphs.io.packaged import graph_path
from ptcc_certify.model import NominalProtocol, Protocol, SlidingModeProtocol

__all__ = ["EXAMPLES", "GRAPHS", "Example", "graph_path", "load_graph", "select"]


@dataclass(frozen=True)
class Example:
    """One example of Section 4, exact numbers as texts.

    Attributes
    ----------
    number : int
    graphs : tuple of str
        Panels (a) and (b) of its figure.
    parameters : mapping of str to str
        Of the protocol: with ``T`` the nominal one, with ``T_r`` and ``T_s`` the sliding-mode one.
    x0 : str
        In node order.
    behaviours : tuple of str
        What the paper reports for each graph.
    figures : mapping of str to int
        What is drawn of it, and the numbers of the paper's figures.
    sigma0, disturbance : str or None
        Of the sliding-mode protocol.
    """

    number: int
    graphs: tuple[str, str]
    parameters: Mapping[str, str]
    x0: str
    behaviours: tuple[str, str]
    figures: Mapping[str, int]
    sigma0: str | None = None
    disturbance: str | None = None

    def protocol(self) -> Protocol:
        """Return the protocol of the example.

        Examples
        --------
        >>> EXAMPLES[1].protocol()
        NominalProtocol(T=3/5, rho1=1/10, rho2=3/10, kappa=1)
        """
        return NominalProtocol(**self.parameters) if "T" in self.parameters else SlidingModeProtocol(**self.parameters)


def _examples() -> dict[int, Example]:
    """Read the table of the examples."""
    table = tomllib.loads((resources.files(__name__) / "examples.toml").read_text(encoding="utf-8"))
    pairs = ("graphs", "behaviours")
    entries = [entry | {name: tuple(entry[name]) for name in pairs} for entry in table["example"]]
    return {entry["number"]: Example(**entry) for entry in entries}


EXAMPLES = _examples()


def load_graph(name: str) -> SignedDigraph:
    """Read a packaged graph.

    Examples
    --------
    >>> load_graph("fig1a")
    SignedDigraph(6 nodes, 12 edges, 4 negative)
    """
    return read_graph(graph_path(name))


def select(name: str) -> list[tuple[Example, str, str]]:
    """Return ``(example, graph name, reported behaviour)`` for ``all``, an example's number or a graph's name.

    Raises
    ------
    ParameterError
        No such example.

    Examples
    --------
    >>> [(example.number, graph) for example, graph, _ in select("2")]
    [(2, 'fig3a'), (2, 'fig3b')]
    """
    runs = [
        (example, graph, behaviour)
        for example in EXAMPLES.values()
        for graph, behaviour in zip(example.graphs, example.behaviours, strict=True)
    ]
    selection = [run for run in runs if name in ("all", str(run[0].number), run[1])]
    if not selection:
        numbers = ", ".join(map(str, EXAMPLES))
        raise ParameterError(
            f'no example "{name}"; use all, published, {numbers} or {", ".join(GRAPHS)}{did_you_mean(name, GRAPHS)}'
        )
    return selection
