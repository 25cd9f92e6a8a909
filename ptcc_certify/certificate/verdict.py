"""The verdict of a certificate, of a graph or a family, in one line, and the exit code that agrees with it.

To ``certified`` and ``undecided`` it adds three things: whether the bound says something by the deadline with the gains
at hand, and whether they bound the input, if not which gains would (:mod:`~ptcc_certify.certificate.usefulness`); what
to try next where nothing was decided; and which expectation was met, refuted or left open
(:mod:`~ptcc_certify.certificate.judgements`).
"""

from __future__ import annotations

from ptcc_certify.certificate.assessment import (
    CERTIFIED,
    OPEN,
    Assessment,
    rejection_text,
    rejects,
    standing,
    verdict_of,
)
from ptcc_certify.certificate.evidence import Evidence
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.judgements import judge
from ptcc_certify.certificate.usefulness import Use, use_of
from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import Change, Sentence
from ptcc_certify.graphs.size_limits import EXACT_NODES

#: Steps of :func:`certify` without which there may be a rate; the time limit may end the others, which seek one.
NO_SEARCHES = ("simulation", "upper bound on the decay rate", "exact final state", "final state")
#: From so many decades between weights on, they are named as the reason that nothing was proved.
MANY_DECADES = 8
#: What to try where edges do not tell whether rest states agree.
NEXT_STEP = (
    "whether rest states agree is not decided: it takes exact rows of more than 120 agents; round the weights to few "
    "digits, or take out what is uncertain between agents that hear several leader groups"
)
#: What is told where it is decided without these rows.
DECIDED_ALONE = (
    "the behaviour is decided on edges, and not certified: a certificate holds exact rows of agents that hear several "
    "leader groups, of 120 at most; ptcc classify shows the decision"
)


def assess(certificate: Evidence, report: CheckReport | None) -> Assessment:
    """Return the graded verdict of a certificate, and of what was expected of it.

    Parameters
    ----------
    certificate : Evidence
    report : CheckReport or None
        What the independent check says of it; None if nothing was proved.

    Returns
    -------
    Assessment

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> weak, strong = (NominalProtocol(T=1, rho1=1, rho2=k, kappa=1) for k in ("0.1", 2))
    >>> print(certify(pair, weak, [3, 1], asks=Asks(simulation=False)).assessment.text)
    certified, but with these gains the bound says little by T: ||E|| <= 0.055 ||E(0)|| at 0.99 T; \
the input is not bounded; rho2=0.501 leaves 1 % and bounds the input
    >>> assessment = certify(pair, strong, [3, 1], asks=Asks(simulation=False)).assessment
    >>> assessment.useful, int(assessment.exit_code)
    (True, 0)
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    >>> asked = Expectations("bipartite consensus", min_rate=100)
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), asks=Asks(expectations=asked))
    >>> cert.assessment.asked, int(cert.assessment.exit_code)
    ('refuted', 3)
    """
    verdict = verdict_of(report)
    proof = certificate.proof
    answers = list(judge(proof))
    use = use_of(proof) if verdict == CERTIFIED else Use(None, _next_step(certificate, report))
    violated = certificate.violated and not rejects(report)
    ignored = sorted({answer.what for answer in answers if answer.status == OPEN} & {"limits", "noise"})
    ignored += ["disturbances"] if proof.delta is not None else []
    without = f" without {' and '.join(ignored)}" if ignored else ""
    told = standing(answers, report)
    return Assessment(verdict, violated, use.useful, use.remark, use.advice, told, use.caveat, without)


def _next_step(certificate: Evidence, report: CheckReport | None) -> Sentence:
    """Tell why nothing was decided, and what to try."""
    proof = certificate.proof
    if report is not None and (rejects(report) or isinstance(proof, FamilyProof)):
        return rejection_text(report)
    if isinstance(proof, FamilyProof):
        undecided = any(part.component.behaviour is None for part in proof.parts)
        return NEXT_STEP if undecided else DECIDED_ALONE
    method, notes, n = proof.method, certificate.observed.notes, proof.graph.n_nodes
    if proof.rate is None:
        if any(name not in NO_SEARCHES for name in certificate.observed.cut_off):
            share = f"no rate is proved, the search took its share of {proof.time_limit:g} s; raise "
            return share, Change("time_limit")
        if method != "best":
            return Change("method", method), " proves no rate; try ", Change("method", "best")
        if (decades := proof.graph.weight_decades) >= MANY_DECADES:
            return f"no rate is proved, weights span {decades} decades: rescale them, or leave out the smallest"
        groups = [note for note in notes if "leader group" in note and "lmi is for" not in note]
        if groups:
            most = max(len(component.nodes) for component in proof.structure.closed_components)
            return f"no rate is proved: a leader group of {most} nodes is too much; certify followers and leaders apart"
        mend = Change("method", "lmi") if n > EXACT_NODES else "rounding the weights to fewer digits"
        return "no rate is proved; try ", mend
    if "final state" in certificate.observed.cut_off:
        share = f"the final state is not proved, it took its share of {certificate.time_limit:g} s; raise "
        return share, Change("time_limit")
    return (
        "the final state is not proved, the equations are ill-conditioned: rescale weights that are far from the others"
    )
