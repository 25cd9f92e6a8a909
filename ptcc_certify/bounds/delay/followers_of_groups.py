"""Followers that hear late of leaders in groups, which hear each other at once and settle by themselves.

Leaders move as if nothing were late: ``|x_l - x_l*| <= sqrt(c_l V(0)) e^(-r s/2)`` by a Lyapunov function of rate
``r``, ``V(0)`` with followers whose errors are 0. With ``u_l`` no less than that for leaders, ``0 < b <= r/2`` and

    D_k u_k - sum_l q^(age_kl/age) |w_kl| u_l >= b u_k,  u_k >= |x_k(0) - x_k*|    for every follower k, over all l

``|x_k(t) - x_k*| <= u_k e^(-b s_c(t))`` for all agents, ``s_c`` the integral of ``min(gain, ln q/(b age))``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import log, rounded
from ptcc_certify.bounds.delay.case import DecayingForm, LateCase, Moments, moments
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.structure import Structure

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
