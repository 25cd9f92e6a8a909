"""Verifies where a mode that comes to bipartite consensus ends if its weights are constant, and nobody knows them.

Section 19 of the format. Let ``R`` be the leaders of the mandatory graph and all that they hear through edges of the
mode; ``c = eta' z``, with ``z_k = g_k x_k(0)`` and ``eta >= 0`` of sum 1 on ``R`` with ``eta' M(L) = 0``. If

    z_k + sum_l |w_kl| (h_l - h_k)  <=  upper        at w+ where h_l > h_k, at w- elsewhere,

for every ``k`` in ``R``, then ``c <= upper`` for all weights: multiply by ``eta_k`` and add. By the same sum the member
with these very weights has ``c`` at least the least of these rows. The lower end is that of ``-z``. Where both
directions of every edge change together, ``eta`` is equal on ``R``, and ``c`` the mean of ``z``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from lmi.exact.decimal_rounding import down, up
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.common_kernel_ends import agents_heard
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Component, Edge, Family, Mode
from ptcc_certify.checker.follower_rows import WeightsBetween
from ptcc_certify.checker.graph import ordered
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.section_declarations import Several, Some


@dataclass(frozen=True, kw_only=True)
class FinalValue:
    """Ends of the consensus value of a mode, how near to them it comes, and the vectors of the rows."""

    lower: Fraction
    upper: Fraction
    within: Fraction
    above: Some[Fraction] | None = None
    below: Some[Fraction] | None = None


@dataclass(frozen=True, kw_only=True)
class FinalValueSection:
    """What the file says of where modes end whose weights are constant."""

    claim: Literal["final value"]
    signals: Literal["constant"]
    component: int
    modes: Several[FinalValue | None]


def fitting_camps(nodes: Sequence[int], edges: Sequence[Edge]) -> dict[int, int] | None:
    """Return camps that all edges fit, the first node of every piece +1; None if there are none.

    Examples
    --------
    >>> fitting_camps([0, 1], [(0, 1, -1, 0, 1)]), fitting_camps([0, 1], [(0, 1, -1, 0, 1), (1, 0, 1, 1, 1)])
    ({0: 1, 1: -1}, None)
    """
    place = {v: k for k, v in enumerate(nodes)}
    source, target = ([place[edge[end]] for edge in edges] for end in (0, 1))
    _, opposite, odd = Digraph.signed_pieces(len(nodes), source, target, [edge[2] < 0 for edge in edges])
    return None if odd else {v: -1 if against else 1 for v, against in zip(nodes, opposite, strict=True)}


def check_final_value(
    doc: Document, family: Family, component: Component, x: Sequence[Fraction] | None, entry: FinalValueSection, of: str
) -> None:
    """Verify the ends of the consensus value of every mode of which it is claimed."""
    if x is None:
        raise RejectedError("a final value without an initial state")
    doc.open("final-value", of)
    values = entry.modes
    need(len(values) == len(family.modes), f"modes has not {len(family.modes)} entries")
    need(any(one is not None for one in values), "no final value of any mode")
    found = [_check_mode(family, component, k, x, one) for k, one in enumerate(values) if one is not None]
    low, high, within = min(v[0] for v in found), max(v[1] for v in found), max(v[2] for v in found)
    doc.done(f"camps times {down(low)} to {up(high)}, attained within {up(within, 2)}")


def _check_mode(
    family: Family, component: Component, number: int, x: Sequence[Fraction], entry: FinalValue
) -> tuple[Fraction, Fraction, Fraction]:
    mode, edges, closed = family.modes[number], component.part.edges[number], component.part.closed[number]
    spend(100 * (len(edges) + len(component.nodes)), what="final values")
    camps = fitting_camps(component.nodes, edges)
    if camps is None or len(closed) != 1:
        raise RejectedError("a mode that does not come to bipartite consensus")
    pivot = mode.structure.closed[closed[0]][0]
    nodes = agents_heard(((s, t) for s, t, *_ in edges), {0: pivot})[0]
    (z,), scale = integers([[camps[v] * x[v] for v in nodes]])
    lower, upper, within = entry.lower, entry.upper, entry.within
    need(lower <= upper, "the lower end is the larger")
    if mode.tied:
        need(entry.above is None and entry.below is None, "vectors of weights that change together")
        mean = Fraction(sum(z), scale * len(z))
        need(lower <= mean <= upper and mean + within >= upper and mean - within <= lower, "the mean is not enclosed")
        return lower, upper, within
    labels, into = [family.labels[v] for v in nodes], set(nodes)
    own = [edge for edge in edges if edge[1] in into]
    for key, told, side, end in (("above", entry.above, 1, upper), ("below", entry.below, -1, -lower)):
        h = list(ordered(labels, told, key).values())
        most, least = _row_ends(mode, own, nodes, [side * y for y in z], scale, h)
        need(most <= end, "a row exceeds the end")
        need(end <= least + within, "no weights are known to come so near to the end")
    return lower, upper, within


def _row_ends(
    mode: Mode, edges: Sequence[Edge], nodes: Sequence[int], z: Sequence[int], scale: int, h: Sequence[Fraction]
) -> tuple[Fraction, Fraction]:
    """Return the largest and the least row at the weights that are the largest for it; ``z`` is over ``scale``."""
    (whole,), divisor = integers([h])
    bits = longest(edge[4] for edge in edges) + longest(whole)
    unit = mode.unit * divisor
    spend(2 * len(nodes), bits + longest(z), unit.bit_length() + scale.bit_length(), "final values")
    sized(2 * len(nodes), bits + longest(z) + unit.bit_length() + scale.bit_length(), "final values")
    heard = dict(zip(nodes, whole, strict=True))
    pulls = WeightsBetween(edges, mode.unit).least(heard, heard)
    rows = [unit * y - scale * pulls[v] for v, y in zip(nodes, z, strict=True)]
    return Fraction(max(rows), unit * scale), Fraction(min(rows), unit * scale)
