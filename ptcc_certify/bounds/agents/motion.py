"""How agents of order n move together: one agent without neighbours, from 0 to the deadline, exactly or enclosed.

``Q L = 0``, so the rows of ``(Q (x) I) Xi`` obey the equation of one agent whatever the gains: ``xi(T) = M xi(0)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from lmi.exact.matrix_exponential import expm
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain

Interval = tuple[Fraction, Fraction]
#: Bits after the point that are kept of a common motion that is not rational, and that are computed.
KEPT_BITS, BITS = 80, 120
#: Terms of a series at most, and the largest ``w`` of one.
MOST_TERMS, LARGEST_DECAY = 10_000, 100


def common_motion(plant: Sequence[Fraction], own: Sequence[Fraction], gain: Gain) -> tuple[tuple[Interval, ...], ...]:
    """Return ``M``, n by n intervals: of radius 0 for chains of integrators.

    ``e^(A T)`` with the companion matrix ``A``; for agents that meet at rest, with ``f = (0, alpha)`` and ``a_1 = 0``,
    the rows ``(1, m)`` and ``(0, 0)``, ``m = int_0^T e^(-a_2 t - alpha s(t)) dt``.

    Examples
    --------
    >>> zero, gain = Fraction(0), Gain(T=2, rho1=1, rho2=1, kappa=1)
    >>> [[str(x) for x, _ in row] for row in common_motion([zero, zero], [zero, zero], gain)]
    [['1', '2'], ['0', '1']]
    >>> at_rest = common_motion([zero, zero], [zero, Fraction(1)], gain)
    >>> float(at_rest[0][1][0]).__round__(6), float(at_rest[0][1][1]) < 1e-20  # int e^(-t) (1 - t/2) dt
    (0.567668, True)
    """
    n, T = len(plant), gain.T
    zero = (Fraction(0), Fraction(0))
    if any(own):
        w = (plant[1] + own[1] * gain.rho1) * T
        middle, radius = decay_integral(w, own[1] * gain.pole)
        return ((Fraction(1), Fraction(0)), _wide(T * middle, T * radius)), (zero, zero)
    if not any(plant):
        return tuple(
            tuple((T ** (j - i) / math.factorial(j - i), Fraction(0)) if j >= i else zero for j in range(n))
            for i in range(n)
        )
    rows, wide = expm([[T * x for x in row] for row in companion(plant)], BITS)
    return tuple(tuple(_wide(x, wide) for x in row) for row in rows)


def _wide(middle: Fraction, radius: Fraction) -> Interval:
    """Return an interval of few digits, wide enough for whoever encloses the same to a few digits more."""
    if not radius:
        return middle, radius
    unit, finer = 2**KEPT_BITS, 2 ** (KEPT_BITS + 16)
    wide = radius + Fraction(1 + math.ceil(abs(middle)), unit)
    return Fraction(round(middle * unit), unit), Fraction(math.ceil(wide * finer), finer)


def companion(plant: Sequence[Fraction]) -> list[list[Fraction]]:
    """Return ``A`` with ``xi' = A xi`` for one agent without input.

    Examples
    --------
    >>> [[str(x) for x in row] for row in companion([Fraction(4), Fraction(1)])]
    [['0', '1'], ['-4', '-1']]
    """
    n = len(plant)
    return [*([Fraction(j == i + 1) for j in range(n)] for i in range(n - 1)), [-a for a in plant]]


def decay_integral(w: Fraction, p: Fraction) -> Interval:
    """Enclose ``int_0^1 e^(-w (1 - q)) q^p dq = sum_j (-w)^j / ((p + 1) .. (p + j + 1))``, ``p >= 0``.

    Raises
    ------
    ParameterError
        ``w`` is beyond 100 in size.

    Examples
    --------
    >>> [str(x) for x in decay_integral(Fraction(0), Fraction(3))]
    ['1/4', '0']
    """
    if abs(w) > LARGEST_DECAY:
        raise ParameterError(
            "rest", f"(a_2 + rest rho1) T = {float(w):.4g} is beyond {LARGEST_DECAY}; take a smaller rest, or rho1"
        )
    term, total = 1 / (p + 1), Fraction(0)
    for j in range(MOST_TERMS):
        total += term
        term = _short(term * -w / (p + j + 2)) if w else Fraction(0)
        if p + j + 3 >= 2 * abs(w) and abs(term) * 2**BITS <= 1:
            break
    if not term and not w:
        return total, Fraction(0)
    # Each term was rounded by 2^-(2 BITS) at most, which later factors multiply by less than e^|w| together.
    return _short(total), Fraction(4, 2**BITS)


def _short(x: Fraction) -> Fraction:
    """Round to twice as many bits after the point as are kept."""
    return Fraction(round(x * 4**BITS), 4**BITS)
