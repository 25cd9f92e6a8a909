"""GraphML and GML, read by networkx, and GEXF.

networkx forgives much: what it would merge, drop or take for something else is refused here, before or after.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.attributes import Pairs, attribute_rows, both_ways, lower_case, names_or_identifiers
from ptcc_certify.graphs.io.files import decoded, lines_of, one_line_errors
from ptcc_certify.graphs.io.raw_edges import TIMES, Rows
from ptcc_certify.graphs.io.text_matrices import is_entry
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading

#: Times of edges in GEXF, and what else elements of edges say of them in GEXF and GraphML.
_TIMES = {"start", "end", "startopen", "endopen", "timestamp", "timestamps", "interval", "intervals"}
_OF_ELEMENTS = {"id", "source", "target", "type", "directed", "sourceport", "targetport", *_TIMES}
_TOKENS_OF_GML = re.compile(r'"[^"]*"|#.*|(?<![\w.])[+-]?\.?\d[^\s"#\[\]]*')
_NUMBER_OF_GML = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))([eE][+-]?\d+)?")


def _rows(
    graph: Any, labels: list[str], data: Sequence[Pairs], undirected: str, name: str, how: Reading, rest: Pairs = ()
) -> Rows:
    """Turn a networkx multigraph, and what its edges hold, into rows."""
    number = {node: i for i, node in enumerate(graph)}
    ends = [(number[u], number[v]) for u, v in graph.edges()]
    rows = attribute_rows(labels, ends, data, name, how, rest)
    rows.undirected = "" if graph.is_directed() else undirected
    rows.in_order = False
    return rows


def _float(text: str) -> str:
    """Return the shortest decimal that names the float of a text; the text itself where that is 0."""
    return str(number) if (number := float(text)) else text


def _markup(data: bytes, name: str) -> str:
    text = decoded(data, name)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FormatError(f"{name}: a DOCTYPE declaration, which may define entities; remove it")
    return text


def read_graphml(data: bytes, name: str, how: Reading) -> Rows:
    """Read GraphML of one flat graph; nodes are called by their names where identifiers only number them."""
    import networkx as nx

    text = _markup(data, name)
    with one_line_errors(name, "GraphML"):
        root, elements = ElementTree.fromstring(text), defaultdict(list)
        for element in root.iter():
            elements[_tag(element)].append(element)
        # networkx reads the first of several graphs, skips nested ones, takes any edgedefault but "directed" for
        # "undirected", merges edges of one id, knows no 0 and 1, and declares nodes that are not.
        if len(elements["graph"]) > 1:
            raise FormatError(f"{name}: a second or nested graph in the GraphML; keep one")
        kind = elements["graph"][0].get("edgedefault") if elements["graph"] else "directed"
        if kind not in ("directed", "undirected"):
            what = "the graph has no edgedefault" if kind is None else f'edgedefault="{shorten(kind)}"'
            raise FormatError(f'{name}: {what}; write edgedefault="directed", or "undirected"')
        for k, edge in enumerate(elements["edge"]):
            edge.set("id", str(k))
            told = edge.attrib.pop("directed", kind).strip()
            if {"0": "undirected", "false": "undirected", "1": "directed", "true": "directed"}.get(told, told) != kind:
                ends = " -> ".join(shorten(edge.get(end, "")) for end in ("source", "target"))
                what = f'edge {ends} has directed="{shorten(told)}", and the graph edgedefault="{kind}"'
                raise FormatError(f"{name}: {what}; write all as directed, one without direction as two")
        graph = nx.parse_graphml(ElementTree.tostring(root, "unicode"), edge_key_type=str, force_multigraph=True)
        declared = Counter(node.get("id", "") for node in elements["node"])
        for node in {**declared, **dict.fromkeys(graph)}:
            if declared[node] != 1:
                raise FormatError(f"{name}: node {shorten(node)} is declared {declared[node]} times; declare it once")
        if len(elements["edge"]) != graph.number_of_edges():
            raise FormatError(f"{name}: an edge that is not in the graph itself; move it there")
        keys = {key.get("id"): key for key in elements["key"]}
        values = [
            _of_graphml(elements["edge"][int(k)], more, keys) for *_, k, more in graph.edges(keys=True, data=True)
        ]
        of_edges = [key for key in keys.values() if key.get("for") == "edge"]
        rest = [_value(key, one) for key in of_edges for one in key if _tag(one) == "default"]
        labels = names_or_identifiers([*graph], [more for _, more in graph.nodes(data=True)])
        return _rows(graph, labels, values, 'edgedefault="undirected"', name, how, rest)


def _tag(element: ElementTree.Element) -> str:
    """Return the tag without its namespace."""
    return element.tag.rpartition("}")[2]


def _own(edge: ElementTree.Element) -> list[tuple[str, str]]:
    """Return the attributes of the element of an edge that say nothing of its ends, its direction and its times."""
    return [(title, value) for title, value in edge.items() if title not in _OF_ELEMENTS and value]


def _value(key: ElementTree.Element, element: ElementTree.Element) -> tuple[str, str]:
    """Return the title and the text of a value under a key."""
    text = element.text or ""
    return key.get("attr.name", ""), _float(text) if text and key.get("attr.type") in ("float", "double") else text


def _of_graphml(edge: ElementTree.Element, more: dict[str, Any], keys: dict[str | None, ElementTree.Element]) -> Pairs:
    """Return what an edge holds, values under one title too, which networkx merges to ``more``."""
    pairs = [_value(keys[one.get("key")], one) for one in edge if _tag(one) == "data" and not len(one)] + _own(edge)
    titles = {title for title, _ in pairs} | {""}
    return [*filter(all, pairs), *((title, value) for title, value in more.items() if title not in titles)]


def read_gml(data: bytes, name: str, how: Reading) -> Rows:
    """Read GML; labels are texts or integers, or else the names or the identifiers of the nodes."""
    import networkx as nx

    text = _numbers_of_gml("\n".join(lines_of(data, name)), name)
    with one_line_errors(name, "GML"):
        # As a multigraph, so that repeated edges come here and meet the same rule as all others.
        graph = nx.parse_gml(re.sub(r"\bgraph\s*\[", "graph [ multigraph 1 ", text, count=1).split("\n"), label=None)
        if odd := {key for key in graph.graph if key.lower() in ("directed", "edge", "node")}:
            raise FormatError(f"{name}: {odd.pop()} is not a key of GML; write it in lower case")
        # networkx takes any value but 0 for 1, the text "0" too.
        bare = re.sub(r'"[^"]*"|#.*', '""', text)
        if graph.is_directed() and set(re.findall(r"\bdirected\s+([^\s\]]+)", bare)) != {"1"}:
            raise FormatError(f"{name}: directed is neither 0 nor 1, or both; write directed 1")
        values = [
            [
                (key, one)
                for key, value in more.items()
                for one in (value if isinstance(value, list) and any(is_entry(str(v)) for v in value) else [value])
            ]
            for *_, more in graph.edges(data=True)
        ]
        nodes = [(str(node), lower_case(attributes)) for node, attributes in graph.nodes(data=True)]
        if not any("label" in attributes for _, attributes in nodes):
            labels = names_or_identifiers([node for node, _ in nodes], [attributes for _, attributes in nodes])
            return _rows(graph, labels, values, "directed 0", name, how)
        own = [attributes.get("label", node) for node, attributes in nodes]
        for label in own:
            if not isinstance(label, str | int) and label not in ((), []):  # the texts "()" and "[]" arrive as these
                raise FormatError(f"{name}: label {shorten(str(label))} is no text and no integer; write it in quotes")
        return _rows(graph, [str(label) for label in own], values, "directed 0", name, how)


def _numbers_of_gml(text: str, name: str) -> str:
    """Write numbers so that networkx takes them whole: of ``1e-05`` it makes 1 and a key ``e``, of ``1e-400`` 0."""

    def token(match: re.Match[str]) -> str:
        written = match[0]
        if written[0] in '"#':
            return written
        if not (number := _NUMBER_OF_GML.fullmatch(written)):
            place = f"{name}, line {text.count(chr(10), 0, match.start()) + 1}"
            raise FormatError(f'{place}: "{shorten(written)}" is no number; write it with a point, or in quotes')
        mantissa, exponent = number.groups()
        if exponent is None and "." not in mantissa:
            return written
        if not float(written) and mantissa.strip("+-0."):
            return f'"{written}"'
        return mantissa + (".0" if "." not in mantissa else "") + (exponent or "")

    return _TOKENS_OF_GML.sub(token, text)


def read_gexf(data: bytes, name: str, how: Reading) -> Rows:
    """Read GEXF of one flat graph: edges are undirected unless they, or the graph, say otherwise."""
    text = _markup(data, name)
    with one_line_errors(name, "GEXF"):
        root = ElementTree.fromstring(text)
        for element in root.iter():
            element.tag = _tag(element)
        graphs = root.findall("graph")
        if len(graphs) != 1:
            raise FormatError(f"{name}: {len(graphs)} graphs; keep one")
        declared = graphs[0].findall("attributes[@class='edge']/attribute")
        titles = {one.get("id", ""): one.get("title", "") for one in declared}
        rest = [
            (one.get("title", ""), one.findtext("default", "")) for one in declared if one.find("default") is not None
        ]
        nodes = [*graphs[0].iter("node")]
        identifiers = [node.get("id", "") for node in nodes]
        number = {node: i for i, node in enumerate(identifiers)}
        if len(number) < len(nodes):
            raise FormatError(f"{name}: two nodes have the same id; rename one")
        named = [node.get("label") or "" for node in nodes]
        labels = named if all(named) and len(set(named)) == len(named) else identifiers
        kind = graphs[0].get("defaultedgetype", "undirected")
        ends, attributes, undirected = [], [], []
        for edge in graphs[0].iter("edge"):
            for end in ("source", "target"):
                if edge.get(end) not in number:
                    raise FormatError(f"{name}: {end} {shorten(str(edge.get(end)))} of an edge is no node; declare it")
            ends.append((number[edge.get("source", "")], number[edge.get("target", "")]))
            of = [(one.get("for", one.get("id", "")), one.get("value", "")) for one in edge.iter("attvalue")]
            attributes.append([*_own(edge), *((titles.get(key, key), value) for key, value in of)])
            undirected.append(edge.get("type", kind) != "directed")
        rows = attribute_rows(labels, ends, attributes, name, how, rest)
        timed = any(_TIMES & {*one.keys()} for one in graphs[0].iter())
        rows.notes = (TIMES,) if timed or graphs[0].find(".//spells") is not None else ()
        kinds = {edge.get("type", kind) for edge in graphs[0].iter("edge")} - {"directed"}
        return both_ways(rows, undirected, f'edges of type "{shorten(" or ".join(sorted(kinds)))}"', how)
