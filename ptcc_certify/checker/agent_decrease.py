"""Verifies the Lyapunov matrix of one agent: that it decays at all gains, and that the coupling is strong enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, pairwise

from lmi.exact.decimal_rounding import down
from lmi.exact.matrix_polynomial_sign import nonnegative_between, semidefinite
from lmi.exact.numbers import integers, longest
from lmi.exact.work import spend
from ptcc_certify.checker.agent_bounds import Used
from ptcc_certify.checker.agent_model import LONGEST, MANY_POINTS, Agents
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.matrix_products import Matrix
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.section_declarations import Positive, Several, Triangle

Rows = list[list[Fraction]]
#: Phases of all functions.
MANY_PHASES = 100


def check_decrease(doc: Document, agents: Agents, used: Sequence[Function]) -> None:
    """Verify ``W > 0``, ``A_z W + W A_z' - b b' + r W <= 0`` at all ``zeta``, ``W K = c b`` and ``c rate >= 1``."""
    doc.open("agent-positive", "agents")
    need(doc.exact.definite(agents.scaled_W[0]), "W is not proved positive definite")
    doc.done(f"{agents.n} rows")
    numbers = doc.open("agent-decrease", "agents")
    need(numbers["rate"] == agents.rate, "the rate is another than that of the agents")
    _check_points(agents)
    F = _while_growing(agents)
    for low, high in pairwise(agents.points):
        need(nonnegative_between(F, low, high), "the decrease is not proved between two points")
    if agents.cap is not None:
        A = scaled_matrix(agents.plant, agents.own, Fraction(0), 1 / agents.cap)
        (at_cap,) = decrease_form(agents.scaled_W, agents.rate, [A])
        need(semidefinite(at_cap), "the decrease is not proved at the cap of the gain")
    doc.done(f"r = {down(agents.rate)}, {max(len(agents.points) - 1, 0)} intervals")
    numbers = doc.open("agent-coupling", "agents")
    need(numbers["coupling"] == agents.coupling, "the coupling is another than that of the agents")
    _check_gains(agents)
    need(all(agents.coupling * f.rate >= 1 for f in used), "the coupling is too weak for a Lyapunov function")
    doc.done(f"c = {down(agents.coupling)}, {len(used)} Lyapunov functions")


@dataclass(frozen=True, kw_only=True)
class PhaseSection:
    """A function that is used, and the matrix by which it decreases faster from some ``zeta`` on."""

    function: int
    rate: Positive
    coupling: Positive
    lower_triangle: Triangle
    points: Several[Fraction]


def check_phases(doc: Document, agents: Agents, used: Sequence[Used]) -> None:
    """Verify faster decrease of functions that are used, from some ``zeta`` on, by matrices not below the former."""
    if "phases" not in doc:
        return
    section = doc.section("phases")
    need(agents.cap is None, "phases of a gain that is capped")
    need(0 < len(section) <= MANY_PHASES, f"no phase, or more than {MANY_PHASES}")
    former = {use.number: (agents.W, 1 / agents.first_gain) for use in used}
    rates = {use.number: use.function.rate for use in used}
    for k, entry in enumerate(section):
        doc.at = f"phases[{k}]"
        number, rate, coupling = entry.function, entry.rate, entry.coupling
        W, points = entry.lower_triangle, entry.points
        need(number in former, "a phase of a function that is not used")
        numbers = doc.open("agent-phase", f"phases[{k}]")
        need(len(W) == agents.n, f"lower_triangle has not {agents.n} entries")
        need(len(points) <= MANY_POINTS, f"more than {MANY_POINTS} points")
        bits = length((coupling, rate, *points, *chain.from_iterable(W)))
        need(bits <= LONGEST, f"a phase with a number of {bits} bits; {LONGEST} are taken")
        need(numbers["rate"] == rate, "the rate is another")
        before, end = former[number]
        need(len(points) >= 2 and points[0] == 0 and points[-1] <= end, "points of a phase that begins too early")
        need(all(low < high for low, high in pairwise(points)), "points are not in ascending order")
        more, _ = integers([[x - y for x, y in zip(*rows, strict=True)] for rows in zip(W, before, strict=True)])
        need(semidefinite(more), "the matrix of a phase is below the former")
        scale = coupling * rates[number]
        own = replace(agents, W=[[x / scale for x in row] for row in W], coupling=1 / rates[number], rate=rate)
        _check_gains(own)
        F = _while_growing(own)
        holds = all(nonnegative_between(F, low, high) for low, high in pairwise(points))
        need(holds, "the decrease of a phase is not proved between two points")
        former[number] = W, points[-1]
        doc.done(f"r = {down(rate)}")


def _check_points(agents: Agents) -> None:
    """Verify that the points are ends of intervals that cover all values of ``zeta`` while the gain is not capped."""
    points, cap = agents.points, agents.cap
    if cap is not None and cap <= agents.first_gain:
        need(not points, "points where the gain is capped from the beginning")
        return
    need(len(points) >= 2, "fewer than two points")
    need(all(low < high for low, high in pairwise(points)), "points are not in ascending order")
    need(points[0] == (0 if cap is None else 1 / cap), "the points begin elsewhere")
    need(points[-1] == 1 / agents.first_gain, "the points end elsewhere")


def _check_gains(agents: Agents) -> None:
    """Verify ``W K = c b``."""
    (W, scale), ((K, own), _) = agents.scaled_W, integers([agents.gains, [agents.coupling]])
    spend(agents.n**2, longest(chain.from_iterable(W)), longest(K), "the gains")
    products = [sum(x * y for x, y in zip(row, K, strict=True)) for row in W]
    need(products == [0] * (agents.n - 1) + [own[0] * scale], "K is not c b'W^-1")


def _while_growing(agents: Agents) -> list[Matrix]:
    """Return what has to be positive semidefinite while the gain grows, by powers of ``zeta``."""
    A = scaled_polynomial(agents.plant, agents.own, agents.gain.rho1, agents.gain.k)
    return decrease_form(agents.scaled_W, agents.rate, A)


def scaled_matrix(plant: Sequence[Fraction], own: Sequence[Fraction], theta: Fraction, zeta: Fraction) -> Rows:
    """Return ``A_z = N - theta J - b (f + a_z)'``.

    Examples
    --------
    >>> zero, one = Fraction(0), Fraction(1)
    >>> scaled_matrix((zero, one), (zero, zero), one, zero)
    [[Fraction(0, 1), Fraction(1, 1)], [Fraction(0, 1), Fraction(-1, 1)]]
    """
    n = len(plant)
    result = [[Fraction(j == i + 1) - theta * i * (i == j) for j in range(n)] for i in range(n)]
    for i in range(n):
        result[n - 1][i] -= own[i] + plant[i] * zeta ** (n - i)
    return result


def scaled_polynomial(plant: Sequence[Fraction], own: Sequence[Fraction], rho1: Fraction, k: Fraction) -> list[Rows]:
    """Return ``A_z`` as a polynomial in ``zeta`` while the gain grows: ``theta = (1 - rho1 zeta)^2 / k``."""
    n = len(plant)
    result = [[[Fraction(0)] * n for _ in range(n)] for _ in range(max(n, 2) + 1)]
    for power, theta in enumerate((1 / k, -2 * rho1 / k, rho1**2 / k)):
        for i in range(n):
            result[power][i][i] -= i * theta
    for i in range(n - 1):
        result[0][i][i + 1] += 1
    for i in range(n):
        result[0][n - 1][i] -= own[i]
        result[n - i][n - 1][i] -= plant[i]
    return result


def decrease_form(scaled_W: tuple[Matrix, int], rate: Fraction, A: Sequence[Rows]) -> list[Matrix]:
    """Return ``b b' - r W - A_z W - W A_z'`` by powers of ``zeta``, times one positive integer.

    ``W`` is in integers over a scale.
    """
    (W, own), n = scaled_W, len(scaled_W[0])
    rows, unit = integers([row for part in A for row in part])
    p, q = rate.as_integer_ratio()
    bits, width = longest(chain.from_iterable(W)) + q.bit_length(), longest(chain.from_iterable(rows))
    spend(2 * len(A) * n**3, bits, width, "the decrease of one agent")
    scale, result = own * unit, []
    for power in range(len(A)):
        part = rows[power * n : (power + 1) * n]
        AW = [[sum(part[i][h] * W[h][j] for h in range(n) if part[i][h]) for j in range(n)] for i in range(n)]
        F = [[-q * (AW[i][j] + AW[j][i]) for j in range(n)] for i in range(n)]
        if power == 0:
            F = [[x - p * unit * y for x, y in zip(*both, strict=True)] for both in zip(F, W, strict=True)]
            F[n - 1][n - 1] += q * scale
        result.append(F)
    return result
