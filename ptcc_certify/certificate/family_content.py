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
from ptcc_certify.bounds.kept_means import LeadingGroup, leading_groups
from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.certificate.restricted_claims import Claim, LastModeClaim, RateClaim, ShareClaim, WindowClaim
from ptcc_certify.checker.family_bounds import deviations, least, mean_intervals, peaks
from ptcc_certify.checker.family_function import Scaled
from ptcc_certify.checker.family_limits import WeightedMean, limits
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import STABILITY
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound
from ptcc_certify.lyapunov.follower_function import FollowerFunction
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.protocols import Protocol
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent
from ptcc_certify.theorems.family_kernel import UNKNOWN
from ptcc_certify.theorems.restricted_signals import SignalClass


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

    @property
    def certifiable(self) -> bool:
        """Whether the behaviour is decided, and the rows of a common kernel are few enough to be written."""
        kernel = self.component.kernel
        return self.component.behaviour is not None and (kernel is None or kernel.has_rows)

    @cached_property
    def leading_groups(self) -> tuple[LeadingGroup, ...]:
        """The leading group of every column of the common kernel."""
        return leading_groups(self.component)

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

    @property
    def means(self) -> list[WeightedMean]:
        """Weighted means of leading groups, with their constants."""
        codes, result = self.quotient.kernel.codes, []
        for q, constant in self.function.means:
            weights = {v: w for v, w in enumerate(q) if w}
            signs = {v: int(codes[v]) for v in weights}
            size = sum((w if signs[v] > 0 else -w for v, w in weights.items()), Fraction(0))
            result.append(WeightedMean(abs(signs[min(signs)]) - 1, weights, size, constant))
        return result

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
    signal: SignalClass = "any"
    restricted: tuple[Claim, ...] = ()

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
        """The rate that every component has for the signals that were asked for; None if some has none."""
        own = {claim.component: claim.rate for claim in self.restricted if isinstance(claim, RateClaim | ShareClaim)}
        rates = [own.get(k, part.rate) for k, part in enumerate(self.parts) if part.component.nodes.size > 1]
        return None if None in rates else min((r for r in rates if r is not None), default=None)

    @property
    def ends_of_signal(self) -> Mapping[int, LastModeClaim | WindowClaim | ShareClaim]:
        """Where agents end under restricted signals, by the numbers of components that depend on the signal."""
        own = {k for k, part in enumerate(self.parts) if part.component.behaviour == DEPENDS}
        claims = (claim for claim in self.restricted if not isinstance(claim, RateClaim))
        return {claim.component: claim for claim in claims if claim.component in own}

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
        if component.behaviour in (None, DEPENDS) or not part.certifiable:
            return dict.fromkeys(range(n))
        groups = dict(enumerate(part.leading_groups))
        means = {j: c for j, group in groups.items() if (c := group.final_value(x)) is not None}
        functions = self._bound_functions(part)
        near, moves = mean_intervals(functions, x), deviations(functions, x)
        return dict(limits(part.kernel_rows, {j: group.nodes for j, group in groups.items()}, means, near, moves, x))

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

    def input_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|u_k(t)|`` for every agent and every signal, from the initial state.

        ``|u_k| = gain |(L X)_k| <= gain sqrt(inputs_k V(0)) e^(-rate s / 2)``; it grows without limit towards the
        deadline if ``rate rho2 kappa < 2``.

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
            There is no initial state.
        """
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the family with x0")
        gain = self.protocol.gain
        clock, height = (np.asarray(of(remaining)) for of in (gain.clock_at_remaining, gain.value_at_remaining))
        bounds = np.full((self.family.n_nodes, clock.size), np.inf)
        for part in self.parts:
            nodes = part.component.nodes
            if nodes.size == 1:
                bounds[nodes] = 0
            x = [self.initial_state[v] for v in nodes.tolist()]
            for V in self._bound_functions(part):
                speeds, unit = least(V.speeds)
                root = V.root(x) / unit
                size = np.array([float(speeds[k] * root) for k in range(nodes.size)]) * (1 + 1e-12)
                decay = height * np.exp(-float(V.rate) * (1 - 1e-12) / 2 * clock)
                bounds[nodes] = np.minimum(bounds[nodes], np.multiply.outer(size, decay))
        return bounds

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
        return self.deviation_at(np.asarray(self.protocol.gain.clock_at_remaining(remaining)))

    def deviation_at(self, clock: np.ndarray) -> np.ndarray:
        """Return the same bound, (N, M), at (M,) instants of the stretched clock, from the initial state."""
        assert self.initial_state is not None
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
                    bounds[nodes] = np.fmin(bounds[nodes], np.multiply.outer(size, decay))
        return bounds
