"""Facts of the distance from balance: bounds on the frustration index, the edges that spoil balance, the cycles."""

from __future__ import annotations

from fractions import Fraction

from lmi.exact.decimal_rounding import counted, down, near, up
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.graphs.frustration import FrustrationIndex
from ptcc_certify.report.facts.graph import against, sides_of
from ptcc_certify.report.text_layout import TEXT, agent_text, shorten_list

#: Columns of a list of edges on a short screen, and on a long one.
_SHORT, _LONG = 140, 12 * TEXT
#: How the spoiling edges and the cycles are joined where one edge is a pair, and where it is an arc.
_PAIR, _ARC = " - ", " -> "


def distance_fact(found: FrustrationIndex, detail: bool = False) -> Fact:
    """Tell the bounds on the frustration index.

    Examples
    --------
    >>> from ptcc_certify.graphs.frustration import frustration_index
    >>> from ptcc_certify.report.facts.balance import distance_fact
    >>> distance_fact(frustration_index([("a", "b", 1), ("b", "a", -2)])).text
    'frustration index 1 of 2 arcs (proved)'
    >>> distance_fact(frustration_index([("a", "b", 1), ("b", "a", 2)])).text
    'the graph is balanced: frustration index 0'
    """
    if not found.upper:
        return Fact(head="balance", value=(0, 0), note="the graph is balanced: frustration index 0", detail=detail)
    what = "pairs" if found.undirected else "arcs"
    of = f"{found.total} {what}" if found.by == "count" else f"{near(found.total)}, what all {what} weigh"
    size = near(found.upper) if found.exact else f"from {down(found.lower)} to {up(found.upper)}"
    more = "; HiGHS reports the larger number, not proved" if found.reported and not found.exact else ""
    note = f"frustration index {size} of {of} (proved{more})"
    return Fact(head="balance", value=(found.lower, found.upper), note=note, detail=detail)


def balance_facts(found: FrustrationIndex, group: bool = False) -> Facts:
    r"""Tell the bounds on the frustration index, and the witnesses of both; of a group of leaders, who they are.

    Examples
    --------
    >>> from ptcc_certify.graphs.frustration import frustration_index
    >>> from ptcc_certify.report.facts.balance import balance_facts
    >>> found = frustration_index([("a", "b", 1), ("b", "a", -2)])
    >>> print(*(fact.text for fact in balance_facts(found)), sep="\n")
    frustration index 1 of 2 arcs (proved)
    1 edge: b -> a
    {a, b} without it
    1 negative cycle, such as a - b - a; no edge is in two
    """
    if group:
        nodes = [labelled(label) for label in found.graph.labels]
        yield Fact(head="leaders", note=shorten_list(nodes, _LONG), brief=(shorten_list(nodes, TEXT),))
    yield distance_fact(found)
    if not found.upper:
        return
    graph, names = found.graph, [agent_text(label) for label in found.graph.labels]
    joint, noun = (_PAIR, "pair") if found.undirected else (_ARC, "edge")
    ends = [(int(graph.source[edge]), int(graph.target[edge])) for edge in found.edges]
    spoiling = [f"{names[s]}{joint}{names[t]}" for s, t in ends if s < t or not found.undirected]
    size = counted(len(spoiling), noun)
    yield Fact(
        head="spoiled by",
        value=ends,
        note=f"{size}: {shorten_list(spoiling, _LONG)}",
        brief=(f"{size}: {shorten_list(spoiling, _SHORT)}",),
    )
    sides = sides_of(range(graph.n_nodes), found.camps.tolist())
    without = f"without {'it' if len(spoiling) == 1 else 'them'}"
    long, short = (f"{against(sides, graph.labels, width)} {without}" for width in (_LONG, TEXT // 2 - 12))
    yield Fact(head="camps", note=long, brief=(short,))
    if found.cycles:
        shortest = min(found.cycles, key=lambda cycle: len(cycle.nodes)).nodes
        such = shorten_list([_PAIR.join(names[node] for node in (*shortest, shortest[0]))], 3 * TEXT)
        total = sum((cycle.share for cycle in found.cycles), Fraction(0))
        of_shares = f"their shares sum to {down(total)}, at no edge to more than it "
        shares = f"{of_shares}{'counts' if found.by == 'count' else 'weighs'}"
        if found.by == "count" and all(cycle.share == 1 for cycle in found.cycles):
            shares = f"no {noun} is in two"
        yield Fact(head="cycles", note=f"{counted(len(found.cycles), 'negative cycle')}, such as {such}; {shares}")
