"""Late messages and leaders that move on uncertain and switching graphs: adversaries against what is certified."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov.follower_rows import FollowerRows, UncertainRows
from ptcc_certify.protocols import NominalProtocol
from ptcc_certify.protocols.late_messages import LateMessages
from ptcc_certify.protocols.moving_leaders import MovingLeaders

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
UNSURE = Family.from_intervals([("l", "a", 1, 2), ("a", "b", -3, -1), ("b", "a", "-0.5", 0), ("l", "b", -1, -1)])


def led_family(rng: np.random.Generator, leaders: int, followers: int, modes: int, common: bool = False) -> Family:
    """Flocks, each with a leader that hears nobody, whose camps every member keeps; one follower of two, if asked."""
    n = leaders + followers
    camp, home = rng.choice([-1, 1], n), np.concatenate([np.arange(leaders), rng.integers(0, leaders, followers)])
    made = []
    for _ in range(modes):
        rows = []
        for v in range(leaders, n):
            others = [u for u in range(n) if home[u] == home[v] and u != v]
            sure = int(rng.choice([u for u in others if u < v]))
            for u in others:
                if u != sure and rng.random() < 0.6:
                    continue
                size, share = Fraction(int(rng.integers(2, 30)), 10), Fraction(int(rng.integers(0, 4)), 10)
                low, high = size * (1 - share), size * (1 + share)
                low = low if u == sure or rng.random() < 0.7 else Fraction(0)
                sign = int(camp[u] * camp[v])
                rows.append((u, v, *sorted((sign * low, sign * high))))
        if common:
            rows += [(0, n, 1, 1), (1, n, -2, -2)]
        made.append(Family.from_intervals(rows, nodes=range(n + common)))
    return Family.switching(made)


def targets_of(family: Family, followers: np.ndarray) -> np.ndarray:
    """``x*_F`` by all agents, ``-L_FF^-1 L_FL`` of the middle of the first mode: that of every member."""
    n, mode = family.n_nodes, family.modes[0]
    L = np.zeros((n, n))
    for e in range(mode.source.size):
        w = float(mode.lower.fraction(e) + mode.upper.fraction(e)) / 2
        s, t = int(mode.source[e]), int(mode.target[e])
        L[t, s] -= int(mode.sign[e]) * w
        L[t, t] += w
    others = np.setdiff1d(np.arange(n), followers)
    R = np.zeros((followers.size, n))
    R[:, others] = -np.linalg.solve(L[np.ix_(followers, followers)], L[np.ix_(followers, others)])
    return R


def worst_ratio(certificate: FamilyCertificate, rng: np.random.Generator) -> tuple[float, float]:
    """Seen over certified, distance to the target and input, of a motion that is chosen against the followers.

    Mode, weights, ages, errors, leaders and disturbances are held over a step, ages so that they stay within the
    delay: what agents hear is constant then, and the motion exact but for disturbances, which are taken too small.
    """
    family, late, tracking = certificate.family, certificate.late, certificate.tracking
    messages = None if late is None else late.messages
    leaders = certificate.asked_leaders
    gain = certificate.protocol.gain if late is None else late.gain
    T, delay = float(certificate.protocol.T), 0.0 if messages is None else float(messages.age)
    error = 0.0 if messages is None else float(messages.value_error)
    speed, pushed = (0.0, 0.0) if leaders is None else (float(leaders.speed), float(leaders.disturbance))
    followers = UncertainRows(family).followers
    R, moving = targets_of(family, followers), np.setdiff1d(np.arange(family.n_nodes), followers)
    modes = [
        [
            (int(m.source[e]), int(m.target[e]), int(m.sign[e]), float(m.lower.fraction(e)), float(m.upper.fraction(e)))
            for e in range(m.source.size)
        ]
        for m in family.modes
    ]
    capped = messages is not None and messages.gain_cap is not None
    late_grid = np.linspace(0, T, 121) if capped else T * (1 - np.geomspace(1, 1e-3, 121))
    clock = late.gain.clock(late_grid) if late is not None else gain.clock_at_remaining(1 - late_grid / T)
    if late is not None and messages is not None and not capped:
        clock = certificate.protocol.gain.clock_at_remaining(1 - late_grid / T)
    x = np.array([float(y) for y in certificate.initial_state or ()])
    history, seen, largest = [(0.0, x.copy())], 0.0, 0.0
    bounds = late.deviation_bound(late_grid) if late is not None else None
    if tracking is not None:
        bounds = tracking.distance_bound(1 - late_grid / T)
    inputs = (late or tracking).input  # type: ignore[union-attr]
    for j, (t, after) in enumerate(pairwise(late_grid.tolist())):
        off = x[followers] - R @ x
        side = np.where(off == 0, rng.choice([-1.0, 1.0], off.size), np.sign(off))
        sides = dict(zip(followers.tolist(), side.tolist(), strict=True))
        oldest = max(delay - (after - t), 0.0) if delay else 0.0
        past = [y for when, y in history if when >= t - oldest - 1e-15] or [x]
        worst = int(np.argmax(np.abs(off) / bounds[:, j]))
        rows = [_rows(edges, sides, x, past, error) for edges in modes]
        outwards = [side[worst] * (heard - D * x)[followers[worst]] for D, heard in rows]
        chosen = int(np.argmax(outwards)) if rng.random() < 0.7 else int(rng.integers(len(rows)))
        D, heard = rows[chosen]
        if inputs is not None:
            g = float(certificate.protocol.gain.value_at_remaining(1 - t / T))
            g = min(g, float(messages.gain_cap)) if messages is not None and messages.gain_cap is not None else g
            u = g * np.abs(heard - D * x)[followers]
            largest = max(largest, float((u / inputs[followers]).max()))
        pace = np.zeros(x.size)
        pace[moving] = -speed * side[worst] * np.sign(R[worst, moving])
        pace[followers] = pushed * side
        if messages is None:
            x = _fresh_step(certificate, modes[chosen], sides, x, pace, (t, after))
        else:
            keep = np.exp(-D * (clock[j + 1] - clock[j]))
            goal = np.where(D > 0, heard / np.where(D > 0, D, 1), x)
            x = goal + (x - goal) * keep + pace * (after - t) * keep
        history = [(when, y) for when, y in history if when >= after - delay - 1e-12] + [(after, x.copy())]
        seen = max(seen, float((np.abs(x[followers] - R @ x) / bounds[:, j + 1]).max()))
    return seen, largest


def _fresh_step(
    certificate: FamilyCertificate,
    edges: list[tuple[int, int, int, float, float]],
    sides: dict[int, float],
    x: np.ndarray,
    pace: np.ndarray,
    span: tuple[float, float],
) -> np.ndarray:
    """Return the state after a step in which nothing is late: Runge and Kutta's, the mode and all pushes held."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        D, heard = _rows(edges, sides, y, [y], 0.0)
        gain = float(certificate.protocol.gain.value_at_remaining(1 - t / float(certificate.protocol.T)))
        return np.asarray(pace + gain * (heard - D * y))

    t, h = span[0], (span[1] - span[0]) / 8
    for _ in range(8):
        a = slope(t, x)
        b = slope(t + h / 2, x + h / 2 * a)
        c = slope(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + slope(t + h, x + h * c))
        t += h
    return x


def _rows(
    edges: list[tuple[int, int, int, float, float]],
    sides: dict[int, float],
    x: np.ndarray,
    past: list[np.ndarray],
    error: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``D`` and what is heard, with the ages, errors and weights that drive every follower farthest off."""
    D, heard = np.zeros(x.size), np.zeros(x.size)
    for source, v, sign, low, high in edges:
        value = max(sign * sides[v] * y[source] for y in past) + error
        weight = high if value > sides[v] * x[v] else low
        D[v] += weight
        heard[v] += weight * sides[v] * value
    return D, heard


def random_case(seed: int) -> FamilyCertificate:
    rng = np.random.default_rng(seed)
    family = led_family(rng, 1 + seed % 3, 2 + seed % 5, 1 + seed % 3, common=seed % 3 == 1)
    x0 = [int(x) for x in rng.integers(-9, 10, family.n_nodes)]
    asked: dict[str, Any] = {}
    cap = [None, 30][seed // 2 % 2]
    if seed % 4:
        error = Fraction(1, 10) if seed % 5 == 0 else 0
        asked["messages"] = LateMessages(Fraction(int(rng.integers(1, 40)), 1000), value_error=error, gain_cap=cap)
    if seed % 4 in (0, 3):
        asked["leaders"] = MovingLeaders(speed="0.5", disturbance=Fraction(seed % 2))
    return certify(family, PROTOCOL, x0, **asked)  # type: ignore[no-any-return]


@pytest.mark.parametrize("seed", range(12))
def test_no_adversary_leaves_more_than_is_certified(seed: int):
    certificate = random_case(seed)
    assert certificate.verdict == "certified", certificate.checked
    late, rng = certificate.late, np.random.default_rng(seed)
    if late is not None and not late.says_something:
        pytest.skip("nothing is certified of so long a delay")
    seen, inputs = worst_ratio(certificate, rng)
    assert 0 < seen <= 1 + 1e-9
    assert inputs <= 1 + 1e-9


def test_known_weights_in_one_mode_are_bounded_as_those_of_a_graph():
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -2), (3, 2, "-0.5"), (1, 3, -1)])
    ours, plain = UncertainRows(Family.from_graph(graph)), FollowerRows(analyse(graph))
    for q in (Fraction(1), Fraction(5, 4)):
        assert float(ours.witness(q).b) == pytest.approx(float(plain.witness(q).b), rel=1e-9)
    assert ours.weights == pytest.approx(plain.D) and ours.largest(np.ones(2)) == pytest.approx(
        plain.largest(np.ones(2))
    )
    wide = UncertainRows(Family.from_graph(graph, uncertainty="10%"))
    assert wide.witness(Fraction(1)).b < plain.witness(Fraction(1)).b
