"""Verifies double integrators that track the velocity of the paper's protocol: section 21 of the format."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import NamedTuple

from lmi.exact.decimal_rounding import down, up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.agent_bounds import BITS, AgentsInput, Used, UsedSection, value_of, verify_used
from ptcc_certify.checker.agent_instants import Halved, check_instants, halvings, largest_value
from ptcc_certify.checker.agent_model import LARGEST_DIMENSION, LONGEST, Cascade, within
from ptcc_certify.checker.common_motion import States, check_ends, need_shape, sized_offsets
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.section_declarations import Ball, ByAgent, Positive, Several


@dataclass(frozen=True, kw_only=True)
class TrackedSection(UsedSection):
    """A Lyapunov function that is used, and what it is worth at the beginning."""

    initial: Fraction | None = None
    drive: Fraction | None = None


@dataclass(frozen=True, kw_only=True)
class CascadeSection:
    """What the file says of double integrators that track the velocity of the paper's protocol."""

    cascade: Positive
    dimension: int
    functions: Several[TrackedSection]
    offsets: ByAgent[Several[Fraction]]
    initial_state: ByAgent[Several[Several[Fraction]]] | None = None
    motion: Several[Several[Ball]]
    final_state: ByAgent[Several[Several[Ball]]] | None = None
    input: AgentsInput | None = None


class Vectors(NamedTuple):
    """A number of every agent in each coordinate of space, in integers over a scale."""

    columns: Sequence[Sequence[int]]
    scale: int | Fraction

    def value(self, graph: Digraph, function: Function) -> Fraction:
        """Bound ``V``, summed over the coordinates of space, from above, to many bits."""
        return value_of(graph, function, [[x] for x in self.columns], self.scale)


class Drive(NamedTuple):
    """Positions less places ``x(0)``, what drives them, ``q(0) = v(0) + eta(0) L x(0)``, and velocities ``v(0)``."""

    positions: Vectors
    error: Vectors
    velocities: Vectors

    def combined(self, agents: Cascade) -> Vectors:
        """Return ``r(0) = v(0)/eta(0) + (alpha + theta) x(0)``."""
        (p, q), (a, c) = agents.eta_0.as_integer_ratio(), agents.pull(Fraction(1)).as_integer_ratio()
        X, V = self.positions, self.velocities
        numbers = list(chain.from_iterable(chain(X.columns, V.columns)))
        sized(len(numbers), longest(numbers) + longest((p, q)) + longest((a, c)), "the input")
        spend(4 * len(numbers), longest(numbers) + longest((p, q)), longest((a, c)), "the input")
        pairs = zip(X.columns, V.columns, strict=True)
        columns = [[q * c * y + p * a * z for z, y in zip(x, v, strict=True)] for x, v in pairs]
        return Vectors(columns, X.scale * p * c)


class Tracked(NamedTuple):
    """A Lyapunov function that is used; not below ``sqrt(V)`` of initial positions, and of ``q(0)``."""

    use: Used
    initial: Fraction
    drive: Fraction


def check_cascade(doc: Document, verified: Verified) -> bool:
    """Verify the section ``agents`` of the cascade; return whether agreement and where it happens were proved."""
    section, graph = doc.section("agents"), verified.structure.graph
    alpha, d = section.cascade, within("dimension", section.dimension, LARGEST_DIMENSION)
    gain = verified.gain
    longest_number = length((alpha, gain.T, gain.rho1, gain.k))
    need(longest_number <= LONGEST, f"agents: a number of {longest_number} bits; {LONGEST} are taken")
    agents = Cascade(2, d, (Fraction(0),) * 2, (Fraction(0), alpha), None, gain)
    offsets, states = sized_offsets(section.offsets, agents), section.initial_state
    need_shape(states, "initial_state", agents)
    drive = None if states is None else drive_of(graph, agents, states, offsets)
    used = _functions(doc, verified, section, drive)
    rests = not graph.listening or any(one.use.function.rate * gain.k > 2 for one in used)
    proved = check_ends(doc, agents, verified.final, section, bool(used), 1 + rests)
    doc.at = "agents.input"
    if section.input is not None:
        need(drive is not None, "a bound of the input without initial states")
        if drive is not None:
            _check_input(doc, verified, agents, used, drive, section.input)
    if "instants" in doc:
        need(states is not None, "instants without initial states")

        def least(k: int, at: Halved, remaining: Fraction) -> tuple[Fraction, Fraction]:
            return roots_above(graph, agents, used[k].use.function, at, remaining)

        check_instants(doc, halvings_of(graph, agents, states or (), offsets), len(used), 2, least)
    return proved


def drive_of(graph: Digraph, agents: Cascade, states: States, offsets: Sequence[Sequence[Fraction]]) -> Drive:
    """Return what the motion begins with, in integers."""
    longest_state = length(x for part in (*states, offsets) for row in part for x in row)
    spend(40 * agents.d * graph.n, longest_state, longest_state, "the initial states")
    pairs = [(row, h) for own, at in zip(states, offsets, strict=True) for row, h in zip(own, at, strict=True)]
    (X, V), scale = integers([[row[0] - h for row, h in pairs], [row[1] for row, _ in pairs]])
    p, q = agents.eta_0.as_integer_ratio()
    sized(len(X), scale.bit_length() + longest(chain(X, V)) + graph.bits + longest((p, q)), "the initial states")
    axes, unit = range(agents.d), graph.unit
    positions, velocities = ([part[axis :: agents.d] for axis in axes] for part in (X, V))
    errors = list[list[int]]()
    for x, v in zip(positions, velocities, strict=True):
        spend(2 * graph.n, longest(x) + graph.bits + longest((unit, p, q)), longest((p, q)), "the initial states")
        errors.append([q * unit * y + p * z for y, z in zip(v, graph.laplacian_product(x), strict=True)])
    return Drive(Vectors(positions, scale), Vectors(errors, scale * q * unit), Vectors(velocities, scale))


def _functions(doc: Document, verified: Verified, section: CascadeSection, drive: Drive | None) -> list[Tracked]:
    """Return which Lyapunov functions are used, and verify what they are worth at the beginning."""
    graph, read = verified.structure.graph, list[tuple[Used, TrackedSection]]()
    for entry in section.functions:
        before = read[-1][0].number if read else -1
        read.append((verify_used(doc, verified, entry, before), entry))
    numbers = doc.open("agent-cascade", "agents")
    need(numbers["alpha"] == section.cascade, "alpha is another than that of the cascade")
    used = list[Tracked]()
    for use, entry in read:
        roots = [entry.initial, entry.drive]
        need(all((x is None) == (drive is None) for x in roots), "initial values are told iff there are initial states")
        bits = length(x for x in roots if x is not None)
        spend(4, bits, bits, "initial values")
        for x, of, what in zip(roots, drive or (), ("initial positions", "initial drive"), strict=False):
            holds = x is not None and x >= 0 and x**2 >= of.value(graph, use.function)
            need(holds, f"the value of function {use.number} of the {what} is not proved")
        used.append(Tracked(use, *(x or Fraction(0) for x in roots)))
    doc.done(f"alpha = {down(numbers['alpha'])}, {len(used)} Lyapunov functions")
    return used


def input_is_bounded(k: Fraction, rate: Fraction, alpha: Fraction) -> bool:
    """Tell whether the input is proved not to grow without limit: ``b k >= 2``, ``alpha k >= 1``.

    Not with both as equations: then its bound grows like ``s``.

    Examples
    --------
    >>> [input_is_bounded(Fraction(1), Fraction(r), Fraction(a)) for r, a in ((4, 1), (5, 1), (4, 2), (3, 9))]
    [False, True, True, False]
    """
    return rate * k >= 4 and alpha * k >= 1 and rate * k + alpha * k > 5


def input_size(agents: Cascade, rate: Fraction, state: Fraction, combined: Fraction) -> Fraction:
    """Return what, times ``sqrt(c_k)``, bounds an input but for ``alpha eta(0) |v_k|``, to many bits from above.

    From ``sqrt(V)`` of the initial positions and of ``r(0)``, of a function by which the input is bounded.
    """
    k, alpha, eta = agents.gain.k, agents.own[1], agents.eta_0
    a, b, theta = alpha - 1 / k, rate / 2 - 2 / k, agents.pull(Fraction(1)) - alpha
    most = max(Fraction(1), (a + alpha) / (a + b))
    return rounded(eta**2 * (combined + (1 / k - theta) * state) * most, BITS, up=True)


def _check_input(
    doc: Document, verified: Verified, agents: Cascade, used: Sequence[Tracked], drive: Drive, section: AgentsInput
) -> None:
    """Verify the bound of every agent's input, in Euclidean norm over space."""
    graph, alpha, eta = verified.structure.graph, agents.own[1], agents.eta_0
    combined = drive.combined(agents)
    bounds = list[list[Fraction]]()
    for one in used:
        rate, constants = one.use.function.rate, one.use.error_constants(graph)
        if constants is not None and input_is_bounded(agents.gain.k, rate, alpha):
            size = input_size(agents, rate, one.initial, root_above(combined.value(graph, one.use.function)))
            spend(40 * graph.n, BITS, BITS, "the input")
            bounds.append([root_above(c) * size for c in constants])
    need(bool(bounds), "a bound of the input though no function and no alpha bound it")
    doc.open("agent-input", "agents")
    values = section.agents
    added = (verified.protocol.gains["mu1"] if verified.protocol.sliding else Fraction(0)) * agents.d
    columns, scale = drive.velocities
    bits = longest(chain.from_iterable(columns))
    spend(agents.d * graph.n, bits, bits, "the input")
    for v, x in enumerate(values):
        speed = root_above(Fraction(sum(column[v] ** 2 for column in columns), scale**2))
        least = min(each[v] for each in bounds) + alpha * eta * speed
        need(x >= least + added, f"the input of agent {shorten(graph.labels[v])} is not proved")
    need(section.largest == max(values), "the largest input is another")
    doc.done(f"at most {up(max(values))}")


def halvings_of(
    graph: Digraph, agents: Cascade, states: States, offsets: Sequence[Sequence[Fraction]]
) -> Iterator[Halved]:
    """Yield where agents are at instants ``T (1 - 2^-i)``, ``i = 1, 2, ..``; every entry of ``y`` is off by ``off``.

    A push of size 1, of ``y`` or of its slope, moves ``X' + L X`` by ``1 + |L|`` at most, which falls like
    ``e^(-alpha s)``, and ``X' = -L X + ..`` does not expand the largest entry: so it moves ``X`` by ``1 + (1 +
    |L|)/alpha``, and the other entry of ``y``, ``X'``, by ``|L|`` times that and ``1 + |L|``.
    """
    reach = 1 + Fraction(2 * max(graph.diagonal), graph.unit)
    most = rounded(reach * (2 + reach / agents.own[1]), BITS, up=True)
    for at in halvings(agents, graph.laplacian_product, graph.unit, states, offsets):
        yield at._replace(off=rounded(at.off * most, BITS, up=True))


def roots_above(
    graph: Digraph, agents: Cascade, function: Function, at: Halved, remaining: Fraction
) -> tuple[Fraction, Fraction]:
    """Bound ``sqrt(V)`` of positions less places, and of ``r = X' + g X``, at an instant from above."""
    g = agents.pull(remaining)
    a, c = g.as_integer_ratio()
    columns = list(chain.from_iterable(chain.from_iterable(at.columns)))
    spend(2 * len(columns), longest(columns), longest((a, c)), "agents at an instant")
    positions = Vectors([x for x, _ in at.columns], at.scale)
    combined = [[c * v + a * y for y, v in zip(*rows, strict=True)] for rows in at.columns]
    spread = root_above(largest_value(graph, function)) * at.off
    roots = [root_above(each.value(graph, function)) for each in (positions, Vectors(combined, at.scale * c))]
    return roots[0] + spread, roots[1] + (1 + g) * spread
