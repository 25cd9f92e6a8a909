"""Lyapunov functions of families with followers, of any size: quadratic forms of what leads, rows of what follows.

Of a component with common states at rest, ``F`` follows the agents ``R`` that hear none of ``F``. Parts ``j`` of ``R``
have functions ``V_j`` of rates ``r_j``, with ``|xi_l| <= sqrt(c_l V_j)``, and ``|(L X)_p| <= sqrt(b_p V_j)`` of their
pivots ``p``. With ``d > 0``, ``t_j > 0``, ``e_l >= t_j sqrt(c_l)``, ``q_p >= t_j sqrt(b_p)`` (0 of agents at rest) let

    W = max( max_(k in F) |xi_k| / d_k,  max_j sqrt(V_j) / t_j ).

If in every mode, at the worst weights, for all ``k`` in ``F``

    sum_(l in F) |w_kl| (d_k - d_l) + sum_(l in R) |w_kl| (d_k - e_l) - sum_p |B_kp| q_p  >=  gamma d_k

and ``gamma <= r_j / 2``, then ``W <= e^(-gamma s) W(0)`` for every signal: at the largest ``|xi_k| / d_k``, what agent
``k`` hears is at most ``d_l W`` or ``e_l W``, and its target ``sum_p B_kp x_p`` moves at most that fast. One pass over
the edges, in integers.

The decay of followers of any size under every signal, proved row by row in integers.

Let nobody outside ``F`` hear a node of ``F``. If ``d > 0`` and, for every node ``k`` of ``F``, in every mode,

    sum_(l in F) |w_kl| (d_k - d_l) + sum_(l not in F) |w_kl| d_k  >=  alpha d_k

at the worst weights, ``w+`` where ``d_l > d_k`` and ``w-`` elsewhere, then ``max_k |x_k| / d_k`` decays with
``e^(-alpha s)`` along ``X_F' = -L_F X_F`` for every signal. With one mode, independent directed weights and camps that
all edges in ``F`` keep, the largest ``alpha`` is the smallest eigenvalue of ``L_F`` over the box, and constant weights
attain it: no certificate of any kind proves more.

The search is policy iteration: solve ``(M - t I) d = 1``, take the worst weights for that ``d``, again until they
stand. Whatever it proposes, integers decide.

References
----------
docs/theory/families.md, "Rows".
docs/theory/families.md, "Rows". Howard, Dynamic Programming and Markov Processes, 1960.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from operator import mul

import numpy as np

from lmi.dyadic import dyadic_array, round_array
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers
from lmi.sparse_h_matrix import positive_vector, smallest_eigenvalue
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import analyse, weak_components
from ptcc_certify.lyapunov.common_form_search import search_common_forms
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.follower_rows import IntervalRows, Policy, least_quotient
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide
from ptcc_certify.theorems.kernel import UNKNOWN, Kernel, TooLarge, reached

#: Rounds of policy iteration, and of the search for the rate.
_ROUNDS, _TRIALS = 40, 24
#: Relative distance of the search from the smallest eigenvalue, and at which it ends.
_NEAR, _TOLERANCE = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class FollowerDecay:
    """``max_k |x_k| / d_k <= e^(-rate s)`` times its first value, along ``X_F' = -L_F X_F``, for every signal.

    Attributes
    ----------
    nodes : (n,) int array
        ``F``, ascending.
    vector : (n,) array of positive int64 or Python ints
        ``d``, up to a common factor.
    rate : Fraction
        ``alpha`` of the norm, per unit of the clock; that of squared functions is twice this.
    """

    nodes: np.ndarray
    vector: np.ndarray
    rate: Fraction

    @property
    def overshoot(self) -> Fraction:
        """``max d / min d``, which multiplies the largest ``|x_k|``."""
        return Fraction(int(self.vector.max()), int(self.vector.min()))


def follower_nodes(family: Family) -> np.ndarray:
    """Return the nodes of which no closed component of any mandatory graph hears, through any edges; ascending.

    Examples
    --------
    >>> follower_nodes(Family.from_intervals([("a", "b", 1, 2), ("b", "c", 0, 1), ("a", "c", 1, 1)])).tolist()
    [1, 2]
    """
    closed = [v for mode in family.modes for c in analyse(mode.mandatory).closed_components for v in c.nodes]
    source, target, _ = family.union
    heard = reached(family.n_nodes, target, source, np.unique(np.array(closed, dtype=np.int64)))
    return np.setdiff1d(np.arange(family.n_nodes), heard)


def follower_decay(family: Family, nodes: np.ndarray | None = None, loss: float = _NEAR) -> FollowerDecay | None:
    """Search and prove the decay of followers.

    Parameters
    ----------
    family : Family
    nodes : (n,) int array, optional
        ``F``, ascending; nobody outside hears them. By default :func:`follower_nodes`.
    loss : float
        Share of the largest rate that is given up, so that ``d`` has a smaller range.

    Returns
    -------
    FollowerDecay or None
        None if there are no followers or rows prove no positive rate.

    Raises
    ------
    ValueError
        A node outside hears one of ``F``.

    References
    ----------
    docs/theory/families.md, "Rows".

    Examples
    --------
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 3, 4), ("c", "b", 1, 2)])
    >>> round(float(follower_decay(chain).rate), 5)
    0.55051
    """
    return next(follower_decays(family, nodes, [loss]), None)


def follower_decays(family: Family, nodes: np.ndarray | None, losses: Iterable[float]) -> Iterator[FollowerDecay]:
    """Yield the decay of followers for every loss, as :func:`follower_decay`, from one search; nothing if that fails.

    Examples
    --------
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2)])
    >>> [(round(float(one.rate), 2), round(float(one.overshoot))) for one in follower_decays(chain, None, [0.01, 0.5])]
    [(0.99, 101), (0.67, 3)]
    """
    nodes = follower_nodes(family) if nodes is None else np.asarray(nodes, dtype=np.int64)
    source, target, _ = family.union
    if (np.isin(source, nodes) & ~np.isin(target, nodes)).any():
        raise ValueError("a node outside the followers hears one of them")
    rows = IntervalRows.of(family.modes, nodes)
    with np.errstate(all="ignore"):
        found = _largest_rate(rows) if nodes.size else None
        if found is None:
            return
        t, policy = found
    for loss in losses:
        with np.errstate(all="ignore"):
            d, _ = _vector(rows, t * (1 - loss), policy)
        if d is not None and (decay := prove_follower_decay(rows, nodes, d)) is not None:
            yield decay


def prove_follower_decay(rows: IntervalRows, nodes: np.ndarray, d: np.ndarray) -> FollowerDecay | None:
    """Prove the rate of a positive vector, rounded to 40 bits: the least quotient of a row and ``d``, in integers.

    None if that is not positive.

    Examples
    --------
    >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 2, 5)]).modes, np.array([1]))
    >>> prove_follower_decay(rows, np.array([1]), np.array([0.3])).rate
    Fraction(2, 1)
    """
    whole, _ = dyadic_array(round_array(d))
    rate = least_rate(rows, whole)
    return FollowerDecay(nodes, whole, rounded(rate, 53)) if rate > 0 else None


def least_rate(
    rows: IntervalRows, d: np.ndarray, outside: np.ndarray | None = None, drifts: Sequence[Fraction] = ()
) -> Fraction:
    """Return the largest ``alpha`` that positive integers ``d`` prove; exact.

    ``sum_l |w_kl| (d_k - d_l) - drift_k >= alpha d_k``, with ``d_l`` of nodes outside as given, 0 by default. Drifts
    are rounded up to multiples of the unit.

    Examples
    --------
    >>> rows = IntervalRows.of(Family.from_intervals([("a", "b", 2, 5), ("b", "c", 1, 3)]).modes, np.array([1, 2]))
    >>> least_rate(rows, np.array([1, 2])), least_rate(rows, np.array([2, 1]))
    (Fraction(1, 2), Fraction(-3, 1))
    """
    outside = np.zeros(rows.outside, dtype=np.int64).astype(d.dtype) if outside is None else outside
    pull = rows.pull(np.concatenate([d, outside]))
    if any(drifts):
        pull = pull - np.array([-(-q // rows.unit) for q in drifts], dtype=object)
    return least_quotient(pull.ravel(), np.tile(d, rows.modes)) * rows.unit


# ---------------------------------------------------------------------- search


def _extended(rows: IntervalRows, d: np.ndarray) -> np.ndarray:
    return np.concatenate([d, np.zeros(rows.outside)])


def _vector(rows: IntervalRows, t: float, policy: Policy) -> tuple[np.ndarray | None, Policy]:
    """Return ``d`` that proves a rate above ``t``, or None, and the last policy: refused, its member is slower."""
    for _ in range(_ROUNDS):
        d = positive_vector(rows.system(policy), t)
        if not (np.isfinite(d).all() and (d > 0).all() and d.max() < 1e250 * d.min()):
            return None, policy
        if (rows.pull(_extended(rows, d)) >= t * d).all():
            return d, policy
        new = rows.worst(_extended(rows, d))
        if new == policy:
            return None, policy
        policy = new
    return None, policy


def _largest_rate(rows: IntervalRows) -> tuple[float, Policy] | None:
    """Return a rate just below the largest, and the policy of a member that is slow; None if none is positive."""
    policy, low = rows.worst(_extended(rows, np.ones(rows.n))), 0.0
    for _ in range(_ROUNDS):
        found = smallest_eigenvalue(rows.system(policy), shifted=True)
        if found is None:
            return None
        high = found[0] * (1 - _NEAR)
        d, new = _vector(rows, high, policy)
        if d is not None:
            low, policy, high = high, new, high * (1 + 3 * _NEAR)
            break
        if new == policy:
            break
        policy = new
    # The bound of the eigenvalue of a block that is nearly triangular is far below it: the test itself decides.
    if low:
        d, _ = _vector(rows, high, policy)
        if d is not None:
            low, high = high, float(rows.system(policy).diagonal().min())
    for _ in range(_TRIALS):
        if high <= low * (1 + _TOLERANCE):
            break
        t = (low + high) / 2
        d, new = _vector(rows, t, policy)
        low, high, policy = (t, high, new) if d is not None else (low, t, policy)
    return (low, policy) if low > 0 else None


#: Shares of the rate of the followers that the agents they follow may take: the larger, the smaller is ``W(0)``. Above
#: ``MANY_FOLLOWERS`` there is one function alone.
LOSSES, MANY_FOLLOWERS = (0.01, 0.3), 5000
#: Bits of ``W``, which is rounded up; the check rounds likewise.
ROOT_BITS = 64
#: Bits of the least ``e``.
_BITS = 24
#: Agents of a part of ``R``, beyond which no function is searched for it.
LARGEST_PART = 120


@dataclass(frozen=True, eq=False)
class LeadingPart:
    """A part of ``R`` in which something moves.

    Attributes
    ----------
    agents : (n,) int array
        In the component, ascending. Nobody outside is heard.
    function : CommonForm
        Of the family on them; nodes are numbered within them.
    times : Fraction
        ``t``.
    """

    agents: np.ndarray
    function: CommonForm
    times: Fraction

    @property
    def bounds(self) -> dict[int, Fraction]:
        """``t sqrt(c_l)``, rounded up, of the agents that are no pivots, by their numbers in the component."""
        pairs = zip(self.function.nodes, self.function.coordinate_constants, strict=True)
        return {int(self.agents[v]): self.times * root_above(c) for v, c in pairs}

    @property
    def ends(self) -> dict[int, Fraction]:
        """``e_l``: the bounds as the rows take them, integers."""
        return {v: Fraction(-(-bound // 1)) for v, bound in self.bounds.items()}

    @property
    def speeds(self) -> dict[int, Fraction]:
        """``q_p``, rounded up, of the pivots, by their numbers in the component."""
        constants = self.function.input_constants
        return {int(self.agents[p]): self.times * root_above(constants[p]) for p in self.function.quotient.pivots}


@dataclass(frozen=True, eq=False)
class FollowerFunction:
    """``W^2`` of the module: ``W^2 <= e^(-rate s) W(0)^2`` for every signal.

    Attributes
    ----------
    family : Family
        Of the component; nodes are numbered within it.
    kernel : Kernel
    followers : (n,) int array
    vector : (n,) array of positive Python ints
        ``d``.
    outside : (N - n,) array of nonnegative Python ints
        ``e`` of the agents that are no followers, ascending.
    parts : tuple of LeadingPart
    rate : Fraction
        Of ``W^2``: at most ``2 gamma`` and every ``r_j``.
    """

    family: Family
    kernel: Kernel
    followers: np.ndarray
    vector: np.ndarray
    outside: np.ndarray
    parts: tuple[LeadingPart, ...]
    rate: Fraction

    kind = "rows"
    optimal = False
    means = ()

    @property
    def overshoot(self) -> Fraction:
        """``(max d / min d)^2`` of the followers."""
        return Fraction(int(self.vector.max()), int(self.vector.min())) ** 2

    @cached_property
    def _sizes(self) -> np.ndarray:
        """(N,) array of Python ints: bounds of ``|xi_k| / W``; 0 of agents at rest and pivots."""
        n = self.family.n_nodes
        sizes = np.zeros(n, dtype=object)
        sizes[self.followers] = self.vector
        sizes[np.setdiff1d(np.arange(n), self.followers)] = self.outside
        return sizes

    @cached_property
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / W`` for every member: ``sum_l w+ (size_k + size_l)`` of followers.

        Integers by node, and what multiplies them.
        """
        rows, rest = IntervalRows.of(self.family.modes, self.followers), set(range(self.family.n_nodes))
        sums = rows.largest_sums(np.concatenate([self.vector, self.outside])).tolist()
        result: list[Scaled] = [(dict(zip(self.followers.tolist(), sums, strict=True)), rows.unit)]
        for part in self.parts:
            ((vector, unit),) = part.function.speeds
            result.append((dict(zip(part.agents.tolist(), vector.values(), strict=True)), unit * part.times))
        return [*result, (dict.fromkeys(rest.difference(*(vector for vector, _ in result)), 0), Fraction(1))]

    @property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / W``, of all agents but pivots and those at rest."""
        return [({k: size for k, size in enumerate(self._sizes.tolist()) if size}, Fraction(1))]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``W`` of a state of the component, rounded up to 64 bits."""
        (whole,), scale = integers([x])
        state, d = np.array(whole, dtype=object), self.vector
        largest = -least_quotient(-abs(state[self.followers] - self._targets(state)), d)
        roots = [largest / scale]
        for part in self.parts:
            roots.append(part.function.root([x[v] for v in part.agents.tolist()]) / part.times)
        return rounded(max(roots), ROOT_BITS, up=True)

    def spread(self, sizes: Mapping[int, Fraction]) -> Fraction | None:
        """Return 1, a weighted maximum, if followers hear no groups; None otherwise."""
        return None if self.parts else Fraction(1)

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``W^2`` of all states with ``|x_k| <= sizes_k``, rounded up to 64 bits."""
        (whole,), scale = integers([[sizes[v] for v in range(self.family.n_nodes)]])
        state, d = np.array(whole, dtype=object), self.vector
        largest = -least_quotient(-(state[self.followers] + self._targets(state, sizes=True)), d)
        squares = [(largest / scale) ** 2]
        for part in self.parts:
            own = dict(enumerate(sizes[v] for v in part.agents.tolist()))
            squares.append(part.function.largest(own) / part.times**2)
        return rounded(max(squares), ROOT_BITS, up=True)

    def _targets(self, state: np.ndarray, sizes: bool = False) -> np.ndarray:
        """Return what the pivots make of every follower at rest, of a state of Python ints, or at most, of sizes."""
        pivots = [c.nodes[0] for c in self.kernel.structure.closed_components if c.balanced]
        rest = np.array([0, *state[pivots].tolist()], dtype=object)
        codes = self.kernel.codes[self.followers]
        columns = np.where(codes == UNKNOWN, 0, codes)
        targets = rest[abs(columns)] if sizes else rest[abs(columns)] * np.sign(columns).astype(object)
        for k in np.flatnonzero(codes == UNKNOWN).tolist():
            row = self.kernel.row(int(self.followers[k]))
            targets[k] = sum(map(mul, map(abs, row) if sizes else row, rest[1:].tolist()))
        return targets


def follower_functions(
    component: FamilyComponent, losses: Sequence[float] = LOSSES, notes: list[str] | None = None
) -> Iterator[FollowerFunction]:
    """Search and prove functions of a component that has followers and common states at rest; from the fastest.

    Yields nothing where rows prove no positive rate, or no function is found of a part that the followers hear;
    ``notes`` is told which.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> chain = [("a", "b", 1, 2), ("b", "a", 1, 2), ("b", "c", 3, 4), ("c", "d", 1, 2)]
    >>> [round(float(W.rate), 3) for W in follower_functions(decide(Family.from_intervals(chain))[0])]
    [1.995, 1.854]
    """
    family = component.family
    followers = follower_nodes(family)
    if component.kernel is None or not followers.size:
        return
    parts = _leading_parts(family, followers)
    if parts is None:
        if notes is not None:
            notes.append("no function was found of the agents that lead")
        return
    found, losses = False, losses if followers.size <= MANY_FOLLOWERS else losses[:1]
    for loss, decay in zip(losses, follower_decays(family, followers, [loss / 2 for loss in losses]), strict=False):
        if (function := _compose(component, decay, parts, loss)) is not None:
            found = True
            yield function
    if not found and notes is not None:
        notes.append("the rows of the followers prove no rate")


def _leading_parts(family: Family, followers: np.ndarray) -> list[LeadingPart] | None:
    """Return the parts of ``R`` in which something moves, each with its function; None if one has none."""
    rest = np.setdiff1d(np.arange(family.n_nodes), followers)
    part_family = family.restricted(rest)
    source, target, _ = part_family.union
    parts = []
    for own in weak_components(rest.size, source, target):
        if own.size == 1:
            continue
        if own.size > LARGEST_PART:
            return None
        (component,) = decide(part_family.restricted(own))
        try:
            quotient = Quotient.of(component)
        except (HypothesisError, TooLarge):
            return None
        functions = search_common_forms(quotient).functions
        if not functions or functions[0].rate <= 0:
            return None
        parts.append(LeadingPart(rest[own], functions[0], Fraction(1)))
    return parts


def _compose(
    component: FamilyComponent, decay: FollowerDecay, parts: list[LeadingPart], loss: float
) -> FollowerFunction | None:
    """Choose ``t`` so that the followers lose about this share of their rate, and prove what is left."""
    family = component.family
    rows = IntervalRows.of(family.modes, decay.nodes)
    rest = np.setdiff1d(np.arange(family.n_nodes), decay.nodes)
    d = decay.vector.astype(object)
    place = {v: k for k, v in enumerate(rest.tolist())}
    size = np.zeros(rest.size)
    for part in parts:
        for v, bound in part.bounds.items():
            size[place[v]] = nearest_float(bound)
    assert component.kernel is not None
    drifts = np.array([nearest_float(q) for q in _drifts(component.kernel, decay.nodes, parts)])
    push = rows.largest_pushes(np.concatenate([np.zeros(rows.n), size])) + drifts
    floats = d.astype(float)
    fastest = float(decay.rate) / (1 - loss / 2)
    aim = (1 - loss) * min([fastest, *(float(part.function.rate) / 2 for part in parts)])
    slack = rows.pull(np.concatenate([floats, np.zeros(rest.size)])) - aim * floats
    with np.errstate(divide="ignore", invalid="ignore"):
        room = float(np.where(push > 0, slack / push, np.inf).min())
    outside = np.zeros(rest.size, dtype=object)
    if parts:
        if not (0 < room < np.inf):
            room = float(d.max())
        times = Fraction(2) ** int(np.floor(np.log2(room)))
        least = min((times * bound for part in parts for bound in part.bounds.values() if bound), default=Fraction(1))
        up = max(0, _BITS - (least.numerator.bit_length() - least.denominator.bit_length()))
        d, times = d << up, times * 2**up
        parts = [LeadingPart(p.agents, p.function, times) for p in parts]
        for part in parts:
            for v, end in part.ends.items():
                outside[place[v]] = int(end)
    gamma = least_rate(rows, d, outside, _drifts(component.kernel, decay.nodes, parts))
    rate = min([rounded(2 * gamma, 53), *(part.function.rate for part in parts)])
    if rate <= 0:
        return None
    return FollowerFunction(family, component.kernel, decay.nodes, d, outside, tuple(parts), rate)


def _drifts(kernel: Kernel, followers: np.ndarray, parts: Sequence[LeadingPart]) -> list[Fraction]:
    """Return ``sum_p |B_kp| q_p`` of every follower."""
    speeds: dict[int, Fraction] = {}
    for part in parts:
        speeds |= part.speeds
    zero = Fraction(0)
    if not any(speeds.values()):
        return [zero] * followers.size
    own = [speeds.get(c.nodes[0], zero) for c in kernel.structure.closed_components if c.balanced]
    by_code = [zero, *own]
    codes = zip(followers.tolist(), abs(kernel.codes[followers]).tolist(), strict=True)
    return [
        sum((abs(b) * q for b, q in zip(kernel.row(k), own, strict=True) if b), zero)
        if code == UNKNOWN
        else by_code[code]
        for k, code in codes
    ]
