"""The page of a certificate: one file of HTML that loads nothing and runs no script.

Its sentences are in ``templates/``, which Jinja2 fills: every text of the file is made printable, cut, and escaped.
"""

from __future__ import annotations

import math
import re
import shlex
from collections import Counter
from collections.abc import Sequence
from datetime import date
from fractions import Fraction
from functools import cache
from importlib import resources
from itertools import groupby, islice
from typing import Any

import jinja2
from markupsafe import Markup

from ptcc_certify.bounds.final_state import extremes
from ptcc_certify.certificate.certificate import Certificate, RejectedCertificate
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.obligations import VerifiedObligation
from ptcc_certify.graphs.io.graph_files import reading_flags
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.size_limits import DRAWN_NODES, LABELLED_NODES
from ptcc_certify.report import notation as texts
from ptcc_certify.report.agents_page import agents_view
from ptcc_certify.report.family_page import family_view
from ptcc_certify.report.figures import draw, inline_figure
from ptcc_certify.report.late_lines import late_lines, tracking_lines
from ptcc_certify.report.notation import above, agent_parts, enclosed, printable, rational
from ptcc_certify.report.plots.agents import camp_groups
from ptcc_certify.report.plots.distributions import plot_degrees, plot_final_states
from ptcc_certify.report.plots.subject import ideal_text, limits_text
from ptcc_certify.report.structure_text import camps, remarks_on
from ptcc_certify.report.told_instants import FEW as FEW_INSTANTS
from ptcc_certify.report.told_instants import told_instants
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.table import THEOREMS

#: Agents up to which each has a row, and how many there are of either extreme above; leader groups that have a row.
ROWS, EXTREMES, GROUPS = 60, 10, 12
#: Agents up to which the first screen tells where each of them ends, and labels of a list there.
FEW = 8


def report_html(
    saved: Certificate | FamilyCertificate,
    *,
    no_run: str = "no run was asked for",
    runs: Sequence[Trajectory] = (),
    day: date | None = None,
) -> str:
    """Return a certificate as one page of HTML that loads nothing and runs no script.

    The first screen is the answer in words; the same certificate makes the same page on the same day.

    Parameters
    ----------
    saved : Certificate or FamilyCertificate
        As :func:`ptcc_certify.certificate.certificate.read_certificate` reads it; with a trajectory
        (:meth:`Certificate.with_simulation`) there are figures of bound and input. One of a family may be undecided.
    no_run : str
        Why there is no trajectory, for the page.
    runs : sequence of Trajectory
        Of a family, for figures of bound and input.
    day : date, optional
        The day that the page gives as that of its writing; today by default.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("<b>", "b", -1), ("b", "<b>", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     page = report_html(read_certificate(f"{folder}/c.json"))
    >>> "<h1>Signed-average consensus at T = 1</h1>" in page, "<bdi>&lt;b&gt;</bdi>" in page, "<b>" in page
    (True, True, False)
    """
    template = "family_page.html" if isinstance(saved, FamilyCertificate) else "page.html"
    part = None if isinstance(saved, FamilyCertificate) else saved.agents
    report = saved.checked
    more = {"no_run": no_run, "obligations": [] if report is None else _obligations(report)}
    if part is not None:
        template, shown = "agents_page.html", agents_view(saved, part)  # type: ignore[arg-type]
    else:
        shown = family_view(saved, runs) if isinstance(saved, FamilyCertificate) else _view(saved)
    return _environment().get_template(template).render(shown | _written(day) | more)


def rejected_html(error: RejectedCertificate, *, day: date | None = None) -> str:
    """Return the page of a certificate that the independent check rejects: the reason, and no claim.

    Parameters
    ----------
    error : RejectedCertificate
        What :func:`ptcc_certify.certificate.certificate.read_certificate` raised.
    day : date, optional
        The day that the page gives as that of its writing; today by default.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "c.json")
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)).save(path)
    ...     _ = path.write_text(path.read_text().replace('"rho2": "1"', '"rho2": "2"'))
    ...     try:
    ...         read_certificate(path)
    ...     except RejectedCertificate as error:
    ...         page = rejected_html(error)
    >>> "REJECTED by the independent check" in page, "consensus" in page
    (True, False)
    """
    name = printable(error.path.name, 200)
    title = f"REJECTED: {name}"
    command = printable(shlex.quote(error.path.name), 200)
    template = _environment().get_template("rejected.html")
    return template.render(title=title, name=name, quoted=command, report=error.report, **_written(day))


def _written(day: date | None) -> dict[str, str]:
    """Return the day of writing, as a page gives it."""
    return {"written": (day or date.today()).isoformat()}


@cache
def _environment() -> jinja2.Environment:
    """Return the templates with what they may use; what is printed is escaped, and an unknown name is an error."""
    environment = texts.environment(lambda text: printable(text, 2000), autoescape=True)
    named = ("above", "below", "indexed", "label", "labels", "plural", "power", "printable", "rational", "symbol")
    environment.filters |= {name: getattr(texts, name) for name in named}
    environment.filters |= {"camps": camps, "grouped": "{:,}".format, "flags": reading_flags, "typeset": texts.typeset}
    style = (resources.files("ptcc_certify.report") / "page.css").read_text(encoding="utf-8")
    environment.globals |= {"style": Markup(style), "inline_figure": inline_figure, "newline": Markup("\n")}
    environment.globals |= {"ROWS": ROWS, "EXTREMES": EXTREMES, "GROUPS": GROUPS, "FEW": FEW}
    environment.globals |= {"LABELLED_NODES": LABELLED_NODES}
    environment.filters |= {"merged": dict.__or__, "capitalized": lambda text: text[:1].upper() + text[1:]}
    return environment


def _view(saved: Certificate) -> dict[str, Any]:
    """Return everything that the template shows."""
    effort, report, labels = saved.effort, saved.report, saved.graph.labels
    invariant = "its state" if saved.direct else "x \u2212 \u03c3"
    title = _title(saved, invariant)
    name = shlex.quote(saved.path.name)
    name = f"./{name}" if name.startswith("-") else name
    more = f" --memory {math.ceil(report.memory)}" if report.memory > 1 else ""
    commands = [f"ptcc check {name}{more}", f"python -m ptcc_certify.checker {name}{more}"]
    notes = saved.document["unverified"].get("notes")
    peaks = effort.peak.agents if effort and effort.peak else ()
    verdict_text, larger_rho2 = _in_words(saved)
    asked = None if saved.trajectory is None else saved.asked_trajectory
    return texts.facts(saved) | {
        **{"verdict_text": verdict_text, "larger_rho2": larger_rho2},
        **{"structure": saved.structure, "protocol": saved.protocol, "invariant": invariant},
        **{"heading": texts.indexed(title), "title": title.replace("<sup>", "^").striptags()},
        "remarks": remarks_on(saved.structure),
        "equations": texts.formula_svg(saved.protocol.latex(places=saved.offsets is not None), inline=False),
        "parameters": [(name, getattr(saved.protocol, name)) for name in texts.parameter_names(saved.protocol)],
        "statements": {theorem.number: theorem.statement for theorem in THEOREMS},
        "states": _states(saved),
        "endings": _endings(saved),
        "group_sizes": sorted(Counter((len(c.nodes), c.balanced) for c in saved.structure.closed_components).items()),
        "kinds": Counter(m.kind for m in saved.envelope.functions).items(),
        "remaining": _remaining(saved),
        "reaching": list(islice(zip(labels, saved.sigma0 or (), saved.reaching or (), strict=False), ROWS)),
        "asked": "" if asked is None else limits_text(asked, saved),
        "ideal": ideal_text(saved),
        "figures": draw(saved, ("graph", "states", "sliding", "decay", "input", "late", "tracking"))
        | _distributions(saved),
        "camp_counts": Counter(camp_groups(saved.structure)[saved.structure.leaders]).items(),
        "gap": _gap(saved),
        "late_lines": [*late_lines(saved), *tracking_lines(saved)],
        "peak_agent": labels[max(range(len(peaks)), key=peaks.__getitem__)] if peaks else None,
        "commands": commands,
        "notes": [note for note in notes[:5] if isinstance(note, str)] if isinstance(notes, list) else [],
    }


def _in_words(saved: Certificate) -> tuple[Markup, str]:
    """Return the verdict without options of the command line, and the ``rho2`` that leaves 1 %, empty if none."""
    text = re.sub(r"--(rho2|mu3) (\S+)(?: \([^)]*\))?", r"\1 = \2", saved.assessment.text)
    useful = re.match(r"--rho2 (\S+) .*leaves 1 %", saved.assessment.advice)
    return texts.typeset(text), useful[1] if useful else ""


def _title(saved: Certificate, invariant: str) -> Markup:
    """Say what the certificate is about."""
    claims, deadline = saved.claims, "T" if saved.protocol.reaching is None else "T_r + T_s"
    behaviour = claims[0].sharpest if len(claims) == 1 else f"{len(claims):,} components settle"
    text = Markup("{} at {} = {}").format(behaviour, deadline, rational(saved.protocol.T)).replace("= \u2248", "\u2248")
    if saved.constant:
        text = Markup("every agent keeps {}").format(invariant)
    text += " of x \N{MINUS SIGN} offsets" * (saved.offsets is not None)
    text += ", nothing late" * (saved.late is not None) + ", leaders at rest" * saved.leaders_move
    return text[:1].upper() + text[1:] if saved.verdict == "certified" else "Undecided: " + text


def _states(saved: Certificate) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the table of initial and final states: of all agents, or of those at the extremes."""
    if saved.initial_state is None:
        return [], []
    heads = ("Initial state", "\u03c3(0)", "State at the deadline", "Limit, if it settles")
    agents, parts = _tabled(saved), agent_parts(saved)
    numbers = texts.state_columns(saved, heads, agents, enclosed)
    if saved.offsets is not None:
        numbers = {"Place h": [texts.rational(saved.offsets[k]) for k in agents], **numbers}
    known = ([texts.label(saved.graph.labels[k]) for k in agents], [parts[k] for k in agents])
    return ["Agent", "Part", *numbers], [list(row) for row in zip(*known, *numbers.values(), strict=True)]


def _tabled(saved: Certificate) -> list[int]:
    """Return the agents that have a row: all, or those that end highest and lowest, from the highest on."""
    if saved.graph.n_nodes <= ROWS:
        return list(range(saved.graph.n_nodes))
    if (end := saved.final_positions) is None:
        highest, lowest = extremes(saved.initial_positions or (), EXTREMES)
    else:
        highest, lowest = extremes(end.states, EXTREMES, end.radius)
    return highest + lowest


def _endings(saved: Certificate) -> list[tuple[Markup, str]]:
    """Return agents and where they end, those together that end at the same; of many, the two extremes."""
    if (end := saved.final_positions) is None or not (intervals := end.intervals):
        return []
    agents = sorted(range(len(intervals)), key=lambda k: intervals[k], reverse=True)
    if len(agents) > FEW:
        highest, lowest = extremes(end.states, 1, end.radius)
        agents = highest + lowest
    same = groupby(agents, key=intervals.__getitem__)
    return [(texts.labels(list(nodes), saved.graph.labels, FEW), enclosed(value)) for value, nodes in same]


def _obligations(report: CheckReport) -> list[tuple[VerifiedObligation, list[VerifiedObligation]]]:
    """Return the obligations of one kind and statement together, in the order of the first of each."""
    kinds: dict[tuple[str, str, str], list[VerifiedObligation]] = {}
    for obligation in report.obligations:
        kinds.setdefault((obligation.kind, obligation.statement, obligation.lemma), []).append(obligation)
    return [(same[0], same) for same in kinds.values()]


def _distributions(saved: Certificate) -> dict[str, Any]:
    """Draw where agents end and whom they listen to, of a graph that is too large to be drawn."""
    if saved.graph.n_nodes <= DRAWN_NODES:
        return {}
    ends = {} if saved.final_state is None else {"final": plot_final_states(saved).figure}
    return ends | ({"degrees": plot_degrees(saved.graph).figure} if saved.graph.n_edges else {})


def _remaining(saved: Certificate) -> list[tuple[str, ...]]:
    """Return the instants, what may be left then of the norm, and of the deviation from the final state, rounded up."""
    if not saved.envelope.functions or saved.rate is None or (not saved.direct and saved.initial_state is None):
        return []
    p = saved.protocol
    instants = [] if saved.direct else [(float(p.span / p.T), "T_r")]
    instants += told_instants(p, saved.direct)[:FEW_INSTANTS]
    remaining = [left for left, _ in instants]
    bounds = map(saved.envelope.residual, remaining) if saved.direct else saved.norm_bound(remaining).tolist()
    columns = [[above(x, 2) for x in bounds]]
    if saved.initial_state is not None and any(m.deviation is not None for m in saved.envelope.functions):
        columns.append([above(float(x), 2) for x in saved.deviation_bound(remaining).max(axis=0)])
    return list(zip((texts.instant(name) for _, name in instants), *columns, strict=True))


def _gap(saved: Certificate) -> Fraction | None:
    """Return how far the end of the repeated run is from the proved final state."""
    if saved.trajectory is None or saved.final_state is None:
        return None
    pairs = zip(saved.trajectory.final_state.tolist(), saved.final_state.intervals or (), strict=True)
    return Fraction(max(abs(float(x) - nearest_float(middle)) for x, (middle, _) in pairs))
