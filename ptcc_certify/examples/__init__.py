"""The paper's examples: parameters in code, graphs as package data.

The paper prints its topologies as pictures only; the packaged graphs are stand-ins of the stated class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.protocols import NominalProtocol, Protocol, SlidingModeProtocol

GRAPHS = ("fig1a", "fig1b", "fig3a", "fig3b", "fig5a", "fig5b")


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


_FIG1 = (("fig1a", "fig1b"), ("stability", "bipartite consensus"))
_FIG3 = (("fig3a", "fig3b"), ("interval bipartite consensus", "stability"))
_FIG5 = (("fig5a", "fig5b"), ("bipartite containment", "stability"))


def _example(
    number: int, figure: tuple[tuple[str, str], tuple[str, str]], numbers: str, x0: str, **more: Any
) -> Example:
    graphs, behaviours = figure
    parameters = dict(entry.split("=") for entry in numbers.split())
    return Example(number, graphs, parameters, x0, behaviours, **more)


EXAMPLES: dict[int, Example] = {
    example.number: example
    for example in (
        _example(1, _FIG1, "T=0.6 rho1=0.1 rho2=0.3 kappa=1", "5,2,-4,3,-2,1", figures={"graphs": 1, "states": 2}),
        _example(2, _FIG3, "T=0.6 rho1=0.2 rho2=0.5 kappa=1", "-4,3,-1,2,-2,5", figures={"graphs": 3, "states": 4}),
        _example(
            3,
            _FIG5,
            "T=0.2 rho1=0.1 rho2=0.3 kappa=1",
            "-6,4,5,-7,8,-5,-3,7,-5,6,4,2,-5,3,-8,1",
            figures={"graphs": 5, "states": 6},
        ),
        _example(
            4,
            _FIG1,
            "T_r=0.5 T_s=1 rho1=0.1 rho2=0.3 kappa=2 mu1=1.2 mu2=0.6 mu3=0.9 delta=1",
            "-4,3,-1,2,-2,5",
            sigma0="-9,1,-5,8,-4,6",
            disturbance="sin(2*k*t + pi/3)",
            figures={"sliding_variables": 7, "states": 8},
        ),
        _example(
            5,
            _FIG3,
            "T_r=1 T_s=0.5 rho1=0.25 rho2=0.3 kappa=3 mu1=2 mu2=0.4 mu3=0.5 delta=1",
            "-4,4,5,-7,8,1",
            sigma0="-10,10,9,-5,5,4",
            disturbance="sin(2*k*t + pi/2)",
            figures={"sliding_variables": 9, "states": 10},
        ),
        _example(
            6,
            _FIG5,
            "T_r=0.4 T_s=0.6 rho1=0.2 rho2=0.1 kappa=3 mu1=2 mu2=0.1 mu3=0.5 delta=1",
            "2.6,-1.2,-1.2,-1,-0.2,0.9,-2.9,2,0.3,2.1,-1,-0.3,-2.7,-2,1,-1",
            sigma0="2.9,-3,0.5,0,0.75,-0.8,-1.5,3.8,2.3,3.6,0.2,-0.27,-4,-2.3,-0.5,-2.9",
            disturbance="cos(k*t - pi/3)",
            figures={"sliding_variables": 11, "states": 12},
        ),
    )
}


def graph_path(name: str) -> Path:
    """Return the path of a packaged graph.

    Raises
    ------
    ParameterError
        No such graph; the message lists them.
    """
    if name not in GRAPHS:
        raise ParameterError(f'no packaged graph "{name}"; there are ' + ", ".join(GRAPHS))
    return Path(str(resources.files(__name__) / f"{name}.csv"))


def load_graph(name: str) -> SignedDigraph:
    """Read a packaged graph.

    Examples
    --------
    >>> load_graph("fig1a")
    SignedDigraph(6 nodes, 12 edges, 4 negative)
    """
    from ptcc_certify.graphs.io import read_graph

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
    chosen = [run for run in runs if name in ("all", str(run[0].number), run[1])]
    if not chosen:
        numbers = ", ".join(map(str, EXAMPLES))
        raise ParameterError(f'no example "{name}"; use all, {numbers} or ' + ", ".join(GRAPHS))
    return chosen
