"""A counterexample of a family as a run: the signal and the initial state that refute a behaviour."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Mode
from ptcc_certify.model import NominalProtocol, Protocol
from ptcc_certify.report.plots.camp_lines import (
    CAMP_STYLES,
    NAME_SIZE,
    NAMED_AGENTS,
    camp_groups,
    camp_lines,
    name_agents,
)
from ptcc_certify.report.plots.graph import plot_graph
from ptcc_certify.report.plots.style import axes_of, finished, styled, time_label
from ptcc_certify.report.text_layout import printable, shorten_text
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import TableSignal
from ptcc_certify.theorems.family_behaviour import (
    CLOSED_SET,
    DIFFERENT,
    MOVING,
    NO_CAMPS,
    STABLE,
    TWO_COMPONENTS,
    Counterexample,
    FamilyComponent,
    mode_name,
)
from ptcc_certify.theorems.kernel import Kernel

#: Where the second of two leader groups begins, the first at 1.
_SECOND = 0.5


@styled
def plot_counterexample(
    subject: FamilyComponent,
    *,
    ax: Axes | None = None,
    why: Counterexample | None = None,
    protocol: Protocol | None = None,
    time_unit: str = "",
) -> Axes:
    """Draw what refutes a behaviour of a family: a run from the state, under the signal, that it names.

    A state that is at rest in one member and moves in another is held in the first up to ``T/2``. Of edges whose signs
    no camps keep the closed walk is drawn, as a graph. Of more than eight agents those are drawn that move most.

    Parameters
    ----------
    subject : FamilyComponent
        As :func:`ptcc_certify.decide` returns it.
    ax : Axes, optional
    why : Counterexample, optional
        By default that of the component.
    protocol : NominalProtocol, optional
        By default that of ``T = rho1 = rho2 = 1`` and ``kappa = 3``.
    time_unit : str

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        There is none, or no state of it is known.

    Examples
    --------
    >>> (pair,) = ptcc.decide([("a", "b", 1, 1), ("b", "a", -1, 0)])
    >>> ax = plot_counterexample(pair)
    >>> ax.get_ylabel()
    'state $x_k$'
    """
    why = subject.counterexample if why is None else why
    if why is None:
        raise ParameterError("the component has no counterexample; its behaviour holds for every signal")
    if why.kind == NO_CAMPS:
        return plot_graph(_walk(subject, why), ax=axes_of(ax))
    state, rows = _state_and_signal(subject, why)
    if state is None:
        raise ParameterError("no state of the counterexample is known exactly; its edges tell")
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3) if protocol is None else protocol
    T = float(protocol.T)
    table = [(share * T, mode, level) for share, mode, level in rows]
    run = simulate(subject.family, protocol, state, TableSignal(table))
    ax, groups = axes_of(ax), camp_groups(subject.structures[why.mode])
    moved = np.ptp(run.states, axis=1)
    agents = sorted(np.argsort(-moved, kind="stable")[:NAMED_AGENTS].tolist())
    for k, style in camp_lines(groups, agents):
        ax.plot(run.t, run.states[k], **style)
    ax.axvline(T, color="black", linewidth=0.8, linestyle=":", label="deadline $T$")
    low, high = float(run.states.min()), float(run.states.max())
    room = (high - low) or 1.0
    ax.set_ylim(low - 0.08 * room, high + 0.22 * room)
    for place, (share, mode, _) in enumerate(rows):
        if place:
            ax.axvline(share * T, color="black", linewidth=0.8)
        end = rows[place + 1][0] if place + 1 < len(rows) else 1.0
        name = shorten_text(printable(mode_name(subject.family, mode)), 18)
        drawn: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": NAME_SIZE, "parse_math": False}
        ax.text((share + end) / 2 * T, high + 0.2 * room, _member_text(subject, why, place, name), **drawn)
    name_agents(ax, run, run.states, {k: CAMP_STYLES[groups[k]][0] for k in agents}, until=float(run.t[-1]))
    return finished(ax, time_label("time $t$", time_unit), "state $x_k$")


def _member_text(component: FamilyComponent, why: Counterexample, place: int, name: str) -> str:
    """Name the member that acts."""
    family = component.family
    mode = family.modes[why.other if place else why.mode]
    lines = [name] if len(family.modes) > 1 else []
    if place and why.edge is not None:
        ends = (shorten_text(printable(mode.labels[int(side[why.edge])]), 10) for side in (mode.source, mode.target))
        lines += [" -> ".join(ends), "at its largest"]
    elif why.kind != STABLE and not mode.known.all():
        lines.append("least weights")
    return "\n".join(lines)


def _state_and_signal(
    component: FamilyComponent, why: Counterexample
) -> tuple[list[float] | None, list[tuple[float, int, Any]]]:
    """Return the state, and rows of share of ``T``, mode and levels."""
    family, structure = component.family, component.structures[why.mode]
    x = np.zeros(component.nodes.size)
    signal: list[tuple[float, int, Any]] = [(0.0, why.mode, 0.0)]
    if why.kind == CLOSED_SET:
        x[list(why.nodes)] = why.camps
        return x.tolist(), signal
    if why.kind == TWO_COMPONENTS:
        for size, node in zip((1.0, _SECOND), why.nodes, strict=True):
            closed = next(c for c in structure.closed_components if node in c.nodes)
            x[list(closed.nodes)] = size * np.array(closed.gauge or [1] * len(closed.nodes))
        return x.tolist(), signal
    if why.kind == DIFFERENT:
        return _moving_column(component, why), [*signal, (0.5, why.other, 0.0)]
    if why.kind == MOVING:
        levels = np.zeros(family.modes[why.other].parameters.size)
        if why.edge is not None:
            levels[_parameter(family.modes[why.other], why.edge)] = 1.0
        return _rest_state(why), [*signal, (0.5, why.other, levels)]
    mode = family.modes[why.mode]
    levels = np.ones(mode.parameters.size)
    levels[[_parameter(mode, edge) for edge in why.off]] = 0.0
    return np.ones(x.size).tolist(), [(0.0, why.mode, levels)]


def _rest_state(why: Counterexample) -> list[float] | None:
    if why.state is not None:
        size = max(map(abs, why.state)) or 1
        return [float(x / size) for x in why.state]
    if why.enclosure is not None:
        x = np.array([float(why.enclosure.unit * m) for m in why.enclosure.middle])
        return (x / np.abs(x).max()).tolist()
    return None


def _moving_column(component: FamilyComponent, why: Counterexample) -> list[float] | None:
    """Return a state at rest in one mode that moves in the other."""
    kernel, other = Kernel(component.structures[why.mode]), component.structures[why.other].graph
    for j in range(kernel.dimension):
        if (column := kernel.column(j)) is not None:
            x = np.array([float(value) for value in column])
            if np.abs(other.laplacian() @ x).max(initial=0.0) > 1e-9:
                return (x / np.abs(x).max()).tolist()
    return None


def _parameter(mode: Mode, edge: int) -> int:
    """Return the number of the parameter that an edge belongs to; of an undirected one either direction does."""
    ends = {int(mode.source[edge]), int(mode.target[edge])}
    for number, other in enumerate(mode.parameters.tolist()):
        same = other == edge or (mode.tied and {int(mode.source[other]), int(mode.target[other])} == ends)
        if same and mode.sign[other] == mode.sign[edge]:
            return number
    raise ParameterError("the edge has no uncertain weight")


def _walk(component: FamilyComponent, why: Counterexample) -> SignedDigraph:
    """Return the edges of the closed walk as a graph."""
    source, target, sign = component.family.union
    labels, walk = component.family.labels, set(why.cycle)
    edges: dict[tuple[str, str], int] = {}
    for s, t, w in zip(source.tolist(), target.tolist(), sign.tolist(), strict=True):
        if (s, t) in walk:
            pair = (labels[s], labels[t])
            edges[pair if pair not in edges else pair[::-1]] = w
    return SignedDigraph.from_edges([(*pair, w) for pair, w in edges.items()])
