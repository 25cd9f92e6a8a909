"""Facts of a graph or a family: its size, how it was read, its structure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.io.columns_beside import IGNORED
from ptcc_certify.graphs.structure import ClosedComponent, Structure, analyse
from ptcc_certify.graphs.stubborn import prejudices, stubbornness
from ptcc_certify.report.facts.claim import family_claims, structure_claims
from ptcc_certify.report.text_layout import (
    TEXT,
    agent_text,
    columns,
    printable,
    short_number,
    shorten_list,
    shorten_text,
)
from ptcc_certify.theorems.family_behaviour import FamilyComponent, mode_name

if TYPE_CHECKING:
    from ptcc_certify.gain_design.answer import AgentsDesign, Design
    from ptcc_certify.graphs.digraph import SignedDigraph

ORIENTATION = {
    "information": "row a,b: information flows a -> b",
    "listens": "row a,b: a listens to b",
    "matrix": "row = listener",
}
_BY_HEADER = {"information": "information flows source -> target", "listens": "source listens to target"}
#: Remarks on the structure: "(0 negative)" tells the one, and the other is about pairs of edges.
_OF_STRUCTURE = _POSITIVE, _ASYMMETRIC = "all weights positive", "sign-asymmetric"
#: Columns of a list of nodes on the long screen: twelve lines.
_LONG_LIST = 12 * TEXT
#: Leader groups that are told one by one.
_GROUPS = 3


def graph_facts(structure: Structure, name: str, details: bool = True) -> Facts:
    """Tell which graph, how its rows were read, and its structure."""
    brief = _graph_text(structure, name)
    yield Fact(
        head="graph",
        value=structure.graph.n_nodes,
        note=f"{labelled(printable(name))}{_size(structure)}",
        brief=(brief,),
    )
    yield from _reading_facts(structure)
    yield from _stubborn_facts(structure.graph)
    if not details:
        return
    yield Fact(head="nodes", note=shorten_list([labelled(label) for label in structure.graph.labels]), detail=True)
    more = [remark for remark in remarks_on(structure) if remark in _OF_STRUCTURE]
    yield Fact(head="structure", note="; ".join([structure_text(structure), *more]), detail=True)


def family_facts(family: Family, name: str, read: str, components: Sequence[FamilyComponent] | None) -> Facts:
    """Tell the size of a family, how it was read, and of every mode its edges and the structure of its mandatory graph.

    ``components`` are those of its decision, which hold structures; without them no details are told.
    """
    head = "family" if family.graph is None else "graph"  # which has something proved as a family of one mode
    yield Fact(head=head, value=family.n_nodes, note=family_text(family, name))
    if any(map(_tells_columns, family.notes)):
        for way, text in _BY_HEADER.items():
            read = read.replace(ORIENTATION[way], text)
    if read or family.notes:
        yield Fact(head="read", note="; ".join(filter(None, (read, *family.notes))))
    yield from _stubborn_facts(family)
    if components is None:
        return
    yield Fact(head="nodes", note=shorten_list([labelled(label) for label in family.labels]), detail=True)
    for number, mode in enumerate(family.modes):
        known = len(components) == 1
        structure = components[0].structures[number] if known else analyse(mode.mandatory)
        size = f"{counted(mode.n_edges, 'edge')} ({int((mode.sign < 0).sum()):,} negative)"
        size += "; undirected" if mode.tied else ""
        text = f"{labelled(mode_name(family, number))}: {size}; mandatory edges: {structure_text(structure)}"
        yield Fact(head="mode", note=text, detail=True)
        if edges := _uncertain_edges(mode):
            yield Fact(head="mode", note=f"uncertain: {edges}", detail=True)


def _tells_columns(note: str) -> bool:
    """Tell whether a note, perhaps of a mode, tells which columns are source and target."""
    return re.search(rf"(^|: )columns (?!{IGNORED.removeprefix('columns ')})", note) is not None


def leader_facts(structure: Structure) -> Facts:
    """Tell the leader groups and the followers of a graph."""
    for (head, text), (_, short) in zip(_leaders(structure, _LONG_LIST), _leaders(structure, 20), strict=True):
        brief = short if columns(short) <= TEXT else shorten_text(short.partition(", negative cycle")[0], TEXT)
        yield Fact(head=head, note=text, brief=(brief,))
    if followers := [labelled(structure.graph.labels[v]) for v in structure.followers.tolist()]:
        brief = shorten_list(followers, TEXT)
        yield Fact(head="followers", note=shorten_list(followers, _LONG_LIST), brief=(brief,))
        yield from _camps_of_all(structure)


def family_text(family: Family, name: str) -> str:
    """Tell the size of a family, its modes by name, and what is uncertain.

    Examples
    --------
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(family_text(Family.from_intervals([("a", "b", 0, 1)]), "pair"))
    'pair: 2 nodes, 1 edge, 1 optional'
    """
    several = len(family.modes) > 1
    edges = sum(mode.n_edges for mode in family.modes)
    uncertain = sum(int((~mode.known).sum()) for mode in family.modes)
    optional = sum(int(mode.optional.sum()) for mode in family.modes)
    rest = f"{_nodes_text(family)}, {counted(edges, 'edge')}"
    rest += f", {uncertain:,} uncertain" if uncertain > optional else ""
    if optional:
        rest += f", {optional:,}{' of them' if uncertain > optional else ''} optional"
    if not (several or name):
        return rest
    if not several:
        return f"{labelled(shorten_text(printable(name), max(TEXT - len(rest) - 2, 8)))}: {rest}"
    names = [labelled(printable(mode_name(family, k))) for k in range(len(family.modes))]
    rest = f"{counted(len(names), 'mode')} on {rest}"
    return f"{shorten_list(names, max(TEXT - len(rest) - 2, 30))}: {rest}"


def _uncertain_edges(mode: Mode) -> str:
    listed = []
    for edge in np.flatnonzero(~mode.known)[:12].tolist():
        ends = [agent_text(mode.labels[int(side[edge])]) for side in (mode.source, mode.target)]
        least, largest = (short_number(end) for end in mode.edge_interval(edge))
        listed.append(f"{ends[0]} -> {ends[1]} in [{least}, {largest}]")
    return shorten_list(listed, 4 * TEXT, int((~mode.known).sum()))


def _size(structure: Structure) -> str:
    graph, negative = structure.graph, int((structure.graph.sign < 0).sum())
    size = f"{_nodes_text(graph)}, {counted(graph.n_edges, 'edge')} ({negative:,} negative)"
    return f": {size}, {_connectivity(structure)}"


def _nodes_text(given: SignedDigraph | Family) -> str:
    """Tell how many nodes there are; agents and prejudices apart where some are stubborn."""
    if not (added := len(prejudices(given))):
        return counted(given.n_nodes, "node")
    return f"{counted(given.n_nodes - added, 'agent')} and {counted(added, 'prejudice')}"


def _stubborn_facts(given: SignedDigraph | Family) -> Facts:
    """Tell which agents are stubborn, and how much."""
    if not (weights := stubbornness(given)):
        return
    names, what = [labelled(agent_text(label)) for label in weights], "; weights of prejudices, added nodes"
    sizes = [
        f"{short_number(low)}{f' to {short_number(high)}' if low < high else ''}" for low, high in weights.values()
    ]
    if len(names) > 1 and len({*sizes}) == 1:
        what = f" {sizes[0]} each{what}"
    else:
        names = [f"{name} {size}" for name, size in zip(names, sizes, strict=True)]
    brief = shorten_list(names, TEXT - len(what)) + what
    yield Fact(head="stubborn", value=list(weights), note=shorten_list(names, _LONG_LIST) + what, brief=(brief,))


def _graph_text(structure: Structure, name: str) -> str:
    """Tell the size and the connectivity of a graph, its name as long as fits beside them."""
    rest = _size(structure)
    if len(rest) + columns(name) > TEXT:
        rest = rest.replace("disconnected, ", "")
        name = PurePath(name).name
    if len(rest) + min(columns(name), 8) > TEXT:  # the claims tell how many components there are
        rest = rest.rpartition(", ")[0]
    return labelled(shorten_text(printable(name), max(TEXT - len(rest), 8))) + rest


def _connectivity(structure: Structure) -> str:
    words = {"strong": "strongly connected", "quasi-strong": "quasi-strongly connected", "weak": "weakly connected"}
    return words.get(structure.connectivity, f"disconnected, {len(structure.components):,} components")


def _reading_facts(structure: Structure) -> Facts:
    """Tell how the rows were read: in full what makes another graph of them, and what else as far as it fits."""
    text = ORIENTATION[structure.graph.read["orientation"]]
    remarks = [remark for remark in remarks_on(structure) if remark not in _OF_STRUCTURE]
    if told := next(filter(_tells_columns, remarks), ""):
        remarks.remove(told)
        text = f"{told}: {_BY_HEADER[structure.graph.read['orientation']]}"
    ignored = [shorten_text(remark, TEXT) for remark in remarks if remark.startswith(IGNORED)]
    lines = [text]
    for remark in [*(remark for remark in remarks if not remark.startswith(IGNORED)), *ignored]:
        if columns(f"{lines[-1]}; {remark}") <= TEXT:
            lines[-1] += f"; {remark}"
        else:
            lines.append(remark)
    yield from (Fact(head="read", note=line) for line in lines)


def _leaders(structure: Structure, width: int) -> Iterator[tuple[str, str]]:
    """Tell of the groups of leaders; of many, the largest that are more than single leaders."""
    closed, labels = structure.closed_components, structure.graph.labels
    largest = sorted(enumerate(closed, start=1), key=lambda item: -len(item[1].nodes))[:_GROUPS]
    many = len(closed) > _GROUPS
    told = [(number, component) for number, component in sorted(largest) if not many or len(component.nodes) > 1]
    if many:
        single, balanced = sum(len(c.nodes) == 1 for c in closed), sum(c.balanced for c in closed)
        larger, size = len(closed) - single, len(largest[0][1].nodes)
        whole = [f"{single:,} of one node, {larger:,} larger, up to {size:,}", f"{larger:,} of 2 to {size:,} nodes"]
        these = ", such as" if larger > len(told) else ""
        texts = [f"{whole[0]}{these}", *whole] if larger else ["all of one node"]
        groups = f"{len(closed):,} groups, {balanced:,} balanced"
        yield "leaders", next((f"{groups}; {text}" for text in texts if columns(groups + text) + 2 <= TEXT), groups)
    for number, component in told:
        text = leaders_text(component, labels, width)
        head = "leaders" if len(closed) == 1 else f"leaders {number}"
        yield ("leaders", f"group {number}: {text}") if many else (head, text)


def leaders_text(component: ClosedComponent, labels: Sequence[str], width: int = 40) -> str:
    """Tell how a group of leaders splits, or why it does not."""
    nodes = [labelled(labels[v]) for v in component.nodes]
    if component.negative_cycle is not None:
        steps = ", ".join(f"{agent_text(labels[s])}->{agent_text(labels[t])}" for s, t in component.negative_cycle[:12])
        more = ", ..." if len(component.negative_cycle) > 12 else ""
        return f"{shorten_list(nodes, 2 * width)}: unbalanced, negative cycle {steps}{more}"
    sides = camps(component)
    return f"balanced, {'camps ' if len(sides) > 1 else 'one camp '}{against(sides, labels, width)}"


def camps(component: ClosedComponent) -> list[list[int]]:
    """Return the camps of a balanced leader group, the one of its first node first."""
    return sides_of(component.nodes, component.gauge or ())


def sides_of(nodes: Sequence[int], gauge: Sequence[int]) -> list[list[int]]:
    """Split nodes by their signs, those that have +1 first.

    Examples
    --------
    >>> sides_of([4, 5, 6], [1, -1, 1])
    [[4, 6], [5]]
    """
    both = ([v for v, g in zip(nodes, gauge, strict=True) if g == sign] for sign in (1, -1))
    return [camp for camp in both if camp]


def _camps_of_all(structure: Structure) -> Facts:
    """Tell the two camps of a connected graph that is balanced as a whole, followers among them."""
    if structure.gauge is None or len(structure.components) > 1:
        return
    sides = sides_of(range(structure.graph.n_nodes), structure.gauge.tolist())
    if len(sides) > 1:
        long, short = (against(sides, structure.graph.labels, width) for width in (_LONG_LIST, TEXT // 2 - 6))
        yield Fact(head="camps", note=f"of all {long}", brief=(f"of all {short}",))


def against(sides: Sequence[Sequence[int]], labels: Sequence[str], width: int) -> str:
    """Write camps against each other.

    Examples
    --------
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(against([[0], [1, 2]], "abc", 40))
    '{a} against {b, c}'
    """
    return " against ".join("{" + shorten_list([labelled(labels[v]) for v in camp], width) + "}" for camp in sides)


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
        ("variable" in read, f"variable {agent_text(str(read.get('variable')))}"),
    )
    return [*(text for holds, text in remarks if holds), *read["notes"]]


def structure_facts(structure: Structure, name: str, more: Iterable[Fact] = ()) -> list[Fact]:
    """Return what is told of a graph alone: its structure, more of it, and what follows from it."""
    claims = structure_claims(structure, [component.claim for component in structure.components])
    return [*graph_facts(structure, name), *leader_facts(structure), *more, *claims]


def decision_facts(
    components: Sequence[FamilyComponent], family: Family, name: str, read: str = "", details: bool = True
) -> list[Fact]:
    r"""Return what is told of a family alone: what it does, decided on edges.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", -1, 0), ("b", "a", 1, 2)])
    >>> for fact in decision_facts(ptcc.decide(unsure), unsure, "pair"):
    ...     if not fact.detail:
    ...         print(f"{fact.head}: {fact.text}")
    family: pair: 2 nodes, 2 edges, 2 uncertain, 1 of them optional
    claim: depends on the signal
    why: the state a=1, b=1 rests at the least weights and moves with a -> b on
    constant: where weights never change: it depends on the weights
    groups: no limit is claimed of a, b
    """
    return [*family_facts(family, name, read, components if details else None), *family_claims(components)]


def design_facts(answer: Design | AgentsDesign, graph: SignedDigraph | None = None, name: str = "") -> list[Fact]:
    """Return what is told of a design, and of its graph: request, verdict, gains, what is proved, deadlines."""
    of_graph: Any = () if graph is None else graph_facts(analyse(graph), name)
    return [*of_graph, *answer.facts()]
