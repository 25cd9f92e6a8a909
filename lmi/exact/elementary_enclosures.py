"""Rational enclosures of square roots, exponentials and logarithms, with the standard library alone.

Each enclosure is ``(below, above)``: rationals between which the true value lies, apart by about ``2^-bits`` of
its size. They come from those of :mod:`decimal`, which rounds them correctly to any number of digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from decimal import MAX_EMAX, MIN_EMIN, ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from functools import lru_cache
from operator import mul

#: Bits to which results are enclosed unless told otherwise.
BITS = 96
#: Bits beyond these that are kept.
SPARE_BITS = 24
#: Beyond this argument an exponential is not formed.
LARGEST_EXPONENT = 100_000
#: Largest ``mu2 T_r + mu3 kappa`` for which :func:`decay_integrals_below` gives more than 0.
LARGEST_PUSH = 2000

Enclosure = tuple[Fraction, Fraction]


def sqrt(x: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose the square root of a nonnegative rational.

    Raises
    ------
    ValueError
        ``x`` is negative.

    Examples
    --------
    >>> below, above = sqrt(Fraction(2))
    >>> below**2 <= 2 <= above**2, float(above - below) < 1e-28
    (True, True)
    """
    if x < 0:
        raise ValueError("the square root of a negative number")
    return _enclose(Context.sqrt, x, bits)


@lru_cache(maxsize=256)  # bounds of many agents ask for the same few
def exp(x: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose ``e^x``; from above by ``e^-100,000`` at least.

    Raises
    ------
    OverflowError
        ``x`` is above 100,000.

    Examples
    --------
    >>> below, above = exp(Fraction(1))
    >>> float(below), float(above - below) < 1e-28
    (2.718281828459045, True)
    >>> below, above = exp(Fraction(-(10**9)))
    >>> below, 0 < above < Fraction(1, 10**40_000)
    (Fraction(0, 1), True)
    """
    if x > LARGEST_EXPONENT:
        raise OverflowError("an exponential of this size is not formed")
    if x < -LARGEST_EXPONENT:
        return Fraction(0), exp(Fraction(-LARGEST_EXPONENT), bits)[1]
    return _enclose(Context.exp, x, bits)


def log(x: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose the natural logarithm of a positive rational; near 1 they are apart by about ``2^-bits``.

    Raises
    ------
    ValueError
        ``x`` is not positive.

    Examples
    --------
    >>> below, above = log(Fraction(10))
    >>> float(below), float(above - below) < 1e-28
    (2.302585092994046, True)
    """
    if x <= 0:
        raise ValueError("the logarithm of a number that is not positive")
    return _enclose(Context.ln, x, bits)


def _enclose(function: Callable[[Context, Decimal], Decimal], x: Fraction, bits: int) -> Enclosure:
    """Enclose a function that grows: at decimals about ``x``, its values widened by a hundred units of the last digit.

    Beside the bits there are digits to spare, and for an argument of up to 100,000.
    """
    digits, ends = bits // 3 + 20, []
    for rounding, side in ((ROUND_FLOOR, Decimal(-1)), (ROUND_CEILING, Decimal(1))):
        context = Context(prec=digits, rounding=rounding, Emin=MIN_EMIN, Emax=MAX_EMAX)
        short = rounded(x, 4 * digits, up=side > 0)  # long integers are slow to become decimals
        value = function(context, context.divide(Decimal(short.numerator), Decimal(short.denominator)))
        end = context.fma(context.abs(value), context.scaleb(side, 3 - digits), value)
        ends.append(rounded(Fraction(end), bits + SPARE_BITS, up=side > 0))
    return ends[0], ends[1]


def rounded(x: Fraction, bits: int, up: bool = False) -> Fraction:
    """Round a rational down, or up, to so many significant bits.

    Examples
    --------
    >>> rounded(Fraction(1, 3), 2), rounded(Fraction(1, 3), 2, up=True)
    (Fraction(1, 4), Fraction(3, 8))
    """
    if x == 0:
        return x
    shift = bits - (x.numerator.bit_length() - x.denominator.bit_length())
    numerator, denominator = x.numerator << max(shift, 0), x.denominator << max(-shift, 0)
    mantissa = -(-numerator // denominator) if up else numerator // denominator
    return Fraction(mantissa << max(-shift, 0), 1 << max(shift, 0))


def decay_integrals_below(
    T_r: Fraction, mu2: Fraction, m: Fraction, instants: Iterable[Fraction], bits: int = BITS
) -> dict[Fraction, Fraction]:
    """Bound ``int_0^t dr/psi(r)`` from below, ``psi(r) = e^(-mu2 r) ((T_r - r)/T_r)^m``, ``z = ln(T_r/(T_r - t))``.

    With ``q = (T_r - r)/T_r`` the integrand is ``e^(w (1 - q)) q^(-m)``, ``w = mu2 T_r``. The way of ``q`` from 1 to
    ``e^(-z)`` is cut into panels, which all instants share; on each the integrand is a product of two power series with
    positive coefficients, so that cutting them off keeps a lower bound. Where ``w q`` is negligible the rest is
    elementary. The bounds are 0 where ``w + m`` is above ``LARGEST_PUSH``.

    Parameters
    ----------
    T_r, mu2, m : Fraction
        Positive; ``m = mu3 kappa``.
    instants : iterable of Fraction
        Values of ``z``, nonnegative.

    Returns
    -------
    dict
        The bound for every ``z``.

    Examples
    --------
    >>> half = log(Fraction(2))[1]  # mu2 near 0, m = 1/2, t = T_r/2
    >>> below = decay_integrals_below(Fraction(1), Fraction(1, 10**20), Fraction(1, 2), [half])[half]
    >>> abs(float(below) - 2 * (1 - 0.5**0.5)) < 1e-15
    True
    """
    # Smaller factors give a lower bound too, and short ones cost less.
    T_r, mu2, m = (rounded(x, 4 * bits) for x in (T_r, mu2, m))
    w = rounded(mu2 * T_r, 4 * bits)
    total, near = Fraction(0), Fraction(1)
    if w + m > LARGEST_PUSH:
        return dict.fromkeys(instants, Fraction(0))
    elementary = Fraction(1, 2**bits) / max(w, Fraction(1))
    bounds = {}
    for z in sorted(set(instants)):
        # A shorter way gives a lower bound too.
        short = min(z, Fraction(LARGEST_EXPONENT // 4) / (m - 1)) if m > 1 else z
        remaining = exp(-min(short, Fraction(4 * bits)), 2 * bits + _bits_below_one(short))[1]
        while near > max(remaining, elementary):
            share = min(Fraction(1, 2), 16 / (w * near + m))
            following = max(rounded(near * (1 - share), 64, up=True), remaining)
            share = rounded(1 - following / near, bits)
            decay = exp(w * (1 - near) + m * log(1 / near, 2 * bits)[0], bits)[0]
            total += rounded(T_r * near * decay * _series_below(w * near, m, share, bits), bits)
            near = following
        remainder = T_r * exp(w * (1 - near), bits)[0] * _power_integral_below(m - 1, log(1 / near)[1], short, bits)
        bounds[z] = rounded(total + remainder, bits)
    return bounds


def _bits_below_one(x: Fraction) -> int:
    """Return how many bits ``e^x - 1`` needs beside its own."""
    return max(x.denominator.bit_length() - x.numerator.bit_length(), 0)


def _power_integral_below(a: Fraction, begin: Fraction, end: Fraction, bits: int) -> Fraction:
    """Bound ``int_begin^end e^(a x) dx`` from below, also for ``a`` near 0 or of either sign; 0 where ``end`` is first.

    It is ``e^(a begin)`` times the length times the mean of ``e^(y x)`` over 0 to 1, ``(e^y - 1)/y``, ``y = a length``.
    """
    length = max(end - begin, Fraction(0))
    y = a * length
    mean = 1 - abs(y)
    if abs(y) > Fraction(1, 2**bits):
        mean = (exp(y, bits + _bits_below_one(y))[y < 0] - 1) / y
    return exp(a * begin, bits)[0] * length * mean


def _series_below(w: Fraction, m: Fraction, q: Fraction, bits: int) -> Fraction:
    """Bound ``int_0^q e^(w x) (1 - x)^(-m) dx`` from below, with ``x = q y`` as a power series in ``y``."""
    unit, push = 1 << (bits + 32), w * q
    exponential, binomial = [unit], [unit]
    total, n = unit, 0
    while True:
        n += 1
        exponential.append(exponential[-1] * push.numerator // (push.denominator * n))
        grown = binomial[-1] * (m.numerator + (n - 1) * m.denominator) * q.numerator
        binomial.append(grown // (m.denominator * q.denominator * n))
        term = sum(map(mul, exponential, reversed(binomial))) // (unit * (n + 1))
        total += term
        if term == 0:
            return q * Fraction(total, unit)
