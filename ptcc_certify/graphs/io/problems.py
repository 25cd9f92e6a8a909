"""All rules that the rows of a file break, refused in one message."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """A rule that rows break: in which row first, what it says, and how it is mended, by hand or with an option."""

    place: str  # "line 3"; "" where none is told
    text: str
    mend: str  # {} stands for the option
    option: str = ""


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
    >>> one_message([loop, empty], lambda *options: " ".join(options))[1]
    'line 2: self-loop at node a; line 3: the source is empty; mend these, or all but line 3 with --drop-self-loops'
    """
    if len(problems) == 1:
        (one,) = problems
        return one.place, f"{one.text}; {one.mend.format(call(one.option) if one.option else '')}"
    texts = "; ".join(f"{one.place}: {one.text}" if one.place else one.text for one in problems)
    options = call(*dict.fromkeys(one.option for one in problems if one.option))
    if not any(one.option for one in problems):
        return "", f"{texts}; mend these"
    by_hand = ", ".join(one.place for one in problems if not one.option)
    how = f"all but {by_hand} with" if by_hand else "read it with"
    return "", f"{texts}; mend these, or {how} {options}"
