"""What is told of a certificate, as data: facts, and changes that are advised. Media lay them out, and name fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from lmi.exact.decimal_rounding import near


@dataclass(frozen=True)
class Change:
    """Another value of a field, or the field alone.

    Attributes
    ----------
    field : str
        As Python names it.
    value : Fraction, str or None

    Examples
    --------
    >>> str(Change("rho2", Fraction(1, 2))), str(Change("time_limit"))
    ('rho2=0.5', 'time_limit')
    """

    field: str
    value: Fraction | str | None = None

    @property
    def number(self) -> str:
        """The value in words; empty if there is none."""
        return near(self.value) if isinstance(self.value, Fraction) else self.value or ""

    def __str__(self) -> str:
        return f"{self.field}={self.number}" if self.value is not None else self.field


#: To which side a number may be rounded, and what a fact rests on.
Side = Literal["up", "down", "exact"]
Standing = Literal["proved", "observed", "unproved"]
#: A sentence: a text, or texts and the changes that stand among them.
Sentence = str | tuple[str | Change, ...]
#: How a medium names a change.
Spelling = Callable[[Change], str]


def spell(sentence: Sentence, name: Spelling = str) -> str:
    """Return a sentence as a text, its changes named as a medium names them.

    Examples
    --------
    >>> spell(("no rate is proved; raise ", Change("time_limit"))), spell("proved")
    ('no rate is proved; raise time_limit', 'proved')
    """
    parts = (sentence,) if isinstance(sentence, str) else sentence
    return "".join(part if isinstance(part, str) else name(part) for part in parts)


def joined(separator: str, sentences: Iterable[Sentence]) -> Sentence:
    """Return sentences as one; those that are empty are left out.

    Examples
    --------
    >>> joined("; ", ["certified", "", ("raise ", Change("rho2"))])
    ('certified', '; ', 'raise ', Change(field='rho2', value=None))
    """
    parts: list[str | Change] = []
    for sentence in sentences:
        if sentence:
            parts += [separator] if parts else []
            parts += [sentence] if isinstance(sentence, str) else sentence
    return tuple(parts)


@dataclass(frozen=True, kw_only=True)
class Fact:
    """One thing that is told of a certificate.

    Attributes
    ----------
    head : str
        What it is of, such as ``"error"``.
    value : object
        The number of it, or the numbers by label; None where words say all.
    side : {"up", "down", "exact"}
        To which side the number may be rounded.
    standing : {"proved", "observed", "unproved"}
        ``observed``: in a simulated run. ``unproved``: nobody proves it, or it is numerical.
    note : str or tuple of str and Change
        The sentence, with the number, rounded to that side.
    brief : tuple of sentences
        Shorter sentences, the shortest last, for a screen of few lines.
    detail : bool
        Whether it is left out of a screen of few lines.
    loud : bool
        Whether it warns.

    Examples
    --------
    >>> Fact(head="rate", value=Fraction(7, 3), side="down", note="rate 2.33333").text
    'rate 2.33333'
    """

    head: str
    value: object = None
    side: Side = "exact"
    standing: Standing = "proved"
    note: Sentence
    brief: tuple[Sentence, ...] = ()
    detail: bool = False
    loud: bool = False

    @property
    def changes(self) -> tuple[Change, ...]:
        """What is advised, in the order in which the sentence names it."""
        return () if isinstance(self.note, str) else tuple(part for part in self.note if isinstance(part, Change))

    @property
    def text(self) -> str:
        """The sentence, with fields named as in Python."""
        return spell(self.note)


#: Facts one after another; those of one head stand together.
Facts = Iterator[Fact]
