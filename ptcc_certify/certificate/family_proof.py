"""What is proved of a family, and what follows: behaviours, rates, bounds for every signal.

Nothing here writes, reads or checks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.decay import ReachingPhase
from ptcc_certify.bounds.deviation.component_bounds import ComponentBounds, FunctionOf, RestStates
from ptcc_certify.bounds.deviation.heard import HeardRows
from ptcc_certify.bounds.final_state.attracting_box import AttractingBox
from ptcc_certify.bounds.final_state.constant_weights import LeadingGroup, leading_groups
from ptcc_certify.bounds.final_state.enclosed_ends import FinalEnds
from ptcc_certify.bounds.instants import Instants, remaining_part
from ptcc_certify.certificate.constrained_switching.claims import (
    Claim,
    FinalValueClaim,
    LastModeClaim,
    RateClaim,
    ShareClaim,
    WindowClaim,
)
from ptcc_certify.certificate.functions import ProvedFunction
from ptcc_certify.certificate.request import Proof
from ptcc_certify.checker.common_kernel_ends import agents_heard, limits
from ptcc_certify.checker.protocol import last_time, sliding_bounded, sliding_part
from ptcc_certify.checker.reading import Interval
from ptcc_certify.checker.signal_bounds import Drive, deviations, ends_near, peaks
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import STABILITY
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.follower_function import FollowerFunction
from ptcc_certify.lyapunov.slow_signals import SignalRateBound
from ptcc_certify.model.constrained_switching import SignalClass
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent
from ptcc_certify.theorems.kernel import UNKNOWN


@dataclass(frozen=True, eq=False)
class ComponentProof:
    """What is proved of one component beside its behaviour.

    Attributes
    ----------
    component : FamilyComponent
    functions : tuple of CommonForm, FollowerFunction or SquaresFunction
        Proved, the largest rate first; nodes are numbered within the component.
    upper_bound : SignalRateBound or None
        No rate for every signal is larger.
    """

    component: FamilyComponent
    functions: tuple[ProvedFunction, ...] = ()
    upper_bound: SignalRateBound | None = None

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate for every signal; None if there is none."""
        return max((V.rate for V in self.functions if V.rate > 0), default=None)

    @property
    def forms(self) -> tuple[CommonForm, ...]:
        """The quadratic ones of the functions."""
        return tuple(V for V in self.functions if isinstance(V, CommonForm))

    @property
    def certifiable(self) -> bool:
        """Whether the behaviour is decided, and the rows of a common kernel are few enough to be written."""
        kernel = self.component.kernel
        return self.component.behaviour is not None and (kernel is None or kernel.has_rows)

    @cached_property
    def leading_groups(self) -> tuple[LeadingGroup, ...]:
        """The leading group of every column of the common kernel."""
        return leading_groups(self.component)

    @cached_property
    def rest_states(self) -> RestStates | None:
        """The common kernel as the formulas of the bounds take it; None where it is not known."""
        if self.component.behaviour == STABILITY:
            return RestStates({k: {} for k in range(self.component.nodes.size)}, ())
        if self.component.kernel is None or not self.component.kernel.has_rows:
            return None
        return RestStates(self.kernel_rows, [group.nodes for group in self.leading_groups])

    @property
    def kernel_rows(self) -> dict[int, dict[int, Fraction]]:
        """The rows of the basis of the common kernel, without zeros, by nodes of the component."""
        kernel = self.component.kernel
        assert kernel is not None, "the component has a common kernel"
        rows: dict[int, dict[int, Fraction]] = {}
        for v, code in enumerate(kernel.codes.tolist()):
            if code == UNKNOWN:
                rows[v] = {j: b for j, b in enumerate(kernel.row(v)) if b}
            else:
                rows[v] = {abs(code) - 1: Fraction(1 if code > 0 else -1)} if code else {}
        return rows


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FamilyProof(Proof):
    """What is proved of a family of graphs, and what follows.

    Attributes
    ----------
    parts : tuple of ComponentProof
        One for each weakly connected component of all edges of all modes.
    restricted : tuple of Claim
        What holds for the signals that were asked for, beside what holds for every signal.
    boxes : mapping of int to AttractingBox
        Where every signal brings the followers of components that depend on it, by the numbers of these.
    ranges : mapping of int to tuple of (Fraction, Fraction)
        Between which ends every signal keeps each agent of these components, at all times.
    """

    parts: tuple[ComponentProof, ...]
    restricted: tuple[Claim, ...] = ()
    boxes: Mapping[int, AttractingBox] = field(default_factory=dict)
    ranges: Mapping[int, tuple[Interval, ...]] = field(default_factory=dict)

    #: Agents of order n are of one graph, but for those that exchange virtual positions.
    agents = None

    @property
    def family(self) -> Family:
        """The family."""
        assert isinstance(self.question.subject, Family)
        return self.question.subject

    @property
    def signal(self) -> SignalClass:
        """The signals that it was asked for."""
        return self.request.signal

    @property
    def checkable(self) -> bool:
        """Whether every behaviour is decided, and takes few enough rows to be written."""
        return all(part.certifiable for part in self.parts)

    @property
    def headline(self) -> str:
        """Behaviour in a few words."""
        behaviour = self.parts[0].component.behaviour or "not decided"
        if len(self.parts) > 1:
            return f"{len(self.parts):,} components"
        every = behaviour in self.behaviours and behaviour != DEPENDS and self.family.graph is None
        return behaviour + (" for every signal" if every else "")

    @property
    def ends(self) -> list[Interval] | None:
        """Where agents end, as middles and radii; None where some end is not known."""
        known = [pair for pair in self.final_state or () if pair is not None]
        middles = [((low + high) / 2, (high - low) / 2) for low, high in known]
        return middles if len(known) == self.family.n_nodes else None

    @property
    def main_figure(self) -> str:
        """The figure that is drawn where none is named: the decay, or the states where nothing of one is proved.

        With late messages what is left, while leaders move how they are tracked.
        """
        if self.late is not None:
            return "graph" if not self.late.says_something else "tracking" if self.late.tracks else "late"
        nothing = self.initial_state is not None and not np.isfinite(self.deviation_bound([0.5])).any()
        return "states" if nothing else "decay"

    @property
    def longest_way(self) -> float | None:
        """The longest way of an agent from its initial to its final state (numerical); None if unknown."""
        if self.initial_state is None or self.final_state is None:
            return None
        pairs = zip(self.initial_state, self.final_state, strict=True)
        return max((float(max(abs(x - y) for y in ends)) for x, ends in pairs if ends is not None), default=None)

    @property
    def constant(self) -> bool:
        """Whether no agent listens to another in any graph, so that there is no decay to certify."""
        return all(part.component.nodes.size == 1 for part in self.parts)

    @property
    def reading_notes(self) -> tuple[str, ...]:
        """Which of :attr:`notes` are of how the family was read."""
        return self.family.notes

    @property
    def common(self) -> bool:
        """Whether every component keeps one kernel, so that every signal brings all agents to rest."""
        return all(part.component.behaviour not in (None, DEPENDS) for part in self.parts)

    @property
    def unbounded(self) -> bool:
        """Whether the input is proved to grow without limit for some signal and some initial state.

        Where rest states differ, or where the upper bound of the rate times ``rho2 kappa / 2`` is below 1.
        """
        pole, bounds = self.protocol.gain.pole, [part.upper_bound for part in self.parts]
        slow = any(bound is not None and bound.value * pole < 2 for bound in bounds)
        return slow or any(part.component.behaviour == DEPENDS for part in self.parts)

    @property
    def behaviours(self) -> tuple[str, ...]:
        """What every component does for every signal."""
        return tuple(str(part.component.behaviour) for part in self.parts)

    @property
    def rate(self) -> Fraction | None:
        """The rate that every component has for every signal; None if some has none that is proved."""
        rates = [part.rate for part in self.parts if part.component.nodes.size > 1]
        return None if None in rates else min((r for r in rates if r is not None), default=None)

    @property
    def rate_of_signal(self) -> Fraction | None:
        """The rate that every component has for the signals that were asked for; None if some has none.

        Each has at least that for every signal.
        """
        own = {claim.component: claim.rate for claim in self.restricted if isinstance(claim, RateClaim | ShareClaim)}
        both = [(own.get(k), part.rate) for k, part in enumerate(self.parts) if part.component.nodes.size > 1]
        rates = [max((r for r in pair if r is not None), default=None) for pair in both]
        return None if None in rates else min((r for r in rates if r is not None), default=None)

    @property
    def ends_of_signal(self) -> Mapping[int, LastModeClaim | WindowClaim | ShareClaim]:
        """Where agents end under restricted signals, by the numbers of components that depend on the signal."""
        own = {k for k, part in enumerate(self.parts) if part.component.behaviour == DEPENDS}
        claims = (claim for claim in self.restricted if not isinstance(claim, RateClaim | FinalValueClaim))
        return {claim.component: claim for claim in claims if claim.component in own}

    @property
    def final_values(self) -> Mapping[int, FinalValueClaim]:
        """Where agents end if mode and weights never change, by the numbers of components of which it is claimed."""
        return {claim.component: claim for claim in self.restricted if isinstance(claim, FinalValueClaim)}

    @property
    def member_bound(self) -> Fraction | None:
        """No rate for constant signals is larger; None if none is proved."""
        bounds = (part.upper_bound for part in self.parts)
        return min((b.value for b in bounds if b is not None and b.kind == "member"), default=None)

    @property
    def upper_bound(self) -> Fraction | None:
        """No rate for every signal is larger; None if none is proved."""
        return min((part.upper_bound.value for part in self.parts if part.upper_bound is not None), default=None)

    # ------------------------------------------------------------------ bounds

    @property
    def settling_share(self) -> float:
        """The share of ``T`` in which no sliding variable moves: ``T_s / T``, or 1."""
        return 1.0 if self.direct else float(self.protocol.span / self.protocol.T)

    @cached_property
    def nominal_state(self) -> tuple[Fraction, ...] | None:
        """``x(0) - sigma(0)``, where there is an initial state."""
        if self.initial_state is None or self.sigma0 is None:
            return self.initial_state
        return tuple(x - s for x, s in zip(self.initial_state, self.sigma0, strict=True))

    @cached_property
    def _drives(self) -> tuple[Drive | None, ...]:
        """What sliding variables do to every component; its nodes are numbered within it."""
        if self.sigma0 is None or self.reaching is None or self.direct:
            return (None,) * len(self.parts)
        ends = (zip(mode.source.tolist(), mode.target.tolist(), strict=True) for mode in self.family.modes)
        edges = [
            [(s, t, mode.upper.fraction(e)) for e, (s, t) in enumerate(pairs)]
            for mode, pairs in zip(self.family.modes, ends, strict=True)
        ]
        quiet = last_time([r.z for r in self.reaching], self.sigma0)
        whole = Drive.of(self.protocol.parameters, dict(enumerate(self.sigma0)), quiet, edges)
        return tuple(whole.restricted(part.component.nodes.tolist()) for part in self.parts)

    @cached_property
    def drives(self) -> tuple[Fraction, ...] | None:
        """``c`` of every function, part after part: how much sliding variables drive it; None if none moves."""
        if self.direct:
            return None
        return tuple(own.constant(V) for part, own in self._driven_parts if own is not None for V in part.functions)

    @property
    def _driven_parts(self) -> Iterator[tuple[ComponentProof, Drive | None]]:
        """Of every part what sliding variables do to it."""
        return zip(self.parts, self._drives, strict=True)

    @cached_property
    def final_state(self) -> FinalEnds | None:
        """Ends between which each agent is at the deadline, for every signal; None where no limit is claimed.

        By label, or by place where no label is a number: ``final_state["ann"]``.
        """
        if self.initial_state is None:
            return None
        result: list[Interval | None] = [None] * self.family.n_nodes
        for part, driven in self._driven_parts:
            for k, ends in self._final(part, driven).items():
                result[int(part.component.nodes[k])] = ends
        return FinalEnds(result, self.family.labels)

    @property
    def final_positions(self) -> FinalEnds | None:
        """Where agents end: in a formation ``final_state`` is less their places."""
        ends = self.final_state
        return ends if ends is None or self.offsets is None else FinalEnds(self.in_places(ends), self.family.labels)

    def in_places(self, ends: Sequence[Interval | None]) -> list[Interval | None]:
        """Return intervals of ``x - offsets`` of all agents as those of positions."""
        if self.offsets is None:
            return list(ends)
        pairs = zip(ends, self.offsets, strict=True)
        return [None if pair is None else (pair[0] + h, pair[1] + h) for pair, h in pairs]

    def places_in(self, part: ComponentProof) -> list[Fraction]:
        """Return the places of the agents of a component, 0 where there is no formation."""
        return [Fraction(0) if self.offsets is None else self.offsets[v] for v in part.component.nodes.tolist()]

    def _state(self, part: ComponentProof) -> list[Fraction]:
        """Return ``x(0) - sigma(0)`` of a component."""
        assert self.nominal_state is not None
        return [self.nominal_state[v] for v in part.component.nodes.tolist()]

    def _final(self, part: ComponentProof, driven: Drive | None) -> Mapping[int, Interval | None]:
        component, x = part.component, self._state(part)
        n = len(x)
        if component.behaviour == STABILITY:
            return dict.fromkeys(range(n), (Fraction(0), Fraction(0)))
        if component.behaviour in (None, DEPENDS) or not part.certifiable:
            return dict.fromkeys(range(n))
        means = {j: c for j, group in enumerate(part.leading_groups) if (c := group.final_value(x)) is not None}
        groups = {j: group.nodes for j, group in enumerate(part.leading_groups)}
        kernel = part.kernel_rows
        near, wide = ends_near(kernel, groups, part.functions, x, driven)
        return dict(limits(kernel, groups, means, near, deviations(part.functions, x, driven), x, wide))

    @property
    def bounded(self) -> bool | None:
        """Whether the input is proved bounded for every signal and initial state; None if it is not.

        Under the sliding-mode protocol its nominal part; of the sliding part see :attr:`sliding_bounded`.
        """
        pole = self.protocol.gain.pole
        each = (
            part.component.nodes.size == 1 or any(V.rate * pole >= 2 for V in part.functions) for part in self.parts
        )
        return True if all(each) else None

    @property
    def sliding_bounded(self) -> bool | None:
        """Whether the sliding part of the input is bounded for every ``sigma(0)``; None if there is none."""
        return None if self.sigma0 is None else sliding_bounded(self.protocol.parameters)

    @cached_property
    def sliding_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``|u_k - u_k^nom|`` under the sliding-mode protocol; None if none are proved."""
        own = None if self.sigma0 is None else sliding_part(self.protocol.parameters, self.sigma0)
        return None if own is None else tuple(own)

    @cached_property
    def nominal_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``gain |(L x)_k|`` for every signal; None if none are proved."""
        if self.initial_state is None or not self.bounded:
            return None
        result = [Fraction(0)] * self.family.n_nodes
        gains = self.protocol.parameters
        for part, driven in self._driven_parts:
            nodes = part.component.nodes.tolist()
            bounds, unit = peaks(part.functions, gains, self._state(part), driven)
            for k, bound in bounds.items():
                result[nodes[k]] = Fraction(bound, unit)
        return tuple(result)

    @property
    def input_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``|u_k|`` for every signal, its sliding part included; None if none are proved."""
        nominal, own = self.nominal_peaks, self.sliding_peaks
        if nominal is None or self.sigma0 is None:
            return nominal
        return None if own is None else tuple(x + y for x, y in zip(nominal, own, strict=True))

    def input_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|u_k(t)|`` for every agent and every signal, from the initial state.

        ``|u_k| = gain |(L X)_k| <= gain sqrt(inputs_k V(0)) e^(-rate s / 2)``; it grows without limit towards the
        deadline if ``rate rho2 kappa < 2``. Under the sliding-mode protocol with what its sliding part adds at most,
        whatever the disturbances.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in (0, 1].

        Returns
        -------
        (N, M) array
            Infinite where nothing is proved.

        Raises
        ------
        ParameterError
            There is no initial state, or an instant is not from 0 to 1.
        """
        self._require_state()
        at, gain = self._instants(remaining), self.protocol.gain.value_at_remaining(_row(remaining))
        bounds = np.full((self.family.n_nodes, at.clock.size), np.inf)
        for part, own in zip(self.parts, self._component_bounds, strict=True):
            bounds[part.component.nodes] = own.input(at, gain)
        if self.sigma0 is None:
            return bounds
        added = [np.inf] * len(bounds) if self.sliding_peaks is None else list(map(nearest_float, self.sliding_peaks))
        return np.asarray((bounds + np.array(added)[:, None]) * (1 + 1e-12))

    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` for every agent and every signal, as :meth:`input_bound` bounds the input.

        With nothing late, leaders at rest and an unlimited gain; otherwise, and of vehicles, ``late`` tells.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].
        """
        self._require_state()
        return self._deviation(self._instants(remaining))

    def deviation_at(self, clock: np.ndarray) -> np.ndarray:
        """Return the same bound, (N, M), at (M,) instants of the stretched clock; no sliding variable moves."""
        assert self.direct
        return self._deviation(Instants(clock))

    def _deviation(self, at: Instants) -> np.ndarray:
        bounds = np.full((self.family.n_nodes, at.clock.size), np.inf)
        for part, own in zip(self.parts, self._component_bounds, strict=True):
            bounds[part.component.nodes] = own.deviation(at)
        return bounds

    @cached_property
    def _component_bounds(self) -> tuple[ComponentBounds, ...]:
        """The bounds over time of every component."""
        return tuple(self._bounds_of(*one) for one in self._driven_parts)

    def _bounds_of(self, part: ComponentProof, driven: Drive | None) -> ComponentBounds:
        """Return the bounds of a component; where nothing drives it by functions of parts that others follow, too."""
        everybody = np.arange(part.component.nodes.size)
        own = [FunctionOf(everybody, V, part.rest_states) for V in part.functions]
        if driven is not None:
            return ComponentBounds(own, self._state(part), drive=driven, phase=self._phase)
        rows = HeardRows.of(part.component.family)
        finals = (
            None if rows is None or self.final_state is None else tuple(self.final_state)
        )  # of large families they take long
        ends = [] if finals is None else [finals[v] for v in part.component.nodes.tolist()]
        known = [pair for pair in ends if pair is not None]
        for led in (led for V in part.functions if isinstance(V, FollowerFunction) for led in V.parts):
            own.append(FunctionOf(led.agents, led.function, _rest_states(led.function.quotient)))
        return ComponentBounds(own, self._state(part), rows, known if len(known) == everybody.size else None)

    def norm_bound(self, V: Any, part: int, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound ``sqrt(V(x - sigma))`` of a function of a part at instants ``1 - t/T``, from the initial state.

        Where no sliding variable moves it is ``e^(-rate s / 2) sqrt(V(0))``.
        """
        own = self._component_bounds[part]
        decay, unit = own.decay(FunctionOf(np.arange(len(own.x)), V, None))
        return decay.times(float_up(unit), self._instants(remaining))

    def _require_state(self) -> None:
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the family with x0")

    def _instants(self, remaining: Sequence[float] | np.ndarray) -> Instants:
        """Return values of the clock, and those of the reaching phase if there is one."""
        if not self.direct:
            return self._phase.instants(_row(remaining))
        return Instants(np.asarray(self.protocol.gain.clock_at_remaining(_row(remaining))))

    @cached_property
    def _phase(self) -> ReachingPhase:
        assert self.protocol.reaching is not None and self.reaching is not None
        return ReachingPhase(self.protocol.reaching, self.reaching, self.sigma0 or ())


def _rest_states(quotient: Quotient) -> RestStates:
    """Return the common kernel of a leading part as the formulas of the bounds take it."""
    source, target, _ = quotient.family.union
    rows = {v: {j: b for j, b in enumerate(row) if b} for v, row in enumerate(quotient.basis)}
    groups = agents_heard(zip(source.tolist(), target.tolist(), strict=True), dict(enumerate(quotient.pivots)))
    return RestStates(rows, list(groups.values()))


def _row(remaining: Any) -> np.ndarray:
    """Return values of ``1 - t/T``, (M,), or refuse them."""
    return np.atleast_1d(remaining_part(remaining))
