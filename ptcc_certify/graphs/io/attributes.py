"""Graphs of nodes and edges with attributes: which of these is the weight, which the sign, which the label."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NoReturn

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, NumberError
from ptcc_certify.graphs.io.columns_beside import column_of
from ptcc_certify.graphs.io.raw_edges import Beside, Rows, Signs, distinct, rows_of
from ptcc_certify.graphs.io.signs import WEIGHT, family_titles, is_sign, plain, sign_of_word, weight_and_sign
from ptcc_certify.graphs.rationals import parse_exact, shorten
from ptcc_certify.graphs.reading import Reading

Attributes = Mapping[str, Any]
Pairs = Iterable[tuple[str, Any]]


def lower_case(attributes: Attributes) -> dict[str, Any]:
    """Return attributes with their titles in small letters."""
    return {str(key).lower(): value for key, value in attributes.items()}


def text_of(attributes: Attributes, title: str) -> str:
    """Return an attribute as a text; "" where it is not there or is null."""
    value = lower_case(attributes).get(title)
    return "" if value is None else str(value).strip()


def names_or_identifiers(identifiers: Sequence[str], nodes: Sequence[Attributes]) -> list[str]:
    """Return what nodes are called: by ``label`` or ``name`` where identifiers only number them, as igraph's n0, n1.

    Examples
    --------
    >>> names_or_identifiers(["n0", "n1"], [{"name": "ann"}, {"name": "bob"}])
    ['ann', 'bob']
    >>> names_or_identifiers(["ann", "bob"], [{"name": "Ann B."}, {"name": "Bob C."}])
    ['ann', 'bob']
    """
    if all(re.fullmatch(r"n?[0-9]+", node) for node in identifiers):
        for title in ("label", "name"):
            names = [text_of(node, title) for node in nodes]
            if names and all(names) and len(set(names)) == len(names):
                return names
    return list(identifiers)


def values_of_edges(
    data: Sequence[Attributes], edge: Callable[[int], str], name: str, told: str | None
) -> tuple[list[Any], Beside]:
    """Return the weights of edges and what stands beside them; ``told`` is the attribute that holds them, and it alone.

    Raises
    ------
    FormatError or GraphError
        An edge has no weight, no sign where others have one, or what makes a family; ``edge(k)`` names the edge k.
    """
    titles = list(dict.fromkeys(title for one in data for title in one))
    if more := family_titles(titles):
        k = next(k for k, one in enumerate(data) if more[0] in one)
        mend = "as a CSV file with columns source, target, weight_min, weight_max, optional it is read"
        mend = mend if name else "ptcc_certify.as_family takes it"
        _fail(name, f'edge {edge(k)} has the attribute "{more[0]}", which makes a family of graphs; {mend}')
    at = weight_and_sign(titles, name or "the edges") if told is None else (None, None)
    weight, sign = (None if k is None else titles[k] for k in at)
    if weight is None or sign is None or not any(_has(one, weight) and _has(one, sign) for one in data):
        either = [title for title in (told or weight or "weight", sign) if title is not None]  # each edge has its own
        weights = [next((one[title] for title in either if _has(one, title)), None) for one in data]
        signs, sign = list[Any](), None
    else:
        weights, signs = [one.get(weight) for one in data], [one.get(sign) for one in data]
        either = [weight]
    for k, value in enumerate(weights):
        if value is None or not _has(data[k], *either):
            what = "weight" if name else f'attribute "{either[0]}"'
            tell = "--columns source,target,NAME" if name else "from_networkx(graph, weight=NAME)"
            _fail(name, f"edge {edge(k)} has no {what}; give each edge a signed number, or name the attribute: {tell}")
        if signs and not _has(data[k], str(sign)):
            _fail(name, f'edge {edge(k)} has no "{sign}", and others have; give each one')
    others = [title for title in titles if title not in (*either, sign, "id")]
    return weights, Beside(
        title=either[0] if not told and is_sign(either[0]) else "",
        signs=Signs(*distinct(signs), str(sign)) if signs else None,
        columns=[column_of(title, [one.get(title, "") for one in data]) for title in others],
        told=told is not None,
    )


def _has(attributes: Attributes, *titles: str) -> bool:
    return any(str(attributes.get(title, "")).strip() for title in titles)


def _fail(name: str, message: str) -> NoReturn:
    if name:
        raise FormatError(f"{name}: {message}")
    raise GraphError(message)


def attribute_rows(
    labels: list[str], ends: Sequence[tuple[int, int]], data: Sequence[Pairs], name: str, how: Reading, rest: Pairs = ()
) -> Rows:
    """Turn edges with attributes, which are texts under titles, into rows; ``rest`` is told of edges that say nothing.

    Raises
    ------
    FormatError
        Two attributes of an edge have one title, in small letters, and different values.
    """
    edge = lambda k: " -> ".join(shorten(labels[end]) for end in ends[k])  # noqa: E731
    told = how.titles[2].lower() if how.titles else None
    default = _by_title(rest, told, lambda: f"{name}: the default of edges")
    where = lambda k: f"{name}: edge {edge(k)}"  # noqa: E731
    texts = [default | _by_title(one, told, partial(where, k)) for k, one in enumerate(data)]
    weights, beside = values_of_edges(texts, edge, name, told)
    return rows_of(labels, [one for one, _ in ends], [other for _, other in ends], weights, beside)


def _by_title(pairs: Pairs, told: str | None, where: Callable[[], str]) -> dict[str, str]:
    """Return texts by their titles in small letters; refuse two of one title that differ, if they count."""
    texts = dict[str, str]()
    for key, value in pairs:
        title, text = str(key).lower(), str(value).strip()
        first = texts.get(title)
        counts = title == told if told else _counts(title, first, text)
        if first and text and counts and not _same(first, text):
            both = f"{shorten(first)} and {shorten(text)}"
            raise FormatError(
                f'{where()}: two attributes are named "{shorten(title)}" ({both}); keep one, or rename it'
            )
        texts[title] = text or first or ""
    return texts


def _counts(title: str, *values: str | None) -> bool:
    """Tell whether an attribute may be a weight, a sign or a direction, by its title or a value."""
    titled = plain(title) in WEIGHT or is_sign(title) or "direct" in title or family_titles([title])
    return bool(titled) or any(value and sign_of_word(value) is not None for value in values)


def _same(one: str, other: str) -> bool:
    try:
        return one == other or parse_exact(one) == parse_exact(other)
    except NumberError:
        return False


def both_ways(rows: Rows, undirected: Sequence[bool], what: str, how: Reading) -> Rows:
    """Let some rows go both ways: of a file of them alone that must be asked for, beside directed ones they say so."""
    some = np.flatnonzero(undirected)
    if some.size == len(undirected) and some.size:
        rows.undirected = what
    elif some.size and not how.undirected:
        first, second = np.asarray(rows.first), np.asarray(rows.second)
        where, last = rows.where, len(undirected)
        place = np.append(np.arange(last), some)
        rows.first, rows.second = np.append(first, second[some]), np.append(second, first[some])
        rows.codes = np.asarray(rows.codes)[place]
        if (signs := rows.beside.signs) is not None:
            rows.beside.signs = replace(signs, codes=np.asarray(signs.codes)[place])
        for column in rows.beside.columns:
            column.codes = None if column.codes is None else np.asarray(column.codes)[place].tolist()
        rows.where = lambda row: where(int(place[row]))
        rows.notes += (f"{what} go both ways ({some.size})",)
    return rows
