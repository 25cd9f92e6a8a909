"""The gate for graphs: whatever a user holds becomes a signed digraph, or is refused with the mend."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, ParameterError, did_you_mean
from ptcc_certify.graphs.digraph import WAY, SignedDigraph, in_all, labels_beside, refuse_unnamed
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io.edge_list import header
from ptcc_certify.graphs.io.files import name_and_ending
from ptcc_certify.graphs.io.graph_files import MATRICES, read_graph
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.tables import first_five

TAKEN = (
    "a SignedDigraph, a path, the name of a packaged graph, a networkx.DiGraph, an adjacency matrix with orientation=, "
    "a DataFrame with columns source, target, weight, or a list of (source, target, weight)"
)


def as_graph(graph: Any, orientation: str | None = None) -> SignedDigraph:
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
          :func:`~ptcc_certify.graphs.io.read_graph`); more columns are ignored, which ``read["notes"]`` says;
        - a list of ``(source, target, weight)``.
    orientation : {"information", "listens"}, optional
        Of an edge ``(a, b)``, or of the entry in row a and column b: information flows a -> b, or a listens to b.
        Edges flow by default, for a matrix it must be said.

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
        if orientation is not None:
            raise ParameterError("a SignedDigraph has its orientation; leave out orientation=")
        return own
    if isinstance(graph, Family):
        raise GraphError(
            f"{graph!r} is several graphs, and one is asked for; certify, decide and simulate_family take families"
        )
    way = orientation or "information"
    if isinstance(graph, str) and not os.path.exists(graph) and graph not in GRAPHS and "." not in graph:  # noqa: PTH110
        names = f"({', '.join(GRAPHS)}); check the path{did_you_mean(graph, GRAPHS)}"
        raise FormatError(f"{shorten(graph)}: no such file, and no packaged graph {names}")
    if isinstance(graph, str | os.PathLike) or hasattr(graph, "read"):
        name, ending = name_and_ending(graph)  # type: ignore[arg-type]
        if orientation is None and ending in MATRICES:
            raise GraphError(f"{name}: a matrix {WAY}")
        return read_graph(file_or_packaged(graph) if isinstance(graph, str) else graph, orientation=orientation)  # type: ignore[arg-type]
    if hasattr(graph, "is_multigraph"):
        return SignedDigraph.from_networkx(graph, orientation=way)
    if (edges := _edges_of_table(graph)) is not None:
        rows, notes = edges
        built = SignedDigraph.from_edges(rows, orientation=way)
        built.read["notes"] = notes
        return built
    if hasattr(graph, "columns") or hasattr(graph, "tocoo") or isinstance(graph, np.ndarray):
        _refuse_edge_array(graph)
        return SignedDigraph.from_matrix(graph, orientation=orientation)
    if isinstance(graph, dict | set | frozenset | bytes | bytearray) or not isinstance(graph, Iterable):
        raise GraphError(f"{shorten(repr(graph))} is not read as a graph; give {TAKEN}")
    rows = list(graph)
    if rows and all(isinstance(row, list) and row and all(isinstance(edge, tuple) for edge in row) for row in rows):
        raise GraphError('a list of edge lists is no graph; of a family give a dict, {"day": edges, "night": edges2}')
    if _rows_of_matrix(rows):
        return SignedDigraph.from_matrix(rows, orientation=orientation)
    return SignedDigraph.from_edges(rows, orientation=way)


def _edges_of_table(table: Any) -> tuple[list[tuple[Any, Any, Any]], tuple[str, ...]] | None:
    """Return edges and notes of a DataFrame with the columns of an edge list; None of anything else."""
    if not hasattr(table, "columns") or not hasattr(table, "to_numpy"):
        return None
    names = [str(name) for name in table.columns]
    if set(labels_beside(table) or ()) == set(names):
        return None  # an adjacency matrix
    if (columns := header(names, "the DataFrame")) is None:
        raise GraphError(
            f"a DataFrame with the columns {first_five(names)} is no graph; name them source, target, weight, or "
            "give an adjacency matrix with the same labels on rows and columns"
        )
    parts = [list(table[table.columns[i]]) for i in columns]
    for what, column in zip(("source", "target"), parts, strict=False):
        for row, label in enumerate(column, 1):
            refuse_unnamed(label, f"row {row}, {what} of the DataFrame")
    _refuse_self_loops(parts[0], parts[1], names[columns[0]], names[columns[1]])
    ignored = [f'"{shorten(name)}"' for i, name in enumerate(names) if i not in columns]
    notes = ("columns ignored: " + ", ".join(ignored[:20]),) if ignored else ()
    return list(zip(*parts, strict=True)), notes


def _refuse_self_loops(sources: list[Any], targets: list[Any], first: str, second: str) -> None:
    loops = [str(a) for a, b in zip(sources, targets, strict=True) if str(a) == str(b)]
    if loops:
        mend = f'remove {"them" if len(loops) > 1 else "it"}: df[df["{shorten(first)}"] != df["{shorten(second)}"]]'
        raise GraphError(f"self-loop at node {shorten(loops[0])}{in_all(len(loops))}; {mend}")


def _refuse_edge_array(array: Any) -> None:
    shape: Any = getattr(array, "shape", ())
    if len(shape) == 2 and shape[1] == 3 != shape[0]:
        raise GraphError(
            f"an array of {shape[0]} x 3 is no adjacency matrix; write edges as a list of (source, target, weight)"
        )


def _rows_of_matrix(rows: list[Any]) -> bool:
    """Tell a list of rows of a matrix from a list of edges: edges are tuples, or hold texts, or are not square."""
    if not rows or not all(isinstance(row, list | np.ndarray) and len(row) == len(rows) for row in rows):
        return False
    if len(rows) != 3 or all(row[k] in (0, "0") for k, row in enumerate(rows)):  # 0 is no weight of an edge
        return True
    if any(isinstance(entry, str) for row in rows for entry in row[:2]):
        return False
    raise GraphError(
        "three lists of three numbers may be edges or a matrix; write edges as tuples (source, target, weight), "
        "and a matrix with zeros on its diagonal"
    )
