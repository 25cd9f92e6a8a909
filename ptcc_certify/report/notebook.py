"""What a notebook shows of a graph, a family, a structure, a certificate, a trajectory, a design: a table, a figure.

What :class:`ptcc_certify.lazy_report.Shown` calls for ``_repr_html_``; elsewhere the plain ``repr`` is shown. Labels
are escaped, figures are inline SVG images with a text in their place for those who do not see them.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable
from contextlib import suppress
from functools import singledispatch
from typing import Any

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.errors import PTCCError
from ptcc_certify.gain_design.answer import AgentsDesign, Design
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import SHOWN_NODES
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.report.facts.graph import decision_facts, design_facts, family_text, structure_facts
from ptcc_certify.report.facts.of_certificate import facts_of
from ptcc_certify.report.plots.glance import plot_glance
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.style import figure_bytes
from ptcc_certify.report.plots.trade_off import plot_trade_off
from ptcc_certify.report.plots.trajectory import plot_run
from ptcc_certify.report.screen import entries
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide


@singledispatch
def html_of(shown: Any) -> str | None:
    """Return what notebooks show of an object; nothing of one that nobody draws: they then take the plain text."""
    return None


@html_of.register(SignedDigraph)
def graph_html(graph: SignedDigraph) -> str:
    """Show a graph: its size, how it was read, its nodes, and a drawing of up to 120 of them."""
    structure = analyse(graph)
    facts = structure_facts(structure, "signed digraph")
    return _structure_page([fact for fact in facts if fact.head in ("graph", "read", "nodes")], structure)


@html_of.register(Structure)
def structure_html(structure: Structure) -> str:
    """Show a structure: the screen of ``ptcc classify``, and a drawing of up to 120 nodes."""
    return _structure_page(structure_facts(structure, "signed digraph"), structure)


@html_of.register(Certificate)
def certificate_html(certificate: Certificate) -> str:
    """Show a certificate: the short screen of ``ptcc certify``, and up to 120 nodes the certificate at a glance.

    Of a family that is a drawing of it, and all facts, since its runs under many signals take long.
    """
    if certificate.of_family:
        return _page(facts_of(certificate), *_family_figure(certificate.family_proof.family))
    facts = [fact for fact in facts_of(certificate, "signed digraph", {}, details=False) if not fact.detail]
    small, figure = certificate.graph_proof.graph.n_nodes <= SHOWN_NODES, None
    with suppress(PTCCError):
        figure = plot_glance(certificate, words=False) if small else None
    return _page(facts, figure, "who listens to whom, and the run of every agent within its bounds", brief=True)


@html_of.register(Family)
def family_html(family: Family) -> str:
    """Show a family: the screen of ``ptcc classify``, and a drawing, up to 120 nodes; of more its size alone."""
    if family.n_nodes > SHOWN_NODES:
        return _page([Fact(head="family", note=family_text(family, ""))], None, "")
    return _page(decision_facts(decide(family), family, ""), *_family_figure(family))


@html_of.register(FamilyComponent)
def component_html(component: FamilyComponent) -> str:
    """Show what a component of a family does: the screen of ``ptcc classify``, and a drawing, up to 120 nodes."""
    return _page(decision_facts([component], component.family, ""), *_family_figure(component.family))


def _family_figure(family: Family) -> tuple[Any, str]:
    """Return a drawing of a family, unless it is large, and a text in its place."""
    if family.n_nodes > SHOWN_NODES:
        return None, ""
    return plot_graph(family).figure, f"drawing of the family: {family_text(family, '')}"


@html_of.register(Trajectory)
def trajectory_html(trajectory: Trajectory) -> str:
    """Show a trajectory: what its ``repr`` says, and states (and sliding variables) over time."""
    drawable = trajectory.states.ndim == 2 and trajectory.t.size > 1 and len(trajectory.labels) <= SHOWN_NODES
    figure = plot_run(trajectory) if drawable else None
    alt = (
        f"states{' and sliding variables' if trajectory.sliding and trajectory.sliding.sigma0.any() else ''} over time"
    )
    return _page([Fact(head="trajectory", note=repr(trajectory))], figure, alt)


@html_of.register(Design)
def design_html(answer: Design) -> str:
    """Show a design: the screen of ``ptcc design``, and its peak input against the deadline."""
    alt = "proved peak input against the deadline, and what no gains can stay below"
    return _page(design_facts(answer), plot_trade_off(answer).figure, alt)


@html_of.register(AgentsDesign)
def agents_design_html(answer: AgentsDesign) -> str:
    """Show a design of agents of order n: the screen of ``ptcc design``."""
    return _page(design_facts(answer), None, "")


def _structure_page(facts: Iterable[Fact], structure: Structure) -> str:
    graph = structure.graph
    figure = plot_graph(structure).figure if graph.n_nodes <= SHOWN_NODES else None
    leaders = f"{structure.leaders.size} of them leaders"
    return _page(facts, figure, f"drawing of the graph: {graph.n_nodes} nodes, {leaders}, {graph.n_edges} edges")


def _page(facts: Iterable[Fact], figure: Any, alt: str, brief: bool = False) -> str:
    """Return facts as a table beside a figure, if there is one, in the words of the short screen if ``brief``."""
    head = "text-align:left;vertical-align:top;padding-right:0.8em"
    rows = "".join(
        f'<tr><th scope="row" style="{head}">{html.escape(name)}</th>'
        f'<td style="text-align:left">{html.escape(text)}</td></tr>'
        for name, text in entries(facts, brief=brief)
    )
    image = ""
    if figure is not None:
        data = base64.b64encode(figure_bytes(figure, ".svg")).decode()
        style = "max-width:100%;background:white"
        image = f'<img alt="{html.escape(alt)}" style="{style}" src="data:image/svg+xml;base64,{data}">'
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<table style="max-width:60em">{rows}</table>{image}</div>'
    )
