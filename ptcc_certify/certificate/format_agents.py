"""The section ``agents`` of a certificate, written and read: section 21 of FORMAT.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.cascade import Roots, initial_rows, root_of
from ptcc_certify.certificate.agents_answer import AgentsAnswer, Residual, UsedFunction
from ptcc_certify.certificate.agents_part import AgentsPart
from ptcc_certify.certificate.cascade_part import CascadePart
from ptcc_certify.certificate.format_vectors import Interval, Writer, interval_text, number, text
from ptcc_certify.checker.reading import exact, interval, triangle
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.agents_protocol import AgentsProtocol
from ptcc_certify.protocols.cascade import CascadeProtocol
from ptcc_certify.theorems.agent_decrease import AgentMatrix, Phase

Section = Mapping[str, Any]
#: Bits of numerator and denominator up to which an enclosed final state is written as it is.
_SHORT_BITS = 256


def agents_section(part: AgentsAnswer, out: Writer) -> dict[str, Any]:
    """Return the section ``agents``."""
    writers: dict[type, Callable[[Any, Writer], dict[str, Any]]] = {
        AgentsPart: _section_of_matrix,
        CascadePart: _section_of_cascade,
    }
    return writers[type(part)](part, out)


def _section_of_matrix(part: AgentsPart, out: Writer) -> dict[str, Any]:
    protocol, matrix, residual = part.protocol, part.matrix, part.residual
    return {
        "order": part.order,
        "dimension": part.dimension,
        "plant": _texts(protocol.plant),
        "own": _texts(protocol.own),
        "gains": _texts(protocol.gains),
        "coupling": format_exact(matrix.coupling),
        "lower_triangle": [_texts(row[: i + 1]) for i, row in enumerate(matrix.W)],
        "rate": format_exact(matrix.rate),
        "gain_cap": text(protocol.gain_cap),
        "points": _texts(matrix.points),
        "functions": [{"function": one.number, "inputs": out.state("inputs", one.inputs)} for one in part.used],
        "offsets": _by_agent(out, [_texts(row) for row in protocol.offsets]),
        "initial_state": part.initial_state
        and _by_agent(out, [[_texts(chain) for chain in agent] for agent in part.initial_state]),
        "motion": [list(map(interval_text, row)) for row in part.motion],
        "final_state": part.final_state
        and _by_agent(out, [[list(map(_end_text, chain)) for chain in agent] for agent in part.final_state]),
        "residual": residual
        and {"clock": format_exact(residual.clock), "agents": _by_agent(out, list(map(_texts, residual.agents)))},
        "input": part.input
        and {"agents": _by_agent(out, _texts(part.input)), "largest": format_exact(max(part.input))},
    }


def _section_of_cascade(part: CascadePart, out: Writer) -> dict[str, Any]:
    used = [{"function": one.number, "inputs": out.state("inputs", one.inputs)} for one in part.used]
    known = part.initial_state is not None
    roots = [{"initial": format_exact(root.state), "drive": format_exact(root.drive)} for root in part.roots]
    absent = {"initial": None, "drive": None}
    begin, final, bounds = part.initial_state, part.final_state, part.input
    return {
        "cascade": format_exact(part.alpha),
        "dimension": part.dimension,
        "functions": [one | (roots[k] if known else absent) for k, one in enumerate(used)],
        "offsets": _by_agent(out, [_texts(row) for row in part.protocol.offsets]),
        "initial_state": begin and _by_agent(out, [[_texts(chain) for chain in agent] for agent in begin]),
        "motion": [list(map(interval_text, row)) for row in part.motion],
        "final_state": final and _by_agent(out, [[list(map(_end_text, chain)) for chain in agent] for agent in final]),
        "input": bounds and {"agents": _by_agent(out, _texts(bounds)), "largest": format_exact(max(bounds))},
    }


def _end_text(end: Interval) -> str | dict[str, str]:
    """Write an interval: as it is where its numbers are short, as in large graphs; else as a ball around it."""
    short = all(max(x.numerator.bit_length(), x.denominator.bit_length()) <= _SHORT_BITS for x in end)
    if end[1] and short:
        return {"mid": format_exact(end[0]), "radius": format_exact(end[1])}
    return interval_text(end)


def _texts(values: Sequence[Fraction]) -> list[str]:
    return list(map(format_exact, values))


def _by_agent(out: Writer, values: Sequence[Any]) -> dict[str, Any]:
    return dict(zip(out.labels, values, strict=True))


def read_agents(
    document: Section, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsAnswer | None:
    """Read the section of an accepted certificate, and its phases; None if it has none."""
    section = document.get("agents")
    if section is None:
        return None
    if "cascade" in section:
        return _read_cascade(section, structure, base, functions)
    phases = tuple(map(_read_phase, document.get("phases", ())))
    return replace(_read_matrix(section, structure, base, functions), phases=phases)


def phases_section(part: AgentsAnswer | None) -> list[dict[str, Any]]:
    """Return the section ``phases``; empty without phases."""
    return [
        {
            "function": phase.function,
            "rate": format_exact(phase.rate),
            "coupling": format_exact(phase.coupling),
            "lower_triangle": [_texts(row[: i + 1]) for i, row in enumerate(phase.W)],
            "points": _texts(phase.points),
        }
        for phase in getattr(part, "phases", ())
    ]


def _read_phase(entry: Section) -> Phase:
    W = tuple(map(tuple, triangle(entry["lower_triangle"], len(entry["lower_triangle"]))))
    points = tuple(map(exact, entry["points"]))
    return Phase(entry["function"], W, exact(entry["rate"]), exact(entry["coupling"]), points)


def _read_cascade(
    section: Section, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> CascadePart:
    entries, alpha, offsets = section["functions"], exact(section["cascade"]), _offsets(section)
    used, begin = [functions[one["function"]] for one in entries], _states(section["initial_state"], exact)
    roots = list[Roots]()
    if begin is not None:
        rows = initial_rows(structure, begin, offsets, base.gain, alpha)[2:]
        for one, V in zip(entries, used, strict=True):
            roots.append(Roots(exact(one["initial"]), exact(one["drive"]), *(root_of(structure, V, x) for x in rows)))
    return CascadePart(
        structure,
        CascadeProtocol.of(base, alpha, offsets),
        _used(section),
        tuple(used),
        tuple(roots),
        begin,
        tuple(tuple(map(interval, row)) for row in section["motion"]),
        _states(section["final_state"], interval),
        _bounds(section),
    )


def _used(section: Section) -> tuple[UsedFunction, ...]:
    return tuple(
        UsedFunction(one["function"], one["inputs"] and tuple(map(exact, one["inputs"].values())))
        for one in section["functions"]
    )


def _offsets(section: Section) -> tuple[tuple[Fraction, ...], ...]:
    return tuple(tuple(map(exact, row)) for row in section["offsets"].values())


def _states(section: Section | None, read: Callable[[Any], Any]) -> tuple[tuple[tuple[Any, ...], ...], ...] | None:
    if section is None:
        return None
    return tuple(tuple(tuple(map(read, chain)) for chain in agent) for agent in section.values())


def _bounds(section: Section) -> tuple[Fraction, ...] | None:
    bounds = section["input"]
    return bounds and tuple(map(exact, bounds["agents"].values()))


def _read_matrix(
    section: Section, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsPart:
    plant, own, gains, points = (tuple(map(exact, section[key])) for key in ("plant", "own", "gains", "points"))
    W = tuple(map(tuple, triangle(section["lower_triangle"], section["order"])))
    matrix = AgentMatrix(W, exact(section["rate"]), points, exact(section["coupling"]), gains)
    protocol = AgentsProtocol(base, plant, own, gains, _offsets(section), number(section["gain_cap"]))
    used, residual = _used(section), section["residual"]
    return AgentsPart(
        structure,
        protocol,
        matrix,
        used,
        tuple(functions[one.number] for one in used),
        _states(section["initial_state"], exact),
        tuple(tuple(map(interval, row)) for row in section["motion"]),
        _states(section["final_state"], interval),
        residual
        and Residual(exact(residual["clock"]), tuple(tuple(map(exact, row)) for row in residual["agents"].values())),
        _bounds(section),
    )
