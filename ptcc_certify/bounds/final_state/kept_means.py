"""Weighted means that every signal keeps: they tell exactly where a group of leaders ends.

Let a component of a family have a common kernel with basis ``B``. The pivot of column ``j`` and all agents that it
hears have rows ``g_k e_j'``: a *leading group* with camps ``g``, which ends at ``g c_j``. If ``p' M(L) = 0`` for every
member, ``p`` supported on the group, then ``c_j = p' G X(0) / p' 1`` for every signal. Only the left null vector of the
mandatory graph of the first mode can be such a ``p``: ones for undirected graphs. Where there is none, a Lyapunov
function keeps ``p' G X`` near its first value, nearest for a ``p`` that is nearly one for all members.

References
----------
docs/theory/families.md, "Where it ends".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.final_state.constant_weights import middle_left_vector
from ptcc_certify.checker.common_kernel_ends import agents_heard
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov.common_forms import MARGIN, CommonForm, mean_constant, rounded_up, weighted_mean
from ptcc_certify.lyapunov.interval_rows import IntervalRows
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.lemmas import exact_left_vector


@dataclass(frozen=True, eq=False)
class LeadingGroup:
    """The pivot of a column of a common kernel, and all agents that it hears through edges of any modes.

    Attributes
    ----------
    nodes : tuple of int
        Ascending.
    camps : tuple of +1/-1
        It ends at these times ``c_j``; the pivot has +1.
    vector : tuple of int, or None
        ``p``, up to a factor, if every signal keeps ``p' G X``; None if no such ``p`` was found.
    """

    nodes: tuple[int, ...]
    camps: tuple[int, ...]
    vector: tuple[int, ...] | None

    def final_value(self, x: Sequence[Fraction]) -> Fraction | None:
        """Return ``c_j`` from the states of all agents of the component; None without a vector.

        Examples
        --------
        >>> from ptcc_certify.theorems.family_behaviour import decide
        >>> (component,) = decide(Family.from_intervals([("a", "b", -2, -1), ("b", "c", 1, 5)], undirected=True))
        >>> leading_groups(component)[0].final_value([Fraction(1), Fraction(-3), Fraction(-5)])
        Fraction(3, 1)
        """
        if self.vector is None:
            return None
        terms = zip(self.vector, self.camps, self.nodes, strict=True)
        return sum((p * g * x[v] for p, g, v in terms), Fraction(0)) / sum(self.vector)


def leading_groups(component: FamilyComponent) -> tuple[LeadingGroup, ...]:
    """Return the leading group of every column of a component with a common kernel.

    A vector is looked for among the ones, and up to 120 leaders among all.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> edges = [("a", "b", 1, 1), ("b", "a", 3, 3), ("b", "c", 1, 2)]
    >>> leading_groups(decide(Family.from_intervals(edges))[0])[0].vector
    (1, 3)
    """
    kernel, family = component.kernel, component.family
    if kernel is None or not kernel.dimension:
        return ()
    closed = [c for c in component.structures[0].closed_components if c.balanced]
    source, target, _ = family.union
    pairs = zip(source.tolist(), target.tolist(), strict=True)
    groups = agents_heard(pairs, {j: c.nodes[0] for j, c in enumerate(closed)})
    result = []
    for j, c in enumerate(closed):
        nodes = np.array(groups[j], dtype=np.int64)
        camps = np.sign(kernel.codes[nodes]).tolist()
        vector = _kept_vector(family, nodes, np.array(c.nodes)) if nodes.size > 1 else (1,)
        result.append(LeadingGroup(tuple(groups[j]), tuple(camps), vector))
    return tuple(result)


def mean_of_shares(component: FamilyComponent, shares: Sequence[Fraction]) -> LeadingGroup | None:
    """Return all agents as a group with a mean that every signal keeps, if shares of the clock bring them together.

    Where they do, the mean of the modes over the shares brings them together, too; only its left null vector can be
    kept. For components of up to 120 agents.

    Parameters
    ----------
    component : FamilyComponent
        All edges of all modes keep its camps.
    shares : sequence of Fraction
        One of each mode.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> pair = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -3)])
    >>> outage = SignedDigraph.from_edges([], nodes="ab")
    >>> group = mean_of_shares(decide(Family.switching([pair, outage]))[0], [Fraction(3, 4), Fraction(1, 4)])
    >>> group.vector, group.camps, group.final_value([Fraction(8), Fraction(0)])
    ((1, 3), (1, -1), Fraction(2, 1))
    """
    assert component.gauge is not None, "agents come together by camps"
    family, nodes = component.family, np.arange(component.nodes.size)
    weights: dict[tuple[int, int], Fraction] = {}
    for mode, share in zip(family.modes, shares, strict=True):
        for e, ends in enumerate(zip(mode.source.tolist(), mode.target.tolist(), strict=True)):
            weights[ends] = weights.get(ends, Fraction(0)) + share * mode.lower.fraction(e)
    edges = [(s, t, w) for (s, t), w in weights.items() if w]
    mean = SignedDigraph.from_edges(edges, nodes=nodes.tolist())
    closed = analyse(mean).closed_components
    if len(closed) != 1 or nodes.size > EXACT_NODES:
        return None
    leaders = np.array(closed[0].nodes)
    whole = _whole_vector(nodes, leaders, exact_left_vector(mean.subgraph(leaders)))
    rows = IntervalRows.of(family.modes, nodes)
    if not _is_kept(rows, _tied(family, rows), whole):
        return None
    return LeadingGroup(tuple(nodes.tolist()), tuple(component.gauge.tolist()), tuple(whole.tolist()))


def with_means(function: CommonForm, groups: Sequence[LeadingGroup]) -> CommonForm:
    """Add to a function of positive rate a weighted mean of each leading group that keeps none exactly.

    Examples
    --------
    >>> from ptcc_certify.lyapunov.common_form_search import search_common_forms
    >>> from ptcc_certify.lyapunov.quotient import Quotient
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> (component,) = decide(Family.from_intervals([("a", "b", 9, 11), ("b", "a", 9, 11)]))
    >>> V = with_means(search_common_forms(Quotient.of(component)).functions[0], leading_groups(component))
    >>> [str(p) for p in V.means[0].weights.values()]
    ['1/2', '1/2']
    """
    if function.rate <= 0:
        return function
    means = []
    for group in groups:
        if group.vector is None:
            p = middle_left_vector(function.quotient.family.restricted(np.array(group.nodes)))
            q = {v: g * weight for v, g, weight in zip(group.nodes, group.camps, p, strict=True) if weight}
            constant = mean_constant(function, q)
            if constant is not None:
                means.append(weighted_mean(function.quotient, q, rounded_up(constant * MARGIN)))
    return replace(function, means=tuple(means))


def _kept_vector(family: Family, nodes: np.ndarray, leaders: np.ndarray) -> tuple[int, ...] | None:
    """Return ``p`` of a group by its nodes, in integers; ``leaders`` are those of the first mode, ascending."""
    rows = IntervalRows.of(family.modes, nodes)
    tied = _tied(family, rows)
    ones = np.ones(nodes.size, dtype=np.int64).astype(object)
    if _is_kept(rows, tied, ones):
        return tuple(ones.tolist())
    if leaders.size > EXACT_NODES:
        return None
    whole = _whole_vector(nodes, leaders, exact_left_vector(family.modes[0].restricted(leaders).mandatory))
    return tuple(whole.tolist()) if _is_kept(rows, tied, whole) else None


def _whole_vector(nodes: np.ndarray, leaders: np.ndarray, p: Sequence[Fraction]) -> np.ndarray:
    """Return ``p`` of the leaders in integers, by nodes, both ascending; 0 of the others."""
    scale = math.lcm(*(y.denominator for y in p))
    whole = np.zeros(nodes.size, dtype=object)
    whole[np.searchsorted(nodes, leaders)] = [y.numerator * (scale // y.denominator) for y in p]
    return whole


def _tied(family: Family, rows: IntervalRows) -> np.ndarray:
    """Tell of every edge of the rows whether its mode is undirected."""
    return np.array([mode.tied for mode in family.modes])[rows.mode]


def _is_kept(rows: IntervalRows, tied: np.ndarray, p: np.ndarray) -> bool:
    """Tell whether ``p' M(L) = 0`` for every member of every mode; nobody in the rows hears a node of none."""
    own, heard = p[rows.target], p[rows.source]
    uncertain = rows.lower != rows.upper
    if (np.where(tied, own != heard, own != 0) & uncertain).any():
        return False
    total = np.zeros((rows.modes, rows.n), dtype=object)
    flow = own * rows.lower.astype(object)
    np.add.at(total, (rows.mode, rows.target), flow)
    np.subtract.at(total, (rows.mode, rows.source), flow)
    return not total.any()
