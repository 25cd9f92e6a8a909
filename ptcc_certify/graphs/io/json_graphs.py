"""Graphs as JSON: node-link data of networkx and D3, lists of edges, matrices."""

from __future__ import annotations

import json
from typing import Any

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.attributes import attribute_rows, lower_case, names_or_identifiers, text_of
from ptcc_certify.graphs.io.files import decoded, one_line_errors
from ptcc_certify.graphs.io.raw_edges import Rows
from ptcc_certify.graphs.io.text_matrices import bracketed_matrix
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading

_LINKS = ("links", "edges")
#: What may name nodes that have no id.
_NAMES = ("name", "label")
_FORM = 'give {"directed": true, "nodes": [{"id": ..}], "links": [{"source": .., "target": .., "weight": ..}]}'


class _Integer(str):
    """An integer of JSON, as it is written: it may be the position of a node, and a text may not."""


def read_json(data: bytes, name: str, how: Reading) -> Rows:
    """Read node-link data, whose links may name nodes by ``id`` or, where there is none, by position from 0 or by name.

    Numbers are texts, so that they are read exactly. Links have a direction unless ``directed`` says false.
    """
    with one_line_errors(name, "JSON"):
        document = json.loads(
            decoded(data, name), parse_float=str, parse_int=_Integer, parse_constant=str, object_pairs_hook=_once
        )
    if isinstance(document, list) and (matrix := bracketed_matrix(data, name)) is not None:
        return matrix
    if isinstance(document, list) and document and all(isinstance(row, dict) for row in document):
        document = {"links": document}
    found = [key for key in _LINKS if isinstance(document, dict) and isinstance(document.get(key), list)]
    if len(found) != 1:
        raise FormatError(f"{name}: is JSON, not a graph; {_FORM}")
    links, nodes = document[found[0]], document.get("nodes", [])
    if not isinstance(nodes, list) or not all(isinstance(one, dict) for one in links):
        raise FormatError(f"{name}: nodes or {found[0]} of the JSON are no lists of objects; {_FORM}")
    undirected = _undirected(document, name)
    told = [one.get(end) for one in links for end in ("source", "target")]
    labels, number = _nodes(nodes, [end for end in told if isinstance(end, str)], name)
    ends = []
    for k, one in enumerate(links, 1):
        source, target = (_end(one, end, k, labels, number, bool(nodes), name) for end in ("source", "target"))
        ends.append((source, target))
    data_of_links = [
        [(key, value) for key, value in one.items() if key not in ("source", "target", "key")] for one in links
    ]
    rows = attribute_rows(labels, ends, data_of_links, name, how)
    rows.undirected = undirected
    rows.where = lambda row: f"{found[0]}[{row}]"
    return rows


def _undirected(document: dict[str, Any], name: str) -> str:
    """Return what says that links have no direction, of the whole or beside what else is told of the graph, or ""."""
    beside = document.get("graph")
    for told in (document, beside if isinstance(beside, dict) else {}):
        for key, usual in (("directed", True), ("undirected", False)):
            if key not in told:
                continue
            if told[key] not in (True, False):
                raise FormatError(f"{name}: {key} is neither true nor false; write one")
            return "" if told[key] == usual else f'"{key}": {json.dumps(told[key])}'
    return ""


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a key occurs twice in an object")
    return dict(pairs)


def _nodes(nodes: list[Any], ends: list[str], name: str) -> tuple[list[str], dict[str, int]]:
    """Return the labels of the nodes, and their positions by what links call them."""
    if not all(isinstance(one, dict) for one in nodes):
        identifiers = [str(one) for one in nodes]
        attributes: list[dict[str, Any]] = [{} for _ in nodes]
    elif all(one.get("id") is not None for one in nodes):
        identifiers, attributes = [str(one["id"]) for one in nodes], nodes
    elif any(one.get("id") is not None for one in nodes):
        raise FormatError(f"{name}: some nodes have an id and others have none; give each its own id")
    elif not all(isinstance(end, _Integer) for end in ends):
        return _named(nodes, ends, name)
    else:
        _refuse_names(nodes, ends, name)
        identifiers, attributes = [str(k) for k in range(len(nodes))], nodes
    number = {one: k for k, one in enumerate(identifiers)}
    if len(number) < len(nodes):
        raise FormatError(f"{name}: two nodes have the same id; rename one")
    return names_or_identifiers(identifiers, attributes), number


def _refuse_names(nodes: list[dict[str, Any]], ends: list[str], name: str) -> None:
    """Refuse integers at the ends of links that are names of nodes without an id, and positions of others."""
    for title in _NAMES:
        names = [lower_case(one).get(title) for one in nodes]
        integers, called = all(isinstance(one, _Integer) for one in names), {*ends}
        if integers and called <= {*names} and any(str(k) in called and str(k) != one for k, one in enumerate(names)):
            what = f"links call nodes by integers that are positions, or {title}s?"
            raise FormatError(f"{name}: {what} Give each node its own id, and name the ends of links by these")


def _named(nodes: list[dict[str, Any]], ends: list[str], name: str) -> tuple[list[str], dict[str, int]]:
    """Return the labels of nodes without an id that links call by name, and their positions by these."""
    found = list[list[str]]()
    for title in _NAMES:
        names = [text_of(one, title) for one in nodes]
        if all(names) and len(set(names)) == len(names) and set(names) >= set(ends):
            found += [names] if names not in found else []
    if len(found) != 1 or any(isinstance(end, _Integer) for end in ends):
        mend = "give each node its own id, and name the ends of links by these"
        raise FormatError(f"{name}: links call nodes by texts that are not the names of the nodes throughout; {mend}")
    return found[0], {one: k for k, one in enumerate(found[0])}


def _end(
    link: dict[str, Any], end: str, k: int, labels: list[str], number: dict[str, int], declared: bool, name: str
) -> int:
    """Return the position of an end of a link; where no nodes are declared, links declare them."""
    label = link.get(end)
    if not isinstance(label, str) or not label:
        raise FormatError(f"{name}: link {k} has no {end} that is a text or a number; {_FORM}")
    if label not in number:
        if declared:
            raise FormatError(f"{name}: {end} {shorten(label)} of link {k} is no node; declare it")
        number[label] = len(labels)
        labels.append(label)
    return number[label]
