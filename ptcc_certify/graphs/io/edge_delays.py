"""Delays of edges: a column of the edge list that a graph was read from."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import chain, islice

from ptcc_certify.errors import FormatError, NumberError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, pairs_of
from ptcc_certify.graphs.io.decimal_commas import pointed
from ptcc_certify.graphs.io.edge_list import Records
from ptcc_certify.graphs.io.files import Source, name_and_ending, read_bytes
from ptcc_certify.graphs.io.problems import Problem, Problems, one_message
from ptcc_certify.graphs.io.signs import find, interval_columns, weight_and_sign
from ptcc_certify.graphs.io.table_columns import columns_of, edge_columns
from ptcc_certify.graphs.rationals import decimal_mend, parse_exact, shorten
from ptcc_certify.graphs.reading import Reading


def read_delays(path: Source, graph: SignedDigraph | Family, title: str = "delay") -> dict[tuple[str, str], Fraction]:
    r"""Read what messages take over every edge from a column of an edge list with a header.

    Parameters
    ----------
    path : str, Path or file object
        The file that the graph was read from; ``graph.read`` tells which end of a row listens.
    graph : SignedDigraph or Family
    title : str
        Of the column.

    Returns
    -------
    dict
        The delay of every edge, by the labels of source and target.

    Raises
    ------
    FormatError
        There is no header, no such column, or a delay that is no number; an edge without delay, by line.

    Examples
    --------
    >>> text = b"source,target,weight,delay\na,b,1,0.02\n"
    >>> graph = read_graph(BytesIO(text), format="csv")
    >>> read_delays(BytesIO(text), graph)
    {('a', 'b'): Fraction(1, 50)}
    """
    name, _ = name_and_ending(path)
    rows = Records(read_bytes(path, name), name)
    begin = list(islice((row for row in rows if len(row[1]) > 1), 20))
    number, fields = begin[0] if begin else (1, [])
    place, titles = f"{name}, line {number}", [field.strip() for field in fields]
    how = Reading(columns=graph.read.get("columns"))
    ends = None if how.titles else edge_columns(titles, place)  # of intervals, too
    sign = None if ends is None else weight_and_sign(titles, place)[1]
    if ends is None:
        told = columns_of(titles, [row for _, row in begin[1:]], place, how)
        titles, ends, sign = list(told.titles), (told.source, told.target, told.weight), told.sign
    at = find(titles, [title.lower()], place)
    if at is None:
        mend = f"begin with a header source,target,weight,{shorten(title)}"
        if edge_columns(titles, place) is not None:
            mend = f"add it, or name one of {', '.join(map(shorten, titles))}"
        raise FormatError(f'{place}: no column "{shorten(title)}"; {mend}')
    low, high, _ = interval_columns(titles, place)
    factors = [[column for column in (ends[2] if low is None else low, high) if column is not None]]
    factors += [] if sign is None else [[sign]]
    dropped = "zeros" in graph.read or bool(graph.read.get("drop_zeros"))  # rows of weight 0
    last = graph.read.get("duplicates") == "last"
    first, second, _ = ends if graph.read.get("orientation") != "listens" else (ends[1], ends[0], None)
    delays: dict[tuple[str, str], Fraction] = {}
    broken = Problems()
    body = [(number, [field.strip() for field in row]) for number, row in chain(begin[1:], rows)]
    texts = {row[at]: None for _, row in body if at < len(row)}  # many edges, few delays
    known = {"": None} | dict(zip(texts, map(_number, pointed(texts, rows.commas)), strict=True))
    for number, row in body:
        if len([field for field in row if field]) < 2:
            continue
        source, target, text = (row[k] if k < len(row) else "" for k in (first, second, at))
        zero = dropped and any(some and all(_is_zero(row, k, rows.commas) for k in some) for some in factors)
        if source == target or zero:
            continue  # it was dropped, and its delay with it
        value = known[text]
        if value is None or value < 0:
            what, quote = ("negative", "") if value is not None else ("not a number", '"')
            said = f"delay {quote}{shorten(text)}{quote} of edge {shorten(source)} -> {shorten(target)} is {what}"
            mend = decimal_mend(text if value is None else "", "give a number >= 0")
            broken.add(Problem(f"line {number}", said, mend), what)
            continue
        if not source or not target:
            said = f"delay {shorten(text)} of no edge: the {'target' if source else 'source'} is empty"
            broken.add(Problem(f"line {number}", said, "name both ends or remove it"))
            continue
        for pair in ((source, target), (target, source))[: 2 if graph.read.get("undirected") else 1]:
            delays[pair] = value if last else max(value, delays.get(pair, value))
    if problems := broken.told():
        where, message = one_message(problems, " ".join)
        raise FormatError(f"{', '.join(filter(None, (name, where)))}: {message}")
    if dropped:  # sums that are 0, too
        edges = set(pairs_of(graph))
        delays = {pair: delay for pair, delay in delays.items() if pair in edges}
    return delays


def _number(text: str) -> Fraction | None:
    try:
        return parse_exact(text)
    except NumberError:
        return None


def _is_zero(row: Sequence[str], column: int, commas: bool) -> bool:
    """Tell whether a field is the number 0; a word for a sign is none."""
    return column < len(row) and _number(*pointed([row[column]], commas)) == 0
