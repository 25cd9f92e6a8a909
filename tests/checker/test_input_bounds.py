"""The bounds of the input against quadrature, maximisation on grids, and sums that are formed term by term."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from generators import random_graph
from scipy.integrate import quad, trapezoid
from scipy.linalg import expm, solve_continuous_lyapunov
from selection import thinned

from lmi.exact.elementary_enclosures import exp
from ptcc_certify.checker import input_formulas as input_bounds
from ptcc_certify.checker.input_formulas import (
    Form,
    InitialSet,
    InputBounds,
    Limits,
    PrescribedGain,
    Reaching,
    decay_above,
    energy_above,
    integral_above,
    length_above,
    peak_above,
    root_above,
    sampled_above,
)
from ptcc_certify.graphs.structure import analyse

F = Fraction
SEEDS = range(25)
#: What floating point may be off by, relative.
SLACK = 1e-11


def log_uniform(rng: np.random.Generator, low: float, high: float) -> Fraction:
    return F(float(np.exp(rng.uniform(math.log(low), math.log(high))))).limit_denominator(10**6)


def random_gain(rng: np.random.Generator) -> PrescribedGain:
    return PrescribedGain(log_uniform(rng, 0.05, 20), log_uniform(rng, 0.01, 5), log_uniform(rng, 0.05, 8))


class Decay:
    """``min(error_bound, amplitude e^(-rate s / 2))`` in floating point, all functions of ``z = ln(T/(T - t))``."""

    def __init__(self, gain: PrescribedGain, error_bound: Fraction, amplitude: Fraction, rate: Fraction):
        self.T, self.rho1, self.k = float(gain.T), float(gain.rho1), float(gain.k)
        self.error_bound, self.amplitude, self.rate = float(error_bound), float(amplitude), float(rate)

    def gain(self, z: float) -> float:
        return self.rho1 + self.k / self.T * math.exp(z)

    def clock(self, z: float) -> float:
        return -self.rho1 * self.T * math.expm1(-z) + self.k * z

    def size(self, z: float) -> float:
        return min(self.error_bound, self.amplitude * math.exp(-self.rate / 2 * self.clock(z)))

    @property
    def crossing(self) -> float:
        if self.amplitude <= self.error_bound:
            return 0.0
        low, high = 0.0, 2 * math.log(self.amplitude / self.error_bound) / self.rate / self.k
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (
                (middle, high)
                if self.amplitude * math.exp(-self.rate / 2 * self.clock(middle)) > self.error_bound
                else (
                    low,
                    middle,
                )
            )
        return high

    def peak(self) -> float:
        instants = np.append(np.geomspace(1e-6, 60, 3000), [0.0, self.crossing])
        return max(self.gain(z) * self.size(z) for z in instants.tolist())

    def integral(self, of: Callable[[float], float], cuts: Sequence[float] = ()) -> float:
        """The integral over ``s``, of a function of ``z`` that decays, smooth but for some cuts."""
        ends = np.unique([0.0, *np.geomspace(1e-4, 400, 60), self.crossing, *cuts]).tolist()
        moved = lambda z: of(z) * (self.rho1 * self.T * math.exp(-z) + self.k)  # noqa: E731
        return sum(quad(moved, a, b, epsabs=1e-200, epsrel=1e-10)[0] for a, b in pairwise(ends))

    def energy(self) -> float:
        return self.integral(lambda z: self.gain(z) * self.size(z) ** 2)

    def length(self) -> float:
        return self.integral(self.size)


def case(seed: int, least: Fraction) -> tuple[PrescribedGain, Fraction, Fraction, Fraction, list[Fraction]]:
    """Gain, held, start, a rate with ``rate k >= least``, and instants: 0, random ones, the crossing."""
    rng = np.random.default_rng(seed)
    gain, held = random_gain(rng), log_uniform(rng, 0.01, 100)
    start = held * log_uniform(rng, 0.3, 1000)
    rate = least / gain.k * (1 + log_uniform(rng, 0.02, 5) * (seed % 4 > 0)) if least else log_uniform(rng, 0.05, 10)
    crossing = F(math.ceil(Decay(gain, held, start, rate).crossing * 2**30), 2**30)
    return gain, held, start, rate, [F(0), *(log_uniform(rng, 0.01, 12) for _ in range(4)), crossing]


# ---------------------------------------------------------------------- roots, exponentials, the gain


@pytest.mark.parametrize("seed", SEEDS)
def test_roots_and_decays_are_bounded_from_above(seed: int):
    x = log_uniform(np.random.default_rng(seed), 1e-3, 1e3)
    assert x <= root_above(x) ** 2 <= x * (1 + F(1, 10**12))
    assert math.exp(-float(x)) * (1 - 1e-13) <= decay_above(x) <= math.exp(-float(x)) * (1 + 1e-12) + 1e-300
    assert decay_above(F(10) ** 9) == decay_above(F(10) ** 6) > 0
    assert root_above(F(0)) == 0
    assert 1 <= decay_above(F(0)) <= 1 + F(1, 2**60)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gain_its_clock_and_the_integral_of_its_square_are_enclosed(seed: int):
    rng = np.random.default_rng(seed)
    gain, z = random_gain(rng), log_uniform(rng, 1e-3, 30)
    true, (low, high) = Decay(gain, F(1), F(1), F(1)), exp(-z, 64)
    assert gain.value(high) < gain.value(low) and gain.clock(z, high) < gain.clock(z, low)
    square = true.integral(lambda x: true.gain(x) * (x <= float(z)), (float(z),))
    for q in (low, high):
        assert float(gain.value(q)) == pytest.approx(true.gain(float(z)), rel=SLACK)
        assert float(gain.clock(z, q)) == pytest.approx(true.clock(float(z)), rel=SLACK)
        assert float(gain.square(z, q)) == pytest.approx(square, rel=1e-8)
    assert gain.value(F(1)) == gain.rho1 + gain.k / gain.T
    assert gain.clock(F(0), F(1)) == gain.square(F(0), F(1)) == 0


# ---------------------------------------------------------------------- peak, energy, length


@pytest.mark.parametrize("seed", SEEDS)
def test_no_peak_is_above_its_bound_and_at_the_crossing_it_is_the_bound(seed: int):
    gain, held, start, rate, instants = case(seed, F(2))
    peak = Decay(gain, held, start, rate).peak()
    bounds = [float(peak_above(gain, held, start, rate, z)) for z in instants]
    assert min(bounds) >= peak * (1 - SLACK)
    assert bounds[-1] <= peak * (1 + 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_energy_is_above_its_bound(seed: int):
    """At the crossing the bound is at most ``rate k / (rate k - 1)`` times the energy: ``p <= gain`` by parts."""
    gain, held, start, rate, instants = case(seed, F(5, 4))
    energy = Decay(gain, held, start, rate).energy()
    bounds = [float(energy_above(gain, held, start, rate, z)) for z in instants]
    assert min(bounds) >= energy * (1 - 1e-9)
    q = float(rate * gain.k)
    assert bounds[-1] <= energy * q / (q - 1) * (1 + 1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_length_is_above_its_bound_and_at_the_crossing_it_is_the_bound(seed: int):
    gain, held, start, rate, instants = case(seed, F(0))
    length = Decay(gain, held, start, rate).length()
    bounds = [float(length_above(gain, held, start, rate, z)) for z in instants]
    if 400 * rate * gain.k > 60:  # else the quadrature ends too early
        assert bounds[-1] <= length * (1 + 1e-8)
    assert min(bounds) >= length * (1 - 1e-9)


def test_bounds_at_the_edges():
    gain = PrescribedGain(F(1), F(1, 10**12), F(1))
    one, two = F(1), F(2)
    assert peak_above(gain, one, two, two, F(0)) == pytest.approx(2 + 2e-12, rel=1e-14)  # rate k = 2 exactly
    with pytest.raises(ValueError, match="not bounded"):
        peak_above(gain, one, one, two - F(1, 10**9), F(0))
    for rate in (one, F(1, 2)):
        with pytest.raises(ValueError, match="not bounded"):
            energy_above(gain, one, one, rate, F(0))
    assert float(energy_above(gain, one, one, F(3, 2), F(0))) == pytest.approx(2, rel=1e-9)  # int (1 - t)^(-1/2)
    assert float(energy_above(gain, one, one, one + F(1, 10**6), F(0))) == pytest.approx(10**6, rel=1e-6)
    for of in (peak_above, energy_above, length_above):
        assert of(gain, F(0), F(0), two, one) == of(gain, one, F(0), two, F(0)) == 0
        assert of(gain, F(0), one, two, F(0)) > 0  # what is held says nothing before the instant 0
    assert peak_above(gain, one, F(0), two, one) == pytest.approx(math.e, rel=1e-11)  # held up to z = 1
    assert float(peak_above(gain, one, one, two, F(200))) == pytest.approx(math.exp(200), rel=1e-9)


# ---------------------------------------------------------------------- limits of the gain


def acting(limits: Limits, gain: PrescribedGain, t: float) -> float:
    """The gain that acts, without sampling."""
    T = float(gain.T)
    if limits.stop_before is not None and t >= T - float(limits.stop_before):
        return 0.0
    value = float(gain.rho1) + (float(gain.k) / (T - t) if t < T else math.inf)
    return min(value, math.inf if limits.gain_cap is None else float(limits.gain_cap))


def random_limits(seed: int, gain: PrescribedGain) -> Limits:
    """A cap, a stop, or both; caps below ``rho1`` and ``gain(0)`` among them, stops near 0 and near ``T``."""
    rng = np.random.default_rng(seed + 1000)
    caps = [gain.rho1 / 2, gain.rho1, gain.rho1 + gain.k / gain.T, gain.rho1 + gain.k / gain.T * F(1, 2)]
    cap = caps[seed // 3 % 4] if seed % 5 == 0 else gain.rho1 + gain.k / gain.T * (1 + log_uniform(rng, 1e-3, 1e6))
    stop = gain.T * (1 - F(1, 10**6)) if seed % 7 == 0 else gain.T * log_uniform(rng, 1e-5, 0.9)
    return [Limits(cap), Limits(None, stop), Limits(cap, stop)][seed % 3]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_clock_of_a_cap_and_a_stop_is_the_integral_from_below(seed: int):
    gain = random_gain(np.random.default_rng(seed))
    limits = random_limits(seed, gain)
    T, end = float(gain.T), float(gain.T - (limits.stop_before or 0))
    cuts = {0.0, end, *(T - T * q for q in np.geomspace(1e-7, 1, 40) if T - T * q < end)}
    if limits.gain_cap is not None and limits.gain_cap > gain.rho1:
        turn = float(gain.T - gain.k / (limits.gain_cap - gain.rho1))
        cuts |= {turn} if 0 < turn < end else set()
    pieces = pairwise(sorted(cuts))
    area = sum(quad(lambda t: acting(limits, gain, t), a, b, epsabs=0, epsrel=1e-12)[0] for a, b in pieces)
    clock = float(limits.clock_below(gain))
    assert area * (1 - 1e-9) <= clock <= area * (1 + SLACK)
    top = limits.largest_gain(gain)
    seen = max(acting(limits, gain, t) for t in [*np.linspace(0, end, 1000, endpoint=False), end * (1 - 1e-15)])
    assert seen <= float(top) * (1 + 1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_clock_of_a_sampled_gain_is_not_above_the_sum(seed: int):
    rng = np.random.default_rng(seed)
    gain = random_gain(rng)
    plain = Limits() if seed % 4 == 3 else random_limits(seed, gain)
    period = gain.T / (int(rng.integers(1, 60)) if seed % 2 else log_uniform(rng, 1, 60))
    limits = Limits(plain.gain_cap, plain.stop_before, period)
    end = gain.T - (limits.stop_before or 0)
    clock, largest, j = F(0), F(0), 0
    while period * j < end:
        value = gain.rho1 + gain.k / (gain.T - period * j)
        if limits.gain_cap is not None:
            value = min(value, limits.gain_cap)
        clock += value * min(period, end - period * j)
        largest, j = max(largest, value), j + 1
    below, top = limits.clock_below(gain), limits.largest_gain(gain)
    assert largest <= top and (limits.gain_cap == top or largest == top)
    assert 0 <= below <= clock
    lost = period * max(top - gain.rho1 - gain.k / gain.T, F(0))
    assert clock - below <= lost * 2 + clock / 10**9  # the sum may lie above the integral by as much as below it


def test_limits_at_the_edges():
    gain = PrescribedGain(F(2), F(3), F(4))  # gain(0) = 5
    for cap, clock in ((F(5), F(10)), (F(3), F(6)), (F(1), F(2))):
        assert Limits(cap).clock_below(gain) == pytest.approx(clock, rel=1e-15)
        assert Limits(cap).clock_below(gain) <= clock
        assert Limits(cap, None, F(1, 3)).clock_below(gain) == Limits(cap).clock_below(gain)  # no gain is lost
    near = Limits(None, F(1, 10**100))
    assert float(near.clock_below(gain)) == pytest.approx(6 + 4 * (math.log(2) + 100 * math.log(10)), rel=1e-12)
    assert near.largest_gain(gain) == 3 + 4 * 10**100
    early = Limits(None, F(2) - F(1, 10**9))
    assert float(early.clock_below(gain)) == pytest.approx(5e-9, rel=1e-6)
    assert Limits(sample_period=F(2)).largest_gain(gain) == 5  # one period: gain(0) all along
    assert Limits(sample_period=F(2)).clock_below(gain) <= 10
    assert Limits(sample_period=F(1)).largest_gain(gain) == 7
    assert Limits(None, F(1), F(1)).largest_gain(gain) == 5  # a period that begins at the stop is none
    for bound in (Limits().largest_gain, Limits().clock_below):
        with pytest.raises(ValueError, match="nothing limits"):
            bound(gain)


@pytest.mark.parametrize("last", [1, 3, 2000])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_held_gain_leaves_no_more_than_what_its_periods_leave_together(
    seed: int, last: int, monkeypatch: pytest.MonkeyPatch
):
    """For ``V = ||R E||^2``: the product of ``||R (I - eta A) R^-1||^2``, periods far from the end taken together."""
    monkeypatch.setattr(input_bounds, "LAST_PERIODS", last)
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    A = rng.normal(size=(n, n)) + 3 * np.eye(n)
    R = np.diag(rng.uniform(0.5, 2, n))
    moved = R @ A @ np.linalg.inv(R)
    rate, growth = float(np.linalg.eigvalsh(moved + moved.T)[0]), float(np.linalg.norm(moved, 2) ** 2)
    gain = random_gain(rng)
    plain = Limits() if seed % 4 == 3 else random_limits(seed, gain)
    limits = Limits(plain.gain_cap, plain.stop_before, gain.T / log_uniform(rng, 1, 60))
    h, end = float(limits.sample_period or 0), float(gain.T - (limits.stop_before or 0))
    steps, j = 1.0, 0
    while j * h < end * (1 - 1e-12):
        eta = acting(Limits(limits.gain_cap), gain, j * h) * min(h, end - j * h)
        step = float(np.linalg.norm(np.eye(n) - eta * moved, 2) ** 2)
        assert step <= (1 - eta * rate + eta**2 * growth) * (1 + 1e-9)
        steps, j = steps * (1 - eta * rate + eta**2 * growth), j + 1
    bound = sampled_above(gain, limits, F(rate), F(growth))
    assert F(steps) * F(1 - 1e-9) <= bound
    if last > j:
        assert bound <= F(steps) * F(1 + 1e-9)


def test_ever_shorter_periods_leave_ever_less():
    """Two enemies, rate 4 and growth 4: at rate ``k`` nothing is proved for long periods, and all for short ones."""
    gain = PrescribedGain(F(1), F(1), F(2))
    left = [sampled_above(gain, Limits(sample_period=F(1, 10**p)), F(4), F(4)) for p in range(0, 9, 2)]
    assert left[0] > 1 and all(b < a / 100 for a, b in pairwise(left[1:]))
    with pytest.raises(ValueError, match="nothing is sampled"):
        sampled_above(gain, Limits(F(5)), F(4), F(4))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_square_of_a_limited_gain_is_integrated_from_above(seed: int):
    gain = random_gain(np.random.default_rng(seed))
    limits = random_limits(seed, gain)
    end = float(gain.T - (limits.stop_before or 0))
    cuts = {0.0, end, *(float(gain.T) * (1 - q) for q in np.geomspace(1e-7, 1, 60) if float(gain.T) * (1 - q) < end)}
    if limits.gain_cap is not None and limits.gain_cap > gain.rho1:
        turn = float(gain.T - gain.k / (limits.gain_cap - gain.rho1))
        cuts |= {turn} if 0 < turn < end else set()
    pieces = pairwise(sorted(cuts))
    area = sum(quad(lambda t: acting(limits, gain, t) ** 2, a, b, epsabs=0, epsrel=1e-12)[0] for a, b in pieces)
    assert area * (1 - SLACK) <= float(limits.integrals(gain)[1]) <= area * (1 + 1e-9)


# ---------------------------------------------------------------------- the energy by two Lyapunov equations


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gain_is_split_between_two_exponentials_of_the_clock(seed: int):
    """``gain <= rho1 + (k/T) (p + e^(s/k - p))`` at all times, at most twice the gain for the largest ``p``."""
    rng = np.random.default_rng(seed)
    gain = random_gain(rng)
    true, most = Decay(gain, F(1), F(1), F(1)), float(gain.rho1 * gain.T / gain.k)
    z = np.append(0.0, np.geomspace(1e-9, 300, 500))
    values = true.rho1 + true.k / true.T * np.exp(z)
    clock = -true.rho1 * true.T * np.expm1(-z) + true.k * z
    for p in (0.0, rng.uniform() * most, most):
        split = true.rho1 + true.k / true.T * (p + np.exp(clock / true.k - p))
        assert (split >= values * (1 - 1e-12)).all()
        if p == most:
            assert (split <= 2 * values * (1 + 1e-12)).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_energy_is_at_most_doubled_by_the_split(seed: int):
    """Of one mode, ``E = e^(-r s / 2)``: ``int ||E||^2 ds = 1/r`` and ``int e^(s/k) ||E||^2 ds = 1/(r - 1/k)``."""
    gain, _, _, rate, _ = case(seed, F(5, 4))
    energy = Decay(gain, F(1), F(1), rate).energy()
    even, grown, most = 1 / rate, 1 / (rate - 1 / gain.k), gain.rho1 * gain.T / gain.k
    best = min(F(math.log(grown / even)), most)
    bounds = [float(integral_above(gain, even, grown, p)) for p in (F(0), most / 2, most, best)]
    assert min(bounds) >= energy * (1 - 1e-9)
    assert max(bounds[2:]) <= 2 * energy * (1 + 1e-9) and bounds[3] <= min(bounds) * (1 + 1e-9)
    for p in (F(-1, 10**9), most + F(1, 10**9)):
        with pytest.raises(ValueError, match="not between"):
            integral_above(gain, even, grown, p)


# ---------------------------------------------------------------------- sets of starts, forms


def rationals(rng: np.random.Generator, *shape: int) -> Any:
    """Hundredths within -5..5."""
    return (np.array([F(int(x), 100) for x in rng.integers(-500, 501, math.prod(shape))]).reshape(shape)).tolist()


def floats(values: Any) -> np.ndarray:
    return np.array(values, dtype=float)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_linear_function_is_largest_where_it_is_largest(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    center, row = rationals(rng, n), {j: x for j, x in enumerate(rationals(rng, n)) if x}
    r = [float(row.get(j, 0)) for j in range(n)]
    assert InitialSet(center).point and InitialSet(center).largest(row) == abs(
        sum(x * center[j] for j, x in row.items())
    )
    radius = [abs(x) for x in rationals(rng, n)]
    box = InitialSet(center, radius)
    corners = product(*([c - s, c + s] for c, s in zip(center, radius, strict=True)))
    assert not box.point
    assert box.largest(row) == max(abs(sum(x * y[j] for j, x in row.items())) for y in corners)
    axes = rationals(rng, int(rng.integers(1, 4)), n)
    bound = float(InitialSet(center, axes=axes).largest(row))
    middle, along = np.dot(r, np.array(center, float)), np.array(axes, float) @ np.array(r)
    assert bound == pytest.approx(abs(middle) + math.sqrt(along @ along), rel=1e-12)
    v = rng.normal(size=(300, len(axes)))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    assert np.abs(middle + v @ along).max() <= bound * (1 + 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_form_is_nowhere_larger_than_its_bound(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    root = np.array(rng.integers(-5, 6, (n, n)))
    P = (root @ root.T + np.eye(n, dtype=int)).tolist()
    full = Form(F(1), "E", range(n), None, [[F(x) for x in row] for row in P], F(1))
    diagonal = Form(F(1), "E", range(n), [abs(x) + 1 for x in rationals(rng, n)], None, F(1))
    sizes = [abs(x) for x in rationals(rng, n)]
    for form in (full, diagonal):
        matrix = np.array(P if form is full else np.diag([float(w) for w in form.diagonal or ()]), float)
        z = rationals(rng, n)
        assert float(form.value(z)) == pytest.approx(np.array(z, float) @ matrix @ np.array(z, float), rel=1e-12)
        corners = product(*([-s, s] for s in sizes))
        assert max(form.value(corner) for corner in corners) <= form.value(sizes, sizes=True)
    assert diagonal.value(sizes, sizes=True) == diagonal.value(sizes)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_start_of_a_set_has_a_larger_form_than_its_bound(seed: int):
    """``V`` is convex: over a box it is largest in a corner. In both coordinates, diagonal and full."""
    rng = np.random.default_rng(seed)
    made = random_graph(rng, "strong", "balanced" if seed % 3 == 0 else "unbalanced", n=int(rng.integers(3, 6)))
    n, rows = made.graph.n_nodes, made.graph.exact_rows(range(made.graph.n_nodes))
    weights = [abs(x) + 1 for x in rationals(rng, n)]
    root = np.array(rng.integers(-5, 6, (n, n)))
    matrix = [[F(x) for x in row] for row in (root @ root.T + np.eye(n, dtype=int)).tolist()]
    forms = [Form(F(1), "E", range(n), weights, None, F(1)), Form(F(1), "E", range(n), None, matrix, F(1))]
    L, A = made.graph.laplacian().toarray(), [made.graph.laplacian().toarray()] * 2
    if made.whole_balanced:
        gauge, p = analyse(made.graph).gauge, floats(weights)
        assert gauge is not None
        forms.append(Form(F(1), "eps", range(n), weights, None, F(1), gauge.tolist()))
        A.append(np.eye(n) - np.outer(gauge, p * gauge) / p.sum())
        assert np.abs(L @ (np.eye(n) - A[-1])).max() < 1e-12 * np.abs(L).max()  # what is left out does not move
    center, axes = rationals(rng, n), rationals(rng, 2, n)
    radius = [abs(x) for x in rationals(rng, n)]
    v = rng.normal(size=(300, 2))
    around = floats(center) + v / np.linalg.norm(v, axis=1, keepdims=True) @ floats(axes)
    corners = floats(center) + floats(radius) * floats(list(product([-1, 1], repeat=n)))
    for initial_set, points in (
        (InitialSet(center), floats([center])),
        (InitialSet(center, [F(0)] * n), floats([center])),
        (InitialSet(center, radius), corners),
        (InitialSet([F(0)] * n, radius), corners - floats(center)),
        (InitialSet(center, axes=axes), around),
    ):
        bounds = InputBounds(rows, PrescribedGain(F(1), F(1), F(3)), forms, [None] * 3, initial_set)
        for k, form in enumerate(forms):
            P = np.diag(floats(weights)) if form.diagonal is not None else floats(matrix)
            z = points @ A[k].T
            top = math.sqrt(np.einsum("ij,jk,ik->i", z, P, z).max())
            assert top <= float(bounds.initial_root(k)) * (1 + 1e-12)
            if initial_set.point:
                assert top == pytest.approx(float(bounds.initial_root(k)), rel=1e-9)


# ---------------------------------------------------------------------- all together, on a pair and on a chain


def test_the_pair_whose_input_is_known():
    """Two enemies that listen to each other: ``E`` decays as ``e^(-2s)``, its rate 4; everything is known."""
    rows = [{0: F(1), 1: F(1)}, {0: F(1), 1: F(1)}]
    gain = PrescribedGain(F(1), F(1, 10**12), F(1))
    form = Form(F(4), "E", [0, 1], [F(1), F(1)], None, F(1))
    deviation = Form(F(4), "eps", [0, 1], [F(1), F(1)], None, F(1), [1, -1])
    bounds = InputBounds(rows, gain, [form, deviation, None], [None] * 3, InitialSet([F(3), F(1)]))
    assert bounds.error_bounds == [4, 4] and float(bounds.error_norm) == pytest.approx(math.sqrt(32))
    assert float(bounds.initial_root(0)) == pytest.approx(math.sqrt(32))
    assert float(bounds.initial_root(1)) == pytest.approx(math.sqrt(8))  # deviations 2, -2 ... of x from the common one
    assert bounds.constant(0) == [1, 1] and bounds.constant(1) == [2, 2]
    assert float(bounds.root_constant(1, None)) == pytest.approx(2)
    for k in (0, 1):
        assert float(bounds.bound(peak_above, None, k, F(0))) == pytest.approx(math.sqrt(32), rel=1e-9)
        # int (gain |e|)^2 = 32 int (1 - t)^2, int gain |e| = sqrt(32) int (1 - t)
        assert float(bounds.bound(energy_above, None, k, F(0))) == pytest.approx(32 / 3, rel=1e-9)
        assert float(bounds.bound(length_above, None, k, F(0))) == pytest.approx(math.sqrt(32) / 2, rel=1e-9)
    with pytest.raises(ValueError, match="single agents"):
        bounds.bound(peak_above, 0, 2, F(0))
    within = InputBounds(rows, gain, [form], [None], InitialSet([F(0), F(0)], [F(3), F(3)]))
    assert within.error_bounds == [6, 6]
    assert [float(x) for x in bounds.disturbed(0, F(1))] == pytest.approx([math.sqrt(8)] * 2, rel=1e-9)
    with pytest.raises(ValueError, match="without limit"):
        bounds.disturbed(1, F(1))


def test_sliding_variables_move_until_the_instant_is_quiet():
    rows = [{}, {0: F(-2), 1: F(2)}]
    gain = PrescribedGain(F(2), F(1), F(1))
    form = Form(F(4), "E", [1], [F(1)], None, F(1))
    initial_set = InitialSet([F(5), F(1)])
    still = InputBounds(rows, gain, [form], [None], initial_set)
    moving = Reaching([F(0), F(3)], F(1), F(1), F(1, 2), F(1), F(2))
    moved = InputBounds(rows, gain, [form], [None], initial_set, moving)
    assert still.quiet == 0 and float(moved.quiet) == pytest.approx(math.log(2))
    assert still.error_bounds == [0, 8]
    # |e| grows by 2 |sigma(0)| = 6 and 2 (mu1 + delta) T_r = 4 at most, |x| by 3 and 2
    assert moved.error_bounds == [0, 18]
    assert moved.initial_root(0) == still.initial_root(0) == pytest.approx(8)
    with pytest.raises(ValueError, match="still move"):
        moved.bound(peak_above, None, 0, F(0))
    early = Reaching([F(0), F(3)], F(1), F(1), F(1, 2), F(1), F(2), F(1))
    assert float(early.quiet) == pytest.approx(math.log(2 / (1 + math.exp(-1))))
    assert early.pushes({0: F(7), 1: F(-2)}) == (6, 4)
    assert Reaching([F(-1), F(3)], F(1), F(1), F(1), F(1), F(2)).pushes({0: F(7), 1: F(-2)}) == (13, 18)
    assert Reaching([F(-1), F(3)], F(1), F(1), F(1), F(1), F(2)).pushes({0: F(7), 1: F(2)}) == (7, 14)
    low, high = early.decay((F(3, 4), F(3, 4)))  # half of T_r
    assert low < high and float(low) == pytest.approx(math.exp(-0.25) / 2) == float(high)
    assert early.decay((F(1, 2), F(1, 2))) == (0, 0) and early.decay((F(1), F(1)))[1] == pytest.approx(1)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", thinned(range(8), 3))
def test_no_sliding_variable_moves_the_error_further(seed: int):
    """``dE = -L E ds - L d sigma``, ``sigma' = -(mu2 + power/(T_r - t)) sigma - s f`` with ``f`` that switches."""
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, "strong", "unbalanced", n=int(rng.integers(2, 6))).graph
    L, n = graph.laplacian().toarray(), graph.n_nodes
    P = solve_continuous_lyapunov(L.T, np.eye(n))
    rate = F(float(1 / np.linalg.eigvalsh(P)[-1])).limit_denominator(10**6) * F(999, 1000)
    matrix = [[F(float(x)) for x in row] for row in P]
    form = Form(rate, "E", range(n), None, matrix, F(float(np.linalg.eigvalsh(P)[0])) * F(99, 100))
    gain, T_s = PrescribedGain(F(2), F(1, 4), 2 / rate), F(2) - F(1, int(rng.integers(2, 9)))
    sigma0, x0 = rationals(rng, n), rationals(rng, n) if seed % 2 else [F(0)] * n
    mu2, power, push = log_uniform(rng, 0.1, 5), F(int(rng.integers(1, 5)), 2), log_uniform(rng, 0.1, 5)
    reaching = Reaching(sigma0, 2 - T_s, T_s, mu2, power, push)
    constants = [F(float(x)) * F(1001, 1000) for x in np.diag(np.linalg.inv(P))]
    bounds = InputBounds(graph.exact_rows(range(n)), gain, [form], [constants], InitialSet(x0), reaching)
    z = bounds.quiet
    peak, energy, length = (float(bounds.bound(of, None, 0, z)) for of in (peak_above, energy_above, length_above))
    agents, held = [float(bounds.bound(peak_above, v, 0, z)) for v in range(n)], floats(bounds.error_bounds)
    true, T_r = Decay(gain, F(1), F(1), rate), float(2 - T_s)
    instants = np.linspace(0, float(z), 2001)
    for _ in range(3):
        E, size, u = -L @ floats(x0), np.abs(floats(sigma0)), []
        sign, f = np.sign(floats(sigma0)), np.zeros(n)
        for i, (a, b) in enumerate(pairwise(instants.tolist())):
            u.append(true.gain(a) * E)
            assert (np.abs(E) <= held * (1 + 1e-3) + 1e-9).all()
            if i % 200 == 0:
                f = float(push) * rng.integers(0, 2, n)
            now, then = (T_r - 2 * (1 - math.exp(-x)) for x in (a, b))
            kept = math.exp(-float(mu2) * (now - then)) * (max(then, 0) / now) ** float(power)
            left = np.maximum(size * kept - f * (now - then), 0)
            moved, step = expm(-L * (true.clock(b) - true.clock(a))), L @ (sign * (size - left))
            E, size = moved @ (E + step / 2) + step / 2, left
        later = np.linspace(float(z), 12, 801)
        for a, b in pairwise(later.tolist()):
            u.append(true.gain(a) * E)
            E = expm(-L * (true.clock(b) - true.clock(a))) @ E
        norm = np.linalg.norm(u, axis=1)
        t = 2 * (1 - np.exp(-np.append(instants[:-1], later[:-1])))
        assert norm.max() <= peak * 1.001
        assert (np.abs(u).max(axis=0) <= np.array(agents) * 1.001).all()
        assert trapezoid(norm**2, t) <= energy * 1.01 and trapezoid(norm, t) <= length * 1.01


@pytest.mark.parametrize("seed", range(8))
def test_no_disturbance_adds_more_to_the_input(seed: int):
    """``dE/ds = -L E - L d / gain`` from 0, with disturbances that switch: constant gains over short steps of ``z``."""
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, "strong", "unbalanced", n=int(rng.integers(2, 6))).graph
    L, n = graph.laplacian().toarray(), graph.n_nodes
    P = solve_continuous_lyapunov(L.T, np.eye(n))
    lowest, highest = np.linalg.eigvalsh(P)[[0, -1]]
    rate = F(float(1 / highest)).limit_denominator(10**6) * F(999, 1000)
    form = Form(rate, "E", range(n), None, [[F(float(x)) for x in row] for row in P], F(float(lowest)))
    constants = [F(float(x)) * F(1001, 1000) for x in np.diag(np.linalg.inv(P))]
    gain = PrescribedGain(F(1), F(1, 10), 2 / rate * F(int(rng.integers(11, 40)), 10))
    bounds = InputBounds(graph.exact_rows(range(n)), gain, [form], [constants], InitialSet([F(0)] * n))
    most = floats(bounds.disturbed(0, F(1, 2)))
    true = Decay(gain, F(1), F(1), rate)
    for d in (0.5 * np.sign(L[0]), 0.5 * np.ones(n), 0.5 * rng.choice([-1, 1], n)):
        x = np.zeros(n)
        z = np.linspace(0, 6, 601)
        for a, b in pairwise(z.tolist()):
            moved, dt = expm(-L * (true.clock(b) - true.clock(a))), true.T * (math.exp(-a) - math.exp(-b))
            x = moved @ x + dt * (moved + np.eye(n)) @ d / 2
            assert (true.gain(b) * np.abs(L @ x) <= most * (1 + 1e-2)).all()
