"""The table of agents of a page: where each begins and ends."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from markupsafe import Markup

from lmi.exact.decimal_rounding import counted
from ptcc_certify.bounds.final_state.of_graph import extremes
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.constrained_switching.final_states import states_of_signal
from ptcc_certify.report import html_text as texts
from ptcc_certify.report.facts.claim import assumptions
from ptcc_certify.report.facts.constrained_switching import agreement_text, rests
from ptcc_certify.report.html_text import above, below, enclosed, rational

#: Agents up to which each has a row, and how many there are of either extreme above.
ROWS, EXTREMES = 60, 10

#: Heads of what vehicles have.
OF_VEHICLES = {"order": "Order", "v(0)": "Initial velocity", "a(0)": "Initial acceleration"}


def states_table(saved: Certificate) -> tuple[str, list[Any], list[str]]:
    """Return caption, rows and heads of the table of initial and final states: of all agents, or of the extremes."""
    if saved.of_family:
        return _of_family(saved)
    columns = _of_agents(saved) if saved.proof.agents is not None else _of_graph(saved)
    if not columns:
        return "", [], []
    agents, end, ends = _tabled(saved), saved.graph_proof.final_state, f"Where the agents end{_assumed(saved)}"
    exact = end is None or end.radius is None
    if saved.proof.agents is not None:
        caption = f"Where the agents begin and end, and their inputs{_assumed(saved)}"
    elif end is None:
        caption = "Where the agents begin"
    elif saved.verdict == "certified":
        caption = f"{ends}, proved {'exactly' if exact else 'in intervals'}"
    else:
        caption = f"{ends} if they settle ({'exact' if exact else 'in proved intervals'})"
    if saved.graph_proof.graph.n_nodes > ROWS:
        total = counted(saved.graph_proof.graph.n_nodes, "agent")
        caption += f": the {EXTREMES} highest and the {EXTREMES} lowest of {total}"
    names = [texts.label(saved.labels[k]) for k in agents]
    return caption, list(zip(names, *columns.values(), strict=True)), ["Agent", *columns]


def _assumed(saved: Certificate) -> str:
    """Tell what final states are without, where more was asked."""
    return "".join(f", {text}" for text in assumptions(saved, states=True))


def _tabled(saved: Certificate) -> list[int]:
    """Return the agents that have a row: all, or those that end highest and lowest, from the highest on."""
    proof = saved.graph_proof
    if proof.graph.n_nodes <= ROWS:
        return list(range(proof.graph.n_nodes))
    if proof.agents is not None:
        return list(range(2 * EXTREMES))
    if (end := proof.final_positions) is None:
        highest, lowest = extremes(proof.initial_positions or (), EXTREMES)
    else:
        highest, lowest = extremes(end.states, EXTREMES, end.radius)
    return highest + lowest


def _of_graph(saved: Certificate) -> dict[str, list[Any]]:
    if saved.initial_state is None:
        return {}
    heads = ("Initial state", OF_VEHICLES, "\u03c3(0)", "State at the deadline", "Limit, if it settles")
    agents, parts = _tabled(saved), texts.agent_parts(saved)
    columns: dict[str, list[Any]] = {"Part": [parts[k] for k in agents]}
    if saved.proof.offsets is not None:
        columns["Place h"] = [rational(saved.proof.offsets[k]) for k in agents]
    return columns | texts.state_columns(saved, heads, agents, enclosed)


def _of_agents(saved: Certificate) -> dict[str, list[Any]]:
    """Return initial and final positions, velocities and so on, and bounds of inputs, of agents of order n."""
    part, agents = saved.proof.agents, _tabled(saved)
    assert part is not None
    letters = ["x", "v", "a", *(f"x^({i})" for i in range(3, part.order))][: part.order]
    columns: dict[str, list[Any]] = {}
    for i, letter in enumerate(letters):
        if part.initial_state is not None:
            columns[f"{letter}(0)"] = [_vector([float(c[i]) for c in part.initial_state[k]]) for k in agents]
        if part.final_state is not None and i < part.settled:
            columns[f"{letter}(T)"] = [_vector([float(c[i][0]) for c in part.final_state[k]]) for k in agents]
    if part.input is not None:
        size = "|u|" if part.dimension == 1 else "\N{DOUBLE VERTICAL LINE}u\N{DOUBLE VERTICAL LINE}"
        columns[f"{size} at most"] = [above(part.input[k], 6) for k in agents]
    return columns


def _vector(numbers: Sequence[float]) -> str:
    """Write a number for each coordinate of space, rounded."""
    told = [f"{x:.6g}" for x in numbers]
    return told[0] if len(told) == 1 else f"({', '.join(told)})"


def _of_family(saved: Certificate) -> tuple[str, list[Any], list[str]]:
    rows: list[tuple[Any, ...]] = list(state_rows(saved)[:ROWS])
    finals = states_of_signal(saved.family_proof)
    heads = ["Agent", "Camp", "Initial state"]
    for name, values in (saved.proof.vehicles or {}).items():
        heads.append(OF_VEHICLES[name])
        rows = [(*begin, rational(x), end) for (*begin, end), x in zip(rows, values, strict=False)]
    if (places := saved.proof.offsets) is not None:
        heads.append("Place h")
        rows = [(*begin, rational(h), end) for (*begin, end), h in zip(rows, places, strict=False)]
    if all(last is None for *_, last in rows):
        return "Where the agents begin", [(texts.label(name), *cells) for name, *cells, _ in rows], heads
    every = finals == list(saved.proof.final_positions or ())
    which = "every signal" if every else "these signals"
    which += "" if saved.protocol.reaching is None else " and disturbance"
    last = "State at the deadline" if rests(saved) else "State at any instant"
    told, whom = f", proved for {which if every else 'signals that keep the promise'}", f", for {which}"
    if saved.family_proof.family.graph is not None:
        told = whom = ""
    written = [(texts.label(name), *cells, end or _ends(None)) for name, *cells, end in rows]
    return f"Where the agents end{_assumed(saved)}{told}", written, [*heads, f"{last}{agreement_text(saved)}{whom}"]


def state_rows(saved: Certificate) -> list[tuple[str, str, str, str | None]]:
    """Return label, camp, initial and final state of every agent; None where no limit is claimed."""
    if saved.initial_state is None:
        return []
    labels, finals = saved.family_proof.family.labels, states_of_signal(saved.family_proof)
    camp = ["\u2013"] * len(labels)
    for part in saved.family_proof.parts:
        for number, side in enumerate(part.component.camps, 1):
            for v in part.component.nodes[side].tolist():
                camp[v] = f"camp {number}"
    ends = [None if end is None else _ends(end) for end in finals]
    return list(zip(labels, camp, map(rational, saved.proof.initial_positions or ()), ends, strict=True))


def _ends(ends: tuple[Fraction, Fraction] | None) -> str:
    """Write an interval, rounded outwards."""
    if ends is None:
        return "no limit is claimed"
    low, high = ends
    if low == high:
        return rational(low)
    return Markup("[{},\u00a0{}]").format(_rounded(low, -1), _rounded(high, 1))


def _rounded(x: Fraction, way: int) -> str:
    text = rational(x)
    if "\N{ALMOST EQUAL TO}" not in text and "/" not in text:
        return text
    outwards = above if (x > 0) == (way > 0) else below
    sign = "\N{MINUS SIGN}" if x < 0 else ""
    return Markup("{}{}").format(sign, outwards(abs(x), 5)) if x else "0"
