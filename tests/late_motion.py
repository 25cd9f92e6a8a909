"""Motions under late messages and behind moving leaders, each an exact one of the closed loop but for rounding.

What an agent hears is held over a step of the grid, so that its age grows with the time: a delay that is measurable and
lies within the largest one where the age at the end of a step does. Between two instants of the grid the equation has
constant coefficients on the clock, and is solved in closed form. No step is an approximation: a bound for every delay
holds for these motions too, but for rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import expm

Vector = np.ndarray
Matrix = np.ndarray


@dataclass(frozen=True)
class Gain:
    """``min(rho1 + k/(T - t), cap)`` before ``T``, ``rho1`` after it."""

    T: float
    rho1: float
    k: float
    cap: float = math.inf

    def value(self, t: float) -> float:
        return self.rho1 if t >= self.T else min(self.rho1 + self.k / (self.T - t), self.cap)

    def clock(self, t: float) -> float:
        """The integral of the gain up to an instant before ``T``, or up to ``T`` where the gain is capped."""
        turn = self.T if self.cap == math.inf else self.T - self.k / max(self.cap - self.rho1, 1e-300)
        early = min(t, max(turn, 0.0))
        if early >= self.T:
            return math.inf
        return self.rho1 * early - self.k * math.log1p(-early / self.T) + (self.cap * (t - early) if t > early else 0)

    def between(self, a: float, b: float) -> float:
        """The integral of the gain from ``a`` to ``b``; infinite where it is not capped and ``T`` lies there."""
        before = self.clock(min(b, self.T)) - self.clock(a) if a < self.T else 0.0
        return before + self.rho1 * max(b - max(a, self.T), 0.0)


def grid(T: float, longest: float, nearest: float, count: int) -> Vector:
    """Instants from 0 on, by steps of at most ``longest``, that come within ``nearest T`` of ``T`` geometrically."""
    ends, q = [0.0], nearest ** (1 / count)
    while T - ends[-1] > nearest * T:
        t = ends[-1]
        ends.append(t + min(longest, (T - t) * (1 - q)))
    return np.array(ends)


def instants(T: float, taubar: float, nearest: float = 1e-7, count: int = 60) -> Vector:
    """A grid up to ``T`` itself, finer at ``T - taubar`` and ``T - 2 taubar``, from which the end hears."""
    whole = grid(T, min(taubar, T) / 8, nearest, count)
    extra = [T * (1 - x) - j * taubar for j in (1, 2) for x in np.geomspace(1e-3, nearest, 12)]
    return np.unique(np.concatenate([whole, [t for t in extra if 0 < t < whole[-1]], [T]]))


Ages = Callable[[Matrix, Matrix, int], Matrix]
#: Where agents are to be, in a state: the same for all, or as leaders are there.
Target = Vector | Callable[[Vector], Vector]


@dataclass(frozen=True)
class Flight:
    """Leaders that move, by the worst row, and disturbances that push followers from their targets.

    Leaders move evenly over a step, for nobody hears of it before the next; a disturbance is a constant times the gain
    within a step.
    """

    W: Matrix
    speed: float
    delta: float

    @cached_property
    def parts(self) -> tuple[list[int], list[int], Matrix]:
        """Return leaders, followers, and ``-L_F^-1 L_FL``."""
        D = np.abs(self.W).sum(axis=1)
        F, A = np.flatnonzero(D > 0).tolist(), np.flatnonzero(D == 0).tolist()
        L = np.diag(D) - self.W
        return A, F, -np.linalg.solve(L[np.ix_(F, F)], L[np.ix_(F, A)])

    def targets(self, X: Matrix) -> Matrix:
        """Where agents are to be, for one state or many; leaders are where they are."""
        A, F, targets = self.parts
        aims = X.copy()
        aims[F] = targets @ X[A]
        return aims

    def move(self, x: Vector, new: Vector, dt: float, top: float, decay: Vector) -> None:
        """Add to the states after a step how leaders move, and what pushes followers under a gain up to ``top``."""
        A, F, targets = self.parts
        off = x[F] - targets @ x[A]
        row, D = int(np.argmax(np.abs(off))), np.abs(self.W).sum(axis=1)[F]
        new[A] += -np.sign(off[row]) * self.speed * np.where(targets[row] >= 0, 1.0, -1.0) * dt
        new[F] += self.delta * np.where(off >= 0, 1.0, -1.0) * (1 - decay) / (D * top)


@dataclass(frozen=True)
class LateMotion:
    """``x_k' = -gain (D_k x_k - sum_l w_kl x_l(t - tau_kl))``, the own state fresh or late as well.

    Attributes
    ----------
    W : (N, N) array
        ``W[k, l]`` is the weight with which ``k`` listens to ``l``.
    gains : list of Gain
        Of each agent, who may have a deadline of its own.
    taubar : float or (N, N) array
        No message is older: one age for all, or that of what ``k`` hears of ``l``.
    times : array
        From 0 on, by steps of the least ``taubar`` at most.
    own_late : bool
        The own state is heard late too, as old as each message.
    at_once : tuple of int
        Agents that listen to each other alone, at once: they move exactly so.
    flight : Flight, optional
        Leaders move, and disturbances act; all gains are the same.
    """

    W: Matrix
    gains: list[Gain]
    taubar: float | Matrix
    times: Vector
    own_late: bool = False
    at_once: tuple[int, ...] = ()
    flight: Flight | None = None

    def run(self, history: Vector, ages: Ages, errors: Callable[[Vector], Vector] | None = None) -> Matrix:
        """Return the states at all instants, (N, times).

        Parameters
        ----------
        history : (N,) array
            The states at 0 and before.
        ages : callable
            ``ages(states, oldest, j)``: the numbers of the instants, from ``oldest`` to ``j``, at which what ``k``
            hears of ``l`` in step ``j`` was said, (N, N) as ``oldest``.
        errors : callable, optional
            What is off in what each agent hears, added to every term of its sum, with the sign of the weight.
        """
        N, D = len(self.W), np.abs(self.W).sum(axis=1)
        X, own = np.empty((N, len(self.times))), np.arange(N)[None, :]
        X[:, 0] = history
        leading = list(self.at_once)
        A = (np.diag(D) - self.W)[np.ix_(leading, leading)]
        slowest = min((x.real for x in np.linalg.eigvals(A) if abs(x) > 1e-9), default=1.0) if leading else 1.0
        moved = [[g.between(a, b) for g in self.gains] for a, b in pairwise(self.times)]
        for j, ds in enumerate(np.array(moved)):
            # the first instant that is not older than taubar at the end of the step
            taubar = np.broadcast_to(self.taubar, (N, N))
            oldest = np.searchsorted(self.times[: j + 1], self.times[j + 1] - taubar * (1 - 1e-12))
            if oldest.max() > j:
                raise ValueError("a step longer than the largest delay")
            which = ages(X[:, : j + 1], oldest, j)
            pull = (self.W * X[own, which]).sum(axis=1) + (D * errors(X[:, j]) if errors is not None else 0)
            if self.own_late:
                X[:, j + 1] = X[:, j] - ds * ((np.abs(self.W) * X[own.T, which]).sum(axis=1) - pull)
                continue
            end, moves = pull / np.where(D > 0, D, 1), D > 0
            decay = np.exp(-D[moves] * ds[moves])
            X[:, j + 1] = X[:, j]
            X[moves, j + 1] = end[moves] + (X[moves, j] - end[moves]) * decay
            if self.flight is not None:
                a, b, gain = self.times[j], self.times[j + 1], self.gains[0]
                top = gain.rho1 if a >= gain.T else min(gain.cap, math.inf if b >= gain.T else gain.value(b))
                self.flight.move(X[:, j], X[:, j + 1], b - a, top, decay)
            if self.at_once:
                X[leading, j + 1] = expm(-A * min(ds[0], 50 / slowest)) @ X[leading, j]
        return X


def oldest_of_all(X: Matrix, oldest: Matrix, j: int) -> Matrix:
    """Every message as late as may be."""
    return oldest


def by_chance(rng: np.random.Generator) -> Ages:
    """Every message of some age."""
    return lambda X, oldest, j: rng.integers(oldest, j + 1, (len(X), len(X)))


def square_wave(period: int, phases: Matrix) -> Ages:
    """Each edge fresh for some steps, then as late as may be for some, in turn."""
    return lambda X, oldest, j: np.where((j + phases) // period % 2 == 0, j, oldest)


def worst(W: Matrix, target: Target) -> Ages:
    """The message of each neighbour that drives the listener farthest from its target, on the side where it is."""

    def ages(X: Matrix, oldest: Matrix, j: int) -> Matrix:
        aim = target(X[:, j]) if callable(target) else target
        side, which = np.sign(W) * np.where(X[:, j] >= aim, 1.0, -1.0)[:, None], oldest.copy()
        for first in np.unique(oldest):
            window = X[:, first:]
            far = np.where(side > 0, window.argmax(axis=1)[None, :], window.argmin(axis=1)[None, :])
            which = np.where(oldest == first, first + far, which)
        return which

    return ages


def worst_errors(nu: float, target: Target) -> Callable[[Vector], Vector]:
    """Errors of received values that drive every listener away from its target."""
    return lambda x: np.where(x >= (target(x) if callable(target) else target), nu, -nu)


# ---------------------------------------------------------------------- moving leaders


@dataclass(frozen=True)
class Moving:
    """Followers of leaders that move, ``x_F' = gain e_F + d``, without delay.

    Speeds and disturbances are a constant times the gain within a step, never above their limits: the equation is one
    with constant coefficients on the clock.
    """

    L: Matrix
    leaders: list[int]
    followers: list[int]
    gain: Gain
    speed: float
    delta: float

    @property
    def targets(self) -> Matrix:
        """``-L_F^-1 L_FL``."""
        F, A = self.followers, self.leaders
        return -np.linalg.solve(self.L[np.ix_(F, F)], self.L[np.ix_(F, A)])

    def run(self, x0: Vector, times: Vector, u: Vector) -> tuple[Matrix, Matrix]:
        """Return states and targets at all instants, the worst row pushed out at each step."""
        F, A, targets = self.followers, self.leaders, self.targets
        LF, m = self.L[np.ix_(F, F)], len(self.followers)
        X, aims = np.empty((len(x0), len(times))), np.empty((m, len(times)))
        X[:, 0], aims[:, 0] = x0, targets @ x0[A]
        for j, (a, b) in enumerate(pairwise(times)):
            top, ds = max(self.gain.value(a), self.gain.value(b)), self.gain.between(a, b)
            velocity, push = self._worst(X[F, j] - aims[:, j], u, targets)
            # d eps/ds = -L_F eps + forcing
            B = np.zeros((m + 1, m + 1))
            B[:m, :m], B[:m, m] = -LF * ds, (push - targets @ velocity) * ds / top
            eps = (expm(B) @ np.append(X[F, j] - aims[:, j], 1.0))[:m]
            X[A, j + 1] = X[A, j] + velocity * ds / top
            aims[:, j + 1] = targets @ X[A, j + 1]
            X[F, j + 1] = aims[:, j + 1] + eps
        return X, aims

    def run_sign(self, x0: Vector, u: Vector, mu: float, layer: float) -> tuple[Vector, Matrix, Matrix]:
        """Return instants, states and targets with ``mu sat(e/layer)`` besides, up to ``1.2 T``, by Heun's method."""
        F, A, targets = self.followers, self.leaders, self.targets
        LF, D, T = self.L[np.ix_(F, F)], float(np.diag(self.L).max()), self.gain.T
        t, X = 0.0, [x0.copy()]
        times, aims = [0.0], [targets @ x0[A]]
        while t < 1.2 * T:
            dt = min(0.05 / (D * self.gain.value(t)), 0.2 * layer / max(mu * D, 1e-9), T / 50)
            if t < T < t + dt + 1e-3 * T:
                dt = max(T - t, 1e-3 * T)  # the last thousandth before T is left out
            eps = X[-1][F] - aims[-1]
            velocity, push = self._worst(eps, u, targets)

            def slope(eps: Vector, t: float, velocity: Vector = velocity, push: Vector = push) -> Vector:
                e = -LF @ eps
                return self.gain.value(t) * e + mu * np.clip(e / layer, -1, 1) + push - targets @ velocity

            if t >= T or t + dt < T:
                first = slope(eps, t)
                eps = eps + dt / 2 * (first + slope(eps + dt * first, t + dt))
                x = X[-1].copy()
                x[A] += velocity * dt
                x[F] = targets @ x[A] + eps
                X.append(x)
                times.append(t + dt)
                aims.append(targets @ x[A])
            t += dt
        return np.array(times), np.array(X).T, np.array(aims).T

    def _worst(self, off: Vector, u: Vector, targets: Matrix) -> tuple[Vector, Vector]:
        """Return velocities of leaders and disturbances that drive the worst row out."""
        row = int(np.argmax(np.abs(off) / u))
        side = 1.0 if off[row] >= 0 else -1.0
        velocity = -side * self.speed * np.where(targets[row] >= 0, 1.0, -1.0)
        return velocity, self.delta * np.where(off >= 0, 1.0, -1.0)
