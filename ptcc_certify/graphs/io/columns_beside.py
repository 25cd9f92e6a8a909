"""Columns and attributes of edges beside those that are read, which may hold the signs of weights that tell sizes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ptcc_certify.errors import NumberError
from ptcc_certify.graphs.io.signs import DIRECTIONS, is_sign, plain, sign_of_word
from ptcc_certify.graphs.rationals import MINUS, parse_exact, shorten

#: How a note begins of columns that are not read.
IGNORED = "columns ignored"
#: Different values of a column up to which it may hold signs; of one with more, only a negative number counts.
_MOST = 1000
_NO, _YES = ("false", "no", "0", "f", "n", "0.0"), ("true", "yes", "1", "t", "y", "1.0")
_UNKNOWN = ("", "?", "na", "n/a", "nan", "none", "null", "unknown", "neutral", "0")
#: What says that a row goes the other way, or both: arrows in any column, words where the title speaks of directions.
_BACK = ("<-", "<--", "<->", "<-->", "<=", "<=>")
_BACK_WORDS = ("back", "backward", "backwards", "reverse", "reversed", "both", "bidirectional", "mutual", "in", "left")
#: Titles of columns whose yes is a minus, whose no is one, and of columns with signed numbers.
_MINUS = (
    r"neg(?!oti)|inhib|repress|suppress|antagon|enem[iy]|foe|oppos|opponent|hostil|(?<!ar)rival|distrust|dislike|minus|"
    r"down(regul|$)|disagree|conflict"
)
_PLUS = (
    r"pos(itive|$)|activat|excit|promot|stimul|induc|^all(y|ies|iance)|friend|(?<!dis)trust|(?<!dis)like(?!li)|plus|"
    r"(?<!dis)agree|upregul|(?<!un)(?<!non)cooperat"
)
_SIGNED = r"(?<!de)(?<!as)sign(?!if|al)|sgn|polarity|valence|attitude|stance|effect|mode$"
_SIZES = r"weight|rating|value|score|strength|trust|coef|corr|influence|beta|^w$"


@dataclass
class Column:
    """Values of one column or attribute: that of row r is ``values[codes[r]]``; without codes there are many."""

    title: str
    values: dict[str, int] = field(default_factory=dict)
    codes: list[int] | None = field(default_factory=list)

    def add(self, value: Any) -> None:
        """Take the value of the next row."""
        text = str(value).strip()
        if self.codes is not None:
            self.codes.append(self.values.setdefault(text, len(self.values)))
            if len(self.values) > _MOST:
                self.codes = None
        elif text[:1] == "-" and len(self.values) <= _MOST + 1:
            self.values.setdefault(text, len(self.values))


def column_of(title: str, values: Iterable[Any]) -> Column:
    """Return a column that is held whole.

    Examples
    --------
    >>> column_of("mode", ["activates", "inhibits", "activates"]).codes
    [0, 1, 0]
    """
    column = Column(title)
    for value in values:
        column.add(value)
    return column


@dataclass(frozen=True)
class Verdict:
    """What a column may be: ``words`` or ``numbers`` that are signs, ``directions``, ``turned``, ``doubt``, or none."""

    kind: str = ""
    value: str = ""  # that makes it so
    named: bool = False  # is it named in full where it is not read?


def verdict(title: str, values: Sequence[str]) -> Verdict:
    """Tell what a column may be beside weights.

    Examples
    --------
    >>> verdict("mode", ["inhibits", "activates"]).kind, verdict("s", ["1", "-1"]).kind, verdict("year", ["1999"]).kind
    ('words', 'numbers', '')
    >>> verdict("is_negative", ["1", "0"]).kind, verdict("rating", ["-5", "3"]).kind
    ('doubt', 'doubt')
    """
    written, texts = plain(title), [text.lower() for text in values]
    signed = re.search(rf"{_MINUS}|{_PLUS}|{_SIGNED}", written) is not None
    if (one := _undirected(written, texts)) is not None:
        return Verdict("directions", values[one], True)
    back = (*_BACK, *_BACK_WORDS) if re.fullmatch(r"(edge)?(dir(ection)?|arrow)s?(type|mode)?", written) else _BACK
    if turned := [text for text in values if text.lower() in back]:
        return Verdict("turned", turned[0], True)
    words = {text: sign_of_word(text) for text in texts}
    if minus := [text for text in values if words[text.lower()] == -1]:
        letters = [text for text in minus if text[:1].isalpha()]
        if None not in words.values():
            return Verdict("words" if letters or 1 in words.values() else "doubt", minus[0], True)
        rest = {text for text, word in words.items() if word is None}
        if rest <= {""} or (letters and (1 in words.values() or signed or rest <= {*_UNKNOWN})):
            return Verdict("doubt", (letters or minus)[0], True)
    if set(texts) <= {*_NO, *_YES}:
        polar = _YES if re.search(_MINUS, written) else _NO if signed else ()
        mixed = set(texts).isdisjoint(_NO) is False if re.search(_SIGNED, written) else True
        odd = [text for text in values if text.lower() in polar]
        return Verdict("doubt" if odd and mixed else "", odd[0] if odd else "", signed)
    numbers = {text: _number(text) for text in values}
    negative = [text for text, number in numbers.items() if number is not None and number < 0]
    if negative and all(number in (1, -1) for number in numbers.values()):
        return Verdict("numbers", negative[0], True)
    if negative and (signed or re.search(_SIZES, written)):
        return Verdict("doubt", negative[0], True)
    return Verdict("", "", signed or bool(negative))


def signs_beside_intervals(columns: Iterable[Column], rows: Iterable[Sequence[Any]], undirected: bool = False) -> str:
    """Return why a column beside uncertain weights is refused: it may hold their signs; "" if none does.

    Parameters
    ----------
    columns : iterable of Column
    rows : iterable of sequence
        What is told of the weight of every edge: a weight, or the ends of an interval.
    undirected : bool
        Whether all edges go both ways.

    Examples
    --------
    >>> signs_beside_intervals([column_of("mode", ["inhibits"])], [[1, 2]]).partition(";")[0]
    'column "mode" holds inhibits beside the weights'
    >>> signs_beside_intervals([column_of("mode", ["inhibits"])], [[-2, -1]])
    ''
    """
    signs = [{str(x).strip()[:1] in ("-", MINUS) for x in row if x is not None and str(x).strip()} for row in rows]
    positive = not any(True in told for told in signs)
    for column in columns:
        values = [*column.values]
        what = verdict(column.title, values)
        if what.kind == "directions" and undirected and {*directions(column.title, values)} == {"undirected"}:
            continue
        held = is_sign(column.title) and next((x for x in values if DIRECTIONS.get(x.lower()) is not False), "")
        if not held and what.kind and (positive or what.kind in ("directions", "turned")):
            held = what.value
        if not held and what.kind and column.codes is not None:
            minus = [None if (sign := _sign_of(value)) is None else sign < 0 for value in values]
            pairs = zip(column.codes, signs, strict=True)
            held = next((values[k] for k, told in pairs if minus[k] is not None and told == {not minus[k]}), "")
        if held:
            mend = "write signs into the weights or both ends of the intervals, and leave the column out"
            if what.kind == "directions":
                mend = "write a row for each direction and leave the column out, or say --undirected of all rows"
            elif what.kind == "turned":
                mend = "exchange the ends of these rows, or write both directions, and leave the column out"
            return f'column "{shorten(column.title)}" holds {shorten(held)} beside the weights; {mend}'
    return ""


def _sign_of(text: str) -> int | None:
    """Return the sign that a word or 1 and -1 stand for; None of other texts."""
    if (word := sign_of_word(text)) is not None:
        return word
    number = _number(text)
    return int(number) if number in (1, -1) else None


def notes_on_ignored(columns: Iterable[Column]) -> tuple[str, ...]:
    """Note the columns that are not read: first, in full, those that hold or name what may be signs.

    Examples
    --------
    >>> notes_on_ignored([column_of("year", ["1999"]), column_of("ally_sign", ["1"])])
    ('perhaps signs, ignored: "ally_sign"', 'columns ignored: "year"')
    """
    columns = list(columns)
    named = [column for column in columns if verdict(column.title, [*column.values]).named]
    others = [f'"{shorten(column.title)}"' for column in columns if column not in named]
    told = [f'"{shorten(column.title)}"' for column in named]
    notes = (f"perhaps signs, ignored: {', '.join(told)}",) if told else ()
    return (*notes, f"{IGNORED}: {', '.join(others[:20])}") if others else notes


def is_signed(title: str) -> bool:
    """Tell whether a title is one of signs, in other words than those that are read."""
    return re.search(_SIGNED, plain(title)) is not None


def is_size(title: str) -> bool:
    """Tell whether a title is one of weights, in other words than those that are read."""
    return re.search(_SIZES, plain(title)) is not None


def directions(title: str, values: Sequence[str]) -> list[str]:
    """Write the values of a column that tells directions as ``directed`` and ``undirected``.

    Examples
    --------
    >>> directions("directed", ["true", "false"])
    ['directed', 'undirected']
    """
    texts = [text.lower() for text in values]
    return ["undirected" if _both_ways(plain(title), text) else "directed" for text in texts]


def _undirected(title: str, texts: Sequence[str]) -> int | None:
    """Return the position of the first value that says undirected; None of a column that tells no directions."""
    asked = title in ("directed", "isdirected", "undirected", "isundirected", "bidirectional")
    if not set(texts) <= {*DIRECTIONS, *((*_NO, *_YES) if asked else ())}:
        return None
    return next((k for k, text in enumerate(texts) if _both_ways(title, text)), None)


def _both_ways(title: str, text: str) -> bool:
    return text == "undirected" or text in (_NO if title in ("directed", "isdirected") else _YES)


def _number(text: str) -> Any:
    try:
        return parse_exact(text)
    except NumberError:
        return None
