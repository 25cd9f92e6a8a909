"""Verifies Lyapunov functions of a family under small delays, errors and disturbances: section 22 of the format.

``m = sqrt(V)`` is a norm of the component's states, apart from those of the common kernel, which decays at ``r/2`` for
every signal. What acts on agent ``k`` beside ``(L x)_k`` is what is late of those it hears, at most ``q h (B phi)_k m``
while ``m`` decays at ``b``, and what is off; both push ``m``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Protocol

from lmi.exact.decimal_rounding import down
from lmi.exact.elementary_enclosures import exp
from lmi.exact.numbers import shorten
from lmi.exact.work import spend
from ptcc_certify.checker.delayed_forms import LateFormWitness, need_left_at_deadline
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Component, Family
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.input_formulas import drift_above
from ptcc_certify.checker.message_ages import LARGEST_GROWTH, Messages
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import FewAgents, Nodes, NotNegative
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.signal_bounds import Function, Sizes, least
from ptcc_certify.checker.stated_bounds import DecayOfAll

#: Source, target, and the largest size of its weight.
Edge = tuple[int, int, Fraction]


class SpreadingFunction(Function, Protocol):
    """A Lyapunov function of which is known how fast it grows where agents move by themselves."""

    def spread(self, sizes: Sizes) -> Fraction | None:
        """Bound how much faster ``sqrt(V)`` grows than agents part by themselves; None if that is not known."""


class FunctionOfSignals(SpreadingFunction, Protocol):
    """A Lyapunov function of a component of a family."""

    @property
    def component(self) -> Component:
        """Whose it is."""


@dataclass(frozen=True, kw_only=True)
class LateFamilyForm:
    """A function of a component of a family under small delays: its root at first, and the share that is left.

    Where values are off or agents disturbed how far agents may be from their targets, over the root, what errors make
    of it, and what disturbances add to it per unit of time; where agents move by themselves that, too, and at what rate
    that lets it grow.
    """

    nodes: Nodes
    initial: NotNegative
    left: Fraction
    sizes: FewAgents | None = None
    floor: NotNegative | None = None
    push: NotNegative | None = None
    growth: NotNegative | None = None


def check_forms_of_family(
    doc: Document,
    messages: Messages,
    family: Family,
    functions: Sequence[FunctionOfSignals],
    begin: Begin,
    entries: Sequence[LateFamilyForm],
) -> list[DecayOfAll]:
    """Verify ``sqrt(V) <= e^(-b s) initial`` for every signal, ``|e_k| <= phi_k sqrt(V)``, of components of a family.

    Return decays to where every agent would settle under the signal; where values are off or agents disturbed, to its
    target, where the pivots are now. Agents whom nobody hears, and who hear nobody, keep to themselves.
    """
    doc.at = "messages.forms"
    state, leaders = begin.state, messages.leaders
    if state is None:
        raise RejectedError("forms without an initial state")
    still = leaders is None or (leaders.speed == 0 and leaders.sign_gain is None)
    need(still, "forms though leaders move, or with a sign term")
    need(messages.gain_cap is not None or not messages.delay, "forms without a cap, though something is late")
    need(not messages.late and bool(entries), "forms of a late own state, or none")
    decays, x = [], list(state)
    for i, entry in enumerate(entries):
        doc.at = of = f"messages.forms[{i}]"
        obligation = doc.open("late-form", of)
        number = obligation["witness"].function
        need(0 <= number < len(functions), "no such Lyapunov function")
        nodes = positions(doc, family.modes[0].structure.graph, entry.nodes, "nodes of forms")
        need(nodes == functions[number].component.nodes, "nodes are not those of the function")
        decay = _FormUnderDelays(messages, family, functions[number])
        q, b, kap = (obligation[key] for key in ("q", "b", "kap"))
        decays.append(decay.checked((q, b, kap), obligation["witness"], entry, x))
        doc.done(f"b = {down(b)}")
    rest = sorted(set(range(len(x))) - {end for mode in family.modes for edge in mode.edges for end in edge[:2]})
    first, none = decays[0], [Fraction(0)] * len(rest)
    return [*decays, DecayOfAll(rest, first.b, None, first.left, none, none, none, none)]


class _FormUnderDelays:
    """One function under the delays, errors and disturbances of a family."""

    def __init__(self, messages: Messages, family: Family, V: FunctionOfSignals):
        self.messages, self.family, self.V = messages, family, V
        self.nodes, self.late = V.component.nodes, (messages.gain_cap or 0) * messages.delay
        self.disturbance = Fraction(0) if messages.leaders is None else messages.leaders.disturbance
        self.wrong = messages.value_error + self.disturbance * messages.delay
        self.speeds, self.unit = least(V.speeds)

    @cached_property
    def edges(self) -> list[list[Edge]]:
        """The edges of the component in every mode."""
        own = set(self.nodes)
        return [
            [(edge[0], edge[1], Fraction(edge[4], mode.unit)) for edge in mode.edges if edge[1] in own]
            for mode in self.family.modes
        ]

    def checked(
        self,
        numbers: tuple[Fraction, Fraction, Fraction],
        witness: LateFormWitness,
        entry: LateFamilyForm,
        x: Sequence[Fraction],
    ) -> DecayOfAll:
        """Verify what is said of the function; return the decay that follows."""
        (q, b, kap), V, nodes, wrong = numbers, self.V, self.nodes, self.wrong > 0
        told = [one is not None for one in (entry.floor, witness.psi, entry.push, entry.sizes)]
        asked = [wrong, wrong, self.disturbance > 0, wrong or self.disturbance > 0 or self.messages.growth > 0]
        need(told == asked, "floor and psi are told iff values are off, push iff agents are disturbed, sizes of both")
        need((entry.growth is None) == (not self.messages.growth), "growth is told iff agents move by themselves")
        bits = length((*numbers, self.late, self.wrong, entry.initial, entry.left, V.rate, *witness.phi))
        spend(50 * len(nodes) * len(self.family.modes), bits, bits, "small delays")
        need(b > 0 and b * self.late <= LARGEST_GROWTH, "b is not positive, or too large")
        need(q >= exp(b * self.late)[1], "q is below e^(b h)")
        pushes = self._heard(witness.phi)
        phi = self._outweighing("phi", witness.phi, Fraction(1), pushes, self.late * q)
        need(kap >= 0 and all(kap**2 >= V.largest(push) for push in pushes), "kap is too small")
        need(b + self.late * q * kap <= V.rate / 2, "the delay takes more than the rate")
        grown, lasts = self._grown(entry, b)
        self.wrong *= lasts
        need(entry.initial >= grown * V.root(x), "initial is not proved")
        need_left_at_deadline(self.messages, b, entry.left)
        falling, none = [y * entry.initial for y in phi], [Fraction(0)] * len(nodes)
        standing, stays = none, Fraction(0)
        if witness.psi is not None and entry.floor is not None:
            standing, stays = self._floor(witness.psi, entry.floor), entry.floor
        if entry.push is not None:
            least_push = lasts * lasts * V.largest(dict.fromkeys(nodes, self.disturbance))
            need(entry.push**2 >= least_push, "push is too small")
            most = entry.push / (b * self.messages.least_gain())
            standing = [y + share * most for y, share in zip(standing, phi, strict=True)]
            stays += entry.push * drift_above(self.messages.gain, b, self.messages.gain_cap)
        if entry.sizes is None:
            return DecayOfAll(nodes, b, None, entry.left, [y / b for y in falling], none, falling, standing)
        sizes = self._sizes(entry.sizes)
        away, floor = ([size * y for size in sizes] for y in (entry.initial, stays))
        return DecayOfAll(nodes, b, None, entry.left, away, floor, falling, standing)

    def _floor(self, psi: Numbers, floor: Fraction) -> list[Fraction]:
        """Verify what errors make of the root, and of what acts on every agent; return that."""
        sums = [heard_in_mode(edges, dict.fromkeys(self.nodes, Fraction(1))) for edges in self.edges]
        off = [
            {v: self.late * y + self.wrong * D[v] for v, y in push.items()}
            for push, D in zip(self._heard(psi), sums, strict=True)
        ]
        found = self._outweighing("psi", psi, floor, off, Fraction(1))
        need(all((floor * self.V.rate / 2) ** 2 >= self.V.largest(push) for push in off), "floor is too small")
        return found

    def _grown(self, entry: LateFamilyForm, b: Fraction) -> tuple[Fraction, Fraction]:
        """Verify how fast ``sqrt(V)`` may grow as agents move by themselves.

        Return by how much more it has grown by ``T``, and how much more stands of what drives it. In their coordinates
        agents part at no more than ``growth |xi_k| <= growth size_k sqrt(V)``.
        """
        if entry.growth is None or entry.sizes is None:
            return Fraction(1), Fraction(1)
        pivots, growth = set(self.V.component.pivots.values()), self.messages.growth
        sizes = {v: Fraction(0) if v in pivots else entry.sizes[v] for v in self.nodes}
        share = self.V.spread(sizes)
        known = share is not None and entry.growth >= growth * share
        need(known or entry.growth**2 >= growth**2 * self.V.largest(sizes), "growth is too small")
        grown = self.messages.grown(entry.growth)
        return grown, self.messages.lasting(entry.growth, b) or grown

    def _heard(self, values: Numbers) -> list[dict[int, Fraction]]:
        """Return ``(B phi)_k`` of every mode."""
        own = {v: values[v] for v in self.nodes}
        return [heard_in_mode(edges, own) for edges in self.edges]

    def _outweighing(
        self, name: str, values: Numbers, share: Fraction, pushes: Sequence[Sizes], factor: Fraction
    ) -> list[Fraction]:
        """Verify that values outweigh a share of the speeds and a factor of every push; return those of the nodes."""
        found = [values[v] for v in self.nodes]
        for v, y in zip(self.nodes, found, strict=True):
            label = shorten(self.family.labels[v])
            need(y >= 0, f"{name} of agent {label} is negative")
            most = Fraction(self.speeds.get(v, 0), self.unit) * share + factor * max(push[v] for push in pushes)
            need(y >= most, f"{name} of agent {label} is too small")
        return found

    def _sizes(self, values: Numbers) -> list[Fraction]:
        """Verify how far agents are from their targets, over the root; return that of the nodes."""
        (known, unit), found = least(self.V.sizes), [values[v] for v in self.nodes]
        for v, size in zip(self.nodes, found, strict=True):
            least_size = Fraction(known.get(v, 0), unit)
            need(size >= least_size, f"size of agent {shorten(self.family.labels[v])} is too small")
        return found


def heard_in_mode(edges: Iterable[Edge], phi: Mapping[int, Fraction]) -> dict[int, Fraction]:
    """Return ``sum_l w+_kl phi_l`` of a mode, of sources, targets and largest sizes of edges.

    Examples
    --------
    >>> heard_in_mode([(0, 1, Fraction(2))], {0: Fraction(3), 1: Fraction(1)})
    {0: Fraction(0, 1), 1: Fraction(6, 1)}
    """
    total = dict.fromkeys(phi, Fraction(0))
    for source, target, high in edges:
        total[target] += high * phi[source]
    return total
