"""One declaration for each section of a certificate: a frozen dataclass whose annotations say what may stand there.

A section is read strictly: no key more, none missing, no value of another type. ``null`` stands for None; a key is left
out only where its field has the default None. What makes certificates writes by the same declarations, and the JSON
schema is printed from them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from fractions import Fraction
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from ptcc_certify.checker import reading
from ptcc_certify.checker.reading import entries, exact, interval, need
from ptcc_certify.checker.side_files import Numbers, SideFiles, beside

T = TypeVar("T")


class Rule(NamedTuple):
    """What holds of a number, and what is said where it does not."""

    holds: Callable[[Any], bool]
    why: str


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
#: A list.
Several = Annotated[Sequence[T], "a list"]
#: A symmetric matrix.
Triangle: TypeAlias = Annotated[Sequence[Sequence[Fraction]], "lower triangle"]
#: A list of numbers, or a side vector, in the order of the followers; or of a length that is read where it is known.
FollowerNumbers: TypeAlias = Annotated[Numbers, "numbers of followers"]
Vector: TypeAlias = Annotated[Any, "numbers"]
FollowerIntegers: TypeAlias = Annotated[list[int], "integers of followers"]
EdgeNumbers: TypeAlias = Annotated[Numbers, "numbers of edges"]
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


@dataclass(frozen=True, kw_only=True)
class RowVector:
    """The witness of rows: a positive number of every follower."""

    u: FollowerNumbers


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
    return tuple(Declared(f.name.rstrip("_"), f.name, hints[f.name], f.default is None) for f in fields(section))


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
    if get_origin(kind) is Literal:
        need(any(type(value) is type(one) and value == one for one in get_args(kind)), f"{what} is {_names(kind)}")
        return value
    if kind is Any:
        return value
    if kind is Fraction:
        return exact(value)
    if isinstance(kind, type) and is_dataclass(kind):
        return _section(kind, value, at, what)
    need(type(value) is (_NONE if kind is None else kind), f"{what} is not {_TYPES.get(kind, 'null')}")
    return value


_TYPES = {int: "an integer", bool: "true or false", str: "a text"}


def _names(kind: Any) -> str:
    return "not one of " + ", ".join(map(str, get_args(kind)))


def _section(kind: Any, value: Any, at: Context, what: str) -> Any:
    known = declared(kind)
    here = value if isinstance(value, dict) else {}
    reading.fields(value, [f.key for f in known if not f.optional or f.key in here], what)
    need(all(here[f.key] is not None for f in known if f.optional and f.key in here), f"{what}: a key that is left out")
    return kind(**{f.name: read(f.kind, value[f.key], at, f.key) for f in known if f.key in here})


def _alternative(kinds: Sequence[Any], value: Any, at: Context, what: str) -> Any:
    """Read null, or one of several: a number for a text, else a section that has the words that are declared."""
    rest = [kind for kind in kinds if kind is not _NONE]
    if value is None and len(rest) < len(kinds):
        return None
    fitting = [kind for kind in rest if _is_text(kind) == isinstance(value, str) and _has_words(kind, value)]
    return read(fitting[0] if fitting else max(rest, key=lambda kind: _common(kind, value)), value, at, what)


def _common(kind: Any, value: Any) -> int:
    """Return how many keys of a section are there."""
    section = isinstance(kind, type) and is_dataclass(kind) and isinstance(value, dict)
    return sum(f.key in value for f in declared(kind)) if section else 0


def _is_text(kind: Any) -> bool:
    """Tell whether JSON has a text for it."""
    return kind in (Fraction, str) or get_origin(kind) is Literal


def _has_words(kind: Any, value: Any) -> bool:
    """Tell whether a section has the first word that is declared, or the keys if there is none."""
    if not isinstance(value, dict) or not (isinstance(kind, type) and is_dataclass(kind)):
        return True
    known = declared(kind)
    word = next((f for f in known if get_origin(f.kind) is Literal), None)
    if word:
        return value.get(word.key) in get_args(word.kind)
    return all(f.key in value for f in known if not f.optional)


def _annotated(kind: Any, value: Any, at: Context, what: str) -> Any:
    inner, note = get_args(kind)[:2]
    if isinstance(note, Rule):
        number = read(inner, value, at, what)
        need(note.holds(number), f"{what} {note.why}")
        return number
    if note == "a ball":
        return interval(value)
    if note == "a list":
        return [read(get_args(inner)[0], one, at, what) for one in entries(value, what)]
    if note == "lower triangle":
        return reading.triangle(value, len(entries(value, what)))
    if note == "a label":
        need(isinstance(value, str) and value in at.index, f"{what}: an unknown node")
        return at.index[value]
    if note in ("numbers", "nodes", "many nodes"):
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
    labels = at.followers if note == "by follower" else at.labels
    if inner is Numbers and beside(value):
        need(len(get_args(kind)) == 2, f"{what} in a side file")
        return at.files.numbers(value, what, len(labels))
    need(list(reading.fields(value, labels, what)) == list(labels), "agents are in another order")
    if inner is Numbers:
        return Numbers([exact(x) for x in value.values()])
    return [read(get_args(inner)[0], x, at, what) for x in value.values()]


def _ends(value: Any, at: Context, what: str) -> tuple[Numbers, Numbers]:
    """Read middles and radii: two side vectors, or intervals by agent."""
    if isinstance(value, dict) and beside(value.get("mid")):
        reading.fields(value, ("mid", "radius"), what)
        need(beside(value["radius"]), "radius is not a side vector")
        mid, radius = (at.files.numbers(value[key], key, len(at.labels)) for key in ("mid", "radius"))
        need(all(r >= 0 for r in radius.values), "a radius is negative")
        return mid, radius
    intervals = read(ByAgent[Ball], value, at, what)
    return Numbers([x for x, _ in intervals]), Numbers([r for _, r in intervals])
