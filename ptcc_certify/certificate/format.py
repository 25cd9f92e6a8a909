"""The JSON of a certificate, schema ``ptcc-certificate/2``: written and read section by section.

``FORMAT.md`` specifies it. What is read was accepted by the independent check, so that every part is there; nothing
that is claimed is taken from the key ``unverified``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify.bounds.envelope import FRACTIONS, LAST_INSTANTS
from ptcc_certify.bounds.input.effort import EnergyIntegral, Peak
from ptcc_certify.certificate.certificate_data import Content, Observations, Source
from ptcc_certify.certificate.checking import record
from ptcc_certify.certificate.format_agents import agents_section, instants_section, phases_section, read_agents
from ptcc_certify.certificate.format_effort import LIMITS, effort_section, energy_witness, peak_witness, read_effort
from ptcc_certify.certificate.format_final_state import final_state_sections, formation_section, read_final_state
from ptcc_certify.certificate.format_graph import certificate_graph, claim_sections, graph_section, structure_section
from ptcc_certify.certificate.format_leaders import leaders_section, read_tracking
from ptcc_certify.certificate.format_messages import Vectors, messages_section, read_late
from ptcc_certify.certificate.format_unproved import nothing_proved, read_unproved, write_unproved
from ptcc_certify.certificate.format_vectors import (
    Reader,
    Writer,
    factor_entry,
    finite,
    number,
    text,
)
from ptcc_certify.certificate.request import Expectations, Request
from ptcc_certify.checker import SCHEMA, SLIDING_BOUND, SLIDING_CLOCK, CheckReport
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.reading import RejectedError, exact, triangle
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
    out = Writer(graph.labels, files)
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
        "paper": _write_paper(content),
        "lyapunov": {"functions": [_write_function(V, out) for V in content.functions]},
        "rates": {
            "paper": text(content.paper_rate),
            "diagonal": text(content.diagonal_rate),
            "proved": text(content.rate),
            "upper_bound": text(content.upper_bound),
        },
        "overshoot": _write_overshoot(content),
        "initial_state": out.state("start", content.initial_state),
        "sliding_variable": out.state("sigma", content.sigma0),
        "influence": influence,
        "final_state": final,
        "reaching_time": reaching_section(graph.labels, content.reaching),
        "input": effort_section(content.effort, out),
        "proof": [],
        "verdict": "",
    }
    if content.agents is not None:
        document["agents"] = agents_section(content.agents, out)
        if phases := phases_section(content.agents):
            document["phases"] = phases
        if instants := instants_section(content.agents):
            document["instants"] = instants
    if content.offsets is not None:
        document["formation"] = formation_section(content, content.offsets, final, out)
    if content.late is not None and content.late.says_something:
        document["messages"] = messages_section(content.late, out)
    if content.tracking is not None:
        document["leaders"] = leaders_section(content.tracking, out)
    document |= {"digest": "", "unverified": _write_unverified(content)}
    given = {(o.kind, o.of): _write_obligation(o, out) for o in content.witnesses}
    document, report = record(document, given, out.files, graph.n_nodes)
    return document, out.files, report


def read_document(
    path: Path, document: Mapping[str, Any], sha256: str, report: CheckReport, files: Mapping[str, bytes]
) -> dict[str, Any]:
    """Return the fields of a certificate that was accepted; the structure is computed anew from the edges."""
    graph = certificate_graph(document, files)
    structure, protocol, data = analyse(graph), read_protocol(document["protocol"]), Reader(graph.labels, files)
    proof = tuple(_read_obligation(step) for step in document["proof"])
    steps = {(step.kind, step.of): step for step in proof}
    paper, functions = document["paper"], document["lyapunov"]["functions"]
    functions = [
        _read_function(f"lyapunov.functions[{k}]", section, structure, data, steps)
        for k, section in enumerate(functions)
    ]
    lyapunov = next((replace(V, objective=paper["objective"]) for V in functions if V.kind == "paper"), None)
    initial_state, rho = data.state(document["initial_state"]), None
    if paper is not None and paper["rho_interval"] is not None:
        rho = ExactInterval(*(number(paper["rho_interval"][key]) for key in ("printed", "exact")))
    effort = read_effort(document, structure, protocol, data, steps)
    request = _read_request(document["unverified"], None if effort is None else effort.initial_set)
    request = replace(request, **read_unproved(document, structure))
    return {
        "structure": structure,
        "protocol": protocol,
        "initial_state": initial_state,
        "sigma0": data.state(document["sliding_variable"]),
        "reaching": read_reaching(document["reaching_time"], protocol),
        "lyapunov": lyapunov,
        "proof": RateProof(
            None if lyapunov is None else lyapunov.rate, tuple(o for o in proof if o.of.split(".")[0] == "paper"), rho
        ),
        "searched_functions": tuple(V for V in functions if V.kind != "paper"),
        "limit": _read_limit(steps, data),
        "final_state": read_final_state(document, structure, data),
        "matrix": None,
        "late": read_late(document, structure, protocol, data, steps)
        or nothing_proved(request, structure, protocol, initial_state is None),
        "tracking": read_tracking(document, structure, protocol, data, steps),
        "request": request,
        "observed": _read_observations(document["unverified"]),
        "source": Source(path, sha256, document, report, effort, files),
        "agents": read_agents(document, structure, protocol, functions),
        "offsets": data.state(document["formation"]["offsets"]) if "formation" in document else None,
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


def read_protocol(section: Mapping[str, Any]) -> Protocol:
    """Return the protocol of an accepted certificate."""
    parameters = {key: value for key, value in section.items() if key != "disturbance"}
    return Protocol.from_dict({key: value if key == "kind" else exact(value) for key, value in parameters.items()})


def reaching_section(labels: Sequence[str], reaching: Sequence[ReachingTime] | None) -> dict[str, Any] | None:
    """Return proved reaching times as files have them."""
    if reaching is None:
        return None
    times = {label: text(r.z) for label, r in zip(labels, reaching, strict=True)}
    return {"bound": SLIDING_BOUND, "clock": SLIDING_CLOCK, "z": times}


def read_reaching(section: Mapping[str, Any] | None, protocol: Protocol) -> tuple[ReachingTime, ...] | None:
    """Return the reaching times of an accepted certificate."""
    if section is None or protocol.reaching is None:
        return None
    return tuple(ReachingTime(protocol.reaching.T_r, number(z)) for z in section["z"].values())


# ---------------------------------------------------------------------- Lyapunov functions


def _write_paper(content: Content) -> dict[str, Any] | None:
    """Write the row of the theorem: its Lyapunov function, whether a rate of it was proved or not."""
    V, interval = content.lyapunov, content.proof.interval
    if V is None:
        return None
    return {
        "theorem": content.theorem.number,
        "objective": V.objective,
        "coordinates": V.coordinates,
        "blocks": [_write_block(block, Writer(content.graph.labels)) for block in V.blocks],
        "rho": text(V.rho),
        "rho_interval": interval and {"printed": text(interval.printed), "exact": text(interval.exact)},
        "rate": text(V.rate),
        "overshoot": format_exact(V.overshoot) if V.blocks else None,
    }


def _write_function(V: LyapunovFunction, out: Writer) -> dict[str, Any]:
    where = Writer(out.labels) if V.kind == "paper" else out  # as the section "paper" has it
    deviation = V.deviation and {
        "agents": dict(zip(out.labels, map(format_exact, V.deviation.agents), strict=True)),
        "norm": format_exact(V.deviation.norm),
    }
    return {
        "class": V.kind,
        "coordinates": V.coordinates,
        "blocks": [_write_block(block, where) for block in V.blocks],
        "rho": text(V.rho),
        "rate": text(V.rate),
        "overshoot": format_exact(V.overshoot),
        "deviation": deviation,
    }


def _read_function(
    name: str,
    section: Mapping[str, Any],
    structure: Structure,
    data: Reader,
    steps: Mapping[tuple[str, str], Obligation],
) -> LyapunovFunction:
    bound, full, rows = section["deviation"], steps.get(("overshoot", name)), steps.get(("dominance", name))
    blocks = tuple(_read_block(block, data, rows is not None) for block in section["blocks"])
    gauge = structure.closed_components[0].gauge if section["coordinates"] == "eps" else ()
    return LyapunovFunction(
        section["class"],
        section["coordinates"],
        blocks,
        number(section["rho"]),
        number(section["rate"]),
        None if full is None else (full.numbers["lowest"], full.numbers["highest"]),
        gauge or (),
        dominance=None if rows is None else Dominance(data.floats(rows.witness["vector"], len(blocks[0].nodes))),
        deviation=None if bound is None else DeviationBound(data.agents(bound["agents"]), exact(bound["norm"])),
        name=name,
    )


def _write_block(block: LyapunovBlock, out: Writer) -> dict[str, Any]:
    section: dict[str, Any] = {"name": block.name, "nodes": out.nodes(block.nodes)}
    if block.matrix is not None:
        section["lower_triangle"] = [[format_exact(x) for x in row[: i + 1]] for i, row in enumerate(block.matrix)]
    elif block.dyadic is not None:
        section["diagonal"] = out.floats("diagonal", block.dyadic)
    else:
        section["diagonal"] = [format_exact(w) for w in block.diagonal]
    return {**section, "times_rho": block.times_rho}


def _read_block(section: Mapping[str, Any], data: Reader, large: bool) -> LyapunovBlock:
    nodes = data.nodes(section["nodes"])
    if "lower_triangle" in section:
        return LyapunovBlock(section["name"], nodes, matrix=triangle(section["lower_triangle"], len(nodes)))
    if large:
        return LyapunovBlock(section["name"], nodes, dyadic=data.floats(section["diagonal"], len(nodes)))
    return LyapunovBlock(section["name"], nodes, tuple(map(exact, section["diagonal"])), section["times_rho"])


def _write_overshoot(content: Content) -> dict[str, Any] | None:
    if content.rate is None:
        return None
    V = content.fastest
    return {"value": format_exact(V.overshoot), "of": f"||{V.coordinates}||^2"}


def _read_limit(steps: Mapping[tuple[str, str], Obligation], data: Reader) -> RateBound | None:
    step = steps.get(("rate-upper-bound", "rates")) or steps.get(("rate-mean", "rates"))
    if step is None:
        return None
    value, section = step.numbers["upper_bound"], step.witness
    if "node" in section:
        return RateBound(value, data.nodes([section["node"]]))
    form, vectors = triangle(section["lower_triangle"], len(section["nodes"])), section["vectors"]
    return RateBound(value, data.nodes(section["nodes"]), form, tuple(tuple(map(exact, vector)) for vector in vectors))


# ---------------------------------------------------------------------- proof


def _write_obligation(obligation: Obligation, out: Writer) -> dict[str, Any]:
    """Return numbers and witness of one step of the proof."""
    witness = obligation.witness
    if isinstance(witness, Dominance):
        witness = _dominance_witness(witness, out)
    elif isinstance(witness, EnergyIntegral):
        witness = energy_witness(witness)
    elif isinstance(witness, Peak):
        witness = peak_witness(witness, out)
    elif isinstance(witness, Vectors):
        witness = witness.written(out)
    elif isinstance(witness, tuple):
        witness = {"u": dict(zip(out.labels, map(format_exact, witness), strict=True))}
    elif isinstance(witness, np.ndarray):
        by_label = zip(out.labels, map(float.hex, witness.tolist()), strict=True)
        witness = {"u": out.vector("u", witness) if out.aside(witness.size) else dict(by_label)}
    return {"numbers": {name: format_exact(value) for name, value in obligation.numbers.items()}, "witness": witness}


def _read_obligation(section: Mapping[str, Any]) -> Obligation:
    numbers = {name: exact(value) for name, value in section["numbers"].items()}
    return Obligation(section["kind"], section["of"], numbers, section["witness"])


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
            factor = factor_entry(group.factor, power, out, group.parents)
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
