"""Graph, structure and claim in a certificate's file, and in what ``ptcc classify`` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify.certificate.format_vectors import Writer
from ptcc_certify.checker import MANY_COMPONENTS
from ptcc_certify.checker.reading import exact
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.digraph import SignedDigraph, Weights
from ptcc_certify.graphs.reading import RECORDED
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.theorems.claims import Claim


def structure_document(structure: Structure) -> dict[str, Any]:
    """Return graph, structure and claim as JSON-ready data, in the keys of a certificate."""
    claims = [component.claim for component in structure.components]
    out = Writer(structure.graph.labels)
    data = {"graph": graph_section(structure.graph, out), "structure": structure_section(structure, out)}
    return data | claim_sections(structure, claims, None, out)


def graph_section(graph: SignedDigraph, out: Writer) -> dict[str, Any]:
    """Return nodes, edges and how they were read."""
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
        "edges": edges,
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
    section, side = document["graph"], SideFiles(Path(), files)
    labels, edges = section["nodes"], section["edges"]
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
    return {"claim": None, "components": _components(structure, claims, final, out)}


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
            "final_state": final and {labels[v]: final[labels[v]] for v in c.nodes},
        }
        for c, claim in zip(components, claims, strict=True)
    ]
