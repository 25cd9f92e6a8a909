"""Lyapunov functions of large graphs, proved row by row: no matrix of all agents is searched or formed densely.

``V = E' P E`` with ``P = diag(w)`` on the rows of ``E`` that move. Each leader group has its own proof

    P_k L_k + L_k' P_k - g_k P_k > 0    on the range of L_k,

of a dense matrix, or above ``EXACT_NODES`` nodes by a sparse factor: ``P_k`` is the Perron vector, or the best diagonal
matrix of :func:`lmi.diagonal_lyapunov`. With ``(g_k - b) P_k`` in place of these blocks,
``S = P L + L' P - b P`` is positive definite if some ``d > 0`` has

    S_ii d_i > sum_j |S_ij| d_j    for every row i.

Followers: ``w = v / u`` and ``d = u`` with ``u = (M - t I)^-1 1``, ``v = (M - t I)^-T 1``, ``M`` the comparison matrix
of ``L_F`` (:mod:`lmi.sparse_h_matrix`). Groups: ``d`` so small that they hardly disturb the followers, ``w`` so large
that the followers hardly disturb them.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

import lmi
from lmi.definiteness_proofs import SparseDefinitenessProof, prove_generalized_margin, prove_sparse_positive_definite
from lmi.dyadic import round_array, round_to_bits
from lmi.errors import LMIError, NoCertificate
from lmi.sparse_h_matrix import FILL_ROWS, SparseHMatrix, fill_core
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import Dominance, GroupProof, LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.leaders_and_followers import prove_connectivity
from ptcc_certify.theorems.lemmas import diagonal_matrix, dyadic_left_vector, gauge, left_vector, symmetric_product

#: Relative deviations of ``t`` below the smallest eigenvalue: the larger, the smaller the overshoot constant.
LOSSES = (1e-5, 1e-2, 0.1, 0.5, 0.9, 0.99, 1.0)
#: What floats may have lost in a row of the inequality: a share of the rate, and of the terms that cancel (45 units of
#: rounding, enough for rows of hundreds of entries). No part of the proof: the check forms every row exactly and
#: refuses a rate that is too large; this is the room for it to succeed.
_SLACK, _ROUNDING = 1e-9, 1e-14
#: In-weights from here on leave no room for rates, which may be four times as large.
_LARGEST_WEIGHT = 2.0**1021
#: Largest condition of a diagonal matrix that is searched for a leader group.
_LARGEST_CONDITION = 1e6
#: Losses of its rate that are tried for a leader group that is proved by a sparse factor.
_GROUP_LOSSES = (1e-6, 1e-4, 1e-2, 0.1, 0.2, 0.3, 0.5, 0.8)


def dominant_functions(
    structure: Structure, losses: Sequence[float] = LOSSES, search: int = 0
) -> list[LyapunovFunction]:
    """Return Lyapunov functions from the fastest to the one of the smallest overshoot constant.

    Leader groups of more than ``EXACT_NODES`` nodes, up to ``search``, take the best diagonal matrix in place of the
    Perron vector. Their rates are proved. The inequality of all rows holds in floating point with some slack; the check
    of the certificate establishes it.

    Raises
    ------
    NoCertificate
        A leader group is too large, or no positive rate was found.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 2), (2, 3, -1)])
    >>> [round(float(m.rate), 3) for m in dominant_functions(analyse(g))]
    [2.0, 1.99, 1.9, 1.5, 1.1, 1.01, 1.0]
    """
    if not structure.graph.n_edges:
        return []
    problem = _Composite(structure, search)
    functions: list[LyapunovFunction] = []
    for loss in losses:
        with contextlib.suppress(LMIError):
            functions.append(problem.function(loss, "lmi" if search else "perron"))
    if not functions:
        raise NoCertificate("no diagonal matrix was found that dominates")
    return functions


class _Composite:
    """Leader groups and followers of one graph, in floats."""

    def __init__(self, structure: Structure, search: int):
        leaders = [c for c in structure.closed_components if len(c.nodes) > 1]
        self.groups = [list(c.nodes) for c in leaders]
        L = structure.graph.laplacian().tocsr()
        self.F = structure.followers
        self.K = np.array([v for group in self.groups for v in group], dtype=np.int64)
        self.place = np.array([k for k, group in enumerate(self.groups) for _ in group], dtype=np.int64)
        rows = L[self.F]
        self.coupling: Any = abs(rows[:, self.K]) if self.K.size else None  # |L_FK|
        self.followers = SparseHMatrix(rows[:, self.F]) if self.F.size else None
        self.smallest = self.followers.smallest() if self.followers is not None else np.inf
        self.nodes = (*self.K.tolist(), *self.F.tolist())
        proofs = []
        several = structure.graph.subgraph(self.K) if self.K.size else structure.graph
        first = 0
        for group, component in zip(self.groups, leaders, strict=True):
            own = several.subgraph(np.arange(first, first + len(group)))
            proofs.append(prove_group(own, component.balanced, search))
            first += len(group)
        self.proofs = tuple(proofs)
        self.p = np.concatenate([proof.weights for proof in proofs]) if proofs else np.zeros(0)
        self.g = np.array([float(proof.rate) for proof in proofs])
        if not min(2 * self.smallest, self.g.min(initial=np.inf)) > 0:
            raise NoCertificate("a block has no positive rate in floating point")

    def function(self, loss: float, kind: str) -> LyapunovFunction:
        """Return the composite whose followers are taken at ``(1 - loss)`` times their smallest eigenvalue."""
        p = self.p
        if self.followers is None:
            w, d = p, np.ones(self.K.size)
        else:
            t = min(self.smallest, self.g.min(initial=np.inf) / 2) * (1 - loss)
            u, v = self.followers.certificate(t).witness or ()
            w, d = v / u, u
            if self.K.size:
                b = min(2 * t, self.g.min() * (1 - loss))
                slack = (self.followers.M @ u) * w + self.followers.Mt @ v - b * v
                coupling_sums = self.coupling.sum(axis=1)
                with np.errstate(divide="ignore"):
                    budget = np.where(coupling_sums > 0, slack / (2 * w * np.maximum(coupling_sums, 1e-300)), np.inf)
                entries = self.coupling.tocoo()
                least = np.full(self.K.size, np.inf)
                np.minimum.at(least, entries.col, budget[entries.row])
                own = np.where(np.isfinite(least), least, 1.0)
                firsts = np.flatnonzero(np.diff(self.place, prepend=-1))
                own = np.minimum.reduceat(own, firsts)[self.place]
                push = self.coupling.T @ (w * u)
                scale = np.maximum.reduceat(2 * push / ((self.g[self.place] - b) * p * own), firsts)
                # Powers of two keep the weights of a group the multiples for which its rate is proved.
                scale = np.exp2(np.ceil(np.log2(np.where(scale > 0, scale, 1.0))))[self.place]
                w, d = np.concatenate([p * scale, w]), np.concatenate([own, d])
        w, d = w / np.exp2(np.ceil(np.log2(w.max()))), d / d.max()
        if not (np.isfinite(w).all() and np.isfinite(d).all() and w.min() > 1e-280 and d.min() > 1e-280):
            raise NoCertificate("the weights span more than float64 holds")
        w, d = round_array(w), round_array(d)
        largest = self._rate(w, d)
        if not largest > 0:
            raise NoCertificate("no positive rate is left")
        block = LyapunovBlock("P", self.nodes, dyadic=w)
        rate = round_to_bits(largest * (1 - _SLACK), 53)
        firsts = np.cumsum([0, *(proof.weights.size for proof in self.proofs)])
        scales = tuple(float(w[i] / proof.weights[0]) for i, proof in zip(firsts, self.proofs, strict=False))
        proof = Dominance(d, self.proofs, scales)
        return LyapunovFunction(kind, "E", (block,), rate=rate, numerical_rate=float(rate), dominance=proof)

    def _rate(self, w: np.ndarray, d: np.ndarray) -> float:
        """Return the largest ``b`` for which every row of the inequality holds."""
        k = self.K.size
        own = self.g[self.place] if k else np.zeros(0)
        if self.followers is None:
            return float(own.min(initial=np.inf))
        w_F, d_F = w[k:], d[k:]
        M, Mt = self.followers.M, self.followers.Mt
        bound = (M @ d_F) * w_F + Mt @ (w_F * d_F)
        # What floats may have lost where the terms of a row cancel.
        both = 4 * self.followers.diagonal * w_F * d_F
        bound = bound - _ROUNDING * (2 * both - bound)
        if self.coupling is not None:
            bound = bound - w_F * (self.coupling @ d[:k])
            own = own - (self.coupling.T @ (w_F * d_F)) / (w[:k] * d[:k])
        return float(min((bound / (w_F * d_F)).min(), own.min(initial=np.inf)))


def prove_group(graph: SignedDigraph, balanced: bool, search: int = 0) -> GroupProof:
    """Prove the decay of a strongly connected group: of the left null vector of ``M(L)``, rounded.

    A group of more than ``EXACT_NODES`` nodes, up to ``search``, takes the best diagonal matrix instead.

    Raises
    ------
    NoCertificate
        The rate was not proved; the message tells the numerical one.

    Examples
    --------
    >>> round(float(prove_group(SignedDigraph.from_edges([(1, 2, 1), (2, 1, -3)]), False).rate), 6)
    2.0
    """
    p = left_vector(graph)
    if graph.n_nodes > EXACT_NODES:
        if not (largest := float(graph.in_weight().max())) < _LARGEST_WEIGHT:
            raise NoCertificate(f"a leader group listens with the weight {largest:.3g}, too near to the largest float")
        if graph.n_nodes <= search:
            with contextlib.suppress(LMIError):
                return _prove_large_group(graph, balanced, p, *_best_diagonal(graph, p if balanced else None))
        return _prove_large_group(graph, balanced, p, p / p.max())
    weights = round_array(p / p.max())
    exact = tuple(Fraction(x) for x in weights.tolist())
    half = np.sqrt(weights)
    S = half[:, None] * graph.dense_laplacian() / half
    guess = float(np.linalg.eigvalsh(S + S.T)[int(balanced)])
    if balanced:
        rate = prove_connectivity(graph, exact, guess)
    else:
        form = symmetric_product(exact, graph.exact_laplacian())
        rate = prove_generalized_margin(form, diagonal_matrix(exact), guess)
    if rate is None or rate <= 0:
        raise NoCertificate(f"the rate of a leader group of {graph.n_nodes} nodes was not proved")
    return GroupProof(weights, rate)


def _best_diagonal(graph: SignedDigraph, p: np.ndarray | None) -> tuple[np.ndarray, float]:
    """Return the diagonal matrix of the best rate, and that; of a balanced group with left vector ``p`` on range(L)."""
    L, basis = graph.dense_laplacian(), None
    if p is not None:
        from scipy.linalg import null_space

        basis = null_space((gauge(graph) * p / np.linalg.norm(p))[None, :])  # type: ignore[operator]
    best = lmi.diagonal_lyapunov(L, objective="rate", basis=basis)
    if best.condition > _LARGEST_CONDITION:
        best = lmi.diagonal_lyapunov(
            L, objective="rate", basis=basis, max_condition=_LARGEST_CONDITION, start=best.log_omega
        )
    return np.exp(best.log_omega - best.log_omega.max()), best.rate


def _prove_large_group(
    graph: SignedDigraph, balanced: bool, p: np.ndarray, weights: np.ndarray, guess: float | None = None
) -> GroupProof:
    """Prove a rate just below the one in floats, by default the smallest generalized eigenvalue, by a sparse factor.

    ``p`` is the left vector.
    """
    from scipy import sparse

    weights = round_array(weights)
    shift = math.frexp(float(graph.in_weight().max()))[1]
    L = sparse.csr_array(graph.laplacian() * 2.0**-shift)
    P = sparse.diags_array(weights)
    half = P @ L
    form = sparse.csc_array(half + half.T)
    n, short = graph.n_nodes, fill_core(L) <= FILL_ROWS
    guess = _smallest_eigenvalue(form, weights, balanced, short) if guess is None else guess * 2.0**-shift
    unit = 2.0**shift
    if not short:
        message = f"the rate {guess * unit:.6g} of a leader group of {n} nodes is numerical"
        raise NoCertificate(f"{message}: its proof would be long")
    basis, parents = None, None
    if balanced and (whole := dyadic_left_vector(graph, p)) and len(set((weights / np.array(whole)).tolist())) == 1:
        parents = _spanning_tree(L)
        basis = _differences(parents, np.array(whole), gauge(graph))  # type: ignore[arg-type]
    elif balanced:
        basis = sparse.csc_array(L[:, 1:])
    for loss in _GROUP_LOSSES:
        g = float(round_to_bits(guess * (1 - loss), 24))
        S = sparse.csc_array(form - g * P)
        size = abs(half) + abs(half.T) + abs(g) * P
        if basis is not None:
            S, size = sparse.csc_array(basis.T @ S @ basis), sparse.csc_array(abs(basis).T @ size @ abs(basis))
        if (factor := _prove_rounded(S, size)) is not None:
            return GroupProof(weights, Fraction(g) * Fraction(2) ** shift, factor, shift, parents)
    raise NoCertificate(f"the rate {guess * unit:.6g} of a leader group of {n} nodes is numerical: it was not proved")


def _prove_rounded(S: Any, size: Any) -> SparseDefinitenessProof | None:
    """Prove every form positive definite that differs from ``S`` by what rounding of entries of ``size`` may change.

    That is taken off the diagonal, in the scaling in which rows are judged: without weights, or with those that a first
    proof found; a second one may change these by a factor of 2, and twice as much is taken off then.
    """
    from scipy import sparse

    root = np.sqrt(np.where((own := S.diagonal()) > 0, own, 1.0))
    off, judged = _ROUNDING * root * (size @ (1 / root)), np.ones(root.size)
    for _ in range(2):
        factor = prove_sparse_positive_definite(sparse.csc_array((S + S.T) / 2 - sparse.diags_array(off)))
        if factor is None or factor.weights is None:
            return factor
        weights = np.empty(root.size)
        weights[factor.order] = factor.weights
        change = weights / judged
        if judged.max() > 1 and change.max() <= 2 * change.min():
            return factor
        judged, off = weights, np.maximum(off, 2 * _ROUNDING * (root / weights) * (size @ (weights / root)))
    return None


def _spanning_tree(L: Any) -> np.ndarray:
    """Return the parent of every node in a breadth-first tree from the node with most neighbours, -1 at the root."""
    from scipy import sparse
    from scipy.sparse.csgraph import breadth_first_order

    near = sparse.csr_array(abs(L))
    root = int(np.argmax(np.diff(near.indptr)))
    _, parents = breadth_first_order(near, root, directed=False, return_predecessors=True)
    parents = parents.astype(np.int64)
    parents[root] = -1
    return parents


def _differences(parents: np.ndarray, w: np.ndarray, signs: np.ndarray) -> Any:
    """Return the columns ``w_q G_i e_i - w_i G_q e_q`` of every node ``i`` but the root, ``q`` its parent."""
    from scipy import sparse

    own = np.flatnonzero(parents >= 0)
    q, column = parents[own], np.arange(own.size)
    values = np.concatenate([w[q] * signs[own], -w[own] * signs[q]]).astype(float)
    where = np.concatenate([own, q]), np.concatenate([column, column])
    return sparse.csc_array((values, where), shape=(parents.size, own.size))


def _smallest_eigenvalue(form: Any, weights: np.ndarray, balanced: bool, factor: bool) -> float:
    """Return the smallest positive eigenvalue of ``(form, diag(weights))``, by a sparse factor or by products alone."""
    from scipy import sparse
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    half = sparse.diags_array(1 / np.sqrt(weights))
    operator = sparse.csc_array(half @ form @ half)
    top = float(abs(operator).max())
    options = {"k": 1 + balanced, "sigma": -1e-3 * top} if factor else {"k": 1, "which": "SA", "tol": 1e-6}
    if balanced and not factor:  # the spectrum of the comparison matrix, whose kernel is known, moved to the other end
        M = sparse.csc_array(2 * sparse.diags_array(operator.diagonal()) - abs(operator))
        kernel = np.sqrt(weights / weights.sum())
        operator = LinearOperator(M.shape, matvec=lambda x: M @ x + 4 * top * kernel * (kernel @ x))
    try:
        smallest = float(eigsh(operator, return_eigenvectors=False, **options).max())
    except (ArpackError, RuntimeError):
        smallest = 0.0
    if not smallest > 0:
        raise NoCertificate(f"no positive rate of a leader group of {weights.size} nodes was found")
    return smallest
