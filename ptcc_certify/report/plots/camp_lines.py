"""Agents over time: a line for each, names of a few, ranges and means of the camps of many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.optimize import isotonic_regression

from lmi.exact.decimal_rounding import near
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure, analyse, find_camps
from ptcc_certify.graphs.stubborn import PREJUDICE
from ptcc_certify.report.plots.style import BEHIND, BOUND, RUN, STEPS, signed, tick_count
from ptcc_certify.report.text_layout import columns, printable, shorten_text
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.trajectory import Trajectory

#: Colour and line of the parts of a graph, which differ without colours too.
CAMP_STYLES: dict[str, tuple[str, Any]] = {
    "first camp": (RUN, "-"),
    "second camp": (BOUND, (0, (7, 1.5))),
    "unbalanced leaders": ("#AA4499", "-."),
    "single leaders": ("#332288", (0, (1, 0.6))),
    "followers": (BEHIND, (0, (3, 1.5))),
    "agents": (BEHIND, "-"),
}
#: Agents of which each has a line, and of one part of a graph of more; of which each has its name, and of one part.
LINE_AGENTS, LINES_OF_PART, NAMED_AGENTS, NAMED_OF_PART = 60, 12, 8, 3
#: Size in points of names, and columns of a name; points that the label of a tick takes.
NAME_SIZE, NAME_LENGTH, TICK_ROOM = 7, 18, 24
#: Columns below which no name is broken to stand at both ends; how much wider than others letters may be.
SHORT, WIDER = 6, 1.1
#: The least share of the width of a panel for the time up to ``T``; points beside it for the axis and its label, and
#: between a line and its name.
TIME_SHARE, AXIS_ROOM, NAME_GAP = 0.55, 40, 10
#: How far beyond ``T`` a figure goes, and how far if nothing changes by more than such a share there.
LATEST, AFTER, CALM = 1.2, 1.1, 0.01
#: How far a line may be from a value that is told of ``T``, as a share of the axis, and lead to it.
ARRIVED = 0.02
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
    """Return the width in points that a name, or its longest line, takes; letters of some scripts take two columns."""
    return 0.62 * NAME_SIZE * max(map(columns, text.split("\n")))


def draw_agents(
    ax: Axes,
    run: Trajectory | AgentsTrajectory,
    values: np.ndarray,
    structure: Structure,
    *,
    size: bool = False,
    colours: Sequence[str] | None = None,
    **style: Any,
) -> dict[int, str]:
    """Draw a quantity of every agent, (N, M), in the colours and lines of camps; return the colours of named lines.

    If up to 60 agents have ``colours`` of their own, lines alone tell camps, and the legend, if there are several.
    Named are those of :func:`named_of_part`. Of more than 60 agents a part of more than twelve is drawn as its range
    and mean, and has no lines but theirs; of a ``size``, which is never negative, as what is below the largest.
    """
    played = run.played if isinstance(run, Trajectory) else None
    group = camp_groups(structure) if played is None else family_groups(played.family)
    named: dict[int, str] = {}
    step: Any = "post" if style.get("drawstyle") == "steps-post" else None
    few, ranges, many = len(group) <= NAMED_AGENTS, False, len(group) > LINE_AGENTS
    own = None if many else colours
    for name, (colour, line) in CAMP_STYLES.items():
        members, label = np.flatnonzero(group == name), name if own is None else ""
        if own is not None and 0 < members.size < len(group):
            ax.plot([], [], color=BEHIND, linestyle=line, label=name)
        elif own is not None:
            line = "-"  # there is nothing to tell apart
        ends = named_of_part(members, values, size=size)
        if len(ends) < members.size:
            rows = np.nan_to_num(values[members])
            if many and members.size > LINES_OF_PART:
                high, low = rows.max(axis=0), 0 if size else rows.min(axis=0)
                ax.fill_between(run.t, low, high, color=colour, alpha=0.2, linewidth=0, step=step)
                middle = high if size else rows.mean(axis=0)
                ax.plot(run.t, middle, color=colour, linestyle=line, linewidth=2, label=name, **style)
                members, label, ranges = ends, "", True
        width = (0.9 if name == "followers" else 1.5) if few else 0.6
        for v in members.tolist():
            thick = width if few or v not in ends else 1.1
            shade = colour if own is None else own[v]
            ax.plot(run.t, values[v], label=label or None, color=shade, linestyle=line, linewidth=thick, **style)
            label = ""
        named |= {int(v): colour if own is None else own[v] for v in ends}
    if ranges:
        ax.fill_between([], [], color=BEHIND, alpha=0.3, label="largest" if size else "mean and range")
    return named


def named_of_part(members: np.ndarray, values: np.ndarray, *, size: bool = False) -> np.ndarray:
    """Return the agents that are named among the members of a part of a graph, by a quantity of all agents, (N, M).

    Of up to eight agents it is each; of more, in a part of more than three, the agent whose quantity is the largest at
    first, and, unless it is a ``size``, that with the least.

    Examples
    --------
    >>> from ptcc_certify.report.plots.camp_lines import named_of_part
    >>> named_of_part(np.arange(5), np.array([[3], [7], [1], [2], [4], *[[0]] * 5]))
    array([1, 2])
    """
    if len(values) <= NAMED_AGENTS or members.size <= NAMED_OF_PART:
        return members
    first = np.nan_to_num(values[members, 0])
    return members[sorted({int(first.argmax())} | (set() if size else {int(first.argmin())}))]


def draw_deadlines(ax: Axes, run: Trajectory | AgentsTrajectory, *, told: bool = False) -> None:
    """Draw the deadline, and where sliding variables move that of theirs, as vertical lines.

    They are named in the legend; or ``told`` beside the tops of their lines.
    """
    lines: list[tuple[Any, Any, str, str]] = []
    if isinstance(run, AgentsTrajectory) or run.protocol.prescribed:
        lines.append((run.protocol.gain.T, ":", "$T$", "deadline $T$"))
    sliding = run.sliding if isinstance(run, Trajectory) else None
    if sliding is not None and sliding.sigma0.any():
        lines.append((sliding.protocol.T_r, (0, (5, 2, 1, 2)), "$T_r$", "$T_r$"))
    beside: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "ha": "right"}
    beside |= {"va": "top", "fontsize": NAME_SIZE, "path_effects": HALO}
    for at, dashes, name, label in lines:
        ax.axvline(float(at), color="black", linewidth=0.8, linestyle=dashes, label=None if told else label)
        if told:
            ax.annotate(f"{name} = {near(at)}", (float(at), 1), (-3, -2), **beside)


def name_agents(
    ax: Axes,
    run: Trajectory | AgentsTrajectory,
    values: np.ndarray,
    lines: dict[int, str],
    *,
    ends: bool = False,
    until: float | None = None,
    told: np.ndarray | None = None,
) -> None:
    """Write the names of agents where their lines begin, and where they end if they end apart; show time ``until``.

    If values are ``told``, (N,), they stand beside the names at the ends, with those of all others who end there; a
    point marks at ``T`` where a line has not arrived. Names take so much room only that the time up to ``T`` keeps 55 %
    of the width: longer ones have two lines, or stand at the beginning alone. Where nothing changes after ``T``, little
    of that is shown unless told.

    ``lines`` holds the colours of the lines by agent, as :func:`draw_agents` returns them.
    """
    if not lines or not run.t.size:
        return
    first, last, T = float(run.t[0]), _seen_until(run, values) if until is None else until, _deadline(run)
    agents, colours = list(lines), list(lines.values())
    enders, enders_colours, tails, early = agents, colours, [""] * len(agents), np.zeros(len(values), dtype=bool)
    at_end = values[:, np.searchsorted(run.t, last * (1 + 1e-12), side="right") - 1]
    if told is not None:
        tail_of = [f": {signed(value, 4 if 1e3 <= abs(value) < 1e4 else 3)}" for value in told.tolist()]
        colour_of = {tail_of[v]: lines[v] for v in reversed(agents)}
        enders = [*agents, *(v for v, tail in enumerate(tail_of) if v not in lines and tail in colour_of)]
        tails = [tail_of[v] for v in enders]
        enders_colours = [colour_of[tail] for tail in tails]
        before = values[:, max(int(np.searchsorted(run.t, T)) - 1, 0)]
        early = np.abs(before - told) > ARRIVED * abs(np.subtract(*ax.get_ylim()))
        at_end = np.where(early, told, at_end)
        for v in np.flatnonzero(early).tolist():
            point: dict[str, Any] = {"marker": "o", "markersize": 3, "markevery": [0], "linewidth": 0.4, "zorder": 4}
            ax.plot([T, last], [told[v]] * 2, color=lines.get(v, BEHIND), gid=f"end-{v}", **point)

    def names_of(some: Sequence[int]) -> list[str]:
        labels = [printable(run.labels[v]).replace(PREJUDICE, " (p)") for v in some]
        return [shorten_text(label, NAME_LENGTH) for label in labels]

    def columns_of(letters: Sequence[int]) -> list[list[tuple[float, float, str, str]]]:
        texts = [_spread(ax, values[agents, 0], names_of(agents), colours, letters[0])]
        if len(letters) > 1:
            texts.append(_spread(ax, at_end[enders], names_of(enders), enders_colours, letters[1], tails))
        apart = len({height for height, *_ in texts[-1]}) > 1
        return texts if told is not None or apart else texts[:1]  # not where all end at the same place

    wide, room, inside = _rooms(ax, (last - first) / ((min(last, T) - first) or 1))
    texts = columns_of([NAME_LENGTH + 8] * (1 + ends))
    needs = [max(text_width(name) for _, _, name, _ in column) for column in texts]
    if (free := (room - NAME_GAP * len(needs)) / WIDER) < sum(needs):
        right = [min(needs[1], max(free / 2, free - needs[0]))] if len(needs) > 1 else []
        parts = zip((free - sum(right), *right), needs, strict=True)
        letters = [
            NAME_LENGTH + 8 if part >= need - 0.01 else max(3, int(part / text_width("x"))) for part, need in parts
        ]
        longest = max(map(columns, names_of(agents)))
        if len(letters) > 1 and told is None and min(letters) < max(longest / 2, min(longest, SHORT)):
            letters = [max(3, int((room - NAME_GAP) / WIDER / text_width("x")))]
        texts = columns_of(letters)
        if told is not None and len(letters) > 1 and min(letters) < min(longest, SHORT):  # names at the ends alone
            whole = max(3, int((room - NAME_GAP) / WIDER / text_width("x")))
            texts = [[], _spread(ax, at_end[enders], names_of(enders), enders_colours, whole, tails)]
    _write_names(ax, texts, (first, last))
    rooms = [NAME_GAP + WIDER * max(text_width(name) for _, _, name, _ in column) if column else 0 for column in texts]
    own = max(wide - rooms[0] - inside * sum(rooms[1:]), wide / 3)
    left = (last - first) * rooms[0] / own
    ticks = MaxNLocator(min(tick_count(ax.xaxis, 5), max(2, int(own / TICK_ROOM))), steps=STEPS).tick_values(
        first, last
    )
    ax.set_xticks([x for x in ticks if first <= x <= last])
    ax.set_xlim(first - left, last)
    ax.spines["bottom"].set_bounds(first, last)  # names have their room before time begins


def _write_names(
    ax: Axes, texts: Sequence[Sequence[tuple[float, float, str, str]]], times: tuple[float, float]
) -> None:
    """Write the columns of names: at the left of the first time, and at the right of the last."""
    for side, column in zip((-1, 1), texts, strict=False):
        for height, place, name, colour in column:
            line = {"arrowstyle": "-", "color": colour, "linewidth": 0.4, "shrinkA": 0, "shrinkB": 0, "clip_on": False}
            gap = 2 / text_width(name)  # the line begins beside the name: nothing is to be cut off
            line |= {"patchA": None, "relpos": (1 + gap if side < 0 else -gap, 0.5)}
            turned = "right" if side < 0 else "left"
            style: dict[str, Any] = {"ha": turned, "multialignment": turned, "color": colour, "linespacing": 1}
            style |= {"va": "center" if "\n" in name else "center_baseline"}
            style |= {"fontsize": NAME_SIZE, "parse_math": False, "annotation_clip": False, "arrowprops": line}
            style["path_effects"] = HALO
            start, moved = (times[side > 0], height), (side * 8, place)
            ax.annotate(name, start, moved, textcoords=("offset points", "data"), **style)


def share_times(named: Sequence[Axes], every: Sequence[Axes], rows: int) -> None:
    """Give all panels, in so many rows, the same times, with room for names at the left; the last row tells them."""
    longest = max(named, key=lambda ax: ax.get_xlim()[1])
    last, ticks = longest.get_xlim()[1], longest.get_xticks()
    names = max(-ax.get_xlim()[0] / np.ptp(ax.get_xlim()) for ax in named)
    for ax in every:
        ax.set_xticks(ticks)
        ax.set_xlim(-last * names / (1 - names), last)
        ax.spines["bottom"].set_bounds(0, last)
        spec = ax.get_subplotspec()
        ax.tick_params(labelbottom=spec is None or spec.rowspan.stop == rows)


def _deadline(run: Trajectory | AgentsTrajectory) -> float:
    """Return the time at which agents are where they should be; the last instant where there is no such time."""
    prescribed = isinstance(run, AgentsTrajectory) or run.protocol.prescribed
    return float(run.protocol.gain.T) if prescribed else float(run.t[-1])


def _seen_until(run: Trajectory | AgentsTrajectory, values: np.ndarray) -> float:
    """Return the time up to which something is to be seen."""
    T, last = _deadline(run), float(run.t[-1])
    after = np.nan_to_num(values[:, run.t > T])
    calm = not after.size or np.ptp(after, axis=1).max() <= CALM * np.ptp(np.nan_to_num(values))
    return min(last, (AFTER if calm else LATEST) * T)


def _rooms(ax: Axes, shown: float) -> tuple[float, float, float]:
    """Return the width of axes in points, how much of it names may take, and the share in it of names behind the lines.

    The time that is ``shown`` is given in units of that up to ``T``. Axes that have a fixed place have room for names
    behind the lines on their right.
    """
    points = 72 / ax.figure.dpi
    spec = ax.get_subplotspec()
    if fixed := spec is None or ax.figure.figure.get_layout_engine() is None:  # type: ignore[union-attr]
        wide = ax.get_window_extent().width * points
        panel = wide + 2 * AXIS_ROOM
    else:
        panel = ax.figure.bbox.width * points * len(spec.colspan) / spec.get_gridspec().ncols
        wide = panel - AXIS_ROOM
    return wide, max(wide + AXIS_ROOM * fixed - TIME_SHARE * panel * shown, 0), 1.0 - fixed


def _spread(
    ax: Axes,
    heights: np.ndarray,
    names: Sequence[str],
    colours: Sequence[str],
    letters: int,
    tails: Sequence[str] = (),
) -> list[tuple[float, float, str, str]]:
    """Return heights of lines, heights of their names, which do not overlap, names with their tails, and colours.

    Lines that cannot be told apart there share one name, of one colour; those with tails, all that have the same one.
    Names have so many ``letters`` in a line.
    """
    alike = tails if any(tails) else colours
    tails = tails or [""] * len(names)
    scale, limits = ax.yaxis.get_transform(), ax.get_ylim()
    low, high = scale.transform(np.array(limits))
    height = 0.75 * ax.get_window_extent().height / ax.figure.dpi * 72  # in points, when labels have their room
    gap = 1.2 * NAME_SIZE / height * (high - low)
    at = np.clip(scale.transform(np.clip(np.nan_to_num(heights), *limits)), low, high)
    groups: list[list[int]] = []
    for k in np.argsort(at, kind="stable"):
        if groups and at[k] - at[groups[-1][0]] < gap / 6:
            at[k] = at[groups[-1][0]]
        same = [own for own in groups if alike[k] == alike[own[0]] and (tails[k] or at[k] == at[own[0]])]
        if same:
            same[0].append(int(k))
        else:
            groups.append([int(k)])
    texts = [_written([names[k] for k in sorted(own)], tails[own[0]], letters) for own in groups]
    if any(tails) and gap * sum(1 + text.count("\n") for text in texts) > high - low:  # wider, but apart
        wide = NAME_LENGTH + max(map(columns, tails))
        texts = [_written([names[k] for k in sorted(own)], tails[own[0]], wide) for own in groups]
    rows = np.array([1 + text.count("\n") for text in texts])
    sizes = min(gap, (high - low) / rows.sum()) * rows
    place = np.array([at[own[0]] for own in groups])
    steps = np.concatenate([[0], np.cumsum((sizes[1:] + sizes[:-1]) / 2)])
    least = low + sizes[0] / 2
    place = np.clip(isotonic_regression(place - steps).x, least, max(least, high - sizes[-1] / 2 - steps[-1])) + steps
    lines, places = scale.inverted().transform([at[own[0]] for own in groups]), scale.inverted().transform(place)
    return list(zip(lines, places, texts, [colours[own[0]] for own in groups], strict=True))


def _written(names: Sequence[str], tail: str, letters: int) -> str:
    """Join names with their tail, in a line or two of so many letters, and count those for which there is no room."""
    wide = min(letters, NAME_LENGTH)
    for shown in range(len(names), 0, -1):
        text = ", ".join([*names[:shown], *([f"+{len(names) - shown}"] if shown < len(names) else [])])
        if columns(text) <= NAME_LENGTH and columns(text + tail) <= letters:
            return text + tail
        head, rest = _halves(text, wide)
        if columns(rest) <= wide and columns(rest + tail) <= letters:
            break
    else:
        if len(names) > 1:
            text = f"{len(names)} agents"
            return text + (tail if columns(text + tail) <= letters else tail.replace(" ", "\n"))
    rest = shorten_text(rest, max(letters - columns(tail), 4))
    return f"{head}\n{rest}{tail}" if rest else f"{head}{tail.replace(' ', chr(10))}"


def _halves(text: str, letters: int) -> tuple[str, str]:
    """Break a text after so many letters, or after the last word of which there is not much less.

    Examples
    --------
    >>> from ptcc_certify.report.plots.camp_lines import _halves
    >>> _halves("north-sea platform", 10), _halves("unbreakable", 6)
    (('north-sea', 'platform'), ('unbrea', 'kable'))
    """
    end = max(k for k in range(1, len(text) + 1) if columns(text[:k]) <= letters or k == 1)
    breaks = [k for k in range(end // 2, end + 1) if k and (text[k - 1] in " -_./," or text[k : k + 1] == " ")]
    end = breaks[-1] if breaks and end < len(text) else end
    return text[:end].rstrip(), text[end:].lstrip()
