"""GraphML and GML, read by networkx, and GEXF.

networkx forgives much: what it would merge, drop or take for something else is refused here, before or after.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import Any
from xml.etree import ElementTree

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.attributes import attribute_rows, both_ways, lower_case, names_or_identifiers
from ptcc_certify.graphs.io.files import decoded, lines_of, one_line_errors
from ptcc_certify.graphs.io.raw_edges import TIMES, Rows
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading


def _rows(graph: Any, labels: list[str], undirected: str, name: str, how: Reading) -> Rows:
    """Turn a networkx multigraph into rows; ``str`` of a float is the shortest decimal that names it."""
    default = lower_case(graph.graph.get("edge_default", {}))
    number = {node: i for i, node in enumerate(graph)}
    ends = [(number[u], number[v]) for u, v in graph.edges()]
    data = [
        default | {key: str(value) for key, value in lower_case(more).items()} for *_, more in graph.edges(data=True)
    ]
    rows = attribute_rows(labels, ends, data, name, how)
    rows.undirected = "" if graph.is_directed() else undirected
    rows.in_order = False
    return rows


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
        graph = nx.parse_graphml(text, edge_key_type=str, force_multigraph=True)
        # networkx reads the first of several graphs, skips nested ones, merges what is declared twice, and declares
        # what is not.
        elements = [(element.tag.rpartition("}")[2], element) for element in ElementTree.fromstring(text).iter()]
        count = Counter(tag for tag, _ in elements)
        declared = Counter(element.get("id", "") for tag, element in elements if tag == "node")
        if count["graph"] != 1:
            raise FormatError(f"{name}: a second or nested graph; keep one")
        for node in {**declared, **dict.fromkeys(graph)}:
            if declared[node] != 1:
                raise FormatError(f"{name}: node {shorten(node)} is declared {declared[node]} times; declare it once")
        if count["edge"] != graph.number_of_edges():
            raise FormatError(f"{name}: two edges between the same nodes have the same id; rename one")
        labels = names_or_identifiers([*graph], [more for _, more in graph.nodes(data=True)])
        return _rows(graph, labels, 'edgedefault="undirected"', name, how)


def read_gml(data: bytes, name: str, how: Reading) -> Rows:
    """Read GML; labels are texts or integers, or else the names or the identifiers of the nodes."""
    import networkx as nx

    text = "\n".join(lines_of(data, name))
    with one_line_errors(name, "GML"):
        # As a multigraph, so that repeated edges come here and meet the same rule as all others.
        graph = nx.parse_gml(re.sub(r"\bgraph\s*\[", "graph [ multigraph 1 ", text, count=1).split("\n"), label=None)
        if odd := {key for key in graph.graph if key.lower() in ("directed", "edge", "node")}:
            raise FormatError(f"{name}: {odd.pop()} is not a key of GML; write it in lower case")
        # networkx takes any value but 0 for 1, the text "0" too.
        bare = re.sub(r'"[^"]*"|#.*', '""', text)
        if graph.is_directed() and set(re.findall(r"\bdirected\s+([^\s\]]+)", bare)) != {"1"}:
            raise FormatError(f"{name}: directed is neither 0 nor 1, or both; write directed 1")
        nodes = [(str(node), lower_case(attributes)) for node, attributes in graph.nodes(data=True)]
        if not any("label" in attributes for _, attributes in nodes):
            labels = names_or_identifiers([node for node, _ in nodes], [attributes for _, attributes in nodes])
            return _rows(graph, labels, "directed 0", name, how)
        own = [attributes.get("label", node) for node, attributes in nodes]
        for label in own:
            if not isinstance(label, str | int) and label not in ((), []):  # the texts "()" and "[]" arrive as these
                raise FormatError(f"{name}: label {shorten(str(label))} is no text and no integer; write it in quotes")
        return _rows(graph, [str(label) for label in own], "directed 0", name, how)


def read_gexf(data: bytes, name: str, how: Reading) -> Rows:
    """Read GEXF of one flat graph: edges are undirected unless they, or the graph, say otherwise."""
    text = _markup(data, name)
    with one_line_errors(name, "GEXF"):
        root = ElementTree.fromstring(text)
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
        graphs = root.findall("graph")
        if len(graphs) != 1:
            raise FormatError(f"{name}: {len(graphs)} graphs; keep one")
        titles, default = dict[str | None, str](), dict[str, str]()
        for attribute in graphs[0].findall("attributes[@class='edge']/attribute"):
            titles[attribute.get("id")] = title = attribute.get("title", "").lower()
            if (value := attribute.findtext("default")) is not None:
                default[title] = value
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
            values = {titles.get(one.get("for"), ""): one.get("value", "") for one in edge.iter("attvalue")}
            own = {"weight": edge.get("weight", "")} if "weight" in edge.keys() else {}  # noqa: SIM118
            attributes.append(default | values | own)
            undirected.append(edge.get("type", kind) != "directed")
        rows = attribute_rows(labels, ends, attributes, name, how)
        timed = any({"start", "end", "startopen", "endopen", "timestamp"} & {*one.keys()} for one in graphs[0].iter())
        rows.notes = (TIMES,) if timed or graphs[0].find(".//spells") is not None else ()
        return both_ways(rows, undirected, 'edges of type "undirected"', how)
