"""What is asked of late messages and moving leaders: of whom, under which protocol, and what is known already."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import float_down, float_up
from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.bounds.decay import Decay
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.instants import Instants
from ptcc_certify.checker.input_formulas import BITS, Limits, decay_above, gain_above
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.message_ages import PARTS, Messages, Moving
from ptcc_certify.checker.reading import RejectedError
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import leading_group, listeners
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.model.moving_leaders import MovingLeaders

#: The largest exponent of what grows, in floats.
LARGEST_EXPONENT = 600
#: What is left is told to be at least this: less would take too many digits to write.
LEAST_LEFT = Fraction(1, 2**1000)


def left_above(x: Fraction) -> Fraction:
    """Bound ``e^-x`` from above by a number that is short enough for a file.

    Examples
    --------
    >>> float(left_above(Fraction(1))), left_above(Fraction(90_000)) == LEAST_LEFT
    (0.36787944117144233, True)
    """
    return max(rounded(decay_above(x), BITS, up=True), LEAST_LEFT)


@dataclass(frozen=True, eq=False)
class DecayingForm:
    """A Lyapunov function of a graph as bounds with late messages need it.

    Attributes
    ----------
    function : int
        Its number.
    form : Form
        In the coordinates ``E``.
    errors, deviations : sequence of N Fraction
        ``e_k^2 <= errors_k V``, ``(x_k - (Q x)_k)^2 <= deviations_k V``.
    """

    function: int
    form: Form
    errors: Sequence[Fraction]
    deviations: Sequence[Fraction]


class Moments(NamedTuple):
    """A decay of all agents over time: ``|x_k - x_k*|`` is at most what decays and what stands.

    Its rate, ``e^(-b s)`` of its clock, (M,), and by agent, (N, M) and (N, 1), in floats from above.
    """

    b: float
    y: np.ndarray
    decaying: np.ndarray
    standing: np.ndarray

    @property
    def bound(self) -> np.ndarray:
        """Their sum, ``(N, M)``."""
        return np.asarray((self.decaying + self.standing) * (1 + 1e-9))


def moments(
    case: LateCase,
    b: Fraction,
    away: Sequence[Fraction],
    moved: Sequence[Fraction],
    t: np.ndarray,
    cap: Fraction | None = None,
) -> Moments:
    """Return a decay ``|x_k - x_k*| <= away_k e^(-b s_c) + moved_k`` of all agents at instants, ``cap`` of its clock.

    Where values are off it is proved up to ``T`` alone: errors go on to push the agents after it.
    """
    y = case.decay(b, t, cap)
    first, standing = (np.array([[float_up(x)] for x in values]) for values in (away, moved))
    after = np.where((t > float(case.protocol.T)) & (case.messages.value_error > 0), np.inf, 0.0)
    return Moments(float(b), y, first * y + after, standing)


@dataclass(frozen=True, eq=False)
class LateCase:
    """A graph or a family whose messages are late, or whose leaders move.

    Parameters
    ----------
    structure : Structure or Family
        Of a family all bounds are by rows, for every signal.
    protocol : Protocol
        Its ``gain``; under the sliding-mode protocol with ``sigma(0) = 0``.
    messages : LateMessages
    initial_state : sequence of N Fraction, optional
    ends : sequence of N (middle, radius), optional
        Of ``Q X(0)``; without it bounds are for every initial state within 1 of its final one.
    influence : Influence, optional
        Exact; it belongs to ``forms``.
    forms : sequence of DecayingForm
        Lyapunov functions of the whole graph: they forgive small delays under a cap, or tell how leaders settle.

    Examples
    --------
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, 1)]))
    >>> case = LateCase(pair, NominalProtocol(), LateMessages({(1, 2): "0.1"}, gain_cap=9))
    >>> case.relative, case.least_cap(Fraction(4)), case.shares is None
    (True, Fraction(4, 1), True)
    """

    structure: Structure | Family
    protocol: Protocol
    messages: LateMessages
    initial_state: Sequence[Fraction] | None = None
    ends: Sequence[tuple[Fraction, Fraction]] | None = None
    influence: Influence | None = None
    forms: Sequence[DecayingForm] = ()

    @property
    def of(self) -> SignedDigraph | Family:
        """The graph or the family."""
        return self.structure.graph if isinstance(self.structure, Structure) else self.structure

    @property
    def graph(self) -> SignedDigraph:
        """The graph, if it is one."""
        assert isinstance(self.structure, Structure)
        return self.structure.graph

    @cached_property
    def followers(self) -> np.ndarray:
        """The agents that hear others, ascending; of a graph that has leaders in groups, others than these."""
        return self.structure.followers if isinstance(self.structure, Structure) else listeners(self.structure)

    @property
    def leaders(self) -> MovingLeaders | None:
        """How leaders move, and what disturbs followers; ``x*`` moves with the leaders. None of leaders at rest."""
        return self.messages.leaders

    @property
    def relative(self) -> bool:
        """Whether bounds are for every initial state within 1 of its final one, in place of the given state."""
        return self.initial_state is None or self.ends is None

    @property
    def of_whole_graph(self) -> bool:
        """Whether Lyapunov functions of the whole graph may say something of it: leaders rest, and ends are known."""
        known = self.initial_state is not None and self.influence is not None and self.influence.exact
        return known and self.leaders is None

    @property
    def state(self) -> Sequence[Fraction]:
        """The initial state, if there is one."""
        assert self.initial_state is not None
        return self.initial_state

    @cached_property
    def led_by_groups(self) -> bool:
        """Whether Lyapunov functions of a family may say something of it, where no rows do: leaders hear others."""
        assert isinstance(self.structure, Family)
        return self.messages.at_rest and leading_group(self.structure) is not None

    @cached_property
    def groups(self) -> list[int]:
        """The leaders of one graph that belong to groups."""
        assert isinstance(self.structure, Structure)
        return [v for c in self.structure.closed_components if len(c.nodes) > 1 for v in c.nodes]

    @cached_property
    def rows(self) -> list[dict[int, Fraction]]:
        """The rows of ``L`` of one graph."""
        return self.graph.exact_rows(range(self.graph.n_nodes))

    @cached_property
    def errors(self) -> list[Fraction]:
        """``E(0)`` of one graph."""
        return [-sum((x * self.state[v] for v, x in row.items()), Fraction(0)) for row in self.rows]

    @cached_property
    def shares(self) -> np.ndarray | None:
        """How old is what is heard over each edge in terms of the oldest, in 64ths, rounded up; None where all are 1.

        Of a family by ordered pair of an edge.
        """
        latencies, age = self.messages.latencies(self.of), self.messages.age
        if not isinstance(latencies, tuple) or not age:
            return None
        part = {x: math.ceil(PARTS * (x + self.messages.held) / age) for x in set(latencies)}
        return None if min(part.values()) == PARTS else np.array([part[x] / PARTS for x in latencies])

    @property
    def signed(self) -> bool:
        """Whether followers have a sign term."""
        return self.leaders is not None and self.leaders.sign_gain is not None

    @property
    def push(self) -> Fraction:
        """How fast a follower and its target may part: 0 with a sign term, which takes that up."""
        return Fraction(0) if self.leaders is None or self.signed else self.leaders.total

    @property
    def growth(self) -> Fraction:
        """At what rate agents that move by themselves part, at most."""
        return self.exact.growth

    def grown(self, growth: Fraction) -> Fraction:
        """Bound ``e^(growth T)`` from above.

        Raises
        ------
        NoCertificate
            It is too large.
        """
        if growth * self.protocol.T > LARGEST_EXPONENT:
            raise NoCertificate("agents part too fast by themselves")
        try:
            return self.exact.grown(growth)
        except RejectedError as error:
            raise NoCertificate(str(error)) from None

    # ------------------------------------------------------------------ the gain that acts

    @cached_property
    def exact(self) -> Messages:
        """What the formulas of the check know of the messages, latencies left out."""
        told, moving = self.messages, asked_leaders(self.leaders)
        late, latency = told.own_delay, Numbers([Fraction(0)])
        return Messages(self.protocol.gain.exact, latency, told.age, late, told.value_error, told.gain_cap, moving)

    def least_cap(self, cap: Fraction | None = None) -> Fraction | None:
        """Return the cap of the gain, or another one that is lower."""
        return min((x for x in (cap, self.messages.gain_cap) if x is not None), default=None)

    def limited(self, cap: Fraction | None = None) -> LimitedGain:
        """Return the gain that acts, under a cap."""
        return GainLimits(gain_cap=self.least_cap(cap)).limit(self.protocol.gain)

    def clock(self, cap: Fraction | None = None) -> Fraction | None:
        """Bound its integral up to ``T`` from below; None where it is infinite."""
        limit = self.least_cap(cap)
        return None if limit is None else Limits(limit).clock_below(self.protocol.gain.exact)

    def left(self, b: Fraction, cap: Fraction | None = None) -> Fraction:
        """Bound ``e^(-b s(T))`` of this integral from above."""
        clock = self.clock(cap)
        return Fraction(0) if clock is None else left_above(b * clock)

    def decay(
        self, b: Fraction, t: np.ndarray, cap: Fraction | None = None, growth: Fraction = Fraction(0)
    ) -> np.ndarray:
        """Bound ``e^(growth (t - T) - b s)`` of the same integral at instants, (M,) floats from above."""
        if growth:
            clock = np.asarray(self.limited(cap).clock(t))
            grows, falls = float_up(growth) * (t - float(self.protocol.T)), float_down(b) * clock
            size = grows - falls + 1e-12 * (np.abs(grows) + np.where(np.isinf(clock), 0, falls)) + 1e-12
            with np.errstate(over="ignore"):
                return np.where(np.isinf(clock), 0.0, np.exp(size) + 1e-300)
        return Decay(2 * float_down(b), 1.0).times(1.0, Instants(np.asarray(self.limited(cap).clock(t))))

    def highest(self, b: Fraction, cap: Fraction | None = None) -> Fraction:
        """Bound ``sup_t g e^(-b s)`` from above, ``g`` the gain that acts, which has a cap."""
        assert self.messages.gain_cap is not None
        return gain_above(self.protocol.gain.exact, self.messages.gain_cap, b, cap)

    def inputs(self, decay: DecayOfAll) -> np.ndarray:
        """Return what a decay says of ``|x_k'|`` up to ``T``, ``(N,)`` floats from above.

        Under a cap of the gain, or where nothing is late or off, of a decay that is fast enough; else infinite.
        """
        gain, p = self.exact.gain, decay.b * self.exact.gain.k
        if (cap := self.messages.gain_cap) is not None:
            y, steady = self.highest(decay.b, decay.cap), cap
        elif p > 1 or (p == 1 and not any(decay.standing)):
            y = self.exact.least_gain()
            steady = decay.b * y * (gain.rho1 * gain.T + gain.k) / (p - 1) if p > 1 else Fraction(0)
        else:
            return np.full(len(self.of.labels), np.inf)
        bounds = [float_up(x * y + steady * n) for x, n in zip(decay.falling, decay.standing, strict=True)]
        return self.of_nodes(decay.nodes, np.array(bounds) * (1 + 1e-9) + 1e-300)

    def of_nodes(self, nodes: Sequence[int], bounds: np.ndarray) -> np.ndarray:
        """Return bounds of some agents as those of all, infinite of others."""
        found = np.full((len(self.of.labels), *bounds.shape[1:]), np.inf)
        found[list(nodes)] = bounds
        return found


def asked_leaders(leaders: MovingLeaders | None) -> Moving | None:
    """Return how leaders move, as files have it; None of leaders at rest."""
    return None if leaders is None else Moving(**{one.name: getattr(leaders, one.name) for one in fields(Moving)})


def read_leaders(section: Moving) -> MovingLeaders:
    """Return what a file says of how leaders move."""
    return MovingLeaders(**vars(section))
