"""Theorem 1: strongly connected signed digraphs."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from lmi.definiteness_proofs import prove_generalized_margin
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.leaders_and_followers import Composite, connectivity_rate, left_vector_diagonal
from ptcc_certify.theorems.lemmas import floats, multiply, without_last
from ptcc_certify.theorems.theorem import CONSTANT, Obligation, RateProof, Theorem


class BalancedStrong(Theorem):
    """Theorem 1.1: strongly connected, structurally balanced: bipartite consensus at T.

    ``V = eps' P eps`` with ``eps = X - (p'GX) G1``, ``P = diag(p)``, ``p' M(L) = 0``; rate ``2 a(L)``.
    """

    number = "1.1"
    statement = "Strongly connected, structurally balanced: bipartite consensus at T."
    conditions = (
        ("strongly connected", lambda s: s.connectivity == "strong"),
        ("structurally balanced", lambda s: s.balanced),
    )

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """``P`` is forced by the graph: nothing is searched."""
        if structure.graph.n_nodes == 1:
            return LyapunovFunction("paper", "eps", (), objective=CONSTANT)
        (whole,) = structure.closed_components
        block = LyapunovBlock("P", whole.nodes, left_vector_diagonal(structure.graph))
        return LyapunovFunction("paper", "eps", (block,), gauge=whole.gauge or (), objective="2 a(L)")

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """``2 a(L) P``."""
        return self.rate(structure, V) * np.diag(floats(V.weights))

    def rate(self, structure: Structure, V: LyapunovFunction) -> float:
        """``2 a(L)``, the second-smallest generalized eigenvalue of ``(PL + L'P, P)``; infinite for one node."""
        return connectivity_rate(structure.graph, V.weights) if V.blocks else math.inf

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """``Z L + L'Z > b Z`` modulo ``G1``, ``Z = G (P - pp'/p'1) G``."""
        if not V.blocks:
            return RateProof(None, ())
        b = _prove_weighted_deviation(structure.graph, V, self.rate(structure, V))
        if b is None or b <= 0:
            return RateProof(None, (), failed="2 a(L) is not proved positive")
        return RateProof(b, (Obligation("deviation-decrease", "paper", {"b": b}),))


class UnbalancedStrong(Composite):
    """Theorem 1.2: strongly connected, structurally unbalanced: stability at T.

    ``V = E' Omega E`` with ``Omega L + L' Omega > 0``; rate ``lmin(Omega L + L' Omega) / lmax(Omega)``.
    """

    number = "1.2"
    statement = "Strongly connected, structurally unbalanced: stability at T."
    conditions = (
        ("strongly connected", lambda s: s.connectivity == "strong"),
        ("structurally unbalanced", lambda s: not s.balanced),
    )
    leader = matrix = "Omega"
    product = "Omega L + L' Omega"


def _prove_weighted_deviation(graph: SignedDigraph, V: LyapunovFunction, guess: float) -> Fraction | None:
    """Prove ``Z L + L'Z >= b Z`` for ``Z = G (P - p p'/p'1) G``, whose form is ``eps'P eps``; return ``b``.

    ``Z G1 = 0`` and ``(Z L + L'Z) G1 = 0`` exactly for any ``p > 0``; one row and column are deleted.
    """
    gauge, p = V.gauge, V.weights
    n = len(V.weights)
    total = sum(p)
    Z = [[gauge[i] * gauge[j] * (p[i] * (i == j) - p[i] * p[j] / total) for j in range(n)] for i in range(n)]
    ZL = multiply(Z, graph.exact_laplacian())
    S = [[ZL[i][j] + ZL[j][i] for j in range(n)] for i in range(n)]
    return prove_generalized_margin(without_last(S), without_last(Z), guess)
