"""Facts about the sliding variables: when each is 0, what is proved about it, and how large it is until then."""

import math
from fractions import Fraction
from itertools import pairwise

import flint
import numpy as np
import pytest
from balls import ball, inverse_decay_integral
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from selection import thinned

from ptcc_certify.errors import SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import SlidingModeProtocol
from ptcc_certify.model.disturbance import SampledDisturbance, WorstCaseDisturbance, as_disturbance, telegraph_noise
from ptcc_certify.model.reaching_time import (
    ReachingProblem,
    ReachingTime,
    certified_reaching_times,
    sliding_bound,
)
from ptcc_certify.simulation.run import simulate

F = Fraction
TINY = F(1, 10**30)
# below, at and above 1, whole and next to whole
POWERS = [
    F(1, 100),
    F(1, 3),
    F(999, 1000),
    F(1),
    1 + F(1, 10**12),
    F(9, 5),
    F(2),
    2 - F(1, 10**15),
    F(3),
    F(17),
    F(100),
]
BITS = 256


def protocol(power=1, mu2=1, T_r=1, mu1=2, delta=1, kappa=2):
    """A protocol with ``mu3 kappa = power``."""
    rest = {"T_s": 1, "rho1": 1, "rho2": 1, "mu1": mu1, "mu2": mu2, "delta": delta}
    return SlidingModeProtocol(T_r=T_r, kappa=kappa, mu3=F(power) / F(kappa), **rest)


@pytest.fixture(autouse=True)
def precision():
    """Balls of 256 bits in the tests; the package is to leave the precision as it finds it."""
    flint.ctx.prec, before = BITS, flint.ctx.prec
    yield
    assert flint.ctx.prec == BITS
    flint.ctx.prec = before


def weight(p, z):
    """dr/psi(r) per dz as a ball: T_r e^(mu2 r + mu3 kappa z - z), r = T_r (1 - e^-z)."""
    T, m = ball(p.T_r), ball(p.mu3 * p.kappa)
    return T * (ball(p.mu2) * T * (1 - (-z).exp()) + (m - 1) * z).exp()


def integral(p, z, push=None):
    """int (push) dr/psi from 0 to the instant z, by flint's adaptive quadrature: a ball that holds the value."""
    z = z if isinstance(z, flint.arb) else ball(z)
    return flint.acb.integral(lambda x, _: weight(p, x) * (1 if push is None else push(x)), 0, z).real


def radius(x):
    return float(x.rad() / abs(x.mid()))


def limit(p):
    """(mu1 - delta) int dr/psi over the whole reaching phase as a ball, for mu3 kappa < 1.

    With u = T_r - r it is (T_r^m e^(mu2 T_r)) times a lower incomplete gamma function of order 1 - m.
    """
    T, mu2, m = ball(p.T_r), ball(p.mu2), ball(p.mu3 * p.kappa)
    lower = (1 - m).gamma() - (mu2 * T).gamma_upper(1 - m)
    return ball(p.mu1 - p.delta) * T * (mu2 * T) ** (m - 1) * (mu2 * T).exp() * lower


def middle(x):
    """The midpoint of a ball as a rational."""
    mantissa, exponent = x.mid().man_exp()
    return F(int(mantissa)) * F(2) ** int(exponent)


# ---------------------------------------------------------------------- the integral


@pytest.mark.parametrize("power", thinned(POWERS))
@pytest.mark.parametrize("mu2", [F(1, 10**12), F(1, 10**6), F(1, 3), F(50), F(1000)])
def test_the_incomplete_gamma_form_is_the_integral_of_its_integrand(power, mu2):
    p = protocol(power, mu2, T_r=F(7, 5))
    for z in (F(1, 10**9), F(1, 1000), F(1), F(100, 7), F(100)):
        closed, direct = inverse_decay_integral(p, z), integral(p, z)
        assert closed.overlaps(direct)
        assert max(radius(closed), radius(direct)) < 1e-20  # narrow balls: that they overlap says something


positive = st.fractions(F(1, 1000), 20, max_denominator=10**6)


@settings(max_examples=30)
@given(positive, st.fractions(F(1, 10**6), 200, max_denominator=10**6), positive, st.floats(-9, 2))
def test_the_integral_is_that_of_two_other_quadratures(power, mu2, T_r, exponent):
    p, z = protocol(power, mu2, T_r), F(10**exponent)
    closed, direct = inverse_decay_integral(p, z), integral(p, z)
    assert closed.overlaps(direct)
    assert max(radius(closed), radius(direct)) < 1e-18
    T, m, size = float(T_r), float(power), float(direct.mid().log())
    if size < 600:  # within the range of floats

        def integrand(x):
            return T * math.exp(float(mu2) * T * -math.expm1(-x) + (m - 1) * x - size)

        # A peak narrower than the first nodes is missed unless the interval is cut towards both ends.
        cuts = float(z) * np.concatenate([[0], np.geomspace(1e-6, 0.5, 20), 1 - np.geomspace(0.4, 1e-6, 20), [1]])
        pieces = (quad(integrand, a, b, epsrel=1e-12, limit=200)[0] for a, b in pairwise(cuts))
        # 1e-10: the exponent mu2 T_r reaches 4,000, and its rounding is all that separates the two.
        assert sum(pieces) == pytest.approx(1, rel=1e-10)


# ---------------------------------------------------------------------- what is certain


def proved(p, size, z):
    """True or False where balls decide whether size <= (mu1 - delta) int dr/psi up to z; None where they do not."""
    surplus = ball(p.mu1 - p.delta) * integral(p, z) - ball(size)
    return True if surplus >= 0 else False if surplus < 0 else None


protocols = st.builds(
    protocol,
    st.one_of(st.sampled_from(POWERS), st.fractions(1, 12, max_denominator=100)),
    st.fractions(F(1, 10**6), 60, max_denominator=10**6),
    st.fractions(F(1, 100), 30, max_denominator=100),
    st.fractions(F(11, 10), 8, max_denominator=10),
    st.sampled_from([F(0), F(1, 2), F(1), F(11, 10) - F(1, 10**12)]),
)


@pytest.mark.few(0)
@settings(max_examples=30)
@given(protocols, st.floats(-9, 6), st.booleans())
def test_a_certified_instant_is_proved_by_another_quadrature_and_next_to_the_least(p, exponent, negative):
    size = F(10**exponent)
    (found,) = certified_reaching_times(p, [-size if negative else size])
    if found.z is None:
        assert p.mu3 * p.kappa < 1
        assert limit(p) < ball(size) * (1 + ball(F(1, 10**9)))
        return
    if found.z < 10**4:  # beyond, flint's quadrature needs more subdivisions than it is given
        assert proved(p, size, found.z) is True
        # Near the limit of mu3 kappa < 1 the integral hardly grows, and a float cannot place its root so well.
        if p.mu3 * p.kappa >= 1 or ball(size) < limit(p) * ball(F(9, 10)):
            assert proved(p, size, found.z * (1 - F(1, 10**9))) is False


@pytest.mark.few(0)
@settings(max_examples=30)
@given(protocols, st.lists(st.floats(-6, 8), min_size=2, max_size=8))
def test_the_certified_instants_are_in_the_order_of_the_sizes(p, exponents):
    sizes = sorted(F(10**x) for x in exponents)
    signed = [-size if i % 2 else size for i, size in enumerate(sizes)]
    zs = [math.inf if r.z is None else r.z for r in certified_reaching_times(p, signed)]
    for first, second in pairwise(zs):
        # Each lies above the least by its own slack, a part in 10^12; next to the limit of mu3 kappa < 1 up to 10^-3.
        assert first <= second * (1 + 1e-11 if p.mu3 * p.kappa >= 1 else 1.001)
    assert min(zs) > 0


def test_a_sliding_variable_that_starts_at_zero_is_there_from_the_beginning():
    for power in POWERS:
        zero, one, again = certified_reaching_times(protocol(power), [F(0), F(1, 10), F(0)])
        assert zero == again == ReachingTime(F(1), F(0))
        assert zero.time == 0
        assert zero.remaining == pytest.approx(1, abs=2e-15)
        assert one.z > 0


@pytest.mark.few(0)
@pytest.mark.parametrize("power", thinned([F(1, 100), F(1, 3), F(1, 2), F(9, 10), F(999, 1000)], 2))
@pytest.mark.parametrize("mu2", [F(1, 1000), F(1), F(30)])
def test_below_one_the_finite_limit_of_the_integral_divides_proved_from_only_the_deadline(power, mu2):
    p = protocol(power, mu2, T_r=F(3, 2), mu1=F(7, 3))
    size = middle(limit(p))
    above, far = certified_reaching_times(p, [size * (1 + F(1, 10**12)), -size * 10**9])
    assert above.z is None
    assert far.z is None
    assert (far.time, far.remaining) == (1.5, 0)
    assert repr(far) == "ReachingTime(T_r = 1.5)"
    below, half = certified_reaching_times(p, [size * (1 - F(1, 10**9)), size / 2])
    assert below.z > half.z > 0
    assert ball(p.mu1 - p.delta) * inverse_decay_integral(p, below.z) >= ball(size * (1 - F(1, 10**9)))


@pytest.mark.few(0)
@pytest.mark.parametrize("power", [F(1), 1 + F(1, 10**9), F(3, 2), F(9, 5), F(2), F(5), F(100)])
@pytest.mark.parametrize("size", [10**6, 10**12, 10**30])
@pytest.mark.parametrize("gap", [F(1), F(1, 10**12)])
def test_from_one_on_every_size_is_proved_to_vanish_before_the_deadline(power, size, gap):
    p = protocol(power, mu1=1 + gap)
    (found,) = certified_reaching_times(p, [F(size)])
    assert found.z is not None
    # The incomplete gamma function, since flint's quadrature does not reach z = 10^41.
    flint.ctx.prec = 1024
    assert ball(gap) * inverse_decay_integral(p, found.z) >= ball(F(size))
    assert ball(gap) * inverse_decay_integral(p, found.z * (1 - F(1, 10**9))) < ball(F(size))
    flint.ctx.prec = BITS


@settings(max_examples=30)
@given(st.fractions(F(1, 10**6), 10**6), st.floats(1e-12, 2000).map(F))
def test_time_is_rounded_up_and_what_is_left_is_rounded_down(T_r, z):
    found = ReachingTime(T_r, z)
    left = ball(T_r) * (-ball(z)).exp()
    assert left >= flint.arb(found.remaining)
    assert 0 <= found.time <= float(T_r)
    # Up to the rounding of T_r itself, an ulp.
    assert flint.arb(found.time) * (1 + ball(F(1, 2**52))) >= ball(T_r) - left
    if z < 600:
        assert found.remaining == pytest.approx(float(left), rel=1e-12)
    assert found.time == pytest.approx(float(ball(T_r) - left), rel=1e-14)


def test_without_disturbances_the_certified_instant_is_that_of_the_undisturbed_run():
    p = protocol(F(3, 2), delta=0)
    sigma0 = [F(1), F(-3), F(1, 100)]
    found = certified_reaching_times(p, sigma0)
    run = ReachingProblem(p, np.array([float(x) for x in sigma0]), as_disturbance("none", 3, 0, 1.0))
    np.testing.assert_allclose([float(r.z) for r in found], run.z, rtol=1e-11)


@pytest.mark.parametrize("power", [F(1, 2), F(1), F(9, 5), F(4)])
def test_a_gain_just_above_delta_is_weighed_exactly(power):
    gap = F(1, 10**12)
    p = protocol(power, mu1=1 + gap)
    # As protocol(power) with everything a million million times larger.
    small, large = (
        certified_reaching_times(p, [gap / 2, gap * 3]),
        certified_reaching_times(protocol(power), [F(1, 2), F(3)]),
    )
    for one, other in zip(small, large, strict=True):
        assert (one.z is None) == (other.z is None)
        if one.z is not None:
            assert float(one.z) == pytest.approx(float(other.z), rel=1e-11)


# ---------------------------------------------------------------------- one run


def clock(p, x):
    """t at the instant x, a ball."""
    return ball(p.T_r) * (1 - (-x).exp())


def exact_float(value):
    return ball(F(float(value)))


def residual(p, sigma0, z, push):
    """How far |sigma0| is from the integral of push/psi up to z, relative to it and to what z itself stands for."""
    z = ball(F(z))
    slope = weight(p, z) * push(z) * z
    return abs(float((integral(p, z, push) - abs(exact_float(sigma0))) / (abs(exact_float(sigma0)) + abs(slope)).mid()))


@settings(max_examples=30)
@given(
    st.sampled_from(POWERS[:-1]),
    st.floats(0.01, 20),
    st.floats(0.1, 10),
    st.floats(-6, 3),
    st.floats(0.1, 60),
    st.floats(0, 6),
    st.integers(0, 99),
)
def test_roots_under_smooth_disturbances_satisfy_their_equation(power, mu2, T_r, exponent, frequency, phase, seed):
    p = protocol(power, mu2, T_r)
    rng = np.random.default_rng(seed)
    sigma0 = rng.choice([-1, 1], 3) * 10**exponent * rng.uniform(0.5, 2, 3)
    run = ReachingProblem(p, sigma0, as_disturbance(f"0.95*sin(k*{frequency!r}*t + {phase!r})", 3, 1, T_r))
    for k, (start, z) in enumerate(zip(sigma0.tolist(), run.z.tolist(), strict=True)):
        if not z < 35:  # beyond, the argument of the package's sine is rounded to T_r
            assert z > 0
            continue
        sign, a, b = int(np.sign(start)), (k + 1) * exact_float(frequency), exact_float(phase)

        def push(x, sign=sign, a=a, b=b):
            return ball(p.mu1) - sign * exact_float(0.95) * (a * clock(p, x) + b).sin()

        assert residual(p, start, z, push) < 1e-13


@pytest.mark.parametrize("power", [F(1, 2), F(1), F(9, 5), F(4)])
@pytest.mark.parametrize("seed", thinned(range(4)))
def test_roots_under_jumping_disturbances_satisfy_their_equation(power, seed):
    p, rng = protocol(power, mu2=F(3, 2), T_r=F(5, 4)), np.random.default_rng(seed)
    noise = telegraph_noise(0.9, 40, 4, 3.0, seed)
    sigma0 = rng.uniform(-1, 1, 4)
    run = ReachingProblem(p, sigma0, noise)
    jumps = 0
    for k in range(4):
        root = F(run.z[k])
        pieces = noise.times[noise.times < 1.25 * -math.expm1(-float(root))].tolist()
        at = [-(1 - exact_float(t) / ball(p.T_r)).log() for t in pieces] + [ball(root)]
        levels = [ball(p.mu1) - int(np.sign(sigma0[k])) * exact_float(d) for d in noise.samples[k]]
        steps = [integral(p, z) for z in at]
        spent = sum((d * (b - a) for d, a, b in zip(levels, steps[:-1], steps[1:], strict=False)), flint.arb(0))
        size = abs(exact_float(sigma0[k]))
        assert abs(float((spent - size) / (size + weight(p, ball(root)) * ball(root)))) < 1e-13
        jumps += len(pieces) - 1
    assert jumps > 10


@pytest.mark.few(0)
@settings(max_examples=30)
@given(protocols, st.floats(-6, 6), st.integers(0, 99))
def test_the_worst_case_attains_the_certified_instant_and_all_others_reach_earlier(p, exponent, seed):
    rng = np.random.default_rng(seed)
    sigma0 = rng.choice([-1, 1], 4) * 10**exponent * rng.uniform(0.1, 1, 4)
    certain = np.array(
        [math.inf if r.z is None else float(r.z) for r in certified_reaching_times(p, list(map(F, sigma0)))]
    )
    worst = ReachingProblem(p, sigma0, WorstCaseDisturbance(p.delta)).z
    close = np.isclose(worst, certain, rtol=1e-11, atol=0)
    # Where mu3 kappa < 1 leaves hardly anything to spare, a float cannot place the root.
    assert close.all() or p.mu3 * p.kappa < 1
    assert (worst <= certain).all()
    size, T_r = float(p.delta), float(p.T_r)
    others = [
        as_disturbance("none", 4, p.delta, T_r),
        as_disturbance((-size * np.sign(sigma0) * 0.999).tolist(), 4, p.delta, T_r),
        as_disturbance((size * np.sign(sigma0) * 0.999).tolist(), 4, p.delta, T_r),
        as_disturbance(f"{0.999 * size!r}*sin({30 / T_r!r}*k*t)", 4, p.delta, T_r),
        telegraph_noise(size, 15 / T_r, 4, T_r, seed),
        WorstCaseDisturbance(p.delta / 2),
    ]
    for other in others:
        assert (ReachingProblem(p, sigma0, other).z <= worst * (1 + 1e-13)).all()


@pytest.mark.parametrize(("mu2", "power"), [(TINY, F(1)), (TINY, F(1, 2)), (TINY, F(3)), (F(2), TINY)])
@pytest.mark.parametrize("size", [1e-9, 0.3, 2.0])
@pytest.mark.parametrize("d", [-0.75, 0.0, 0.75])
def test_constant_disturbances_give_the_roots_of_elementary_equations(mu2, power, size, d):
    p = protocol(power, mu2, T_r=F(3))
    run = ReachingProblem(p, np.array([size, -size]), as_disturbance(d, 2, 1, 3.0))
    for gap, z in zip((2 - d, 2 + d), run.z, strict=True):
        share, m = size / gap / 3, float(power)
        if power == 1:
            expected = share
        elif mu2 == TINY:
            expected = math.log1p((m - 1) * share) / (m - 1)
        else:
            expected = -math.log1p(-math.log1p(2 * size / gap) / 2 / 3)
        assert z == pytest.approx(expected, rel=1e-13)


@pytest.mark.few(0)
@settings(max_examples=30)
@given(st.sampled_from(POWERS[:-1]), st.floats(0.05, 20), st.integers(0, 99))
def test_the_sliding_variable_between_its_start_and_its_root_is_that_of_another_quadrature(power, mu2, seed):
    p, rng = protocol(power, mu2), np.random.default_rng(seed)
    sigma0, frequency = rng.uniform(-2, 2, 2), float(rng.uniform(1, 30))
    run = ReachingProblem(p, sigma0, as_disturbance(f"0.9*sin({frequency!r}*k*t)", 2, 1, 1.0))
    z = np.sort(rng.uniform(0, np.minimum(run.z.max(), 20) * 1.1, 12))
    values = run.sigma(np.append(z, np.inf))
    np.testing.assert_array_equal(values[:, -1], 0)
    for k in range(2):
        sign = int(np.sign(sigma0[k]))

        def push(x, k=k, sign=sign):
            return ball(p.mu1) - sign * exact_float(0.9) * ((k + 1) * exact_float(frequency) * clock(p, x)).sin()

        for at, value in zip(z.tolist(), values[k].tolist(), strict=False):
            if at >= run.z[k]:
                assert value == 0
                continue
            x = ball(F(at))
            psi = (-ball(p.mu2) * clock(p, x) - ball(p.mu3 * p.kappa) * x).exp()
            expected = sign * psi * (abs(exact_float(sigma0[k])) - integral(p, x, push))
            assert value == pytest.approx(float(expected), rel=1e-9, abs=1e-13 * abs(sigma0[k]))


def test_sliding_variables_of_equal_size_under_equal_pushes_reach_together():
    p = protocol(F(3, 2))
    for sigma0, d in (
        ([1.0, 1.0], "0.8*sin(9*t)"),
        ([1.0, -1.0], ["0.8*sin(9*t)", "-0.8*sin(9*t)"]),
        ([1.0, -1.0], "worst-case"),
        ([-2.0, -2.0], 0.5),
    ):
        first, second = ReachingProblem(p, np.array(sigma0), as_disturbance(d, 2, 1, 1.0)).z.tolist()
        assert first == second > 0
    apart = ReachingProblem(p, np.array([1.0, -1.0]), as_disturbance("0.8", 2, 1, 1.0)).z
    assert apart[0] > apart[1] * 1.1


PAIR = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", 2)])


@pytest.mark.parametrize(("power", "size"), [(F(9, 5), 1e30), (F(3, 2), 1e30), (F(1), 1e3)])
def test_an_agent_may_reach_closer_to_the_deadline_than_a_float_of_time_tells(power, size):
    p = protocol(power)
    run = simulate(PAIR, p, [1, 2], sigma0=[1.0, size])
    (found,) = certified_reaching_times(p, [F(size)])
    z = run.sliding.reaching_z[1]
    assert 40 < z < math.inf
    assert z == pytest.approx(float(found.z), rel=1e-11)
    assert run.sliding.reaching_times[1] == 1.0
    # What a relative error 1e-11 of z makes of it.
    assert run.sliding.reaching_left[1] == pytest.approx(float((-ball(found.z)).exp()), rel=1e-10 * z)
    assert 0 < found.remaining < 1e-17
    assert found.remaining == pytest.approx(run.sliding.reaching_left[1], rel=1e-10 * z)
    assert run.sliding.reaching_times[0] < 1


def test_what_is_left_before_the_deadline_underflows_to_zero():
    p = protocol(F(1))
    run = simulate(PAIR, p, [1, 2], sigma0=[1.0, 2.5e6])
    assert run.sliding.reaching_z[1] == pytest.approx(2.5e6 / math.e, rel=1e-3)
    assert (run.sliding.reaching_times[1], run.sliding.reaching_left[1]) == (1.0, 0.0)
    (found,) = certified_reaching_times(p, [F(2500000)])
    assert (found.time, found.remaining) == (1.0, 0.0)
    assert float(found.z) == pytest.approx(run.sliding.reaching_z[1], rel=1e-11)


def test_below_one_the_worst_case_keeps_a_large_sliding_variable_until_the_deadline():
    p = protocol(F(1, 2))
    run = ReachingProblem(p, np.array([100.0, 0.5]), WorstCaseDisturbance(1))
    assert run.z[0] == math.inf
    z = np.array([1.0, 30, 60, 200, np.inf])
    values = run.sigma(z)[0]
    assert (values[:-1] > 0).all()
    assert values[-1] == 0
    # What is left of the bracket, e^-mu2 of it, times ((T_r - t)/T_r)^(mu3 kappa).
    rest = (100 - float(limit(p))) * math.exp(-1)
    np.testing.assert_allclose(values[1:-1], rest * np.exp(-z[1:-1] / 2), rtol=1e-6)


# ---------------------------------------------------------------------- bounds of the size


@pytest.mark.few(0)
@settings(max_examples=30)
@given(protocols, st.floats(-4, 4), st.integers(0, 99))
def test_the_bound_holds_for_every_disturbance_vanishes_in_time_and_is_below_proposition_1(p, exponent, seed):
    rng = np.random.default_rng(seed)
    sigma0 = rng.choice([-1, 1], 3) * 10**exponent * rng.uniform(0.1, 1, 3)
    sigma0[seed % 3] *= seed % 2
    z = np.append(np.linspace(0, 50, 101), np.inf)
    rational = list(map(F, sigma0))
    certain = [r.z for r in certified_reaching_times(p, rational)]
    bound = sliding_bound(p, rational, z)
    with np.errstate(under="ignore"):
        decay = np.exp(-p.reaching_gain.clock_at_tau(z))
    assert (bound <= np.abs(sigma0)[:, None] * decay * (1 + 1e-12)).all()
    assert (bound[:, 0] >= np.abs(sigma0)).all()
    np.testing.assert_allclose(bound[:, 0], np.abs(sigma0), rtol=1e-12)
    for row, last in zip(bound, certain, strict=True):
        assert (row[z >= (math.inf if last is None else float(last))] == 0).all()
        assert (np.diff(row) <= 1e-14 * row[:-1]).all()
    size, T_r = float(p.delta), float(p.T_r)
    for d in (
        as_disturbance(0.99 * size, 3, p.delta, T_r),
        as_disturbance(f"{0.99 * size!r}*cos({20 / T_r!r}*k*t)", 3, p.delta, T_r),
        telegraph_noise(size, 15 / T_r, 3, T_r, seed),
    ):
        values = np.abs(ReachingProblem(p, sigma0, d).sigma(z))
        assert (values <= bound * (1 + 1e-9) + 1e-13 * decay * np.abs(sigma0).max()).all()


@pytest.mark.few(0)
@pytest.mark.parametrize("size", [F(1, 1000), F(1), F(9), F(100)])
@pytest.mark.parametrize("power", [F(1, 2), F(1), F(9, 5)])
def test_no_bound_is_below_what_the_worst_case_leaves_however_near_the_reaching_time(power, size):
    p = protocol(power, mu2=F(3, 5), T_r=F(1, 2), mu1=F(6, 5))
    (reached,) = certified_reaching_times(p, [size])
    ends = [float(reached.z)] if reached.z is not None else [20.0]
    z = np.unique([end * (1 - share) for end in ends for share in (*np.geomspace(1e-15, 1, 60), 0, -1e-15, -1e-12)])
    (bound,) = sliding_bound(p, [size], z)
    for instant, known in zip(z.tolist(), bound.tolist(), strict=True):
        at = F(instant)
        left = ball(size) - ball(p.mu1 - p.delta) * (inverse_decay_integral(p, at) if at else ball(F(0)))
        clock = ball(p.mu2 * p.T_r) * (1 - (-ball(at)).exp()) + ball(power * at)
        assert not left * (-clock).exp() > ball(F(max(known, 1e-300)))
        if left > ball(size) / 10**6 and known > 1e-300:
            assert known <= float((left * (-clock).exp()).mid()) * (1 + 3e-6)


def test_the_bound_holds_along_simulated_runs():
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -2), (3, 1, 1), (3, 4, 1)])
    for power, d in ((F(1, 2), "worst-case"), (F(3, 2), "sin(20*k*t)"), (F(2), lambda t, x, sigma: np.cos(x))):
        p = protocol(power)
        sigma0 = [F(1), F(-2), F(0), F(1, 3)]
        run = simulate(graph, p, [5, 2, -4, 3], sigma0=sigma0, disturbance=d)
        with np.errstate(divide="ignore"):
            bound = sliding_bound(p, sigma0, -np.log(run.sliding.reaching_remaining))
        assert (np.abs(run.sliding.sigma) <= bound + 1e-9).all()
        assert (bound > 0).sum() > 100
        for k, r in enumerate(certified_reaching_times(p, sigma0)):
            assert (run.sliding.sigma[k, run.t >= r.time] == 0).all()


# ---------------------------------------------------------------------- refusals


def test_a_disturbance_that_jumps_too_often_is_refused():
    rng = np.random.default_rng(0)
    times = np.unique(np.append(0.0, rng.uniform(0, 1, 300_000)))
    noise = SampledDisturbance(times, rng.uniform(-1, 1, times.size))
    with pytest.raises(SimulationError, match="too fast, or jumps too often"):
        ReachingProblem(protocol(F(1)), np.array([1.0, 2.0]), noise)


@pytest.mark.parametrize("sizes", [("1e-310", "1"), ("1e300", "-1e-300"), ("1e-320", "1e100"), ("1e-291", "1e-289")])
def test_tiny_and_huge_sliding_variables_are_proved_beside_each_other(sizes: tuple[str, str]):
    p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    sigma0 = [Fraction(x) for x in sizes]
    for size, reached in zip(sigma0, certified_reaching_times(p, sigma0), strict=True):
        assert reached.z is not None
        if abs(size) < 1e-9:  # the integral is T_r z there
            assert abs(size) <= reached.z <= abs(size) * (1 + Fraction(1, 10**8))
