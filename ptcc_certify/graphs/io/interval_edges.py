"""Edges whose weights lie in intervals, or that may fail, as files, tables and networkx graphs tell them."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any, NamedTuple

from ptcc_certify.errors import GraphError, NumberError, ParameterError
from ptcc_certify.graphs.family import read_interval
from ptcc_certify.graphs.io.signs import code_among, is_sign, sign_of_word
from ptcc_certify.graphs.labels import refuse_unnamed
from ptcc_certify.graphs.rationals import as_fraction, format_exact, shorten

_YES, _NO = ("yes", "true", "1", "1.0", "x"), ("no", "false", "0", "0.0", "")
#: Texts that stand where a value is missing; a node may be called so.
_MISSING = ("na", "n/a", "#n/a", "nan", "null", "none", "<na>", "nat")
#: Of weights in intervals.
TWICE = "the edges give intervals themselves; leave out the uncertainty"

Interval = tuple[Any, Any, Fraction, Fraction]


def absent(value: Any) -> bool:
    """Tell whether a value says nothing: None, NaN and NA of pandas, and a text of blanks.

    Examples
    --------
    >>> absent(" "), absent(float("nan")), absent(0)
    (True, True, False)
    """
    return value is None or (not value.strip() if isinstance(value, str) else str(value) in ("nan", "<NA>", "NaT"))


def known(value: Any) -> Any:
    """Return what is told of an edge beside its ends; None where that is nothing, or a text such as NA.

    Examples
    --------
    >>> known("NA"), known(float("nan")), known("0")
    (None, None, '0')
    """
    missing = absent(value) or (isinstance(value, str) and value.strip().lower() in _MISSING)
    return None if missing else value


class Entry(NamedTuple):
    """An edge as it is told: where it stands, its ends, its weight or an interval, and whether it may fail."""

    place: str
    source: Any
    target: Any
    weight: Any
    least: Any
    largest: Any
    optional: Any

    @property
    def always_zero(self) -> bool:
        """Whether its weight and both ends of its interval, as far as they are told, are the number 0.

        Examples
        --------
        >>> Entry("row 1", "a", "b", None, "0.0", "0", None).always_zero
        True
        """
        told = [end for end in (self.weight, self.least, self.largest) if not absent(end)]
        try:
            return bool(told) and not any(as_fraction(end, "weight") for end in told)
        except (NumberError, TypeError, ValueError):
            return False

    def interval(self, share: Fraction) -> Interval:
        """Return source, target, least and largest weight; ``share`` is the uncertainty of a single weight.

        Raises
        ------
        GraphError
            It has no weight, no interval, or a weight outside of it.

        Examples
        --------
        >>> Entry("row 1", "a", "b", "-2", None, None, "yes").interval(Fraction(1, 10))
        ('a', 'b', Fraction(-11, 5), Fraction(0, 1))
        """
        for end, node in (("source", self.source), ("target", self.target)):
            if isinstance(node, str) and not node.strip():
                raise GraphError(f"{self.place}: the {end} is empty; name the {end} or remove the row")
            refuse_unnamed(node, self.place)
        single = absent(self.least) and absent(self.largest)
        if not single and share:
            raise ParameterError(TWICE)
        ends = (self.weight, self.weight) if single else (self.least, self.largest)
        if single and absent(self.weight):
            raise GraphError(f"{self.place}: it has no weight; give weight, or weight_min and weight_max")
        if any(map(absent, ends)):
            raise GraphError(f"{self.place}: one end of its interval is missing; give weight_min and weight_max")
        text = "" if absent(self.optional) else str(self.optional).strip().lower()
        if text not in (*_YES, *_NO):
            raise GraphError(f"{self.place}: optional is {shorten(str(self.optional))}; write yes or no")
        least, largest = read_interval(*ends, self.place)
        if share:
            least, largest = sorted((least * (1 - share), least * (1 + share)))
        if not single:
            _refuse_outside(self.weight, least, largest, self.place)
        return (self.source, self.target, *(may_fail(least, largest) if text in _YES else (least, largest)))


def may_fail(least: Fraction, largest: Fraction) -> tuple[Fraction, Fraction]:
    """Return the interval of an edge that may fail, too.

    Examples
    --------
    >>> may_fail(Fraction(1), Fraction(2))
    (Fraction(0, 1), Fraction(2, 1))
    """
    return min(least, Fraction(0)), max(largest, Fraction(0))


def told_weights(weights: Iterable[Any], title: str) -> list[Any]:
    """Return weights, with 1 and -1 in the place of words for signs where they are nothing else but gaps.

    Raises
    ------
    GraphError
        The title is one of signs, and the numbers are codes of relations.

    Examples
    --------
    >>> told_weights(["activates", "-"], "type"), told_weights(["-", "2"], "weight")
    ([1, -1], ['-', '2'])
    """
    weights = list(weights)
    words = [sign_of_word(weight) if isinstance(weight, str) else None for weight in weights]
    gaps = [absent(weight) for weight in weights]
    if all(word is not None or gap for word, gap in zip(words, gaps, strict=True)):
        return words
    try:
        numbers = [as_fraction(weight, "weight") for weight, gap in zip(weights, gaps, strict=True) if not gap]
    except (NumberError, TypeError):
        return weights  # which is told of the edge
    if is_sign(title) and (code := code_among(numbers, title)) is not None:
        what = f'column "{shorten(title)}" holds {code}: codes of relations, not signs'
        raise GraphError(f"{what}; write 1 and -1, or call the column weight if it holds weights")
    return weights


def _refuse_outside(weight: object, least: Fraction, largest: Fraction, place: str) -> None:
    """Refuse a weight, or a sign, that stands beside an interval and lies outside of it; other texts say nothing."""
    try:
        number = as_fraction(weight, "weight")  # type: ignore[arg-type]
    except (NumberError, TypeError, ValueError):
        sign = sign_of_word(weight) if isinstance(weight, str) else None
        if sign is not None and (least if sign > 0 else -largest) < 0:
            what = f'"{shorten(str(weight))}" stands beside {format_exact(least)} to {format_exact(largest)}'
            raise GraphError(f"{place}: {what}; write the sign into both ends") from None
        return
    if not least <= number <= largest:
        ends = f"{format_exact(least)} to {format_exact(largest)}"
        raise GraphError(f"{place}: weight {format_exact(number)} lies outside of its interval, {ends}; mend one")
