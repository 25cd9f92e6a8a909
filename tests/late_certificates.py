"""Certificates with late messages, or with leaders that move, made by hand from those of the graph as it stands."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from asked import certify_words
from mutations import Json, resealed
from oracle import number
from scipy.integrate import trapezoid

from lmi.exact.elementary_enclosures import exp, log, sqrt
from ptcc_certify.checker import OBLIGATIONS
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.late_messages import LateMessages

ROOM = Fraction(1, 10**6)


def led_graph(
    rng: np.random.Generator, leaders: int, followers: int, *, acyclic: bool = False, signs: str = "mixed"
) -> SignedDigraph:
    """Single leaders and followers, each of which some leader reaches; labels that are no numbers.

    Parameters
    ----------
    signs : {"mixed", "positive", "gauge"}
        Of the edges between followers; ``gauge``: some camps fit them.
    """
    n = leaders + followers
    order = [f"a{v}" for v in rng.permutation(n)]
    camp = rng.choice([-1, 1], n)
    edges = []
    for k in range(leaders, n):
        before = [int(rng.integers(0, k))]
        others = [v for v in range(leaders, n) if v != k and (v < k or not acyclic)]
        more = [int(x) for x in rng.permutation(others)[: int(rng.integers(1, 3))]] if others else []
        for v in sorted({*before, *more}):
            sign = {"mixed": rng.choice([-1, 1]), "positive": 1, "gauge": camp[k] * camp[v]}[signs]
            edges.append((order[v], order[k], Fraction(int(sign) * int(rng.integers(10, 300)), 100)))
    return SignedDigraph.from_edges(edges, sorted(order))


def grouped_graph(rng: np.random.Generator, followers: int) -> tuple[SignedDigraph, dict[tuple[str, str], Fraction]]:
    """A leader group with any signs, a single leader, and followers of them; delays, which are 0 within the group."""
    size = int(rng.integers(2, 4))
    pairs = [(v, (v + 1) % size) for v in range(size)] + [(1, 0)]
    for k in range(size + 1, size + 1 + followers):
        before = int(rng.integers(0, min(k, size + 1))) if k > size + 1 else 0
        others = [v for v in range(k - 1, size + 1 + followers) if v not in (k, size)]
        pairs += [(before, k), *((v, k) for v in others[:2])]
    weights = {pair: Fraction(int(rng.choice([-1, 1]) * rng.integers(10, 300)), 100) for pair in pairs}
    edges = [(f"a{s}", f"a{t}", w) for (s, t), w in weights.items()]
    delays = {(f"a{s}", f"a{t}"): Fraction(int(t >= size) * int(rng.integers(5, 40)), 500) for s, t in weights}
    graph = SignedDigraph.from_edges(edges, [f"a{v}" for v in range(size + 1 + followers)])
    return graph, delays


@cache
def settling(seed: int, gain_cap: Any = None) -> Json:
    """A certificate of followers that hear late of a leader group, as it is made."""
    rng = np.random.default_rng(seed)
    graph, delays = grouped_graph(rng, int(rng.integers(1, 4)))
    x0 = [Fraction(int(v), 10) for v in rng.integers(-50, 50, graph.n_nodes)]
    return plain(graph, nominal(), x0, messages=LateMessages(delays, gain_cap=gain_cap))


@cache
def whole(seed: int, own_delay: bool, apart: bool = True, error: Any = 0) -> Json:
    """A certificate of a leader group with followers under a capped gain, by the delay LMI, as it is made."""
    rng = np.random.default_rng(seed)
    graph, _ = grouped_graph(rng, int(rng.integers(1, 3)))
    x0 = [Fraction(int(v), 10) for v in rng.integers(-50, 50, graph.n_nodes)]
    delays = {(s, t): Fraction(int(rng.integers(2 if apart else 6, 7)), 1000) for s, t, _ in graph.edges}
    messages = LateMessages(delays, own_delay=own_delay, gain_cap=8, value_error=error)
    return plain(graph, nominal(), x0, messages=messages)


def plain(graph: SignedDigraph, protocol: Any, x0: Any, **options: Any) -> Json:
    """The certificate of the graph as it stands."""
    return {**json.loads(certify_words(graph, protocol, x0, simulation=False, **options).to_json()), "unverified": {}}


def nominal(T: Any = 1, rho1: Any = 1, k: Any = 3) -> NominalProtocol:
    return NominalProtocol(T=T, rho1=rho1, rho2=k, kappa=1)


class Late:
    """What late messages of a certificate are made from, in rationals."""

    def __init__(self, data: Json, latencies: Sequence[Fraction] = (), delay: Fraction = Fraction(0)):
        self.data = data
        self.labels = data["problem"]["graph"]["nodes"]
        index = {label: v for v, label in enumerate(self.labels)}
        self.edges = [(index[s], index[t], number(w)) for s, t, w in data["problem"]["graph"]["modes"][0]["edges"]]
        self.followers = sorted({t for _, t, _ in self.edges})
        self.D = {v: sum((abs(w) for _, t, w in self.edges if t == v), Fraction(0)) for v in range(len(self.labels))}
        g = {key: number(x) for key, x in data["problem"]["gain"].items() if key not in ("kind", "disturbance")}
        self.T = g["T"] if "T" in g else g["T_r"] + g["T_s"]
        self.rho1, self.k = g["rho1"], g["rho2"] * g["kappa"]
        # ages of what is heard, by source and listener, in 64ths of the largest one, rounded up
        self.parts = dict.fromkeys(((s, t) for s, t, _ in self.edges), 64)
        if len(latencies) > 1:
            held = delay - max(latencies)
            ages = (math.ceil(64 * (x + held) / delay) for x in latencies)
            self.parts = dict(zip(self.parts, ages, strict=True))

    @cached_property
    def heard(self) -> dict[int, list[tuple[int, Fraction]]]:
        """What followers hear of followers: sources and sizes."""
        own = set(self.followers)
        return {v: [(s, abs(w)) for s, t, w in self.edges if t == v and s in own] for v in self.followers}

    def interval(self, v: int) -> tuple[Fraction, Fraction]:
        said = self.data["final_state"][self.labels[v]]
        return (number(said["mid"]), number(said["radius"])) if isinstance(said, dict) else (number(said), Fraction(0))

    def away(self, v: int) -> Fraction:
        """What an agent is away from its final state at most."""
        if "final_state" not in self.data:
            return Fraction(1)
        mid, radius = self.interval(v)
        return abs(number(self.data["problem"]["initial_state"][self.labels[v]]) - mid) + radius

    def power(self, q: Fraction, s: int, v: int) -> Fraction:
        """``q`` to the power of the age of what is heard over an edge, a little above."""
        part = self.parts[s, v]
        return q if part == 64 else Fraction(float(q) ** (part / 64) * (1 + 1e-12))

    def witness(self, q: Fraction) -> tuple[dict[int, Fraction], Fraction] | None:
        """``u`` and ``b`` with ``D u - q |W_F| u >= b u``; None if there are none."""
        place = {v: i for i, v in enumerate(self.followers)}
        A = np.zeros((len(place), len(place)))
        for v, sources in self.heard.items():
            A[place[v], place[v]] = float(self.D[v])
            for s, w in sources:
                A[place[v], place[s]] -= float(self.power(q, s, v) * w)
        rate = float(np.linalg.eigvals(A).real.min()) * 0.98
        if rate < 1e-3:
            return None
        u = np.linalg.solve(A - rate * np.eye(len(A)), np.ones(len(A)))
        values = {v: Fraction(round(float(x) * 2**30), 2**30) for v, x in zip(self.followers, u / u.max(), strict=True)}
        own = [
            self.D[v] - sum((self.power(q, s, v) * w * values[s] for s, w in self.heard[v]), Fraction(0)) / values[v]
            for v in self.followers
        ]
        return (values, min(own)) if min(values.values()) > 0 and min(own) > 0 else None

    def clock(self, cap: Fraction) -> Fraction:
        """The integral of ``min(gain, cap)`` up to ``T``, from below."""
        if cap <= self.rho1 + self.k / self.T:
            return cap * self.T
        r = self.k / (cap - self.rho1)
        return self.rho1 * (self.T - r) + self.k * log(self.T / r)[0] + cap * r

    def largest_gain(self, b: Fraction, gain_cap: Fraction, cap: Fraction | None) -> Fraction:
        """The supremum of ``g e^(-b s_c)``, a little above."""
        first, lower = self.rho1 + self.k / self.T, min(gain_cap, gain_cap if cap is None else cap)
        found = [min(first, gain_cap)]
        turn = self.k / (lower - self.rho1) if lower > first else self.T
        for level in (lower, gain_cap):
            if level > first:
                r = self.k / (level - self.rho1)
                clock = self.rho1 * (self.T - turn) + self.k * log(self.T / turn)[0] + lower * (turn - r)
                found.append(level * exp(-b * clock)[1])
        return max(found) * (1 + ROOM)

    def falling(self, step: Json, entry: Json, push: Fraction, sign: Fraction, p: Fraction) -> list[Fraction]:
        """The same without a cap, where nothing is late: ``p = b k`` is above 1, or at least 1 without a push."""
        u, found = step["bound"][0], [Fraction(0)] * len(self.labels)
        y = (self.rho1 + self.k / self.T) * number(entry["initial"])
        if push:
            y += push / min(u.values()) * (self.rho1 * self.T + self.k) / (p - 1)
        for v in self.followers:
            found[v] = (self.D[v] * u[v] + sum((w * u[s] for s, w in self.heard[v]), Fraction(0))) * y + sign
        return found

    def inputs(
        self, step: Json, entry: Json, error: Fraction, gain_cap: Fraction, sign: Fraction = Fraction(0)
    ) -> list[Fraction]:
        """What an entry of ``rows`` proves of the inputs of all agents."""
        u, b, floor, found = step["bound"][0], number(step["numbers"]["b"]), number(entry["floor"]), []
        if "after" in entry:
            first = min(self.rho1 + self.k / self.T, gain_cap)
            floor += number(entry["after"]) * min(self.rho1, gain_cap) / first
        y = self.largest_gain(b, gain_cap, number(entry["cap"]) if "cap" in entry else None)
        for v in range(len(self.labels)):
            if v not in u:
                found.append(Fraction(0))
                continue
            heard, D = sum((w * u[s] for s, w in self.heard[v]), Fraction(0)), self.D[v]
            most = (2 * D - b) * u[v] * number(entry["initial"]) * y
            found.append((most + gain_cap * (floor * (D * u[v] + heard) + error * D)) * (1 + ROOM) + sign)
        return found

    # ------------------------------------------------------------------ parts

    def integral(self, b: Fraction, cap: Fraction | None) -> Fraction:
        """``int_0^T e^(-b (s_c(T) - s_c(r))) dr``, a little above, by quadrature."""
        if cap is None:
            return Fraction(0)
        first, T, k = float(self.rho1 + self.k / self.T), float(self.T), float(self.k)
        r = T if cap <= first else k / float(cap - self.rho1)
        end = math.exp(-float(b * cap) * r)
        x = T - r * np.exp(np.linspace(0, math.log(T / r), 4001))  # instants before the turn
        grown = float(b) * k * np.log((T - x) / r)  # without rho1, as the format has it
        whole = float(abs(trapezoid(np.exp(-grown), x)))
        return Fraction(end * whole * (1 + 1e-5) + (1 - end) / float(b * cap)) * (1 + ROOM)

    def row(
        self,
        q: Fraction,
        delay: Fraction,
        error: Fraction,
        gain_cap: Fraction | None,
        push: Fraction | None = None,
    ) -> tuple[Json, Json] | None:
        """An entry of ``rows``, and its obligation without ``of``."""
        if (found := self.witness(q)) is None:
            return None
        u, b = found
        cap = None if not delay else log(q)[0] / (b * delay) * (1 - ROOM)
        limit = min((x for x in (cap, gain_cap) if x is not None), default=None)
        clock = None if limit is None else self.clock(limit) * (1 - ROOM)
        left = Fraction(0) if clock is None else exp(-b * clock)[1] * (1 + ROOM)
        initial = max(self.away(v) / u[v] for v in self.followers)
        slack = {v: self.D[v] * u[v] - sum((w * u[s] for s, w in self.heard[v]), Fraction(0)) for v in self.followers}
        floor = max(error * self.D[v] / slack[v] for v in self.followers)
        known = present({"cap": cap, "clock": clock})
        known |= {"left": left, "initial": initial, "floor": floor}
        entry = {key: text(x) for key, x in known.items()}
        drift = Fraction(0)
        if push is not None:
            drift = push / min(u.values()) * self.integral(b, limit)
            slowest = min(x for x in (self.rho1, gain_cap) if x is not None)
            after = max(push / slowest / x for x in slack.values())
            entry |= {"drift": text(drift), "after": text(after)}
        told = {"q": text(q), "b": text(b)}
        return entry, {
            "numbers": told,
            "witness": {"u": [text(u[v]) for v in self.followers]},
            "bound": (u, initial * left + floor + drift, b),
        }

    def steps(
        self, delay: Fraction, error: Fraction, gain_cap: Fraction | None, count: int, push: float = 0.0
    ) -> tuple[Json, Json, dict[int, Fraction], list[Fraction]]:
        """The part ``steps``, its witness, and bounds at ``T`` and of inputs under a cap, in floats with some room."""
        A = np.zeros((len(self.followers),) * 2)
        place = {v: i for i, v in enumerate(self.followers)}
        for v, sources in self.heard.items():
            A[place[v], place[v]] = float(self.D[v])
            for s, w in sources:
                A[place[v], place[s]] -= float(w)
        base = np.linalg.solve(A, np.array([float(self.D[v]) for v in self.followers]))
        share = max(max(float(self.away(v)) / base[place[v]] for v in self.followers), float(error)) + 1e-9
        share += push / self.gain_at(0.0, gain_cap) / min(float(self.D[v]) for v in self.followers)
        y0 = {
            v: Fraction(math.ceil(base[place[v]] * share * (1 + 1e-6) * 2**30) + 2**10, 2**30) for v in self.followers
        }
        near = [self.T * (1 - Fraction(1, 2**j)) for j in range(1, 12)]
        instants = sorted(
            {self.T * Fraction(i, count) for i in range(count + 1)}
            | set(near)
            | {self.T - delay * j for j in (1, 2) if delay * j < self.T}
        )
        y = [{v: float(x) for v, x in y0.items()}]
        peaks = [0.0] * len(self.labels)
        for i, (a, b) in enumerate(pairwise(instants)):
            at = {
                p: max((m for m, t in enumerate(instants) if t <= a - delay * p / 64), default=0)
                for p in set(self.parts.values())
            }
            way = self.way(float(a), float(b), gain_cap)
            new = {}
            for v in self.followers:
                told = sum(float(w) * y[at[self.parts[s, v]]][s] for s, w in self.heard[v])
                h = told / float(self.D[v]) + float(error)
                peaks[v] = max(peaks[v], self.gain_before(float(b), gain_cap) * float(self.D[v]) * (y[i][v] + h))
                h += push / (float(self.D[v]) * self.gain_at(float(a), gain_cap)) if math.isfinite(way) else 0.0
                x = float(self.D[v]) * way
                decay = 1 / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)
                new[v] = min(y[i][v], h + max(y[i][v] - h, 0) * decay)
            y.append(new)
        top = max(y[0].values())
        bounds = {v: Fraction(x + len(instants) * top / 2**20) for v, x in y[-1].items()}
        room = [float(gain_cap or 0) * float(self.D[v]) * len(instants) * top / 2**26 for v in range(len(peaks))]
        inputs = [Fraction(x * (1 + 1e-9) + more) for x, more in zip(peaks, room, strict=True)]
        return (
            {"instants": [text(t) for t in instants]},
            {"start": [text(y0[v]) for v in self.followers]},
            bounds,
            inputs,
        )

    def gain_before(self, t: float, cap: Fraction | None) -> float:
        """The gain before an instant, at ``T`` its cap; 0 without one, where nothing bounds it."""
        if cap is None:
            return 0.0
        return float(cap) if t >= float(self.T) else self.gain_at(t, cap)

    def gain_at(self, t: float, cap: Fraction | None) -> float:
        gain = float(self.rho1) + float(self.k) / (float(self.T) - t)
        return gain if cap is None else min(gain, float(cap))

    def way(self, a: float, b: float, cap: Fraction | None) -> float:
        T, rho1, k = map(float, (self.T, self.rho1, self.k))
        if cap is None:
            return math.inf if b >= T else rho1 * (b - a) + k * math.log((T - a) / (T - b))
        x = np.linspace(a, b, 2001)[:-1] + (b - a) / 4000
        return float(np.minimum(rho1 + k / (T - x), float(cap)).mean() * (b - a))

    def missed(self, latency: Fraction) -> tuple[Json, Json] | None:
        """The part ``missed`` of the agent with the largest bound, and its witness."""
        best = None
        for agent in self.followers:
            if not self.heard[agent]:
                continue
            gauge = self.signs(agent)
            if gauge is None:
                continue
            t, total = max(self.T - latency, Fraction(0)), Fraction(0)
            s = self.rho1 * t + self.k * log(self.T / (self.T - t))[1] if t else Fraction(0)
            for v, w in self.heard[agent]:
                mid, radius = self.interval(v)
                size = max(
                    abs(number(self.data["problem"]["initial_state"][self.labels[v]]) - mid) - radius, Fraction(0)
                )
                total += w / self.D[agent] * exp(-self.D[v] * s)[0] * size
            if total > 0 and (best is None or total > best[0]):
                best = total, agent, gauge
        if best is None:
            return None
        bound, agent, gauge = best
        said = {"agent": self.labels[agent], "bound": text(bound * (1 - ROOM))}
        return said, {"gauge": [gauge.get(v, 0) for v in self.followers]}

    def signs(self, agent: int) -> dict[int, int] | None:
        """Signs of those that an agent hears of, which fit edges and initial states; None if there are none."""
        weight = {(s, t): w for s, t, w in self.edges}
        for first in (1, -1):
            gauge, todo, fits = {agent: first}, [agent], True
            while todo:
                v = todo.pop()
                for s, _ in self.heard[v]:
                    sign = gauge[v] * (1 if weight[s, v] > 0 else -1)
                    if s not in gauge:
                        gauge[s] = sign
                        todo.append(s)
                    fits &= gauge[s] == sign
            again = any(s == agent for v in gauge for s, _ in self.heard[v])
            for v, g in gauge.items():
                mid, radius = self.interval(v)
                off = g * (number(self.data["problem"]["initial_state"][self.labels[v]]) - mid)
                fits &= off >= radius or (v == agent and not again)
            if fits:
                return gauge
        return None

    def levels(self) -> dict[int, int] | None:
        """The longest paths from leaders; None if followers form a cycle."""
        level = dict.fromkeys(self.followers, 1)
        for _ in self.followers:
            new = {v: 1 + max((level[s] for s, _ in self.heard[v]), default=0) for v in self.followers}
            if new == level:
                return level
            level = new
        return (
            None
            if {v: 1 + max((level[s] for s, _ in self.heard[v]), default=0) for v in self.followers} != level
            else level
        )

    def form(
        self, delay: Fraction, gain_cap: Fraction, late: bool, k: int, share: Fraction
    ) -> tuple[Json, Json] | None:
        """The part ``form`` with ``b`` a share of half the rate; its obligation without ``of``."""
        function = self.data["decays"][k]
        n, place = len(self.labels), {label: v for v, label in enumerate(self.labels)}
        if "deviation" not in function or function["coordinates"] != "E" or "diagonal" not in function["blocks"][0]:
            return None
        rho = number(function.get("rho", "1"))
        P = {
            place[label]: number(x) * (rho if block["times_rho"] else 1)
            for block in function["blocks"]
            for label, x in zip(block["nodes"], block["diagonal"], strict=True)
        }
        r = number(function["rate"])
        L = [[Fraction(0)] * n for _ in range(n)]
        for s, t, w in self.edges:
            L[t][s] = -w
            L[t][t] += abs(w)
        B = [[abs(x) if late or i != j else Fraction(0) for j, x in enumerate(row)] for i, row in enumerate(L)]
        b, h = share * r / 2, gain_cap * delay
        q = exp(b * h)[1] * (1 + ROOM)
        lag = float(h * q)
        roots = [float(sqrt(1 / P[v])[1]) if v in P else 0.0 for v in range(n)]
        M = np.eye(n) - lag * np.array(B, dtype=float)
        if r <= 0 or np.abs(np.linalg.eigvals(lag * np.array(B, dtype=float))).max() >= 0.9:
            return None
        phi = [Fraction(float(x * (1 + 1e-9))) if x > 0 else Fraction(0) for x in np.linalg.solve(M, roots)]
        pushed = [sum((x * y for x, y in zip(row, phi, strict=True)), Fraction(0)) for row in B]
        if any(phi[v] < sqrt(1 / P[v])[1] + h * q * pushed[v] for v in P):
            return None
        size = [[abs(sum((L[m][i] * P[m] * L[m][j] for m in P), Fraction(0))) for j in range(n)] for i in range(n)]
        value = sum((pushed[i] * size[i][j] * pushed[j] for i in range(n) for j in range(n)), Fraction(0))
        kap = sqrt(value)[1] * (1 + ROOM)
        if b + h * q * kap > r / 2:
            return None
        x0 = [number(self.data["problem"]["initial_state"][label]) for label in self.labels]
        E = [sum((a * x for a, x in zip(row, x0, strict=True)), Fraction(0)) for row in L]
        root = sqrt(sum((P[v] * E[v] ** 2 for v in P), Fraction(0)))[1]
        left = exp(-b * self.clock(gain_cap))[1] * (1 + ROOM)
        from oracle import Oracle

        Q = Oracle(self.data, {}).Q
        moved = [
            (h * q / b) * root * sum((abs(x) * y for x, y in zip(row, pushed, strict=True)), Fraction(0)) * (1 + ROOM)
            for row in Q
        ]
        deviation = [number(function["deviation"]["agents"][label]) for label in self.labels]
        away = [sqrt(c)[1] * root * (1 + ROOM) for c in deviation]
        rest = [(m + x * left) * (1 + ROOM) for m, x in zip(moved, away, strict=True)]
        told = {"q": text(q), "b": text(b), "kap": text(kap)}
        y = root * self.largest_gain(b, gain_cap, None) * (1 + ROOM)
        agents = {"moved": moved, "away": away, "residual": rest}
        said = {"left": text(left), **{key: self.by_agent(values) for key, values in agents.items()}}
        witness = {"function": k, "phi": self.by_agent(phi)}
        return said, {"numbers": told, "witness": witness, "inputs": [x * y for x in phi]}

    def by_agent(self, values: Sequence[Fraction]) -> Json:
        return {label: text(x) for label, x in zip(self.labels, values, strict=True)}


def text(x: Any) -> str:
    return str(Fraction(x))


def present(said: Json) -> Json:
    """Without what is None: a part that is absent has no key."""
    return {key: x for key, x in said.items() if x is not None}


def obligation(kind: str, of: str, numbers: Json | None = None, witness: Any = None) -> Json:
    proves, lemma = OBLIGATIONS[kind]
    told = {"kind": kind, "of": of, "proves": proves, "lemma": lemma}
    return told | present({"numbers": numbers or None, "witness": witness})


def with_messages(
    data: Json,
    latency: Any = "1/50",
    *,
    packets: Json | None = None,
    late: bool = False,
    value_error: Any = 0,
    gain_cap: Any = None,
    qs: Sequence[Any] = ("21/20",),
    steps: int = 0,
    missed: bool = False,
    staged: bool = False,
    form: Fraction | None = None,
    bounded: bool = True,
    moving: tuple[Any, ...] | None = None,
) -> Json:
    """The certificate with late messages: as many of the parts as there are.

    ``moving``: speed, disturbance and, perhaps, the gain of a sign term.
    """
    data = copy.deepcopy(data)
    each = latency if isinstance(latency, list) else [latency]
    delay = max(map(Fraction, each))
    if packets is not None:
        delay += (Fraction(packets["losses"]) + 1) * Fraction(packets["period"])
    case = Late(data, list(map(Fraction, each)), delay)
    error, cap = Fraction(value_error), None if gain_cap is None else Fraction(gain_cap)
    said: Json = {
        "latency": [text(x) for x in latency] if isinstance(latency, list) else text(latency),
        **present({"packets": packets}),
        "delay": text(delay),
        "own": "late" if late else "fresh",
        "value_error": text(error),
        "rows": [],
    }
    if cap is not None:
        said["gain_cap"] = text(cap)
    if moving is not None:
        said["leaders"] = {"speed": text(moving[0]), "disturbance": text(moving[1])}
    proof, bounds, inputs, push, sign = [], [], [], None, Fraction(0)
    if moving is not None:
        push = Fraction(moving[0]) + Fraction(moving[1])
        error += Fraction(moving[0]) * delay
        if len(moving) > 2 and moving[2] is not None:
            push, sign = Fraction(0), Fraction(moving[2])
            said["leaders"]["sign_gain"] = text(sign)
    for q in () if late else qs:
        if (found := case.row(Fraction(q), delay, error, cap, push)) is not None:
            entry, step = found
            bounds.append({v: step["bound"][0][v] * step["bound"][1] for v in case.followers})
            inputs += [] if cap is None else [case.inputs(step, entry, error, cap, sign)]
            if push is not None and not delay and not error and (p := step["bound"][2] * case.k) > 1:
                inputs.append(case.falling(step, entry, push, sign, p))
            proof.append(
                obligation("late-rows", f"messages.rows[{len(said['rows'])}]", step["numbers"], step["witness"])
            )
            said["rows"].append(entry)
    if steps:
        said["steps"], witness, above, most = case.steps(delay, error, cap, steps, float(push or 0))
        bounds.append(above)
        inputs += [] if cap is None else [most]
        proof.append(obligation("late-steps", "messages.steps", witness=witness))
    if bounds:
        least = [min(own[v] for own in bounds) if case.D.get(v) else Fraction(0) for v in range(len(case.labels))]
        said["residual"] = case.by_agent(least)
        proof.append(obligation("late-residual", "messages.residual"))
    if missed and (found := case.missed(min(map(Fraction, each)))) is not None:
        said["missed"] = found[0]
        proof.append(obligation("late-missed", "messages.missed", witness=found[1]))
    if staged and (levels := case.levels()) is not None:
        last = max(levels.values())
        said["staged"] = {case.labels[v]: text(case.T - (last - levels[v]) * delay) for v in case.followers}
        proof.append(obligation("late-staged", "messages.staged"))
    if form is not None and cap is not None:
        for k in range(len(data["decays"])):
            if (found := case.form(delay, cap, late, k, form)) is not None:
                said["form"] = found[0]
                proof.append(obligation("late-form", "messages.form", found[1]["numbers"], found[1]["witness"]))
                inputs.append(found[1]["inputs"])
                break
    if inputs and bounded:
        said["input"] = case.by_agent([min(own) for own in zip(*inputs, strict=True)])
        proof.append(obligation("late-input", "messages.input"))
    data["messages"] = said
    data["proof"] += proof
    return resealed(data)


def with_leaders(
    data: Json,
    speed: Any = "1/2",
    disturbance: Any = 0,
    sign_gain: Any = None,
    bounded: bool = True,
    gain_cap: Any = None,
) -> Json:
    """The certificate with leaders that move, of which nothing is heard late."""
    moving = (speed, disturbance, sign_gain)
    return with_messages(data, 0, qs=(1,), moving=moving, bounded=bounded, gain_cap=gain_cap)
