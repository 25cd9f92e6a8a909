"""What is told of a graph, a family or a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ptcc_certify.certificate.fact import Fact
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.report.facts.claim import family_claims, structure_claims
from ptcc_certify.report.facts.graph import family_facts, graph_facts, leader_facts

if TYPE_CHECKING:
    from ptcc_certify.gain_design.answer import AgentsDesign, Design
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.theorems.family_behaviour import FamilyComponent


def structure_facts(structure: Structure, name: str) -> list[Fact]:
    """Return what is told of a graph alone: its structure, and what follows from it."""
    claims = structure_claims(structure, [component.claim for component in structure.components])
    return [*graph_facts(structure, name), *leader_facts(structure), *claims]


def decision_facts(
    components: Sequence[FamilyComponent], family: Family, name: str, read: str = "", details: bool = True
) -> list[Fact]:
    r"""Return what is told of a family alone: what it does, decided on edges.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", -1, 0), ("b", "a", 1, 2)])
    >>> for fact in decision_facts(ptcc.decide(unsure), unsure, "pair"):
    ...     if not fact.detail:
    ...         print(f"{fact.head}: {fact.text}")
    family: pair: 2 nodes, 2 edges, 2 uncertain, 1 of them optional
    claim: depends on the signal
    why: the state a=1, b=1 rests at the least weights and moves with a -> b on
    constant: where weights never change: it depends on the weights
    groups: no limit is claimed of a, b
    """
    return [*family_facts(family, name, read, components if details else None), *family_claims(components)]


def design_facts(answer: Design | AgentsDesign, graph: SignedDigraph | None = None, name: str = "") -> list[Fact]:
    """Return what is told of a design, and of its graph: request, verdict, gains, what is proved, deadlines."""
    of_graph: Any = () if graph is None else graph_facts(analyse(graph), name)
    return [*of_graph, *answer.facts()]
