"""Certificates of agents of order n made by hand: from that of their graph, by plain formulas in rationals.

Nothing here is taken from what makes certificates but the certificate of the graph itself; ``W`` comes from a small
semidefinite program, and is rounded. What is written is true, and close to the limits of what is true.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any

import cvxpy as cp
import flint
import numpy as np
from asked import certify_words
from mutations import Json, resealed
from oracle import Oracle, inverse, number

from ptcc_certify.checker import OBLIGATIONS
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol

Vector = list[Fraction]
Matrix = list[Vector]
ZERO, ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True)
class Setting:
    """What agents are, and what they run; ``R = r k``.

    ``spare`` is the share by which the decrease is proved faster than ``rate`` says.
    """

    order: int = 2
    dimension: int = 1
    plant: tuple[Fraction, ...] = ()
    damping: Fraction = ZERO
    R: Fraction | None = None
    cap: Fraction | None = None
    pieces: int = 1
    T: Fraction = Fraction(2)
    rho1: Fraction = Fraction(1, 2)
    k: Fraction = Fraction(3, 2)
    slides: bool = False
    offsets: bool = True
    start: bool = True
    method: str = "paper"
    spare: Fraction = Fraction(1, 1000)

    @property
    def a(self) -> list[Fraction]:
        return list(self.plant) or [ZERO] * self.order

    @property
    def f(self) -> list[Fraction]:
        return [ZERO] * (self.order - 1) + [self.damping]

    @property
    def rate(self) -> Fraction:
        return (Fraction(2 * self.order) if self.R is None else self.R) / self.k

    @property
    def first_gain(self) -> Fraction:
        return self.rho1 + self.k / self.T

    @property
    def eta_0(self) -> Fraction:
        return self.first_gain if self.cap is None else min(self.first_gain, self.cap)

    @property
    def points(self) -> list[Fraction]:
        """Ends of equal intervals of ``zeta``."""
        if self.cap is not None and self.cap <= self.first_gain:
            return []
        low, high = (ZERO if self.cap is None else 1 / self.cap), 1 / self.first_gain
        return [low + (high - low) * j / self.pieces for j in range(self.pieces + 1)]


def chain_matrix(s: Setting, zeta: Fraction, theta: Fraction) -> Matrix:
    """``A_z = N - theta J - b (f + a_z)'``."""
    n = s.order
    A = [[Fraction(int(j == i + 1)) - theta * i * (i == j) for j in range(n)] for i in range(n)]
    for i in range(n):
        A[n - 1][i] -= s.f[i] + s.a[i] * zeta ** (n - i)
    return A


def theta(s: Setting, zeta: Fraction) -> Fraction:
    return (1 - s.rho1 * zeta) ** 2 / s.k


def bernstein_matrices(s: Setting) -> list[Matrix]:
    """Bernstein coefficients of ``A_z`` on every interval, from its values at equally spaced places."""
    m, found = max(s.order, 2), []
    place = [Fraction(j, m) for j in range(m + 1)]
    weights = [[math.comb(m, i) * x**i * (1 - x) ** (m - i) for i in range(m + 1)] for x in place]
    back = inverse(weights)
    for low, high in pairwise(s.points):
        zetas = [low + (high - low) * x for x in place]
        values = [chain_matrix(s, zeta, theta(s, zeta)) for zeta in zetas]
        for row in back:
            found.append(
                [
                    [sum((c * A[i][j] for c, A in zip(row, values, strict=True)), ZERO) for j in range(s.order)]
                    for i in range(s.order)
                ]
            )
    if s.cap is not None:
        found.append(chain_matrix(s, 1 / s.cap, ZERO))
    return found


@lru_cache(maxsize=500)
def lyapunov_matrix(s: Setting) -> tuple[tuple[Fraction, ...], ...]:
    """``W`` for a rate that is larger by ``spare``, rounded to 40 bits."""
    n, r = s.order, float(s.rate * (1 + s.spare))
    scale = np.diag([r ** (i - n + 0.5) for i in range(n)])
    back = np.linalg.inv(scale)
    W = cp.Variable((n, n), symmetric=True)
    size = cp.Variable()
    b = back[:, -1:]
    limits = [cp.bmat([[W, b], [b.T, cp.reshape(size, (1, 1), order="C")]]) >> 0]
    for A in bernstein_matrices(s):
        B = back @ np.array([[float(x) for x in row] for row in A]) @ scale
        limits.append(b @ b.T - r * W - B @ W - W @ B.T >> 0)
    # The trace keeps the oldest Clarabel from solutions that run away where the size alone leaves one free.
    cp.Problem(cp.Minimize(size + 1e-6 * cp.trace(W)), limits).solve(solver=cp.CLARABEL)
    assert W.value is not None
    found = scale @ W.value @ scale
    step = [2.0 ** (math.floor(math.log2(abs(found[i, i]))) // 2) for i in range(n)]
    rounded = [[Fraction(round(found[i, j] / (step[i] * step[j]) * 2**40), 2**40) for j in range(n)] for i in range(n)]
    return tuple(
        tuple(rounded[max(i, j)][min(i, j)] * Fraction(step[i]) * Fraction(step[j]) for j in range(n)) for i in range(n)
    )


# ---------------------------------------------------------------------- what one agent does


def motion(s: Setting) -> list[list[Any]]:
    """``M``, as texts or intervals."""
    n, T = s.order, s.T
    if s.damping:
        exact = s.a[1] + s.damping * s.rho1 == 0
        return [["1", str(T / (s.damping * s.k + 1)) if exact else damped(s, interval)], ["0", "0"]]
    if not any(s.a):
        return [[str(T ** (j - i) / math.factorial(j - i)) if j >= i else "0" for j in range(n)] for i in range(n)]
    return exponential(s, interval)


def exponential(s: Setting, read: Any) -> list[list[Any]]:
    """What is read from the entries of ``e^(A T)``, balls of 1,000 bits."""
    companion = [[Fraction(int(j == i + 1)) for j in range(s.order)] for i in range(s.order - 1)]
    companion.append([-a for a in s.a])
    before, flint.ctx.prec = flint.ctx.prec, 1000
    try:
        found = flint.arb_mat([[ball(x * s.T) for x in row] for row in companion]).exp()
        return [[read(found[i, j]) for j in range(s.order)] for i in range(s.order)]
    finally:
        flint.ctx.prec = before


def damped(s: Setting, read: Any) -> Any:
    """What is read from ``int_0^T e^(-a_2 t - f_2 s(t)) dt``, a ball of 1,000 bits."""
    w, p = (s.a[1] + s.damping * s.rho1) * s.T, s.damping * s.k
    before, flint.ctx.prec = flint.ctx.prec, 1000
    try:
        return read(ball(s.T / (p + 1)) * ball(-w).hypgeom_1f1(1, ball(p + 2)))
    finally:
        flint.ctx.prec = before


def ball(x: Fraction) -> Any:
    return flint.arb(flint.fmpq(x.numerator, x.denominator))


def interval(x: Any) -> Json:
    """An interval with a radius of a part in 10^25 that holds a ball."""
    mid = Fraction(str(flint.arb(x.mid()).str(60, radius=False)))
    radius = max(abs(mid), ONE) / 10**25
    assert abs(x - ball(mid)) < ball(radius)
    return {"mid": str(mid), "radius": str(radius)}


def ends(x: Any) -> tuple[Fraction, Fraction]:
    """Middle and radius of an interval."""
    return (number(x["mid"]), number(x["radius"])) if isinstance(x, dict) else (number(x), ZERO)


def above(x: Fraction) -> str:
    """A number a little above the root of a rational."""
    return str(Fraction(math.nextafter(math.sqrt(float(x)) * (1 + 1e-12), math.inf))) if x else "0"


# ---------------------------------------------------------------------- the document


def of_graph(graph: SignedDigraph, s: Setting) -> Json:
    """The certificate of the graph, with the protocol of the setting, without states and inputs."""
    rho2, kappa, rho1 = s.k / 2, Fraction(2), s.rho1 or ONE
    protocol: Any = NominalProtocol(T=s.T, rho1=rho1, rho2=rho2, kappa=kappa)
    options: Json = {}
    if s.slides:
        more = {"mu1": 2, "mu2": 1, "mu3": 1, "delta": "3/2"}
        protocol = SlidingModeProtocol(T_r=s.T / 4, T_s=s.T * 3 / 4, rho1=rho1, rho2=rho2, kappa=kappa, **more)
        options["sigma0"] = [0] * graph.n_nodes
        options["x0"] = [0] * graph.n_nodes
    data = json.loads(certify_words(graph, protocol, simulation=False, method=s.method, **options).to_json())
    data["problem"]["gain"]["rho1"] = str(s.rho1)
    of_input = lambda step: step["kind"].startswith("input-") or step["of"].startswith("input")  # noqa: E731
    data["proof"] = [step for step in data["proof"] if not of_input(step)]
    data["problem"].pop("initial_state", None)
    for of in (data, *data.get("components", ())):
        of.pop("final_state", None)
    data.pop("input", None)
    data.get("influence", {}).pop("degenerate", None)
    return {**data, "unverified": {}}


def document(graph: SignedDigraph, s: Setting, seed: int = 0) -> Json:
    """A certificate of agents of order n on a graph."""
    rng, data = np.random.default_rng(seed), of_graph(graph, s)
    labels, n, d = data["problem"]["graph"]["nodes"], s.order, s.dimension
    draw = lambda *shape: rng.integers(-300, 301, shape)  # noqa: E731
    H = draw(len(labels), d) * s.offsets
    X = draw(len(labels), d, n)
    offsets = {label: [str(Fraction(int(x), 100)) for x in row] for label, row in zip(labels, H, strict=True)}
    states = {
        label: [[str(Fraction(int(x), 100)) for x in row] for row in rows]
        for label, rows in zip(labels, X, strict=True)
    }
    used = [k for k, f in enumerate(data["decays"]) if Fraction(f["rate"]) > 0]
    rates = [Fraction(data["decays"][k]["rate"]) for k in used]
    c = 1 / min(rates, default=ONE)
    W = [list(row) for row in lyapunov_matrix(replace(s, dimension=1, slides=False, method="paper", offsets=True))]
    P = inverse(W)
    agents: Json = {
        "order": n,
        "dimension": d,
        "plant": list(map(str, s.a)),
        "own": list(map(str, s.f)),
        "gains": [str(c * x) for x in P[-1]],
        "coupling": str(c),
        "lower_triangle": [[str(x) for x in row[: i + 1]] for i, row in enumerate(W)],
        "rate": str(s.rate),
        "points": list(map(str, s.points)),
        "functions": [{"function": k} | ({} if (own := inputs(data, k)) is None else {"inputs": own}) for k in used],
        "offsets": offsets,
        "motion": motion(s),
    }
    if s.cap is not None:
        agents["gain_cap"] = str(s.cap)
    data["agents"] = agents
    if s.start:
        agents["initial_state"] = states
        if "containment_weights" in data.get("influence", {}):
            agents["final_state"] = final_state(data)
        more = {"residual": residual(data, s), "input": input_bound(data, s)}
        agents |= {key: x for key, x in more.items() if x is not None}
    data["proof"] += obligations(agents)
    data["verdict"] = (
        "certified"
        if "influence" in data and (used or not data["problem"]["graph"]["modes"][0]["edges"])
        else "undecided"
    )
    return resealed(data)


def obligations(agents: Json) -> list[Json]:
    """What the end of the proof lists."""
    kinds: list[tuple[str, str, Json]] = [
        ("input-constants", f"decays[{entry['function']}]", {}) for entry in agents["functions"] if "inputs" in entry
    ]
    kinds += [
        ("agent-positive", "agents", {}),
        ("agent-decrease", "agents", {"rate": agents["rate"]}),
        ("agent-coupling", "agents", {"coupling": agents["coupling"]}),
        ("agent-motion", "agents", {}),
    ]
    kinds += [
        (f"agent-{key.replace('_', '-')}", "agents", {})
        for key in ("final_state", "residual", "input")
        if key in agents
    ]
    return [
        {"kind": kind, "of": of, "proves": OBLIGATIONS[kind][0], "lemma": OBLIGATIONS[kind][1]}
        | ({"numbers": numbers} if numbers else {})
        for kind, of, numbers in kinds
    ]


def inputs(data: Json, k: int) -> Json | None:
    """Constants of the input of a full matrix: a little above the diagonal of its inverse."""
    function = data["decays"][k]
    if function["class"] != "full":
        return None
    (block,) = function["blocks"]
    lower = [list(map(number, row)) for row in block["lower_triangle"]]
    P = [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]
    least = dict(zip(block["nodes"], (row[i] for i, row in enumerate(inverse(P))), strict=True))
    return {
        label: str(Fraction(math.ceil(least[label] * 10**12 + 1), 10**12)) if label in least else "0"
        for label in data["problem"]["graph"]["nodes"]
    }


def read_states(data: Json) -> list[list[Vector]]:
    """``xi_k(0) - (h_k, 0, ..)`` by agent, coordinate and derivative."""
    agents = data["agents"]
    found = []
    for label in data["problem"]["graph"]["nodes"]:
        pairs = zip(agents["initial_state"][label], agents["offsets"][label], strict=True)
        found.append([[number(x) - (number(h) if j == 0 else 0) for j, x in enumerate(row)] for row, h in pairs])
    return found


def final_state(data: Json) -> Json:
    agents, Q, G = data["agents"], Oracle(data, {}).Q, read_states(data)
    M = [[ends(x) for x in row] for row in agents["motion"]]
    n, d, labels = agents["order"], agents["dimension"], data["problem"]["graph"]["nodes"]
    found: Json = {}
    for k, label in enumerate(labels):
        found[label] = []
        for axis in range(d):
            moved = [sum((q * G[v][axis][j] for v, q in enumerate(Q[k])), ZERO) for j in range(n)]
            row = []
            for i in range(n):
                mid = sum((m * x for (m, _), x in zip(M[i], moved, strict=True)), ZERO)
                mid += number(agents["offsets"][label][axis]) if i == 0 else 0
                radius = sum((r * abs(x) for (_, r), x in zip(M[i], moved, strict=True)), ZERO)
                row.append({"mid": str(mid), "radius": str(radius)} if radius else str(mid))
            found[label].append(row)
    return found


def initial_value(data: Json, s: Setting, k: int) -> Fraction:
    """``V(0) = sum Om_kl z_k'P z_l`` of a function."""
    agents, oracle, G = data["agents"], Oracle(data, {}), read_states(data)
    n, d = s.order, s.dimension
    lower = [list(map(number, row)) for row in agents["lower_triangle"]]
    P = inverse([[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)])
    F, _, _, _ = oracle.form(data["decays"][k])
    total = ZERO
    for axis in range(d):
        Y = [[row[axis][j] / s.eta_0**j for j in range(n)] for row in G]
        for a, x in enumerate(Y):
            for b, y in enumerate(Y):
                if F[a][b]:
                    total += F[a][b] * sum((P[i][j] * x[i] * y[j] for i in range(n) for j in range(n)), ZERO)
    return total


def residual(data: Json, s: Setting) -> Json | None:
    functions = data["decays"]
    used = [e["function"] for e in data["agents"]["functions"] if "deviation" in functions[e["function"]]]
    if s.cap is None or not used:
        return None
    values = {k: initial_value(data, s, k) for k in used}
    clock = Fraction(float(limited_clock(s)) * (1 - 1e-12))
    W, found = lyapunov_matrix(replace(s, dimension=1, slides=False, method="paper", offsets=True)), {}
    decay = Fraction(math.exp(-float(s.rate * clock)) * (1 + 1e-12))
    for label in data["problem"]["graph"]["nodes"]:
        least = min(number(functions[k]["deviation"]["agents"][label]) * values[k] for k in used)
        found[label] = [above(s.cap ** (2 * i) * W[i][i] * least * decay) for i in range(s.order)]
    return {"clock": str(clock), "agents": found}


def limited_clock(s: Setting) -> float:
    """The integral of the capped gain over ``[0, T)``."""
    cap = s.cap or ZERO
    if cap <= s.first_gain:
        return float(cap * s.T)
    turn = s.T - s.k / (cap - s.rho1)
    return float(s.rho1 * turn + cap * (s.T - turn)) + float(s.k) * math.log(s.T / (s.T - turn))


def error_constants(data: Json, k: int) -> Sequence[Fraction] | None:
    """``c_k^E`` of a Lyapunov function."""
    entry = next(e for e in data["agents"]["functions"] if e["function"] == k)
    function, labels = data["decays"][k], data["problem"]["graph"]["nodes"]
    if function["class"] == "full":
        return [number(entry["inputs"][label]) for label in labels] if "inputs" in entry else None
    oracle = Oracle(data, {})
    _, P, _, nodes = oracle.form(function)
    weight = {v: P[i][i] for i, v in enumerate(nodes)}
    if function["coordinates"] == "eps":
        return [sum((x * x / weight[j] for j, x in enumerate(row) if x), ZERO) for row in oracle.L]
    return [1 / weight[v] if v in weight else ZERO for v in range(len(labels))]


def input_bound(data: Json, s: Setting) -> Json | None:
    agents, labels = data["agents"], data["problem"]["graph"]["nodes"]
    known = {e["function"]: c for e in agents["functions"] if (c := error_constants(data, e["function"])) is not None}
    large = s.rate * s.k >= 2 * s.order
    if not known or (s.cap is None and not large):
        return None
    damped = damping_bound(data, s) if s.damping else [ZERO] * len(labels)
    if damped is None:
        return None
    values = {k: initial_value(data, s, k) for k in known}
    W = lyapunov_matrix(replace(s, dimension=1, slides=False, method="paper", offsets=True))
    e = s.eta_0 if large else s.cap or ZERO
    common = e ** (2 * s.order) * number(agents["coupling"]) ** 2 * inverse([list(row) for row in W])[-1][-1]
    found = {}
    for v, label in enumerate(labels):
        size = number(above(common * min(c[v] * values[k] for k, c in known.items())))
        size += abs(s.a[0]) * sum(abs(number(h)) for h in agents["offsets"][label]) + damped[v]
        found[label] = str(size + (2 * s.dimension if s.slides else 0))
    return {"agents": found, "largest": max(found.values(), key=Fraction)}


def damping_bound(data: Json, s: Setting) -> list[Fraction] | None:
    """Bound ``f_2 eta |x_k'|`` by its value at 0, of agents that meet at rest."""
    agents, functions, oracle = data["agents"], data["decays"], Oracle(data, {})
    used = [e["function"] for e in agents["functions"] if "deviation" in functions[e["function"]]]
    falls = s.damping * s.k >= 1 and s.a[1] + (s.damping - 1 / s.k) * s.eta_0 >= 0
    if not used or not falls or "final_state" not in agents:
        return None
    values, G, found = {k: initial_value(data, s, k) for k in used}, read_states(data), []
    w = number(agents["lower_triangle"][1][1])
    for v, label in enumerate(data["problem"]["graph"]["nodes"]):
        least = min(number(functions[k]["deviation"]["agents"][label]) * values[k] for k in used)
        speeds = [
            sum((q * row[axis][1] for q, row in zip(oracle.Q[v], G, strict=True)), ZERO) for axis in range(s.dimension)
        ]
        away, along = number(above(w * least)), number(above(sum((x * x for x in speeds), ZERO)))
        found.append(s.damping * s.eta_0 * (s.eta_0 * away + along))
    return found
