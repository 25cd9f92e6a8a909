"""Verifies the delay LMI: a quadratic Lyapunov function that forgives late messages under a capped gain.

On the clock ``ds = g dt`` agents obey ``x' = -F``, ``F = L x - p``, ``p_k = sum_e w_e rho_e`` over the late edges
``e = (l, k)`` into ``k``; ``rho_e`` is the integral of ``m_e'F`` over the time that the message is late, at most
``h_e``. ``m_e'F`` is ``F_l``, or ``F_l - sgn(w_e) F_k`` where the own state is late as well. With ``xi = x_free -
R x_first``, ``L R = 0``, it is ``xi' = -A xi + C p``; with ``c_e >= h_e (e^(2 b h_e) - 1)/(2 b)``, ``Z = [L_free, -I]``

    N = [[P A + A'P - 2 b P,  -P C],  [-C'P,  diag(T)]] - Z' (sum_e tau_e c_e m_e m_e') Z - [0, Q_first]'[0, Q_first]

if definite, says ``V' + 2 b V <= sum_e tau_e (rho_e^2 - c_e (m_e'F)^2) - |Q_first p|^2`` of ``V = xi'P xi``, since
``T_k p_k^2 <= sum_e tau_e rho_e^2`` for ``1/T_k = sum_e w_e^2/tau_e``. Times ``e^(2 b s)`` the sum has an integral that
is not positive, for ``F = 0`` before 0: ``V(s) <= e^(-2 b s) V(0)``, and that of ``e^(2 b s) |Q_first p|^2`` is at most
``V(0)``.

Where values are off by ``nu``, ``p_k`` holds ``D_k rho_k`` besides, ``|rho_k| <= nu``, and ``1/T_k`` ``D_k^2/tau_k``.
What that makes of agents that begin at rest is added: ``V <= f^2 = nu^2 sum_k tau_k/(2 b)``, and since the matrix is
definite with 0 for ``b``, too, the integral of ``|Q_first p|^2`` up to ``s`` is at most ``2 b s f^2``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain
from typing import NamedTuple

from lmi.exact.decimal_rounding import down
from lmi.exact.definite import Arithmetic
from lmi.exact.elementary_enclosures import exp, rounded
from lmi.exact.numbers import integers, longest
from lmi.exact.work import spend
from ptcc_certify.checker.delayed_forms import need_left_at_deadline
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import combination
from ptcc_certify.checker.final_state import deviation_rows
from ptcc_certify.checker.graph import proved_above
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.input_formulas import BITS, root_above
from ptcc_certify.checker.matrix_products import Matrix, Sparse, need_rows, quadratic, times
from ptcc_certify.checker.message_ages import LARGEST_GROWTH, PARTS, Messages
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import FewAgents, NotNegative, Several, Triangle
from ptcc_certify.checker.stated_bounds import DecayOfAll

Row = dict[int, Fraction]
#: How often the bounds of ``|F_k|`` are put into themselves.
ROUNDS = 8


class Channel(NamedTuple):
    """A late edge."""

    edge: int  #: its number
    source: int
    listener: int
    weight: int  #: times the unit
    lateness: Fraction  #: on the clock, at most


class AgentConstants(NamedTuple):
    """Bounds by agent."""

    away: list[Fraction]  #: of ``|x_k - (Q x)_k|`` over ``sqrt(V)``
    slope: list[Fraction]  #: of ``|(L x)_k|`` over ``sqrt(V)``
    walk: list[Fraction]  #: of how far ``(Q x)_k`` ever moves, over ``sqrt(V(0))``


@dataclass(frozen=True, eq=False)
class LateLoop:
    """A graph with late messages.

    Attributes
    ----------
    laplacian : sequence of dict of int to int
        Rows of ``L``, times ``unit``, without zeros.
    unit : int
    projection : list of dict of int to Fraction
        Rows of ``Q``.
    free : list of int
        All nodes but the first one of each balanced closed component.
    channels : list of Channel
    own_late : bool
    wrong : list of int
        The agents that hear values that are off.
    """

    laplacian: Sequence[dict[int, int]]
    unit: int
    projection: Sequence[Mapping[int, Fraction]]
    free: Sequence[int]
    channels: Sequence[Channel]
    own_late: bool
    wrong: Sequence[int] = ()

    @cached_property
    def first(self) -> list[int]:
        """The nodes that are not free."""
        free = set(self.free)
        return [v for v in range(len(self.laplacian)) if v not in free]

    @cached_property
    def place(self) -> dict[int, int]:
        """Where free nodes are among their coordinates."""
        return {v: i for i, v in enumerate(self.free)}

    @cached_property
    def listeners(self) -> list[int]:
        """The agents that hear late, or what is off."""
        return sorted({e.listener for e in self.channels}.union(self.wrong))

    @cached_property
    def camps(self) -> list[Row]:
        """The rows of ``R``, by the number of the first node: where agents end if one of them is at 1."""
        diagonal = [self.projection[p][p] for p in self.first]
        bits = length(chain(diagonal, *(row.values() for row in self.projection)))
        spend(len(self.projection) * len(diagonal), bits, bits, "the delay LMI")
        return [
            {j: row[p] / x for j, (p, x) in enumerate(zip(self.first, diagonal, strict=True)) if row.get(p)}
            for row in self.projection
        ]

    @cached_property
    def differences(self) -> list[Row]:
        """The rows of ``C``, by node."""
        each = ((v, self.camps[v].items()) for v in self.free)
        return [{v: Fraction(1), **{self.first[k]: -r for k, r in camps}} for v, camps in each]

    def coordinates(self, x: Sequence[Fraction]) -> list[Fraction]:
        """Return ``C x``."""
        return [sum((r * x[v] for v, r in row.items()), Fraction(0)) for row in self.differences]

    @cached_property
    def system(self) -> list[Row]:
        """The rows of ``A``."""
        bits = length(chain(*(row.values() for row in self.camps)))
        own = longest(chain(*map(dict.values, self.laplacian)))
        added = sum(len(self.laplacian[self.first[k]]) for row in self.camps for k in row)
        spend(added, bits * max(len(self.first), 1), own + self.unit.bit_length(), "the delay LMI")
        place, unit = self.place, self.unit
        rows = [{place[j]: Fraction(x, unit) for j, x in row.items() if j in place} for row in self.laplacian]
        return [combination(row, dict(enumerate(rows))) for row in self.differences]

    @cached_property
    def pushed(self) -> list[Row]:
        """The rows of ``C``, columns of :attr:`listeners`."""
        column = {v: k for k, v in enumerate(self.listeners)}
        return [{column[v]: r for v, r in row.items() if v in column} for row in self.differences]

    @cached_property
    def walks(self) -> dict[int, Row]:
        """The rows of ``Q`` of those first nodes, by number, that do not rest, columns of :attr:`listeners`."""
        rows = ({k: self.projection[p].get(v) for k, v in enumerate(self.listeners)} for p in self.first)
        found = {j: {k: x for k, x in row.items() if x} for j, row in enumerate(rows)}
        return {j: row for j, row in found.items() if row}

    @cached_property
    def slopes(self) -> Sparse:
        """The rows of ``Z``, times the unit: free coordinates first, then :attr:`listeners`."""
        column = {v: len(self.free) + k for k, v in enumerate(self.listeners)}
        rows = []
        for v, own in enumerate(self.laplacian):
            row = {self.place[j]: x for j, x in own.items() if j in self.place}
            rows.append(row | ({column[v]: -self.unit} if v in column else {}))
        return rows

    def heard(self, e: Channel) -> dict[int, int]:
        """Return ``m_e``."""
        return {e.source: 1, e.listener: -1 if e.weight > 0 else 1} if self.own_late else {e.source: 1}

    @cached_property
    def deviations(self) -> list[Row]:
        """The rows of ``(I - Q)``, columns of free coordinates."""
        rows = deviation_rows(self.projection)
        return [{self.place[j]: x for j, x in row.items() if j in self.place} for row in rows]


def channels_of(
    edges: Sequence[tuple[int, int, int]], lateness: Sequence[Fraction], rests: Sequence[bool], own_late: bool
) -> list[Channel]:
    """Return the edges over which something is late: not those from who rests, if the own state is fresh.

    Parameters
    ----------
    edges : sequence of (source, listener, weight)
    lateness : sequence of Fraction
        By edge.
    rests : sequence of bool
        Whether a node listens to nobody.
    own_late : bool
    """
    each = zip(edges, lateness, strict=True)
    return [Channel(k, s, t, w, h) for k, ((s, t, w), h) in enumerate(each) if h and (own_late or not rests[s])]


@dataclass(frozen=True, kw_only=True)
class LateLMI:
    """What one matrix proves: the share that is left, how far ends move, deviations at first, and what is left.

    And what errors make of the root of the Lyapunov function.
    """

    left: Fraction
    floor: NotNegative | None = None
    moved: FewAgents
    away: FewAgents
    residual: FewAgents


@dataclass(frozen=True, kw_only=True)
class LateLMIWitness:
    """``P``, ``tau`` of every edge, and where values are off of every agent."""

    matrix: Triangle
    tau: Several[Fraction]
    errors: FewAgents | None = None


def check_delay_lmi(doc: Document, messages: Messages, verified: Verified, section: LateLMI) -> DecayOfAll:
    """Verify ``sqrt(V) <= e^(-b s) sqrt(V(0))`` under late messages, and how far the final state may move."""
    doc.at = "messages.lmi"
    graph, cap, state = verified.structure.graph, messages.gain_cap, verified.begin.state
    if cap is None or state is None:
        raise RejectedError("lmi without a cap of the gain, or without an initial state")
    error = messages.value_error
    need(not (error and messages.late), "lmi of values that are off and of a late own state")
    need(verified.final.exact, "lmi without an exact influence of the leaders")
    obligation = doc.open("late-lmi", "messages.lmi")
    P, tau, b = obligation["witness"].matrix, obligation["witness"].tau, obligation["b"]
    wrong, floor = obligation["witness"].errors, section.floor or Fraction(0)
    told = wrong is not None, section.floor is not None
    need(told == (error > 0, error > 0), "floor and errors are told iff values are off")
    loop, free = loop_of(messages, verified, cap), verified.structure.free_nodes
    need_rows(2 * graph.n)
    need(len(tau) == graph.n_edges and len(P) == len(free), "a matrix or tau of another size")
    late, left = {e.edge: e.lateness for e in loop.channels}, section.left
    need(b > 0 and 2 * b * max(late.values(), default=0) <= LARGEST_GROWTH, "b is not positive, or too large")
    need(all(x > 0 if k in late else x == 0 for k, x in enumerate(tau)), "tau is positive iff messages are late")
    off = {} if wrong is None else {v: wrong[v] for v in loop.wrong}
    need(all(x > 0 for x in off.values()), "errors are positive of agents that listen")
    lmi = DelayLMI(loop, b, P, [tau[e.edge] for e in loop.channels], off)
    need(lmi.proved(doc.exact), "the delay LMI is not proved")
    need(2 * b * floor**2 >= error**2 * sum(off.values(), Fraction(0)), "floor is too small")
    clock = need_left_at_deadline(messages, b, left)
    root, (away, slope, walk) = lmi.root([state[v] for v in range(graph.n)]), lmi.constants(doc.exact)
    far = root + 2 * b * clock * floor
    drawn = [far * x + floor * y for x, y in zip(walk, away, strict=True)]
    moved = proved_above(graph, section.moved, "moved", drawn)
    first = proved_above(graph, section.away, "away", [root * x for x in away])
    rest = [x + y * left for x, y in zip(moved, first, strict=True)]
    proved_above(graph, section.residual, "residual", rest)
    doc.done(f"b = {down(b)}, gain at most {down(cap)}")
    falling, standing = lmi.inputs(AgentConstants(away, slope, walk), (floor, error, clock))
    columns = list(first), list(moved), [root * x for x in falling], standing
    return DecayOfAll(range(graph.n), b, None, left, *columns)


def loop_of(messages: Messages, verified: Verified, cap: Fraction) -> LateLoop:
    """Return what is late."""
    structure, final, graph = verified.structure, verified.final, verified.structure.graph
    need_rows(graph.n)
    rows, parts = [graph.row(v) for v in range(graph.n)], messages.parts
    edges = [(s, t, -rows[t][s]) for s, t in zip(graph.source, graph.target, strict=True)]
    lateness = [cap * messages.delay * Fraction(x, PARTS) for x in parts]
    lateness *= graph.n_edges if len(parts) == 1 else 1
    channels = channels_of(edges, lateness, [not row for row in rows], messages.late)
    wrong = [v for v, row in enumerate(rows) if row] if messages.value_error else []
    return LateLoop(rows, graph.unit, final.projection, structure.free_nodes, channels, messages.late, wrong)


class DelayLMI:
    """What one matrix proves of a loop, if its ``N`` is definite.

    Parameters
    ----------
    loop : LateLoop
    b : Fraction
        Positive.
    P : m rows of m Fractions
        Symmetric.
    tau : sequence of Fraction
        Positive, one for each channel.
    errors : mapping of int to Fraction
        The same of agents that hear what is off.
    """

    def __init__(
        self,
        loop: LateLoop,
        b: Fraction,
        P: Sequence[Sequence[Fraction]],
        tau: Sequence[Fraction],
        errors: Mapping[int, Fraction],
    ):
        self.loop, self.b, self.tau, self.errors = loop, b, tau, errors
        (self.P, self.scale), self.rational = integers(P), P

    def proved(self, exact: Arithmetic) -> bool:
        """Tell whether ``P > 0`` and ``N > 0`` are proved."""
        return exact.definite(self.P) and exact.definite(self.inequality(exact))

    def inequality(self, exact: Arithmetic) -> Matrix:
        """Return ``N``, times a positive integer."""
        loop = self.loop
        m, q = len(loop.free), len(loop.listeners)
        need_rows(m + q)
        A, a = _sparse_integers(loop.system)
        C, c = _sparse_integers(loop.pushed)
        PA, PC = times(exact, self.P, A, m), times(exact, self.P, C, q)
        b2 = 2 * self.b
        bits = longest(chain.from_iterable(PA)) + (a * c * self.scale).bit_length() + length([self.b])
        spend(2 * (m + q) ** 2 + 4 * (m + 1) ** 2 * len(loop.channels), bits, bits, "the delay LMI")
        N = [[Fraction(0)] * (m + q) for _ in range(m + q)]
        for i in range(m):
            for j in range(m):
                N[i][j] = Fraction(PA[i][j] + PA[j][i], a * self.scale) - b2 * self.rational[i][j]
            for k in range(q):
                N[i][m + k] = N[m + k][i] = Fraction(-PC[i][k], c * self.scale)
        for k, T in enumerate(self._multipliers()):
            N[m + k][m + k] = T
        for e, tau in zip(loop.channels, self.tau, strict=True):
            factor = rounded(tau * _growth(e.lateness, self.b) / loop.unit**2, BITS, up=True)
            row: dict[int, int] = {}
            for v, sign in loop.heard(e).items():
                for j, x in loop.slopes[v].items():
                    row[j] = row.get(j, 0) + sign * x
            _subtract(N, row, factor)
        for walk in loop.walks.values():
            _subtract(N, {m + k: x for k, x in walk.items()}, Fraction(1))
        return integers(N)[0]

    def _multipliers(self) -> list[Fraction]:
        """Return ``T_k``, rounded down."""
        sums = dict.fromkeys(self.loop.listeners, Fraction(0))
        for e, tau in zip(self.loop.channels, self.tau, strict=True):
            sums[e.listener] += rounded(Fraction(e.weight, self.loop.unit) ** 2 / tau, BITS, up=True)
        for v, tau in self.errors.items():
            sums[v] += rounded(self.weight_of(v) ** 2 / tau, BITS, up=True)
        return [rounded(1 / x, BITS) for x in sums.values()]

    def weight_of(self, v: int) -> Fraction:
        """Return ``D_v``."""
        return Fraction(self.loop.laplacian[v][v], self.loop.unit)

    def root(self, x0: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V(0))`` from above."""
        (xi,), unit = integers([self.loop.coordinates(x0)])
        spend(2 * len(xi) ** 2, 2 * longest(xi), longest(chain.from_iterable(self.P)), "V(0)")
        return root_above(Fraction(quadratic(self.P, xi), self.scale * unit**2))

    def constants(self, exact: Arithmetic) -> AgentConstants:
        """Return what ``P``, which is definite, says of every agent."""
        loop, m = self.loop, len(self.loop.free)
        D, scale = _sparse_integers(loop.deviations)
        rows = [*D, *({self.loop.place[j]: x for j, x in row.items() if j in loop.place} for row in loop.laplacian)]
        found = exact.above(self.P, [[row.get(j, 0) for j in range(m)] for row in rows])
        if found is None:
            raise RejectedError("the matrix is not proved positive definite")
        n, share = len(loop.laplacian), 1 / (2 * self.b)
        away = [root_above(x * self.scale / scale**2) for x in found[:n]]
        slope = [root_above(x * self.scale / loop.unit**2) for x in found[n:]]
        walk = [sum((r**2 for j, r in row.items() if j in loop.walks), Fraction(0)) for row in loop.camps]
        return AgentConstants(away, slope, [root_above(x * share) for x in walk])

    def inputs(
        self, constants: AgentConstants, errors: tuple[Fraction, Fraction, Fraction]
    ) -> tuple[list[Fraction], list[Fraction]]:
        """Return ``phi_k`` and ``psi_k``, ``|F_k| <= phi_k sqrt(V(0)) e^(-b s) + psi_k``, for ``f``, ``nu``, ``s(T)``.

        ``|F_k|`` is at most ``|(L x)_k|`` and what every late message adds: ``|w_e|`` times the sum over ``m_e`` of
        ``|x_l(s) - x_l(s - h)|``, the deviations at both times and the walk between, or ``h`` times the largest slope;
        and ``nu D_k``.
        """
        (away, slope, walk), loop, (floor, error, clock) = constants, self.loop, errors
        falling, standing = [], []
        for e in loop.channels:
            q = rounded(exp(self.b * e.lateness)[1], BITS, up=True)
            between = root_above(2 * self.b * e.lateness) * q  # over the walk of all times
            parts = ((1 + q) * away[v] + between * walk[v] for v in loop.heard(e))
            falling.append((e, rounded(e.lateness * q, BITS, up=True), sum(parts, Fraction(0))))
            between = 2 * self.b * root_above(e.lateness * clock)
            parts = (floor * (2 * away[v] + between * walk[v]) for v in loop.heard(e))
            standing.append((e, e.lateness, sum(parts, Fraction(0))))
        if not error:
            return self._rounds(slope, falling), [Fraction(0)] * len(slope)
        own = [floor * x + (error * self.weight_of(v) if v in self.errors else 0) for v, x in enumerate(slope)]
        return self._rounds(slope, falling), self._rounds(own, standing)

    def _rounds(self, own: Sequence[Fraction], late: Sequence[tuple[Channel, Fraction, Fraction]]) -> list[Fraction]:
        """Return bounds of ``|F_k|``, put into themselves, of what agents add themselves and what is late."""
        phi: list[Fraction] | None = None
        for _ in range(ROUNDS):
            total = list(own)
            for e, lag, far in late:
                near = far if phi is None else min(far, lag * sum(phi[v] for v in self.loop.heard(e)))
                total[e.listener] += abs(Fraction(e.weight, self.loop.unit)) * near
            phi = [rounded(x, BITS, up=True) for x in total]
        return phi or []


def _growth(h: Fraction, b: Fraction) -> Fraction:
    """Bound ``h (e^(2 b h) - 1)/(2 b)`` from above."""
    return h * (exp(2 * b * h)[1] - 1) / (2 * b)


def _sparse_integers(rows: Sequence[Row]) -> tuple[Sparse, int]:
    """Return sparse rational rows times a common denominator, and that."""
    values, scale = integers([list(row.values()) for row in rows])
    return [dict(zip(row, own, strict=True)) for row, own in zip(rows, values, strict=True)], scale


def _subtract(N: list[list[Fraction]], row: Mapping[int, Fraction | int], factor: Fraction) -> None:
    """Subtract ``factor row'row``."""
    for i, x in row.items():
        for j, y in row.items():
            N[i][j] -= factor * x * y
