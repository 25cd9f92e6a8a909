"""Scenario files: graph, protocol, initial state, limits and expectations in one TOML file.

Every key is an option of some command, in a section of its own kind (:data:`SECTIONS`); a command takes those that are
its options and leaves the others to the commands that have them. Flags override the file.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ptcc_certify.cli.click_options import DECLARED, FILE, IN_LIBRARY, OF_PROTOCOL, TITLES, names_of
from ptcc_certify.cli.terminal import SCENARIO
from ptcc_certify.errors import FormatError, ParameterError, PTCCError, did_you_mean
from ptcc_certify.graphs.declared_option import Option
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import OPTIONAL, UNCERTAINTY
from ptcc_certify.graphs.recognised_files import TOML, kind_of, refuse_as_graph
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

#: Largest file, in bytes.
MAX_BYTES = 1_000_000
#: Where the scenario of a call is kept: ``context.meta[MEMORY]``.
MEMORY = "ptcc_certify.scenario"
#: Commands for which it does not matter what the agents are.
_OF_THE_GRAPH_ALONE = ("classify", "check")
#: Where the context of its command is kept.
COMMAND = "ptcc_certify.command"


def _keys(section: str) -> dict[str, Option]:
    """Return the options of a section by their keys."""
    declared = (told for told in DECLARED if told.key.partition(".")[0] == section)
    return {told.key.partition(".")[2]: told for told in declared}


#: The sections: what they are about, and of each key the option that it stands for.
SECTIONS = {section: (title, _keys(section)) for section, title in TITLES.items()}
#: Keys that make a family of a graph.
OF_FAMILIES = (UNCERTAINTY.name, OPTIONAL.name)
#: Options of late messages and moving leaders.
BESIDE = names_of(LateMessages, MovingLeaders)


@dataclass(frozen=True)
class Scenario:
    """A scenario file.

    Attributes
    ----------
    path : str
        As it was named.
    sections : mapping
        As the file has them: numbers that are no integers are texts.
    options : mapping of str to Any
        What it gives, by the names of the commands' parameters; ``graph`` is found from here, a list of several.
    """

    path: str
    sections: Mapping[str, Mapping[str, Any]]
    options: Mapping[str, Any]

    @property
    def graph(self) -> str:
        """The graph, as a command takes it; the first of several."""
        return self.graphs[0]

    @property
    def graphs(self) -> tuple[str, ...]:
        """The graphs, as commands take them: several are the modes of a family."""
        files = self.options["graph"]
        return (files,) if isinstance(files, str) else tuple(files)

    def place(self, option: str) -> str:
        """Return where an option stands in the file: ``scenario.toml: [protocol] T``."""
        for section, (_, keys) in SECTIONS.items():
            for key, told in keys.items():
                if told.name == option:
                    return f"{self.path}: [{section}] {key}"
        return self.path

    def document(self) -> dict[str, Any]:
        """Return what a certificate records of it, as JSON: numbers as texts, exact."""
        return {"file": Path(self.path).name, **_texts(self.sections)}


def read_scenario(path: str) -> Scenario:
    r"""Read a scenario file.

    Parameters
    ----------
    path : str
        A TOML file of at most :data:`MAX_BYTES`; paths in it are relative to its folder.

    Returns
    -------
    Scenario

    Raises
    ------
    FormatError
        No file, too large, no TOML, or no scenario.
    ParameterError
        A section or a key is unknown, or a value is of another kind; the message names file, section and key.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "team.toml")
    ...     _ = file.write_text('[graph]\nfile = "fig1a"\n[protocol]\nT = 0.6\n[initial_state]\nx0 = [1, 2.5, -3]')
    ...     scenario = read_scenario(str(file))
    >>> scenario.graph, scenario.options["T"], scenario.options["x0"]
    ('fig1a', '0.6', '1,2.5,-3')
    """
    name, folder = shorten(path, 200), Path(path).parent
    sections = _parsed(path, name)
    options: dict[str, Any] = {}
    for section, keys in sections.items():
        known = SECTIONS[section][1]
        for key, value in keys.items():
            place = f"{name}: [{section}] {shorten(key)}"
            if key not in known:
                hint = _where(key) or did_you_mean(key, known) or f"; there are {', '.join(known)}"
                raise ParameterError(f"{place}: no such key{hint}")
            told = known[key]
            if told.kind == "numbers":
                options[told.name] = _numbers(value if isinstance(value, list) else [value], place)
            elif told.kind == "state":
                options[told.name] = _state(value, folder, place)
            elif told is FILE and isinstance(value, list):
                options[told.name] = _texts_of(value, place, '["day.csv", "night.csv"]') or None
            else:
                options[told.name] = _value(value, told.example, place)
    files = options.get("graph")
    if not isinstance(files, str | list):
        raise ParameterError(
            f'{name}: [graph] file: names no graph; write file = "graph.csv" or a packaged one, "fig1a"'
        )
    options["graph"] = _beside(files, folder) if isinstance(files, str) else [_beside(one, folder) for one in files]
    return Scenario(name, sections, options)


def _parsed(path: str, name: str) -> dict[str, dict[str, Any]]:
    """Return the sections of a file, or refuse it."""
    from ptcc_certify.graphs.io.files import parse_toml

    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise FormatError(f"{name}: cannot be read ({(error.strerror or str(error)).lower()})") from None
    if len(data) > MAX_BYTES:
        raise FormatError(f"{name}: more than {MAX_BYTES} bytes; give a long initial state as a CSV file")
    sections = parse_toml(data, name, str)
    if {"count", "nodes"} <= set(sections):
        raise FormatError(f"{name}: describes random graphs, not a scenario; ptcc batch takes it")
    if not any(isinstance(sections.get(section), dict) for section in SECTIONS):
        raise FormatError(f"{name}: TOML, but not a scenario: it has none of the sections; ptcc new writes a scenario")
    for section, keys in sections.items():
        if section not in SECTIONS:
            what = "section" if isinstance(keys, dict) else "key outside of a section"
            hint = did_you_mean(section, SECTIONS) if isinstance(keys, dict) else _where(section)
            hint = hint or f"; there are {', '.join(SECTIONS)}"
            raise ParameterError(f"{name}: [{shorten(section)}]: no such {what}{hint}")
        if not isinstance(keys, dict):
            raise ParameterError(f"{name}: [{section}]: is a section; write its keys below [{section}]")
    return sections


def _texts(value: Any) -> Any:
    """Return TOML with its integers as texts."""
    if isinstance(value, dict):
        return {key: _texts(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_texts(part) for part in value]
    return value if isinstance(value, bool) else str(value)


def _where(key: str) -> str:
    """Return in which section a key is, for one that stands in another; nothing if there is no such key."""
    homes = [section for section, (_, keys) in SECTIONS.items() if key in keys]
    return f"; it belongs to [{homes[0]}]" if homes else ""


def _texts_of(value: list[Any], place: str, example: str) -> list[str]:
    """Return a list of texts."""
    if not all(isinstance(text, str) for text in value):
        raise ParameterError(f"{place}: write a list of texts, such as {example}")
    return value


def _numbers(value: list[Any], place: str) -> str:
    """Return a list of numbers as an option takes it."""
    if not all(isinstance(x, int | str) and not isinstance(x, bool) for x in value):
        raise ParameterError(f"{place}: write a list of numbers, such as [0, 0.1]")
    return ",".join(map(str, value))


def _value(value: Any, example: str, place: str) -> Any:
    """Return a value as an option takes it: true or false, or a text."""
    if example.startswith("["):
        return _texts_of(value if isinstance(value, list) else [value], place, example)
    wanted = example in ("true", "false")
    if isinstance(value, bool) != wanted or not isinstance(value, bool | int | str):
        kind = "true or false" if wanted else "a text" if example.startswith('"') else "a number"
        raise ParameterError(f"{place}: write {kind}, such as {example}")
    return value if isinstance(value, bool) else str(value)


def _state(value: Any, folder: Path, place: str) -> str:
    """Return an initial state as ``--x0`` takes it."""
    if isinstance(value, str):
        path = folder / value
        is_list = value == "random" or any(sign in value for sign in ",=") or value.replace(".", "").isdecimal()
        return value if is_list and not os.path.isfile(path) else str(path)  # noqa: PTH113 - Path.is_file may raise
    entries = list(value.items()) if isinstance(value, dict) else value if isinstance(value, list) else [value]
    texts = []
    for entry in entries:
        label, number = entry if isinstance(entry, tuple) else (None, entry)
        if isinstance(number, bool) or not isinstance(number, int | str):
            raise ParameterError(f"{place}: write a list of numbers, {{ label = value, .. }}, a CSV file or random")
        texts.append(str(number) if label is None else f"{label}={number}")
    row = io.StringIO()
    csv.writer(row, lineterminator="").writerow(texts)
    return row.getvalue()


def _beside(text: str, folder: Path) -> str:
    """Return a path relative to the folder of the scenario; a packaged graph, and standard input, by name."""
    from ptcc_certify.graphs.io.packaged import GRAPHS, graph_path

    path = folder / text
    if text == "-" or text not in GRAPHS or path.is_file():
        return text if text == "-" else str(path)
    return text if kind_of(text) in ("missing", "a folder") else str(graph_path(text))  # not the file of this folder


# ---------------------------------------------------------------------- in a command


def is_scenario(graph: str) -> bool:
    """Tell whether what is given for a graph is a scenario file: a name that ends in .toml."""
    return graph.lower().endswith(".toml")


def graph_of(context: click.Context, parameter: click.Parameter, graph: Any) -> Any:
    """Return the graph of a command, or its graphs; of a scenario those, after the command has the options it gives.

    The callback of every GRAPH; these are eager, so that options find their defaults here.
    """
    given = graph if isinstance(graph, tuple) else (graph,)
    named = [path for path in given if is_scenario(path)]
    if context.resilient_parsing or not named:
        return graph
    if len(given) > 1:
        raise ParameterError(f"{shorten(named[0], 200)}: a scenario stands alone; let its key file list the graphs")
    scenario = _scenario_of(named[0])
    context.meta.update({MEMORY: scenario, COMMAND: context, SCENARIO: named[0]})
    accepted = {parameter.name for parameter in context.command.params}
    if "agents" not in accepted and context.command.name not in _OF_THE_GRAPH_ALONE:
        for key in ("agents", "offsets", "biases"):
            if scenario.options.get(key) not in (None, "integrator", "1"):
                why = (
                    f"ptcc {context.command.name} takes single integrators; ptcc certify, simulate and plot take others"
                )
                raise ParameterError(f"{scenario.place(key)}: {why}")
    if context.command.name == "design":
        refuse_beside(scenario, context.command.name)
    if "x0" in accepted and "dimension" not in accepted and scenario.options.get("dimension", "1") != "1":
        why = f"ptcc {context.command.name} takes scalar agents; what is proved of one component holds for each"
        raise ParameterError(f"{scenario.place('dimension')}: {why}: leave it out, and let x0 be one component")
    families = [key for key in OF_FAMILIES if key in scenario.options]
    if len(scenario.graphs) > 1:
        families.insert(0, "graph")
    if families and "switching" not in accepted:
        raise ParameterError(f"{scenario.place(families[0])}: {takes_one_graph(context.command.name)}")
    context.default_map = {name: value for name, value in scenario.options.items() if name in accepted}
    context.default_map |= {"switching": True} if len(scenario.graphs) > 1 else {}
    kind_of_protocol(context, None, context.params.get("kind"))
    return scenario.graphs if isinstance(graph, tuple) else scenario.graph


def _scenario_of(path: str) -> Scenario:
    """Return the scenario of a file, or refuse it, or a graph that it names."""
    from ptcc_certify.graphs.io.packaged import GRAPHS

    if kind_of(path) not in TOML:
        refuse_as_graph(path)
    scenario = read_scenario(path)
    for one in scenario.graphs:
        if one not in ("-", *GRAPHS):
            try:
                refuse_as_graph(one)
            except FormatError as error:
                raise FormatError(f"{scenario.place('graph')}: {error}") from None
    return scenario


def refuse_beside(scenario: Scenario | None, command: str) -> None:
    """Refuse late messages and moving leaders of a scenario where they would be left out without a word."""
    if scenario is None:
        return
    for option in BESIDE:
        if scenario.options.get(option) not in (None, False):
            what, figure = "late messages", "late"
            if option in names_of(MovingLeaders):
                what, figure = "leaders that move" if option in ("leader_speed", "sign_gain") else option, "tracking"
            mend = f"ptcc certify -o c.json proves it, ptcc plot c.json --what {figure} runs it"
            raise ParameterError(f"{scenario.place(option)}: ptcc {command} does not take {what}; {mend}")


def takes_one_graph(name: str | None) -> str:
    """Return what a command says to a family of graphs.

    Examples
    --------
    >>> takes_one_graph("design")
    'ptcc design takes one graph; a family (several graphs, uncertain weights) is for ptcc classify, certify, ...'
    """
    where = "a family (several graphs, uncertain weights) is for ptcc classify, certify, simulate, plot, check"
    return f"ptcc {name} takes one graph; {where}"


def kind_of_protocol(context: click.Context, parameter: click.Parameter | None, kind: str | None) -> str | None:
    """Return the protocol; one that a flag chooses leaves the scenario's keys of the other one out.

    The callback of ``--protocol``; eager, as GRAPH is, in whichever order they are given.
    """
    if kind is not None and context.get_parameter_source("kind") is ParameterSource.COMMANDLINE:
        left_out = {name for other, names in OF_PROTOCOL.items() for name in names if other != kind}
        context.default_map = {k: v for k, v in (context.default_map or {}).items() if k not in left_out}
    return kind


def scenario_record() -> dict[str, Any] | None:
    """Return what the certificate of this call records of its scenario, with the flags that override it."""
    context = click.get_current_context()
    scenario: Scenario | None = context.meta.get(MEMORY)
    if scenario is None:
        return None
    given = [name for name in scenario.options if name in context.params and name != "graph"]
    flags = [name for name in given if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]
    return scenario.document() | {"overridden": {name: str(context.params[name]) for name in flags}}


def places_of(options: Iterable[str]) -> list[str]:
    """Return where the scenario of this call gives some of these options: ``plant.toml: [limits] gain_cap``."""
    scenario: Scenario | None = click.get_current_context().meta.get(MEMORY)
    return [] if scenario is None else [scenario.place(name) for name in options if name in scenario.options]


def placed(context: click.Context, error: PTCCError | click.BadParameter) -> Exception:
    """Return an error with the place in the scenario from which the value came, if it is of one."""
    scenario: Scenario | None = context.meta.get(MEMORY)
    if scenario is None:
        return error
    if isinstance(error, click.BadParameter):
        option, text = (error.param.name if error.param else None) or "", error.message
    else:
        text, option = str(error), error.field
        option = IN_LIBRARY.get(option, option)
        if text.startswith("--"):  # of a command itself
            flag, _, text = text.partition(" ")
            option = flag.strip("-:").replace("-", "_")
            text = text.removeprefix("= ")
    if context.meta[COMMAND].get_parameter_source(option) is ParameterSource.DEFAULT_MAP:
        return ParameterError(f"{scenario.place(option)}: {text}")
    return error
