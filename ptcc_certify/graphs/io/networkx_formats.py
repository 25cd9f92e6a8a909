"""GraphML, GML and Pajek, read by networkx.

networkx forgives much: what it would merge, drop or take for something else is refused here, before or after.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.digraph import OF_EDGES
from ptcc_certify.graphs.io.files import decoded, lines_of, one_line_errors
from ptcc_certify.graphs.io.graph_from_rows import Numbers, Rows
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.size_limits import MAX_NODES


def _rows(graph: Any, labels: list[str], undirected: str, name: str) -> Rows:
    """Turn a networkx multigraph into rows; ``str`` of a float is the shortest decimal that names it."""
    default = _lower_case(graph.graph.get("edge_default", {}))
    number, weights = {node: i for i, node in enumerate(graph)}, Numbers()
    first, second, codes = [], [], []
    for u, v, data in graph.edges(data=True):
        first.append(number[u])
        second.append(number[v])
        attributes = default | _lower_case(data)
        if more := OF_EDGES & attributes.keys():
            edge = f"{shorten(labels[first[-1]])} -> {shorten(labels[second[-1]])}"
            mend = "as a CSV file with columns source, target, weight_min, weight_max, optional it is read"
            raise FormatError(f'{name}: edge {edge} has the attribute "{min(more)}", which makes a family; {mend}')
        try:
            codes.append(weights[str(attributes.get("weight", attributes.get("sign", "")))])
        except KeyError:
            edge = f"{shorten(labels[first[-1]])} -> {shorten(labels[second[-1]])}"
            raise FormatError(f"{name}: edge {edge} has no weight; give it a number as weight or sign") from None
    undirected = "" if graph.is_directed() else undirected
    return Rows(labels, first, second, list(weights.texts), codes, lambda row: "", undirected, in_order=False)


def _lower_case(attributes: Mapping[str, Any]) -> dict[str, Any]:
    return {key.lower(): value for key, value in attributes.items()}


def read_graphml(data: bytes, name: str) -> Rows:
    """Read GraphML of one flat graph; the identifiers of the nodes are their labels."""
    import networkx as nx

    text = decoded(data, name)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FormatError(f"{name}: a DOCTYPE declaration, which may define entities; remove it")
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
        return _rows(graph, list(graph), 'edgedefault="undirected"', name)


def read_gml(data: bytes, name: str) -> Rows:
    """Read GML; labels are texts or integers, or else the identifiers of the nodes."""
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
        labels = [_lower_case(attributes).get("label", node) for node, attributes in graph.nodes(data=True)]
        for label in labels:
            if not isinstance(label, str | int) and label not in ((), []):  # the texts "()" and "[]" arrive as these
                raise FormatError(f"{name}: label {shorten(str(label))} is no text and no integer; write it in quotes")
        return _rows(graph, [str(label) for label in labels], "directed 0", name)


def read_pajek(data: bytes, name: str) -> Rows:
    """Read Pajek: ``*Vertices n``, rows ``number label`` where labels are not numbers, one list of arcs or edges."""
    import networkx as nx

    # networkx takes comments for nodes, a section that it does not know for rows of the one before, and leaves out
    # backslashes and apostrophes, as a shell does.
    lines = [line.strip() for line in lines_of(data, name)]
    lines = [line for line in lines if line and not line.lower().startswith(("%", "/*", "*network"))]
    heads = [i for i, line in enumerate(lines) if line.startswith("*")]
    sections = "\n".join(lines[i].lower() for i in heads)
    if not re.fullmatch(r"\*vertices\s+[0-9]{1,9}(\n\*(arcs|edges)([ \t].*)?)?", sections, re.ASCII) or heads[0] > 0:
        raise FormatError(f"{name}: not *Vertices n and then one list, of *Arcs or of *Edges; write it so")
    if re.search(r"[\\']", re.sub(r'"[^"\\]*"', "", "\n".join(lines))):
        raise FormatError(f"{name}: a backslash, or an apostrophe outside of quotes; put labels in double quotes")
    n, end = int(sections.split()[1]), heads[1] if len(heads) > 1 else len(lines)
    if n > MAX_NODES:
        raise FormatError(f"{name}: {n} nodes are more than {MAX_NODES}")
    declared = {row.split()[0]: row for row in lines[1:end]}
    numbers = {str(i): f"{i} {i}" for i in range(1, n + 1)}
    if len(declared) < end - 1 or not numbers.keys() >= declared.keys():
        raise FormatError(f"{name}: a node is declared twice, or is not one of 1 to {n}; mend the rows of *Vertices")
    for row in lines[end + 1 :]:
        if len(row.split()) < 2 or not numbers.keys() >= set(row.split()[:2]):
            raise FormatError(f'{name}: row "{shorten(row)}" does not name two of the nodes 1 to {n}; mend it')
    with one_line_errors(name, "Pajek"):
        edges = (" ".join(row.split()[:3]) for row in lines[end:])
        graph = nx.parse_pajek([lines[0], *(numbers | declared).values(), *edges])
        if len(graph) != n:
            raise FormatError(f"{name}: two nodes have the same label; rename one")
        return _rows(graph, list(graph), "*Edges", name)
