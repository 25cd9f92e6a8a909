"""All rules that the rows of a file break, refused in one message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ptcc_certify.graphs.labels import in_all


@dataclass(frozen=True)
class Problem:
    """A rule that rows break: in which row first, what it says, and how it is mended, by hand or with an option."""

    place: str  # "line 3"; "" where none is told
    text: str
    mend: str  # {} stands for the option, if there is one
    option: str = ""

    @property
    def by_hand(self) -> Problem:
        """The same where no options are: rows in memory."""
        return replace(self, mend=self.mend.partition(", or ")[0], option="") if self.option else self


class Problems:
    """Rules that rows break: of each the first row, and how many rows there are.

    Examples
    --------
    >>> problems = Problems()
    >>> problems.add(Problem("line 2", "self-loop at a", "remove it"))
    >>> problems.add(Problem("line 5", "self-loop at b", "remove it"))
    >>> [problem.text for problem in problems.told()]
    ['self-loop at a (2 in all)']
    """

    def __init__(self) -> None:
        self._first: dict[str, Problem] = {}
        self._count = Counter[str]()

    def add(self, problem: Problem, kind: str = "") -> None:
        """Take a problem of a kind, which its mend tells by default."""
        kind = kind or problem.mend
        self._first.setdefault(kind, problem)
        self._count[kind] += 1

    def told(self, *mended: str) -> list[Problem]:
        """Return the first of every kind, which says how many there are, but for kinds that are mended."""
        kinds = ((kind, one) for kind, one in self._first.items() if kind not in mended)
        return [replace(one, text=one.text + in_all(self._count[kind])) for kind, one in kinds]


def one_message(problems: Sequence[Problem], call: Callable[..., str]) -> tuple[str, str]:
    """Return where the first row stands that breaks a rule, and what is said of all rules that are broken.

    Parameters
    ----------
    problems : sequence of Problem
        At least one.
    call : function
        Writes options as they are given.

    Examples
    --------
    >>> loop = Problem("line 2", "self-loop at node a", "remove it, or drop all with {}", "--drop-self-loops")
    >>> one_message([loop], lambda *options: " ".join(options))
    ('line 2', 'self-loop at node a; remove it, or drop all with --drop-self-loops')
    >>> empty = Problem("line 3", "the source is empty", "name a node")
    >>> one_message([loop, empty], lambda *options: " ".join(options))[1]  # doctest: +ELLIPSIS
    'line 2: self-loop at node a; line 3: the source is empty (name a node); mend these, or all but line 3 with ...'
    """
    if len(problems) == 1:
        (one,) = problems
        return one.place, f"{one.text}; {one.mend.format(call(one.option)) if one.option else one.mend}"
    texts = []
    for one in problems:
        by_hand = "" if one.option else f" ({one.mend})"
        texts.append(f"{one.place}: {one.text}{by_hand}" if one.place else f"{one.text}{by_hand}")
    without = [one.place or "the rest" for one in problems if not one.option]
    if len(without) == len(problems):
        return "", f"{'; '.join(texts)}; mend these"
    how = f"all but {', '.join(without)} with" if without else "read it with"
    options = call(*dict.fromkeys(one.option for one in problems if one.option))
    return "", f"{'; '.join(texts)}; mend these, or {how} {options}"
