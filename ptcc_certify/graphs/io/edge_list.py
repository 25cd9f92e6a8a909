"""Edge lists: rows ``source,target,weight`` of a text file, read and written."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain

import numpy as np

from ptcc_certify.errors import FormatError, NumberError
from ptcc_certify.graphs.digraph import OF_EDGES, SignedDigraph, ordered_labels
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.graph_from_rows import DECIMALS, HEADER_MEND, Numbers, Rows
from ptcc_certify.graphs.rationals import parse_exact, shorten
from ptcc_certify.graphs.size_limits import MAX_LINE

_SEPARATORS = ("\t", ",", ";", None)  # None: blanks
_SOURCE = ("source", "from", "fromnodeid", "fromnode", "fromid", "sourcenode", "sourceid", "src", "rater")
_TARGET = ("target", "to", "tonodeid", "tonode", "toid", "targetnode", "targetid", "dst", "rated", "ratee")
_WEIGHT = ("weight", "sign", "rating", "value", "w")
#: The note of a file whose header puts source and target elsewhere than source first.
BY_HEADER = "columns by header"
#: The note of a file whose raters were read as those who are heard.
RATERS = "raters listen? --edges listens"


def records(data: bytes, name: str) -> Iterator[tuple[int, list[str]]]:
    """Yield number of the line and fields of each row that is not a comment; fields may have blanks around them.

    Commas, tabs, semicolons or blanks separate the fields, whichever the first row of several fields uses.
    """
    numbered = enumerate(lines_of(data, name), 1)
    separator: str | None = ","
    detected = False
    for number, line in numbered:
        if line.lstrip()[:1] in "#%":  # the empty text is in every text
            continue
        try:
            if not detected:
                separator, detected = _separator(line)
            if '"' not in line:
                row = line.split(separator)
                if len(row) == 1 and _other_separator(line):
                    mend = "separate fields as the rows before do, or quote the line if it is the name of a node"
                    raise FormatError(f"{name}, line {number}: {shorten(line.strip())} is one field here; {mend}")
                yield number, row
            else:  # a quoted field may go on in the following lines
                yield number, _csv_fields(chain([line], (text for _, text in numbered)), separator, strict=True)
        except csv.Error as error:
            mend = 'close each, set it apart, and write "" for a quote within quotes'
            why = shorten(str(error), 80)
            raise FormatError(f"{name}, line {number}: unclear quotes ({why}); {mend}") from None


def _csv_fields(lines: Iterable[str], separator: str | None, strict: bool) -> list[str]:
    """Split the first row of ``lines``, honouring quotes."""
    whole = (f"{line}\n" if separator else line.replace("\t", " ") + "\n" for line in lines)
    row = next(csv.reader(whole, delimiter=separator or " ", skipinitialspace=True, strict=strict))
    return [field.strip() for field in row if separator or field]


def _separator(line: str) -> tuple[str | None, bool]:
    """Return the separator that gives most fields, three at most, and whether it gives several.

    Filled fields count first, so that ``a;b;0,5`` is split at its semicolons; then empty ones, as in ``a;;``.
    """

    def rank(separator: str | None) -> tuple[int, int]:
        row = _csv_fields([line], separator, strict=False)
        return min(len([*filter(None, row)]), 3), min(len(row), 3)

    best = max(_SEPARATORS, key=rank)
    return (best, True) if rank(best) > (1, 1) else (",", False)


def _other_separator(line: str) -> bool:
    """Tell whether a row of one field is an edge of another kind of table, such as ``a;b;1`` among commas."""
    return re.fullmatch(r"[^\t,;]+([\t,;])[^\t,;]+\1\s*[+-]?\d[\d.,/eE+-]*\s*", line) is not None


def column(row: Sequence[str], names: Sequence[str], place: str) -> int | None:
    """Return the column that bears the first of ``names`` that occurs, whatever its case, blanks and hyphens."""
    titles = [_plain(field) for field in row]
    for name in names:
        if titles.count(_plain(name)) > 1:
            raise FormatError(f'{place}: two columns are named "{name}"; rename one')
        if _plain(name) in titles:
            return titles.index(_plain(name))
    return None


def _plain(title: str) -> str:
    """Return a title in small letters, without what may stand between its words."""
    return re.sub(r"[\s_-]", "", title.lower())


def edge_columns(row: Sequence[str], place: str) -> tuple[int, int, int | None] | None:
    """Return the columns of source, target and, if it is named, weight; None if a row names no source and target."""
    source, target = column(row, _SOURCE, place), column(row, _TARGET, place)
    return None if source is None or target is None else (source, target, column(row, _WEIGHT, place))


def header(row: Sequence[str], place: str) -> tuple[int, int, int] | None:
    """Return the columns of source, target and weight if a row is a header, else None.

    Examples
    --------
    >>> header(["weight", "from", "to"], "a.csv, line 1"), header(["a", "b", "1"], "a.csv, line 1")
    ((1, 2, 0), None)
    """
    if (columns := edge_columns(row, place)) is None:
        return None
    if column(row, sorted(OF_EDGES), place) is not None:
        mend = "ptcc classify, certify, simulate and plot take it, and ptcc_certify.read_family"
        raise FormatError(f"{place}: uncertain weights or optional edges, which make a family of graphs; {mend}")
    source, target, weight = columns
    if weight is not None:
        return source, target, weight
    try:
        parse_exact("".join(row[2:3]))
    except NumberError:
        raise FormatError(f"{place}: the header names no weight; name one column weight, sign or rating") from None
    return None


def read_edge_list(data: bytes, name: str) -> Rows:
    """Read an edge list; a row with one field declares a node."""
    if data.startswith(b"%%MatrixMarket"):
        raise FormatError(f'{name}, line 1: a Matrix Market file; name it .mtx or pass the format "mtx"')
    nodes, weights = Numbers(), Numbers()
    first, second, codes, numbers = [], [], [], []
    ignored: dict[str, None] = {}
    started, named, raters = 0, False, False
    width, (s, t, w) = 3, (0, 1, 2)
    for number, row in records(data, name):
        if not started and len(row) > 1:
            started = number
            if columns := header([field.strip() for field in row], f"{name}, line {number}"):
                named, width, (s, t, w) = True, len(row), columns
                raters = row[s].strip().lower() == "rater"
                ignored = {f'"{shorten(field.strip())}"': None for i, field in enumerate(row) if i not in columns}
                continue
            if "".join(row[2:3]).strip().lower() in _WEIGHT:
                titles = ", ".join(shorten(field.strip()) for field in row[:3])
                mend = "name the column of who is heard source, that of who listens target"
                mend += DECIMALS * (re.search(rb"[;\t]\s*[+-]?\d+,\d+\s*$", data, re.MULTILINE) is not None)
                raise FormatError(f"{name}, line {number}: the header {titles} names no source and target; {mend}")
        if len(row) > width and any(map(str.strip, row[width:])):
            ignored["beyond the header" if named else "after the third"] = None
        try:
            source, target, code = nodes[row[s]], nodes[row[t]], weights[row[w]]
        except LookupError:
            mend = HEADER_MEND if number == started else ""
            if label := _declared([field.strip() for field in row], (s, t, w), f"{name}, line {number}", mend):
                _ = nodes[label]
            continue
        first.append(source)
        second.append(target)
        codes.append(code)
        numbers.append(number)
    notes = (BY_HEADER,) * (s > 0) + (RATERS,) * raters
    notes += ("columns ignored: " + ", ".join(list(ignored)[:20]),) if ignored else ()
    if not named and ignored:
        _refuse_decimal_commas(data, name)
    if not named and len(numbers) > 2:
        _refuse_matrix(data, len(numbers), name)
    rows = Rows(list(nodes.texts), first, second, list(weights.texts), codes, lambda row: f"line {numbers[row]}")
    rows.headerless, rows.notes = not named, notes
    return rows


def _refuse_matrix(data: bytes, n: int, name: str) -> None:
    """Refuse n rows of n numbers with zeros on the diagonal: as edges, the third would have weight 0."""
    with suppress(NumberError):
        rows = (row for _, row in records(data, name) if row[1:])
        if all(len(row) == n and [*map(parse_exact, row)][k] == 0 for k, row in enumerate(rows)):
            mend = "save it as .npy or .mtx, or write rows source,target,weight"
            raise FormatError(f"{name}: looks like a {n} x {n} matrix, not like a table of edges; {mend}")


def _refuse_decimal_commas(data: bytes, name: str) -> None:
    """Refuse rows such as ``a,b,-1,5`` throughout: their weight may be -1, with another column, or -1.5."""
    lines = (line for line in lines_of(data, name) if line.lstrip()[:1] not in "#%")
    if all(re.fullmatch(r"[^,;\s]*|[^,]*,[^,]*,\s*[+-]?\d+(,\s*\d{1,3}\s*)?", line) for line in lines):
        which = "a weight with a decimal comma, or a weight and another column?"
        raise FormatError(
            f"{name}: {which} Write decimals with a point, or begin with a header source,target,weight,..."
        )


def _declared(row: list[str], columns: tuple[int, int, int], place: str, mend: str) -> str:
    """Return the node that a row without an edge declares, "" if the row is empty; refuse any other."""
    if len(row) < 2 or not any(row):
        return "".join(row)
    source, target, weight = (row[i] if i < len(row) else "" for i in columns)
    if source and target:
        edge = f"{shorten(source)} -> {shorten(target)}"
        raise FormatError(f"{place}: edge {edge} has no weight; add one in a third column{mend}")
    if mend and not row[0] and all(row[1:]) and not re.fullmatch(r"[+-]?[\d./eE+-]+", row[-1]):
        read = 'SignedDigraph.from_matrix(pandas.read_csv(FILE, index_col=0), orientation="listens")'
        raise FormatError(f"{place}: looks like a matrix with names; write rows of edges, or in Python {read}")
    if target or weight or not source:
        raise FormatError(f"{place}: the {'target' if source else 'source'} is empty; name a node or remove the row")
    return source


def edge_list(graph: SignedDigraph, name: str) -> bytes:
    """Write a graph as an edge list that is read back as an equal graph with the same order of nodes."""
    labels = [_cell(label, name) for label in graph.labels]
    declared = np.ones(graph.n_nodes, dtype=bool)
    if ordered_labels(list(graph.labels[::-1]))[0] == list(graph.labels):  # the labels themselves tell their order
        declared[graph.source] = declared[graph.target] = False
    lines = ["source,target,weight", *(labels[k] for k in np.flatnonzero(declared))]
    for s, t, weight in zip(graph.source.tolist(), graph.target.tolist(), graph.weight_texts, strict=True):
        lines.append(f"{labels[s]},{labels[t]},{weight}")
    return "".join(f"{line}\n" for line in lines).encode("utf-8")


def _cell(label: str, name: str) -> str:
    """Return a label as a field, quoted where it needs it; refuse what would not be read back."""
    # Two labels and a weight of 4,000 characters, every character a doubled quote, fit a line.
    odd = re.search("[\0\ud800-\udfff]", label) or not label or label != label.strip()
    if odd or len(label) > MAX_LINE // 5:
        what = f"is empty, not Unicode text, has blanks around it or is longer than {MAX_LINE // 5} characters"
        raise FormatError(f'{name}: label "{shorten(label)}" {what}; rename the node')
    if label[0] in "#%" or re.search(r'[,;"\t\n\r]', label):
        return '"' + label.replace('"', '""') + '"'
    return label
