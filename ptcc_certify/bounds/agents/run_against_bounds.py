"""A simulated run of agents of order n against the proved bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.agents.each_agent import root_product
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.theorems.matrix_for_order_n import AgentMatrix

#: Tolerances of the integrator within which nothing is told from 0. Its absolute tolerance is a share of the largest:
#: what fell below some of these is its own error. Without this floor 13 of 160 random cases were above their bounds at
#: the tolerance 1e-10, and 12 of them by less with a smaller one. Where a run cannot judge, an enclosure without an
#: integrator does, which is above none of them (``tests/certificate/test_cascade.py``).
RESOLVED = 100


@dataclass(frozen=True)
class AgentsComparison:
    """How near a run comes to its bounds: ratios, at most 1 up to rounding where none is violated.

    All are taken of ``e^(r s/2)`` times what is bounded, which is what was integrated. Of bounds from a matrix there is
    no floor. Bounds of the cascade may fall faster than that, and a run counts by how much it is above :data:`RESOLVED`
    times the tolerance of its integrator, relative to its largest.

    Attributes
    ----------
    decay : float
        ``max sqrt(V(t) e^(r s) / V(0))`` over the functions and the instants after 0.
    deviations : tuple of n float
        The same of positions, velocities and so on, over the agents; empty without constants.
    relative_input : float or None
        The same of ``|K eps_k|``.
    input : float or None
        ``max |u_k|`` over its proved bound; None without one.
    """

    decay: float
    deviations: tuple[float, ...]
    relative_input: float | None
    input: float | None

    @property
    def worst(self) -> float:
        """The largest of all."""
        ratios = (self.decay, *self.deviations, self.relative_input or 0.0, self.input or 0.0)
        return max(ratios)

    @property
    def violated(self) -> bool:
        """Whether a bound was exceeded by more than rounding."""
        return not self.worst <= 1 + 1e-6


def compare_agents(
    structure: Structure,
    matrix: AgentMatrix,
    functions: Sequence[LyapunovFunction],
    initial_values: Sequence[Fraction],
    error_constants: Sequence[Sequence[Fraction] | None],
    bounds: Sequence[Fraction] | None,
    run: AgentsTrajectory,
) -> AgentsComparison | None:
    """Compare a run with what the functions and the matrix prove of it; None where nothing disagrees."""
    later = np.isfinite(run.scaled).all(axis=(0, 1, 2)) & (run.t > 0)
    z, L = run.scaled[..., later], structure.graph.laplacian()
    N, n = len(z), z.shape[2]
    P = np.linalg.cholesky(np.array([[float(x) for x in row] for row in matrix.inverse])).T
    decay = 0.0
    deviation, relative = np.full((N, n), np.inf), np.full(N, np.inf)
    for V, value, constants in zip(functions, initial_values, error_constants, strict=True):
        if not value:
            continue
        roots = V.scaled(V.coordinates_of(z, L))
        values = (np.einsum("ij,kdjm->kdim", P, roots) ** 2).sum(axis=(0, 1, 2))
        decay = max(decay, float(np.sqrt(values.max() / float(value))))
        if V.deviation is not None:
            rows = [[float_up(root_product(c, matrix.W[i][i], value)) for i in range(n)] for c in V.deviation.agents]
            deviation = np.minimum(deviation, rows)
        if constants is not None:
            gain = matrix.gains[-1] * matrix.coupling
            relative = np.minimum(relative, [float_up(root_product(gain, c, value)) for c in constants])
    if not any(initial_values):
        return None
    eps = -(L @ z.reshape(N, -1)).reshape(z.shape)
    pull = np.einsum("i,kdim->kdm", np.array(list(map(float, matrix.gains))), eps)
    pulls = np.sqrt((pull**2).sum(axis=1)).max(axis=-1)
    sizes = np.sqrt((z**2).sum(axis=1)).max(axis=-1)
    finite = np.isfinite(deviation).all()
    return AgentsComparison(
        decay,
        tuple(_ratio(sizes, deviation).max(axis=0).tolist()) if finite else (),
        float(_ratio(pulls, relative).max()) if np.isfinite(relative).all() else None,
        _input_ratio(run, later, bounds),
    )


def compare_with_bounds(
    structure: Structure,
    functions: Sequence[LyapunovFunction],
    roots: Callable[[np.ndarray], Sequence[np.ndarray]],
    deviations: Callable[[np.ndarray], np.ndarray],
    bounds: Sequence[Fraction] | None,
    run: AgentsTrajectory,
) -> AgentsComparison:
    """Compare a run with bounds over time: ``sqrt(V)`` of positions, deviations of every derivative, and the input.

    Parameters
    ----------
    roots : callable
        Of ``1 - t/T``, (M,), to bounds of ``sqrt(V)`` of every function.
    deviations : callable
        Of the same to (N, n, M) bounds.
    """
    later = np.isfinite(run.scaled).all(axis=(0, 1, 2)) & (run.t > 0) & (run.rate * run.clock < 1200)  # e^600
    z, q = run.scaled[..., later], run.remaining[later]
    L = structure.graph.laplacian()
    weight, eta = np.exp(run.rate * run.clock[later] / 2), np.array([run.protocol.value(x) for x in q])
    decay = 0.0
    for V, bound in zip(functions, roots(q), strict=True):
        values = (V.scaled(V.coordinates_of(z[:, :, :1], L)) ** 2).sum(axis=(0, 1, 2))
        decay = max(decay, float(_ratio(_resolved(np.sqrt(values), run.rtol), bound * weight).max()))
    most = deviations(q) * weight / eta ** np.arange(z.shape[2])[:, None]
    sizes = _resolved(np.sqrt((z**2).sum(axis=1)), run.rtol)
    ratios = _ratio(sizes, most).max(axis=(0, 2)).tolist() if np.isfinite(most).all() else []
    return AgentsComparison(decay, tuple(ratios), None, _input_ratio(run, later, bounds))


def _input_ratio(run: AgentsTrajectory, later: np.ndarray, bounds: Sequence[Fraction] | None) -> float | None:
    """Return the largest input over its bound; None without one."""
    if bounds is None:
        return None
    actual = np.sqrt((run.input[..., later] ** 2).sum(axis=1)).max(axis=-1)
    return float(_ratio(actual, np.array([float_up(x) for x in bounds])).max())


def _resolved(size: np.ndarray, rtol: float) -> np.ndarray:
    """Return by how much sizes are above what the integrator resolves; nothing of what rests."""
    return np.maximum(size - RESOLVED * rtol * float(size.max(initial=0.0)), 0.0)


def _ratio(size: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Return sizes over bounds; 0 over 0, up to rounding, is 0."""
    zero = bound == 0
    least = 1e-9 * max(float(bound.max(initial=0.0)), 1e-300)
    return np.where(zero, np.where(size > least, np.inf, 0.0), size / np.where(zero, 1, bound))
