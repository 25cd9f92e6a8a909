"""Small delays of every signal of a family, whoever leads: its Lyapunov functions forgive them under a capped gain.

With ``sqrt(V)`` a norm that decays at ``r/2`` for every signal, ``|(L X)_k| <= c_k sqrt(V)`` for every member, ``B_i``
the largest ``|w_kl|`` of mode ``i``, ``h = G delay``, ``q >= e^(b h)`` and

    phi_k >= c_k + h q max_i (B_i phi)_k,    kap >= sqrt(V) of all |x_k| <= (B_i phi)_k,    b + h q kap <= r/2

``sqrt(V) <= e^(-b s) sqrt(V(0))`` and ``|x_k'| <= g phi_k e^(-b s) sqrt(V(0))``: every agent is within ``(phi_k / b)
e^(-b s) sqrt(V(0))`` of where it would settle under the signal. Without a cap the same holds where nothing is late:
there agents settle at ``T``.

Where values are off by ``error``, agents are disturbed by ``|d_k| <= delta``, or both, nothing settles. With ``wrong =
error + delta delay``, ``off_i = h B_i psi + wrong D_i`` and

    psi_k >= c_k f + max_i off_i,    f r/2 >= sqrt(V) of all |x_k| <= off_i,    push >= sqrt(V) of all |x_k| <= delta

``f + push int_0^t e^(-b (s(t) - s(r))) dr`` is added to the root of ``V``, which bounds how far agents are from
their targets: ``|x_k - sum_j B_kj x_j| <= size_k sqrt(V)``, ``B`` the common kernel, ``j`` its pivots.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import float_up
from lmi.exact.elementary_enclosures import exp, rounded
from ptcc_certify.bounds.delay.case import LateCase, Moments
from ptcc_certify.bounds.delay.decay_by_rows import driven, each_times, lasting
from ptcc_certify.checker.forms_of_families import Edge, SpreadingFunction, heard_in_mode
from ptcc_certify.checker.input_formulas import BITS, drift_above, root_above
from ptcc_certify.checker.signal_bounds import least
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.theorems.family_behaviour import FamilyComponent

#: Agents of a component for whose functions delays are tried, and halvings of the interval of ``b``.
LARGEST, _HALVINGS = 120, 25
#: The share of the rate at which the longest delay is sought.
_LEAST_SHARE = Fraction(1, 1000)
#: Room for rounding, relatively; of what errors add.
_MORE, _ROOM = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class FamilyForm:
    """What a Lyapunov function of a component of a family proves with late messages, or under a capped gain.

    Attributes
    ----------
    function : int
        Its number among those of all components.
    nodes : tuple of int
        The agents of the component.
    q, b, kap : Fraction
    phi : tuple of N Fraction
        0 of other agents.
    initial : Fraction
        ``sqrt(V(0))`` from above.
    left : Fraction
        ``e^(-b s(T))`` from above.
    floor, push : Fraction or None
        What errors add to the root, and disturbances per unit of time; None where there are none.
    sizes, psi : tuple of N Fraction, or None
    growth : Fraction or None
        At what rate agents that move by themselves let the root grow.
    """

    function: int
    nodes: tuple[int, ...]
    q: Fraction
    b: Fraction
    kap: Fraction
    phi: tuple[Fraction, ...]
    initial: Fraction
    left: Fraction
    floor: Fraction | None = None
    push: Fraction | None = None
    sizes: tuple[Fraction, ...] | None = None
    psi: tuple[Fraction, ...] | None = None
    growth: Fraction | None = None

    def decay(self, case: LateCase) -> DecayOfAll:
        """Return what it says of the agents of the component."""
        chosen, b, push, zero = self.nodes, self.b, self.push or Fraction(0), Fraction(0)
        falling, standing = [self.phi[v] * self.initial for v in chosen], [zero] * len(chosen)
        away, floor = [y / b for y in falling], [zero] * len(chosen)
        if self.psi is not None:
            standing = [self.psi[v] for v in chosen]
        if push:
            most = push / (b * case.exact.least_gain())
            standing = [x + self.phi[v] * most for v, x in zip(chosen, standing, strict=True)]
        if self.sizes is not None:
            at_T = (self.floor or 0) + push * drift_above(case.protocol.gain.exact, b, case.messages.gain_cap)
            away, floor = ([self.sizes[v] * x for v in chosen] for x in (self.initial, at_T))
        return DecayOfAll(chosen, b, None, self.left, away, floor, falling, standing)

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds how far agents are from where they would settle at instants.

        Infinite of those of other components, 0 of agents whom nobody hears, and who hear nobody.
        """
        assert isinstance(case.structure, Family)
        decay, (sources, listeners, _) = self.decay(case), case.structure.union
        growth = self.growth or Fraction(0)
        push = float((self.push or Fraction(0)) / _more(case, growth, self.b))
        y, added = driven(case, self.b, push, None, self.after(case), t, growth)
        first, sizes = (
            np.array([[float_up(x)] for x in (values or [Fraction(0)] * len(self.nodes))])
            for values in (decay.away, None if self.sizes is None else [self.sizes[v] for v in self.nodes])
        )
        standing = lasting(case, self.b, sizes * float_up(self.floor or Fraction(0)), t, growth)
        decaying, standing = (
            case.of_nodes(self.nodes, x) for x in (each_times(first, y) + each_times(sizes, added), standing)
        )
        alone = np.setdiff1d(np.arange(len(decaying)), np.concatenate([sources, listeners]))
        decaying[alone] = standing[alone] = 0
        return Moments(float(self.b), y, decaying, standing)

    def stays(self, case: LateCase) -> bool:
        """Whether growth is slower than the decay after ``T``, so that what is left then is never exceeded."""
        return case.exact.lasting(self.growth or Fraction(0), self.b) is not None

    def after(self, case: LateCase) -> float:
        """Return what disturbances add to the root at all times."""
        return float_up((self.push or Fraction(0)) / (self.b * case.exact.least_gain(always=True)))


def forms_of_family(
    case: LateCase, parts: Sequence[tuple[FamilyComponent, Sequence[SpreadingFunction]]]
) -> tuple[FamilyForm, ...]:
    """Return what leaves least at ``T`` of every component in which somebody listens; none if one has nothing.

    Parameters
    ----------
    case : LateCase
        Of a family; of late messages with a cap of the gain. Without an initial state there are none.
    parts : sequence of (FamilyComponent, sequence of SpreadingFunction)
        Every component with its functions, in the order in which files number them.
    """
    found, number = [], 0
    if case.initial_state is None:
        return ()
    for component, functions in parts:
        own: list[FamilyForm] = []
        for V in functions:
            own += _bound(case, component, V, number)
            number += 1
        if component.nodes.size > 1:
            if not own:
                return ()
            found.append(min(own, key=_cost))
    return tuple(found)


def longest_delay_of_family(
    case: LateCase, parts: Sequence[tuple[FamilyComponent, Sequence[SpreadingFunction]]]
) -> float:
    """Return about the longest delay that functions of a family forgive: this certificate's limit, not the loop's."""
    longest = math.inf
    for component, functions in parts:
        own = [] if component.nodes.size > 1 else [math.inf]
        for V in functions if 1 < component.nodes.size <= LARGEST else ():
            low, high = 0.0, float(V.rate) / 2
            for _ in range(_HALVINGS if V.rate > 0 else 0):
                middle = (low + high) / 2
                tried = _Tried.of(component, V, Fraction(middle))
                low, high = (middle, high) if tried.prove(V.rate * _LEAST_SHARE) is not None else (low, middle)
            own.append(low / float(case.messages.gain_cap or 1))
        longest = min(longest, max(own, default=0.0))
    return longest


def rest_of(case: LateCase, forms: Sequence[FamilyForm]) -> DecayOfAll:
    """Return what is so of agents whom nobody hears, and who hear nobody: they rest."""
    nodes = sorted(set(range(len(case.of.labels))).difference(*(one.nodes for one in forms)))
    nothing, one = [Fraction(0)] * len(nodes), forms[0]
    return DecayOfAll(nodes, one.b, None, one.left, nothing, nothing, nothing, nothing)


def _cost(found: FamilyForm) -> tuple[float, float]:
    most, rest = float(max(found.phi) * found.initial), float(max(found.sizes or (Fraction(0),)))
    stays = float(found.floor or 0) + float(found.push or 0) / float(found.b)
    return most / float(found.b) * float(found.left) + rest * stays, most


def _bound(case: LateCase, component: FamilyComponent, V: SpreadingFunction, number: int) -> Iterator[FamilyForm]:
    """Yield what one function proves; nothing if it does not forgive this delay."""
    rate, late = V.rate / 2, (case.messages.gain_cap or Fraction(0)) * case.messages.age
    if not rate > 0 or (late and component.nodes.size > LARGEST):
        return
    tried = _Tried.of(component, V, late)
    b = Fraction(tried.largest_b(float(rate))) if late else rate
    if b and (proved := tried.prove(b)) is not None:
        q, kap, phi = proved
        state, chosen, whole = case.state, component.nodes.tolist(), [Fraction(0)] * len(case.state)
        for v, x in zip(chosen, phi, strict=True):
            whole[v] = x
        initial = rounded(V.root([state[v] for v in chosen]), BITS, up=True)
        found = FamilyForm(number, tuple(chosen), q, b, kap, tuple(whole), initial, case.left(b))
        with suppress(NoCertificate):
            yield found if case.messages.settles else _with_errors(case, found, tried)


def _more(case: LateCase, growth: Fraction, b: Fraction) -> Fraction:
    """Return how much more of errors and disturbances stands where agents move by themselves."""
    return case.exact.lasting(growth, b) or case.grown(growth)


def _with_errors(case: LateCase, found: FamilyForm, tried: _Tried) -> FamilyForm:
    """Add what errors of values, disturbances and agents that move by themselves make of it."""
    disturbance = Fraction(0) if case.leaders is None else case.leaders.disturbance
    V, n, more = tried.V, len(found.nodes), Fraction(1) + Fraction(_ROOM)
    own, unit = least(V.sizes)

    def whole(values: Sequence[Fraction]) -> tuple[Fraction, ...]:
        by_node = dict(zip(found.nodes, values, strict=True))
        return tuple(by_node.get(v, Fraction(0)) for v in range(len(found.phi)))

    sizes = whole([rounded(Fraction(own.get(v, 0), unit) * more, BITS, up=True) for v in range(n)])
    found, lasts = replace(found, sizes=sizes), Fraction(1)
    if case.growth:
        own_sizes = {v: sizes[node] for v, node in enumerate(found.nodes)}
        shares = (root_above(V.largest(own_sizes)), V.spread(own_sizes))
        growth = rounded(case.growth * min(x for x in shares if x is not None) * more, BITS, up=True)
        found = replace(found, growth=growth, initial=rounded(found.initial * case.grown(growth), BITS, up=True))
        lasts = _more(case, growth, found.b)
    wrong = (case.messages.value_error + disturbance * case.messages.age) * lasts
    if disturbance:
        push = root_above(V.largest(dict.fromkeys(range(n), disturbance))) * lasts
        found = replace(found, push=rounded(push * more, BITS, up=True))
    if wrong:
        floor, psi = tried.errors(wrong)
        found = replace(found, floor=floor, psi=whole(psi))
    return found


def _edges(mode: Mode) -> list[Edge]:
    """Return source, target and largest weight of every edge."""
    ends = zip(mode.source.tolist(), mode.target.tolist(), strict=True)
    return [(s, t, mode.upper.fraction(e)) for e, (s, t) in enumerate(ends)]


@dataclass(frozen=True, eq=False)
class _Tried:
    """A function, ``c``, the edges of every mode, and ``h``."""

    V: SpreadingFunction
    first: Sequence[Fraction]
    modes: Sequence[Sequence[Edge]]
    late: Fraction

    @classmethod
    def of(cls, component: FamilyComponent, V: SpreadingFunction, late: Fraction) -> _Tried:
        """Return a function of a component under so much lateness on the clock."""
        speeds, unit = least(V.speeds)
        first = [Fraction(speeds.get(v, 0), unit) * (1 + Fraction(_MORE)) for v in range(component.nodes.size)]
        return cls(V, first, [_edges(mode) for mode in component.family.modes], late)

    def prove(self, b: Fraction) -> tuple[Fraction, Fraction, list[Fraction]] | None:
        """Return ``q``, ``kap`` and ``phi`` for a rate; None if they prove less of it."""
        q = rounded(exp(b * self.late)[1], BITS, up=True)
        phi = self._phi(float(self.late * q))
        if phi is None:
            return None
        pushes = [heard_in_mode(edges, dict(enumerate(phi))) for edges in self.modes]
        kap = rounded(root_above(max(self.V.largest(push) for push in pushes)), BITS, up=True)
        return (q, kap, phi) if b + self.late * q * kap <= self.V.rate / 2 else None

    def errors(self, wrong: Fraction) -> tuple[Fraction, list[Fraction]]:
        """Return ``f`` and ``psi``, for values that are off by ``wrong``: ``psi = f a + c`` by two fixed points."""
        n, ones = len(self.first), dict.fromkeys(range(len(self.first)), Fraction(1))
        sums = [heard_in_mode(edges, ones) for edges in self.modes]
        heard = [float(wrong * max(D[v] for D in sums)) for v in range(n)]
        a, c = (self._solved(float(self.late), np.array(x, dtype=float)) for x in (self.first, heard))
        assert a is not None and c is not None, "the delay is forgiven"
        rise, start = (
            max(
                self.V.largest({v: self.late * y + off * D[v] for v, y in heard_in_mode(edges, x).items()})
                for edges, D in zip(self.modes, sums, strict=True)
            )
            for x, off in ((_exact(a), Fraction(0)), (_exact(c), wrong))
        )
        rate, more = self.V.rate / 2, Fraction(1) + Fraction(_ROOM)
        floor = rounded(root_above(start) / (rate - root_above(rise)) * more * more, BITS, up=True)
        pairs = zip(_exact(a).values(), _exact(c).values(), strict=True)
        return floor, [rounded((floor * x + y) * more, BITS, up=True) for x, y in pairs]

    def largest_b(self, rate: float) -> float:
        """Return about the largest ``b`` that is proved; 0 if there is none."""
        low, high = 0.0, rate
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            proved = middle and self.prove(Fraction(middle)) is not None
            low, high = (middle, high) if proved else (low, middle)
        return low

    def _phi(self, lag: float) -> list[Fraction] | None:
        """Return ``phi`` with some room; None if it is too large."""
        first = np.array([float(x) for x in self.first]) * (1 + _MORE)
        first += _MORE * first.max(initial=0.0) * (lag > 0)
        phi = self._solved(lag, first)
        return None if phi is None else list(_exact(phi * (1 + _MORE)).values())

    def _solved(self, lag: float, first: np.ndarray) -> np.ndarray | None:
        """Return the solution of ``phi = first + lag max_i B_i phi``; None if there is none."""
        phi = first
        if lag:
            n, heard = first.size, np.zeros((len(self.modes), first.size, first.size))
            for B, edges in zip(heard, self.modes, strict=True):
                for s, t, high in edges:
                    B[t, s] += float(high)
            most = np.zeros((n, n))
            for _ in range(n + 2):  # the mode that is the worst of every row, for the last phi
                worst = (heard @ phi).argmax(axis=0)
                chosen = heard[worst, np.arange(n)]
                if np.array_equal(chosen, most):
                    break
                most = chosen
                if np.abs(np.linalg.eigvals(lag * most)).max(initial=0.0) >= 1:
                    return None
                phi = np.linalg.solve(np.eye(n) - lag * most, first)
            if not (np.isfinite(phi).all() and (phi >= first).all()):
                return None
        return phi


def _exact(values: np.ndarray) -> dict[int, Fraction]:
    return {v: rounded(Fraction(x), BITS, up=True) for v, x in enumerate(values.tolist())}
