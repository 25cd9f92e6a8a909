"""Signed digraphs from files of any format, and to edge lists."""

from __future__ import annotations

import gzip
import os
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.edge_list import RATERS, edge_list, read_edge_list
from ptcc_certify.graphs.io.files import Source, name_and_ending, read_bytes, refuse_no_path, write_atomically
from ptcc_certify.graphs.io.graph_from_rows import graph_of
from ptcc_certify.graphs.io.matrix_files import read_mat, read_mtx, read_npy, read_npz
from ptcc_certify.graphs.io.networkx_formats import read_gml, read_graphml, read_pajek
from ptcc_certify.graphs.kinds_of_file import refuse_content_as_graph
from ptcc_certify.graphs.rationals import shorten

MATRICES = {"mtx": read_mtx, "npz": read_npz, "npy": read_npy, "mat": read_mat}
_GRAPHS = {"graphml": read_graphml, "gml": read_gml, "net": read_pajek, "pajek": read_pajek}
#: Endings of files that are no edge lists.
OTHER_FORMATS = (*_GRAPHS, *MATRICES)
_READERS = dict.fromkeys(("csv", "tsv", "txt", "edges", "edgelist"), read_edge_list) | _GRAPHS | MATRICES


def read_graph(
    path: Source,
    *,
    orientation: str | None = None,
    duplicates: Literal["refuse", "sum", "last"] = "refuse",
    drop_self_loops: bool = False,
    undirected: bool = False,
    format: str | None = None,
) -> SignedDigraph:
    r"""Read a signed digraph from a file.

    An **edge list** has one edge ``source,target,weight`` per line. Commas, tabs, semicolons or blanks separate the
    fields, whichever the first row uses; ``#`` and ``%`` begin comment lines; fields may be quoted; a row with one
    field declares a node. A first row of known names (source, from, src, fromnodeid; target, to, dst, tonodeid;
    weight, sign, rating, value, w) is a header, and columns are then found by name. Columns beyond the three are
    ignored, which ``graph.read["notes"]`` says. **GraphML, GML and Pajek** edges need an attribute ``weight``
    (or ``sign``), in Pajek the third column. A **matrix** (Matrix Market, ``.npz``, ``.npy``, ``.mat``) has
    listeners as rows unless ``orientation`` says otherwise: entry (k, l) is what k makes of l.

    Weights are exact. In an edge list ``0.1``, ``1/3`` and ``0x1p-2`` are the numbers that they say. GraphML, GML,
    Pajek and Matrix Market go through float64, and a float is then the shortest decimal that names it: ``0.1`` is
    1/10 again, but digits beyond the 17th are lost. Integers and texts stay what they are. A float of ``.npz``,
    ``.npy`` and ``.mat`` is the dyadic number that it is.

    Parameters
    ----------
    path : str, Path or file object
        ``"-"`` is standard input. The ending tells the format, its content gzip; anything else is an edge list.
    orientation : {"information", "listens"}, optional
        Does a row ``a,b,w`` say that information flows a -> b (the default), or that a listens to b, as in trust
        and rating data? Entry (k, l) of a matrix is such a row ``k,l,w``, where k listens to l by default; a matrix
        of networkx needs ``"information"``.
    duplicates : {"refuse", "sum", "last"}
        What becomes of two rows for the same ordered pair.
    drop_self_loops, undirected : bool
        Drop self-loops instead of refusing them. Let each edge go both ways; a file that says itself that it is
        undirected is refused without this.
    format : str, optional
        One of the endings csv, tsv, txt, edges, edgelist, graphml, gml, net, pajek, mtx, npz, npy, mat.

    Returns
    -------
    SignedDigraph
        ``graph.read`` tells how the file was read: ``orientation`` ("matrix" for one whose rows listen), ``duplicates``
        ("refused", "sum" or "last"), ``self_loops`` ("refused" or "dropped N"), ``undirected`` and ``notes``.

    Raises
    ------
    FormatError
        The file cannot be opened, is no file of its format, or is no signed digraph: a weight that is not a finite
        number, a weight 0 (an unknown sign is not an edge), a repeated edge, a self-loop, no node at all.
    ParameterError
        An option has an unknown value.

    Examples
    --------
    >>> graph = read_graph(StringIO("a,b,1\nb,c,-0.1\n"))
    >>> graph.edges
    (('a', 'b', Fraction(1, 1)), ('b', 'c', Fraction(-1, 10)))
    >>> read_graph(StringIO("a,b,nan\n"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ptcc_certify.errors.FormatError: input, line 1: weight "nan" of edge a -> b is not a finite number; ...
    """
    name, ending = name_and_ending(path)
    ending = ending if format is None else str(format).lower().lstrip(".")
    _refuse_unknown("orientation", orientation or "information", ("information", "listens"))
    _refuse_unknown("duplicates", duplicates, ("refuse", "sum", "last"))
    _refuse_unknown("format", ending if format else "csv", _READERS)
    rows = _READERS.get(ending, read_edge_list)(graph_bytes(path, name, ending), name)
    way = "matrix" if ending in MATRICES and orientation != "information" else orientation or "information"
    if way != "information":
        rows.notes = tuple(note for note in rows.notes if note != RATERS)
    return graph_of(rows, name, way, duplicates, bool(drop_self_loops), bool(undirected))


def graph_bytes(path: Source, name: str, ending: str) -> bytes:
    """Read a file, or refuse what is no graph, such as a certificate.

    Examples
    --------
    >>> graph_bytes(StringIO("a,b,1"), "input", "csv")
    b'a,b,1'
    """
    data = read_bytes(path, name)
    refuse_content_as_graph(data, name, ending, path)
    return data


def is_edge_list(ending: str) -> bool:
    """Tell whether a file with this ending is read as an edge list.

    Examples
    --------
    >>> is_edge_list("csv"), is_edge_list("npz")
    (True, False)
    """
    return _READERS.get(ending, read_edge_list) is read_edge_list


def read_graph_as(path: Source, read: Mapping[str, Any], **options: Any) -> SignedDigraph:
    """Read a file as another graph was read; see :func:`read_graph`.

    Parameters
    ----------
    path : str, Path or file object
    read : mapping
        ``graph.read`` of the other graph, or of its certificate.
    **options : keywords of :func:`read_graph`
        Count in place of what ``read`` says.

    Returns
    -------
    SignedDigraph

    Raises
    ------
    FormatError, ParameterError
        See :func:`read_graph`.

    Examples
    --------
    >>> graph = read_graph(StringIO("a,b,1"), orientation="listens")
    >>> read_graph_as(StringIO("a,b,1"), graph.read) == graph
    True
    """
    return read_graph(path, **keywords_as(path, read) | options)


def keywords_as(path: Source, read: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords with which :func:`read_graph` reads a file as another graph was read.

    Examples
    --------
    >>> keywords_as("g.csv", read_graph(StringIO("a,b,1"), orientation="listens").read)
    {'orientation': 'listens', 'duplicates': 'refuse', 'drop_self_loops': False, 'undirected': False}
    """
    turned = "information" if name_and_ending(path)[1] in MATRICES else "listens"  # each kind has its own default
    return {
        "orientation": turned if read["orientation"] == turned else None,
        "duplicates": {"refused": "refuse"}.get(read["duplicates"], read["duplicates"]),
        "drop_self_loops": read["self_loops"] != "refused",
        "undirected": read["undirected"],
    }


def reading_flags(read: Mapping[str, Any]) -> str:
    """Return how a graph was read, as flags of the command line.

    Parameters
    ----------
    read : mapping
        ``graph.read``.

    Returns
    -------
    str

    Examples
    --------
    >>> reading_flags(read_graph(StringIO("a,b,1"), orientation="listens", duplicates="sum").read)
    '--edges listens --duplicates sum'
    """
    words = ["a matrix" if read["orientation"] == "matrix" else f"--edges {read['orientation']}"]
    words += [f"--duplicates {read['duplicates']}"] * (read["duplicates"] != "refused")
    words += ["--drop-self-loops"] * (read["self_loops"] != "refused")
    words += ["--undirected"] * bool(read["undirected"])
    return " ".join(words)


def _refuse_unknown(option: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise ParameterError(f'{option} "{shorten(str(value))}" is unknown; use one of {", ".join(choices)}')


def write_graph(graph: SignedDigraph, path: str | os.PathLike[str]) -> None:
    """Write a graph as CSV ``source,target,weight`` that :func:`read_graph` reads back as an equal graph.

    Weights are written as ``p`` or ``p/q``. Rows with one field declare isolated nodes, or all nodes where these are
    not in the order of their numbers.

    Parameters
    ----------
    graph : SignedDigraph
    path : str or Path
        Ends in .csv, .txt, .edges or .edgelist, or one of these and .gz.

    Raises
    ------
    GraphError
        It is no ``SignedDigraph``.
    FormatError
        The file cannot be written, its ending belongs to another format, or a label would not be read back: it is
        empty, has blanks around it, or is no Unicode text.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a, b", "c", "0.1")], nodes=["lonely"])
    >>> with TemporaryDirectory() as folder:
    ...     write_graph(graph, f"{folder}/graph.csv")
    ...     read_graph(f"{folder}/graph.csv") == graph
    True
    """
    if not isinstance(graph, SignedDigraph):
        raise GraphError(f"{shorten(repr(graph))} is no SignedDigraph; give ptcc_certify.as_graph of it")
    refuse_no_path(path)
    name, ending = name_and_ending(path)
    if not is_edge_list(ending):
        raise FormatError(f"{name}: graphs are written as edge lists; let the name end in .csv")
    data = edge_list(graph, name)
    packed = os.fspath(path).lower().endswith((".gz", ".gzip"))
    write_atomically(path, gzip.compress(data, mtime=0) if packed else data)
