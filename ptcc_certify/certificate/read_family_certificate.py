"""Reads a certificate of a family back from a file that the independent check accepts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ptcc_certify.bounds.late_messages import read_late
from ptcc_certify.bounds.section_numbers import fractions
from ptcc_certify.bounds.tracking import read_tracking
from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.claim_sections import read_claim
from ptcc_certify.certificate.document import read_protocol, read_reaching
from ptcc_certify.certificate.family_certificate import ComponentProof, FamilyCertificate
from ptcc_certify.certificate.functions import ProvedFunction, read_box, read_function
from ptcc_certify.certificate.graph_sections import certificate_family
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.certificate.unverified import nothing_proved, read_unproved, read_upper_bound
from ptcc_certify.checker.attracting_boxes import AttractingBox, KeptBox
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.model import Protocol
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide


def read_family_certificate(source: Source) -> FamilyCertificate:
    """Return what an accepted file says: family, behaviours, Lyapunov functions and what follows of them.

    The decision is made anew, and so is the proof of each upper bound on the rate from the members that the file names.
    """
    document = source.document
    family = certificate_family(document["graph"], source.files)
    claims = [document["claim"]] if document["claim"] is not None else [c["claim"] for c in document["components"]]
    components = [
        component if component.behaviour == claim["behaviour"] else replace(component, behaviour=claim["behaviour"])
        for component, claim in zip(decide(family), claims, strict=True)
    ]
    files = SideFiles(Path(), source.files)
    functions: list[list[ProvedFunction]] = [[] for _ in components]
    sections, proved = source.report.sections, source.report.proved
    for k, section in enumerate(sections["lyapunov"].functions):
        V = read_function(f"lyapunov.functions[{k}]", section, components[section.component], proved, files)
        functions[section.component].append(V)
    bounds = _read_bounds(document["unverified"].get("upper_bounds"), components)
    parts = tuple(ComponentProof(c, tuple(V), b) for c, V, b in zip(components, functions, bounds, strict=True))
    state, sigma0 = (fractions(sections[key]) for key in ("initial_state", "sliding_variable"))
    restricted = enumerate(sections.get("restricted", ()))
    promised = tuple(read_claim(f"restricted[{k}]", entry, proved, components) for k, entry in restricted)
    protocol, disturbance = read_protocol(sections["protocol"]), document["protocol"].get("disturbance")
    kept: dict[str, Any] = {"signal": promised[0].signal if promised else "any", "restricted": promised}
    kept["disturbance"] = disturbance
    kept["boxes"] = {
        entry.component: read_box(entry, components[entry.component].family.labels, files)
        for entry in sections.get("boxes", ())
        if isinstance(entry, AttractingBox)
    }
    kept["ranges"] = {
        entry.component: tuple(zip(entry.lower, entry.upper, strict=True))
        for entry in sections.get("boxes", ())
        if isinstance(entry, KeptBox)
    }
    kept |= {"expectations": _read_expectations(document["unverified"].get("asked")), "source": source}
    kept |= _read_beside(source, family, protocol, state is None)
    return FamilyCertificate(
        family,
        protocol,
        parts,
        state,
        sigma0,
        read_reaching(sections.get("reaching_time"), protocol),
        **kept,
    )


def _read_beside(source: Source, family: Family, protocol: Protocol, relative: bool) -> dict[str, Any]:
    """Return what the file says of late messages and of leaders that move, or that nothing is proved of them."""
    asked = read_unproved(source.document, family)
    messages, leaders = asked.get("messages"), asked.get("leaders")
    late = read_late(source.report, family, protocol, relative)
    tracking = read_tracking(source.report, family, protocol, relative)
    late = late or nothing_proved(messages, leaders, family, protocol, relative)
    proved = next((one.leaders for one in (late, tracking) if one is not None), None)
    return {"late": late, "tracking": tracking, "asked_leaders": proved or leaders}


def _read_bounds(stated: Any, components: Sequence[FamilyComponent]) -> list[FamilyRateBound | None]:
    """Prove the upper bounds anew that a file states, one for each component."""
    entries = stated if isinstance(stated, list) and len(stated) == len(components) else [None] * len(components)
    return [
        None if entry is None or component.kernel is None else read_upper_bound(Quotient.of(component), entry)
        for entry, component in zip(entries, components, strict=True)
    ]


def _read_expectations(asked: Any) -> Expectations:
    """Return what was asked, as the file says; nothing if it says what nobody can ask."""
    try:
        return Expectations(asked["behaviour"])
    except (TypeError, LookupError, ParameterError):
        return Expectations()
