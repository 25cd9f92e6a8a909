"""What every theorem of the paper has: hypotheses, a Lyapunov function, a rate with its proof.

All rates are per unit of the stretched clock ``s``: ``V <= e^(-rate s) V(0)`` and, in the coordinates of the theorem,
``||.||^2 <= overshoot e^(-rate s) ||.(0)||^2``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.definiteness_proofs import prove_generalized_margin, prove_margin, prove_positive_definite
from lmi.dyadic import round_to_bits
from ptcc_certify.checker import Statement
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.lyapunov.function import LyapunovFunction, Matrix
from ptcc_certify.theorems.lemmas import EXACT_NODES, algebraic_connectivity, exact_left_vector, left_vector

if TYPE_CHECKING:
    import flint

#: Significant bits to which the search's floats are rounded before anything is proved about them.
BITS = 40
#: A left null vector is kept exact when its entries are shorter than this, otherwise rounded to it.
EXACT_VECTOR_BITS = 64
#: The objective where there is nothing to decrease.
KEPT = "none: every agent keeps its state"


@dataclass(frozen=True)
class ExactInterval:
    """Proved lower bounds of the ends of the interval of ``rho``; None where ``rho`` is unbounded.

    Every ``rho`` in ``0 < rho <= printed`` and ``0 < rho <= exact`` is admissible; the true ends lie above, as a rule
    by one part in 10^9.
    """

    printed: Fraction | None
    exact: Fraction | None


@dataclass(frozen=True)
class Obligation(Statement):
    """One statement that was proved, and that the independent check verifies again.

    Attributes
    ----------
    kind : str
        One of :data:`ptcc_certify.checker.OBLIGATIONS`, which gives the statement and its lemma.
    of : str
        The part of the certificate that it is about.
    numbers : mapping of str to Fraction
        The constants of the statement.
    witness : optional
        What makes the statement easy to verify, JSON-ready or to be written by the document; need not be trusted.
    """

    numbers: Mapping[str, Fraction] = field(default_factory=dict)
    witness: Any = None


@dataclass(frozen=True)
class RateProof:
    """A proved rate, with what was proved; ``rate`` None when a step could not be proved (``failed`` says which)."""

    rate: Fraction | None
    obligations: tuple[Obligation, ...]
    interval: ExactInterval | None = None
    failed: str | None = None


class Theorem(ABC):
    """A theorem row: when it applies, its Lyapunov function, its rate.

    Subclasses set ``number`` and ``statement`` and read like the theorem.
    """

    number: str
    statement: str

    @abstractmethod
    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Return the named hypotheses, each with its truth value."""

    def applies(self, structure: Structure) -> bool:
        """Tell whether all hypotheses hold."""
        return all(self.hypotheses(structure).values())

    @abstractmethod
    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """Search the Lyapunov function and round it to rationals.

        Raises
        ------
        lmi.NoCertificate
            The search found none.
        """

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """Return the symmetric ``S`` (floats) with which the paper bounds ``V' <= -gain z'Sz``.

        ``Omega A + A' Omega`` on the rows of ``V`` unless the theorem says otherwise.
        """
        S = floats(V.weights)[:, None] * float_block(structure.graph.dense_laplacian(), V.nodes, V.nodes)
        return S + S.T

    def rate(self, structure: Structure, V: LyapunovFunction) -> float:
        """Return the paper's rate ``lmin(S) / lmax`` from floating-point eigenvalues; infinite if ``V`` is 0."""
        if not V.blocks:
            return math.inf
        return smallest_eigenvalue(self.decrease(structure, V)) / float(max(V.weights))

    @abstractmethod
    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """Prove a rate of ``V`` in exact arithmetic, as near to the paper's as proves."""


# ---------------------------------------------------------------------- floats


def float_block(L: np.ndarray, rows: Iterable[int], columns: Iterable[int]) -> np.ndarray:
    """Return ``L[rows][:, columns]``, either possibly empty."""
    return L[np.ix_(np.array([*rows], dtype=int), np.array([*columns], dtype=int))]


def floats(values: Iterable[Fraction]) -> np.ndarray:
    """Return rationals as a float64 array."""
    return np.array([float(v) for v in values])


def smallest_eigenvalue(S: np.ndarray) -> float:
    """Return the smallest eigenvalue of a symmetric matrix."""
    return float(np.linalg.eigvalsh(S)[0])


def block_of(structure: Structure, component: ClosedComponent) -> SignedDigraph:
    """Return the closed component as a graph of its own."""
    return structure.graph.subgraph(component.nodes)


def rounded(values: np.ndarray, bits: int = BITS) -> tuple[Fraction, ...]:
    """Round positive floats to short dyadic rationals."""
    return tuple(round_to_bits(float(v), bits) for v in values)


def left_vector_diagonal(graph: SignedDigraph) -> tuple[Fraction, ...]:
    """Return ``p`` of Lemma 2.3: exact where that is short, otherwise rounded (the proofs hold for any ``p > 0``)."""
    if graph.n_nodes <= EXACT_NODES // 4:
        exact = exact_left_vector(graph)
        if all(p.denominator.bit_length() <= EXACT_VECTOR_BITS for p in exact):
            return tuple(exact)
    return rounded(left_vector(graph), 53)


def connectivity_rate(graph: SignedDigraph, p: tuple[Fraction, ...]) -> float:
    """Return ``2 a(L)`` of Lemma 3.1 in floating point."""
    return 2 * algebraic_connectivity(graph, floats(p))


# ---------------------------------------------------------------------- exact matrices


def exact_block(L: Matrix, rows: Iterable[int], columns: Iterable[int]) -> Matrix:
    """Return ``L[rows][:, columns]``."""
    columns = list(columns)
    return [[L[i][j] for j in columns] for i in rows]


def symmetric_product(weights: Iterable[Fraction], A: Matrix) -> Matrix:
    """Return ``Omega A + A' Omega`` with ``Omega = diag(weights)``."""
    w, n = list(weights), len(A)
    return [[w[i] * A[i][j] + w[j] * A[j][i] for j in range(n)] for i in range(n)]


def congruence(A: Matrix, S: Matrix) -> Matrix:
    """Return ``A' S A``."""
    return multiply(transpose(A), multiply(S, A))


def transpose(A: Matrix) -> Matrix:
    """Return the transpose."""
    return [list(column) for column in zip(*A, strict=True)]


def multiply(A: Matrix, B: Matrix) -> Matrix:
    """Return ``A B``, formed in integers over common denominators."""
    (left, a), (right, b) = integer_matrix(A), integer_matrix(B)
    return [[Fraction(x, a * b) for x in row] for row in integer_rows(left * right)]


def integer_matrix(M: Sequence[Sequence[Fraction]]) -> tuple[flint.fmpz_mat, int]:
    """Return a rational matrix as integers over its common denominator, and that."""
    import flint

    scale = math.lcm(*{x.denominator for row in M for x in row})
    whole = [[x.numerator * (scale // x.denominator) for x in row] for row in M]
    return flint.fmpz_mat(len(M), len(M[0]) if M else 0, [x for row in whole for x in row]), scale


def integer_rows(M: flint.fmpz_mat) -> list[list[int]]:
    """Return the rows of an integer matrix."""
    return [[int(x) for x in row] for row in M.tolist()]


def diagonal_matrix(weights: Iterable[Fraction]) -> Matrix:
    """Return ``diag(weights)``."""
    w = list(weights)
    return [[w[i] if i == j else Fraction(0) for j in range(len(w))] for i in range(len(w))]


def without_last(S: Matrix) -> Matrix:
    """Delete the last row and column: the quadratic form modulo a kernel vector whose last entry is not zero."""
    return [row[:-1] for row in S[:-1]]


def to_floats(S: Matrix) -> np.ndarray:
    """Return a rational matrix in float64."""
    return np.array([[float(x) for x in row] for row in S]).reshape(len(S), -1)


# ---------------------------------------------------------------------- proofs


def prove_direct(structure: Structure, V: LyapunovFunction, letter: str) -> RateProof:
    """Prove ``Omega A + A' Omega > m I`` on the rows of ``V``, hence the rate ``m / lmax(Omega)``."""
    weights = V.weights
    A, unit = integer_matrix(exact_block(structure.graph.exact_laplacian(), V.nodes, V.nodes))
    w, scale = integer_matrix([weights])
    product = integer_rows(A)
    own = integer_rows(w)[0]
    S = [[own[i] * x + own[j] * product[j][i] for j, x in enumerate(row)] for i, row in enumerate(product)]
    Z = [[unit * scale * (i == j) for j in range(len(own))] for i in range(len(own))]
    guess = smallest_eigenvalue(np.array([[x / (unit * scale) for x in row] for row in S]))
    m = prove_generalized_margin(S, Z, guess) if guess > 0 else None
    if m is None:
        return RateProof(None, (), failed=f"{letter} is not proved positive definite")
    return RateProof(m / max(weights), (Obligation("margin", "paper", {"m": m} | _rho(V)),))


def _rho(V: LyapunovFunction) -> dict[str, Fraction]:
    return {} if V.rho is None else {"rho": V.rho}


def prove_connectivity(graph: SignedDigraph, p: tuple[Fraction, ...], guess: float) -> Fraction | None:
    """Prove ``xi'(PL + L'P)xi >= b xi'P xi`` for all ``xi`` in the range of ``L``, with ``P = diag(p)``; return ``b``.

    ``L G1 = 0``, so ``L'(PL + L'P - bP)L`` is tested after one row and column are deleted. That is a proof for any
    ``p > 0``, exact left null vector or rounded.
    """
    L = graph.exact_laplacian()
    S = without_last(congruence(L, symmetric_product(p, L)))
    Z = without_last(congruence(L, diagonal_matrix(p)))
    return prove_generalized_margin(S, Z, guess)


def prove_weighted_deviation(
    graph: SignedDigraph, gauge: tuple[int, ...], p: tuple[Fraction, ...], guess: float
) -> Fraction | None:
    """Prove ``Z L + L'Z >= b Z`` for ``Z = G (P - p p'/p'1) G``, whose form is ``eps'P eps``; return ``b``.

    ``Z G1 = 0`` and ``(Z L + L'Z) G1 = 0`` exactly for any ``p > 0``; one row and column are deleted.
    """
    n, total = len(p), sum(p)
    Z = [
        [gauge[i] * gauge[j] * ((p[i] if i == j else Fraction(0)) - p[i] * p[j] / total) for j in range(n)]
        for i in range(n)
    ]
    ZL = multiply(Z, graph.exact_laplacian())
    S = [[ZL[i][j] + ZL[j][i] for j in range(n)] for i in range(n)]
    return prove_generalized_margin(without_last(S), without_last(Z), guess)


def prove_coupled(
    structure: Structure, V: LyapunovFunction, gamma: Matrix, leaders: tuple[Obligation, ...], letter: str
) -> RateProof:
    """Prove ``[[Gamma, rho L_FL' H_F], [rho H_F L_FL, rho S_F]] > m I`` and the ends of the interval of ``rho``."""
    phi = exact_phi(structure, V, gamma)
    rho = V.rho if V.rho is not None else Fraction(1)
    S = phi(rho)
    m = prove_margin(S, smallest_eigenvalue(to_floats(S)))
    if m is None:
        return RateProof(None, leaders, failed=f"{letter} is not proved positive definite")
    statement = Obligation("margin", "paper", {"m": m} | _rho(V))
    interval, found = prove_interval(V, phi)
    return RateProof(m / max(V.weights), (*leaders, statement, *found), interval)


def exact_phi(structure: Structure, V: LyapunovFunction, gamma: Matrix) -> Callable[[Fraction], Matrix]:
    """Return ``rho -> Phi(rho)`` in rationals; ``gamma`` covers the blocks that ``rho`` does not multiply."""
    L = structure.graph.exact_laplacian()
    leaders = [v for block in V.blocks if not block.times_rho for v in block.nodes]
    followers = [v for block in V.blocks if block.times_rho for v in block.nodes]
    weights = [w for block in V.blocks if block.times_rho for w in block.diagonal]
    S_F = symmetric_product(weights, exact_block(L, followers, followers))
    C = [[w * x for x in row] for w, row in zip(weights, exact_block(L, followers, leaders), strict=True)]

    def phi(rho: Fraction) -> Matrix:
        top = [[*gamma[i], *(rho * row[i] for row in C)] for i in range(len(leaders))]
        bottom = [[*(rho * x for x in row), *(rho * x for x in S_F[i])] for i, row in enumerate(C)]
        return top + bottom

    return phi


def prove_interval(
    V: LyapunovFunction, phi: Callable[[Fraction], Matrix]
) -> tuple[ExactInterval | None, tuple[Obligation, ...]]:
    """Prove the ends of the interval of ``rho``: ``Phi(end) > 0`` implies ``Phi(rho) > 0`` for ``0 < rho < end``."""
    if V.interval is None:
        return None, ()
    ends: dict[str, Fraction | None] = {}
    for name, value in (("printed", V.interval.printed), ("exact", V.interval.exact)):
        if not np.isfinite(value):
            ends[name] = None
            continue
        found = (Fraction(value * (1 - loss)) for loss in (1e-9, 1e-7, 1e-4, 0.01))
        # The fallback is rho itself, whose admissibility is proved with the rate.
        ends[name] = next((end for end in found if prove_positive_definite(phi(end))), V.rho)
    if (printed := ends["printed"]) is not None and (exact := ends["exact"]) is not None:
        ends["printed"] = min(printed, exact)  # they may coincide, and differ by rounding
    numbers = {name: end for name, end in ends.items() if end is not None}
    interval = ExactInterval(ends["printed"], ends["exact"])
    if not numbers:
        return interval, ()
    return interval, (Obligation("rho-interval", "paper", numbers),)


def closed_blocks(structure: Structure) -> list[tuple[int, ClosedComponent]]:
    """Return the closed components with their 1-based number."""
    return list(enumerate(structure.closed_components, start=1))


def follower_nodes(structure: Structure) -> tuple[int, ...]:
    """Return the followers as a tuple."""
    return tuple(structure.followers.tolist())


def split_rho(followers: np.ndarray) -> tuple[np.ndarray, float]:
    """Split ``rho Omega_F`` into a matrix with largest entry 1 and the factor ``rho``."""
    top = float(followers.max())
    return followers / top, top
