"""A certificate at a glance, and in motion: what is drawn is what is proved, and what runs."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc as command
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.legend import Legend
from matplotlib.text import Text
from PIL import Image

import ptcc_certify as ptcc
from ptcc_certify.errors import ParameterError
from ptcc_certify.report.page import report_html
from ptcc_certify.report.plots.animation import animate
from ptcc_certify.report.plots.camp_lines import _written
from ptcc_certify.report.plots.final_colours import ENDS, colours_of
from ptcc_certify.report.plots.glance import _asked, joined_above, plot_glance
from ptcc_certify.report.plots.graph import node_id
from ptcc_certify.report.plots.sizes import figures_for

CORPUS = Path(__file__).parents[1] / "corpus"
KINDS = [
    "fig3a",
    "odd-labels",
    "late",
    "late-moving",
    "vehicles",
    "late-camps",
    "formation",
    "sliding",
    "single",
    "parts",
]


def certificate(name: str) -> ptcc.Certificate:
    return ptcc.read_certificate(CORPUS / f"{name}.json")


@pytest.mark.few(3)
@pytest.mark.parametrize("name", KINDS)
def test_every_run_is_drawn_inside_its_tube(name: str) -> None:
    figure = plot_glance(certificate(name))
    ax = figure.axes[1]
    lines = {line.get_gid(): line for line in ax.lines if str(line.get_gid()).startswith("run")}
    assert len(lines) == len(certificate(name).labels) == len(ax.collections)
    room = 1e-6 * np.ptp(ax.get_ylim())
    for k, tube in enumerate(ax.collections):
        (path,) = tube.get_paths()
        t, x = lines[node_id(k, "run")].get_data()
        half = (len(path.vertices) - 3) // 2
        rims = path.vertices[1 : half + 1], path.vertices[half + 2 : -1][::-1]
        low, high = (np.interp(t, rim[:, 0], rim[:, 1]) for rim in rims)
        least, most = np.minimum(low, high), np.maximum(low, high)
        assert (least - room <= x).all() and (x <= most + room).all(), k


@pytest.mark.parametrize("name", ["late-missed", "late-capped", "vehicles-formation"])
def test_steps_of_a_bound_are_joined_and_none_of_it_is_cut_off(name: str) -> None:
    cert = certificate(name)
    T, t = float(cert.protocol.T), cert.asked_trajectory.t
    tube, fine = cert.tube(t), np.linspace(0, T, 20011)
    sharp = cert.tube(fine)
    for k in range(len(cert.labels)):
        half = (tube.high[k] - tube.low[k]) / 2
        joined = joined_above(t, half, 0.1 * T)
        known = np.isfinite(half)
        assert (joined[known] >= half[known] * (1 - 1e-12)).all()
        assert (np.interp(fine, t, joined) >= (sharp.high[k] - sharp.low[k]) / 2 * (1 - 1e-9) - 1e-12).all()
        before = t < 0.9 * T
        assert np.sum(np.diff(joined[before]) == 0) <= np.sum(np.diff(half[before]) == 0)


def test_colours_tell_the_sign_of_a_state_and_are_legible_on_white_and_under_white() -> None:
    red, grey, blue = (np.array(to_rgb(colour)) for colour in colours_of(np.array([-3.0, 0.0, 3.0])))
    assert red[0] > red[2] and blue[2] > blue[0] and np.ptp(grey) == 0
    for share in np.linspace(0, 1, 101):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in ENDS(share)[:3]]
        luminance = float(np.dot([0.2126, 0.7152, 0.0722], linear))
        assert 1.05 / (luminance + 0.05) >= 4.5


def test_final_states_stand_at_the_ends_of_lines_each_its_own() -> None:
    ends = dict(ends_told(plot_glance(certificate("fig5a")).axes[1]))
    final = certificate("fig5a").final_state
    for names, value in ends.items():
        for name in names.split(", "):
            assert abs(float(final[name]) - value) <= 0.01, name
    assert sum(len(names.split(", ")) for names in ends) == 16


def ends_told(ax: Axes) -> list[tuple[str, float]]:
    """The names at the ends of lines, and the values beside them."""
    texts = [text.get_text().replace("\n", " ").replace("\N{MINUS SIGN}", "-") for text in ax.texts]
    return [(text.rpartition(": ")[0], float(text.rpartition(": ")[2])) for text in texts if ": " in text]


def test_noise_of_the_integrator_has_no_colour_and_no_labels_of_its_own() -> None:
    ax = plot_glance(certificate("sampled")).axes[1]
    assert ends_told(ax) == [("1, 2, 3, 4, 5, 6", 0)]
    assert {line.get_color() for line in ax.lines if line.get_gid()} == set(colours_of(np.zeros(1)))


def test_a_proved_end_that_is_not_reached_in_time_is_a_point_at_the_deadline() -> None:
    ax = plot_glance(certificate("odd-labels")).axes[1]
    points = [line.get_xydata()[0].tolist() for line in ax.lines if str(line.get_gid()).startswith("end")]
    assert points == [[1, 0]] * 3 and ax.get_ylim()[0] < 0
    assert not [line for line in plot_glance(certificate("fig3a")).axes[1].lines if "end" in str(line.get_gid())]


def made(n: int, cut: int) -> ptcc.Certificate:
    """A ring in two camps, of which the first has so many agents."""
    ends = [(k, (k + step) % n) for k in range(n) for step in (1, 7)]
    edges = [(f"a{j}", f"a{k}", -1 if (j < cut) != (k < cut) else 1) for j, k in ends]
    protocol = ptcc.NominalProtocol(T=1, rho1=1, rho2=9, kappa=2)
    return ptcc.certify(edges, protocol, [3 - k % 11 * 0.5 for k in range(n)], asks=ptcc.Asks(method="paper"))


@pytest.mark.parametrize(("n", "lines"), [(45, 45), (64, 4)])
def test_of_many_agents_labels_count_all_who_end_there(n: int, lines: int) -> None:
    cert = made(n, 20)
    ax = plot_glance(cert).axes[1]
    assert sum(line.get_linewidth() < 2 and len(line.get_xdata()) > 2 for line in ax.lines) == lines
    assert len(ax.collections) >= (n if lines == n else 2)
    final = [float(x) for x in cert.proof.final_state.states]
    for names, value in ends_told(ax):
        shown, _, more = names.replace(" agents", "").rpartition("+")
        counted = len(shown.strip(", ").split(", ")) + int(more) if shown else int(more)
        assert counted == sum(abs(x - value) < 0.01 for x in final), names
    assert len(ends_told(ax)) == 2


def test_names_at_the_left_stay_beside_the_axis_and_few_names_need_no_higher_panel() -> None:
    figure = plot_glance(certificate("fig5a"))
    FigureCanvasAgg(figure).draw()
    ax = figure.axes[1]
    box = ax.get_window_extent()
    for text in ax.texts:
        extent = Text.get_window_extent(text)
        assert box.y0 - 3 < extent.y0 and extent.y1 < box.y1 + 3, text.get_text()
    assert plot_glance(made(45, 20), stacked=True).get_figheight() < 7


def test_up_to_60_agents_are_coloured_by_where_they_end() -> None:
    cert = made(45, 20)
    lines = {line.get_gid(): line.get_color() for line in plot_glance(cert).axes[1].lines if line.get_gid()}
    ends = colours_of(np.array([float(x) for x in cert.proof.final_state.states]))
    assert [lines[node_id(k, "run")] for k in range(45)] == ends


def test_names_fill_two_lines_before_they_are_counted() -> None:
    assert _written([f"agent{k}" for k in range(6)], ": 0", 20) == "agent0, agent1,\nagent2, +3: 0"
    assert _written(["lead", "ann", "bob"], ": 1", 12) == "lead, ann,\nbob: 1"


def test_words_say_the_claim_and_the_bounds() -> None:
    texts = [text.get_text() for text in plot_glance(certificate("fig3a")).texts]
    assert texts[0] == "Interval bipartite consensus at T = 0.6 (Theorem 2.1)" and "certified" in texts
    assert any("every agent within 1.3e-06" in text for text in texts)
    assert not plot_glance(certificate("fig3a"), words=False).texts


@pytest.mark.parametrize(
    "name", ["no-initial-state", "group-vehicles", "windows", "family-late", "core", "undecided", "plane"]
)
def test_every_kind_has_a_glance(name: str) -> None:
    read = ptcc.read_certificate(CORPUS / f"{name}.json")
    assert plot_glance(read).axes


def test_a_film_shows_the_run_and_ends_where_it_ends(tmp_path: Path) -> None:
    animate(certificate("single"), tmp_path / "run.gif", seconds=0.3)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames >= 2
    animate(certificate("plane"), tmp_path / "run.html", seconds=0.2)
    assert "<input" in (tmp_path / "run.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "file", "seconds", "why"),
    [
        ("fig3a", "run.png", 1, "films are written to"),
        ("fig3a", "run.gif", 0, "seconds = 0"),
        ("windows", "run.gif", 1, "of intervals or modes"),
        ("core", "run.gif", 1, "at most 40 agents"),
        ("group-vehicles", "run.gif", 1, "delays are too short"),
    ],
)
def test_what_has_no_film_is_told(name: str, file: str, seconds: float, why: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=why):
        animate(certificate(name), tmp_path / file, seconds=seconds)
    assert not list(tmp_path.iterdir())


def test_the_command_makes_a_film(tmp_path: Path) -> None:
    file = str(CORPUS / "single.json")
    made = command("animate", file, "-o", str(tmp_path / "a.gif"), "--seconds", "0.2")
    assert made.code == 0 and made.out.startswith("written") and (tmp_path / "a.gif").stat().st_size
    refused = command("animate", file, "-o", str(tmp_path / "a.txt"))
    assert refused.code == 2 and refused.err.count("\n") == 1


@pytest.mark.parametrize("name", ["fig5a", "late", "vehicles", "group-vehicles", "formation"])
def test_a_run_of_anybody_is_compared_with_the_tube(name: str) -> None:
    cert = certificate(name)
    run = cert.asked_trajectory or cert.simulate()
    tube, x = cert.tube(run.t), run.positions
    assert tube.compare(x, tolerance=1e-6).inside and tube.compare(x.T, tolerance=1e-6).inside
    k, at = np.unravel_index(int((tube.high - tube.low)[:, 1:].argmin()), (len(x), run.t.size - 1))
    off = np.array(x)
    off[k, at + 1] = tube.high[k, at + 1] + 0.5
    found = tube.compare(off, tolerance=1e-6)
    assert not found.inside and found.agent == cert.labels[k] and abs(found.outside - 0.5) < 1e-4
    with pytest.raises(ParameterError, match="have shape"):
        tube.compare(x[:, :3])


def test_where_leaders_move_targets_are_asked_for() -> None:
    cert = certificate("moving")
    with pytest.raises(ParameterError, match="give their targets"):
        cert.tube([0.5])
    run = cert.asked_trajectory
    assert cert.tube(run.t, run.targets).compare(run.positions, tolerance=1e-6).inside


def test_colours_and_values_are_of_the_run_where_leaders_move() -> None:
    """They were those of leaders at rest."""
    cert = certificate("moving")
    ax = plot_glance(cert).axes[1]
    run = cert.asked_trajectory
    lines = {line.get_gid(): line for line in ax.lines if line.get_gid()}
    at_T = [np.interp(float(cert.protocol.T), run.t, x) for x in run.positions]
    assert [lines[node_id(k, "run")].get_color() for k in range(len(at_T))] == colours_of(np.array(at_T))
    told = " ".join(text.get_text().replace("\n", " ") for text in ax.texts)
    for x in at_T:
        assert f": {x:.3g}" in told, (x, told)


@pytest.mark.parametrize("name", ["refuted", "refuted-rate", "family-refuted", "gain-cap"])
def test_what_was_asked_is_told_beside_a_claim_that_is_proved(name: str) -> None:
    read = certificate(name)
    texts = [text.get_text() for text in plot_glance(read).texts]
    told = next(text for text in texts if text.startswith("verdict: "))
    assert "certified" not in texts and told[9:30] == read.facts()[-1].text[:21]


def test_what_shades_and_colours_tell_is_named() -> None:
    titles = [plot_glance(certificate(name)).axes[1].get_title(loc="left") for name in ("sliding", "fig3a", "gain-cap")]
    colour = "colour: state at $T$"
    assert titles == [f"shaded: bounds in floats (numerical); {colour}", f"shaded: proved; {colour}", colour]
    legend = plot_glance(certificate("fig1b")).axes[0].figure.legends[0]
    assert "leads" in [text.get_text() for text in legend.get_texts()]
    assert "$T_r$ = 0.5" in [text.get_text() for text in plot_glance(certificate("sliding")).axes[1].texts]


@pytest.mark.parametrize(
    ("name", "title", "note"),
    [
        (
            "late",
            "Late messages: every agent within 0.000361 of",
            "nothing late: interval bipartite consensus at T = 1",
        ),
        ("moving", "Moving leaders, disturbances: every follower on its", "leaders at rest, without disturbances: int"),
        (
            "late-own",
            "Late messages under a gain cap: every agent within 0.136",
            "without limits, nothing late: bipart",
        ),
        ("sampled", "Gain \u2264 20, zero-order hold 0.001", "without limits: stability at T = 1 (Theorem 1.2)"),
        ("sampled-slowly", "Under limits of the gain: nothing is proved", "without limits: stability at T = 1"),
        ("parts", "a, b, c: bipartite consensus at T = 1", "error: "),
    ],
)
def test_titles_say_what_was_asked_and_never_deny_what_is_drawn(name: str, title: str, note: str) -> None:
    texts = [text.get_text() for text in plot_glance(certificate(name)).texts]
    assert " ".join(texts).startswith(title)
    assert any(text.startswith(note) for text in texts)
    for text in texts:
        assert not text.endswith((" =", " \u2264", "Theorem", " 0.99")) and not text.startswith(("%", "=", "\u2264"))


@pytest.mark.parametrize(
    ("name", "coloured"), [("fig3a", True), ("moving", True), ("group-vehicles", False), ("plane", False)]
)
def test_the_caption_says_what_colours_tell(name: str, coloured: bool) -> None:
    read = certificate(name)
    page = report_html(read if read.proof.agents is not None else read.with_simulation())
    caption = page.partition('id="figure-glance"')[2].partition("<figcaption>")[2].partition("</figcaption>")[0]
    assert "Who of" in caption and ("Colours tell" in caption) is coloured


@pytest.mark.parametrize(
    ("edges", "x0", "told"),
    [
        ([("l", "b", 1), ("m", "c", 1)], {"l": 4, "m": -4, "b": 1000, "c": -4}, {"l, b: 4", "m, c: \N{MINUS SIGN}4"}),
        ([("l", "b", 1), ("m", "c", 1)], {"l": "1.24", "m": "1.16", "b": 100, "c": -4}, {"l, b: 1.24", "m, c: 1.16"}),
        ([("a", "b", 1), ("b", "a", 2)], {"a": 1000, "b": 0}, {"a, b: 333"}),
        ([("a", "b", 1), ("b", "a", 2)], {"a": 10000, "b": 0}, {"a, b: 3333"}),
    ],
)
def test_ends_are_told_to_three_digits_of_their_own(edges: list[Any], x0: dict[str, Any], told: set[str]) -> None:
    figure = plot_glance(ptcc.certify(edges, ptcc.NominalProtocol(T=1, rho1=1, rho2=3, kappa=2), x0))
    assert {text.get_text() for text in figure.axes[1].texts if ": " in text.get_text()} == told


@pytest.mark.parametrize(
    ("last", "squares", "key"), [([("b", "c", -1)], 2, "second camp"), ([], 1, "second camp of leaders")]
)
def test_followers_have_the_shape_of_the_camp_in_which_they_end(last: list[Any], squares: int, key: str) -> None:
    edges = [("a", "b", 1), ("b", "a", 1), ("a", "d", -1), ("d", "a", -1), *(last or [("b", "c", 1), ("d", "c", 1)])]
    figure = plot_glance(ptcc.certify(edges, ptcc.NominalProtocol(T=1, rho1=1, rho2=3, kappa=2), [1, 2, 3, 4]))
    nodes = [line for line in figure.axes[0].lines if str(line.get_gid()).startswith("node-")]
    assert sum(line.get_marker() == "s" for line in nodes) == squares
    assert key in {text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()}


def test_steps_are_joined_beside_what_has_no_limit() -> None:
    bound = np.repeat([4.0, np.inf, 2.0, 1.0], 10)
    joined = joined_above(np.arange(40.0), bound, 100)
    assert joined.shape == bound.shape and (joined >= bound).all() and np.isinf(joined[10:20]).all()


@pytest.mark.parametrize("name", ["late-group", "sliding-containment"])
def test_on_a_slide_the_legend_covers_no_node_and_names_at_the_ends_stand_apart(name: str) -> None:
    with figures_for("slide"):
        figure = plot_glance(certificate(name))
        FigureCanvasAgg(figure).draw()
    ax, runs = figure.axes[:2]
    (legend,) = ax.figure.legends
    nodes = [line for line in ax.lines if str(line.get_gid()).startswith("node-")]
    centres = [line.get_transform().transform(line.get_xydata())[0] for line in nodes]
    assert nodes and min(y for _, y in centres) > legend.get_window_extent().y1
    boxes = [Text.get_window_extent(text) for text in runs.texts if ": " in text.get_text().replace("\n", " ")]
    boxes.sort(key=lambda box: box.y0)
    assert all(above.y0 > below.y1 - 0.25 * below.height for below, above in pairwise(boxes))


def test_a_title_is_no_detail() -> None:
    read = certificate("sampled-slowly")
    assert _asked(read, read.facts())[0] == "under limits of the gain: nothing is proved"


def test_on_a_slide_modes_side_by_side_show_their_arrows() -> None:
    with figures_for("slide"):
        panel = plot_glance(certificate("switching")).axes[0].child_axes[0]
    nodes = [line for line in panel.lines if len(line.get_xdata()) and line.get_markersize() > 6.1]
    places = np.vstack([line.get_xydata() for line in nodes])
    apart = min(float(np.hypot(*(p - q))) for k, p in enumerate(places) for q in places[:k])
    assert apart > 2 * nodes[0].get_markersize()
