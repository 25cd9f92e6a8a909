"""Reads a certificate back from a file that the independent check accepts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ptcc_certify.bounds.delay.late_messages import read_late
from ptcc_certify.bounds.float_conversion import fractions
from ptcc_certify.bounds.input.effort import read_effort
from ptcc_certify.certificate.agents_part import read_agents
from ptcc_certify.certificate.constrained_switching.sections import read_claim
from ptcc_certify.certificate.evidence import Observations
from ptcc_certify.certificate.family_proof import ComponentProof, FamilyProof
from ptcc_certify.certificate.final_state_sections import read_final_state
from ptcc_certify.certificate.functions import ProvedFunction, _read_function, _read_limit, read_box, read_function
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.graph_sections import certificate_family, certificate_graph
from ptcc_certify.certificate.proof import Source
from ptcc_certify.certificate.request import Question
from ptcc_certify.certificate.section_io import Reader
from ptcc_certify.certificate.unverified_section import (
    nothing_proved,
    read_observations,
    read_request,
    read_unproved,
    read_unproved_signals,
    read_upper_bound,
    with_longest_delays,
    with_longest_period,
)
from ptcc_certify.checker.attracting_boxes import AttractingBox, KeptBox
from ptcc_certify.checker.protocol import NominalSection, ReachingTimes, SlidingSection
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.checker.theorem_function import PaperSection
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.lyapunov.slow_signals import SignalRateBound
from ptcc_certify.model import Protocol
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide
from ptcc_certify.theorems.theorem import ExactInterval, Obligation, RateProof


def read_document(source: Source) -> tuple[GraphProof | FamilyProof, Observations]:
    """Return what an accepted file proves, and what it says of searches; structures and decisions are made anew."""
    document, sections = source.document, source.report.sections
    protocol, state = read_protocol(sections["gain"]), fractions(sections["initial_state"])
    subject: Structure | Family
    if "signal" in document["problem"]:
        subject, effort = certificate_family(document["problem"]["graph"], source.files), None
    else:
        subject = analyse(certificate_graph(document, source.files))
        effort = with_longest_period(read_effort(source.report, subject, protocol, state), document["unverified"])
    request = read_request(document["unverified"], None if effort is None else effort.initial_set)
    request = replace(request, **read_unproved(document, subject))
    relative = state is None if isinstance(subject, Family) else sections["final_state"] is None
    late = read_late(source.report, subject, protocol, relative)
    late = late or nothing_proved(request.messages, subject, protocol, state is None)
    words: dict[str, Any] = {
        "question": Question(subject, protocol, state, fractions(sections["sliding_variable"]), request),
        "reaching": read_reaching(sections.get("reaching_time"), protocol),
        "late": with_longest_delays(late, document["unverified"]),
        "source": replace(source, effort=effort),
        "offsets": tuple(sections["formation"].offsets) if "formation" in sections else None,
    }
    if isinstance(subject, Family):
        proof = _read_family_proof(source, subject, words)
        if proof.late is not None and not proof.late.says_something:  # why is told from where agents begin and end
            case = replace(proof.late.case, initial_state=state, ends=proof.ends)
            proof = replace(proof, late=replace(proof.late, case=case))
        return proof, Observations()
    return _read_graph_proof(source, subject, words), read_observations(document["unverified"])


def _read_graph_proof(source: Source, structure: Structure, words: dict[str, Any]) -> GraphProof:
    """Return what is proved of one graph; ``words`` are the fields that proofs of families have, too."""
    report, data = source.report, Reader(structure.graph.labels, source.files)
    sections, proved = report.sections, report.proved
    paper: PaperSection | None = sections["paper"]
    functions = [
        _read_function(f"decays[{k}]", section, structure, data, proved) for k, section in enumerate(sections["decays"])
    ]
    lyapunov = next((replace(V, objective=paper.objective) for V in functions if paper and V.kind == "paper"), None)
    rho = None
    if paper is not None and paper.rho_interval is not None:
        rho = ExactInterval(paper.rho_interval.printed, paper.rho_interval.exact)
    obligations = tuple(
        Obligation(kind, of, {key: x for key, x in step.items() if key != "witness"})
        for (kind, of), step in proved.items()
        if of.split(".")[0] == "paper"
    )
    return GraphProof(
        lyapunov=lyapunov,
        paper_proof=RateProof(None if lyapunov is None else lyapunov.rate, obligations, rho),
        searched_functions=tuple(V for V in functions if V.kind != "paper"),
        limit=_read_limit(proved, data),
        final_state=read_final_state(report, structure),
        matrix=None,
        agents=read_agents(report, structure, words["question"].protocol, functions),
        **words,
    )


def _read_family_proof(source: Source, family: Family, words: dict[str, Any]) -> FamilyProof:
    """Return what is proved of a family; each upper bound on the rate is proved anew from members that are named."""
    document, sections, proved = source.document, source.report.sections, source.report.proved
    claims = [part["claim"] for part in document.get("components", [document])]
    components = [
        component if component.behaviour == claim["behaviour"] else replace(component, behaviour=claim["behaviour"])
        for component, claim in zip(decide(family), claims, strict=True)
    ]
    files = SideFiles(Path(), source.files)
    functions: list[list[ProvedFunction]] = [[] for _ in components]
    for k, section in enumerate(sections["decays"]):
        V = read_function(f"decays[{k}]", section, components[section.component], proved, files)
        functions[section.component].append(V)
    bounds = _read_bounds(document["unverified"].get("upper_bounds"), components)
    restricted = tuple(
        read_claim(f"restricted[{k}]", entry, proved, components)
        for k, entry in enumerate(sections.get("restricted", ()))
    )
    signal = restricted[0].signal if restricted else read_unproved_signals(document["unverified"])
    question = words.pop("question")
    boxes = sections.get("boxes", ())
    return FamilyProof(
        question=replace(question, request=replace(question.request, signal=signal)),
        parts=tuple(ComponentProof(c, tuple(V), b) for c, V, b in zip(components, functions, bounds, strict=True)),
        restricted=restricted,
        boxes={
            entry.component: read_box(entry, components[entry.component].family.labels, files)
            for entry in boxes
            if isinstance(entry, AttractingBox)
        },
        ranges={
            entry.component: tuple(zip(entry.lower, entry.upper, strict=True))
            for entry in boxes
            if isinstance(entry, KeptBox)
        },
        **words,
    )


def _read_bounds(stated: Any, components: Sequence[FamilyComponent]) -> list[SignalRateBound | None]:
    """Prove the upper bounds anew that a file states, one for each component."""
    entries = stated if isinstance(stated, list) and len(stated) == len(components) else [None] * len(components)
    return [
        None if entry is None or component.kernel is None else read_upper_bound(Quotient.of(component), entry)
        for entry, component in zip(entries, components, strict=True)
    ]


def read_protocol(section: NominalSection | SlidingSection) -> Protocol:
    """Return the protocol of an accepted certificate."""
    return Protocol.from_dict({key: value for key, value in vars(section).items() if key != "disturbance"})


def read_reaching(section: ReachingTimes | None, protocol: Protocol) -> tuple[ReachingTime, ...] | None:
    """Return the reaching times of an accepted certificate."""
    if section is None or protocol.reaching is None:
        return None
    return tuple(ReachingTime(protocol.reaching.T_r, z) for z in section.z)
