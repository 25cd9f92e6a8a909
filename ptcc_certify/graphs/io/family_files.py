"""Families of graphs from files: weights in intervals, shares of uncertainty, edges that may fail, files as modes."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import FormatError, GraphError, NumberError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode, read_share
from ptcc_certify.graphs.io.columns_beside import column_of, signs_beside_intervals
from ptcc_certify.graphs.io.edge_list import direction_of_comments, records
from ptcc_certify.graphs.io.files import Source, name_and_ending
from ptcc_certify.graphs.io.graph_files import MATRICES, format_of, graph_bytes, is_edge_list, read_graph
from ptcc_certify.graphs.io.signs import find, is_sign, sign_of_word, weight_and_sign
from ptcc_certify.graphs.io.table_columns import BY_HEADER, IGNORED, edge_columns
from ptcc_certify.graphs.rationals import as_fraction, format_exact, parse_exact, shorten
from ptcc_certify.graphs.reading import Reading, option_flags

_LEAST = ("weight_min", "min_weight", "w_min", "least", "min", "lower")
_LARGEST = ("weight_max", "max_weight", "w_max", "largest", "max", "upper")
_OPTIONAL = ("optional", "may_fail")
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
_YES, _NO = ("yes", "true", "1", "x"), ("no", "false", "0", "")

Pair = tuple[Hashable, Hashable]
Row = tuple[str, str, Fraction, Fraction]


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
    for number, path in enumerate(sources, 1):
        rows = _interval_rows(path, orientation or "information", share, undirected)
        name = stem = _mode_name(path, number)
        again = number
        while name in named:  # no mode may take the place of another
            name, again = f"{stem} ({again})", again + 1
        if rows is not None:
            if any(value != getattr(Reading, option) for option, value in options.items()):
                raise ParameterError("rows with intervals are neither merged nor dropped; mend them in the file")
            nodes, edges = rows
            off = set(wanted) & {pair for edge in edges for pair in _both(edge[:2], undirected)}
            edges = [_may_fail(edge) if off & set(_both(edge[:2], undirected)) else edge for edge in edges]
            named[name] = Family.from_intervals(edges, nodes, undirected=undirected)
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
    name, ending = name_and_ending(path)
    if not is_edge_list(ending) or (path == "-") or (hasattr(path, "read") and not hasattr(path, "seek")):
        return False
    data = graph_bytes(path, name, ending)
    if hasattr(path, "seek"):
        path.seek(0)
    if not is_edge_list(format_of(data, ending)):
        return False
    rows = ([field.strip() for field in row] for _, row in records(data, name))
    first = next((row for row in rows if len(row) > 1), [])
    return edge_columns(first, name) is not None and interval_columns(first, name) != (None, None, None)


def interval_columns(first: Sequence[str], place: str) -> tuple[int | None, int | None, int | None]:
    """Return the columns of the least and the largest weight, and that of edges that may fail; None of each it lacks.

    Raises
    ------
    FormatError
        One end of the intervals is named without the other.

    Examples
    --------
    >>> interval_columns(["source", "target", "weight_min", "weight_max"], "a.csv")
    (2, 3, None)
    """
    low, high, may_fail = (find(first, names, place) for names in (_LEAST, _LARGEST, _OPTIONAL))
    if (low is None) != (high is None):
        raise FormatError(f"{place}: the header names one end of the intervals; name weight_min and weight_max")
    return low, high, may_fail


def truth(answer: object) -> bool | None:
    """Return what an answer to "optional" means; None if it means nothing.

    Examples
    --------
    >>> truth("Yes"), truth(False), truth("perhaps")
    (True, False, None)
    """
    text = str(answer).strip().lower()
    return text in _YES if text in (*_YES, *_NO) else None


def refuse_outside(weight: object, least: Fraction, largest: Fraction, place: str) -> None:
    """Refuse a weight that stands beside an interval and lies outside of it; what is no number says nothing.

    Examples
    --------
    >>> refuse_outside("n/a", Fraction(1), Fraction(2), "row 1"), refuse_outside(1.5, Fraction(1), Fraction(2), "row 1")
    (None, None)
    """
    try:
        number = as_fraction(weight, "weight")  # type: ignore[arg-type]
    except (NumberError, TypeError):
        return
    if not least <= number <= largest:
        ends = f"{format_exact(least)} to {format_exact(largest)}"
        raise GraphError(f"{place}: weight {format_exact(number)} lies outside of its interval, {ends}; mend one")


def _both(pair: Sequence[str], undirected: bool) -> list[tuple[str, str]]:
    return [(pair[0], pair[1])] + [(pair[1], pair[0])] * undirected


def _has(graph: SignedDigraph | Mode, pair: tuple[str, str]) -> bool:
    index = {label: k for k, label in enumerate(graph.labels) if label in pair}
    source, target = (index.get(label, -1) for label in pair)
    return bool(((graph.source == source) & (graph.target == target)).any())


def _may_fail(row: Row) -> Row:
    return row[0], row[1], min(row[2], Fraction(0)), max(row[3], Fraction(0))


def _interval_rows(
    path: Source, orientation: str, share: Fraction, undirected: bool
) -> tuple[list[str], list[Row]] | None:
    """Return nodes and rows of an edge list whose header names intervals or optional edges; None of other files."""
    name, ending = name_and_ending(path)
    if not is_edge_list(ending) or (path == "-") or (hasattr(path, "read") and not hasattr(path, "seek")):
        return None
    data = graph_bytes(path, name, ending)
    if hasattr(path, "seek"):
        path.seek(0)
    if not is_edge_list(format_of(data, ending)):
        return None
    lines = [(number, [field.strip() for field in row]) for number, row in records(data, name) if any(row)]
    first = next((row for _, row in lines if len(row) > 1), [])
    if (ends := edge_columns(first, name)) is None:
        return None
    low, high, may_fail = columns = interval_columns(first, name)
    if columns == (None, None, None):
        return None
    if low is None and ends[2] is None:
        raise FormatError(f"{name}: the header names no weight; name a column weight, or weight_min and weight_max")
    _refuse_other_readings(first, low is not None, data, name, undirected)
    if low is not None and share:
        raise FormatError(f"{name}: gives intervals itself; leave out the uncertainty, or write those of all files")
    if orientation != "information":
        ends = ends[1], ends[0], ends[2]
    nodes: dict[str, None] = {}
    rows: dict[tuple[str, str], tuple[int, Row]] = {}
    body = lines[1 + next(k for k, (_, fields) in enumerate(lines) if fields == first) :]
    if low is None:
        body = _with_numbers(body, weight_and_sign(first, name)[0])
    others = [k for k in range(len(first)) if k not in (*ends, *columns)]
    full = [[*row, *[""] * len(first)] for _, row in body if len(row) > 1]
    weights = [row[k] for row in full for k in (low, high, ends[2]) if k is not None]
    if text := signs_beside_intervals([column_of(first[k], (row[k] for row in full)) for k in others], weights):
        raise FormatError(f"{name}: {text}")
    for number, row in body:
        where = f"{name}, line {number}"
        if len(row) > len(first) and any(row[len(first) :]):
            raise FormatError(
                f"{where}: {len(row)} fields, and the header has {len(first)}; quote fields with separators"
            )
        if len([*filter(None, row)]) == 1:
            nodes[row[0] or row[-1]] = None
            continue
        edge = _row(row, ends, (low, high, may_fail), where, share)
        nodes |= dict.fromkeys(edge[:2])
        if again := next((rows[pair] for pair in _both(edge[:2], undirected) if pair in rows), None):
            mend = "an edge of both signs is two files (modes), or one interval with 0 inside"
            if again[1][:2] != edge[:2]:
                mend = "--undirected makes each row both directions; keep one, or leave out --undirected"
            raise FormatError(f"{where}: second row for edge {_text(edge)} (the first is line {again[0]}); {mend}")
        rows[edge[:2]] = number, edge
    if not nodes:
        raise FormatError(f"{name}: no edge and no node below the header; give rows")
    return list(nodes), [row for _, row in rows.values()]


def _refuse_other_readings(first: Sequence[str], intervals: bool, data: bytes, name: str, undirected: bool) -> None:
    """Refuse a column of signs beside weights or intervals, and comments that say of undirected edges."""
    weight, sign = weight_and_sign(first, name)
    beside = sign if sign is not None or not intervals else weight
    if beside is not None and is_sign(first[beside]):
        mend = "write the sign into the weights or both ends of the intervals, and leave the column out"
        raise FormatError(f'{name}: a column "{shorten(first[beside])}" beside the weights; {mend}')
    if (said := direction_of_comments(data, name)) and not undirected:
        raise FormatError(f"{name}: {said} means undirected edges; let each go both ways with --undirected")


def _with_numbers(body: list[tuple[int, list[str]]], weight: int | None) -> list[tuple[int, list[str]]]:
    """Return rows with 1 and -1 in the place of words for signs, where their weights are nothing else."""
    rows = [row for _, row in body if weight is not None and weight < len(row) and row[weight]]
    if weight is not None and rows and all(sign_of_word(row[weight]) for row in rows):
        for row in rows:
            row[weight] = str(sign_of_word(row[weight]))
    return body


def _text(edge: Sequence[Any]) -> str:
    return f"{shorten(edge[0])} -> {shorten(edge[1])}"


def _row(
    row: list[str],
    ends: tuple[int, int, int | None],
    columns: Sequence[int | None],
    where: str,
    share: Fraction,
) -> Row:
    """Return source, target, least and largest weight of a row, or refuse it."""
    field = lambda k: row[k] if k is not None and k < len(row) else ""  # noqa: E731
    source, target = field(ends[0]), field(ends[1])
    edge = _text((source, target))
    if not source or not target:
        raise FormatError(
            f"{where}: the {'source' if not source else 'target'} is empty; name a node or remove the row"
        )
    low, high, may_fail = columns
    try:
        if low is None:
            weight = parse_exact(field(ends[2]))
            least, largest = sorted((weight * (1 - share), weight * (1 + share)))
        else:
            least, largest = parse_exact(field(low)), parse_exact(field(high))
    except NumberError as error:
        raise FormatError(f"{where}: edge {edge}: {error}; give a number") from None
    if (answer := truth(field(may_fail))) is None:
        raise FormatError(f"{where}: optional is {shorten(field(may_fail))}; write yes or no")
    if least > largest:
        raise FormatError(
            f"{where}: edge {edge}: its least weight {least} is above its largest {largest}; exchange them"
        )
    if low is not None and ends[2] is not None:
        refuse_outside(field(ends[2]), least, largest, f"{where}: edge {edge}")
    if least == largest == 0:
        raise FormatError(f"{where}: edge {edge}: its weight is always 0; remove the row")
    if source == target:
        raise FormatError(f"{where}: self-loop at node {shorten(source)}; remove it")
    found = source, target, least, largest
    return _may_fail(found) if answer else found
