"""Where the agents of a component with a common kernel end: ``X(T) = B c``; each number ``c_j`` is enclosed here.

Let ``A_j`` be the pivot of column ``j`` of the basis ``B`` and all agents that it hears, directly or not, through
edges of any modes. Their rows of ``B`` are ``g_k e_j'``, ``g_k = 1`` or ``-1``: a row of ``L B = 0`` makes ``g_k e_j'``
a mean of rows, with signs, none of which is longer. All edges among them keep the camps ``g``, and nobody else is
heard, so the extremes of ``g_k x_k`` over ``A_j`` only move inwards, and ``c_j`` lies between them.

If ``q' L = 0`` for every member, ``q`` supported on ``A_j``, then ``q' X`` is kept by every signal, and
``c_j = q' X(0) / sum_k q_k g_k``: exactly. Of edges ``s -> t`` with ``w- < w+`` this asks ``q_t = 0``, or if both
directions change together, ``q_t = sign q_s``. If only ``|q' L X|^2 <= m V`` for every member, ``V`` a Lyapunov
function of rate ``r``, then ``|q' X(0) - q' X(T)| <= (2/r) sqrt(m V(0))``.

Sliding variables push the extremes outwards. But ``y = x - sigma`` obeys ``y' = -gain L x`` and ends where ``x`` does:
``q' y`` is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.family import Component, Family
from ptcc_certify.checker.reading import Interval, need
from ptcc_certify.checker.section_declarations import Some

#: A mean that a signal keeps: weights of agents, or that all are equal up to camps.
Mean = Literal["equal"] | Some[Fraction]
#: What is said of a vector that is the camps.
EQUAL = "equal"


@dataclass(frozen=True)
class WeightedMean:
    """A weighted mean that a Lyapunov function keeps near its first value: ``|q' L X|^2 <= constant V``.

    Attributes
    ----------
    column : int
        All agents of ``weights`` have rows of ``B`` that are 1 or -1 in this column, and 0 elsewhere.
    weights : dict of int to Fraction
        ``q``,
    size : Fraction
        with the sum ``sum_k q_k g_k``, not 0.
    constant : Fraction
    """

    column: int
    weights: Mapping[int, Fraction]
    size: Fraction
    constant: Fraction

    def interval(self, x: Sequence[Fraction], deviation: Fraction) -> Interval:
        """Return ends of ``c_j``; ``q' X`` moves by at most ``deviation``."""
        middle, radius = sum((q * x[v] for v, q in self.weights.items()), Fraction(0)), deviation / abs(self.size)
        return middle / self.size - radius, middle / self.size + radius


def agents_heard(pairs: Iterable[tuple[int, int]], pivots: Mapping[int, int]) -> dict[int, list[int]]:
    """Return ``A_j`` of every column, ascending, from edges ``(source, target)`` of all modes."""
    near: dict[int, set[int]] = {}
    for s, t in pairs:
        near.setdefault(t, set()).add(s)
    result = {}
    for j, pivot in pivots.items():
        found, seen = [pivot], {pivot}
        for v in found:
            new = near.get(v, set()) - seen
            seen |= new
            found.extend(new)
        result[j] = sorted(found)
    return result


def limits(
    kernel: Mapping[int, Mapping[int, Fraction]],
    groups: Mapping[int, Sequence[int]],
    means: Mapping[int, Fraction],
    near: Iterable[tuple[int, Interval]],
    moves: tuple[Mapping[int, int], int],
    x: Sequence[Fraction],
    wide: Mapping[int, Interval] | None = None,
) -> dict[int, Interval]:
    """Return ends of ``x_k(T)`` of every agent.

    ``kernel`` has the rows of ``B`` without zeros, ``groups`` the sets ``A_j``, ``means`` the ``c_j`` that are known
    exactly, ``near`` other columns with ends of theirs, ``moves`` bounds of ``|x_k(0) - x_k(T)|`` as integers over one.
    Where sliding variables move, ``x`` is ``y(0)``, and ``wide`` has ends of all columns in place of extremes of ``x``.
    """
    values, bounds, scale = _together(list(kernel), moves, x)
    units = {v: item for v, row in kernel.items() if len(row) == 1 and abs((item := next(iter(row.items())))[1]) == 1}
    ways: dict[int, tuple[list[int], list[int]]] = {}
    for j, group in groups.items():
        own = [values[v] if kernel[v][j] > 0 else -values[v] for v in group]
        ways[j] = ([min(own)], [max(own)]) if wide is None else ([], [])
    for v, d in bounds.items():
        if v in units:
            j, g = units[v]
            middle = values[v] if g > 0 else -values[v]
            ways[j][0].append(middle - d)
            ways[j][1].append(middle + d)
    ends = dict(wide or {})
    ranges = ((j, (Fraction(max(low), scale), Fraction(min(high), scale))) for j, (low, high) in ways.items() if low)
    for j, (low, high) in (*ranges, *near, *((j, (c, c)) for j, c in means.items())):
        first, last = ends.get(j, (low, high))
        ends[j] = max(low, first), min(high, last)
    result: dict[int, Interval] = {}
    for v, row in kernel.items():
        if v in units:
            j, g = units[v]
            result[v] = ends[j] if g > 0 else (-ends[j][1], -ends[j][0])
            continue
        low = sum((b * ends[j][b < 0] for j, b in row.items()), Fraction(0))
        high = sum((b * ends[j][b > 0] for j, b in row.items()), Fraction(0))
        if v in bounds:
            low = max(low, Fraction(values[v] - bounds[v], scale))
            high = min(high, Fraction(values[v] + bounds[v], scale))
        result[v] = low, high
    return result


def _together(
    nodes: Sequence[int], moves: tuple[Mapping[int, int], int], x: Sequence[Fraction]
) -> tuple[dict[int, int], dict[int, int], int]:
    """Return states and deviations of some nodes as integers over one scale, and that."""
    (state,), scale = integers([[x[k] for k in nodes]])
    bounds, unit = moves
    bits = longest(state) + longest(bounds.values()), scale.bit_length() + unit.bit_length()
    spend(2 * len(nodes), *bits, "final states of many agents")
    sized(2 * len(nodes), sum(bits), "final states of many agents")
    values = {k: y * unit for k, y in zip(nodes, state, strict=True)}
    return values, {k: d * scale for k, d in bounds.items()}, scale * unit


# ---------------------------------------------------------------------- the check


def check_means(
    family: Family, witness: Sequence[Mapping[str, Any] | None] | None, x: Sequence[Fraction]
) -> list[tuple[dict[int, list[int]], dict[int, Fraction]]]:
    """Return of every component the sets ``A_j`` and, where a witness proves them, the ``c_j``."""
    given = [None] * len(family.components) if witness is None else witness
    need(len(given) == len(family.components), f"means has not {len(family.components)} entries")
    result = []
    for component, entry in zip(family.components, given, strict=True):
        pairs = ((s, t) for edges in component.part.edges for s, t, _, _, _ in edges)
        groups = agents_heard(pairs, component.pivots) if component.kernel else {}
        need(entry is None or set(entry) <= set(map(str, groups)), "means of a component")
        numbered = ((int(j), q) for j, q in (entry or {}).items())
        means = {j: check_mean(family, component, groups[j], j, q, x) for j, q in numbered}
        result.append((groups, means))
    return result


def check_mean(
    family: Family, component: Component, group: Sequence[int], j: int, entry: Any, x: Sequence[Fraction]
) -> Fraction:
    """Verify that every member keeps ``q' X``, and return ``c_j``."""
    camps = {v: int(component.kernel[v][j]) for v in group}
    if entry == EQUAL:
        q = camps
    else:
        index = family.modes[0].structure.graph.index
        nodes = [index[label] for label in entry]
        need(set(nodes) <= set(group), "a mean of agents that a pivot does not hear")
        (whole,), _ = integers([list(entry.values())])
        q = dict(zip(nodes, whole, strict=True))
    bits = longest(q.values())
    for mode, edges in zip(family.modes, component.part.edges, strict=True):
        spend(4 * len(edges), mode.unit.bit_length(), bits, "means that are kept")
        total: dict[int, int] = {}
        for s, t, sign, low, high in edges:
            if own := q.get(t, 0):
                total[t] = total.get(t, 0) + own * low
                total[s] = total.get(s, 0) - sign * own * low
            free = own == sign * q.get(s, 0) if mode.tied else not own
            need(low == high or free, "a mean that an uncertain edge changes")
        need(not any(total.values()), "a mean that is not kept")
    size = sum(own * camps[v] for v, own in q.items())
    need(size != 0, "a mean of weight 0")
    (values,), scale = integers([[x[v] for v in q]])
    spend(len(q), longest(values), bits, "a mean")
    return Fraction(sum(own * y for own, y in zip(q.values(), values, strict=True)), scale * size)
