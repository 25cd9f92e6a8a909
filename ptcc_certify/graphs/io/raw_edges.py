"""The rows of a graph, whatever its format, before any rule is applied to them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ptcc_certify.errors import GraphError
from ptcc_certify.graphs.io.columns_beside import Column
from ptcc_certify.graphs.io.problems import Problem
from ptcc_certify.graphs.labels import refuse_unnamed
from ptcc_certify.graphs.rationals import shorten

#: What the first row of a table without a header may be.
HEADER_MEND = "; if this row is a header, call who is heard source, who listens target, and the weight weight"
#: The note of a file whose nodes and edges come and go.
TIMES = "times ignored: all edges are there at once"


@dataclass(frozen=True)
class Signs:
    """Signs beside weights: that of row r is ``values[codes[r]]``, in the column or attribute ``title``."""

    values: Sequence[Any]
    codes: Sequence[int] | np.ndarray
    title: str


@dataclass
class Beside:
    """What stands beside the weights of edges, in columns or attributes."""

    title: str = ""  # of a weight whose numbers are codes of relations, unless they are 1 and -1
    signs: Signs | None = None
    columns: Sequence[Column] = ()  # what is not read
    told: bool = False  # were the columns told, so that those beside them say nothing?
    may_be_told: bool = True  # columns, or the attribute of weights
    titles: Sequence[str] = ()  # of source, target and weight


@dataclass
class Rows:
    """What a source says, before any rule is applied: ``labels[first[r]], labels[second[r]], weights[codes[r]]``."""

    labels: list[str]
    first: Sequence[int] | np.ndarray
    second: Sequence[int] | np.ndarray
    weights: Sequence[Any] | np.ndarray  # distinct: texts of the exact grammar, or numbers, or an array of numbers
    codes: Sequence[int] | np.ndarray
    where: Callable[[int], str] = lambda row: ""  # "line 14" of row 13; "" where the format does not tell
    beside: Beside = field(default_factory=Beside)
    undirected: str = ""  # what in the file says that its edges have no direction
    in_order: bool = True  # do the rows come as they stand in the file?
    headerless: bool = False
    kind: Literal["edges", "matrix", "DataFrame"] = "edges"  # a DataFrame is told what files are told
    notes: tuple[str, ...] = ()
    problems: Sequence[Problem] = ()  # what is wrong with rows that are left out
    asks: str = ""  # why the direction must be told

    @property
    def matrix(self) -> bool:
        """Whether these are entries of a matrix, whose rows listen unless it is said that they inform."""
        return self.kind == "matrix"


class Numbers(dict[str, int]):
    """Numbers texts as they come; blanks around a text do not count, and nothing but blanks is a KeyError."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self.texts = {text: number for number, text in enumerate(texts)}

    def __missing__(self, text: str) -> int:
        if not (stripped := text.strip()):
            raise KeyError(text)
        return self.setdefault(text, self.texts.setdefault(stripped, len(self.texts)))


class Nodes(dict[str, int]):
    """Numbers nodes in memory as they come; refuses what has no name, and two that are written alike.

    Examples
    --------
    >>> nodes = Nodes()
    >>> nodes.number(7, "an edge"), nodes.number("a", "an edge"), [*nodes]
    (0, 1, ['7', 'a'])
    """

    def __init__(self) -> None:
        self.first: dict[str, Hashable] = {}

    def number(self, node: Hashable, where: str) -> int:
        """Return the number of a node, which stands in ``where``."""
        label = str(node)
        if label not in self:
            refuse_unnamed(node, where)
            self[label] = len(self)
        if (first := self.first.setdefault(label, node)) is not node and first != node:
            raise GraphError(f"two different nodes are both written {shorten(label)}; rename one of them")
        return self[label]


class Draft:
    """Rows of a text as they come: labels and weights are texts, and every row stands in a line."""

    def __init__(self, labels: Iterable[str] = ()):
        self.nodes, self.weights = Numbers(labels), Numbers()
        self.first, self.second, self.codes, self.lines = list[int](), list[int](), list[int](), list[int]()

    def add(self, first: int, second: int, weight: str, line: int = 0) -> None:
        """Take an edge between nodes with these numbers."""
        self.codes.append(self.weights[weight])
        self.first.append(first)
        self.second.append(second)
        self.lines.append(line)

    def rows(self) -> Rows:
        """Return what was taken."""
        where = lambda row: f"line {self.lines[row]}" if self.lines[row] else ""  # noqa: E731
        return Rows([*self.nodes.texts], self.first, self.second, [*self.weights.texts], self.codes, where)


def rows_of(
    labels: list[str], first: Any, second: Any, weights: Any, beside: Beside | None = None, matrix: bool = False
) -> Rows:
    """Return rows ``labels[first], labels[second], weight`` of edges or of a matrix.

    Examples
    --------
    >>> rows_of(["a", "b"], [0, 1], [1, 0], ["-0.5", "-0.5"]).weights
    ['-0.5']
    """
    return Rows(
        labels, first, second, *distinct(weights), beside=beside or Beside(), kind="matrix" if matrix else "edges"
    )


def distinct(values: Any) -> tuple[Any, Any]:
    """Return the different values, of an array as one, and which of these each value is.

    Examples
    --------
    >>> distinct([2, 1, 2])
    ([2, 1], [0, 1, 0])
    """
    if isinstance(values, np.ndarray):
        return np.unique(values, return_inverse=True)
    table: dict[tuple[type, Any], int] = {}
    try:
        codes = [table.setdefault((type(value), value), len(table)) for value in values]
    except TypeError:  # a value that has no hash, which is refused as no number
        return list(values), np.arange(len(values))
    return [value for _, value in table], codes
