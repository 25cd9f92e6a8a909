"""Facts about certificates under the sliding-mode protocol: claims, proofs, bounds, reaching times, outcomes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from typing import Any

import flint
import numpy as np
import pytest
from asked import certify_words
from balls import inverse_decay_integral
from generators import all_classes, class_cases, random_graph
from selection import thinned

from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import SLIDING_BOUND, SLIDING_CLOCK, digest
from ptcc_certify.checker import check as independent_check
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import load_graph, select
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.model.disturbance import SampledDisturbance, StateDependent, telegraph_noise
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.lemmas import laplacian_spectrum

pytestmark = pytest.mark.usefixtures("quick_search")

RUNS = [(number, name) for number in "456" for _, name, _ in select(number)]
KINDS = ("expression", "worst-case", "telegraph", "constant", "high frequency", "state-dependent", "sampled")


@cache
def example(number: str, name: str) -> Certificate:
    run = next(run for run, graph, _ in select(number) if graph == name)
    assert run.sigma0 is not None
    sigma0 = run.sigma0.split(",")
    return certify(
        load_graph(name),
        run.protocol(),
        InitialState(run.x0.split(","), sigma0=sigma0),
        asks=Asks(disturbance=run.disturbance),
    )


def sliding_run(certificate: Certificate) -> Trajectory:
    assert certificate.trajectory is not None and certificate.trajectory.sliding is not None
    return certificate.trajectory


# ---------------------------------------------------------------------- the paper's examples


@pytest.mark.few(0)
@pytest.mark.parametrize(("number", "name"), RUNS)
def test_the_examples_behave_as_the_paper_reports(number: str, name: str):
    cert, run = example(number, name), sliding_run(example(number, name))
    reported = next(behaviour for _, graph, behaviour in select(number) if graph == name)
    protocol = cert.protocol
    assert isinstance(protocol, SlidingModeProtocol)
    assert cert.claim is not None and cert.comparison is not None and cert.final_state is not None
    assert cert.reaching is not None and cert.initial_state is not None and cert.sigma0 is not None
    assert cert.claim.behaviour == reported
    assert cert.claim.theorem == cert.theorem.number == f"{number}.{1 if reported != 'stability' else 2}"
    assert cert.verdict == "certified"
    T_r = float(protocol.T_r)
    for reached, proved in zip(run.sliding.reaching_times, cert.reaching, strict=True):
        assert proved.z is not None
        assert reached <= proved.time < T_r
    for row, z in zip(run.sliding.sigma, run.sliding.reaching_z, strict=True):
        at = -np.log(np.where(run.sliding.reaching_remaining > 0, run.sliding.reaching_remaining, 1e-300))
        assert (row[at >= z] == 0).all() and (row[at < z] != 0).all()
    assert not cert.comparison.violated and cert.comparison.reaching_kept
    # The end state is Q (X(0) - sigma(0)), not Q X(0), up to what the clock leaves at the last sample before T.
    start = [x - s for x, s in zip(cert.initial_state, cert.sigma0, strict=True)]
    assert cert.final_state.states == final_state(cert.structure, start).states
    spectrum = laplacian_spectrum(cert.structure).spectral_rate
    assert spectrum is not None
    last = np.flatnonzero(run.remaining > 0)[-1]
    left = math.exp(-spectrum / 2 * run.clock[last])
    assert np.abs(run.states[:, last] - np.asarray(cert.final_state)).max() <= 100 * left + 1e-8
    assert np.abs(run.final_state - np.asarray(cert.final_state)).max() <= 1e-8


@pytest.mark.few(0)
def test_the_corollaries_are_those_of_the_sliding_mode():
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    pair = certify(SignedDigraph.from_edges([(1, 2, 3), (2, 1, 3)]), protocol)
    assert pair.claim is not None
    assert (pair.claim.theorem, pair.claim.corollaries) == ("4.1", ("6.1", "7"))
    foes = certify(
        SignedDigraph.from_edges([(1, 2, -1), (2, 3, -1), (3, 1, -1), (2, 1, -1), (3, 2, -1), (1, 3, -1)]), protocol
    )
    assert foes.claim is not None
    assert (foes.claim.theorem, foes.claim.corollaries) == ("4.2", ("6.2",))
    chain = certify(SignedDigraph.from_edges([(1, 2, 3), (2, 3, 1)]), protocol)
    assert chain.claim is not None
    assert (chain.claim.theorem, chain.claim.corollaries) == ("5.1", ("8", "9"))
    fork = certify(SignedDigraph.from_edges([(1, 3, 3), (2, 3, 1)]), protocol)
    assert fork.claim is not None
    assert (fork.claim.theorem, fork.claim.corollaries) == ("6.1", ("10",))


def test_undirected_agents_meet_at_the_signed_average_of_start_minus_sigma():
    graph = SignedDigraph.from_edges([(1, 2, -2), (2, 1, -2), (2, 3, 1), (3, 2, 1)])
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    cert = certify(graph, protocol, InitialState([6, 1, 2], sigma0=[3, 0, 1]))
    assert cert.final_state is not None
    assert cert.final_state.states == (Fraction(1, 3), Fraction(-1, 3), Fraction(-1, 3))


def test_a_start_that_meets_at_zero_because_of_sigma_is_degenerate():
    graph = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    cert = certify(graph, protocol, InitialState([3, 1], sigma0=[2, 0]))
    assert cert.final_state is not None and cert.final_state.degenerate == (1,)


# ---------------------------------------------------------------------- what the file says


def test_every_key_about_the_sliding_mode_is_exact_and_readable():
    cert = example("4", "fig1b")
    data = json.loads(cert.to_json())
    gain = data["problem"]["gain"]
    assert gain["kind"] == "sliding-mode"
    assert SlidingModeProtocol(**{k: v for k, v in gain.items() if k not in ("kind", "disturbance")}) == cert.protocol
    assert gain["disturbance"] == "sin(2*k*t + pi/3)"
    assert data["claim"]["theorem"] == data["paper"]["theorem"] == "4.1"
    assert data["problem"]["sliding_variable"]["1"] == "-9"
    steps = [step for step in data["proof"] if not step["kind"].startswith("input")]
    places = [(step["kind"], step["of"], sorted({"numbers", "witness"} & set(step))) for step in steps]
    assert [kind for kind, _, _ in places[:4]] == ["structure", "claim", "final-state", "deviation-decrease"]
    assert places[-3][:2] == ("rate-upper-bound", "rates")
    assert places[-2:] == [("sliding-bound", "gain", []), ("reaching-time", "reaching_time", [])]
    assert data["reaching_time"]["bound"] == SLIDING_BOUND and data["reaching_time"]["clock"] == SLIDING_CLOCK
    assert cert.reaching is not None
    assert [Fraction(z) for z in data["reaching_time"]["z"].values()] == [r.z for r in cert.reaching]
    assert data["unverified"]["simulation"]["reaching_kept"] is True
    assert data["unverified"]["residual"] is None


@pytest.mark.few(0)
def test_a_reaching_time_is_part_of_the_proof_only_where_one_is_proved():
    """``mu3 kappa < 1`` and a large ``sigma(0)``: certain at ``T_r`` only, and ``z`` is null."""
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)])
    weak = SlidingModeProtocol(1, 1, 1, 1, 1, 2, 1, "1/2", 1)
    late = certify(graph, weak, InitialState(sigma0=["1e9", "-1e9"]), asks=Asks(simulation=False))
    assert late.reaching is not None and [r.z for r in late.reaching] == [None, None]
    both = certify(graph, weak, InitialState(sigma0=["1e9", "1/100"]), asks=Asks(simulation=False))
    assert both.reaching is not None and [r.z is None for r in both.reaching] == [True, False]
    still = certify(graph, weak, InitialState(sigma0=[0, 0]), asks=Asks(simulation=False))
    half = certify(
        graph, weak, InitialState(sigma0=["1e9", 0]), asks=Asks(simulation=False)
    )  # the other is 0 from the start, which is no step
    ends = {"late": late, "both": both, "still": still, "half": half}
    proved = {
        name: [o.kind for o in cert.obligations if o.of in ("gain", "reaching_time")] for name, cert in ends.items()
    }
    assert proved == {
        "late": ["sliding-bound"],
        "both": ["sliding-bound", "reaching-time"],
        "still": ["sliding-bound"],
        "half": ["sliding-bound"],
    }
    assert all(cert.verdict == "certified" for cert in ends.values())


def spoilt(data: dict[str, Any], *path: str, to: Any) -> str | None:
    """What the check rejects once one entry is changed, and the digest with it."""
    copy = json.loads(json.dumps(data))
    place = copy
    for key in path[:-1]:
        place = place[key]
    assert place[path[-1]] != to
    place[path[-1]] = to
    report = independent_check({**copy, "digest": digest(copy)})
    assert not report.accepted
    return report.rejected


def test_the_check_sees_a_reaching_time_that_is_too_early_and_gains_that_prove_nothing():
    cert = example("4", "fig1b")
    assert cert.checked is not None and cert.checked.accepted
    data = json.loads(cert.to_json())
    for label, z in data["reaching_time"]["z"].items():
        early = str(Fraction(z) * Fraction(999, 1000))
        assert spoilt(data, "reaching_time", "z", label, to=early) == "reaching-time of reaching_time"
        farther = str(Fraction(data["problem"]["sliding_variable"][label]) * Fraction(1001, 1000))
        moved = spoilt(data, "problem", "sliding_variable", label, to=farther)
        assert moved is not None  # the outcome is that of another sigma(0), and the time too
        assert spoilt(data, "reaching_time", "z", label, to=str(-Fraction(z))) == "reaching-time of reaching_time"
    assert spoilt(data, "problem", "gain", "mu1", to=data["problem"]["gain"]["delta"]) is not None
    assert spoilt(data, "reaching_time", "bound", to="||sigma(t)|| <= 0") == "reaching_time"


@pytest.mark.few(0)
def test_certified_reaching_times_hold_in_balls():
    cert = example("5", "fig3a")
    protocol = cert.protocol
    assert isinstance(protocol, SlidingModeProtocol) and cert.reaching is not None and cert.sigma0 is not None
    before, flint.ctx.prec = flint.ctx.prec, 300
    try:
        gap = protocol.mu1 - protocol.delta
        for size, reached in zip(cert.sigma0, cert.reaching, strict=True):
            assert reached.z is not None
            ball = inverse_decay_integral(protocol, reached.z) * flint.arb(gap.numerator) / gap.denominator
            assert ball >= abs(int(size))
    finally:
        flint.ctx.prec = before


def test_without_a_start_the_reaching_times_are_proved_all_the_same():
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    cert = certify(SignedDigraph.from_edges([("a", "b", 1)]), protocol, InitialState(sigma0={"b": 2, "a": 0}))
    assert cert.reaching is not None and [r.z is not None and r.z > 0 for r in cert.reaching] == [False, True]
    assert cert.final_state is None and cert.trajectory is None
    assert cert.verdict == "certified" and "reaching-time" in [o.kind for o in cert.obligations]
    assert json.loads(cert.to_json())["problem"]["sliding_variable"] == {"a": "0", "b": "2"}


@pytest.mark.few(0)
def test_without_sigma_the_certificate_is_the_nominal_one():
    protocol = SlidingModeProtocol("0.5", "0.5", 1, 1, 2, 2, 1, 1, 1)
    graph = load_graph("fig3a")
    slid, plain = certify(graph, protocol, [1, 2, 3, 4, 5, 6]), certify(graph, protocol.nominal, [1, 2, 3, 4, 5, 6])
    assert slid.rate == plain.rate
    assert slid.final_state is not None and plain.final_state is not None
    assert slid.final_state.states == plain.final_state.states
    assert slid.envelope.residual(0.01) == plain.envelope.residual(0.01)
    assert slid.verdict == plain.verdict == "certified"
    of_sliding = ("claim", "sliding-bound", "input-sliding", "input-peak")
    added = [o for o in slid.obligations if o.kind not in of_sliding]
    assert added == [o for o in plain.obligations if o.kind not in ("claim", "input-peak")]
    assert slid.effort is not None and plain.effort is not None
    assert slid.effort.energy == plain.effort.energy and slid.effort.path_length == plain.effort.path_length
    assert slid.effort.peak is not None and plain.effort.peak is not None
    assert slid.effort.peak.how == plain.effort.peak.how  # mu1 is added to each
    assert json.loads(slid.to_json())["problem"]["sliding_variable"] == dict.fromkeys(graph.labels, "0")
    assert "sliding_variable" not in json.loads(plain.to_json())["problem"]


def test_what_belongs_to_the_sliding_mode_is_refused_elsewhere():
    graph, nominal = load_graph("fig1a"), NominalProtocol(1, 1, 1, 2)
    for more in ({"sigma0": [0] * 6}, {"disturbance": "t"}):
        with pytest.raises(ParameterError, match="sliding-mode"):
            certify_words(graph, nominal, [1] * 6, **more)
    protocol = SlidingModeProtocol(1, 1, 1, 1, 2, 2, 1, 1, 1)
    with pytest.raises(ParameterError, match="sigma0 of agent 2"):
        certify(graph, protocol, InitialState([1] * 6, sigma0=[0, "x", 0, 0, 0, 0]))
    with pytest.raises(ParameterError, match="beyond delta"):
        certify(graph, protocol, [1] * 6, asks=Asks(disturbance="2"))


# ---------------------------------------------------------------------- bounds


def test_the_bound_cannot_be_asked_as_a_multiple_of_the_start_while_sigma_drives():
    envelope = example("4", "fig1a").envelope
    assert not envelope.direct
    with pytest.raises(ParameterError, match="norm_bound"):
        envelope.residual(0.1)
    with pytest.raises(ParameterError, match="norm_bound"):
        envelope.bound(1.0, np.ones(6))


@pytest.mark.few(0)
@pytest.mark.parametrize(("number", "name"), RUNS)
def test_the_bound_of_the_state_holds_along_the_run_and_falls_after_T_r(number: str, name: str):
    cert, run = example(number, name), sliding_run(example(number, name))
    assert cert.envelope.phase is not None and cert.initial_state is not None and cert.lyapunov is not None
    x0 = np.array([float(x) for x in cert.initial_state])
    before = run.remaining > 1e-7
    bound = cert.envelope.norm_bound(run.remaining[before], x0)
    function = cert.envelope.functions[0]
    z = function.coordinates_of(run.states[:, before], cert.graph.laplacian())
    assert (np.linalg.norm(z, axis=0) <= bound * (1 + 1e-9) + 1e-6).all()
    after = run.remaining[before] < float(run.protocol.T_s / run.protocol.T) * (1 - 1e-9)
    assert (np.diff(bound[after]) < 0).all()


def test_a_rate_that_is_too_high_is_seen_as_violated():
    """The comparison can fail: twice the spectral rate is exceeded by the run, on both sides of T_r."""
    from dataclasses import replace

    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)])
    protocol = SlidingModeProtocol("0.1", 1, 1, 1, 2, 200, 1, 1, 0)
    cert = certify(graph, protocol, InitialState([3, 1], sigma0=["0.01", 0]))
    assert cert.comparison is not None and not cert.comparison.violated and cert.trajectory is not None
    wrong = replace(cert.envelope, functions=(replace(cert.envelope.functions[0], rate=Fraction(6)),))
    assert wrong.compare(cert.trajectory).violated


def test_a_reaching_time_or_a_bound_of_sigma_that_is_missed_is_seen():
    from dataclasses import replace

    cert = example("4", "fig1a")
    run, envelope = sliding_run(cert), cert.envelope
    assert envelope.phase is not None
    early = tuple(replace(r, z=r.z / 2) for r in envelope.phase.reaching if r.z is not None)
    hasty = replace(envelope, phase=replace(envelope.phase, reaching=early))
    assert hasty.compare(run).reaching_kept is False
    assert hasty.compare(run).violated
    swollen = replace(run, sliding=replace(run.sliding, sigma=run.sliding.sigma * 1.5))
    assert envelope.compare(swollen).sliding_ratio == pytest.approx(1.5, rel=1e-3)


def test_only_runs_of_which_something_was_proved_are_compared():
    cert = example("4", "fig1a")
    run, envelope, protocol = sliding_run(cert), cert.envelope, cert.protocol
    x0, sigma0 = run.states[:, 0], run.sliding.sigma0
    with pytest.raises(ParameterError, match="boundary-layer"):
        envelope.compare(simulate(cert.graph, protocol, x0, sigma0=sigma0, disturbance="t/9", boundary_layer=0.1))
    with pytest.raises(ParameterError, match=r"another sigma\(0\)"):
        envelope.compare(simulate(cert.graph, protocol, x0))
    with pytest.raises(ParameterError, match="another protocol"):
        envelope.compare(simulate(cert.graph, run.protocol.nominal, x0))


# ---------------------------------------------------------------------- every row, every kind of disturbance


def disturbance(kind: str, n: int, protocol: SlidingModeProtocol, rng: np.random.Generator) -> Any:
    delta, until = float(protocol.delta), 1.3 * float(protocol.T)
    if kind == "expression":
        return f"{delta}*sin({rng.uniform(1, 9):.3f}*k*t + {rng.uniform(0, 6):.3f})"
    if kind == "telegraph":
        return telegraph_noise(delta, 12 / until, n, until, int(rng.integers(1000)))
    if kind == "constant":
        return (delta * rng.uniform(-1, 1, n)).tolist()
    if kind == "high frequency":
        return f"{delta}*cos(250*t + k)"
    if kind == "state-dependent":
        return StateDependent(lambda t, x, sigma: delta * np.sin(3 * x + 5 * t) * np.cos(sigma))
    if kind == "sampled":
        times = np.linspace(0, until, 12)
        return SampledDisturbance(times, delta * rng.uniform(-1, 1, (n, 12)))
    return kind


def judged(name: str, kwargs: dict, kind: str, power: Fraction, seed: int) -> Certificate:
    """One random run; ``power`` is ``mu3 kappa``."""
    rng = np.random.default_rng([seed, sum(map(ord, name + kind))])
    graph = random_graph(rng, **kwargs).graph
    scale = float(graph.in_weight().max()) or 1.0
    pick = lambda low, high: Fraction(float(rng.uniform(low, high))).limit_denominator(1000)  # noqa: E731
    kappa, delta = pick(0.3, 3), pick(0.1, 2)
    protocol = SlidingModeProtocol(
        pick(0.2, 1),
        pick(0.2, 1),
        pick(0.1, 1) / Fraction(scale).limit_denominator(1000),
        2 / Fraction(scale).limit_denominator(1000) / kappa,
        kappa,
        delta * pick(1.05, 3),
        pick(0.1, 3),
        power / kappa,
        delta,
    )
    n = graph.n_nodes
    x0, sigma0 = ([Fraction(int(v), 100) for v in rng.integers(-500, 501, n)] for _ in range(2))
    if n > 2:
        sigma0[0] = Fraction(0)
    return certify(
        graph, protocol, InitialState(x0, sigma0=sigma0), asks=Asks(disturbance=disturbance(kind, n, protocol, rng))
    )


def check(cert: Certificate, power: Fraction) -> None:
    assert cert.comparison is not None and cert.final_state is not None and cert.reaching is not None
    assert cert.verdict == "certified", cert.notes
    assert not cert.comparison.violated, cert
    assert cert.comparison.reaching_kept
    run = sliding_run(cert)
    late = [r.z is None for r in cert.reaching]
    if power >= 1:
        assert not any(late)
        assert np.isfinite(run.sliding.reaching_z).all()
    shown = "\n".join(certificate_lines(cert, "graph"))
    assert ("reaching time T_r for" in shown) == any(late)
    # sigma is certain to be 0 at T_r in any case.
    assert (run.sliding.sigma[:, run.sliding.reaching_remaining == 0] == 0).all()


POWERS = (Fraction(1, 3), Fraction(1), Fraction(9, 5))


#: A graph of each row of the paper, and one of several components.
OF_EACH_ROW = ("1.1", "1.2", "2.1 K=1", "2.1 K>=2", "2.2", "3.1 mixed", "3.1 mixed no single", "3.2")


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "kwargs"), class_cases((*OF_EACH_ROW[1::2], "disconnected 1.2 2.1 isolated")))
def test_every_row_keeps_its_bounds(name: str, kwargs: dict):
    number = [known for known, _ in all_classes()].index(name)
    power = POWERS[number % 3]
    check(judged(name, kwargs, KINDS[number % len(KINDS)], power, 1), power)


@pytest.fixture
def figures() -> Iterator[list[tuple[str, str, float, float, float]]]:
    rows: list[tuple[str, str, float, float, float]] = []
    yield rows
    print(f"\n{len(rows)} runs; worst ratios: V {max(r[2] for r in rows):.4f}, sigma {max(r[3] for r in rows):.6f}")
    for kind in KINDS:
        own = [r for r in rows if r[1] == kind]
        print(f"  {kind:<16} {len(own)} runs, V {max(r[2] for r in own):.4f}, sigma {max(r[3] for r in own):.6f}")
    print(f"  reaching: all kept; {sum(r[4] for r in rows):.0f} agents certain at T_r only")


@pytest.mark.campaign
def test_campaign_every_row_every_kind(figures: list[tuple[str, str, float, float, float]]):
    """Every class of graph x every kind of disturbance, ``mu3 kappa`` below, at and above 1 in turn."""
    count = 0
    for name, kwargs in all_classes():
        for kind in KINDS:
            power = POWERS[count % 3]
            count += 1
            cert = judged(name, kwargs, kind, power, count)
            check(cert, power)
            seen = cert.comparison
            assert seen is not None and cert.reaching is not None
            late = sum(r.z is None for r in cert.reaching)
            figures.append((name, kind, seen.worst_ratio, seen.sliding_ratio or 0.0, late))
    assert count >= 500


# ---------------------------------------------------------------------- disturbances that read the states

PATH = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1), ("c", "b", -1)])


def path_protocol(**other: Any) -> SlidingModeProtocol:
    given = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 2, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
    return SlidingModeProtocol(**(given | other))


@pytest.mark.few(1)
@pytest.mark.parametrize("mu1", ["1.001", "1.1", 2])
@pytest.mark.parametrize("seed", thinned(range(4)))
def test_a_function_that_is_the_worst_case_is_not_taken_for_a_violation(mu1: Any, seed: int):
    """It attains every certified reaching time; the integrator's last digits must not break one."""
    rng = np.random.default_rng(seed)
    sigma0 = rng.uniform(-1, 1, 3) * 10.0 ** rng.uniform(-6, 1, 3)
    x0 = rng.normal(size=3) * 10.0 ** rng.uniform(-2, 3)
    cert = certify(
        PATH,
        path_protocol(mu1=mu1),
        InitialState(x0, sigma0=sigma0),
        asks=Asks(disturbance=lambda t, x, sigma: np.sign(sigma)),
    )
    assert cert.comparison is not None and cert.comparison.reaching_kept and not cert.comparison.violated
    assert cert.reaching is not None
    certain = [float(r.z) for r in cert.reaching if r.z is not None]
    np.testing.assert_allclose(sliding_run(cert).sliding.reaching_z, certain, rtol=1e-5)


def test_two_agents_that_arrive_together_are_found_under_a_function_too():
    x0, sigma0 = [5, 2, -4], [0.006, 0.006, 0.01]
    run, own = (
        simulate(PATH, path_protocol(), x0, sigma0=sigma0, disturbance=d)
        for d in (lambda t, x, sigma: np.sign(sigma), "worst-case")
    )
    np.testing.assert_allclose(run.sliding.reaching_z, own.sliding.reaching_z, rtol=1e-8)
    assert own.sliding.reaching_z[0] == own.sliding.reaching_z[1]


def test_a_trial_beyond_a_root_shows_the_function_no_sign_that_never_occurs():
    """While sigma_k > 0 the disturbance is within delta; what it would be for sigma_k < 0 does not matter."""
    run = simulate(
        PATH, path_protocol(), [5, 2, -4], sigma0=[1, 2, 3], disturbance=lambda t, x, s: np.where(s >= 0, 0.5, 5.0)
    )
    own = simulate(PATH, path_protocol(), [5, 2, -4], sigma0=[1, 2, 3], disturbance=0.5)
    np.testing.assert_allclose(run.states, own.states, atol=1e-8)


def test_what_rounding_allows_beyond_delta_never_reaches_mu1():
    tight = path_protocol(mu1="1.00000000000001", mu3="0.1")
    with pytest.raises(ParameterError, match="beyond delta"):
        simulate(PATH, tight, [5, 2, -4], sigma0=[1e-16, 2, 3], disturbance=1.0000000000005)
    run = simulate(PATH, tight, [5, 2, -4], sigma0=[1e-16, 2, 3], disturbance="sin(9*t)")
    assert (run.sliding.reaching_z > 0).all()


@pytest.mark.few(0)
@pytest.mark.parametrize("text", thinned(["3*sin(pi*2**20*19999*t)", "1.9*abs(sin(pi*2**18*19999*t/1.25))"], 2))
def test_a_fast_signal_does_not_hide_between_the_samples(text: str):
    with pytest.raises(ParameterError, match="beyond delta"):
        simulate(PATH, path_protocol(), [5, 2, -4], disturbance=text)


@pytest.mark.few(0)
@pytest.mark.parametrize("mu1", thinned(["1e-290", "1e-5"], 2))
def test_starts_of_any_size_keep_their_bounds(mu1: str):
    protocol = path_protocol(mu1=mu1, delta=0, mu3="0.5")
    with np.errstate(all="raise", under="ignore"):
        cert = certify(PATH, protocol, InitialState([5, 2, -4], sigma0=["1e300", 1, 2]))
    assert cert.comparison is not None and not cert.comparison.violated
    assert math.isfinite(cert.comparison.worst_ratio)
