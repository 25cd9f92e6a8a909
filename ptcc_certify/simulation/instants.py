"""The instants at which a run is sampled, dense towards its deadlines and accurate however near to them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError
from ptcc_certify.graphs.rationals import as_fraction, number_within, whole_number

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact
    from ptcc_certify.model import Protocol

#: How far a run goes past the deadline unless told otherwise, as a share of it.
PAST = 0.25
#: Samples past the deadline, where nothing drives the agents; where something does, for 40 in a tenth of ``T``.
_PAST_SAMPLES, _DRIVEN_SAMPLES = 5, 100
#: Steps of a run in steps of closed form at most; a step as a share of what is left until ``T``, at most.
MOST_STEPS, STEP_SHARE = 20_000, 0.02
# 1 - t/T at 0.5 T, 0.9 T, 0.99 T.
_MARKS = (0.5, 0.1, 0.01)


class Instants(NamedTuple):
    """Where a run is sampled: ``t``, ``1 - t/T`` and ``1 - t/T_r``, each (M,); the last is 0 without a ``T_r``."""

    t: np.ndarray
    remaining: np.ndarray
    reaching_remaining: np.ndarray

    @property
    def z(self) -> np.ndarray:
        """``ln(T_r/(T_r - t))``, infinite from ``T_r`` on."""
        return minus_log(self.reaching_remaining, 1 - self.reaching_remaining)


def steps_towards(T: float, longest: float, share: float, nearest: float) -> np.ndarray:
    """Return what is left until ``T`` after steps at most so long, each at most a share of what is left, from 0 on.

    The last but one instant is as near to ``T`` as ``nearest`` times ``T``.
    """
    left = [0.0, nearest * T]
    while left[-1] < T:
        left.append(left[-1] + min(longest, left[-1] * share))
    return np.array([*left[:-1], T])[::-1]


def default_instants(
    protocol: Protocol, remaining: float, samples: int, past: float, *, driven: bool = False
) -> Instants:
    """Return instants dense towards ``T_r``, if there is one, and towards ``T``, and evenly in time.

    Past ``T`` they are denser where agents are ``driven``, by a disturbance that may oscillate.

    Raises
    ------
    ParameterError
        A number is outside its domain.
    """
    remaining = number_within(remaining, "remaining", 1e-300, 1 - 2**-53)
    samples = whole_number(samples, "samples", 2, 10**9)
    past = number_within(past, "past", 0, 1e6)
    T_r, T_s, T = (float(x) for x in (protocol.T - protocol.span, protocol.span, protocol.T))
    grid = np.linspace(1, 0, samples)
    if protocol.prescribed:
        grid = np.exp(np.linspace(0, math.log(remaining), samples))
        grid = np.append(grid, np.linspace(1, grid[-1], samples // 2))  # for figures in t
    grid = np.unique(grid)[::-1]
    shares = grid * (T_s / T)
    if protocol.prescribed:
        shares = shares[shares >= remaining * (1 - 1e-12)]
    shares = np.append(shares, [share for share in _MARKS if share < T_s / T])
    between = np.stack([T * (1 - shares), shares, np.zeros(shares.size)])
    between[0, shares == T_s / T] = T_r
    steps = math.ceil(_DRIVEN_SAMPLES * max(past / PAST, 1)) if driven else _PAST_SAMPLES
    later = T * (1 + past * np.arange(steps + 1 if past else 1) / steps)
    parts = [between, np.stack([later, np.zeros(later.size), np.zeros(later.size)])]
    if T_r:
        marks = np.array([T * (1 - share) for share in _MARKS])
        early = np.append(grid, 1 - marks[marks < T_r] / T_r)
        late = np.minimum((T_s + T_r * early) / T, 1.0)  # 0.8 + 0.9 is more than 1.7 in floats
        parts.append(np.stack([T_r * (1 - early), late, early]))
    table = np.concatenate(parts, axis=1)
    table = table[:, np.lexsort((table[0], -table[1], -table[2]))]
    fresh = np.append(True, np.diff(table, axis=1).any(axis=0))
    return Instants(*table[:, fresh])


def wanted_instants(protocol: Protocol, times: Iterable[Exact]) -> Instants:
    """Return the instants wanted, what remains until ``T`` and ``T_r`` from exact rationals.

    Raises
    ------
    ParameterError
        There are none, they are no numbers, negative, or not increasing.
    """
    try:
        wanted = [as_fraction(t, "an instant") for t in times]  # type: ignore[arg-type]
        t = np.array([float(value) for value in wanted])
    except (NumberError, TypeError, OverflowError) as error:
        raise ParameterError("times", f"{error}") from None
    if not wanted:
        raise ParameterError("times is empty; give at least one instant")
    if wanted[0] < 0:
        raise ParameterError(f"times starts at {t[0]}; instants must be >= 0")
    for earlier, later in pairwise(wanted):
        if later <= earlier:
            raise ParameterError(f"times is not increasing: {float(later)} follows {float(earlier)}")

    def remaining(deadline: Fraction) -> np.ndarray:
        share = [max(0.0, float(1 - value / deadline)) if deadline else 0.0 for value in wanted]
        return np.where(t == float(deadline), 0.0, share)

    return Instants(t, remaining(protocol.T), remaining(protocol.T - protocol.span))


def tau_before(t: np.ndarray, q: np.ndarray, T: float, remaining: float) -> np.ndarray:
    """Return ``-ln(q T/remaining)``, ``q = 1 - t/T > 0``, of instants from ``remaining`` before ``T`` on."""
    share = (t - (T - remaining)) / remaining
    return np.maximum(minus_log(q * (T / remaining), share), 0.0)


def minus_log(q: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return ``-ln(q)``, where ``q + share = 1``: whichever is the small one holds the digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(share < 0.5, -np.log1p(-share), -np.log(q))
