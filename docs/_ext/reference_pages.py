"""The pages of the reference, from what the packages export: nothing is listed twice, nothing is left out."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from typing import Any

import lmi
import ptcc_certify
from ptcc_certify.cli import cli

#: The rooms of ``ptcc_certify`` in the order of their use: title, and modules whose further names are listed too.
ROOMS = {
    "graphs": (
        "Graphs and their structure",
        "graphs.digraph graphs.io graphs.structure graphs.frustration graphs.ensembles",
    ),
    "model": (
        "What is asked of what: protocols, agents, messages, disturbances",
        "model model.gain model.disturbance model.reaching_time model.asks",
    ),
    "certificate": (
        "Certificates",
        "certificate.certificate certificate.assessment certificate.fact",
    ),
    "checker": ("The independent check", "certificate.checking checker"),
    "bounds": (
        "Bounds: error, final state, input",
        "bounds.envelope bounds.final_state.of_graph bounds.final_state.captured bounds.input.effort "
        "bounds.input.initial_sets bounds.input.worst_initial_state",
    ),
    "simulation": ("Simulation", "simulation.trajectory"),
    "theorems": (
        "Theorems and lemmas",
        "theorems.claims theorems.table theorems.theorem theorems.lemmas theorems.casadi_lyapunov",
    ),
    "gain_design": (
        "Design of gains and deadlines",
        "gain_design.answer gain_design.search gain_design.deadline_search",
    ),
    "batch": ("Many graphs", "batch"),
    "report": ("Pages, statements, figures", "report.explorer"),
    "examples": ("Examples of the paper, and of others", "examples examples.published"),
    "errors": ("Errors", "errors"),
}


def heading(text: str, line: str) -> str:
    """Return a heading of reStructuredText."""
    return f"{text}\n{line * len(text)}\n\n"


def entries(module: str, names: list[str]) -> str:
    """Return a table of names, and below it all that their docstrings say."""
    things = {f"{module}.{name}": getattr(import_module(module), name) for name in names}
    table = "".join(f"   ~{name}\n" for name in things)
    return f".. autosummary::\n   :nosignatures:\n\n{table}\n" + "".join(map(entry, things, things.values()))


def entry(name: str, thing: Any) -> str:
    """Return the directive that prints a docstring."""
    if inspect.isclass(thing):
        kind = "exception" if issubclass(thing, Exception) else "class"
        return f".. auto{kind}:: {name}\n   :members:\n   :member-order: bysource\n\n"
    return f".. auto{'function' if callable(thing) else 'data'}:: {name}\n\n"


def exported(package: Any) -> dict[str, list[str]]:
    """Return the public names of a package by the module within it that defines them."""
    modules: dict[str, list[str]] = {}
    for name, module in package._EXPORTS.items():
        modules.setdefault(module.removeprefix(f"{package.__name__}."), []).append(name)
    return modules


def further_names(module_name: str) -> list[str]:
    """Return classes and functions of a module that ``ptcc_certify`` does not export and whose docstring has parts."""
    module = import_module(module_name)
    flat = [getattr(ptcc_certify, name) for name in ptcc_certify._EXPORTS]
    return [
        name
        for name, thing in vars(module).items()
        if (inspect.isclass(thing) or inspect.isfunction(thing))
        and not name.startswith("_")
        and (thing.__module__ == module_name or name in getattr(module, "__all__", ()))
        and "\n    ---" in (thing.__doc__ or "")
        and not any(thing is other for other in flat)
    ]


def room_page(title: str, exports: dict[str, list[str]], modules: list[str]) -> str:
    """Return the page of a room: what ``import ptcc_certify`` offers of it, then its further names."""
    functions = {name: getattr(ptcc_certify, name) for names in exports.values() for name in names}
    page = heading(title, "=") + entries("ptcc_certify", [name for name, thing in functions.items() if callable(thing)])
    for module, names in exports.items():
        page += "".join(entry(f"ptcc_certify.{module}.{name}", 0) for name in names if not callable(functions[name]))
    for module in modules:
        if names := further_names(f"ptcc_certify.{module}"):
            page += heading(f"Further names of ``ptcc_certify.{module}``", "-") + entries(
                f"ptcc_certify.{module}", names
            )
    return page


def lmi_page() -> str:
    """Return the page of ``lmi``: every name, module by module, under the first line of its module."""
    page = heading("``lmi``: Lyapunov matrices of any real matrix", "=")
    for module, names in exported(lmi).items():
        first = (inspect.getdoc(import_module(f"lmi.{module}")) or module).splitlines()[0]
        page += heading(first.rstrip("."), "-") + entries("lmi", names)
    return page


def command_page() -> str:
    """Return the page of the command line: all options of every command."""
    page = "# Command line\n\nWhat `ptcc --help` and `ptcc COMMAND --help` print; of many options `--help-all`.\n"
    group = cli.make_context("ptcc", [], resilient_parsing=True, max_content_width=100)
    for name in ("", *cli.list_commands(group)):
        command = cli.get_command(group, name) if name else cli
        assert command is not None
        context = command.make_context(name, [], parent=group, resilient_parsing=True) if name else group
        page += f"\n## {context.command_path}\n\n```text\n{command.get_help(context)}\n```\n"
    return page


def write_reference(folder: Path) -> None:
    """Write a page for every room, one for ``lmi``, and one for the command line."""
    exports = exported(ptcc_certify)
    if homeless := {module for module in exports if module.partition(".")[0] not in ROOMS}:
        raise LookupError(f"no page of the reference for {homeless}; add their rooms to ROOMS")
    folder.mkdir(exist_ok=True)
    for room, (title, modules) in ROOMS.items():
        own = {module: names for module, names in exports.items() if module.partition(".")[0] == room}
        (folder / f"{room}.rst").write_text(room_page(title, own, modules.split()), encoding="utf-8")
    (folder / "lmi.rst").write_text(lmi_page(), encoding="utf-8")
    (folder / "command_line.md").write_text(command_page(), encoding="utf-8")
