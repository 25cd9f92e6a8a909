"""The longest delay with which no more than a wanted residual is left at the deadline, by what is proved of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.delay.case import LateCase, SettlingBounds
from ptcc_certify.bounds.delay.decay_by_rows import MORE
from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBounds
from ptcc_certify.bounds.delay.forms_of_families import forms_of_family, longest_delay_of_family, rest_of
from ptcc_certify.bounds.delay.late_messages import LateBounds, bound_late, late_rows
from ptcc_certify.bounds.delay.small_delays import SmallDelayBounds
from ptcc_certify.bounds.virtual_positions import bound_vehicles
from ptcc_certify.checker.forms_of_families import SpreadingFunction
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.theorems.family_behaviour import FamilyComponent

#: Halvings of the interval, in powers of two, and digits of the delay that is returned.
_HALVINGS, _DIGITS = 9, 3
#: Delays below this share of ``T`` are not tried.
_SHORTEST = 1e-5


def bound_case(case: LateCase) -> LateBounds:
    """Return what is proved by rows and by Lyapunov functions.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 2, 1)]))
    >>> case = LateCase(structure, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), LateMessages(delay=1))
    >>> longest = longest_delay(bound_case(case), Fraction(1, 20))
    >>> 0.005 < longest.messages.age < 0.5, longest.largest <= 0.05
    (True, True)
    """
    return with_forms(bound_late(case))


def longest_forgiven(case: LateCase) -> float | None:
    """Return about the longest delay that a function of the whole graph forgives; None where none is asked."""
    asked = [kind(case) for kind in (SmallDelayBounds, DelayLMIBounds) if kind.asked(case)]
    return max((bounds.longest_delay() for bounds in asked), default=None)


def with_forms(late: LateBounds) -> LateBounds:
    """Add what the best Lyapunov functions of the whole graph prove."""
    kinds: tuple[Any, ...] = SettlingBounds, SmallDelayBounds, DelayLMIBounds
    found = [pair for kind in kinds if kind.asked(late.case) and (pair := kind(late.case).best()) is not None]
    bounds, decays = zip(*found, strict=True) if found else ((), ())
    return _with_decays(replace(late, of_all=bounds), decays)


def with_forms_of_family(
    late: LateBounds, parts: Sequence[tuple[FamilyComponent, Sequence[SpreadingFunction]]]
) -> LateBounds:
    """Add what Lyapunov functions of a family prove, where it has groups of leaders."""
    forms = forms_of_family(late.case, parts)
    if late.messages.age:
        late = replace(late, longest_delay=longest_delay_of_family(late.case, parts))
    if not forms:
        return late
    decays = [*(one.decay(late.case) for one in forms), rest_of(late.case, forms)]
    residual = np.zeros(len(late.labels))
    for decay in decays:
        at_T = (x * decay.left + y for x, y in zip(decay.away, decay.floor, strict=True))
        residual[list(decay.nodes)] = [float_up(x) for x in at_T]
    return _with_decays(replace(late, of_all=forms, residual=residual * MORE), decays)


def _with_decays(late: LateBounds, decays: Sequence[DecayOfAll]) -> LateBounds:
    """Add what decays say of inputs, and of vehicles."""
    if late.messages.gain_cap is not None or (late.forms and late.messages.exact):
        least = [x for x in (late.input, *map(late.case.inputs, decays)) if x is not None]
        bound = np.minimum.reduce(least) if least else None
        late = replace(late, input=None if bound is None or np.isinf(bound).any() else bound)
    if late.messages.vehicles is not None and decays:
        rows = late_rows(late.case) if late.rows else None
        late = replace(late, vehicles=bound_vehicles(late.case, late.rows, rows, late.steps, decays))
    return late


def longest_delay(late: LateBounds, residual: Fraction) -> LateBounds | None:
    """Return the bounds for nearly the longest delay that leaves no more than a residual.

    Parameters
    ----------
    late : LateBounds
        With some delay; its value error, losses and cap of the gain are kept, and so are the proportions of all times.
    residual : Fraction
        What may be left of ``|x_k(T) - x_k*|``.

    Returns
    -------
    LateBounds or None
        None if no delay is found. One of ``T`` is as good as any longer one, and none longer is tried.
    """
    T, age = late.case.protocol.T, late.messages.age
    best = None
    shortest, high = T * Fraction(_SHORTEST), min(age, T)
    if late.largest <= residual:
        best, shortest, high = late, age, max(age, T)
        latest = late if age >= T else bound_at(late.case, T)
        if latest.largest <= residual:
            return latest
    low, top = math.log(float(shortest)), math.log(float(high))
    for _ in range(_HALVINGS):
        middle = (low + top) / 2
        tried = bound_at(late.case, Fraction(f"{math.exp(middle):.{_DIGITS - 1}e}"))
        if tried.largest <= residual:
            best, low = tried, middle
        else:
            top = middle
    return best


def bound_at(case: LateCase, age: Fraction) -> LateBounds:
    """Bound what is left where what is heard is so old, all times in proportion."""
    messages = case.messages
    factor, given = age / messages.age, messages.delay
    delay: Fraction | dict[tuple[str, str], Fraction] = messages.largest_delay * factor
    if isinstance(given, Mapping):
        delay = {edge: Fraction(x) * factor for edge, x in given.items()}
    period = None if messages.period is None else messages.period * factor
    return bound_case(replace(case, messages=replace(messages, delay=delay, period=period)))
