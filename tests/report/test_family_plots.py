"""Facts about figures of families: runs lie within what is shaded, below the bound, and above it if it is wrong."""

import numpy as np
import pytest
from asked import certify_family

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol
from ptcc_certify.report.plots.camp_lines import CAMP_STYLES
from ptcc_certify.report.plots.counterexample import plot_counterexample
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.plots.runs_under_signals import sample_runs
from ptcc_certify.report.plots.trajectory import plot_trajectory
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import RandomSignal, WorstCaseSignal
from ptcc_certify.theorems.family_behaviour import decide

pytestmark = pytest.mark.usefixtures("quick_search")

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
DAY = Family.from_graph(SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "a", -2)]), uncertainty="20%")
NIGHT = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])


@pytest.fixture(scope="module")
def drawn():
    certificate = certify_family(Family.switching({"day": DAY, "night": NIGHT}), PROTOCOL, [1, 4, -3])
    return certificate, sample_runs(certificate, [RandomSignal(1), RandomSignal(2), WorstCaseSignal()])


@pytest.mark.few(0)
def test_every_run_lies_within_what_is_shaded(drawn):
    certificate, runs = drawn
    ax = plot_trajectory(certificate, runs=runs)
    tubes = [shade.get_paths()[0] for shade in ax.collections]
    assert tubes
    for run in runs:
        for x in run.states:
            points = np.column_stack([run.t, x])[1:-12]
            assert any(tube.contains_points(points, radius=1e-3).all() for tube in tubes)


@pytest.mark.few(0)
def test_the_bars_of_final_states_are_named(drawn):
    names = [text.get_text() for text in plot_trajectory(drawn[0], runs=drawn[1]).get_legend().get_texts()]
    assert names[-2:] == ["proved for every signal", "final states, proved"]


@pytest.mark.few(0)
def test_the_decay_of_every_run_lies_below_the_bound(drawn):
    certificate, runs = drawn
    ax = plot_decay(certificate, runs=runs, axis="clock")
    lines = {line.get_label(): line for line in ax.lines}
    bound = lines["proved for every signal"].get_ydata()
    gaps = [line.get_ydata() for line in ax.lines if len(line.get_ydata()) == len(bound)]
    assert len(gaps) == 4
    assert all(not (gap > bound * 1.000001).any() for gap in gaps)


def test_what_cannot_be_drawn_is_refused(drawn):
    certificate, _ = drawn
    other = simulate(DAY, PROTOCOL, [1, 4, -3], times=[0, 1])
    for call, told in (
        (lambda: plot_trajectory(other, runs=[other]), "certificate of a family"),
        (lambda: plot_trajectory(DAY), "of their certificates"),
        (lambda: plot_trajectory(certificate, runs=[other]), "of the certificate"),
        (lambda: plot_decay(certificate, axis="up"), "is unknown"),
        (lambda: plot_trajectory(certify_family(DAY, PROTOCOL)), "no initial state"),
    ):
        with pytest.raises(ParameterError, match=told):
            call()


def test_the_input_of_every_run_lies_below_its_bound(drawn):
    certificate, runs = drawn
    ax = plot_input(certificate, runs=runs)
    lines = {line.get_label(): line for line in ax.lines}
    bound = lines["proved for every signal"]
    for line in ax.lines:
        t, size = line.get_xdata(), line.get_ydata()
        if len(t) == len(bound.get_xdata()) and line is not bound:
            assert not (size > bound.get_ydata() * 1.000001).any()
    assert float(bound.get_ydata()[0]) == pytest.approx(float(max(certificate.input_peaks)))


def test_no_agent_has_a_role_that_it_has_in_one_mode_alone():
    day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    night, spoiled = (SignedDigraph.from_edges([("c", "a", w), ("a", "b", 1)], nodes="abc") for w in (-2, 2))
    for other, names in ((night, {"first camp", "second camp"}), (spoiled, {"agents"})):
        family = Family.switching([day, other])
        for ax in (
            plot_trajectory(simulate(family, PROTOCOL, [1, 4, -3], RandomSignal(1), times=[0, 0.5])),
            plot_graph(family),
        ):
            assert {t.get_text() for t in ax.get_legend().get_texts()} & set(CAMP_STYLES) == names


def test_modes_are_drawn_side_by_side_with_nodes_in_the_same_places():
    ax = plot_graph(Family.switching({"day": DAY, "night": NIGHT}))
    titles = [panel.get_title() for panel in ax.child_axes]
    places = [[text.get_position() for text in panel.texts if text.get_text() in "abc"] for panel in ax.child_axes]
    assert titles == ["day", "night"] and places[0] == places[1]


def test_ranges_of_uncertain_weights_are_written_at_their_edges_and_edges_that_may_fail_are_named():
    ax = plot_graph(Family.from_intervals([("a", "b", -2, -1), ("b", "c", 0, 3), ("c", "a", -1, 1)]))
    assert {"\N{MINUS SIGN}1\N{HORIZONTAL ELLIPSIS}\N{MINUS SIGN}2", "0\N{HORIZONTAL ELLIPSIS}3"} <= {
        text.get_text() for text in ax.texts
    }
    assert {"uncertain weight", "may fail"} <= {text.get_text() for text in ax.get_legend().get_texts()}


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [1, 2, 9, 50])
def test_graphs_of_all_sizes_are_drawn(n):
    edges = [(k, (k + 1) % n, 0, 1 + k % 2) for k in range(n)] if n > 1 else []
    mode = Family.from_intervals(edges, nodes=range(n))
    for family in (mode, Family.switching([mode] * 8)):
        plot_graph(family).figure.canvas.draw()


DECIDED = {
    "moving state": Family.switching(
        {"day": Family.from_graph(NIGHT), "foe": SignedDigraph.from_edges([("c", "a", 2), ("a", "b", 1)])}
    ),
    "edge": Family.from_graph(NIGHT, optional=[("a", "b")]),
    "kernels": Family.switching([NIGHT, SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -1), ("a", "c", 1)])]),
    "undirected": Family.from_intervals([("a", "b", 1, 2), ("b", "c", 0, 1)], undirected=True),
}


@pytest.mark.parametrize("name", DECIDED)
def test_a_state_that_moves_rests_up_to_half_the_deadline_and_not_after(name):
    (component,) = decide(DECIDED[name])
    ax = plot_counterexample(component)
    agents = [line for line in ax.lines if len(line.get_xdata()) > 2]
    t = agents[0].get_xdata()
    states = np.array([line.get_ydata() for line in agents])
    assert np.ptp(states[:, t < 0.5], axis=1).max() < 1e-9 < 1e-2 < np.ptp(states, axis=1).max()


@pytest.mark.parametrize("behaviour", ["stability", "bipartite consensus", "interval bipartite consensus"])
@pytest.mark.parametrize("name", DECIDED)
def test_every_refutation_is_drawn(name, behaviour):
    (component,) = decide(DECIDED[name])
    why = component.refutation(behaviour)
    assert why is not None
    assert plot_counterexample(component, why=why).lines or why.kind == "no camps"


def test_a_behaviour_that_holds_has_no_counterexample():
    with pytest.raises(ParameterError, match="holds for every signal"):
        plot_counterexample(decide(DAY)[0])


def test_states_are_drawn_where_no_limit_is_claimed():
    certificate = certify_family(DECIDED["edge"], PROTOCOL, [1, 2, 3])
    runs = sample_runs(certificate, [RandomSignal(1)])
    assert not plot_trajectory(certificate, runs=runs).collections
    for plot in (plot_input, plot_decay):
        legend = plot(certificate, runs=runs).get_legend()
        assert "proved for every signal" not in {text.get_text() for text in legend.get_texts()}
        title = " ".join(legend.get_title().get_text().split())
        assert title.endswith("no bound exists for all states and signals: the behaviour depends on the signal")


def test_states_come_first_where_no_bound_of_a_decay_is_proved():
    """An edge that may fail, on which it depends who leads."""
    edges = [(1, 2, 1, 1), (2, 3, -1, 0), (3, 4, 1, 1)]
    cert = certify_family(Family.from_intervals(edges), NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2, 3, 4])
    assert cert.main_figure == "states"
    runs = sample_runs(cert, [RandomSignal(1)])
    assert cert.plot(runs=runs).axes[-1].get_ylabel() == cert.plot("states", runs=runs).get_ylabel()


def test_a_certificate_draws_its_figures_by_name(drawn):
    certificate, runs = drawn
    assert certificate.plot("states", runs=runs).get_ylabel() == "state $x_k$"
    assert certificate.plot("graph").child_axes
    for what, told in (("spectrum", "eigenvalues of single graphs"), ("picture", "is unknown")):
        with pytest.raises(ParameterError, match=told):
            certificate.plot(what)


def test_the_certified_peak_has_the_digits_of_the_screen(drawn):
    certificate, runs = drawn
    peak = plot_input(certificate, runs=runs).texts[0].get_text().removeprefix("proved peak ")
    assert f"|u_k| <= {peak}, " in "\n".join(certificate_lines(certificate, "day"))
    assert len(peak.replace(".", "").lstrip("0")) == 4
