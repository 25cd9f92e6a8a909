"""In what two signed digraphs, or two families of them, differ: one line that says which."""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction

from lmi.exact.decimal_rounding import counted
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
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
    >>> graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2)])
    >>> difference(graph, SignedDigraph.from_edges([("b", "a", 1), ("c", "b", -2)]))
    'every edge points the other way: read it with --edges listens?'
    >>> difference(graph, SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 2)]))
    '1 of 2 edges has another sign (the signs are dropped), such as b -> c: -2 in the certificate, 2 in the graph'
    """
    if one.sha256 == other.sha256:
        return None
    nodes, present = set(one.labels), set(other.labels)
    if nodes != present:
        return _lists("node", sorted(nodes - present), sorted(present - nodes))
    reference, actual = _edges(one), _edges(other)
    if actual == {(t, s): w for (s, t), w in reference.items()}:
        return _tell_reversal(other)
    if actual.keys() == reference.keys():
        return _weights(reference, actual)
    if actual.keys() == {(t, s) for s, t in reference}:
        return f"{_tell_reversal(other)} Then {_weights(reference, {(t, s): w for (s, t), w in actual.items()})}"
    reversals = [(s, t) for s, t in reference if (s, t) not in actual and (t, s) in actual and (t, s) not in reference]
    if reversals:
        point = "points" if len(reversals) == 1 else "point"
        example = f"such as {_arrow(reversals[0])} in the certificate"
        return f"{len(reversals)} of {len(reference)} edges {point} the other way, {example}"
    missing, more = (
        [_arrow(pair) for pair in edges if pair not in others]
        for edges, others in ((reference, actual), (actual, reference))
    )
    return _lists("edge", missing, more)


def _edges(graph: SignedDigraph) -> Edges:
    return {(s, t): w for s, t, w in graph.edges}


def _tell_reversal(graph: SignedDigraph) -> str:
    way = graph.read["orientation"]
    if way == "matrix":
        return "every edge points the other way: is the matrix transposed?"
    return f"every edge points the other way: read it with --edges {'information' if way == 'listens' else 'listens'}?"


def _weights(reference: Edges, actual: Edges) -> str:
    """Tell in what the weights of the same edges differ."""
    signs = [pair for pair, w in reference.items() if w * actual[pair] < 0]
    if signs:
        if len(signs) == len(reference):
            return "every edge has the other sign"
        remark = " (the signs are dropped)" if all(w > 0 for w in actual.values()) else ""
        example = _both(signs[0], reference, actual)
        return f"{_count(len(signs), len(reference))} another sign{remark}, such as {example}"
    errors = {pair: abs(actual[pair] - w) / abs(w) for pair, w in reference.items() if actual[pair] != w}
    pair = max(errors, key=errors.__getitem__)
    why = ", as if rounded" if errors[pair] <= ROUNDED else ""
    return (
        f"{_count(len(errors), len(reference))} another weight{why}: the largest relative difference is "
        f"{nearest_float(errors[pair]):.2g}, of {_both(pair, reference, actual)}"
    )


def _count(some: int, of: int) -> str:
    return f"{some} of {counted(of, 'edge')} {'has' if some == 1 else 'have'}"


def _both(pair: tuple[str, str], reference: Edges, actual: Edges) -> str:
    return f"{_arrow(pair)}: {_number(reference[pair])} in the certificate, {_number(actual[pair])} in the graph"


def _number(value: Fraction) -> str:
    short = value.numerator.bit_length() + value.denominator.bit_length() <= 120
    return str(value) if short else f"{nearest_float(value):.17g}"


def _arrow(pair: tuple[str, str]) -> str:
    return f"{shorten(pair[0])} -> {shorten(pair[1])}"


def _lists(what: str, missing: list[str], more: list[str]) -> str:
    """Tell what is missing and what is more, each with an example."""
    clauses = [
        f"{counted(len(names), what)} of the {where} alone, such as {shorten(names[0], 90)}"
        for names, where in ((missing, "certificate"), (more, "graph"))
        if names
    ]
    return "; ".join(clauses)


def mode_order(one: Family, other: Family) -> tuple[int, ...] | None:
    """Return the positions in ``other`` of the modes of ``one``; None if these are not the same modes.

    A family is the same in any order of its modes, whatever these are called.

    Examples
    --------
    >>> day, night = (Family.from_intervals([("a", "b", w, w)]) for w in (1, 2))
    >>> mode_order(Family.switching([day, night]), Family.switching([night, day]))
    (1, 0)
    >>> mode_order(day, night) is None
    True
    """
    if one.sha256 == other.sha256:
        return tuple(range(len(one.modes)))
    if sorted(one.labels) != sorted(other.labels) or len(one.modes) != len(other.modes):
        return None
    order = _matches(one, other)
    return None if None in order else tuple(k for k in order if k is not None)


def family_difference(one: Family, other: Family) -> str | None:
    """Tell in what a family differs from another: nodes, modes, edges; None if they have the same modes.

    Parameters
    ----------
    one : Family
        The one that is meant, of a certificate.
    other : Family
        The one at hand.

    Examples
    --------
    >>> family_difference(Family.from_intervals([("a", "b", 1, 2)]), Family.from_intervals([("a", "b", 1, 3)]))
    '["a", "b", "1", "2"] is only in the certificate, and ["a", "b", "1", "3"] is only in the files'
    """
    if mode_order(one, other) is not None:
        return None
    if odd := sorted(set(one.labels) ^ set(other.labels)):
        return f"node {shorten(odd[0])} is only in the {'certificate' if odd[0] in one.labels else 'files'}"
    if len(one.modes) != len(other.modes):
        return f"{counted(len(one.modes), 'mode')} in the certificate, {len(other.modes)} in the files"
    pairs = _different_modes(one, other)
    number, place = pairs[0]
    first, second = (set(f.modes[k].marked_lines()) for f, k in ((one, number), (other, place)))
    alone = [
        f"{shorten(min(lines), 120)} is only in the {where}"
        for where, lines in (("certificate", first - second), ("files", second - first))
        if lines
    ]
    return _mode_text(one, other, pairs) + ", and ".join(alone)


def _matches(one: Family, other: Family) -> list[int | None]:
    """Return for every mode of a family the position of an equal one in another, each taken once; None without."""
    places = defaultdict(list)
    for number, mode in enumerate(other.modes):
        places[tuple(mode.marked_lines())].append(number)
    equal = [places[tuple(mode.marked_lines())] for mode in one.modes]
    return [numbers.pop(0) if numbers else None for numbers in equal]


def _different_modes(one: Family, other: Family) -> list[tuple[int, int]]:
    """Return pairs of positions of modes that differ: those of one name, then the others as they come."""
    order = _matches(one, other)
    mine = [k for k, place in enumerate(order) if place is None]
    theirs = [k for k in range(len(other.modes)) if k not in order]
    named = {other.modes[k].name: k for k in reversed(theirs)}
    pairs = [(k, named.pop(one.modes[k].name)) for k in mine if one.modes[k].name in named]  # names may occur twice
    rest = [k for k in mine if k not in {first for first, _ in pairs}]
    return pairs + list(zip(rest, [k for k in theirs if k not in {second for _, second in pairs}], strict=True))


def _mode_text(one: Family, other: Family, pairs: list[tuple[int, int]]) -> str:
    """Name the first of two modes that differ, and tell how many more do."""
    if len(one.modes) == 1:
        return ""
    name, also = (shorten(family.modes[k].name) for family, k in zip((one, other), pairs[0], strict=True))
    remarks = [f"{also} of the files"] if also != name else []
    if len(pairs) > 1:
        remarks.append(f"one of {len(pairs)} that differ")
    return f"in mode {name} ({', '.join(remarks)}) " if remarks else f"in mode {name} "
