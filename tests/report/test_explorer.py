"""The explorer: every control, what it says, and that nothing is called certified that was not checked."""

from __future__ import annotations

import html
import re
import runpy
import shlex
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import Run
from bad_inputs import ptcc as ptcc_called
from matplotlib.backends.backend_agg import FigureCanvasAgg
from selection import thinned

import ptcc_certify as ptcc
from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.io.packaged import GRAPHS
from ptcc_certify.graphs.size_limits import EXPLORED_NODES
from ptcc_certify.report.explorer import GIVEN, Explorer, Settings, View, explore, model, widgets
from ptcc_certify.report.explorer.model import reading_of
from ptcc_certify.report.explorer.widgets import controls

pytestmark = pytest.mark.usefixtures("quick_search")

PNG = b"\x89PNG\r\n\x1a\n"
SLIDING = Settings(kind="sliding-mode")


class Panel:
    """The widget with its parts by name."""

    def __init__(self, explorer: Explorer, settings: Settings):
        self.widget = controls(explorer, settings)
        self.box, self._text, self._image = self.widget.children
        self.texts: list[str] = []
        self.images: list[tuple[float, bytes]] = []
        self._text.observe(lambda change: self.texts.append(self.text), names="value")
        self._image.observe(lambda change: self.images.append((time.perf_counter(), self.image)), names="value")

    @property
    def text(self) -> str:
        return html.unescape(self._text.value.removeprefix("<pre>").removesuffix("</pre>"))

    @property
    def image(self) -> bytes:
        return bytes(self._image.value)

    @property
    def controls(self) -> dict[str, Any]:
        return {child.description: child for child in self.box.children}

    def line(self, head: str) -> str:
        return next(line for line in self.text.splitlines() if line.startswith(head))

    def set(self, name: str, value: Any) -> tuple[float, float]:
        """Move a control; return the seconds until the first new image, and until the verdict."""
        self.texts.clear()
        self.images.clear()
        began = time.perf_counter()
        self.controls[name].value = value
        return self.images[0][0] - began, time.perf_counter() - began


def certificate_of(view: View) -> ptcc.Certificate:
    assert view.certificate is not None
    return view.certificate


@pytest.fixture(scope="module")
def explorer() -> Explorer:
    return Explorer()


@pytest.fixture(scope="module")
def panel(explorer: Explorer) -> Panel:
    return Panel(explorer, Settings())


@pytest.fixture(scope="module")
def sliding(explorer: Explorer) -> Panel:
    return Panel(explorer, SLIDING.changed(graph="fig1a", method="paper"))


@pytest.mark.few(0)
def test_it_opens_with_a_certified_view(panel: Panel):
    assert panel.image.startswith(PNG)
    assert panel.line("claim").endswith("interval bipartite consensus at T = 1 (Theorem 2.1)")
    assert panel.line("verdict").startswith("verdict    certified; ||E|| <= ")
    assert set(panel.controls) == {"graph", "protocol", "bounds", "initial state", "T", "rho1", "rho2", "kappa"}


def test_it_begins_with_the_defaults_of_the_protocols():
    assert Settings().protocol() == ptcc.NominalProtocol()
    assert {name: getattr(SLIDING.protocol(), name) for name in ("rho1", "rho2", "kappa")} == {
        name: getattr(ptcc.SlidingModeProtocol(), name) for name in ("rho1", "rho2", "kappa")
    }


def test_its_advice_is_for_the_controls(explorer: Explorer):
    verdict = explorer.view(Settings(rho1=0.2, rho2=0.1, kappa=1)).verdict
    assert re.search("rho2 = [0-9.]+ leaves 1 %", verdict) and "--" not in verdict


def rows(view: View) -> dict[str, str]:
    return view.facts | {"verdict": view.verdict}


@pytest.mark.few(0)
def test_a_control_that_is_moved_changes_image_and_text(panel: Panel):
    before = panel.text, panel.image
    panel.set("T", 0.4)
    assert panel.text != before[0]
    assert panel.image != before[1]
    assert panel.image.startswith(PNG)
    assert "at T = 0.4 " in panel.line("claim")


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "value"), [("T", 0.4), ("rho1", 0.8), ("rho2", 0.9), ("kappa", 1.5)])
def test_gains_move_the_bound_and_leave_the_rate(explorer: Explorer, name: str, value: float):
    """Rates are per unit of the clock and belong to the graph; only the clock depends on the gains."""
    before, after = (rows(explorer.preview(Settings(**more))) for more in ({}, {name: value}))  # type: ignore[arg-type]
    assert after["rate"] == before["rate"]
    assert after["error"] != before["error"]


def test_the_seed_decides_the_initial_state_and_with_it_the_final_state(explorer: Explorer):
    start = np.random.default_rng(7).integers(-9, 10, size=6).tolist()
    final_state = ptcc.final_state(ptcc.analyse(load_graph("fig3a")), start)
    ends = ", ".join(f"{label}={float(value):.5g}" for label, value in final_state.items())
    exact = all(Fraction(f"{float(value):.5g}") == value for value in final_state.values())
    assert (
        explorer.preview(Settings(seed=7)).facts["x(T)"]
        == f"{ends} ({'exact' if exact else 'exact; here to 5 digits'})"
    )
    thirds = Explorer(ptcc.SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 2)]))
    ends = [thirds.preview(Settings(GIVEN, seed=seed)).facts["x(T)"] for seed in range(4)]
    assert any("/3, " in end and end.endswith("(exact)") for end in ends)


@pytest.mark.few(0)
def test_every_packaged_graph_is_there(explorer: Explorer, panel: Panel):
    assert panel.controls["graph"].options == GRAPHS
    for name in GRAPHS:
        claim, view = ptcc.analyse(load_graph(name)).claim, explorer.view(Settings(name, method="paper"))
        assert claim is not None
        assert claim.sharpest in view.facts["claim"], name
        assert f"Theorem {claim.theorem}" in view.facts["claim"], name
        assert view.verdict.startswith("certified"), name


@pytest.mark.few(0)
@pytest.mark.usefixtures("every_class")
def test_a_class_of_bounds_shows_its_own_rate(explorer: Explorer):
    rates = {}
    for method in ("paper", "perron", "lmi", "full", "best"):
        view = explorer.view(Settings("fig1a", method=method))
        assert view.certificate is not None and view.certificate.rate is not None
        rates[method] = view.certificate.rate
        assert view.facts["rate"].startswith(str(float(rates[method]))[:5])
    assert (
        rates["paper"] == ptcc.certify(load_graph("fig1a"), Settings().protocol(), asks=ptcc.Asks(method="paper")).rate
    )
    limit = view.certificate.upper_bound
    assert limit is not None
    assert max(rates.values()) == rates["best"] <= limit
    assert rates["lmi"] >= rates["perron"] * (1 - 1e-6)  # the best diagonal matrix, but for rounding


def test_what_is_shown_is_what_certify_certifies(explorer: Explorer):
    settings = SLIDING.changed(method="paper", disturbance="sin", seed=3)
    start, sigma0 = np.random.default_rng(3).integers(-9, 10, size=(2, 6)).tolist()
    whole = ptcc.certify(
        load_graph("fig3a"),
        settings.protocol(),
        ptcc.InitialState(start, sigma0=sigma0),
        asks=ptcc.Asks(disturbance="1*sin(2*k*t)", method="paper"),
    )
    shown = certificate_of(explorer.view(settings))
    for part in ("rate", "overshoot", "initial_state", "sigma0", "reaching", "claim", "verdict"):
        assert getattr(shown, part) == getattr(whole, part), part
    assert shown.final_state is not None
    assert whole.final_state is not None
    assert shown.final_state.states == whole.final_state.states
    assert shown.theorem.number == whole.theorem.number
    left = [0.5, 0.1, 0.01]
    assert shown.norm_bound(left).tolist() == whole.norm_bound(left).tolist()
    assert ptcc.check(shown.to_dict()).accepted


def test_doubled_weights_double_the_rate():
    pairs = [("a", "b", 1), ("b", "c", -2), ("c", "a", 1)]
    rates = []
    for factor in (1, 2):
        graph = ptcc.SignedDigraph.from_edges([(s, t, factor * w) for s, t, w in pairs])
        rates.append(certificate_of(Explorer(graph).view(Settings(GIVEN, method="paper"))).rate)
    assert float(rates[1] / rates[0]) == pytest.approx(2, rel=1e-6)


def test_a_given_graph_comes_first_and_is_shown():
    graph = ptcc.SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    panel = Panel(Explorer(graph), Settings(GIVEN))
    assert panel.controls["graph"].options[0] == GIVEN
    assert "Theorem 1.1" in panel.line("claim")


# ---------------------------------------------------------------------- sliding mode


@pytest.mark.few(0)
def test_the_protocol_brings_its_own_controls(explorer: Explorer):
    panel = Panel(explorer, Settings("fig1a", method="paper"))
    before = panel.text
    panel.set("protocol", "sliding-mode")
    assert "T" not in panel.controls
    own = {"T_r", "T_s", "mu1", "mu2", "mu3", "delta", "sigma(0) random", "disturbance"}
    assert own <= set(panel.controls)
    assert "at T = 1, any |d_k| <= 1 (Theorem 4.2)" in panel.line("claim")
    panel.set("protocol", "nominal")
    assert panel.text == before
    assert not own & set(panel.controls)


#: Moved one after the other, each with all before it, and the row that tells of it.
MOVES = (
    ("T_r", 0.8, "at T = 1.3, any"),
    ("T_s", 0.9, "at T = 1.7, any"),
    ("mu1", 4.0, "sliding"),
    ("mu2", 2.0, "sliding"),
    ("mu3", 2.0, "sliding"),
    ("delta", 0.5, "sliding"),
    ("rho1", 0.5, "at T_r"),
    ("rho2", 0.5, "at T_r"),
    ("kappa", 1.0, "at T_r"),
    ("disturbance", "none", "x(T)"),
    ("disturbance", "sin", "x(T)"),
    ("disturbance", "telegraph", "x(T)"),
    ("reaching", False, "no reaching phase"),
    ("seed", 5, "x(T)"),
    ("method", "paper", "rate       7.23"),
)


@pytest.mark.few(0)
def test_every_control_of_the_sliding_mode_is_followed(explorer: Explorer):
    """In the text, in the run, or in the proved reaching times."""
    explorer.view(SLIDING)  # finds the Lyapunov functions that previews take
    settings, before = SLIDING, explorer.preview(SLIDING)
    for name, value, says in MOVES:
        settings = settings.changed(**{name: value})
        view = explorer.preview(settings)
        assert says in view.text, name
        assert told_by(view) != told_by(before), name
        before = view
    assert explorer.view(settings).verdict.startswith("certified")


def told_by(view: View) -> tuple[object, ...]:
    certificate = view.certificate
    assert certificate is not None and certificate.trajectory is not None
    return view.text, certificate.trajectory.states.tobytes(), certificate.reaching


def test_a_larger_margin_reaches_the_manifold_earlier(explorer: Explorer):
    times = []
    for mu1, delta in ((1.5, 1), (2, 1), (4, 1), (4, 0)):
        reaching = certificate_of(explorer.preview(SLIDING.changed(mu1=mu1, delta=delta))).reaching
        assert reaching is not None
        times.append(max(r.time for r in reaching))
    assert times == sorted(times, reverse=True)
    assert len(set(times)) == len(times)


@pytest.mark.few(0)
def test_the_final_state_is_the_same_whatever_the_disturbance(explorer: Explorer):
    ends = set()
    for disturbance in ("worst-case", "none", "sin", "telegraph"):
        view = explorer.view(SLIDING.changed(disturbance=disturbance, method="paper"))
        ends.add(view.facts["x(T)"])
        assert "bound kept" in view.facts["simulated"]
    assert len(ends) == 1


@pytest.mark.few(0)
def test_what_is_wrong_is_told_in_one_line_and_drawn(sliding: Panel):
    before = sliding.image
    sliding.set("delta", 2.0)
    assert sliding.text == "mu1 = 2 does not exceed delta = 2; a disturbance could outweigh it: give mu1 > 2"
    assert sliding.image.startswith(PNG)
    assert sliding.image != before
    sliding.set("delta", 1.0)
    assert sliding.image == before
    assert sliding.line("verdict").startswith("verdict    certified")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"T": 0}, "T = 0 is outside its domain"),
        ({"rho1": 0}, "rho1 = 0"),
        ({"rho2": 0}, "rho2 = 0 gives no deadline"),
        ({"kappa": 0}, "kappa = 0"),
        ({"T": "soon"}, "not a finite number"),
        ({"graph": "fig9"}, 'graph "fig9" is unknown; one of fig1a'),
        ({"kind": "sliding-mode", "mu3": 0}, "mu3 = 0"),
    ],
)
def test_refused_settings_say_why(explorer: Explorer, change: dict[str, Any], says: str):
    view = explorer.view(Settings().changed(**change))
    assert says in view.text
    assert view.text == explorer.preview(Settings().changed(**change)).text
    assert "\n" not in view.text
    assert view.certificate is None
    assert view.png.startswith(PNG)


@pytest.mark.parametrize("change", [{"kind": "other"}, {"method": "magic"}, {"disturbance": "wind"}, {"seed": -1}])
def test_settings_outside_the_choices_are_refused_at_once(change: dict[str, Any]):
    with pytest.raises(ParameterError, match=next(iter(change))):
        Settings(**change)


# ---------------------------------------------------------------------- proved or not


@pytest.mark.few(0)
def test_nothing_is_called_certified_before_the_check(panel: Panel):
    panel.set("T", 0.7)
    assert len(panel.images) == len(panel.texts) == 2
    assert "certified" not in panel.texts[0]
    assert panel.texts[0].endswith("verdict    not checked yet")
    assert "\nverdict    certified" in panel.texts[1]


def test_what_the_check_rejects_is_not_certified(explorer: Explorer, monkeypatch: pytest.MonkeyPatch):
    rejection = CheckReport(False, "undecided", (), "rate", "because this test says so", "none", "")
    monkeypatch.setattr("ptcc_certify.certificate.document.record", lambda sections, *others: (sections, rejection))
    view = explorer.view(Settings(T=0.9))
    assert view.text.startswith("verdict    undecided: the independent check rejects rate, a defect of this program")
    assert view.grade == "doubt"


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("first", "second"),
    thinned(
        product(
            [Settings("fig1b"), Settings("fig1b", kind="sliding-mode")],
            [Settings("fig1b", kind="sliding-mode", T_r=0.7), Settings("fig1b", T=0.7, seed=3)],
        ),
        3,
    ),
)
def test_a_preview_claims_what_the_certificate_does_but_for_the_size_of_bounds(first: Settings, second: Settings):
    """Whatever protocol the Lyapunov functions were found under: they belong to the graph."""
    explorer = Explorer()
    explorer.view(first)
    preview, view = explorer.preview(second), explorer.view(second)
    assert [preview.facts[head] for head in ("claim", "x(T)")] == [view.facts[head] for head in ("claim", "x(T)")]
    assert preview.certificate is not None and view.certificate is not None
    for part in ("protocol", "initial_state", "sigma0", "reaching", "theorem"):
        assert getattr(preview.certificate, part) == getattr(view.certificate, part), part
    assert ptcc.check(preview.certificate.to_dict()).accepted  # nothing is claimed that would not be certified


def test_sliding_variables_are_drawn_again_only_where_they_move(explorer: Explorer, monkeypatch: pytest.MonkeyPatch):
    """The gains of the states leave them as they are; without sigma(0) there are none."""
    drawn: list[str] = []
    monkeypatch.setattr(model, "panel_svg", lambda certificate, name: drawn.append(name) or f"{name} {len(drawn)}")
    moves = [SLIDING.changed(seed=7), SLIDING.changed(seed=7, rho2=1.3), SLIDING.changed(seed=7, mu2=1.5)]
    shown = [explorer.svg(explorer.preview(settings), "sliding") for settings in moves]
    assert shown == ["sliding 1", "sliding 1", "sliding 2"]
    assert "sliding" in explorer.preview(moves[0]).panels
    assert "sliding" not in explorer.preview(moves[0].changed(reaching=False)).panels
    assert "sliding" not in explorer.preview(Settings("fig1a")).panels


def test_without_a_run_the_graph_is_shown_and_the_rest_says_why(monkeypatch: pytest.MonkeyPatch):
    def fails(*args: object, **options: object) -> None:
        raise SimulationError("the integrator failed")

    monkeypatch.setattr(model, "simulate", fails)
    explorer = Explorer()
    view = explorer.preview(Settings("fig1a"))
    texts = [[text.get_text() for text in ax.texts] for ax in view.figure.axes]
    assert [any("no run to draw" in text for text in own) for own in texts] == [True, True, False, True]
    assert view.facts["claim"].startswith("stability")


# ---------------------------------------------------------------------- code


@pytest.fixture
def made(
    explorer: Explorer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[View, list[str], Run]]:
    """What returns a view, the lines that its Python prints, and what its command line does, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def make(settings: Settings, explorer: Explorer = explorer) -> tuple[View, list[str], Run]:
        view = explorer.view(settings)
        Path("shown.py").write_text(f"{view.python}\nprint(cert.assessment.text)\n", encoding="utf-8")
        capsys.readouterr()
        runpy.run_path("shown.py")
        printed = capsys.readouterr().out.splitlines()
        return view, printed, ptcc_called(*shlex.split(view.command)[1:], "-v")

    return make


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "settings",
    thinned(
        [
            Settings("fig3a", T="0.6", seed=4),
            Settings("fig1a", kind="sliding-mode", disturbance="telegraph", seed=2, method="paper"),
            Settings("fig3b", kind="sliding-mode", disturbance="sin", delta="1/2", method="perron"),
        ],
        2,
    ),
    ids=["nominal", "telegraph", "sin"],
)
def test_the_code_that_is_copied_makes_what_is_shown(
    settings: Settings, made: Callable[..., tuple[View, list[str], Run]]
):
    view, printed, command = made(settings)
    assert printed[-1] == view.verdict
    assert str(view.certificate) in "\n".join(printed)
    assert Path("decay.png").stat().st_size > 1000
    screen = " ".join(command.out.split())  # lines that are wrapped are one again
    assert screen.startswith(f"verdict {view.verdict} "), command.err
    assert all(text in screen for text in view.facts["simulated"].split("; "))


def test_the_code_reads_a_given_graph_as_it_was_read(made: Callable[..., tuple[View, list[str], Run]]):
    Path("it's mine.csv").write_text("a,b,1\nb,a,1\nb,c,-2\na,b,3\n", encoding="utf-8")
    how = {"duplicates": "last", "undirected": False, "drop_self_loops": False}
    source = reading_of("it's mine.csv", "listens", **how)
    graph = ptcc.read_graph("it's mine.csv", orientation="listens", **how)  # type: ignore[arg-type]
    view, printed, command = made(Settings("mine"), Explorer(graph, "mine", source))
    assert printed[-1] == view.verdict
    assert " ".join(command.out.split()).startswith(f"verdict {view.verdict} "), command.err


def test_graphs_that_are_too_large_are_refused():
    n = EXPLORED_NODES + 1
    path = ptcc.SignedDigraph.from_edges([(k, k + 1, 1) for k in range(n - 1)])
    with pytest.raises(ParameterError, match=f"up to {EXPLORED_NODES} nodes; this one has {n}"):
        explore(path)


def test_a_graph_without_edges_stays_where_it_is():
    view = Explorer(ptcc.SignedDigraph.from_matrix([[0, 0], [0, 0]], orientation="listens")).view(Settings(GIVEN))
    assert "none: no agent listens to another" in view.text
    assert view.png.startswith(PNG)


# ---------------------------------------------------------------------- with and without widgets


@pytest.mark.few(0)
def test_in_a_notebook_the_controls_come(monkeypatch: pytest.MonkeyPatch):
    import ipywidgets

    monkeypatch.setattr(widgets, "_in_notebook", lambda: True)
    widget = explore(settings=Settings("fig1b", T=0.6))
    assert isinstance(widget, ipywidgets.VBox)
    assert "T = 0.6" in widget.children[1].value
    with pytest.raises(ParameterError, match='graph "fig7" is unknown'):
        explore(settings=Settings("fig7"))


@pytest.mark.few(1)
@pytest.mark.parametrize("notebook", [True, False])
def test_without_widgets_there_is_a_static_view(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], notebook: bool
):
    monkeypatch.setattr(widgets, "_in_notebook", lambda: notebook)
    if notebook:
        monkeypatch.setitem(sys.modules, "ipywidgets", None)
    view = explore()
    assert isinstance(view, View)
    assert 'pip install ".[notebook]"' in capsys.readouterr().out
    assert view._repr_png_().startswith(PNG)
    assert len(view.figure.axes) == 4
    assert "\nverdict    certified" in repr(view)


@pytest.mark.few(0)
@pytest.mark.filterwarnings("error", "ignore::DeprecationWarning:matplotlib|pyparsing")
@pytest.mark.parametrize("settings", [Settings("fig5a"), Settings("fig5a", kind="sliding-mode", seed=2)])
def test_no_text_of_the_figure_is_clipped_or_on_another_panel(explorer: Explorer, settings: Settings):
    view = explorer.view(settings)
    assert view.png.startswith(b"\x89PNG")
    figure = view.figure
    renderer = FigureCanvasAgg(figure).get_renderer()
    width, height = figure.get_size_inches() * figure.dpi
    panels = [ax.get_tightbbox(renderer) for ax in figure.axes]
    for box in panels:
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1
    for one, other in combinations(panels, 2):
        assert not one.overlaps(other)
