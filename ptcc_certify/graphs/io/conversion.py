"""The gate for graphs: whatever a user holds becomes a signed digraph or a family of them, or is refused."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, GraphError, ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import SignedDigraph, graph_of, refuse_networkx
from ptcc_certify.graphs.family import Family, read_share
from ptcc_certify.graphs.io.columns_beside import column_of, notes_on_ignored, signs_beside_intervals
from ptcc_certify.graphs.io.family_files import read_family
from ptcc_certify.graphs.io.graph_files import read_as
from ptcc_certify.graphs.io.interval_edges import TWICE, Entry, absent, known, told_weights
from ptcc_certify.graphs.io.interval_rows import IntervalRows, is_family_file, take
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged
from ptcc_certify.graphs.io.problems import Problems, one_message
from ptcc_certify.graphs.io.raw_edges import Beside, Nodes, Rows, Signs, distinct, rows_of
from ptcc_certify.graphs.io.signs import interval_columns, is_sign, weight_and_sign
from ptcc_certify.graphs.io.table_columns import BY_HEADER, LISTENS, Columns, columns_of, edge_columns
from ptcc_certify.graphs.labels import first_five, labels_beside, refuse_written_twice
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading, joined

TAKEN = (
    "a SignedDigraph, a path, the name of a packaged graph, a networkx.DiGraph, an adjacency matrix with orientation=, "
    "a DataFrame with columns source, target, weight, or a list of (source, target, weight)"
)


def as_graph(graph: Any, orientation: str | None = None, **reading: Any) -> SignedDigraph:
    """Return the signed digraph that a user holds, in whatever form.

    Every function that takes a graph takes all of these.

    Parameters
    ----------
    graph : graph-like
        - a :class:`~ptcc_certify.graphs.digraph.SignedDigraph`, or what holds one as ``graph``: a structure, a
          certificate, a run;
        - a path, a file object (of a matrix with its orientation), or the name of a packaged graph, ``"fig1a"`` ..
          ``"fig5b"`` or ``"highland_tribes"``, where no such file exists;
        - a ``networkx.DiGraph`` with the edge attribute ``weight``;
        - an adjacency matrix, whose orientation must be said: a NumPy array, a SciPy sparse matrix or array, a list of
          rows, or a DataFrame with the same labels on rows and columns; ``"-0.3"`` is exact, ``-0.3`` a nearby float;
        - a DataFrame of edges with columns ``source``, ``target``, ``weight`` in any order (or the other names of
          :func:`~ptcc_certify.graphs.io.read_graph`, or those of ``columns``); a column ``sign`` or ``type`` beside
          ``weight``, or another of signs, is its factor, others are ignored, which ``read["notes"]`` says;
        - a list of ``(source, target, weight)``.
    orientation : {"information", "listens"}, optional
        Of an edge ``(a, b)``, or of the entry in row a and column b: information flows a -> b, or a listens to b.
        Edges flow by default, for a matrix it must be said.
    **reading : Any
        The other keywords of :func:`~ptcc_certify.graphs.io.read_graph` but ``format``, such as ``laplacian=True`` or
        ``columns="a,b,w"``, as far as they say something about what is given. Of a table ``source=``, ``target=`` and
        ``weight=`` name the columns as networkx calls them; those left out have these names.

    Returns
    -------
    SignedDigraph

    Raises
    ------
    GraphError
        It is no graph, or no signed digraph; the message names what is taken, or the mend.

    Examples
    --------
    >>> as_graph("fig1a")
    SignedDigraph(6 nodes, 12 edges, 4 negative)
    >>> as_graph([("ann", "bob", -2)]) == as_graph(np.array([[0, -2], [0, 0]]), "information")
    False
    >>> as_graph([("1", "2", -2)]) == as_graph(np.array([[0, -2], [0, 0]]), "information")
    True
    >>> import pandas
    >>> table = pandas.DataFrame({"from": ["ann"], "to": ["bob"], "score": [-2]})
    >>> as_graph(table, source="from", target="to", weight="score").edges
    (('ann', 'bob', Fraction(-2, 1)),)
    """
    if isinstance(
        signed := graph if isinstance(graph, SignedDigraph) else getattr(graph, "graph", None), SignedDigraph
    ):
        if orientation is not None or reading:
            given = ", ".join(f"{name}=" for name in (reading if orientation is None else ("orientation", *reading)))
            raise ParameterError(f"a SignedDigraph has its orientation and its edges; leave out {given}")
        return signed
    if isinstance(graph, Family):
        raise GraphError(
            f"{graph!r} is several graphs, and one is asked for; certify, decide and simulate take families"
        )
    if reading.keys() & set(_COLUMNS):
        if "columns" in reading:
            raise ParameterError("columns are named twice; give columns=, or source=, target= and weight=")
        reading["columns"] = [str(reading.pop(name, name)) for name in _COLUMNS]
    how = Reading(orientation=orientation, **reading)
    if isinstance(graph, str) and not os.path.exists(graph) and graph not in GRAPHS and "." not in graph:  # noqa: PTH110
        names = f"({', '.join(GRAPHS)}); check the path{did_you_mean(graph, GRAPHS)}"
        raise FormatError(f"{shorten(graph)}: no such file, and no packaged graph {names}")
    if isinstance(graph, str | os.PathLike) or hasattr(graph, "read"):
        file = file_or_packaged(graph) if isinstance(graph, str) else graph
        return read_as(file, how, ask=True)  # type: ignore[arg-type]
    way = orientation or "information"
    if hasattr(graph, "is_multigraph"):
        weight = how.titles[2] if how.titles else None
        return SignedDigraph.from_networkx(graph, weight, orientation=way, **_only(how, reading, _OF_EDGES, "columns"))
    if (table := _rows_of_table(graph, how)) is not None:
        return graph_of(table, "", how)
    if hasattr(graph, "columns") or hasattr(graph, "tocoo") or isinstance(graph, np.ndarray):
        _refuse_edge_array(graph)
        return SignedDigraph.from_matrix(graph, orientation=orientation, **_only(how, reading, _OF_MATRICES))
    if isinstance(graph, dict | set | frozenset | bytes | bytearray) or not isinstance(graph, Iterable):
        raise GraphError(f"{shorten(repr(graph))} is not read as a graph; give {TAKEN}")
    rows = list(graph)
    if _is_list_of_graphs(rows):
        raise GraphError("a list of graphs is a family, and one graph is asked for; certify and simulate take families")
    if rows and all(isinstance(row, list) and row and all(isinstance(edge, tuple) for edge in row) for row in rows):
        raise GraphError('a list of edge lists is no graph; of a family give a dict, {"day": edges, "night": edges2}')
    if _rows_of_matrix(rows, how.laplacian is not None):
        return SignedDigraph.from_matrix(rows, orientation=orientation, **_only(how, reading, _OF_MATRICES))
    return SignedDigraph.from_edges(rows, orientation=way, **_only(how, reading, _OF_EDGES))


#: The columns of a table of edges, as networkx calls them.
_COLUMNS = ("source", "target", "weight")
#: What may be said of edges, and of a matrix, that are in memory.
_OF_EDGES = ("duplicates", "drop_self_loops", "drop_zeros", "undirected")
_OF_MATRICES = ("duplicates", "drop_self_loops", "undirected", "laplacian")


def _only(how: Reading, given: Iterable[str], names: tuple[str, ...], read: str = "") -> dict[str, Any]:
    """Return the options of these names; refuse any other that is given, but for one that was read."""
    if rest := [name for name in given if name not in (*names, read)]:
        raise ParameterError(f"{rest[0]}: says nothing about a graph in memory of this kind; leave {rest[0]} out")
    return {name: getattr(how, name) for name in names}


def _rows_of_table(table: Any, how: Reading) -> Rows | None:
    """Return the rows of a DataFrame with the columns of an edge list; None of anything else."""
    if not hasattr(table, "columns") or not hasattr(table, "to_numpy"):
        return None
    names = [str(name) for name in table.columns]
    if set(labels_beside(table) or ()) == set(names):
        return None  # an adjacency matrix
    named = bool(how.titles) or edge_columns(names, "the DataFrame") is not None
    columns = columns_of(names, [], "the DataFrame", how) if named else Columns()
    if not columns.titles and not columns.told:
        own = joined(names[:3]) if len(names) > 2 else "a,b,w"
        raise GraphError(
            f"a DataFrame with the columns {first_five(names)} is no graph; name them source, target, weight, or give "
            f'as_graph(.., columns="{shorten(own)}"), with orientation="listens" if the first listens, or an adjacency '
            "matrix with the same labels on rows and columns"
        )
    how.refuse("variable", "the DataFrame", "a table of edges")
    if not columns.titles:
        columns = replace(columns, titles=tuple(names))
    nodes, ends = Nodes(), []
    pairs = zip(*(table[table.columns[k]] for k in (columns.source, columns.target)), strict=True)
    for row, (source, target) in enumerate(pairs, 1):
        first = nodes.number(source, f"row {row}, source of the DataFrame")
        ends.append((first, nodes.number(target, f"row {row}, target of the DataFrame")))
    beside = Beside(columns.codes, told=columns.told)
    if columns.sign is not None:
        beside.signs = Signs(*distinct(table[table.columns[columns.sign]]), names[columns.sign])
    beside.columns = [column_of(names[k], table[table.columns[k]]) for k in columns.ignored]
    rows = rows_of(
        [*nodes],
        [one for one, _ in ends],
        [other for _, other in ends],
        [*table[table.columns[columns.weight]]],
        beside,
    )
    rows.kind = "DataFrame"
    rows.notes = tuple(note for note in columns.notes if note != BY_HEADER and not note.endswith(LISTENS))
    return rows


def _refuse_edge_array(array: Any) -> None:
    shape: Any = getattr(array, "shape", ())
    if len(shape) == 2 and shape[1] == 3 != shape[0]:
        raise GraphError(
            f"an array of {shape[0]} x 3 is no adjacency matrix; write edges as a list of (source, target, weight)"
        )


def _rows_of_matrix(rows: list[Any], told: bool) -> bool:
    """Tell a list of rows of a matrix from a list of edges: edges are tuples, or hold texts, or are not square."""
    if not rows or not all(isinstance(row, list | np.ndarray) and len(row) == len(rows) for row in rows):
        return False
    if told or len(rows) != 3 or all(row[k] in (0, "0") for k, row in enumerate(rows)):  # 0 is no weight of an edge
        return True
    if any(isinstance(entry, str) for row in rows for entry in row[:2]):
        return False
    raise GraphError(
        "three lists of three numbers may be edges or a matrix; write edges as tuples (source, target, weight), "
        "and a matrix with zeros on its diagonal, or with laplacian=True"
    )


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
    if (rows := _interval_rows(family, uncertainty)) is not None:
        made = Family.from_intervals(rows.edges, rows.nodes, orientation=orientation or "information")
        alike = refuse_written_twice(made.modes[0].labels, "")
        return replace(made, notes=(*made.notes, *rows.notes, *alike))
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
    return isinstance(graphs, Mapping) or _is_list_of_graphs(graphs) or _interval_rows(graphs) is not None


def _is_list_of_graphs(graphs: Any) -> bool:
    if not isinstance(graphs, list | tuple) or not graphs:
        return False
    return all(
        isinstance(one, SignedDigraph | Family | str | os.PathLike)
        or hasattr(one, "is_multigraph")
        or hasattr(one, "columns")
        or (getattr(one, "ndim", 0) == 2 and one.shape[0] == one.shape[1])
        for one in graphs
    )


def _interval_rows(graphs: Any, uncertainty: Any = 0) -> IntervalRows | None:
    """Return the edges of a DataFrame or networkx graph with intervals, or of a list of edges with four entries.

    None of others.
    """
    if isinstance(graphs, list | tuple):
        intervals = bool(graphs) and all(isinstance(row, tuple) and len(row) == 4 for row in graphs)
        if intervals and read_share(uncertainty):
            raise ParameterError(TWICE)
        return IntervalRows([], [*graphs]) if intervals else None
    if hasattr(graphs, "is_multigraph"):
        told = _entries_of_networkx(graphs)
    elif hasattr(graphs, "columns") and hasattr(graphs, "to_numpy"):
        told = _entries_of_table(graphs)
    else:
        return None
    if told is None:
        return None
    rows, entries = told
    broken = Problems()
    take(rows, entries, Reading(), read_share(uncertainty), broken)
    if problems := [problem.by_hand for problem in broken.told()]:
        raise GraphError(": ".join(filter(None, one_message(problems, " ".join))))
    return rows


_Told = tuple[IntervalRows, list[tuple[str, Entry]]]


def _entries_of_table(table: Any) -> _Told | None:
    names = [str(name) for name in table.columns]
    low, high, may_fail = interval_columns(names, "the DataFrame")
    ends = edge_columns(names, "the DataFrame")
    if ends is None or (low, high, may_fail) == (None, None, None):
        return None
    if low is None and ends[2] is None:
        raise GraphError("the DataFrame names no weight; name a column weight, or weight_min and weight_max")
    if low is not None and ends[2] is not None and is_sign(names[ends[2]]):
        ends = (*ends[:2], None)  # a column of signs, or of directions
    read = (*ends, low, high, may_fail)
    m = len(table)
    columns = [[None] * m if k is None else list(table[table.columns[k]]) for k in read]
    columns = [*map(_whole_numbers, columns[:2]), *([*map(known, column)] for column in columns[2:])]
    if low is None and ends[2] is not None:
        columns[2] = told_weights(columns[2], names[ends[2]])
    others = [k for k in range(len(names)) if k not in read]
    beside = [column_of(names[k], table[table.columns[k]]) for k in others]
    if text := signs_beside_intervals(beside, zip(*columns[2:5], strict=True)):
        raise GraphError(f"the DataFrame: {text}")
    nodes, entries = dict[Any, bool](), list[tuple[str, Entry]]()  # nodes with edges, and without
    for row, (source, target, *values) in enumerate(zip(*columns, strict=True), 1):
        if absent(target) and all(map(absent, values)):  # a node, or nothing
            nodes |= {} if absent(source) else {source: nodes.get(source, False)}
        else:
            nodes |= {source: True, target: True}
            place = f"edge {shorten(str(source))} -> {shorten(str(target))}"
            entries.append((f"row {row} of the DataFrame", Entry(place, source, target, *values)))
    alone = [str(node) for node, there in nodes.items() if not there]
    notes = (f"{counted(len(alone), 'node')} without edges: {first_five(alone)}",) if alone else ()
    return IntervalRows([*nodes], notes=(*notes, *notes_on_ignored(beside))), entries


def _whole_numbers(nodes: list[Any]) -> list[Any]:
    """Return nodes that pandas made floats since one is missing as the integers that they were."""
    there = [node for node in nodes if not absent(node)]
    floats = len(there) < len(nodes) and all(isinstance(node, float) and node.is_integer() for node in there)
    return [None if absent(node) else int(node) for node in nodes] if floats else nodes


def _entries_of_networkx(graph: Any) -> _Told | None:
    edges = [data for *_, data in graph.edges(data=True)]
    titles = list(dict.fromkeys(title for data in edges for title in data if isinstance(title, str)))
    columns = interval_columns(titles, "the graph")
    if columns == (None, None, None):
        return None
    refuse_networkx(graph)
    weight, _ = weight_and_sign(titles, "the graph")
    if weight is not None and columns[0] is not None and is_sign(titles[weight]):
        weight = None  # an attribute of signs, or of directions
    read = [None if k is None else titles[k] for k in (weight, *columns)]
    values = lambda title, missing: [missing if title is None else data.get(title, missing) for data in edges]  # noqa: E731
    told = [[*map(known, values(title, None))] for title in read]
    if columns[0] is None and weight is not None:
        told[0] = told_weights(told[0], titles[weight])
    beside = [column_of(title, values(title, "")) for title in titles if title not in read]
    if text := signs_beside_intervals(beside, zip(*told[:3], strict=True)):
        raise GraphError(f"the graph: {text}")
    places = [(f"edge {shorten(str(u))} -> {shorten(str(v))}", u, v) for u, v in graph.edges()]
    entries = [("", Entry(*place, *one)) for place, one in zip(places, zip(*told, strict=True), strict=True)]
    return IntervalRows([*graph.nodes], notes=notes_on_ignored(beside)), entries
