"""What is decided of a family, as JSON: the output of ``ptcc classify --json``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ptcc_certify.graphs.family import Family
from ptcc_certify.theorems.agreeing_groups import FamilyGroups
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, counterexample_text, mode_name


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
