"""Figures of a report: which there are, and how they stand in a page."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from ptcc_certify.bounds.late_messages import LateBounds
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import DRAWN_NODES, EXACT_NODES, INPUT_NODES
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.report.plots.agents_motion import plot_formation, plot_motion
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.plots.spectrum import plot_spectrum
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.plots.tracking import plot_tracking
from ptcc_certify.report.plots.trajectory import plot_sliding, plot_trajectory
from ptcc_certify.simulation.late_messages import can_run

#: What draws each figure of a certificate, on given axes or its own; all but the graph show its simulated run.
PLOTS: dict[str, Callable[..., Any]] = {
    "decay": plot_decay,
    "input": plot_input,
    "graph": plot_graph,
    "states": plot_trajectory,
    "sliding": plot_sliding,
    "late": plot_tracking,
    "tracking": plot_tracking,
    "spectrum": plot_spectrum,
    "motion": plot_motion,
    "formation": plot_formation,
}


def plot(subject: Any, what: str, **keywords: Any) -> Any:
    """Draw a figure of an object.

    Raises
    ------
    ParameterError
        No figure is called so.

    Examples
    --------
    >>> from ptcc_certify.report.figures import plot
    >>> plot(None, "picture")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: what = 'picture' is unknown; one of decay, input, graph, states, ...
    """
    if what not in PLOTS:
        raise ParameterError(f"what = {what!r} is unknown; one of {', '.join(PLOTS)}")
    if what == "spectrum" and isinstance(subject, Family | FamilyCertificate):
        why = "eigenvalues of single graphs do not tell what switching among them does"
        raise ParameterError(f"{why}; draw those of one graph, or the decay of the family")
    return gated(PLOTS[what])(subject, **keywords)


def draw(saved: Certificate, wanted: Sequence[str]) -> dict[str, Any]:
    """Draw those of the wanted figures for which there is something to draw."""
    run, n = saved.trajectory, saved.graph.n_nodes
    there = {"graph": n <= DRAWN_NODES}
    if saved.initial_state is not None and n <= EXACT_NODES:
        there["late"] = saved.late is not None and _late_is_drawn(saved.late, saved.protocol)
        there["tracking"] = saved.tracking is not None
    if run is not None:
        slid = run.sliding is not None
        there["states"] = n <= INPUT_NODES and not saved.constant
        there["decay"] = saved.comparison is not None and bool(saved.envelope.functions) and bool(run.error.any())
        there["sliding"] = slid and not saved.direct and n <= INPUT_NODES
        there["input"] = n <= INPUT_NODES and (slid or not saved.constant)
    drawn = [name for name in wanted if there.get(name)]
    axes = (PLOTS[name](saved) for name in drawn)
    return {name: ax.figure for name, ax in zip(drawn, axes, strict=True)}


def _late_is_drawn(late: LateBounds, protocol: Protocol) -> bool:
    """Tell whether there are runs with late messages under something that was proved."""
    return late.says_something and can_run(protocol, late.messages)


def inline_figure(figure: Figure, name: str, caption: Markup) -> Markup:
    """Return a figure as inline SVG, which a caption of HTML describes in words and numbers."""
    image = figure_bytes(figure, ".svg").decode()
    image = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", image, flags=re.DOTALL)
    # the figures of a page share its names, so each puts its own before them
    image = re.sub(r"\bid=\"", f'id="{name}-', image.replace("xlink:href=", "href="))
    image = re.sub(r"(href=\"#|url\(#)", rf"\g<1>{name}-", image)
    image = re.sub(r' d="[^"]*"', lambda d: re.sub(r"(\.\d{3})\d+", r"\1", d[0]), image)  # a smaller page
    frame = re.search(r'<svg[^>]*viewBox="([-0-9. ]+)"[^>]*>', image)
    assert frame is not None
    return Markup(
        '<figure id="figure-{}"><svg viewBox="{}" role="img" aria-label="{}">{}<figcaption>{}</figcaption></figure>'
    ).format(name, frame[1], caption.striptags(), Markup(image[frame.end() :].strip()), caption)
