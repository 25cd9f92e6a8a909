"""Verifies boxes in which agents stay, or to which followers come, under every signal, where they need not rest.

Section 19 of the format. Of ``+-x_l(0)`` that reach an agent along edges of any modes none is left behind: within the
least and the largest it stays at all times.

Agents that are no followers hear none of these, and stay within what reaches them of
``+-x_l(0)`` at all times. With these ends, ``u`` and ``l`` of the followers, ``y_l = u_l`` for positive and ``-l_l``
for negative edges, let for every follower ``k`` in every mode

    sum_l |w_kl| (u_k - y_l)  >=  0        at w+ where y_l > u_k, at w- elsewhere,

and the mirror image for ``-l_k``. With ``d`` of followers whose rows decay, ``rho``, the largest of 0,
``(x_k - u_k) / d_k`` and ``(l_k - x_k) / d_k``, decays likewise: where it is taken, add both rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import integers
from lmi.exact.work import spend
from ptcc_certify.checker.constrained_switching import reachable_bounds
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Component, Family
from ptcc_certify.checker.follower_rows import WeightsBetween
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.row_functions import check_follower_rows
from ptcc_certify.checker.section_declarations import Nodes, Positive, Several, Vector


@dataclass(frozen=True, kw_only=True)
class AttractingBox:
    """A box to which followers come."""

    component: int
    nodes: Nodes
    vector: Vector
    lower: Several[Fraction]
    upper: Several[Fraction]
    rate: Positive


@dataclass(frozen=True, kw_only=True)
class KeptBox:
    """A box in which all agents of a component stay."""

    component: int
    lower: Several[Fraction]
    upper: Several[Fraction]


def check_boxes(doc: Document, family: Family, begin: Begin) -> None:
    """Verify every box."""
    if "boxes" not in doc:
        return
    items = doc.section("boxes")
    need(bool(items), "no box")
    need(not (begin.sigma and any(begin.sigma)), "a box while sliding variables move")
    if begin.state is None:
        raise RejectedError("a box without an initial state")
    x, last = list(begin.state), (False, -1)
    for k, entry in enumerate(items):
        doc.at = of = f"boxes[{k}]"
        kept, component = isinstance(entry, KeptBox), family.component(entry.component)
        need(last < (kept, entry.component), "boxes are out of order")
        need(component.depends, "a box where all agents come to rest")
        doc.open("kept-box" if kept else "attracting-box", of)
        if isinstance(entry, KeptBox):
            _check_kept(doc, component, x, entry)
        else:
            _check_box(doc, family, component, x, entry)
        last = kept, entry.component


def _check_kept(doc: Document, component: Component, x: Sequence[Fraction], entry: KeptBox) -> None:
    """Verify a box in which all agents of a component stay at all times."""
    edges, n = component.part.edges, len(component.nodes)
    spend(100 * sum(1 + len(some) for some in edges), what="boxes")
    reach = reachable_bounds(component.nodes, {edge[:3] for some in edges for edge in some}, x)
    need(len(entry.lower) == len(entry.upper) == n, f"lower or upper has not {n} entries")
    for v, low, high in zip(component.nodes, entry.lower, entry.upper, strict=True):
        need(low <= reach[v][0] and reach[v][1] <= high, "an agent may leave the box")
    doc.done(f"{n} agents")


def _check_box(
    doc: Document, family: Family, component: Component, x: Sequence[Fraction], entry: AttractingBox
) -> None:
    edges = component.part.edges
    spend(100 * sum(1 + len(some) for some in edges), what="boxes")
    nodes = positions(doc, family.modes[0].structure.graph, entry.nodes, "followers")
    inside = set(nodes)
    need(bool(nodes) and nodes == [v for v in component.nodes if v in inside], "followers")
    need(all(t in inside for some in edges for s, t, *_ in some if s in inside), "a follower is heard by another agent")
    rate, n = entry.rate, len(nodes)
    vector = doc.files.numbers(entry.vector, "vector", n)
    need(vector.positive(), "the vector is not positive")
    d, scale = vector.over(range(n))
    rest = [v for v in component.nodes if v not in inside]
    sizes = dict(zip(nodes, d, strict=True)) | dict.fromkeys(rest, 0)
    check_follower_rows(family, component, nodes, sizes, {}, (rate, scale))
    reach = reachable_bounds(component.nodes, {edge[:3] for some in edges for edge in some}, x)
    need(len(entry.lower) == len(entry.upper) == n, f"lower or upper has not {n} entries")
    lower, upper = list(entry.lower), list(entry.upper)
    (low, high), _ = integers([lower + [reach[v][0] for v in rest], upper + [reach[v][1] for v in rest]])
    top = dict(zip([*nodes, *rest], high, strict=True))
    bottom = dict(zip([*nodes, *rest], [-y for y in low], strict=True))
    _check_ends(component, nodes, top, bottom)
    doc.done(f"rate {down(rate)}, {n} followers")


def _check_ends(component: Component, nodes: Sequence[int], top: dict[int, int], bottom: dict[int, int]) -> None:
    """Verify the rows of ``u`` and ``-l`` in every mode: numbers ``2 k`` and ``2 k + 1`` of one vector."""
    ends = {2 * v: y for v, y in top.items()} | {2 * v + 1: y for v, y in bottom.items()}
    for edges in component.part.edges:
        both = [
            (2 * s + (same if sign > 0 else other), 2 * t + same, 1, low, high)
            for s, t, sign, low, high in edges
            for same, other in ((0, 1), (1, 0))
        ]
        rows = WeightsBetween(both, 1).least(ends, ends)
        need(all(rows[2 * v + side] >= 0 for v in nodes for side in (0, 1)), "an agent may leave the box")
