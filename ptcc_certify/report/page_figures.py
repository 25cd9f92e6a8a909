"""Figures of a report: which there are, and how they stand in a page."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.certificate.assessment import REFUTED
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError, SimulationError, gated, labelled
from ptcc_certify.graphs.size_limits import DRAWN_NODES, EXACT_NODES, TRACED_NODES
from ptcc_certify.model.base import Protocol
from ptcc_certify.report.html_text import set_text
from ptcc_certify.report.plots.counterexample import plot_counterexample
from ptcc_certify.report.plots.decay import NothingDecays, plot_decay
from ptcc_certify.report.plots.distributions import plot_degrees, plot_final_states
from ptcc_certify.report.plots.glance import plot_glance
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.input import plot_input
from ptcc_certify.report.plots.spectrum import plot_spectrum
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.plots.subject import is_of_family
from ptcc_certify.report.plots.tracking import plot_tracking
from ptcc_certify.report.plots.trajectory import plot_formation, plot_motion, plot_sliding, plot_trajectory
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.late_messages import can_run
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.family_behaviour import DEPENDS, Counterexample, FamilyComponent, counterexample_text

#: What draws each figure of a certificate, on given axes or its own; all but the graph show its simulated run.
PLOTS: dict[str, Callable[..., Any]] = {
    "glance": plot_glance,
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
    "final": plot_final_states,
    "degrees": lambda saved: plot_degrees(saved.graph),
}
#: What the glance for narrow screens is called.
NARROW = "glance-narrow"
#: Agents of order n up to which a run is drawn.
_RUN = 60
#: What is refuted, the counterexample in words, its component, and itself.
Counterexamples = list[tuple[str, Markup, FamilyComponent, Counterexample]]


def plot(subject: Any, what: str, **keywords: Any) -> Any:
    """Draw a figure of an object.

    Raises
    ------
    ParameterError
        No figure is called so.

    Examples
    --------
    >>> from ptcc_certify.report.page_figures import plot
    >>> plot(None, "picture")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: what = 'picture' is unknown; one of glance, decay, input, graph, ...
    """
    if what not in PLOTS:
        raise ParameterError("what", f"= {what!r} is unknown; one of {', '.join(PLOTS)}")
    if what == "spectrum" and is_of_family(subject):
        why = "eigenvalues of single graphs do not tell what switching among them does"
        raise ParameterError(f"{why}; draw those of one graph, or the decay of the family")
    return gated(PLOTS[what])(subject, **keywords)


def draw(
    saved: Certificate,
    wanted: Sequence[str] | None = None,
    runs: Sequence[Trajectory] = (),
    why: Counterexamples | None = None,
    agents_run: AgentsTrajectory | None = None,
) -> dict[str, Any]:
    """Draw those of the wanted figures for which there is something to draw, and counterexamples ``why``.

    Parameters
    ----------
    saved : Certificate
        With a trajectory, for figures of it.
    wanted : sequence of str, optional
        All there are by default.
    runs : sequence of Trajectory
        Of a family.
    why : list
        See :func:`counterexamples`.
    agents_run : AgentsTrajectory, optional
        Of agents of order n.
    """
    wanted = tuple(PLOTS) if wanted is None else wanted
    if saved.of_family:
        return _draw_family(saved, wanted, runs, why or [])
    run, n = saved.trajectory, saved.graph_proof.graph.n_nodes
    there = {"graph": n <= DRAWN_NODES}
    if saved.proof.agents is None:
        there["final"] = n > DRAWN_NODES and saved.proof.final_state is not None
        there["degrees"] = n > DRAWN_NODES and saved.graph_proof.graph.n_edges > 0
    if saved.initial_state is not None and n <= EXACT_NODES:
        there |= _beside(saved.proof.late, saved.protocol)
    if run is not None:
        slid = run.sliding is not None
        there["states"] = n <= TRACED_NODES and not saved.proof.constant
        there["decay"] = saved.comparison is not None and bool(saved.graph_proof.envelope.functions)
        there["sliding"] = slid and not saved.direct and n <= TRACED_NODES
        there["input"] = n <= TRACED_NODES and (slid or not saved.proof.constant)
    figures = _figures(saved, [name for name in wanted if there.get(name)])
    begins = saved.initial_state if saved.proof.agents is None else saved.proof.agents.initial_state
    made = run is not None or agents_run is not None or begins is None  # no run is drawn that was not asked for
    if "glance" in wanted and n <= DRAWN_NODES and made:
        figures |= _glance(saved, [agents_run] if agents_run else None)
    if agents_run is not None and saved.proof.agents is not None:
        figures["motion"] = plot_motion(agents_run)
        if saved.proof.agents.dimension == 2:
            figures["formation"] = plot_formation(agents_run).figure
    return figures


def _figures(saved: Certificate, names: Sequence[str], runs: Sequence[Trajectory] = ()) -> dict[str, Any]:
    """Draw figures, some of them with runs of a family; a decay only if something decays."""
    figures = {}
    for name in names:
        taken = {"runs": runs} if saved.of_family and name in ("states", "input", "decay") else {}
        with suppress(NothingDecays):
            figures[name] = PLOTS[name](saved, **taken).figure
    return figures


def _glance(saved: Certificate, runs: Sequence[Any] | None) -> dict[str, Any]:
    """Draw a certificate at a glance, for wide screens and narrow ones, unless it or its run is beyond floats."""
    with suppress(ParameterError, SimulationError):
        both = {"glance": False, NARROW: True}
        return {name: plot_glance(saved, words=False, runs=runs, stacked=stacked) for name, stacked in both.items()}
    return {}


def run_of_agents(saved: Certificate) -> AgentsTrajectory | None:
    """Return a run of a few agents of order n; None of others, and where it fails."""
    if saved.proof.agents is None or saved.proof.agents.initial_state is None or saved.graph_proof.graph.n_nodes > _RUN:
        return None
    try:
        return saved.proof.agents.simulate()
    except (SimulationError, ParameterError):
        return None


def _draw_family(
    saved: Certificate, wanted: Sequence[str], runs: Sequence[Trajectory], why: Counterexamples
) -> dict[str, Any]:
    """Draw the graphs, runs within what is proved, and counterexamples: as far as there are any."""
    proof = saved.family_proof
    small = bool(runs) and proof.family.n_nodes <= TRACED_NODES
    there = {"graph": proof.family.n_nodes <= DRAWN_NODES, "states": small, "input": small}
    there["decay"] = bool(runs) and proof.common and proof.rate is not None
    if proof.late is not None and proof.late.says_something:
        there["tracking" if proof.late.tracks else "late"] = True
    figures = _figures(saved, [name for name in wanted if there.get(name)], runs)
    made = small or saved.initial_state is None or proof.late is not None
    if "glance" in wanted and proof.family.n_nodes <= DRAWN_NODES and made:
        figures |= _glance(saved, runs)
    for number, (_, _, component, one) in enumerate(why):
        try:
            figures[f"why{number}"] = plot_counterexample(component, why=one, protocol=saved.protocol).figure
        except (ParameterError, SimulationError):
            continue  # no state of it is known; the words stand alone
    return figures


def counterexamples(saved: Certificate) -> Counterexamples:
    """Return what is refuted, the counterexample in words, its component, and itself: for claim and expectation."""
    result = []
    for part in saved.family_proof.parts:
        component = part.component
        if component.behaviour == DEPENDS and component.counterexample is not None:
            result.append(("one behaviour for every signal", component, component.counterexample))
            break
    asked = saved.expectations.behaviour
    if asked is not None and any(a.status == REFUTED for a in saved.assessment.answers):
        for part in saved.family_proof.parts:
            if part.component.holds(asked) is False:
                why = part.component.refutation(asked)
                if why is not None and why not in [one for _, _, one in result]:
                    result.append((asked, part.component, why))
                break
    return [(what, set_text(counterexample_text(c, why, labelled)), c, why) for what, c, why in result]


def _beside(late: LateBounds | None, protocol: Protocol) -> dict[str, bool]:
    """Tell which figure of late messages or moving leaders there is: of runs under something that was proved."""
    if late is None or not late.says_something:
        return {}
    return {"tracking": True} if late.tracks else {"late": can_run(protocol, late.messages)}


def inline_figure(figure: Figure, name: str, caption: Markup, narrow: Figure | None = None) -> Markup:
    """Return a figure as inline SVG, which a caption of HTML describes in words and numbers; on phones a narrow one."""
    both = [_svg(figure, name, caption)] + ([] if narrow is None else [_svg(narrow, NARROW, caption)])
    return Markup('<figure id="figure-{}">{}<figcaption>{}</figcaption></figure>').format(
        name, Markup("").join(both), caption
    )


def _svg(figure: Figure, name: str, caption: Markup) -> Markup:
    """Return a figure as inline SVG of a class."""
    image = figure_bytes(figure, ".svg").decode()
    image = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", image, flags=re.DOTALL)
    # the figures of a page share its names, so each puts its own before them
    image = re.sub(r"\bid=\"", f'id="{name}-', image.replace("xlink:href=", "href="))
    image = re.sub(r"(href=\"#|url\(#)", rf"\g<1>{name}-", image)
    image = re.sub(r' d="[^"]*"', lambda d: re.sub(r"(\.\d{3})\d+", r"\1", d[0]), image)  # a smaller page
    frame = re.search(r'<svg[^>]*viewBox="([-0-9. ]+)"[^>]*>', image)
    assert frame is not None
    return Markup('<svg class="{}" viewBox="{}" role="img" aria-label="{}">{}').format(
        name, frame[1], caption.striptags(), Markup(image[frame.end() :].strip())
    )
