"""Deadlines of stages: where followers form no cycle, each agent is at its final state by a deadline of its own.

The level of a follower is the longest path from leaders to it. With deadlines one delay apart, from level to level, all
that an agent hears is final at its own deadline, where its gain has a pole: it is there exactly, and stays.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ptcc_certify.lyapunov.follower_rows import FollowerRows


def stage_deadlines(rows: FollowerRows, T: Fraction, delay: Fraction) -> tuple[Fraction, ...] | None:
    """Return the deadline of every follower, ``T - (levels - level) delay``; None where followers form a cycle.

    Parameters
    ----------
    rows : FollowerRows
    T : Fraction
    delay : Fraction
        In the unit of ``T``.

    Returns
    -------
    tuple of Fraction, or None
        None as well where information takes longer to arrive: the first deadline would not be positive.

    Examples
    --------
    >>> chain = FollowerRows(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])))
    >>> stage_deadlines(chain, Fraction(1), Fraction(1, 10))
    (Fraction(9, 10), Fraction(1, 1))
    """
    level = np.ones(rows.D.size, dtype=np.int64)
    W = rows.W.tocoo()
    for _ in range(rows.D.size + 1):
        new = level.copy()
        np.maximum.at(new, W.row, level[W.col] + 1)
        if (new == level).all():
            break
        if new.max() > rows.D.size:
            return None
        level = new
    else:
        return None
    most = int(level.max())
    if T - (most - 1) * delay <= 0:
        return None
    return tuple(T - (most - int(x)) * delay for x in level)
