"""Verifies the common motion of agents of order n, which is that of one agent without neighbours, and where it ends."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from typing import Any

from lmi.exact.matrix_exponential import expm
from lmi.exact.numbers import integers, longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.agent_model import Chains
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.final_state import FinalState
from ptcc_certify.checker.reading import Interval, length, need
from ptcc_certify.checker.side_files import Numbers

#: Bits to which an integral is enclosed.
BITS = 96
#: Largest exponent ``w`` of :func:`rest_integral`.
LARGEST_EXPONENT = 1000
#: What an entry of the final states costs, in products, and more for each derivative where the motion is rounded.
ENTRY, ROUNDED_ENTRY = 800, 800
#: By agent, coordinate by coordinate, numbers for position, velocity and so on.
States = Sequence[Sequence[Sequence[Fraction]]]


def check_motion(doc: Document, agents: Chains, M: Sequence[Sequence[Interval]]) -> Sequence[Sequence[Interval]]:
    """Verify ``M``, which takes the common motion from time 0 to the deadline; return it."""
    doc.open("agent-motion", "agents")
    n = agents.n
    need(len(M) == n and all(len(row) == n for row in M), f"motion has not {n} rows of {n} entries")
    true, radius = motion_of(agents)
    for row, exact_row in zip(M, true, strict=True):
        for (mid, wide), (low, high) in zip(row, exact_row, strict=True):
            need(mid - wide <= low - radius and high + radius <= mid + wide, "the common motion is another")
            need(wide == 0 or low < high or radius > 0, "a radius where the common motion is known exactly")
    doc.done("exact" if not any(wide for row in M for _, wide in row) else "enclosed")
    return M


def check_ends(
    doc: Document, agents: Chains, final: FinalState, section: Any, decays: bool, derivatives: int | None = None
) -> bool:
    """Verify the common motion and the final states; return whether agreement and where it happens were proved.

    Parameters
    ----------
    section : AgentsSection or CascadeSection
    decays : bool
        Whether a Lyapunov function is used.
    derivatives : int, optional
        Of how many final values may be told; by default of all.
    """
    doc.at = "agents.motion"
    M = check_motion(doc, agents, section.motion)
    doc.at = "agents.final_state"
    proved = doc.sections["influence"] is not None and (decays or not final.structure.graph.listening)
    if section.final_state is not None:
        states = section.initial_state
        need(states is not None and proved, "a final state without initial states or a proof")
        check_final_states(doc, agents, final, M[:derivatives], states, section.offsets, section.final_state)
    return proved


def motion_of(agents: Chains, bits: int = BITS) -> tuple[list[list[Interval]], Fraction]:
    """Return ends of the entries of ``M``, and how far it may be beyond them."""
    n, T = agents.n, agents.gain.T
    zero = Fraction(0)
    if any(agents.own):  # at rest
        damping = agents.own[1]
        exponent = (agents.plant[1] + damping * agents.gain.rho1) * T
        need(abs(exponent) <= LARGEST_EXPONENT, f"(a_2 + f_2 rho1) T is above {LARGEST_EXPONENT} in size")
        low, high = rest_integral(damping * agents.gain.k, exponent, bits)
        return [[(Fraction(1), Fraction(1)), (T * low, T * high)], [(zero, zero), (zero, zero)]], zero
    companion = [[T if j == i + 1 else zero for j in range(n)] for i in range(n - 1)]
    companion.append([-a * T for a in agents.plant])
    middle, radius = expm(companion, bits)
    return [[(x, x) for x in row] for row in middle], radius


def rest_integral(p: Fraction, w: Fraction, bits: int = BITS) -> Interval:
    """Enclose ``int_0^1 e^(-w (1 - q)) q^p dq = sum_(j >= 0) (-w)^j / ((p + 1)(p + 2) .. (p + j + 1))``.

    Parameters
    ----------
    p : Fraction
        Not negative.
    w : Fraction
        At most ``LARGEST_EXPONENT`` in size.

    Returns
    -------
    (below, above)
        Equal for ``w = 0``.

    Examples
    --------
    >>> rest_integral(Fraction(1), Fraction(0))
    (Fraction(1, 2), Fraction(1, 2))
    >>> below, above = rest_integral(Fraction(0), Fraction(1))  # 1 - 1/e
    >>> float(below), float(above - below) < 1e-28
    (0.6321205588285577, True)
    """
    if w == 0:
        return 1 / (p + 1), 1 / (p + 1)
    places = bits + 2 * int(abs(w)) + 32
    (a, c), (b, d) = p.as_integer_ratio(), w.as_integer_ratio()
    own = longest((a, b, c, d))
    spend(8 * (places + 2 * LARGEST_EXPONENT), places + 2 * own, 2 * own, "the common motion")
    # term: the summand in units of 2^-places, rounded; each: what it is off by; off: what the sum is
    term = (c << places) // (a + c)
    total, off, each, j = term, Fraction(1), Fraction(1), 0
    while p + j + 2 < 2 * abs(w) or abs(term) > each:
        j += 1
        bottom = a + (j + 1) * c  # p + j + 1 = bottom / c
        term = -term * b * c // (d * bottom)
        each = Fraction(-int(-(each * abs(b) * c) // (d * bottom)) + 2)
        total, off = total + term, off + each
    off += 2 * (abs(term) + each)  # the rest is at most twice its first term, which is less than half of this one
    return (total - off) / (1 << places), (total + off) / (1 << places)


def check_final_states(
    doc: Document,
    agents: Chains,
    final: FinalState,
    M: Sequence[Sequence[Interval]],
    states: States,
    offsets: Sequence[Sequence[Fraction]],
    claimed: Sequence[Sequence[Sequence[Interval]]],
) -> None:
    """Verify the interval of every agent, coordinate and derivative: ``h_k + sum_l Q_kl sum_j M_ij g_lj``.

    Of as many derivatives as ``M`` has rows. In the large form from the leaders' intervals and what followers leave.
    """
    doc.open("agent-final-state", "agents")
    labels, n = final.structure.graph.labels, agents.n
    rounded = any(wide for row in M for _, wide in row)
    bits = length(chain((x for row in M for pair in row for x in pair), *chain.from_iterable(states)))
    products = ENTRY + (n * ROUNDED_ENTRY if rounded else 0)
    spend(products * len(labels) * agents.d * n, bits, bits, "the final states of agents")
    need_shape(claimed, "final_state", agents, len(M))
    for axis in range(agents.d):
        G = [[row[axis][j] - (offsets[v][axis] if j == 0 else 0) for v, row in enumerate(states)] for j in range(n)]
        before = [final.values(Numbers(g)) for g in G] if rounded else []
        each = list(map(final.enclosures, before))
        for i, row in enumerate(M):
            values = final.values(Numbers(_combined([mid for mid, _ in row], G)))
            own = [claimed[v][axis][i] for v in range(len(labels))]
            mids = [mid - (offsets[v][axis] if i == 0 else 0) for v, (mid, _) in enumerate(own)]
            for v, end in final.enclosures(values).items():
                x, r = _wider(end, row, [ends[v] for ends in each])
                need(abs(x - mids[v]) + r <= own[v][1], f"agent {shorten(labels[v])} ends elsewhere")
            if final.weights is None:
                wide = {k: _wider(value, row, [one[k] for one in before]) for k, value in values.items()}
                final.check_followers(wide, (Numbers(mids), Numbers([radius for _, radius in own])))
    doc.done("exact" if final.exact and not rounded else "enclosed")


def _wider(end: Interval, row: Sequence[Interval], before: Sequence[Interval]) -> Interval:
    """Return an interval wider by what a rounded row of ``M`` makes of what is there ``before``, at time 0.

    That is of positions, velocities and so on; empty if ``M`` is exact.
    """
    x, r = end
    return x, r + sum((wide * (abs(y) + s) for (_, wide), (y, s) in zip(row, before, strict=False)), Fraction(0))


def _combined(row: Sequence[Fraction], G: Sequence[Sequence[Fraction]]) -> list[Fraction]:
    """Return ``sum_j M_j g_lj`` of every agent."""
    (own,), unit = integers([row])
    X, scale = integers(G)
    spend(len(row) * len(G[0]), longest(own), longest(x for part in X for x in part), "the common motion")
    sums = (sum(m * x for m, x in zip(own, column, strict=True)) for column in zip(*X, strict=True))
    return [Fraction(x, unit * scale) for x in sums]


def need_shape(states: Sequence[Sequence[Sequence[Any]]] | None, what: str, agents: Chains, n: int = 0) -> None:
    """Refuse states unless those of every agent are of every coordinate, with ``n`` derivatives of each."""
    fits = all(len(rows) == agents.d and all(len(row) == (n or agents.n) for row in rows) for rows in states or ())
    need(fits, f"{what} is not of {agents.d} coordinates with {n or agents.n} derivatives each")


def sized_offsets(offsets: Sequence[Sequence[Fraction]], agents: Chains) -> Sequence[Sequence[Fraction]]:
    """Return the offset of every agent, which has all coordinates."""
    need(all(len(row) == agents.d for row in offsets), f"offsets has not {agents.d} entries of an agent")
    return offsets
