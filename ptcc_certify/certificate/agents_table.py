"""The table of agents that a certificate is made into."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.restricted_states import ends_for_signal
from ptcc_certify.checker.reading import Interval
from ptcc_certify.graphs.tables import import_pandas

if TYPE_CHECKING:
    import pandas as pd

    from ptcc_certify.certificate.certificate_data import Content


def agents_table(certificate: Content | FamilyContent, certified: bool = True) -> pd.DataFrame:
    """Return one row per agent; see :meth:`Certificate.to_pandas` and :meth:`FamilyCertificate.to_pandas`.

    Examples
    --------
    >>> moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
    >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {"a": 0, "b": 4, "c": 9})
    >>> agents_table(cert)[["box_least", "box_largest"]].loc["c"].tolist()
    [1.0, 2.0]
    """
    pandas = import_pandas()
    columns: Mapping[Any, Any]
    if isinstance(certificate, FamilyContent):
        columns = _of_family(certificate, certified)
    else:
        own = _of_graph(certificate) if certificate.agents is None else certificate.agents.columns()
        columns = {**certificate.structure.to_pandas(), **own}
    return pandas.DataFrame(columns, index=pandas.Index(certificate.labels, name="node"))


def _of_graph(certificate: Content) -> dict[str, Any]:
    """Return where agents begin and end, and how near they are proved to be, NaN where that is not known."""
    unknown = np.full(certificate.graph.n_nodes, np.nan)
    begin, end = certificate.initial_positions, certificate.final_positions
    deviation = unknown
    if begin is not None and certificate.functions:
        share = 1 if certificate.direct else float(certificate.protocol.span / certificate.protocol.T)
        deviation = certificate.deviation_bound([0.01 * share])[:, 0]
    return {
        "x(0)": unknown if begin is None else [float(x) for x in begin],
        "x(T)": unknown if end is None else np.asarray(end, dtype=float),
        "deviation": np.where(np.isfinite(deviation), deviation, np.nan),
    }


def _of_family(certificate: FamilyContent, certified: bool) -> dict[str, Any]:
    """Return intervals; nothing of restricted signals, nor of boxes, unless the check accepts the certificate."""
    unknown: list[Interval | None] = [None] * certificate.family.n_nodes
    restricted = ends_for_signal(certificate) if certified else unknown
    signal = "" if certificate.signal == "any" else str(certificate.signal)
    return {
        **_pair("least", "largest", certificate.final_states or unknown),
        **_pair("restricted_least", "restricted_largest", restricted),
        "restricted_to": ["" if ends is None else signal for ends in restricted],
        **_pair("box_least", "box_largest", _boxes(certificate) if certified else unknown),
        **_pair("stays_least", "stays_largest", _ranges(certificate) if certified else unknown),
        "keeps": _keeps(certificate),
    }


def _pair(least: str, largest: str, states: Iterable[Interval | None]) -> dict[str, np.ndarray]:
    """Return two columns of ends rounded outwards, NaN where there are none."""
    unknown = (math.nan, math.nan)
    ends = [unknown if one is None else (float_down(one[0]), float_up(one[1])) for one in states]
    low, high = np.array(ends, dtype=float).T
    return {least: low, largest: high}


def _boxes(certificate: FamilyContent) -> list[Interval | None]:
    """Return the interval of the box of every agent that is in one."""
    result: list[Interval | None] = [None] * certificate.family.n_nodes
    for number, box in certificate.boxes.items():
        nodes = certificate.parts[number].component.nodes[box.decay.nodes].tolist()
        for v, low, high in zip(nodes, box.lower, box.upper, strict=True):
            result[v] = low, high
    return result


def _ranges(certificate: FamilyContent) -> list[Interval | None]:
    """Return the interval in which every signal keeps an agent whose end depends on it."""
    result: list[Interval | None] = [None] * certificate.family.n_nodes
    for number, ends in certificate.ranges.items():
        for v, own in zip(certificate.parts[number].component.nodes.tolist(), ends, strict=True):
            result[v] = own
    return result


def _keeps(certificate: FamilyContent) -> np.ndarray:
    """Tell which agents no edge of any mode leads to, while no sliding variable moves, nor leaders."""
    _, target, _ = certificate.family.union
    hears = np.zeros(certificate.family.n_nodes, dtype=bool)
    hears[target] = True
    return ~hears & (certificate.direct and not certificate.leaders_move)
