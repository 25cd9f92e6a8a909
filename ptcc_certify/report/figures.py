"""Figures of a report: which there are, and how they stand in a page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ptcc_certify.certificate.saved import SavedCertificate
from ptcc_certify.graphs.limits import DRAWN_NODES, INPUT_NODES
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.plots.trajectory import plot_sliding
from ptcc_certify.simulation.trajectory import SlidingTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(saved: SavedCertificate, wanted: Sequence[str]) -> dict[str, Figure]:
    """Draw those of the wanted figures for which there is something to draw."""
    run, n = saved.trajectory, saved.graph.n_nodes
    figures: dict[str, Any] = {}
    if "graph" in wanted and n <= DRAWN_NODES:
        figures["graph"] = plot_graph(saved.structure).figure
    if run is None:
        return figures
    if "decay" in wanted and saved.comparison is not None and saved.envelope.members and run.error.any():
        figures["decay"] = plot_decay(saved).figure
    if "sliding" in wanted and isinstance(run, SlidingTrajectory) and not saved.direct and n <= INPUT_NODES:
        figures["sliding"] = plot_sliding(run, saved.reaching).figure
    if "input" in wanted and n <= INPUT_NODES and (not saved.constant or isinstance(run, SlidingTrajectory)):
        figures["input"] = plot_input(run, saved.structure, saved).figure  # type: ignore[arg-type]
    return figures


def inline_figure(figure: Figure, name: str, caption: str) -> str:
    """Return a figure as inline SVG, which a caption of HTML describes in words and numbers."""
    image = figure_bytes(figure, ".svg").decode()
    image = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", image, flags=re.DOTALL)
    # the figures of a page share its names, so each puts its own before them
    image = re.sub(r"\bid=\"", f'id="{name}-', image.replace("xlink:href=", "href="))
    image = re.sub(r"(href=\"#|url\(#)", rf"\g<1>{name}-", image)
    image = re.sub(r' d="[^"]*"', lambda d: re.sub(r"(\.\d{3})\d+", r"\1", d[0]), image)  # a smaller page
    frame = re.search(r'<svg[^>]*viewBox="([-0-9. ]+)"[^>]*>', image)
    assert frame is not None
    said = re.sub(r"<[^>]*>", "", caption)  # what is left is escaped already, quotes too
    head = f'<svg viewBox="{frame[1]}" role="img" aria-label="{said}">'
    return f'<figure id="figure-{name}">{head}{image[frame.end() :].strip()}<figcaption>{caption}</figcaption></figure>'
