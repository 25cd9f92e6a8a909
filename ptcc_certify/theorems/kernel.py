"""The states at rest in a graph, by the rows of a basis: by edges where they tell, by exact numbers where they do not.

A family has one behaviour under every signal if the kernel of one mandatory graph is at rest in every member. That is a
list of questions of one kind: is a combination ``sum_c b_c B_c`` of rows of the basis ``B`` zero? An uncertain edge
``l -> k`` asks it of ``B_k - sgn(w) B_l``, agent ``k`` in another mandatory graph of row ``k`` of ``L B``.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.labels import place_of
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.theorems.lemmas import solve_exact

#: A row of the basis that is neither zero nor, up to its sign, a unit vector.
UNKNOWN = np.iinfo(np.int64).max
#: Rounds after which agents that hear several groups stand for themselves.
_ROUNDS = 20
#: One unit of an enclosure; numbers are drawn up to :data:`_LARGEST`, so that floats hold them.
_UNIT = Fraction(1, 2**60)
_LARGEST = 2**10

#: Coefficients ``b_c`` of rows of a basis, by the number of the row; none is 0.
Combination = dict[int, Fraction]


class TooLarge(Exception):
    """The rows of a kernel are rational numbers, and there are too many to solve for."""


@dataclass(frozen=True, eq=False)
class StateEnclosure:
    """A state at rest in a graph, enclosed: ``|q_k - unit middle_k| <= unit radius_k``.

    Leaders have radius 0: balanced closed component ``j`` keeps its camps times ``values[j]``, the others 0. For
    followers it is proved row by row, in integers (over the scale of the weights):

        sum_l |w_kl| (radius_k - radius_l)  >=  |sum_l |w_kl| (middle_k - sgn(w_kl) middle_l)|.

    For the error ``e = q - middle`` has ``L e = -L middle`` on followers, hence ``M |e| <= |L middle| <= M radius``
    with the comparison matrix ``M`` of their block, and the inverse of ``M`` is nonnegative.

    Attributes
    ----------
    values : tuple of d int
    middle, radius : tuple of N int
    unit : Fraction
    """

    values: tuple[int, ...]
    middle: tuple[int, ...]
    radius: tuple[int, ...]
    unit: Fraction = _UNIT


class Kernel:
    """The kernel of a signed Laplacian, by the rows of its basis ``B``.

    Column ``j`` belongs to balanced closed component ``j``: its camps there, 0 in the others. The row of an agent that
    ends in a camp of one component whatever the weights, or at 0, is known from the edges. An agent whose news all come
    through one other agent, and with one sign, has that one's row or its opposite. The others need a solve.

    Parameters
    ----------
    structure : Structure

    Attributes
    ----------
    dimension : int
    codes : (n,) int array
        ``j + 1`` or ``-(j + 1)`` for a row that is a unit vector or its opposite, 0 for a row of zeros.
    """

    def __init__(self, structure: Structure):
        self.structure = structure
        balanced = [c for c in structure.closed_components if c.gauge is not None]
        self.dimension = len(balanced)
        codes = np.full(structure.graph.n_nodes, UNKNOWN)
        codes[structure.leaders] = 0
        for number, component in enumerate(balanced, 1):
            codes[list(component.nodes)] = number * np.array(component.gauge)
        self.codes = _follow(structure.graph, codes)

    @cached_property
    def numbers(self) -> np.ndarray:
        """(n,) int array: the codes, and of the other agents the number of their row, signed.

        Agents with one number have one row, with opposite numbers opposite rows, whatever the weights. Number
        ``dimension + 1 + k`` belongs to agent ``k`` itself.
        """
        return _number_rows(self.structure.graph, self.codes, self.dimension)

    @cached_property
    def _unsolved(self) -> list[int]:
        """The agents whose rows need a solve, one for each number."""
        unknown = np.flatnonzero(self.codes == UNKNOWN)
        return np.unique(np.abs(self.numbers[unknown]) - self.dimension - 1).tolist()

    @property
    def has_rows(self) -> bool:
        """Whether all rows are told by edges, or few enough to be solved for."""
        return len(self._unsolved) <= EXACT_NODES

    @cached_property
    def _solved(self) -> dict[int, list[Fraction]]:
        """The rows that the edges alone do not tell, by their numbers."""
        own = [self.dimension + 1 + v for v in self._unsolved]
        if len(own) > EXACT_NODES:
            raise TooLarge
        rows, zero = [self.combination(row) for row in self.structure.graph.exact_rows(self._unsolved)], Fraction(0)
        block = [[row.get(c, zero) for c in own] for row in rows]
        pull = [[-row.get(j, zero) for j in range(1, self.dimension + 1)] for row in rows]
        solution = solve_exact(block, pull)
        assert solution is not None, "a follower block is never singular"
        return dict(zip(own, solution, strict=True))

    def row(self, node: int | str) -> Sequence[Fraction]:
        """Return ``B_k`` of a node, exact: by its index, or by its label if that is a text.

        Raises
        ------
        UnknownAgentError
            There is no such node.
        TooLarge
            The edges alone do not tell it, nor the rows of more than 120 agents.
        """
        node = place_of(node, self.structure.graph.labels)
        code = int(self.codes[node])
        if code == UNKNOWN:
            number = int(self.numbers[node])
            solved = self._solved[abs(number)]
            return solved if number > 0 else [-x for x in solved]
        row = [Fraction(0)] * self.dimension
        if code:
            row[abs(code) - 1] = Fraction(1 if code > 0 else -1)
        return row

    def column(self, j: int) -> tuple[Fraction, ...] | None:
        """Return column ``j`` of ``B``, a state at rest; None if it takes a solve of too many rows."""
        try:
            return tuple(self.row(v)[j] for v in range(self.codes.size))
        except TooLarge:
            return None

    # ------------------------------------------------------------------ combinations of rows

    def combination(self, coefficients: dict[int, Fraction]) -> Combination:
        """Return ``sum_k a_k B_k`` over agents as a combination of rows that differ."""
        result: Combination = {}
        for node, a in coefficients.items():
            if number := int(self.numbers[node]):
                result[abs(number)] = result.get(abs(number), Fraction(0)) + (a if number > 0 else -a)
        return {c: b for c, b in result.items() if b}

    def _reduced(self, node: int, row: dict[int, Fraction], own_row: dict[int, Fraction]) -> Combination:
        """Return row ``node`` of another ``L B`` as a combination, less a multiple of the kernel's own, which is 0."""
        result, c = self.combination(row), abs(int(self.numbers[node]))
        if c in result and c > self.dimension:
            own = self.combination(own_row)
            if c in own:
                share = result[c] / own[c]
                result = {x: result.get(x, 0) - share * own.get(x, 0) for x in result.keys() | own.keys()}
        return {x: b for x, b in result.items() if b}

    def edge_questions(
        self, source: np.ndarray, target: np.ndarray, sign: np.ndarray
    ) -> Iterator[tuple[int, Combination]]:
        """Yield the edges that may have ``B_target != sign B_source``, each with the difference.

        First come those where the edges alone tell that it is so.
        """
        ends, heard = self.codes[target], self.codes[source]
        unknown = (ends == UNKNOWN) | (heard == UNKNOWN)
        differ = ~unknown & (ends != sign * np.where(unknown, 0, heard))
        # A row that no camp tells is a proper mean of others, and never a unit vector.
        unit = np.where(ends == UNKNOWN, heard, ends)
        by_edges = differ | (unknown & (unit != UNKNOWN) & (unit != 0))
        for edge in np.flatnonzero(by_edges).tolist():
            k, one = int(target[edge]), int(source[edge])
            yield edge, self.combination({k: Fraction(1), one: Fraction(-int(sign[edge]))})
        if unknown.any():
            for edge in np.flatnonzero(
                unknown & ~by_edges & (self.numbers[target] != sign * self.numbers[source])
            ).tolist():
                k, one = int(target[edge]), int(source[edge])
                yield edge, self.combination({k: Fraction(1), one: Fraction(-int(sign[edge]))})

    def row_questions(self, graph: SignedDigraph) -> Iterator[Combination]:
        """Yield rows of ``L B`` of another graph that may not be 0.

        First come those of agents whose rows of ``B`` edges alone tell.
        """
        ends, heard = self.codes[graph.target], self.codes[graph.source]
        # Where all edges of a row agree with B, its sum is 0.
        agree = (ends != UNKNOWN) & (ends == graph.sign * np.where(heard == UNKNOWN, 0, heard))
        suspects = np.zeros(graph.n_nodes, dtype=bool)
        suspects[graph.target[~agree]] = True
        if suspects.any():
            suspects &= ~_proportional_rows(self.structure.graph, graph)
        if suspects.any():
            agree |= self.numbers[graph.target] == graph.sign * self.numbers[graph.source]
            spoiled = np.zeros_like(suspects)
            spoiled[graph.target[~agree]] = True
            suspects &= spoiled
        by_edges = suspects & (self.codes != UNKNOWN)
        for some in (np.flatnonzero(by_edges).tolist(), np.flatnonzero(suspects & ~by_edges).tolist()):
            rows = graph.exact_rows(some), self.structure.graph.exact_rows(some)
            for node, row, own_row in zip(some, *rows, strict=True):
                if question := self._reduced(node, row, own_row):
                    yield question

    def told_column(self, question: Combination) -> int | None:
        """Return a column in which a combination is not 0 by the edges alone; None if these do not tell."""
        units = [c for c in question if c <= self.dimension]
        if len(units) == len(question):
            return units[0] - 1
        if len(units) == 1 and len(question) == 2 and len(set(map(abs, question.values()))) == 1:
            return units[0] - 1  # a unit vector and a row that is none
        return None

    def solved_column(self, question: Combination) -> int | None:
        """Return a column in which a combination is not 0; None if it is 0.

        Raises
        ------
        TooLarge
            As :meth:`row`.
        """
        total = [Fraction(0)] * self.dimension
        for c, b in question.items():
            if c <= self.dimension:
                total[c - 1] += b
            else:
                total = [x + b * y for x, y in zip(total, self._solved[c], strict=True)]
        return next((j for j, x in enumerate(total) if x), None)

    # ------------------------------------------------------------------ enclosures

    @cached_property
    def enclosure(self) -> StateEnclosure | None:
        """A state at rest with a random number for each component, enclosed; None if floats do not find one."""
        return _enclose(self.structure.graph, self.codes, self.dimension)

    def moves_enclosed(self, question: Combination) -> bool:
        """Tell whether a combination of rows is not 0 for the enclosed state, which proves that it is not 0."""
        q = self.enclosure
        if q is None:
            return False
        middle, radius = Fraction(0), Fraction(0)
        for c, b in question.items():
            if c <= self.dimension:
                middle += b * q.values[c - 1] / q.unit
            else:
                v = c - self.dimension - 1
                middle += b * q.middle[v]
                radius += abs(b) * q.radius[v]
        return abs(middle) > radius


# ---------------------------------------------------------------------- rows that the edges tell


def _follow(graph: SignedDigraph, codes: np.ndarray) -> np.ndarray:
    """Return the codes of followers that hear one camp only, through edges that all agree; the rest stay unknown."""
    n = graph.n_nodes
    follower = codes == UNKNOWN
    into = np.flatnonzero(follower[graph.target])
    source, target = graph.source[into], graph.target[into]
    sign = graph.sign[into].astype(np.int64)
    codes = spread(codes, source, target, sign)
    # A follower that hears anything else spoils itself and all that hear it.
    spoiled = np.unique(target[codes[target] != sign * codes[source]])
    if spoiled.size:
        codes[reached(n, source, target, spoiled)] = UNKNOWN
    return codes


def _number_rows(graph: SignedDigraph, codes: np.ndarray, dimension: int) -> np.ndarray:
    """Return numbers of rows: agents whose news come through one agent, and with one sign, share its number.

    Agents that stand for themselves keep the numbers of their own rows. Given these rows, those of all others are the
    only solution of their equations, which a common number satisfies: so it is theirs.
    """
    unknown = codes == UNKNOWN
    into = np.flatnonzero(unknown[graph.target])
    source, target = graph.source[into], graph.target[into]
    sign = graph.sign[into].astype(np.int64)
    own_numbers = dimension + 1 + np.arange(graph.n_nodes)
    alone = np.zeros(graph.n_nodes, dtype=bool)
    for _ in range(_ROUNDS):
        free = ~alone[target]
        edges = source[free], target[free], sign[free]
        numbers = spread(np.where(alone, own_numbers, codes), *edges)
        spoiled = numbers[edges[1]] != edges[2] * numbers[edges[0]]
        if not spoiled.any():
            return numbers
        alone[edges[1][spoiled]] = True
    return np.where(unknown, own_numbers, codes)


def _proportional_rows(graph: SignedDigraph, other: SignedDigraph) -> np.ndarray:
    """(n,) bool array: agents who hear the same agents in both graphs, with the same signs and in the same shares."""
    n = graph.n_nodes
    alike = np.zeros(n, dtype=bool)
    degrees = [np.bincount(g.target, minlength=n) for g in (graph, other)]
    alike[(degrees[0] == degrees[1]) & (degrees[0] > 0)] = True
    edges = [np.flatnonzero(alike[g.target]) for g in (graph, other)]  # in one order, by target and source
    target = graph.target[edges[0]]
    same = (graph.source[edges[0]] == other.source[edges[1]]) & (graph.sign[edges[0]] == other.sign[edges[1]])
    first = np.searchsorted(target, target)
    sizes = [_exact_sizes(g, some) for g, some in zip((graph, other), edges, strict=True)]
    same &= np.asarray(sizes[0] * sizes[1][first] == sizes[1] * sizes[0][first], dtype=bool)
    alike[target[~same]] = False
    return alike


def spread(codes: np.ndarray, source: np.ndarray, target: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return the codes with those of agents of which they are unknown taken from one that they hear, breadth first.

    Examples
    --------
    >>> spread(np.array([5, UNKNOWN, 2]), np.array([0, 2]), np.array([1, 1]), np.array([-1, 1])).tolist()
    [5, -5, 2]
    """
    codes = codes.copy()
    for layer, edges in _layers(codes.size, source, target, np.flatnonzero(codes != UNKNOWN)):
        codes[layer] = sign[edges] * codes[source[edges]]
    return codes


def _layers(
    n: int, source: np.ndarray, target: np.ndarray, first: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the followers breadth first, layer by layer, each with an edge that it hears an earlier node by."""
    order = np.argsort(source, kind="stable")
    start = np.searchsorted(source[order], np.arange(n + 1))
    seen = np.zeros(n, dtype=bool)
    seen[first] = True
    front = first
    while front.size:
        counts = start[front + 1] - start[front]
        where = np.repeat(start[front] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts) + np.arange(
            counts.sum()
        )
        edges = order[where]
        edges = edges[~seen[target[edges]]]
        front, which = np.unique(target[edges], return_index=True)
        seen[front] = True
        if front.size:
            yield front, edges[which]


def reached(n: int, source: np.ndarray, target: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the nodes that news from ``first`` reaches, these included.

    Examples
    --------
    >>> reached(4, np.array([0, 1]), np.array([1, 2]), np.array([1])).tolist()
    [1, 2]
    """
    from scipy import sparse
    from scipy.sparse.csgraph import breadth_first_order

    if not first.size:
        return np.zeros(0, dtype=np.int64)
    rows, columns = np.concatenate([source, np.full(first.size, n)]), np.concatenate([target, first])
    pattern = sparse.csr_array((np.ones(rows.size, dtype=np.int8), (rows, columns)), shape=(n + 1, n + 1))
    found = breadth_first_order(pattern, n, return_predecessors=False)
    return np.sort(found[found < n]).astype(np.int64)


# ---------------------------------------------------------------------- enclosures


def _enclose(graph: SignedDigraph, codes: np.ndarray, dimension: int) -> StateEnclosure | None:
    """Return an enclosed state at rest: floats propose middle and radius, integers prove them."""
    n, unknown = graph.n_nodes, codes == UNKNOWN
    draw = random.Random(0)
    values = tuple(draw.randint(1, _LARGEST) for _ in range(dimension))
    columns = np.where(unknown, 0, codes)
    state = np.sign(columns) * np.array([0, *values], dtype=np.int64)[np.abs(columns)]
    into = np.flatnonzero(unknown[graph.target])
    source, target = graph.source[into], graph.target[into]
    whole = _exact_sizes(graph, into)
    guess = _propose(n, source, target, graph.sign[into], graph.weights[into], state.astype(float), unknown)
    if guess is None:
        return None
    ones = int(1 / _UNIT)
    middle = np.array([s * ones for s in state.tolist()], dtype=object)
    steps = np.zeros(n, dtype=object)
    middle[unknown] = [round(x * ones) for x in guess[0].tolist()]
    steps[unknown] = [round(x * 2**20) for x in guess[1].tolist()]
    signs = graph.sign[into].astype(object)
    start = np.flatnonzero(np.diff(target, prepend=-1))  # edges ascend by target
    defect = np.add.reduceat(whole * (middle[target] - signs * middle[source]), start)
    margin = np.add.reduceat(whole * (steps[target] - steps[source]), start)
    if any(x <= 0 for x in margin) or any(x <= 0 for x in steps[unknown]):
        return None
    factor = max(-(-abs(r) // m) for r, m in zip(defect, margin, strict=True))
    return StateEnclosure(values, tuple(middle.tolist()), tuple((factor * steps).tolist()))


def _exact_sizes(graph: SignedDigraph, edges: np.ndarray) -> np.ndarray:
    """Return the sizes of weights, over one scale, as an array of exact objects."""
    table, _ = graph.weight_table()
    if table is not None and table.dtype == np.int64:
        return np.abs(table[edges]).astype(object)
    return np.array([abs(graph.exact_weight(e)) for e in edges.tolist()], dtype=object)


def _propose(
    n: int, source: np.ndarray, target: np.ndarray, sign: np.ndarray, weights: np.ndarray, state: np.ndarray, free: Any
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return floats: the state on ``free`` nodes, and expected numbers of steps until the others are reached."""
    from scipy import sparse

    from lmi.sparse_h_matrix import solve

    place = np.cumsum(free) - 1
    m = int(free.sum())
    sizes = np.abs(weights) / np.bincount(target, np.abs(weights), minlength=n)[target]
    inner = free[source]
    ends = place[target[inner]], place[source[inner]]
    pull = np.bincount(place[target[~inner]], (sizes * sign)[~inner] * state[source[~inner]], minlength=m)
    results = []
    for entries, right in (((sizes * sign)[inner], pull), (sizes[inner], np.ones(m))):
        matrix = sparse.csr_array(sparse.eye_array(m) - sparse.coo_array((entries, ends), shape=(m, m)))
        results.append(solve(matrix, right, np.ones(m), tolerance=1e-14))
    return (results[0], results[1]) if all(np.isfinite(r).all() for r in results) else None


def first_answer(
    kernel: Kernel, questions: Iterable[tuple[Any, Combination]]
) -> tuple[Any, int | None, Combination] | None:
    """Return the first question that the edges, an exact solve or an enclosure answers with "not 0".

    Parameters
    ----------
    kernel : Kernel
    questions : iterable of (name, combination)

    Returns
    -------
    (name, column, combination) or None
        ``column`` of the basis tells; None if it is the enclosed state. None instead of all: all are 0.

    Raises
    ------
    TooLarge
        No question is answered so, and one is open.
    """
    open_questions = []
    for name, question in questions:
        if not question:
            continue
        if (column := kernel.told_column(question)) is not None:
            return name, column, question
        open_questions.append((name, question))
    try:
        for name, question in open_questions:
            if (column := kernel.solved_column(question)) is not None:
                return name, column, question
    except TooLarge:
        for name, question in open_questions:
            if kernel.moves_enclosed(question):
                return name, None, question
        raise
    return None
