"""The file of a family's certificate: modes, structures, claims, Lyapunov functions, bounds, and their proof."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.certificate.checking import record
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.format import producer, protocol_section, reaching_section
from ptcc_certify.certificate.format_family_rows import (
    Step,
    box_entry,
    form_entry,
    form_steps,
    range_entry,
    rows_entry,
    rows_steps,
    squares_entry,
    squares_steps,
)
from ptcc_certify.certificate.format_graph import structure_section
from ptcc_certify.certificate.format_restricted import claim_entry, claim_steps, enclosed
from ptcc_certify.certificate.format_upper_bound import upper_bound_entry
from ptcc_certify.certificate.format_vectors import Writer
from ptcc_certify.certificate.restricted_claims import Claim
from ptcc_certify.checker import NOT_OF_FAMILIES, SCHEMA, CheckReport
from ptcc_certify.checker.family import THEOREM
from ptcc_certify.checker.family_limits import EQUAL
from ptcc_certify.checker.reading import exact
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import BIPARTITE_CONTAINMENT, INTERVAL_BIPARTITE_CONSENSUS, analyse
from ptcc_certify.graphs.weights import Weights
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent


def family_document(
    certificate: FamilyContent, files: bool = True
) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
    """Return a certificate of a family as JSON-ready data, its side files, and what the check says of it."""
    out = Writer(certificate.family.labels, files)
    family, parts = certificate.family, certificate.parts
    components = [part.component for part in parts]
    functions = [(k, V) for k, part in enumerate(parts) for V in part.functions]
    finals, peaks, labels = certificate.final_states, certificate.input_peaks, family.labels
    drives = certificate.drives
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "producer": producer(),
        **family_sections(family, components, out),
        "protocol": protocol_section(certificate.protocol, certificate.disturbance),
        **dict.fromkeys(NOT_OF_FAMILIES),
        "lyapunov": {"functions": [_function(family, components[k], k, V, out) for k, V in functions]}
        | ({} if drives is None else {"drives": list(map(format_exact, drives))}),
        "initial_state": out.state("start", certificate.initial_state),
        "sliding_variable": out.state("sigma", certificate.sigma0),
        "reaching_time": reaching_section(labels, certificate.reaching),
        "final_state": None
        if finals is None
        else {label: None if ends is None else enclosed(*ends) for label, ends in zip(labels, finals, strict=True)},
        "input": {
            "bounded": certificate.bounded,
            "peaks": None if peaks is None else dict(zip(labels, map(_up, peaks), strict=True)),
            **_sliding_part(certificate),
        },
        "proof": [],
        "verdict": "",
    }
    if certificate.boxes or certificate.ranges:
        labelled = ((k, box, list(components[k].family.labels)) for k, box in sorted(certificate.boxes.items()))
        document["boxes"] = [box_entry(own, k, box, out) for k, box, own in labelled]
        document["boxes"] += [range_entry(k, ends) for k, ends in sorted(certificate.ranges.items())]
    if certificate.restricted:
        document["restricted"] = [claim_entry(claim, _labels(certificate, claim)) for claim in certificate.restricted]
    document |= {"digest": "", "unverified": _unverified(certificate)}
    steps = _steps(certificate, out)
    given = {(kind, of): {"numbers": numbers, "witness": witness} for kind, of, witness, numbers in steps}
    document, report = record(document, given, out.files, family.n_nodes)
    return document, out.files, report


def _function(family: Family, component: FamilyComponent, number: int, V: Any, out: Writer) -> dict[str, Any]:
    labels = [family.labels[v] for v in component.nodes.tolist()]
    if V.kind == "squares":
        return squares_entry(number, V, out)
    return rows_entry(labels, number, V, out) if V.kind == "rows" else form_entry(labels, number, V)


def _labels(certificate: FamilyContent, claim: Claim) -> Sequence[str]:
    return certificate.parts[claim.component].component.family.labels


def _sliding_part(certificate: FamilyContent) -> dict[str, Any]:
    """Write the sliding part of the input; nothing under the nominal protocol."""
    bounded, own = certificate.sliding_bounded, certificate.sliding_peaks
    if bounded is None:
        return {}
    agents = None if own is None else dict(zip(certificate.family.labels, map(_up, own), strict=True))
    return {"sliding": {"bounded": bounded, "agents": agents}}


def _up(x: Fraction) -> str:
    """Write a bound, rounded up to 60 bits or so."""
    return format_exact(rounded(x, 60, up=True))


def _steps(certificate: FamilyContent, out: Writer) -> Iterator[Step]:
    """Yield kind, place, witness and numbers of the obligations that have some, in any order."""
    components = [part.component for part in certificate.parts]
    functions: list[Any] = [V for part in certificate.parts for V in part.functions]
    yield "family-claim", "graph", claim_witnesses(certificate.family, components), {}
    for k, V in enumerate(functions):
        of = f"lyapunov.functions[{k}]"
        if V.kind == "squares":
            yield from squares_steps(of, V, out)
        else:
            yield from (rows_steps if V.kind == "rows" else form_steps)(of, V)
    if certificate.final_states is not None:
        yield "family-final-state", "final_state", _means(certificate), {}
    for k, claim in enumerate(certificate.restricted):
        yield from claim_steps(f"restricted[{k}]", claim, _labels(certificate, claim))


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
        "asked": {"behaviour": expectations.behaviour},
        "read": dict(certificate.family.read) or None,
        "origins": dict(certificate.origins),
        "scenario": certificate.scenario,
        "notes": list(certificate.notes),
    }


def family_sections(family: Family, components: Sequence[FamilyComponent], out: Writer | None = None) -> dict[str, Any]:
    """Return modes, the structure of their mandatory graphs, and the claim of every component."""
    out, labels = out or Writer(family.labels), family.labels
    structures = [structure_section(analyse(mode.mandatory), out) for mode in family.modes]
    claims = [{"theorem": THEOREM, "behaviour": c.behaviour, "signal": "any"} for c in components]
    sections: dict[str, Any] = {"graph": _modes(family, out), "structure": {"modes": structures}, "claim": claims[0]}
    if len(claims) > 1:
        nodes = [[labels[v] for v in c.nodes.tolist()] for c in components]
        sections["claim"] = None
        sections["components"] = [{"nodes": n, "claim": claim} for n, claim in zip(nodes, claims, strict=True)]
    return sections


def _modes(family: Family, out: Writer) -> dict[str, Any]:
    modes = [{"name": mode.name, "undirected": mode.tied, "edges": _edges(mode, out)} for mode in family.modes]
    return {"nodes": list(family.labels), "modes": modes, "sha256": family.sha256}


def _edges(mode: Mode, out: Writer) -> Any:
    labels = mode.labels
    if not out.aside(mode.n_edges) or mode.lower.table.dtype == object:
        columns = mode.source.tolist(), mode.target.tolist(), *mode.texts
        return [[labels[s], labels[t], *dict.fromkeys(ends)] for s, t, *ends in zip(*columns, strict=True)]
    ends = {}
    for key, below, above in (("least", mode.upper, mode.lower), ("largest", mode.lower, mode.upper)):
        values = np.where(mode.sign < 0, -below.table, above.table)
        ends[key] = out.vector(key, values) | ({"scale": str(mode.lower.scale)} if values.dtype.kind == "i" else {})
    source, target = out.vector("source", mode.source), out.vector("target", mode.target)
    return {"count": mode.n_edges, "source": source, "target": target, **ends}


def certificate_family(section: Mapping[str, Any], files: Mapping[str, bytes]) -> Family:
    """Return the family of an accepted certificate; ``files`` are its side files.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0)])
    >>> certificate_family(family_sections(family, decide(family))["graph"], {}) == family
    True
    """
    labels, modes, side = tuple(section["nodes"]), [], SideFiles(Path(), files)
    index = {label: v for v, label in enumerate(labels)}
    for mode in section["modes"]:
        rows = mode["edges"]
        if isinstance(rows, dict):
            source, target, *ends = _columns(rows, side)
        else:
            source, target = (np.array([index[row[k]] for row in rows], dtype=np.int64) for k in (0, 1))
            ends = [([exact(row[k]) for row in rows], np.arange(len(rows))) for k in (2, -1)]
        sign, lower, upper = _sizes(*ends)
        modes.append(Mode(labels, source, target, sign, lower, upper, name=mode["name"], tied=mode["undirected"]))
    return Family(tuple(modes))


def _columns(rows: Mapping[str, Any], files: SideFiles) -> tuple[Any, ...]:
    """Return sources and targets of edges in side files, and distinct values and their places of both ends."""
    names = ("source", "target", "least", "largest")
    entries = ({key: rows[name][key] for key in ("file", "sha256")} for name in names)
    source, target, *ends = (np.array(files.column(entry, rows["count"])) for entry in entries)
    distinct = []
    for name, column in zip(names[2:], ends, strict=True):
        values, codes = np.unique(column, return_inverse=True)
        scale = exact(rows[name].get("scale", "1"))
        distinct.append(([Fraction(x) / scale for x in values.tolist()], codes))
    return source, target, *distinct


def _sizes(least: tuple[list[Fraction], Any], largest: tuple[list[Fraction], Any]) -> tuple[np.ndarray, Any, Any]:
    """Return signs and bounds of sizes of weights between the values ``[codes]`` of two lists."""
    (low, below), (high, above) = least, largest
    m, above = len(below), above + len(low)
    positive = np.array([x > 0 for x in (*low, *high)], dtype=bool)[above]
    codes = np.concatenate([np.where(positive, below, above), np.where(positive, above, below)])
    both = Weights([abs(x) for x in (*low, *high)], codes)
    return np.where(positive, 1, -1).astype(np.int8), both.take(np.arange(m)), both.take(np.arange(m, 2 * m))


def claim_witnesses(family: Family, components: Sequence[FamilyComponent]) -> list[Any]:
    """Return what proves the claim of every component; None where its edges alone do."""
    first = analyse(family.modes[0].mandatory)
    number = {c.nodes[0]: k for k, c in enumerate(first.closed_components, start=1)}
    return [_witness(family, component, number) for component in components]


def _witness(family: Family, component: FamilyComponent, number: Mapping[int, int]) -> Any:
    nodes = component.nodes.tolist()
    labels = [family.labels[v] for v in nodes]
    if component.behaviour in (BIPARTITE_CONTAINMENT, INTERVAL_BIPARTITE_CONSENSUS):
        assert component.kernel is not None
        if not component.kernel.has_rows:
            return None
        structure = component.kernel.structure
        columns = [str(number[nodes[c.nodes[0]]]) for c in structure.closed_components if c.balanced]
        rows = {v: zip(columns, component.kernel.row(v), strict=True) for v in structure.followers.tolist()}
        return {"rows": {labels[v]: {j: format_exact(x) for j, x in row if x} for v, row in rows.items()}}
    why = component.counterexample
    if component.behaviour != DEPENDS or why is None or why.kind != "moving rest state":
        return None
    edge = None
    if why.edge is not None:
        mode = component.family.modes[why.other]
        edge = [labels[mode.source[why.edge]], labels[mode.target[why.edge]], int(mode.sign[why.edge])]
    state: dict[str, Any] = {}
    if why.state is not None:
        state = {label: format_exact(x) for label, x in zip(labels, why.state, strict=True) if x}
    elif (q := why.enclosure) is not None:
        for label, middle, radius in zip(labels, q.middle, q.radius, strict=True):
            if radius:
                state[label] = {"mid": format_exact(middle * q.unit), "radius": format_exact(radius * q.unit)}
            elif middle:
                state[label] = format_exact(middle * q.unit)
    return {"mode": why.mode, "other": why.other, "edge": edge, "state": state}
