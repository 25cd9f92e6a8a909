"""Which columns of a table hold source, target, weight and sign of its edges, and whether its first row tells that."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.columns_beside import is_signed, is_size
from ptcc_certify.graphs.io.signs import (
    SIGN,
    WEIGHT,
    family_titles,
    find,
    is_sign,
    plain,
    sign_of_word,
    weight_and_sign,
)
from ptcc_certify.graphs.io.text_matrices import is_entry, is_number
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading

_SOURCE = ("source", "from", "fromnodeid", "fromnode", "fromid", "sourcenode", "sourceid", "src", "rater")
_TARGET = ("target", "to", "tonodeid", "tonode", "toid", "targetnode", "targetid", "dst", "rated", "ratee")
#: Titles of who listens in the first column, and of who is heard in the second: they turn the direction round.
_LISTENERS = r"listen(er|s|ing)?|follower|rater|trust[eo]r|voter|receiver|hear(s|er|ing)|reader|subscriber|observer"
_HEARD = r"listens|hears|speaker|heard|followee|followed|rated|trustee|trusted|sender|writer|leader"
#: What follows the name of an end in a title, and words for either end: the first count in any column, the others,
#: which may tell times or places, only in the first two.
_REST = r"(node|vertex|gene|protein|agent|id|name|label|index)*"
_STARTS = (rf"(source|src|from){_REST}", rf"(start|origin|orig|tf|transcriptionfactor|regulator|influencer){_REST}")
_ENDS = (rf"(target|tgt|dst|to){_REST}", rf"(end|sink|dest|destination|influenced|regulated){_REST}")
#: Who may be at either end.
_SOMEBODY = r"(user|person|people|actor|member|country|state|player|character)s?"
#: Titles of times; of what is no node, and of what is no weight.
_TIME = r"(?!.*(candid|mand)ate).*(time|date|year|stamp)"
_NO_END = rf"|\W*|\d+|no|nr|id|idx|index|row|key|x|unnamed.*|(edge|link|row)(id|nr|no)?|{_TIME}|.*(?<!ac)(?<!vis)count"
_NO_WEIGHT = (
    r"(start|end|pub|publication|created|updated)?(date|year|time|(time)?stamp)|(edge|link|row|pm|pubmed)?id|doi"
)
#: Two titles that say nothing of a direction, the first is then who is heard: Gene1 and Gene2, a and b.
_NEUTRAL = r"(?P<what>.*?)(1.(?P=what)2|a.(?P=what)b|i.(?P=what)j|u.(?P=what)v|s.(?P=what)t|0.(?P=what)1)(?P<rest>\w*)"
#: Titles of weights that are entries of a matrix, where k may listen to l: a_kl, w(i,j).
_OF_MATRIX = r"[alw]\W?(ij|i,j|kl|k,l|uv|u,v)\W?"
_NO_TITLE = re.compile(r"nan|na|n/?a|none|null|inf|infinity|true|false|unknown|x|\?*", re.IGNORECASE)
#: What is to be done where no column is known to be the weight.
_TELL_ALL = "name one column weight, sign or rating, or tell the three: --columns source,target,NAME"
#: The note of a file whose header puts source and target elsewhere than source first.
BY_HEADER = "columns by header"
#: How a note ends that asks whether those who are read as heard listen, and that of a file of raters.
LISTENS = "? --edges listens"
RATERS = f"raters listen{LISTENS}"


@dataclass(frozen=True)
class Columns:
    """Positions of source, target, weight and, beside the weight, sign; the titles if the first row is a header."""

    source: int = 0
    target: int = 1
    weight: int = 2
    sign: int | None = None
    titles: tuple[str, ...] = ()
    told: bool = False  # by the option
    notes: tuple[str, ...] = ()
    asks: str = ""  # why the direction must be told
    guessed: bool = False  # the first row names no source and target, but is none of edges

    @property
    def ignored(self) -> list[int]:
        """Columns that are not read."""
        used = (self.source, self.target, self.weight, self.sign)
        return [k for k in range(len(self.titles)) if k not in used]

    @property
    def codes(self) -> str:
        """The title of a weight whose numbers would be codes of relations; "" of others."""
        title = self.titles[self.weight] if self.titles and not self.told else ""
        return title if is_sign(title) else ""


def edge_columns(row: Sequence[str], place: str) -> tuple[int, int, int | None] | None:
    """Return the columns of source, target and, if it is named, weight; None if a row names no source and target."""
    source, target = find(row, _SOURCE, place), find(row, _TARGET, place)
    return None if source is None or target is None else (source, target, weight_and_sign(row, place)[0])


def names_edges(row: Sequence[str]) -> bool:
    """Tell whether a row has a title of edges: of a source and a target, or of a weight.

    Examples
    --------
    >>> names_edges(["Gene1", "Gene2", "Type"]), names_edges(["ann", "bob", "eve"])
    (True, False)
    """
    written = {plain(field) for field in row}
    return not written.isdisjoint((*WEIGHT, *SIGN)) or not (written.isdisjoint(_SOURCE) or written.isdisjoint(_TARGET))


def columns_of(first: Sequence[str], others: Sequence[Sequence[str]], place: str, how: Reading) -> Columns:
    """Return the columns of a table from its first row and some of the others.

    Examples
    --------
    >>> columns_of(["weight", "from", "to"], [], "a.csv, line 1", Reading()).source
    1
    >>> columns_of(["Gene1", "Gene2", "Type"], [["a", "b", "-"]], "a.csv, line 1", Reading()).notes
    ('columns Gene1, Gene2, Type',)
    >>> columns_of(["Gene", "TF", "Score"], [["a", "b", "2"]], "a.csv, line 1", Reading()).source
    1
    """
    titles = tuple(field.strip() for field in first)
    if how.titles:
        return _told(titles, others, place, how)
    if edge_columns(titles, place) is not None:
        return named_columns(titles, place)
    weight, sign = weight_and_sign(titles, place)
    if len(titles) < 3 or not _is_header(titles, weight if weight is not None else 2, others, place):
        return Columns()
    _refuse_family(titles, place)
    weight = 2 if weight is None else weight
    source, target, known = _ends(titles, place)
    if not {source, target}.isdisjoint({weight, sign}):
        raise FormatError(f"{place}: {_no_ends(titles)}")
    if {source, target} == {0, 1} and not (known and _both_ends(titles)) and not _tells_weight(titles[weight]):
        _refuse_wide(titles, others, place)
    if re.fullmatch(_NO_WEIGHT, plain(titles[weight])):
        raise FormatError(f"{place}: the header names no weight; {_TELL_ALL}")
    asks = _direction(titles[source], titles[target], titles[weight], known, place)
    return Columns(source, target, weight, sign, titles, False, (_note(titles, source, target, weight),), asks, True)


def _ends(titles: Sequence[str], place: str) -> tuple[int, int, bool]:
    """Return the columns of source and target among titles other than these two, and whether a title tells them.

    Where the first two hold a word for one end alone, the other of them is the other end.
    """
    written = [plain(title) for title in titles]
    found = []
    for sure, near in (_STARTS, _ENDS):
        words = [k for k, title in enumerate(written) if re.fullmatch(rf"{sure}|{near}", title)]
        here = [k for k in words if k < 2 or re.fullmatch(sure, written[k])]
        if len(here) > 1 or (words and not here and re.fullmatch(_NEUTRAL, " ".join(written[:2])) is None):
            raise FormatError(f"{place}: {_no_ends(titles)}")
        found.append(here[0] if here else None)
    source, target = found
    if source is None and target is None:
        source, target = 0, 1
    elif source is None or target is None:
        end = target if source is None else source
        if end not in (0, 1):
            raise FormatError(f"{place}: {_no_ends(titles)}")
        source, target = (1 - end, end) if source is None else (end, 1 - end)
    pair = re.fullmatch(_NEUTRAL, " ".join(written[k] for k in (source, target)))
    told = pair or None not in found or any(re.fullmatch(_REST[:-1] + "+", written[k]) for k in (source, target))
    if len(titles) > 3 and find(titles, (*WEIGHT, *SIGN), place) not in (2, None) and not told:
        raise FormatError(f"{place}: {_no_ends(titles)}")  # of more than two columns before the weight
    if any(re.fullmatch(_NO_END, written[k]) and len(titles[k]) != 1 for k in (source, target)):
        raise FormatError(f"{place}: {_no_ends(titles)}")
    return source, target, found != [None, None]


def _refuse_wide(titles: Sequence[str], others: Sequence[Sequence[str]], place: str) -> None:
    """Refuse a matrix whose columns have other names than its rows: the second column has entries and no nodes."""
    rows = [[field.strip() for field in row] for row in others if len(row) == len(titles)]
    named = not all(is_number(row[0]) for row in rows)
    if not (rows and named and all(is_entry(text) for row in rows for text in row[1:] if text)):
        return
    ends = {row[1] for row in rows} - {""}
    if ends and (ends <= {"0", "1"} or not all(text.isdigit() for text in ends)):
        what = "looks like a matrix with names, and its rows and columns have different ones"
        raise FormatError(f"{place}: {what}; give both the same, or write rows of edges")


def _no_ends(titles: Sequence[str]) -> str:
    mend = "name two columns source and target, or tell all: --columns a,b,w"
    return f"the header {', '.join(map(shorten, titles[:20]))} names no source and target; {mend}"


def _refuse_family(titles: Sequence[str], place: str) -> None:
    if family_titles(titles):
        what = "uncertain weights or optional edges, which make a family of graphs"
        mend = "name the columns of the ends source and target"
        if edge_columns(titles, place) is not None:
            mend = "ptcc classify, certify, simulate and plot take it, and ptcc_certify.read_family"
        raise FormatError(f"{place}: {what}; {mend}")


def named_columns(titles: Sequence[str], place: str) -> Columns:
    """Return the columns of a row that names source and target; none where it is a row of edges all the same.

    The third of three titles is that of the weight, too, where it is a word for a positive sign, such as trust.
    """
    _refuse_family(titles, place)
    source, target, _ = edge_columns(titles, place) or (0, 1, None)
    if source > target and any(re.fullmatch(_STARTS[1], plain(title)) for title in titles[:2]):
        what = f"who is heard, {shorten(titles[0])} or {shorten(titles[source])}?"
        raise FormatError(f"{place}: {what} Tell the three columns: --columns source,target,NAME")
    weight, sign = weight_and_sign(titles, place)
    if weight is None:
        if is_number("".join(titles[2:3])):
            return Columns()
        rest = [k for k in range(len(titles)) if k not in (source, target)]
        if len(rest) == 1 and re.match(r"[^\W\d_]", titles[rest[0]]) and sign_of_word(titles[rest[0]]) == 1:
            note = _note(titles, source, target, rest[0])
            return Columns(source, target, rest[0], titles=tuple(titles), notes=(note,), guessed=True)
        raise FormatError(f"{place}: the header names no weight; {_TELL_ALL}")
    notes = [BY_HEADER] if source > 0 else []
    if plain(titles[source]) == "rater":
        notes.append(RATERS)
    return Columns(source, target, weight, sign, tuple(titles), notes=tuple(notes))


def _told(titles: tuple[str, ...], others: Sequence[Sequence[str]], place: str, how: Reading) -> Columns:
    """Return the columns that the option tells, by title or by number from 1."""
    at = []
    for wanted in how.titles:
        if re.fullmatch(r"[0-9]{1,4}", wanted):
            k = int(wanted) - 1
            if not 0 <= k < len(titles):
                raise FormatError(f"{place}: no column {wanted}; there are 1 to {len(titles)}")
        elif (k := find(titles, [wanted], place)) is None:  # type: ignore[assignment]
            there = ", ".join(map(shorten, titles[:20]))
            raise FormatError(f'{place}: no column "{shorten(wanted)}"; the first row has {there}')
        at.append(k)
    by_title = not all(wanted.isdigit() for wanted in how.titles)
    if not by_title and edge_columns(titles, place) is None and not _is_header(titles, at[2], others, place):
        return Columns(at[0], at[1], at[2], told=True, notes=(_note(how.titles, 0, 1, 2),))
    notes, ends = [_note(titles, *at)], (titles[at[0]], titles[at[1]])
    opposite = re.match(_HEARD, plain(ends[0])) and re.match(_LISTENERS, plain(ends[1]))
    if by_title and opposite and how.orientation == "listens":
        heard, listens = map(shorten, ends)
        mend = f'leave "listens" out, or give the columns {listens},{heard},{shorten(titles[at[2]])}'
        raise FormatError(f"{place}: the columns say that {listens} listens to {heard}, edges the opposite; {mend}")
    if _turned(*ends):
        notes.append(f"{' listens to '.join(map(shorten, ends))}{LISTENS}")
    return Columns(at[0], at[1], at[2], titles=titles, told=True, notes=tuple(notes))


def columns_of_comment(titles: Sequence[str], place: str, prose: bool = False) -> str:
    """Return the columns of source, target and weight that titles in a comment tell, from 1; "" of the usual three.

    Titles name both ends, or one, and a weight; what may be prose names both ends first.

    Examples
    --------
    >>> columns_of_comment(["follower", "leader", "weight"], ""), columns_of_comment(["source", "target", "weight"], "")
    ('2,1,3', '')
    """
    written = [plain(title) for title in titles]
    source, target, _ = edge_columns(titles, place) or (None, None, None)
    if source is not None and target is not None:
        rater = written[source] == "rater"
        rest = [k for k in range(len(titles)) if k not in (source, target)]
        if not rest or ((source, target) == (0, 1) and not rater):
            return ""
        weight = next((k for k in rest if _tells_weight(titles[k])), rest[0])
        known = {source, target} == {0, 1} or _tells_weight(titles[weight])
        return ",".join(str(k + 1) for k in (source, target, weight)) if known else ""
    if len(titles) < 3:
        return ""
    both = _both_ends(titles)
    listens, heard = "|".join((rf"({_LISTENERS}){_REST}", *_ENDS)), "|".join((rf"({_HEARD}){_REST}", *_STARTS))
    turned = bool(re.fullmatch(listens, written[0]) or re.fullmatch(heard, written[1]))
    weights = [k for k in range(2, len(titles)) if _tells_weight(titles[k], both)]
    if prose and not both:  # nothing but the usual titles of weights
        weights = [k for k in weights if names_edges([titles[k]]) and len(titles[k]) > 1]
    if entry := re.fullmatch(_OF_MATRIX, written[2]):
        weights, turned = [2], written[1] != entry[1][0]
    return f"2,1,{weights[0] + 1}" if turned and weights else ""


def _tells_weight(title: str, words: bool = False) -> bool:
    """Tell whether a word is the title of a weight or a sign, or one for a sign among ``words``; plurals are prose."""
    size = (is_size(title) or is_signed(title)) and not title.lower().endswith(("s", "ed"))
    return size or names_edges([title]) or (words and sign_of_word(title) is not None)


def _both_ends(titles: Sequence[str]) -> bool:
    """Tell whether both of the first two titles are words for an end, or for a node such as gene."""
    words = "|".join((rf"({_LISTENERS}){_REST}", rf"({_HEARD}){_REST}", *_STARTS, *_ENDS, _REST, _SOMEBODY))
    return all(re.fullmatch(words, plain(title)) for title in titles[:2])


def asks_of_corner(corner: str, line: str) -> str:
    r"""Return why the direction of a matrix must be told: its corner says that rows are heard; "" of any other.

    Examples
    --------
    >>> asks_of_corner("to from", "line 1"), asks_of_corner(r"from\to", "line 1").partition(";")[0]
    ('', 'line 1: the corner from\\to says that rows are heard')
    """
    heard, ends = "|".join((*_STARTS, rf"({_HEARD}){_REST}")), "|".join(_ENDS)
    words = re.findall(r"[^\W_]+", corner.lower())
    words = words[1:] if words[:1] in (["row"], ["rows"]) else words
    begins = ["".join(words[:k]) for k in range(1, len(words) + 1)]
    if not any(re.fullmatch(rf"({heard})({ends})?", begin) for begin in begins):
        return ""
    mend = "say --edges information if they are, or --edges listens if rows listen to columns"
    return f"{line}: the corner {shorten(corner)} says that rows are heard; {mend}"


def _is_header(titles: Sequence[str], weight: int, others: Sequence[Sequence[str]], place: str) -> bool:
    """Tell whether a row is of titles: where others have a number, or a sign, it has a word that is none.

    The word may be one for a sign, such as Trust, see :func:`_is_title`. Where others have words throughout, which are
    refused, no node is called as it calls the ends.
    """
    title = titles[weight]
    if not re.match(r"[^\W\d_]", title) or _NO_TITLE.fullmatch(title):
        return False
    below = [row[weight].strip() for row in others if len(row) > max(weight, 1)]
    nodes = {field.strip() for row in others for field in row[:2]}
    if is_entry(title):
        if not below or not nodes.isdisjoint(titles[:2]) or not _is_title(titles, title, below, nodes, place):
            return False
        if sign_of_word(title) == -1 and all(is_number(text) and text[0] != "-" for text in below):
            what = f"column {shorten(title)} has no negative number: sizes of negative weights, or signs?"
            raise FormatError(f"{place}: {what} Give weights their signs in a column called weight")
        return True
    words = title not in below and all(below) and len(below) > 1 and nodes.isdisjoint(titles[:2])
    return bool(below) and (any(map(is_entry, below)) or (is_sign(title) and all(below)) or words)


def _is_title(titles: Sequence[str], title: str, below: Sequence[str], nodes: Iterable[str], place: str) -> bool:
    """Tell whether a word for a sign is a title: above numbers and symbols; above words, where both ends have titles.

    Where one end alone has a title, or both are numbered as no node below is, it may be either; verbs are none.
    """
    if not all(map(is_entry, below)):
        return False
    if not any(re.match(r"[^\W\d_]", text) for text in below):
        return True
    words = "|".join((_LISTENERS, _HEARD, *_STARTS, *_ENDS))
    ends = [re.fullmatch(words, plain(end)) is not None for end in titles[:2]]
    numbered = re.fullmatch(_NEUTRAL, " ".join(map(plain, titles[:2]))) is not None and len(titles[0]) > 1
    numbered = numbered and re.search("[a-z]{2}", titles[0]) is not None
    if title.lower().endswith("s") or not (any(ends) or numbered):
        return False
    if not any(ends) and any(re.fullmatch(re.escape(titles[0][:-1]) + r"\d+", node) for node in nodes):
        return False
    if not all(ends):
        what = f"{', '.join(map(shorten, titles[:3]))} are titles, or an edge?"
        raise FormatError(f"{place}: {what} Name who is heard source, who listens target, and the weight weight")
    return True


def _note(titles: Sequence[str], *columns: int) -> str:
    return f"columns {', '.join(shorten(titles[k]) for k in columns)}"


def _turned(source: str, target: str) -> bool:
    """Tell whether a title of the source says that it listens, or one of the target that it is heard."""
    return bool(re.match(_LISTENERS, plain(source)) or re.match(_HEARD, plain(target)))


def _direction(source: str, target: str, weight: str, known: bool, place: str) -> str:
    """Return why the direction must be told; "" where titles tell it, or say as little as Gene1 and Gene2."""
    turned = _turned(source, target) or re.fullmatch(_OF_MATRIX, plain(weight))
    if not turned and (known or re.fullmatch(_NEUTRAL, f"{plain(source)} {plain(target)}")):
        return ""
    what = f"the header {shorten(source)}, {shorten(target)}, .. names no source and target"
    line = place.rpartition(", ")[2]
    if_listens = f"if {shorten(source)} listens to {shorten(target)}"
    return f"{line}: {what}; say --edges listens {if_listens}, or --edges information"
