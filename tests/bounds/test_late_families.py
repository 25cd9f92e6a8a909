"""Late messages and leaders that move on uncertain and switching graphs: adversaries against what is certified."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from led_families import led_family

import ptcc_certify as ptcc
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.checker.reading import digest
from ptcc_certify.errors import HypothesisError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, pairs_of
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov.follower_rows import FollowerRows
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, Expectations, GainLimits
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.report.page import report_html
from ptcc_certify.report.report_file import write_report
from ptcc_certify.report.statement import report_latex

#: The first follower hears the second, and the other way round: no vector decreases for both.
EITHER_WAY = [[("a", "c", -1), ("c", "b", -1)], [("a", "b", 1), ("b", "c", -1)]]
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
UNSURE = Family.from_intervals([("l", "a", 1, 2), ("a", "b", -3, -1), ("b", "a", "-0.5", 0), ("l", "b", -1, -1)])


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


def ages_of(family: Family, messages: LateMessages | None) -> dict[tuple[int, int], float]:
    """How old what is heard may be, by source and target."""
    source, target = (ends.tolist() for ends in family.pairs)
    pairs = list(zip(source, target, strict=True))
    if messages is None:
        return dict.fromkeys(pairs, 0.0)
    each = messages.latencies(family)
    each = each if isinstance(each, tuple) else (each,) * len(pairs)
    return {pair: float(x + messages.held) for pair, x in zip(pairs, each, strict=True)}


def worst_ratio(certificate: Certificate, rng: np.random.Generator) -> tuple[float, float]:
    """Seen over certified, distance to the target and input, of a motion that is chosen against the followers.

    Mode, weights, ages, errors, leaders and disturbances are held over a step, ages so that they stay within the
    delay: what agents hear is constant then, and the motion exact but for disturbances, which are taken too small.
    """
    family, late = certificate.family, certificate.late
    messages = None if late.tracks else late.messages
    ages = ages_of(family, messages)
    leaders = certificate.asked_leaders
    T, delay = float(certificate.protocol.T), 0.0 if messages is None else float(messages.age)
    error = 0.0 if messages is None else float(messages.value_error)
    speed, pushed = (0.0, 0.0) if leaders is None else (float(leaders.speed), float(leaders.disturbance))
    followers = FollowerRows(family).followers
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
    clock = late.gain.clock(late_grid)
    if not capped:
        clock = certificate.protocol.gain.clock_at_remaining(1 - late_grid / T)
    x = np.array([float(y) for y in certificate.initial_state or ()])
    history, seen, largest = [(0.0, x.copy())], 0.0, 0.0
    bounds, inputs = late.deviation_bound(late_grid), late.input
    for j, (t, after) in enumerate(pairwise(late_grid.tolist())):
        off = x[followers] - R @ x
        side = np.where(off == 0, rng.choice([-1.0, 1.0], off.size), np.sign(off))
        sides = dict(zip(followers.tolist(), side.tolist(), strict=True))
        past = {
            pair: [y for when, y in history if when >= t - max(age - (after - t), 0.0) - 1e-15] or [x]
            for pair, age in ages.items()
        }
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
    certificate: Certificate,
    edges: list[tuple[int, int, int, float, float]],
    sides: dict[int, float],
    x: np.ndarray,
    pace: np.ndarray,
    span: tuple[float, float],
) -> np.ndarray:
    """Return the state after a step in which nothing is late: Runge and Kutta's, the mode and all pushes held."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        D, heard = _rows(edges, sides, y, {edge[:2]: [y] for edge in edges}, 0.0)
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
    past: dict[tuple[int, int], list[np.ndarray]],
    error: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``D`` and what is heard, with the ages, errors and weights that drive every follower farthest off."""
    D, heard = np.zeros(x.size), np.zeros(x.size)
    for source, v, sign, low, high in edges:
        value = max(sign * sides[v] * y[source] for y in past[source, v]) + error
        weight = high if value > sides[v] * x[v] else low
        D[v] += weight
        heard[v] += weight * sides[v] * value
    return D, heard


def random_case(seed: int, by_edge: bool = False) -> Certificate:
    rng = np.random.default_rng(seed)
    family = led_family(rng, 1 + seed % 3, 2 + seed % 5, 1 + seed % 3, common=seed % 3 == 1)
    x0 = [int(x) for x in rng.integers(-9, 10, family.n_nodes)]
    asked: dict[str, Any] = {}
    cap = [None, 30][seed // 2 % 2]
    if seed % 4:
        error = Fraction(1, 10) if seed % 5 == 0 else 0
        asked["messages"] = LateMessages(Fraction(int(rng.integers(1, 40)), 1000), value_error=error, gain_cap=cap)
    if by_edge:
        delay = Fraction(int(rng.integers(5, 60)), 1000)
        each = {pair: delay * Fraction(int(rng.integers(0, 5)), 4) for pair in pairs_of(family)}
        asked["messages"] = LateMessages({**each, pairs_of(family)[0]: delay}, gain_cap=cap)
    if seed % 4 in (0, 3):
        asked["leaders"] = MovingLeaders(speed="0.5", disturbance=Fraction(seed % 2))
    return certify(family, PROTOCOL, x0, **asked)  # type: ignore[no-any-return]


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("by_edge", [False, True], ids=["one delay", "edge by edge"])
def test_no_adversary_leaves_more_than_is_certified(by_edge: bool, seed: int):
    certificate = random_case(seed, by_edge)
    assert certificate.verdict == "certified", certificate.checked
    late, rng = certificate.late, np.random.default_rng(seed)
    if late is not None and not late.says_something:
        pytest.skip("nothing is certified of so long a delay")
    seen, inputs = worst_ratio(certificate, rng)
    assert 0 < seen <= 1 + 1e-9
    assert inputs <= 1 + 1e-9


def test_known_weights_in_one_mode_are_bounded_as_those_of_a_graph():
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -2), (3, 2, "-0.5"), (1, 3, -1)])
    ours, plain = FollowerRows(Family.from_graph(graph)), FollowerRows(analyse(graph))
    for q in (Fraction(1), Fraction(5, 4)):
        assert float(ours.witness(q).b) == pytest.approx(float(plain.witness(q).b), rel=1e-9)
    assert ours.weights == pytest.approx(plain.D) and ours.largest(np.ones(2)) == pytest.approx(
        plain.largest(np.ones(2))
    )
    wide = FollowerRows(Family.from_graph(graph, uncertainty="10%"))
    assert wide.witness(Fraction(1)).b < plain.witness(Fraction(1)).b


@pytest.mark.few(0)
def test_what_no_gain_takes_away_is_less_than_every_gain_leaves():
    leaders, found = MovingLeaders(speed="0.5"), []
    for cap, rho2 in ((Fraction(1, 1000), 2), (5, 2), (20, 2), (500, 2), (None, 2), (None, 50)):
        protocol, messages = NominalProtocol(T=1, rho1=1, rho2=rho2, kappa=1), LateMessages("0.05", gain_cap=cap)
        late = certify(UNSURE, protocol, [1, 2, -3], messages=messages, leaders=leaders).late
        found.append((late.never_below, late.largest))
    assert 0.025 <= max(kept for kept, _ in found) <= min(left for _, left in found)  # speed times delay at least


BESIDE: dict[str, dict[str, Any]] = {
    "late": {"messages": LateMessages("0.01")},
    "late edge by edge": {"messages": LateMessages({("a", "b"): "0.02", ("b", "a"): "0.001", ("l", "b"): "0.5"})},
    "capped": {"messages": LateMessages("0.01", period="0.002", losses=2, value_error="0.01", gain_cap=20)},
    "late behind leaders that move": {
        "messages": LateMessages("0.01", gain_cap=20),
        "leaders": MovingLeaders(speed="0.5", disturbance="0.1"),
    },
    "leaders that move": {"leaders": MovingLeaders(speed="0.5")},
    "leaders that move, followed with a sign term": {"leaders": MovingLeaders(speed="0.5", sign_gain=1)},
    "a cap": {"limits": GainLimits(gain_cap=20)},
    "disturbances": {"asks": Asks(delta="0.1")},
    "noise and disturbances under a cap": {
        "asks": Asks(delta="0.1", noise="0.01"),
        "limits": GainLimits(gain_cap=20),
    },
}


@cache
def certified(name: str, x0: tuple[int, ...] | None = (1, 2, -3)) -> Certificate:
    return certify(UNSURE, PROTOCOL, x0, **BESIDE[name])  # type: ignore[no-any-return]


@pytest.mark.few(0)
@pytest.mark.parametrize("x0", [(1, 2, -3), None], ids=["state", "every state"])
@pytest.mark.parametrize("name", BESIDE)
def test_what_is_certified_is_read_back(name: str, x0: tuple[int, ...] | None, tmp_path: Path):
    made = certified(name, x0)
    made.save(tmp_path / "c.json")
    found = ptcc.read_certificate(tmp_path / "c.json")
    assert found == made and found.leaders_move == made.leaders_move == ("leaders" in BESIDE[name])
    assert found.summary() == made.summary() and "nothing late" not in found.summary().split("claim")[0]
    if made.late is not None:
        assert found.late.messages.latencies(UNSURE) == made.late.messages.latencies(UNSURE)
        assert found.late.messages.age == made.late.messages.age and found.late.leaders == made.late.leaders
        assert found.late.largest == pytest.approx(made.late.largest) and found.late.relative == (x0 is None)
        t = np.linspace(0, 1, 11)
        assert found.late.deviation_bound(t) == pytest.approx(made.late.deviation_bound(t))


@pytest.mark.few(0)
def test_what_a_cap_leaves_bounds_runs_of_members():
    made, runs = certified("a cap"), []
    for member in ([(0, 1, 1), (1, 2, -3), (2, 1, "-0.5"), (0, 2, -1)], [(0, 1, 2), (1, 2, -1), (0, 2, -1)]):
        run = ptcc.simulate(SignedDigraph.from_edges(member), PROTOCOL, [1, 2, -3], actuator=GainLimits(gain_cap=20))
        runs.append(np.abs(run.final_state - np.array([1, 1, -1])).max())
        assert np.all(np.abs(run.input).max(axis=1)[1:] <= made.late.inputs.max())
    assert 0.05 * made.late.largest < max(runs) <= made.late.largest


def test_what_is_asked_of_a_family_under_a_cap_alone_is_told_of_the_cap():
    asks = Asks(expectations=Expectations("bipartite consensus", min_rate=Fraction(1, 10)))
    made = certify(UNSURE, PROTOCOL, [1, 2, -3], limits=GainLimits(gain_cap=20), asks=asks)
    text = made.assessment.text
    assert "bipartite consensus at T under a cap (nothing settles under a cap); met: rate >= 0.1" in text
    page = report_html(ptcc.read_certificate(made))
    for word in ("under disturbances", "of its target", "leaders move", "late messages"):
        assert word not in " ".join((made.summary(), text, page)), word


@pytest.mark.parametrize(
    ("more", "asked"),
    [
        ({"limits": GainLimits(gain_cap=20)}, "a gain cap"),
        ({"asks": Asks(delta="0.1")}, "disturbances"),
        ({"leaders": MovingLeaders(speed=1)}, "leaders that move"),
    ],
)
def test_where_no_vector_of_all_modes_exists_what_was_asked_is_named(more: dict[str, Any], asked: str):
    modes = [SignedDigraph.from_edges(one) for one in EITHER_WAY]
    made = certify(dict(zip("mn", modes, strict=True)), PROTOCOL, [1, 2, -3], **more)
    assert made.assessment.exit_code == 4
    assert f"left open: {asked} (no vector for the followers was found)" in made.assessment.text


@pytest.mark.few(0)
def test_disturbances_and_noise_of_a_family_are_those_of_followers_and_of_what_is_heard():
    limits, asks = GainLimits(gain_cap=20), Asks(delta="0.1", noise="0.01")
    noisy = certify(UNSURE, PROTOCOL, [1, 2, -3], limits=limits, asks=asks)
    inexact = LateMessages(value_error="0.02", gain_cap=20, leaders=MovingLeaders(speed=0, disturbance="0.1"))
    plain = certify(UNSURE, PROTOCOL, [1, 2, -3], messages=inexact)
    assert noisy.late is not None and noisy.document["digest"] == plain.document["digest"]
    assert 0.02 < noisy.late.largest < 0.2 and noisy.assessment.exit_code == 0


@pytest.mark.parametrize(
    "more",
    [
        {"limits": GainLimits(stop_before="0.1")},
        {"limits": GainLimits(gain_cap=9, sample_period="0.1")},
        {"limits": (GainLimits(gain_cap=9), GainLimits(gain_cap=8)), "asks": Asks(noise=1)},
        {"limits": GainLimits(stop_before="0.1"), "asks": Asks(delta=1)},
    ],
)
def test_other_limits_of_families_are_refused(more: dict[str, Any]):
    with pytest.raises(ParameterError, match="families take one gain cap alone"):
        certify(UNSURE, PROTOCOL, [1, 2, -3], **more)
    group, asked = Family.from_intervals([(1, 2, 1, 2), (2, 1, 1, 2)]), GainLimits(gain_cap=9)
    with pytest.raises(HypothesisError, match=r"with leaders that move.*leads and hears others: leave it out"):
        certify(group, PROTOCOL, limits=asked, leaders=MovingLeaders(speed=1))
    with pytest.raises(HypothesisError, match=r"with late messages.*leads and hears others: add a gain cap"):
        certify(group, PROTOCOL, messages=LateMessages("0.01"))


@pytest.mark.few(0)
def test_a_delay_that_is_not_forgiven_is_left_open_and_read_back(tmp_path: Path):
    asked = Asks(expectations=Expectations("bipartite consensus", max_residual="0.1"))
    made = certify(UNSURE, PROTOCOL, [1, 2, -3], messages=LateMessages(50, gain_cap=100), asks=asked)
    made.save(tmp_path / "c.json")
    for certificate in (made, ptcc.read_certificate(tmp_path / "c.json")):
        assert certificate.verdict == "certified" and certificate.assessment.asked == "left open"
        assert int(certificate.assessment.exit_code) == 4 and certificate.late.messages.delay == 50


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ({"behaviour": "bipartite consensus"}, 4),
        ({"max_residual": "0.1"}, 0),
        ({"max_residual": "1e-9"}, 4),
        ({"min_rate": "0.1"}, 4),
        ({"max_input": 10_000}, 0),
        ({"max_input": 1}, 3),
    ],
)
def test_expectations_are_of_what_is_asked(words: dict[str, Any], code: int):
    """What follows where nothing is late is no answer to a question about late messages."""
    messages, asked = LateMessages("0.001", gain_cap=50), Asks(expectations=Expectations(**words))
    certificate = certify(UNSURE, PROTOCOL, [1, 2, -3], messages=messages, asks=asked)
    assert int(certificate.assessment.exit_code) == code


@pytest.mark.parametrize(
    ("family", "more", "why"),
    [
        ([("a", "b", 1, 2), ("b", "a", 1, 2), ("b", "c", 1, 2)], {}, "a leads and hears others"),
        ([("a", "c", 1, 2), ("b", "c", 1, 2)], {}, "where the signal decides"),
        ([("a", "b", 1, 2)], {"messages": LateMessages({("b", "a"): "0.1"})}, "no such edge"),
        ([("a", "b", 1, 2)], {"messages": LateMessages("0.1", own_delay=True, gain_cap=2)}, "own state"),
        ([("a", "b", 1, 2)], {"asks": Asks(expectations=Expectations(max_residual=1)), "messages": None}, "how late"),
    ],
)
def test_what_is_not_proved_is_refused(family: Any, more: dict[str, Any], why: str):
    with pytest.raises((ParameterError, HypothesisError), match=why):
        certify(Family.from_intervals(family), PROTOCOL, **{"messages": LateMessages("0.1"), **more})


def test_under_the_sliding_mode_protocol_variables_begin_at_0():
    sliding = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=2, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    messages = LateMessages("0.01")
    assert certify(UNSURE, sliding, [1, 2, -3], messages=messages).verdict == "certified"
    with pytest.raises(ParameterError, match="sigma0"):
        certify(UNSURE, sliding, ptcc.InitialState([1, 2, -3], sigma0=[1, 0, 0]), messages=messages)
    with pytest.raises(ParameterError, match="nominal"):
        certify(UNSURE, sliding, [1, 2, -3], leaders=MovingLeaders(speed=1))


def forged(name: str, path: str, value: Any) -> str | None:
    """Return what the check says of a certificate with another number; None if it accepts that."""
    data = certified(name).to_dict()
    *way, last = path.split(".")
    at: Any = data
    for key in way:
        at = at[int(key) if key.isdigit() else key]
    assert at[int(last) if last.isdigit() else last] != value
    at[int(last) if last.isdigit() else last] = value
    return check(data | {"digest": digest(data)}).rejected


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("late", "messages.delay", "1/2"),
        ("late", "messages.residual.a", "0"),
        ("late", "messages.residual.l", "1"),
        ("late", "messages.rows.0.initial", "1/100"),
        ("late", "messages.rows.0.left", "0"),
        ("late edge by edge", "messages.latency.3", "1/5"),
        ("late edge by edge", "messages.latency", ["0", "0.02", "0.5"]),
        ("late edge by edge", "messages.latency", ["0", "1/2", "1/1000", "1/50", "0"]),
        ("capped", "messages.rows.0.floor", "0"),
        ("capped", "messages.input.b", "1"),
        ("capped", "messages.value_error", "1"),
        ("late behind leaders that move", "messages.rows.0.drift", "0"),
        ("late behind leaders that move", "messages.rows.0.after", "0"),
        ("leaders that move", "messages.rows.0.initial", "0"),
        ("leaders that move", "messages.rows.0.after", "0"),
        ("leaders that move", "messages.leaders.speed", "9"),
        ("leaders that move, followed with a sign term", "messages.leaders.sign_gain", "1/4"),
    ],
)
def test_a_forged_number_is_rejected(name: str, path: str, value: str):
    assert forged(name, path, value) is not None


@pytest.mark.few(0)
def test_rows_hold_at_the_worst_weights_of_every_mode_alone():
    """Of two modes, each of which has a rate, none is proved by the rows of the other; ``b`` above the least fails."""
    day = Family.from_intervals([("l", "a", 1, 2), ("a", "b", 5, 6)])
    night = Family.from_intervals([("l", "a", "0.1", 2), ("a", "b", 1, 6)])
    both = certify(Family.switching([day, night]), PROTOCOL, [0, 1, 1], leaders=MovingLeaders(speed=1))
    data = both.to_dict()
    step = next(one for one in data["proof"] if one["kind"] == "late-rows")
    assert float(Fraction(step["numbers"]["b"])) <= 0.1
    step["numbers"]["b"] = "1/9"
    data["digest"] = digest(data)
    assert "does not decay so fast" in str(check(data).reason)
    assert json.loads(both.to_json())["messages"]["leaders"]["speed"] == "1"


@pytest.mark.usefixtures("framed_figures")
def test_figures_are_of_what_is_asked(tmp_path: Path):
    """The bound is drawn, and no run in which nothing is late and leaders rest."""
    late, moving = certified("late"), certified("leaders that move")
    assert [late.main_figure, moving.main_figure] == ["late", "tracking"]
    assert [line.get_label() for line in late.plot("late").lines] == ["proved bound"]
    assert [line.get_label() for line in moving.plot("tracking", axis="time").lines] == ["proved bound", "$T$"]
    for what in ("states", "decay", "input"):
        with pytest.raises(ParameterError, match="no run of a family is made with late messages"):
            late.plot(what)
    late.save(tmp_path / "c.json")
    page = report_html(ptcc.read_certificate(tmp_path / "c.json"))
    assert 'id="figure-late"' in page and 'id="figure-states"' not in page


@pytest.mark.few(1)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize("name", ["late", "late behind leaders that move", "leaders that move"])
def test_page_and_latex_tell_no_end_of_another_problem(name: str, tmp_path: Path):
    """Where agents end is told with what it leaves out, and a bound without a run is not called a run."""
    made = certified(name)
    made.save(tmp_path / "c.json")
    saved = ptcc.read_certificate(tmp_path / "c.json")
    capped = made.late is not None and made.late.messages.gain_cap is not None
    absent = {"without a gain cap": capped, "nothing late": not made.late.tracks, "leaders at rest": made.leaders_move}
    asked = made.proof.asked_leaders
    absent["without disturbances"] = asked is not None and asked.disturbance > 0
    without = ", ".join(text for text, there in absent.items() if there)
    page = report_html(saved)
    assert f"Where the agents end, {without}, proved for every signal" in page
    assert "numerical), under the proved bound" not in page and "at most: the proved bound for every signal" in page
    assert f"occurs at $T$ for every such choice, {without}: as" in report_latex(saved)
    assert saved.to_pandas()["keeps"].tolist() == [not made.leaders_move, False, False]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("late", "late messages"),
        ("capped", "late and inexact messages"),
        ("leaders that move", "leaders that move"),
        ("a cap", "a gain cap"),
        ("disturbances", "disturbances"),
        ("noise and disturbances under a cap", "inexact messages"),
    ],
)
def test_a_page_of_a_family_tells_why_there_is_no_run(name: str, why: str, tmp_path: Path):
    certified(name).save(tmp_path / "c.json")
    write_report(tmp_path / "c.json", tmp_path / "c.html")
    page = (tmp_path / "c.html").read_text("utf-8")
    assert f"with {why} none is made of a family" in page
    assert ("however leaders move" in page) == certified(name).leaders_move
