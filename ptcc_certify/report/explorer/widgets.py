"""The explorer in a notebook: controls of ipywidgets, text and figure."""

from __future__ import annotations

import asyncio
import html
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.io.packaged import GRAPHS
from ptcc_certify.graphs.rationals import as_fraction, shorten
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.report.explorer.model import Explorer, View
from ptcc_certify.report.explorer.settings import (
    DISTURBANCES,
    GIVEN,
    KINDS,
    LARGEST_SEED,
    SLIDERS,
    Settings,
    refuse_unknown,
)

if TYPE_CHECKING:
    from ipywidgets import VBox

_WITHOUT_WIDGETS = (
    'controls need a notebook with ipywidgets (pip install ".[notebook]"); in a browser, without: ptcc explore'
)
#: Seconds of rest after which what is shown is certified.
_REST = 0.3


def explore(graph: Any = None, settings: Settings | None = None, *, orientation: str | None = None) -> VBox | View:
    """Show controls for graph, protocol, disturbance, initial state and class of bounds; bound and run follow them.

    While a control is moved the bound is that of Lyapunov functions found before, and nothing is called certified; at
    rest it is what :func:`ptcc_certify.certify` certifies. Without ipywidgets, or outside a notebook, a line says how
    to get the controls, and one static view is returned; ``ptcc explore`` shows the same in a browser.

    Parameters
    ----------
    graph : graph-like, optional
        A graph of up to 120 nodes besides the packaged ones: whatever :func:`ptcc_certify.as_graph` takes.
    settings : Settings, optional
        What the controls begin with.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    ipywidgets.VBox or View

    Raises
    ------
    ParameterError
        The graph has more than 120 nodes, or the settings name an unknown one.

    Examples
    --------
    >>> view = explore()
    controls need a notebook with ipywidgets (pip install ".[notebook]"); in a browser, without: ptcc explore
    >>> print(view.text.splitlines()[-1])
    verdict    certified; ||E|| <= 1.8e-30 ||E(0)|| at 0.99 T
    """
    if settings is not None and not isinstance(settings, Settings):
        raise ParameterError("settings", f"= {shorten(repr(settings))} is none; give ptcc.report.explorer.Settings()")
    packaged = isinstance(graph, str) and graph in GRAPHS
    explorer = Explorer(None if graph is None or packaged else as_graph(graph, orientation))
    if settings is None:
        settings = Settings() if graph is None else Settings(graph=graph if packaged else GIVEN)
    if _in_notebook():
        try:
            return controls(explorer, settings)
        except ImportError:
            pass
    print(_WITHOUT_WIDGETS)
    return explorer.view(settings)


def controls(explorer: Explorer, settings: Settings) -> VBox:
    """Return the widget of :func:`explore`: controls, text and figure.

    Parameters
    ----------
    explorer : Explorer
    settings : Settings
        What the controls begin with.

    Returns
    -------
    ipywidgets.VBox
        Its children are the controls, the text and the image.

    Raises
    ------
    ImportError
        ipywidgets is not installed.
    PTCCError
        The settings name an unknown graph, or a parameter that is not a number.
    """
    import ipywidgets as widgets

    refuse_unknown("graph", settings.graph, explorer.graphs)
    panel = _panel(explorer, settings.to_dict())
    image, text = widgets.Image(format="png"), widgets.HTML()
    box = widgets.HBox(layout={"flex_flow": "row wrap"})
    certified: list[asyncio.TimerHandle] = []

    def show(view: View) -> None:
        image.value, text.value = view.png, f"<pre>{html.escape(view.text)}</pre>"

    def update(_: object = None) -> None:
        while certified:
            certified.pop().cancel()
        chosen = Settings(**{name: control.value for name, control in panel.items()})
        names = ["graph", "kind", "method", "seed", *chosen.own]
        names += ["reaching", "disturbance"] if chosen.kind == "sliding-mode" else []
        if box.children != (children := tuple(panel[name] for name in names)):
            box.children = children
        show(explorer.preview(chosen))
        certified.extend(_at_rest(lambda: show(explorer.view(chosen))))

    for control in panel.values():
        control.observe(update, names="value")
    update()
    return widgets.VBox([box, text, image])


def _at_rest(work: Callable[[], None]) -> list[asyncio.TimerHandle]:
    """Do work after a while, which may be cancelled; at once where no event loop runs."""
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        work()
        return []
    return [loop.call_later(_REST, work)]


def _panel(explorer: Explorer, begin: dict[str, Any]) -> dict[str, Any]:
    """Return the controls by the names of the settings, set to what these begin with."""
    import ipywidgets as widgets

    wide = {"style": {"description_width": "85px"}, "layout": {"width": "310px"}}

    def choice(name: str, options: tuple[str, ...], title: str) -> Any:
        return widgets.Dropdown(options=options, value=begin[name], description=title, **wide)

    def slider(name: str) -> Any:
        value, of = float(as_fraction(begin[name], name)), SLIDERS[name]
        bounds = {"min": min(of.least, value), "max": max(of.largest, value), "step": of.step}
        looks = {"readout_format": ".6g", "tooltip": of.meaning}
        return widgets.FloatSlider(value=value, description=name, continuous_update=False, **looks, **bounds, **wide)

    seed, largest = begin["seed"], max(LARGEST_SEED, begin["seed"])
    return {
        "graph": choice("graph", tuple(explorer.graphs), "graph"),
        "kind": choice("kind", KINDS, "protocol"),
        "method": choice("method", METHODS[::-1], "bounds"),
        "seed": widgets.IntSlider(seed, 0, largest, description="initial state", continuous_update=False, **wide),
        **{name: slider(name) for name in SLIDERS},
        "reaching": widgets.Checkbox(value=begin["reaching"], description="sigma(0) random", indent=False),
        "disturbance": choice("disturbance", DISTURBANCES, "disturbance"),
    }


def _in_notebook() -> bool:
    """Tell whether a kernel that shows widgets runs this."""
    shell = sys.modules.get("IPython")  # which a kernel has loaded
    return shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None
