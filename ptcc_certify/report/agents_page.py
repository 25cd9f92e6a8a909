"""What the page of a certificate of agents of order n shows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.size_limits import DRAWN_NODES
from ptcc_certify.protocols.agents import PLURALS, plant_text
from ptcc_certify.report import notation as texts
from ptcc_certify.report.agents_lines import answers
from ptcc_certify.report.figures import inline_figure
from ptcc_certify.report.plots.agents_motion import plot_formation, plot_motion
from ptcc_certify.report.plots.graph import plot_graph

if TYPE_CHECKING:
    from ptcc_certify.certificate.agents_answer import AgentsAnswer
    from ptcc_certify.certificate.certificate import Certificate

#: Agents that have a row, and agents up to which a run is drawn.
ROWS, DRAWN = 60, 60
#: Heads of the short screen, in words.
_HEADS = {"agents": "Agents", "x(T)": "Positions at T", "v(T)": "Velocities at T", "a(T)": "Accelerations at T"}
_HEADS |= {"error": "How near", "input": "Input", "INPUT": "Input"}
#: ``1 - t/T`` of the rows of bounds, and their names.
_INSTANTS = {0.5: "0.5 T", 0.1: "0.9 T", 0.01: "0.99 T", 1e-6: "T(1 \N{MINUS SIGN} 10^-6)"}


def agents_view(saved: Certificate, part: AgentsAnswer) -> dict[str, Any]:
    """Return everything that the template shows."""
    name, protocol = shlex.quote(saved.path.name), part.protocol
    figures, run_text = _figures(saved)
    graph = ""
    if saved.graph.n_nodes <= DRAWN_NODES:
        caption = Markup("The graph: arrows point to who listens, solid from allies, dashed from opponents.")
        graph = inline_figure(plot_graph(saved.graph).figure, "graph", caption)
    head, lines = _states(saved, part)
    return texts.facts(saved) | {
        "title": _title(saved),
        **{"part": part, "plant": plant_text(protocol.plant), "driven": any(protocol.plant)},
        "told": [(_HEADS.get(key, key or "and"), text) for key, text in answers(part)],
        "equations": texts.formula_svg(protocol.latex(), inline=False),
        "parameters": [(key, getattr(saved.protocol, key)) for key in texts.parameter_names(saved.protocol)],
        **{"head": head, "lines": lines, "remaining": _remaining(part)},
        **{"figures": figures, "run_text": run_text, "figure_graph": graph},
        "commands": [f"ptcc check {name}", f"python -m ptcc_certify.checker {name}"],
    }


def _title(saved: Certificate) -> str:
    claims = saved.claims
    what = claims[0].sharpest if len(claims) == 1 else f"{len(claims):,} components settle"
    text = f"{what} of {plant_text(saved.agents.protocol.plant)}" if saved.agents is not None else what
    return text[:1].upper() + text[1:] if saved.verdict == "certified" else "Undecided: " + text


def _states(saved: Certificate, part: AgentsAnswer) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the table of initial and final states, and inputs."""
    agents, letters = (
        range(min(saved.graph.n_nodes, ROWS)),
        ["x", "v", "a", *(f"x^({i})" for i in range(3, part.order))],
    )
    columns: dict[str, list[str]] = {}
    for i, letter in enumerate(letters[: part.order]):
        if part.initial_state is not None:
            columns[f"{letter}(0)"] = [_vector([float(c[i]) for c in part.initial_state[k]]) for k in agents]
        if part.final_state is not None and i < part.settled:
            columns[f"{letter}(T)"] = [_vector([float(c[i][0]) for c in part.final_state[k]]) for k in agents]
    if part.input is not None:
        bound = part.input
        columns[
            "|u| at most" if part.dimension == 1 else "\N{DOUBLE VERTICAL LINE}u\N{DOUBLE VERTICAL LINE} at most"
        ] = [texts.above(bound[k], 6) for k in agents]
    rows = [[texts.label(saved.graph.labels[k]), *(column[k] for column in columns.values())] for k in agents]
    return ["Agent", *columns], rows if columns else []


def _vector(numbers: Sequence[float]) -> str:
    """Write a number for each coordinate of space, rounded."""
    told = [f"{x:.6g}" for x in numbers]
    return told[0] if len(told) == 1 else f"({', '.join(told)})"


def _remaining(part: AgentsAnswer) -> tuple[list[str], list[list[str]]] | None:
    """Return head and rows of bounds of the largest deviation of each derivative."""
    worst = part.deviation_bound(np.array(list(_INSTANTS))).max(axis=0)
    if not part.functions or part.initial_state is None or not np.isfinite(worst).all():
        return None
    names = [PLURALS[i] if i < len(PLURALS) else f"derivatives {i}" for i in range(part.order)]
    rows = [[at, *(texts.above(float(x), 2) for x in worst[:, j])] for j, at in enumerate(_INSTANTS.values())]
    return ["Instant", *(name.capitalize() for name in names)], rows


def _figures(saved: Certificate) -> tuple[Mapping[str, Any], str]:
    """Draw a run, and tell how it compares with the bounds."""
    part = saved.agents
    if part is None or part.initial_state is None or saved.graph.n_nodes > DRAWN:
        return {}, ""
    try:
        run = part.simulate()
    except (SimulationError, ParameterError):
        return {}, ""
    seen = part.compare(run)
    text = ""
    if seen is not None:
        word = "exceeds a bound" if seen.violated else "keeps every bound"
        text = (
            f"A run by CVODES {word}: the largest ratio of V to its bound is {seen.decay:.4f}, of all {seen.worst:.4f}."
        )
    figures = {"motion": plot_motion(run)}
    return figures | ({"formation": plot_formation(run).figure} if part.dimension == 2 else {}), text
