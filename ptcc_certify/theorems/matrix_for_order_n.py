r"""One matrix for agents of order n: what a Lyapunov function of the graph needs to be one of the agents.

In ``y_k = S (xi_k - h_k)``, ``S = diag(1, zeta, .., zeta^(n-1))``, ``zeta = 1/eta``, the closed loop is

    dY/ds = (I (x) A_z - L (x) b K) Y,   A_z = N - theta J - b (f + a_z)',   (a_z)_i = a_i zeta^(n-i+1)

with ``theta = (1 - rho1 zeta)^2/k`` while the gain grows, 0 while it is capped. Let ``Z L + L'Z >= beta Z`` for a form
``Z`` of the graph, ``W > 0``, ``P = W^-1``, ``K = c b'P`` with ``c beta >= 1``, and

    F(zeta) = b b' - r W - A_z W - W A_z' >= 0.

Then ``V = sum_kl Z_kl y_k'P y_l`` has ``dV/ds = Y'[Z (x) (A_z'P + P A_z) - c (Z L + L'Z) (x) P b b'P] Y <= -r V``.
``F`` is a polynomial in ``zeta``; on an interval it is a convex combination of its Bernstein matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import comb

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.errors import NoCertificate
from lmi.exact import arithmetic
from lmi.exact.decimal_rounding import down
from lmi.exact.matrix_polynomial_sign import nonnegative_between, semidefinite
from lmi.exact.numbers import integers
from lmi.feedback import feedback_matrix, later_matrices
from ptcc_certify.checker.agent_bounds import adjugate
from ptcc_certify.checker.agent_decrease import Rows, decrease_form, scaled_matrix, scaled_polynomial

Matrix = tuple[tuple[Fraction, ...], ...]
#: Significant bits of the entries of ``W``, and digits of the gains: the first that prove.
BITS, DIGITS = 40, (4, 6, 9, 12, 15)
#: Ends of intervals of ``zeta`` at most.
MOST_POINTS = 257
#: Later phases: how often the first gain their gain is at least; how much faster they are at least, and bisections.
LATER, FASTER, BISECTIONS = (2, 6, 40), 1.01, 5


@dataclass(frozen=True)
class ScaledAgent:
    """One agent of order n in scaled coordinates, at every value of ``zeta``.

    Attributes
    ----------
    plant, own : tuple of n Fraction
        ``a`` and ``f``.
    rho1, k : Fraction
        Of the gain ``rho1 + k/(T - t)``.
    first : Fraction
        The gain at 0.
    cap : Fraction or None
        What the gain is at most.

    Examples
    --------
    >>> zero, one = Fraction(0), Fraction(1)
    >>> ScaledAgent((zero, zero), (zero, zero), zero, one, 2 * one, None).span
    (Fraction(0, 1), Fraction(1, 2))
    """

    plant: tuple[Fraction, ...]
    own: tuple[Fraction, ...]
    rho1: Fraction
    k: Fraction
    first: Fraction
    cap: Fraction | None

    @property
    def order(self) -> int:
        """``n``."""
        return len(self.plant)

    @property
    def span(self) -> tuple[Fraction, Fraction] | None:
        """The least and the largest ``zeta`` while the gain grows; None if it is capped from the start."""
        if self.cap is not None and self.cap <= self.first:
            return None
        return (Fraction(0) if self.cap is None else 1 / self.cap), 1 / self.first

    @property
    def at_cap(self) -> Rows | None:
        """``A_z`` while the gain is capped; None if it never is."""
        return None if self.cap is None else scaled_matrix(self.plant, self.own, Fraction(0), 1 / self.cap)

    @cached_property
    def coefficients(self) -> list[Rows]:
        """``A_z`` while the gain grows, as a polynomial in ``zeta``, the constant one first."""
        return scaled_polynomial(self.plant, self.own, self.rho1, self.k)

    def vertices(self, points: Sequence[Fraction]) -> list[np.ndarray]:
        """Return matrices in floats whose convex hull holds every ``A_z``: those of Bernstein, and that of the cap."""
        matrices = [A for low, high in pairwise(map(float, points)) for A in self._bernstein(low, high)]
        return matrices + ([] if self.at_cap is None else [_floats(self.at_cap)])

    def _bernstein(self, low: float, high: float) -> list[np.ndarray]:
        """Return the Bernstein matrices of ``A_z`` while the gain grows, between two values of ``zeta``."""
        C, m = list(map(_floats, self.coefficients)), len(self.coefficients) - 1
        shifted = [
            (high - low) ** j * sum(comb(p, j) * low ** (p - j) * C[p] for p in range(j, m + 1)) for j in range(m + 1)
        ]
        shares = np.array([[comb(i, j) / comb(m, j) for j in range(m + 1)] for i in range(m + 1)])
        return list(np.einsum("ij,jab->iab", shares, np.array(shifted)))


def _floats(A: Sequence[Sequence[Fraction]]) -> np.ndarray:
    return np.array([[float(x) for x in row] for row in A])


@dataclass(frozen=True)
class AgentMatrix:
    """A proved ``W``, for a rate and the gains of one agent.

    Attributes
    ----------
    W : n rows of n Fraction
    rate : Fraction
        ``r``, per unit of the stretched clock.
    points : tuple of Fraction
        Ends of the intervals of ``zeta`` on which the Bernstein matrices prove it.
    coupling : Fraction
        ``c``.
    gains : tuple of n Fraction
        ``K = c b'W^-1``.
    """

    W: Matrix
    rate: Fraction
    points: tuple[Fraction, ...]
    coupling: Fraction
    gains: tuple[Fraction, ...]

    @cached_property
    def inverse(self) -> Matrix:
        """``P = W^-1``."""
        return inverse(self.W)


@dataclass(frozen=True)
class Phase:
    """Faster decrease of a Lyapunov function ``V`` of the graph, of the rate ``beta``, from some ``zeta`` on.

    With ``W`` not below the former matrix, ``W K = d b`` and ``beta d b b' - rate W - A_z W - W A_z' >= 0``: so the
    form of ``W`` is not above that of the former matrix where this phase begins.

    Attributes
    ----------
    function : int
        The number of ``V``.
    W : n rows of n Fraction
    rate : Fraction
    coupling : Fraction
        ``d``.
    points : tuple of Fraction
        From 0 to where it begins.
    """

    function: int
    W: Matrix
    rate: Fraction
    coupling: Fraction
    points: tuple[Fraction, ...]

    def begins(self, rho1: Fraction, k: Fraction, T: Fraction) -> float:
        """Return ``1 - t/T`` where ``zeta``, which is ``T (1 - t/T)/(rho1 T (1 - t/T) + k)``, is the last point."""
        zeta = self.points[-1]
        return min(float(k * zeta / (T * (1 - rho1 * zeta))), 1.0)


def inverse(W: Matrix) -> Matrix:
    """Return the inverse of a positive definite matrix.

    Examples
    --------
    >>> inverse(((Fraction(2), Fraction(1)), (Fraction(1), Fraction(1))))[0]
    (Fraction(1, 1), Fraction(-1, 1))
    """
    whole, scale = integers(W)
    rows, determinant = adjugate(whole)
    return tuple(tuple(Fraction(x * scale, determinant) for x in row) for row in rows)


def nonnegative(S: Matrix) -> bool:
    """Tell whether a symmetric matrix is positive semidefinite, exactly.

    Examples
    --------
    >>> nonnegative(((Fraction(1, 2), Fraction(1, 2)), (Fraction(1, 2), Fraction(1, 2))))
    True
    """
    return semidefinite(integers(S)[0])


def prove_decrease(agent: ScaledAgent, W: Matrix, rate: Fraction) -> tuple[Fraction, ...] | None:
    """Return ends of intervals of ``zeta`` on which Bernstein matrices prove ``F >= 0``; None if they do not.

    Intervals are halved where they do not prove it, which ends where ``F > 0``.
    """
    scaled_W, at_cap = integers(W), agent.at_cap
    if not arithmetic().definite(scaled_W[0]):
        return None
    if at_cap is not None and not semidefinite(decrease_form(scaled_W, rate, [at_cap])[0]):
        return None
    if agent.span is None:
        return ()
    F = decrease_form(scaled_W, rate, agent.coefficients)
    points, todo = [agent.span[0]], [agent.span]
    while todo:
        low, high = todo.pop()
        if nonnegative_between(F, low, high):
            points.append(high)
        elif len(points) + len(todo) + 2 > MOST_POINTS or not nonnegative_between(F, high, high):
            return None  # at a point it does not hold, or it holds too narrowly
        else:
            middle = (low + high) / 2
            todo += [(middle, high), (low, middle)]
    return tuple(points)


def agent_matrix(agent: ScaledAgent, rate: Fraction, coupling: Fraction) -> AgentMatrix:
    """Search ``W`` for a rate, round it so that the gains ``K = c b'W^-1`` are short, and prove it.

    Raises
    ------
    NoCertificate
        Nothing that the search found was proved.

    Examples
    --------
    >>> zero, one = Fraction(0), Fraction(1)
    >>> agent = ScaledAgent((zero, zero), (zero, zero), zero, one, 2 * one, None)
    >>> [float(x) for x in agent_matrix(agent, Fraction(4), one).gains]  # 12 and 6, and a little to spare
    [12.03, 6.008]
    """
    points = [] if agent.span is None else list(agent.span)
    for _ in range(4):
        found = feedback_matrix(agent.vertices(points), float(rate))
        if (proved := round_and_prove(agent, found, rate, coupling)) is not None:
            return proved
        points = sorted({*points, *((a + b) / 2 for a, b in pairwise(points))})
    raise NoCertificate(f"no matrix for agents of order {agent.order} was proved at the rate {float(rate):.6g}")


def paper_matrix(agent: ScaledAgent, beta: Fraction) -> AgentMatrix:
    """Return the matrix of single integrators under the paper's protocol: ``K = 1``, ``W = c = 1/beta``, ``r = beta``.

    Then ``F = 1 - r W = 0``, ``V`` is ``beta`` times the Lyapunov function of the graph, and every bound is the same.

    Examples
    --------
    >>> zero, one = Fraction(0), Fraction(1)
    >>> paper_matrix(ScaledAgent((zero,), (zero,), one, one, 2 * one, None), Fraction(3)).gains
    (Fraction(1, 1),)
    """
    W = ((1 / beta,),)
    points = prove_decrease(agent, W, beta)
    if points is None:
        raise NoCertificate("the paper's protocol is that of single integrators")
    return AgentMatrix(W, beta, points, 1 / beta, (Fraction(1),))


def round_and_prove(agent: ScaledAgent, found: np.ndarray, rate: Fraction, coupling: Fraction) -> AgentMatrix | None:
    """Round a matrix so that ``K = c b'W^-1`` has few digits, and prove it; None if no rounding proves."""
    W = [[round_to_bits(float(x), BITS) for x in row] for row in found]
    gains = float(coupling) * np.linalg.solve(found, np.eye(len(found))[-1])
    for digits in DIGITS:
        K = tuple(Fraction(f"{x:.{digits - 1}e}") for x in gains)
        exact = with_gains(W, [x / coupling for x in K])
        if (points := prove_decrease(agent, exact, rate)) is not None:
            return AgentMatrix(exact, rate, points, coupling, K)
    return None


def find_phases(
    agent: ScaledAgent, matrix: AgentMatrix, function: int, beta: Fraction, later: bool = True
) -> list[Phase]:
    """Return phases of a Lyapunov function of the rate ``beta``, one after the other, each faster than the former.

    The first has the ``W`` of all functions: this one may decay faster by it than the slowest that is used. Those
    that are ``later`` have matrices of their own, from where the gain is :data:`LATER` times the first one on.

    Examples
    --------
    >>> zero, one = Fraction(0), Fraction(1)
    >>> agent = ScaledAgent((zero, one), (zero, zero), one, one, 2 * one, None)
    >>> phases = find_phases(agent, agent_matrix(agent, Fraction(4), one), 0, 2 * one)  # c beta is 2, where 1 would do
    >>> len(phases) > 0, all(phase.rate > 4 for phase in phases)
    (True, True)
    """
    if agent.span is None or agent.cap is not None:
        return []
    W, c = _floats(matrix.W), float(matrix.coupling)
    phases = list[Phase]()
    gains, driven = _floats((matrix.gains,))[0], np.zeros_like(W)
    driven[-1, -1] = c * float(beta)
    frame = np.linalg.inv(np.linalg.cholesky(W))
    vertices = agent.vertices(matrix.points)
    slowest = min(float(np.linalg.eigvalsh(frame @ (driven - A @ W - W @ A.T) @ frame.T).min()) for A in vertices)
    rate = Fraction(down(Fraction(max(slowest, 0.0)) * (1 - Fraction(1, 10**6)), 6))
    if rate >= FASTER * matrix.rate and (
        points := prove_decrease(agent, _scaled(matrix.W, 1 / (matrix.coupling * beta)), rate)
    ):
        phases.append(Phase(function, matrix.W, rate, matrix.coupling, points))
    for times in LATER if later else ():
        later_agent = replace(agent, first=agent.first * times)
        former, rate = (phases[-1].W, phases[-1].rate) if phases else (matrix.W, matrix.rate)
        phase = _later_phase(later_agent, gains, matrix.gains, former, function, beta, rate)
        phases += [] if phase is None else [phase]
    return phases


def _later_phase(
    agent: ScaledAgent,
    floats: np.ndarray,
    gains: Sequence[Fraction],
    former: Matrix,
    function: int,
    beta: Fraction,
    rate: Fraction,
) -> Phase | None:
    """Return the fastest phase that is found, if it is faster than the former by :data:`FASTER`."""
    systems, W = agent.vertices(agent.span or ()), _floats(former)
    low, high = float(rate), 2 * float(rate)
    best, matrix_at = None, later_matrices(systems, floats, W, float(beta))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        solution = matrix_at(middle)
        low, high = (low, middle) if solution is None else (middle, high)
        best = best if solution is None else (solution, middle)
    if best is None or best[1] < FASTER * float(rate):
        return None
    matrix, chosen = best
    d = Fraction(f"{(matrix @ floats)[-1]:.6e}")
    rounded = [[round_to_bits(float(x), BITS) for x in row] for row in matrix]
    exact, pace = with_gains(rounded, [x / d for x in gains]), Fraction(f"{chosen:.5e}")
    rows = zip(exact, former, strict=True)
    above = nonnegative(tuple(tuple(x - y for x, y in zip(*pair, strict=True)) for pair in rows))
    points = prove_decrease(agent, _scaled(exact, 1 / (d * beta)), pace) if above and d > 0 else None
    return None if points is None else Phase(function, exact, pace, d, points)


def _scaled(W: Matrix, factor: Fraction) -> Matrix:
    return tuple(tuple(factor * x for x in row) for row in W)


def with_gains(W: Sequence[Sequence[Fraction]], g: Sequence[Fraction]) -> Matrix:
    """Return the symmetric matrix next to ``W`` with ``W g = b``, ``b`` the last unit vector: so ``g = b'W^-1``.

    Of all such it is the nearest one in the Frobenius norm (the symmetric update of Powell).

    Examples
    --------
    >>> with_gains([[Fraction(2), Fraction(1)], [Fraction(1), Fraction(1)]], [Fraction(-1), Fraction(2)])[0]
    (Fraction(2, 1), Fraction(1, 1))
    """
    n = len(g)
    rest = [Fraction(i == n - 1) - sum((W[i][j] * g[j] for j in range(n)), Fraction(0)) for i in range(n)]
    size, along = sum(x * x for x in g), sum((x * y for x, y in zip(g, rest, strict=True)), Fraction(0))
    return tuple(
        tuple(W[i][j] + (rest[i] * g[j] + g[i] * rest[j] - along * g[i] * g[j] / size) / size for j in range(n))
        for i in range(n)
    )
