"""The rows of a file, whatever its format, and the rules that turn them into a graph or refuse them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NoReturn

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, NumberError
from ptcc_certify.graphs.digraph import (
    LARGEST_WEIGHT,
    SMALLEST_WEIGHT,
    SignedDigraph,
    Weights,
    in_all,
    ordered_labels,
)
from ptcc_certify.graphs.rationals import MINUS, nearest_float, parse_exact, shorten

#: What the first row of a table without a header may be.
HEADER_MEND = "; if this row is a header, name its columns source, target, weight"
#: What is said at once of a table with such a row and decimal commas.
DECIMALS = "; write decimals with a point, too"

#: What stands for a sign in some tables.
WORDS_OF_SIGN = ("+", "-", MINUS, "positive", "negative", "pos", "neg", "plus", "minus")


@dataclass
class Rows:
    """What a file says, before any rule is applied: ``labels[first[r]], labels[second[r]], weights[codes[r]]``."""

    labels: list[str]
    first: Sequence[int] | np.ndarray
    second: Sequence[int] | np.ndarray
    weights: Sequence[str] | np.ndarray  # distinct: texts of the exact grammar, or an array of integers or floats
    codes: Sequence[int] | np.ndarray
    where: Callable[[int], str]  # "line 14" of row 13; "" where the format does not tell
    undirected: str = ""  # what in the file says that its edges have no direction
    in_order: bool = True  # do the rows come as they stand in the file?
    headerless: bool = False
    notes: tuple[str, ...] = ()


class Numbers(dict[str, int]):
    """Numbers texts as they come; blanks around a text do not count, and nothing but blanks is a KeyError."""

    def __init__(self) -> None:
        self.texts: dict[str, int] = {}

    def __missing__(self, text: str) -> int:
        if not (stripped := text.strip()):
            raise KeyError(text)
        return self.setdefault(text, self.texts.setdefault(stripped, len(self.texts)))


def graph_of(
    rows: Rows, name: str, orientation: str, duplicates: str, drop_self_loops: bool, undirected: bool
) -> SignedDigraph:
    """Build the graph, or refuse the first row that breaks a rule; see :func:`ptcc_certify.graphs.io.read_graph`."""
    if not rows.labels:
        raise FormatError(f"{name}: no edge and no node in this file; give rows source,target,weight")
    if len(set(rows.labels)) < len(rows.labels):
        label = Counter(rows.labels).most_common(1)[0][0]
        raise FormatError(f'{name}: two nodes have the label "{shorten(label)}"; rename one')
    if rows.undirected and not undirected:
        raise FormatError(f"{name}: {rows.undirected} means undirected edges; let each go both ways with --undirected")
    draft = _Draft(rows, name, listens=orientation != "information")
    loops = draft.drop_self_loops(drop_self_loops)
    draft.refuse_zeros("weight 0")
    notes = draft.merge_duplicates(duplicates, undirected)
    source, target, codes = draft.source, draft.target, draft.codes
    if undirected:
        source, target, codes = np.append(source, target), np.append(target, source), np.append(codes, codes)
    labels, rank = ordered_labels(rows.labels)
    read = {
        "orientation": orientation,
        "duplicates": "refused" if duplicates == "refuse" else duplicates,
        "self_loops": f"dropped {loops}" if drop_self_loops else "refused",
        "undirected": undirected,
        "notes": rows.notes + notes,
    }
    try:
        return SignedDigraph(labels, rank[source], rank[target], Weights(draft.values, codes), read)
    except GraphError as error:
        raise FormatError(f"{name}: {error}") from None


class _Draft:
    """The edges that remain, as arrays; edge ``e`` stood in row ``row[e]`` and has the weight ``values[codes[e]]``."""

    def __init__(self, rows: Rows, name: str, listens: bool):
        self.rows, self.name = rows, name
        first, second = np.asarray(rows.first, dtype=np.int64), np.asarray(rows.second, dtype=np.int64)
        self.source, self.target = (second, first) if listens else (first, second)
        self.row, self.codes = np.arange(first.size), np.array(rows.codes, dtype=np.int64)
        self.values: list[Fraction] | np.ndarray
        if not isinstance(rows.weights, np.ndarray):
            self.values = [self.parsed(text, code) for code, text in enumerate(rows.weights)]
        elif rows.weights.dtype.kind == "f":  # a float is the dyadic number that it is
            self.values = rows.weights.astype(np.float64)
            if (odd := np.flatnonzero(~np.isfinite(self.values)[self.codes])).size:
                weight = f"weight {self.values[self.codes[odd[0]]]} of edge {self.edge(odd[0])}"
                self.refuse(odd[0], f"{weight} is not a finite number; remove the entry or give a weight")
        else:
            self.values = [Fraction(value) for value in rows.weights.tolist()]

    def keep(self, which: np.ndarray) -> None:
        self.source, self.target = self.source[which], self.target[which]
        self.codes, self.row = self.codes[which], self.row[which]

    def edge(self, edge: int) -> str:
        labels = self.rows.labels
        return f"{shorten(labels[self.source[edge]])} -> {shorten(labels[self.target[edge]])}"

    def refuse(self, edge: int, message: str) -> NoReturn:
        where = self.rows.where(int(self.row[edge]))
        raise FormatError(f"{self.name}{where and ', '}{where}: {message}")

    def parsed(self, text: str, code: int) -> Fraction:
        """Read a weight exactly, or name the first edge that has it."""
        quoted = f'"{shorten(text)}"'
        try:
            value = parse_exact(text)
            if not value or SMALLEST_WEIGHT <= abs(nearest_float(value)) <= LARGEST_WEIGHT:
                return value
            message, mend = " is outside the range of float64", "rescale the weights"
        except NumberError as error:
            message = str(error).removeprefix(quoted) if str(error).startswith(quoted) else f": {error}"
            mend = "remove the row or give a weight"
            if "," in text:
                mend = "write decimals with a point"
            elif text.lower() in WORDS_OF_SIGN:
                mend = "write 1 or -1"
            elif text.startswith("{"):
                mend = "write the file with networkx.write_weighted_edgelist"
            elif MINUS in text:
                mend = f"write {text.replace(MINUS, '-')[:40]}"
            elif code == 0 and self.rows.headerless and "finite" not in message:
                mend += HEADER_MEND + DECIMALS * any("," in other for other in self.rows.weights[1:])
        edge = int(np.argmax(self.codes == code))
        return self.refuse(edge, f"weight {quoted} of edge {self.edge(edge)}{message}; {mend}")

    def drop_self_loops(self, allowed: bool) -> int:
        loops = np.flatnonzero(self.source == self.target)
        if loops.size and not allowed:
            which = f"{shorten(self.rows.labels[self.source[loops[0]]])}{in_all(loops.size)}"
            mend = "remove these rows" if loops.size > 1 and self.rows.where(0).startswith("line") else "remove it"
            self.refuse(loops[0], f"self-loop at node {which}; {mend}, or drop all with --drop-self-loops")
        self.keep(self.source != self.target)
        return int(loops.size)

    def refuse_zeros(self, what: str) -> None:
        edges = np.flatnonzero(np.array([not value for value in self.values], dtype=bool)[self.codes])
        if edges.size:
            named = ", ".join(self.edge(edge) for edge in edges[:5].tolist())
            which = f"{what} of edge {named}{in_all(edges.size)}"
            self.refuse(edges[0], f"{which}: neither ally nor opponent; remove it or give a weight")

    def merge_duplicates(self, duplicates: str, undirected: bool) -> tuple[str, ...]:
        """Refuse or merge the rows of one pair (of one unordered pair, if edges go both ways); note how many."""
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
            which = f"{self.edge(second)} (the first is {earlier}){in_all(repeated)}"
            self.refuse(second, f"second row for edge {which}; keep one, or merge with --duplicates sum|last")
        if duplicates == "last":
            if undirected and not self.rows.undirected and not self.rows.in_order:
                raise FormatError(f"{self.name}: which of two opposite edges is the last is not known; use sum")
            self.keep(key.size - 1 - np.unique(key[::-1], return_index=True)[1])
        else:
            values: list[Fraction] = [Fraction(value) for value in self.values]
            sums: dict[int, Fraction] = defaultdict(Fraction)
            for edge in np.flatnonzero(count[pair] > 1).tolist():
                sums[int(pair[edge])] += values[self.codes[edge]]
            self.codes[first[list(sums)]] = np.arange(len(values), len(values) + len(sums))
            self.values = values + list(sums.values())
            self.keep(np.sort(first))
            self.refuse_zeros("sum 0 of the weights")
        return (f"{repeated} repeated rows were merged ({duplicates})",)
