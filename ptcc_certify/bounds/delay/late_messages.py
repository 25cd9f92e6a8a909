"""What holds with late messages: what is left at the deadline, row by row; who misses it; deadlines of stages.

Agents obey :mod:`ptcc_certify.model.late_messages`, leaders listen to nobody. With ``D_k u_k - q sum_l |w_kl| u_l
>= b u_k``, ``cap <= ln q / (b age)`` and ``s_c`` the integral of ``min(gain, cap)``

    |x_k(t) - x_k*| <= u_k (initial e^(-b s_c(t)) + floor)

for every gain that acts and all delays up to ``age``; ``initial`` is the largest ``|x_k(0) - x_k*| / u_k``, and
``floor`` what errors of values add. Where leaders move, the target ``x_k*(t)`` does, too, and what is heard of it is
off by ``speed age`` more; and there is added, inside the bracket,

    (speed + disturbance) / min u  int_0^t e^(-b (s_c(t) - s_c(r))) dr.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.errors import LMIError, NoCertificate
from lmi.exact.decimal_rounding import float_up, up
from lmi.exact.elementary_enclosures import log, rounded
from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBound
from ptcc_certify.bounds.delay.late_steps import Steps, bound_steps, search_steps
from ptcc_certify.bounds.delay.missed_deadline import Missed, find_missed
from ptcc_certify.bounds.delay.settling_leaders import Settling
from ptcc_certify.bounds.delay.small_delays import SmallDelays, left_above
from ptcc_certify.bounds.delay.staged_deadlines import stage_deadlines
from ptcc_certify.bounds.float_conversion import floats, floats_up
from ptcc_certify.bounds.tracking import drift_integral
from ptcc_certify.bounds.virtual_positions import VehicleBounds, bound_vehicles, read_vehicles, vehicles_section
from ptcc_certify.checker.delay_lmi import LateLMI, LateLMIWitness
from ptcc_certify.checker.input_formulas import BITS, Limits
from ptcc_certify.checker.late_drift import drift_above
from ptcc_certify.checker.late_form import LateForm, LateFormWitness
from ptcc_certify.checker.late_input import gain_above
from ptcc_certify.checker.late_messages import PARTS, Delays, Moving, Packets
from ptcc_certify.checker.messages import MessagesSection, StepsStart
from ptcc_certify.checker.missed_deadline import Signs
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.sections import RowVector, declared
from ptcc_certify.checker.settling_leaders import SettlingSection, SettlingWitness
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, pairs_of
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import FollowerRows, RowWitness, listeners
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.virtual_positions import TrackingProtocol, Vehicles
from ptcc_certify.theorems.theorem import Obligation

#: Up to so many followers many ``q`` are tried; beyond, the best of those that one vector proves.
SEARCHED_FOLLOWERS = 3000
#: Values of ``q`` that are tried, and the largest one; losses of ``b`` for a more even vector.
_TRIED, _LARGEST_Q, _LOSSES = 10, 1e9, (0.01, 0.2, 0.6)
#: What is added to a bound in floats, relatively, so that it holds.
_MORE = 1 + 1e-9
#: What errors of values add, at least: less is lost in floats.
_LEAST = 1e-300


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
    """

    witness: RowWitness
    cap: Fraction | None
    clock: Fraction | None
    left: Fraction
    initial: Fraction
    floor: Fraction
    drift: Fraction | None = None
    after: Fraction | None = None

    def residual(self, after: bool = False) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` at ``T``, or from there on, for every follower, in floats from above."""
        drift = (self.after if after else self.drift) or 0
        return self.witness.u * float(self.initial * self.left + self.floor + drift) * _MORE + 1e-300


@dataclass(frozen=True, eq=False, repr=False)
class LateBounds:
    """What is proved of a graph whose messages are late.

    Attributes
    ----------
    messages : LateMessages
    structure : Structure or Family
    gain : LimitedGain
        The gain that acts.
    relative : bool
        Whether bounds are for every initial state within 1 of its final one, in place of the given state.
    rows : tuple of RowBound
    steps : Steps or None
    missed : Missed or None
    staged : tuple of Fraction, or None
        Of every follower the deadline at which it is at its final state exactly.
    residual : (N,) array or None
        What bounds ``|x_k(T) - x_k*|`` row by row, in floats from above; None where nothing does.
    form : SmallDelays or None
        What a Lyapunov function of the whole graph proves under a capped gain.
    settling : Settling or None
        What holds of followers that hear late of leaders in groups.
    lmi : DelayLMIBound or None
        What the delay LMI proves of the whole graph under a capped gain.
    longest_delay : float or None
        About the longest delay that such functions forgive: this certificate's limit. None if it was not asked.
    unarrived : bool
        Whether deadlines of stages fail since information takes longer than ``T`` to come from leaders to all.
    input : (N,) array or None
        What bounds ``|x_k'|`` up to ``T``, the sliding term left out, in floats from above; None where nothing does.
    enough : Fraction or None
        The age up to which no more is left than was asked, near to the longest one that is proved; all times of
        ``messages`` in proportion.
    leaders : MovingLeaders or None
        How leaders move, and what disturbs the followers; None if they rest, and nothing does.
    vehicles : VehicleBounds or None
        What follows of double integrators that track these agents, which then are virtual.
    """

    messages: LateMessages
    structure: Structure | Family
    gain: LimitedGain
    relative: bool
    rows: tuple[RowBound, ...] = ()
    steps: Steps | None = None
    missed: Missed | None = None
    staged: tuple[Fraction, ...] | None = None
    residual: np.ndarray | None = None
    form: SmallDelays | None = None
    lmi: DelayLMIBound | None = None
    longest_delay: float | None = None
    unarrived: bool = False
    input: np.ndarray | None = None
    enough: Fraction | None = None
    settling: Settling | None = None
    leaders: MovingLeaders | None = None
    vehicles: VehicleBounds | None = None

    @cached_property
    def followers(self) -> np.ndarray:
        """The agents that are bounded, ascending."""
        return self.structure.followers if isinstance(self.structure, Structure) else listeners(self.structure)

    @property
    def labels(self) -> Sequence[str]:
        """Of all agents."""
        return self.structure.graph.labels if isinstance(self.structure, Structure) else self.structure.labels

    @property
    def says_something(self) -> bool:
        """Whether anything is proved."""
        whole = self.settling or self.form or self.lmi
        return bool(self.rows or self.steps or self.missed or self.staged or whole)

    @property
    def largest(self) -> float:
        """The largest of the bounds of ``|x_k(T) - x_k*|``, of vehicles theirs; infinite where nothing is bounded."""
        if self.vehicles is not None:
            return float(self.vehicles.position.max())
        largest = math.inf if self.residual is None else float(self.residual.max())
        largest = largest if self.settling is None else min(largest, float(self.settling.residual.max()))
        whole = [float_up(max(one.residual)) for one in (self.form, self.lmi) if one is not None]
        return min([largest, *whole])

    def __repr__(self) -> str:
        size = up(self.largest, 2) if self.largest else "0"
        within = "nothing" if math.isinf(self.largest) else f"every agent within {size}"
        return f"LateBounds({self.messages!r}: {within} at T)"

    @property
    def after(self) -> float | None:
        """What bounds ``|x_k - x_k*|`` from ``T`` on where leaders move; None where they rest."""
        if self.vehicles is not None:
            return None if self.leaders is None else self.vehicles.after(self)
        found = [float(row.residual(after=True).max()) for row in self.rows]
        return min(found) if found and self.leaders is not None else None

    @cached_property
    def never_below(self) -> float | None:
        """What stays at least of the largest bound however large the gain, where leaders move while messages come.

        What no decay takes away obeys ``D_k y_k >= sum_l |w_kl| y_l + speed age D_k`` in every member, by rows as from
        instant to instant, and is above the least such ``y``. By rows more stays, how much depends on those found.
        """
        if self.leaders is None or not self.messages.age or not (self.rows or self.steps):
            return None
        of, error = self.structure, float(self.leaders.speed * self.messages.age)
        return float(late_rows(of, self.messages).kept_off(error).max()) / _MORE

    @property
    def inputs(self) -> np.ndarray | None:
        """What bounds ``|u_k|`` up to ``T``, of vehicles theirs, the sliding term left out; None where nothing does."""
        return self.input if self.vehicles is None else self.vehicles.input

    @property
    def tracking_protocol(self) -> TrackingProtocol | None:
        """The protocol of vehicles that are bounded; None without them."""
        if self.vehicles is None:
            return None
        return TrackingProtocol(self.gain.gain, self.vehicles.a1, self.vehicles.a2, self.messages.gain_cap)

    @property
    def direct(self) -> bool:
        """Whether all followers hear of leaders alone, so that they settle at ``T`` exactly."""
        return self.staged is not None and len(set(self.staged)) == 1

    def deviation_bound(self, t: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` at instants, of vehicles theirs, ``(F, M)`` floats; or infinite."""
        t = np.asarray(t, dtype=float)
        if self.vehicles is not None:
            return self.vehicles.over_time(self, t)[0][self.followers]
        whole = np.full((self.followers.size, len(t)), np.inf)
        for row in self.rows:
            cap = [x for x in (row.cap, self.gain.limits.gain_cap) if x is not None]
            clock = GainLimits(gain_cap=min(cap, default=None)).limit(self.gain.gain).clock(t)
            b, M = float(row.witness.b), float(row.initial)
            c = np.full(t.shape, float(row.floor))
            if self.leaders is not None:
                push = float(self.leaders.total) / float(row.witness.u.min())
                c = c + push * drift_integral(self.gain.gain, b, min(cap, default=None), t)
            whole = np.minimum(whole, row.witness.u[:, None] * (M * np.exp(-b * clock) + c) * _MORE)
        if self.steps is not None:
            at = np.searchsorted([float(x) for x in self.steps.instants], t * (1 - 1e-15), side="right") - 1
            whole = np.minimum(whole, self.steps.bounds[np.maximum(at, 0)].T)
        for one in self._of_all:
            whole = np.minimum(whole, one.deviation_bound(self.gain, t)[self.followers])
        return whole

    def largest_bound(self, t: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return what bounds the largest ``|x_k - x_k*|`` of all agents at instants, ``(M,)`` floats."""
        if self.vehicles is not None:  # leaders that have a velocity move, too
            return np.asarray(self.vehicles.over_time(self, np.asarray(t, dtype=float))[0].max(axis=0))
        bounds = [one.deviation_bound(self.gain, np.asarray(t, dtype=float)) for one in self._of_all]
        if not bounds:
            return np.asarray(self.deviation_bound(t).max(axis=0))
        return np.asarray(np.minimum.reduce(bounds).max(axis=0))

    @property
    def _of_all(self) -> list[Settling | DelayLMIBound]:
        """What bounds deviations of all agents at every instant."""
        return [one for one in (self.settling, self.lmi) if one is not None]


def bound_late(
    structure: Structure | Family,
    protocol: Protocol,
    messages: LateMessages,
    initial_state: Sequence[Fraction] | None = None,
    ends: Sequence[tuple[Fraction, Fraction]] | None = None,
    leaders: MovingLeaders | None = None,
) -> LateBounds:
    """Bound what late messages leave at the deadline.

    Parameters
    ----------
    structure : Structure or Family
        All leaders are single nodes; of a family all bounds are by rows, for every signal.
    protocol : Protocol
        Its ``gain``; under the sliding-mode protocol with ``sigma(0) = 0``.
    messages : LateMessages
    initial_state : sequence of N Fraction, optional
    ends : sequence of N (middle, radius), optional
        Of ``Q X(0)``; without it bounds are for every initial state within 1 of its final one.
    leaders : MovingLeaders, optional
        Without a sign term: leaders move, and followers are disturbed; ``x*`` moves with the leaders.

    Returns
    -------
    LateBounds
        Without bounds by rows where a leader belongs to a group, or the own state is late, too.

    Raises
    ------
    ParameterError
        A delay is of an edge that is not there.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 2, 1)]))
    >>> bounds = bound_late(structure, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), LateMessages(delay="0.01"))
    >>> bounds.residual.max() < 0.5
    np.True_
    """
    gain = GainLimits(gain_cap=messages.gain_cap).limit(protocol.gain)
    if isinstance(structure, Family):
        bounds = LateBounds(messages, structure, gain, ends is None, leaders=leaders)
        return _by_rows(bounds, late_rows(structure, messages), initial_state, ends)
    latencies = messages.latencies(structure.graph)
    if messages.own_delay or any(len(c.nodes) > 1 for c in structure.closed_components):
        return LateBounds(messages, structure, gain, initial_state is None or ends is None, leaders=leaders)
    rows = late_rows(structure, messages)
    bounds = LateBounds(messages, structure, gain, initial_state is None or ends is None, leaders=leaders)
    bounds = _by_rows(bounds, rows, initial_state, ends)
    if messages.value_error or messages.gain_cap is not None or leaders is not None or messages.vehicles is not None:
        return bounds
    if initial_state is not None and ends is not None:
        bounds = replace(bounds, missed=find_missed(rows, protocol, latencies, initial_state, ends))
    staged = stage_deadlines(rows, protocol.T, messages.age)
    unarrived = staged is None and stage_deadlines(rows, protocol.T, Fraction(0)) is not None
    return replace(bounds, staged=staged, unarrived=unarrived)


def _by_rows(
    bounds: LateBounds,
    rows: FollowerRows,
    initial_state: Sequence[Fraction] | None,
    ends: Sequence[tuple[Fraction, Fraction]] | None,
) -> LateBounds:
    """Add what is proved row by row, and of one graph from instant to instant."""
    messages, gain, leaders = bounds.messages, bounds.gain, bounds.leaders
    first = np.ones(rows.D.size)
    if initial_state is not None and ends is not None:
        first = _away(rows, initial_state, ends)
    found, steps = search_rows(rows, bounds, first), None
    if messages.age and messages.vehicles is None and isinstance(bounds.structure, Structure):
        with suppress(LMIError):
            error, push = float(heard_wrong(messages, leaders)) * _MORE, float(leaders.total if leaders else 0)
            steps = search_steps(rows, gain, messages.age, error, first, push * _MORE)
    each = [row.residual() for row in found]
    each += [] if steps is None else [steps.bounds[-1] * _MORE + 1e-300]
    inputs = _least(rows, [] if messages.gain_cap is None else [_inputs(rows, bounds, row) for row in found])
    bounds = replace(bounds, rows=found, steps=steps, residual=_least(rows, each), input=inputs)
    return bounds if messages.vehicles is None else bound_vehicles(bounds, rows)


def heard_wrong(messages: LateMessages, leaders: MovingLeaders | None) -> Fraction:
    """Return what a target that is heard late is off by: the error of values, and how far it moved on."""
    return messages.value_error + (0 if leaders is None else leaders.speed * messages.age)


def _inputs(rows: FollowerRows, bounds: LateBounds, row: RowBound) -> np.ndarray:
    """Bound ``gain (D_k |eps_k| + sum_l |w_kl| |eps_l(t - tau_kl)| + error D_k)`` of every follower."""
    cap, gain = bounds.messages.gain_cap, bounds.gain.gain.exact
    u, b = row.witness.u, float_up(row.witness.b)
    assert cap is not None
    y, floor = float_up(row.initial * gain_above(gain, cap, row.witness.b, row.cap)), row.floor
    if row.after is not None:
        floor += row.after * min(gain.rho1, cap) / min(gain.value(Fraction(1)), cap)
    error = heard_wrong(bounds.messages, bounds.leaders)
    wrong = float_up(cap * floor) * rows.largest(u) + float_up(cap * error) * rows.weights
    return ((2 * rows.weights - b * (1 - 1e-15)) * u * y + wrong) * _MORE + 1e-300


def _away(
    rows: FollowerRows, initial_state: Sequence[Fraction], ends: Sequence[tuple[Fraction, Fraction]]
) -> np.ndarray:
    """Bound ``|x_k(0) - x_k*|`` of every follower from above: of many in floats with room for their rounding."""
    if rows.D.size > SEARCHED_FOLLOWERS:
        with suppress(OverflowError):
            followers = rows.followers.tolist()
            parts = ((initial_state[v], *ends[v]) for v in followers)
            x, mid, radius = np.array([[float(value) for value in part] for part in parts]).T
            return np.asarray(np.abs(x - mid) + radius + (np.abs(x) + np.abs(mid) + radius) * 2.0**-50 + 1e-300)
    return np.array([float_up(abs(initial_state[v] - ends[v][0]) + ends[v][1]) for v in rows.followers])


def late_rows(of: Structure | Family, messages: LateMessages) -> FollowerRows:
    """Return the rows of the followers, with ages of what is heard by edge, in 64ths of the oldest, rounded up.

    Parameters
    ----------
    of : Structure or Family
        All leaders are single nodes.
    messages : LateMessages
    """
    latencies = messages.latencies(of.graph if isinstance(of, Structure) else of)
    if not isinstance(latencies, tuple) or not messages.age:
        return FollowerRows(of)
    part = {x: math.ceil(PARTS * (x + messages.held) / messages.age) for x in set(latencies)}
    if min(part.values()) == PARTS:
        return FollowerRows(of)
    return FollowerRows(of, np.array([part[x] / PARTS for x in latencies]))


def _least(rows: FollowerRows, bounds: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the least of bounds of followers, for all agents."""
    if not bounds:
        return None
    whole = np.zeros(rows.n_nodes)
    whole[rows.followers] = np.minimum.reduce(bounds)
    return whole


def search_rows(rows: FollowerRows, bounds: LateBounds, first: np.ndarray) -> tuple[RowBound, ...]:
    """Return the row bound that leaves least at ``T`` of those found, under a cap that of the least input, too.

    Where leaders move that which leaves least after ``T``, too.
    """
    gain, messages, leaders = bounds.gain, bounds.messages, bounds.leaders
    candidates: list[RowBound] = []

    def offer(q: float, loss: float) -> None:
        with suppress(LMIError):
            witness = rows.witness(Fraction(round_to_bits(q, 24)), loss)
            candidates.append(row_bound(rows, gain, messages, first, witness, leaders))

    small = rows.D.size <= SEARCHED_FOLLOWERS
    with suppress(LMIError):  # the equations of the followers are too ill-conditioned for floats
        if not messages.age:
            for loss in _LOSSES[: None if small else 1]:
                offer(1.0, loss)
        else:
            if small:
                most = min(rows.largest_q(), _LARGEST_Q)
                tried = np.exp(math.log(most) * np.linspace(0, 1, _TRIED + 2)[1:-1] ** 2)
                for q in tried:
                    offer(float(q), _LOSSES[0])
                best = min(candidates, key=_largest, default=None)
                if best is not None:
                    for loss in _LOSSES[1:]:
                        offer(float(best.witness.q), loss)
            else:
                best_q = _best_q(rows, gain, messages, _LARGEST_Q)
                for loss in _LOSSES[1:]:
                    offer(best_q, loss)
    if not candidates:
        return ()
    chosen = [min(candidates, key=_largest)]
    if messages.gain_cap is not None:
        chosen.append(min(candidates, key=lambda row: float(_inputs(rows, bounds, row).max())))
    if leaders is not None:
        chosen.append(min(candidates, key=lambda row: float(row.residual(after=True).max())))
    return tuple(dict.fromkeys(chosen))


def _largest(bound: RowBound) -> float:
    return float(bound.residual().max())


def _best_q(rows: FollowerRows, gain: LimitedGain, messages: LateMessages, most: float) -> float:
    """Return the ``q`` that leaves least by the vector for ``q = 1``."""
    witness, age = rows.witness(Fraction(1), _LOSSES[1]), float(messages.age)
    share = float(rows.share(witness.u).max())
    top = min(most, 1 / share if share else most)
    best, least = 1 + (top - 1) / 2, 0.0
    for q in np.exp(math.log(top) * np.linspace(0, 1, 60)[1:-1] ** 2):
        b = rows.decay(witness, float(q))
        if b > 0:
            cap = Fraction(math.log(q) / (b * age))
            caps = [cap, *([] if messages.gain_cap is None else [messages.gain_cap])]
            value = -b * float(GainLimits(gain_cap=min(caps)).limit(gain.gain).clock([float(gain.gain.T)])[0])
            best, least = (float(q), value) if value < least else (best, least)
    return best


def row_bound(
    rows: FollowerRows,
    gain: LimitedGain,
    messages: LateMessages,
    first: np.ndarray,
    witness: RowWitness,
    leaders: MovingLeaders | None = None,
) -> RowBound:
    """Return what a witness proves under a delay.

    Raises
    ------
    NoCertificate
        ``q`` is 1, which serves no delay.
    """
    caps = [] if messages.gain_cap is None else [messages.gain_cap]
    cap = None
    if messages.age:
        if witness.q <= 1:
            raise NoCertificate("q = 1 serves no delay")
        cap = rounded(log(witness.q)[0] / (witness.b * messages.age), BITS)
        caps.append(cap)
    clock, left = None, Fraction(0)
    if caps:
        clock = Limits(min(caps)).clock_below(gain.gain.exact)
        left = left_above(witness.b * clock)
    floor = 0.0
    error = heard_wrong(messages, leaders)
    slack = rows.slack(witness.u)
    if error:
        floor = max(rows.floor(witness.u, float(error)), _LEAST)
    initial = float((first / witness.u).max())
    row = RowBound(witness, cap, clock, left, Fraction(initial * _MORE), Fraction(floor * _MORE))
    if leaders is None:
        return row
    push, limit = leaders.total / Fraction(float(witness.u.min())), min(caps, default=None)
    drift = push * drift_above(gain.gain.exact, witness.b, limit)
    slowest = gain.gain.rho1 if messages.gain_cap is None else min(gain.gain.rho1, messages.gain_cap)
    after = Fraction(float((1 / slack).max()) * _MORE) * leaders.total / slowest
    return replace(row, drift=rounded(drift, BITS, up=True), after=rounded(after, BITS, up=True))


def late_obligations(late: LateBounds | None) -> Iterator[Obligation]:
    """Yield what proves bounds with late messages."""
    if late is None:
        return
    for i, row in enumerate(late.rows):
        numbers = {"q": row.witness.q, "b": row.witness.b}
        yield Obligation("late-rows", f"messages.rows[{i}]", numbers, RowVector(u=Numbers(row.witness.u)))
    if late.steps is not None:
        yield Obligation("late-steps", "messages.steps", witness=StepsStart(start=Numbers(late.steps.start)))
    if late.missed is not None:
        yield Obligation("late-missed", "messages.missed", witness=Signs(gauge=late.missed.gauge.tolist()))
    if (settling := late.settling) is not None:
        witness = SettlingWitness(function=settling.function, u=Numbers(settling.u))
        yield Obligation("late-settling", "messages.settling", {"q": settling.q, "b": settling.b}, witness)
    if (form := late.form) is not None:
        numbers = {"q": form.q, "b": form.b, "kap": form.kap}
        phi = LateFormWitness(function=form.function, phi=Numbers(form.phi))
        yield Obligation("late-form", "messages.form", numbers, phi)
    if (lmi := late.lmi) is not None:
        floating: Any = [list(map(float, row)) for row in (*lmi.matrix, lmi.tau)]  # dyadic numbers, and short texts
        matrix = LateLMIWitness(matrix=floating[:-1], tau=floating[-1])
        yield Obligation("late-lmi", "messages.lmi", {"b": lmi.b}, matrix)


def delays(messages: LateMessages, of: SignedDigraph | Family, leaders: MovingLeaders | None = None) -> Delays:
    """Return how late, how often lost and how inexact messages are, as files have it."""
    period, latency = messages.period, messages.latencies(of)
    return Delays(
        latency=latency if isinstance(latency, Fraction) else Numbers(latency),
        packets=None if period is None else Packets(period=period, losses=Fraction(messages.losses)),
        delay=messages.age,
        own="late" if messages.own_delay else "fresh",
        value_error=messages.value_error,
        gain_cap=messages.gain_cap,
        leaders=None if leaders is None else Moving(speed=leaders.speed, disturbance=leaders.disturbance),
    )


def messages_section(late: LateBounds) -> MessagesSection:
    """Return what is proved with late messages, as files have it."""
    proved: dict[str, Any] = {f.name: getattr(late, f.name) for f in declared(MessagesSection) if hasattr(late, f.name)}
    of = late.structure.graph if isinstance(late.structure, Structure) else late.structure
    proved["vehicles"] = vehicles_section(late.vehicles)
    return MessagesSection(**proved | vars(delays(late.messages, of, late.leaders)))


def read_late(
    report: CheckReport, structure: Structure | Family, protocol: Protocol, relative: bool
) -> LateBounds | None:
    """Return what an accepted certificate says of late messages; None if it says nothing."""
    section: MessagesSection | None = report.sections.get("messages")
    if section is None:
        return None
    vehicles = read_vehicles(section.vehicles)
    messages = read_messages(section, structure, None if vehicles is None else Vehicles(vehicles.v0))
    proved, moving = report.proved, section.leaders
    leaders = None if moving is None else MovingLeaders(moving.speed, moving.disturbance)
    rows = []
    for i, row in enumerate(section.rows):
        step = proved["late-rows", f"messages.rows[{i}]"]
        witness = RowWitness(step["q"], step["b"], floats(step["witness"].u))
        rows.append(RowBound(witness, row.cap, row.clock, row.left, row.initial, row.floor, row.drift, row.after))
    gain = GainLimits(gain_cap=messages.gain_cap).limit(protocol.gain)
    missed, steps = None, None
    if section.missed is not None:
        gauge = np.array(proved["late-missed", "messages.missed"]["witness"].gauge)
        missed = Missed(section.missed.agent, section.missed.bound, gauge)
    if section.steps is not None and isinstance(structure, Structure):
        start = floats(proved["late-steps", "messages.steps"]["witness"].start)
        error, push = float_up(heard_wrong(messages, leaders)), float_up(leaders.total) if leaders else 0.0
        times = tuple(section.steps.instants)
        steps = bound_steps(late_rows(structure, messages), gain, messages.age, error, times, start, push)
    return LateBounds(
        messages,
        structure,
        gain,
        relative,
        tuple(rows),
        steps,
        missed,
        None if section.staged is None else tuple(section.staged),
        floats_up(section.residual),
        _read_form(section.form, proved.get(("late-form", "messages.form"))),
        lmi=_read_lmi(section.lmi, proved.get(("late-lmi", "messages.lmi"))),
        settling=_read_settling(section.settling, proved.get(("late-settling", "messages.settling"))),
        input=floats_up(section.input),
        leaders=leaders,
        vehicles=vehicles,
    )


def _read_form(form: LateForm | None, step: Any) -> SmallDelays | None:
    if form is None:
        return None
    known = step["witness"]
    bounds = form.left, tuple(form.moved), tuple(form.residual)
    return SmallDelays(known.function, step["q"], step["b"], step["kap"], tuple(known.phi), *bounds)


def _read_lmi(lmi: LateLMI | None, step: Any) -> DelayLMIBound | None:
    if lmi is None:
        return None
    bounds = (tuple(values) for values in (lmi.moved, lmi.away, lmi.residual))
    matrix = tuple(map(tuple, step["witness"].matrix))
    return DelayLMIBound(step["b"], matrix, tuple(step["witness"].tau), lmi.left, *bounds)


def _read_settling(settling: SettlingSection | None, step: Any) -> Settling | None:
    if settling is None:
        return None
    known, (cap, clock, left) = step["witness"], (settling.cap, settling.clock, settling.left)
    return Settling(known.function, step["q"], step["b"], cap, clock, left, tuple(known.u))


def read_messages(section: Delays, structure: Structure | Family, vehicles: Vehicles | None = None) -> LateMessages:
    """Return what a certificate says of how late messages are."""
    packets, of = section.packets, structure.graph if isinstance(structure, Structure) else structure
    latency: Any = section.latency
    if isinstance(latency, Numbers):
        latency = dict(zip(pairs_of(of), latency, strict=True))
    return LateMessages(
        delay=latency,
        period=None if packets is None else packets.period,
        losses=0 if packets is None else int(packets.losses),
        value_error=section.value_error,
        own_delay=section.own == "late",
        gain_cap=section.gain_cap,
        vehicles=vehicles,
    )
