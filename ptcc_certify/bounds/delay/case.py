"""What is asked of late messages and moving leaders: of whom, under which protocol, and what is known already.

Followers that hear late of leaders in groups, which hear each other at once and settle by themselves.

Leaders move as if nothing were late: ``|x_l - x_l*| <= sqrt(c_l V(0)) e^(-r s/2)`` by a Lyapunov function of rate
``r``, ``V(0)`` with followers whose errors are 0. With ``u_l`` no less than that for leaders, ``0 < b <= r/2`` and

    D_k u_k - sum_l q^(age_kl/age) |w_kl| u_l >= b u_k,  u_k >= |x_k(0) - x_k*|    for every follower k, over all l

``|x_k(t) - x_k*| <= u_k e^(-b s_c(t))`` for all agents, ``s_c`` the integral of ``min(gain, ln q/(b age))``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import float_down, float_up
from lmi.exact.elementary_enclosures import log, rounded
from ptcc_certify.bounds.decay import Decay
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.instants import Instants
from ptcc_certify.checker.input_formulas import BITS, Limits, decay_above, gain_above, root_above
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.message_ages import PARTS, Messages, Moving
from ptcc_certify.checker.reading import RejectedError
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import leading_group, listeners
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.limited_gain import LimitedGain

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


#: Values of ``q`` that are tried, and the largest one; shares of the largest ``b``.
_TRIED, _LARGEST_Q, _SHARES = 16, 1e9, (0.3, 0.6, 0.85, 0.97)
#: Room for rounding, relatively.
_MORE = 1e-9


@dataclass(frozen=True, eq=False)
class Settling:
    """A bound of all agents: ``|x_k(t) - x_k*| <= u_k e^(-b s_c(t))``, at ``T`` with ``left`` in place of the power.

    Attributes
    ----------
    function : int
        The number of the Lyapunov function of the leaders.
    q, b, cap : Fraction
    clock, left : Fraction
        ``s_c(T)`` from below, ``e^(-b s_c(T))`` from above.
    u : tuple of N Fraction
    """

    function: int
    q: Fraction
    b: Fraction
    cap: Fraction
    clock: Fraction
    left: Fraction
    u: tuple[Fraction, ...]

    @property
    def residual(self) -> np.ndarray:
        """What bounds ``|x_k(T) - x_k*|``, ``(N,)`` floats from above."""
        return np.array([float_up(x * self.left) for x in self.u])

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds ``|x_k - x_k*|`` at instants."""
        return moments(case, self.b, self.u, [Fraction(0)] * len(self.u), t, self.cap)


class SettlingBounds:
    """Bounds of the agents of one graph whose leaders settle.

    Parameters
    ----------
    case : LateCase
        With an initial state; leaders hear each other at once.
    """

    @staticmethod
    def asked(case: LateCase) -> bool:
        """Tell whether leaders of a case form groups, and settle by themselves."""
        structure = case.structure
        if case.messages.value_error or case.messages.own_delay:
            return False
        if case.relative or not case.forms or not case.messages.age or not isinstance(structure, Structure):
            return False
        return bool(case.groups and structure.followers.size) and case.messages.leaders_hear_at_once(structure)

    def __init__(self, case: LateCase):
        graph, n = case.graph, case.graph.n_nodes
        self.case, self.followers, self.D = case, case.followers, graph.in_weight()
        each = zip(case.state, case.ends or (), strict=True)
        self.away = np.array([float_up(abs(x - m) + r) for x, (m, r) in each])
        self.W, self.shares = np.zeros((2, n, n))
        self.W[graph.target, graph.source] = np.abs(graph.weights)
        self.shares[graph.target, graph.source] = 1 if case.shares is None else case.shares

    def best(self) -> tuple[Settling, DecayOfAll] | None:
        """Return what leaves least at ``T``, and what it says of all agents; None if no function serves."""
        found = [bound for one in self.case.forms for bound in self._tried(one)]
        if not found:
            return None
        best = min(found, key=lambda bound: float(max(bound.u) * bound.left))
        u, F, nothing = np.array([float_up(x) for x in best.u]), self.followers, [Fraction(0)] * self.D.size
        most = self.D * u + self.W @ u
        most[F] = (2 * self.D[F] - float(best.b)) * u[F]
        falling = [Fraction(x) for x in (most * (1 + _MORE)).tolist()]
        return best, DecayOfAll(range(u.size), best.b, best.cap, best.left, best.u, nothing, falling, nothing)

    def _tried(self, one: DecayingForm) -> Iterator[Settling]:
        """Yield bounds by one function, for some ``q`` and ``b``."""
        F, most = self.followers, float(one.form.rate) / 2 * (1 - _MORE)
        leaders, root = np.zeros(self.D.size), self._root(one)
        exact = {v: rounded(root_above(one.deviations[v]) * root, BITS, up=True) for v in self.case.groups}
        leaders[list(exact)] = [float_up(x) for x in exact.values()]
        for tried in np.exp(math.log(_LARGEST_Q) * np.linspace(0, 1, _TRIED + 1)[1:] ** 3):
            q = round_to_bits(float(tried), 24)
            heard = (self.W * float(q) ** self.shares)[F]
            A = np.diag(self.D[F] * (1 - _MORE)) - heard[:, F] * (1 + _MORE)
            largest = float(np.linalg.eigvals(A).real.min())
            if not largest > 0:
                return
            for b in {min(most, share * largest) for share in _SHARES}:
                low = np.linalg.solve(A - b * np.eye(F.size), heard @ leaders * (1 + _MORE))
                flat = np.linalg.solve(A - b * np.eye(F.size), np.ones(F.size))
                u = np.maximum(low, 0) + max(float(((self.away[F] - low) / flat).max()), _MORE) * flat
                if np.isfinite(u).all() and (flat > 0).all() and (u >= self.away[F]).all():
                    yield self._bound(one.function, Fraction(q), b, exact, u * (1 + _MORE))

    def _bound(self, function: int, q: Fraction, b: float, leaders: dict[int, Fraction], own: np.ndarray) -> Settling:
        rate, u = Fraction(b), [Fraction(0)] * self.D.size
        cap = rounded(log(q)[0] / (rate * self.case.messages.age), BITS)
        for v, x in (*leaders.items(), *zip(self.followers.tolist(), own, strict=True)):
            u[v] = x if isinstance(x, Fraction) else rounded(Fraction(float(x)), BITS, up=True)
        clock = self.case.clock(cap)
        assert clock is not None
        return Settling(function, q, rate, cap, clock, self.case.left(rate, cap), tuple(u))

    def _root(self, one: DecayingForm) -> Fraction:
        """Bound ``sqrt(V(0))`` from above, followers where their errors are 0."""
        groups, errors = set(self.case.groups), self.case.errors
        return root_above(one.form.value([errors[v] if v in groups else Fraction(0) for v in one.form.nodes]))
