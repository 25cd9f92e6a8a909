"""Theorems 1 to 3: one file for each family, each reading like the theorem."""

from __future__ import annotations

from ptcc_certify.structure import Structure
from ptcc_certify.theorems.base import LyapunovBlock, LyapunovFunction, Obligation, RateProof, Theorem
from ptcc_certify.theorems.quasi_strong import BalancedQuasiStrong, UnbalancedQuasiStrong
from ptcc_certify.theorems.strong import BalancedStrong, UnbalancedStrong
from ptcc_certify.theorems.weak import BalancedWeak, UnbalancedWeak

THEOREMS: tuple[Theorem, ...] = (
    BalancedStrong(),
    UnbalancedStrong(),
    BalancedQuasiStrong(),
    UnbalancedQuasiStrong(),
    BalancedWeak(),
    UnbalancedWeak(),
)

__all__ = ["THEOREMS", "LyapunovBlock", "LyapunovFunction", "Obligation", "RateProof", "Theorem", "theorem_for"]


def theorem_for(structure: Structure) -> Theorem:
    """Return the theorem whose hypotheses the graph meets; a disconnected graph takes the composite of Theorem 3.

    Examples
    --------
    >>> from ptcc_certify.graph import SignedDigraph
    >>> from ptcc_certify.structure import analyse
    >>> theorem_for(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)]))).number
    '1.1'
    """
    return next(theorem for theorem in THEOREMS if theorem.applies(structure))
