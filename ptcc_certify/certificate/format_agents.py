"""The section ``agents`` of a certificate, written and read: section 21 of FORMAT.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from ptcc_certify.certificate.agents_part import AgentsPart, Residual, UsedFunction
from ptcc_certify.certificate.format_vectors import Writer, interval_text, number, text
from ptcc_certify.checker.reading import exact, interval, triangle
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.agents import AgentsProtocol
from ptcc_certify.theorems.agent_decrease import AgentMatrix

Section = Mapping[str, Any]


def agents_section(part: AgentsPart, out: Writer) -> dict[str, Any]:
    """Return the section ``agents``."""
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
        and _by_agent(out, [[list(map(interval_text, chain)) for chain in agent] for agent in part.final_state]),
        "residual": residual
        and {"clock": format_exact(residual.clock), "agents": _by_agent(out, list(map(_texts, residual.agents)))},
        "input": part.input
        and {"agents": _by_agent(out, _texts(part.input)), "largest": format_exact(max(part.input))},
    }


def _texts(values: Sequence[Fraction]) -> list[str]:
    return list(map(format_exact, values))


def _by_agent(out: Writer, values: Sequence[Any]) -> dict[str, Any]:
    return dict(zip(out.labels, values, strict=True))


def read_agents(
    section: Section | None, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsPart | None:
    """Read the section of an accepted certificate; None if it has none."""
    if section is None:
        return None
    plant, own, gains, points = (tuple(map(exact, section[key])) for key in ("plant", "own", "gains", "points"))
    W = tuple(map(tuple, triangle(section["lower_triangle"], section["order"])))
    matrix = AgentMatrix(W, exact(section["rate"]), points, exact(section["coupling"]), gains)
    offsets = tuple(tuple(map(exact, row)) for row in section["offsets"].values())
    protocol = AgentsProtocol(base, plant, own, gains, offsets, number(section["gain_cap"]))
    used = tuple(
        UsedFunction(one["function"], one["inputs"] and tuple(map(exact, one["inputs"].values())))
        for one in section["functions"]
    )
    begin, end, residual, bounds = (section[key] for key in ("initial_state", "final_state", "residual", "input"))
    return AgentsPart(
        structure,
        protocol,
        matrix,
        used,
        tuple(functions[one.number] for one in used),
        begin and tuple(tuple(tuple(map(exact, chain)) for chain in agent) for agent in begin.values()),
        tuple(tuple(map(interval, row)) for row in section["motion"]),
        end and tuple(tuple(tuple(map(interval, chain)) for chain in agent) for agent in end.values()),
        residual
        and Residual(exact(residual["clock"]), tuple(tuple(map(exact, row)) for row in residual["agents"].values())),
        bounds and tuple(map(exact, bounds["agents"].values())),
    )
