"""A certificate in motion: agents on their way to the deadline, in the tubes where they are proved to be."""

from __future__ import annotations

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib import animation, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lmi.exact.decimal_rounding import near
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.report.plots.final_colours import colours_of
from ptcc_certify.report.plots.glance import plot_glance
from ptcc_certify.report.plots.graph import node_id
from ptcc_certify.report.plots.subject import read_back, trajectory_of
from ptcc_certify.report.plots.trajectory import agents_run
from ptcc_certify.simulation.trajectory import Trajectory

#: What is written, by what.
WRITERS = {".gif": "pillow", ".mp4": "ffmpeg", ".html": "html"}
#: Pictures a second, pixels an inch; the longest that is made, in seconds.
_RATE, _DOTS, LONGEST = 15, 110, 60
#: Seconds for which the last picture stays.
_STAYS = 1.0


def animate(subject: Any, path: str | Path, *, seconds: float = 5, time_unit: str = "") -> None:
    """Write a film of a certificate at a glance: agents run in their tubes, nodes have the colours of their states.

    Of vehicles in the plane the formation moves, with trails.

    Parameters
    ----------
    subject : Certificate, or its path
        Of one graph of at most 40 agents, with an initial state.
    path : str or Path
        ``.gif``, ``.html`` (one page with buttons), or ``.mp4`` where ffmpeg is installed. It appears whole or not at
        all.
    seconds : float
        How long the way to the deadline takes, at most 60.
    time_unit : str
        Of the deadline, for the label of the axis.

    Raises
    ------
    ParameterError
        The certificate is of a family, has no initial state or too many agents; or there is no such kind of film.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5])
    >>> with TemporaryDirectory() as folder:
    ...     cert.animate(Path(folder, "run.gif"), seconds=0.2)
    ...     Path(folder, "run.gif").read_bytes()[:6]
    b'GIF89a'
    """
    refuse_no_path(path)
    certificate, kind = read_back(subject), Path(path).suffix.lower()
    if kind not in WRITERS:
        raise ParameterError(f"{path}: films are written to {', '.join(WRITERS)}; choose one of these")
    if kind == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise ParameterError(f"{path}: .mp4 needs the program ffmpeg, which is not installed; write a .gif or .html")
    if not 0 < seconds <= LONGEST:
        raise ParameterError("seconds", f"= {seconds:g} is not within 0 and {LONGEST}")
    run = _run_of(certificate)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")  # letters of scripts that the font does not have
        figure = plot_glance(certificate, runs=None if isinstance(run, Trajectory) else [run], time_unit=time_unit)
        film = _film(_Scene(figure, run), kind, seconds)
    write_atomically(path, film)


def _run_of(certificate: Any) -> Any:
    """Return the run that is shown, or refuse what has none."""
    if not isinstance(certificate, Certificate):
        raise ParameterError("a film is of a certificate; give certify(graph, protocol, x0)")
    if certificate.of_family:
        what = "a film is of weights that are known and stay; this certificate is of intervals or modes"
        raise ParameterError(f"{what}; certify without these, or draw a figure")
    if certificate.graph_proof.graph.n_nodes > LABELLED_NODES:
        raise ParameterError(f"a film shows at most {LABELLED_NODES} agents; draw a figure of these")
    part = certificate.proof.agents
    if part is None and (certificate.initial_state is None or certificate.only_drawn):
        raise ParameterError("the certificate holds no initial state to run from; certify with x0")
    if part is None and certificate.proof.late is not None and certificate.asked_trajectory is None:
        raise ParameterError(
            "no run is made of what was asked: delays are too short for one; draw a figure of the bound"
        )
    return trajectory_of(certificate) if part is None else agents_run(certificate)


class _Scene:
    """What moves in a figure at a glance: nodes that change their colours, and the run up to an instant."""

    def __init__(self, figure: Figure, run: Any):
        self.run, self.T = run, float(run.protocol.gain.T)
        graph, ax = figure.axes
        self.in_plane = not isinstance(run, Trajectory) and run.states.shape[1] == 2
        positions = run.positions if isinstance(run, Trajectory) else run.states[:, :, 0]
        values = positions if positions.ndim == 2 else positions[:, 0]
        self.ways = list(positions) if self.in_plane else [np.array([run.t, own]) for own in values]
        self.scale = float(np.abs(values).max()) or 1.0
        self.nodes, self.lines = ({one.get_gid(): one for one in of.lines if one.get_gid()} for of in (graph, ax))
        for name in [name for name in self.lines if str(name).startswith("end")]:
            self.lines.pop(name).set_visible(False)  # where agents come to be is not shown before they do
        mark: dict[str, Any] = {"markersize": 4.5, "zorder": 6}
        self.dots = {name: ax.plot([], [], "o", color=one.get_color(), **mark)[0] for name, one in self.lines.items()}
        below: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "right", "va": "top"}
        self.time = ax.annotate("", (1, 0), (0, -18), fontsize=9, annotation_clip=False, **below)
        moving = [*self.nodes.values(), *graph.texts, *self.lines.values(), *self.dots.values(), self.time]
        self.moving = sorted(moving, key=lambda artist: artist.get_zorder())
        for artist in moving:
            artist.set_animated(True)
        figure.set_dpi(_DOTS)
        self.canvas = FigureCanvasAgg(figure)
        self.canvas.draw()
        self.still = self.canvas.copy_from_bbox(figure.bbox)

    def picture(self, t: float) -> np.ndarray:
        """Return the picture of the instant ``t``, (height, width, 4)."""
        shown = self.run.t <= t
        for k, way in enumerate(self.ways):
            name, node, now = node_id(k, "run"), node_id(k), np.array([np.interp(t, self.run.t, own) for own in way])
            self.lines[name].set_data(*np.column_stack([way[:, shown], now]))
            self.dots[name].set_data(*now[:, None])
            if node in self.nodes and not self.in_plane:
                self.nodes[node].set_color(colours_of(now[1:], self.scale)[0])
        self.time.set_text(f"$t$ = {min(t, self.T):.3g} of {near(self.run.protocol.gain.T)}")
        self.canvas.restore_region(self.still)
        for artist in self.moving:
            artist.axes.draw_artist(artist)  # type: ignore[union-attr]
        return np.array(self.canvas.buffer_rgba())


def _film(scene: _Scene, kind: str, seconds: float) -> bytes:
    """Return the film of a scene, in the format of a suffix."""
    instants = np.linspace(0, 1.04 * scene.T, max(2, round(seconds * _RATE)))
    pictures = [scene.picture(t) for t in instants]
    pictures += [pictures[-1]] * round(_STAYS * _RATE)
    high, wide = pictures[0].shape[:2]
    screen = Figure((wide / _DOTS, high / _DOTS), dpi=_DOTS)
    shown = screen.figimage(pictures[0])
    FigureCanvasAgg(screen)

    def show(number: int) -> list[Any]:
        shown.set_data(pictures[number])
        return [shown]

    film = animation.FuncAnimation(screen, show, len(pictures), interval=1000 / _RATE, init_func=lambda: [shown])
    with (
        rc_context({"animation.embed_limit": 100, "animation.frame_format": "jpeg", "savefig.dpi": _DOTS}),
        TemporaryDirectory() as folder,
    ):
        if kind == ".html":
            return film.to_jshtml(fps=_RATE, default_mode="once").encode()
        file = Path(folder, f"film{kind}")
        film.save(file, writer=WRITERS[kind], fps=_RATE, dpi=_DOTS)
        return file.read_bytes()
