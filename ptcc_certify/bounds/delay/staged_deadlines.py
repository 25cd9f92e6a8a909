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

    None are returned where information takes longer to arrive: the first deadline would not be positive.

    Parameters
    ----------
    rows : FollowerRows
    T : Fraction
    delay : Fraction
        In the unit of ``T``.

    Returns
    -------
    tuple of Fraction, or None

    Examples
    --------
    >>> chain = FollowerRows(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])))
    >>> stage_deadlines(chain, Fraction(1), Fraction(1, 10))
    (Fraction(9, 10), Fraction(1, 1))
    """
    level = levels(rows)
    if level is None:
        return None
    if T - (int(level.max()) - 1) * delay <= 0:
        return ()
    most = int(level.max())
    due = {x: T - (most - x) * delay for x in np.unique(level).tolist()}
    return tuple(due[x] for x in level.tolist())


def levels(rows: FollowerRows) -> np.ndarray | None:
    """Return the edges of the longest path from leaders to every follower; None where followers form a cycle.

    Examples
    --------
    >>> levels(FollowerRows(analyse(SignedDigraph.from_edges([(1, 2, 1), (1, 3, 1), (2, 3, -1)])))).tolist()
    [1, 2]
    """
    components = rows.structure.strong_component[rows.followers]
    if np.bincount(components).max() > 1:
        return None
    out, waiting = rows.W.tocsc(), np.diff(rows.W.indptr).tolist()
    first, listeners = out.indptr.tolist(), out.indices.tolist()
    level = [1] * rows.D.size
    todo = [k for k, count in enumerate(waiting) if not count]
    for k in todo:
        for j in listeners[first[k] : first[k + 1]]:
            level[j] = max(level[j], level[k] + 1)
            waiting[j] -= 1
            if not waiting[j]:
                todo.append(j)
    return np.array(level)
