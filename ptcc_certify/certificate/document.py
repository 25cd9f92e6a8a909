"""The JSON of a certificate, schema ``ptcc-certificate/2``: written from sections, read as what was proved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.bounds.input.effort import EnergyIntegral, Peak, effort_section, peak_witness, read_effort
from ptcc_certify.bounds.late_messages import late_obligations, messages_section, read_late
from ptcc_certify.bounds.section_numbers import fractions
from ptcc_certify.bounds.tracking import leaders_section, read_tracking, tracking_obligations
from ptcc_certify.certificate.agents_answer import AgentsAnswer, rows_of
from ptcc_certify.certificate.agents_part import AgentsPart, matrix_section, phases_section, read_matrix
from ptcc_certify.certificate.cascade_part import CascadePart, cascade_section, read_cascade
from ptcc_certify.certificate.certificate_data import Content, Source
from ptcc_certify.certificate.checking import record
from ptcc_certify.certificate.claim_sections import ball, claim_section, claim_steps
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.final_state_sections import final_state_sections, formation_section, read_final_state
from ptcc_certify.certificate.functions import (
    _dominance_witness,
    _overshoot,
    _rates,
    _read_function,
    _read_limit,
    _write_function,
    box_section,
    function_section,
    function_steps,
    kept_section,
    paper_section,
)
from ptcc_certify.certificate.graph_sections import (
    certificate_graph,
    claim_sections,
    claim_witnesses,
    family_sections,
    graph_section,
    structure_section,
)
from ptcc_certify.certificate.restricted_claims import Claim
from ptcc_certify.certificate.section_writer import Reader, Writer, write
from ptcc_certify.certificate.unverified import (
    _read_observations,
    _read_request,
    _write_unverified,
    nothing_proved,
    read_unproved,
    upper_bound_entry,
    write_unproved,
)
from ptcc_certify.checker import NOT_OF_FAMILIES, SCHEMA, SLIDING_BOUND, SLIDING_CLOCK
from ptcc_certify.checker.agent_cascade import CascadeSection
from ptcc_certify.checker.agent_decrease import PhaseSection
from ptcc_certify.checker.agent_instants import InstantsSection
from ptcc_certify.checker.agents import AgentsSection
from ptcc_certify.checker.family_bounds import FamilyInput
from ptcc_certify.checker.family_limits import EQUAL
from ptcc_certify.checker.family_rows import FamilyFunctionsSection
from ptcc_certify.checker.final_state import FormationSection, InfluenceSection
from ptcc_certify.checker.input import EnergyWitness, InputSection
from ptcc_certify.checker.leaders import LeadersSection
from ptcc_certify.checker.messages import MessagesSection
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.protocol import NominalSection, ReachingTimes, SlidingPart, SlidingSection
from ptcc_certify.checker.rates import OvershootSection, RatesSection
from ptcc_certify.checker.restricted_signals import Section
from ptcc_certify.checker.sections import Ball, ByAgent, Several
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.theorem_function import PaperSection
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.lyapunov.follower_rows import listeners
from ptcc_certify.lyapunov.function import Dominance, LyapunovFunction
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.model import Protocol
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.theorems.agent_decrease import Phase
from ptcc_certify.theorems.theorem import ExactInterval, Obligation, RateProof


def agents_section(part: AgentsAnswer) -> AgentsSection | CascadeSection:
    """Return the section ``agents``."""
    if isinstance(part, CascadePart):
        return cascade_section(part)
    assert isinstance(part, AgentsPart)
    return matrix_section(part)


def read_agents(
    report: CheckReport, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsAnswer | None:
    """Return what an accepted certificate says of agents, with its phases; None if it says nothing."""
    section: AgentsSection | CascadeSection | None = report.sections.get("agents")
    if section is None:
        return None
    instants = rows_of(report.sections.get("instants", ()))
    if isinstance(section, CascadeSection):
        return replace(read_cascade(section, structure, base, functions), instants=instants)
    phases = tuple(
        Phase(p.function, rows_of(p.lower_triangle), p.rate, p.coupling, tuple(p.points))
        for p in report.sections.get("phases", ())
    )
    return replace(read_matrix(section, structure, base, functions), phases=phases, instants=instants)


def certificate_document(
    content: Content, files: bool = True
) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
    """Return a certificate as JSON-ready data, its side files, and what the check says, which lays down the proof."""
    graph, structure = content.graph, content.structure
    out = Writer(graph.labels, files, [graph.labels[v] for v in structure.followers])
    influence, final = final_state_sections(content, out)
    run = content.trajectory
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "producer": producer(),
        "graph": graph_section(graph, out),
        "structure": structure_section(structure, out),
        **claim_sections(structure, content.claims, final, out),
        "protocol": protocol_section(
            content.protocol, None if run is None or run.sliding is None else run.sliding.source
        ),
        "paper": write(PaperSection, paper_section(content), Writer(graph.labels)),
        "lyapunov": {"functions": [_write_function(V, out) for V in content.functions]},
        "rates": write(RatesSection, _rates(content), out),
        "overshoot": write(OvershootSection, _overshoot(content), out),
        "initial_state": out.state("start", content.initial_state),
        "sliding_variable": out.state("sigma", content.sigma0),
        "influence": write(InfluenceSection, influence, out),
        "final_state": final,
        "reaching_time": write(ReachingTimes, reaching_section(content.reaching), out),
        "input": write(InputSection | None, effort_section(content.effort, graph.n_nodes), out),
        "proof": [],
        "verdict": "",
    }
    if content.agents is not None:
        section = agents_section(content.agents)
        document["agents"] = write(type(section), section, out)
        if phases := phases_section(content.agents):
            document["phases"] = write(Several[PhaseSection], phases, out)
        if instants := getattr(content.agents, "instants", ()):
            document["instants"] = write(InstantsSection, instants, out)
    if content.offsets is not None:
        document["formation"] = write(FormationSection, formation_section(content, content.offsets, final), out)
    document |= _sections_beside(content, out)
    document |= {"digest": "", "unverified": _write_unverified(content)}
    given = {(o.kind, o.of): write_obligation(o, out) for o in content.witnesses}
    document, report = record(document, given, out.files, graph.n_nodes)
    return document, out.files, report


def _sections_beside(content: Content | FamilyContent, out: Writer) -> dict[str, Any]:
    """Return what is proved with late messages, and while leaders move, as files have it."""
    sections: dict[str, Any] = {}
    if content.late is not None and content.late.says_something:
        sections["messages"] = write(MessagesSection, messages_section(content.late), out)
    if content.tracking is not None:
        sections["leaders"] = write(LeadersSection, leaders_section(content.tracking), out)
    return sections


def read_document(
    path: Path, document: Mapping[str, Any], sha256: str, report: CheckReport, files: Mapping[str, bytes]
) -> dict[str, Any]:
    """Return the fields of a certificate that was accepted; the structure is computed anew from the edges."""
    graph = certificate_graph(document, files)
    structure = analyse(graph)
    protocol = read_protocol(report.sections["protocol"])
    data = Reader(graph.labels, files)
    sections, proved = report.sections, report.proved
    paper: PaperSection | None = sections["paper"]
    functions = [
        _read_function(f"lyapunov.functions[{k}]", section, structure, data, proved)
        for k, section in enumerate(sections["lyapunov"].functions)
    ]
    lyapunov = next((replace(V, objective=paper.objective) for V in functions if paper and V.kind == "paper"), None)
    initial_state, relative = fractions(sections["initial_state"]), sections["final_state"] is None
    rho = None
    if paper is not None and paper.rho_interval is not None:
        rho = ExactInterval(paper.rho_interval.printed, paper.rho_interval.exact)
    obligations = tuple(
        Obligation(kind, of, {key: x for key, x in step.items() if key != "witness"})
        for (kind, of), step in proved.items()
        if of.split(".")[0] == "paper"
    )
    effort = read_effort(report, structure, protocol, initial_state)
    request = _read_request(document["unverified"], None if effort is None else effort.initial_set)
    request = replace(request, **read_unproved(document, structure))
    return {
        "structure": structure,
        "protocol": protocol,
        "initial_state": initial_state,
        "sigma0": fractions(sections["sliding_variable"]),
        "reaching": read_reaching(report.sections.get("reaching_time"), protocol),
        "lyapunov": lyapunov,
        "proof": RateProof(None if lyapunov is None else lyapunov.rate, obligations, rho),
        "searched_functions": tuple(V for V in functions if V.kind != "paper"),
        "limit": _read_limit(proved, data),
        "final_state": read_final_state(report, structure),
        "matrix": None,
        "late": read_late(report, structure, protocol, relative)
        or nothing_proved(request.messages, request.leaders, structure, protocol, initial_state is None),
        "tracking": read_tracking(report, structure, protocol, relative),
        "request": request,
        "observed": _read_observations(document["unverified"]),
        "source": Source(path, sha256, document, report, effort, files),
        "agents": read_agents(report, structure, protocol, functions),
        "offsets": tuple(sections["formation"].offsets) if "formation" in sections else None,
    }


def producer() -> str:
    """Return the name and version of this program, as certificates tell who made them."""
    from importlib.metadata import version

    return f"ptcc-certify {version('ptcc-certify')}"


def protocol_section(protocol: Protocol, disturbance: str | None) -> dict[str, Any]:
    """Return a protocol as files have it; ``disturbance`` is what a run of the sliding-mode protocol met, if any."""
    section: dict[str, Any] = protocol.to_dict()
    return section if protocol.reaching is None else {**section, "disturbance": disturbance}


def read_protocol(section: NominalSection | SlidingSection) -> Protocol:
    """Return the protocol of an accepted certificate."""
    return Protocol.from_dict({key: value for key, value in vars(section).items() if key != "disturbance"})


def reaching_section(reaching: Sequence[ReachingTime] | None) -> ReachingTimes | None:
    """Return proved reaching times as files have them."""
    if reaching is None:
        return None
    return ReachingTimes(bound=SLIDING_BOUND, clock=SLIDING_CLOCK, z=[r.z for r in reaching])


def read_reaching(section: ReachingTimes | None, protocol: Protocol) -> tuple[ReachingTime, ...] | None:
    """Return the reaching times of an accepted certificate."""
    if section is None or protocol.reaching is None:
        return None
    return tuple(ReachingTime(protocol.reaching.T_r, z) for z in section.z)


def write_obligation(obligation: Obligation, out: Writer) -> dict[str, Any]:
    """Return numbers and witness of one step of the proof."""
    witness = obligation.witness
    if isinstance(witness, Dominance):
        witness = _dominance_witness(witness, out)
    elif is_dataclass(witness):
        if isinstance(witness, EnergyIntegral):
            witness = EnergyWitness(W0=witness.matrices[0], W1=witness.matrices[1])
        elif isinstance(witness, Peak):
            witness = peak_witness(witness)
        witness = write(type(witness), witness, out)
    return {"numbers": {name: format_exact(value) for name, value in obligation.numbers.items()}, "witness": witness}


def family_document(
    certificate: FamilyContent, files: bool = True
) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
    """Return a certificate of a family as JSON-ready data, its side files, and what the check says of it."""
    family, parts, labels = certificate.family, certificate.parts, certificate.family.labels
    out = Writer(labels, files, [labels[v] for v in listeners(family).tolist()])
    components = [part.component for part in parts]
    used = [function_section(part.component, k, V, out) for k, part in enumerate(parts) for V in part.functions]
    finals, drives = certificate.final_states, certificate.drives
    ends = None if finals is None else [None if pair is None else ball(*pair) for pair in finals]
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "producer": producer(),
        **family_sections(family, components, out),
        "protocol": protocol_section(certificate.protocol, certificate.disturbance),
        **dict.fromkeys(NOT_OF_FAMILIES),
        "lyapunov": write(FamilyFunctionsSection, FamilyFunctionsSection(functions=used, drives=drives), out),
        "initial_state": out.state("start", certificate.initial_state),
        "sliding_variable": out.state("sigma", certificate.sigma0),
        "reaching_time": write(ReachingTimes, reaching_section(certificate.reaching), out),
        "final_state": write(ByAgent[Ball | None], ends, out),
        "input": write(FamilyInput, _input(certificate), out),
        "proof": [],
        "verdict": "",
    }
    boxes: list[Any] = [box_section(components[k].nodes, k, box, out) for k, box in sorted(certificate.boxes.items())]
    boxes += [kept_section(k, pairs) for k, pairs in sorted(certificate.ranges.items())]
    if boxes:
        document["boxes"] = [write(type(box), box, out) for box in boxes]
    if certificate.restricted:
        claims = [_claim(certificate, claim) for claim in certificate.restricted]
        document["restricted"] = [write(type(claim), claim, out) for claim in claims]
    document |= _sections_beside(certificate, out)
    document |= {"digest": "", "unverified": _unverified(certificate)}
    given = {(o.kind, o.of): write_obligation(o, out) for o in _steps(certificate, out)}
    document, report = record(document, given, out.files, family.n_nodes)
    return document, out.files, report


def _labels(certificate: FamilyContent, claim: Claim) -> Sequence[str]:
    return certificate.parts[claim.component].component.family.labels


def _claim(certificate: FamilyContent, claim: Claim) -> Section:
    component = certificate.parts[claim.component].component
    return claim_section(claim, component.nodes, component.family.labels)


def _input(certificate: FamilyContent) -> FamilyInput:
    """Return bounds of the input, rounded up to 60 bits or so; the sliding part under that protocol."""
    bounded, own, peaks = certificate.sliding_bounded, certificate.sliding_peaks, certificate.input_peaks
    sliding = None if bounded is None else SlidingPart(bounded=bounded, agents=_up(own))
    return FamilyInput(bounded=certificate.bounded, peaks=_up(peaks), sliding=sliding)


def _up(values: Sequence[Fraction] | None) -> Numbers | None:
    return None if values is None else Numbers([rounded(x, 60, up=True) for x in values])


def _steps(certificate: FamilyContent, out: Writer) -> Iterator[Obligation]:
    """Yield the obligations that have numbers or a witness, in any order."""
    components = [part.component for part in certificate.parts]
    functions = [V for part in certificate.parts for V in part.functions]
    yield Obligation("family-claim", "graph", witness=claim_witnesses(certificate.family, components))
    for k, V in enumerate(functions):
        yield from function_steps(f"lyapunov.functions[{k}]", V, out)
    if certificate.final_states is not None:
        yield Obligation("family-final-state", "final_state", witness=_means(certificate))
    for k, claim in enumerate(certificate.restricted):
        yield from claim_steps(f"restricted[{k}]", claim, _labels(certificate, claim))
    yield from late_obligations(certificate.late)
    yield from tracking_obligations(certificate.tracking)


def _means(certificate: FamilyContent) -> list[Any] | None:
    """Return the means that every signal keeps, by component and closed component; None if there is none."""
    first = analyse(certificate.family.modes[0].mandatory)
    number = {c.nodes[0]: str(k) for k, c in enumerate(first.closed_components, start=1)}
    result: list[Any] = []
    for part in certificate.parts:
        nodes = part.component.nodes
        labels = [certificate.family.labels[v] for v in nodes.tolist()]
        means = {}
        for group in part.leading_groups:
            if group.vector is not None and len(group.nodes) > 1:
                pivot = next(v for v in group.nodes if int(nodes[v]) in number)
                terms = zip(group.nodes, group.camps, group.vector, strict=True)
                q = {labels[v]: format_exact(Fraction(g * p)) for v, g, p in terms if p}
                means[number[int(nodes[pivot])]] = EQUAL if set(group.vector) == {1} else q
        result.append(means or None)
    return result if any(result) else None


def _unverified(certificate: FamilyContent) -> dict[str, Any]:
    expectations = certificate.expectations
    bounds = [(part.component, part.upper_bound) for part in certificate.parts]
    return {
        "upper_bounds": [None if b is None else upper_bound_entry(Quotient.of(c), b) for c, b in bounds],
        "asked": {"behaviour": expectations.behaviour} | write_unproved(certificate),
        "read": dict(certificate.family.read) or None,
        "origins": dict(certificate.origins),
        "scenario": certificate.scenario,
        "notes": list(certificate.notes),
    }
