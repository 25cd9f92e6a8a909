"""UCINET's DL files: a full matrix, or lists of edges or of nodes."""

from __future__ import annotations

import re
from typing import NoReturn

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.raw_edges import Draft, Rows
from ptcc_certify.graphs.io.text_matrices import matrix_rows
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.size_limits import MAX_NODES

_FORMATS = ("fullmatrix", "edgelist1", "nodelist1")
_LABELS = ("labels", "row labels", "column labels", "col labels")
_DIFFER = "labels of rows and columns differ; give both the same, in the same order"
_SECTION = re.compile(
    r"\b(labels\s+embedded|(?:(?:row|col|column|matrix)\s+)?labels(?=\s*:)|data(?=\s*:))\s*:?", re.IGNORECASE
)


def read_dl(data: bytes, name: str, how: Reading) -> Rows:
    """Read a DL file: in a full matrix rows listen unless ``orientation`` says otherwise; a list has edges."""
    text = "\n".join(line for line in lines_of(data, name))
    head = re.match(r"\s*dl\b", text, re.IGNORECASE)
    if not head:
        raise FormatError(f"{name}: not a DL file, which begins with dl n=...; write it again")
    parts = _SECTION.split(text[head.end() :])
    settings = {key.lower(): value.lower() for key, value in re.findall(r"(\w+)\s*=\s*([\w.]+)", parts[0])}
    sections = {" ".join(key.lower().split()): body for key, body in zip(parts[1::2], parts[2::2], strict=True)}
    embedded = "labels embedded" in sections
    layout, n = settings.get("format", "fullmatrix"), settings.get("n", "")
    if settings.get("nm", "1") != "1":
        raise FormatError(f"{name}: {settings['nm']} matrices; save one")
    if layout not in _FORMATS:
        raise FormatError(f"{name}: format={shorten(layout)} is not read; save it as fullmatrix or edgelist1")
    if "nr" in settings or "nc" in settings or not re.fullmatch(r"[1-9][0-9]{0,8}", n) or int(n) > MAX_NODES:
        raise FormatError(f"{name}: not one number n of nodes; begin with dl n=3")
    if "data" not in sections:
        raise FormatError(f"{name}: no section data:; write it")
    told = [_texts(sections[one]) for one in _LABELS if one in sections and not embedded]
    if any(one != told[0] for one in told):
        raise FormatError(f"{name}: {_DIFFER}")
    labels = told[0] if told else []
    body = [_texts(line) for line in sections["data"].split("\n") if line.strip()]
    dl = _Dl(name, int(n), labels, embedded)
    return dl.matrix(body, settings) if layout == "fullmatrix" else dl.edges(body, layout == "nodelist1")


def _texts(line: str) -> list[str]:
    """Split a line at blanks and commas, but for those within quotes."""
    return [quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|([^\s,"]+)', line)]


class _Dl:
    def __init__(self, name: str, n: int, labels: list[str], embedded: bool):
        self.name, self.n, self.embedded = name, n, embedded
        self.labels = labels or ([] if embedded else [str(i) for i in range(1, n + 1)])
        if not embedded and len(self.labels) != n:
            self.refuse(f"{len(self.labels)} labels for n={n} nodes; give one for each")
        if len(set(self.labels)) < len(self.labels):
            self.refuse("two nodes have the same label; rename one")

    def refuse(self, message: str) -> NoReturn:
        raise FormatError(f"{self.name}: {message}")

    def matrix(self, body: list[list[str]], settings: dict[str, str]) -> Rows:
        """Read n rows of n entries, in any number of lines; embedded labels stand before rows and above columns."""
        if settings.get("diagonal", "present") != "present":
            self.refuse("diagonal=absent is not read; save the diagonal, too")
        entries = [text for line in body for text in line]
        if self.embedded:
            columns, entries = entries[: self.n], entries[self.n :]
            self.labels, step = columns, self.n + 1
            if entries[::step] != columns:
                self.refuse(_DIFFER)
            entries = [text for k, text in enumerate(entries) if k % step]
        if len(entries) != self.n * self.n:
            self.refuse(f"{len(entries)} entries, not {self.n} x {self.n}; the file is not whole")
        return matrix_rows(self.labels, [entries[k : k + self.n] for k in range(0, len(entries), self.n)])

    def edges(self, body: list[list[str]], lists: bool) -> Rows:
        """Read rows ``a b w``, or ``a b c ..`` of a node and those that it is tied to, each with weight 1."""
        labels = dict.fromkeys(self.labels)
        ends = [line if lists else line[:2] for line in body]
        if self.embedded:
            labels = dict.fromkeys(text for line in ends for text in line)
        number = {label: i for i, label in enumerate(labels)}
        draft = Draft(labels)
        number |= {} if self.embedded else {str(i): i - 1 for i in range(1, self.n + 1)}
        for line, nodes in zip(body, ends, strict=True):
            if len(nodes) < 2 or (not lists and len(line) != 3) or not all(text in number for text in nodes):
                self.refuse(
                    f'row "{shorten(" ".join(line))}" is no edge of the n={self.n} nodes with a weight; mend it'
                )
            for other in nodes[1:]:
                draft.add(number[nodes[0]], number[other], "1" if lists else line[2])
        if len(labels) != self.n:
            self.refuse(f"{len(labels)} nodes, and n={self.n}; mend n")
        rows = draft.rows()
        rows.notes = ("lists without weights: each is 1",) if lists else ()
        return rows
