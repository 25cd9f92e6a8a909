r"""Texts, numbers and sentences of facts as LaTeX that every engine sets."""

from __future__ import annotations

import re
from itertools import pairwise

from markupsafe import Markup

from ptcc_certify.errors import Sentence, spell
from ptcc_certify.model.casadi_latex import symbol_latex
from ptcc_certify.report.html_text import EXPONENT, LETTERS, as_parameters, labels_apart
from ptcc_certify.report.text_layout import NO_BREAK

_TEX = {c: f"\\{c}" for c in "{}$&#%_"}
_TEX |= {"\\": r"$\backslash$", "^": r"\^{}", "~": r"\~{}", "<": "$<$", ">": "$>$", "|": "$|$"}
_TEX |= {c: rf"{{\char{ord(c)}}}" for c in "\"'`"}
#: Signs of a formula, and words that are set as operators in one.
_SIGNS = {"||": r"\|", "<=": r"\le", ">=": r"\ge", "->": r"\to", "_": r"\_", "%": r"\%", "{": r"\{", "}": r"\}"}
_OPERATORS = {"int": r"\int", "dt": r"\mathrm{d}t", "min": r"\min", "Re": r"\operatorname{Re}", "sqrt": r"\sqrt"}
_OPERATORS |= {"lmin": r"\lambda_{\min}", "lmax": r"\lambda_{\max}", "sign": r"\operatorname{sign}"}
_OPERATORS |= {"eps": r"\varepsilon", "Xit": r"\tilde\Xi", "Xit_F": r"\tilde\Xi_{F}"}
#: What needs no more room beside it than LaTeX gives.
_SPACED = {"=", r"\le", r"\ge", "<", ">", "+", "-", "/", r"\to", *_OPERATORS.values()}
_TOKEN = re.compile(
    r"(?P<mantissa>\b\d[\d.]*)e(?P<exponent>[+-]?\d+)|[A-Za-z]+(?:\d|_\w+)?|\|\||<=|>=|->|[_%{}]",
)
_ROOT = re.compile(r"\\sqrt (\S+)")
#: What ends a formula.
_STOPS = (",", ";", ":", ".")
#: Words that are formulas: numbers and signs; letters other than the article, and Greek ones by their names.
_NAME = rf"([b-zA-Z]|{'|'.join(LETTERS)}|int|dt|min|Re|sqrt)(_\w)?'*(\(.*)?"
_FORMULA = re.compile(rf".*[0-9|<>=^+].*|[-/]|-?{_NAME}|(sign|lmin|lmax)\(.*")


def latex_of_text(text: str) -> Markup:
    r"""Return a text as LaTeX; letters beyond Latin-1 are written as their code.

    Examples
    --------
    >>> print(latex_of_text("50% of {a}_1 \\ \u4e2d"))
    50\% of \{a\}\_1 $\backslash$ U+4E2D
    """

    def one(c: str) -> str:
        if " " <= c <= "~":
            return _TEX.get(c, c)
        if c == "\N{HORIZONTAL ELLIPSIS}":
            return "..."
        return c if "\u00c0" <= c <= "\u00ff" and c not in "\u00d0\u00de\u00f0\u00fe" else f"U+{ord(c):04X}"

    return Markup(re.sub("-(?=-)", "-{}", "".join(map(one, text))))


def latex_of_number(text: str) -> Markup:
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


def latex_of_sentence(sentence: Sentence) -> Markup:
    r"""Return a sentence, its formulas set as such, its labels as they are.

    Examples
    --------
    >>> print(latex_of_sentence("at 0.99 T: ||E|| <= 6e-03 ||E(0)||, each within 0.025"))
    at $0.99\, T$: $\|E\| \le 6 \cdot 10^{-3}\, \|E(0)\|$, each within $0.025$
    >>> print(latex_of_sentence("E = -L x: by how much each agent differs"))
    $E = -L\, x$: by how much each agent differs
    """
    text = spell(sentence, as_parameters, marked=True).replace(NO_BREAK, " ")
    return Markup("").join(
        latex_of_text(piece) if is_label else _words(piece) for piece, is_label in labels_apart(text)
    )


def _words(text: str) -> Markup:
    """Set the library's own words: neighbours that are formulas as one, unless a comma or the like is between."""
    pieces: list[str] = []
    is_open = False
    for word in text.split(" "):
        core = word.lstrip("([{").rstrip(")]},;:.")
        is_formula = bool(_FORMULA.fullmatch(core))
        if is_formula and is_open:
            pieces[-1] += f" {word}"
        else:
            pieces.append(word if is_formula else latex_of_text(word))
        is_open = is_formula and (not word.endswith(_STOPS) or _is_open(pieces[-1].lstrip("(")))
    return Markup(" ".join(piece if isinstance(piece, Markup) else _formula(piece) for piece in pieces))


def _is_open(formula: str) -> bool:
    """Tell whether a formula has a bracket that is not closed yet."""
    return any(formula.count(left) > formula.count(right) for left, right in ("()", "[]"))


def _formula(text: str) -> str:
    """Set a formula, with punctuation and brackets that belong to the sentence outside of it."""
    before = after = ""
    while text[-1] in _STOPS or (text[-1] == ")" and text.count(")") > text.count("(")):
        text, after = text[:-1], text[-1] + after
    while text[0] == "(" and text.count("(") > text.count(")"):
        text, before = text[1:], before + "("
    return f"{before}${_in_math(text)}${after}"


def _in_math(text: str) -> str:
    words = [_TOKEN.sub(_token, word) for word in text.split(" ")]
    joined = words[0]
    for last, word in pairwise(words):
        joined += f" {word}" if {last, word} & _SPACED or last.endswith(",") else rf"\, {word}"
    return _ROOT.sub(r"\\sqrt{\1}", EXPONENT.sub(r"^{\1}", joined))


def _token(match: re.Match[str]) -> str:
    token = match[0]
    if match["mantissa"]:
        factor = "" if match["mantissa"] == "1" else rf"{match['mantissa']} \cdot "
        return f"{factor}10^{{{int(match['exponent'])}}}"
    return _SIGNS.get(token) or _OPERATORS.get(token) or symbol_latex(token)
