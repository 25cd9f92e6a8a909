"""What a certificate of a family holds, and what follows: behaviours, rates, bounds for every signal.

Nothing here writes, reads or checks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ptcc_certify.bounds.envelope import Instants
from ptcc_certify.bounds.family_deviation import deviation_on_clock, deviation_while_driven, sliding_sizes
from ptcc_certify.bounds.reaching_phase import ReachingPhase
from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.checker.family_bounds import deviations, final_interval, largest_state, peaks
from ptcc_certify.checker.family_sliding import Drive, last_time
from ptcc_certify.checker.protocol import sliding_bounded, sliding_part
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound
from ptcc_certify.lyapunov.follower_function import FollowerFunction
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent
from ptcc_certify.theorems.family_groups import FamilyGroups


@dataclass(frozen=True, eq=False)
class ComponentProof:
    """What is proved of one component beside its behaviour.

    Attributes
    ----------
    component : FamilyComponent
    functions : tuple of FamilyFunction
        Proved, the largest rate first; nodes are numbered within the component.
    upper_bound : FamilyRateBound or None
        No rate for every signal is larger.
    """

    component: FamilyComponent
    functions: tuple[FamilyFunction | FollowerFunction, ...] = ()
    upper_bound: FamilyRateBound | None = None

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate for every signal; None if there is none."""
        return max((V.rate for V in self.functions if V.rate > 0), default=None)


@dataclass(frozen=True)
class BoundFunction:
    """A function of a component as the formulas of the bounds take it: by nodes of the component."""

    quotient: Quotient
    function: FamilyFunction

    @property
    def rate(self) -> Fraction:
        """The rate for every signal."""
        return self.function.rate

    @property
    def inputs(self) -> Mapping[int, Fraction]:
        """``|(L X)_k|^2 <= inputs[k] V``."""
        return dict(enumerate(self.function.input_constants))

    @property
    def coordinates(self) -> Mapping[int, Fraction]:
        """``xi_k^2 <= coordinates[k] V``."""
        return dict(zip(self.function.nodes, self.function.coordinate_constants, strict=True))

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of a state of the component."""
        return self.function.value(self.quotient.coordinates(x))

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``."""
        return self.function.largest(self.quotient.coordinate_sizes(sizes))


@dataclass(frozen=True, eq=False, repr=False)
class FamilyContent:
    """The parts of a certificate of a family, and what follows from them."""

    family: Family
    protocol: Protocol
    parts: tuple[ComponentProof, ...]
    initial_state: tuple[Fraction, ...] | None = None
    sigma0: tuple[Fraction, ...] | None = None
    reaching: tuple[ReachingTime, ...] | None = None
    disturbance: str | None = None
    expectations: Expectations = field(default_factory=Expectations)
    notes: tuple[str, ...] = ()
    source: Source | None = None
    origins: Mapping[str, str] = field(default_factory=dict)
    scenario: Mapping[str, Any] | None = None

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
    def upper_bound(self) -> Fraction | None:
        """No rate for every signal is larger; None if none is proved."""
        return min((part.upper_bound.value for part in self.parts if part.upper_bound is not None), default=None)

    # ------------------------------------------------------------------ bounds

    @property
    def direct(self) -> bool:
        """Whether no sliding variable moves: the agents move as without disturbances."""
        return self.sigma0 is None or not any(self.sigma0)

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
        return tuple(self._drive(part.component) for part in self.parts)

    def _drive(self, component: FamilyComponent) -> Drive:
        assert self.sigma0 is not None and self.reaching is not None
        sigma0 = dict(enumerate(self.sigma0[v] for v in component.nodes.tolist()))
        edges = [
            [
                (int(s), int(t), mode.upper.fraction(e))
                for e, (s, t) in enumerate(zip(mode.source, mode.target, strict=True))
            ]
            for mode in component.family.modes
        ]
        quiet = last_time([r.z for r in self.reaching], self.sigma0)
        return Drive.of(self.protocol.parameters, sigma0, quiet, edges)

    @cached_property
    def drives(self) -> tuple[Fraction, ...] | None:
        """``c`` of every function, part after part: how much sliding variables drive it; None if none moves."""
        if self.direct:
            return None
        pairs = zip(self.parts, self._drives, strict=True)
        return tuple(own.constant(V) for part, own in pairs if own is not None for V in self._bound_functions(part))

    def _bound_functions(self, part: ComponentProof) -> Sequence[BoundFunction | FollowerFunction]:
        return self.bound_functions[self.parts.index(part)]

    @cached_property
    def bound_functions(self) -> tuple[tuple[BoundFunction | FollowerFunction, ...], ...]:
        """The functions of every part, as the formulas of the bounds take them."""
        return tuple(
            tuple(
                BoundFunction(Quotient.of(part.component), V) if isinstance(V, FamilyFunction) else V
                for V in part.functions
            )
            for part in self.parts
        )

    @cached_property
    def final_states(self) -> tuple[Interval | None, ...] | None:
        """Ends between which each agent is at the deadline, for every signal; None where no limit is claimed."""
        if self.initial_state is None:
            return None
        result: list[Interval | None] = [None] * self.family.n_nodes
        for part, driven in zip(self.parts, self._drives, strict=True):
            for k, ends in self._final(part, self._state(part), driven).items():
                result[int(part.component.nodes[k])] = ends
        return tuple(result)

    def _state(self, part: ComponentProof) -> list[Fraction]:
        """Return ``x(0) - sigma(0)`` of a component."""
        assert self.nominal_state is not None
        return [self.nominal_state[v] for v in part.component.nodes.tolist()]

    def _final(self, part: ComponentProof, x: list[Fraction], driven: Drive | None) -> Mapping[int, Interval | None]:
        component, n = part.component, len(x)
        if component.behaviour == STABILITY:
            return dict.fromkeys(range(n), (Fraction(0), Fraction(0)))
        if component.behaviour == DEPENDS:
            return dict.fromkeys(range(n))
        moves = deviations(self._bound_functions(part), False, x, driven)
        if component.behaviour == BIPARTITE_CONSENSUS:
            assert component.gauge is not None
            camps = dict(enumerate(component.gauge.tolist()))
            return dict(final_interval(range(n), camps, FamilyGroups(component).sources.tolist(), moves, x, driven))
        largest = largest_state(range(n), x, driven)
        reach = {k: moves.get(k, 2 * largest + abs(x[k])) for k in range(n)}
        return {k: (max(-largest, x[k] - d), min(largest, x[k] + d)) for k, d in reach.items()}

    @property
    def bounded(self) -> bool | None:
        """Whether the input is proved bounded for every signal and initial state; None if it is not.

        Under the sliding-mode protocol its nominal part; of the sliding part see :attr:`sliding_bounded`.
        """
        pole = self.protocol.gain.pole
        held = (
            part.component.nodes.size == 1 or any(V.rate * pole >= 2 for V in part.functions) for part in self.parts
        )
        return True if all(held) else None

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
        for part, driven in zip(self.parts, self._drives, strict=True):
            nodes = part.component.nodes.tolist()
            for k, bound in peaks(self._bound_functions(part), gains, self._state(part), driven).items():
                result[nodes[k]] = bound
        return tuple(result)

    @property
    def input_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``|u_k|`` for every signal, its sliding part included; None if none are proved."""
        nominal, own = self.nominal_peaks, self.sliding_peaks
        if nominal is None or self.sigma0 is None:
            return nominal
        return None if own is None else tuple(x + y for x, y in zip(nominal, own, strict=True))

    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` for every agent and every signal, from the initial state.

        Whatever the disturbances, under the sliding-mode protocol.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (N, M) array
            Infinite where nothing is proved.

        Raises
        ------
        ParameterError
            There is no initial state.
        """
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the family with x0")
        at = self._instants(remaining)
        bounds = np.full((self.family.n_nodes, at.clock.size), np.inf)
        for part, driven in zip(self.parts, self._drives, strict=True):
            nodes, x, stable = part.component.nodes, self._state(part), part.component.behaviour == STABILITY
            if nodes.size == 1:
                bounds[nodes] = 0 if driven is None else sliding_sizes(driven, self._phase, at)
            for V in self._bound_functions(part):
                if driven is None:
                    own = deviation_on_clock(V, stable, x, at.clock)
                else:
                    own = deviation_while_driven(V, stable, x, driven, self._phase, at)
                if own is not None:
                    bounds[nodes] = np.minimum(bounds[nodes], own)
        return bounds

    def norm_bound(self, V: Any, part: int, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound ``sqrt(V(x - sigma))`` of a function of a part at instants ``1 - t/T``, from the initial state.

        Where no sliding variable moves it is ``e^(-rate s / 2) sqrt(V(0))``.
        """
        at, half, driven = self._instants(remaining), float(V.rate) / 2, self._drives[part]
        root = math.sqrt(nearest_float(V.value(self._state(self.parts[part])))) * (1 + 1e-12)
        if driven is None:
            return root * np.exp(-half * at.clock)
        return self._phase.driven(half, root, nearest_float(driven.constant(V)), at)

    def _instants(self, remaining: Sequence[float] | np.ndarray) -> Instants:
        """Return values of the clock, and those of the reaching phase if there is one."""
        if not self.direct:
            return self._phase.instants(np.asarray(remaining, dtype=float))
        return Instants(np.asarray(self.protocol.gain.clock_at_remaining(remaining)))

    @cached_property
    def _phase(self) -> ReachingPhase:
        assert self.protocol.reaching is not None and self.reaching is not None
        return ReachingPhase(self.protocol.reaching, self.reaching)
