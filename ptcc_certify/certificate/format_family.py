"""The file of a family's certificate: modes, structures, claims, Lyapunov functions, bounds, and their proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.numbers import longest
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.format import producer, protocol_section, reaching_section
from ptcc_certify.certificate.format_family_rows import form_entry, form_steps, rows_entry, rows_steps
from ptcc_certify.certificate.format_graph import structure_section
from ptcc_certify.certificate.format_vectors import Writer
from ptcc_certify.checker import NOT_OF_FAMILIES, OBLIGATIONS, SCHEMA, digest
from ptcc_certify.checker.family import THEOREM
from ptcc_certify.checker.reading import exact
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.digraph import Weights
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import BIPARTITE_CONTAINMENT, INTERVAL_BIPARTITE_CONSENSUS, analyse
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent

#: Bits of the middles and radii of final states, which are rounded outwards.
_BITS = 64


def family_document(certificate: FamilyContent, files: bool = False) -> tuple[dict[str, Any], Writer]:
    """Return a certificate of a family as JSON-ready data, and what holds its side files."""
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
        else {label: None if ends is None else _enclosed(*ends) for label, ends in zip(labels, finals, strict=True)},
        "input": {
            "bounded": certificate.bounded,
            "peaks": None if peaks is None else dict(zip(labels, map(_up, peaks), strict=True)),
            **_sliding_part(certificate),
        },
        "proof": _proof(certificate, components, functions),
        "verdict": "certified",
    }
    return document | {"digest": digest(document), "unverified": _unverified(certificate)}, out


def _function(family: Family, component: FamilyComponent, number: int, V: Any, out: Writer) -> dict[str, Any]:
    labels = [family.labels[v] for v in component.nodes.tolist()]
    return rows_entry(labels, number, V, out) if V.kind == "rows" else form_entry(labels, number, V)


def _sliding_part(certificate: FamilyContent) -> dict[str, Any]:
    """Write the sliding part of the input; nothing under the nominal protocol."""
    bounded, own = certificate.sliding_bounded, certificate.sliding_peaks
    if bounded is None:
        return {}
    agents = None if own is None else dict(zip(certificate.family.labels, map(_up, own), strict=True))
    return {"sliding": {"bounded": bounded, "agents": agents}}


def _up(x: Fraction) -> str:
    """Write a bound, rounded up to 60 bits or so."""
    if not x:
        return "0"
    unit = Fraction(2) ** (longest([x.numerator]) - longest([x.denominator]) - 60)
    return format_exact(-(-x // unit) * unit)


def _enclosed(low: Fraction, high: Fraction) -> Any:
    """Write ends as a middle and a radius, rounded outwards."""
    if low == high:
        return format_exact(low)
    size = max(abs(low), abs(high))
    unit = Fraction(2) ** (longest([size.numerator]) - longest([size.denominator]) - _BITS)
    below, above = low // unit, -(-high // unit)
    return {"mid": format_exact((below + above) * unit / 2), "radius": format_exact((above - below) * unit / 2)}


def _proof(
    certificate: FamilyContent,
    components: Sequence[FamilyComponent],
    functions: Sequence[tuple[int, Any]],
) -> list[dict[str, Any]]:
    family = certificate.family
    steps = [_step("structure", f"graph.modes[{k}]") for k in range(len(family.modes))]
    steps.append(_step("family-claim", "graph", claim_witnesses(family, components)))
    for k, (_, V) in enumerate(functions):
        own = (rows_steps if V.kind == "rows" else form_steps)(f"lyapunov.functions[{k}]", V)
        steps += [_step(kind, of, witness, **numbers) for kind, of, witness, numbers in own]
    steps += [_step("sliding-bound", "protocol")] * (certificate.sigma0 is not None)
    if certificate.drives is not None:
        times = zip(certificate.reaching or (), certificate.sigma0 or (), strict=True)
        steps += [_step("reaching-time", "reaching_time")] * any(s and r.z is not None for r, s in times)
        steps += [_step("family-drive", f"lyapunov.functions[{k}]") for k in range(len(functions))]
    steps += [_step("family-final-state", "final_state")] * (certificate.final_states is not None)
    steps += [_step("input-sliding", "input")] * (certificate.sliding_peaks is not None)
    return steps + [_step("family-input", "input")] * (certificate.bounded is not None)


def _step(kind: str, of: str, witness: Any = None, **numbers: str) -> dict[str, Any]:
    proves, lemma = OBLIGATIONS[kind]
    return {"kind": kind, "of": of, "proves": proves, "lemma": lemma, "numbers": numbers, "witness": witness}


def _unverified(certificate: FamilyContent) -> dict[str, Any]:
    expectations = certificate.expectations
    bounds = [part.upper_bound for part in certificate.parts]
    return {
        "upper_bounds": [None if b is None else {"value": format_exact(b.value), "kind": b.kind} for b in bounds],
        "asked": {"behaviour": expectations.behaviour},
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


def certificate_family(section: Mapping[str, Any], folder: Path = Path()) -> Family:
    """Return the family of an accepted certificate; ``folder`` holds its side files.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0)])
    >>> certificate_family(family_sections(family, decide(family))["graph"]) == family
    True
    """
    labels, modes, files = tuple(section["nodes"]), [], SideFiles(folder, None)
    index = {label: v for v, label in enumerate(labels)}
    for mode in section["modes"]:
        rows = mode["edges"]
        if isinstance(rows, dict):
            count = rows["count"]
            source, target = (np.array(files.integers(rows[key], key, count)) for key in ("source", "target"))
            least, largest = (files.numbers(rows[key], key, count) for key in ("least", "largest"))
            ends = list(zip(least, largest, strict=True))
        else:
            source, target = (np.array([index[row[k]] for row in rows], dtype=np.int64) for k in (0, 1))
            ends = [(exact(row[2]), exact(row[-1])) for row in rows]
        sign = np.array([1 if high > 0 else -1 for _, high in ends], dtype=np.int8)
        sizes = [sorted(map(abs, pair)) for pair in ends]
        both, m = Weights([low for low, _ in sizes] + [high for _, high in sizes]), len(ends)
        bounds = both.take(np.arange(m)), both.take(np.arange(m, 2 * m))
        modes.append(Mode(labels, source, target, sign, *bounds, name=mode["name"], tied=mode["undirected"]))
    return Family(tuple(modes))


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
