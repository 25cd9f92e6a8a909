"""Modes, structures and claims of a family in a certificate's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ptcc_certify.certificate.format_graph import structure_section
from ptcc_certify.certificate.format_vectors import Writer
from ptcc_certify.checker.family import THEOREM
from ptcc_certify.checker.reading import exact
from ptcc_certify.graphs.digraph import Weights
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import BIPARTITE_CONTAINMENT, INTERVAL_BIPARTITE_CONSENSUS, analyse
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent


def family_sections(family: Family, components: Sequence[FamilyComponent]) -> dict[str, Any]:
    """Return modes, the structure of their mandatory graphs, and the claim of every component."""
    out, labels = Writer(family.labels), family.labels
    structures = [structure_section(analyse(mode.mandatory), out) for mode in family.modes]
    claims = [{"theorem": THEOREM, "behaviour": c.behaviour, "signal": "any"} for c in components]
    sections: dict[str, Any] = {"graph": _modes(family), "structure": {"modes": structures}, "claim": claims[0]}
    if len(claims) > 1:
        nodes = [[labels[v] for v in c.nodes.tolist()] for c in components]
        sections["claim"] = None
        sections["components"] = [{"nodes": n, "claim": claim} for n, claim in zip(nodes, claims, strict=True)]
    return sections


def _modes(family: Family) -> dict[str, Any]:
    labels, modes = family.labels, []
    for mode in family.modes:
        columns = mode.source.tolist(), mode.target.tolist(), *mode.texts
        edges = [[labels[s], labels[t], *dict.fromkeys(ends)] for s, t, *ends in zip(*columns, strict=True)]
        modes.append({"name": mode.name, "undirected": mode.tied, "edges": edges})
    return {"nodes": list(labels), "modes": modes, "sha256": family.sha256}


def read_family(section: Mapping[str, Any]) -> Family:
    """Return the family of an accepted certificate.

    Examples
    --------
    >>> family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0)])
    >>> read_family(family_sections(family, decide(family))["graph"]) == family
    True
    """
    labels, modes = tuple(section["nodes"]), []
    index = {label: v for v, label in enumerate(labels)}
    for mode in section["modes"]:
        rows = mode["edges"]
        source, target = (np.array([index[row[k]] for row in rows], dtype=np.int64) for k in (0, 1))
        ends = [(exact(row[2]), exact(row[-1])) for row in rows]
        sign = np.array([1 if high > 0 else -1 for _, high in ends], dtype=np.int8)
        sizes = [sorted(map(abs, pair)) for pair in ends]
        both, m = Weights([low for low, _ in sizes] + [high for _, high in sizes]), len(rows)
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
    state = {label: format_exact(x) for label, x in zip(labels, why.state or (), strict=True) if x}
    return {"mode": why.mode, "other": why.other, "edge": edge, "state": state}
