"""A certificate at a glance: who listens to whom beside every agent's run in its proved tube, the bounds in words."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.certificate.graph_proof import tube_of
from ptcc_certify.errors import ParameterError, SimulationError, spell
from ptcc_certify.graphs.size_limits import DRAWN_NODES, LABELLED_NODES, REPEATED_NODES
from ptcc_certify.report.facts.claim import assumptions
from ptcc_certify.report.facts.of_certificate import facts_of
from ptcc_certify.report.plots.camp_lines import (
    LINE_AGENTS,
    camp_groups,
    draw_agents,
    draw_deadlines,
    name_agents,
    named_of_part,
)
from ptcc_certify.report.plots.decay import NothingDecays
from ptcc_certify.report.plots.distributions import plot_final_states
from ptcc_certify.report.plots.final_colours import at_deadline, colours_at_end, final_states, positions_of
from ptcc_certify.report.plots.graph import INSIDE, delays_of, node_id, plot_graph
from ptcc_certify.report.plots.sizes import DOUBLE_COLUMN, SINGLE_COLUMN, current_sizes
from ptcc_certify.report.plots.style import BEHIND, BOUND, STYLE, finished, legend_columns, new_axes, shown, time_label
from ptcc_certify.report.plots.subject import read_back, trajectory_of
from ptcc_certify.report.plots.tracking import plot_tracking
from ptcc_certify.report.plots.trajectory import agents_run, plot_formation, plot_trajectory
from ptcc_certify.report.text_layout import NO_BREAK, columns
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.family_behaviour import DEPENDS

#: Height of the panels in inches, and how much wider the runs are drawn than the graph.
_HIGH, _RATIO = 3.0, 1.35
#: The share of the height of the graph's panel that its legend has, or more where it has many rows.
_BELOW = 0.16
#: Inches that panels have on a slide, however long the words above them are.
_LEAST_HIGH = 2.0
#: Inches below which one stands above the other; their heights, and what each agent beyond eight adds for its names.
_NARROW, _STACKED, _MORE = 5.0, (2.7, 2.5), 0.11
#: Inches from line to line of the title, and of the words below it.
_TITLE, _LINE = 0.17, 0.14
#: What is told above the panels: the claim as the title, and of each row of heads the first fact that there is.
_TOLD = (("late", "tracking", "limited", "error"), ("input",), ("disturbed",))
#: Colours of a verdict: whether everything asked was proved.
_GOOD, _DOUBT = "#117733", "#8A5A00"
#: Characters of an inch of text; of the title, which is larger.
_CHARACTERS, _OF_TITLE = 16.5, 11.8
#: The least share of the error that is drawn.
_LEAST = 1e-9
#: Up to when runs are shown, in units of ``T``.
_LAST = 1.04
#: How long steps of a bound are, in units of ``T``, whose corners are not joined.
_FLAT = 0.1
#: How dark tubes of all agents are together.
_SHADE = 0.7
#: Agents of which every one is named; of more those that begin highest and lowest. Up to how many lines are thick.
_EACH, _THICK = LABELLED_NODES, 12


def plot_glance(
    subject: Any,
    *,
    runs: Sequence[Any] | None = None,
    words: bool = True,
    time_unit: str = "",
    stacked: bool | None = None,
) -> Figure:
    """Draw a certificate at a glance.

    Above: the claim, the verdict, and in words how near agents are to where they end, and with what input. Left: who
    listens to whom, every agent in the colour of its state at ``T`` - blue above 0, red below, grey at 0 - leaders
    outlined, the second camp as squares. Right: the run of every agent in the same colour, shaded where it is proved to
    be, through a reaching phase of the sliding mode by bounds in floats (numerical), with its state at ``T`` at the end
    of its line: the proved final state, or under limits, with late messages or moving leaders that of the run.

    Above 40 agents the graph is drawn as its matrix and few are named, above 60 runs are drawn as ranges; above 1,000
    no run is made for this. Of families the runs are under many signals, of vehicles in the plane their ways are drawn.
    Where no initial state is asked for it is what is left of the error from every one, or the graph alone.

    Parameters
    ----------
    subject : Certificate, or its path
    runs : sequence of runs, optional
        Of a family, or one of agents of order n; by default they are simulated.
    words : bool
        Whether claim, verdict and bounds stand above.
    time_unit : str
        Of the deadline, for the label of the axis.
    stacked : bool, optional
        Whether runs stand below the graph; by default where figures are made narrower than 5 inches.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        The subject is no certificate.

    Examples
    --------
    >>> from ptcc_certify.report.plots.glance import plot_glance
    >>> foes = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
    >>> figure = plot_glance(certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5]))
    >>> [text.get_text() for text in figure.axes[1].texts]
    ['ann', 'bob', 'ann: \u22121', 'bob: 1', '$T$ = 1']
    """
    certificate = read_back(subject)
    if not isinstance(certificate, Certificate):
        what = type(certificate).__name__
        raise ParameterError(f"a glance is of a certificate, not of {what}; give certify(graph, protocol, x0)")
    sizes = current_sizes()
    stacked = sizes.widths[1] < _NARROW if stacked is None else stacked
    with style.context(STYLE):
        run = _run_of(certificate, runs)
        beside = run is not None or (certificate.initial_state is not None and _of_bounds(certificate))
        alone = not beside and not _bounded_for_all(certificate)
        n = len(certificate.labels)
        rows = _STACKED[0], _STACKED[1] + _MORE * (max(0, n - 8) if n <= _EACH else 0)
        width = SINGLE_COLUMN[0] if stacked else sizes.of(DOUBLE_COLUMN)[0]
        head = _Head.of(certificate, width) if words else None
        above = 0.0 if head is None else head.high
        high = (rows[0] if alone else sum(rows)) if stacked else _HIGH
        if sizes.shape is not None and not stacked:
            high = max(_LEAST_HIGH, width * sizes.shape - above)
        figure = Figure((width, high + above), layout="constrained")
        panels: Any = figure
        if head is not None:
            _, panels = figure.subfigures(2, 1, height_ratios=(above, high))  # type: ignore[misc]
            head.write(figure)
        ends, colours = final_states(certificate, run), colours_at_end(certificate, run)
        if alone:
            _draw_graph(panels.subfigures(1, 1), certificate, ends, colours)
            return shown(figure)
        if stacked:
            left, right = panels.subfigures(2, 1, height_ratios=rows)
        else:
            left, right = panels.subfigures(1, 2, width_ratios=(1, _RATIO))
        _draw_graph(left, certificate, ends, colours)
        if beside:
            _draw_runs(right, certificate, run, ends, runs, time_unit)
        else:
            _draw_error(new_axes(right), certificate, time_unit)
        return shown(figure)


def _run_of(certificate: Certificate, runs: Sequence[Any] | None) -> Any:
    """Return the run that is drawn of one graph; None of families, where there is none, and of too many agents."""
    part = certificate.proof.agents
    if certificate.of_family:
        return None
    if part is not None and part.initial_state is None:
        return None
    if part is None and (certificate.initial_state is None or certificate.only_drawn):
        return None  # what is proved is of all initial states
    if len(certificate.labels) > REPEATED_NODES and certificate.trajectory is None:
        return None
    if certificate.proof.late is not None and certificate.asked_trajectory is None:
        return None  # there is none with what is late, or of leaders that move
    try:
        return trajectory_of(certificate) if part is None else agents_run(runs[0] if runs else certificate)
    except SimulationError:
        return None
    except OverflowError:
        raise ParameterError("a state is beyond the range of float64; nothing is drawn of it") from None


def _of_bounds(certificate: Certificate) -> bool:
    """Tell whether runs under many signals are drawn, or bounds alone, if there are some."""
    late = certificate.proof.late
    return certificate.of_family if late is None else not certificate.of_family or late.says_something


class _Head(NamedTuple):
    """What stands above the panels: the claim, the verdict, and bounds in words."""

    title: list[str]
    lines: list[str]
    word: str
    fine: bool
    beside: bool

    @classmethod
    def of(cls, certificate: Certificate, width: float) -> Self:
        """Return what is told of a certificate, in lines for so many inches."""
        facts = [fact for fact in facts_of(certificate, details=False) if not fact.detail]
        verdict = spell(certificate.assessment.brief)
        fine = not certificate.assessment.exit_code and certificate.assessment.useful is not False
        notes = [] if fine and verdict.partition(";")[0] == "certified" else [f"verdict: {verdict}"]
        asked, told = _asked(certificate, facts)
        for heads in _TOLD:
            group = next(filter(None, ([f for f in facts if f.head == head and f is not told] for head in heads)), [])
            first = sorted(group, key=lambda fact: fact.side == "down")[:2]  # what is proved above
            notes += [f"{fact.head}: {spell(fact.note)}" for fact in first]
        word = certificate.assessment.word
        if certificate.verdict == "certified" and not word.startswith("certified"):
            word = f"asked: {word}"  # the claim itself is proved
        beside = width > _NARROW  # the verdict stands beside the title, or below it
        room = int(_OF_TITLE * (width - (0.3 + len(word) / _OF_TITLE if beside else 0)))
        claimed = [fact for fact in facts if fact.head == "claim"]
        claims = [_fitting(fact, room) for fact in claimed]
        if asked:  # the claim is of less than what was asked, and what is drawn
            ideal = assumptions(certificate)
            texts = [text.replace("".join(f", {one}" for one in ideal), "") for text in claims]
            notes.insert(not fine, f"{', '.join(ideal)}: {'; '.join(t for t in texts if t != ', '.join(ideal))}")
        title = _wrapped(asked or "; ".join(claims), room, max_lines=4, placeholder=" ...")
        if asked or len(claimed) == 1:  # else labels stand first
            title[0] = title[0][:1].upper() + title[0][1:]
        lines = [line for note in notes for line in _wrapped(note, int(_CHARACTERS * width))]
        return cls(title, lines, word, fine and not claims[0].startswith(DEPENDS), beside)

    @property
    def high(self) -> float:
        """The height in inches."""
        return 0.2 + _TITLE * (len(self.title) + (not self.beside)) + _LINE * len(self.lines)

    def write(self, figure: Figure) -> None:
        """Write all of it at the top of a figure."""
        high = float(figure.get_figheight())
        top = high - 0.06
        plain: dict[str, Any] = {"va": "top", "parse_math": False}
        for number, text in enumerate(self.title):
            figure.text(0.012, (top - number * _TITLE) / high, text, fontsize=10, weight="bold", **plain)
        begin = top - _TITLE * len(self.title)
        x, y = (0.988, top) if self.beside else (0.012, begin)
        mark: dict[str, Any] = {"fontsize": 9, "weight": "bold", "ha": "right" if self.beside else "left", "va": "top"}
        figure.text(x, y / high, self.word, color=_GOOD if self.fine else _DOUBT, **mark)
        begin -= 0.03 if self.beside else _TITLE + 0.03
        for number, text in enumerate(self.lines):
            figure.text(0.012, (begin - number * _LINE) / high, text, fontsize=7.5, color="0.25", **plain)


def _fitting(fact: Fact, characters: int) -> str:
    """Return the first of the shorter texts of a fact that fits a line, or the last; else its sentence."""
    texts = [spell(text) for text in fact.brief or (fact.note,)]
    return next((text for text in texts if len(text) <= characters), texts[-1])


def _asked(certificate: Certificate, facts: Sequence[Fact]) -> tuple[str, Fact | None]:
    """Say what is proved of late messages, moving leaders and limits of the gain, and by which fact; of others nothing.

    Examples
    --------
    >>> from ptcc_certify.report.plots.glance import _asked
    >>> asks = {"messages": LateMessages(delay="0.01", gain_cap=20), "asks": Asks(simulation=False)}
    >>> cert = certify([("a", "b", 1)], NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [1, 2], **asks)
    >>> _asked(cert, cert.facts())[0]
    'late messages under a gain cap: every agent within 0.000552 of its final state at T'
    """
    late, leaders = certificate.proof.late, certificate.proof.asked_leaders
    if late is None and leaders is None:
        if not certificate.limits or certificate.proof.agents is not None:
            return "", None
        told = next((fact for fact in facts if fact.head == "error" and fact.asked), None)
        return ("under limits of the gain: nothing is proved" if told is None else told.asked), told
    messages = None if late is None else late.messages
    parts = {
        "moving leaders": leaders is not None and leaders.speed > 0,
        "clipped inputs": leaders is not None and leaders.saturation is not None,
        "growth": leaders is not None and leaders.growth is not None,
        "disturbances": leaders is not None and leaders.disturbance > 0,
    }
    given = [name for name, there in parts.items() if there]
    if messages is not None and not messages.exact:
        given.insert(0, messages.name)
    if messages is not None and messages.vehicles is not None:
        given = [" of ".join([*given[:1], "vehicles"]), *given[1:]]
    capped = certificate.limits or (messages is not None and messages.gain_cap is not None)
    under = " ".join(filter(None, (", ".join(given), "under a gain cap" if capped else "")))
    told = next((fact for fact in facts if fact.head in ("late", "tracking", "limited") and fact.asked), None)
    return f"{under}: {'nothing is proved' if told is None else told.asked}", told


#: Blanks at which no line breaks: before a sign of percent, about equality, around numbers of theorems or T.
_TIED = re.compile(
    r" (?=%)| (?=[=\u2264] )|(?<=[=\u2264]) |(?<=Theorem) |(?<=Corollary) |(?<=within) |(?:(?<=\d)|(?<=at)) (?=T\b)"
)


def _wrapped(text: str, characters: int, **limits: Any) -> list[str]:
    """Return the lines of a text with the signs of print, in which no number is parted from what it is of.

    Examples
    --------
    >>> from ptcc_certify.report.plots.glance import _wrapped
    >>> _wrapped("consensus at T = 1 (Theorem 2.1): 5 % is left", 16)
    ['consensus', 'at T = 1', '(Theorem 2.1):', '5 % is left']
    """
    text = text.replace("<=", "\N{LESS-THAN OR EQUAL TO}").replace("||", "\N{DOUBLE VERTICAL LINE}")
    return [line.replace(NO_BREAK, " ") for line in textwrap.wrap(_TIED.sub(NO_BREAK, text), characters, **limits)]


def _draw_graph(panel: SubFigure, certificate: Certificate, ends: np.ndarray, colours: list[str] | None) -> None:
    """Draw who listens to whom, in the colours of final states; of a graph too large for that its final states."""
    subject = certificate.family_proof.family if certificate.of_family else certificate.graph_proof.structure
    if ends.size <= LABELLED_NODES:
        beside = 0.11 if max(map(columns, certificate.labels)) > INSIDE else 0.02  # labels reach beyond the nodes
        low, narrow = _BELOW, {"columnspacing": 1, "handlelength": 1.5, "handletextpad": 0.5, "frameon": False}
        for last in (False, True):  # a legend of many rows takes room from the graph
            ax = panel.add_axes((beside, low, 1 - 2 * beside, 0.98 - low))
            plot_graph(subject, ax=ax, colours=colours, delays=delays_of(certificate))
            if (legend := ax.get_legend()) is None:
                return
            texts = [text.get_text() for text in legend.get_texts()]
            handles: Any = legend.legend_handles
            legend.remove()
            number = legend_columns(texts, panel.bbox.width / panel.dpi, 3)
            legend = panel.legend(handles, texts, loc="lower center", ncols=number, **narrow)
            high = legend.get_window_extent().height / panel.bbox.height + 0.02
            if last or high <= low:
                return
            low = high
            legend.remove()
            ax.remove()
    elif ends.size <= DRAWN_NODES:
        plot_graph(subject, ax=new_axes(panel))
    elif np.isfinite(ends).all():
        plot_final_states(certificate, ax=new_axes(panel))


def _draw_runs(
    panel: SubFigure,
    certificate: Certificate,
    run: Any,
    ends: np.ndarray,
    runs: Sequence[Any] | None,
    time_unit: str,
) -> None:
    """Draw runs within what is proved of them."""
    part, late = certificate.proof.agents, certificate.proof.late
    with suppress(NothingDecays, SimulationError):
        if part is not None and part.dimension == 2:
            plot_formation(run, ax=new_axes(panel))
        elif run is None and (late is not None or certificate.proof.leaders_move):
            plot_tracking(certificate, ax=new_axes(panel), time_unit=time_unit)
        elif certificate.of_family:
            plot_trajectory(certificate, ax=new_axes(panel), runs=runs or None, time_unit=time_unit)
        else:
            _draw_run(new_axes(panel), certificate, run, ends, time_unit)


def _bounded_for_all(certificate: Certificate) -> bool:
    """Tell whether a share of the error is proved to be left, whatever the initial state."""
    return not certificate.of_family and certificate.direct and bool(certificate.graph_proof.envelope.functions)


def _draw_error(ax: Axes, certificate: Certificate, time_unit: str) -> None:
    """Draw which share of the error is left at most, from every initial state."""
    gain, envelope = certificate.protocol.gain, certificate.graph_proof.envelope
    remaining = np.geomspace(1, 1e-6, 400)
    share = np.array([envelope.residual(q) for q in remaining])
    ax.plot(gain.time_at_tau(-np.log(remaining)), share, color=BOUND, linewidth=1.8)
    ax.axvline(float(gain.T), color="black", linewidth=0.8, linestyle=":")
    ax.set_yscale("log")
    ax.set_ylim(max(float(share.min()), _LEAST), 1.5 * float(share.max()))
    z = envelope.coordinates.replace("eps", r"\varepsilon")
    ax.set_title("at most, from every initial state: proved", loc="left")
    finished(ax, time_label("time $t$", time_unit), rf"$\|{z}(t)\| \,/\, \|{z}(0)\|$")


def joined_above(t: np.ndarray, bound: np.ndarray, longest: float) -> np.ndarray:
    """Return what lies on a bound, (M,), or above it, and joins the corners of its steps that are not the longest.

    Between instants, too, it is not below a bound that falls, or rises, from the one to the other. A bound that
    does not go by steps, equal at most instants to that before, is returned as it is.

    Examples
    --------
    >>> from ptcc_certify.report.plots.glance import joined_above
    >>> joined_above(np.arange(8.0), np.array([4, 4, 4, 2, 2, 2, 2, 0.0]), 5)
    array([4. , 4. , 4. , 4. , 3.5, 3. , 2.5, 2. ])
    """
    known = np.flatnonzero(np.isfinite(bound))
    if 2 * np.count_nonzero(np.diff(bound[known]) == 0) < known.size:
        return bound
    wide, times = bound[known], t[known]
    wide = np.maximum.reduce([wide, np.append(wide[:1], wide[:-1]), np.append(wide[1:], wide[-1:])])
    change = np.flatnonzero(np.diff(wide))
    falls, begins = wide[change + 1] < wide[change], np.append(0, change + 1)
    ends = np.append(change, wide.size - 1)
    flat = times[ends] - times[begins] > longest
    kept = np.unique([0, wide.size - 1, *change[falls], *(change[~falls] + 1), *begins[flat], *ends[flat]])
    joined = bound.copy()
    joined[known] = np.interp(times, times[kept], wide[kept])
    return joined


def _draw_run(ax: Axes, certificate: Certificate, run: Any, ends: np.ndarray, time_unit: str) -> None:
    """Draw the run of every agent of one graph within its tube, with its state at ``T`` at the end of its line."""
    values, T = positions_of(run), float(run.protocol.gain.T)
    colours = colours_at_end(certificate, run) or [BEHIND] * len(values)
    ends = np.where(np.isnan(ends), at_deadline(run, values), ends)
    structure = certificate.graph_proof.structure
    if len(values) > LINE_AGENTS:
        named = draw_agents(ax, run, values, structure)
    else:
        single = isinstance(run, Trajectory)
        tube = tube_of(certificate.graph_proof, run.t, run.targets) if single else None
        # a run that has not settled says nothing of what is from T on
        proof = certificate.proof
        ideal = single and not (proof.limits or proof.late is not None or proof.leaders_move)
        until = run.t < T if ideal and not run.deadline_resolved else run.t >= 0
        for k, colour in enumerate(colours):
            width = 1.3 if len(values) <= _THICK else 0.8
            ax.plot(run.t[until], values[k][until], color=colour, linewidth=width, gid=node_id(k, "run"))
            if tube is not None and np.isfinite(tube.low[k]).any():
                shade: dict[str, Any] = {"alpha": _SHADE / max(5, len(values)), "linewidth": 0}
                half = (tube.high[k] - tube.low[k]) / 2
                wider = np.subtract(joined_above(run.t, half, _FLAT * T), half, where=np.isfinite(half), out=0 * run.t)
                low, high = tube.low[k] - wider, tube.high[k] + wider
                ax.fill_between(run.t[until], low[until], high[until], color=colour, **shade)
        named = dict(enumerate(colours))
        if len(values) > _EACH:
            group = camp_groups(structure)
            parts = [named_of_part(np.flatnonzero(group == part), values) for part in dict.fromkeys(group)]
            named = {int(v): colours[v] for v in np.concatenate(parts)}
        keys = ["colour: state at $T$"]
        if tube is not None and np.isfinite(tube.low[:, run.t < T]).any():
            keys.insert(0, "shaded: proved" if certificate.direct else "shaded: bounds in floats (numerical)")
        ax.set_title("; ".join(keys), loc="left", fontsize=7)
    seen = np.column_stack([values[:, run.t <= _LAST * T], ends])
    least, most = float(seen.min()), float(seen.max())
    room = 0.06 * (most - least) or 1.0
    ax.set_ylim(least - room, most + room)
    name_agents(ax, run, values, named, ends=True, until=_LAST * T, told=ends)
    draw_deadlines(ax, run, told=True)
    part = certificate.proof.agents
    name = "state $x_k$" if part is None and certificate.proof.vehicles is None else "position"
    finished(ax, time_label("time $t$", time_unit), f"{name}, coordinate 1" if part and part.dimension > 1 else name)
