"""A certificate as a statement in LaTeX: a proposition with hypotheses, claims and numbers.

Its sentences are in ``templates/statement.tex``; what is not LaTeX already is escaped where it is printed.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import jinja2
from markupsafe import Markup

from ptcc_certify.bounds.envelope import FRACTIONS, Envelope
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.certificate.judgements import largest_late_input
from ptcc_certify.certificate.restricted_bounds import deviation_of_signal, nearer_for_signal
from ptcc_certify.certificate.restricted_claims import WindowClaim
from ptcc_certify.certificate.restricted_states import states_of_signal
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import STABILITY
from ptcc_certify.protocols.casadi_latex import symbol_latex
from ptcc_certify.report import notation as texts
from ptcc_certify.report.facts.claim import box_text, range_text, sharpest, told_ranges
from ptcc_certify.report.facts.decay import BOUND_KINDS, explicit_logs
from ptcc_certify.report.facts.instants import FEW, told_instants
from ptcc_certify.report.facts.signals import signal_facts, signal_text
from ptcc_certify.report.facts.states import attained_text, constant_text
from ptcc_certify.report.page import THEOREM
from ptcc_certify.report.plots.subject import ideal_text
from ptcc_certify.report.states_table import state_rows
from ptcc_certify.report.text_layout import arithmetic
from ptcc_certify.theorems.counterexample_text import counterexample_text, mode_name
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent

#: Agents up to which ``W`` is printed (a matrix of amsmath has 10 columns), and edges up to which these are.
_MATRIX, _EDGES = 10, 60
#: Width in pt of a column of ``article`` in two columns, and of ``W = (w_kl) =`` with the brackets.
_COLUMN, _HEAD = 229, 78
_CAPTIONS = {
    "graph": "The signed digraph: arrows point to who listens, solid from allies, dashed from opponents.",
    "decay": (
        "What is left of the error against the time left, both logarithmic. Thick line: the %s from the initial state"
        " of the table, the least of those of the Lyapunov functions, which are the thin lines; dashed: that of the"
        " theorem's own. With circles: a simulated run (numerical), down to the dotted line, below which the integrator"
        " resolves nothing."
    ),
}
_FAMILY_CAPTIONS = {
    "graph": "The graphs: arrows point to who listens, solid from allies, dashed from opponents.",
    "decay": (
        "How far agents are from their final states, against the time left, both logarithmic. Thick line: the %s"
        " for every signal. Thin: simulated runs (numerical), down to the dotted line, below which the integrator"
        " resolves nothing."
    ),
}
#: What a behaviour is, in symbols.
_MEANINGS = {
    "stability": r"$x_{k}(t) \to 0$ for every $k$",
    "consensus": r"all $x_{k}(t)$ have the same limit",
    "signed-average consensus": (
        r"$x_{k}(t) \to a$ in one camp and $x_{k}(t) \to -a$ in the other, $a$ being the mean of the initial states,"
        " those of the other camp taken with the opposite sign"
    ),
    "bipartite consensus": r"for some $a$, $x_{k}(t) \to a$ in one camp and $x_{k}(t) \to -a$ in the other",
    "interval bipartite consensus": (
        r"for some $a$, the leaders tend to $a$ in one camp and to $-a$ in the other, and each follower to a limit in"
        " $[-|a|, |a|]$"
    ),
    "containment": (
        "each closed component tends to a value of its own, and each follower to a limit between the lowest and the"
        " highest of these"
    ),
    "bipartite containment": (
        "for some $a_{j}$, the agents of closed component $j$ tend to $a_{j}$ in one camp and to $-a_{j}$ in the other"
        r" ($a_{j} = 0$ if it is not balanced), and each follower to a limit in $[-\max_{j} |a_{j}|, \max_{j} |a_{j}|]$"
    ),
}


def report_latex(saved: Certificate, figures: dict[str, str] | None = None) -> str:
    r"""Return a certificate as a statement in LaTeX, to be read by ``\input``; it needs amsmath and graphicx.

    Parameters
    ----------
    saved : Certificate
        As :func:`ptcc_certify.certificate.certificate.read_certificate` reads it.
    figures : mapping of {"graph", "decay"} to str, optional
        Names of the files that are included.

    Returns
    -------
    str
        A proposition with hypotheses, claims and numbers; of an undecided certificate what was verified.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a_1", "b", -1), ("b", "a_1", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     text = report_latex(read_certificate(f"{folder}/c.json"))
    >>> print(next(line for line in text.splitlines() if line.startswith("{}a")))
    {}a\_1 & leader, camp 1 & $3$ & $-1$ \\
    """
    names = texts.parameter_names(saved.protocol)
    view = texts.facts(saved) | {
        "comment": _comment(saved.path.name),
        "parameters": [(Markup(symbol_latex(name)), getattr(saved.protocol, name)) for name in names],
        **{"structure": saved.structure, "named": _named(saved.graph.labels)},
        **dict(zip(("matrix", "small"), _matrix(saved.graph), strict=True)),
        "edges": _edges(saved.graph),
        **{"connectivity": texts.structure_text(saved.structure).partition(";")[0], "bounds": _bounds(saved)},
        "shares": _shares(saved),
        "times": [0.0, *(r.time for r in saved.reaching or () if r.z is not None)],
        **dict(zip(("columns", "rows"), _states(saved), strict=True)),
        **{"figures": figures or {}, "stem": _stem(saved.path.stem), "captions": _captions(saved)},
        "sha256": _broken(saved.sha256),
        **_late(saved),
    }
    return _environment().get_template("statement.tex").render(view)


def family_latex(saved: FamilyCertificate, figures: dict[str, str] | None = None) -> str:
    r"""Return a family's certificate as a statement in LaTeX, to be read by ``\input``; see :func:`report_latex`.

    Parameters
    ----------
    saved : FamilyCertificate
        As :func:`ptcc_certify.certificate.certificate.read_certificate` reads it.
    figures : mapping of {"graph", "decay"} to str, optional
        Names of the files that are included.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "0.5", "1.5")])
    >>> with TemporaryDirectory() as folder:
    ...     certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]).save(f"{folder}/c.json")
    ...     text = family_latex(read_certificate(f"{folder}/c.json"))
    >>> print(next(line for line in text.splitlines() if line.startswith("Consensus")))
    Consensus occurs at $T$ for every such choice: as $t \to T$, all $x_{k}(t)$ have the same limit.
    """
    assert saved.source is not None
    names = texts.parameter_names(saved.protocol)
    rows = [
        (_cut(label), Markup("--") if camp == "\N{EN DASH}" else camp, *ends)
        for label, camp, *ends in state_rows(saved)[: texts.LISTED]
    ]
    facts = _family_facts(saved)
    view = facts | {
        "comment": _comment(saved.source.path.name),
        "parameters": [(Markup(symbol_latex(name)), getattr(saved.protocol, name)) for name in names],
        **{"named": _named(saved.family.labels), "listed": _intervals(saved), "rows": rows},
        "remaining": [(_instant(saved, name), _number(bound)) for name, bound in _remaining(saved)],
        "remaining_promised": [
            (_instant(saved, name), _number(bound)) for name, bound in _remaining(saved, of_signal=True)
        ],
        **{"sigma0": saved.sigma0, "last_time": _last_time(saved)},
        "why": [counterexample_text(c, c.counterexample) for c in _depending(saved) if c.counterexample is not None],
        "restricted_tex": [_powers(text) for text in facts["restricted"]],
        "left_by_windows": _left_by_windows(saved),
        "ends_known": any(last is not None for *_, last in rows),
        **{"figures": figures or {}, "stem": _stem(saved.source.path.stem), "report": saved.checked},
        **{"sha256": _broken(saved.source.sha256), "sha256_plain": saved.source.sha256},
        **{"bound_kinds": BOUND_KINDS, "theorem": THEOREM, "captions": _family_captions(saved)},
    }
    return _environment().get_template("family_statement.tex").render(view)


def _family_facts(saved: FamilyCertificate) -> dict[str, Any]:
    """Return what the template of a family shows."""
    family, components = saved.family, [part.component for part in saved.parts]
    certified = saved.verdict == "certified"
    parameters = [(mode, mode.parameters) for mode in family.modes]  # both directions of an undirected edge are one
    return {
        **{"saved": saved, "family": family, "components": components, "certified": certified},
        "claims": list(Counter(map(sharpest, components)).items()),
        **{"claims_in_all": len(components), "several": len(family.modes) > 1},
        "n_edges": sum(mode.n_edges for mode in family.modes),
        "uncertain": sum(edges.size for _, edges in parameters),
        "optional": sum(int(mode.optional[edges].sum()) for mode, edges in parameters),
        "depends": any(c.behaviour == DEPENDS for c in components),
        "mode_names": [texts.printable(mode_name(family, k)) for k in range(len(family.modes))],
        "rate_bound": min((p.upper_bound for p in saved.parts if p.upper_bound), key=lambda b: b.value, default=None),
        "constant": all(component.nodes.size == 1 for component in components),
        "restricted": _restricted(saved) if certified else [],
        "boxes": [box_text(components[k], box) for k, box in sorted(saved.boxes.items())] if certified else [],
        "ranges": [range_text(components[k], ends) for k, ends in told_ranges(saved).items()] if certified else [],
        "promise": "" if saved.signal == "any" else signal_text(saved.signal)[1],
        "these": states_of_signal(saved) != list(saved.final_states or ()),
        "explicit_power": _explicit_power(saved),
        **{"sliding": saved.protocol.reaching is not None, "arithmetic": arithmetic(saved.direct)},
    }


def _restricted(saved: FamilyCertificate) -> list[str]:
    """Tell what is proved of restricted signals, with the ends of constant weights."""
    entries = [fact.text for fact in signal_facts(saved)]
    if text := constant_text(saved):
        entries.append(f"{signal_text('constant')[1]}: at the deadline {text}; {attained_text(saved)}")
    return entries


def _remaining(saved: FamilyCertificate, of_signal: bool = False) -> list[tuple[str, Markup]]:
    """Return the names of instants and the bound of the deviation of any agent from its final state there.

    For every signal, or for those that were asked for, where more is proved of these.
    """
    proved = nearer_for_signal(saved) if of_signal else saved.common and saved.rate is not None
    if saved.initial_state is None or not proved:
        return []
    instants = told_instants(saved.protocol, saved.direct)[:FEW]
    left = [share for share, _ in instants]
    bounds = deviation_of_signal(saved, left) if of_signal else saved.deviation_bound(left)
    return [(name, texts.above(float(x), 2)) for (_, name), x in zip(instants, bounds.max(axis=0), strict=True)]


def _explicit_power(saved: FamilyCertificate) -> int | None:
    """Return ``p`` with a rate above ``10^p`` in closed form; None if some component has none, or a better one."""
    logs = explicit_logs(saved) if saved.rate is None and saved.common else []
    return int(min(logs)) - 1 if logs else None


def _powers(text: str) -> Markup:
    """Return a text of the screen whose powers of ten are set as such."""
    return Markup(re.sub(r"\b1e(-?\d+)", r"$10^{\1}$", _tex(text)))


def _left_by_windows(saved: FamilyCertificate) -> str:
    """Return what joint windows leave less and less of, in symbols; nothing where no such claim is made."""
    claims = [claim for claim in saved.restricted if isinstance(claim, WindowClaim)]
    sizes = {STABILITY: r"$\max_{k} |x_{k}(t)|$"}
    spread = r"$\max_{k} g_{k} x_{k}(t) - \min_{k} g_{k} x_{k}(t)$, where $g_{k} = \pm 1$ is the camp of agent $k$"
    within = " over the agents of a component" if len(saved.parts) > 1 else ""
    return "; or ".join(dict.fromkeys(sizes.get(claim.behaviour, spread) + within for claim in claims))


def _last_time(saved: FamilyCertificate) -> float | None:
    """Return an instant from which on all sliding variables are proved 0; None if that is ``T_r``."""
    times = [None if r.z is None else r.time for r in saved.reaching or ()]
    return None if None in times else max((t for t in times if t is not None), default=0.0)


def _instant(saved: FamilyCertificate, name: str) -> Markup:
    """Return the name of an instant in symbols; without a reaching phase ``T`` is the sum of two parameters."""
    if saved.protocol.reaching is not None and saved.direct:
        name = name.replace("T", "(T_r + T_s)")
    return Markup(re.sub(r"_(\w)", r"_{\1}", re.sub(r"(?<=\d) (?=\(?T)", r"\,", name)))


def _captions(saved: Certificate) -> dict[str, str]:
    """Return captions that say whether the bound is proved; through a reaching phase it is integrated in floats."""
    decay = _CAPTIONS["decay"].replace("%s", _bound_word(saved))
    if saved.trajectory is not None and saved.asked_trajectory is not None:
        decay += f" Bounds and circles: {ideal_text(saved)}; without circles: the run that was asked."
    return _CAPTIONS | {"decay": decay}


def _bound_word(saved: Certificate | FamilyCertificate) -> str:
    return "proved bound" if saved.direct else "bound (numerical)"


def _family_captions(saved: FamilyCertificate) -> dict[str, str]:
    """Return captions that speak of bands and dotted edges where there are some, and of the bound as of one graph."""
    caption = _FAMILY_CAPTIONS["graph"]
    if any(mode.parameters.size for mode in saved.family.modes):
        caption += " A pale band is as wide as the largest weight, the line on it as the least."
    if any(mode.optional.any() for mode in saved.family.modes):
        caption += " Dotted ones may fail."
    return _FAMILY_CAPTIONS | {"graph": caption, "decay": _FAMILY_CAPTIONS["decay"].replace("%s", _bound_word(saved))}


def _depending(saved: FamilyCertificate) -> list[FamilyComponent]:
    return [part.component for part in saved.parts if part.component.behaviour == DEPENDS]


def _intervals(saved: FamilyCertificate) -> list[tuple[str, list[tuple[int, int, Fraction, Fraction]]]]:
    """Return listener, source and interval of the edges of every mode of a family that has few, agents from 1."""
    modes = saved.family.modes
    if sum(mode.n_edges for mode in modes) > _EDGES:
        return []
    return [
        (
            texts.printable(mode_name(saved.family, number)),
            [(int(mode.target[e]) + 1, int(mode.source[e]) + 1, *mode.edge_interval(e)) for e in range(mode.n_edges)],
        )
        for number, mode in enumerate(modes)
    ]


def _comment(name: str) -> Markup:
    """Return a file name for a comment, in which nothing is safe but ASCII."""
    return Markup("".join(c if " " <= c <= "~" else "?" for c in name))


def _stem(stem: str) -> str:
    return re.sub("[^A-Za-z0-9]+", "-", stem)


def _broken(sha256: str) -> Markup:
    """Return a hash that LaTeX may break over lines."""
    return Markup(r"\allowbreak{}".join(sha256[i : i + 8] for i in range(0, 64, 8)))


def _cut(label: str) -> str:
    return texts.printable(label, texts.CHARACTERS // 2)


def _named(labels: Sequence[str]) -> list[str]:
    """Return the labels in the order of the agents' numbers, unless they are these numbers or too many."""
    numbers = [str(k) for k in range(1, len(labels) + 1)]
    cut = [_cut(label) for label in labels[: texts.LISTED]]
    return cut if len(labels) <= texts.LISTED and cut != numbers else []


def _matrix(graph: SignedDigraph) -> tuple[list[list[Fraction]], bool]:
    """Return ``W`` of a small graph and whether it is set small; nothing if it is wider than a column of two."""
    weights = {(t, s): w for s, t, w in graph.edges} if graph.n_nodes <= _MATRIX else {}
    if not weights:
        return [], False
    rows = [[weights.get((target, source), Fraction(0)) for source in graph.labels] for target in graph.labels]
    entries = sum(max(_width(_rational(w)) for w in column) for column in zip(*rows, strict=True))
    gaps = 2 * (graph.n_nodes - 1)
    if _HEAD + entries + 5 * gaps <= _COLUMN:
        return rows, False
    return (rows, True) if 0.85 * (_HEAD + entries) + 3 * gaps <= _COLUMN else ([], False)  # \footnotesize is 0.8


def _width(number: str) -> float:
    """Estimate the width in pt of a number in LaTeX, set in 10 pt."""
    points = {"-": 7.8, ".": 2.8, ",": 2.8, "{": 0, "}": 0, " ": 0}
    return sum(points.get(c, 5) for c in re.sub(r"\\[a-z]+", "00", number))


def _edges(graph: SignedDigraph) -> list[tuple[int, int, Fraction]]:
    """Return listener, source and weight of the edges of a graph that has few, agents counted from 1."""
    number = {label: k for k, label in enumerate(graph.labels, start=1)}
    return [(number[t], number[s], w) for s, t, w in graph.edges] if graph.n_edges <= _EDGES else []


def _bounds(saved: Certificate) -> list[tuple[Fraction, Fraction]]:
    """Return overshoot constant and rate of the functions whose least bound holds; none that another one beats."""
    own = [m for m in saved.envelope.functions if m.coordinates == saved.envelope.coordinates]
    bounds: list[tuple[Fraction, Fraction]] = []
    for c, rate in sorted((m.overshoot, m.proved_rate) for m in own):
        if bounds and bounds[-1][0] == c:
            bounds.pop()  # its rate is smaller, or the same
        if not bounds or rate > bounds[-1][1]:
            bounds.append((c, rate))
    return bounds


def _shares(saved: Certificate) -> list[tuple[float, float]]:
    """Return the share of the norm where the decay begins that may be left at fractions of the time from there."""
    if saved.rate is None or saved.overshoot is None:
        return []
    envelope, p = saved.envelope, saved.protocol
    if saved.direct:
        return [(f, envelope.residual(float(1 - Fraction(str(f))))) for f in FRACTIONS]
    sliding = Envelope(envelope.structure, envelope.gain, envelope.functions)
    clocks = [float(p.rho1 * p.span) * f - float(p.rho2 * p.kappa) * math.log(1 - f) for f in FRACTIONS]
    return [(f, float(sliding.norm_factor(s * (1 - 1e-12)))) for f, s in zip(FRACTIONS, clocks, strict=True)]


def _late(saved: Certificate) -> dict[str, Fraction | float | str | None]:
    """Return what is left at ``T`` with late messages, the input, who misses it, and followers' drift after ``T``."""
    late, tracking = saved.late, saved.tracking
    missed = None if late is None else late.missed
    where = "targets" if saved.leaders_move else "final states"
    return {
        "late_largest": None if late is None or math.isinf(late.largest) else late.largest,
        "late_after": None if late is None else late.after,
        "late_input": None if late is None else largest_late_input(late, saved.protocol),
        "whole_late": f", from within 1 of the {where}" if late is not None and late.relative else "",
        "late_missed": None if missed is None else _cut(saved.graph.labels[missed.agent]),
        "tracking_after": None if tracking is None else tracking.distance_after,
    }


def _states(saved: Certificate) -> tuple[list[str], list[tuple[str, str, tuple[str, ...]]]]:
    """Return heads and rows of the table of places in a formation, and of initial and final states."""
    if saved.initial_state is None and saved.offsets is None:
        return [], []
    heads = ("$x_{k}(0)$", r"$\sigma_{k}(0)$", "at the deadline", "limit, if it settles")
    agents = range(min(saved.graph.n_nodes, texts.LISTED))
    numbers = {} if saved.offsets is None else {"$h_{k}$": [texts.rational(saved.offsets[k]) for k in agents]}
    if saved.initial_state is not None:
        numbers |= texts.state_columns(
            saved, heads, agents, lambda x: texts.enclosed(x) if x[1] else texts.rational(x[0])
        )
    labels = [_cut(label) for label in saved.graph.labels[: texts.LISTED]]
    parts = [part.removeprefix("leader of ") for part in texts.agent_parts(saved)]  # a column of two has little room
    return list(numbers), list(zip(labels, parts, zip(*numbers.values(), strict=True), strict=False))


@cache
def _environment() -> jinja2.Environment:
    """Return the template with what it may use; an unknown name is an error."""
    environment = texts.environment(
        _tex,
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
        keep_trailing_newline=True,
    )
    environment.filters |= {
        **{"latex": Markup, "rational": _rational, "coordinate": _coordinate, "number": _number},
        "above": lambda x, digits: _number(texts.above(x, digits)),
        "below": lambda x, digits: _number(texts.below(x, digits)),
        "equals": lambda x: ("= " + _rational(x)).replace(r"= \approx", r"\approx"),
    }
    environment.filters["arrows"] = lambda text: Markup(_tex(text).replace("-$>$", r"$\to$"))
    environment.globals |= {"meanings": _MEANINGS}
    return environment


# ---------------------------------------------------------------------- texts and numbers

_TEX = {c: f"\\{c}" for c in "{}$&#%_"}
_TEX |= {"\\": r"$\backslash$", "^": r"\^{}", "~": r"\~{}", "<": "$<$", ">": "$>$", "|": "$|$"}
_TEX |= {c: rf"{{\char{ord(c)}}}" for c in "\"'`"}


def _tex(text: str) -> str:
    r"""Return a text as LaTeX that every engine sets; letters beyond Latin-1 are written as their code.

    Examples
    --------
    >>> print(_tex("50% of {a}_1 \\ \u4e2d"))
    50\% of \{a\}\_1 $\backslash$ U+4E2D
    """

    def one(c: str) -> str:
        if " " <= c <= "~":
            return _TEX.get(c, c)
        if c == "\N{HORIZONTAL ELLIPSIS}":
            return "..."
        return c if "\u00c0" <= c <= "\u00ff" and c not in "\u00d0\u00de\u00f0\u00fe" else f"U+{ord(c):04X}"

    return re.sub("-(?=-)", "-{}", "".join(map(one, text)))


def _coordinate(text: str) -> Markup:
    """Return the letter of what decays: of the error, or of the deviation from the weighted signed mean."""
    return Markup("E" if text in ("E", "||E||^2") else r"\varepsilon")


def _rational(x: Fraction) -> Markup:
    """Write a rational: exactly if that is short, else marked as near."""
    return _number(texts.rational(x))


def _number(text: str) -> Markup:
    """Turn a number as the page shows it into LaTeX."""
    signs = {
        "\N{MINUS SIGN}": "-",
        "\N{ALMOST EQUAL TO}": r"\approx",
        "\u00d7": r"\cdot",
        "\u00b1": r"\pm",
        "\u00a0": " ",
    }
    for sign, latex in (signs | {"<sup>": "^{", "</sup>": "}"}).items():
        text = str(text).replace(sign, latex)
    return Markup(text)
