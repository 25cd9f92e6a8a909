"""Adjacency matrices as text: plain or with labels, as MATLAB, NumPy and Python print them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import decoded
from ptcc_certify.graphs.io.laplacian_or_adjacency import diagonal_of
from ptcc_certify.graphs.io.raw_edges import Rows, rows_of
from ptcc_certify.graphs.io.signs import sign_of_word
from ptcc_certify.graphs.rationals import decimal_mend, shorten

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?|\d+/\d+|nan|inf(inity)?)", re.IGNORECASE)
_ZERO = re.compile(r"[+-]?(0+\.?0*|\.0+)([eE][+-]?\d+)?")
#: What may stand around a matrix in brackets, as MATLAB, NumPy and Python write it.
_BRACKETS = re.compile(
    r"\s*(?:\w+\s*=\s*)?(?:[\w.]+\()?\s*(\[.*\])\s*(?:,\s*dtype=[\w.'\"]+\s*)?\)?\s*;?\s*", re.DOTALL
)
Line = Sequence[str]


def is_zero(text: str) -> bool:
    """Tell whether a text is the number 0.

    Examples
    --------
    >>> is_zero("-0.0"), is_zero("-"), is_zero("0e5")
    (True, False, True)
    """
    return _ZERO.fullmatch(text) is not None


def is_number(text: str) -> bool:
    """Tell whether a text is a number.

    Examples
    --------
    >>> is_number("-0.5"), is_number("1/3"), is_number("+")
    (True, True, False)
    """
    return _NUMBER.fullmatch(text) is not None


def is_entry(text: str) -> bool:
    """Tell whether a text is a number, or a word for a sign.

    Examples
    --------
    >>> is_entry("-0.5"), is_entry("1/3"), is_entry("+"), is_entry("b")
    (True, True, True, False)
    """
    return is_number(text) or sign_of_word(text) is not None


def matrix_rows(labels: list[str], entries: Sequence[Line]) -> Rows:
    """Turn the entries of a matrix, which are texts, into rows; a zero is no entry.

    Examples
    --------
    >>> matrix_rows(["a", "b"], [["0", "-0.5"], ["0.0", "0"]]).weights
    ['-0.5']
    """
    zeros, found = dict[str, bool](), []
    for k, line in enumerate(entries):
        for m, text in enumerate(line):
            if text not in zeros:
                zeros[text] = is_zero(text)
            if not zeros[text]:
                found.append((k, m, text))
    rows = rows_of(labels, [k for k, *_ in found], [m for _, m, _ in found], [text for *_, text in found], matrix=True)
    rows.where = lambda row: f"row {shorten(labels[found[row][0]])}, column {shorten(labels[found[row][1]])}"
    return rows


def bracketed_matrix(data: bytes, name: str) -> Rows | None:
    """Read ``[0 -1; 1 0]``, ``W = [..]``, ``[[0, -1], [1, 0]]``, or what NumPy prints; None of other texts."""
    if not re.match(rb"(\xef\xbb\xbf)?\s*(\w+\s*=\s*)?([\w.]+\()?\s*\[", data[:400]):
        return None
    text = "\n".join(line for line in decoded(data, name).splitlines() if line.strip()[:1] not in ("#", "%"))
    if (match := _BRACKETS.fullmatch(text)) is None or '"' in text or "{" in text:
        return None
    inner = match[1][1:-1]
    nested = re.findall(r"\[([^\[\]]*)\]", inner)
    if re.search(r"(^|[\s,\[])\.\.\.", inner.replace("...\n", " ")):
        raise FormatError(f"{name}: a matrix that was printed in parts (...); write all of it: numpy.savetxt")
    lines = nested or re.split(r"[;\n]", inner.replace("...\n", " "))
    entries = [re.findall(r"[^\s,]+", line) for line in lines if line.strip(" ,\t\r")]
    n = len(entries)
    if any(len(line) != n for line in entries) or not all(map(is_entry, (text for line in entries for text in line))):
        raise FormatError(f"{name}: brackets, but no square matrix of numbers; write n rows of n numbers")
    return _told([str(i) for i in range(1, n + 1)], entries)


def table_as_matrix(table: Sequence[Line], name: str) -> Rows | None:
    """Read the rows of a whole table as a matrix; None if they are none.

    Rows and columns of a matrix may have labels, which are the same. Without them n rows of n numbers are a matrix if
    the diagonal is 0, or that of a Laplacian, and if they are no edges: a third weight would be 0, or a node would be
    called by a negative number or a fraction.
    """
    lines = [[text.strip() for text in line] for line in table]
    if len(lines) < 2:
        return None
    if all(len(line) > 2 and not line[-1] for line in lines):  # a separator ends each row
        lines = [line[:-1] for line in lines]
    n = len(lines) - 1
    columns = lines[0][1:] if len(lines[0]) == len(lines[1]) else lines[0]
    labels = [line[0] for line in lines[1:]]
    corner = len(lines[0]) == len(lines[1]) and _NUMBER.fullmatch(lines[0][0]) is not None
    same = not corner and all(labels) and len(set(labels)) == n == len(columns) and set(columns) == set(labels)
    if same and all(len(line) == n + 1 for line in lines[1:]):
        return _labelled(labels, columns, [line[1:] for line in lines[1:]], name, bool(lines[0][0]))
    if not lines[0][0] and all(lines[0][1:]) and all(map(is_entry, filter(None, lines[1][1:]))) and lines[1][0]:
        what = "looks like a matrix with names, and its rows and columns have different ones"
        raise FormatError(f"{name}, line 1: {what}; give both the same, or write rows of edges")
    if lines[0] == [str(k) for k in range(n)] and _plain(lines[1:]) is not None:
        raise FormatError(f"{name}, line 1: numbers of columns above a matrix, or an edge? Leave this row out")
    if n == len(lines[0]) == len(set(lines[0])) and all(lines[0]) and not any(map(is_entry, lines[0])):
        rows = _plain(lines[1:])  # only columns have labels
        return None if rows is None else _told(lines[0], lines[1:])
    return _plain(lines)


def _labelled(labels: list[str], columns: list[str], entries: list[list[str]], name: str, named: bool) -> Rows | None:
    for label, line in zip(labels, entries, strict=True):
        for column, text in zip(columns, line, strict=True):
            if not text:
                raise FormatError(
                    f"{name}: row {shorten(label)}, column {shorten(column)} of the matrix is empty; write 0"
                )
    if odd := [(k, m) for k, line in enumerate(entries) for m, text in enumerate(line) if not is_entry(text)]:
        if named:
            return None
        k, m = odd[0]
        text = entries[k][m]
        place = f"row {shorten(labels[k])}, column {shorten(columns[m])} of the matrix"
        raise FormatError(f'{name}: {place}: "{shorten(text)}" is not a number; {decimal_mend(text)}')
    order = [columns.index(label) for label in labels]
    return _told(labels, [[line[k] for k in order] for line in entries])


def _plain(lines: list[list[str]]) -> Rows | None:
    n = len(lines)
    if any(len(line) != n for line in lines) or not all(is_entry(text) for line in lines for text in line):
        return None
    ends = [text for line in lines for text in line[:2]]
    no_labels = any(not re.fullmatch(r"\d+", text) for text in ends)
    no_diagonal = all(is_zero(line[k]) for k, line in enumerate(lines))
    if (no_diagonal and (n > 2 or no_labels)) or ((n > 3 or no_labels) and _like_laplacian(lines)):
        return _told([str(i) for i in range(1, n + 1)], lines)
    return None


def _like_laplacian(lines: list[list[str]]) -> bool:
    try:
        entries = np.array(lines, dtype=float)
    except ValueError:
        return False
    first, second = np.nonzero(entries)
    return diagonal_of(first, second, entries[first, second], len(lines), False).laplacian


def _told(labels: list[str], entries: Sequence[Line]) -> Rows:
    rows = matrix_rows(labels, entries)
    rows.notes = (f"a {len(labels)} x {len(labels)} matrix as text",)
    return rows
