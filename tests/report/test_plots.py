"""Figures, judged by their artists: what is drawn, in which colours, and where the lines are."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from scipy.integrate import quad

import ptcc_certify
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import EXAMPLES, load_graph, select
from ptcc_certify.graphs.digraph import SignedDigraph, Weights
from ptcc_certify.graphs.size_limits import DRAWN_NODES, KAMADA_NODES, LABELLED_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.nominal import NominalProtocol
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.graph import EDGE_STYLES, HALO, plot_graph
from ptcc_certify.report.plots.input import plot_effort, plot_input
from ptcc_certify.report.plots.spectrum import CLASS_MARKERS, plot_frontier, plot_spectrum
from ptcc_certify.report.plots.style import CAMP_COLOURS, DOUBLE_COLUMN, SINGLE_COLUMN, STYLE, save_figure
from ptcc_certify.report.plots.trajectory import plot_run, plot_trajectory
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import SlidingTrajectory
from ptcc_certify.theorems.lemmas import laplacian_spectrum

pytestmark = pytest.mark.filterwarnings("error")

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
    return load_graph(name)


@cache
def certified(name: str) -> Certificate:
    graph = graph_of(name)
    if name.startswith("fig"):
        example = select(name)[0][0]
        return certify(graph, example.protocol(), list(map(float, example.x0.split(","))))
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
            names[v] = "unbalanced leaders" if gauge is None else "first camp" if gauge[k] > 0 else "second camp"
    return names


def shows(drawn: np.ndarray, row: np.ndarray, scale: float) -> bool:
    """Whether a line is that of an agent; gaps, where nothing is resolved, hide nothing that is large at the start."""
    gaps = np.isnan(drawn)
    return np.array_equal(drawn[~gaps], row[~gaps]) and not (gaps[0] and row[0] > 1e-6 * scale)


# ---------------------------------------------------------------------- agents over time


@pytest.mark.parametrize("name", NAMES)
def test_the_input_is_drawn_by_camp_under_its_certified_peak(name: str) -> None:
    cert = certified(name)
    run = cert.trajectory
    assert run is not None
    states, ax = drawn(plot_trajectory(run, cert.structure)), drawn(plot_input(run, cert.structure, cert))
    n, peak = cert.graph.n_nodes, cert.effort and cert.effort.peak
    assert len(states.lines) == n + 1 and len(ax.lines) == n + 1 + (peak is not None)
    for values, axes in ((run.states, states), (np.abs(run.input), ax)):
        scale = np.abs(values[:, :1]).max()
        for row, camp in zip(values, camps(cert.structure), strict=True):
            colours = [line.get_color() for line in axes.lines[:n] if shows(line.get_ydata(), row, scale)]
            assert any(same_color(colour, CAMP_COLOURS[camp]) for colour in colours)
    assert set(labelled(ax)) == {*camps(cert.structure), "deadline"} | ({"certified peak"} if peak else set())
    if peak is not None:
        height = labelled(ax)["certified peak"].get_ydata()[0]  # type: ignore[attr-defined]
        assert height == float(peak.largest) >= np.abs(run.input).max() * (1 - 1e-9)
        assert ax.get_ylim()[0] < height < ax.get_ylim()[1] and ax.get_yscale() == "log"


def test_the_peak_is_drawn_where_it_holds_only() -> None:
    graph, start = graph_of("fig3b"), [-4, 3, -1, 2, -2, 5]
    protocol, capped = EXAMPLES[2].protocol(), GainLimits(gain_cap="0.5")
    cert = certify(graph, protocol, start, limits=[capped], simulation=False)
    assert cert.effort is not None and cert.effort.peak is not None
    own = float(cert.effort.residual[0].largest or 0)
    peak = float(cert.effort.peak.largest)
    expected = [
        ({}, peak),
        ({"actuator": capped}, own),
        ({"actuator": GainLimits(gain_cap=50)}, peak),
        ({"actuator": GainLimits(sample_period="0.01", stop_before="0.05")}, None),
        ({"disturbance": "sin(k*t)", "delta": 1, "actuator": capped}, None),
    ]
    assert 0 < own < peak
    for options, height in expected:
        run = simulate(graph, protocol, start, **options)
        ax = drawn(plot_input(run, cert.structure, cert))
        line = labelled(ax).get("certified peak")
        assert (line and line.get_ydata()[0]) == height  # type: ignore[attr-defined]
        assert height is None or np.abs(run.input).max() <= height * (1 + 1e-9)
        steps = {line.get_drawstyle() for line in ax.lines[:6]}
        assert steps == {"steps-post" if run.held_input is not None else "default"}
    region = certify(graph, protocol, start, initial_set=5, simulation=False)
    run = simulate(graph, protocol, start)
    assert region.effort is not None and region.effort.peak is not None
    assert "certified peak" not in labelled(plot_input(run, region.structure, region))


def test_an_input_without_bound_is_drawn_with_its_start() -> None:
    pair = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    slow = NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1)
    cert = certify(pair, slow, [1, -1])
    assert cert.trajectory is not None
    ax = drawn(plot_input(cert.trajectory, cert.structure, cert))
    size = np.abs(cert.trajectory.input)
    assert ax.get_ylim()[0] < size[:, 0].min() < 1e-3 * size.max() < size.max() < ax.get_ylim()[1]
    assert "certified peak" not in labelled(ax)


def test_the_input_of_the_sliding_mode() -> None:
    example = EXAMPLES[5]
    start, sigma0 = (list(map(float, text.split(","))) for text in (example.x0, example.sigma0 or ""))
    graph = graph_of("fig3b")
    cert = certify(graph, example.protocol(), start, sigma0=sigma0, disturbance=example.disturbance)
    assert cert.trajectory is not None
    ax = drawn(plot_input(cert.trajectory, cert.structure, cert))
    assert {"deadline", "$T_r$"} <= set(labelled(ax))
    peak = cert.effort and cert.effort.peak
    assert ("certified peak" in labelled(ax)) == (peak is not None)
    run = cert.trajectory
    assert isinstance(run, SlidingTrajectory)
    late = run.t > float(run.protocol.T)  # there the input answers the disturbance alone
    answers = {line.get_ydata()[late].round(6).tobytes() for line in ax.lines[:6]}
    assert answers == {row.round(6).tobytes() for row in np.abs(run.disturbance[:, late])}
    other = certify(graph, example.protocol(), start, sigma0=[1.0] * 6, simulation=False)
    with pytest.raises(ValueError, match=r"another sigma\(0\) than"):
        plot_input(cert.trajectory, cert.structure, other)


def test_a_certificate_of_something_else_is_refused() -> None:
    cert, structure = certified("fig1a"), certified("fig1a").structure
    run = cert.trajectory
    assert run is not None and cert.initial_state is not None
    other = certified("fig3b")
    with pytest.raises(ValueError, match="another graph than"):
        plot_input(run, structure, other)
    with pytest.raises(ValueError, match="another protocol than"):
        plot_input(run, structure, certify(cert.graph, PROTOCOL, cert.initial_state, simulation=False))
    with pytest.raises(ValueError, match="another initial state than"):
        plot_input(run, structure, certify(cert.graph, cert.protocol, [1] * 6, simulation=False))
    without = certify(cert.graph, cert.protocol, simulation=False)
    assert "certified peak" not in labelled(plot_input(run, structure, without))
    columns = simulate(cert.graph, cert.protocol, np.eye(6)[:, :2], times=[0])
    with pytest.raises(ValueError, match="holds 2 initial states; draw the input of one"):
        plot_input(columns, structure)


# ---------------------------------------------------------------------- graphs


@pytest.mark.parametrize("name", NAMES)
def test_graphs_have_a_node_for_every_agent_and_an_arrow_for_every_edge(name: str) -> None:
    structure = analyse(graph_of(name))
    graph, ax = structure.graph, drawn(plot_graph(structure))
    assert [text.get_text() for text in ax.texts] == list(graph.labels)
    place = np.array([text.xy for text in ax.texts])
    group = camps(structure)
    found = {}
    for collection in ax.collections:
        for point in collection.get_offsets():
            size = float(collection.get_sizes()[0])
            found[tuple(point)] = to_hex(collection.get_facecolor()[0]), to_hex(collection.get_edgecolor()[0]), size
    assert len(found) == graph.n_nodes
    for point, camp in zip(place, group, strict=True):
        colour, edge, _ = found[tuple(point)]
        assert same_color(colour, CAMP_COLOURS[camp])
        assert (edge == "#000000") == (camp != "followers")
    sizes = {(found[tuple(p)][2], camp == "followers") for p, camp in zip(place, group, strict=True)}
    if len(sizes) == 2:
        assert min(s for s, follows in sizes if not follows) > max(s for s, follows in sizes if follows)
    arrows = [patch for patch in ax.patches if isinstance(patch, FancyArrowPatch)]
    assert len(arrows) == graph.n_edges
    for arrow, source, target, sign in zip(arrows, graph.source, graph.target, graph.sign, strict=True):
        ends = arrow._posA_posB  # type: ignore[attr-defined]
        assert np.array_equal(ends, [place[source], place[target]])
        colour, line, _ = EDGE_STYLES[int(sign)]
        assert same_color(arrow.get_edgecolor(), colour) and arrow.get_linestyle() == line
    signs = {EDGE_STYLES[int(sign)][2] for sign in graph.sign}
    ground = {"leader group"} if "followers" in group else set()
    assert set(labelled(ax)) == {*group} | signs | ground


def test_the_layout_is_the_same_in_every_run_and_separates_the_nodes() -> None:
    for graph in (graph_of("apart"), ring(KAMADA_NODES + 10)):
        first, again = (np.vstack([c.get_offsets() for c in plot_graph(analyse(graph)).collections]) for _ in range(2))
        assert np.array_equal(first, again)
        gaps = np.linalg.norm(first[:, None] - first[None], axis=-1) + np.eye(len(first))
        assert gaps.min() > 0.1 / math.sqrt(len(first))


def ring(n: int) -> SignedDigraph:
    return SignedDigraph.from_edges([(k, k % n + 1, 1) for k in range(1, n + 1)])


def test_large_graphs_are_drawn_without_labels_or_refused() -> None:
    assert len(plot_graph(analyse(ring(LABELLED_NODES))).texts) == LABELLED_NODES
    assert not plot_graph(analyse(ring(LABELLED_NODES + 1))).texts
    assert len(drawn(plot_graph(analyse(ring(DRAWN_NODES)))).patches) == DRAWN_NODES
    with pytest.raises(ValueError, match=r"^graphs are drawn up to 300 nodes; this one has 301$"):
        plot_graph(analyse(ring(DRAWN_NODES + 1)))


def test_labels_are_drawn_as_they_are() -> None:
    edges = [("$x_1$", r"$\frac$", 1), (r"$\frac$", "lone \ud800", -1), ("lone \ud800", "a very long name", 1)]
    ax = drawn(plot_graph(analyse(SignedDigraph.from_edges(edges))))
    assert [text.get_text() for text in ax.texts] == ["$x_1$", r"$\frac$", "lone ?", "a very long ..."]


# ---------------------------------------------------------------------- spectra and frontiers


@pytest.mark.parametrize("name", NAMES)
def test_spectra_with_the_line_of_a_bounded_input(name: str) -> None:
    cert = certified(name)
    ax, spectrum = drawn(plot_spectrum(cert.structure, cert.protocol)), laplacian_spectrum(cert.structure)
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
        ax = drawn(plot_spectrum(structure, protocol))
        assert not any("kappa" in label for label in labelled(ax))
        assert ax.get_xlabel() == "real part of eigenvalue" and ax.get_ylabel() == "imaginary part of eigenvalue"


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
        plot_input(run, cert.structure, ax=axes[0]),
        plot_graph(cert.structure, axes[1]),
        plot_spectrum(cert.structure, ax=axes[2]),
        plot_frontier(cert, axes[3]),
    ]
    assert all(a is b for a, b in zip(given, axes, strict=True))
    drawn(axes[0])


# ---------------------------------------------------------------------- decay, runs, style


@pytest.mark.parametrize("axis", ["left", "time", "clock"])
def test_the_decay_lies_under_the_bound_and_the_bound_is_the_best_of_all(axis: str) -> None:
    cert = certified("fig3b")
    run = cert.trajectory
    assert run is not None
    ax = drawn(plot_decay(cert, axis=axis))
    shown = labelled(ax)
    before = run.remaining > 0
    place = {"left": run.remaining, "time": 1 - run.remaining, "clock": run.clock}[axis][before]
    bound, seen = shown["proved bound"], shown["simulated (CVODES)"]
    floor = shown["integrator's floor"].get_ydata()[0]  # type: ignore[attr-defined]
    assert np.array_equal(bound.get_xdata(), place)  # type: ignore[attr-defined]
    height, size = bound.get_ydata(), seen.get_ydata()  # type: ignore[attr-defined]
    assert size[0] == 1 and (size <= height * (1 + 1e-9) + floor).all()
    functions = [line.get_ydata() for line in ax.lines if line.get_xdata() is not None and len(line.get_ydata()) > 2]
    functions = [y for y in functions if y is not height and y is not size]
    assert len(functions) == len(cert.envelope.functions) > 1
    assert np.array_equal(height, np.minimum.reduce(functions))
    if axis == "clock":  # straight lines: the slope is half the rate
        for function, y in zip(cert.envelope.functions, functions, strict=True):
            assert y == pytest.approx(y[0] * np.exp(-function.rate_below * place / 2), rel=1e-9)


def test_the_decay_needs_a_run_and_a_known_axis() -> None:
    cert = certified("fig3b")
    with pytest.raises(ValueError, match='axis "days" is unknown; one of left, time, clock'):
        plot_decay(cert, axis="days")
    with pytest.raises(ValueError, match="holds no simulated run"):
        plot_decay(certify(cert.graph, cert.protocol, [1] * 6, simulation=False))


def test_closed_components_have_a_ground_where_there_are_followers() -> None:
    def grounds(name: str) -> int:
        return sum(same_color(line.get_color(), HALO[0]) and len(line.get_xdata()) > 0 for line in ax_of(name).lines)

    def ax_of(name: str) -> Axes:
        return drawn(plot_graph(analyse(graph_of(name))))

    structure = analyse(graph_of("fig5b"))
    leaders = set(structure.leaders.tolist())
    pairs = zip(structure.graph.source.tolist(), structure.graph.target.tolist(), strict=True)
    assert grounds("fig5b") == len(leaders) + sum(s in leaders and t in leaders for s, t in pairs)
    assert grounds("fig1a") == 0
    assert "leader group" in labelled(ax_of("fig5b"))


def test_figures_without_axes_have_the_style_and_a_column_of_width(tmp_path: Path) -> None:
    import matplotlib.pyplot as plt
    from matplotlib import rc_params_from_file

    run = certified("fig1a").trajectory
    assert run is not None
    ax = drawn(plot_trajectory(run, certified("fig1a").structure))
    assert tuple(ax.figure.get_size_inches()) == SINGLE_COLUMN
    assert plot_run(run, certified("fig1a").structure, wide=True).get_figwidth() == DOUBLE_COLUMN[0]
    styled = rc_params_from_file(STYLE_FILE, use_default_template=False)
    assert ax.xaxis.label.get_size() == styled["axes.labelsize"]
    assert {tick.get_size() for tick in ax.get_xticklabels()} == {styled["xtick.labelsize"]}
    assert {text.get_size() for text in ax.get_legend().get_texts()} == {styled["legend.fontsize"]}
    with plt.style.context(STYLE):
        assert plt.rcParams["font.size"] == styled["font.size"]
    own = Figure().add_subplot()
    plot_trajectory(run, certified("fig1a").structure, own)
    assert own.xaxis.label.get_size() == plt.rcParams["font.size"]


def test_saved_figures_appear_whole_and_are_vectors_where_asked(tmp_path: Path) -> None:
    figure = plot_graph(analyse(graph_of("fig1b"))).figure
    for name, head in (("a.png", b"\x89PNG"), ("a.pdf", b"%PDF"), ("a.svg", b"<?xml"), ("B.SVG", b"<?xml")):
        save_figure(figure, tmp_path / name)  # type: ignore[arg-type]
        assert (tmp_path / name).read_bytes().startswith(head)
    with pytest.raises(ParameterError, match=r"a\.gif: figures are written to \.png, \.pdf, \.svg"):
        save_figure(figure, tmp_path / "a.gif")  # type: ignore[arg-type]
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.parametrize("name", ["fig1a", "fig3b", "fig5b"])
def test_no_text_of_a_figure_is_clipped_or_covers_the_data(name: str) -> None:
    """The legend lies above the axes, and every text inside the figure."""
    cert = certified(name)
    run = cert.trajectory
    assert run is not None
    axes = [
        plot_trajectory(run, cert.structure),
        plot_decay(cert),
        plot_input(run, cert.structure, cert),
        plot_graph(cert.structure),
        plot_spectrum(cert.structure, cert.protocol),
        plot_frontier(cert),
    ]
    for ax in axes:
        figure = ax.figure
        assert isinstance(figure, Figure)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        legend = ax.get_legend().get_window_extent(renderer)
        assert legend.y0 >= ax.get_window_extent(renderer).y1 - 1
        width, height = canvas.get_width_height()
        texts = [*ax.get_legend().get_texts(), ax.xaxis.label, ax.yaxis.label]
        for text in texts if ax.axison else texts[:-2]:
            box = text.get_window_extent(renderer)
            assert box.x0 >= -1 and box.x1 <= width + 1 and box.y0 >= -1 and box.y1 <= height + 1, text


@pytest.mark.parametrize("name", NAMES)
def test_the_energy_grows_and_stays_under_its_bound(name: str) -> None:
    cert = certified(name)
    run = cert.trajectory
    assert run is not None
    ax = drawn(plot_effort(run, cert))
    shown = labelled(ax)
    spent = shown["simulated (CVODES)"].get_ydata()  # type: ignore[attr-defined]
    assert spent[0] == 0 and (np.diff(spent) >= 0).all()
    assert cert.effort is not None
    assert ("certified bound" in shown) == (cert.effort.energy is not None)
    if cert.effort.energy is not None:
        bound = shown["certified bound"].get_ydata()[0]  # type: ignore[attr-defined]
        assert bound == float(cert.effort.energy.value)
        assert spent[-1] <= bound
    columns = simulate(cert.graph, cert.protocol, np.ones((cert.graph.n_nodes, 2)), times=[0])
    with pytest.raises(ValueError, match="holds 2 initial states"):
        plot_effort(columns)


@pytest.mark.parametrize("gains", [(1, 1, 1, 2), (1, 1, 1, 50), (2, 100, 1, 1), (1, 1, 10, 100), (1, 0.1, 0.1, 1)])
def test_the_energy_is_that_of_the_closed_form_or_refused(gains: tuple[float, ...]) -> None:
    """Of a pair ``E = e^(-2 s) E(0)``; the last two are too fast for the samples, and infinite."""
    T, rho1, rho2, kappa = gains
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    run = simulate(pair, NominalProtocol(T=T, rho1=str(rho1), rho2=str(rho2), kappa=kappa), [3, 5])

    def power(t: float) -> float:
        gain, s = rho1 + rho2 * kappa / (T - t), rho1 * t + rho2 * kappa * math.log(T / (T - t))
        return 2 * (2 * gain * math.exp(-2 * s)) ** 2

    if gains[-2:] in ((10, 100), (0.1, 1)):
        with pytest.raises(ValueError, match="do not settle the energy"):
            plot_effort(run)
        return
    spent = plot_effort(run).lines[0].get_ydata()
    assert np.asarray(spent)[-1] == pytest.approx(quad(power, 0, T, limit=500)[0], rel=5e-3)


@pytest.mark.parametrize("size", [1e300, 1e154])
@pytest.mark.parametrize("actuator", [None, GainLimits(gain_cap=50), GainLimits(sample_period="0.05")])
def test_an_energy_beyond_floats_is_refused_without_a_warning(size: float, actuator: GainLimits | None) -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    run = simulate(pair, PROTOCOL, [size, 0], actuator=actuator)
    with pytest.raises(ValueError, match="the energy is beyond the range of floats"):
        plot_effort(run)


def test_no_certified_line_for_a_run_from_elsewhere() -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    cert = certify(pair, PROTOCOL, [3, 5], simulation=False)
    late = simulate(pair, PROTOCOL, [300, -500], times=[0.01, 0.1, 0.5, 0.9, 1])
    for draw in (plot_input(late, cert.structure, cert), plot_effort(simulate(pair, PROTOCOL, [3, 5]), cert)):
        labels = set(labelled(draw))
        assert ("certified bound" in labels) == draw.get_ylabel().startswith("energy")
        assert "certified peak" not in labels
    near = certify(pair, PROTOCOL, [10**13, 10**13 + 1], simulation=False)
    with pytest.raises(ValueError, match="another initial state than"):
        plot_input(simulate(pair, PROTOCOL, [1e13, 1e13 + 8]), near.structure, near)


@pytest.mark.parametrize("size", ["1e-250", "1e13", "1e155", "1e250"])
def test_starts_of_any_size_are_drawn(size: str) -> None:
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    start = [Fraction(size), -Fraction(size) / 3]
    cert = certify(pair, PROTOCOL, start)
    run = cert.trajectory
    assert run is not None
    for ax in (plot_trajectory(run, cert.structure), plot_input(run, cert.structure, cert), plot_decay(cert)):
        drawn(ax)
    norm = labelled(plot_decay(cert))["simulated (CVODES)"].get_ydata()  # type: ignore[attr-defined]
    small = certify(pair, PROTOCOL, [x / Fraction(size) for x in start])
    assert norm[:20] == pytest.approx(labelled(plot_decay(small))["simulated (CVODES)"].get_ydata()[:20])  # type: ignore[attr-defined]


@pytest.mark.parametrize("start", [["0.123", "-7.013", "2.739"], ["1/3", "-1e5", "1e-5"]])
def test_the_start_of_a_certificate_is_known_again_whatever_its_decimals(start: list[str]) -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1)])
    cert = certify(graph, PROTOCOL, start)
    assert cert.trajectory is not None
    assert "certified peak" in labelled(plot_input(cert.trajectory, cert.structure, cert))
