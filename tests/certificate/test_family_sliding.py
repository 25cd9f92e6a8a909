"""Facts about families under the sliding-mode protocol: neither signal nor disturbance exceeds what is proved."""

import random
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import product

import numpy as np
import pytest
from asked import certify_family, family_certificate
from common_kernel_families import KINDS, random_family
from row_families import laplacian, random_led, random_vertex
from scipy.integrate import quad
from selection import thinned

from ptcc_certify.certificate.certificate import read_certificate
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.certificate.runs_against_bounds import compare, functions_of, worst_case_signals
from ptcc_certify.checker import check, digest
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.signal_bounds import Drive, drive_sizes
from ptcc_certify.errors import Change, ParameterError, spell
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.follower_function import follower_functions
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.reaching_time import certified_reaching_times
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import ConstantSignal, PeriodicSignal, RandomSignal, Signal, Stretch
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
RATIOS = ("deviation_ratio", "final_ratio", "input_ratio", "lyapunov_ratio", "sliding_ratio")
TRAP = [("a", "b", 1, 1), ("b", "a", 1, 1), ("c", "a", 1, 2), ("c", "b", 1, 2), ("a", "c", 1, 1)]


class Driver(Signal):
    """At every step the member under which a function of ``x - sigma`` grows most, sliding variables included."""

    text = "worst case of what is driven"

    def __init__(self, form, protocol, sigma0, step):
        self.form, self.protocol, self.sigma0, self.step = form, protocol, sigma0, step

    def play(self, members, gain, state):
        clock, T, T_r = 0.0, float(self.protocol.T), float(self.protocol.T_r)
        while True:
            tau = np.linspace(0, 60, 2001)
            q = np.exp(-np.interp(clock, gain.clock_at_tau(tau), tau))
            share = max((q * T - (T - T_r)) / T_r, 0.0)
            size = share ** float(self.protocol.mu3 * self.protocol.kappa)
            x, clock = state(), clock + self.step
            y = x - size * self.sigma0
            yield Stretch(members.worst(x, 2 * self.form @ y), clock)


def drawn_protocol(rng) -> SlidingModeProtocol:
    delta = Fraction(int(rng.integers(0, 5)), 4)
    mu1, mu2, mu3 = (
        delta + Fraction(int(rng.integers(1, 9)), 4),
        int(rng.integers(1, 4)),
        rng.choice(["0.1", "0.4", "1"]),
    )
    T_r, T_s = (Fraction(int(rng.integers(1, 9)), 4) for _ in range(2))
    return SlidingModeProtocol(T_r=T_r, T_s=T_s, rho1="1/2", rho2=1, kappa=3, mu1=mu1, mu2=mu2, mu3=mu3, delta=delta)


def disturbances(rng, delta: Fraction) -> Iterator:
    """Constant, square and sine, at the full bound; and the one that keeps sliding variables from 0 the longest."""
    d, w = float(delta), float(rng.uniform(1, 30))
    yield f"{d}"
    yield f"-{d} * sign(sin({w} * k * t))"
    yield f"{d} * sin({w} * k * t + k)"
    yield "worst-case"


def drawn_family(rng, n) -> Family:
    modes, share = int(rng.integers(1, 4)), Fraction(int(rng.integers(0, 4)), 10)
    kind = KINDS[int(rng.integers(len(KINDS)))]
    return random_family(
        rng, kind, n, modes, Fraction(1, 5) if modes == 1 and not share else share, float(rng.choice([0, 0.3]))
    )


def signals(rng, certificate, sigma0) -> list[Signal]:
    members = Members(certificate.family)
    found = list(worst_case_signals(certificate, members.unit / 3))
    for nodes, V in functions_of(certificate):
        form = type(found[0]).against(V, nodes, certificate.family.n_nodes).form
        found.append(Driver(form, certificate.protocol, np.array(sigma0), members.unit / 4))
    word = [
        (mode, members.unit * float(0.2 + rng.exponential()), float(rng.random()))
        for mode in range(len(members.arrays))
    ]
    found += [PeriodicSignal(word), RandomSignal(int(rng.integers(99)), members.unit / 2), ConstantSignal(0, 1.0)]
    return found


def worst_ratios(rng, families, played=4, **options):
    worst, runs = dict.fromkeys(RATIOS, 0.0), 0
    for family in families:
        n, protocol = family.n_nodes, drawn_protocol(rng)
        sigma0 = (rng.integers(-9, 10, n) * (rng.random(n) < 0.8) / float(rng.choice([2, 20]))).tolist()
        x0 = rng.integers(-9, 10, n).tolist()
        certificate = certify_family(family, protocol, x0, sigma0=sigma0, time_limit=10)
        assert certificate.verdict == "certified", certificate.checked
        choices = list(product(signals(rng, certificate, sigma0), disturbances(rng, protocol.delta)))
        for k in rng.choice(len(choices), min(played, len(choices)), replace=False):
            signal, disturbance = choices[int(k)]
            more = {"sigma0": sigma0, "disturbance": disturbance, "past": 0, **options}
            run = simulate(family, protocol, x0, signal, **more)
            seen, runs = compare(certificate, run), runs + 1
            assert not seen.violated, (family, signal, disturbance, protocol, x0, sigma0, seen)
            for name in RATIOS:
                worst[name] = max(worst[name], getattr(seen, name) or 0.0)
    return worst, runs


@pytest.mark.few(0)
def test_neither_signal_nor_disturbance_exceeds_what_is_proved():
    rng = np.random.default_rng(9)
    families = [drawn_family(rng, 3), Family.from_intervals(TRAP)]
    worst, runs = worst_ratios(rng, families, 3, samples=20, remaining=1e-4, rtol=1e-9, atol=1e-9)
    assert runs == 6
    assert all(0 < worst[name] <= 1.000001 for name in RATIOS)
    assert worst["lyapunov_ratio"] > 0.5 and worst["sliding_ratio"] > 0.5


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(80))
def test_on_eighty_families_many_signals_and_disturbances_exceed_nothing(part):
    rng = np.random.default_rng(300 + part)
    family = drawn_family(rng, 2 + part % 7)
    worst, runs = worst_ratios(rng, [family], 6, samples=40, remaining=1e-4, rtol=1e-9, atol=1e-9)
    print(runs, "runs", worst)
    assert runs >= 4


# ---------------------------------------------------------------------- the trap


def products(rows, sizes, sign=lambda x: x):
    """Rows times a vector, by entries or by their sizes."""
    return [sum(sign(x) * y for x, y in zip(row, sizes, strict=True)) for row in rows]


@cache
def trap():
    """A family in which all hear c, its certificate, |C L(w+)| |sigma|, and C L sigma of a member."""
    camp = ["b1", "b2", "b3", "b4"]
    edges = [("a", "c", 10, 10), ("c", "a", "0.1", 10)]
    edges += [row for b in camp for row in ((b, "a", 100, 100), ("a", b, 100, 100), ("c", b, "0.1", 10))]
    family = Family.from_intervals(edges, nodes=["a", *camp, "c"])
    sigma0 = [0, 0, 0, 0, 0, 1]
    slow = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1="1.001", mu2=1, mu3="1/2", delta=1)
    certificate = certify_family(family, slow, sigma0, sigma0=sigma0, time_limit=60)  # x - sigma is 0 at first
    mode, ((_, form), *_) = family.modes[0], list(functions_of(certificate))
    quotient = form.quotient
    C = [[Fraction(int(v == u)) - quotient.basis[v][0] * (u == 0) for u in range(6)] for v in quotient.nodes]
    largest = laplacian(mode, np.ones(mode.n_edges, dtype=bool))
    apart = laplacian(
        mode, np.array([int(s) == 5 and int(t) > 0 for s, t in zip(mode.source, mode.target, strict=True)])
    )
    cancelled = [
        [sum(c * x for c, x in zip(row, column, strict=True)) for column in zip(*largest, strict=True)] for row in C
    ]
    return certificate, quotient, products(cancelled, sigma0, abs), quotient.coordinates(products(apart, sigma0)), apart


def largest_value(V, sizes):
    """``V`` of all coordinates of these sizes, at most."""
    pairs = ((abs(p), x * y) for x, row in zip(sizes, V.matrix, strict=True) for y, p in zip(sizes, row, strict=True))
    return sum((p * Fraction(product) for p, product in pairs), Fraction(0))


@pytest.mark.few(0)
def test_entries_of_c_l_that_cancel_at_the_largest_weights_bound_nothing():
    certificate, quotient, cancelled, moved, _ = trap()
    assert quotient.pivots == (0,) and cancelled[:4] == [0] * 4  # a and every b hear c with 10
    assert all(abs(float(x) + 9.9) < 1e-9 for x in moved[:4])  # a hears it with 0.1, every b with 10
    assert certificate.parts[0].functions
    shares = []
    for V, stated in zip(certificate.parts[0].functions, certificate.drives, strict=True):
        value, wrong = V.value([Fraction(x) for x in moved]), largest_value(V, cancelled)
        assert wrong < value <= stated**2 * (1 + Fraction(1, 10**9))
        shares.append(value / wrong)
    assert max(shares) > 4


def test_a_drive_of_cancelled_entries_is_refused():
    certificate, _, cancelled, _, _ = trap()
    data = certificate.to_dict()
    for k, V in enumerate(certificate.parts[0].functions):
        wrong = root_above(largest_value(V, cancelled))
        data["drives"][k] = str(wrong)
        report = check(data | {"digest": digest(data)})
        assert report.rejected == f"family-drive of decays[{k}]"
        data["drives"][k] = str(certificate.drives[k] * 2)  # larger is true, too
        assert check(data | {"digest": digest(data)}).accepted


def test_a_run_exceeds_what_cancelled_entries_would_prove():
    certificate, quotient, cancelled, _, _ = trap()
    mode = certificate.family.modes[0]
    levels = [float(mode.source[e] == 5 and mode.target[e] > 0) for e in mode.parameters.tolist()]
    run = simulate(
        certificate.family,
        certificate.protocol,
        certificate.initial_state,
        ConstantSignal(0, levels),
        sigma0=certificate.sigma0,
        times=[0, *np.geomspace(1e-5, 1e-2, 12).tolist()],
    )
    assert not compare(certificate, run).violated
    before = np.isfinite(run.clock)
    y = (run.states - run.sliding.sigma)[:, before]
    xi = np.array([[float(x) for x in quotient.coordinates(list(map(Fraction, column)))] for column in y.T.tolist()])
    for number, V in enumerate(certificate.parts[0].functions):
        P = np.array([[float(x) for x in row] for row in V.matrix])
        root = np.sqrt(np.einsum("ti,ij,tj->t", xi, P, xi))
        own = certificate.norm_bound(certificate.parts[0].functions[number], 0, run.remaining[before])
        wrong = own * float(root_above(largest_value(V, cancelled)) / certificate.drives[number])
        assert (root <= own * (1 + 1e-6)).all() and (root[1:] > wrong[1:] * 1.05).any()


def test_drive_sizes_bound_what_any_member_makes_of_sliding_variables():
    draw = random.Random(5)
    for k in range(20):
        family = random_led(draw, ("stability", "bipartite consensus")[k % 2])
        sigma0 = {v: Fraction(draw.randint(-5, 5)) for v in range(family.n_nodes)}
        for mode in family.modes:
            edges = [
                (int(s), int(t), mode.upper.fraction(e))
                for e, (s, t) in enumerate(zip(mode.source, mode.target, strict=True))
            ]
            bound = drive_sizes(edges, sigma0)
            for _ in range(5):
                L = laplacian(mode, random_vertex(draw, mode))
                moved = [sum(x * sigma0[j] for j, x in enumerate(row)) for row in L.tolist()]
                assert all(abs(x) <= float(bound[v]) * (1 + 1e-12) + 1e-12 for v, x in enumerate(moved))


# ---------------------------------------------------------------------- enclosures


def test_integrals_of_what_drives_are_enclosed_closely():
    rng = np.random.default_rng(1)
    for _ in range(5):
        p = drawn_protocol(rng)
        gains = {name: Fraction(value) for name, value in p.parameters.items()}
        drive = Drive.of(gains, {0: Fraction(1)}, None, [[]])
        power, T, T_r = float(p.mu3 * p.kappa), float(p.T), float(p.T_r)

        def product_at(t, p=p, power=power, T=T, T_r=T_r):
            psi = np.exp(-float(p.mu2) * t) * max(1 - t / T_r, 0.0) ** power
            return (float(p.rho1) + float(p.rho2 * p.kappa) / (T - t)) * psi

        exact = quad(product_at, 0, T_r, limit=200)[0]
        assert exact <= float(drive.integral) <= exact * 1.2
        assert float(drive.largest) >= max(product_at(t) for t in np.linspace(0, T_r, 2000)) * (1 - 1e-12)


# ---------------------------------------------------------------------- sigma(0) = 0, and one graph


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", thinned(KINDS, 2))
def test_without_sliding_variables_all_is_as_without_disturbances(kind):
    rng = np.random.default_rng(8)
    family, x0 = random_family(rng, kind, 3, 2, Fraction(1, 10)), [3, -1, 2]
    nominal = certify_family(family, NominalProtocol(T=2, rho1=1, rho2=1, kappa=3), x0, time_limit=60)
    zero = (Fraction(0),) * 3  # with the same functions, whatever the searches had time for
    reaching = certified_reaching_times(PROTOCOL, zero)
    own = family_certificate(family, PROTOCOL, nominal.parts, nominal.initial_state, zero, reaching)
    assert own.direct and own.drives is None and own.verdict == "certified"
    assert own.final_state == nominal.final_state and own.nominal_peaks == nominal.input_peaks
    if own.input_peaks is not None:
        assert all(x - y == PROTOCOL.mu1 for x, y in zip(own.input_peaks, nominal.input_peaks, strict=True))
    q = np.geomspace(1, 1e-6, 9)
    assert (own.deviation_bound(q) == nominal.deviation_bound(q)).all()


def test_a_family_of_one_graph_runs_as_the_graph_does():
    rng = np.random.default_rng(3)
    for k in range(3):
        family = random_family(rng, "consensus", 4, 1)
        graph, protocol = family.modes[0].mandatory, drawn_protocol(rng)
        x0, sigma0 = rng.integers(-9, 10, 4).tolist(), rng.integers(-3, 4, 4).tolist()
        disturbance = f"{float(protocol.delta)} * sin(7*k*t + {k})"
        times = np.linspace(0, float(protocol.T) * 1.2, 25).tolist()
        more = {"sigma0": sigma0, "disturbance": disturbance, "times": times}
        one = simulate(graph, protocol, x0, **more)
        own = simulate(family, protocol, x0, ConstantSignal(0), **more)
        assert np.abs(one.states - own.states).max() < 1e-7
        assert np.allclose(one.sliding.sigma, own.sliding.sigma, rtol=1e-12, atol=1e-14)
        assert (one.sliding.reaching_z == own.sliding.reaching_z).all()
        assert np.abs(one.sliding.disturbance - own.sliding.disturbance).max() < 1e-12
        assert own.to_csv().startswith("t,remaining,0,1,2,3,mode,sigma(0)")


@pytest.mark.parametrize("kind", thinned(["bipartite consensus", "stability", "bipartite containment"], 3))
def test_functions_of_rows_are_driven_too(kind):
    draw, rng = random.Random(2), np.random.default_rng(2)
    family = random_led(draw, kind)
    parts = tuple(ComponentProof(c, tuple(follower_functions(c))) for c in decide(family))
    assert [part.component.behaviour for part in parts] == [kind] and parts[0].functions
    n = family.n_nodes
    x0 = tuple(Fraction(int(x)) for x in rng.integers(-5, 6, n))
    sigma0 = tuple(Fraction(int(x), 4) for x in rng.integers(-5, 6, n))
    reaching = certified_reaching_times(PROTOCOL, sigma0)
    certificate = family_certificate(family, PROTOCOL, parts, x0, sigma0, reaching)
    assert certificate.checked.accepted, certificate.checked
    more = {"sigma0": sigma0, "samples": 25, "past": 0, "remaining": 1e-3}
    for signal in (RandomSignal(1, 2.0), ConstantSignal(0, 0.0), ConstantSignal(0, 1.0)):
        assert not compare(certificate, simulate(family, PROTOCOL, x0, signal, **more)).violated


# ---------------------------------------------------------------------- files, and what is refused


@pytest.mark.few(0)
def test_a_file_is_read_back_as_it_was(tmp_path):
    family = Family.from_intervals(TRAP)
    certificate = certify_family(family, PROTOCOL, [1, 2, 3], sigma0=[1, 0, "-1/4"], time_limit=60)
    certificate.save(tmp_path / "c.json")
    back = read_certificate(tmp_path / "c.json")
    assert back.to_dict() == certificate.to_dict() and back.sigma0 == certificate.sigma0
    assert back.drives == certificate.drives and back.input_peaks == certificate.input_peaks
    q = [1, 0.7, 0.5, 0.1]
    assert np.allclose(back.deviation_bound(q), certificate.deviation_bound(q), rtol=1e-12)


def test_what_does_not_fit_is_refused():
    family = Family.from_intervals(TRAP)
    nominal = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
    with pytest.raises(ParameterError, match="sigma0 belongs to the sliding-mode protocol"):
        certify_family(family, nominal, [1, 2, 3], sigma0=[1, 0, 0])
    for more in ({"sigma0": [1, 0, 0]}, {"disturbance": "sin(t)"}):
        with pytest.raises(ParameterError, match="belongs to the sliding-mode protocol"):
            simulate(family, nominal, [1, 2, 3], **more)
    with pytest.raises(ParameterError, match="beyond delta"):
        simulate(family, PROTOCOL, [1, 2, 3], disturbance="2*sin(t)")
    with pytest.raises(ParameterError, match="reads the states"):
        simulate(family, PROTOCOL, [1, 2, 3], disturbance=lambda t, x, sigma: np.sin(x))


def test_where_the_sliding_part_may_grow_no_peak_is_claimed():
    slow = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3="0.1", delta=1)
    certificate = certify_family(Family.from_intervals(TRAP), slow, [1, 2, 3], sigma0=[1, 0, 0], time_limit=60)
    assert certificate.verdict == "certified" and certificate.bounded and not certificate.sliding_bounded
    assert certificate.nominal_peaks is not None and certificate.input_peaks is None
    assert Change("mu3", Fraction("0.334")) in certificate.assessment.advice


def test_the_gain_that_is_named_where_the_bound_says_little_is_enough():
    path = [("a", "b", 1), ("b", "a", 1), ("b", "c", -1), ("c", "b", -1)]
    modes = Family.switching([SignedDigraph.from_edges(path), SignedDigraph.from_edges([*path, ("a", "c", -1)])])
    gains = {"T_r": 1, "T_s": 1, "rho1": 1, "kappa": 1, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
    asked = {"x0": [1, 2, 3], "sigma0": ["0.1", 0, 0]}
    weak = certify_family(modes, SlidingModeProtocol(rho2="0.1", **gains), **asked)
    assert weak.assessment.useful is False and "leaves 1 %" in spell(weak.assessment.advice)
    rho2 = weak.assessment.advice[0].number
    assert certify_family(modes, SlidingModeProtocol(rho2=rho2, **gains), **asked).assessment.useful
