"""Where the agents end: ``X(T) = Q X(0)``, exactly or in intervals; who decides whom.

``Q`` projects onto the kernel of ``L`` along its range. An unbalanced closed component goes to 0; a balanced one to
``G_k 1 c_k`` with ``c_k = eta_k' G_k X_Lk(0)``, ``eta_k' M(L_Lk) = 0``, ``eta_k' 1 = 1``; followers go to
``-L_F^-1 L_FL X_L(T)``.

In a large graph the final state is enclosed: leaders by left null vectors, followers by one solve.
With ``u > 0`` and ``M(L_F) u > 0``, any approximation ``y`` of the followers' end has

    |x_F - y|  <=  max_i((|r_i| + s_i) / (M(L_F) u)_i) u,      r = L_F y + L_FL x_L,

``s`` what the radii of the leaders add. The left null vector of a large leader group is enclosed in the same way.
Residuals are taken in floats with room for their rounding, or in rationals where that room is too wide; the check of
the certificate forms them exactly.
"""

from __future__ import annotations

import csv
import heapq
import io
import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.child_process import apart
from lmi.errors import LMIError
from lmi.search_time import checkpoint, processor_left, seconds_left
from lmi.sparse_h_matrix import SparseHMatrix, solve
from ptcc_certify.bounds.final_state.captured import Captured, Reach, captured, ranking
from ptcc_certify.errors import ParameterError, quoted
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_state
from ptcc_certify.graphs.labels import import_pandas, place_of, position, series
from ptcc_certify.graphs.rationals import nearest_float, writable
from ptcc_certify.graphs.structure import ClosedComponent, Structure, analyse
from ptcc_certify.theorems.lemmas import (
    EXACT_NODES,
    containment_weights,
    dyadic_left_vector,
    exact_containment_weights,
    exact_left_vector,
    left_vector,
)

if TYPE_CHECKING:
    import pandas as pd

Number = Fraction | float
#: Weights of followers on components are stored up to this number.
MANY_WEIGHTS = 1_000_000
#: Room for the rounding of a residual in floats, and the radius up to which it is narrow enough.
_ROUNDING, _NARROW = 1e-12, 4e-7
#: Residual of a witness in every row, relatively.
_LOOSE = 0.05
#: Room for the rounding of a radius, and of texts and floats of a middle.
_MORE, _ULP = 1 + 1e-6, 2.0**-52
#: Above what floats below the smallest normal one are off by.
_TINY = 1e-320
#: States below this size, or above its reciprocal, leave no room for radii in float64, and are taken in another unit.
_SMALLEST = Fraction(1, 10**290)
#: Bits of all weights from which on exact work may take long.
_MANY_DIGITS = 200_000


@dataclass(frozen=True, eq=False)
class Enclosure:
    """What is proved of ``Q`` in a large graph, and what proves it.

    Attributes
    ----------
    left_null_vectors : mapping of k to (middle, radius)
        Of those of ``Influence.balanced`` whose left null vectors are not rational.
    witness : (N,) array
        ``u > 0`` with ``M(L_F) u > 0``; 1 for leaders, but for those of ``left_null_vectors``.
    """

    left_null_vectors: dict[int, tuple[np.ndarray, np.ndarray]]
    witness: np.ndarray


@dataclass(frozen=True, repr=False)
class Influence:
    """Who decides whom: the nonzero rows of ``Q``, in factored form.

    Attributes
    ----------
    structure : Structure
    left_null_vectors : tuple of tuple
        For each balanced closed component the weights ``eta_k`` times gauge, in the order of its nodes: the
        component meets at ``c_k = sum left_null_vectors * X(0)`` times its gauge.
    containment_weights : tuple of tuple, or None
        For each follower, its weight on each balanced closed component (``varpi``; absolute sum at most 1). None where
        followers times components are more than ``MANY_WEIGHTS``, or no solve in floats converges.
    exact : bool
        Whether the numbers are rationals.
    enclosure : Enclosure or None
        What is proved where they are not.

    References
    ----------
    Lemmas 2, 8 and 9 of [Zhu]_.
    Altafini, Consensus problems on networks with antagonistic interactions, IEEE Trans. Automat. Control 58 (2013).

    Examples
    --------
    >>> who = influence(analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)])))
    >>> who.containment_weights, who.apply([Fraction(1), Fraction(0), Fraction(2)])[0][1]  # of a and b on c
    (((Fraction(1, 4), Fraction(-3, 4)),), Fraction(-5, 4))
    """

    structure: Structure
    left_null_vectors: tuple[tuple[Number, ...], ...]
    containment_weights: tuple[tuple[Number, ...], ...] | None
    exact: bool
    enclosure: Enclosure | None = field(default=None, compare=False)

    @cached_property
    def balanced(self) -> tuple[ClosedComponent, ...]:
        """The balanced closed components, to which ``left_null_vectors`` and ``containment_weights`` belong."""
        return tuple(c for c in self.structure.closed_components if c.balanced)

    @property
    def groups(self) -> Iterator[tuple[ClosedComponent, tuple[Number, ...]]]:
        """The balanced closed components with their ``left_null_vectors``."""
        return zip(self.balanced, self.left_null_vectors, strict=True)

    def row(self, node: int | str) -> dict[int, Number]:
        """Return the row of ``Q`` of one node as ``{leader index: weight}``.

        Parameters
        ----------
        node : int or str
            Its index, or its label if that is a text.

        Returns
        -------
        dict of int to Fraction or float
            Empty for a node that ends at 0 from every initial state.

        Raises
        ------
        UnknownAgentError
            There is no such node.

        Examples
        --------
        >>> who = influence(analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)])))
        >>> who.row(1), who.row("c") == who.row(1)
        ({0: Fraction(1, 4), 2: Fraction(-3, 4)}, True)
        """
        node = place_of(node, self.structure.graph.labels)
        where = np.flatnonzero(self.structure.followers == node)
        weights: Sequence[Number] = [dict(zip(c.nodes, c.gauge or (), strict=True)).get(node, 0) for c in self.balanced]
        if where.size:
            weights = self._weights_of(int(where[0]))
        result: dict[int, Number] = {}
        for (component, null_vector), weight in zip(self.groups, weights, strict=True):
            if weight:
                result.update({v: weight * w for v, w in zip(component.nodes, null_vector, strict=True)})
        return result

    def apply(self, x0: Sequence[Number]) -> tuple[list[Number], list[Number]]:
        """Return ``Q x0`` and the consensus values ``c_k`` of the balanced closed components.

        Parameters
        ----------
        x0 : sequence of N numbers
            Rational if ``exact``.

        Returns
        -------
        final_state : list of N numbers
        consensus_values : list of numbers
        """
        zero: Number = Fraction(0) if self.exact else 0.0
        values = [
            sum((w * x0[v] for v, w in zip(component.nodes, null_vector, strict=True)), zero)
            for component, null_vector in self.groups
        ]
        final: list[Number] = [zero] * self.structure.graph.n_nodes
        for component, value in zip(self.balanced, values, strict=True):
            for v, sign in zip(component.nodes, component.gauge or (), strict=True):
                final[v] = sign * value
        if self.containment_weights is None:
            state = np.array([float(x) for x in final])
            for v, x in zip(self.structure.followers.tolist(), follower_state(self.structure, state), strict=True):
                final[v] = float(x)
            return final, values
        for v, weights in zip(self.structure.followers.tolist(), self.containment_weights, strict=True):
            checkpoint()
            final[v] = sum((w * c for w, c in zip(weights, values, strict=True) if w), zero)
        return final, values

    def to_pandas(self) -> pd.DataFrame:
        """Return the weights, rounded to floats: one row per node, one column per leader that counts.

        A node's final state is the sum of its row times the leaders' initial states.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> influence([("a", "c", 1), ("b", "c", -3)]).to_pandas().loc["c"].to_dict()
        {'a': 0.25, 'b': -0.75}
        """
        pandas, labels = import_pandas(), np.array(self.structure.graph.labels, dtype=object)
        names = [pandas.Index(part, name=name) for part, name in ((labels, "node"), (labels[self._counted], "leader"))]
        table = np.zeros((labels.size, len(names[1])))
        place = {v: k for k, v in enumerate(self._counted)}
        for node in range(labels.size):
            for leader, weight in self.row(node).items():
                table[node, place[leader]] = float(weight)
        return pandas.DataFrame(table, index=names[0], columns=names[1])

    @cached_property
    def shares(self) -> np.ndarray:
        """The share of each of N nodes in where all end, ``sum_k |Q_kj| / sum_kl |Q_kl|``; all 0 if all end at 0.

        Raises
        ------
        ParameterError
            There are too many followers and leader groups for the weights of all.

        Examples
        --------
        >>> influence([("a", "c", 1), ("b", "c", -3)]).shares.round(3)
        array([0.417, 0.   , 0.583])
        """
        if self.containment_weights is None:
            raise ParameterError("there are too many followers and leader groups to tell every weight; ask row of one")
        shares, of_followers = np.zeros(self.structure.graph.n_nodes), np.zeros(len(self.balanced))
        for weights in self.containment_weights:
            of_followers += [abs(float(weight)) for weight in weights]
        for (component, null_vector), heard in zip(self.groups, of_followers, strict=True):
            sizes = np.array([abs(float(w)) for w in null_vector])
            shares[list(component.nodes)] = sizes * (len(component.nodes) + heard)
        total = float(shares.sum())
        return shares / total if total else shares

    def to_csv(self) -> str:
        """Return the weights that are not 0 as CSV ``node,leader,weight``, in floats, as spreadsheets take them.

        :meth:`row` has them as exact as they are known.

        Examples
        --------
        >>> print(influence([("a", "c", 1), ("b", "c", -3)]).to_csv(), end="")
        node,leader,weight
        a,a,1.0
        c,a,0.25
        c,b,-0.75
        b,b,1.0
        """
        labels, text = self.structure.graph.labels, io.StringIO()
        rows = (
            (label, labels[j], float(weight)) for k, label in enumerate(labels) for j, weight in self.row(k).items()
        )
        csv.writer(text, lineterminator="\n").writerows([("node", "leader", "weight"), *rows])
        return text.getvalue()

    def captured(self, *agents: int | str, radius: Any = 1) -> Captured:
        """Tell how far captured agents, which hear nobody and show what they like, move where the others end.

        Constants within ``[-R, R]`` move agent k by at most ``R sum_a |h_ka|`` to either side, which is reached;
        signals that vary by at most ``R (M(L_F')^-1 |L_F'A| 1)_k``. Exact where ``self`` is, otherwise numerical.

        Parameters
        ----------
        *agents : int or str
            Indices, or labels if these are texts.
        radius : Fraction, int, float or str
            ``R > 0``, in the unit of the states.

        Returns
        -------
        Captured

        Raises
        ------
        UnknownAgentError, ParameterError
            There is no such agent; nobody is captured, or everybody; the radius is not positive; floats do not do.

        Examples
        --------
        >>> influence([("a", "c", 1), ("b", "c", -3)]).captured("b", radius=2).constant
        {'a': Fraction(0, 1), 'c': Fraction(3, 2)}
        """
        return captured(self.structure, agents, radius, self.exact)

    def ranking(self, radius: Any = 1) -> list[Reach]:
        """Rank all agents by how far each, captured alone, moves where the others end: the most dangerous first.

        By ``R sum_k |h_ka|`` (see :meth:`captured`), of equals in the order of nodes.

        Parameters
        ----------
        radius : Fraction, int, float or str
            ``R > 0``, in the unit of the states.

        Returns
        -------
        list of N Reach

        Raises
        ------
        ParameterError
            There are more than 10,000 agents, or one; the radius is not positive; floats do not do.

        Examples
        --------
        >>> influence([("a", "c", 1), ("b", "c", -3)]).ranking()[0]
        Reach(agent='b', moved_most='c', total=Fraction(3, 4), largest=Fraction(3, 4), varying=Fraction(3, 4))
        """
        return ranking(self.structure, radius, self.exact)

    @property
    def _counted(self) -> list[int]:
        """Indices of the leaders in balanced groups."""
        return sorted(v for component in self.balanced for v in component.nodes)

    def __repr__(self) -> str:
        kind = "exact" if self.exact else "enclosed" if self.enclosure is not None else "in floats"
        leaders, groups = len(self._counted), len(self.balanced)
        return f"Influence({self.structure.graph.n_nodes} nodes, {leaders} leaders, {groups} balanced groups, {kind})"

    def _weights_of(self, follower: int) -> Sequence[Number]:
        """Return the weights of one follower, by one solve with the transposed block if they are not stored."""
        if self.containment_weights is not None:
            return self.containment_weights[follower]
        L, F = self.structure.graph.laplacian().tocsr(), self.structure.followers
        block, unit = L[F][:, F], np.zeros(F.size)
        unit[follower] = 1
        row = -(L[F].T @ solve(block.T.tocsr(), unit, block.diagonal()))
        return [float(sum(g * row[v] for v, g in zip(c.nodes, c.gauge or (), strict=True))) for c in self.balanced]


def follower_state(structure: Structure, state: np.ndarray) -> np.ndarray:
    """Return ``-L_F^-1 L_FL x_L`` for the leaders' entries of ``state`` (N,), in floating point."""
    F = structure.followers
    if not F.size:
        return np.zeros(0)
    rows = structure.graph.laplacian().tocsr()[F]
    leaders = state.copy()
    leaders[F] = 0
    block = rows[:, F].tocsr()
    return solve(block, -(rows @ leaders), block.diagonal())


def influence(graph: Any, *, exact: bool | None = None, orientation: str | None = None) -> Influence:
    """Compute ``Q`` in factored form.

    Parameters
    ----------
    graph : graph-like or Structure
        Whatever :func:`ptcc_certify.as_graph` takes.
    exact : bool, optional
        Rationals or floats; by default rationals for graphs of at most ``EXACT_NODES`` nodes, and for such groups.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    Influence

    References
    ----------
    Lemmas 2, 8 and 9 of [Zhu]_.

    Examples
    --------
    >>> influence([(1, 2, -3), (2, 1, -1)]).left_null_vectors  # they meet at (3 x_1 - x_2)/4 and its opposite
    ((Fraction(3, 4), Fraction(-1, 4)),)
    """
    structure = analyse(graph, orientation)
    floats = exact is False
    exact = structure.graph.n_nodes <= EXACT_NODES if exact is None else exact
    left_null_vectors = _left_null_vectors(structure, exact, floats)
    balanced = [c for c in structure.closed_components if c.balanced]
    weights: Sequence[Sequence[Number]] | None = None
    if exact:
        weights = _in_time(partial(exact_containment_weights, structure), structure.graph)
    elif structure.followers.size * len(balanced) <= MANY_WEIGHTS:
        found = containment_weights(structure)
        weights = None if found is None else found.tolist()
    rows = None if weights is None else tuple(map(tuple, weights))
    return Influence(structure, left_null_vectors, rows, exact)


def influence_in_floats(structure: Structure) -> Influence:
    """Compute ``Q`` in floats, without the weights of followers: where there is no time for more."""
    return Influence(structure, _left_null_vectors(structure, False, True), None, False)


def _left_null_vectors(structure: Structure, exact: bool, floats: bool) -> tuple[tuple[Number, ...], ...]:
    """Return the weights of leaders: exact, in floats, or exact in small groups."""
    graph, left_null_vectors = structure.graph, list[tuple[Number, ...]]()
    several = [v for c in structure.closed_components if len(c.nodes) > 1 for v in c.nodes]
    groups, place = graph.subgraph(several) if several else graph, {v: i for i, v in enumerate(several)}
    balanced = [c for c in structure.closed_components if c.balanced]
    for component in balanced:
        if len(component.nodes) == 1:
            left_null_vectors.append((Fraction(1),))
            continue
        checkpoint()
        block = groups.subgraph([place[v] for v in component.nodes])
        eta: Sequence[Number]
        if exact or (block.n_nodes <= EXACT_NODES and not floats):
            eta = _in_time(partial(exact_left_vector, block), block)
        else:
            p = left_vector(block)
            whole = dyadic_left_vector(block, p)
            total = sum(whole or ())
            eta = [Fraction(w, total) for w in whole] if whole else p.tolist()
        left_null_vectors.append(tuple(g * w for g, w in zip(component.gauge or (), eta, strict=True)))
    return tuple(left_null_vectors)


def _in_time(work: Callable[[], Any], graph: SignedDigraph) -> Any:
    """Return what exact work gives: under a time limit in a process of its own if it may take long."""
    limited = math.isfinite(min(seconds_left(), processor_left()))
    apart_from_here = limited and takes_long(graph)
    return next(apart(lambda: iter([work()]))) if apart_from_here else work()


def takes_long(graph: SignedDigraph) -> bool:
    """Tell whether what is exact of a graph may take long: it has many digits, or agents above ``EXACT_NODES``."""
    if graph.n_nodes > EXACT_NODES:
        return True
    return sum(w.numerator.bit_length() + w.denominator.bit_length() for _, _, w in graph.edges) > _MANY_DIGITS


@dataclass(frozen=True)
class FinalState(Mapping[str, Number]):
    """The state at the deadline and after: a mapping from labels to states; ``numpy.asarray`` rounds it to floats.

    Attributes
    ----------
    labels : tuple of str
        The N agents.
    states : tuple of Fraction or float
        ``Q X(0)``, exact for small graphs, otherwise the middles of intervals.
    consensus_values : tuple
        ``c_k`` of each balanced closed component.
    degenerate : tuple of int
        1-based numbers of the closed components that meet at 0 although they are balanced: the special initial states
        with ``eta' G X(0) = 0``, for which the consensus value of Definitions 3 to 5 is not positive.
    radius : tuple of Fraction, or None
        Of the proved intervals, 0 where an end is exact; None if all are, or if nothing is proved.

    References
    ----------
    Definitions 2 to 5; Lemmas 2, 8 and 9 of [Zhu]_.

    Examples
    --------
    >>> end = final_state(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1), (2, 3, 4)])), [3, 1, 7])
    >>> end
    FinalState(1=1, 2=-1, 3=-1)
    >>> end.consensus_values, end.degenerate, end[2]
    ((Fraction(1, 1),), (), Fraction(-1, 1))
    """

    labels: tuple[str, ...]
    states: tuple[Number, ...]
    consensus_values: tuple[Number, ...]
    degenerate: tuple[int, ...]
    radius: tuple[Fraction, ...] | None = None

    @property
    def exact(self) -> bool:
        """Whether ``states`` is exact: rational, without a radius."""
        return self.radius is None and all(isinstance(x, Fraction) for x in self.states)

    @property
    def intervals(self) -> tuple[tuple[Fraction, Fraction], ...] | None:
        """Middle and radius of a proved interval for each agent; None if nothing is proved."""
        if self.radius is None and not self.exact:
            return None
        radius = self.radius or (Fraction(0),) * len(self.states)
        return tuple(zip((Fraction(x) for x in self.states), radius, strict=True))

    @cached_property
    def _by_label(self) -> dict[str, Number]:
        return dict(zip(self.labels, self.states, strict=True))

    def __getitem__(self, label: Hashable) -> Number:
        try:
            return self._by_label[str(label)]
        except KeyError:
            return self.states[position(label, self.labels)]

    def __len__(self) -> int:
        return len(self.labels)

    def __iter__(self) -> Iterator[str]:
        return iter(self.labels)

    def __contains__(self, label: object) -> bool:
        return str(label) in self._by_label

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array([float(x) for x in self.states], dtype=dtype)

    def to_pandas(self) -> pd.Series:
        """Return the states, rounded to floats, as a Series by label.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> final_state([("a", "b", -1)], [3, 5]).to_pandas().to_dict()
        {'a': 3.0, 'b': -3.0}
        """
        return series(np.asarray(self), self.labels, "final state")

    def __repr__(self) -> str:
        entries = ", ".join(f"{quoted(k)}={float(x):.6g}" for k, x in [*zip(self.labels, self.states, strict=True)][:8])
        return f"FinalState({entries}{', ...' if len(self.labels) > 8 else ''})"


def extremes(
    states: Sequence[Number], number: int, radius: Sequence[Fraction] | None = None
) -> tuple[list[int], list[int]]:
    """Return the agents with the highest states and those with the lowest, from the highest on, no agent twice.

    Of states whose nearest floats are equal, exact ones come before enclosed ones, then nodes in their order.

    Examples
    --------
    >>> from ptcc_certify.bounds.final_state.of_graph import extremes
    >>> extremes([5, 2, 9, 9, 2, 2], 1), extremes([9.5, Fraction(19, 2)], 1, [Fraction(1, 99), Fraction(0)])
    (([2], [1]), ([1], [0]))
    """
    floats = [nearest_float(Fraction(x)) for x in states]
    wide = [bool(r) for r in radius or (0,) * len(floats)]
    highest = heapq.nsmallest(number, range(len(floats)), key=lambda k: (-floats[k], wide[k], k))
    chosen = set(highest)
    others = (k for k in range(len(floats)) if k not in chosen)
    lowest = heapq.nsmallest(number, others, key=lambda k: (floats[k], wide[k], k))
    return highest, lowest[::-1]


def final_state(
    graph: Any,
    x0: Any,
    *,
    exact: bool | None = None,
    matrix: Influence | None = None,
    orientation: str | None = None,
) -> FinalState:
    """Compute the state at the deadline, ``Q x0``.

    Parameters
    ----------
    graph : graph-like or Structure
        Whatever :func:`ptcc_certify.as_graph` takes.
    x0 : state-like
        In node order, or by label: whatever :func:`ptcc_certify.as_state` takes.
    exact : bool, optional
        See :func:`influence`.
    matrix : Influence, optional
        ``Q``, if it is known already.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    FinalState

    Raises
    ------
    ParameterError
        Wrong length, or an entry that is not a finite number.

    References
    ----------
    Lemmas 2, 8 and 9 of [Zhu]_.

    Examples
    --------
    >>> final_state([("a", "c", 1), ("b", "c", -3)], {"a": 1, "b": 2, "c": 0}).states
    (Fraction(1, 1), Fraction(-5, 4), Fraction(2, 1))
    """
    structure = analyse(graph, orientation)
    initial_state = as_state(x0, structure.graph)
    matrix = influence(structure, exact=exact) if matrix is None else matrix
    if not isinstance(matrix, Influence) or matrix.structure != structure:
        raise ParameterError("matrix is not the influence of this graph; leave it out, or give influence(graph)")
    final, values = matrix.apply(initial_state if matrix.exact else [float(x) for x in initial_state])
    numbers = [k for k, c in enumerate(structure.closed_components, start=1) if c.balanced]
    size = max((abs(float(x)) for x in initial_state), default=0.0)
    meets_at_zero = [c == 0 if matrix.exact else abs(float(c)) <= 1e-12 * size for c in values]
    degenerate = tuple(k for k, zero in zip(numbers, meets_at_zero, strict=True) if zero)
    return FinalState(structure.graph.labels, tuple(final), tuple(values), degenerate)


# ---------------------------------------------------------------------- large graphs


class NotEnclosedError(ArithmeticError):
    """No interval was found; the message tells why."""


def enclose(influence: Influence) -> Influence:
    """Enclose the left null vectors of ``Q``, and find the witness of all intervals.

    Raises
    ------
    NotEnclosedError
        The equations of followers or left null vectors are too ill-conditioned for floats.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -2)]))
    >>> who, x0 = enclose(influence(st, exact=False)), [Fraction(1), Fraction(0), Fraction(1)]
    >>> final = enclosed_final_state(who, x0)
    >>> bool(abs(Fraction(final.states[1]) + Fraction(1, 3)) <= final.radius[1] < 1e-9)  # c ends at -1/3
    True
    """
    checkpoint()
    structure, F = influence.structure, influence.structure.followers
    u = np.ones(structure.graph.n_nodes)
    if F.size:
        u[F] = _witness(structure.graph.laplacian().tocsr()[F][:, F])
    left_null_vectors = {
        k: _enclose_left_null_vector(structure, component, np.array(null_vector, dtype=float), u)
        for k, (component, null_vector) in enumerate(influence.groups)
        if not all(isinstance(w, Fraction | int) and writable(Fraction(w)) for w in null_vector)
    }  # a file states a rational that is too long to be written in a ball
    return replace(influence, enclosure=Enclosure(left_null_vectors, u))


def enclosed_final_state(influence: Influence, initial_state: Sequence[Fraction]) -> FinalState:
    """Enclose ``Q x0``, what is known of ``Q`` being enclosed.

    Raises
    ------
    NotEnclosedError
        The followers' equations are too ill-conditioned for floats, or a consensus value may be 0.
    """
    final, spreads = _enclosed(influence, initial_state)
    numbers = [k for k, c in enumerate(influence.structure.closed_components, start=1) if c.balanced]
    values, degenerate = list[Number](), []
    for number, component in zip(numbers, influence.balanced, strict=True):
        first = component.nodes[0]
        value, spread = final[first] * (component.gauge or (1,))[0], spreads[first]
        if spread and abs(Fraction(value)) <= 2 * spread:
            raise NotEnclosedError(f"the consensus value of leader group {number} may or may not be 0")
        if not value:
            degenerate.append(number)
        values.append(value)
    labels = influence.structure.graph.labels
    return FinalState(labels, tuple(final), tuple(values), tuple(degenerate), tuple(spreads))


def enclosed_ends(influence: Influence, begin: Sequence[tuple[Fraction, Fraction]]) -> list[tuple[Fraction, Fraction]]:
    """Enclose ``Q x`` for all ``x`` within intervals, middle and radius of each agent.

    Raises
    ------
    NotEnclosedError
        The followers' equations are too ill-conditioned for floats.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -2)]))
    >>> begin = [(Fraction(1), Fraction(1, 8)), (Fraction(0), Fraction(0)), (Fraction(1), Fraction(0))]
    >>> ends = enclosed_ends(enclose(influence(st, exact=False)), begin)
    >>> ends[0] == begin[0], bool(ends[1][1] >= Fraction(1, 24))  # c ends at (x_a - 2 x_b)/3
    (True, True)
    """
    state, spread = zip(*begin, strict=True)
    final, spreads = _enclosed(influence, state, spread if any(spread) else None)
    return [(Fraction(x), r) for x, r in zip(final, spreads, strict=True)]


def _enclosed(
    influence: Influence, state: Sequence[Fraction], spread: Sequence[Fraction] | None = None
) -> tuple[list[Number], list[Fraction]]:
    """Return middles and radii of ``Q x`` for all ``x`` within ``spread`` of a state; in floats where not exact."""
    structure, enclosure = influence.structure, influence.enclosure
    n = len(state)
    unit = Fraction(1)
    zero = Fraction(0)
    assert enclosure is not None
    size = max((abs(state[v]) for c in influence.balanced for v in c.nodes), default=zero)
    size += max(spread or (zero,))
    if size and not _SMALLEST <= size <= 1 / _SMALLEST:
        unit = Fraction(2) ** (size.numerator.bit_length() - size.denominator.bit_length())
        state, spread = [x / unit for x in state], spread and [r / unit for r in spread]
    middle, radius = np.zeros(n), np.zeros(n)
    exact = dict[int, tuple[Fraction, Fraction]]()
    for k, (component, null_vector) in enumerate(influence.groups):
        signs, nodes = np.array(component.gauge or ()), component.nodes
        group_state = [state[v] for v in nodes]
        group_spread = [Fraction(0)] * len(nodes) if spread is None else [spread[v] for v in nodes]
        if k in enclosure.left_null_vectors and (any(group_state) or any(group_spread)):
            value, width = _enclosed_value(enclosure.left_null_vectors[k], group_state, group_spread)
            middle[list(nodes)], radius[list(nodes)] = signs * value, width
            continue
        consensus = sum((Fraction(w) * x for w, x in zip(null_vector, group_state, strict=True) if x), zero)
        blur = sum((abs(Fraction(w)) * r for w, r in zip(null_vector, group_spread, strict=True) if r), zero)
        exact.update((v, (sign * consensus, blur)) for v, sign in zip(nodes, component.gauge or (), strict=True))
        middle[list(nodes)] = signs * float(consensus)
        radius[list(nodes)] = rounding_radius(consensus) + float(blur) * _MORE + (_TINY if blur else 0)
    exact.update(
        (v, (Fraction(0), Fraction(0))) for c in structure.closed_components if not c.balanced for v in c.nodes
    )
    F = structure.followers
    if F.size and (middle.any() or radius.any()):
        largest = float(np.maximum(np.abs(middle), radius).max())
        middle[F], radius[F] = _enclose_followers(structure, middle, radius, enclosure.witness)
        if not radius[F].max() <= _NARROW * largest:
            leaders = exact | _exact_leaders(influence, enclosure, state, spread)
            exact |= _exactly_enclosed_followers(structure, leaders, middle[F].tolist(), enclosure.witness)
    final: list[Number] = [x if unit == 1 else Fraction(x) * unit for x in middle.tolist()]
    spreads = [Fraction(r) * unit for r in radius.tolist()]
    for v, (x, r) in exact.items():
        final[v], spreads[v] = x * unit, r * unit
    return final, spreads


def _enclosed_value(
    null_vector: tuple[np.ndarray, np.ndarray], own: Sequence[Fraction], wide: Sequence[Fraction]
) -> tuple[float, float]:
    """Return middle and radius of the consensus value of a group whose left null vector is enclosed, in floats."""
    weights, radii = null_vector
    states, spread = np.array(own, dtype=float), np.array(wide, dtype=float)
    value, total = float(weights @ states), float(np.abs(weights) @ np.abs(states))
    more = float(radii @ (np.abs(states) + spread)) + float(np.abs(weights) @ spread)
    return value, (more + _ROUNDING * total) * _MORE + _TINY


def rounding_radius(value: Fraction) -> float:
    """Bound how far the nearest float, or its decimal text, is from a rational.

    Examples
    --------
    >>> rounding_radius(Fraction(1, 2)), 0 < rounding_radius(Fraction(1, 3)) < 1e-15
    (0.0, True)
    """
    near = float(value)
    return 0.0 if Fraction(near) == value else float(_spacing(near))


def _spacing(x: float | np.ndarray) -> Any:
    """Bound the rounding of a float or of its decimal text."""
    return 2 * _ULP * np.abs(x) + 5e-324


def _witness(block: Any) -> np.ndarray:
    """Return ``u > 0`` with ``M(block) u > 0``, its largest entry 1."""
    with np.errstate(all="ignore"):
        try:
            matrix = SparseHMatrix(block)
        except LMIError as error:
            raise NotEnclosedError(str(error)) from None
        ones = np.ones(matrix.diagonal.size)
        rows = matrix.M.multiply(1 / matrix.diagonal[:, None]).tocsr()  # rows of every size weigh alike
        u = solve(rows, ones, ones, _LOOSE / np.sqrt(ones.size))
        u /= u.max()
        comparison = matrix.M @ u
    if not (np.isfinite(u).all() and (u > 0).all() and np.isfinite(comparison).all() and (comparison > 0).all()):
        raise NotEnclosedError("the equations are too ill-conditioned for floats")
    return u


def _enclose_left_null_vector(
    structure: Structure, component: ClosedComponent, null_vector: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Enclose ``eta' M(L_k) = 0``, ``eta'1 = 1`` of one group, signs of the camps included; fill in its ``u``."""
    checkpoint()
    nodes = np.array(component.nodes)
    block = structure.graph.laplacian().tocsr()[nodes][:, nodes].tocsr()
    signs = np.array(component.gauge or (), dtype=float)
    eta = signs * null_vector
    top = int(np.argmax(eta))
    rest = np.delete(np.arange(nodes.size), top)
    own = _witness(block[rest][:, rest].T.tocsr())
    u[nodes[rest]] = own
    columns = block.T.tocsr()[rest]  # of the comparison matrix, but for signs
    z = eta / eta[top]
    comparison = 2 * block.diagonal()[rest] * own - abs(columns[:, rest]) @ own
    total = abs(columns) @ z
    residual = np.abs(2 * block.diagonal()[rest] * z[rest] - total)
    with np.errstate(all="ignore"):
        error = float(((residual + _ULP * (np.diff(columns.indptr) + 4) * total) / comparison).max()) * _MORE
    weights = np.zeros(nodes.size)
    weights[rest] = own
    low, high = z.sum() - error * weights.sum(), z.sum() + error * weights.sum()
    if not low > 0.5 * high:
        group = f"a leader group of {nodes.size} nodes"
        raise NotEnclosedError(f"the left null vector of {group} is too ill-conditioned for floats")
    ends = np.abs((z - error * weights) / high - eta), np.abs((z + error * weights) / low - eta)
    return signs * eta, np.maximum(*ends) * _MORE + 8 * _ULP * eta


def _enclose_followers(
    structure: Structure, middle: np.ndarray, radius: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return middles and radii of the followers in floats, in a unit near to the largest leader."""
    checkpoint()
    F = structure.followers
    unit = float(np.exp2(np.floor(np.log2(np.maximum(np.abs(middle), radius).max()))))
    rows = structure.graph.laplacian().tocsr()[F]
    state, blur = middle / unit, abs(rows) @ (radius / unit)
    block = rows[:, F].tocsr()
    with np.errstate(all="ignore"):
        followers = follower_state(structure, state)
        if not np.isfinite(followers).all():
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        state[F] = followers
        comparison = 2 * block.diagonal() * u[F] - abs(block) @ u[F]
        residual = np.abs(rows @ state) + blur + _ROUNDING * (abs(rows) @ np.abs(state))
        error = float(np.where(comparison > 0, residual / comparison, np.inf).max()) * 1.01
        final = followers * unit
        return final, (error * u[F] * unit + _spacing(final)) * _MORE


def _exact_leaders(
    influence: Influence, enclosure: Enclosure, state: Sequence[Fraction], spread: Sequence[Fraction] | None
) -> dict[int, tuple[Fraction, Fraction]]:
    """Return middles and radii of the groups whose left null vectors are enclosed, in rationals, as the check does."""
    leaders: dict[int, tuple[Fraction, Fraction]] = {}
    for k, vectors in enclosure.left_null_vectors.items():
        checkpoint()
        nodes, gauge = influence.balanced[k].nodes, influence.balanced[k].gauge or ()
        weights, radii = ([Fraction(repr(x)) for x in vector.tolist()] for vector in vectors)
        value = sum((w * state[v] for v, w in zip(nodes, weights, strict=True)), Fraction(0))
        blur = sum((r * abs(state[v]) for v, r in zip(nodes, radii, strict=True)), Fraction(0))
        if spread is not None:
            blur += sum((abs(w) + r) * spread[v] for v, w, r in zip(nodes, weights, radii, strict=True))
        leaders |= {v: (sign * value, blur) for v, sign in zip(nodes, gauge, strict=True)}
    return leaders


def _exactly_enclosed_followers(
    structure: Structure, leaders: Mapping[int, tuple[Fraction, Fraction]], followers: Sequence[float], u: np.ndarray
) -> dict[int, tuple[Fraction, Fraction]]:
    """Return middles, the decimals of floats, and radii of the followers, with residuals in rationals.

    These are the numbers that a certificate states, and the residuals those that its check forms: nothing is added for
    rounding, which ill-conditioned equations would make much wider than what is proved.
    """
    F = structure.followers.tolist()
    middles, weights = [Fraction(repr(x)) for x in followers], dict(zip(F, map(Fraction, u[F].tolist()), strict=True))
    values = {v: x for v, (x, _) in leaders.items()} | dict(zip(F, middles, strict=True))
    error = Fraction(0)
    for v, row in zip(F, structure.graph.exact_rows(F), strict=True):
        checkpoint()
        residual = abs(sum((x * values[j] for j, x in row.items()), Fraction(0)))
        residual += sum(abs(x) * leaders[j][1] for j, x in row.items() if j in leaders)
        comparison = sum((weights[j] * (x if j == v else -abs(x)) for j, x in row.items() if j in weights), Fraction(0))
        if comparison <= 0 or residual * _SMALLEST > comparison:
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        error = max(error, residual / comparison)
    radii = [Fraction(float(error * weight) * _MORE + (_TINY if error else 0)) for weight in weights.values()]
    return dict(zip(F, zip(middles, radii, strict=True), strict=True))
