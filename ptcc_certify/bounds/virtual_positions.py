"""What holds of vehicles that track virtual states: every decay of these carries over.

With ``|z_k - x*_k| <= Y_k + floor_k``, ``Y_k = away_k y``, by rows ``u_k (M y + C)``, ``y' >= -b g y`` and ``C' >= -b g
C`` where nothing drives it, ``g`` the gain of the chain, double integrators have, with ``a_1 > b`` and ``a_2 >= b``

    |x_k - x*_k| <= a_1 Y_k/(a_1 - b) + floor_k + |v_k(0)| y/((a_1 - b) g(0))
    |v_k| <= a_1 g (|x_k - x*_k| + |q_k - x*_k|),   |q_k - x*_k| <= Y_k + floor_k + |v_k(0)| y/(a_1 g(0)),

and so do vehicles of order 3 with the factors of :class:`~ptcc_certify.checker.stated_bounds.Tracking`. Floors are not
drives: they are added as they are. ``v_k(0)`` has a term of its own, which is there where ``M = 0``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

import numpy as np

from lmi.exact.decimal_rounding import float_up, up
from ptcc_certify.bounds.agents.each_agent import checked_graph
from ptcc_certify.bounds.delay.case import LateCase, Moments
from ptcc_certify.bounds.delay.decay_by_rows import RowBound
from ptcc_certify.bounds.delay.decay_by_steps import Steps
from ptcc_certify.bounds.float_conversion import floats_up
from ptcc_certify.checker.message_ages import Messages
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import DecayOfAll, Tracking, VehiclesSection, passed_on
from ptcc_certify.checker.stepwise_inputs import VehicleSteps, Walk
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import FollowerRows
from ptcc_certify.model.virtual_positions import Vehicles

#: How many times faster vehicles track than the virtual states decay.
FASTER = 2
#: A share of the longest way, of which less need not be left where gains are chosen.
ENOUGH = 0.01
#: What is added to a bound in floats, relatively and absolutely, so that it holds.
_MORE, _LEAST = 1 + 1e-9, 1e-300


class Carried(Protocol):
    """A decay of virtual states, by rows or of all agents."""

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds ``|z_k - x_k*|`` of all agents at instants."""


@dataclass(frozen=True, eq=False)
class VehicleBounds:
    """Bounds of vehicles that track virtual states.

    Attributes
    ----------
    vehicles : Vehicles
        Which they are, and how they begin.
    gains : tuple of Fraction
        ``a_1``, ``a_2`` and, if any is of order 3, ``a_3``.
    position : (N,) array
        What bounds ``|x_k(T) - x*_k|``, in floats from above.
    velocity, input : (N,) array or None
        What bounds ``|x_k'|`` and ``|u_k|`` up to ``T``; None without a cap of the gain. Those of leaders that move, as
        they like, are 0.
    """

    vehicles: Vehicles
    gains: tuple[Fraction, ...]
    position: np.ndarray
    velocity: np.ndarray | None
    input: np.ndarray | None

    def cost(self, enough: float) -> tuple[float, float]:
        """By what gains are chosen: what is left, if more than enough, times the largest input; or the fastest ones."""
        push = np.inf if self.input is None else float(self.input.max()) * max(float(self.position.max()), enough)
        return push, -float(self.gains[0])

    @property
    def by_steps(self) -> bool:
        """Whether they can be followed from instant to instant: double integrators under a cap of the gain."""
        return self.input is not None and self.vehicles.team is None and not self.vehicles.disturbance

    def over_time(self, case: LateCase, decays: Sequence[Carried], t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what bounds deviations and velocities of all agents at instants, ``(N, M)`` floats.

        From ``T`` on the gain of the tracking stays what it came to: without a cap there is no bound after ``T``. With
        one there is none of velocities then, of deviations the same, but :meth:`after` where leaders move.
        """
        chosen, a1, T, cap = case.followers, float(self.gains[0]), float(case.protocol.T), case.messages.gain_cap
        orders, (speed, push) = np.array(self.vehicles.orders), self.vehicles.begun
        g = case.limited().value(t, remaining=np.maximum(1 - t / T, _LEAST))
        position, velocity = (np.full((orders.size, len(t)), np.inf) for _ in range(2))
        for b, y, decaying, floor in (one.over_time(case, t) for one in decays):
            for order in np.unique(orders).tolist():
                tracking, of = _tracking(case.exact, order, self.gains, Fraction(b)), orders == order
                if not tracking.follows:
                    continue
                least = np.where(decaying + floor > 0, _LEAST, 0.0)[of]
                both = []
                shaken = 0.0 if order == 1 else float(self.vehicles.disturbance * tracking.steady)
                for passed in (tracking.position, tracking.ahead):
                    falling, standing, by_speed, by_push, _ = map(float, passed)
                    own = (by_speed * speed + by_push * push)[:, None] * y + falling * decaying + standing * floor
                    both.append(own[of] + shaken)
                position[of] = np.minimum(position[of], both[0] * _MORE + least)
                if order > 1:
                    velocity[of] = np.minimum(velocity[of], a1 * g * (both[0] + both[1]) * _MORE + least)
        past = t > T
        if self.velocity is None:
            velocity[:, t >= T] = np.inf
        else:
            velocity = np.where(past, np.inf, np.minimum(velocity, self.velocity[:, None]))
        if cap is None or case.leaders is not None:
            rows = [one for one in decays if isinstance(one, RowBound)]
            position[:, past] = np.inf if (after := self.after(case, rows)) is None else after
        if case.leaders is not None and case.leaders.speed:  # which move as they like
            others = np.setdiff1d(np.arange(orders.size), chosen)
            position[others] = velocity[others] = 0
        return position, velocity

    def after(self, case: LateCase, rows: Sequence[RowBound]) -> float | None:
        """Return what bounds ``|x_k - x*_k|`` from ``T`` on under a cap; None where nothing does.

        With ``C <= after`` at all times ``|x_k - x*_k|`` is at most ``u_k (a_1 M y/(a_1 - b) + floor + after)``, what
        the initial velocity adds, and ``speed/(a_1 g)``, what a vehicle lags behind a target that moves: with ``g =
        g(0)``, or from ``T`` on with the cap if it is less than that at ``T``. Of order 3, ``speed (1/a_1 + (1 + 1/(k
        a_1))/a_2)/g(0)``.
        """
        cap, leaders = case.messages.gain_cap, case.leaders
        if cap is None or leaders is None:
            return None
        messages, at_T, (a1, a2), third = case.exact, self.position, self.gains[:2], 3 in self.vehicles.orders
        behind = 1 / a1 + ((1 + 1 / (messages.gain.k * a1)) / a2 if third else 0)
        early, lasting = (float_up(leaders.speed * behind / g) for g in (messages.least_gain(), cap))
        found = []
        for row in rows:
            decay = _of_row(case, replace(row, floor=row.floor + (row.after or 0), drift=None))
            bound = _passed(messages, decay, self.vehicles, self.gains, lasting=True)[0]
            found.append((bound + early).max())
            if not third:
                found.append(np.maximum(bound + lasting, at_T).max())
        return float(min(found)) * _MORE if np.isfinite(found).any() else None


def bound_vehicles(
    case: LateCase,
    found: Sequence[RowBound],
    rows: FollowerRows | None,
    steps: Steps | None = None,
    decays: Sequence[DecayOfAll] = (),
) -> VehicleBounds | None:
    """Return what holds of vehicles that track virtual states, by rows of these and by decays of all of them.

    Under a cap of the gain what follows from instant to instant, too, if virtual states are bounded so.

    Raises
    ------
    ParameterError
        A leader that moves as it likes has an initial velocity.

    Examples
    --------
    >>> from ptcc_certify.bounds.delay.late_messages import bound_late
    >>> from ptcc_certify.model.virtual_positions import Vehicles
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1)]))
    >>> messages = LateMessages(gain_cap=9, vehicles=Vehicles((Fraction(0), Fraction(1)), (2, 2)))
    >>> ends = [(Fraction(1), Fraction(0))] * 2
    >>> bounds = bound_late(LateCase(structure, NominalProtocol(rho2=4), messages, [Fraction(1), Fraction(3)], ends))
    >>> bounds.vehicles.position.max() < 0.01, bounds.vehicles.velocity.max() < 100
    (np.True_, np.True_)
    """
    vehicles = case.messages.vehicles
    assert vehicles is not None
    chosen = set(case.followers.tolist())
    if case.leaders is not None and case.leaders.speed:
        for name, values in (("v0", vehicles.v0), ("a0", vehicles.a0 or ())):
            moving = next((v for v, x in enumerate(values) if x and v not in chosen), None)
            if moving is not None:
                label = shorten(case.of.labels[moving])
                raise ParameterError(name, f"of {label} is not 0, a leader that moves as it likes here; give it 0")
    ends = [_of_row(case, row, rows) for row in found]
    for one in decays:
        columns = [x * one.left for x in one.away], one.floor, one.falling, one.standing
        each = (case.of_nodes(one.nodes, np.array([float_up(x) for x in column])) for column in columns)
        ends.append(_Ends(one.b, one.left, one.cap, *each))
    if not ends:
        return None
    ways = [] if case.relative else [abs(x - m) for x, (m, _) in zip(case.state, case.ends or (), strict=True)]
    enough = ENOUGH * float(max(ways, default=1) or 1)
    bounds = min((_bounds(case, ends, b) for b in {one.b for one in ends}), key=lambda one: one.cost(enough))
    return _with_steps(case, steps, bounds) if steps is not None and bounds.by_steps else bounds


class _Ends(NamedTuple):
    """A decay of virtual states, by agent in floats: what it leaves at ``T``, what stands, and both of ``|e_k|``."""

    b: Fraction
    left: Fraction
    cap: Fraction | None
    at_T: np.ndarray
    floor: np.ndarray
    falling: np.ndarray | float = 0.0
    standing: np.ndarray | float = 0.0


def _of_row(case: LateCase, row: RowBound, rows: FollowerRows | None = None) -> _Ends:
    """Return the decay of a row of virtual states; without rows of a graph nothing of ``|e_k|``."""
    u, b = np.zeros(len(case.of.labels)), row.witness.b
    u[case.followers] = row.witness.u
    M, at_T, floor = (float_up(x) for x in (row.initial, row.initial * row.left + (row.drift or 0), row.floor))
    if rows is None:
        return _Ends(b, row.left, row.cap, u * at_T, u * floor)
    falling, standing = np.zeros((2, u.size))
    falling[case.followers] = (2 * rows.weights - float(b) * (1 - 1e-15)) * row.witness.u * M
    most, error = float_up(row.highest_floor(case)), float_up(case.exact.wrong)
    standing[case.followers] = most * rows.largest(row.witness.u) + error * rows.weights
    return _Ends(b, row.left, row.cap, u * at_T, u * floor, falling, standing)


def _bounds(case: LateCase, decays: Sequence[_Ends], b: Fraction) -> VehicleBounds:
    """Return what holds of vehicles with gains for a decay at the rate ``b``."""
    vehicles = case.messages.vehicles
    assert vehicles is not None
    a = Fraction(up(FASTER * b, 3))
    # of order 3 the second filter must outrun what the growth of the gain takes from it, too
    gains = (a, Fraction(up(a + FASTER / case.exact.gain.k, 3)), a) if 3 in vehicles.orders else (a, a)
    each = [_passed(case.exact, one, vehicles, gains) for one in decays]
    position, *capped = (np.minimum.reduce(bounds) for bounds in zip(*each, strict=True))
    velocity, push = capped or (None, None)
    return VehicleBounds(vehicles, gains, position, velocity, push)


def _tracking(messages: Messages, order: int, gains: tuple[Fraction, ...], b: Fraction) -> Tracking:
    return Tracking(order, gains, b, messages.gain.k, messages.least_gain())


def _passed(
    messages: Messages, decay: _Ends, vehicles: Vehicles, gains: tuple[Fraction, ...], lasting: bool = False
) -> list[np.ndarray]:
    """Return the bounds of all agents by one decay, in floats from above; infinite where it is too fast.

    Of positions at ``T``, or ``lasting`` at all times, of what disturbs.
    """
    pairs = [(decay.at_T, decay.floor), *[(decay.falling, decay.standing)] * 2]
    (speed, push), orders = vehicles.begun, np.array(vehicles.orders)
    found = [np.full(orders.size, np.inf) for _ in pairs[: 1 if messages.gain_cap is None else 3]]
    for order in np.unique(orders).tolist():
        tracking, of = _tracking(messages, order, gains, decay.b), orders == order
        if not tracking.follows:
            continue
        each = passed_on(messages, decay.left, decay.cap, tracking)
        if lasting and order > 1:
            each = (each[0]._replace(disturbed=tracking.steady), *each[1:])
        shaken = float_up(vehicles.disturbance)
        for bounds, passed, (falls, stands) in zip(found, each, pairs, strict=False):
            falling, standing, by_speed, by_push, disturbed = map(float_up, passed)
            bound = by_speed * speed + by_push * push + falling * falls + standing * stands + disturbed * shaken
            bounds[of] = (bound * _MORE + np.where(bound > 0, _LEAST, 0))[of]
    return found


def _along(case: LateCase, steps: Steps, bounds: VehicleBounds) -> tuple[VehicleSteps, Sequence[int], np.ndarray]:
    """Follow vehicles from instant to instant; return them at ``T``, and the last bounds of virtual states.

    And in every step what bounds ``|x_k - x*_k|``, ``(m, F)`` floats.
    """
    nodes, latency = case.followers.tolist(), case.messages.latencies(case.of)
    messages = replace(case.exact, latency=Numbers([latency] if isinstance(latency, Fraction) else latency))
    start, scale = Numbers(list(map(Fraction, steps.start.tolist()))).over(range(len(nodes)))
    assert isinstance(case.structure, Structure)
    walk = Walk(messages, checked_graph(case.structure), nodes, steps.instants, start, scale)
    a1, a2 = bounds.gains
    moved = VehicleSteps(walk, [abs(bounds.vehicles.v0[v]) for v in nodes], a1, a2)
    lags = np.array([float_up(walk.size * D / a1) for D in walk.steps.degrees])
    each = []
    for i, step in enumerate(walk):
        moved.step(i, step)
        each.append((float_up(walk.unit) * np.array(step.begin, float) + lags * np.array(moved.most, float)) * _MORE)
    return moved, step.end, np.array(each)


def deviations_by_steps(case: LateCase, steps: Steps, bounds: VehicleBounds) -> np.ndarray:
    """Return what bounds ``|x_k - x*_k|`` of vehicles in every step, ``(m, F)`` floats."""
    return _along(case, steps, bounds)[2]


def _with_steps(case: LateCase, steps: Steps, bounds: VehicleBounds) -> VehicleBounds:
    """Return the bounds with what follows from instant to instant, where that is less."""
    moved, last, _ = _along(case, steps, bounds)
    found: dict[str, Any] = {}
    for name, (factor, values) in moved.bounds(last).items():
        found[name] = getattr(bounds, name).copy()
        own = [float_up(factor * x) * _MORE for x in values]
        found[name][case.followers] = np.minimum(found[name][case.followers], own)
    return replace(bounds, **found)


def vehicles_section(bounds: VehicleBounds | None) -> VehiclesSection | None:
    """Return bounds of vehicles as files have them."""
    if bounds is None:
        return None
    numbers: dict[str, Any] = {
        name: None if (value := getattr(bounds, name)) is None else Numbers(value)
        for name in ("position", "velocity", "input")
    }
    of, (a1, a2, *third) = bounds.vehicles, bounds.gains
    if of.team is not None:
        numbers["orders"] = Numbers(list(map(Fraction, of.team)))
    if third:
        numbers |= {"a3": third[0], "a0": Numbers(of.a0)}
    return VehiclesSection(a1=a1, a2=a2, v0=Numbers(of.v0), disturbance=of.disturbance or None, **numbers)


def read_vehicles(section: VehiclesSection | None) -> VehicleBounds | None:
    """Return what an accepted certificate says of vehicles."""
    if section is None:
        return None
    position, velocity, push = (floats_up(x) for x in (section.position, section.velocity, section.input))
    assert position is not None
    v0 = tuple(section.v0)
    orders = (2,) * len(v0) if section.orders is None else tuple(map(int, section.orders))
    gains = section.a1, section.a2, *([] if section.a3 is None else [section.a3])
    a0 = None if section.a0 is None else tuple(section.a0)
    vehicles = Vehicles(v0, orders, a0, section.disturbance or Fraction(0))
    return VehicleBounds(vehicles, gains, position, velocity, push)
