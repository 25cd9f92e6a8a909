"""Floats as the dyadic numbers that they are: integers over a power of two, and how they are rounded to fewer bits."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np


def round_to_bits(value: float, bits: int) -> Fraction:
    """Round a finite float to the nearest dyadic rational with ``bits`` significant bits.

    Parameters
    ----------
    value : float
        Finite.
    bits : int
        Positive.

    Returns
    -------
    Fraction

    Examples
    --------
    >>> round_to_bits(0.1, 4)
    Fraction(13, 128)
    """
    p, q = value.as_integer_ratio()
    drop = p.bit_length() - bits
    return Fraction(p, q) if drop <= 0 else Fraction(round(Fraction(p, 1 << drop)) << drop, q)


def round_array(x: np.ndarray, bits: int = 40) -> np.ndarray:
    """Round every float of an array to so many significant bits.

    Examples
    --------
    >>> float(round_array(np.array([1 / 3]))[0]).hex()
    '0x1.5555555556000p-2'
    """
    mantissa, exponent = np.frexp(x)
    return np.ldexp(np.rint(np.ldexp(mantissa, bits)), exponent - bits)


def dyadic_integers(values: Any) -> tuple[list[int], int]:
    """Return floats or ints as integers over one power of two: ``values = integers * 2^power``, exactly.

    So a matrix of floats is handed to whoever checks its proof in integers.

    Parameters
    ----------
    values : (n,) sequence of float or int
        Finite.

    Returns
    -------
    integers : list of n ints
    power : int

    Examples
    --------
    >>> dyadic_integers([0.75, -2.0, 3])
    ([3, -8, 12], -2)
    """
    ratios = [value.as_integer_ratio() for value in (values.tolist() if hasattr(values, "tolist") else values)]
    places = max((q.bit_length() for _, q in ratios), default=1)
    return [p << (places - q.bit_length()) for p, q in ratios], 1 - places


def dyadic_array(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return an array of floats or ints as integers over one power of two, in int64 if they fit.

    Examples
    --------
    >>> dyadic_array(np.array([0.75, -2.0, 0.0]))
    (array([ 3, -8,  0]), -2)
    """
    whole, power = odd_parts(values)
    some = whole != 0
    least = int(power[some].min(initial=2**20)) if some.any() else 0
    up = np.where(some, power - least, 0)
    if int((np.frexp(whole.astype(float))[1] + up).max(initial=0)) < 62:
        return whole << up, least
    return whole.astype(object) << up.astype(object), least


def odd_parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ``values = whole 2^power`` in int64, ``whole`` odd or 0."""
    whole, power = values, np.zeros(values.shape, dtype=np.int64)
    if values.dtype.kind == "f":
        mantissa, exponent = np.frexp(values.astype(float))
        whole, power = np.ldexp(mantissa, 53), exponent.astype(np.int64) - 53
    whole = whole.astype(np.int64)
    zeros = np.frexp(np.abs((whole & -whole).astype(float)))[1].astype(np.int64) - 1
    return np.where(whole != 0, whole >> np.maximum(zeros, 0), 0), np.where(whole != 0, power + zeros, 0)
