"""The twelve theorems, and which of them a graph meets."""

from __future__ import annotations

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.theorems.base import Theorem
from ptcc_certify.theorems.quasi_strong import BalancedQuasiStrong, UnbalancedQuasiStrong
from ptcc_certify.theorems.sliding_mode import SlidingMode
from ptcc_certify.theorems.strong import BalancedStrong, UnbalancedStrong
from ptcc_certify.theorems.weak import BalancedWeak, UnbalancedWeak

_NOMINAL: tuple[Theorem, ...] = (
    BalancedStrong(),
    UnbalancedStrong(),
    BalancedQuasiStrong(),
    UnbalancedQuasiStrong(),
    BalancedWeak(),
    UnbalancedWeak(),
)
_SLIDING: tuple[Theorem, ...] = tuple(map(SlidingMode, _NOMINAL))
#: All twelve rows, 1.1 to 3.2 for the nominal and 4.1 to 6.2 for the sliding-mode protocol; see :class:`Theorem`.
THEOREMS: tuple[Theorem, ...] = (*_NOMINAL, *_SLIDING)


def theorem_for(structure: Structure, protocol: str = "nominal") -> Theorem:
    """Return the theorem whose hypotheses the graph meets; a disconnected graph takes the composite of Theorem 3 or 6.

    Parameters
    ----------
    structure : Structure
    protocol : {"nominal", "sliding-mode"}

    Returns
    -------
    Theorem
        One of :data:`THEOREMS`.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)]))
    >>> theorem_for(st).number, theorem_for(st, "sliding-mode").number
    ('1.1', '4.1')
    """
    rows = _SLIDING if protocol == "sliding-mode" else _NOMINAL
    return next(theorem for theorem in rows if theorem.applies(structure))
