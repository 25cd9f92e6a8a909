"""Verifies bounds of agents of order n: what is left at the deadline with a capped gain, and their input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain
from operator import mul

from lmi.exact.decimal_rounding import up
from lmi.exact.elementary_enclosures import exp, rounded
from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.work import spend
from ptcc_certify.checker.agent_model import Agents
from ptcc_certify.checker.common_motion import States
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.final_state import FinalState
from ptcc_certify.checker.input import Verified, check_constants
from ptcc_certify.checker.input_formulas import Limits, root_above
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.matrix_products import Matrix
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.section_declarations import ByAgent, FewAgents, NotNegative, Several
from ptcc_certify.checker.side_files import Numbers

#: Bits to which long numbers are rounded, upwards, before they bound every agent.
BITS = 256
#: Up to ``r clock`` of this size exponentials are formed; beyond it they are not made smaller.
LARGEST_DECAY = 100_000


@dataclass(frozen=True)
class Used:
    """A Lyapunov function that is used.

    Attributes
    ----------
    number : int
        Of ``decays``.
    function : Function
    inputs : list of Fraction or None
        ``c_k`` with ``e_k^2 <= c_k E'P E`` of a full matrix; None: not known, or those of a diagonal one.
    """

    number: int
    function: Function
    inputs: Sequence[Fraction] | None

    def error_constants(self, graph: Digraph) -> Sequence[Fraction] | None:
        """Return ``c_k`` with ``e_k^2 <= c_k V``; None if they are not known."""
        form = self.function.quadratic
        if self.inputs is None and form.coordinates == "eps":
            spend(graph.n + graph.n_edges, 2 * graph.bits, BITS, "constants of the input")
        return self.inputs if self.inputs is not None else form.error_constants(graph.n, graph.rational_row, BITS)


@dataclass(frozen=True, kw_only=True)
class UsedSection:
    """A Lyapunov function that is used, by its number, and constants of a full matrix."""

    function: int
    inputs: FewAgents | None = None


def verify_used(doc: Document, verified: Verified, entry: UsedSection, before: int) -> Used:
    """Return which Lyapunov function is used, after the one of number ``before``, and verify its constants."""
    doc.at = "agents.functions"
    k, functions = entry.function, verified.functions
    need(before < k < len(functions), "functions that are used: none such, or in another order")
    need(functions[k].rate > 0, "a Lyapunov function that is used and does not decay")
    constants = None
    if entry.inputs is not None:
        constants = check_constants(doc, verified.structure.graph, functions[k], k, entry.inputs)
    return Used(k, functions[k], constants)


@dataclass(frozen=True)
class Begin:
    """Where agents begin, and what their Lyapunov functions are worth there.

    Attributes
    ----------
    agents : Agents
    graph : Digraph
    states, offsets : by agent
        ``xi_k(0)`` by coordinate, and ``h_k``.
    """

    agents: Agents
    graph: Digraph
    states: States
    offsets: Sequence[Sequence[Fraction]]

    @cached_property
    def columns(self) -> tuple[list[list[list[int]]], int]:
        """``y(0)`` by coordinate and derivative, a number for each agent; over a scale, and the scale."""
        n, d = self.agents.n, self.agents.d
        pairs = zip(self.states, self.offsets, strict=True)
        axes = ((row, h) for own, at in pairs for row, h in zip(own, at, strict=True))
        rows = [[x - (h if j == 0 else 0) for j, x in enumerate(row)] for row, h in axes]
        whole, scale = integers(rows)
        p, q = (1 / self.agents.eta_0).as_integer_ratio()
        factors = [p**i * q ** (n - 1 - i) for i in range(n)]
        bits = longest(chain.from_iterable(whole)), longest(factors)
        sized(len(whole) * n, sum(bits), "the initial states")
        spend(len(whole) * n, *bits, "the initial states")
        return [[[row[i] * x for row in whole[axis::d]] for i, x in enumerate(factors)] for axis in range(d)], (
            scale * q ** (n - 1)
        )

    @cached_property
    def inverse(self) -> tuple[Matrix, Fraction]:
        """``P = W^-1`` in integers, times a positive number, and that."""
        W, scale = self.agents.scaled_W
        rows, determinant = adjugate(W)
        return rows, Fraction(determinant, scale)

    def value(self, function: Function, at: tuple[list[list[list[int]]], Fraction] | None = None) -> Fraction:
        """Bound ``V = sum_kl Om_kl z_k'P z_l``, summed over the coordinates of space, from above, to many bits.

        At time 0, or of other columns over a scale.
        """
        columns, scale = at or self.columns
        return value_of(self.graph, function, columns, scale, self.inverse)


def value_of(
    graph: Digraph,
    function: Function,
    columns: Sequence[Sequence[Sequence[int]]],
    scale: int | Fraction,
    inverse: tuple[Matrix, Fraction] = ([[1]], Fraction(1)),
) -> Fraction:
    """Bound ``V = sum_kl Om_kl z_k'P z_l`` from above, to many bits, summed over the coordinates of space.

    Of columns over a scale, by coordinate and derivative; ``P`` is told in integers, times a positive number, and that.
    """
    (P, times), form = inverse, function.quadratic
    n, total, unit, own = len(P), 0, 1, 1
    for each in columns:
        Z: list[list[int]] = []
        for x in each:
            z, unit = form.coordinates_of(graph, x)
            Z.append(z)
        U = []
        for z in Z:
            pushed, own = form.times(z)
            U.append(pushed)
        bits = longest(chain.from_iterable(Z)), longest(chain.from_iterable(U))
        spend(n**2 * len(Z[0]), *bits, "initial values")
        spend(n**2, sum(bits), longest(chain.from_iterable(P)), "initial values")
        total += sum(P[i][j] * sum(map(mul, Z[i], U[j])) for i in range(n) for j in range(n))
    return rounded(Fraction(total, own * (scale * unit) ** 2) / times, BITS, up=True)


def adjugate(W: Matrix) -> tuple[Matrix, int]:
    """Return ``det(W) W^-1`` and ``det(W)`` of a positive definite integer matrix, by elimination without fractions."""
    n, before = len(W), 1
    bits = n * longest(chain.from_iterable(W))
    spend(2 * n**3, bits, bits, "the inverse of W")
    rows = [[*row, *(int(i == j) for j in range(n))] for i, row in enumerate(W)]
    for k in range(n):
        own, pivot = rows[k], rows[k][k]
        rows = [
            row if i == k else [(pivot * x - row[k] * y) // before for x, y in zip(row, own, strict=True)]
            for i, row in enumerate(rows)
        ]
        before = pivot
    return [row[n:] for row in rows], before


@dataclass(frozen=True, kw_only=True)
class ResidualSection:
    """How far the clock comes with a capped gain, and what is left of positions, velocities and so on by agent."""

    clock: NotNegative
    agents: ByAgent[Several[Fraction]]


@dataclass(frozen=True, kw_only=True)
class AgentsInput:
    """Bounds of the inputs, and the largest of them."""

    agents: FewAgents
    largest: Fraction


def check_residual(doc: Document, begin: Begin, used: Sequence[Used], section: ResidualSection) -> None:
    """Verify what is left at the deadline with a capped gain, of positions, velocities and so on."""
    doc.open("agent-residual", "agents")
    agents, labels = begin.agents, begin.graph.labels
    clock, cap, numbers = section.clock, agents.cap or Fraction(0), section.agents
    need(clock <= Limits(gain_cap=cap).integrals(agents.gain)[0], "the clock is not proved")
    need(all(len(row) == agents.n for row in numbers), f"derivatives has not {agents.n} entries")
    decay = exp(-min(agents.rate * clock, Fraction(LARGEST_DECAY)))[1]
    powers = [rounded(cap ** (2 * i) * agents.W[i][i] * decay, BITS, up=True) for i in range(agents.n)]
    known = [(use.function.deviation, begin.value(use.function)) for use in used if use.function.deviation is not None]
    for v, row in enumerate(numbers):
        least = min(c[v] * value for c, value in known if c is not None)
        for i, x in enumerate(row):
            holds = x >= 0 and x**2 >= powers[i] * least
            need(holds, f"what is left of agent {shorten(labels[v])} is not proved")
    doc.done(f"positions within {up(max(row[0] for row in numbers))}")


def check_input(
    doc: Document, begin: Begin, used: Sequence[Used], section: AgentsInput, final: FinalState, mu1: Fraction
) -> None:
    """Verify the bound of every agent's input, in Euclidean norm over space; ``mu1`` is 0 without sliding variables."""
    doc.open("agent-input", "agents")
    agents, graph, values = begin.agents, begin.graph, section.agents
    (P, times), gain = begin.inverse, agents.eta_0 if agents.bounded else agents.cap or Fraction(0)
    common = rounded(gain ** (2 * agents.n) * agents.coupling**2 * P[-1][-1] / times, BITS, up=True)
    known = [(c, begin.value(use.function)) for use in used if (c := use.error_constants(graph)) is not None]
    damped = _damping(begin, used, final)
    for v, x in enumerate(values):
        own = abs(agents.plant[0]) * sum(map(abs, begin.offsets[v]), Fraction(0)) + damped[v]
        rest = x - own - mu1 * agents.d
        holds = rest >= 0 and rest**2 >= common * min(c[v] * value for c, value in known)
        need(holds, f"the input of agent {shorten(graph.labels[v])} is not proved")
    need(section.largest == max(values), "the largest input is another")
    doc.done(f"at most {up(max(values))}")


def _damping(begin: Begin, used: Sequence[Used], final: FinalState) -> list[Fraction]:
    """Bound ``eta f_2 |x_k'|`` of every agent that meets others at rest, by the common velocity and its deviation."""
    agents, n, eta = begin.agents, begin.graph.n, begin.agents.eta_0
    if not any(agents.own):
        return [Fraction(0)] * n
    known = [(use.function.deviation, begin.value(use.function)) for use in used if use.function.deviation is not None]
    spend(40 * n * (agents.d + len(known)), BITS, BITS, "the common velocity")
    columns = [[row[axis][1] for row in begin.states] for axis in range(agents.d)]
    speeds = [final.enclosures(final.values(Numbers(column))) for column in columns]
    bounds = []
    for v in range(n):
        away = root_above(agents.W[1][1] * min(c[v] * value for c, value in known))
        along = root_above(sum(((abs(x) + r) ** 2 for x, r in (speed[v] for speed in speeds)), Fraction(0)))
        bounds.append(agents.own[1] * eta * (eta * away + along))
    return bounds
