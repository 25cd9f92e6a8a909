"""Proved bounds of the input of the nominal protocol, ``u = gain(t) E``, with the standard library alone.

With ``k = rho2 kappa`` and ``z = ln(T/(T - t))`` the gain is ``rho1 + (k/T) e^z`` and the stretched clock
``s = rho1 T (1 - e^-z) + k z``. What is known of an agent is ``|e_k| <= min(held, start e^(-rate s / 2))``: ``held``
for all times, ``start`` from a Lyapunov function of that rate. The bounds below use ``held`` up to an instant ``z`` and
``start`` from there on; every ``z`` gives a valid one. The energy follows besides from two Lyapunov equations. All
arguments are rationals, every rounding is upwards (or downwards where a name says ``below``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

from lmi.exact.elementary_enclosures import LARGEST_EXPONENT, exp, log, rounded, sqrt
from lmi.exact.work import spend

#: Bits to which bounds are rounded.
BITS = 64
#: Pieces, of equal length in ``z``, into which the time is cut while sliding variables move.
PIECES = 16
#: Periods before the end that are multiplied one by one.
LAST_PERIODS = 2000

Linear = Mapping[int, Fraction]
Rows = Sequence[Sequence[Fraction]]
Interval = tuple[Fraction, Fraction]
Of = Callable[["PrescribedGain", Fraction, Fraction, Fraction, Fraction], Fraction]


def root_above(x: Fraction) -> Fraction:
    """Bound a square root from above.

    Examples
    --------
    >>> float(root_above(Fraction(9, 4)))
    1.5
    """
    return rounded(sqrt(rounded(x, BITS, up=True), BITS)[1], BITS, up=True)


def decay_above(x: Fraction) -> Fraction:
    """Bound ``e^-x`` from above for ``x >= 0``; beyond ``x = 100,000`` it is no longer made smaller.

    Examples
    --------
    >>> float(decay_above(Fraction(1)))
    0.36787944117144233
    """
    return exp(-min(rounded(x, BITS), Fraction(LARGEST_EXPONENT)), BITS)[1]


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
    >>> float(gain.above(Fraction(0))), float(gain.clock_below(Fraction(1)))
    (3.0, 2.6321205588285577)
    """

    T: Fraction
    rho1: Fraction
    k: Fraction

    def above(self, z: Fraction) -> Fraction:
        """Bound the gain at ``z`` from above."""
        return rounded(self.rho1 + self.k / self.T * exp(z, BITS)[1], BITS, up=True)

    def clock_below(self, z: Fraction) -> Fraction:
        """Bound the clock ``s`` at ``z`` from below."""
        return rounded(self.rho1 * self.T * (1 - exp(-z, BITS)[1]) + self.k * z, BITS)

    def clock_above(self, z: Fraction) -> Fraction:
        """Bound the clock ``s`` at ``z`` from above."""
        return rounded(self.rho1 * self.T * (1 - exp(-z, BITS)[0]) + self.k * z, BITS, up=True)


def peak_above(gain: PrescribedGain, held: Fraction, start: Fraction, rate: Fraction, z: Fraction) -> Fraction:
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
    top = gain.above(z)
    late = start * decay_above(rate / 2 * gain.clock_below(z)) * top
    return rounded(late if z == 0 else max(held * top, late), BITS, up=True)


def energy_above(gain: PrescribedGain, held: Fraction, start: Fraction, rate: Fraction, z: Fraction) -> Fraction:
    """Bound ``int_0^T (gain |e|)^2 dt`` for ``rate k > 1``.

    Up to ``z`` it is ``held^2 (rho1^2 t + 2 rho1 k z + (k^2/T)(e^z - 1))``, and from there on, integrated by parts,
    ``start^2 e^(-rate s) (gain + (k/T) e^z / (rate k - 1)) / rate`` at most.

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
    rho1, k, T = gain.rho1, gain.k, gain.T
    if rate * k <= 1:
        raise ValueError("the energy is not bounded by this rate")
    grown = exp(z, BITS)[1]
    early = held**2 * (rho1**2 * T * (1 - exp(-z, BITS)[0]) + 2 * rho1 * k * z + k**2 / T * (grown - 1))
    left = decay_above(rate * gain.clock_below(z))
    late = start**2 * left * (gain.above(z) + k / T * grown / (rate * k - 1)) / rate
    return rounded((early if z else 0) + late, BITS, up=True)


def length_above(gain: PrescribedGain, held: Fraction, start: Fraction, rate: Fraction, z: Fraction) -> Fraction:
    """Bound ``int_0^T gain |e| dt = int |e| ds`` by ``held s(z) + (2/rate) start e^(-rate s(z) / 2)``.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))
    >>> float(length_above(gain, Fraction(1), Fraction(3), Fraction(2), Fraction(0)))
    3.0
    """
    late = 2 / rate * start * decay_above(rate / 2 * gain.clock_below(z))
    return rounded((held * gain.clock_above(z) if z else 0) + late, BITS, up=True)


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

    def largest_gain(self, gain: PrescribedGain) -> Fraction | None:
        """Return the largest value of ``gain`` that acts; None if it grows without limit."""
        latest = self.stop_before
        if self.sample_period is not None:
            end = gain.T - (latest or 0)
            periods = -(-end // self.sample_period)  # those that begin before the end
            latest = gain.T - self.sample_period * (periods - 1)
        ends = [self.gain_cap] if self.gain_cap is not None else []
        if latest is not None:
            ends.append(gain.rho1 + gain.k / latest)
        return min(ends, default=None)

    def top(self, gain: PrescribedGain) -> Fraction:
        """Return the largest gain that acts of ``gain``.

        Raises
        ------
        ValueError
            Nothing limits the gain.
        """
        top = self.largest_gain(gain)
        if top is None:
            raise ValueError("nothing limits the gain")
        return top

    def clock_below(self, gain: PrescribedGain) -> Fraction:
        """Bound the integral of the gain up to the deadline from below.

        With sampling it is a sum of values at the beginnings of periods, which lacks at most
        ``h (largest gain - gain(0))``, since the gain never falls.

        Raises
        ------
        ValueError
            Nothing limits the gain: the integral is infinite.
        """
        T, rho1, k, top = gain.T, gain.rho1, gain.k, self.top(gain)
        end, turn = T - (self.stop_before or 0), self._turn(gain, top)
        s = rho1 * turn + k * log(T / (T - turn), BITS)[0] + top * (end - turn)
        if self.sample_period is not None:
            s -= self.sample_period * max(top - rho1 - k / T, Fraction(0))
        return rounded(max(s, Fraction(0)), BITS)

    def square_above(self, gain: PrescribedGain) -> Fraction:
        """Bound the integral of the square of ``gain`` up to the deadline from above, without sampling.

        Raises
        ------
        ValueError
            Nothing limits the gain: the integral is infinite.
        """
        T, rho1, k, top = gain.T, gain.rho1, gain.k, self.top(gain)
        end, turn = T - (self.stop_before or 0), self._turn(gain, top)
        squares = rho1**2 * turn + 2 * rho1 * k * log(T / (T - turn), BITS)[1] + k**2 * (1 / (T - turn) - 1 / T)
        return rounded(squares + top**2 * (end - turn), BITS, up=True)

    def _turn(self, gain: PrescribedGain, top: Fraction) -> Fraction:
        """Return the instant from which on the gain is ``top``, the stop unless that comes first."""
        if top <= gain.rho1 + gain.k / gain.T:
            return Fraction(0)
        return min(gain.T - gain.k / (top - gain.rho1), gain.T - (self.stop_before or 0))


def sampled_above(gain: PrescribedGain, limits: Limits, rate: Fraction, growth: Fraction) -> Fraction:
    """Bound ``V`` at the end over ``V(0)`` if gain and input are held over periods.

    With ``F L + L'F >= rate F`` and ``L'F L <= growth F`` a period ``X - eta L X``, ``eta`` being its length times its
    gain, leaves ``V (1 - eta rate + eta^2 growth)`` at most. All but the last ``LAST_PERIODS`` periods leave
    ``V e^(-rate A + growth B)``, ``A`` and ``B`` the sums of ``eta`` and ``eta^2``: with ``h`` the period and ``g``
    the gain that acts, ``A >= int g dt - h (g - g(0))`` and ``B <= h int g^2 dt``, since the gain never falls.

    Raises
    ------
    ValueError
        There is no period, or the bound is too large to be formed.

    Examples
    --------
    >>> gain = PrescribedGain(Fraction(1), Fraction(1), Fraction(1))  # two periods: eta = 1, 3/2
    >>> sampled_above(gain, Limits(sample_period=Fraction(1, 2)), Fraction(1), Fraction(1))
    Fraction(7, 4)
    """
    h, g0 = limits.sample_period, gain.rho1 + gain.k / gain.T
    if h is None:
        raise ValueError("nothing is sampled")
    end = gain.T - (limits.stop_before or 0)
    count = -(-end // h)
    first = max(count - LAST_PERIODS, 0)
    factor, bits = Fraction(1), _bits((gain.T, gain.rho1, gain.k, h, end, rate, growth, limits.gain_cap or h))
    spend(300 * (count - first), bits, bits, "held gains")
    if first:
        early = Limits(limits.gain_cap, gain.T - h * first)
        lost = h * ((early.largest_gain(gain) or g0) - min(g0, limits.gain_cap or g0))
        power = rate * max(early.clock_below(gain) - lost, Fraction(0)) - growth * h * early.square_above(gain)
        if power < -LARGEST_EXPONENT:
            raise ValueError("a bound that is too large to be formed")
        factor = decay_above(power) if power >= 0 else exp(rounded(-power, BITS, up=True), BITS)[1]
    for j in range(first, count):
        g = gain.rho1 + gain.k / (gain.T - h * j)
        eta = min(g, limits.gain_cap or g) * min(h, end - h * j)
        factor = rounded(factor * max(1 - eta * rate + eta**2 * growth, Fraction(0)), BITS, up=True)
    return factor


@dataclass(frozen=True)
class Form:
    """A Lyapunov function ``z'P z`` that decays: ``V <= e^(-rate s) V(0)``.

    Attributes
    ----------
    rate : Fraction
    coordinates : {"E", "eps"}
        ``E = -L X`` on the nodes, or the weighted deviation ``eps = X - (p'G X / p'1) G 1``.
    nodes : list of int
    diagonal : list of Fraction or None
    matrix : list of list of Fraction or None
        ``P``, its diagonal if it is diagonal.
    lowest : Fraction
        Not above the smallest eigenvalue of ``P``.
    gauge : list of int
        Camps of the nodes, for the coordinates ``eps``.
    """

    rate: Fraction
    coordinates: str
    nodes: Sequence[int]
    diagonal: Sequence[Fraction] | None
    matrix: Sequence[Sequence[Fraction]] | None
    lowest: Fraction
    gauge: Sequence[int] = ()

    @cached_property
    def entries(self) -> tuple[list[list[tuple[int, int]]], int]:
        """The rows of ``P`` without zeros, pairs of place and entry, in integers over a scale; and the scale."""
        lines = [[w] for w in self.diagonal] if self.diagonal is not None else self.matrix or ()
        whole, scale = _whole([p for line in lines for p in line])
        left = iter(whole)
        first = range(len(lines)) if self.diagonal is not None else [0] * len(lines)
        return [
            [(j, p) for j, p in enumerate(islice(left, len(x)), i) if p] for i, x in zip(first, lines, strict=True)
        ], scale

    def value(self, z: Sequence[Fraction], sizes: bool = False) -> Fraction:
        """Return ``z'P z``, or ``z'|P| z`` with the sizes of the entries."""
        (rows, common), (Z, scale) = self.entries, _whole(z)
        total = sum(x * sum((abs(p) if sizes else p) * Z[j] for j, p in row) for x, row in zip(Z, rows, strict=True))
        return Fraction(total, common * scale**2)

    def largest_value(self, sizes: Sequence[Fraction]) -> Fraction:
        """Bound ``z'P z`` where ``|z_i| <= sizes_i``."""
        return self.value(sizes, sizes=True)


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
        left = self.T_s
        if self.z is not None and self.z <= LARGEST_EXPONENT:
            left += self.T_r * exp(-self.z, BITS)[0]
        return log((self.T_r + self.T_s) / left, BITS)[1]

    def decay(self, remaining: Interval) -> Interval:
        """Enclose ``psi`` where ``1 - t/T`` is within an interval."""
        low, high = (((self.T_r + self.T_s) * x - self.T_s) / self.T_r for x in remaining)  # (T_r - t)/T_r
        if high <= 0:
            return Fraction(0), Fraction(0)
        low, high = min(low, Fraction(1)), min(high, Fraction(1))
        above = decay_above(max(self.mu2 * self.T_r * (1 - high) - self.power * log(high, BITS)[1], Fraction(0)))
        if low <= 0:
            return Fraction(0), above
        push = rounded(self.mu2 * self.T_r * (1 - low) - self.power * log(low, BITS)[0], BITS, up=True)
        return (exp(-push, BITS)[0] if push <= LARGEST_EXPONENT else Fraction(0)), above

    def pushes(self, row: Linear) -> tuple[Fraction, Fraction]:
        """Bound ``|sum_k a_k s_k c_k|`` where ``0 <= c_k <= |sigma_k(0)|``, and where ``0 <= c_k <= push``."""
        moved = [(a * self.sigma0[k], a * self._sign(k)) for k, a in row.items() if self.sigma0[k]]
        one, other = (
            max(sum((x for x in own if x > 0), Fraction(0)), -sum((x for x in own if x < 0), Fraction(0)))
            for own in (zip(*moved, strict=True) if moved else ((), ()))
        )
        return one, other * self.push

    def _sign(self, k: int) -> int:
        return 1 if self.sigma0[k] > 0 else -1


class Piece(NamedTuple):
    """A piece of the time while sliding variables move, all from above but ``clock_below``.

    The gain at its two ends, how far the clock goes, how long it lasts, ``int gain^2 dt``, and by how much ``psi``
    falls.
    """

    first: Fraction
    last: Fraction
    clock_below: Fraction
    clock_above: Fraction
    time: Fraction
    square: Fraction
    drop: Fraction


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
    _kept: dict[Any, Any] = field(default_factory=dict)

    def form(self, k: int) -> Form:
        """Return the Lyapunov function ``k``.

        Raises
        ------
        ValueError
            It is one of a large graph, or does not decay.
        """
        form = self.forms[k]
        if form is None or form.rate <= 0:
            raise ValueError("a Lyapunov function that says nothing of single agents")
        return form

    @property
    def quiet(self) -> Fraction:
        """``z`` from which on the sliding variables are 0; 0 if they always are."""
        return Fraction(0) if self.reaching is None else self.reaching.quiet

    def _squared(self, sizes: Sequence[Fraction]) -> list[Fraction]:
        """Return ``|L^2| sizes``."""
        pushed = []
        bits = 2 * _bits(x for row in self.rows for x in row.values()) + _bits(sizes)
        spend(5 * sum(len(self.rows[j]) for row in self.rows for j in row), bits, bits, "L^2")
        for row in self.rows:
            square: dict[int, Fraction] = {}
            for j, x in row.items():
                for i, y in self.rows[j].items():
                    square[i] = square.get(i, Fraction(0)) + x * y
            pushed.append(sum((abs(x) * sizes[j] for j, x in square.items()), Fraction(0)))
        return pushed

    @cached_property
    def held(self) -> list[Fraction]:
        """What no ``|e_k|`` ever exceeds: ``e^(-L s)`` expands neither ``max |x_k|`` nor ``max |e_k|``."""
        largest = max(map(self.initial_set.largest, self.rows))
        states = max(self.initial_set.largest({v: Fraction(1)}) for v in range(len(self.rows)))
        if self.reaching is not None:
            moved = [self.reaching.pushes(row) for row in self.rows]
            largest += max(a for a, _ in moved) + self.reaching.T_r * max(b for _, b in moved)
            states += max(map(abs, self.reaching.sigma0)) + self.reaching.T_r * self.reaching.push
        heard = [2 * row.get(v, Fraction(0)) for v, row in enumerate(self.rows)]
        return [min(largest, h * states) for h in heard]

    @cached_property
    def first(self) -> Fraction:
        """A bound of ``||E(0)||``, exact but for rounding for a single initial state."""
        return root_above(sum((self.initial_set.largest(row) ** 2 for row in self.rows), Fraction(0)))

    @cached_property
    def held_norm(self) -> Fraction:
        """What ``||E||`` never exceeds."""
        return root_above(sum((x * x for x in self.held), Fraction(0)))

    def start(self, k: int) -> Fraction:
        """Bound ``sqrt(V(0))`` of the set; ``sqrt(V) <= e^(-rate s / 2) v`` while no sliding variable moves."""
        if ("start", k) not in self._kept:
            form = self.form(k)
            rows = self._coordinates(form)
            known = [self._center[v] for v in form.nodes] if form.coordinates == "E" else None
            self._kept["start", k] = rounded(_largest_root(form, rows, self.initial_set, known), BITS, up=True)
        return self._kept["start", k]

    @cached_property
    def _center(self) -> list[Fraction]:
        """``L`` times the center of the starts."""
        return [_dot(row, self.initial_set.center) for row in self.rows]

    def _coordinates(self, form: Form) -> list[Linear]:
        """Return the rows of the coordinates of a form."""
        return [self.rows[v] for v in form.nodes] if form.coordinates == "E" else list(_deviations(form))

    def _pieces(self, z: Fraction) -> list[Piece]:
        """Return what the pieces of the time up to ``z`` have in common."""
        if z not in self._kept:
            assert self.reaching is not None
            bits = _bits((self.gain.T, self.gain.rho1, self.gain.k, z, self.reaching.T_r, self.reaching.mu2))
            spend(300 * PIECES, bits, bits, "bounds of the input while sliding variables move")
            (T, rho1, k), up = (self.gain.T, self.gain.rho1, self.gain.k), True
            instants = [z * j / PIECES for j in range(PIECES + 1)]
            remaining = [exp(-x, BITS) for x in instants]  # 1 - t/T
            decay = [(Fraction(1), Fraction(1)), *(self.reaching.decay(x) for x in remaining[1:])]
            gains = [rounded(rho1 + k / T / low, BITS, up) for low, _ in remaining]
            pieces = []
            for j in range(PIECES):
                (low, high), (end, nearest) = remaining[j], remaining[j + 1]
                step, time = k * z / PIECES, rounded(T * (high - end), BITS, up)
                square = rho1**2 * time + 2 * rho1 * step + k**2 / T * (1 / end - 1 / high)
                clock = rounded(rho1 * T * max(low - nearest, Fraction(0)) + step, BITS)
                above, drop = rounded(rho1 * time + step, BITS, up), rounded(decay[j][1] - decay[j + 1][0], BITS, up)
                pieces.append(Piece(gains[j], gains[j + 1], clock, above, time, rounded(square, BITS, up), drop))
            self._kept[z] = pieces
        return self._kept[z]

    def _reached(self, k: int, z: Fraction) -> tuple[list[tuple[Fraction, Fraction]], Fraction]:
        """Bound ``sqrt(V)`` while sliding variables move: at the begin of each piece, and what it adds.

        From ``z`` on ``sqrt(V)`` is at most the last number times ``e^(-rate s / 2)``.

        In a piece from ``a`` to ``b`` of the time ``sqrt(V)`` gains at most ``w (psi(a) - psi(b)) + f (b - a)``, ``w``
        and ``f`` being the norms of what bounds ``L sigma``, ``|sigma_k| <= |sigma_k(0)|``, and ``L f``.
        """
        if (k, z) not in self._kept:
            assert self.reaching is not None
            form = self.form(k)
            pushes = zip(*map(self.reaching.pushes, self._coordinates(form)), strict=True)
            w, f = (root_above(form.largest_value(own)) for own in pushes)
            v, found = self.start(k), []
            for piece in self._pieces(z):
                added = rounded(w * piece.drop + f * piece.time, BITS, up=True)
                found.append((v, added))
                v = rounded(v * decay_above(form.rate / 2 * piece.clock_below) + added, BITS, up=True)
            begin = rounded(v * exp(form.rate / 2 * self.gain.clock_above(z), BITS)[1], BITS, up=True)
            self._kept[k, z] = found, begin
        return self._kept[k, z]

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
        form, known = self.form(k), self.constants[k]
        if known is not None:
            return known
        if form.diagonal is None:
            raise ValueError("a full matrix without constants")
        weight = dict(zip(form.nodes, form.diagonal, strict=True))
        if form.coordinates == "E":
            return [1 / weight[v] if v in weight else Fraction(0) for v in range(len(self.rows))]
        return [sum((x * x / weight[j] for j, x in row.items()), Fraction(0)) for row in self.rows]

    def root_constant(self, k: int, v: int | None) -> Fraction:
        """Return ``c`` with ``|e_v| <= c sqrt(V)``, or ``||E|| <= c sqrt(V)`` without an agent."""
        if v is not None:
            return root_above(self.constant(k)[v])
        form = self.form(k)
        return root_above(1 / form.lowest if form.coordinates == "E" else sum(self.constant(k), Fraction(0)))

    def bound(self, of: Of, v: int | None, k: int, z: Fraction) -> Fraction:
        """Bound the peak, the energy or the length ``of`` an agent's ``gain e_v``, or of ``gain ||E||``.

        Raises
        ------
        ValueError
            Sliding variables still move at ``z``, or ``z`` is beyond 100,000, or the bound is infinite.
        """
        if not self.quiet <= z <= LARGEST_EXPONENT:
            raise ValueError("an instant at which sliding variables still move, or one too late")
        bits = _bits((self.gain.T, self.gain.rho1, self.gain.k, self.form(k).rate, z))
        spend(50, bits, bits, "bounds of the input")
        held = self.held_norm if v is None else self.held[v]
        c, rate = self.root_constant(k, v), self.form(k).rate
        if self.reaching is None:
            return of(self.gain, held, c * self.start(k), rate, z)
        pieces, begin = self._reached(k, z)
        early, late = self._early(of, held, c, z, pieces), of(self.gain, Fraction(0), c * begin, rate, z)
        return rounded(max(early, late) if of is peak_above else early + late, BITS, up=True)

    def _early(
        self, of: Of, held: Fraction, c: Fraction, z: Fraction, reached: Sequence[tuple[Fraction, Fraction]]
    ) -> Fraction:
        """Bound the peak, the energy or the length up to ``z``, while sliding variables move."""
        pieces = self._pieces(z)
        if of is peak_above:  # gain e^(-rate s / 2) does not grow
            most = (p.first * v + p.last * added for p, (v, added) in zip(pieces, reached, strict=True))
            return min(c * max(most), held * pieces[-1].last)
        sizes = [min(c * (v + added), held) for v, added in reached]
        if of is energy_above:
            return sum((p.square * size**2 for p, size in zip(pieces, sizes, strict=True)), Fraction(0))
        return sum((p.clock_above * size for p, size in zip(pieces, sizes, strict=True)), Fraction(0))

    def largest_form(self, W: Rows) -> Fraction:
        """Bound ``E(0)'W E(0)`` over the starts, ``E`` on the nodes that listen, in order."""
        nodes, one = [v for v, row in enumerate(self.rows) if row], Fraction(1)
        form = Form(one, "E", nodes, None, W, one)
        known = [self._center[v] for v in nodes]
        return _largest_root(form, [self.rows[v] for v in nodes], self.initial_set, known) ** 2

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
        pushed = root_above(form.largest_value([2 * self.rows[v].get(v, Fraction(0)) for v in form.nodes]))
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
        every = [Fraction(1)] * len(self.rows)
        twice = self._squared(every)
        added = root_above(form.largest_value([twice[v] for v in form.nodes])) * noise * 2 / form.rate
        own = (2 * row.get(v, Fraction(0)) * noise for v, row in enumerate(self.rows))
        each = [root_above(c) * added + x for c, x in zip(self.constant(k), own, strict=True)]
        return self.root_constant(k, None) * added, each


def _bits(values: Iterable[Fraction]) -> int:
    """Return the bits of the longest numerator or denominator."""
    return max((max(x.numerator.bit_length(), x.denominator.bit_length()) for x in values), default=0)


def _whole(values: Sequence[Fraction]) -> tuple[list[int], int]:
    """Return rationals times their common denominator, and that."""
    scale = math.lcm(*{x.denominator for x in values})
    return [x.numerator * (scale // x.denominator) for x in values], scale


def _dot(row: Linear, x: Sequence[Fraction]) -> Fraction:
    """Return ``sum_j a_j x_j``."""
    return sum((a * x[j] for j, a in row.items()), Fraction(0))


def _count(form: Form, rows: Sequence[Linear], initial_set: InitialSet) -> None:
    """Count the work of :func:`_largest_root`."""
    n, matrix = len(rows), [*([form.diagonal] if form.diagonal is not None else form.matrix or ())]
    vectors = [initial_set.center, *([initial_set.radius] if initial_set.radius else []), *initial_set.axes]
    bits = _bits(x for row in rows for x in row.values()) + _bits(x for vector in vectors for x in vector)
    entries = sum(map(len, rows))
    spend(
        5 * len(vectors) * (entries + n * len(matrix)), bits, bits + _bits(x for row in matrix for x in row), "starts"
    )
    if initial_set.radius:
        spend((entries + n * len(matrix)) * len(initial_set.center), bits, bits, "starts")


def _largest_root(
    form: Form, rows: Sequence[Linear], initial_set: InitialSet, center: Sequence[Fraction] | None = None
) -> Fraction:
    """Bound ``sqrt(z'P z)`` over the starts, ``z = A X(0)`` with the rows of ``A``; ``sqrt(V)`` is a norm.

    The lesser of two bounds: from the largest ``|z_i|``, and from the center and ``M = A'P A``, with
    ``sum_jl |M_jl| radius_j radius_l`` for a box and ``sum_j axes_j'M axes_j`` for an ellipsoid. ``center`` is ``z`` of
    the center, where it is known.
    """
    _count(form, rows, initial_set)
    middle = root_above(form.value([_dot(row, initial_set.center) for row in rows] if center is None else center))
    if initial_set.point:
        return middle
    if initial_set.axes:
        spread = sum((form.value([_dot(row, axis) for row in rows]) for axis in initial_set.axes), Fraction(0))
    else:
        spread = _spread(form, rows, initial_set.radius)
    entries = root_above(form.largest_value([initial_set.largest(row) for row in rows]))
    return min(entries, middle + root_above(spread))


def _spread(form: Form, rows: Sequence[Linear], radius: Sequence[Fraction]) -> Fraction:
    """Return ``sum_jl |M_jl| radius_j radius_l``, ``M = A'P A``; in integers."""
    (whole, unit), (R, scale) = _whole([x for row in rows for x in row.values()]), _whole(radius)
    left, (lines, common) = iter(whole), form.entries
    A = [dict(zip(row, left, strict=False)) for row in rows]
    M = [[0] * len(R) for _ in R]
    for own, line in zip(A, lines, strict=True):
        moved = [0] * len(R)  # a row of P A
        for place, w in line:
            for j, a in A[place].items():
                moved[j] += w * a
        for j, a in own.items():
            M[j] = [m + a * x for m, x in zip(M[j], moved, strict=True)]
    total = sum(r * sum(abs(m) * q for m, q in zip(row, R, strict=True)) for r, row in zip(R, M, strict=True))
    return Fraction(total, common * unit**2 * scale**2)


def _deviations(form: Form) -> list[dict[int, Fraction]]:
    """Return the rows of ``X - (p'G X / p'1) G 1``."""
    p = form.diagonal or ()
    total, rows = sum(p), []
    for v, g in zip(form.nodes, form.gauge, strict=True):
        row = {w: -g * h * x / total for w, h, x in zip(form.nodes, form.gauge, p, strict=True)}
        row[v] += 1
        rows.append(row)
    return rows
