"""Graphs of edges and matrices that are in memory, by the rules for files."""

from __future__ import annotations

from typing import Any

import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.attributes import Values
from ptcc_certify.graphs.io.graph_from_rows import Rows, Signs, graph_of
from ptcc_certify.graphs.io.signs import is_sign
from ptcc_certify.graphs.reading import Reading


def graph_in_memory(
    how: Reading, labels: list[str], first: Any, second: Any, weights: Any, matrix: bool = False
) -> SignedDigraph:
    """Build a graph of rows ``labels[first], labels[second], weight``; weights may be attributes of edges.

    Examples
    --------
    >>> graph_in_memory(Reading(), ["a", "b"], [0], [1], ["-0.5"]).edges
    (('a', 'b', Fraction(-1, 2)),)
    """
    values = weights if isinstance(weights, Values) else Values(weights)
    rows = Rows(labels, first, second, *distinct(values.weights), lambda row: "", matrix=matrix)
    rows.beside, rows.told = values.beside, values.told
    rows.weight_title = values.weight if is_sign(values.weight) else ""
    rows.signs = Signs(*distinct(values.signs), values.sign) if values.signs else None
    return graph_of(rows, "", how)


def distinct(values: Any) -> tuple[Any, Any]:
    """Return the different values, of an array as one, and which of these each value is.

    Examples
    --------
    >>> distinct([2, 1, 2])
    ([2, 1], [0, 1, 0])
    """
    if isinstance(values, np.ndarray):
        return np.unique(values, return_inverse=True)
    table: dict[tuple[type, Any], int] = {}
    try:
        codes = [table.setdefault((type(value), value), len(table)) for value in values]
    except TypeError:  # a value that has no hash, which is refused as no number
        return list(values), np.arange(len(values))
    return [value for _, value in table], codes
