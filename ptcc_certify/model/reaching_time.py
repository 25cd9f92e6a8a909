"""The sliding variables: when each reaches 0, how large it is until then, and what is certain about both.

    sigma_k' = -mu1 sign(sigma_k) - (mu2 + mu3 kappa/(T_r - t)) sigma_k + d_k,      |d_k| <= delta < mu1

A disturbance that does not depend on the states decouples them. With ``s`` the sign of ``sigma_k(0)`` and
``psi(t) = e^(-mu2 t) ((T_r - t)/T_r)^(mu3 kappa)``,

    |sigma_k(t)| = psi(t) (|sigma_k(0)| - int_0^t (mu1 - s d_k(r)) / psi(r) dr)

until the bracket is 0, and 0 from there on. The integrand is positive, so the root is simple and the only one. It can
lie nearer to ``T_r`` than a float tells: everything is computed in ``z = ln(T_r/(T_r - t))``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import down, float_down, near, up
from lmi.exact.elementary_enclosures import decay_integrals_below, rounded
from ptcc_certify.checker import REACHING_BITS
from ptcc_certify.errors import SimulationError
from ptcc_certify.model.base import ReachingProtocol
from ptcc_certify.model.disturbance import Disturbance, WorstCaseDisturbance

#: Beyond this z the time is T_r to the last bit of a float.
LAST_Z = 40.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(15)
# Panels times agents at most, but so many panels in any case; panels times agents at a time.
_MAX_PANELS = 200_000
_LEAST_PANELS = 3000
_BATCH = 200_000
#: By how much a sum of panels, or a decay, may be off, relative to the initial state.
SUM_ERROR = 1e-12
_LARGEST_Z = Fraction(2) ** 1000
#: Sizes of sliding variables below which floats lose digits.
_LEAST = 1e-290
#: Bits of an instant.
_INSTANT_BITS = 53


# ---------------------------------------------------------------------- what is certain


@dataclass(frozen=True)
class ReachingTime:
    """A proved reaching time: whatever the disturbance, ``sigma_k = 0`` from this instant on.

    Attributes
    ----------
    deadline : Fraction
        ``T_r``, in units of time.
    z : Fraction or None
        ``ln(T_r/(T_r - t))`` of the instant; None where only ``T_r`` itself is certain.

    References
    ----------
    Proposition 1 of [Zhu]_ bounds the norm of all sliding variables; each by itself follows from equation (49).

    Examples
    --------
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3="1/2", delta=1)
    >>> small, large = certified_reaching_times(p, [Fraction(1), Fraction(100)])
    >>> small.time < 1, large.time, large.z is None  # the worst case keeps the large one from 0 until T_r
    (True, 1.0, True)
    """

    deadline: Fraction
    z: Fraction | None

    @property
    def remaining(self) -> float:
        """``T_r - t``, rounded down; 0 where only ``T_r`` is certain, and where it is below the range of floats."""
        if not self.z:
            return 0.0 if self.z is None else float_down(self.deadline)
        z = float(min(self.z, Fraction(1000)))
        rest = float(self.deadline) * math.exp(-z) * (1 - 1e-15 - 2e-16 * z)
        return rest if rest > 1e-300 else 0.0

    @property
    def time(self) -> float:
        """The instant, rounded up, at most the float nearest to ``T_r``."""
        if self.z is None:
            return float(self.deadline)
        early = -float(self.deadline) * math.expm1(-float(min(self.z, Fraction(1000)))) * (1 + 1e-15)
        return min(early, float(self.deadline))

    def __repr__(self) -> str:
        if self.z is None:
            return f"ReachingTime(T_r = {near(self.deadline)})"
        return f"ReachingTime({up(Fraction(self.time))}, {down(self.remaining, 3)} before T_r)"


def certified_reaching_times(protocol: ReachingProtocol, sigma0: Sequence[Fraction]) -> tuple[ReachingTime, ...]:
    """Prove for every agent an instant from which its sliding variable is 0, whatever the disturbance.

    ``|sigma_k(0)| <= (mu1 - delta) int_0^t dr/psi(r)`` is shown with the lower bounds of the integral that the checker
    uses. With ``mu3 kappa >= 1`` such a ``t < T_r`` always exists. With ``mu3 kappa < 1`` the integral is finite: a
    large ``sigma_k(0)`` is certain to be 0 at ``T_r`` only, and the worst-case disturbance attains it.

    Parameters
    ----------
    protocol : ReachingProtocol
    sigma0 : sequence of N Fraction

    Returns
    -------
    tuple of N ReachingTime
        Above the least provable instant by a part in 10^12, as a rule.

    References
    ----------
    Equation (49) and Proposition 1 of [Zhu]_.

    Examples
    --------
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> certified_reaching_times(p, [Fraction(0), Fraction(-1)])
    (ReachingTime(0, 1 before T_r), ReachingTime(0.43409, 0.565 before T_r))
    """
    worst = worst_case(protocol, tuple(float(x) for x in sigma0))
    pole, push = protocol.mu3 * protocol.kappa, protocol.mu1 - protocol.delta
    instants = {Fraction(0): Fraction(0)}

    def prove(candidates: dict[Fraction, Fraction]) -> set[Fraction]:
        below = decay_integrals_below(protocol.T_r, protocol.mu2, pole, candidates.values(), REACHING_BITS)
        proved = {size: z for size, z in candidates.items() if size <= push * below[z]}
        instants.update(proved)
        return set(proved)

    # Near 0 the integral is T_r z.
    guesses = {
        abs(x): abs(x) / (push * protocol.T_r) if abs(x) < _LEAST else Fraction(z)
        for x, z in zip(sigma0, worst.z.tolist(), strict=True)
        if z < math.inf
    }
    for slack in (1e-12, 1e-9, 1e-6, 1e-3):
        raised = {size: z * Fraction(1 + slack) for size, z in guesses.items() if size not in instants}
        prove({size: rounded(z, _INSTANT_BITS, up=True) for size, z in raised.items()})
    # What floats cannot place is within a tenth; with mu3 kappa < 1 the integral does not grow any more from ``z`` on.
    z = float(min(_LARGEST_Z, (60 if pole < 1 else 1600) / abs(pole - 1)) if pole != 1 else _LARGEST_Z)
    steps = round((math.log(z) - math.log(_LEAST)) / math.log(1.1))
    places = dict.fromkeys(prove(dict.fromkeys(set(map(abs, sigma0)) - set(instants), Fraction(z))), (0, steps))
    for _ in range(steps.bit_length()):
        middle = {size: sum(ends) // 2 for size, ends in places.items()}
        proved = prove({size: Fraction(math.exp(math.log(z) - k * math.log(1.1))) for size, k in middle.items()})
        places = {
            size: (middle[size], last) if size in proved else (first, middle[size])
            for size, (first, last) in places.items()
        }
    return tuple(ReachingTime(protocol.T_r, instants.get(abs(size))) for size in sigma0)


# ---------------------------------------------------------------------- one run


class ReachingProblem:
    """The sliding variables of one run under a disturbance that does not depend on the states.

    Parameters
    ----------
    protocol : ReachingProtocol
    sigma0 : (N,) array
    disturbance : Disturbance

    Raises
    ------
    SimulationError
        The disturbance varies too fast to be resolved.
    """

    def __init__(self, protocol: ReachingProtocol, sigma0: np.ndarray, disturbance: Disturbance):
        self._protocol, self._disturbance = protocol, disturbance
        sigma0 = np.where(np.abs(sigma0) < _LEAST, 0.0, sigma0)  # floats lose digits there
        # Each sliding variable in units of its own initial state: the bracket begins at 1.
        self._unit, self._sign = np.abs(sigma0), np.sign(sigma0)
        self._agents = np.flatnonzero(self._sign)
        # A worst-case disturbance of the full size leaves mu1 - delta, which floats would cancel.
        self._gap = float(protocol.mu1 - protocol.delta)
        self._worst = isinstance(disturbance, WorstCaseDisturbance) and disturbance.delta == protocol.delta
        if self._agents.size:
            self._end = self._latest()
            self._edges, self._steps = self._panels()
            self._sums = np.concatenate([np.zeros((self._agents.size, 1)), np.cumsum(self._steps, axis=1)], axis=1)

    @cached_property
    def z(self) -> np.ndarray:
        """``ln(T_r/(T_r - t))`` where each of the N sliding variables reaches 0, to near machine precision.

        0 for one that starts there or below 1e-290, infinite for one that is 0 at ``T_r`` only.
        """
        z = np.zeros(self._unit.size)
        _, rows, same = np.unique(self._unit[self._agents], return_index=True, return_inverse=True)
        if not self._worst:  # the disturbances of two agents differ, though they start equally far
            rows = same = np.arange(self._agents.size)
        z[self._agents] = np.array([self._root(row) for row in rows.tolist()])[same]
        return z

    def sigma(self, z: np.ndarray) -> np.ndarray:
        """Return the (N, M) sliding variables at increasing instants ``z >= 0``, infinite from ``T_r`` on."""
        values = np.zeros((self.z.size, z.size))
        for rows in self._blocks(z):
            agents = self._agents[rows]
            before = z < self.z[agents, None]
            used = before.any(axis=0)
            start = (self._sign[agents] * self._unit[agents])[:, None]
            values[np.ix_(agents, used)] = np.where(before[:, used], start * self._sizes(rows, z[used]), 0.0)
        return values

    def above(self, z: np.ndarray, certain: np.ndarray) -> np.ndarray:
        """Bound the (N, M) sizes of the sliding variables at increasing ``z >= 0``, 0 from ``certain`` (N,) on.

        What remains of the bracket is raised by what the sum may be off by; it is at most the integral from ``z`` to
        the certain instant, too, which nothing cancels.
        """
        bounds = np.zeros((self._unit.size, z.size))
        for rows in self._blocks(z):
            agents = self._agents[rows]
            used = z < certain[agents].max()
            size, decay = self._sizes(rows, z[used], SUM_ERROR), self._decay(z[used])
            in_panel = self._integrals(z[used], self._edges[self._panel(z[used]) + 1], rows)
            for place, (row, agent) in enumerate(zip(rows, agents.tolist(), strict=True)):
                end, before = float(certain[agent]), z[used] < certain[agent]
                if end <= self._end:
                    rest = self._rest(row, z[used][before], end, in_panel[place, before]) * decay[before]
                    size[place, before] = np.minimum(size[place, before], rest)
                bounds[agent, : before.sum()] = size[place, before] * self._unit[agent] * (1 + SUM_ERROR / 2)
        return bounds

    def _blocks(self, z: np.ndarray) -> Iterator[range]:
        """Yield the rows of the agents that do not start at 0, so many at once as fit into memory at instants ``z``."""
        step = max(1, 10 * _BATCH // (z.size * _NODES.size + 1))
        for first in range(0, self._agents.size, step):
            yield range(first, min(first + step, self._agents.size))

    def _sizes(self, rows: range, z: np.ndarray, more: float = 0.0) -> np.ndarray:
        """Return the (A, M) sizes of some sliding variables in their units, with so much added to the bracket."""
        near, size = z <= self._end, np.empty((len(rows), z.size))
        panel = self._panel(z[near])
        integral = self._sums[rows[0] : rows[-1] + 1, panel] + self._integrals(self._edges[panel], z[near], rows)
        size[:, near] = np.minimum(np.maximum(1 - integral, 0) + more, 1) * self._decay(z[near])
        size[:, ~near] = [self._tail(row, z[~near], more) for row in rows]
        return size

    def _rest(self, row: int, z: np.ndarray, end: float, in_panel: np.ndarray) -> np.ndarray:
        """Return the integrals of one agent from instants ``z < end`` to ``end``, each to near machine precision.

        ``in_panel`` has those from each instant to the end of its panel.
        """
        panel, last = self._panel(z), int(self._panel(np.array([end]))[0])
        later = np.append(np.cumsum(self._steps[row, :last][::-1])[::-1], 0.0)  # from an edge on to the last panel
        whole = panel < last
        final = float(self._integrals(self._edges[[last]], np.array([end]), [row])[0, 0])
        rest = in_panel + later[np.minimum(panel + 1, last)] + final
        rest[~whole] = self._integrals(z[~whole], np.full((~whole).sum(), end), [row])[0]
        return rest

    def _panel(self, z: np.ndarray) -> np.ndarray:
        return np.clip(np.searchsorted(self._edges, z, side="right") - 1, 0, self._steps.shape[1] - 1)

    def _decay(self, z: np.ndarray) -> np.ndarray:
        return np.exp(-self._protocol.reaching_gain.clock_at_tau(z))

    def _push(self, z: np.ndarray, rows: Any) -> np.ndarray:
        """Return ``mu1 - s d`` of some agents at (M,) instants, in units of their initial values."""
        agents = self._agents[rows]
        unit = self._unit[agents, None]
        if self._worst:
            return np.broadcast_to(self._gap / unit, (len(rows), z.size))
        signs = self._sign[agents]
        t = self._protocol.reaching_gain.time_at_tau(z)
        d = self._disturbance.values(t, agents, signs.astype(int))
        return (float(self._protocol.mu1) - signs[:, None] * d) / unit

    def _integrals(self, a: np.ndarray, b: np.ndarray, rows: Any) -> np.ndarray:
        """Return the (A, P) integrals of ``(mu1 - s d)/psi dt`` over panels of ``z``."""
        half = (b - a) / 2
        z = (a + half)[:, None] + half[:, None] * _NODES
        with np.errstate(over="ignore", invalid="ignore"):  # infinite beyond the root of a small initial value
            if self._worst:
                return np.multiply.outer(self._gap / self._unit[self._agents[rows]], self._weight(z) @ _WEIGHTS * half)
            push = self._push(z.ravel(), rows).reshape(len(rows), *z.shape)
            return (push * self._weight(z)) @ _WEIGHTS * half

    def _latest(self) -> float:
        """Return a ``z`` by which the worst case has brought every agent to 0, a tenth too large or so."""
        edges = np.concatenate([[0.0], np.geomspace(1e-12, 1, 400) * LAST_Z])
        low, half = edges[:-1, None], np.diff(edges)[:, None] / 2
        with np.errstate(over="ignore"):
            integral = np.cumsum((self._weight(low + half + half * _NODES) * half) @ _WEIGHTS) * self._gap
        return float(edges[min(int(np.searchsorted(integral, self._unit.max())) + 2, edges.size - 1)])

    def _panels(self) -> tuple[np.ndarray, np.ndarray]:
        """Return panel edges and the (A, P) integrals over them, refined until halving changes nothing."""
        gain, T = self._protocol.reaching_gain, float(self._protocol.T_r)
        fine = np.concatenate([[0.0], np.geomspace(1e-12, 1, 400) * self._end])
        clock = gain.clock_at_tau(fine)
        even = np.interp(np.linspace(0, clock[-1], 64 + min(int(clock[-1]), 4000)), clock, fine)
        breaks = -np.log1p(-self._disturbance.breaks(T) / T)
        edges = np.unique(np.concatenate([even, np.linspace(0, self._end, 65), breaks[breaks < self._end]]))
        a, b = edges[:-1], edges[1:]
        previous = np.full(a.size, np.inf)
        rows = range(self._agents.size)
        batch = max(1, _BATCH // self._agents.size)
        most = max(_MAX_PANELS // self._agents.size, _LEAST_PANELS)
        panels: list[tuple[np.ndarray, np.ndarray]] = []
        count = 0
        while a.size:
            count += min(a.size, batch)
            if count > most:
                raise SimulationError(
                    "the disturbance varies too fast, or jumps too often, to be resolved before T_r; try a slower one"
                )
            (low, a), (high, b), (before, previous) = (np.split(part, [batch]) for part in (a, b, previous))
            middle = (low + high) / 2
            whole, left, right = (self._integrals(p, q, rows) for p, q in ((low, high), (low, middle), (middle, high)))
            size = np.abs(left) + np.abs(right)
            with np.errstate(invalid="ignore"):
                error = np.nan_to_num(np.abs(whole - left - right) / np.where(size > 0, size, 1)).max(axis=0)
            # Halving makes a smooth error vanish; one that only halves is rounding, if it is small, or else a jump.
            rounding = (error <= 1e-12) & (error > before / 8)
            fits = (error <= 4e-15) | rounding | (high - low <= 1e-13 * high)
            panels.append((low[fits], (left + right)[:, fits]))
            split = ~fits
            a = np.concatenate([a, low[split], middle[split]])
            b = np.concatenate([b, middle[split], high[split]])
            previous = np.concatenate([previous, error[split], error[split]])
        starts = np.concatenate([part[0] for part in panels])
        order = np.argsort(starts)
        steps = np.concatenate([part[1] for part in panels], axis=1)[:, order]
        return np.append(starts[order], self._end), steps

    def _root(self, row: int) -> float:
        """Return where the bracket of one agent vanishes."""
        from scipy.optimize import brentq

        panel = int(np.searchsorted(self._sums[row, 1:], 1.0))
        if panel == self._steps.shape[1]:
            return self._far_root(row)
        start, end = self._edges[panel : panel + 2]
        rest = 1 - self._sums[row, panel]

        def excess(z: float) -> float:
            return float(self._integrals(self._edges[[panel]], np.array([z]), [row])[0, 0] - rest)

        if excess(end) <= 0:
            return float(end)
        # Down to the smallest floats, which halving the bracket takes 1,100 steps to reach.
        return float(brentq(excess, start, end, xtol=1e-300, rtol=1e-15, maxiter=3000))

    def _weight(self, z: np.ndarray | float) -> np.ndarray:
        """Return ``dt/psi``, per unit of ``z``."""
        with np.errstate(over="ignore"):
            return np.exp(self._protocol.reaching_gain.clock_at_tau(z) - z) * float(self._protocol.T_r)

    def _far_push(self, row: int) -> float:
        """``(mu1 - s d)/psi dt/dz`` at the last instant that a float tells from ``T_r``."""
        return float(self._push(np.array([self._end]), [row])[0, 0] * self._weight(self._end))

    def _far_root(self, row: int) -> float:
        """Beyond the last panel time stands still, and the bracket is elementary."""
        rest = 1 - self._sums[row, -1]
        growth = float(self._protocol.mu3 * self._protocol.kappa - 1)
        with np.errstate(over="ignore", divide="ignore"):
            share = float(np.divide(rest, self._far_push(row)))
        if growth == 0:
            return self._end + share
        return self._end + math.log1p(growth * share) / growth if growth * share > -1 else math.inf

    def _tail(self, row: int, z: np.ndarray, more: float = 0.0) -> np.ndarray:
        rest = min(1 - self._sums[row, -1] + more, 1.0)
        growth, beyond = float(self._protocol.mu3 * self._protocol.kappa - 1), z - self._end
        # psi first: what it multiplies may leave the range of floats.
        with np.errstate(over="ignore", invalid="ignore"):
            integral = np.expm1(growth * beyond) / growth if growth else beyond
            size = self._decay(z) * np.maximum(rest - self._far_push(row) * integral, 0)
        return np.where(np.isfinite(size), size, 0.0)


def sliding_bound(
    protocol: ReachingProtocol,
    sigma0: Sequence[Fraction],
    z: np.ndarray,
    reaching: Sequence[ReachingTime] | None = None,
) -> np.ndarray:
    """Return the (N, M) bounds of ``|sigma_k|`` at increasing instants ``z``, never below the worst case.

    ``psi(t) max(0, |sigma_k(0)| - (mu1 - delta) int_0^t dr/psi(r))``, below that of Proposition 1 and true for every
    disturbance; 0 from the proved reaching times on, which are computed unless they are given. Below 1e-300 floats
    lose digits, and may be 0.
    """
    worst = worst_case(protocol, tuple(float(x) for x in sigma0))
    times = certified_reaching_times(protocol, sigma0) if reaching is None else reaching
    return worst.above(z, np.array([math.inf if r.z is None else float(r.z) for r in times]) * (1 + 1e-15))


@lru_cache(maxsize=2)
def worst_case(protocol: ReachingProtocol, sigma0: tuple[float, ...]) -> ReachingProblem:
    """Return the problem whose run is the bound: times, bounds and runs ask for it, at instants of their own."""
    return ReachingProblem(protocol, np.array(sigma0), WorstCaseDisturbance(protocol.delta))
