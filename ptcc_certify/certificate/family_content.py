"""What a certificate of a family holds, and what follows: behaviours, rates, bounds for every signal.

Nothing here writes, reads or checks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.numbers import integers
from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.checker.family_bounds import deviations, final_box, final_interval, least, peaks
from ptcc_certify.checker.family_function import Scaled
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound
from ptcc_certify.lyapunov.follower_function import FollowerFunction
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.protocols import Protocol
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
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)``."""
        return [self.function.speeds]

    @property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""
        (roots,), scale = integers([[root_above(c) for c in self.function.coordinate_constants]])
        return [(dict(zip(self.function.nodes, roots, strict=True)), Fraction(1, scale))]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state of the component."""
        return root_above(self.function.value(self.quotient.coordinates(x)))


@dataclass(frozen=True, eq=False, repr=False)
class FamilyContent:
    """The parts of a certificate of a family, and what follows from them."""

    family: Family
    protocol: Protocol
    parts: tuple[ComponentProof, ...]
    initial_state: tuple[Fraction, ...] | None = None
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

    def _bound_functions(self, part: ComponentProof) -> list[BoundFunction | FollowerFunction]:
        result: list[BoundFunction | FollowerFunction] = []
        for V in part.functions:
            result.append(BoundFunction(Quotient.of(part.component), V) if isinstance(V, FamilyFunction) else V)
        return result

    @cached_property
    def final_states(self) -> tuple[Interval | None, ...] | None:
        """Ends between which each agent is at the deadline, for every signal; None where no limit is claimed."""
        if self.initial_state is None:
            return None
        result: list[Interval | None] = [None] * self.family.n_nodes
        for part in self.parts:
            nodes = part.component.nodes.tolist()
            x = [self.initial_state[v] for v in nodes]
            for k, ends in self._final(part, x).items():
                result[nodes[k]] = ends
        return tuple(result)

    def _final(self, part: ComponentProof, x: list[Fraction]) -> Mapping[int, Interval | None]:
        component, n = part.component, len(x)
        if component.behaviour == STABILITY:
            return dict.fromkeys(range(n), (Fraction(0), Fraction(0)))
        if component.behaviour == DEPENDS:
            return dict.fromkeys(range(n))
        moves = deviations(self._bound_functions(part), x)
        if component.behaviour == BIPARTITE_CONSENSUS:
            assert component.gauge is not None
            camps = dict(enumerate(component.gauge.tolist()))
            return dict(final_interval(range(n), camps, FamilyGroups(component).sources.tolist(), moves, x))
        return dict(final_box(range(n), moves, x))

    @property
    def bounded(self) -> bool | None:
        """Whether the input is proved bounded for every signal and initial state; None if it is not."""
        pole = self.protocol.gain.pole
        held = (
            part.component.nodes.size == 1 or any(V.rate * pole >= 2 for V in part.functions) for part in self.parts
        )
        return True if all(held) else None

    @cached_property
    def input_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``|u_k|`` for every signal; None if none are proved."""
        if self.initial_state is None or not self.bounded:
            return None
        result = [Fraction(0)] * self.family.n_nodes
        gains = self.protocol.parameters
        for part in self.parts:
            nodes = part.component.nodes.tolist()
            x = [self.initial_state[v] for v in nodes]
            bounds, unit = peaks(self._bound_functions(part), gains, x)
            for k, bound in bounds.items():
                result[nodes[k]] = Fraction(bound, unit)
        return tuple(result)

    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` for every agent and every signal, from the initial state.

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
        clock = np.asarray(self.protocol.gain.clock_at_remaining(remaining))
        bounds = np.full((self.family.n_nodes, clock.size), np.inf)
        for part in self.parts:
            nodes = part.component.nodes
            if nodes.size == 1:
                bounds[nodes] = 0
            x = [self.initial_state[v] for v in nodes.tolist()]
            for V in self._bound_functions(part):
                moves, unit = deviations([V], x)
                if part.component.behaviour == STABILITY and moves:
                    root = V.root(x)
                    sizes = [(vector, factor * root) for vector, factor in V.sizes]
                    moves, unit = least([(moves, Fraction(1, unit)), *sizes])
                if moves:
                    size = np.array([moves[k] / unit for k in range(nodes.size)]) * (1 + 1e-12)
                    decay = np.exp(-float(V.rate) * (1 - 1e-12) / 2 * clock)
                    bounds[nodes] = np.minimum(bounds[nodes], np.multiply.outer(size, decay))
        return bounds
