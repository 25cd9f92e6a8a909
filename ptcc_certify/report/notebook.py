"""What a notebook shows of a graph, a structure, a certificate, a trajectory and a design: a table and a figure.

Registered with :mod:`ptcc_certify.graphs.display_hook`, which calls them for ``_repr_html_``; elsewhere the plain
``repr`` is shown. Labels are escaped, figures are inline SVG images with a text in their place for those who
do not see them.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.gain_design import Design
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.display_hook import shows
from ptcc_certify.graphs.size_limits import SHOWN_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.plots.trade_off import plot_trade_off
from ptcc_certify.report.plots.trajectory import plot_run
from ptcc_certify.report.screen import certificate_lines, structure_lines
from ptcc_certify.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure, FigureBase


# Where the text of a line of a screen begins, after its head.
_HEAD = 11


@shows(SignedDigraph)
def graph_html(graph: SignedDigraph) -> str:
    """Show a graph: its size, how it was read, its nodes, and a drawing of up to 120 of them."""
    lines = structure_lines(analyse(graph), "signed digraph")
    return _page([line for line in lines if line.startswith(("graph", "read", "nodes"))], _graph_figure(graph))


@shows(Structure)
def structure_html(structure: Structure) -> str:
    """Show a structure: the screen of ``ptcc classify``, and a drawing of up to 120 nodes."""
    return _page(structure_lines(structure, "signed digraph"), _graph_figure(structure.graph, structure))


@shows(Certificate)
def certificate_html(certificate: Certificate) -> str:
    """Show a certificate: the screen of ``ptcc certify``, and the simulated decay under its proved bound."""

    def draw() -> FigureBase:
        return plot_decay(certificate).figure

    run = certificate.trajectory
    moves = run is not None and certificate.comparison is not None and bool(run.error.any())
    drawable = moves and bool(certificate.envelope.functions)
    alt = "simulated decay of the error under its proved bound, over the time left to the deadline"
    return _page(certificate_lines(certificate, "signed digraph"), [(draw, alt)] if drawable else [])


@shows(Trajectory)
def trajectory_html(trajectory: Trajectory) -> str:
    """Show a trajectory: what its ``repr`` says, and states (and sliding variables) over time."""
    structure = analyse(trajectory.graph)

    def draw() -> Figure:
        return plot_run(trajectory, structure)

    drawable = trajectory.states.ndim == 2 and trajectory.t.size > 1 and len(trajectory.labels) <= SHOWN_NODES
    also = " and sliding variables" if trajectory.sliding else ""
    return _page([f"{'trajectory':<{_HEAD}}{trajectory!r}"], [(draw, f"states{also} over time")] if drawable else [])


@shows(Design)
def design_html(found: Design) -> str:
    """Show a design: the screen of ``ptcc design``, and its peak input against the deadline."""

    def draw() -> FigureBase:
        return plot_trade_off(found).figure

    return _page(found.lines(), [(draw, "certified peak input against the deadline, and what no gains can stay below")])


def _base64(figure: FigureBase) -> str:
    return base64.b64encode(figure_bytes(figure, ".svg")).decode()


_Drawing = tuple[Callable[[], "FigureBase"], str]


def _graph_figure(graph: SignedDigraph, structure: Structure | None = None) -> list[_Drawing]:
    if graph.n_nodes > SHOWN_NODES:
        return []
    known = analyse(graph) if structure is None else structure
    alt = f"drawing of the graph: {graph.n_nodes} nodes, {known.leaders.size} of them leaders, {graph.n_edges} edges"
    return [(lambda: plot_graph(known).figure, alt)]


def _page(lines: Iterable[str], figures: Sequence[_Drawing]) -> str:
    """Return lines, each with a head of ten characters, as a table beside figures."""
    rows = "".join(
        f'<tr><th scope="row" style="text-align:left;vertical-align:top">{html.escape(line[:_HEAD].strip())}</th>'
        f'<td style="text-align:left">{html.escape(line[_HEAD:].strip())}</td></tr>'
        for line in lines
    )
    images = "".join(
        f'<img alt="{html.escape(alt)}" style="max-width:100%;background:white" '
        f'src="data:image/svg+xml;base64,{_base64(draw())}">'
        for draw, alt in figures
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<table style="max-width:60em">{rows}</table>{images}</div>'
    )
