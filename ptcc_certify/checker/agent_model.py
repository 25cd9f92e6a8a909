"""Reads agents of order n: their equation, the protocol's numbers, and how far they are within limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from lmi.exact.numbers import integers
from ptcc_certify.checker.input_formulas import PrescribedGain
from ptcc_certify.checker.matrix_products import Matrix
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.section_declarations import Several, Triangle

#: Largest order, and largest dimension of space.
LARGEST_ORDER, LARGEST_DIMENSION = 8, 8
#: Bits of a numerator or a denominator of what describes one agent.
LONGEST = 2000
#: Largest ``T (1 + max |a_i|)`` of agents that are no integrators.
LARGEST_MOTION = 100
#: Ends of the intervals of ``zeta``.
MANY_POINTS = 257


@dataclass(frozen=True)
class Chains:
    """What agents of order n are, and what they feed back of their own state, in ``d`` coordinates.

    Attributes
    ----------
    n, d : int
    plant, own : n numbers
        ``a`` and ``f``.
    cap : Fraction or None
        What the gain is at most; positive.
    gain : PrescribedGain
        Before the cap; its ``rho1`` may be 0.
    """

    n: int
    d: int
    plant: Sequence[Fraction]
    own: Sequence[Fraction]
    cap: Fraction | None
    gain: PrescribedGain

    @property
    def first_gain(self) -> Fraction:
        """The gain at time 0, before the cap."""
        return self.gain.value(Fraction(1))

    @property
    def eta_0(self) -> Fraction:
        """The gain at time 0."""
        return self.first_gain if self.cap is None else min(self.first_gain, self.cap)


@dataclass(frozen=True)
class Agents(Chains):
    """Agents ``x^(n) + a_n x^(n-1) + .. + a_1 x = u`` in ``d`` coordinates, and what they run.

    Attributes
    ----------
    gains : n numbers
        ``K``.
    coupling, rate : Fraction
        ``c`` and ``r``, both positive.
    W : n rows of n numbers
        Symmetric.
    points : list of Fraction
    """

    gains: Sequence[Fraction]
    coupling: Fraction
    W: Sequence[Sequence[Fraction]]
    rate: Fraction
    points: Sequence[Fraction]

    @cached_property
    def scaled_W(self) -> tuple[Matrix, int]:
        """``W`` in integers over a scale, and the scale."""
        return integers(self.W)

    @property
    def bounded(self) -> bool:
        """Whether ``eta^n e^(-r s / 2)`` never grows."""
        return self.rate * self.gain.k >= 2 * self.n

    @property
    def damped(self) -> bool:
        """Whether ``eta e^(-f_2 s - a_2 t)`` never grows, of agents that meet at rest."""
        spare = self.own[1] - 1 / self.gain.k
        return spare >= 0 and self.plant[1] + spare * self.first_gain >= 0


@dataclass(frozen=True)
class Cascade(Chains):
    """Double integrators that track the velocity of the paper's protocol: ``K = (alpha + theta, 1)``."""

    @property
    def gains(self) -> tuple[Fraction, Fraction]:
        """``K`` without ``theta``."""
        return self.own[1], Fraction(1)

    def pull(self, remaining: Fraction) -> Fraction:
        """Return ``g = alpha + theta`` where ``1 - t/T`` is ``remaining``: ``theta = k/(eta (T - t))^2``.

        Examples
        --------
        >>> one = Fraction(1)
        >>> agents = Cascade(2, 1, (0 * one, 0 * one), (0 * one, 3 * one), None, PrescribedGain(one, one, one))
        >>> agents.pull(one), agents.pull(0 * one)
        (Fraction(13, 4), Fraction(4, 1))
        """
        return self.own[1] + self.gain.k / (self.gain.rho1 * self.gain.T * remaining + self.gain.k) ** 2


@dataclass(frozen=True, kw_only=True)
class OneAgent:
    """What the file says of one agent."""

    order: int
    dimension: int
    plant: Several[Fraction]
    own: Several[Fraction]
    gains: Several[Fraction]
    coupling: Fraction
    lower_triangle: Triangle
    rate: Fraction
    gain_cap: Fraction | None = None
    points: Several[Fraction]


def agents_of(section: OneAgent, gain: PrescribedGain) -> Agents:
    """Return what the section says of one agent, within its limits."""
    n, d = within("order", section.order, LARGEST_ORDER), within("dimension", section.dimension, LARGEST_DIMENSION)
    plant, own, gains, W, points = section.plant, section.own, section.gains, section.lower_triangle, section.points
    need(all(len(x) == n for x in (plant, own, gains, W)), f"plant, own, gains or lower_triangle has not {n} entries")
    need(len(points) <= MANY_POINTS, f"more than {MANY_POINTS} points")
    coupling, rate, cap = section.coupling, section.rate, section.gain_cap
    agents = Agents(n, d, plant, own, cap, gain, gains, coupling, W, rate, points)
    numbers = (*plant, *own, *gains, *points, *(x for row in W for x in row), coupling, rate, cap or coupling)
    longest = length((*numbers, gain.T, gain.rho1, gain.k))
    need(longest <= LONGEST, f"agents: a number of {longest} bits; {LONGEST} are taken")
    need(rate > 0, "the rate of the agents is not positive")
    need(coupling > 0, "the coupling is not positive")
    need(cap is None or cap > 0, "the cap of the gain is not positive")
    most = gain.T * (1 + max(map(abs, plant)))
    need(
        not any(plant) or most <= LARGEST_MOTION,
        f"agents that move too far before T; T (1 + max |a|) <= {LARGEST_MOTION}",
    )
    _check_own(agents)
    need(cap is not None or rate * gain.k > 2 * (n - 1), "r k is not above 2 (n - 1): derivatives need not agree at T")
    return agents


def _check_own(agents: Agents) -> None:
    """Refuse feedback of an agent's own state unless it is that of meeting at rest."""
    f, a = agents.own, agents.plant
    if any(f):
        need(agents.n == 2, "feedback of the own state of agents that are not of order 2")
        need(f[0] == 0 and f[1] > 0, "feedback of the own state that does not damp the velocity alone")
        need(a[0] == 0, "feedback of the own velocity beside a force a_1 x")
        need(agents.cap is None, "feedback of the own velocity with a gain that is capped")


def within(key: str, value: int, largest: int) -> int:
    """Return an integer from 1 to ``largest``."""
    need(1 <= value <= largest, f"{key} is no integer from 1 to {largest}")
    return value
