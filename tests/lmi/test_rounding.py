"""What is printed for a proved bound is a bound too: on the screen, by the check, on the page, in LaTeX, in reprs."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph
from hypothesis import given
from hypothesis import strategies as st

from lmi.exact.decimal_rounding import down, float_down, float_up, near, up
from ptcc_certify import GainLimits, NominalProtocol, SlidingModeProtocol, certify, check, read_certificate
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.examples import load_graph
from ptcc_certify.gain_design.search import design
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.report.statement import report_latex

CLASSES = dict(all_classes())
NUMBER = r"(-?[0-9.]+(?:e[-+]?[0-9]+)?)"
rationals = st.builds(
    lambda p, q, e: Fraction(p, q) * Fraction(10) ** e,
    st.integers(-(10**30), 10**30),
    st.integers(1, 10**30),
    st.integers(-320, 320),
)


# ---------------------------------------------------------------------- the two directions


@given(rationals, st.integers(1, 20))
def test_a_number_lies_between_what_is_printed_below_and_above_it(x: Fraction, digits: int):
    """By less than two units of the last digit."""
    low, high = Fraction(down(x, digits)), Fraction(up(x, digits))
    assert low <= x <= high
    assert high - low <= abs(x) * Fraction(10) ** (1 - digits)
    assert (low == high) == (low == x)


@given(st.integers(-(10**6) + 1, 10**6 - 1), st.integers(-20, 20))
def test_a_number_that_fits_is_printed_exactly(whole: int, exponent: int):
    x = whole * Fraction(10) ** exponent
    assert Fraction(down(x)) == Fraction(up(x)) == Fraction(near(x)) == x


@given(rationals)
def test_what_is_given_is_printed_exactly_or_marked(x: Fraction):
    text = near(x)
    assert Fraction(text) == x if text[0] != "~" else abs(Fraction(text[1:]) - x) <= abs(x) / 10**5


@given(rationals)
def test_floats_are_next_to_a_rational_on_the_side_that_is_asked(x: Fraction):
    low, high = float_down(x), float_up(x)
    assert low <= x <= high and high in (low, math.nextafter(low, math.inf))


# ---------------------------------------------------------------------- everything that is printed


@cache
def made(k: int) -> Certificate:
    """A certificate of a random graph, with limits and a set of initial states, or of the sliding mode."""
    rng = np.random.default_rng(k)
    graph = random_graph(rng, **{**list(CLASSES.values())[k % len(CLASSES)], "weights": "ratios"}).graph
    n = graph.n_nodes
    x0 = [Fraction(int(p), int(q)) for p, q in zip(rng.integers(-99, 99, n), rng.integers(1, 9, n), strict=True)]
    if k % 4 == 3:
        robust = SlidingModeProtocol(T_r=1, T_s=1, rho1="1/3", rho2="5/7", kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
        return certify(graph, robust, InitialState(x0, sigma0=[x / 3 for x in x0]), asks=Asks(simulation=False))
    protocol = NominalProtocol(T="7/3", rho1="1/3", rho2=["1/7", "3/2", 9][k % 3], kappa=1)
    more: dict[str, Any] = {"initial_set": "1/3"} if k % 5 == 1 else {}
    limits = [GainLimits(gain_cap="100/3"), GainLimits(stop_before="1/7")]
    return certify_words(graph, protocol, x0, limits=limits, delta="1/3", noise="1/7", simulation=False, **more)


#: By default one of each protocol, each gain, and with a set of starts.
GRAPHS = [pytest.param(k, marks=() if k in (3, 6, 14, 25) else pytest.mark.campaign) for k in range(28)]


def above(texts: list[str], exact: Any) -> None:
    assert texts and all(Fraction(text) >= exact for text in texts), (texts, float(exact))


def below(texts: list[str], exact: Any) -> None:
    assert texts and all(Fraction(text) <= exact for text in texts), (texts, float(exact))


@pytest.mark.parametrize("k", GRAPHS)
def test_the_screen_rounds_to_the_safe_side(k: int):
    cert = made(k)
    text = "\n".join(certificate_lines(cert, "graph"))
    if cert.rate is None:
        return
    assert cert.upper_bound is not None and cert.effort is not None
    below(re.findall(rf"^rate +{NUMBER} per unit", text, re.M), cert.rate)
    below(re.findall(rf"rate {NUMBER}\)", repr(cert)), cert.rate)
    above(re.findall(rf"upper bound {NUMBER}, proved", text), cert.upper_bound)
    below(
        re.findall(rf"optimality ratio at least {NUMBER}$", text.replace(" (", "\n("), re.M),
        cert.rate / cert.upper_bound,
    )
    if cert.paper_rate is not None and cert.lyapunov is not None:
        below(re.findall(rf"paper {NUMBER} =", text), cert.paper_rate)
        above(re.findall(rf"overshoot constant {NUMBER} of", text), cert.lyapunov.overshoot)
    taken = re.findall(rf"(?:full|lmi|perron) {NUMBER} \(overshoot {NUMBER}\)", text)
    assert len(taken) == len(cert.search.functions)
    for (rate, factor), function in zip(taken, cert.search.functions, strict=True):
        below([rate], function.rate)
        above([factor], function.overshoot)
    effort = cert.effort
    lower = re.findall(rf"min Re lambda >= {NUMBER}", text)
    assert not lower or effort.threshold[0] is None or Fraction(lower[0]) <= effort.threshold[0]
    for pattern, bound in (
        (
            rf"^(?:effort|input).*\|u_k\| <= {NUMBER}, (?:\|\|u|the largest)",
            None if effort.peak is None else effort.peak.largest,
        ),
        (rf"^effort.*\|\|u\|\| <= {NUMBER}", None if effort.peak is None else effort.peak.norm),
        (rf"\^2 dt <= {NUMBER}", None if effort.energy is None else effort.energy.value),
        (rf"\|\|u\|\| dt <= {NUMBER}", None if effort.path_length is None else effort.path_length.value),
        (rf"adds at most {NUMBER}", None if effort.disturbed is None else max(effort.disturbed.inputs)),
    ):
        if bound is not None:
            above(re.findall(pattern, text, re.M), bound)
    limited = text.partition("\nlimited")[2].splitlines()[:: 2 if cert.noise else 1]  # between them those of noise
    for line, entry in zip(limited, effort.residual, strict=False):
        above(re.findall(rf"\|\|E\|\| <= {NUMBER}", line), entry.norm)
        assert entry.largest is None or Fraction(re.findall(rf"\|u_k\| <= {NUMBER}", line)[0]) >= entry.largest
    if cert.direct:
        left = re.findall(rf"{NUMBER} at (?:0\.|T\()", re.findall(r"^ .*\(0\)\|\| at most .*$", text, re.M)[0])
        for said, q in zip(left, (0.5, 0.1, 0.01, 1e-6, 1e-9), strict=True):
            assert Fraction(said) >= Fraction(cert.envelope.residual(q))
    for r, said in zip(cert.reaching or (), map(repr, cert.reaching or ()), strict=True):
        if r.z is not None:
            time, remaining = re.findall(NUMBER, said)
            assert Fraction(time) >= Fraction(r.time) and Fraction(remaining) <= Fraction(r.remaining)


@pytest.mark.parametrize("k", GRAPHS)
@pytest.mark.parametrize("stdlib", [True, False])
def test_the_check_rounds_to_the_safe_side(k: int, stdlib: bool):
    """Rates, margins and ends down; prefactors, constants and bounds of the input up."""
    data = made(k).to_dict()
    report = check(data, stdlib=stdlib)
    assert report.accepted
    functions, effort, rates = data["decays"], data["input"], data["rates"]
    for step, told in zip(report.obligations, data["proof"], strict=True):
        said, numbers = step.detail, {key: Fraction(x) for key, x in told.get("numbers", {}).items()}
        which = re.search(r"decays\[(\d+)\]", step.of)
        function = functions[int(which[1])] if which else None
        if "b" in numbers:
            below(re.findall(rf"^b = {NUMBER}", said), numbers["b"])
        if "m" in numbers:
            below(re.findall(rf"^m = {NUMBER}", said), numbers["m"])
        if step.kind == "margin":
            below(re.findall(rf", rate {NUMBER}", said), Fraction(rates["paper"]))
        if step.kind == "rho-interval":
            for name, way in (("printed", "as printed"), ("exact", "exactly")):
                below(re.findall(rf"<= {NUMBER} {way}", said), numbers[name])
        if step.kind == "overshoot" and function is not None:
            above(re.findall(NUMBER, said), Fraction(function["overshoot"]))
        if step.kind == "deviation" and function is not None:
            above(re.findall(NUMBER, said), Fraction(function["deviation"]["norm"]))
        if step.kind in ("rate-upper-bound", "rate-mean"):
            above(re.findall(NUMBER, said), Fraction(rates["upper_bound"]))
        for kind, key in (("input-energy", "energy"), ("input-length", "path_length")):
            if step.kind == kind:
                above(re.findall(NUMBER, said), Fraction(effort[key]))
        if step.kind == "input-peak":
            above(re.findall(rf"at most {NUMBER},", said), Fraction(effort["peak"]["largest"]))
            above(re.findall(rf"norm {NUMBER}", said), Fraction(effort["peak"]["norm"]))
        if step.kind == "limited-gain":
            above(re.findall(rf"at most {NUMBER} at", said), Fraction(effort["residual"][int(step.of[-2])]["norm"]))


def _row_of_table(text: str, name: str) -> list[str]:
    """The numbers of a row of the statement's table of bounds."""
    rows: list[str] = re.findall(rf"^{name}_\{{i\}} &(.*?)(?:\\\\)? *$", text, re.MULTILINE)
    return [number for row in rows for number in re.findall(NUMBER, row)]


@pytest.mark.few(2)
@pytest.mark.parametrize("k", GRAPHS)
def test_page_and_statement_round_to_the_safe_side(k: int, tmp_path: Path):
    cert = made(k)
    cert.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    if saved.rate is None or saved.effort is None or saved.upper_bound is None or saved.overshoot is None:
        return
    below(re.findall(rf"rate {NUMBER}\)", repr(saved)), saved.rate)
    page = re.sub(r"\s\u00d7\s10<sup>(.*?)</sup>", r"e\1", report_html(saved)).replace("\u2212", "-")
    text = re.sub(r" \\cdot 10\^\{(.*?)\}", r"e\1", report_latex(saved))
    text = re.sub(r"\s*\\cdot\s*10\^\{(.*?)\}", r"e\1", text)

    below(re.findall(rf"{NUMBER} per unit of the stretched clock s, proved", page), saved.rate)
    above(re.findall(rf"upper bound {NUMBER}, proved", page), saved.upper_bound)
    below(re.findall(rf"optimality ratio at least {NUMBER}(?:<| )", page), saved.rate / saved.upper_bound)
    above(re.findall(rf"overshoot constant at that rate {NUMBER} of", page), saved.overshoot)
    above(re.findall(rf"upper bound \${NUMBER}\$, proved", text), saved.upper_bound)
    rates = re.findall(rf"e\}}\^\{{-{NUMBER}\\,", text) or _row_of_table(text, "r")
    constants = re.findall(rf"\^2 \\le {NUMBER}\\,", text) or _row_of_table(text, "c")
    below(rates, saved.rate)
    shown = [V for V in saved.envelope.functions if V.coordinates == saved.envelope.coordinates]
    assert constants and len(constants) == len(rates)
    for c, rate in zip(map(Fraction, constants), map(Fraction, rates), strict=True):
        assert any(V.overshoot <= c and rate <= V.proved_rate for V in shown), (c, rate)
    if saved.effort.energy is not None:
        above(re.findall(rf"<sup>2</sup> dt \u2264 {NUMBER}", page)[:1], saved.effort.energy.value)
    if saved.effort.peak is not None:
        end = r", (?:\u2016u\u2016|the largest of agent)"  # the second where no limits are asked for
        above(re.findall(rf"\|u<sub>k</sub>\| \u2264 {NUMBER}{end}", page), saved.effort.peak.largest)


def test_the_rate_of_the_readme_is_not_rounded_up():
    """13.9985999972 is proved, where 13.9986 was printed."""
    cert = certify(
        load_graph("fig3a"), NominalProtocol(T="0.6", rho1="0.2", rho2="0.5", kappa=1), asks=Asks(simulation=False)
    )
    assert cert.rate is not None and cert.checked is not None and cert.rate < Fraction("13.9986")
    best = [step.detail for step in cert.checked.obligations if step.detail.startswith("b = 13.9")]
    assert best and all(detail.startswith("b = 13.9985") for detail in best)


def test_a_reaching_time_is_rounded_up():
    z = Fraction(1, 3)  # t = 1 - e^(-1/3) = 0.28346868942...
    assert repr(ReachingTime(Fraction(1), z)) == "ReachingTime(0.283469, 0.716 before T_r)"
    assert repr(ReachingTime(Fraction(1, 3), None)) == "ReachingTime(T_r = 1/3)"


def test_a_design_is_rounded_to_the_safe_side():
    """Peaks and certified deadlines up, what no gains can undercut down; the curve likewise."""
    found = design(load_graph("fig1a"), max_input="31/3", initial_bound="7/9")
    text = found.summary()
    assert found.peak is not None and found.shortest_certified is not None and found.shortest_possible is not None
    above(re.findall(rf"^proved +.u_k. <= {NUMBER}, every", text, re.M), found.peak)
    above(re.findall(rf"^deadline +{NUMBER} is met", text, re.M), found.shortest_certified)
    below(re.findall(rf"no gains meet one below {NUMBER}$", text, re.M), found.shortest_possible)
    assert found.product is not None and found.lower_product is not None
    for T, peak, low in zip(*found.trade_off([0.1, 1 / 3, 7.7]), strict=True):
        assert Fraction(float(peak)) * Fraction(float(T)) >= found.product
        assert Fraction(float(low)) * Fraction(float(T)) <= found.lower_product
