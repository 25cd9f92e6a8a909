"""Options of click, and keys of scenarios, from the fields that declare them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from typing import Any, ClassVar

import click

from ptcc_certify.errors import ParameterError, PTCCError, did_you_mean
from ptcc_certify.gain_design.request import DesignRequest
from ptcc_certify.graphs.declared_option import Option, options_of
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import OPTIONAL, PREJUDICE, STUBBORN, UNCERTAINTY, Reading
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, Expectations, GainLimits, InitialState, Run
from ptcc_certify.model.constrained_switching import CLOCK_DWELL, ClockShares, DwellTime, JointWindows
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

Decorator = Callable[[Any], Any]

#: What the command line and scenarios alone have.
FILE = Option(flag="", help="", key="graph.file", example='"fig1b"', name="graph")
SIGNAL = Option(
    flag="--signal",
    help="Families: mode and weights change at any instants, or are fixed and unknown.",
    key="graph.signal",
    example='"any"',
    choices=("any", "constant"),
    default="any",
)
KIND = Option(
    flag="--protocol",
    help="Nominal, or sliding mode, which disturbances within delta do not move.",
    key="protocol.kind",
    example='"nominal"',
    name="kind",
    choices=("nominal", "sliding-mode"),
    default="nominal",
)
DIMENSION = Option(
    flag="--dimension",
    help="Agents: coordinates of space; --x0 agent after agent.",
    key="initial_state.dimension",
    least=1,
    most=1000,
)
A0 = Option(
    flag="--a0 STATE", help="Agents of order 3: initial accelerations.", key="agents.a0", example='"0"', shown="0"
)
SHORTEST = Option(
    flag="--shortest-deadline",
    help=".. or for the shortest one.",
    key="design.shortest_deadline",
    example="true",
    kind="flag",
)
#: What makes a family of graphs, and for which signals something is asked of it.
OF_FAMILIES = (
    UNCERTAINTY,
    OPTIONAL,
    SIGNAL,
    options_of(DwellTime)["least"],
    CLOCK_DWELL,
    *options_of(JointWindows, ClockShares).values(),
)
#: Everything that is declared, in the order of the sections and keys of a scenario.
DECLARED = (
    FILE,
    *options_of(Reading).values(),
    STUBBORN,
    *OF_FAMILIES,
    KIND,
    *options_of(NominalProtocol, SlidingModeProtocol, Agents, InitialState).values(),
    A0,
    PREJUDICE,
    *options_of(Run, Asks).values(),
    DIMENSION,
    *options_of(GainLimits, LateMessages, MovingLeaders, Expectations, DesignRequest).values(),
    SHORTEST,
)
#: Options of one protocol alone, by its kind: a flag that chooses the other one leaves such keys out.
OF_PROTOCOL = {
    "nominal": ("T", *(told.name for told in options_of(GainLimits).values()), "noise"),
    "sliding-mode": ("T_r", "T_s", "mu1", "mu2", "mu3", "sigma0", "disturbance", "boundary_layer"),
}
#: What commands call the fields of the library that they call otherwise.
IN_LIBRARY = {"initial_state": "x0", "initial": "x0"}
IN_LIBRARY |= {field: told.name for field, told in options_of(MovingLeaders, LateMessages, Expectations, Asks).items()}
_FLAGS = {told.name: told.word for told in DECLARED}


def names_of(*kinds: type) -> tuple[str, ...]:
    """Return what commands call the options of dataclasses.

    Examples
    --------
    >>> names_of(MovingLeaders)
    ('leader_speed', 'sign_gain', 'growth', 'saturation')
    """
    return tuple(told.name for told in options_of(*kinds).values())


def options_asking(names: Iterable[str]) -> tuple[str, ...]:
    """Return what commands call the options by which parts of a case, or what it asks, are given.

    Examples
    --------
    >>> options_asking(["initial_set", "leaders"])
    ('initial_bound', 'leader_speed', 'sign_gain', 'growth', 'saturation')
    """
    parts = {"messages": LateMessages, "leaders": MovingLeaders, "limits": GainLimits}
    given = (names_of(parts[name]) if name in parts else (IN_LIBRARY.get(name, name),) for name in names)
    return tuple(chain.from_iterable(given))


def given_of(kind: type, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the options give of a dataclass, by its fields.

    Examples
    --------
    >>> given_of(MovingLeaders, {"leader_speed": "1/2", "sign_gain": None, "T": "1"})
    {'speed': '1/2'}
    """
    given = {field: options.get(told.name) for field, told in options_of(kind).items()}
    return {field: value for field, value in given.items() if value is not None}


def flag_of(name: str) -> str:
    """Return the flag of an option.

    Examples
    --------
    >>> flag_of("leader_speed"), flag_of("kind"), flag_of("workers")
    ('--leader-speed', '--protocol', '--workers')
    """
    return _FLAGS.get(name) or f"--{name.replace('_', '-')}"


def exact_number(text: str, flag: str) -> Fraction:
    """Return the exact number that a text of an option stands for."""
    from ptcc_certify.graphs.rationals import decimal_mend, parse_exact

    try:
        return parse_exact(text)
    except PTCCError as error:
        times = {told.word for told in DECLARED if told.unit == "time"}
        such = "a number in your unit of time, such as 0.001" if flag in times else "a number such as 0.5"
        raise ParameterError(f"{flag}: {error}; {decimal_mend(text, f'give {such}')}") from None


def _exact(context: click.Context, parameter: click.Parameter, text: str | None) -> Fraction | None:
    """Return the exact number that an option gives, None if it was not given."""
    return None if text is None or context.resilient_parsing else exact_number(text, parameter.opts[0])


def click_option(told: Option, **changes: Any) -> Decorator:
    """Return the option of click that is declared, with the changes that one command makes."""
    callback, hidden = changes.pop("callback", None), changes.pop("hidden", False)
    told = replace(told, **changes)
    of_one = any(told.name in names for names in OF_PROTOCOL.values())
    shown = told.shown or (str(told.default) if told.kind == "parameter" and of_one else "")
    more: dict[str, Any] = {"help": told.help, "hidden": hidden, "callback": callback, "metavar": told.metavar}
    if shown:
        more["help"] += f"  [default: {shown}]"
    elif not told.many and told.default is not None:
        more["default"] = told.default if told.kind in ("count", "choice", "switch") else str(told.default)
    if told.kind == "number":
        more["callback"] = callback or _exact
    elif told.kind == "parameter":
        more["metavar"] = "NUMBER"
    elif told.kind == "choice":
        more["type"] = click.Choice(list(told.choices), case_sensitive=False)
    elif told.kind == "count":
        more["type"] = click.IntRange(told.least, told.most)
    elif told.kind == "float":
        more["type"] = float
    elif told.kind == "switch":
        more |= {"default": told.default, "show_default": False}
    return click.option(
        told.flag.partition(" ")[0],
        told.name,
        multiple=told.many,
        is_flag=True if told.kind == "flag" else None,
        **more,
    )


def options_for(*kinds: type, asked: bool = False, **changes: Any) -> Decorator:
    """Return one decorator for the options of dataclasses; nothing is given by default where something is ``asked``."""
    declared = list(options_of(*kinds).values())
    if asked:
        declared = [told if told.kind == "switch" else replace(told, default=None) for told in declared]
    return together(*(click_option(told, **changes) for told in declared))


def one_of(kind: type, name: str, **changes: Any) -> Decorator:
    """Return the option of one field."""
    return click_option(options_of(kind)[name], **changes)


def together(*decorators: Decorator) -> Decorator:
    """Return one decorator of several, which adds their options in this order."""

    def apply(function: Any) -> Any:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return apply


# ---------------------------------------------------------------------- help


#: What the sections of a scenario are about.
TITLES = {
    "graph": "Who listens to whom.",
    "protocol": "The protocol and its parameters; exact: 0.1 is 1/10, and 1/3 is written as a text.",
    "initial_state": "Where the agents begin: a list in node order, { label = value }, a CSV file, or random.",
    "agents": "Agents of order n, their first velocities, and a formation.",
    "disturbance": "What disturbs the agents.",
    "limits": "Limits of the gain (nominal protocol).",
    "messages": "Messages that arrive late, get lost or are rounded.",
    "leaders": "Leaders that move (nominal protocol).",
    "expectations": "What is asked: exit code 3 if it is refuted, 4 if it is left open.",
    "certificate": "How it is proved.",
    "simulation": "How ptcc simulate runs it.",
    "design": "What ptcc design asks, beside max_input and initial_bound.",
}
#: The topics of the help, in its order, and what they are about: sections of a scenario, families, and the rest.
TOPICS = {
    "graph": TITLES["graph"],
    "families": "Families of graphs, uncertain weights, and their signals.",
    **TITLES,
    "captured": "Agents that show what they like.",
    "files": "What is printed and written, and where the work is done.",
}
_TOPIC = {told.name: told.key.partition(".")[0] for told in DECLARED} | {told.name: "families" for told in OF_FAMILIES}
_TOPIC |= dict.fromkeys(("captured", "radius"), "captured")


def _show_help(context: click.Context, parameter: click.Parameter, topic: str | None) -> None:
    """Print what ``--help``, ``--help TOPIC`` and ``--help-all`` ask for, and end."""
    if topic is None or context.resilient_parsing:
        return
    command: Any = context.command
    click.echo(command.get_help(context) if parameter is HELP_ALL else command.help_about(context, topic))
    context.exit()


_OF_HELP: dict[str, Any] = {"is_eager": True, "expose_value": False, "callback": _show_help}
HELP = click.Option(
    ["-h", "--help"],
    is_flag=False,
    flag_value="",
    metavar="[TOPIC]",
    help="Show this message, or the options of a topic.",
    **_OF_HELP,
)
HELP_ALL = click.Option(["--help-all"], flag_value="all", help="Show all options.", **_OF_HELP)


class Command(click.Command):
    """A command whose help shows few options first, and the others by topics."""

    #: What is shown first. Commands of few options show all at once.
    first: ClassVar[tuple[str, ...]] = (
        *("kind", "T", "rho1", "rho2", "kappa", "x0", "seed", "edges", "switching", "expect", "what", "stdlib"),
        *("verified", "workers", "restart", "output", "as_json", "verbose", "port", "no_browser"),
    )
    few: ClassVar[int] = 17

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        """Return ``--help``, which takes a topic where there are many options."""
        return HELP if len(self.params) > self.few else super().get_help_option(ctx)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return all parameters, ``--help`` and ``--help-all`` at the end."""
        params = super().get_params(ctx)
        return [*params, HELP_ALL] if HELP in params else params

    def rows_of_help(self, ctx: click.Context) -> dict[str, list[tuple[str, str]]]:
        """Return the options by topics, in the order of the help; those shown first are under ``""``.

        Examples
        --------
        >>> command = Command("sail", params=[click.Option([flag]) for flag in ("--T", "--delay", "--log")])
        >>> list(command.rows_of_help(click.Context(command)))
        ['', 'messages', 'files']
        """
        rows: dict[str, list[tuple[str, str]]] = {topic: [] for topic in ("", *TOPICS)}
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx) if isinstance(parameter, click.Option) else None
            if row is not None:
                name, of_help = parameter.name or "", not parameter.expose_value
                rows["" if of_help or name in self.first else _TOPIC.get(name, "files")].append(row)
        return {topic: found for topic, found in rows.items() if found}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write all options: few first, the others by topics."""
        for topic, rows in self.rows_of_help(ctx).items():
            with formatter.section(_title(topic)):
                formatter.write_dl(rows)

    def help_about(self, ctx: click.Context, topic: str = "") -> str:
        """Return what ``--help`` prints of a topic; without one the options shown first, and the topics.

        A word that cannot be a topic, such as the file in ``--help graph.csv``, is an argument of the command.
        """
        from ptcc_certify.graphs.io.packaged import GRAPHS

        rows = self.rows_of_help(ctx)
        topics = [name for name in rows if name]
        letters = {flag for parameter in self.params for flag in parameter.opts}
        if all(f"-{letter}" in letters for letter in topic):
            topic = ""  # flags of one letter in one word, as in -hv
        if topic not in topics and topic.isidentifier() and topic not in GRAPHS:
            near = did_you_mean(topic, topics)
            raise ParameterError(f'--help: there is no topic "{shorten(topic)}"{near}; topics: {", ".join(topics)}')
        formatter = ctx.make_formatter()
        self.format_usage(ctx, formatter)
        if topic in topics:
            with formatter.section(_title(topic)):
                formatter.write_dl(rows[topic])
            return formatter.getvalue().rstrip()
        formatter.write_paragraph()
        text, example, more = inspect.cleandoc(self.help or "").partition("\n\nFor example: ")
        with formatter.indentation():
            formatter.write_text(text + example + more.partition("\n\n")[0])
        with formatter.section("Options"):
            formatter.write_dl(rows[""], col_max=20)
        with formatter.section(f"More options by topic, {ctx.command_path} --help TOPIC"):
            formatter.write_dl([(name, _title(name)) for name in topics])
        return formatter.getvalue().rstrip()


def _title(topic: str) -> str:
    """Return the line of a topic."""
    return re.split("[.:;]", TOPICS.get(topic, "Options"))[0]
