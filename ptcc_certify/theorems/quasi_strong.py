"""Theorem 2: quasi-strongly connected signed digraphs: one closed component, and followers."""

from __future__ import annotations

import numpy as np

import lmi
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.base import (
    Obligation,
    RateProof,
    Theorem,
    block_of,
    connectivity_rate,
    diagonal_matrix,
    float_block,
    floats,
    follower_nodes,
    left_vector_diagonal,
    prove_connectivity,
    prove_coupled,
    prove_direct,
    rounded,
    split_rho,
)
from ptcc_certify.theorems.diagonal_composite import DiagonalComposite


class BalancedQuasiStrong(Theorem):
    """Theorem 2.1: quasi-strongly connected, leaders structurally balanced: interval bipartite consensus at T.

    K >= 2: ``V = E' Xi E``, ``Xi = diag(Xi_L, rho Xi_F)``, ``Xi_L = diag(nu)``, ``nu' M(L_L) = 0``; with
    ``Phi = [[2 a(L_L) Xi_L, rho L_FL' Xi_F], [rho Xi_F L_FL, rho (Xi_F L_F + L_F' Xi_F)]]`` the rate is
    ``lmin(Phi) / lmax(Xi)``. K = 1: ``V = E_F' Xi_F E_F``, rate ``lmin(Xi_F L_F + L_F' Xi_F) / lmax(Xi_F)``.
    """

    number = "2.1"
    statement = "Quasi-strongly connected, leaders structurally balanced: interval bipartite consensus at T."

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Quasi-strongly connected, the closed component balanced."""
        return {
            "quasi-strongly connected": structure.connectivity == "quasi-strong",
            "leaders structurally balanced": structure.closed_components[0].balanced,
        }

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """``Xi_F`` and ``rho`` from one semidefinite program; ``rho`` polished in its exact interval."""
        L, F = structure.graph.dense_laplacian(), structure.followers
        leaders = structure.closed_components[0]
        if len(leaders.nodes) == 1:
            found = lmi.h_matrix_lyapunov(float_block(L, F, F))
            block = LyapunovBlock("Xi_F", follower_nodes(structure), rounded(found.omega))
            return LyapunovFunction("paper", "E", (block,), objective="lmin(Xi_F L_F + L_F' Xi_F) / lmax(Xi_F)")
        nu = left_vector_diagonal(block_of(structure, leaders))
        decrease = connectivity_rate(block_of(structure, leaders), nu) * floats(nu)
        A_FL, A_F = float_block(L, F, leaders.nodes), float_block(L, F, F)
        joint = lmi.coupled_lyapunov([lmi.FixedLeader(floats(nu), decrease)], A_FL, A_F)
        xi = rounded(split_rho(joint.followers)[0])
        coupling = lmi.Coupling(np.diag(decrease), floats(nu), floats(xi), A_FL, A_F)
        return LyapunovFunction(
            "paper",
            "E",
            (LyapunovBlock("Xi_L", leaders.nodes, nu), LyapunovBlock("Xi_F", follower_nodes(structure), xi, True)),
            rounded(np.array([coupling.best_rho()]))[0],
            objective="lmin(Phi) / lmax(Xi)",
            interval=coupling.interval(),
        )

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """``Phi``, or ``Xi_F L_F + L_F' Xi_F`` for a single leader."""
        if V.rho is None:
            return super().decrease(structure, V)
        leaders, followers = V.blocks
        L, F, K = structure.graph.dense_laplacian(), followers.nodes, leaders.nodes
        gamma = connectivity_rate(structure.graph.subgraph(K), leaders.diagonal) * np.diag(floats(leaders.diagonal))
        nu, xi = floats(leaders.diagonal), floats(followers.diagonal)
        return lmi.Coupling(gamma, nu, xi, float_block(L, F, K), float_block(L, F, F)).phi(float(V.rho))

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """``2 a(L_L)`` on the range of ``L_L`` first, then ``Phi > m I``."""
        if V.rho is None:
            return prove_direct(structure, V, "Xi_F L_F + L_F' Xi_F")
        graph, nu = structure.graph.subgraph(V.blocks[0].nodes), V.blocks[0].diagonal
        b = prove_connectivity(graph, nu, connectivity_rate(graph, nu))
        if b is None:
            return RateProof(None, (), failed="2 a(L_L) is not proved positive")
        lemma = Obligation("leader-decrease", "paper.Xi_L", {"b": b})
        return prove_coupled(structure, V, diagonal_matrix(b * x for x in nu), (lemma,), "Phi")


class UnbalancedQuasiStrong(DiagonalComposite):
    """Theorem 2.2: quasi-strongly connected, leaders structurally unbalanced: stability at T.

    ``V = E' Xit E``, ``Xit = diag(Xit_L, rho Xi_F)``; rate ``lmin(Psi) / lmax(Xit)``, ``Psi = Xit L + L' Xit``.
    """

    number = "2.2"
    statement = "Quasi-strongly connected, leaders structurally unbalanced: stability at T."
    leader_letter, follower_letter, matrix_letter, product_letter = "Xit_L", "Xi_F", "Xit", "Psi"

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Quasi-strongly connected, the closed component unbalanced."""
        return {
            "quasi-strongly connected": structure.connectivity == "quasi-strong",
            "leaders structurally unbalanced": not structure.closed_components[0].balanced,
        }
