"""Files in and out: signed digraphs in every common format, starts, and writing that is whole or not at all.

Every format is turned into the same rows (first label, second label, weight, place in the file), and one routine
checks the rows and builds the graph; so a rule of the reader holds for all formats, and a refusal names file, line
and mend. Text formats keep the weight as the text that it is until :func:`ptcc_certify.rationals.parse_exact` reads
it: ``0.1`` in a CSV, GraphML, GML, Pajek or Matrix Market file is 1/10, exactly what the shortest decimal of a float
says. Binary formats (``.npz``, ``.npy``, ``.mat``) hold floats, and a float is the dyadic number that it is.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import struct
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Literal, TypeVar

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, NumberError, ParameterError, PTCCError
from ptcc_certify.graph import LARGEST_WEIGHT, SMALLEST_WEIGHT, SignedDigraph, Weights, ordered_labels
from ptcc_certify.rationals import format_exact, nearest_float, parse_exact, shorten

MAX_BYTES = 2**30
"""A file, unpacked, may have this many bytes."""
MAX_LINE = 65_536
"""A line of a text file may have this many characters."""
MAX_NODES = 2 * 10**6
"""A matrix or a Pajek file may declare this many nodes: their number stands in the file, not the nodes themselves."""

_EDGE_LIST = "edge list"
_FORMATS = {
    **dict.fromkeys(("csv", "tsv", "txt", "edges", "edgelist"), _EDGE_LIST),
    **{"graphml": "graphml", "gml": "gml", "net": "pajek", "pajek": "pajek"},
    **{"mtx": "mtx", "npz": "npz", "npy": "npy", "mat": "mat"},
}
_MATRIX_FORMATS = {"mtx", "npz", "npy", "mat"}
_ORIENTATIONS = ("information", "listens")
_DUPLICATES = ("refuse", "sum", "last")
_SEPARATORS = ("\t", ",", ";", None)
_SOURCE = ("source", "from", "fromnodeid", "src")
_TARGET = ("target", "to", "tonodeid", "dst")
_WEIGHT = ("weight", "sign", "rating", "value", "w")
_NODE = ("node", "label", "name", "id")
_VALUE = ("value", "state", "x", "x0", "sigma0")
_QUOTED = re.compile(r'"((?:[^"]|"")*)"')
_GZIP = b"\x1f\x8b"
_MAT_COMPRESSED, _MAT_MATRIX, _MAT_SPARSE = 15, 14, 5
_MAT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_NAMED_AT_MOST = 5

_T = TypeVar("_T")
Source = str | os.PathLike[str] | IO[str] | IO[bytes]


@dataclass
class _Rows:
    """What a file says, before any rule is applied; row ``r`` is ``labels[first[r]], labels[second[r]], weight``."""

    labels: list[str]
    first: Sequence[int] | np.ndarray
    second: Sequence[int] | np.ndarray
    values: Sequence[Any] | np.ndarray  # the distinct weights: texts, Fractions or float64
    codes: Sequence[int] | np.ndarray  # row r has the weight values[codes[r]]
    where: Callable[[int], str]  # ", line 14" of row 13
    undirected: str = ""  # what in the file says that its edges have no direction
    headerless: bool = False
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Options:
    orientation: str
    duplicates: str
    drop_self_loops: bool
    undirected: bool


# ---------------------------------------------------------------------------------------------- reading a graph


def read_graph(
    path: Source,
    *,
    orientation: str | None = None,
    duplicates: Literal["refuse", "sum", "last"] = "refuse",
    drop_self_loops: bool = False,
    undirected: bool = False,
    format: str | None = None,
) -> SignedDigraph:
    r"""Read a signed digraph from a file, its weights exactly.

    An **edge list** has one edge ``source,target,weight`` per line. Commas, tabs, semicolons or blanks separate the
    fields, whichever the first row uses; ``#`` and ``%`` begin comment lines; fields may be quoted; a row with one
    field declares a node. A first row of known names (source, from, src, fromnodeid; target, to, dst, tonodeid;
    weight, sign, rating, value, w) is a header, and columns are then found by name. Columns beyond the three are
    ignored, which ``graph.read["notes"]`` says. **GraphML, GML and Pajek** edges need an attribute ``weight``
    (or ``sign``), in Pajek the third column. A **matrix** (Matrix Market, ``.npz``, ``.npy``, ``.mat``) has
    listeners as rows: entry (k, l) is what k makes of l.

    Parameters
    ----------
    path : str, Path or file object
        ``"-"`` is standard input. The ending tells the format, gzip is recognised by its content; anything unknown
        is an edge list.
    orientation : {"information", "listens"}, optional
        Does a row ``a,b,w`` say that information flows a -> b (the default), or that a listens to b, as in trust
        and rating data? A matrix needs no orientation, and none may be given.
    duplicates : {"refuse", "sum", "last"}
        What becomes of two rows for the same ordered pair.
    drop_self_loops : bool
        Drop self-loops instead of refusing them.
    undirected : bool
        Each edge goes both ways. A file that says itself that it is undirected is refused without this.
    format : str, optional
        One of the endings csv, tsv, txt, edges, edgelist, graphml, gml, net, pajek, mtx, npz, npy, mat.

    Returns
    -------
    SignedDigraph
        ``graph.read`` tells how the file was read: ``orientation`` ("information", "listens" or "matrix"),
        ``duplicates`` ("refused", "sum" or "last"), ``self_loops`` ("refused" or "dropped N"), ``undirected`` and
        ``notes``.

    Raises
    ------
    FormatError
        The file cannot be opened, is no file of its format, or is no signed digraph: a weight that is not a finite
        number, a weight 0 (an unknown sign is not an edge), a repeated edge, a self-loop, no node at all.
    ParameterError
        An option has an unknown value, or an orientation is given for a matrix.

    Examples
    --------
    >>> from io import StringIO
    >>> graph = read_graph(StringIO("a,b,1\nb,c,-0.1\n"))
    >>> graph.edges
    (('a', 'b', Fraction(1, 1)), ('b', 'c', Fraction(-1, 10)))
    >>> read_graph(StringIO("a,b,nan\n"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ptcc_certify.errors.FormatError: input, line 1: weight "nan" of edge a -> b is not a finite number; ...
    """
    if orientation is not None and orientation not in _ORIENTATIONS:
        raise ParameterError(f'orientation "{shorten(str(orientation))}" is unknown; use information or listens')
    if duplicates not in _DUPLICATES:
        raise ParameterError(f'duplicates "{shorten(str(duplicates))}" is unknown; use refuse, sum or last')
    if format is not None and format.lower().lstrip(".") not in _FORMATS:
        raise ParameterError(f'format "{shorten(format)}" is unknown; use one of {", ".join(_FORMATS)}')
    name, ending = _name(path)
    kind = _FORMATS.get(ending if format is None else format.lower().lstrip("."), _EDGE_LIST)
    if kind in _MATRIX_FORMATS and orientation is not None:
        raise ParameterError(
            f"{name}: the rows of a matrix are the listeners, so it needs no orientation; leave it out"
        )
    data = _unpacked(_content(path, name), name)
    rows = _READERS[kind](data, name)
    matrix = kind in _MATRIX_FORMATS
    options = _Options(
        "matrix" if matrix else orientation or "information", duplicates, bool(drop_self_loops), bool(undirected)
    )
    return _Draft(rows, name, options).graph()


class _Draft:
    """Rows on their way to a graph; the steps run in the order of :meth:`graph`."""

    def __init__(self, rows: _Rows, name: str, options: _Options):
        self.rows, self.name, self.options = rows, name, options
        first, second = np.asarray(rows.first, dtype=np.int64), np.asarray(rows.second, dtype=np.int64)
        self.source, self.target = (second, first) if options.orientation == "listens" else (first, second)
        self.codes = np.asarray(rows.codes, dtype=np.int64)
        self.row = np.arange(first.size)  # place of each remaining edge in the file
        self.notes = list(rows.notes)

    def graph(self) -> SignedDigraph:
        rows, options = self.rows, self.options
        if not rows.labels:
            raise FormatError(f"{self.name}: no edge and no node in this file; give rows source,target,weight")
        if rows.undirected and not options.undirected:
            raise FormatError(
                f"{self.name}: {rows.undirected} means undirected edges; let each go both ways with --undirected"
            )
        values = self.exact_values()
        loops = self.drop_self_loops()
        self.refuse_zeros(values)
        values = self.merge_duplicates(values)
        if options.undirected:
            self.source, self.target = np.append(self.source, self.target), np.append(self.target, self.source)
            self.codes = np.append(self.codes, self.codes)
        labels, rank = ordered_labels(rows.labels)
        read = {
            "orientation": options.orientation,
            "duplicates": "refused" if options.duplicates == "refuse" else options.duplicates,
            "self_loops": f"dropped {loops}" if options.drop_self_loops else "refused",
            "undirected": options.undirected,
            "notes": tuple(self.notes),
        }
        try:
            return SignedDigraph(labels, rank[self.source], rank[self.target], Weights(values, self.codes), read)
        except GraphError as error:
            raise FormatError(f"{self.name}: {error}") from None

    def keep(self, mask: np.ndarray) -> None:
        self.source, self.target, self.codes = self.source[mask], self.target[mask], self.codes[mask]
        self.row = self.row[mask]

    def place(self, edge: int) -> str:
        return f"{self.name}{self.rows.where(int(self.row[edge]))}"

    def edge(self, edge: int) -> str:
        labels = self.rows.labels
        return f"{shorten(labels[self.source[edge]])} -> {shorten(labels[self.target[edge]])}"

    def edges(self, edges: np.ndarray) -> str:
        names = ", ".join(self.edge(i) for i in edges[:_NAMED_AT_MOST].tolist())
        return names + (", ..." if edges.size > _NAMED_AT_MOST else "")

    def exact_values(self) -> Sequence[Fraction] | np.ndarray:
        """Parse the distinct weights; refuse the first edge whose weight is no number or beyond float64."""
        values = self.rows.values
        bad: dict[int, tuple[str, str]] = {}  # code -> what stands before and after the name of the edge
        if isinstance(values, np.ndarray):
            for code in np.flatnonzero(~np.isfinite(values)).tolist():
                bad[code] = f"weight {values[code]}", " is not a finite number; remove the entry or give a weight"
            self.refuse_weights(bad)
            return values
        exact: list[Fraction] = []
        for code, value in enumerate(values):
            exact.append(Fraction(0))
            try:
                exact[-1] = parse_exact(value) if isinstance(value, str) else value
            except NumberError as error:
                bad[code] = _about_weight(value, str(error))
            if exact[-1] and not SMALLEST_WEIGHT <= abs(nearest_float(exact[-1])) <= LARGEST_WEIGHT:
                bad[code] = "weight", " is outside the range of float64; rescale the weights"
        self.refuse_weights(bad)
        return exact

    def refuse_weights(self, bad: dict[int, tuple[str, str]]) -> None:
        if bad:
            edge = int(np.flatnonzero(np.isin(self.codes, list(bad)))[0])
            before, after = bad[int(self.codes[edge])]
            header = edge == 0 and self.rows.headerless and "finite" not in after
            hint = "; if this row is a header, name its columns source, target, weight" if header else ""
            raise FormatError(f"{self.place(edge)}: {before} of edge {self.edge(edge)}{after}{hint}")

    def drop_self_loops(self) -> int:
        loops = np.flatnonzero(self.source == self.target)
        if loops.size and not self.options.drop_self_loops:
            count = f" ({loops.size} in all)" if loops.size > 1 else ""
            label = shorten(self.rows.labels[self.source[loops[0]]])
            raise FormatError(
                f"{self.place(int(loops[0]))}: self-loop at node {label}{count}; "
                "remove it, or drop all with --drop-self-loops"
            )
        if loops.size:
            self.keep(self.source != self.target)
        return int(loops.size)

    def refuse_zeros(self, values: Sequence[Fraction] | np.ndarray) -> None:
        zeros = [code for code, value in enumerate(values) if not value]
        if not zeros:
            return
        edges = np.flatnonzero(np.isin(self.codes, zeros))
        if edges.size:
            more = f"; {edges.size} edges have weight 0: {self.edges(edges)}" if edges.size > 1 else ""
            raise FormatError(
                f"{self.place(int(edges[0]))}: weight 0 of edge {self.edge(int(edges[0]))}, and an unknown sign is "
                f"not an edge{more}; remove each or give a weight"
            )

    def merge_duplicates(self, values: Sequence[Fraction] | np.ndarray) -> Sequence[Fraction] | np.ndarray:
        """Refuse or merge the rows of one pair (of one unordered pair, if edges go both ways); return the weights."""
        low, high = self.source, self.target
        if self.options.undirected:
            low, high = np.minimum(low, high), np.maximum(low, high)
        key = low * len(self.rows.labels) + high
        order = np.argsort(key, kind="stable")
        again = key[order][1:] == key[order][:-1]
        if not again.any():
            return values
        if self.options.duplicates == "refuse":
            second = int(order[1:][again].min())
            first = int(np.flatnonzero(key == key[second])[0])
            earlier = self.rows.where(int(self.row[first])).lstrip(", ") or "an earlier one"
            raise FormatError(
                f"{self.place(second)}: second row for edge {self.edge(second)} (the first is {earlier}; "
                f"{int(again.sum())} repeated in all); keep one, or merge with --duplicates sum|last"
            )
        starts = np.flatnonzero(np.append(True, ~again))
        ends = np.append(starts[1:], order.size)
        exact = [Fraction(v) for v in values]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            if end - start > 1:
                rows = order[start:end]
                if self.options.duplicates == "last":
                    self.codes[rows[0]] = self.codes[rows[-1]]
                else:
                    exact.append(sum((exact[c] for c in self.codes[rows].tolist()), Fraction(0)))
                    self.codes[rows[0]] = len(exact) - 1
        kept = np.zeros(order.size, dtype=bool)
        kept[order[starts]] = True
        repeated = int(order.size - starts.size)
        self.keep(kept)
        zeros = np.flatnonzero(np.array([v == 0 for v in exact], dtype=bool)[self.codes])
        if zeros.size:
            raise FormatError(
                f"{self.place(int(zeros[0]))}: the rows of edge {self.edge(int(zeros[0]))} add up to 0, and an unknown "
                f"sign is not an edge; {zeros.size} such in all: {self.edges(zeros)}; remove these rows"
            )
        self.notes.append(f"{repeated} repeated rows were merged ({self.options.duplicates})")
        return exact


def _about_weight(text: str, message: str) -> tuple[str, str]:
    """Split what :func:`parse_exact` says about a weight, to be joined by the name of the edge."""
    quoted = f'"{shorten(text)}"'
    mend = "; write decimals with a point" if "," in text else "; remove the row or give a weight"
    if message.startswith(quoted):
        return f"weight {quoted}", message.removeprefix(quoted) + mend
    return "weight", f": {message}{mend}"


# ---------------------------------------------------------------------------------------------- bytes and text


def _one_line(error: BaseException) -> str:
    """Return the reason of an exception on one line."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return shorten(" ".join(str(error).split()), 160) or type(error).__name__


def _reads(what: str) -> Callable[[Callable[[Any, str], _T]], Callable[[Any, str], _T]]:
    """Decorate ``reader(data, name)``: whatever another library raises becomes one line, its warnings are silenced."""

    def decorate(reader: Callable[[Any, str], _T]) -> Callable[[Any, str], _T]:
        @wraps(reader)
        def guarded(data: Any, name: str) -> _T:
            import warnings

            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    return reader(data, name)
            except PTCCError:
                raise
            except Exception as error:
                raise FormatError(f"{name}: not {what} that can be read ({_one_line(error)}); write it again") from None

        return guarded

    return decorate


def _name(path: Source) -> tuple[str, str]:
    """Return the name for messages and the lower-case ending without dot, .gz left aside."""
    if isinstance(path, str | os.PathLike):
        text = os.fspath(path)
        if text == "-":
            return "standard input", ""
    else:
        text = getattr(path, "name", None) or "input"
        if not isinstance(text, str):
            return "input", ""
    lower = re.sub(r"\.gz(ip)?$", "", text.lower())
    return shorten(text, 200), lower.rpartition(".")[2] if "." in lower else ""


def _content(path: Source, name: str) -> bytes | str:
    """Read at most MAX_BYTES from a path, standard input or a file object."""
    try:
        if isinstance(path, str | os.PathLike):
            if os.fspath(path) == "-":
                data: bytes | str = getattr(sys.stdin, "buffer", sys.stdin).read(MAX_BYTES + 1)
            elif Path(path).is_dir():
                raise FormatError(f"{name}: is a directory; name a file")
            else:
                with Path(path).open("rb") as file:
                    data = file.read(MAX_BYTES + 1)
                if data and not data.startswith(_GZIP) and name.lower().endswith(".gz"):
                    raise FormatError(f"{name}: not a gzip file; rename it without .gz, or fetch it again")
        elif hasattr(path, "read"):
            data = path.read(MAX_BYTES + 1)
        else:
            raise FormatError(f"{type(path).__name__} is neither a path nor a file object; name a file")
    except PTCCError:
        raise
    except FileNotFoundError:
        raise FormatError(f"{name}: no such file; check the path") from None
    except UnicodeDecodeError:
        raise FormatError(f"{name}: not UTF-8 text; save it as UTF-8, or open it as a binary file") from None
    except (OSError, ValueError) as error:
        raise FormatError(f"{name}: cannot be read ({_one_line(error)})") from None
    if not isinstance(data, bytes | str):
        raise FormatError(f"{name}: a file object gives {type(data).__name__}, neither text nor bytes")
    if len(data) > MAX_BYTES:
        raise FormatError(f"{name}: more than {MAX_BYTES} bytes; split the file")
    return data


@_reads("a gzip file")
def _unpacked(data: bytes | str, name: str) -> bytes | str:
    """Undo gzip, up to MAX_BYTES."""
    if isinstance(data, str) or not data.startswith(_GZIP):
        return data
    import gzip

    with gzip.GzipFile(fileobj=BytesIO(data)) as file:
        unpacked = file.read(MAX_BYTES + 1)
    if len(unpacked) > MAX_BYTES:
        raise FormatError(f"{name}: unpacks to more than {MAX_BYTES} bytes; split the file")
    return unpacked


def _lines(data: bytes | str, name: str) -> list[str]:
    r"""Decode UTF-8 and split at ``\n`` (at ``\r`` in files without ``\n``); a ``\r`` before ``\n`` stays."""
    if isinstance(data, bytes):
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise FormatError(f"{name}: UTF-16 text; save it as UTF-8")
        if (nul := data.find(b"\0")) >= 0:
            raise FormatError(f"{name}, line {data.count(10, 0, nul) + 1}: a NUL byte; this is not a text file")
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise FormatError(
                f"{name}, line {line}: byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
            ) from None
    else:
        text = data
        if (nul := text.find("\0")) >= 0:
            raise FormatError(f"{name}, line {text.count(chr(10), 0, nul) + 1}: a NUL; this is not a text file")
    text = text.removeprefix("\ufeff")
    lines = text.split("\n") if "\n" in text else text.split("\r")
    if len(text) > MAX_LINE and max(map(len, lines)) > MAX_LINE:
        number = next(i for i, line in enumerate(lines, 1) if len(line) > MAX_LINE)
        raise FormatError(
            f"{name}, line {number}: longer than {MAX_LINE} characters; break it, or name the format of the file"
        )
    return lines


# ---------------------------------------------------------------------------------------------- edge lists


class _OpenQuoteError(Exception):
    """A quoted field does not end within the text."""


def _split(line: str, separator: str | None) -> list[str | None]:
    """Split a row into stripped fields, honouring quotes; an empty field without quotes is None.

    Raises ``_OpenQuoteError``, and ValueError where text follows a closing quote.
    """
    if '"' not in line:
        return [text.strip() or None for text in line.split(separator)]
    fields: list[str | None] = []
    at, end = 0, len(line)

    def skip_blanks(at: int) -> int:
        while at < end and line[at].isspace() and line[at] != separator:
            at += 1
        return at

    while True:
        at = skip_blanks(at)
        if at == end and separator is None:
            return fields
        if at < end and line[at] == '"':
            match = _QUOTED.match(line, at)
            if match is None:
                raise _OpenQuoteError
            fields.append(match[1].replace('""', '"'))
            after = match.end()
            at = skip_blanks(after)
            if at < end and not (line[at] == separator if separator else at > after):
                raise ValueError
        elif separator is None:
            start = at
            while at < end and not line[at].isspace():
                at += 1
            fields.append(line[start:at])
        else:
            start, at = at, line.find(separator, at)
            at = end if at < 0 else at
            fields.append(line[start:at].strip() or None)
        if separator is not None:
            if at == end:
                return fields
            at += 1


def _detect(line: str) -> str | Literal[False] | None:
    """Return the separator of a row: the first to give three fields, else the first to give two, else False.

    Filled fields count first, so that ``a;b;0,5`` is split at its semicolons; then empty ones, as in ``a;;``.
    """
    rows = []
    for separator in _SEPARATORS:
        with suppress(_OpenQuoteError, ValueError):
            rows.append((separator, _split(line, separator)))
    for filled in (True, False):
        for wanted in (3, 2):
            for separator, row in rows:
                if len(row) - filled * row.count(None) >= wanted:
                    return separator
    return False


def _is_comment(line: str) -> bool:
    stripped = line.lstrip()
    return not stripped or stripped[0] in "#%"


class _Table:
    """The rows of a separated text file, one at a time; knows the number of the line it is at."""

    def __init__(self, lines: list[str], name: str):
        self.name = name
        self.lines = iter(lines)
        self.separator: str | None = ","
        self.detected = False
        self.line = 0  # number of the last line taken
        self.extra = 0  # further lines that the last row took, because of line breaks within quotes

    def place(self) -> str:
        return f"{self.name}, line {self.line}"

    def split(self, line: str) -> list[str | None]:
        """Split the row that begins with ``line``, which may take further lines; [] if all fields are empty."""
        if not self.detected and (found := _detect(line)) is not False:
            self.separator, self.detected = found, True
        self.extra = 0
        while True:
            try:
                fields = _split(line, self.separator)
                break
            except ValueError:
                raise FormatError(
                    f'{self.place()}: text follows a closing quote; write a quote within quotes as ""'
                ) from None
            except _OpenQuoteError:
                line = self._longer(line)
        return fields if any(field is not None for field in fields) else []

    def _longer(self, line: str) -> str:
        """Append the lines up to the next with an odd number of quotes, where the quoted field may end."""
        size, parts = len(line), [line]
        for more in self.lines:
            self.extra += 1
            parts.append(more)
            size += len(more) + 1
            if size > MAX_LINE:
                break
            if more.count('"') % 2:
                return "\n".join(parts)
        raise FormatError(f"{self.place()}: a quoted field is not closed; add the closing quote")


def _column(fields: Sequence[str | None], names: tuple[str, ...], place: str) -> int | None:
    """Return the column that bears the first of ``names`` that occurs."""
    lower = [(f or "").lower() for f in fields]
    for name in names:
        if lower.count(name) > 1:
            raise FormatError(f'{place}: two columns are named "{name}"; rename one')
        if name in lower:
            return lower.index(name)
    return None


def _header(fields: Sequence[str | None], place: str) -> tuple[int, int, int] | None:
    """Return the columns of source, target and weight if a row is a header, else None."""
    source, target = _column(fields, _SOURCE, place), _column(fields, _TARGET, place)
    if source is None or target is None:
        return None
    weight = _column(fields, _WEIGHT, place)
    if weight is not None:
        return source, target, weight
    try:
        parse_exact(fields[2] or "" if len(fields) > 2 else "")
    except NumberError:
        raise FormatError(f"{place}: the header names no weight; name one column weight, sign or rating") from None
    return None


class _EdgeList(_Table):
    """The edges of a separated text file.

    Nearly every row of a large file repeats labels and weights; such a row costs three look-ups of its texts as they
    stand, blanks included. All other lines take the slow way.
    """

    def __init__(self, lines: list[str], name: str):
        super().__init__(lines, name)
        self.nodes: dict[str, int] = {}
        self.values: dict[str, int] = {}
        self.plain_nodes: dict[str, int] = {}  # text as it stands -> node; nothing that could begin a comment
        self.plain_values: dict[str, int] = {}
        self.first: list[int] = []
        self.second: list[int] = []
        self.codes: list[int] = []
        self.others: list[int] = []  # the number of edges before each line that is no edge
        self.columns = 0, 1, 2
        self.width = 3
        self.started = self.header = False
        self.ignored: dict[str, None] = {}

    def read(self) -> _Rows:
        first, second, codes = self.first, self.second, self.codes
        nodes, values = self.plain_nodes, self.plain_values
        for line in self.lines:
            self.slow(line)
            if self.started:
                break
        separator, width, (s, t, v) = self.separator, self.width, self.columns
        for line in self.lines:
            fields = line.split(separator)
            if len(fields) != width or '"' in line:
                self.slow(line)
                continue
            try:
                a, b, w = nodes[fields[s]], nodes[fields[t]], values[fields[v]]
            except KeyError:
                if _is_comment(line) or not all(fields[i].strip() for i in (s, t, v)):
                    self.slow(line)
                    continue
                a, b, w = self.node(fields[s]), self.node(fields[t]), self.value(fields[v])
            first.append(a)
            second.append(b)
            codes.append(w)
        return self.rows()

    def node(self, text: str) -> int:
        label = text.strip()
        number = self.nodes.setdefault(label, len(self.nodes))
        if label[0] not in "#%":
            self.plain_nodes[text] = number
        return number

    def value(self, text: str) -> int:
        return self.plain_values.setdefault(text, self.values.setdefault(text.strip(), len(self.values)))

    def slow(self, line: str) -> None:
        """Take a line of any kind."""
        self.line, self.extra = 1 + len(self.first) + len(self.others), 0
        is_edge = not _is_comment(line) and self.row(self.split(line))
        self.others += [len(self.first)] * (self.extra + (not is_edge))

    def row(self, row: list[str | None]) -> bool:
        """Take a row; tell whether it is an edge."""
        if len(row) > 1 and not self.started:
            self.started, self.width = True, max(len(row), 3)
            if (found := _header(row, self.place())) is not None:
                self.header, self.columns = True, found
                self.ignored = {f'"{shorten(x or "")}"': None for i, x in enumerate(row) if i not in found}
                return False
        cells = [row[i] if i < len(row) else None for i in self.columns]
        source, target, weight = cells if len(row) != 1 else (row[0], None, None)
        if target is None and weight is None:
            if source is not None:
                self.nodes.setdefault(source, len(self.nodes))
            elif row:
                raise FormatError(f"{self.place()}: a row without a node; remove it")
            return False
        if source is None or target is None:
            what = "source" if source is None else "target"
            raise FormatError(f"{self.place()}: the {what} is empty; name a node or remove the row")
        if weight is None:
            raise FormatError(
                f"{self.place()}: edge {shorten(source)} -> {shorten(target)} has no weight; add one in a third column"
            )
        if any(row[self.width if self.header else 3 :]):
            self.ignored["beyond the header" if self.header else "after the third"] = None
        self.first.append(self.nodes.setdefault(source, len(self.nodes)))
        self.second.append(self.nodes.setdefault(target, len(self.nodes)))
        self.codes.append(self.values.setdefault(weight, len(self.values)))
        return True

    def rows(self) -> _Rows:
        return _Rows(
            list(self.nodes),
            self.first,
            self.second,
            list(self.values),
            self.codes,
            lambda row: f", line {1 + row + bisect_right(self.others, row)}",
            headerless=self.started and not self.header,
            notes=["columns ignored: " + ", ".join(list(self.ignored)[:20])] if self.ignored else [],
        )


def _read_edge_list(data: bytes | str, name: str) -> _Rows:
    lines = _lines(data, name)
    if lines[0].startswith("%%MatrixMarket"):
        raise FormatError(f'{name}, line 1: a Matrix Market file; name it .mtx or pass the format "mtx"')
    return _EdgeList(lines, name).read()


# ---------------------------------------------------------------------------------------------- other text formats


class _Builder:
    """Collects nodes and edges of a format whose nodes have identifiers besides their labels."""

    def __init__(self, name: str):
        self.name = name
        self.number: dict[str, int] = {}  # identifier -> node
        self.labels: list[str] = []
        self.label_set: set[str] = set()
        self.first: list[int] = []
        self.second: list[int] = []
        self.codes: list[int] = []
        self.code_of: dict[str, int] = {}
        self.places: list[int] = []

    def node(self, identifier: str, label: str, line: int) -> None:
        if identifier in self.number:
            raise FormatError(f"{self.name}, line {line}: node {shorten(identifier)} is declared twice; remove one")
        if label in self.label_set:
            raise FormatError(f'{self.name}, line {line}: two nodes have the label "{shorten(label)}"; rename one')
        self.label_set.add(label)
        self.number[identifier] = len(self.labels)
        self.labels.append(label)

    def edge(self, first: str, second: str, weight: str | None, line: int) -> None:
        for end in (first, second):
            if end not in self.number:
                raise FormatError(
                    f"{self.name}, line {line}: an edge names node {shorten(end)}, which is not declared; declare it"
                )
        a, b = self.number[first], self.number[second]
        if weight is None or not weight.strip():
            raise FormatError(
                f"{self.name}, line {line}: edge {shorten(self.labels[a])} -> {shorten(self.labels[b])} has no weight; "
                "give it an attribute weight or sign"
            )
        self.first.append(a)
        self.second.append(b)
        self.codes.append(self.code_of.setdefault(weight.strip(), len(self.code_of)))
        self.places.append(line)

    def rows(self, undirected: str = "") -> _Rows:
        return _Rows(
            self.labels,
            self.first,
            self.second,
            list(self.code_of),
            self.codes,
            lambda row: f", line {self.places[row]}",
            undirected,
        )


def _read_graphml(data: bytes | str, name: str) -> _Rows:
    from xml.parsers import expat

    reader = _GraphML(name)
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    reader.parser = parser
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.doctype
    try:
        parser.Parse(data, True)
    except PTCCError:
        raise
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "syntax error")
        raise FormatError(f"{name}, line {error.lineno}: not well-formed GraphML ({reason})") from None
    except (ValueError, LookupError) as error:
        raise FormatError(f"{name}: not GraphML that can be read ({_one_line(error)})") from None
    return reader.rows()


class _GraphML:
    """Handlers of an XML parser, for one flat graph; node identifiers are the labels."""

    def __init__(self, name: str):
        self.name = name
        self.parser: Any = None
        self.builder = _Builder(name)
        self.edges: list[tuple[str, str, dict[str, str], int]] = []
        self.directed: set[bool] = set()  # which kinds of edges occur
        self.default_directed: bool | None = None
        self.keys: dict[str, str] = {}  # identifier of an edge attribute -> its name, lower case
        self.defaults: dict[str, str] = {}
        self.key: str | None = None  # the <key> that is open
        self.attributes: dict[str, str] | None = None  # of the <edge> that is open
        self.data: str | None = None  # name of the <data> that is open
        self.buffer: list[str] | None = None
        self.depth_of_graph = 0

    def refuse(self, message: str) -> FormatError:
        return FormatError(f"{self.name}, line {self.parser.CurrentLineNumber}: {message}")

    def doctype(self, *_: object) -> None:
        raise self.refuse("a DOCTYPE declaration, which may define entities; remove it")

    def need(self, attributes: dict[str, str], *names: str) -> list[str]:
        missing = [n for n in names if n not in attributes]
        if missing:
            raise self.refuse(f'an element without the attribute "{missing[0]}"; add it')
        return [attributes[n] for n in names]

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(" ")[2]
        if tag == "graph":
            self.depth_of_graph += 1
            if self.depth_of_graph > 1 or self.default_directed is not None:
                raise self.refuse("a second or nested graph; keep one")
            (default,) = self.need(attributes, "edgedefault")
            self.default_directed = default == "directed"
        elif tag == "key":
            (self.key,) = self.need(attributes, "id")
            if attributes.get("for", "all") in ("edge", "all"):
                self.keys[self.key] = attributes.get("attr.name", self.key).lower()
        elif tag == "node":
            (identifier,) = self.need(attributes, "id")
            self.builder.node(identifier, identifier, self.parser.CurrentLineNumber)
        elif tag == "edge":
            source, target = self.need(attributes, "source", "target")
            own = attributes.get("directed")
            self.directed.add(bool(self.default_directed) if own is None else own == "true")
            self.attributes = {}
            self.edges.append((source, target, self.attributes, self.parser.CurrentLineNumber))
        elif tag == "hyperedge":
            raise self.refuse("a hyperedge; an edge joins two nodes")
        elif tag == "default" and self.key in self.keys:
            self.buffer = []
        elif tag == "data" and self.attributes is not None:
            (key,) = self.need(attributes, "key")
            self.data = self.keys.get(key)
            self.buffer = [] if self.data in ("weight", "sign") else None

    def text(self, text: str) -> None:
        if self.buffer is not None:
            self.buffer.append(text)

    def end(self, tag: str) -> None:
        tag = tag.rpartition(" ")[2]
        if tag == "graph":
            self.depth_of_graph -= 1
        elif tag == "key":
            self.key = None
        elif tag == "default" and self.key is not None and self.buffer is not None:
            self.defaults[self.keys[self.key]] = "".join(self.buffer)
            self.buffer = None
        elif tag == "data" and self.attributes is not None and self.buffer is not None and self.data is not None:
            self.attributes[self.data] = "".join(self.buffer)
            self.buffer = None
        elif tag == "edge":
            self.attributes = None

    def rows(self) -> _Rows:
        if self.default_directed is None:
            raise FormatError(f"{self.name}: no graph element; this is not GraphML")
        if len(self.directed) == 2:
            raise FormatError(
                f"{self.name}: directed and undirected edges are mixed; write each undirected edge as two directed ones"
            )
        for source, target, attributes, line in self.edges:
            weight = next((a[k] for k in ("weight", "sign") for a in (attributes, self.defaults) if k in a), None)
            self.builder.edge(source, target, weight, line)
        undirected = not (self.directed or {self.default_directed}).pop()
        return self.builder.rows('edgedefault="undirected"' if undirected else "")


_GML_TOKEN = re.compile(r'"[^"]*"|#[^\n]*|\[|\]|[^\s"\[\]]+|"')
_GML_KEYS = {"id", "label", "source", "target", "weight", "sign", "directed"}


def _read_gml(data: bytes | str, name: str) -> _Rows:
    from html import unescape

    text = "\n".join(_lines(data, name))
    builder = _Builder(name)
    edges: list[tuple[dict[str, str], int]] = []
    directed, graph_seen = "0", False
    position, line = 0, 1
    stack: list[tuple[str, dict[str, str], int]] = [("", {}, 1)]  # open lists: key, plain values, line
    key: str | None = None
    for match in _GML_TOKEN.finditer(text):
        line += text.count("\n", position, match.start())
        position = match.start()
        token = match[0]
        if token[0] == "#":
            continue
        if token == '"':
            raise FormatError(f"{name}, line {line}: a text is not closed; add the closing quote")
        if token == "]":
            if len(stack) == 1 or key is not None:
                raise FormatError(f'{name}, line {line}: an unexpected "]"; this is not GML')
            closed, values, begun = stack.pop()
            path = [k for k, _, _ in stack[1:]]
            if path == ["graph"] and closed == "node":
                identifier = values.get("id")
                if identifier is None:
                    raise FormatError(f"{name}, line {begun}: a node without id; give it one")
                builder.node(identifier, values.get("label", identifier), begun)
            elif path == ["graph"] and closed == "edge":
                edges.append((values, begun))
            elif not path and closed == "graph":
                directed = values.get("directed", "0")
        elif key is None:
            if token[0] in '"[' or not token[0].isalpha():
                raise FormatError(f'{name}, line {line}: a key is expected, not "{shorten(token)}"; this is not GML')
            key = token
        elif token == "[":
            if len(stack) > 100:
                raise FormatError(f"{name}, line {line}: lists are nested more than 100 deep")
            if len(stack) == 1 and key.lower() == "graph":
                if graph_seen:
                    raise FormatError(f"{name}, line {line}: a second graph; keep one")
                graph_seen = True
            stack.append((key.lower(), {}, line))
            key = None
        else:
            values, key = stack[-1][1], key.lower()
            if key in values and key in _GML_KEYS:
                raise FormatError(f"{name}, line {line}: {shorten(key)} occurs twice in one list; keep one")
            values[key] = unescape(token[1:-1]) if token[0] == '"' else token
            key = None
    if len(stack) > 1 or key is not None:
        raise FormatError(f"{name}, line {stack[-1][2]}: a list is not closed; the file is not whole")
    if not graph_seen:
        raise FormatError(f"{name}: no graph list; this is not GML")
    for values, begun in edges:
        if "source" not in values or "target" not in values:
            raise FormatError(f"{name}, line {begun}: an edge without source or target; give both")
        builder.edge(values["source"], values["target"], values.get("weight", values.get("sign")), begun)
    return builder.rows("" if directed == "1" else "directed 0")


def _read_pajek(data: bytes | str, name: str) -> _Rows:
    builder = _Builder(name)
    section, vertices = "", -1
    sections: set[str] = set()
    declared: dict[str, tuple[str, int]] = {}
    edges: list[tuple[str, str, str | None, int]] = []
    for number, line in enumerate(_lines(data, name), 1):
        place = f"{name}, line {number}"
        stripped = line.strip()
        if not stripped or stripped.startswith(("%", "/*")):
            continue
        try:
            fields = [f or "" for f in _split(stripped, None)]
        except (_OpenQuoteError, ValueError):
            raise FormatError(f"{place}: a quoted label is not closed or not set apart; mend the quotes") from None
        if stripped[0] == "*":
            section = fields[0].lower()
            if section == "*vertices":
                if vertices >= 0 or len(fields) < 2 or not re.fullmatch("[0-9]{1,9}", fields[1], re.ASCII):
                    raise FormatError(f"{place}: give *Vertices once, with the number of nodes")
                vertices = int(fields[1])
                if vertices > MAX_NODES:
                    raise FormatError(f"{place}: {vertices} nodes are more than {MAX_NODES}")
            elif section in ("*arcs", "*edges"):
                sections.add(section)
            elif section != "*network":
                raise FormatError(
                    f"{place}: {shorten(fields[0])} is not read here; give arcs as rows source target weight in *Arcs"
                )
        elif section == "*vertices":
            if fields[0] in declared:
                raise FormatError(f"{place}: node {shorten(fields[0])} is declared twice; remove one")
            declared[fields[0]] = (fields[1] if len(fields) > 1 else fields[0], number)
        elif section in ("*arcs", "*edges"):
            if len(fields) < 2:
                raise FormatError(f"{place}: one field only; a row is source target weight")
            edges.append((fields[0], fields[1], fields[2] if len(fields) > 2 else None, number))
        else:
            raise FormatError(f"{place}: a row before *Vertices; this is not Pajek")
    if vertices < 0:
        raise FormatError(f"{name}: no *Vertices line; this is not Pajek")
    for i in range(1, vertices + 1):
        label, number = declared.pop(str(i), (str(i), 0))
        builder.node(str(i), label, number)
    for identifier, (_, number) in declared.items():
        raise FormatError(f"{name}, line {number}: node {shorten(identifier)} is not one of 1 .. {vertices}")
    if len(sections) == 2:
        raise FormatError(f"{name}: *Arcs and *Edges are mixed; write each undirected edge as two arcs")
    for first, second, weight, number in edges:
        builder.edge(first, second, weight, number)
    return builder.rows("*Edges" if "*edges" in sections else "")


def _read_mtx(data: bytes | str, name: str) -> _Rows:
    lines = _lines(data, name)
    banner = lines[0].lower().split()
    if len(banner) != 5 or banner[:2] != ["%%matrixmarket", "matrix"] or banner[2] not in ("coordinate", "array"):
        raise FormatError(
            f"{name}, line 1: not a Matrix Market banner; it reads %%MatrixMarket matrix coordinate real general"
        )
    layout, kind, symmetry = banner[2:]
    if kind not in ("real", "double", "integer"):
        raise FormatError(f"{name}, line 1: a {shorten(kind)} matrix has no real weights; write it as real or integer")
    if symmetry not in ("general", "symmetric"):
        raise FormatError(f"{name}, line 1: a {shorten(symmetry)} matrix; write it as general")
    body = ((number, line.split()) for number, line in enumerate(lines, 1) if not _is_comment(line))
    number, size = next(body, (1, []))
    wanted = 3 if layout == "coordinate" else 2
    if len(size) != wanted or not all(re.fullmatch("[0-9]{1,15}", x, re.ASCII) for x in size):
        raise FormatError(
            f"{name}, line {number}: no line of sizes; it reads rows columns entries (array: rows columns)"
        )
    n = int(size[0])
    if n != int(size[1]):
        raise FormatError(f"{name}, line {number}: the matrix is {n} x {size[1]}; an adjacency matrix is square")
    if n > MAX_NODES:
        raise FormatError(f"{name}, line {number}: {n} nodes are more than {MAX_NODES}")
    builder = _Builder(name)
    for i in range(1, n + 1):
        builder.node(str(i), str(i), number)
    if layout == "coordinate":
        expected = int(size[2])
        for number, fields in body:
            if len(fields) != 3:
                raise FormatError(f"{name}, line {number}: {len(fields)} fields; an entry is row column weight")
            row, column = (x.lstrip("0") for x in fields[:2])
            if row not in builder.number or column not in builder.number:
                where = f"({shorten(fields[0])}, {shorten(fields[1])})"
                raise FormatError(f"{name}, line {number}: entry {where} lies outside the {n} x {n} matrix")
            builder.edge(column, row, fields[2], number)
        found = len(builder.first)
    else:
        half = symmetry == "symmetric"
        expected, found = n * (n + 1) // 2 if half else n * n, 0
        cells = ((row, column) for column in range(1, n + 1) for row in range(column if half else 1, n + 1))
        zero: dict[str, bool] = {}
        for number, fields in body:
            for text in fields:
                found += 1
                if text not in zero:
                    zero[text] = _is_zero(text)
                cell = next(cells, None)
                if cell is not None and not zero[text]:
                    builder.edge(str(cell[1]), str(cell[0]), text, number)
    if found != expected:
        raise FormatError(f"{name}: {found} entries where the sizes announce {expected}; the file is not whole")
    return builder.rows("a symmetric Matrix Market file" if symmetry == "symmetric" else "")


def _is_zero(text: str) -> bool:
    try:
        return parse_exact(text) == 0
    except NumberError:
        return False  # refused later, with the name of the edge


# ---------------------------------------------------------------------------------------------- binary matrices


def _dense_rows(matrix: np.ndarray, labels: np.ndarray | None, name: str) -> _Rows:
    """Turn a dense matrix into rows; entry (k, l) is the edge l -> k."""
    _refuse_no_adjacency(matrix.shape, matrix.dtype, name)
    target, source = np.nonzero(matrix)
    return _entry_rows(matrix.shape[0], target, source, matrix[target, source], labels, name)


def _refuse_no_adjacency(shape: Sequence[int], dtype: np.dtype, name: str) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        size = " x ".join(map(str, shape)) or "a single number"
        raise FormatError(f"{name}: the matrix is {size}; an adjacency matrix is square")
    if dtype.kind not in "iuf":
        raise FormatError(f"{name}: the matrix holds {dtype}, not real numbers; store it as float64 or int64")
    if shape[0] > MAX_NODES:
        raise FormatError(f"{name}: {shape[0]} nodes are more than {MAX_NODES}")


def _entry_rows(
    n: int, target: np.ndarray, source: np.ndarray, data: np.ndarray, labels: np.ndarray | None, name: str
) -> _Rows:
    """Turn the entries of an n x n matrix into rows; stored zeros are no entries."""
    if not target.shape == source.shape == data.shape == (data.size,):
        raise ValueError("its indices and entries differ in number")
    if data.size and (min(target.min(), source.min()) < 0 or max(target.max(), source.max()) >= n):
        raise FormatError(f"{name}: an entry lies outside the {n} x {n} matrix; write the file again")
    keep = data != 0
    target, source = target[keep], source[keep]
    if labels is None:
        names = [str(i) for i in range(1, n + 1)]
    elif labels.dtype.kind not in "USiu" or labels.shape != (n,):
        raise FormatError(f"{name}: labels must be {n} texts or integers")
    else:
        names = [x.decode("utf-8") if isinstance(x, bytes) else str(x) for x in labels.tolist()]
    values, codes = np.unique(data[keep], return_inverse=True)
    return _Rows(
        names,
        source,
        target,
        values.astype(np.float64) if values.dtype.kind == "f" else [Fraction(v) for v in values.tolist()],
        codes,
        lambda row: f", row {int(target[row]) + 1}, column {int(source[row]) + 1}",
    )


def _binary(data: bytes | str, name: str) -> bytes:
    if isinstance(data, str):
        raise FormatError(f"{name}: a matrix file is binary; open it as such")
    return data


@_reads("a NumPy array")
def _read_npy(data: bytes | str, name: str) -> _Rows:
    data = _binary(data, name)
    if not data.startswith(b"\x93NUMPY"):
        raise FormatError(f"{name}: not a NumPy array file; write it with numpy.save")
    return _dense_rows(np.load(BytesIO(data), allow_pickle=False), None, name)


@_reads("an .npz archive")
def _read_npz(data: bytes | str, name: str) -> _Rows:
    import zipfile

    data = _binary(data, name)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > MAX_BYTES:
            raise FormatError(f"{name}: unpacks to more than {MAX_BYTES} bytes; split the file")
    with np.load(BytesIO(data), allow_pickle=False) as archive:
        arrays = dict(archive)
    labels = arrays.pop("labels", None)
    if "format" in arrays:
        return _sparse_rows(arrays, labels, name)
    numeric = {key: array.shape for key, array in arrays.items() if array.dtype.kind in "iufc"}
    return _dense_rows(arrays[_the_matrix(numeric, arrays, name)], labels, name)


def _sparse_rows(arrays: dict[str, np.ndarray], labels: np.ndarray | None, name: str) -> _Rows:
    """Turn the arrays that ``scipy.sparse.save_npz`` writes into rows.

    SciPy's own conversions trust the index arrays and crash the process where these are damaged; here NumPy checks
    every index.
    """
    layout, data = arrays["format"].item(), arrays["data"]
    layout = layout.decode("ascii") if isinstance(layout, bytes) else str(layout)
    shape = arrays["shape"].tolist()
    _refuse_no_adjacency(shape, data.dtype, name)
    n = int(shape[0])
    if layout == "coo":
        row, column = _integers(arrays["row"]), _integers(arrays["col"])
    elif layout in ("csr", "csc"):
        row = _expanded(_integers(arrays["indptr"]), n, data.size)
        column, data = _integers(arrays["indices"])[: row.size], data[: row.size]
        if layout == "csc":
            row, column = column, row
    elif layout == "bsr":
        _, height, width = data.shape
        block = _expanded(_integers(arrays["indptr"]), n // height, data.shape[0])
        data, along = data[: block.size], _integers(arrays["indices"])[: block.size]
        row = block[:, None, None] * height + np.arange(height)[:, None]
        column = along[:, None, None] * width + np.arange(width)
        row, column = (np.broadcast_to(index, data.shape).ravel() for index in (row, column))
        data = data.ravel()
    elif layout == "dia":
        column = np.broadcast_to(np.arange(data.shape[1]), data.shape)
        row = column - _integers(arrays["offsets"])[:, None]
        inside = (row >= 0) & (row < n) & (column < n)
        row, column, data = row[inside], column[inside], data[inside]
    else:
        raise ValueError(f"a sparse matrix in the unknown layout {layout}")
    return _entry_rows(n, row, column, data, labels, name)


def _integers(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iu" or array.ndim != 1:
        raise ValueError("its indices are not a list of integers")
    return array.astype(np.int64)


def _expanded(start: np.ndarray, n: int, size: int) -> np.ndarray:
    """Return the row (column) ``i`` of each entry of a compressed matrix: ``start[i] <= entry < start[i + 1]``."""
    if start.size != n + 1 or start[0] != 0 or (np.diff(start) < 0).any() or start[-1] > size:
        raise ValueError("its index of rows or columns is inconsistent")
    return np.repeat(np.arange(n), np.diff(start))


@_reads("a MATLAB file")
def _read_mat(data: bytes | str, name: str) -> _Rows:
    """Read a MATLAB 5 file.

    ``scipy.io.loadmat`` crashes the process on some damaged files, so the few structures of a numeric matrix are read
    here: tagged elements, compressed or not, each with flags, dimensions, name and one to three arrays.
    """
    data = _binary(data, name)
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None or data.startswith(b"MATLAB 7.3"):
        raise FormatError(f"{name}: not a MATLAB 5 file (7.3 is HDF5); save the matrix with -v7")
    variables = {}
    for element in _mat_elements(data, order, name):
        variable = _MatVariable(element, order)
        variables[variable.name] = variable
    square = {k: v.shape for k, v in variables.items() if k and v.is_numeric}
    variable = variables[_the_matrix(square, variables, name)]
    if variable.is_complex:
        raise FormatError(f"{name}: the matrix {shorten(variable.name)} is complex, not real; store its real part")
    n = variable.shape[0]
    if not variable.is_sparse:
        return _dense_rows(variable.array().reshape((n, n), order="F"), None, name)
    row, start, values = variable.array(), variable.array(), variable.array()
    _refuse_no_adjacency(variable.shape, values.dtype, name)
    column = _expanded(_integers(start), n, values.size)
    return _entry_rows(n, _integers(row)[: column.size], column, values[: column.size], None, name)


def _mat_tag(data: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Return type and content of the element at ``at``, and where the next one begins."""
    (kind,) = struct.unpack_from(order + "I", data, at)
    if kind >> 16:  # a small element: size and type share one word, the data have the other
        size, start, end = kind >> 16, at + 4, at + 8
        kind &= 0xFFFF
    else:
        (size,) = struct.unpack_from(order + "I", data, at + 4)
        start = at + 8
        end = start + size + (0 if kind == _MAT_COMPRESSED else -size % 8)
    if start + size > min(end, len(data)):
        raise ValueError("it ends within an element")
    return kind, data[start : start + size], end


def _mat_elements(data: bytes, order: str, name: str) -> Iterator[memoryview]:
    """Yield the content of each matrix element, unpacked up to MAX_BYTES in all."""
    import zlib

    at, left = 128, MAX_BYTES
    while at < len(data):
        kind, content, at = _mat_tag(memoryview(data), at, order)
        if kind == _MAT_COMPRESSED:
            unpacked = zlib.decompressobj().decompress(content, left)
            left -= len(unpacked)
            if left <= 0:
                raise FormatError(f"{name}: unpacks to more than {MAX_BYTES} bytes; split the file")
            kind, content, _ = _mat_tag(memoryview(unpacked), 0, order)
        if kind == _MAT_MATRIX:
            yield content


class _MatVariable:
    """The head of a matrix element; :meth:`array` then gives one array after the other."""

    def __init__(self, content: memoryview, order: str):
        self.content, self.order, self.at = content, order, 0
        flags = self.array()
        kind = int(flags[0]) & 0xFF
        self.is_complex, logical = bool(flags[0] & 0x800), bool(flags[0] & 0x200)
        self.is_sparse = kind == _MAT_SPARSE
        self.is_numeric = kind in range(_MAT_SPARSE, 16) and not logical
        self.shape: tuple[int, ...] = ()
        self.name = ""
        if kind <= 16:  # later classes have no dimensions
            self.shape = tuple(self.array().tolist())
            self.name = self.array().tobytes().decode("latin-1")

    def array(self) -> np.ndarray:
        kind, data, self.at = _mat_tag(self.content, self.at, self.order)
        if kind not in _MAT_TYPES:
            raise ValueError("an element has an unknown type")
        return np.frombuffer(data, dtype=self.order + _MAT_TYPES[kind])


def _the_matrix(shapes: dict[str, tuple[int, ...]], variables: Any, name: str) -> str:
    """Return the name of the only square matrix; a single number counts only where there is nothing else."""
    square = [k for k, shape in shapes.items() if len(shape) == 2 and shape[0] == shape[1]]
    square = [k for k in square if shapes[k][0] > 1] or square
    if len(square) != 1:
        held = ", ".join(shorten(str(k)) for k in (square or list(variables))[:20]) or "nothing"
        what = "several square matrices" if square else "no square numeric matrix"
        raise FormatError(f"{name}: {what} among its variables ({held}); keep one")
    return square[0]


_READERS: dict[str, Callable[[bytes | str, str], _Rows]] = {
    _EDGE_LIST: _read_edge_list,
    "graphml": _read_graphml,
    "gml": _read_gml,
    "pajek": _read_pajek,
    "mtx": _read_mtx,
    "npy": _read_npy,
    "npz": _read_npz,
    "mat": _read_mat,
}


# ---------------------------------------------------------------------------------------------- starts


def read_state(text_or_path: str | os.PathLike[str], graph: SignedDigraph) -> list[Fraction]:
    """Read one exact number for each node of a graph.

    Parameters
    ----------
    text_or_path : str or Path
        Numbers in node order ``5,2,-4``; or ``label=value`` in any order, an item with a comma in its label quoted
        whole (``"a,b=1"``); or the path of a file with rows ``node,value`` (header optional, separators, comments
        and quotes as in an edge list).
    graph : SignedDigraph

    Returns
    -------
    list of Fraction
        In node order.

    Raises
    ------
    ParameterError
        The text does not give each node of the graph exactly one finite number.
    FormatError
        The same for a file; names the line.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> read_state("5,-0.5", graph) == read_state("b=-1/2, a=5", graph)
    True
    """
    if _is_path(text_or_path):
        return _state_of_file(text_or_path, graph)
    text = os.fspath(text_or_path)
    try:
        items = [item or "" for item in _split(text, ",")]
    except (_OpenQuoteError, ValueError):
        raise ParameterError(f"start {shorten(text)}: a quote is not closed, or text follows it") from None
    if any("=" in item for item in items):
        pairs = []
        for item in items:
            label, equals, value = item.rpartition("=")
            if not equals:
                raise ParameterError(f'start: "{shorten(item)}" has no node; write each item as label=value')
            pairs.append((label if label in graph.index else label.strip(), value, "start"))
        return _state(pairs, graph, "start", ParameterError)
    if len(items) != graph.n_nodes:
        if len(items) == 1 and not _is_number(items[0]):
            raise ParameterError(f'start: "{shorten(text)}" is neither a number nor a file; check the path')
        raise ParameterError(
            f"start: {len(items)} {'value' if len(items) == 1 else 'values'} for {graph.n_nodes} nodes; "
            f"give one for each of {_some(graph.labels)}"
        )
    return _state([(a, b, "start") for a, b in zip(graph.labels, items, strict=True)], graph, "start", ParameterError)


def _is_path(text: str | os.PathLike[str]) -> bool:
    if not isinstance(text, str):
        return True
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False


def _is_number(text: str) -> bool:
    try:
        parse_exact(text)
    except NumberError:
        return False
    return True


def _some(labels: Sequence[str]) -> str:
    return ", ".join(shorten(x) for x in labels[:_NAMED_AT_MOST]) + (", ..." if len(labels) > _NAMED_AT_MOST else "")


def _state_of_file(path: str | os.PathLike[str], graph: SignedDigraph) -> list[Fraction]:
    name, _ = _name(path)
    table = _Table(_lines(_unpacked(_content(path, name), name), name), name)
    node, value, started = 0, 1, False
    pairs = []
    next_line = 1
    for line in table.lines:
        table.line = next_line
        row = [] if _is_comment(line) else table.split(line)
        next_line = table.line + 1 + (table.extra if row else 0)
        if not row:
            continue
        if not started:
            started = True
            nodes, values = _column(row, _NODE, table.place()), _column(row, _VALUE, table.place())
            if nodes is not None and values is not None:
                node, value = nodes, values
                continue
        if len(row) <= max(node, value) or row[node] is None or row[value] is None:
            raise FormatError(f"{table.place()}: a row needs a node and a value; write node,value")
        pairs.append((row[node] or "", row[value] or "", table.place()))
    return _state(pairs, graph, name, FormatError)


def _state(
    pairs: Sequence[tuple[str, str, str]], graph: SignedDigraph, name: str, refusal: type[PTCCError]
) -> list[Fraction]:
    """Put (label, value, place) in node order."""
    state: dict[str, Fraction] = {}
    for label, text, place in pairs:
        if label not in graph.index:
            raise refusal(f"{place}: node {shorten(label)} is not in the graph; its nodes are {_some(graph.labels)}")
        if label in state:
            raise refusal(f"{place}: node {shorten(label)} has two values; keep one")
        try:
            state[label] = parse_exact(text)
        except NumberError as error:
            raise refusal(f"{place}: value of node {shorten(label)}: {error}; give a finite number") from None
    if missing := [label for label in graph.labels if label not in state]:
        count = f" ({len(missing)} nodes have none: {_some(missing)})" if len(missing) > 1 else ""
        raise refusal(f"{name}: node {shorten(missing[0])} has no value{count}; give one to each node")
    return [state[label] for label in graph.labels]


# ---------------------------------------------------------------------------------------------- writing


def write_graph(graph: SignedDigraph, path: str | os.PathLike[str]) -> None:
    """Write a graph as CSV ``source,target,weight`` that :func:`read_graph` reads back as an equal graph.

    Weights are written exactly, as ``p`` or ``p/q``. A row with one field declares an isolated node; where labels
    are not all integers such rows also keep the order of the nodes.

    Parameters
    ----------
    graph : SignedDigraph
    path : str or Path
        Ends in .csv, .txt, .edges or .edgelist, or one of these and .gz.

    Raises
    ------
    FormatError
        The file cannot be written, its ending belongs to another format, or a label cannot stand in a text file.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> graph = SignedDigraph.from_edges([("a, b", "c", "0.1")], nodes=["lonely"])
    >>> with TemporaryDirectory() as folder:
    ...     write_graph(graph, Path(folder, "graph.csv"))
    ...     print(Path(folder, "graph.csv").read_text(), end="")
    ...     read_graph(Path(folder, "graph.csv")) == graph
    source,target,weight
    lonely
    "a, b",c,1/10
    True
    """
    name, ending = _name(path)
    if _FORMATS.get(ending, _EDGE_LIST) != _EDGE_LIST:
        raise FormatError(f"{name}: graphs are written as edge lists; let the name end in .csv")
    cells = [_cell(label, name) for label in graph.labels]
    data = "".join(line + "\n" for line in _csv_lines(graph, cells)).encode("utf-8")
    if os.fspath(path).lower().endswith((".gz", ".gzip")):
        import gzip

        data = gzip.compress(data, mtime=0)
    write_atomically(path, data)


def _cell(label: str, name: str) -> str:
    """Return a label as a CSV field, quoted where it needs it."""
    try:
        label.encode("utf-8")
    except UnicodeEncodeError:
        raise FormatError(f"{name}: label {shorten(ascii(label))} is not Unicode text; rename the node") from None
    if "\0" in label:
        raise FormatError(f"{name}: label {shorten(label)} contains a NUL; rename the node")
    # Two labels and a weight of 4,000 characters, every character a doubled quote, fit a line.
    if len(label) > MAX_LINE // 5:
        raise FormatError(f"{name}: label {shorten(label)} is longer than {MAX_LINE // 5} characters; rename the node")
    if label and label == label.strip() and label[0] not in '#%"' and not re.search(r'[,"\n\r]', label):
        return label
    return '"' + label.replace('"', '""') + '"'


def _csv_lines(graph: SignedDigraph, cells: list[str]) -> Iterator[str]:
    yield "source,target,weight"
    n = graph.n_nodes
    by_value = ordered_labels(list(graph.labels[::-1]))[0] == list(graph.labels)
    isolated = np.ones(n, dtype=bool)
    isolated[graph.source] = isolated[graph.target] = False
    seen = 0  # the nodes before this one have occurred; only needed where the order of occurrence counts
    for i, (s, t) in enumerate(zip(graph.source.tolist(), graph.target.tolist(), strict=True)):
        new = [k for k in (s, t) if k >= seen]
        if new and not by_value:
            in_order = new == list(range(new[0], new[0] + len(new)))
            yield from cells[seen : new[0] if in_order else max(new) + 1]
            seen = max(new) + 1
        yield f"{cells[s]},{cells[t]},{format_exact(graph.exact_weight(i))}"
    yield from (cells[k] for k in range(n) if (isolated[k] if by_value else k >= seen))


def write_atomically(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write a file that appears whole or not at all.

    The data go to a new file in the same folder, which then takes the place of ``path`` in one step. Links are
    followed, the permissions of an existing file are kept, and what is no regular file (a pipe, ``/dev/stdout``) is
    written to as it is.

    Parameters
    ----------
    path : str or Path
    data : bytes or str
        Text is written as UTF-8.

    Raises
    ------
    FormatError
        The folder is missing or closed, or ``path`` is a directory. Nothing is left behind.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_atomically(Path(folder, "a.txt"), "whole")
    ...     [file.name for file in Path(folder).iterdir()]
    ['a.txt']
    """
    name = shorten(os.fspath(path), 200)
    try:
        content = data.encode("utf-8") if isinstance(data, str) else data
        if Path(path).is_dir():
            raise FormatError(f"{name}: is a directory; name a file")
        if Path(path).exists() and not Path(path).is_file():
            with Path(path).open("wb") as file:
                file.write(content)
        else:
            _replace(Path(os.path.realpath(path)), content)
    except UnicodeEncodeError:
        raise FormatError(f"{name}: the text cannot be written as UTF-8") from None
    except FileNotFoundError:
        raise FormatError(f"{name}: the folder does not exist; make it first") from None
    except PTCCError:
        raise
    except (OSError, ValueError) as error:
        raise FormatError(f"{name}: cannot be written ({_one_line(error)})") from None


def _replace(path: Path, content: bytes) -> None:
    temporary = path.with_name(f".{path.name[:100]}.{secrets.token_hex(6)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            shutil.copymode(path, temporary)
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
