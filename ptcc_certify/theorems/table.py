"""The twelve theorems, and which of them a graph meets.

Theorems 4 to 6 are the rows of Theorems 1 to 3 under the sliding-mode protocol and bounded disturbances. From ``T_r``
on every sliding variable is 0 (Proposition 1) and the agents move as under the nominal protocol with the deadline
``T_r + T_s``, from ``X(0) - sigma(0)`` so to speak. Hypotheses (``mu1 > delta`` is checked by the protocol), Lyapunov
functions and rates are those of the nominal rows; Theorem 4.1 is Theorem 1.1, and so on, Corollaries 6 to 10 are
Corollaries 1 to 5.
"""

from __future__ import annotations

from copy import copy
from typing import Any

from ptcc_certify.errors import ParameterError, did_you_mean
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import Protocol
from ptcc_certify.theorems.claims import sliding_number
from ptcc_certify.theorems.strong import BalancedStrong, UnbalancedStrong
from ptcc_certify.theorems.theorem import Theorem
from ptcc_certify.theorems.weak import BalancedQuasiStrong, BalancedWeak, UnbalancedQuasiStrong, UnbalancedWeak


def _sliding_mode(nominal: Theorem) -> Theorem:
    """Return the counterpart of a nominal row."""
    row = copy(nominal)
    row.number = sliding_number(nominal.number)
    row.statement = nominal.statement.replace(" at T", " at T_r + T_s, under bounded disturbances")
    return row


_NOMINAL: tuple[Theorem, ...] = (
    BalancedStrong(),
    UnbalancedStrong(),
    BalancedQuasiStrong(),
    UnbalancedQuasiStrong(),
    BalancedWeak(),
    UnbalancedWeak(),
)
_SLIDING: tuple[Theorem, ...] = tuple(map(_sliding_mode, _NOMINAL))
#: All twelve rows, 1.1 to 3.2 for the nominal and 4.1 to 6.2 for the sliding-mode protocol; see :class:`Theorem`.
THEOREMS: tuple[Theorem, ...] = (*_NOMINAL, *_SLIDING)


def theorem_for(graph: Any, protocol: str | Protocol = "nominal") -> Theorem:
    """Return the theorem whose hypotheses the graph meets; a disconnected graph takes the composite of Theorem 3 or 6.

    Parameters
    ----------
    graph : graph-like or Structure
        Whatever :func:`ptcc_certify.as_graph` takes.
    protocol : {"nominal", "sliding-mode"} or Protocol

    Returns
    -------
    Theorem
        One of :data:`THEOREMS`.

    Raises
    ------
    ParameterError
        No protocol is called so.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)]))
    >>> theorem_for(st).number, theorem_for(st, "sliding-mode").number
    ('1.1', '4.1')
    """
    structure, kind = analyse(graph), getattr(protocol, "kind", protocol)
    if kind not in ("nominal", "sliding-mode"):
        raise ParameterError(f"protocol {shorten(repr(kind))} is unknown; one of nominal, sliding-mode")
    rows = _SLIDING if kind == "sliding-mode" else _NOMINAL
    return next(theorem for theorem in rows if theorem.applies(structure))


def cite(*theorems: str) -> str:
    """Return BibTeX of the source.

    Parameters
    ----------
    *theorems : str
        Such as ``"2.1"``; their statements stand in the note.

    Returns
    -------
    str

    Raises
    ------
    ParameterError
        No theorem is called so.

    Examples
    --------
    >>> print(cite("1.1").splitlines()[-2])
      note   = {Manuscript; Theorem 1.1: Strongly connected, structurally balanced: bipartite consensus at T.}
    """
    note, statements = "Manuscript", {row.number: row.statement for row in THEOREMS}
    for theorem in map(str, theorems):
        if theorem not in statements:
            hint = did_you_mean(theorem, statements)
            raise ParameterError(f'no theorem "{shorten(theorem)}"; one of {", ".join(statements)}{hint}')
        note += f"; Theorem {theorem}: {statements[theorem]}"
    return (
        "@unpublished{zhu_prescribed_time_coordination,\n"
        "  author = {Zhu, Zhen-Hua and Wu, Huaiyu and Guan, Zhi-Hong and Liu, Zhi-Wei and Chen, Yang and "
        "Zheng, Xiujuan},\n"
        "  title  = {Robust prescribed-time coordination control of cooperative-antagonistic networks with "
        "disturbances},\n"
        f"  note   = {{{note}}}\n"
        "}"
    )


def cite_software() -> str:
    """Return BibTeX of this program, as CITATION.cff has it.

    Examples
    --------
    >>> print(cite_software().splitlines()[0])
    @software{ptcc_certify,
    """
    from ptcc_certify import __version__

    return (
        "@software{ptcc_certify,\n"
        "  author  = {{ptcc-certify contributors}},\n"
        "  title   = {ptcc-certify: certify prescribed-time coordination control on signed digraphs},\n"
        f"  version = {{{__version__}}},\n"
        "  note    = {MIT license}\n"
        "}"
    )
