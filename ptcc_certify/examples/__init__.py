"""The paper's examples: parameters in code, graphs as package data.

The paper prints its topologies as pictures only; the packaged graphs are stand-ins of the stated class.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from ptcc_certify.errors import ParameterError
from ptcc_certify.graph import SignedDigraph

GRAPHS = ("fig1a", "fig1b", "fig3a", "fig3b", "fig5a", "fig5b")


@dataclass(frozen=True)
class Example:
    """One example of Section 4 with the nominal protocol, exact numbers as texts.

    Attributes
    ----------
    number : int
    graphs : tuple of str
        Panels (a) and (b) of its figure.
    T, rho1, rho2, kappa : str
    x0 : str
        In node order.
    behaviours : tuple of str
        What the paper reports for each graph.
    """

    number: int
    graphs: tuple[str, str]
    T: str
    rho1: str
    rho2: str
    kappa: str
    x0: str
    behaviours: tuple[str, str]


EXAMPLES: dict[int, Example] = {
    1: Example(
        1,
        ("fig1a", "fig1b"),
        T="0.6",
        rho1="0.1",
        rho2="0.3",
        kappa="1",
        x0="5,2,-4,3,-2,1",
        behaviours=("stability", "bipartite consensus"),
    ),
    2: Example(
        2,
        ("fig3a", "fig3b"),
        T="0.6",
        rho1="0.2",
        rho2="0.5",
        kappa="1",
        x0="-4,3,-1,2,-2,5",
        behaviours=("interval bipartite consensus", "stability"),
    ),
    3: Example(
        3,
        ("fig5a", "fig5b"),
        T="0.2",
        rho1="0.1",
        rho2="0.3",
        kappa="1",
        x0="-6,4,5,-7,8,-5,-3,7,-5,6,4,2,-5,3,-8,1",
        behaviours=("bipartite containment", "stability"),
    ),
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
    from ptcc_certify.io import read_graph

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
