"""How far leaders that move, and disturbances, drive followers off while messages are late: an integral from above.

With ``s_c`` the integral of ``min(gain, cap)`` followers are driven off by ``speed + disturbance`` times

    int_0^T e^(-b (s_c(T) - s_c(r))) dr

at ``T``, over the least entry of the vector of the rows. Without a cap it is 0: the clock goes on for ever.
"""

from __future__ import annotations

from fractions import Fraction

from lmi.exact.elementary_enclosures import exp, log, rounded
from ptcc_certify.checker.input_formulas import BITS, PrescribedGain
from ptcc_certify.checker.reading import Interval


def drift_above(gain: PrescribedGain, b: Fraction, cap: Fraction | None) -> Fraction:
    """Bound ``int_0^T e^(-b (s_c(T) - s_c(r))) dr`` from above, ``s_c`` the integral of ``min(gain, cap)``.

    Before ``gain`` comes to the cap, where ``T - t = r``, it is ``int (r/(T - x))^p dx`` at most, ``p = b k``; from
    there on a linear equation with constant coefficients adds ``(1 - e^(-b cap r)) / (b cap)``.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(2))
    >>> float(drift_above(gain, Fraction(1), Fraction(2)))  # (1 - e^-2)/2
    0.43233235838169365
    >>> 0.09 < drift_above(gain, Fraction(1), Fraction(11)) < 0.11, drift_above(gain, Fraction(1), None)
    (True, Fraction(0, 1))
    """
    if cap is None:
        return Fraction(0)
    turn = gain.T if cap <= gain.value(Fraction(1)) else gain.k / (cap - gain.rho1)
    low, high = _decay(b * cap * turn)
    return rounded(high * _before(gain, b * gain.k, turn) + (1 - low) / (b * cap), BITS, up=True)


def _before(gain: PrescribedGain, p: Fraction, left: Fraction) -> Fraction:
    """Bound ``int_0^(T - left) (left/(T - x))^p dx = left (1 - e^(-(p-1) z)) / (p - 1)``, ``z = ln(T/left)``."""
    z = rounded(log(gain.T / left, BITS)[1], BITS, up=True)
    if p < 1:
        grown = exp(rounded((1 - p) * z, BITS, up=True), BITS)[1]
        return left * min((grown - 1) / (1 - p), z * grown)
    return left * (z if p == 1 else min(z, (1 - _decay((p - 1) * z)[0]) / (p - 1)))


def _decay(x: Fraction) -> Interval:
    """Enclose ``e^-x``, ``x >= 0``."""
    return exp(-rounded(x, BITS, up=True), BITS)[0], exp(-rounded(x, BITS), BITS)[1]
