"""The Lyapunov function of all theorems but 1.1: leader groups side by side, and the followers times ``rho``.

``V = E' H E`` with ``H = diag(H_1 .., rho H_F)`` over closed components and followers; with ``Gamma`` what the leaders
decrease by,

    Phi(rho) = [[Gamma, rho L_FL' H_F], [rho H_F L_FL, rho (H_F L_F + L_F' H_F)]],    rate  lmin(Phi) / lmax(H).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

import numpy as np
from scipy.linalg import block_diag

import lmi
from lmi.definiteness_proofs import prove_generalized_margin, prove_margin, prove_positive_definite
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.theorems.lemmas import (
    EXACT_NODES,
    Matrix,
    algebraic_connectivity,
    congruence,
    diagonal_matrix,
    exact_block,
    exact_left_vector,
    float_block,
    floats,
    left_vector,
    rounded,
    symmetric_product,
    unbalanced_diagonal,
    without_last,
)
from ptcc_certify.theorems.theorem import CONSTANT, ExactInterval, Obligation, RateProof, Theorem

#: A left null vector is kept exact when its entries are shorter than this, otherwise rounded to 53 bits.
EXACT_VECTOR_BITS = 64


class Composite(Theorem):
    """No closed component is balanced: ``Gamma`` is ``H_k L_k + L_k' H_k``, so that ``Phi = H L + L' H``.

    Subclasses give the paper's letters of the blocks (``leader`` with ``{k}`` for the number of the component), of the
    whole matrix ``H`` and of its decrease ``Phi``.
    """

    leader: str
    follower: str
    matrix: str
    product: str
    #: What has to be positive of a leader group, where that is proved by itself.
    positive: str

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """All blocks and ``rho`` from one semidefinite program; ``rho`` polished in its exact interval."""
        omega = _unbalanced_diagonal(structure)
        leaders = [
            (k, component, rounded(omega[list(component.nodes)]))
            for k, component in enumerate(structure.closed_components, start=1)
        ]
        return self._with_followers(structure, leaders, omega[structure.followers])

    def _with_followers(
        self,
        structure: Structure,
        leaders: Iterable[tuple[int, ClosedComponent, tuple[Fraction, ...]]],
        followers: np.ndarray,
    ) -> LyapunovFunction:
        """Put leader groups and ``rho H_F`` together, that scaled to largest entry 1 and the best ``rho``."""
        blocks = tuple(LyapunovBlock(self.leader.format(k=k), c.nodes, diagonal) for k, c, diagonal in leaders)
        objective = f"lmin({self.product}) / lmax({self.matrix})"
        if followers.size == 0:
            return LyapunovFunction("paper", "E", blocks, objective=objective)
        blocks += (self._follower_block(structure, followers / float(followers.max()), True),)
        coupling = self._coupling(structure, blocks)
        (rho,) = rounded([coupling.best_rho()])
        return LyapunovFunction("paper", "E", blocks, rho, objective=objective, interval=coupling.interval())

    def _follower_block(self, structure: Structure, diagonal: np.ndarray, times_rho: bool) -> LyapunovBlock:
        return LyapunovBlock(self.follower, tuple(structure.followers.tolist()), rounded(diagonal), times_rho)

    def _coupling(self, structure: Structure, blocks: Sequence[LyapunovBlock]) -> lmi.Coupling:
        """Return the composite in floats; without followers its follower block is empty."""
        leaders, L = [block for block in blocks if not block.times_rho], structure.graph.dense_laplacian()
        K = [v for block in leaders for v in block.nodes]
        F = [v for block in blocks if block.times_rho for v in block.nodes]
        return lmi.Coupling(
            block_diag(*(self._leader_decrease(structure, block) for block in leaders)),
            floats(w for block in leaders for w in block.diagonal),
            floats(w for block in blocks if block.times_rho for w in block.diagonal),
            float_block(L, F, K),
            float_block(L, F, F),
        )

    def _leader_decrease(self, structure: Structure, block: LyapunovBlock) -> np.ndarray:
        """Return the part of ``Gamma`` that belongs to one block, in floats."""
        return _product(structure, block.nodes, block.diagonal)

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """Return ``Phi`` at the ``rho`` of ``V``."""
        return _product(structure, V.nodes, V.weights)

    def rate(self, structure: Structure, V: LyapunovFunction) -> float:
        """``lmin(Phi) / lmax(H)``."""
        if not V.blocks:
            return math.inf
        return float(np.linalg.eigvalsh(self.decrease(structure, V))[0]) / float(max(V.weights))

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """Prove what the leaders decrease by, then ``Phi > m I``, hence the rate ``m / lmax(H)``, and the interval."""
        if not V.blocks:
            return RateProof(None, ())
        gamma: list[Matrix] = []
        lemmas: list[Obligation] = []
        for block in V.blocks:
            if not block.times_rho:
                decrease = self._prove_leader_decrease(structure, block)
                if decrease is None:
                    failed = f"{self.positive.format(block=block.name)} is not proved positive"
                    return RateProof(None, tuple(lemmas), failed=failed)
                gamma.append(decrease[0])
                lemmas += decrease[1]
        phi = _exact_phi(structure, V, gamma)
        m = _prove_margin(phi(V.rho or Fraction(1)))
        if m is None:
            product = V.objective.removeprefix("lmin(").partition(") / lmax(")[0]
            return RateProof(None, tuple(lemmas), failed=f"{product} is not proved positive definite")
        margin = Obligation("margin", "paper", {"m": m} | ({} if V.rho is None else {"rho": V.rho}))
        interval, ends = _prove_interval(V, phi)
        return RateProof(m / max(V.weights), (*lemmas, margin, *ends), interval)

    def _prove_leader_decrease(
        self, structure: Structure, block: LyapunovBlock
    ) -> tuple[Matrix, tuple[Obligation, ...]] | None:
        """Return the part of ``Gamma`` that belongs to one block, in rationals, and what was proved for it."""
        L = structure.graph.exact_laplacian()
        return symmetric_product(block.diagonal, exact_block(L, block.nodes, block.nodes)), ()


class BalancedComposite(Composite):
    """Some closed component is balanced: its ``H_k = diag(eta_k)`` is forced, and decreases on the range of ``L_k``.

    Closed components of one balanced node are left out. If all are such, ``V = E_F' H_F E_F``, with rate
    ``lmin(H_F L_F + L_F' H_F) / lmax(H_F)``. The ``Gamma`` of an unbalanced group is ``lmin(H_k L_k + L_k' H_k) I``.
    """

    #: Whether the ``Gamma`` of a balanced group is ``2 a(L_k) lmin(H_k) I``, or ``2 a(L_k) H_k``.
    uniform: bool

    def _share(self, diagonal: Sequence[Fraction]) -> Sequence[Fraction]:
        """Return the diagonal that ``2 a(L_k)`` multiplies in ``Gamma``."""
        return [min(diagonal)] * len(diagonal) if self.uniform else diagonal

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """Free blocks, ``H_F`` and ``rho`` from one semidefinite program; ``rho`` polished in its exact interval."""
        L, F = structure.graph.dense_laplacian(), structure.followers
        components = [(k, c) for k, c in enumerate(structure.closed_components, start=1) if len(c.nodes) > 1]
        if not components and F.size == 0:
            return LyapunovFunction("paper", "E", (), objective=CONSTANT)
        if not components:
            solution = lmi.h_matrix_lyapunov(float_block(L, F, F))
            block = self._follower_block(structure, solution.omega, False)
            objective = f"lmin({self.follower} L_F + L_F' {self.follower}) / lmax({self.follower})"
            return LyapunovFunction("paper", "E", (block,), objective=objective)
        fixed: dict[int, tuple[Fraction, ...]] = {}
        groups: list[lmi.FixedLeader | lmi.FreeLeader] = []
        for k, component in components:
            graph = structure.graph.subgraph(component.nodes)
            if component.balanced:
                eta = fixed[k] = left_vector_diagonal(graph)
                groups.append(lmi.FixedLeader(floats(eta), connectivity_rate(graph, eta) * floats(self._share(eta))))
            else:
                groups.append(lmi.FreeLeader(graph.dense_laplacian()))
        K = [v for _, c in components for v in c.nodes]
        joint = lmi.coupled_lyapunov(groups, float_block(L, F, K), float_block(L, F, F))
        leaders = [
            (k, component, fixed.get(k) or rounded(diagonal))
            for (k, component), diagonal in zip(components, joint.leaders, strict=True)
        ]
        return self._with_followers(structure, leaders, joint.followers)

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """Return ``Phi`` at the ``rho`` of ``V``, or ``H_F L_F + L_F' H_F`` when all closed components are single."""
        return self._coupling(structure, V.blocks).phi(float(V.rho or 1))

    def _leader_decrease(self, structure: Structure, block: LyapunovBlock) -> np.ndarray:
        if block.name == self.follower:
            return super()._leader_decrease(structure, block)
        graph = structure.graph.subgraph(block.nodes)
        if _is_balanced(structure, block):
            return np.diag(connectivity_rate(graph, block.diagonal) * floats(self._share(block.diagonal)))
        return lmi.diagonal_margin(graph.dense_laplacian(), floats(block.diagonal)) * np.eye(graph.n_nodes)

    def _prove_leader_decrease(
        self, structure: Structure, block: LyapunovBlock
    ) -> tuple[Matrix, tuple[Obligation, ...]] | None:
        if block.name == self.follower:
            return super()._prove_leader_decrease(structure, block)
        graph = structure.graph.subgraph(block.nodes)
        share: Sequence[Fraction] = [Fraction(1)] * len(block.nodes)
        if _is_balanced(structure, block):
            kind, number = "leader-decrease", "b"
            share = self._share(block.diagonal)
            bound = prove_connectivity(graph, block.diagonal, connectivity_rate(graph, block.diagonal))
        else:
            kind, number = "leader-margin", "m"
            bound = _prove_margin(symmetric_product(block.diagonal, graph.exact_laplacian()))
        if bound is None:
            return None
        obligation = Obligation(kind, f"paper.{block.name}", {number: bound})
        return diagonal_matrix(bound * x for x in share), (obligation,)


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


def prove_connectivity(graph: SignedDigraph, p: tuple[Fraction, ...], guess: float) -> Fraction | None:
    """Prove ``xi'(PL + L'P)xi >= b xi'P xi`` for all ``xi`` in the range of ``L``, with ``P = diag(p)``; return ``b``.

    ``L G1 = 0``, so ``L'(PL + L'P - bP)L`` is tested after one row and column are deleted. That is a proof for any
    ``p > 0``, exact left null vector or rounded.
    """
    L = graph.exact_laplacian()
    S = without_last(congruence(L, symmetric_product(p, L)))
    Z = without_last(congruence(L, diagonal_matrix(p)))
    return prove_generalized_margin(S, Z, guess)


def _unbalanced_diagonal(structure: Structure) -> np.ndarray:
    """Find all blocks together, or each by itself where the best joint rate lies below what the solver resolves."""
    if structure.connectivity == "strong":
        return unbalanced_diagonal(structure.graph)
    L, F = structure.graph.dense_laplacian(), structure.followers
    try:
        return lmi.diagonal_lyapunov(L).omega
    except lmi.NoCertificate:
        omega = np.ones(len(L))
    for component in structure.closed_components:
        omega[list(component.nodes)] = unbalanced_diagonal(structure.graph.subgraph(component.nodes))
    if F.size:
        omega[F] = lmi.h_matrix_lyapunov(float_block(L, F, F)).omega
    return omega


def _product(structure: Structure, nodes: Sequence[int], weights: Iterable[Fraction]) -> np.ndarray:
    """Return ``Omega A + A' Omega`` in floats, ``A`` the rows and columns ``nodes`` of ``L``."""
    S = floats(weights)[:, None] * float_block(structure.graph.dense_laplacian(), nodes, nodes)
    return S + S.T


def _is_balanced(structure: Structure, block: LyapunovBlock) -> bool:
    return next(c.balanced for c in structure.closed_components if c.nodes == block.nodes)


def _prove_margin(S: Matrix) -> Fraction | None:
    """Prove ``S > m I``; return ``m``."""
    return prove_margin(S, float(np.linalg.eigvalsh(np.array([floats(row) for row in S]))[0]))


def _exact_phi(structure: Structure, V: LyapunovFunction, gamma: Sequence[Matrix]) -> Callable[[Fraction], Matrix]:
    """Return ``rho -> Phi(rho)`` in rationals; ``gamma`` covers the blocks that ``rho`` does not multiply."""
    A = exact_block(structure.graph.exact_laplacian(), V.nodes, V.nodes)
    leaders = sum(map(len, gamma))
    followers = [w for block in V.blocks if block.times_rho for w in block.diagonal]

    def phi(rho: Fraction) -> Matrix:
        S, first = symmetric_product([*[Fraction(0)] * leaders, *(rho * w for w in followers)], A), 0
        for part in gamma:
            for i, row in enumerate(part, start=first):
                S[i][first : first + len(part)] = row
            first += len(part)
        return S

    return phi


def _prove_interval(
    V: LyapunovFunction, phi: Callable[[Fraction], Matrix]
) -> tuple[ExactInterval | None, tuple[Obligation, ...]]:
    """Prove the ends of the interval of ``rho``: ``Phi(end) > 0`` implies ``Phi(rho) > 0`` for ``0 < rho < end``."""
    if V.interval is None:
        return None, ()

    def prove(end: float) -> Fraction | None:
        if not math.isfinite(end):
            return None
        lowered = (Fraction(end * (1 - loss)) for loss in (1e-9, 1e-7, 1e-4, 0.01))
        # The fallback is rho itself, whose admissibility is proved with the rate.
        return next((value for value in lowered if prove_positive_definite(phi(value))), V.rho)

    printed, exact = prove(V.interval.printed), prove(V.interval.exact)
    if exact is not None and V.rho is not None:
        exact = max(exact, V.rho)  # which may lie next to the end, beyond what it is lowered to
    if printed is not None and exact is not None:
        printed = min(printed, exact)  # they may coincide, and differ by rounding
    numbers = {name: end for name, end in (("printed", printed), ("exact", exact)) if end is not None}
    return ExactInterval(printed, exact), (Obligation("rho-interval", "paper", numbers),) if numbers else ()
