"""The explorer: proved bound and simulated run of a graph, redrawn while parameters are moved in a notebook.

Lyapunov functions and their rates depend on the graph alone; gains and deadline enter through the clock. They are
searched and proved once for each graph and class. What follows a control is the rest: clock, run, bound, final state,
and the independent check of the certificate that they make.
"""

from __future__ import annotations

import html
import io
import math
import sys
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lmi.exact.decimal_rounding import down
from ptcc_certify.bounds.final_state import final_state
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.errors import ParameterError, PTCCError
from ptcc_certify.examples import GRAPHS, load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.rationals import as_fraction
from ptcc_certify.graphs.size_limits import CHECKED_NODES, EXPLORED_NODES
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.search import METHODS, search_functions
from ptcc_certify.protocols import Protocol, ReachingProtocol
from ptcc_certify.protocols.disturbance import Disturbance, ExpressionDisturbance, as_disturbance, telegraph_noise
from ptcc_certify.protocols.reaching_time import certified_reaching_times
from ptcc_certify.report.figures import PLOTS
from ptcc_certify.report.plots.decay import error_norm, resolved
from ptcc_certify.report.plots.style import BOUND, RUN, SINGLE_COLUMN, STYLE, finished, new_axes
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.simulation.run import simulate

if TYPE_CHECKING:
    from ipywidgets import VBox

KINDS = ("nominal", "sliding-mode")
DISTURBANCES = ("none", "worst-case", "sin", "telegraph")
#: The name of a graph that is given, among those of the packaged ones.
GIVEN = "given graph"
#: The value of ``s`` times the largest rate that is possible, at which the bound should be small, whatever the gains.
_CLOCK = 4.0
#: Parameters of the protocols with what they begin with; their sliders go up to 3, but for some.
_GAIN = {"rho1": 0.2, "rho2": 0.5, "kappa": 1}
_BEGIN = {"T": 1, "T_r": 0.5, "T_s": 0.5, **_GAIN, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
_LARGEST, _LARGER = 3.0, {"kappa": 5.0, "mu1": 5.0}
#: Those of each kind of protocol.
_OWN = {"nominal": ("T", *_GAIN), "sliding-mode": tuple(name for name in _BEGIN if name != "T")}
#: Lines of the certificate's screen that are shown, by their heads; a line without one belongs to the line before.
_SHOWN = ("claim", "x(T)", "sliding", "disturbed", "rate", "error", "proof", "input", "INPUT", "simulated", "note")
_SAMPLES, _DPI = 81, 120
#: Share of the initial error down to which the decay is drawn: below it the integrator resolves little.
_LEAST = 1e-8
#: Changes of sign of each telegraph signal until the deadline, in the mean.
_SWITCHES = 5
_WITHOUT_WIDGETS = "controls need a notebook with ipywidgets: pip install 'ptcc-certify[notebook]'"


class Settings:
    """What the controls are set to.

    Parameters
    ----------
    graph : str
        A packaged graph, or ``"given graph"``.
    kind : {"nominal", "sliding-mode"}
    reaching : bool
        Sliding mode: whether ``sigma(0)`` is random, or 0, which leaves no reaching phase.
    disturbance : {"none", "worst-case", "sin", "telegraph"}
        Sliding mode: what the simulated run meets; ``sin`` is ``delta sin(2 k t)``.
    seed : int
        Of the initial state, of ``sigma(0)`` and of telegraph signals: whole numbers from -9 to 9.
    method : {"best", "paper", "perron", "lmi", "full"}
        Classes of Lyapunov functions; see :mod:`ptcc_certify.lyapunov.search`.
    **parameters : number or str
        Parameters of the protocol: ``T, T_r, T_s, rho1, rho2, kappa, mu1, mu2, mu3, delta``; those of the other kind
        are ignored. A float is taken as the decimal of 12 digits that it stands for: 0.6 is 3/5.

    Raises
    ------
    ParameterError
        An unknown kind, disturbance, method or parameter, or a negative seed.

    Examples
    --------
    >>> Settings(T=0.6, rho2=0.3).protocol()
    NominalProtocol(T=3/5, rho1=1/5, rho2=3/10, kappa=1)
    """

    def __init__(
        self,
        graph: str = "fig3a",
        kind: str = "nominal",
        *,
        reaching: bool = True,
        disturbance: str = "worst-case",
        seed: int = 0,
        method: str = "best",
        **parameters: Any,
    ):
        self.graph, self.kind, self.reaching, self.disturbance = graph, kind, reaching, disturbance
        self.seed, self.method, self.parameters = seed, method, _BEGIN | parameters
        for name, known in (("kind", KINDS), ("disturbance", DISTURBANCES), ("method", METHODS)):
            _refuse_unknown(name, getattr(self, name), known)
        for name in parameters:
            _refuse_unknown("parameter", name, _BEGIN)
        if seed < 0:
            raise ParameterError(f"seed = {seed} is outside its domain; seed must be >= 0")

    def to_dict(self) -> dict[str, Any]:
        """Return all settings by their names, the parameters of the protocol among them."""
        own = {name: value for name, value in vars(self).items() if name != "parameters"}
        return own | self.parameters

    def changed(self, **changes: Any) -> Settings:
        """Return these settings but for some.

        Raises
        ------
        ParameterError
            As for new ones.
        """
        return Settings(**self.to_dict() | changes)

    def protocol(self) -> Protocol:
        """Return the protocol.

        Raises
        ------
        ParameterError
            A parameter is outside its domain.
        """
        return Protocol.from_dict({"kind": self.kind} | {k: _decimal(self.parameters[k]) for k in _OWN[self.kind]})


@dataclass(frozen=True, eq=False, repr=False)
class View:
    """What is shown for some settings: in a notebook the figure, elsewhere the text.

    Attributes
    ----------
    settings : Settings
    certificate : Certificate or None
        None where the settings are refused.
    refusal : str
        What is wrong with the settings, in one line.
    """

    settings: Settings
    certificate: Certificate | None
    refusal: str = ""

    @cached_property
    def text(self) -> str:
        """Claim, rate, run and verdict, or the refusal. The independent check is made when this is asked for."""
        if self.certificate is None:
            return self.refusal
        return "\n".join(_select_lines(certificate_lines(self.certificate, self.settings.graph)))

    @property
    def unchecked(self) -> str:
        """Claim and rate, or the refusal, before the independent check: nothing is called certified."""
        if self.certificate is None:
            return self.refusal
        return "\n".join(_unchecked_lines(self.certificate))

    @cached_property
    def figure(self) -> Figure:
        """States, sliding variables if there is a reaching phase, and decay under the proved bound."""
        return _refusal(self.refusal) if self.certificate is None else _figure(self.certificate)

    @cached_property
    def png(self) -> bytes:
        """The figure as PNG."""
        buffer = io.BytesIO()
        FigureCanvasAgg(self.figure).print_png(buffer)
        return buffer.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return self.text


class Explorer:
    """Makes views of settings, and keeps what does not depend on the gains.

    Parameters
    ----------
    graph : SignedDigraph, optional
        A graph of up to 120 nodes besides the packaged ones.

    Attributes
    ----------
    graphs : dict of str to SignedDigraph
        By name; a given graph comes first.

    Raises
    ------
    ParameterError
        The graph has more than 120 nodes.

    Examples
    --------
    >>> view = Explorer().view(Settings("fig1b", T=0.6))
    >>> print(view.text.splitlines()[0])
    claim      bipartite consensus at T = 0.6 (Theorem 1.1)
    >>> print(Explorer().view(Settings("fig1b", T=0)).text)
    T = 0 is outside its domain; T must be > 0
    """

    def __init__(self, graph: SignedDigraph | None = None):
        self.graphs = {} if graph is None else {GIVEN: graph}
        if graph is not None and graph.n_nodes > EXPLORED_NODES:
            raise ParameterError(
                f"graphs are explored up to {EXPLORED_NODES} nodes; this one has {graph.n_nodes}: use certify"
            )
        self.graphs |= {name: load_graph(name) for name in GRAPHS}
        self._proved: dict[tuple[str, str], Certificate] = {}

    def knows(self, settings: Settings) -> bool:
        """Tell whether the Lyapunov functions are found already, so that a view takes a fraction of a second."""
        return (settings.graph, settings.method) in self._proved

    def certificate(self, settings: Settings) -> Certificate:
        """Return the certificate of some settings, with a simulated run that is not compared with the bound yet.

        It equals that of :func:`ptcc_certify.certify` but for the choice among the Lyapunov functions of the method:
        they are to be good under all gains, and are not chosen for those at hand.

        Raises
        ------
        PTCCError
            The settings are refused, or the integrator failed.
        """
        protocol, base = settings.protocol(), self._base(settings)
        if not protocol.prescribed:
            raise ParameterError("rho2 = 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
        structure, n = base.structure, base.graph.n_nodes
        draws = np.random.default_rng(settings.seed).integers(-9, 10, size=(2, n)).tolist()
        x0 = [Fraction(x) for x in draws[0]]
        more: dict[str, Any] = {}
        if (sliding := protocol.reaching) is not None:
            sigma0 = [Fraction(x) for x in (draws[1] if settings.reaching else [0] * n)]
            base = base.changed(sigma0=tuple(sigma0), reaching=certified_reaching_times(sliding, sigma0))
            more = {"sigma0": [float(x) for x in sigma0], "disturbance": _disturbance(settings, sliding, n)}
        run = simulate(base.graph, protocol, [float(x) for x in x0], samples=_SAMPLES, **more)
        offset = base.sigma0 or (Fraction(0),) * n
        shifted = [x - s for x, s in zip(x0, offset, strict=True)]
        return base.changed(
            protocol=protocol,
            initial_state=tuple(x0),
            final_state=final_state(structure, shifted, matrix=base.influence),
            trajectory=run,
        )

    def view(self, settings: Settings) -> View:
        """Return figure and text of some settings; those that are refused are told in one line.

        Parameters
        ----------
        settings : Settings

        Returns
        -------
        View
        """
        try:
            return View(settings, self.certificate(settings))
        except PTCCError as error:
            return View(settings, None, str(error))
        except OverflowError:
            return View(settings, None, "a number is beyond the range of float64; choose other settings")

    def _base(self, settings: Settings) -> Certificate:
        """Return a nominal certificate of the graph, whose structure and Lyapunov functions serve all gains."""
        graph, method = settings.graph, settings.method
        _refuse_unknown("graph", graph, self.graphs)
        if (graph, "paper") not in self._proved:
            base = certify(self.graphs[graph], Settings().protocol(), simulation=False, method="paper")
            self._proved[graph, "paper"] = base
        if (graph, method) not in self._proved:
            base = self._proved[graph, "paper"]
            unit = float(base.upper_bound or 1)
            search = search_functions(ErrorSystem(base.structure), method, [_CLOCK / unit])
            notes = (*base.notes, *search.notes)
            self._proved[graph, method] = base.changed(search=search, method=method, notes=notes)
        return self._proved[graph, method]


def explore(graph: SignedDigraph | None = None, settings: Settings | None = None) -> VBox | View:
    """Show controls for graph, protocol, disturbance, initial state and class of bounds; bound and run follow them.

    Certificates of graphs of up to 24 nodes are checked at every change; larger ones when the button is pressed, and
    until then nothing is called certified. Without ipywidgets, or outside a notebook, a line says how to get the
    controls, and one static view is returned.

    Parameters
    ----------
    graph : SignedDigraph, optional
        A graph of up to 120 nodes besides the packaged ones.
    settings : Settings, optional
        What the controls begin with.

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
    controls need a notebook with ipywidgets: pip install 'ptcc-certify[notebook]'
    >>> print(view.text.splitlines()[-1])
    verdict    certified; ||E|| <= 2.3e-06 ||E(0)|| at 0.99 T
    """
    explorer = Explorer(graph)
    if settings is None:
        settings = Settings() if graph is None else Settings(graph=GIVEN)
    if _in_notebook():
        try:
            return controls(explorer, settings)
        except ImportError:
            pass
    print(_WITHOUT_WIDGETS)
    return explorer.view(settings)


def controls(explorer: Explorer, settings: Settings) -> VBox:
    """Return the widget of :func:`explore`: controls, figure and text.

    Parameters
    ----------
    explorer : Explorer
    settings : Settings
        What the controls begin with.

    Returns
    -------
    ipywidgets.VBox
        Its children are the controls, a button that checks larger graphs, the text and the image.

    Raises
    ------
    ImportError
        ipywidgets is not installed.
    PTCCError
        The settings name an unknown graph, or a parameter that is not a number.
    """
    import ipywidgets as widgets

    _refuse_unknown("graph", settings.graph, explorer.graphs)
    panel = _panel(explorer, settings.to_dict())
    image, text = widgets.Image(format="png"), widgets.HTML()
    button, box = widgets.Button(description="check"), widgets.HBox(layout={"flex_flow": "row wrap"})

    def read_settings() -> Settings:
        return Settings(**{name: control.value for name, control in panel.items()})

    def tell(words: str) -> None:
        text.value = f"<pre>{html.escape(words)}</pre>"

    def show(view: View, more: str = "") -> None:
        tell(view.unchecked + more)
        image.value = view.png

    def update(_: object = None) -> None:
        tell("verdict    none: not computed yet")  # nothing of the settings before may stay
        settings = read_settings()
        names = ("graph", "kind", "method", "seed", *_OWN[settings.kind])
        names += ("reaching", "disturbance") if settings.kind == "sliding-mode" else ()
        children = tuple(panel[name] for name in names)
        if box.children != children:
            box.children = children
        cheap = explorer.graphs[settings.graph].n_nodes <= CHECKED_NODES
        button.layout.display = "none" if cheap else None
        if not explorer.knows(settings):  # the paper's function is there at once
            remark = f"\nbounds     the paper's; the class {settings.method} is being searched"
            show(explorer.view(settings.changed(method="paper")), remark)
        view = explorer.view(settings)
        show(view)
        if cheap:
            tell(view.text)

    for control in panel.values():
        control.observe(update, names="value")
    button.on_click(lambda _: tell(explorer.view(read_settings()).text))
    update()
    return widgets.VBox([box, button, text, image])


def _panel(explorer: Explorer, begin: dict[str, Any]) -> dict[str, Any]:
    """Return the controls by the names of the settings, set to what these begin with."""
    import ipywidgets as widgets

    wide = {"style": {"description_width": "85px"}, "layout": {"width": "310px"}}

    def choice(name: str, options: tuple[str, ...], title: str) -> Any:
        return widgets.Dropdown(options=options, value=begin[name], description=title, **wide)

    def slider(name: str, largest: float) -> Any:
        value = float(as_fraction(_decimal(begin[name]), name))
        bounds = {"min": min(0.0, value), "max": max(largest, value), "step": 0.05, "readout_format": ".6g"}
        return widgets.FloatSlider(value=value, description=name, continuous_update=False, **bounds, **wide)

    seed, largest = begin["seed"], max(99, begin["seed"])
    return {
        "graph": choice("graph", tuple(explorer.graphs), "graph"),
        "kind": choice("kind", KINDS, "protocol"),
        "method": choice("method", METHODS[::-1], "bounds"),
        "seed": widgets.IntSlider(seed, 0, largest, description="start seed", continuous_update=False, **wide),
        **{name: slider(name, _LARGER.get(name, _LARGEST)) for name in _BEGIN},
        "reaching": widgets.Checkbox(value=begin["reaching"], description="sigma(0) random", indent=False),
        "disturbance": choice("disturbance", DISTURBANCES, "disturbance"),
    }


def _in_notebook() -> bool:
    """Tell whether a kernel that shows widgets runs this."""
    shell = sys.modules.get("IPython")  # which a kernel has loaded
    return shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None


def _refuse_unknown(name: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise ParameterError(f'{name} "{value}" is unknown; one of {", ".join(choices)}')


def _decimal(value: Any) -> Any:
    """Return a float as a decimal of 12 digits: sliders give 0.15000000000000002 for 0.15."""
    return f"{value:.12g}" if isinstance(value, float) else value


def _disturbance(settings: Settings, protocol: ReachingProtocol, n: int) -> Disturbance:
    """Return what the simulated run meets, scaled to ``delta``."""
    until = float(protocol.T) * 2
    if settings.disturbance == "sin":
        return ExpressionDisturbance(f"{_decimal(settings.parameters['delta'])}*sin(2*k*t)")
    if settings.disturbance == "telegraph":
        return telegraph_noise(float(protocol.delta), _SWITCHES / float(protocol.T), n, until, settings.seed)
    return as_disturbance(settings.disturbance, n, protocol.delta, until)


def _select_lines(lines: list[str]) -> list[str]:
    """Keep the lines whose heads are shown, with those that belong to them."""
    selection, head = [], ""
    for line in lines:
        head = line[:10].strip() or head
        selection += [line] if head in (*_SHOWN, "verdict") else []
    return selection


def _unchecked_lines(certificate: Certificate) -> list[str]:
    """Tell claim and rate of a certificate that the independent check has not seen."""
    behaviours = ", ".join(claim.behaviour for claim in certificate.claims[:4])
    rate = "none" if certificate.rate is None else down(certificate.rate)
    return [
        f"claim      {behaviours} at T = {float(certificate.protocol.T):.12g} (Theorem {certificate.theorem.number})",
        f"rate       {rate} per unit of s, as found",
        "verdict    none: not checked yet",
    ]


def _figure(certificate: Certificate) -> Figure:
    """Draw states, sliding variables if there is a reaching phase, and decay under the bound."""
    draw: list[Callable[..., object]] = [PLOTS["states"]]
    draw += [] if certificate.direct else [PLOTS["sliding"]]
    draw += [_draw_decay] if certificate.envelope.functions else []
    width, height = SINGLE_COLUMN
    with style.context(STYLE):
        figure = Figure((width * len(draw), height), dpi=_DPI, layout="none")  # type: ignore[arg-type]
        # Fixed margins in inches, for labels, and for three lines of a legend: finding them takes half the drawing.
        left, right, bottom, top, gap = 0.65, 0.35, 0.42, 0.7, 1.25
        whole, panel_width = width * len(draw), (width * len(draw) - left - right - gap * (len(draw) - 1)) / len(draw)
        figure.subplots_adjust(left / whole, bottom / height, 1 - right / whole, 1 - top / height, gap / panel_width)
        for place, panel in enumerate(draw, start=1):
            panel(certificate, ax=new_axes(figure, (1, len(draw), place)))
    return figure


def _draw_decay(certificate: Certificate, ax: Axes) -> None:
    """Draw ``||E||`` (or ``||eps||``) under its bound as :func:`plot_decay` does, but without each function's own."""
    run, envelope = certificate.trajectory, certificate.envelope
    assert run is not None
    before = run.remaining > 0
    function = next(m for m in envelope.functions if m.coordinates == envelope.coordinates)
    norm = np.linalg.norm(function.coordinates_of(run.states[:, before], certificate.graph.laplacian()), axis=0)
    bound, scale = certificate.norm_bound(run.remaining[before]), float(norm[0]) or 1.0
    _, floor, unit = error_norm(run, certificate)
    norm = resolved(norm, bound, floor * unit)
    ax.loglog(run.remaining[before], bound / scale, color=BOUND, linewidth=1.6, label="bound")
    ax.loglog(run.remaining[before], norm / scale, color=RUN, label="simulated (CVODES)")
    top = float(bound[0]) / scale
    ax.set_ylim(_LEAST, 3 * max(1.0, top if math.isfinite(top) else 1.0))
    ax.invert_xaxis()
    ax.minorticks_off()  # these and typeset powers of ten would take longer to draw than all the rest
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_ticks([1, 1e-2, 1e-4, 1e-6, 1e-8])
        axis.set_major_formatter("{x:g}")
    name = "E" if envelope.coordinates == "E" else r"\varepsilon"
    finished(ax, "remaining time, $1 - t/T$", rf"$\|{name}(t)\| / \|{name}(0)\|$")


def _refusal(message: str) -> Figure:
    """Return a figure that holds nothing but a message."""
    figure = Figure((2 * SINGLE_COLUMN[0], SINGLE_COLUMN[1]), dpi=_DPI)
    figure.text(0.5, 0.5, textwrap.fill(message, 90), ha="center", va="center", parse_math=False)
    return figure
