"""A certificate as a statement in LaTeX: a proposition with hypotheses, claims and numbers."""

from __future__ import annotations

import re
from collections import Counter
from fractions import Fraction

from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.format import producer
from ptcc_certify.protocols.latex import symbol_latex
from ptcc_certify.report.screen import structure_text
from ptcc_certify.report.texts import (
    AUTHORS,
    CHARACTERS,
    LISTED,
    TITLE,
    above,
    agent_parts,
    below,
    common_bound,
    enclosed,
    parameter_names,
    printable,
    rational,
)


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
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify, read_certificate
    >>> foes = SignedDigraph.from_edges([("a_1", "b", -1), ("b", "a_1", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     text = report_latex(read_certificate(f"{folder}/c.json"))
    >>> print(next(line for line in text.splitlines() if line.startswith("{}a")))
    {}a\_1 & leader, camp 1 & $3$ & $-1$ \\
    """
    p, graph = saved.protocol, saved.graph
    sliding, T = p.reaching, p.deadline_latex
    given = ", ".join(f"${symbol_latex(name)} = {_rational(getattr(p, name))}$" for name in parameter_names(p))
    given = given.replace(r"= \approx", r"\approx")
    parts = [
        f"% A statement that ptcc report made from a certificate: {_comment(saved.path.name)}",
        f"% SHA-256 of the file {saved.sha256}, of the graph {saved.report.sha256}",
        r"% For \input in a document with \usepackage{amsmath,graphicx}.",
        r"\begin{trivlist}",
        rf"\item[\hskip\labelsep\textbf{{{_head(saved)}}}]",
        f"Let ${graph.n_nodes}$ agents be connected by a signed digraph of ${graph.n_edges}$ edges, "
        f"${int((graph.sign < 0).sum())}$ of them negative ({_tex(structure_text(saved.structure))}), "
        "and let agent $k$ "
        + (
            r"move by $\dot x_{k} = u_{k} + d_{k}$ with $|d_{k}| \le \delta$"
            if sliding
            else r"move by $\dot x_{k} = u_{k}$"
        ),
        r"under the protocol",
        r"\begin{equation*}",
        p.latex(),
        r"\end{equation*}",
        f"with {given}.",
        *_claims(saved, T),
        *_decay(saved, T),
        *_input(saved),
        *_limits(saved),
        r"\end{trivlist}",
        *_states(saved),
        *_figures(figures or {}, saved.path.stem),
        *_source(saved),
    ]
    return "\n".join(parts) + "\n"


def _head(saved: Certificate) -> str:
    """Call a certified statement a proposition, and no other."""
    return (
        "Proposition (certified)." if saved.verdict == "certified" else "Verified statements (certificate undecided)."
    )


def _claims(saved: Certificate, T: str) -> list[str]:
    """Return what the theorems say of the graph, claimed only where it is certified."""
    counted = sorted(Counter(saved.claims).items(), key=lambda item: item[0].theorem)
    if saved.constant:
        kept = "its state" if saved.direct else r"$x_{k} - \sigma_{k}$"
        return [f"No agent listens to another: each keeps {kept}."]
    whatever = ", whatever the disturbances" if saved.protocol.reaching else ""
    proved = saved.verdict == "certified"
    lines = []
    for claim, count in counted:
        whole = f"On {count} component(s) of the graph, " if len(saved.claims) > 1 else ""
        said = f"{claim.behaviour} occurs at ${T}${whatever}, by Theorem~{claim.theorem}"
        if not proved:
            said = f"the hypotheses of Theorem~{claim.theorem} ({claim.behaviour} at ${T}$) hold"
        lines.append(f"{(whole + said)[0].upper()}{(whole + said)[1:]}.")
    if saved.degenerate:
        lines.append(f"From the start below, leader group {', '.join(map(str, saved.degenerate))} meets at $0$.")
    return lines


def _decay(saved: Certificate, T: str) -> list[str]:
    """Return the inequality of the decay, and what may be left before the deadline, rounded to the safe side."""
    if saved.rate is None or saved.prefactor is None:
        return []
    z = {"||E||^2": "E", "||eps||^2": r"\varepsilon"}[saved.document["prefactor"]["of"]]
    whole = f"({T})" if "+" in T else T
    rate, factor = _below(saved.rate, 6), _above(saved.prefactor, 4)
    begin = "0" if saved.direct else "T_{r}"
    since = "s(t)" if saved.direct else f"(s(t) - s({begin}))"
    said = {
        "E": "$E = -L X$, $L$ being the signed Laplacian,",
        r"\varepsilon": r"the deviation $\varepsilon$ of $X$ from its weighted signed mean",
    }
    lines = [
        f"For every start and ${begin} \\le t < {T}$, {said[z]} obeys",
        r"\begin{gather*}",
        rf"\|{z}(t)\|^2 \le {factor}\, \mathrm{{e}}^{{-{rate}\, {since}}}\, \|{z}({begin})\|^2, \\",
        rf"s(t) = \rho_{{1}} t + \rho_{{2}} \kappa \ln\frac{{{T}}}{{{T} - t}}.",
        r"\end{gather*}",
    ]
    if saved.upper_bound is not None:
        lines.append(f"The rate of no Lyapunov function exceeds ${_above(saved.upper_bound, 8)}$.")
    if saved.direct:
        shares = ((f, saved.envelope.residual(float(1 - Fraction(str(f))))) for f in FRACTIONS)
        left = ", ".join(f"${_above(share, 2)}$ at $t = {f}\\,{whole}$" for f, share in shares)
        name = "E" if saved.envelope.coordinates == "E" else r"\varepsilon"
        norm = rf"$\|{name}(0)\|$" + ("" if name == z else f", {said[name].rstrip(',')},")
        lines.append(f"Of {norm} at most the following share is left: {left}.")
    if saved.assessment.useful is False:
        lines.append("With these gains the bound says little by the deadline.")
    if not saved.direct and saved.reaching is not None:
        late = sum(r.z is None for r in saved.reaching)
        last = max((r.time for r in saved.reaching if r.z is not None), default=0.0)
        lines.append(
            f"Of the sliding variables ${len(saved.reaching) - late}$ are $0$ from $t = {_above(last, 6)}$ "
            "on, and all from $T_{r}$ on."
        )
    return lines


def _input(saved: Certificate) -> list[str]:
    """Return whether the input stays finite, and how large it gets."""
    effort = saved.effort
    if effort is None or saved.constant or effort.bounded is None:
        return []
    part = "nominal part of the input" if saved.protocol.reaching else "input"
    if not effort.bounded:
        return [f"The {part} is not bounded up to the deadline: from some starts it grows without limit."]
    lines = [f"The {part} stays bounded up to the deadline for every start."]
    if effort.peak is not None:
        whom = "from the start below"
        if effort.starts is not None:
            R = common_bound(effort.starts)
            which = "of the set that the certificate names" if R is None else rf"with $|x_{{k}}(0)| \le {_rational(R)}$"
            whom = f"from all starts {which}"
        largest, norm = (_above(x, 4) for x in (effort.peak.largest, effort.peak.norm))
        which = "It" if part == "input" else "The whole input"
        lines.append(rf"{which} satisfies $|u_{{k}}| \le {largest}$ for all $k$ and $\|u\| \le {norm}$, {whom}.")
    return lines


def _limits(saved: Certificate) -> list[str]:
    """Return what limits of the gain, noise and disturbances of the nominal protocol leave."""
    effort, lines = saved.effort, []
    for entry in () if effort is None else effort.residual:
        limits = entry.limits
        named = [rf"the gain is at most ${_rational(limits.gain_cap)}$"] if limits.gain_cap is not None else []
        if limits.stop_before is not None:
            named.append(rf"the input is $0$ from $T - {_rational(limits.stop_before)}$ on")
        if limits.sample_period is not None:
            named.append(rf"gain and input are held over periods of ${_rational(limits.sample_period)}$")
        said = [rf"$\|E(T)\| \le {_above(entry.norm, 3)}$"]
        if entry.agents is not None:
            said.append(f"every agent is within ${_above(max(entry.agents), 3)}$ of its outcome at $T$")
        if entry.largest is not None:
            said.append(rf"$|u_{{k}}| \le {_above(entry.largest, 4)}$")
        lines.append(f"If {' and '.join(named)}, then {', '.join(said)}.")
        if entry.noise is not None and entry.noisy_norm is not None and entry.noisy_largest is not None:
            norm, largest = _above(entry.noisy_norm, 3), _above(entry.noisy_largest, 4)
            bound = _rational(entry.noise)
            lines.append(rf"With noise $|n_{{k}}| \le {bound}$, $\|E(T)\| \le {norm}$ and $|u_{{k}}| \le {largest}$.")
    if effort is not None and effort.disturbed is not None:
        d = effort.disturbed
        ends = "" if d.drift is None else f", and agents end within ${_above(max(d.drift), 4)}$ of their outcome"
        more = _above(max(d.inputs), 4)
        lines.append(rf"Disturbances $|d_{{k}}| \le {_rational(d.delta)}$ add at most ${more}$ to $|u_{{k}}|${ends}.")
    return lines


def _states(saved: Certificate) -> list[str]:
    """Return the table of starts and final states."""
    if saved.start is None:
        return []
    parts, gone = agent_parts(saved), saved.sigma0 if not saved.direct else None
    heads = ["Agent", "Part", "$x_{k}(0)$"] + ([r"$\sigma_{k}(0)$"] if gone else [])
    ends = "at the deadline" if saved.verdict == "certified" else "limit, if it settles"
    heads += [ends] if saved.final_state is not None else []
    rows = []
    for k, label in enumerate(saved.graph.labels[:LISTED]):
        row = [_tex(printable(label, CHARACTERS // 2)), parts[k], f"${_rational(saved.start[k])}$"]
        row += [f"${_rational(gone[k])}$"] if gone else []
        row += [f"${_interval(saved.final_state[k])}$"] if saved.final_state is not None else []
        rows.append(_ROW + " & ".join(row) + r" \\")
    more = saved.graph.n_nodes - LISTED
    lines = [
        r"\begin{center}",
        rf"\begin{{tabular}}{{ll{'r' * (len(heads) - 2)}}}",
        r"\hline",
        " & ".join(heads) + r" \\",
        r"\hline",
        *rows,
        r"\hline",
        r"\end{tabular}",
        r"\end{center}",
    ]
    return lines + ([rf"\noindent The table leaves out ${more}$ more agents."] if more > 0 else [])


def _figures(figures: dict[str, str], stem: str) -> list[str]:
    """Return the figures, by the names of their files."""
    captions = {
        "graph": "The signed digraph: arrows point to who listens, solid from allies, dashed from opponents.",
        "decay": "Proved bounds over a simulated run (numerical), against the time left.",
    }
    return [
        f"\\begin{{figure}}[htbp]\n\\centering\n\\includegraphics[width=0.75\\linewidth]{{{file}}}\n"
        f"\\caption{{{captions[name]}}}\n\\label{{fig:{re.sub('[^A-Za-z0-9]+', '-', stem)}-{name}}}\n\\end{{figure}}"
        for name, file in figures.items()
    ]


def _source(saved: Certificate) -> list[str]:
    """Return where the theorems are from, and which file proves the numbers."""
    breakable = r"\allowbreak{}".join(saved.sha256[i : i + 8] for i in range(0, 64, 8))
    return [
        rf"\noindent Theorems: {AUTHORS}, \emph{{{TITLE}}}, manuscript. The statement follows from a certificate of "
        f"${len(saved.report.steps)}$ obligations, which the checker of "
        rf"{_tex(producer())} verified in exact arithmetic; "
        rf"SHA-256 of its file: \texttt{{{breakable}}}."
    ]


# ---------------------------------------------------------------------- texts and numbers

#: Before a label that begins with ``[``, which would else be an argument of the end of the row above.
_ROW = "{}"
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


def _comment(text: str) -> str:
    """Return a text for a comment, where nothing but ASCII is safe."""
    return "".join(c if " " <= c <= "~" else "?" for c in text)


def _rational(x: Fraction) -> str:
    """Write a rational: exactly if that is short, else marked as near."""
    return _number(rational(x))


def _interval(value: tuple[Fraction, Fraction]) -> str:
    """Write a proved interval: its number if it is one."""
    return _rational(value[0]) if value[1] == 0 else _number(enclosed(value))


def _above(x: Fraction | float, digits: int) -> str:
    """Write a positive number, rounded up."""
    return _number(above(x, digits))


def _below(x: Fraction | float, digits: int) -> str:
    """Write a positive number, rounded down."""
    return _number(below(x, digits))


def _number(text: str) -> str:
    """Turn a number as the page shows it into LaTeX."""
    signs = {"\N{MINUS SIGN}": "-", "\N{ALMOST EQUAL TO}": r"\approx", "\u00d7": r"\cdot", "\u00b1": r"\pm"}
    for sign, latex in signs.items():
        text = text.replace(sign, latex)
    return text.replace("<sup>", "^{").replace("</sup>", "}")
