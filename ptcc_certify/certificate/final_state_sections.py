"""Influence of the leaders and final states in a certificate's file: exact, or in balls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from ptcc_certify.bounds.final_state.enclosed_ends import agents_ends, influence_balls
from ptcc_certify.bounds.final_state.of_graph import FinalState, Influence, rounding_radius
from ptcc_certify.bounds.float_conversion import numbers
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.proof import Proof
from ptcc_certify.certificate.section_io import LONG, Writer, exact_or_ball, interval_text
from ptcc_certify.checker.final_state import FormationSection, InfluenceSection, LeftNullVector
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.reading import Interval, exact, interval
from ptcc_certify.checker.side_files import Numbers, beside
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure


def final_state_sections(proof: GraphProof, out: Writer) -> tuple[InfluenceSection | None, dict[str, Any] | None]:
    """Return the influence of every leader, and the final state, exact or in balls; None if they are floating point."""
    if proof.influence.exact:
        return _exact_final_state(proof)
    return (None, None) if proof.influence.enclosure is None else _enclose_final_state(proof, out)


def _exact_final_state(proof: GraphProof) -> tuple[InfluenceSection, dict[str, Any] | None]:
    matrix, labels = proof.influence, proof.graph.labels
    left_null_vectors, containment_weights = influence_balls(matrix)
    ends: dict[str, Any] | None = None
    if proof.final_state is not None and proof.initial_state is not None:
        sigma0 = proof.sigma0 or [Fraction(0)] * len(labels)
        first = [x - s for x, s in zip(proof.initial_state, sigma0, strict=True)]
        ends = dict(zip(labels, _exact_texts(matrix, first), strict=True))
    groups = zip(matrix.balanced, left_null_vectors, strict=True)
    section = InfluenceSection(
        components=[LeftNullVector(nodes=c.nodes, left_null_vector=null_vector) for c, null_vector in groups],
        containment_weights=containment_weights,
        degenerate=None if ends is None else list(proof.degenerate),
    )
    return section, ends


def _enclose_final_state(proof: GraphProof, out: Writer) -> tuple[InfluenceSection, dict[str, Any] | None]:
    """Write the final state of a large graph: left null vectors of leader groups, and its intervals."""
    labels, matrix, final_state = proof.graph.labels, proof.influence, proof.final_state
    assert matrix.enclosure is not None
    final: dict[str, Any] | None = None
    if final_state is not None and final_state.radius is not None:
        if out.aside(len(labels)) and all(isinstance(x, float) or r == 0 for x, r in _pairs(final_state)):
            radius = [float(r) if isinstance(x, float) else rounding_radius(x) for x, r in _pairs(final_state)]
            final = {
                "mid": out.vector("mid", np.asarray(final_state)),
                "radius": out.vector("radius", np.array(radius)),
            }
        else:
            final = dict(zip(labels, _texts(final_state), strict=True))
    groups = []
    for k, (component, null_vector) in enumerate(matrix.groups):
        if len(component.nodes) == 1:
            continue
        values: Sequence[Interval] = [(Fraction(w), Fraction(0)) for w in null_vector]
        if k in matrix.enclosure.left_null_vectors:
            pairs = zip(*(x.tolist() for x in matrix.enclosure.left_null_vectors[k]), strict=True)
            values = [(exact(repr(x)), exact(repr(r))) for x, r in pairs]
        groups.append(LeftNullVector(nodes=component.nodes, left_null_vector=values))
    degenerate = None if final_state is None else list(final_state.degenerate)
    return InfluenceSection(components=groups, containment_weights=None, degenerate=degenerate), final


def formation_section(proof: Proof, offsets: Sequence[Fraction], final: Mapping[str, Any] | None) -> FormationSection:
    """Return the places of a formation, and where its agents begin, of one graph also where they end.

    ``final`` is where they end less these.
    """
    ends = None
    if isinstance(proof, GraphProof) and final is not None and proof.final_state is not None:
        pairs: Sequence[Interval] = proof.final_state.intervals or ()
        if not beside(final.get("mid")):
            pairs = list(map(interval, final.values()))
        placed = [(x + h, r) for (x, r), h in zip(pairs, offsets, strict=True)]
        ends = Numbers([x for x, _ in placed]), Numbers([r for _, r in placed])
    positions = numbers(proof.initial_positions)
    return FormationSection(offsets=Numbers(offsets), initial_state=positions, final_state=ends)


def stated_ends(
    matrix: Influence, final_state: FinalState | None, begin: Sequence[Fraction] | None
) -> Sequence[Interval] | None:
    """Return the final state as a file states it, which what is proved of it must rest on; None if nothing is proved.

    A float is the decimal that its text is, a rational that is too long for a text an interval.

    Parameters
    ----------
    matrix : Influence
    final_state : FinalState or None
    begin : sequence of N Fraction, or None
        ``X(0) - sigma(0)``.

    Examples
    --------
    >>> from ptcc_certify.bounds.final_state.of_graph import enclose, enclosed_final_state
    >>> graph = SignedDigraph.from_edges([("a", "c", 1), ("b", "c", 9)])
    >>> matrix = enclose(influence(graph, exact=False))
    >>> begin = [Fraction(1), Fraction(0), Fraction(0)]
    >>> stated_ends(matrix, enclosed_final_state(matrix, begin), begin)[1][0]  # of c, no float
    Fraction(1, 10)
    """
    if final_state is None or begin is None or final_state.intervals is None:
        return None
    if len(begin) > LONG:
        return final_state.intervals
    return [interval(x) for x in (_exact_texts(matrix, begin) if matrix.exact else _texts(final_state))]


def _exact_texts(matrix: Influence, begin: Sequence[Fraction]) -> list[str | dict[str, str]]:
    """Write the final state of a small graph."""
    return [interval_text(x) for x in agents_ends(matrix, [(x, Fraction(0)) for x in begin])]


def _pairs(final_state: FinalState) -> zip[tuple[Fraction | float, Fraction]]:
    """Return middle and radius of every agent."""
    return zip(final_state.states, final_state.radius or [Fraction(0)] * len(final_state), strict=True)


def _texts(final_state: FinalState) -> list[str | dict[str, str]]:
    """Write the intervals of a final state; many floats as the dyadic numbers that they are in a side file, too."""
    digits = repr if len(final_state) <= LONG else float.hex
    return [
        exact_or_ball(Fraction(x))
        if r == 0
        else {"mid": digits(x), "radius": digits(float(r))}
        if isinstance(x, float)
        else {"mid": format_exact(x), "radius": format_exact(r)}
        for x, r in _pairs(final_state)
    ]


def read_final_state(report: CheckReport, structure: Structure) -> FinalState | None:
    """Return where the agents end; None if the certificate does not say."""
    final = report.sections["final_state"]
    if final is None:
        return None
    middle, radius = map(tuple, final)
    values = [middle[c.nodes[0]] * (c.gauge or (1,))[0] for c in structure.closed_components if c.balanced]
    degenerate, spread = tuple(report.sections["influence"].degenerate), radius if any(radius) else None
    return FinalState(structure.graph.labels, middle, tuple(values), degenerate, spread)
