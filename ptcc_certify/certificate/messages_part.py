"""What is proved beside a decay where messages are late, or leaders move: of graphs and of families."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.bounds.delay.late_messages import LateBounds, bound_late
from ptcc_certify.bounds.delay.longest_delay import (
    longest_delay,
    longest_forgiven,
    with_forms,
    with_forms_of_family,
)
from ptcc_certify.certificate.assessment import rejects
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.final_state_sections import stated_ends
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.checker.reading import Interval
from ptcc_certify.graphs.size_limits import EXACT_NODES


def with_messages(certificate: Certificate) -> Certificate:
    """Add what is left at the deadline, where messages are late or leaders move; of one graph the longest delay, too.

    Lyapunov functions of a whole graph forgive small delays under a cap.

    Raises
    ------
    HypothesisError
        Where followers are drawn to depends on the signal, or leaders hear somebody in some mode.
    """
    proof = certificate.proof
    if (messages := proof.request.messages) is None:
        return certificate
    case = LateCase(proof.question.subject, proof.protocol, messages, proof.initial_state, _ends(proof))
    late = bound_late(case)
    if isinstance(proof, FamilyProof) and case.led_by_groups:
        late = with_forms_of_family(late, [(part.component, part.functions) for part in proof.parts])
    if not isinstance(proof, GraphProof) or late.tracks:
        return certificate.changed(late=late)
    case = replace(late.case, influence=proof.influence, forms=proof.decaying_forms)
    late = with_forms(replace(late, case=case))
    if messages.age and not late.rows:  # which bear any delay
        late = replace(late, longest_delay=longest_forgiven(case))
    certificate, asked = certificate.changed(late=late), certificate.expectations.max_residual
    if asked is not None and messages.age and proof.graph.n_nodes <= EXACT_NODES:
        certificate = certificate.changed(late=replace(late, enough=_longest_delay(certificate, late, asked)))
    return certificate


def _ends(proof: GraphProof | FamilyProof) -> Sequence[Interval] | None:
    """Return where agents end, as middles and radii that a file states; None where some end is not known."""
    if isinstance(proof, GraphProof):
        return stated_ends(proof.influence, proof.final_state, proof.initial_state)
    return proof.ends


def _longest_delay(certificate: Certificate, late: LateBounds, asked: Fraction) -> Fraction | None:
    """Return nearly the longest delay that leaves so little, if the check accepts what a certificate states of it."""
    longest = longest_delay(late, asked)
    if longest is None or longest is late:
        return None if longest is None else late.messages.age
    return None if rejects(certificate.changed(late=longest).checked) else longest.messages.age
