"""Where a family that comes to bipartite consensus ends for unknown constant weights, exactly.

Let ``z = G X(0)`` and ``c = eta(w)' z``, ``eta(w)`` the normalised left null vector of ``M(L)``.
If numbers ``h_k`` satisfy for every node ``k`` of the closed set

    z_k + sum_l |w_kl| (h_l - h_k)  <=  c+        at w+ where h_l > h_k, at w- elsewhere,

then ``c <= c+`` for all weights of the mode: multiply by ``eta_k(w) >= 0`` and add. Policy iteration, which solves for
``(c, h)`` and takes the worst weights, ends at the maximum, which is so attained. Weights that change may exceed it.

Weighted means that every signal keeps: they tell exactly where a group of leaders ends.

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

from lmi.dyadic import dyadic_array, round_to_bits
from lmi.exact.elementary_enclosures import rounded
from lmi.sparse_h_matrix import solve
from ptcc_certify.checker.common_kernel_ends import agents_heard
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import analyse, find_camps
from ptcc_certify.lyapunov.common_forms import MARGIN, CommonForm, mean_constant, rounded_up, weighted_mean
from ptcc_certify.lyapunov.follower_rows import IntervalRows, Policy
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.kernel import reached
from ptcc_certify.theorems.lemmas import exact_left_vector, solve_exact

_ROUNDS = 60
#: Longest numerators and denominators, in bits, that are written as they are; bits of others, about.
_SHORT, _BITS = 256, 64
Interval = tuple[Fraction, Fraction]


@dataclass(frozen=True, eq=False)
class ValueEnds:
    """Ends of the consensus value of one mode over all constant weights, in short numbers, and what proves them.

    Attributes
    ----------
    camps : tuple of N +1/-1
        ``x_k(T) = camps_k c``, the first node +1.
    nodes : tuple of int
        The closed set that decides.
    lower, upper : Fraction
    within : Fraction
        Members have values at most so far from either end.
    vectors : tuple of two tuples of Fraction, or None
        ``h`` of the upper end, and of the lower end, which is that of ``-z``. None of weights that change together,
        where ``c`` is the mean of ``z``.
    """

    camps: tuple[int, ...]
    nodes: tuple[int, ...]
    lower: Fraction
    upper: Fraction
    within: Fraction
    vectors: tuple[tuple[Fraction, ...], tuple[Fraction, ...]] | None

    @property
    def final_states(self) -> list[Interval]:
        """The ends of ``x_k(T)`` of every node."""
        return [(self.lower, self.upper) if g > 0 else (-self.upper, -self.lower) for g in self.camps]


def value_ends(mode: Mode, x0: Sequence[Fraction]) -> ValueEnds:
    """Enclose the consensus value of a mode over all constant weights in its intervals, in numbers that a file holds.

    Parameters
    ----------
    mode : Mode
        Connected; its edges keep camps, its mandatory graph has one closed component.
    x0 : sequence of N Fraction

    Returns
    -------
    ValueEnds
        Exact up to 120 nodes in the closed set, and for undirected graphs, rounded outwards where numbers are long;
        else the ends are proved, and some member is near them.

    Raises
    ------
    HypothesisError
        The mode does not come to bipartite consensus.

    Examples
    --------
    >>> ends = value_ends(Family.from_intervals([("a", "b", -2, -1), ("b", "a", -1, -1)]).modes[0], [0, Fraction(6)])
    >>> str(ends.lower), str(ends.upper), str(ends.within), ends.camps
    ('-3', '-2', '0', (1, -1))
    """
    n = len(mode.labels)
    gauge, violated, _ = find_camps(n, mode.source, mode.target, mode.sign)
    closed = analyse(mode.mandatory).closed_components
    if violated.size or len(closed) != 1:
        raise HypothesisError("the mode does not come to bipartite consensus for all weights in its intervals")
    nodes, camps = reached(n, mode.target, mode.source, np.array(closed[0].nodes)), tuple(gauge.tolist())
    z = [camps[v] * Fraction(x0[v]) for v in nodes.tolist()]
    if mode.tied:  # eta = 1 for every member
        mean = sum(z, Fraction(0)) / len(z)
        low, high = -_short_above(-mean), _short_above(mean)
        return ValueEnds(camps, tuple(nodes.tolist()), low, high, high - low, None)
    rows = IntervalRows.of([mode], nodes)
    root = int(np.searchsorted(nodes, closed[0].nodes[0]))
    (above, high, over), (below, low, under) = (
        _short_end(rows, side, _largest_value(rows, side, root)) for side in (z, [-x for x in z])
    )
    return ValueEnds(camps, tuple(nodes.tolist()), -low, high, max(over, under), (above, below))


def _short_end(
    rows: IntervalRows, z: Sequence[Fraction], h: tuple[Fraction, ...]
) -> tuple[tuple[Fraction, ...], Fraction, Fraction]:
    """Return short ``h``, the bound of all values that it proves, and how far below some value is at most."""
    spread = max(z) - min(z)
    if spread and not all(map(_is_short, h)):
        largest = int(rows.largest_sums(np.ones(rows.n + rows.outside, dtype=np.int64)).max())
        share = spread / (rows.unit * largest)
        unit = Fraction(2) ** (share.numerator.bit_length() - share.denominator.bit_length() - _BITS)
        h = tuple(round(x / unit) * unit for x in h)
    values = row_values(rows, z, h)
    if not spread or max(values) - max(z) > spread / 2**20:  # floats failed
        h, values = (Fraction(0),) * rows.n, list(z)
    bound = _short_above(max(values))
    return h, bound, _short_above(bound - min(values))


def _is_short(x: Fraction) -> bool:
    return max(map(int.bit_length, x.as_integer_ratio())) <= _SHORT


def _short_above(x: Fraction) -> Fraction:
    """Return a number, or where it is long a short one that is a little larger."""
    return x if _is_short(x) else rounded(x, _BITS, up=True)


def row_values(rows: IntervalRows, z: Sequence[Fraction], h: Sequence[Fraction]) -> list[Fraction]:
    """Return ``z_k + sum_l |w_kl| (h_l - h_k)`` of every row of one mode, the largest over all weights.

    By the left null vector, the value of every member is at most the largest of them, and of some at least the least.

    Examples
    --------
    >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)]).modes, np.array([0, 1]))
    >>> list(map(str, row_values(rows, [Fraction(0), Fraction(6)], [Fraction(0), Fraction(2)])))
    ['2', '4']
    """
    scale = math.lcm(*(x.denominator for x in h))
    whole = np.array([x.numerator * (scale // x.denominator) for x in h] + [0] * rows.outside, dtype=object)
    unit = rows.unit / scale
    return [x - unit * p for x, p in zip(z, rows.pull(whole).ravel().tolist(), strict=True)]


# ---------------------------------------------------------------------- policy iteration


def _largest_value(rows: IntervalRows, z: list[Fraction], root: int) -> tuple[Fraction, ...]:
    """Return ``h`` that proves the largest value, or one that is little larger."""
    floats = np.array([nearest_float(x) for x in z])
    top = float(np.abs(floats).max(initial=0)) or 1.0
    policy = rows.worst(np.zeros(rows.n))
    h = np.zeros(rows.n)
    seen = -np.inf
    for _ in range(_ROUNDS):
        h, c = _solve(rows, policy, floats / top, root)
        new = rows.worst(h)
        if not np.isfinite(h).all() or new == policy or c <= seen:
            break
        seen, policy = c, new
    if rows.n <= EXACT_NODES:
        return _largest_exactly(rows, z, root, policy)
    whole, power = dyadic_array(np.where(np.isfinite(h), h, 0.0) * top)
    vector = tuple(int(x) * Fraction(2) ** power for x in whole.tolist())
    return vector if max(row_values(rows, z, vector)) <= max(z) else (Fraction(0),) * rows.n


def _solve(rows: IntervalRows, policy: Policy, z: np.ndarray, root: int) -> tuple[np.ndarray, float]:
    """Return ``h`` and ``c`` with ``M h + c 1 = z`` and ``h_root = 0``, in floats."""
    h = np.zeros(rows.n)
    if rows.n == 1:
        return h, float(z[0])
    M = rows.system(policy)
    rest = np.flatnonzero(np.arange(rows.n) != root)
    block = M[rest][:, rest]
    diagonal = block.diagonal()
    A, B = solve(block, z[rest], diagonal), solve(block, np.ones(rest.size), diagonal)
    heard = M[[root]][:, rest].toarray()[0]
    c = float((z[root] - heard @ A) / (1 - heard @ B))
    h[rest] = A - c * B
    return h, c


def _largest_exactly(rows: IntervalRows, z: list[Fraction], root: int, policy: Policy) -> tuple[Fraction, ...]:
    while True:
        c, h = _solve_exactly(rows, policy, z, root)
        if max(row_values(rows, z, h)) == c:
            return h
        heard = np.array([h[j] > h[k] for k, j in zip(rows.target.tolist(), rows.source.tolist(), strict=True)])
        policy = Policy(policy.mode, heard)


def _solve_exactly(
    rows: IntervalRows, policy: Policy, z: list[Fraction], root: int
) -> tuple[Fraction, tuple[Fraction, ...]]:
    n, zero = rows.n, Fraction(0)
    system = [[zero] * n for _ in range(n)]  # the column of the root is that of c
    weights = np.where(policy.largest, rows.upper, rows.lower).tolist()
    for k, j, w in zip(rows.target.tolist(), rows.source.tolist(), weights, strict=True):
        system[k][k] += w * rows.unit
        system[k][j] -= w * rows.unit
    for row in system:
        row[root] = Fraction(1)
    solution = solve_exact(system, [[x] for x in z])
    assert solution is not None, "there is one closed component"
    h = [row[0] for row in solution]
    c, h[root] = h[root], zero
    return c, tuple(h)


def middle_left_vector(family: Family) -> tuple[Fraction, ...]:
    """Return a short rational vector near to the left null vector of ``M(L)``, all weights in the middle, of sum 1.

    Examples
    --------
    >>> middle_left_vector(Family.from_intervals([("a", "b", 1, 3), ("b", "a", 2, 2)]))
    (Fraction(1, 2), Fraction(1, 2))
    """
    n = family.n_nodes
    M = np.zeros((n, n))
    for mode in family.modes:
        weights = (mode.lower.as_float() + mode.upper.as_float()) / 2
        np.add.at(M, (mode.target, mode.target), weights)
        np.add.at(M, (mode.target, mode.source), -weights)
    system = np.vstack([M.T / (np.abs(M).max() or 1.0), np.ones(n)])
    eta = np.maximum(np.linalg.lstsq(system, np.append(np.zeros(n), 1.0), rcond=None)[0], 0.0)
    p = [round_to_bits(float(x), 40) if x > 1e-12 else Fraction(0) for x in eta]
    largest = int(np.argmax(eta))
    p[largest] += 1 - sum(p, Fraction(0))
    return tuple(p)


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
    >>> from ptcc_certify.lyapunov.common_forms import Quotient
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
