"""Encloses agents of order n at instants at which the time left is halved, and verifies Lyapunov functions there.

Between ``tau_0`` and ``tau_0/2`` left let ``tau = tau_0 w``, ``w = 1 - x``, ``D = d/dx`` and ``h = tau eta``, which is
``rho1 tau_0 w + k``. Positions less offsets obey

    w^n D^n p = -sum_i (a_i tau_0^(n-i+1) w^n + (f_i + K_i L) h^(n-i+1) w^(i-1)) D^(i-1) p

A polynomial ``p`` with integer coefficients leaves a defect ``d``: it is the motion of agents that are pushed by ``b
d/h^n`` per unit of the clock in the coordinates ``y_i = D^(i-1) p/h^(i-1)``, and rounded where it begins. Since ``V``
decays, ``sqrt(V)`` of the difference from the motion is at most the sum of ``sqrt(V)`` of all that was pushed.

In the cascade ``K_1 h^2`` is ``alpha h^2 + k``. What is made of pushes there is told by
:mod:`~ptcc_certify.checker.agent_cascade`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import chain
from math import comb, factorial, perm
from operator import mul
from typing import NamedTuple

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest
from lmi.exact.work import spend
from ptcc_certify.checker.agent_bounds import Begin
from ptcc_certify.checker.agent_model import Agents, Cascade
from ptcc_certify.checker.common_motion import States
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.section_declarations import Several

Columns = list[list[list[int]]]
#: ``V`` of every function that is used, at most, at every instant; None: not told. Of the cascade two roots of each.
InstantsSection = Several[Several[Fraction | None]]
#: Bits of the largest initial coefficient; coefficients end where what they add is below the root of the unit.
BITS = 256
#: Instants, and coefficients of one polynomial.
MANY_INSTANTS, MANY_TERMS = 16, 800


class Halved(NamedTuple):
    """Where agents are at an instant.

    Attributes
    ----------
    columns : by coordinate of space and derivative
        ``y`` of every agent in integers.
    scale : Fraction
        What 1 is in these.
    off : Fraction
        The sum of all that was pushed, of all coordinates of space, as the largest entry of ``y`` of any agent: so much
        ``sqrt(V)`` of ``y`` is off, for every ``V`` that decays, and is at most 1 where one entry of ``y`` of every
        agent is at most 1, in one coordinate of space.
    """

    columns: Columns
    scale: Fraction
    off: Fraction


class _Step:
    """One halving of the time left.

    Parameters
    ----------
    agents : Agents or Cascade
    tau : Fraction
        What is left at first.
    product : callable
        ``L x``, times ``unit``.
    unit : int
    """

    def __init__(
        self, agents: Agents | Cascade, tau: Fraction, product: Callable[[Sequence[int]], list[int]], unit: int
    ):
        self.n, self.product, self.unit = agents.n, product, unit
        n, part = agents.n, agents.gain.rho1 * tau
        self.last = part / 2 + agents.gain.k
        rows = []
        for i, (a, f, K) in enumerate(zip(agents.plant, agents.own, agents.gains, strict=True)):
            power = n - i
            h = [comb(power, d) * (-part) ** d * (part + agents.gain.k) ** (power - d) for d in range(power + 1)]
            w = [Fraction((-1) ** d * comb(i, d)) for d in range(i + 1)]
            pull = [sum(h[d - j] * w[j] for j in range(i + 1) if 0 <= d - j <= power) for d in range(n + 1)]
            plant = [a * tau**power * (-1) ** d * comb(n, d) for d in range(n + 1)]
            rows += [[K * x for x in pull], [f * x + y for x, y in zip(pull, plant, strict=True)]]
        if isinstance(agents, Cascade):
            rows[0][0] += agents.gain.k  # theta h^2
        self.rows, self.times = integers(rows)
        self.bits = longest(chain([self.times], *self.rows))

    def run(self, X: list[list[int]]) -> tuple[list[list[int]], Fraction] | None:
        """Return coefficients where half is left, in the variable of the next step, and the largest defect's size.

        From the first ``n`` coefficients of every agent. None if there would be too many.
        """
        n, X = self.n, list(X)
        size, defect = len(X[0]), Fraction(0)
        while len(X) < 4 * n + 16 or any(longest(x) > BITS // 2 + len(X) - n for x in X[-n:]):
            j = len(X) - n
            if j > MANY_TERMS:
                return None
            divisor = self.times * self.unit * perm(j + n, n)
            X.append([x // divisor for x in self._rest(X, j)])
            defect += Fraction(perm(j + n, n), 2**j)
        last = len(X) - 1
        for j in range(last - n + 1, last + n + 1):
            defect += Fraction(max(map(abs, self._rest(X, j))), self.times * self.unit * 2**j)
        spend(n * len(X) * size, longest(chain.from_iterable(X)), len(X), "agents at an instant")
        halved = []
        for m in range(n):
            factors = [comb(j, m) << (last - j) for j in range(len(X))]
            halved.append([sum(map(mul, factors, column)) >> last for column in zip(*X, strict=True)])
        return halved, defect

    def _rest(self, X: Sequence[Sequence[int]], j: int) -> list[int]:
        """Return the coefficient of ``x^j`` of the equation without that of ``D^n p``, times two units."""
        n, size = self.n, len(X[0])
        pulled, own = [0] * size, [0] * size
        for i in range(n):
            for d in range(min(j, n) + 1):
                k = j - d + i
                if k < len(X):
                    factor = perm(k, i)
                    K, a = self.rows[2 * i][d] * factor, self.rows[2 * i + 1][d] * factor
                    pulled = [x + K * y for x, y in zip(pulled, X[k], strict=True)] if K else pulled
                    own = [x + a * y for x, y in zip(own, X[k], strict=True)] if a else own
        for d in range(min(j, n) + 1):
            if (k := j - d + n) < len(X):
                factor = self.times * (-1) ** d * comb(n, d) * perm(k, n)
                own = [x + factor * y for x, y in zip(own, X[k], strict=True)]
        spend(3 * (n + 1) ** 2 * size, self.bits, longest(X[-1]), "agents at an instant")
        return [-self.unit * x - y for x, y in zip(own, self.product(pulled), strict=True)]


def halvings(
    agents: Agents | Cascade,
    product: Callable[[Sequence[int]], list[int]],
    unit: int,
    states: States,
    offsets: Sequence[Sequence[Fraction]],
) -> Iterator[Halved]:
    """Yield where agents are at instants ``T (1 - 2^-i)``, ``i = 1, 2, ..``.

    Parameters
    ----------
    agents : Agents or Cascade
        Without a cap of the gain.
    product : callable
        ``L x``, times ``unit``, of one integer for each agent.
    unit : int
    states, offsets : by agent
        Initial states by coordinate of space, and places in a formation.
    """
    n, tau, k = agents.n, agents.gain.T, agents.gain.k
    first = [
        [
            [
                (row[axis][m] - (h[axis] if m == 0 else 0)) * tau**m / factorial(m)
                for row, h in zip(states, offsets, strict=True)
            ]
            for m in range(n)
        ]
        for axis in range(agents.d)
    ]
    largest = max((abs(x) for rows in first for row in rows for x in row), default=Fraction(0))
    if not largest:
        return
    scale = Fraction(2) ** (BITS + largest.denominator.bit_length() - largest.numerator.bit_length())
    spend(4 * n * agents.d * len(states), BITS, largest.denominator.bit_length() + BITS, "agents at an instant")
    each = [[[int(x * scale // 1) for x in row] for row in rows] for rows in first]
    rounding = sum((factorial(m) / k**m for m in range(n)), Fraction(0)) * agents.d / scale
    off = rounding
    while True:
        step, after = _Step(agents, tau, product, unit), []
        for X in each:
            if (found := step.run(X)) is None:
                return
            after.append(found[0])
            off += found[1] * k ** (1 - n) / scale
        tau, each = tau / 2, after
        off = rounded(off + rounding, BITS, up=True)
        p, q = step.last.as_integer_ratio()
        factors = [factorial(m) * q**m * p ** (n - 1 - m) for m in range(n)]
        columns = [[[f * x for x in row] for f, row in zip(factors, X, strict=True)] for X in each]
        yield Halved(columns, scale * p ** (n - 1), off)


def largest_value(graph: Digraph, function: Function) -> Fraction:
    """Bound ``V`` of one number of every agent that is at most 1, in one coordinate of space."""
    form = function.quadratic
    own, scale = form.weights
    if form.diagonal is None:
        P, scale = form.entries
        own = list(chain.from_iterable(P))
    reach = Fraction(2 * max(graph.diagonal), graph.unit) if form.coordinates == "E" else Fraction(2)
    return Fraction(sum(map(abs, own)), scale) * reach**2


def value_above(begin: Begin, function: Function, at: Halved) -> Fraction:
    """Bound ``V`` at an instant from above."""
    P, times = begin.inverse
    spread = largest_value(begin.graph, function) * (sum(P[i][i] for i in range(len(P))) / times)
    return (root_above(begin.value(function, (at.columns, at.scale))) + root_above(spread) * at.off) ** 2


def check_instants(
    doc: Document,
    known: Iterator[Halved],
    functions: int,
    each: int,
    least: Callable[[int, Halved, Fraction], Sequence[Fraction]],
) -> None:
    """Verify what Lyapunov functions are worth at instants at which the time left is halved.

    Parameters
    ----------
    doc : Document
    known : iterator of Halved
    functions, each : int
        How many are used, and how many numbers are told of each.
    least : callable
        What these are at least, of function ``k``, at an instant where ``1 - t/T`` is a number.
    """
    section, remaining = doc.section("instants"), Fraction(1)
    need(1 <= len(section) <= MANY_INSTANTS, f"no instants, or more than {MANY_INSTANTS}")
    doc.open("agent-instants", "instants")
    for row in section:
        if (at := next(known, None)) is None:
            raise RejectedError("the agents are not enclosed at an instant")
        remaining /= 2
        need(len(row) == each * functions, f"an instant has not {each * functions} entries")
        for k in range(functions):
            told = row[each * k : each * (k + 1)]
            if any(x is not None for x in told):
                holds = all(x is None or x >= y for x, y in zip(told, least(k, at, remaining), strict=True))
                need(holds, "a Lyapunov function is larger at an instant")
    doc.done(f"{len(section)} instants")
