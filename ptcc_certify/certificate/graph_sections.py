"""Graph, structure, claim and final states in a certificate's file, and what ``ptcc classify`` prints of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify.bounds.final_state.enclosed_ends import agents_ends, influence_balls
from ptcc_certify.bounds.final_state.of_graph import FinalState, Influence, rounding_radius
from ptcc_certify.bounds.float_conversion import numbers
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.request import Proof
from ptcc_certify.certificate.section_io import LONG, Writer, exact_or_ball, interval_text
from ptcc_certify.checker import MANY_COMPONENTS
from ptcc_certify.checker.family import THEOREM
from ptcc_certify.checker.final_state import FormationSection, InfluenceSection, LeftNullVector
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.reading import Interval, exact, interval
from ptcc_certify.checker.side_files import Numbers, SideFiles, beside
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.reading import RECORDED
from ptcc_certify.graphs.structure import BIPARTITE_CONTAINMENT, INTERVAL_BIPARTITE_CONSENSUS, Structure, analyse
from ptcc_certify.theorems.agreeing_groups import FamilyGroups
from ptcc_certify.theorems.claims import Claim
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, counterexample_text, mode_name


def structure_document(structure: Structure) -> dict[str, Any]:
    """Return graph, structure and claim as JSON-ready data, in the keys of a certificate."""
    claims = [component.claim for component in structure.components]
    out = Writer(structure.graph.labels)
    problem = {"graph": graph_section(structure.graph, out)}
    data = {"problem": problem, "structure": [structure_section(structure, out)]}
    return data | claim_sections(structure, claims, None, out)


def graph_section(graph: SignedDigraph, out: Writer) -> dict[str, Any]:
    """Return nodes, the one mode, and how edges were read."""
    read, (table, scale) = graph.read, graph.weight_table()
    edges: Any
    if out.aside(graph.n_edges) and table is not None:
        edges = {
            "count": graph.n_edges,
            "scale": str(scale),
            "source": out.file("source", graph.source),
            "target": out.file("target", graph.target),
            "weight": out.file("weight", table),
        }
    else:
        edges = [
            [graph.labels[s], graph.labels[t], w]
            for s, t, w in zip(graph.source.tolist(), graph.target.tolist(), graph.weight_texts, strict=True)
        ]
    return {
        "nodes": list(graph.labels),
        "modes": [{"edges": edges}],
        "read": {key: read[key] for key in RECORDED if key in read},
        "sha256": graph.sha256,
    }


def certificate_graph(document: Mapping[str, Any], files: Mapping[str, bytes]) -> SignedDigraph:
    """Return the graph of an accepted certificate.

    Parameters
    ----------
    document : mapping
        The parsed JSON.
    files : mapping of str to bytes
        Its side files.

    Returns
    -------
    SignedDigraph

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> document = certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), asks=Asks(simulation=False)).to_dict()
    >>> certificate_graph(document, {}) == foes
    True
    """
    section, side = document["problem"]["graph"], SideFiles(Path(), files)
    labels, edges = section["nodes"], section["modes"][0]["edges"]
    if isinstance(edges, dict):
        source, target, weight = (
            np.array(side.column(edges[key], edges["count"])) for key in ("source", "target", "weight")
        )
        scale = exact(edges["scale"])
        values, codes = np.unique(weight, return_inverse=True)
        weights = Weights([Fraction(x) / scale for x in values.tolist()], codes)
    else:
        index = {label: i for i, label in enumerate(labels)}
        source = np.array([index[s] for s, _, _ in edges], dtype=np.int64)
        target = np.array([index[t] for _, t, _ in edges], dtype=np.int64)
        weights = Weights([exact(w) for _, _, w in edges])
    return SignedDigraph(labels, source, target, weights, section["read"])


def structure_section(structure: Structure, out: Writer) -> dict[str, Any]:
    """Return components with the witnesses of their balance."""
    labels = structure.graph.labels
    closed = []
    for component in structure.closed_components:
        entry: dict[str, Any] = {"nodes": [labels[v] for v in component.nodes], "balanced": component.balanced}
        if component.gauge is not None:
            entry["gauge"] = list(component.gauge)
        if component.negative_cycle is not None:
            entry["negative_cycle"] = [[labels[s], labels[t]] for s, t in component.negative_cycle]
        closed.append(entry)
    return {
        "connectivity": structure.connectivity,
        "closed_components": closed,
        "leaders": out.nodes(structure.leaders),
        "followers": out.nodes(structure.followers),
        "balanced": structure.balanced,
        "sign_symmetric": structure.sign_symmetric,
    }


def claim_sections(
    structure: Structure, claims: Sequence[Claim], final: Mapping[str, Any] | None, out: Writer
) -> dict[str, Any]:
    """Return theorem, behaviour and corollaries; of a disconnected graph those of every weak component."""
    if len(claims) == 1:
        return {"claim": _claim(claims[0])}
    return {"components": _components(structure, claims, final, out)}


def _claim(claim: Claim) -> dict[str, Any]:
    return {"theorem": claim.theorem, "behaviour": claim.behaviour, "corollaries": list(claim.corollaries)}


def _components(structure: Structure, claims: Sequence[Claim], final: Mapping[str, Any] | None, out: Writer) -> Any:
    """Return connectivity, claim and final state of every weak component, in arrays if there are many."""
    components, labels = structure.components, structure.graph.labels
    if len(components) > MANY_COMPONENTS:
        return {
            "nodes": out.vector("component", structure.weak_component)
            if out.aside(len(labels))
            else [[labels[v] for v in c.nodes] for c in components],
            "connectivity": [c.connectivity for c in components],
            "theorem": [claim.theorem for claim in claims],
            "behaviour": [claim.behaviour for claim in claims],
            "corollaries": [list(claim.corollaries) for claim in claims],
        }
    if final is not None and len(final) != len(labels):  # in side files
        final = None
    return [
        {
            "nodes": [labels[v] for v in c.nodes],
            "connectivity": c.connectivity,
            "claim": _claim(claim),
            **({"final_state": {labels[v]: final[labels[v]] for v in c.nodes}} if final else {}),
        }
        for c, claim in zip(components, claims, strict=True)
    ]


def family_claim_sections(family: Family, components: Sequence[FamilyComponent], out: Writer) -> dict[str, Any]:
    """Return the structure of the mandatory graph of every mode, and the claim of every component."""
    labels = family.labels
    structures = [structure_section(analyse(mode.mandatory), out) for mode in family.modes]
    claims = [{"theorem": THEOREM, "behaviour": c.behaviour} for c in components]
    if len(claims) == 1:
        return {"structure": structures, "claim": claims[0]}
    nodes = [[labels[v] for v in c.nodes.tolist()] for c in components]
    parts = [{"nodes": n, "claim": claim} for n, claim in zip(nodes, claims, strict=True)]
    return {"structure": structures, "components": parts}


def family_section(family: Family, out: Writer) -> dict[str, Any]:
    """Return nodes and modes."""
    modes = [
        {"name": mode.name, **({"undirected": True} if mode.tied else {}), "edges": _edges(mode, out)}
        for mode in family.modes
    ]
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
    >>> family = Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, 0)])
    >>> certificate_family(family_section(family, Writer(family.labels)), {}) == family
    True
    """
    labels = tuple(section["nodes"])
    modes = []
    side = SideFiles(Path(), files)
    index = {label: v for v, label in enumerate(labels)}
    for mode in section["modes"]:
        rows = mode["edges"]
        if isinstance(rows, dict):
            source, target, *ends = _columns(rows, side)
        else:
            source, target = (np.array([index[row[k]] for row in rows], dtype=np.int64) for k in (0, 1))
            ends = [([exact(row[k]) for row in rows], np.arange(len(rows))) for k in (2, -1)]
        sign, lower, upper = _sizes(*ends)
        tied = "undirected" in mode
        modes.append(Mode(labels, source, target, sign, lower, upper, name=mode["name"], tied=tied))
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
    return {"mode": why.mode, "other": why.other, **({"edge": edge} if edge else {}), "state": state}


def decision_document(family: Family, components: Sequence[FamilyComponent]) -> dict[str, Any]:
    """Return a decision as JSON-ready data.

    Examples
    --------
    >>> family = Family.from_intervals([("a", "b", 1, 2)])
    >>> decision_document(family, ptcc.decide(family))["components"][0]["behaviour"]
    'bipartite consensus'
    """
    modes = [
        {
            "name": mode_name(family, number),
            "edges": mode.n_edges,
            "uncertain": int((~mode.known).sum()),
            "optional": int(mode.optional.sum()),
        }
        for number, mode in enumerate(family.modes)
    ]
    parts = [_component(family, component) for component in components]
    return {"signal": components[0].signal, "nodes": list(family.labels), "modes": modes, "components": parts}


def _component(family: Family, component: FamilyComponent) -> dict[str, Any]:
    labels = [family.labels[v] for v in component.nodes.tolist()]
    why, gauge = component.counterexample, component.gauge
    document: dict[str, Any] = {
        "nodes": labels,
        "behaviour": component.behaviour,
        "special": list(component.special),
        "camps": None if gauge is None else dict(zip(labels, gauge.tolist(), strict=True)),
        "counterexample": None if why is None else {"kind": why.kind, "text": counterexample_text(component, why)},
    }
    if component.behaviour == DEPENDS and component.signal == "any":
        groups = FamilyGroups(component)
        document["agreeing"] = [[labels[v] for v in group.nodes.tolist()] for group in groups.agreeing]
        document["at_zero"] = [labels[v] for v in groups.at_zero.tolist()]
    return document


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
