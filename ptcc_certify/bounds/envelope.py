r"""What a proved rate says over time, and how a simulated trajectory compares with it.

Under the sliding-mode protocol, with ``y = x - sigma`` and ``A`` the matrix of the coordinates ``z`` (rows of ``E``, or
``eps``),

    z_y' = -gain (A z_y + B sigma),      sqrt(V)' <= -(rate/2) gain sqrt(V) + gain || |B| |sigma| ||_Omega

so that ``|| |B| b ||_Omega`` drives the decay of ``sqrt(V(y))``, where ``b_k`` bounds ``|sigma_k|`` whatever the
disturbance. The coordinates of ``x`` are those of ``y`` and of ``sigma``: ``||z_x||_Omega <= sqrt(V(y)) + || |C| b
||_Omega``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.decay import Decay, ReachingPhase, decayed
from ptcc_certify.bounds.final_state.of_graph import Influence, influence
from ptcc_certify.bounds.instants import Instants, clock_values, remaining_part
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import as_state
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.gain import Gain
from ptcc_certify.simulation.trajectory import Trajectory

#: Instants, as fractions of the deadline, at which ratios and residuals are reported.
FRACTIONS = (0.5, 0.9, 0.99)
#: 1 - t/T at which residuals are reported besides.
LAST_INSTANTS = (1e-6, 1e-9)
#: The integrator's error is taken to be below this multiple of its tolerance times the size of the state.
FLOOR_FACTOR = 1000.0


@dataclass(frozen=True)
class Comparison:
    """A simulated trajectory against an envelope.

    Attributes
    ----------
    worst_ratio : float
        ``max over t > 0 of max(sqrt(V) - f, 0) / sqrt(bound)`` with ``f = floor * tolerance * sqrt(V(0))``, the floor
        below which the integrator resolves nothing. At most 1 (up to rounding) when no bound is violated.
    floor : float
        The constant in ``f``.
    tolerance : float
        Relative tolerance of the integrator.
    resolved_until : float
        ``1 - t/T`` from which the bound lies below ``f^2``; 0 if it never does.
    judged : int
        How many samples after the first rose above the floor. If none did, the run says nothing about the bound.
    ratios : dict of float to float
        ``sqrt(V / bound)`` at those of the fractions 0.5, 0.9, 0.99 of the deadline that were sampled.
    stop : float
        Smallest ``1 - t/T`` that was sampled before the deadline.
    deadline_resolved : bool
        Whether the run settled, so that samples from the deadline on were judged too.
    sliding_ratio : float or None
        Sliding mode: ``max over k, t of max(|sigma_k| - f, 0) / bound``, with the bound of each agent and with that of
        Proposition 1 for the norm; ``f`` is the integrator's floor of the largest ``|sigma_k(0)|``.
    deviation_ratio : float or None
        ``max over k, t > 0 of max(|x_k - final_state_k| - f, 0) / bound`` with the bound of each agent and of the norm,
        and the integrator's floor of the largest state; None without constants.
    reaching_kept : bool or None
        Sliding mode: whether every sliding variable was 0 at its certified reaching time.

    References
    ----------
    Theorems 1 to 6 and Proposition 1 of [Zhu]_.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)

    >>> comparison = certify(pair, protocol, [3, 1]).comparison
    >>> comparison.violated, comparison.worst_ratio <= 1, comparison.deadline_resolved
    (False, True, True)
    """

    worst_ratio: float
    floor: float
    tolerance: float
    resolved_until: float
    judged: int
    ratios: dict[float, float] = field(hash=False)
    stop: float
    deadline_resolved: bool
    sliding_ratio: float | None = None
    deviation_ratio: float | None = None
    reaching_kept: bool | None = None

    @property
    def violated(self) -> bool:
        """Whether a bound was exceeded by more than rounding."""
        worst = max(self.worst_ratio, self.sliding_ratio or 0.0, self.deviation_ratio or 0.0)
        return worst > 1 + 1e-6 or self.reaching_kept is False


class History(NamedTuple):
    """``sqrt(V)`` of one run and its bound over time, (M,) each, and the floor ``f`` of the integrator."""

    root: np.ndarray
    bound: np.ndarray
    floor: float


@dataclass(frozen=True)
class Envelope:
    """The pointwise best of several bounds ``V_i(t) <= e^(-rate_i s(t)) V_i(0)``.

    Under the sliding-mode protocol for one ``sigma(0)`` and every disturbance within ``delta``, through the reaching
    phase and on to ``T_r + T_s``.

    Attributes
    ----------
    structure : Structure
    gain : Gain
    functions : tuple of LyapunovFunction
    phase : ReachingPhase or None
        The sliding variables; None under the nominal protocol.

    References
    ----------
    Theorems 1 to 6, Lemma 6 and Proposition 1 of [Zhu]_.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)

    >>> envelope = certify(pair, protocol, [3, 1], asks=Asks(simulation=False)).envelope
    >>> 0 < envelope.residual(0.01) < 0.01  # what may be left at 0.99 T
    True
    >>> bool(envelope.deviation(envelope.gain.clock(0.99), [3, 1]).max() < 0.01)
    True
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> envelope = certify(pair, robust, InitialState([3, 1], sigma0=[1, 0]), asks=Asks(simulation=False)).envelope
    >>> bool(envelope.deviation_bound(0.01, [3, 1]).max() < 0.01)  # of every agent at 0.99 (T_r + T_s)
    True
    """

    structure: Structure
    gain: Gain
    functions: tuple[LyapunovFunction, ...]
    phase: ReachingPhase | None = None

    @cached_property
    def _laplacian(self) -> object:
        return self.structure.graph.laplacian()

    def __call__(self, *_: object, **__: object) -> object:
        """Refuse the call: there are several bounds."""
        raise ParameterError("an Envelope is no function: norm_bound(q, x0) bounds ||E(t)|| at q = 1 - t/T")

    @property
    def coordinates(self) -> str:
        """The coordinates ``z`` of the bounds in norm: ``E`` if some function is in ``E``, otherwise ``eps``."""
        return "eps" if all(m.coordinates == "eps" for m in self.functions) and self.functions else "E"

    @property
    def _in_norm(self) -> list[LyapunovFunction]:
        return [m for m in self.functions if m.coordinates == self.coordinates]

    @property
    def _moving(self) -> ReachingPhase | None:
        """The reaching phase in which sliding variables move; None where there is none, or ``sigma(0) = 0``."""
        return self.phase if self.phase is not None and any(self.phase.sigma0) else None

    @property
    def direct(self) -> bool:
        """Whether no sliding variable moves: the bounds are those of the nominal protocol."""
        return self._moving is None

    # ------------------------------------------------------------------ instants

    def _at(self, clock: Any) -> Instants:
        """Return the instants at values of the clock, or refuse them, and all where there is a reaching phase."""
        if not self.direct:
            raise ParameterError("sigma(0) is not 0: in the reaching phase ask norm_bound or deviation_bound")
        return Instants(clock_values(clock))

    def _when(self, remaining: Any) -> Instants:
        """Return the instants where ``1 - t/T`` is ``remaining``, or refuse them."""
        if self._moving is not None:
            return self._moving.instants(remaining)
        return Instants(np.asarray(self.gain.clock_at_remaining(remaining_part(remaining))))

    def _of(self, trajectory: Trajectory) -> Instants:
        """Return the samples of a run."""
        if trajectory.sliding is None:
            return Instants(trajectory.clock)
        with np.errstate(divide="ignore"):
            return Instants(trajectory.clock, -np.log(trajectory.sliding.reaching_remaining))

    # ------------------------------------------------------------------ bounds

    def norm_factor(self, clock: np.ndarray | float) -> np.ndarray:
        """Bound of ``||z(t)|| / ||z(0)||`` at clock values ``s``: ``min_i sqrt(overshoot_i) e^(-rate_i s / 2)``.

        Parameters
        ----------
        clock : float or (M,) array
            Values of the stretched clock, infinite from the deadline on.

        Returns
        -------
        array
            Of the shape of ``clock``; infinite where nothing was proved: an envelope without Lyapunov functions bounds
            nothing.

        Raises
        ------
        ParameterError
            A value is negative or not a number; or there is a reaching phase: sliding variables drive the agents, and
            no multiple of their initial value bounds them.
        """
        at = self._at(clock)
        factors = (Decay(m.rate_below, math.sqrt(m.overshoot_above)).times(1.0, at) for m in self._in_norm)
        return np.minimum.reduce([np.full_like(at.clock, np.inf), *factors])

    def residual(self, remaining: float) -> float:
        """Bound of ``||z(t)|| / ||z(0)||`` where ``1 - t/T`` equals ``remaining``: what is left at that instant.

        Parameters
        ----------
        remaining : float
            From 1 at 0 to 0 at the deadline.

        Returns
        -------
        float

        Raises
        ------
        ParameterError
            ``remaining`` is not one number from 0 to 1; or there is a reaching phase (see :meth:`norm_factor`).
        """
        if np.ndim(remaining):
            raise ParameterError("remaining is one number from 0 to 1; for several instants ask norm_bound")
        return float(self.norm_factor(self._when(remaining).clock))

    def bound(self, clock: np.ndarray | float, x0: Any) -> np.ndarray:
        """Bound of ``||z||`` at clock values ``s`` from ``x0``: ``min_i sqrt(e^(-rate_i s) V_i(0) / lmin(P_i))``.

        Parameters
        ----------
        clock : (M,) array or float
            Values of the stretched clock, infinite from the deadline on.
        x0 : sequence of N numbers, mapping of label to number or pandas Series
            Rationals are taken exactly, floats as the dyadic numbers they are.

        Returns
        -------
        (M,) array or float
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            A value of the clock is negative or not a number, or ``x0`` does not fit the graph; or there is a reaching
            phase, in which the clock alone bounds nothing.
        """
        return self._norms(self._at(clock), as_state(x0, self.structure.graph))

    def norm_bound(self, remaining: Sequence[float] | np.ndarray | float, x0: Any) -> np.ndarray:
        """Bound of ``||z||`` from ``x0``, (M,), at the instants where ``1 - t/T`` is ``remaining``, (M,).

        Whatever the disturbance; ``T = T_r + T_s`` under the sliding-mode protocol.

        Raises
        ------
        ParameterError
            A value of ``remaining`` is not from 0 to 1, or ``x0`` does not fit the graph.
        """
        return self._norms(self._when(remaining), as_state(x0, self.structure.graph))

    def _norms(self, at: Instants, x0: Sequence[Fraction]) -> np.ndarray:
        """Return the bounds of ``||z||`` from ``x0``."""
        unit = self._unit(x0) if self._moving else 1.0
        bound = np.full_like(at.clock, np.inf)
        for m, decay in self._decays(self._in_norm, x0, unit):
            least = math.sqrt(m.lowest_below)
            with np.errstate(over="ignore"):
                norm = decay.times(1 / least, at) + self._sliding_norm(m, at, unit) / least * (1 + 1e-12)
                bound = np.minimum(bound, norm * unit)
        return bound

    def _decays(
        self, functions: Iterable[LyapunovFunction], x0: Sequence[Fraction], unit: float
    ) -> Iterator[tuple[LyapunovFunction, Decay]]:
        """Yield functions with what bounds ``sqrt(V)`` over time, of ``x - sigma``, in that unit.

        Where sliding variables move, of those that decay: one that bounds only the growth would end in infinity.
        """
        phase = self._moving
        wanted = [m for m in functions if phase is None or m.rate_below > 0]
        for m, root in self._initial_values(wanted, [x / Fraction(unit) for x in self._nominal_state(x0)]):
            if phase is None:
                yield m, Decay(m.rate_below, root)
            else:
                yield m, Decay(m.rate_below, root, phase, self._pushes(m) * (self._unit(()) / unit))

    def _pushes(self, function: LyapunovFunction) -> np.ndarray:
        """Return what drives a function in every piece of the reaching phase, in units of ``sigma(0)``."""
        if id(function) not in self._known_pushes:
            assert self.phase is not None
            drive = self._size_of(function, self._laplacian)
            sizes = self.phase.sizes(self.phase.pieces) / self._unit(())
            self._known_pushes[id(function)] = np.append(_column_norms(drive @ sizes), 0.0)
        return self._known_pushes[id(function)]

    @cached_property
    def _known_pushes(self) -> dict[int, np.ndarray]:
        return {}

    def _size_of(self, function: LyapunovFunction, after: Any = None) -> np.ndarray:
        """Return ``|R C|``, ``P = R'R``, with ``C`` from states to coordinates, or ``|R C after|``."""
        L: Any = self._laplacian
        C = L[function.rows] if function.coordinates == "E" else function.coordinates_of(np.eye(L.shape[0]), L)
        whole = C if after is None else C @ after
        return np.abs(function.scaled(whole if isinstance(whole, np.ndarray) else whole.toarray()))

    def _sliding_norm(self, function: LyapunovFunction, at: Instants, unit: float) -> np.ndarray | float:
        """Return ``|| |C| b ||_Omega``, what sliding variables are in the coordinates of a function, in that unit."""
        phase = self._moving
        return 0.0 if phase is None else _column_norms(self._size_of(function) @ (phase.sizes(at.z) / unit))

    def deviation_bound(self, remaining: np.ndarray | Sequence[float] | float, x0: Any) -> np.ndarray:
        """Bound of ``|x_k - final_state_k|`` from ``x0`` where ``1 - t/T`` is ``remaining``.

        Parameters
        ----------
        remaining : float or (M,) array
            From 1 at 0 to 0 at the deadline.
        x0 : sequence of N numbers, mapping of label to number or pandas Series

        Returns
        -------
        (N, M) or (N,) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            A value of ``remaining`` is not from 0 to 1, or ``x0`` does not fit the graph.
        """
        return self._deviations(self._when(remaining), as_state(x0, self.structure.graph))[:-1]

    def deviation(self, clock: np.ndarray | float, x0: Any) -> np.ndarray:
        """Bound of ``|x_k - (Q x0)_k|`` at clock values ``s`` from ``x0``: how far each agent is from its final state.

        The least of ``sqrt(c_k e^(-rate s) V(0))`` over the Lyapunov functions, and never more than ``max_j |x_j(0) -
        (Q x0)_j|``: ``x - Q x`` obeys the same equation as ``x``, and ``e^(-L s)`` does not expand the largest entry.

        Parameters
        ----------
        clock : (M,) array or float
        x0 : sequence of N numbers, mapping of label to number or pandas Series
            Rationals are taken exactly, floats as the dyadic numbers they are.

        Returns
        -------
        (N, M) array or (N,) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            A value of the clock is negative or not a number, or ``x0`` does not fit the graph; or there is a reaching
            phase, in which the clock alone bounds nothing.
        """
        return self._deviations(self._at(clock), as_state(x0, self.structure.graph))[:-1]

    def deviation_norm(self, clock: np.ndarray | float, x0: Any) -> np.ndarray:
        """Bound of ``||x - Q x0||`` at values ``clock`` of ``s``, from ``x0``; see :meth:`deviation`."""
        return self._deviations(self._at(clock), as_state(x0, self.structure.graph))[-1]

    def _deviations(self, at: Instants, x0: Sequence[Fraction], unit: float | None = None) -> np.ndarray:
        """Return the bounds of every agent and of the norm, (N + 1, M), in that unit or in 1.

        Those of ``x - sigma``, and ``|sigma|`` besides.
        """
        phase = self._moving
        own = unit or (self._unit(x0) if phase else 1.0)
        bounds = np.full((len(x0) + 1, *at.clock.shape), 0.0 if self._still else np.inf)
        for m, decay in self._decays(self._with_deviation, x0, own):
            bounds = np.minimum(bounds, decay.times(deviation_constants(m), at))
        if phase is not None:
            size = phase.sizes(np.atleast_1d(at.z)) / own
            bounds += np.vstack([size, _column_norms(size)]).reshape(bounds.shape)
        if self._with_deviation:
            bounds = np.minimum(bounds.T, self._largest_deviations(x0, own)).T
        return bounds if unit or phase is None else bounds * own * (1 + 1e-15)

    @property
    def _with_deviation(self) -> list[LyapunovFunction]:
        return [m for m in self.functions if m.deviation is not None]

    @cached_property
    def _still(self) -> bool:
        """Whether no agent moves: every one is where it ends."""
        return not ErrorSystem(self.structure).nodes

    @cached_property
    def _influence(self) -> Influence:
        return influence(self.structure)

    def _nominal_state(self, x0: Sequence[Fraction]) -> list[Fraction]:
        """Return the initial state from which the nominal motion has the same final state: ``x(0) - sigma(0)``."""
        phase = self._moving
        return list(x0) if phase is None else [x - sigma for x, sigma in zip(x0, phase.sigma0, strict=True)]

    def _largest_deviations(self, x0: Sequence[Fraction], unit: float) -> np.ndarray:
        """Return what no deviation of an agent and no norm of them, (N + 1,), ever exceeds, in that unit, rounded up.

        That is ``max_k |x_k(0) - final_state_k|``, and under the sliding-mode protocol ``sum_k |sigma_k(0)|`` more:
        ``d = x - final_state`` obeys ``d' = -gain L d + sigma'``, every ``|sigma_k|`` falls to 0, and ``e^(-L s)`` does
        not expand the largest entry.
        """
        nominal = self._nominal_state(x0)
        gaps = (abs(x - Fraction(end)) for x, end in zip(x0, self._influence.apply(nominal)[0], strict=True))
        whole = max(gaps) + sum((abs(x - y) for x, y in zip(x0, nominal, strict=True)), Fraction(0))
        most = float_up(whole / Fraction(unit))
        return np.append(np.full(len(x0), most), most * math.sqrt(len(x0)) * (1 + 1e-15))

    @cached_property
    def _rows(self) -> list[dict[int, Fraction]]:
        return self.structure.graph.exact_rows(range(self.structure.graph.n_nodes))

    def _initial_values(
        self, functions: Iterable[LyapunovFunction], x0: Sequence[Fraction]
    ) -> Iterator[tuple[LyapunovFunction, float]]:
        """Yield ``sqrt(V(0))`` of functions, rounded up: coordinates in rationals, since entries may cancel in them."""
        error = [-sum((w * x0[j] for j, w in row.items()), Fraction(0)) for row in self._rows]
        for function in functions:
            z = function.exact_coordinates_of(x0, error)
            top = max(map(abs, z), default=Fraction(0))
            relative = np.array([float(x / (top or 1)) for x in z])
            yield function, float(np.sqrt(function.value(relative))) * (1 + 1e-12) * float_up(top) if top else 0.0

    def _unit(self, x0: Iterable[Any]) -> float:
        """Return the size of a state and of ``sigma(0)``, in which squares neither overflow nor vanish."""
        sigma0 = () if self.phase is None else self.phase.sigma0
        return max((abs(float(x)) for x in (*x0, *sigma0)), default=0.0) or 1.0

    # ------------------------------------------------------------------ runs

    def compare(self, trajectory: Trajectory) -> Comparison:
        """Compare a simulated run with every bound: Lyapunov functions, sliding variables, reaching times.

        See :class:`Comparison`.

        Several initial states at once, or the components of vector-valued agents, are judged column by column (a bound
        that holds for every column holds for their sum). ``V`` is quadratic: initial states and weights of any size are
        compared in units of the initial state, so that no square overflows or vanishes. A run that begins later than 0
        is judged from its first sample on.

        Parameters
        ----------
        trajectory : Trajectory
            Of the same graph and protocol.

        Returns
        -------
        Comparison

        Raises
        ------
        ParameterError
            The run is of another graph or protocol, disturbed or held over periods under the nominal protocol, or has
            no sample before the deadline; under the sliding-mode protocol it begins later than 0, from another
            ``sigma(0)``, or is the boundary-layer imitation, of which nothing was proved.
        """
        if not isinstance(trajectory, Trajectory):
            raise ParameterError(f"{shorten(repr(trajectory))} is no run; give what simulate returned")
        sliding_ratio, reaching_kept = (None, None) if self.phase is None else _compare_sliding(self.phase, trajectory)
        if trajectory.conditions.forcing is not None or trajectory.held_input is not None:
            raise ParameterError("the bounds are for undisturbed runs whose input is not held over periods")
        if trajectory.graph.labels != self.structure.graph.labels or trajectory.graph != self.structure.graph:
            raise ParameterError("the run is of another graph, or has its agents in another order, than the envelope")
        if trajectory.protocol.gain != self.gain:
            raise ParameterError("the run is of another graph or protocol than the envelope")
        if not np.isfinite(trajectory.clock[0]):
            raise ParameterError("the run has no sample before the deadline, where a bound could be compared")
        T = float(self.gain.T)
        judged = trajectory.clock > trajectory.clock[0]
        if not trajectory.deadline_resolved:
            judged &= trajectory.t < T
        worst, floor, resolved, count = 0.0, 0.0, 0.0, 0
        ratios: dict[float, float] = {}
        for history in (h for function in self.functions for h in self.histories(function, trajectory)):
            root, bound, f = history
            excess = np.maximum(root - f, 0.0)[judged]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                ratio = np.nan_to_num(np.where(excess > 0, excess / bound[judged], 0.0), nan=np.inf, posinf=np.inf)
                plain = np.where(root > 0, root / bound, 0.0)
            worst = max(worst, float(ratio.max(initial=0.0)))
            count += int((excess > 0).sum())
            if root[0] > 0:
                floor = max(floor, float(f / (trajectory.rtol * root[0])))
            below = trajectory.remaining[(bound < f) & (trajectory.remaining > 0)]
            resolved = max(resolved, float(below.max(initial=0.0)))
            for fraction in FRACTIONS:
                at = int(np.argmin(np.abs(trajectory.t - fraction * T)))
                if abs(trajectory.t[at] - fraction * T) <= 1e-9 * T:
                    ratios[fraction] = max(ratios.get(fraction, 0.0), float(plain[at]))
        before = trajectory.remaining[trajectory.remaining > 0]
        return Comparison(
            worst,
            floor,
            trajectory.rtol,
            resolved,
            count,
            ratios,
            float(before.min()),
            trajectory.deadline_resolved,
            sliding_ratio=sliding_ratio,
            deviation_ratio=self._deviation_ratio(trajectory, judged),
            reaching_kept=reaching_kept,
        )

    def _deviation_ratio(self, trajectory: Trajectory, judged: np.ndarray) -> float | None:
        """Compare every agent's deviation from the final state with its bound, column by column.

        Before the deadline only: the bound is 0 from there on, and whether the run has arrived is told elsewhere.
        """
        if not self._with_deviation or trajectory.t[0] != 0:
            return None
        judged = judged & (trajectory.t < float(self.gain.T))
        worst = 0.0
        for x in _columns(trajectory):
            size, x0 = self._unit(x[:, 0]), [Fraction(v) for v in x[:, 0].tolist()]
            final, _ = self._influence.apply(self._nominal_state(x0))
            gap = np.abs(x / size - np.array([float(Fraction(v) / Fraction(size)) for v in final])[:, None])
            excess = np.maximum(gap - FLOOR_FACTOR * trajectory.rtol * np.abs(x / size).max(), 0.0)
            excess = np.vstack([excess, np.linalg.norm(excess, axis=0)])
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(excess > 0, excess / self._deviations(self._of(trajectory), x0, size), 0.0)
            worst = max(worst, float(ratio[:, judged].max(initial=0.0)))
        return worst

    def histories(self, function: LyapunovFunction, trajectory: Trajectory) -> list[History]:
        """Return ``sqrt(V)`` and its bound along a run, column by column, in units of the initial state.

        Where sliding variables move, of ``x`` and of ``x - sigma``.

        Parameters
        ----------
        function : LyapunovFunction
            Of this envelope.
        trajectory : Trajectory
            Of the same graph and protocol.

        Returns
        -------
        list of History
            One for each column of the states.
        """
        if not self.direct:
            return list(self._driven_histories(function, trajectory))
        result = []
        for x in _columns(trajectory):
            x = x / self._unit(x[:, 0])
            z = function.coordinates_of(x, self._laplacian)
            unit = float(np.abs(z[:, 0]).max(initial=0.0)) or 1.0
            root = np.sqrt(function.value(z / unit))
            bound = decayed(root[0], function.rate_below, trajectory.clock - trajectory.clock[0])
            result.append(History(root, bound, FLOOR_FACTOR * trajectory.rtol * self._state_scale(function, x, unit)))
        return result

    def _driven_histories(self, function: LyapunovFunction, trajectory: Trajectory) -> Iterator[History]:
        assert trajectory.sliding is not None
        states, at = trajectory.states, self._of(trajectory)
        own, x0 = self._unit(states[:, 0]), [Fraction(x) for x in states[:, 0].tolist()]
        x, y = states / own, (states - trajectory.sliding.sigma) / own
        size, sliding = max(float(np.abs(part).max()) for part in (x, y)), self._sliding_norm(function, at, own)
        for _, decay in self._decays([function], x0, own):
            v = decay.times(1.0, at)
            unit = float((v + sliding).max()) or 1.0
            floor = FLOOR_FACTOR * trajectory.rtol * size * self._state_scale(function, np.ones((len(y), 1)), unit)
            for part, bound in ((x, v + sliding), (y, v)):
                root = np.sqrt(function.value(function.coordinates_of(part, self._laplacian) / unit))
                yield History(root, bound / unit, floor)

    def _state_scale(self, function: LyapunovFunction, states: np.ndarray, unit: float) -> float:
        """Bound ``sqrt(V(dz)) / unit`` for errors as large as the largest state: tolerances are of the whole."""
        size = np.full(states.shape[0], np.abs(states).max(initial=0.0))
        if function.coordinates == "E":
            size = np.asarray(abs(self._laplacian) @ size)[function.rows]  # type: ignore[arg-type, operator]
        else:
            size = 2 * size[function.rows]
        root, size = np.abs(function.root), size / unit
        return float(np.linalg.norm(root * size if root.ndim == 1 else root @ size))


def deviation_constants(function: LyapunovFunction) -> np.ndarray:
    """Return what ``sqrt(V)`` is multiplied by in the bounds of all agents and of the norm, (N + 1,)."""
    assert function.deviation is not None
    return np.append(function.deviation.roots, function.deviation.norm_root)


def _columns(trajectory: Trajectory) -> np.ndarray:
    """Return the states of a run column by column, (S, N, M)."""
    return np.moveaxis(trajectory.states.reshape(len(trajectory.labels), -1, trajectory.t.size), 1, 0)


def _compare_sliding(phase: ReachingPhase, trajectory: Trajectory) -> tuple[float, bool]:
    """Return the largest ratio of sliding variables to their bounds, and whether all were 0 when they certainly are."""
    run = trajectory.sliding
    if run is None or run.protocol != phase.protocol:
        raise ParameterError("the run is of another protocol than the envelope")
    if run.boundary_layer is not None:
        raise ParameterError("nothing was proved about the boundary-layer imitation; compare the true solution")
    sigma0 = np.array([float(x) for x in phase.sigma0])
    if trajectory.t[0] != 0 or (run.sigma0 != sigma0).any():
        raise ParameterError("the run starts later than 0, or from another sigma(0) than the envelope")
    certain = np.array([np.inf if r.z is None else float(r.z) for r in phase.reaching])
    late = certain * 1e-9
    if run.reads_states:  # sigma_k is known to the integrator's floor, its root to that over the slope
        gap = float(phase.protocol.mu1 - phase.protocol.delta) * float(phase.protocol.T_r) * np.exp(-certain)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            late = late + np.where(sigma0 != 0, FLOOR_FACTOR * trajectory.rtol * np.abs(sigma0) / gap, 0.0)
    in_time = bool((run.reaching_z <= certain + late).all())
    with np.errstate(divide="ignore"):
        z = -np.log(run.reaching_remaining)
    bound, size = phase.sizes(z), np.abs(sigma0).max(initial=0.0)
    excess = np.maximum(np.abs(run.sigma) - FLOOR_FACTOR * trajectory.rtol * size, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(excess > 0, excess / bound, 0.0)
        norm = np.linalg.norm(excess / (size or 1.0), axis=0)
        ratio = np.append(ratio, np.where(norm > 0, norm / (phase.norm(z) / size), 0.0))
    return float(ratio.max(initial=0.0)), in_time


def _column_norms(M: np.ndarray) -> np.ndarray:
    """Return the Euclidean norms of the columns; nothing is squared that could leave float64."""
    top = np.abs(M).max(axis=0, initial=0.0)
    unit = np.where(top > 0, top, 1.0)
    return np.linalg.norm(M / unit, axis=0) * top * (1 + 1e-12)
