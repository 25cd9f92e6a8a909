"""Facts about kept means, several groups, restricted signals and pages of families under the sliding-mode protocol."""

import copy
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from asked import certify_family
from common_kernel_families import random_family

from ptcc_certify.certificate.certificate import read_certificate
from ptcc_certify.certificate.runs_against_bounds import compare
from ptcc_certify.checker import check, digest
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows
from ptcc_certify.report.page import report_html
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.report.statement import report_latex
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import RandomSignal

PROTOCOL = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
PATH = Family.from_intervals([("a", "b", 1, 2), ("b", "c", -3, -1)], undirected=True)
DISTURBANCES = ("worst-case", "sin(20*k*t)", "1")


@cache
def of_path():
    return certify_family(PATH, PROTOCOL, [3, 1, 2], sigma0=[1, -2, 0], time_limit=60)


def runs(certificate, played=3, **options):
    start, sigma0 = ([float(x) for x in state] for state in (certificate.initial_state, certificate.sigma0))
    for k in range(played):
        more = {"sigma0": sigma0, "disturbance": DISTURBANCES[k % 3], "past": 0, **options}
        yield simulate(certificate.family, certificate.protocol, start, RandomSignal(k), **more)


@pytest.mark.few(0)
def test_means_that_every_signal_keeps_are_those_of_x_minus_sigma():
    x0, sigma0 = [3, 1, 2], ["1", "-2", "1/2"]
    certificate = certify_family(PATH, PROTOCOL, x0, sigma0=sigma0, time_limit=60)
    mean = Fraction(2 + 3, 3) - Fraction(3, 2) / 3
    assert certificate.final_state == ((mean, mean), (mean, mean), (-mean, -mean))
    assert certificate.checked.accepted
    for run in runs(certificate):
        assert np.allclose(run.final_state, [float(low) for low, _ in certificate.final_state], atol=1e-5)
        assert not compare(certificate, run).violated


def test_a_mean_of_x_in_place_of_x_minus_sigma_is_refused():
    certificate = of_path()
    data = certificate.to_dict()
    assert check(data).accepted
    low = Fraction(3 + 1 - 2, 3)
    data["final_state"] = {"a": str(low), "b": str(low), "c": str(-low)}
    assert check(data | {"digest": digest(data)}).reason == "a final state is not enclosed"


@pytest.mark.few(0)
def test_groups_and_followers_end_within_what_is_proved():
    rng = np.random.default_rng(11)
    for n in (4, 5):
        family = random_family(rng, "containment", n, 2, Fraction(1, 5), 0.3)
        sigma0, x0 = (rng.integers(-6, 7, n).tolist() for _ in range(2))
        certificate = certify_family(family, PROTOCOL, x0, sigma0=sigma0, time_limit=60)
        assert certificate.checked.accepted
        for run in runs(certificate, 2):
            assert not compare(certificate, run).violated


def test_narrower_ends_than_sliding_variables_leave_are_refused():
    family = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 3), ("b", "c", 1, 2)])
    certificate = certify_family(family, PROTOCOL, [5, 6, 3], sigma0=[9, 8, 1], time_limit=60)
    data = certificate.to_dict()
    assert check(data).accepted
    y = [Fraction(5) - 9, Fraction(6) - 8]
    assert certificate.final_state[0][1] > max(y)
    ends = {"mid": str((y[0] + y[1]) / 2), "radius": str((y[1] - y[0]) / 2)}
    data["final_state"] = dict.fromkeys(data["final_state"], ends)
    assert not check(data | {"digest": digest(data)}).accepted


LED = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", -2, -1)])


@cache
def of_led(sigma0):
    return certify_family(LED, PROTOCOL, [3, 1, 2], sigma0=sigma0, time_limit=60)


@pytest.mark.few(0)
@pytest.mark.parametrize("sigma0", [(0, 0, 0), (1, -2, 3)])
def test_inputs_are_below_their_curve(sigma0):
    certificate = of_led(sigma0)
    played = list(runs(certificate))
    for run in played:
        own = run.remaining > 1e-3
        bound = certificate.input_bound(run.remaining[own])
        assert (np.abs(run.input[:, own]) <= bound * (1 + 1e-6) + 1e-6).all()
    first = certificate.input_bound([1.0])[:, 0]
    assert (first <= [float(x) * (1 + 1e-9) for x in certificate.input_peaks]).all()
    assert "proved peak" in plot_input(certificate, runs=played).texts[0].get_text()


def test_where_the_sliding_part_may_grow_there_is_no_curve_of_the_input():
    gains = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": "0.1", "delta": 1}
    certificate = certify_family(PATH, SlidingModeProtocol(**gains), [3, 1, 2], sigma0=[1, 0, 2], time_limit=60)
    assert certificate.bounded and certificate.input_peaks is None
    assert np.isinf(certificate.input_bound([1.0, 0.3])).all()
    assert np.isfinite(certificate.deviation_bound([1.0, 0.3])).all()


@pytest.mark.parametrize(
    "signal",
    [DwellTime("0.3", clock="t"), JointWindows(2, on="0.3", clock="s"), ClockShares(["1"])],
    ids=["dwell", "windows", "shares"],
)
def test_restricted_signals_are_for_the_nominal_protocol(signal):
    with pytest.raises(ParameterError, match="restricted signals are certified under the nominal protocol; leave out"):
        certify_family(PATH, PROTOCOL, [3, 1, 2], signal=signal)


@pytest.mark.few(0)
@pytest.mark.parametrize("sigma0", [(0, 0, 0), (1, -2, 3)])
def test_a_file_that_adds_restricted_signals_is_refused(sigma0):
    nominal = NominalProtocol(T=2, rho1=1, rho2=1, kappa=3)
    told = certify_family(LED, nominal, [3, 1, 2], signal="constant", time_limit=60).to_dict()
    data = of_led(sigma0).to_dict()
    assert told["restricted"] and check(told).accepted and check(data).accepted
    data["restricted"] = told["restricted"]
    data["proof"] += [step for step in told["proof"] if step["of"].startswith("restricted")]
    report = check(data | {"digest": digest(data)})
    why = "while sliding variables move" if any(sigma0) else "under the sliding-mode protocol"
    assert not report.accepted and f"restricted signals {why}" in str(report.reason)


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_pages_and_statements_say_what_slides(tmp_path):
    made = of_path()
    made.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    assert saved == made == copy.deepcopy(saved) and saved.upper_bound == made.upper_bound
    assert saved.sigma0 == made.sigma0 and saved.reaching == made.reaching
    page, statement = report_html(saved), report_latex(saved)
    assert "Sliding-mode protocol" in page and "Reaching times" in page and "nominal protocol," not in page
    assert "every signal and disturbance" in page and "signed average of the initial states" not in page
    assert r"\dot x_{k} = u_{k} + d_{k}$ with $|d_{k}| \le \delta$" in statement and "V(X(T_{r}))" in statement
    assert "whatever the disturbances" in statement and "All sliding variables are $0$ from" in statement
    assert "the mean of the initial states" not in statement
    text = "\n".join(certificate_lines(saved, "path", {}))
    assert "sigma(0)" in text and "for every signal and disturbance" in text
    certify_family(PATH, PROTOCOL, sigma0=[1, -2, 0], time_limit=60).save(tmp_path / "d.json")
    assert "V(T<sub>r</sub>)" in report_html(read_certificate(tmp_path / "d.json"))
