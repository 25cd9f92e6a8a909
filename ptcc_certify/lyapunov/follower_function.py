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

References
----------
docs/theory/families.md, "Rows".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from operator import mul

import numpy as np

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import weak_components
from ptcc_certify.lyapunov.common_form_search import search_common_forms
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.interval_rows import IntervalRows, least_quotient
from ptcc_certify.lyapunov.row_decay import FollowerDecay, follower_decays, follower_nodes, least_rate
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide
from ptcc_certify.theorems.kernel import UNKNOWN, Kernel, TooLarge

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
