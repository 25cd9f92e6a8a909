"""The verdict line tells what a certificate is worth and what became of what was asked; the exit code agrees."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from bad_inputs import detailed, ptcc
from generators import all_classes, random_graph
from selection import thinned

from ptcc_certify import (
    Expectations,
    GainLimits,
    NominalProtocol,
    SignedDigraph,
    SlidingModeProtocol,
    analyse,
    box,
    certify,
    ellipsoid,
    read_certificate,
)
from ptcc_certify.bounds.input.initial_sets import initial_set_within
from ptcc_certify.certificate.assessment import exit_code, worst_code
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.usefulness import LAST
from ptcc_certify.errors import Change
from ptcc_certify.examples import load_graph
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.report.statement import report_latex

pytestmark = pytest.mark.usefixtures("quick_search")

CLASSES = dict(all_classes())
WEAK = {"rho1": "0.1", "rho2": "0.05", "kappa": 2}


@cache
def weak(k: int, sliding: bool = False) -> Certificate:
    """A random graph under gains that are too small."""
    rng = np.random.default_rng(k)
    graph = random_graph(rng, **{**list(CLASSES.values())[k % len(CLASSES)], "weights": "decimals"}).graph
    x0 = rng.integers(-9, 9, graph.n_nodes).tolist()
    if sliding:
        robust = SlidingModeProtocol(T_r=1, T_s="0.5", mu1=2, mu2=1, mu3=1, delta=1, **WEAK)
        return certify(graph, robust, InitialState(x0, sigma0=[1] * graph.n_nodes), asks=Asks(simulation=False))
    return certify(graph, NominalProtocol(T=1, **WEAK), x0, asks=Asks(simulation=False))


# ---------------------------------------------------------------------- usefulness


@pytest.mark.few(0)
@pytest.mark.parametrize(("k", "sliding"), thinned([(k, k % 3 == 0) for k in range(1, 11)], 2))
def test_the_gains_that_are_named_leave_one_percent_and_bound_the_input(k: int, sliding: bool):
    """Certified with what the line says, nothing else changed, at most a hundredth is left, of a bounded input."""
    cert = weak(k, sliding)
    found = cert.assessment
    assert cert.verdict == "certified" and found.useful is False
    said = re.search(r"rho2=(\S+) leaves 1 %( and bounds the input)?$", found.text)
    assert said is not None, found.text
    assert bool(said[2]) == ("; the input is not " in found.text) == (cert.effort.bounded is not True)
    assert found.advice[0] == Change("rho2", Fraction(said[1])) and Fraction(said[1]) > cert.protocol.rho2
    p = {name: getattr(cert.protocol, name) for name in cert.protocol.to_dict() if name not in ("kind", "disturbance")}
    protocol = type(cert.protocol)(**{**p, "rho2": said[1]})
    again = certify(
        cert.graph, protocol, InitialState(cert.initial_state, sigma0=cert.sigma0), asks=Asks(simulation=False)
    )
    assert again.assessment.useful and again.assessment.exit_code == 0
    assert again.effort.bounded and not (again.assessment.caveat or again.assessment.advice)
    left = re.search(r"\|\| <= (\S+) \|\|", again.assessment.text)
    assert left is not None and float(left[1]) <= 0.01


def test_a_sliding_part_that_is_not_bounded_is_told_with_the_gain_that_bounds_it():
    def found(mu3: str) -> Any:
        p = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 2, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": mu3, "delta": 1}
        return certify(
            PAIR, SlidingModeProtocol(**p), InitialState([1, 3], sigma0=[5, -5]), asks=Asks(simulation=False)
        ).assessment

    weak_gain = found("0.3")
    assert weak_gain.text.endswith("; the input is not proved bounded; mu3=0.334 bounds the input")
    assert weak_gain.exit_code == 0 and not found("0.334").caveat


def test_a_bound_that_is_certified_and_says_nothing_is_not_called_certified_alone():
    """The bound of the error at T(1 - 1e-9) is above the error at the start, and the verdict was `certified`."""
    slow = certify(
        load_graph("fig5b"), NominalProtocol(T=1, rho1="0.01", rho2="0.001", kappa=1), asks=Asks(simulation=False)
    )
    assert slow.verdict == "certified" and slow.envelope.residual(1e-9) > 0.9
    assert slow.assessment.text.startswith("certified, but with these gains the bound says little by T: ||E|| <= ")
    assert slow.assessment.exit_code == 0 and slow.to_dict()["verdict"] == "certified"
    assert "says little" in certificate_lines(slow, "fig5b")[0]
    assert str(slow).startswith("Certificate(certified, but says little by T; the input is not bounded; rho2=")


def test_what_is_useful_is_stated_and_true():
    cert = certify(load_graph("fig1a"), NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), asks=Asks(simulation=False))
    said = re.fullmatch(r"certified; \|\|E\|\| <= (\S+) \|\|E\(0\)\|\| at 0.99 T", cert.assessment.text)
    assert said is not None and cert.envelope.residual(float(LAST)) <= float(said[1]) <= 0.01


@pytest.mark.few(0)
def test_a_bound_is_useful_too_if_no_agent_has_more_than_a_hundredth_of_the_longest_way_left():
    """Of ``||E||`` from any start more may be left than of the way of the last of a chain, who alone has one."""
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1), ("c", "d", 1)])
    found = []
    for rho2 in ("0.6", 1, 2):
        cert = certify(
            graph, NominalProtocol(T=1, rho1=1, rho2=rho2, kappa=1), [0, 0, 0, 1], asks=Asks(simulation=False)
        )
        way, left = cert.longest_way, float(cert.deviation_bound([float(LAST)]).max())
        assert way is not None
        assert cert.assessment.useful == (cert.envelope.residual(float(LAST)) <= 0.01 or left <= 0.01 * way)
        found.append(cert.assessment.text)
    assert any("every agent within" in text for text in found)
    assert any("says little" in text for text in found) and any("||E(0)||" in text for text in found)


def test_agents_that_do_not_move_are_certified_whatever_the_gains():
    still = certify(SignedDigraph.from_edges([], ["a", "b"]), NominalProtocol(T=1, **WEAK), [1, 2])
    assert still.assessment.text == "certified; nothing to decay" and still.assessment.exit_code == 0


# ---------------------------------------------------------------------- expectations


ASKED = {
    "met": {"behaviour": "stability", "min_rate": Fraction(9), "max_input": Fraction(1000)},
    "refuted": {"behaviour": "consensus", "min_rate": Fraction(10), "max_input": Fraction(1, 100)},
    "left open": {"min_rate": Fraction("9.0437"), "max_input": Fraction(900)},
}


@cache
def strong() -> Certificate:
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    return certify(load_graph("fig1a"), protocol, [9, -8, 7, -6, 5, 4], asks=Asks(simulation=False))


@pytest.mark.usefixtures("every_class")
@pytest.mark.parametrize("rate", ["met", "refuted", "left open", None])
@pytest.mark.parametrize("most", ["met", "refuted", "left open", None])
@pytest.mark.parametrize("behaviour", ["met", "refuted", None])
def test_what_was_asked_is_in_the_line_and_the_exit_code_agrees(
    behaviour: str | None, rate: str | None, most: str | None
):
    peak = strong().effort.peak.largest  # type: ignore[union-attr]
    wanted = {"behaviour": behaviour, "min_rate": rate, "max_input": most}
    asked = {key: ASKED[status][key] for key, status in wanted.items() if status is not None}
    if most in ("met", "left open"):
        asked["max_input"] = peak if most == "met" else peak * Fraction(99, 100)
    found = strong().changed(expectations=Expectations(**asked)).assessment
    statuses = {status for status in wanted.values() if status}
    assert {answer.status for answer in found.answers} == statuses and len(found.answers) == len(asked)
    worst = next((s for s in ("refuted", "left open") if s in statuses), None)
    assert found.exit_code == {"refuted": 3, "left open": 4, None: 0}[worst]
    assert found.text.startswith(f"{worst or ('met' if statuses else 'certified')}") and "certified" in found.text
    for answer in found.answers:
        before = found.text[: found.text.index(answer.what)]
        assert re.findall("met:|refuted:|left open:", before)[-1] == f"{answer.status}:"
    assert found.word == (worst or "certified")


def test_codes_are_worst_first():
    assert exit_code(True, True, True) == 1 and exit_code(False, True, True) == 3 and exit_code(False, False, True) == 4
    assert worst_code([4, 0, 1, 3]) == 1 and worst_code([0, 4]) == 4 and worst_code([]) == 0


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("options", "code", "says"),
    thinned(
        [
            (("--gain-cap", "20", "--sample-period", "0.5"), 4, "left open: limits (certified with a period of 0.00"),
            (("--sample-period", "0.5"), 4, "left open: limits (certified with a period of 6.4"),
            (("--noise", "1"), 4, "left open: noise (without a limit it meets an infinite gain"),
            (("--delta", "1", "--rho2", "0.01"), 4, "left open: delta (the rate proves no bounded input)"),
            (("--gain-cap", "20"), 0, "certified; "),
            (
                ("--gain-cap", "20", "--noise", "1", "--delta", "1"),
                0,
                "certified without disturbances, but with these gains the bound says little",
            ),
            (
                ("--gain-cap", "0.001"),
                0,
                "certified, but with these gains the bound says little by T: under the limits",
            ),
            (
                ("--stop-before", "0.9", "--initial-bound", "2"),
                0,
                "certified, but with these gains the bound says little",
            ),
            (
                ("--expect", "consensus", "--min-rate", "9.0438"),
                3,
                "refuted: consensus (it is stability); left open: rate",
            ),
        ],
        2,
    ),
)
def test_an_expectation_that_is_not_met_is_in_the_verdict_line(options: tuple[str, ...], code: int, says: str):
    run = detailed("certify", "fig1a", "--no-simulation", *options)
    assert run.code == code and run.out.splitlines()[0].startswith(f"verdict    {says}"), run.out
    assert run.err == ""
    told = ptcc("certify", "fig1a", "--no-simulation", "--json", *options)
    assert told.code == code and (f"verdict    {says}" in told.err) == bool(code)


# ---------------------------------------------------------------------- what to try next


FAR = [("a", "b", "1e300"), ("b", "a", "1e300"), ("b", "c", "1e-300"), ("c", "d", "-1e300"), ("d", "c", "1e-300")]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("graph", "method", "says"),
    [
        (
            FAR,
            "best",
            "no rate is proved, weights span 600 decades: rescale them, or leave out the smallest",
        ),
        ([(i, (i + 1) % 130, 1) for i in range(130)], "full", "method=full proves no rate; try method=best"),
        ([(i, (i + 1) % 130, 1) for i in range(130)], "paper", "method=paper proves no rate; try method=best"),
    ],
)
def test_where_nothing_is_decided_it_says_what_to_try(graph: Any, method: str, says: str):
    cert = certify(SignedDigraph.from_edges(graph), strong().protocol, asks=Asks(method=method, simulation=False))
    assert cert.assessment.text == f"undecided: {says}"
    assert cert.assessment.exit_code == 4 and cert.assessment.useful is None


# ---------------------------------------------------------------------- page, statement, notebook, file


@pytest.mark.few(0)
def test_page_statement_and_notebook_say_the_same(tmp_path: Path):
    """With what was asked; the page of a bound that says little is not green."""
    asked = Expectations("stability", Fraction(10), Fraction(10**6))
    protocol = NominalProtocol(T="0.6", rho1="0.1", rho2="0.01", kappa=1)
    weak = certify(load_graph("fig1a"), protocol, [1] * 6, asks=Asks(noise=1, expectations=asked, simulation=False))
    weak.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    assert saved.expectations == asked and saved.assessment == weak.assessment
    assert saved.assessment.text.startswith("refuted: rate >= 10 (upper bound 9.04416")
    page, text = report_html(saved), report_latex(saved)
    assert '<div class="verdict doubt">' in page and "says little by T" in page and "refuted: rate ≥ 10" in page
    assert "\n% With these gains the bound says little by the deadline.\n" in text  # an opinion, for who edits the text
    assert "says little by T" in weak._repr_html_() and "refuted: rate" in weak._repr_html_()
    assert repr(weak).startswith("Certificate(refuted: rate >= 10 (upper bound 9.04416")
    strong().save(tmp_path / "d.json")
    fine = read_certificate(tmp_path / "d.json")
    assert '<div class="verdict good">' in report_html(fine) and "says little" not in report_latex(fine)


@pytest.mark.parametrize("asked", [None, 3, [], {"min_rate": []}, {"limits": 5, "behaviour": "x", "max_input": "-1"}])
def test_what_a_file_says_was_asked_need_not_be_sound(asked: Any, tmp_path: Path):
    """It is no part of the claim."""
    document = strong().to_dict()
    document["unverified"]["asked"] = asked
    (tmp_path / "c.json").write_text(json.dumps(document))
    saved = read_certificate(tmp_path / "c.json")
    assert saved.expectations == Expectations() and saved.assessment.exit_code == 0


def test_lines_are_short():
    assert all(len(weak(k, k % 3 == 0).assessment.text) <= 200 for k in range(1, 10, 2))
    assert len(certificate_lines(strong(), "fig1a")[0]) <= 80


# ---------------------------------------------------------------------- what is left under limits of the gain

PAIR = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
GAINS = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)


def limited(x0: Any = None, graph: SignedDigraph = PAIR, protocol: NominalProtocol = GAINS, **more: Any) -> Any:
    return certify_words(graph, protocol, x0, simulation=False, **more).assessment


def test_what_is_left_of_states_beyond_the_squares_of_floats_is_right():
    shares = [
        limited(x0, limits=[GainLimits(gain_cap="0.01")]) for x0 in ([1, 3], ["1e-200", "3e-200"], ["1e200", "3e200"])
    ]
    assert len({found.remark for found in shares}) == 1
    assert shares[0].useful is False and "||E|| <= 0.99 ||E(0)|| at T" in shares[0].remark


def test_noise_from_the_final_state_is_not_a_share_of_nothing():
    found = limited([1, 1], limits=[GainLimits(gain_cap=10)], noise="0.1")
    assert found.useful is False and "||E|| <= 0.29 at T" in found.remark


@pytest.mark.few(0)
@pytest.mark.parametrize("followers", thinned([40, 100], 2))
def test_of_a_set_no_share_is_stated_that_single_states_exceed(followers: int):
    hub = SignedDigraph.from_edges([(1, 2, 1), *((2, 3 + k, 10) for k in range(followers))])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa="3.3")
    found = limited(
        None, hub, protocol, initial_set=initial_set_within(analyse(hub), 1), limits=[GainLimits(gain_cap="4.5")]
    )
    assert "||E(0)||" not in found.remark and "from all these initial states" in found.remark


@pytest.mark.few(0)
@pytest.mark.parametrize("size", ["0.01", "1000", "1e200"])
def test_the_verdict_on_a_set_does_not_hang_on_another_start(size: str):
    sets = initial_set_within(analyse(PAIR), size)
    assert limited([7, 3], initial_set=sets, limits=[GainLimits(gain_cap="0.01")]).useful is False
    assert limited([7, 3], initial_set=sets, limits=[GainLimits(gain_cap="100")]).useful is True


@pytest.mark.parametrize("region", [box([1, 1], [1, 1]), ellipsoid([1, 1], [[1, 1]])])
def test_an_unbounded_input_from_a_thin_set_is_not_called_proved(region: Any):
    weak_gains = NominalProtocol(T=1, rho1=1, rho2="1/10", kappa=1)
    asked = Expectations(max_input=Fraction(100))
    found = limited(None, protocol=weak_gains, initial_set=region, expectations=asked)
    assert found.exit_code == 4 and "refuted" not in found.text
    solid = limited(None, protocol=weak_gains, initial_set=box([0, 0], [2, 1]), expectations=asked)
    assert solid.exit_code == 3 and "without limit, proved" in solid.text


def test_disturbances_are_not_counted_and_it_says_so():
    for limits in ([], [GainLimits(gain_cap=20)]):
        assert limited([1, 3], limits=limits, delta=1).text.startswith("certified without disturbances; ")


def test_noise_that_nobody_hears_is_no_open_question():
    alone = SignedDigraph.from_edges([], nodes=["a", "b"])
    assert limited([1, 2], alone, limits=[GainLimits(gain_cap=5)], noise="0.1").exit_code == 0
