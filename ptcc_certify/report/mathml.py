"""Equations of a protocol in MathML, and the letters of its parameters, as a browser sets them.

The equations are translated from the LaTeX that is printed from the protocol's own expressions. Functions take a stack
of tokens, the next one last, and leave it at what they do not translate.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from ptcc_certify.protocols import Protocol

_LETTERS = {
    "rho": "\u03c1",
    "kappa": "\u03ba",
    "mu": "\u03bc",
    "sigma": "\u03c3",
    "varsigma": "\u03c2",
    "delta": "\u03b4",
}
_OPERATORS = {"cdot": "\u22c5", "le": "\u2264", "ge": "\u2265", "ne": "\u2260", "infty": "\u221e", "-": "\u2212"}
_SUM = "<mo>\u2211</mo>"
# Tags of what stands below and above: of a letter, and of a sum.
_SCRIPTS = {"_": "msub", "^": "msup", "_^": "msubsup"}
_LIMITS = {"_": "munder", "^": "mover", "_^": "munderover"}
_TOKEN = re.compile(r"\\begin\{\w+\}|\\end\{\w+\}|\\\\|\\[A-Za-z]+|[0-9]+(?:\.[0-9]+)?|[^\s]")


def equations(protocol: Protocol) -> str:
    """Return the equations of a protocol; their LaTeX is the text in their place."""
    source = protocol.latex()
    tokens = _TOKEN.findall(source)[::-1]
    inner = _row(tokens, ())
    return f'<math display="block" alttext="{html.escape(" ".join(source.split()), quote=True)}">{inner}</math>'


def symbol(name: str) -> str:
    """Return a parameter's letter with its index."""
    match = re.fullmatch(r"([A-Za-z]+?)_?([0-9rs]?)", name)
    letters, index = (match[1], match[2]) if match else (name, "")
    return _LETTERS.get(letters, letters) + (f"<sub>{index}</sub>" if index else "")


def _row(tokens: list[str], ends: Sequence[str]) -> str:
    """Translate tokens up to one of ``ends``, which is left; scripts bind to what stands before them."""
    pieces: list[str] = []
    while tokens and tokens[-1] not in ends:
        if tokens[-1] in ("_", "^"):
            scripts = {}
            while tokens and tokens[-1] in ("_", "^"):
                mark = tokens.pop()
                scripts[mark] = _atom(tokens)
            base = pieces.pop()
            marks = "".join(mark for mark in "_^" if mark in scripts)
            tag = (_LIMITS if base == _SUM else _SCRIPTS)[marks]
            pieces.append(f"<{tag}>{base}{''.join(scripts[mark] for mark in marks)}</{tag}>")
        else:
            pieces.append(_atom(tokens))
    return f"<mrow>{''.join(pieces)}</mrow>"


def _atom(tokens: list[str]) -> str:
    """Translate one letter, number, sign or group."""
    token = tokens.pop()
    name = token.lstrip("\\")
    if token == "{":
        row = _row(tokens, ("}",))
        tokens.pop()
        return row
    if token.startswith("\\begin"):
        return _rows_of(tokens, token[7:-1])
    if token == "\\frac":
        return f"<mfrac>{_atom(tokens)}{_atom(tokens)}</mfrac>"
    if token == "\\left":
        first, inner = tokens.pop(), _row(tokens, ("\\right",))
        tokens.pop()
        return f"<mrow><mo>{first}</mo>{inner}<mo>{tokens.pop()}</mo></mrow>"
    if token in ("\\operatorname", "\\mathrm", "\\text"):
        tokens.pop()
        letters = ""
        while tokens[-1] != "}":
            letters += tokens.pop()
        tokens.pop()
        return f'<mi mathvariant="normal">{letters}</mi>'
    if token == "\\dot":
        return f"<mover>{_atom(tokens)}<mo>\u02d9</mo></mover>"
    if token == "\\sum":
        return _SUM
    if token == "\\quad":
        return '<mspace width="1em"></mspace>'
    if name in _LETTERS:
        return f"<mi>{_LETTERS[name]}</mi>"
    if name in _OPERATORS:
        return f"<mo>{_OPERATORS[name]}</mo>"
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    return f"<mi>{token}</mi>" if token.isalpha() else f"<mo>{html.escape(token)}</mo>"


def _rows_of(tokens: list[str], kind: str) -> str:
    """Translate the rows of ``aligned`` or ``cases``."""
    rows: list[list[str]] = [[]]
    while tokens[-1] != f"\\end{{{kind}}}":
        rows[-1].append(_row(tokens, ("&", "\\\\", f"\\end{{{kind}}}")))
        if tokens[-1] == "\\\\":
            rows.append([])
        if tokens[-1] in ("&", "\\\\"):
            tokens.pop()
    tokens.pop()
    sides = ("right", "left") if kind == "aligned" else ("left", "left")
    cells = "".join(
        "<mtr>"
        + "".join(f'<mtd style="text-align:{side}">{cell}</mtd>' for side, cell in zip(sides, row, strict=False))
        + "</mtr>"
        for row in rows
    )
    table = f'<mtable displaystyle="true">{cells}</mtable>'
    return table if kind == "aligned" else f'<mrow><mo stretchy="true">{{</mo>{table}</mrow>'
