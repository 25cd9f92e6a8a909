"""What is told of a certificate: question, answers, verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import near
from ptcc_certify.certificate.assessment import rejects
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import joined
from ptcc_certify.report.facts.agents import agents_facts
from ptcc_certify.report.facts.claim import assumptions, claim_facts, family_claims
from ptcc_certify.report.facts.constrained_switching import signal_facts
from ptcc_certify.report.facts.decay import (
    error_facts,
    family_error_facts,
    family_rate_facts,
    function_facts,
    rate_facts,
)
from ptcc_certify.report.facts.graph import family_facts, graph_facts
from ptcc_certify.report.facts.input import disturbed_facts, family_input_facts, input_facts
from ptcc_certify.report.facts.late import late_facts
from ptcc_certify.report.facts.question_and_verdict import protocol_facts, run_facts, verdict_facts
from ptcc_certify.report.facts.sliding import sliding_facts
from ptcc_certify.report.facts.states import family_final_facts, final_facts, initial_facts

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate

#: How the line ends that tells what is given.
_FOLLOWS = ", in what follows"


def facts_of(
    certificate: Certificate,
    name: str | None = None,
    origins: Mapping[str, str] | None = None,
    details: bool = True,
) -> list[Fact]:
    r"""Return what is told of a certificate: question, answers, verdict. Nothing that the check rejects is told.

    Parameters
    ----------
    certificate : Certificate
    name : str, optional
        What the graph is called, unless as the certificate says.
    origins : mapping of str to str, optional
        Where ``x(0)`` and ``sigma(0)`` come from, and how a family was ``read``, unless as the certificate says.
    details : bool
        Whether facts that a short screen leaves out are sought at all: some take as long as the proof.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5], asks=Asks(simulation=False))
    >>> print(*(f"{fact.head}: {fact.text}" for fact in facts_of(cert) if fact.head in ("x(T)", "input")), sep="\n")
    x(T): a=-1, b=1 (exact)
    input: bounded; |u_k| <= 24.01, the largest of agent a
    """
    origins = certificate.origins if origins is None else origins
    if name is None:
        name = certificate.origins.get("graph", "" if certificate.of_family else "graph")
    facts: list[Fact] = []
    if certificate.of_family:
        components = [part.component for part in certificate.family_proof.parts]
        facts += family_facts(
            certificate.family_proof.family, name, origins.get("read", ""), components if details else None
        )
    else:
        facts += graph_facts(certificate.graph_proof.structure, name, details)
    facts += protocol_facts(certificate, origins)
    if not rejects(certificate.checked):
        facts += _answers(certificate, origins, details)
    return [*facts, *verdict_facts(certificate)]


def _answers(certificate: Certificate, origins: Mapping[str, str], details: bool) -> Facts:
    """Tell what becomes of the agents: first with late messages and moving leaders, if there are any."""
    labels, protocol = certificate.labels, certificate.protocol
    yield from initial_facts(certificate, origins, alone=certificate.only_drawn)
    yield from sliding_facts(labels, protocol.reaching, certificate.sigma0, certificate.proof.reaching)
    yield from late_facts(certificate)
    beside = _beside(certificate)
    if certificate.of_family:
        components = [part.component for part in certificate.family_proof.parts]
        of = "" if certificate.proof.offsets is None else " of x - offsets"
        yield from family_claims(components, f"{of} at T = {near(protocol.T)}", certificate)
    else:
        yield from claim_facts(certificate)
    yield from beside
    yield from (_of_family if certificate.of_family else _of_graph)(certificate, details, beside)


def _of_graph(certificate: Certificate, details: bool, beside: Sequence[Fact]) -> Facts:
    """Tell of one graph where its agents end, how fast, and with what input; ``beside`` what is given there."""
    drawn = certificate.only_drawn
    if certificate.proof.agents is not None:
        yield from agents_facts(certificate.proof.agents, details)
    elif not drawn:
        yield from _details(final_facts(certificate), certificate.proof.leaders_move)
    if details:
        part = certificate.proof.agents
        of = "" if part is None else "of the plain protocol: " if part.order == 1 else "of single integrators: "
        yield from (replace(fact, note=joined("", (of, fact.note))) for fact in rate_facts(certificate))
    if certificate.proof.agents is None and (details or not beside):
        yield from _details(error_facts(certificate, drawn, details), bool(beside))
        yield from _given(input_facts(certificate, details), beside)
        yield from _details(disturbed_facts(certificate), bool(beside))
    if details:
        yield from run_facts(certificate)


def _of_family(certificate: Certificate, details: bool, beside: Sequence[Fact]) -> Facts:
    """Tell the same of a family for every signal, and for those that were asked for."""
    yield from family_rate_facts(certificate)
    if details:
        yield from function_facts(certificate)
    yield from signal_facts(certificate)
    yield from _details(family_final_facts(certificate), certificate.proof.leaders_move)
    yield from _details(family_error_facts(certificate), bool(beside))
    yield from _given(family_input_facts(certificate), beside)


def _beside(certificate: Certificate) -> list[Fact]:
    """Tell what the rest of a certificate knows nothing of: nothing, or one fact."""
    if certificate.proof.late is None and not certificate.proof.leaders_move:
        return []  # facts that are without limits, noise or disturbances say so
    without = [text for text in assumptions(certificate) if not text.startswith("without limits")]
    text = f"{', '.join(without)}{_FOLLOWS}"
    return [Fact(head="given", note=text, detail=True)] if without else []


def _details(facts: Iterable[Fact], are: bool) -> Iterable[Fact]:
    """Return facts, which are details where others stand in their place."""
    return (replace(fact, detail=True) for fact in facts) if are else facts


def _given(facts: Iterable[Fact], beside: Sequence[Fact]) -> Facts:
    """Return facts of the input as details that say what is given; as they are where nothing is."""
    first = "".join(f"{fact.text.removesuffix(_FOLLOWS)}: " for fact in beside)
    for fact in _details(facts, bool(beside)):
        yield replace(fact, note=joined("", (first, fact.note)), brief=()) if first and fact.head == "input" else fact
