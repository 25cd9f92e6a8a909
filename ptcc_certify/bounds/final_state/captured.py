"""Who is dangerous: how far captured agents move where the others end.

A captured agent hears nobody and shows what it likes within ``[-R, R]``; the others keep their rules. It leads by
itself then, and where it shows a constant the others end at ``X_k = X0_k + sum_a h_ka x_a``, at ``X0`` where it shows
0. With ``S`` all nodes outside balanced closed components, of a single captured agent

    h_S = L_SS^-1 e_a / (L_SS^-1)_aa                     for a in S, 0 elsewhere;
    h_C = g g_a,      h_S = -L_SS^-1 L_SC g g_a          for a in a balanced closed component C with camps g,

so that one matrix serves all agents. Several captured agents lead in the graph in which all of them hear nobody.
Constants move ``X_k`` by at most ``R sum_a |h_ka|``, which is reached. Signals that vary move ``x_k`` by

    J_k = R sum_a int_0^inf |(e^(-L_F' s) L_F'a)_k| ds   <=   R (M(L_F')^-1 |L_F'A| 1)_k

and no less than constants, with F' who follows then and A who is captured. The bound is what constants do in the graph
of ``|w_kl|``, and ``J_k`` itself where the walks from each of A to k have one sign.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.search_time import checkpoint
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.labels import place_of
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.size_limits import EXACT_NODES, RANKED_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.model.parameters import parameter
from ptcc_certify.theorems.lemmas import solve_exact

Number = Fraction | float
Effects = Iterator[tuple[int, np.ndarray]]
Solver = Callable[[np.ndarray], np.ndarray]
#: Columns that are solved for at once in floats.
_COLUMNS = 256
#: What ``|h|`` in floats may be: it is 1 at most.
_ONE = 1 + 1e-6


@dataclass(frozen=True)
class Captured:
    """How far captured agents move where each of the others ends; made by :meth:`Influence.captured`.

    Attributes
    ----------
    agents : tuple of str
        Who is captured.
    radius : Fraction
        ``R``, in the unit of the states: what they show stays within ``[-R, R]``.
    weights : dict of str to dict of str to Fraction or float
        ``h_ka`` of each other agent k, by captured agent a; absolute values sum to at most 1.
    constant : dict of str to Fraction or float
        ``R sum_a |h_ka|``: by how much constants move the final state of k to either side, reached.
    varying : dict of str to Fraction or float
        ``R (M(L_F')^-1 |L_F'A| 1)_k``: by how much signals that vary may move ``x_k``, at any time, at most.
    exact : bool
        Whether the numbers are rationals; otherwise they are numerical.

    References
    ----------
    Lemmas 8 and 9 of [Zhu]_ for the graph in which the captured agents hear nobody.

    Examples
    --------
    >>> from ptcc_certify import influence
    >>> taken = influence([("a", "b", 1), ("a", "c", 1), ("b", "c", -1), ("c", "b", -2)]).captured("a")
    >>> taken.constant["b"], taken.varying["b"]
    (Fraction(0, 1), Fraction(1, 1))
    """

    agents: tuple[str, ...]
    radius: Fraction
    weights: dict[str, dict[str, Number]]
    constant: dict[str, Number]
    varying: dict[str, Number]
    exact: bool

    def to_csv(self) -> str:
        """Return CSV ``node,constant,varying``, in floats, one row per agent that is not captured.

        Examples
        --------
        >>> from ptcc_certify import influence
        >>> print(influence([("a", "c", 1), ("b", "c", -3)]).captured("b", radius=2).to_csv(), end="")
        node,constant,varying
        a,0.0,0.0
        c,1.5,1.5
        """
        return _csv(("node", "constant", "varying"), [(k, x, self.varying[k]) for k, x in self.constant.items()])


@dataclass(frozen=True)
class Reach:
    """How far one agent moves where the others end if it alone is captured; made by :meth:`Influence.ranking`.

    Attributes
    ----------
    agent, moved_most : str
        Who is captured, and the first of those that it moves farthest.
    total : Fraction or float
        ``R sum_k |h_ka|`` over the others, for constants.
    largest : Fraction or float
        ``R max_k |h_ka|``, likewise.
    varying : Fraction or float
        ``R sum_k (M(L_F')^-1 |L_F'a|)_k``: at most so much in all for signals that vary.

    References
    ----------
    Lemmas 8 and 9 of [Zhu]_ for the graph in which the captured agent hears nobody.

    Examples
    --------
    >>> from ptcc_certify import influence
    >>> worst = influence([("a", "c", 1), ("b", "c", -3)]).ranking()[0]
    >>> isinstance(worst, Reach), worst.agent, worst.moved_most, worst.total
    (True, 'b', 'c', Fraction(3, 4))
    """

    agent: str
    moved_most: str
    total: Number
    largest: Number
    varying: Number


def captured(structure: Structure, agents: Sequence[int | str], radius: Any, exact: bool) -> Captured:
    """Compute how far captured agents move the others: see :meth:`Influence.captured`.

    Examples
    --------
    >>> captured(analyse([("a", "b", 1), ("b", "a", -1), ("b", "c", 3)]), ["b"], 1, True).weights
    {'a': {'b': Fraction(-1, 1)}, 'c': {'b': Fraction(1, 1)}}
    """
    graph, radius = structure.graph, parameter("radius", radius)
    chosen = sorted({place_of(agent, graph.labels) for agent in agents})
    if not 0 < len(chosen) < graph.n_nodes:
        what = "every agent is captured" if chosen else "no agent is captured"
        raise ParameterError(f"{what}; name some of the {graph.n_nodes}, so that others are left to be moved")
    heard = np.isin(graph.target, chosen)
    deaf = graph.without_edges(*zip(graph.source[heard].tolist(), graph.target[heard].tolist(), strict=True))
    moves, bounds = (dict(_effects(analyse(g), exact, chosen)) for g in (deaf, _absolute(deaf)))
    others = [(k, label) for k, label in enumerate(graph.labels) if k not in moves]
    weights = {label: {graph.labels[a]: moves[a][k] for a in chosen} for k, label in others}
    constant = {label: _scaled(radius, sum(map(abs, row.values())), exact) for label, row in weights.items()}
    varying = {label: _scaled(radius, sum(bounds[a][k] for a in chosen), exact) for k, label in others}
    return Captured(tuple(graph.labels[a] for a in chosen), radius, weights, constant, varying, exact)


def ranking(structure: Structure, radius: Any, exact: bool) -> list[Reach]:
    """Rank all agents by how far each moves the others: see :meth:`Influence.ranking`.

    Examples
    --------
    >>> [(row.agent, row.total) for row in ranking(analyse([("a", "b", 1), ("b", "c", -2), ("a", "c", 1)]), 1, True)]
    [('a', Fraction(4, 3)), ('b', Fraction(2, 3)), ('c', Fraction(0, 1))]
    """
    graph, radius, n = structure.graph, parameter("radius", radius), structure.graph.n_nodes
    if n == 1:
        raise ParameterError("a single agent has no others to move; give a graph of two agents or more")
    if n > RANKED_NODES:
        what = f"agents are ranked one by one up to {RANKED_NODES:,}, and these are {n:,}"
        raise ParameterError(f"{what}; ask how far single ones move the others")
    positive = _absolute(graph) if structure.gauge is None else None  # of camps all agree on, constants do the worst
    varying = {} if positive is None else {a: h.sum() - 1 for a, h in _effects(analyse(positive), exact)}
    found = dict[int, Reach]()
    for a, h in _effects(structure, exact):
        h[a] = 0
        most = int(np.argmax(abs(h))) if h.any() else int(a == 0)
        total = abs(h).sum()
        moves = (_scaled(radius, x, exact) for x in (total, abs(h[most]), varying.get(a, total)))
        found[a] = Reach(graph.labels[a], graph.labels[most], *moves)
    return sorted((found[a] for a in range(n)), key=lambda reach: -reach.total)


def ranking_csv(ranked: Sequence[Reach]) -> str:
    """Return a ranking as CSV ``agent,moved_most,total,largest,varying``, in floats.

    Examples
    --------
    >>> print(ranking_csv([Reach("a", "b", Fraction(3, 2), Fraction(1), Fraction(2))]), end="")
    agent,moved_most,total,largest,varying
    a,b,1.5,1.0,2.0
    """
    return _csv([field.name for field in fields(Reach)], [list(vars(row).values()) for row in ranked])


def _effects(structure: Structure, exact: bool, agents: Iterable[int] | None = None) -> Effects:
    """Yield agents, by default all, in any order, each with its ``h`` (N,), 1 at itself, if it alone is captured."""
    graph, n = structure.graph, structure.graph.n_nodes
    L = np.array(graph.exact_laplacian(), dtype=object) if exact else graph.laplacian().tocsr()
    number = Fraction if exact else float
    balanced = [c for c in structure.closed_components if c.balanced]
    groups = [(list(c.nodes), np.array([number(g) for g in c.gauge or ()], dtype=L.dtype)) for c in balanced]
    group_of = {v: k for k, (nodes, _) in enumerate(groups) for v in nodes}
    S = [v for v in range(n) if v not in group_of]
    place = {v: i for i, v in enumerate(S)}
    columns: dict[tuple[bool, int], list[int]] = {}  # one for all members of a group
    for a in range(n) if agents is None else agents:
        columns.setdefault((a in group_of, group_of.get(a, a)), []).append(a)
    rows, keys = L[S], list(columns)
    solve = (_exact_solver if exact else _float_solver)(rows[:, S])
    step = len(keys) if exact else _COLUMNS
    for part in (keys[i : i + step] for i in range(0, len(keys), step)):
        checkpoint()
        right = np.zeros((len(S), len(part)), dtype=L.dtype)
        for column, (grouped, k) in enumerate(part):
            if grouped:
                right[:, column] = -(rows[:, groups[k][0]] @ groups[k][1])
            else:
                right[place[k], column] = 1
        solved = solve(right) if S else right
        for column, (grouped, k) in enumerate(part):
            h = np.array([number(0)] * n, dtype=L.dtype)
            h[S] = solved[:, column]
            if grouped:
                h[groups[k][0]] = groups[k][1]
            for a in columns[grouped, k]:
                with np.errstate(all="ignore"):
                    effect = h / h[a]
                if not exact and not abs(effect).max() <= _ONE:
                    mend = f"give weights of more even size, or at most {EXACT_NODES} agents"
                    raise ParameterError(f"captured agents: the equations are too ill-conditioned for floats; {mend}")
                yield a, effect


def _exact_solver(A: np.ndarray) -> Solver:
    return lambda B: np.array(solve_exact(A.tolist(), B.tolist()), dtype=object)


def _float_solver(A: Any) -> Solver:
    """Return what solves for columns: by a factor as soon as Krylov solves fail, whatever fills in, or NaN."""
    from lmi.sparse_h_matrix import Factor, solve_columns

    factor: Factor | None = None

    def solve(B: np.ndarray) -> np.ndarray:
        nonlocal factor
        solved = None if factor else solve_columns(A, B, A.diagonal())
        if solved is None and A.shape[0] <= RANKED_NODES:
            factor = factor or Factor(A)
            solved = np.column_stack([factor.solve(column) for column in B.T])
        return np.full(B.shape, np.nan) if solved is None else solved

    return solve


def _absolute(graph: SignedDigraph) -> SignedDigraph:
    """Return the graph of ``|w_kl|``."""
    sizes = Weights([abs(graph.exact_weight(edge)) for edge in range(graph.n_edges)])
    return SignedDigraph(graph.labels, graph.source, graph.target, sizes)


def _scaled(radius: Fraction, x: Any, exact: bool) -> Number:
    return radius * Fraction(x) if exact else float(radius) * float(x)


def _csv(head: Sequence[str], rows: Sequence[Sequence[str | Number]]) -> str:
    """Return CSV, numbers in floats."""
    text = io.StringIO()
    cells = ([x if isinstance(x, str) else float(x) for x in row] for row in rows)
    csv.writer(text, lineterminator="\n").writerows([head, *cells])
    return text.getvalue()
