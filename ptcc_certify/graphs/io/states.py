"""The gate for states: one exact number for each node, from whatever form a user holds them in, or random."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, NumberError, ParameterError, PTCCError, did_you_mean, items_of
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.conversion import as_graph
from ptcc_certify.graphs.io.decimal_commas import pointed
from ptcc_certify.graphs.io.edge_list import Records
from ptcc_certify.graphs.io.files import name_and_ending, read_bytes
from ptcc_certify.graphs.io.signs import find
from ptcc_certify.graphs.labels import first_five, labels_beside
from ptcc_certify.graphs.rationals import MINUS, as_fraction, parse_exact, shorten
from ptcc_certify.graphs.stubborn import agent_nodes, completed, prejudices

_NODE = ("node", "label", "name", "id")
_VALUE = ("value", "state", "x", "x0", "sigma0")


#: Whose entries of prejudices, where they are not given, are those of their agents; others are 0.
_SHARED = ("x0", "orders", "initial state", "offsets", "low", "high", "center", "axes")
#: Largest entry of an initial state, in size: final states and trajectories are also reported as floats.
LARGEST_STATE = Fraction(1e300)  # the float, which exceeds 10^300 a little


def as_state(values: Any, graph: Any, name: str = "x0") -> list[Fraction]:
    """Return one exact number for each node, in node order, from whatever form a user holds them in.

    Every function that takes a state takes all of these.

    Parameters
    ----------
    values : state-like
        - N numbers in node order: a list, tuple or array of ints, floats (the dyadic numbers they are), Fractions or
          texts of the exact grammar;
        - by label, in any order: a mapping or a pandas Series, or a DataFrame of one column;
        - a text or a path as :func:`read_state` takes it: ``"5,2,-4"``, ``"b=2, a=1"``, ``"state.csv"``;
        - ``"random"``: the state that ``ptcc certify`` draws.
    graph : graph-like
        N nodes; whatever :func:`ptcc_certify.as_graph` takes.
    name : str
        What messages call it.

    Returns
    -------
    list of N Fraction

    Raises
    ------
    ParameterError
        The number of values is not N, a label is that of no node, or an entry is not a finite number, or beyond 1e300.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> as_state([1, "0.1"], graph), as_state({"b": 0.5, "a": 1}, graph), as_state("b=2, a=1", graph)
    ([Fraction(1, 1), Fraction(1, 10)], [Fraction(1, 1), Fraction(1, 2)], [Fraction(1, 1), Fraction(2, 1)])
    """
    rows = as_states(values, graph, name)
    if (size := len(rows[0])) != 1:
        raise ParameterError(
            f"the initial state {name} has {size} numbers for each agent; give one: each coordinate "
            "has a certificate of its own"
        )
    return [row[0] for row in rows]


def as_states(values: Any, graph: Any, name: str = "x0") -> list[list[Fraction]]:
    """Return S exact numbers for each node: what :func:`as_state` takes, or N rows of S numbers, by label or in order.

    Returns
    -------
    list of N lists of S Fraction

    Raises
    ------
    ParameterError
        As :func:`as_state`, or rows differ in length.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> as_states({"b": [3, 4], "a": [1, 2]}, graph) == as_states([[1, 2], [3, 4]], graph)
    True
    """
    graph = as_graph(graph)
    needed = [graph.labels[k] for k in agent_nodes(graph)]
    if isinstance(values, str) and values.strip() == "random":
        return draw_states([0, 1] if name == "sigma0" else 0, graph, name)  # what the command line draws
    if isinstance(values, str | os.PathLike):
        try:
            state = _read(values, graph, "initial state", still_of(name))
        except PTCCError as error:
            raise type(error)(f"{name}: {error}") from None
        return [[_checked(x, label, name)] for label, x in zip(graph.labels, state, strict=True)]
    what, mend = f"the initial state {name}", f"give one number for each of {first_five(needed)}"
    if isinstance(values, set | frozenset | bytes | bytearray):
        raise ParameterError(f"{what} is {shorten(repr(values))}, which has no order; {mend}")
    if np.ma.is_masked(values):
        raise ParameterError(f"{what} has masked entries; {mend}")
    values = in_node_order(values.toarray() if hasattr(values, "tocoo") else values, graph, name)
    if not isinstance(values, Iterable) or not getattr(values, "ndim", True):
        raise ParameterError(f"{what} is {'missing' if values is None else shorten(repr(values))}; {mend}")
    rows = [list(row) if _is_row(row) else [row] for row in values]
    still = still_of(name)
    rows = [*completed(rows, graph, None if still is None else [still] * len(rows[0]) if rows else [])]
    if len(rows) != graph.n_nodes:
        count = f"{counted(len(rows), 'value')} for {counted(len(needed), 'agent')}"
        raise ParameterError(f"{what} has {count}; {mend}")
    if len({len(row) for row in rows}) > 1 or not rows[0]:
        raise ParameterError(f"{what} has empty rows, or rows of different lengths; give as many numbers to each agent")
    return [[_checked(x, label, name) for x in row] for label, row in zip(graph.labels, rows, strict=True)]


def _is_row(entry: Any) -> bool:
    return isinstance(entry, list | tuple) or getattr(entry, "ndim", 0) > 0


def _checked(value: Any, label: str, name: str) -> Fraction:
    """Return an entry as a rational, or refuse it by agent."""
    if type(value) is not Fraction:
        where = f"{name} of agent {shorten(label)}"
        try:
            value = as_fraction(value, where)
        except NumberError as error:
            text = str(error)
            raise ParameterError(text if text.startswith(where) else f"{where}: {text}") from None
    if abs(value) > LARGEST_STATE:
        raise ParameterError(f"{name} of agent {shorten(label)} is beyond 1e300; choose another unit")
    return value


def read_state(
    text_or_path: str | os.PathLike[str], graph: SignedDigraph, name: str = "initial state"
) -> list[Fraction]:
    """Read one exact number for each node of a graph.

    Parameters
    ----------
    text_or_path : str or Path
        Numbers in node order ``5,2,-4``; or ``label=value`` in any order, a label with a comma in quotes
        (``"a,b"=1``); or the path of a file with rows ``node,value`` (header optional, separators, comments
        and quotes as in an edge list).
    graph : SignedDigraph
    name : str
        What messages call it.

    Returns
    -------
    list of Fraction
        In node order.

    Raises
    ------
    ParameterError
        The text does not give each node of the graph exactly one finite number.
    FormatError
        The same for a file; names the line.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> read_state("5,-0.5", graph) == read_state("b=-1/2, a=5", graph)
    True
    """
    return _read(text_or_path, graph, name, still_of(name))


def _read(
    text_or_path: str | os.PathLike[str], graph: SignedDigraph, name: str, still: Fraction | None
) -> list[Fraction]:
    if not isinstance(text_or_path, str) or os.path.isfile(text_or_path):  # noqa: PTH113 - Path.is_file may raise
        return _state_of_file(text_or_path, graph, still)
    place = f'{name} "{shorten(text_or_path)}"'
    try:
        items = items_of(text_or_path) or [""]
    except csv.Error as error:
        raise ParameterError(place, f"unclear quotes ({error}); close each") from None
    bare, labelled = text_or_path.strip(), any("=" in item for item in items)
    if re.fullmatch(r"\[.*\]|\(.*\)|\{.*\}", bare) or _separated_otherwise(bare, items, graph):
        mend = "separate the values by commas, without brackets, such as 5,2,-4 or a=5,b=2,c=-4"
        raise ParameterError(place, f"no such file; {mend}")
    if labelled:
        if (other := next((item for item in items if "=" not in item), None)) is not None:
            message = f'"{shorten(other)}" is not label=value'
            if any("," in label for label in graph.labels):
                message += "; write labels with a comma in quotes"
            raise ParameterError(place, message)
        pairs = [item.rpartition("=")[::2] for item in items]
        pairs = [(label if label in graph.index else label.strip(), value) for label, value in pairs]
    elif len(items := [*completed(items, graph, None if still is None else "0")]) == graph.n_nodes:
        pairs = list(zip(graph.labels, items, strict=True))
    else:
        needed = [graph.labels[k] for k in agent_nodes(graph)]
        size = f"{counted(len(items), 'value')} for {counted(len(needed), 'node')}"
        raise ParameterError(place, f"no such file, and {size}; give one for each of {first_five(needed)}")
    return _in_node_order([(*pair, place) for pair in pairs], graph, place, ParameterError, still)


def _separated_otherwise(text: str, items: Sequence[str], graph: SignedDigraph) -> bool:
    """Tell whether values seem to be separated by blanks or semicolons, or labels from values by colons."""
    if ";" in text and not any(";" in label for label in graph.labels):
        return True
    if "=" not in text and (ends := [item.partition(":")[0].strip() for item in items if ":" in item]):
        return all(label in graph.index for label in ends)
    several = text.count("=") > 1 or text.partition("=")[0] not in graph.index
    return len(items) == 1 < graph.n_nodes and re.search(r"[;\s]", text) is not None and several


def in_node_order(values: Any, graph: SignedDigraph, name: str = "x0") -> Any:
    """Put one entry for each node in node order: by label where there are labels, otherwise as they come.

    Everything that has an entry for each node passes here, so that a label counts wherever there is one.

    Parameters
    ----------
    values : mapping of label to entry, pandas Series or DataFrame, or anything else
        A Series has its labels in its index, a DataFrame has one row for each node; labels are compared as texts.
        Anything else is returned as it is.
    graph : SignedDigraph
    name : str
        What messages call it.

    Returns
    -------
    list, or ``values`` as they are

    Raises
    ------
    ParameterError
        A node has no entry, or two; or a label is that of no node.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> in_node_order({"b": 2, "a": 1}, graph), in_node_order([1, 2], graph)
    ([1, 2], [1, 2])
    """
    entries = by_label(values, name)
    if entries is None:
        return values
    entries = _with_prejudices(entries, graph, still_of(name))
    missing = [label for label in graph.labels if label not in entries]
    unknown = [label for label in entries if label not in graph.index]
    if missing or unknown:
        wrong = [f"no value for {first_five(missing)}"] if missing else []
        if unknown:
            wrong.append(f"{first_five(unknown)} {'is' if len(unknown) == 1 else 'are'} not in the graph")
        mend = "give each node one value, or values without labels in node order"
        raise ParameterError(f"the initial state {name}: {', and '.join(wrong)}; {mend}")
    return [entries[label] for label in graph.labels]


def by_label(values: Any, name: str = "x0") -> dict[str, Any] | None:
    """Return the entries of a mapping, Series or DataFrame by label; None of what has no labels.

    Raises
    ------
    ParameterError
        Two labels are written alike.

    Examples
    --------
    >>> by_label({1: 5, 2: 3}), by_label([5, 3])
    ({'1': 5, '2': 3}, None)
    """
    if isinstance(values, Mapping):
        labels, entries = [str(label) for label in values], list(values.values())
    elif (beside := labels_beside(values)) is not None:
        labels, entries = beside, list(values.to_numpy())
        names = [str(title) for title in getattr(values, "columns", ())]
        node, value = _node_and_value(names, name)
        if node is not None and value is not None and len(names) == 2:  # a table as in a file
            labels, entries = [str(label) for label in values.iloc[:, node]], list(values.iloc[:, value])
    else:
        return None
    result = dict(zip(labels, entries, strict=True))
    if len(result) < len(labels):
        twice = next(label for label in result if labels.count(label) > 1)
        raise ParameterError(f"the initial state {name} has two values for node {shorten(twice)}; keep one")
    return result


def random_states(seed: Any, n: int, dimension: int = 1) -> list[list[Fraction]]:
    """Draw initial states uniform on [-10, 10], to three decimals, so that they can be written down.

    Parameters
    ----------
    seed : int or sequence of int
        The same seed draws the same initial state.
    n, dimension : int
        Number of nodes, and of numbers for each.

    Returns
    -------
    list of list of Fraction
        ``dimension`` numbers for each node.

    Examples
    --------
    >>> states = random_states(7, 3, dimension=2)
    >>> states == random_states(7, 3, dimension=2), [len(numbers) for numbers in states]
    (True, [2, 2, 2])
    """
    thousandths = np.random.default_rng(seed).integers(-10_000, 10_001, size=(n, dimension))
    return [[Fraction(int(x), 1000) for x in row] for row in thousandths]


def still_of(name: str) -> Fraction | None:
    """Return what prejudices have of a state where it is not given: 0, or None where they share that of their agents.

    Examples
    --------
    >>> still_of("--x0"), still_of("v0")
    (None, Fraction(0, 1))
    """
    return None if name.lstrip("-") in _SHARED else Fraction(0)


def draw_states(seed: Any, graph: SignedDigraph, name: str = "x0", dimension: int = 1) -> list[list[Fraction]]:
    """Draw states of the agents of a graph, as :func:`random_states` does; prejudices are not drawn.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> draw_states(7, graph) == draw_states(7, with_stubborn(graph, "b=2"))[:2]
    True
    """
    still, drawn = still_of(name), random_states(seed, len(agent_nodes(graph)), dimension)
    return [*completed(drawn, graph, None if still is None else [still] * dimension)]


def _with_prejudices(entries: dict[str, Any], graph: SignedDigraph, still: Any) -> dict[str, Any]:
    """Return entries by label with those of prejudices that are left out."""
    labels = [(graph.labels[node], graph.labels[agent]) for node, agent in prejudices(graph).items()]
    added = {p: entries[a] if still is None else still for p, a in labels if p not in entries and a in entries}
    return entries | added


def _state_of_file(path: str | os.PathLike[str], graph: SignedDigraph, still: Fraction | None) -> list[Fraction]:
    name, _ = name_and_ending(path)
    columns: tuple[int, int] | None = None
    width = 0
    pairs, rows = [], Records(read_bytes(path, name), name)
    for number, texts in rows:
        place, row = f"{name}, line {number}", [text.strip() for text in texts]
        if columns is None:
            node, value = _node_and_value(pointed(row, rows.commas), place)
            if node is not None and value is not None:
                columns, width = (node, value), len(row)
                continue
            columns, width = (0, 1), 2
        if any(text[:1].isdigit() for text in row[width:]):
            mend = "separate fields by semicolons where numbers have decimal commas, or write a point"
            raise FormatError(f"{place}: {len(row)} fields, and {width} are meant; {mend}")
        cells = [row[i] for i in columns if i < len(row) and row[i]]
        if any(row) and len(cells) < 2:
            raise FormatError(f"{place}: a row needs a node and a value; write node,value")
        if cells:
            pairs.append((cells[0], cells[1], place))
    return _in_node_order(_with_points(pairs, rows.commas), graph, name, FormatError, still)


def _with_points(pairs: Sequence[tuple[str, str, str]], commas: bool) -> list[tuple[str, str, str]]:
    values = pointed([text for _, text, _ in pairs], commas)
    return [(label, value, place) for (label, _, place), value in zip(pairs, values, strict=True)]


def read_vectors_of_file(
    path: str | os.PathLike[str], graph: SignedDigraph, dimension: int, still: Fraction | None = None
) -> list[list[Fraction]]:
    """Read rows ``node,x,y,..`` of so many numbers for each node; the header is optional.

    Raises
    ------
    FormatError
        A row has another number of entries, an entry is no number, or a node has no row, or two.
    """
    name, _ = name_and_ending(path)
    columns: list[list[tuple[str, str, str]]] = [[] for _ in range(dimension)]
    rows = Records(read_bytes(path, name), name)
    for number, texts in rows:
        place, row = f"{name}, line {number}", [text.strip() for text in texts]
        if not any(row) or (not columns[0] and row[0] not in graph.index):
            continue  # a header
        if len(row) != dimension + 1:
            raise FormatError(f"{place}: a row needs a node and {dimension} numbers; write node,x,y")
        for entries, text in zip(columns, row[1:], strict=True):
            entries.append((row[0], text, place))
    states = [
        _in_node_order(_with_points(entries, rows.commas), graph, name, FormatError, still) for entries in columns
    ]
    return [list(row) for row in zip(*states, strict=True)]


def _node_and_value(row: Sequence[str], place: str) -> tuple[int | None, int | None]:
    """Return the columns of a header; beside that of the nodes a single other one holds the values, however called."""
    node, value = find(row, _NODE, place), find(row, _VALUE, place)
    if node is not None and value is None and len(row) == 2:
        with suppress(NumberError):
            parse_exact(row[1 - node])
            return node, None  # a row of a node that is called so
        return node, 1 - node
    if node is not None and value is not None and None not in (find(row, (t,), place) for t in "xy"):
        raise FormatError(f"{place}: x and y are coordinates of a vector; keep one column, called value")
    return node, value


def _in_node_order(
    pairs: Sequence[tuple[str, str, str]],
    graph: SignedDigraph,
    name: str,
    refusal: type[PTCCError],
    still: Fraction | None,
) -> list[Fraction]:
    """Put (label, value, place) in node order."""
    state: dict[str, Fraction] = {}
    for label, text, place in pairs:
        if label not in graph.index:
            hint = did_you_mean(label, graph.labels) or f"; its nodes are {first_five(graph.labels)}"
            raise refusal(place, f'node "{shorten(label)}" is not in the graph{hint}')
        if label in state:
            raise refusal(place, f"node {shorten(label)} has two values; keep one")
        try:
            state[label] = parse_exact(text)
        except NumberError as error:
            mend = "write the minus as -" if MINUS in text else "give a finite number"
            raise refusal(place, f"value of node {shorten(label)}: {error}; {mend}") from None
    state = _with_prejudices(state, graph, still)
    if missing := [label for label in graph.labels if label not in state]:
        count = f"{len(missing)} of {graph.n_nodes} nodes have no value"
        raise refusal(f"{name}: {count}: {first_five(missing)}; give one to each node")
    return [state[label] for label in graph.labels]
