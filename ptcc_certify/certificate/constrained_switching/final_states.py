"""Ends between which agents are at the deadline under restricted signals, beside those for every signal.

In a formation these are of positions, places added.

References
----------
docs/theory/families.md, "Restricted signals".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ptcc_certify.certificate.family_proof import FamilyProof
    from ptcc_certify.checker.reading import Interval


def last_states(proof: FamilyProof) -> list[Interval | None]:
    """Return the ends between which agents stay whose last mode decides; None of the others."""
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, claim in proof.ends_of_signal.items():
        nodes = proof.parts[number].component.nodes.tolist()
        for v, ends in zip(nodes, claim.final_states or (), strict=False):
            result[v] = ends
    pairs = zip(constant_states(proof), proof.in_places(result), strict=True)
    return [other if ends is None else ends for ends, other in pairs]


def constant_states(proof: FamilyProof) -> list[Interval | None]:
    """Return the ends between which agents end if mode and weights never change; None where these are not claimed.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [0, 6], signal="constant")
    >>> [str(x) for x in constant_states(cert)[0]]
    ['2', '3']
    """
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, claim in proof.final_values.items():
        nodes = proof.parts[number].component.nodes.tolist()
        for v, ends in zip(nodes, claim.final_states or (), strict=False):
            result[v] = ends
    return proof.in_places(result)


def states_of_signal(proof: FamilyProof) -> list[Interval | None]:
    """Return the final states for every signal, and where there are none, those for the signals that were asked for."""
    pairs = zip(proof.final_positions or (), last_states(proof), strict=False)
    return [other if ends is None else ends for ends, other in pairs]


def ends_for_signal(proof: FamilyProof) -> list[Interval | None]:
    """Return the nearest ends that are proved for the signals that were asked for; None of agents that have none.

    All are None where all signals were asked for, which :attr:`FamilyProof.final_state` tells of.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [0, 6], signal="constant")
    >>> [str(x) for x in ends_for_signal(cert)[0]]
    ['2', '3']
    """
    unknown: list[Interval | None] = [None] * proof.family.n_nodes
    if proof.signal == "any":
        return unknown
    pairs = zip(last_states(proof), proof.final_positions or unknown, strict=True)
    return [every if ends is None else ends for ends, every in pairs]
