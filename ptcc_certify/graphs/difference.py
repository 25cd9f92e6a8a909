"""In what two signed digraphs differ: direction, signs, rounded weights, edges, nodes; one line that says which."""

from __future__ import annotations

from fractions import Fraction

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.rationals import nearest_float, shorten

#: Relative difference of weights up to which they are called rounded.
ROUNDED = Fraction(1, 100)

Edges = dict[tuple[str, str], Fraction]


def difference(one: SignedDigraph, other: SignedDigraph) -> str | None:
    """Tell in what a graph differs from another, the likeliest cause first; None if they are equal.

    Parameters
    ----------
    one : SignedDigraph
        The graph that is meant, of a certificate.
    other : SignedDigraph
        The one at hand.

    Returns
    -------
    str or None
        One line.

    Examples
    --------
    >>> told = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2)])
    >>> difference(told, SignedDigraph.from_edges([("b", "a", 1), ("c", "b", -2)]))
    'every edge points the other way: read it with --edges listens?'
    >>> difference(told, SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 2)]))
    '1 of 2 edges has another sign (the signs are dropped), such as b -> c: -2 in the certificate, 2 in the graph'
    """
    if one.sha256 == other.sha256:
        return None
    nodes, present = set(one.labels), set(other.labels)
    if nodes != present:
        return _lists("node", sorted(nodes - present), sorted(present - nodes))
    meant, found = _edges(one), _edges(other)
    if found == {(t, s): w for (s, t), w in meant.items()}:
        return _turned(other)
    if found.keys() == meant.keys():
        return _weights(meant, found)
    if found.keys() == {(t, s) for s, t in meant}:
        return f"{_turned(other)} Then {_weights(meant, {(t, s): w for (s, t), w in found.items()})}"
    turned = [(s, t) for s, t in meant if (s, t) not in found and (t, s) in found and (t, s) not in meant]
    if turned:
        some = f"{len(turned)} of {len(meant)} edges point{'s' * (len(turned) == 1)} the other way"
        return f"{some}, such as {_arrow(turned[0])} in the certificate"
    missing, more = (
        [_arrow(pair) for pair in part if pair not in rest] for part, rest in ((meant, found), (found, meant))
    )
    return _lists("edge", missing, more)


def _edges(graph: SignedDigraph) -> Edges:
    return {(s, t): w for s, t, w in graph.edges}


def _turned(graph: SignedDigraph) -> str:
    way = graph.read["orientation"]
    if way == "matrix":
        return "every edge points the other way: is the matrix transposed?"
    return f"every edge points the other way: read it with --edges {'information' if way == 'listens' else 'listens'}?"


def _weights(meant: Edges, found: Edges) -> str:
    """Tell in what the weights of the same edges differ."""
    signs = [pair for pair, w in meant.items() if w * found[pair] < 0]
    if signs:
        if len(signs) == len(meant):
            return "every edge has the other sign"
        dropped = " (the signs are dropped)" if all(w > 0 for w in found.values()) else ""
        return f"{_count(len(signs), len(meant))} another sign{dropped}, such as {_both(signs[0], meant, found)}"
    apart = {pair: abs(found[pair] - w) / abs(w) for pair, w in meant.items() if found[pair] != w}
    pair = max(apart, key=apart.__getitem__)
    why = ", as if rounded" if apart[pair] <= ROUNDED else ""
    return (
        f"{_count(len(apart), len(meant))} another weight{why}: the largest relative difference is "
        f"{nearest_float(apart[pair]):.2g}, of {_both(pair, meant, found)}"
    )


def _count(some: int, of: int) -> str:
    return f"{some} of {of} edge{'s' * (of != 1)} {'has' if some == 1 else 'have'}"


def _both(pair: tuple[str, str], meant: Edges, found: Edges) -> str:
    return f"{_arrow(pair)}: {_number(meant[pair])} in the certificate, {_number(found[pair])} in the graph"


def _number(value: Fraction) -> str:
    short = value.numerator.bit_length() + value.denominator.bit_length() <= 120
    return str(value) if short else f"{nearest_float(value):.17g}"


def _arrow(pair: tuple[str, str]) -> str:
    return f"{shorten(pair[0])} -> {shorten(pair[1])}"


def _lists(what: str, missing: list[str], more: list[str]) -> str:
    """Tell what is missing and what is more, each with an example."""
    said = [
        f"{len(names)} {what}{'s' * (len(names) > 1)} of the {where} alone, such as {shorten(names[0], 90)}"
        for names, where in ((missing, "certificate"), (more, "graph"))
        if names
    ]
    return "; ".join(said)
