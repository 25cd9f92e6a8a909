"""Agents over time: a named line for each of a few, ranges and medians of the camps of many."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.optimize import isotonic_regression

from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure, analyse, find_camps
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, STEPS, tick_count
from ptcc_certify.report.text_layout import columns, printable, shorten_text
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.trajectory import Trajectory

#: Colour and line of the parts of a graph, which differ without colours too.
CAMP_STYLES: dict[str, tuple[str, Any]] = {
    "first camp": (RUN, "-"),
    "second camp": (BOUND, (0, (7, 1.5))),
    "unbalanced leaders": ("#CC79A7", "-."),
    "single leaders": ("#332288", (0, (1, 0.6))),
    "followers": (BEHIND, (0, (3, 1.5))),
    "agents": (BEHIND, "-"),
}
#: Agents, and agents of one part of a graph, of which each has a line.
NAMED_AGENTS, NAMED_OF_PART = 8, 3
#: Size in points of names, and columns of a name; points that the label of a tick takes.
NAME_SIZE, NAME_LENGTH, TICK_ROOM = 7, 16, 24
#: What keeps a name legible upon lines.
HALO = [patheffects.withStroke(linewidth=2, foreground="white")]


def camp_groups(structure: Structure) -> np.ndarray:
    """Return which of ``CAMP_STYLES`` every node belongs to."""
    group = np.full(structure.graph.n_nodes, "followers", dtype=object)
    for component in structure.closed_components:
        alone = len(component.nodes) == 1
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            camp = {1: "first camp", -1: "second camp", 0: "unbalanced leaders"}[sign]
            group[v] = "single leaders" if alone else camp
    return group


def family_camps(family: Family) -> np.ndarray | None:
    """Return the camp, of ``CAMP_STYLES``, of every node that all edges of all modes keep; None if there are none.

    Examples
    --------
    >>> from ptcc_certify.report.plots.camp_lines import family_camps
    >>> family_camps(ptcc.as_family([("a", "b", -2, -1)])).tolist()
    ['first camp', 'second camp']
    """
    gauge, violated, _ = find_camps(family.n_nodes, *family.union)
    return None if violated.size else np.where(gauge > 0, "first camp", "second camp").astype(object)


def family_groups(family: Family) -> np.ndarray:
    """Return the part of ``CAMP_STYLES`` that every node has in all modes; else the camps of all edges; else "agents".

    Examples
    --------
    >>> from ptcc_certify.report.plots.camp_lines import family_groups
    >>> day, night = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([("b", "a", 1)], nodes="ab")
    >>> family_groups(Family.switching([day, night])).tolist()
    ['first camp', 'first camp']
    """
    own = [camp_groups(analyse(mode.mandatory)) for mode in family.modes]
    if all((one == own[0]).all() for one in own):
        return own[0]
    camps = family_camps(family)
    return np.full(family.n_nodes, "agents", dtype=object) if camps is None else camps


def camp_lines(groups: np.ndarray, agents: Iterable[int]) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield agents, each with how its line is drawn; the first of a part of the graph has its name for the legend.

    Examples
    --------
    >>> from ptcc_certify.report.plots.camp_lines import camp_lines
    >>> [(k, style["label"]) for k, style in camp_lines(np.array(["followers", "agents", "followers"]), [0, 1, 2])]
    [(0, 'followers'), (1, 'agents'), (2, None)]
    """
    seen = set[str]()
    for k in agents:
        name = str(groups[k])
        colour, line = CAMP_STYLES[name]
        yield k, {"color": colour, "linestyle": line, "label": None if name in seen else name}
        seen.add(name)


def text_width(text: str) -> float:
    """Return the width in points that a name has room for; letters of some scripts take two columns."""
    return 0.62 * NAME_SIZE * columns(text)


def draw_agents(
    ax: Axes,
    run: Trajectory | AgentsTrajectory,
    values: np.ndarray,
    structure: Structure,
    *,
    size: bool = False,
    **style: Any,
) -> dict[int, str]:
    """Draw a quantity of every agent, (N, M), in the colours and lines of camps; return the colours of single lines.

    Of up to eight agents each has a line. Of more, a part of the graph with more than three agents is drawn as its
    range and median, with a line for the agent whose quantity is the largest at first, and for that with the least;
    of a ``size``, which is never negative, the largest is drawn instead, and what is below it.
    """
    played = run.played if isinstance(run, Trajectory) else None
    group = camp_groups(structure) if played is None else family_groups(played.family)
    single: dict[int, str] = {}
    ranges = False
    step: Any = "post" if style.get("drawstyle") == "steps-post" else None
    for name, (colour, line) in CAMP_STYLES.items():
        members = np.flatnonzero(group == name)
        width, label = 0.9 if name == "followers" else 1.5, name
        if len(group) > NAMED_AGENTS and members.size > NAMED_OF_PART:
            rows = np.nan_to_num(values[members])
            high, low = rows.max(axis=0), 0 if size else rows.min(axis=0)
            ax.fill_between(run.t, low, high, color=colour, alpha=0.2, linewidth=0, step=step)
            middle = high if size else np.median(rows, axis=0)
            ax.plot(run.t, middle, color=colour, linestyle=line, linewidth=2, label=name, **style)
            ends = {int(rows[:, 0].argmax())} | (set() if size else {int(rows[:, 0].argmin())})
            members = members[sorted(ends)]
            width, label, ranges = 0.7, "", True
        for v in members:
            drawn = {"color": colour, "linestyle": line, "linewidth": width}
            ax.plot(run.t, values[v], label=label or None, **drawn, **style)
            label, single[int(v)] = "", colour
    if ranges:
        ax.fill_between([], [], color=BEHIND, alpha=0.3, label="largest" if size else "median and range")
    return single


def draw_deadlines(ax: Axes, run: Trajectory | AgentsTrajectory) -> None:
    """Draw the deadline, and where sliding variables move that of theirs, as vertical lines."""
    if isinstance(run, AgentsTrajectory) or run.protocol.prescribed:
        ax.axvline(float(run.protocol.gain.T), color="black", linewidth=0.8, linestyle=":", label="deadline $T$")
    sliding = run.sliding if isinstance(run, Trajectory) else None
    if sliding is not None and sliding.sigma0.any():
        reached = float(sliding.protocol.T_r)
        ax.axvline(reached, color="black", linewidth=0.8, linestyle=(0, (5, 2, 1, 2)), label="$T_r$")


def name_agents(
    ax: Axes,
    run: Trajectory | AgentsTrajectory,
    values: np.ndarray,
    lines: dict[int, str],
    *,
    ends: bool = False,
    until: float | None = None,
    told: bool = False,
) -> None:
    """Write the names of agents where their lines begin, and where they end if they end apart; show time ``until``.

    If they are ``told``, the values at the ends stand beside the names there.

    ``lines`` holds the colours of the lines by agent, as :func:`draw_agents` returns them.
    """
    if not lines or not run.t.size:
        return
    agents, colours = np.array(list(lines)), list(lines.values())
    names = [shorten_text(printable(run.labels[v]), NAME_LENGTH - 4) for v in agents]
    texts = [_spread(ax, values[agents, 0], names, colours)]
    if ends:
        digits = 2 - math.floor(math.log10(float(np.abs(values).max()) or 1.0))  # a run's 1e-9 is 0
        tails = [f": {round(float(x), digits) + 0.0:.3g}" if told else "" for x in values[agents, -1]]
        texts.append(_spread(ax, values[agents, -1], names, colours, tails))
    if ends and not told and len(texts[1]) < 2:
        del texts[1]  # all end at the same place
    first, last = float(run.t[0]), float(run.t[-1]) if until is None else until
    for side, column in zip((-1, 1), texts, strict=False):
        for height, place, name, colour in column:
            line = {"arrowstyle": "-", "color": colour, "linewidth": 0.4, "shrinkA": 0, "shrinkB": 0, "clip_on": False}
            gap = 2 / text_width(name)  # the line begins beside the name: nothing is to be cut off
            line |= {"patchA": None, "relpos": (1 + gap if side < 0 else -gap, 0.5)}
            style: dict[str, Any] = {"ha": "right" if side < 0 else "left", "va": "center_baseline", "color": colour}
            style |= {"fontsize": NAME_SIZE, "parse_math": False, "annotation_clip": False, "arrowprops": line}
            style["path_effects"] = HALO
            start, moved = ((first, last)[side > 0], height), (side * 8, place)
            ax.annotate(name, start, moved, textcoords=("offset points", "data"), **style)
    rooms = [10 + max(text_width(name) for _, _, name, _ in column) for column in texts]
    width = ax.get_window_extent().width / ax.figure.dpi * 72
    width = min([0.8 * width, *(width - room for room in rooms[1:])])  # without names at the end, in any panel
    own = max(width - rooms[0], width / 3)
    left = (last - first) * rooms[0] / own
    ticks = MaxNLocator(min(tick_count(ax.xaxis, 5), max(2, int(own / TICK_ROOM))), steps=STEPS).tick_values(
        first, last
    )
    ax.set_xticks([x for x in ticks if first <= x <= last])
    ax.set_xlim(first - left, last)
    ax.spines["bottom"].set_bounds(first, last)  # names have their room before time begins


def _spread(
    ax: Axes, heights: np.ndarray, names: Sequence[str], colours: Sequence[str], tails: Sequence[str] = ()
) -> list[tuple[float, float, str, str]]:
    """Return heights of lines, heights of their names, which do not overlap, names with their tails, and colours.

    Lines that cannot be told apart there share one name, and one tail.
    """
    tails = tails or [""] * len(names)
    alike = list(zip(colours, tails, strict=True))
    scale, limits = ax.yaxis.get_transform(), ax.get_ylim()
    low, high = scale.transform(np.array(limits))
    height = 0.75 * ax.get_window_extent().height / ax.figure.dpi * 72  # in points, when labels have their room
    gap = 1.2 * NAME_SIZE / height * (high - low)
    at = np.clip(scale.transform(np.clip(np.nan_to_num(heights), *limits)), low, high)
    groups: list[list[int]] = []
    for k in np.argsort(at, kind="stable"):
        if groups and at[k] - at[groups[-1][0]] < gap / 6:
            at[k] = at[groups[-1][0]]
        if groups and at[k] == at[groups[-1][0]] and alike[k] == alike[groups[-1][0]]:
            groups[-1].append(int(k))
        else:
            groups.append([int(k)])
    place = np.array([at[own[0]] for own in groups])
    steps = gap * np.arange(len(groups))
    place = np.clip(isotonic_regression(place - steps).x, low + gap / 2, max(low + gap / 2, high - steps[-1])) + steps
    lines, texts = scale.inverted().transform([at[own[0]] for own in groups]), scale.inverted().transform(place)
    joint = [_joined([names[k] for k in sorted(own)]) + tails[own[0]] for own in groups]
    return list(zip(lines, texts, joint, [colours[own[0]] for own in groups], strict=True))


def _joined(names: Sequence[str]) -> str:
    """Join names, and count those for which there is no room."""
    for shown in range(len(names), 0, -1):
        more = [f"+{len(names) - shown}"] if shown < len(names) else []
        if columns(text := ", ".join([*names[:shown], *more])) <= NAME_LENGTH:
            return text
    return text
