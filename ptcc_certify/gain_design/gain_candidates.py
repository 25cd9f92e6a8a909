"""Gains by increasing product of peak and deadline, in units of a deadline."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from ptcc_certify.bounds.input.tightest_bound import decaying, log, usable_functions
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.gain_design.answer import DIGITS
from ptcc_certify.gain_design.request import DesignRequest, input_bounds
from ptcc_certify.graphs.rationals import nearest_float

#: ``rho1 T / k`` is sought between these.
_LEAST, _MOST = 1e-3, 1e6


class Option(NamedTuple):
    """Gains in units of a deadline: ``rho1 T``, ``k``, the clock of a capped gain or None, and about what ``phi``."""

    a: Fraction
    k: Fraction
    clock: Fraction | None
    product: Fraction


def options(base: Certificate, request: DesignRequest) -> list[Option]:
    """Return gains by increasing ``phi``: the best without a cap, and a cap for each function if a residual is allowed.

    In units of ``k`` and the largest ``m_v`` everything is free of dimensions.
    """
    bounds, residual = input_bounds(base, request.initial_set), request.residual
    functions = usable_functions(bounds)
    agents: list[int | None] = [None] if request.input_norm == 2 else [*range(len(bounds.rows))]
    largest = [bounds.error_norm if v is None else bounds.error_bounds[v] for v in agents]
    top = max(largest)
    if base.proof.constant or top == 0 or not functions:
        return [Option(Fraction(1), Fraction(1), None, Fraction(0))] if base.proof.constant or top == 0 else []
    rates = {i: bounds.form(i).rate for i in functions}
    decay = {i: [decaying(bounds, i, v) for v in agents] for i in functions}
    moving = [j for j, h in enumerate(largest) if h and all(decay[i][j] for i in functions)]
    size = np.array([nearest_float(largest[j] / top) for j in moving])
    over = {i: np.array([log(decay[i][j] / largest[j]) for j in moving]) for i in functions}
    least = 2 / max(rates.values())
    best = (math.inf, 1.0, least)
    for i in functions:
        k = decimal(2 / rates[i], up=True)
        may = [j for j in functions if rates[j] * k >= 2]
        # The clock of the crossing, over k.
        clocks = np.array([over[j] * nearest_float(2 / (rates[j] * k)) for j in may])
        which, every = clocks.argmin(axis=0), np.arange(len(moving))
        crossing = clocks[which, every]
        share = size * np.exp(np.minimum(np.array([over[j] for j in may])[which, every], 0))
        a, peak = least_peak(np.maximum(crossing, 0), share)
        if peak * nearest_float(k / least) < best[0] * (1 - 1e-9):
            best = (peak * nearest_float(k / least), a, k)
    product, a, k = best
    options = []
    if math.isfinite(product):
        options.append(Option(decimal(Fraction(a) * k), k, None, Fraction(product) * least * top))
    if residual is not None:
        for i in functions:
            bound = base.graph_proof.functions[i].deviation
            if bound is None:
                continue
            excess = max(map(log, bound.agents)) / 2 + log(bounds.initial_root(i)) - log(residual)
            clock = decimal(Fraction(max(excess, 1e-6) * (1 + 1e-12)) * 2 / rates[i], up=True)
            options.append(Option(clock, k, clock, clock * top))
    return sorted(options, key=lambda option: option.product)


def least_peak(clocks: np.ndarray, sizes: np.ndarray) -> tuple[float, float]:
    """Return the ``a`` that makes ``max_v sizes_v (a + e^(z_v))`` least, ``a (1 - e^(-z_v)) + z_v = clocks_v``, and it.

    Examples
    --------
    >>> a, peak = least_peak(np.array([1.0]), np.array([1.0]))  # with a = 0 it is e
    >>> round(a, 3), round(peak, 3)
    (0.403, 2.588)
    """
    from scipy.optimize import minimize_scalar

    grid = np.geomspace(_LEAST, _MOST, 28)
    values = [peak_factor(a, clocks, sizes) for a in grid]
    i = int(np.argmin(values))
    ends = (grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
    near = minimize_scalar(
        lambda a: peak_factor(a, clocks, sizes), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]}
    )
    return min([(float(near.x), float(near.fun)), (float(grid[i]), float(values[i]))], key=lambda pair: pair[1])


def peak_factor(a: float, clocks: np.ndarray, sizes: np.ndarray) -> float:
    """Return ``max_v sizes_v (a + e^(z_v))``, ``a (1 - e^(-z_v)) + z_v = clocks_v``, for ``k = 1``.

    The clock is concave in ``z``, so that Newton's method from below grows to the root.

    Examples
    --------
    >>> round(peak_factor(0.0, np.array([1.0]), np.array([1.0])), 6)
    2.718282
    """
    z = np.maximum(clocks / (1 + a), clocks - a)
    for _ in range(40):
        step = (clocks + a * np.expm1(-z) - z) / (a * np.exp(-z) + 1)
        z = z + step
        if np.abs(step).max(initial=0) <= 1e-13 * (1 + z.max(initial=0)):
            break
    with np.errstate(over="ignore"):
        return float((sizes * (a + np.exp(z))).max(initial=0.0))


def decimal(x: Fraction, up: bool = False) -> Fraction:
    """Round a nonnegative rational to a few decimal digits, to nearest or upwards.

    Examples
    --------
    >>> float(decimal(Fraction(2, 3))), float(decimal(Fraction(1, 3), up=True)), float(decimal(Fraction(0)))
    (0.6666666667, 0.3333333334, 0.0)
    """
    if not x:
        return x
    shift = DIGITS - 1 - math.floor(log(x) / math.log(10))
    unit = Fraction(10) ** shift
    scaled = x * unit
    return Fraction(math.ceil(scaled) if up else round(scaled)) / unit
