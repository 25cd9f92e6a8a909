"""Facts about runs of families against their certificates: no signal exceeds what is proved for every signal."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from asked import certify_family
from common_kernel_families import KINDS, random_family
from scipy.linalg import expm

from ptcc_certify.certificate.runs_against_bounds import compare, functions_of, worst_case_signals
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import ConstantSignal, PeriodicSignal, RandomSignal

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
RATIOS = ("deviation_ratio", "final_ratio", "input_ratio", "lyapunov_ratio", "mode_ratio")


def drawn_family(rng, n):
    modes, share = int(rng.integers(1, 4)), [Fraction(0), Fraction(1, 10), Fraction(3, 10)][int(rng.integers(3))]
    share = Fraction(1, 5) if modes == 1 and not share else share
    return random_family(rng, KINDS[int(rng.integers(len(KINDS)))], n, modes, share, float(rng.choice([0, 0.3])))


def played_signals(rng, certificate, count, steps=(3,)):
    """Worst cases of coarse and fine steps, the extreme members held, words, and random signals up to the count."""
    members = Members(certificate.family)
    signals = [s for step in steps for s in worst_case_signals(certificate, members.unit / step)]
    modes = range(len(members.arrays))
    signals += [ConstantSignal(mode, level) for mode in modes for level in (0.0, 0.5, 1.0)]
    word = [(mode, members.unit * float(0.5 + rng.exponential()), float(rng.random())) for mode in modes]
    signals += [PeriodicSignal(word), PeriodicSignal(word[::-1])]
    dwells = members.unit * 10 ** rng.uniform(-0.3, 1, max(2, count - len(signals)))
    return [*signals, *(RandomSignal(k, dwell) for k, dwell in enumerate(dwells))]


def worst_ratios(rng, families, count, steps=(3,), **options):
    worst, runs = dict.fromkeys(RATIOS, 0.0), 0
    for family in families:
        n = family.n_nodes
        certificate = certify_family(family, PROTOCOL, rng.integers(-9, 10, n).tolist(), time_limit=10)
        for signal in played_signals(rng, certificate, count, steps):
            run = simulate(family, PROTOCOL, certificate.initial_state, signal, past=0, **options)
            seen, runs = compare(certificate, run), runs + 1
            assert not seen.violated, (family, signal, seen)
            for name in RATIOS:
                worst[name] = max(worst[name], getattr(seen, name) or 0.0)
    return worst, runs


@pytest.mark.few(0)
def test_no_signal_exceeds_what_is_proved():
    rng = np.random.default_rng(11)
    families = [random_family(rng, "consensus", 3, 2, Fraction(1, 5))]
    worst, runs = worst_ratios(rng, families, 12, samples=30, remaining=1e-4)
    assert runs >= 12
    assert worst["lyapunov_ratio"] > 0.9  # the bound is sharp somewhere
    assert all(0 < worst[name] <= 1.000001 for name in RATIOS)


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(10))
def test_on_a_hundred_families_a_hundred_signals_each_exceed_nothing(part):
    rng = np.random.default_rng(2026 + part)
    families = [drawn_family(rng, 3 + (part + k) % 14) for k in range(10)]
    worst, runs = worst_ratios(rng, families, 100, (3, 10), samples=40, remaining=1e-4, rtol=1e-9, atol=1e-9)
    print(runs, "runs", worst)
    assert runs >= 1000


@pytest.mark.few(0)
def test_a_certificate_that_claims_too_much_is_found_out():
    family = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    certificate = certify_family(family, PROTOCOL, [1, 2])
    part = certificate.parts[0]
    boast = [replace(V, rates=tuple(r * Fraction(11, 10) for r in V.rates)) for V in part.functions]
    wrong = certificate.changed(parts=(replace(part, functions=tuple(boast)),))
    assert any(
        compare(wrong, simulate(family, PROTOCOL, [1, 2], s, samples=20, remaining=1e-4)).violated
        for s in worst_case_signals(wrong)
    )
    assert not any(
        compare(certificate, simulate(family, PROTOCOL, [1, 2], s, samples=20, remaining=1e-4)).violated
        for s in worst_case_signals(certificate)
    )


@pytest.mark.few(0)
def test_the_worst_case_falls_more_slowly_than_random_signals():
    rng = np.random.default_rng(7)
    family = random_family(rng, "stability", 3, 2, Fraction(1, 4))
    certificate = certify_family(family, PROTOCOL, [1, -2, 3])
    worst = worst_case_signals(certificate)[0]
    V_end = []
    for signal in (worst, *map(RandomSignal, range(5))):
        x = simulate(family, PROTOCOL, [1, -2, 3], signal, times=[0.9]).states[:, 0]
        V_end.append(x @ worst.form @ x)
    assert V_end[0] > max(V_end[1:])


def test_the_ratio_of_a_lyapunov_function_is_that_of_exponentials():
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -2, -1)])
    certificate = certify_family(family, PROTOCOL, [1, 2])
    run = simulate(family, PROTOCOL, [1, 2], ConstantSignal(0, 1.0), times=[0, "1/2"])
    A = Members(family).laplacian(run.played.choices[0]).toarray()
    x, ratios = expm(-A * run.clock[1]) @ [1, 2], []
    for signal, (_, V) in zip(worst_case_signals(certificate), functions_of(certificate), strict=False):
        start = np.array([1, 2]) @ signal.form @ [1, 2]
        ratios.append(np.sqrt(x @ signal.form @ x / (np.exp(-float(V.rate) * run.clock[1]) * start)))
    assert abs(compare(certificate, run).lyapunov_ratio - max(ratios)) < 1e-6


def test_runs_of_something_else_are_refused():
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -2, -1)])
    certificate, start = certify_family(family, PROTOCOL, [1, 2]), [1, 2]
    other = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -2, -1), ("c", "a", 1, 1)])
    with pytest.raises(ParameterError, match="another family"):
        compare(certificate, simulate(other, PROTOCOL, [1, 2, 3], times=[0]))
    with pytest.raises(ParameterError, match="another protocol"):
        compare(certificate, simulate(family, NominalProtocol(T=2), start, times=[0]))
    with pytest.raises(ParameterError, match="another initial state"):
        compare(certificate, simulate(family, PROTOCOL, [1, 3], times=[0]))
