"""What the proved rate says under the sliding-mode protocol, through the reaching phase and on to ``T_r + T_s``.

With ``y = x - sigma`` and ``A`` the matrix of the certificate's coordinates ``z`` (rows of ``E``, or ``eps``),

    z_y' = -gain (A z_y + B sigma),      sqrt(V)' <= -(rate/2) gain sqrt(V) + gain || |B| |sigma| ||_Omega

so that on the clock ``s``, ``v = sqrt(V(y))``:

    v(s) <= e^(-rate s/2) v(0) + int_0^s e^(-rate (s - r)/2) || |B| b ||_Omega dr

where ``b_k`` bounds ``|sigma_k|`` whatever the disturbance. The coordinates of ``x`` are those of ``y`` and of
``sigma``: ``||z_x||_Omega <= v + || |C| b ||_Omega``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.bounds.envelope import (
    FLOOR_FACTOR,
    Comparison,
    Envelope,
    History,
    Instants,
    clock_values,
    deviation_constants,
)
from ptcc_certify.bounds.reaching_phase import ReachingPhase
from ptcc_certify.errors import ParameterError
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.base import ReachingProtocol
from ptcc_certify.model.reaching_time import ReachingTime, sliding_bound

if TYPE_CHECKING:
    from ptcc_certify.simulation.trajectory import Trajectory

#: Lyapunov functions and arrays of instants whose bounds are kept.
_CACHE_SIZE = 32
#: A function, ``|R C|``, and where each piece begins, and at ``T_r``, its bound and what drives it.
_Driven = tuple[LyapunovFunction, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class SlidingEnvelope(Envelope):
    """The proved bounds under the sliding-mode protocol, for one ``sigma(0)`` and every disturbance within ``delta``.

    Attributes
    ----------
    protocol : SlidingModeProtocol
    sigma0 : tuple of Fraction
        ``sigma(0)``, N numbers.
    reaching : tuple of ReachingTime
        Proved reaching times, one for each agent.

    References
    ----------
    Theorems 4 to 6 and Proposition 1 of [Zhu]_.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> envelope = certify(pair, robust, InitialState([3, 1], sigma0=[1, 0]), asks=Asks(simulation=False)).envelope
    >>> bool(envelope.deviation_bound(0.01, [3, 1]).max() < 0.01)  # of every agent at 0.99 (T_r + T_s)
    True
    >>> bool(envelope.sliding_norm(0.0) >= 1)  # ||sigma(0)|| = 1
    True
    """

    protocol: ReachingProtocol
    sigma0: tuple[Fraction, ...]
    reaching: tuple[ReachingTime, ...]

    @property
    def direct(self) -> bool:
        """Whether ``sigma(0) = 0``: there is no reaching phase, and the bounds are those of the nominal protocol."""
        return not any(self.sigma0)

    @cached_property
    def _phase(self) -> ReachingPhase:
        return ReachingPhase(self.protocol, self.reaching)

    def _at(self, clock: Any) -> Instants:
        """Refuse values of the clock alone where there is a reaching phase."""
        if not self.direct:
            raise ParameterError("sigma(0) is not 0: in the reaching phase ask state_bound or deviation_bound")
        return super()._at(clock)

    def _when(self, remaining: Any) -> Instants:
        """Return ``s`` and ``z`` where ``1 - t/(T_r + T_s)`` is ``remaining``, or refuse it."""
        return self._phase.instants(remaining)

    def _of(self, trajectory: Trajectory) -> Instants:
        run = trajectory.sliding
        assert run is not None
        with np.errstate(divide="ignore"):
            return Instants(trajectory.clock, -np.log(run.reaching_remaining))

    def state_bound(self, remaining: np.ndarray | float, x0: Any) -> np.ndarray:
        """Bound of ``||z(x)||`` where ``1 - t/(T_r + T_s)`` is ``remaining``, from ``x0``, whatever the disturbance.

        Parameters
        ----------
        remaining : float or (M,) array
            Between 0 and 1.
        x0 : sequence of N numbers, mapping of label to number or pandas Series

        Returns
        -------
        array
            Of the shape of ``remaining``; infinite where nothing was proved.

        Raises
        ------
        ParameterError
            A value of ``remaining`` is not from 0 to 1, or ``x0`` does not fit the graph.
        """
        return self.norm_bound(remaining, x0)

    def _norms(self, at: Instants, x0: Sequence[Fraction]) -> np.ndarray:
        if self.direct:
            return super()._norms(at, x0)
        bound, unit = np.full_like(at.clock, np.inf), self._unit(x0)
        for function, v, sliding in self._bounds(self._in_norm, x0, unit, at):
            with np.errstate(over="ignore"):
                bound = np.minimum(bound, (v + sliding) / math.sqrt(function.lowest_below) * unit * (1 + 1e-12))
        return bound

    def sliding_norm(self, z: np.ndarray) -> np.ndarray:
        """Return Proposition 1's bound of ``||sigma||`` at instants ``z``: ``e^(-clock) ||sigma(0)||``.

        Parameters
        ----------
        z : (M,) array
            ``ln(T_r/(T_r - t))`` of the instants, dimensionless.

        Returns
        -------
        (M,) array

        Raises
        ------
        ParameterError
            An instant is negative or not a number.
        """
        z = clock_values(z, "z")
        size = math.hypot(*(float(x) for x in self.sigma0))
        return size * np.exp(-self.protocol.reaching_gain.clock_at_tau(z))

    def compare(self, trajectory: Trajectory) -> Comparison:
        """Compare a simulated run with every bound: Lyapunov functions, sliding variables, reaching times.

        Raises
        ------
        ParameterError
            The run is of another graph or protocol, begins later than 0, from another ``sigma(0)``, or is the
            boundary-layer imitation, of which nothing was proved.
        """
        run = trajectory.sliding
        if run is None or run.protocol != self.protocol:
            raise ParameterError("the run is of another protocol than the envelope")
        if run.boundary_layer is not None:
            raise ParameterError("nothing was proved about the boundary-layer imitation; compare the true solution")
        sigma0 = np.array([float(x) for x in self.sigma0])
        if trajectory.t[0] != 0 or (run.sigma0 != sigma0).any():
            raise ParameterError("the run starts later than 0, or from another sigma(0) than the envelope")
        certain = np.array([np.inf if r.z is None else float(r.z) for r in self.reaching])
        late = certain * 1e-9
        if run.reads_states:  # sigma_k is known to the integrator's floor, its root to that over the slope
            gap = float(self.protocol.mu1 - self.protocol.delta) * float(self.protocol.T_r) * np.exp(-certain)
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                late = late + np.where(sigma0 != 0, FLOOR_FACTOR * trajectory.rtol * np.abs(sigma0) / gap, 0.0)
        in_time = bool((run.reaching_z <= certain + late).all())
        z = self._of(trajectory).z
        bound, size = self._sliding(z), np.abs(sigma0).max(initial=0.0)
        excess = np.maximum(np.abs(run.sigma) - FLOOR_FACTOR * trajectory.rtol * size, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(excess > 0, excess / bound, 0.0)
            norm = np.linalg.norm(excess / (size or 1.0), axis=0)
            ratio = np.append(ratio, np.where(norm > 0, norm / (self.sliding_norm(z) / size), 0.0))
        return replace(super().compare(trajectory), sliding_ratio=float(ratio.max(initial=0.0)), reaching_kept=in_time)

    def histories(self, function: LyapunovFunction, trajectory: Trajectory) -> list[History]:
        """Return ``sqrt(V)`` of ``x`` and of ``x - sigma`` with their bounds along a run, in units of ``x(0)``."""
        if self.direct:
            return super().histories(function, trajectory)
        run = trajectory.sliding
        assert run is not None
        own, x0 = self._unit(trajectory.states[:, 0]), [Fraction(x) for x in trajectory.states[:, 0].tolist()]
        x, y = trajectory.states / own, (trajectory.states - run.sigma) / own
        size, result = max(float(np.abs(part).max()) for part in (x, y)), []
        for _, v, sliding in self._bounds([function], x0, own, self._of(trajectory)):
            unit = float((v + sliding).max()) or 1.0
            floor = FLOOR_FACTOR * trajectory.rtol * size * self._state_scale(function, np.ones((len(y), 1)), unit)
            for part, bound in ((x, v + sliding), (y, v)):
                root = np.sqrt(function.value(function.coordinates_of(part, self._laplacian) / unit))
                result.append(History(root, bound / unit, floor))
        return result

    def _unit(self, x0: Iterable[Any]) -> float:
        return super()._unit([*x0, *self.sigma0])

    def _bounds(
        self, functions: Iterable[LyapunovFunction], x0: Sequence[Fraction], unit: float, at: Instants
    ) -> Iterator[tuple[LyapunovFunction, np.ndarray, np.ndarray]]:
        """Yield functions with their bounds of ``||z_y||_Omega`` and ``|| |C| b ||_Omega``, in units of ``unit``.

        Of those that bound the reaching phase: one that bounds only the growth would end in infinity.
        """
        pieces, s = self._pieces
        reaching = np.isfinite(at.z)
        place = np.where(reaching, np.searchsorted(pieces, at.z, side="right") - 1, pieces.size)
        clock = np.where(reaching, self.protocol.clock_while_reaching(at.z), at.clock)
        since = np.maximum(clock - s[place], 0.0)
        instants, same = np.unique(at.z[reaching], return_inverse=True)
        size = np.zeros((len(x0), *at.z.shape))
        size[:, reaching] = self._sliding(instants)[:, same] / unit
        for function, C, v, forcing in self._driven([m for m in functions if m.rate_below > 0], tuple(x0), unit):
            half = function.rate_below / 2
            gained = forcing[place] * (-np.expm1(-half * since) / half)
            yield function, v[place] * np.exp(-half * since) + gained, _column_norms(C @ size)

    @cached_property
    def _pieces(self) -> tuple[np.ndarray, np.ndarray]:
        """The instants ``z`` at which the pieces of the reaching phase begin; the clock there and at ``T_r``."""
        pieces = self._phase.pieces
        return pieces, self.protocol.clock_while_reaching(np.append(pieces, np.inf))

    def _driven(
        self, functions: Sequence[LyapunovFunction], x0: tuple[Fraction, ...], unit: float
    ) -> Iterator[_Driven]:
        """Yield functions with what they are until ``T_r``, kept for whoever asks about other instants."""
        known = {id(one): self._cache[key] for one in functions if (key := (id(one), x0, unit)) in self._cache}
        anew = [one for one in functions if id(one) not in known]
        pieces, s = self._pieces
        size = self._sliding(pieces) / unit
        for function, root in self._initial_values(anew, [x / Fraction(unit) for x in self._nominal_state(x0)]):
            C, B = self._drive(function)
            forcing, half = np.append(_column_norms(B @ size), 0.0), function.rate_below / 2
            step = half * np.diff(s)
            each = zip(np.exp(-step).tolist(), (forcing[:-1] * (-np.expm1(-step) / half)).tolist(), strict=True)
            v = np.array(list(accumulate(each, lambda v, piece: piece[0] * v + piece[1], initial=root)))
            known[id(function)] = self._keep((id(function), x0, unit), (function, C, v, forcing))
        yield from (known[id(function)] for function in functions)

    @cached_property
    def _cache(self) -> dict[Any, Any]:
        return {}

    def _keep(self, key: Any, value: Any) -> Any:
        """Keep what was computed for the questions that come next, and return it."""
        if len(self._cache) > _CACHE_SIZE:
            self._cache.clear()
        self._cache[key] = value
        return value

    def _sliding(self, z: np.ndarray) -> np.ndarray:
        """Return :func:`sliding_bound`, which every Lyapunov function asks for at the same instants."""
        known = self._cache.get(z.tobytes())
        if known is None:
            known = self._keep(z.tobytes(), sliding_bound(self.protocol, self.sigma0, z, self.reaching))
        return np.asarray(known)

    def _drive(self, function: LyapunovFunction) -> tuple[np.ndarray, np.ndarray]:
        """Return ``|R C|`` and ``|R B|``, ``P = R'R``: how sliding variables enter the coordinates and drive them."""
        L: Any = self._laplacian
        if function.coordinates == "E":
            rows = L[function.rows]
            return np.abs(function.scaled(rows.toarray())), np.abs(function.scaled((rows @ L).toarray()))
        deviation = function.coordinates_of(np.eye(L.shape[0]), L)
        return np.abs(function.scaled(deviation)), np.abs(function.scaled(deviation @ L))

    def _nominal_state(self, x0: Sequence[Fraction]) -> list[Fraction]:
        return [x - sigma for x, sigma in zip(x0, self.sigma0, strict=True)]

    def _deviations(self, at: Instants, x0: Sequence[Fraction], unit: float | None = None) -> np.ndarray:
        """Return the bounds of every agent and of the norm: those of ``y = x - sigma``, and ``|sigma|`` besides."""
        if self.direct:
            return super()._deviations(at, x0, unit)
        own = unit or self._unit(x0)
        bounds = np.full((len(x0) + 1, *at.clock.shape), 0.0 if self._still else np.inf)
        for function, v, _ in self._bounds(self._with_deviation, x0, own, at):
            with np.errstate(invalid="ignore", over="ignore"):
                own_bounds = np.multiply.outer(deviation_constants(function), v * (1 + 1e-12))
            bounds = np.minimum(bounds, np.nan_to_num(own_bounds, posinf=np.inf))
        size = self._sliding(np.atleast_1d(at.z)) / own
        bounds += np.vstack([size, _column_norms(size)]).reshape(bounds.shape)
        if self._with_deviation:
            bounds = np.minimum(bounds.T, self._largest_deviations(x0) / own * (1 + 1e-15)).T
        return bounds if unit else bounds * own


def _column_norms(M: np.ndarray) -> np.ndarray:
    """Return the Euclidean norms of the columns; nothing is squared that could leave float64."""
    top = np.abs(M).max(axis=0, initial=0.0)
    unit = np.where(top > 0, top, 1.0)
    return np.linalg.norm(M / unit, axis=0) * top * (1 + 1e-12)
