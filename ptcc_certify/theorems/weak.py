"""Theorem 3: weakly connected signed digraphs with several closed components.

The block-triangular argument needs no weak connectivity, so the same Lyapunov functions serve disconnected graphs.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import lmi
from lmi.definiteness_proofs import prove_margin
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.base import (
    KEPT,
    Matrix,
    Obligation,
    RateProof,
    Theorem,
    block_of,
    closed_blocks,
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
    smallest_eigenvalue,
    split_rho,
    symmetric_product,
    to_floats,
)
from ptcc_certify.theorems.diagonal_composite import DiagonalComposite


class BalancedWeak(Theorem):
    """Theorem 3.1: weakly connected, at least one closed component balanced: bipartite containment at T.

    ``V = Eb' H Eb`` over all rows but those of one-node closed components, ``H = diag(H_k .., rho H_F)`` with
    ``H_k = diag(eta_k)`` for balanced ones; with ``Gamma`` the block diagonal of ``2 a(L_Lk) lmin(H_k) I`` and
    ``lmin(H_k L_Lk + L_Lk' H_k) I``, ``Pi = [[Gamma, rho L_FLb' H_F], [rho H_F L_FLb, rho (H_F L_F + L_F' H_F)]]`` and
    the rate is ``lmin(Pi) / lmax(H)``. All closed components single: ``V = E_F' H_F E_F``.
    """

    number = "3.1"
    statement = "Weakly connected, some closed component balanced: bipartite containment at T."

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Several closed components (or several weak components), one of them balanced."""
        return {
            "more than one closed component": len(structure.closed_components) > 1,
            "at least one closed component balanced": any(c.balanced for c in structure.closed_components),
        }

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """Free blocks, ``H_F`` and ``rho`` from one semidefinite program; ``rho`` polished in its exact interval."""
        L, F = structure.graph.dense_laplacian(), structure.followers
        components = _several_nodes(structure)
        if not components:
            if F.size == 0:
                return LyapunovFunction("paper", "E", (), objective=KEPT)
            found = lmi.h_matrix_lyapunov(float_block(L, F, F))
            block = LyapunovBlock("H_F", follower_nodes(structure), rounded(found.omega))
            return LyapunovFunction("paper", "E", (block,), objective="lmin(H_F L_F + L_F' H_F) / lmax(H_F)")
        K = [v for _, c in components for v in c.nodes]
        fixed: dict[int, tuple[Fraction, ...]] = {}
        leaders: list[lmi.FixedLeader | lmi.FreeLeader] = []
        for k, component in components:
            graph = block_of(structure, component)
            if component.balanced:
                eta = fixed[k] = left_vector_diagonal(graph)
                decrease = connectivity_rate(graph, eta) * float(min(eta))
                leaders.append(lmi.FixedLeader(floats(eta), np.full(len(eta), decrease)))
            else:
                leaders.append(lmi.FreeLeader(graph.dense_laplacian()))
        joint = lmi.coupled_lyapunov(leaders, float_block(L, F, K), float_block(L, F, F))
        blocks = [
            LyapunovBlock(f"H_{k}", component.nodes, fixed.get(k) or rounded(diagonal))
            for (k, component), diagonal in zip(components, joint.leaders, strict=True)
        ]
        objective = "lmin(Pi) / lmax(H)"
        if F.size == 0:
            return LyapunovFunction("paper", "E", tuple(blocks), objective=objective)
        blocks.append(LyapunovBlock("H_F", follower_nodes(structure), rounded(split_rho(joint.followers)[0]), True))
        coupling = self._coupling(structure, tuple(blocks))
        rho = rounded(np.array([coupling.best_rho()]))[0]
        return LyapunovFunction("paper", "E", tuple(blocks), rho, objective=objective, interval=coupling.interval())

    def _coupling(self, structure: Structure, blocks: tuple[LyapunovBlock, ...]) -> lmi.Coupling:
        """Return the composite in floats; without followers its follower block is empty."""
        L = structure.graph.dense_laplacian()
        leaders = [block for block in blocks if not block.times_rho]
        decreases = np.concatenate(
            [np.full(len(b.nodes), _leader_decrease(structure, b, _balanced(structure, b))) for b in leaders]
        )
        K = [v for block in leaders for v in block.nodes]
        F = [v for block in blocks if block.times_rho for v in block.nodes]
        return lmi.Coupling(
            np.diag(decreases),
            floats(w for block in leaders for w in block.diagonal),
            floats(w for block in blocks if block.times_rho for w in block.diagonal),
            float_block(L, F, K),
            float_block(L, F, F),
        )

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """``Pi``, or ``H_F L_F + L_F' H_F`` when all closed components are single."""
        if not _several_nodes(structure):
            return super().decrease(structure, V)
        return self._coupling(structure, V.blocks).phi(float(V.rho or 1))

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """Prove the decrease of each leader block, then ``Pi > m I``."""
        if not V.blocks:
            return RateProof(None, ())
        if not _several_nodes(structure):
            return prove_direct(structure, V, "H_F L_F + L_F' H_F")
        obligations: list[Obligation] = []
        gamma: list[Fraction] = []
        for block in V.blocks:
            if block.times_rho:
                continue
            balanced = _balanced(structure, block)
            guess = _leader_decrease(structure, block, balanced)
            graph = structure.graph.subgraph(block.nodes)
            if balanced:
                b = prove_connectivity(graph, block.diagonal, guess / float(min(block.diagonal)))
                decrease = None if b is None else b * min(block.diagonal)
                kind, numbers = "leader-decrease", {"b": b}
            else:
                S = symmetric_product(block.diagonal, graph.exact_laplacian())
                decrease = prove_margin(S, smallest_eigenvalue(to_floats(S)))
                kind, numbers = "leader-margin", {"m": decrease}
            if decrease is None:
                return RateProof(
                    None, tuple(obligations), failed=f"the decrease of {block.name} is not proved positive"
                )
            proved = {name: value for name, value in numbers.items() if value is not None}
            obligations.append(Obligation(kind, f"paper.{block.name}", proved))
            gamma += [decrease] * len(block.nodes)
        Gamma: Matrix = diagonal_matrix(gamma)
        return prove_coupled(structure, V, Gamma, tuple(obligations), "Pi")


class UnbalancedWeak(DiagonalComposite):
    """Theorem 3.2: weakly connected, all closed components unbalanced: stability at T.

    ``V = E' Th E``, ``Th = diag(Th_L1 .. Th_Lm, rho Th_F)``; rate ``lmin(Th L + L' Th) / lmax(Th)``.
    """

    number = "3.2"
    statement = "Weakly connected, all closed components unbalanced: stability at T."
    leader_letter, follower_letter, matrix_letter = "Theta_L", "Theta_F", "Theta"
    product_letter = "Theta L + L' Theta"

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Several closed components (or several weak components), none balanced."""
        return {
            "more than one closed component": len(structure.closed_components) > 1,
            "all closed components unbalanced": not any(c.balanced for c in structure.closed_components),
        }


def _several_nodes(structure: Structure) -> list[tuple[int, ClosedComponent]]:
    return [(k, c) for k, c in closed_blocks(structure) if len(c.nodes) > 1]


def _balanced(structure: Structure, block: LyapunovBlock) -> bool:
    return next(c.balanced for c in structure.closed_components if c.nodes == block.nodes)


def _leader_decrease(structure: Structure, block: LyapunovBlock, balanced: bool) -> float:
    """Return ``2 a(L_Lk) lmin(H_k)`` or ``lmin(H_k L_Lk + L_Lk' H_k)``."""
    graph = structure.graph.subgraph(block.nodes)
    if balanced:
        return connectivity_rate(graph, block.diagonal) * float(min(block.diagonal))
    return lmi.diagonal_margin(graph.dense_laplacian(), floats(block.diagonal))
