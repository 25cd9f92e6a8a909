"""What agents do that are bounded from instant to instant: their input under a capped gain, and that of vehicles.

From ``t_(i-1)`` to ``t_i`` the gain is at most ``g_i = g(t_i)``, and ``|e_k| <= D_k m_k``, ``m_k`` the deviation where
the step begins and what is heard. Vehicles that track such agents have ``r' = -a_1 g r + r_2 - g e``, ``r = x - z``,
``r_2' = -a_2 g r_2``, ``r_2(0) = v(0)``, so that with ``y = a_1 |r_k|/D_k`` and ``h = m_k + |r_2|/(g D_k)``

    y_i <= h + (y_(i-1) - h) e^(-a_1 d_i),    y_0 = 0,    d_i what the clock goes, or, below h, g_i (t_i - t_(i-1)),

    |v_k| <= |r_2| + g D_k y,    |u_k| <= (g' y + a_1 g^2 (y + m_k)) D_k + (a_1 + a_2) g |r_2|,    g' <= (g - rho1)^2/k.

Numbers are multiples of ``2^-30``, of shares or of the unit of the bounds; everything is rounded up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil

from lmi.exact.numbers import longest
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.input_formulas import Limits, clock_between
from ptcc_certify.checker.message_ages import Messages
from ptcc_certify.checker.reading import length
from ptcc_certify.checker.stepwise_bounds import FIXED, ONE, Step, Steps, fixed_decay_above, fixed_decay_below


class Walk:
    """Bounds from instant to instant, and the gain on the way.

    Parameters
    ----------
    messages : Messages
    graph : Digraph
    nodes : ints
        The followers.
    instants : Fractions
    start : ints
        ``y_0`` by follower, times a scale.
    scale : int
    kind : type of Steps

    Attributes
    ----------
    steps : Steps
    unit : Fraction
        What an integer of the bounds stands for.
    gain : PrescribedGain
    gains : sequence of Fraction
        What acts at every instant; ascending to the cap, at ``T`` as before without one.
    ways : sequence of Fraction
        How far its clock goes between two of them, from below; without a cap None to ``T``.
    longest : list of Fraction
        The same from above, under a cap.
    """

    def __init__(
        self,
        messages: Messages,
        graph: Digraph,
        nodes: Sequence[int],
        instants: Sequence[Fraction],
        start: Sequence[int],
        scale: int,
        kind: type[Steps] = Steps,
    ):
        gain, cap, leaders = messages.gain, messages.gain_cap, messages.leaders
        bits = length((gain.T, gain.rho1, gain.k, messages.delay, cap or gain.T, *instants))
        spend(120 * len(instants), 2 * bits, 2 * bits, "instants of steps")
        gains = [Limits(cap).gain_at(gain, t) for t in instants[:-1]]
        self.gain, self.gains = gain, [*gains, cap or gains[-1]]
        self.ways = [clock_between(gain, cap, a, b) for a, b in pairwise(instants)]
        push = Fraction(0) if leaders is None else leaders.push * scale / gains[0]
        degrees = [graph.diagonal[v] for v in nodes]
        self.steps = kind(graph, nodes, degrees, start, messages.wrong * scale, messages.parts, push)
        self.unit = Fraction(self.steps.largest, scale << FIXED)
        self.longest = [g * (b - a) for g, (a, b) in zip(self.gains[1:], pairwise(instants), strict=True)]
        self._told = instants, messages.delay, self.ways, gains if leaders is not None else []

    def __iter__(self) -> Iterator[Step]:
        """Yield the steps, see :meth:`ptcc_certify.checker.stepwise_bounds.Steps.walk`."""
        return self.steps.walk(*self._told)

    @property
    def size(self) -> Fraction:
        """What an integer stands for, times a degree that is an integer."""
        return self.unit / self.steps.graph.unit


class AgentSteps:
    """The input ``g |e_k|`` of agents.

    Attributes
    ----------
    peaks : sequence of int
        The largest ``g m_k`` so far, over the last gain.
    """

    def __init__(self, walk: Walk):
        self.walk = walk
        spend(2 * len(walk.ways) * len(walk.steps.nodes), FIXED, FIXED, "inputs from instant to instant")
        self.peaks: Sequence[int] = [0] * len(walk.steps.nodes)
        self._shares = [ceil(ONE * gain / walk.gains[-1]) for gain in walk.gains[1:]]

    def step(self, i: int, step: Step) -> None:
        """Take a step of the walk."""
        self.peaks = self.walk.steps.larger(self.peaks, step, self._shares[i])


class VehicleSteps:
    """Vehicles that track agents which are bounded from instant to instant.

    Parameters
    ----------
    walk : Walk
    begun : sequence of Fraction
        ``|v_k(0)|`` by follower.
    a1, a2 : Fraction
        Gains of the tracking.

    Attributes
    ----------
    lag : list of int
        ``a_1 |r_k|/D_k`` at the instant that was reached.
    most : list of int
        The largest one on the way there.
    velocity, input : list of int
        The largest ``|v_k|/(D_k g(T))`` and ``|u_k|/(D_k a_1 g(T)^2)`` so far.
    """

    def __init__(self, walk: Walk, begun: Sequence[Fraction], a1: Fraction, a2: Fraction):
        self.walk, self.a1, gains, ways = walk, a1, walk.gains, [way or Fraction(0) for way in walk.ways]
        bits = length((a1, a2)) + FIXED
        spend(60 * len(ways), bits, length((gains[0], gains[-1])), "vehicles from instant to instant")
        size = walk.size * gains[0]
        self._begun = [ceil(v / (size * D)) for v, D in zip(begun, walk.steps.degrees, strict=True)]
        self.lag, self.most, self.velocity, self.input = ([0] * len(begun) for _ in range(4))
        pairs = zip(ways, walk.longest, strict=True)
        self._decays = [(fixed_decay_above(int(ONE * a1 * x)), fixed_decay_below(ceil(ONE * a1 * y))) for x, y in pairs]
        clock, top, self._factors = Fraction(0), gains[-1], list[list[int]]()
        for way, low, high in zip(ways, gains, gains[1:], strict=False):
            # of begun, which is |r_2| over g(0), in h, |v_k| and |u_k|; of y in these; of m_k in |u_k|
            left = Fraction(fixed_decay_above(int(ONE * a2 * clock)), ONE) * gains[0]
            rise = Fraction(0) if low == top else (high - walk.gain.rho1) ** 2 / walk.gain.k / a1
            of_begun = left / low, left / top, (a1 + a2) * high * left / (a1 * top**2)
            of_both = high / top, (rise + high**2) / top**2, high**2 / top**2
            self._factors.append([ceil(ONE * x) for x in (*of_begun, *of_both)])
            clock += way
        bits = longest(x for factors in self._factors for x in factors)
        spend(8 * len(ways) * len(begun), bits, longest(self._begun) + FIXED, "vehicles from instant to instant")

    def step(self, i: int, step: Step) -> None:
        """Take a step of the walk."""
        (above, below), (ahead, speed, push, grown, own, pulled) = self._decays[i], self._factors[i]
        for k, (x, other, v, y) in enumerate(zip(step.begin, step.heard, self._begun, self.lag, strict=True)):
            m = x + other
            h = m - (-v * ahead >> FIXED)
            self.lag[k] = h - ((h - y) * (below if y < h else above) >> FIXED)
            self.most[k] = most = max(y, self.lag[k])
            self.velocity[k] = max(self.velocity[k], -(-(v * speed + most * grown) >> FIXED))
            self.input[k] = max(self.input[k], -(-(v * push + most * own + m * pulled) >> FIXED))

    def bounds(self, last: Sequence[int]) -> dict[str, tuple[Fraction, list[int]]]:
        """Return what bounds positions at ``T``, from the last bounds of the walk, velocities and inputs.

        Each is a factor, and by follower what it multiplies.
        """
        size, top, degrees = self.walk.size, self.walk.gains[-1], self.walk.steps.degrees
        velocity, push = ([D * x for D, x in zip(degrees, part, strict=True)] for part in (self.velocity, self.input))
        p, q = self.a1.as_integer_ratio()
        unit = self.walk.steps.graph.unit
        far = [p * unit * y + q * D * x for y, D, x in zip(last, degrees, self.lag, strict=True)]
        return {
            "position": (size / p, far),
            "velocity": (size * top, velocity),
            "input": (size * self.a1 * top**2, push),
        }
