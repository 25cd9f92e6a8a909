"""Which option of the command line, and which key of a scenario, a field stands for: declared once, at the field."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Option:
    """What a field is called on the command line and in a scenario.

    Attributes
    ----------
    flag : str
        ``--leader-speed``; of a switch with both, ``--simulation/--no-simulation``.
    help : str
        What it means, in one or two sentences.
    key : str
        Section and key of a scenario, ``leaders.speed``; none where no scenario has it.
    example : str
        Its value in a scenario, as TOML, which tells the kind of value, too.
    name : str
        What commands call it; that of the flag, ``leader_speed``, where nothing else is told.
    metavar : str
        What stands for its value.
    kind : {"number", "text", "state", "numbers", "switch", "choice", "count", "float"}
        What its value is: a number is exact, a state is one of all agents, a count a whole number.
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
    protocol : str
        The only protocol that has it; none of both have.
    """

    flag: str
    help: str
    key: str = ""
    example: str = "1"
    name: str = ""
    metavar: str | None = None
    kind: str = "number"
    unit: str = ""
    default: Any = None
    shown: str = ""
    choices: tuple[str, ...] = ()
    least: int | None = None
    most: int | None = None
    many: bool = False
    protocol: str = ""

    def __post_init__(self) -> None:
        name = self.name or self.flag.partition("/")[0].lstrip("-").replace("-", "_")
        object.__setattr__(self, "name", name)


def option(
    flag: str,
    help: str,
    of: Any = None,
    *,
    default: Any = None,
    required: bool = False,
    **told: Any,
) -> Any:
    """Return a field of a dataclass that stands for an option.

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
    ...     speed: float = option("--wind-speed", "How fast it blows.", default=0.0, unit="m/s")
    >>> Wind().speed, options_of(Wind)["speed"].name
    (0.0, 'wind_speed')
    """
    if of is None:
        declared = Option(flag=flag, help=help, default=default, **told)
        return field(default=MISSING if required else default, metadata={"option": declared})
    of.option = Option(flag=flag, help=help, default=of.default, **told)
    return of


def options_of(*kinds: type) -> Mapping[str, Option]:
    """Return the options of the fields of dataclasses, by the names of the fields.

    Examples
    --------
    >>> from ptcc_certify.protocols.moving_leaders import MovingLeaders
    >>> {name: told.flag for name, told in options_of(MovingLeaders).items()}
    {'speed': '--leader-speed', 'sign_gain': '--sign-gain'}
    """
    found = {}
    for kind in kinds:
        for one in fields(kind):
            own = inspect.getattr_static(kind, one.name, MISSING)
            told = getattr(own, "option", None) or one.metadata.get("option")
            if told is not None:
                found[one.name] = told
    return found
