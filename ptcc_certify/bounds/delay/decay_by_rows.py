"""What is left of followers of single leaders, while messages are late or leaders move, by one positive vector.

With ``D_k u_k - q sum_l |w_kl| u_l >= b u_k``, ``cap <= ln q / (b age)`` and ``s_c`` the integral of ``min(gain, cap)``

    |x_k(t) - x_k*| <= u_k (initial e^(-b s_c(t)) + floor)

for every gain that acts and all delays up to ``age``; ``initial`` is the largest ``|x_k(0) - x_k*| / u_k``, and
``floor`` what errors of values add. Where leaders move, the target ``x_k*(t)`` does, too, and what is heard of it is
off by ``speed age`` more; and there is added, inside the bracket,

    (speed + disturbance) / min u  int_0^t e^(-b (s_c(t) - s_c(r))) dr.

Where nothing is late and the gain has no cap this is 0 at ``T``, and with ``p = b rho2 kappa`` before it

    (speed + disturbance) / min u  (T - t) (1 - ((T - t)/T)^(p - 1)) / (p - 1).

A sign term takes it up: followers that are on their targets at ``T`` stay there.

Where inputs are clipped to ``U``, ``|x_k - x_k*| <= u_k y`` with ``y' = -min(b gain y, U/max u)``: a row of the maximum
moves towards its target by its input, or by ``U`` if that is clipped. So ``y`` falls evenly first; and once ``b gain
y`` is at most ``U/max u`` it decays as above, for ``b rho2 kappa >= 1``. ``initial e^(-b s)`` bounds it at all times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.errors import LMIError, NoCertificate
from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import exp, log, rounded
from ptcc_certify.bounds.delay.case import LARGEST_EXPONENT, LateCase, Moments
from ptcc_certify.checker.input_formulas import BITS, Limits, PrescribedGain, drift_above
from ptcc_certify.lyapunov.follower_rows import FollowerRows, RowWitness
from ptcc_certify.model.gain import Gain

#: Up to so many followers many ``q`` are tried; beyond, the best of those that one vector proves.
SEARCHED_FOLLOWERS = 3000
#: Values of ``q`` that are tried, and the largest one; losses of ``b`` for a more even vector.
_TRIED, _LARGEST_Q, _LOSSES = 10, 1e9, (0.01, 0.2, 0.6)
#: The same where inputs are clipped: an even vector is what matters, as long as ``b rho2 kappa >= 1``.
LOSSES_CLIPPED = (0.01, 0.2, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96, 0.98, 0.99, 0.995, 0.999)
#: The share of the speed that inputs allow at which bounds fall, and halvings by which is found until when.
_SLOWER, _HALVINGS = 1 - Fraction(1, 2**20), 100
#: Slower rates that are tried where ``e^(b s)`` is beyond floats.
_SLOWED = 20
#: The share of the time that is left where bounds of followers of moving leaders are compared.
_JUDGED = 0.05
#: What is added to a bound in floats, relatively and absolutely, so that it holds.
MORE, LEAST = 1 + 1e-9, 1e-300


@dataclass(frozen=True, eq=False)
class RowBound:
    """A bound by rows: ``|x_k(t) - x_k*| <= u_k (initial e^(-b s_c(t)) + floor)``, at ``T`` with ``left`` in its place.

    Attributes
    ----------
    witness : RowWitness
        ``q``, ``b`` and ``u``.
    cap : Fraction or None
        Of the clock ``s_c``; None where nothing is late.
    clock : Fraction or None
        ``s_c(T)`` from below; None where it is infinite.
    left, initial, floor : Fraction
        From above.
    drift, after : Fraction or None
        What leaders that move, and disturbances, add to ``floor`` at ``T``, and at all times; None where leaders rest.
    start, turn, level : Fraction or None
        Where inputs are clipped: the largest ``|x_k(0) - x_k*| / u_k``, and until when that falls evenly, to what.
    """

    witness: RowWitness
    cap: Fraction | None
    clock: Fraction | None
    left: Fraction
    initial: Fraction
    floor: Fraction
    drift: Fraction | None = None
    after: Fraction | None = None
    start: Fraction | None = None
    turn: Fraction | None = None
    level: Fraction | None = None

    def stays(self, case: LateCase) -> bool:
        """Whether growth is slower than the decay after ``T``, so that what is left then is never exceeded."""
        return case.exact.lasting(case.growth, self.witness.b) is not None

    def residual(self, after: bool = False) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` at ``T``, or from there on, for every follower, in floats from above."""
        most = self.initial * self.left + self.floor + ((self.after if after else self.drift) or 0)
        return self.witness.u * float(most) * MORE + (LEAST if most else 0)

    def decay(self, case: LateCase, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ``e^(-b s_c)``, and what leaders that move and disturbances add in the bracket, (M,) floats each.

        After ``T`` the gain is low again: from what they added by then they add ever more, at most ``after``.
        """
        push = float(case.push) / float(self.witness.u.min())
        return driven(case, self.witness.b, push, self.cap, float(self.after or 0), t, case.growth)

    def deviation_bound(self, case: LateCase, t: np.ndarray) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` of followers at instants, ``(F, M)`` floats."""
        return self.over_time(case, t).bound[case.followers]

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return the same of all agents, 0 of others than followers."""
        (y, added), u = self.decay(case, t), np.zeros((len(case.of.labels), 1))
        u[case.followers, 0] = self.witness.u
        floor = lasting(case, self.witness.b, u * float(self.floor), t, case.growth)
        falls = float(self.initial) * y + added
        if self.turn and self.start is not None and self.level is not None:
            line = float(self.start) - float(self.start - self.level) * t / float(self.turn)
            falls = np.where(t < float(self.turn), np.minimum(falls, line * MORE), falls)
        return Moments(float(self.witness.b), y, each_times(u, falls), floor)

    def highest_floor(self, case: LateCase) -> Fraction:
        """Return what errors of values, leaders that move and disturbances add at most up to ``T``."""
        return self.floor + (self.after or 0) * case.exact.least_gain(always=True) / case.exact.least_gain()

    def inputs(self, case: LateCase, rows: FollowerRows) -> np.ndarray | None:
        """Bound the inputs of followers, and a sign term; None where nothing does."""
        found, most = self._not_clipped(case, rows), case.exact.saturation
        if most is None:
            return found
        clipped = np.full(self.witness.u.size, float_up(most))
        return clipped if found is None else np.minimum(found, clipped)

    def _not_clipped(self, case: LateCase, rows: FollowerRows) -> np.ndarray | None:
        """Bound ``gain (D_k |eps_k| + sum_l |w_kl| |eps_l(t - tau_kl)| + error D_k)`` of followers, and a sign term.

        Under a cap, or where messages come at once and exactly, if ``gain e^(-b s)`` falls. None elsewhere.
        """
        cap, u, b = case.messages.gain_cap, self.witness.u, float_up(self.witness.b)
        sign = 0.0 if case.leaders is None else float_up(case.leaders.sign_gain or Fraction(0))
        falling, most = None, case.exact.falling_input(self.witness.b, self.initial, Fraction(float(u.min())))
        if most is not None and case.messages.vehicles is None:
            falling = (rows.largest(u) * float_up(most) * MORE + sign) * MORE
        if cap is None:
            return falling
        y = float_up(self.initial * case.highest(self.witness.b, self.cap))
        floor, error = (float_up(cap * x) for x in (self.highest_floor(case), case.exact.wrong))
        wrong = floor * rows.largest(u) + error * rows.weights
        whole = (2 * rows.weights - b * (1 - 1e-15)) * u * y + wrong + sign
        whole = whole * MORE + (LEAST if y or floor or error else 0)
        return np.asarray(whole if falling is None else np.minimum(whole, falling))


def _decayed(remaining: np.ndarray, p: float) -> np.ndarray:
    """Return ``int ((T - t)/(T - r))^p dr/T`` from 0 to ``t``, where ``1 - t/T`` is ``remaining``; 0 at ``T``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(remaining > 0, (1 - remaining ** (p - 1)) / (p - 1) if p != 1 else -np.log(remaining), 0.0)
    return np.asarray(remaining * np.maximum(share, 0))


def driven(
    case: LateCase,
    b: Fraction,
    push: float,
    cap: Fraction | None,
    after: float,
    t: np.ndarray,
    growth: Fraction = Fraction(0),
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``y = e^(-b s_c)``, and what ``push`` per unit of time adds to what decays like it, (M,) floats each.

    After ``T`` the gain is low again: from what was added by then ever more is, at most ``after`` if growth is slower
    than the decay then. With growth ``y`` is multiplied by ``e^(growth (t - T))``, what is added by ``e^(growth t)``.
    """
    T, added, part = float(case.protocol.T), np.zeros(t.shape), float_up(growth)
    if push:
        least, low = case.least_cap(cap), case.exact.least_gain(always=True)
        before = push * drift_integral(case.protocol.gain, float(b), least, np.append(t, T))
        before *= np.exp(part * np.append(np.minimum(t, T), T))
        rate = (float(b) * float(low if least is None else min(low, least)) - part) or -LEAST
        grown = -np.expm1(-rate * np.maximum(t - T, 0))
        later = before[-1] * (1 - grown) + push / rate * grown
        added = np.where(t > T, np.minimum(later, after if rate > 0 else np.inf), before[:-1])
    return case.decay(b, t, cap, growth), added


def each_times(sizes: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return (N, 1) times (M,): 0 where the first is 0, also of what is infinite."""
    with np.errstate(invalid="ignore"):
        return np.where(sizes > 0, sizes * y, 0.0)


def lasting(case: LateCase, b: Fraction, floor: np.ndarray, t: np.ndarray, growth: Fraction) -> np.ndarray:
    """Return what errors add, (N, 1), at instants, (N, M): after ``T`` infinite where growth outpaces the decay."""
    lost = (floor > 0) & (case.exact.lasting(growth, b) is None)
    return np.where((t > float(case.protocol.T)) & lost, np.inf, floor)


def drift_integral(gain: Gain, b: float, cap: Fraction | None, t: np.ndarray) -> np.ndarray:
    """Bound ``int_0^t e^(-b (s_c(t) - s_c(r))) dr`` at instants up to ``T``, in floats.

    Parameters
    ----------
    gain : Gain
    b : float
    cap : Fraction or None
        ``s_c`` is the integral of ``min(gain, cap)``; None: of the gain.
    t : (M,) array
        In units of time, up to ``T``.

    Returns
    -------
    (M,) array
        In units of time.

    Examples
    --------
    >>> gain = Gain(T=1, rho1=1, rho2=2, kappa=1)
    >>> drift_integral(gain, 1.0, Fraction(2), np.array([0, 1])).round(4)  # (1 - e^-2)/2
    array([0.    , 0.4323])
    """
    T, p = float(gain.T), b * float(gain.pole)
    turn = 0.0
    if cap is not None:
        turn = 1.0 if cap <= gain.first else float(gain.pole / (cap - gain.rho1) / gain.T)
    q = np.maximum(1 - t / T, 0)
    before = T * _decayed(np.maximum(q, turn), p)
    if cap is None:
        return before
    left = np.exp(-b * float(cap) * T * np.maximum(turn - q, 0))
    return np.asarray(before * left + (1 - left) / (b * float(cap)))


def away(case: LateCase, rows: FollowerRows) -> np.ndarray:
    """Bound ``|x_k(0) - x_k*|`` of every follower from above; 1 without a state.

    Of many followers in floats with room for their rounding.
    """
    if case.initial_state is None or case.ends is None:
        return np.ones(rows.D.size)
    followers, state, ends = rows.followers.tolist(), case.initial_state, case.ends
    if rows.D.size > SEARCHED_FOLLOWERS:
        with suppress(OverflowError):
            parts = ((state[v], *ends[v]) for v in followers)
            x, mid, radius = np.array([[float(value) for value in part] for part in parts]).T
            return np.asarray(np.abs(x - mid) + radius + (np.abs(x) + np.abs(mid) + radius) * 2.0**-50 + LEAST)
    return np.array([float_up(abs(state[v] - ends[v][0]) + ends[v][1]) for v in followers])


def search_rows(case: LateCase, rows: FollowerRows, first: np.ndarray) -> tuple[RowBound, ...]:
    """Return the row bound that leaves least at ``T`` of those found, under a cap that of the least input, too.

    Where leaders move those which leave least before ``T``, and after it, too.

    Parameters
    ----------
    case : LateCase
    rows : FollowerRows
        Those of the case.
    first : (F,) array
        ``|x_k(0) - x_k*|`` from above.
    """
    candidates: list[RowBound] = []

    def offer(q: float, loss: float) -> None:
        with suppress(LMIError):
            witness = rows.witness(Fraction(round_to_bits(q, 24)), loss)
            candidates.append(row_bound(case, rows, first, witness))

    small = rows.D.size <= SEARCHED_FOLLOWERS
    with suppress(LMIError):  # the equations of the followers are too ill-conditioned for floats
        if not case.messages.age:
            losses = _LOSSES if case.exact.saturation is None else LOSSES_CLIPPED
            for loss in losses[: None if small else 1]:
                offer(1.0, loss)
        else:
            best_q = 1.0 if small else _best_q(case, rows)
            if small:
                most = min(rows.largest_q(), _LARGEST_Q)
                for q in _grid(most, _TRIED):
                    offer(float(q), _LOSSES[0])
                best_q = float(min(candidates, key=_largest).witness.q) if candidates else 1.0
            for loss in _LOSSES[1:]:  # a q of 1 serves no delay
                offer(best_q, loss)
    if not candidates:
        return ()
    near = np.array([float(case.protocol.T) * (1 - _JUDGED)])
    aims: list[Callable[[RowBound], float]] = [_largest]
    if any(row.inputs(case, rows) is not None for row in candidates):
        aims.append(lambda row: _peak(row.inputs(case, rows)))
    if case.leaders is not None:
        aims.append(lambda row: float(row.residual(after=True).max()) if row.stays(case) else math.inf)
    if case.leaders is not None and not case.messages.age:  # nothing is left at T without a cap
        aims.append(lambda row: float(row.deviation_bound(case, near).max()))
    return tuple(dict.fromkeys(min(candidates, key=aim) for aim in aims))


def _peak(inputs: np.ndarray | None) -> float:
    return math.inf if inputs is None else float(inputs.max())


def _largest(bound: RowBound) -> float:
    return float(bound.residual().max())


def _grid(most: float, count: int) -> np.ndarray:
    """Return values of ``q`` between 1 and the largest one, denser near to 1."""
    return np.asarray(np.exp(math.log(most) * np.linspace(0, 1, count + 2)[1:-1] ** 2))


def _best_q(case: LateCase, rows: FollowerRows) -> float:
    """Return the ``q`` that leaves least by the vector for ``q = 1``."""
    witness, gain = rows.witness(Fraction(1), _LOSSES[1]), case.protocol.gain
    share = float(rows.share(witness.u).max())
    top = min(_LARGEST_Q, 1 / share if share else _LARGEST_Q)
    best, least = 1 + (top - 1) / 2, 0.0
    for q in _grid(top, 58):
        b = rows.decay(witness, float(q))
        if b > 0:
            cap = Fraction(math.log(q) / (b * float(case.messages.age)))
            value = -b * float(case.limited(cap).clock([float(gain.T)])[0])
            best, least = (float(q), value) if value < least else (best, least)
    return best


def _clipped(
    case: LateCase, b: Fraction, start: Fraction, most: Fraction
) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """Return ``b``, ``turn``, ``level`` and ``initial`` where inputs are clipped, ``most = U/max u``.

    A rate whose ``e^(b s)`` at the turn is beyond floats is given up for a slower one.

    Raises
    ------
    NoCertificate
        ``b rho2 kappa`` is below 1, or ``start`` is too large for the inputs.
    """
    gain, cap, speed = case.protocol.gain.exact, case.messages.gain_cap, most * _SLOWER
    for _ in range(_SLOWED):
        if b * gain.k < 1 or start >= speed * gain.T:
            raise NoCertificate("inputs that are clipped do not bring them there, as far as is proved")
        turn = _turn(gain, b, start, (speed, most), cap)
        level = start - speed * turn
        passed = Fraction(0) if not turn else rounded(b * Limits(cap, gain.T - turn).clock_above(gain), BITS, up=True)
        if passed <= LARGEST_EXPONENT:
            return b, turn, level, rounded(level * exp(passed, BITS)[1], BITS, up=True)
        b = min(b / 2, max(1 / gain.k, b * LARGEST_EXPONENT / passed)) if b > 2 / gain.k else 1 / gain.k
    raise NoCertificate("inputs that are clipped bring them there too near to T")


def _turn(
    gain: PrescribedGain, b: Fraction, start: Fraction, speeds: tuple[Fraction, Fraction], cap: Fraction | None
) -> Fraction:
    """Return when ``b g`` times the line from ``start``, at the first speed, is between this and the second."""
    speed, most = speeds

    def pulled(t: Fraction) -> Fraction:
        acts = gain.value(1 - t / gain.T)
        return b * min(acts, cap or acts) * (start - speed * t)

    if pulled(Fraction(0)) <= most:
        return Fraction(0)
    low, high = Fraction(0), start / speed
    turn = rounded(high / 2, BITS)
    for _ in range(_HALVINGS):
        if speed <= pulled(turn) <= most:
            return turn
        low, high = (turn, high) if pulled(turn) > most else (low, turn)
        turn = rounded((low + high) / 2, BITS)
    raise NoCertificate("when inputs are clipped no more lies too near to T")


def row_bound(case: LateCase, rows: FollowerRows, first: np.ndarray, witness: RowWitness) -> RowBound:
    """Return what a witness proves.

    Raises
    ------
    NoCertificate
        ``q`` is 1, which serves no delay.
    """
    cap, age = None, case.messages.age
    if age:
        if witness.q <= 1:
            raise NoCertificate("q = 1 serves no delay")
        cap = rounded(log(witness.q)[0] / (witness.b * age), BITS)
    floor = max(rows.floor(witness, float(case.exact.wrong)), LEAST) if case.exact.wrong else 0.0
    grown = case.grown(case.growth)
    more = case.exact.lasting(case.growth, witness.b) or grown
    initial = Fraction(float((first / witness.u).max()) * MORE) * grown
    stands = Fraction(floor * MORE) * more
    clipped: dict[str, Fraction] = {}
    if (most := case.exact.saturation) is not None:
        b, turn, level, reached = _clipped(case, witness.b, initial, most / Fraction(float(witness.u.max())))
        clipped = {"start": initial, "turn": turn, "level": level}
        witness, initial = replace(witness, b=b), reached
    row = RowBound(witness, cap, case.clock(cap), case.left(witness.b, cap), initial, stands, **clipped)
    if case.leaders is None:
        return row
    push = case.push / Fraction(float(witness.u.min())) * grown
    drift = push * drift_above(case.protocol.gain.exact, witness.b, case.least_cap(cap))
    flattest = Fraction(float((1 / rows.slack(witness)).max()) * MORE)
    after = more * flattest * case.push / case.exact.least_gain(always=True)
    return replace(row, drift=rounded(drift, BITS, up=True), after=rounded(after, BITS, up=True))
