"""Simple interaction format: ``a activates b c``, one relation and its targets in a row."""

from __future__ import annotations

import re

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.raw_edges import Draft, Rows
from ptcc_certify.graphs.io.signs import sign_of_word
from ptcc_certify.graphs.io.text_matrices import is_number
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading


def read_sif(data: bytes, name: str, how: Reading) -> Rows:
    """Read SIF: fields between tabs where there are any, otherwise blanks; one field is a node, ``# ..`` a comment."""
    lines = lines_of(data, name)
    separator = "\t" if any("\t" in line for line in lines) else None
    draft = Draft()
    for number, line in enumerate(lines, 1):
        fields = [field.strip() for field in line.split(separator)]
        comment = line.lstrip().startswith("#")
        if (comment or len(fields) == 1) and _is_edge(line, fields):
            mend = f"separate its fields by {'tabs' if separator else 'blanks'}"
            what, mend = ("a row or a comment", 'begin a comment with "# "') if comment else ("one field here", mend)
            raise FormatError(f'{name}, line {number}: "{shorten(line.strip())}" is {what}; {mend}, or rename the node')
        if not any(fields) or comment:
            continue
        if not all(fields) or len(fields) == 2:
            mend = "write a relation b: one source, one relation, then its targets"
            raise FormatError(f'{name}, line {number}: "{shorten(line.strip())}" is no row of SIF; {mend}')
        if score := _score(fields):
            mend = "leave scores out, or write a table with a header source,target,sign,weight as .csv"
            raise FormatError(f"{name}, line {number}: {shorten(score)} is a score, not a target; {mend}")
        source = draft.nodes[fields[0]]
        for target in fields[2:]:
            draft.add(source, draft.nodes[target], fields[1], number)
    rows = draft.rows()
    rows.beside.title, rows.beside.may_be_told = "relation", False
    return rows


def _score(fields: list[str]) -> str:
    """Return a number after the first target that is none, since nodes have names or other numbers; "" without one.

    Examples
    --------
    >>> _score(["1956", "activates", "2885", "0.93"]), _score(["1956", "activates", "2885", "207"])
    ('0.93', '')
    """
    ends = [fields[0], *fields[2:3]]
    named, whole = not any(map(is_number, ends)), all(end.isdigit() or not is_number(end) for end in ends)
    return next((one for one in fields[3:] if is_number(one) and (named or (whole and not one.isdigit()))), "")


def _is_edge(line: str, fields: list[str]) -> bool:
    """Tell whether a line reads ``a activates b``, whatever separates its words, and does not begin with ``# ``."""
    words = fields if len(fields) > 2 else re.split(r"[\s,;]+", line.strip())
    if len(words) < 3 or words[0][:2] in ("#", "##"):
        return False
    return sign_of_word(words[1]) is not None or words[1] in ("+1", "-1") or (words is fields and words[1] == "1")
