"""Words for signs, and which column or attribute of an edge holds its weight and its sign."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.rationals import MINUS, shorten

_POSITIVE = (
    "+ positive pos plus up activate activates activated activating activation activator act induce induces induction "
    "stimulate stimulates stimulation upregulate upregulates upregulation promote promotes enhance enhances "
    "ally allies friend friends trust trusts like likes support supports agree agrees alliance "
    "excitatory excites excitation upregulated cooperation for --> ->"
)
_NEGATIVE = (
    f"- {MINUS} negative neg minus down inhibit inhibits inhibited inhibiting inhibition inhibitor inh repress "
    "represses repressed repressing repression repressor suppress suppresses suppression downregulate downregulates "
    "downregulation block blocks enemy enemies foe foes opponent opponents rival rivals distrust distrusts dislike "
    "dislikes oppose opposes disagree disagrees hostility "
    "inhibitory downregulated conflict against --| -| |"
)
_SIGNS = dict.fromkeys(_POSITIVE.split(), 1) | dict.fromkeys(_NEGATIVE.split(), -1)
#: Titles of weights, and of what is a sign beside a weight: of both the first that occurs counts.
WEIGHT = ("weight", "rating", "value", "w", "strength", "magnitude", "intensity")
SIGN = (
    *("sign", "type", "edgetype", "effect", "relation", "relationship", "interaction", "interactiontype"),
    *("regulation", "polarity", "valence", "attitude", "mor"),
)
#: Those whose numbers are no sizes.
_RELATIONS = ("type", "edgetype", "relation", "relationship", "interactiontype")
#: Titles of the least and the largest weight of an edge, and of whether it may fail, which make a family of a graph.
_LEAST = ("weight_min", "min_weight", "w_min", "least", "min", "lower")
_LARGEST = ("weight_max", "max_weight", "w_max", "largest", "max", "upper")
_OPTIONAL = ("optional", "may_fail")
#: What Gephi writes as the type of edges.
DIRECTIONS = {"directed": False, "undirected": True}
#: What is said of a word that is none for a sign.
NO_SIGN = "is neither a number nor a word for a sign, such as + - activates inhibits"


def plain(title: str) -> str:
    """Return a title in small letters, without what may stand between its words.

    Examples
    --------
    >>> plain("From-Node_Id")
    'fromnodeid'
    """
    return re.sub(r"[\s_-]", "", title.lower())


def sign_of_word(text: str) -> int | None:
    """Return 1 or -1 for a word that stands for a sign, None for any other text, numbers too.

    Examples
    --------
    >>> [sign_of_word(word) for word in ("Activates", "down-regulation", "-", "+-", "neg-", "1")]
    [1, -1, -1, None, None, None]
    """
    word = text.strip().lower()
    letters = re.fullmatch(r"[^\W\d_].*[^\W\d_]", word)  # what stands between + and -, or at an end, is no gap
    return _SIGNS.get(word, _SIGNS.get(plain(word)) if letters else None)


def is_sign(title: str) -> bool:
    """Tell whether a title is one of signs, whose numbers are codes of relations unless they are 1 and -1.

    Examples
    --------
    >>> is_sign("Edge Type"), is_sign("weight")
    (True, False)
    """
    return plain(title) in SIGN


def find(titles: Sequence[str], names: Sequence[str], place: str) -> int | None:
    """Return the position of the title that is the first of ``names`` to occur; None if none does.

    Examples
    --------
    >>> find(["To Node", "Weight"], ["sign", "weight"], "a.csv")
    1
    """
    written = [plain(title) for title in titles]
    for name in names:
        if written.count(plain(name)) > 1:
            raise FormatError(f'{place}: two columns are named "{shorten(name)}"; rename one')
        if plain(name) in written:
            return written.index(plain(name))
    return None


def weight_and_sign(titles: Sequence[str], place: str) -> tuple[int | None, int | None]:
    """Return the positions of the weight and of the sign beside it; a sign alone is the weight.

    Examples
    --------
    >>> weight_and_sign(["sign", "year", "weight"], "a.csv"), weight_and_sign(["year", "sign"], "a.csv")
    ((2, 0), (1, None))
    """
    weight, sign = find(titles, WEIGHT, place), find(titles, SIGN, place)
    return (sign, None) if weight is None else (weight, sign)


def code_among(values: Sequence[Fraction], title: str) -> Fraction | None:
    """Return a number that makes a column of relations one of codes; None where it holds signs, 1 and -1.

    A column called sign may hold 1 alone, or any number beside a negative one; fractions are no codes beside a
    negative number, or where the title is not one of relations.

    Examples
    --------
    >>> code_among([Fraction(1), Fraction(2)], "type"), code_among([Fraction(1), Fraction(-1)], "type")
    (Fraction(2, 1), None)
    >>> code_among([Fraction("1.1")], "type"), code_among([Fraction("1.1")], "effect")
    (Fraction(11, 10), None)
    """
    numbers = set(values)
    if title.strip().lower() == "sign":
        return None if min(numbers, default=0) < 0 else next((v for v in values if v != 1), None)
    if not numbers or (-1 in numbers and numbers <= {-1, 0, 1}):
        return None
    if any(v.denominator > 1 for v in numbers) and (min(numbers) < 0 or plain(title) not in _RELATIONS):
        return None
    return next((v for v in values if v not in (-1, 1)), values[0])


def interval_columns(first: Sequence[str], place: str) -> tuple[int | None, int | None, int | None]:
    """Return the columns of the least and the largest weight, and that of edges that may fail; None of each it lacks.

    Raises
    ------
    FormatError
        One end of the intervals is named without the other.

    Examples
    --------
    >>> interval_columns(["source", "target", "weight_min", "weight_max"], "a.csv")
    (2, 3, None)
    """
    if not family_titles(first):
        return None, None, None
    low, high, may_fail = (find(first, names, place) for names in (_LEAST, _LARGEST, _OPTIONAL))
    if sum(plain(title) in map(plain, _OPTIONAL) for title in first) > 1:
        raise FormatError(f"{place}: two columns tell whether edges may fail; leave one out")
    if (low is None) != (high is None):
        raise FormatError(f"{place}: one end of the intervals is named alone; name weight_min and weight_max")
    return low, high, may_fail


def family_titles(titles: Sequence[str]) -> list[str]:
    """Return titles of intervals of weights, or of edges that may fail, where they make a family of a graph.

    One end alone does if its title names the weight; ``max`` alone may be anything.

    Examples
    --------
    >>> family_titles(["source", "target", "min", "max"]), family_titles(["source", "target", "weight", "max"])
    (['min', 'max'], [])
    """
    of = [[title for title in titles if plain(title) in map(plain, names)] for names in (_LEAST, _LARGEST, _OPTIONAL)]
    named = any("weight" in title.lower() or plain(title) in ("wmin", "wmax") for title in (*of[0], *of[1]))
    return [*of[2], *of[0], *of[1]] if of[2] or named or (of[0] and of[1]) else []
