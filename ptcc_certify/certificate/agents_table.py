"""The table of agents that a certificate is made into."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.certificate.constrained_switching.final_states import ends_for_signal
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.checker.reading import Interval
from ptcc_certify.graphs.labels import import_pandas

if TYPE_CHECKING:
    import pandas as pd

    from ptcc_certify.certificate.certificate_file import Recorded


def agents_table(certificate: Recorded) -> pd.DataFrame:
    """Return one row per agent; see :meth:`Certificate.to_pandas`.

    Examples
    --------
    >>> moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
    >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {"a": 0, "b": 4, "c": 9})
    >>> agents_table(cert)[["box_least", "box_largest"]].loc["c"].tolist()
    [1.0, 2.0]
    """
    pandas = import_pandas()
    columns: Mapping[Any, Any]
    proof = certificate.proof
    if isinstance(proof, FamilyProof):
        columns = _of_family(proof, certificate.verdict == "certified")
    else:
        own = _of_graph(proof) if proof.agents is None else proof.agents.columns()
        columns = {**proof.structure.to_pandas(), **own}
    return pandas.DataFrame(columns, index=pandas.Index(proof.labels, name="node"))


def _of_graph(proof: GraphProof) -> dict[str, Any]:
    """Return where agents begin and end, and how near they are proved to be, NaN where that is not known."""
    unknown = np.full(proof.graph.n_nodes, np.nan)
    begin, end = proof.initial_positions, proof.final_positions
    deviation = unknown
    if begin is not None and proof.functions:
        share = 1 if proof.direct else float(proof.protocol.span / proof.protocol.T)
        deviation = proof.deviation_bound([0.01 * share])[:, 0]
    return {
        "x(0)": unknown if begin is None else [float(x) for x in begin],
        "x(T)": unknown if end is None else np.asarray(end, dtype=float),
        "deviation": np.where(np.isfinite(deviation), deviation, np.nan),
    }


def _of_family(proof: FamilyProof, certified: bool) -> dict[str, Any]:
    """Return intervals; nothing of restricted signals, nor of boxes, unless the check accepts the certificate."""
    unknown: list[Interval | None] = [None] * proof.family.n_nodes
    restricted = ends_for_signal(proof) if certified else unknown
    signal = "" if proof.signal == "any" else str(proof.signal)
    return {
        **_pair("least", "largest", proof.final_positions or unknown),
        **_pair("restricted_least", "restricted_largest", restricted),
        "restricted_to": ["" if ends is None else signal for ends in restricted],
        **_pair("box_least", "box_largest", _boxes(proof) if certified else unknown),
        **_pair("stays_least", "stays_largest", _ranges(proof) if certified else unknown),
        "keeps": _keeps(proof),
    }


def _pair(least: str, largest: str, states: Iterable[Interval | None]) -> dict[str, np.ndarray]:
    """Return two columns of ends rounded outwards, NaN where there are none."""
    unknown = (math.nan, math.nan)
    ends = [unknown if one is None else (float_down(one[0]), float_up(one[1])) for one in states]
    low, high = np.array(ends, dtype=float).T
    return {least: low, largest: high}


def _boxes(proof: FamilyProof) -> list[Interval | None]:
    """Return the interval of the box of every agent that is in one."""
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, box in proof.boxes.items():
        nodes = proof.parts[number].component.nodes[box.decay.nodes].tolist()
        for v, low, high in zip(nodes, box.lower, box.upper, strict=True):
            result[v] = low, high
    return proof.in_places(result)


def _ranges(proof: FamilyProof) -> list[Interval | None]:
    """Return the interval in which every signal keeps an agent whose end depends on it."""
    result: list[Interval | None] = [None] * proof.family.n_nodes
    for number, ends in proof.ranges.items():
        for v, own in zip(proof.parts[number].component.nodes.tolist(), ends, strict=True):
            result[v] = own
    return proof.in_places(result)


def _keeps(proof: FamilyProof) -> np.ndarray:
    """Tell which agents no edge of any mode leads to, while no sliding variable moves, nor leaders."""
    _, target, _ = proof.family.union
    hears = np.zeros(proof.family.n_nodes, dtype=bool)
    hears[target] = True
    return ~hears & (proof.direct and not proof.leaders_move)
