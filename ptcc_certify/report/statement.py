"""A certificate as a statement in LaTeX: a proposition with hypotheses, claims, and the facts of the certificate.

Its sentences are in ``templates/statement.tex``; what is not LaTeX already is escaped where it is printed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import jinja2
from markupsafe import Markup

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.constrained_switching.claims import WindowClaim
from ptcc_certify.certificate.constrained_switching.final_states import states_of_signal
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import STABILITY
from ptcc_certify.model.agents import plant_text
from ptcc_certify.model.casadi_latex import symbol_latex
from ptcc_certify.report import html_text as texts
from ptcc_certify.report.facts.agents import claimed_of
from ptcc_certify.report.facts.claim import assumptions
from ptcc_certify.report.facts.constrained_switching import signal_text
from ptcc_certify.report.facts.late import beside_law
from ptcc_certify.report.facts.of_certificate import facts_of
from ptcc_certify.report.latex_text import latex_of_number, latex_of_sentence, latex_of_text
from ptcc_certify.report.page import THEOREM, protocol_latex
from ptcc_certify.report.page_states_table import state_rows
from ptcc_certify.report.plots.subject import ideal_text
from ptcc_certify.report.text_layout import arithmetic
from ptcc_certify.theorems.family_behaviour import DEPENDS, mode_name

#: Agents up to which ``W`` is printed (a matrix of amsmath has 10 columns), and edges up to which these are.
_MATRIX, _EDGES = 10, 60
#: Width in pt of a column of ``article`` in two columns, and of ``W = (w_kl) =`` with the brackets.
_COLUMN, _HEAD = 229, 78
#: Facts that stand elsewhere in a statement, or are of no interest in one.
_ELSEWHERE = {"graph", "family", "read", "nodes", "mode", "structure", "protocol", "claim", "function"}
_ELSEWHERE |= {"time limit", "note", "proof", "verdict"}
_DOWN_TO = "down to the dotted line, below which the integrator resolves nothing."
#: Heads of what vehicles have.
_OF_VEHICLES = {"order": "$n_{k}$", "v(0)": r"$\dot x_{k}(0)$", "a(0)": r"$\ddot x_{k}(0)$"}
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
        A proposition with hypotheses, claims and numbers; of an undecided certificate what was verified. What is not
        proved, such as what is numerical, stands behind it.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a_1", "b", -1), ("b", "a_1", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     text = report_latex(read_certificate(f"{folder}/c.json"))
    >>> print(next(line for line in text.splitlines() if line.startswith("{}a")))
    {}a\_1 & leader, camp 1 & $3$ & $-1$ \\
    """
    assert saved.source is not None
    names = texts.parameter_names(saved.protocol)
    own = _of_family(saved) if saved.of_family else _of_graph(saved)
    told = [fact for fact in facts_of(saved) if fact.head not in _ELSEWHERE and not isinstance(fact.value, dict)]
    if saved.proof.agents is not None:  # the rate of the graph alone, with which single integrators would decay
        told = [fact for fact in told if fact.head != "rate"]
    view = {
        **{"saved": saved, "certified": saved.verdict == "certified", "sliding": saved.protocol.reaching is not None},
        **{"n": len(saved.labels), "named": _named(saved.labels), "part": saved.proof.agents},
        "protocol": protocol_latex(saved),
        "beside_law": beside_law(saved),
        "parameters": [(Markup(symbol_latex(name)), getattr(saved.protocol, name)) for name in names],
        "proved": [fact for fact in told if fact.standing == "proved"],
        "unproved": [fact for fact in told if fact.standing == "unproved"],
        "begins": saved.proof.initial_positions is not None,
        "comment": _comment(saved.source.path.name),
        **{"figures": figures or {}, "stem": _stem(saved.source.path.stem), "captions": _captions(saved)},
        **{"report": saved.source.report, "arithmetic": arithmetic(saved.direct), "theorem": THEOREM},
        **{"sha256": saved.source.sha256, "broken": _broken(saved.source.sha256)},
    }
    return _environment().get_template("statement.tex").render(view | own)


def _of_graph(saved: Certificate) -> dict[str, Any]:
    """Return what the template shows of one graph alone."""
    proof = saved.graph_proof
    matrix, small = _matrix(proof.graph)
    columns, rows = _states(saved)
    heads = ["Part", *columns] if columns else []
    (structure,) = (fact for fact in facts_of(saved) if fact.head == "structure")
    claims = sorted(Counter(proof.claims).items(), key=lambda item: item[0].theorem)
    return {
        **{"family": None, "several": False, "depends": False, "matrix": matrix, "small": small},
        "modes": [] if matrix else _modes(Family.from_graph(proof.graph)),
        "n_edges": proof.graph.n_edges,
        "negative": int((proof.graph.sign < 0).sum()),
        "structure": structure,
        "claims": [(claim.behaviour, claim.special[-1:], claim.theorem, number) for claim, number in claims],
        **{
            "claims_in_all": len(proof.claims),
            "assumed": assumptions(saved),
            "assumed_of_states": assumptions(saved, states=True),
            "offsets": proof.offsets,
        },
        "plant": "" if proof.agents is None else plant_text(proof.agents.protocol.plant),
        **{"bounds": _bounds(saved), "heads": heads, "rows": rows, "windows": ""},
    }


def _of_family(saved: Certificate) -> dict[str, Any]:
    """Return what the template shows of a family alone."""
    proof = saved.family_proof
    family, components = proof.family, [part.component for part in proof.parts]
    parameters = [(mode, mode.parameters) for mode in family.modes]  # both directions of an undirected edge are one
    claims = Counter(component.sharpest for component in components)
    heads, rows = _family_states(saved)
    return {
        **{"family": family, "several": len(family.modes) > 1, "matrix": [], "modes": _modes(family)},
        "mode_names": [texts.printable(mode_name(family, k)) for k in range(len(family.modes))],
        "n_edges": sum(mode.n_edges for mode in family.modes),
        "uncertain": sum(edges.size for _, edges in parameters),
        "optional": sum(int(mode.optional[edges].sum()) for mode, edges in parameters),
        "depends": DEPENDS in claims,
        "claims": [(behaviour, (), "", number) for behaviour, number in claims.items()],
        **{
            "claims_in_all": len(components),
            "assumed": assumptions(saved),
            "assumed_of_states": assumptions(saved, states=True),
            "offsets": proof.offsets,
            "plant": "",
            "bounds": [],
        },
        "promise": "" if proof.signal == "any" else signal_text(proof.signal)[1],
        **{"heads": heads, "rows": rows, "windows": _left_by_windows(saved)},
    }


def _left_by_windows(saved: Certificate) -> str:
    """Return what joint windows leave less and less of, in symbols; nothing where no such claim is made."""
    claims = [claim for claim in saved.family_proof.restricted if isinstance(claim, WindowClaim)]
    sizes = {STABILITY: r"$\max_{k} |x_{k}(t)|$"}
    spread = r"$\max_{k} g_{k} x_{k}(t) - \min_{k} g_{k} x_{k}(t)$, where $g_{k} = \pm 1$ is the camp of agent $k$"
    within = " over the agents of a component" if len(saved.family_proof.parts) > 1 else ""
    return "; or ".join(dict.fromkeys(sizes.get(claim.behaviour, spread) + within for claim in claims))


def _captions(saved: Certificate) -> dict[str, str]:
    """Return captions that say whether the bound is proved; through a reaching phase it is integrated in floats."""
    bound = "proved bound" if saved.direct else "bound (numerical)"
    if not saved.of_family:
        decay = f"What is left of the error against the time left, both logarithmic. Thick line: the {bound} from the"
        decay += " initial state of the table, the least of those of the Lyapunov functions, which are the thin lines;"
        decay += f" dashed: that of the theorem's own. With circles: a simulated run (numerical), {_DOWN_TO}"
        if saved.trajectory is not None and saved.asked_trajectory is not None:
            decay += f" Bounds and circles: {ideal_text(saved)}; without circles: the run that was asked."
        graph = "The signed digraph: arrows point to who listens, solid from allies, dashed from opponents."
        return {"graph": graph, "decay": decay}
    graph = "The graphs: arrows point to who listens, solid from allies, dashed from opponents."
    if any(mode.parameters.size for mode in saved.family_proof.family.modes):
        graph += " A pale band is as wide as the largest weight, the line on it as the least."
    if any(mode.optional.any() for mode in saved.family_proof.family.modes):
        graph += " Dotted ones may fail."
    decay = "How far agents are from their final states, against the time left, both logarithmic. Thick line: the"
    decay += f" {bound} for every signal. Thin: simulated runs (numerical), {_DOWN_TO}"
    return {"graph": graph, "decay": decay}


def _modes(family: Family) -> list[tuple[str, list[tuple[int, int, Fraction, Fraction]]]]:
    """Return listener, source and interval of the edges of every mode of a family that has few, agents from 1."""
    modes = family.modes
    if sum(mode.n_edges for mode in modes) > _EDGES:
        return []
    return [
        (
            texts.printable(mode_name(family, number)),
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


def _bounds(saved: Certificate) -> list[tuple[Fraction, Fraction]]:
    """Return overshoot constant and rate of the functions whose least bound holds; none that another one beats."""
    own = [m for m in saved.graph_proof.envelope.functions if m.coordinates == saved.graph_proof.envelope.coordinates]
    bounds: list[tuple[Fraction, Fraction]] = []
    for c, rate in sorted((m.overshoot, m.proved_rate) for m in own):
        if bounds and bounds[-1][0] == c:
            bounds.pop()  # its rate is smaller, or the same
        if not bounds or rate > bounds[-1][1]:
            bounds.append((c, rate))
    return bounds


def _states(saved: Certificate) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return heads and rows of the table of places in a formation, and of initial and final states."""
    if (saved.initial_state is None and saved.proof.offsets is None) or saved.proof.agents is not None:
        return [], []
    heads = ("$x_{k}(0)$", _OF_VEHICLES, r"$\sigma_{k}(0)$", "at the deadline", "limit, if it settles")
    agents = range(min(saved.graph_proof.graph.n_nodes, texts.LISTED))
    numbers = (
        {} if saved.proof.offsets is None else {"$h_{k}$": [texts.rational(saved.proof.offsets[k]) for k in agents]}
    )
    if saved.initial_state is not None:
        numbers |= texts.state_columns(
            saved, heads, agents, lambda x: texts.enclosed(x) if x[1] else texts.rational(x[0])
        )
    parts = [part.removeprefix("leader of ") for part in texts.agent_parts(saved)]  # a column of two has little room
    labels = map(latex_of_text, map(_cut, saved.labels))
    return list(numbers), list(zip(labels, parts, *map(_in_math, numbers.values()), strict=False))


def _family_states(saved: Certificate) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return heads and rows of the table of camps, initial and final states."""
    rows = state_rows(saved)[: texts.LISTED]
    if not rows:
        return [], []
    labels, camps, begins, ends = zip(*rows, strict=True)
    columns = {"Camp": [Markup("--") if camp == "\N{EN DASH}" else camp for camp in camps]}
    if (places := saved.proof.offsets) is not None:
        columns["$h_{k}$"] = _in_math(map(texts.rational, places[: texts.LISTED]))
    columns["$x_{k}(0)$"] = _in_math(begins)
    for name, values in (saved.proof.vehicles or {}).items():
        columns[_OF_VEHICLES[name]] = _in_math(map(texts.rational, values[: texts.LISTED]))
    if not saved.direct:
        columns[r"$\sigma_{k}(0)$"] = _in_math(map(texts.rational, (saved.sigma0 or ())[: texts.LISTED]))
    if any(end is not None for end in ends):
        restricted = states_of_signal(saved.family_proof) != list(saved.proof.final_positions or ())
        head = "at the deadline, restricted" if restricted else "at the deadline"
        columns[head] = ["no limit claimed" if end is None else _in_math([end])[0] for end in ends]
    return list(columns), list(zip(map(latex_of_text, map(_cut, labels)), *columns.values(), strict=True))


def _in_math(numbers: Iterable[str]) -> list[Markup]:
    """Return numbers, as the page shows them, in formulas."""
    return [Markup(f"${latex_of_number(number)}$") for number in numbers]


@cache
def _environment() -> jinja2.Environment:
    """Return the template with what it may use; an unknown name is an error."""
    environment = texts.environment(
        latex_of_text,
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
        keep_trailing_newline=True,
    )
    environment.filters |= {
        **{
            "latex": Markup,
            "rational": _rational,
            "coordinate": _coordinate,
            "words": latex_of_sentence,
            "sentence": lambda fact: latex_of_sentence(fact.note),
        },
        "above": lambda x, digits: latex_of_number(texts.above(x, digits)),
        "below": lambda x, digits: latex_of_number(texts.below(x, digits)),
        "equals": lambda x: ("= " + _rational(x)).replace(r"= \approx", r"\approx"),
        "head": lambda head: latex_of_sentence(texts.head_text(head)),
        "claimed": lambda part: latex_of_sentence(claimed_of(part)),
    }
    environment.globals |= {"meanings": _MEANINGS}
    return environment


def _coordinate(text: str) -> Markup:
    """Return the letter of what decays: of the error, or of the deviation from the weighted signed mean."""
    return Markup("E" if text in ("E", "||E||^2") else r"\varepsilon")


def _rational(x: Fraction) -> Markup:
    """Write a rational: exactly if that is short, else marked as near."""
    return latex_of_number(texts.rational(x))
