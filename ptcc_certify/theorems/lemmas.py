"""The lemmas of the paper as functions, one each, and the arithmetic of matrices that theorems and final states need.

Lemma 4 is :func:`lmi.h_matrix_lyapunov`, Lemma 5 :func:`lmi.schur_positive_definite` and Lemma 6
:func:`ptcc_certify.model.gain.prescribed_time_bound`; the others are here. Lemma 7.1 is Lemma 9.1 for one closed
component, Lemma 8 the same for Lemma 9.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

import lmi
from lmi.dyadic import round_to_bits
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs import size_limits as limits
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.structure import Structure, analyse

if TYPE_CHECKING:
    import flint


#: A matrix of rationals, as lists of rows.
Matrix = list[list[Fraction]]
EXACT_NODES, DENSE_NODES, FACTOR_NODES = limits.EXACT_NODES, limits.DENSE_NODES, limits.FACTOR_NODES
#: Eigenvalues nearest to 0 that are computed, products spent on an inverse, and restarts of Arnoldi's method.
_NEAREST, _PRODUCTS, _RESTARTS = 8, 2000, 50


def gauge(graph: Any) -> np.ndarray | None:
    """Lemma 1: a graph is structurally balanced iff some diagonal ``G`` of signs has ``G L G = M(L)``.

    Parameters
    ----------
    graph : graph-like

    Returns
    -------
    (N,) int8 array or None
        The diagonal of ``G``, +1 at the first node of each weak component; None if no such ``G`` exists.

    Examples
    --------
    >>> gauge(SignedDigraph.from_edges([(1, 2, -3), (2, 3, 1)]))
    array([ 1, -1, -1], dtype=int8)
    """
    graph = as_graph(graph)
    return analyse(graph).gauge


@dataclass(frozen=True)
class Spectrum:
    """Lemma 2 for one graph: the nonzero eigenvalues of ``L`` and the dimension of its kernel.

    Attributes
    ----------
    nonzero : (r,) complex array
        Eigenvalues with the zeros of balanced closed components taken out, computed per strong component.
    kernel_dimension : int
        Number of balanced closed components.
    """

    nonzero: np.ndarray
    kernel_dimension: int

    @property
    def spectral_rate(self) -> float | None:
        """``2 min Re lambda`` over the nonzero eigenvalues: no certified rate can exceed it; None if there are none."""
        return float(2 * self.nonzero.real.min()) if self.nonzero.size else None


def laplacian_spectrum(structure: Any) -> Spectrum:
    """Lemma 2: a strong graph is unbalanced iff every eigenvalue of ``L`` has positive real part.

    If it is balanced, 0 is simple (eigenvector ``G 1``) and the others have positive real part. For any graph the
    spectrum is the union over its strong components; only balanced closed ones contribute a zero.

    Parameters
    ----------
    structure : Structure or graph-like
        Of strong components above ``DENSE_NODES`` nodes only the eigenvalues nearest to 0 are computed, by Arnoldi's
        method; above ``FACTOR_NODES`` that takes too long.

    Returns
    -------
    Spectrum

    Examples
    --------
    >>> g = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 4)])
    >>> laplacian_spectrum(analyse(g)).nonzero.real.round(6).tolist()
    [2.0, 4.0]
    """
    structure = analyse(structure)
    balanced = {c.nodes[0] for c in structure.closed_components if c.balanced}
    values: list[np.ndarray] = []
    for nodes, block in component_blocks(structure):
        large = nodes.size > DENSE_NODES
        eigenvalues = _nearest_eigenvalues(block) if large else np.linalg.eigvals(block.toarray()).astype(complex)
        if int(nodes[0]) in balanced:
            eigenvalues = np.delete(eigenvalues, np.argmin(np.abs(eigenvalues)))
        values.append(eigenvalues)
    values.append(structure.graph.in_weight()[single_followers(structure)].astype(complex))
    return Spectrum(np.concatenate(values), len(balanced))


def component_blocks(structure: Structure) -> Iterator[tuple[np.ndarray, Any]]:
    """Yield the nodes of every strong component of several nodes, and its block of ``L`` as a sparse array.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 4)])
    >>> [(nodes.tolist(), block.toarray().tolist()) for nodes, block in component_blocks(analyse(g))]
    [([0, 1], [[1.0, -1.0], [-1.0, 1.0]])]
    """
    number = structure.strong_component
    order, ends = np.argsort(number, kind="stable"), np.cumsum(np.bincount(number)).tolist()
    L = structure.graph.laplacian()[order][:, order].sorted_indices()  # components stand one after the other
    for first, end in pairwise([0, *ends]):
        if end - first > 1:
            yield order[first:end], L[first:end, first:end]


def single_followers(structure: Structure) -> np.ndarray:
    """Return the nodes that listen to somebody, and are strong components by themselves.

    Examples
    --------
    >>> single_followers(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 4)]))).tolist()
    [2]
    """
    number = structure.strong_component
    return np.flatnonzero((np.bincount(number)[number] == 1) & (structure.graph.in_weight() > 0))


def _nearest_eigenvalues(block: Any) -> np.ndarray:
    """Return the eigenvalues nearest to 0, by inverses of the block shifted to the left of them all."""
    from scipy import sparse
    from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, bicgstab, eigs

    from lmi.sparse_h_matrix import FILL_ROWS, fill_core

    diagonal = block.diagonal()
    shift = -1e-4 * float(diagonal.mean())
    inverse = None
    if fill_core(block) > FILL_ROWS:
        shifted = sparse.csr_array(block - shift * sparse.eye_array(diagonal.size))
        scaled = LinearOperator(block.shape, matvec=lambda x: x.ravel() / (diagonal - shift))

        def solve(x: np.ndarray) -> np.ndarray:
            solution, failed = bicgstab(shifted, x.ravel(), rtol=1e-10, maxiter=_PRODUCTS, M=scaled)
            if failed:
                raise np.linalg.LinAlgError("the inverse did not converge")
            return solution

        inverse = LinearOperator(block.shape, matvec=solve)
    options: dict[str, Any] = {"sigma": shift, "OPinv": inverse, "return_eigenvectors": False, "maxiter": _RESTARTS}
    try:
        eigenvalues = eigs(sparse.csc_array(block), k=_NEAREST, **options)
    except ArpackNoConvergence as error:
        eigenvalues = error.eigenvalues
    except (ArpackError, RuntimeError) as error:
        raise np.linalg.LinAlgError(str(error)) from None
    if len(eigenvalues) < 2:
        raise np.linalg.LinAlgError("the eigenvalues nearest to 0 were not found")
    return np.asarray(eigenvalues)


def left_vector(graph: Any) -> np.ndarray:
    """Lemma 2.3: the positive ``p`` with ``p' M(L) = 0`` and ``p' 1 = 1`` of a strongly connected graph.

    Computed without subtractions (Grassmann, Taksar, Heyman 1985), hence to full relative accuracy in each entry
    however far apart the weights lie; above 500 nodes by a sparse factor, to its accuracy. Where everybody listens to
    as much as is listened to them, as in undirected graphs, it is ``1/N``: that is checked first, exactly.

    Parameters
    ----------
    graph : graph-like
        Strongly connected.

    Returns
    -------
    (N,) array

    Raises
    ------
    HypothesisError
        The graph is not strongly connected, or float64 cannot hold the entries of ``p``.

    Examples
    --------
    >>> left_vector(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 1)]))
    array([0.75, 0.25])
    """
    graph = as_graph(graph)
    if graph.n_nodes > DENSE_NODES:
        return np.full(graph.n_nodes, 1 / graph.n_nodes) if _all_ones(graph) else _sparse_left_vector(graph)
    rate = np.abs(graph.dense_laplacian())
    np.fill_diagonal(rate, 0.0)
    rate /= rate.max(initial=0.0) or 1.0
    n = graph.n_nodes
    p = np.zeros(n)
    p[0] = 1.0
    with np.errstate(all="ignore"):
        for k in range(n - 1, 0, -1):
            out = rate[k, :k].sum()
            if not out > 0:
                raise HypothesisError("the graph is not strongly connected, so no positive left vector is unique")
            rate[:k, k] /= out
            rate[:k, :k] += np.outer(rate[:k, k], rate[k, :k])
        for k in range(1, n):
            p[k] = p[:k] @ rate[:k, k]
        p /= p.max()
    if not (np.isfinite(p).all() and (p > 0).all()):
        raise HypothesisError(
            "no positive left vector: the graph is not strongly connected, or its entries span more than float64 holds"
        )
    return p / p.sum()


def _all_ones(graph: SignedDigraph) -> bool:
    """Tell whether the left vector of a graph is the vector of ones, exactly; False if the graph is not connected."""
    from scipy.sparse.csgraph import connected_components

    size, in_weight = np.abs(graph.weights), graph.in_weight()
    with np.errstate(all="ignore"):
        surplus = np.abs(in_weight - np.bincount(graph.source, size, minlength=graph.n_nodes))
    if (surplus > 1e-9 * in_weight).any() or connected_components(graph.adjacency(), directed=False)[0] > 1:
        return False
    return _annihilates(graph, [1] * graph.n_nodes)


def _annihilates(graph: SignedDigraph, p: Sequence[int]) -> bool:
    """Tell whether ``p' M(L) = 0``, exactly."""
    surplus = [Fraction(0)] * graph.n_nodes
    for edge, (s, t) in enumerate(zip(graph.source.tolist(), graph.target.tolist(), strict=True)):
        flow = p[t] * abs(graph.exact_weight(edge))
        surplus[t] += flow
        surplus[s] -= flow
    return not any(surplus)


def _sparse_left_vector(graph: SignedDigraph) -> np.ndarray:
    """Solve ``p' M(L) = 0`` with the last entry of ``p`` set to 1, by a sparse factor."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    from lmi.sparse_h_matrix import FILL_ROWS, fill_core, solve

    M = sparse.csc_array(sparse.diags_array(graph.in_weight()) - abs(graph.adjacency()))
    rest, last = sparse.csc_array(M[:-1, :-1].T), -M[[-1], :-1].toarray().ravel()
    if fill_core(M) > FILL_ROWS:
        p = np.append(solve(sparse.csr_array(rest), last, rest.diagonal()), 1.0)
    else:
        options = {"SymmetricMode": True}
        factor = splu(rest, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        p = np.append(factor.solve(last), 1.0)
    if not (np.isfinite(p).all() and (p > 0).all()):
        raise HypothesisError(
            f"no positive left vector of a group of {graph.n_nodes:,} leaders was found in float64; "
            "certify a part of the graph, or weights of more even size"
        )
    return p / p.sum()


def dyadic_left_vector(graph: SignedDigraph, p: np.ndarray | None = None) -> list[int] | None:
    """Lemma 2.3 in integers of at most 40 bits, if there is such a ``p``, as in undirected graphs; None if not.

    Parameters
    ----------
    graph : SignedDigraph
        Strongly connected.
    p : (N,) array, optional
        :func:`left_vector` by default.

    Examples
    --------
    >>> dyadic_left_vector(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 3)]))
    [1, 1]
    >>> dyadic_left_vector(SignedDigraph.from_edges([(1, 2, 3), (2, 1, 1)])) is None
    True
    """
    p = left_vector(graph) if p is None else p
    whole = np.rint(np.ldexp(p / p.max(), 40)).astype(np.int64).tolist()
    if min(whole) <= 0:
        return None
    common = math.gcd(*whole)
    whole = [w // common for w in whole]
    return whole if _annihilates(graph, whole) else None


def exact_left_vector(graph: Any) -> list[Fraction]:
    """Lemma 2.3 in exact rationals (see :func:`left_vector`); for graphs of at most ``EXACT_NODES`` nodes.

    Parameters
    ----------
    graph : graph-like
        Strongly connected.

    Returns
    -------
    list of N Fraction
        Positive, of sum 1.

    Raises
    ------
    HypothesisError
        The graph is not strongly connected.

    Examples
    --------
    >>> exact_left_vector(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 1)]))
    [Fraction(3, 4), Fraction(1, 4)]
    """
    graph = as_graph(graph)
    n, L = graph.n_nodes, graph.exact_laplacian()
    # p' M(L) = 0 has rank n - 1; its last equation gives way to p' 1 = 1.
    system = [[L[j][i] if i == j else -abs(L[j][i]) for j in range(n)] for i in range(n - 1)] + [[Fraction(1)] * n]
    p = solve_exact(system, [[Fraction(0)]] * (n - 1) + [[Fraction(1)]])
    if p is None or any(row[0] <= 0 for row in p):
        raise HypothesisError("the graph is not strongly connected, so no positive left vector is unique")
    return [row[0] for row in p]


def algebraic_connectivity(graph: Any, p: np.ndarray | None = None) -> float:
    """Lemma 3.1: ``a(L) = min xi' Lbar xi / xi' P xi`` over ``xi' G p = 0``, ``Lbar = (P L + L' P) / 2``.

    Parameters
    ----------
    graph : graph-like
        Strongly connected, structurally balanced, N >= 2.
    p : (N,) array, optional
        :func:`left_vector` by default.

    Returns
    -------
    float
        Positive: the second-smallest generalized eigenvalue of ``(Lbar, P)``.

    Raises
    ------
    HypothesisError
        The graph is a single node or structurally unbalanced.

    Examples
    --------
    >>> round(algebraic_connectivity(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])), 12)
    2.0
    """
    graph = as_graph(graph)
    if graph.n_nodes < 2:
        raise HypothesisError("a(L) needs at least two nodes")
    if gauge(graph) is None:
        raise HypothesisError("a(L) is defined for structurally balanced graphs; this one has a negative cycle")
    p = left_vector(graph) if p is None else p
    half = np.sqrt(p)
    S = half[:, None] * graph.dense_laplacian() / half
    return float(np.linalg.eigvalsh((S + S.T) / 2)[1])


def unbalanced_lyapunov(graph: Any) -> lmi.DiagonalCertificate:
    """Lemma 3.2: a diagonal ``Omega > 0`` with ``Omega L + L' Omega > 0`` of an unbalanced strong graph.

    Parameters
    ----------
    graph : graph-like
        Strongly connected and structurally unbalanced.

    Returns
    -------
    lmi.DiagonalCertificate
        Of the best margin; its ``rate`` is per unit of the clock, in floating point.

    Raises
    ------
    HypothesisError
        The graph is not strongly connected or is structurally balanced.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)])
    >>> round(unbalanced_lyapunov(g).rate, 6)
    2.0
    """
    graph = as_graph(graph)
    structure = analyse(graph)
    if structure.connectivity != "strong":
        raise HypothesisError(f"Lemma 3.2 asks for a strongly connected graph; this one is {structure.connectivity}")
    if structure.balanced:
        raise HypothesisError("Lemma 3.2 asks for a structurally unbalanced graph; this one is balanced")
    return lmi.diagonal_lyapunov(graph.laplacian())


def unbalanced_diagonal(graph: SignedDigraph) -> np.ndarray:
    """Return ``omega`` of Lemma 3.2: of the largest margin, or ``p`` of Lemma 2.3 where the solver resolves none.

    ``x'(P L + L'P)x = sum_kl p_k |w_kl| (x_k - sign(w_kl) x_l)^2``, which vanishes for balanced graphs only: ``P``
    always serves, however small its margin.

    Examples
    --------
    >>> unbalanced_diagonal(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)])).round(6)
    array([1., 1.])
    """
    try:
        return lmi.diagonal_lyapunov(graph.laplacian()).omega
    except lmi.NoCertificate:
        p = left_vector(graph)
        return p / p.max()


def follower_lyapunov(structure: Any) -> lmi.DiagonalCertificate:
    """Lemmas 7, 9.1: ``L_F`` is a nonsingular H-matrix; some diagonal ``Xi_F > 0`` has ``Xi_F L_F + L_F' Xi_F > 0``.

    Parameters
    ----------
    structure : Structure or graph-like
        With followers.

    Returns
    -------
    lmi.DiagonalCertificate
        Of the best margin; its ``rate`` is per unit of the clock, in floating point.

    Raises
    ------
    HypothesisError
        There are no followers.

    Examples
    --------
    >>> follower_lyapunov(analyse(SignedDigraph.from_edges([(1, 2, -4)]))).rate
    8.0
    """
    structure = analyse(structure)
    F = structure.followers
    if F.size == 0:
        raise HypothesisError("the graph has no followers")
    return lmi.h_matrix_lyapunov(structure.graph.laplacian()[F][:, F])


def containment_weights(structure: Any) -> np.ndarray | None:
    """Lemmas 8 and 9.2: ``varpi_k = -L_F^-1 L_FLk G_k 1``, the pull of balanced closed component k on each follower.

    Absolute row sums are at most 1. With one closed component (Lemma 8) the column is ``zeta``, and ``|zeta| = 1``
    if the whole graph is balanced.

    Parameters
    ----------
    structure : Structure or graph-like

    Returns
    -------
    (N_F, m_b) array, or None
        One column for each balanced closed component, in order; unbalanced ones pull to zero and have none. None
        where neither BiCGSTAB converges nor a sparse factor is cheap.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -3)])
    >>> containment_weights(analyse(g))
    array([[ 0.25, -0.75]])
    """
    structure = analyse(structure)
    from lmi.sparse_h_matrix import solve_columns

    balanced, F = [c for c in structure.closed_components if c.balanced], structure.followers
    if F.size == 0 or not balanced:
        return np.zeros((F.size, len(balanced)))
    ends = np.zeros((structure.graph.n_nodes, len(balanced)))  # G_k 1 on each balanced closed component
    for column, component in enumerate(balanced):
        ends[list(component.nodes), column] = component.gauge
    rows = structure.graph.laplacian().tocsr()[F]
    L_F = rows[:, F].tocsr()
    return solve_columns(L_F, -(rows @ ends), L_F.diagonal())


def exact_containment_weights(structure: Any) -> list[list[Fraction]]:
    """Lemmas 8 and 9.2 in exact rationals (see :func:`containment_weights`), as rows.

    Parameters
    ----------
    structure : Structure or graph-like

    Returns
    -------
    list of N_F lists of Fraction
        One entry for each balanced closed component.

    Raises
    ------
    HypothesisError
        The followers' block is singular, which Lemma 9 excludes.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -2)])
    >>> exact_containment_weights(analyse(g))
    [[Fraction(1, 3), Fraction(-2, 3)]]
    """
    structure = analyse(structure)
    F = structure.followers.tolist()
    balanced = [c for c in structure.closed_components if c.balanced]
    if not F or not balanced:
        return [[] for _ in F]
    L = structure.graph.exact_laplacian()
    pull = [
        [-sum((L[i][v] * g for v, g in zip(c.nodes, c.gauge or (), strict=True)), Fraction(0)) for c in balanced]
        for i in F
    ]
    solution = solve_exact([[L[i][j] for j in F] for i in F], pull)
    if solution is None:
        raise HypothesisError("the follower block is singular, which Lemma 9 excludes")
    return solution


def solve_exact(A: Sequence[Sequence[Fraction]], B: Sequence[Sequence[Fraction]]) -> list[list[Fraction]] | None:
    """Solve ``A X = B`` in exact rationals; None if ``A`` is singular.

    Examples
    --------
    >>> solve_exact([[Fraction(2)]], [[Fraction(1)]])
    [[Fraction(1, 2)]]
    """
    import flint

    def matrix(rows: Sequence[Sequence[Fraction]]) -> flint.fmpq_mat:
        entries = [flint.fmpq(x.numerator, x.denominator) for row in rows for x in row]
        return flint.fmpq_mat(len(rows), len(rows[0]), entries)

    try:
        X = matrix(A).solve(matrix(B))
    except ZeroDivisionError:
        return None
    return [[Fraction(int(x.p), int(x.q)) for x in row] for row in X.tolist()]


#: Significant bits to which the search's floats are rounded before anything is proved about them.
BITS = 40


def float_block(L: np.ndarray, rows: Iterable[int], columns: Iterable[int]) -> np.ndarray:
    """Return ``L[rows][:, columns]``, either possibly empty."""
    return L[np.ix_(np.array([*rows], dtype=int), np.array([*columns], dtype=int))]


def floats(values: Iterable[Fraction]) -> np.ndarray:
    """Return rationals as a float64 array."""
    return np.array([float(v) for v in values])


def rounded(values: Iterable[float], bits: int = BITS) -> tuple[Fraction, ...]:
    """Round positive floats to short dyadic rationals."""
    return tuple(round_to_bits(float(v), bits) for v in values)


def exact_block(L: Matrix, rows: Iterable[int], columns: Iterable[int]) -> Matrix:
    """Return ``L[rows][:, columns]``."""
    columns = list(columns)
    return [[L[i][j] for j in columns] for i in rows]


def diagonal_matrix(weights: Iterable[Fraction]) -> Matrix:
    """Return ``diag(weights)``."""
    w = list(weights)
    return [[w[i] if i == j else Fraction(0) for j in range(len(w))] for i in range(len(w))]


def symmetric_product(weights: Iterable[Fraction], A: Matrix) -> Matrix:
    """Return ``Omega A + A' Omega`` with ``Omega = diag(weights)``."""
    w = list(weights)
    n, zero = len(A), Fraction(0)
    return [
        [w[i] * A[i][j] + w[j] * A[j][i] if A[i][j] or A[j][i] else zero for j in range(n)]  # many are
        for i in range(n)
    ]


def multiply(A: Matrix, B: Matrix) -> Matrix:
    """Return ``A B``, formed in integers over common denominators."""
    (left, a), (right, b) = integer_matrix(A), integer_matrix(B)
    return [[Fraction(x, a * b) for x in row] for row in integer_rows(left * right)]


def congruence(A: Matrix, S: Matrix) -> Matrix:
    """Return ``A' S A``."""
    return multiply([list(column) for column in zip(*A, strict=True)], multiply(S, A))


def integer_matrix(M: Sequence[Sequence[Fraction]]) -> tuple[flint.fmpz_mat, int]:
    """Return a rational matrix as integers over its common denominator, and that."""
    import flint

    scale = math.lcm(*{x.denominator for row in M for x in row})
    whole = [[x.numerator * (scale // x.denominator) for x in row] for row in M]
    return flint.fmpz_mat(len(M), len(M[0]) if M else 0, [x for row in whole for x in row]), scale


def integer_rows(M: flint.fmpz_mat) -> list[list[int]]:
    """Return the rows of an integer matrix."""
    return [[int(x) for x in row] for row in M.tolist()]


def without_last(S: Matrix) -> Matrix:
    """Delete the last row and column: the quadratic form modulo a kernel vector whose last entry is not zero."""
    return [row[:-1] for row in S[:-1]]
