"""Figures, judged by their artists: what is drawn, in which colours, and where the lines are."""

from __future__ import annotations

import inspect
import math
import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family, certify_words
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from scipy.integrate import quad
from scipy.spatial import Delaunay
from selection import thinned

import ptcc_certify
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import EXAMPLES, load_graph, select
from ptcc_certify.gain_design.search import design
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.model.asks import Asks, GainLimits, InitialState
from ptcc_certify.model.base import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.report.notebook import trajectory_html
from ptcc_certify.report.page import report_html
from ptcc_certify.report.plots.camp_lines import (
    CAMP_STYLES,
    LINE_AGENTS,
    NAME_LENGTH,
    NAME_SIZE,
    NAMED_AGENTS,
    NAMED_OF_PART,
    TIME_SHARE,
)
from ptcc_certify.report.plots.counterexample import plot_counterexample
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.distributions import plot_degrees, plot_final_states
from ptcc_certify.report.plots.final_colours import colours_of
from ptcc_certify.report.plots.glance import plot_glance
from ptcc_certify.report.plots.graph import GROUND, plot_graph, weight_ranges
from ptcc_certify.report.plots.graph_layout import FREE_NODES, arc
from ptcc_certify.report.plots.input import plot_effort, plot_input
from ptcc_certify.report.plots.sizes import DOUBLE_COLUMN, SINGLE_COLUMN, figures_for
from ptcc_certify.report.plots.spectrum import CLASS_MARKERS, plot_frontier, plot_spectrum
from ptcc_certify.report.plots.style import BEHIND, BOUND, EDGE_STYLES, STYLE, save_figure
from ptcc_certify.report.plots.tracking import plot_tracking
from ptcc_certify.report.plots.trade_off import plot_trade_off
from ptcc_certify.report.plots.trajectory import plot_formation, plot_motion, plot_run, plot_sliding, plot_trajectory
from ptcc_certify.report.report_file import write_report
from ptcc_certify.simulation.nominal import Bounded
from ptcc_certify.simulation.run import simulate
from ptcc_certify.theorems.lemmas import laplacian_spectrum

pytestmark = [
    pytest.mark.filterwarnings("error", "ignore::DeprecationWarning:matplotlib|pyparsing", "ignore:Glyph .* missing"),
    pytest.mark.usefixtures("quick_search"),
]

CORPUS = Path(__file__).parents[1] / "corpus"
STYLE_FILE = Path(ptcc_certify.__file__).with_name("ptcc.mplstyle")
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
NAMES = ("fig1a", "fig3b", "fig5b", "apart", "single")


def graph_of(name: str) -> SignedDigraph:
    if name == "single":
        return SignedDigraph(["alone"], np.zeros(0, int), np.zeros(0, int), Weights([]))
    if name == "apart":  # a balanced pair with a follower, and an unbalanced triangle
        return SignedDigraph.from_edges(
            [("a", "b", -1), ("b", "a", -2), ("b", "c", 1), ("x", "y", 1), ("y", "z", 1), ("z", "x", -3)]
        )
    if name == "wide":  # labels of two columns a letter
        rows = [("北京市朝阳区", "日本語", 1), ("日本語", "مرحبا", -2), ("مرحبا", "日本語", 1), ("ñandú", "😀🎉", 3)]
        return SignedDigraph.from_edges(rows)
    return load_graph(name)


@cache
def certified(name: str) -> Certificate:
    if name == "sliding":
        example = EXAMPLES[5]
        start, sigma0 = (list(map(float, text.split(","))) for text in (example.x0, example.sigma0 or ""))
        return certify(
            graph_of("fig3b"),
            example.protocol(),
            InitialState(start, sigma0=sigma0),
            asks=Asks(disturbance=example.disturbance),
        )
    graph = graph_of(name)
    if name.startswith("fig"):
        example = select(name)[0][0]
        return certify(graph, example.protocol(), list(map(float, example.x0.split(","))))
    if name == "wide":
        return certify(graph, PROTOCOL, [2e12, -3e12, 1e12, -4e12, 5e12])
    return certify(graph, PROTOCOL, [float(k * (-1) ** k) for k in range(1, graph.n_nodes + 1)])


def drawn(ax: Axes) -> Axes:
    """Render the figure, and see that its limits are finite."""
    assert isinstance(ax, Axes)
    figure = ax.figure
    assert isinstance(figure, Figure)
    FigureCanvasAgg(figure).draw()
    assert np.isfinite([*ax.get_xlim(), *ax.get_ylim()]).all()
    return ax


def labelled(ax: Axes) -> dict[str, object]:
    return {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}


def camps(structure: Structure) -> list[str]:
    """The group of every node, from the components."""
    names = ["followers"] * structure.graph.n_nodes
    for component in structure.closed_components:
        for k, v in enumerate(component.nodes):
            gauge = component.gauge
            if len(component.nodes) == 1:
                names[v] = "single leaders"
                continue
            names[v] = "unbalanced leaders" if gauge is None else "first camp" if gauge[k] > 0 else "second camp"
    return names


def shows(drawn: np.ndarray, row: np.ndarray, scale: float) -> bool:
    """Whether a line is that of an agent; gaps, where nothing is resolved, hide nothing that is large at the start."""
    gaps = np.isnan(drawn)
    return np.array_equal(drawn[~gaps], row[~gaps]) and not (gaps[0] and abs(row[0]) > 1e-6 * scale)


# ---------------------------------------------------------------------- agents over time


def agent_lines(ax: Axes) -> list[Line2D]:
    """The lines of single agents: those of means are thicker, those of bounds and deadlines have two points."""
    lines = [line for line in ax.lines if line.get_linewidth() < 2 and line.get_linestyle() != "None"]
    return [line for line in lines if len(line.get_xdata()) > 2]  # type: ignore[arg-type]


def peak_of(ax: Axes) -> Annotation | None:
    """The text at the line of the proved peak."""
    return next((text for text in ax.texts if text.get_text().startswith("proved peak")), None)  # type: ignore[return-value]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["fig1a", "fig3b", "apart", "single"])
def test_each_of_few_agents_has_a_line_of_its_camp_and_its_name(name: str) -> None:
    cert = certified(name)
    run = cert.trajectory
    assert run is not None and cert.graph.n_nodes <= NAMED_AGENTS
    states, ax = drawn(plot_trajectory(cert)), drawn(plot_input(cert))
    ends = colours_of(run.states[:, -1], first=float(np.abs(run.states[:, 0]).max()))
    several = set(camps(cert.structure)) if len(set(camps(cert.structure))) > 1 else set()
    for values, axes in ((run.states, states), (run.input, ax)):
        scale = np.abs(values[:, :1]).max()
        assert len(agent_lines(axes)) == cert.graph.n_nodes
        for row, camp, end in zip(values, camps(cert.structure), ends, strict=True):
            colours = [line.get_color() for line in agent_lines(axes) if shows(line.get_ydata(), row, scale)]
            alike = axes is ax and len(set(ends)) < 2  # then camps tell them apart
            want = to_rgb(CAMP_STYLES[camp][0] if alike else end)
            assert any(np.allclose(to_rgb(colour), want, atol=0.02) for colour in colours)
        assert set(labelled(axes)) == (several if axes is states else {*camps(cert.structure), "deadline $T$"})
        names = [text.get_text() for text in axes.texts if text is not peak_of(axes)]
        written = ", ".join(name for name in names if not name.startswith("$T$"))
        assert set(cert.graph.labels) <= set(written.split(", ")) or "+" in written
    assert any(text.get_text().startswith("$T$ = ") for text in states.texts)
    peak, text = cert.effort and cert.effort.peak, peak_of(ax)
    assert (text is None) == (peak is None)
    if text is not None and peak is not None:
        assert float(text.get_text().split()[2].strip(",")) >= peak.largest >= np.abs(run.input).max() * (1 - 1e-9)
        assert text.xy[1] == float(peak.largest) < ax.get_ylim()[1] or text.get_text().endswith("above")
        lines = {height for line in ax.lines for height in line.get_ydata() if abs(height) == float(peak.largest)}
        assert len(lines) == (0 if text.get_text().endswith("above") else 2)  # above and below


def test_up_to_60_agents_have_lines_and_those_that_begin_highest_and_lowest_their_names() -> None:
    cert = certified("fig5b")
    run, group = cert.trajectory, np.array(camps(cert.structure))
    assert run is not None and NAMED_AGENTS < cert.graph.n_nodes <= LINE_AGENTS
    ax = drawn(plot_trajectory(cert))
    lines = {line.get_ydata().tobytes(): line for line in agent_lines(ax)}
    assert {row.tobytes() for row in run.states} == set(lines)
    assert {line.get_color() for line in lines.values()} == set(colours_of(np.zeros(1)))  # all end at 0
    written = ", ".join(text.get_text() for text in ax.texts)
    for part in set(group):
        own = np.flatnonzero(group == part)
        assert len(own) > NAMED_OF_PART
        for end in (own[run.states[own, 0].argmin()], own[run.states[own, 0].argmax()]):
            assert cert.graph.labels[end] in written.split(", ")


@pytest.mark.parametrize("name", ["fig3a", "parts", "moving"])
def test_states_and_graph_have_the_colours_of_the_glance(name: str) -> None:
    cert = read_certificate(CORPUS / f"{name}.json")
    nodes, runs = (
        {line.get_gid(): line.get_color() for line in ax.lines if line.get_gid()} for ax in plot_glance(cert).axes
    )
    n, states, graph = len(cert.labels), plot_trajectory(cert), plot_graph(cert)
    assert sorted(line.get_color() for line in agent_lines(states)) == sorted(runs[f"run-{k}"] for k in range(n))
    assert {line.get_gid(): line.get_color() for line in graph.lines if line.get_gid()} == nodes
    assert all(same_color(line.get_color(), BEHIND) for line in labelled(states).values())  # type: ignore[attr-defined]
    assert "$T$ = " in " ".join(text.get_text() for text in states.texts)


@pytest.mark.few(0)
def test_of_more_than_60_agents_the_parts_are_drawn_as_their_range_and_mean() -> None:
    ring = SignedDigraph.from_edges([(k, (k + 1) % 64, -1 if k in (5, 30) else 1) for k in range(64)])
    run = simulate(ring, PROTOCOL, [float(k * (-1) ** k) for k in range(64)])
    ax, group = drawn(plot_trajectory(run)), np.array(camps(analyse(ring)))
    for part in ("first camp", "second camp"):
        rows = run.states[group == part]
        assert labelled(ax)[part].get_ydata() == pytest.approx(rows.mean(axis=0))  # type: ignore[attr-defined]
        (shade,) = [one for one in ax.collections if same_color(one.get_facecolor()[0][:3], CAMP_STYLES[part][0])]
        inside = shade.get_paths()[0].vertices  # type: ignore[union-attr]
        assert [inside[:, 1].min(), inside[:, 1].max()] == pytest.approx([rows.min(), rows.max()])
    assert len(agent_lines(ax)) == 4 and len(ax.texts) >= 4


@pytest.mark.few(0)
@pytest.mark.usefixtures("every_class")
def test_the_peak_is_drawn_where_it_holds_only() -> None:
    graph, start = graph_of("fig3b"), [-4, 3, -1, 2, -2, 5]
    protocol, capped = EXAMPLES[2].protocol(), GainLimits(gain_cap="0.5")
    cert = certify(graph, protocol, start, limits=[capped], asks=Asks(simulation=False))
    assert cert.effort is not None and cert.effort.peak is not None
    own = float(cert.effort.residual[0].largest or 0)
    peak = float(cert.effort.peak.largest)
    expected = [
        ({}, peak),
        ({"actuator": capped}, own),
        ({"actuator": GainLimits(gain_cap=50)}, peak),
        ({"actuator": GainLimits(sample_period="0.01", stop_before="0.05")}, None),
        ({"disturbance": Bounded("sin(k*t)", 1), "actuator": capped}, None),
    ]
    assert 0 < own < peak
    for options, height in expected:
        run = simulate(graph, protocol, start, **options)
        ax = drawn(plot_input(run, certificate=cert))
        text = peak_of(ax)
        assert (text and not text.get_text().endswith("above") and text.xy[1]) in (height, False)
        assert (text is None) == (height is None)
        assert height is None or np.abs(run.input).max() <= height * (1 + 1e-9)
        steps = {line.get_drawstyle() for line in agent_lines(ax)}
        assert steps == {"steps-post" if run.held_input is not None else "default"}


@pytest.mark.few(1)
@pytest.mark.usefixtures("every_class")
@pytest.mark.parametrize("radius", [5, 1])
def test_beside_the_peak_of_a_set_the_set_is_named(radius: int) -> None:
    graph, start = graph_of("fig3b"), [-4, 3, -1, 2, -2, 5]
    region = certify(graph, EXAMPLES[2].protocol(), start, asks=Asks(initial_set=radius))
    assert region.effort is not None and region.effort.peak is not None
    text = peak_of(drawn(plot_input(region)))
    assert text is not None and f"(all $|x_k(0)| \\leq$ {radius}" in text.get_text()
    assert float(text.get_text().split()[2]) >= region.effort.peak.largest
    assert ("not from where this run begins" in text.get_text()) == (radius < 5)


@pytest.mark.few(0)
def test_of_a_certificate_under_limits_the_run_under_them_is_drawn_and_they_are_named() -> None:
    graph, start = graph_of("fig3b"), [-4, 3, -1, 2, -2, 5]
    held, capped = GainLimits(sample_period="0.01"), GainLimits(gain_cap="0.5")
    titles = {}
    for name, limits in {"held": [held], "capped": [capped], "both": [held, capped]}.items():
        cert = certify(graph, EXAMPLES[2].protocol(), start, limits=limits, asks=Asks(method="paper"))
        ax = drawn(plot_input(cert))
        legend = ax.get_legend()
        assert legend is not None and cert.trajectory is not None
        titles[name] = legend.get_title().get_text()
        first = np.nanmax([abs(line.get_ydata()[0]) for line in agent_lines(ax)])  # type: ignore[index]
        for other in (plot_trajectory(cert), plot_decay(cert)):
            assert other.get_legend().get_title().get_text() == titles[name]  # type: ignore[union-attr]
        ideal = np.abs(cert.trajectory.input[:, 0]).max()
        assert (first == pytest.approx(ideal)) == (name != "capped")
    assert titles == {"held": "held over 0.01", "capped": "gain at most 0.5", "both": "without the limits of the gain"}


@pytest.mark.few(0)
@pytest.mark.parametrize("limits", [None, GainLimits(gain_cap="0.5")], ids=["ideal", "capped"])
def test_figures_of_a_formation_show_positions(limits: GainLimits | None) -> None:
    """Lines of states begin at ``x0`` and end at final positions; no word tells them less places."""
    start, h = [-4, 3, -1, 2, -2, 5], [1, -2, 0, 4, 30, -50]
    agents = ptcc_certify.Agents(order=1, offsets=h)
    cert = certify(graph_of("fig3b"), EXAMPLES[2].protocol(), start, limits=limits or (), agents=agents)
    assert cert.final_positions is not None and cert.trajectory is not None
    for ax in (plot_trajectory(cert), plot_run(cert).axes[0], *([] if limits else [plot_trajectory(cert.trajectory)])):
        ends = np.array([[line.get_ydata()[k] for k in (0, -1)] for line in agent_lines(drawn(ax))])  # type: ignore[index]
        assert sorted(ends[:, 0]) == pytest.approx(sorted(start))
        if limits is None:
            assert sorted(ends[:, 1]) == pytest.approx(sorted(map(float, cert.final_positions.states)), abs=1e-6)
        legend = ax.get_legend()
        assert legend is not None and legend.get_title().get_text() == ("" if limits is None else "gain at most 0.5")
    (low, high) = plot_final_states(cert).get_xlim()
    assert low <= min(cert.final_positions.states) and high >= max(cert.final_positions.states)


CAPPED = ptcc_certify.LateMessages(delay="0.01", gain_cap=40)


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("agents", "x0"),
    [
        (ptcc_certify.Agents(order=2, cascade=3), [5, 2, -4, 3, -2, 1]),
        (ptcc_certify.Agents(order=2), [[5, 1], [2, 2], [-4, 0], [3, -1], [-2, 6], [1, 1]]),
    ],
)
def test_inputs_of_agents_of_order_n_are_drawn_below_their_proved_peak(agents: Any, x0: Any) -> None:
    protocol = NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    cert = certify(graph_of("fig3a"), protocol, x0, agents=agents, asks=Asks(method="perron", simulation=False))
    assert cert.agents is not None and cert.agents.input is not None
    ax, run = drawn(cert.plot("input")), cert.agents.simulate()
    peak = peak_of(ax)
    assert peak is not None and float(peak.get_text().split()[2].rstrip(",")) >= max(cert.agents.input)
    highest = max(np.nanmax(np.abs(line.get_ydata())) for line in agent_lines(ax))  # type: ignore[arg-type]
    assert highest == pytest.approx(np.nanmax(np.linalg.norm(run.input, axis=1)), rel=1e-6)
    assert highest <= max(cert.agents.input)


@pytest.mark.few(0)
def test_with_late_messages_their_bound_of_the_input_is_drawn_and_not_that_of_messages_at_once() -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("a", "c", 2)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=3, kappa=1)
    cert = certify(graph, protocol, [1, 2, 3], messages=CAPPED, asks=Asks(method="perron"))
    assert cert.late is not None and cert.late.input is not None
    texts = [text.get_text() for text in drawn(plot_input(cert)).texts]
    (told,) = [text for text in texts if text.startswith("late messages: at most ")]
    assert float(told.split()[4].rstrip(",")) >= cert.late.input.max()
    assert not any("proved peak" in text for text in texts)
    punctual = [text.get_text() for text in drawn(plot_input(cert.trajectory, certificate=cert)).texts]
    assert any("proved peak" in text and "messages at once" in text for text in punctual)


@pytest.mark.parametrize(
    ("name", "bounds", "scale"),
    [("group-vehicles", [290.4], "symlog"), ("late-capped", [36.75], "linear"), ("fig5a", [380], "linear")],
)
def test_bounds_of_the_run_that_is_drawn_are_lines_in_sight(name: str, bounds: list[float], scale: str) -> None:
    ax = drawn(plot_input(CORPUS / f"{name}.json"))
    told = [text for text in ax.texts if "peak" in text.get_text() or "at most" in text.get_text()]
    assert [text.xy[1] for text in told] == pytest.approx(bounds, rel=1e-3)  # type: ignore[attr-defined]
    dashed = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--" and len(line.get_ydata()) == 2]
    assert dashed == pytest.approx([sign * bound for bound in bounds for sign in (1, -1)], rel=1e-3)
    assert ax.get_yscale() == scale and ax.get_ylim()[1] > max(bounds)


def test_a_held_input_is_drawn_in_steps_where_every_period_is_sampled() -> None:
    graph, protocol = graph_of("fig1a"), NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
    for period, style in (("0.05", "steps-post"), ("0.001", "default")):
        run = simulate(graph, protocol, range(6), actuator=GainLimits(sample_period=period))
        assert {line.get_drawstyle() for line in agent_lines(plot_input(run))} == {style}


def test_an_input_without_bound_is_drawn_with_its_start() -> None:
    pair = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    slow = NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1)
    cert = certify(pair, slow, [1, -1])
    assert cert.trajectory is not None
    ax = drawn(plot_input(cert))
    u = cert.trajectory.input
    assert ax.get_ylim()[0] < u.min() < 1e3 * u[:, 0].min() < 1e3 * u[:, 0].max() < u.max() < ax.get_ylim()[1]
    assert ax.get_yscale() == "symlog" and peak_of(ax) is None


@pytest.mark.few(0)
def test_the_input_of_the_sliding_mode() -> None:
    example = EXAMPLES[5]
    start, sigma0 = (list(map(float, text.split(","))) for text in (example.x0, example.sigma0 or ""))
    graph = graph_of("fig3b")
    cert = certify(
        graph, example.protocol(), InitialState(start, sigma0=sigma0), asks=Asks(disturbance=example.disturbance)
    )
    assert cert.trajectory is not None
    ax = drawn(plot_input(cert))
    assert {"deadline $T$", "$T_r$"} <= set(labelled(ax))
    peak = cert.effort and cert.effort.peak
    assert (peak_of(ax) is not None) == (peak is not None)
    run = cert.trajectory
    assert run.sliding is not None
    late = run.t > float(run.protocol.T)  # there the input answers the disturbance alone
    answers = {line.get_ydata()[late].round(6).tobytes() for line in agent_lines(ax)}
    assert answers == {(0.0 - row).round(6).tobytes() for row in run.sliding.disturbance[:, late]}
    other = certify(graph, example.protocol(), InitialState(start, sigma0=[1.0] * 6), asks=Asks(simulation=False))
    with pytest.raises(ValueError, match=r"another sigma\(0\) than"):
        plot_input(cert.trajectory, certificate=other)


def test_a_certificate_of_something_else_is_refused() -> None:
    cert = certified("fig1a")
    run = cert.trajectory
    assert run is not None and cert.initial_state is not None
    other = certified("fig3b")
    with pytest.raises(ValueError, match="another graph than"):
        plot_input(run, certificate=other)
    with pytest.raises(ValueError, match="another protocol than"):
        plot_input(run, certificate=certify(cert.graph, PROTOCOL, cert.initial_state, asks=Asks(simulation=False)))
    with pytest.raises(ValueError, match="another initial state than"):
        plot_input(run, certificate=certify(cert.graph, cert.protocol, [1] * 6, asks=Asks(simulation=False)))
    without = certify(cert.graph, cert.protocol, asks=Asks(simulation=False))
    assert peak_of(plot_input(run, certificate=without)) is None
    columns = simulate(cert.graph, cert.protocol, np.eye(6)[:, :2], times=[0])
    with pytest.raises(ValueError, match="holds 2 initial states; draw a run of one"):
        plot_input(columns)


# ---------------------------------------------------------------------- graphs


def arrows_in(ax: Axes) -> list[FancyArrowPatch]:
    return [patch for patch in ax.patches if isinstance(patch, FancyArrowPatch)]


def nodes_in(ax: Axes) -> dict[tuple[float, float], Line2D]:
    """The marks of the nodes by their places."""
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    return {(x, y): line for line in marks for x, y in line.get_xydata()}  # type: ignore[misc]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", NAMES)
def test_graphs_have_a_node_for_every_agent_and_an_arrow_for_every_edge(name: str) -> None:
    structure = analyse(graph_of(name))
    graph, ax = structure.graph, drawn(plot_graph(structure))
    found, group = nodes_in(ax), camps(structure)
    assert len(found) == graph.n_nodes
    assert [text.get_text() for text in ax.texts[: graph.n_nodes]] == list(graph.labels)
    for camp in set(group):
        own = [line for line in found.values() if same_color(line.get_color(), CAMP_STYLES[camp][0])]
        assert len(own) == group.count(camp)
        assert all((line.get_markeredgecolor() == "black") == (camp != "followers") for line in own)
    heads = [patch.get_arrowstyle() for patch in arrows_in(ax)]
    assert sum(1 + (type(head).__name__ == "CurveFilledAB") for head in heads) == graph.n_edges
    arrows = [edge.arrow for edge in weight_ranges(Family.from_graph(graph).modes[0])]
    for patch, arrow in zip(arrows_in(ax), arrows, strict=True):
        colour, line, _ = EDGE_STYLES[arrow.sign]
        assert same_color(patch.get_edgecolor(), colour) and patch.get_linestyle() == line
    signs = {EDGE_STYLES[int(sign)][2] for sign in graph.sign}
    several = any(len(component.nodes) > 1 for component in structure.closed_components)
    ground = {"leader group"} if "followers" in group and several else set()
    assert set(labelled(ax)) == {*group} | signs | ground
    assert not {colour for colour, _, _ in EDGE_STYLES.values()} & {colour for colour, _ in CAMP_STYLES.values()}


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(["fig5b", "fig1a", "fig1b", "fig3a", "ring", "fig3b", "fig5a", "apart"]))
def test_every_arrow_keeps_away_from_nodes_that_are_not_its_ends(name: str) -> None:
    graph = ring(LABELLED_NODES) if name == "ring" else graph_of(name)
    ax = drawn(plot_graph(graph))
    nodes = nodes_in(ax)
    places = ax.transData.transform(list(nodes))
    radius = max(line.get_markersize() for line in nodes.values()) / 2 * ax.figure.dpi / 72
    for patch in arrows_in(ax):
        ends = ax.transData.transform(patch._posA_posB)  # type: ignore[attr-defined]
        curve = arc(*ends, patch.get_connectionstyle().rad, np.linspace(0, 1, 60))  # type: ignore[attr-defined]
        gaps = np.linalg.norm(places[:, None] - curve, axis=-1).min(axis=1)
        assert np.sort(gaps)[2:].min(initial=np.inf) > radius  # the two nearest are its ends


def test_weights_are_written_where_they_differ_and_there_are_few() -> None:
    differ = plot_graph([("a", "b", 1), ("b", "c", -2.5), ("c", "a", "1/3")])
    assert {text.get_text() for text in differ.texts[3:]} == {"1", "\N{MINUS SIGN}2.5", "0.333"}
    assert len(plot_graph([("a", "b", 2), ("b", "c", -2)]).texts) == 3
    many = plot_graph(SignedDigraph.from_edges([(k, k % 30 + 1, k) for k in range(1, 31)]))
    assert len(many.texts) == 30 and len({patch.get_linewidth() for patch in arrows_in(many)}) == 30


def test_a_weight_stands_where_no_other_arrow_crosses() -> None:
    edges = [("L", "1", 1), ("1", "L", 1), ("L", "2", -1), ("1", "3", 2), ("2", "4", 1), ("3", "5", -1), ("4", "5", 1)]
    graph = SignedDigraph.from_edges(edges)
    ax = drawn(plot_graph(graph))
    weights = ax.texts[graph.n_nodes :]
    curves = []
    for patch in arrows_in(ax):
        ends = patch._posA_posB  # type: ignore[attr-defined]
        curve = arc(*ends, patch.get_connectionstyle().rad, np.linspace(0, 1, 200))  # type: ignore[attr-defined]
        curves.append(ax.transData.transform(curve))
    assert len(weights) == len(curves) == 6
    for k, weight in enumerate(weights):
        box = Text.get_window_extent(weight)
        others = np.concatenate(curves[:k] + curves[k + 1 :])
        assert not box.count_contains(others), weight


def test_no_weight_hides_an_arrowhead() -> None:
    for name in ("switching", "dwell", "late-camps"):
        figure = plot_glance(CORPUS / f"{name}.json")
        FigureCanvasAgg(figure).draw()
        first = figure.axes[0]
        for ax in first.child_axes or [first]:
            weights = [patch.get_window_extent() for t in ax.texts if (patch := t.get_bbox_patch()) is not None]
            for arrow in arrows_in(ax):
                paths, _ = arrow._get_path_in_displaycoord()  # type: ignore[attr-defined]
                heads = [
                    Bbox([corners.min(axis=0), corners.max(axis=0)]) for corners in (p.vertices[:3] for p in paths[1:])
                ]
                for head in heads:
                    shared = [Bbox.intersection(box, head) for box in weights]
                    covered = max((one.width * one.height for one in shared if one is not None), default=0)
                    assert covered <= 0.25 * head.width * head.height, (name, covered)


def test_a_flat_graph_has_a_flat_figure() -> None:
    heights = [
        plot_graph([(k, k + 1, 1) for k in range(4)]).figure.get_figheight(),
        plot_graph(graph_of("fig1a")).figure.get_figheight(),
    ]
    assert heights[0] < 1.2 < 3 < heights[1] <= 3.4


def test_the_layout_is_the_same_in_every_run_and_separates_the_nodes() -> None:
    for graph in (graph_of("apart"), ring(FREE_NODES + 10)):
        first, again = (np.array(list(nodes_in(plot_graph(graph)))) for _ in range(2))
        assert np.array_equal(first, again)
        gaps = np.linalg.norm(first[:, None] - first[None], axis=-1) + 100 * np.eye(len(first))
        assert gaps.min() > 9  # points


def ring(n: int) -> SignedDigraph:
    return SignedDigraph.from_edges([(k, k % n + 1, 1) for k in range(1, n + 1)])


def test_large_graphs_are_drawn_as_matrices_camp_by_camp() -> None:
    assert len(plot_graph(ring(LABELLED_NODES)).texts) == LABELLED_NODES
    camp = [(f"a{j}", f"a{(j + 1) % 30}", 1) for j in range(30)] + [(f"b{j}", f"b{(j + 1) % 30}", 1) for j in range(30)]
    ax = drawn(plot_graph([*camp, ("a0", "b0", -1), ("b3", "a3", -1), ("a5", "z", 1)]))
    cells: dict[int, set[tuple[int, int]]] = {1: set(), -1: set()}  # of allies and opponents, by listener and source
    for patch in ax.patches:
        sign = next(sign for sign in (1, -1) if same_color(patch.get_facecolor()[:3], EDGE_STYLES[sign][0]))
        for corners in np.asarray(patch.get_path().vertices).reshape(-1, 5, 2)[:, :4]:
            column, row = corners.min(axis=0).round().astype(int).tolist()
            cells[sign].add((row, column))
    assert len(cells[1]) == 61 and len(cells[-1]) == 2
    assert {(row < 30, column < 30) for row, column in cells[-1]} == {(True, False), (False, True)}
    assert all((row < 30) == (column < 30) for row, column in cells[1] if row < 60)
    assert {"first camp (30)", "second camp (30)", "followers (1)"} <= set(labelled(ax))


def test_labels_are_drawn_as_they_are() -> None:
    edges = [("$x_1$", r"$\frac$", 1), (r"$\frac$", "lone \ud800", -1), ("lone \ud800", "a very long name", 1)]
    ax = drawn(plot_graph(edges))
    assert [text.get_text() for text in ax.texts] == ["$x_1$", r"$\frac$", "lone ?", "a very long ..."]


def test_long_labels_around_a_circle_hardly_cover_another() -> None:
    names = [f"a person {k}" for k in range(40)]
    ax = drawn(plot_graph([(a, names[(k + j) % 40], 1) for k, a in enumerate(names) for j in (1, 9, 17)]))
    boxes = [text.get_window_extent() for text in ax.texts]
    shared = [Bbox.intersection(a, b) for k, a in enumerate(boxes) for b in boxes[:k]]
    area = boxes[0].width * boxes[0].height
    assert len(boxes) == 40 and max(box.width * box.height for box in shared if box is not None) < area / 8


def test_the_ground_of_a_leader_group_has_no_hole() -> None:
    def grounds(name: str) -> list[Polygon]:
        ax = drawn(plot_graph(graph_of(name)))
        return [patch for patch in ax.patches if isinstance(patch, Polygon) and len(patch.get_xy())]

    structure = analyse(graph_of("fig5b"))
    middles = 0
    for component in structure.closed_components:
        middles += len(component.nodes) >= 3
    triangles = [patch for patch in grounds("fig5b") if len(patch.get_xy()) == 4]
    assert len(triangles) == middles == 2 and all(same_color(patch.get_facecolor(), GROUND) for patch in triangles)
    assert not grounds("fig1a") and grounds("apart")


def test_the_ground_of_a_leader_group_reaches_under_no_follower() -> None:
    leaders = [(k, k % 37 + 1, 1) for k in range(1, 38)] + [(k, (k + 12) % 37 + 1, 1) for k in range(1, 38)]
    ax = drawn(plot_graph(SignedDigraph.from_edges([*leaders, (1, 38, 1), (20, 39, 1), (30, 40, 1)])))
    places, radius = np.array([text.xy for text in ax.texts]), 6.3  # type: ignore[attr-defined]
    followers = [place for place, text in zip(places, ax.texts, strict=True) if int(text.get_text()) > 37]
    grounds = [patch for patch in ax.patches if isinstance(patch, Polygon) and len(patch.get_xy()) > 2]
    assert grounds and len(followers) == 3
    for patch in grounds:
        for place in followers:
            assert not patch.get_path().contains_point(place, radius=patch.get_linewidth() / 2 + radius)


def test_short_labels_of_40_agents_stand_in_their_nodes() -> None:
    ax = drawn(plot_graph(ring(LABELLED_NODES)))
    for text in ax.texts:
        box, place = text.get_window_extent(), ax.transData.transform(text.xy)  # type: ignore[attr-defined]
        assert abs((box.x0 + box.x1) / 2 - place[0]) < 1 and box.width * 72 / ax.figure.dpi < 12.6


@pytest.mark.few(0)
def test_the_axis_of_an_input_that_is_large_for_a_short_time_alone_is_logarithmic() -> None:
    for name, scale in (("fig1a", "symlog"), ("fig3a", "linear")):
        example, _, _ = select(name)[name == "fig1a"]
        sigma0 = example.sigma0 and example.sigma0.split(",")
        cert = certify(
            load_graph(name),
            example.protocol(),
            InitialState(example.x0.split(","), sigma0=sigma0),
            asks=Asks(method="paper"),
        )
        ax = drawn(plot_input(cert))
        assert ax.get_yscale() == scale and ax.spines["bottom"].get_bounds()[0] == 0
        end = plot_decay(cert, axis="time")
        assert ("$T_r$" in labelled(end)) == (example.sigma0 is not None)
        if example.sigma0 is not None:
            assert labelled(end)["$T_r$"].get_xdata()[0] == pytest.approx(float(example.protocol().reaching.T_r))  # type: ignore[attr-defined,union-attr]


@pytest.mark.few(0)
def test_what_is_small_at_the_deadline_is_drawn_on_the_axis_of_remaining_time() -> None:
    protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    for name, asked in MOVING.items():
        cert = certify_words(CHAIN, protocol, [1, 3, -2, 4], method="perron", simulation=False, **asked)
        assert cert.late is not None
        times = np.array([0, 0.5, 1 - 1e-6, 1, 1.5 if cert.late.tracks else 1])
        bound = cert.late.largest_bound(times)
        small = bool(bound[-2:].max() < bound[0] / 100)
        ax, over_time = drawn(plot_tracking(cert)), drawn(plot_tracking(cert, axis="time"))
        assert ax.get_xlabel().startswith("remaining time" if small else "time"), (name, bound)
        assert over_time.get_xlabel() == "time $t$" and over_time.get_xscale() == "linear"
        left = drawn(plot_tracking(cert, axis="left"))
        q, values = labelled(left)["proved bound"].get_data()  # type: ignore[attr-defined]
        assert np.interp([1 - t for t in times[:3]], q[::-1], values[::-1]) == pytest.approx(bound[:3], rel=1e-3)
        assert left.get_xlim()[0] == 1 > left.get_xlim()[1] > 0 and (values[q >= left.get_xlim()[1]] > 0).all()
    with pytest.raises(ParameterError, match="unknown; one of left, time"):
        plot_tracking(cert, axis="clock")  # type: ignore[arg-type]


@pytest.mark.few(0)
def test_what_oscillates_after_the_deadline_is_drawn_with_40_samples_a_period() -> None:
    run, graph = certified("sliding").trajectory, graph_of("fig3b")
    assert run is not None and "sin(2*k*t" in str(EXAMPLES[5].disturbance)
    shaken = simulate(graph, PROTOCOL, range(6), disturbance=Bounded("sin(k*9*t)", 1), actuator=GainLimits(gain_cap=9))
    for t, deadline, period in ((run.t, 1.5, math.pi / graph.n_nodes), (shaken.t, 1, 2 * math.pi / 54)):
        assert (np.diff(t[t >= deadline]) <= period / 40).all()


@pytest.mark.few(0)
def test_inputs_of_two_panels_have_one_axis() -> None:
    steep, flat = certified("sliding"), certified("fig3b")
    left, right = Figure().subplots(1, 2)
    for ax, cert in ((left, steep), (right, flat)):
        drawn(plot_input(cert, ax=ax, beside=[steep, flat]))
    assert left.get_ylim() == right.get_ylim() and left.get_yscale() == right.get_yscale() == "symlog"
    assert list(left.get_yticks()) == list(right.get_yticks()) and 0 in left.get_yticks()
    assert plot_input(flat).get_yscale() == "linear"


def test_the_bound_of_a_disconnected_graph_is_named_by_the_theorems_of_its_components() -> None:
    pairs, mixed = [("c", "d", 1), ("e", "f", 1)], [("a", "b", 1), ("b", "a", -1), ("c", "d", 1), ("e", "d", 1)]
    for edges, named in ((pairs, "Theorem 2.1"), (mixed, "Theorems 1.2 and 3.1")):
        cert = certify(SignedDigraph.from_edges(edges), PROTOCOL, range(len({v for e in edges for v in e[:2]})))
        assert {claim.theorem for claim in cert.claims} == set(named.split()[1::2])
        assert f"bound of {named}" in labelled(plot_decay(cert)) and named in repr(cert)


ASKED: dict[str, dict[str, Any]] = {
    "messages late by up to 0.05": {"messages": LateMessages(delay="0.05")},
    "gain at most 20, messages late by up to 0.05": {"messages": LateMessages(delay="0.05", gain_cap=20)},
    "gain at most 20, off by 0.1": {"messages": LateMessages(value_error="0.1", gain_cap=20)},
    "leaders move at up to 1": {"leaders": MovingLeaders(speed=1)},
    "messages late by up to 0.05, leaders move at up to 1": {
        "messages": LateMessages(delay="0.05"),
        "leaders": MovingLeaders(speed=1),
    },
    "gain at most 5": {"limits": [GainLimits(gain_cap=5)]},
    "off from $T$ - 0.2": {"limits": [GainLimits(stop_before="0.2")]},
    "gain at most 5, without disturbance, without noise": {
        "limits": [GainLimits(gain_cap=5)],
        "noise": "0.1",
        "delta": "0.1",
    },
}


@pytest.mark.few(0)
@pytest.mark.parametrize("title", ASKED)
def test_the_run_that_is_drawn_is_the_one_that_was_asked(title: str) -> None:
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1), (1, 4, 1), (3, 4, -1)])
    protocol, x0 = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [1, 0, 2, -1]
    cert = certify_words(graph, protocol, x0, method="paper", **ASKED[title])
    (states,) = plot_run(cert).axes
    drawn_axes = states, plot_decay(cert), plot_input(cert)
    assert {ax.get_legend().get_title().get_text() for ax in drawn_axes} == {title}  # type: ignore[union-attr]
    acts = {name: value for name, value in ASKED[title].items() if name in ("messages", "leaders")}
    run = simulate(graph, protocol, x0, actuator=next(iter(ASKED[title].get("limits", ())), None), **acts)
    ends = [line.get_ydata()[-1] for line in agent_lines(states)]  # type: ignore[index]
    assert sorted(ends) == pytest.approx(sorted(run.states[:, -1]), abs=1e-6)
    decay = drawn(drawn_axes[1])
    (bound,) = [line for line in decay.lines if line.get_label() == "proved without these"]
    assert same_color(bound.get_color(), BEHIND) and bound.get_linewidth() < 1
    assert not any(same_color(line.get_color(), BOUND) for line in decay.lines)  # none that the run may cross
    assert decay.get_window_extent().height >= 0.55 * decay.figure.bbox.height


def test_where_delays_are_too_short_for_a_run_the_states_say_that_they_are_without() -> None:
    graph = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)])
    cert = certify(graph, PROTOCOL, [1, 0, 2], messages=LateMessages(delay="1e-9"), asks=Asks(method="paper"))
    (ax,) = plot_run(cert).axes
    assert ax.get_legend().get_title().get_text() == "without late messages"  # type: ignore[union-attr]


# ---------------------------------------------------------------------- spectra and frontiers


@pytest.mark.few(0)
@pytest.mark.parametrize("name", NAMES)
def test_spectra_with_the_line_of_a_bounded_input(name: str) -> None:
    cert = certified(name)
    ax, spectrum = drawn(plot_spectrum(cert)), laplacian_spectrum(cert.structure)
    shown = labelled(ax)
    if spectrum.nonzero.size:
        points = shown["nonzero eigenvalues"].get_xydata()  # type: ignore[attr-defined]
        assert np.array_equal(points, np.stack([spectrum.nonzero.real, spectrum.nonzero.imag], axis=1))
    zeros = [label for label in shown if label.startswith("zero eigenvalues")]
    many = spectrum.kernel_dimension
    assert zeros == ([] if not many else ["zero eigenvalues" + (f" ({many})" if many > 1 else "")])
    (line,) = (handle for label, handle in shown.items() if "kappa" in label)
    p = cert.protocol
    assert line.get_xdata()[0] == float(1 / (p.rho2 * p.kappa))  # type: ignore[attr-defined]
    assert len(ax.lines) == bool(spectrum.nonzero.size) + bool(many) + 1
    bounded = cert.effort is not None and cert.effort.bounded
    assert bounded == (spectrum.nonzero.real > float(1 / (p.rho2 * p.kappa))).all()
    across, up = (ax.transData.transform(p) - ax.transData.transform((0, 0)) for p in ((1, 0), (0, 1)))
    assert across[0] == pytest.approx(up[1])


def test_spectra_without_a_line() -> None:
    structure = analyse(graph_of("fig1a"))
    endless = NominalProtocol(T=1, rho1=1, rho2=0, kappa=1)
    for protocol in (None, endless):
        ax = drawn(plot_spectrum(structure, protocol=protocol))
        assert not any("kappa" in label for label in labelled(ax))
        assert ax.get_xlabel() == "real part of eigenvalue" and ax.get_ylabel() == "imaginary part of eigenvalue"


@pytest.mark.few(0)
@pytest.mark.parametrize("name", NAMES[:-1])
def test_frontiers_hold_every_proved_function(name: str) -> None:
    cert = certified(name)
    ax = drawn(plot_frontier(cert))
    shown, functions = labelled(ax), cert.envelope.functions
    assert {m.kind for m in functions} == set(shown) & set(CLASS_MARKERS)
    found = sorted((label, *point) for label in set(shown) & set(CLASS_MARKERS) for point in shown[label].get_xydata())  # type: ignore[attr-defined]
    assert found == sorted((m.kind, m.overshoot_above, m.rate_below) for m in functions)
    for label, rate in (
        ("upper bound (proved)", cert.upper_bound),
        ("spectral rate (numerical)", cert.spectral_rate),
    ):
        assert rate is not None and shown[label].get_ydata()[0] == float(rate)  # type: ignore[attr-defined]
        assert ax.get_ylim()[0] <= rate < ax.get_ylim()[1]
    assert ax.get_xscale() == "log" and max(m.rate for m in functions) <= ax.get_ylim()[1]


def test_no_frontier_without_decay() -> None:
    with pytest.raises(ValueError, match="holds no proved Lyapunov function"):
        plot_frontier(certified("single"))


def test_figures_are_drawn_into_given_axes() -> None:
    cert = certified("fig3b")
    run = cert.trajectory
    assert run is not None
    axes = Figure().subplots(2, 2).ravel()
    given = [
        plot_input(run, ax=axes[0]),
        plot_graph(cert.graph, ax=axes[1]),
        plot_spectrum(cert.structure, ax=axes[2]),
        plot_frontier(cert, ax=axes[3]),
    ]
    assert all(a is b for a, b in zip(given, axes, strict=True))
    drawn(axes[0])


# ---------------------------------------------------------------------- decay, runs, style


@pytest.mark.few(0)
@pytest.mark.parametrize("axis", ["left", "time", "clock"])
def test_the_decay_lies_under_the_bound_and_the_bound_is_the_best_of_all(axis: str) -> None:
    cert = certified("fig3b")
    run = cert.trajectory
    assert run is not None
    ax = drawn(plot_decay(cert, axis=axis))
    shown = labelled(ax)
    before = run.remaining > 0
    T = float(run.protocol.T)
    place = {"left": run.remaining, "time": T * (1 - run.remaining), "clock": run.clock}[axis][before]
    bound, seen = shown["proved bound from $x(0)$"], shown["simulated (CVODES)"]
    floor = shown["integrator's floor"].get_ydata()[0]  # type: ignore[attr-defined]
    assert np.array_equal(bound.get_xdata(), place)  # type: ignore[attr-defined]
    height, size = bound.get_ydata(), seen.get_ydata()  # type: ignore[attr-defined]
    there = np.isfinite(size)
    assert size[0] == 1 and there[: there.sum()].all() and not there.all()
    assert (size[there] <= height[there] * (1 + 1e-6)).all() and size[there].min() > floor
    assert f"bound of Theorem {cert.theorem.number}" in shown
    functions = [line.get_ydata() for line in ax.lines if len(line.get_ydata()) > 2 and line not in (bound, seen)]
    assert len(functions) == len(cert.envelope.functions) > 1
    assert np.array_equal(height, np.minimum.reduce(functions))
    if axis == "clock":  # straight lines: the slope is half the rate
        for function, y in zip(cert.envelope.functions, functions, strict=True):
            assert y == pytest.approx(y[0] * np.exp(-function.rate_below * place / 2), rel=1e-9)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["fig1a", "fig3a", "fig5b", "apart"])
def test_no_run_is_drawn_above_a_bound(name: str) -> None:
    cert = certified(name)
    shown = labelled(plot_decay(cert))
    seen, bound = (np.asarray(shown[which].get_ydata()) for which in ("simulated (CVODES)", "proved bound from $x(0)$"))  # type: ignore[attr-defined]
    assert np.isfinite(seen).sum() > 20 and not (seen > bound * (1 + 1e-6)).any()
    norm = np.linalg.norm(cert.trajectory.error, axis=0) if cert.trajectory else np.zeros(0)
    alone = np.asarray(labelled(plot_decay(cert.trajectory))["simulated (CVODES)"].get_ydata())  # type: ignore[attr-defined]
    kept = np.isfinite(alone)
    assert alone[kept] == pytest.approx((norm / norm[0])[: kept.size][kept])


@pytest.mark.parametrize(("first", "factor"), [(0.0, 50.0), (0.0, 1e6), (0.999, 1e4)])
def test_a_run_that_violates_its_bound_is_seen_to_do_so(first: float, factor: float) -> None:
    cert = certified("fig3b")
    run = cert.trajectory
    assert run is not None
    late = 1 - run.remaining > first
    states = np.where(late, run.states[:, -1:] + factor * (run.states[:, :1] - run.states[:, -1:]), run.states)
    ax = plot_decay(replace(run, states=states), certificate=cert)
    x, y = labelled(ax)["simulated (CVODES)"].get_data()  # type: ignore[attr-defined]
    inside = (y > labelled(ax)["proved bound from $x(0)$"].get_ydata()) & (y < ax.get_ylim()[1])  # type: ignore[attr-defined]
    inside &= (x <= max(ax.get_xlim())) & (x >= min(ax.get_xlim()))
    assert inside.sum() > 20


def test_the_decay_needs_a_proved_bound_and_a_known_axis() -> None:
    cert = certified("fig3b")
    with pytest.raises(ParameterError, match='axis "days" is unknown; one of left, time, clock'):
        plot_decay(cert, axis="days")
    with pytest.raises(ParameterError, match="has no initial state"):
        plot_decay(certify(cert.graph, cert.protocol, asks=Asks(simulation=False)))
    with pytest.raises(ParameterError, match="holds no proved bound"):
        plot_decay(certified("single"))
    with pytest.raises(ParameterError, match="another initial state"):
        plot_decay(
            cert.trajectory, certificate=certify(cert.graph, cert.protocol, [1] * 6, asks=Asks(simulation=False))
        )


@pytest.mark.few(0)
def test_of_a_certificate_without_a_run_the_bounds_are_drawn_and_states_simulated(tmp_path: Path) -> None:
    cert = certified("fig3b")
    cert.save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    assert saved.trajectory is None
    assert not any(label.startswith("simulated") for label in labelled(drawn(plot_decay(saved))))
    for plot in (plot_trajectory, plot_input):
        lines = (agent_lines(plot(one)) for one in (saved, cert))
        for again, first in zip(*lines, strict=True):
            assert again.get_ydata()[:50] == pytest.approx(first.get_ydata()[:50], nan_ok=True)  # type: ignore[index]
    assert drawn(plot_spectrum(saved)) and drawn(plot_graph(saved))


# ---------------------------------------------------------------------- what an editor of figures asks


CHAIN = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1), ("c", "d", -1)])
MOVING: dict[str, dict[str, Any]] = {
    "late": {"messages": LateMessages(delay="0.05")},
    "capped": {"messages": LateMessages(delay="0.0005", own_delay=True, gain_cap=20)},
    "leaders": {"leaders": MovingLeaders(speed=1)},
    "sign": {"leaders": MovingLeaders(speed=1, sign_gain=1)},
}


@cache
def gallery() -> dict[str, Figure]:
    """Every figure at the width of a column, of few agents, of many, and of one, drawn."""
    plots: list[tuple[Callable[..., Any], Sequence[str]]] = [
        *(
            (plot, ("fig3b", "fig5b", "single", "sliding", "wide"))
            for plot in (plot_trajectory, plot_input, plot_graph)
        ),
        (plot_decay, ("fig3b", "fig5b", "sliding")),
        *((plot, ("fig3b",)) for plot in (plot_effort, plot_spectrum, plot_frontier)),
        *((plot, ("sliding",)) for plot in (plot_run, plot_sliding)),
    ]
    figures = {f"{name} {plot.__name__}": plot(certified(name)).figure for plot, names in plots for name in names}
    pair = design(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]), max_input=10, initial_bound=1)
    figures["pair plot_trade_off"] = plot_trade_off(pair).figure
    for name, asked in MOVING.items():
        cert = certify_words(
            CHAIN, NominalProtocol(1, 1, 2, 1), [1, 3, -2, 4], method="perron", simulation=False, **asked
        )
        plot = plot_tracking
        figures[f"{name} {plot.__name__}"] = plot(cert, time_unit="s").figure
    for figure in figures.values():
        FigureCanvasAgg(figure).draw()
    return figures


@pytest.mark.few(0)
def test_no_text_of_a_figure_overlaps_another_or_leaves_the_figure_or_is_small() -> None:
    for name, figure in gallery().items():
        texts = {text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()}
        for ax in figure.axes:
            texts -= set(unseen_texts(ax))
        boxes = {text: Text.get_window_extent(text) for text in texts}
        assert boxes
        for text, box in boxes.items():
            assert text.get_fontsize() >= 7, (name, text)
            inside = box.x0 > -2 and box.y0 > -2 and box.x1 < figure.bbox.width + 2 and box.y1 < figure.bbox.height + 2
            assert inside, (name, text)
        for (text, box), (other, near) in combinations(boxes.items(), 2):
            width = min(box.x1, near.x1) - max(box.x0, near.x0)
            height = min(box.y1, near.y1) - max(box.y0, near.y0)
            assert width < 1 or height < 2, (name, text.get_text(), other.get_text())


@cache
def further() -> list[Figure]:
    """Figures of every other kind: of families, of agents of order n, of many agents, at a glance."""
    day = ptcc_certify.as_family([("ann", "bob", 1, 2), ("bob", "eve", -1, -1)])
    night = SignedDigraph.from_edges([("ann", "bob", 1), ("bob", "eve", -2)])
    family = certify_family(Family.switching({"day": day, "night": night}), PROTOCOL, [1, 4, -3])
    depends = certify_family(ptcc_certify.as_family([("a", "b", 1, 1), ("b", "a", -1, 0)]), PROTOCOL, [1, 4])
    asked: dict[str, Any] = {"agents": ptcc_certify.Agents(order=2), "asks": Asks(method="paper", simulation=False)}
    plane = certify(CHAIN, PROTOCOL, [[k, 2 - k] for k in range(4)], **asked)
    parts = depends.family_proof.parts
    drawn = [plot_graph(family), plot_trajectory(family), plot_decay(family), plot_input(family)]
    drawn += [plot_counterexample(parts[0].component), plot_final_states(certified("fig5b")), plot_formation(plane)]
    drawn += [plot_degrees(CHAIN), plot_motion(plane), *map(plot_glance, (family, plane, certified("fig3b")))]
    return [one.figure for one in drawn]


def light(colour: Any) -> np.ndarray:
    """Red, green and blue as light, without the gamma of sRGB."""
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast(colour: Any) -> float:
    """The contrast to white by WCAG 2."""
    return float(1.05 / (light(colour) @ [0.2126, 0.7152, 0.0722] + 0.05))


@pytest.mark.few(0)
def test_every_text_of_every_figure_is_dark_enough_on_white_and_white_ones_stand_on_dark_nodes() -> None:
    seen = 0
    for figure in [*gallery().values(), *further()]:
        for ax in figure.axes:
            nodes = [
                line.get_color() for line in ax.lines if line.get_marker() in ("o", "s", "D") and len(line.get_xdata())
            ]
            for text in (text for text in ax.texts if same_color(text.get_color(), "white")):
                assert nodes and min(contrast(node) for node in nodes if not same_color(node, "white")) >= 4.5, text
        colours = {text.get_color() for text in figure.findobj(Text) if text.get_text().strip()}
        seen += len(colours)
        assert all(contrast(colour) >= 4.5 or same_color(colour, "white") for colour in colours), colours
    assert seen > 60


#: What is left of light to eyes without cones of green: Machado, Oliveira and Fernandes (2009), severity 1.
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear light of sRGB."""
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    xyz = to_xyz @ np.clip(rgb, 0, 1) / [0.95047, 1, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_camps_differ_in_their_lines_and_to_eyes_without_cones_of_green_in_their_colours() -> None:
    """The distance is that of CIE 1976, of which about 2 is just seen; edges of either sign, and their lines, too."""
    styles = {name: style for name, style in CAMP_STYLES.items() if name != "agents"}  # where no other part is
    for (one, (colour, line)), (other, (second, dashes)) in combinations(styles.items(), 2):
        for seen in (np.eye(3), DEUTERANOPIA):
            apart = np.linalg.norm(lab(seen @ light(colour)) - lab(seen @ light(second)))
            assert apart >= 20, (one, other, apart)
        assert line != dashes
    (ally, line, _), (opponent, dashes, _) = EDGE_STYLES.values()
    assert np.linalg.norm(lab(DEUTERANOPIA @ light(ally)) - lab(DEUTERANOPIA @ light(opponent))) >= 20
    assert line != dashes


@pytest.mark.few(0)
@pytest.mark.parametrize("names", ["abcd", "a very long name of somebody", "fourteen wide", "北京市朝阳区"])
def test_names_leave_more_than_half_of_the_width_to_the_time_up_to_the_deadline(names: str) -> None:
    labels = [f"{names[:-2]}{k} {names[-2:]}" for k in range(4)]
    graph = SignedDigraph.from_edges([(a, b, 1) for a, b in pairwise(labels)])
    cert = certify(graph, PROTOCOL, [1, -2, 3, 7], asks=Asks(simulation=False))
    for ax in (plot_trajectory(cert), plot_input(cert), *plot_glance(cert).axes[1:]):
        whole = ax.figure.figure if ax.get_subplotspec() is None else ax.figure
        FigureCanvasAgg(ax.figure.figure).draw()  # type: ignore[union-attr]
        begin, end = ax.transData.transform([[0, 0], [1, 0]])[:, 0]
        assert end - begin >= TIME_SHARE * whole.bbox.width
        for text in ax.texts:
            assert all(len(line) <= NAME_LENGTH + 9 for line in text.get_text().split("\n"))


@pytest.mark.few(0)
def test_names_of_any_script_lie_right_of_the_axis() -> None:
    for name in ("wide", "fig3b", "single"):
        for plot in (plot_trajectory, plot_input):
            ax = gallery()[f"{name} {plot.__name__}"].axes[0]
            edge = ax.get_window_extent().x0
            assert min(Text.get_window_extent(text).x0 for text in ax.texts) > edge, (name, plot)


def test_names_beside_axes_that_have_their_place_lie_right_of_the_axis_too() -> None:
    for name in ("fig3b", "sliding", "wide"):
        for ax, plot in zip(Figure((8, 7)).subplots(2, 2).ravel(), (plot_trajectory, plot_input), strict=False):
            drawn(plot(certified(name), ax=ax))
            inside = [Text.get_window_extent(text) for text in ax.texts if text is not peak_of(ax)]
            assert min(box.x0 for box in inside) > ax.get_window_extent().x0, (name, plot)


def test_names_at_the_end_stand_where_lines_end_in_the_figure() -> None:
    """Leaders move on after ``T``, to half of it more, which is not all shown."""
    cert = certify_words(CHAIN, NominalProtocol(1, 1, 2, 1), [1, 3, -2, 4], method="perron", **MOVING["leaders"])
    run, ax = cert.asked_trajectory, drawn(plot_trajectory(cert))
    assert run is not None and run.t[-1] > ax.get_xlim()[1] > 1
    ends = [text for text in ax.texts if text.xy[0] > 1]  # type: ignore[attr-defined]
    assert ends
    for text in ends:
        at = [np.interp(ax.get_xlim()[1], run.t, run.states[list(cert.graph.labels).index(k)]) for k in "abcd"]
        assert min(abs(text.xy[1] - x) for x in at) < 0.05  # type: ignore[attr-defined]


def test_ticks_leave_a_power_of_ten_to_the_label_of_the_axis() -> None:
    ax = gallery()["wide plot_trajectory"].axes[0]
    assert ax.get_ylabel() == "state $x_k$ / $10^{12}$"
    assert not ax.yaxis.get_offset_text().get_visible()


def unseen_texts(ax: Axes) -> list[Text]:
    """The texts of ticks outside the range, and all of axes that are off: matplotlib keeps, but does not draw them."""
    unseen = [] if ax.axison else [ax.xaxis.label, ax.yaxis.label]
    for axis in (ax.xaxis, ax.yaxis):
        low, high = sorted(axis.get_view_interval())
        reach = 1e-9 * (high - low)
        for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
            if not ax.axison or not low - reach <= tick.get_loc() <= high + reach:
                unseen += [tick.label1, tick.label2]
    return unseen


def test_every_figure_has_one_legend_above_its_axes() -> None:
    for name, figure in gallery().items():
        legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend() is not None)]
        alone = name.endswith("plot_trajectory") and len(set(camps(certified(name.split()[0]).structure))) == 1
        assert len(legends) == (not alone), name  # lines of one part need no legend
        for legend in legends:
            bottom = legend.get_window_extent().y0  # type: ignore[union-attr]
            assert all(bottom >= ax.get_window_extent().y1 - 2 for ax in figure.axes), name


def test_every_figure_names_the_unit_of_time() -> None:
    cert = certified("sliding")
    for plot in (plot_trajectory, plot_input, plot_effort, plot_sliding):
        assert plot(cert, time_unit="ms").get_xlabel() == "time $t$ (ms)"
        assert plot(cert).get_xlabel() == "time $t$"
    assert plot_decay(cert, axis="time", time_unit="ms").get_xlabel() == "time $t$ (ms)"
    assert [ax.get_xlabel() for ax in plot_run(cert, time_unit="s").axes] == ["", "time $t$ (s)"]


def test_every_figure_has_one_signature() -> None:
    names = [name for name in ptcc_certify.__all__ if name.startswith("plot_")]
    assert len(names) == 15
    for name in names:
        subject, *keywords = inspect.signature(getattr(ptcc_certify, name)).parameters.values()
        assert subject.name == "subject" and subject.default is inspect.Parameter.empty
        assert all(one.kind is inspect.Parameter.KEYWORD_ONLY for one in keywords)
        assert name in ("plot_run", "plot_motion", "plot_glance") or (keywords[0].name, keywords[0].default) == (
            "ax",
            None,
        )


def test_a_subject_that_leads_to_no_figure_is_refused_with_the_mend() -> None:
    with pytest.raises(ParameterError, match="a trajectory or a certificate, not from str; give certify"):
        plot_trajectory("fig1a")
    with pytest.raises(ParameterError, match="drawn from a certificate, not from SignedDigraph; give certify"):
        plot_frontier(graph_of("fig1a"))
    with pytest.raises(ParameterError, match="drawn from a certificate, not from str; give certify"):
        plot_tracking("fig1a")
    with pytest.raises(ParameterError, match="says nothing of late messages or of leaders that move"):
        plot_tracking(certified("fig1a"))
    with pytest.raises(ParameterError, match="no sliding variables; simulate under the sliding-mode protocol"):
        plot_sliding(certified("fig1a"))
    run = certified("fig1a").trajectory
    assert run is not None
    with pytest.raises(ParameterError, match="holds states that are not finite"):
        plot_decay(replace(run, states=run.states * np.nan))


def test_figures_without_axes_have_the_style_and_a_column_of_width(tmp_path: Path) -> None:
    import matplotlib.pyplot as plt
    from matplotlib import rc_params_from_file

    run = certified("fig1a").trajectory
    assert run is not None
    ax = drawn(plot_trajectory(run))
    assert tuple(ax.figure.get_size_inches()) == SINGLE_COLUMN
    assert plot_run(run, wide=True).get_figwidth() == DOUBLE_COLUMN[0]
    styled = rc_params_from_file(STYLE_FILE, use_default_template=False)
    assert ax.xaxis.label.get_size() == styled["axes.labelsize"]
    assert {tick.get_size() for tick in ax.get_xticklabels()} == {styled["xtick.labelsize"]}
    assert {text.get_size() for text in ax.get_legend().get_texts()} == {styled["legend.fontsize"]}
    with plt.style.context(STYLE):
        assert plt.rcParams["font.size"] == styled["font.size"]
    own = Figure().add_subplot()
    plot_trajectory(run, ax=own)
    assert own.xaxis.label.get_size() == plt.rcParams["font.size"]


def test_saved_figures_appear_whole_and_are_vectors_where_asked(tmp_path: Path) -> None:
    ax = plot_graph(analyse(graph_of("fig1b")))
    for name, head in (("a.png", b"\x89PNG"), ("a.pdf", b"%PDF"), ("a.svg", b"<?xml"), ("B.SVG", b"<?xml")):
        save_figure(ax, tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(head)
    with pytest.raises(ParameterError, match=r"a\.gif: figures are written to \.png, \.pdf, \.svg"):
        save_figure(ax, tmp_path / "a.gif")
    assert len(list(tmp_path.iterdir())) == 4
    save_figure(Figure((1, 1)), tmp_path / "a.png")
    assert int.from_bytes((tmp_path / "a.png").read_bytes()[16:20]) == 300


@pytest.mark.few(0)
@pytest.mark.parametrize("name", NAMES)
def test_the_energy_grows_and_stays_under_its_bound(name: str) -> None:
    cert = certified(name)
    run = cert.trajectory
    assert run is not None
    ax = drawn(plot_effort(run, certificate=cert))
    shown = labelled(ax)
    spent = shown["simulated (CVODES)"].get_ydata()  # type: ignore[attr-defined]
    assert spent[0] == 0 and (np.diff(spent) >= 0).all()
    assert cert.effort is not None
    assert ("proved bound" in shown) == (cert.effort.energy is not None)
    if cert.effort.energy is not None:
        bound = shown["proved bound"].get_ydata()[0]  # type: ignore[attr-defined]
        assert bound == float(cert.effort.energy.value)
        assert spent[-1] <= bound
    columns = simulate(cert.graph, cert.protocol, np.ones((cert.graph.n_nodes, 2)), times=[0])
    with pytest.raises(ValueError, match="holds 2 initial states"):
        plot_effort(columns)


@pytest.mark.parametrize(
    "gains", [(1, 1, 1, 2), (1, 1, 1, 50), (2, 100, 1, 1), (1, 1, 10, 100), (1, 0.1, 0.1, 1), (1, 0.1, 0.25, 1)]
)
def test_the_energy_is_that_of_the_closed_form_or_refused(gains: tuple[float, ...]) -> None:
    """Of a pair ``E = e^(-2 s) E(0)``; the last three are too fast for the samples, and infinite."""
    T, rho1, rho2, kappa = gains
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    run = simulate(pair, NominalProtocol(T=T, rho1=str(rho1), rho2=str(rho2), kappa=kappa), [3, 5])

    def power(t: float) -> float:
        gain, s = rho1 + rho2 * kappa / (T - t), rho1 * t + rho2 * kappa * math.log(T / (T - t))
        return 2 * (2 * gain * math.exp(-2 * s)) ** 2

    if gains[-2:] in ((10, 100), (0.1, 1), (0.25, 1)):
        with pytest.raises(ValueError, match="do not settle the energy"):
            plot_effort(run)
        return
    spent = plot_effort(run).lines[0].get_ydata()
    assert np.asarray(spent)[-1] == pytest.approx(quad(power, 0, T, limit=500)[0], rel=5e-3)


@pytest.mark.parametrize("size", [1e299, 1e154])
@pytest.mark.parametrize("actuator", [None, GainLimits(gain_cap=50), GainLimits(sample_period="0.05")])
def test_an_energy_beyond_floats_is_refused_without_a_warning(size: float, actuator: GainLimits | None) -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    run = simulate(pair, PROTOCOL, [size, 0], actuator=actuator)
    with pytest.raises(ValueError, match="the energy is beyond the range of floats"):
        plot_effort(run)


def test_no_certified_line_for_a_run_from_elsewhere() -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    cert = certify(pair, PROTOCOL, [3, 5], asks=Asks(simulation=False))
    late = simulate(pair, PROTOCOL, [300, -500], times=[0.01, 0.1, 0.5, 0.9, 1])
    for draw in (plot_input(late, certificate=cert), plot_effort(simulate(pair, PROTOCOL, [3, 5]), certificate=cert)):
        labels = set(labelled(draw))
        assert ("proved bound" in labels) == draw.get_ylabel().startswith("energy")
        assert peak_of(draw) is None
    near = certify(pair, PROTOCOL, [10**13, 10**13 + 1], asks=Asks(simulation=False))
    with pytest.raises(ValueError, match="another initial state than"):
        plot_input(simulate(pair, PROTOCOL, [1e13, 1e13 + 8]), certificate=near)


@pytest.mark.few(0)
@pytest.mark.parametrize("size", thinned(["1e-250", "1e13", "1e155", "1e250"], 3))
def test_starts_of_any_size_are_drawn(size: str) -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    start = [Fraction(size), -Fraction(size) / 3]
    cert = certify(pair, PROTOCOL, start)
    run = cert.trajectory
    assert run is not None
    for ax in (plot_trajectory(run), plot_input(cert), plot_decay(cert)):
        drawn(ax)
    norm = labelled(plot_decay(cert))["simulated (CVODES)"].get_ydata()  # type: ignore[attr-defined]
    small = certify(pair, PROTOCOL, [x / Fraction(size) for x in start])
    assert norm[:20] == pytest.approx(labelled(plot_decay(small))["simulated (CVODES)"].get_ydata()[:20])  # type: ignore[attr-defined]


@pytest.mark.parametrize("start", [["0.123", "-7.013", "2.739"], ["1/3", "-1e5", "1e-5"]])
def test_the_start_of_a_certificate_is_known_again_whatever_its_decimals(start: list[str]) -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1)])
    cert = certify(graph, PROTOCOL, start)
    assert cert.trajectory is not None
    assert peak_of(plot_input(cert)) is not None


def test_followers_are_not_drawn_among_the_leaders_of_a_ring():
    ring = [((k + 1) % 12 + 1, k + 1, 1 if k % 3 else -1) for k in range(12)]
    ring += [(k - 8, k + 1, 1) for k in range(12, 16)]
    ax = plot_graph(ring)
    *camps, followers = (np.column_stack(line.get_data()) for line in ax.lines if len(line.get_xdata()) > 1)
    leaders = np.concatenate(camps)
    assert (len(leaders), len(followers)) == (12, 4)
    assert (Delaunay(leaders).find_simplex(followers) < 0).all()


def test_ticks_of_time_do_not_overlap_beside_long_names():
    a, b, c, d = (letter * 40 for letter in "abcd")
    edges = [(a, b, 1), (b, a, -1), (b, c, 2), (c, d, -9), (d, c, 0.1)]
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    ax = plot_trajectory(simulate(SignedDigraph.from_edges(edges), protocol, [7, 3, 0, -5]))
    FigureCanvasAgg(ax.figure).draw()
    boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
    assert len(boxes) > 1 and all(a.x1 < b.x0 for a, b in pairwise(boxes))


@pytest.mark.few(0)
def test_names_of_agents_that_end_at_one_place_do_not_cover_each_other():
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    cert = ptcc_certify.certify(
        pair,
        protocol,
        [[3, 1], [1, 0]],
        agents=ptcc_certify.Agents(order=2),
        asks=ptcc_certify.Asks(method="paper", simulation=False),
    )
    texts = ptcc_certify.plot_formation(cert).texts
    assert [text.get_text() for text in texts] == ["a", "b", "a", "b"]  # where they begin, and where they end
    for first, second in (texts[:2], texts[2:]):
        assert np.hypot(*np.subtract(first.xyann, second.xyann)) > NAME_SIZE


@pytest.mark.few(0)
def test_coordinates_in_the_plane_stand_side_by_side():
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    cert = ptcc_certify.certify(
        pair,
        protocol,
        [[3, 1], [1, 0]],
        agents=ptcc_certify.Agents(order=2),
        asks=ptcc_certify.Asks(method="paper", simulation=False),
    )
    for wide in (False, True):
        axes = ptcc_certify.plot_motion(cert, wide=wide).axes
        assert axes[0].get_subplotspec().get_gridspec().get_geometry() == (2, 2)
        assert [ax.get_ylabel() for ax in axes] == ["position x", "position y", "velocity x", "velocity y"]
        assert [ax.get_xlabel() for ax in axes] == ["", "", "time $t$", "time $t$"]
        assert len({(ax.get_xlim(), tuple(ax.get_xticks())) for ax in axes}) == 1
        for ax in axes:  # velocities begin at 0, and are named where they are largest
            assert sorted(text.get_text() for text in ax.texts) == ["a", "b"]
            assert ax.spines["bottom"].get_bounds()[0] == 0


@pytest.mark.few(0)
def test_a_motion_names_its_agents_and_all_panels_have_the_same_times():
    pair = SignedDigraph.from_edges([("ann", "bob", 1), ("bob", "ann", 1)])
    agents, x0 = ptcc_certify.Agents(order=2), {"ann": [0, 1], "bob": [3, 1]}
    cert = certify(pair, NominalProtocol(T=1), x0, agents=agents, asks=Asks(method="paper", simulation=False))
    panels = ptcc_certify.plot_motion(cert).axes
    assert [sorted(text.get_text() for text in ax.texts) for ax in panels[:2]] == [["ann", "bob"], ["ann, bob"]]
    assert len(panels) == 4 and {ax.get_xlim() for ax in panels} == {panels[1].get_xlim()}
    assert "deadline $T$" in {text.get_text() for text in panels[0].figure.legends[0].get_texts()}


def test_states_and_sliding_variables_have_the_same_times() -> None:
    upper, lower = plot_run(certified("sliding")).axes
    assert upper.get_xlim() == lower.get_xlim() and list(upper.get_xticks()) == list(lower.get_xticks())
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("", "time $t$")


@pytest.mark.few(0)
def test_where_sliding_variables_are_0_neither_they_nor_their_deadline_are_announced() -> None:
    graph, x0 = SignedDigraph.from_edges([(1, 2, 1), (2, 1, -1)]), [1, 2]
    p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    for sigma0, moves in (([0, 0], False), ([1, 0], True)):
        cert = certify(graph, p, InitialState(x0, sigma0=sigma0), asks=Asks(method="paper"))
        assert cert.trajectory is not None
        for ax in (plot_trajectory(cert), plot_input(cert), plot_decay(cert)):
            assert any("$T_r$" in name for name in [*labelled(ax), *(text.get_text() for text in ax.texts)]) == moves
        assert ("drives the sliding variable" in report_html(read_certificate(cert))) == moves
        assert ("sliding variables over time" in trajectory_html(cert.trajectory)) == moves


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "ends", [(1, 1 + 2**-50, 1), (0, 0, 0), (1e-320, 2e-320, 0), (-1e300, 1e300, 3), (1e300, 1e300, 1e300)]
)
def test_bars_of_final_states_that_agree_but_for_last_digits_are_drawn(ends: tuple[float, ...]) -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("c", "d", 1), ("e", "f", 1)])
    states = [x for end in ends for x in (end, 0)]
    ax = drawn(plot_final_states(certify(graph, PROTOCOL, states, asks=Asks(simulation=False, method="paper"))))
    assert sum(bar.get_height() for bar in ax.patches) == 6  # type: ignore[attr-defined]
    low, high = ax.get_xlim()
    assert all(low <= x <= high for x in ends)


@pytest.mark.few(0)
def test_states_of_very_different_sizes_are_those_of_the_certificate(tmp_path: Path) -> None:
    """A run that is integrated less its targets begins at small states but for the rounding of large ones."""
    graph = SignedDigraph.from_edges([("a1", "a2", "11/50")], nodes=[f"a{k}" for k in range(6)])
    start, protocol = ["4e5", "4e5", "1e-7", "1e-7", "1/3", "1e-7"], NominalProtocol("0.133", "2.3", "8.3", 4)
    leaders, limits = MovingLeaders(speed="0.355"), GainLimits(gain_cap="2.28")
    moved = certify(graph, protocol, start, leaders=leaders, limits=limits, asks=Asks(simulation=False))
    assert write_report(moved, tmp_path / "moved.html") == "certified"


# ---------------------------------------------------------------------- journals and slides


def saved_size(path: Path) -> tuple[float, float]:
    """Width and height of a saved figure in inches."""
    data = path.read_bytes()
    if path.suffix == ".png":
        place = data.index(b"pHYs") + 4
        across = int.from_bytes(data[place : place + 4])  # per metre
        return tuple(int.from_bytes(data[k : k + 4]) / across / 0.0254 for k in (16, 20))  # type: ignore[return-value]
    size = re.search(rb"(?:MediaBox \[ 0 0 |width=\")([\d.]+)(?: |pt\" height=\")([\d.]+)", data)
    assert size is not None
    return float(size[1]) / 72, float(size[2]) / 72


@pytest.mark.few(1)
@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
@pytest.mark.parametrize(("purpose", "text"), [("ieee", 8.0), ("nature", 7.0), ("slide", 18.0)])
def test_figures_have_the_width_and_the_text_of_what_they_are_for(
    purpose: str, text: float, suffix: str, tmp_path: Path
) -> None:
    run, path = certified("fig3b").trajectory, tmp_path / f"a{suffix}"
    with figures_for(purpose) as sizes:
        for wide in (False, True):
            figure = plot_run(run, wide=wide)
            save_figure(figure, path)
            width, height = saved_size(path)
            assert width == pytest.approx(sizes.widths[wide], abs=2 / 300)
            assert purpose != "slide" or height == pytest.approx(width * 9 / 16, abs=2 / 300)
            drawn_to_saved = width / figure.get_figwidth()
            assert figure.axes[0].xaxis.label.get_size() * drawn_to_saved == pytest.approx(text, rel=0.01)
        if suffix == ".pdf" and purpose != "ieee":
            streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", path.read_bytes(), re.DOTALL)
            (page,) = [content for content in map(inflated, streams) if b" cm" in content[:200]]
            assert float(page.split(b" 0 0 ")[0].split()[-1]) == pytest.approx(drawn_to_saved, rel=1e-3)
    save_figure(plot_run(run), path)
    assert saved_size(path) == pytest.approx(SINGLE_COLUMN, abs=2 / 300)  # as before
    with figures_for(purpose, width=5):
        for drawing in (plot_graph(certified("fig3b")), plot_glance(certified("fig3b"))):
            save_figure(drawing, path)
            assert saved_size(path)[0] == pytest.approx(5, abs=2 / 300)


def inflated(stream: bytes) -> bytes:
    """The content of a stream of a PDF that is text."""
    try:
        return zlib.decompress(stream)
    except zlib.error:
        return b""


def test_nothing_is_cut_off_a_figure_that_is_drawn_smaller(tmp_path: Path) -> None:
    run, path, drawn = certified("fig3b").trajectory, tmp_path / "a.pdf", []
    for purpose in ("ieee", "nature"):
        figure = plot_run(run)
        with figures_for(purpose):
            save_figure(figure, path)
        streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", path.read_bytes(), re.DOTALL)
        page = max(map(inflated, streams), key=len)
        drawn.append([page.count(operator) for operator in (b" l\n", b" m\n", b" Do\n", b" re\n")])
    assert drawn[0] == drawn[1] and drawn[0][0] > 100


def test_states_have_their_unit_on_every_axis_of_theirs() -> None:
    cert = certified("sliding")
    with figures_for(state_unit="m"):
        assert plot_trajectory(cert).get_ylabel() == "state $x_k$ (m)"
        assert plot_sliding(cert).get_ylabel() == "sliding variable $\\sigma_k$ (m)"
        assert plot_glance(cert).axes[1].get_ylabel() == "state $x_k$ (m)"
        assert plot_input(cert).get_ylabel() == "input $u_k$"
    assert plot_trajectory(cert).get_ylabel() == "state $x_k$"


def test_what_figures_are_not_made_for_is_refused() -> None:
    for words, told in (({"purpose": "poster"}, "one of ieee, nature, slide"), ({"width": 0}, "0.5 to 100 inches")):
        with pytest.raises(ParameterError, match=told), figures_for(**words):  # type: ignore[arg-type]
            pass


def test_delays_of_edges_stand_at_their_arrows_and_inputs_have_the_colours_of_where_agents_end():
    graph = ptcc_certify.SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "b", -1)])
    lags = {("a", "b"): "0.02", ("b", "c"): "0.01", ("c", "b"): "0.03"}
    asks = ptcc_certify.Asks(simulation=False)
    p = ptcc_certify.NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    cert = ptcc_certify.certify(graph, p, [1, 2, 3], messages=ptcc_certify.LateMessages(lags), asks=asks)
    written = [text.get_text() for text in ptcc_certify.plot_graph(cert).texts]
    assert written[3:] == ["0.02", "0.01 / 0.03"]
    assert [text.get_text() for text in ptcc_certify.plot_graph(graph).texts] == ["a", "b", "c"]
    plain = ptcc_certify.certify(graph, p, [1, 2, 3], asks=asks)
    colours = {line.get_color() for line in ptcc_certify.plot_input(plain).lines[:3]}
    assert colours == {line.get_color() for line in ptcc_certify.plot_trajectory(plain).lines[:3]}
