"""Lyapunov functions of large graphs, proved row by row: no matrix of all agents is searched or formed densely.

``V = E' P E`` with ``P = diag(w)`` on the rows of ``E`` that move. Leader groups are small, and each has its own proof

    L_k'(P_k L_k + L_k' P_k - g_k P_k)L_k > 0    modulo the kernel of L_k.

With ``(g_k - b) P_k`` in place of these blocks, ``S = P L + L' P - b P`` is positive definite if some ``d > 0`` has

    S_ii d_i > sum_j |S_ij| d_j    for every row i.

Followers: ``w = v / u`` and ``d = u`` with ``u = (M - t I)^-1 1``, ``v = (M - t I)^-T 1``, ``M`` the comparison matrix
of ``L_F`` (:mod:`lmi.iterative`). Groups: ``d`` so small that they hardly disturb the followers, ``w`` so large that
the followers hardly disturb them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.errors import LMIError, NoCertificate
from lmi.exact import prove_generalized_margin, round_to_bits
from lmi.iterative import SparseHMatrix
from ptcc_certify.error_system import ErrorSystem
from ptcc_certify.graph import SignedDigraph
from ptcc_certify.lemmas import EXACT_NODES, left_vector
from ptcc_certify.rationals import format_exact
from ptcc_certify.structure import Structure
from ptcc_certify.theorems.base import diagonal_matrix, prove_connectivity, symmetric_product

#: Relative distances of ``t`` below the smallest eigenvalue: the larger, the smaller the prefactor.
LOSSES = (1e-5, 1e-2, 0.1, 0.5, 0.9, 0.99, 1.0)
#: Significant bits of weights and of the vector, and what floats may have lost in a row of the inequality.
_BITS, _SLACK = 40, 1e-9
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class DominantMember:
    """A diagonal Lyapunov matrix whose rate follows row by row.

    Attributes
    ----------
    nodes : tuple of int
        The rows of ``E`` that move, leader groups first.
    diagonal, vector : tuple of Fraction
        ``w`` and ``d``.
    rate : Fraction
    group_rates : tuple of Fraction
        ``g_k`` of every leader group that moves.
    """

    nodes: tuple[int, ...]
    diagonal: tuple[Fraction, ...]
    vector: tuple[Fraction, ...]
    rate: Fraction
    group_rates: tuple[Fraction, ...]

    @property
    def witness(self) -> dict[str, Any]:
        """What the check needs besides the diagonal, JSON-ready."""
        return {"vector": list(map(format_exact, self.vector)), "groups": list(map(format_exact, self.group_rates))}


def dominant_members(structure: Structure, losses: Sequence[float] = LOSSES) -> list[DominantMember]:
    """Return Lyapunov functions from the fastest to the one of the smallest prefactor.

    The rates of leader groups are proved. The inequality of all rows holds in floating point with some slack; the check
    of the certificate establishes it.

    Raises
    ------
    NoCertificate
        A leader group is large, or no positive rate was found.

    Examples
    --------
    >>> from ptcc_certify.structure import analyse
    >>> g = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 2), (2, 3, -1)])
    >>> [round(float(m.rate), 3) for m in dominant_members(analyse(g))]
    [2.0, 1.99, 1.9, 1.5, 1.1, 1.01, 1.0]
    """
    if not structure.graph.n_edges:
        return []
    problem = _Composite(structure)
    found: list[DominantMember] = []
    for loss in losses:
        try:
            found.append(problem.member(loss))
        except LMIError:
            continue
    if not found:
        raise NoCertificate("no diagonal matrix was found that dominates")
    return found


class _Composite:
    """Leader groups and followers of one graph, in floats."""

    def __init__(self, structure: Structure):
        system = ErrorSystem(structure)
        self.nodes, self.groups = system.nodes, [list(c.nodes) for c in system.leaders]
        largest = max(map(len, self.groups), default=0)
        if largest > EXACT_NODES:
            raise NoCertificate(f"a leader group has {largest} nodes; groups are treated up to {EXACT_NODES}")
        L = structure.graph.laplacian().tocsr()
        self.F = structure.followers
        self.K = np.array([v for group in self.groups for v in group], dtype=np.int64)
        self.place = np.array([k for k, group in enumerate(self.groups) for _ in group], dtype=np.int64)
        rows = L[self.F]
        self.pull: Any = abs(rows[:, self.K]) if self.K.size else None  # |L_FK|
        self.followers = SparseHMatrix(rows[:, self.F]) if self.F.size else None
        self.smallest = self.followers.smallest() if self.followers is not None else np.inf
        self.p: list[Fraction] = []
        self.group_rates: list[Fraction] = []
        several = structure.graph.subgraph(self.K) if self.K.size else structure.graph
        first = 0
        for group, component in zip(self.groups, system.leaders, strict=True):
            own = several.subgraph(np.arange(first, first + len(group)))
            p, g = _group(own, component.balanced)
            self.p += p
            self.group_rates.append(g)
            first += len(group)
        self.g = np.array([float(g) for g in self.group_rates])
        if not min(2 * self.smallest, self.g.min(initial=np.inf)) > 0:
            raise NoCertificate("a block has no positive rate in floating point")

    def member(self, loss: float) -> DominantMember:
        """Return the composite whose followers are taken at ``(1 - loss)`` times their smallest eigenvalue."""
        p = np.array([float(x) for x in self.p])
        if self.followers is None:
            w, d = p, np.ones(self.K.size)
        else:
            t = min(self.smallest, self.g.min(initial=np.inf) / 2) * (1 - loss)
            u, v = self.followers.certificate(t).witness or ()
            w, d = v / u, u
            if self.K.size:
                b = min(2 * t, self.g.min() * (1 - loss))
                slack = (self.followers.M @ u) * w + self.followers.Mt @ v - b * v
                heard = self.pull.sum(axis=1)
                with np.errstate(divide="ignore"):
                    budget = np.where(heard > 0, slack / (2 * w * np.maximum(heard, 1e-300)), np.inf)
                entries = self.pull.tocoo()
                least = np.full(self.K.size, np.inf)
                np.minimum.at(least, entries.col, budget[entries.row])
                own = np.where(np.isfinite(least), least, 1.0)
                firsts = np.flatnonzero(np.diff(self.place, prepend=-1))
                own = np.minimum.reduceat(own, firsts)[self.place]
                push = self.pull.T @ (w * u)
                scale = np.maximum.reduceat(2 * push / ((self.g[self.place] - b) * p * own), firsts)
                # Powers of two keep the weights of a group the multiples for which its rate is proved.
                scale = np.exp2(np.ceil(np.log2(np.where(scale > 0, scale, 1.0))))[self.place]
                w, d = np.concatenate([p * scale, w]), np.concatenate([own, d])
        w, d = w / np.exp2(np.ceil(np.log2(w.max()))), d / d.max()
        if not (np.isfinite(w).all() and np.isfinite(d).all() and w.min() > 1e-280 and d.min() > 1e-280):
            raise NoCertificate("the weights span more than float64 holds")
        diagonal = tuple(round_to_bits(float(x), _BITS) for x in w)
        vector = tuple(round_to_bits(float(x), _BITS) for x in d)
        g = tuple(self.group_rates)
        rate = self._rate(np.array([float(x) for x in diagonal]), np.array([float(x) for x in vector]), g)
        if not rate > 0:
            raise NoCertificate("no positive rate is left")
        return DominantMember(self.nodes, diagonal, vector, round_to_bits(rate * (1 - _SLACK), 53), g)

    def _rate(self, w: np.ndarray, d: np.ndarray, g: Sequence[Fraction]) -> float:
        """Return the largest ``b`` for which every row of the inequality holds."""
        k = self.K.size
        own = np.array([float(x) for x in g])[self.place] if k else np.zeros(0)
        if self.followers is None:
            return float(own.min(initial=np.inf))
        w_F, d_F = w[k:], d[k:]
        M, Mt = self.followers.M, self.followers.Mt
        bound = (M @ d_F) * w_F + Mt @ (w_F * d_F)
        # What floats may have lost where the terms of a row cancel.
        both = 4 * self.followers.diagonal * w_F * d_F
        bound = bound - _ROUNDING * (2 * both - bound)
        if self.pull is not None:
            bound = bound - w_F * (self.pull @ d[:k])
            own = own - (self.pull.T @ (w_F * d_F)) / (w[:k] * d[:k])
        return float(min((bound / (w_F * d_F)).min(), own.min(initial=np.inf)))


def _group(graph: SignedDigraph, balanced: bool) -> tuple[list[Fraction], Fraction]:
    """Return the left null vector of ``M(L)``, rounded, and the proved decay of its Lyapunov function."""
    p = left_vector(graph)
    weights = tuple(round_to_bits(float(x), _BITS) for x in p / p.max())
    half = np.sqrt([float(x) for x in weights])
    S = half[:, None] * graph.laplacian().toarray() / half
    guess = float(np.linalg.eigvalsh(S + S.T)[int(balanced)])
    if balanced:
        proved = prove_connectivity(graph, weights, guess)
    else:
        form = symmetric_product(weights, graph.exact_laplacian())
        proved = prove_generalized_margin(form, diagonal_matrix(weights), guess)
    if proved is None or proved <= 0:
        raise NoCertificate(f"the rate of a leader group of {graph.n_nodes} nodes was not proved")
    return list(weights), proved
