"""Facts about limited actuators, each held against quadrature, a matrix exponential, a brute-force loop or DOP853."""

import math
from fractions import Fraction
from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, GainLimits
from ptcc_certify.model.disturbance import SampledDisturbance
from ptcc_certify.model.gain import Gain
from ptcc_certify.model.limited_gain import LimitedGain
from ptcc_certify.simulation.nominal import Bounded, as_forcing
from ptcc_certify.simulation.run import simulate

PROTOCOL = NominalProtocol("0.6", "0.1", "0.3", 1)
GAIN = PROTOCOL.gain
TRIO = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2), ("c", "a", 1), ("a", "c", 3)])
X0 = np.array([3.0, -1.0, 2.0])

# The gain 0.1 + 0.3/(0.6 - t) starts at 0.6.
LIMITS = [
    {"gain_cap": 20},
    {"gain_cap": "0.61"},
    {"gain_cap": "0.6"},
    {"gain_cap": "0.3"},
    {"gain_cap": "0.1"},
    {"gain_cap": "0.05"},
    {"gain_cap": 10**5},
    {"stop_before": "0.05"},
    {"stop_before": "0.5999"},
    {"gain_cap": 20, "stop_before": "0.01"},
    {"gain_cap": 20, "stop_before": "0.2"},
    {"gain_cap": "0.05", "stop_before": "0.2"},
    {"gain_cap": "0.7", "stop_before": "0.1"},
]


def random_graph(rng, n, links=3):
    W = np.zeros((n, n))
    for k in range(n):
        heard = rng.choice([j for j in range(n) if j != k], min(links, n - 1), replace=False)
        W[k, heard] = rng.choice([-1, 1], heard.size) * rng.integers(1, 9, heard.size)
    return SignedDigraph.from_matrix(W, orientation="listens")


def plain_gain(t, cap=None, stop=None, p=PROTOCOL):
    """The definition, as a float function of one instant."""
    T, rho1, pole = float(p.T), float(p.rho1), float(p.rho2 * p.kappa)
    if stop is not None and t >= T - float(stop):
        return 0.0
    value = rho1 + (pole / (T - t) if t < T else 0)
    return value if cap is None else min(value, float(cap))


# ---------------------------------------------------------------------- gain and clock


@pytest.mark.parametrize("limits", LIMITS, ids=str)
def test_value_and_clock_are_the_definition_and_its_integral(limits):
    limited = GainLimits(**limits).limit(GAIN)
    cap, stop = (float(limits[name]) if name in limits else None for name in ("gain_cap", "stop_before"))
    t = np.array([0, 0.05, 0.1, 0.3, 0.41, 0.5, 0.56, 0.58, 0.597, 0.6, 0.7, 3])
    np.testing.assert_allclose(limited.value(t), [plain_gain(v, cap, stop) for v in t], rtol=1e-12)
    corners = [0.6, 0.6 - (stop or 0)] + ([0.6 - 0.3 / (cap - 0.1)] if cap and cap > 0.1 else [])
    for v, clock in zip(t, limited.clock(t), strict=True):
        cuts = sorted({0.0, v, *(c for c in corners if 0 < c < v)})
        area = sum(quad(plain_gain, a, b, (cap, stop), epsabs=0, limit=200)[0] for a, b in pairwise(cuts))
        assert clock == pytest.approx(area, rel=1e-9, abs=1e-15)


def test_the_clock_ends_at_the_closed_form():
    T, rho1, k, cap = 0.6, 0.1, 0.3, 20.0
    expected = rho1 * T + k * (1 + math.log(T * (cap - rho1) / k))
    assert GainLimits(gain_cap=20).limit(GAIN).clock(0.6) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("exponent", [20, 100, 290])
def test_limits_beyond_the_resolution_of_t_act_where_they_should(exponent):
    size = Fraction(10) ** exponent
    capped = GainLimits(gain_cap=size).limit(GAIN)
    assert capped.clock(0.6) == pytest.approx(0.06 + 0.3 * (1 + math.log(2 * float(size))), rel=1e-13)
    stopped = GainLimits(stop_before=1 / size).limit(GAIN)
    assert stopped.clock(0.6) == pytest.approx(0.06 + 0.3 * (math.log(0.6) + exponent * math.log(10)), rel=1e-13)
    left = np.array([3, 1, 0.3]) / (0.6 * float(size))
    np.testing.assert_array_equal(stopped.value(np.full(3, 0.6), left) > 0, [True, False, False])


def test_without_limits_the_gain_stays_what_it_is():
    limited, t = GainLimits().limit(GAIN), np.array([0, 1e-17, 0.1, 0.5999, 0.6, 1])
    np.testing.assert_allclose(limited.clock(t), GAIN.clock(t), rtol=1e-15)
    np.testing.assert_array_equal(limited.value(t), GAIN.value(t))
    assert GainLimits().ideal and not limited.bounded


def test_without_a_deadline_only_a_cap_below_rho1_and_a_stop_act():
    baseline = Gain(1, 2, 0, 1)
    np.testing.assert_array_equal(GainLimits(gain_cap=3).limit(baseline).clock([0.5, 1, 2]), [1, 2, 4])
    np.testing.assert_array_equal(GainLimits(gain_cap=1).limit(baseline).clock([0.5, 1, 2]), [0.5, 1, 2])
    np.testing.assert_array_equal(GainLimits(stop_before="0.5").limit(baseline).clock([0.25, 1, 2]), [0.5, 1, 1])
    assert GainLimits().limit(baseline).bounded


def test_a_stop_acts_from_its_instant_on():
    limited = GainLimits(stop_before="0.1").limit(Gain("0.3", 1, 1, 1))
    t = np.array([np.nextafter(0.2, 0) - 1e-15, 0.2, np.nextafter(0.2, 1), 0.3, 9])
    np.testing.assert_array_equal(limited.value(t) > 0, [True, False, False, False, False])


positive = st.fractions(Fraction(1, 1000), 1000)


@settings(deadline=None)
@given(
    positive, positive, positive, positive, st.none() | st.fractions(0, 1), st.none() | positive, st.integers(0, 2**32)
)
def test_the_clock_increases_and_stays_below_the_cap_times_t(T, rho1, pole, cap, stop, period, seed):
    assume(stop is None or 0 < stop < 1)
    assume(period is None or 1000 * period > T)
    actuator = GainLimits(cap, None if stop is None else stop * T, period)
    t = np.sort(np.append(np.random.default_rng(seed).uniform(0, 2 * float(T), 50), [0, float(T)]))
    limited = actuator.limit(Gain(T, rho1, pole, 1))
    clock, gain = limited.clock(t), limited.value(t)
    slack = 1e-14 * (1 + clock)
    assert clock[0] == 0
    assert (np.diff(clock) >= -slack[1:]).all()
    assert (clock <= float(cap) * t * (1 + 1e-12) + slack).all()
    assert (gain <= float(cap)).all() and (gain >= 0).all()


# ---------------------------------------------------------------------- undisturbed runs


@pytest.mark.parametrize("limits", LIMITS, ids=str)
def test_the_state_is_the_matrix_exponential_of_the_clock(limits):
    rng = np.random.default_rng(len(str(limits)))
    for n in (2, 5, 9):
        graph, start = random_graph(rng, n), rng.normal(size=(n, 2))
        actuator = GainLimits(**limits)
        run = simulate(graph, PROTOCOL, start, actuator=actuator, samples=21)
        L, clock = graph.laplacian().toarray(), actuator.limit(GAIN).clock(run.t, run.remaining)
        np.testing.assert_array_equal(run.clock, clock)
        for i in (*range(0, run.t.size, 7), run.deadline_index, run.t.size - 1):
            assert np.abs(run.states[:, :, i] - expm(-L * clock[i]) @ start).max() < 1e-8
        assert np.abs(run.final_state - expm(-L * clock[run.deadline_index]) @ start).max() < 1e-8
        assert run.t[run.deadline_index] == 0.6


def test_the_input_is_the_effective_one_and_the_run_names_its_actuator():
    actuator = GainLimits(gain_cap=20, stop_before="0.01")
    run = simulate(TRIO, PROTOCOL, X0, actuator=actuator, times=[0, "0.3", "0.588", "0.59", "0.6", 1])
    np.testing.assert_allclose(run.input, np.array([0.6, 1.1, 20, 0, 0, 0]) * run.error, rtol=1e-12)
    assert run.conditions.actuator == actuator
    assert "GainLimits(gain_cap=20, stop_before=1/100)" in repr(run)
    assert not run.deadline_resolved
    np.testing.assert_array_equal(run.states[:, 3:], run.states[:, [3]] * [1, 1, 1])


def test_a_run_long_enough_is_settled_and_a_stopped_start_is_still():
    protocol = NominalProtocol("0.6", "0.1", 9, 1)
    run = simulate(TRIO, protocol, X0, actuator=GainLimits(gain_cap=10**6))
    assert run.deadline_resolved
    assert np.abs(run.final_state - simulate(TRIO, protocol, X0).final_state).max() < 1e-9
    np.testing.assert_array_equal(simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(1), times=[0]).states[:, 0], X0)


@cache
def certified():
    return certify(load_graph("fig1a"), PROTOCOL, asks=Asks(simulation=False))


@pytest.mark.parametrize("limits", LIMITS, ids=str)
def test_a_proved_envelope_holds_on_the_clock_that_acts(limits):
    cert = certified()
    run = simulate(cert.graph, PROTOCOL, [5, 2, -4, 3, -2, 1], actuator=GainLimits(**limits))
    compared = cert.envelope.compare(run)
    assert compared.judged > 100 and not compared.violated


def test_an_ideal_actuator_changes_nothing():
    ideal, run = simulate(TRIO, PROTOCOL, X0, actuator=GainLimits()), simulate(TRIO, PROTOCOL, X0)
    np.testing.assert_array_equal(ideal.states, run.states)
    assert ideal.conditions.actuator is None and "GainLimits" not in repr(ideal)


# ---------------------------------------------------------------------- sampled runs


def brute_force(rows, x, until, h, cap, stop, p):
    """Fractions all along: every (start, end, gain, state at start) up to ``until``, and the state there."""
    end = p.T if stop is None else p.T - stop
    now, course = Fraction(0), []
    while now < until:
        later = (now // h + 1) * h
        later = min([later, until, *(cut for cut in (p.T, end) if cut > now)])
        gain = p.rho1 + (p.rho2 * p.kappa / (p.T - now) if now < p.T else 0)
        gain = gain if cap is None else min(gain, cap)
        gain = Fraction(0) if stop is not None and now >= end else gain
        course.append((now, later, gain, x))
        pull = [sum(w * y for w, y in zip(row, x, strict=True)) for row in rows]
        x = [y - (later - now) * gain * e for y, e in zip(x, pull, strict=True)]
        now = later
    return course, x


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("cap", "stop", "h"),
    thinned(product([None, "0.05", "0.3", 5, 1000], [None, "0.13"], ["0.07", "0.2", "0.05", "0.59", "0.9"]), 7),
)
def test_a_sampled_run_is_the_recursion_in_rationals(cap, stop, h):
    actuator = GainLimits(cap, stop, h)
    times = [Fraction(i, 97) for i in range(80)] + [Fraction("0.83")]
    times = sorted({*times, Fraction("0.6"), Fraction("0.47")})
    run = simulate(TRIO, PROTOCOL, X0, actuator=actuator, times=times)
    rows = [[Fraction(v) for v in row] for row in TRIO.laplacian().toarray()]
    start = [Fraction(v) for v in X0]
    limits = (actuator.sample_period, actuator.gain_cap, actuator.stop_before)
    clock = Fraction(0)
    for i, until in enumerate(times):
        course, x = brute_force(rows, start, until, *limits, PROTOCOL)
        np.testing.assert_allclose(run.states[:, i], [float(v) for v in x], rtol=1e-12, atol=1e-12)
        clock = sum(((b - a) * gain for a, b, gain, _ in course), Fraction(0))
        assert run.clock[i] == pytest.approx(float(clock), rel=1e-12, abs=1e-15)
        # What is held at an instant is what a course that goes on a little holds last.
        *_, (_, _, gain, held) = brute_force(rows, start, until + Fraction(1, 10**9), *limits, PROTOCOL)[0]
        pull = TRIO.laplacian() @ np.array([float(v) for v in held])
        np.testing.assert_allclose(run.input[:, i], -float(gain) * pull, rtol=1e-10, atol=1e-10)


def test_columns_of_a_sampled_run_evolve_apart():
    start, actuator = np.stack([X0, 1e6 * X0[::-1]], axis=1), GainLimits(sample_period="0.07")
    run = simulate(TRIO, PROTOCOL, start, actuator=actuator)
    for column in range(2):
        alone = simulate(TRIO, PROTOCOL, start[:, column], actuator=actuator)
        np.testing.assert_allclose(run.states[:, column], alone.states, rtol=1e-12)
        np.testing.assert_allclose(run.input[:, column], alone.input, rtol=1e-12)


@pytest.mark.parametrize("limits", [{"gain_cap": 20}, {"stop_before": "0.05"}])
def test_sampled_runs_tend_to_the_continuous_one(limits):
    continuous = simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(**limits), samples=21)
    gaps = []
    for h in ("1/100", "1/1000", "1/10000"):
        run = simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(**limits, sample_period=h), samples=21)
        gaps.append(np.abs(run.states - continuous.states).max())
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.5)
    assert gaps[1] / gaps[2] == pytest.approx(10, rel=0.2)


def test_a_period_may_start_closer_to_the_deadline_than_a_float_tells():
    h = Fraction("0.2") - Fraction(1, 10**40)
    run = simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(sample_period=h), times=[0, "0.6", "0.7"])
    assert np.isfinite(run.states).all()
    step = 0.1 * float(h) + 0.3 * np.array([1 / 3, 1 / 2, 1])
    x = X0
    for a in (*step, 0.3):
        x = x - a * (TRIO.laplacian() @ x)
    np.testing.assert_allclose(run.states[:, 1], x, rtol=1e-12)


# ---------------------------------------------------------------------- disturbances and noise


def reference(graph, start, times, gain, d, n, cuts=()):
    """DOP853 in plain time, restarted at ``cuts``."""
    L = graph.laplacian().toarray()
    edges = sorted({0.0, float(times[-1]), *(c for c in cuts if 0 < c < times[-1])})
    x, out = start, np.empty((start.size, len(times)))
    for a, b in pairwise(edges):
        inside = (times >= a) & (times <= b)
        # Just inside the piece the gain has its value of the piece.
        low, high = a + 1e-13, b - 1e-13
        sol = solve_ivp(
            lambda t, x, low=low, high=high: (
                -gain(min(max(t, low), high)) * (L @ (x + n(min(max(t, low), high)))) + d(min(max(t, low), high))
            ),
            (a, b),
            x,
            "DOP853",
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
        )
        if inside.any():
            out[:, inside] = sol.sol(times[inside])
        x = sol.y[:, -1]
    return out


def nothing(t):
    return 0.0


UP_TO = 0.6 * (1 - np.array([1, 0.7, 0.4, 0.1, 0.05, 0.01, 0.003, 1e-3]))
PAST = np.append(UP_TO, [0.6, 0.65, 0.9])
K = np.arange(1, 4)


@pytest.mark.parametrize(
    ("text", "delta", "function"),
    [
        ("0.2*sin(9*k*t)", "0.2", lambda t: 0.2 * np.sin(9 * K * t)),
        ("k*cos(30*t)/3", 1, lambda t: K * np.cos(30 * t) / 3),
        (0.5, 2, lambda t: np.full(3, 0.5)),
        ([1, -2, 3], 3, lambda t: np.array([1.0, -2, 3])),
    ],
)
def test_a_disturbed_run_is_that_of_another_integrator(text, delta, function):
    run = simulate(TRIO, PROTOCOL, X0, disturbance=Bounded(text, delta), times=UP_TO)
    expected = reference(TRIO, X0, UP_TO, plain_gain, function, nothing)
    assert np.abs(run.states - expected).max() < 1e-8
    np.testing.assert_allclose(run.clock, GAIN.clock_at_remaining(run.remaining))
    assert f"disturbance {'constant' if not isinstance(text, str) else text}" in repr(run)


@pytest.mark.few(13)
@pytest.mark.parametrize("limits", LIMITS, ids=str)
@pytest.mark.parametrize("noisy", [False, True])
def test_a_disturbed_and_noisy_run_behind_limits_is_that_of_another_integrator(limits, noisy):
    more = {"noise": Bounded("0.1*cos(20*t + k)", "0.1")} if noisy else {}
    run = simulate(
        TRIO, PROTOCOL, X0, actuator=GainLimits(**limits), disturbance=Bounded("sin(9*k*t)", 1), times=PAST, **more
    )
    cap, stop = (float(limits[name]) if name in limits else None for name in ("gain_cap", "stop_before"))
    cuts = [0.6, 0.6 - (stop or 0)] + ([0.6 - 0.3 / (cap - 0.1)] if cap and cap > 0.1 else [])
    expected = reference(
        TRIO,
        X0,
        PAST,
        lambda t: plain_gain(t, cap, stop),
        lambda t: np.sin(9 * K * t),
        (lambda t: 0.1 * np.cos(20 * t + K)) if noisy else nothing,
        cuts,
    )
    assert np.abs(run.states - expected).max() < (1e-6 if cap == 1e5 else 2e-8)


def test_jumping_signals_are_met_at_their_jumps():
    times = np.array([0, 0.1, 0.25, 0.4, 0.55, 0.7])
    rng = np.random.default_rng(8)
    d, n = (SampledDisturbance(times, rng.uniform(-1, 1, (3, 6)), hold=hold) for hold in (True, False))
    run = simulate(
        TRIO, PROTOCOL, X0, actuator=GainLimits(9), disturbance=Bounded(d, 1), noise=Bounded(n, 1), times=PAST
    )
    expected = reference(
        TRIO,
        X0,
        PAST,
        lambda t: plain_gain(t, 9),
        lambda t: d.values([t], range(3))[:, 0],
        lambda t: n.values([t], range(3))[:, 0],
        [*times, 0.6, 0.6 - 0.3 / 8.9],
    )
    assert np.abs(run.states - expected).max() < 2e-8


@pytest.mark.parametrize("limits", [GainLimits("1e19"), GainLimits(stop_before="1e-20")], ids=["cap", "stop"])
def test_noise_moves_agents_as_long_as_the_gain_acts(limits: GainLimits):
    """Long after a disturbance has ceased to matter: the states follow the noise, ``x -> Q (x + n) - n``."""
    times = [0, 0.5, 1 - 1e-6, 1]
    run = simulate(TRIO, PROTOCOL, X0, actuator=limits, noise=Bounded("10*(k-2)", 10), times=times)
    n = np.array([-10.0, 0.0, 10.0])
    modes = expm(-40 * TRIO.laplacian().toarray())  # of an unbalanced graph nothing remains
    assert run.states[:, -1] == pytest.approx(modes @ (X0 + n) - n, abs=5e-3)


def test_telegraph_signals_of_disturbance_and_noise_differ():
    forcing = as_forcing(TRIO, PROTOCOL.T, Bounded("telegraph", 1), Bounded("telegraph", "0.1"), 1.0)
    assert not set(forcing.disturbance.breaks(1.0)) & set(forcing.noise.breaks(1.0))
    options = {"disturbance": Bounded(forcing.disturbance, 1), "noise": Bounded(forcing.noise, "0.1")}
    run = simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(9), times=UP_TO, **options)
    expected = reference(
        TRIO,
        X0,
        UP_TO,
        lambda t: plain_gain(t, 9),
        *(lambda t, source=source: source.values([t], range(3))[:, 0] for source in forcing[:2]),
        [*forcing.disturbance.breaks(1.0), *forcing.noise.breaks(1.0), 0.6 - 0.3 / 8.9],
    )
    assert np.abs(run.states - expected).max() < 2e-8


@pytest.mark.parametrize("times", [[0, "0.6"], [0, 1], None, [Fraction("0.6") * (1 - Fraction(1, 10**30)), "0.6"]])
def test_a_disturbed_run_reaches_the_deadline_and_goes_on(times):
    """One agent hears nobody and drifts by d; the other follows it and is there at T."""
    graph, protocol = SignedDigraph.from_edges([("a", "b", 1)]), NominalProtocol("0.6", 1, 3, 1)
    run = simulate(graph, protocol, [0, 1], disturbance=Bounded(["0.5", "0"], "0.5"), times=times)
    np.testing.assert_allclose(run.states[0], run.t / 2, atol=1e-8)
    assert run.deadline_resolved
    if run.deadline_index is not None:
        np.testing.assert_allclose(run.final_state, 0.3, atol=1e-8)


def test_the_deadline_is_reached_continuously_under_a_disturbance():
    run = simulate(
        TRIO, NominalProtocol("0.6", "0.1", 3, 1), X0, disturbance=Bounded("0.2*sin(9*k*t)", 1), remaining=1e-12
    )
    i = run.deadline_index
    assert np.abs(run.states[:, i] - run.states[:, i - 1]).max() < 1e-9
    fine = simulate(
        TRIO, run.protocol, X0, disturbance=Bounded("0.2*sin(9*k*t)", 1), times=[Fraction("0.6") - Fraction(1, 10**25)]
    )
    assert np.abs(fine.states[:, 0] - run.final_state).max() < 1e-9


@pytest.mark.few(0)
def test_a_large_disturbed_graph_and_its_columns():
    rng = np.random.default_rng(5)
    graph, start = random_graph(rng, 250), rng.normal(size=(250, 2))
    run = simulate(graph, PROTOCOL, start, disturbance=Bounded("sin(k*t)", 1), times=["0.3", "0.59"])
    times, numbers = np.array([0, 0.3, 0.59]), np.arange(1, 251)
    for column in range(2):
        expected = reference(graph, start[:, column], times, plain_gain, lambda t: np.sin(numbers * t), nothing)
        assert np.abs(run.states[:, column] - expected[:, 1:]).max() < 1e-7


def test_a_disturbance_moves_a_start_at_rest_and_the_baseline():
    run = simulate(TRIO, NominalProtocol(1, 1, 0, 1), [0, 0, 0], disturbance=Bounded(1e-9, "1e-9"), times=[0, "0.5", 2])
    lone = simulate(SignedDigraph.from_edges([], ["a"]), PROTOCOL, [0], disturbance=Bounded("cos(t)", 1), times=[0, 3])
    assert 0 < np.abs(run.states[:, 2]).max() <= 2e-9 * (1 + 1e-9)
    assert run.deadline_index is None and "no deadline" in repr(run)
    assert lone.states[0, 1] == pytest.approx(math.sin(3), abs=1e-8)
    assert simulate(TRIO, NominalProtocol(1, 1, 0, 1), X0, noise=Bounded("0.1", "0.1")).states.shape[0] == 3


# ---------------------------------------------------------------------- refusals


@pytest.mark.parametrize("name", ["gain_cap", "stop_before", "sample_period"])
@pytest.mark.parametrize("value", [-1, 0, "0", float("nan"), float("inf"), "x", None.__class__, 10**400])
def test_a_limit_outside_its_domain_is_refused_by_name(name, value):
    with pytest.raises(ParameterError, match=name) as caught:
        GainLimits(**{name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("stop", ["0.6", 1, Fraction(3, 5)])
def test_a_stop_is_below_the_deadline(stop):
    with pytest.raises(ParameterError, match="stop_before must be below T = 3/5"):
        LimitedGain(GAIN, GainLimits(stop_before=stop))
    with pytest.raises(ParameterError, match="stop_before"):
        simulate(TRIO, PROTOCOL, X0, actuator=GainLimits(stop_before=stop))


def test_limits_that_never_act_are_refused():
    with pytest.raises(ParameterError, match="gain_cap acts only where"):
        GainLimits(gain_cap=10**299).limit(Gain(10**5, 1, 1, 1))
    with pytest.raises(ParameterError, match="stop_before acts only where"):
        GainLimits(stop_before=Fraction(1, 10**299)).limit(Gain(10**5, 1, 1, 1))


CAP, SAMPLED = GainLimits(gain_cap=9), GainLimits(sample_period="0.1")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"disturbance": "t"}, "delta"),
        ({"disturbance": Bounded("2*t", 1)}, "beyond delta"),
        ({"disturbance": Bounded("t", -1)}, "delta = -1"),
        ({"disturbance": Bounded("t", float("nan"))}, "delta"),
        ({"disturbance": Bounded("worst-case", 1)}, "sliding variables"),
        ({"disturbance": Bounded(lambda t, x, s: x, 1)}, "states"),
        ({"disturbance": Bounded(["0"] * 2, 1)}, "2 disturbances for 3 agents"),
        ({"noise": "t", "actuator": CAP}, "noise needs a bound"),
        ({"noise": Bounded("2*t", 1), "actuator": CAP}, "beyond"),
        ({"noise": Bounded("t", 1)}, "infinite.*gain cap or stop"),
        ({"noise": Bounded("t", 1), "actuator": SAMPLED}, "sample period"),
        ({"disturbance": Bounded("t", 1), "actuator": SAMPLED}, "sample period"),
        ({"actuator": GainLimits(sample_period="1e-7")}, "more than 1,000,000 periods"),
        ({"actuator": CAP, "sigma0": [0, 0, 0]}, "sliding-mode"),
        ({"actuator": CAP, "boundary_layer": 0.1}, "sliding-mode"),
        (
            {"disturbance": Bounded(SampledDisturbance(np.linspace(0, 0.5, 10_002), np.zeros(10_002)), 1)},
            "10,000 samples",
        ),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_line(options, words):
    with pytest.raises(ParameterError, match=words) as caught:
        simulate(TRIO, PROTOCOL, X0, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("options", [{"actuator": CAP}, {"noise": Bounded(0, 0)}])
def test_the_sliding_mode_takes_no_actuator(options):
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    with pytest.raises(ParameterError, match=f"{next(iter(options))} belongs to the nominal protocol"):
        simulate(TRIO, protocol, X0, **options)


def test_a_sampled_run_that_diverges_is_a_named_failure():
    with pytest.raises(SimulationError, match="shorter sample_period"):
        simulate(TRIO, NominalProtocol(1, 10**6, 1, 1), X0, actuator=GainLimits(sample_period="1/1000"))
