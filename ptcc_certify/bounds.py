"""What a proved rate says over time, and how a simulated trajectory compares with it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.gain import Gain
from ptcc_certify.structure import Structure
from ptcc_certify.theorems import LyapunovFunction

if TYPE_CHECKING:
    from ptcc_certify.trajectory import Trajectory

#: Instants, as fractions of the deadline, at which ratios and residuals are reported.
FRACTIONS = (0.5, 0.9, 0.99)
#: 1 - t/T at which residuals are reported besides.
LAST_INSTANTS = (1e-6, 1e-9)
#: The integrator's error is taken to be below this multiple of its tolerance times the size of the state.
FLOOR_FACTOR = 1000.0


def float_above(value: Fraction) -> float:
    """Return a float that is not below ``value``; infinity where it is beyond float64.

    Examples
    --------
    >>> float_above(Fraction(1, 3)) >= Fraction(1, 3), float_above(Fraction(10) ** 400)
    (True, inf)
    """
    try:
        return math.nextafter(float(value), math.inf)
    except OverflowError:
        return math.inf


@dataclass(frozen=True)
class Member:
    """One bound of an envelope: ``V <= e^(-rate s) V(0)`` for ``V = z' diag(weights) z``.

    Attributes
    ----------
    kind : str
        Class of the certificate, e.g. ``paper``.
    coordinates : {"E", "eps"}
        See :class:`ptcc_certify.theorems.LyapunovFunction`.
    nodes : (n,) int array
    weights : (n,) array
    gauge : (N,) array or None
        Camps, for the coordinates ``eps``.
    rate : float
        Not above the proved rate.
    prefactor : float
        Not below the proved prefactor; it multiplies the squared norm.
    """

    kind: str
    coordinates: str
    nodes: np.ndarray
    weights: np.ndarray
    gauge: np.ndarray | None
    rate: float
    prefactor: float

    @classmethod
    def of(cls, kind: str, structure: Structure, V: LyapunovFunction, rate: float) -> Member:
        """Build the member of a Lyapunov function with a given rate, rounded to the safe side."""
        return cls(
            kind,
            V.coordinates,
            np.array(V.nodes, dtype=np.int64),
            np.array([float(w) for w in V.weights]),
            structure.gauge,
            math.nextafter(rate, 0.0),
            float_above(V.prefactor),
        )

    def coordinates_of(self, states: np.ndarray, L: object) -> np.ndarray:
        """Return ``z`` for states of shape (N, ...): rows of ``-L X``, or the weighted deviation of ``X``."""
        if self.coordinates == "E":
            flat = states.reshape(len(states), -1)
            return -np.asarray(L @ flat).reshape(states.shape)[self.nodes]  # type: ignore[operator]
        assert self.gauge is not None
        X, g = states[self.nodes], self.gauge[self.nodes].astype(float)
        share = self.weights / self.weights.sum()
        mean = np.tensordot(share * g, X, axes=1)
        return X - np.multiply.outer(g, mean)

    def value(self, z: np.ndarray) -> np.ndarray:
        """Return ``V`` for coordinates of shape (n, ...)."""
        return np.tensordot(self.weights, z**2, axes=1)


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
    reaching_kept : bool or None
        Sliding mode: whether every sliding variable was 0 at its certified reaching time.
    """

    worst_ratio: float
    floor: float
    tolerance: float
    resolved_until: float
    judged: int
    ratios: dict[float, float]
    stop: float
    deadline_resolved: bool
    sliding_ratio: float | None = None
    reaching_kept: bool | None = None

    @property
    def violated(self) -> bool:
        """Whether a bound was exceeded by more than rounding."""
        return max(self.worst_ratio, self.sliding_ratio or 0.0) > 1 + 1e-6 or self.reaching_kept is False


class History(NamedTuple):
    """``sqrt(V)`` of one run and its bound over time, (M,) each, and the floor ``f`` of the integrator."""

    root: np.ndarray
    bound: np.ndarray
    floor: float


@dataclass(frozen=True)
class Envelope:
    """The pointwise best of several bounds ``V_i(t) <= e^(-rate_i s(t)) V_i(0)``.

    Attributes
    ----------
    structure : Structure
    gain : Gain
    members : tuple of Member
    """

    structure: Structure
    gain: Gain
    members: tuple[Member, ...]

    @cached_property
    def _laplacian(self) -> object:
        return self.structure.graph.laplacian()

    def norm_factor(self, clock: np.ndarray | float) -> np.ndarray:
        """Bound of ``||z(t)|| / ||z(0)||`` at clock values ``s``: ``min_i sqrt(prefactor_i) e^(-rate_i s / 2)``.

        Parameters
        ----------
        clock : float or array
            Values of the stretched clock, infinite from the deadline on.

        Returns
        -------
        array
            Infinite where nothing was proved: an envelope without members bounds nothing.
        """
        clock = np.asarray(clock, dtype=float)
        factors = [math.sqrt(m.prefactor) * np.exp(-m.rate * clock / 2) for m in self.members]
        return np.minimum.reduce(factors) if factors else np.full_like(clock, np.inf)

    def residual(self, remaining: float) -> float:
        """Bound of ``||z(t)|| / ||z(0)||`` where ``1 - t/T`` equals ``remaining``: what is left at that instant."""
        return float(self.norm_factor(self.gain.clock_at_remaining(remaining)))

    def bound(self, clock: np.ndarray | float, x0: np.ndarray) -> np.ndarray:
        """Bound of ``||z||`` at clock values ``s`` from ``x0``: ``min_i sqrt(e^(-rate_i s) V_i(0) / min weight)``."""
        clock = np.asarray(clock, dtype=float)
        x0 = np.asarray(x0, dtype=float)
        bounds = [
            np.sqrt(m.value(m.coordinates_of(x0, self._laplacian)) / m.weights.min()) * np.exp(-m.rate * clock / 2)
            for m in self.members
        ]
        return np.minimum.reduce(bounds) if bounds else np.full_like(clock, np.inf)

    def compare(self, trajectory: Trajectory) -> Comparison:
        """Compare a simulated run with every member; see :class:`Comparison`.

        Several starts at once, or the components of vector-valued agents, are judged column by column (a bound that
        holds for every column holds for their sum). ``V`` is quadratic: starts and weights of any size are compared
        in units of the start, so that no square overflows or vanishes. A run that begins later than 0 is judged from
        its first sample on.

        Raises
        ------
        ParameterError
            The run is of another graph or protocol, or has no sample before the deadline.
        """
        if trajectory.graph != self.structure.graph or trajectory.protocol.gain != self.gain:
            raise ParameterError("the run is of another graph or protocol than the envelope")
        if not np.isfinite(trajectory.clock[0]):
            raise ParameterError("the run has no sample before the deadline, where a bound could be compared")
        T = float(self.gain.T)
        judged = trajectory.clock > trajectory.clock[0]
        if not trajectory.deadline_resolved:
            judged &= trajectory.t < T
        worst, floor, resolved, count = 0.0, 0.0, 0.0, 0
        ratios: dict[float, float] = {}
        for history in (h for member in self.members for h in self.histories(member, trajectory)):
            root, bound, f = history
            excess = np.maximum(root - f, 0.0)[judged]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                ratio = np.where(excess > 0, excess / bound[judged], 0.0)
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
            worst, floor, trajectory.rtol, resolved, count, ratios, float(before.min()), trajectory.deadline_resolved
        )

    def histories(self, member: Member, trajectory: Trajectory) -> list[History]:
        """Return ``sqrt(V)`` and its bound along a run, column by column, in units of the start."""
        states = trajectory.states.reshape(len(trajectory.labels), -1, trajectory.t.size)
        states = states / _sizes(states)
        z = member.coordinates_of(states, self._laplacian)
        unit = _sizes(z)
        root = np.sqrt(member.value(z / unit))
        decay = np.exp(-member.rate * (trajectory.clock - trajectory.clock[0]) / 2)
        return [
            History(
                root[column],
                root[column, 0] * decay,
                FLOOR_FACTOR * trajectory.rtol * self._state_scale(member, states[:, column], float(unit[column, 0])),
            )
            for column in range(states.shape[1])
        ]

    def _state_scale(self, member: Member, states: np.ndarray, unit: float) -> float:
        """Return ``||dz||_weights / unit`` for an error ``|dx_k| = max |x_k|`` in every entry, the worst case."""
        size = np.abs(states).max(axis=1)
        if member.coordinates == "E":
            size = np.asarray(abs(self._laplacian) @ size)[member.nodes]  # type: ignore[arg-type, operator]
        else:
            size = 2 * size[member.nodes]
        return float(np.sqrt(member.weights @ (size / unit) ** 2))


def _sizes(values: np.ndarray) -> np.ndarray:
    """Return the (S, 1) largest entries of (N, S, M) values at the first instant, 1 for a column of zeros."""
    sizes = np.abs(values[:, :, :1]).max(axis=0, initial=0.0)
    return np.where(sizes > 0, sizes, 1.0)
