"""One declaration for each section of a certificate: a frozen dataclass whose annotations say what may stand there.

A section is read strictly: no key more, none missing, no value of another type. Where a field is None its key is left
out; ``null`` stands for None in lists and among values by agent alone. Of the keys that ``one_of`` names one is there.
What makes certificates writes by the same declarations, and the JSON schema is printed from them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from dataclasses import fields as fields_of
from fractions import Fraction
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from ptcc_certify.checker.reading import entries, exact, fields, interval, need, triangle
from ptcc_certify.checker.side_files import Numbers, SideFiles, beside

T = TypeVar("T")


class Rule(NamedTuple):
    """What holds of a number, and what is said where it does not."""

    holds: Callable[[Any], bool]
    why: str


class Pattern(NamedTuple):
    """A regular expression that a text matches as a whole."""

    text: str


Sha256: TypeAlias = Annotated[str, Pattern("[0-9a-f]{64}")]
#: What is read where it is verified: long lists of which every entry is looked at once, and what a text names.
Unread = Annotated[T, "unread"]
Positive = Annotated[Fraction, Rule(lambda x: x > 0, "is not positive")]
NotNegative = Annotated[Fraction, Rule(lambda x: x >= 0, "is negative")]
#: A middle and a radius, which is 0 where an exact number stands.
Ball: TypeAlias = Annotated[tuple[Fraction, Fraction], "a ball"]
#: A number of each agent: texts by label, or a side vector; of few agents texts.
Agents: TypeAlias = Annotated[Numbers, "by agent"]
FewAgents: TypeAlias = Annotated[Numbers, "by agent", "no file"]
#: Anything else of each agent, or of each follower, by label.
ByAgent = Annotated[Sequence[T], "by agent"]
#: Anything of some agents, by label.
Some = Annotated[Mapping[str, T], "by some agents"]
ByFollower = Annotated[Sequence[T], "by follower"]
#: Anything by the number of a closed component.
ByNumber = Annotated[Mapping[str, T], "by number"]
#: A list.
Several = Annotated[Sequence[T], "a list"]
#: A symmetric matrix.
Triangle: TypeAlias = Annotated[Sequence[Sequence[Fraction]], "lower triangle"]
#: A list of numbers, or a side vector, in the order of the followers; or of a length that is read where it is known.
FollowerNumbers: TypeAlias = Annotated[Numbers, "numbers of followers"]
Vector: TypeAlias = Annotated[Any, "numbers"]
Integers: TypeAlias = Annotated[Any, "integers"]
Column: TypeAlias = Annotated[Any, "a column"]
FollowerIntegers: TypeAlias = Annotated[list[int], "integers of followers"]
EdgeNumbers: TypeAlias = Annotated[Numbers, "numbers of edges"]
#: The agents themselves.
Labels: TypeAlias = Annotated[list[str], "labels"]
#: The place of an agent that stands as its label.
Node: TypeAlias = Annotated[int, "a label"]
#: Middles and radii of every agent: by label, or two side vectors.
Ends: TypeAlias = Annotated[tuple[Numbers, Numbers], "ends by agent"]
#: Labels; of many agents, labels or a side vector of places.
Nodes: TypeAlias = Annotated[Any, "nodes"]
ManyNodes: TypeAlias = Annotated[Any, "many nodes"]


@dataclass
class Context:
    """Whom ``by agent`` means, and where side vectors are.

    Attributes
    ----------
    files : SideFiles
    labels, followers : sequence of str
    index : mapping of str to int
        Places of labels.
    edges : int
        Their number.
    """

    files: SideFiles
    labels: Sequence[str] = ()
    followers: Sequence[str] = ()
    index: Mapping[str, int] = field(default_factory=dict)
    edges: int = 0

    def know(self, labels: Sequence[str]) -> Mapping[str, int]:
        """Take the labels of the agents; return their places."""
        self.labels, self.index = labels, {label: v for v, label in enumerate(labels)}
        return self.index


@dataclass(frozen=True, kw_only=True)
class RowVector:
    """The witness of rows: a positive number of every follower."""

    u: FollowerNumbers


class Brings(NamedTuple):
    """What an obligation brings: the names of its numbers, and its witness as it is declared; None: no witness."""

    numbers: str = ""
    witness: Any = None


class Declared(NamedTuple):
    """A field of a section: its key, what may stand there, and whether it may be absent."""

    key: str
    name: str
    kind: Any
    optional: bool


@cache
def declared(section: type) -> tuple[Declared, ...]:
    """Return what is declared of every field; a trailing ``_`` is not in the key."""
    hints = get_type_hints(section, include_extras=True)
    return tuple(Declared(f.name.rstrip("_"), f.name, hints[f.name], f.default is None) for f in fields_of(section))


_UNIONS, _NONE = (Union, type(int | None)), type(None)


def read(kind: Any, value: Any, at: Context, what: str) -> Any:
    """Return a JSON value as its declaration has it.

    Raises
    ------
    RejectedError
        It is another.
    """
    if get_origin(kind) in _UNIONS:
        return _alternative(get_args(kind), value, at, what)
    if get_origin(kind) is Annotated:
        return _annotated(kind, value, at, what)
    if get_origin(kind) is tuple:
        pairs = zip(get_args(kind), entries(value, what, len(get_args(kind))), strict=True)
        return tuple(read(inner, one, at, what) for inner, one in pairs)
    if get_origin(kind) is Literal:
        need(any(type(value) is type(one) and value == one for one in get_args(kind)), f"{what} is {_names(kind)}")
        return value
    if kind is Any:
        return value
    if kind is Fraction:
        return exact(value)
    if isinstance(kind, type) and is_dataclass(kind):
        return _section(kind, value, at, what)
    plain = _NONE if kind is None else get_origin(kind) or kind
    need(type(value) is plain, f"{what} is not {_TYPES.get(plain, 'null')}")
    return value


#: The names of JSON's types.
_TYPES = {int: "an integer", bool: "true or false", str: "a text", dict: "an object", list: "a list"}


def _names(kind: Any) -> str:
    return "not one of " + ", ".join(str(x).lower() if isinstance(x, bool) else str(x) for x in get_args(kind))


def parts_of(section: type, value: Any, what: str) -> list[Declared]:
    """Return what is declared of the keys of an object, which has those of a section, and no other."""
    known, here = declared(section), value if isinstance(value, dict) else {}
    fields(value, [f.key for f in known if not f.optional or f.key in here], what)
    for f in known:
        need(not f.optional or f.key not in here or here[f.key] is not None, f"{f.key} is null, and not left out")
    due = getattr(section, "one_of", ())
    need(not due or sum(key in here for key in due) == 1, f"{what} has not one of {', '.join(due)}")
    return [f for f in known if f.key in here]


def _section(kind: Any, value: Any, at: Context, what: str) -> Any:
    return kind(**{f.name: read(f.kind, value[f.key], at, f.key) for f in parts_of(kind, value, what)})


def _alternative(kinds: Sequence[Any], value: Any, at: Context, what: str) -> Any:
    """Read null, or one of several: the first that JSON has such a value for, a section by its words or its keys."""
    rest = [kind for kind in kinds if kind is not _NONE]
    if value is None and len(rest) < len(kinds):
        return None
    fitting = [kind for kind in rest if _may_be(kind, value)]
    return read(fitting[0] if fitting else max(rest, key=lambda kind: _common(kind, value)), value, at, what)


def _common(kind: Any, value: Any) -> tuple[int, int]:
    """Return how many words that are declared of a section are there, and how many of its keys."""
    if not (isinstance(kind, type) and is_dataclass(kind) and isinstance(value, dict)):
        return 0, 0
    here = [f for f in declared(kind) if f.key in value]
    words = (value[f.key] in get_args(f.kind) for f in here if get_origin(f.kind) is Literal)
    return sum(words), len(here)


def _may_be(kind: Any, value: Any) -> bool:
    """Tell whether JSON has a value of this type for it; of a section, with the same words, or keys if it has none."""
    if get_origin(kind) is Annotated and get_args(kind)[1] == "a list":
        return isinstance(value, list)
    if kind in (Fraction, str) or get_origin(kind) is Literal:
        return isinstance(value, str)
    if not (isinstance(kind, type) and is_dataclass(kind)):
        return type(value) is kind if kind is int else isinstance(value, list | dict)
    if not isinstance(value, dict):
        return False
    known = declared(kind)
    word = next((f for f in known if get_origin(f.kind) is Literal), None)
    if word:
        return value.get(word.key) in get_args(word.kind)
    return all(f.key in value for f in known if not f.optional)


@cache
def outermost(kind: Any) -> tuple[Any, Any]:
    """Return what is annotated, and the annotation: of several the last one, which holds of all that those before say.

    Examples
    --------
    >>> outermost(Unread[Several[int]]) == (Several[int], "unread")
    True
    """
    inner, *notes = get_args(kind)
    if len(notes) > 1 and notes[-1] != "no file":
        return Annotated[(inner, *notes[:-1])], notes[-1]
    return inner, notes[0]


def _annotated(kind: Any, value: Any, at: Context, what: str) -> Any:
    inner, note = outermost(kind)
    if isinstance(note, Rule):
        number = read(inner, value, at, what)
        need(note.holds(number), f"{what} {note.why}")
        return number
    if isinstance(note, Pattern):
        need(isinstance(value, str) and bool(re.fullmatch(note.text, value)), f"{what} is not like {note.text}")
        return value
    if note == "a ball":
        return interval(value)
    if note == "a list":
        return [read(get_args(inner)[0], one, at, f"an entry of {what}") for one in entries(value, what)]
    if note == "lower triangle":
        return triangle(value, len(entries(value, what)))
    if note == "a label":
        need(isinstance(value, str) and value in at.index, f"{what}: an unknown node")
        return at.index[value]
    if note in ("unread", "numbers", "integers", "a column", "nodes", "many nodes"):
        return value
    if note == "labels":
        texts = bool(entries(value, what)) and all(isinstance(x, str) for x in value)
        need(texts, f"{what} are not texts, or there is none")
        need(len(set(value)) == len(value), "a node occurs twice")
        return value
    if note == "numbers of followers":
        return at.files.numbers(value, what, len(at.followers))
    if note == "numbers of edges":
        return at.files.numbers(value, what, at.edges)
    if note == "integers of followers":
        return at.files.integers(value, what, len(at.followers))
    if note == "ends by agent":
        return _ends(value, at, what)
    if note == "by some agents":
        need(isinstance(value, dict) and all(label in at.index for label in value), f"{what}: an unknown node")
        return {label: read(get_args(inner)[1], x, at, what) for label, x in value.items()}
    if note == "by number":
        numbered = isinstance(value, dict) and all(re.fullmatch("[1-9][0-9]{0,8}", key) for key in value)
        need(numbered, f"{what} is not an object with numbers as keys")
        return {key: read(get_args(inner)[1], x, at, what) for key, x in value.items()}
    labels = at.followers if note == "by follower" else at.labels
    if inner is Numbers and beside(value):
        need(len(get_args(kind)) == 2, f"{what} in a side file")
        return at.files.numbers(value, what, len(labels))
    need(list(fields(value, labels, what)) == list(labels), "agents are in another order")
    if inner is Numbers:
        return Numbers([exact(x) for x in value.values()])
    return [read(get_args(inner)[0], x, at, what) for x in value.values()]


def _ends(value: Any, at: Context, what: str) -> tuple[Numbers, Numbers]:
    """Read middles and radii: two side vectors, or intervals by agent."""
    if isinstance(value, dict) and beside(value.get("mid")):
        fields(value, ("mid", "radius"), what)
        need(beside(value["radius"]), "radius is not a side vector")
        mid, radius = (at.files.numbers(value[key], key, len(at.labels)) for key in ("mid", "radius"))
        need(all(r >= 0 for r in radius.values), "a radius is negative")
        return mid, radius
    intervals = read(ByAgent[Ball], value, at, what)
    return Numbers([x for x, _ in intervals]), Numbers([r for _, r in intervals])
