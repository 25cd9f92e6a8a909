"""What is told of a certificate, as data: facts, which media lay out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from ptcc_certify.errors import Change, Sentence, spell

#: To which side a number may be rounded, and what a fact rests on.
Side = Literal["up", "down", "exact"]
Standing = Literal["proved", "observed", "unproved"]


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
        The sentence, with the number, rounded to that side; labels stand in it between marks, see
        :func:`ptcc_certify.errors.labelled`.
    brief : tuple of sentences
        Shorter sentences, the shortest last, for a screen of few lines.
    detail : bool
        Whether it is left out of a screen of few lines.
    loud : bool
        Whether it warns.
    asked : str
        The clause, if it tells what is proved under all that was asked: for a title.

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
    asked: str = ""

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
