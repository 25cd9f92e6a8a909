"""Verifies the Lyapunov functions of a family: forms, sums of squares, and functions of followers, row by row.

Section 19 of the format. A function of rows belongs to a component with common states at rest, in which the followers
``F`` are heard by nobody else. Parts ``j`` of the others have forms ``V_j`` of rates ``r_j``; agents in no part hear
nobody. With positive ``d`` and ``t_j``, bounds ``e_l^2 >= t_j^2 coordinates_l`` and ``q_p^2 >= t_j^2 inputs_p`` of
pivots ``p``, the square of ``W = max(max_F |xi_k| / d_k, max_j sqrt(V_j) / t_j)`` decays at the rate ``b`` if ``b`` is
at most every ``r_j`` and for every row of ``F`` in every mode

    2 sum_(l in F) |w| (d_k - d_l) + 2 sum_(l not in F) |w| (d_k - e_l) - 2 sum_p |B_kp| q_p  >=  b d_k

at ``w+`` where the bracket is negative, at ``w-`` elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias

from lmi.exact.decimal_rounding import down
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.common_forms import FamilyFunction, FormSection, Scaled, check_form
from ptcc_certify.checker.common_kernel_ends import WeightedMean
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Component, Family, Part
from ptcc_certify.checker.follower_rows import RowSystem, WeightsBetween
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.section_declarations import Nodes, NotNegative, Positive, Several, Vector
from ptcc_certify.checker.weighted_squares import SquaresFunction, SquaresSection, check_squares

#: Lyapunov functions that are read.
MANY_FUNCTIONS = 1000
#: Bits of constants and values, which are rounded up.
BITS = 64


@dataclass(frozen=True, kw_only=True)
class PartSection:
    """A part that followers hear: its form, by what it is divided, and bounds of its agents."""

    nodes: Nodes
    function: FormSection
    times: Positive
    bounds: Several[NotNegative]


@dataclass(frozen=True, kw_only=True)
class RowsSection:
    """What the file says of a function of rows."""

    class_: Literal["rows"]
    component: int
    vector: Vector
    parts: Several[PartSection]
    rate: Fraction


#: What a file says of a function of a family.
FunctionOfFamily: TypeAlias = FormSection | RowsSection | SquaresSection


@dataclass(frozen=True)
class LeadingPart:
    """A part that the followers hear: its form, ``t``, and bounds of its agents, speeds of pivots, times ``W``."""

    function: FamilyFunction
    times: Fraction
    bounds: dict[int, Fraction]


@dataclass(frozen=True)
class FollowerFunction:
    """A function of rows that was verified: ``W^2 <= e^(-rate s) W(0)^2`` for every signal.

    Attributes
    ----------
    component : Component
    vector : dict of int to int
        ``d`` of every follower,
    scale : int
        over this.
    parts : list of LeadingPart
    rate : Fraction
    speeds : list of Scaled
        Bounds of ``|(L X)_k| / W`` for every member.
    """

    component: Component
    vector: dict[int, int]
    scale: int
    parts: list[LeadingPart]
    rate: Fraction
    speeds: list[Scaled]

    @property
    def means(self) -> tuple[WeightedMean, ...]:
        """None."""
        return ()

    @property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / W``, of all agents but pivots and those at rest."""
        pivots = set(self.component.pivots.values())
        led = {v: b for part in self.parts for v, b in part.bounds.items() if v not in pivots}
        (values,), scale = integers([list(led.values())])
        return [(self.vector, Fraction(1, self.scale)), (dict(zip(led, values, strict=True)), Fraction(1, scale))]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``W`` of a state, rounded up."""
        xi, unit = self.component.coordinates(list(self.vector), x)
        roots = [self._share(xi) / unit]
        roots += [part.function.root(x) / part.times for part in self.parts]
        return rounded(max(roots), BITS, up=True)

    def spread(self, sizes: Mapping[int, Fraction]) -> Fraction | None:
        """Return 1, a weighted maximum, if followers hear no groups; None otherwise."""
        return None if self.parts else Fraction(1)

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``W^2`` of all states with ``|x_k| <= sizes_k``, rounded up."""
        xi, unit = self.component.coordinates(list(self.vector), sizes, sizes=True)
        squares = [(self._share(xi) / unit) ** 2]
        squares += [part.function.largest(sizes) / part.times**2 for part in self.parts]
        return rounded(max(squares), BITS, up=True)

    def _share(self, xi: Sequence[int]) -> Fraction:
        """Return the largest ``|xi_k| / d_k``."""
        top, bottom = 0, 1
        for y, d in zip(map(abs, xi), self.vector.values(), strict=True):
            if y * bottom > top * d:
                top, bottom = y, d
        return Fraction(top * self.scale, bottom)


Function = FamilyFunction | FollowerFunction | SquaresFunction


def check_family_functions(doc: Document, family: Family) -> list[Function]:
    """Verify every function, its rates and constants."""
    items = doc.section("decays")
    need(len(items) <= MANY_FUNCTIONS, f"more than {MANY_FUNCTIONS} Lyapunov functions")
    result: list[Function] = []
    for k, entry in enumerate(items):
        doc.at = of = f"decays[{k}]"
        component = family.component(entry.component)
        need(not component.depends, "a Lyapunov function where there is no common kernel")
        if isinstance(entry, RowsSection):
            result.append(check_rows(doc, family, component, entry, of))
        elif isinstance(entry, SquaresSection):
            result.append(check_squares(doc, family, component, entry, of))
        else:
            result.append(check_form(doc, family, component, entry, of))
    return result


def check_rows(doc: Document, family: Family, component: Component, entry: RowsSection, of: str) -> FollowerFunction:
    """Verify a function of rows."""
    need(len(entry.parts) <= MANY_FUNCTIONS, "too many parts of a function")
    number = entry.component
    parts = [_part(doc, family, component, item, f"{of}.parts[{j}]", number) for j, item in enumerate(entry.parts)]
    led = [v for part in parts for v in part.bounds]
    need(len(led) == len(set(led)), "parts of a function share an agent")
    resting = set(component.pivots.values()).difference(led)
    outside = resting.union(led)
    followers = [v for v in component.nodes if v not in outside]
    need(bool(followers), "no followers")
    _closed(component, [set(part.bounds) for part in parts], resting)
    numbers = doc.open("family-rows", of)
    rate = entry.rate
    need(numbers["b"] == rate, "b is not the rate")
    need(all(rate <= part.function.rate for part in parts), "a part that the followers hear is slower")
    vector = doc.files.numbers(entry.vector, "vector", len(followers))
    need(vector.positive(), "the vector is not positive")
    own, scale = vector.over(range(len(followers)))
    pivots = set(component.pivots.values())
    (bounds,), common = integers([[part.bounds[v] for part in parts for v in part.bounds]])
    sized(2 * len(followers), longest(own) + common.bit_length() + scale.bit_length(), "the vector")
    sizes = {v: d * common for v, d in zip(followers, own, strict=True)}
    others = {v: b * scale for v, b in zip(led, bounds, strict=True)}
    speeds = {v: b for v, b in others.items() if v in pivots}
    sizes |= {v: 0 if v in pivots else b for v, b in others.items()} | dict.fromkeys(resting, 0)
    pushes = check_follower_rows(family, component, followers, sizes, speeds, (rate, scale * common))
    doc.done(f"b = {down(rate)}, {len(followers)} rows")
    all_speeds: list[Scaled] = [pushes, (dict.fromkeys(resting, 0), Fraction(1))]
    all_speeds += [(own, unit * part.times) for part in parts for own, unit in part.function.speeds]
    only = {v: sizes[v] for v in followers}
    return FollowerFunction(component, only, scale * common, parts, rate, all_speeds)


def _part(doc: Document, family: Family, component: Component, entry: PartSection, of: str, number: int) -> LeadingPart:
    nodes = positions(doc, family.modes[0].structure.graph, entry.nodes, "nodes of a part")
    inside = set(nodes)
    need(nodes == [v for v in component.nodes if v in inside] and bool(nodes), "nodes of a part")
    kernel = {v: component.kernel[v] for v in nodes}
    pivots = {j: v for j, v in component.pivots.items() if v in inside}
    need(all(j in pivots for row in kernel.values() for j in row), "a part that hears others")
    spend(sum(map(len, component.part.edges)), what="parts of a function")
    edges = [[edge for edge in some if edge[1] in inside] for some in component.part.edges]
    own = Component(Part(nodes, None, edges, component.part.closed), component.behaviour, kernel, pivots)
    function, times = check_form(doc, family, own, entry.function, of), entry.times
    need(entry.function.component == number, "another component of a part")
    need(len(entry.bounds) == len(nodes), f"bounds has not {len(nodes)} entries")
    bounds = dict(zip(nodes, entry.bounds, strict=True))
    leading = set(pivots.values())
    for v, bound in bounds.items():
        c = function.inputs[v] if v in leading else function.coordinates[v]
        need(bound**2 >= times**2 * c, "the bound of an agent of a part is not proved")
    return LeadingPart(function, times, bounds)


def _closed(component: Component, parts: Sequence[set[int]], resting: set[int]) -> None:
    """Verify that agents of a part hear that part alone, and agents at rest nobody."""
    home = dict.fromkeys(resting, -1) | {v: j for j, part in enumerate(parts) for v in part}
    for edges in component.part.edges:
        for s, t, *_ in edges:
            if t in home:
                need(home[t] >= 0 and home.get(s) == home[t], "an agent that is no follower hears others")


def check_follower_rows(
    family: Family,
    component: Component,
    followers: Sequence[int],
    sizes: dict[int, int],
    speeds: dict[int, int],
    aim: tuple[Fraction, int],
) -> Scaled:
    """Verify all rows at the rate ``aim[0]``; return the speeds of followers. Sizes and speeds are over ``aim[1]``."""
    rate, scale = aim
    kernel, unit = component.whole
    drifts = dict.fromkeys(followers, 0)
    spend(2 * component.size, unit.bit_length() + 64, longest(speeds.values()), "rows of a family")
    if any(speeds.values()):
        moving = {j: speeds.get(v, 0) for j, v in component.pivots.items()}
        drifts = {v: sum(abs(b) * moving[j] for j, b in kernel[v].items()) for v in followers}
    p, q = rate.as_integer_ratio()
    pairs = zip(component.part.edges, family.modes, strict=True)
    rows = RowSystem(family.labels, followers, [WeightsBetween(edges, mode.unit) for edges, mode in pairs])
    least = [p * unit * sizes[v] + 2 * q * drifts[v] for v in followers]
    rows.need_rows(sizes, sizes, least, "a row does not decay fast enough", 2 * q * unit)
    most, units = rows.most(sizes, sizes)
    return dict(zip(followers, most, strict=True)), Fraction(1, units * scale)
