"""Signed digraphs and families of them from files of any format, and graphs to edge lists."""

from __future__ import annotations

import gzip
import os
import re
from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, NamedTuple

from lmi.exact.decimal_rounding import counted, near
from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.digraph import WAY, SignedDigraph, graph_of
from ptcc_certify.graphs.family import Family, Mode, read_share
from ptcc_certify.graphs.io.columns_beside import column_of, signs_beside_intervals
from ptcc_certify.graphs.io.edge_list import direction_of_comments, edge_list, read_edge_list, records
from ptcc_certify.graphs.io.files import Source, name_and_ending, read_bytes, refuse_no_path, write_atomically
from ptcc_certify.graphs.io.intervals import Entry, Interval, interval_columns, may_fail, numbers_of_words
from ptcc_certify.graphs.io.json_graphs import read_json
from ptcc_certify.graphs.io.matrix_files import read_mat, read_mtx, read_npy, read_npz
from ptcc_certify.graphs.io.networkx_formats import read_gexf, read_gml, read_graphml
from ptcc_certify.graphs.io.pajek import read_pajek
from ptcc_certify.graphs.io.rows import Rows
from ptcc_certify.graphs.io.sif import read_sif
from ptcc_certify.graphs.io.signs import is_sign, weight_and_sign
from ptcc_certify.graphs.io.table_columns import BY_HEADER, IGNORED, RATERS, edge_columns
from ptcc_certify.graphs.io.ucinet import read_dl
from ptcc_certify.graphs.kinds_of_file import refuse_content_as_graph
from ptcc_certify.graphs.rationals import format_exact, shorten
from ptcc_certify.graphs.reading import Reading, option_flags, options_of_record

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


#: Keywords of :func:`read_family` and of what type they are in a certificate.
_KEYWORDS: dict[str, Any] = {
    "orientation": (str, type(None)),
    "duplicates": str,
    "drop_self_loops": bool,
    "drop_zeros": bool,
    "undirected": bool,
    "laplacian": (bool, type(None)),
    "columns": (str, type(None)),
    "variable": (str, type(None)),
    "uncertainty": str,
    "optional": list,
}
#: What files are whose rows have the directions of ``graph.read``.
_WAYS = {"matrix": "a matrix as text", "information": "a table of edges"}

Pair = tuple[Hashable, Hashable]


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
    fields, whichever the first row uses; ``#`` and ``%`` begin comment lines; fields may be quoted; a row with one
    field declares a node. A first row of known names (source, from, src, fromnodeid; target, to, dst, tonodeid;
    weight, sign, rating, value, w, strength, magnitude) is a header, and columns are then found by name; so is a first
    row such as ``Gene1,Gene2,Type`` above numbers or signs. Words for signs (``+``, ``-``, activates, inhibits, ..) are
    1 and -1 where a column holds nothing else; a column ``sign`` or ``type`` beside ``weight`` is its factor, as is
    another of signs beside weights that are all positive. Columns that are not read are told by
    ``graph.read["notes"]``. A table may be a **matrix**, plain, with labels, or in brackets.

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
        rows.notes = tuple(note for note in rows.notes if note != RATERS)
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
    turned = "information" if rows.matrix else "listens"
    return {"orientation": way if way == turned or rows.asks else None, **asked}


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


def read_family(
    paths: Source | Sequence[Source],
    *,
    uncertainty: Any = 0,
    optional: Iterable[Pair] = (),
    orientation: str | None = None,
    undirected: bool = False,
    **options: Any,
) -> Family:
    r"""Read a family of signed digraphs: one mode from each file.

    An edge list whose header names ``weight_min`` and ``weight_max`` gives the interval of each weight, with its sign:
    ``-3,-2`` is an opponent; 0 at one end is an edge that may fail; 0 inside, a weight of unknown sign, becomes two
    such edges, one of each sign. A column ``optional`` (yes or no) marks edges that may fail. Any other file is read
    as :func:`read_graph` reads it.

    Parameters
    ----------
    paths : str, Path, file object, or sequence of these
        Several files are modes, of which any may act at any instant; each is named by its file.
    uncertainty : number or str
        Of weights that are given as one number: a share from 0 to 1, or a text as "10%".
    optional : iterable of (source, target)
        Edges that may fail, in every mode that has them: from who is heard to who listens, whatever the orientation.
    orientation : {"information", "listens"}, optional
        As in :func:`read_graph`.
    undirected : bool
        As in :func:`read_graph`; an undirected edge is one parameter, both directions change together.
    **options : Any
        Others of :func:`read_graph`, not for files with intervals.

    Returns
    -------
    Family
        ``family.read`` has the keywords that read the files again.

    Raises
    ------
    FormatError
        A file is no graph; an interval is empty, has both ends 0, or occurs twice: the line is named.
    GraphError
        An optional edge is in no file, or two files have different nodes.

    Examples
    --------
    >>> family = read_family(StringIO("source,target,weight_min,weight_max\na,b,1,2\nb,a,-1,0\n"))
    >>> family, family.modes[0].edge_interval(0)
    (Family(2 nodes, 2 of 2 weights uncertain, 1 edge optional), (Fraction(-1, 1), Fraction(0, 1)))
    >>> read_family([StringIO("a,b,1"), StringIO("b,a,1")], uncertainty="10%")
    Family(2 nodes, 2 modes, 2 of 2 weights uncertain)
    """
    one = isinstance(paths, str | Path) or hasattr(paths, "read")
    sources: list[Any] = [paths] if one else list(paths)  # type: ignore[arg-type]
    share, wanted = read_share(uncertainty), [(str(s), str(t)) for s, t in optional]
    named: dict[str, Family] = {}
    ways, notes = dict[str, str](), list[str]()
    missing = set(wanted)
    record: dict[str, Any] = {}
    for number, path in enumerate(sources, 1):
        dropped = [option for option in _DROPS if options.get(option)]
        rows = _interval_rows(path, orientation or "information", share, undirected, dropped)
        name = stem = _mode_name(path, number)
        again = number
        while name in named:  # no mode may take the place of another
            name, again = f"{stem} ({again})", again + 1
        if rows is not None:
            for option, value in options.items():
                if option not in _DROPS and value != getattr(Reading, option):
                    why = "are not merged" if option == "duplicates" else "are read by their header"
                    raise ParameterError(option, f"is not for rows with intervals, which {why}; leave it out")
            nodes, edges, left_out, by_header = rows
            notes += [f"{shorten(name_and_ending(path)[0])}: {BY_HEADER}, whatever their order"] if by_header else []
            told = " and ".join(counted(left_out[kind], kind) for kind in sorted(left_out, reverse=True))
            notes += [f"{shorten(name_and_ending(path)[0])}: {told} dropped"] if left_out else []
            both = [{*_both(edge[:2], undirected)} for edge in edges]
            off = set(wanted) & set[tuple[str, str]]().union(*both)
            edges = [(*e[:2], *may_fail(*e[2:])) if off & pairs else e for e, pairs in zip(edges, both, strict=True)]
            named[name] = Family.from_intervals(edges, nodes, undirected=undirected)
            how = Reading(orientation=orientation, undirected=undirected, **options)
            record = how.record(False, left_out[LOOP], left_out[ZERO]) | {"notes": (BY_HEADER,) * by_header}
        else:
            graph = read_graph(path, orientation=orientation, undirected=undirected, **options)
            if orientation is None and name_and_ending(path)[1] not in MATRICES:
                ways[graph.read["orientation"]] = name
            notes += [
                f"{shorten(name)}: {note}" for note in graph.read["notes"] if not note.startswith((IGNORED, BY_HEADER))
            ]
            off = {pair for pair in wanted if _has(graph, pair)}
            named[name] = Family.from_graph(graph, uncertainty=share, optional=off)
        missing -= off
    if missing:
        source, target = min(missing)
        turned = any(_has(mode, (target, source)) for family in named.values() for mode in family.modes)
        mend = f"{_text((target, source))} is: name the one who is heard first" if turned else "check the labels"
        raise GraphError(f"optional edge {_text((source, target))} is in no file; {mend}")
    if len(ways) > 1:
        told = " and ".join(f"{shorten(name)} is {_WAYS[way]}" for way, name in ways.items())
        raise GraphError(f"{told}: say --edges listens or information, which counts for both")
    orientation = "listens" if "matrix" in ways else orientation  # a matrix as text, whose ending does not tell it
    read = {"orientation": orientation, "undirected": undirected, **options}
    read |= {"uncertainty": format_exact(share), "optional": [list(pair) for pair in wanted]}
    family = Family.switching(named)
    if record and family.graph is not None:  # one file with intervals, in which all weights are known
        family.graph.read.update(record)
    again_given = _given_again([str(path) for path in sources], [*named])
    return replace(family, read=read, notes=(*family.notes, *again_given, *notes))


def _given_again(paths: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return a note about each file that is given more than once."""
    notes = []
    for path in dict.fromkeys(paths):
        if len(same := [name for other, name in zip(paths, names, strict=True) if other == path]) > 1:
            modes = ", ".join(shorten(name) for name in same)
            notes.append(f"{shorten(Path(path).name)} was given {len(same)} times: modes {modes} are the same")
    return tuple(notes)


def keywords_of(read: Any) -> dict[str, Any]:
    """Return the keywords of :func:`read_family` that a certificate tells; none where it tells anything else.

    Examples
    --------
    >>> keywords_of(read_family(StringIO("a,b,1"), uncertainty="10%").read)
    {'orientation': None, 'undirected': False, 'uncertainty': '1/10', 'optional': []}
    >>> keywords_of({"uncertainty": [1]})
    {}
    """
    if not isinstance(read, Mapping) or not all(name in _KEYWORDS for name in read):
        return {}
    fits = all(isinstance(value, _KEYWORDS[name]) for name, value in read.items())
    pairs = read.get("optional", []) if fits else []
    texts = all(isinstance(p, list) and len(p) == 2 and all(isinstance(end, str) for end in p) for p in pairs)
    return dict(read) if fits and texts else {}


def family_flags(read: Mapping[str, Any], path: str = "") -> str:
    """Return how a family was read from files, one of them ``path``, as flags of the command line.

    Examples
    --------
    >>> family_flags(read_family(StringIO("a,b,1"), uncertainty="10%", optional=[("a", "b")]).read)
    '--edges information --uncertainty 10% --optional a,b'
    """
    way = read.get("orientation")
    matrix = way is None and name_and_ending(path)[1] in MATRICES
    words = ["a matrix" if matrix else f"--edges {way or 'information'}"]
    words += option_flags(read)
    if (share := read.get("uncertainty", "0")) not in ("0", 0):
        words.append(f"--uncertainty {percent(share)}")
    return " ".join(words + [f"--optional {','.join(pair)}" for pair in read.get("optional", ())])


def percent(share: str) -> str:
    """Write a share as a percentage, if that is a short decimal.

    Examples
    --------
    >>> percent("1/20"), percent("1/3")
    ('5%', '1/3')
    """
    short = near(100 * read_share(share), 6)
    return share if "/" in short or short.startswith("~") else f"{short}%"


def _mode_name(path: Source, number: int) -> str:
    """Return what the mode of a file is called: as the file, ``stdin``, or by its number."""
    if path == "-" or getattr(path, "name", None) in ("standard input", "<stdin>"):
        return "stdin"
    return Path(re.sub(r"\.gz$", "", str(path))).stem if isinstance(path, str | Path) else str(number)


def is_family_file(path: Source) -> bool:
    """Tell whether a file gives weights in intervals, or edges that may fail: by its header alone.

    Examples
    --------
    >>> is_family_file(StringIO("source,target,weight_min,weight_max")), is_family_file(StringIO("a,b,1"))
    (True, False)
    """
    return _family_table(path) is not None


#: Options that leave rows with intervals out.
_DROPS = ("drop_self_loops", "drop_zeros")
#: What they leave out.
LOOP, ZERO = "self-loop", "row of weight 0"


class _FamilyTable(NamedTuple):
    """A table whose header names intervals, or edges that may fail."""

    name: str
    data: bytes
    header: list[str]
    ends: tuple[int, int, int | None]  # columns of source, target and weight
    columns: tuple[int | None, int | None, int | None]  # of the least and the largest weight, and of what may fail
    rows: Iterator[tuple[int, list[str]]]  # below the header


def _family_table(path: Source) -> _FamilyTable | None:
    name, ending = name_and_ending(path)
    if not is_edge_list(ending) or (path == "-") or (hasattr(path, "read") and not hasattr(path, "seek")):
        return None
    data = graph_bytes(path, name, ending)
    if hasattr(path, "seek"):
        path.seek(0)
    if not is_edge_list(format_of(data, ending)):
        return None
    rows = ((number, [field.strip() for field in row]) for number, row in records(data, name))
    header = next((row for _, row in rows if len(row) > 1), [])
    if (ends := edge_columns(header, name)) is None:
        return None
    columns = interval_columns(header, name)
    return None if columns == (None, None, None) else _FamilyTable(name, data, header, ends, columns, rows)


def _interval_rows(
    path: Source, orientation: str, share: Fraction, undirected: bool, dropped: Collection[str]
) -> tuple[list[str], list[Interval], Counter[str], bool] | None:
    """Return nodes and rows of an edge list whose header names intervals or optional edges; None of other files.

    Also how many rows were dropped, and whether sources stand elsewhere than in the first column.
    """
    if (table := _family_table(path)) is None:
        return None
    name, data, header, ends, columns, below = table
    low, by_header = columns[0], ends[0] > 0
    ends = ends if orientation == "information" else (ends[1], ends[0], ends[2])
    if low is None and ends[2] is None:
        raise FormatError(f"{name}: the header names no weight; name a column weight, or weight_min and weight_max")
    _refuse_other_readings(header, low is not None, data, name, undirected)
    if low is not None and share:
        raise FormatError(f"{name}: gives intervals itself; leave out the uncertainty, or write those of all files")
    nodes, edges = dict[str, None](), list[tuple[int, list[str]]]()
    for number, row in below:
        if any(row[len(header) :]):
            what = f"{len(row)} fields, and the header has {len(header)}; quote fields with separators"
            raise FormatError(f"{name}, line {number}: {what}")
        filled = [*filter(None, row)]
        if len(filled) > 1:
            edges.append((number, row + [""] * (len(header) - len(row))))
        nodes |= dict.fromkeys([row[k] for k in ends[:2]] if len(filled) > 1 and len(row) > 1 else filled)
    if not nodes:
        raise FormatError(f"{name}: no edge and no node below the header; give rows")
    column = lambda k: [None] * len(edges) if k is None else [row[k] for _, row in edges]  # noqa: E731
    numbers = [column(k) for k in (ends[2], *columns[:2])]
    beside = [column_of(header[k], column(k)) for k in range(len(header)) if k not in (*ends, *columns)]
    if text := signs_beside_intervals(beside, (weight for some in numbers for weight in some)):
        raise FormatError(f"{name}: {text}")
    if low is None:
        numbers[0] = numbers_of_words(numbers[0])
    optional = [""] * len(edges) if columns[2] is None else column(columns[2])
    first, second = (column(k) for k in ends[:2])
    rows: dict[tuple[str, str], tuple[int, Interval]] = {}
    left_out = Counter[str]()
    for (number, _), source, target, *told in zip(edges, first, second, *numbers, optional, strict=True):
        where = f"{name}, line {number}"
        if not source or not target:
            empty = "target" if source else "source"
            raise FormatError(f"{where}: the {empty} is empty; name a node or remove the row")
        entry = Entry(f"{where}: edge {_text((source, target))}", source, target, *told)
        if (kind := _kind_to_drop(entry, where, dropped)) is not None:
            left_out[kind] += 1
            continue
        try:
            edge = entry.interval(share)
        except GraphError as error:
            raise FormatError(str(error)) from None
        if again := next((rows[pair] for pair in _both(edge[:2], undirected) if pair in rows), None):
            mend = "an edge of both signs is two files (modes), or one interval with 0 inside"
            if again[1][:2] != edge[:2]:
                mend = "--undirected makes each row both directions; keep one, or leave out --undirected"
            raise FormatError(f"{where}: second row for edge {_text(edge)} (the first is line {again[0]}); {mend}")
        rows[edge[:2]] = number, edge
    return list(nodes), [row for _, row in rows.values()], left_out, by_header


def _kind_to_drop(entry: Entry, where: str, dropped: Collection[str]) -> str | None:
    """Return what a row is that an option drops, and refuse it without that option; None of every other row."""
    if entry.source == entry.target:
        if "drop_self_loops" in dropped:
            return LOOP
        mend = "remove it, or drop all with --drop-self-loops"
        raise FormatError(f"{where}: self-loop at node {shorten(entry.source)}; {mend}")
    if entry.always_zero:
        if "drop_zeros" in dropped:
            return ZERO
        raise FormatError(f"{entry.place}: its weight is always 0; remove it, or drop all with --drop-zeros")
    return None


def _both(pair: Sequence[str], undirected: bool) -> list[tuple[str, str]]:
    source, target = pair
    return [(source, target), (target, source)] if undirected else [(source, target)]


def _has(graph: SignedDigraph | Mode, pair: tuple[str, str]) -> bool:
    index = {label: k for k, label in enumerate(graph.labels) if label in pair}
    source, target = (index.get(label, -1) for label in pair)
    return bool(((graph.source == source) & (graph.target == target)).any())


def _refuse_other_readings(first: Sequence[str], intervals: bool, data: bytes, name: str, undirected: bool) -> None:
    """Refuse a column of signs beside weights or intervals, and comments that say of undirected edges."""
    weight, sign = weight_and_sign(first, name)
    beside = sign if sign is not None or not intervals else weight
    if beside is not None and is_sign(first[beside]):
        mend = "write the sign into the weights or both ends of the intervals, and leave the column out"
        raise FormatError(f'{name}: a column "{shorten(first[beside])}" beside the weights; {mend}')
    if (said := direction_of_comments(data, name)) and not undirected:
        raise FormatError(f"{name}: {said} means undirected edges; let each go both ways with --undirected")


def _text(edge: Sequence[Any]) -> str:
    return f"{shorten(edge[0])} -> {shorten(edge[1])}"
