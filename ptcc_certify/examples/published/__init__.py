"""Published examples: claims in ``published.toml``, graphs as CSV files beside it.

The source of the numbers of each entry is its ``source``, besides the paper. Most papers have another protocol, often
asymptotic or in discrete time. What is compared is the behaviour, and final states where they are printed: these depend
on the graph and the initial state alone, not on the protocol.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from importlib import resources
from pathlib import Path

from ptcc_certify.errors import ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import read_graph
from ptcc_certify.graphs.io.conversion import as_family
from ptcc_certify.graphs.io.packaged import GRAPHS, graph_path
from ptcc_certify.model import NominalProtocol

__all__ = ["PUBLISHED", "Published", "select_published"]


@dataclass(frozen=True)
class Published:
    """A published example, exact numbers as texts.

    Attributes
    ----------
    name : str
    kind : str
    paper : str
        Author and title.
    source : str
        Where the numbers were seen.
    claim : str
        What is claimed, in a sentence.
    behaviour : str
        That claim as :attr:`ptcc_certify.theorems.claims.Claim.behaviour` or one of its special cases.
    graphs : tuple of str
        Several: the graph switches among them.
    rho2 : str
        Of the protocol, which has ``T=1``, ``rho1=1/10`` and ``kappa=1`` throughout.
    doi : str or None
    x0 : mapping of str to str or None
        Initial states, where some are printed.
    ends : mapping of str to str
        Final states of some nodes, as printed or as the claim has them.
    fails : str or None
        What is found instead, of an entry that not as claimed.
    """

    name: str
    kind: str
    paper: str
    source: str
    claim: str
    behaviour: str
    graphs: tuple[str, ...]
    rho2: str = "10"
    doi: str | None = None
    x0: Mapping[str, str] | None = None
    ends: Mapping[str, str] | None = None
    fails: str | None = None

    def graph(self) -> SignedDigraph | Family:
        """Return the graph, or the family of those among which it switches.

        Examples
        --------
        >>> PUBLISHED["sensors"].graph()
        SignedDigraph(5 nodes, 10 edges, 0 negative)
        >>> PUBLISHED["swarm"].graph()
        Family(8 nodes, 4 modes)
        """
        paths = [_path(graph) for graph in self.graphs]
        return read_graph(paths[0]) if len(paths) == 1 else as_family(paths)

    def protocol(self) -> NominalProtocol:
        """Return the protocol.

        Examples
        --------
        >>> PUBLISHED["sensors"].protocol()
        NominalProtocol(T=1, rho1=1/10, rho2=10, kappa=1)
        """
        return NominalProtocol(T=1, rho1="1/10", rho2=self.rho2, kappa=1)

    def misses(self, ends: Mapping[str, Fraction]) -> tuple[str, ...]:
        """Return the nodes whose final states are not the claimed ones, rounded as these are; fractions are exact.

        A node without a final state is one of them.

        Examples
        --------
        >>> entry = PUBLISHED["four_people"]
        >>> entry.ends
        {'1': '60', '2': '60', '3': '75', '4': '75'}
        >>> entry.misses({"1": Fraction("60.02"), "2": Fraction("59.4"), "3": Fraction(75), "4": Fraction(75)})
        ('2',)
        """
        return tuple(
            node
            for node, text in (self.ends or {}).items()
            if node not in ends or abs(ends[node] - Fraction(text)) > _half(text)
        )


def _half(text: str) -> Fraction:
    """Return half a unit of the last digit."""
    return Fraction(0) if "/" in text else Fraction(Decimal(1).scaleb(int(Decimal(text).as_tuple().exponent))) / 2


def _path(graph: str) -> Path:
    """Return the path of the graph of an entry."""
    return graph_path(graph) if graph in GRAPHS else Path(str(resources.files(__name__) / f"{graph}.csv"))


def _published() -> dict[str, Published]:
    """Read the table of the published examples."""
    table = tomllib.loads((resources.files(__name__) / "published.toml").read_text(encoding="utf-8"))
    return {entry["name"]: Published(**entry | {"graphs": tuple(entry["graphs"])}) for entry in table["entry"]}


PUBLISHED = _published()


def select_published(name: str) -> list[Published]:
    """Return all entries for ``published``, one for its name.

    Raises
    ------
    ParameterError
        No such entry.

    Examples
    --------
    >>> [entry.doi for entry in select_published("four_people")]
    ['10.1109/TAC.2016.2613905']
    """
    if name != "published" and name not in PUBLISHED:
        names = ", ".join(PUBLISHED)
        raise ParameterError(f'no published example "{name}"; use {names}{did_you_mean(name, PUBLISHED)}')
    return [entry for entry in PUBLISHED.values() if name in ("published", entry.name)]
