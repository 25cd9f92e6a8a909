"""What Theorems 2.2 and 3.2 share: no closed component is balanced, one diagonal matrix covers all agents."""

from __future__ import annotations

import numpy as np

import lmi
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.base import (
    RateProof,
    Theorem,
    closed_blocks,
    exact_block,
    exact_phi,
    float_block,
    floats,
    follower_nodes,
    prove_direct,
    prove_interval,
    rounded,
    split_rho,
    symmetric_product,
)
from ptcc_certify.theorems.lemmas import unbalanced_diagonal


class DiagonalComposite(Theorem):
    """``V = E' Th E`` with ``Th = diag(leader blocks, rho Th_F)`` and rate ``lmin(Th L + L' Th) / lmax(Th)``."""

    leader_letter: str
    follower_letter: str
    matrix_letter: str
    product_letter: str

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """All blocks and ``rho`` from one semidefinite program; ``rho`` polished in its exact interval."""
        L, F = structure.graph.dense_laplacian(), structure.followers
        try:
            omega = lmi.diagonal_lyapunov(L).omega
        except lmi.NoCertificate:
            omega = self._block_by_block(structure, L)
        leaders = tuple(
            LyapunovBlock(self.leader_letter + suffix, component.nodes, rounded(omega[list(component.nodes)]))
            for suffix, component in self._suffixes(structure)
        )
        objective = f"lmin({self.product_letter}) / lmax({self.matrix_letter})"
        if F.size == 0:
            return LyapunovFunction("paper", "E", leaders, objective=objective)
        followers = LyapunovBlock(
            self.follower_letter, follower_nodes(structure), rounded(split_rho(omega[F])[0]), True
        )
        coupling = self._coupling(L, (*leaders, followers))
        rho = rounded(np.array([coupling.best_rho()]))[0]
        blocks, interval = (*leaders, followers), coupling.interval()
        return LyapunovFunction("paper", "E", blocks, rho, objective=objective, interval=interval)

    def _block_by_block(self, structure: Structure, L: np.ndarray) -> np.ndarray:
        """Find each block by itself, for when the best joint rate lies below what the solver resolves."""
        omega, F = np.ones(len(L)), structure.followers
        for component in structure.closed_components:
            omega[list(component.nodes)] = unbalanced_diagonal(structure.graph.subgraph(component.nodes))
        if F.size:
            omega[F] = lmi.h_matrix_lyapunov(float_block(L, F, F)).omega
        return omega

    def _suffixes(self, structure: Structure) -> list[tuple[str, ClosedComponent]]:
        if len(structure.closed_components) == 1:
            return [("", structure.closed_components[0])]
        return [(str(k), component) for k, component in closed_blocks(structure)]

    def _coupling(self, L: np.ndarray, blocks: tuple[LyapunovBlock, ...]) -> lmi.Coupling:
        F, K = blocks[-1].nodes, [v for block in blocks[:-1] for v in block.nodes]
        omega_L = floats(w for block in blocks[:-1] for w in block.diagonal)
        S = omega_L[:, None] * float_block(L, K, K)
        omega_F = floats(blocks[-1].diagonal)
        return lmi.Coupling(S + S.T, omega_L, omega_F, float_block(L, F, K), float_block(L, F, F))

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """``Th L + L' Th > m I`` and the ends of the interval of ``rho``."""
        direct = prove_direct(structure, V, self.product_letter)
        if direct.rate is None or V.rho is None:
            return direct
        K = [v for block in V.blocks[:-1] for v in block.nodes]
        weights = [w for block in V.blocks[:-1] for w in block.diagonal]
        gamma = symmetric_product(weights, exact_block(structure.graph.exact_laplacian(), K, K))
        interval, found = prove_interval(V, exact_phi(structure, V, gamma))
        return RateProof(direct.rate, (*direct.obligations, *found), interval)
