"""Free parameters of the bounds of the input: which Lyapunov function, and from which instant on."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar

from ptcc_certify.bounds.input.effort import Witness
from ptcc_certify.checker.input_formulas import InputBounds, Of, rounded
from ptcc_certify.graphs.rationals import nearest_float, writable

#: Bits of the bounds that are written, and of the instants that witness them.
BOUND_BITS, INSTANT_BITS = 40, 24
#: Beyond this ``z = ln(T/(T - t))`` no bound is formed.
LATEST = 5_000
#: Bounds below are raised to this, so that they can be written.
LEAST = Fraction(1, 2**1200)

Result = TypeVar("Result")


def round_up(x: Fraction) -> Fraction:
    """Round up to the bits that are written, and what is next to nothing to ``LEAST``.

    Raises
    ------
    OverflowError
        Too large to be written.
    """
    value = rounded(max(x, LEAST), BOUND_BITS, up=True) if x else x
    if not writable(value):
        raise OverflowError("a bound that is too large to be written")
    return value


def log(x: Fraction) -> float:
    """Return the natural logarithm of a nonnegative rational of any size."""
    return math.log(x.numerator) - math.log(x.denominator) if x else -math.inf


def least(attempts: Iterable[Callable[[], Result | None]], size: Callable[[Result], Any]) -> Result | None:
    """Return the least of what can be proved; None if nothing can."""
    results = []
    for attempt in attempts:
        with suppress(ValueError, ArithmeticError):
            results.append(attempt())
    return min((result for result in results if result is not None), key=size, default=None)


def usable_functions(bounds: InputBounds) -> list[int]:
    """Return which Lyapunov functions decay and say something of single agents."""
    functions = []
    for k in range(len(bounds.forms)):
        with suppress(ValueError, ArithmeticError):
            bounds.constant(k)
            bounds.initial_root(k)
            functions.append(k)
    return functions


def decaying(bounds: InputBounds, k: int, agent: int | None) -> Fraction:
    """Return what ``|e_agent|``, or ``||E||``, is at most at first by a Lyapunov function, and decays."""
    return bounds.root_constant(k, agent) * bounds.initial_root(k)


def _driven_peak(bounds: InputBounds, k: int, agent: int | None) -> tuple[float, float]:
    """Return about what a function bounds the peak by while sliding variables move, and without ``|e|``, for ties.

    Infinite where floats or the kernel form no numbers of this size.
    """
    try:
        pieces, most, begin = bounds.pieces(k, _quiet(bounds))
        last, clock = nearest_float(pieces[-1].last), math.fsum(nearest_float(p.clock) for p in pieces)
        constant = bounds.error_norm if agent is None else bounds.error_bounds[agent]
        c = nearest_float(bounds.root_constant(k, agent))
        late = c * math.exp(log(begin) - nearest_float(bounds.form(k).rate) / 2 * clock) * last
    except (ValueError, ArithmeticError):
        return math.inf, math.inf
    alone = c * nearest_float(most)
    return max(late, min(alone, nearest_float(constant) * last)), alone


def _quiet(bounds: InputBounds) -> Fraction:
    """Return the end of the reaching phase, short of which another checker may find it, with other roundings."""
    return rounded(bounds.quiet, BOUND_BITS, up=True)


def best_bound(bounds: InputBounds, of: Of, agent: int | None, functions: Sequence[int]) -> Witness | None:
    """Return the bound of the function whose decay takes over first, the least peak; about the least while driven."""
    size = _driven_peak if bounds.reaching else decaying
    for z, _, k in sorted((_crossing(bounds, agent, k), size(bounds, k, agent), k) for k in functions):
        if z <= LATEST:
            instant = max(Fraction(math.ceil(z * 2**INSTANT_BITS), 2**INSTANT_BITS), _quiet(bounds))
            with suppress(ValueError, ArithmeticError):
                return Witness(round_up(bounds.bound(of, agent, k, instant)), k, instant)
    return None


def least_bound(bounds: InputBounds, of: Of, functions: Sequence[int]) -> Witness | None:
    """Return the least bound of the norm over some Lyapunov functions."""
    return least((partial(best_bound, bounds, of, None, [k]) for k in functions), lambda w: w.value)


def _crossing(bounds: InputBounds, agent: int | None, k: int) -> float:
    """Return ``z`` where the constant bound meets the decaying one, the best instant for the bounds; 0 while driven."""
    if bounds.reaching is not None:
        return 0.0
    constant = bounds.error_norm if agent is None else bounds.error_bounds[agent]
    first = decaying(bounds, k, agent)
    if not constant or not first:
        return 0.0
    s = 2 * (log(first) - log(constant)) / nearest_float(bounds.form(k).rate)
    linear, pole = nearest_float(bounds.gain.rho1 * bounds.gain.T), nearest_float(bounds.gain.k)
    low, high = 0.0, s / pole
    if not 0 < high < math.inf:
        return 0.0 if high <= 0 else math.inf
    for _ in range(60):
        z = (low + high) / 2
        low, high = (z, high) if -linear * math.expm1(-z) + pole * z < s else (low, z)
    return high
