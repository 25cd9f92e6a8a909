"""What comments of an edge list say of its columns and directions, which nothing reads in silence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice, product

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.signs import plain, weight_and_sign
from ptcc_certify.graphs.io.table_columns import columns_of_comment, edge_columns
from ptcc_certify.graphs.io.text_matrices import is_entry
from ptcc_certify.graphs.rationals import shorten

_NO = r"\s*[:=?]\s*(false|no?|0|none|n/a)(?=\s*($|[.;,|(]|\w+\s*[:=]|-\s))"
_DONE = "(removed|replaced|dropped|deleted|split|converted|turned|merged|expanded|doubled)"
#: How comments say that edges are undirected, from their first word on; others are told as comments.
_UNDIRECTED = (
    # not "undirected: no", "undirected edges: 0", "undirected edges were removed"
    rf"undirected\b(?!{_NO}|\s+(false|no)\s*$|\s+\w+\s*:\s*0|\s+\w+\s+((has|have) been|was|were)\s+{_DONE}\b)",
    r"(weighted|signed),?\s+undirected\b",
    r"(this|it|(this|the) (graph|network)) is (an )?undirected\b",
    rf"(is[\s_]?)?directed( graph| network)?({_NO}|\s+false\s*$)",  # directed = False
    r"[\w ]*[:=]\s*undirected[\s.;,]*$",  # Type: undirected
)
#: What else comments say of undirected edges, and, where no header does, of ends.
_OF_DIRECTIONS = re.compile(r"undirected|\bsymmetric|\bnot directed|\bdirected\s*[:=]|\brevers", re.IGNORECASE)
_OF_ENDS = re.compile(
    r"\b(source|from|sender|src|tf|regulator)\b.*\b(target|to|receiver|dst|gene)\b|"
    r"\b(target|to|receiver|dst|gene)\b.*\b(source|from|sender|src|tf|regulator)\b|\blisten",
    re.IGNORECASE,
)


def note_on_rows(data: bytes) -> tuple[str, ...]:
    r"""Note comments that look like rows of edges, which a label that begins with # makes of one.

    Examples
    --------
    >>> note_on_rows(b"#Gene1,Gene2,Score\na,b,1\n#b,a,2\n")
    ('ignored as a comment: #b,a,2',)
    """
    found = re.findall(rb"^[ \t]*[#%][^\s#%,;].*$", data, re.MULTILINE)
    lines = [line for line in found if _is_row_of_edges(line.decode("utf-8", "replace").strip())]
    if not lines:
        return ()
    rest = f" and {len(lines) - 1} more" if len(lines) > 1 else ""
    return (_ignored(lines[0].decode("utf-8", "replace")) + rest,)


def note_on_names(data: bytes, n: int) -> tuple[str, ...]:
    r"""Note a comment above a matrix that has as many words as there are nodes, as ``numpy.savetxt(header=..)`` does.

    Examples
    --------
    >>> note_on_names(b"# a b\n0 1\n-1 0\n", 2)
    ('ignored as a comment: # a b; names are a first row',)
    """
    for line in islice((line.strip() for line in data[:10000].decode("utf-8", "replace").splitlines()), n):
        if line[:1] in ("#", "%") and len(re.findall(r"[^\s,;#%]+", line)) == n:
            return (f"{_ignored(line)}; names are a first row",)
    return ()


def note_on_directions(data: bytes, understood: str, width: int) -> tuple[str, ...]:
    r"""Note a comment above the rows that speaks of directions in words which are not understood here.

    The width is that of rows without a header, 0 where titles tell the ends.

    Examples
    --------
    >>> note_on_directions(b"# friends (undirected)\na,b,1\n", "", 3)
    ('ignored as a comment: # friends (undirected)',)
    >>> note_on_directions(b"# source,target,weight\na,b,1\n", "", 3)
    ()
    """
    for line in _above(data):
        titles = any(edge_columns(titles, "") for titles, _ in _titles_of(line, width))
        ends = width > 0 and not titles and _OF_ENDS.search(line)
        if not understood and (ends or _OF_DIRECTIONS.search(line)):
            return (_ignored(line),)
    return ()


def _ignored(line: str) -> str:
    return f"ignored as a comment: {shorten(line.strip())}"


def _words(line: str) -> str:
    return re.sub(r"^[\s#%]*", "", line)


def _is_row_of_edges(comment: str) -> bool:
    """Tell whether a comment has three fields or more and a number, the third of those between blanks, or a sign."""
    fields = re.split(r"\s*[,;\t]\s*", comment)
    return any(map(is_entry, fields[1:])) if len(fields) > 2 else any(map(is_entry, comment.split()[2:3]))


def undirected_by_comment(data: bytes, name: str) -> str:
    """Return what comments before the first row say of undirected edges, as KONECT and SNAP do; "" if nothing."""
    for number, line in enumerate(_above(data), 1):
        if konect := re.match(r"\s*%\s*(sym|asym|bip)\b", line):
            if konect[1] == "bip":
                mend = "give the nodes of each its own names, such as u1 and v1, and leave out this line"
                raise FormatError(f"{name}, line {number}: % bip: two sets of nodes share their numbers; {mend}")
            return "% sym" if konect[1] == "sym" else ""
        if re.match("|".join(_UNDIRECTED), _words(line), re.IGNORECASE):
            return f"the comment {shorten(line.strip())}"
    return ""


def refuse_titles(data: bytes, name: str, width: int) -> None:
    """Refuse rows without a header whose columns a comment names in another order, as numpy.savetxt writes it.

    It has as many titles as rows have fields, see :func:`_titles_of`.
    """
    for line in _above(data):
        for titles, prose in _titles_of(line, width):
            if columns := columns_of_comment(titles, name, prose):
                mend = f"remove {line.strip()[0]} before {shorten(titles[0])}"
                if None in weight_and_sign(titles, name):
                    mend += f", or tell them: --columns {columns}"
                raise FormatError(f"{name}: a comment names the columns; {mend}")


def _titles_of(line: str, width: int) -> Iterator[tuple[list[str], bool]]:
    r"""Yield so many titles of a comment, between commas, semicolons or tabs, or between blanks and any of these.

    What stands before a colon or around brackets is none of them. The second item tells that it may be prose.

    Examples
    --------
    >>> [titles for titles, _ in _titles_of("# Columns (to, from, weight)", 3)][0]
    ['to', 'from', 'weight']
    """
    text = re.sub(r"^[\w ]*:\s*", "", _words(line)).rstrip()
    inner = re.fullmatch(r"[\w ]*\(([^()]*)\)", text)
    separators = (",", ";", r"\t", r"[,;\t ]")
    for told, separator in product([text] if inner is None else [inner[1], text], separators):
        titles = [title.strip(" \"'") for title in re.split(rf"\s*{separator}\s*(?![^(]*\))", told)]
        if len(titles) == width == len(set(map(plain, titles))) and not re.search("[./:]", "".join(titles)):
            yield titles, len(separator) > 2


def _above(data: bytes) -> Iterator[str]:
    r"""Yield the lines above the first row, which are comments or empty.

    Examples
    --------
    >>> [*_above(b"# a\n\n%b\n1,2,1\n# c\n")]
    ['# a', '', '%b']
    """
    begins, text = 0, data.removeprefix(b"\xef\xbb\xbf")
    while begins < len(text):
        found = re.compile(rb"\r\n|\r|\n").search(text, begins)
        ends = found.end() if found else len(text)
        line = text[begins:ends].decode("utf-8", "replace").rstrip("\r\n")
        if line.strip()[:1] not in "#%":
            return
        yield line
        begins = ends
