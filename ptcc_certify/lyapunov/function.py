"""The Lyapunov function: one class, from the search that finds one to the file, the bounds over time and the page.

``V = z' P z`` with ``V <= e^(-rate s) V(0)`` on the stretched clock ``s``. Theorems and searches make it, a certificate
adds its name and the constants of deviation, and reading a file makes it again. Everything that is proved about it is
rational; what is computed with it in floats is rounded to the safe side here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

import lmi
from lmi.definiteness_proofs import SparseDefinitenessProof
from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.theorems.lemmas import Matrix


@dataclass(frozen=True, eq=False)
class LyapunovBlock:
    """One block of a Lyapunov matrix, exact: its diagonal, or one of ``matrix`` and ``dyadic`` in place of that.

    Attributes
    ----------
    name : str
        The paper's letter: ``P``, ``Omega``, ``Xi_L``, ``Xi_F``, ``H_2``, ``H_F``, ``Theta_L1``, ``Theta_F``.
    nodes : tuple of int
    diagonal : tuple of Fraction
        Positive, without the factor ``rho``.
    times_rho : bool
        Whether the block enters the Lyapunov matrix multiplied by ``rho``.
    matrix : rows of Fractions or None
        Of a full block.
    dyadic : (n,) array or None
        The diagonal of a large block, in floats that are the dyadic numbers they are.
    """

    name: str
    nodes: tuple[int, ...]
    diagonal: tuple[Fraction, ...] = ()
    times_rho: bool = False
    matrix: Matrix | None = None
    dyadic: np.ndarray | None = None


@dataclass(frozen=True)
class DeviationBound:
    """``|x_k - (Q x)_k|^2 <= agents[k] V`` and ``||x - Q x||^2 <= norm V``; the check proves it.

    Attributes
    ----------
    agents : tuple of N Fraction
    norm : Fraction
    """

    agents: tuple[Fraction, ...]
    norm: Fraction

    @cached_property
    def roots(self) -> np.ndarray:
        """``sqrt(agents)`` (N,), rounded up."""
        return np.array([root_above(c) for c in self.agents])

    @cached_property
    def norm_root(self) -> float:
        """``sqrt(norm)``, rounded up."""
        return root_above(self.norm)


@dataclass(frozen=True, eq=False)
class GroupProof:
    """The decay of a leader group by itself.

    Attributes
    ----------
    weights : (n,) array
        ``P_k``, each of at most 40 significant bits.
    rate : Fraction
        ``g_k``.
    factor : SparseDefinitenessProof or None
        What proves it for a large group: of ``L_k`` over ``2^shift``.
    shift : int
    parents : (n,) int array or None
        A spanning tree, -1 at its root, whose differences are the basis of the form that was factored; without one
        that of a balanced group is the columns of ``L_k`` but the first.
    """

    weights: np.ndarray
    rate: Fraction
    factor: SparseDefinitenessProof | None = None
    shift: int = 0
    parents: np.ndarray | None = None

    @property
    def power(self) -> int:
        """The form that was factored is that of the graph's own ``L_k`` times ``2^power``."""
        basis = self.factor is not None and self.parents is None and self.factor.order.size < self.weights.size
        return -self.shift * (3 if basis else 1)


@dataclass(frozen=True, eq=False)
class Dominance:
    """What proves the rate of a diagonal matrix row by row, in a large graph.

    Attributes
    ----------
    vector : (n,) array
        ``d`` of the inequality; every entry is the dyadic number that it is, of at most 40 significant bits.
    groups : tuple of GroupProof
        Of every leader group that moves; empty where it was read back, and the check has verified it.
    scales : tuple of float
        Powers of two, by which the weights of the groups are multiplied in ``P``.
    """

    vector: np.ndarray
    groups: tuple[GroupProof, ...] = ()
    scales: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class LyapunovFunction:
    """``V = z' P z``, ``P = diag(blocks)``, in the coordinates ``z`` of its proof.

    Attributes
    ----------
    kind : str
        Class: ``paper``, ``perron``, ``lmi`` or ``full``.
    coordinates : {"E", "eps"}
        ``E``: the rows ``nodes`` of ``E = -L X``. ``eps``: the deviation of ``X`` from its weighted signed mean,
        ``eps = X - (p'GX / p'1) G1``.
    blocks : tuple of LyapunovBlock
    rho : Fraction or None
    rate : Fraction or None
        ``V <= e^(-rate s) V(0)``, proved; None if it is not. Negative rates, which bound the growth, occur too.
    ends : pair of Fraction, or None
        ``lowest I <= P <= highest I`` of a full matrix, proved.
    gauge : tuple of int
        Camps of ``nodes``, for the coordinates ``eps``.
    objective : str
        The quotient that the paper's rate is, in its letters.
    interval : RhoInterval or None
        Numerical ends of the admissible ``rho``.
    numerical_rate : float or None
        The rate of a search, before the matrix was rounded, in floating point.
    dominance : Dominance or None
        Of a large graph: what proves the rate row by row.
    deviation : DeviationBound or None
        Constants from ``V`` to the deviation of each agent to its final state.
    name : str
        Which part of a certificate it is.
    """

    kind: str
    coordinates: str
    blocks: tuple[LyapunovBlock, ...]
    rho: Fraction | None = None
    rate: Fraction | None = None
    ends: tuple[Fraction, Fraction] | None = None
    gauge: tuple[int, ...] = ()
    objective: str = ""
    interval: lmi.RhoInterval | None = None
    numerical_rate: float | None = None
    dominance: Dominance | None = None
    deviation: DeviationBound | None = None
    name: str = ""

    @cached_property
    def nodes(self) -> tuple[int, ...]:
        """The nodes whose coordinates enter ``V``, block after block."""
        return tuple(v for block in self.blocks for v in block.nodes)

    @property
    def matrix(self) -> Matrix | None:
        """A full ``P``; None of a diagonal one."""
        return self.blocks[0].matrix if self.blocks else None

    @cached_property
    def weights(self) -> tuple[Fraction, ...]:
        """The diagonal of a diagonal ``P``, ``rho`` included, in the order of ``nodes``; empty of a full one."""
        return tuple(
            Fraction(w) * (self.rho if block.times_rho and self.rho is not None else 1)
            for block in self.blocks
            for w in (block.diagonal if block.dyadic is None else block.dyadic.tolist())
        )

    @property
    def lowest(self) -> Fraction:
        """Not above the smallest eigenvalue of ``P``."""
        return self._ends[0]

    @property
    def highest(self) -> Fraction:
        """Not below the largest eigenvalue of ``P``."""
        return self._ends[1]

    @cached_property
    def _ends(self) -> tuple[Fraction, Fraction]:
        if self.ends is not None:
            return self.ends
        if self.dominance is not None:  # floats, of which there are many
            return Fraction(float(self.array.min())), Fraction(float(self.array.max()))
        return min(self.weights, default=Fraction(1)), max(self.weights, default=Fraction(1))

    @property
    def proved_rate(self) -> Fraction:
        """The rate of a function of which one is proved."""
        assert self.rate is not None
        return self.rate

    @property
    def overshoot(self) -> Fraction:
        """``highest / lowest``, which multiplies the squared norm."""
        return self.highest / self.lowest

    @property
    def form(self) -> Form | None:
        """What bounds of the input take; None without a rate, and in large graphs."""
        if self.rate is None or self.dominance is not None:
            return None
        diagonal = None if self.matrix is not None else self.weights
        return Form(self.rate, self.coordinates, self.nodes, diagonal, self.matrix, self.lowest, self.gauge)

    # ------------------------------------------------------------------ in floats

    @cached_property
    def rate_below(self) -> float:
        """The rate, rounded down."""
        return float_down(self.proved_rate)

    @cached_property
    def overshoot_above(self) -> float:
        """The overshoot constant, rounded up."""
        return float_up(self.overshoot)

    @cached_property
    def lowest_below(self) -> float:
        """``lowest``, rounded down."""
        return float_down(self.lowest)

    @cached_property
    def array(self) -> np.ndarray:
        """``P`` (n, n), or its diagonal (n,) if it is diagonal."""
        if self.matrix is not None:
            return np.array([[float(x) for x in row] for row in self.matrix])
        if len(self.blocks) == 1 and self.blocks[0].dyadic is not None:
            return self.blocks[0].dyadic
        return np.array([float(w) for w in self.weights])

    @cached_property
    def rows(self) -> np.ndarray:
        """``nodes`` as an index array."""
        return np.array(self.nodes, dtype=np.int64)

    @cached_property
    def root(self) -> np.ndarray:
        """``R`` with ``P = R'R``: the square root of the weights, or the Cholesky factor of a full ``P``."""
        return np.sqrt(self.array) if self.array.ndim == 1 else np.linalg.cholesky(self.array).T

    def coordinates_of(self, states: np.ndarray, L: Any) -> np.ndarray:
        """Return ``z`` for states of shape (N, ...): rows of ``-L X``, or the weighted deviation of ``X``."""
        if self.coordinates == "E":
            flat = states.reshape(len(states), -1)
            return -np.asarray(L @ flat).reshape(states.shape)[self.rows]
        X, g = states[self.rows], np.array(self.gauge, dtype=float)
        mean = np.tensordot(self.array / self.array.sum() * g, X, axes=1)
        return X - np.multiply.outer(g, mean)

    def exact_coordinates_of(self, x: Sequence[Fraction], error: Sequence[Fraction]) -> list[Fraction]:
        """Return ``z`` of one state in rationals; ``error`` is its ``-L x``."""
        if self.coordinates == "E":
            return [error[v] for v in self.nodes]
        own = [x[v] for v in self.nodes]
        total = sum((w * g * y for w, g, y in zip(self.weights, self.gauge, own, strict=True)), Fraction(0))
        mean = total / sum(self.weights)
        return [y - g * mean for y, g in zip(own, self.gauge, strict=True)]

    def scaled(self, z: np.ndarray) -> np.ndarray:
        """Return ``R z``, whose Euclidean norm is ``sqrt(V)``, for coordinates of shape (n, ...)."""
        if self.root.ndim == 1:
            return self.root.reshape(-1, *([1] * (z.ndim - 1))) * z
        return np.tensordot(self.root, z, axes=1)

    def value(self, z: np.ndarray) -> np.ndarray:
        """Return ``V`` for coordinates of shape (n, ...)."""
        return (self.scaled(z) ** 2).sum(axis=0)


def root_above(value: Fraction) -> float:
    """Return a float that is not below the square root of a nonnegative rational of any size.

    Examples
    --------
    >>> root_above(Fraction(10) ** 500) >= 1e250, root_above(Fraction(0))
    (True, 0.0)
    """
    if value == 0:
        return 0.0
    shift = (value.numerator.bit_length() - value.denominator.bit_length()) // 2
    root = math.sqrt(float(value * Fraction(4) ** -shift)) * (1 + 1e-15)
    try:
        return math.nextafter(math.ldexp(root, shift), math.inf)
    except OverflowError:
        return math.inf
