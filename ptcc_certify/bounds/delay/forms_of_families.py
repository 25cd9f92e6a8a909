"""Small delays of every signal of a family, whoever leads: its Lyapunov functions forgive them under a capped gain.

With ``sqrt(V)`` a norm that decays at ``r/2`` for every signal, ``|(L X)_k| <= c_k sqrt(V)`` for every member, ``B_i``
the largest ``|w_kl|`` of mode ``i``, ``h = G delay``, ``q >= e^(b h)`` and

    phi_k >= c_k + h q max_i (B_i phi)_k,    kap^2 >= V of all states with |x_k| <= (B_i phi)_k,    b + h q kap <= r/2

``sqrt(V) <= e^(-b s) sqrt(V(0))`` and ``|x_k'| <= g phi_k e^(-b s) sqrt(V(0))``: every agent is within ``(phi_k / b)
e^(-b s) sqrt(V(0))`` of where it would settle under the signal. Without a cap the same holds where nothing is late:
there agents settle at ``T``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.elementary_enclosures import exp, rounded
from ptcc_certify.bounds.delay.case import LateCase, Moments, moments
from ptcc_certify.checker.delayed_forms import Edge, heard_in_mode
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.signal_bounds import Function, least
from ptcc_certify.checker.stated_bounds import DecayOfAll
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.theorems.family_behaviour import FamilyComponent

#: Agents of a component for whose functions delays are tried, and halvings of the interval of ``b``.
LARGEST, _HALVINGS = 120, 25
#: Room for rounding, relatively.
_MORE = 1e-9


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
    """

    function: int
    nodes: tuple[int, ...]
    q: Fraction
    b: Fraction
    kap: Fraction
    phi: tuple[Fraction, ...]
    initial: Fraction
    left: Fraction

    @property
    def decay(self) -> DecayOfAll:
        """What it says of the agents of the component."""
        falling, nothing = [self.phi[v] * self.initial for v in self.nodes], [Fraction(0)] * len(self.nodes)
        away = [y / self.b for y in falling]
        return DecayOfAll(self.nodes, self.b, None, self.left, away, nothing, falling, nothing)

    def over_time(self, case: LateCase, t: np.ndarray) -> Moments:
        """Return what bounds how far agents are from where they would settle at instants.

        Infinite of those of other components, 0 of agents whom nobody hears, and who hear nobody.
        """
        assert isinstance(case.structure, Family)
        decay, (sources, listeners, _) = self.decay, case.structure.union
        found = moments(case, self.b, decay.away, decay.floor, t)
        decaying, standing = (case.of_nodes(self.nodes, x) for x in (found.decaying, found.standing))
        alone = np.setdiff1d(np.arange(len(decaying)), np.concatenate([sources, listeners]))
        decaying[alone] = standing[alone] = 0
        return Moments(found.b, found.y, decaying, standing)


def forms_of_family(
    case: LateCase, parts: Sequence[tuple[FamilyComponent, Sequence[Function]]]
) -> tuple[FamilyForm, ...]:
    """Return what leaves least at ``T`` of every component in which somebody listens; none if one has nothing.

    Parameters
    ----------
    case : LateCase
        Of a family, with an initial state; of late messages with a cap of the gain.
    parts : sequence of (FamilyComponent, sequence of Function)
        Every component with its functions, in the order in which files number them.
    """
    found, number = [], 0
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


def rest_of(case: LateCase, forms: Sequence[FamilyForm]) -> DecayOfAll:
    """Return what is so of agents whom nobody hears, and who hear nobody: they rest."""
    nodes = sorted(set(range(len(case.of.labels))).difference(*(one.nodes for one in forms)))
    nothing, one = [Fraction(0)] * len(nodes), forms[0]
    return DecayOfAll(nodes, one.b, None, one.left, nothing, nothing, nothing, nothing)


def _cost(found: FamilyForm) -> tuple[float, float]:
    most = float(max(found.phi) * found.initial)
    return most / float(found.b) * float(found.left), most


def _bound(case: LateCase, component: FamilyComponent, V: Function, number: int) -> Iterator[FamilyForm]:
    """Yield what one function proves; nothing if it does not forgive this delay."""
    n, rate = component.nodes.size, V.rate / 2
    late = (case.messages.gain_cap or Fraction(0)) * case.messages.age
    if not rate > 0 or (late and n > LARGEST):
        return
    speeds, unit = least(V.speeds)
    first = [Fraction(speeds.get(v, 0), unit) * (1 + Fraction(_MORE)) for v in range(n)]
    tried = _Tried(V, first, [_edges(mode) for mode in component.family.modes], late)
    b = Fraction(tried.largest_b(float(rate))) if late else rate
    if b and (proved := tried.prove(b)) is not None:
        q, kap, phi = proved
        state, chosen, whole = case.state, component.nodes.tolist(), [Fraction(0)] * len(case.state)
        for v, x in zip(chosen, phi, strict=True):
            whole[v] = x
        initial = rounded(V.root([state[v] for v in chosen]), BITS, up=True)
        yield FamilyForm(number, tuple(chosen), q, b, kap, tuple(whole), initial, case.left(b))


def _edges(mode: Mode) -> list[Edge]:
    """Return source, target and largest weight of every edge."""
    ends = zip(mode.source.tolist(), mode.target.tolist(), strict=True)
    return [(s, t, mode.upper.fraction(e)) for e, (s, t) in enumerate(ends)]


@dataclass(frozen=True, eq=False)
class _Tried:
    """A function, ``c``, the edges of every mode, and ``h``."""

    V: Function
    first: Sequence[Fraction]
    modes: Sequence[Sequence[Edge]]
    late: Fraction

    def prove(self, b: Fraction) -> tuple[Fraction, Fraction, list[Fraction]] | None:
        """Return ``q``, ``kap`` and ``phi`` for a rate; None if they prove less of it."""
        q = rounded(exp(b * self.late)[1], BITS, up=True)
        phi = self._phi(float(self.late * q))
        if phi is None:
            return None
        pushes = [heard_in_mode(edges, dict(enumerate(phi))) for edges in self.modes]
        kap = rounded(root_above(max(self.V.largest(push) for push in pushes)), BITS, up=True)
        return (q, kap, phi) if b + self.late * q * kap <= self.V.rate / 2 else None

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
        return [rounded(Fraction(x), BITS, up=True) for x in (phi * (1 + _MORE)).tolist()]
