"""The explorer: every control, what it says, and that nothing is called certified that was not checked."""

from __future__ import annotations

import html
import sys
import time
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import ptcc_certify as ptcc
from ptcc_certify.certificate import certificate as certificates
from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import GRAPHS, load_graph
from ptcc_certify.graphs.size_limits import CHECKED_NODES, EXPLORED_NODES
from ptcc_certify.report import explorer as module
from ptcc_certify.report.explorer import (
    GIVEN,
    Explorer,
    Settings,
    View,
    controls,
    explore,
)

PNG = b"\x89PNG\r\n\x1a\n"
SLIDING = Settings(kind="sliding-mode")


class Panel:
    """The widget with its parts by name."""

    def __init__(self, explorer: Explorer, settings: Settings):
        self.widget = controls(explorer, settings)
        self.box, self.button, self._text, self._image = self.widget.children
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


@pytest.fixture(scope="module")
def explorer() -> Explorer:
    return Explorer()


@pytest.fixture(scope="module")
def panel(explorer: Explorer) -> Panel:
    return Panel(explorer, Settings())


@pytest.fixture(scope="module")
def sliding(explorer: Explorer) -> Panel:
    return Panel(explorer, SLIDING)


def test_it_opens_with_a_certified_view(panel: Panel):
    assert panel.image.startswith(PNG)
    assert panel.line("claim").endswith("interval bipartite consensus at T = 1 (Theorem 2.1)")
    assert panel.line("verdict").startswith("verdict    certified; ||E|| <= ")
    assert set(panel.controls) == {"graph", "protocol", "bounds", "start seed", "T", "rho1", "rho2", "kappa"}
    assert panel.button.layout.display == "none"


@pytest.mark.parametrize(("name", "value"), [("T", 0.4), ("rho1", 0.8), ("rho2", 0.9), ("kappa", 2.0)])
def test_gains_move_the_bound_and_leave_the_rate(panel: Panel, name: str, value: float):
    """Rates are per unit of the clock and belong to the graph; only the clock depends on the gains."""
    before = panel.text, panel.image, panel.line("rate"), panel.line("error")
    panel.set(name, value)
    assert panel.text != before[0]
    assert panel.image != before[1]
    assert panel.image.startswith(PNG)
    assert panel.line("rate") == before[2]
    assert panel.line("error") != before[3]
    assert f"at T = {panel.controls['T'].value:g} " in panel.line("claim")


def test_the_start_decides_the_final_state(explorer: Explorer, panel: Panel):
    before = panel.image
    panel.set("start seed", 7)
    assert panel.image != before
    start = np.random.default_rng(7).integers(-9, 10, size=6).tolist()
    final_state = ptcc.final_state(ptcc.analyse(load_graph("fig3a")), start)
    ends = ", ".join(
        f"{label}={value:.5g}" for label, value in zip(final_state.labels, final_state.values, strict=True)
    )
    assert panel.line("x(T)") == f"x(T)       {ends} (exact)"


def test_every_packaged_graph_is_there(panel: Panel):
    panel.controls["graph"].value = GRAPHS[-1]
    for name in GRAPHS:
        before = panel.image
        panel.set("graph", name)
        claim = ptcc.analyse(load_graph(name)).claim
        assert claim is not None
        assert claim.behaviour in panel.line("claim"), name
        assert f"Theorem {claim.theorem}" in panel.line("claim"), name
        assert panel.image != before, name
        assert panel.line("verdict").startswith("verdict    certified"), name


def test_a_class_of_bounds_shows_its_own_rate(explorer: Explorer):
    panel, rates = Panel(explorer, Settings("fig1a")), {}
    for method in ("paper", "perron", "lmi", "full", "best"):
        panel.controls["bounds"].value = method
        rates[method] = explorer.certificate(Settings("fig1a", method=method)).rate
        assert rates[method] is not None
        assert panel.line("rate").startswith(f"rate       {str(float(rates[method]))[:5]}")
    assert rates["paper"] == ptcc.certify(load_graph("fig1a"), Settings().protocol(), method="paper").rate
    limit = explorer.certificate(Settings("fig1a")).upper_bound
    assert limit is not None
    assert max(rates.values()) == rates["best"] <= limit  # type: ignore[type-var, operator]
    assert rates["lmi"] >= rates["perron"] * (1 - 1e-6)  # the best diagonal matrix, but for rounding


def test_what_is_shown_is_what_certify_certifies(explorer: Explorer):
    settings = SLIDING.changed(method="paper", disturbance="sin", seed=3)
    start, sigma0 = np.random.default_rng(3).integers(-9, 10, size=(2, 6)).tolist()
    whole = ptcc.certify(
        load_graph("fig3a"), settings.protocol(), start, sigma0=sigma0, disturbance="1*sin(2*k*t)", method="paper"
    )
    shown = explorer.certificate(settings)
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
        rates.append(Explorer(graph).certificate(Settings(GIVEN, method="paper")).rate)
    assert float(rates[1] / rates[0]) == pytest.approx(2, rel=1e-6)


def test_a_given_graph_comes_first_and_is_shown():
    graph = ptcc.SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    panel = Panel(Explorer(graph), Settings(GIVEN))
    assert panel.controls["graph"].options[0] == GIVEN
    assert "Theorem 1.1" in panel.line("claim")


# ---------------------------------------------------------------------- sliding mode


def test_the_protocol_brings_its_own_controls(explorer: Explorer):
    panel = Panel(explorer, Settings())
    before = panel.image
    panel.set("protocol", "sliding-mode")
    assert "T" not in panel.controls
    own = {"T_r", "T_s", "mu1", "mu2", "mu3", "delta", "sigma(0) random", "disturbance"}
    assert own <= set(panel.controls)
    assert "at T_r + T_s = 1 whatever the disturbance (Theorem 5.1)" in panel.line("claim")
    assert panel.image != before
    panel.set("protocol", "nominal")
    assert panel.image == before
    assert not own & set(panel.controls)


#: Moved one after the other, each with all before it.
MOVES = (
    ("T_r", 0.8, "T_r + T_s = 1.3"),
    ("T_s", 0.9, "T_r + T_s = 1.7"),
    ("mu1", 4.0, "reaching time"),
    ("mu2", 2.0, "reaching time"),
    ("mu3", 2.0, "reaching time"),
    ("delta", 0.5, "reaching time"),
    ("rho1", 1.0, "at T_r"),
    ("rho2", 1.0, "at T_r"),
    ("kappa", 2.0, "at T_r"),
    ("disturbance", "none", "the run meets d = none"),
    ("disturbance", "sin", "sin(2*k*t)"),
    ("disturbance", "telegraph", "random telegraph signals"),
    ("sigma(0) random", False, "||E(t)|| / ||E(0)||"),
    ("start seed", 5, "x(T)"),
    ("bounds", "paper", "rate       7.23"),
)


def test_every_control_of_the_sliding_mode_is_followed(explorer: Explorer):
    panel = Panel(explorer, SLIDING)
    for name, value, says in MOVES:
        before = panel.text, panel.image
        panel.set(name, value)
        assert says in panel.text, name
        assert panel.text != before[0], name
        assert panel.image != before[1], name
        assert panel.line("verdict").startswith("verdict    certified"), name


def test_a_larger_margin_reaches_the_manifold_earlier(explorer: Explorer):
    times = []
    for mu1, delta in ((1.5, 1), (2, 1), (4, 1), (4, 0)):
        reaching = explorer.certificate(SLIDING.changed(mu1=mu1, delta=delta)).reaching
        assert reaching is not None
        times.append(max(r.time for r in reaching))
    assert times == sorted(times, reverse=True)
    assert len(set(times)) == len(times)


def test_the_final_state_is_the_same_whatever_the_disturbance(explorer: Explorer):
    panel, ends = Panel(explorer, SLIDING), set()
    for disturbance in ("worst-case", "none", "sin", "telegraph"):
        panel.controls["disturbance"].value = disturbance
        ends.add(panel.line("x(T)"))
        assert "bound kept" in panel.line("simulated")
    assert len(ends) == 1


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
    assert view.text == view.unchecked
    assert "\n" not in view.text
    assert view.certificate is None
    assert view.png.startswith(PNG)


@pytest.mark.parametrize("change", [{"kind": "other"}, {"method": "magic"}, {"disturbance": "wind"}, {"seed": -1}])
def test_settings_outside_the_choices_are_refused_at_once(change: dict[str, Any]):
    with pytest.raises(ParameterError, match=next(iter(change))):
        Settings(**change)


# ---------------------------------------------------------------------- proved or not


def test_nothing_is_called_certified_before_the_check(explorer: Explorer):
    panel = Panel(explorer, Settings())
    panel.set("T", 0.7)
    assert "not computed yet" in panel.texts[0]
    assert "certified" not in "".join(panel.texts[:2])
    assert "proved" not in "".join(panel.texts[:2])
    assert "not checked yet" in panel.texts[1]
    assert "\nverdict    certified" in panel.texts[-1]


def test_what_the_check_rejects_is_not_certified(explorer: Explorer, monkeypatch: pytest.MonkeyPatch):
    rejection = CheckReport(False, "undecided", (), "rate", "because this test says so", "none", "")
    monkeypatch.setattr(certificates, "check", lambda *args, **options: rejection)
    view = explorer.view(Settings(T=0.9))
    said = "undecided: the independent check rejects rate; please report this graph"
    assert view.text.endswith(f"verdict    {said}")
    assert "REJECTED" in view.text


def test_the_first_view_of_a_class_is_the_papers_until_it_is_found():
    panel = Panel(Explorer(), Settings(method="paper"))
    panel.set("bounds", "full")
    assert len(panel.images) == 1  # the paper's image was there already
    assert "the class full is being searched" in panel.texts[1]
    panel.set("graph", "fig3b")
    assert len(panel.images) == 2
    assert "certified" not in "".join(panel.texts[:-1])


def test_a_larger_graph_is_checked_when_asked():
    n = CHECKED_NODES + 1
    ring = ptcc.SignedDigraph.from_edges([(k, (k + 1) % n, -1 if k == 0 else 1) for k in range(n)])
    panel = Panel(Explorer(ring), Settings(GIVEN, method="paper"))
    assert panel.button.layout.display is None
    panel.set("T", 0.5)
    assert "not checked yet" in panel.text
    assert "certified" not in panel.text
    panel.button.click()
    assert panel.line("verdict").startswith("verdict    certified")


def test_graphs_that_are_too_large_are_refused():
    n = EXPLORED_NODES + 1
    path = ptcc.SignedDigraph.from_edges([(k, k + 1, 1) for k in range(n - 1)])
    with pytest.raises(ParameterError, match=f"up to {EXPLORED_NODES} nodes; this one has {n}"):
        explore(path)


def test_a_graph_without_edges_stays_where_it_is():
    view = Explorer(ptcc.SignedDigraph.from_matrix([[0, 0], [0, 0]], orientation="listens")).view(Settings(GIVEN))
    assert "there is nothing to decay" in view.text
    assert view.png.startswith(PNG)


# ---------------------------------------------------------------------- with and without widgets


def test_in_a_notebook_the_controls_come(monkeypatch: pytest.MonkeyPatch):
    import ipywidgets

    monkeypatch.setattr(module, "_in_notebook", lambda: True)
    widget = explore(settings=Settings("fig1b", T=0.6))
    assert isinstance(widget, ipywidgets.VBox)
    assert "T = 0.6" in widget.children[2].value
    with pytest.raises(ParameterError, match='graph "fig7" is unknown'):
        explore(settings=Settings("fig7"))


@pytest.mark.parametrize("notebook", [True, False])
def test_without_widgets_there_is_a_static_view(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], notebook: bool
):
    monkeypatch.setattr(module, "_in_notebook", lambda: notebook)
    if notebook:
        monkeypatch.setitem(sys.modules, "ipywidgets", None)
    view = explore()
    assert isinstance(view, View)
    assert "pip install 'ptcc-certify[notebook]'" in capsys.readouterr().out
    assert view._repr_png_().startswith(PNG)
    assert len(view.figure.axes) == 2
    assert "\nverdict    certified" in repr(view)


def test_responses_are_told(explorer: Explorer, capsys: pytest.CaptureFixture[str]):
    """Prints seconds; benchmarks/explorer.py measures them in earnest."""
    panel = Panel(explorer, SLIDING)
    moves = [("graph", "fig5a"), ("rho1", 1.0), ("disturbance", "telegraph")]
    told = []
    for name, value in moves:
        image, verdict = panel.set(name, value)
        told.append(f"{name} = {value}: image after {image:.2f} s, verdict after {verdict:.2f} s")
        assert 0 < image <= verdict
    with capsys.disabled():
        print("", *told, sep="\n  ")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("settings", [Settings("fig5a"), Settings("fig5a", kind="sliding-mode", seed=2)])
def test_no_text_of_the_figure_is_clipped_or_on_another_panel(explorer: Explorer, settings: Settings):
    view = explorer.view(settings)
    assert view.png.startswith(b"\x89PNG")
    figure = view.figure
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    width, height = figure.get_size_inches() * figure.dpi
    panels = [ax.get_tightbbox(renderer) for ax in figure.axes]
    for box in panels:
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1
    for before, after in pairwise(panels):
        assert before.x1 <= after.x0 + 1
