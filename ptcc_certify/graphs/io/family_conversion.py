"""The gate for families: whatever a user holds becomes a family of signed digraphs, or is refused with the mend."""

from __future__ import annotations

import os
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from ptcc_certify.errors import GraphError, NumberError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph, refuse_networkx
from ptcc_certify.graphs.family import Family, read_share
from ptcc_certify.graphs.io.columns_beside import column_of, signs_beside_intervals
from ptcc_certify.graphs.io.conversion import as_graph
from ptcc_certify.graphs.io.family_files import interval_columns, is_family_file, read_family, refuse_outside, truth
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged
from ptcc_certify.graphs.io.signs import OF_EDGES
from ptcc_certify.graphs.io.table_columns import edge_columns
from ptcc_certify.graphs.rationals import as_fraction, shorten

#: Of weights in intervals.
_TWICE = "the edges give intervals themselves; leave out the uncertainty"
#: What a mapping is.
_BY_NAME = "a dict is a family of graphs by name; give the edges of one graph as a list of (source, target, weight)"


def as_family(family: Any, orientation: str | None = None, *, uncertainty: Any = 0) -> Family:
    """Return the family of signed digraphs that a user holds, in whatever form.

    Parameters
    ----------
    family : family-like
        - a :class:`~ptcc_certify.graphs.family.Family`;
        - a mapping of names to graphs, or a list of graphs or of their paths: modes, of which any may act at any
          instant;
        - a DataFrame of edges with columns ``source``, ``target``, ``weight_min``, ``weight_max``, or a list of
          ``(source, target, least, largest)``: weights in intervals; a column ``optional`` (true or false) marks edges
          that may fail;
        - a ``networkx.DiGraph`` whose edges have these attributes in place of ``weight``, or ``optional`` beside it;
        - whatever :func:`~ptcc_certify.graphs.io.as_graph` takes: one graph; a path may also be of a file with
          intervals.
    orientation : {"information", "listens"}, optional
        As in :func:`~ptcc_certify.graphs.io.as_graph`.
    uncertainty : number or str
        Of weights that are given as one number: a share from 0 to 1, or a text as "10%".

    Returns
    -------
    Family

    Raises
    ------
    GraphError
        It is no graph and no family, or its modes have different nodes; the message names the mend.
    ParameterError
        A family with an uncertainty besides: it has its own weights.

    References
    ----------
    docs/theory/families.md, "What may change".

    Examples
    --------
    >>> as_family({"day": [("a", "b", 1)], "night": [("b", "a", 1)]})
    Family(2 nodes, 2 modes)
    >>> as_family("fig1a", uncertainty="10%")
    Family(6 nodes, 12 of 12 weights uncertain)
    """
    if isinstance(family, Family):
        if uncertainty or orientation is not None:
            raise ParameterError("a Family has its weights and its orientation; leave out uncertainty and orientation")
        return family
    if isinstance(family, Mapping) or _is_list_of_graphs(family):
        if isinstance(family, Mapping):
            named = {str(name): one for name, one in family.items()}
        elif all(isinstance(one, str | os.PathLike) for one in family):
            paths = [file_or_packaged(str(one)) for one in family]
            return read_family(paths, uncertainty=uncertainty, orientation=orientation)
        else:
            named = {str(number): one for number, one in enumerate(family, 1)}
        alone = {name: _mode_of(one, orientation, uncertainty) for name, one in named.items()}
        return Family.switching(alone)
    if isinstance(family, str | os.PathLike) and (family in GRAPHS or os.path.exists(family)):  # noqa: PTH110
        return read_family(file_or_packaged(os.fspath(family)), uncertainty=uncertainty, orientation=orientation)
    if (edges := _interval_edges(family, uncertainty)) is not None:
        nodes = family.nodes if hasattr(family, "is_multigraph") else ()
        return Family.from_intervals(edges, nodes, orientation=orientation or "information")
    return Family.from_graph(as_graph(family, orientation), uncertainty=uncertainty)


def _mode_of(graph: Any, orientation: str | None, uncertainty: Any) -> Family:
    """Return a mode of several, which may be a family itself."""
    if isinstance(graph, Family) and not uncertainty:
        return graph
    try:
        return as_family(graph, orientation, uncertainty=uncertainty)
    except GraphError as error:
        neighbours = isinstance(graph, Mapping | list | tuple) and all(isinstance(one, str) for one in graph)
        if not neighbours or _BY_NAME in str(error):
            raise
        raise type(error)(f"{error}; {_BY_NAME}") from None


def is_family(graphs: Any) -> bool:
    """Tell whether a user holds a family rather than one graph.

    Examples
    --------
    >>> is_family(["fig1a", "fig1b"]), is_family([("a", "b", 1)]), is_family(Family.from_graph(as_graph("fig1a")))
    (True, False, False)
    """
    if isinstance(graphs, Family):
        return graphs.graph is None
    if isinstance(graphs, str | os.PathLike):
        return os.path.isfile(graphs) and is_family_file(graphs)  # noqa: PTH113 - Path.is_file may raise
    return isinstance(graphs, Mapping) or _is_list_of_graphs(graphs) or _interval_edges(graphs) is not None


def _is_list_of_graphs(graphs: Any) -> bool:
    if not isinstance(graphs, list | tuple) or not graphs:
        return False
    return all(
        isinstance(one, SignedDigraph | Family | str | os.PathLike) or hasattr(one, "is_multigraph") for one in graphs
    )


class _Entry(NamedTuple):
    """An edge as a user holds it: where it stands, its ends, its weight or an interval, and whether it may fail."""

    place: str
    source: Any
    target: Any
    weight: Any
    least: Any
    largest: Any
    optional: Any

    def interval(self, share: Fraction) -> tuple[Any, Any, Any, Any]:
        """Return source, target, least and largest weight."""
        single = self.least is None and self.largest is None
        if not single and share:
            raise ParameterError(_TWICE)
        ends = (self.weight, self.weight) if single else (self.least, self.largest)
        if None in ends:
            raise GraphError(f"{self.place}: it has no weight; give weight, or weight_min and weight_max")
        if (answer := truth(self.optional)) is None:
            raise GraphError(f"{self.place}: optional is {shorten(str(self.optional))}; write True or False")
        try:
            least, largest = (as_fraction(end, "the weight") for end in ends)
        except NumberError as error:
            raise GraphError(f"{self.place}: {error}") from None
        if share:
            least, largest = sorted((least * (1 - share), least * (1 + share)))
        refuse_outside(self.weight, least, largest, self.place)
        return (self.source, self.target, min(least, 0), max(largest, 0)) if answer else (*self[1:3], least, largest)


def _interval_edges(graphs: Any, uncertainty: Any = 0) -> list[tuple[Any, Any, Any, Any]] | None:
    """Return the edges of a DataFrame or networkx graph with intervals, or of a list of edges with four entries.

    None of others.
    """
    if isinstance(graphs, list | tuple):
        intervals = bool(graphs) and all(isinstance(row, tuple) and len(row) == 4 for row in graphs)
        if intervals and read_share(uncertainty):
            raise ParameterError(_TWICE)
        return [*graphs] if intervals else None
    if hasattr(graphs, "is_multigraph"):
        entries = _entries_of_networkx(graphs)
    elif hasattr(graphs, "columns") and hasattr(graphs, "to_numpy"):
        entries = _entries_of_table(graphs)
    else:
        return None
    share = read_share(uncertainty)
    return None if entries is None else [entry.interval(share) for entry in entries]


def _entries_of_table(table: Any) -> list[_Entry] | None:
    names = [str(name) for name in table.columns]
    low, high, may_fail = interval_columns(names, "the DataFrame")
    ends = edge_columns(names, "the DataFrame")
    if ends is None or (low, high, may_fail) == (None, None, None):
        return None
    if low is None and ends[2] is None:
        raise GraphError("the DataFrame names no weight; name a column weight, or weight_min and weight_max")
    m = len(table)
    rest = [
        [absent] * m if k is None else list(table[table.columns[k]])
        for k, absent in ((ends[2], None), (low, None), (high, None), (may_fail, False))
    ]
    others = [k for k in range(len(names)) if k not in (*ends, low, high, may_fail)]
    beside = [column_of(names[k], table[table.columns[k]]) for k in others]
    if text := signs_beside_intervals(beside, (weight for column in rest[:3] for weight in column)):
        raise GraphError(f"the DataFrame: {text}")
    at = [list(table[table.columns[k]]) for k in ends[:2]] + rest
    return [_Entry(f"row {row} of the DataFrame", *entry) for row, entry in enumerate(zip(*at, strict=True), 1)]


def _entries_of_networkx(graph: Any) -> list[_Entry] | None:
    if not any(OF_EDGES & data.keys() for *_, data in graph.edges(data=True)):
        return None
    refuse_networkx(graph)
    absent = {"weight": None, "weight_min": None, "weight_max": None, "optional": False}
    edges = [data for *_, data in graph.edges(data=True)]
    titles = dict.fromkeys(str(title) for data in edges for title in data if title not in absent)
    beside = [column_of(title, (data.get(title, "") for data in edges)) for title in titles]
    if text := signs_beside_intervals(beside, (data.get(title, "") for data in edges for title in [*absent][:3])):
        raise GraphError(f"the graph: {text}")
    return [
        _Entry(f"edge {shorten(str(u))} -> {shorten(str(v))}", u, v, *(data.get(k, absent[k]) for k in absent))
        for u, v, data in graph.edges(data=True)
    ]
