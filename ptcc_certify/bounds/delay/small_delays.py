"""Small delays of a whole graph under a capped gain, whoever leads: a Lyapunov function that forgives them.

The gain is at most ``G``, ``h = G delay``. ``B`` is ``|W|``, or ``|L|`` where the own state is late as well. With ``V =
E'P E`` of rate ``r``, ``e_k^2 <= c_k V``, ``q >= e^(b h)`` and

    phi_k >= sqrt(c_k) + h q (B phi)_k,    kap^2 >= (B phi)' |L'P L| (B phi),    b + h q kap <= r/2

``sqrt(V(t)) <= e^(-b s(t)) sqrt(V(0))``, ``s`` the capped clock; and the agents are drawn to a state that differs from
``Q X(0)`` by at most ``(h q/b) |Q| B phi sqrt(V(0))``. Nothing settles at ``T``.

Where values are off by ``error``, with ``off = h B psi + error D``, ``D`` the sums of ``|w_kl|``, and

    psi_k >= sqrt(c_k) f + off_k,    f r/2 >= sqrt(off' |L'P L| off)

``f`` is added to the root, and ``|Q| off s(T)`` to how far agents are drawn off. Where nothing is late or off the same
is said without a cap: it is what holds of the graph as it stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.exact.elementary_enclosures import exp, rounded
from ptcc_certify.bounds.delay.case import DecayingForm, LateCase, Moments, moments
from ptcc_certify.checker.input_formulas import BITS, Limits, root_above
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.structure import Structure

#: Halvings of the interval of ``b``, and of the longest delay.
_HALVINGS = 40
#: Room for rounding, relatively; of what errors add.
_MORE, _ROOM = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class SmallDelays:
    """What a Lyapunov function proves with late messages and a capped gain.

    Attributes
    ----------
    function : int
        Its number.
    q, b, kap : Fraction
    phi : tuple of N Fraction
    left : Fraction
        ``e^(-b s(T))`` from above.
    moved, away, residual : tuple of N Fraction
        How far from ``Q X(0)`` agents are drawn to up to ``T``, what beside that decays of their deviations, where they
        are at first, and how far from ``Q X(0)`` they are at ``T``, from above.
    floor : Fraction or None
        ``f``; None where no value is off.
    psi : tuple of N Fraction, or None
    """

    function: int
    q: Fraction
    b: Fraction
    kap: Fraction
    phi: tuple[Fraction, ...]
    left: Fraction
    moved: tuple[Fraction, ...]
    away: tuple[Fraction, ...]
    residual: tuple[Fraction, ...]
    floor: Fraction | None = None
    psi: tuple[Fraction, ...] | None = None

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds ``|x_k - (Q X(0))_k|`` at instants."""
        return moments(case, self.b, self.away, self.moved, t)


class SmallDelayBounds:
    """Bounds of one graph under one capped gain, or where nothing is late or off.

    Parameters
    ----------
    case : LateCase
        With an exact influence, and an initial state.
    """

    @staticmethod
    def asked(case: LateCase) -> bool:
        """Tell whether such bounds are asked of a case."""
        messages = case.messages
        known = not (messages.value_error and messages.own_delay)
        return case.of_whole_graph and known and (messages.exact or messages.gain_cap is not None) and bool(case.forms)

    def __init__(self, case: LateCase):
        n, own, cap = case.graph.n_nodes, case.messages.own_delay, case.messages.gain_cap
        assert case.influence is not None
        self.case, self.influence, self.late = case, case.influence, (cap or Fraction(0)) * case.messages.age
        self.far = Fraction(0) if cap is None else Limits(cap).clock_above(case.protocol.gain.exact)
        self.B = [{v: abs(x) for v, x in row.items() if own or v != k} for k, row in enumerate(case.rows)]
        self._B = np.array([[float(row.get(v, 0)) for v in range(n)] for row in self.B])
        self._L = np.array([[float(row.get(v, 0)) for v in range(n)] for row in case.rows])

    def best(self) -> tuple[SmallDelays, DecayOfAll] | None:
        """Return what leaves least at ``T``, times the largest input, and what it says of all agents.

        Where nothing is left, of the fastest function. None if no function forgives this delay.
        """
        found = [self._decay(one, bound) for one in self.case.forms if (bound := self.bound(one)) is not None]
        return min(found, key=self._cost, default=None)

    def _decay(self, one: DecayingForm, bound: SmallDelays) -> tuple[SmallDelays, DecayOfAll]:
        root, nothing = self._root(one), (Fraction(0),) * len(bound.phi)
        falling = [root * x for x in bound.phi]
        moved, psi, nodes = bound.moved, bound.psi or nothing, range(len(falling))
        return bound, DecayOfAll(nodes, bound.b, None, bound.left, bound.away, moved, falling, psi)

    def _cost(self, found: tuple[SmallDelays, DecayOfAll]) -> tuple[float, float]:
        bound, decay = found
        push = 1.0 if self.case.messages.gain_cap is None else float(self.case.inputs(decay).max())
        return float(max(bound.residual)) * push, -float(bound.b)

    def longest_delay(self) -> float:
        """Return the longest delay that some function forgives, about: this certificate's limit, not the loop's."""
        longest, cap = 0.0, float(self.case.messages.gain_cap or math.inf)
        for one in self.case.forms:
            low, high = 0.0, float(one.form.rate) / cap
            weights = self._weights(one)
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                low, high = (middle, high) if self._largest_b(one, weights, middle * cap) else (low, middle)
            longest = max(longest, low)
        return longest

    def bound(self, one: DecayingForm) -> SmallDelays | None:
        """Return what one function proves; None if it does not forgive this delay."""
        h = self.late
        guess = self._largest_b(one, self._weights(one), float(h))
        if not guess:
            return None
        b = Fraction(guess)
        q = rounded(exp(b * h)[1], BITS, up=True)
        phi = self._phi(one, float(h * q))
        if phi is None:
            return None
        exact = [rounded(Fraction(x), BITS, up=True) for x in phi]
        pushed = [sum((x * exact[v] for v, x in row.items()), Fraction(0)) for row in self.B]
        kap = Fraction(self._kap(self._weights(one), np.array([float(x) for x in pushed])) * (1 + _MORE))
        left = self.case.left(b)
        root = self._root(one)
        floor, psi, off = self._errors(one)
        walks = [h * q / b * root * x + self.far * y for x, y in zip(pushed, off, strict=True)]
        moved, away, residual = list[Fraction](), list[Fraction](), list[Fraction]()
        for k, c in enumerate(one.deviations):
            share = sum((abs(Fraction(x)) * walks[v] for v, x in self.influence.row(k).items()), Fraction(0))
            size = root_above(c * (1 + Fraction(_MORE)))
            moved.append(rounded(share + size * floor, BITS, up=True))
            away.append(rounded(size * root, BITS, up=True))
            residual.append(rounded(moved[-1] + away[-1] * left, BITS, up=True))
        found = SmallDelays(one.function, q, b, kap, tuple(exact), left, tuple(moved), tuple(away), tuple(residual))
        return found if psi is None else replace(found, floor=floor, psi=psi)

    def _errors(self, one: DecayingForm) -> tuple[Fraction, tuple[Fraction, ...] | None, list[Fraction]]:
        """Return ``f``, ``psi`` and ``off`` of a function that forgives the delay: nothing where no value is off."""
        error, n = self.case.messages.value_error, len(one.errors)
        if not error:
            return Fraction(0), None, [Fraction(0)] * n
        late, weights, D = float(self.late), self._weights(one), self._B.sum(axis=1)
        first = np.sqrt([float(c) for c in one.errors]) * (1 + _MORE)
        # psi = f a + c, with a = sqrt(c) + h B a and c = error D + h B c
        a, c = (np.linalg.solve(np.eye(n) - late * self._B, x) for x in (first, float(error) * D))
        pushed, rate = self._kap(weights, late * (self._B @ a)), float(one.form.rate) / 2
        floor = self._kap(weights, late * (self._B @ c) + float(error) * D) / (rate - pushed) * (1 + _ROOM)
        psi = [rounded(Fraction(x), BITS, up=True) for x in ((floor * a + c) * (1 + _ROOM)).tolist()]
        off = [sum((self.late * x * psi[v] + error * x for v, x in row.items()), Fraction(0)) for row in self.B]
        return Fraction(floor) * (1 + Fraction(_ROOM)), tuple(psi), off

    def _root(self, one: DecayingForm) -> Fraction:
        """Bound ``sqrt(V(0))`` from above."""
        return root_above(one.form.value([self.case.errors[v] for v in one.form.nodes]))

    def _weights(self, one: DecayingForm) -> np.ndarray:
        """Return ``|L'P L|`` in floats."""
        P, scale = one.form.entries
        L = self._L[list(one.form.nodes)]
        return np.abs(L.T @ np.array([[x / scale for x in row] for row in P]) @ L)

    def _phi(self, one: DecayingForm, lag: float) -> np.ndarray | None:
        """Return ``phi`` with some room; None if ``lag B`` is no contraction."""
        first = np.sqrt([float(c) for c in one.errors]) * (1 + _MORE)
        try:
            phi = np.linalg.solve(np.eye(first.size) - lag * self._B, first + _MORE * first.max())
        except np.linalg.LinAlgError:  # an eigenvalue of ``lag B`` is 1
            return None
        good = (
            np.isfinite(phi).all()
            and (phi >= first).all()
            and (phi >= first + lag * (self._B @ phi) * (1 - 1e-6)).all()
        )
        if not good or np.abs(np.linalg.eigvals(lag * self._B)).max(initial=0.0) >= 1:
            return None
        return phi

    def _kap(self, weights: np.ndarray, pushed: np.ndarray) -> float:
        return float(np.sqrt(max(pushed @ weights @ pushed, 0.0)))

    def _largest_b(self, one: DecayingForm, weights: np.ndarray, h: float) -> float:
        """Return about the largest ``b`` with ``b + h q kap <= r/2``; 0 if there is none."""

        def excess(b: float) -> float:
            lag = h * float(np.exp(b * h))
            phi = self._phi(one, lag)
            return np.inf if phi is None else b + lag * self._kap(weights, self._B @ phi) - rate

        rate = float(one.form.rate) / 2 * (1 - 1e-6)
        low, high = 0.0, rate
        if not excess(0.0) < 0:
            return 0.0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if excess(middle) <= 0 else (low, middle)
        return low * (1 - 1e-6)


def delay_threshold(structure: Structure, gain: float) -> float:
    """Return the delay from which on constant gain with a late own state does not settle, in floats.

    ``gain delay |lambda| < pi/2 - |arg lambda|`` for all nonzero eigenvalues ``lambda`` of ``L``: the first crossing of
    the imaginary axis. Every strong component by itself.

    Parameters
    ----------
    structure : Structure
    gain : float
        Positive.

    Returns
    -------
    float
        In units of time; infinite where nobody listens to anybody.

    Examples
    --------
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)]))
    >>> round(delay_threshold(pair, 10), 6)  # pi/2 / (10 * 2)
    0.07854
    """
    L, least = structure.graph.dense_laplacian(), np.inf
    for part in range(int(structure.strong_component.max()) + 1):
        nodes = np.flatnonzero(structure.strong_component == part)
        for value in np.linalg.eigvals(L[np.ix_(nodes, nodes)]):
            if abs(value) > 1e-9 * max(np.abs(L).max(), 1e-300):
                least = min(least, (np.pi / 2 - abs(np.angle(value))) / (gain * abs(value)))
    return float(least)
