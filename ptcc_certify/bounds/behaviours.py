"""Definitions 1 to 5 as predicates on states and runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.bounds.final_state import FinalState
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.io import as_state
from ptcc_certify.graphs.structure import Structure, analyse

if TYPE_CHECKING:
    from ptcc_certify.simulation.trajectory import Trajectory


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
    Definition 1 and Lemma 6 of [Zhu]_.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1])
    >>> is_prescribed_time_stable(run)
    True
    """
    if trajectory.deadline_index is None:
        raise HypothesisError("the trajectory has no sample at a deadline, so the definition does not apply")
    after = trajectory.error[..., trajectory.deadline_index :]
    return bool(np.abs(after).max(initial=0.0) <= tolerance * np.abs(trajectory.error).max(initial=0.0))


def is_stability(x: Any, graph: Any, tolerance: float = 0.0) -> bool:
    """Definition 2: ``x_k = 0`` for all agents (from the deadline on).

    Parameters
    ----------
    x : sequence of N numbers, mapping or pandas Series by label, FinalState or Trajectory
        A trajectory is judged at its deadline and at every later sample, relative to its largest initial value.
    graph : Structure or graph-like
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)]))
    >>> is_stability(final_state(st, [3, 4]), st)
    True
    """
    return all(all(abs(v) <= tol for v in state) for state, tol in _states(x, analyse(graph), tolerance))


def is_bipartite_consensus(x: Any, graph: Any, tolerance: float = 0.0) -> bool:
    """Definition 3: ``|x_k| = x*`` for all agents, with ``x* > 0`` (see :func:`is_stability` for parameters).

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    graph : Structure or graph-like
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]))
    >>> is_bipartite_consensus(final_state(st, [3, 4]), st), is_bipartite_consensus(final_state(st, [3, 3]), st)
    (True, False)
    """
    return all(_same_modulus(state, tol) for state, tol in _states(x, analyse(graph), tolerance))


def is_interval_bipartite_consensus(x: Any, graph: Any, tolerance: float = 0.0) -> bool:
    """Definition 4: ``|x_k| = x_f > 0`` for all leaders, ``|x_l| <= x_f`` for all followers; one closed component.

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    graph : Structure or graph-like
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 3, 1), (3, 2, 1)]))
    >>> is_interval_bipartite_consensus(final_state(st, [2, 0, 0]), st)
    True
    """
    structure = analyse(graph)
    if len(structure.closed_components) != 1:
        return False
    leaders, followers = structure.leaders.tolist(), structure.followers.tolist()
    return all(
        _same_modulus([state[k] for k in leaders], tol)
        and all(abs(state[k]) <= abs(state[leaders[0]]) + tol for k in followers)
        for state, tol in _states(x, structure, tolerance)
    )


def is_bipartite_containment(x: Any, graph: Any, tolerance: float = 0.0) -> bool:
    """Definition 5: balanced closed components in bipartite consensus, unbalanced at 0, followers within the leaders.

    Parameters
    ----------
    x : sequence of N numbers, FinalState or Trajectory
        See :func:`is_stability`.
    graph : Structure or graph-like
    tolerance : float
        0 asks for equality, which makes sense for exact final states.

    Returns
    -------
    bool

    References
    ----------
    Section II of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)]))
    >>> is_bipartite_containment(final_state(st, [1, 0, 2]), st)
    True
    """
    structure = analyse(graph)
    return all(_is_contained(state, structure, tol) for state, tol in _states(x, structure, tolerance))


def _is_contained(state: Sequence[Any], structure: Structure, tolerance: float) -> bool:
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
    if isinstance(x, FinalState):
        size = max((abs(float(v)) for v in x.states), default=0.0)
        return [(x.states, tolerance * size if tolerance else 0)]
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
    return [(as_state(x, structure.graph, "x"), tolerance)]
