"""Whether what a certificate of agents of order n claims is true: judged from the closed loop, without the checker.

What is said of the graph is left to :mod:`oracle`. Of the agents the closed loop is formed as the file states it, with
the gains as they are written: that ``V`` decreases is decided in rationals at many gains, the common motion in balls,
and bounds are compared with an integrated motion. A bound that some instant exceeds is false.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import flint
import numpy as np
from oracle import Json, Matrix, Oracle, ball, false_claims, number
from scipy.integrate import solve_ivp

#: Shares of the interval of ``zeta`` at which the decrease is decided.
SHARES = (0, 1, Fraction(1, 2), Fraction(1, 7), Fraction(6, 7), Fraction(1, 50), Fraction(49, 50), Fraction(19, 60))
#: A bound may lie below what floats find by this share.
SLACK = 1e-7
#: ``z = ln(T/(T - t))`` up to which the motion is formed.
LATEST = 4.0


def false_claims_of_agents(data: Json, files: Mapping[str, bytes] | None = None) -> list[str]:
    """Say what is false in an accepted certificate of agents of order n; an empty list if nothing is."""
    functions, known = data["agents"]["functions"], "influence" in data
    judge = AgentOracle(data, files or {})
    certified = known and (bool(functions) or not data["problem"]["graph"]["modes"][0]["edges"])
    judge.require((data["verdict"] == "certified") is certified, "verdict")
    empty = "initial_state" not in data["problem"] and "input" not in data
    judge.require(empty and not any(judge.sigma0), "what is said of agents of order 1")
    judge.judged()
    return [*of_graph_alone(data, files), *judge.false]


def of_graph_alone(data: Json, files: Mapping[str, bytes] | None) -> list[str]:
    """Say what is false of the graph alone; most mutants of agents have the same."""
    proved = "proved" in data["rates"] or not data["problem"]["graph"]["modes"][0]["edges"]
    of_graph = {key: x for key, x in data.items() if key != "agents"}
    of_graph["verdict"] = "certified" if "influence" in data and proved else "undecided"
    of_graph["proof"] = [step for step in data["proof"] if step["of"] != "agents"]
    text = json.dumps({**of_graph, "digest": "", "unverified": {}})
    return false_claims(json.loads(text), files) if files else list(_without_files(text))


@lru_cache(maxsize=50)
def _without_files(text: str) -> tuple[str, ...]:
    return tuple(false_claims(json.loads(text), None))


class Motion(NamedTuple):
    """A motion at some instants: ``z``, gain, clock, states (agents, coordinates, derivatives), inputs."""

    z: float
    gain: float
    clock: float
    states: np.ndarray
    inputs: np.ndarray


class AgentOracle(Oracle):
    """One certificate of agents of order n."""

    def __init__(self, data: Json, files: Mapping[str, bytes]):
        super().__init__(data, files)
        self.agents: Json = data["agents"]
        self.order, self.d = self.agents["order"], self.agents["dimension"]
        self.a, self.f, self.K = (list(map(number, self.agents[key])) for key in ("plant", "own", "gains"))
        self.r = number(self.agents["rate"])
        self.cap = number(self.agents["gain_cap"]) if "gain_cap" in self.agents else None
        lower = [list(map(number, row)) for row in self.agents["lower_triangle"]]
        n = self.order
        self.W = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]

    def judged(self) -> None:
        self.require(definite(self.W), "W > 0")
        self.require(self.r > 0, "a rate that is not positive")
        k = self.gain[2]
        self.require(self.cap is not None or self.r * k > 2 * (self.order - 1), "derivatives need not agree")
        if self.false:
            return
        self.used = [(e, self.data["decays"][e["function"]]) for e in self.agents["functions"]]
        for claim in (
            self.decrease,
            self.spectrum,
            self.error_constants,
            self.common,
            self.ends,
            self.bounds_of_motion,
        ):
            claim()

    # ------------------------------------------------------------------ decrease

    def chain(self, zeta: Fraction, theta: Fraction) -> Matrix:
        """``A_z``: how the scaled state of one agent moves on the clock without neighbours."""
        n = self.order
        rows = [[Fraction(0)] * n for _ in range(n)]
        for i in range(n):
            rows[i][i] -= i * theta
            if i + 1 < n:
                rows[i][i + 1] += 1
            rows[n - 1][i] -= self.f[i] + self.a[i] * zeta ** (n - i)
        return rows

    @property
    def gains_at(self) -> list[tuple[Fraction, Fraction]]:
        """Values of ``(zeta, theta)`` that occur."""
        T, rho1, k = self.gain
        first, found = rho1 + k / T, []
        if self.cap is None or self.cap > first:
            low, high = (Fraction(0) if self.cap is None else 1 / self.cap), 1 / first
            found = [(z, (1 - rho1 * z) ** 2 / k) for z in (low + (high - low) * Fraction(x) for x in SHARES)]
        return found if self.cap is None else [*found, (1 / self.cap, Fraction(0))]

    def decrease(self) -> None:
        """``dV/ds + r V <= 0`` in rationals, all agents together, with the gains as they are written."""
        P = flint.fmpq_mat([[rational(x) for x in row] for row in self.W]).inv()
        for entry, function in self.used:
            self.require(number(function["rate"]) > 0, "a function that does not decay")
            Z = self.form(function)[0]
            for zeta, theta in self.gains_at:
                falls = decreases(self.key, tuple(map(tuple, Z)), P, self.chain(zeta, theta), self.K, self.r)
                self.require(falls, f"the decrease of function {entry['function']} at zeta = {zeta}")

    def spectrum(self) -> None:
        """At constant gain nothing decays more slowly than the rate says."""
        if not self.used:
            return
        _T, _, k = self.gain
        theta = 1 / k if self.cap is None else Fraction(0)
        zeta = Fraction(0) if self.cap is None else 1 / self.cap
        A = np.array([[float(x) for x in row] for row in self.chain(zeta, theta)])
        values = np.linalg.eigvals(np.array([[float(x) for x in row] for row in self.L]))
        K = np.array([float(x) for x in self.K])
        for value in values[np.abs(values) > 1e-6]:
            M = A.astype(complex)
            M[-1] -= value * K
            slowest = -2 * np.linalg.eigvals(M).real.max()
            self.require(float(self.r) <= slowest * (1 + 1e-5) + 1e-5, "a rate above the spectral one")

    def error_constants(self) -> None:
        for entry, function in self.used:
            if "inputs" not in entry:
                continue
            _, P, _, nodes = self.form(function)
            for v, c in enumerate(self.vector(entry["inputs"])):
                S = [
                    [c * x - (u == v) * (w == v) for x, w in zip(row, nodes, strict=True)]
                    for row, u in zip(P, nodes, strict=True)
                ]
                self.require(c >= 0 and semidefinite(S), "a constant of the input")

    # ------------------------------------------------------------------ common motion

    @cached_property
    def M(self) -> list[list[Any]]:
        """What the common motion is at the deadline, in balls."""
        n, (T, rho1, k) = self.order, self.gain
        flint.ctx.prec = 1500
        if not any(self.f):
            A = [[Fraction(int(j == i + 1)) for j in range(n)] for i in range(n - 1)] + [[-x for x in self.a]]
            return flint.arb_mat([[ball(x * T) for x in row] for row in A]).exp().tolist()
        # x'' + a_2 x' + f_2 eta x' = 0: the integral of exp(-w (1 - q)) q^p by Kummer's transformation
        w, p = (self.a[1] + self.f[1] * rho1) * T, self.f[1] * k
        m = ball(T / (p + 1)) * ball(-w).exp() * ball(w).hypgeom_1f1(ball(p + 1), ball(p + 2))
        return [[ball(Fraction(1)), m], [ball(Fraction(0)), ball(Fraction(0))]]

    def holds_ball(self, said: Any, value: Any) -> bool:
        mid, radius = (number(said["mid"]), number(said["radius"])) if isinstance(said, dict) else (number(said), 0)
        return not abs(value - ball(mid)) > ball(Fraction(radius))

    def common(self) -> None:
        own = any(self.f)
        allowed = not own or (self.order == 2 and self.f[0] == 0 < self.f[1] and self.a[0] == 0 and self.cap is None)
        self.require(allowed, "a common motion that is not known")
        if allowed:
            for row, true in zip(self.agents["motion"], self.M, strict=True):
                for said, x in zip(row, true, strict=True):
                    self.require(self.holds_ball(said, x), "motion")

    @cached_property
    def shifted(self) -> list[list[list[Fraction]]]:
        """``xi_k(0) - (h_k, 0, ..)``."""
        found = []
        for label in self.labels:
            pairs = zip(self.agents["initial_state"][label], self.offsets(label), strict=True)
            found.append([[number(x) - (h if j == 0 else 0) for j, x in enumerate(row)] for row, h in pairs])
        return found

    def offsets(self, label: str) -> list[Fraction]:
        return list(map(number, self.agents["offsets"][label]))

    def ends(self) -> None:
        """Final states: ``h + Q M`` of the initial ones."""
        said = self.agents.get("final_state")
        if said is None:
            return
        n = self.order
        for k, label in enumerate(self.labels):
            for axis in range(self.d):
                moved = [
                    sum((q * row[axis][j] for q, row in zip(self.Q[k], self.shifted, strict=True)), Fraction(0))
                    for j in range(n)
                ]
                for i, x in enumerate(said[label][axis]):
                    end = ball(self.offsets(label)[axis] if i == 0 else Fraction(0))
                    for j in range(n):
                        end += self.M[i][j] * ball(moved[j])
                    self.require(self.holds_ball(x, end), f"final state of {label}")

    # ------------------------------------------------------------------ the motion

    @cached_property
    def eta_0(self) -> Fraction:
        T, rho1, k = self.gain
        return rho1 + k / T if self.cap is None else min(rho1 + k / T, self.cap)

    @cached_property
    def run(self) -> list[Motion]:
        """The closed loop, in the coordinates of the file."""
        keys = ("order", "dimension", "plant", "own", "gains", "offsets", "initial_state")
        told = {key: self.agents[key] for key in keys} | {"gain": self.data["problem"]["gain"], "labels": self.labels}
        text = json.dumps(told, sort_keys=True)
        return integrated(self.key, text, tuple(map(float, self.gain)), None if self.cap is None else float(self.cap))

    def value(self, Z: np.ndarray, states: np.ndarray, zeta: float) -> float:
        """``V`` of some states less offsets."""
        P = np.linalg.inv(np.array([[float(x) for x in row] for row in self.W]))
        Y = states * zeta ** np.arange(self.order)
        return float(np.einsum("kl,kai,ij,laj->", Z, Y, P, Y))

    def bounds_of_motion(self) -> None:
        """Decrease, deviations, residual and input along a motion."""
        if "initial_state" not in self.agents or not self.used:
            return
        H = np.array([[float(x) for x in self.offsets(label)] for label in self.labels])
        W, r = [float(self.W[i][i]) for i in range(self.order)], float(self.r)
        Q = np.array([[float(x) for x in row] for row in self.Q])
        known = []
        for _, function in self.used:
            Z = np.array([[float(x) for x in row] for row in self.form(function)[0]])
            deviation = function.get("deviation")
            constants = None if deviation is None else [float(number(c)) for c in self.by_label(deviation["agents"])]
            known.append((Z, constants, self.value(Z, self.less(self.run[0].states, H), 1 / self.run[0].gain)))
        for at in self.run:
            states = self.less(at.states, H)
            away = states - np.einsum("kl,lai->kai", Q, states)
            size = float(np.abs(states).max()) + 1
            for Z, constants, begin in known:
                left = begin * math.exp(-r * at.clock)
                floor = 1e-14 * size**2 * float(np.abs(Z).max()) * max(1.0, 1 / min(W)) + SLACK * left
                self.require(self.value(Z, away, 1 / at.gain) <= left + floor * 1e3, f"V at z = {at.z}")
                for i, w in enumerate(W):
                    for v, c in enumerate(constants or ()):
                        bound = at.gain**i * math.sqrt(c * w * left)
                        seen = float(np.linalg.norm(away[v, :, i]))
                        self.require(seen <= bound * (1 + SLACK) + 1e-8 * size * at.gain**i, f"deviation at z = {at.z}")
        self.judge_input()
        self.judge_residual(H, Q)

    def by_label(self, said: Json) -> list[str]:
        return [said[label] for label in self.labels]

    @staticmethod
    def less(states: np.ndarray, H: np.ndarray) -> np.ndarray:
        found = states.copy()
        found[:, :, 0] -= H
        return found

    def judge_input(self) -> None:
        said = self.agents.get("input")
        if said is None:
            return
        self.require(number(said["largest"]) == max(map(number, said["agents"].values())), "the largest input")
        g = self.gains
        pushed = float(g["mu1"]) * math.sqrt(self.d) if "mu1" in g else 0.0
        for at in self.run:
            for v, bound in enumerate(self.by_label(said["agents"])):
                seen = float(np.linalg.norm(at.inputs[v])) * (1 - SLACK) + pushed
                self.require(float(number(bound)) * (1 + 1e-9) >= seen - 1e-7, f"input at z = {at.z}: {bound} {seen}")

    def judge_residual(self, H: np.ndarray, Q: np.ndarray) -> None:
        said = self.agents.get("residual")
        if said is None:
            return
        last = self.run[-1]
        self.require(float(number(said["clock"])) <= last.clock * (1 + 1e-9), "clock")
        states = self.less(last.states, H)
        away = states - np.einsum("kl,lai->kai", Q, states)
        for v, row in enumerate(self.by_label(said["agents"])):
            for i, x in enumerate(row):
                seen = float(np.linalg.norm(away[v, :, i]))
                self.require(float(number(x)) * (1 + SLACK) + 1e-8 * (1 + np.abs(states).max()) >= seen, "residual")
        self.judge_ends(last)

    def judge_ends(self, last: Motion) -> None:
        """With a capped gain the motion goes on to the deadline: what is claimed there, from the motion itself."""
        said, left = self.agents.get("final_state"), self.agents["residual"]["agents"]
        for v, label in enumerate(self.labels if said is not None else ()):
            middles = np.array([[float(self.middle(x)) for x in row] for row in said[label]])
            off = np.linalg.norm(last.states[v] - middles, axis=0)
            wide = np.array([[float(self.width(x)) for x in row] for row in said[label]])
            for i in range(self.order):
                most = float(number(left[label][i])) * (1 + SLACK) + float(np.linalg.norm(wide[:, i]))
                self.require(off[i] <= most + 1e-7 * (1 + np.abs(middles).max()), "the motion ends elsewhere")

    @staticmethod
    def middle(x: Any) -> Fraction:
        return number(x["mid"] if isinstance(x, dict) else x)

    @staticmethod
    def width(x: Any) -> Fraction:
        return number(x["radius"]) if isinstance(x, dict) else Fraction(0)


def rational(x: Fraction) -> Any:
    return flint.fmpq(x.numerator, x.denominator)


def semidefinite(S: Matrix) -> bool:
    """Whether ``x'S x >= 0`` for all ``x``, of a symmetric matrix in rationals."""
    return no_negative_root([[rational(x) for x in row] for row in S])


def no_negative_root(S: list[list[Any]]) -> bool:
    """Whether no eigenvalue of a symmetric matrix is negative: all are real, so Descartes' rule of signs decides it."""
    n, polynomial = len(S), flint.fmpq_mat(S).numer_denom()[0].charpoly()
    return all(polynomial[k] * (-1) ** (n - k) >= 0 for k in range(n + 1))


def definite(W: Matrix) -> bool:
    """Sylvester's criterion."""
    return all(
        flint.fmpq_mat([[rational(x) for x in row[: k + 1]] for row in W[: k + 1]]).det() > 0 for k in range(len(W))
    )


def decreases(L: Any, Z: Any, P: Any, A: Matrix, K: list[Fraction], r: Fraction) -> bool:
    """Whether ``(Z (x) P) G + G'(Z (x) P) + r Z (x) P <= 0``, ``G = I (x) A - L (x) b K``."""
    N, n = len(L), len(A)
    forms = flint.fmpq_mat([[rational(x) for x in row] for row in Z])
    laplacian = flint.fmpq_mat([[rational(x) for x in row] for row in L])
    chain = flint.fmpq_mat([[rational(x) for x in row] for row in A])
    push = flint.fmpq_mat([[rational(x) if i == n - 1 else flint.fmpq(0) for x in K] for i in range(n)])
    one, other = P * chain, P * push  # of I (x) A and of L (x) b K
    both = one + one.transpose() + P * rational(r)
    pulled = forms * laplacian
    rows = [
        [
            -forms[k, m] * both[i, j] + pulled[k, m] * other[i, j] + pulled[m, k] * other[j, i]
            for m in range(N)
            for j in range(n)
        ]
        for k in range(N)
        for i in range(n)
    ]
    return no_negative_root(rows)


@lru_cache(maxsize=200)
def integrated(L: Any, text: str, gain: tuple[float, float, float], cap: float | None) -> list[Motion]:
    """Integrate ``x^(n) + sum a_i x^(i-1) = u`` up to ``LATEST``, or up to the deadline if the gain is capped."""
    told, (T, rho1, k) = json.loads(text), gain
    n, labels = told["order"], told["labels"]
    read = lambda values: np.array([float(number(x)) for x in values])  # noqa: E731
    a, f, K = (read(told[key]) for key in ("plant", "own", "gains"))
    H = np.array([read(told["offsets"][label]) for label in labels])
    X = np.array([[read(row) for row in told["initial_state"][label]] for label in labels])
    A = np.array([[float(x) for x in row] for row in L])

    def eta(t: float) -> float:
        value = rho1 + k / max(T - t, 1e-300)
        return value if cap is None else min(value, cap)

    def inputs(t: float, states: np.ndarray) -> np.ndarray:
        g = eta(t)
        y = states.copy()
        y[:, :, 0] -= H
        y *= g ** -np.arange(n, dtype=float)
        eps = -np.einsum("kl,lai->kai", A, y)
        return g**n * (eps @ K - y @ f) + a[0] * H

    def slope(t: float, flat: np.ndarray) -> np.ndarray:
        states = flat.reshape(X.shape)
        moved = np.empty_like(states)
        moved[:, :, :-1] = states[:, :, 1:]
        moved[:, :, -1] = inputs(t, states) - states @ a
        return moved.ravel()

    # The time is tau = ln(T/(T - t)) before the cap; from there on t itself.
    turn = T if cap is None else max(T - k / (cap - rho1), 0.0) if cap > rho1 + k / T else 0.0
    last = LATEST if cap is None else (math.log(T / (T - turn)) if turn > 0 else 0.0)
    places = sorted({*np.linspace(0, last, 25)})
    found = []

    def note(t: float, z: float, flat: np.ndarray) -> None:
        clock = rho1 * min(t, turn) + (k * math.log(T / (T - min(t, turn))) if min(t, turn) < T else 0.0)
        clock += (cap or 0.0) * max(t - turn, 0.0)
        states = flat.reshape(X.shape).copy()
        found.append(Motion(z, eta(t), clock, states, inputs(t, states)))

    options: Json = {"method": "LSODA", "rtol": 1e-11, "atol": 1e-12 * (1 + float(np.abs(X).max()))}
    flat = X.ravel()
    if last > 0:
        field = lambda z, x: T * math.exp(-z) * slope(T * -math.expm1(-z), x)  # noqa: E731
        run = solve_ivp(field, (0, last), flat, t_eval=places, **options)
        assert run.success
        for z, column in zip(run.t, run.y.T, strict=True):
            note(T * -math.expm1(-z), z, column)
        flat = run.y[:, -1]
    if cap is not None:
        run = solve_ivp(slope, (turn, T), flat, t_eval=np.linspace(turn, T, 25), **options)
        assert run.success
        for t, column in zip(run.t, run.y.T, strict=True):
            note(t, math.inf, column)
    return found
