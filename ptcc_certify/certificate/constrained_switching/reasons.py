"""Why nothing is claimed of a component under the restricted signals that were asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down
from ptcc_certify.certificate.constrained_switching.claims import ShareClaim
from ptcc_certify.checker.constrained_switching import MANY_CLAIMS
from ptcc_certify.model.constrained_switching import ClockShares, JointWindows
from ptcc_certify.theorems.contractions import joint_behaviour
from ptcc_certify.theorems.family_behaviour import DEPENDS

if TYPE_CHECKING:
    from ptcc_certify.certificate.family_proof import FamilyProof

#: What is told of rates below every number that is written.
TOO_SMALL = "a rate exists, too small to matter"


def reasons_for_none(proof: FamilyProof) -> dict[int, tuple[str, bool]]:
    """Return why components have no claim for the signals asked for, and whether that leaves open what they do.

    Examples
    --------
    >>> day, night = ([("a", "b", 1), ("b", "a", 1)], [("a", "b", 1), ("b", "a", -1)])
    >>> family = Family.switching([SignedDigraph.from_edges(edges) for edges in (day, night)])
    >>> p, windows = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), JointWindows(10**9, on=1, clock="s")
    >>> reasons_for_none(certify(family, p, signal=windows))
    {0: ('stability: a rate exists, too small to matter, and none is certified', True)}
    """
    if proof.signal == "any" or len(proof.restricted) >= MANY_CLAIMS:
        return {}
    claims = proof.restricted
    told = {one.component for one in claims if not isinstance(one, ShareClaim) or one.behaviour is not None}
    parts = {
        number: part
        for number, part in enumerate(proof.parts)
        if number not in told and part.component.nodes.size > 1 and part.component.behaviour is not None
    }
    result = {}
    for number, part in parts.items():
        if part.component.behaviour != DEPENDS:
            rate = "no rate is proved" if part.rate is None else f"rate {down(part.rate)}"
            result[number] = f"{rate}, as for every signal; nothing more is proved", False
        elif isinstance(proof.signal, JointWindows):
            behaviour = joint_behaviour(part.component)
            small = f"{behaviour}: {TOO_SMALL}, and none is certified"
            nothing = "all edges together do not bring the agents to rest, or not to known states; nothing is proved"
            result[number] = nothing if behaviour is None else small, True
        elif isinstance(proof.signal, ClockShares):
            result[number] = "no function of all modes that falls with these shares was found; nothing is proved", True
        else:
            result[number] = "switches never end, and each may undo what was reached; nothing is proved", True
    return result
