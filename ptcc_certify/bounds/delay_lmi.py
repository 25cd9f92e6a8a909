"""Delays of a whole graph under a capped gain by the delay LMI: searched in floats, rounded, proved as in the check.

What is stated follows from :mod:`ptcc_certify.checker.delay_lmi`: ``sqrt(V(s)) <= e^(-b s) sqrt(V(0))``; the agents are
drawn to a state that differs from ``Q X(0)`` by at most ``walk_k sqrt(V(0))``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from lmi.delay import LateSystem, delay_lyapunov
from lmi.errors import LMIError
from lmi.exact import arithmetic
from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import common_denominator
from lmi.exact.work import WorkError
from ptcc_certify.bounds.final_state import Influence
from ptcc_certify.bounds.small_delays import left_above
from ptcc_certify.checker.delay_lmi import DelayLMI, LateLoop, Row, channels_of
from ptcc_certify.checker.input_formulas import BITS, Limits
from ptcc_certify.checker.late_input import gain_above
from ptcc_certify.checker.late_messages import PARTS
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.gain import Gain
from ptcc_certify.protocols.late_messages import LateMessages

#: Above so many free agents nothing is searched.
LARGEST = 20
#: Values of ``b`` that are tried, as shares of the rate where nothing is late.
_SHARES = (0.85, 0.5, 0.2, 0.05)
#: The share at which the longest delay is sought, the lateness that is tried first, times the largest entry of ``L``,
#: and the number of factors 2 from there up or down, and then of halvings.
_LEAST_SHARE, _FIRST, _STEPS, _HALVINGS = 0.01, 0.2, 10, 4
#: What is left at ``T`` counts as this at least where a Lyapunov function is chosen.
_LEAST_LEFT = 1e-2
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
    moved, residual : tuple of N Fraction
        How far from ``Q X(0)`` agents are drawn to, and are at ``T``, from above.
    """

    b: Fraction
    matrix: tuple[tuple[Fraction, ...], ...]
    tau: tuple[Fraction, ...]
    left: Fraction
    moved: tuple[Fraction, ...]
    residual: tuple[Fraction, ...]


class DelayLMIBounds:
    """Bounds of one graph under one capped gain.

    Parameters
    ----------
    structure : Structure
    gain : Gain
    messages : LateMessages
        With a ``gain_cap``.
    influence : Influence
        Exact.
    initial_state : sequence of N Fraction
    """

    def __init__(
        self,
        structure: Structure,
        gain: Gain,
        messages: LateMessages,
        influence: Influence,
        initial_state: Sequence[Fraction],
    ):
        assert messages.gain_cap is not None
        self.structure, self.gain, self.messages, self.state = structure, gain, messages, initial_state
        self.cap, self.clock = messages.gain_cap, Limits(messages.gain_cap).clock_below(gain.exact)
        rows = structure.graph.exact_rows(range(structure.graph.n_nodes))
        unit = common_denominator({x.denominator for row in rows for x in row.values()}, structure.graph.n_edges)
        first = {c.nodes[0] for c in influence.balanced}
        self._laplacian = [{j: int(x * unit) for j, x in row.items()} for row in rows]
        self._unit = unit
        self._projection = [
            {j: Fraction(x) for j, x in influence.row(v).items()} for v in range(structure.graph.n_nodes)
        ]
        self._free = [v for v in range(structure.graph.n_nodes) if v not in first]

    @cached_property
    def _ages(self) -> list[Fraction]:
        """What is heard over each edge is so old at most, rounded up to 64ths of the oldest."""
        latencies, age = self.messages.latencies(self.structure.graph), self.messages.age
        if not isinstance(latencies, tuple):
            return [age] * self.structure.graph.n_edges
        return [math.ceil(PARTS * (x + self.messages.held) / age) * age / PARTS for x in latencies]

    def loop(self, factor: Fraction = Fraction(1)) -> LateLoop:
        """Return what is late, every age multiplied by a factor."""
        graph = self.structure.graph
        ends = zip(graph.source.tolist(), graph.target.tolist(), strict=True)
        edges = [(s, t, -self._laplacian[t][s]) for s, t in ends]
        lateness, rests = [self.cap * x * factor for x in self._ages], [not row for row in self._laplacian]
        channels = channels_of(edges, lateness, rests, self.messages.own_delay)
        return LateLoop(self._laplacian, self._unit, self._projection, self._free, channels, self.messages.own_delay)

    def best(self) -> tuple[DelayLMIBound, np.ndarray] | None:
        """Return what leaves least at ``T`` of what is found, with bounds of inputs; None if nothing is."""
        if not 0 < len(self._free) <= LARGEST:
            return None
        loop, found = self.loop(), list[tuple[float, float, np.ndarray, np.ndarray]]()
        system, start = _system(loop), np.array([float(x) for x in loop.coordinates(self.state)])
        for share in _SHARES:
            b = share * system.rate
            if not b > 0:
                return None
            left = math.exp(-min(b * float(self.clock), 700.0))
            gram = _gram(loop)
            walking = len(system.walks) > 0
            least = gram * (2 * b * max(left, _LEAST_LEFT) ** 2 if walking else 1.0)
            with suppress(LMIError):
                P, tau = delay_lyapunov(system, b, start, least)
                away = math.sqrt(max(float(np.max(np.einsum("ij,ji->i", *_deviations(loop, P)))), 0.0))
                walk = math.sqrt(_walk(loop) / (2 * b))
                found.append((math.sqrt(max(start @ P @ start, 0.0)) * (walk + away * left), b, P, tau))
        for _, b, P, tau in sorted(found, key=lambda one: one[0]):
            with suppress(WorkError):
                if (bound := self._proved(loop, Fraction(b), P, tau)) is not None:
                    return bound
        return None

    def longest_delay(self) -> float:
        """Return about the longest delay that some function forgives: this certificate's limit, not the loop's.

        Infinite where nobody hears late of anybody who moves.
        """
        if not 0 < len(self._free) <= LARGEST:
            return 0.0
        system = _system(self.loop())
        start, least, b = np.zeros(len(self._free)), _gram(self.loop()), _LEAST_SHARE * system.rate
        if not b > 0 or not len(system.lateness):
            return math.inf if b > 0 else 0.0

        def forgives(factor: float) -> bool:
            with suppress(LMIError):
                delay_lyapunov(_system(self.loop(Fraction(factor))), b, start, least)
                return True
            return False

        low = high = _FIRST / float(np.abs(system.K).max() * system.lateness.max())
        step = 2.0 if forgives(low) else 0.5
        for _ in range(_STEPS):
            high = low * step
            if forgives(high) != (step > 1):
                break
            low = high
        else:
            return low * float(self.messages.age) if step > 1 else 0.0
        low, high = min(low, high), max(low, high)
        for _ in range(_HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if forgives(middle) else (low, middle)
        return low * float(self.messages.age)

    def _proved(
        self, loop: LateLoop, b: Fraction, P: np.ndarray, tau: np.ndarray
    ) -> tuple[DelayLMIBound, np.ndarray] | None:
        """Return what a rounded function states, if it is proved."""
        if not (tau > 0).all() or not np.isfinite(P).all():
            return None
        exact, matrix = arithmetic(), [[Fraction(x) for x in row] for row in P.tolist()]
        each = [Fraction(x) for x in tau.tolist()]
        lmi = DelayLMI(loop, b, matrix, each)
        if not lmi.proved(exact):
            return None
        root, left, constants = lmi.root(self.state), left_above(b * self.clock), lmi.constants(exact)
        moved = [rounded(root * x * _MORE, BITS, up=True) for x in constants.walk]
        residual = [
            rounded(x + root * c * left * _MORE, BITS, up=True) for x, c in zip(moved, constants.away, strict=True)
        ]
        by_edge = dict(zip((e.edge for e in loop.channels), each, strict=True))
        edges = tuple(by_edge.get(k, Fraction(0)) for k in range(self.structure.graph.n_edges))
        y = root * gain_above(self.gain.exact, self.cap, b)
        inputs = np.array([float_up(x * y * _MORE) for x in lmi.inputs(*constants)]) + 1e-300
        return DelayLMIBound(b, tuple(map(tuple, matrix)), edges, left, tuple(moved), tuple(residual)), inputs


def _dense(rows: Sequence[Row], width: int) -> np.ndarray:
    """Return sparse rational rows as an array."""
    found = np.zeros((len(rows), width))
    for i, row in enumerate(rows):
        for j, x in row.items():
            found[i, j] = float(x)
    return found


def _system(loop: LateLoop) -> LateSystem:
    """Return a loop in floats."""
    m, n, q, channels = len(loop.free), len(loop.laplacian), len(loop.listeners), loop.channels
    place = {v: k for k, v in enumerate(loop.listeners)}
    Z = _dense([{j: Fraction(x, loop.unit) for j, x in row.items()} for row in loop.slopes], m + q)
    return LateSystem(
        _dense(loop.system, m),
        _dense(loop.pushed, q),
        Z[:, :m],
        np.array(loop.listeners, dtype=int),
        np.array([place[e.listener] for e in channels], dtype=int),
        np.array([float(Fraction(e.weight, loop.unit)) for e in channels]),
        np.array([float(e.lateness) for e in channels]),
        _dense([{v: Fraction(x) for v, x in loop.heard(e).items()} for e in channels], n),
        _dense(list(loop.walks.values()), q),
    )


def _gram(loop: LateLoop) -> np.ndarray:
    """Return ``D'D``, ``D`` the deviations from ``Q x``."""
    D = _dense(loop.deviations, len(loop.free))
    return D.T @ D


def _deviations(loop: LateLoop, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    D = _dense(loop.deviations, len(loop.free))
    return D, np.linalg.solve(P, D.T)


def _walk(loop: LateLoop) -> float:
    """Return the largest sum of squares of rows of ``R`` over what walks."""
    return max((float(sum(r**2 for j, r in row.items() if j in loop.walks)) for row in loop.camps), default=0.0)
