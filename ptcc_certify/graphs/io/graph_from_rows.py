"""The rules that turn rows, whatever their format, into the edges of a graph or refuse them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, NoReturn

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, NumberError
from ptcc_certify.graphs.io.columns_beside import directions, is_signed, notes_on_ignored, verdict
from ptcc_certify.graphs.io.laplacian_or_adjacency import Diagonal, diagonal_of, fits_one_node, is_one_half
from ptcc_certify.graphs.io.problems import Problem, one_message
from ptcc_certify.graphs.io.raw_edges import HEADER_MEND, Rows, Signs
from ptcc_certify.graphs.io.signs import DIRECTIONS, NO_SIGN, code_among, sign_of_word
from ptcc_certify.graphs.labels import in_all, ordered_labels, refuse_written_twice
from ptcc_certify.graphs.packed_weights import LARGEST_WEIGHT, SMALLEST_WEIGHT, Weights
from ptcc_certify.graphs.rationals import MINUS, as_fraction, decimal_mend, nearest_float, parse_exact, shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.recognised_files import shell_word

#: Numbers of a type without signs that are nearer to its largest than this were negative.
_WRAPPED = 32
#: Bits of fractions that are not written.
_LONG = 4000
#: Whole weights from 0 to this, and no other, look like codes.
_LARGEST_CODE = 9


Edges = tuple[list[str], np.ndarray, np.ndarray, Weights, dict[str, Any]]


def edges_of(rows: Rows, name: str, how: Reading) -> Edges:
    """Return labels, source, target, weights and ``read`` of a graph, or tell all rules that its rows break.

    See :func:`ptcc_certify.graphs.io.read_graph`.

    Parameters
    ----------
    rows : Rows
    name : str
        Of the file; "" of data in memory, where mends are parameters instead of flags.
    how : Reading
    """
    if name and not rows.labels and not rows.problems:
        raise FormatError(f"{name}: no edge and no node in this file; give rows source,target,weight")
    if name and len(set(rows.labels)) < len(rows.labels):
        label = Counter(rows.labels).most_common(1)[0][0]
        raise FormatError(f'{name}: two nodes have the label "{shorten(label)}"; rename one')
    alike = refuse_written_twice(rows.labels, name)
    draft = _Draft(rows, name, how)
    if rows.asks and how.orientation is None:
        what, _, mend = rows.asks.rpartition("; ")
        place, _, text = what.partition(": ")
        draft.problems = [Problem(place, text, mend), *draft.problems]
        draft.refuse_problems()
    if not draft.no_weights:  # otherwise weights are no numbers, and say nothing of signs beside them
        draft.multiply_signs()
        draft.read_beside()
        draft.read_laplacian()
    loops = draft.drop(draft.source == draft.target)
    if not how.drop_self_loops and loops.size:
        draft.tell_self_loops(loops)
    zeros = draft.drop(draft.zero())
    if not how.drop_zeros and zeros.size:
        draft.tell_zeros(zeros, "weight 0")
    if draft.undirected and not how.undirected:
        text = f"{draft.undirected} means undirected edges"
        draft.problems.append(Problem("", text, "let each go both ways with {}", "undirected"))
    notes = draft.merge_duplicates()
    draft.refuse_problems()
    source, target, codes = draft.source, draft.target, draft.codes
    if how.undirected:
        source, target, codes = np.append(source, target), np.append(target, source), np.append(codes, codes)
    labels, rank = ordered_labels(rows.labels)
    read = how.record(rows.matrix, loops.size, zeros.size + draft.cancelled)
    read["notes"] = (
        *draft.notes,
        *rows.notes,
        *alike,
        *notes,
        *notes_on_ignored(c for c in rows.beside.columns if c.title not in draft.read_too),
    )
    return labels, rank[source], rank[target], Weights(draft.values, codes), read


class _Draft:
    """The edges that remain, as arrays; edge ``e`` stood in row ``row[e]`` and has the weight ``values[codes[e]]``."""

    def __init__(self, rows: Rows, name: str, how: Reading):
        self.rows, self.name, self.how = rows, name, how
        self.notes: tuple[str, ...] = ()
        self.problems: list[Problem] = [*rows.problems]
        self.no_weights: dict[int, Problem] = {}  # codes of what is no weight, and why
        self.cancelled, self.undirected = 0, rows.undirected
        self.read_too = set[str]()  # titles of columns beside that turned out to be signs
        first, second = np.asarray(rows.first, dtype=np.int64), np.asarray(rows.second, dtype=np.int64)
        self.listens = how.orientation == "listens" or (rows.matrix and how.orientation is None)
        self.source, self.target = (second, first) if self.listens else (first, second)
        self.row, self.codes = np.arange(first.size), np.array(rows.codes, dtype=np.int64)
        self.values: list[Fraction] | np.ndarray
        if not isinstance(rows.weights, np.ndarray):
            self.values = self.read_weights(rows.weights)
            self.leave_out_no_weights()
        elif rows.weights.dtype.kind == "f":  # a float is the dyadic number that it is
            self.values = rows.weights.astype(np.float64)
            if (odd := np.flatnonzero(~np.isfinite(self.values)[self.codes])).size:
                weight = f"weight {self.values[self.codes[odd[0]]]} of edge {self.edge(odd[0])}"
                self.refuse(odd[0], f"{weight} is not a finite number; remove the entry or give a weight")
        else:
            self.values = [Fraction(value) for value in rows.weights.tolist()]
            most = max(rows.weights.tolist(), default=0)
            if rows.weights.dtype.kind == "u" and most > (top := np.iinfo(rows.weights.dtype).max) - _WRAPPED:
                what = f"{most} is what {most - top - 1} becomes in {rows.weights.dtype}"
                self.fail(name, f"{what}; store the matrix as int64 or float64")

    def keep(self, which: np.ndarray) -> None:
        self.source, self.target = self.source[which], self.target[which]
        self.codes, self.row = self.codes[which], self.row[which]

    def drop(self, which: np.ndarray) -> np.ndarray:
        """Leave out edges; return their rows."""
        rows = self.row[which]
        if rows.size:
            self.keep(~which)
        return rows

    def zero(self) -> np.ndarray:
        """Tell which edges have weight 0."""
        zero = self.values == 0 if isinstance(self.values, np.ndarray) else [not value for value in self.values]
        return np.array(zero, dtype=bool)[self.codes]

    def edge(self, edge: int) -> str:
        labels = self.rows.labels
        return f"{shorten(labels[self.source[edge]])} -> {shorten(labels[self.target[edge]])}"

    def edge_of_row(self, row: int) -> str:
        ends = int(self.rows.first[row]), int(self.rows.second[row])
        source, target = ends[::-1] if self.listens else ends
        return f"{shorten(self.rows.labels[source])} -> {shorten(self.rows.labels[target])}"

    def option(self, text: str) -> str:
        """Write an option as a flag, or as a parameter of data in memory."""
        name, _, value = text.partition(" ")
        if self.name:
            return f"--{name.replace('_', '-')} {value}".strip()
        return f'{name}="{value.partition("|")[0]}"' if value else f"{name}=True"

    def call(self, *options: str) -> str:
        """Write options as flags, or as the call that takes them."""
        words = [self.option(option) for option in options]
        return " ".join(words) if self.name else f"as_graph(.., {', '.join(words)})"

    def place(self, row: int | None) -> str:
        where = "" if row is None else self.rows.where(row)
        return ", ".join(filter(None, (self.name, where)))

    def fail(self, place: str, message: str) -> NoReturn:
        if not self.name:
            raise GraphError(message)
        raise FormatError(f"{place}: {message}")

    def refuse(self, edge: int, message: str) -> NoReturn:
        self.fail(self.place(int(self.row[edge])), message)

    def refuse_problems(self) -> None:
        """Refuse all that rows break in one message, with the options that mend it."""
        if self.problems:
            place, message = one_message(self.problems, self.call)
            self.fail(", ".join(filter(None, (self.name, place))), message)

    # ------------------------------------------------------------------ weights and signs

    def read_weights(self, weights: Sequence[Any]) -> list[Fraction]:
        """Read all weights exactly; where they are words for signs and nothing else, as 1 and -1."""
        if not any(isinstance(weight, str) for weight in weights):
            values = [self.parsed(weight, code) for code, weight in enumerate(weights)]
        else:
            words = [sign_of_word(weight) if isinstance(weight, str) else None for weight in weights]
            if None not in words:
                self.notes += ("signs read from words",) if any(len(text) > 1 for text in weights) else ()
                return [Fraction(word) for word in words if word is not None]
            order = sorted(range(len(weights)), key=lambda code: words[code] is not None)
            by_code = {code: self.parsed(weights[code], code) for code in order}  # what is neither is told first
            values = [by_code[code] for code in range(len(weights))]
        if (title := self.rows.beside.title) and not self.no_weights and (odd := code_among(values, title)) is not None:
            what = f'column "{shorten(title)}" holds {odd}: codes of relations, not signs'
            self.refuse(int(np.argmax(self.codes == values.index(odd))), f"{what}; {self.columns_mend()}")
        return values

    def columns_mend(self) -> str:
        if not self.name:
            return "write 1 and -1, or name the weight: as_graph(.., weight=...)"
        columns = shell_word(",".join(self.rows.beside.titles or "abw"))
        tell = f", or name the columns of source, target and weight: --columns {columns}"
        return f"write 1 and -1{tell if self.rows.beside.may_be_told else ''}"

    def parsed(self, weight: Any, code: int) -> Fraction:
        """Read a weight exactly, or name the first edge that has it."""
        edge = lambda: self.edge(int(np.argmax(self.codes == code)))  # noqa: E731
        quoted = f'"{shorten(weight)}"' if isinstance(weight, str) else "a number"
        try:
            if isinstance(weight, Fraction) and max(map(int.bit_length, weight.as_integer_ratio())) < _LONG:
                return weight  # the graph itself refuses one that no float64 is near
            value = parse_exact(weight) if isinstance(weight, str) else as_fraction(weight, "weight")
            if not value or SMALLEST_WEIGHT <= abs(nearest_float(value)) <= LARGEST_WEIGHT:
                return value
            return self.no_weight(
                code, f"weight {quoted} of edge {edge()} is outside the range of float64", "rescale the weights"
            )
        except NumberError as error:
            if not isinstance(weight, str):
                return self.no_weight(code, *f"edge {edge()}: {error}".rsplit("; ", 1))
            message = str(error).removeprefix(quoted) if str(error).startswith(quoted) else f": {error}"
            mend = self.mend_of_text(weight, message, code)
            return self.no_weight(code, f"weight {quoted} of edge {edge()}{message}", mend)

    def no_weight(self, code: int, text: str, mend: str = "give a number") -> Fraction:
        """Note what is no weight, of the first edge that has it."""
        row = int(self.row[int(np.argmax(self.codes == code))])
        self.no_weights[code] = Problem(self.rows.where(row), text, mend)
        return Fraction(1)

    def leave_out_no_weights(self) -> None:
        """Leave edges without a weight out, and tell of the first of them."""
        if self.no_weights:
            without = np.isin(self.codes, [*self.no_weights])
            first = next(iter(self.no_weights.values()))
            self.problems.append(replace(first, text=first.text + in_all(int(without.sum()))))
            self.keep(~without)

    def mend_of_text(self, text: str, message: str, code: int) -> str:
        """Tell how a text is mended that is no number."""
        if "," in text:
            return decimal_mend(text)
        if sign_of_word(text) is not None:
            return "write 1 or -1, as in the other rows"
        if text.startswith("{"):
            return "write the file with networkx.write_weighted_edgelist"
        if MINUS in text:
            return f"write {text.replace(MINUS, '-')[:40]}"
        if "finite" in message or not message.endswith("not a number"):
            return "remove the row or give a weight"
        mend = "give one, or a word for a sign such as + - activates inhibits"
        if code == 0 and self.rows.headerless:
            mend += HEADER_MEND
        return mend

    def multiply_signs(self) -> None:
        """Multiply weights by the signs of a column that is named so."""
        if (signs := self.rows.beside.signs) is not None and len(signs.values):
            self.multiply(signs)

    def read_beside(self) -> None:
        """Multiply weights that are all positive by signs in another column; refuse what may be signs."""
        for column in () if self.rows.beside.told else self.rows.beside.columns:
            what = verdict(column.title, [*column.values])
            values = [*column.values]
            title = shorten(column.title)
            if not what.kind or not len(self.codes):
                continue
            positive = not any(value < 0 for value in self.values)
            codes = column.codes or []
            if what.kind == "turned":
                place = self.place(codes.index(column.values[what.value])) if codes else self.name
                mend = "turn such rows round, write what goes both ways as two, and leave the column out"
                self.fail(place, f'column "{title}" holds {shorten(what.value)}, another direction; {mend}')
            elif what.kind == "directions":
                self.multiply(Signs(directions(column.title, values), codes, column.title))
            elif what.kind == "words" or (
                what.kind == "numbers" and (positive or self.read_too or is_signed(column.title))
            ):
                self.multiply(Signs(values, codes, column.title))
                self.read_too.add(column.title)
            elif positive:
                text = f'column "{title}" holds {shorten(what.value)}, and all weights are positive: are these signs?'
                mend = "If so, write 1 and -1" if self.name else "if so, write 1 and -1"
                tell = self.columns_mend().removeprefix("write 1 and -1")
                place = self.place(codes.index(column.values[what.value])) if codes else self.name
                self.fail(place, f"{text} {mend} throughout{tell}")

    def multiply(self, signs: Signs) -> None:
        """Multiply weights that tell sizes by the signs beside them; refuse signs that say something else."""
        texts = [str(sign).strip() for sign in signs.values]
        beside, title = np.asarray(signs.codes), shorten(signs.title)
        directions = [DIRECTIONS.get(text.lower()) for text in texts]
        if None not in directions:
            if len(set(directions)) > 1:
                self.fail(self.name, f'column "{title}" holds directed and undirected edges; write both as two rows')
            self.undirected = self.undirected or (f'column "{title}"' if directions[0] else "")
            return
        factors = [self.factor(text, beside == code, title) for code, text in enumerate(texts)]
        words = all(sign_of_word(text) is not None for text in texts)
        if not words and (odd := code_among([*map(Fraction, factors)], signs.title)) is not None:
            what = f'column "{title}" holds {", ".join(map(str, sorted(factors)))} and no -1'
            self.refuse(int(np.argmax(beside == factors.index(int(odd)))), f"{what}; {self.columns_mend()}")
        pairs, which = np.unique(self.codes * len(texts) + beside, return_inverse=True)
        both = [(Fraction(self.values[p // len(texts)]), factors[p % len(texts)]) for p in pairs.tolist()]
        if negative := bool(self.rows.beside.title) or any(weight < 0 for weight, _ in both):
            for k, (weight, factor) in enumerate(both):
                if weight * factor < 0 or (weight < 0 and not factor):
                    edge = int(np.argmax(which == k))
                    what = f'weight {weight} of edge {self.edge(edge)} and {factor} in column "{title}" disagree'
                    self.refuse(edge, f"{what}; {self.columns_mend()}")
        self.values, self.codes = [abs(weight) * factor for weight, factor in both], which.astype(np.int64)
        self.notes += (f'column "{title}" agrees' if negative else f'weights times column "{title}"',)

    def factor(self, text: str, beside: np.ndarray, title: str) -> int:
        """Return the sign that a text stands for, or 0; refuse any other, of the first of the edges ``beside``."""
        if (word := sign_of_word(text)) is not None:
            return word
        try:
            if (number := parse_exact(text)) in (-1, 0, 1):
                return int(number)
            what = f"is neither 1 nor -1: a code of a relation; {self.columns_mend()}"
        except NumberError:
            what = f"{NO_SIGN}; {self.columns_mend()}"
        edge = int(np.argmax(beside))
        return self.refuse(edge, f'"{shorten(text)}" of edge {self.edge(edge)} in column "{title}" {what}')

    # ------------------------------------------------------------------ rules

    def read_laplacian(self) -> None:
        """Read the weights of a Laplacian, if it is told to be one; refuse what looks like one untold."""
        if self.how.laplacian is False or not (self.how.laplacian or (self.source == self.target).any()):
            return
        entries = np.array([nearest_float(v) if isinstance(v, Fraction) else v for v in self.values])[self.codes]
        first, second = np.asarray(self.rows.first), np.asarray(self.rows.second)
        if not self.how.laplacian and not self.rows.matrix and not fits_one_node(first, second, entries):
            return
        found = self.diagonal(first, second, entries)
        if not self.how.laplacian:
            self.refuse_laplacian_untold(found)
            return
        self.refuse_no_laplacian(found)
        self.drop(self.source == self.target)
        self.values = -self.values if isinstance(self.values, np.ndarray) else [-value for value in self.values]
        ordinary = not (found.rows or found.columns)
        self.notes += ("a Laplacian: each weight is minus the entry",)
        self.notes += ("its rows sum to 0, those of the protocol's signed Laplacian do not",) if ordinary else ()

    def diagonal(self, first: np.ndarray, second: np.ndarray, entries: np.ndarray) -> Diagonal:
        """Compare the diagonal with the other entries; note edges without a direction, where it tells that they are."""
        both = self.how.undirected or bool(self.undirected)
        found = diagonal_of(first, second, entries, len(self.rows.labels), both)
        if found.laplacian or not (both or is_one_half(first, second)):
            return found
        other = diagonal_of(first, second, entries, len(self.rows.labels), not both)  # of both halves, or of one
        if not both and other.laplacian and (other.loops > 1 or self.how.laplacian):
            self.undirected = "a diagonal that holds the sums over both ends of edges"
        return other if other.laplacian or not is_one_half(first, second) else found

    def refuse_laplacian_untold(self, found: Diagonal) -> None:
        """Refuse what looks like a Laplacian and is not told to be one."""
        no = "--no-laplacian" if self.name else "laplacian=False"
        if self.rows.matrix and found.normalised and not found.laplacian:
            what = "a positive diagonal, and no positive entry beside it, as of a normalised Laplacian; give W"
            self.fail(self.name, f"{what}, or add {no} if these are self-loops")
        if found.laplacian and (self.rows.matrix or found.loops > 1):
            what = "the diagonal holds the sums of the other entries, as a Laplacian's"
            if not self.name and self.rows.kind == "edges":
                self.fail(self.name, f"{what}; give the matrix with laplacian=True, or leave the self-loops out")
            both = ("undirected",) if self.undirected and not self.how.undirected else ()
            mend = f"read it with {self.call('laplacian', *both)}, or add {no} if these are self-loops"
            self.fail(self.name, f"{what}; {mend}")

    def refuse_no_laplacian(self, found: Diagonal) -> None:
        """Refuse what is no Laplacian ``D - W``, or tells its direction by columns where none was said."""
        if found.negative and found.loops:
            self.fail(self.name, "the diagonal is minus the sums of magnitudes: minus a Laplacian; give its negative")
        if not (found.rows or found.columns or found.balanced_rows or found.balanced_columns):
            label = shorten(self.rows.labels[found.odd])
            self.fail(self.name, f"no Laplacian: the diagonal of row {label} is not the sum of magnitudes beside it")
        if self.how.orientation is not None:
            return
        if self.rows.matrix and self.name and not (found.rows or found.balanced_rows):
            what = "a Laplacian whose columns hold the sums: do columns listen?"
            self.fail(self.name, f"{what} Say --edges information, or --edges listens if rows do")
        if not self.rows.matrix and not (found.columns or found.balanced_columns):  # sums of who is heard
            say = "--edges {}" if self.name else 'orientation="{}"'
            what = "a Laplacian with the sums over edges of one source: does the source listen?"
            mend = f"Say {say.format('listens')}, or {say.format('information')} if the target does"
            self.fail(self.name, f"{what} {mend}")

    def tell_self_loops(self, rows: np.ndarray) -> None:
        label = shorten(self.rows.labels[int(self.rows.first[rows[0]])])
        mend = "remove them" if rows.size > 1 else "remove it"
        if rows.size > 1 and self.rows.where(0).startswith("line"):
            mend = "remove these rows"
        text = f"self-loop at node {label}{in_all(rows.size)}"
        self.problems.append(
            Problem(self.rows.where(int(rows[0])), text, f"{mend}, or drop all with {{}}", "drop_self_loops")
        )

    def tell_zeros(self, rows: np.ndarray, what: str) -> None:
        named = ", ".join(self.edge_of_row(row) for row in rows[:5].tolist())
        text = f"{what} of edge {named}{in_all(rows.size)}"
        text += ": neither ally nor opponent"
        values = sorted(set(self.values)) if len(self.values) <= _LARGEST_CODE + 1 else []
        if not self.rows.matrix and values[1:] not in ([], [1]) and set(values) <= {*range(_LARGEST_CODE + 1)}:
            text += f" (are {', '.join(map(str, values))} codes of relations?)"
        mend = "remove it or give a weight, or drop all with {}"
        self.problems.append(Problem(self.rows.where(int(rows[0])), text, mend, "drop_zeros"))

    def mirrored(self, first: np.ndarray) -> bool:
        """Tell whether rows repeat ``first`` ones once, the other way, with equal weights, which a sum would double."""
        later = np.flatnonzero(first != np.arange(first.size))
        first = first[later]
        values = [[self.values[code] for code in self.codes[rows].tolist()] for rows in (first, later)]
        turned = (self.source[first] == self.target[later]) & (self.source[first] != self.source[later])
        once = np.unique(first).size == first.size
        return once and bool(turned.all()) and values[0] == values[1] and (self.rows.in_order or bool(self.undirected))

    def merge_duplicates(self) -> tuple[str, ...]:
        """Tell or merge the rows of one pair (of one unordered pair, if edges go both ways); note how many."""
        duplicates = self.how.duplicates
        undirected = self.how.undirected or (duplicates == "refuse" and bool(self.undirected))
        low, high = self.source, self.target
        if undirected:
            low, high = np.minimum(low, high), np.maximum(low, high)
        key = low * len(self.rows.labels) + high
        if not (repeated := int(np.count_nonzero(np.diff(np.sort(key)) == 0))):
            return ()
        _, first, pair, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
        if duplicates == "refuse":
            second = int(np.argmax(first[pair] != np.arange(key.size)))
            earlier = self.rows.where(int(self.row[first[pair[second]]])) or "an earlier one"
            which = f"{self.edge(second)} (the first is {earlier})" if self.name else self.edge(second)
            text = f"{'second row for edge' if self.name else 'two edges'} {which}{in_all(repeated)}"
            which = "last" if undirected and self.mirrored(first[pair]) else "sum|last"
            mend = "keep one, or merge with {}"
            self.problems.append(Problem(self.rows.where(int(self.row[second])), text, mend, f"duplicates {which}"))
            return ()
        if duplicates == "last":
            if undirected and not self.undirected and not self.rows.in_order:
                self.fail(self.name, "which of two opposite edges is the last is not known; use sum")
            self.keep(key.size - 1 - np.unique(key[::-1], return_index=True)[1])
        else:
            values: list[Fraction] = [Fraction(value) for value in self.values]
            sums: dict[int, Fraction] = defaultdict(Fraction)
            for edge in np.flatnonzero(count[pair] > 1).tolist():
                sums[int(pair[edge])] += values[self.codes[edge]]
            self.codes[first[list(sums)]] = np.arange(len(values), len(values) + len(sums))
            self.values = values + list(sums.values())
            self.keep(np.sort(first))
            rows = self.drop(self.zero())
            self.cancelled = rows.size
            if rows.size and not self.how.drop_zeros:
                self.tell_zeros(rows, "sum 0 of the weights")
        return (f"{repeated} repeated rows were merged ({duplicates})",)
