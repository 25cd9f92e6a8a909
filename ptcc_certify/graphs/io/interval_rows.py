"""Edge lists whose header names intervals of weights, or edges that may fail."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import chain
from typing import NamedTuple

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.io import comments
from ptcc_certify.graphs.io.columns_beside import notes_on_ignored, signs_beside_intervals
from ptcc_certify.graphs.io.decimal_commas import pointed_fields
from ptcc_certify.graphs.io.edge_list import EdgeList, Records
from ptcc_certify.graphs.io.files import Source, name_and_ending
from ptcc_certify.graphs.io.graph_files import format_of, graph_bytes, is_edge_list
from ptcc_certify.graphs.io.interval_edges import Entry, Interval, known, told_weights
from ptcc_certify.graphs.io.problems import Problem, Problems, one_message
from ptcc_certify.graphs.io.signs import interval_columns, is_sign, plain
from ptcc_certify.graphs.io.table_columns import BY_HEADER, RATERS, Columns, edge_columns
from ptcc_certify.graphs.labels import refuse_written_twice
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading

#: Options that say nothing about these rows, and why.
_NOT_TAKEN = {
    "duplicates": "are not merged",
    **dict.fromkeys(("laplacian", "columns", "variable"), "are read by their header"),
}


class _Table(NamedTuple):
    """A table whose header names intervals, or edges that may fail."""

    name: str
    data: bytes
    header: tuple[str, ...]
    started: int  # the line of the header
    ends: tuple[int, int, int | None]  # columns of source, target and weight
    columns: tuple[int | None, int | None, int | None]  # of the least and the largest weight, and of what may fail
    rows: Iterator[tuple[int, list[str]]]  # but for the header
    commas: bool  # may fields hold decimal commas?


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
    rows, before = Records(data, name), list[tuple[int, list[str]]]()
    for number, row in rows:
        if len(row) > 1:
            break
        before.append((number, row))  # declares a node
    else:
        return None
    header = tuple(field.strip() for field in row)
    if (ends := edge_columns(header, name)) is None:
        return None
    columns = interval_columns(header, name)
    if columns == (None, None, None):
        return None
    if columns[0] is not None and ends[2] is not None and is_sign(header[ends[2]]):
        ends = (*ends[:2], None)  # a column of signs, or of directions
    return _Table(name, data, header, number, ends, columns, chain(before, rows), rows.commas)


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
    header = _of_the_header(table, how)
    edges = _Edges(table)
    edges.read(table.rows)
    if not edges.nodes and not edges.broken.told():
        raise FormatError(f"{table.name}: no edge and no node below the header; give rows")
    alike = refuse_written_twice([*edges.nodes.texts], table.name)
    rows = IntervalRows([*edges.nodes.texts], notes=(*alike, BY_HEADER) if table.ends[0] > 0 else alike)
    rows.notes += (RATERS,) if plain(table.header[table.ends[0]]) == "rater" and how.orientation is None else ()
    beside = [column for _, column in edges.beside]
    try:
        entries = edges.entries(how)
        text = signs_beside_intervals(beside, [entry[3:6] for _, entry in entries], how.undirected)
    except GraphError as error:
        text = str(error)
    if text:
        raise FormatError(f"{table.name}: {text}")
    rows.notes += (*edges.notes, *edges.nodes_alone(), *notes_on_ignored(beside), *comments.note_on_rows(table.data))
    take(rows, entries, how, share, edges.broken)
    mended = [kind for kind, option in (("loop", how.drop_self_loops), ("zero", how.drop_zeros)) if option]
    found = edges.broken.told(*mended)
    if problems := [*header, *sorted(found, key=lambda problem: int(problem.place.removeprefix("line ")))]:
        place, message = one_message(problems, lambda *options: " ".join(options))
        raise FormatError(f"{', '.join(filter(None, (table.name, place)))}: {message}")
    return rows


class _Edges(EdgeList):
    """The rows of a table with intervals, with all their fields, and those that are no edges."""

    def __init__(self, table: _Table):
        first, second, weight = table.ends
        self.columns_told = table.columns
        low = table.columns[0]
        assert weight is not None or low is not None
        columns = Columns(first, second, weight if low is None else low, titles=table.header)  # type: ignore[arg-type]
        super().__init__(table.name, columns, table.started, table.commas)
        self.weight, self.kept = weight, list[list[str]]()
        self.ends = (*self.ends, *({table.columns[1], weight} - {None, self.ends[2]}))
        self.beside = [(k, column) for k, column in self.beside if k not in (weight, *table.columns)]

    def read(self, rows: Iterable[tuple[int, list[str]]]) -> None:
        """Read all rows; the weight of a row stands for both ends of its interval where these are empty."""
        low, high, _ = self.columns_told
        weight, values = self.weight, {self.weight, low, high}

        def with_ends(row: list[str]) -> list[str]:
            row = ["" if k in values and known(text) is None else text for k, text in enumerate(row)]
            if low is None or high is None or weight is None or max(low, high, weight) >= len(row):
                return row
            ends = row[low], row[high]
            return [row[weight] if k in (low, high) and not any(ends) else text for k, text in enumerate(row)]

        super().read((number, with_ends(row)) for number, row in rows)

    def entries(self, how: Reading) -> list[tuple[str, Entry]]:
        """Return the edges as they are told, each with its line."""
        kept, labels = self.kept or [], [*self.nodes.texts]
        field = lambda row, k: row[k].strip() if k < len(row) else ""  # noqa: E731
        column = lambda k: [None] * len(kept) if k is None else [field(row, k) for row in kept]  # noqa: E731
        numbers = [k for k in (*self.columns_told[:2], self.weight) if k is not None]
        pointed = pointed_fields([[field(row, k) for k in numbers] for row in kept], self.commas)
        for row, texts in zip(kept, pointed, strict=True):
            row[:] = [dict(zip(numbers, texts, strict=True)).get(k, text) for k, text in enumerate(row)]
        least, largest, fails = map(column, self.columns_told)
        weights = column(self.weight)
        if self.columns_told[0] is None and self.weight is not None:
            weights = told_weights(weights, self.columns.titles[self.weight])
        result = []
        ends = (self.first, self.second) if how.orientation != "listens" else (self.second, self.first)
        told = zip(weights, least, largest, ["" if may is None else may for may in fails], strict=True)
        for s, t, line, values in zip(*ends, self.lines, told, strict=True):
            source, target = labels[s], labels[t]
            result.append((f"line {line}", Entry(f"edge {_text((source, target))}", source, target, *values)))
        return result


def _of_the_header(table: _Table, how: Reading) -> list[Problem]:
    """Refuse headers that tell no weight; return what comments say of undirected edges."""
    name, (_, _, weight), (low, _, _) = table.name, table.ends, table.columns
    if low is None and weight is None:
        raise FormatError(f"{name}: the header names no weight; name a column weight, or weight_min and weight_max")
    if (said := comments.undirected_by_comment(table.data, name)) and not how.undirected:
        return [Problem("", f"{said} means undirected edges", "let each go both ways with {}", "--undirected")]
    return []


def take(
    rows: IntervalRows, entries: Sequence[tuple[str, Entry]], how: Reading, share: Fraction, broken: Problems
) -> None:
    """Take edges into ``rows``, and what is wrong into ``broken``; self-loops and zeros are of these kinds."""
    seen: dict[tuple[str, str], str] = {}
    for place, entry in entries:
        pair, loop = (entry.source, entry.target), entry.source == entry.target
        if loop:
            rows.loops += 1
            text, mend = f"self-loop at node {shorten(str(entry.source))}", "remove it, or drop all with {}"
            broken.add(Problem(place, text, mend, "--drop-self-loops"), "loop")
        if entry.always_zero:
            rows.zeros += not loop
            text, mend = f"{entry.place}: its weight is always 0", "remove it, or drop all with {}"
            if not loop:
                broken.add(Problem(place, text, mend, "--drop-zeros"), "zero")
            continue
        try:
            edge = entry.interval(share)
        except GraphError as error:
            text, _, mend = str(error).rpartition("; ")
            broken.add(Problem(place, text, mend))
            continue
        again = pair if pair in seen else pair[::-1]
        if loop:
            continue
        if again in seen and (again == pair or how.undirected):
            mend = "an edge of both signs is two files (modes), or one interval with 0 inside"
            if again != pair:
                mend = "--undirected makes each row both directions; keep one, or leave out --undirected"
            broken.add(Problem(place, f"second row for edge {_text(pair)} (the first is {seen[again]})", mend))
            continue
        seen[pair] = place or "an earlier one"
        rows.edges.append(edge)


def _text(pair: Sequence[str]) -> str:
    return f"{shorten(pair[0])} -> {shorten(pair[1])}"
