"""Numbers with a decimal comma, as spreadsheets write them where semicolons or tabs separate the fields."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ptcc_certify.graphs.rationals import COMMA, THOUSANDS

_POINT = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE][+-]?\d+)?")
#: The note of a file with such numbers.
NOTE = "decimal commas: 0,5 is 0.5"


def pointed(texts: Iterable[str], commas: bool = True) -> list[str]:
    """Return texts with a point in place of the decimal comma; as they are where it may be something else.

    That is beside numbers with a point, and where each may be one with thousands, such as 1,000.

    Parameters
    ----------
    texts : iterable of str
        All texts of a column, without blanks around them.
    commas : bool
        Whether a field of this file may hold a decimal comma.

    Examples
    --------
    >>> pointed(["0,5", "-1,250", "b"]), pointed(["0,5", "1.000"]), pointed(["1,000", "-2,000"])
    (['0.5', '-1.250', 'b'], ['0,5', '1.000'], ['1,000', '-2,000'])
    """
    texts = list(texts)
    found = [text for text in texts if COMMA.fullmatch(text)] if commas else []
    if all(map(THOUSANDS.fullmatch, found)) or any(map(_POINT.fullmatch, texts)):
        return texts
    return [text.replace(",", ".") if COMMA.fullmatch(text) else text for text in texts]


def pointed_fields(rows: Sequence[Sequence[str]], commas: bool = True) -> list[list[str]]:
    """Return rows, without blanks around their fields, which are judged together; see :func:`pointed`.

    Examples
    --------
    >>> pointed_fields([["a ", "b", "0,5"], ["b"]])
    [['a', 'b', '0.5'], ['b']]
    """
    fields = iter(pointed([field.strip() for row in rows for field in row], commas))
    return [[next(fields) for _ in row] for row in rows]
