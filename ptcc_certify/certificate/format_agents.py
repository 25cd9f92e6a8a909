"""The sections ``agents`` and ``phases`` of a certificate, written and read: section 21 of FORMAT.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.cascade import Roots, initial_rows, root_of
from ptcc_certify.certificate.agents_answer import AgentsAnswer, Residual, UsedFunction
from ptcc_certify.certificate.agents_part import AgentsPart
from ptcc_certify.certificate.cascade_part import CascadePart
from ptcc_certify.certificate.format_vectors import fractions, numbers
from ptcc_certify.checker.agent_bounds import AgentsInput, ResidualSection, UsedSection
from ptcc_certify.checker.agent_cascade import CascadeSection, TrackedSection
from ptcc_certify.checker.agent_decrease import PhaseSection
from ptcc_certify.checker.agents import AgentsSection
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.agents import AgentsProtocol
from ptcc_certify.protocols.cascade import CascadeProtocol
from ptcc_certify.theorems.agent_decrease import AgentMatrix, Phase


def agents_section(part: AgentsAnswer) -> AgentsSection | CascadeSection:
    """Return the section ``agents``."""
    bounds = None if part.input is None else AgentsInput(agents=Numbers(part.input), largest=max(part.input))
    if isinstance(part, CascadePart):
        return _cascade_section(part, bounds)
    assert isinstance(part, AgentsPart)
    protocol, matrix, residual = part.protocol, part.matrix, part.residual
    return AgentsSection(
        order=part.order,
        dimension=part.dimension,
        plant=protocol.plant,
        own=protocol.own,
        gains=protocol.gains,
        coupling=matrix.coupling,
        lower_triangle=matrix.W,
        rate=matrix.rate,
        gain_cap=protocol.gain_cap,
        points=matrix.points,
        functions=[UsedSection(function=one.number, inputs=numbers(one.inputs)) for one in part.used],
        offsets=protocol.offsets,
        initial_state=part.initial_state,
        motion=part.motion,
        final_state=part.final_state,
        residual=None if residual is None else ResidualSection(clock=residual.clock, agents=residual.agents),
        input=bounds,
    )


def _cascade_section(part: CascadePart, bounds: AgentsInput | None) -> CascadeSection:
    roots: Sequence[Any] = part.roots if part.initial_state is not None else [None] * len(part.used)
    pairs = zip(part.used, roots, strict=True)
    return CascadeSection(
        cascade=part.alpha,
        dimension=part.dimension,
        functions=[
            TrackedSection(
                function=one.number,
                inputs=numbers(one.inputs),
                initial=None if root is None else root.state,
                drive=None if root is None else root.drive,
            )
            for one, root in pairs
        ],
        offsets=part.protocol.offsets,
        initial_state=part.initial_state,
        motion=part.motion,
        final_state=part.final_state,
        input=bounds,
    )


def phases_section(part: AgentsAnswer) -> list[PhaseSection]:
    """Return the section ``phases``; empty without phases."""
    return [
        PhaseSection(function=p.function, rate=p.rate, coupling=p.coupling, lower_triangle=p.W, points=p.points)
        for p in getattr(part, "phases", ())
    ]


def read_agents(
    report: CheckReport, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsAnswer | None:
    """Return what an accepted certificate says of agents, with its phases; None if it says nothing."""
    section: AgentsSection | CascadeSection | None = report.sections.get("agents")
    if section is None:
        return None
    if isinstance(section, CascadeSection):
        return _read_cascade(section, structure, base, functions)
    phases = tuple(
        Phase(p.function, _rows(p.lower_triangle), p.rate, p.coupling, tuple(p.points))
        for p in report.sections.get("phases", ())
    )
    return replace(_read_matrix(section, structure, base, functions), phases=phases)


def _read_cascade(
    section: CascadeSection, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> CascadePart:
    alpha, offsets, begin = section.cascade, _rows(section.offsets), _states(section.initial_state)
    used, roots = [functions[one.function] for one in section.functions], list[Roots]()
    if begin is not None:
        rows = initial_rows(structure, begin, offsets, base.gain, alpha)[2:]
        for one, V in zip(section.functions, used, strict=True):
            told = one.initial or Fraction(0), one.drive or Fraction(0)
            roots.append(Roots(*told, *(root_of(structure, V, x) for x in rows)))
    return CascadePart(
        structure,
        CascadeProtocol.of(base, alpha, offsets),
        _used(section.functions),
        tuple(used),
        tuple(roots),
        begin,
        _rows(section.motion),
        _states(section.final_state),
        _bounds(section.input),
    )


def _used(functions: Sequence[UsedSection]) -> tuple[UsedFunction, ...]:
    return tuple(UsedFunction(one.function, fractions(one.inputs)) for one in functions)


def _rows(rows: Sequence[Sequence[Any]]) -> tuple[tuple[Any, ...], ...]:
    return tuple(map(tuple, rows))


def _states(states: Sequence[Sequence[Sequence[Any]]] | None) -> tuple[tuple[tuple[Any, ...], ...], ...] | None:
    return None if states is None else tuple(map(_rows, states))


def _bounds(section: AgentsInput | None) -> tuple[Fraction, ...] | None:
    return None if section is None else tuple(section.agents)


def _read_matrix(
    section: AgentsSection, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsPart:
    plant, own, gains, points = map(tuple, (section.plant, section.own, section.gains, section.points))
    matrix = AgentMatrix(_rows(section.lower_triangle), section.rate, points, section.coupling, gains)
    protocol = AgentsProtocol(base, plant, own, gains, _rows(section.offsets), section.gain_cap)
    used, residual = _used(section.functions), section.residual
    return AgentsPart(
        structure,
        protocol,
        matrix,
        used,
        tuple(functions[one.number] for one in used),
        _states(section.initial_state),
        _rows(section.motion),
        _states(section.final_state),
        None if residual is None else Residual(residual.clock, _rows(residual.agents)),
        _bounds(section.input),
    )
