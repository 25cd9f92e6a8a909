"""Numbers of sections as floats and fractions, and the other way round."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.checker.side_files import Numbers


def floats(numbers: Numbers) -> np.ndarray:
    """Return the floats nearest to numbers, each rounded once."""
    return np.array([float(x) if numbers.scale is None else x / numbers.scale for x in numbers.values])


def numbers(values: Sequence[Fraction] | np.ndarray | None) -> Numbers | None:
    """Return numbers as the sections have them; None of None."""
    return None if values is None else Numbers(values)


def fractions(values: Numbers | None) -> tuple[Fraction, ...] | None:
    """Return numbers that were read; None of None."""
    return None if values is None else tuple(values)


def floats_up(numbers: Numbers | None) -> np.ndarray | None:
    """Return floats that numbers do not exceed; None of None."""
    return None if numbers is None else np.array([float_up(x) for x in numbers])
