"""The screens of ``ptcc design``, short and long."""

from __future__ import annotations

from ptcc_certify.gain_design.agents_answer import AgentsDesign
from ptcc_certify.gain_design.answer import Design
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.report.structure_text import graph_entries
from ptcc_certify.report.text_layout import format_lines, wrap_lines


def design_summary(answer: Design | AgentsDesign, graph: SignedDigraph, name: str) -> list[str]:
    """Return the short screen: graph, how it was read, what was asked, verdict, deadlines; 8 lines of 80 columns.

    Gains that meet it stand between verdict and deadlines.
    """
    why = answer.bounds_text if answer.protocol is not None else answer.binding
    entries = [
        *graph_entries(analyse(graph), name),
        ("asked", answer.request_text),
        ("verdict", f"{answer.verdict}: {why}"),
        ("gains", answer.gains_text),
        ("deadline", answer.deadline_text),
    ]
    return wrap_lines(format_lines((head, text) for head, text in entries if text))


def design_lines(answer: Design | AgentsDesign, graph: SignedDigraph, name: str) -> list[str]:
    """Return the long screen: gains, what binds, and the largest input besides."""
    return [*format_lines(graph_entries(analyse(graph), name)), *answer.lines()]
