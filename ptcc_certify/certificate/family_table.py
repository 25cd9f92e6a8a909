"""The table of agents that the certificate of a family is made into."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.restricted_states import ends_for_signal
from ptcc_certify.checker.reading import Interval
from ptcc_certify.graphs.tables import import_pandas

if TYPE_CHECKING:
    import pandas as pd


def family_table(certificate: FamilyContent, certified: bool) -> pd.DataFrame:
    """Return one row per agent; see :meth:`FamilyCertificate.to_pandas`.

    Parameters
    ----------
    certificate : FamilyContent
    certified : bool
        Whether the check accepts it: without that nothing is told of restricted signals, nor of boxes.

    Examples
    --------
    >>> moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
    >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {"a": 0, "b": 4, "c": 9})
    >>> family_table(cert, True)[["box_least", "box_largest"]].loc["c"].tolist()
    [1.0, 2.0]
    """
    pandas, n = import_pandas(), certificate.family.n_nodes
    unknown: list[Interval | None] = [None] * n
    own = ends_for_signal(certificate) if certified else unknown
    signal = "" if certificate.signal == "any" else str(certificate.signal)
    columns: dict[str, Any] = {
        **_pair("least", "largest", certificate.final_states or unknown),
        **_pair("restricted_least", "restricted_largest", own),
        "restricted_to": ["" if ends is None else signal for ends in own],
        **_pair("box_least", "box_largest", _boxes(certificate) if certified else unknown),
        **_pair("stays_least", "stays_largest", _ranges(certificate) if certified else unknown),
        "keeps": _keeps(certificate),
    }
    return pandas.DataFrame(columns, index=pandas.Index(certificate.family.labels, name="node"))


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
    """Tell which agents no edge of any mode leads to, while no sliding variable moves."""
    _, target, _ = certificate.family.union
    hears = np.zeros(certificate.family.n_nodes, dtype=bool)
    hears[target] = True
    return ~hears & certificate.direct
