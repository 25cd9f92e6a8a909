"""Rational enclosures of square roots, exponentials, logarithms and powers, with the standard library alone.

Every function returns ``(below, above)``: rationals between which the true value lies, apart by about ``2^-bits`` of
its size.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from math import isqrt
from operator import mul

#: Bits to which results are enclosed unless told otherwise.
BITS = 96
#: Beyond this argument an exponential is not formed.
LARGEST_EXPONENT = 100_000
#: Largest ``mu2 T_r + mu3 kappa`` for which :func:`decay_integral_below` gives more than 0.
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
    if x == 0:
        return Fraction(0), Fraction(0)
    shift = bits + max((x.denominator.bit_length() - x.numerator.bit_length()) // 2 + 1, 0)
    root = isqrt((x.numerator << 2 * shift) // x.denominator)
    return Fraction(root, 1 << shift), Fraction(root + 1, 1 << shift)


@lru_cache(maxsize=256)  # bounds of many agents ask for the same few
def exp(x: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose ``e^x``.

    Raises
    ------
    OverflowError
        ``|x|`` is above 100,000.

    Examples
    --------
    >>> below, above = exp(Fraction(1))
    >>> float(below), float(above - below) < 1e-28
    (2.718281828459045, True)
    """
    if abs(x) > LARGEST_EXPONENT:
        raise OverflowError("an exponential of this size is not formed")
    if x < 0:
        below, above = exp(-x, bits + 2)
        return rounded(1 / above, bits + 2), rounded(1 / below, bits + 2, up=True)
    # e^x = (e^(x / 2^halvings))^(2^halvings): each squaring doubles the relative error.
    halvings = max((x.numerator // x.denominator).bit_length() + 8, 0)
    scale = bits + halvings + 24
    one = 1 << scale
    low = (x.numerator << scale) // (x.denominator << halvings)
    lower, upper = _exp_series(low, one), _exp_series(low + 1, one, up=True)
    # Beyond `scale` bits nothing is kept: the size of the result is carried apart from its leading bits.
    a, b = Fraction(lower, one), Fraction(upper, one)
    for _ in range(halvings):
        a, b = rounded(a * a, scale), rounded(b * b, scale, up=True)
    return rounded(a, bits + 2), rounded(b, bits + 2, up=True)


def _exp_series(x: int, one: int, up: bool = False) -> int:
    """Sum ``x^n / n!`` in units of ``1 / one`` for ``0 <= x <= one / 128``, rounded down or up."""
    total = term = one
    n = 1
    while term:
        term = term * x // (one * n)
        total += term
        n += 1
    # Each term is cut by less than 2 units, and the tail is below one.
    return total + 2 * n + 4 if up else total


def log(x: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose the natural logarithm of a positive rational.

    ``x = 2^k m`` with ``1/2 <= m < 2`` and ``ln m = 2 artanh((m - 1)/(m + 1))``.

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
    k = x.numerator.bit_length() - x.denominator.bit_length()
    m = x / Fraction(2) ** k
    below, above = _artanh((m - 1) / (m + 1), bits + 8)
    two = _artanh(Fraction(1, 3), bits + 8 + abs(k).bit_length())
    low, high = two if k >= 0 else two[::-1]
    return 2 * (below + k * low), 2 * (above + k * high)


def _artanh(y: Fraction, bits: int) -> Enclosure:
    """Enclose ``artanh y = sum y^(2n+1)/(2n+1)`` for ``|y| <= 1/3``."""
    if y < 0:
        below, above = _artanh(-y, bits)
        return -above, -below
    one = 1 << (bits + 16)
    low = y.numerator * one // y.denominator
    return Fraction(_artanh_series(low, one), one), Fraction(_artanh_series(low + 1, one, up=True), one)


def _artanh_series(y: int, one: int, up: bool = False) -> int:
    total, power, n = 0, y, 0
    while power:
        total += power // (2 * n + 1)
        power = power * y // one * y // one
        n += 1
    # Each term is cut by less than 3 units, and the tail is below one.
    return total + 3 * n + 4 if up else total


def power(x: Fraction, y: Fraction, bits: int = BITS) -> Enclosure:
    """Enclose ``x^y`` for ``x > 0``.

    Examples
    --------
    >>> below, above = power(Fraction(2), Fraction(1, 2))
    >>> below**2 <= 2 <= above**2, float(above - below) < 1e-27
    (True, True)
    """
    more = (
        bits
        + 8
        + max((y.numerator // y.denominator).bit_length(), 0)
        + abs(x.numerator.bit_length() - x.denominator.bit_length()).bit_length()
    )
    below, above = log(x, more)
    ends = sorted((y * below, y * above))
    return exp(ends[0], bits + 2)[0], exp(ends[1], bits + 2)[1]


def rounded(x: Fraction, bits: int, up: bool = False) -> Fraction:
    """Round a nonnegative rational down, or up, to so many significant bits.

    Examples
    --------
    >>> rounded(Fraction(1, 3), 2), rounded(Fraction(1, 3), 2, up=True)
    (Fraction(1, 4), Fraction(3, 8))
    """
    if x == 0:
        return x
    shift = bits - (x.numerator.bit_length() - x.denominator.bit_length())
    numerator, denominator = (
        (x.numerator << shift, x.denominator) if shift >= 0 else (x.numerator, x.denominator << -shift)
    )
    mantissa = -(-numerator // denominator) if up else numerator // denominator
    return Fraction(mantissa) * Fraction(2) ** -shift


def decay_integral_below(T_r: Fraction, mu2: Fraction, m: Fraction, z: Fraction, bits: int = BITS) -> Fraction:
    """Bound ``int_0^t dr/psi(r)`` from below, ``psi(r) = e^(-mu2 r) ((T_r - r)/T_r)^m``, ``z = ln(T_r/(T_r - t))``.

    Parameters
    ----------
    T_r, mu2, m : Fraction
        Positive; ``m = mu3 kappa``.
    z : Fraction
        Nonnegative.

    Examples
    --------
    >>> below = decay_integral_below(Fraction(1), Fraction(1, 10**20), Fraction(1, 2), log(Fraction(2))[1])
    >>> abs(float(below) - 2 * (1 - 0.5**0.5)) < 1e-15  # mu2 near 0, m = 1/2, t = T_r/2
    True
    """
    return decay_integrals_below(T_r, mu2, m, [z], bits)[z]


def decay_integrals_below(
    T_r: Fraction, mu2: Fraction, m: Fraction, instants: Iterable[Fraction], bits: int = BITS
) -> dict[Fraction, Fraction]:
    """Bound the integrals up to several instants ``z``; see :func:`decay_integral_below`.

    With ``q = (T_r - r)/T_r`` the integrand is ``e^(w (1 - q)) q^(-m)``, ``w = mu2 T_r``. The way of ``q`` from 1 to
    ``e^(-z)`` is cut into panels, which all instants share; on each the integrand is a product of two power series with
    positive coefficients, so that cutting them off keeps a lower bound. Where ``w q`` is negligible the rest is
    elementary. The bounds are 0 where ``w + m`` is above ``LARGEST_PUSH``.
    """
    # Smaller factors give a lower bound too, and short ones cost less.
    T_r, mu2, m = (rounded(x, 4 * bits) for x in (T_r, mu2, m))
    w, total, near = rounded(mu2 * T_r, 4 * bits), Fraction(0), Fraction(1)
    if w + m > LARGEST_PUSH:
        return dict.fromkeys(instants, Fraction(0))
    elementary = Fraction(1, 2**bits) / max(w, Fraction(1))
    found = {}
    for z in sorted(set(instants)):
        # A shorter way gives a lower bound too.
        short = min(z, Fraction(LARGEST_EXPONENT // 4) / (m - 1)) if m > 1 else z
        small = short.denominator.bit_length() - short.numerator.bit_length()
        left = exp(-min(short, Fraction(4 * bits)), 2 * bits + max(small, 0))[1]
        while near > max(left, elementary):
            share = min(Fraction(1, 2), 16 / (w * near + m))
            following = rounded(near * (1 - share), 64, up=True)
            if following <= left or following >= near:
                following = left
            share = rounded(1 - following / near, bits)
            start = exp(w * (1 - near), bits)[0] * power(1 / near, m, bits)[0]
            total += rounded(T_r * near * start * _series_below(w * near, m, share, bits), bits)
            near = following
        rest = Fraction(0)
        begin = log(1 / near)[1]
        if short > begin and near <= elementary:
            rest = T_r * exp(w * (1 - near), bits)[0] * _power_integral_below(m - 1, begin, short, bits)
        found[z] = rounded(total + rest, bits)
    return found


def _power_integral_below(a: Fraction, begin: Fraction, end: Fraction, bits: int) -> Fraction:
    """Bound ``int_begin^end e^(a x) dx`` from below, also for ``a`` near 0 or of either sign."""
    length = end - begin
    y = a * length
    first = exp(max(a * begin, Fraction(-LARGEST_EXPONENT)), bits)[0] if a * begin > -LARGEST_EXPONENT else Fraction(0)
    if abs(y) > 1:
        grown = exp(min(y, Fraction(LARGEST_EXPONENT)), bits)[0] if y > 0 else exp(max(y, Fraction(-1000)), bits)[1]
        return first * (grown - 1) / a if y > 0 else first * (1 - grown) / -a
    # The mean of e^(y x) over 0 <= x <= 1 is sum y^k / (k + 1)!: it grows with y, and cut after an odd power it is a
    # lower bound for either sign.
    y = rounded(y, bits) if y >= 0 else -rounded(-y, bits, up=True)
    mean = term = Fraction(1)
    for k in range(1, 2 * bits):
        term = term * y / (k + 1)
        mean += term
        if k % 2 and abs(term) < Fraction(1, 2**bits):
            break
    return first * length * max(mean, Fraction(0))


def _series_below(w: Fraction, m: Fraction, q: Fraction, bits: int) -> Fraction:
    """Bound ``int_0^q e^(w x) (1 - x)^(-m) dx`` from below, with ``x = q y`` as a power series in ``y``."""
    one, push = 1 << (bits + 32), w * q
    exponential, binomial, total, n = [one], [one], one, 0
    while True:
        n += 1
        exponential.append(exponential[-1] * push.numerator // (push.denominator * n))
        grown = binomial[-1] * (m.numerator + (n - 1) * m.denominator) * q.numerator
        binomial.append(grown // (m.denominator * q.denominator * n))
        term = sum(map(mul, exponential, reversed(binomial))) // (one * (n + 1))
        total += term
        if term == 0:
            return q * Fraction(total, one)
