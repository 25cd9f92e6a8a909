"""Text for a terminal: how many columns it takes, lists, intervals and names shortened to fit, long lines wrapped."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from fractions import Fraction

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.errors import LABEL, LABEL_END, labelled, quoted, unlabelled

#: Columns of a screen, and of the head of a line on it, blank included.
WIDTH, HEAD = 80, 11
#: Columns of the text beside the head.
TEXT = WIDTH - HEAD
#: A blank at which no line is broken; printed as a blank.
NO_BREAK = "\N{NO-BREAK SPACE}"


def columns(text: str) -> int:
    """Return the columns that a text takes at most: 2 for a wide letter, 1 for any other, none for marks of labels.

    Examples
    --------
    >>> columns("abc"), columns("日本")
    (3, 4)
    """
    text = unlabelled(text)
    return len(text) if text.isascii() else sum(1 + (unicodedata.east_asian_width(c) in "WF") for c in text)


def printable(text: str) -> str:
    r"""Return a text with ``?`` for what would steer a terminal, marks of labels apart.

    Examples
    --------
    >>> printable("a\x1b[31m")
    'a?[31m'
    """
    shown = {LABEL, LABEL_END}
    return text if text.isprintable() else "".join(c if c.isprintable() or c in shown else "?" for c in text)


def shorten_text(text: str, width: int) -> str:
    """Cut the end of a text that takes more columns than ``width``, and mark the cut.

    Examples
    --------
    >>> shorten_text("abcdefgh", 6), shorten_text("abc", 6)
    ('abc...', 'abc')
    """
    return text if columns(text) <= width else _cut(text, width - 3) + "..."


def shorten_label(label: str, width: int = 24) -> str:
    """Cut a long label before its end: labels that begin alike often differ there.

    Examples
    --------
    >>> shorten_label("school of mathematics, room 12")
    'school ...atics, room 12'
    """
    return label if columns(label) <= width else f"{_cut(label, 7)}...{_cut(label[::-1], width - 10)[::-1]}"


def agent_text(label: str, width: int = 24) -> str:
    """Return a label, shortened, as it stands in a sentence."""
    shown = printable(unlabelled(label))
    return labelled(shorten_label(shown, width + len(shown) - len(quoted(shown))))


def shorten_list(words: Sequence[str], width: int = 90, total: int = 0) -> str:
    """List as many words as fit, and tell how many there are: ``total``, if these are the first of more.

    Examples
    --------
    >>> shorten_list(["ann", "bob", "eve", "daniel", "zoe"], 25), shorten_list(["ann"], 25)
    ('ann, ... (5 in all)', 'ann')
    """
    ending = f", ... ({max(total, len(words)):,} in all)"
    room = width - columns(ending)
    used, fitting = 0, 0
    for number, word in enumerate(words, start=1):
        used += columns(word) + (2 if number > 1 else 0)
        if used > width:
            break
        fitting = number if used <= room else fitting
    if used <= width and total <= len(words):
        return ", ".join(words)
    if fitting:
        return ", ".join(words[:fitting]) + ending
    return shorten_label(words[0], room) + ending if max(total, len(words)) > 1 else shorten_text(words[0], width)


def value_list(labels: Sequence[str], values: Iterable[object], width: int = 4 * TEXT) -> str:
    """List the value of every node, long labels shortened."""
    entries = [f"{agent_text(label)}={short_number(value)}" for label, value in zip(labels, values, strict=True)]
    return shorten_list(entries, width)


def short_number(value: object) -> str:
    """Write a number with five digits, to nearest, a rational as a quotient if that is short and exact alone.

    Examples
    --------
    >>> short_number(Fraction(-1, 3)), short_number(Fraction(1, 2)), short_number(Fraction(2, 3001))
    ('-1/3', '0.5', '0.00066644')
    """
    try:
        decimal = f"{float(value):.5g}"  # type: ignore[arg-type]
    except OverflowError:
        return near(Fraction(value), 5)  # type: ignore[call-overload]
    if not isinstance(value, Fraction) or Fraction(decimal) == value:
        return decimal
    short = abs(value.numerator) < 1000 and value.denominator < 1000
    return str(value) if short else decimal


def interval_text(ends: tuple[Fraction, Fraction] | None) -> str:
    """Tell an interval, rounded outwards.

    Examples
    --------
    >>> interval_text((Fraction(1, 3), Fraction(2, 3))), interval_text((Fraction(1), Fraction(1)))
    ('in [0.33333, 0.66667]', 'at 1')
    """
    if ends is None:
        return "no limit is claimed"
    low, high = ends
    return f"at {short_number(low)}" if low == high else f"in [{down(low, 5)}, {up(high, 5)}]"


def intervals_text(labels: Sequence[str], states: Sequence[tuple[Fraction, Fraction] | None], width: int) -> str:
    """Tell the intervals of agents, those with the same one together.

    Examples
    --------
    >>> both = (Fraction(0), Fraction(1))
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(intervals_text(["a", "b", "c"], [both, both, None], 80))
    'a, b in [0, 1], c no limit is claimed'
    >>> intervals_text(["a", "b"], [both, both], 80)
    'every agent in [0, 1]'
    """
    groups: dict[str, list[str]] = {}
    for label, ends in zip(labels, states, strict=True):
        groups.setdefault(interval_text(ends), []).append(agent_text(label))
    if len(groups) == 1 < len(states):
        return f"every agent {next(iter(groups))}"
    texts = [f"{shorten_list(names, 24 if width < 4 * TEXT else 4 * TEXT)} {ends}" for ends, names in groups.items()]
    return shorten_list(texts, width)


def wrap_text(text: str, width: int = TEXT) -> list[str]:
    """Break a text into lines of at most ``width`` columns, at blanks where there are any.

    Examples
    --------
    >>> wrap_text("the state of every agent", 10)
    ['the state', 'of every', 'agent']
    >>> wrap_text(unbroken("g e' - 3 g x'"), 10)
    ["g e'", "- 3 g x'"]
    """
    lines, line = [], ""
    for word in text.split(" "):
        longer = f"{line} {word}" if line else word
        if columns(longer) <= width:
            line = longer
            continue
        lines += [line] if line else []
        while columns(word) > width:
            head = _cut(word, width)
            lines.append(head)
            word = word[len(head) :]
        line = word
    return [one.replace(NO_BREAK, " ") for one in (*lines, line)]


def unbroken(formula: str) -> str:
    """Return a formula whose lines may only be broken before a sign between two terms.

    Examples
    --------
    >>> [term.replace(NO_BREAK, "_") for term in unbroken("3 g e - 2 g x'").split(" ")]
    ['3_g_e', "-_2_g_x'"]
    """
    return re.sub(r" (?![+-] )", NO_BREAK, formula)


def wrap_lines(lines: Iterable[str], width: int = WIDTH) -> list[str]:
    """Wrap the lines of a screen, each a head of 11 columns and a text; what continues a text is indented.

    Examples
    --------
    >>> wrap_lines(["verdict    certified, and checked"], 25)
    ['verdict    certified, and', '           checked']
    """
    return [
        (line[:HEAD] if number == 0 else " " * HEAD) + part
        for line in lines
        for number, part in enumerate(wrap_text(line[HEAD:], max(width - HEAD, 20)))
    ]


def wrap_command(words: Sequence[str], width: int = WIDTH) -> list[str]:
    r"""Write a command on lines that a shell takes as one; an option stays with its value.

    Examples
    --------
    >>> print("\n".join(wrap_command(["ptcc", "certify", "a.csv", "--T", "2", "--kappa", "1"], 30)))
    ptcc certify a.csv --T 2 \
        --kappa 1
    """
    parts: list[str] = []
    for word in words:
        if parts and not word.startswith("--"):
            parts[-1] += f" {word}"
        else:
            parts.append(word)
    lines = [parts[0]]
    for part in parts[1:]:
        if columns(lines[-1]) + columns(part) + 3 > width:
            lines[-1] += " \\"
            lines.append(f"    {part}")
        else:
            lines[-1] += f" {part}"
    return lines


def format_lines(entries: Iterable[tuple[str, str]]) -> list[str]:
    """Write each head with its text as one line, whatever its length."""
    return [f"{head:<{HEAD - 1}} {NO_BREAK.join(map(printable, text.split(NO_BREAK)))}" for head, text in entries]


def _cut(text: str, width: int) -> str:
    """Return as much of the beginning of a text as takes so many columns."""
    end, used = 0, 0
    while end < len(text) and (used := used + columns(text[end])) <= width:
        end += 1
    return text[:end]


def arithmetic(direct: bool) -> str:
    """Name the arithmetic of a proof: reaching times are enclosed in balls, unless the decay begins at 0."""
    return "exact arithmetic" if direct else "exact or ball arithmetic"
