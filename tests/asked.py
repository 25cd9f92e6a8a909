"""``certify`` by one list of words, for tests of many cases: each word goes to the group that declares it."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify, certify_case
from ptcc_certify.certificate.family_certification import certify_family as take_steps
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.request import Question, read_initial_state, read_request, read_sliding_variable
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.asks import Asks, Case, InitialState


def certify_words(graph: Any, protocol: Any, x0: Any = None, **words: Any) -> Any:
    """Return the certificate of what is asked."""
    groups = {
        kind: {f.name: words.pop(f.name) for f in fields(kind) if f.name in words} for kind in (InitialState, Asks)
    }
    return certify(graph, protocol, InitialState(x0, **groups[InitialState]), asks=Asks(**groups[Asks]), **words)


def certify_family(family: Family, protocol: Any, x0: Any = None, *, progress: Any = None, **words: Any) -> Any:
    """Return the certificate of a family by the steps for one, even where it is one known graph."""
    steps = {name: words.pop(name) for name in ("signal", "scenario", "origins") if name in words}
    case = Case(family, protocol, InitialState(x0, words.pop("sigma0", None)), asks=Asks(**words))
    case = replace(case, signal=steps.pop("signal", "any"))
    if family.graph is None:
        return certify_case(case, progress=progress, **steps)
    structure, origins = analyse(family.modes[0].mandatory), steps.get("origins", {})
    state = None if x0 is None else read_initial_state(structure, x0, "x0")
    sigma, reaching = read_sliding_variable(structure, protocol, case.initial.sigma0)
    request = read_request(structure, case, steps.get("scenario"), origins)
    return take_steps(family, Question(family, protocol, state, sigma, request), reaching, progress or (lambda _: None))


def family_certificate(family: Family, protocol: Any, parts: Any, *more: Any) -> Certificate:
    """Return the certificate of a family with proofs of one's own; more are x(0), sigma(0) and reaching times."""
    x0, sigma0, reaching = (*more, None, None, None)[:3]
    return Certificate(FamilyProof(question=Question(family, protocol, x0, sigma0), reaching=reaching, parts=parts))
