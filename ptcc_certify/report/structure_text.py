"""What the screens and pages say of a graph and its structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath

from ptcc_certify.graphs.io.table_columns import BY_HEADER, IGNORED
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.report.text_layout import TEXT, columns, counted, printable, shorten_label, shorten_list, shorten_text

ORIENTATION = {
    "information": "a row a,b: information flows a -> b, b listens",
    "listens": "a row a,b: a listens to b",
    "matrix": "row = listener",
}

SHORT_ORIENTATION = ORIENTATION | {
    "information": "row a,b: information flows a -> b",
    "listens": "row a,b: a listens to b",
}
_BY_HEADER = {"information": "information flows source -> target", "listens": "source listens to target"}
#: Remarks for the long screen alone: "(0 negative)" tells the one, and the other is about pairs of edges.
_LONG_REMARKS = _POSITIVE, _ASYMMETRIC = "all weights positive", "sign-asymmetric"

#: The head of a line, and its text; a line without a head belongs to the one before.
Lines = Iterator[tuple[str, str]]


def graph_entries(structure: Structure, name: str) -> list[tuple[str, str]]:
    """Return the first two lines of every short screen: which graph, and how its rows were read."""
    return [("graph", _graph_text(structure, name)), *_reading_entries(structure)]


def _graph_text(structure: Structure, name: str) -> str:
    """Tell the size and the connectivity of a graph, its name as long as fits beside them."""
    graph, negative = structure.graph, int((structure.graph.sign < 0).sum())
    size = f"{counted(graph.n_nodes, 'node')}, {counted(graph.n_edges, 'edge')} ({negative:,} negative)"
    rest = f": {size}, {_connectivity(structure)}"
    if len(rest) + columns(name) > TEXT:
        rest, name = rest.replace("ly connected", "").replace("disconnected, ", ""), PurePath(name).name
    if len(rest) + min(columns(name), 8) > TEXT:  # the claims tell how many components there are
        rest = rest.rpartition(", ")[0]
    return shorten_text(printable(name), max(TEXT - len(rest), 8)) + rest


def _connectivity(structure: Structure) -> str:
    words = {"strong": "strongly connected", "quasi-strong": "quasi-strongly connected", "weak": "weakly connected"}
    return words.get(structure.connectivity, f"disconnected, {len(structure.components):,} components")


def _reading_entries(structure: Structure) -> list[tuple[str, str]]:
    """Tell how the rows were read: in full what makes another graph of them, and what else as far as it fits."""
    text = SHORT_ORIENTATION[structure.graph.read["orientation"]]
    remarks = [remark for remark in remarks_on(structure) if remark not in _LONG_REMARKS]
    if BY_HEADER in remarks:
        remarks.remove(BY_HEADER)
        text = f"{BY_HEADER}: {_BY_HEADER[structure.graph.read['orientation']]}"
    ignored = [shorten_text(remark, TEXT) for remark in remarks if remark.startswith(IGNORED)]
    lines = [text]
    for remark in [*(remark for remark in remarks if not remark.startswith(IGNORED)), *ignored]:
        if columns(f"{lines[-1]}; {remark}") <= TEXT:
            lines[-1] += f"; {remark}"
        else:
            lines.append(remark)
    return [("" if number else "read", line) for number, line in enumerate(lines)]


def leader_lines(structure: Structure, most: int, width: int = 40) -> Lines:
    """Tell of the groups of leaders; of many, the largest that are more than single leaders."""
    closed, labels = structure.closed_components, structure.graph.labels
    largest = sorted(enumerate(closed, start=1), key=lambda item: -len(item[1].nodes))[:most]
    many = len(closed) > most
    told = [(number, component) for number, component in sorted(largest) if not many or len(component.nodes) > 1]
    if many:
        single, balanced = sum(len(c.nodes) == 1 for c in closed), sum(c.balanced for c in closed)
        larger, size = len(closed) - single, len(largest[0][1].nodes)
        whole = [f"{single:,} of one node, {larger:,} larger, up to {size:,}", f"{larger:,} of 2 to {size:,} nodes"]
        these = ", such as" * (larger > len(told))
        texts = [f"{whole[0]}{these}", *whole] if larger else ["all of one node"]
        groups = f"{len(closed):,} groups, {balanced:,} balanced"
        yield "leaders", next((f"{groups}; {text}" for text in texts if columns(groups + text) + 2 <= TEXT), groups)
    for number, component in told:
        text = leaders_text(component, labels, width)
        head = "leaders" if len(closed) == 1 else f"leaders {number}"
        yield ("", f"group {number}: {text}") if many else (head, text)


def leaders_text(component: ClosedComponent, labels: Sequence[str], width: int = 40) -> str:
    """Tell how a group of leaders splits, or why it does not."""
    nodes = [labels[v] for v in component.nodes]
    if component.negative_cycle is not None:
        steps = ", ".join(
            f"{shorten_label(labels[s])}->{shorten_label(labels[t])}" for s, t in component.negative_cycle[:12]
        )
        more = ", ..." if len(component.negative_cycle) > 12 else ""
        return f"{shorten_list(nodes, 2 * width)}: unbalanced, negative cycle {steps}{more}"
    sides = camps(component)
    text = " against ".join("{" + shorten_list([labels[v] for v in camp], width) + "}" for camp in sides)
    return f"balanced, {'camps ' if len(sides) > 1 else 'one camp '}{text}"


def camps(component: ClosedComponent) -> list[list[int]]:
    """Return the camps of a balanced leader group, the one of its first node first."""
    gauge = component.gauge or ()
    both = ([v for v, g in zip(component.nodes, gauge, strict=True) if g == sign] for sign in (1, -1))
    return [camp for camp in both if camp]


def structure_text(structure: Structure) -> str:
    """Return connectivity, closed components, leaders and followers, and balance in one line."""
    closed = structure.closed_components
    groups = f"{counted(len(closed), 'closed component')} ({sum(c.balanced for c in closed):,} balanced)"
    followers = f"{counted(structure.leaders.size, 'leader')}, {counted(structure.followers.size, 'follower')}"
    whole = f"whole graph {'balanced' if structure.balanced else 'unbalanced'}"
    return f"{_connectivity(structure)}; {groups}; {followers}; {whole}"


def remarks_on(structure: Structure) -> list[str]:
    """Return what is particular about a graph and about how it was read."""
    read, some = structure.graph.read, structure.graph.n_edges > 0
    remarks = (
        (structure.undirected and some, "undirected"),
        (structure.all_positive and some, _POSITIVE),
        (not structure.sign_symmetric, _ASYMMETRIC),
        (not some, "no edges, is this the right file?"),
        (read["duplicates"] != "refused", f"duplicates {read['duplicates']}"),
        (read["self_loops"] != "refused", f"self-loops {read['self_loops']}"),
        ("zeros" in read, f"weights 0 {read.get('zeros')}"),
        (read["undirected"], "each row goes both ways"),
        ("variable" in read, f"variable {shorten_label(str(read.get('variable')))}"),
    )
    return [*(text for holds, text in remarks if holds), *read["notes"]]
