"""Pajek: networks of ``.net`` files and of the projects of ``.paj`` files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TypeVar

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.attributes import both_ways
from ptcc_certify.graphs.io.columns_beside import column_of
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.raw_edges import TIMES, Draft, Rows
from ptcc_certify.graphs.io.text_matrices import is_zero
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.size_limits import MAX_NODES

#: Sections of a network, and those of a project that are not read.
_LISTS = ("arcs", "edges", "arcslist", "edgeslist", "matrix")
_BESIDE = ("partition", "vector", "permutation", "cluster", "hierarchy", "events")
_FORM = "not *Vertices n and then lists of *Arcs, *Edges, *Arcslist, *Edgeslist or a *Matrix; write it so"

Line = tuple[int, str]
_One = TypeVar("_One")


@dataclass
class _Section:
    """A list of a network: its kind, number and name of its relation, and its rows with their numbers of lines."""

    kind: str
    relation: str
    named: bool  # or called by its number
    lines: list[Line] = field(default_factory=list)


@dataclass
class _Network:
    title: str
    nodes: list[Line] = field(default_factory=list)
    vertices: str | None = None
    sections: list[_Section] = field(default_factory=list)
    events: bool = False  # a list of times

    def rows(self) -> Iterator[Line]:
        """Yield all rows."""
        return chain(self.nodes, *(section.lines for section in self.sections))


def read_pajek(data: bytes, name: str, how: Reading) -> Rows:
    """Read Pajek: ``*Vertices n``, rows ``number label`` where labels are not numbers, lists of arcs and edges."""
    networks = list(_networks(lines_of(data, name), name))
    if len(networks) > 1:
        networks = [_chosen({one.title: one for one in networks}, "networks", name, how)]
    if not networks:
        raise FormatError(f"{name}: {_FORM}")
    network = networks[0]
    network.sections = [section for section in network.sections if section.lines] or network.sections[:1]
    relations = dict.fromkeys(section.relation for section in network.sections)
    if len(relations) > 1:
        wanted = _chosen({one: one for one in relations}, "relations", name, how)
        network.sections = [section for section in network.sections if section.relation == wanted]
    elif how.variable not in (None, network.title, *relations):
        raise FormatError(f"{name}: no network and no relation is called {shorten(str(how.variable))}")
    labels = _labels(network, name)
    draft = _Rows(labels, name)
    for section in network.sections:
        draft.read(section)
    rows = draft.rows()
    rows.beside.columns = [column_of("label", draft.tags)] if any(draft.tags) else []
    rows.notes = tuple({f'relation "{shorten(section.relation)}"': 0 for section in network.sections if section.named})
    rows.notes += ("lists without weights: each is 1",) if draft.lists else ()
    timed = any(re.search(r'(^|\s)\[[\d*,\s-]+\](?=[^"]*$)', row) for _, row in network.rows())
    rows.notes += (TIMES,) if timed or network.events else ()
    return both_ways(rows, draft.undirected, "*Edges", how)


def _chosen(named: Mapping[str, _One], what: str, name: str, how: Reading) -> _One:
    """Return the network or relation that is told by its name, or name all."""
    if how.variable is not None and how.variable in named:
        return named[how.variable]
    names = ", ".join(f'"{shorten(one)}"' for one in list(named)[:20])
    raise FormatError(f"{name}: several {what} ({names}); choose one with --variable NAME")


def _networks(lines: Sequence[str], name: str) -> Iterator[_Network]:
    network, read = _Network(""), True
    rows: list[Line] = network.nodes
    for number, text in enumerate(lines, 1):
        line = text.strip()
        if not line or line.startswith(("%", "/*")):
            continue
        if not line.startswith("*"):
            if read and network.vertices is None:
                raise FormatError(f"{name}, line {number}: {_FORM}")
            rows.append((number, line))
            continue
        kind, _, rest = line[1:].partition(" ") if " " in line else line[1:].partition("\t")
        kind, rest = kind.lower(), rest.strip()
        relation = re.match(r"(?::\s*(\d+)\s*)?(?:\"([^\"]*)\"|'([^']*)')?\s*$", rest)
        if kind == "vertices" and not read:
            continue  # of a partition or a vector
        if kind in ("network", "vertices"):
            if kind == "network" or network.vertices is not None:
                if network.vertices is not None:
                    yield network
                network = _Network(rest if kind == "network" else "")
            rows, read = network.nodes, True
            network.vertices = rest if kind == "vertices" else None
        elif kind in _LISTS and network.vertices is not None and relation:
            section = _Section(kind, relation[2] or relation[3] or relation[1] or "1", bool(relation[2] or relation[3]))
            network.sections.append(section)
            rows, read = section.lines, True
        elif kind in _BESIDE:
            rows, read = [], False
            network.events = network.events or kind == "events"
        else:
            raise FormatError(f'{name}, line {number}: "{shorten(line)}": {_FORM}')
    if network.vertices is not None:
        yield network


def _labels(network: _Network, name: str) -> list[str]:
    """Return the labels of the vertices, which are their numbers where they have none."""
    if not re.fullmatch(r"[0-9]{1,9}", network.vertices or "", re.ASCII):
        what = "two sets of nodes" if re.fullmatch(r"\d+\s+\d+", network.vertices or "") else "no number of nodes"
        raise FormatError(f"{name}: *Vertices {shorten(network.vertices or '')}: {what}; write *Vertices n")
    n = int(network.vertices or 0)
    if n > MAX_NODES:
        raise FormatError(f"{name}: {n} nodes are more than {MAX_NODES}")
    labels = [str(i) for i in range(1, n + 1)]
    declared = set()
    for line, row in network.nodes:
        number, *rest = _fields(row, line, name)
        if not _is_node(number, n) or number in declared:
            what = "declared twice" if number in declared else f"not one of 1 to {n}"
            raise FormatError(f"{name}, line {line}: node {shorten(number)} is {what}; mend the rows of *Vertices")
        declared.add(number)
        if rest:
            labels[int(number) - 1] = rest[0]
    if len(set(labels)) < n:
        raise FormatError(f"{name}: two nodes have the same label; rename one")
    return labels


def _fields(row: str, line: int, name: str) -> list[str]:
    """Split a row at blanks, but for those within double quotes."""
    if '"' not in row:
        return row.split()
    if not re.fullmatch(r'\s*(?:(?:"[^"]*"|[^\s"]+)(?:\s+|$))*', row):
        raise FormatError(f"{name}, line {line}: not Pajek that can be read (no closing quotation); write it again")
    return [quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|([^\s"]+)', row)]


def _is_node(text: str, n: int) -> bool:
    return text.isascii() and text.isdigit() and text == str(int(text)) and 1 <= int(text) <= n


class _Rows(Draft):
    """The rows of all sections."""

    def __init__(self, labels: list[str], name: str):
        super().__init__(labels)
        self.labels, self.name = labels, name
        self.n = len(labels)
        self.undirected, self.tags, self.lists = list[bool](), list[str](), False

    def read(self, section: _Section) -> None:
        """Read a section."""
        undirected = section.kind.startswith("edges")
        for k, (line, row) in enumerate(section.lines):
            fields = row.split()
            if section.kind == "matrix":
                if len(fields) != self.n or len(section.lines) != self.n:
                    raise FormatError(
                        f"{self.name}, line {line}: the *Matrix has not {self.n} rows of {self.n} numbers"
                    )
                edges = [(k, m, entry) for m, entry in enumerate(fields) if not is_zero(entry)]
            else:
                lists = section.kind.endswith("list")
                nodes = fields if lists else fields[:2]
                if len(nodes) < 2 or not all(_is_node(text, self.n) for text in nodes):
                    what = f'row "{shorten(row)}" does not name {"" if lists else "two of "}the nodes 1 to {self.n}'
                    raise FormatError(f"{self.name}, line {line}: {what}; mend it")
                weight = "1" if lists else "".join(fields[2:3])
                if not _is_number(weight):
                    edge = " -> ".join(shorten(self.labels[int(node) - 1]) for node in nodes)
                    raise FormatError(
                        f"{self.name}, line {line}: edge {edge} has no weight; give it in the third column"
                    )
                edges = [(int(nodes[0]) - 1, int(other) - 1, weight) for other in nodes[1:]]
                self.lists = self.lists or lists
            tag = re.search(r'\sl\s+(?:"([^"]*)"|(\S+))', row)  # the label of an arc, which may be a sign
            for first, second, weight in edges:
                self.add(first, second, weight, line)
                self.tags.append("" if tag is None else tag[1] or tag[2] or "")
                self.undirected.append(undirected)


def _is_number(text: str) -> bool:
    return re.match(r"[+-]?(\d|\.\d|nan|inf)", text, re.IGNORECASE) is not None
