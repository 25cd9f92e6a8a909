"""Where the agents end: ``X(T) = Q X(0)``, exactly; who decides whom; Definitions 1 to 5 as predicates.

``Q`` projects onto the kernel of ``L`` along its range. An unbalanced closed component goes to 0; a balanced one to
``G_k 1 c_k`` with ``c_k = eta_k' G_k X_Lk(0)``, ``eta_k' M(L_Lk) = 0``, ``eta_k' 1 = 1``; followers go to
``-L_F^-1 L_FL X_L(T)``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.sparse_h_matrix import solve
from ptcc_certify.errors import HypothesisError, NumberError, ParameterError
from ptcc_certify.graphs.io import in_node_order
from ptcc_certify.graphs.rationals import as_fraction, shorten
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.theorems.lemmas import (
    EXACT_NODES,
    containment_weights,
    dyadic_left_vector,
    exact_containment_weights,
    exact_left_vector,
    left_vector,
)

if TYPE_CHECKING:
    from ptcc_certify.simulation.trajectory import Trajectory

Number = Fraction | float
#: Weights of followers on components are stored up to this number.
MANY_PULLS = 1_000_000


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


@dataclass(frozen=True)
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
        followers times components are more than ``MANY_PULLS``.
    exact : bool
        Whether the numbers are rationals.
    enclosure : Enclosure or None
        What is proved where they are not.

    References
    ----------
    Lemmas 2, 8 and 9 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.
    Altafini, Consensus problems on networks with antagonistic interactions, IEEE Trans. Automat. Control 58 (2013).

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
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

    def row(self, node: int) -> dict[int, Number]:
        """Return the row of ``Q`` of one node as ``{leader index: weight}``.

        Parameters
        ----------
        node : int
            Its index.

        Returns
        -------
        dict of int to Fraction or float
            Empty for a node that ends at 0 from every initial state.

        Examples
        --------
        >>> from ptcc_certify.graphs.digraph import SignedDigraph
        >>> from ptcc_certify.graphs.structure import analyse
        >>> influence(analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)]))).row(1)
        {0: Fraction(1, 4), 2: Fraction(-3, 4)}
        """
        for component, null_vector in zip(self.balanced, self.left_null_vectors, strict=True):
            if node in component.nodes:
                own = (component.gauge or ())[component.nodes.index(node)]
                return {v: own * w for v, w in zip(component.nodes, null_vector, strict=True)}
        where = np.flatnonzero(self.structure.followers == node)
        if where.size == 0:
            return {}
        result: dict[int, Number] = {}
        weights = self._weights_of(int(where[0]))
        for component, null_vector, weight in zip(self.balanced, self.left_null_vectors, weights, strict=True):
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
            for component, null_vector in zip(self.balanced, self.left_null_vectors, strict=True)
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
            final[v] = sum((w * c for w, c in zip(weights, values, strict=True) if w), zero)
        return final, values

    def _weights_of(self, follower: int) -> Sequence[Number]:
        """Return the weights of one follower, by one solve with the transposed block if they are not stored."""
        if self.containment_weights is not None:
            return self.containment_weights[follower]
        L, F = self.structure.graph.laplacian().tocsr(), self.structure.followers
        block, unit = L[F][:, F], np.zeros(F.size)
        unit[follower] = 1
        heard = -(L[F].T @ solve(block.T.tocsr(), unit, block.diagonal()))
        return [float(sum(g * heard[v] for v, g in zip(c.nodes, c.gauge or (), strict=True))) for c in self.balanced]


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


def influence(structure: Structure, *, exact: bool | None = None) -> Influence:
    """Compute ``Q`` in factored form.

    Parameters
    ----------
    structure : Structure
    exact : bool, optional
        Rationals or floats; by default rationals for graphs of at most ``EXACT_NODES`` nodes.

    Returns
    -------
    Influence

    References
    ----------
    Lemmas 2, 8 and 9 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> foes = analyse(SignedDigraph.from_edges([(1, 2, -3), (2, 1, -1)]))
    >>> influence(foes).left_null_vectors  # they meet at (3 x_1 - x_2)/4 and its opposite
    ((Fraction(3, 4), Fraction(-1, 4)),)
    """
    graph = structure.graph
    exact = graph.n_nodes <= EXACT_NODES if exact is None else exact
    left_null_vectors: list[tuple[Number, ...]] = []
    several = [v for c in structure.closed_components if len(c.nodes) > 1 for v in c.nodes]
    groups, place = graph.subgraph(several) if several else graph, {v: i for i, v in enumerate(several)}
    balanced = [c for c in structure.closed_components if c.balanced]
    for component in balanced:
        gauge = component.gauge or ()
        if len(component.nodes) == 1:
            left_null_vectors.append((Fraction(1),))
            continue
        block = groups.subgraph([place[v] for v in component.nodes])
        eta: Sequence[Number]
        if exact or block.n_nodes <= EXACT_NODES:
            eta = exact_left_vector(block)
        else:
            p = left_vector(block)
            whole = dyadic_left_vector(block, p)
            total = sum(whole or ())
            eta = [Fraction(w, total) for w in whole] if whole else p.tolist()
        left_null_vectors.append(tuple(g * w for g, w in zip(gauge, eta, strict=True)))
    if not exact and structure.followers.size * len(balanced) > MANY_PULLS:
        return Influence(structure, tuple(left_null_vectors), None, False)
    try:
        weights: Sequence[Sequence[Number]] = (
            exact_containment_weights(structure) if exact else containment_weights(structure).tolist()
        )
    except RuntimeError:  # a factor of floats that is exactly singular
        return Influence(structure, tuple(left_null_vectors), None, False)
    return Influence(structure, tuple(left_null_vectors), tuple(tuple(row) for row in weights), exact)


@dataclass(frozen=True)
class FinalState:
    """The state at the deadline and after.

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
    Definitions 2 to 5; Lemmas 2, 8 and 9 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> end = final_state(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1), (2, 3, 4)])), [3, 1, 7])
    >>> end
    FinalState(1=1, 2=-1, 3=-1)
    >>> end.consensus_values, end.degenerate
    ((Fraction(1, 1),), ())
    """

    labels: tuple[str, ...]
    states: tuple[Number, ...]
    consensus_values: tuple[Number, ...]
    degenerate: tuple[int, ...]
    radius: tuple[Fraction, ...] | None = None

    @property
    def exact(self) -> bool:
        """Whether ``final_state`` is exact: rational, without a radius."""
        return self.radius is None and all(isinstance(x, Fraction) for x in self.states)

    @property
    def intervals(self) -> tuple[tuple[Fraction, Fraction], ...] | None:
        """Middle and radius of a proved interval for each agent; None if nothing is proved."""
        if self.radius is None and not self.exact:
            return None
        radius = self.radius or (Fraction(0),) * len(self.states)
        return tuple(zip((Fraction(x) for x in self.states), radius, strict=True))

    @cached_property
    def values(self) -> np.ndarray:
        """(N,) float64 array: ``final_state``, rounded."""
        return np.array([float(x) for x in self.states])

    def __repr__(self) -> str:
        shown = ", ".join(f"{k}={float(x):.6g}" for k, x in list(zip(self.labels, self.states, strict=True))[:8])
        return f"FinalState({shown}{', ...' if len(self.labels) > 8 else ''})"


def final_state(
    structure: Structure,
    x0: Sequence[Any] | Mapping[Any, Any],
    *,
    exact: bool | None = None,
    matrix: Influence | None = None,
) -> FinalState:
    """Compute the state at the deadline, ``Q x0``.

    Parameters
    ----------
    structure : Structure
    x0 : sequence of N numbers, mapping of label to number or pandas Series
        In node order, or by label; ints, floats (the dyadic numbers they are), Fractions or texts of the exact grammar.
    exact : bool, optional
        See :func:`influence`.
    matrix : Influence, optional
        ``Q``, if it is known already.

    Returns
    -------
    FinalState

    Raises
    ------
    ParameterError
        Wrong length, or an entry that is not a finite number.

    References
    ----------
    Lemmas 2, 8 and 9 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> final_state(analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)])), [1, 0, 2]).states
    (Fraction(1, 1), Fraction(-5, 4), Fraction(2, 1))
    """
    start = exact_initial_state(structure, x0)
    matrix = influence(structure, exact=exact) if matrix is None else matrix
    final, values = matrix.apply(start if matrix.exact else [float(x) for x in start])
    numbers = [k for k, c in enumerate(structure.closed_components, start=1) if c.balanced]
    size = max((abs(float(x)) for x in start), default=0.0)
    meets_at_zero = [c == 0 if matrix.exact else abs(float(c)) <= 1e-12 * size for c in values]
    degenerate = tuple(k for k, zero in zip(numbers, meets_at_zero, strict=True) if zero)
    return FinalState(structure.graph.labels, tuple(final), tuple(values), degenerate)


def exact_initial_state(
    structure: Structure, x0: Sequence[Any] | Mapping[Any, Any], name: str = "x0"
) -> list[Fraction]:
    """Return an initial state as N rationals; ``x0`` in node order, or with labels. ``name`` is what messages call it.

    Raises
    ------
    ParameterError
        Wrong length, labels other than those of the nodes, or an entry that is not a finite number.
    """
    labels = structure.graph.labels
    x0 = in_node_order(x0, structure.graph, name)
    if isinstance(x0, str) or not hasattr(x0, "__getitem__"):
        raise ParameterError(f"the initial state {name} is a sequence of numbers in node order, or a mapping by label")
    if len(x0) != len(labels):
        raise ParameterError(f"the initial state {name} has {len(x0)} values for {len(labels)} agents")
    start = []
    for label, value in zip(labels, x0, strict=True):
        if type(value) is Fraction:
            start.append(value)
            continue
        try:
            start.append(as_fraction(value, f"{name} of agent {shorten(label)}"))
        except NumberError as error:
            where = f"{name} of agent {shorten(label)}"
            raise ParameterError(str(error) if str(error).startswith(where) else f"{where}: {error}") from None
    return start


# ---------------------------------------------------------------------- Definitions 1 to 5


def is_prescribed_time_stable(trajectory: Trajectory, tolerance: float = 1e-6) -> bool:
    """Definition 1 on one run of the error system: ``E -> 0`` at the deadline and ``E = 0`` from there on.

    Definition 1 speaks of all initial states of a system; a single trajectory can only refute it.

    Parameters
    ----------
    trajectory : Trajectory
        Of a protocol with a deadline, sampled at it and beyond.
    tolerance : float
        Relative to the largest ``|E|`` of the run.

    Returns
    -------
    bool
        False refutes prescribed-time stability; True does not prove it.

    Raises
    ------
    HypothesisError
        The deadline is not among the samples.

    References
    ----------
    Definition 1 and Lemma 6 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, simulate
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1])
    >>> is_prescribed_time_stable(run)
    True
    """
    if trajectory.deadline_index is None:
        raise HypothesisError("the trajectory has no sample at a deadline, so the definition does not apply")
    after = trajectory.error[..., trajectory.deadline_index :]
    return bool(np.abs(after).max(initial=0.0) <= tolerance * np.abs(trajectory.error).max(initial=0.0))


def is_stability(x: Any, structure: Structure, tolerance: float = 0.0) -> bool:
    """Definition 2: ``x_k = 0`` for all agents (from the deadline on).

    Parameters
    ----------
    x : sequence of N numbers, mapping or pandas Series by label, FinalState or Trajectory
        A trajectory is judged at its deadline and at every later sample, relative to its largest start.
    structure : Structure
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)]))
    >>> is_stability(final_state(st, [3, 4]), st)
    True
    """
    return all(all(abs(v) <= tol for v in state) for state, tol in _states(x, structure, tolerance))


def is_bipartite_consensus(x: Any, structure: Structure, tolerance: float = 0.0) -> bool:
    """Definition 3: ``|x_k| = x*`` for all agents, with ``x* > 0`` (see :func:`is_stability` for parameters).

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    structure : Structure
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]))
    >>> is_bipartite_consensus(final_state(st, [3, 4]), st), is_bipartite_consensus(final_state(st, [3, 3]), st)
    (True, False)
    """
    return all(_same_modulus(state, tol) for state, tol in _states(x, structure, tolerance))


def is_interval_bipartite_consensus(x: Any, structure: Structure, tolerance: float = 0.0) -> bool:
    """Definition 4: ``|x_k| = x_f > 0`` for all leaders, ``|x_l| <= x_f`` for all followers; one closed component.

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    structure : Structure
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 3, 1), (3, 2, 1)]))
    >>> is_interval_bipartite_consensus(final_state(st, [2, 0, 0]), st)
    True
    """
    if len(structure.closed_components) != 1:
        return False
    leaders, followers = structure.leaders.tolist(), structure.followers.tolist()
    return all(
        _same_modulus([state[k] for k in leaders], tol)
        and all(abs(state[k]) <= abs(state[leaders[0]]) + tol for k in followers)
        for state, tol in _states(x, structure, tolerance)
    )


def is_bipartite_containment(x: Any, structure: Structure, tolerance: float = 0.0) -> bool:
    """Definition 5: balanced closed components in bipartite consensus, unbalanced at 0, followers within the leaders.

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    structure : Structure
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)]))
    >>> is_bipartite_containment(final_state(st, [1, 0, 2]), st)
    True
    """
    return all(_contained(state, structure, tol) for state, tol in _states(x, structure, tolerance))


def _contained(state: Sequence[Any], structure: Structure, tolerance: float) -> bool:
    for component in structure.closed_components:
        own = [state[v] for v in component.nodes]
        if component.balanced and not _same_modulus(own, tolerance):
            return False
        if not component.balanced and any(abs(v) > tolerance for v in own):
            return False
    hull = max(abs(state[v]) for v in structure.leaders.tolist())
    return all(abs(state[v]) <= hull + tolerance for v in structure.followers.tolist())


def _same_modulus(state: Sequence[Any], tolerance: float) -> bool:
    sizes = [abs(v) for v in state]
    return min(sizes) > tolerance and max(sizes) - min(sizes) <= tolerance


def _states(x: Any, structure: Structure, tolerance: float) -> list[tuple[Sequence[Any], float]]:
    """Return the states to judge, each with its absolute tolerance (an int 0 keeps rationals exact)."""
    if isinstance(x, FinalState) and tolerance == 0:
        return [(x.states, 0)]
    if isinstance(x, FinalState):
        size = max((abs(float(v)) for v in x.states), default=0.0)
        return [(x.states, tolerance * size)]
    if hasattr(x, "deadline_index"):
        if x.deadline_index is None:
            raise HypothesisError("the trajectory has no sample at a deadline, so the definitions do not apply")
        states = np.asarray(x.states)
        states = states.reshape(states.shape[0], -1, states.shape[-1])
        sizes = np.abs(states[:, :, 0]).max(axis=0)
        return [
            (states[:, column, i].tolist(), tolerance * float(sizes[column]))
            for column in range(states.shape[1])
            for i in range(x.deadline_index, states.shape[-1])
        ]
    return [(in_node_order(x, structure.graph, "x"), tolerance)]
