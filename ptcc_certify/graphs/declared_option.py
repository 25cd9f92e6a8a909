"""Which option of the command line, and which key of a scenario, a field stands for: declared once, at the field."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Option:
    """What a field is called on the command line and in a scenario.

    Attributes
    ----------
    flag : str
        With what stands for its value: ``--leader-speed V``; of a switch both, ``--simulation/--no-simulation``.
    help : str
        What it means, in one or two sentences.
    key : str
        Section and key of a scenario, ``leaders.speed``; of a field the key alone, where it is called otherwise there.
    example : str
        Its value in a scenario, as TOML, which tells the kind of value, too.
    name : str
        What commands call it; where nothing is told as the flag, ``leader_speed``.
    kind : {"number", "parameter", "text", "state", "numbers", "switch", "flag", "choice", "count", "float"}
        What its value is: a number is exact, the field itself reads a parameter, a state is one of all agents, a count
        a whole number. Where nothing is told it follows from the others.
    unit : str
        Of a number: ``time``, say.
    default : Any
        That of the field.
    shown : str
        What its default is called, where that is none of the command line.
    choices : tuple of str
    least, most : int, optional
        Of a count.
    many : bool
        Whether it may be repeated.
    """

    flag: str
    help: str
    key: str = ""
    example: str = "1"
    name: str = ""
    kind: str = ""
    unit: str = ""
    default: Any = None
    shown: str = ""
    choices: tuple[str, ...] = ()
    least: int | None = None
    most: int | None = None
    many: bool = False

    def __post_init__(self) -> None:
        switch = self.flag.partition("/")[1]
        if not self.name:
            object.__setattr__(self, "name", self.word.lstrip("-").replace("-", "_"))
        if not self.kind:
            told = {"switch": switch, "choice": self.choices, "count": self.least is not None}
            kinds = {"": "parameter", "STATE": "state", "LIST": "numbers"}
            kind = next((kind for kind, true in told.items() if true), kinds.get(self.metavar or "", "number"))
            object.__setattr__(self, "kind", kind)

    @property
    def word(self) -> str:
        """The flag alone, ``--leader-speed``; of a switch the first of both."""
        return self.flag.partition(" ")[0].partition("/")[0]

    @property
    def metavar(self) -> str | None:
        """What stands for its value."""
        return self.flag.partition(" ")[2] or None


def option(
    flag: str,
    help: str,
    of: Any = None,
    *,
    default: Any = None,
    required: bool = False,
    **told: Any,
) -> Any:
    """Return a field of a dataclass that stands for an option; ``section`` of the class is that of its scenario.

    Parameters
    ----------
    flag, help, **told : Any
        See :class:`Option`.
    of : Positive, NotNegative or Given, optional
        A field that reads its values; of any other ``default`` is the default.
    default : Any
        Of the field, None where nothing is told; ``required`` has none.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Wind:
    ...     section = "weather"
    ...     speed: float = option("--wind-speed V", "How fast it blows.", default=0.0, unit="m/s")
    >>> told = options_of(Wind)["speed"]
    >>> Wind().speed, told.word, told.name, told.key, told.metavar
    (0.0, '--wind-speed', 'wind_speed', 'weather.speed', 'V')
    """
    if of is None:
        declared = Option(flag=flag, help=help, default=default, **told)
        return field(default=MISSING if required else default, metadata={"option": declared})
    of.option = Option(flag=flag, help=help, default=of.default, **told)
    return of


def options_of(*kinds: Any) -> Mapping[str, Option]:
    """Return the options of the fields of dataclasses, by the names of the fields.

    Examples
    --------
    >>> from ptcc_certify.model.late_messages import MovingLeaders
    >>> {name: told.key for name, told in options_of(MovingLeaders).items() if name in ("speed", "saturation")}
    {'speed': 'leaders.speed', 'saturation': 'limits.saturation'}
    """
    found = {}
    for kind in kinds:
        for one in fields(kind):
            told = getattr(inspect.getattr_static(kind, one.name, None), "option", one.metadata.get("option"))
            if told is not None:
                key = told.key if "." in told.key else f"{kind.section}.{told.key or one.name}"
                found[one.name] = replace(told, key=key)
    return found
