"""Verifies where the agents end: left null vectors of leader groups, weights of followers, the final state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from operator import mul
from typing import Any

from lmi.exact.directed_rounding import up
from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.graph import by_agent, ordered, positions
from ptcc_certify.checker.matrices import Matrix, need_rows
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import Interval, RejectedError, entries, fields, interval, length, need, same
from ptcc_certify.checker.side_vectors import Numbers, beside
from ptcc_certify.checker.structure import MANY_COMPONENTS, Claim, Structure

#: Integers by node.
Indexed = Sequence[int] | Mapping[int, int]
#: An interval may be wider than twice what is proved by this share of the largest entry of the initial state.
WIDEST = Fraction(1, 10**6)
#: Bits to which the values of leader groups are rounded, beyond the common scale of states, in the large form.
GRID_BITS = 128
ZERO = Fraction(0), Fraction(0)
#: The left null vector of a group of one.
ALONE = [(Fraction(1), Fraction(0))]


@dataclass(frozen=True, eq=False)
class FinalState:
    """The matrix ``Q`` that takes the begin to the final state.

    Attributes
    ----------
    structure : Structure
    left_null_vectors : list of (list of Interval), or None
        ``eta_k' G_k`` of each balanced closed component; None: not known exactly.
    weights : list of (list of Interval)
        Of each follower on these components.
    """

    structure: Structure
    left_null_vectors: list[list[Interval]] | None = None
    weights: Sequence[Sequence[Interval]] = ()

    @cached_property
    def projection(self) -> list[dict[int, Fraction]]:
        """The rows of ``Q``, which are exact."""
        need(self.left_null_vectors is not None, "a deviation from a final state that is not exact")
        n, left_null_vectors = self.structure.graph.n, self.left_null_vectors or []
        need_rows(n)
        bits = sum(2 * length(x for row in rows for x, _ in row) for rows in (left_null_vectors, self.weights))
        count = n * sum(len(group) for _, group, _ in self.structure.balanced)
        sized(count, bits, "the weights of leaders")
        spend(count, bits, bits, "the weights of leaders")
        Q: list[dict[int, Fraction]] = [{} for _ in range(n)]
        for k, (_, group, gauge) in enumerate(self.structure.balanced):
            weights = {v: Fraction(g) for v, g in zip(group, gauge, strict=True)}
            weights |= {v: row[k][0] for v, row in zip(self.structure.followers, self.weights, strict=True)}
            for v, weight in weights.items():
                if weight:
                    Q[v] |= {j: weight * x for j, (x, _) in zip(group, left_null_vectors[k], strict=True)}
        return Q

    @cached_property
    def deviations(self) -> tuple[Matrix, int, Matrix]:
        """``D = I - Q`` on the columns ``kept``, times a scale; the scale; ``D'D``."""
        place, Q = {v: j for j, v in enumerate(self.structure.kept)}, self.projection
        rows = [[(i == v) - row.get(v, Fraction(0)) for v in place] for i, row in enumerate(Q)]
        D, scale = integers(rows)
        columns, bits = list(zip(*D, strict=True)), longest(x for row in D for x in row)
        sized(len(columns) ** 2 + len(D) * len(columns), 2 * bits, "D'D")
        spend(len(columns) ** 2 * len(D) // 2, bits, bits, "D'D")
        half = [[sum(map(mul, x, y)) for y in columns[: i + 1]] for i, x in enumerate(columns)]
        return D, scale, [[half[max(i, j)][min(i, j)] for j in range(len(half))] for i in range(len(half))]


def check_final_state(doc: Document, structure: Structure, claim: Claim, begin: Begin) -> FinalState:
    """Verify ``Q``, and the final state as ``Q (X(0) - sigma(0))``."""
    given, said, graph = doc.section("final_state"), doc.section("influence"), structure.graph
    if said is None or begin.state is None:
        need(all(state is None for _, state in claim.components), "a final state of a component without one of all")
    if said is None:
        need(given is None, "a final state without the influence of the leaders")
        return FinalState(structure)
    witness = doc.open("final-state", "graph", witness=True)["witness"]
    fields(said, ("components", "containment_weights", "degenerate"), "influence")
    u = None if witness is None else by_agent(doc, graph, fields(witness, ("u",), "the witness")["u"], "u")
    need(u is None or u.positive(), "u is not positive")
    large = said["containment_weights"] is None  # no weights of followers
    left_null_vectors = _left_null_vector(doc, structure, said["components"], large, u)
    weights = [] if large else _weights(structure, said["containment_weights"], u)
    exact = not large and not any(r for row in (*left_null_vectors.values(), *weights) for _, r in row)
    widest = None
    if begin.state is None:
        need(given is None and said["degenerate"] is None, "a final state without an initial state")
    else:
        widest = _final(
            doc, structure, (given, said["degenerate"]), begin, left_null_vectors, None if large else weights, u
        )
        _components(graph, claim, given)
    doc.done(
        "exact"
        if exact
        else "influence of leader groups"
        if widest is None
        else f"enclosed, radius at most {up(widest)}"
    )
    return FinalState(structure, list(left_null_vectors.values()), weights) if exact else FinalState(structure)


def _components(graph: Digraph, claim: Claim, said: Any) -> None:
    """Check the final state of every weak component, which repeats the final state where that is no side vector."""
    for nodes, state in claim.components:
        if len(claim.components) > MANY_COMPONENTS or beside(said.get("mid")):
            need(state is None, "the final state of a component")
        else:
            need(same(state, {graph.labels[v]: said[graph.labels[v]] for v in nodes}), "the final state of a component")


def _worst(nodes: Sequence[int], residuals: Indexed, pushed: Indexed) -> tuple[int, int]:
    """Return ``max_i |r_i| / (M u)_i`` as numerator and denominator; ``M u > 0`` makes ``M`` an M-matrix."""
    worst, least = 0, 1
    for v in nodes:
        need(pushed[v] > 0, "u is no witness")
        if abs(residuals[v]) * least > worst * pushed[v]:
            worst, least = abs(residuals[v]), pushed[v]
    return worst, least


# ---------------------------------------------------------------------- leaders


def _left_null_vector(
    doc: Document, structure: Structure, said: Any, large: bool, u: Numbers | None
) -> dict[int, list[Interval]]:
    """Verify ``eta' M(L_k) = 0``, ``eta'1 = 1`` for every group: exactly, or within the radii."""
    listed, found = [b for b in structure.balanced if len(b[1]) > 1 or not large], {}
    for entry, (k, group, gauge) in zip(entries(said, "components", len(listed)), listed, strict=True):
        fields(entry, ("nodes", "left_null_vector"), "a component")
        need(positions(doc, structure.graph, entry["nodes"], "a component") == group, "another component")
        found[k] = [interval(x) for x in entries(entry["left_null_vector"], "left_null_vector", len(group))]
        _left_null_vector_of(structure.graph, group, [(g * x, r) for g, (x, r) in zip(gauge, found[k], strict=True)], u)
    return found


def _left_null_vector_of(
    graph: Digraph, group: Sequence[int], left_null_vectors: Sequence[Interval], u: Numbers | None
) -> None:
    """Verify the left null vector of one comparison matrix; all in integers."""
    (eta, radii), scale = integers([[x for x, _ in left_null_vectors], [r for _, r in left_null_vectors]])
    left, top = graph.left(group, eta), max(range(len(eta)), key=eta.__getitem__)
    if not any(radii):
        need(sum(eta) == scale, "a left null vector does not sum to 1")
        need(not any(left), "a left null vector is not kept by the motion")
        return
    if u is None or eta[top] <= 0:
        raise RejectedError("no witness of the enclosure")
    each, _ = u.over(group)
    each[top] = 0
    # |exact / exact[top] - eta / eta[top]| <= worst / (least eta[top]) u, since the rest of M is an M-matrix
    worst, least = _worst([i for i in range(len(eta)) if i != top], left, graph.left(group, each))
    middle, width = least * sum(eta), worst * sum(each)
    need(middle > width, "a left null vector is not enclosed")
    for x, y, radius in zip(eta, each, radii, strict=True):
        below, above = least * x - worst * y, least * x + worst * y
        holds = (x - radius) * (middle + width) <= scale * below
        need(holds and scale * above <= (x + radius) * (middle - width), "a left null vector is not enclosed")


# ---------------------------------------------------------------------- followers


def _weights(structure: Structure, said: Any, u: Numbers | None) -> list[list[Interval]]:
    """Verify the columns ``L_F w = -L_FLk G_k 1``: exactly, or by ``|w - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``."""
    graph, F = structure.graph, structure.followers
    said = ordered([graph.labels[v] for v in F], said, "containment_weights")
    weights = [[interval(x) for x in entries(row, "a row", len(structure.balanced))] for row in said.values()]
    rows, each = {v: graph.row(v) for v in F}, dict(zip(F, u.over(F)[0] if u else (), strict=False))
    count, bits = sum(map(len, rows.values())), longest(each.values())
    spend(2 * count, graph.bits, bits, "followers")
    pushed = {
        v: sum(each[j] * (x if j == v else -abs(x)) for j, x in row.items() if j in each) for v, row in rows.items()
    }
    for column, (_, group, gauge) in enumerate(structure.balanced):
        (middles,), scale = integers([[row[column][0] for row in weights]])
        known = {v: g * scale for v, g in zip(group, gauge, strict=True)}  # unbalanced leaders end at 0
        known |= zip(F, middles, strict=True)
        spend(count, graph.bits, longest(known.values()), "followers")
        left = {v: sum(x * known.get(j, 0) for j, x in row.items()) for v, row in rows.items()}
        astray = next((v for v in F if left[v]), None)
        if astray is not None:
            need(u is not None, f"agent {shorten(graph.labels[astray])} is not where its neighbours pull it")
            worst, least = _worst(F, left, pushed)
            error = Fraction(worst, least * scale)
            within = all(error * each[v] <= row[column][1] for v, row in zip(F, weights, strict=True))
            need(within, "followers are not enclosed")
    return weights


# ---------------------------------------------------------------------- final state


def _final(
    doc: Document,
    structure: Structure,
    said: tuple[Any, Any],
    begin: Begin,
    left_null_vectors: Mapping[int, list[Interval]],
    weights: Sequence[Sequence[Interval]] | None,
    u: Numbers | None,
) -> Fraction:
    """Verify where the agents end; return the largest radius that is proved."""
    graph, moved = structure.graph, begin.state or Numbers([])
    if begin.sigma is not None:
        moved = Numbers([x - s for x, s in zip(moved, begin.sigma, strict=True)])
    values = {
        k: combined(left_null_vectors.get(k, ALONE), [(moved[v], Fraction(0)) for v in group])
        for k, group, _ in structure.balanced
    }
    need(all(abs(x) > r or r == 0 for x, r in values.values()), "a value that may or may not be 0")
    need(same(said[1], [k for k, (x, _) in values.items() if x == 0]), "which components meet at 0")
    claimed, spare = _claimed(doc, graph, said[0]), WIDEST * moved.largest()
    proved: dict[int, Interval] = {}
    for k, (group, gauge) in enumerate(zip(structure.closed, structure.gauges, strict=True), start=1):
        x, r = values.get(k, ZERO)
        proved |= {v: (g * x, r) for v, g in zip(group, gauge or [0] * len(group), strict=True)}
    if weights is not None:
        rows = zip(structure.followers, weights, strict=True)
        proved |= {v: combined(row, list(values.values())) for v, row in rows}
    for v, (x, r) in proved.items():
        mid, radius = claimed[0][v], claimed[1][v]
        if x != mid or r != radius:
            need(abs(x - mid) + r <= radius, f"agent {shorten(graph.labels[v])} ends elsewhere")
            narrow = r == radius or radius <= 2 * r + spare
            need(narrow, f"the interval of agent {shorten(graph.labels[v])} is wider than what is proved")
    widest = max(r for _, r in proved.values())
    if weights is None and structure.followers:
        widest = max(widest, _followers(structure, values, claimed, spare, u))
    return widest


def _claimed(doc: Document, graph: Digraph, said: Any) -> tuple[Numbers, Numbers]:
    """Read middles and radii of the final state: two side vectors, or intervals by agent."""
    if isinstance(said, dict) and beside(said.get("mid")):
        fields(said, ("mid", "radius"), "final_state")
        need(beside(said["radius"]), "radius is not a side vector")
        mid, radius = (doc.files.numbers(said[key], key, graph.n) for key in ("mid", "radius"))
        need(all(r >= 0 for r in radius.values), "a radius is negative")
        return mid, radius
    intervals = [interval(x) for x in ordered(graph.labels, said, "final_state").values()]
    return Numbers([x for x, _ in intervals]), Numbers([r for _, r in intervals])


def _followers(
    structure: Structure,
    values: Mapping[int, Interval],
    claimed: tuple[Numbers, Numbers],
    spare: Fraction,
    u: Numbers | None,
) -> Fraction:
    """Verify the followers' part of one final state: ``|x_F - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``.

    All in integers: states over ``grid``, to which values of leaders are rounded where they do not fit, and ``u``
    over another scale. Returns the largest radius that is proved.
    """
    need(u is not None, "no witness of the enclosure")
    F, graph = structure.followers, structure.graph
    (mids, scale), (radii, fine), (U, _) = (numbers.over(F) for numbers in (*claimed, u or Numbers([])))
    exact = {k: x for k, (x, _) in values.items() if len(structure.closed[k - 1]) == 1}
    (own,), other = integers([list(exact.values())])
    grid = math.lcm(scale, other)
    if any(r or grid % x.denominator for k, (x, r) in values.items() if k not in exact):
        grid <<= GRID_BITS
    whole = {k: x * (grid // other) for k, x in zip(exact, own, strict=True)}
    X, R, each = [0] * graph.n, [0] * graph.n, [0] * graph.n
    for v, x, weight in zip(F, mids, U, strict=True):
        X[v], each[v] = x * (grid // scale), weight
    for k, group, gauge in structure.balanced:
        value, r = values[k]
        middle = whole[k] if k in whole else math.floor(value * grid)
        wide = 0 if k in whole else math.ceil(r * grid) + (middle != value * grid)
        for v, g in zip(group, gauge, strict=True):
            X[v], R[v] = g * middle, wide
    blur = graph.heard(R) if any(R) else R
    residuals = [abs(x) + y for x, y in zip(graph.moved(X), blur, strict=True)]
    worst, least = _worst(F, residuals, graph.moved(each, signed=False))
    # The radius that is proved is worst u / (least grid); all over least grid fine
    room, share = math.floor(spare * (least * grid * fine)), least * grid
    for v, told, weight in zip(F, radii, U, strict=True):
        proved, radius = worst * fine * weight, share * told
        if proved > radius or (proved != radius and radius > 2 * proved + room):
            name = shorten(graph.labels[v])
            need(proved <= radius, f"agent {name} ends elsewhere")
            need(False, f"the interval of agent {name} is wider than what is proved")
    return Fraction(worst * max(U), share)


def combined(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that holds the sum of the products."""
    if len(weights) == 1:
        ((a, r),), ((x, s),) = weights, values
        return a * x, abs(a) * s + r * abs(x) + r * s
    (A, R), fine = integers([[a for a, _ in weights], [r for _, r in weights]])
    (X, S), scale = integers([[x for x, _ in values], [s for _, s in values]])
    spend(4 * len(A), longest(A) + longest(R), longest(X) + longest(S), "sums of intervals")
    radius = sum(abs(a) * s + r * abs(x) + r * s for a, r, x, s in zip(A, R, X, S, strict=True)) if any(R + S) else 0
    return Fraction(sum(map(mul, A, X)), fine * scale), Fraction(radius, fine * scale)
