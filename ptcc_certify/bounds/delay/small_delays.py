"""Small delays of a whole graph under a capped gain, whoever leads: a Lyapunov function that forgives them.

The gain is at most ``G``, ``h = G delay``. ``B`` is ``|W|``, or ``|L|`` where the own state is late as well. With ``V =
E'P E`` of rate ``r``, ``e_k^2 <= c_k V``, ``q >= e^(b h)`` and

    phi_k >= sqrt(c_k) + h q (B phi)_k,    kap^2 >= (B phi)' |L'P L| (B phi),    b + h q kap <= r/2

``sqrt(V(t)) <= e^(-b s(t)) sqrt(V(0))``, ``s`` the capped clock; and the agents are drawn to a state that differs from
``Q X(0)`` by at most ``(h q/b) |Q| B phi sqrt(V(0))``. Nothing settles at ``T``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import exp, rounded
from ptcc_certify.bounds.delay.case import DecayingForm, LateCase
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.graphs.structure import Structure

#: Halvings of the interval of ``b``, and of the longest delay.
_HALVINGS = 40
#: Room for rounding, relatively.
_MORE = 1e-9


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
    moved, residual : tuple of N Fraction
        How far from ``Q X(0)`` agents are drawn to, and are at ``T``, from above.
    """

    function: int
    q: Fraction
    b: Fraction
    kap: Fraction
    phi: tuple[Fraction, ...]
    left: Fraction
    moved: tuple[Fraction, ...]
    residual: tuple[Fraction, ...]


class SmallDelayBounds:
    """Bounds of one graph under one capped gain.

    Parameters
    ----------
    case : LateCase
        With a ``gain_cap``, an exact influence, and an initial state.
    """

    @staticmethod
    def asked(case: LateCase) -> bool:
        """Tell whether such bounds are asked of a case."""
        return case.of_whole_graph and bool(case.forms)

    def __init__(self, case: LateCase):
        n, own, cap = case.graph.n_nodes, case.messages.own_delay, case.messages.gain_cap
        assert case.influence is not None and cap is not None
        self.case, self.cap, self.influence = case, cap, case.influence
        self.B = [{v: abs(x) for v, x in row.items() if own or v != k} for k, row in enumerate(case.rows)]
        self._B = np.array([[float(row.get(v, 0)) for v in range(n)] for row in self.B])
        self._L = np.array([[float(row.get(v, 0)) for v in range(n)] for row in case.rows])

    def best(self) -> tuple[SmallDelays, np.ndarray] | None:
        """Return what leaves least at ``T``, with bounds of inputs; None if no function forgives this delay."""
        found = [(bound, one) for one in self.case.forms if (bound := self.bound(one)) is not None]
        if not found:
            return None
        bound, one = min(found, key=lambda pair: max(pair[0].residual))
        return bound, self.inputs(one, bound)

    def longest_delay(self) -> float:
        """Return the longest delay that some function forgives, about: this certificate's limit, not the loop's."""
        longest = 0.0
        for one in self.case.forms:
            low, high = 0.0, float(one.form.rate) / float(self.cap)
            weights = self._weights(one)
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                low, high = (middle, high) if self._largest_b(one, weights, middle * float(self.cap)) else (low, middle)
            longest = max(longest, low)
        return longest

    def bound(self, one: DecayingForm) -> SmallDelays | None:
        """Return what one function proves; None if it does not forgive this delay."""
        h = self.cap * self.case.messages.age
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
        moved, residual = list[Fraction](), list[Fraction]()
        for k, c in enumerate(one.deviations):
            share = sum((abs(Fraction(x)) * pushed[v] for v, x in self.influence.row(k).items()), Fraction(0))
            moved.append(rounded(h * q / b * share * root, BITS, up=True))
            residual.append(rounded(moved[-1] + root_above(c * (1 + Fraction(_MORE))) * root * left, BITS, up=True))
        return SmallDelays(one.function, q, b, kap, tuple(exact), left, tuple(moved), tuple(residual))

    def inputs(self, one: DecayingForm, bound: SmallDelays) -> np.ndarray:
        """Return what bounds ``|x_k'| <= g phi_k sqrt(V(0)) e^(-b s)`` up to ``T``, ``(N,)`` floats from above."""
        y = self._root(one) * self.case.highest(bound.b)
        return np.array([float_up(x * y) for x in bound.phi]) * (1 + _MORE) + 1e-300

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
