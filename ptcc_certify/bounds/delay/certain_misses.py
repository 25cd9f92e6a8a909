"""Who misses the deadline for certain: an agent that hears of followers late, under a gain that grows without limit.

Such an agent follows what it hears: ``x_k(T) = D_k^-1 sum_l w_kl x_l(T - tau_kl)``, and what it hears of is not at its
final state yet. With signs ``g`` that fit the weights among all followers that agent ``k`` hears of, also by others,
and ``g_l eps_l(0) >= 0``, deviations keep their signs and fall no faster than ``e^(-D_l s)``:

    |eps_k(T)| >= sum_l (|w_kl|/D_k) e^(-D_l s(T - tau_kl)) |eps_l(0)|.

Deadlines of stages: where followers form no cycle, each agent is at its final state by a deadline of its own.

The level of a follower is the longest path from leaders to it. With deadlines one delay apart, from level to level, all
that an agent hears is final at its own deadline, where its gain has a pole: it is there exactly, and stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.elementary_enclosures import exp, log, rounded
from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.checker.input_formulas import BITS
from ptcc_certify.graphs.rationals import writable
from ptcc_certify.lyapunov.follower_rows import FollowerRows
from ptcc_certify.model.base import Protocol

#: Followers up to which it is searched who misses the deadline.
_MISSED_FOLLOWERS = 400


@dataclass(frozen=True, eq=False)
class Missed:
    """An agent that is off its final state at ``T`` by ``bound`` at least, if no message comes sooner than told.

    Attributes
    ----------
    agent : int
        Its node.
    bound : Fraction
        Positive.
    gauge : (F,) int array
        Signs of the followers that the agent hears of, and its own; 0 for others.
    """

    agent: int
    bound: Fraction
    gauge: np.ndarray


def find_missed(case: LateCase, followers: Sequence[int]) -> Missed | None:
    """Return the agent that is certain to miss the deadline by most; None if none is found.

    With signs ``g`` that fit the weights among all followers that agent ``k`` hears of, also by others, and
    ``g_l eps_l(0) >= 0``,

        |eps_k(T)| >= sum_l (|w_kl|/D_k) e^(-D_l s(T - tau_kl)) |eps_l(0)|.
    """
    initial_state, ends = case.initial_state, case.ends
    if initial_state is None or ends is None or len(followers) > _MISSED_FOLLOWERS:
        return None
    graph, latencies = case.graph, case.messages.latencies(case.of)
    delays = latencies if isinstance(latencies, tuple) else (latencies,) * graph.n_edges
    of = {(s, t): x for s, t, x in zip(graph.source.tolist(), graph.target.tolist(), delays, strict=True)}
    exact = dict(zip(followers, graph.exact_rows(followers), strict=True))
    heard = {k: [j for j in exact[k] if j != k and j in exact] for k in followers}
    best: Missed | None = None
    for k in followers:
        if not heard[k] or not all(of[j, k] > 0 for j in heard[k]):
            continue
        signs = _signs(k, heard, exact, initial_state, ends)
        if signs is None:
            continue
        bound = Fraction(0)
        for j in heard[k]:
            size = max(abs(initial_state[j] - ends[j][0]) - ends[j][1], Fraction(0))
            bound += abs(exact[k][j]) / exact[k][k] * _kept(case.protocol, exact[j][j], of[j, k]) * size
        bound = rounded(bound, BITS) if bound > 0 else bound
        if bound > 0 and writable(bound) and (best is None or bound > best.bound):
            best = Missed(k, bound, np.array([signs.get(v, 0) for v in followers]))
    return best


def _kept(protocol: Protocol, rate: Fraction, delay: Fraction) -> Fraction:
    """Bound ``e^(-rate s(T - delay))`` from below."""
    share = delay / protocol.T
    if share >= 1:
        return exp(Fraction(0))[0]  # as the check encloses it
    return exp(-rate * protocol.gain.exact.clock(log(1 / share)[1], share))[0]


def _signs(
    k: int,
    heard: dict[int, list[int]],
    rows: dict[int, dict[int, Fraction]],
    initial_state: Sequence[Fraction],
    ends: Sequence[tuple[Fraction, Fraction]],
) -> dict[int, int] | None:
    """Return signs that fit weights and deviations, of an agent and of all that it hears of; None if there are none."""
    signs, todo = {k: 1}, [k]
    for v in todo:
        for j in heard[v]:
            sign = signs[v] * (1 if rows[v][j] < 0 else -1)  # the Laplacian's entry is minus the weight
            if j not in signs:
                todo.append(j)
            if signs.setdefault(j, sign) != sign:
                return None
    judged = {j for v in todo for j in heard[v]}
    for sign in (1, -1):
        if all(
            sign * signs[v] * (initial_state[v] - ends[v][0]) >= ends[v][1]
            or (ends[v][1] == 0 and initial_state[v] == ends[v][0])
            for v in judged
        ):
            return {v: sign * s for v, s in signs.items()}
    return None


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
