"""Claims for restricted signals: proved, and kept by random signals that are admissible."""

from __future__ import annotations

import copy
import random
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family
from common_kernel_families import random_family
from families import random_family as any_family
from scipy.linalg import expm
from selection import thinned

from lmi.exact.decimal_rounding import up
from ptcc_certify import Family, NominalProtocol, SignedDigraph, certify
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.checking import read_and_check
from ptcc_certify.certificate.constrained_switching.bounds import deviation_of_signal
from ptcc_certify.certificate.constrained_switching.claims import LastModeClaim, RateClaim, ShareClaim
from ptcc_certify.certificate.verdict import assess
from ptcc_certify.checker import check, digest
from ptcc_certify.errors import ParameterError
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.mode_forms import search_share_form
from ptcc_certify.model.asks import Expectations
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows
from ptcc_certify.report.facts.constrained_switching import signal_facts
from ptcc_certify.report.page import report_html
from ptcc_certify.report.report_file import write_report
from ptcc_certify.report.screen import certificate_lines, check_summary, summary_lines
from ptcc_certify.report.statement import report_latex
from ptcc_certify.theorems.contractions import clock_for_all_edges
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
IN_TIME, ON_CLOCK = DwellTime("0.2", clock="t"), DwellTime(3, clock="s")


@cache
def slowed_by_switches() -> Family:
    """Two stable modes, each much faster by itself than under the worst switching."""
    one = SignedDigraph.from_edges([("b", "a", -10), ("c", "a", 10), ("a", "b", 1), ("b", "c", -3)], nodes="abc")
    other = SignedDigraph.from_edges([("b", "a", 1), ("c", "a", -3), ("c", "b", -10), ("a", "c", 1)])
    return Family.switching({"one": one, "other": other})


@cache
def of_slowed(signal: Any) -> Certificate:
    return certify_family(slowed_by_switches(), PROTOCOL, [3, -1, 2], signal=signal)


@cache
def random_families() -> list[Family]:
    """A stable one, one of consensus, one of containment, and one of consensus whose weights are uncertain."""
    draw = np.random.default_rng(11)
    known = [random_family(draw, kind, 4, 2) for kind in ("stability", "consensus", "containment")]
    return [*known, random_family(draw, "consensus", 3, 2, Fraction(1, 5), 0.3)]


@cache
def certificates(more: bool = False) -> list[Certificate]:
    """Of two families and three signals, and of a third whose weights are uncertain; or of what is left."""
    signals = (IN_TIME, ON_CLOCK, "constant")
    stable, consensus, containment, uncertain = random_families()
    cases = [*product([containment], signals), (uncertain, IN_TIME)]
    if more:
        cases = [*product([stable, consensus], signals), (uncertain, ON_CLOCK), (uncertain, "constant")]
    own = [] if more else [of_slowed(signal) for signal in signals]
    start = [3, -1, 2, -2, 1]
    return own + [certify_family(f, PROTOCOL, start[: f.n_nodes], signal=signal) for f, signal in cases]


def switches(rng: np.random.Generator, signal: Any) -> list[float]:
    """Instants of switches on the clock: the least gaps, or somewhat longer ones."""
    if signal == "constant":
        return []
    gaps = float(signal.least) * (1 + rng.exponential(0.3, 6) * (rng.random(6) < 0.5))
    instants = np.cumsum([rng.random() * float(signal.least), *gaps])
    return (PROTOCOL.gain.clock(instants[instants < 1]) if signal.clock == "t" else instants).tolist()


def excess(certificate: Certificate, claim: RateClaim, rng: np.random.Generator) -> float:
    """The largest logarithm of ``V`` over its bound along a random signal."""
    part, m = certificate.parts[claim.component], len(certificate.family.modes)
    quotient = Quotient.of(part.component)
    V = max(part.functions, key=lambda V: V.rate)
    matrices = (V.matrix,) * m if claim.forms is None else claim.forms.matrices
    forms = [np.array(P, dtype=float) for P in matrices]
    ends = [0.0, *switches(rng, claim.signal)]
    ends.append(ends[-1] + 3.0)
    modes = [int(rng.integers(m))]
    while len(modes) < len(ends) - 1:
        modes.append(int(rng.choice([k for k in range(m) if k != modes[-1]] or [0])))
    xi, worst = rng.normal(size=len(quotient.nodes)), -np.inf
    first, held = np.log(xi @ forms[modes[0]] @ xi), {}
    for count, ((begin, end), mode) in enumerate(zip(pairwise(ends), modes, strict=True)):
        own, s = quotient.modes[mode], begin
        for step in np.diff(np.linspace(begin, end, 6)):
            level = [Fraction(int(x)) for x in rng.integers(0, 2, len(own.parts))]
            if claim.signal == "constant":
                level = held.setdefault("level", level)
            xi = expm(-np.array(own.member(level), dtype=float) * step) @ xi
            s += step
            ratio = np.log(float(claim.ratio))
            allowed = {"constant": 0.0, "t": count * ratio, "s": ratio}[getattr(claim.signal, "clock", "constant")]
            worst = max(worst, np.log(xi @ forms[mode] @ xi) - first + float(claim.rate) * s - allowed)
    return worst


def excesses(runs: int, seed: int, more: bool = False) -> list[float]:
    rng = np.random.default_rng(seed)
    claims = [(made, claim) for made in certificates(more) for claim in made.restricted]
    cases = [(made, claim) for made, claim in claims if isinstance(claim, RateClaim)]
    return [excess(*case, rng) for case in cases for _ in range(runs)]


#: By default some certificates; others in a campaign.
SOME_AND_MORE = pytest.mark.parametrize("more", [False, pytest.param(True, marks=pytest.mark.campaign)])


@pytest.mark.few(0)
@SOME_AND_MORE
def test_every_claim_is_verified(more: bool):
    for certificate in certificates(more):
        assert certificate.verdict == "certified" and certificate.restricted
        assert check(certificate.to_dict(), stdlib=True).accepted


@pytest.mark.few(0)
def test_no_admissible_signal_exceeds_the_bound():
    found = excesses(10, 0)
    assert -1e-3 < max(found) <= 1e-9  # attained at the beginning


@pytest.mark.campaign
@pytest.mark.parametrize("more", [False, True])
def test_no_admissible_signal_of_thousands_exceeds_the_bound(more: bool):
    assert max(excesses(400, 1, more)) <= 1e-9


@pytest.mark.few(0)
def test_more_is_proved_for_seldom_switches_than_for_any():
    """Each mode has the rate 4.4 by itself; switched fast, in equal shares, they decay with 0.65."""
    signals = ("any", DwellTime("0.1", clock="s"), ON_CLOCK, IN_TIME, "constant")
    rates = [of_slowed(signal).rate_of_signal for signal in signals]
    assert rates[0] <= rates[1] < rates[2] < rates[4] and rates[3] > rates[0]


def laplacian(mode: Any, rng: np.random.Generator) -> np.ndarray:
    """That of a member of a mode."""
    L = np.zeros((len(mode.labels),) * 2)
    for edge in range(mode.n_edges):
        ends = [float(end.fraction(edge)) for end in (mode.lower, mode.upper)]
        weight, source, target = ends[rng.integers(2)], int(mode.source[edge]), int(mode.target[edge])
        L[target, target] += weight
        L[target, source] -= int(mode.sign[edge]) * weight
    return L


def deviation_ratio(certificate: Certificate, rng: np.random.Generator) -> float:
    """The largest ratio of a deviation from the final state to its bound, along a random signal that is admissible."""
    t = np.linspace(0, 0.95, 12)
    clock = PROTOCOL.gain.clock(t)
    modes = certificate.family.modes
    ends = [*switches(rng, certificate.signal), 1e3]
    x, s, number = np.array(certificate.initial_state, dtype=float), 0.0, int(rng.integers(len(modes)))
    states = np.zeros((x.size, t.size))
    for end in ends:
        L = laplacian(modes[number], rng)
        for k in np.flatnonzero((clock >= s) & (clock < end)):
            states[:, k] = expm(-L * (clock[k] - s)) @ x
        x, s, number = expm(-L * (end - s)) @ x, end, (number + 1) % len(modes)
    moved = np.abs(states - x[:, None]) - 1e-9
    return float((moved / deviation_of_signal(certificate, 1 - t)).max())


@pytest.mark.few(0)
@SOME_AND_MORE
def test_no_admissible_signal_leaves_the_error_bound_of_these_signals(more: bool):
    rng = np.random.default_rng(5)
    for certificate in certificates(more):
        assert max(deviation_ratio(certificate, rng) for _ in range(10)) <= 1, (certificate.family, certificate.signal)
        remaining = [1, 0.1, 1e-4]
        assert (deviation_of_signal(certificate, remaining) <= certificate.deviation_bound(remaining)).all()


@pytest.mark.usefixtures("framed_figures")
def test_the_error_bound_of_seldom_switches_is_told_beside_that_of_every_signal():
    certificate = of_slowed(IN_TIME)
    every = float(certificate.deviation_bound([0.01]).max())
    these = float(deviation_of_signal(certificate, [0.01]).max())
    assert these < 1e-6 * every
    short, long = "\n".join(summary_lines(certificate, "f")), "\n".join(certificate_lines(certificate, "f"))
    for text in (short, long):
        assert f"{up(these, 2)} " in text and text.count("(these signals)") == (1 if text == short else 2)
    saved = read_certificate(certificate.to_dict())
    page, statement = report_html(saved), report_latex(saved)
    assert "(these signals)" in page and "Nor are the error bounds under the promise" in page
    assert "(these signals)." in statement


@pytest.mark.few(0)
def test_so_many_switches_that_nothing_would_be_said_leave_the_bound_of_every_signal():
    certificate = of_slowed(DwellTime("1e-6", clock="t"))
    assert (deviation_of_signal(certificate, [0.01]) == certificate.deviation_bound([0.01])).all()


@SOME_AND_MORE
def test_a_rate_for_restricted_signals_is_never_below_that_for_any(more: bool):
    for certificate in certificates(more):
        assert certificate.rate is None or certificate.rate_of_signal >= certificate.rate


@pytest.mark.few(0)
def test_the_claims_are_read_back(tmp_path: Path):
    for certificate in certificates()[1:6:2]:
        certificate.save(tmp_path / "c.json")
        again = read_certificate(tmp_path / "c.json")
        assert again.signal == certificate.signal
        for one, other in zip(again.restricted, certificate.restricted, strict=True):
            assert (one.rate, one.ratio, one.bounded) == (other.rate, other.ratio, other.bounded)


def test_dwell_times_at_their_limits():
    long, short = (of_slowed(DwellTime(x, clock="t")) for x in (5, "1e-6"))
    assert DwellTime(5, clock="t").switches(PROTOCOL.T) == 1 and long.rate_of_signal > short.rate_of_signal
    assert short.restricted[0].ratio == 1 and short.rate_of_signal == short.rate
    one = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -1, -1)])
    (claim,) = certify_family(one, PROTOCOL, signal=ON_CLOCK).restricted
    assert claim.ratio == 1
    alone = certify_family(Family.from_intervals([], nodes=["a"]), PROTOCOL, signal=ON_CLOCK)
    assert alone.restricted == () and alone.verdict == "certified"


def test_a_dwell_in_time_has_so_many_switches_before_the_deadline():
    """Gaps of just the dwell, the first switch soon after 0: as many as fit."""
    for least, count in (("1", 1), ("2", 1), ("0.5", 2), ("0.4", 3), ("0.3", 4)):
        dwell = DwellTime(least, clock="t")
        first = 1e-9
        fits = sum(first + k * float(dwell.least) < 1 for k in range(10))
        assert dwell.switches(Fraction(1)) == count == fits


@pytest.mark.parametrize("wrong", [("0", "t"), ("-1", "s"), ("1", "x"), ("1", None), ("nan", "t")])
def test_a_dwell_time_that_is_none_is_refused(wrong: tuple[str, Any]):
    with pytest.raises(ParameterError):
        DwellTime(wrong[0], clock=wrong[1])


def test_signals_that_are_none_are_refused():
    with pytest.raises(ParameterError, match="DwellTime"):
        certify(slowed_by_switches(), PROTOCOL, signal="seldom")
    with pytest.raises(ParameterError, match="families"):
        certify(SignedDigraph.from_edges([("a", "b", 1)]), PROTOCOL, signal=ON_CLOCK)


@pytest.mark.few(0)
def test_a_rate_that_is_asked_for_is_judged_for_these_signals():
    family = slowed_by_switches()
    asked = Expectations(min_rate="4")
    never = certify_family(family, PROTOCOL, signal="constant", expectations=asked)
    assert never.assessment.asked == "met"
    assert certify_family(family, PROTOCOL, expectations=asked).assessment.asked != "met"


@pytest.mark.few(0)
def test_a_rate_that_is_asked_for_is_worth_more_than_a_small_constant():
    """A dwell time in time costs no rate: what is proved for long ones holds for short ones."""
    family, short = slowed_by_switches(), DwellTime("0.02", clock="t")
    first = of_slowed(short)
    assert first.rate_of_signal == first.rate < 4 and "nothing more is proved" in first.summary()
    made = certify_family(family, PROTOCOL, signal=short, expectations=Expectations(min_rate="4"))
    assert made.assessment.asked == "met" and made.rate_of_signal >= 4 and made.verdict == "certified"


def resealed(data: dict[str, Any]) -> dict[str, Any]:
    return {**data, "digest": digest(data)}


def test_no_claim_is_larger_than_its_proof():
    kept = next(c for c in certificates() if c.signal == ON_CLOCK and c.restricted[0].ratio > 1)
    data = kept.to_dict()
    (entry,) = data["restricted"]
    rate, ratio = Fraction(entry["rate"]), Fraction(entry["ratio"])
    for key, new in (
        ("rate", str(rate + Fraction(1, 10**6))),
        ("ratio", str(ratio - Fraction(1, 100))),
        ("ratio", "1"),
        ("bounded", None if entry["bounded"] else True),
        ("forms", None),
        ("forms", entry["forms"][:1]),
        ("signals", "constant"),
        ("signals", {"dwell": str(ON_CLOCK.least / 2), "clock": "s"}),
        ("signals", {"dwell": "0", "clock": "t"}),
        ("component", 1),
        ("claim", "more"),
    ):
        made = copy.deepcopy(data)
        made["restricted"][0][key] = new
        assert not check(resealed(made)).accepted, (key, new)
    for key in entry:
        made = copy.deepcopy(data)
        del made["restricted"][0][key]
        assert not check(resealed(made)).accepted, key
    longer = copy.deepcopy(data)
    longer["restricted"][0]["signals"]["dwell"] = str(2 * ON_CLOCK.least)
    assert check(resealed(longer)).accepted


# ---------------------------------------------------------------------- the last mode


def last(family: Family, signal: Any = IN_TIME, **more: Any) -> Certificate:
    return certify_family(family, PROTOCOL, range(1, family.n_nodes + 1), signal=signal, **more)


def against() -> Family:
    """Two modes with different camps."""
    one = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1)])
    return Family.switching({"one": one, "other": SignedDigraph.from_edges([("a", "b", -1), ("b", "c", 2)])})


def test_where_kernels_differ_the_last_mode_decides():
    made = last(against())
    (claim,) = made.restricted
    assert made.verdict == "certified" and made.behaviours == ("depends on the signal",)
    assert isinstance(claim, LastModeClaim) and set(claim.behaviours) == {"bipartite consensus"}
    assert claim.final_states == ((1, 1), (-1, 2), (-1, 3)) and last(against(), ON_CLOCK).restricted == ()


@pytest.mark.few(0)
def test_an_expectation_is_judged_by_the_last_mode():
    for expected, met in (("bipartite consensus", True), ("bipartite containment", True), ("stability", False)):
        answers = [last(against(), signal, expectations=expected).assessment.asked for signal in (IN_TIME, "any")]
        assert answers == (["met", "refuted"] if met else ["refuted", "refuted"])
    outage = Family.switching([against().modes[0].mandatory, SignedDigraph.from_edges([], nodes="abc")])
    assert last(outage).restricted[0].behaviours == ("bipartite consensus", "bipartite containment")
    assert last(outage, expectations="bipartite consensus").assessment.asked == "refuted"
    assert last(outage, expectations="bipartite containment").assessment.asked == "met"


def test_consensus_is_told_of_restricted_signals_where_all_weights_are_positive():
    line = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1)])
    outage = Family.switching([line, SignedDigraph.from_edges([], nodes="abc")])
    halves = Family.switching(
        [SignedDigraph.from_edges([edge], nodes="abc") for edge in [("a", "b", 1), ("b", "c", 1)]]
    )
    windows, shares = JointWindows(2, on=1, clock="s"), ClockShares(["0.9", "0.1"])
    for family, signal, expected, asked in (
        (outage, shares, "consensus", "met"),
        (halves, windows, "consensus", "met"),
        (halves, IN_TIME, "containment", "met"),
        (halves, IN_TIME, "consensus", "refuted"),
        (against(), IN_TIME, "consensus", "refuted"),
        (outage, shares, "signed-average consensus", "left open"),
    ):
        assert last(family, signal, expectations=expected).assessment.asked == asked, (signal, expected)


def test_a_mode_whose_uncertain_weights_move_targets_is_not_told():
    unsure = Family.from_intervals([("a", "c", 1, 2), ("b", "c", 1, 1)])
    made = last(unsure, expectations="bipartite containment")
    assert made.restricted[0].behaviours == (None,) and made.assessment.asked not in ("met", "refuted")
    assert made.restricted[0].final_states == ((1, 1), (1, 3), (3, 3))


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", thinned(range(12)))
def test_no_signal_leaves_the_ends_of_the_last_mode(seed: int):
    draw, rng = random.Random(seed), np.random.default_rng(seed)
    family = any_family(draw, "depends", nodes=draw.randint(3, 6)).family
    made = last(family)
    (claim,) = made.restricted
    assert made.verdict == "certified" and check(made.to_dict(), stdlib=True).accepted
    low, high = np.array(claim.final_states, dtype=float).T
    for _ in range(20):
        x = np.arange(1.0, family.n_nodes + 1)
        for _ in range(6):
            mode = family.modes[int(rng.integers(len(family.modes)))]
            L = np.array(mode.member(rng.random(mode.n_edges) < 0.5).dense_laplacian(), dtype=float)
            x = expm(-L * rng.exponential(1.0)) @ x
            assert (x >= low - 1e-9).all() and (x <= high + 1e-9).all()


# ---------------------------------------------------------------------- windows

WINDOWS = JointWindows(2, on="0.4", clock="s")
NODES = [f"{end}{e}" for end in "st" for e in range(4)]


def cut_up(rng: np.random.Generator, n: int, stable: bool) -> Family:
    """Modes that share out the edges of a connected graph, most of them alone in theirs."""
    edges = [(f"n{k}", f"n{k + 1}", int(rng.choice([1, -1]))) for k in range(n - 1)]
    sign = int(np.prod([w for *_, w in edges])) * (-1 if stable else 1)
    edges.append((f"n{n - 1}", "n0", sign))
    labels = [f"n{k}" for k in range(n)]
    graphs = [SignedDigraph.from_edges([edge], nodes=labels) for edge in edges]
    return Family.switching(graphs)


@pytest.mark.parametrize("seed", thinned(range(8), 3))
def test_joint_windows_contract_as_much_as_is_claimed(seed: int):
    rng = np.random.default_rng(seed)
    n, stable = int(rng.integers(2, 5)), bool(seed % 2)
    family = cut_up(rng, n, stable)
    signal = JointWindows(n, on=Fraction(1, 2), clock="s")
    made = certify_family(family, PROTOCOL, range(1, n + 1), signal=signal)
    (claim,) = made.restricted
    assert claim.behaviour == ("stability" if stable else "bipartite consensus")
    assert made.verdict == "certified" and check(made.to_dict(), stdlib=True).accepted
    camps = made.parts[0].component.gauge
    laplacians = [mode.mandatory.dense_laplacian() for mode in family.modes]
    x = np.arange(1.0, n + 1)
    size = (lambda x: abs(x).max()) if stable else (lambda x: np.ptp(camps * x))
    for _ in range(4):
        before = size(x)
        for _ in range(claim.rate.exponent):
            spare = rng.dirichlet(np.ones(n)) * (n - n / 2)
            for k in rng.permutation(n):
                x = expm(-laplacians[k] * (0.5 + spare[k])) @ x
        assert size(x) <= before * float(claim.rate.contraction) + 1e-15
    low, high = np.array(claim.final_states, dtype=float).T
    if not stable:
        assert (x >= low - size(x) - 1e-9).all() and (x <= high + size(x) + 1e-9).all()


def test_windows_without_a_joint_graph_prove_nothing():
    apart = Family.switching([SignedDigraph.from_edges([("a", "c", 1)], nodes="abc")] * 2)
    assert last(apart, WINDOWS).restricted == ()
    spoiled = Family.from_intervals([("a", "b", 1, 1), ("b", "a", -1, 0), ("b", "c", 0, 1)])
    assert last(spoiled, WINDOWS).restricted == ()
    assert last(slowed_by_switches(), WINDOWS).restricted == ()  # every signal brings it to 0 already


def test_windows_of_time_and_windows_that_are_none_are_refused():
    with pytest.raises(ParameterError, match="prove nothing at T"):
        JointWindows(1, on=1, clock="t")
    for length, on, clock in ((0, 1, "s"), (1, 2, "s"), (1, 0, "s"), (1, 1, None)):
        with pytest.raises(ParameterError):
            JointWindows(length, on=on, clock=clock)


@pytest.mark.parametrize("seed", range(4))
def test_windows_that_no_signal_keeps_are_refused_and_those_that_one_just_keeps_are_not(seed: int):
    family = cut_up(np.random.default_rng(seed), n := 3 + seed, False)
    just = JointWindows(1, on=Fraction(1, n), clock="s")
    assert certify_family(family, PROTOCOL, signal=just).restricted
    with pytest.raises(ParameterError, match="no signal has every edge on"):
        certify_family(family, PROTOCOL, signal=JointWindows(1, on=Fraction(1, n) + Fraction(1, 10**9), clock="s"))


@pytest.mark.few(0)
def test_what_all_edges_need_of_the_clock_is_the_least_of_all_plays():
    rng = np.random.default_rng(5)
    for _ in range(30):
        on = rng.random((3, 4)) < 0.5
        on[0, ~on.any(axis=0)] = True
        graphs = [
            SignedDigraph.from_edges([(f"s{e}", f"t{e}", 1) for e in np.flatnonzero(row)], nodes=NODES) for row in on
        ]
        needed = clock_for_all_edges(Family.switching(graphs))
        plays = (np.array(h) / 12 for h in product(range(13), repeat=3))
        least = min(h.sum() for h in plays if (on.T @ h >= 1 - 1e-9).all())
        assert float(needed) == pytest.approx(least, abs=1e-9)


def test_windows_are_read_back_and_judged(tmp_path: Path):
    made = certify_family(cut_up(np.random.default_rng(0), 3, False), PROTOCOL, [1, 2, 3], signal=WINDOWS)
    made.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    assert again.restricted[0].rate == made.restricted[0].rate and again.signal == WINDOWS
    data = made.to_dict()
    eta = Fraction(data["restricted"][0]["eta"])
    for key, new in (("eta", str(eta * 2)), ("eta", "0"), ("behaviour", "stability"), ("component", 1)):
        forged = copy.deepcopy(data)
        forged["restricted"][0][key] = new
        assert not check(resealed(forged)).accepted, key
    forged = copy.deepcopy(data)
    forged["restricted"][0]["signals"]["window"] = "3"
    assert not check(resealed(forged)).accepted


# ---------------------------------------------------------------------- shares of the clock


def with_outage(kind: str) -> Family:
    modes = [random_family(np.random.default_rng(k), kind, 4).modes[0].mandatory for k in (2, 2)]
    outage = SignedDigraph.from_edges([], nodes=range(4))
    return Family.switching({"one": modes[0], "outage": outage, "other": modes[1]})


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", ["stability", "consensus"])
def test_shares_of_the_clock_weigh_the_rates_of_modes(kind: str):
    family, shares = with_outage(kind), [Fraction(5, 10), Fraction(3, 10), Fraction(2, 10)]
    made = certify_family(family, PROTOCOL, signal=ClockShares(shares))
    (claim,) = made.restricted
    assert made.verdict == "certified" and check(made.to_dict(), stdlib=True).accepted
    assert claim.behaviour == {"stability": "stability", "consensus": "bipartite consensus"}[kind]
    V = claim.form.function
    assert V.rates[1] == 0 < claim.rate == sum(s * r for s, r in zip(shares, V.rates, strict=True))
    P, quotient, rng = np.array(V.matrix, dtype=float), Quotient(family), np.random.default_rng(0)
    for _ in range(30):
        xi, spent = rng.normal(size=len(P)), np.zeros(3)
        first = xi @ P @ xi
        for _ in range(8):
            mode, step = int(rng.integers(3)), rng.exponential(0.3)
            xi = expm(-np.array(quotient.modes[mode].center, dtype=float) * step) @ xi
            spent[mode] += step
            decay = np.exp(-np.array(V.rates, dtype=float) @ spent)
            assert xi @ P @ xi <= decay * first * (1 + 1e-9)


@pytest.mark.few(0)
def test_a_function_for_every_signal_stands_for_shares_where_their_own_search_finds_less():
    family, shares = slowed_by_switches(), [Fraction(1, 2), Fraction(1, 2)]
    (component,) = decide(family)
    (V, *_) = certify_family(family, PROTOCOL).parts[0].functions
    assert isinstance(V, CommonForm)
    fast = replace(V, rates=tuple(100 * rate for rate in V.rates))
    form = search_share_form(component, shares, [fast])
    assert form is not None and form.function is fast


@pytest.mark.few(0)
def test_a_rate_that_is_asked_for_is_met_by_that_for_every_signal_where_shares_prove_less():
    family = slowed_by_switches()
    made = certify_family(family, PROTOCOL, signal=ClockShares(["0.5", "0.5"]))
    (claim,) = made.restricted
    assert isinstance(claim, ShareClaim) and made.rate is not None and claim.rate > made.rate
    asked = Expectations(min_rate=made.rate)
    less = made.changed(restricted=(replace(claim, rate=made.rate / 2),), expectations=asked)
    assert less.rate_of_signal == made.rate and assess(less, made.checked).asked == "met"


def test_what_shares_prove_is_judged_and_read_back(tmp_path: Path):
    signal = ClockShares(["0.9", "0.1", "0"])
    made = certify_family(with_outage("consensus"), PROTOCOL, signal=signal, expectations="bipartite consensus")
    assert made.assessment.asked == "met"
    made.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    assert again.signal == signal and again.restricted[0].rate == made.restricted[0].rate
    data = made.to_dict()
    for key, new in (
        ("rate", str(made.restricted[0].rate + Fraction(1, 1000))),
        ("behaviour", "stability"),
        ("behaviour", None),
        ("nodes", data["problem"]["graph"]["nodes"]),
        ("signals", {"shares": ["1", "0.1", "0"]}),
        ("signals", {"shares": ["1.5", "-0.5", "0"]}),
        ("signals", {"shares": ["1", "0"]}),
    ):
        forged = copy.deepcopy(data)
        forged["restricted"][0][key] = new
        assert not check(resealed(forged)).accepted, (key, new)
    forged = copy.deepcopy(data)
    del forged["restricted"][0]["behaviour"]
    assert not check(resealed(forged)).accepted


def played_by_shares(family: Family, shares: list[Fraction], x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Where agents are after modes were played in turn, in another order each time, by their shares of the clock."""
    for step in [0.3] * 20 + [4.0] * 30:
        for k in rng.permutation(len(family.modes)).tolist():
            mode = family.modes[k]
            L = np.zeros((x.size, x.size))
            for e, (s, t) in enumerate(zip(mode.source, mode.target, strict=True)):
                weight = rng.uniform(float(mode.lower.fraction(e)), float(mode.upper.fraction(e)))
                L[t, t] += weight
                L[t, s] -= weight * mode.sign[e]
            x = expm(-L * float(shares[k]) * step) @ x
    return x


@pytest.mark.few(0)
def test_shares_tell_where_agents_end_exactly_where_a_mean_is_kept():
    day = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 3), ("b", "c", -2)])
    outage = SignedDigraph.from_edges([], nodes="abc")
    shares, x0 = [Fraction(3, 10), Fraction(7, 10)], [Fraction(8), Fraction(0), Fraction(5)]
    family = Family.switching({"outage": outage, "day": day})
    made = certify_family(family, PROTOCOL, x0, signal=ClockShares(shares))
    (claim,) = made.restricted
    (only,) = certify_family(Family.switching([day]), PROTOCOL, x0).parts
    assert only.leading_groups[0].final_value(x0) == 2  # p = (1, 3)/4
    assert claim.final_states == ((2, 2), (2, 2), (-2, -2)) and claim.mean == (1, 3, 0)
    for seed in range(5):
        end = played_by_shares(family, shares, np.array(x0, dtype=float), np.random.default_rng(seed))
        assert np.allclose(end, [2, 2, -2], atol=1e-9)
    assert "a, b at 2, c at -2 (these signals)" in " ".join(made.summary().split())
    assert check(made.to_dict(), stdlib=True).accepted


def test_shares_tell_between_which_values_agents_end_where_no_mean_is_kept():
    first = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", -1, -1)])
    outage = Family.from_intervals([], nodes="abc")
    shares, x0 = [Fraction(1, 2), Fraction(1, 2)], [Fraction(8), Fraction(0), Fraction(-5)]
    family = Family.switching({"on": first, "outage": outage})
    (claim,) = certify_family(family, PROTOCOL, x0, signal=ClockShares(shares)).restricted
    assert claim.mean is None and claim.final_states == ((0, 8), (0, 8), (-8, 0))
    ends = np.array(
        [played_by_shares(family, shares, np.array(x0, dtype=float), np.random.default_rng(k)) for k in range(5)]
    )
    assert np.allclose(ends[:, 0], ends[:, 1]) and np.allclose(ends[:, 0], -ends[:, 2])
    assert (ends[:, 0] > 4).all() and (ends[:, 0] < 16 / 3).all() and np.ptp(ends[:, 0]) > 1e-3


def test_shares_that_bring_agents_to_0_say_so(tmp_path: Path):
    shares = ClockShares(["0.5", "0.3", "0.2"])
    made = certify_family(with_outage("stability"), PROTOCOL, [1, 2, 3, 4], signal=shares)
    assert made.restricted[0].final_states == ((0, 0),) * 4 and made.restricted[0].mean is None
    made.save(tmp_path / "c.json")
    assert read_certificate(tmp_path / "c.json").restricted[0].final_states == ((0, 0),) * 4


def test_no_end_that_shares_do_not_prove_is_accepted(tmp_path: Path):
    day, outage = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -3)]), SignedDigraph.from_edges([], nodes="ab")
    balanced = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 3)])
    made = certify_family(Family.switching([balanced, outage]), PROTOCOL, [8, 0], signal=ClockShares(["0.5", "0.5"]))
    made.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    (one,), (other,) = made.restricted, again.restricted
    assert one.final_states == other.final_states == ((2, 2), (2, 2)) and one.mean == other.mean == (1, 3)
    assert again.to_dict() == made.to_dict()
    data = made.to_dict()
    (step,) = [k for k, step in enumerate(data["proof"]) if step["kind"] == "clock-shares"]
    wider = {"mid": "4", "radius": "4"}
    for ends, witness, accepted in (
        ({"a": "2", "b": "2"}, {"mean": {"a": "1", "b": "3"}}, True),
        ({"a": wider, "b": wider}, None, True),
        ({"a": {"mid": "4", "radius": "3"}, "b": wider}, None, False),
        ({"a": "2", "b": "2"}, None, False),
        ({"a": "4", "b": "4"}, {"mean": "equal"}, False),
        ({"a": "4", "b": "4"}, {"mean": {"a": "1", "b": "1"}}, False),
        ({"a": "0", "b": "0"}, {"mean": {}}, False),
        ({"a": "2", "b": "201/100"}, {"mean": {"a": "1", "b": "3"}}, False),
        ({"a": "2"}, {"mean": {"a": "1", "b": "3"}}, False),
        (None, {"mean": {"a": "1", "b": "3"}}, False),
        ({"a": "2", "b": "2"}, {"mean": {"a": "1", "b": "3"}, "more": 1}, False),
    ):
        forged = copy.deepcopy(data)
        for place, key, new in (
            (forged["restricted"][0], "final_state", ends),
            (forged["proof"][step], "witness", witness),
        ):
            place.pop(key)
            place |= {} if new is None else {key: new}
        assert check(resealed(forged)).accepted is accepted, (ends, witness)
    older = copy.deepcopy(data)  # files that were made before say nothing of ends
    del older["restricted"][0]["final_state"]
    assert not check(resealed(older)).accepted
    older["proof"][step]["witness"] = None
    assert not check(resealed(older)).accepted
    del older["proof"][step]["witness"]
    assert check(resealed(older)).accepted
    for place, key in (("restricted", "final_state"), ("proof", "witness")):
        null = copy.deepcopy(data)
        null[place][step if place == "proof" else 0][key] = None
        assert not check(resealed(null)).accepted, key
    stable = certify_family(
        Family.switching([day, outage]), PROTOCOL, [8, 0], signal=ClockShares(["0.5", "0.5"])
    ).to_dict()
    assert stable["restricted"][0]["final_state"] == {"a": "0", "b": "0"}
    stateless = certify_family(
        Family.switching([balanced, outage]), PROTOCOL, signal=ClockShares(["0.5", "0.5"])
    ).to_dict()
    assert "final_state" not in stateless["restricted"][0]
    stateless["restricted"][0]["final_state"] = {"a": "2", "b": "2"}
    assert not check(resealed(stateless)).accepted


def test_shares_that_are_none_are_refused():
    for wrong in (["0.5"], ["0.5", "0.6"], ["1.5", "-0.5"], ["x", "1"]):
        with pytest.raises(ParameterError):
            ClockShares(wrong)
    with pytest.raises(ParameterError, match="2 shares"):
        certify_family(with_outage("consensus"), PROTOCOL, signal=ClockShares(["0.5", "0.5"]))


def test_the_claims_of_a_certificate_are_about_the_same_signals():
    document = copy.deepcopy(of_slowed(ON_CLOCK).to_dict())
    second = copy.deepcopy(document["restricted"][0])
    second["signals"]["dwell"] = str(ON_CLOCK.least + 1)
    document["restricted"].append(second)
    own = [step for step in document["proof"] if step["of"].startswith("restricted[0]")]
    document["proof"] += [step | {"of": step["of"].replace("[0]", "[1]", 1)} for step in own]
    document["digest"] = digest(document)
    assert check(document).reason == "claims about different signals"
    second["signals"]["dwell"] = str(ON_CLOCK.least)
    document["digest"] = digest(document)
    assert check(document).accepted


def test_no_constant_member_refutes_what_shares_or_windows_are_asked_for():
    chain = Family.switching([SignedDigraph.from_edges([e], nodes="abc") for e in (("a", "b", 1), ("b", "c", -1))])
    expected = "bipartite consensus"
    for signal in (ClockShares(["1/2", "1/2"]), JointWindows(1000, on=500, clock="s")):
        (answer,) = certify_family(chain, PROTOCOL, signal=signal, expectations=expected).assessment.answers
        assert (answer.status, answer.why) == ("left open", "not decided of these signals"), signal
    (answer,) = certify_family(chain, PROTOCOL, signal="constant", expectations=expected).assessment.answers
    assert answer.status == "refuted"
    pair = [SignedDigraph.from_edges([("a", "b", w), ("b", "a", w)]) for w in (1, 100)]
    asked = Expectations(min_rate="201.99999999")
    shared = certify_family(Family.switching(pair), PROTOCOL, signal=ClockShares(["1/2", "1/2"]), expectations=asked)
    assert shared.assessment.answers[0].status != "refuted"


def test_claims_of_several_components_name_theirs():
    first = SignedDigraph.from_edges([("a", "b", 1), ("x", "z", 1)], nodes="abcxyz")
    second = SignedDigraph.from_edges([("b", "c", 1), ("y", "z", 1)], nodes="abcxyz")
    certificate = certify_family(Family.switching([first, second]), PROTOCOL, signal=JointWindows(2, on=1, clock="s"))
    lines = [fact.text for fact in signal_facts(certificate) if fact.head == "windows"]
    assert lines and all(line.startswith("component of ") for line in lines)


@pytest.mark.usefixtures("framed_figures")
def test_signals_of_which_nothing_is_claimed_stand_in_the_file(tmp_path: Path):
    family = Family.from_intervals([("a", "b", 1, 1), ("b", "a", 1, 1), ("b", "c", 0, 1), ("c", "b", 0, 1)])
    made = certify_family(family, NominalProtocol(), [1, 2, 3], signal=JointWindows(1, "0.3"))
    made.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    for certificate in (made, saved):
        assert certificate.facts()[-1].text.startswith("left open: what these signals do")
    assert saved.family_proof.signal == made.family_proof.signal
    assert write_report(tmp_path / "c.json", tmp_path / "c.html") == "left open"
    lines = check_summary(str(tmp_path / "c.json"), *read_and_check(tmp_path / "c.json"))
    assert any(line.startswith("verdict    left open") for line in lines)
