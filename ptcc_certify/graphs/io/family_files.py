"""Families of signed digraphs from files."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import GraphError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode, read_share
from ptcc_certify.graphs.io.files import Source, name_and_ending
from ptcc_certify.graphs.io.graph_files import MATRICES, read_graph
from ptcc_certify.graphs.io.interval_edges import may_fail
from ptcc_certify.graphs.io.interval_rows import read_interval_rows
from ptcc_certify.graphs.io.table_columns import BY_HEADER
from ptcc_certify.graphs.rationals import format_exact, shorten
from ptcc_certify.graphs.reading import Reading, option_flags

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
    how = Reading(orientation=orientation, undirected=undirected, **options)
    one = isinstance(paths, str | Path) or hasattr(paths, "read")
    if not one and not isinstance(paths, Iterable):
        raise ParameterError("paths", f"= {shorten(repr(paths))} is no file; give a path, or a list of paths")
    sources: list[Any] = [paths] if one else list(paths)  # type: ignore[arg-type]
    share, wanted = read_share(uncertainty), _pairs(optional)
    named: dict[str, Family] = {}
    ways, notes = dict[str, str](), list[str]()
    missing = set(wanted)
    record: dict[str, Any] = {}
    for number, path in enumerate(sources, 1):
        name = stem = _mode_name(path, number)
        again = number
        while name in named:  # no mode may take the place of another
            name, again = f"{stem} ({again})", again + 1
        rows, mode = read_interval_rows(path, how, share), f"{shorten(name)}: " if len(sources) > 1 else ""
        if rows is not None:
            notes += [f"{mode}{note}" for note in (*rows.notes, *rows.dropped)]
            both = [{*_both(edge[:2], undirected)} for edge in rows.edges]
            off = set(wanted) & set[tuple[str, str]]().union(*both)
            edges = [
                (*e[:2], *may_fail(*e[2:])) if off & pairs else e for e, pairs in zip(rows.edges, both, strict=True)
            ]
            named[name] = Family.from_intervals(edges, rows.nodes, undirected=undirected)
            record = how.record(False, rows.loops, rows.zeros) | {"notes": rows.notes}
        else:
            graph = read_graph(path, orientation=orientation, undirected=undirected, **options)
            if orientation is None and name_and_ending(path)[1] not in MATRICES:
                ways[graph.read["orientation"]] = name
            notes += [f"{mode}{note}" for note in graph.read["notes"] if note != BY_HEADER]
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


def _pairs(optional: Any) -> list[tuple[str, str]]:
    """Return the edges that may fail, by label, or refuse what are no pairs."""
    pairs = [*optional] if isinstance(optional, Iterable) and not isinstance(optional, str | bytes) else [optional]
    for pair in pairs:
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            mend = 'give pairs of who is heard and who listens, such as [("a", "b")]'
            raise ParameterError("optional", f"holds {shorten(repr(pair))}, which is no edge; {mend}")
    return [(str(source), str(target)) for source, target in pairs]


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


def _both(pair: Sequence[str], undirected: bool) -> list[tuple[str, str]]:
    source, target = pair
    return [(source, target), (target, source)] if undirected else [(source, target)]


def _has(graph: SignedDigraph | Mode, pair: tuple[str, str]) -> bool:
    index = {label: k for k, label in enumerate(graph.labels) if label in pair}
    source, target = (index.get(label, -1) for label in pair)
    return bool(((graph.source == source) & (graph.target == target)).any())


def _text(edge: Sequence[Any]) -> str:
    return f"{shorten(edge[0])} -> {shorten(edge[1])}"
