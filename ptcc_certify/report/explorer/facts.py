"""What the explorer tells of a certificate: the same few rows for all settings, so that each has its place."""

from __future__ import annotations

from itertools import islice

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import Change
from ptcc_certify.report.facts.claim import claim_facts
from ptcc_certify.report.facts.decay import error_facts, instants_facts, rate_facts
from ptcc_certify.report.facts.input import input_facts, threshold_facts
from ptcc_certify.report.facts.of_certificate import run_facts, sliding_facts
from ptcc_certify.report.facts.states import final_facts

#: The rows, and what stands in those for which a certificate has nothing to tell.
HEADS = ("claim", "x(T)", "error", "rate", "input", "sliding", "simulated")
NOTHING = "-"
#: The verdict before the independent check.
UNCHECKED = "not checked yet"


def rows_of(certificate: Certificate, compared: bool) -> dict[str, str]:
    """Return what a certificate claims by :data:`HEADS`, of facts that cost little; of the run if it is ``compared``.

    Parameters
    ----------
    certificate : Certificate
        With an initial state.
    compared : bool

    Returns
    -------
    dict of str to str
    """
    decays = certificate.proof.rate is not None and not certificate.proof.constant
    inputs = list(input_facts(certificate, details=False))
    loud = any(fact.loud for fact in inputs)
    sliding = sliding_facts(
        certificate.labels, certificate.protocol.reaching, certificate.sigma0, certificate.proof.reaching
    )
    facts = {
        "claim": claim_facts(certificate),
        "x(T)": islice(final_facts(certificate), 1),
        "error": islice(instants_facts(certificate), 1) if decays else error_facts(certificate, False, False),
        "rate": islice(rate_facts(certificate), 1),
        "input": [*inputs, *(threshold_facts(certificate) if loud else ())],
        "sliding": list(sliding)[-1:],
        "simulated": islice(run_facts(certificate), 2) if compared else (),
    }
    return {head: "; ".join(fact.text for fact in facts[head]) or NOTHING for head in HEADS}


def of_controls(change: Change) -> str:
    """Name a change of the controls.

    Examples
    --------
    >>> of_controls(Change("rho2", "1.38")), of_controls(Change("method", "best"))
    ('rho2 = 1.38', 'bounds = best')
    """
    name = "bounds" if change.field == "method" else change.field
    return f"{name} = {change.number}" if change.number else name
