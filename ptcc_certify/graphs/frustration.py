"""How far a signed graph is from balance: bounds on its frustration index, with witnesses.

The *frustration index* ``F`` is the least number (or the least weight ``F_w``) of edges whose removal leaves a balanced
graph, that is, the least over all camps ``g`` of what disagrees with them:

    F_w = min_g sum { |w_kl| : w_kl g_k g_l < 0 }.

Any camps bound it from above. A *packing* of negative cycles bounds it from below: where every cycle ``C`` gets a share
``y_C >= 0`` so that no edge is used for more than it weighs, ``sum_{C: e in C} y_C <= w_e``, a set ``S`` whose removal
balances the graph meets every negative cycle, and

    w(S) >= sum_{e in S} sum_{C: e in C} y_C >= sum_C y_C.

Camps are improved by tabu search; cycles and shares come from a linear program whose columns are shortest paths from
``(k, +)`` to ``(k, -)`` in the double cover of the graph. That is floating point, and proves nothing: what is returned
is counted in integers, cycle by cycle.

An undirected graph is counted by its pairs, every other one by its arcs. Arcs of one pair and one sign disagree with
camps together, so that they are one *tie* here.
"""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from lmi.exact.decimal_rounding import counted, down, up
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.packed_weights import ReadOnly
from ptcc_certify.graphs.structure import analyse, find_camps

#: The ties of a cycle, one after the other.
Cycle = tuple[int, ...]
#: Steps of tabu search per node.
_STEPS = 30
#: By how much a cycle must be shorter than 1 to be new, and the length of a tie that costs nothing.
_SHORTER, _STEP = 1e-6, 1e-9
#: Nodes from which shortest paths are found at once, and new cycles after which the linear program is solved again.
_BATCH, _NEW_CYCLES = 64, 2000
#: Shares are rounded to fractions of so small a denominator, of the unit in which all weights are integers.
_DENOMINATOR = 60
#: Bits of the common denominator of all weights: more than those of all floats.
_SCALE_BITS = 4000


@dataclass(frozen=True)
class NegativeCycle:
    """A negative cycle of the underlying undirected multigraph, with its share in a packing.

    Attributes
    ----------
    nodes : tuple of int
        The nodes in their order; the last one is followed by the first.
    signs : tuple of +1/-1
        Of the tie from each node to the next one; their product is -1.
    share : Fraction
        ``y_C``, in the unit of what is counted.

    References
    ----------
    Cartwright, Harary, Structural balance: a generalization of Heider's theory, Psychol. Rev. 63 (1956).

    Examples
    --------
    >>> from ptcc_certify.graphs.frustration import NegativeCycle, frustration_index
    >>> frustration_index([("a", "b", 1), ("b", "a", -1)]).cycles
    (NegativeCycle(nodes=(0, 1), signs=(1, -1), share=Fraction(1, 1)),)
    """

    nodes: tuple[int, ...]
    signs: tuple[int, ...]
    share: Fraction


@dataclass(frozen=True, eq=False, repr=False)
class FrustrationIndex(ReadOnly):
    """Bounds on the frustration index of a graph, each with its witness; made by :func:`frustration_index`.

    Attributes
    ----------
    graph : SignedDigraph
    by : {"count", "weight"}
        Whether edges are counted or weighed.
    undirected : bool
        Whether pairs are counted, not arcs.
    lower, upper : Fraction
        ``lower <= F <= upper``, proved. The sum of all shares is at most ``lower``: ``F`` is a multiple of the largest
        unit of which all weights are multiples, so that the sum is rounded up to one.
    camps : (N,) int8 array
        +1 or -1; what disagrees with them makes ``upper``.
    edges : tuple of int
        Numbers of the edges of the graph that disagree with the camps: both of an undirected pair.
    cycles : tuple of NegativeCycle
        The packing that makes ``lower``.
    reported : bool
        HiGHS reports ``upper`` as the optimum of an integer program. This is not proved, unless ``exact``.

    References
    ----------
    Zaslavsky, Balanced decompositions of a signed graph, J. Combin. Theory Ser. B 43 (1987).

    Examples
    --------
    >>> from ptcc_certify.graphs.frustration import FrustrationIndex, frustration_index
    >>> F = frustration_index([("a", "b", 1), ("b", "c", 1), ("c", "a", -2)])
    >>> isinstance(F, FrustrationIndex), F.exact, len(F.edges)
    (True, True, 1)
    """

    graph: SignedDigraph
    by: Literal["count", "weight"]
    undirected: bool
    lower: Fraction
    upper: Fraction
    camps: np.ndarray
    edges: tuple[int, ...]
    cycles: tuple[NegativeCycle, ...]
    reported: bool

    def __post_init__(self) -> None:
        self.lock()

    @property
    def exact(self) -> bool:
        """Whether the two bounds are equal."""
        return self.lower == self.upper

    @property
    def total(self) -> Fraction:
        """What all edges count or weigh together."""
        ties = _Ties(self.graph, self.by, self.undirected)
        return Fraction(sum(ties.weight.tolist()), ties.scale)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold: numbers as exact texts, nodes by their labels.

        Examples
        --------
        >>> from ptcc_certify.graphs.frustration import frustration_index
        >>> frustration_index([("a", "b", 1), ("b", "a", -1)]).to_dict()["cycles"]
        [{'nodes': ['a', 'b'], 'signs': [1, -1], 'share': '1'}]
        """
        labels = self.graph.labels
        cycles = [
            {"nodes": [labels[k] for k in cycle.nodes], "signs": list(cycle.signs), "share": str(cycle.share)}
            for cycle in self.cycles
        ]
        return {
            "by": self.by,
            "undirected": self.undirected,
            "lower": str(self.lower),
            "upper": str(self.upper),
            "exact": self.exact,
            "reported": self.reported,
            "camps": dict(zip(labels, self.camps.tolist(), strict=True)),
            "edges": self._rows(),
            "cycles": cycles,
        }

    def to_csv(self) -> str:
        """Return CSV ``source,target,weight``, one row for each edge that disagrees with the camps.

        Examples
        --------
        >>> from ptcc_certify.graphs.frustration import frustration_index
        >>> print(frustration_index([("a", "b", 1), ("b", "a", "-0.5")], by="weight").to_csv(), end="")
        source,target,weight
        b,a,-1/2
        """
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([("source", "target", "weight"), *self._rows()])
        return text.getvalue()

    def _rows(self) -> list[list[str]]:
        graph, texts = self.graph, self.graph.weight_texts
        return [[graph.labels[graph.source[e]], graph.labels[graph.target[e]], texts[e]] for e in self.edges]

    def __repr__(self) -> str:
        value = str(self.lower) if self.exact else f"from {down(self.lower)} to {up(self.upper)}"
        what = "pairs" if self.undirected else "arcs"
        found = f"{counted(len(self.edges), 'edge')} to remove, {counted(len(self.cycles), 'negative cycle')}"
        return f"FrustrationIndex({value}, by {self.by} of {what}; {found})"


def frustration_index(
    graph: Any, by: Literal["count", "weight"] = "count", time_limit: float = 30.0, orientation: str | None = None
) -> FrustrationIndex:
    r"""Bound the frustration index, the distance from balance: ``F = min_g sum { 1 : w_kl g_k g_l < 0 }``.

    Parameters
    ----------
    graph : graph-like
        Whatever :func:`ptcc_certify.as_graph` takes. Of one group: ``graph.subgraph(nodes)``.
    by : {"count", "weight"}
        Count edges, or sum up the sizes of their weights. Pairs if the graph is undirected (``w_kl = w_lk`` for all
        pairs), else arcs.
    time_limit : float
        Seconds for the searches, nearly: what they found by then is returned.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    FrustrationIndex
        Both bounds are proved: they are sums of rationals. How near they are to each other is up to searches in
        floating point.

    Raises
    ------
    ParameterError
        ``by`` is something else, the time limit is not positive, or the common denominator of the weights is too long.

    References
    ----------
    Harary, On the measurement of structural balance, Behavioral Science 4 (1959).
    Aref, Wilson, Balance and frustration in signed networks, J. Complex Networks 7 (2019).

    Examples
    --------
    >>> from ptcc_certify.graphs.frustration import frustration_index
    >>> frustration_index("highland_tribes")
    FrustrationIndex(7, by count of pairs; 14 edges to remove, 7 negative cycles)
    """
    if by not in ("count", "weight"):
        raise ParameterError("by", f'= {by!r}: give "count" or "weight"')
    if not time_limit > 0:
        raise ParameterError("time_limit", f"= {time_limit!r}: seconds must be positive")
    structure = analyse(graph, orientation)
    ties = _Ties(structure.graph, by, structure.undirected)
    end = time.monotonic() + time_limit
    search = _Search(ties, end)
    if structure.gauge is not None:
        search.camps = structure.gauge
    elif ties.weight.size:
        search.run()
    camps, shares = search.camps, search.shares
    source, target = structure.graph.source, structure.graph.target
    spoiling = np.flatnonzero(structure.graph.sign * camps[source] * camps[target] < 0)
    return FrustrationIndex(
        graph=structure.graph,
        by=by,
        undirected=structure.undirected,
        lower=Fraction(ties.bound_of(shares), ties.scale),
        upper=Fraction(ties.disagreement(camps), ties.scale),
        camps=camps,
        edges=tuple(spoiling.tolist()),
        cycles=tuple(ties.cycle(walk, share) for walk, share in shares.items()),
        reported=search.reported,
    )


class _Ties:
    """The ties of a graph, that is pair and sign, with weights that are integers over one scale."""

    def __init__(self, graph: SignedDigraph, by: str, undirected: bool):
        self.n = n = graph.n_nodes
        low, high = np.minimum(graph.source, graph.target), np.maximum(graph.source, graph.target)
        self.keys, which = np.unique(2 * (low * n + high) + (graph.sign < 0), return_inverse=True)
        self.low, self.high = np.divmod(self.keys // 2, n)
        self.sign = np.where(self.keys % 2, -1, 1).astype(np.int8)
        sizes = [Fraction(1)] * len(which)
        if by == "weight":
            sizes = [abs(graph.exact_weight(edge)) for edge in range(len(which))]
        self.scale = 1
        for denominator in {size.denominator for size in sizes}:
            self.scale = math.lcm(self.scale, denominator)
            if self.scale.bit_length() > _SCALE_BITS:
                mend = f'have no common denominator of {_SCALE_BITS} bits; round them, or give "count"'
                raise ParameterError("by", f'= "weight": the weights {mend}')
        weight = [0] * len(self.keys)
        for tie, size in zip(which.tolist(), sizes, strict=True):
            weight[tie] += int(size * self.scale)
        if undirected:
            weight = [both // 2 for both in weight]
        self.weight = np.array(weight, dtype=object)

    def against(self, camps: np.ndarray) -> np.ndarray:
        """Return the ties that disagree with camps."""
        return np.flatnonzero(self.sign * camps[self.low] * camps[self.high] < 0)

    def disagreement(self, camps: np.ndarray) -> int:
        return sum(self.weight[self.against(camps)].tolist())

    def bound_of(self, shares: dict[Cycle, Fraction]) -> int:
        """Return what a packing proves, after checking that each cycle is negative, and that no tie is overused."""
        used = dict.fromkeys(range(len(self.weight)), Fraction(0))
        for ties, share in shares.items():
            self.cycle(ties, share)
            for tie in ties:
                used[tie] += share
        if not all(used[tie] <= weight for tie, weight in enumerate(self.weight)) or any(
            y < 0 for y in shares.values()
        ):
            raise ArithmeticError("a packing of negative cycles uses a tie for more than it weighs")
        return math.ceil(sum(shares.values(), Fraction(0)))

    def cycle(self, ties: Sequence[int], share: Fraction) -> NegativeCycle:
        """Return the cycle that runs through ties in their order, which must close and be negative."""
        ends = [(int(self.low[tie]), int(self.high[tie])) for tie in ties]
        if len(ends) < 2:
            raise ArithmeticError("a cycle has at least two ties")
        begin = ends[0][0] if ends[0][1] in ends[1] else ends[0][1]
        nodes = [begin]
        for low, high in ends:
            if nodes[-1] not in (low, high):
                raise ArithmeticError("the ties of a cycle do not meet")
            nodes.append(low + high - nodes[-1])
        signs = tuple(self.sign[list(ties)].tolist())
        if nodes.pop() != begin or math.prod(signs) != -1:
            raise ArithmeticError("a cycle does not close, or is positive")
        return NegativeCycle(tuple(nodes), signs, share / self.scale)


class _Search:
    """The searches for camps and for a packing of negative cycles, in floats; shares are in units of the ties."""

    def __init__(self, ties: _Ties, end: float):
        self.ties, self.end, self.random = ties, end, np.random.default_rng(0)
        self.limit = end - time.monotonic()
        self.camps = np.ones(ties.n, dtype=np.int8)
        self.shares: dict[Cycle, Fraction] = {}
        self.reported = False
        self.cycles: dict[Cycle, None] = {}

    def run(self) -> None:
        ties = self.ties
        self.camps = find_camps(ties.n, ties.low, ties.high, ties.sign)[0]
        self._improve_camps(self.end - 0.7 * (self.end - time.monotonic()))
        upper, number = ties.disagreement(self.camps), self.ties.against(self.camps).size
        self.unit = Fraction(upper, number)  # no tie of a packing is used for more than F, so that larger ones are as F
        self.cost = np.array([float(Fraction(min(weight, upper)) / self.unit) for weight in ties.weight])
        self._disjoint_cycles()
        if self._pack() and not self._met():
            self._integer_program()

    def _left(self) -> float:
        return self.end - time.monotonic()

    def _improve_camps(self, end: float) -> None:
        """Turn single nodes over, the best of those that were not turned of late (tabu search)."""
        from scipy import sparse

        ties, n = self.ties, self.ties.n
        largest = max(self.ties.weight)
        weight = np.array([float(Fraction(w, largest)) for w in ties.weight]) * ties.sign
        ends = np.concatenate([ties.low, ties.high]), np.concatenate([ties.high, ties.low])
        matrix = sparse.csr_array((np.concatenate([weight, weight]), ends), shape=(n, n))
        camps = self.camps.astype(float)
        gain = camps * (matrix @ camps)  # what agrees at a node, less what disagrees
        free_at, change, least = np.zeros(n, dtype=np.int64), 0.0, 0.0
        best = camps.copy()
        for step in range(_STEPS * n + 1000):
            if step % 100 == 0 and time.monotonic() > end:
                break
            node = int(np.argmin(np.where(free_at <= step, gain, np.inf)))
            change += gain[node]
            row = slice(matrix.indptr[node], matrix.indptr[node + 1])
            heard = matrix.indices[row]
            gain[heard] -= 2 * camps[node] * matrix.data[row] * camps[heard]
            camps[node], gain[node] = -camps[node], -gain[node]
            free_at[node] = step + 1 + min(n // 4, 10) + self.random.integers(min(n // 4, 10) + 1)
            if change < least - 1e-12:
                least, best = change, camps.copy()
        self._offer(best)

    def _offer(self, camps: np.ndarray) -> None:
        """Keep camps if they are better; the first node gets +1."""
        camps = (camps * camps[0]).astype(np.int8)
        if self.ties.disagreement(camps) < self.ties.disagreement(self.camps):
            self.camps = camps

    def _met(self) -> bool:
        return self.ties.bound_of(self.shares) >= self.ties.disagreement(self.camps)

    def _pack(self) -> bool:
        """Improve the packing by linear programs as long as new cycles promise to; tell whether none does any more."""
        from scipy.optimize import linprog

        lengths = np.zeros(self.cost.size)
        while self._left() > 0 and not self._met():
            if self.cycles:
                rows = self._rows()
                limits = {"time_limit": self._left()}
                answer = linprog(self.cost, -rows, -np.ones(rows.shape[0]), options=limits)
                if answer.status != 0:
                    return False
                lengths, shares = np.maximum(answer.x, 0), -answer.ineqlin.marginals
                wish = {
                    cycle: (Fraction(share) * self.unit).limit_denominator(_DENOMINATOR)
                    for cycle, share in zip(self.cycles, shares.tolist(), strict=True)
                    if share > 0
                }
                self._keep(dict(sorted(wish.items(), key=lambda item: -item[1])))
            if not self._new_cycles(lengths):
                return self._left() > 0
        return False

    def _disjoint_cycles(self) -> None:
        """Find negative cycles of one tie that disagrees, the shortest ones that earlier ones leave room for."""
        import networkx as nx

        ties, left = self.ties, self.ties.weight.tolist()
        against = self.random.permutation(ties.against(self.camps)).tolist()
        agreeing = nx.Graph()
        agreeing.add_nodes_from(range(ties.n))
        for tie in np.setdiff1d(np.arange(len(left)), against).tolist():
            agreeing.add_edge(int(ties.low[tie]), int(ties.high[tie]), tie=tie)
        for longest in (1, 2, 3, ties.n):
            for tie in against:
                while left[tie] and self._left() > 0.5 * self.limit:
                    try:
                        path = nx.bidirectional_shortest_path(agreeing, int(ties.low[tie]), int(ties.high[tie]))
                    except nx.NetworkXNoPath:
                        break
                    if len(path) - 1 > longest:
                        break
                    steps = list(pairwise(path))
                    cycle = self._from_least([tie, *(agreeing.edges[step]["tie"] for step in reversed(steps))])
                    share = min(left[used] for used in cycle)
                    self.cycles[cycle] = None
                    for used in cycle:
                        left[used] -= share
                    agreeing.remove_edges_from([step for step in steps if not left[agreeing.edges[step]["tie"]]])
        self._keep(dict.fromkeys(self.cycles, Fraction(0)))

    def _rows(self) -> Any:
        """Return the (cycles, ties) matrix that tells which cycle runs through which tie."""
        from scipy import sparse

        sizes = [len(cycle) for cycle in self.cycles]
        which = np.concatenate([np.array(cycle) for cycle in self.cycles])
        rows = np.repeat(np.arange(len(sizes)), sizes)
        return sparse.csr_array((np.ones(which.size), (rows, which)), shape=(len(sizes), self.cost.size))

    def _keep(self, wish: dict[Cycle, Fraction]) -> None:
        """Give cycles the shares that are wished for as far as ties allow, then what is left; keep what is best."""
        left, shares = self.ties.weight.tolist(), dict.fromkeys(wish, Fraction(0))
        for most in (wish, dict.fromkeys(wish, math.inf)):
            for cycle, wished in most.items():
                share = min(wished, *(left[tie] for tie in cycle))
                if share > 0:
                    shares[cycle] += share
                    for tie in cycle:
                        left[tie] -= share
        shares = {cycle: Fraction(share) for cycle, share in shares.items() if share}
        if sum(shares.values()) > sum(self.shares.values()):
            self.shares = shares

    def _new_cycles(self, lengths: np.ndarray) -> int:
        """Add negative cycles shorter than 1, through ends of ties that disagree, which all have; return how many."""
        from scipy import sparse
        from scipy.sparse.csgraph import dijkstra

        ties, n, found = self.ties, self.ties.n, 0
        sources = self.random.permutation(np.unique(ties.low[ties.against(self.camps)]))
        across = np.where(ties.sign < 0, n, 0)
        heads = np.concatenate([ties.low, ties.low + n, ties.high + across, ties.high + n - across])
        tails = np.concatenate([ties.high + across, ties.high + n - across, ties.low, ties.low + n])
        search_lengths = lengths.copy()
        for begin in range(0, sources.size, _BATCH):
            if self._left() <= 0 or found >= _NEW_CYCLES:
                break
            cover = sparse.csr_array((np.tile(search_lengths + _STEP, 4), (heads, tails)), shape=(2 * n, 2 * n))
            batch = sources[begin : begin + _BATCH]
            _, before = dijkstra(cover, indices=batch, return_predecessors=True, limit=1.0)
            for source, row in zip(batch.tolist(), before, strict=True):
                if row[source + n] < 0:
                    continue
                cycle = self._simple(self._walk(row, source))
                if lengths[list(cycle)].sum() < 1 - _SHORTER and cycle not in self.cycles:
                    self.cycles[cycle] = None
                    found += 1
                    search_lengths[list(cycle)] += 1 / len(cycle)  # so that others are found next
        return found

    def _walk(self, before: np.ndarray, source: int) -> Iterator[tuple[int, int, int]]:
        """Walk back from ``(source, -)`` to ``(source, +)`` in the double cover: node, next node, tie."""
        n, here = self.ties.n, source + self.ties.n
        while here != source:
            there = int(before[here])
            low, high = sorted((here % n, there % n))
            key = 2 * (low * n + high) + ((here < n) != (there < n))
            yield here % n, there % n, int(np.searchsorted(self.ties.keys, key))
            here = there

    def _simple(self, walk: Iterable[tuple[int, int, int]]) -> Cycle:
        """Return a negative cycle of a negative closed walk, the same tuple for the same cycle."""
        nodes, path = list[int](), list[int]()
        for node, following, tie in walk:
            nodes.append(node)
            path.append(tie)
            if following in nodes:
                begin = nodes.index(following)
                if math.prod(self.ties.sign[path[begin:]].tolist()) < 0:
                    path = path[begin:]
                    break
                del nodes[begin:], path[begin:]
        return self._from_least(path)

    @staticmethod
    def _from_least(path: list[int]) -> Cycle:
        """Return the ties of a cycle from the least one on, towards the smaller of its neighbours."""
        first = path.index(min(path))
        path = path[first:] + path[:first]
        return tuple(path if len(path) < 3 or path[1] < path[-1] else [path[0], *reversed(path[1:])])

    def _integer_program(self) -> None:
        """Ask HiGHS for the least set of ties that meets all cycles seen, and see more, until it leaves none."""
        from scipy.optimize import LinearConstraint, milp

        while self._left() > 0:
            options = {"time_limit": self._left(), "mip_rel_gap": 0.0}
            meets = LinearConstraint(self._rows(), lb=1)
            answer = milp(self.cost, constraints=meets, integrality=1, bounds=(0, 1), options=options)
            if answer.status != 0:
                return
            removed = answer.x > 0.5
            kept, ties = ~removed, self.ties
            if not self._new_cycles(removed.astype(float)):
                self._offer(find_camps(ties.n, ties.low[kept], ties.high[kept], ties.sign[kept])[0])
                self.reported = self._left() > 0
                return
