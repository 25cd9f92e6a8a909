"""Verifies where the agents end: left null vectors of leader groups, weights of followers, the final state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import chain
from operator import mul
from typing import Any

from lmi.exact.decimal_rounding import up
from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.matrix_products import Matrix, need_rows
from ptcc_certify.checker.protocol import Begin
from ptcc_certify.checker.reading import Interval, RejectedError, length, need, same
from ptcc_certify.checker.section_declarations import Agents, Ball, ByFollower, Ends, Nodes, Several
from ptcc_certify.checker.side_files import Numbers, beside
from ptcc_certify.checker.structure import MANY_COMPONENTS, Claim, Structure

#: An interval may be wider than twice what is proved by this share of the largest entry of the initial state.
WIDEST = Fraction(1, 10**6)
#: Bits to which the values of leader groups are rounded, beyond the common scale of states, in the large form.
GRID_BITS = 128
ZERO = Fraction(0), Fraction(0)


@dataclass(frozen=True, eq=False)
class FinalState:
    """The matrix ``Q`` that takes the begin to the final state.

    Attributes
    ----------
    structure : Structure
    left_null_vectors : mapping of int to (list of Interval)
        ``eta_k' G_k`` of balanced closed components by number; in the large form of those of two nodes or more.
    weights : list of (list of Interval), or None
        Of each follower on these components; None: not known, or the large form.
    u : Numbers or None
        The witness: positive by node, ``M(L_F) u > 0``.
    """

    structure: Structure
    left_null_vectors: Mapping[int, Sequence[Interval]]
    weights: Sequence[Sequence[Interval]] | None = None
    u: Numbers | None = None

    @cached_property
    def exact(self) -> bool:
        """Whether ``Q`` is known exactly."""
        rows = (*self.left_null_vectors.values(), *(self.weights or ()))
        return self.weights is not None and not any(r for row in rows for _, r in row)

    @cached_property
    def scaled_u(self) -> list[int]:
        """``u`` on the followers, times a scale; 0 without a witness."""
        F = self.structure.followers
        return self.u.over(F)[0] if self.u is not None else [0] * len(F)

    @cached_property
    def pushed(self) -> list[int]:
        """``M(L_F) u`` on the followers, times the scales of ``u`` and ``L``."""
        graph = self.structure.graph
        each = dict(zip(self.structure.followers, self.scaled_u, strict=True))
        return graph.laplacian_product([each.get(v, 0) for v in range(graph.n)], signed=False)

    def error(self, residuals: Sequence[int] | Mapping[int, int]) -> tuple[int, int]:
        """Return ``e = max_i |r_i| / (M(L_F) u)_i`` as numerator and denominator; 0 where nothing is left over.

        ``r`` is what ``L_F`` leaves of some states: these are off by at most ``e scaled_u``.
        """
        labels, F = self.structure.graph.labels, self.structure.followers
        astray = next((v for v in F if residuals[v]), None)
        if astray is None:
            return 0, 1
        need(self.u is not None, f"agent {shorten(labels[astray])} is not where its neighbours pull it")
        return _worst(F, residuals, self.pushed)

    def values(self, x: Numbers) -> dict[int, Interval]:
        """Enclose ``eta_k' G_k x`` of every balanced closed component, by its number."""
        vectors, values = self.left_null_vectors, {}
        for k, group, _ in self.structure.balanced:
            states = [(x[v], Fraction(0)) for v in group]
            values[k] = combined(vectors[k], states) if k in vectors else states[0]
        return values

    def enclosures(self, values: Mapping[int, Interval]) -> dict[int, Interval]:
        """Enclose ``Q x`` by node from its values of the components; in the large form on the leaders alone."""
        structure, result = self.structure, dict[int, Interval]()
        for k, (group, gauge) in enumerate(zip(structure.closed, structure.gauges, strict=True), start=1):
            x, r = values.get(k, ZERO)
            result |= {v: (g * x, r) for v, g in zip(group, gauge or [0] * len(group), strict=True)}
        if self.weights is not None:
            rows = zip(structure.followers, self.weights, strict=True)
            result |= {v: combined(row, list(values.values())) for v, row in rows}
        return result

    def check_followers(
        self, values: Mapping[int, Interval], intervals: tuple[Numbers, Numbers], spare: Fraction | None = None
    ) -> Fraction:
        """Verify intervals of the followers in the large form: ``|x_F - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``.

        All in integers: states over ``grid``, to which values of components are rounded where they do not fit, and
        ``u`` over another scale. Returns the largest radius that is proved.

        Parameters
        ----------
        values : mapping of int to Interval
            Of every balanced closed component.
        intervals : (Numbers, Numbers)
            Middles and radii, by agent.
        spare : Fraction, optional
            How much wider than twice what is proved they may be; None: as wide as they like.
        """
        structure, graph, F = self.structure, self.structure.graph, self.structure.followers
        (mids, scale), (radii, fine) = (numbers.over(F) for numbers in intervals)
        wide = {k for k, (_, r) in values.items() if r or k in self.left_null_vectors}
        single = {group[0]: values[k][0] for k, group, _ in structure.balanced if k not in wide}
        (own,), other = integers([list(single.values())])
        grid = math.lcm(scale, other)
        if any(r or grid % x.denominator for x, r in map(values.__getitem__, wide)):
            grid <<= GRID_BITS
        middles = {v: x * (grid // scale) for v, x in zip(F, mids, strict=True)}
        middles |= {v: x * (grid // other) for v, x in zip(single, own, strict=True)}
        blurs: dict[int, int] = {}
        for k, group, gauge in structure.balanced:
            if k in wide:
                value, r = values[k]
                middle = math.floor(value * grid)
                middles |= {v: g * middle for v, g in zip(group, gauge, strict=True)}
                blurs |= dict.fromkeys(group, math.ceil(r * grid) + (middle != value * grid))
        X, R = ([states.get(v, 0) for v in range(graph.n)] for states in (middles, blurs))
        blur = graph.sums_in(R) if any(R) else R
        worst, least = self.error([abs(x) + y for x, y in zip(graph.laplacian_product(X), blur, strict=True)])
        # The radius that is proved is worst scaled_u / (least grid); all over least grid fine
        share = least * grid
        room = None if spare is None else math.floor(spare * (share * fine))
        for v, radius, weight in zip(F, radii, self.scaled_u, strict=True):
            _narrow(graph.labels[v], 0, worst * fine * weight, share * radius, room)
        return Fraction(worst * max(self.scaled_u, default=0), share)

    @cached_property
    def projection(self) -> list[dict[int, Fraction]]:
        """The rows of ``Q``, which are exact."""
        need(self.exact, "a deviation from a final state that is not exact")
        n, left_null_vectors, rows = self.structure.graph.n, self.left_null_vectors, self.weights or ()
        need_rows(n)
        bits = sum(2 * length(x for row in part for x, _ in row) for part in (left_null_vectors.values(), rows))
        count = n * sum(len(group) for _, group, _ in self.structure.balanced)
        sized(count, bits, "the weights of leaders")
        spend(count, bits, bits, "the weights of leaders")
        Q: list[dict[int, Fraction]] = [{} for _ in range(n)]
        for column, (k, group, gauge) in enumerate(self.structure.balanced):
            weights = {v: Fraction(g) for v, g in zip(group, gauge, strict=True)}
            weights |= {v: row[column][0] for v, row in zip(self.structure.followers, rows, strict=True)}
            for v, weight in weights.items():
                if weight:
                    Q[v] |= {j: weight * x for j, (x, _) in zip(group, left_null_vectors[k], strict=True)}
        return Q

    @cached_property
    def deviations(self) -> tuple[Matrix, int]:
        """``D = I - Q`` on the columns ``free_nodes``, times a scale; the scale."""
        rows, zero = deviation_rows(self.projection), Fraction(0)
        return integers([[row.get(v, zero) for v in self.structure.free_nodes] for row in rows])

    @cached_property
    def gram(self) -> Matrix:
        """``D'D``, times the scale of :attr:`deviations` squared."""
        D, _ = self.deviations
        columns, bits = list(zip(*D, strict=True)), longest(x for row in D for x in row)
        sized(len(columns) ** 2 + len(D) * len(columns), 2 * bits, "D'D")
        spend(len(columns) ** 2 * len(D) // 2, bits, bits, "D'D")
        half = [[sum(map(mul, x, y)) for y in columns[: i + 1]] for i, x in enumerate(columns)]
        return [[half[max(i, j)][min(i, j)] for j in range(len(half))] for i in range(len(half))]


def deviation_rows(projection: Sequence[Mapping[int, Fraction]]) -> list[dict[int, Fraction]]:
    """Return the rows of ``I - Q`` from those of ``Q``.

    Examples
    --------
    >>> deviation_rows([{}, {0: Fraction(1, 2)}])
    [{0: Fraction(1, 1)}, {0: Fraction(-1, 2), 1: Fraction(1, 1)}]
    """
    zero = Fraction(0)
    return [{j: (i == j) - row.get(j, zero) for j in sorted({i, *row})} for i, row in enumerate(projection)]


@dataclass(frozen=True, kw_only=True)
class LeftNullVector:
    """The left null vector of a balanced leader group."""

    nodes: Nodes
    left_null_vector: Several[Ball]


@dataclass(frozen=True, kw_only=True)
class InfluenceSection:
    """Left null vectors, containment weights unless the graph is large, and which groups meet at 0."""

    components: Several[LeftNullVector]
    containment_weights: ByFollower[Several[Ball]] | None = None
    degenerate: Several[int] | None = None


@dataclass(frozen=True, kw_only=True)
class AgentsVector:
    """The witness of what is enclosed: a positive number of every agent."""

    u: Agents


@dataclass(frozen=True, kw_only=True)
class FormationSection:
    """The places of agents in a formation, and where they begin and end."""

    offsets: Agents
    initial_state: Agents | None = None
    final_state: Ends | None = None


def check_final_state(doc: Document, structure: Structure, claim: Claim, begin: Begin) -> FinalState:
    """Verify ``Q``, and the final state as ``Q (X(0) - sigma(0))``."""
    graph, final_state = structure.graph, doc.section("final_state")
    influence = doc.section("influence")
    if influence is None or begin.state is None:
        without = "the influence of the leaders" if influence is None else "an initial state"
        need(final_state is None, f"a final state without {without}")
        need(all(state is None for _, state in claim.components), "a final state of a component without one of all")
    if influence is None:
        return FinalState(structure, {})
    witness = doc.open("final-state", "graph")["witness"]
    u = None if witness is None else witness.u
    need(u is None or u.positive(), "u is not positive")
    weights = influence.containment_weights
    large = weights is None  # no weights of followers
    final = FinalState(structure, _left_null_vectors(doc, structure, influence.components, large, u), None, u)
    if weights is not None:
        final = replace(final, weights=_weights(final, weights))
    detail = "influence of leader groups"
    if begin.state is None:
        need(influence.degenerate is None, "a final state without an initial state")
    else:
        detail = f"enclosed, radius at most {up(_final(final, final_state, influence.degenerate, begin))}"
        _components(graph, claim, doc.data.get("final_state"))
    doc.done("exact" if final.exact else detail)
    return final


def _components(graph: Digraph, claim: Claim, final_state: Any) -> None:
    """Check the final state of every weak component, which repeats the final state where that is no side vector."""
    for nodes, state in claim.components:
        if len(claim.components) > MANY_COMPONENTS or beside(final_state.get("mid")):
            need(state is None, "the final state of a component")
        else:
            need(
                same(state, {graph.labels[v]: final_state[graph.labels[v]] for v in nodes}),
                "the final state of a component",
            )


def _worst(
    nodes: Sequence[int], residuals: Sequence[int] | Mapping[int, int], pushed: Sequence[int]
) -> tuple[int, int]:
    """Return ``max_i |r_i| / (M u)_i`` as numerator and denominator; ``M u > 0`` makes ``M`` an M-matrix."""
    worst, least = 0, 1
    for v in nodes:
        need(pushed[v] > 0, "u is no witness")
        if abs(residuals[v]) * least > worst * pushed[v]:
            worst, least = abs(residuals[v]), pushed[v]
    return worst, least


# ---------------------------------------------------------------------- leaders


def _left_null_vectors(
    doc: Document, structure: Structure, section: Sequence[LeftNullVector], large: bool, u: Numbers | None
) -> dict[int, list[Interval]]:
    """Verify ``eta' M(L_k) = 0``, ``eta'1 = 1`` for every group: within the radii, which may be 0."""
    groups, vectors = [b for b in structure.balanced if len(b[1]) > 1 or not large], {}
    need(len(section) == len(groups), f"components has not {len(groups)} entries")
    for entry, (k, group, gauge) in zip(section, groups, strict=True):
        need(positions(doc, structure.graph, entry.nodes, "a component") == group, "another component")
        need(len(entry.left_null_vector) == len(group), f"left_null_vector has not {len(group)} entries")
        vectors[k] = list(entry.left_null_vector)
        _left_null_vector(structure.graph, group, [(g * x, r) for g, (x, r) in zip(gauge, vectors[k], strict=True)], u)
    return vectors


def _left_null_vector(graph: Digraph, group: Sequence[int], intervals: Sequence[Interval], u: Numbers | None) -> None:
    """Verify the left null vector of one comparison matrix; all in integers."""
    (eta, radii), scale = integers([[x for x, _ in intervals], [r for _, r in intervals]])
    residuals, top = graph.left_product(group, eta), max(range(len(eta)), key=eta.__getitem__)
    worst, least, each = 0, 1, [0] * len(eta)
    need(eta[top] > 0, "a left null vector is not positive")
    if any(residuals):
        if u is None:
            raise RejectedError("a left null vector is not kept by the motion")
        each = [0 if i == top else x for i, x in enumerate(u.over(group)[0])]
        # |exact / exact[top] - eta / eta[top]| <= worst / (least eta[top]) u, since the rest of M is an M-matrix
        worst, least = _worst([i for i in range(len(eta)) if i != top], residuals, graph.left_product(group, each))
    middle, width = least * sum(eta), worst * sum(each)
    need(middle > width, "a left null vector is not enclosed")
    for x, y, radius in zip(eta, each, radii, strict=True):
        below, above = least * x - worst * y, least * x + worst * y
        holds = (x - radius) * (middle + width) <= scale * below
        need(holds and scale * above <= (x + radius) * (middle - width), "a left null vector is not enclosed")


# ---------------------------------------------------------------------- followers


def _weights(final: FinalState, weights: Sequence[Sequence[Interval]]) -> Sequence[Sequence[Interval]]:
    """Verify the columns ``L_F w = -L_FLk G_k 1``, within the radii; leaders of other components are at 0."""
    structure, graph, F = final.structure, final.structure.graph, final.structure.followers
    count = len(structure.balanced)
    need(all(len(row) == count for row in weights), f"a row has not {count} entries")
    rows = {v: graph.row(v) for v in F}
    for column, (_, group, gauge) in enumerate(structure.balanced):
        (middles,), scale = integers([[row[column][0] for row in weights]])
        states = dict(zip((*F, *group), (*middles, *(g * scale for g in gauge)), strict=True))
        spend(sum(map(len, rows.values())), graph.bits, longest(states.values()), "followers")
        worst, least = final.error({v: sum(x * states.get(j, 0) for j, x in row.items()) for v, row in rows.items()})
        error = Fraction(worst, least * scale)
        within = all(error * x <= row[column][1] for x, row in zip(final.scaled_u, weights, strict=True))
        need(within, "followers are not enclosed")
    return weights


# ---------------------------------------------------------------------- final state


def _final(
    final: FinalState, intervals: tuple[Numbers, Numbers] | None, degenerate: Sequence[int] | None, begin: Begin
) -> Fraction:
    """Verify where the agents end; return the largest radius that is proved."""
    structure, shifted = final.structure, begin.state or Numbers([])
    if begin.sigma is not None:
        shifted = Numbers([x - s for x, s in zip(shifted, begin.sigma, strict=True)])
    values = final.values(shifted)
    need(all(abs(x) > r or r == 0 for x, r in values.values()), "a value that may or may not be 0")
    need(degenerate == [k for k, (x, _) in values.items() if x == 0], "which components meet at 0")
    spare, enclosures = WIDEST * shifted.largest(), final.enclosures(values)
    if intervals is None:
        raise RejectedError("no final state, though there is an initial state")
    for v, (x, r) in enclosures.items():
        mid, radius = intervals[0][v], intervals[1][v]
        if x != mid or r != radius:
            _narrow(structure.graph.labels[v], abs(x - mid), r, radius, spare)
    widest = max(r for _, r in enclosures.values())
    return widest if final.weights is not None else max(widest, final.check_followers(values, intervals, spare))


def _narrow(label: str, off: Any, error: Any, radius: Any, spare: Any) -> None:
    """Verify that a radius takes in what is proved, off the middle, and unless it may be wider, not much more."""
    if off + error > radius:
        raise RejectedError(f"agent {shorten(label)} ends elsewhere")
    if spare is not None and radius > 2 * error + spare:
        raise RejectedError(f"the interval of agent {shorten(label)} is wider than what is proved")


def check_formation(doc: Document, begin: Begin, of_family: bool = False) -> None:
    """Verify that agents of a formation begin where the rest of the document tells, and their places added.

    Of one graph that they end there, too; of a family this is left to the reader.
    """
    if "formation" not in doc:
        return
    need("agents" not in doc, "a formation beside that of agents of order n")
    section, end = doc.section("formation"), None if of_family else doc.sections["final_state"]
    told = (section.initial_state, begin.state), (section.final_state, end)
    need(all((x is None) == (y is None) for x, y in told), "positions are told iff states are")
    none = Numbers([])
    parts = section.offsets, begin.state or none, section.initial_state or none
    known = [list(part) for part in (*parts, *(end or (none, none)), *(section.final_state or (none, none)))]
    bits = length(chain.from_iterable(known))
    spend(8 * len(section.offsets), bits, bits, "a formation")
    h, x, y, mid, r, middle, radius = known
    need(all(a + b == c for a, b, c in zip(x, h, y, strict=False)), "an agent of the formation begins elsewhere")
    ends = zip(mid, h, r, middle, radius, strict=False)
    need(all(abs(a + b - c) + s <= t for a, b, s, c, t in ends), "an agent of the formation ends elsewhere")


def combined(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that holds the sum of the products."""
    (A, R), fine = integers([[a for a, _ in weights], [r for _, r in weights]])
    (X, S), scale = integers([[x for x, _ in values], [s for _, s in values]])
    spend(4 * len(A), longest(A) + longest(R), longest(X) + longest(S), "sums of intervals")
    radius = sum(abs(a) * s + r * abs(x) + r * s for a, r, x, s in zip(A, R, X, S, strict=True))
    return Fraction(sum(map(mul, A, X)), fine * scale), Fraction(radius, fine * scale)
