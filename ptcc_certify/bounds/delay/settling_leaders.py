"""Followers that hear late of leaders in groups, which hear each other at once and settle by themselves.

Leaders move as if nothing were late: ``|x_l - x_l*| <= sqrt(c_l V(0)) e^(-r s/2)`` by a Lyapunov function of rate
``r``, ``V(0)`` with followers whose errors are 0. With ``u_l`` no less than that for leaders, ``0 < b <= r/2`` and

    D_k u_k - sum_l q^(age_kl/age) |w_kl| u_l >= b u_k,  u_k >= |x_k(0) - x_k*|    for every follower k, over all l

``|x_k(t) - x_k*| <= u_k e^(-b s_c(t))`` for all agents, ``s_c`` the integral of ``min(gain, ln q/(b age))``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import log, rounded
from ptcc_certify.bounds.delay.small_delays import DecayingForm, left_above
from ptcc_certify.checker.input_formulas import BITS, Limits, root_above
from ptcc_certify.checker.late_input import gain_above
from ptcc_certify.checker.late_messages import PARTS
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.limited_gain import LimitedGain

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

    def deviation_bound(self, gain: LimitedGain, t: np.ndarray) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` at instants, ``(N, M)`` floats."""
        caps = [x for x in (self.cap, gain.limits.gain_cap) if x is not None]
        clock = GainLimits(gain_cap=min(caps)).limit(gain.gain).clock(t)
        u = np.array([float_up(x) for x in self.u])
        return np.asarray(u[:, None] * np.exp(-float(self.b) * clock) * (1 + _MORE))


class SettlingBounds:
    """Bounds of the agents of one graph whose leaders settle.

    Parameters
    ----------
    structure : Structure
    gain : LimitedGain
        The gain that acts.
    messages : LateMessages
        Leaders hear each other at once.
    initial_state : sequence of N Fraction
    ends : sequence of N (middle, radius)
        Of ``Q X(0)``.
    """

    def __init__(
        self,
        structure: Structure,
        gain: LimitedGain,
        messages: LateMessages,
        initial_state: Sequence[Fraction],
        ends: Sequence[tuple[Fraction, Fraction]],
    ):
        self.structure, self.gain, self.messages = structure, gain, messages
        graph, n = structure.graph, structure.graph.n_nodes
        rows = graph.exact_rows(range(n))
        self.errors = [-sum((x * initial_state[v] for v, x in row.items()), Fraction(0)) for row in rows]
        self.away = np.array([float_up(abs(x - m) + r) for x, (m, r) in zip(initial_state, ends, strict=True)])
        self.D = graph.in_weight()
        self.groups = [v for c in structure.closed_components if len(c.nodes) > 1 for v in c.nodes]
        latencies = messages.latencies(graph)
        each = latencies if isinstance(latencies, tuple) else (latencies,) * graph.n_edges
        self.W, self.shares = np.zeros((2, n, n))
        self.W[graph.target, graph.source] = np.abs(graph.weights)
        self.shares[graph.target, graph.source] = [math.ceil(PARTS * x / messages.age) / PARTS for x in each]

    def best(self, forms: Sequence[DecayingForm]) -> Settling | None:
        """Return what leaves least at ``T``; None if no function serves."""
        found = [bound for one in forms for bound in self._tried(one)]
        return min(found, key=lambda bound: float(max(bound.u) * bound.left), default=None)

    def inputs(self, bound: Settling) -> np.ndarray:
        """Return what bounds ``|x_k'|`` up to ``T`` under a capped gain, ``(N,)`` floats from above."""
        cap, u = self.messages.gain_cap, np.array([float_up(x) for x in bound.u])
        assert cap is not None
        y = float_up(gain_above(self.gain.gain.exact, cap, bound.b, bound.cap))
        most = self.D * u + self.W @ u
        F = self.structure.followers
        most[F] = (2 * self.D[F] - float(bound.b)) * u[F]
        return most * y * (1 + _MORE) + 1e-300

    def _tried(self, one: DecayingForm) -> Iterator[Settling]:
        """Yield bounds by one function, for some ``q`` and ``b``."""
        F, most = self.structure.followers, float(one.form.rate) / 2 * (1 - _MORE)
        leaders, root = np.zeros(self.D.size), self._root(one)
        exact = {v: rounded(root_above(one.deviations[v]) * root, BITS, up=True) for v in self.groups}
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
        rate, gain_cap = Fraction(b), self.messages.gain_cap
        cap = rounded(log(q)[0] / (rate * self.messages.age), BITS)
        clock = Limits(cap if gain_cap is None else min(cap, gain_cap)).clock_below(self.gain.gain.exact)
        u = [Fraction(0)] * self.D.size
        for v, x in (*leaders.items(), *zip(self.structure.followers.tolist(), own, strict=True)):
            u[v] = x if isinstance(x, Fraction) else rounded(Fraction(float(x)), BITS, up=True)
        left = left_above(rate * clock)
        return Settling(function, q, rate, cap, clock, left, tuple(u))

    def _root(self, one: DecayingForm) -> Fraction:
        """Bound ``sqrt(V(0))`` from above, followers where their errors are 0."""
        groups = set(self.groups)
        return root_above(one.form.value([self.errors[v] if v in groups else Fraction(0) for v in one.form.nodes]))
