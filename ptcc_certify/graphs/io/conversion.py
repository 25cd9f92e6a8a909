"""The gate for graphs: whatever a user holds becomes a signed digraph, or is refused with the mend."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import SignedDigraph, graph_of
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io.columns_beside import column_of
from ptcc_certify.graphs.io.graph_files import read_as
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged
from ptcc_certify.graphs.io.rows import Beside, Nodes, Rows, Signs, distinct, rows_of
from ptcc_certify.graphs.io.table_columns import BY_HEADER, RATERS, columns_of, edge_columns
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.tables import first_five, labels_beside

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
        ``columns="a,b,w"``, as far as they say something about what is given.

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
    """
    if isinstance(own := graph if isinstance(graph, SignedDigraph) else getattr(graph, "graph", None), SignedDigraph):
        if orientation is not None or reading:
            given = ", ".join(f"{name}=" for name in (*["orientation"] * (orientation is not None), *reading))
            raise ParameterError(f"a SignedDigraph has its orientation and its edges; leave out {given}")
        return own
    if isinstance(graph, Family):
        raise GraphError(
            f"{graph!r} is several graphs, and one is asked for; certify, decide and simulate take families"
        )
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
    if rows and all(isinstance(row, list) and row and all(isinstance(edge, tuple) for edge in row) for row in rows):
        raise GraphError('a list of edge lists is no graph; of a family give a dict, {"day": edges, "night": edges2}')
    if _rows_of_matrix(rows, how.laplacian is not None):
        return SignedDigraph.from_matrix(rows, orientation=orientation, **_only(how, reading, _OF_MATRICES))
    return SignedDigraph.from_edges(rows, orientation=way, **_only(how, reading, _OF_EDGES))


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
    if not how.titles and edge_columns(names, "the DataFrame") is None:
        raise GraphError(
            f"a DataFrame with the columns {first_five(names)} is no graph; name them source, target, weight, tell "
            'them: columns="a,b,w", or give an adjacency matrix with the same labels on rows and columns'
        )
    how.refuse("variable", "the DataFrame", "a table of edges")
    columns = columns_of(names, [], "the DataFrame", how)
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
    rows.notes = tuple(note for note in columns.notes if note not in (BY_HEADER, RATERS))
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
