"""Facts about trajectories under the sliding-mode protocol, each held against a method that shares nothing with it."""

import csv
import io
import math
from fractions import Fraction
from functools import cache
from itertools import pairwise, product

import casadi as ca
import numpy as np
import pytest
from generators import all_classes, random_graph
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import SlidingModeProtocol
from ptcc_certify.model.disturbance import SampledDisturbance, StateDependent, telegraph_noise
from ptcc_certify.model.reaching_time import certified_reaching_times
from ptcc_certify.simulation.nominal import Bounded
from ptcc_certify.simulation.run import simulate

F = Fraction
X0 = [5, 2, -4, 3, -2, 1]
SIGMA0 = [1.0, -0.5, 0.25, -2.0, 0.75, 1.5]


def protocol(power="3/2", **changes):
    """A protocol with ``mu3 kappa = power``."""
    given = {"T_r": 1, "T_s": F(3, 2), "rho1": F(1, 2), "rho2": F(2, 5), "kappa": 1}
    return SlidingModeProtocol(**(given | {"mu1": 2, "mu2": 1, "mu3": power, "delta": 1} | changes))


@cache
def six():
    """A balanced leading ring, an unbalanced pair that listens to it, and a follower of both."""
    edges = [(1, 2, 2), (2, 3, -1), (3, 1, -1), (3, 4, 1), (4, 5, 1), (5, 4, -3), (1, 6, 1), (5, 6, -2)]
    return SignedDigraph.from_edges(edges)


def final_state_of(graph, x0, sigma0):
    """Q (x0 - sigma0), exactly, as floats."""
    start = [F(x) - F(s) for x, s in zip(x0, sigma0, strict=True)]
    return np.array([float(x) for x in final_state(analyse(graph), start).states])


def gains(p, t):
    """The nominal gain and that of the sliding variables before T_r, from their definitions."""
    nominal = float(p.rho1) + float(p.rho2 * p.kappa) / (float(p.T) - t)
    with np.errstate(divide="ignore"):
        return nominal, float(p.mu2) + np.divide(float(p.mu3 * p.kappa), float(p.T_r) - t)


# ---------------------------------------------------------------------- implicit Euler on the differential inclusion


def implicit_euler(graph, p, x0, sigma0, d, steps, marks):
    """Return the (2, N, 2 marks) states and sliding variables, evenly over [0, T_r] and over [T_r, T_r + T_s/2].

    The set-valued sign is resolved implicitly: sigma + h mu1 sign(sigma) = ... is solved by a soft threshold, so that
    nothing chatters and 0 is met exactly. ``d(t, x, sigma)`` returns (N,).
    """
    T_r, T_s, mu1, n = float(p.T_r), float(p.T_s), float(p.mu1), graph.n_nodes
    L = graph.laplacian().toarray()
    sigma = np.array(sigma0, dtype=float)
    y = np.array(x0, dtype=float) - sigma
    kept = []
    for start, h in ((0.0, T_r / steps), (T_r, T_s / 2 / steps)):
        t = start + h * np.arange(1, steps + 1)
        nominal, _ = gains(p, t)
        inverse = np.linalg.inv(np.eye(n) + (h * nominal)[:, None, None] * L)
        drive = (h * nominal)[:, None, None] * L
        for i in range(steps):
            if start or i == steps - 1:
                sigma = np.zeros(n)
            else:
                pushed = sigma + h * d(t[i], y + sigma, sigma)
                g = float(p.mu2) + float(p.mu3 * p.kappa) / (T_r - t[i])
                sigma = np.sign(pushed) * np.maximum(np.abs(pushed) - h * mu1, 0) / (1 + h * g)
            y = inverse[i] @ (y - drive[i] @ sigma)
            if (i + 1) % (steps // marks) == 0:
                kept.append(np.stack([y + sigma, sigma]))
    return np.stack(kept, axis=-1)


KINDS = ["sine", "constant", "telegraph", "samples", "worst-case", "state"]


def disturbances(kind, rng, n, p):
    """A disturbance of a kind, for the package and as a function of (t, x, sigma) written here."""
    delta, end = float(p.delta), float(p.T)
    if kind == "sine":
        a, phase = float(rng.uniform(1, 9)), float(rng.uniform(0, 6))
        k = np.arange(1, n + 1)
        return f"{delta!r}*sin(k*{a!r}*t + {phase!r})", lambda t, x, sigma: delta * np.sin(k * a * t + phase)
    if kind == "constant":
        levels = rng.uniform(-delta, delta, n)
        return levels.tolist(), lambda t, x, sigma: levels
    if kind == "worst-case":
        return "worst-case", lambda t, x, sigma: delta * np.sign(sigma)
    if kind == "state":

        def function(t, x, sigma):
            return delta * np.sin(x + 2 * sigma + t)

        return function, function
    if kind == "telegraph":
        noise = telegraph_noise(delta, 5 / end, n, end, int(rng.integers(99)))
        return noise, lambda t, x, sigma: noise.samples[:, np.searchsorted(noise.times, t, side="right") - 1]
    times, values = np.linspace(0, end, 9), rng.uniform(-delta, delta, (n, 9))
    return SampledDisturbance(times, values), lambda t, x, sigma: np.array([np.interp(t, times, row) for row in values])


MARKS = 10


def campaign(cases, steps, rng):
    """Return for each case its kind, the difference at the finest steps, the extrapolated one, and observed orders."""
    classes, rows = all_classes(), []
    for case in range(cases):
        n, kind = int(rng.integers(2, 9)), KINDS[case % len(KINDS)]
        while True:
            name, keywords = classes[int(rng.integers(len(classes)))]
            try:
                graph = random_graph(rng, **(keywords | {"n": n})).graph
            except ValueError:  # this class has no graph so small
                continue
            break
        # In units in which the fastest agent is as fast as the gains: Euler has to resolve it.
        graph = SignedDigraph.from_matrix(
            graph.adjacency().toarray() * 4 / (graph.in_weight().max() or 1), orientation="listens"
        )
        p = protocol(
            [F(1), F(3, 2), F(2), F(3)][case % 4],
            T_r=F(int(rng.integers(5, 16)), 10),
            T_s=F(int(rng.integers(5, 21)), 10),
            mu2=F(int(rng.integers(1, 30)), 10),
            mu1=F(int(rng.integers(12, 30)), 10),
        )
        x0, sigma0 = rng.uniform(-3, 3, n), rng.uniform(-1, 1, n) * rng.choice([0, 1, 1, 1], n)
        ours, theirs = disturbances(kind, rng, n, p)
        times = [p.T_r * F(i, MARKS) for i in range(1, MARKS + 1)]
        times += [p.T_r + p.T_s * F(i, 2 * MARKS) for i in range(1, MARKS + 1)]
        run = simulate(graph, p, x0, sigma0=sigma0, disturbance=ours, times=times)
        exact = np.stack([run.states, run.sliding.sigma])
        found = [implicit_euler(graph, p, x0, sigma0, theirs, count, MARKS) for count in steps]
        errors = [np.abs(values - exact).max() for values in found]
        extrapolated = np.abs(2 * found[-1] - found[-2] - exact).max()
        size = np.abs(x0).max()
        orders = [math.log2(a / b) for a, b in pairwise(errors) if b > 1e-9 * size]
        rows.append((name, kind, errors[-1] / size, extrapolated / size, orders))
    return rows


def show(title, rows, smooth):
    orders = np.concatenate([row[4] for row in smooth])
    print(
        f"\n{title}: {len(rows)} runs, difference at the finest steps {max(r[2] for r in rows):.1e}, extrapolated "
        f"{max(r[3] for r in smooth):.1e} where d is continuous ({max(r[3] for r in rows):.1e} overall); "
        f"orders {orders.min():.2f} .. {np.median(orders):.3f} .. {orders.max():.2f}"
    )
    return orders


def check_campaign(title, rows, finest, extrapolated):
    smooth = [row for row in rows if row[1] != "telegraph"]
    orders = show(title, rows, smooth)
    assert 0.95 < np.median(orders) < 1.05
    assert orders.size > len(smooth)
    for name, kind, difference, rest, own in rows:
        assert difference < finest, name
        # A jump falls anywhere between two steps: with jumps the order is not clean, and extrapolation does not help.
        if kind != "telegraph":
            assert rest < extrapolated, (name, kind)
            assert all(0.9 < order < 1.1 for order in own), (name, kind)


@pytest.mark.few(0)
def test_implicit_euler_on_the_inclusion_approaches_our_solution_at_order_one():
    rows = campaign(len(KINDS), [500, 1000, 2000], np.random.default_rng(11))
    check_campaign("implicit Euler", rows, finest=5e-3, extrapolated=2e-5)


@pytest.mark.campaign
def test_implicit_euler_approaches_our_solution_on_many_graphs():
    rows = campaign(120, [500, 1000, 2000, 4000], np.random.default_rng(12))
    check_campaign("implicit Euler, campaign", rows, finest=2e-3, extrapolated=1e-4)


# ---------------------------------------------------------------------- between the reaching times, an explicit method


def between_events(graph, p, x0, sigma0, d, events, z_wanted):
    """DOP853 in z = ln(T_r/(T_r - t)): (2, N, M) states and sliding variables, the latter at their events, and y."""
    n, L, T_r = graph.n_nodes, graph.laplacian().toarray(), float(p.T_r)
    state = np.concatenate([np.subtract(x0, sigma0), sigma0])
    out, left_over = np.full((2, n, z_wanted.size), np.nan), np.zeros(n)
    stops = np.unique(np.concatenate([[0.0], events[np.isfinite(events)], [z_wanted[-1]]]))
    for a, b in pairwise(stops.tolist()):
        sign = np.where(events > a, np.sign(sigma0), 0.0)

        def motion(z, v, sign=sign):
            t, R = -T_r * math.expm1(-z), T_r * math.exp(-z)
            y, sigma = v[:n], v[n:]
            drift = -float(p.mu1) * sign + d(t, y + sigma, sigma)
            rate = float(p.rho1) + float(p.rho2 * p.kappa) / (float(p.T_s) + R)
            moved = R * drift - (float(p.mu2) * R + float(p.mu3 * p.kappa)) * sigma
            return np.concatenate([-R * rate * (L @ (y + sigma)), np.where(sign != 0, moved, 0.0)])

        inside = np.flatnonzero((z_wanted >= a) & (z_wanted <= b))
        at = np.append(z_wanted[inside], b)
        run = solve_ivp(motion, (a, b), state, method="DOP853", t_eval=np.unique(at), rtol=1e-13, atol=1e-13)
        out[:, :, inside] = run.y[:, np.searchsorted(run.t, z_wanted[inside])].reshape(2, n, -1)
        state = run.y[:, -1].copy()
        arrived = np.flatnonzero(events == b)
        left_over[arrived] = state[n + arrived]
        state[n + arrived] = 0
    out[0] += out[1]
    return out, left_over, state[:n]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("kind", "power"), thinned(product(["sine", "worst-case", "state", "constant"], [F(1), F(3, 2), F(3)]))
)
def test_an_explicit_integration_between_the_reaching_times_agrees(kind, power):
    rng = np.random.default_rng([KINDS.index(kind), int(2 * power)])
    worst = [0.0, 0.0, 0.0]
    for _ in range(2):
        p = protocol(power, T_r=F(int(rng.integers(5, 16)), 10))
        n, graph, T_r = 6, six(), float(p.T_r)
        x0, sigma0 = rng.uniform(-3, 3, n), rng.uniform(-1, 1, n) * [1, 1, 1, 1, 1, 0]
        ours, theirs = disturbances(kind, rng, n, p)
        times = [*np.sort(rng.uniform(0, T_r, 30)).tolist(), p.T_r + p.T_s / 4, p.T_r + p.T_s * F(9, 10)]
        run = simulate(graph, p, x0, sigma0=sigma0, disturbance=ours, times=times)
        assert np.isfinite(run.sliding.reaching_z).all()
        z = -np.log1p(-run.t[:30] / T_r)
        end = max(run.sliding.reaching_z.max(), z[-1])
        values, left_over, y = between_events(graph, p, x0, sigma0, theirs, run.sliding.reaching_z, np.append(z, end))
        worst[0] = max(worst[0], np.abs(values[0, :, :-1] - run.states[:, :30]).max())
        worst[1] = max(worst[1], np.abs(values[1, :, :-1] - run.sliding.sigma[:, :30]).max())
        worst[2] = max(worst[2], np.abs(left_over).max())
        # From the last reaching time on the motion is the matrix exponential of the clock.
        last = (float(p.T_s) + T_r * math.exp(-end)) / float(p.T)
        for i in (30, 31):
            span = run.clock[i] - p.gain.clock_at_remaining(last)
            worst[0] = max(worst[0], np.abs(expm(-span * graph.laplacian().toarray()) @ y - run.states[:, i]).max())
    print(f"\nDOP853, {kind}: states {worst[0]:.1e}, sigma {worst[1]:.1e}, at the reaching times {worst[2]:.1e}")
    # CVODES is asked for 1e-11 a step, which adds up over its steps; sigma comes from quadratures, near rounding.
    assert worst[0] < 1e-8
    assert max(worst[1:]) < (1e-9 if kind == "state" else 1e-11)


# ---------------------------------------------------------------------- the outcome


@pytest.mark.few(0)
def test_ten_disturbances_end_in_the_same_exact_final_state():
    graph, p = six(), protocol()
    levels = np.linspace(-1, 1, 25)
    rng = np.random.default_rng(0)
    ten = {
        "worst-case": "worst-case",
        "telegraph 1": telegraph_noise(1, 8, 6, 2.5, seed=1),
        "telegraph 2": telegraph_noise(1, 8, 6, 2.5, seed=2),
        "constant +": 0.9,
        "constant -": -0.9,
        "fast": "sin(300*t)",
        "state": lambda t, x, sigma: np.sin(x),
        "against the sign": lambda t, x, sigma: -np.tanh(20 * x),
        "samples": SampledDisturbance(np.linspace(0, 2.5, 25), rng.permuted(np.tile(levels, (6, 1)), axis=1)),
        "list": [f"sin({3 * k}*t)" if k % 2 else f"cos(k*t)*exp(-{k}*t)" for k in range(6)],
    }
    expected = final_state_of(graph, X0, SIGMA0)
    # sigma(0) matters: without it they would end elsewhere.
    assert np.abs(expected - final_state_of(graph, X0, [0] * 6)).max() > 0.1
    ends, early = [], []
    for d in ten.values():
        run = simulate(graph, p, X0, sigma0=SIGMA0, disturbance=d)
        assert run.deadline_resolved
        ends.append(run.final_state)
        early.append(simulate(graph, p, X0, sigma0=SIGMA0, disturbance=d, times=["0.2"]).states[:, 0])
    spread, deviation = np.ptp(ends, axis=0).max(), np.abs(np.array(ends) - expected).max()
    print(f"\nten disturbances: spread of the end states {spread:.1e}, from the exact outcome {deviation:.1e}")
    assert max(spread, deviation) < 1e-8
    assert np.ptp(early, axis=0).max() > 0.1  # on the way they are apart


# ---------------------------------------------------------------------- edge cases


def test_a_sliding_variable_that_starts_at_zero_stays_there():
    sigma0 = [0, 1, 0, -2, 0, 0.5]
    for d in ("worst-case", "sin(7*k*t)", lambda t, x, sigma: np.cos(x)):
        run = simulate(six(), protocol(), X0, sigma0=sigma0, disturbance=d)
        np.testing.assert_array_equal(run.sliding.reaching_z[[0, 2, 4]], 0)
        np.testing.assert_array_equal(run.sliding.reaching_times[[0, 2, 4]], 0)
        np.testing.assert_array_equal(run.sliding.sigma[[0, 2, 4]], 0)
        assert (run.sliding.reaching_z[[1, 3, 5]] > 0).all()


def test_without_any_sliding_variable_the_run_is_the_nominal_one():
    graph, p = six(), protocol()
    times = [F(i, 10) for i in range(31)]
    nominal = simulate(graph, p.nominal, X0, times=times)
    for sigma0, d in ((None, None), ([0] * 6, "sin(7*k*t)"), ([0] * 6, lambda t, x, sigma: np.cos(x))):
        run = simulate(graph, p, X0, sigma0=sigma0, disturbance=d, times=times)
        assert np.abs(run.states - nominal.states).max() < 1e-9
        np.testing.assert_array_equal(run.sliding.sigma, 0)
        np.testing.assert_array_equal(run.remaining, nominal.remaining)
        np.testing.assert_allclose(run.clock, nominal.clock, rtol=1e-14)


def test_two_agents_may_reach_at_the_same_time():
    sigma0 = [1, -1, 0.5, 1, 0, -0.5]
    run = simulate(six(), protocol(), X0, sigma0=sigma0)
    assert (
        run.sliding.reaching_z[0]
        == run.sliding.reaching_z[1]
        == run.sliding.reaching_z[3]
        > run.sliding.reaching_z[2]
        == run.sliding.reaching_z[5]
    )
    assert np.abs(run.final_state - final_state_of(six(), X0, sigma0)).max() < 1e-9
    together = simulate(six(), protocol(), X0, sigma0=sigma0, disturbance=lambda t, x, sigma: np.sign(sigma))
    np.testing.assert_allclose(together.sliding.reaching_z, run.sliding.reaching_z, rtol=1e-8)


@pytest.mark.parametrize("power", [F(1), F(6, 5)])
def test_an_agent_that_reaches_closer_to_the_deadline_than_a_float_tells_ends_right(power):
    sigma0 = [1, -0.5, 1e5, -2, 0.75, 1.5]
    run = simulate(six(), protocol(power), X0, sigma0=sigma0)
    assert 40 < run.sliding.reaching_z[2] < math.inf
    assert run.sliding.reaching_times[2] == 1
    np.testing.assert_array_equal(run.sliding.sigma[:, run.t >= 1], 0)
    assert (run.sliding.sigma[2, (run.sliding.reaching_remaining > 0) & (run.t < 1)] > 0).all()
    assert np.abs(run.final_state - final_state_of(six(), X0, sigma0)).max() < 1e-8 * 1e5


def test_without_disturbances_and_with_a_gain_just_above_delta_the_final_state_is_the_same():
    expected = final_state_of(six(), X0, SIGMA0)
    for p in (protocol(delta=0), protocol(mu1=1 + F(1, 10**12))):
        run = simulate(six(), p, X0, sigma0=SIGMA0)
        assert np.abs(run.final_state - expected).max() < 1e-9
        certain = certified_reaching_times(p, list(map(F, SIGMA0)))
        np.testing.assert_allclose(run.sliding.reaching_z, [float(r.z) for r in certain], rtol=1e-11)
    assert run.sliding.reaching_z.min() > 40


def test_a_single_leader_ends_where_it_started_less_its_sliding_variable():
    star = SignedDigraph.from_edges([("lead", "a", 2), ("lead", "b", -1), ("a", "b", 1), ("b", "a", -3)])
    x0, sigma0 = [3, 1, -1], [0.5, 0.25, 1]
    run = simulate(star, protocol(), x0, sigma0=sigma0, disturbance="sin(5*k*t)")
    lead = star.labels.index("lead")
    assert run.final_state[lead] == pytest.approx(x0[lead] - sigma0[lead], abs=1e-9)
    assert np.abs(run.final_state - final_state_of(star, x0, sigma0)).max() < 1e-9
    # While its sliding variable lasts nobody but the disturbance and its own input moves it.
    np.testing.assert_allclose(run.states[lead] - run.sliding.sigma[lead], x0[lead] - sigma0[lead], atol=1e-12)


def test_several_single_leaders_end_apart_and_their_follower_between():
    graph = SignedDigraph.from_edges([("one", "f", 1), ("two", "f", 3), ("three", "f", -4)])
    x0, sigma0 = [4, -2, 1, 1], [1, -1, 0, 2]
    order = [graph.labels.index(label) for label in ("one", "two", "three", "f")]
    start, sliding = np.zeros(4), np.zeros(4)
    start[order], sliding[order] = x0, sigma0
    for d in ("worst-case", "cos(9*k*t)", lambda t, x, sigma: np.sin(3 * x)):
        run = simulate(graph, protocol(), start, sigma0=sliding, disturbance=d)
        np.testing.assert_allclose(run.final_state[order], [3, -1, 1, (3 - 3 - 4) / 8], atol=1e-9)


@pytest.mark.parametrize("d", ["worst-case", "sin(5*t)", lambda t, x, sigma: np.cos(x)])
def test_isolated_agents_lose_their_sliding_variables_only(d):
    apart = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1), ("c", "d", 2)], ["lone"])
    order = [apart.labels.index(label) for label in ("lone", "a", "b", "c", "d")]
    start, sliding = np.zeros(5), np.zeros(5)
    start[order], sliding[order] = [7, 3, 1, 2, 0], [0.5, 1, 0, 1, 1]
    run = simulate(apart, protocol(), start, sigma0=sliding, disturbance=d)
    np.testing.assert_allclose(run.final_state[order], [6.5, 0.5, -0.5, 1, 1], atol=1e-9)
    alone = simulate(SignedDigraph.from_edges([], ["lone"]), protocol(), [7], sigma0=[0.5], disturbance=d)
    assert alone.final_state == pytest.approx([6.5], abs=1e-11)
    np.testing.assert_allclose(alone.states[0], 6.5 + alone.sliding.sigma[0], atol=1e-11)
    if not callable(d):
        assert alone.sliding.reaching_z[0] == pytest.approx(run.sliding.reaching_z[order[0]], rel=1e-14)


def test_below_one_the_worst_case_is_beaten_at_the_deadline_only_and_the_end_is_still_right():
    p, sigma0 = protocol(F(1, 2)), [100.0, -0.5, 0.25, -200.0, 0.75, 1.5]
    run = simulate(six(), p, X0, sigma0=sigma0)
    np.testing.assert_array_equal(np.isinf(run.sliding.reaching_z), [True, False, False, True, False, False])
    np.testing.assert_array_equal(run.sliding.reaching_times[[0, 3]], 1)
    np.testing.assert_array_equal(run.sliding.reaching_left[[0, 3]], 0)
    at = int(np.flatnonzero(run.t == 1)[0])
    np.testing.assert_array_equal(run.sliding.sigma[:, at:], 0)
    assert (np.abs(run.sliding.sigma[[0, 3], :at]) > 0).all()
    assert np.abs(run.final_state - final_state_of(six(), X0, sigma0)).max() < 1e-9 * 200
    # As sqrt(T_r - t) at last: so continuous, although never 0 before.
    last = np.abs(run.sliding.sigma[[0, 3], at - 1]) / np.sqrt(run.sliding.reaching_remaining[at - 1])
    earlier = np.abs(run.sliding.sigma[[0, 3], at - 30]) / np.sqrt(run.sliding.reaching_remaining[at - 30])
    np.testing.assert_allclose(last, earlier, rtol=1e-2)


# ---------------------------------------------------------------------- what is read off


@pytest.mark.parametrize(
    "d", ["worst-case", "sin(40*k*t)", telegraph_noise(1, 30, 6, 3.0, seed=5), lambda t, x, sigma: np.sin(x)]
)
def test_sliding_variables_keep_their_sign_until_they_are_exactly_zero_for_good(d):
    run = simulate(six(), protocol(), X0, sigma0=SIGMA0, disturbance=d)
    for array in (run.states, run.sliding.sigma, run.sliding.disturbance, run.input, run.switching_input, run.error):
        assert np.isfinite(array).all()
    z = -np.log(np.maximum(run.sliding.reaching_remaining, 1e-300))
    for k in range(6):
        before = z < run.sliding.reaching_z[k] * (1 - 1e-12)
        after = z > run.sliding.reaching_z[k] * (1 + 1e-12)
        assert (np.sign(run.sliding.sigma[k, before]) == np.sign(SIGMA0[k])).all()
        assert (run.sliding.sigma[k, after] == 0).all()
        assert before.sum() > 10
        assert after.sum() > 10
    assert (np.abs(run.sliding.disturbance) <= 1).all()


@pytest.mark.few(0)
@pytest.mark.parametrize("d", ["worst-case", "sin(9*k*t)", lambda t, x, sigma: np.sin(x)])
def test_the_inputs_are_those_of_the_protocols_expression_and_the_equivalent_control(d):
    graph, p = six(), protocol()
    run = simulate(graph, p, X0, sigma0=SIGMA0, disturbance=d, remaining=1e-4)
    x, varsigma, t = ca.SX.sym("x", 6), ca.SX.sym("s", 6), ca.SX.sym("t")
    input_ = ca.Function("u", [x, varsigma, t], [p.input(graph, x, varsigma, t)])
    nominal = ca.Function("n", [x, t], [p.nominal.input(graph, x, t)])
    switching, equivalent = run.switching_input, run.input
    checked = 0
    for i in range(run.t.size):
        state, sigma, instant = run.states[:, i], run.sliding.sigma[:, i], run.t[i]
        # sigma - x + x returns to sigma up to a rounding of x, whose sign would decide where sigma is smaller still.
        if (np.abs(sigma[sigma != 0]) < 1e-12).any():
            continue
        by_hand = np.array(input_(state, sigma - state, instant)).ravel()
        np.testing.assert_allclose(switching[:, i], by_hand, rtol=1e-9, atol=1e-9)
        freely = np.array(nominal(state, instant)).ravel() - run.sliding.disturbance[:, i]
        sliding = sigma == 0
        np.testing.assert_allclose(equivalent[sliding, i], freely[sliding], rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(equivalent[~sliding, i], switching[~sliding, i])
        checked += 1
    assert checked > 150


@pytest.mark.parametrize("d", ["worst-case", "sin(9*k*t)", lambda t, x, sigma: np.sin(x + t)])
def test_the_derivative_of_the_states_is_input_plus_disturbance(d):
    graph, p, h = six(), protocol(), F(1, 10**4)
    centres = [F(i, 50) + F(1, 97) for i in range(48)] + [1 + F(i, 10) for i in range(1, 14)]
    times = sorted(t + j * h for t in centres for j in (-2, -1, 0, 1, 2))
    run = simulate(graph, p, X0, sigma0=SIGMA0, disturbance=d, times=times)
    x = run.states.reshape(6, -1, 5)
    slope = (x[:, :, 0] - 8 * x[:, :, 1] + 8 * x[:, :, 3] - x[:, :, 4]) / (12 * float(h))
    middle = run.t.reshape(-1, 5)[:, 2]
    motion = (run.input + run.sliding.disturbance).reshape(6, -1, 5)[:, :, 2]
    smooth = np.abs(run.sliding.reaching_times[:, None] - middle).min(axis=0) > 3 * float(h)
    assert smooth.sum() > 55
    np.testing.assert_allclose(slope[:, smooth], motion[:, smooth], rtol=1e-6, atol=1e-6)
    loop = p.closed_loop(graph)
    ode = ca.Function("ode", [loop["x"], loop["p"], loop["t"]], [loop["ode"]])
    before = np.flatnonzero(smooth & (middle < run.sliding.reaching_times.min()))
    assert before.size >= 2
    for i in before:
        at = 5 * i + 2
        state = np.concatenate([run.states[:, at], run.sliding.sigma[:, at] - run.states[:, at]])
        whole = np.array(ode(state, run.sliding.disturbance[:, at], run.t[at])).ravel()
        np.testing.assert_allclose(slope[:, i], whole[:6], rtol=1e-6, atol=1e-6)
        sigma = run.sliding.sigma.reshape(6, -1, 5)[:, i]
        fall = (sigma[:, 0] - 8 * sigma[:, 1] + 8 * sigma[:, 3] - sigma[:, 4]) / (12 * float(h))
        np.testing.assert_allclose(fall, whole[:6] + whole[6:], rtol=1e-6, atol=1e-6)


def test_the_table_has_a_column_for_every_sliding_variable():
    run = simulate(six(), protocol(), X0, sigma0=SIGMA0, samples=5)
    header, *rows = csv.reader(io.StringIO(run.to_csv()))
    labels = list(six().labels)
    assert header == ["t", "remaining", *labels, *(f"{name}({label})" for name in ("sigma", "u") for label in labels)]
    columns = [run.t, run.remaining, *run.states, *run.sliding.sigma, *run.input]
    np.testing.assert_array_equal(np.array(rows, dtype=float).T, columns)


def test_a_run_says_what_it_is():
    run = simulate(six(), protocol(), X0, sigma0=SIGMA0, disturbance="sin(k*t)", times=[0, 1, F(5, 2)])
    assert repr(run).startswith("Trajectory(6 agents, 3 instants, t = 0 .. 2.5, settled at T = 2.5")
    assert (run.sliding.source, run.sliding.bounded_by, run.sliding.boundary_layer) == (
        "sin(k*t)",
        "interval arithmetic",
        None,
    )
    assert run.stats["steps"] > 0
    with pytest.raises(ValueError, match="read-only"):
        run.sliding.sigma[0, 0] = 1
    early = simulate(six(), protocol(), X0, sigma0=SIGMA0, times=[0, 1])
    assert "deadline not reached" in repr(early)
    with pytest.raises(ParameterError, match="T is not among"):
        _ = early.final_state


# ---------------------------------------------------------------------- instants, units, tolerances


def test_instants_given_as_rationals_are_met_exactly_around_both_deadlines():
    p = protocol(T_r=F(1, 3), T_s=F(2, 3))
    near, same = F(1, 3) - F(1, 10**12), F(1, 3) - F(1, 10**30)
    times = [0, "1/10", near, same, F(1, 3) + F(1, 10**12), "1/2", 1 - F(1, 10**13), 1, "3/2"]
    run = simulate(six(), p, X0, sigma0=SIGMA0, times=times)
    np.testing.assert_array_equal(run.t, [float(F(t)) for t in times])
    np.testing.assert_array_equal(run.states[:, 0], X0)
    np.testing.assert_array_equal(run.sliding.sigma[:, 0], SIGMA0)
    assert run.sliding.reaching_remaining[2] == pytest.approx(3e-12, rel=1e-12)
    np.testing.assert_array_equal(run.sliding.reaching_remaining[3:], 0)
    np.testing.assert_array_equal(run.sliding.sigma[:, 3:], 0)
    assert run.remaining[6] == pytest.approx(1e-13, rel=1e-12)
    assert run.deadline_index == 7
    np.testing.assert_array_equal(run.clock[7:], math.inf)
    np.testing.assert_allclose(run.states[:, 2], run.states[:, 4], atol=1e-9)
    np.testing.assert_allclose(run.states[:, 8], run.final_state, atol=1e-9)
    assert np.abs(run.final_state - final_state_of(six(), X0, SIGMA0)).max() < 1e-9


def test_runs_may_start_after_either_deadline():
    p, expected = protocol(), final_state_of(six(), X0, SIGMA0)
    whole = simulate(six(), p, X0, sigma0=SIGMA0, times=[0, 2, F(5, 2)])
    np.testing.assert_allclose(
        simulate(six(), p, X0, sigma0=SIGMA0, times=[2]).states[:, 0], whole.states[:, 1], atol=1e-9
    )
    np.testing.assert_allclose(simulate(six(), p, X0, sigma0=SIGMA0, times=[4]).states[:, 0], expected, atol=1e-9)


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "d", ["worst-case", "sin(9*k*t)", telegraph_noise(1, 10, 6, 3.0), lambda t, x, sigma: np.sin(x)]
)
def test_the_solution_does_not_depend_on_where_it_is_sampled(d):
    p = protocol()
    dense = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d)
    assert (np.diff(dense.t) > 0).all()
    assert {0.0, 1.0, 2.5} <= set(dense.t.tolist())
    picked = np.unique(np.append(np.arange(0, dense.t.size, 37), dense.deadline_index))
    sparse = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d, times=dense.t[picked].tolist())
    # Near T_r, T the float t stands for slightly other instants; a sliding variable moves by at most 10 an ulp there.
    assert np.abs(sparse.states - dense.states[:, picked]).max() < 1e-8
    assert np.abs(sparse.sliding.sigma - dense.sliding.sigma[:, picked]).max() < 1e-8
    np.testing.assert_allclose(sparse.sliding.reaching_z, dense.sliding.reaching_z, rtol=1e-8)
    other = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d, samples=7, past=0)
    assert np.abs(other.final_state - dense.final_state).max() < 1e-8
    assert other.at(0.5) == pytest.approx(dense.at(0.5), abs=1e-8)


@pytest.mark.few(0)
@pytest.mark.parametrize("unit", [1e8, 1e-8, -1.0, 1e100, 1e-100])
def test_the_units_of_the_states_scale_the_solution(unit):
    size = abs(F(unit))
    p, scaled = protocol(), protocol(mu1=2 * size, delta=size)
    for d, other in (("worst-case", "worst-case"), (0.5, 0.5 * unit)):
        run = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d, samples=21)
        again = simulate(
            six(), scaled, np.multiply(X0, unit), sigma0=np.multiply(SIGMA0, unit), disturbance=other, samples=21
        )
        np.testing.assert_allclose(again.sliding.reaching_z, run.sliding.reaching_z, rtol=1e-12)
        np.testing.assert_allclose(again.states / unit, run.states, atol=1e-9)
        np.testing.assert_allclose(again.sliding.sigma / unit, run.sliding.sigma, atol=1e-11)


@pytest.mark.parametrize("remaining", [1e-8, 1e-15, 1e-30, 1e-200])
def test_however_fine_the_default_instants_both_deadlines_are_among_them(remaining):
    run = simulate(six(), protocol(1), X0, sigma0=[1, -0.5, 1e5, -2, 0.75, 1.5], remaining=remaining)
    assert (run.sliding.reaching_remaining[run.t == 1] == 0).any()
    np.testing.assert_array_equal(run.sliding.sigma[:, run.sliding.reaching_remaining == 0], 0)
    assert (run.remaining[run.t == 2.5] == 0).any()
    assert run.deadline_index is not None
    assert run.final_state == pytest.approx(final_state_of(six(), X0, run.sliding.sigma0), abs=1e-8 * 1e5)


def test_the_unit_of_time_scales_the_solution():
    p = protocol()
    fast = protocol(T_r=F(1, 1000), T_s=F(3, 2000), rho1=500, mu1=2000, delta=1000, mu2=1000)
    run = simulate(six(), p, X0, sigma0=SIGMA0, disturbance="sin(9*k*t)", samples=21)
    again = simulate(six(), fast, X0, sigma0=SIGMA0, disturbance="1000*sin(9000*k*t)", samples=21)
    np.testing.assert_allclose(again.sliding.reaching_z, run.sliding.reaching_z, rtol=1e-12)
    np.testing.assert_allclose(again.states, run.states, atol=1e-9)


# ---------------------------------------------------------------------- the imitation


@pytest.mark.parametrize("d", ["worst-case", "sin(9*k*t)", 0.5])
def test_the_boundary_layer_approaches_the_true_solution_as_it_gets_thinner(d):
    p, times = protocol(), [F(i, 20) for i in range(1, 21)]
    true = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d, times=times)
    errors = []
    for width in (0.1, 0.01, 0.001):
        layer = simulate(six(), p, X0, sigma0=SIGMA0, disturbance=d, times=times, boundary_layer=width)
        assert layer.sliding.boundary_layer == width
        assert np.isnan(layer.sliding.reaching_z).all()
        errors.append(np.abs(layer.states - true.states).max())
        assert (layer.sliding.sigma[:, layer.t < 1] != 0).all()
        sigma = layer.sliding.sigma
        switching = layer.switching_input + 2 * (np.sign(sigma) - np.tanh(sigma / width))
        np.testing.assert_allclose(layer.input, switching, atol=1e-9)
    print(f"\nboundary layer, {d}: {errors}")
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 0.01


def test_the_boundary_layer_is_for_disturbances_that_do_not_read_the_states():
    for d in (lambda t, x, sigma: np.sin(x), StateDependent(lambda t, x, sigma: 0.0)):
        with pytest.raises(ParameterError, match="boundary"):
            simulate(six(), protocol(), X0, sigma0=SIGMA0, disturbance=d, boundary_layer=0.1)


@pytest.mark.parametrize("width", [0, 0.0, -1, float("nan"), float("inf"), 1e-13, 1e13])
def test_a_boundary_layer_without_a_width_is_refused(width):
    with pytest.raises(ParameterError, match="boundary_layer"):
        simulate(six(), protocol(), X0, sigma0=SIGMA0, boundary_layer=width)


# ---------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"disturbance": "1.5*sin(k*t)"}, r"agent .* at t = .*1\.[0-9]+.*beyond delta = 1\.0"),
        ({"disturbance": 1.25}, r"agent 1 at t = 0 is 1\.25, beyond delta = 1\.0"),
        ({"disturbance": [0, 0, 0, -1.5, 0, 0]}, r"agent 4 at t = 0 is -1\.5, beyond"),
        ({"disturbance": "0.9 + 0.2*t*(1-sign(abs(k-3)))"}, r"agent 3 at t = .*beyond"),
        ({"disturbance": SampledDisturbance([0, 1, 2], [0, 0, 1.1])}, r"at t = 2 is 1\.1"),
        ({"disturbance": "1/(t-0.5)"}, "agent 1 at t = 0"),
        ({"disturbance": lambda t, x, sigma: 1.5 * np.sign(sigma)}, r"agent 1 at t = 0 is 1\.5, beyond"),
        ({"disturbance": lambda t, x, sigma: np.where(t > 0.3, 9.0, 0.0)}, r"agent 1 at t = 0\.[0-9]+ is 9\.0"),
        ({"disturbance": lambda t, x, sigma: np.zeros(5)}, r"shape is \(5,\)"),
        ({"disturbance": lambda t, x, sigma: np.zeros((6, 1))}, r"shape is \(6, 1\)"),
        ({"disturbance": lambda t, x, sigma: "a"}, "no array of numbers"),
        ({"disturbance": lambda t, x, sigma: math.nan}, "agent 1 at t = 0 is nan, not finite"),
        ({"disturbance": [0.1, 0.2]}, "2 disturbances for 6 agents"),
        ({"disturbance": Bounded("sin(t)", 1)}, "has its bound, delta; give the signal alone"),
        ({"disturbance": "sin(q)"}, "unknown name"),
        ({"sigma0": [1, 2]}, "sigma0 has 2 values"),
        ({"sigma0": 1}, "sigma0 is 1; give one number"),
        ({"sigma0": [0, 0, math.nan, 0, 0, 0]}, "sigma0 of agent 3 is nan"),
        ({"sigma0": [0, 0, 0, 0, 0, math.inf]}, "sigma0 of agent 6 is inf"),
        ({"sigma0": ["a"] * 6}, "sigma0"),
        ({"sigma0": [[1, 2]] * 6}, "sigma0"),
        ({"x0": [[1, 2]] * 6}, "one initial state at a time"),
        ({"x0": [1] * 5}, "x0 has 5 values"),
        ({"rtol": 0}, "rtol"),
        ({"samples": 1}, "samples"),
        ({"remaining": 0}, "remaining"),
        ({"times": []}, "empty"),
        ({"times": [1, 0]}, "not increasing"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_line(options, words):
    given = {"x0": X0, "sigma0": SIGMA0} | options
    with pytest.raises(ParameterError, match=words) as caught:
        simulate(six(), protocol(), **given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value"), [("sigma0", [0] * 6), ("disturbance", "none"), ("disturbance", 0), ("boundary_layer", 0.1)]
)
def test_the_nominal_protocol_has_no_sliding_variables(name, value):
    with pytest.raises(ParameterError, match=f"{name} belongs to the sliding-mode protocol") as caught:
        simulate(six(), protocol().nominal, X0, **{name: value})
    assert "\n" not in str(caught.value)


def test_the_boundary_layer_serves_an_agent_that_listens_to_nobody():
    lone = SignedDigraph.from_edges([], ["a"])
    run = simulate(lone, protocol(), [5], sigma0=[1], boundary_layer=1e-3, disturbance="sin(9*t)")
    assert run.deadline_residual == 0
    assert run.final_state[0] == pytest.approx(4, abs=2e-3)
