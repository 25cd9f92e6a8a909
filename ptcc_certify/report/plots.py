"""Figures: Axes in, Axes out, and how they are saved.

Without ``ax`` a figure of one column is made in the style of ``ptcc.mplstyle``; for figures of your own
``plt.style.use("ptcc_certify.ptcc")``, with ``figsize=ptcc.SINGLE_COLUMN`` or ``ptcc.DOUBLE_COLUMN``.
"""

from __future__ import annotations

import functools
import io
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.rounding import float_up
from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.simulation.trajectory import SlidingTrajectory, Trajectory
from ptcc_certify.theorems.lemmas import laplacian_spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

    from ptcc_certify.bounds.input import Effort
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.gain_design import Design
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols.nominal import Protocol
    from ptcc_certify.protocols.reaching_time import ReachingTime

#: Matplotlib's name of the style of all figures.
STYLE = "ptcc_certify.ptcc"
#: Width and height in inches of figures as wide as a column, or two, of a journal.
SINGLE_COLUMN, DOUBLE_COLUMN = (3.5, 2.7), (7.16, 2.9)
#: What figures are saved as; PDF and SVG are vectors.
FIGURES = (".png", ".pdf", ".svg")
#: Colour-blind safe (Okabe and Ito): first camp, second camp, unbalanced leaders, followers.
CAMP_COLOURS = {
    "first camp": "#0072B2",
    "second camp": "#D55E00",
    "unbalanced leaders": "#CC79A7",
    "followers": "#7F7F7F",
}
#: Colour and line of an edge from an ally (+1) or an opponent (-1).
EDGE_STYLES = {1: ("#4477AA", "-", "ally"), -1: ("#AA3344", "--", "opponent")}
#: Colour and marker of the classes of certificates.
CLASS_MARKERS = {
    "paper": ("#000000", "s"),
    "perron": ("#009E73", "^"),
    "lmi": ("#0072B2", "o"),
    "full": ("#D55E00", "D"),
}
#: Largest graph that is drawn, whose nodes are labelled, and whose layout is that of Kamada and Kawai.
DRAWN_NODES, LABELLED_NODES, KAMADA_NODES = 300, 40, 60
#: Horizontal axes of the decay, and their labels.
_DECAY_AXES = {"left": "time left, $1 - t/T$", "time": "time, $t/T$", "clock": "stretched clock $s(t)$"}
#: Colour and width, in points, of what marks the closed components of a graph.
HALO = ("#DDDDDD", 22)
#: An error ``|e_k|`` below so many tolerances of the integrator, in units of what it is made of, is not resolved.
RESOLVED_ERROR = 10
#: Decades of the input that are drawn below its size at the start; changes of sign go further down.
INPUT_DECADES = 3


def _styled(plot: Callable[..., Any]) -> Callable[..., Any]:
    """Draw in the style of :data:`STYLE`, unless the axes are given: these have a style of their own."""

    @functools.wraps(plot)
    def drawn(*args: Any, **options: Any) -> Any:
        from matplotlib import style
        from matplotlib.axes import Axes

        if any(isinstance(value, Axes) for value in (*args, *options.values())):
            return plot(*args, **options)
        with style.context(STYLE):
            return plot(*args, **options)

    return drawn


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file; it appears whole or not at all, and equal figures make equal files.

    Parameters
    ----------
    figure : Figure
    path : path
        ``.png`` (200 dots per inch), ``.pdf`` or ``.svg``.

    Raises
    ------
    ParameterError
        Another suffix.

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, analyse
    >>> ax = plot_graph(analyse(SignedDigraph.from_edges([(1, 2, -1)])))
    >>> save_figure(ax.figure, "graph.jpg")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: graph.jpg: figures are written to .png, .pdf, .svg; choose one of these
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FIGURES:
        raise ParameterError(f"{path}: figures are written to {', '.join(FIGURES)}; choose one of these")
    write_atomically(path, figure_bytes(figure, suffix))


def figure_bytes(figure: FigureBase, suffix: str) -> bytes:
    """Return a figure as one of :data:`FIGURES`, the same bytes for the same figure.

    Letters of scripts that the font does not have become boxes, without a word about each.
    """
    from matplotlib import style

    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    buffer = io.BytesIO()
    with style.context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        figure.savefig(buffer, format=suffix[1:], metadata=undated)  # type: ignore[attr-defined]
    return buffer.getvalue()


@_styled
def plot_trajectory(trajectory: Trajectory, structure: Structure, ax: Axes | None = None) -> Axes:
    """Draw ``x_k(t)`` with camps coloured, leaders thick, followers thin, and the deadline as a vertical line.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    structure : Structure
        Of the same graph.
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, analyse, simulate
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [line.get_label() for line in plot_trajectory(run, analyse(pair)).lines]
    ['first camp', 'second camp', 'deadline']
    """
    ax = _axes(ax)
    _draw_agents(trajectory, trajectory.states, structure, ax)
    ax.set_xlabel("time $t$")
    ax.set_ylabel("state $x_k$")
    _legend_above(ax)
    return ax


@_styled
def plot_run(
    trajectory: Trajectory,
    structure: Structure,
    reaching: Sequence[ReachingTime] | None = None,
    *,
    wide: bool = False,
) -> Figure:
    """Draw the states; under the sliding-mode protocol with a reaching phase the sliding variables below them.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    structure : Structure
        Of the same graph.
    reaching : sequence of N ReachingTime, optional
        Proved reaching times.
    wide : bool
        As wide as two columns of a journal, instead of one.

    Returns
    -------
    Figure

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, SlidingModeProtocol, analyse, simulate
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> len(plot_run(simulate(pair, p, [3, 5], sigma0=[1, 0]), analyse(pair)).axes)
    2
    """
    from matplotlib.figure import Figure

    width, height = DOUBLE_COLUMN if wide else SINGLE_COLUMN
    if not isinstance(trajectory, SlidingTrajectory) or not trajectory.sigma0.any():
        return plot_trajectory(trajectory, structure, _axes(None, (width, height))).figure  # type: ignore[return-value]
    figure = Figure((width, 2 * height), layout="constrained")
    upper, lower = (new_axes(figure, (2, 1, row)) for row in (1, 2))
    plot_trajectory(trajectory, structure, upper)
    plot_sliding(trajectory, reaching, lower)
    return figure


@_styled
def plot_sliding(
    trajectory: SlidingTrajectory, reaching: Sequence[ReachingTime] | None = None, ax: Axes | None = None
) -> Axes:
    r"""Draw ``sigma_k(t)`` up to a little beyond ``T_r``, dots where each reaches 0, ticks where that is proved.

    Parameters
    ----------
    trajectory : SlidingTrajectory
    reaching : sequence of N ReachingTime, optional
        Proved reaching times (``certificate.reaching``).
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, SlidingModeProtocol, certified_reaching_times, simulate
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(pair, p, [3, 5], sigma0=[1, -4])
    >>> ax = plot_sliding(run, certified_reaching_times(p, [1, -4]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['$\\sigma_k$ reaches 0', 'proved at the latest', '$T_r$']
    """
    ax, T_r = _axes(ax), float(trajectory.protocol.T_r)
    shown = trajectory.t <= 1.1 * T_r
    for row in trajectory.sigma:
        ax.plot(trajectory.t[shown], row[shown], color="#0072B2", linewidth=0.9)
    reached = trajectory.reaching_times[trajectory.sigma0 != 0]
    if np.isfinite(reached).any():
        ax.plot(reached, np.zeros(reached.size), "o", color="#0072B2", markersize=3, label="$\\sigma_k$ reaches 0")
    if reaching is not None:
        proved = [r.time for r in reaching if r.z is None or r.z > 0]
        ax.plot(proved, [0.0] * len(proved), "|", color="#D55E00", markersize=12, label="proved at the latest")
    ax.axvline(T_r, color="black", linewidth=0.8, linestyle=":", label="$T_r$")
    ax.set_xlabel("time $t$")
    ax.set_ylabel("sliding variable $\\sigma_k$")
    _legend_above(ax)
    return ax


@_styled
def plot_decay(certificate: Certificate, ax: Axes | None = None, *, axis: str = "left") -> Axes:
    """Draw ``||E(t)|| / ||E(0)||`` of the simulated run under its proved bounds; the vertical axis is logarithmic.

    Thick: the bound, the best of all proved Lyapunov functions at every instant. Thin: each of them. Dashed: the
    paper's. Dotted: the integrator's floor, below which the run says nothing. If only Theorem 1.1's own coordinates
    were proved, ``||eps(t)||`` instead.

    Parameters
    ----------
    certificate : Certificate or SavedCertificate
        With a trajectory and a proved rate.
    ax : Axes, optional
    axis : {"left", "time", "clock"}
        Horizontally the time left ``1 - t/T``, logarithmic, running towards the deadline; or ``t/T``; or the stretched
        clock ``s(t)``, on which each bound is a straight line where nothing but a rate is at work.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        There is nothing to draw, or an unknown axis.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> [plot_decay(cert, axis=name).get_xlabel() for name in ("left", "time", "clock")]
    ['time left, $1 - t/T$', 'time, $t/T$', 'stretched clock $s(t)$']
    """
    if axis not in _DECAY_AXES:
        raise ValueError(f'axis "{axis}" is unknown; one of {", ".join(_DECAY_AXES)}')
    run, envelope, start = certificate.trajectory, certificate.envelope, certificate.start
    if run is None or start is None or certificate.comparison is None or not envelope.members:
        raise ValueError("the certificate holds no simulated run with a proved bound")
    ax, before, unit = _axes(ax), run.remaining > 0, _unit(run)
    remaining, states = run.remaining[before], run.states[:, before] / unit
    place = {"left": remaining, "time": 1 - remaining, "clock": run.clock[before]}[axis]
    shown = [m for m in envelope.members if m.coordinates == envelope.coordinates]
    norm = np.linalg.norm(shown[0].coordinates_of(states, certificate.graph.laplacian()), axis=0)
    bound = envelope.norm_bound(remaining, start) / unit
    scale = float(norm[0]) or float(bound[0])
    if scale == 0:
        raise ValueError("the agents begin where they end: nothing decays")
    for number, member in enumerate(shown if len(shown) > 1 else ()):
        alone = replace(envelope, members=(member,)).norm_bound(remaining, start) / unit / scale
        if member.kind == "paper":
            ax.plot(place, alone, color="black", linewidth=0.9, linestyle="--", label="the paper's")
        else:
            label = "each Lyapunov function" if all(m.kind == "paper" for m in shown[:number]) else None
            ax.plot(place, alone, color="#D55E00", linewidth=0.7, alpha=0.55, label=label)
    ax.plot(place, bound / scale, color="#D55E00", linewidth=1.6, label="proved bound")
    if norm[0] > 0:
        ax.plot(place, np.maximum(norm / scale, 1e-300), color="#0072B2", label="simulated (CVODES)")
        floor = FLOOR_FACTOR * run.rtol * float(np.abs(states).max()) * _row_sum(certificate)
        ax.axhline(floor / scale, color="#7F7F7F", linewidth=0.9, linestyle=":", label="integrator's floor")
        least = min(float((norm / scale).min()), floor / scale)
        ax.set_ylim(max(least, 1e-18) / 3, 3 * max(float((norm / scale).max()), float((bound / scale).max())))
    ax.set_yscale("log")
    if axis == "left":
        ax.set_xscale("log", subs=[])  # ticks at decades only
        ax.invert_xaxis()
    ax.set_xlabel(_DECAY_AXES[axis])
    name = "E" if envelope.coordinates == "E" else r"\varepsilon"
    ax.set_ylabel(rf"$\|{name}(t)\| \,/\, \|{name}(0)\|$")
    _legend_above(ax)
    return ax


@_styled
def plot_trade_off(found: Design, ax: Axes | None = None) -> Axes:
    """Draw the peak input that is certified against the deadline, and below which no gains can stay.

    Both axes are logarithmic. The limit that was asked for is a horizontal line.

    Parameters
    ----------
    found : Design
    ax : Axes, optional

    Returns
    -------
    Axes

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, design
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> ax = plot_trade_off(design(pair, max_input=10, initial_bound=1))
    >>> [line.get_label() for line in ax.lines]
    ['certified with these gains', 'no gains stay below', 'asked for', 'this design']
    """
    ax, curve = _axes(ax), found.trade_off(found.deadlines())
    if np.isfinite(curve.certified).any():
        ax.loglog(curve.deadlines, curve.certified, color="#0072B2", label="certified with these gains")
    if np.isfinite(curve.lower).any():
        ax.fill_between(curve.deadlines, curve.lower * 1e-3, curve.lower, color="#7F7F7F", alpha=0.3, linewidth=0)
        ax.loglog(curve.deadlines, curve.lower, color="#7F7F7F", linestyle="--", label="no gains stay below")
        ax.set_ylim(bottom=float(np.nanmin(curve.lower)) / 3)
    ax.axhline(float(found.max_input), color="#D55E00", linewidth=0.9, linestyle=":", label="asked for")
    if found.protocol is not None and found.peak:
        ax.plot([float(found.protocol.T)], [float(found.peak)], "o", color="#0072B2", label="this design")
    ax.set_xlabel("deadline $T$")
    ax.set_ylabel(r"peak input $\|u\|_2$" if found.input_norm == 2 else "peak input, largest $|u_k|$")
    _legend_above(ax)
    return ax


@_styled
def plot_input(
    trajectory: Trajectory, structure: Structure, certificate: Certificate | None = None, ax: Axes | None = None
) -> Axes:
    """Draw ``|u_k(t)|`` with camps coloured, and the peak that a certificate of the same start proves.

    The axis of the input is logarithmic, from three decades below its size at the start. Behind an actuator it is the
    input that acts. Nothing is drawn where the integrator no longer resolves what the gain multiplies. No peak is drawn
    where none holds: for runs that begin later than 0, sampled inputs, disturbance or noise of the nominal protocol,
    boundary layers. Under caps and stops that ``certificate`` judges, theirs is drawn.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    structure : Structure
        Of the same graph.
    certificate : Certificate, optional
        Of the same graph, protocol and start. One of a set of starts adds nothing.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The trajectory holds several starts, or the certificate is of another graph, protocol or start.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, analyse, simulate
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> run = simulate(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_input(run, analyse(pair))
    >>> len(ax.lines), ax.get_ylabel()
    (3, 'input $|u_k|$')
    """
    _need_one_start(trajectory)
    peak = None if certificate is None else _certified_peak(trajectory, certificate)
    ax, u = _axes(ax), _resolved_input(trajectory)
    size = np.where(np.isnan(u), 0.0, np.abs(u))
    top = max(float(size.max(initial=0)), peak or 0.0)
    if top > 0:
        ax.set_yscale("log", nonpositive="clip")
        first = float(size[:, 0].max(initial=0)) if u.shape[1] else 0.0
        ax.set_ylim((first or top) * 10.0**-INPUT_DECADES, top * 2)
    held = trajectory.held_input is not None
    _draw_agents(trajectory, np.abs(u), structure, ax, drawstyle="steps-post" if held else "default")
    if peak is not None:
        ax.axhline(peak, color="black", linewidth=0.9, linestyle="--", label="certified peak")
    ax.set_xlabel("time $t$")
    ax.set_ylabel("input $|u_k|$")
    _legend_above(ax)
    return ax


@_styled
def plot_effort(trajectory: Trajectory, certificate: Certificate | None = None, ax: Axes | None = None) -> Axes:
    """Draw the energy spent so far, ``int_0^t ||u||^2 dt``, and the bound that a certificate of the same start proves.

    The integral is numerical: between the samples ``||u||^2`` is taken for an exponential of ``ln(T/(T - t))``, as it
    is along a single mode. No bound is drawn where none holds: as in :func:`plot_input`, and under the sliding-mode
    protocol, whose switching part no certificate integrates.

    Parameters
    ----------
    trajectory : Trajectory
        Of one start.
    certificate : Certificate, optional
        Of the same graph, protocol and start.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The trajectory holds several starts, its samples do not settle the energy, or the certificate is of another
        graph, protocol or start.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
    >>> ax = plot_effort(cert.trajectory, cert)
    >>> [line.get_label() for line in ax.lines]
    ['simulated (CVODES)', 'certified bound', 'deadline']
    """
    _need_one_start(trajectory)
    proved = None if certificate is None else _certified_effort(trajectory, certificate)
    bound = None
    if proved is not None and proved.energy is not None and trajectory.actuator is None:
        bound = None if isinstance(trajectory, SlidingTrajectory) else float(proved.energy.value)
    ax, spent = _axes(ax), _energy(trajectory)
    ax.plot(trajectory.t, spent, color="#0072B2", label="simulated (CVODES)")
    if bound is not None:
        ax.axhline(bound, color="black", linewidth=0.9, linestyle="--", label="certified bound")
    ax.set_ylim(0, 1.1 * max(bound or 0.0, float(spent.max(initial=0))) or 1)
    _draw_deadlines(trajectory, ax)
    ax.set_xlabel("time $t$")
    ax.set_ylabel(r"energy spent, $\int \|u\|^2\, dt$")
    _legend_above(ax)
    return ax


@_styled
def plot_graph(structure: Structure, ax: Axes | None = None) -> Axes:
    """Draw the signed digraph: arrows in the direction of information, solid from allies, dashed from opponents.

    Nodes have the colours of their camps; leaders are larger and outlined, and a grey ground joins each of
    their groups, the closed strong components. Up to 40 nodes are labelled. The layout is the same in every run.

    Parameters
    ----------
    structure : Structure
        Of up to 300 nodes.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        The graph has more than 300 nodes.

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, analyse
    >>> ax = plot_graph(analyse(SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", -1)])))
    >>> len(ax.patches), [text.get_text() for text in ax.texts]
    (3, ['a', 'b', 'c'])
    """
    from matplotlib.patches import FancyArrowPatch

    graph = structure.graph
    n = graph.n_nodes
    if n > DRAWN_NODES:
        raise ValueError(f"graphs are drawn up to {DRAWN_NODES} nodes; this one has {n}")
    ax, place, group = _axes(ax, (SINGLE_COLUMN[0], 3.4)), _layout(graph), _camp_groups(structure)
    for component in structure.closed_components if structure.followers.size else ():
        _draw_ground(ax, graph, place, component.nodes)
    if structure.followers.size:
        ax.plot([], [], color=HALO[0], linewidth=6, label="leader group")
    leads = group != "followers"
    area = np.where(leads, 1.7, 1.0) * min(max(4000 / n, 14), 130)  # points squared, as scatter takes them
    for name, colour in CAMP_COLOURS.items():
        own = group == name
        if own.any():
            edge, width = (colour, 0.5) if name == "followers" else ("black", 1.1)
            x, y = place[own].T
            ax.scatter(x, y, area[own], colour, edgecolors=edge, linewidths=width, zorder=2)
            ax.plot([], [], "o", color=colour, markeredgecolor=edge, markersize=6, label=name)
    radius, width, head = np.sqrt(area) / 2, 1.1 if n <= LABELLED_NODES else 0.6, 9 if n <= LABELLED_NODES else 5
    for source, target, sign in zip(graph.source.tolist(), graph.target.tolist(), graph.sign.tolist(), strict=True):
        colour, line, _ = EDGE_STYLES[sign]
        ax.add_artist(
            FancyArrowPatch(
                place[source],
                place[target],
                arrowstyle="-|>",
                mutation_scale=head,
                shrinkA=radius[source],
                shrinkB=radius[target],
                connectionstyle="arc3,rad=0.1",  # keeps the two directions apart
                color=colour,
                linestyle=line,
                linewidth=width,
                zorder=1,
            )
        )
    for sign, (colour, line, name) in EDGE_STYLES.items():
        if (graph.sign == sign).any():
            ax.plot([], [], color=colour, linestyle=line, linewidth=width, label=name)
    if n <= LABELLED_NODES:
        inside = max(map(len, graph.labels)) <= 2
        for v, label in enumerate(graph.labels):
            ax.annotate(
                shorten(label, 12),
                place[v],
                (0, 0) if inside else (0, radius[v] + 2),
                textcoords="offset points",
                ha="center",
                va="center_baseline" if inside else "bottom",
                color="white" if inside else "black",
                fontsize=8,
                parse_math=False,
            )
    ax.set_aspect("equal")
    low, high = place.min(axis=0), place.max(axis=0)
    span = max(high - low) or 1.0
    half = 0.62 * np.maximum(high - low, 0.6 * span)  # a path is drawn as a line, in axes that are none
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    ax.set_axis_off()
    _legend_above(ax)
    return ax


@_styled
def plot_spectrum(structure: Structure, protocol: Protocol | None = None, ax: Axes | None = None) -> Axes:
    """Draw the eigenvalues of ``L`` (numerical), and the line from which on the input stays bounded.

    The zeros of balanced closed components are marked apart. From every start the input (its nominal part, under the
    sliding-mode protocol) is bounded up to the deadline if all other eigenvalues lie right of ``1/(rho2 kappa)``; one
    to its left leaves it unbounded. One unit is as long in both directions.

    Parameters
    ----------
    structure : Structure
        Of strong components above 500 nodes only the eigenvalues nearest to 0 are computed.
    protocol : NominalProtocol or SlidingModeProtocol, optional
        Whose line is drawn; there is none with ``rho2 = 0``.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    numpy.linalg.LinAlgError
        The eigenvalues were not found.

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph, analyse
    >>> ax = plot_spectrum(analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 4)])))
    >>> [(line.get_label(), line.get_xdata().round(6).tolist()) for line in ax.lines]
    [('nonzero eigenvalues', [2.0, 4.0]), ('zero eigenvalues', [0.0])]
    """
    ax, spectrum = _axes(ax), laplacian_spectrum(structure)
    if spectrum.nonzero.size:
        values = spectrum.nonzero
        ax.plot(values.real, values.imag, "o", color="#0072B2", markersize=5, alpha=0.7, label="nonzero eigenvalues")
    if spectrum.kernel_dimension:
        many = "" if spectrum.kernel_dimension == 1 else f" ({spectrum.kernel_dimension})"
        ax.plot([0.0], [0.0], "x", color="#7F7F7F", markersize=7, label=f"zero eigenvalues{many}")
    if protocol is not None and protocol.prescribed:
        least = float(1 / (protocol.rho2 * protocol.kappa))
        name = r"$1/(\rho_2 \kappa)$: input bounded to the right"
        ax.axvline(least, color="#D55E00", linewidth=0.9, linestyle="--", label=name)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    ax.set_xlabel("real part of eigenvalue")
    ax.set_ylabel("imaginary part of eigenvalue")
    _legend_above(ax)
    return ax


@_styled
def plot_frontier(certificate: Certificate, ax: Axes | None = None) -> Axes:
    """Draw rate against prefactor of all proved Lyapunov functions by class, and what no rate exceeds.

    A function of rate ``b`` and prefactor ``c`` proves ``||z(t)||^2 <= c e^(-b s) ||z(0)||^2``, ``z`` being ``E``, or
    the ``eps`` of Theorem 1.1 for the paper's own. The axis of the prefactor is logarithmic.

    Parameters
    ----------
    certificate : Certificate
        With a proved Lyapunov function.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        There is nothing to draw.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> ax = plot_frontier(certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)))
    >>> [line.get_label() for line in ax.lines]
    ['paper', 'perron', 'no rate exceeds (proved)', 'spectral rate (numerical)']
    """
    members = certificate.envelope.members
    if not members:
        raise ValueError("the certificate holds no proved Lyapunov function")
    ax = _axes(ax)
    ax.set_xscale("log")
    for kind, (colour, marker) in CLASS_MARKERS.items():
        own = [m for m in members if m.kind == kind]
        if own:
            points = [m.prefactor for m in own], [m.rate for m in own]
            ax.plot(*points, marker, color=colour, markersize=5, alpha=0.8, label=kind)
    rates = [m.rate for m in members]
    if certificate.upper_bound is not None:
        limit = float_up(certificate.upper_bound)
        ax.axhline(limit, color="#7F7F7F", linewidth=2.2, alpha=0.6, label="no rate exceeds (proved)")
        rates.append(limit)
    if certificate.spectral_rate is not None:
        rates.append(certificate.spectral_rate)
        ax.axhline(rates[-1], color="black", linewidth=0.9, linestyle=":", label="spectral rate (numerical)")
    low, high = min(0.0, *rates), max(0.0, *rates)
    ax.set_ylim(low - 0.08 * (high - low) * (low < 0), high + 0.08 * (high - low))
    ax.set_xlabel("prefactor of the squared norm")
    ax.set_ylabel("proved rate")
    _legend_above(ax)
    return ax


def _draw_ground(ax: Axes, graph: SignedDigraph, place: np.ndarray, nodes: Sequence[int]) -> None:
    """Draw a grey ground under the nodes of a strong component and along its edges."""
    inside, (colour, width) = np.zeros(graph.n_nodes, dtype=bool), HALO
    inside[list(nodes)] = True
    own = inside[graph.source] & inside[graph.target]
    lines = [(v, v) for v in nodes] + list(zip(graph.source[own].tolist(), graph.target[own].tolist(), strict=True))
    narrow = width if graph.n_nodes <= LABELLED_NODES else width / 2
    for source, target in lines:
        x, y = place[[source, target]].T
        ax.plot(x, y, color=colour, linewidth=narrow, solid_capstyle="round", zorder=0)


def _row_sum(certificate: Certificate) -> float:
    """Bound ``||dz||`` for an error of 1 in every state."""
    if certificate.envelope.coordinates == "eps":
        return 2 * math.sqrt(certificate.graph.n_nodes)
    return float(np.linalg.norm(abs(certificate.graph.laplacian()).sum(axis=1)))


def _camp_groups(structure: Structure) -> np.ndarray:
    """Return which of ``CAMP_COLOURS`` every node belongs to."""
    group = np.full(structure.graph.n_nodes, "followers", dtype=object)
    for component in structure.closed_components:
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            group[v] = {1: "first camp", -1: "second camp", 0: "unbalanced leaders"}[sign]
    return group


def _draw_agents(
    trajectory: Trajectory, values: np.ndarray, structure: Structure, ax: Axes, drawstyle: str = "default"
) -> None:
    """Draw a line for every agent, leaders first and thick, and the deadlines."""
    group = _camp_groups(structure)
    seen: set[str] = set()
    for node in np.argsort(group == "followers", kind="stable"):
        name = str(group[node])
        ax.plot(
            trajectory.t,
            values[node],
            color=CAMP_COLOURS[name],
            linewidth=0.9 if name == "followers" else 1.6,
            linestyle="--" if name == "followers" else "-",
            drawstyle=drawstyle,
            label=None if name in seen else name,
        )
        seen.add(name)
    _draw_deadlines(trajectory, ax)


def _need_one_start(trajectory: Trajectory) -> None:
    if trajectory.states.ndim != 2:
        raise ValueError(f"the trajectory holds {trajectory.states.shape[1]} starts; draw the input of one")


def _unit(trajectory: Trajectory) -> float:
    """Return the size of the largest state, in which squares neither overflow nor vanish."""
    return float(np.abs(trajectory.states).max(initial=0)) or 1.0


def _resolved_input(trajectory: Trajectory) -> np.ndarray:
    """Return the input, NaN where the infinite gain multiplies what the integrator does not resolve."""
    u = np.array(trajectory.input)
    if trajectory.held_input is not None:
        return u
    weights = abs(trajectory.graph.laplacian())
    floor = RESOLVED_ERROR * trajectory.rtol * np.asarray(weights @ np.abs(trajectory.states))
    lost = np.abs(trajectory.error) < floor
    if isinstance(trajectory, SlidingTrajectory):  # what answers the disturbance is resolved
        u[lost] -= (trajectory.protocol.gain.value_at_remaining(trajectory.remaining) * trajectory.error)[lost]
        lost &= u == 0
    u[lost] = np.nan
    return u


def _energy(trajectory: Trajectory) -> np.ndarray:
    """Return ``int ||u||^2 dt`` up to each instant, (M,).

    Raises
    ------
    ValueError
        With every second sample it would differ by more than a hundredth.
    """
    power = (np.nan_to_num(_resolved_input(trajectory)) ** 2).sum(axis=0)
    if trajectory.held_input is not None:
        return np.concatenate([[0.0], np.cumsum(power[:-1] * np.diff(trajectory.t))])
    T, t, left = float(trajectory.protocol.T), trajectory.t, trajectory.remaining
    full = (trajectory.input**2).sum(axis=0)
    every, some = (_integrated(power[::k], full[::k], t[::k], left[::k], T) for k in (1, 2))
    if t.size > 2 and abs(every[::2][-1] - some[-1]) > every[-1] / 100:
        raise ValueError("these samples do not settle the energy: simulate with more, unless it is infinite")
    return every


def _integrated(power: np.ndarray, full: np.ndarray, t: np.ndarray, left: np.ndarray, T: float) -> np.ndarray:
    """Integrate over time, before ``T`` over ``tau = -ln(left)``: exact for exponentials of ``tau``.

    ``full`` holds besides ``power`` what is not resolved: it tells how fast ``power`` fell to there.
    """
    power = power.copy()
    lost = 1 + np.flatnonzero((power[1:] == 0) & (power[:-1] > 0))
    power[lost] = np.minimum(full[lost], power[lost - 1])
    late = left[1:] <= 0
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = np.where(late, 0.0, np.log(left[:-1] / left[1:]))
    early = _logarithmic_mean(power[:-1] * left[:-1], power[1:] * left[1:]) * T * tau
    pieces = np.where(late, np.minimum(power[:-1], power[1:]) * np.diff(t), early)
    return np.concatenate([[0.0], np.cumsum(pieces)])


def _logarithmic_mean(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ``(a - b) / ln(a/b)``, the mean of the exponential from ``a`` to ``b``; half the sum if one is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(a / b)
        mean = (a - b) / ratio
    return np.where(np.isfinite(ratio) & (np.abs(ratio) > 1e-6), mean, (a + b) / 2)


def _draw_deadlines(trajectory: Trajectory, ax: Axes) -> None:
    if trajectory.protocol.prescribed:
        ax.axvline(float(trajectory.protocol.T), color="black", linewidth=0.8, linestyle=":", label="deadline")
    if isinstance(trajectory, SlidingTrajectory):
        ax.axvline(float(trajectory.protocol.T_r), color="#7F7F7F", linewidth=0.8, linestyle="-.", label="$T_r$")


def _certified_peak(trajectory: Trajectory, certificate: Certificate) -> float | None:
    """Return the proved bound of ``|u_k|`` that holds for a run; None if there is none.

    Raises
    ------
    ValueError
        The certificate is of another graph, protocol or start.
    """
    effort, actuator = _certified_effort(trajectory, certificate), trajectory.actuator
    if effort is None:
        return None
    if actuator is None:
        return None if effort.peak is None else float(effort.peak.largest)
    if actuator.sample_period is not None:
        return None
    for entry in effort.residual:
        same = (entry.limits.gain_cap, entry.limits.stop_before) == (actuator.gain_cap, actuator.stop_before)
        if same and entry.limits.sample_period is None and entry.largest is not None:
            return float(entry.largest)
    # A smaller gain at the same state: what bounds the input of the ideal actuator bounds it too.
    return None if effort.peak is None else float(effort.peak.largest)


def _certified_effort(trajectory: Trajectory, certificate: Certificate) -> Effort | None:
    """Return what is proved about the input of a run; None if that is of other starts, or the run is disturbed.

    Raises
    ------
    ValueError
        The certificate is of another graph, protocol or start.
    """
    for name in ("graph", "protocol"):
        if getattr(certificate, name) != getattr(trajectory, name):
            raise ValueError(f"the certificate is of another {name} than the trajectory")
    starts = [("start", certificate.start, trajectory.states[:, :1])]
    rounding = np.abs(trajectory.states[:, :1])  # runs are integrated in units of the start
    unproved = trajectory.forcing is not None or 0.0 not in trajectory.t[:1]
    if isinstance(trajectory, SlidingTrajectory):
        sigma0 = trajectory.sigma0[:, None]
        starts.append(("sigma(0)", certificate.sigma0, sigma0))
        unproved = unproved or trajectory.boundary_layer is not None
        rounding = rounding + np.abs(sigma0)  # the states are sums of two parts
    for name, proved, run in starts if 0.0 in trajectory.t[:1] else ():
        at = run if proved is None else np.array([[float(x)] for x in proved])
        if (np.abs(at - run) > 4 * np.finfo(float).eps * rounding).any():
            raise ValueError(f"the certificate is of another {name} than the trajectory")
    effort = certificate.effort
    if effort is None or effort.starts is not None or certificate.start is None or unproved:
        return None
    return effort


def _layout(graph: SignedDigraph) -> np.ndarray:
    """Return places of the nodes, (N, 2), the same in every run."""
    import networkx as nx

    plain = nx.Graph(zip(graph.source.tolist(), graph.target.tolist(), strict=True))
    plain.add_nodes_from(range(graph.n_nodes))
    if graph.n_nodes > KAMADA_NODES:
        place = nx.spring_layout(plain, seed=1)
    else:
        hops = dict(nx.all_pairs_shortest_path_length(plain))
        apart = 2 + max(max(row.values()) for row in hops.values())  # between components
        place = nx.kamada_kawai_layout(plain, {u: {v: hops[u].get(v, apart) for v in plain} for u in plain})
    points = np.array([place[v] for v in range(graph.n_nodes)])
    width, height = np.ptp(points, axis=0)
    return points if width >= height else points[:, ::-1]  # lying, as axes are wider than high


def _legend_above(ax: Axes) -> None:
    """Put the legend above the axes, where it covers no data, in as many columns as its width takes."""
    width = ax.get_window_extent().width / ax.figure.dpi
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2 if width < 4 else 3, frameon=False)


def new_axes(figure: FigureBase, place: tuple[int, int, int] = (1, 1, 1)) -> Axes:
    """Add axes to a figure in the style that is in force; ``place`` is rows, columns and number, from 1."""
    from matplotlib import rcParams

    ax = figure.add_subplot(*place)
    style: Any = rcParams  # whose stubs know literal names only
    # Ticks and grid are made when they are drawn, after the style has gone: fix them now.
    for which in ("x", "y"):
        ax.tick_params(axis=which, labelsize=style[f"{which}tick.labelsize"])
        for kind in ("major", "minor"):
            ax.tick_params(axis=which, which=kind, width=style[f"{which}tick.{kind}.width"])
    if style["axes.grid"]:
        ax.grid(True, color=style["grid.color"], linewidth=style["grid.linewidth"])
    return ax


def _axes(ax: Axes | None, size: tuple[float, float] = SINGLE_COLUMN) -> Axes:
    from matplotlib.figure import Figure

    return new_axes(Figure(size, layout="constrained")) if ax is None else ax
