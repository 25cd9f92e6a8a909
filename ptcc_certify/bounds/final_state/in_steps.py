r"""Opinions in steps of time: ``x(t+1) = A x(t)``, of DeGroot and of Friedkin and Johnsen, with opponents.

The graph tells A: agent k keeps the share ``a_kk = s_k`` of its own opinion, and hears with

    a_kl = (1 - s_k) w_kl / (sum_l |w_kl| + theta_k),      b_k = (1 - s_k) theta_k / (sum_l |w_kl| + theta_k),

``b_k`` that of its prejudice, which rests. So ``I - A`` is the signed Laplacian of the graph with the weights ``a_kl``:
what is proved of final states and of who decides whom is proved of that graph.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from lmi.exact.elementary_enclosures import log, rounded
from lmi.sparse_h_matrix import solve
from ptcc_certify.bounds.final_state.of_graph import (
    FinalState,
    Influence,
    NotEnclosedError,
    enclose,
    enclosed_final_state,
    final_state,
    influence,
)
from ptcc_certify.bounds.final_state.opinions import disagreement, polarisation
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_graph, as_state
from ptcc_certify.graphs.io.states import by_label
from ptcc_certify.graphs.io.with_stubborn import told_by_agent
from ptcc_certify.graphs.labels import place_of
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import as_fraction, format_exact, shorten
from ptcc_certify.graphs.structure import Structure, analyse, find_camps
from ptcc_certify.graphs.stubborn import agent_nodes

#: Vectors that are tried for the bound, each by one solve.
_VECTORS = 8
#: Entries of a vector that are smaller, relatively, are of no use.
_SMALLEST = 1e-100
#: Bits to which the factor of a step is rounded.
_BITS = 60


@dataclass(frozen=True)
class StepDecay:
    """``|x_k(t) - X_k| <= (1-b)^t M u_k`` for the agents that hear, in the end, only who rests.

    Attributes
    ----------
    factor : Fraction
        ``1 - b``, in [0, 1).
    size : Fraction
        ``M``.
    weights : mapping of int to Fraction
        ``u_k > 0`` by node.

    Notes
    -----
    ``u_k - sum_{l in F} |a_kl| u_l >= b u_k`` (l = k included): the next error is, in absolute values, at most
    ``|A_FF| (1-b)^t M u <= (1-b)^(t+1) M u``.
    """

    factor: Fraction
    size: Fraction
    weights: Mapping[int, Fraction]

    def after(self, step: int) -> Fraction:
        """Return what no agent of the bound is farther than from its final opinion at a step and ever after."""
        power = Fraction(1)
        for bit in bin(step)[2:]:
            power = rounded(power * power * (self.factor if bit == "1" else 1), _BITS, up=True)
        return power * self.size * max(self.weights.values())

    def steps(self, within: Fraction) -> int:
        """Return a number of steps after which each of them stays within a distance > 0 of its final opinion.

        Examples
        --------
        >>> StepDecay(Fraction(1, 2), Fraction(8), {0: Fraction(1)}).steps(Fraction(1))
        3
        """
        begin = self.size * max(self.weights.values())
        if begin <= within:
            return 0
        if not self.factor:
            return 1
        step = math.ceil(log(begin / within)[1] / -log(self.factor)[1])
        return step - 1 if self.after(step - 1) <= within else step


@dataclass(frozen=True, eq=False, repr=False)
class OpinionsInSteps:
    """What becomes of opinions in steps of time; made by :func:`opinions_in_steps`.

    Attributes
    ----------
    graph : SignedDigraph
        As it was given.
    structure : Structure
        Of the graph with the weights ``a_kl`` and ``b_k``; ``a_kk`` is what is left to 1.
    initial_state : tuple of N Fraction
    final_state : FinalState
        ``X``: where opinions end; of agents that do not settle their mean in the long run.
    influence : Influence
        Who decides whom: the matrix of ``X = Q x(0)``.
    periods : mapping of tuple of int to int
        The closed groups that go on in rounds for almost every ``x(0)``, each with the number of steps of a round.
    decay : StepDecay or None
        What is proved of the way; None where no agent hears, in the end, only who rests.
    """

    graph: SignedDigraph
    structure: Structure
    initial_state: tuple[Fraction, ...]
    final_state: FinalState
    influence: Influence
    periods: Mapping[tuple[int, ...], int]
    decay: StepDecay | None

    @property
    def converges(self) -> bool:
        """Whether opinions converge from every initial state; decided exactly."""
        return not self.periods

    @cached_property
    def restless(self) -> np.ndarray:
        """(N,) bool: who goes on in rounds, or hears of such a group, and so does not settle from every x(0)."""
        return _reached(self.graph, [v for nodes in self.periods for v in nodes])

    def run(self, steps: int) -> np.ndarray:
        """Return ``x(0) .. x(steps)``, (steps + 1, N), in floats: numerical."""
        L, states = self.structure.graph.laplacian(), [np.array([float(x) for x in self.initial_state])]
        for _ in range(steps):
            states.append(states[-1] - L @ states[-1])
        return np.array(states)

    def to_dict(self, within: Fraction) -> dict[str, Any]:
        """Return what is known, numbers as texts, by label; the bound with the steps until within a distance > 0."""
        labels, end = self.graph.labels, self.final_state
        ends = {a: str(x) for a, x in zip(labels, end.states, strict=True)}
        rounds = [{"nodes": [labels[k] for k in nodes], "period": steps} for nodes, steps in self.periods.items()]
        bound = None
        if (decay := self.decay) is not None:
            weights = {labels[k]: str(x) for k, x in decay.weights.items()}
            factor, size, soon = str(decay.factor), str(decay.size), decay.steps(within)
            bound = {"factor": factor, "size": size, "weights": weights, "within": str(within), "steps": soon}
        restless = [a for a, moves in zip(labels, self.restless, strict=True) if moves]
        return {
            "converges": self.converges,
            "rounds": rounds,
            "restless": restless,
            "final_state": ends,
            "exact": end.exact,
            "radius": None if end.radius is None else {a: str(x) for a, x in zip(labels, end.radius, strict=True)},
            "bound": bound,
            "polarisation": [str(polarisation(self.graph, x)) for x in (self.initial_state, end.states)],
            "disagreement": [str(disagreement(self.graph, x)) for x in (self.initial_state, end.states)],
        }

    def __repr__(self) -> str:
        how = "converge" if self.converges else f"{int(self.restless.sum())} do not settle"
        return f"OpinionsInSteps({self.structure.graph.n_nodes} nodes, {how})"


def opinions_in_steps(graph: Any, x0: Any, *, self_weight: Any = 0) -> OpinionsInSteps:
    """Tell what becomes of opinions in steps of time, ``x(t+1) = A x(t) + B p``.

    Parameters
    ----------
    graph : graph-like
        Whatever :func:`ptcc_certify.as_graph` takes; with stubborn agents: :func:`ptcc_certify.with_stubborn`.
    x0 : state-like
        Whatever :func:`ptcc_certify.as_state` takes.
    self_weight : number, text, or mapping of label to number
        The share ``0 <= s_k < 1`` that an agent keeps of its own opinion in every step.

    Returns
    -------
    OpinionsInSteps

    Raises
    ------
    ParameterError
        A share is not in [0, 1).

    References
    ----------
    DeGroot, Reaching a consensus, J. Amer. Statist. Assoc. 69 (1974).
    Friedkin and Johnsen, Social influence and opinions, J. Math. Sociol. 15 (1990).

    Examples
    --------
    >>> debate = ptcc.with_stubborn([("a", "b", 1), ("b", "a", -1)], {"a": 1})
    >>> found = opinions_in_steps(debate, [3, 1])
    >>> found.converges, found.final_state["a"], found.final_state["b"]
    (True, Fraction(1, 1), Fraction(1, 1))
    >>> opinions_in_steps([("a", "b", 1), ("b", "a", 1)], [3, 1]).periods
    {(0, 1): 2}
    """
    graph = as_graph(graph)
    own = _shares(self_weight, graph)
    stepwise = _with_rows_of_one(graph, own)
    structure, begin = analyse(stepwise), as_state(x0, stepwise)
    who = influence(structure)
    end = final_state(structure, begin, matrix=who)
    if not who.exact:
        with suppress(NotEnclosedError):  # then the ends are numerical
            end = enclosed_final_state(enclose(who), begin)
    periods = {}
    for component in structure.closed_components:
        if len(component.nodes) > 1 and not any(own[v] for v in component.nodes):
            inside = np.flatnonzero(np.isin(stepwise.target, component.nodes))
            place = np.searchsorted(component.nodes, [stepwise.source[inside], stepwise.target[inside]])
            if (steps := period(place[0], place[1], stepwise.sign[inside])) > 1:
                periods[component.nodes] = steps
    return OpinionsInSteps(graph, structure, tuple(begin), end, who, periods, _decay(structure, own, begin, end))


def period(source: np.ndarray, target: np.ndarray, sign: np.ndarray) -> int:
    """Return the number of steps of a round of ``x(t+1) = A x(t)``, A irreducible with ``sum_l |a_kl| = 1``.

    1 where it converges from every x(0). With d the greatest common divisor of the lengths of cycles, nodes have
    classes in ``Z_d`` such that every edge raises the class by 1; A' is A with the signs of edges from class d-1 to
    class 0 turned. If A is balanced, its eigenvalues on the unit circle are the d-th roots of 1, and the round has d
    steps; if A' is, they are the d-th roots of -1, and it has 2d; else there are none, and x goes to 0.

    Parameters
    ----------
    source, target, sign : int arrays
        The edges between nodes 0 to n - 1, loops included: strongly connected.

    References
    ----------
    Wielandt, Unzerlegbare, nicht negative Matrizen, Math. Z. 52 (1950).

    Examples
    --------
    >>> three = np.array([0, 1, 2])
    >>> period(three, np.roll(three, -1), np.array([1, 1, 1]))  # each hears the one before
    3
    >>> period(np.repeat(three, 2), np.array([1, 2, 0, 2, 0, 1]), np.full(6, -1))  # three mutual enemies
    2
    """
    n = int(target.max()) + 1
    pattern = sparse.csr_array((np.ones(source.size, dtype=np.int8), (source, target)), shape=(n, n))
    order, parent = breadth_first_order(pattern, 0)
    level = np.zeros(n, dtype=np.int64)
    for node in order[1:].tolist():
        level[node] = level[parent[node]] + 1
    d = int(np.gcd.reduce(level[source] + 1 - level[target]))
    if not find_camps(n, source, target, sign)[1].size:
        return d
    turned = np.where(level[target] % d == 0, -sign, sign)
    return 1 if find_camps(n, source, target, turned)[1].size else 2 * d


def _shares(self_weight: Any, graph: SignedDigraph) -> list[Fraction]:
    """Return which share each node keeps of its own opinion; prejudices and whoever hears nobody keep all anyway."""
    named = by_label(self_weight, "self_weight")
    if named is None:
        text = isinstance(self_weight, str)
        agents = [graph.labels[k] for k in agent_nodes(graph)]
        named = told_by_agent(self_weight, agents, "self_weight") if text else dict.fromkeys(agents, self_weight)
    own = [Fraction(0)] * graph.n_nodes
    for label, told in named.items():
        share = as_fraction(told, f"self_weight of {shorten(label)}")
        if not 0 <= share < 1:
            mend = "give the share 0 <= s < 1 that it keeps of its own opinion; negative ones are another model"
            raise ParameterError("self_weight", f"of {shorten(label)} is {format_exact(share)}; {mend}")
        own[graph.index[label] if label in graph.index else place_of(label, graph.labels)] = share
    return own


def _with_rows_of_one(graph: SignedDigraph, own: Sequence[Fraction]) -> SignedDigraph:
    """Return the graph with the weights ``a_kl`` and ``b_k``."""
    weights = [graph.exact_weight(edge) for edge in range(graph.n_edges)]
    heard = [Fraction(0)] * graph.n_nodes
    for node, weight in zip(graph.target.tolist(), weights, strict=True):
        heard[node] += abs(weight)
    scale = [(1 - share) / total if total else total for share, total in zip(own, heard, strict=True)]
    scaled = [weight * scale[node] for node, weight in zip(graph.target.tolist(), weights, strict=True)]
    return SignedDigraph(graph.labels, graph.source, graph.target, Weights(scaled), graph.read)


def _reached(graph: SignedDigraph, nodes: Sequence[int]) -> np.ndarray:
    """Tell of each node whether it is one of these, or hears of them."""
    n, some = graph.n_nodes, np.asarray(nodes, dtype=np.int64)
    source, target = (np.concatenate(both) for both in ((graph.source, np.full(some.size, n)), (graph.target, some)))
    pattern = sparse.csr_array((np.ones(source.size, dtype=np.int8), (source, target)), shape=(n + 1, n + 1))
    found = np.zeros(n + 1, dtype=bool)
    found[breadth_first_order(pattern, n, return_predecessors=False)] = True
    return found[:n]


def _decay(
    structure: Structure, own: Sequence[Fraction], begin: Sequence[Fraction], end: FinalState
) -> StepDecay | None:
    """Prove how fast opinions of those settle that hear, in the end, only who rests; the vector is found in floats."""
    graph, groups = structure.graph, [c.nodes for c in structure.closed_components if len(c.nodes) > 1]
    F = np.setdiff1d(structure.followers, np.flatnonzero(_reached(graph, [v for nodes in groups for v in nodes])))
    if not F.size or (intervals := end.intervals) is None:
        return None
    error = {k: abs(begin[k] - intervals[k][0]) + intervals[k][1] for k in F.tolist()}
    sizes, u = np.array([float(x) for x in error.values()]), np.ones(F.size)
    block = sparse.csr_array(2 * sparse.diags_array(graph.laplacian().diagonal()[F]) - abs(graph.laplacian())[F][:, F])
    fewest, best = math.inf, None
    for _ in range(_VECTORS):
        v = solve(block, u, block.diagonal())
        if not (v > _SMALLEST * v.max()).all():
            break
        rate, span = float((u / v).min()), float((sizes / v).max() * v.max())
        needed = (
            math.log(1 + span / (1e-3 * sizes.max() or 1)) / -math.log1p(-min(rate, 1 - 1e-9)) if rate > 0 else math.inf
        )
        if needed < fewest:
            fewest, best = needed, v / v.max()
        u = v / v.max()
    if best is None:
        return None
    weights = {k: Fraction(x) for k, x in zip(F.tolist(), best.tolist(), strict=True)}
    heard = {k: own[k] * x for k, x in weights.items()}
    for edge, (s, t) in enumerate(zip(graph.source.tolist(), graph.target.tolist(), strict=True)):
        if t in weights and s in weights:
            heard[t] += abs(graph.exact_weight(edge)) * weights[s]
    factor = rounded(max(heard[k] / x for k, x in weights.items()), _BITS, up=True)
    size = rounded(max(error[k] / x for k, x in weights.items()), _BITS, up=True)
    return StepDecay(factor, size, weights) if factor < 1 else None
