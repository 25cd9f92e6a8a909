"""How far agents of a component are from where they end, and how fast they go, for every signal; in floats, upwards.

With ``sqrt(V) <= y``, ``|(L y)_k| <= c_k sqrt(V)``, sliding variables that move by ``|sigma_k| <= psi |sigma_k(0)|``,
``R(t) = int_t^T gain psi`` and a rate ``2 alpha``,

    |x_k(t) - x_k(T)|  <=  c_k (y(t) + c R(t)) / alpha + m_k R(t) + |sigma_k|,      |u_k|  <=  gain (c_k y + m_k psi)

where ``c`` and ``m_k`` are those of :mod:`ptcc_certify.checker.signal_bounds`: the first is what the speeds add up to
until the deadline. Deviations are besides at most what :func:`from_rest` tells where ``R`` is 0, and at all times
where all agents end at 0.

References
----------
docs/theory/families.md, "Where it ends", "Disturbances" and "Inputs".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple, Protocol

import numpy as np

from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.bounds.decay import Decay, ReachingPhase
from ptcc_certify.bounds.deviation.heard import HeardRows
from ptcc_certify.bounds.instants import Instants
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.reading import Interval
from ptcc_certify.checker.signal_bounds import Drive, least
from ptcc_certify.checker.signal_bounds import Function as BoundsFunction

_SLACK = 1 + 1e-12
#: Bits beyond those of the sizes to which shares of these are rounded up.
_ROUNDING_BITS = 32


class Function(BoundsFunction, Protocol):
    """What the formulas of the bounds take, and how large coordinates are."""

    @property
    def sizes(self) -> Sequence[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""


class RestStates(NamedTuple):
    """The common kernel of a component: the rows of its basis by node, without zeros, and its leading groups."""

    rows: Mapping[int, Mapping[int, Fraction]]
    groups: Sequence[Sequence[int]]


def from_rest(sizes: Sequence[Scaled], rest: RestStates) -> Scaled:
    """Bound ``|x_k(t) - x_k(T)| / sqrt(V)``, for every signal after ``t``.

        x_k - x_k(T) = xi_k + sum_j B_kj (x_(p_j) - c_j)

    Of every leading group ``c_j`` is between the least and the largest ``g_l x_l`` at all times, since no signal lets
    these grow apart: its pivot is no farther from it than the farthest agent of the group from the pivot, and another
    one no farther than from some other agent. Groups of one agent rest.

    Parameters
    ----------
    sizes : sequence of Scaled
        Bounds of ``|xi_k| / sqrt(V)``, for all but pivots and agents at rest.
    rest : RestStates

    Examples
    --------
    >>> one = Fraction(1)
    >>> shares = {0: {0: one}, 1: {0: one}, 2: {1: one}, 3: {0: one / 2, 1: one / 2}}
    >>> vector, unit = from_rest([({1: 3, 3: 5}, Fraction(1, 2))], RestStates(shares, [[0, 1], [2]]))
    >>> [str(x * unit) for x in vector.values()]  # the pivot is as far as agent 1 from it; agent 3 hears it by halves
    ['3/2', '3/2', '0', '13/4']
    """
    known, scale = least(sizes)
    reach = {k: known.get(k, 0) << _ROUNDING_BITS for k in rest.rows}
    ends = [sorted([0, *(reach[v] for v in group)])[-2:] for group in rest.groups]
    members = [set(group) for group in rest.groups]
    result = {}
    for k, row in rest.rows.items():
        result[k] = reach[k]
        for j, b in row.items():
            second, largest = ends[j]
            far = second if k in members[j] and reach[k] == largest else largest
            result[k] -= -abs(b.numerator) * far // b.denominator
    return result, Fraction(1, scale << _ROUNDING_BITS)


@dataclass(frozen=True, eq=False)
class FunctionOf:
    """A function of some agents of a component that hear nobody else, and their common states at rest."""

    agents: np.ndarray
    function: Function
    rest: RestStates | None


@dataclass(frozen=True, eq=False)
class ComponentBounds:
    """The bounds over time of a component.

    Attributes
    ----------
    functions : sequence of FunctionOf
    x : sequence of n Fraction
        ``x(0)``, less ``sigma(0)`` where sliding variables move.
    rows : HeardRows, or None
        Followed if ``ends`` are known, a function decays, and no sliding variable moves.
    ends : sequence of n intervals, or None
        Where every agent ends.
    drive : Drive or None
        What sliding variables do; None where none moves.
    phase : ReachingPhase or None
        When.
    """

    functions: Sequence[FunctionOf]
    x: Sequence[Fraction]
    rows: HeardRows | None = None
    ends: Sequence[Interval] | None = None
    drive: Drive | None = None
    phase: ReachingPhase | None = None

    def deviation(self, at: Instants) -> np.ndarray:
        """Bound ``|x_k(t) - x_k(T)|`` at M instants, (n, M): 0 where all begin where they end, at rest."""
        still = len(self.x) == 1
        if self.drive is not None:
            bounds = np.zeros((1, at.clock.size)) if still else self.by_functions(at)
            return bounds + self._sliding(at)
        if self.ends is not None:
            still = still or all(x == low == high for x, (low, high) in zip(self.x, self.ends, strict=True))
        if still:
            return np.zeros((len(self.x), at.clock.size))
        bounds, finite = self.by_functions(at), np.isfinite(at.clock)
        rate = max((float(one.function.rate) for one in self.functions), default=0.0)
        if self.rows is not None and self.ends is not None and rate > 0 and finite.any():
            pairs = zip(self.x, self.ends, strict=True)
            start = np.array([float_up(max(abs(x - end) for end in ends)) for x, ends in pairs])
            followed = self.rows.follow(start, lambda s: self.by_functions(Instants(s)), at.clock[finite], rate)
            bounds[:, finite] = np.fmin(bounds[:, finite], followed)
        return bounds

    def by_functions(self, at: Instants) -> np.ndarray:
        """Bound the same by functions alone, less what sliding variables are; infinite where none decays."""
        bounds = np.full((len(self.x), at.clock.size), np.inf)
        for one in self.functions:
            if one.function.rate > 0:
                bounds[one.agents] = np.minimum(bounds[one.agents], self._deviation(one, at))
        return bounds

    def _deviation(self, one: FunctionOf, at: Instants) -> np.ndarray:
        """Bound the deviations of the agents of one function."""
        V = one.function
        decay, unit = self.decay(one)
        n, rest = one.agents.size, None if one.rest is None else from_rest(V.sizes, one.rest)
        if self.drive is None:
            speeds = [(vector, factor * 2 / V.rate) for vector, factor in V.speeds]
            return decay.times(_floats([*speeds, *([] if rest is None else [rest])], n, unit), at)
        assert self.phase is not None
        left = self.phase.rest(at)
        with np.errstate(over="ignore", invalid="ignore"):
            driven = decay.times(1.0, at) + float_up(self.drive.constant(V) / unit) * left
            bounds = np.multiply.outer(_floats(V.speeds, n, unit * 2 / V.rate), driven)
            bounds += np.multiply.outer([float_up(self.drive.sizes[k]) for k in range(n)], left)
            if rest is not None and one.rest is not None:
                near = decay.times(_floats([rest], n, unit), at)
                bounds = np.fmin(bounds, near if not one.rest.groups else np.where(left == 0, near, np.inf))
        return np.nan_to_num(bounds * _SLACK, nan=np.inf, posinf=np.inf)

    def input(self, at: Instants, gain: np.ndarray) -> np.ndarray:
        """Bound ``gain |(L x)_k|``, (n, M)."""
        if len(self.x) == 1:
            return np.zeros((1, at.clock.size))
        bounds = np.full((len(self.x), at.clock.size), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            for one in self.functions:
                if self.drive is not None and one.function.rate <= 0:
                    continue
                decay, unit = self.decay(one)
                speeds = _floats(one.function.speeds, one.agents.size, unit)
                own = decay.times(speeds, at) * gain
                own[np.isinf(speeds)] = np.inf
                if self.drive is not None and self.phase is not None:
                    sizes = [float_up(self.drive.sizes[k]) for k in range(len(self.x))]
                    own = (own + np.multiply.outer(sizes, gain * self.phase.share_at(at))) * _SLACK
                bounds[one.agents] = np.fmin(bounds[one.agents], own)
            if self.rows is not None and self.drive is None:
                heard = self.rows.speeds(self.deviation(at)) * gain
                bounds = np.where(np.isfinite(at.clock), np.fmin(bounds, heard), bounds)
        return np.nan_to_num(bounds, nan=np.inf, posinf=np.inf)

    def decay(self, one: FunctionOf) -> tuple[Decay, Fraction]:
        """Return what bounds ``sqrt(V(x - sigma))`` over time, in a unit, and that."""
        V = one.function
        root = V.root([self.x[v] for v in one.agents.tolist()])
        c = Fraction(0) if self.drive is None else self.drive.constant(V)
        unit = max(root, c) or Fraction(1)
        decay = Decay(float_down(V.rate), float_up(root / unit))
        if self.phase is not None:
            decay = replace(decay, phase=self.phase, push=float_up(c / unit) * self.phase.shares)
        return decay, unit

    def _sliding(self, at: Instants) -> np.ndarray:
        """Bound ``|sigma_k|``, (n, M)."""
        assert self.drive is not None and self.phase is not None
        sizes = [abs(float(s)) for s in self.drive.sigma0.values()]
        return np.multiply.outer(sizes, self.phase.share_at(at)) * _SLACK


def _floats(bounds: Sequence[Scaled], n: int, unit: Fraction) -> np.ndarray:
    """Return the least bound of every node times a unit in floats that are not below; infinity where there is none."""
    values, scale = least(bounds)
    return np.array([float_up(values[k] * unit / scale) if k in values else np.inf for k in range(n)])
