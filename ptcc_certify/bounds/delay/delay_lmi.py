"""Delays of a whole graph under a capped gain by the delay LMI: searched in floats, rounded, proved as in the check.

What is stated follows from :mod:`ptcc_certify.checker.delay_lmi`: ``sqrt(V(s)) <= e^(-b s) sqrt(V(0))``; the agents are
drawn to a state that differs from ``Q X(0)`` by at most ``walk_k sqrt(V(0))``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import islice

import numpy as np

from lmi.delay import LateSystem, delay_lyapunov
from lmi.errors import LMIError
from lmi.exact import arithmetic
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import common_denominator
from lmi.exact.work import WorkError
from ptcc_certify.bounds.delay.case import LateCase, Moments, moments
from ptcc_certify.checker.delay_lmi import DelayLMI, LateLoop, Row, channels_of
from ptcc_certify.checker.input_formulas import BITS, Limits, root_above
from ptcc_certify.checker.stated_bounds import DecayOfAll

#: Above so many free agents nothing is searched; above the other the first function that is found is taken, and the
#: longest delay sought by factors of 2 alone: a search takes 0.3 s with 20 free agents, 2 to 4 s with 30, 10 s with 40.
LARGEST, THOROUGH = 30, 20
#: Values of ``b`` that are tried, as shares of the rate where nothing is late.
_SHARES = (0.85, 0.5, 0.2, 0.05)
#: The share at which the longest delay is sought, the lateness that is tried first, times the largest entry of ``L``,
#: and the number of factors 2 from there up or down, and then of halvings.
_LEAST_SHARE, _FIRST, _STEPS, _HALVINGS = 0.01, 0.2, 10, 4
#: What is left at ``T`` counts as this at least where a Lyapunov function is chosen.
_LEAST_LEFT = 1e-2
#: Rates that are tried are below this, over the largest lateness.
_IN_DELAY = 2.0
#: Multipliers are at least this, over the largest one.
_LEAST = 1e-12
#: Room for rounding, relatively.
_MORE = 1 + Fraction(1, 10**9)


@dataclass(frozen=True, eq=False)
class DelayLMIBound:
    """What the delay LMI proves.

    Attributes
    ----------
    b : Fraction
    matrix : m rows of m Fractions
        ``P``, of the coordinates of the free agents.
    tau : tuple of Fraction
        By edge; 0 where nothing is late.
    left : Fraction
        ``e^(-b s(T))`` from above.
    moved, away, residual : tuple of N Fraction
        How far from ``Q X(0)`` agents are drawn to up to ``T``, what beside that decays of their deviations, where they
        are at first, and how far from ``Q X(0)`` they are at ``T``, from above.
    floor : Fraction or None
        What errors make of the root of the function; None where no value is off.
    errors : tuple of N Fraction, or None
        Multipliers of errors; 0 of agents that hear nobody.
    """

    b: Fraction
    matrix: tuple[tuple[Fraction, ...], ...]
    tau: tuple[Fraction, ...]
    left: Fraction
    moved: tuple[Fraction, ...]
    away: tuple[Fraction, ...]
    residual: tuple[Fraction, ...]
    floor: Fraction | None = None
    errors: tuple[Fraction, ...] | None = None

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds ``|x_k - (Q X(0))_k|`` at instants."""
        return moments(case, self.b, self.away, self.moved, t)


class DelayLMIBounds:
    """Bounds of one graph under one capped gain.

    Parameters
    ----------
    case : LateCase
        With a ``gain_cap``, an exact influence, and an initial state.
    """

    @staticmethod
    def asked(case: LateCase) -> bool:
        """Tell whether such bounds are asked of a case."""
        messages = case.messages
        told = messages.age > 0 or messages.value_error > 0
        known = told and messages.gain_cap is not None and not (messages.value_error and messages.own_delay)
        return case.of_whole_graph and known

    def __init__(self, case: LateCase):
        cap, clock = case.messages.gain_cap, case.clock()
        assert case.influence is not None and cap is not None and clock is not None
        self.case, self.graph, self.influence, self.cap, self.clock = case, case.graph, case.influence, cap, clock

    def loop(self, factor: Fraction = Fraction(1)) -> LateLoop:
        """Return what is late, every age multiplied by a factor."""
        shares, oldest = self.case.shares, self.cap * self.case.messages.age * factor
        lateness = [oldest * Fraction(float(x)) for x in (np.ones(self.graph.n_edges) if shares is None else shares)]
        channels = channels_of(self._edges, lateness, [not row for row in self._whole.laplacian], self._whole.own_late)
        return replace(self._whole, channels=channels)

    @cached_property
    def _whole(self) -> LateLoop:
        """The graph, nothing late."""
        nodes, first = range(self.graph.n_nodes), {c.nodes[0] for c in self.influence.balanced}
        rows = self.case.rows
        unit = common_denominator({x.denominator for row in rows for x in row.values()}, self.graph.n_edges)
        laplacian = [{j: int(x * unit) for j, x in row.items()} for row in rows]
        projection = [{j: Fraction(x) for j, x in self.influence.row(v).items()} for v in nodes]
        free = [v for v in nodes if v not in first]
        wrong = [v for v, row in enumerate(laplacian) if row] if self.case.messages.value_error else []
        return LateLoop(laplacian, unit, projection, free, (), self.case.messages.own_delay, wrong)

    @cached_property
    def _edges(self) -> list[tuple[int, int, int]]:
        """Source, listener and weight of every edge."""
        ends = zip(self.graph.source.tolist(), self.graph.target.tolist(), strict=True)
        return [(s, t, -self._whole.laplacian[t][s]) for s, t in ends]

    @property
    def _free(self) -> int:
        """The number of free agents."""
        return self.graph.n_nodes - len(self.influence.balanced)

    @property
    def _small(self) -> bool:
        """Whether anything is searched."""
        return 0 < self._free <= LARGEST

    def best(self) -> tuple[DelayLMIBound, DecayOfAll] | None:
        """Return what leaves least at ``T`` of what is found, and what it says of all agents; None if nothing is."""
        if not self._small:
            return None
        with suppress(OverflowError, WorkError):
            loop = self.loop()
            found = islice(self._search(loop), None if self._free <= THOROUGH else 1)
            for _, b, P, tau in sorted(found, key=lambda one: one[0]):
                if (bound := self._proved(loop, Fraction(b), P, tau)) is not None:
                    return bound
        return None

    def _search(self, loop: LateLoop) -> Iterator[tuple[float, float, np.ndarray, np.ndarray]]:
        """Yield functions, as far as floats tell: how much is left at ``T``, in some unit, and ``b, P, tau``."""
        system, exact = _system(loop), loop.coordinates(self.case.state)
        largest = max(map(abs, exact)) or Fraction(1)
        start = np.array([float(x / largest) for x in exact])
        off, clock = float(self.case.messages.value_error / largest), float(self.clock)
        D, most = _dense(loop.deviations, len(loop.free)), _fastest(system)
        # of how far the final state walks the largest sum of squares, over the columns that do
        walk = max((float(sum(r**2 for j, r in row.items() if j in loop.walks)) for row in loop.camps), default=0.0)
        shares = _SHARES if self._free <= THOROUGH else _SHARES[1:]
        for b in (share * most for share in shares if most > 0):
            left = math.exp(-min(b * float(self.clock), 700.0))
            with suppress(LMIError, np.linalg.LinAlgError):
                size = 2 * b * max(left, _LEAST_LEFT) ** 2 if walk else 1.0
                # by what the root at first, and what errors make of it, are multiplied in what is left
                at_first = math.sqrt(walk / (2 * b)) + left / math.sqrt(size)
                of_errors = math.sqrt(2 * b * walk) * clock + 1 / math.sqrt(size)
                price = (off * of_errors / at_first) ** 2 / (2 * b)
                P, tau = delay_lyapunov(system, b, start, size * D.T @ D, price)
                away = math.sqrt(max(float(np.einsum("ij,ji->i", D, np.linalg.solve(P, D.T)).max()), 0.0))
                root = math.sqrt(max(float(start @ P @ start), 0.0))
                floor = off * math.sqrt(float(tau[tau.size - system.errors :].sum()) / (2 * b))
                whole = math.sqrt(walk / (2 * b)) * (root + 2 * b * clock * floor) + away * (root * left + floor)
                yield whole, b, P, tau

    def longest_delay(self) -> float:
        """Return about the longest delay that some function forgives: this certificate's limit, not the loop's.

        Infinite where nobody hears late of anybody who moves.
        """
        with suppress(OverflowError):
            if self._small:
                return self._longest_factor() * float(self.case.messages.age)
        return 0.0

    def _longest_factor(self) -> float:
        """Return by what all ages may be multiplied, about."""
        system, D = _system(replace(self.loop(), wrong=())), _dense(self._whole.deviations, len(self._whole.free))
        if not system.rate > 0 or not len(system.lateness):
            return math.inf if system.rate > 0 else 0.0

        def forgives(factor: float) -> bool:
            late = replace(system, lateness=system.lateness * factor)
            with suppress(LMIError):
                delay_lyapunov(late, _LEAST_SHARE * _fastest(late), np.zeros(len(D[0])), D.T @ D)
                return True
            return False

        low = _FIRST / float(np.abs(system.K).max() * system.lateness.max())
        step = 2.0 if forgives(low) else 0.5
        for _ in range(_STEPS):
            if forgives(low * step) != (step > 1):
                break
            low *= step
        else:
            return low if step > 1 else 0.0
        low *= min(step, 1.0)
        high = 2 * low
        for _ in range(_HALVINGS if self._free <= THOROUGH else 0):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if forgives(middle) else (low, middle)
        return low

    def _proved(
        self, loop: LateLoop, b: Fraction, P: np.ndarray, tau: np.ndarray
    ) -> tuple[DelayLMIBound, DecayOfAll] | None:
        """Return what a rounded function states, if it is proved."""
        exact, matrix = arithmetic(), [[Fraction(x) for x in row] for row in P.tolist()]
        whole = [Fraction(x) for x in np.maximum(tau, _LEAST * tau.max(initial=1.0)).tolist()]
        each, off = whole[: len(loop.channels)], dict(zip(loop.wrong, whole[len(loop.channels) :], strict=True))
        lmi = DelayLMI(loop, b, matrix, each, off)
        if not lmi.proved(exact):
            return None
        root, left, error = lmi.root(self.case.state), self.case.left(b), self.case.messages.value_error
        constants, clock = lmi.constants(exact), Limits(self.cap).clock_above(self.case.protocol.gain.exact)
        floor = rounded(root_above(error**2 * sum(off.values(), Fraction(0)) / (2 * b)), BITS, up=True)
        far = root + 2 * b * clock * floor
        drawn = (far * x + floor * y for x, y in zip(constants.walk, constants.away, strict=True))
        moved = [rounded(x * _MORE, BITS, up=True) for x in drawn]
        away = [rounded(root * x * _MORE, BITS, up=True) for x in constants.away]
        residual = [rounded(x + y * left, BITS, up=True) for x, y in zip(moved, away, strict=True)]
        by_edge = dict(zip((e.edge for e in loop.channels), each, strict=True))
        edges = tuple(by_edge.get(k, Fraction(0)) for k in range(self.graph.n_edges))
        falling, standing = lmi.inputs(constants, (floor, error, clock))
        bounds = tuple(moved), tuple(away), tuple(residual)
        found = DelayLMIBound(b, tuple(map(tuple, matrix)), edges, left, *bounds)
        if error:
            multipliers = tuple(off.get(v, Fraction(0)) for v in range(self.graph.n_nodes))
            found = replace(found, floor=floor, errors=multipliers)
        nodes, pushed = range(self.graph.n_nodes), [root * x for x in falling]
        return found, DecayOfAll(nodes, b, None, left, away, moved, pushed, standing)


def _dense(rows: Sequence[Row], width: int) -> np.ndarray:
    """Return sparse rational rows as an array."""
    found = np.zeros((len(rows), width))
    for i, row in enumerate(rows):
        for j, x in row.items():
            found[i, j] = float(x)
    return found


def _system(loop: LateLoop) -> LateSystem:
    """Return a loop in floats."""
    m, n, q = len(loop.free), len(loop.laplacian), len(loop.listeners)
    channels, wrong = loop.channels, loop.wrong
    sizes = [*(e.weight for e in channels), *(loop.laplacian[v][v] for v in wrong)]
    heard = [{v: Fraction(x) for v, x in loop.heard(e).items()} for e in channels]
    place = {v: k for k, v in enumerate(loop.listeners)}
    Z = _dense([{j: Fraction(x, loop.unit) for j, x in row.items()} for row in loop.slopes], m + q)
    return LateSystem(
        _dense(loop.system, m),
        _dense(loop.pushed, q),
        Z[:, :m],
        np.array(loop.listeners, dtype=int),
        np.array([place[v] for v in (*(e.listener for e in channels), *wrong)], dtype=int),
        np.array([float(Fraction(x, loop.unit)) for x in sizes]),
        np.array([float(e.lateness) for e in channels] + [0.0] * len(wrong)),
        _dense([*heard, *({} for _ in wrong)], n),
        _dense(list(loop.walks.values()), q),
        len(wrong),
    )


def _fastest(system: LateSystem) -> float:
    """Return the rate of which shares are tried: that where nothing is late, or two over the largest lateness."""
    return float(np.min(_IN_DELAY / system.lateness[system.lateness > 0], initial=system.rate))
