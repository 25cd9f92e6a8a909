"""The JSON of a certificate, schema ``ptcc-certificate/3``: written from sections, read back once it is accepted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.bounds.delay.late_messages import late_obligations, messages_section, read_late
from ptcc_certify.bounds.float_conversion import fractions
from ptcc_certify.bounds.input.effort import EnergyIntegral, Peak, effort_section, peak_witness, read_effort
from ptcc_certify.certificate.agents_part import read_agents
from ptcc_certify.certificate.checking import record
from ptcc_certify.certificate.constrained_switching.claims import Claim
from ptcc_certify.certificate.constrained_switching.sections import ball, claim_section, claim_steps, read_claim
from ptcc_certify.certificate.evidence import Evidence, Observations
from ptcc_certify.certificate.family_proof import ComponentProof, FamilyProof
from ptcc_certify.certificate.functions import (
    ProvedFunction,
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
    read_box,
    read_function,
)
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.graph_sections import (
    certificate_family,
    certificate_graph,
    claim_sections,
    claim_witnesses,
    family_claim_sections,
    family_section,
    final_state_sections,
    formation_section,
    graph_section,
    read_final_state,
    structure_section,
)
from ptcc_certify.certificate.request import Proof, Question, Source
from ptcc_certify.certificate.section_io import Reader, Writer, write
from ptcc_certify.certificate.unverified_section import (
    nothing_proved,
    read_observations,
    read_request,
    read_unproved,
    read_unproved_signals,
    read_upper_bound,
    with_longest_delays,
    with_longest_period,
    write_unverified,
)
from ptcc_certify.checker import SCHEMA, SLIDING_BOUND, SLIDING_CLOCK
from ptcc_certify.checker.agent_decrease import PhaseSection
from ptcc_certify.checker.agent_instants import InstantsSection
from ptcc_certify.checker.attracting_boxes import AttractingBox, KeptBox
from ptcc_certify.checker.common_kernel_ends import EQUAL
from ptcc_certify.checker.constrained_switching import Section
from ptcc_certify.checker.final_state import FormationSection, InfluenceSection
from ptcc_certify.checker.input import EnergyWitness, InputSection
from ptcc_certify.checker.lyapunov import OvershootSection, RatesSection
from ptcc_certify.checker.messages import MessagesSection
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.protocol import NominalSection, ReachingTimes, SlidingPart, SlidingSection
from ptcc_certify.checker.row_functions import FunctionOfFamily
from ptcc_certify.checker.section_declarations import Ball, ByAgent, Several
from ptcc_certify.checker.side_files import Numbers, SideFiles
from ptcc_certify.checker.signal_bounds import FamilyInput
from ptcc_certify.checker.theorem_function import PaperSection
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.lyapunov.common_forms import Quotient
from ptcc_certify.lyapunov.follower_rows import listeners
from ptcc_certify.lyapunov.function import Dominance
from ptcc_certify.lyapunov.slow_signals import SignalRateBound
from ptcc_certify.model import Protocol
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide
from ptcc_certify.theorems.theorem import ExactInterval, Obligation, RateProof


def certificate_document(
    certificate: Evidence, files: bool = True
) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
    """Return a certificate as JSON-ready data, its side files, and what the check says, which lays down the proof."""
    proof, labels = certificate.proof, certificate.proof.labels
    hear = listeners(proof.family).tolist() if isinstance(proof, FamilyProof) else proof.structure.followers
    out = Writer(labels, files, [labels[v] for v in hear])
    if isinstance(proof, FamilyProof):
        sections, more, steps = *_family_sections(proof, out), _steps(proof, out)
    else:
        run = certificate.trajectory
        met = None if run is None or run.sliding is None else run.sliding.source
        sections, more, steps = *_graph_sections(proof, met, out), iter(proof.witnesses)
    sections = {key: part for key, part in sections.items() if part is not None}
    document: dict[str, Any] = {"schema": SCHEMA, "producer": producer(), **sections, "proof": [], "verdict": ""}
    document |= {
        **more,
        **_sections_beside(proof, sections.get("final_state"), out),
        "digest": "",
        "unverified": write_unverified(certificate),
    }
    given = {(o.kind, o.of): write_obligation(o, out) for o in steps}
    document, report = record(document, given, out.files, len(labels))
    return document, out.files, report


def _problem(proof: Proof, graph: Mapping[str, Any], met: str | None, out: Writer) -> dict[str, Any]:
    """Return what is asked: graph, gain, where the agents begin."""
    parts = {
        "graph": graph,
        "signal": "any" if isinstance(proof, FamilyProof) else None,
        "gain": gain_section(proof.protocol, met),
        "initial_state": out.state("start", proof.initial_state),
        "sliding_variable": out.state("sigma", proof.sigma0),
    }
    return {key: part for key, part in parts.items() if part is not None}


def _graph_sections(proof: GraphProof, met: str | None, out: Writer) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what files say of one graph, before the proof and behind it; its run has ``met`` a disturbance."""
    influence, final = final_state_sections(proof, out)
    sections = {
        "problem": _problem(proof, graph_section(proof.graph, out), met, out),
        "structure": [structure_section(proof.structure, out)],
        **claim_sections(proof.structure, proof.claims, final, out),
        "paper": write(PaperSection, paper_section(proof), Writer(proof.labels)),
        "decays": [_write_function(V, out) for V in proof.functions],
        "rates": write(RatesSection, _rates(proof), out),
        "overshoot": write(OvershootSection, _overshoot(proof), out),
        "influence": write(InfluenceSection, influence, out),
        "final_state": final,
        "reaching_time": write(ReachingTimes, reaching_section(proof.reaching), out),
        "input": write(InputSection | None, effort_section(proof.effort, proof.graph.n_nodes), out),
    }
    more: dict[str, Any] = {}
    if (agents := proof.agents) is not None:
        more["agents"] = write(type(agents.section), agents.section, out)
        if agents.phases:
            phases = [
                PhaseSection(function=p.function, rate=p.rate, coupling=p.coupling, lower_triangle=p.W, points=p.points)
                for p in agents.phases
            ]
            more["phases"] = write(Several[PhaseSection], phases, out)
        if agents.instants:
            more["instants"] = write(InstantsSection, agents.instants, out)
    return sections, more


def _family_sections(proof: FamilyProof, out: Writer) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what files say of a family, before the proof and behind it."""
    components = [part.component for part in proof.parts]
    used = [function_section(part.component, k, V, out) for k, part in enumerate(proof.parts) for V in part.functions]
    finals = proof.final_state
    ends = None if finals is None else [None if pair is None else ball(*pair) for pair in finals]
    sections = {
        "problem": _problem(proof, family_section(proof.family, out), None, out),
        **family_claim_sections(proof.family, components, out),
        "decays": write(Several[FunctionOfFamily], used, out),
        "drives": write(Several[Fraction], proof.drives, out),
        "reaching_time": write(ReachingTimes, reaching_section(proof.reaching), out),
        "final_state": write(ByAgent[Ball | None], ends, out),
        "input": write(FamilyInput, _input(proof), out),
    }
    more: dict[str, Any] = {}
    boxes: list[Any] = [box_section(components[k].nodes, k, box, out) for k, box in sorted(proof.boxes.items())]
    boxes += [kept_section(k, pairs) for k, pairs in sorted(proof.ranges.items())]
    if boxes:
        more["boxes"] = [write(type(box), box, out) for box in boxes]
    if proof.restricted:
        claims = [_claim(proof, claim) for claim in proof.restricted]
        more["restricted"] = [write(type(claim), claim, out) for claim in claims]
    return sections, more


def _sections_beside(proof: Proof, final: Mapping[str, Any] | None, out: Writer) -> dict[str, Any]:
    """Return a formation, of which ``final`` is where agents end, and what is proved of late messages and leaders."""
    sections: dict[str, Any] = {}
    if proof.offsets is not None:
        sections["formation"] = write(FormationSection, formation_section(proof, proof.offsets, final), out)
    if proof.late is not None and proof.late.says_something:
        sections["messages"] = write(MessagesSection, messages_section(proof.late), out)
    return sections


def producer() -> str:
    """Return the name and version of this program, as certificates tell who made them."""
    from importlib.metadata import version

    return f"ptcc-certify {version('ptcc-certify')}"


def gain_section(protocol: Protocol, disturbance: str | None) -> dict[str, Any]:
    """Return a protocol as files have it; ``disturbance`` is what a run of the sliding-mode protocol met, if any."""
    section: dict[str, Any] = protocol.to_dict()
    return section if disturbance is None else {**section, "disturbance": disturbance}


def reaching_section(reaching: Sequence[ReachingTime] | None) -> ReachingTimes | None:
    """Return proved reaching times as files have them."""
    if reaching is None:
        return None
    return ReachingTimes(bound=SLIDING_BOUND, clock=SLIDING_CLOCK, z=[r.z for r in reaching])


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


def _labels(proof: FamilyProof, claim: Claim) -> Sequence[str]:
    return proof.parts[claim.component].component.family.labels


def _claim(proof: FamilyProof, claim: Claim) -> Section:
    component = proof.parts[claim.component].component
    return claim_section(claim, component.nodes, component.family.labels)


def _input(proof: FamilyProof) -> FamilyInput:
    """Return bounds of the input, rounded up to 60 bits or so; the sliding part under that protocol."""
    bounded, own, peaks = proof.sliding_bounded, proof.sliding_peaks, proof.input_peaks
    sliding = None if bounded is None else SlidingPart(bounded=bounded, agents=_up(own))
    return FamilyInput(bounded=proof.bounded, peaks=_up(peaks), sliding=sliding)


def _up(values: Sequence[Fraction] | None) -> Numbers | None:
    return None if values is None else Numbers([rounded(x, 60, up=True) for x in values])


def _steps(proof: FamilyProof, out: Writer) -> Iterator[Obligation]:
    """Yield the obligations that have numbers or a witness, in any order."""
    components = [part.component for part in proof.parts]
    functions = [V for part in proof.parts for V in part.functions]
    yield Obligation("family-claim", "graph", witness=claim_witnesses(proof.family, components))
    for k, V in enumerate(functions):
        yield from function_steps(f"decays[{k}]", V, out)
    if proof.final_state is not None:
        yield Obligation("family-final-state", "final_state", witness=_means(proof))
    for k, claim in enumerate(proof.restricted):
        yield from claim_steps(f"restricted[{k}]", claim, _labels(proof, claim))
    yield from late_obligations(proof.late)


def _means(proof: FamilyProof) -> list[Any] | None:
    """Return the means that every signal keeps, by component and closed component; None if there is none."""
    first = analyse(proof.family.modes[0].mandatory)
    number = {c.nodes[0]: str(k) for k, c in enumerate(first.closed_components, start=1)}
    result: list[Any] = []
    for part in proof.parts:
        nodes = part.component.nodes
        labels = [proof.family.labels[v] for v in nodes.tolist()]
        means = {}
        for group in part.leading_groups:
            if group.vector is not None and len(group.nodes) > 1:
                pivot = next(v for v in group.nodes if int(nodes[v]) in number)
                terms = zip(group.nodes, group.camps, group.vector, strict=True)
                q = {labels[v]: format_exact(Fraction(g * p)) for v, g, p in terms if p}
                means[number[int(nodes[pivot])]] = EQUAL if set(group.vector) == {1} else q
        result.append(means or None)
    return result if any(result) else None


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
