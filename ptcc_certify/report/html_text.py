"""Numbers, labels and words of a report, as HTML; numbers that were proved are rounded to the safe side.

What holds HTML is :class:`markupsafe.Markup`, which the templates print as it is; everything else they escape.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import lru_cache
from typing import Any

import jinja2
import ziamath
from markupsafe import Markup, escape
from ziamath.tex import tex2mml

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.document import producer
from ptcc_certify.errors import LABEL, LABEL_END, Change, quoted
from ptcc_certify.graphs.rationals import format_exact, nearest_float, writable
from ptcc_certify.model import Protocol
from ptcc_certify.report.text_layout import NO_BREAK

#: Labels of a list that are written out, and characters of a label.
LISTED, CHARACTERS = 30, 48
AUTHORS = "Zhen-Hua Zhu, Huaiyu Wu, Zhi-Hong Guan, Zhi-Wei Liu, Yang Chen, Xiujuan Zheng"
TITLE = "Robust prescribed-time coordination control of cooperative-antagonistic networks with disturbances"

#: What facts are of, in words, by their heads.
HEADS = {"nodes": "Their names", "read": "Read as", "family": "Family of graphs", "given": "Assumed"}
HEADS |= {
    "x(0)": "Initial state",
    "offsets": "Places",
    "v(0)": "Initial velocities",
    "sigma(0)": "Sliding variables sigma(0)",
}
HEADS |= {"alone": "Each mode alone", "groups": "What holds all the same", "box": "Where they are drawn"}
HEADS |= {"rate": "How fast", "error": "How near", "bound": "Upper bound", "function": "Lyapunov functions"}
HEADS |= {"x(T)": "Where they end", "v(T)": "Velocities at T", "a(T)": "Accelerations at T", "x(t)": "Where they stay"}
HEADS |= {"messages": "Messages", "late": "Left by then", "left": "Left"}
HEADS |= {"tracking": "How leaders are tracked", "disturbed": "Disturbances", "limited": "Within limits"}
HEADS |= dict.fromkeys(("constant", "dwell", "shares", "windows"), "If signals are restricted")
HEADS |= {"effort": "Size of the input", "claim": "What they do"}

_MINUS = "\N{MINUS SIGN}"
#: An exponent in brackets, with up to two more pairs inside.
EXPONENT = re.compile(r"\^\(((?:[^()]|\((?:[^()]|\([^()]*\))*\))*)\)")
#: Units of a formula's drawing in the size of its letters.
_EM = 200
#: Greek letters by the names that a screen gives them.
LETTERS = {
    "rho": "\u03c1",
    "kappa": "\u03ba",
    "mu": "\u03bc",
    "delta": "\u03b4",
    "Omega": "\u03a9",
    "Theta": "\u0398",
    "lambda": "\u03bb",
}
LETTERS |= {"eps": "\u03b5", "Xi": "\u039e", "Xit": "\u039e\u0303", "Phi": "\u03a6", "Psi": "\u03a8", "Pi": "\u03a0"}

# ---------------------------------------------------------------------- texts of the file


def printable(text: str, limit: int = CHARACTERS) -> str:
    """Return a text of the file fit to be shown: cut, and what is not printable written as its code."""
    short = text if len(text) <= limit else text[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return "".join(c if c.isprintable() else f"\\u{{{ord(c):x}}}" for c in short)


def label(text: str, limit: int = CHARACTERS) -> Markup:
    """Return a label; ``bdi`` keeps its direction of writing to itself."""
    return Markup("<bdi>{}</bdi>").format(printable(text, limit))


def labels(nodes: Sequence[Any], names: Sequence[str] | None = None, most: int = LISTED) -> Markup:
    """Return up to ``most`` labels, or those of nodes, and how many more there are; those of a few are cut shorter."""
    limit = CHARACTERS if most >= LISTED else CHARACTERS // 2
    listing = Markup(", ").join(label(quoted(node if names is None else names[node]), limit) for node in nodes[:most])
    return listing + (f" and {len(nodes) - most:,} more" if len(nodes) > most else "")


def labels_apart(text: str) -> list[tuple[str, bool]]:
    """Return the pieces of a sentence, and whether each is a label.

    Examples
    --------
    >>> from ptcc_certify.errors import labelled
    >>> labels_apart(f"of agent {labelled('mu1')}.")
    [('of agent ', False), ('mu1', True), ('.', False)]
    """
    pieces = re.split(f"{LABEL}([^{LABEL_END}]*){LABEL_END}?", text)
    return [(piece, number % 2 == 1) for number, piece in enumerate(pieces) if piece]


def as_parameters(change: Change) -> str:
    """Name a change as a paper does; it has no options of a command line."""
    return f"{change.field} = {change.number}" if change.number else change.field


def set_text(text: str) -> Markup:
    """Set a sentence: formulas as such, and labels as they are.

    Examples
    --------
    >>> from ptcc_certify.errors import labelled
    >>> print(set_text(f"mu1 of agent {labelled('mu1')}"))
    \u03bc<sub>1</sub> of agent <bdi>mu1</bdi>
    """
    return Markup("").join(
        label(piece, 2000) if is_label else typeset(signs(printable(piece, 2000)))
        for piece, is_label in labels_apart(text.replace(NO_BREAK, " "))
    )


def head_text(head: str) -> str:
    """Return what facts of a head are of, in words, or a text that begins with a capital."""
    return HEADS.get(head) or head[:1].upper() + head[1:]


# ---------------------------------------------------------------------- numbers


def rational(x: Fraction) -> str:
    """Write a rational: as a decimal or a quotient if that is short, else with six digits, marked as near."""
    cofactor = x.denominator
    for prime in (2, 5):
        while cofactor % prime == 0:
            cofactor //= prime
    if cofactor == 1 and writable(x):
        with localcontext(prec=5000):
            text = f"{Decimal(x.numerator) / Decimal(x.denominator):f}"
        if len(text) <= 12:
            return text.replace("-", _MINUS)
    if writable(x) and len(text := format_exact(x)) <= 14:
        return text.replace("-", _MINUS)
    return _near(x)


def _near(x: Fraction) -> Markup:
    if abs(x) > 10**300:
        return Markup("beyond {}10<sup>300</sup>").format("" if x > 0 else _MINUS)
    return "\N{ALMOST EQUAL TO}\u00a0" + power(f"{nearest_float(x):.6g}")


def power(text: str) -> Markup:
    """Write ``3e-07`` as a product with a power of ten, and a true minus sign."""
    mantissa, _, exponent = text.partition("e")
    ten = Markup("10<sup>{}</sup>").format(int(exponent or 0))
    if exponent and mantissa != "1":
        ten = Markup("{}\u00a0\u00d7\u00a0").format(mantissa) + ten
    return (ten if exponent else Markup(mantissa)).replace("-", _MINUS)


def above(x: Fraction | float, digits: int = 4) -> Markup:
    """Write a positive number, rounded up."""
    return power(up(x, digits))


def below(x: Fraction | float, digits: int = 6) -> Markup:
    """Write a positive number, rounded down."""
    return power(down(x, digits))


def enclosed(value: tuple[Fraction, Fraction]) -> str:
    """Write a proved interval: exactly, or a decimal with a radius that takes its rounding in."""
    middle, radius = value
    if radius == 0:
        text = rational(middle)
        return _near(middle) + f" ({text})" if "/" in text else text
    text = f"{nearest_float(middle):.9g}"
    if "inf" in text:
        return _near(middle)
    return power(text) + " \u00b1 " + above(radius + abs(middle - Fraction(text)), 2)


# ---------------------------------------------------------------------- letters and equations


def indexed(text: str) -> Markup:
    """Set indices: ``T_r`` with its r below."""
    return Markup(re.sub(r"\b(\w)_(\w)\b", r"\1<sub>\2</sub>", str(escape(text))))


def symbol(name: str) -> Markup:
    """Return a parameter's letter with its index: ``rho1``."""
    letters, index = re.fullmatch(r"([A-Za-z]+?)_?([0-9rs]?)", name).groups()  # type: ignore[union-attr]
    letter = LETTERS.get(letters, letters)
    return indexed(f"{letter}_{index}" if index else letter)


def signs(text: str) -> str:
    """Write minus signs of numbers, and arrows of edges, as such."""
    return re.sub(r"(?<=[= \[])-(?=\d)", "\N{MINUS SIGN}", text).replace(" -> ", " \N{RIGHTWARDS ARROW} ")


def typeset(text: str) -> Markup:
    r"""Set what a screen writes in ASCII: ``||E|| <= 2e-07``, ``lmin(Xi_F)``, ``rho2``, powers.

    Examples
    --------
    >>> print(typeset("int ||u||^2 dt <= 3e+04"), typeset("V <= e^(-rate (s - s(T_r))) V(0) at T(1-1e-6)"), sep=chr(10))
    \u222b \u2016u\u2016<sup>2</sup> dt \u2264 3\xa0\xd7\xa010<sup>4</sup>
    V \u2264 e<sup>\u2212rate (s \u2212 s(T<sub>r</sub>))</sup> V(0) at T(1\u221210<sup>\u22126</sup>)
    """
    text = re.sub(r"\b[A-Za-z]+(?![A-Za-z])", lambda word: LETTERS.get(word[0], word[0]), text)
    text = re.sub(r"(?<=[\u03c1\u03bc])(?=\d)", "_", text)
    text = re.sub(r"(?<=L)'|(?<=L_F)'", "\u2032", text)
    for plain, sign in ((" <= ", " \u2264 "), (" >= ", " \u2265 "), ("||", "\u2016")):  # a label may be ">"
        text = text.replace(plain, sign)
    text = re.sub(r"\bint (?=\u2016)", "\N{INTEGRAL} ", text)
    text = re.sub(r"(?<=\d) (?=T)", "\u00a0", text)  # the name of an instant is not broken
    text = re.sub(r"\b(T\(1)-", rf"\1{_MINUS}", text)
    shown = re.sub(r"\bl(min|max)(?=\()", "\u03bb<sub>\\1</sub>", str(indexed(text)))
    shown = re.sub(r"\b[\d.]+e[+-]?\d+\b", lambda number: str(power(number[0])), shown)
    shown = EXPONENT.sub(lambda exponent: f"<sup>{exponent[1].replace('-', _MINUS)}</sup>", shown)
    return Markup(re.sub(r"\^(\d)", r"<sup>\1</sup>", shown))


@lru_cache(maxsize=256)
def formula_svg(latex: str, inline: bool = True) -> Markup:
    r"""Draw a formula as inline SVG, in the colour and the size of the text around it; no font is needed.

    Parameters
    ----------
    latex : str
        In LaTeX, without dollar signs; it is the text for who cannot see the picture.
    inline : bool
        Whether the formula stands in a line of text; otherwise it is displayed.

    Returns
    -------
    Markup
        A text of HTML, the element ``svg``, the same for the same formula.

    Examples
    --------
    >>> print(formula_svg("-x").partition(" style")[0])
    <svg role="img" aria-label="-x" viewBox="-8 -116 298 138"
    >>> "<text" in formula_svg(r"\frac{\rho_1}{T - t}", inline=False)
    False
    """
    mathml = tex2mml(latex, inline=inline).replace('rowspacing="3pt"', 'rowspacing="0.4em"')
    before, ziamath.config.svg2 = ziamath.config.svg2, False
    try:
        drawn = ziamath.Math(mathml, size=_EM, margin=_EM / 10).svgxml()
    finally:
        ziamath.config.svg2 = before
    left, top, width, height = (round(float(x)) for x in drawn.attrib["viewBox"].split())
    shape = f"width:{width / _EM:.4g}em;height:{height / _EM:.4g}em;vertical-align:{-(top + height) / _EM:.4g}em"
    paths = [_relative_path(path.attrib["d"]) for path in drawn.iter("path")]
    bars = ({key: round(float(bar.attrib[key])) for key in ("x", "y", "width", "height")} for bar in drawn.iter("rect"))
    paths += ["M{x} {y}h{width}v{height}h-{width}z".format_map(bar) for bar in bars]
    picture = Markup('<svg role="img" aria-label="{}" viewBox="{}" style="{}"><path d="{}" fill="currentColor"/></svg>')
    return picture.format(" ".join(latex.split()), f"{left} {top} {width} {height}", shape, "".join(paths))


def _relative_path(path: str) -> str:
    """Write the whole coordinates of an SVG path from point to point, which takes half the letters."""
    x = y = 0
    steps = []
    for letter, numbers in re.findall("([MLQZ])([^MLQZ]*)", path):
        values = [round(float(number)) for number in numbers.split()]
        moved = [value - (y if k % 2 else x) for k, value in enumerate(values)]
        if values:
            x, y = values[-2:]
        if letter == "M":
            moved = values
        elif letter == "L" and not any(moved):
            continue
        steps.append((letter if letter == "M" else letter.lower()) + " ".join(map(str, moved)).replace(" -", "-"))
    return "".join(steps)


# ---------------------------------------------------------------------- words


def parameter_names(protocol: Protocol) -> list[str]:
    """Return the names of a protocol's parameters, in their order."""
    return [name for name in protocol.to_dict() if name != "kind"]


def agent_parts(saved: Certificate) -> list[str]:
    """Say of every agent which part of the graph it is in."""
    parts = ["follower"] * saved.graph_proof.graph.n_nodes
    groups = saved.graph_proof.structure.closed_components
    for k, component in enumerate(groups, start=1):
        name = f"leader of group {k}" if len(groups) > 1 else "leader"
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            camp = {1: "camp 1", -1: "camp 2", 0: "unbalanced"}[sign]
            parts[v] = f"{name}, {'alone' if len(component.nodes) == 1 else camp}"
    return parts


def state_columns(
    saved: Certificate,
    heads: tuple[str, Mapping[str, str], str, str, str],
    agents: Sequence[int],
    written: Callable[[tuple[Fraction, Fraction]], str],
) -> dict[str, list[str]]:
    """Return initial states, what vehicles have, ``sigma(0)`` and final states, as far as there are, by their heads.

    The last head is for what an undecided certificate says of the final state; ``written`` writes a proved interval.
    """
    x0, sigma0, end = saved.proof.initial_positions or (), saved.sigma0 or (), saved.graph_proof.final_positions
    columns = {heads[0]: [rational(x0[k]) for k in agents]}
    for name, values in (saved.proof.vehicles or {}).items():
        columns[heads[1][name]] = [rational(values[k]) for k in agents]
    if not saved.direct:
        columns[heads[2]] = [rational(sigma0[k]) for k in agents]
    if end is not None and (intervals := end.intervals):
        ends = heads[3] if saved.verdict == "certified" else heads[4]
        columns[ends] = [written(intervals[k]) for k in agents]
    return columns


# ---------------------------------------------------------------------- templates


def environment(finalize: Callable[[str], str], **syntax: Any) -> jinja2.Environment:
    """Return the templates; what is printed is finalized unless it is Markup, and an unknown name is an error."""
    result = jinja2.Environment(
        loader=jinja2.PackageLoader("ptcc_certify.report"),
        finalize=lambda value: value if isinstance(value, Markup) else finalize(str(value)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        **syntax,
    )
    result.globals |= {"AUTHORS": AUTHORS, "TITLE": TITLE, "LISTED": LISTED, "producer": producer()}
    return result
