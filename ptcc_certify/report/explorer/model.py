"""What the explorer shows of settings: figures, facts, verdict, and the code that makes them.

Lyapunov functions depend on the graph alone; gains and deadline enter through the clock. While a control is moved the
bound is therefore that of functions found before, in a fraction of a second; at rest it is what ``certify`` certifies.
"""

from __future__ import annotations

import io
import math
import shlex
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.certificate.assessment import CERTIFIED, rejects
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify, certify_case
from ptcc_certify.certificate.request import refuse_long_weights
from ptcc_certify.errors import ParameterError, PTCCError, SimulationError, spell
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.packaged import GRAPHS
from ptcc_certify.graphs.reading import Reading, option_flags
from ptcc_certify.graphs.size_limits import EXPLORED_NODES
from ptcc_certify.model import Protocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, Case, InitialState
from ptcc_certify.model.disturbance import Disturbance, as_disturbance
from ptcc_certify.model.reaching_time import certified_reaching_times
from ptcc_certify.model.refusals import refuse_before_the_graph
from ptcc_certify.report.explorer.facts import UNCHECKED, of_controls, rows_of
from ptcc_certify.report.explorer.settings import GIVEN, Settings, refuse_unknown
from ptcc_certify.report.page_figures import PLOTS
from ptcc_certify.report.plots.decay import error_norm, resolved
from ptcc_certify.report.plots.sizes import SINGLE_COLUMN
from ptcc_certify.report.plots.style import BOUND, RUN, STYLE, figure_bytes, finished, new_axes
from ptcc_certify.simulation.run import simulate

#: The panels, in the order in which they stand, and what they show.
PANELS = {
    "states": "States over time",
    "decay": "Error under its proved bound",
    "graph": "The graph: who listens to whom",
    "input": "Input over time",
    "sliding": "Sliding variables over time",
}
#: Share of the initial error down to which the decay is drawn, below which the integrator resolves little; and of time.
_LEAST, _LAST = 1e-8, 1e-4
#: Decades that are named on the axes of the decay.
_TICKS = {4: "10⁴", 2: "100", 0: "1", -2: "0.01", -4: "10⁻⁴", -6: "10⁻⁶", -8: "10⁻⁸"}
#: A panel in inches, and its margins: left, bottom, right, and top: the longest legend has one line, or four.
_SIZE, _MARGINS = (SINGLE_COLUMN[0], 3.0), (0.62, 0.45, 0.56)
_TOP = {"decay": 0.26, "states": 0.74, "input": 0.74, "graph": 0.74, "sliding": 0.74}


def panel_svg(certificate: Certificate, name: str) -> str:
    """Return a panel by itself, as wide as a column of a journal, as SVG."""
    return figure_bytes(draw_panels(certificate, (name,)), ".svg").decode()


def shown_in(certificate: Certificate, name: str) -> Any:
    """Return all that a panel shows of a graph, if it does not change with every control; None if it does.

    Sliding variables move by their own gain: those of the protocol's states leave them as they are.
    """
    run = certificate.trajectory
    if name == "graph":
        return name
    if name != "sliding" or run is None or run.sliding is None:
        return None
    moved = tuple(part.tobytes() for part in (run.t, run.sliding.sigma, run.sliding.reaching_times))
    return moved, run.sliding.protocol.T_r, certificate.proof.reaching


def draw_panels(certificate: Certificate, names: tuple[str, ...]) -> Figure:
    """Return panels in one figure, two beside each other."""
    columns = min(2, len(names))
    rows = math.ceil(len(names) / columns)
    size = np.array([columns * _SIZE[0], rows * _SIZE[1]])
    with style.context(STYLE):
        figure = Figure(size.tolist(), layout="none")  # type: ignore[arg-type]  # with one all is drawn twice
        for place, name in enumerate(names, start=1):
            ax = new_axes(figure, (rows, columns, place))
            row, column = divmod(place - 1, columns)
            left, bottom, right = (0.1, 0.1, 0.1) if name == "graph" else _MARGINS
            corner = (column * _SIZE[0] + left, (rows - 1 - row) * _SIZE[1] + bottom) / size
            extent = (_SIZE[0] - left - right, _SIZE[1] - bottom - _TOP[name]) / size
            ax.set_position((*corner, *extent))
            _draw(certificate, name, ax)
    return figure


def message_figure(message: str) -> Figure:
    """Return a figure that holds nothing but a message."""
    figure = Figure((2 * SINGLE_COLUMN[0], SINGLE_COLUMN[1]))
    figure.text(0.5, 0.5, message, ha="center", va="center", wrap=True, parse_math=False)
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=90)
    return buffer.getvalue()


def _draw(certificate: Certificate, name: str, ax: Axes) -> None:
    """Draw a panel, or say that there is nothing to draw."""
    try:
        if name != "graph" and certificate.trajectory is None:
            raise ValueError("the integrator failed: there is no run to draw")
        (_draw_decay if name == "decay" else PLOTS[name])(certificate, ax=ax)
    except ValueError as nothing:
        ax.clear()
        ax.set_axis_off()
        ax.text(0.5, 0.5, str(nothing), ha="center", va="center", wrap=True, transform=ax.transAxes, parse_math=False)


def _draw_decay(certificate: Certificate, ax: Axes) -> None:
    """Draw ``||E||`` (or ``||eps||``) under its bound as :func:`plot_decay` does, but without each function's own.

    These, typeset powers of ten and minor ticks would take longer to draw than all the rest; the axes are fixed.
    """
    run, envelope = certificate.trajectory, certificate.graph_proof.envelope
    if run is None or not envelope.functions or certificate.proof.constant:
        raise ValueError("there is nothing to decay" if certificate.proof.constant else "no bound is proved")
    before = run.remaining > 0
    norm, floor, unit = error_norm(run, certificate)
    bound = certificate.graph_proof.norm_bound(run.remaining[before]) / unit
    scale = float(norm[0]) or 1.0
    ax.loglog(run.remaining[before], bound / scale, color=BOUND, linewidth=1.6, label="proved bound")
    ax.loglog(run.remaining[before], resolved(norm, bound, floor) / scale, color=RUN, label="simulated (CVODES)")
    ax.minorticks_off()
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_ticks([10.0**k for k in _TICKS], list(_TICKS.values()))
    ax.set_xlim(1, _LAST)
    ax.set_ylim(_LEAST, 1e4)
    name = "E" if envelope.coordinates == "E" else "ε"
    finished(ax, "remaining time, 1 − t/T", f"‖{name}(t)‖ / ‖{name}(0)‖")


@dataclass(frozen=True, eq=False)
class Question:
    """What ``certify`` is asked for some settings.

    Attributes
    ----------
    settings : Settings
    source : mapping or None
        Where the graph was read from and how (``path``, ``orientation``, ...); None of a packaged graph or an object.
    graph : SignedDigraph
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : list of N int
    sigma0 : list of N int, or None
        None for the nominal protocol.
    disturbance : Disturbance or None
    """

    settings: Settings
    source: Mapping[str, Any] | None
    graph: SignedDigraph
    protocol: Protocol
    x0: list[int]
    sigma0: list[int] | None
    disturbance: Disturbance | None

    @property
    def sliding(self) -> dict[str, Any]:
        """What is asked under the sliding-mode protocol alone."""
        return {} if self.sigma0 is None else {"sigma0": self.sigma0, "disturbance": self.disturbance}


def python_of(question: Question) -> str:
    """Return Python that makes the certificate of a question and draws its decay."""
    settings, source, name = question.settings, question.source, question.settings.graph
    lines = ["import ptcc_certify as ptcc"]
    if source is None and name in GRAPHS:
        lines += ["", f'g = "{name}"']
    elif source is None:
        lines += ["", "g = ...  # the graph that was given to explore()"]
    else:
        how = "".join(f", {key}={value!r}" for key, value in source.items() if key != "path")
        lines += ["", f"g = ptcc.read_graph({source['path']!r}{how})"]
    kind = "SlidingModeProtocol" if settings.kind == "sliding-mode" else "NominalProtocol"
    parameters = ", ".join(f"{key}={value!r}" for key, value in _texts(question).items())
    lines += fill(f"p = ptcc.{kind}({parameters})", 80, subsequent_indent="    ").split("\n")
    asks = [] if settings.method == "best" else [f'method="{settings.method}"']
    arguments = [f"x0={question.x0}"]
    if question.sigma0 is not None:
        arguments = [f"x0=ptcc.InitialState({question.x0}, sigma0={question.sigma0})"]
        asks.append(f"disturbance={_disturbance(question)}")
    if asks:
        arguments.append(f"asks=ptcc.Asks({', '.join(asks)})")
    lines += ["cert = ptcc.certify(", "    g,", "    p,", *(f"    {argument}," for argument in arguments), ")"]
    lines += ["print(cert)", 'ptcc.save_figure(ptcc.plot_decay(cert), "decay.png")']
    return "\n".join(lines)


def command_of(question: Question) -> str:
    """Return the ``ptcc certify`` of a question."""
    settings, source = question.settings, dict(question.source or {})
    words = ["ptcc", "certify", str(source.pop("path", settings.graph))]
    words += ["--edges", str(source["orientation"])] if "orientation" in source else []
    words += [word for flag in option_flags(source) for word in flag.split(" ", 1)]
    words += [] if settings.kind == "nominal" else ["--protocol", settings.kind]
    for key, value in _texts(question).items():
        words += [f"--{key.replace('_', '-')}", value]
    words.append(f"--x0={','.join(map(str, question.x0))}")
    if question.sigma0 is not None:
        words += [f"--sigma0={','.join(map(str, question.sigma0))}"] if any(question.sigma0) else []
        words += ["--disturbance", settings.disturbance_text]
        words += ["--seed", str(settings.seed)] if settings.disturbance == "telegraph" else []
    words += [] if settings.method == "best" else ["--method", settings.method]
    return shlex.join(words)


def reading_of(path: str, orientation: str | None, **how: Any) -> dict[str, Any]:
    """Return where a graph was read from and how, but for what is so unless it is told."""
    options = {"orientation": orientation, **how}
    return {"path": path} | {key: value for key, value in options.items() if value != getattr(Reading, key)}


def _texts(question: Question) -> dict[str, str]:
    return {name: str(value) for name, value in question.settings.own.items()}


def _disturbance(question: Question) -> str:
    settings, protocol = question.settings, question.protocol
    if settings.disturbance != "telegraph" or not isinstance(protocol, SlidingModeProtocol):
        return repr(settings.disturbance_text)
    until = 2 * float(protocol.T)
    return (
        f"ptcc.telegraph_noise({float(protocol.delta)}, rate={20 / until!r}, n={len(question.x0)}, "
        f"until={until!r}, seed={settings.seed})"
    )


#: Instants of a run that is drawn while a control is moved.
_SAMPLES = 61


@dataclass(frozen=True, eq=False, repr=False)
class View:
    """What is shown for some settings: in a notebook the figure, elsewhere the text.

    Attributes
    ----------
    settings : Settings
    refusal : str
        What is wrong with the settings, in one line; empty if nothing is.
    question : Question or None
    certificate : Certificate or None
        None where the settings are refused, like the question.
    checked : bool
        Whether ``certify`` made the certificate, with its independent check.
    """

    settings: Settings
    refusal: str = ""
    question: Question | None = None
    certificate: Certificate | None = None
    checked: bool = False

    @cached_property
    def facts(self) -> dict[str, str]:
        """What is claimed and bounded, by heads that are the same for all settings; empty if refused, or rejected."""
        if self.certificate is None or (self.checked and rejects(self.certificate.checked)):
            return {}
        return rows_of(self.certificate, compared=self.checked)

    @property
    def verdict(self) -> str:
        """The verdict line of ``certify``; before the check it says so."""
        if self.certificate is None:
            return self.refusal
        return spell(self.certificate.assessment.sentence, of_controls) if self.checked else UNCHECKED

    @property
    def grade(self) -> str:
        """``"good"`` if certified and of use; ``"doubt"``, ``"bad"``; ``"open"`` before the check."""
        if self.certificate is None:
            return "bad"
        if not self.checked:
            return "open"
        assessment = self.certificate.assessment
        if assessment.violated:
            return "bad"
        return "good" if assessment.verdict == CERTIFIED and assessment.useful else "doubt"

    @property
    def text(self) -> str:
        """Facts and verdict as lines, or the refusal."""
        lines = [f"{head:<10} {text}" for head, text in (self.facts | {"verdict": self.verdict}).items()]
        return self.refusal or "\n".join(lines)

    @property
    def panels(self) -> tuple[str, ...]:
        """The panels of which there is something to show: sliding variables only where they move."""
        moves = self.settings.kind == "sliding-mode" and self.settings.reaching
        return tuple(name for name in PANELS if name != "sliding" or moves)

    @cached_property
    def figure(self) -> Figure:
        """All panels in one figure, or the refusal."""
        return message_figure(self.refusal) if self.certificate is None else draw_panels(self.certificate, self.panels)

    @cached_property
    def png(self) -> bytes:
        """The figure as PNG."""
        return png(self.figure)

    @property
    def python(self) -> str:
        """Python that makes the checked certificate; empty if the settings are refused."""
        return "" if self.question is None else python_of(self.question)

    @property
    def command(self) -> str:
        """The command line that prints it; empty if the settings are refused."""
        return "" if self.question is None else command_of(self.question)

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
    name : str
        Of this graph.
    source : mapping, optional
        Where this graph was read from and how: ``path``, and keywords of :func:`ptcc_certify.read_graph`.

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

    def __init__(self, graph: SignedDigraph | None = None, name: str = GIVEN, source: Mapping[str, Any] | None = None):
        if graph is not None and graph.n_nodes > EXPLORED_NODES:
            raise ParameterError(
                f"graphs are explored up to {EXPLORED_NODES} nodes; this one has {graph.n_nodes}: use certify"
            )
        given = {} if graph is None else {name: graph}
        self.graphs = given | {packaged: load_graph(packaged) for packaged in GRAPHS if packaged not in given}
        self._sources = {name: source}
        self._latest: dict[tuple[str, str], Certificate] = {}
        self._drawn: dict[tuple[str, str], tuple[Any, str]] = {}

    def preview(self, settings: Settings) -> View:
        """Return a view at once: the bound is that of Lyapunov functions found before, and nothing is checked.

        Parameters
        ----------
        settings : Settings

        Returns
        -------
        View
        """
        return self._view(settings, self._preview, checked=False)

    def view(self, settings: Settings, progress: Callable[[str], None] = lambda step: None) -> View:
        """Return the view of what ``certify`` certifies; settings that are refused are told in one line.

        Parameters
        ----------
        settings : Settings
        progress : callable, optional
            Is told each step of ``certify`` as it begins.

        Returns
        -------
        View
        """
        return self._view(settings, lambda question: self._certificate(question, progress), checked=True)

    def svg(self, view: View, name: str) -> str:
        """Return a panel of a view as SVG; what it shows is drawn again only if that has changed."""
        assert view.certificate is not None
        place, shows = (view.settings.graph, name), shown_in(view.certificate, name)
        if shows is None:
            return panel_svg(view.certificate, name)
        if self._drawn.get(place, (None, ""))[0] != shows:
            self._drawn[place] = shows, panel_svg(view.certificate, name)
        return self._drawn[place][1]

    def question(self, settings: Settings) -> Question:
        """Return what ``certify`` is asked for settings; initial states are drawn from their seed.

        Raises
        ------
        ParameterError
            The settings are refused.
        """
        refuse_unknown("graph", settings.graph, self.graphs)
        graph, protocol = self.graphs[settings.graph], settings.protocol()
        x0, random = np.random.default_rng(settings.seed).integers(-9, 10, size=(2, graph.n_nodes)).tolist()
        source = self._sources.get(settings.graph)
        sigma0, disturbance = None, None
        if (sliding := protocol.reaching) is not None:
            sigma0 = random if settings.reaching else [0] * graph.n_nodes
            until = 2 * float(protocol.T)
            disturbance = as_disturbance(settings.disturbance_text, graph.n_nodes, sliding.delta, until, settings.seed)
        return Question(settings, source, graph, protocol, x0, sigma0, disturbance)

    def _view(self, settings: Settings, certificate: Callable[[Question], Certificate], *, checked: bool) -> View:
        try:
            question = self.question(settings)
            return View(settings, "", question, certificate(question), checked)
        except PTCCError as error:
            return View(settings, str(error))
        except OverflowError:
            return View(settings, "a number is beyond the range of float64; choose other settings")

    def _certificate(self, question: Question, progress: Callable[[str], None]) -> Certificate:
        settings = question.settings
        initial = InitialState(question.x0, sigma0=question.sigma0)
        asks = Asks(method=settings.method, disturbance=question.disturbance)
        certificate: Any = certify_case(Case(question.graph, question.protocol, initial, asks=asks), progress=progress)
        self._latest[settings.graph, settings.method] = certificate
        return certificate

    def _preview(self, question: Question) -> Certificate:
        """Return a certificate of Lyapunov functions found before: the latest of the class, or else the paper's."""
        settings, graph, protocol = question.settings, question.graph, question.protocol
        refuse_before_the_graph(Case(graph, protocol))
        refuse_long_weights(graph)
        base = self._latest.get((settings.graph, settings.method)) or self._latest.get((settings.graph, "paper"))
        if base is None:
            base = certify(graph, Settings().protocol(), asks=Asks(simulation=False, method="paper"))
            self._latest[settings.graph, "paper"] = base
        run = None
        with suppress(SimulationError):  # the panels tell that there is none
            run = simulate(graph, protocol, question.x0, samples=_SAMPLES, **question.sliding)
        x0 = [Fraction(x) for x in question.x0]
        sigma0 = None if question.sigma0 is None else [Fraction(s) for s in question.sigma0]
        sliding = protocol.reaching
        reaching = None if sliding is None or sigma0 is None else certified_reaching_times(sliding, sigma0)
        first = x0 if sigma0 is None else [x - s for x, s in zip(x0, sigma0, strict=True)]
        return base.changed(
            protocol=protocol,
            initial_state=tuple(x0),
            sigma0=None if sigma0 is None else tuple(sigma0),
            reaching=reaching,
            final_state=final_state(base.graph_proof.structure, first, matrix=base.graph_proof.influence),
            trajectory=run,
            notes=(),
        )
