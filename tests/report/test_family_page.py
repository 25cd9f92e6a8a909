"""Facts about the page and the statement of a family: what they say is what is certified, and a refutation is drawn."""

import math
import re
from dataclasses import replace
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from selection import thinned

from ptcc_certify import (
    Expectations,
    Family,
    NominalProtocol,
    SignedDigraph,
    SlidingModeProtocol,
    certify,
    read_certificate,
)
from ptcc_certify.errors import ParameterError, unlabelled
from ptcc_certify.graphs.io import as_family
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows
from ptcc_certify.report.facts.claim import groups_text
from ptcc_certify.report.page import report_html
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.plots.runs_under_signals import sample_runs
from ptcc_certify.report.plots.trajectory import plot_trajectory
from ptcc_certify.report.report_file import write_report
from ptcc_certify.report.screen import certificate_lines, summary_lines
from ptcc_certify.report.statement import report_latex
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import RandomSignal
from ptcc_certify.theorems.family_behaviour import decide

pytestmark = pytest.mark.usefixtures("quick_search")


@pytest.fixture(autouse=True)
def words_alone(request: pytest.FixtureRequest) -> None:
    """Figures are written out in the test of the first screen alone."""
    if "first_screen" not in request.node.name:
        request.getfixturevalue("framed_figures")


PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
DAY = SignedDigraph.from_edges([("ann", "<b>", 1), ("<b>", "eve", -1)])
NIGHT = SignedDigraph.from_edges([("eve", "ann", -2), ("ann", "<b>", 1)])
SWITCHING = Family.switching({"day": DAY, "night": NIGHT})
UNSURE = Family.from_graph(DAY, optional=[("<b>", "eve")])


@pytest.fixture(scope="module")
def made():
    return certify(SWITCHING, PROTOCOL, [3, 1, 2])


def words(page):
    text = re.sub(r"(?s)<style>.*?</style>|<svg.*?</svg>", "", page)
    return " ".join(re.sub("</?bdi>|(<[^>]*>)", lambda tag: " " if tag[1] else "", text).split())


@pytest.mark.few(0)
def test_the_first_screen_tells_family_signal_end_rate_bound_ratio_and_input(made, tmp_path):
    made.save(tmp_path / "c.json")
    assert write_report(tmp_path / "c.json", tmp_path / "c.html", day=date(2026, 1, 1)) == "certified"
    page = (tmp_path / "c.html").read_text("utf-8")
    first = words(page.partition("<nav")[0])
    for told in (
        "bipartite consensus at T = 1 for every signal: camps {ann, &lt;b&gt;} against {eve}",
        "ann, &lt;b&gt; in [−2, 3], eve in [−3, 2]",
        "upper bound",
        "bounded; |u k | ≤",
        "c.json ; this page was written on 2026-01-01",
    ):
        assert told in first, told
    assert {f'id="figure-{name}"' in page for name in ("graph", "states", "decay", "input")} == {True}
    assert "<script" not in page and "<b>" not in page
    assert "The bounds are kept" in words(page)


@pytest.mark.few(0)
def test_what_is_proved_of_restricted_signals_is_told_too():
    saved = read_certificate(certify(SWITCHING, PROTOCOL, signal=DwellTime("0.2", clock="t")).to_dict())
    told = "t least 0.2 of time between switches"
    page = words(report_html(saved))
    assert f"If signals are restricted a{told}: rate " in page and f"signals that keep a promise: a{told}" in page
    assert "holds for signals that keep the promise alone" in page
    assert rf"\item If signals are restricted: a{told.replace('0.2', '$0.2$')}: rate $" in report_latex(saved)


@pytest.mark.parametrize("signal", [ClockShares(["0.7", "0.3"]), JointWindows(2, on=1, clock="s")], ids=repr)
def test_agents_that_leave_where_they_begin_are_not_told_to_stay_where_they_end(signal):
    family = Family.switching(
        [SignedDigraph.from_edges(edges, nodes="ab") for edges in ([("a", "b", 1), ("b", "a", 2)], [])]
    )
    saved = read_certificate(certify(family, PROTOCOL, [1, 5], signal=signal).to_dict())
    page = words(report_html(saved)).replace("\N{NO-BREAK SPACE}", " ")
    ends = "every agent at 11/3" if isinstance(signal, ClockShares) else "every agent in [1, 5]"
    assert f"Where they end {ends} (these signals)" in page
    assert "every signal keeps a, b in [1, 5] at all times" in page


def test_ends_under_the_last_mode_stand_on_page_and_statement():
    other = SignedDigraph.from_edges([("ann", "<b>", -1), ("<b>", "eve", -1)])
    signal = DwellTime("0.2", clock="t")
    saved = read_certificate(certify(Family.switching([DAY, other]), PROTOCOL, [1, 2, 3], signal=signal).to_dict())
    page, statement = words(report_html(saved)), report_latex(saved)
    assert "ann at 1, &lt;b&gt; in [−1, 2], eve in [−2, 3], all at one |x(T)| (these signals)" in page
    assert "State at the deadline, all at one |x(T)|, for these signals" in page
    assert "& -- & $2$ & $[-1, 2]$" in statement and "U+2013" not in statement
    assert r"at least $0.2$ of time between switches: the last mode decides: bip" in statement
    runs = [simulate(saved.family, PROTOCOL, [1, 2, 3], RandomSignal(1), times=[0, 0.5])]
    axes = [plot_trajectory(saved, runs=runs), plot_input(saved, runs=runs)]
    assert all("of any kind" in ax.get_legend().get_title().get_text() for ax in axes)


def test_an_expectation_that_is_refuted_is_told_and_its_counterexample_is_drawn():
    saved = read_certificate(certify(SWITCHING, PROTOCOL, asks=Asks(expectations=Expectations("stability"))).to_dict())
    page = report_html(saved)
    assert "REFUTED" in page and 'id="figure-why0"' in page
    assert "refuted: stability (held in day, ann hears nobody else and keeps its value)" in words(page)


def test_of_a_behaviour_that_depends_on_the_signal_the_page_tells_why_and_what_holds_all_the_same():
    saved = read_certificate(certify(UNSURE, PROTOCOL, [3, 1, 2]).to_dict())
    page = report_html(saved)
    text = words(page)
    assert (
        "Why the state ann=0, &lt;b&gt;=0, eve=1 rests at the least weights and moves with &lt;b&gt; → eve on" in text
    )
    assert "no limit is claimed of eve" in text and 'id="figure-why0"' in page
    assert "no limit is claimed" not in text.partition("What was proved")[2].partition("What is refuted")[0]
    assert "What holds all the same where the signal decides, and what became of expectations, is not part of" in text
    assert "corroborate the bounds" not in text and "The theorem" not in report_latex(saved)
    assert r"b$>$ $\to$ eve on" in report_latex(saved)
    assert "for every signal and every initial state" not in text.partition("What was asked")[0]


def test_a_page_of_an_undecided_family_says_what_to_try_and_claims_nothing(made, tmp_path):
    parts = tuple(
        replace(part, component=replace(part.component, behaviour=None, kernel=None), functions=(), upper_bound=None)
        for part in made.parts
    )
    undecided = made.changed(parts=parts)
    assert write_report(undecided, tmp_path / "u.html", simulation=False) == "undecided"
    assert repr(undecided).startswith("Certificate(undecided: ") and "; not decided, rate none)" in repr(undecided)
    assert undecided.to_dict()["verdict"] == "undecided" and undecided.to_pandas()["least"].isna().all()
    text = words((tmp_path / "u.html").read_text("utf-8"))
    assert "Undecided refutes nothing" in text and "Undecided: what the agents do" in text and "not decided" in text
    assert "How to check it" not in text and "proof obligation" not in text.partition("What this does not say")[0]
    with pytest.raises(ParameterError, match="no statement"):
        write_report(undecided, tmp_path / "u.tex")


@pytest.mark.few(0)
def test_a_statement_has_intervals_behaviour_rate_bound_and_input(made, tmp_path):
    family = Family.switching({"day": Family.from_graph(DAY, uncertainty="10%"), "night": NIGHT})
    certify(family, PROTOCOL, [3, 1, 2]).save(tmp_path / "c.json")
    assert write_report(tmp_path / "c.json", tmp_path / "c.tex", simulation=False) == "certified"
    text = (tmp_path / "c.tex").read_text("utf-8")
    for told in (
        r"in mode day $w_{2,1} \in [0.9, 1.1]$, $w_{3,2} \in [-1.1, -0.9]$; in mode night $w_{1,3} = -2$",
        "Bipartite consensus occurs at $T$ for every such choice",
        r"V(X(t)) \le \mathrm{e}^{-",
        "decay rate at most $",
        r"\item Input: bounded; $|u_{k}| \le",
        r"{}$<$b$>$ & camp 1 & $1$ & $[",
        r"\includegraphics[width=\linewidth]{c_graph.pdf}",
    ):
        assert told in text, told
    assert (tmp_path / "c_graph.pdf").exists() and not (tmp_path / "c_decay.pdf").exists()


def test_intervals_of_the_page_enclose_what_is_proved():
    pair = as_family([("a", "b", "1/3", "2/3"), ("b", "a", "1/7", "6/7")])
    saved = read_certificate(certify(pair, PROTOCOL, ["1/3", "2/7"]).to_dict())
    low, high = saved.final_state[0]
    shown = re.search(r"\[([0-9.]+),\N{NO-BREAK SPACE}([0-9.]+)\]", report_html(saved))
    assert float(shown[1]) <= low <= high <= float(shown[2])


@pytest.mark.parametrize(
    ("family", "x0", "figures"),
    thinned(
        [
            ([("a", "b", 1, 2)], [0, 0], {"graph", "states", "input"}),
            ([("a", "b", 1, 2), ("c", "d", -2, -1)], [1, 2, 3, 4], {"graph", "states", "decay", "input"}),
            (Family.switching([SignedDigraph.from_edges([], nodes=["a"])] * 2), [3], {"graph", "states", "input"}),
            (Family.switching([DAY, SignedDigraph.from_edges([], nodes=DAY.labels)]), [1, 2, 3], None),
        ],
        2,
    ),
    ids=["at rest", "two components", "one agent", "outage"],
)
def test_what_there_is_nothing_to_draw_of_is_left_out(family, x0, figures):
    saved = read_certificate(certify(family, PROTOCOL, x0).to_dict())
    page = report_html(saved, runs=sample_runs(saved, [RandomSignal(1)]))
    drawn = set(re.findall('id="figure-([a-z0-9]+)"', page))
    assert drawn == {"glance"} | ({"graph", "states", "input", "why0"} if figures is None else figures)
    assert r"\end{proposition}" in report_latex(saved)


def test_a_statement_of_which_one_component_depends_on_the_signal_claims_the_others():
    family = Family.from_intervals([("a", "b", 0, 1), ("c", "d", 1, 2), ("e", "f", -2, -1)])
    text = " ".join(report_latex(read_certificate(certify(family, PROTOCOL, [1, 2, 3, 4, 5, 6]).to_dict())).split())
    assert (
        "On $1$ component of the union of all graphs, where the agents end depends on the signal: no" in text
        and "Why: the state" in text
    )
    assert "On $1$ component of the union of all graphs, consensus occurs at $T$ for every such choice" in text
    assert "& no limit claimed" in text and "The theorem" not in text


@pytest.mark.few(0)
@pytest.mark.parametrize("clock", thinned(["s", "t"], 2))
def test_under_a_dwell_time_the_page_shows_signals_that_keep_it(clock: str):
    promise = DwellTime("0.3", clock=clock)
    saved = read_certificate(certify(SWITCHING, PROTOCOL, [1, 2, 3], signal=promise).to_dict())
    runs = sample_runs(saved)
    for run in runs:
        instants = [x for x in run.played.switches.tolist() if math.isfinite(x)]
        grid = np.linspace(0, 1, 200_000, endpoint=False)
        times = instants if clock == "s" else np.interp(instants, run.protocol.gain.clock(grid), grid).tolist()
        assert all(b - a >= 0.2999 for a, b in pairwise(times))
    assert sum(len(run.played.switches) > 1 for run in runs) > 2
    page = words(report_html(saved, runs=runs))
    assert "8 runs from the initial state of the certificate under signals that keep the promise." in page
    assert f"under 8 signals, which keep the promise: at least 0.3 of {'time' if clock == 't' else 'the clock'}" in page
    assert "need not keep" not in page
    for drawn in (plot_trajectory(saved, runs=runs), plot_input(saved, runs=runs)):
        assert drawn.get_legend().get_title().get_text() == "8 signals of the kind asked for"


@pytest.mark.few(1)
@pytest.mark.parametrize("signal", ["constant", ClockShares(["0.75", "0.25"]), JointWindows(2, on="0.5", clock="s")])
def test_the_runs_of_a_family_are_under_signals_of_the_kind_that_was_asked(signal: Any) -> None:
    chains = [[("ann", "<b>", 9), ("<b>", "eve", -9)], [("ann", "<b>", 9), ("<b>", "eve", -18), ("ann", "eve", -9)]]
    modes = [SignedDigraph.from_edges(edges) for edges in chains]  # large weights settle after few switches
    cert = certify(Family.switching(modes), PROTOCOL, [1, 2, 3], signal=signal)
    runs = sample_runs(cert)
    assert signal == "constant" or all(run.played.switches.size > 6 for run in runs)
    for run in runs:
        switches = run.played.switches[np.isfinite(run.played.switches)]
        if signal == "constant":
            assert switches.tolist() == [0]
        elif isinstance(signal, ClockShares):
            lengths = np.diff(switches)
            n = len(lengths) // 2
            assert lengths[: 2 * n : 2].sum() == pytest.approx(3 * lengths[1 : 2 * n : 2].sum())
        else:
            assert np.diff(switches) == pytest.approx(1)
    assert "of the kind asked for" in plot_trajectory(cert, runs=runs).get_legend().get_title().get_text()


def test_the_statement_defines_the_clock_and_what_windows_leave_less_of():
    one = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)], ["c"])
    other = SignedDigraph.from_edges([("b", "c", 1), ("c", "b", 1)], ["a"])
    signal = JointWindows(2, on="0.5", clock="s")
    saved = read_certificate(certify(Family.switching([one, other]), PROTOCOL, [1, 2, 4], signal=signal).to_dict())
    text = report_latex(saved)
    assert r"The stretched clock is $s(t) = \rho_{1} t + \rho_{2} \kappa \ln\frac{T}{T - t}$" in text
    assert r"What is left under restricted signals is $\max_{k} g_{k} x_{k}(t) - \min_{k} g_{k} x_{k}(t)$" in text
    assert re.search(r"what is left shrinks by \$10\^\{-\d+\}\$ of it", text)
    with_rate = read_certificate(certify(SWITCHING, PROTOCOL, signal=DwellTime("0.2", clock="t")).to_dict())
    assert report_latex(with_rate).count(r"\ln\frac") == 1 and "What is left under" not in report_latex(with_rate)


def test_a_page_whose_ends_depend_on_the_signal_says_so_in_its_verdict():
    leaders = as_family([(1, 3, 1, 2), (2, 3, 1, 1)])
    page = words(report_html(read_certificate(certify(leaders, PROTOCOL, [1, 2, 3]).to_dict())))
    assert "CERTIFIED: depends on the signal" in page


def test_groups_without_negative_edges_agree_and_others_up_to_camps():
    for sign, told in ((1, "; a, b agree;"), (-1, "; a, b agree up to camps;")):
        pair = [("a", "b", sign, 2 * sign) if sign > 0 else ("a", "b", -2, -1), ("b", "a", sign, sign)]
        (component,) = decide([*pair, ("a", "d", 1, 2), ("c", "d", 1, 1)])
        assert told in unlabelled(groups_text(component))


@pytest.mark.parametrize("sigma0", thinned([[1, 0, "-1/2"], [0, 0, 0]], 2))
def test_the_bound_of_a_family_through_a_reaching_phase_is_called_numerical_everywhere(sigma0):
    unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", -2, -1)])
    made = certify(unsure, SLIDING, InitialState([1, 2, 3], sigma0=sigma0))
    saved = read_certificate(made.to_dict())
    page, statement = words(report_html(saved)), report_latex(saved, {"decay": "d.pdf"})
    inside, outside = " ".join(statement.split()).split(r"\end{proposition}")
    proved = made.direct
    assert ("of every agent from its final state at most" in inside) == proved
    assert ("Not proved, or numerical, by floating point, and no part of the certificate" in outside) == (not proved)
    assert ("Thick line: the proved bound for every signal" in outside) == proved != ("bound (numerical)" in outside)
    assert ("(numerical, rounded up)" in page) == ("0.99 T s , numerical: " in page) == (not proved)
    runs = sample_runs(made, [RandomSignal(1)])
    for plot in (plot_trajectory, plot_decay, plot_input):
        labels = [text.get_text() for text in plot(made, runs=runs).figure.axes[0].get_legend().get_texts()]
        assert ("proved for every signal" in labels) == proved != ("bound for every signal (numerical)" in labels)
    assert all(("numerical" in " ".join(told(made, "f"))) != proved for told in (summary_lines, certificate_lines))


def test_ends_of_constant_weights_under_disturbances_stand_on_screen_page_and_statement():
    one, other = ([("a", "b", g, g * 2), ("b", "a", g, g)] for g in (1, -1))
    other = [(s, t, *sorted((low, high))) for s, t, low, high in other]
    family = Family.switching({"m1": Family.from_intervals(one), "m2": Family.from_intervals(other)})
    made = certify(family, SLIDING, InitialState([0, 6], sigma0=[0, 0]), signal="constant")
    saved = read_certificate(made.to_dict())
    screen, told = " ".join(" ".join(summary_lines(saved, "f")).split()), "m1: consensus; m2: bipartite consensus"
    assert f"constant if mode and weights never change: {told}" in screen
    assert "x(T) a in [-3, 3], b in [2, 3] (these signals)" in screen
    assert told in words(report_html(saved)) and told in report_latex(saved)


def test_a_statement_that_speaks_of_the_stretched_clock_defines_it():
    moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1), ("c", "d", 1, 2)])
    for protocol, T in ((PROTOCOL, "T"), (SLIDING, "T_{r} + T_{s}")):
        text = report_latex(read_certificate(certify(moved, protocol, [0, 4, 100, 3]).to_dict()))
        clock = f"\\rho_{{1}} t + \\rho_{{2}} \\kappa \\ln\\frac{{{T}}}{{{T} - t}}"
        assert f"The stretched clock is $s(t) = {clock}$" in text
        assert text.count(r"\ln\frac{") == 1


@pytest.mark.few(0)
@pytest.mark.parametrize("sigma0", thinned([[1, 0, 2], [0, 0, 0]], 2))
def test_agents_that_listen_to_nobody_end_where_sliding_variables_bring_them(sigma0):
    moved = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
    made = certify(moved, SLIDING, InitialState([0, 4, 100], sigma0=sigma0))
    page, screen = words(report_html(read_certificate(made.to_dict()))), "\n".join(summary_lines(made, "moved"))
    for text in (page, screen):
        assert ("a, b keep their value" in text) == made.direct != ("a, b end at x(0) - sigma(0)" in text)
    run = simulate(moved, SLIDING, [0, 4, 100], RandomSignal(1), sigma0=sigma0)
    leaders = [run.labels.index(label) for label in "ab"]
    assert np.allclose(run.states[leaders, -1], [[0, 4, 100][v] - sigma0[v] for v in leaders])
