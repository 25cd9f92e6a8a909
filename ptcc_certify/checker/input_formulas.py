"""Proved bounds of the input of the nominal protocol, ``u = gain(t) E``, with the standard library alone.

With ``k = rho2 kappa`` and ``z = ln(T/(T - t))`` the gain is ``rho1 + (k/T) e^z`` and the stretched clock
``s = rho1 T (1 - e^-z) + k z``. What is known of an agent is ``|e_k| <= min(error_bound, amplitude e^(-rate s / 2))``:
``error_bound`` for all times, ``amplitude`` from a Lyapunov function of that rate. The bounds below use ``error_bound``
up to an instant ``z`` and ``amplitude`` from there on; every ``z`` gives a valid one. The energy follows besides from
two Lyapunov equations. All arguments are rationals, every rounding is upwards (or downwards where a name says
``below``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import chain, pairwise
from typing import Any, NamedTuple

from lmi.exact.definite import Arithmetic
from lmi.exact.elementary_enclosures import LARGEST_EXPONENT, exp, log, rounded, sqrt
from lmi.exact.numbers import integers, longest
from lmi.exact.work import spend
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.matrix_products import congruence
from ptcc_certify.checker.reading import Interval, length

#: Bits to which bounds are rounded.
BITS = 64
#: Pieces, of equal length in ``z``, into which the time is cut while sliding variables move.
PIECES = 16
#: Periods before the end that are multiplied one by one.
LAST_PERIODS = 2000

Linear = Mapping[int, Fraction]
Rows = Sequence[Sequence[Fraction]]
Of = Callable[["PrescribedGain", Fraction, Fraction, Fraction, Fraction], Fraction]


def root_above(x: Fraction) -> Fraction:
    """Bound a square root from above.

    Examples
    --------
    >>> float(root_above(Fraction(9, 4)))
    1.5
    """
    return rounded(sqrt(x, BITS)[1], BITS, up=True)


def decay_above(x: Fraction) -> Fraction:
    """Bound ``e^-x`` from above; beyond ``x = 100,000`` it is no longer made smaller.

    Raises
    ------
    OverflowError
        ``x`` is below -100,000.

    Examples
    --------
    >>> float(decay_above(Fraction(1)))
    0.36787944117144233
    """
    return exp(-rounded(x, BITS), BITS)[1]


@dataclass(frozen=True)
class PrescribedGain:
    """``gain = rho1 + k/(T - t)`` before ``T``, in terms of ``z = ln(T/(T - t))``.

    Attributes
    ----------
    T, rho1, k : Fraction
        ``k = rho2 kappa``; all positive.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(2))
    >>> half = log(Fraction(2))[0], Fraction(1, 2)  # z and 1 - t/T
    >>> gain.value(half[1]), float(gain.clock(*half))
    (Fraction(5, 1), 1.8862943611198906)
    """

    T: Fraction
    rho1: Fraction
    k: Fraction

    def value(self, q: Fraction) -> Fraction:
        """Return the gain where ``1 - t/T = q``; from above for a lower bound of ``q``."""
        return self.rho1 + self.k / (self.T * q)

    def clock(self, z: Fraction, q: Fraction) -> Fraction:
        """Return the clock, the integral of the gain, where ``1 - t/T = q = e^-z``.

        From above for a lower bound of ``q`` and an upper one of ``z``, from below for the others.
        """
        return self.rho1 * self.T * (1 - q) + self.k * z

    def square(self, z: Fraction, q: Fraction) -> Fraction:
        """Return the integral of the square of the gain where ``1 - t/T = q = e^-z``; rounded like :meth:`clock`."""
        return self.rho1**2 * self.T * (1 - q) + 2 * self.rho1 * self.k * z + self.k**2 / self.T * (1 / q - 1)


def peak_above(
    gain: PrescribedGain, error_bound: Fraction, amplitude: Fraction, rate: Fraction, z: Fraction
) -> Fraction:
    """Bound ``sup_t gain(t) |e_k(t)|`` for ``rate k >= 2``.

    Up to ``z`` the gain grows to its value there; from there on ``gain e^(-rate s / 2)`` no longer grows, since
    ``gain' <= gain^2 / k``.

    Raises
    ------
    ValueError
        ``rate k < 2``: the bound grows without limit.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> float(peak_above(gain, Fraction(1), Fraction(3), Fraction(2), Fraction(0)))  # 2 * 3 at the start
    6.0
    >>> float(peak_above(gain, Fraction(1), Fraction(3), Fraction(2), Fraction(3, 5))) < 3
    True
    """
    if rate * gain.k < 2:
        raise ValueError("the input is not bounded by this rate")
    low, high = exp(-z, BITS)
    top = gain.value(low)
    late = amplitude * decay_above(rate / 2 * gain.clock(z, high)) * top
    return rounded(late if z == 0 else max(error_bound * top, late), BITS, up=True)


def energy_above(
    gain: PrescribedGain, error_bound: Fraction, amplitude: Fraction, rate: Fraction, z: Fraction
) -> Fraction:
    """Bound ``int_0^T (gain |e|)^2 dt`` for ``rate k > 1``.

    Up to ``z`` it is ``error_bound^2 int_0^t gain^2 dt``, and from there on, integrated by parts,
    ``amplitude^2 e^(-rate s) (gain + (k/T) e^z / (rate k - 1)) / rate`` at most.

    Raises
    ------
    ValueError
        ``rate k <= 1``: the bound is infinite.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1, 10**9), Fraction(1))
    >>> round(float(energy_above(gain, Fraction(1), Fraction(1), Fraction(2), Fraction(0))), 6)  # int (1-t)^(2-2) dt
    1.0
    """
    if rate * gain.k <= 1:
        raise ValueError("the energy is not bounded by this rate")
    low, high = exp(-z, BITS)
    late = amplitude**2 * decay_above(rate * gain.clock(z, high)) / rate
    late *= gain.value(low) + gain.k / (gain.T * low) / (rate * gain.k - 1)
    return rounded((error_bound**2 * gain.square(z, low) if z else 0) + late, BITS, up=True)


def length_above(
    gain: PrescribedGain, error_bound: Fraction, amplitude: Fraction, rate: Fraction, z: Fraction
) -> Fraction:
    """Bound ``int_0^T gain |e| dt = int |e| ds`` by ``error_bound s(z) + (2/rate) amplitude e^(-rate s(z) / 2)``.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> float(length_above(gain, Fraction(1), Fraction(3), Fraction(2), Fraction(0)))
    3.0
    """
    low, high = exp(-z, BITS)
    late = 2 / rate * amplitude * decay_above(rate / 2 * gain.clock(z, high))
    return rounded((error_bound * gain.clock(z, low) if z else 0) + late, BITS, up=True)


def integral_above(gain: PrescribedGain, even: Fraction, grown: Fraction, p: Fraction) -> Fraction:
    """Bound ``int gain ||E||^2 ds``, the energy, by ``even = int ||E||^2 ds`` and ``grown = int e^(s/k) ||E||^2 ds``.

    With ``q = rho1 T / k`` it is ``z = s/k - q (1 - e^-z)``, hence ``e^z - e^-p e^(s/k) <= p`` for ``0 <= p <= q`` and

        gain = rho1 + (k/T) e^z <= rho1 + (k/T) (p + e^-p e^(s/k))

    which is at most twice the gain for ``p = q``.

    Raises
    ------
    ValueError
        ``p`` is not within ``0 .. q``.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))  # E = e^-s: even 1/2, grown 1
    >>> round(float(integral_above(gain, Fraction(1, 2), Fraction(1), Fraction(0))), 6)
    1.5
    >>> round(float(integral_above(gain, Fraction(1, 2), Fraction(1), Fraction(7, 10))), 6)  # ln 2 is best
    1.346585
    """
    if not 0 <= p <= gain.rho1 * gain.T / gain.k:
        raise ValueError("p is not between 0 and rho1 T / k")
    slope = gain.k / gain.T
    return rounded((gain.rho1 + slope * p) * even + slope * decay_above(p) * grown, BITS, up=True)


@dataclass(frozen=True)
class Limits:
    """What an actuator leaves of the gain: capped at ``gain_cap``, 0 from ``T - stop_before`` on, or held.

    Attributes
    ----------
    gain_cap, stop_before : Fraction or None
        ``stop_before < T``.
    sample_period : Fraction or None
        Gain and input are held over so long a time, from 0 on; the last period ends at the deadline, or at the stop.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> capped = Limits(gain_cap=Fraction(11))
    >>> capped.largest_gain(gain), float(capped.clock_below(gain))  # rho1 T + k (1 + ln(T (11 - rho1)/k))
    (Fraction(11, 1), 4.302585092994046)
    """

    gain_cap: Fraction | None = None
    stop_before: Fraction | None = None
    sample_period: Fraction | None = None

    def largest_gain(self, gain: PrescribedGain) -> Fraction:
        """Return the largest value of ``gain`` that acts.

        Raises
        ------
        ValueError
            Nothing limits the gain.
        """
        latest = self.end(gain) if self.sample_period is None else self.sample_period * (self.periods(gain) - 1)
        if latest < gain.T:
            return self.gain_at(gain, latest)
        if self.gain_cap is None:
            raise ValueError("nothing limits the gain")
        return self.gain_cap

    def gain_at(self, gain: PrescribedGain, t: Fraction) -> Fraction:
        """Return ``min(gain(t), gain_cap)``, what the cap leaves of ``gain`` at an instant ``t`` before the deadline.

        Parameters
        ----------
        gain : PrescribedGain
        t : Fraction
            In ``[0, T)``, in units of time.
        """
        value = gain.value(1 - t / gain.T)
        return value if self.gain_cap is None else min(value, self.gain_cap)

    def end(self, gain: PrescribedGain) -> Fraction:
        """Return the instant from which on ``gain`` is 0, or the deadline."""
        return gain.T - (self.stop_before or 0)

    def periods(self, gain: PrescribedGain) -> int:
        """Return the number of sampling periods that begin before ``gain`` ends.

        Raises
        ------
        ValueError
            Nothing is sampled.
        """
        if self.sample_period is None:
            raise ValueError("nothing is sampled")
        return -(-self.end(gain) // self.sample_period)

    def clock_below(self, gain: PrescribedGain) -> Fraction:
        """Bound the integral of the gain up to the deadline from below.

        With sampling it is a sum of values at the beginnings of periods, which lacks at most
        ``h (largest gain - gain(0))``, since the gain never falls.

        Raises
        ------
        ValueError
            Nothing limits the gain: the integral is infinite.
        """
        lost = (self.sample_period or 0) * (self.largest_gain(gain) - self.gain_at(gain, Fraction(0)))
        return rounded(max(self.integrals(gain)[0] - lost, Fraction(0)), BITS)

    def clock_above(self, gain: PrescribedGain) -> Fraction:
        """Bound the integral of ``gain`` up to the deadline from above, without sampling, but for the largest gain.

        Raises
        ------
        ValueError
            Nothing limits the gain: the integral is infinite.
        """
        top, turn, (_, high) = self._turn(gain)
        return rounded(gain.clock(high, 1 - turn / gain.T) + top * (self.end(gain) - turn), BITS, up=True)

    def integrals(self, gain: PrescribedGain) -> Interval:
        """Bound the integral of ``gain`` up to the deadline from below, and that of its square from above.

        Without sampling, but for the largest gain.

        Raises
        ------
        ValueError
            Nothing limits the gain: the integrals are infinite.
        """
        top, turn, (low, high) = self._turn(gain)
        q, rest = 1 - turn / gain.T, self.end(gain) - turn
        return gain.clock(low, q) + top * rest, gain.square(high, q) + top**2 * rest

    def _turn(self, gain: PrescribedGain) -> tuple[Fraction, Fraction, Interval]:
        """Return the largest gain, from which instant on it is that, and ``-ln(1 - t/T)`` there."""
        top, turn = self.largest_gain(gain), Fraction(0)
        if top > gain.value(Fraction(1)):
            turn = min(gain.T - gain.k / (top - gain.rho1), self.end(gain))
        return top, turn, log(1 / (1 - turn / gain.T), BITS)


def clock_between(gain: PrescribedGain, cap: Fraction | None, a: Fraction, b: Fraction) -> Fraction | None:
    """Bound ``int_a^b min(gain, cap) dt`` from below for ``0 <= a < b <= T``; None where it is infinite.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(2))
    >>> float(clock_between(gain, None, Fraction(0), Fraction(1, 2)))  # 1/2 + 2 ln 2
    1.8862943611198906
    >>> one, half = Fraction(1), Fraction(1, 2)
    >>> clock_between(gain, Fraction(5), half, one), clock_between(gain, None, 0 * one, one)
    (Fraction(5, 2), None)
    """
    turn = gain.T
    if cap is not None:
        turn = max(gain.T - gain.k / (cap - gain.rho1), Fraction(0)) if cap > gain.rho1 else Fraction(0)
    elif b == gain.T:
        return None
    early, late = min(b, turn), max(a, turn)
    way = Fraction(0) if cap is None or late >= b else cap * (b - late)
    if a < early:
        way += gain.rho1 * (early - a) + gain.k * log((gain.T - a) / (gain.T - early), BITS)[0]
    return rounded(max(way, Fraction(0)), BITS)


def gain_above(gain: PrescribedGain, gain_cap: Fraction, b: Fraction, cap: Fraction | None = None) -> Fraction:
    """Bound ``sup_t g e^(-b s_c)``, ``g = min(gain, gain_cap)``, ``s_c`` the integral of ``min(g, cap)`` from 0 to t.

    While ``gain`` grows past neither cap, or past ``cap`` alone, the product falls, grows, or first falls and then
    grows; under ``gain_cap`` it falls: the supremum is where ``t = 0``, or where the gain comes to a cap.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(2))
    >>> gain_above(gain, Fraction(9), Fraction(1)), gain_above(gain, Fraction(2), Fraction(1))
    (Fraction(3, 1), Fraction(2, 1))
    >>> 9 * 0.6 < gain_above(gain, Fraction(9), Fraction(1, 8)) < 9 * 0.7
    True
    """
    first, lower = gain.value(Fraction(1)), gain_cap if cap is None else min(cap, gain_cap)
    found = [min(first, gain_cap)]
    for level in (lower, gain_cap):
        if level > first:
            t = gain.T - gain.k / (level - gain.rho1)
            found.append(level * decay_above(b * (clock_between(gain, lower, Fraction(0), t) or Fraction(0))))
    return max(found)


def drift_above(gain: PrescribedGain, b: Fraction, cap: Fraction | None) -> Fraction:
    """Bound ``int_0^T e^(-b (s_c(T) - s_c(r))) dr`` from above, ``s_c`` the integral of ``min(gain, cap)``.

    Before ``gain`` comes to the cap, where ``T - t = r``, it is ``int (r/(T - x))^p dx`` at most, ``p = b k``; from
    there on a linear equation with constant coefficients adds ``(1 - e^(-b cap r)) / (b cap)``. By so much, over the
    least entry of the vector of the rows, leaders of speed 1 drive followers off; by nothing without a cap, as the
    clock goes on for ever.

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
    low, high = _decay_within(b * cap * turn)
    return rounded(high * _left_before(gain, b * gain.k, turn) + (1 - low) / (b * cap), BITS, up=True)


def _left_before(gain: PrescribedGain, p: Fraction, left: Fraction) -> Fraction:
    """Bound ``int_0^(T - left) (left/(T - x))^p dx = left (1 - e^(-(p-1) z)) / (p - 1)``, ``z = ln(T/left)``."""
    z = rounded(log(gain.T / left, BITS)[1], BITS, up=True)
    if p < 1:
        grown = exp(rounded((1 - p) * z, BITS, up=True), BITS)[1]
        return left * min((grown - 1) / (1 - p), z * grown)
    return left * (z if p == 1 else min(z, (1 - _decay_within((p - 1) * z)[0]) / (p - 1)))


def _decay_within(x: Fraction) -> Interval:
    """Enclose ``e^-x``, ``x >= 0``."""
    return exp(-rounded(x, BITS, up=True), BITS)[0], exp(-rounded(x, BITS), BITS)[1]


def sampled_above(gain: PrescribedGain, limits: Limits, rate: Fraction, growth: Fraction) -> Fraction:
    """Bound ``V`` at the end over ``V(0)`` if gain and input are held over periods.

    With ``F L + L'F >= rate F`` and ``L'F L <= growth F`` a period ``X - eta L X``, ``eta`` being its length times its
    gain, leaves ``V (1 - eta rate + eta^2 growth)`` at most. All but the last ``LAST_PERIODS`` periods leave
    ``V e^(-rate A + growth B)``, ``A`` and ``B`` the sums of ``eta`` and ``eta^2``: with ``h`` the period and ``g``
    the gain that acts, ``A >= int g dt - h (g - g(0))`` and ``B <= h int g^2 dt``, since the gain never falls.

    Raises
    ------
    ValueError
        There is no period.
    OverflowError
        The bound is too large to be formed.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))  # two periods: eta = 1, 3/2
    >>> sampled_above(gain, Limits(sample_period=Fraction(1, 2)), Fraction(1), Fraction(1))
    Fraction(7, 4)
    """
    count, end, h = limits.periods(gain), limits.end(gain), limits.sample_period or Fraction(0)
    first, factor = max(count - LAST_PERIODS, 0), Fraction(1)
    bits = length((gain.T, gain.rho1, gain.k, h, end, rate, growth, limits.gain_cap or h))
    spend(300 * (count - first), bits, bits, "held gains")
    if first:
        clock, square = Limits(limits.gain_cap, gain.T - h * first).integrals(gain)
        lost = h * (limits.gain_at(gain, h * first) - limits.gain_at(gain, Fraction(0)))
        factor = decay_above(rate * max(clock - lost, Fraction(0)) - growth * h * square)
    for j in range(first, count):
        eta = limits.gain_at(gain, h * j) * min(h, end - h * j)
        factor = rounded(factor * max(1 - eta * rate + eta**2 * growth, Fraction(0)), BITS, up=True)
    return factor


@dataclass(frozen=True)
class InitialSet:
    """A set of initial states: a point, a box, or an ellipsoid.

    Attributes
    ----------
    center : N numbers
        In units of the states, like all others.
    radius : N numbers
        ``|x_k - center_k| <= radius_k``; empty for a point or an ellipsoid.
    axes : vectors of N numbers
        ``center + sum_j v_j axes_j`` with ``||v||_2 <= 1``; empty for a point or a box.

    Examples
    --------
    >>> box = InitialSet([Fraction(1), Fraction(0)], [Fraction(1), Fraction(2)])
    >>> box.largest({0: Fraction(1), 1: Fraction(-1)})  # |x_1 - x_2| over 0..2 and -2..2
    Fraction(4, 1)
    """

    center: Sequence[Fraction]
    radius: Sequence[Fraction] = ()
    axes: Sequence[Sequence[Fraction]] = ()

    @property
    def point(self) -> bool:
        """Whether there is one initial state only."""
        return not any(self.radius) and not self.axes

    def largest(self, row: Linear) -> Fraction:
        """Bound the size of a linear function over the set.

        Parameters
        ----------
        row : mapping of int to Fraction
            The coefficients ``a_j`` of ``sum_j a_j x_j`` that are not 0.

        Returns
        -------
        Fraction
            Exact for a point or a box, rounded up for an ellipsoid.
        """
        size = abs(_dot(row, self.center))
        if self.radius:
            size += sum((abs(x) * self.radius[j] for j, x in row.items()), Fraction(0))
        elif self.axes:
            size += root_above(sum((_dot(row, axis) ** 2 for axis in self.axes), Fraction(0)))
        return size


@dataclass(frozen=True)
class Reaching:
    """How sliding variables move until they are 0, with ``s_k`` the sign of ``sigma_k(0)``.

        sigma_k' = -(mu2 + power/(T_r - t)) sigma_k - s_k f_k,      0 <= f_k <= push
        |sigma_k| <= psi |sigma_k(0)|,      psi = e^(-mu2 t) ((T_r - t)/T_r)^power

    Attributes
    ----------
    sigma0 : list of Fraction
        ``sigma(0)``, not all 0.
    T_r, T_s, mu2 : Fraction
    power, push : Fraction
        ``mu3 kappa`` and ``mu1 + delta``.
    z : Fraction or None
        The last proved reaching time, ``ln(T_r/(T_r - t))``; None: ``T_r``.
    """

    sigma0: Sequence[Fraction]
    T_r: Fraction
    T_s: Fraction
    mu2: Fraction
    power: Fraction
    push: Fraction
    z: Fraction | None = None

    @cached_property
    def quiet(self) -> Fraction:
        """``z = ln(T/(T - t))``, ``T = T_r + T_s``, from above, of an instant from which on all are 0."""
        remaining = self.T_s + (0 if self.z is None else self.T_r * exp(-self.z, BITS)[0])
        return log((self.T_r + self.T_s) / remaining, BITS)[1]

    def decay(self, remaining: Interval) -> Interval:
        """Enclose ``psi`` where ``1 - t/T`` is within an interval."""
        low, high = (((self.T_r + self.T_s) * q - self.T_s) / self.T_r for q in remaining)
        return self._psi(low, 0), self._psi(high, 1)

    def _psi(self, share: Fraction, end: int) -> Fraction:
        """Bound ``psi`` where ``(T_r - t)/T_r = share`` by the lower or the upper end of an enclosure."""
        share = min(share, Fraction(1))
        if share <= 0:
            return Fraction(0)
        return exp(self.power * log(share, BITS)[end] - self.mu2 * self.T_r * (1 - share), BITS)[end]

    def pushes(self, row: Linear) -> tuple[Fraction, Fraction]:
        """Bound ``|sum_k a_k s_k c_k|`` where ``0 <= c_k <= |sigma_k(0)|``, and where ``0 <= c_k <= push``."""
        by_size = [a * self.sigma0[k] for k, a in row.items() if self.sigma0[k]]
        by_sign = [a if self.sigma0[k] > 0 else -a for k, a in row.items() if self.sigma0[k]]
        return _one_sided(by_size), _one_sided(by_sign) * self.push


class Stretch(NamedTuple):
    """A stretch of the time while sliding variables move.

    The gain at its two ends, from above; how far the clock goes; ``int gain^2 dt`` and the length, from above; ``psi``
    at its begin, from above, and at its end, from below.
    """

    first: Fraction
    last: Fraction
    clock: Interval
    square: Fraction
    length: Fraction
    psi: Interval


def stretches(gain: PrescribedGain, reaching: Reaching, z: Fraction, count: int) -> list[Stretch]:
    """Cut the time up to ``z = ln(T/(T - t))`` into stretches of equal length in ``z``.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(2), Fraction(1), Fraction(1))
    >>> one = Fraction(1)
    >>> reaching = Reaching([one], one, one, one, one, one)
    >>> len(stretches(gain, reaching, reaching.quiet, 3))
    3
    """
    bits = length((gain.T, gain.rho1, gain.k, z, reaching.T_r, reaching.mu2))
    spend(300 * count, bits, bits, "bounds while sliding variables move")
    shares = ((z * j / count, exp(-z * j / count, BITS)) for j in range(count + 1))  # z and 1 - t/T
    instants, result = [(x, q, reaching.decay(q)) for x, q in shares], []
    for (a, (low, high), before), (b, (end, nearest), after) in pairwise(instants):
        passed = max(gain.clock(b, nearest) - gain.clock(a, low), Fraction(0)), gain.clock(b, end) - gain.clock(a, high)
        square, span = gain.square(b, end) - gain.square(a, high), gain.T * (high - end)
        result.append(Stretch(gain.value(low), gain.value(end), passed, square, span, (after[0], before[1])))
    return result


class Piece(NamedTuple):
    """A piece of the time while sliding variables move, all from above.

    ``sqrt(V)`` at its begin, what the piece adds to it, the gain at its two ends, how far the clock goes, and
    ``int gain^2 dt``.
    """

    root: Fraction
    added: Fraction
    first: Fraction
    last: Fraction
    clock: Fraction
    square: Fraction


@dataclass(frozen=True)
class InputBounds:
    """Bounds of the input over a set of initial states.

    Attributes
    ----------
    rows : list of dict of int to Fraction
        Of ``L``.
    gain : PrescribedGain
        Under the sliding-mode protocol with ``T = T_r + T_s``.
    forms : list of Form or None
    constants : list of (list of Fraction or None)
        ``c_k`` of full matrices, ``e_k^2 <= c_k V``; those of diagonal ones follow.
    initial_set : InitialSet
        Of ``X(0)``.
    reaching : Reaching or None
        None if no sliding variable moves.

    Notes
    -----
    While sliding variables move, ``dx = -gain L x dt + d sigma``: ``E' = -gain L E - L sigma'``.
    """

    rows: Sequence[Linear]
    gain: PrescribedGain
    forms: Sequence[Form | None]
    constants: Sequence[Sequence[Fraction] | None]
    initial_set: InitialSet
    reaching: Reaching | None = None
    _cache: dict[Any, Any] = field(default_factory=dict)

    def form(self, k: int) -> Form:
        """Return the Lyapunov function ``k``.

        Raises
        ------
        ValueError
            There is none, it is one of a large graph, or it does not decay.
        """
        if type(k) is not int or not 0 <= k < len(self.forms):
            raise ValueError("there is no such Lyapunov function")
        form = self.forms[k]
        if form is None or form.rate <= 0:
            raise ValueError("a Lyapunov function that says nothing of single agents")
        return form

    @property
    def quiet(self) -> Fraction:
        """``z`` from which on the sliding variables are 0; 0 if they always are."""
        return Fraction(0) if self.reaching is None else self.reaching.quiet

    @cached_property
    def error_bounds(self) -> list[Fraction]:
        """What no ``|e_k|`` ever exceeds: ``e^(-L s)`` expands neither ``max |x_k|`` nor ``max |e_k|``."""
        largest = max(map(self.initial_set.largest, self.rows))
        states = max(self.initial_set.largest({v: Fraction(1)}) for v in range(len(self.rows)))
        if self.reaching is not None:
            pushes, T_r = self._pushes, self.reaching.T_r
            largest += max(a for a, _ in pushes) + T_r * max(b for _, b in pushes)
            states += max(map(abs, self.reaching.sigma0)) + T_r * self.reaching.push
        return [min(largest, 2 * row.get(v, Fraction(0)) * states) for v, row in enumerate(self.rows)]

    @cached_property
    def _pushes(self) -> list[tuple[Fraction, Fraction]]:
        """What sliding variables and their drift do to every ``e_k``."""
        return [] if self.reaching is None else [self.reaching.pushes(row) for row in self.rows]

    @cached_property
    def error_norm(self) -> Fraction:
        """What ``||E||`` never exceeds."""
        return root_above(sum((x * x for x in self.error_bounds), Fraction(0)))

    def initial_root(self, k: int) -> Fraction:
        """Bound ``sqrt(V(0))`` of the set; ``sqrt(V) <= e^(-rate s / 2) v`` while no sliding variable moves."""
        if k not in self._cache:
            self._cache[k] = rounded(self._largest_root(self.form(k)), BITS, up=True)
        return self._cache[k]

    def _coordinates(self, form: Form) -> list[Linear]:
        """Return the rows of the coordinates of a form: of ``L``, or of ``X - (p'G X / p'1) G 1``."""
        if form.coordinates == "E":
            return [self.rows[v] for v in form.nodes]
        own = list(zip(form.nodes, form.gauge, form.diagonal or (), strict=True))
        total = sum(w for _, _, w in own)
        return [{j: (v == j) - g * h * w / total for j, h, w in own} for v, g, _ in own]

    def _largest_root(self, form: Form) -> Fraction:
        """Bound ``sqrt(z'P z)`` over the initial states, ``z = A X(0)`` the coordinates of a form; it is a norm.

        The lesser of two bounds: from the largest ``|z_i|``, and from the center and ``M = A'P A``, with
        ``sum_jl |M_jl| radius_j radius_l`` for a box and ``sum_j axes_j'M axes_j`` for an ellipsoid.
        """
        rows, initial_set = self._coordinates(form), self.initial_set
        P, _ = form.entries
        vectors = [initial_set.center, initial_set.radius, *initial_set.axes]
        bits = length(chain.from_iterable(row.values() for row in rows)) + length(chain.from_iterable(vectors))
        entry_bits = bits + longest(chain.from_iterable(P))
        spend(5 * len(vectors) * (sum(map(len, rows)) + len(P) ** 2), bits, entry_bits, "initial states")

        def value(x: Sequence[Fraction]) -> Fraction:
            return form.value([_dot(row, x) for row in rows])

        middle = root_above(value(initial_set.center))
        if initial_set.point:
            return middle
        excess = (
            _spread(form, rows, initial_set.radius)
            if initial_set.radius
            else sum(map(value, initial_set.axes), Fraction(0))
        )
        entries = root_above(form.value([initial_set.largest(row) for row in rows], sizes=True))
        return min(entries, middle + root_above(excess))

    def pieces(self, k: int, z: Fraction) -> tuple[list[Piece], Fraction, Fraction]:
        """Bound ``sqrt(V)`` in pieces of the time up to ``z``, while sliding variables move.

        Returned besides are what ``gain sqrt(V)`` is at most up to ``z``, if ``gain e^(-rate s / 2)`` never grows; and
        what, times ``e^(-rate s / 2)``, is at least ``sqrt(V)`` from ``z`` on.

        In a piece from ``a`` to ``b`` of the time ``sqrt(V)`` gains at most ``w (psi(a) - psi(b)) + f (b - a)``, ``w``
        and ``f`` being the norms of what bounds ``L sigma``, ``|sigma_k| <= |sigma_k(0)|``, and ``L f``.
        """
        if (k, z) in self._cache:
            return self._cache[k, z]
        assert self.reaching is not None
        gain = self.gain
        form, v = self.form(k), self.initial_root(k)
        pieces = list[Piece]()
        of_errors = form.coordinates == "E"
        pushes = (
            [self._pushes[v] for v in form.nodes] if of_errors else map(self.reaching.pushes, self._coordinates(form))
        )
        w, f = (root_above(form.value(push, sizes=True)) for push in zip(*pushes, strict=True))
        if ("stretches", z) not in self._cache:
            self._cache["stretches", z] = stretches(gain, self.reaching, z, PIECES)
        for stretch in self._cache["stretches", z]:
            added = w * (stretch.psi[1] - stretch.psi[0]) + f * stretch.length
            above = (v, added, stretch.first, stretch.last, stretch.clock[1], stretch.square)
            pieces.append(Piece(*(rounded(x, BITS, up=True) for x in above)))
            v = rounded(v * decay_above(form.rate / 2 * stretch.clock[0]) + added, BITS, up=True)
        nearest = exp(-z, BITS)[0]
        begin = rounded(v * exp(form.rate / 2 * gain.clock(z, nearest), BITS)[1], BITS, up=True)
        self._cache[k, z] = pieces, max(p.first * p.root + p.last * p.added for p in pieces), begin
        return self._cache[k, z]

    def share(self, k: int, limits: Limits, clock: Fraction, growth: Fraction) -> Fraction:
        """Bound ``sqrt(V)`` at the deadline over ``sqrt(V(0))`` under limits of the gain that leave this clock."""
        if limits.sample_period is None:
            return decay_above(self.form(k).rate / 2 * clock)
        return root_above(sampled_above(self.gain, limits, self.form(k).rate, growth))

    def constant(self, k: int) -> Sequence[Fraction]:
        """Return ``c_v`` with ``e_v^2 <= c_v V`` for every agent.

        Raises
        ------
        ValueError
            Those of a full matrix are not known.
        """
        form, constants = self.form(k), self.constants[k]
        if constants is not None:
            return constants
        if (k, "constants") not in self._cache:
            self._cache[k, "constants"] = form.error_constants(len(self.rows), self.rows.__getitem__)
        if self._cache[k, "constants"] is None:
            raise ValueError("a full matrix without constants")
        return self._cache[k, "constants"]

    def root_constant(self, k: int, v: int | None) -> Fraction:
        """Return ``c`` with ``|e_v| <= c sqrt(V)``, or ``||E|| <= c sqrt(V)`` without an agent."""
        if (k, v, "root") not in self._cache:
            form = self.form(k)
            whole = 1 / form.lowest if v is None and form.coordinates == "E" else None
            square = self.constant(k)[v] if v is not None else whole or sum(self.constant(k), Fraction(0))
            self._cache[k, v, "root"] = root_above(square)
        return self._cache[k, v, "root"]

    def bound(self, of: Of, v: int | None, k: int, z: Fraction) -> Fraction:
        """Bound the peak, the energy or the length ``of`` an agent's ``gain e_v``, or of ``gain ||E||``.

        Raises
        ------
        ValueError
            Sliding variables still move at ``z``, or ``z`` is beyond 100,000, or the bound is infinite.
        """
        if not self.quiet <= z <= LARGEST_EXPONENT:
            raise ValueError("an instant at which sliding variables still move, or one too late")
        bits = length((self.gain.T, self.gain.rho1, self.gain.k, self.form(k).rate, z))
        spend(50, bits, bits, "bounds of the input")
        error_bound = self.error_norm if v is None else self.error_bounds[v]
        c, rate = self.root_constant(k, v), self.form(k).rate
        if self.reaching is None:
            return of(self.gain, error_bound, c * self.initial_root(k), rate, z)
        pieces, most, begin = self.pieces(k, z)
        late = of(self.gain, Fraction(0), c * begin, rate, z)
        if of is peak_above:
            return rounded(max(late, min(c * most, error_bound * pieces[-1].last)), BITS, up=True)
        for p in pieces:
            size = min(c * (p.root + p.added), error_bound)
            late += p.square * size**2 if of is energy_above else p.clock * size
        return rounded(late, BITS, up=True)

    def largest_form(self, W: Rows) -> Fraction:
        """Bound ``E(0)'W E(0)`` over the initial states, ``E`` on the nodes that listen, in order."""
        nodes, one = [v for v, row in enumerate(self.rows) if row], Fraction(1)
        return self._largest_root(Form(one, "E", nodes, None, W, one)) ** 2

    def disturbed(self, k: int, delta: Fraction) -> list[Fraction]:
        """Bound what disturbances ``|d_k| <= delta`` add to the inputs of the nominal protocol.

        ``dE/ds = -L E - L d / gain``, and ``int_0^t ((T - t)/(T - r))^q dr <= (T - t)/(q - 1)``, ``q = rate k / 2``.

        Raises
        ------
        ValueError
            ``rate k <= 2``, or deviations.
        """
        form = self.form(k)
        q = form.rate * self.gain.k / 2
        if q <= 1 or form.coordinates != "E":
            raise ValueError("the input may grow without limit")
        pushed = root_above(form.value([2 * self.rows[v].get(v, Fraction(0)) for v in form.nodes], sizes=True))
        each = pushed * delta * (self.gain.rho1 * self.gain.T + self.gain.k) / (q - 1)
        return [root_above(c) * each for c in self.constant(k)]

    def noisy(self, k: int, noise: Fraction) -> tuple[Fraction, list[Fraction]]:
        """Bound what measurement noise ``|n_k| <= noise`` adds to ``||E||`` and to every ``|e_k - (L n)_k|``.

        ``dE/ds = -L E + L^2 n``, so that ``sqrt(V)`` of what noise adds stays below ``2 w noise / rate``, ``w``
        being the root of ``sum_ij |P_ij| q_i q_j``, ``q = |L^2| 1``.

        Raises
        ------
        ValueError
            Deviations.
        """
        form = self.form(k)
        if form.coordinates != "E":
            raise ValueError("deviations say nothing of noise")
        bits, twice = 3 * length(x for row in self.rows for x in row.values()), []
        spend(5 * sum(len(self.rows[j]) for row in self.rows for j in row), bits, bits, "L^2")
        for v in form.nodes:
            square = dict[int, Fraction]()
            for j, x in self.rows[v].items():
                for i, y in self.rows[j].items():
                    square[i] = square.get(i, Fraction(0)) + x * y
            twice.append(sum(map(abs, square.values()), Fraction(0)))
        added = root_above(form.value(twice, sizes=True)) * noise * 2 / form.rate
        own = (2 * row.get(v, Fraction(0)) * noise for v, row in enumerate(self.rows))
        each = [root_above(c) * added + x for c, x in zip(self.constant(k), own, strict=True)]
        return self.root_constant(k, None) * added, each


def _dot(row: Linear, x: Sequence[Fraction]) -> Fraction:
    """Return ``sum_j a_j x_j``."""
    return sum((a * x[j] for j, a in row.items()), Fraction(0))


def _one_sided(values: Sequence[Fraction]) -> Fraction:
    """Return the larger of the sums of the positive and of the negative numbers, in size."""
    return (sum(map(abs, values), Fraction(0)) + abs(sum(values, Fraction(0)))) / 2


def _spread(form: Form, rows: Sequence[Linear], radius: Sequence[Fraction]) -> Fraction:
    """Return ``sum_jl |M_jl| radius_j radius_l``, ``M = A'P A``; in integers."""
    (whole, unit), ((R,), scale) = integers([list(row.values()) for row in rows]), integers([radius])
    P, common = form.entries
    A = [dict(zip(row, own, strict=True)) for row, own in zip(rows, whole, strict=True)]
    M = congruence(Arithmetic(), P, A, len(R))
    total = sum(r * sum(abs(m) * q for m, q in zip(row, R, strict=True)) for r, row in zip(R, M, strict=True))
    return Fraction(total, common * unit**2 * scale**2)
