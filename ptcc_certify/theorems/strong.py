"""Theorem 1: strongly connected signed digraphs."""

from __future__ import annotations

import math

import numpy as np

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.base import (
    KEPT,
    Obligation,
    RateProof,
    Theorem,
    connectivity_rate,
    floats,
    left_vector_diagonal,
    prove_direct,
    prove_weighted_deviation,
    rounded,
)
from ptcc_certify.theorems.lemmas import unbalanced_diagonal


class BalancedStrong(Theorem):
    """Theorem 1.1: strongly connected, structurally balanced: bipartite consensus at T.

    ``V = eps' P eps`` with ``eps = X - (p'GX) G1``, ``P = diag(p)``, ``p' M(L) = 0``; rate ``2 a(L)``.
    """

    number = "1.1"
    statement = "Strongly connected, structurally balanced: bipartite consensus at T."

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Strongly connected and balanced."""
        return {
            "strongly connected": structure.connectivity == "strong",
            "structurally balanced": structure.balanced,
        }

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """``P`` is forced by the graph: nothing is searched."""
        if structure.graph.n_nodes == 1:
            return LyapunovFunction("paper", "eps", (), objective=KEPT)
        (whole,) = structure.closed_components
        block = LyapunovBlock("P", whole.nodes, left_vector_diagonal(structure.graph))
        return LyapunovFunction("paper", "eps", (block,), gauge=whole.gauge or (), objective="2 a(L)")

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """``2 a(L) P``."""
        if not V.blocks:
            return np.zeros((0, 0))
        return self.rate(structure, V) * np.diag(floats(V.weights))

    def rate(self, structure: Structure, V: LyapunovFunction) -> float:
        """``2 a(L)``, the second-smallest generalized eigenvalue of ``(PL + L'P, P)``; infinite for one node."""
        if not V.blocks:
            return math.inf
        return connectivity_rate(structure.graph, V.weights)

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """``Z L + L'Z > b Z`` modulo ``G1``, ``Z = G (P - pp'/p'1) G``."""
        if not V.blocks:
            return RateProof(None, ())
        b = prove_weighted_deviation(structure.graph, V.gauge, V.weights, self.rate(structure, V))
        if b is None:
            return RateProof(None, (), failed="2 a(L) is not proved positive")
        return RateProof(b, (Obligation("deviation-decrease", "paper", {"b": b}),))


class UnbalancedStrong(Theorem):
    """Theorem 1.2: strongly connected, structurally unbalanced: stability at T.

    ``V = E' Omega E`` with ``Omega L + L' Omega > 0``; rate ``lmin(Omega L + L' Omega) / lmax(Omega)``.
    """

    number = "1.2"
    statement = "Strongly connected, structurally unbalanced: stability at T."

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Strongly connected and unbalanced."""
        return {
            "strongly connected": structure.connectivity == "strong",
            "structurally unbalanced": not structure.balanced,
        }

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """``Omega`` of Lemma 3.2, the one with the largest rate that the solver resolves."""
        nodes, omega = tuple(range(structure.graph.n_nodes)), unbalanced_diagonal(structure.graph)
        block = LyapunovBlock("Omega", nodes, rounded(omega))
        return LyapunovFunction("paper", "E", (block,), objective="lmin(Omega L + L' Omega) / lmax(Omega)")

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """``Omega L + L' Omega > m I``."""
        return prove_direct(structure, V, "Omega L + L' Omega")
