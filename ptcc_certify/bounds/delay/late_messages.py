"""What holds with late messages and moving leaders: what is left at the deadline, by every kind of proof; stages.

Agents obey :mod:`ptcc_certify.model.late_messages` and :mod:`ptcc_certify.model.late_messages`. Followers of single
leaders are bounded row by row
(:mod:`ptcc_certify.bounds.delay.decay_by_rows`) and from instant to instant
(:mod:`ptcc_certify.bounds.delay.decay_by_steps`), all agents by a Lyapunov function of the whole graph.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.errors import LMIError
from lmi.exact.decimal_rounding import float_up, up
from ptcc_certify.bounds.delay.case import LARGEST_EXPONENT, LateCase, Settling, asked_leaders, read_leaders
from ptcc_certify.bounds.delay.certain_misses import Missed, find_missed, stage_deadlines
from ptcc_certify.bounds.delay.decay_by_rows import LOSSES_CLIPPED, MORE, RowBound, away, search_rows
from ptcc_certify.bounds.delay.decay_by_steps import Steps, bound_steps, search_steps
from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBound
from ptcc_certify.bounds.delay.forms_of_families import FamilyForm
from ptcc_certify.bounds.delay.small_delays import SmallDelays
from ptcc_certify.bounds.float_conversion import floats, floats_up
from ptcc_certify.bounds.instants import instants_from_0
from ptcc_certify.bounds.virtual_positions import (
    VehicleBounds,
    bound_vehicles,
    deviations_by_steps,
    read_vehicles,
    vehicles_section,
)
from ptcc_certify.checker.delay_lmi import LateLMIWitness
from ptcc_certify.checker.delayed_forms import LateFormWitness, SettlingWitness
from ptcc_certify.checker.forms_of_families import LateFamilyForm
from ptcc_certify.checker.message_ages import Delays, Packets
from ptcc_certify.checker.messages import MessagesSection, StepsStart
from ptcc_certify.checker.missed_deadline import Signs
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.section_declarations import RowVector, declared
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, pairs_of
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import FollowerRows, RowWitness
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.model.virtual_positions import TrackingProtocol, Vehicles
from ptcc_certify.theorems.theorem import Obligation


@dataclass(frozen=True, eq=False, repr=False)
class LateBounds:
    """What is proved of a graph or a family whose messages are late, or whose leaders move.

    Attributes
    ----------
    case : LateCase
        What it is proved of.
    relative : bool
        Whether bounds are for every initial state within 1 of its final one, in place of the given state.
    rows : tuple of RowBound
    steps : Steps or None
    missed : Missed or None
    staged : tuple of Fraction, or None
        Of every follower the deadline at which it is at its final state exactly; empty where information takes longer
        than ``T`` to come from leaders to all.
    residual : (N,) array or None
        What bounds ``|x_k(T) - x_k*|`` row by row, in floats from above; None where nothing does.
    of_all : tuple of Settling, SmallDelays, DelayLMIBound or FamilyForm
        What Lyapunov functions of the graph or the family prove of all agents, at every instant up to ``T``.
    longest_delay : float or None
        About the longest delay that such functions forgive: this certificate's limit. None if it was not asked.
    input : (N,) array or None
        What bounds ``|x_k'|`` up to ``T``, the sliding term left out, in floats from above; None where nothing does.
    enough : Fraction or None
        The age up to which no more is left than was asked, near to the longest one that is proved; all times of
        ``messages`` in proportion.
    vehicles : VehicleBounds or None
        What follows of vehicles that track these agents, which then are virtual.
    """

    case: LateCase
    relative: bool
    rows: tuple[RowBound, ...] = ()
    steps: Steps | None = None
    missed: Missed | None = None
    staged: tuple[Fraction, ...] | None = None
    residual: np.ndarray | None = None
    of_all: tuple[Settling | SmallDelays | DelayLMIBound | FamilyForm, ...] = ()
    longest_delay: float | None = None
    input: np.ndarray | None = None
    enough: Fraction | None = None
    vehicles: VehicleBounds | None = None

    @property
    def messages(self) -> LateMessages:
        """How late messages are."""
        return self.case.messages

    @property
    def structure(self) -> Structure | Family:
        """Of the graph, or the family."""
        return self.case.structure

    @property
    def graph(self) -> SignedDigraph | None:
        """The one graph; None of a family of others."""
        return self.structure.graph

    @property
    def tracks(self) -> bool:
        """Whether leaders move, and nothing is late, lost or rounded."""
        return self.messages.tracks

    @property
    def bounding_rho2(self) -> str | None:
        """A ``rho2`` of few digits with which the input stays bounded while leaders move; None without a bound."""
        if not self.rows:
            return None
        b, kappa = max(row.witness.b for row in self.rows), self.case.protocol.kappa
        return up(1 / (b * kappa) * Fraction(1001, 1000), 3)

    @property
    def gain(self) -> LimitedGain:
        """The gain that acts."""
        return self.case.limited()

    @property
    def leaders(self) -> MovingLeaders | None:
        """How leaders move, and what disturbs the followers; None if they rest, and nothing does."""
        return self.case.leaders

    @property
    def labels(self) -> Sequence[str]:
        """Of all agents."""
        return self.case.of.labels

    @property
    def missing(self) -> str:
        """What was not found, in words, where nothing is proved."""
        if self.case.exact.saturation is not None:
            return self._not_reached
        if self.case.growth * self.case.protocol.T > LARGEST_EXPONENT:
            return f"growth times T is above {LARGEST_EXPONENT}"
        of_groups = isinstance(self.structure, Family) and self.case.led_by_groups
        if of_groups and self.relative:
            return "it asks for an initial state"
        return f"no {'Lyapunov function that bears it' if of_groups else 'vector for the followers'} was found"

    @cached_property
    def _not_reached(self) -> str:
        """What it would take that inputs that are clipped bring followers to where they end, in words."""
        gain, rows = self.case.protocol.gain.exact, late_rows(self.case)
        first, enough, rates = away(self.case, rows), math.inf, [Fraction(0)]
        for loss in LOSSES_CLIPPED:
            with suppress(LMIError):
                witness = rows.witness(Fraction(1), loss)
                rates.append(witness.b)
                if witness.b * gain.k >= 1:
                    enough = min(enough, float((first / witness.u).max() * witness.u.max() / float(gain.T)))
        if math.isinf(enough):
            least = up(1 / (max(rates) * self.case.protocol.kappa), 3) if max(rates) else ""
            return f"it asks for rho2 of at least {least}" if least else "no vector for the followers was found"
        return f"it asks for inputs of at least {up(enough * (1 + 1e-6), 3)}"

    @cached_property
    def unreachable(self) -> tuple[str, Fraction] | None:
        """An agent that no inputs that are clipped so far bring to where it ends by ``T``, and how far it is off."""
        most, case = self.case.exact.saturation, self.case
        if most is None or case.relative or case.ends is None:
            return None
        reach = most * case.protocol.T
        off = [(abs(case.state[v] - case.ends[v][0]) - case.ends[v][1] - reach, v) for v in self.followers.tolist()]
        worst, agent = max(off)
        return (self.labels[agent], worst) if worst > 0 else None

    @property
    def whose(self) -> str:
        """Of whom something is proved, in a word: agents, or followers where leaders move as they like."""
        return "agent" if self.leaders is None or self.forms else "follower"

    @property
    def goal(self) -> str:
        """What they are near to, in words."""
        if self.forms:
            return "where it would settle" if self.messages.settles else "its target, which walks,"
        return "its final state" if self.leaders is None else f"its {self.leaders.goal}"

    @property
    def followers(self) -> np.ndarray:
        """The agents that are bounded, ascending."""
        return self.case.followers

    @property
    def of_followers(self) -> list[RowBound | Steps]:
        """What bounds deviations of followers at every instant up to ``T``; of leaders there are none."""
        return [*self.rows, *(() if self.steps is None else (self.steps,))]

    @property
    def settling(self) -> Settling | None:
        """What holds of followers that hear late of leaders in groups."""
        return next((one for one in self.of_all if isinstance(one, Settling)), None)

    @property
    def form(self) -> SmallDelays | None:
        """What a Lyapunov function of the whole graph proves."""
        return next((one for one in self.of_all if isinstance(one, SmallDelays)), None)

    @property
    def lmi(self) -> DelayLMIBound | None:
        """What the delay LMI proves of the whole graph under a capped gain."""
        return next((one for one in self.of_all if isinstance(one, DelayLMIBound)), None)

    @property
    def forms(self) -> tuple[FamilyForm, ...]:
        """What Lyapunov functions of a family prove, component by component."""
        return tuple(one for one in self.of_all if isinstance(one, FamilyForm))

    @property
    def says_something(self) -> bool:
        """Whether anything is proved."""
        return bool(self.of_followers or self.of_all or self.missed or self.staged)

    @property
    def residuals(self) -> list[np.ndarray]:
        """What bounds ``|x_k(T) - x_k*|``, of vehicles theirs, by one proof after the other: (N,) arrays.

        Agents move continuously: what bounds all from ``T`` on does so at ``T``, too.
        """
        if self.vehicles is None and self.direct:
            return [np.zeros(len(self.labels))]
        own = [self.residual, None if self.settling is None else self.settling.residual]
        own += [np.array([float_up(x) for x in one.residual]) for one in (self.form, self.lmi) if one is not None]
        found = [one for one in own if one is not None] if self.vehicles is None else [self.vehicles.position]
        return found if self.after is None else [*found, np.full(len(self.labels), self.after)]

    @property
    def largest(self) -> float:
        """The largest of the bounds of ``|x_k(T) - x_k*|``, of vehicles theirs; infinite where nothing is bounded."""
        return min((float(one.max()) for one in self.residuals), default=math.inf)

    def __repr__(self) -> str:
        size = up(self.largest, 2) if self.largest else "0"
        within = "nothing" if math.isinf(self.largest) else f"every {self.whose} within {size} of {self.goal}"
        return f"LateBounds({self.messages!r}: {within} at T)"

    @property
    def unarrived(self) -> bool:
        """Whether deadlines of stages fail since information takes longer than ``T`` to come from leaders to all."""
        return self.staged == ()

    @cached_property
    def after(self) -> float | None:
        """What bounds ``|x_k - x_k*|`` from ``T`` on where leaders move; None where they rest."""
        if self.leaders is None or (self.vehicles is not None and not self.rows):
            return None
        if self.vehicles is not None:
            return self.vehicles.after(self.case, self.rows)
        if self.forms:
            return self._after_by_forms
        rows = [row for row in self.rows if row.stays(self.case)]
        return min((float(row.residual(after=True).max()) for row in rows), default=None)

    @property
    def _after_by_forms(self) -> float | None:
        """What bounds the same from ``T`` on by forms: what decays goes on to do so, what drives add grows."""
        if not all(one.stays(self.case) for one in self.forms):
            return None
        times = np.concatenate([[1.0], np.geomspace(1.001, 1e9, 200)]) * float(self.case.protocol.T)
        return float(self.largest_bound(times).max())

    @cached_property
    def never_below(self) -> float | None:
        """What stays at least of the largest bound however large the gain, where leaders move while messages come.

        What no decay takes away obeys ``D_k y_k >= sum_l |w_kl| y_l + speed age D_k`` in every member, by rows as from
        instant to instant, and is above the least such ``y``. By rows more stays, how much depends on those found.
        """
        if self.leaders is None or not self.messages.age or not self.of_followers:
            return None
        error = float(self.leaders.speed * self.messages.age)
        return float(late_rows(self.case).kept_off(error).max()) / MORE

    @property
    def inputs(self) -> np.ndarray | None:
        """What bounds ``|u_k|`` up to ``T``, of vehicles theirs, the sliding term left out; None where nothing does."""
        if self.vehicles is not None:
            return self.vehicles.input
        return self._inputs_heard_right if self.input is None else self.input

    @property
    def heard_right(self) -> bool:
        """Whether followers hear what is so, and no sign term acts: nobody moves, or all hear leaders at rest alone."""
        bounds = [row.initial + row.highest_floor(self.case) for row in self.rows]
        return self.vehicles is None and not self.case.signed and (self.direct or not all(bounds or [True]))

    @cached_property
    def _inputs_heard_right(self) -> np.ndarray | None:
        """Bound ``|u_k|`` where followers hear what is so; None where they do not, or nothing is proved.

        It is 0 where nobody moves. Followers of leaders alone are off by ``e^(-D_k s)`` of what they are at first, and
        ``gain e^(-D_k s)`` is largest at first if ``D_k rho2 kappa >= 1``.
        """
        if not self.heard_right:
            return None
        bound = np.zeros(len(self.labels))
        if not self.direct:
            return bound
        rows, pole = late_rows(self.case), self.case.protocol.gain.pole
        doubtful = rows.followers[rows.D * float(pole) < 1 + 1e-9].tolist()
        degrees = (row[v] for v, row in zip(doubtful, self.case.graph.exact_rows(doubtful), strict=True))
        if not self.rows or any(degree * pole < 1 for degree in degrees):
            return None
        first = float_up(self.case.exact.least_gain())
        off = np.minimum.reduce([row.witness.u * float_up(row.initial) for row in self.rows])
        bound[self.followers] = first * rows.weights * off * MORE
        return bound

    @property
    def tracking_protocol(self) -> TrackingProtocol | None:
        """The protocol of vehicles that are bounded; None without them."""
        if self.vehicles is None:
            return None
        return TrackingProtocol(
            self.gain.gain, self.vehicles.gains, self.messages.gain_cap, self.vehicles.vehicles.team
        )

    @property
    def direct(self) -> bool:
        """Whether all followers hear of leaders alone, so that they settle at ``T`` exactly."""
        return self.staged is not None and len(set(self.staged)) == 1

    def deviation_bound(self, t: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` at instants, of vehicles theirs, ``(F, M)`` floats.

        Infinite where nothing does. While leaders rest it holds after ``T`` as before, for no proof asks how large the
        gain is; while they move :attr:`after` is what is proved then. Of vehicles nothing is after ``T`` without a cap.

        Parameters
        ----------
        t : (M,) array_like
            In units of time, from 0 on; one number counts as an array of one.

        Raises
        ------
        ParameterError
            An instant is before 0, or no number.

        Examples
        --------
        >>> late = certify(SignedDigraph.from_edges([("a", "b", 1)]), NominalProtocol(rho1="0.1"), [0, 5],
        ...     messages=LateMessages("0.01", gain_cap=20), leaders=MovingLeaders(speed=1)).late
        >>> bool(late.deviation_bound(1.5).max() <= late.after)
        True
        """
        t = instants_from_0(t)
        if self.vehicles is not None:
            return self.vehicles_over_time(t)[0][self.followers]
        least = np.full((self.followers.size, t.size), np.inf)
        bounds = [one.deviation_bound(self.case, t) for one in self.of_followers]
        bounds += [one.over_time(self.case, t).bound[self.followers] for one in self.of_all]
        settled = self.direct & (t > float(self.case.protocol.T))
        return np.where(settled, 0.0, np.minimum.reduce([least, *bounds]))

    def vehicles_over_time(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what bounds deviations and velocities of vehicles at instants, ``(N, M)`` floats.

        See :meth:`ptcc_certify.bounds.virtual_positions.VehicleBounds.over_time`.
        """
        assert self.vehicles is not None
        position, velocity = self.vehicles.over_time(self.case, [*self.rows, *self.of_all], t)
        if self.steps is not None and self.vehicles.by_steps:
            before = t <= float(self.case.protocol.T)
            steps = np.searchsorted([float(x) for x in self.steps.instants[1:-1]], t[before] * (1 - 1e-15))
            own = np.full(position.shape, np.inf)
            own[np.ix_(self.followers, before)] = self._vehicles_by_steps[steps].T
            position = np.minimum(position, own)
        return position, velocity

    @cached_property
    def _vehicles_by_steps(self) -> np.ndarray:
        assert self.vehicles is not None
        assert self.steps is not None
        return deviations_by_steps(self.case, self.steps, self.vehicles)

    def largest_bound(self, t: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return what bounds the largest of these of all agents, ``(M,)`` floats, as :meth:`deviation_bound` does."""
        t = instants_from_0(t)
        if self.vehicles is not None:  # leaders that have a velocity move, too
            return np.asarray(self.vehicles_over_time(t)[0].max(axis=0))
        least = self.deviation_bound(t).max(axis=0, initial=0)
        if self.of_all:  # leaders deviate, too
            leaders = np.setdiff1d(np.arange(len(self.labels)), self.followers)
            bounds = [one.over_time(self.case, t).bound[leaders] for one in self.of_all]
            least = np.maximum(least, np.minimum.reduce(bounds).max(axis=0, initial=0))
        return np.asarray(least)


def bound_late(case: LateCase) -> LateBounds:
    """Bound what late messages leave at the deadline, by rows: nothing where leaders or the own state forbid them.

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
    >>> messages = LateMessages(delay="0.01")
    >>> bounds = bound_late(LateCase(structure, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), messages))
    >>> bounds.residual.max() < 0.5
    np.True_
    """
    messages, of_graph = case.messages, isinstance(case.structure, Structure)
    messages.latencies(case.of)
    bounds = LateBounds(case, case.relative)
    if (messages.own_delay or case.groups) if of_graph else case.led_by_groups:
        return bounds
    rows = late_rows(case)
    first, steps = away(case, rows), None
    found = search_rows(case, rows, first)
    followed = messages.age or (messages.vehicles is not None and messages.gain_cap is not None)
    if followed and of_graph and not case.signed:
        with suppress(LMIError):
            steps = search_steps(case, rows, first)
    each = [one.residual() for one in (*found, steps) if one is not None]
    inputs = [row.inputs(case, rows) for row in found] + ([] if steps is None else [steps.inputs(rows)])
    push = _least(rows, [bound for bound in inputs if bound is not None])
    bounds = replace(bounds, rows=found, steps=steps, residual=_least(rows, each), input=push)
    if messages.vehicles is not None:
        return replace(bounds, vehicles=bound_vehicles(case, found, rows, steps))
    if not _may_be_staged(case):
        return bounds
    missed = find_missed(case, rows.followers.tolist())
    return replace(bounds, missed=missed, staged=stage_deadlines(rows, case.protocol.T, messages.age))


def _may_be_staged(case: LateCase) -> bool:
    """Tell whether late messages of a graph are all that keeps followers of single leaders from settling exactly."""
    told = case.messages
    alone = not (told.own_delay or told.value_error or told.gain_cap is not None or told.vehicles or case.leaders)
    return alone and isinstance(case.structure, Structure) and not case.groups


def late_rows(case: LateCase) -> FollowerRows:
    """Return the rows of the followers of single leaders, with ages of what is heard by edge."""
    return FollowerRows(case.structure, case.shares)


def _least(rows: FollowerRows, bounds: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the least of bounds of followers, for all agents; None where some is beyond the range of floats."""
    if not bounds:
        return None
    whole = np.zeros(rows.n_nodes)
    whole[rows.followers] = np.minimum.reduce(bounds)
    return whole if np.isfinite(whole).all() else None


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
        psi = None if form.psi is None else Numbers(form.psi)
        phi = LateFormWitness(function=form.function, phi=Numbers(form.phi), psi=psi)
        yield Obligation("late-form", "messages.form", numbers, phi)
    for i, one in enumerate(late.forms):
        numbers = {"q": one.q, "b": one.b, "kap": one.kap}
        psi = None if one.psi is None else Numbers(one.psi)
        phi = LateFormWitness(function=one.function, phi=Numbers(one.phi), psi=psi)
        yield Obligation("late-form", f"messages.forms[{i}]", numbers, phi)
    if (lmi := late.lmi) is not None:
        floating: Any = [list(map(float, row)) for row in (*lmi.matrix, lmi.tau)]  # dyadic numbers, and short texts
        errors = None if lmi.errors is None else Numbers(lmi.errors)
        matrix = LateLMIWitness(matrix=floating[:-1], tau=floating[-1], errors=errors)
        yield Obligation("late-lmi", "messages.lmi", {"b": lmi.b}, matrix)


def delays(messages: LateMessages, of: SignedDigraph | Family) -> Delays:
    """Return how late, how often lost and how inexact messages are, as files have it."""
    period, latency = messages.period, messages.latencies(of)
    return Delays(
        latency=latency if isinstance(latency, Fraction) else Numbers(latency),
        packets=None if period is None else Packets(period=period, losses=Fraction(messages.losses)),
        delay=messages.age,
        own="late" if messages.own_delay else "fresh",
        value_error=messages.value_error,
        gain_cap=messages.gain_cap,
        leaders=asked_leaders(messages.leaders),
    )


def messages_section(late: LateBounds) -> MessagesSection:
    """Return what is proved with late messages, as files have it."""
    proved: dict[str, Any] = {f.name: getattr(late, f.name) for f in declared(MessagesSection) if hasattr(late, f.name)}
    forms = [_form_section(one) for one in late.forms]
    proved |= {"vehicles": vehicles_section(late.vehicles), "staged": late.staged or None, "forms": forms or None}
    return MessagesSection(**proved | vars(delays(late.messages, late.case.of)))


def _form_section(one: FamilyForm) -> LateFamilyForm:
    """Return what a Lyapunov function of a family proves, as files have it."""
    sizes = None if one.sizes is None else Numbers(one.sizes)
    told = {key: getattr(one, key) for key in ("initial", "left", "floor", "push", "growth")}
    return LateFamilyForm(nodes=np.array(one.nodes), sizes=sizes, **told)


def read_late(
    report: CheckReport, structure: Structure | Family, protocol: Protocol, relative: bool
) -> LateBounds | None:
    """Return what an accepted certificate says of late messages; None if it says nothing."""
    section: MessagesSection | None = report.sections.get("messages")
    if section is None:
        return None
    vehicles = read_vehicles(section.vehicles)
    messages = read_messages(section, structure, None if vehicles is None else vehicles.vehicles)
    proved, case, rows = report.proved, LateCase(structure, protocol, messages), []
    for i, row in enumerate(section.rows):
        step = proved["late-rows", f"messages.rows[{i}]"]
        rows.append(RowBound(RowWitness(step["q"], step["b"], floats(step["witness"].u)), **vars(row)))
    missed, steps = None, None
    if section.missed is not None:
        gauge = np.array(proved["late-missed", "messages.missed"]["witness"].gauge)
        missed = Missed(section.missed.agent, section.missed.bound, gauge)
    if section.steps is not None:
        start = floats(proved["late-steps", "messages.steps"]["witness"].start)
        steps = bound_steps(case, late_rows(case), tuple(section.steps.instants), start)
    staged = None if section.staged is None else tuple(section.staged)
    if staged is None and _may_be_staged(case) and stage_deadlines(late_rows(case), protocol.T, messages.age) == ():
        staged = ()  # which files leave out
    return LateBounds(
        case,
        relative,
        rows=tuple(rows),
        steps=steps,
        missed=missed,
        staged=staged,
        residual=floats_up(section.residual),
        of_all=(*_of_whole_graph(section, proved), *_read_forms(case, section, proved)),
        input=floats_up(section.input),
        vehicles=vehicles,
    )


def _read_forms(case: LateCase, section: MessagesSection, proved: Any) -> Iterator[FamilyForm]:
    """Yield what Lyapunov functions of a family prove."""
    index = {label: v for v, label in enumerate(case.of.labels)} if section.forms else {}
    for i, entry in enumerate(section.forms or ()):
        step = proved["late-form", f"messages.forms[{i}]"]
        witness, (q, b, kap) = step["witness"], (step[key] for key in ("q", "b", "kap"))
        nodes, phi = tuple(index[label] for label in entry.nodes), tuple(witness.phi)
        sizes, psi = (None if one is None else tuple(one) for one in (entry.sizes, witness.psi))
        said = entry.initial, entry.left, entry.floor, entry.push, sizes, psi, entry.growth
        yield FamilyForm(witness.function, nodes, q, b, kap, phi, *said)


def _of_whole_graph(section: MessagesSection, proved: Any) -> Iterator[Any]:
    """Yield what Lyapunov functions of the whole graph prove: fields of sections, obligations and witnesses."""
    for kind, name in ((Settling, "settling"), (SmallDelays, "form"), (DelayLMIBound, "lmi")):
        if (own := getattr(section, name)) is not None:
            step = proved[f"late-{name}", f"messages.{name}"]
            known = {**step, **vars(step["witness"]), **vars(own)}
            yield kind(**{field.name: _fixed(known[field.name]) for field in fields(kind)})


def _fixed(value: Any) -> Any:
    """Return lists of numbers, and of such lists, as tuples."""
    return tuple(map(_fixed, value)) if isinstance(value, list | tuple | Numbers) else value


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
        leaders=None if section.leaders is None else read_leaders(section.leaders),
    )
