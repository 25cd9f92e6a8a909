"""Instants up to the deadline, or of the clock, as floats: where bounds over time are asked."""

from __future__ import annotations

import math
import sys
from typing import Any, NamedTuple

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten


class Instants(NamedTuple):
    """Where bounds are asked: values of the clock, and of ``z = ln(T_r/(T_r - t))`` if there is a reaching phase."""

    clock: np.ndarray
    z: Any = None


def remaining_part(remaining: Any, name: str = "remaining") -> np.ndarray:
    """Return values of ``1 - t/T`` as floats, or refuse what is no instant up to the deadline.

    Raises
    ------
    ParameterError
        A value is not a number from 0 to 1.

    Examples
    --------
    >>> remaining_part([1, 0.5])
    array([1. , 0.5])
    >>> remaining_part(1.9)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: remaining = 1.9 is outside its domain; it is 1 - t/T, from 1 at 0 to 0 at T
    """
    return _within(remaining, name, 1.0, "it is 1 - t/T, from 1 at 0 to 0 at T")


def clock_values(clock: Any, name: str = "clock") -> np.ndarray:
    """Return values of a clock as floats, or refuse those before its start.

    Raises
    ------
    ParameterError
        A value is negative or not a number.

    Examples
    --------
    >>> clock_values(np.inf)
    array(inf)
    """
    return _within(clock, name, math.inf, "a clock is 0 at the start and infinite at its deadline")


def instants_from_0(t: Any, name: str = "t") -> np.ndarray:
    """Return instants as an array of floats, one number as an array of one; or refuse what is none from 0 on.

    Raises
    ------
    ParameterError
        A value is negative, infinite or not a number.

    Examples
    --------
    >>> instants_from_0(0.5)
    array([0.5])
    """
    return np.atleast_1d(_within(t, name, sys.float_info.max, "instants are from 0 on"))


def _within(values: Any, name: str, most: float, domain: str) -> np.ndarray:
    try:
        entries = np.asarray(values)
        if entries.dtype.kind in "bUS":
            raise TypeError("truth values and texts are no numbers")
        array = entries.astype(float)
    except (TypeError, ValueError):
        raise ParameterError(name, f"= {shorten(repr(values))} is not a number, nor an array of numbers") from None
    outside = array[~((array >= 0) & (array <= most))]  # NaN is neither
    if outside.size:
        raise ParameterError(name, f"= {outside.flat[0]:.12g} is outside its domain; {domain}")
    return array
