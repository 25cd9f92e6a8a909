"""Edge lists: rows ``source,target,weight`` of a text file, read and written."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain, islice

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, NumberError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import comments
from ptcc_certify.graphs.io.columns_beside import Column
from ptcc_certify.graphs.io.decimal_commas import NOTE, pointed, pointed_fields
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.problems import Problem, Problems, one_message
from ptcc_certify.graphs.io.raw_edges import HEADER_MEND, Beside, Draft, Numbers, Rows, Signs
from ptcc_certify.graphs.io.signs import WEIGHT, plain, sign_of_word
from ptcc_certify.graphs.io.table_columns import Columns, asks_of_corner, columns_of, names_edges
from ptcc_certify.graphs.io.text_matrices import bracketed_matrix, is_entry, table_as_matrix
from ptcc_certify.graphs.labels import first_five, ordered_labels
from ptcc_certify.graphs.rationals import COMMA, parse_exact, shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.size_limits import MAX_LINE

_SEPARATORS = ("\t", ",", ";", None)  # None: blanks
#: Rows that are looked at before columns are told; different fields after the third that are; where signs are first.
_LOOKED_AT, _EXTRA, _SIGN_AT = 20, 10**5, {"first": "2,3,1", "second": "1,3,2"}
#: From this number on a number after the third column is taken for a year or a time.
_TIMES = 1900
#: From this number on whole weights throughout are taken for seconds since 1970.
_SECONDS = 10**8


class Records(Iterator[tuple[int, list[str]]]):
    r"""Number of the line and fields of each row that is not a comment; fields may have blanks around them.

    Commas, tabs, semicolons or blanks separate the fields, whichever the first row of several fields uses.

    Examples
    --------
    >>> list(Records(b"a;b;0,5\nb", "g.csv"))
    [(1, ['a', 'b', '0,5']), (2, ['b'])]
    """

    def __init__(self, data: bytes, name: str):
        self.separator: str | None = ","
        self._rows = self._read(data, name)

    def __next__(self) -> tuple[int, list[str]]:
        return next(self._rows)

    @property
    def commas(self) -> bool:
        """Whether a field may hold a decimal comma, by what separates the rows that were read."""
        return self.separator in (";", "\t")

    def _read(self, data: bytes, name: str) -> Iterator[tuple[int, list[str]]]:
        numbered = enumerate(lines_of(data, name), 1)
        separator, detected = self.separator, False
        for number, line in numbered:
            if number == 1 and (told := re.fullmatch(r'"?sep=([,;\t ])"?\s*', line)):  # as Excel tells it
                self.separator = separator = told[1].strip(" ") or None
                detected = True
                continue
            if line.lstrip()[:1] in "#%":  # the empty text is in every text
                continue
            if not detected and not line.strip(" ,;\t"):
                continue  # empty fields above all others
            try:
                if not detected:
                    separator, detected = _separator(line)
                    self.separator = separator
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
    Commas that are all in numbers between other separators, as in ``a;0,5`` and ``a;b;0,5;0,1``, separate nothing.
    """
    for separator, least in ((";", 2), ("\t", 2), (None, 3)):
        fields = _csv_fields([line], separator, strict=False)
        with_comma = [field for field in fields if "," in field]
        if with_comma and len(fields) >= least and all(map(COMMA.fullmatch, with_comma)) and '"' not in line:
            return separator, True

    def rank(separator: str | None) -> tuple[int, int]:
        row = _csv_fields([line], separator, strict=False)
        return min(len([*filter(None, row)]), 3), min(len(row), 3)

    best = max(_SEPARATORS, key=rank)
    return (best, True) if rank(best) > (1, 1) else (",", False)


def _other_separator(line: str) -> bool:
    """Tell whether a row of one field is an edge of another kind of table, such as ``a;b;1`` among commas."""
    number = r"\s*[+-]?\d[\d.,/eE+-]*\s*"
    other = rf"[^\t,;]+([\t,;])[^\t,;]+(\1[^\t,;]*)*?\1{number}(\1.*)?"
    return re.fullmatch(rf"{other}|\s*\S+\s+\S+(\s+[+-]?\d[\d.,/eE+-]*)+\s*", line) is not None


def read_edge_list(data: bytes, name: str, how: Reading) -> Rows:
    """Read an edge list, where a row with one field declares a node, or a matrix as text."""
    if data.startswith(b"%%MatrixMarket"):
        raise FormatError(f'{name}, line 1: a Matrix Market file; name it .mtx or pass the format "mtx"')
    if not how.titles and (matrix := bracketed_matrix(data, name)) is not None:
        return matrix
    undirected = comments.undirected_by_comment(data, name)
    numbered = Records(data, name)
    begin = list(islice(numbered, _LOOKED_AT))
    table = _several(begin, numbered.commas)
    tells = bool(how.titles) or bool(table and names_edges(table[0]))
    konect = re.match(rb"(\xef\xbb\xbf)?%\s*(sym|asym)\b", data) is not None  # nodes, weight and time
    started = next((number for number, row in begin if len(row) > 1), 0)
    if (
        table and not tells and not konect and len(table[0]) >= len(table) - 1
    ):  # perhaps a matrix, of which all rows are needed
        begin += islice(numbered, len(table[0]) + 2)
        table = _several(begin, numbered.commas)
        declares = any(len(row) == 1 and row[0].strip() for _, row in begin)
        if not declares and (matrix := table_as_matrix(table, name)) is not None:
            if numbered.commas:
                _name_as_written(matrix, begin)
            if (corner := table[0][0].strip()) not in matrix.labels:
                matrix.asks = asks_of_corner(corner, f"line {started}")
            if len(table) == len(matrix.labels):  # without a row of names
                matrix.notes += comments.note_on_names(data, len(table))
            return matrix
    columns = columns_of(table[0], table[1:], f"{name}, line {started}", how) if table else Columns()
    if columns.titles:
        begin = [row for row in begin if row[0] != started]
    elif table:
        _refuse_titles(table[0], f"{name}, line {started}")
    draft = EdgeList(name, columns, started, numbered.commas)
    draft.read(chain(begin, numbered))
    rows = draft.rows()
    rows.notes += comments.note_on_rows(data) or comments.note_on_directions(
        data, undirected, 0 if columns.titles or not table else len(table[0])
    )
    if rows.problems and not columns.titles:  # of which the other rules say nothing
        place, message = one_message(rows.problems, " ".join)
        raise FormatError(f"{', '.join(filter(None, (name, place)))}: {message}")
    if not columns.titles and not columns.told:
        comments.refuse_titles(data, name, len(table[0]) if table else 0)
        _refuse_ambiguous(draft, rows, data, konect)
    rows.undirected = undirected
    return rows


def _several(rows: Iterable[tuple[int, list[str]]], commas: bool) -> list[list[str]]:
    """Return the rows of several fields."""
    return pointed_fields([row for _, row in rows if len(row) > 1], commas)


def _name_as_written(matrix: Rows, rows: Iterable[tuple[int, list[str]]]) -> None:
    """Give the labels of a matrix back the commas that its entries lost; note that these did."""
    fields = [field.strip() for _, row in rows for field in row]
    written = {new: field for new, field in zip(pointed(fields), fields, strict=True) if new != field}
    matrix.labels = [written.get(label, label) for label in matrix.labels]
    matrix.notes += (NOTE,) if written else ()


class EdgeList(Draft):
    """The rows of a table, as they come."""

    def __init__(self, name: str, columns: Columns, started: int, commas: bool = False):
        super().__init__()
        self.commas, self.notes = commas, tuple[str, ...]()  # may fields hold decimal commas, and do they?
        self.name, self.columns, self.started = name, columns, started
        self.signs, self.sign_codes = Numbers(), list[int]()
        self.beside = [(k, Column(columns.titles[k])) for k in columns.ignored]
        self.kept: list[list[str]] | None = None  # the fields of every edge, where they are asked for
        self.broken, self.declared = Problems(), list[int]()  # nodes of rows of one field
        self.ends: tuple[int | None, ...] = (columns.source, columns.target, columns.weight)  # and what tells weights
        self.extra: dict[str, int] = {}  # fields after the third of a table without header, and the line of each

    def read(self, rows: Iterable[tuple[int, list[str]]]) -> None:
        """Read all rows but for a header."""
        columns, nodes, weights, signs = self.columns, self.nodes, self.weights, self.signs
        first, second, codes, lines = self.first, self.second, self.codes, self.lines
        s, t, w, sign = columns.source, columns.target, columns.weight, columns.sign
        width = len(columns.titles) or (10**9 if columns.told else 3)
        for number, row in rows:
            if len(row) > width and any(map(str.strip, row[width:])) and self.more_fields(number, row, width):
                continue
            try:
                if sign is not None and not (row[w].strip() and row[sign].strip()):
                    raise LookupError  # before a weight is registered that no edge has
                source, target, code = nodes[row[s]], nodes[row[t]], weights[row[w]]
                if sign is not None:
                    self.sign_codes.append(signs[row[sign]])
            except LookupError:
                self.no_edge(number, [field.strip() for field in row])
                continue
            first.append(source)
            second.append(target)
            codes.append(code)
            lines.append(number)
            if self.kept is not None:
                self.kept.append(row)
            for k, column in self.beside:
                column.add(row[k] if k < len(row) else "")
        if self.commas:
            self.weights.texts, self.signs.texts, self.extra = map(
                self.with_points, (self.weights.texts, self.signs.texts, self.extra)
            )
            for _, column in self.beside:
                column.values = self.with_points(column.values)

    def with_points(self, texts: dict[str, int]) -> dict[str, int]:
        """Write a point in place of each decimal comma, and note it."""
        result = dict(zip(pointed(texts), texts.values(), strict=True))
        self.notes = self.notes if result == texts else (NOTE,)
        return result

    def more_fields(self, number: int, row: list[str], width: int) -> bool:
        """Note fields beyond a header, which make a row none; keep those after the third of a table without."""
        if self.columns.titles:
            mend = "quote fields that hold the separator"
            mend += ", or write the table of R with row.names = FALSE" if len(row) == width + 1 else ""
            self.broken.add(Problem(f"line {number}", f"{len(row)} fields, and the header has {width}", mend), "fields")
            return True
        if len(self.extra) < _EXTRA:
            for field in row[width:]:
                self.extra.setdefault(field.strip(), number)
        return False

    def no_edge(self, number: int, row: list[str]) -> None:
        """Declare the node of a row without an edge, or note what is wrong with the row."""
        columns, titles = self.columns, self.columns.titles
        if len(row) < 2 or not any(row):
            if label := "".join(row):
                self.declared.append(self.nodes[label])
            return
        field = lambda k: row[k] if k is not None and k < len(row) else ""  # noqa: E731
        source, target, *weights = map(field, self.ends)
        edge = f"edge {shorten(source)} -> {shorten(target)}"
        if source and target and columns.sign is not None and all(weights):
            title = shorten(titles[columns.sign])
            problem = Problem(f"line {number}", f'{edge} has no "{title}"', "add one")
        elif source and target:
            lacking = next(k for k in self.ends[2:] if k is not None and not field(k))
            mend = f'add one in column "{shorten(titles[lacking])}"' if titles else "add one in a third column"
            mend += HEADER_MEND if number == self.started else ""
            problem = Problem(f"line {number}", f"{edge} has no weight", mend)
        elif target or not source or any(weights):
            end = "target" if source else "source"
            problem = Problem(f"line {number}", f"the {end} is empty", f"name the {end} or remove the row")
        else:
            _ = self.nodes[source]
            return
        self.broken.add(problem, "no weight" if problem.text.endswith("has no weight") else "")

    def nodes_alone(self) -> tuple[str, ...]:
        """Note nodes without edges, which rows of one field declare."""
        there = {*self.first, *self.second}
        alone = [label for k, label in enumerate(self.nodes.texts) if k not in there]
        return (f"{counted(len(alone), 'node')} without edges: {first_five(alone)}",) if alone else ()

    def rows(self) -> Rows:
        """Return what was read; refuse titles that are nodes, too."""
        columns, rows = self.columns, super().rows()
        rows.headerless, rows.problems = not columns.titles, self.broken.told()
        rows.notes, rows.asks = (*columns.notes, *self.notes, *self.nodes_alone()), columns.asks
        rows.notes += ("columns ignored: after the third",) if self.extra else ()
        rows.beside = Beside(columns.codes, None, [column for _, column in self.beside], columns.told)
        rows.beside.titles = (
            [columns.titles[k] for k in (columns.source, columns.target, columns.weight)] if columns.titles else []
        )
        if columns.sign is not None:
            rows.beside.signs = Signs(list(self.signs.texts), self.sign_codes, columns.titles[columns.sign])
        ends = [columns.titles[k] for k in (columns.source, columns.target)] if columns.guessed else []
        if again := [title for title in ends if title in self.nodes.texts]:
            what = f"{shorten(again[0])} is a title, and a node in another row"
            raise FormatError(f"{self.name}, line {self.started}: {what}; call who is heard source, who listens target")
        return rows


def _refuse_titles(row: list[str], place: str) -> None:
    """Refuse a first row that names a weight, but no source and target."""
    if plain("".join(row[2:3])) in (*WEIGHT, "sign"):
        titles = ", ".join(shorten(field.strip()) for field in row[:3])
        mend = "name the column of who is heard source, that of who listens target"
        raise FormatError(f"{place}: the header {titles} names no source and target; {mend}")


def _refuse_ambiguous(draft: EdgeList, rows: Rows, data: bytes, konect: bool) -> None:
    """Refuse a table without header whose rows may be something else than ``source,target,weight``.

    ``konect``: its first line, as KONECT writes it, tells that the fourth column holds times.
    """
    name, labels, weights = draft.name, draft.nodes.texts, draft.weights.texts
    tell = "begin with a header source,target,weight, or tell these columns, such as --columns 1,2,3"
    commas = [label for label in labels if re.fullmatch(r"[+-]?\d+,\d+", label)]
    if commas and b'"' not in data:
        which = "nodes, or a matrix, with decimal commas? Write decimals with a point, or quote the names of nodes"
        raise FormatError(f"{name}: {commas[0]} among {which}")
    _refuse_printed(draft)
    _refuse_text(draft)
    alone = bool(draft.first) and 0 not in draft.first and 0 not in draft.second  # the first node
    if alone and rows.labels[0] in (str(len(labels) - 1), str(len(draft.first))):
        what = f"{rows.labels[0]} is the number of nodes or edges, or a node without edges? Leave the first row out"
        raise FormatError(f"{name}: {what}, or begin with a header source,target,weight")
    if not konect and _counts(draft):
        what = "are numbers of nodes and of edges, or an edge? Leave this row out"
        raise FormatError(f"{name}, line {draft.lines[0]}: the first two fields {what}, or {tell}")
    extra = dict[str, int]() if konect else draft.extra
    if extra:
        _refuse_decimal_commas(data, name)
        least = max(Fraction(_TIMES), *(10 * _size(text) for text in (*weights, *labels)))
    for field, line in extra.items():
        if field and (field in labels or sign_of_word(field) is not None or not _is_time(field, least)):
            what = f'a weight, and "{shorten(field)}" in another column: neighbours, a sign or the weight?'
            raise FormatError(f"{name}, line {line}: {what} If there are edges, {tell}")
    for ends, which in ((draft.first, "first"), (draft.second, "second")):
        signs = all(_is_sign(rows.labels[k]) for k in ends) and {rows.labels[k] for k in ends}
        if signs and (signs != {"1"} or (len(ends) > 1 and any(text in labels for text in weights))):
            what = f"the {which} column holds signs: name a file of interactions .sif"
            raise FormatError(f"{name}: {what}, or tell the columns, such as --columns {_SIGN_AT[which]}")
    if len(weights) > 1 and all(text.isdigit() and int(text[:20]) >= _SECONDS for text in weights):
        raise FormatError(f"{name}: the third column holds times, not weights? If there are weights, {tell}")
    if odd := [label for label in labels if not label.isdigit() and is_entry(label) and sign_of_word(label) is None]:
        what = f"a node called {shorten(odd[0])}: a matrix, or edges?"
        raise FormatError(f"{name}: {what} Save a matrix as .npy or .mtx; of edges, {tell}")
    nodes = len(weights) > 1 and all(text.isdigit() and text in labels for text in weights)
    lists = nodes and not konect and len(set(draft.first)) == len(draft.first) > 2
    if lists and all(rows.labels[t] != rows.weights[w] for t, w in zip(draft.second, draft.codes, strict=True)):
        raise FormatError(f"{name}: a list of neighbours, or edges with weights that are nodes? Of edges, {tell}")


def _refuse_printed(draft: EdgeList) -> None:
    """Refuse what prints: a sparse matrix, whose rows begin ``(0, 1)``, and lists of neighbours of every node."""
    if odd := [label for label in draft.nodes.texts if re.fullmatch(r"\(\d+,?", label)]:
        what = f"a node called {shorten(odd[0])}: a sparse matrix that was printed? Save it as .mtx or .npz"
        raise FormatError(f"{draft.name}: {what}; of edges, begin with a header source,target,weight")
    begins = [*draft.first, *draft.declared]
    every = len(begins) == len(draft.nodes.texts) == len(set(begins))
    if draft.first and draft.declared and every and all(text in draft.nodes.texts for text in draft.weights.texts):
        mend = "Write those with networkx.write_weighted_edgelist; of edges, begin with a header source,target,weight"
        raise FormatError(f"{draft.name}: lists of neighbours, one of every node, or edges and nodes alone? {mend}")


def _refuse_text(draft: EdgeList) -> None:
    """Refuse a first or last row that is text, such as ``n = 3``, or numbers of columns: no other row has its ends."""
    first, second, labels = np.asarray(draft.first), np.asarray(draft.second), [*draft.nodes.texts]
    for k in {0, len(first) - 1} if len(first) > 1 else ():
        ends = [int(first[k]), int(second[k])]
        if np.count_nonzero(np.isin(first, ends) | np.isin(second, ends)) > 1:
            continue
        names, weight = [labels[v] for v in ends], [*draft.weights.texts][draft.codes[k]]
        numbers = all(text.isdigit() for v, text in enumerate(labels) if v not in ends)
        if (numbers and not any(text.isdigit() for text in names)) or (k == 0 and (*names, weight) == ("0", "1", "2")):
            what = f"{shorten(names[0])} and {shorten(names[1])} are in no other row: text, or an edge?"
            mend = "Leave this row out, or begin with a header source,target,weight"
            raise FormatError(f"{draft.name}, line {draft.lines[k]}: {what} {mend}")


def _counts(draft: EdgeList) -> bool:
    """Tell whether the first row may hold the numbers of nodes and of rows after it, which are more than one."""
    labels, others = [*draft.nodes.texts], len(draft.first) - 1
    if others < 2 or not [*draft.weights.texts][draft.codes[0]].isdigit():
        return False
    nodes = {*draft.first[1:], *draft.second[1:], *draft.declared}
    return (labels[draft.first[0]], labels[draft.second[0]]) == (str(len(nodes)), str(others))


def _is_sign(label: str) -> bool:
    return label in ("1", "-1") or sign_of_word(label) is not None


def _size(text: str) -> Fraction:
    """Return the size of a number, 0 of another text."""
    try:
        return abs(parse_exact(text))
    except NumberError:
        return Fraction(0)


def _is_time(text: str, least: Fraction) -> bool:
    """Tell whether a text is a year or a time, which is larger than nodes and weights, or no number at all."""
    try:
        return parse_exact(text) >= least
    except NumberError:
        return not is_entry(text)


def _refuse_decimal_commas(data: bytes, name: str) -> None:
    """Refuse rows such as ``a,b,-1,5`` throughout: their weight may be -1, with another column, or -1.5."""
    lines = (line for line in lines_of(data, name) if line.lstrip()[:1] not in "#%")
    if all(re.fullmatch(r"[^,;\s]*|[^,]*,[^,]*,\s*[+-]?\d+(,\s*\d{1,3}\s*)?", line) for line in lines):
        which = "a weight with a decimal comma, or a weight and another column?"
        raise FormatError(
            f"{name}: {which} Write decimals with a point, or begin with a header source,target,weight,..."
        )


def edge_list(graph: SignedDigraph, name: str) -> bytes:
    """Write a graph as an edge list that is read back as an equal graph with the same order of nodes."""
    labels = [_cell(label, name) for label in graph.labels]
    declared = np.ones(graph.n_nodes, dtype=bool)
    if ordered_labels(list(graph.labels[::-1]))[0] == list(graph.labels):  # the labels themselves tell their order
        declared[graph.source] = declared[graph.target] = False
    lines = ["source,target,weight", *(f"{labels[k]},," for k in np.flatnonzero(declared))]
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
    if label[0] in "#%\ufeff" or re.search(r'[,;"\t\n\r]', label) or _other_separator(label):
        return '"' + label.replace('"', '""') + '"'
    return label
