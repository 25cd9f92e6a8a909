"""Whether what a certificate of the cascade claims is true: judged from a motion in positions and velocities.

The motion is formed from ``x' = v``, ``v' = eta' e + eta e' + alpha eta (eta e - v)``, of deviations from the common
motion: in a basis of the range of ``L``, so that they have no floor. At the instants that a file tells of it is formed
once more, by power series in ``t`` of many digits. What is said of the graph is left to :mod:`oracle`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import flint
import numpy as np
from oracle import Json, Matrix, Oracle, ball, number
from oracle_agents import SLACK, AgentOracle, of_graph_alone
from scipy.integrate import quad, solve_ivp

#: ``z = ln(T/(T - t))`` up to which the motion is formed, unless it decays by ``e^-MOST`` before; and instants.
LATEST, MOST, COUNT = 12.0, 60.0, 17
#: Bits of power series, which end where eight terms are below ``2^-SMALL`` of the largest.
BITS, SMALL = 3000, 400


class Motion(NamedTuple):
    """Deviations of agents from the common motion at some instants, and their inputs without it."""

    z: np.ndarray
    states: np.ndarray
    inputs: np.ndarray


def false_claims_of_cascade(data: Json, files: Mapping[str, bytes] | None = None) -> list[str]:
    """Say what is false in an accepted certificate of the cascade; an empty list if nothing is."""
    judge = CascadeOracle(data, files or {})
    proved = "influence" in data and (
        bool(data["agents"]["functions"]) or not data["problem"]["graph"]["modes"][0]["edges"]
    )
    judge.require((data["verdict"] == "certified") is proved, "verdict")
    judge.require(not any(judge.sigma0), "sliding variables")
    judge.judged()
    return [*of_graph_alone(data, files), *judge.false]


class CascadeOracle(AgentOracle):
    """One certificate of the cascade."""

    def __init__(self, data: Json, files: Mapping[str, bytes]):
        Oracle.__init__(self, data, files)
        self.agents: Json = data["agents"]
        self.alpha = number(self.agents["cascade"])
        self.order, self.d = 2, self.agents["dimension"]
        self.a, self.f = [Fraction(0)] * 2, [Fraction(0), self.alpha]
        self.cap = None

    def judged(self) -> None:
        self.require(self.alpha > 0, "alpha is not positive")
        if self.false:
            return
        self.used = [(e, self.data["decays"][e["function"]]) for e in self.agents["functions"]]
        for claim in (
            self.error_constants,
            self.common,
            self.ends,
            self.velocities,
            self.roots,
            self.along_a_motion,
            self.where_halves_are_left,
        ):
            claim()

    def velocities(self) -> None:
        """Velocities vanish at ``T`` where ``k Re lambda > 1``."""
        said = self.agents.get("final_state")
        if said is None or not any(len(row) > 1 for rows in said.values() for row in rows):
            return
        values = np.linalg.eigvals(np.array([[float(x) for x in row] for row in self.L]))
        slowest = min((x.real for x in values if abs(x) > 1e-6), default=math.inf)
        self.require(float(self.gain[2]) * slowest > 1 - 1e-6, "velocities that do not vanish")

    def errors(self) -> list[list[Fraction]]:
        """``q(0) = v(0) + eta(0) L x(0)``, by agent and coordinate."""
        X = self.shifted
        return [
            [
                row[axis][1] + self.eta_0 * sum((a * X[j][axis][0] for j, a in enumerate(self.L[k])), Fraction(0))
                for axis in range(self.d)
            ]
            for k, row in enumerate(X)
        ]

    def roots(self) -> None:
        """``initial`` and ``drive`` of every function used, in rationals."""
        begin = self.agents.get("initial_state")
        for entry, function in self.used:
            self.require(number(function["rate"]) > 0, "a function that does not decay")
            if begin is None:
                self.require("initial" not in entry and "drive" not in entry, "roots without states")
                continue
            Z = self.form(function)[0]
            starts = [[row[axis][0] for axis in range(self.d)] for row in self.shifted]
            for key, rows in (("initial", starts), ("drive", self.errors())):
                value = sum(
                    (z * sum(x * y for x, y in zip(rows[k], rows[m], strict=True)))
                    for k, own in enumerate(Z)
                    for m, z in enumerate(own)
                    if z
                )
                self.require(number(entry[key]) ** 2 >= value and number(entry[key]) >= 0, key)

    def along_a_motion(self) -> None:
        """``V`` of positions, and the input, along a motion."""
        if "initial_state" not in self.agents:
            return
        X = np.array([[[float(x) for x in row] for row in agent] for agent in self.shifted])
        L = np.array([[float(x) for x in row] for row in self.L])
        Q = np.array([[float(x) for x in row] for row in self.Q])
        T, rho1, k = map(float, self.gain)
        run = moved(L.tobytes(), X.tobytes(), X.shape, (T, rho1, k, float(self.alpha)))
        for entry, function in self.used:
            Z = np.array([[float(x) for x in row] for row in self.form(function)[0]])
            sizes = np.sqrt(
                np.maximum(np.einsum("kl,mka,mla->m", Z, run.states[:, :, :, 0], run.states[:, :, :, 0]), 0)
            )
            v, w, rate = (float(number(x)) for x in (entry["initial"], entry["drive"], function["rate"]))
            for z, size in zip(run.z, sizes, strict=True):
                bound = v * math.exp(-rate / 2 * clock(self.gain, z)) + w * integral(self.gain, self.alpha, rate, z)
                self.require(size <= bound * (1 + SLACK) + 1e-13 * sizes[0], f"V at z = {z}")
        said = self.agents.get("input")
        if said is None:
            return
        self.require(number(said["largest"]) == max(map(number, said["agents"].values())), "the largest input")
        pushed = float(self.gains["mu1"]) * math.sqrt(self.d) if "mu1" in self.gains else 0.0
        common = np.einsum("kl,la->ka", Q, X[:, :, 1])
        for z, u in zip(run.z, run.inputs, strict=True):
            eta = rho1 + k / T * math.exp(z)
            whole = u - float(self.alpha) * eta * math.exp(-float(self.alpha) * clock(self.gain, z)) * common
            for v, bound in enumerate(self.by_label(said["agents"])):
                seen = float(np.linalg.norm(whole[v])) * (1 - SLACK) + pushed
                self.require(float(number(bound)) * (1 + 1e-9) >= seen - 1e-9, f"input at z = {z}: {bound} {seen}")

    def where_halves_are_left(self) -> None:
        """``sqrt(V)`` of positions and of ``r = x'/eta + (alpha + theta) x`` at ``T (1 - 2^-i)``."""
        told = self.data.get("instants")
        if told is None:
            return
        self.require("initial_state" in self.agents and told, "instants of no motion")
        if self.false:
            return
        T, rho1, k = self.gain
        states = tuple(tuple(map(tuple, row)) for row in self.shifted)
        motion = halved(self.key, states, (*self.gain, self.alpha), len(told))
        for i, (row, (x, v)) in enumerate(zip(told, motion, strict=True), 1):
            eta = rho1 + k / T * 2**i
            pull = self.alpha + k * (2**i / (T * eta)) ** 2
            self.require(len(row) == 2 * len(self.used), "entries of an instant")
            for (_, function), S, R in zip(self.used, row[::2], row[1::2], strict=True):
                Z = self.form(function)[0]
                for root, at in ((S, x), (R, v * ball(1 / eta) + x * ball(pull))):
                    self.require(root is None or not below(number(root), Z, at), f"V where 2^-{i} is left")


def below(root: Fraction, Z: Matrix, at: Any) -> bool:
    """Whether a number is negative, or its square surely below ``V`` of agents, (N, d)."""
    pushed = flint.arb_mat([[ball(z) for z in row] for row in Z]) * at
    value = sum((x * y for x, y in zip(at.entries(), pushed.entries(), strict=True)), flint.arb(0))
    return root < 0 or bool(ball(root**2) < value)


def clock(gain: tuple[Fraction, Fraction, Fraction], z: float) -> float:
    """``s``, the integral of the gain."""
    T, rho1, k = map(float, gain)
    return -rho1 * T * math.expm1(-z) + k * z


def integral(gain: tuple[Fraction, Fraction, Fraction], alpha: Fraction, rate: float, z: float) -> float:
    """``int_0^t e^(-(rate/2)(s(t) - s(r)) - alpha s(r)) dr``, by quadrature in ``z``."""
    T, end, b, a = float(gain[0]), clock(gain, z), rate / 2, float(alpha)
    field: Callable[[float], float] = lambda x: (  # noqa: E731
        T * math.exp(-x - b * (end - clock(gain, x)) - a * clock(gain, x))
    )
    pieces = np.linspace(0, z, 9)
    return sum(quad(field, low, high, epsabs=0, epsrel=1e-9)[0] for low, high in pairwise(pieces))


@lru_cache(maxsize=300)
def moved(laplacian: bytes, states: bytes, shape: tuple[int, ...], numbers: tuple[float, ...]) -> Motion:
    """Integrate deviations from the common motion, agents by coordinates by (position, velocity)."""
    N = shape[0]
    L, X = np.frombuffer(laplacian).reshape(N, N), np.frombuffer(states).reshape(shape)
    T, rho1, k, alpha = numbers
    left, sizes, right = np.linalg.svd(L)
    rank = int((sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)).sum())
    U, kernel = left[:, :rank], right[rank:].T
    begin = np.linalg.solve(np.hstack([U, kernel]), X.reshape(N, -1))[:rank].reshape(rank, *shape[1:])
    B = U.T @ L @ U

    def control(z: float, w: np.ndarray) -> np.ndarray:
        eta, slope = rho1 + k / T * math.exp(z), k / T**2 * math.exp(2 * z)
        e, e_dot = (-np.einsum("kl,la->ka", B, w[:, :, i]) for i in range(2))
        return slope * e + eta * e_dot + alpha * eta * (eta * e - w[:, :, 1])

    def field(z: float, flat: np.ndarray) -> np.ndarray:
        w = flat.reshape(begin.shape)
        return (T * math.exp(-z) * np.stack([w[:, :, 1], control(z, w)], axis=2)).ravel()

    fastest = (rho1 * T + k) * max(2 * np.abs(np.diag(L)).max(initial=0), alpha, 1 / k)
    places, w, found = np.linspace(0, min(LATEST, MOST / fastest), COUNT), begin, [begin]
    for low, high in pairwise(places):
        # positions and velocities decay by factors: each stretch has a tolerance of its own
        eta, (x, v) = rho1 + k / T * math.exp(low), np.abs(w).max(axis=(0, 1), initial=0)
        size = np.maximum([max(x, v / eta), max(v, eta * x)], 1e-290)
        atol = np.broadcast_to(1e-12 * size, w.shape).ravel()
        run = solve_ivp(field, (low, high), w.ravel(), "LSODA", rtol=1e-10, atol=atol) if w.size else None
        assert run is None or run.success
        w = w if run is None else run.y[:, -1].reshape(begin.shape)
        found.append(w)
    inputs = [np.einsum("ki,ia->ka", U, control(z, w)) for z, w in zip(places, found, strict=True)]
    return Motion(places, np.array([np.einsum("ki,iaj->kaj", U, w) for w in found]), np.array(inputs))


@lru_cache(maxsize=100)
def halved(laplacian: Any, states: Any, numbers: tuple[Fraction, ...], count: int) -> list[tuple[Any, Any]]:
    """Positions and velocities, (N, d) each, where ``2^-i`` of the time is left, ``i = 1, .., count``.

    While ``w (1 - y/2)`` is left, ``0 <= y <= 1``, with ``q = rho1 w/2``, ``h = k + 2 q`` and ``D = d/dy``,

        (4 - 4 y + y^2) D^2 x = -L ((k + alpha (h - q y)^2) x + F) - alpha F,  F = (2 h - (h + 2 q) y + q y^2) D x
    """
    flint.ctx.prec = BITS
    w, rho1, k, alpha = map(ball, numbers)
    L = flint.arb_mat([[ball(a) for a in row] for row in laplacian])
    x, v = (flint.arb_mat([[ball(chain[i]) for chain in agent] for agent in states]) for i in (0, 1))
    found = []
    for _ in range(count):
        q, h, c = rho1 * w / 2, rho1 * w + k, [0 * x, 0 * x, x, v * (w / 2)]
        sizes = [size(each) for each in c]
        while len(c) < 12 or max(sizes[-8:]) > max(sizes) / 2**SMALL:
            m = len(c) - 4
            assert m < 10_000, "a series that does not end"
            fast = c[-1] * (2 * h * (m + 1)) - c[-2] * ((h + 2 * q) * m) + c[-3] * (q * (m - 1))
            drawn = c[-2] * (k + alpha * h**2) - c[-3] * (2 * alpha * h * q) + c[-4] * (alpha * q**2)
            own = c[-1] * (4 * m * (m + 1)) - c[-2] * (m * (m - 1))
            c.append((own - L * (drawn + fast) - fast * alpha) * (1 / flint.arb(4 * (m + 1) * (m + 2))))
            sizes.append(size(c[-1]))
        x, v = sum(c, 0 * x), sum((m * each for m, each in enumerate(c[2:])), 0 * x) * (2 / w)
        x, v, w = x.mid(), v.mid(), w / 2  # their radii would grow by many digits in every step
        found.append((x, v))
    return found


def size(matrix: Any) -> Any:
    """Not below the largest entry."""
    return max(x.abs_upper() for x in matrix.entries())
