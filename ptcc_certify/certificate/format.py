"""The JSON of a certificate, schema ``ptcc-certificate/2``: written and read section by section.

``FORMAT.md`` specifies it. What is read was accepted by the independent check, so that every part is there; nothing
that is claimed is taken from the key ``unverified``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify.bounds.envelope import FRACTIONS, LAST_INSTANTS
from ptcc_certify.bounds.input.effort import EnergyIntegral, Peak
from ptcc_certify.certificate.certificate_data import Content, Observations, Source
from ptcc_certify.certificate.checking import record
from ptcc_certify.certificate.format_agents import agents_section, phases_section, read_agents
from ptcc_certify.certificate.format_effort import LIMITS, effort_section, peak_witness, read_effort
from ptcc_certify.certificate.format_final_state import final_state_sections, formation_section, read_final_state
from ptcc_certify.certificate.format_graph import certificate_graph, claim_sections, graph_section, structure_section
from ptcc_certify.certificate.format_leaders import leaders_section, read_tracking
from ptcc_certify.certificate.format_messages import messages_section, read_late
from ptcc_certify.certificate.format_unproved import nothing_proved, read_unproved, write_unproved
from ptcc_certify.certificate.format_vectors import (
    Reader,
    Writer,
    factor_section,
    finite,
    fractions,
    text,
)
from ptcc_certify.certificate.request import Expectations, Request
from ptcc_certify.certificate.write_sections import write
from ptcc_certify.checker import SCHEMA, SLIDING_BOUND, SLIDING_CLOCK, CheckReport
from ptcc_certify.checker.agent_decrease import PhaseSection
from ptcc_certify.checker.dominance import FactorSection
from ptcc_certify.checker.final_state import FormationSection, InfluenceSection
from ptcc_certify.checker.input import EnergyWitness, InputSection
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.leaders import LeadersSection
from ptcc_certify.checker.lyapunov import DeviationSection, FunctionSection
from ptcc_certify.checker.messages import MessagesSection
from ptcc_certify.checker.protocol import NominalSection, ReachingTimes, SlidingSection
from ptcc_certify.checker.rates import MeanWitness, OvershootSection, RatesSection
from ptcc_certify.checker.reading import RejectedError, exact
from ptcc_certify.checker.sections import Several
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.theorem_function import BlockSection, PaperSection, RhoInterval
from ptcc_certify.errors import one_line
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure, analyse, behaviour_name
from ptcc_certify.lyapunov.function import DeviationBound, Dominance, LyapunovBlock, LyapunovFunction
from ptcc_certify.lyapunov.rate_upper_bound import RateBound
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.theorems.theorem import ExactInterval, Obligation, RateProof


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
    if content.offsets is not None:
        document["formation"] = write(FormationSection, formation_section(content, content.offsets, final), out)
    if content.late is not None and content.late.says_something:
        document["messages"] = write(MessagesSection, messages_section(content.late), out)
    if content.tracking is not None:
        document["leaders"] = write(LeadersSection, leaders_section(content.tracking), out)
    document |= {"digest": "", "unverified": _write_unverified(content)}
    given = {(o.kind, o.of): write_obligation(o, out) for o in content.witnesses}
    document, report = record(document, given, out.files, graph.n_nodes)
    return document, out.files, report


def read_document(
    path: Path, document: Mapping[str, Any], sha256: str, report: CheckReport, files: Mapping[str, bytes]
) -> dict[str, Any]:
    """Return the fields of a certificate that was accepted; the structure is computed anew from the edges."""
    graph = certificate_graph(document, files)
    structure, protocol, data = analyse(graph), read_protocol(report.sections["protocol"]), Reader(graph.labels, files)
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
        or nothing_proved(request, structure, protocol, initial_state is None),
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


# ---------------------------------------------------------------------- protocol


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


# ---------------------------------------------------------------------- Lyapunov functions


def paper_section(content: Content) -> PaperSection | None:
    """Return the row of the theorem: its Lyapunov function, whether a rate of it was proved or not."""
    V, interval = content.lyapunov, content.proof.interval
    if V is None:
        return None
    coordinates: Any = V.coordinates
    return PaperSection(
        theorem=content.theorem.number,
        objective=V.objective,
        coordinates=coordinates,
        blocks=list(map(_block, V.blocks)),
        rho=V.rho,
        rho_interval=None if interval is None else RhoInterval(printed=interval.printed, exact=interval.exact),
        rate=V.rate,
        overshoot=V.overshoot if V.blocks else None,
    )


def _rates(content: Content) -> RatesSection:
    rates = content.paper_rate, content.diagonal_rate, content.rate, content.upper_bound
    return RatesSection(**dict(zip(("paper", "diagonal", "proved", "upper_bound"), rates, strict=True)))


def _write_function(V: LyapunovFunction, out: Writer) -> dict[str, Any]:
    where = Writer(out.labels) if V.kind == "paper" else out  # as the section "paper" has it
    section: dict[str, Any] = write(FunctionSection, _function(V), where)
    return section


def _function(V: LyapunovFunction) -> FunctionSection:
    bound, words = V.deviation, dict[str, Any](class_=V.kind, coordinates=V.coordinates)
    return FunctionSection(
        **words,
        blocks=list(map(_block, V.blocks)),
        rho=V.rho,
        rate=V.proved_rate,
        overshoot=V.overshoot,
        deviation=None if bound is None else DeviationSection(agents=Numbers(bound.agents), norm=bound.norm),
    )


def _block(block: LyapunovBlock) -> BlockSection:
    diagonal = block.diagonal if block.dyadic is None else block.dyadic
    return BlockSection(
        name=block.name,
        nodes=block.nodes,
        diagonal=diagonal if block.matrix is None else None,
        lower_triangle=block.matrix,
        times_rho=block.times_rho,
    )


def _read_function(
    name: str, section: FunctionSection, structure: Structure, data: Reader, proved: Mapping[tuple[str, str], Any]
) -> LyapunovFunction:
    bound, full, rows = section.deviation, proved.get(("overshoot", name)), proved.get(("dominance", name))
    blocks = tuple(_read_block(block, data, rows is not None) for block in section.blocks)
    gauge = structure.closed_components[0].gauge if section.coordinates == "eps" else ()
    return LyapunovFunction(
        section.class_,
        section.coordinates,
        blocks,
        section.rho,
        section.rate,
        None if full is None else (full["lowest"], full["highest"]),
        gauge or (),
        dominance=None if rows is None else Dominance(data.floats(rows["witness"].vector, len(blocks[0].nodes))),
        deviation=None if bound is None else DeviationBound(tuple(bound.agents), bound.norm),
        name=name,
    )


def _read_block(section: BlockSection, data: Reader, large: bool) -> LyapunovBlock:
    nodes = data.nodes(section.nodes)
    if section.lower_triangle is not None:
        return LyapunovBlock(section.name, nodes, matrix=list(map(list, section.lower_triangle)))
    if large:
        return LyapunovBlock(section.name, nodes, dyadic=data.floats(section.diagonal, len(nodes)))
    return LyapunovBlock(section.name, nodes, tuple(map(exact, section.diagonal or ())), section.times_rho)


def _overshoot(content: Content) -> OvershootSection | None:
    if content.rate is None:
        return None
    V = content.fastest
    return OvershootSection(value=V.overshoot, of=f"||{V.coordinates}||^2")


def _read_limit(proved: Mapping[tuple[str, str], Any], data: Reader) -> RateBound | None:
    step = proved.get(("rate-upper-bound", "rates")) or proved.get(("rate-mean", "rates"))
    if step is None:
        return None
    value, witness = step["upper_bound"], step["witness"]
    if isinstance(witness, MeanWitness):
        return RateBound(value, (witness.node,))
    vectors = tuple(map(tuple, witness.vectors))
    return RateBound(value, data.nodes(witness.nodes), witness.lower_triangle, vectors)


# ---------------------------------------------------------------------- proof


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


def _dominance_witness(proof: Dominance, out: Writer) -> dict[str, Any]:
    """Return the vector, and the proof of every leader group, each factor once."""
    groups: list[Any] = []
    first = 0
    for group, scale in zip(proof.groups, proof.scales, strict=True):
        rate = format_exact(group.rate)
        unit = math.frexp(float(group.weights[0]))[1]
        key = first, group.rate, np.ldexp(group.weights, -unit).tobytes()
        repeated = key in out.written_groups
        out.written_groups.add(key)
        if group.factor is None or repeated:
            groups.append(rate)
        else:
            # The factor is that of the group's own weights, of which those of the function are a power of two.
            power = group.power + 1 - math.frexp(scale)[1]
            factor = write(FactorSection, factor_section(group.factor, power, group.parents), out)
            groups.append({"rate": rate, "factor": factor})
        first += group.weights.size
    return {"vector": out.floats("vector", proof.vector), "groups": groups}


# ---------------------------------------------------------------------- what is not verified


def _write_unverified(content: Content) -> dict[str, Any]:
    search, envelope = content.search, content.envelope
    remaining = (*(1 - f for f in FRACTIONS), *LAST_INSTANTS)
    residual = {str(1 - q if q > 1e-3 else f"1-{q:g}"): q for q in remaining}
    floats = None
    if content.final_state is not None and not content.final_state.exact:
        floats = dict(zip(content.graph.labels, map(finite, np.asarray(content.final_state).tolist()), strict=True))
    return {
        "spectral": finite(content.spectral_rate),
        "optimality_ratio": content.optimality_ratio,
        "paper_rate": finite(content.numerical_rate),
        "rounding_loss": finite(content.rounding_loss),
        "search": {
            "method": content.method,
            "at": None if content.at is None else float(content.at),
            "searched": {kind: finite(rate) for kind, rate in search.searched.items()},
            "diagonal_limit": finite(search.diagonal_limit),
        },
        "residual": {name: finite(envelope.residual(q)) for name, q in residual.items()} if content.direct else None,
        "final_state": floats,
        "asked": _write_request(content.request) | write_unproved(content),
        "scenario": None if content.request.scenario is None else dict(content.request.scenario),
        "origins": dict(content.request.origins),
        "simulation": _write_run(content),
        "time_limit": finite(content.time_limit),
        "cut_off": list(content.cut_off),
        "notes": list(content.notes),
    }


def _write_run(content: Content) -> dict[str, Any] | None:
    run, comparison = content.trajectory, content.comparison
    if comparison is None:
        return None
    section = {
        "worst_ratio": finite(comparison.worst_ratio),
        "floor": finite(comparison.floor),
        "resolved_until": comparison.resolved_until,
        "judged": comparison.judged,
        "ratios": {str(k): finite(v) for k, v in comparison.ratios.items()},
        "stop": comparison.stop,
        "tolerances": {"relative": comparison.tolerance},
        "deviation_ratio": finite(comparison.deviation_ratio),
        "deadline_resolved": comparison.deadline_resolved,
    }
    if run is None or run.sliding is None:
        return section
    return section | {
        "sliding_ratio": finite(comparison.sliding_ratio),
        "reaching_kept": comparison.reaching_kept,
        "reached": dict(zip(content.graph.labels, map(finite, run.sliding.reaching_z.tolist()), strict=True)),
        "disturbance_bounded_by": run.sliding.bounded_by,
    }


def _read_observations(section: Mapping[str, Any]) -> Observations:
    """Read what the file says of searches; other observations are made anew."""
    return Observations(cut_off=_texts(section.get("cut_off")), notes=_texts(section.get("notes")))


def _write_request(request: Request) -> dict[str, Any]:
    """Return what was asked; what became of it is no part of the claim, and follows from what is."""
    expectations = request.expectations
    return {
        "behaviour": expectations.behaviour,
        "min_rate": text(expectations.min_rate),
        "max_input": text(expectations.max_input),
        "max_residual": text(expectations.max_residual),
        "limits": [{name: text(getattr(entry, name)) for name in LIMITS} for entry in request.limits],
        "delta": text(request.delta),
        "noise": text(request.noise),
    }


def _read_request(unverified: Mapping[str, Any], initial_set: InitialSet | None) -> Request:
    """Read what was asked; nothing of it is claimed, so that what cannot be read is left out."""
    section, search, seconds = (unverified.get(key) for key in ("asked", "search", "time_limit"))
    scenario, origins = unverified.get("scenario"), unverified.get("origins")
    origins = origins.items() if isinstance(origins, dict) else ()
    section = section if isinstance(section, dict) else {}
    method, behaviour = search.get("method") if isinstance(search, dict) else None, section.get("behaviour")
    try:
        behaviour = behaviour_name(behaviour) if isinstance(behaviour, str) else None
    except ValueError:
        behaviour = None
    entries = section.get("limits")
    each = [[_positive(entry, key) for key in LIMITS] for entry in (entries if isinstance(entries, list) else [])[:100]]
    return Request(
        method=method if method in METHODS else "best",
        initial_set=initial_set,
        limits=tuple(Limits(*entry) for entry in each if any(entry)),
        delta=_positive(section, "delta"),
        noise=_positive(section, "noise"),
        time_limit=float(seconds) if isinstance(seconds, int | float) and seconds is not True else math.inf,
        expectations=Expectations(
            behaviour, *(_positive(section, key) for key in ("min_rate", "max_input", "max_residual"))
        ),
        scenario=scenario if isinstance(scenario, dict) else None,
        origins={key: one_line(origin)[:200] for key, origin in origins if isinstance(origin, str)},
    )


def _positive(section: Any, key: str) -> Fraction | None:
    try:
        value = None if section.get(key) is None else exact(section[key])
    except (AttributeError, RejectedError):
        return None
    return value if value is not None and value > 0 else None


def _texts(section: Any) -> tuple[str, ...]:
    return tuple(one for one in section if isinstance(one, str)) if isinstance(section, list) else ()
