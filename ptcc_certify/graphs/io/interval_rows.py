"""Edge lists whose header names intervals of weights, or edges that may fail."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.io.columns_beside import Column, column_of, notes_on_ignored, signs_beside_intervals
from ptcc_certify.graphs.io.edge_list import direction_of_comments, records
from ptcc_certify.graphs.io.files import Source, name_and_ending
from ptcc_certify.graphs.io.graph_files import format_of, graph_bytes, is_edge_list
from ptcc_certify.graphs.io.intervals import Entry, Interval, interval_columns, numbers_of_words
from ptcc_certify.graphs.io.problems import Problem, one_message
from ptcc_certify.graphs.io.signs import is_sign, weight_and_sign
from ptcc_certify.graphs.io.table_columns import BY_HEADER, edge_columns
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.tables import in_all

#: Options that say nothing about these rows, and why.
_NOT_TAKEN = {
    "duplicates": "are not merged",
    **dict.fromkeys(("laplacian", "columns", "variable"), "are read by their header"),
}


class _Table(NamedTuple):
    """A table whose header names intervals, or edges that may fail."""

    name: str
    data: bytes
    header: list[str]
    ends: tuple[int, int, int | None]  # columns of source, target and weight
    columns: tuple[int | None, int | None, int | None]  # of the least and the largest weight, and of what may fail
    rows: Iterator[tuple[int, list[str]]]  # below the header


@dataclass
class IntervalRows:
    """Nodes and edges with intervals, how many rows were dropped, and notes on what was read."""

    nodes: list[str]
    edges: list[Interval] = field(default_factory=list)
    loops: int = 0
    zeros: int = 0
    notes: tuple[str, ...] = ()

    @property
    def dropped(self) -> tuple[str, ...]:
        """A note on rows that were dropped."""
        told = [counted(k, what) for k, what in ((self.loops, "self-loop"), (self.zeros, "row of weight 0")) if k]
        return (f"{' and '.join(told)} dropped",) if told else ()


def is_family_file(path: Source) -> bool:
    """Tell whether a file gives weights in intervals, or edges that may fail: by its header alone.

    Examples
    --------
    >>> is_family_file(StringIO("source,target,weight_min,weight_max")), is_family_file(StringIO("a,b,1"))
    (True, False)
    """
    return _table(path) is not None


def _table(path: Source) -> _Table | None:
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
    return None if columns == (None, None, None) else _Table(name, data, header, ends, columns, rows)


def read_interval_rows(path: Source, how: Reading, share: Fraction) -> IntervalRows | None:
    r"""Read an edge list whose header names intervals or edges that may fail; None of other files.

    Parameters
    ----------
    path : Source
    how : Reading
    share : Fraction
        The uncertainty of weights that are given as one number.

    Raises
    ------
    FormatError
        Rows that are no edges: all rules that they break, in one message.
    ParameterError
        An option says nothing about such rows.

    Examples
    --------
    >>> text = "source,target,min,max\na,b,1,2\nb,b,1,1"
    >>> rows = read_interval_rows(StringIO(text), Reading(drop_self_loops=True), Fraction(0))
    >>> rows.edges, rows.dropped
    ([('a', 'b', Fraction(1, 1), Fraction(2, 1))], ('1 self-loop dropped',))
    """
    if (table := _table(path)) is None:
        return None
    for option, why in _NOT_TAKEN.items():
        if getattr(how, option) != getattr(Reading, option):
            raise ParameterError(option, f"is not for rows with intervals, which {why}; leave it out")
    if table.columns[0] is not None and share:
        raise FormatError(
            f"{table.name}: gives intervals itself; leave out the uncertainty, or write those of all files"
        )
    problems = _of_the_header(table, how)
    nodes, numbered = _fields(table)
    rows = IntervalRows(nodes, notes=(BY_HEADER,) if table.ends[0] > 0 else ())
    entries, beside = _entries(table, numbered, how)
    if text := signs_beside_intervals(beside, (end for _, entry in entries for end in entry[3:6] if end is not None)):
        raise FormatError(f"{table.name}: {text}")
    rows.notes += notes_on_ignored(beside)
    _take(rows, entries, how, share, problems)
    if problems:
        place, message = one_message(problems, lambda *options: " ".join(options))
        raise FormatError(f"{', '.join(filter(None, (table.name, place)))}: {message}")
    return rows


def _of_the_header(table: _Table, how: Reading) -> list[Problem]:
    """Refuse headers that tell no weight, or signs beside weights; return what comments say of undirected edges."""
    name, header, (_, _, weight), (low, _, _) = table.name, table.header, table.ends, table.columns
    if low is None and weight is None:
        raise FormatError(f"{name}: the header names no weight; name a column weight, or weight_min and weight_max")
    weight, sign = weight_and_sign(header, name)
    beside = sign if sign is not None or low is None else weight
    if beside is not None and is_sign(header[beside]):
        mend = "write the sign into the weights or both ends of the intervals, and leave the column out"
        raise FormatError(f'{name}: a column "{shorten(header[beside])}" beside the weights; {mend}')
    if (said := direction_of_comments(table.data, name)) and not how.undirected:
        return [Problem("", f"{said} means undirected edges", "let each go both ways with {}", "--undirected")]
    return []


def _fields(table: _Table) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the nodes, and the fields of rows with edges, by the numbers of their lines."""
    nodes, edges = dict[str, None](), list[tuple[int, list[str]]]()
    width = len(table.header)
    for number, row in table.rows:
        if any(row[width:]):
            what = f"{len(row)} fields, and the header has {width}; quote fields with separators"
            raise FormatError(f"{table.name}, line {number}: {what}")
        filled = [*filter(None, row)]
        if len(filled) > 1:
            edges.append((number, row + [""] * (width - len(row))))
        nodes |= dict.fromkeys([row[k] for k in table.ends[:2]] if len(filled) > 1 and len(row) > 1 else filled)
    if not nodes:
        raise FormatError(f"{table.name}: no edge and no node below the header; give rows")
    return list(nodes), edges


def _entries(
    table: _Table, numbered: Sequence[tuple[int, list[str]]], how: Reading
) -> tuple[list[tuple[str, Entry]], list[Column]]:
    """Return the edges as they are told, each with its line, and the columns that are not read."""
    first, second, weight = table.ends
    column = lambda k: [None] * len(numbered) if k is None else [row[k] for _, row in numbered]  # noqa: E731
    weights = column(weight)
    if table.columns[0] is None:
        weights = numbers_of_words(weights)
    least, largest, fails = map(column, table.columns)
    told = weights, least, largest, [text or "" for text in fails]
    if how.orientation == "listens":
        first, second = second, first
    entries = []
    for (number, row), values in zip(numbered, zip(*told, strict=True), strict=True):
        place = f"line {number}"
        entries.append((place, Entry(f"edge {_text((row[first], row[second]))}", row[first], row[second], *values)))
    read = (*table.ends, *table.columns)
    return entries, [column_of(table.header[k], column(k)) for k in range(len(table.header)) if k not in read]


def _take(
    rows: IntervalRows, entries: Sequence[tuple[str, Entry]], how: Reading, share: Fraction, problems: list[Problem]
) -> None:
    """Take edges into ``rows``, and what is wrong into ``problems``: of each kind the first row, and how many."""
    seen: dict[tuple[str, str], str] = {}
    broken = defaultdict[str, list[Problem]](list)
    for place, entry in entries:
        pair = entry.source, entry.target
        if "" in pair:
            empty = "target" if entry.source else "source"
            broken["empty"].append(Problem(place, f"the {empty} is empty", "name a node or remove the row"))
        elif entry.source == entry.target:
            rows.loops += 1
            text, mend = f"self-loop at node {shorten(entry.source)}", "remove it, or drop all with {}"
            broken["loop"].append(Problem(place, text, mend, "--drop-self-loops"))
        elif entry.always_zero:
            rows.zeros += 1
            text, mend = f"{entry.place}: its weight is always 0", "remove it, or drop all with {}"
            broken["zero"].append(Problem(place, text, mend, "--drop-zeros"))
        else:
            try:
                edge = entry.interval(share)
            except GraphError as error:
                text, _, mend = str(error).partition("; ")
                broken["weight"].append(Problem(place, text, mend.replace("{", "{{").replace("}", "}}")))
                continue
            again = pair if pair in seen else pair[::-1]
            if again in seen and (again == pair or how.undirected):
                mend = "an edge of both signs is two files (modes), or one interval with 0 inside"
                if again != pair:
                    mend = "--undirected makes each row both directions; keep one, or leave out --undirected"
                text = f"second row for edge {_text(pair)} (the first is {seen[again]})"
                broken["again"].append(Problem(place, text, mend))
                continue
            seen[pair] = place
            rows.edges.append(edge)
    for kind, option in (("loop", how.drop_self_loops), ("zero", how.drop_zeros)):
        if option:
            broken.pop(kind, None)
    problems += [replace(some[0], text=some[0].text + in_all(len(some))) for some in broken.values()]


def _text(pair: Sequence[str]) -> str:
    return f"{shorten(pair[0])} -> {shorten(pair[1])}"
