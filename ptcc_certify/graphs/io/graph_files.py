"""Signed digraphs from files of any format, and to edge lists."""

from __future__ import annotations

import gzip
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.digraph import WAY, SignedDigraph, graph_of
from ptcc_certify.graphs.io.edge_list import edge_list, read_edge_list
from ptcc_certify.graphs.io.files import Source, name_and_ending, read_bytes, refuse_no_path, write_atomically
from ptcc_certify.graphs.io.json_graphs import read_json
from ptcc_certify.graphs.io.matrix_files import read_mat, read_mtx, read_npy, read_npz
from ptcc_certify.graphs.io.networkx_formats import read_gexf, read_gml, read_graphml
from ptcc_certify.graphs.io.pajek import read_pajek
from ptcc_certify.graphs.io.raw_edges import Rows
from ptcc_certify.graphs.io.sif import read_sif
from ptcc_certify.graphs.io.table_columns import LISTENS
from ptcc_certify.graphs.io.ucinet import read_dl
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading, option_flags, options_of_record
from ptcc_certify.graphs.recognised_files import refuse_content_as_graph

MATRICES = {"mtx": read_mtx, "npz": read_npz, "npy": read_npy, "mat": read_mat}
_GRAPHS = {
    "graphml": read_graphml,
    "gml": read_gml,
    "gexf": read_gexf,
    "json": read_json,
    **dict.fromkeys(("net", "paj", "pajek"), read_pajek),
    "dl": read_dl,
    "sif": read_sif,
}
#: Endings of files that are no edge lists.
OTHER_FORMATS = (*_GRAPHS, *MATRICES)
_READERS = dict.fromkeys(("csv", "tsv", "txt", "edges", "edgelist"), read_edge_list) | _GRAPHS | MATRICES
#: Readers that take an option.
_TAKEN = {
    "columns": (read_edge_list, read_graphml, read_gml, read_gexf, read_json),
    "variable": (read_pajek, read_npz, read_mat),
}
#: How files of some formats begin, which other endings may hide.
_BEGINNINGS = {
    rb"<\?xml[^>]*>\s*(<!--.*?-->\s*)*<graphml\b|<graphml\b": "graphml",
    rb"<\?xml[^>]*>\s*(<!--.*?-->\s*)*<gexf\b|<gexf\b": "gexf",
    rb"\*(vertices|network)\s": "pajek",
    rb"dl\s+n(m|r|c)?\s*=": "dl",
    rb"(creator\b[^\n]*\n\s*)?graph\s*\[": "gml",
    rb"\{\s*[\"}]": "json",
}


def read_graph(
    path: Source,
    *,
    orientation: str | None = None,
    duplicates: Literal["refuse", "sum", "last"] = "refuse",
    drop_self_loops: bool = False,
    drop_zeros: bool = False,
    undirected: bool = False,
    laplacian: bool | None = None,
    columns: str | Sequence[str] | None = None,
    variable: str | None = None,
    format: str | None = None,
) -> SignedDigraph:
    r"""Read a signed digraph from a file.

    An **edge list** has one edge ``source,target,weight`` per line. Commas, tabs, semicolons or blanks separate the
    fields, whichever the first row uses; beside semicolons and tabs ``0,5`` is 0.5; ``#`` and ``%`` begin comment
    lines; fields may be quoted; a row with one field declares a node. A first row of known names (source, from, src,
    fromnodeid; target, to, dst, tonodeid; weight, sign, rating, value, w, strength, magnitude) is a header, and columns
    are then found by name; so is a first row such as ``Gene1,Gene2,Type`` above numbers or signs. Words for signs
    (``+``, ``-``, activates, inhibits, ..) are 1 and -1 where a column holds nothing else; a column ``sign`` or
    ``type`` beside ``weight`` is its factor, as is another of signs beside weights that are all positive. Columns that
    are not read are told by ``graph.read["notes"]``. A table may be a **matrix**, plain, with labels, or in brackets.

    **GraphML, GML, GEXF, node-link JSON** edges need an attribute ``weight`` (or ``sign``, or both), **Pajek** and
    **UCINET DL** a third column; **SIF** has rows ``a activates b c``. A **matrix** (Matrix Market, ``.npz``, ``.npy``,
    ``.mat``, ``.dl``, text) has listeners as rows unless ``orientation`` says otherwise: entry (k, l) is what k makes
    of l. What may be one thing or another is refused with what would tell it.

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
    drop_self_loops, drop_zeros, undirected : bool
        Drop self-loops, or edges of weight 0, instead of refusing them. Let each edge go both ways; a file that says
        itself that it is undirected is refused without this.
    laplacian : bool, optional
        The matrix is a signed Laplacian ``D - W``, whose weights are minus its entries. A matrix whose diagonal holds
        the sums of its rows is refused unless this says what it is.
    columns : str or sequence of str, optional
        Source, target and weight of a table, by title or number from 1, as ``"from,to,score"``; of nodes and edges with
        attributes the last counts.
    variable : str, optional
        Which of several matrices, networks or relations.
    format : str, optional
        One of the endings csv, tsv, txt, edges, edgelist, graphml, gml, gexf, json, net, paj, pajek, dl, sif, mtx, npz,
        npy, mat. Otherwise the ending of the name tells it, or the first bytes.

    Returns
    -------
    SignedDigraph
        ``graph.read`` tells how the file was read: ``orientation`` ("matrix" for one whose rows listen), ``duplicates``
        ("refused", "sum" or "last"), ``self_loops`` ("refused" or "dropped N"), ``undirected`` and ``notes``;
        ``zeros``, ``laplacian``, ``columns`` and ``variable`` where these were asked for.

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
    how = Reading(
        orientation=orientation,
        duplicates=duplicates,
        drop_self_loops=drop_self_loops,
        drop_zeros=drop_zeros,
        undirected=undirected,
        laplacian=laplacian,
        columns=columns,
        variable=variable,
    )
    return read_as(path, how, format)


def read_as(path: Source, how: Reading, format: str | None = None, ask: bool = False) -> SignedDigraph:
    """Read a file; ``ask`` for the direction of a matrix that is not told.

    Examples
    --------
    >>> read_as(StringIO("a,b,1"), Reading(orientation="listens")).edges[0]
    ('b', 'a', Fraction(1, 1))
    """
    rows, name = _rows(path, how, format)
    return _graph(rows, name, how, ask)


def _graph(rows: Rows, name: str, how: Reading, ask: bool = False) -> SignedDigraph:
    if ask and rows.matrix and how.orientation is None:
        raise GraphError(f"{name}: a matrix {WAY}")
    if how.orientation is not None:
        rows.notes = tuple(note for note in rows.notes if not note.endswith(LISTENS))
    return graph_of(rows, name, how)


def _rows(path: Source, how: Reading, format: str | None = None) -> tuple[Rows, str]:
    """Return what a file says, and its name."""
    name, ending = name_and_ending(path)
    ending = ending if format is None else str(format).lower().lstrip(".")
    if format and ending not in _READERS:
        raise ParameterError(f'format "{shorten(ending)}" is unknown; use one of {", ".join(_READERS)}')
    data = graph_bytes(path, name, ending)
    ending = ending if format else format_of(data, ending)
    reader = _READERS.get(ending, read_edge_list)
    for option, readers in _TAKEN.items():
        if reader not in readers:
            how.refuse(
                option, name, "a table of edges" if reader is read_edge_list else f"files in the format {ending}"
            )
    return reader(data, name, how), name


def format_of(data: bytes, ending: str) -> str:
    """Return the format of a file: what its ending says, or its first bytes where that says an edge list.

    Examples
    --------
    >>> format_of(b"<graphml>", "txt"), format_of(b"a,b,1", "csv")
    ('graphml', 'csv')
    """
    begin = data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    for pattern, kind in _BEGINNINGS.items():
        if is_edge_list(ending) and re.match(pattern, begin, re.IGNORECASE | re.DOTALL):
            return kind
    return ending


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


def keywords_as(path: Source, read: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords with which :func:`read_graph` reads a file as another graph was read.

    Parameters
    ----------
    path : Source
        Asked only whether it holds a matrix, which has another direction by default.
    read : mapping
        ``graph.read`` of that graph.

    Examples
    --------
    >>> how = keywords_as(StringIO("a,b,1"), read_graph(StringIO("a,b,1"), orientation="listens").read)
    >>> how["orientation"], how["duplicates"]
    ('listens', 'refuse')
    """
    asked = options_of_record(read)
    rows, way = _rows(path, Reading(**asked))[0], read["orientation"]
    if rows.asks:
        return {"orientation": "listens" if way == "matrix" else way, **asked}
    turned = "information" if rows.matrix else "listens"
    return {"orientation": way if way == turned else None, **asked}


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
    return " ".join(words + option_flags(options_of_record(read)))


def write_graph(graph: SignedDigraph, path: str | os.PathLike[str]) -> None:
    """Write a graph as CSV ``source,target,weight`` that :func:`read_graph` reads back as an equal graph.

    Weights are written as ``p`` or ``p/q``. Rows ``node,,`` declare isolated nodes, or all nodes where these are not
    in the order of their numbers.

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
