"""Graphs and families with stubborn agents, made from what tells how stubborn they are."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from ptcc_certify.errors import GraphError, NumberError, ParameterError, items_of
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode, read_interval
from ptcc_certify.graphs.io.conversion import as_graph
from ptcc_certify.graphs.io.decimal_commas import pointed
from ptcc_certify.graphs.io.edge_list import Records
from ptcc_certify.graphs.io.files import name_and_ending, read_bytes
from ptcc_certify.graphs.io.states import by_label
from ptcc_certify.graphs.labels import place_of
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import format_exact, shorten
from ptcc_certify.graphs.stubborn import PREJUDICE


def with_stubborn(graph: Any, stubborn: Any) -> SignedDigraph | Family:
    """Return a graph, or a family, in which some agents are stubborn: with a node for each of their prejudices.

    The node is called ``a's prejudice``. Of an initial state its entry may be left out: then it is ``x_a(0)``.

    Parameters
    ----------
    graph : graph-like or Family
        Whatever :func:`ptcc_certify.as_graph` takes.
    stubborn : mapping of label to number, pair of numbers or text; number or text
        How stubborn agents are: the weights ``theta > 0`` of their prejudices. A pair, or ``"0.3..0.5"``, is an
        interval that holds it, which makes a family. ``"a=0.5,b=1"`` or the path of a file of rows ``node,theta``, too;
        a number alone is that of all agents.

    Returns
    -------
    SignedDigraph, or Family

    Raises
    ------
    ParameterError
        An agent is not in the graph, or its stubbornness is not a positive number.
    GraphError
        A node is called like a prejudice already.

    References
    ----------
    Friedkin and Johnsen, Social influence and opinions, J. Math. Sociol. 15 (1990).
    Taylor, Towards a mathematical theory of influence and attitude change, Human Relations 21 (1968).

    Examples
    --------
    >>> debate = with_stubborn([("a", "b", 1), ("b", "a", 1)], {"a": "0.5"})
    >>> debate.edges[-1], ptcc.final_state(debate, {"a": 3, "b": 0})["b"]
    (('a', 'b', Fraction(1, 1)), Fraction(3, 1))
    """
    given: Any = graph if isinstance(graph, Family) else as_graph(graph)
    weights = _weights_by_agent(stubborn, given.labels)
    if clash := {label + PREJUDICE for label in weights}.intersection(given.labels):
        raise GraphError(f"a node is called {shorten(min(clash))} already; rename it")
    if isinstance(given, SignedDigraph) and all(low == high for low, high in weights.values()):
        source, target = map(np.concatenate, zip((given.source, given.target), _ends(given, weights), strict=True))
        told = [given.exact_weight(e) for e in range(given.n_edges)] + [low for low, _ in weights.values()]
        return SignedDigraph(_labels(given, weights), source, target, Weights(told), given.read)
    family = given if isinstance(given, Family) else Family.from_graph(given)
    tied = any(mode.tied and not mode.known.all() for mode in family.modes)
    note = ("both directions of an edge change by themselves, for prejudices go one way",) if tied else ()
    return replace(family, modes=tuple(_mode(mode, weights) for mode in family.modes), notes=(*family.notes, *note))


def _labels(given: Any, weights: Mapping[str, Any]) -> list[str]:
    return [*given.labels, *(label + PREJUDICE for label in weights)]


def _ends(given: Any, weights: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return sources and targets of the edges from prejudices."""
    place, n = {label: k for k, label in enumerate(given.labels)}, len(given.labels)
    return np.arange(n, n + len(weights)), np.array([place[label] for label in weights], dtype=np.int64)


def _mode(mode: Mode, weights: Mapping[str, tuple[Fraction, Fraction]]) -> Mode:
    """Return a mode with prejudices."""
    source, target = map(np.concatenate, zip((mode.source, mode.target), _ends(mode, weights), strict=True))
    sign, m = np.concatenate([mode.sign, np.ones(len(weights), dtype=np.int8)]), source.size
    bounds = [[side.fraction(e) for e in range(mode.n_edges)] for side in (mode.lower, mode.upper)]
    both = Weights([x for side, old in enumerate(bounds) for x in (*old, *(pair[side] for pair in weights.values()))])
    order = np.lexsort((sign, source, target))
    lower, upper = both.take(order), both.take(order + m)
    return Mode(tuple(_labels(mode, weights)), source[order], target[order], sign[order], lower, upper, mode.name)


def _weights_by_agent(stubborn: Any, labels: Sequence[str]) -> dict[str, tuple[Fraction, Fraction]]:
    """Return the least and the largest weight of each prejudice, by the labels of agents in node order."""
    named = by_label(stubborn, "stubborn")
    if named is None:
        texts = isinstance(stubborn, str | os.PathLike)
        if not texts and (stubborn is None or hasattr(stubborn, "__len__")):
            mend = 'give {"a": 0.5}, or one number for all'
            raise ParameterError("stubborn", f"= {shorten(repr(stubborn))} does not tell of which agents; {mend}")
        named = told_by_agent(stubborn, labels, "stubborn") if texts else dict.fromkeys(labels, stubborn)
    if not named:
        raise ParameterError("stubborn", "names nobody; give a=0.5, or leave it out")
    known = {*labels}
    for label in named:
        if label not in known:
            place_of(label, labels)
    return {label: _interval(named[label], label) for label in labels if label in named}


def told_by_agent(text: str | os.PathLike[str], labels: Sequence[str], name: str) -> dict[str, str]:
    """Return what a text ``a=0.5,b=1`` or a file of rows ``node,number`` tells by label; a number alone is of all.

    Examples
    --------
    >>> told_by_agent("b=1, a=0.3..0.5", ["a", "b"], "stubborn"), told_by_agent("2", ["a", "b"], "stubborn")
    ({'b': '1', 'a': '0.3..0.5'}, {'a': '2', 'b': '2'})
    """
    known = {*labels}
    if not isinstance(text, str) or os.path.isfile(text):  # noqa: PTH113 - Path.is_file may raise
        file, _ = name_and_ending(text)
        records = Records(read_bytes(text, file), file)
        rows = [[cell.strip() for cell in row] for _, row in records if any(row)]
        rows = rows[1:] if rows and rows[0][0] not in known else rows  # a header
        if odd := next((row for row in rows if len(row) != 2), None):
            raise ParameterError(name, f"of {file}: {shorten(','.join(odd))} is no row node,number; write a,0.5")
        pairs = [*zip([label for label, _ in rows], pointed([x for _, x in rows], records.commas), strict=True)]
    else:
        try:
            items = items_of(text)
        except csv.Error as error:
            raise ParameterError(name, f"has unclear quotes or rows ({error}); write a=0.5,b=1") from None
        if "=" not in text and len(items) == 1 and not text.strip()[:1].isalpha():
            return dict.fromkeys(labels, text.strip())
        if bare := next((item for item in items if "=" not in item), None):
            mend = "write a=0.5,b=1, one number for all, or the name of a file"
            raise ParameterError(name, f'has "{shorten(bare)}", which is not label=number; {mend}')
        split = [item.rpartition("=")[::2] for item in items]
        pairs = [(label if label in known else label.strip(), number.strip()) for label, number in split]
    told = dict(pairs)
    if len(told) < len(pairs):
        raise ParameterError(name, "names an agent twice; keep one")
    return told


def _interval(theta: Any, label: str) -> tuple[Fraction, Fraction]:
    """Return the least and the largest weight of a prejudice, or refuse them."""
    ends = theta.split("..", 1) if isinstance(theta, str) else theta
    ends = ends if isinstance(ends, tuple | list) else [ends]
    place = f"stubbornness of {shorten(label)}"
    mend = "give a number > 0, such as 0.5, an interval 0.3..0.5, or leave the agent out"
    if len(ends) not in (1, 2):
        raise ParameterError(f"{place} has {len(ends)} numbers; {mend}")
    try:
        low, high = read_interval(ends[0], ends[-1], place)
    except (GraphError, NumberError) as error:
        raise ParameterError(f"{place}: {str(error).removeprefix(f'{place}: ').partition(';')[0]}; {mend}") from None
    if low < 0:
        raise ParameterError(f"{place} is {format_exact(low)}, which repels it from its prejudice; {mend}")
    return low, high
